"""Steps: a path, timed by a time law, started at a time."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement, StepPath, between
from isel_twin.motion.time_law import TimeLaw


@dataclass(frozen=True, slots=True)
class StepRun:
    """Ticks first + 1 .. last of a path; tick first + i falls at start_ns + tick i of the time law.

        path      tick   1  2  3 | 4  5  6  7  8 | 9  10       first = 3: a motion that was stopped after 3 ticks
        law       tick             1  2  3  4  5               and is resumed with 5 more: last = 8

    Implements `isel_twin.motion.Motion`. Raises ValueError if the path has fewer ticks than the law.
    """

    path: StepPath
    law: TimeLaw
    start_ns: int
    first: int = 0

    def __post_init__(self) -> None:
        if self.first < 0 or self.last > self.path.ticks:
            raise ValueError(f"ticks {self.first}..{self.last} timed on a path of {self.path.ticks}")

    @property
    def axes(self) -> int:
        return self.path.axes

    @property
    def last(self) -> int:
        return self.first + self.law.ticks

    @property
    def end_ns(self) -> int:
        return self.start_ns + self.law.duration_ns

    @property
    def lead_ns(self) -> int:
        return 0  # a stage takes a step at once

    def count(self, t_ns: int) -> int:
        return self.first + self.law.count(t_ns - self.start_ns)

    def window(self, k0: int, k1: int) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
        times = self.law.times(k0 - self.first, k1 - self.first)
        times += self.start_ns
        return times, self.path.deltas(k0, k1)

    def displacement(self, t_ns: int) -> Displacement:
        return self.displacement_after(self.count(t_ns))

    def displacement_after(self, tick: int) -> Displacement:
        """Steps of each axis when this tick of the path has been made, the first of it not before `first`."""
        made = self.path.displacement(tick)
        return between(self.path.displacement(self.first), made) if self.first else made

    def stopped(self, t_ns: int) -> StepRun:
        """The stop ramp is that of `TimeLaw.stopped`."""
        return replace(self, law=self.law.stopped(t_ns - self.start_ns))

    def cut(self, t_ns: int) -> StepRun:
        law = self.law.cut(t_ns - self.start_ns)
        return self if law is self.law else replace(self, law=law)

    def continues(self, other: Motion) -> bool:
        """The same path from the same place at the same time."""
        return (
            isinstance(other, StepRun)
            and (self.start_ns, self.first) == (other.start_ns, other.first)
            and self.path == other.path
        )
