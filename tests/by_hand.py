"""A plant that does nothing by itself: whoever tests says where everything is, and sees what it was told."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.stage import Stage
from isel_twin.plant import Cut, Threshold


class PlantByHand:
    """Implements `isel_twin.plant.Plant`; every quantity is what was last assigned to it."""

    physics = True

    def __init__(self, watched: Sequence[Threshold] = (), axes: int = 4, stages: Sequence[Stage] = ()) -> None:
        self.time_ns = 0
        self.edge = False
        self.passed = np.zeros(len(watched), dtype=bool)
        self.position_mm = np.zeros(3)
        self.velocity_mm_s = np.zeros(3)
        self.commanded = np.zeros(axes, dtype=np.int64)
        self.late = np.zeros(axes, dtype=np.int64)
        """Changes that no drive has been given yet."""
        self.command = np.zeros(axes)
        self.rotor = np.zeros(axes)
        self.lag = np.zeros(axes)
        self.powered = np.zeros(axes, dtype=bool)
        self.fault = np.zeros(axes, dtype=bool)
        self.stages = tuple(stages)
        self.current_fraction = np.zeros(len(stages))
        self.slip_steps = np.full(axes, 32.0)
        self.closed_loop = np.zeros(axes, dtype=bool)
        self.drive_faults = ((0, ""),) * axes
        self.overloaded = np.zeros(axes, dtype=bool)
        self.in_position = np.ones(axes, dtype=bool)
        self.rotor_speed = np.zeros(axes)
        self.turn_steps = np.full(axes, 1600.0)
        self.resets = 0
        self.at_rest = True
        self.power = (False, False, False)
        """Stages, brake, lowering, as last told."""
        self.drawn: list[tuple[int, float]] = []
        """Trip points told, by number of the threshold."""
        self.pushed: list[tuple[int, float]] = []
        self.phases: list[tuple[int, str]] = []
        self.cuts: list[Cut | None] = []

    @property
    def told(self) -> NDArray[np.int64]:
        return self.commanded + self.late

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        self.time_ns = until_ns
        return until_ns

    def trips(self) -> NDArray[np.bool_]:
        return self.passed.copy()

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        self.power = (stages, brake_released, lowering)

    def reset_drives(self) -> None:
        self.resets += 1

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        self.drawn.append((threshold, position_mm))

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        self.pushed.append((axis, force_n, place))

    def set_cut(self, cut: Cut | None) -> None:
        self.cuts.append(cut)

    def set_phase_lost(self, axis: int, phases: str) -> None:
        self.phases.append((axis, phases))
