"""A path, timed by a profile, started at a time: what a controller is executing."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import Displacement, Path
from isel_twin.motion.profile import Profile

__all__ = ["Run"]


@dataclass(frozen=True, slots=True)
class Run:
    """Ticks first + 1 .. last of a path; tick first + i falls at start_ns + tick i of the profile.

        path      tick   1  2  3 | 4  5  6  7  8 | 9  10       first = 3: a motion that was stopped after 3 ticks
        profile   tick             1  2  3  4  5               and is resumed with 5 more: last = 8

    Raises ValueError if the path has not as many ticks as the profile times.
    """

    path: Path
    profile: Profile
    start_ns: int
    first: int = 0

    def __post_init__(self) -> None:
        if self.first < 0 or self.last > self.path.ticks:
            raise ValueError(f"ticks {self.first}..{self.last} timed on a path of {self.path.ticks}")

    @property
    def last(self) -> int:
        """Number of the last path tick made when the run has ended."""
        return self.first + self.profile.ticks

    @property
    def end_ns(self) -> int:
        """Time of the last tick; start_ns if there is none."""
        return self.start_ns + self.profile.duration_ns

    def count(self, t_ns: int) -> int:
        """Path ticks made at t_ns, those of earlier runs of the path included: first .. last."""
        return self.first + self.profile.count(t_ns - self.start_ns)

    def window(self, k0: int, k1: int) -> tuple[NDArray[np.int64], NDArray[np.uint8]]:
        """Times in ns int64 [k1 - k0] and packed steps uint8 [k1 - k0] of path ticks k0 + 1 .. k1.

        first <= k0 <= k1 <= last, IndexError otherwise.
        """
        times = self.profile.times(k0 - self.first, k1 - self.first)
        times += self.start_ns
        return times, self.path.codes(k0, k1)

    def displacement(self, t_ns: int) -> Displacement:
        """Steps of X, Y, Z, A made by this run up to t_ns."""
        x0, y0, z0, a0 = self.path.displacement(self.first)
        x1, y1, z1, a1 = self.path.displacement(self.count(t_ns))
        return x1 - x0, y1 - y0, z1 - z0, a1 - a0

    def stopped(self, t_ns: int) -> Run:
        """The same up to t_ns, then the stop ramp; see `Profile.stopped`."""
        return replace(self, profile=self.profile.stopped(t_ns - self.start_ns))

    def cut(self, t_ns: int) -> Run:
        """The same, ended at t_ns: only the ticks at or before it."""
        return replace(self, profile=self.profile.cut(t_ns - self.start_ns))
