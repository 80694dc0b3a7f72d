"""What the iSMIF's 15-pin socket carries while it makes the ticks of a stream: phase patterns, or clock and direction.

Goal: both kinds of drive signal (6.5) follow from the stream, and both turn the motor by the same steps. With T0 the
interface holds the phase of every motor itself, as an index into the eight half steps of one electrical period, and the
card puts the currents of that index into the two windings:

    index          0   1   2   3   4   5   6   7
    winding A     +1  +1   0  -1  -1  -1   0  +1       sign of the current
    winding B      0  +1  +1  +1   0  -1  -1  -1
    full steps     0       2       4       6           or 1 3 5 7: the parity it stood on when full steps were chosen

A plus step raises the index by one half step (two in full-step mode), a minus step lowers it. With T1 pin 2, 4, 6 carry
a clock pulse for each step of X, Y, Z and pin 3, 5, 7 the direction; the stage outside keeps the index. How the cards'
eight data lines and the strobe code the currents is not in the manual, so the signals are given as currents (S6).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

PHASES = np.array([[1, 0], [1, 1], [0, 1], [-1, 1], [-1, 0], [-1, -1], [0, -1], [1, -1]], dtype=np.int8)
"""int8 [8, 2]: signs of the currents in windings A and B for each index."""


def phase_patterns(delta: NDArray[Any], start: tuple[int, int, int] = (0, 0, 0)) -> NDArray[np.int8]:
    """int8 [n, 3, 2]: currents of X, Y, Z in windings A and B after each tick of a stream.

    delta: int8 [n, 4], half steps of the stage at each tick (a full step: two); start: half steps made before.
    """
    index = np.asarray(start, dtype=np.int64) + np.cumsum(delta[:, :3], axis=0, dtype=np.int64)
    patterns: NDArray[np.int8] = PHASES[index % len(PHASES)]
    return patterns


def clock_and_direction(delta: NDArray[Any]) -> tuple[NDArray[np.bool_], NDArray[np.bool_]]:
    """bool [n, 3] twice: does X, Y, Z get a clock pulse at this tick, and is its direction line high (plus)?

    delta: int8 [n, 4]; a step is one pulse, however many half steps the stage makes of it.
    The direction line keeps the last direction while an axis rests, and is high before its first step.
    """
    steps = np.asarray(delta, dtype=np.int8)[:, :3]
    clock = steps != 0
    last = np.maximum.accumulate(np.where(clock, np.arange(len(steps))[:, None], -1), axis=0)
    signs = np.take_along_axis(steps, np.maximum(last, 0), axis=0) if len(steps) else steps
    return clock, (last < 0) | (signs > 0)
