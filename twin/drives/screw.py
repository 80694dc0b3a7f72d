"""The screw as data, with bearings, coupling and nut.

A nut of lead p moves r = p (1 + lead error) / 2 pi metres a radian and hangs on the screw by a spring and damper with a
dead zone, the backlash. Losses in the nut are friction in proportion to its force:

    forward   T = F r / efficiency                    back-driven   T = F r * backdrive_efficiency

A steel screw adds to the rotor's inertia that of a plain rod of its nominal diameter, less the thread:

    J = fill * pi/32 rho d^4 l + coupling

Its free length, from the nut to the fixed bearing at the motor's end, stretches like a rod of that diameter less the
thread; bearing and nut are compliant, too. Together they have the stated stiffness in the middle of the travel:

    1/k(x) = 1/k_bearing+nut + (x + l_0)/(E A)         x: place of the nut, l_0: free length where x = 0
    E A = E sqrt(fill) pi/4 d^2                        (fill goes with d^4, the section with d^2)

The lead has an error that repeats every turn, nut at r th + a sin(x / r), and grows in proportion to its warming.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from isel_twin.base.parameters import check, number

STEEL_KG_M3 = 7850.0
STEEL_GROWTH_PER_K = 11.5e-6  # thermal expansion


@dataclass(frozen=True)
class Screw:
    """Everything that turns with the rotor, and the nut. `Screw()` is a bare motor shaft. Raises ValueError for an
    impossible value."""

    # everything that turns with the rotor: screw, coupling, a load at a test bench
    inertia_kgm2: float = number("kg m2", 0.0, 1.0, default=0.0)
    # friction torque in motion, of nut preload and bearings
    coulomb_nm: float = number("N m", 0.0, 5.0, key="shaft_coulomb", default=0.0)
    # friction torque at rest over that in motion
    breakaway_ratio: float = number("1", 1.0, 3.0, key="breakaway", default=1.3)
    # shaft speed at which half of the surplus at rest is gone
    stribeck_rad_s: float = number("rad/s", 1e-6, 1e6, default=2.5)
    viscous_nm_s_per_rad: float = number("N m s", 0.0, 0.1, key="shaft_viscous", default=0.0)
    lead_mm: float = number("mm", 0.5, 100.0, key="lead", default=5.0)
    # relative error of the lead: +0.00046 is a carriage that goes 0.46 mm too far in 1 m
    lead_error: float = number("%", -1.0, 1.0, key="lead_error", scale=1e-2, default=0.0)
    # screw temperature above that at which its lead was measured; the frame with its switches keeps its length
    warming_k: float = number("K", -50.0, 100.0, key="screw_warming", optional=True, default=0.0)
    # amplitude of the error of the lead that repeats every revolution
    cyclic_error_m: float = number("um", 0.0, 200.0, key="cyclic_error", scale=1e-6, optional=True, default=0.0)
    # work at the nut over work at the shaft when the screw drives
    efficiency: float = number("1", 0.2, 1.0, key="efficiency", default=0.9)
    # the same when the nut drives, 0 or less: self-locking; nan becomes 2 - 1 / efficiency (same loss both ways)
    backdrive_efficiency: float = number("1", -100.0, 1.0, default=math.nan)
    backlash_mm: float = number("mm", 0.0, 1.0, key="backlash", default=0.0)
    # Axial stiffness between screw and nut: screw, fixed bearing and nut in series; 0: no nut. With a finite `rod_n` it
    # is the one in the middle of the travel.
    stiffness_n_per_m: float = number("N/um", 1.0, 200.0, key="stiffness", scale=1e6, default=0.0)
    rod_n: float = number("N", 1e5, math.inf, default=math.inf)  # E A; inf: the stiffness is the same everywhere
    free_length_m: float = number("m", 0.0, 10.0, default=0.0)  # l_0: from the fixed bearing to the nut where x = 0
    middle_m: float = number("m", 0.0, 10.0, default=0.0)  # position where the stiffness is the stated one
    damping_n_s_per_m: float = number("N s/m", 0.0, 20_000.0, key="damping", default=0.0)  # axial

    def __post_init__(self) -> None:
        check(self)
        if math.isnan(self.backdrive_efficiency):
            object.__setattr__(self, "backdrive_efficiency", 2.0 - 1.0 / self.efficiency)
        if self.stiffness_n_per_m * (self.free_length_m + self.middle_m) >= self.rod_n:
            raise ValueError(
                f"screw: a stiffness of {self.stiffness_n_per_m / 1e6:g} N/um is more than the screw alone has; "
                f"allowed: below {self.rod_n / (self.free_length_m + self.middle_m) / 1e6:.4g} N/um"
            )

    @property
    def travel_m_per_rad(self) -> float:
        """Travel of the nut a radian, lead error and growth included."""
        error = self.lead_error + STEEL_GROWTH_PER_K * self.warming_k
        return self.lead_mm * 1e-3 * (1.0 + error) / (2.0 * math.pi)

    @property
    def bearing_m_per_n(self) -> float:
        """Compliance of fixed bearing and nut: the stated one without the screw's own."""
        return 1.0 / self.stiffness_n_per_m - (self.free_length_m + self.middle_m) / self.rod_n

    def stiffness_at(self, position_m: float) -> float:
        if self.rod_n == math.inf:
            return self.stiffness_n_per_m
        return 1.0 / (self.bearing_m_per_n + max(0.0, position_m + self.free_length_m) / self.rod_n)


@dataclass(frozen=True)
class Rod:
    """A threaded steel rod and its coupling, as files describe a screw. Raises ValueError for impossible values."""

    diameter_mm: float = number("mm", 4.0, 100.0, key="screw_diameter")
    length_mm: float = number("mm", 10.0, 10_000.0, key="screw_length")
    # inertia of the threaded rod over that of a plain one of the nominal diameter
    fill: float = number("1", 0.3, 1.0, key="screw_fill")
    coupling_inertia_kgm2: float = number("kg m2", 0.0, 1e-2, key="coupling_inertia")
    modulus_n_per_m2: float = number("GPa", 10.0, 1000.0, key="screw_modulus", scale=1e9, optional=True, default=206e9)
    # from the fixed bearing to the nut at position 0; nan: half of what the screw is longer than the travel
    free_length_mm: float = number("mm", 0.0, 10_000.0, key="free_length", optional=True, default=math.nan)

    def __post_init__(self) -> None:
        check(self)

    @property
    def inertia_kgm2(self) -> float:
        plain_kgm2 = math.pi / 32.0 * STEEL_KG_M3 * (1e-3 * self.diameter_mm) ** 4 * 1e-3 * self.length_mm
        return self.fill * plain_kgm2 + self.coupling_inertia_kgm2

    @property
    def rod_n(self) -> float:
        """E A: force that would double its length."""
        return self.modulus_n_per_m2 * math.sqrt(self.fill) * math.pi / 4.0 * (1e-3 * self.diameter_mm) ** 2
