"""Energy of machines that lose none: it comes and goes by what the exchange of forces explains, and stays.

MuJoCo's steps and the sub-steps of the drives keep an energy that is not quite the mechanical one (the derivation
stands at `hunt.invariants.exchanged_j`). So what is read swings by O(h^2) with what swings in the machine, and must
neither drift nor depend on when in a step it is read.
"""

from __future__ import annotations

import numpy as np
import pytest
from hunt.invariants import exchanged_j
from numpy.typing import NDArray
from plant.energy import mechanical_energy_j

from .conftest import NONE, Bench

pytestmark = pytest.mark.long(seconds=4)

WINDOW_NS = 500_000
LOSSES = (
    "iron_nm_s_per_rad", "drag_nm_s_per_rad", "damping_n_s_per_m", "coulomb_nm", "stribeck_nm", "forward_loss",
    "backward_loss", "detent_torque_nm",
)  # fmt: skip
"""And the detent, which is none, but between whose valleys a free rotor moves by chance, and its energy with it."""
MACHINES = {"4030": (100.0, 100.0, 30.0), "traverse": (300.0, 300.0, 300.0)}


def lossless(bench, machine: str, **overrides: float) -> Bench:
    """A limp machine, bent by 150 N along X and Y, at rest, let go, and from then on without any friction on X and Y;
    Z stays where it is."""
    still = {"axes.z.brake": 2000.0, "axes.z.backlash": 0.0}
    b = bench({**still, **overrides}, power=False, machine=machine, start_mm=MACHINES[machine])
    b.plant.apply_force(0, 150.0, "tool")
    b.plant.apply_force(1, 150.0, "tool")
    b.wait(2000)
    plant = b.plant
    for name in LOSSES:
        plant.parts.drives[name][:2] = 0.0
    plant.built.coulomb_nm[:2] = 0.0
    plant.parts.axes["friction_n"][:2] = 0.0
    plant.parts.joints_law["friction_n"][plant.built.dof[:2]] = 0.0
    plant.parts.joints_law["damper_n_s_per_m"] = 0.0
    plant.parts.springs[1] = 0.0
    b.plant.apply_force(0, 0.0, "tool")
    b.plant.apply_force(1, 0.0, "tool")
    return b


def energies(b: Bench, count: int, step_ns: int) -> tuple[NDArray[np.float64], float]:
    """float64 [count] J, and the most that the exchange can make of what was seen to swing."""
    energy, most = np.empty(count), 0.0
    for k in range(count):
        b.feed(step_ns, *NONE)
        energy[k] = mechanical_energy_j(b.plant.built)
        most = max(most, exchanged_j(b.plant))
    return energy, most


@pytest.mark.parametrize("machine", MACHINES)
def test_without_losses_a_thousand_cycles_keep_the_energy(bench, machine):
    """16 s at 63 Hz, 33 s at 30 Hz: within the bound all the time, and on average the same to 2 per mille of it."""
    b = lossless(bench, machine, **{"imperfections.backlash": False})
    cycle_ns = 16_000_000 if machine == "4030" else 33_000_000
    energy, most = energies(b, 10_000, cycle_ns // 10 + WINDOW_NS // 25)
    assert np.ptp(energy) < most
    means = energy.reshape(4, -1).mean(axis=1)
    assert np.ptp(means) < 0.002 * most


@pytest.mark.parametrize("machine", MACHINES)
def test_energy_is_the_same_wherever_in_a_step_it_is_read(bench, machine):
    """At each of 20 sub-steps of each step of MuJoCo: no more than what the exchange explains, and without leaps.

    Read with the structure as it was at the last of MuJoCo's steps it leapt by a hundred times as much.
    """
    b = lossless(bench, machine, **{"imperfections.backlash": False})
    energy, most = energies(b, 4000, WINDOW_NS // 20)
    assert np.ptp(energy) < most
    assert np.abs(np.diff(energy)).max() < 0.1 * most


@pytest.mark.parametrize("machine", MACHINES)
def test_a_structure_that_swings_alone_keeps_its_energy_to_the_last_digits(bench, machine):
    """No nut on X and Y: what is left is MuJoCo's step alone, which keeps m v^2 / 2 + k q_n q_n-1 / 2 exactly; read at
    any sub-step."""
    b = lossless(bench, machine, **{"imperfections.backlash": False})
    b.plant.parts.drives["stiffness_n_per_m"][:2] = 0.0
    energy, _ = energies(b, 4000, 3 * WINDOW_NS // 20)
    assert energy == pytest.approx(energy[0], abs=1e-12)
