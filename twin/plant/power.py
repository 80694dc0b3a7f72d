"""What the drives of a built machine are told: stages, brakes, lowering of the current, lost phases, supply."""

from __future__ import annotations

import numpy as np

from isel_twin.drives.dynamics import BOTH, OPEN
from isel_twin.drives.servo import forget
from isel_twin.native import core
from isel_twin.plant import memory
from isel_twin.plant.built import Built, find_available

_PHASES = {"": BOTH, "a": BOTH & ~1, "b": BOTH & ~2, "ab": OPEN}  # remaining phases, by the interrupted ones


class Power:
    """Stages off, brakes closed, phases and supply whole."""

    def __init__(self, built: Built) -> None:
        self._built = built
        self.switched = (False, False, False)
        """Arguments of the last `switch`."""
        self.lost = [""] * memory.AXES
        """Interrupted phases of each motor."""

    @property
    def stages(self) -> bool:
        return self.switched[0]

    def switch(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """`Plant.set_power`"""
        switched = (stages, brake_released, lowering)
        if switched == self.switched:
            return
        built, parts = self._built, self._built.parts
        core.wake(built.memory)
        if stages and not self.stages:
            parts.axes["still_since"] = parts.plant["now"]
            parts.axes["fraction"] = 1.0
            self._forget_faults()
        if not lowering:
            parts.axes["fraction"] = 1.0
        self.switched = switched
        parts.axes["lowering"] = lowering
        parts.drives["coulomb_nm"] = built.coulomb_nm + (0.0 if brake_released else 1.0) * built.brake_nm
        self._set_phases()

    def reset_drives(self) -> None:
        core.wake(self._built.memory)
        self._forget_faults()

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """Raises ValueError for anything but "a", "b", "ab" and ""."""
        if phases not in _PHASES:
            raise ValueError(f"unknown motor phases {phases!r}; there are: a, b, ab")
        core.wake(self._built.memory)
        self.lost[axis] = phases
        self._set_phases()

    def set_undervoltage(self, missing: float) -> None:
        parts = self._built.parts
        core.wake(self._built.memory)
        left, supply, drives = 1.0 - missing, parts.supply, parts.drives
        stages = [axis.stage for axis in self._built.machine.axes]
        if supply["on"][0]:
            supply["source_v"] = left * stages[0].supply_v
            supply["steady"] = 0
        else:
            drives["drive_v"] = [left * stage.drive_v for stage in stages]
            drives["return_v"] = [left * stage.supply_v for stage in stages]
        find_available(self._built, left)

    def _forget_faults(self) -> None:
        for i in np.flatnonzero(self._built.closed):
            forget(self._built.parts.states[i : i + 1])

    def _set_phases(self) -> None:
        lost = ["" if closed else lost for lost, closed in zip(self.lost, self._built.closed, strict=True)]
        self._built.parts.axes["phases"] = [_PHASES[phases] if self.stages else OPEN for phases in lost]
        self._built.parts.drives["connected"] = [not lost for lost in self.lost]
