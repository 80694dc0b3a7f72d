"""Position switches that ideal carriages strike, and the ticks that move them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES


@dataclass(frozen=True)
class PositionSwitch:
    """An opener: open at and beyond `trip` (steps, motor sense) on the side `side` (-1, +1).

    It closes again once the carriage is more than `hysteresis` steps back from the trip point.
    """

    contact: str
    axis: int
    trip: int
    side: int
    hysteresis: int = 8


@dataclass(frozen=True)
class Ticks:
    """Ticks: t_ns int64 [n], delta int8 or int32 [n, axes] in the sense of the counters."""

    t_ns: NDArray[np.int64]
    delta: NDArray[Any]

    def __len__(self) -> int:
        return len(self.t_ns)

    @property
    def total(self) -> tuple[int, ...]:
        """Sum of the steps of each axis."""
        return tuple(int(n) for n in self.delta.sum(axis=0, dtype=np.int64))

    def path(self) -> NDArray[np.int64]:
        """int64 [n, axes], position of each axis after each tick, counted from 0."""
        return np.cumsum(self.delta, axis=0, dtype=np.int64)


def switches(travel: Iterable[int] = (126_400, 96_000, 44_800, 100_000), hysteresis: int = 8) -> list[PositionSwitch]:
    """Both switches of every axis: motor end at 0, far end at `travel` steps (default: the 4030 at 320 steps/mm)."""
    return [
        PositionSwitch(f"limit_{AXIS_NAMES[axis]}{end}", axis, trip, side, hysteresis)
        for axis, far in enumerate(travel)
        for end, trip, side in ((1, 0, -1), (2, far, +1))
    ]
