"""Where switches and the feeler act next, drawn at power-on and anew with each release (wiring/5)."""

from __future__ import annotations

import numpy as np

from isel_twin.machine import Contact, Machine

KEPT = 0.9  # largest part of its hysteresis by which a switch's trip point moves inwards from one time to the next


class TripPoints:
    """The next trip points of a machine's position switches, in their order, and of its feeler."""

    def __init__(self, machine: Machine, random: np.random.Generator) -> None:
        self._random, self._feeler = random, machine.feeler
        self.switches_mm = [self._drawn(switch.position_mm, switch.repeatability_mm) for switch in machine.switches]
        self.feeler_mm = self.next_of_feeler()

    def next_of(self, number: int, switch: Contact) -> float:
        """The next trip point of a switch that has just been released, not beyond the carriage (wiring/12)."""
        inwards = 1.0 if switch.end == "motor" else -1.0
        nearest_mm = self.switches_mm[number] + inwards * KEPT * switch.hysteresis_mm
        trip_mm = self._drawn(switch.position_mm, switch.repeatability_mm)
        if switch.hysteresis_mm > 0.0 and inwards * (trip_mm - nearest_mm) > 0.0:
            trip_mm = nearest_mm
        self.switches_mm[number] = trip_mm
        return trip_mm

    def next_of_feeler(self) -> float:
        """The deflection at which the feeler acts next; 0 of a machine without one."""
        found = self._feeler
        return 0.0 if found is None else max(self._drawn(found.pretravel_mm, found.repeatability_mm), 0.0)

    def _drawn(self, nominal_mm: float, deviation_mm: float) -> float:
        return nominal_mm + float(self._random.normal(0.0, deviation_mm)) if deviation_mm > 0.0 else nominal_mm
