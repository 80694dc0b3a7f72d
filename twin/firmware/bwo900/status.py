"""Status parameters for programs and files (manual 8.5, P8900 on; 8.7, P12150 on).

    P8900 .. P8942    program, block, cycle, S, loop, feed, motion, dwell: of the block in execution
    P8945 .. P8981    its G functions                P9100 .. P9102    its G92
    P9300 .. P9381    the same of the block in analysis, up to 400 further on; P9500 .. P9502 its G92
    P12150 ..         positions of an axis, mm       P12170            its speed, mm/min
    P12135, 180 ..    its switches, limits, whether it moves       P8559   an M function is waited for

They are computed when read. Without a program they are 0 (cycles: deleted, as in the manual), and the G functions those
at the start of a program (bwo900/33).
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.geometry.groups import Modal
from isel_twin.firmware.bwo900.geometry.in_force import InForce
from isel_twin.firmware.bwo900.numbers import Axis, Cell, G, P
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE, MACHINE_AXES, of_axis
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes
from isel_twin.firmware.bwo900.realtime.channel import Channel
from isel_twin.firmware.bwo900.realtime.executed import Executed

# by offset from P8900 (but for 40, `Executed.motion`) and from P9300
MODAL: Final[Mapping[int, Callable[[Modal], int]]] = {
    Cell.MOTION: lambda m: m.motion,
    Cell.POLAR: lambda m: m.polar,
    Cell.PLANE: lambda m: m.plane,
    Cell.EXACT_STOP: lambda m: m.exact,
    Cell.RADIUS: lambda m: m.radius,
    Cell.AXIS_CORRECTION: lambda m: m.correction,
    Cell.ROTATION: lambda m: m.rotation,
    Cell.COORDINATES: lambda m: m.coordinates,
    Cell.ZERO: lambda m: m.zero,
    Cell.MIRROR_FIRST: lambda m: G.MIRROR_FIRST if m.mirror_first else G.MIRROR_OFF,
    Cell.MIRROR_SECOND: lambda m: G.MIRROR_SECOND if m.mirror_second else G.MIRROR_OFF,
    Cell.OVERRIDE: lambda m: m.override,
    Cell.DIMENSION: lambda m: m.dimension,
    Cell.FEED_KIND: lambda m: m.feed,
    Cell.SPEED_KIND: lambda m: m.speed,
}
PLANE: Final = (Cell.FIRST_AXIS, Cell.SECOND_AXIS, Cell.THIRD_AXIS)
EXECUTED: Final = (
    Cell.PROGRAM, Cell.BLOCK, Cell.CYCLE, Cell.CYCLE_BLOCK, Cell.DEPTH, Cell.CALLER, Cell.CALLER_BLOCK,
    *range(Cell.FIRST_SPINDLE, Cell.LAST_SPINDLE + 1), Cell.PASSES, Cell.PASS, Cell.FEED, Cell.END_FEED, Cell.SPEED,
    Cell.MOTION, Cell.DWELL, Cell.DWELL_LEFT, Cell.SHIFT,
)  # fmt: skip
ANALYSED: Final = (
    Cell.PROGRAM, Cell.BLOCK, Cell.DEPTH_ANALYSED, Cell.CYCLE, Cell.CYCLE_BLOCK, Cell.LOOPS, Cell.FEED, Cell.SHIFT,
)  # fmt: skip
AXIS_CELLS: Final = (
    Axis.STRUCK, Axis.MACHINE_PLACE, Axis.SET_PLACE, Axis.ACTUAL_PLACE, Axis.SHOWN_PLACE, Axis.PROGRAMMED_PLACE,
    Axis.DELTA_PLACE, Axis.SHOWN_SHIFT, Axis.LAG, Axis.ACTUAL_SPEED, Axis.SPEED_NOW, Axis.REFERENCED, Axis.AT_LIMIT,
    Axis.DRIVEN,
)  # fmt: skip

# numbers of all these parameters
NUMBERS: Final = (
    P.M_WAITS,
    *sorted(P.EXECUTED + n for n in {*EXECUTED, *MODAL, *PLANE}),
    *sorted(P.ANALYSED + n for n in {*ANALYSED, *MODAL, *PLANE}),
    *(first + axis for first in (P.SHIFT_EXECUTED, P.SHIFT_ANALYSED) for axis in range(MACHINE_AXES)),
    *(of_axis(axis, offset) for axis in range(MACHINE_AXES) for offset in AXIS_CELLS),
)
_KNOWN: Final = frozenset(NUMBERS)

# deleted at power-on
FORGOTTEN: Final = (
    P.BLOCK_RELEASE, P.TRAVEL_RELEASE, P.SAFETY_HALT, P.HAND_PLANE, P.HAND_ZERO, P.HAND_COORDINATES, P.EXCHANGE,
    P.RELEASE, P.BLOCK_LOCK, P.EMERGENCY_1, P.EMERGENCY_2, P.NOT_INTERPOLATING, P.WITHOUT_DYNAMICS,
)  # fmt: skip
COMMANDS: Final = (  # the same, of an axis
    Axis.BARRED, Axis.SET, Axis.TO_RELATIVE, Axis.TO_ABSOLUTE, Axis.MEASURE, Axis.TO_BASE, Axis.TO_FIXED,
    Axis.BASE_REACHED, Axis.FIXED_REACHED, Axis.RELATIVE_REACHED, Axis.ABSOLUTE_REACHED,
)  # fmt: skip


def at_power_on() -> Iterator[tuple[int, float | None]]:
    """P and values written at power-on: size of the channel, no references and programs, volatile settings."""
    yield from ((P.CHANNEL, 1.0), (P.AXES, float(AXES)), (P.LAST_AXIS, float(AXES)))
    yield from ((number, 0.0) for number in (P.ALL_REFERENCED, P.PROGRAM_ACTIVE, P.PROGRAM_RUNS, P.REFERENCED))
    yield from ((number, 1.0) for number in (P.MODE_TO_PLC, P.MODE_ACTIVE, P.MODE))  # HAND
    yield from ((number, None) for number in FORGOTTEN)
    for axis in range(AXES):
        yield of_axis(axis, Axis.SLOPE), None
        for offset in COMMANDS:
            yield of_axis(axis, offset), None
        yield of_axis(axis, Axis.CHANNEL), 1.0
        yield of_axis(axis, Axis.LOGICAL), axis + 1.0


def value(number: int, interpreter: Interpreter, channel: Channel, axes: Axes) -> float | None:
    """The value of a computed parameter P; None: deleted, or not one of them."""
    if number not in _KNOWN:
        return None
    if number >= P.AXES_FIRST:
        axis, offset = divmod(number - P.AXES_FIRST, AXIS_SIZE)
        shown = offset == Axis.SHOWN_PLACE and channel.unmoved
        return _axis(axis, Axis.PROGRAMMED_PLACE if shown else offset, channel.executed, axes)
    if number == P.M_WAITS:
        return float(channel.halted)
    if number >= P.SHIFT_ANALYSED:
        return interpreter.in_force.frame.shift[number - P.SHIFT_ANALYSED]
    if number >= P.ANALYSED:
        return _analysed(number - P.ANALYSED, interpreter)
    if number >= P.SHIFT_EXECUTED:
        return channel.executed.in_force.frame.shift[number - P.SHIFT_EXECUTED]
    return _executed(number - P.EXECUTED, interpreter, channel)


def _analysed(number: int, interpreter: Interpreter) -> float | None:
    told = interpreter.in_force
    match number:
        case Cell.DEPTH_ANALYSED:
            return float(told.depth)
        case Cell.LOOPS:
            return float(interpreter.stack.loops)
        case Cell.FEED:
            return told.feed_mm_min
    return _of_both(number, told, interpreter.stack.place)


def _executed(number: int, interpreter: Interpreter, channel: Channel) -> float | None:
    executed = channel.executed
    told = executed.in_force
    feed, end_feed = executed.feed_mm_min
    if Cell.FIRST_SPINDLE <= number <= Cell.LAST_SPINDLE:
        return None if executed.block is None else executed.block.speeds.get(number - Cell.FIRST_SPINDLE + 1)
    match number:
        case Cell.MOTION:
            return executed.motion
        case Cell.DEPTH:
            return float(told.depth)
        case Cell.CALLER:
            return float(told.caller[0][1:] or 0)
        case Cell.CALLER_BLOCK:
            return float(told.caller[1])
        case Cell.PASSES | Cell.PASS:
            return float(interpreter.stack.loop[number - Cell.PASSES])
        case Cell.FEED:
            return feed
        case Cell.END_FEED:
            return end_feed
        case Cell.SPEED:
            return 60.0 * channel.speed_mm_s
        case Cell.DWELL:
            return executed.dwell_s
        case Cell.DWELL_LEFT:
            return channel.dwell_left_s
    return _of_both(number, told, executed.place if executed.active else ("", 0))


def _of_both(number: int, told: InForce, place: tuple[str, int]) -> float | None:
    """Cells of the analysed and of the executed block alike; place: its program and number."""
    if number in MODAL:
        return float(MODAL[number](told.modal))
    if number in PLANE:
        plane = told.frame.plane
        return float((plane.first, plane.second, plane.third)[number - PLANE[0]] + 1)
    name, block = told.called_by or place
    match number:
        case Cell.PROGRAM:
            return float(name[1:] or 0)
        case Cell.BLOCK:
            return float(block)
        case Cell.CYCLE:
            return None if told.cycle is None else float(told.cycle)
        case Cell.CYCLE_BLOCK:
            return None if told.cycle is None else float(place[1] if told.called_by else 0)
    return float(G.SHIFT) if any(told.frame.shift) else 0.0


def _axis(axis: int, offset: int, executed: Executed, axes: Axes) -> float:
    frame = executed.frame
    if offset in (Axis.SHOWN_PLACE, Axis.PROGRAMMED_PLACE, Axis.DELTA_PLACE):
        axis = frame.order[axis]
    programmed, shift = executed.target[axis], executed.display_shift_mm(axis)
    place = axes.position[axis]
    if offset in (Axis.SET_PLACE, Axis.SHOWN_PLACE, Axis.DELTA_PLACE) and frame.senses is not None:
        place *= frame.senses[axis]
    match offset:
        case Axis.MACHINE_PLACE:
            return place - axes.set_mm(axis)
        case Axis.ACTUAL_PLACE:
            return axes.actual_mm(axis)
        case Axis.SHOWN_PLACE:
            return place - shift
        case Axis.PROGRAMMED_PLACE:
            return programmed
        case Axis.DELTA_PLACE:
            return programmed - (place - shift)
        case Axis.SHOWN_SHIFT:
            return shift
        case Axis.LAG:
            return place - axes.actual_mm(axis)
        case Axis.ACTUAL_SPEED:
            return 60.0 * axes.actual_mm_s(axis)
        case Axis.SPEED_NOW:
            return 60.0 * axes.speed_mm_s(axis)
        case Axis.STRUCK:
            return _bytes(axes.struck(axis, 2), axes.struck(axis, 1))
        case Axis.REFERENCED:
            return _bytes(axes.referenced[axis], axes.struck(axis, 1))
        case Axis.AT_LIMIT:
            return _bytes(*axes.at_limit(axis))
        case Axis.DRIVEN:
            return float(axes.driven(axis))
    return place


def _bytes(first: bool, second: bool) -> float:
    """Two signals: one in byte 1, one in byte 2."""
    return first + 256.0 * second
