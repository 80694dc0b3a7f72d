"""Torque curves that makers have published, read from their sheets.

A   StepperOnline 23HS32-4004S on a DM542T, 2000 microsteps a revolution, 4.2 A peak      the law is chosen on A and D
D   17HS19-2004S on a digital microstep drive, 24 V, 2 A peak, 2000 microsteps a revolution
C   14HS17-0504S at 20 V, 0.5 A, half step, without damping by the drive                  nothing is fitted on it
"""

from __future__ import annotations

from isel_twin.drives.stage import Stage

SPEEDS_RPM = (90, 210, 300, 390, 510, 600)
PUBLISHED_NM = {
    36: (1.830, 1.774, 1.642, 1.393, 1.229, 1.026),
    48: (1.846, 1.824, 1.781, 1.733, 1.501, 1.332),
}
POINTS = [(v, rpm, nm) for v, row in PUBLISHED_NM.items() for rpm, nm in zip(SPEEDS_RPM, row, strict=True)]

CURVE_D = {
    25: 0.350, 50: 0.350, 100: 0.345, 200: 0.330, 300: 0.330, 400: 0.310, 500: 0.310, 600: 0.310, 700: 0.285,
    800: 0.265, 900: 0.245, 1000: 0.245, 1100: 0.220, 1200: 0.220, 1300: 0.195, 1400: 0.175, 1500: 0.155,
}  # fmt: skip
"""Nm at rev/min, lower edge of the maker's band."""

CURVE_C = {
    600: 1700, 800: 1800, 1000: 1800, 1200: 1700, 1400: 1600, 1600: 1550, 1800: 1500, 2000: 1300, 2200: 1200,
    2500: 1100, 2800: 900, 3000: 700,
}  # fmt: skip
"""g cm at half steps/s. The maker's first point (400) lies in the resonance."""


def dm542t(supply_v: float, **settings: float) -> Stage:
    """A digital drive: it damps."""
    return Stage(**{"supply_v": supply_v, "current_a": 4.2, "microsteps": 10, "damping_gain": 2.0, **settings})


DRIVE_D = Stage(supply_v=24, current_a=2.0, microsteps=10, damping_gain=2.0)
DRIVE_C = Stage(supply_v=20, current_a=0.5, microsteps=2)
