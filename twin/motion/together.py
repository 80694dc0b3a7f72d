"""Several plans of set points on one grid, added: motions that begin and end independently of each other.

first    |--------------|            ticks 3 .. of it: the ones before were made earlier
second           |-----------|       begins 4 ticks later
together |-------------------|       increments of a tick: the sum
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import Displacement, added, between
from isel_twin.motion.set_points import SetPoints


@dataclass(frozen=True, eq=False)
class Part:
    """A plan whose tick k is tick k + offset of the sum; ticks up to 0 of the sum were made before. until: last tick of
    the plan that counts; None: all of it."""

    plan: SetPoints
    offset: int
    until: int | None = None

    @property
    def skip(self) -> int:
        return max(0, -self.offset)

    @property
    def end(self) -> int:
        return self.plan.ticks if self.until is None else self.until

    def tick(self, k: int) -> int:
        """Tick of the plan at tick k of the sum."""
        return min(max(k - self.offset, self.skip), max(self.end, self.skip))


@dataclass(frozen=True, eq=False)
class Together:
    """Implements `isel_twin.motion.SetPoints`: the sum of parts, of which there is at least one."""

    parts: tuple[Part, ...]
    identity: object

    @property
    def axes(self) -> int:
        return self.parts[0].plan.axes

    @property
    def ticks(self) -> int:
        return max(max(part.offset + part.end, 0) for part in self.parts)

    def displacement(self, k: int) -> Displacement:
        total: Displacement = (0,) * self.axes
        for part in self.parts:
            made = between(part.plan.displacement(part.skip), part.plan.displacement(part.tick(k)))
            total = added(total, made)
        return total

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"set points {first}..{last} of {self.ticks}")
        total = np.zeros((last - first, self.axes), np.int32)
        for part in self.parts:
            low, high = part.tick(first), part.tick(last)
            if low < high:
                at = low + part.offset - first
                total[at : at + high - low] += part.plan.deltas(low, high)
        return total

    def stopped(self, k: int) -> Together:
        return replace(self, parts=tuple(replace(p, plan=p.plan.stopped(p.tick(k)), until=None) for p in self.parts))
