"""The iSMIF's stored commands, and their settings, counters, signals and reference input.

A command that takes time is an activity (`isel_twin.firmware.activity`). The reference run of an axis (6.13):

    position   switch  |  travel ->
               #########
       rest            |          50 ms
       search          |<----------------------------- until the input goes low, stopped there
       rest            |          50 ms
       free run        |--->                           until the input goes high, stopped there
       rest            |          50 ms
       offset              |--->0                      #O steps, then the counter is set to 0

A search or free run that ends before the input changes fails, and its command fails, too.
"""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import CounterSet, Event, Output, ReferenceSearch, Remark
from isel_twin.firmware.activity import Activity, Ended, Pause, Travel, Unfinished
from isel_twin.firmware.executor import Executor, Parked
from isel_twin.firmware.ismif.commands import STEPS_LIMIT, Instruction, Target
from isel_twin.firmware.ismif.configuration import Configuration
from isel_twin.firmware.ismif.moves import FullSteps, ramp
from isel_twin.motion import Displacement, line

AXES, COUNTERS = range(3), 4  # X, Y, Z, and an unused counter
# standstill before each motion of a reference run: the carriage settles, the switch stops bouncing (ismif/8)
REST_NS = 50 * MILLISECOND_NS
SEARCH_LIMIT = 200_000
FREE_LIMIT = 4_000  # half steps after which a search or a free run has failed (ismif/8)


class Standing(Enum):
    """The purpose of a pause."""

    WAITING = "waiting time of the job"
    RESTING = "rest of a reference run"


@dataclass(frozen=True)
class Search:
    """A motion that ends at once when the reference input has this level."""

    level: bool


class Failure(Unfinished):
    """The command cannot be completed: its job is dropped (ismif/1)."""


class Actions:
    """The state of the interface. Counters count half steps of the stage, independent of F (ismif/4)."""

    def __init__(self, events: list[Event], error_ppm: int) -> None:
        """events: list that gets all events; error_ppm: error of the output frequency (ismif/5)."""
        self.executor = Executor(COUNTERS)
        self.configuration = Configuration()
        self.input = True
        self._events = events
        self._error_ppm = error_ppm
        self._known = [False] * 3
        self._pen = 0

    def carry_out(self, instruction: Instruction) -> Activity | None:
        """Carry out a stored command, or return the activity that does."""
        match instruction.code:
            case "L":
                return self._vector(*instruction.arguments)
            case "$H":
                return self._reference_run(*instruction.arguments)
            case "W":
                return _stand(instruction.arguments[0] * MILLISECOND_NS, Standing.WAITING)
            case "A":
                self._set_signal(*instruction.arguments)
            case _:
                self._configure(instruction)
        return None

    def _vector(self, index: int, *targets: Target) -> Activity:
        """6.14: all axes together, led by the longest way. Z of a plotter is the relay, switched first (ismif/12)."""
        steps = [0] * COUNTERS
        ends = [self.position_steps(axis) for axis in AXES]
        for target in targets:
            start = ends[target.axis]
            ends[target.axis] = target.steps + (start if target.relative else 0)
            steps[target.axis] = ends[target.axis] - start
        if any(abs(end) > STEPS_LIMIT for end in ends):
            raise Failure(f"a target more than {STEPS_LIMIT} half steps from the zero point")
        if self.configuration.plotter:
            self._set_pen(ends[2])
            steps[2] = 0
        yield from self._travel(tuple(steps), index)

    def _reference_run(self, axes: tuple[int, ...]) -> Activity:
        """6.13: each axis in turn. Z of a plotter has no search, its pen is lifted first (ismif/12)."""
        for axis in axes:
            self._known[axis] = False
        motors = [axis for axis in axes if not self._is_pen(axis)]
        if len(motors) < len(axes):
            self._set_pen(0)
        for axis in motors:
            yield from self._reference_axis(axis)

    def _reference_axis(self, axis: int) -> Activity:
        settings, unit = self.configuration.reference[axis], self.configuration.half_steps
        towards = 1 if settings.positive else -1
        self._events.append(ReferenceSearch(axis))
        yield from _stand(REST_NS, Standing.RESTING)
        yield from self._travel(_along(axis, SEARCH_LIMIT // unit * towards), settings.search, Search(False))
        yield from _stand(REST_NS, Standing.RESTING)
        yield from self._travel(_along(axis, FREE_LIMIT // unit * -towards), settings.free, Search(True))
        yield from _stand(REST_NS, Standing.RESTING)
        yield from self._travel(_along(axis, settings.offset * -towards), settings.offset_speed)
        self._events.append(ReferenceSearch(axis, found=True))
        self._set_counter(axis, 0)
        self._known[axis] = True

    def _travel(self, steps: Displacement, index: int, search: Search | None = None) -> Activity:
        """Move straight by `steps`, with `search` to the change of the input. Raises Failure if it does not change."""
        settings = self.configuration
        straight = line(steps)
        path = FullSteps(straight) if settings.half_steps == 2 else straight
        made = 0
        while made < path.ticks and not (search is not None and self.input == search.level):
            speed_hz = settings.speed_hz[index]
            law = ramp(path.ticks - made, speed_hz, settings.start_hz, settings.ramp_ms, self._error_ppm)
            ended = yield Travel(path, law, made, search)
            if ended.by_event:
                return
            made = ended.ticks
            if search is not None and made == path.ticks:
                raise Failure(self._not_found(steps, search))

    def _not_found(self, steps: Displacement, search: Search) -> str:
        """Remark it, and return the words."""
        axis = next(axis for axis in AXES if steps[axis])
        level, way, limit = ("high", "free run", FREE_LIMIT) if search.level else ("low", "search", SEARCH_LIMIT)
        what = f"the reference input has not gone {level} in {limit} half steps of the {way}"
        text = f"reference run of {AXIS_NAMES[axis].upper()}: {what}"
        self._events.append(Remark(text))
        return text

    @property
    def purpose(self) -> object:
        """What the command in progress, or in a pause, waits for."""
        parked = self.executor.parked
        return self.executor.purpose if parked is None else parked.request.purpose

    def set_input(self, level: bool) -> None:
        """Take the level of the reference input; a search in a pause is also successful then."""
        self.input = level
        if self.purpose == Search(level):
            self.executor.cut()
            self.settle()

    def settle(self) -> None:
        """End a motion that has been stopped or cut and has no tick left, within this call."""
        if self.executor.stopping and self.executor.due:
            self.executor.tick()

    def power_on(self, level: bool) -> None:
        """The drive signals come up, nothing is referenced."""
        self.input = level
        self.request_power()
        self._put("stages", 1)
        self._put("brake", 1)
        self._put("current_lowering", 0)
        self._put_drive_signals()
        self._put_safe()

    def reset(self) -> None:
        """6.16: no motion, no position; the settings stay, the signals go off (ismif/11)."""
        self.executor.discard()
        self._known = [False] * 3
        for axis in AXES:
            self._set_counter(axis, 0)
        self._put_safe()

    def request_power(self) -> None:
        """Send a pulse: the safety relay closes at its rising edge, if its conditions hold."""
        self._put("power_request", 1)
        self._put("power_request", 0)

    def _configure(self, instruction: Instruction) -> None:
        self.configuration.set(instruction)
        if instruction.code in ("T", "F"):
            self._put_drive_signals()
        elif instruction.code == "Z":
            self._set_pen(0)

    def _set_signal(self, on: int) -> None:
        self._put("pin12", on)
        self._put("spindle", on)

    def _set_pen(self, position: int) -> None:
        """The plotter's relay is on wherever Z is not 0 (ismif/12)."""
        self._pen = position
        self._put("z_relay", int(position != 0))

    def _set_counter(self, axis: int, value: int) -> None:
        self.executor.set_counter(axis, value)
        self._events.append(CounterSet(axis, value))

    def _put_drive_signals(self) -> None:
        self._put("clock_signals", int(self.configuration.clock))
        self._put("full_steps", int(self.configuration.full_step))

    def _put_safe(self) -> None:
        self._set_signal(0)
        self._set_pen(0)

    def _put(self, name: str, level: int) -> None:
        self._events.append(Output(name, level))

    @property
    def position_known(self) -> bool:
        """True if every axis with a motor is referenced."""
        return all(known for axis, known in enumerate(self._known) if not self._is_pen(axis))

    def position_steps(self, axis: int) -> int:
        """Position of an axis in the steps of commands."""
        return self._pen if self._is_pen(axis) else self.executor.counts[axis] // self.configuration.half_steps

    def _is_pen(self, axis: int) -> bool:
        return self.configuration.plotter and axis == 2


def failed(parked: Parked) -> bool:
    """True if this command was parked in a search that ended without finding the switch."""
    request, result = parked.request, parked.result
    return (
        isinstance(request, Travel)
        and isinstance(request.purpose, Search)
        and result == Ended(request.path.ticks, by_event=False)
    )


def _stand(ns: int, purpose: Standing) -> Activity:
    """Let time pass; a pause makes it longer (ismif/10)."""
    left: int | None = ns
    while left is not None:
        left = yield Pause(left, purpose)


def _along(axis: int, steps: int) -> Displacement:
    return tuple(steps if axis == i else 0 for i in range(COUNTERS))
