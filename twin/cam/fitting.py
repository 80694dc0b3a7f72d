"""Extents of a file's ways, and a zero of the work with which they are within the travel.

    file, a zero     --- read --->   X 10 .. 60      a coordinate that follows the zero, or stays where it is:
    file, 1 mm more  --- read --->   X 11 .. 61      G53, G28, a zero of its own

Nobody has to know what the words of a format do with the zero: the file is read with two zeros, and compared.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import zip_longest
from typing import Final, TypeAlias

from isel_twin.cam import arcs
from isel_twin.cam.course import TravelError
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Element, Line, Place, Point, Rapid, Reference, Remark, Toolpath
from isel_twin.cam.written import AXES, MachineAxes

Read: TypeAlias = Callable[[CamSettings], Toolpath]

FIT: Final = "fit"  # in place of a zero
ROOM_MM = 5.0  # kept from the ends of the travel, where there is as much
_SAME_MM = 1e-6
_ASIDE_MM = 0.577215  # so that no way has no length, as one to where the tool stands anyway
_NO_WAY = "the way depends on the zero of the work; choose one by hand"

_Span: TypeAlias = tuple[float, float]  # least and greatest, mm
_Ends: TypeAlias = tuple[tuple[float, Place], tuple[float, Place]]  # the same, with what leads there


@dataclass(frozen=True)
class Extents:
    """Reach of all motions along each axis, in the sense of the counters, mm; None: nowhere."""

    work: tuple[_Span | None, ...]  # from the zero, of what follows it
    fixed: tuple[_Ends | None, ...]  # of the machine, of what does not


class BeyondError(CamError):
    """A way beyond the travel, with all that it takes to mend it. zero: one that fits, if there is one."""

    def __init__(self, why: str, zero: Point | None = None, key: str = "") -> None:
        words = "" if zero is None else in_words(zero)
        keeps = f"{key} = [{words.replace(',', ', ')}] keeps it"
        super().__init__(why if zero is None else f"{why}: --zero {words} fits, or --zero fit ({keeps})")
        self.why, self.zero = why, zero


def with_zero(settings: CamSettings, zero: Point) -> CamSettings:
    """The settings with this zero of the work, which is that of G54, too."""
    return replace(settings, zero=zero, zeros={**settings.zeros, 1: zero} if 1 in settings.zeros else settings.zeros)


def in_words(zero: Point) -> str:
    """A zero as an option has it: X,Y,Z."""
    return ",".join(map(_plain, zero))


def fitted(read: Read, axes: MachineAxes, settings: CamSettings) -> CamSettings:
    """The settings with the nearest zero that keeps all that follows it within the travel. Raises CamError if none
    does."""
    found = extents(read, settings)
    zero, why = _nearest(found, axes, _zero(settings))
    if why:
        raise CamError(f"{_drawn(found, axes, settings)}: no zero fits: {why}")
    return with_zero(settings, zero)


def remarked(path: Toolpath, settings: CamSettings) -> Iterator[Element]:
    """The same path, behind a remark that says its zero."""
    yield Remark(Place(1), f"zero of the work: {in_words(_zero(settings))}")
    yield from path


def advised(error: TravelError, read: Read, axes: MachineAxes, settings: CamSettings) -> BeyondError:
    """The refusal of a way beyond the travel, with the zero that mends it."""
    try:
        found = extents(read, settings)
    except CamError as other:
        return BeyondError(f"{error}; no zero that fits can be told: {other}")
    zero, why = _nearest(found, axes, _zero(settings))
    told = f"{error}; {_drawn(found, axes, settings)}"
    if why := _fixed_beyond(found, axes) or why:
        return BeyondError(f"{told}: no zero fits: {why}")
    return BeyondError(told, zero, "[cam] zeros.1" if 1 in settings.zeros else "[cam] zero")


def extents(read: Read, settings: CamSettings) -> Extents:
    """Raises CamError, also for a file of which they cannot be told."""
    try:
        return _extents(read, settings, (1.0, 1.0, 1.0))
    except CamError:  # as of an arc that begins where the tool stands before the job
        return _extents(read, settings, (0.0, 0.0, 1.0))


def _extents(read: Read, settings: CamSettings, by_mm: Point) -> Extents:
    """by_mm: between the two zeros, 0 or 1."""
    x, y, z = (at + _ASIDE_MM * by for at, by in zip(_zero(settings), by_mm, strict=True))
    zero, moved = (x, y, z), with_zero(settings, (x + by_mm[0], y + by_mm[1], z + by_mm[2]))
    start, signs = settings.machine_point(settings.start), (1, 1, settings.z_sign)
    work: list[_Span | None] = [None] * len(AXES)
    fixed: list[_Ends | None] = [None] * len(AXES)
    for one, other in zip_longest(_motions(read(with_zero(settings, zero))), _motions(read(moved))):
        if one is None or other is None or one.place != other.place:
            raise CamError(_NO_WAY)
        if isinstance(one, Reference) or isinstance(other, Reference):
            start = one.ends(start) if isinstance(one, Reference) else start
            continue
        for axis, span in enumerate(_reach(one, start)):
            low, high = sorted(signs[axis] * mm for mm in span)
            by = signs[axis] * (other.to[axis] - one.to[axis])
            if abs(by) < _SAME_MM:
                least, most = (low, one.place), (high, one.place)
                ends = fixed[axis] or (least, most)
                fixed[axis] = min(ends[0], least), max(ends[1], most)
            elif abs(by - 1.0) < _SAME_MM:
                low, high = (round(mm - zero[axis], 9) for mm in (low, high))
                before = work[axis] or (low, high)
                work[axis] = min(before[0], low), max(before[1], high)
            else:
                raise CamError(_NO_WAY, one.place)
        start = one.to
    return Extents(tuple(work), tuple(fixed))


def _zero(settings: CamSettings) -> Point:
    return settings.zeros.get(1, settings.zero)


def _motions(path: Toolpath) -> Iterator[Rapid | Line | Arc | Reference]:
    return (element for element in path if isinstance(element, (Rapid, Line, Arc, Reference)))


def _reach(motion: Rapid | Line | Arc, start: Point) -> list[_Span]:
    """Least and greatest coordinates of a motion behind its start."""
    reach = [(mm, mm) for mm in motion.to]
    if isinstance(motion, Arc):
        of = arcs.shape(motion, start)
        reach[of.a], reach[of.b] = arcs.bounds(of)
    return reach


def _nearest(found: Extents, axes: MachineAxes, zero: Point) -> tuple[Point, str]:
    """The zero nearest to this one that fits, and "", or this one, and why there is none."""
    chosen = list(zero)
    for axis, (name, (low, high)) in enumerate(zip(AXES, axes.travel_mm, strict=True)):
        if (span := found.work[axis]) is None:
            continue
        least, most = low - span[0], high - span[1]  # of the zero
        if most < least - 0.5 / axes.steps_mm[axis]:  # places are rounded to a count
            return zero, f"along {name} the file is longer than the travel by {_plain(least - most)} mm"
        # counters are 0 where the reference run ends, but the far switch may stand before the end of the travel
        if not least - _SAME_MM <= zero[axis] <= max(most - ROOM_MM, least) + _SAME_MM:
            chosen[axis] = _within(zero[axis], least, most)
    return (chosen[0], chosen[1], chosen[2]), ""


def _fixed_beyond(found: Extents, axes: MachineAxes) -> str:
    """A place beyond the travel that no zero moves, in words; "" if there is none."""
    for name, ends, (low, high), steps in zip(AXES, found.fixed, axes.travel_mm, axes.steps_mm, strict=True):
        for mm, place in ends or ():
            if not low - 0.5 / steps <= mm <= high + 0.5 / steps:
                where = f"line {place.line} leads to {name} {_plain(mm)} mm wherever the zero of the work is"
                return f"{where} (G53, G28, G91 from the start, a zero of its own)"
    return ""


def _within(mm: float, least: float, most: float) -> float:
    """The nearest value between two, with room to both, and a round one where that is possible."""
    room = min(ROOM_MM, max((most - least) / 2.0, 0.0))
    least, most = least + room, most - room
    nearest = min(max(mm, least), most)
    whole = math.ceil(nearest) if nearest == least else math.floor(nearest)
    return float(whole) if least <= whole <= most else round(nearest, 6)


def _drawn(found: Extents, axes: MachineAxes, settings: CamSettings) -> str:
    """Extents of a file about its zero, Z as the file has it, and the travel, in words."""
    signs = 1, 1, settings.z_sign if settings.file_z_up else -settings.z_sign
    drawn = [_in_words(name, span, sign) for name, span, sign in zip(AXES, found.work, signs, strict=True)]
    travel = [_in_words(name, span, 1) for name, span in zip(AXES, axes.travel_mm, strict=True) if span[0] < span[1]]
    draws = f"the file draws {', '.join(filter(None, drawn))} mm about its zero, " if any(drawn) else ""
    return f"{draws}the machine travels {', '.join(travel)} mm"


def _in_words(name: str, span: _Span | None, sign: int) -> str:
    if span is None:
        return ""
    low, high = sorted(sign * mm for mm in span)
    return f"{name} {_plain(low)} to {_plain(high)}" if low < high else f"{name} {_plain(low)}"


def _plain(mm: float) -> str:
    return f"{round(mm, 6) + 0.0:.6f}".rstrip("0").rstrip(".")
