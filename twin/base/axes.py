"""Names of axes, in the order of every array that has one entry an axis.

A controller has up to eight axes; their number is its own (`len(controller.counts)`). A machine has a carriage for each
of the first three: what a further axis is told to do, it does, without a motor or a mass behind it.
"""

from __future__ import annotations

from typing import Final

AXIS_NAMES: Final = ("x", "y", "z", "a", "b", "c", "u", "v")  # axes of a controller, as many of them as it has

CARRIAGES: Final = AXIS_NAMES[:3]  # axes of a machine
