"""The command of an axis between two set points: it moves evenly from one to the next.

A tick at t0 changes the command by d, evenly over the lead, the time L > 0 that follows:

    u(t) = commanded - behind(t),      behind(t) = pending max(0, (end - t) / L),      pending = d,  end = t0 + L

    commanded  ..............________________          commanded: sum of all ticks
                             |          _.-'''
                      pending|      _.-'               u: the drive's command
                             |  _.-'
    u  ______________________|-'
                             t0              end

A tick before the end of the former lead takes over its rest: pending' = behind(t) + d, end' = t + L'. So u has no jump
and depends on past ticks only.

A drive gets the mean of u over each of its sub-steps. Over [a, b] behind(t) has the integral

    pending (b' - a) (2 end - a - b') / (2 L),      b' = min(b, end)
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from isel_twin.native import record

LEAD = record(
    "LEAD",
    [
        ("pending", "f8"),  # microsteps to come at the last tick
        ("end_ns", "i8"),  # when they have come
        ("lead_ns", "i8"),  # time of the last tick to then
    ],
)


def no_leads(axes: int) -> NDArray[np.void]:
    leads = np.zeros(axes, LEAD)
    leads["lead_ns"] = 1
    return leads


def all_behind(leads: NDArray[np.void], t_ns: int) -> NDArray[np.float64]:
    left_ns = np.maximum(leads["end_ns"] - t_ns, 0)
    behind_steps: NDArray[np.float64] = leads["pending"] * left_ns / leads["lead_ns"]
    return behind_steps
