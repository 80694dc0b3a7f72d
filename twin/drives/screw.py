"""The shaft behind the motor as data: screw, bearings, coupling and nut.

The shaft turns with the rotor. A nut of lead p moves r = p (1 + lead error) / 2 pi metres a radian and hangs on the
screw by a spring and damper with a dead zone, the backlash. Losses in the nut are friction in proportion to its force:

    forward   T = F r / efficiency                    back-driven   T = F r * backdrive_efficiency
"""

from __future__ import annotations

import math
from dataclasses import dataclass


@dataclass(frozen=True)
class Screw:
    """What turns with the rotor, and the nut on it. `Screw()` is a bare motor shaft.

    Raises ValueError for a value that no screw can have.
    """

    inertia_kgm2: float = 0.0
    """Everything that turns with the rotor: screw, coupling, a load at a test bench."""
    coulomb_nm: float = 0.0
    """Friction torque in motion."""
    breakaway_ratio: float = 1.3
    """Friction torque at rest over that in motion."""
    stribeck_rad_s: float = 2.5
    """Shaft speed at which half of the surplus at rest is gone."""
    viscous_nm_s_per_rad: float = 0.0
    """Viscous friction."""
    lead_mm: float = 5.0
    """Travel a revolution."""
    lead_error: float = 0.0
    """Relative error of the lead (0.00046: 0.046 % long)."""
    efficiency: float = 0.9
    """Work at the nut over work at the shaft when the screw drives."""
    backdrive_efficiency: float = math.nan
    """The same when the nut drives, 0 or less: self-locking; nan becomes 2 - 1 / efficiency (same loss both ways)."""
    backlash_mm: float = 0.0
    """Free travel of the nut."""
    stiffness_n_per_m: float = 0.0
    """Axial stiffness between screw and nut (screw, fixed bearing, nut); 0: no nut."""
    damping_n_s_per_m: float = 0.0
    """Axial damping beside it."""

    def __post_init__(self) -> None:
        if math.isnan(self.backdrive_efficiency):
            object.__setattr__(self, "backdrive_efficiency", 2.0 - 1.0 / max(self.efficiency, 1e-9))
        for name, low, high in (
            ("inertia_kgm2", 0.0, 1.0),
            ("coulomb_nm", 0.0, 100.0),
            ("breakaway_ratio", 1.0, 10.0),
            ("stribeck_rad_s", 1e-6, 1e6),
            ("viscous_nm_s_per_rad", 0.0, 1e3),
            ("lead_mm", 0.1, 1000.0),
            ("lead_error", -0.1, 0.1),
            ("efficiency", 0.05, 1.0),
            ("backdrive_efficiency", -100.0, 1.0),
            ("backlash_mm", 0.0, 10.0),
            ("stiffness_n_per_m", 0.0, 1e12),
            ("damping_n_s_per_m", 0.0, 1e9),
        ):
            value = getattr(self, name)
            if not low <= value <= high:
                raise ValueError(f"screw: {name} must lie in {low:g} .. {high:g}, not {value!r}")

    @property
    def travel_m_per_rad(self) -> float:
        """Travel of the nut a radian, lead error included."""
        return self.lead_mm * 1e-3 * (1.0 + self.lead_error) / (2.0 * math.pi)
