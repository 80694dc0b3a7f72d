r"""How long the carriages ring after a move: until their distance from where they come to rest stays within a bound.

             | <- in progress -> | <- DWELL_S: looked at every millisecond ---> |
    distance |                   |\ /\ _                                         |
             |                   | V  V \/\-_____________________________________|
             |                   | <-----> | settling time                      the next line

A line of a job is over when the controller says so, not when the machine stands still: a hole is drilled where the
carriage rings. With a bound for it the time of a job is that of a host which waits for it.
"""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.core.twin import Twin
from isel_twin.jobs.result import Result

DWELL_S = 0.2  # in which every machine of this class comes to rest
LOOK_NS = MILLISECOND_NS


class Settling:
    """Lets the machine settle after each of these lines of a job; a watcher of `played`."""

    def __init__(self, twin: Twin, bound_mm: float, lines: Collection[int]) -> None:
        self._twin, self._bound_mm, self._lines = twin, bound_mm, frozenset(lines)
        self.dwelt_ns = self.last_ns = 0  # let pass in all, and after the last of them
        self.of_line_ns: dict[int, int] = {}  # settling times, by number of the line

    def take(self, result: Result) -> None:
        """The line is over."""
        if result.number not in self._lines or not result.ok:
            return
        twin, begun_ns, seen_mm = self._twin, self._twin.time_ns, []
        for _ in range(round(DWELL_S * SECOND_NS / LOOK_NS)):
            twin.run_until(twin.time_ns + LOOK_NS)
            seen_mm.append(twin.position_error_mm)
        apart_mm = np.abs(np.array(seen_mm) - seen_mm[-1]).max(axis=1)
        outside = np.flatnonzero(apart_mm > self._bound_mm)
        self.of_line_ns[result.number] = (int(outside[-1]) + 1) * LOOK_NS if len(outside) else 0
        self.last_ns = twin.time_ns - begun_ns
        self.dwelt_ns += self.last_ns

    @property
    def spared_ns(self) -> int:
        """Time that was let pass and that no host would wait."""
        return self.dwelt_ns - sum(self.of_line_ns.values())
