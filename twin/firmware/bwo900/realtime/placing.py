"""Moves of single axes that the PLC asks for while no program runs (manual 8.7, P12111 to P12133; bwo900/74).

    written     P12111 relative, P12112 absolute: the place is the value           reached: P12191, P12192
    byte = 1    P12131  1, 2  measuring in +, in -, until the probe acts                    P12181
                        3, 4  the next edge of the probe takes the place, it is taken now
                P12132  1, 2  emergency position, absolute, relative: P12032, P12033        P12182, byte 1
                        3, 4  base position, absolute, relative: P12034, P12035             P12182, byte 3
                P12133  1, 2  fixed position P12036; to and fro by P12037                   P12183, bytes 1, 2

Axes move independently, several at once. A deleted value or a byte of 0 ends its move; a new move of an axis begins
when the one before has been braked. `reached` is set when the set point is there, a following error before the axis.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from typing import Final

from isel_twin.base.units import SECOND_NS
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE, Parameters, byte, of_axis
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES, Axes
from isel_twin.firmware.bwo900.realtime.homing import under_way
from isel_twin.firmware.bwo900.realtime.jog import FURTHEST_MM, SPEED_MM_MIN
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest


@dataclass(frozen=True)
class Kind:
    """A kind of move. Numbers are offsets of an axis from P12000."""

    command: int
    byte: int  # of the command, 1 to 4; 0: all of it is the place
    reached: int
    reached_byte: int
    place: int = 0  # where to; 0: on until the probe acts
    relative: bool = False
    speed: int = Axis.SPEED
    override: int = 0  # which one counts; 0: none does
    channel_override: int = 0  # P with that of the channel
    sense: int = 0  # +1, -1 of a measuring move
    emergency: bool = False
    swings: bool = False
    takes: bool = False  # no move: the place is taken as measured
    releases: bool = False  # no move: the next edge of the probe does so


RELATIVE: Final = Kind(
    Axis.TO_RELATIVE, 0, Axis.RELATIVE_REACHED, 1, Axis.TO_RELATIVE, relative=True, speed=Axis.RELATIVE_SPEED,
    override=Axis.RELATIVE_OVERRIDE, channel_override=P.RELATIVE_OVERRIDE,
)  # fmt: skip
ABSOLUTE: Final = Kind(
    Axis.TO_ABSOLUTE, 0, Axis.ABSOLUTE_REACHED, 1, Axis.TO_ABSOLUTE, speed=Axis.ABSOLUTE_SPEED,
    override=Axis.ABSOLUTE_OVERRIDE, channel_override=P.ABSOLUTE_OVERRIDE,
)  # fmt: skip
SWINGING: Final = Kind(
    Axis.TO_FIXED, 2, Axis.FIXED_REACHED, 2, Axis.SWING_MM, relative=True, speed=Axis.FIXED_SPEED,
    override=Axis.FIXED_OVERRIDE, swings=True,
)  # fmt: skip
_FIXED: Final = Axis.FIXED_OVERRIDE
KINDS: Final = (
    RELATIVE,
    ABSOLUTE,
    Kind(Axis.MEASURE, 1, Axis.MEASURED, 1, override=Axis.OVERRIDE, sense=1),
    Kind(Axis.MEASURE, 2, Axis.MEASURED, 1, override=Axis.OVERRIDE, sense=-1),
    Kind(Axis.MEASURE, 3, Axis.MEASURED, 1, releases=True),
    Kind(Axis.MEASURE, 4, Axis.MEASURED, 1, takes=True),
    Kind(Axis.TO_BASE, 1, Axis.BASE_REACHED, 1, Axis.EMERGENCY_MM, emergency=True),
    Kind(Axis.TO_BASE, 2, Axis.BASE_REACHED, 1, Axis.EMERGENCY_WAY_MM, relative=True, emergency=True),
    Kind(Axis.TO_BASE, 3, Axis.BASE_REACHED, 3, Axis.BASE_MM, override=_FIXED),
    Kind(Axis.TO_BASE, 4, Axis.BASE_REACHED, 3, Axis.BASE_WAY_MM, relative=True, override=_FIXED),
    Kind(Axis.TO_FIXED, 1, Axis.FIXED_REACHED, 1, Axis.FIXED_MM, speed=Axis.FIXED_SPEED, override=_FIXED),
    SWINGING,
)
COMMANDS: Final = frozenset(kind.command for kind in KINDS)


@dataclass(frozen=True)
class _Move:
    kind: Kind
    start: int  # places in increments
    target: int
    ends: bool = False  # it is braked, and over when the axis stands
    dwells_ns: int | None = None  # it swings, and stands at a place until then


class Placing:
    def __init__(self, parameters: Parameters, axes: Axes) -> None:
        self._parameters, self._axes = parameters, axes
        self._moves: dict[int, _Move] = {}  # by axis
        self.wants: dict[int, Kind] = {}  # moves that have not begun, by axis
        self._commands: dict[int, float] = {}  # as written last, by number
        self.run: SetPointRun | None = None

    @property
    def busy(self) -> bool:
        return bool(self._moves)

    @property
    def next_ns(self) -> int | None:
        """When an axis stands, or has stood long enough."""
        times = [move.dwells_ns for move in self._moves.values() if move.dwells_ns is not None]
        if (run := self.run) is not None:
            plan, _ = under_way(run, run.start_ns)
            stands = [run.start_ns + plan.stands_at(axis) * PERIOD_NS for axis in self._moves]
            times += [t for t in (*stands, run.end_ns) if t > self._axes.now_ns]
        return min(times, default=None)

    def measuring(self) -> Iterator[tuple[int, int]]:
        """Axis and sense of each measuring move."""
        for axis, move in self._moves.items():
            if move.kind.sense and not move.ends:
                yield axis, move.kind.sense

    # requests

    def written(self, number: int) -> list[tuple[int, Kind]]:
        """Take a written command. End the moves it ends; return axis and kind of those that are to begin."""
        axis, offset = divmod(number - P.AXES_FIRST, AXIS_SIZE)
        p = self._parameters
        value, before = p.get(number), self._commands.get(number, 0.0)
        self._commands[number] = value
        begin = []
        for kind in (kind for kind in KINDS if kind.command == offset):
            asked = byte(value, kind.byte) if kind.byte else p.loaded(number)
            if asked and kind.byte and byte(before, kind.byte):
                continue
            if asked or (kind.byte and byte(before, kind.byte)) or not kind.byte:
                self._reach(axis, kind, reached=False)
                self._end(axis, kind)
            if asked and not kind.releases:
                begin.append((axis, kind))
        return begin

    def want(self, axis: int, kind: Kind) -> None:
        """Request a move: it begins once the axis stands. Raises ProgramError: M1008 the place is one of the machine,
        and the axis has no reference point; M2101 to M2104 a limit switch or a software limit is in the way."""
        if not (kind.relative or kind.sense or self._axes.referenced[axis]):
            raise ProgramError(Code.NOT_REFERENCED, NAMES[axis])
        self._target(axis, kind)
        self.wants[axis] = kind
        if axis in self._moves:
            self.brake(axis)

    def begin(self) -> None:
        """Begin what is wanted of axes that stand."""
        for axis, kind in [(axis, kind) for axis, kind in self.wants.items() if axis not in self._moves]:
            del self.wants[axis]
            here = self._axes.counts[axis]
            try:
                move = _Move(kind, here, self._target(axis, kind))
            except ProgramError:  # the axis has moved since it was wanted
                continue
            self._moves[axis] = move
            self._go(axis)

    def _target(self, axis: int, kind: Kind) -> int:
        axes, p = self._axes, self._parameters
        per_mm, here = axes.limits().increments_per_mm[axis], axes.counts[axis]
        low, high = axes.software_limits(axis)
        if kind.sense:
            target_mm = min(high, FURTHEST_MM) if kind.sense > 0 else max(low, -FURTHEST_MM)
        else:
            target_mm = p.axis(axis, kind.place, 0.0) + (here / per_mm if kind.relative else 0.0)
        target = round(target_mm * per_mm)
        for sense, beyond, code, end, struck in (
            (1, target_mm > high, Code.SOFTWARE_LIMIT_HIGH, 2, Code.HARDWARE_LIMIT_HIGH),
            (-1, target_mm < low, Code.SOFTWARE_LIMIT_LOW, 1, Code.HARDWARE_LIMIT_LOW),
        ):
            if (target - here) * sense > 0 and beyond:
                raise ProgramError(code, NAMES[axis])
            if (target - here) * sense > 0 and axes.struck(axis, end):
                raise ProgramError(struck, NAMES[axis])
        return target

    # motion

    def advance(self) -> None:
        for axis in [axis for axis in self._moves if self._stands(axis)]:
            move = self._moves[axis]
            if move.ends:
                del self._moves[axis]
            elif self._axes.counts[axis] == move.target or move.dwells_ns is not None:
                self._arrived(axis, move)
        if self.run is not None and self._axes.now_ns >= self.run.end_ns and all(map(self._stands, self._moves)):
            self.run = None

    def _arrived(self, axis: int, move: _Move) -> None:
        kind, now_ns = move.kind, self._axes.now_ns
        if not kind.swings:
            del self._moves[axis]
            if not kind.sense:
                self._reach(axis, kind, reached=True)
            return
        at_start = move.target == move.start
        if move.dwells_ns is None:
            self._reach(axis, kind, reached=not at_start)
            seconds = self._parameters.axis(axis, Axis.SWING_START_S if at_start else Axis.SWING_END_S, 0.0)
            move = replace(move, dwells_ns=now_ns + round(max(seconds, 0.0) * SECOND_NS))
        assert move.dwells_ns is not None
        if now_ns < move.dwells_ns or axis in self._axes.unsettled():
            self._moves[axis] = replace(move, dwells_ns=max(move.dwells_ns, now_ns + PERIOD_NS))
            return
        per_mm = self._axes.limits().increments_per_mm[axis]
        way = round(self._parameters.axis(axis, kind.place, 0.0) * per_mm)
        self._reach(axis, kind, reached=False)
        self._moves[axis] = replace(move, target=move.start + (way if at_start else 0), dwells_ns=None)
        self._go(axis)

    def scale(self) -> None:
        """Overrides or locks have changed: every move goes on at the speed it may have."""
        for axis, move in self._moves.items():
            if not move.ends and move.dwells_ns is None:
                self._go(axis)

    def brake(self, axis: int) -> None:
        """Brake the move of an axis."""
        self._moves[axis] = move = replace(self._moves[axis], ends=True, dwells_ns=None)
        sharpness = self._axes.sharpness(axis, 1 if move.target > self._axes.counts[axis] else -1)
        self._plan(axis, lambda plan, tick: plan.braked(axis, tick, sharpness))

    def brake_all(self) -> None:
        """Brake all moves, and drop those that wait."""
        self.wants.clear()
        for axis in list(self._moves):
            self.brake(axis)

    def cut(self) -> None:
        """The drives are off: forget everything."""
        self.wants.clear()
        self._moves.clear()
        self.run = None

    def _end(self, axis: int, kind: Kind) -> None:
        if self.wants.get(axis) == kind:
            del self.wants[axis]
        if axis in self._moves and self._moves[axis].kind == kind:
            self.brake(axis)

    def _go(self, axis: int) -> None:
        """Move an axis to its target from where it is, or hold it."""
        move, axes = self._moves[axis], self._axes
        per_mm, here = axes.limits().increments_per_mm[axis], axes.counts[axis]
        speed = self._speed_mm_s(axis, move.kind) * self._factor(axis, move.kind) * per_mm
        sign = 1 if move.target > here else -1
        if axes.barred(axis, sign) or not speed:
            self._plan(axis, lambda plan, tick: plan.braked(axis, tick, axes.sharpness(axis, sign)))
            return
        left, stands = move.target - here, self._stands(axis)

        def towards(plan: Indexer, tick: int) -> Indexer:
            made = 0 if self.run is None else self.run.displacement(axes.now_ns)[axis]
            return (plan.to if stands else plan.towards)(axis, tick, float(made + left), speed)

        self._plan(axis, towards)

    def _plan(self, axis: int, change: Callable[[Indexer, int], Indexer]) -> None:
        """Change the plan of an axis from now on; without a run one begins."""
        axes, now_ns = self._axes, self._axes.now_ns
        limits = axes.limits()
        ramp = limits.rapid_acceleration[axis] * limits.increments_per_mm[axis]
        run = self.run
        if run is None:
            run = SetPointRun(at_rest(AXES, PERIOD_NS, ramp, ("placing", now_ns)), PERIOD_NS, now_ns)
        plan, tick = under_way(run, now_ns)
        self.run = run.with_plan(change(replace(plan, acceleration=ramp), tick))
        if not self.run.last:
            self.run = None

    def _speed_mm_s(self, axis: int, kind: Kind) -> float:
        fastest = self._axes.limits().hand[axis]
        if kind.sense:
            return min(self._parameters.given(P.HAND_FEED, SPEED_MM_MIN) / 60.0, fastest)
        asked = self._parameters.axis(axis, kind.speed, 0.0) / 60.0
        return min(asked, fastest) if asked > 0.0 else fastest

    def _factor(self, axis: int, kind: Kind) -> float:
        if not kind.override:
            return 1.0
        p = self._parameters
        channel = p.get(kind.channel_override) if kind.channel_override else 0.0
        which = p.axis(axis, kind.override, 0.0) or channel
        return overrides.percent(p, int(which)) / 100.0

    def _stands(self, axis: int) -> bool:
        run = self.run
        if run is None:
            return True
        plan, _ = under_way(run, run.start_ns)
        return plan.stands(axis, run.count(self._axes.now_ns))

    def _reach(self, axis: int, kind: Kind, *, reached: bool) -> None:
        """Set or clear the byte that tells that the place is reached; that of measuring is set by the probe."""
        number, shift = of_axis(axis, kind.reached), 8 * (kind.reached_byte - 1)
        others = int(self._parameters.get(number)) & ~(0xFF << shift)
        self._parameters.write(number, float(others | int(reached) << shift))
