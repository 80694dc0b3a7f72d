"""Hands and eyes at a twin: pulls, lets go, reads a gauge, as a person does at the machine."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.core.twin import Twin
from isel_twin.many.identification.measured import Reading, Ring
from isel_twin.many.identification.ring_down import ring_down

SETTLE_S = 0.3  # from the reply or the change of a pull until a gauge is read
PULL_S, PULL_PARTS = 0.3, 20  # so slowly a pull comes and goes, and in so many parts
RING_S, RING_STEP_S = 0.4, 0.0005  # so long and so often a model that rings down is looked at


class Pulls:
    """A hand at a spring scale. A force that came at once would have the frame swing until after the gauge is read, the
    longer the heavier it is; so it comes and goes in PULL_S (many/25)."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self._now: dict[int, tuple[float, str]] = {}  # by axis: N, and where

    def pull(self, how: Reading | Ring) -> None:
        """Pull along its axis as it says, in place of what was pulled along it before."""
        axis = CARRIAGES.index(how.axis)
        if self._now.get(axis, (0.0, how.push_at))[1] != how.push_at:
            self._change(axis, 0.0, self._now[axis][1])
        self._change(axis, how.push_n, how.push_at)

    def end(self) -> None:
        """Let all of it go, and await rest."""
        for axis, (_, at) in list(self._now.items()):
            self._change(axis, 0.0, at)
            self._twin.run(SETTLE_S)
        self._now.clear()

    def _change(self, axis: int, force_n: float, at: str) -> None:
        before_n = self._now.get(axis, (0.0, at))[0]
        if force_n == before_n:
            return
        for part in range(1, PULL_PARTS + 1):
            self._twin.apply_force(axis, before_n + (force_n - before_n) * part / PULL_PARTS, at)
            self._twin.run(PULL_S / PULL_PARTS)
        self._now[axis] = force_n, at


def shown_mm(twin: Twin, reading: Reading) -> float:
    """What a gauge without zero and noise shows now: a position, or how far the tool is from a point."""
    if reading.about_mm is not None:
        return math.dist(twin.position_mm.tolist(), reading.about_mm)
    return float(twin.position_mm[CARRIAGES.index(reading.axis)])


def let_go(twin: Twin, ring: Ring) -> tuple[float, float]:
    """Frequency in Hz and damping ratio after a force is let go; nan if nothing rings."""
    axis = CARRIAGES.index(ring.axis)
    Pulls(twin).pull(ring)
    twin.run(SETTLE_S)
    twin.apply_force(axis, 0.0, ring.push_at)
    count = round(RING_S / RING_STEP_S)
    position_mm = np.empty(count)
    times_s: NDArray[np.float64] = RING_STEP_S * np.arange(count, dtype=np.float64)
    for at in range(count):
        position_mm[at] = twin.position_mm[axis]
        twin.run(RING_STEP_S)
    try:
        return ring_down(times_s, position_mm)
    except ValueError:
        return math.nan, math.nan
