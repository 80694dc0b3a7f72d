"""Elements of a path: lines and arcs.

Positions are tuples of mm, one for each axis; the first three are X, Y, Z. An arc lies in a plane of two of them, and
the others run evenly with its angle: a helix.

    plane seen against its third axis:    second ^    counter-clockwise: sweep > 0
                                                 +---> first
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from functools import cached_property
from typing import Final, TypeAlias

Point: TypeAlias = tuple[float, ...]
_NEW, _SET = object.__new__, object.__setattr__  # bound once


@dataclass(frozen=True, slots=True)
class Plane:
    """A plane of two axes, numbers from 0, and the axis across it (manual, G17 to G19, q152 to q154)."""

    first: int
    second: int
    third: int

    def of(self, point: Point) -> tuple[float, float]:
        """Coordinates in the plane."""
        return point[self.first], point[self.second]

    def into(self, point: Point, u: float, v: float) -> Point:
        """The point with these coordinates in the plane."""
        changed = list(point)
        changed[self.first], changed[self.second] = u, v
        return tuple(changed)


XY: Final = Plane(0, 1, 2)  # G17
ZX: Final = Plane(2, 0, 1)  # G18
YZ: Final = Plane(1, 2, 0)  # G19


@dataclass(frozen=True, slots=True)
class Straight:
    start: Point
    end: Point
    length_mm: float = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "length_mm", math.dist(self.start, self.end))

    def point(self, share: float) -> Point:
        """The point at a share of its length, 0 to 1; its ends are exact."""
        if share == 1.0:
            return self.end
        return tuple(a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))

    def tangent(self, share: float = 0.0) -> Point:
        """Unit vector along it; zeros if it has no length."""
        length = self.length_mm or 1.0
        return tuple([(b - a) / length for a, b in zip(self.start, self.end, strict=True)])

    def extent(self, axis: int) -> tuple[float, float]:
        """Lowest and highest coordinate of an axis on it."""
        return min(self.start[axis], self.end[axis]), max(self.start[axis], self.end[axis])

    def reversed(self) -> Straight:
        return Straight(self.end, self.start)


def straight(start: Point, end: Point, length_mm: float) -> Straight:
    """A line whose length is known, in half the time."""
    made = _NEW(Straight)
    _SET(made, "start", start)
    _SET(made, "end", end)
    _SET(made, "length_mm", length_mm)
    return made


@dataclass(frozen=True)
class Arc:
    """An arc in a plane around `centre` (first, second axis), sweep_rad counter-clockwise; other axes run with it.
    Radii at start and end may differ a little: the radius runs evenly with the angle, so that both ends are exact."""

    start: Point
    end: Point
    plane: Plane
    centre: tuple[float, float]
    sweep_rad: float

    @cached_property
    def radius_mm(self) -> float:
        return math.dist(self.plane.of(self.start), self.centre)

    @cached_property
    def end_radius_mm(self) -> float:
        return math.dist(self.plane.of(self.end), self.centre)

    @cached_property
    def start_rad(self) -> float:
        """Angle of the start, from the first axis."""
        u, v = self.plane.of(self.start)
        return math.atan2(v - self.centre[1], u - self.centre[0])

    @cached_property
    def length_mm(self) -> float:
        """Its length over all axes, with the mean radius."""
        mean = (self.radius_mm + self.end_radius_mm) / 2.0
        rise = [b - a for i, (a, b) in enumerate(zip(self.start, self.end, strict=True)) if i not in self._in_plane]
        return math.hypot(mean * self.sweep_rad, self.end_radius_mm - self.radius_mm, *rise)

    @property
    def _in_plane(self) -> tuple[int, int]:
        return self.plane.first, self.plane.second

    def point(self, share: float) -> Point:
        """The point at a share of its angle, 0 to 1; its ends are exact."""
        if share == 0.0:
            return self.start
        if share == 1.0:
            return self.end
        radius = self.radius_mm + share * (self.end_radius_mm - self.radius_mm)
        angle = self.start_rad + share * self.sweep_rad
        along = tuple(a + share * (b - a) for a, b in zip(self.start, self.end, strict=True))
        u, v = self.centre
        return self.plane.into(along, u + radius * math.cos(angle), v + radius * math.sin(angle))

    def tangent(self, share: float = 0.0) -> Point:
        """Unit vector along it at a share of its angle."""
        angle, grows = self.start_rad + share * self.sweep_rad, self.end_radius_mm - self.radius_mm
        turn = (self.radius_mm + share * grows) * self.sweep_rad
        slope = tuple(b - a for a, b in zip(self.start, self.end, strict=True))
        slope = self.plane.into(
            slope, grows * math.cos(angle) - turn * math.sin(angle), grows * math.sin(angle) + turn * math.cos(angle)
        )
        length = math.hypot(*slope) or 1.0
        return tuple(s / length for s in slope)

    def extent(self, axis: int) -> tuple[float, float]:
        """Lowest and highest coordinate of an axis on it: at its ends, or where the circle turns back."""
        places = [self.start[axis], self.end[axis]]
        if axis in self._in_plane:
            quarter = math.pi / 2.0
            first, last = sorted((self.start_rad, self.start_rad + self.sweep_rad))
            begin = 0.0 if axis == self.plane.first else quarter
            for turn in range(math.ceil((first - begin) / math.pi), math.floor((last - begin) / math.pi) + 1):
                share = (begin + turn * math.pi - self.start_rad) / self.sweep_rad
                places.append(self.point(share)[axis])
        return min(places), max(places)

    def reversed(self) -> Arc:
        return Arc(self.end, self.start, self.plane, self.centre, -self.sweep_rad)


Element: TypeAlias = Straight | Arc  # one piece of a path
