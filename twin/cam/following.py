"""What drives that follow make of a way: they round its corners, and run inside its arcs. Servo axes at a speed v are
behind by v T, T the inverse of their gain; stepper motors are not.

    corner:  v T d -----.           the part of the lag across the new direction dies away by exp(-t / T) while that
                        | '         across the old one grows by v T (t / T - 1 + exp(-t / T)): both are v T sin / e
    arc:     the radius shrinks by (v T)^2 / 2 r

Beyond the bound of the settings a corner becomes an exact stop, and an arc is made more slowly (language/8).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from isel_twin.cam.arcs import Shape
from isel_twin.cam.toolpath import Point


class Following:
    """Follows the directions of the motions of a toolpath. lag_s: T; bound_mm: 0 for none."""

    def __init__(self, lag_s: float, bound_mm: float) -> None:
        self.matters = lag_s > 0.0 and bound_mm > 0.0  # False: nothing here makes a difference
        self._lag_s, self._bound_mm = lag_s, bound_mm
        self._before: tuple[float, float, float] | None = None  # direction of the last motion, length 1
        self._speed_mm_s = 0.0

    def corner(self, begins: Sequence[float], ends: Sequence[float], speed_mm_s: float) -> bool:
        """Must the drives come to rest before the next motion? It begins and ends in these directions, of any length;
        one without any leaves things as they are."""
        first, last = _unit(begins), _unit(ends)
        if first is None or last is None:
            return False
        before, before_mm_s = self._before, self._speed_mm_s
        self._before, self._speed_mm_s = last, speed_mm_s
        if before is None:
            return False
        along = sum(u * v for u, v in zip(before, first, strict=True))
        across = math.sqrt(max(1.0 - along * along, 0.0)) if along > 0.0 else 1.0
        lag_mm = math.sqrt(before_mm_s * speed_mm_s) * self._lag_s
        return across * lag_mm / math.e > self._bound_mm

    def fastest_mm_s(self, radius_mm: float) -> float:
        """In an arc of this radius."""
        return math.sqrt(2.0 * radius_mm * self._bound_mm) / self._lag_s


def directions(of: Shape) -> tuple[Point, Point]:
    """In which an arc begins and ends."""
    return _direction(of, of.start_angle, of.start_radius), _direction(of, of.start_angle + of.sweep, of.end_radius)


def _direction(of: Shape, angle: float, radius: float) -> Point:
    """By what the point moves in the whole sweep if it went on like that."""
    wider = of.end_radius - of.start_radius
    way = [0.0, 0.0, 0.0]
    way[of.a] = wider * math.cos(angle) - radius * of.sweep * math.sin(angle)
    way[of.b] = wider * math.sin(angle) + radius * of.sweep * math.cos(angle)
    way[of.third] = of.height
    return way[0], way[1], way[2]


def _unit(way: Sequence[float]) -> tuple[float, float, float] | None:
    x, y, z = way
    length = math.sqrt(x * x + y * y + z * z)
    return (x / length, y / length, z / length) if length else None
