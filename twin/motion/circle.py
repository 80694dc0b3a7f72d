"""Circles and helices: a difference algorithm after Bresenham, every tick one step of one of two axes.

Everything is written for the counter-clockwise direction; clockwise is its mirror image, the same with the two axes
exchanged. With the centre at the origin and c = x^2 + y^2 - R^2, the quadrant gives the senses rx, ry = -1 or +1 in
which the axes go, one of them inwards (c falls), the other outwards (c rises):

            rx -1  |  rx -1            A tick makes the one of the two steps that ends nearer to the circle. The sum of
            ry -1  |  ry +1            both new values of c is 2 g,
          ---------+---------              g = c + rx x + ry y + 1,
            rx +1  |  rx +1            so the inward step is made if g > 0, the outward one otherwise. No step leaves
            ry -1  |  ry +1            the circle by more than about half a step.

The controller is not told R but the start point Xs, Ys, the senses Rx, Ry there and the start value D of its register.
Its register is (g - 1) / 2 = (c + rx x + ry y) / 2 with the sign -Rx Ry, so that in every quadrant X steps while it is
positive and Y while it is negative (zero: the one that goes inwards):

    D = Rx Ry (R^2 - Xs (Xs + Rx) - Ys (Ys + Ry)) / 2,    hence    R^2 = 2 Rx Ry D + Xs (Xs + Rx) + Ys (Ys + Ry)   (1)

which is the manual's formula (iMC manual 2.3.3, 2.3.6)

    D = (Rx Ry R + Rx Ry Summe(R - 1) - Rx Summe(Xs + (Rx - Ry)/2) + Ry Summe(Ys + (Rx + Ry)/2)) / 2             (2)

with Summe(n) = n (|n| + 1). Both commands printed in the manual agree: `y400,1500,119,-141,141,-1,-1` gives R = 200,
`w32000,600,-1000,-2000,0,1,-1,6000` gives R = 2000. Its worked example finds the same 119 by two slips that cancel:
Summe(-141) computed as |n| (n + 1), and Ys + (Rx - Ry)/2 instead of Ys + (Rx + Ry)/2. A host written from that text
sends another D, off by up to two steps of radius; `squared_radius` recognises this (decision motion/3).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import Displacement, check_range, even
from isel_twin.native import core

INTERVAL = 8192  # ticks between two checkpoints: some 30 us to walk, 24 bytes to keep
# Steps by which another reading of D must be nearer to the start point than the manual's. Found by trying radii and
# start points (docs/step_streams.md): a host that follows the manual is then hardly ever misread.
HANDICAP = 0.2
LARGEST = 1 << 28  # bound of coordinates and tick numbers: squares fit into 64 bits (the controller's have 24)


def circle(
    ticks: int,
    d: int,
    xs: int,
    ys: int,
    rx: int,
    ry: int,
    clockwise: bool,
    axes: tuple[int, int] = (0, 1),
    third_axis: int | None = None,
    third_steps: int = 0,
    axis_count: int = 4,
) -> Circle:
    """An arc of `ticks` single-axis steps; iMC manual 2.2.28 and 2.3. A helix (2.2.27) has a third axis with signed
    `third_steps`: whichever are fewer, these or those of the arc, are spread evenly over the others.

    d: start value of the difference register. xs, ys: start point in steps from the centre. rx, ry: sense of each axis
    at the start; only the signs are used, to interpret d (motion/4). axes: first and second axis of the plane (0 X, 1 Y
    ...) out of axis_count.

    Raises ValueError for a negative or too large tick number, too large coordinates, or axes that are not different.
    """
    if clockwise:
        (xs, ys), (rx, ry), axes = (ys, xs), (ry, rx), (axes[1], axes[0])
    r2 = squared_radius(d, xs, ys, 1 if rx > 0 else -1, 1 if ry > 0 else -1)
    return Circle(ticks, xs, ys, r2, axes, third_axis, third_steps, axis_count)


def squared_radius(d: int, xs: int, ys: int, rx: int, ry: int) -> int:
    """R^2 that a host means by D = d, counter-clockwise (decision motion/3).

    (2) is solved for R^2 in three readings: Summe(n) = |n| (n + 1) as in the worked example; Summe(n) = n (|n| + 1),
    which is (1); both slips of the example. A reading is valid if it gives the square of a whole number whose circle,
    rounded, passes through the start point; it may miss the square by 1, because an odd R makes 2 D odd and the host
    rounds D. Of several valid ones the radius nearest to the start point is taken. If none is valid, R is not whole or
    D comes from another formula: then (1) is used, limited to 3/2 steps from the start point, which is as far as
    rounding down a point of the circle can move it.
    """
    x, y, y_slip = xs + (rx - ry) // 2, ys + (rx + ry) // 2, ys + (rx - ry) // 2
    sense, twice, along_x = rx * ry, 2 * d, rx * abs(x) * (x + 1)
    start = math.hypot(xs, ys)
    radii = []
    printed = sense * (twice + along_x - ry * abs(y) * (y + 1))
    if (n := _whole_root(printed)) is not None and _rounds_to(n, xs, ys):
        if abs(n - start) < HANDICAP:
            return n * n  # no other one is nearer
        radii.append((abs(n - start), n))
    meant = sense * (twice + rx * x * (abs(x) + 1) - ry * y * (abs(y) + 1))
    slipped = sense * (twice + along_x - ry * abs(y_slip) * (y_slip + 1))
    for r2 in (meant, slipped):
        if (n := _whole_root(r2)) is not None and _rounds_to(n, xs, ys):
            radii.append((abs(n - start) + HANDICAP, n))
    if radii:
        return min(radii)[1] ** 2
    return min(max(meant, math.floor(max(start - 1.5, 0.0) ** 2)), math.ceil((start + 1.5) ** 2))


def _whole_root(square: int) -> int | None:
    """The whole number whose square this misses by 1 at most."""
    n = math.isqrt(max(square + 1, 0))
    return n if abs(n * n - square) <= 1 else None


def _rounds_to(radius: int, x: int, y: int) -> bool:
    """True if the circle passes through the square of the points that are rounded to (x, y)."""
    x, y = abs(x), abs(y)
    nearest = max(2 * x - 1, 0) ** 2 + max(2 * y - 1, 0) ** 2
    farthest = (2 * x + 1) ** 2 + (2 * y + 1) ** 2
    return nearest <= 4 * radius * radius <= farthest


@dataclass(frozen=True, slots=True)
class Circle:
    """An arc in the counter-clockwise frame: for a clockwise arc the axes are exchanged. Errors: `circle`."""

    arc_ticks: int
    xs: int
    ys: int
    squared_radius: int
    plane: tuple[int, int]
    third_axis: int | None
    third_steps: int
    axes: int

    def __post_init__(self) -> None:
        used = [*self.plane] if self.third_axis is None else [*self.plane, self.third_axis]
        if len(self.plane) != 2 or len(set(used)) != len(used) or not set(used) <= set(range(self.axes)):
            raise ValueError(f"a circle needs different axes out of 0..{self.axes - 1}, got {used}")
        numbers = self.arc_ticks, self.xs, self.ys, self.third_steps
        if self.arc_ticks < 0 or max(map(abs, numbers)) >= LARGEST or abs(self.squared_radius) >= LARGEST**2 << 2:
            told = ", ".join(map(str, numbers))
            raise ValueError(f"ticks, xs, ys and third steps of a circle must stay below {LARGEST}, got {told}")

    @property
    def ticks(self) -> int:
        """Ticks of the arc, or of a third axis that has more."""
        return max(self.arc_ticks, abs(self.third_steps))

    def deltas(self, first: int, last: int) -> NDArray[np.int8]:
        check_range(first, last, self.ticks)
        delta = np.zeros((last - first, self.axes), dtype=np.int8)
        begin, end = (even(k, self.arc_ticks, self.ticks) for k in (first, last))
        steps = delta if end - begin == last - first else np.zeros((end - begin, self.axes), dtype=np.int8)
        self._walk(begin, steps, *self.plane)
        if steps is not delta:
            makes_one = np.zeros((last - first, 1), dtype=np.int8)
            core.fill_even(makes_one, np.array([self.arc_ticks]), first, self.ticks)
            delta[makes_one[:, 0] == 1] = steps
        if self.third_axis is not None:
            core.fill_even(
                delta, np.eye(self.axes, dtype=np.int64)[self.third_axis] * self.third_steps, first, self.ticks
            )
        return delta

    def displacement(self, k: int) -> Displacement:
        check_range(0, k, self.ticks)
        steps = [0] * self.axes
        x, y = self._walk(even(k, self.arc_ticks, self.ticks), np.empty((0, 2), dtype=np.int8), 0, 1)
        steps[self.plane[0]] = x - self.xs
        steps[self.plane[1]] = y - self.ys
        if self.third_axis is not None:
            steps[self.third_axis] = even(k, self.third_steps, self.ticks)
        return tuple(steps)

    def _walk(self, k: int, delta: NDArray[np.int8], first: int, second: int) -> list[int]:
        """Write the steps of the arc after the first k into columns of delta; return x, y at the end. Goes on from the
        last checkpoint."""
        state = _checkpoints(self)[k // INTERVAL].copy()
        core.walk(state, k % INTERVAL, delta, first, second)
        return state[:2].tolist()


@lru_cache(maxsize=16)
def _checkpoints(path: Circle) -> NDArray[np.int64]:
    """int64 [n, 3]: x, y, c after 0, INTERVAL, 2 INTERVAL, ... steps of the arc."""
    states = np.empty((path.arc_ticks // INTERVAL + 1, 3), dtype=np.int64)
    state = np.array([path.xs, path.ys, path.xs**2 + path.ys**2 - path.squared_radius])
    for row in states:
        row[:] = state
        core.walk(state, INTERVAL, np.empty((0, 2), dtype=np.int8), 0, 1)
    return states
