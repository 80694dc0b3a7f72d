"""A row of changes as ticks: each axis makes its n steps evenly, in the middle of n equal parts of the row.

    row      t0                                t0 + ns
    X, n=4   |----s----|----s----|----s----|----s----|        s at t0 + (2 k - 1) ns / 2 n, rounded down
    Y, n=2   |---------s---------|---------s---------|

So rows of equal changes make an even frequency, and no step falls on the border of two rows (external/5). Steps
of several axes at the same nanosecond are one tick.
"""

from __future__ import annotations

import numpy as np

from isel_twin.base.compiling import njit


@njit(nogil=True, error_model="numpy")
def spread(changes, start_ns, duration_ns):
    """(t_ns int64 [n], delta int8 [n, axes]) of a row. changes: int64 [axes]."""
    axes = len(changes)
    most = 0
    for axis in range(axes):
        most += abs(changes[axis])
    t_ns = np.empty(most, np.int64)
    delta = np.zeros((most, axes), np.int8)
    made = np.zeros(axes, np.int64)
    ticks = 0
    while True:
        first = np.int64(-1)
        for axis in range(axes):
            steps = abs(changes[axis])
            if made[axis] < steps:
                at = (2 * made[axis] + 1) * duration_ns // (2 * steps)
                if first < 0 or at < first:
                    first = at
        if first < 0:
            break
        t_ns[ticks] = start_ns + first
        for axis in range(axes):
            steps = abs(changes[axis])
            if made[axis] < steps and (2 * made[axis] + 1) * duration_ns // (2 * steps) == first:
                delta[ticks, axis] = 1 if changes[axis] > 0 else -1
                made[axis] += 1
        ticks += 1
    return t_ns[:ticks].copy(), delta[:ticks].copy()
