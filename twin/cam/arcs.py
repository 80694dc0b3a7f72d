"""The geometry of an arc, a spiral or a helix of a toolpath, and its chords.

     b ^     . end           The plane is spanned by two axes, a before b. An angle grows from a to b: about
       |   /   .             Z and X that is the counter-clockwise sense of `Arc.turns`, about Y the other one,
       | r1     .            as Z X is seen from +Y and X Z from -Y.
       |/  sweep .
centre +----r0---- start     Radius and height run evenly with the angle.
                  > a
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from typing import NamedTuple

from isel_twin.cam.toolpath import Arc, CamError, Point

FULL = 2.0 * math.pi
NO_WAY_MM = 1e-6  # an end nearer to the start than this is a full circle
PLANES = ((1, 2), (0, 2), (0, 1))  # axes a, b by `Arc.plane`
SENSE = (1, -1, 1)  # of a counter-clockwise arc, from a to b


def seen_from_above(plane: int) -> tuple[int, int]:
    """The two axes of a plane in the order in which a counter-clockwise arc leads from one to the other."""
    a, b = PLANES[plane]
    return (a, b) if SENSE[plane] > 0 else (b, a)


class Shape(NamedTuple):
    """An arc in numbers: axes a and b of its plane and the third one, mm, rad."""

    a: int
    b: int
    third: int
    centre: tuple[float, float]  # along a and b
    start_angle: float
    sweep: float  # from a to b positive
    start_radius: float
    end_radius: float
    height: float  # along the third axis
    length: float


def shape(arc: Arc, start: Point) -> Shape:
    """The arc from this point. Raises CamError for one without radius or turns."""
    a, b = PLANES[arc.plane]
    third = arc.plane
    ca, cb = arc.centre[a], arc.centre[b]
    r0 = math.hypot(start[a] - ca, start[b] - cb)
    r1 = math.hypot(arc.to[a] - ca, arc.to[b] - cb)
    if not (r0 and r1 and arc.turns):
        raise CamError("an arc begins or ends at its centre, or has no turns; give its centre", arc.place)
    at = math.atan2(start[b] - cb, start[a] - ca)
    sense = SENSE[arc.plane] * (1 if arc.turns > 0 else -1)
    sweep = (math.atan2(arc.to[b] - cb, arc.to[a] - ca) - at) * sense % FULL
    if sweep * r0 < NO_WAY_MM:  # what lies as near on the other side is a full circle already
        sweep += FULL
    sweep = sense * (sweep + FULL * (abs(arc.turns) - 1))
    height = arc.to[third] - start[third]
    length = math.sqrt(((r0 + r1) / 2.0 * sweep) ** 2 + (r1 - r0) ** 2 + height**2)
    return Shape(a, b, third, (ca, cb), at, sweep, r0, r1, height, length)


def chords(arc: Arc, start: Point, of: Shape, tolerance: float) -> Iterator[Point]:
    """Ends of chords of equal angles that leave the arc by at most this, mm (language/5); the last is the arc's own."""
    largest = max(of.start_radius, of.end_radius)
    most = 2.0 * math.acos(max(1.0 - tolerance / largest, 0.0))
    n = max(math.ceil(abs(of.sweep) / most), 1)
    (ca, cb), step, at = of.centre, of.sweep / n, of.start_angle
    radius, wider, low, higher = of.start_radius, (of.end_radius - of.start_radius) / n, start[of.third], of.height / n
    cos, sin = math.cos, math.sin
    for i in range(1, n):
        r, angle = radius + wider * i, at + step * i
        u, v, w = ca + r * cos(angle), cb + r * sin(angle), low + higher * i
        yield (u, v, w) if of.third == 2 else (w, u, v) if of.third == 0 else (u, w, v)
    yield arc.to


def bounds(of: Shape) -> tuple[tuple[float, float], tuple[float, float]]:
    """Least and greatest coordinates along a and b, each for the larger radius, mm."""
    r = max(of.start_radius, of.end_radius)
    first, last = sorted((of.start_angle, of.start_angle + of.sweep))
    quarter = math.pi / 2.0
    angles = [quarter * k for k in range(math.ceil(first / quarter), math.floor(last / quarter) + 1)]
    angles = [*angles[:4], of.start_angle, of.start_angle + of.sweep]
    along_a, along_b = ([c + r * f(x) for x in angles] for c, f in zip(of.centre, (math.cos, math.sin), strict=True))
    return (min(along_a), max(along_a)), (min(along_b), max(along_b))
