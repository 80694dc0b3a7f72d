"""Many TrackPath-v0 side by side: a step of all of them is one compiled call for each thread.

    envs = gymnasium.make_vec("isel_twin.envs:isel_twin/TrackPath-v0", num_envs=64, path="random")

        actions [n, 3] --->  thread 0: environments 0 .. k    step, step, ...   no Python, no lock
                             thread 1: environments k+1 ..    ...
                       --->  observations [n, 35], rewards [n], ...

Each environment gives the same bits as alone: the same step on the same arrays (tracking.c), by their addresses. The
environments make their resets themselves, one after the other.
"""

from __future__ import annotations

import itertools
import os
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import gymnasium
import numpy as np
from gymnasium.vector import AutoresetMode, VectorEnv
from gymnasium.vector.utils import batch_space
from numpy.typing import ArrayLike, NDArray

from isel_twin.envs.track import TrackPath, ended, infos
from isel_twin.envs.tracking import IDLE, LANE, PLACE, SIZE, TRACK
from isel_twin.envs.wrappers import AlongPath, Randomised
from isel_twin.native import core
from isel_twin.plant.memory import AXES

_TIME = -1  # instead of a result of a step: the time is over


class TrackVector(VectorEnv[NDArray[np.float64], NDArray[np.float32], Any]):
    """A vector of TrackPath-v0. Spaces, calls and infos are those of Gymnasium's own vector environments. An
    environment whose episode is over is reset, with the options of the last `reset`: by the next step, which ignores
    its action (`AutoresetMode.NEXT_STEP`), or by the step that has ended it (SAME_STEP): then its last observation and
    info are `final_obs` and `final_info` of the infos.
    """

    def __init__(
        self,
        num_envs: int = 1,
        workers: int | None = None,
        randomised: Mapping[str, Sequence[float]] | None = None,
        along: Mapping[str, float] | None = None,
        autoreset_mode: AutoresetMode | str = AutoresetMode.NEXT_STEP,
        max_episode_steps: int | None = None,
        **options: Any,
    ) -> None:
        """options: those of TrackPath. workers: threads, None: the number of processors. max_episode_steps: as in
        `gymnasium.make`; an episode ends by "time" then, too.

        randomised, along: arguments of the wrappers Randomised and AlongPath, {} for its defaults; None: without it.
        Raises ValueError with one line for a wrong argument.
        """
        super().__init__()
        if num_envs < 1:
            raise ValueError(f"num_envs is {num_envs}; give at least 1")
        if workers is not None and workers < 1:
            raise ValueError(f"workers is {workers}; give at least 1")
        if max_episode_steps is not None and max_episode_steps < 1:
            raise ValueError(f"max_episode_steps is {max_episode_steps}; give at least 1")
        autoreset = AutoresetMode(autoreset_mode)
        if autoreset is AutoresetMode.DISABLED:
            raise ValueError("autoreset_mode is 'Disabled'; there are: 'NextStep', 'SameStep'")
        tracks = [TrackPath(**options) for _ in range(num_envs)]
        envs: list[gymnasium.Env[Any, Any]] = list(tracks)
        if randomised:
            envs = [Randomised(env, **randomised) for env in envs]
        self._along = 0.0, 0.0  # `feed_mm_s` and `offset_mm`
        if along is not None:
            led = [AlongPath(env, **along) for env in envs]
            self._along = led[0].feed_mm_s, led[0].offset_mm
            envs = list(led)
        self.envs = tuple(envs)  # for inspection; do not step them
        self._tracks = tracks
        self.num_envs = num_envs
        self.single_observation_space = tracks[0].observation_space
        self.single_action_space = envs[0].action_space
        self.observation_space = batch_space(self.single_observation_space, num_envs)
        self.action_space = batch_space(self.single_action_space, num_envs)
        self.metadata = {**tracks[0].metadata, "autoreset_mode": autoreset}
        self._same_step = autoreset is AutoresetMode.SAME_STEP
        self.render_mode = tracks[0].render_mode
        self._track = np.zeros(num_envs, TRACK)
        self._lanes = np.zeros((num_envs, AXES), LANE)
        for k, track in enumerate(tracks):
            track.keep_in(self._track[k : k + 1], self._lanes[k])
        self._places = np.zeros(num_envs, PLACE)
        self._most_steps = max_episode_steps
        self._left = np.zeros(num_envs, np.int64)  # steps until the time is over, 0: the episode is over
        self._begun = False
        self._options: dict[str, Any] | None = None
        many = min(workers or os.cpu_count() or 1, num_envs)
        ends = np.linspace(0, num_envs, many + 1).astype(int).tolist()
        self._stretches = list(itertools.pairwise(ends))
        self._pool = ThreadPoolExecutor(many - 1, "isel-twin-tracks") if many > 1 else None

    def reset(
        self, *, seed: int | list[int | None] | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin all episodes. seed: of the first, with successive ones for the others; or one for each."""
        n = self.num_envs
        seeds = [seed + i for i in range(n)] if isinstance(seed, int) else [None] * n if seed is None else seed
        if len(seeds) != self.num_envs:
            raise ValueError(f"{len(seeds)} seeds for {self.num_envs} environments")
        self._options = options
        observations = np.empty((self.num_envs, SIZE))
        for k, own in enumerate(seeds):
            observations[k] = self._begin(k, own)
        self._begun = True
        return observations, self._infos(np.zeros(self.num_envs, np.int64))

    def step(
        self, asked: ArrayLike
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_], NDArray[np.bool_], dict[str, Any]]:
        """Make a step in each. Raises ResetNeeded before the first reset, ValueError for invalid actions."""
        if not self._begun:
            raise gymnasium.error.ResetNeeded("call reset() before step()")
        values = np.array(asked, np.float64, order="C")
        if values.shape != self.action_space.shape or not np.isfinite(values).all():
            raise ValueError(f"actions must be finite numbers, shape {self.action_space.shape}")
        observations = np.empty((self.num_envs, SIZE))
        idle = self._left == 0
        overs = np.where(idle, IDLE, 0)
        actions = np.empty((self.num_envs, AXES)) if self._along[0] > 0.0 else values
        arguments: tuple[Any, ...] = (self._places, *self._along, values, actions, observations, overs)
        if self._pool is None:
            core.take_steps(*arguments, 0, self.num_envs)
        else:
            others = [self._pool.submit(core.take_steps, *arguments, *ends) for ends in self._stretches[1:]]
            try:
                core.take_steps(*arguments, *self._stretches[0])  # meanwhile
            finally:
                for done in others:
                    done.result()
        track = self._track
        rewards = track["reward_progress"] + track["reward_time"] + track["reward_deviation"] + track["reward_abort"]
        self._left -= ~idle
        overs[idle] = 0
        truncated = (overs == 0) & (self._left == 0) & ~idle
        self._left[overs > 0] = 0
        terminated, overs = overs > 0, np.where(truncated, _TIME, overs)
        if self._same_step:
            return observations, rewards, terminated, truncated, self._begin_over(observations, overs)
        for k in np.flatnonzero(idle):
            observations[k] = self._begin(int(k), None)
            rewards[k] = 0.0
        return observations, rewards, terminated, truncated, self._infos(overs)

    def render(self) -> tuple[Any, ...] | None:
        return tuple(track.render() for track in self._tracks)

    def close_extras(self, **_: Any) -> None:
        """End threads, close renderers."""
        for track in self._tracks:
            track.close()
        if self._pool is not None:
            self._pool.shutdown()

    def _begin(self, k: int, seed: int | None) -> NDArray[np.float64]:
        observation, _ = self.envs[k].reset(seed=seed, options=self._options)
        self._places[k] = self._tracks[k].place[0]
        steps = self._tracks[k].steps_left
        self._left[k] = steps if self._most_steps is None else min(steps, self._most_steps)
        return observation

    def _begin_over(self, observations: NDArray[np.float64], overs: NDArray[np.int64]) -> dict[str, Any]:
        """Begin anew those that are over, observations [n, SIZE] included; the infos, final ones among them."""
        finals: dict[str, Any] = {}
        for k in np.flatnonzero(overs).tolist():
            info = {name: float(value) for name, value in infos(self._track[k]).items()}
            final = {"final_obs": observations[k].copy(), "final_info": {**info, "ended": ended(int(overs[k]))}}
            finals = self._add_info(finals, final, k)
            observations[k] = self._begin(k, None)
        return {**self._infos(np.zeros_like(overs)), **finals}

    def _infos(self, overs: NDArray[np.int64]) -> dict[str, Any]:
        """Infos in the form of Gymnasium's vector environments. overs: results of the step, or _TIME."""
        everyone = np.ones(self.num_envs, dtype=np.bool_)
        said: dict[str, Any] = {}
        for name, value in infos(self._track).items():
            said[name], said[f"_{name}"] = np.array(value, np.float64), everyone.copy()
        if overs.any():
            said["ended"] = np.array([ended(int(over)) if over else None for over in overs], dtype=object)
            said["_ended"] = overs != 0
        return said
