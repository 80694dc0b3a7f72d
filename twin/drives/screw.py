"""The shaft behind the motor as data: screw, bearings, coupling and nut.

The shaft turns with the rotor. A nut of lead p moves r = p (1 + lead error) / 2 pi metres a radian and hangs on the
screw by a spring and damper with a dead zone, the backlash. Losses in the nut are friction in proportion to its force:

    forward   T = F r / efficiency                    back-driven   T = F r * backdrive_efficiency

What a screw of steel adds to the rotor's inertia is that of a plain rod of its nominal diameter, less the thread:

    J = fill * pi/32 rho d^4 l + coupling
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from isel_twin.parameters import check, number

STEEL_KG_M3 = 7850.0


@dataclass(frozen=True)
class Screw:
    """What turns with the rotor, and the nut on it. `Screw()` is a bare motor shaft.

    Raises ValueError for a value that no screw can have.
    """

    inertia_kgm2: float = number("kg m2", 0.0, 1.0, default=0.0)
    """Everything that turns with the rotor: screw, coupling, a load at a test bench."""
    coulomb_nm: float = number("N m", 0.0, 5.0, key="shaft_coulomb", default=0.0)
    """Friction torque in motion, of nut preload and bearings."""
    breakaway_ratio: float = number("1", 1.0, 3.0, key="breakaway", default=1.3)
    """Friction torque at rest over that in motion."""
    stribeck_rad_s: float = number("rad/s", 1e-6, 1e6, default=2.5)
    """Shaft speed at which half of the surplus at rest is gone."""
    viscous_nm_s_per_rad: float = number("N m s", 0.0, 0.1, key="shaft_viscous", default=0.0)
    """Viscous friction."""
    lead_mm: float = number("mm", 0.5, 100.0, key="lead", default=5.0)
    """Travel a revolution."""
    lead_error: float = number("%", -1.0, 1.0, key="lead_error", scale=1e-2, default=0.0)
    """Relative error of the lead: +0.00046 is a carriage that goes 0.46 mm too far in 1 m."""
    efficiency: float = number("1", 0.2, 1.0, key="efficiency", default=0.9)
    """Work at the nut over work at the shaft when the screw drives."""
    backdrive_efficiency: float = number("1", -100.0, 1.0, default=math.nan)
    """The same when the nut drives, 0 or less: self-locking; nan becomes 2 - 1 / efficiency (same loss both ways)."""
    backlash_mm: float = number("mm", 0.0, 1.0, key="backlash", default=0.0)
    """Free travel of the nut."""
    stiffness_n_per_m: float = number("N/um", 1.0, 200.0, key="stiffness", scale=1e6, default=0.0)
    """Axial stiffness between screw and nut: screw, fixed bearing and nut in series; 0: no nut."""
    damping_n_s_per_m: float = number("N s/m", 0.0, 20_000.0, key="damping", default=0.0)
    """Axial damping beside it."""

    def __post_init__(self) -> None:
        check(self)
        if math.isnan(self.backdrive_efficiency):
            object.__setattr__(self, "backdrive_efficiency", 2.0 - 1.0 / self.efficiency)

    @property
    def travel_m_per_rad(self) -> float:
        """Travel of the nut a radian, lead error included."""
        return self.lead_mm * 1e-3 * (1.0 + self.lead_error) / (2.0 * math.pi)


@dataclass(frozen=True)
class Rod:
    """A threaded steel rod and its coupling, whose inertia is a screw's. Raises ValueError."""

    diameter_mm: float = number("mm", 4.0, 100.0, key="screw_diameter")
    """Nominal diameter."""
    length_mm: float = number("mm", 10.0, 10_000.0, key="screw_length")
    fill: float = number("1", 0.3, 1.0, key="screw_fill")
    """Inertia of the threaded rod over that of a plain one of the nominal diameter."""
    coupling_inertia_kgm2: float = number("kg m2", 0.0, 1e-2, key="coupling_inertia")

    def __post_init__(self) -> None:
        check(self)

    @property
    def inertia_kgm2(self) -> float:
        """Of rod and coupling about their axis."""
        plain_kgm2 = math.pi / 32.0 * STEEL_KG_M3 * (1e-3 * self.diameter_mm) ** 4 * 1e-3 * self.length_mm
        return self.fill * plain_kgm2 + self.coupling_inertia_kgm2
