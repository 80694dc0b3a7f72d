"""Corners by function: G12 chamfers and roundings, G123 circles through three points (manual 4.4, 4.11).

    G12 P70       the corner to the next path is cut, each leg P70 long       two lines only
    G12 P71       a tangential arc of radius P71 is inserted                    lines and circles
    G123          this path and the next one run on the circle through their three points, or on two lines

Blocks in between without a path in the plane are carried out at the beginning of the inserted element. M1226: the next
path is missing; M1158: not possible.
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.circles import arc_by_centre
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Plane, Straight
from isel_twin.firmware.bwo900.geometry.plane import (
    STRAIGHT_RAD,
    UV,
    bend,
    cut,
    flat_length,
    heading,
    left_of,
    meetings,
    offset,
    share_of,
)
from isel_twin.firmware.bwo900.messages import Code, ProgramError

# G123: two lines up to this height over the chord (between the manual's examples, 0.009 and 0.13)
STRAIGHT: Final = 0.02
NEAR: Final = 1e-9


class Contour:
    """Takes blocks and returns them with their corners."""

    def __init__(self) -> None:
        self._first: PathBlock | None = None  # the block whose corner waits for the next path
        self._between: list[PathBlock] = []

    @property
    def idle(self) -> bool:
        return self._first is None

    def push(self, block: PathBlock) -> list[PathBlock]:
        """Returns the blocks that are complete."""
        first = self._first
        if first is None:
            return self._begin(block)
        if not _flat(block):
            self._between.append(block)
            return []
        between, self._between, self._first = self._between, [], None
        if first.in_space or block.in_space:
            error = ProgramError(Code.NO_CORNER, "a curve in space has no corner in a plane")
            raise error.at(first.program, first.number, first.column)
        if first.three_points:
            done = self._pair(first, block)
            return [done[0], *between, *self._begin(replace(done[1], three_points=False))]
        try:
            a, put, b = _corner(first, block)
        except ProgramError as error:
            raise error.at(first.program, first.number, first.column) from None
        plane, before = first.plane, replace(first, elements=(*first.elements[:-1], a))
        put = replace(put, start=plane.into(put.end, *plane.of(a.end)))  # after moves across the plane
        after = replace(block, start=put.start, elements=(put, b, *block.elements[1:]))
        return [before, *(_moved(other, plane.of(a.end)) for other in between), *self._begin(after)]

    def flush(self) -> list[PathBlock]:
        """End: no block follows. Raises ProgramError M1226 if a corner waits for the next path."""
        if self._first is not None:
            first, self._first, self._between = self._first, None, []
            error = ProgramError(Code.NO_NEXT_PATH, "the next path is missing")
            raise error.at(first.program, first.number, first.column)
        return []

    def _begin(self, block: PathBlock) -> list[PathBlock]:
        if block.turns_corner and _flat(block):
            self._first = block
            return []
        return [block]

    def _pair(self, first: PathBlock, second: PathBlock) -> tuple[PathBlock, PathBlock]:
        a, b = through(first.drawn[-1], second.drawn[0], first.plane)
        return (replace(first, elements=(*first.elements[:-1], a)), replace(second, elements=(b, *second.elements[1:])))


def _flat(block: PathBlock) -> bool:
    """True if it has a path in its plane."""
    return block.in_space or any(flat_length(element, block.plane) > NEAR for element in block.drawn)


def _moved(block: PathBlock, place: UV) -> PathBlock:
    """A block of moves across the plane, at this place of it."""
    elements = tuple(
        Straight(block.plane.into(e.start, *place), block.plane.into(e.end, *place)) for e in block.elements
    )
    return replace(block, elements=elements, start=block.plane.into(block.start, *place))


def _corner(first: PathBlock, second: PathBlock) -> tuple[Element, Element, Element]:
    """The rest of the last element of one block, the inserted element, and the rest of the first of the other."""
    a, b, plane = first.drawn[-1], second.drawn[0], first.plane
    if first.rounding_mm is not None:
        return rounded(a, b, plane, abs(first.rounding_mm))
    assert first.chamfer_mm is not None
    return chamfered(a, b, plane, abs(first.chamfer_mm))


def chamfered(a: Element, b: Element, plane: Plane, leg: float) -> tuple[Element, Element, Element]:
    """Two lines and the chamfer between them. Raises ProgramError M1158."""
    if isinstance(a, Arc) or isinstance(b, Arc):
        raise ProgramError(Code.NO_CORNER, "a chamfer lies between two lines")
    if leg >= flat_length(a, plane) or leg >= flat_length(b, plane):
        raise ProgramError(Code.NO_CORNER, f"a leg of {leg:g} mm is longer than the path")
    corner, d, e = plane.of(a.end), heading(a, plane, 1.0), heading(b, plane, 0.0)
    p = (corner[0] - leg * d[0], corner[1] - leg * d[1])
    q = (corner[0] + leg * e[0], corner[1] + leg * e[1])
    first, last = cut(a, plane, None, p), cut(b, plane, q, None)
    return first, Straight(first.end, last.start), last


def rounded(a: Element, b: Element, plane: Plane, radius: float) -> tuple[Element, Element, Element]:
    """Two elements and the tangential arc between them. Raises ProgramError M1158."""
    angle = bend(a, b, plane)
    if abs(angle) < STRAIGHT_RAD:
        raise ProgramError(Code.NO_CORNER, "there is no corner")
    side = 1.0 if angle > 0.0 else -1.0
    aside, beside = offset(a, plane, side * radius), offset(b, plane, side * radius)
    if aside is None or beside is None:
        raise ProgramError(Code.NO_CORNER, f"no arc of {radius:g} mm fits")
    corner = plane.of(a.end)
    for centre in sorted(meetings(aside, beside, plane), key=lambda c: math.dist(c, corner)):
        p, q = _foot(a, plane, centre), _foot(b, plane, centre)
        if 0.0 <= share_of(a, plane, p) <= 1.0 + 1e-9 and -1e-9 <= share_of(b, plane, q) <= 1.0:
            first, last = cut(a, plane, None, p), cut(b, plane, q, None)
            arc = arc_by_centre(first.end, last.start, plane, centre, int(side), max(1e-6 * radius, 1e-6))
            return first, arc, last
    raise ProgramError(Code.NO_CORNER, f"no arc of {radius:g} mm fits")


def _foot(element: Element, plane: Plane, centre: UV) -> UV:
    """The nearest point of its line or circle."""
    if isinstance(element, Straight):
        u, v = plane.of(element.start)
        d = heading(element, plane, 0.0)
        along = (centre[0] - u) * d[0] + (centre[1] - v) * d[1]
        return u + along * d[0], v + along * d[1]
    size = math.dist(centre, element.centre) or 1.0
    factor = element.radius_mm / size
    return (
        element.centre[0] + factor * (centre[0] - element.centre[0]),
        element.centre[1] + factor * (centre[1] - element.centre[1]),
    )


def through(a: Element, b: Element, plane: Plane) -> tuple[Element, Element]:
    """Two elements through the same points: arcs of one circle, or lines."""
    p, q, r = plane.of(a.start), plane.of(a.end), plane.of(b.end)
    chord = math.dist(p, r)
    lines = Straight(a.start, a.end), Straight(b.start, b.end)
    if chord <= NEAR:
        return lines
    d = ((r[0] - p[0]) / chord, (r[1] - p[1]) / chord)
    height = (q[0] - p[0]) * left_of(d)[0] + (q[1] - p[1]) * left_of(d)[1]
    if abs(height) / chord < STRAIGHT:
        return lines
    centre = _centre(p, q, r)
    sense = -1 if height > 0.0 else 1
    tolerance = 1e-6 * max(chord, 1.0)
    return (
        arc_by_centre(a.start, a.end, plane, centre, sense, tolerance),
        arc_by_centre(b.start, b.end, plane, centre, sense, tolerance),
    )


def _centre(p: UV, q: UV, r: UV) -> UV:
    """Of the circle through three points that are not on a line."""
    ax, ay, bx, by = q[0] - p[0], q[1] - p[1], r[0] - p[0], r[1] - p[1]
    twice = 2.0 * (ax * by - ay * bx)
    a, b = ax * ax + ay * ay, bx * bx + by * by
    return p[0] + (by * a - ay * b) / twice, p[1] + (ax * b - bx * a) / twice
