"""Any number of samples reduced to a screen: minimum and maximum in each column of pixels.

    samples  . .. . .: .  . .: .  ..  :.      millions, read piece by piece
    columns  |--|--|--|--|--|--|--|--|--|     at most COLUMNS, and one more for each time a counter was set
             low, high of each curve          nan: no sample there

Curves: true position, position error and speed of the carriages and lost steps of the axes. Setting a counter moves the
zero, not the machine: curves are interrupted there, no speed is computed across it, and the path, drawn in the last
zero, is continuous.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.thinning import extremes
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.core.position import position_error_mm

if TYPE_CHECKING:
    from isel_twin.recordings.recorder import Recorder

COLUMNS = 3000  # columns of a curve: for a screen of 1500 pixels at double zoom
MOST_WAY = 16_000  # most vertices of a path
SHORTEST_NS = 2 * MILLISECOND_NS  # least time between samples for a speed: in less, one step more or less dominates
PIXELS = 1500  # resolution of the longest extent of a path: vertices within one pixel are merged
Pair = tuple[NDArray[np.float64], NDArray[np.float64]]  # minima and maxima


@dataclass(frozen=True, eq=False)
class Columns:
    """Curves of a run: n columns, low and high [n] or [n, ...] of each."""

    first_ns: int
    last_ns: int
    time_ns: NDArray[np.int64]
    piece: NDArray[np.int64]  # columns of one piece are joined by a line
    position_mm: Pair
    error_mm: Pair
    speed_mm_s: Pair
    lost_steps: Pair
    way: Way


@dataclass(frozen=True, eq=False)
class Way:
    """The path: vertices [m, 3] in mm in the last zero, the largest deviation [m] until the next one, times [m]."""

    position_mm: NDArray[np.float64]
    deviation_mm: NDArray[np.float64]
    time_ns: NDArray[np.int64]

    def at(self, time_ns: int) -> NDArray[np.float64]:
        """float64 [3], position at this time."""
        vertex = min(int(self.time_ns.searchsorted(time_ns)), len(self.time_ns) - 1)
        found: NDArray[np.float64] = self.position_mm[vertex]
        return found


def columns(recorder: Recorder, step_mm: NDArray[np.float64], last_ns: int) -> Columns:
    """Curves of a recorder's samples; last_ns: the present."""
    breaks = np.array(recorder.counters_set_ns[:COLUMNS], dtype=np.int64)
    first_ns, least, most = _extent(recorder, breaks)
    last_ns = max(last_ns, first_ns + 1)
    pixel_mm = max(float(np.max(most - least, initial=0.0)), 1.0) / PIXELS
    number = COLUMNS + len(breaks)
    axes = recorder.axes
    low, high = (np.full((number, 7 + axes), np.nan) for _ in range(2))
    time_ns = np.full(number, -1, dtype=np.int64)
    way = _WayMaker(pixel_mm)
    before: tuple[int, NDArray[np.float64], int] | None = None  # time, position and piece of the last speed
    shift = _shifts(recorder, breaks)
    for samples in recorder.samples():
        t_ns = samples["time_ns"]
        piece = np.searchsorted(breaks, t_ns, side="right")
        key = (t_ns - first_ns) * (COLUMNS - 1) // (last_ns - first_ns) + piece
        error_mm = position_error_mm(samples["position_mm"], samples["counts"], step_mm)
        speed, before = _speed(t_ns, samples["position_mm"], piece, before)
        values = np.concatenate([samples["position_mm"], error_mm, speed[:, None], samples["lost_steps"]], axis=1)
        starts = np.flatnonzero(np.diff(key, prepend=-1))
        keys = key[starts]
        with np.errstate(invalid="ignore"):
            low[keys] = np.fmin(low[keys], np.fmin.reduceat(values, starts))
            high[keys] = np.fmax(high[keys], np.fmax.reduceat(values, starts))
        time_ns[keys] = np.where(time_ns[keys] < 0, t_ns[starts], time_ns[keys])
        way.add(t_ns, samples["position_mm"] + shift[piece], np.abs(error_mm).max(axis=1))
    there = time_ns >= 0
    low, high, time_ns = low[there], high[there], time_ns[there]

    def pair(part: slice | int) -> Pair:
        return low[:, part], high[:, part]

    return Columns(
        first_ns=first_ns,
        last_ns=last_ns,
        time_ns=time_ns,
        piece=np.searchsorted(breaks, time_ns, side="right"),
        position_mm=pair(slice(0, 3)),
        error_mm=pair(slice(3, 6)),
        speed_mm_s=pair(6),
        lost_steps=pair(slice(7, 7 + axes)),
        way=way.made(),
    )


def _extent(recorder: Recorder, breaks: NDArray[np.int64]) -> tuple[int, NDArray[np.float64], NDArray[np.float64]]:
    """First time, and the corners [3] of the box that holds the path."""
    shift = _shifts(recorder, breaks)
    least, most = np.full(3, np.inf), np.full(3, -np.inf)
    first_ns: int | None = None
    for samples in recorder.samples():
        first_ns = int(samples["time_ns"][0]) if first_ns is None else first_ns
        position_mm = samples["position_mm"] + shift[np.searchsorted(breaks, samples["time_ns"], side="right")]
        least, most = np.minimum(least, position_mm.min(axis=0)), np.maximum(most, position_mm.max(axis=0))
    return first_ns or 0, least, most


def _shifts(recorder: Recorder, breaks: NDArray[np.int64]) -> NDArray[np.float64]:
    """float64 [pieces, 3]: offset of each piece to the last zero, from the jump of the position when the zero moved;
    the machine is at rest then, or nearly.
    """
    jumps = np.zeros((len(breaks) + 1, 3))
    before: tuple[int, NDArray[np.float64]] | None = None
    for samples in recorder.samples() if len(breaks) else ():
        piece = np.searchsorted(breaks, samples["time_ns"], side="right")
        position_mm = samples["position_mm"]
        if before is not None:
            piece = np.concatenate([[before[0]], piece])
            position_mm = np.concatenate([before[1][None], position_mm])
        for k in np.flatnonzero(np.diff(piece)):
            jumps[piece[k]] += position_mm[k + 1] - position_mm[k]
        before = int(piece[-1]), position_mm[-1]
    shift: NDArray[np.float64] = jumps[::-1].cumsum(axis=0)[::-1]
    return shift


def _speed(
    t_ns: NDArray[np.int64],
    position_mm: NDArray[np.float64],
    piece: NDArray[np.int64],
    before: tuple[int, NDArray[np.float64], int] | None,
) -> tuple[NDArray[np.float64], tuple[int, NDArray[np.float64], int]]:
    """Speed [n] in mm/s since the sample before; nan without one, or if a counter was set in between."""
    if before is None:
        before = int(t_ns[0]), position_mm[0], int(piece[0])
    took_ns = np.diff(t_ns, prepend=before[0])
    way_mm = np.linalg.norm(np.diff(position_mm, axis=0, prepend=before[1][None]), axis=1)
    good = (took_ns >= SHORTEST_NS) & (np.diff(piece, prepend=before[2]) == 0)
    speed = np.where(good, way_mm / np.maximum(took_ns, 1) * SECOND_NS, np.nan)
    return speed, (int(t_ns[-1]), position_mm[-1], int(piece[-1]))


class _WayMaker:
    """Collects vertices, merges those within a pixel, and keeps the extremes when there are too many."""

    def __init__(self, pixel_mm: float) -> None:
        self._pixel_mm = pixel_mm
        self._last: NDArray[np.int64] | None = None
        self._parts: list[tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.int64]]] = []

    def add(self, t_ns: NDArray[np.int64], position_mm: NDArray[np.float64], deviation_mm: NDArray[np.float64]) -> None:
        pixels = np.round(position_mm / self._pixel_mm).astype(np.int64)
        before = pixels[:1] - 1 if self._last is None else self._last[None]
        self._last = pixels[-1]
        new = (np.diff(pixels, axis=0, prepend=before) != 0).any(axis=1)
        new[0] = True
        starts = np.flatnonzero(new)
        worst = np.maximum.reduceat(deviation_mm, starts)
        self._parts.append((position_mm[starts], worst, t_ns[starts]))
        if sum(len(part[2]) for part in self._parts) > 2 * MOST_WAY:
            self._thin()

    def _thin(self) -> None:
        position_mm, worst, t_ns = (np.concatenate(each) for each in zip(*self._parts, strict=True))
        if len(t_ns) > MOST_WAY:
            starts = extremes(position_mm, MOST_WAY)
            position_mm, worst, t_ns = position_mm[starts], np.maximum.reduceat(worst, starts), t_ns[starts]
        self._parts = [(position_mm, worst, t_ns)]

    def made(self) -> Way:
        self._thin()
        return Way(*self._parts[0])
