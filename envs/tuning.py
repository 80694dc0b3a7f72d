"""The Gymnasium environment of a job of moves with a choice of speed, ramp and start-stop frequency before each.

reset   a new twin is switched on and makes its reference run
step    action -> Settings -> commands of a host -> result of the move -> observation, reward
"""

from __future__ import annotations

import dataclasses
import math
from collections import OrderedDict
from collections.abc import Mapping
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import NDArray

from isel_twin.core.state import TwinState
from isel_twin.core.twin import Twin
from isel_twin.envs import moves
from isel_twin.envs.moves import JOB, Job, Move, Settings, Setup
from isel_twin.language import Ranges, create_language, needed
from isel_twin.machine import Machine

if TYPE_CHECKING:
    from isel_twin.plant.picture import Picture

_SIZE = 15
_MOST_KEPT = 16  # seeds whose machines are kept (envs/1)


def to_settings(action: NDArray[np.floating[Any]], ranges: Ranges | None = None) -> Settings:
    """Settings of an action, three finite numbers (else ValueError), clipped to -1 .. 1, over a controller's ranges;
    None: those of the default controller.

    The speed is linear, the others are geometric (envs/2). What the controller does not have stays as it is.
    """
    ranges = _default_ranges() if ranges is None else ranges
    values = np.asarray(action, dtype=np.float64)
    if values.shape != (3,) or not np.isfinite(values).all():
        raise ValueError(f"action is {action!r}; it must be three finite numbers from -1 to 1")
    speed, acceleration, start_stop = (np.clip(values, -1.0, 1.0) + 1.0) / 2.0
    slowest, fastest = ranges["speed_hz"]
    ramps = {"acceleration_hz_per_ms": acceleration, "start_stop_hz": start_stop}
    return Settings(
        speed_hz=round(slowest + speed * (fastest - slowest)),
        **{name: _geometric(part, *ranges[name]) for name, part in ramps.items() if name in ranges},
    )


def to_action(settings: Settings, ranges: Ranges | None = None) -> NDArray[np.float32]:
    """float32 [3], the action for these settings with a controller of these ranges; None: the default controller's. 0
    for what the controller does not have."""
    ranges = _default_ranges() if ranges is None else ranges
    parts = [_linear(settings.speed_hz, *ranges["speed_hz"])]
    for name in ("acceleration_hz_per_ms", "start_stop_hz"):
        parts.append(_logarithmic(getattr(settings, name), *ranges[name]) if name in ranges else 0.5)
    return np.array([2.0 * part - 1.0 for part in parts], dtype=np.float32)


@cache
def _default_ranges() -> Ranges:
    return needed(create_language(Setup.controller), Setup.controller).ranges


def _geometric(part: float, low: int, high: int) -> int:
    return round(low * (high / low) ** part)


def _linear(value: int, low: int, high: int) -> float:
    return (value - low) / (high - low) if high > low else 0.0


def _logarithmic(value: int, low: int, high: int) -> float:
    return math.log(value / low) / math.log(high / low) if high > low else 0.0


@dataclass(frozen=True, eq=False)
class Episode:
    """An episode between two moves: `JobTuning.save`. It can be pickled."""

    twin: TwinState
    setup: Setup
    made: int  # moves
    time_s: float
    over: bool


class JobTuning(gymnasium.Env[NDArray[np.float64], NDArray[np.float32]]):
    """
    ## Description
    A gantry with stepper motors has to make a job, a list of moves, as fast as it can without losing a step. Before
    each move the agent chooses speed, acceleration and start-stop frequency; they go to an emulated controller as the
    commands of a host program, and its step stream drives motors, screws and structure. All axes move together, the
    speed is that of the axis with the most steps. After the move the machine stands for `settle_s` and is measured. The
    controller has no feedback: it does not notice lost steps, and later moves then end in the wrong place, or in a
    limit switch.

    ## Action Space
    A `Box(-1, 1, (3,), float32)`. Speed is linear in the action because time goes with its inverse; the two others are
    geometric, equal differences in the action being equal ratios. `to_settings` and `to_action` convert. The space
    spans what the controller takes, `JobTuning.ranges`; the numbers are those of the default controller.

    | Num | Action                      | at -1 | at 0  | at +1 | Scale     | Unit  | Command |
    |-----|-----------------------------|-------|-------|-------|-----------|-------|---------|
    | 0   | speed of the leading axis   | 30    | 20015 | 40000 | linear    | Hz    | `@0M`   |
    | 1   | acceleration                | 1     | 63    | 4000  | geometric | Hz/ms | `@0J`   |
    | 2   | start-stop frequency        | 20    | 283   | 4000  | geometric | Hz    | `@0j`   |

    ## Observation Space
    A `Box(-Inf, Inf, (15,), float64)`, all of it at rest, after the last move. Position error is true carriage position
    minus counter; lost steps are counted at the rotor since the reference run.

    | Num   | Observation                                                    | Unit  |
    |-------|----------------------------------------------------------------|-------|
    | 0-2   | way of the next move by the counters, X Y Z; 0 after the last  | mm    |
    | 3-5   | position error X Y Z                                           | mm    |
    | 6-8   | lost steps X Y Z; fractions are load angle                     | steps |
    | 9-11  | residual vibration X Y Z: half of the range during the dwell   | mm    |
    | 12    | duration of the last move                                      | s     |
    | 13    | settling time of the last move                                 | s     |
    | 14    | moves still to be made                                         | 1     |

    ## Rewards
    The unit is the second. The reward of a step is the sum of these terms, each also in `info` under its name:
    - *reward_time*: minus the time from command to reply.
    - *reward_settling*: minus the time from the reply until the position error of all axes stays within `tolerance_mm`
      (at most `settle_s`).
    - *reward_lost_steps*: minus `lost_steps_penalty` if a motor has slipped in this move.
    - *reward_tolerance*: minus `tolerance_penalty` if an axis is outside `tolerance_mm` at the end of the dwell.
    - *reward_abort*: minus `abort_penalty` if the controller refused the move or broke it off (limit switch, stop,
      fault, speed refused) or the time limit did.

    `abort_penalty` should exceed the time of a whole job, or aborting would pay.

    `info` also has `settings` (a `Settings`), `reply`, `slipped`, `deviation_mm` (largest position error from command
    to end of the dwell) and `time_s` (virtual time of all moves so far, standstill not counted).

    ## Starting State
    The twin has just been switched on with its carriages at a random place, $\\mathcal{U}[1, 3]$ mm off the motor-end
    switches, and has made a reference run there: the counters are 0. Place, repeatability of the switches and bounce
    come from the seed; everything else is the same in every episode. Same seed and same actions: same bits.

    ## Episode End
    ### Termination
    1. The job is done: the controller has made every move.
    2. It refused a move or broke one off; `info["reply"]` says why, of the default controller: "2" limit switch, "F"
       stop, "9" fault, "H" hood, "D" speed refused. One whose replies do not tell shows a fault (`twin.fault`).

    Lost steps do not end an episode: the controller does not know of them (envs/3).
    ### Truncation
    The moves have taken `time_limit_s` of virtual time and the job is not done.

    ## Arguments
    ```python
    import gymnasium, isel_twin.envs
    env = gymnasium.make("isel_twin/JobTuning-v0", overrides={"payload.mass": 8.0})
    ```

    | Parameter            | Type            | Default    | Description                                            |
    |----------------------|-----------------|------------|--------------------------------------------------------|
    | `job`                | list of (x,y,z) | `JOB`      | targets in mm from the reference point                 |
    | `machine`            | str, path       | `"4030"`   | machine of the package or folder of a user's own       |
    | `controller`         | str             | `"imc-s8"` | any controller with a language                         |
    | `plant`              | str             | `"mujoco"` | `"kinematic"`: nothing is ever lost, for trying out    |
    | `overrides`          | dict            | none       | machine parameters to change: payload, supply, ...     |
    | `scenario`           | path            | none       | timed events, see `isel_twin.wiring.scenario`          |
    | `load_nm`            | float           | `0.0`      | extra drag torque at the shaft of every axis            |
    | `tolerance_mm`       | float           | `0.05`     | allowed position error at rest                         |
    | `settle_s`           | float           | `0.2`      | standstill after each move                             |
    | `time_limit_s`       | float           | `120.0`    | virtual time for the whole job, standstill not counted |
    | `lost_steps_penalty` | float           | `20.0`     | s                                                      |
    | `tolerance_penalty`  | float           | `10.0`     | s                                                      |
    | `abort_penalty`      | float           | `200.0`    | s                                                      |
    | `render_mode`        | str             | none       | `"rgb_array"`: a picture of the machine as it stands   |

    ## Version History
    * v0: Initial version.
    """

    metadata = {"render_modes": ["rgb_array"], "render_fps": 2}  # noqa: RUF012  (the base class declares it so)

    def __init__(
        self,
        job: Job = JOB,
        machine: str | Path | Machine = "4030",
        controller: str = "imc-s8",
        plant: str = "mujoco",
        overrides: Mapping[str, Any] | None = None,
        scenario: str | Path | None = None,
        load_nm: float = 0.0,
        tolerance_mm: float = 0.05,
        settle_s: float = 0.2,
        time_limit_s: float = 120.0,
        lost_steps_penalty: float = 20.0,
        tolerance_penalty: float = 10.0,
        abort_penalty: float = 200.0,
        render_mode: str | None = None,
    ) -> None:
        """Raises ValueError with one line for a wrong argument; the machine is built by `reset`."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"unknown render_mode {render_mode!r}; there is: rgb_array")
        self.action_space = Box(-1.0, 1.0, (3,), np.float32)
        self.observation_space = Box(-np.inf, np.inf, (_SIZE,), np.float64)
        self.render_mode = render_mode
        # The twin of this episode; the next one may reuse it, unless it is observed or recorded.
        self.twin: Twin | None = None
        changes = dict(overrides or {})
        self.setup = Setup(
            job, machine, controller, plant, 0, changes, scenario, load_nm, tolerance_mm, settle_s, time_limit_s
        )
        self.ranges: Ranges = moves.spoken(self.setup).ranges  # range of the action space (envs/6)
        self._penalties = lost_steps_penalty, tolerance_penalty, abort_penalty
        self._made, self._time_s, self._over = 0, 0.0, True
        self._picture: Picture | None = None
        self._begun: OrderedDict[int, TwinState] = OrderedDict()  # by seed, after the reference run

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Switch a twin on and let it make its reference run. Machine and scenario are read by the first reset.

        options: {"job": ...} gives this and all later episodes another job.
        """
        super().reset(seed=seed)
        changes = dict(options or {})
        if not changes.keys() <= {"job"}:
            raise ValueError(f"unknown options {sorted(changes.keys() - {'job'})}; there is: job")
        twin_seed = int(self.np_random.integers(1 << 32))
        self.setup = dataclasses.replace(self.setup, seed=twin_seed, **changes)
        self.twin = self._referenced(kept=seed is not None)
        self._made, self._time_s, self._over = 0, 0.0, False
        error_mm = self.twin.position_mm - self.twin.counts[:3] / self._steps_per_mm
        return self._observation(error_mm, self.twin.lost_steps[:3], np.zeros(3), 0.0, 0.0), {}

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Make the next move. Raises ResetNeeded if the episode is over, ValueError for an invalid action."""
        if self.twin is None or self._over:
            raise gymnasium.error.ResetNeeded("the job is over; call reset() before step()")
        settings = to_settings(action, self.ranges)
        left_s = self.setup.time_limit_s - self._time_s
        move = moves.make_move(self.twin, self.setup.job[self._made], settings, self.setup, left_s)
        self._time_s += move.time_s
        self._made += move.done
        refused = not move.done and move.reply != ""
        terminated = self._made == len(self.setup.job) or refused
        truncated = not terminated and self._time_s >= self.setup.time_limit_s
        self._over = terminated or truncated
        rewards = self._rewards(move)
        observation = self._observation(move.error_mm, move.lost_steps, move.vibration_mm, move.time_s, move.settling_s)
        info = {
            **rewards,
            "settings": settings,
            "reply": move.reply,
            "slipped": move.slipped,
            "deviation_mm": move.deviation_mm,
            "margin": move.margin,
            "edge": move.edge,
            "time_s": self._time_s,
        }
        return observation, math.fsum(rewards.values()), terminated, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """uint8 [480, 640, 3], the machine; None unless render_mode is "rgb_array". RuntimeError without OpenGL."""
        if self.render_mode is None:
            return None
        if self.twin is None:
            raise gymnasium.error.ResetNeeded("there is no machine yet; call reset() before render()")
        if self._picture is None:
            from isel_twin.plant.picture import Picture

            self._picture = Picture(self.twin.machine)
        return self._picture.draw(self.twin.machine_position_mm)

    def close(self) -> None:
        """Close the renderer."""
        if self._picture is not None:
            self._picture.close()
            self._picture = None

    def save(self) -> Episode:
        """The episode between two moves, for `restore`, so that a search can go on from here any number of times.

        Raises ResetNeeded before the first reset, StateError for a controller that cannot be saved.
        """
        if self.twin is None:
            raise gymnasium.error.ResetNeeded("there is no episode yet; call reset() before save()")
        return Episode(self.twin.save(), self.setup, self._made, self._time_s, self._over)

    def restore(self, episode: Episode) -> None:
        """Continue a saved episode, here or in an environment with the same arguments (else ValueError)."""
        if dataclasses.replace(self.setup, seed=episode.setup.seed, job=episode.setup.job) != episode.setup:
            raise ValueError("the episode is of another setup; restore it into an environment with the same arguments")
        if self.twin is None:
            self.twin = moves.new_twin(episode.setup)
        elif self.twin.followed:
            self.twin = self.twin.another(episode.setup.seed)
        self.twin.restore(episode.twin)
        self.setup, self._made, self._time_s = episode.setup, episode.made, episode.time_s
        self._over = episode.over

    def __getstate__(self) -> dict[str, Any]:
        state = {**vars(self), "_picture": None, "_begun": OrderedDict()}
        state["twin"] = None if self.twin is None else self.twin.save()
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        vars(self).update(state)
        saved = state["twin"]
        if saved is not None:
            self.twin = moves.new_twin(self.setup)
            self.twin.restore(saved)

    def _referenced(self, kept: bool) -> Twin:
        """The twin of a new episode after its reference run; for a seed that was kept, its state at that time."""
        setup, twin = self.setup, self.twin
        state = self._begun.get(setup.seed)
        if twin is None or state is None:
            twin = moves.referenced_twin(setup, like=twin)
            if kept:
                self._begun[setup.seed] = twin.save()
                if len(self._begun) > _MOST_KEPT:
                    self._begun.popitem(last=False)
            return twin
        moves.check_job(setup.job, twin.machine)
        if twin.followed:  # an observer of the last episode must not see this one
            twin = twin.another(setup.seed)
        twin.restore(state)
        return twin

    @property
    def _steps_per_mm(self) -> NDArray[np.float64]:
        assert self.twin is not None
        return np.array([axis.steps_per_mm for axis in self.twin.machine.axes])

    def _rewards(self, move: Move) -> dict[str, float]:
        outside = bool((np.abs(move.error_mm) > self.setup.tolerance_mm).any())
        lost_steps, tolerance, abort = self._penalties
        return {
            "reward_time": -move.time_s,
            "reward_settling": -move.settling_s,
            "reward_lost_steps": -lost_steps * move.slipped,
            "reward_tolerance": -tolerance * outside,
            "reward_abort": -abort * (not move.done),
        }

    def _observation(
        self,
        error_mm: NDArray[np.float64],
        lost_steps: NDArray[np.float64],
        vibration_mm: NDArray[np.float64],
        time_s: float,
        settling_s: float,
    ) -> NDArray[np.float64]:
        assert self.twin is not None
        to_make = len(self.setup.job) - self._made
        here_mm = self.twin.counts[:3] / self._steps_per_mm
        way_mm = np.array(self.setup.job[self._made]) - here_mm if to_make else np.zeros(3)
        return np.concatenate([way_mm, error_mm, lost_steps, vibration_mm, [time_s, settling_s, float(to_make)]])
