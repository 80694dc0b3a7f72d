"""Curves in space as elements of a path: polynomials (G52), pieces of splines (G50, G51), circles in space (G02, G03).

    Cubic   P(t) = V3 t^3 + V2 t^2 + V1 t + V0,  t from 0 to 1            4.18
    Round   C + r (cos a u + sin a v),  u, v at right angles in its plane       4.3

`share` is that of the length, so that a feed is one along the path. The length of a cubic is integrated in SPANS spans,
by five points of Gauss each; t for a length is the cubic through both ends of a span with its slopes (1e-9 of the
length for curves without cusps).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Final, TypeAlias

import numpy as np
from numpy.typing import NDArray

from isel_twin.firmware.bwo900.geometry.elements import Point

SPANS: Final = 128
_GAUSS: Final = np.polynomial.legendre.leggauss(5)
LEAST_MM: Final = 1e-9
_FLAT: Final = 1e-9  # sine of the angle between two radii that lie on a line
Places: TypeAlias = NDArray[np.float64]  # float64 [n, axes], mm


@dataclass(frozen=True)
class Cubic:
    """Coefficients by axis, mm. Its end is start + v1 + v2 + v3."""

    start: Point
    v1: Point
    v2: Point
    v3: Point

    @cached_property
    def end(self) -> Point:
        return tuple(sum(all_) for all_ in zip(self.start, self.v1, self.v2, self.v3, strict=True))

    @cached_property
    def _v(self) -> Places:
        return np.array([self.start, self.v1, self.v2, self.v3])

    def _at(self, t: NDArray[np.float64], order: int = 0) -> Places:
        """Place, or a derivative by t, [n, axes]."""
        v0, v1, v2, v3 = self._v
        x = t[:, None]
        if order == 0:
            return v0 + x * (v1 + x * (v2 + x * v3))
        return v1 + x * (2.0 * v2 + 3.0 * x * v3) if order == 1 else 2.0 * v2 + 6.0 * x * v3

    @cached_property
    def _lengths(self) -> NDArray[np.float64]:
        """float64 [SPANS + 1], length from the start to t = k / SPANS."""
        nodes, weights = _GAUSS
        t = (np.arange(SPANS)[:, None] + 0.5 + 0.5 * nodes) / SPANS
        speed = np.linalg.norm(self._at(t.ravel(), 1), axis=1).reshape(t.shape)
        return np.concatenate(([0.0], np.cumsum(speed @ weights) * 0.5 / SPANS))

    @property
    def length_mm(self) -> float:
        return float(self._lengths[-1])

    def _t(self, shares: NDArray[np.float64]) -> NDArray[np.float64]:
        lengths, wanted = self._lengths, shares * self.length_mm
        k = np.clip(np.searchsorted(lengths, wanted, side="right") - 1, 0, SPANS - 1)
        span = np.maximum(lengths[k + 1] - lengths[k], LEAST_MM)
        x = np.clip((wanted - lengths[k]) / span, 0.0, 1.0)
        speeds = np.maximum(np.linalg.norm(self._at(np.arange(SPANS + 1) / SPANS, 1), axis=1), LEAST_MM)
        a, b = (np.minimum(span * SPANS / speeds[k + side], 3.0) for side in (0, 1))  # 3: t never runs back
        inside = x * (a + x * (3.0 - 2.0 * a - b + x * (a + b - 2.0)))
        t: NDArray[np.float64] = (k + inside) / SPANS
        return t

    def points(self, shares: NDArray[np.float64]) -> Places:
        """Places at shares of the length, float64 [n]; both ends are exact."""
        places = self._at(self._t(shares))
        places[shares <= 0.0], places[shares >= 1.0] = self.start, self.end
        return places

    def tangent(self, share: float = 0.0) -> Point:
        t = self._t(np.array([share]))
        direction = self._at(t, 1)[0]
        if np.linalg.norm(direction) < LEAST_MM:  # a point that begins or ends with V1 = 0
            near = np.clip(np.array([share]), 1e-6, 1.0 - 1e-6)
            direction = self._at(near, 1)[0]
        return tuple((direction / max(float(np.linalg.norm(direction)), LEAST_MM)).tolist())

    @cached_property
    def tightest_mm(self) -> float:
        """Smallest radius of curvature, of 2 SPANS + 1 places."""
        t = np.arange(2 * SPANS + 1) / (2 * SPANS)
        first, second = self._at(t, 1), self._at(t, 2)
        speed2 = np.maximum((first**2).sum(axis=1), LEAST_MM**2)
        cross2 = np.maximum(speed2 * (second**2).sum(axis=1) - (first * second).sum(axis=1) ** 2, 0.0)
        bend = float(np.max(np.sqrt(cross2) / speed2**1.5))
        return 1.0 / bend if bend > 0.0 else math.inf

    @cached_property
    def steepest(self) -> Point:
        """Largest share of the speed that each axis gets."""
        first = self._at(np.arange(SPANS + 1) / SPANS, 1)
        speed = np.maximum(np.linalg.norm(first, axis=1), LEAST_MM)
        return tuple(np.max(np.abs(first) / speed[:, None], axis=0).tolist())

    def extent(self, axis: int) -> tuple[float, float]:
        """Lowest and highest coordinate of an axis: at the ends, or where it turns back."""
        roots = np.roots([3.0 * self.v3[axis], 2.0 * self.v2[axis], self.v1[axis]])
        turns = [float(t.real) for t in roots if abs(t.imag) < LEAST_MM and 0.0 < t.real < 1.0]
        values = [self.start[axis], self.end[axis], *self._at(np.array(turns))[:, axis].tolist()]
        return min(values), max(values)

    def parts(self, count: int) -> tuple[Cubic, ...]:
        """The same curve in as many pieces, each of the same step of t."""
        made: list[Cubic] = []
        _, v1, v2, v3 = self._v
        h = 1.0 / count
        start = self.start
        for k in range(count):
            t = k * h
            first, second = h * (v1 + t * (2.0 * v2 + 3.0 * t * v3)), h * h * (v2 + 3.0 * t * v3)
            piece = Cubic(start, *(tuple(v.tolist()) for v in (first, second, h**3 * v3)))
            start = piece.end
            made.append(piece)
        return tuple(made)


@dataclass(frozen=True)
class Round:
    """An arc in space about a centre, from start to end; sweep_rad negative: the long way. If the radii at both ends
    differ, it runs evenly from one to the other. Raises ValueError if the three points lie on a line: no plane."""

    start: Point
    end: Point
    centre: Point
    long: bool

    def __post_init__(self) -> None:
        if self.radius_mm <= LEAST_MM or self.end_radius_mm <= LEAST_MM:
            raise ValueError("the centre is the start or the end")
        if np.linalg.norm(self._across) <= _FLAT:
            raise ValueError("start, end and centre on a line are no plane")

    @cached_property
    def _arms(self) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        centre = np.array(self.centre)
        return np.array(self.start) - centre, np.array(self.end) - centre

    @property
    def radius_mm(self) -> float:
        return float(np.linalg.norm(self._arms[0]))

    @property
    def end_radius_mm(self) -> float:
        return float(np.linalg.norm(self._arms[1]))

    @cached_property
    def _u(self) -> NDArray[np.float64]:
        unit: NDArray[np.float64] = self._arms[0] / self.radius_mm
        return unit

    @cached_property
    def _across(self) -> NDArray[np.float64]:
        """What of the direction to the end is at right angles to that to the start."""
        unit = self._arms[1] / self.end_radius_mm
        rest: NDArray[np.float64] = unit - float(unit @ self._u) * self._u
        return rest

    @cached_property
    def _w(self) -> NDArray[np.float64]:
        unit: NDArray[np.float64] = self._across / np.linalg.norm(self._across)
        return unit

    @cached_property
    def sweep_rad(self) -> float:
        short = math.atan2(float(np.linalg.norm(self._across)), float(self._arms[1] @ self._u) / self.end_radius_mm)
        return short - 2.0 * math.pi if self.long else short

    @property
    def length_mm(self) -> float:
        mean = (self.radius_mm + self.end_radius_mm) / 2.0
        return math.hypot(mean * self.sweep_rad, self.end_radius_mm - self.radius_mm)

    def points(self, shares: NDArray[np.float64]) -> Places:
        """Places at shares of the angle, float64 [n]; both ends are exact."""
        angle = (shares * self.sweep_rad)[:, None]
        radius = self.radius_mm + shares[:, None] * (self.end_radius_mm - self.radius_mm)
        places: Places = np.array(self.centre) + radius * (np.cos(angle) * self._u + np.sin(angle) * self._w)
        places[shares <= 0.0], places[shares >= 1.0] = self.start, self.end
        return places

    def tangent(self, share: float = 0.0) -> Point:
        angle, sense = share * self.sweep_rad, math.copysign(1.0, self.sweep_rad)
        direction = sense * (math.cos(angle) * self._w - math.sin(angle) * self._u)
        return tuple(direction.tolist())

    @property
    def tightest_mm(self) -> float:
        return min(self.radius_mm, self.end_radius_mm)

    @cached_property
    def steepest(self) -> Point:
        return tuple(np.hypot(self._u, self._w).tolist())

    def extent(self, axis: int) -> tuple[float, float]:
        """Lowest and highest coordinate of an axis: at the ends, or where the circle turns back."""
        first = math.atan2(float(self._w[axis]), float(self._u[axis]))
        shares = [(first + k * math.pi) / self.sweep_rad for k in range(-3, 4)]
        inside = np.array([0.0, 1.0, *(share for share in shares if 0.0 < share < 1.0)])
        values = self.points(inside)[:, axis]
        return float(values.min()), float(values.max())


Bent: TypeAlias = Cubic | Round


def through(start: Point, end: Point, leaving: Point, arriving: Point) -> Cubic:
    """The cubic between two points with these derivatives by t at its ends (Hermite)."""
    way = [b - a for a, b in zip(start, end, strict=True)]
    v2 = tuple(3.0 * w - 2.0 * a - b for w, a, b in zip(way, leaving, arriving, strict=True))
    v3 = tuple(a + b - 2.0 * w for w, a, b in zip(way, leaving, arriving, strict=True))
    return Cubic(start, leaving, v2, v3)
