"""The iSMIF's ramp law and its full steps, as paths and time laws of `isel_twin.motion`.

The leading axis starts with the start speed f0, rises evenly to the end speed V within the ramp length R, stays, and
falls the same way (6.8 to 6.10). So its acceleration follows from the three settings,

    a = (V - f0) / R        s(t) = f0 t + a t^2 / 2 on the ramp,  s(T) = N

and the rest is the trapezoid of `isel_twin.motion.time_law`: a short motion slows down from its middle on before it
reaches V, and V <= f0 or R = 0 means no ramp. The output frequency of a real device is off by up to 5 %: `error_ppm`
scales f0 and V, while the ramp keeps its length (ismif/5), so that a is scaled with them.

In full-step mode the PBL pattern jumps by two half steps at once: a tick of the stream is +-2 half steps of the stage
(ismif/4).
"""

from __future__ import annotations

from dataclasses import dataclass
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion import Displacement, StepPath, TimeLaw, constant, trapezoid


def ramp(steps: int, speed_hz: int, start_hz: int, ramp_ms: int, error_ppm: int = 0) -> TimeLaw:
    """Time law of `steps` steps of the leading axis. error_ppm: output frequency over nominal."""
    scale = Fraction(1_000_000 + error_ppm, 1_000_000)
    v, f0 = speed_hz * scale, start_hz * scale
    if speed_hz <= start_hz or ramp_ms == 0:
        return constant(steps, v)
    return trapezoid(steps, v, f0, (v - f0) * 1000 / ramp_ms)


@dataclass(frozen=True)
class FullSteps:
    """A path of full steps, in the half steps of the stage."""

    path: StepPath

    @property
    def ticks(self) -> int:
        return self.path.ticks

    @property
    def axes(self) -> int:
        return self.path.axes

    def deltas(self, first: int, last: int) -> NDArray[np.int8]:
        """-2, 0, +2."""
        return 2 * self.path.deltas(first, last)

    def displacement(self, k: int) -> Displacement:
        """Half steps of each axis after k full steps."""
        return tuple(2 * n for n in self.path.displacement(k))
