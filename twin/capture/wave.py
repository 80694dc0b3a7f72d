"""Levels over time of one wire in a logic analyser, and a capture of several wires.

    level     ____|~~~~~|____|~~~          first = False, t_ns = [2, 8, 13]
    t_ns      0   2     8    13

Between two times the level does not change, and at each of them it does. Times are whole nanoseconds from 0 on.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

LONGEST_NS = 10**18  # longest capture, 31 years: sums of some of them fit into 64 bits
IN_C = ("LONGEST_NS",)  # records.h has them, too


class CaptureError(ValueError):
    """A capture cannot be used; the message is one line with the place, the reason and the remedy."""


class WrongCallError(CaptureError):
    """An option is wrong; the line begins with its bare name."""


@dataclass(frozen=True, eq=False)
class Wave:
    first: bool  # level before the first change
    t_ns: NDArray[np.int64]  # int64 [n], never decreasing: times of its changes
    known_ns: int = 0  # until then it had no level, and is taken to have had its first one
    gaps: tuple[tuple[int, int], ...] = ()  # times from and to which it had no level later

    def inverted(self) -> Wave:
        return replace(self, first=not self.first)

    def edges(self, rising: bool) -> NDArray[np.int64]:
        """int64 [m], times at which it rises, or falls."""
        return self.t_ns[int(self.first == rising) :: 2]

    def at(self, t_ns: NDArray[np.int64]) -> NDArray[np.bool_]:
        """bool [m], level at times int64 [m]; at a change the new one."""
        changes = np.searchsorted(self.t_ns, t_ns, side="right")
        levels: NDArray[np.bool_] = (changes & 1).astype(np.bool_) ^ self.first
        return levels


@dataclass(frozen=True, eq=False)
class Capture:
    """Signals of one file by the names asked for."""

    waves: Mapping[str, Wave]
    end_ns: int  # time of the last sample; the first one is not before 0
    resolution_ns: float  # time between two samples, or the time unit of the file; 0 if unknown
    shift_ns: int = 0  # added to the times of a file that begins before 0
    gaps: tuple[tuple[int, int], ...] = ()  # times from and to which nothing was captured
