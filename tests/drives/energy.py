"""Energy of one drive."""

from __future__ import annotations

import math

from isel_twin.base.compiling import njit


@njit(error_model="numpy")
def stored_energy_j(p, s, nut_position_m):
    """Energy in the rotor, the detent and the nut spring, J (phase currents not counted)."""
    angle = p.pole_pairs * s.theta_rad + p.phase_offset_rad
    stretch = max(0.0, abs(p.travel_m_per_rad * s.theta_rad - nut_position_m) - p.half_backlash_m)
    return (
        0.5 * p.inertia_kgm2 * s.omega_rad_s**2
        + p.detent_torque_nm / (4.0 * p.pole_pairs) * (1.0 - math.cos(4.0 * angle))
        + 0.5 * p.stiffness_n_per_m * stretch**2
    )
