"""A machine whose numbers vary may need a shorter MuJoCo step than the one in its file: it is halved until it fits."""

from __future__ import annotations

from collections.abc import Callable
from typing import TypeVar

from isel_twin.machine import Machine

STEP = "timing.mujoco_step"
MOST_HALVINGS = 3

Made = TypeVar("Made")


def finely(machine: Machine, make: Callable[[dict[str, float]], Made]) -> Made:
    """What `make` makes of the machine with these overrides: none, or a step so short that its springs and masses allow
    it. Raises what `make` raises if no halving helps."""
    step_ms, whole_ms = float(machine.tree["timing"]["mujoco_step"]["value"]), machine.timing.substep_ns * 1e-6
    more: dict[str, float] = {}
    for _ in range(MOST_HALVINGS):
        try:
            return make(more)
        except ValueError as error:
            step_ms *= 0.5
            if STEP not in str(error) or abs(step_ms / whole_ms - round(step_ms / whole_ms)) > 1e-9:
                raise
            more = {STEP: step_ms}
    return make(more)
