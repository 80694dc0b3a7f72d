"""Names of axes, in the order of every array that has one entry an axis.

A controller has up to eight axes; their number is its own (`len(controller.counts)`). A machine has a carriage for each
of the first three. Further axes have no motor and no mass: they always are where the controller puts them.
"""

from __future__ import annotations

from typing import Final

AXIS_NAMES: Final = ("x", "y", "z", "a", "b", "c", "u", "v")  # axes of a controller; one with n axes uses the first n

CARRIAGES: Final = AXIS_NAMES[:3]  # axes of a machine
