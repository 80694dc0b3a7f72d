"""A row of changes as ticks: each axis makes its n steps evenly, in the middle of n equal parts of the row.

    row      t0                                t0 + ns
    X, n=4   |----s----|----s----|----s----|----s----|        s at t0 + (2 k - 1) ns / 2 n, rounded down
    Y, n=2   |---------s---------|---------s---------|

So rows of equal changes make an even frequency, and no step falls on the border of two rows (external/5). Steps
of several axes at the same nanosecond are one tick.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import core


def spread(changes: NDArray[np.int64], start_ns: int, duration_ns: int) -> tuple[NDArray[np.int64], NDArray[np.int8]]:
    """(t_ns int64 [n], delta int8 [n, axes]) of a row. changes: int64 [axes]."""
    most = int(np.abs(changes).sum())
    t_ns, delta = np.empty(most, np.int64), np.zeros((most, len(changes)), np.int8)
    ticks = core.spread(changes, start_ns, duration_ns, np.zeros_like(changes), t_ns, delta)
    return t_ns[:ticks].copy(), delta[:ticks].copy()
