"""Parts of a twin that are chosen by name or drawn when it is built."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine
from isel_twin.plant import Plant, Threshold

__all__ = ["PLANTS", "build_plant", "power_on_mm"]

PLANTS = ("mujoco", "kinematic")


def build_plant(
    plant: str, machine: Machine, thresholds: Sequence[Threshold], start_mm: NDArray[np.float64], axes: int
) -> Plant:
    if plant == "kinematic":
        from isel_twin.plant.kinematic import KinematicPlant

        return KinematicPlant(machine, thresholds, start_mm, axes)
    from isel_twin.plant.mujoco import MujocoPlant

    return MujocoPlant(machine, thresholds, start_mm, axes)


def power_on_mm(
    machine: Machine, random: np.random.Generator, wanted_mm: Sequence[float] | None
) -> NDArray[np.float64]:
    """float64 [3], where the carriages stand when the mains is switched on: as wanted, or where they happen to be.

    Raises ValueError unless the wanted positions lie between the hard stops.
    """
    if wanted_mm is None:
        return np.array([random.uniform(axis.power_on_low_mm, axis.power_on_high_mm) for axis in machine.axes])
    if len(wanted_mm) != len(machine.axes):
        raise ValueError(f"start_mm has {len(wanted_mm)} values; give one for each of X, Y and Z")
    for axis, position_mm in zip(machine.axes, wanted_mm, strict=True):
        low_mm, high_mm = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        if not low_mm <= position_mm <= high_mm:
            raise ValueError(f"start_mm: {axis.name} = {position_mm}; it must lie from {low_mm:g} to {high_mm:g} mm")
    return np.array(wanted_mm, dtype=np.float64)
