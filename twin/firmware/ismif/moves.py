"""The iSMIF's ramp law and its full steps, as paths and profiles of `isel_twin.motion`.

The leading axis starts with the start speed f0, rises evenly to the end speed V within the ramp length R, stays, and
falls the same way (6.8 to 6.10). So its acceleration follows from the three settings,

    a = (V - f0) / R        s(t) = f0 t + a t^2 / 2 on the ramp,  s(T) = N

and everything else is the trapezoid of `isel_twin.motion.profile`: a short motion turns around at its middle before it
gets to V, and V <= f0 or R = 0 means no ramp. The output frequency of a real device is off by up to 5 %: `error_ppm`
scales f0 and V, while the ramp keeps its length (S5), so that a is scaled with them.

In full-step mode the PBL pattern jumps by two half steps at once. A stream knows only single steps of the stage, so a
full step is a pair of them, the second one nanosecond after the first (S4):

    half steps    |     |     |     |          path tick   1     2     3     4
    full steps    ||    ||    ||    ||                     1 2   3 4   5 6   7 8
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion import Path, Profile, constant, trapezoid

MILLION = 1_000_000
PAIR_NS = 1
"""Between the two half steps of a full step."""


def profile(steps: int, speed_hz: int, start_hz: int, ramp_ms: int, error_ppm: int = 0) -> Profile:
    """Time law of `steps` steps of the leading axis; see the module. `error_ppm`: output frequency over nominal."""
    scale = Fraction(MILLION + error_ppm, MILLION)
    v, f0 = speed_hz * scale, start_hz * scale
    if speed_hz <= start_hz or ramp_ms == 0:
        return constant(steps, v)
    return trapezoid(steps, v, f0, (v - f0) * 1000 / ramp_ms)


@dataclass(frozen=True)
class PairedPath:
    """A path of full steps: every tick of `steps` as two half steps of the stage."""

    steps: Path

    @property
    def ticks(self) -> int:
        """Number of half steps."""
        return 2 * self.steps.ticks

    def codes(self, first: int, last: int) -> NDArray[np.uint8]:
        """uint8 [last - first]: codes of half steps first + 1 .. last."""
        return self.steps.codes(first // 2, (last + 1) // 2).repeat(2)[first % 2 :][: last - first]

    def displacement(self, k: int) -> tuple[int, int, int, int]:
        """Half steps of each axis after k of them."""
        x, y, z, a = (
            m + n for m, n in zip(self.steps.displacement(k // 2), self.steps.displacement((k + 1) // 2), strict=True)
        )
        return x, y, z, a


@dataclass(frozen=True)
class PairedProfile:
    """The time law that belongs to a PairedPath: `steps` times the full steps, `ticks` counts half steps."""

    steps: Profile
    ticks: int

    @property
    def duration_ns(self) -> int:
        """Time of the last half step."""
        return int(self.times(self.ticks - 1, self.ticks)[0]) if self.ticks else 0

    def times(self, first: int, last: int) -> NDArray[np.int64]:
        """int64 [last - first]: times of half steps first + 1 .. last."""
        times = self.steps.times(first // 2, (last + 1) // 2).repeat(2)
        times[1::2] += PAIR_NS
        return times[first % 2 :][: last - first]

    def count(self, t_ns: int) -> int:
        """Half steps at or before t_ns."""
        return min(self.ticks, self.steps.count(t_ns) + self.steps.count(t_ns - PAIR_NS))

    def cut(self, t_ns: int) -> PairedProfile:
        """Only the half steps at or before t_ns."""
        return replace(self, ticks=self.count(t_ns))

    def stopped(self, t_ns: int) -> PairedProfile:
        """The same up to t_ns, then the ramp down; whole full steps only."""
        return paired(self.steps.stopped(t_ns))


def paired(steps: Profile) -> PairedProfile:
    """The half steps of a profile of full steps."""
    return PairedProfile(steps, 2 * steps.ticks)
