"""Circles of G02 and G03: by centre, by radius (manual 4.4 to 4.6)."""

from __future__ import annotations

import math
from typing import Final

from isel_twin.firmware.bwo900.geometry.elements import Arc, Plane, Point
from isel_twin.firmware.bwo900.messages import Code, ProgramError

NEAR_MM: Final = 1e-9
SAME_MM: Final = 5e-4  # half of the last digit of a position: such an end is the start, written with rounded digits


def arc_by_radius(start: Point, end: Point, plane: Plane, radius: float, turn: int) -> tuple[Arc, bool]:
    """The arc of G02 (turn -1) or G03 (+1) with R: the smaller one for R > 0, the larger for R < 0.

    A radius below half the chord becomes half the chord; the second value is then True (M1234). Raises ProgramError
    M1231 if start and end are the same.
    """
    (u0, v0), (u1, v1) = plane.of(start), plane.of(end)
    chord = math.dist((u0, v0), (u1, v1))
    if chord <= NEAR_MM:
        raise ProgramError(Code.CIRCLE_WITHOUT_PATH)
    half, size = chord / 2.0, abs(radius)
    corrected = size < half - NEAR_MM
    rise = 0.0 if size <= half else math.sqrt(size * size - half * half)
    side = turn if radius >= 0.0 else -turn  # the centre lies on the left of the chord (+1) or on its right
    u = (u0 + u1) / 2.0 - side * rise * (v1 - v0) / chord
    v = (v0 + v1) / 2.0 + side * rise * (u1 - u0) / chord
    return Arc(start, end, plane, (u, v), _sweep((u0, v0), (u1, v1), (u, v), turn)), corrected


def arc_by_centre(
    start: Point, end: Point, plane: Plane, centre: tuple[float, float], turn: int, tolerance_mm: float
) -> Arc:
    """The arc of G02 (turn -1) or G03 (+1) about a centre; the full circle if start and end are in the same direction.

    Radii at start and end that differ move the centre to the mean radius, on the same side; if that would move it by
    more than the tolerance, the radius runs evenly from one to the other instead (bwo900/8). Raises ProgramError M1238
    if they differ by more than the tolerance (P8843), M1233 for a radius of nothing.
    """
    (u0, v0), (u1, v1) = plane.of(start), plane.of(end)
    first, last = math.dist((u0, v0), centre), math.dist((u1, v1), centre)
    if first <= NEAR_MM:
        raise ProgramError(Code.CIRCLE_WITHOUT_CENTRE, "the centre is the start")
    if abs(first - last) > tolerance_mm:
        raise ProgramError(Code.CENTRE_OFF, f"radius {first:.4f} mm at the start, {last:.4f} mm at the end")
    sweep = _sweep((u0, v0), (u1, v1), centre, turn)
    if abs(sweep) * first <= SAME_MM:
        return Arc(start, end, plane, centre, sweep + turn * 2.0 * math.pi)
    chord = math.dist((u0, v0), (u1, v1))
    mean, half = (first + last) / 2.0, chord / 2.0
    if first != last and mean > half > NEAR_MM:
        rise = math.sqrt(mean * mean - half * half)
        left = (u1 - u0) * (centre[1] - v0) - (v1 - v0) * (centre[0] - u0) >= 0.0
        rise = rise if left else -rise
        moved = ((u0 + u1) / 2.0 - rise * (v1 - v0) / chord, (v0 + v1) / 2.0 + rise * (u1 - u0) / chord)
        if math.dist(moved, centre) <= tolerance_mm:
            return Arc(start, end, plane, moved, _sweep((u0, v0), (u1, v1), moved, turn))
    return Arc(start, end, plane, centre, sweep)


def _sweep(start: tuple[float, float], end: tuple[float, float], centre: tuple[float, float], turn: int) -> float:
    """Angle from start to end about a centre, in (0, 2 pi] for turn +1, negative for -1."""
    begin = math.atan2(start[1] - centre[1], start[0] - centre[0])
    angle = math.atan2(end[1] - centre[1], end[0] - centre[0]) - begin
    angle = math.fmod(turn * angle, 2.0 * math.pi)
    return turn * (angle if angle > 0.0 else angle + 2.0 * math.pi)
