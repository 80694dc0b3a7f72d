"""Two axes whose step frequencies differ by the resonance of a drive make it swing, as isel says of its own tables.

    X   | | | | | | | | | | | | |      the longest way: a step at each tick
    Y   | | | | | |   | | | | | |      a little less: now and then a tick without a step, f_X - f_Y times a second

(isel, C-Series Wiring and Setup Manual, p. 74: resonance also by beat between axes of nearly equal step counts.) What
may swing is the rotor with its screw in the field of the motor, f0 = sqrt(Nr Km I / J) / 2 pi.
"""

from __future__ import annotations

import math

import numpy as np
import pytest

from isel_twin import Twin

TOP_HZ = 6702
LONG = 24_000
"""Steps of X."""


def swing(steps: int) -> float:
    """Microsteps by which Y's load angle swings, half of peak to peak, in a second at full speed."""
    twin = Twin(start_mm=(5.0, 5.0, 5.0))
    for line in ("@07", "@0R7", "@0J100", "@0z1"):
        assert twin.query(line) == "0"
    twin.write(f"@0A{LONG},{TOP_HZ},{steps},{TOP_HZ},0,900,0,900\r".encode())
    twin.run(1.0)
    lag = []
    for _ in range(2000):
        twin.run(0.5e-3)
        lag.append(twin.lost_steps[1])
    return 0.5 * float(np.ptp(lag))


def beat_hz(steps: int) -> float:
    return TOP_HZ * (LONG - steps) / LONG


def natural_hz() -> float:
    axis = Twin(plant="kinematic").machine.axes[1]
    stiffness = axis.motor.pole_pairs * axis.motor.torque_constant_nm_per_a * axis.stage.current_a
    return math.sqrt(stiffness / (axis.motor.rotor_inertia_kgm2 + axis.screw.inertia_kgm2)) / (2.0 * math.pi)


def test_step_counts_that_differ_by_the_resonance_make_a_drive_swing() -> None:
    """Alone it swings by the half step of its own pulses; 9 times as much in the beat; and far off, by the missing step
    besides."""
    resonant = round(LONG * (1.0 - natural_hz() / TOP_HZ))
    alone, beating, off = swing(LONG), swing(resonant), swing(22_000)
    assert alone < 0.6
    assert off < alone + 0.6
    assert beating > 6.0 * alone
    assert beating > 3.0, "isel's example: two axes, 24 000 and 23 420 steps"


def test_the_beat_is_worst_at_the_resonance_of_rotor_and_screw() -> None:
    """Nothing fitted: f0 from data sheet and screw. Within 5 %, since the nut carries the table on its spring."""
    counts = range(23_200, 23_601, 40)
    worst = max(counts, key=swing)
    assert beat_hz(worst) == pytest.approx(natural_hz(), rel=0.05)
