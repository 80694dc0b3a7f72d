"""Switches of carriages that follow their command exactly, and the way of these: following.c."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import core, record

SWITCH = record(
    "SWITCH",
    [
        ("axis", "i8"),
        ("sense", "i8"),
        ("strike", "f8"),  # in counts times sense
        ("release", "f8"),
        ("struck", "i8"),  # 1: it is
    ],
)


def places_on_the_way(
    start_ns: int,
    until_ns: int,
    lead_ns: int,
    t_ns: NDArray[np.int64],
    delta: NDArray[np.int32],
    commanded: NDArray[np.int64],
    leads: NDArray[np.void],
) -> tuple[NDArray[np.int64], NDArray[np.float64]]:
    """Where the path has its corners up to until_ns, what is led included: times and counts, before and after each
    change. commanded, leads: copies, which change."""
    most = (len(t_ns) + 1) * (len(leads) + 3) + 1
    times_ns, counts = np.empty(most, dtype=np.int64), np.empty((most, len(leads)))
    n = core.path_corners(start_ns, until_ns, lead_ns, t_ns, delta, commanded, leads, times_ns, counts)
    return times_ns[:n], counts[:n]
