"""Lines and arcs in the two axes of a plane: offset, intersection, shortening.

offset by d to the left        a line moves, an arc's radius shrinks (counter-clockwise) or grows
meeting points                 of the whole line and the whole circle behind two elements
share of a point               of the way to it, below 0 and above 1 beyond the ends
"""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Plane, Point, Straight

UV: TypeAlias = tuple[float, float]
NEAR: Final = 1e-9
STRAIGHT_RAD: Final = 1e-6  # change of direction that counts as none, or as exactly backwards
SAME_CURVATURE: Final = 1e-6  # relative difference of two curvatures that counts as none


def heading(element: Element, plane: Plane, share: float) -> UV:
    """Unit vector in the plane; zeros if the element has no length there."""
    u, v = plane.of(element.tangent(share))
    size = math.hypot(u, v)
    return (u / size, v / size) if size > NEAR else (0.0, 0.0)


def left_of(direction: UV) -> UV:
    """A quarter of a turn counter-clockwise."""
    return -direction[1], direction[0]


def turn(before: UV, after: UV) -> float:
    """Angle from one direction to another in rad, -pi to pi, counter-clockwise."""
    cross = before[0] * after[1] - before[1] * after[0]
    return math.atan2(cross, before[0] * after[0] + before[1] * after[1])


def bend(a: Element, b: Element, plane: Plane, retraced: float = 1.0) -> float:
    """Change of direction at the corner of two elements in rad, counter-clockwise. Exactly backwards its sign, the side
    of a on which b lies, is told by the curvatures; `retraced` is the sign where b runs back on a."""
    angle = turn(heading(a, plane, 1.0), heading(b, plane, 0.0))
    if abs(angle) < math.pi - STRAIGHT_RAD:
        return angle
    return math.copysign(angle, -_leaves_left(a, b) or retraced)


def crosses_again(a: Element, b: Element, plane: Plane, angle: float, reach_mm: float) -> bool:
    """True if b goes almost backwards and curves through a within reach of their corner; angle: their `bend`."""
    off, to_the_left = math.pi - abs(angle), _leaves_left(a, b)
    if off > 1.0 or angle * to_the_left <= 0.0:
        return False
    return 2.0 * math.sin(off) / abs(to_the_left) < min(reach_mm, flat_length(a, plane), flat_length(b, plane))


def _leaves_left(a: Element, b: Element) -> float:
    """Curvature of b to the left of the way back, 1/mm; 0 if it is the way back."""
    ends = curvature(a, 1.0), curvature(b, 0.0)
    return sum(ends) if abs(sum(ends)) > SAME_CURVATURE * max(map(abs, ends)) else 0.0


def curvature(element: Element, share: float) -> float:
    """1 / R at its beginning or end (share 0 or 1), counter-clockwise."""
    if isinstance(element, Straight):
        return 0.0
    return math.copysign(1.0 / (element.end_radius_mm if share else element.radius_mm), element.sweep_rad)


def flat_length(element: Element, plane: Plane) -> float:
    """Length in the plane."""
    if isinstance(element, Arc):
        return abs(element.sweep_rad) * (element.radius_mm + element.end_radius_mm) / 2.0
    return math.dist(plane.of(element.start), plane.of(element.end))


def offset(element: Element, plane: Plane, distance: float) -> Element | None:
    """The element moved to its left; None for an arc that vanishes."""
    if isinstance(element, Straight):
        normal = left_of(heading(element, plane, 0.0))
        return Straight(*(_moved(p, plane, normal, distance) for p in (element.start, element.end)))
    sense = 1.0 if element.sweep_rad > 0.0 else -1.0
    ends = []
    for point, radius in ((element.start, element.radius_mm), (element.end, element.end_radius_mm)):
        if radius - sense * distance <= NEAR:
            return None
        u, v = plane.of(point)
        factor = (radius - sense * distance) / radius
        centre = element.centre
        ends.append(plane.into(point, centre[0] + factor * (u - centre[0]), centre[1] + factor * (v - centre[1])))
    return replace(element, start=ends[0], end=ends[1])


def _moved(point: Point, plane: Plane, direction: UV, distance: float) -> Point:
    u, v = plane.of(point)
    return plane.into(point, u + distance * direction[0], v + distance * direction[1])


def meetings(a: Element, b: Element, plane: Plane) -> list[UV]:
    """Intersections of the whole lines or circles of two elements: none, one or two."""
    if isinstance(a, Straight) and isinstance(b, Straight):
        return _lines(plane.of(a.start), heading(a, plane, 0.0), plane.of(b.start), heading(b, plane, 0.0))
    if isinstance(a, Straight) and isinstance(b, Arc):
        return _line_circle(plane.of(a.start), heading(a, plane, 0.0), b.centre, b.end_radius_mm)
    if isinstance(a, Arc) and isinstance(b, Straight):
        return _line_circle(plane.of(b.start), heading(b, plane, 0.0), a.centre, a.radius_mm)
    assert isinstance(a, Arc)
    assert isinstance(b, Arc)
    return _circles(a.centre, a.radius_mm, b.centre, b.radius_mm)


def _lines(p: UV, d: UV, q: UV, e: UV) -> list[UV]:
    cross = d[0] * e[1] - d[1] * e[0]
    if abs(cross) < 1e-12:
        return []
    t = ((q[0] - p[0]) * e[1] - (q[1] - p[1]) * e[0]) / cross
    return [(p[0] + t * d[0], p[1] + t * d[1])]


def _line_circle(p: UV, d: UV, centre: UV, radius: float) -> list[UV]:
    along = (centre[0] - p[0]) * d[0] + (centre[1] - p[1]) * d[1]
    foot = (p[0] + along * d[0], p[1] + along * d[1])
    square = radius * radius - (foot[0] - centre[0]) ** 2 - (foot[1] - centre[1]) ** 2
    if square < -1e-9 * max(radius, 1.0):
        return []
    half = math.sqrt(max(square, 0.0))
    return [(foot[0] + s * half * d[0], foot[1] + s * half * d[1]) for s in ((-1.0, 1.0) if half > NEAR else (0.0,))]


def _circles(a: UV, r: float, b: UV, s: float) -> list[UV]:
    apart = math.dist(a, b)
    if apart < NEAR:
        return []
    along = (apart * apart + r * r - s * s) / (2.0 * apart)
    square = r * r - along * along
    if square < -1e-9 * max(r, 1.0):
        return []
    half = math.sqrt(max(square, 0.0))
    d = ((b[0] - a[0]) / apart, (b[1] - a[1]) / apart)
    foot = (a[0] + along * d[0], a[1] + along * d[1])
    return [(foot[0] - k * half * d[1], foot[1] + k * half * d[0]) for k in ((-1.0, 1.0) if half > NEAR else (0.0,))]


def share_of(element: Element, plane: Plane, point: UV) -> float:
    """The share of a point of its line or circle; on an arc the one nearest to 0 .. 1."""
    if isinstance(element, Straight):
        u, v = plane.of(element.start)
        length = flat_length(element, plane)
        d = heading(element, plane, 0.0)
        return ((point[0] - u) * d[0] + (point[1] - v) * d[1]) / length
    angle = math.atan2(point[1] - element.centre[1], point[0] - element.centre[0]) - element.start_rad
    whole, sweep = 2.0 * math.pi, element.sweep_rad
    share = math.fmod(math.copysign(1.0, sweep) * angle, whole)
    share = (share + whole if share < 0.0 else share) / abs(sweep)
    back = share - whole / abs(sweep)
    return share if abs(share - 0.5) <= abs(back - 0.5) else back


def cut(element: Element, plane: Plane, begin: UV | None, end: UV | None) -> Element:
    """The part of an element between two of its points; None: to its own end. Other axes keep their ends."""
    first = 0.0 if begin is None else share_of(element, plane, begin)
    last = 1.0 if end is None else share_of(element, plane, end)
    start = element.start if begin is None else plane.into(element.start, *begin)
    stop = element.end if end is None else plane.into(element.end, *end)
    if isinstance(element, Straight):
        return Straight(start, stop)
    return replace(element, start=start, end=stop, sweep_rad=(last - first) * element.sweep_rad)
