"""The plots of the page: of each time from one frame to the next the least and the largest of every curve.

    samples, each SAMPLE_NS:  . . . :. . . . | . . '. . . |           a frame sees the ends, samples what lies between
    points                    |--------------|------------|

A point says from when on it tells; where that is not the end of the one before, nobody has looked.
"""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.core.position import position_error_mm
from isel_twin.core.sampling import Sampler, TwinSamples
from isel_twin.core.twin import Twin

SAMPLE_NS = 10 * MILLISECOND_NS  # as that of recordings, so that both have one grid
RATE_SAMPLES = 5  # over which a frequency is a mean
MARGIN_NS = 5 * MILLISECOND_NS  # virtual time of a least margin: several windows of the plant

Point = list[Any]


class Plots:
    """Watches a twin while somebody looks at its page."""

    def __init__(self, twin: Twin) -> None:
        self._twin, self._margins = twin, twin.margin_reader()
        self._watches = False
        self._sampler: Sampler | None = None  # of the plant, unless that uses another grid
        self._low = self._high = self._ends()
        self._from_ns = self._margin_ns = twin.time_ns
        self._margin: list[float | None] = []

    def watch(self, watched: bool) -> None:
        """Begin or end to look."""
        if watched == self._watches:
            return
        self._watches = watched
        if not watched:
            if self._sampler is not None:
                self._twin.sample_no_more(self._take)
            return
        self._sampler = self._twin.sample(self._take, SAMPLE_NS)
        self._margins.take()
        self._begin()

    def point(self) -> Point:
        """From and to in s; frequency in Hz and position error in mm, each the least and the largest of each axis; the
        least margin of each axis."""
        twin = self._twin
        if self._sampler is not None:
            self._sampler.hand_on()
        self._reach(self._ends()[None], self._ends()[None])
        if twin.time_ns >= self._margin_ns + MARGIN_NS:
            self._margin_ns = twin.time_ns
            self._margin = [None if math.isnan(margin) else margin for margin in self._margins.take().tolist()]
        axes = len(twin.counts)
        curves = [part.tolist() for part in (self._low[:axes], self._high[:axes], self._low[axes:], self._high[axes:])]
        made = [self._from_ns / SECOND_NS, twin.time_ns / SECOND_NS, *curves, self._margin]
        self._begin()
        return made

    def _begin(self) -> None:
        self._from_ns, self._low = self._twin.time_ns, self._ends()
        self._high = self._low

    def _ends(self) -> NDArray[np.float64]:
        """float64 [axes + 3], frequencies and position errors of now."""
        return np.concatenate([self._twin.step_hz, self._twin.position_error_mm])

    def _reach(self, low: NDArray[np.float64], high: NDArray[np.float64]) -> None:
        """Take in values [n, axes + 3]."""
        self._low = np.minimum(self._low, low.min(axis=0, initial=math.inf))
        self._high = np.maximum(self._high, high.max(axis=0, initial=-math.inf))

    def _take(self, samples: TwinSamples) -> None:
        """Samples between which no counter was set. A count tells the steps of a stretch but for one."""
        error_mm = position_error_mm(samples.position_mm, samples.counts, self._twin.step_mm)
        made = samples.counts[RATE_SAMPLES:] - samples.counts[:-RATE_SAMPLES]
        took_s = (samples.time_ns[RATE_SAMPLES:] - samples.time_ns[:-RATE_SAMPLES])[:, None] / SECOND_NS
        still = np.zeros((len(error_mm), made.shape[1]))
        low, high = still + math.inf, still - math.inf
        low[RATE_SAMPLES:], high[RATE_SAMPLES:] = (made + 1) / took_s, (made - 1) / took_s
        self._reach(np.concatenate([low, error_mm], axis=1), np.concatenate([high, error_mm], axis=1))
