"""From blocks to pieces of a joined motion: limits of axes and path, corners, exact stops (manual 8.5, P8851 on).

    speed of a piece      the feed, the rapid speed of the axis with the longest way (G00), and what each axis can:
                          v <= V_i / |d_i|,  d the direction; V_i = P12004, P12120, slope (P12136)
    acceleration          a <= A_i / |d_i|,  A_i = P12004 / P12008, or P12009 where that is longer and it is no G00
                          (bwo900/14)
    on a circle           v^2 / R and the ramp share the acceleration of the plane's axes: each has 1 / sqrt 2 of it
                          P8852: v <= KV sqrt(2 R P8852), the deviation that the servo's lag makes (bwo900/15)
    at a corner           factor of the lower of both speeds: cos(180 deg - angle) ^ P8851, 0 at 90 degrees and sharper
    P8857                 the same deviation on the circle through the ends of two elements that join, and on arcs
    feed dynamics         P8850 = 1: the feed is that of the point of contact, F r / R, r of the tool's centre
                          P8850 > 1: F (1 + p / 100 (P8850 - R) / (P8850 - WR)), WR <= R <= P8850, p P8848 where the
                          contour is convex, P8849 where it is concave; R its radius, WR the tool's

Lengths in mm, speeds in mm/s, accelerations in mm/s^2; displacements in increments, whole numbers whose sums are those
of the rounded places, so that no path drifts.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import groupby
from operator import add, mul, sub
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.blocks import BlockEnd, Correction, PathBlock
from isel_twin.firmware.bwo900.geometry.curves import Bent, Round
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Point, Straight
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte
from isel_twin.motion.pieces import Curve, Pieces

MINUTE_S: Final = 60.0
FASTEST_MM_MIN: Final = 6_000.0  # P12004 if unset
DYNAMICS_MS: Final = 250.0  # P12008 if unset: time from standstill to the highest speed
KV_1_S: Final = 16.0  # P12020 if unset
FURTHEST: Final = 2.0**31  # increments from zero that a counter of 32 bits holds
SHARE: Final = math.sqrt(0.5)  # of the acceleration, on circles: across the path and along it
STRAIGHT: Final = 1e-9  # sine of an angle that counts as 0
NO_CONTOUR_MM: Final = 1e-6  # radius of a contour that counts as a corner
MANY: Final = 8  # blocks from which on columns are faster than rows
CONTINUOUS: Final = BlockEnd.CONTINUOUS  # bound once: looking up a member takes 0.2 us
SLOWEST: Final = 0.01  # least part of the feed left by P8848 and P8849


@dataclass(frozen=True, slots=True)
class MotionLimits:
    """Limits of axes and path, from the parameters; tuples have one value an axis."""

    increments_per_mm: tuple[float, ...]
    speed: Point  # mm/s, of paths
    hand: Point  # mm/s, of moves without a program
    acceleration: Point  # mm/s^2, with feed
    rapid_acceleration: Point  # mm/s^2, with G00
    rapid: float  # mm/s, of the axis with the longest way
    corner: float  # exponent of the corner factor; negative: off
    deviation_mm: float  # P8852, 0: off
    kv: float
    test_feed: float | None  # P8815, mm/s: in place of all feeds
    feed_share: float = 1.0  # P8818: of every programmed feed
    contour_mm: float = 0.0  # P8857, 0: off
    convex: float = 0.0
    concave: float = 0.0  # P8848 and P8849, as a share of the feed: -1 to 1
    # P8850: 0 off, 1 feed at the point of contact, above that the largest radius with another feed
    reference_mm: float = 0.0
    # P12010 of an axis: ramps are sin^2. They take as long as linear ones, and are pi/2 steeper in their middle.
    sine: bool = False
    turns_s: float = 1.0  # revolutions a second that feeds in mm a revolution are reckoned with

    def feed_mm_s(self, programmed_mm_min: float) -> float:
        return self.test_feed or self.feed_share * programmed_mm_min / MINUTE_S

    @property
    def steeper(self) -> float:
        """Factor of the acceleration in the middle of a ramp."""
        return math.pi / 2.0 if self.sine else 1.0

    @classmethod
    def of(cls, parameters: Parameters, increments_per_mm: Sequence[float]) -> MotionLimits:
        p, axes = parameters, range(len(increments_per_mm))
        fastest = tuple(positive(p.axis(a, Axis.SPEED, 0.0), FASTEST_MM_MIN) / MINUTE_S for a in axes)
        rise_ms = [positive(p.axis(a, Axis.DYNAMICS_1, 0.0), DYNAMICS_MS) for a in axes]
        first = tuple(v / (1e-3 * ms) for v, ms in zip(fastest, rise_ms, strict=True))
        second = tuple(
            min(v / (1e-3 * ms), f) if (ms := p.axis(a, Axis.DYNAMICS_2, 0.0)) > 0.0 else f
            for a, v, f in zip(axes, fastest, first, strict=True)
        )
        hand = tuple(_slope(p, a, v) for a, v in enumerate(fastest))
        speed = tuple(min(v, positive(p.axis(a, Axis.HAND_SPEED, 0.0) / MINUTE_S, v)) for a, v in enumerate(hand))
        exponent = p.get(P.CORNER_DYNAMICS) if p.loaded(P.CORNER_DYNAMICS) else 1.0
        return cls(
            increments_per_mm=tuple(increments_per_mm),
            speed=speed,
            acceleration=second,
            rapid_acceleration=first,
            hand=hand,
            rapid=positive(p.get(P.RAPID), max(fastest) * MINUTE_S) / MINUTE_S,
            corner=exponent if exponent > 0.0 or exponent == -1.0 else 1.0,
            deviation_mm=max(p.get(P.CIRCLE_DYNAMICS), 0.0),
            kv=min(positive(p.axis(a, Axis.KV, 0.0), KV_1_S) for a in axes),
            test_feed=max(p.get(P.TEST_FEED), 0.0) / MINUTE_S or None,
            feed_share=positive(p.get(P.FEED_SHARE), 100.0) / 100.0,
            contour_mm=max(p.get(P.CONTOUR_DYNAMICS), 0.0),
            convex=_share(p.get(P.CONVEX)),
            concave=_share(p.get(P.CONCAVE)),
            reference_mm=max(p.get(P.FEED_DYNAMICS), 0.0),
            sine=any(p.axis(a, Axis.DYNAMICS_KIND, 0.0) == 1.0 for a in axes),
        )


def positive(value: float, default: float) -> float:
    """The value of a parameter, or the default where it is 0, deleted or negative."""
    return value if value > 0.0 else default


def circumradius(a: Point, b: Point, c: Point) -> float:
    """Radius in mm of the circle through three points; infinite for points on a line."""
    first, second, chord = math.dist(a, b), math.dist(b, c), math.dist(a, c)
    if first <= 0.0 or second <= 0.0:
        return math.inf
    cosine = sum((y - x) * (z - y) for x, y, z in zip(a, b, c, strict=True)) / (first * second)
    sine = math.sqrt(max(1.0 - cosine * cosine, 0.0))
    return chord / (2.0 * sine) if sine > STRAIGHT else math.inf


def feed_factor(arc: Arc, correction: Correction, limits: MotionLimits) -> float:
    """Factor of the feed on an arc of the tool's centre beside a contour (P8848 to P8850); 1 without a contour, as on
    an arc around an outer corner."""
    reference, tool, centre = limits.reference_mm, correction.radius_mm, arc.radius_mm
    if not correction.side or tool <= 0.0 or reference < 1.0:
        return 1.0
    concave = correction.side * arc.sweep_rad > 0.0
    contour = centre + tool if concave else centre - tool
    if contour <= NO_CONTOUR_MM:
        return 1.0
    if reference == 1.0:
        return centre / contour
    if reference <= tool or contour >= reference:
        return 1.0
    part = min((reference - contour) / (reference - tool), 1.0)
    return max(1.0 + (limits.concave if concave else limits.convex) * part, SLOWEST)


def _slope(p: Parameters, axis: int, fastest: float) -> float:
    """Speed that P12136 allows an axis, mm/s: P12005 by byte 1, P12006 by byte 2, 10 and 20 % of P12004 unless set."""
    asked, most = p.axis(axis, Axis.SLOPE, 0.0), fastest
    for number, speed, share in ((1, Axis.SLOPE_SPEED_1, 0.1), (2, Axis.SLOPE_SPEED_2, 0.2)):
        if byte(asked, number) & 1:
            most = min(most, positive(p.axis(axis, speed, 0.0) / MINUTE_S, share * fastest))
    return most


def _share(percent: float) -> float:
    """Percent, at most 100 either way, as a share."""
    return min(max(percent, -100.0), 100.0) / 100.0


def corner_factor(cosine: float, exponent: float) -> float:
    """Factor of the speed at a corner (P8851); cosine: of the change of direction, 1 straight on, 0 and less: none.

    Exponent 1 gives 0, 0.5, 0.707, 0.866, 1 at 90, 120, 135, 150, 180 degrees between the lines; negative: off.
    """
    return 1.0 if exponent < 0.0 else min(max(cosine, 0.0), 1.0) ** exponent


def _corner_factors(cosines: NDArray[np.float64], exponent: float) -> NDArray[np.float64]:
    """`corner_factor` of each, to the bit: exponents other than 1 are those of the mathematics library, one by one."""
    if exponent == 1.0:
        return np.clip(cosines, 0.0, 1.0)
    return np.array([corner_factor(cosine, exponent) for cosine in cosines.tolist()])


def _cosine(a: Iterable[Any], b: Iterable[Any]) -> Any:
    """Of the angle between unit vectors, of numbers or of columns: their products added in the order of the axes."""
    return reduce(add, map(mul, a, b), 0.0)


class PieceMaker:
    """Makes pieces from blocks; remembers position, direction and speed at the end of the last one."""

    def __init__(self, limits: MotionLimits, position: Point) -> None:
        """position: where the axes stand, mm."""
        self.limits = limits
        self._place = self._increments(position)
        self._end: tuple[Point, float] | None = None
        """Direction and speed at the end of the last piece; None: it ends at 0."""
        self._line: tuple[Point, Point] | None = None
        """The last piece, if it is a line with a feed that the next one joins; kept where P8857 limits the speed."""

    def pieces(self, blocks: Sequence[PathBlock]) -> tuple[Pieces, list[int]]:
        """The pieces of these blocks, and the number of each block. Raises ProgramError: M1230 no feed, M1237."""
        ways: list[NDArray[np.float64]] = []
        tables: list[NDArray[np.float64]] = []
        curves: list[tuple[int, Curve]] = []
        counts: list[int] = []
        for plain, group in groupby(blocks, self._joins_by_a_line):
            run = list(group)
            lines = [element for block in run for element in block.elements if isinstance(element, Straight)]
            made = self._lines(lines, run) if plain and len(run) >= MANY else None
            if made is not None:
                counts += [1] * len(run)
            else:
                made = self._one_by_one(run, sum(map(len, ways)), curves, counts)
            ways.append(made[0])
            tables.append(made[1])
        way = np.concatenate(ways) if ways else np.empty((0, len(self._place)))
        table = np.concatenate(tables, axis=1) if tables else np.empty((5, 0))
        return Pieces(way, table[0], table[1], table[2], table[3], table[4], tuple(curves)), counts

    def _joins_by_a_line(self, block: PathBlock) -> bool:
        """True for one line with a feed that nothing stops."""
        return (
            len(block.elements) == 1
            and type(block.elements[0]) is Straight
            and not block.rapid
            and not block.per_turn
            and block.end is CONTINUOUS
            and block.end_feed_mm_min is None
            and (block.feed_mm_min or 0.0) > 0.0
            and not self.limits.contour_mm
        )

    def _lines(
        self, lines: Sequence[Straight], blocks: Sequence[PathBlock]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]] | None:
        """As `_one_by_one`, to the bit, for many blocks that join by lines; None if one of them is left out there, or
        has an error."""
        limits = self.limits
        start, end = np.array([line.start for line in lines]), np.array([line.end for line in lines])
        length = np.array([line.length_mm for line in lines])
        exact = end * np.array(limits.increments_per_mm)
        if not (np.abs(exact) <= FURTHEST).all() or not (length > 0.0).all():
            return None
        places = np.rint(exact)
        way = np.diff(places, axis=0, prepend=[self._place])
        if not way.any(axis=1).all():
            return None
        direction = (end - start) / length[:, None]
        share = np.abs(direction)
        share[share == 0.0] = math.nan  # an axis that rests limits nothing
        limit = np.fmin.reduce(np.array(limits.speed) / share, axis=1)
        acceleration = np.fmin.reduce(np.array(limits.acceleration) / share, axis=1) * limits.steeper
        feeds = [block.feed_mm_min or 0.0 for block in blocks]
        known = {feed: limits.feed_mm_s(feed) for feed in set(feeds)}
        wanted = np.array([known[feed] for feed in feeds])
        speed = np.minimum(wanted, limit)
        before, last = self._end or (direction[0], 0.0)
        cosines = _cosine(np.vstack([before, direction[:-1]]).T, direction.T)
        entry = _corner_factors(cosines, limits.corner) * np.minimum(np.append(last, speed[:-1]), speed)
        self._place = tuple(map(int, places[-1].tolist()))
        self._end = tuple(direction[-1].tolist()), float(speed[-1])
        return way, np.stack([length, wanted, limit, acceleration, entry])

    def _one_by_one(
        self, blocks: Sequence[PathBlock], first: int, curves: list[tuple[int, Curve]], counts: list[int]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Displacements [n, axes] and the other columns [5, n] of n pieces. first: number of the first; adds to curves
        and counts."""
        rows: list[Point] = []
        columns: list[tuple[float, float, float, float, float]] = []
        for block in blocks:
            before = len(rows)
            for element in block.elements:
                length = element.length_mm
                end = self._increments(element.end)
                way = tuple(map(sub, end, self._place))
                if length <= 0.0 or (not any(way) and isinstance(element, Straight)):
                    continue
                wanted, limit, acceleration = self._law(element, block)
                if not block.rapid:
                    limit = min(limit, self._contour(element))
                entry = self._entry(element, min(wanted, limit))
                if isinstance(element, Arc):
                    curves.append((first + len(rows), _Curve(element, self._place, self.limits.increments_per_mm)))
                elif not isinstance(element, Straight):
                    curves.append((first + len(rows), _BentCurve(element, self._place, self.limits.increments_per_mm)))
                rows.append(way)
                columns.append((length, wanted, limit, acceleration, entry))
                self._place = end
                self._end = element.tangent(1.0), min(wanted, limit)
                line = isinstance(element, Straight) and not block.rapid
                self._line = (element.start, element.end) if line else None
            if block.end is not BlockEnd.CONTINUOUS:
                self.stop()
            elif block.end_feed_mm_min is not None and self._end is not None:
                self._end = self._end[0], min(self._end[1], self._feed_mm_s(block, block.end_feed_mm_min))
            counts.append(len(rows) - before)
        table = np.array(columns, dtype=np.float64).reshape(len(rows), 5).T
        return np.array(rows, dtype=np.float64).reshape(len(rows), len(self._place)), table

    def stop(self) -> None:
        self._end = self._line = None

    def _increments(self, place: Point) -> tuple[int, ...]:
        exact = [x * per for x, per in zip(place, self.limits.increments_per_mm, strict=True)]
        if not all([abs(value) <= FURTHEST for value in exact]):
            raise ProgramError(Code.TOO_LARGE, "a place that no counter holds")
        return tuple(map(round, exact))

    def _law(self, element: Element | Bent, block: PathBlock) -> tuple[float, float, float]:
        """Wanted speed (bwo900/28), highest speed and acceleration of an element, mm/s and mm/s^2."""
        limits = self.limits
        able = limits.rapid_acceleration if block.rapid else limits.acceleration
        if isinstance(element, Arc):
            limit, acceleration = self._around(element, able)
            wanted = limit
        elif not isinstance(element, Straight):
            limit, acceleration = self._along(element, able)
            wanted = limit
        else:
            direction = [abs(d) for d in element.tangent()]
            limit = min([v / d for v, d in zip(limits.speed, direction, strict=True) if d > 0.0])
            acceleration = min([a / d for a, d in zip(able, direction, strict=True) if d > 0.0])
            wanted = limits.rapid / max(direction)
        if not block.rapid:
            if block.feed_mm_min is None or block.feed_mm_min <= 0.0:
                raise ProgramError(Code.NO_FEED)
            wanted = limits.test_feed or limits.feed_share * self._feed_mm_s(block, block.feed_mm_min)
            if isinstance(element, Arc):
                wanted *= feed_factor(element, block.correction, limits)
        return wanted, limit, acceleration * limits.steeper

    def _feed_mm_s(self, block: PathBlock, feed: float) -> float:
        return feed * self.limits.turns_s if block.per_turn else feed / MINUTE_S

    def _around(self, arc: Arc, able: Point) -> tuple[float, float]:
        limits, plane = self.limits, arc.plane
        radius = min(arc.radius_mm, arc.end_radius_mm)
        flat = abs(arc.sweep_rad) * (arc.radius_mm + arc.end_radius_mm) / 2.0 / arc.length_mm
        pair = (plane.first, plane.second)
        speed = min(limits.speed[axis] for axis in pair) / flat
        across = SHARE * min(able[axis] for axis in pair)
        acceleration = across / flat
        speed = min(speed, math.sqrt(across * radius) / flat)
        for axis, (a, b) in enumerate(zip(arc.start, arc.end, strict=True)):
            if axis not in pair and a != b:
                share = abs(b - a) / arc.length_mm
                speed = min(speed, limits.speed[axis] / share)
                acceleration = min(acceleration, able[axis] / share)
        if limits.deviation_mm:
            if limits.deviation_mm > radius:
                raise ProgramError(Code.CIRCLE_DYNAMICS, f"P8852 is {limits.deviation_mm:g}, the radius {radius:g} mm")
            speed = min(speed, limits.kv * math.sqrt(2.0 * radius * limits.deviation_mm))
        return speed, acceleration

    def _along(self, curve: Bent, able: Point) -> tuple[float, float]:
        """On a curve in space: as around a circle of its tightest radius, with each axis at its steepest."""
        limits, radius = self.limits, curve.tightest_mm
        moving = [(axis, share) for axis, share in enumerate(curve.steepest) if share > STRAIGHT]
        speed = min(limits.speed[axis] / share for axis, share in moving)
        across = SHARE * min(able[axis] for axis, _ in moving)
        acceleration = SHARE * min(able[axis] / share for axis, share in moving)
        speed = min(speed, math.sqrt(across * radius))
        if limits.deviation_mm and isinstance(curve, Round):
            if limits.deviation_mm > radius:
                raise ProgramError(Code.CIRCLE_DYNAMICS, f"P8852 is {limits.deviation_mm:g}, the radius {radius:g} mm")
            speed = min(speed, limits.kv * math.sqrt(2.0 * radius * limits.deviation_mm))
        return speed, acceleration

    def _contour(self, element: Element | Bent) -> float:
        """Highest speed by P8857: on an arc, or on a line by the circle through it and the line before."""
        limits = self.limits
        if not limits.contour_mm:
            return math.inf
        if isinstance(element, Arc):
            radius = min(element.radius_mm, element.end_radius_mm)
        elif not isinstance(element, Straight):
            radius = element.tightest_mm
        elif self._line is not None:
            radius = circumradius(*self._line, element.end)
        else:
            return math.inf
        return limits.kv * math.sqrt(2.0 * radius * limits.contour_mm)

    def _entry(self, element: Element | Bent, speed: float) -> float:
        if self._end is None:
            return 0.0
        before, last = self._end
        return corner_factor(_cosine(before, element.tangent(0.0)), self.limits.corner) * min(last, speed)


class _Curve:
    """An arc as a `Curve` of a joined motion."""

    def __init__(self, arc: Arc, begin: Sequence[int], per_mm: Sequence[float]) -> None:
        self._arc, self._begin, self._per_mm = arc, np.array(begin, dtype=np.float64), np.array(per_mm)

    def displacement(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        arc = self._arc
        share = s / arc.length_mm
        start, end = np.array(arc.start), np.array(arc.end)
        points = start + share[:, None] * (end - start)
        radius = arc.radius_mm + share * (arc.end_radius_mm - arc.radius_mm)
        angle = arc.start_rad + share * arc.sweep_rad
        points[:, arc.plane.first] = arc.centre[0] + radius * np.cos(angle)
        points[:, arc.plane.second] = arc.centre[1] + radius * np.sin(angle)
        way: NDArray[np.float64] = points * self._per_mm - self._begin
        way[share <= 0.0] = 0.0
        return way


class _BentCurve:
    """A curve in space as a `Curve` of a joined motion."""

    def __init__(self, curve: Bent, begin: Sequence[int], per_mm: Sequence[float]) -> None:
        self._curve, self._begin, self._per_mm = curve, np.array(begin, dtype=np.float64), np.array(per_mm)

    def displacement(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        share = s / self._curve.length_mm
        way: NDArray[np.float64] = self._curve.points(share) * self._per_mm - self._begin
        way[share <= 0.0] = 0.0
        return way
