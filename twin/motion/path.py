"""Which axes step at which tick: straight lines here, circles and helices in module `circle`.

A path is a formula: any stretch can be computed, in any order, and costs only its own length (on a circle plus at most
one checkpoint interval).

    line     axis i with n_i steps has made floor((2 k n_i + N) / (2 N)) of them after tick k, N = max |n_i|
    circle   every tick is one step of one of the two axes
    helix    a circle of B ticks; the third axis follows by the rule of the line with N = B, or leads if it has more
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from operator import add, sub
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.native import core

MOST_TICKS = 1 << 40
SMALL = 1 << 30  # ticks of a line whose formula keeps within 64 bits
Displacement = tuple[int, ...]  # whole numbers of steps or increments, one an axis


def added(a: Sequence[int], b: Sequence[int]) -> Displacement:
    return tuple(map(add, a, b))


def between(before: Sequence[int], now: Sequence[int]) -> Displacement:
    return tuple(map(sub, now, before))


class StepPath(Protocol):
    """The path of a `StepRun`. Immutable, equal to another path of the same ticks. Controllers may have their own."""

    @property
    def ticks(self) -> int: ...

    @property
    def axes(self) -> int: ...

    def deltas(self, first: int, last: int) -> NDArray[np.int8]:
        """int8 [last - first, axes], steps at ticks first + 1 .. last. IndexError if the path has fewer."""

    def displacement(self, k: int) -> Displacement:
        """Steps made by each axis after k ticks, 0 <= k <= ticks."""


def line(steps: Sequence[int]) -> StepLine:
    """A straight line of the given signed steps, one number an axis; as many ticks as the leading axis has steps.

    Raises ValueError unless there are one to eight numbers below 2^40.
    """
    ticks = max(map(abs, steps), default=0)
    if not 1 <= len(steps) <= len(AXIS_NAMES) or ticks >= MOST_TICKS:
        raise ValueError(f"a line needs 1 to {len(AXIS_NAMES)} step numbers below 2^40, got {tuple(steps)}")
    return StepLine(tuple(map(int, steps)), int(ticks))


@dataclass(frozen=True, slots=True)
class StepLine:
    """Steps of each axis spread evenly over at least as many ticks, below MOST_TICKS; else it raises ValueError."""

    steps: Displacement
    ticks: int

    def __post_init__(self) -> None:
        if not max(map(abs, self.steps), default=0) <= self.ticks < MOST_TICKS:
            raise ValueError(f"a line of the steps {self.steps} in {self.ticks} ticks")

    @property
    def axes(self) -> int:
        return len(self.steps)

    def deltas(self, first: int, last: int) -> NDArray[np.int8]:
        check_range(first, last, self.ticks)
        delta = np.zeros((last - first, self.axes), dtype=np.int8)
        core.fill_even(delta, np.array(self.steps, dtype=np.int64), first, self.ticks)
        return delta

    def displacement(self, k: int) -> Displacement:
        if k == self.ticks:
            return self.steps
        if k == 0:
            return (0,) * len(self.steps)
        check_range(0, k, self.ticks)
        return tuple([even(k, n, self.ticks) for n in self.steps])

    def displacements(self, ticks: NDArray[np.int64]) -> NDArray[np.int64]:
        """int64 [n, axes], `displacement` after each of these ticks [n]."""
        if self.ticks >= SMALL:
            return np.array([self.displacement(k) for k in ticks.tolist()], dtype=np.int64).reshape(-1, self.axes)
        steps = np.array(self.steps, dtype=np.int64)
        return np.sign(steps) * ((2 * ticks[:, None] * np.abs(steps) + self.ticks) // max(2 * self.ticks, 1))

    def tick_of(self, axis: int, place: int) -> int:
        """The first tick after which this axis has made so many of its steps, by the rule of `even`: step j falls at
        the first k with 2 k |n| + N >= 2 N j, at ceil((2 j - 1) N / (2 |n|))."""
        return -((1 - 2 * abs(place)) * self.ticks // (2 * abs(self.steps[axis])))


def check_range(first: int, last: int, ticks: int) -> None:
    """Raise IndexError unless ticks first + 1 .. last exist."""
    if not 0 <= first <= last <= ticks:
        raise IndexError(f"ticks {first}..{last} of a path of {ticks}")


def even(k: int, n: int, ticks: int) -> int:
    """Steps made after tick k by an axis whose n steps are spread evenly over `ticks` ticks."""
    if n < 0:  # the way back passes through the same kind of points (motion/5)
        return -even(k, -n, ticks)
    return (2 * k * n + ticks) // (2 * ticks) if n else 0
