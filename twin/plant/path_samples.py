"""Samples of a plant without physics: taken of each stretch of the path when it has been made, in one call of C.

ticks    | || |  | | ||     |        before           the state before the stretch
samples     x        x        x      time_ns <= t     all ticks up to a time of the grid have been made at it

Of a straight way they are what its formula says.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.native import core
from isel_twin.plant import MOST_SAMPLES, Along, Samples

_NEVER_NS = 1 << 62


class PathSamples:
    """Implements `isel_twin.plant.Sampled` for a plant that is always at its command; it has no grid of its own, so
    that any interval fits and counts are of the exact nanosecond, too."""

    time_ns: int
    _count: int  # axes of the controller
    _start_mm: NDArray[np.float64]
    _step_mm: NDArray[np.float64]
    _commanded: NDArray[np.int64]
    _leads: NDArray[np.void]

    def __init__(self) -> None:
        self._every_ns = 0
        self._sample_ns = _NEVER_NS  # when the next one is taken
        self._taken: list[tuple[NDArray[Any], ...]] = []  # (times, counts, what is behind, speeds)
        self._waiting = 0
        self._latest: NDArray[np.float64] | None = None  # counts, behind and speeds of the last sample

    def fits(self, interval_ns: int) -> bool:
        return interval_ns > 0

    def sample_every(self, interval_ns: int, from_ns: int = 0) -> None:
        if interval_ns < 0:
            raise ValueError(f"samples every {interval_ns} ns; allowed: 1 and more, or 0 for none")
        self._every_ns, self._sample_ns = interval_ns, from_ns
        self._aim()

    def sample_again(self) -> None:
        self._latest = None

    @property
    def samples_waiting(self) -> int:
        return self._waiting

    def take_samples(self) -> Samples:
        width = len(self._leads)
        nothing = np.empty(0, np.int64), np.empty((0, width), np.int64), np.empty((0, width)), np.empty((0, width))
        taken = self._taken or [nothing]
        time_ns, counts, left, speeds = taken[0] if len(taken) == 1 else map(np.concatenate, zip(*taken, strict=True))
        self._taken, self._waiting = [], 0
        commands, rows, carriages = counts - left, len(time_ns), len(CARRIAGES)
        return Samples(
            time_ns=time_ns,
            position_mm=self._start_mm + commands[:, :carriages] * self._step_mm,
            velocity_mm_s=speeds[:, :carriages] * self._step_mm,
            commanded=counts[:, : self._count],
            rotor=commands[:, : self._count],
            current_fraction=np.empty((rows, 0)),
            margin=np.full((rows, self._count), np.nan),
            force_n=np.full((rows, carriages), np.nan),
            supply_v=np.full(rows, np.nan),
        )

    def _aim(self) -> None:
        """Drop unread samples; the next one is the first of the grid after now."""
        self._taken, self._waiting, self._latest = [], 0, None
        if self._every_ns:
            self._sample_ns = self.time_ns + 1 + (self._sample_ns - self.time_ns - 1) % self._every_ns
        else:
            self._sample_ns = _NEVER_NS

    def _before(self) -> tuple[NDArray[np.int64], NDArray[np.void]]:
        """What `_sample` is to be given of the state before a stretch."""
        return self._commanded.copy(), self._leads.copy()

    def _sample(
        self,
        before: tuple[NDArray[np.int64], NDArray[np.void]],
        t_ns: NDArray[np.int64],
        delta: NDArray[Any],
        lead_ns: int,
    ) -> None:
        """Take the samples of a stretch that has been made to the present; ticks after that are not looked at."""
        if self._sample_ns > self.time_ns:
            return
        every_ns, first_ns = self._every_ns, self._sample_ns
        moves_until_ns = int(before[1]["end_ns"].max())
        if len(t_ns):
            moves_until_ns = max(moves_until_ns, int(t_ns[-1]) + lead_ns)
        rest_ns = first_ns + max(-((first_ns - moves_until_ns) // every_ns), 0) * every_ns  # first of the grid at rest
        times_ns = self._times_ns(self.time_ns, rest_ns)
        wide = np.ascontiguousarray(delta, dtype=np.int32)  # one function for all kinds of ticks
        shape = len(times_ns), len(self._leads)
        found = np.empty(shape, np.int64), np.empty(shape), np.empty(shape)
        core.commands_at(times_ns, lead_ns, np.ascontiguousarray(t_ns, dtype=np.int64), wide, *before, *found)
        self._take(times_ns, *found)

    def _sample_straight(self, until_ns: int, along: Along | None = None) -> None:
        """Take the samples of a straight way, without leads, from the present to until_ns before it is made; None: it
        stays where it is."""
        times_ns = self._times_ns(until_ns, self._sample_ns if along is None else until_ns)
        counts = np.tile(self._commanded, (len(times_ns), 1))
        if along is not None:
            way = along(times_ns)
            counts[:, : way.shape[1]] += way
        nothing = np.zeros(counts.shape)
        self._take(times_ns, counts, nothing, nothing)

    def _times_ns(self, until_ns: int, rest_ns: int) -> NDArray[np.int64]:
        """The times of the grid up to until_ns, but not beyond the first one at which nothing moves."""
        first_ns, every_ns = self._sample_ns, self._every_ns
        self._sample_ns += ((until_ns - first_ns) // every_ns + 1) * every_ns
        return np.arange(first_ns, min(until_ns, rest_ns) + 1, every_ns, dtype=np.int64)

    def _take(self, times_ns: NDArray[np.int64], *found: NDArray[Any]) -> None:
        """Keep what is found at these times, as far as it is news: counts, what is behind them, speeds [n, axes]."""
        rows = np.concatenate(found, axis=1)
        before = rows[0] + 1.0 if self._latest is None else self._latest  # the first one is news
        changed = (rows != np.concatenate((before[None], rows[:-1]))).any(axis=1)
        self._latest = rows[-1]
        news = changed.nonzero()[0][: MOST_SAMPLES - self._waiting]
        if len(news):
            self._taken.append((times_ns[news], *(part[news] for part in found)))
            self._waiting += len(news)
