"""The drives of a plant without physics, as far as they are always the same: they follow at once and tire never."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.drives.stage import AnyStage


class IdealDrives:
    """Implements that part of `isel_twin.plant.Plant`: forces, brakes, phases and supply have no effect."""

    _count: int  # axes of the controller

    def _no_effect(self, *_: Any, **__: Any) -> None:
        """For the methods of a plant with physics."""

    apply_force = set_cut = turn_cut = reset_drives = set_phase_lost = watch_margin = _no_effect
    set_friction = set_obstacle = set_payload = set_undervoltage = _no_effect

    @property
    def lag(self) -> NDArray[np.float64]:
        return np.zeros(self._count)

    @property
    def fault(self) -> NDArray[np.bool_]:
        return np.zeros(self._count, dtype=np.bool_)

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        return ((0, ""),) * self._count

    @property
    def overloaded(self) -> NDArray[np.bool_]:
        return np.zeros(self._count, dtype=np.bool_)

    @property
    def stages(self) -> tuple[AnyStage, ...]:
        return ()

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        return np.empty(0)

    @property
    def force_n(self) -> NDArray[np.float64]:
        return np.full(len(CARRIAGES), math.nan)

    @property
    def supply_v(self) -> float:
        return math.nan

    @property
    def margin(self) -> NDArray[np.float64]:
        return np.full(self._count, np.nan)

    @property
    def fastest_rad_s(self) -> NDArray[np.float64]:
        return self.margin

    def take_margin(self) -> NDArray[np.float64]:
        return self.margin

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        return np.ones(self._count)
