"""The state of a common supply in the loop; its law (isel_twin.drives.supply) is in feed.h."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.dynamics import BOTH
from isel_twin.drives.stage import AnyStage
from isel_twin.drives.supply import Supply
from isel_twin.native import record

SUPPLY = record(
    "SUPPLY",
    [
        ("on", "i8"),  # 0: every stage has its own stiff supply
        ("gate", "i8"),  # phases let through: BOTH, or OPEN at under-voltage
        ("steady", "i8"),  # 1: the last window changed nothing
        ("voltage_v", "f8"),  # U
        ("source_v", "f8"),  # U0
        ("source_ohm", "f8"),  # R_s
        ("charge_decay", "f8"),  # exp(-h / R_s C)
        ("window_s", "f8"),  # h
        ("capacitance_f", "f8"),  # C
        ("chopper_v", "f8"),
        ("chopper_ohm", "f8"),
        ("undervoltage_v", "f8"),
        ("release_v", "f8"),
        ("energy_j", "f8"),  # T w + R i^2 of this window so far
        ("mean_j", "f8"),  # the same of the window before
        ("magnetic_j", "f8"),  # L i^2 / 2 at the end of the window before
        ("drawn_j", "f8"),  # all that the stages took since power-on, less what they gave back
        ("dumped_j", "f8"),  # all that the chopper took
    ],
)


def supply_state(supply: Supply | None, stages: Sequence[AnyStage], window_s: float) -> NDArray[np.void]:
    """A charged supply of these stages, shape [1], dtype SUPPLY; `on` is 0 if there is none."""
    state = np.zeros(1, SUPPLY)
    state["gate"] = BOTH
    state["steady"] = 1
    if supply is None or not supply.enabled:
        return state
    state["on"] = 1
    state["voltage_v"] = state["source_v"] = stages[0].supply_v
    state["window_s"] = window_s
    state["charge_decay"] = math.exp(-window_s / (supply.source_ohm * supply.capacitance_f))
    for name in ("source_ohm", "capacitance_f", "chopper_v", "chopper_ohm", "undervoltage_v", "release_v"):
        state[name] = getattr(supply, name)
    return state
