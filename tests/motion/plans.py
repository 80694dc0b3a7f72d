"""A plan of set points for tests, exact and obvious: so many increments every period, and a stop that brakes by one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


@dataclass(frozen=True)
class Table:
    """Implements isel_twin.motion.SetPoints: row k - 1 is tick k."""

    rows: tuple[tuple[int, ...], ...]
    identity: object = "table"

    @property
    def ticks(self) -> int:
        return len(self.rows)

    @property
    def axes(self) -> int:
        return len(self.rows[0])

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"ticks {first}..{last} of {self.ticks}")
        return np.array(self.rows[first:last], dtype=np.int32).reshape(last - first, self.axes)

    def displacement(self, k: int) -> tuple[int, ...]:
        return tuple(sum(row[axis] for row in self.rows[:k]) for axis in range(self.axes))

    def stopped(self, k: int) -> Table:
        """One increment a period less, on every axis, until all stand."""
        rows, last = list(self.rows[:k]), self.rows[k - 1] if k else (0,) * self.axes
        while any(last):
            last = tuple(n - (n > 0) + (n < 0) for n in last)
            rows.append(last)
        return Table(tuple(rows), self.identity)


def table(*rows: Sequence[int], identity: object = "table") -> Table:
    return Table(tuple(tuple(row) for row in rows), identity)
