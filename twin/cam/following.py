"""Drives that follow round the corners of a way, and run inside its arcs. Servo axes at a speed v are behind by v T, T
the inverse of their gain; stepper motors are not.

    corner:  v T d -----.           the part of the lag across the new direction dies away by exp(-t / T) while that
                        | '         across the old one grows by v T (t / T - 1 + exp(-t / T)): both are v T sin / e
    arc:     the radius shrinks by (v T)^2 / 2 r

    reversal: where an axis turns round in an arc, friction holds it until its loops have the torque: as much as an
              error E would give alone, or an integral of E over R. When it has stood for t, the arc has left it by
              b = a t^2 / 2, a = v^2 / r; its error, as it is behind by T, is a t (T + t / 2), so that

                  a t (T + t / 2) + a t^2 (T / 2 + t / 6) / R = E

Beyond the bounds of the settings a corner becomes an exact stop, and an arc is made more slowly (language/8,
language/9).
"""

from __future__ import annotations

import math
from collections.abc import Sequence

from isel_twin.cam.arcs import Shape
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Point
from isel_twin.cam.written import MachineAxes


class Following:
    """Follows the directions of the motions of a toolpath."""

    def __init__(self, axes: MachineAxes, settings: CamSettings) -> None:
        self._lag_s, self._held_mm, self._reset_s = axes.lag_s, axes.held_mm, axes.reset_s
        self._usual_mm = settings.following_mm
        self.bound(None)
        self._reversal_mm = settings.reversal_mm if axes.held_mm else 0.0
        self._before: tuple[float, float, float] | None = None  # direction of the last motion, length 1
        self._speed_mm_s = 0.0

    @property
    def matters(self) -> bool:
        """False: nothing here makes a difference."""
        return bool(self._bound_mm or self._reversal_mm)

    def bound(self, tolerance_mm: float | None) -> None:
        """By how much corners and arcs may be rounded from here on, where the file asks for less than the settings."""
        bounds = [each for each in (self._usual_mm, tolerance_mm) if each]
        self._bound_mm = min(bounds) if bounds and self._lag_s else 0.0  # 0: none

    def rest(self) -> None:
        """The drives have come to rest."""
        self._before = None

    def corner(self, begins: Sequence[float], ends: Sequence[float], speed_mm_s: float) -> bool:
        """Must the drives come to rest before the next motion? It begins and ends in these directions, of any length;
        one without any leaves things as they are."""
        first, last = _unit(begins), _unit(ends)
        if first is None or last is None:
            return False
        before, before_mm_s = self._before, self._speed_mm_s
        self._before, self._speed_mm_s = last, speed_mm_s
        if before is None or not self._bound_mm:
            return False
        along = sum(u * v for u, v in zip(before, first, strict=True))
        across = math.sqrt(max(1.0 - along * along, 0.0)) if along > 0.0 else 1.0
        lag_mm = math.sqrt(before_mm_s * speed_mm_s) * self._lag_s
        return across * lag_mm / math.e > self._bound_mm

    def fastest_mm_s(self, radius_mm: float) -> tuple[float, str]:
        """In an arc of this radius, and why."""
        fastest, why = math.inf, ""
        if self._bound_mm:
            fastest = math.sqrt(2.0 * radius_mm * self._bound_mm) / self._lag_s
            by = "[cam] following_mm" if self._bound_mm == self._usual_mm else "G64 P"
            why = f"its drives follow within {self._bound_mm:g} mm ({by})"
        if self._reversal_mm and (slow := math.sqrt(radius_mm * self._turning_mm_s2())) < fastest:
            fastest = slow
            why = f"friction holds a drive that turns round by {self._reversal_mm:g} mm at most ([cam] reversal_mm)"
        return fastest, why

    def _turning_mm_s2(self) -> float:
        """The acceleration a with which an axis may turn round, so that it is held until the arc has left it by b: with
        a = 2 b / t^2 in E of above, t^2 b / 3 R - t (E - b - b T / R) + 2 b T = 0."""
        left_mm, lag_s, reset_s = self._reversal_mm, self._lag_s, self._reset_s
        square, minus = left_mm / (3.0 * reset_s), self._held_mm - left_mm * (1.0 + lag_s / reset_s)
        root = minus**2 - 8.0 * square * left_mm * lag_s
        if minus <= 0.0 or root < 0.0:
            return math.inf  # it is never held for as long
        return 2.0 * left_mm / ((minus + math.sqrt(root)) / (2.0 * square)) ** 2


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
