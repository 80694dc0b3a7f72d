"""Assertions about a machine whose errors name what was expected, what was found, when, which axis and which command.

    def test_pocket(watched):
        watched.play("jobs/pocket.txt")
        assert_no_step_lost(watched)
        assert_ends_at(watched, (0.0, 0.0, 0.0), tolerance_mm=0.05)

    MotionError: x has lost steps
      expected: no step lost
      was:      16 steps lost
      when:     12.304000 s
      axis:     x
      command:  line 7: @0M16000,9000,...

They take a `Watched` (isel_twin.jobs.checks.watched; jobs/6), in pytest the fixture `watched`. At a real controller
(`pytest --isel-port`) those of replies and times look at it, and the others are noted as not looked at. Each returns
None or raises MotionError, an AssertionError; what cannot be asserted, such as an axis that does not exist, is a
ValueError.
"""

from __future__ import annotations

import itertools
import math
import os
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import Concatenate, ParamSpec, cast

import numpy as np
from numpy.typing import ArrayLike, NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.files import atomic_write
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.checks.paths import arc, from_path, since_left
from isel_twin.jobs.checks.watched import Command, Heard, JobRun, Watched
from isel_twin.jobs.golden import Golden, GoldenError, called, differences, dumps, golden_file, load
from isel_twin.jobs.result import in_percent
from isel_twin.jobs.verdict import HALF_A_SLIP, halfway

__all__ = [
    "MotionError",
    "arc",
    "assert_accepted",
    "assert_cycle_time",
    "assert_ends_at",
    "assert_golden",
    "assert_no_collision",
    "assert_no_step_lost",
    "assert_on_path",
    "assert_outputs",
    "assert_replies",
    "assert_switch_margin",
    "assert_torque_margin",
]

MOST = 5  # differences from a golden run that are listed


class MotionError(AssertionError):
    """An assertion about a machine failed; the message says what, when, which axis and which command."""

    def __init__(
        self,
        what: str,
        *,
        expected: str,
        was: str,
        time_ns: int | None = None,
        axis: str | None = None,
        command: Command | None = None,
    ) -> None:
        self.expected, self.was, self.time_ns, self.axis, self.command = expected, was, time_ns, axis, command
        rows = [("expected", expected), ("was", was)]
        rows += [] if time_ns is None else [("when", f"{time_ns / SECOND_NS:.6f} s")]
        rows += [] if axis is None else [("axis", axis)]
        rows += [] if command is None else [("command", str(command))]
        super().__init__("\n".join([what, *(f"  {name + ':':<9} {text}" for name, text in rows)]))


P = ParamSpec("P")


def _inside(check: Callable[Concatenate[Watched, P], None]) -> Callable[Concatenate[Heard, P], None]:
    """Of an assertion that looks inside the machine: at a real one it looks at nothing, which is noted."""

    @wraps(check)
    def assertion(seen: Heard, /, *args: P.args, **kwargs: P.kwargs) -> None:
        __tracebackhide__ = True
        if not seen.overlook(check.__name__):
            check(cast("Watched", seen), *args, **kwargs)

    return assertion


@_inside
def assert_no_step_lost(seen: Watched) -> None:
    """Since power-on no axis has lost steps or rests halfway between two stable places, no servo drive has switched
    itself off, and none rests short of its command. Lets the machine come to rest first. Fails if the controller
    is still busy."""
    __tracebackhide__ = True
    _at_rest(seen, "no step lost")
    twin = seen.twin
    for axis in AXIS_NAMES[: len(twin.lost_steps)]:
        if (command := seen.lost_in(axis)) is not None:
            raise MotionError(
                f"{axis} has lost steps",
                expected="no step lost",
                was=f"{command.lost[axis]:+.0f} steps (counter minus rotor)",
                time_ns=command.end_ns,
                axis=axis,
                command=command,
            )
    if steps := int(twin.unpowered_steps.sum()):
        raise MotionError(
            "steps without power", expected="no step while the stages have no power", was=f"{steps} steps"
        )
    for axis, (number, cause) in zip(AXIS_NAMES, twin.drive_faults, strict=False):
        if number:
            raise MotionError(f"{axis}: {cause}", expected="no drive switched off", was=f"{number} times", axis=axis)
    for i in np.flatnonzero(~twin.in_position):
        raise MotionError(
            f"{AXIS_NAMES[i]} rests beside its command",
            expected="every servo drive in position",
            was=f"{twin.following_error[i]:+.0f} increments from it",
            time_ns=twin.time_ns,
            axis=AXIS_NAMES[i],
        )
    for i in np.flatnonzero(halfway(twin.lost_steps, twin.slip_steps)):
        raise MotionError(
            f"{AXIS_NAMES[i]} {HALF_A_SLIP}",
            expected="no step lost",
            was=f"{twin.lost_steps[i]:+.2f} of {twin.slip_steps[i]:.0f} steps off",
            time_ns=twin.time_ns,
            axis=AXIS_NAMES[i],
            command=seen.command_at(twin.time_ns),
        )


@_inside
def assert_no_collision(seen: Watched) -> None:
    """Nothing has met what it must not, since `begin`."""
    __tracebackhide__ = True
    seen.rest()
    for collision in seen.twin.collisions:
        if collision.time_ns >= seen.begin_ns:
            raise MotionError(
                collision.who,
                expected="no collision",
                was=str(collision),
                time_ns=collision.time_ns,
                command=seen.command_at(collision.time_ns),
            )


def assert_accepted(seen: Heard) -> None:
    """Every command since `begin` was answered and not refused; in a job, every expectation was met. The controller
    does not stand in a fault: some tell an error in no reply."""
    __tracebackhide__ = True
    seen.rest()
    _require_accepted(seen)
    if seen.fault_left:
        raise MotionError("the controller stands in a fault", expected="none", was=seen.fault_left, time_ns=seen.now_ns)


def _require_accepted(seen: Heard) -> None:
    __tracebackhide__ = True
    if seen.job is not None:
        for result in seen.job[0]:
            if not result.ok:
                asked = result.expected is not None or not result.reply
                raise MotionError(
                    "a line of the job went wrong",
                    expected=result.expected or "a command that is accepted",
                    was=(asked and result.why) or f"answered {result.reply!r}; {result.blame}".rstrip("; "),
                    time_ns=result.end_ns,
                    command=Command(result.time_ns, result.number, text=result.command),
                )
        return
    for command in seen.commands:
        if not seen.accepts(command):
            raise MotionError(
                "a command was refused",
                expected="a command that is accepted",
                was=f"answered {seen.reply_text(command)!r}" if command.reply else "not answered",
                time_ns=command.end_ns,
                command=command,
            )


def assert_replies(seen: Heard, expected: Sequence[str]) -> None:
    """The commands since `begin` had these replies, in this order; "" for none."""
    __tracebackhide__ = True
    commands = seen.commands
    for command, text in zip(commands, expected, strict=False):
        if (reply := seen.reply_text(command)) != text:
            raise MotionError(
                "another reply", expected=repr(text), was=repr(reply), time_ns=command.end_ns, command=command
            )
    if len(commands) != len(expected):
        raise MotionError(
            "another number of commands",
            expected=f"{len(expected)} replies",
            was=f"{len(commands)} command{'' if len(commands) == 1 else 's'}",
            time_ns=seen.now_ns,
            command=commands[-1] if commands else None,
        )


@_inside
def assert_ends_at(
    seen: Watched, position_mm: Sequence[float | None] | Mapping[str, float], tolerance_mm: float = 0.05
) -> None:
    """The carriages, at rest, are at these true positions in the zero of the counters. position_mm: X, Y, Z, None for
    an axis to ignore; or by name, {"x": 50.0}."""
    __tracebackhide__ = True
    wanted = _by_axis(position_mm)
    _at_rest(seen, "an end position")
    twin = seen.twin
    for axis, target in wanted.items():
        found = float(twin.position_mm[CARRIAGES.index(axis)])
        if not abs(found - target) <= tolerance_mm:
            i = CARRIAGES.index(axis)
            counter_mm = float(twin.counts[i] * twin.step_mm[i])
            raise MotionError(
                f"{axis} is {found - target:+.3f} mm off",
                expected=f"{target:.3f} mm +- {tolerance_mm:g} mm",
                was=f"{found:.3f} mm; its counter says {counter_mm:.3f} mm",
                time_ns=twin.time_ns,
                axis=axis,
                command=seen.command_at(twin.time_ns),
            )


@_inside
def assert_on_path(seen: Watched, points_mm: ArrayLike, tolerance_mm: float) -> None:
    """Since `begin`, no sample of the position was farther from the path than the tolerance.

    points_mm: [n, 2] corners of a path in XY, or [n, 3] in space, by the counters; `arc` makes some. Speed and
    completeness are not checked here but by `assert_ends_at` and `assert_cycle_time`.
    """
    __tracebackhide__ = True
    points = np.asarray(points_mm, dtype=np.float64)
    if points.ndim != 2 or points.shape[1] not in (2, 3) or not len(points):
        raise ValueError(f"points_mm has the shape {points.shape}; give [n, 2] for X Y or [n, 3] for X Y Z")
    time_ns, position_mm, _ = seen.samples()
    if not len(time_ns):
        raise ValueError("there was no look at the machine since `begin`: no time has passed")
    distance_mm, nearest = from_path(position_mm[:, : points.shape[1]], points)
    worst = int(np.argmax(distance_mm))
    if not distance_mm[worst] <= tolerance_mm:
        first = int(np.flatnonzero(~(distance_mm <= tolerance_mm))[0])
        off = position_mm[first, : points.shape[1]] - nearest[first]
        raise MotionError(
            f"{distance_mm[worst]:.3f} mm from the path",
            expected=f"within {tolerance_mm:g} mm of it",
            was=f"first {distance_mm[first]:.3f} mm off, at {_mm(position_mm[first])} mm; "
            f"most {distance_mm[worst]:.3f} mm at {time_ns[worst] / SECOND_NS:.6f} s, at {_mm(position_mm[worst])} mm",
            time_ns=int(time_ns[first]),
            axis=CARRIAGES[int(np.argmax(np.abs(off)))],
            command=seen.command_at(int(time_ns[first])),
        )


def assert_cycle_time(seen: Heard, most_s: float, least_s: float = 0.0) -> None:
    """The time from the first command since `begin` to the last reply, or the end of the last line of a job."""
    __tracebackhide__ = True
    commands = seen.commands
    if not commands:
        raise ValueError("there was no command since `begin`")
    begin_ns, end_ns = commands[0].begin_ns, max(command.end_ns for command in commands)
    if seen.job is not None:
        end_ns = max(end_ns, seen.job[1])
    took_s = (end_ns - begin_ns) / SECOND_NS
    if not least_s <= took_s <= most_s:
        slowest = max(commands, key=lambda command: command.end_ns - command.begin_ns)
        raise MotionError(
            "too slow" if took_s > most_s else "too fast",
            expected=f"at most {most_s:g} s" + (f", at least {least_s:g} s" if least_s else ""),
            was=f"{took_s:.6f} s, of which the command below took "
            f"{(slowest.end_ns - slowest.begin_ns) / SECOND_NS:.6f} s",
            time_ns=end_ns,
            command=slowest,
        )


@_inside
def assert_switch_margin(seen: Watched, least_mm: float) -> None:
    """Since `begin`, every carriage kept that distance from the nominal trip point of each of its end switches.
    Commands that set a counter, such as reference runs, may come nearer. As they end near a switch, a carriage may then
    leave it first: being nearer counts only after it has been farther away; being beyond the trip point counts always.
    """
    __tracebackhide__ = True
    time_ns, _, machine_mm = seen.samples()
    free = np.ones(len(time_ns), dtype=np.bool_)
    free[: int(np.searchsorted(time_ns, seen.commands[0].begin_ns if seen.commands else 0))] = False
    commands = seen.every_command
    for command, after in zip(commands, [*commands[1:], None], strict=True):
        if command.counter_set:
            free &= ~((time_ns >= command.begin_ns) & (time_ns <= (math.inf if after is None else after.begin_ns)))
    found: list[tuple[float, int, str, str]] = []
    for switch in seen.twin.machine.switches:
        if switch.axis not in CARRIAGES:
            continue
        way_mm = machine_mm[:, CARRIAGES.index(switch.axis)] - switch.position_mm
        away_mm = -way_mm if switch.end == "far" else way_mm
        near = free & (away_mm < least_mm) & (since_left(free, away_mm >= least_mm) | (away_mm < 0.0))
        if near.any():
            k = int(np.flatnonzero(near)[np.argmin(away_mm[near])])
            found.append((float(away_mm[k]), int(time_ns[k]), switch.axis, switch.name))
    if found:
        away, when_ns, axis, name = min(found, key=lambda each: each[0])
        raise MotionError(
            f"{axis} comes too near to {name}",
            expected=f"at least {least_mm:g} mm from its trip point",
            was=f"{away:.3f} mm" if away >= 0.0 else f"{-away:.3f} mm beyond it",
            time_ns=when_ns,
            axis=axis,
            command=seen.command_at(when_ns),
        )


@_inside
def assert_torque_margin(seen: Watched, least: float) -> None:
    """In every command since `begin` each motor kept that pull-out margin (1 without load, 0 at the limit). Raises
    ValueError for a plant without physics, which has no margin."""
    __tracebackhide__ = True
    from isel_twin.drives.bands import margin_band

    margins = [
        (margin, axis, command)
        for command in seen.commands
        for axis, margin in zip(AXIS_NAMES, command.margin, strict=False)
        if not math.isnan(margin)
    ]
    if not margins:
        raise ValueError('no motor has a margin to speak of; take plant="mujoco", and move')
    margin, axis, command = min(margins, key=lambda each: each[0])
    if margin < least:
        torque = seen.twin.torque_band[AXIS_NAMES.index(axis)].tolist()
        raise MotionError(
            f"{axis} keeps too little torque",
            expected=f"a margin of at least {100 * least:.0f} %",
            was=in_percent([margin], [None if math.isnan(torque[0]) else margin_band(margin, *torque)]),
            time_ns=command.begin_ns,
            axis=axis,
            command=command,
        )


@_inside
def assert_outputs(seen: Watched, **values: int) -> None:
    """Outputs of the controller and relays have these values now: spindle=1."""
    __tracebackhide__ = True
    outputs = seen.twin.outputs
    for name, value in values.items():
        if name not in outputs:
            raise ValueError(f"there is no output {name!r}; there are: {', '.join(sorted(outputs))}")
        if outputs[name] != value:
            when_ns, command = seen.output_changes.get(name, (None, seen.command_at(seen.twin.time_ns)))
            since = "from the beginning" if when_ns is None else f"since {when_ns / SECOND_NS:.6f} s"
            raise MotionError(
                f"{name} is {outputs[name]}",
                expected=f"{name} = {value}",
                was=f"{outputs[name]}, {since}",
                time_ns=seen.twin.time_ns,
                command=command,
            )


@_inside
def assert_golden(seen: Watched, file: str | os.PathLike[str] | None = None, *, update: bool = False) -> None:
    """The job of `Watched.play` equals its golden run (`isel-twin golden record`), to the tick. file: None for the one
    beside the job. update: write it instead. Raises GoldenError for a wrong file."""
    __tracebackhide__ = True
    if (run := seen.run) is None:
        raise ValueError("no job was played: watched.play(job) first")
    path = golden_file(run.job) if file is None else Path(file)
    origin = seen.twin.origin
    machine = origin.as_built
    call = origin.with_(machine=machine.name)
    now = called(run.golden, call, run.job, path)
    if update:
        atomic_write(path, dumps(now).encode())
        return
    if not path.is_file():
        raise GoldenError(f"{path}: there is no golden run; make it with isel-twin golden record {run.job}")
    was = load(path)
    if (path.parent / str(was.call["machine"])).resolve() == machine.folder.resolve():
        now = called(run.golden, call.with_(machine=str(machine.folder)), run.job, path)
    if found := list(differences(was, now)):
        first = found[0]
        result = next((result for result in run.results if result.number == first.line), None)
        rest = f"; and {len(found) - MOST} more" if len(found) > MOST else ""
        time_ns, axis = _divergence(was, now, run)
        raise MotionError(
            f"not what it was, first in line {first.line}" if first.line else "not what it was",
            expected=f"as in {path}",
            was="; ".join(str(difference) for difference in found[:MOST]) + rest,
            time_ns=time_ns,
            axis=axis,
            command=None if result is None else Command(result.time_ns, result.number, text=result.command),
        )


def _at_rest(seen: Watched, what: str) -> None:
    __tracebackhide__ = True
    seen.rest()
    if not seen.twin.idle:
        raise MotionError(
            "the controller is still at work",
            expected=f"{what}, with the machine at rest",
            was="a command that is not over: let time pass first (twin.run_until_idle())",
            time_ns=seen.twin.time_ns,
            command=seen.command_at(seen.twin.time_ns),
        )


def _by_axis(position_mm: Sequence[float | None] | Mapping[str, float]) -> dict[str, float]:
    if isinstance(position_mm, Mapping):
        unknown = [axis for axis in position_mm if axis not in CARRIAGES]
        if unknown:
            raise ValueError(f"there is no axis {unknown[0]!r}; there are: {', '.join(CARRIAGES)}")
        return dict(position_mm)
    if len(position_mm) > len(CARRIAGES):
        raise ValueError(f"position_mm has {len(position_mm)} values; there are: {', '.join(CARRIAGES)}")
    return {axis: float(mm) for axis, mm in zip(CARRIAGES, position_mm, strict=False) if mm is not None}


def _divergence(was: Golden, now: Golden, run: JobRun) -> tuple[int | None, str | None]:
    """When the streams first differ, to a window of a move, and the axis; None if they do not."""
    commands = (result for result in run.results if not result.condition)
    for command, a, b in zip(commands, was.moves, now.moves, strict=False):
        if a.windows != b.windows:
            spans = zip(a.windows, b.windows, b.spans_ns, strict=False)
            after_ns = next((begin_ns for x, y, (begin_ns, _) in spans if x != y), 0)
            axes = itertools.zip_longest(AXIS_NAMES, a.axes, b.axes)
            return command.time_ns + after_ns, next((name for name, x, y in axes if x != y), None)
    return None, None


def _mm(position_mm: NDArray[np.float64]) -> str:
    return " ".join(f"{axis} {mm:.3f}" for axis, mm in zip(CARRIAGES, position_mm, strict=False))
