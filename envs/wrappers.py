"""Wrappers that make the environments easier to learn. Each raises ValueError with one line for an unsuitable
environment.

Scaled        JobTuning-v0 with observations within -1 .. 1
Randomised    TrackPath-v0 on another machine in every episode
AlongPath     TrackPath-v0 by feed and offset from the path instead of step frequencies
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from gymnasium.utils import RecordConstructorArgs
from numpy.typing import NDArray

from isel_twin.envs.track import TrackPath
from isel_twin.envs.tuning import JobTuning
from isel_twin.envs.variations import VARIATIONS, varied
from isel_twin.machine import Machine, load_machine, with_overrides

_DRAWS = 0x5242  # separates the random numbers of `Randomised` from the environment's of the same seed

Observations = gymnasium.Env[NDArray[np.float64], NDArray[np.float32]]


class Scaled(gymnasium.ObservationWrapper[NDArray[np.float64], NDArray[np.float32], NDArray[np.float64]],
             RecordConstructorArgs):  # fmt: skip
    """JobTuning-v0 with observations within a `Box(-1, 1, (15,), float64)`.

    Bounded values are divided by their bounds. Others are compressed: x / (|x| + u) is 1/2 at u, almost x / u far below
    it, and tends to 1, so that micrometres stay visible beside errors of millimetres.

    | Num   | Observation                    | Scaled                | Unit u                                       |
    |-------|--------------------------------|-----------------------|----------------------------------------------|
    | 0-2   | way of the next move X Y Z     | x / u                 | travel of the axis                           |
    | 3-5   | position error X Y Z           | x / (abs(x) + u)      | `tolerance_mm`                               |
    | 6-8   | lost steps X Y Z               | x / (abs(x) + u)      | two full steps: from there on they are lost  |
    | 9-11  | residual vibration X Y Z       | x / (abs(x) + u)      | `tolerance_mm`                               |
    | 12    | duration of the last move      | x / (abs(x) + u)      | 1 s                                          |
    | 13    | settling time of the last move | x / u                 | `settle_s`                                   |
    | 14    | moves still to be made         | x / u                 | moves of the job                             |
    """

    def __init__(self, env: Observations) -> None:
        RecordConstructorArgs.__init__(self)
        super().__init__(env)
        tuning = env.unwrapped
        if not isinstance(tuning, JobTuning):
            raise ValueError(f"Scaled is for isel_twin/JobTuning-v0, not for {type(tuning).__name__}")
        self._tuning = tuning
        setup = tuning.setup
        loaded = setup.machine if isinstance(setup.machine, Machine) else load_machine(setup.machine)
        axes = with_overrides(loaded, setup.overrides).axes
        self.observation_space = Box(-1.0, 1.0, (15,), np.float64)
        self._bent = np.zeros(15, dtype=np.bool_)
        self._bent[3:13] = True
        self._units = np.concatenate(
            [
                [axis.travel_mm for axis in axes],
                [setup.tolerance_mm] * 3,
                [0.5 * axis.slip_steps for axis in axes],
                [setup.tolerance_mm] * 3,
                [1.0, setup.settle_s, 1.0],
            ]
        )

    def observation(self, observation: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [15], scaled."""
        units = self._units.copy()
        units[14] = len(self._tuning.setup.job)
        scaled: NDArray[np.float64] = observation / (units + np.where(self._bent, np.abs(observation), 0.0))
        return scaled.clip(-1.0, 1.0)


class Randomised(gymnasium.Wrapper[NDArray[np.float64], NDArray[np.float32], NDArray[np.float64], NDArray[np.float32]],
                 RecordConstructorArgs):  # fmt: skip
    """TrackPath-v0 on another machine in every episode: payload, friction, ... drawn evenly from ranges.

        track = gymnasium.make("isel_twin.envs:isel_twin/TrackPath-v0")
        env = Randomised(track, payload_kg=(0, 8), friction=(0.7, 1.5))

    Options of `reset` override the random ones, which are in `info["randomised"]` of `reset`. The seed determines them;
    two policies with the same seed get the same machines.
    """

    def __init__(self, env: Observations, **ranges: Sequence[float]) -> None:
        """ranges: by name of an option (isel_twin.envs.variations.VARIATIONS), lowest and highest value."""
        constructed: dict[str, Any] = dict(ranges)
        RecordConstructorArgs.__init__(self, **constructed)
        super().__init__(env)
        if not isinstance(env.unwrapped, TrackPath):
            raise ValueError(f"Randomised is for isel_twin/TrackPath-v0, not for {type(env.unwrapped).__name__}")
        for name, bounds in ranges.items():
            if name not in VARIATIONS:
                raise ValueError(f"unknown range {name!r}; there are: {', '.join(VARIATIONS)}")
            low, high = VARIATIONS[name]
            if len(bounds) != 2 or not low <= bounds[0] <= bounds[1] <= high:
                raise ValueError(f"range {name} is {bounds!r}; allowed: two numbers from {low:g} to {high:g}, in order")
            for end in bounds:  # refuse it now, not in some episode
                varied(env.unwrapped.machine, {name: float(end)})
        self._ranges: Mapping[str, Sequence[float]] = {name: ranges[name] for name in VARIATIONS if name in ranges}
        self._random: np.random.Generator | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        if seed is not None:
            self._random = np.random.default_rng([seed, _DRAWS])
        elif self._random is None:
            self._random = np.random.default_rng([int(self.unwrapped.np_random.integers(1 << 32)), _DRAWS])
        drawn = {name: float(self._random.uniform(bounds[0], bounds[1])) for name, bounds in self._ranges.items()}
        observation, info = self.env.reset(seed=seed, options={**drawn, **(options or {})})
        return observation, {**info, "randomised": drawn}


class AlongPath(gymnasium.Wrapper[NDArray[np.float64], NDArray[np.float32], NDArray[np.float64], NDArray[np.float32]],
                RecordConstructorArgs):  # fmt: skip
    """TrackPath-v0 by feed and offset: even an untrained agent follows the path.

    A `Box(-1, 1, (4,), float32)`. The target of the counters at the end of a step is a point that moves along the path
    at the feed, plus the offset; the step frequencies follow from it.

    | Num | Action                                         | at -1      | at 0          | at 1        | Unit |
    |-----|------------------------------------------------|------------|---------------|-------------|------|
    | 0   | feed: speed of the point along the path        | 0          | half of it    | `feed_mm_s` | mm/s |
    | 1-3 | offset of the counters from that point X Y Z   | -offset_mm | 0             | `offset_mm` | mm   |

    The observation is that of TrackPath-v0.
    """

    def __init__(self, env: Observations, feed_mm_s: float = 40.0, offset_mm: float = 0.03) -> None:
        RecordConstructorArgs.__init__(self, feed_mm_s=feed_mm_s, offset_mm=offset_mm)
        super().__init__(env)
        track = env.unwrapped
        if not isinstance(track, TrackPath):
            raise ValueError(f"AlongPath is for isel_twin/TrackPath-v0, not for {type(track).__name__}")
        for name, value in (("feed_mm_s", feed_mm_s), ("offset_mm", offset_mm)):
            if not 0.0 < value <= 1e3:
                raise ValueError(f"{name} is {value!r}; allowed: more than 0, up to 1000")
        self._track = track
        self.feed_mm_s, self.offset_mm = feed_mm_s, offset_mm
        self.action_space = Box(-1.0, 1.0, (4,), np.float32)

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float64], Any, bool, bool, dict[str, Any]]:
        """Make a step. Raises ValueError for anything but four finite numbers."""
        values = np.asarray(action, dtype=np.float64)
        if values.shape != (4,) or not np.isfinite(values).all():
            raise ValueError(f"action is {action!r}; it must be four finite numbers from -1 to 1")
        return self.env.step(self._track.aim(values, self.feed_mm_s, self.offset_mm))
