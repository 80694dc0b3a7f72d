"""A motion whose ticks are stored, not described: of a recording, or of another control."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement


@dataclass(frozen=True, eq=False)
class Listed:
    """A motion as a list of ticks. Implements `isel_twin.motion.Motion`.

    t_ns: int64 [n], never decreasing; delta: int8 or int32 [n, axes].
    """

    t_ns: NDArray[np.int64]
    delta: NDArray[Any]
    start_ns: int
    lead_ns: int = 0
    first: int = 0

    @property
    def axes(self) -> int:
        return int(self.delta.shape[1])

    @cached_property
    def end_ns(self) -> int:
        return int(self.t_ns[-1]) if len(self.t_ns) else self.start_ns

    @cached_property
    def last(self) -> int:
        return self.first + len(self.t_ns)

    def count(self, t_ns: int) -> int:
        return self.first + int(self.t_ns.searchsorted(t_ns, side="right"))

    def window(self, k0: int, k1: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
        if not self.first <= k0 <= k1 <= self.last:
            raise IndexError(f"ticks {k0}..{k1} of a motion from {self.first} to {self.last}")
        part = slice(k0 - self.first, k1 - self.first)
        return self.t_ns[part].copy(), self.delta[part].copy()

    def displacement(self, t_ns: int) -> Displacement:
        made = self.count(t_ns) - self.first
        return tuple(int(n) for n in self.delta[:made].sum(axis=0, dtype=np.int64))

    def stopped(self, t_ns: int) -> Listed:
        """Its ticks are all there is: it ends at once, without a ramp."""
        return self.cut(t_ns)

    def cut(self, t_ns: int) -> Listed:
        made = self.count(t_ns) - self.first
        if made == len(self.t_ns):
            return self
        return replace(self, t_ns=self.t_ns[:made], delta=self.delta[:made])

    def continues(self, other: Motion) -> bool:
        return self.start_ns == other.start_ns and self.first == other.first
