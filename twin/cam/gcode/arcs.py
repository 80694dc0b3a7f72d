"""Centres of arcs as LinuxCNC finds them, from offsets, absolute coordinates or a radius; its tolerances."""

from __future__ import annotations

import math

PLANES = {170: 2, 180: 1, 190: 0}  # the axis turned about, by the code
SMALL_MM = 0.00127  # least radius; half a chord may exceed R by this
SPIRAL_MM = 0.02 * math.sqrt(2.0)  # radii may differ by this, and by more up to
SPIRAL = 0.001  # of the larger one, and
MOST_SPIRAL = 100.0  # times SPIRAL_MM

Flat = tuple[float, float]


def by_radius(start: Flat, end: Flat, radius: float, clockwise: bool) -> Flat:
    """The centre of an arc with this radius; negative: of the longer one. Raises ValueError."""
    (x0, y0), (x1, y1) = start, end
    if start == end:
        raise ValueError("an arc by R cannot end at its start; write I and J for a full circle")
    half = math.hypot(x1 - x0, y1 - y0) / 2.0
    if half - abs(radius) > SMALL_MM:
        raise ValueError(f"R{abs(radius):g} is too small to reach the end, which is {2 * half:.4f} mm away")
    towards = math.atan2(y1 - y0, x1 - x0) + (-math.pi / 2 if clockwise == (radius > 0) else math.pi / 2)
    offset = math.sqrt(max(radius * radius - half * half, 0.0))
    return (x0 + x1) / 2.0 + offset * math.cos(towards), (y0 + y1) / 2.0 + offset * math.sin(towards)


def radii(start: Flat, end: Flat, centre: Flat) -> Flat:
    """Distances of start and end from the centre."""
    return math.dist(start, centre), math.dist(end, centre)


def fits(start: Flat, end: Flat, centre: Flat) -> bool:
    """Are the radii equal enough (decision cam/16)?"""
    r0, r1 = radii(start, end, centre)
    differ = abs(r0 - r1)
    if min(r0, r1) < SMALL_MM or differ > MOST_SPIRAL * SPIRAL_MM:
        return False
    return differ <= SPIRAL_MM or differ <= SPIRAL * max(r0, r1)


def sweep(start: Flat, end: Flat, centre: Flat, turns: int) -> float:
    """Signed angle of the whole arc, rad; start on end is a full turn."""
    x0, y0, x1, y1 = start[0] - centre[0], start[1] - centre[1], end[0] - centre[0], end[1] - centre[1]
    angle = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) * (1 if turns > 0 else -1)
    angle = angle if angle > 1e-6 else angle + 2.0 * math.pi
    return math.copysign(angle + 2.0 * math.pi * (abs(turns) - 1), turns)
