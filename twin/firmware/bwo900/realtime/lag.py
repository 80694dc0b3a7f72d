"""Supervision of the following error (manual 8.7, P12024, P12025): an axis that does not follow ends all, M2001.

    expected lag                  x   set position, s   its lag behind a position loop with gain KV (P12020)
                                  s(t + T) = s(t) exp(-KV T) + (x(t + T) - x(t)) (1 - exp(-KV T)) / (KV T)
                                  at constant speed v: s = v / KV, "feed / (60 KV)"
    allowed                       (1 + P12024 / 100) |s| + coarse window (P12017), exceeded for at most P12025

P12024 is 50 % and P12025 50 ms unless set; P12025 = -1: off.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.firmware.bwo900.numbers import Axis
from isel_twin.firmware.bwo900.parameters import MACHINE_AXES, Parameters
from isel_twin.firmware.bwo900.realtime.path import KV_1_S, positive

LOOK_NS: Final = 25 * MILLISECOND_NS
MORE_PERCENT: Final = 50.0
LONGEST_MS: Final = 50.0
COARSE: Final = 8.0  # P12017 over P12016 if unset
OFF: Final = -1.0


def window_mm(parameters: Parameters, axis: int, per_mm: float) -> float:
    """The fine exact-stop window of an axis: P12016, or the square root of one increment in mm."""
    return positive(parameters.axis(axis, Axis.WINDOW_FINE, 0.0), math.sqrt(1.0 / per_mm))


class LagWatch:
    """Checks all axes every `LOOK_NS` while something moves. Positions and lags are increments."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.due_ns: int | None = None  # next check; None: nothing moves
        self._last_ns = 0
        self._counts: tuple[int, ...] = (0,) * MACHINE_AXES
        self._ought = [0.0] * MACHINE_AXES
        self._since_ns: list[int | None] = [None] * MACHINE_AXES  # since when the lag of an axis exceeds the limit
        self._known: tuple[int, list[tuple[float, float, float, float]]] | None = None
        """Settings, and the revision of the parameters they were made from."""

    def _settings(self, per_mm: Sequence[float]) -> Sequence[tuple[float, float, float, float]]:
        """Of each axis: KV in 1/s, P12024 in %, P12025 in ms, coarse window in mm."""
        p = self._parameters
        if self._known is None or self._known[0] != p.revision:
            settings = [
                (
                    positive(p.axis(axis, Axis.KV, 0.0), KV_1_S),
                    positive(p.axis(axis, Axis.LAG_PERCENT, 0.0), MORE_PERCENT),
                    p.axis(axis, Axis.LAG_MS, 0.0),
                    positive(p.axis(axis, Axis.WINDOW_COARSE, 0.0), COARSE * window_mm(p, axis, per_mm[axis])),
                )
                for axis in range(MACHINE_AXES)
            ]
            self._known = p.revision, settings
        return self._known[1]

    def begin(self, now_ns: int, counts: Sequence[int]) -> None:
        """Begin the checks, with all axes at rest."""
        self.due_ns, self._last_ns, self._counts = now_ns + LOOK_NS, now_ns, tuple(counts)
        self._ought, self._since_ns = [0.0] * MACHINE_AXES, [None] * MACHINE_AXES

    def end(self) -> None:
        self.due_ns = None

    def is_due(self, now_ns: int) -> bool:
        return self.due_ns is not None and now_ns >= self.due_ns

    def look(self, now_ns: int, counts: Sequence[int], lag: Sequence[float], per_mm: Sequence[float]) -> int | None:
        """Check; return an axis that has lagged for too long."""
        self.due_ns = now_ns + LOOK_NS
        passed_s, self._last_ns = (now_ns - self._last_ns) / SECOND_NS, now_ns
        before, self._counts = self._counts, tuple(counts)
        late = None
        for axis, (kv, more, longest_ms, coarse_mm) in enumerate(self._settings(per_mm)):
            gain = kv * passed_s
            left = math.exp(-gain)
            self._ought[axis] = self._ought[axis] * left + (counts[axis] - before[axis]) * (1.0 - left) / gain
            if longest_ms == OFF or abs(lag[axis]) <= self._allowed(axis, more, coarse_mm * per_mm[axis]):
                self._since_ns[axis] = None
                continue
            since_ns = self._since_ns[axis]
            if since_ns is None:
                self._since_ns[axis] = now_ns
            elif now_ns - since_ns >= positive(longest_ms, LONGEST_MS) * MILLISECOND_NS and late is None:
                late = axis
        return late

    def exceeds(self, axis: int, lag: float, per_mm: Sequence[float]) -> bool:
        """True if a following error is beyond what the axis was allowed at the last check."""
        _, more, _, coarse_mm = self._settings(per_mm)[axis]
        return abs(lag) > self._allowed(axis, more, coarse_mm * per_mm[axis])

    def _allowed(self, axis: int, more_percent: float, coarse: float) -> float:
        return (1.0 + more_percent / 100.0) * abs(self._ought[axis]) + coarse
