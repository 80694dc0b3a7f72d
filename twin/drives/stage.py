"""The power stage as data: a chopper that drives two phase currents from a limited supply.

The current it wants is I (cos phi, sin phi), phi being the electrical angle of the microstep counter. In half and full
step the two waves have the corners of a switch instead:

    half step, A:  1  1  0 -1 -1 -1  0  1        full step, A:  1 -1 -1  1       (B: a quarter period later)

so the torque at standstill is Km I in microstep, alternately Km I and sqrt(2) Km I in half step, and sqrt(2) Km I in
full step. What it can do ends at the supply: supply_factor * supply_v can drive a current, and a current that the stage
wants to get rid of flows back against supply_v.
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Stage:
    """A two-phase power stage. Raises ValueError for a setting that no stage can have."""

    supply_v: float
    """Supply voltage."""
    current_a: float
    """Peak phase current in motion."""
    microsteps: int = 8
    """Microsteps a full step: 1 full step (both phases on), 2 half step, 8 for 1600 a revolution at 1.8 degrees."""
    idle_current_fraction: float = 0.5
    """Current at rest over current in motion, when the controller lowers it."""
    idle_delay_s: float = 0.2
    """Rest before the current is lowered."""
    supply_factor: float = 0.8
    """Part of the supply that can drive a current: drops, dead time, sag (fitted, decision D1); 1: all of it."""
    extra_resistance_ohm: float = 0.2
    """Switches, sense resistor and cable in each phase (estimate); 0: none."""
    quiescent_w: float = 2.0
    """Losses while switched on, beside those of the current (estimate)."""
    thermal_resistance_k_per_w: float = 8.0
    """From the switches through the heat sink to the air (estimate)."""
    thermal_time_constant_s: float = 300.0
    """Of stage and heat sink (estimate)."""
    ambient_c: float = 25.0
    """Temperature of the air in the cabinet."""
    thermal_limit_c: float = 85.0
    """Where the over-temperature contact opens (estimate)."""

    def __post_init__(self) -> None:
        for name, low, high in (
            ("supply_v", 1.0, 1000.0),
            ("current_a", 0.01, 100.0),
            ("microsteps", 1, 256),
            ("idle_current_fraction", 0.0, 1.0),
            ("idle_delay_s", 0.0, math.inf),
            ("supply_factor", 0.1, 1.0),
            ("extra_resistance_ohm", 0.0, 100.0),
            ("quiescent_w", 0.0, 1000.0),
            ("thermal_resistance_k_per_w", 0.0, 1000.0),
            ("thermal_time_constant_s", 1.0, 1e6),
            ("ambient_c", -50.0, 150.0),
            ("thermal_limit_c", -50.0, 300.0),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"stage: {name} must lie in {low:g} .. {high:g}, not {value!r}")
        if self.microsteps != int(self.microsteps):
            raise ValueError(f"stage: microsteps must be a whole number, not {self.microsteps!r}")

    @property
    def drive_v(self) -> float:
        """Largest voltage that drives a phase current (it flows back against supply_v)."""
        return self.supply_factor * self.supply_v

    def loss_w(self, current_fraction: float) -> float:
        """Heat it makes while switched on, at a fraction of its current; both phases together."""
        return self.quiescent_w + self.extra_resistance_ohm * (self.current_a * current_fraction) ** 2

    @property
    def stepped(self) -> bool:
        """True in full and half step, where the phases are switched and not shaped."""
        return self.microsteps <= 2
