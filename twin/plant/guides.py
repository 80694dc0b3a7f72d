"""Where guides that are not straight put the tool, by where the carriages are.

A guide that is an arc lies off towards a second axis, by its bow b in the middle of the travel L and by nothing at its
ends, and turns its carriage evenly over the travel, by the angle a in all. What is at the arm h from the screw then
goes farther by a h (the principle of Abbe), which a scale at the screw does not see:

    off  = 4 b u (1 - u)      u = x / L                on  = a u (h + z)

With Z the tool goes away from the screw of X, which is above it, and of Y on a portal; on a machine whose table moves
along Y it comes nearer to that screw: h - z. Positions are machine coordinates, Z grows downwards.

Range of validity. Position only: by 20 um over 400 mm at 100 mm/s it would change velocities by 0.02 mm/s. Forces,
trip points, collisions and what a probe feels are those of straight guides.
"""

from __future__ import annotations

import dataclasses

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.machine import Machine

BOWS = tuple((first, second) for first in CARRIAGES for second in CARRIAGES if first != second)


def along_guides_mm(machine: Machine, position_mm: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64 [..., 3], positions as a gauge between tool and table shows them, from those of straight guides."""
    guides = machine.guides
    if guides is None:
        return position_mm
    number = dataclasses.asdict(guides)
    part = position_mm / np.array([axis.travel_mm for axis in machine.axes])
    found = position_mm.copy()
    for first, second in BOWS:
        if bow_mm := number[f"{first}_{second}"]:
            u = part[..., CARRIAGES.index(first)]
            found[..., CARRIAGES.index(second)] += 4.0 * bow_mm * u * (1.0 - u)
    z_mm = position_mm[..., 2]
    found[..., 0] += guides.turn_x * part[..., 0] * (guides.arm_x + z_mm)
    found[..., 1] += guides.turn_y * part[..., 1] * (guides.arm_y + (-z_mm if machine.kinematics == "table" else z_mm))
    return found
