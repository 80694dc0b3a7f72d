"""The common supply in the compiled loop: its state, and the law of isel_twin.drives.supply once a window."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.compiling import njit
from isel_twin.drives.dynamics import OPEN
from isel_twin.drives.servo import VOLTAGE_FAULT, fail
from isel_twin.drives.shaft import SERVO
from isel_twin.drives.stage import AnyStage
from isel_twin.drives.supply import Supply
from isel_twin.native import record

STEADY = 1e-9  # change of the voltage in a window, over U0, that counts as none

SUPPLY = record(
    "SUPPLY",
    [
        ("on", "i8"),  # 0: every stage has its own stiff supply
        ("gate", "i8"),  # phases let through: all (3), or none (0) at under-voltage
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
    state["gate"] = 3
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


@njit(inner=True, error_model="numpy")
def feed(supply, axes, drives, states):
    """Advance the voltage to the end of a window in which the stages took `energy_j`, and pass it to the drives. axes
    [3] AXIS, drives [3] AXIS_PARAMETERS, states [3] AXIS_STATE. A stage without enough voltage is off."""
    magnetic_j = 0.0
    own_w = 0.0
    for i in range(axes.shape[0]):
        a_a, b_a = states[i].current_a_a, states[i].current_b_a
        magnetic_j += 0.5 * axes[i].inductance_h * (a_a * a_a + b_a * b_a)
        if axes[i].phases & supply.gate != OPEN:
            own_w += axes[i].own_w
    h = supply.window_s
    before = supply.voltage_v
    taken_j = supply.energy_j + magnetic_j - supply.magnetic_j + own_w * h
    supply.mean_j = supply.energy_j
    supply.energy_j = 0.0
    supply.magnetic_j = magnetic_j
    supply.drawn_j += taken_j
    blocked_v = math.sqrt(max(0.0, before * before - 2.0 * taken_j / supply.capacitance_f))
    voltage_v = blocked_v
    if before < supply.source_v or blocked_v < supply.source_v:
        end_v = supply.source_v - supply.source_ohm * taken_j / (h * max(before, 1.0))
        charged_v = end_v + (before - end_v) * supply.charge_decay
        voltage_v = max(blocked_v, min(charged_v, supply.source_v))
    if voltage_v > supply.chopper_v:
        least_v = voltage_v * math.exp(-h / (supply.chopper_ohm * supply.capacitance_f))
        left_v = max(supply.chopper_v, least_v)
        supply.dumped_j += 0.5 * supply.capacitance_f * (voltage_v * voltage_v - left_v * left_v)
        voltage_v = left_v
    supply.steady = 1 if abs(voltage_v - before) <= STEADY * supply.source_v else 0
    if supply.steady == 0:
        supply.voltage_v = voltage_v
    gate = supply.gate
    if voltage_v < supply.undervoltage_v:
        supply.gate = 0
    elif voltage_v > supply.release_v:
        supply.gate = 3
    if gate != supply.gate:
        supply.steady = 0
    for i in range(axes.shape[0]):
        drives[i].drive_v = axes[i].supply_factor * supply.voltage_v
        drives[i].return_v = supply.voltage_v
        axes[i].fault = 1 if supply.gate == OPEN else 0
        if supply.gate == OPEN and drives[i].kind == SERVO and states[i].on != 0 and states[i].fault == 0:
            fail(states[i], VOLTAGE_FAULT)
