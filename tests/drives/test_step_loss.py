"""When an axis loses steps, how many, and how far it lags when it does not.

Default X axis: 23HS32-4004S at 4.2 A, 1600 microsteps a revolution, 5 mm lead, 20 kg, 0.12 Nm of friction.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from drives.axis import X_AXIS, trapezoid, travel
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.drives.curves import mean_command
from isel_twin.drives.library import MOTORS
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage
from tests.thorough import drawn

STAGE_48 = Stage(supply_v=48, current_a=4.2, microsteps=8)
STAGE_36 = Stage(supply_v=36, current_a=4.2, microsteps=8)
STAGE_36_DAMPED = Stage(supply_v=36, current_a=4.2, microsteps=8, damping_gain=2.0)


def distance_to_multiple_of_four(full_steps: float) -> float:
    return abs(full_steps - 4 * round(full_steps / 4))


@pytest.mark.parametrize(("stage", "load_nm"), [(STAGE_48, 0.0), (STAGE_48, 0.6), (STAGE_36_DAMPED, 0.6)])
def test_the_default_ramp_to_16000_hz_loses_nothing(stage: Stage, load_nm: float) -> None:
    outcome = travel(trapezoid(16_000, 300, 16_000, 100e3), stage, load_nm=load_nm)
    assert abs(outcome.lost_full_steps) < 0.5


def test_at_36_v_and_0_6_nm_15000_hz_hold_without_damping_and_16000_do_not() -> None:
    """A load that does not damp, on a stage that does not either: mid-band instability comes before pull-out."""
    assert abs(travel(trapezoid(16_000, 300, 15_000, 100e3), STAGE_36, load_nm=0.6).lost_full_steps) < 0.5
    assert travel(trapezoid(16_000, 300, 16_000, 100e3), STAGE_36, load_nm=0.6).lost_full_steps > 3.5


@pytest.mark.parametrize("load_nm", [0.0, 0.6])
def test_a_ramp_of_4000_hz_per_ms_to_16000_hz_loses_steps(load_nm: float) -> None:
    outcome = travel(trapezoid(16_000, 300, 16_000, 4e6), STAGE_48, load_nm=load_nm)
    assert outcome.lost_full_steps > 3.5


def test_40000_hz_is_more_than_the_axis_can_follow() -> None:
    assert travel(trapezoid(60_000, 300, 40_000, 100e3), STAGE_48).lost_full_steps > 3.5


@pytest.mark.parametrize("hz_per_s", [100e3, 1e6])
def test_20000_hz_is_within_reach_without_load(hz_per_s: float) -> None:
    assert abs(travel(trapezoid(20_000, 300, 20_000, hz_per_s), STAGE_48).lost_full_steps) < 0.1


@pytest.mark.parametrize(
    ("steps", "speed_hz", "hz_per_s"),
    [(16_001, 16_000, 8e6), (52_007, 40_000, 100e3), (33_016, 30_000, 4e6), (52_029, 40_000, 1e6)],
)
@pytest.mark.parametrize("screw", [Screw(), X_AXIS], ids=["bare", "X axis"])
def test_losses_are_multiples_of_four_full_steps(steps: int, speed_hz: float, hz_per_s: float, screw: Screw) -> None:
    """The torque repeats itself every four full steps, so that is where a slipped rotor is caught again."""
    lost = travel(trapezoid(steps, 300, speed_hz, hz_per_s), STAGE_48, screw=screw).lost_full_steps
    assert abs(lost) > 3.9
    assert distance_to_multiple_of_four(lost) < 0.1


@pytest.mark.parametrize("load_nm", [0.15, 0.3, 0.6, 1.0, 1.4])
def test_static_lag_is_the_arcsine_of_the_load(load_nm: float) -> None:
    """(2/pi) asin(T / Km I) full steps on a shaft without friction or detent."""
    motor = MOTORS["23HS32-4004S"]
    smooth = type(motor)(0.65, 3.2e-3, motor.torque_constant_nm_per_a, 5.3e-5, detent_torque_nm=0.0)
    outcome = travel(trapezoid(800, 300, 2000, 20e3), STAGE_48, motor=smooth, screw=Screw(), load_nm=load_nm)
    expected = 2 / math.pi * math.asin(load_nm / (motor.torque_constant_nm_per_a * 4.2))
    assert outcome.lost_full_steps == pytest.approx(expected, rel=0.01)


@pytest.mark.parametrize("load_nm", [0.3, 0.6, 1.0, 1.4])
def test_detent_changes_the_static_lag_by_less_than_5_percent_over_a_full_step(load_nm: float) -> None:
    """Averaged over the eight microsteps of a full step; the detent has a period of one full step."""
    motor = MOTORS["23HS32-4004S"]
    lags = [
        travel(trapezoid(800 + k, 300, 2000, 20e3), STAGE_48, screw=Screw(), load_nm=load_nm).lost_full_steps
        for k in range(8)
    ]
    expected = 2 / math.pi * math.asin(load_nm / (motor.torque_constant_nm_per_a * 4.2))
    assert np.mean(lags) == pytest.approx(expected, rel=0.05)


def test_the_lag_after_a_move_stays_within_the_friction_band() -> None:
    """Sticking may hold the rotor off by asin(breakaway / Km I), detent adding its share; nothing creeps."""
    band = 2 / math.pi * math.asin((0.12 * 1.3 + 0.06) / (MOTORS["23HS32-4004S"].torque_constant_nm_per_a * 4.2))
    outcome = travel(trapezoid(3203, 300, 4000, 50e3), STAGE_48)
    assert outcome.at_rest
    assert abs(outcome.lost_full_steps) <= band


@given(st.lists(st.floats(0.0, 30.0), min_size=1, max_size=40))
@settings(max_examples=drawn(200), deadline=None)
def test_mean_command_is_the_time_mean_of_the_counter(increments: list[float]) -> None:
    """Against a sum over a fine grid of the counter floor(phase)."""
    phase = np.concatenate([[0.0], np.cumsum(increments)])
    fine = 20_000
    for k, mean in enumerate(mean_command(phase)):
        within = phase[k] + (np.arange(fine) + 0.5) / fine * (phase[k + 1] - phase[k])
        assert mean == pytest.approx(np.floor(within).mean(), abs=31 / fine)


def test_a_pulse_acts_from_where_it_falls_in_the_sub_step() -> None:
    """A pulse after a fifth of the sub-step counts for four fifths of it."""
    assert mean_command(np.array([0.9, 1.4, 2.0, 2.0])) == pytest.approx([0.8, 1.0, 2.0])
