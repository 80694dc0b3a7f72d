"""Tool radius correction G41, G42: the path of the tool's centre beside the contour (manual 7.2 to 7.7).

    contour    a ----> corner ----> b           side +1: the tool is on the left
    offset     each element moved by the radius, and

      outer corner, change of direction > P8845       an arc about the corner (P8845 deleted: always)
      outer corner, otherwise                          both prolonged to their meeting point
      the way back                                     an arc, as outside; an arc may lead inside (bwo900/63)
      inner corner                                     both cut at their meeting point
      tangential                                       nothing

    switching on     a line, which ends at right angles to the beginning of the next element, a radius away
    switching off    a line, which begins where the corrected path has ended
    another radius   an element begins at the old distance and ends at the new one

Blocks without a path in the plane are carried out at the meeting point, or at the end of the arc; at most 12 in a row
(M1157). A corner depends only on its two elements. A contour that the tool cannot follow gives a message:

    M1152    an inner circle that is not larger than the tool
    M1153    switched on or off with a circle
    M1156    two circles, corrected, do not meet
    M1223    an inner corner takes more of an element than there is, or the line and the circle do not meet
    M1232    another plane, and the correction is still on
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import Correction, PathBlock, Text
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Plane, Point, Straight
from isel_twin.firmware.bwo900.geometry.plane import (
    STRAIGHT_RAD,
    UV,
    bend,
    crosses_again,
    flat_length,
    heading,
    meetings,
    offset,
    share_of,
)
from isel_twin.firmware.bwo900.messages import Code, ProgramError

MOST_EMPTY: Final = 12  # blocks without a path in a row (M1157)
NEAR_MM: Final = 1e-7
NEAR: Final = 1e-9  # share of an element
SHARPEST: Final = 120.0  # degrees, for P8845 = 0: above this change of direction an arc


def corner_arc(deviation_deg: float, threshold: float | None) -> bool:
    """True if an outer corner gets an arc. threshold: P8845; None: deleted."""
    return threshold is None or deviation_deg > (threshold or SHARPEST)


@dataclass
class _Open:
    """A block whose elements are being corrected."""

    block: PathBlock
    left: int  # elements still to be corrected
    done: list[Element] = field(default_factory=list)

    def add(self, *elements: Element) -> None:
        """Append the result of one more of its elements."""
        self.done += elements
        self.left -= 1

    def tell(self, text: str) -> None:
        """Have the block say that about the special case of 7.2, unless it says something else."""
        self.block = self.block.like(text=self.block.text or Text(f"G40 without a path, then another plane: {text}"))


@dataclass
class _Last:
    """The corrected element that waits for the next one: programmed, moved, and its beginning."""

    element: Element
    moved: Element
    begin: Point
    share: float  # of the moved element, where it begins
    open: _Open
    correction: Correction
    approach: bool = False  # the line that switches the correction on: its end is not yet known

    @property
    def plane(self) -> Plane:
        return self.open.block.plane


_Place = tuple[Point, float]  # a point of a moved element, and its share of the element


class Offset:
    """Takes blocks and returns them corrected."""

    def __init__(self, threshold: float | None = None, *, in_place: bool = False) -> None:
        """threshold: P8845. in_place: `Readings.plane_change_in_place`."""
        self._threshold = threshold
        self._in_place = in_place
        self._open: deque[_Open] = deque()
        self._last: _Last | None = None
        self._place: tuple[Plane, UV] | None = None
        """Where the corrected path ended, if the correction was switched off in a block without a path."""
        self._strayed = False
        """It has been left for a place that was wrong by the tool's offset; the next line ends where it should."""
        self._waiting: list[tuple[_Open, Element]] = []
        """Moves across the plane, until it is known where the next element begins."""
        self._empty = 0

    @property
    def idle(self) -> bool:
        return self._last is None and self._place is None

    def push(self, block: PathBlock) -> list[PathBlock]:
        """Returns the blocks that are complete. Raises ProgramError."""
        on = bool(block.correction.side) and (block.correction.radius_mm > 0.0 or self._last is not None)
        if self.idle and not on:
            return [block]
        if block.in_space:
            raise ProgramError(Code.NO_APPROACH, "a curve in space; a line switches the correction off")
        flat = any(flat_length(element, block.plane) > NEAR_MM for element in block.drawn)
        if on and self._last is not None and block.plane != self._last.plane:
            raise ProgramError(Code.EXCLUDED, "another plane with radius correction")
        entry = _Open(block, len(block.elements))
        self._open.append(entry)
        if not flat and not on:
            self._finish_last()
        strays = not on and self._place is not None and self._place[0] != block.plane and not self._strayed
        if not flat and not (strays and block.length_mm > NEAR_MM):
            self._pathless(entry)
            return self._done()
        self._empty = 0
        for element in block.drawn:
            if strays and element.length_mm > NEAR_MM:
                strays = False
                self._stray(entry, element)
            elif flat_length(element, block.plane) <= NEAR_MM:
                self._across(entry, element)
            elif on:
                self._corrected(entry, element)
            else:
                self._off(entry, element)
        return self._done()

    def flush(self) -> list[PathBlock]:
        """Returns all blocks: no element follows."""
        self._finish_last()
        return self._done()

    def _done(self) -> list[PathBlock]:
        ready = []
        while self._open and self._open[0].left == 0:
            entry = self._open.popleft()
            elements = tuple(entry.done)
            start = elements[0].start if elements else entry.block.start
            ready.append(replace(entry.block, elements=elements, start=start))
        return ready

    def _pathless(self, entry: _Open) -> None:
        if self._last is not None and (entry.block.number or entry.block.main):
            self._empty += 1
            if self._empty > MOST_EMPTY:
                raise ProgramError(Code.TOO_MANY_WITHOUT_PATH, f"more than {MOST_EMPTY} in a row")
        for element in entry.block.drawn:
            self._across(entry, element)

    def _across(self, entry: _Open, element: Element) -> None:
        """A move across the plane happens at the tool's position, not the contour's; it waits until that is known."""
        if self._last is not None:
            self._waiting.append((entry, element))
        else:
            entry.add(element if self._place is None else _at(element, *self._place))

    def _crossed(self, plane: Plane, place: Point) -> None:
        for entry, element in self._waiting:
            entry.add(_at(element, plane, plane.of(place)))
        self._waiting.clear()

    def _corrected(self, entry: _Open, element: Element) -> None:
        correction, plane = entry.block.correction, entry.block.plane
        last = self._last
        if last is None:
            if isinstance(element, Arc):
                raise ProgramError(Code.NO_APPROACH, "the correction is switched on with a line")
            begin = element.start if self._place is None else self._place[0].into(element.start, *self._place[1])
            self._place = None
            self._last = _Last(element, element, begin, 0.0, entry, correction, approach=True)
            return
        moved = _beside(element, plane, correction)
        if last.approach:
            begin, share = moved.start, 0.0
            self._over(last, Straight(last.begin, plane.into(last.element.end, *plane.of(begin))))
        else:
            begin, share = self._meet(last, element, correction.side)
        self._last = _Last(element, moved, begin, share, entry, correction)

    def _meet(self, last: _Last, element: Element, side: int) -> _Place:
        """End the last element with its corner; return the beginning of the next one. A new radius is effective only at
        the end of the next element."""
        plane, old = last.plane, last.correction
        moved = _beside(element, plane, replace(old, side=side))
        same = side == old.side
        angle = bend(last.element, element, plane, retraced=-side)
        there = plane.into(last.moved.end, *plane.of(moved.start))  # before moves across the plane in between
        if same and abs(angle) < STRAIGHT_RAD:
            self._over(last, _between(last, there, 1.0))
            return moved.start, 0.0
        crosses = crosses_again(last.element, element, plane, angle, old.radius_mm)
        outer = same and side * angle < 0.0 and not crosses
        if not same or (outer and corner_arc(math.degrees(abs(angle)), self._threshold)):
            sweep = -side * abs(angle) if same else _over_the_path(old.side, angle)
            arc = Arc(last.moved.end, there, plane, plane.of(element.start), sweep)
            corner = [arc] if abs(sweep) > STRAIGHT_RAD and old.radius_mm > 0.0 else []
            self._over(last, _between(last, last.moved.end if corner else there, 1.0), *corner)
            return moved.start, 0.0
        point, end, begin = _meeting(last.moved, moved, plane, outer=outer)
        self._over(last, _between(last, plane.into(last.moved.end, *point), end))
        return plane.into(moved.start, *point), begin

    def _over(self, last: _Last, *elements: Element) -> None:
        last.open.add(*elements)
        self._crossed(last.plane, elements[-1].end)

    def _finish_last(self) -> None:
        """No element follows: the last one ends at right angles to its contour's end."""
        last, self._last = self._last, None
        if last is None:
            return
        if last.approach:
            self._over(last, Straight(last.begin, last.element.end))
            return
        self._over(last, _between(last, last.moved.end, 1.0))
        self._place, self._strayed = (last.plane, last.plane.of(last.moved.end)), False

    def _off(self, entry: _Open, element: Element) -> None:
        """The line that switches the correction off, or an element after it."""
        self._finish_last()
        if self._place is None:
            entry.add(element)
            return
        (plane, place), self._place, self._strayed = self._place, None, False
        if isinstance(element, Arc):
            raise ProgramError(Code.NO_APPROACH, "the correction is switched off with a line")
        entry.add(Straight(plane.into(element.start, *place), element.end))

    def _stray(self, entry: _Open, element: Element) -> None:
        """The first path in another plane, the correction having been switched off without one: it takes the tool's
        offset along (7.2)."""
        assert self._place is not None
        plane, place = self._place
        if self._in_place:
            entry.tell("the place is right (plane_change_in_place); at the manual's control it is wrong")
            self._off(entry, element)
            return
        (u, v), (end_u, end_v) = plane.of(element.start), plane.of(element.end)
        off_u, off_v = place[0] - u, place[1] - v
        wrong = plane.into(element.end, end_u + off_u, end_v + off_v)
        self._off(entry, replace(element, end=wrong))
        self._place, self._strayed = (plane, plane.of(wrong)), True
        entry.tell(f"the place is wrong by {math.hypot(off_u, off_v):g} mm")


def _beside(element: Element, plane: Plane, correction: Correction) -> Element:
    """The element moved by the correction. Raises ProgramError M1152."""
    moved = offset(element, plane, correction.side * correction.radius_mm)
    if moved is None:
        size = f"{element.radius_mm:g} mm" if isinstance(element, Arc) else ""
        raise ProgramError(Code.CIRCLE_TOO_SMALL, f"a circle of {size} inside, a tool of {correction.radius_mm:g} mm")
    return moved


def _over_the_path(side: int, angle: float) -> float:
    """Sweep about a corner from one side of the path to the other: the shorter one; forwards if straight."""
    return -side * math.pi if abs(angle) < STRAIGHT_RAD else angle - math.copysign(math.pi, angle)


def _meeting(a: Element, b: Element, plane: Plane, *, outer: bool) -> tuple[UV, float, float]:
    """Where two moved elements meet at their corner, and the shares of both there. Raises ProgramError M1223, M1156."""
    corner = plane.of(b.start)
    points = meetings(a, b, plane)
    for point in sorted(points, key=lambda p: math.dist(p, corner)):
        end, begin = share_of(a, plane, point), share_of(b, plane, point)
        if outer:
            end, begin = _beyond(a, end, 1.0), -_beyond(b, -begin, 0.0)
            fits = end >= 1.0 - NEAR and begin <= NEAR
        else:
            fits = -NEAR <= end <= 1.0 + NEAR and -NEAR <= begin <= 1.0 + NEAR
        if fits:
            return point, end, begin
    circles = isinstance(a, Arc) and isinstance(b, Arc)
    raise ProgramError(
        Code.CIRCLES_APART if circles and not points else Code.CONTOUR, "the tool is too large for an inner corner"
    )


def _beyond(element: Element, share: float, least: float) -> float:
    """The share of a place beyond the end of a prolonged element; on a circle a turn later."""
    if isinstance(element, Arc) and share < least - NEAR:
        return share + 2.0 * math.pi / abs(element.sweep_rad)
    return share


def _between(last: _Last, end: Point, share: float) -> Element:
    """The moved element from where it begins to `end`. Raises ProgramError M1223."""
    moved, plane = last.moved, last.plane
    if isinstance(moved, Straight):
        d = heading(moved, plane, 0.0)
        (u, v), (begin_u, begin_v) = plane.of(end), plane.of(last.begin)
        if (u - begin_u) * d[0] + (v - begin_v) * d[1] < -NEAR_MM:
            raise _too_short(last, "path")
        return Straight(last.begin, end)
    if share < last.share - NEAR:
        raise _too_short(last, "arc")
    return replace(moved, start=last.begin, end=end, sweep_rad=(share - last.share) * moved.sweep_rad)


def _too_short(last: _Last, what: str) -> ProgramError:
    block = last.open.block
    error = ProgramError(Code.CONTOUR, f"the {what} is too short for the tool's radius")
    return error.at(block.program, block.number, block.column)


def _at(element: Element, plane: Plane, place: UV) -> Element:
    """The move across the plane, at this place of it."""
    return Straight(plane.into(element.start, *place), plane.into(element.end, *place))
