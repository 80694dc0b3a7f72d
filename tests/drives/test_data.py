"""Motors, stages and screws as data: what a data sheet says comes out, and what makes no sense is refused."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import pytest

from isel_twin.drives.curves import pull_out_prediction, pull_out_torque
from isel_twin.drives.library import MOTORS
from isel_twin.drives.motor import Motor, Specimen, from_datasheet
from isel_twin.drives.screw import Screw
from isel_twin.drives.stage import Stage


def test_holding_torque_is_measured_with_both_phases_on() -> None:
    """Km = T_hold / (sqrt 2 I): 2.40 Nm at 4.0 A give 0.424 Nm/A, 1.236 Nm at 2.8 A give 0.312 Nm/A."""
    assert MOTORS["23HS32-4004S"].torque_constant_nm_per_a == pytest.approx(0.4243, abs=1e-4)
    assert MOTORS["57HS56-2804"].torque_constant_nm_per_a == pytest.approx(0.3121, abs=1e-4)


@pytest.mark.parametrize(
    ("name", "resistance_ohm", "inductance_h", "inertia_gcm2", "full_steps"),
    [
        ("23HS32-4004S", 0.65, 3.2e-3, 530, 200),
        ("57HS56-2804", 1.1, 3.0e-3, 300, 200),
        ("23HS22-2804S", 0.92, 2.68e-3, 300, 200),
        ("cnc3d-NEMA23", 1.2, 4.0e-3, 600, 200),
        ("57STH56-2804MAC", 1.1, 3.4e-3, 305, 400),
    ],
)
def test_table_of_motors(
    name: str, resistance_ohm: float, inductance_h: float, inertia_gcm2: float, full_steps: int
) -> None:
    motor = MOTORS[name]
    assert (motor.resistance_ohm, motor.inductance_h) == (resistance_ohm, inductance_h)
    assert motor.rotor_inertia_kgm2 == pytest.approx(inertia_gcm2 * 1e-7)
    assert motor.full_steps_per_rev == full_steps


def test_a_rewound_motor_is_the_same_iron() -> None:
    """Twice the turns at half the current: R and L four times, Km twice; detent and drag torque stay."""
    motor = from_datasheet(2.0, 4.0, 0.6, 2e-3, 5e-5)
    rewound = from_datasheet(2.0, 2.0, 2.4, 8e-3, 5e-5)
    assert rewound.torque_constant_nm_per_a == pytest.approx(2 * motor.torque_constant_nm_per_a)
    assert rewound.detent_torque_nm == pytest.approx(motor.detent_torque_nm)
    assert rewound.iron_drag_nm_s_per_rad == pytest.approx(motor.iron_drag_nm_s_per_rad)


def test_the_rated_current_is_peak_or_rms_by_name() -> None:
    """Km is the same; the peak of the microstep wave is the printed current, or 41 % more."""
    peak = from_datasheet(2.0, 4.0, 0.6, 2e-3, 5e-5)
    rms = from_datasheet(2.0, rated_current_rms_a=4.0, resistance_ohm=0.6, inductance_h=2e-3, rotor_inertia_kgm2=5e-5)
    assert peak.rated_current_a == 4.0
    assert rms.rated_current_a == pytest.approx(5.657, abs=1e-3)
    assert rms.torque_constant_nm_per_a == peak.torque_constant_nm_per_a == pytest.approx(0.35355, abs=1e-5)
    for currents in ({}, {"rated_current_a": 4.0, "rated_current_rms_a": 2.8}):
        with pytest.raises(ValueError, match=r"either rated_current_a .peak. or rated_current_rms_a"):
            from_datasheet(2.0, resistance_ohm=0.6, inductance_h=2e-3, rotor_inertia_kgm2=5e-5, **currents)


@pytest.mark.parametrize(
    ("name", "running_nm", "said"),
    [
        ("rated_current_a", 1.83, None),  # curve A at 4.2 A: 1.83 Nm; the sheet means the peak
        ("rated_current_a", 2.30, "does not fit 4 A as peak (1.7 Nm at most); it fits RMS: give rated_current_rms_a"),
        ("rated_current_rms_a", 2.30, None),
        ("rated_current_rms_a", 1.70, "does not fit 4 A as RMS (2.4 Nm at most); it fits peak: give rated_current_a"),
        ("rated_current_a", 3.50, "does not fit 4 A as peak (1.7 Nm at most); nor does it fit RMS"),
        ("rated_current_a", math.nan, None),
    ],
)
def test_a_current_that_fits_the_torques_in_one_meaning_only_is_told(
    caplog: pytest.LogCaptureFixture, name: str, running_nm: float, said: str | None
) -> None:
    """23HS32-4004S: holding torque 2.40 Nm at 4.0 A, so 1.70 Nm in microstep at 4 A peak and 2.40 Nm at 4 A RMS."""
    rest = {"resistance_ohm": 0.65, "inductance_h": 3.2e-3, "rotor_inertia_kgm2": 5.3e-5}
    from_datasheet(2.40, **{name: 4.0}, **rest, running_torque_nm=running_nm)
    lines = [record.getMessage() for record in caplog.records]
    assert len(lines) == (said is not None)
    assert said is None or said in lines[0]


def test_default_detent_is_in_the_range_of_data_sheets() -> None:
    """Stated: 0.039 Nm for the 57HS56, 0.09 for a 2.45 Nm motor; the rule must come within a factor 1.5."""
    for name in ("57HS56-2804", "cnc3d-NEMA23"):
        stated = MOTORS[name]
        by_rule = dataclasses.replace(stated, detent_torque_nm=math.nan).detent_torque_nm
        assert 1 / 1.5 < by_rule / stated.detent_torque_nm < 1.5


@pytest.mark.parametrize(
    ("make", "values", "named"),
    [
        (Motor, (0.0, 3e-3, 0.4, 5e-5), "resistance_ohm"),
        (Motor, (0.65, -3e-3, 0.4, 5e-5), "inductance_h"),
        (Motor, (0.65, 3e-3, math.nan, 5e-5), "torque_constant_nm_per_a"),
        (Motor, (0.65, 3e-3, 0.4, math.inf), "rotor_inertia_kgm2"),
        (Motor, (0.65, 3e-3, 0.4, 5e-5, -0.1), "detent_torque_nm"),
        (Motor, (0.65, 3e-3, 0.4, 5e-5, 0.1, 0.0), "iron_loss_ohm"),
        (Motor, (0.65, 3e-3, 0.4, 5e-5, 0.1, 40.0, 0), "pole_pairs"),
        (Stage, (0.0, 4.0), "supply_v"),
        (Stage, (48.0, -4.0), "current_a"),
        (Stage, (48.0, 4.0, 0), "microsteps"),
        (Stage, (48.0, 4.0, 2.5), "microsteps"),
        (Stage, (48.0, 4.0, 8, 1.5), "idle_current_fraction"),
        (Screw, (-1e-5,), "inertia_kgm2"),
        (Screw, (0.0, math.nan), "coulomb_nm"),
        (Screw, (0.0, 0.1, 0.9), "breakaway_ratio"),
    ],
)
def test_a_value_that_makes_no_sense_is_named(make: Any, values: tuple[float, ...], named: str) -> None:
    with pytest.raises(ValueError, match=named):
        make(*values)


def test_values_are_frozen() -> None:
    with pytest.raises(dataclasses.FrozenInstanceError):
        Stage(48.0, 4.0).supply_v = 24.0  # type: ignore[misc]


def test_a_holding_torque_below_the_back_emf_is_saturation() -> None:
    """At the current of the sheet, both phases on, the torque is the sheet's; without current Km is the back-EMF's."""
    motor = from_datasheet(1.0, 5.0, 0.5, 2e-3, 1e-4, back_emf_v_s_per_rad=0.2)
    both_a = math.sqrt(2.0) * 5.0
    assert motor.torque_constant_nm_per_a == 0.2
    assert motor.at_current(both_a).torque_constant_nm_per_a * both_a == pytest.approx(1.0, rel=1e-12)
    assert motor.at_current(1e-6).torque_constant_nm_per_a == pytest.approx(0.2)
    assert motor.at_current(both_a).iron_drag_nm_s_per_rad == pytest.approx(motor.iron_drag_nm_s_per_rad)


def test_two_figures_that_say_the_same_make_no_saturation() -> None:
    motor = from_datasheet(math.sqrt(2.0), 5.0, 0.5, 2e-3, 1e-4, back_emf_v_s_per_rad=0.202)
    assert math.isinf(motor.saturation_current_a)


def test_a_back_emf_that_is_too_small_for_the_holding_torque_is_refused() -> None:
    with pytest.raises(ValueError, match=r"needs a back-EMF of 0\.141 V s/rad, not 0\.1: is that the amplitude of one"):
        from_datasheet(1.0, 5.0, 0.5, 2e-3, 1e-4, back_emf_v_s_per_rad=0.1)


def test_a_saturated_motor_is_as_weak_on_the_bench_as_in_the_closed_form() -> None:
    """Far below all limits of the supply the torque is Km(I) I, less what the iron takes."""
    motor = dataclasses.replace(MOTORS["23HS32-4004S"], saturation_current_a=4.2, detent_torque_nm=0.0)
    stage = Stage(supply_v=48.0, current_a=4.2, microsteps=10, damping_gain=2.0)
    expected = motor.torque_constant_nm_per_a / math.sqrt(2.0) * 4.2 - motor.iron_torque_nm(math.pi)
    assert pull_out_torque(motor, stage, 30.0) == pytest.approx(expected, rel=0.02)
    assert pull_out_prediction(motor, stage, 30.0) == pytest.approx(expected, rel=0.02)


@pytest.mark.parametrize(
    ("kind", "share", "gain"), [("slow", 0, 0), ("mixed", 0.6, 0), ("fast", 1, 0), ("digital", 1, 2)]
)
def test_kinds_of_stages(kind: str, share: float, gain: float) -> None:
    stage = Stage(supply_v=48.0, current_a=4.2, kind=kind)
    assert (stage.fast_share, stage.damping_gain) == (share, gain)


def test_a_current_is_its_peak_and_its_rms_value() -> None:
    assert Stage(supply_v=48.0, current_a=4.2).current_rms_a == pytest.approx(2.97, abs=0.001)


@pytest.mark.parametrize(
    ("factor", "number"),
    [
        ("resistance", "resistance_ohm"),
        ("inductance", "inductance_h"),
        ("torque_constant", "torque_constant_nm_per_a"),
        ("rotor_inertia", "rotor_inertia_kgm2"),
        ("detent_torque", "detent_torque_nm"),
        ("iron_knee", "iron_knee_rad_s"),
    ],
)
def test_a_specimen_differs_from_its_sheet_by_its_factor(factor: str, number: str) -> None:
    sheet = MOTORS["23HS32-4004S"]
    assert getattr(Specimen(**{factor: 1.5}).of(sheet), number) == pytest.approx(1.5 * getattr(sheet, number))
