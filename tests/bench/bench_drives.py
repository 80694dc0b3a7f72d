"""Drives: sub-steps a second of one drive on one core (target 10^7), and what a torque curve costs.

`extra_info` holds sub-steps a second, from the median.
"""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.drives.curves import follow, mean_command, pull_out_torque
from isel_twin.drives.dynamics import axis_parameters
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import Stage

SUB_STEPS = 400_000
DT = 25e-6
X_AXIS = Screw(inertia_kgm2=4.3e-5, coulomb_nm=0.12, viscous_nm_s_per_rad=2e-4)


@pytest.mark.parametrize("speed_hz", [0.0, 1000.0, 10_000.0])
def test_sub_steps_a_second(benchmark: BenchmarkFixture, speed_hz: float) -> None:
    """Ten seconds of one axis, at rest and turning."""
    stage = Stage(supply_v=48, current_a=4.2, microsteps=8)
    parameters = axis_parameters(MOTORS["23HS32-4004S"], stage, X_AXIS, DT)
    t = np.arange(SUB_STEPS + 1) * DT
    ramp = np.minimum(t, 0.2)
    command = mean_command(speed_hz * (ramp**2 / 0.4 + t - ramp))
    load = np.zeros(SUB_STEPS)

    def run() -> int:
        return int(follow(parameters, axis_states(1), command, load, 32.0))

    assert run() == SUB_STEPS
    benchmark(run)
    benchmark.extra_info["sub_steps_per_s"] = SUB_STEPS / benchmark.stats["median"]


def test_a_pull_out_torque(benchmark: BenchmarkFixture) -> None:
    stage = Stage(supply_v=48, current_a=4.2, microsteps=10)
    torque_nm = benchmark(pull_out_torque, MOTORS["23HS32-4004S"], stage, 300.0)
    assert torque_nm > 1.0
