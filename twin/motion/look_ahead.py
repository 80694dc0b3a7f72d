"""Look-ahead over a chain of pieces and its ramps: look_ahead.c; used by `joined`, where the formulas are.

A chain is a table, one row a piece; a law is a list of phases, one to three a piece, each a ramp or a constant speed:

    table   LENGTH  LIMIT  ...                     phases   t      dt     s0     s1     v0     v1
            units of path, seconds                          begin, duration, from and to (on the piece), speeds

    piece j     v_j ___/~~~\\___ v_j+1              phases of it: rise to the peak, cruise, fall

Times are double precision: after a day the resolution is still 10 ps (motion/14).
"""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import record

PLAN_PIECE = record("PLAN_PIECE", [(name, "f8") for name in ("length", "speed", "limit", "acceleration", "entry")])
PLAN_PHASE = record("PLAN_PHASE", [(name, "f8") for name in ("t", "dt", "s0", "s1", "v0", "v1")])
LENGTH, SPEED, LIMIT, ACCELERATION, ENTRY = range(5)  # columns of a table of pieces: the fields above
T, DT, S0, S1, V0, V1 = range(6)  # columns of phases
FRACTIONS = 65536.0  # displacements are multiples of 1/FRACTIONS increment, so that sums are exact (motion/13)
FARTHEST = 2.0**31
IN_C = ("FARTHEST", "FRACTIONS")  # records.h has them, too

# messages by the number that `core.faults` returns
FAULTS = (
    "",
    "displacements must be whole multiples of 2^-16 increments below 2^31",
    "lengths of pieces must be positive",
    "speeds and limits of pieces must be positive, entry speeds at least 0",
    "a piece needs a speed or a limit",
    "accelerations of pieces must be positive",
)


def in_c(rows: NDArray[np.float64], dtype: np.dtype[Any]) -> NDArray[np.void]:
    """A table of pieces, or phases, as records [n]."""
    return rows.view(dtype)[:, 0]
