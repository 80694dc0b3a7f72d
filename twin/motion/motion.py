"""What a controller can be executing: ticks at which each command changes by a whole number.

With this protocol nothing below a controller needs to know how it moves its axes. There are two kinds:

    step run        -1, 0, +1 (a full step of a half-step stage: +-2) at times of their own, held until the next tick
                    command  ____|~~~~~|~~~~~~~~|~~~          stepper drives

    set-point run   any change, one tick a period, led evenly to the next tick
                    command  ____/~~~~~\\_____/~~~~           servo drives (`lead_ns`)

Both are formulas: a window of ticks is computed when asked for, so that a job of 10^8 ticks needs little memory.

A motion is immutable. A controller that changes it half-way (a stop ramp, a limit switch, a new plan) puts another one
in its place. If that one *continues* the former, it is the same motion with another future:

    b continues a at time t:   b.start_ns == a.start_ns, b.first == a.first, and the ticks at or before t are the same

The controller alone is responsible for the last point: ticks that have been made stay. `continues` checks the rest. A
motion that does not continue the former ends it at the present time and begins anew (motion/8).
"""

from __future__ import annotations

from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import Displacement


class Motion(Protocol):
    @property
    def axes(self) -> int:
        """Number of axes, 1 to 8."""

    @property
    def start_ns(self) -> int:
        """Time at which it starts; its first tick comes later."""

    @property
    def end_ns(self) -> int:
        """Time of the last tick; start_ns if there is none."""

    @property
    def lead_ns(self) -> int:
        """Time after each tick over which the command moves evenly to its new value; 0: it jumps."""

    @property
    def first(self) -> int:
        """Number of ticks of its plan that an earlier motion, which it resumes, has made."""

    @property
    def last(self) -> int:
        """Number of its last tick: it makes ticks first + 1 .. last."""

    def count(self, t_ns: int) -> int:
        """Number of the last tick made at t_ns: first .. last."""

    def window(self, k0: int, k1: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Times in ns int64 [k1 - k0], never decreasing, and changes int8 or int32 [k1 - k0, axes] of ticks
        k0 + 1 .. k1; first <= k0 <= k1 <= last, IndexError otherwise."""

    def displacement(self, t_ns: int) -> Displacement:
        """Sum of its changes up to t_ns, one number an axis."""

    def stopped(self, t_ns: int) -> Motion:
        """The same up to t_ns, then the ramp to standstill."""

    def cut(self, t_ns: int) -> Motion:
        """The same, ended at t_ns: only the ticks at or before it."""

    def continues(self, other: Motion) -> bool:
        """True if this is `other` with, at most, another future (module docstring)."""
