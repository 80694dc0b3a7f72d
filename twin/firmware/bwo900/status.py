"""What the control tells about itself in parameters, for programs and files (manual 8.5, P8900 on; 8.7, P12150 on).

    P8900 .. P8942    program, block, cycle, loop, feed, motion, dwell: of the block that is carried out
    P8945 .. P8981    its G functions                P9100 .. P9102    its G92
    P9300 .. P9381    the same of the block that is analysed, up to 400 further on; P9500 .. P9502 its G92
    P12150 ..         positions of an axis, mm       P12170            its speed, mm/min
    P12135, 180 ..    its switches, limits, whether it moves       P8559   an M function is waited for

They are worked out when they are asked for. Without a program they are 0 (cycles: deleted, as the manual says), and
the G functions those that a program begins with.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Final

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.geometry.groups import Modal
from isel_twin.firmware.bwo900.geometry.in_force import InForce
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE, MACHINE_AXES
from isel_twin.firmware.bwo900.realtime.axes import Axes
from isel_twin.firmware.bwo900.realtime.channel import Channel
from isel_twin.firmware.bwo900.realtime.executed import Executed

MODAL: Final[Mapping[int, Callable[[Modal], int]]] = {
    40: lambda m: m.motion,
    45: lambda m: m.polar,
    50: lambda m: m.plane,
    58: lambda m: m.exact,
    64: lambda m: m.radius,
    65: lambda m: m.correction,
    66: lambda m: m.rotation,
    67: lambda m: m.coordinates,
    69: lambda m: m.zero,
    70: lambda m: 61 if m.mirror_first else 60,
    71: lambda m: 62 if m.mirror_second else 60,
    72: lambda m: m.override,
    78: lambda m: m.dimension,
    80: lambda m: 94,
    81: lambda m: 97,
}
"""By the number behind P8900 (but for 40, see `Executed.motion`) and behind P9300."""
PLANE: Final = (51, 52, 53)
EXECUTED: Final = (0, 1, 4, 5, 12, 13, 14, 34, 35, 36, 37, 38, 40, 41, 42, 79)
ANALYSED: Final = (0, 1, 3, 4, 5, 34, 36, 79)
AXIS_CELLS: Final = (135, 150, 151, 152, 154, 155, 156, 157, 160, 168, 170, 180, 185, 188)
WAITING: Final = 8_559
SHIFT_EXECUTED, SHIFT_ANALYSED = 9_100, 9_500

NUMBERS: Final = (
    WAITING,
    *sorted(8_900 + n for n in {*EXECUTED, *MODAL, *PLANE}),
    *sorted(9_300 + n for n in {*ANALYSED, *MODAL, *PLANE}),
    *(first + axis for first in (SHIFT_EXECUTED, SHIFT_ANALYSED) for axis in range(MACHINE_AXES)),
    *(12_000 + AXIS_SIZE * axis + offset for axis in range(MACHINE_AXES) for offset in AXIS_CELLS),
)
"""All of them."""
_KNOWN: Final = frozenset(NUMBERS)


def at_power_on(axes: int) -> Iterator[tuple[int, float | None]]:
    """P and values written at power-on: size of the channel, state without references and programs, and the settings
    that are not kept."""
    yield from ((8_550, 1.0), (8_551, float(axes)), (8_552, float(axes)))
    yield from ((number, 0.0) for number in (8_579, 8_685, 8_687, 8_709))
    yield from ((number, 1.0) for number in (8_683, 8_688, 8_703))  # HAND
    yield from ((number, None) for number in (8_701, 8_702, 8_757, 8_758, 8_759, 8_880, 8_891, 8_893, 8_894))
    for axis in range(axes):
        first = 12_000 + AXIS_SIZE * axis
        yield from ((first + 136, None), (first + 198, 1.0), (first + 199, axis + 1.0))


def value(number: int, interpreter: Interpreter, channel: Channel, axes: Axes) -> float | None:
    """The value of a parameter P that is worked out; None: it is deleted, or not one of them."""
    if number not in _KNOWN:
        return None
    if number >= 12_000:
        axis, offset = divmod(number - 12_000, AXIS_SIZE)
        return _axis(axis, offset, channel.executed, axes)
    if number == WAITING:
        return float(channel.halted)
    if number >= SHIFT_ANALYSED:
        return interpreter.in_force.frame.shift[number - SHIFT_ANALYSED]
    if number >= 9_300:
        return _analysed(number - 9_300, interpreter)
    if number >= SHIFT_EXECUTED:
        return channel.executed.in_force.frame.shift[number - SHIFT_EXECUTED]
    return _executed(number - 8_900, interpreter, channel)


def _analysed(number: int, interpreter: Interpreter) -> float | None:
    told = interpreter.in_force
    if number in MODAL:
        return float(MODAL[number](told.modal))
    if number in PLANE:
        return _axis_of_plane(told, number)
    name, block = interpreter.place
    in_cycle = told.called_by
    match number:
        case 0:
            return float((in_cycle or (name, block))[0][1:] or 0)
        case 1:
            return float((in_cycle or (name, block))[1])
        case 3:
            return float(told.depth)
        case 4:
            return None if told.cycle is None else float(told.cycle)
        case 5:
            return None if told.cycle is None else float(block if in_cycle else 0)
        case 34:
            return float(interpreter.loops)
        case 36:
            return told.feed_mm_min
    return 92.0 if any(told.frame.shift) else 0.0


def _executed(number: int, interpreter: Interpreter, channel: Channel) -> float | None:
    executed = channel.executed
    told = executed.in_force
    if number == 40:
        return executed.motion
    if number in MODAL:
        return float(MODAL[number](told.modal))
    if number in PLANE:
        return _axis_of_plane(told, number)
    name, block = executed.place if executed.active else ("", 0)
    in_cycle = told.called_by
    feed, end_feed = executed.feed_mm_min
    match number:
        case 0:
            return float((in_cycle or (name, block))[0][1:] or 0)
        case 1:
            return float((in_cycle or (name, block))[1])
        case 4:
            return None if told.cycle is None else float(told.cycle)
        case 5:
            return None if told.cycle is None else float(block if in_cycle else 0)
        case 12:
            return float(told.depth)
        case 13:
            return float(told.caller[0][1:] or 0)
        case 14:
            return float(told.caller[1])
        case 34 | 35:
            return float(interpreter.loop[number - 34])
        case 36:
            return feed
        case 37:
            return end_feed
        case 38:
            return 60.0 * channel.speed_mm_s
        case 41:
            return executed.dwell_s
        case 42:
            return channel.dwell_left_s
    return 92.0 if any(told.frame.shift) else 0.0


def _axis_of_plane(told: InForce, number: int) -> float:
    plane = told.frame.plane
    return float((plane.first, plane.second, plane.third)[number - PLANE[0]] + 1)


def _axis(axis: int, offset: int, executed: Executed, axes: Axes) -> float:
    frame = executed.frame
    if offset in (154, 155, 156):
        axis = frame.order[axis]
    programmed, shift = executed.target[axis], executed.display_shift_mm(axis)
    place = axes.set_mm(axis)
    if offset in (151, 154, 156) and frame.senses is not None:
        place *= frame.senses[axis]
    match offset:
        case 152:
            return axes.actual_mm(axis)
        case 154:
            return place - shift
        case 155:
            return programmed
        case 156:
            return programmed - (place - shift)
        case 157:
            return shift
        case 160:
            return place - axes.actual_mm(axis)
        case 168:
            return 60.0 * axes.actual_mm_s(axis)
        case 170:
            return 60.0 * axes.speed_mm_s(axis)
        case 135:
            return _bytes(axes.struck(axis, 2), axes.struck(axis, 1))
        case 180:
            return _bytes(axes.referenced[axis], axes.struck(axis, 1))
        case 185:
            return _bytes(*axes.at_limit(axis))
        case 188:
            return float(axes.driven(axis))
    return place


def _bytes(first: bool, second: bool) -> float:
    """Two signals: one in byte 1, one in byte 2."""
    return first + 256.0 * second
