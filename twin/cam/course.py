"""The way of the tool in counts: checked against travel and speeds, without moves of no length.

    Rapid Line Arc  --- Course --->  Move, Move, ...     in whole counts, absolute: nothing drifts
                                     Turn                an arc that the controller makes by itself

Rounded is the point, not the way to it, and Z takes its sense here, last of all (language/2). A feed is the speed along
the path (language/1); a wrong place is refused, a speed is clipped (language/4).
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import NamedTuple, Protocol

from isel_twin.cam import arcs
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Caution, Place, Point, Reference
from isel_twin.cam.written import AXES, Counts, MachineAxes

CLOSE = 1e-9  # of a speed: no difference


class TravelError(CamError):
    """A way beyond the travel of the machine, as the zero of the work is."""


class Move(NamedTuple):
    """A straight move, never of no length."""

    place: Place
    to: Counts
    steps: Counts  # from the point before
    length_mm: float
    speed_mm_s: float  # along the path
    hz: float  # counts a second of the axis with most of them
    rapid: bool


class Turn(NamedTuple):
    """An arc in counts, about a centre that need not be a whole number of them."""

    place: Place
    start: Counts
    to: Counts
    a: int  # first axis of its plane
    b: int
    centre: tuple[float, float]  # along a and b, counts
    sweep: float  # rad; positive from a to b, as the counters count
    per_mm: float  # counts, of both axes
    radius_mm: float
    spread_mm: float  # by which the radius grows
    length_mm: float
    speed_mm_s: float

    @property
    def flat_mm(self) -> float:
        """Its length in its plane. Where that is no count, a controller may take it for a full circle."""
        return self.radius_mm * abs(self.sweep)


class Limits(Protocol):
    """Limits of what a controller makes."""

    @property
    def low_hz(self) -> float: ...

    @property
    def high_hz(self) -> float: ...

    @property
    def along_path(self) -> bool:
        """Its speeds are those of the path, not of the axis with most counts."""

    def turn_counts(self, turn: Turn) -> float | None:
        """Counts to which its speed in this arc applies, over the whole arc; None if it does not make it by itself at
        least as exactly as by chords. What it takes is asked of `Commands.turn` next."""


class Course:
    """Follows the tool. cautions: said since they were taken last; each kind once."""

    def __init__(self, axes: MachineAxes, settings: CamSettings, limits: Limits) -> None:
        self.point: Point = (0.0, 0.0, 0.0)  # as programmed, mm, Z upwards: where the reference run ends
        self.cautions: list[Caution] = []
        self._axes = axes
        self._limits = limits
        self._tolerance = settings.tolerance_mm
        x, y, z = axes.steps_mm
        self._per_mm = x, y, z * settings.z_sign
        self._coarsest = min(axes.steps_mm)
        self._counts: Counts = (0, 0, 0)
        self._range = axes.range_counts
        self._said: set[str] = set()

    def caution(self, kind: str, place: Place, text: str) -> None:
        if kind not in self._said:
            self._said.add(kind)
            self.cautions.append(Caution(place, text))

    def referenced(self, run: Reference) -> None:
        """Axes stand at 0."""
        self.point = run.ends(self.point)
        x, y, z = (0 if axis in run.axes else old for axis, old in enumerate(self._counts))
        self._counts = x, y, z

    def line(self, place: Place, to: Point, speed: float, rapid: bool = False) -> Move | None:
        """The straight way from here; None if it has no length in counts. Raises CamError."""
        self.point = to
        sx, sy, sz = self._per_mm
        counts = x, y, z = round(to[0] * sx), round(to[1] * sy), round(to[2] * sz)
        x0, y0, z0 = self._counts
        steps = dx, dy, dz = x - x0, y - y0, z - z0
        if not (dx or dy or dz):
            return None
        (x_low, x_high), (y_low, y_high), (z_low, z_high) = self._range
        if not (x_low <= x <= x_high and y_low <= y <= y_high and z_low <= z <= z_high):
            raise self._beyond(place, counts)
        self._counts = counts
        mx, my, mz = dx / sx, dy / sy, dz / sz
        length = math.sqrt(mx * mx + my * my + mz * mz)
        most = max(abs(dx), abs(dy), abs(dz))
        limits = self._limits
        counted = self._coarsest * length if limits.along_path else most
        hz = speed * counted / length
        if self._axes.top_mm_s or not limits.low_hz <= hz <= limits.high_hz:
            speed = self._limited(place, speed, length, counted, (mx, my, mz), rapid)
        return Move(place, counts, steps, length, speed, speed * most / length, rapid)

    def arc(self, arc: Arc) -> Iterator[Move | Turn]:
        """The arc from here, by the controller itself or by chords. Raises CamError."""
        start = self.point
        of = arcs.shape(arc, start)
        turn = self._turn(arc, of)
        if turn is not None and (counted := self._limits.turn_counts(turn)) is not None:
            self._check_bounds(turn, of)
            limits = self._limits
            if self._axes.top_mm_s or not limits.low_hz <= arc.feed_mm_s * counted / of.length <= limits.high_hz:
                ways = [0.0, 0.0, 0.0]
                ways[of.a] = ways[of.b] = of.length
                speed = self._limited(arc.place, arc.feed_mm_s, of.length, counted, ways, rapid=False)
                turn = turn._replace(speed_mm_s=speed)
            self.point, self._counts = arc.to, turn.to
            yield turn
            return
        for to in arcs.chords(arc, start, of, self._tolerance):
            if (move := self.line(arc.place, to, arc.feed_mm_s)) is not None:
                yield move

    def _turn(self, arc: Arc, of: arcs.Shape) -> Turn | None:
        """None if one axis of its plane is finer than the other."""
        a, b = of.a, of.b
        per_a, per_b = self._per_mm[a], self._per_mm[b]
        if abs(per_a) != abs(per_b):
            return None
        (x, y, z), (sx, sy, sz) = arc.to, self._per_mm
        mirrored = -1 if per_a * per_b < 0 else 1
        return Turn(
            place=arc.place,
            start=self._counts,
            to=(round(x * sx), round(y * sy), round(z * sz)),
            a=a,
            b=b,
            centre=(of.centre[0] * per_a, of.centre[1] * per_b),
            sweep=of.sweep * mirrored,
            per_mm=abs(per_a),
            radius_mm=of.start_radius,
            spread_mm=of.end_radius - of.start_radius,
            length_mm=of.length,
            speed_mm_s=arc.feed_mm_s,
        )

    def _check_bounds(self, turn: Turn, of: arcs.Shape) -> None:
        """Raise CamError for an arc that leaves the travel; one that ends on its border is within half a count."""
        (a_low, a_high), (b_low, b_high) = self._range[of.a], self._range[of.b]
        (ca, cb), r = turn.centre, max(of.start_radius, of.end_radius) * turn.per_mm
        lowest, highest = self._range[of.third]
        level = lowest <= turn.to[of.third] <= highest
        if level and a_low <= ca - r and ca + r <= a_high and b_low <= cb - r and cb + r <= b_high:
            return  # so does the whole circle, as nearly all do
        low, high = list(self.point), list(self.point)
        for axis, (least, greatest) in zip((of.a, of.b), arcs.bounds(of), strict=True):
            low[axis], high[axis] = least, greatest
        low[of.third] = high[of.third] = self.point[of.third] + of.height
        for corner in (low, high):
            x, y, z = (round(mm * per) for mm, per in zip(corner, self._per_mm, strict=True))
            if not all(least <= at <= most for at, (least, most) in zip((x, y, z), self._range, strict=True)):
                raise self._beyond(turn.place, (x, y, z))

    def _limited(
        self, place: Place, speed: float, length: float, counted: float, ways: Sequence[float], rapid: bool
    ) -> float:
        """The speed within what controller and axes make. ways: of each axis, mm."""
        limits = self._limits
        fastest = limits.high_hz * length / counted
        for top, way in zip(self._axes.top_mm_s or (), ways, strict=False):
            fastest = min(fastest, top * length / abs(way)) if way else fastest
        slowest = min(limits.low_hz * length / counted, fastest)
        what = "rapid" if rapid else "feed"
        wanted = f"{what} of {speed:g} mm/s is"
        if speed > fastest * (1.0 + CLOSE):
            self.caution(f"fast {what}", place, f"a {wanted} more than the machine makes: {fastest:.4g} mm/s here")
        elif speed < slowest * (1.0 - CLOSE):
            self.caution(f"slow {what}", place, f"a {wanted} less than the controller makes: {slowest:.4g} mm/s here")
        return min(max(speed, slowest), fastest)

    def _beyond(self, place: Place, counts: Counts) -> CamError:
        for name, at, steps, (low, high), (least, most) in zip(
            AXES, counts, self._axes.steps_mm, self._axes.travel_mm, self._range, strict=True
        ):
            if not least <= at <= most:
                if low == high:
                    return CamError(f"goes along {name}, an axis that this machine has not", place)
                travel = f"which travels from {low:g} to {high:g} mm"
                return TravelError(f"leads to {name} {at / steps:.3f} mm of the machine, {travel}", place)
        raise AssertionError("within the travel")


def halves(turn: Turn) -> list[Counts]:
    """Ends of equal parts of at most half a turn; the last is the end of the arc."""
    n = math.ceil(abs(turn.sweep) / math.pi - CLOSE)
    if n == 1:
        return [turn.to]
    (ca, cb), a, b = turn.centre, turn.a, turn.b
    u, v = turn.start[a] - ca, turn.start[b] - cb
    radius, angle = math.hypot(u, v), math.atan2(v, u)
    wider = (math.hypot(turn.to[a] - ca, turn.to[b] - cb) - radius) / n
    ends = []
    for i in range(1, n):
        at, r = angle + turn.sweep * i / n, radius + wider * i
        x, y, z = (low + round((high - low) * i / n) for low, high in zip(turn.start, turn.to, strict=True))
        point = [x, y, z]
        point[a], point[b] = round(ca + r * math.cos(at)), round(cb + r * math.sin(at))
        ends.append((point[0], point[1], point[2]))
    return [*ends, turn.to]
