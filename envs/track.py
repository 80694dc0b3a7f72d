"""The Gymnasium environment of set points: a few milliseconds of step frequency for each axis, along a path.

reset   the machine stands at the start of the path, stages on, with the payload, friction, ... of this episode
step    action -> pulses -> drives and machine -> position of the tool -> observation, reward     (tracking.c)

The agent replaces the controller. `reset` rebuilds only a changed machine, and even then not its model
(`isel_twin.plant.model.load_model`) (envs/7).
"""

from __future__ import annotations

import math
import time
from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any

import gymnasium
import numpy as np
from gymnasium.spaces import Box
from numpy.typing import ArrayLike, NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.envs.paths import lay_path, sampled
from isel_twin.envs.tracking import LANE, OUTSIDE, PLACE, REWARDS, SIZE, STEPS_LOST, TRACK, place_of
from isel_twin.envs.variations import VARIATIONS, checked, limits_rad_s, varied
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.native import core
from isel_twin.plant.model import load_model
from isel_twin.plant.mujoco import MujocoPlant
from isel_twin.plant.picture import has_screen

if TYPE_CHECKING:
    from isel_twin.plant.picture import Picture, Window

_SETTLING_NS = 100_000_000  # from power-on to the start: time for the rotors to come to rest
_CLEAR_MM = 1.0  # a path keeps this far from the ends of the travel
_NEAR = 6.0  # the camera's distance from the tool, over the size of the first path


class TrackPath(gymnasium.Env[NDArray[np.float64], NDArray[np.float32]]):
    """
    ## Description
    A gantry with stepper motors has to lead its tool along a path, as fast as it can without leaving it and without
    losing a step. Every `step_s` the agent gives each axis a step frequency; the pulses go to power stages, motors,
    screws and structure. The agent must learn what a controller does with ramps, corner speeds and input shaping:
    between its counter and the tool are the load angle of the motor, backlash, friction and an elastic frame.

    ## Action Space
    A `Box(-1, 1, (3,), float32)`: the step frequencies until the next step, over `highest_hz`; values outside are
    clipped. Frequencies change at once: a jump that the motor cannot follow loses steps. Pulses are evenly spaced, also
    from one step to the next.

    | Num | Action                  | Min | Max | Unit       | at 1, defaults         |
    |-----|-------------------------|-----|-----|------------|------------------------|
    | 0   | step frequency of X     | -1  | 1   | highest_hz | 16 kHz, 50 mm/s        |
    | 1   | step frequency of Y     | -1  | 1   | highest_hz | 16 kHz, 50 mm/s        |
    | 2   | step frequency of Z     | -1  | 1   | highest_hz | 16 kHz, 50 mm/s        |

    ## Observation Space
    A `Box(-1, 1, (35,), float64)`. Values outside are clipped. P: the nearest point of the path to the tool.
    The tool is where a gauge between tool and table would see it, backlash, load angle and the frame's deflection
    included. A real controller knows 6-8 and, with the nearest point to its counters for P, 12-14 and 18-34; a machine
    with scales on its axes almost all of it.

    | Num   | Observation                                                       | Min | Max | Unit                |
    |-------|-------------------------------------------------------------------|-----|-----|---------------------|
    | 0-2   | tool minus P, X Y Z                                               | -1  | 1   | tolerance_mm        |
    | 3-5   | speed of the tool X Y Z                                           | -1  | 1   | that of highest_hz  |
    | 6-8   | step frequency X Y Z in the last step                             | -1  | 1   | highest_hz          |
    | 9-11  | load angle X Y Z: counter minus rotor                             | -1  | 1   | two full steps      |
    | 12-14 | counter minus P, X Y Z                                            | -1  | 1   | 2 tolerance_mm      |
    | 15-17 | least pull-out margin X Y Z in the last step                      | 0   | 1   | torque there is     |
    | 18-20 | point of the path 0.5 mm ahead of P, minus P, X Y Z               | -1  | 1   | 0.5 mm              |
    | 21-23 | 1 mm ahead                                                        | -1  | 1   | 1 mm                |
    | 24-26 | 2 mm ahead                                                        | -1  | 1   | 2 mm                |
    | 27-29 | 4 mm ahead                                                        | -1  | 1   | 4 mm                |
    | 30-32 | 8 mm ahead; beyond the end of the path: its end                   | -1  | 1   | 8 mm                |
    | 33    | part of the path that is still ahead                              | 0   | 1   | length of the path  |
    | 34    | part of the time that is left                                     | 0   | 1   | time_limit_s        |

    ## Rewards
    The unit is the millimetre of path. The reward of a step is the sum of these terms, each also in `info`:
    - *reward_progress*: the distance that the nearest point has moved along the path, mm, but no more than the tool
      has moved in that direction; backwards is negative.
    - *reward_time*: minus `time_weight` times the time of the step.
    - *reward_deviation*: minus `deviation_weight` times the time of the step, times the square of the deviation over
      the tolerance.
    - *reward_abort*: minus `abort_penalty` if steps were lost or the tool has left the tolerance.

    A whole path gives its length less its costs. `abort_penalty` should exceed the cost of standing still
    (`time_weight` times `time_limit_s`), or aborting would pay.

    `info` also has `way_mm` (how far along the path), `deviation_mm` (of the tool from the path, the largest of looks
    every 2 ms; or, if it is above the tolerance, of a point of the path that was passed over from the tool's way),
    `time_s` (since the start), `edge` (the least factor on the speed of any motor in the last step until it swings
    itself out of step, inf at rest), and at the end of an episode `ended`: "done", "outside", "lost steps" or "time".

    ## Starting State
    The machine stands at the start of the path, stages on, at rest: in the middle of its travel, or as near to it as
    the path has room. Its counters are off the path by $\\mathcal{U}[-1, 1]$ times `reference_mm` in each coordinate,
    as after a reference run. The seed determines that, and a random path; everything else is the same in every episode.
    The same seed, options and actions give the same bits, whatever came before.

    Options of `reset` hold for one episode (envs/9); a wrong one is refused with one line:

    | Option       | Allowed       | Unit | Description                                                      |
    |--------------|---------------|------|------------------------------------------------------------------|
    | `payload_kg` | 0 .. 20       | kg   | dead weight on the table, in the place of the machine's          |
    | `friction`   | 0.1 .. 10     | 1    | factor of guide friction and drag of the shafts                  |
    | `stiffness`  | 0.2 .. 1.2    | 1    | factor of the screws' stiffness and of the structure's springs   |
    | `supply`     | 0.5 .. 1.5    | 1    | factor of the stages' supply                                     |
    | `backlash`   | 0 .. 10       | 1    | factor of the backlash                                           |
    | `path`       | see Arguments |      | another path                                                     |

    A factor that takes a number out of its range in machine files is also refused. The wrapper `Randomised` draws them
    for every episode.

    ## Episode End
    ### Termination
    1. Done: no frequency is above 300 Hz, and for 20 ms the tool has been within the tolerance of the end of the path
       and no rotor more than a full step from its counter.
    2. Out of tolerance: `deviation_mm` is above `tolerance_mm`.
    3. Lost steps: counter and rotor of an axis are two full steps apart or more, where the motor pulls no longer.
    ### Truncation
    `time_limit_s` of virtual time is over.

    ## Rendering
    `rgb_array` is a picture of the machine with the path on its table; `human` shows it in a window of MuJoCo's viewer,
    in real time at most. Either needs OpenGL, the window a screen; without, one line says so, and without a screen
    the environment's `metadata` has no "human".

    ## Arguments
    ```python
    import gymnasium
    env = gymnasium.make("isel_twin.envs:isel_twin/TrackPath-v0", path="circle", overrides={"payload.mass": 8.0})
    ```

    | Parameter          | Type          | Default    | Description                                                  |
    |--------------------|---------------|------------|--------------------------------------------------------------|
    | `path`             | str or points | `"square"` | "corner", "square", "circle", "random", or [n, 2 or 3] mm    |
    | `machine`          | str, path     | `"4030"`   | machine of the package or folder of a user's own             |
    | `overrides`        | dict          | none       | machine parameters to change, see `isel-twin describe`       |
    | `step_s`           | float         | `0.002`    | time of a step, multiple of the machine's MuJoCo step        |
    | `highest_hz`       | float         | `16000.0`  | step frequency at action 1                                   |
    | `tolerance_mm`     | float         | `0.1`      | allowed deviation of the tool from the path                  |
    | `reference_mm`     | float         | `0.01`     | by how much counters may be off the path at the start        |
    | `time_limit_s`     | float         | `5.0`      | virtual time of an episode                                   |
    | `time_weight`      | float         | `10.0`     | mm a second                                                  |
    | `deviation_weight` | float         | `20.0`     | mm a second                                                  |
    | `abort_penalty`    | float         | `100.0`    | mm                                                           |
    | `render_mode`      | str           | none       | `"human"` or `"rgb_array"`                                   |

    An environment can be pickled and copied at any time, in the middle of an episode as well, and goes on from there to
    the bit.

    ## Version History
    * v0: Initial version.
    """

    metadata = {"render_modes": ["human", "rgb_array"], "render_fps": 500}  # noqa: RUF012  (the base class has it so)

    def __init__(
        self,
        path: str | ArrayLike = "square",
        machine: str | Path | Machine = "4030",
        overrides: Mapping[str, Any] | None = None,
        step_s: float = 0.002,
        highest_hz: float = 16_000.0,
        tolerance_mm: float = 0.1,
        reference_mm: float = 0.01,
        time_limit_s: float = 5.0,
        time_weight: float = 10.0,
        deviation_weight: float = 20.0,
        abort_penalty: float = 100.0,
        render_mode: str | None = None,
    ) -> None:
        """Raises ValueError (MachineError) with one line for a wrong argument."""
        if render_mode not in (None, *self.metadata["render_modes"]):
            raise ValueError(f"unknown render_mode {render_mode!r}; there are: human, rgb_array")
        loaded = machine if isinstance(machine, Machine) else load_machine(machine)
        self.machine = with_overrides(loaded, overrides or {})  # the machine without options of `reset`
        servo = [axis.name for axis in self.machine.axes if axis.closed_loop]
        if servo:
            raise ValueError(
                f"{self.machine.file}: axes.{servo[0]} has a servo drive; TrackPath-v0 is for stepper motors"
            )
        grid_ns = self.machine.timing.mujoco_step_ns
        step_ns = round(step_s * 1e9) if math.isfinite(step_s) else 0
        if step_ns % grid_ns or not 0 < step_ns <= 100_000_000:
            raise ValueError(f"step_s is {step_s!r}; allowed: multiples of {grid_ns * 1e-9:g} s up to 0.1 s")
        for name, value, low, high in (
            ("highest_hz", highest_hz, 100.0, 200_000.0),
            ("tolerance_mm", tolerance_mm, 1e-3, 10.0),
            ("reference_mm", reference_mm, 0.0, 0.9 * tolerance_mm / math.sqrt(3.0)),
            ("time_limit_s", time_limit_s, step_s, 1e4),
            ("time_weight", time_weight, 0.0, 1e6),
            ("deviation_weight", deviation_weight, 0.0, 1e6),
            ("abort_penalty", abort_penalty, 0.0, 1e9),
        ):
            if not low <= value <= high:
                raise ValueError(f"{name} is {value!r}; allowed: {low:g} to {high:g}")
        self.action_space = Box(-1.0, 1.0, (3,), np.float32)
        least = np.full(SIZE, -1.0)
        least[[15, 16, 17, SIZE - 2, SIZE - 1]] = 0.0
        self.observation_space = Box(least, np.ones(SIZE), dtype=np.float64)
        self.render_mode = render_mode
        modes = self.metadata["render_modes"] if has_screen() else ["rgb_array"]
        self.metadata = {"render_modes": modes, "render_fps": round(1e9 / step_ns)}
        self.step_s = step_ns * 1e-9  # time of a step
        self._path = path
        self._reference_mm = reference_mm
        lay_path(path, np.random.default_rng(0))  # refuse it now

        self._plant: MujocoPlant | None = None
        self._stands: tuple[Any, ...] = ()  # variation and position for which `_plant` was built
        self._settled: Mapping[str, Any] = {}  # the settled state of `_plant` there
        self._options: dict[str, Any] = {}
        self._points = np.zeros((0, 3))
        self._from_mm = np.zeros(3)  # their start, in machine coordinates
        self._track = np.zeros(1, TRACK)
        self._now = self._track[0]
        self._track["step_ns"] = step_ns
        self._track["tolerance_mm"] = tolerance_mm
        self._track["time_limit_s"] = time_limit_s
        self._track["time_weight"] = time_weight
        self._track["deviation_weight"] = deviation_weight
        self._track["abort_penalty"] = abort_penalty
        self._lanes = np.zeros(len(CARRIAGES), LANE)
        self._lanes["highest_hz"] = highest_hz
        self._lanes["steps_per_mm"] = [axis.steps_per_mm for axis in self.machine.axes]
        self._lanes["half_slip"] = [0.5 * axis.slip_steps for axis in self.machine.axes]
        self._track["reach_mm"] = math.sqrt(3.0) * self.step_s * float((highest_hz / self._lanes["steps_per_mm"]).max())
        self._track["began_ns"] = self._track["until_ns"] = _SETTLING_NS
        self._begun = self._track.copy(), self._lanes.copy()  # at the start of an episode
        self._supply = math.nan  # factor for which they have the limits of the motors
        most = 3 * (math.ceil(highest_hz * self.step_s) + 2)
        self._pulses = np.zeros(most, np.int64), np.zeros((most, 3), np.int32)
        self.path_mm = np.zeros((0, 4))  # of this episode in pieces: X, Y, Z from its start, and the distance along it
        self._shape_mm = np.zeros((3, 0))
        self.place = np.zeros(0, PLACE)  # [1] until the next reset: where what it works on is
        self._at_work: tuple[NDArray[Any], ...] = ()  # what is there
        self.steps_left = 0  # steps until the time limit, 0: no episode; callers that use `place` count themselves
        self._steps = max(1, round(time_limit_s / self.step_s))
        self._picture: Picture | None = None
        self._window: Window | None = None

    def reset(
        self, *, seed: int | None = None, options: dict[str, Any] | None = None
    ) -> tuple[NDArray[np.float64], dict[str, Any]]:
        """Begin an episode at the start of the path. Raises ValueError (MachineError) with one line for a wrong
        option."""
        super().reset(seed=seed)
        return self._begin(checked(options or {})), self._info()

    def step(self, action: NDArray[np.float32]) -> tuple[NDArray[np.float64], float, bool, bool, dict[str, Any]]:
        """Make a step. Raises ResetNeeded if the episode is over, ValueError for an action that is none."""
        if not self.steps_left:
            raise gymnasium.error.ResetNeeded("the episode is over; call reset() before step()")
        values = np.ascontiguousarray(action, np.float64)
        if values.shape != (3,):
            raise ValueError(f"action is {action!r}; it must be three finite numbers from -1 to 1")
        observation = np.empty(SIZE)
        over: int = core.take_step(self.place, values, observation)
        if over < 0:
            raise ValueError(f"action is {action!r}; it must be three finite numbers from -1 to 1")
        self.steps_left -= 1
        info = self._info()
        truncated = over == 0 and self.steps_left == 0
        if over or truncated:
            self.steps_left = 0
            info["ended"] = ended(over)
        reward = info["reward_progress"] + info["reward_time"] + info["reward_deviation"] + info["reward_abort"]
        if self.render_mode == "human":
            self.render()
        return observation, reward, over != 0, truncated, info

    def render(self) -> NDArray[np.uint8] | None:
        """ "rgb_array": uint8 [480, 640, 3], machine and path; "human": in a window. RuntimeError without OpenGL."""
        if self.render_mode is None:
            return None
        if self._plant is None:
            raise gymnasium.error.ResetNeeded("there is no machine yet; call reset() before render()")
        from isel_twin.plant.picture import Picture, Window

        path_mm = self.path_mm[:, :3] + self._lanes["origin_mm"]
        if self.render_mode == "rgb_array":
            near_m = _NEAR * 1e-3 * float(np.ptp(path_mm, axis=0).max())
            self._picture = self._picture or Picture(self.machine, near_m=near_m)
            return self._picture.draw(self._plant.position_mm, path_mm)
        self._window = self._window or Window(self.machine)
        self._window.show(self._plant.position_mm, path_mm)
        time.sleep(self.step_s)
        return None

    def close(self) -> None:
        """Close renderer and window."""
        for shown in (self._picture, self._window):
            if shown is not None:
                shown.close()
        self._picture = self._window = None

    @property
    def counter_mm(self) -> NDArray[np.float64]:
        """float64 [3], position of the tool by the counters, from the start of the path."""
        return np.asarray(self._lanes["counter"] / self._lanes["steps_per_mm"])

    @property
    def tool_mm(self) -> NDArray[np.float64]:
        """float64 [3], true position of the tool, from the start of the path. Raises ResetNeeded before the first
        reset."""
        if self._plant is None:
            raise gymnasium.error.ResetNeeded("there is no machine yet; call reset()")
        return np.asarray(self._plant.position_mm - self._lanes["origin_mm"])

    @property
    def highest_mm_s(self) -> NDArray[np.float64]:
        """float64 [3], speed at action 1."""
        return np.asarray(self._lanes["highest_hz"] / self._lanes["steps_per_mm"])

    def __getstate__(self) -> dict[str, Any]:
        """For pickle: only the state of the plant."""
        state = self.__dict__.copy()
        for name in ("_plant", "_stands", "_settled", "place", "_at_work", "_now", "_picture", "_window"):
            state.pop(name, None)
        state["standing"] = self._plant.save() if self._plant is not None else None
        return state

    def __setstate__(self, state: dict[str, Any]) -> None:
        standing = state.pop("standing")
        self.__dict__.update(state)
        self._plant, self._stands, self._settled, self._picture, self._window = None, (), {}, None, None
        self._now, self.place, self._at_work = self._track[0], np.zeros(0, PLACE), ()
        if standing is not None:
            self._stand()
            self._bind()
            assert self._plant is not None
            self._plant.restore(standing)

    def _begin(self, options: dict[str, Any]) -> NDArray[np.float64]:
        """The first observation of an episode with these options."""
        points = lay_path(options.get("path", self._path), self.np_random)
        off_mm = self._reference_mm * self.np_random.uniform(-1.0, 1.0, 3)
        if not (len(self.path_mm) and np.array_equal(points, self._points)):
            path = sampled(points)
            self._check_fits(points)
            self.path_mm, self._points, self._from_mm = path, points, self._start_mm(points)
        self._options, self.steps_left = options, 0
        self._stand()
        assert self._plant is not None
        supply = options.get("supply", 1.0)
        if supply != self._supply:
            self._begun[1]["limit_rad_s"], self._supply = limits_rad_s(self.machine, supply), supply
        self._track[:], self._lanes[:] = self._begun
        self._lanes["origin_mm"] = self._plant.position_mm + off_mm
        self._bind()
        observation = np.empty(SIZE)
        core.begin_episode(self.place, observation)
        self.steps_left = self._steps
        return observation

    def _stand(self) -> None:
        """Set up a machine with the options of this episode, at rest at the start of its path."""
        start_mm = self._from_mm
        stands = (*(self._options.get(name) for name in VARIATIONS), *start_mm)
        again = stands == self._stands
        if again and self._settled:
            assert self._plant is not None
            self._plant.restore(self._settled)
            return
        self._stands, self._settled = (), {}
        machine = varied(self.machine, self._options)
        if self._plant is None:
            self._plant = MujocoPlant(machine, (), start_mm, 3, load_model(machine, visual=False))
        else:
            self._plant.become(machine, start_mm)
        self._plant.set_power(stages=True, brake_released=True, lowering=False)
        self._plant.advance(_SETTLING_NS, np.empty(0, np.int64), np.empty((0, 3), np.int32))
        self._plant.watch_margin()
        self._shape_mm = self._plant.shape_mm
        self._stands = stands
        if again:  # who comes twice will come again
            self._settled = self._plant.save()

    def _bind(self) -> None:
        assert self._plant is not None
        self._at_work = self._plant.memory, self._track, self._lanes, self._shape_mm, self.path_mm, *self._pulses
        self.place = place_of(self._at_work)

    def _start_mm(self, points: NDArray[np.float64]) -> NDArray[np.float64]:
        """float64 [3], start of the path in machine coordinates: in the middle of the travel, if it fits there."""
        travel_mm = np.array([axis.travel_mm for axis in self.machine.axes])
        low_mm, high_mm = _CLEAR_MM - points.min(axis=0), travel_mm - _CLEAR_MM - points.max(axis=0)
        return np.clip(0.5 * travel_mm, low_mm, high_mm)

    def _check_fits(self, points: NDArray[np.float64]) -> None:
        """Refuse a path that is larger than the travel."""
        for axis, size_mm in zip(self.machine.axes, np.ptp(points, axis=0), strict=True):
            most_mm = axis.travel_mm - 2.0 * _CLEAR_MM
            if size_mm > most_mm:
                raise ValueError(f"path is {size_mm:g} mm wide along {axis.name}; allowed: up to {most_mm:g}")

    def _info(self) -> dict[str, Any]:
        return {name: float(value) for name, value in infos(self._now).items()}

    def aim(self, asked: NDArray[np.float64], feed_mm_s: float, offset_mm: float) -> NDArray[np.float32]:
        """float32 [3], the action that leads the counters along the path (tracking.c). Raises ResetNeeded before
        the first reset."""
        if not len(self.place):
            raise gymnasium.error.ResetNeeded("there is no machine yet; call reset() before step()")
        action = np.empty(3)
        core.aim(self.place, feed_mm_s, offset_mm, np.ascontiguousarray(asked, np.float64), action)
        return action.astype(np.float32)

    # For vectors of environments (track_vector.py)

    def keep_in(self, track: NDArray[np.void], lanes: NDArray[np.void]) -> None:
        """Keep the state in these arrays from now on: track [1] TRACK, lanes [3] LANE."""
        track[:], lanes[:] = self._track, self._lanes
        self._track, self._lanes, self._now = track, lanes, track[0]


def infos(track: Any) -> dict[str, Any]:
    """The entries of `info` for a TRACK, or for an array of them."""
    return {
        "way_mm": track["way_mm"],
        "deviation_mm": track["deviation_mm"],
        "edge": track["edge"],
        "time_s": 1e-9 * (track["until_ns"] - track["began_ns"]),
        **{name: track[name] for name in REWARDS},
    }


def ended(over: int) -> str:
    """How an episode ended, by what its last step returned; 0 or less: its time was over."""
    return "time" if over <= 0 else "lost steps" if over & STEPS_LOST else "outside" if over & OUTSIDE else "done"
