"""Centres of arcs as LinuxCNC finds them, from offsets, absolute coordinates or a radius; its tolerances."""

from __future__ import annotations

import math

PLANES = {170: 2, 180: 1, 190: 0}  # the axis turned about, by the code
INCH_MM = 25.4
SMALL_MM = 0.00127  # least radius; half a chord may exceed R by this
SPIRAL_MM = 0.02 * math.sqrt(2.0)  # radii may differ by this where numbers are mm, and
SPIRAL_INCH_MM = 0.002 * math.sqrt(2.0) * INCH_MM  # by this where they are inches (cam/16), and by more up to
SPIRAL = 0.001  # of the larger one, and
MOST_SPIRAL = 100.0  # times that length

Flat = tuple[float, float]


def by_radius(start: Flat, end: Flat, radius: float, clockwise: bool) -> Flat:
    """The centre of an arc with this radius, mm; negative: of the longer one. Raises ValueError."""
    (x0, y0), (x1, y1) = start, end
    if start == end:
        raise ValueError("an arc by R cannot end at its start: a full circle wants its centre I J K")
    half = math.hypot(x1 - x0, y1 - y0) / 2.0
    if half - abs(radius) > SMALL_MM:
        raise ValueError(f"R of {abs(radius):g} mm is too small to reach the end, which is {2 * half:.4f} mm away")
    towards = math.atan2(y1 - y0, x1 - x0) + (-math.pi / 2 if clockwise == (radius > 0) else math.pi / 2)
    offset = math.sqrt(max(radius * radius - half * half, 0.0))
    return (x0 + x1) / 2.0 + offset * math.cos(towards), (y0 + y1) / 2.0 + offset * math.sin(towards)


def radii(start: Flat, end: Flat, centre: Flat) -> Flat:
    """Distances of start and end from the centre."""
    return math.dist(start, centre), math.dist(end, centre)


def fits(start: Flat, end: Flat, centre: Flat, unit: float) -> bool:
    """Are the radii equal enough? unit: of the file, mm."""
    r0, r1 = radii(start, end, centre)
    differ, spiral_mm = abs(r0 - r1), SPIRAL_MM if unit == 1.0 else SPIRAL_INCH_MM
    if min(r0, r1) < SMALL_MM or differ > MOST_SPIRAL * spiral_mm:
        return False
    return differ <= spiral_mm or differ <= SPIRAL * max(r0, r1)


def misfit(letters: str, unit: float, ends: tuple[Flat, Flat], readings: tuple[Flat, Flat], absolute: bool) -> str:
    """Say why an arc between these ends cannot be made about the centre that is read. readings: the centres by offsets
    and by absolute coordinates, absolute: the second is read; unit: of the file, mm."""
    (o0, o1), (a0, a1) = (radii(*ends, centre) for centre in readings)
    other_fits = fits(*ends, readings[not absolute], unit)
    if min((a0, a1) if absolute else (o0, o1)) < SMALL_MM and not other_fits:
        return "an arc without radius: start or end is its centre"
    of = "mm" if unit == 1.0 else "inch"
    why = (
        f"the radii to start and end of the arc differ by {abs(o0 - o1) / unit:.4f} {of} with {letters} as offsets "
        f"({o0 / unit:.4f} and {o1 / unit:.4f}), by {abs(a0 - a1) / unit:.4f} {of} as absolute "
        f"({a0 / unit:.4f} and {a1 / unit:.4f})"
    )
    if not other_fits:
        return why
    meant, code = ("offsets", "G91.1") if absolute else ("absolute", "G90.1")
    return f"{why}; if they are {meant}, write {code} before it"


def sweep(start: Flat, end: Flat, centre: Flat, turns: int) -> float:
    """Signed angle of the whole arc, rad; start on end is a full turn."""
    x0, y0, x1, y1 = start[0] - centre[0], start[1] - centre[1], end[0] - centre[0], end[1] - centre[1]
    angle = math.atan2(x0 * y1 - y0 * x1, x0 * x1 + y0 * y1) * (1 if turns > 0 else -1)
    angle = angle if angle > 1e-6 else angle + 2.0 * math.pi
    return math.copysign(angle + 2.0 * math.pi * (abs(turns) - 1), turns)
