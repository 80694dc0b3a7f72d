"""The kinematic plant: the carriage follows the counter exactly, switches still work.

    position = start + commanded * lead / steps_per_rev

For host tests that want only protocol and timing. No time passes between a pulse and the motion it makes, so a switch
changes at the very pulse that strikes it:

    motor end:  struck while position <  trip, free again from trip + hysteresis on
    far end:    struck while position >  trip, free again from trip - hysteresis on
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numba import njit
from numpy.typing import NDArray

from isel_twin.axes import CARRIAGES
from isel_twin.drives.stage import Stage
from isel_twin.machine import Machine
from isel_twin.plant import Switch


@njit(cache=True)
def _follow(delta, commanded, axis, sense, strike, release, struck):  # type: ignore[no-untyped-def]
    """Make ticks until a switch changes; commanded and struck change in place. Return the number of ticks made."""
    low, high = (
        np.full(commanded.shape[0], -np.inf),
        np.full(commanded.shape[0], np.inf),
    )  # between them, no switch of the axis changes
    for s in range(axis.shape[0]):
        edge = sense[s] * (release[s] if struck[s] else strike[s])
        if (sense[s] > 0) == struck[s]:
            low[axis[s]] = max(low[axis[s]], edge)
        else:
            high[axis[s]] = min(high[axis[s]], edge)
    for k in range(delta.shape[0]):
        outside = False
        for i in range(delta.shape[1]):
            if delta[k, i]:
                commanded[i] += delta[k, i]
                outside |= not low[i] < commanded[i] < high[i]
        if outside and _switch(commanded, axis, sense, strike, release, struck):
            return k + 1
    return delta.shape[0]


@njit(cache=True)
def _switch(commanded, axis, sense, strike, release, struck):  # type: ignore[no-untyped-def]
    """Set the switches for these positions; say whether one has changed."""
    changed = False
    for s in range(axis.shape[0]):
        beyond = sense[s] * commanded[axis[s]]
        now = beyond > (release[s] if struck[s] else strike[s])
        changed |= now != struck[s]
        struck[s] = now
    return changed


class KinematicPlant:
    """Implements `isel_twin.plant.Plant` without physics; forces, power and brake have no effect."""

    def __init__(
        self, machine: Machine, switches: Sequence[Switch], start_mm: NDArray[np.float64], axes: int = 4
    ) -> None:
        """Place the carriages at start_mm [3] in machine coordinates. axes: number of the controller's axes."""
        self.time_ns = 0
        self._start_mm = np.array(start_mm, dtype=np.float64)
        self._step_mm = np.array([axis.step_mm for axis in machine.axes])
        self._switches = tuple(switches)
        self._axis = np.array([switch.axis for switch in switches], dtype=np.int64)
        self._sense = np.array([switch.sense for switch in switches], dtype=np.int64)
        self._strike = np.empty(len(switches))
        self._release = np.empty(len(switches))
        self._axes = axes
        self._commanded = np.zeros(max(axes, len(CARRIAGES)), dtype=np.int64)
        self._struck = np.zeros(len(switches), dtype=np.bool_)
        for number, switch in enumerate(switches):
            self.set_trip_point(number, switch.trip_mm)
            self._struck[number] = self._strike[number] < 0.0

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any]) -> int:
        """See Plant.advance."""
        before = self._struck.copy()
        made = _follow(delta, self._commanded, self._axis, self._sense, self._strike, self._release, self._struck)
        self.time_ns = int(t_ns[made - 1]) if (before != self._struck).any() else until_ns
        return self.time_ns

    def trips(self) -> NDArray[np.bool_]:
        """See Plant.trips."""
        return self._struck.copy()

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """Without physics there is nothing to power."""

    def apply_force(self, axis: int, force_n: float) -> None:
        """Without physics there is nothing to push."""

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """Without physics there are no phases."""

    def set_trip_point(self, switch: int, position_mm: float) -> None:
        """See Plant.set_trip_point. Kept in steps from the start position, in the sense of the switch."""
        geometry = self._switches[switch]
        step_mm, start_mm = self._step_mm[geometry.axis], self._start_mm[geometry.axis]
        self._strike[switch] = geometry.sense * (position_mm - start_mm) / step_mm
        self._release[switch] = self._strike[switch] - geometry.hysteresis_mm / step_mm

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """See Plant.position_mm."""
        return self._start_mm + self._commanded[:3] * self._step_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """Zero: a carriage that jumps from step to step has no velocity."""
        return np.zeros(3)

    @property
    def commanded(self) -> NDArray[np.int64]:
        """See Plant.commanded."""
        return self._commanded[: self._axes].copy()

    @property
    def rotor(self) -> NDArray[np.float64]:
        """The rotor is where it is told to be."""
        return self.commanded.astype(np.float64)

    @property
    def stages(self) -> tuple[Stage, ...]:
        """None: there are no currents."""
        return ()

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """Of no stage."""
        return np.empty(0)

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """One step: there is no motor that could slip."""
        return np.ones(self._axes)

    @property
    def at_rest(self) -> bool:
        """Nothing moves by itself."""
        return True
