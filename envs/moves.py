"""One move of a job, for the environment and the sweeps. A controller makes a move on a twin with a host's commands
(`Language.move`); the measurements are those of a dial gauge and a stop watch:

    |<--------- time_s --------->|<-- settling_s -->|
    command                    reply    last time outside the tolerance        end of the dwell (settle_s)
                                 |<--- vibration_mm = half of (highest - lowest) position error --->|

position error = true carriage position - counter / (steps per mm), in mm, on each axis.

A motor slips by whole periods of its torque, four full steps: if counter minus rotor changes by half a period or more
from one rest to the next, steps were lost in between; anything less is load angle (`isel_twin.jobs.verdict.lost`).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.core.spec import TwinSpec
from isel_twin.core.twin import Twin
from isel_twin.envs.watching import Watch
from isel_twin.jobs.verdict import lost
from isel_twin.language import Language, create_language, needed, readable
from isel_twin.language import MoveSettings as Settings
from isel_twin.machine import Machine, with_overrides

Job = Sequence[tuple[float, float, float]]  # targets X, Y, Z in mm from the reference point, where a job begins

# a short job with long moves, where speed counts, and short ones, where ramp and start-stop frequency count
JOB: Job = (
    (100.0, 50.0, 10.0),
    (100.0, 150.0, 10.0),
    (105.0, 150.0, 10.0),
    (105.0, 150.0, 15.0),
    (40.0, 40.0, 15.0),
    (10.0, 10.0, 5.0),
)

_START_MM = (1.0, 3.0)  # from the motor-end switch at power-on: near, so that the reference run is short (envs/1)
_ANSWER_LIMIT_S = 60.0  # for a command of the reference run, and for settings
_BREAK_LIMIT_S = 60.0  # for breaking off a move; the longest stop ramp takes 40 s: 40000 Hz at 1 Hz/ms
# Five quarters of a period of the portal's 63 Hz: four successive samples have four phases of it (envs/5).
_MOVING_SAMPLE_S, _MOVING_SAMPLE_NS = 0.02, 20 * MILLISECOND_NS
_RESTING_SAMPLE_S, _RESTING_SAMPLE_NS = 0.002, 2 * MILLISECOND_NS


@dataclass(frozen=True)
class Setup:
    """The constants while settings are tried: the job, the machine, and the criteria of a good move."""

    job: Job = JOB
    machine: str | Path | Machine = "4030"
    controller: str = "imc-s8"  # any controller with a language (`isel_twin.language`)
    plant: str = "mujoco"
    seed: int = 0
    overrides: Mapping[str, Any] = field(default_factory=dict)  # of machine parameters, {"payload.mass": 8.0}
    scenario: str | Path | None = None  # file of timed events; the reference run is over about 2 s after power-on
    load_nm: float = 0.0  # extra load on every shaft, against motion (Coulomb friction): a margin of safety (envs/4)
    tolerance_mm: float = 0.05  # largest position error of any axis that is allowed at rest
    settle_s: float = 0.2  # standstill after each move, in which the machine settles and is measured
    time_limit_s: float = 120.0  # virtual time for the whole job without standstill; then a move is given up

    def __post_init__(self) -> None:
        if not self.job:
            raise ValueError("the job has no moves; give at least one target (x, y, z) in mm")
        for number, point in enumerate(self.job, 1):
            if len(point) != 3 or not all(math.isfinite(value) for value in point):
                raise ValueError(f"job: target {number} is {point!r}; write three numbers, X, Y and Z in mm")
        for name, low in (("load_nm", 0.0), ("tolerance_mm", 1e-6), ("settle_s", 0.01), ("time_limit_s", 1e-3)):
            value = getattr(self, name)
            if not low <= value <= 1e6:
                raise ValueError(f"{name} is {value!r}; it must be a number from {low:g} to 1e6")

    @property
    def spec(self) -> TwinSpec:
        """The spec of the twin, without start positions. Raises ValueError with one line."""
        scenario = None if self.scenario is None else Path(self.scenario)
        spec = TwinSpec(self.machine, self.controller, self.plant, self.seed, scenario, overrides=self.overrides)
        if self.load_nm <= 0.0:
            return spec
        axes = with_overrides(spec.as_built, self.overrides).axes
        loads = {f"axes.{axis.name}.shaft_coulomb": axis.screw.coulomb_nm + self.load_nm for axis in axes}
        return spec.with_(overrides={**self.overrides, **loads})


@dataclass(frozen=True)
class Move:
    """The result of one move. Arrays are float64 [3], X Y Z."""

    reply: str  # the controller's reply as text; "" if the move was given up at the time limit
    done: bool  # the controller has made the move: the reply is no refusal, and there is no fault
    time_s: float  # from the command to the reply
    settling_s: float  # from the reply to the last time that an axis was outside the tolerance, or 0
    slipped: bool  # a motor lost steps in this move, or a servo drive switched itself off
    lost_steps: NDArray[np.float64]  # counter minus rotor at rest, in steps, since the reference run
    error_mm: NDArray[np.float64]  # position error at the end of the dwell
    vibration_mm: NDArray[np.float64]  # half of highest minus lowest position error during the dwell
    deviation_mm: float  # largest position error of any axis, from command to the end of the dwell, sampled
    margin: float | None  # least pull-out margin of any motor meanwhile (`Twin.margin`); None without physics
    edge: float | None  # least factor on the speed of any motor until it swings (`Twin.speed_edge`); None: no physics

    def good(self, tolerance_mm: float) -> bool:
        """True if it is done, without a lost step, and within the tolerance at rest."""
        return self.done and not self.slipped and float(np.abs(self.error_mm).max()) <= tolerance_mm


def spoken(setup: Setup) -> Language:
    """The language of the setup's controller. Raises ValueError with one line if there is none."""
    return needed(create_language(setup.controller), setup.controller)


def referenced_twin(setup: Setup, like: Twin | None = None) -> Twin:
    """A new twin after a physical reference run. like: one of the same setup with another seed or job, from which the
    new one is built in a tenth of the time.
    Raises ValueError with one line for a job outside the machine, a controller without language, or one that refuses.
    """
    twin = new_twin(setup, like)
    check_job(setup.job, twin.machine)
    language = needed(twin.language, setup.controller)
    for command in language.reference():
        over, reply = _converse(twin, command, _ANSWER_LIMIT_S)
        if not over or not language.accepted(command, reply) or twin.fault:
            raise ValueError(
                f"no reference run: {setup.controller} answers {language.text(reply)!r} to {readable(command)} within "
                f"{_ANSWER_LIMIT_S:g} s; take a scenario that begins later, or a smaller load_nm"
            )
    return twin


def new_twin(setup: Setup, like: Twin | None = None) -> Twin:
    """The twin of a setup, just switched on."""
    x, y, z = np.random.default_rng(setup.seed).uniform(*_START_MM, size=3)
    start_mm = (float(x), float(y), float(z))
    if like is not None:
        return like.another(setup.seed, start_mm)
    return Twin.of(setup.spec.with_(start_mm=start_mm))


def check_job(job: Job, machine: Machine) -> None:
    """Raise ValueError with one line for a target outside the machine."""
    for number, point in enumerate(job, 1):
        for axis, value in zip(machine.axes, point, strict=True):
            if not 0.0 <= value < axis.travel_mm:
                raise ValueError(f"job: target {number}: {axis.name} is {value:g} mm; allowed: 0 to {axis.travel_mm:g}")


def _converse(twin: Twin, data: bytes, limit_s: float) -> tuple[bool, bytes]:
    """Whether the controller is done after at most limit_s of virtual time, and its reply."""
    twin.read()
    twin.write(data)
    over = twin.run_until_idle(limit_s)
    return over, twin.read()


def make_move(twin: Twin, target_mm: Sequence[float], settings: Settings, setup: Setup, limit_s: float) -> Move:
    """Move to target_mm [3] and measure; the move is given up after limit_s seconds of virtual time.

    Raises ValueError with one line for settings that cannot be sent to the controller.
    """
    language = needed(twin.language, setup.controller)
    target = [round(mm * axis.steps_per_mm) for mm, axis in zip(target_mm, twin.machine.axes, strict=True)]
    lost_before, faults_before = twin.lost_steps[:3], twin.drive_faults

    *before, command = language.move(target, settings)
    for data in before:
        _converse(twin, data, _ANSWER_LIMIT_S)
    began_ns = twin.time_ns
    twin.watch_margin()
    deviation_mm = _begin(twin, command, limit_s)
    time_s = (twin.time_ns - began_ns) * 1e-9
    over, reply = twin.idle, twin.read()
    given_up = not over or not (reply or language.accepted(command, reply))
    if given_up:
        twin.write(language.break_off())
        twin.run_until_idle(_BREAK_LIMIT_S)
        twin.read()

    dwell_mm = _dwell(twin, round(setup.settle_s / _RESTING_SAMPLE_S))
    outside = np.flatnonzero(np.abs(dwell_mm).max(axis=1) > setup.tolerance_mm)
    lost_steps = twin.lost_steps[:3]
    return Move(
        reply="" if given_up else language.text(reply),
        done=not given_up and language.accepted(command, reply) and not twin.fault,
        time_s=time_s,
        settling_s=float((outside[-1] + 1) * _RESTING_SAMPLE_S) if len(outside) else 0.0,
        slipped=bool(lost(lost_steps - lost_before, twin.slip_steps[:3]).any()) or twin.drive_faults != faults_before,
        lost_steps=lost_steps,
        error_mm=dwell_mm[-1],
        vibration_mm=np.ptp(dwell_mm, axis=0) / 2.0,
        deviation_mm=max(deviation_mm, float(np.abs(dwell_mm).max())),
        margin=None if np.isnan(twin.margin).all() else float(np.nanmin(twin.margin)),
        edge=None if np.isnan(twin.speed_edge).all() else float(np.nanmin(twin.speed_edge)),
    )


def _begin(twin: Twin, command: bytes, limit_s: float) -> float:
    """Make a move, in at most limit_s rounded up to whole intervals; return the largest position error in mm."""
    began_ns, every = twin.time_ns, _MOVING_SAMPLE_NS
    watch = Watch(twin, every)
    try:
        twin.write(command)
        if watch.in_loop:
            intervals = max(math.ceil(limit_s * 1e9 / every), 1)
            twin.run_until(began_ns + intervals * every, lambda: twin.idle)
            errors_mm = watch.errors_mm()
            if (twin.time_ns - began_ns) % every == 0:
                errors_mm = errors_mm[:-1]  # the last one belongs to the dwell
        else:
            looks = []
            while not twin.run_until_idle(_MOVING_SAMPLE_S) and twin.time_ns - began_ns < limit_s * 1e9:
                looks.append(watch.error_mm())
            errors_mm = np.array(looks)
    finally:
        watch.leave()
    return float(np.abs(errors_mm).max(initial=0.0))


def _dwell(twin: Twin, looks: int) -> NDArray[np.float64]:
    """float64 [looks, 3], position errors in mm during the dwell."""
    watch = Watch(twin, _RESTING_SAMPLE_NS)
    try:
        if watch.in_loop:
            twin.run_until(twin.time_ns + looks * _RESTING_SAMPLE_NS)
            return watch.errors_mm()
        errors = []
        for _ in range(looks):
            twin.run_until(twin.time_ns + _RESTING_SAMPLE_NS)
            errors.append(watch.error_mm())
        return np.array(errors)
    finally:
        watch.leave()
