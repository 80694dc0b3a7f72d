"""Set points: a plan with one tick a period; the command moves evenly from one to the next.

    tick k is at start_ns + (k - first) period; until the next tick the command moves to the sum of k ticks

               start      1       2       3       4            ticks
    command    ________________-------'''''''''''''''          deltas 0, 8, 6, 0: ramps, not steps

So the command reaches a set point one period late, as in a drive that interpolates between two telegrams, and needs no
knowledge of the future (motion/7).
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement, between


class SetPoints(Protocol):
    """The plan of a `SetPointRun`. Immutable.

    While it runs it may be replaced by one with the same set points up to the present and the same `identity`: so moves
    are joined, braked and replanned.
    """

    @property
    def ticks(self) -> int:
        """Number of set points."""

    @property
    def axes(self) -> int: ...

    @property
    def identity(self) -> object:
        """Equal for a plan and the plans that replace it."""

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        """int32 [last - first, axes], increments at ticks first + 1 .. last. IndexError if there are fewer."""

    def displacement(self, k: int) -> Displacement:
        """Sum of the changes of ticks 1 .. k, 0 <= k <= ticks."""

    def stopped(self, k: int) -> SetPoints:
        """The same up to tick k, then braking to standstill as fast as its ramps allow."""


@dataclass(frozen=True, slots=True)
class SetPointRun:
    """Ticks first + 1 .. last of a plan, one every period_ns, from start_ns on.

    Implements `isel_twin.motion.Motion`. `end`: number of the last tick if it was cut; None: the whole plan. Raises
    ValueError for a period that is not positive or ticks that the plan does not have.
    """

    plan: SetPoints
    period_ns: int
    start_ns: int
    first: int = 0
    end: int | None = None

    def __post_init__(self) -> None:
        if self.period_ns <= 0:
            raise ValueError(f"the period of set points must be positive, got {self.period_ns} ns")
        if not 0 <= self.first <= self.last <= self.plan.ticks:
            raise ValueError(f"set points {self.first}..{self.last} of a plan of {self.plan.ticks}")

    @property
    def axes(self) -> int:
        return self.plan.axes

    @property
    def last(self) -> int:
        return self.plan.ticks if self.end is None else self.end

    @property
    def end_ns(self) -> int:
        return self.start_ns + (self.last - self.first) * self.period_ns

    @property
    def lead_ns(self) -> int:
        return self.period_ns

    def count(self, t_ns: int) -> int:
        made = (t_ns - self.start_ns) // self.period_ns
        return self.first + min(max(made, 0), self.last - self.first)

    def window(self, k0: int, k1: int) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        if not self.first <= k0 <= k1 <= self.last:
            raise IndexError(f"set points {k0}..{k1} of a run from {self.first} to {self.last}")
        times = self.start_ns + np.arange(k0 + 1 - self.first, k1 + 1 - self.first, dtype=np.int64) * self.period_ns
        return times, self.plan.deltas(k0, k1)

    def displacement(self, t_ns: int) -> Displacement:
        return between(self.plan.displacement(self.first), self.plan.displacement(self.count(t_ns)))

    def next_tick(self, t_ns: int) -> int:
        """Number of the first tick at or after t_ns: from there on the plan can still change."""
        return self.first + max(0, -((self.start_ns - t_ns) // self.period_ns))

    def with_plan(self, plan: SetPoints) -> SetPointRun:
        return replace(self, plan=plan)

    def stopped(self, t_ns: int) -> SetPointRun:
        """The run of the plan's `stopped`; unchanged if all its ticks have been made."""
        made = self.count(t_ns)
        return self if made == self.last else replace(self, plan=self.plan.stopped(made), end=None)

    def cut(self, t_ns: int) -> SetPointRun:
        return replace(self, end=self.count(t_ns))

    def continues(self, other: Motion) -> bool:
        """The same plan, or one that replaces it, from the same place at the same time."""
        return (
            isinstance(other, SetPointRun)
            and (self.start_ns, self.first, self.period_ns) == (other.start_ns, other.first, other.period_ns)
            and self.plan.identity == other.plan.identity
        )
