"""Steps to torque: power stage, motor, screw and nut.

motor.py      motors by type name, and what follows from a data sheet
stage.py      supply, current, microsteps
screw.py      the shaft behind the motor, and the nut on it
dynamics.py   the compiled sub-step: command in, force on the nut out
"""

from isel_twin.drives.motor import MOTORS, Motor
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage

__all__ = ["MOTORS", "Motor", "Screw", "Stage"]
