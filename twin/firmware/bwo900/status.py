"""What the control tells about itself in parameters, for programs and files (manual 8.5, P8900 on; 8.7, P12150 on).

    P8900, P8901   program and block in execution       P9300, P9301   those that are analysed
    P8934 .. P8942 loop, feed, motion, dwell            P9340 .. P9381 G functions that are in force for the next block
    P12150 ..      positions of an axis, mm             P12170         its speed, mm/min

They are worked out when they are asked for.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final, Protocol

from isel_twin.firmware.bwo900.channel import Channel
from isel_twin.firmware.bwo900.groups import Modal
from isel_twin.firmware.bwo900.interpreter import Interpreter
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE

__all__ = ["NUMBERS", "cell", "shown"]

MODAL: Final[Mapping[int, Callable[[Modal], int]]] = {
    9_340: lambda m: m.motion,
    9_345: lambda m: m.polar,
    9_350: lambda m: m.plane,
    9_358: lambda m: m.exact,
    9_364: lambda m: m.radius,
    9_365: lambda m: m.correction,
    9_366: lambda m: m.rotation,
    9_367: lambda m: m.coordinates,
    9_369: lambda m: m.zero,
    9_370: lambda m: 61 if m.mirror_first else 60,
    9_371: lambda m: 62 if m.mirror_second else 60,
    9_372: lambda m: m.override,
    9_378: lambda m: m.dimension,
    9_380: lambda m: 94,
    9_381: lambda m: 97,
}


NUMBERS: Final = (
    *range(8_900, 8_943),
    *range(9_300, 9_382),
    *(12_000 + AXIS_SIZE * axis + offset for axis in range(3) for offset in range(150, 171)),
)
"""Those that may have a value."""


class Seen(Protocol):
    """What an axis is at: `axis` from 0, mm and mm/s."""

    def set_mm(self, axis: int) -> float: ...
    def actual_mm(self, axis: int) -> float: ...
    def speed_mm_s(self, axis: int) -> float: ...


def cell(number: int, interpreter: Interpreter, channel: Channel, seen: Seen, axes: int) -> float | None:
    """The value of such a parameter P; None: it is not one of them."""
    if 9_300 <= number < 9_400:
        return _analysed(number, interpreter)
    if 8_900 <= number < 9_000:
        return _executed(number, interpreter, channel)
    axis, offset = divmod(number - 12_000, AXIS_SIZE)
    if 0 <= axis < axes and 150 <= offset <= 170:
        return _axis(axis, offset, interpreter, seen)
    return None


def _analysed(number: int, interpreter: Interpreter) -> float | None:
    if not interpreter.active:
        return None
    if (part := MODAL.get(number)) is not None:
        return float(part(interpreter.modal))
    name, block = interpreter.place
    plane = interpreter.frame.plane
    match number:
        case 9_300:
            return float(name[1:] or 0)
        case 9_301:
            return float(block)
        case 9_303:
            return float(interpreter.depth)
        case 9_334:
            return float(len(interpreter.loops))
        case 9_336:
            return interpreter.feed_mm_min
        case 9_351 | 9_352 | 9_353:
            return float((plane.first, plane.second, plane.third)[number - 9_351] + 1)
        case 9_379:
            return 92.0 if any(interpreter.frame.shift) else 0.0
    return None


def _executed(number: int, interpreter: Interpreter, channel: Channel) -> float | None:
    if not channel.active:
        return None
    name, block = channel.block
    match number:
        case 8_900:
            return float(name[1:] or 0)
        case 8_901:
            return float(block)
        case 8_934 | 8_935 if interpreter.loops:
            passes, left = interpreter.loops[-1]
            return float(passes if number == 8_934 else passes - left + 1)
        case 8_936:
            return channel.feed_mm_min
        case 8_938:
            return 60.0 * channel.speed_mm_s
        case 8_940:
            return channel.motion
        case 8_941 | 8_942:
            programmed, rest = channel.dwell_s
            return programmed if number == 8_941 else rest
    return None


def shown(axis: int, interpreter: Interpreter) -> float:
    """How much the display is off the machine's coordinates, mm: zero point, G92, tool length."""
    frame = interpreter.frame
    return frame.zero[axis] + frame.shift[axis] + (frame.length if axis == frame.plane.third else 0.0)


def _axis(axis: int, offset: int, interpreter: Interpreter, seen: Seen) -> float | None:
    shift, place = shown(axis, interpreter), seen.set_mm(axis)
    match offset:
        case 150 | 151:
            return place
        case 152:
            return seen.actual_mm(axis)
        case 154:
            return place - shift
        case 155:
            return interpreter.program_position[axis]
        case 156:
            return interpreter.program_position[axis] - (place - shift)
        case 157:
            return shift
        case 160:
            return place - seen.actual_mm(axis)
        case 170:
            return 60.0 * seen.speed_mm_s(axis)
    return None
