"""What a controller can be executing: ticks at which each command changes by a whole number.

The goal of this protocol is that nobody below a controller knows how it moves its axes. Two kinds follow it:

    step run        -1, 0, +1 (a full step of a half-step stage: +-2) at times of their own, held until the next tick
                    command  ____|~~~~~|~~~~~~~~|~~~          stepper drives

    set-point run   any change, one tick a period, led evenly to the next tick
                    command  ____/~~~~~\\_____/~~~~           servo drives; see `lead_ns`

Both are described, not stored: a window of ticks is expanded where it is looked at, so that a job of 10^8 ticks needs
little memory.

A motion is immutable. A controller that changes its mind in mid-motion (a stop ramp, a limit switch, a new plan) puts
another one in its place. If that one *continues* the former, it is the same motion with another future:

    b continues a at time t:   b.start_ns == a.start_ns, b.first == a.first, and the ticks at or before t are the same

Only the controller can make sure of the last: ticks that have been made are not taken back. `continues` tells the rest
(motion/8).
A motion that does not continue the former ends it at the present time and begins anew.
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
        """Time over which a drive is led evenly to the new command, from each tick on; 0: it takes it at once."""

    @property
    def first(self) -> int:
        """Number of ticks of its plan that were made before it, by a motion it resumes."""

    @property
    def last(self) -> int:
        """Number of the last tick made when it has ended: it makes ticks first + 1 .. last."""

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
        """True if this is `other` with, at most, another future; see the module."""
