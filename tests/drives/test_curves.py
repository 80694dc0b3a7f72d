"""Torque curves against the makers' (published.py), a closed form written out here once more, and a data sheet's
starting rate."""

from __future__ import annotations

import itertools
import math
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from drives.published import CURVE_C, CURVE_D, DRIVE_C, DRIVE_D, POINTS, dm542t

from isel_twin.drives.curves import (
    pull_in_rate,
    pull_out_envelope,
    pull_out_prediction,
    pull_out_predictions,
    pull_out_torque,
    resonance_hz,
    starts_in_step,
)
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor, from_datasheet
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage

pytestmark = pytest.mark.long(seconds=7)

torque = cache(pull_out_torque)
"""Several tests look at the same places."""

NEMA23 = MOTORS["23HS32-4004S"]
FOUR_FIELDS = Motor(
    resistance_ohm=0.65,
    inductance_h=3.2e-3,
    torque_constant_nm_per_a=2.4 / (math.sqrt(2) * 4.0),
    rotor_inertia_kgm2=5.3e-5,
)
UNFITTED = Motor(0.65, 3.2e-3, 2.4 / (math.sqrt(2) * 4.0), 5.3e-5, iron_loss_ohm=math.inf)
NEMA17 = from_datasheet(0.52, 2.0, 1.4, 3.0e-3, 82e-7)
NEMA14 = from_datasheet(0.23, 0.5, 15.0, 26e-3, 18e-7)


@pytest.mark.parametrize(("supply_v", "rpm", "published_nm"), POINTS)
@pytest.mark.parametrize("motor", [NEMA23, FOUR_FIELDS], ids=["table", "four fields"])
def test_curve_a_is_met_within_10_percent(motor: Motor, supply_v: float, rpm: float, published_nm: float) -> None:
    assert torque(motor, dm542t(supply_v), rpm) == pytest.approx(published_nm, rel=0.10)


@pytest.mark.parametrize(("rpm", "published_nm"), CURVE_D.items())
def test_curve_d_is_met_within_15_percent(rpm: float, published_nm: float) -> None:
    """To 1500 rev/min; 1300 was asked for."""
    assert torque(NEMA17, DRIVE_D, rpm) == pytest.approx(published_nm, rel=0.15)


@pytest.mark.parametrize(("half_steps_hz", "published_gcm"), CURVE_C.items())
def test_curve_c_is_predicted_within_25_percent(half_steps_hz: float, published_gcm: float) -> None:
    """From 90 to 450 rev/min, from the data sheet alone."""
    found_nm = torque(NEMA14, DRIVE_C, half_steps_hz * 60 / 400)
    assert found_nm == pytest.approx(published_gcm * 9.80665e-5, rel=0.25)


@pytest.mark.parametrize(("supply_v", "rpm", "published_nm"), [p for p in POINTS if p[1] <= 300])
def test_up_to_300_rpm_nothing_needs_to_be_fitted(supply_v: float, rpm: float, published_nm: float) -> None:
    ideal = dm542t(supply_v, supply_factor=1.0, damping_gain=0.0, extra_resistance_ohm=0.0)
    assert torque(UNFITTED, ideal, rpm) == pytest.approx(published_nm, rel=0.08)


@pytest.mark.parametrize("rpm", [210, 390, 600, 750, 900, 1200])
@pytest.mark.parametrize(
    ("motor", "stage"), [(NEMA23, dm542t(36)), (NEMA23, dm542t(48)), (NEMA17, DRIVE_D)], ids=["A 36 V", "A 48 V", "D"]
)
def test_on_a_drive_that_damps_the_kind_of_load_does_not_matter(motor: Motor, stage: Stage, rpm: float) -> None:
    """A brake damps and a constant load does not: within 5 % they agree."""
    brake = torque(motor, stage, rpm)
    assert torque(motor, stage, rpm, constant_load=True) == pytest.approx(brake, rel=0.05)


@pytest.fixture(scope="module")
def curves() -> dict[int, list[float]]:
    """Torque every 60 rpm from 300 to 1200 rpm at both supplies."""
    return {v: [torque(NEMA23, dm542t(v), rpm) for rpm in range(300, 1201, 60)] for v in (36, 48)}


def test_torque_falls_with_speed_above_the_knee(curves: dict[int, list[float]]) -> None:
    """The supply takes over at 300 rev/min (36 V) and 420 (48 V) from the current, and at 420 for curve D's motor."""
    small = [torque(NEMA17, DRIVE_D, rpm) for rpm in range(420, 1501, 60)]
    for curve in (curves[36], curves[48][2:], small):
        assert all(faster < slower for slower, faster in itertools.pairwise(curve))


def test_more_voltage_never_means_less_torque(curves: dict[int, list[float]]) -> None:
    assert all(high >= low for low, high in zip(curves[36], curves[48], strict=True))


def envelope_nm(motor: Motor, voltage_v: float, current_a: float, resistance_ohm: float, rpm: float) -> float:
    """Acarnley's phasor diagram for a microstepped motor (sine current, square voltage), with iron drag."""
    w = rpm * math.pi / 30
    we, km = 50 * w, motor.torque_constant_nm_per_a
    z2 = resistance_ohm**2 + (we * motor.inductance_h) ** 2
    by_voltage = km * (4 / math.pi) * voltage_v / math.sqrt(z2) - 50 * we * (km / 50) ** 2 * resistance_ohm / z2
    return min(km * current_a, by_voltage) - km**2 / motor.iron_loss_ohm * w / (1 + (w / motor.iron_knee_rad_s) ** 2)


@pytest.mark.parametrize("supply_v", [36, 48])
@pytest.mark.parametrize("rpm", [60, 150, 300, 450, 600, 750, 900])
def test_the_closed_form_bounds_the_bench(supply_v: float, rpm: float) -> None:
    stage = dm542t(supply_v)
    bound = envelope_nm(NEMA23, 0.5 * (0.82 + 1.0) * supply_v, 4.2, 0.65 + stage.extra_resistance_ohm, rpm)
    assert torque(NEMA23, stage, rpm) <= 1.05 * bound
    assert pull_out_envelope(NEMA23, stage, rpm) == pytest.approx(bound, rel=0.005)


@pytest.mark.parametrize("rpm", [30, 210, 390, 600, 900, 1200])
@pytest.mark.parametrize(
    ("motor", "stage"), [(NEMA23, dm542t(36)), (NEMA23, dm542t(48)), (NEMA17, DRIVE_D)], ids=["A 36 V", "A 48 V", "D"]
)
def test_the_prediction_needs_no_motion(motor: Motor, stage: Stage, rpm: float) -> None:
    """Both limits at once, in closed form: within 6 % of a bench on which nothing swings."""
    assert pull_out_prediction(motor, stage, rpm) == pytest.approx(torque(motor, stage, rpm), rel=0.06)


OTHER_SIZES = {
    "NEMA 14, 14HS13-0804S": (from_datasheet(0.18, 0.8, 6.8, 10e-3, 13e-7), 24.0),
    "NEMA 24, 24HS39-4204S": (from_datasheet(4.0, 4.2, 0.75, 3.2e-3, 900e-7), 48.0),
    "NEMA 34, 34HS59-6004S": (from_datasheet(12.0, 6.0, 0.8, 7.3e-3, 4000e-7), 72.0),
}
"""Catalogue figures (holding torque, current, R, L, inertia), rounded; a tenth to five times the torque."""


@pytest.mark.parametrize("name", OTHER_SIZES)
def test_motors_of_other_sizes_hold_nine_tenths_of_the_prediction_at_every_speed(name: str) -> None:
    """Nothing was chosen on them. From 60 to 1500 rev/min, against a brake, on a drive that damps: none drops out."""
    motor, supply_v = OTHER_SIZES[name]
    stage = Stage(supply_v=supply_v, current_a=motor.rated_current_a, microsteps=10, damping_gain=2.0)
    for rpm in range(60, 1501, 180):
        assert torque(motor, stage, rpm) > 0.9 * pull_out_prediction(motor, stage, rpm), rpm


@pytest.mark.parametrize("rpm", [30, 210, 390, 600, 900, 1200, 1500])
@pytest.mark.parametrize("supply_v", [24, 36, 48])
def test_the_prediction_is_the_best_of_a_search_over_the_current_vector(supply_v: float, rpm: float) -> None:
    """Every vector in the plane that neither limit forbids, the voltage being the clipped sine of what is asked for."""
    stage, motor = dm542t(supply_v), NEMA23
    w = rpm * math.pi / 30
    x = np.linspace(-1, 0.2, 1201)[:, None] * 4.2 + 1j * np.linspace(0, 1, 1001)[None, :] * 4.2
    x *= math.sin(math.pi / 40) / (math.pi / 40)  # ten microsteps a full step stand still between pulses
    asked = 4.2 * math.sin(math.pi / 40) / (math.pi / 40)
    volts = np.abs((0.85 + 1j * 50 * w * 3.2e-3) * x + 1j * w * motor.torque_constant_nm_per_a)
    limit = 0.5 * (0.82 + 1.0) * supply_v

    def best(volt_limit: float) -> complex:
        allowed = (np.abs(x) <= asked) & (volts <= volt_limit)
        top = x[allowed].imag.max()
        return complex(x[allowed & (x.imag == top)].mean())

    i = best(limit)
    if abs(i) < 0.998 * asked:
        s = abs(i) / asked
        i = best(limit * 2 / math.pi * (math.asin(s) / s + math.sqrt(1 - s * s)))
    drag = motor.torque_constant_nm_per_a**2 / motor.iron_loss_ohm * w / (1 + (w / 72.0) ** 2)
    expected = motor.torque_constant_nm_per_a * i.imag - drag
    assert pull_out_prediction(motor, stage, rpm) == pytest.approx(expected, abs=0.012)


@pytest.mark.parametrize(("microsteps", "factor"), [(1, math.sqrt(2)), (2, 1.207), (10, 1.0), (64, 1.0)])
def test_slow_torque_is_that_of_the_current_wave(microsteps: int, factor: float) -> None:
    """Turning slowly against a brake a motor gives the mean of its holding torque: full > half > microstep."""
    stage = Stage(supply_v=48, current_a=4.0, microsteps=microsteps)
    hold = factor * NEMA23.torque_constant_nm_per_a * 4.0
    slow_nm = torque(NEMA23, stage, 60)
    assert 0.85 * hold < slow_nm < hold
    assert slow_nm <= 1.05 * pull_out_envelope(NEMA23, stage, 60)


def test_standstill_torque_is_the_torque_constant_times_current() -> None:
    assert torque(NEMA23, dm542t(48), 0) == pytest.approx(NEMA23.torque_constant_nm_per_a * 4.2, rel=0.01)


@pytest.mark.parametrize(("supply_v", "rpm"), [(36, 90), (36, 300), (36, 510), (36, 600), (48, 390), (48, 600)])
def test_halving_the_sub_step_changes_little(supply_v: float, rpm: float) -> None:
    stage = dm542t(supply_v)
    coarse = torque(NEMA23, stage, rpm)
    assert torque(NEMA23, stage, rpm, dt_s=12.5e-6) == pytest.approx(coarse, rel=0.02)


def test_the_inertia_on_the_bench_matters_little() -> None:
    light = torque(NEMA23, dm542t(48), 510, 0.0)
    assert torque(NEMA23, dm542t(48), 510, 3e-4) == pytest.approx(light, rel=0.03)


def test_a_load_without_damping_brings_out_mid_band_instability() -> None:
    """Where the supply limits the current, a motor that nothing damps swings itself out of step."""
    stage = dm542t(36, damping_gain=0.0)
    assert torque(NEMA23, stage, 700, constant_load=True) < 0.8 * torque(NEMA23, stage, 700)
    slow = torque(NEMA23, stage, 240)
    assert torque(NEMA23, stage, 240, constant_load=True) == pytest.approx(slow, rel=0.02)


def test_pull_in_rate_of_the_57hs56_is_the_data_sheets() -> None:
    """Data sheet: starts at 2500 half steps/s, a figure with a margin."""
    motor = MOTORS["57HS56-2804"]
    for supply_v in (24, 32, 36, 48):
        assert 2500 < pull_in_rate(motor, Stage(supply_v=supply_v, current_a=2.8, microsteps=2)) < 3500


def test_pull_in_rate_falls_with_inertia_and_load() -> None:
    motor, stage = MOTORS["57HS56-2804"], Stage(supply_v=36, current_a=2.8, microsteps=2)
    bare = pull_in_rate(motor, stage)
    heavy = pull_in_rate(motor, stage, load_inertia_kgm2=9e-5)
    assert heavy == pytest.approx(bare / math.sqrt(1.2e-4 / 0.3e-4), rel=0.2)  # rate^2 J: constant, in essence
    assert pull_in_rate(motor, stage, load_torque_nm=0.3) < bare


def test_pull_in_rate_counts_the_stages_own_steps() -> None:
    motor = MOTORS["57HS56-2804"]
    full, half = (pull_in_rate(motor, Stage(supply_v=36, current_a=2.8, microsteps=m)) for m in (1, 2))
    assert half == pytest.approx(2 * full, rel=0.15)


@pytest.mark.parametrize("microsteps", [8, 64])
def test_finer_steps_start_at_the_same_speed(microsteps: int) -> None:
    motor = MOTORS["57HS56-2804"]
    half, fine = (pull_in_rate(motor, Stage(36, 2.8, m)) / m for m in (2, microsteps))
    assert fine == pytest.approx(half, rel=0.15)


def test_a_motor_that_cannot_hold_the_load_starts_at_no_rate() -> None:
    assert pull_in_rate(MOTORS["57HS56-2804"], Stage(36, 2.8, 2), load_torque_nm=3.0) == 0.0


def test_natural_frequency() -> None:
    """Bare 57HS56 rotor at full hold: sqrt(50 * 1.236 / 3e-5) / 2 pi = 228 Hz."""
    stage = Stage(supply_v=36, current_a=2.8, microsteps=1)
    assert resonance_hz(MOTORS["57HS56-2804"], stage) == pytest.approx(228.4, abs=0.5)


def test_full_step_starts_fail_in_the_resonance_band_of_the_bare_motor() -> None:
    """Near the natural frequency (228 Hz) and at half of it, but neither below nor between."""
    motor, stage = MOTORS["57HS56-2804"], Stage(supply_v=36, current_a=2.8, microsteps=1)
    failed = [hz for hz in range(40, 321, 20) if not starts_in_step(motor, stage, hz)]
    assert any(80 <= hz <= 130 for hz in failed)
    assert {200, 220, 240} <= set(failed)
    assert not [hz for hz in failed if hz < 80 or 140 < hz < 170 or hz > 260]


def test_half_step_starts_hold_on_the_loaded_axis() -> None:
    """57HS56 at 2 A, 32 V on a 10 mm screw with 15 kg and an axis' friction: only full step has a band (110 Hz)."""
    motor = MOTORS["57HS56-2804"]
    axis = Screw(inertia_kgm2=15 * (0.010 / (2 * math.pi)) ** 2 + 2.5e-5 + 5e-6, coulomb_nm=0.02)
    full, half = (Stage(supply_v=32, current_a=2.0, microsteps=m) for m in (1, 2))
    rates = range(40, 501, 20)
    assert [hz for hz in rates if not starts_in_step(motor, full, hz, axis)]
    assert not [hz for hz in rates if not starts_in_step(motor, half, 2 * hz, axis)]


@pytest.mark.parametrize("speed_rpm", [-1.0, math.inf, math.nan])
def test_a_speed_that_makes_no_sense_is_refused(speed_rpm: float) -> None:
    with pytest.raises(ValueError, match="speed_rpm"):
        pull_out_torque(NEMA23, dm542t(48), speed_rpm)


@pytest.mark.parametrize("rate_hz", [0.0, -5.0, math.inf, math.nan])
def test_a_rate_that_makes_no_sense_is_refused(rate_hz: float) -> None:
    with pytest.raises(ValueError, match="rate_hz"):
        starts_in_step(NEMA23, dm542t(48), rate_hz)


def predicted_nm(motor: Motor, stage: Stage, rpm: float, current_a: float) -> float:
    """The second closed form in complex numbers; current_a: g I."""
    w, km = rpm * 2.0 * math.pi / 60.0, motor.torque_constant_nm_per_a
    impedance = complex(motor.resistance_ohm + stage.extra_resistance_ohm, motor.pole_pairs * w * motor.inductance_h)
    centre, radius = -1j * w * km / impedance, 0.5 * (stage.drive_v + stage.supply_v) / abs(impedance)

    def highest(radius: float) -> complex:
        top = centre + 1j * radius
        if abs(1j * current_a - centre) <= radius:
            return 1j * current_a
        if abs(top) <= current_a:
            return top
        along = (current_a**2 - radius**2 + abs(centre) ** 2) / (2.0 * abs(centre))
        if along >= current_a:
            return 0j
        crossings = (
            centre / abs(centre) * complex(along, sign * math.sqrt(current_a**2 - along**2)) for sign in (1, -1)
        )
        return max(crossings, key=lambda i: i.imag)

    i = highest(radius)
    if 0.0 < abs(i) < current_a * (1.0 - 1e-9):
        x = current_a / abs(i)
        i = highest(radius * 2.0 / math.pi * (x * math.asin(1.0 / x) + math.sqrt(1.0 - 1.0 / x**2)))
    return max(0.0, km * i.imag - motor.iron_torque_nm(w))


@pytest.mark.parametrize("stage", [Stage(48.0, 4.2), Stage(24.0, 2.0, microsteps=2), Stage(80.0, 3.0, microsteps=1)])
def test_the_prediction_is_its_closed_form_at_every_speed(stage: Stage) -> None:
    rpm = np.linspace(0.0, 4900.0, 400)
    motor = replace(NEMA23, iron_loss_ohm=31.7, iron_knee_rad_s=8.3).at_current(stage.vector_a)
    half_step = math.pi / 4 / stage.microsteps
    current_a = stage.vector_a * math.sin(half_step) / half_step
    expected = [predicted_nm(motor, stage, speed, current_a) for speed in rpm.tolist()]
    found = pull_out_predictions(motor, stage, rpm)
    assert found.max() > 0.3
    assert found == pytest.approx(expected, rel=1e-12, abs=1e-12)
    assert pull_out_prediction(motor, stage, 300.0) == pull_out_predictions(motor, stage, np.array([300.0]))[0]
