"""Four drives side by side in registers, to the bit what each is alone: one text of the law, two widths (law.h)."""

from __future__ import annotations

import numpy as np
import pytest
from drives.axis import DT, rigs
from numpy.typing import NDArray

from isel_twin.drives.dynamics import BOTH, OPEN, PHASE_A, PHASE_B, axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage
from isel_twin.native import core

STRETCHES, LONG = 20, 200  # of sub-steps alike


def drawn_drive(rng: np.random.Generator) -> NDArray[np.void]:
    """A motor on a stage with one or none of its particulars, on a screw with or without nut, play and friction."""
    particular = (
        {},
        {"damping_gain": rng.uniform(0.2, 2.0)},
        {"microsteps": 1},
        {"microsteps": 2},
        {"step_error": rng.uniform(0.01, 0.2)},
        {"current_offset": rng.uniform(-0.2, 0.2)},
        {"kind": "mixed"},
        {"kind": "slow", "damping_gain": 1.0, "step_error": 0.05},
    )[rng.integers(8)]
    stage = Stage(supply_v=rng.uniform(24.0, 60.0), current_a=rng.uniform(1.0, 4.0), **particular)
    screw = Screw(
        inertia_kgm2=4.3e-5,
        coulomb_nm=rng.choice([0.0, 0.12]),
        viscous_nm_s_per_rad=2e-4,
        stiffness_n_per_m=rng.choice([0.0, 5e6]),
        backlash_mm=rng.choice([0.0, 0.02]),
    )
    return axis_parameters(MOTORS[sorted(MOTORS)[rng.integers(len(MOTORS))]], stage, screw, DT)


@pytest.mark.parametrize("seed", range(12))
def test_side_by_side_is_one_by_one(seed: int) -> None:
    """Ramps up to far too fast, rests, wires that break and come back, pushes: what a motor does in and out of step.
    Without AVX2 both are one by one."""
    rng = np.random.default_rng(seed)
    drives = np.concatenate([drawn_drive(rng) for _ in range(4)])
    rates = rng.uniform(-1.0, 1.0, (STRETCHES, 4)) * rng.choice([0.0, 0.05, 0.3, 4.0], (STRETCHES, 4))
    command = np.cumsum(np.repeat(rates, LONG, axis=0), axis=0)
    phases = np.repeat(rng.choice([BOTH, BOTH, BOTH, PHASE_A, PHASE_B, OPEN], (STRETCHES, 4)), LONG, axis=0)
    fraction = np.repeat(rng.choice([1.0, 0.5], (STRETCHES, 4)), LONG, axis=0)
    place_m = np.cumsum(rng.normal(0.0, 1e-7, command.shape), axis=0)
    load_nm = rng.normal(0.0, 0.1, command.shape)
    found = []
    for wide in (0, core.has_avx2()):
        states, nut_n = axis_states(4), np.empty_like(command)
        states["theta_rad"][3] = 1e6 if seed % 3 == 0 else 0.0  # beyond which sines are the library's
        made = rigs.march(wide, drives, states, command, phases, fraction, place_m, 1e-3 * load_nm, load_nm, nut_n)
        assert made == 1
        found.append((nut_n, states))
    (alone_n, alone), (beside_n, beside) = found
    assert np.abs(alone["omega_rad_s"]).max() > 0.0
    np.testing.assert_array_equal(beside_n.view(np.int64), alone_n.view(np.int64))
    for name in alone.dtype.names:
        assert beside[name].tobytes() == alone[name].tobytes(), name
