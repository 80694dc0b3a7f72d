"""Tool radius correction G41, G42: the path of the tool's centre beside the contour (manual 7.2 to 7.7).

    contour    a ----> corner ----> b           side +1: the tool is on the left
    offset     each element moved by the radius, and

      outer corner, change of direction > P8845       an arc about the corner (P8845 deleted: always)
      outer corner, otherwise                          both prolonged to their meeting point
      the way back                                     an arc, as outside
      inner corner                                     both cut at their meeting point
      tangential                                       nothing

    switching on     a line, which ends at right angles to the beginning of the next element, a radius away
    switching off    a line, which begins where the corrected path has ended
    another radius   an element begins at the old distance and ends at the new one

Blocks without a path are carried out at the meeting point, or before the arc. At most 12 of them may follow each other
(M1157). A contour that the tool cannot follow is a message: M1151 to M1156, M1223.
"""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass, field, replace
from typing import Final

from isel_twin.firmware.bwo900.blocks import Correction, PathBlock
from isel_twin.firmware.bwo900.elements import Arc, Element, Line, Plane, Point
from isel_twin.firmware.bwo900.geometry import UV, cut, flat_length, heading, left_of, meetings, offset, share_of, turn
from isel_twin.firmware.bwo900.messages import ProgramError

__all__ = ["Offset", "corner_arc"]

MOST_EMPTY: Final = 12
"""Blocks without a path in a row (M1157)."""
STRAIGHT_RAD: Final = 1e-6
NEAR_MM: Final = 1e-7
SHARPEST: Final = 120.0
"""P8845 = 0: an arc above this change of direction, degrees."""


def corner_arc(deviation_deg: float, threshold: float | None) -> bool:
    """Whether an outer corner gets an arc. threshold: P8845, None deleted: always; 0: above 120 degrees."""
    if threshold is None:
        return True
    return deviation_deg > (threshold or SHARPEST)


@dataclass
class _Open:
    """A block whose elements are being corrected, and those that are done."""

    block: PathBlock
    left: int
    """Elements that are not done."""
    done: list[Element] = field(default_factory=list)


@dataclass
class _Last:
    """The corrected element that waits for the next one: as programmed, moved, and where it begins."""

    element: Element
    moved: Element
    begin: Point
    open: _Open
    correction: Correction
    approach: bool = False
    """It is the line that switches the correction on: its end is not known yet."""


class Offset:
    """Takes blocks and gives them on, corrected; see the module."""

    def __init__(self, threshold: float | None = None) -> None:
        """threshold: P8845."""
        self._threshold = threshold
        self._open: deque[_Open] = deque()
        self._last: _Last | None = None
        self._place: Point | None = None
        """Where the corrected path has got to, after the correction was switched off in a block without a path."""
        self._plane: Plane | None = None
        """The plane of `_place`."""
        self._empty = 0

    def push(self, block: PathBlock) -> list[PathBlock]:
        """The blocks that are done now. Raises ProgramError."""
        corrected = bool(block.correction.side) and block.correction.radius_mm > 0.0
        flat = any(flat_length(element, block.plane) > NEAR_MM for element in block.elements)
        if self._last is None and self._place is None and not corrected:
            return [block]
        entry = _Open(block, len(block.elements))
        self._open.append(entry)
        turned = not corrected and bool(block.elements) and block.plane != self._last_plane
        if not flat and not turned:
            self._pathless(entry)
            return self._done()
        self._empty = 0
        for element in block.elements:
            if self._last is None and self._place is None and not corrected:
                entry.done.append(element)
                entry.left -= 1
            elif not turned and flat_length(element, block.plane) <= NEAR_MM:
                self._across(entry, element)
            elif corrected:
                self._corrected(entry, element)
            else:
                self._off(entry, element)
        return self._done()

    @property
    def _last_plane(self) -> Plane | None:
        """Of the path that is corrected, or was until the correction was switched off; None: there is none."""
        return self._plane if self._last is None else self._last.open.block.plane

    def flush(self) -> list[PathBlock]:
        """Nothing comes that the last element could meet: it ends at right angles to its end."""
        if self._last is not None and not self._last.approach:
            self._finish(self._last, None)
            last, self._last = self._last, None
            self._place, self._plane = last.open.done[-1].end, last.open.block.plane
        elif self._last is not None:
            last, self._last = self._last, None
            line = Line(last.begin, last.element.end)
            last.open.done.append(line)
            last.open.left -= 1
            self._place = None
        for entry in self._open:
            entry.left = 0
        return self._done()

    # ---- blocks ------------------------------------------------------------------------------------------------------

    def _done(self) -> list[PathBlock]:
        """Blocks whose elements are all done, in order."""
        ready = []
        while self._open and self._open[0].left == 0:
            entry = self._open.popleft()
            elements = tuple(entry.done)
            start = elements[0].start if elements else entry.block.start
            ready.append(replace(entry.block, elements=elements, start=start))
        return ready

    def _pathless(self, entry: _Open) -> None:
        """A block without a way in the plane."""
        self._empty += not entry.block.elements
        if self._empty > MOST_EMPTY:
            raise ProgramError(1157, f"more than {MOST_EMPTY} in a row")
        for element in entry.block.elements:
            self._across(entry, element)

    def _across(self, entry: _Open, element: Element) -> None:
        """A move across the plane: where the tool is, not where the contour is. It waits for that to be known."""
        if self._last is None:
            place = self._place
            entry.done.append(element if place is None else _at(element, entry.block.plane, place))
            entry.left -= 1
            return
        self._waiting.append((entry, element))

    @property
    def _waiting(self) -> list[tuple[_Open, Element]]:
        return self.__dict__.setdefault("_across_waiting", [])

    # ---- elements ----------------------------------------------------------------------------------------------------

    def _corrected(self, entry: _Open, element: Element) -> None:
        correction, plane = entry.block.correction, entry.block.plane
        last = self._last
        if last is None:
            if isinstance(element, Arc):
                raise ProgramError(1153, "the correction is switched on with a line")
            begin = element.start if self._place is None else self._place
            self._place = None
            self._last = _Last(element, element, begin, entry, correction, approach=True)
            return
        moved = offset(element, plane, correction.side * correction.radius_mm)
        if moved is None:
            raise ProgramError(1155, f"a circle of {element.radius_mm:g} mm" if isinstance(element, Arc) else "")
        if last.approach:
            start = moved.start
            last.open.done.append(Line(last.begin, plane.into(last.element.end, *plane.of(start))))
            last.open.left -= 1
            self._crossed(start)
            self._last = _Last(element, moved, start, entry, correction)
            return
        begin = self._meet(last, moved, element, correction)
        self._last = _Last(element, moved, begin, entry, correction)

    def _meet(self, last: _Last, moved: Element, element: Element, correction: Correction) -> Point:
        """End the last element where the next one begins, with what lies between them; where that is."""
        plane = last.open.block.plane
        before, after = heading(last.element, plane, 1.0), heading(element, plane, 0.0)
        angle = turn(before, after)
        same = correction.side == last.correction.side
        if same and correction.radius_mm != last.correction.radius_mm:
            moved_old = offset(element, plane, last.correction.side * last.correction.radius_mm)
            if moved_old is None:
                raise ProgramError(1155)
            return self._meet(last, moved_old, element, last.correction)
        if same and abs(angle) < STRAIGHT_RAD:
            self._finish(last, moved.start)
            return moved.start
        back = abs(angle) > math.pi - STRAIGHT_RAD
        outer = same and (back or correction.side * angle < 0.0)
        if not same or (outer and corner_arc(math.degrees(abs(angle)), self._threshold)):
            return self._around(last, moved, element, correction)
        point = self._meeting(last, moved, plane, outer=outer)
        begin = plane.into(moved.start, *point)
        self._finish(last, plane.into(last.moved.end, *point))
        return begin

    def _around(self, last: _Last, moved: Element, element: Element, correction: Correction) -> Point:
        """An outer corner, or a change of side: an arc about the corner."""
        self._finish(last, last.moved.end)
        plane, corner = last.open.block.plane, last.open.block.plane.of(element.start)
        start, end = last.moved.end, moved.start
        before, after = heading(last.element, plane, 1.0), heading(element, plane, 0.0)
        sweep = -correction.side * abs(turn(before, after))
        if correction.side != last.correction.side:
            first, second = left_of(before), left_of(after)
            sweep = turn(
                (last.correction.side * first[0], last.correction.side * first[1]),
                (correction.side * second[0], correction.side * second[1]),
            )
        if abs(sweep) > STRAIGHT_RAD:
            last.open.done.append(Arc(start, end, plane, corner, sweep))
        return end

    def _meeting(self, last: _Last, moved: Element, plane: Plane, *, outer: bool) -> UV:
        """Where two moved elements meet at their corner. Raises ProgramError M1223, M1156."""
        corner = plane.of(moved.start)
        points = meetings(last.moved, moved, plane)
        best: UV | None = None
        for point in sorted(points, key=lambda p: math.dist(p, corner)):
            a, b = share_of(last.moved, plane, point), share_of(moved, plane, point)
            if outer:
                fits = a >= 1.0 - 1e-9 and b <= 1e-9
                fits = fits or not (isinstance(last.moved, Line) and isinstance(moved, Line))
            else:
                fits = -1e-9 <= a <= 1.0 + 1e-9 and -1e-9 <= b <= 1.0 + 1e-9
            if fits:
                best = point
                break
        if best is None:
            circles = isinstance(last.moved, Arc) and isinstance(moved, Arc)
            raise ProgramError(1156 if circles and not points else 1223, "the tool is too large for an inner corner")
        return best

    def _finish(self, last: _Last, end: Point | None) -> None:
        """The last element is done: from where it begins to `end`, None: its own end. Raises ProgramError M1223."""
        plane = last.open.block.plane
        begin = plane.of(last.begin)
        stop = last.moved.end if end is None else end
        element = self._between(last, plane, begin, plane.of(stop))
        last.open.done.append(element)
        last.open.left -= 1
        self._crossed(element.end)

    def _between(self, last: _Last, plane: Plane, begin: UV, end: UV) -> Element:
        moved = last.moved
        if isinstance(moved, Line):
            start, stop = plane.into(moved.start, *begin), plane.into(moved.end, *end)
            way = (end[0] - begin[0], end[1] - begin[1])
            d = heading(moved, plane, 0.0)
            if way[0] * d[0] + way[1] * d[1] < -NEAR_MM:
                raise ProgramError(1223, "the path is too short for the tool's radius")
            return Line(start, stop)
        first, final = share_of(moved, plane, begin), share_of(moved, plane, end)
        if abs(moved.radius_mm - math.dist(begin, moved.centre)) > 1e-6:  # another radius: a spiral
            sweep = moved.sweep_rad
            return Arc(plane.into(moved.start, *begin), moved.end, plane, moved.centre, sweep)
        if math.dist(begin, plane.of(moved.start)) < NEAR_MM:
            first = 0.0
        if math.dist(end, plane.of(moved.end)) < NEAR_MM:
            final = 1.0
        if final < first:
            raise ProgramError(1223, "the arc is too short for the tool's radius")
        whole = cut(moved, plane, begin, end)
        assert isinstance(whole, Arc)
        return replace(whole, sweep_rad=(final - first) * moved.sweep_rad)

    def _crossed(self, place: Point) -> None:
        """Moves across the plane that waited for this place."""
        for entry, element in self._waiting:
            entry.done.append(_at(element, entry.block.plane, place))
            entry.left -= 1
        self._waiting.clear()

    def _off(self, entry: _Open, element: Element) -> None:
        """The line that switches the correction off. It begins where the tool is, in another plane, too."""
        last, plane = self._last, self._last_plane
        assert plane is not None
        if last is not None:
            if last.approach:
                last.open.done.append(Line(last.begin, last.element.end))
                last.open.left -= 1
                self._crossed(last.element.end)
                begin = last.element.end
            else:
                self._finish(last, None)
                begin = last.open.done[-1].end
            self._last = None
        else:
            assert self._place is not None
            begin = self._place
        self._place = None
        if isinstance(element, Arc):
            raise ProgramError(1153, "the correction is switched off with a line")
        entry.done.append(Line(plane.into(element.start, *plane.of(begin)), element.end))
        entry.left -= 1


def _at(element: Element, plane: Plane, place: Point) -> Element:
    """A move across the plane at another place of it."""
    u, v = plane.of(place)
    return Line(plane.into(element.start, u, v), plane.into(element.end, u, v))
