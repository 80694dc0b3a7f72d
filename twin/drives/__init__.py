"""Steps to torque: power stage, motor, screw and nut.

    motor.py      motors by type name, and what follows from a data sheet
    stage.py      supply, current, microsteps
    screw.py      the shaft behind the motor, and the nut on it
    dynamics.py   the compiled sub-step: command in, force on the nut out
    curves.py     pull-out torque and pull-in rate, measured on a virtual bench with it
    heat.py       temperatures of the stages
    report.py     the torque curve as a table and a picture

The compiled part is imported when it is first used, so that data alone costs no time.
"""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from isel_twin.drives.motor import MOTORS, Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage

if TYPE_CHECKING:
    from isel_twin.drives.curves import (
        pull_in_rate,
        pull_out_envelope,
        pull_out_prediction,
        pull_out_torque,
        resonance_hz,
        starts_in_step,
    )

__all__ = [
    "MOTORS",
    "Motor",
    "Screw",
    "Stage",
    "pull_in_rate",
    "pull_out_envelope",
    "pull_out_prediction",
    "pull_out_torque",
    "resonance_hz",
    "starts_in_step",
]


def __getattr__(name: str) -> Any:
    if name in __all__:
        from isel_twin.drives import curves

        return getattr(curves, name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
