"""Motion of the default machine: what follows, what is lost, what rings. Figures from data sheets and closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from .conftest import FULL_STEP, MS, NONE, PERIOD, ramp_ns, ticks

NEWTON_PER_NM = 2.0 * math.pi / 5e-3
"""Force at the nut of a 5 mm screw for one newton metre at the shaft, without losses."""


def multiple_of_a_period(lost: float) -> bool:
    """Within a tenth of a full step of a whole number of torque periods."""
    return abs(lost / PERIOD - round(lost / PERIOD)) * 4.0 < 0.1


def test_all_axes_arrive_where_they_are_sent(bench):
    b = bench()
    b.move((16000, 16000, 16000), 10000)
    b.wait(1500)
    np.testing.assert_allclose(b.plant.position_mm, (150.0, 150.0, 80.0), atol=0.03)
    assert np.all(np.abs(b.lost) < FULL_STEP / 2)
    b.move((-16000, -16000, -16000), 10000)
    b.wait(1500)
    np.testing.assert_allclose(b.plant.position_mm, (100.0, 100.0, 30.0), atol=0.03)


def test_default_ramp_holds_with_extra_load(bench):
    b = bench(start_mm=(20.0, 100.0, 30.0))
    b.plant.apply_force(0, -0.6 * NEWTON_PER_NM)
    b.wait(100)
    b.move((32000, 0, 0), 16000)
    b.plant.apply_force(0, 0.0)
    b.wait(1000)
    assert abs(b.lost[0]) < FULL_STEP / 2


@pytest.mark.parametrize("hz_per_ms", [1000, 2000])
def test_steep_ramp_that_still_holds(bench, hz_per_ms):
    b = bench(start_mm=(20.0, 100.0, 30.0))
    b.move((16000, 0, 0), 16000, hz_per_ms=hz_per_ms)
    b.wait(1000)
    assert abs(b.lost[0]) < FULL_STEP / 2


@pytest.mark.parametrize("axis", [0, 1])
def test_too_steep_ramp_loses_whole_periods(bench, axis):
    b = bench(start_mm=(20.0, 20.0, 20.0))
    steps = [0, 0, 0]
    steps[axis] = 16000
    b.move(steps, 16000, hz_per_ms=4000)
    b.wait(1500)
    assert b.lost[axis] >= PERIOD
    assert multiple_of_a_period(b.lost[axis])


def test_speed_beyond_the_motor_loses_steps(bench):
    b = bench(start_mm=(20.0, 100.0, 30.0))
    b.move((32000, 0, 0), 40000)
    b.wait(1500)
    assert b.lost[0] >= PERIOD
    assert multiple_of_a_period(b.lost[0])
    assert b.plant.position_mm[0] == pytest.approx(20.0 + (32000 - b.lost[0]) / 320.0, abs=0.03)


def test_a_axis_follows_its_counter(bench):
    b = bench()
    t_ns = np.arange(1, 11, dtype=np.int64) * MS
    b.feed(11 * MS, t_ns, ticks(10, 0, 0, 0, -1))
    assert b.plant.commanded.tolist() == [0, 0, 0, -10]
    assert b.plant.rotor[3] == -10.0


def test_half_steps_are_a_setting(bench):
    b = bench({"axes.all.steps_per_rev": 400})
    b.move((4000, 4000, 4000), 2400, hz_per_ms=75)
    b.wait(1500)
    np.testing.assert_allclose(b.plant.position_mm, (150.0, 150.0, 80.0), atol=0.03)


def test_lost_phase_loses_steps(bench):
    b = bench()
    b.plant.set_phase_lost(0, "a")
    b.move((3200, 0, 0), 5000)
    b.wait(1500)
    assert abs(b.lost[0]) >= PERIOD / 2
    with pytest.raises(ValueError, match="a, b, ab"):
        b.plant.set_phase_lost(0, "c")


def test_static_lag_follows_the_arcsine(tmp_path, bench):
    """lag = (2 / pi) asin(T / T_peak) full steps: a motor without detent on an axis without friction, pushed."""
    number = '{{ value = {}, unit = "{}", grade = "setting", source = "test" }}'
    (tmp_path / "machine.toml").write_text(
        'name = "ideal"\nbased_on = "4030"\n[motors.ideal]\n'
        + "".join(
            f"{key} = {number.format(value, unit)}\n"
            for key, value, unit in (
                ("resistance_ohm", 0.65, "ohm"),
                ("inductance_h", 3.2e-3, "H"),
                ("torque_constant_nm_per_a", 0.424, "N m/A"),
                ("rotor_inertia_kgm2", 5.3e-5, "kg m2"),
                ("detent_torque_nm", 0.0, "N m"),
            )
        )
        + '[axes.x]\nmotor = "ideal"\n'
    )
    free = {f"axes.x.{key}": 0.0 for key in ("shaft_coulomb", "guide_friction", "backlash")}
    b = bench({**free, "axes.x.efficiency": 1.0}, machine=tmp_path, lowering=False)
    for torque_nm in (0.3, 0.6, 1.2):
        b.plant.apply_force(0, -torque_nm * NEWTON_PER_NM)
        b.wait(2000)
        expected = 2.0 / math.pi * math.asin(torque_nm / (0.424 * 4.2))
        assert b.lost[0] / FULL_STEP == pytest.approx(expected, rel=0.05)


def test_current_is_lowered_after_its_delay_and_comes_back_with_a_pulse(bench):
    """Half the current is half the holding torque: 1.1 N m are held in the delay (peak 1.78) and not after it."""
    b = bench({"axes.x.guide_friction": 0.0, "axes.x.shaft_coulomb": 0.0})
    b.move((32, 0, 0), 1000)
    b.plant.apply_force(0, -1.1 * NEWTON_PER_NM)
    b.wait(195)
    assert abs(b.lost[0]) < 1.5 * FULL_STEP
    b.wait(100)
    assert b.lost[0] > PERIOD
    kept = bench({"axes.x.guide_friction": 0.0, "axes.x.shaft_coulomb": 0.0}, lowering=False)
    kept.plant.apply_force(0, -1.1 * NEWTON_PER_NM)
    kept.wait(1000)
    assert abs(kept.lost[0]) < 1.5 * FULL_STEP


def ring_down(b, axis: int, top_hz: float = 2000.0) -> tuple[float, float]:
    """Frequency in Hz and damping ratio after a stop without ramp: half periods and logarithmic decrement."""
    t_ns = ramp_ns(12800, top_hz)[:6400]
    b.feed(int(t_ns[-1]), t_ns, ticks(len(t_ns), *np.eye(3, dtype=int)[axis]))
    b.wait(100)
    trace = []
    for _ in range(4000):
        b.wait(0.1)
        trace.append(b.plant.position_mm[axis])
    b.wait(3000)
    swing = np.array(trace) - b.plant.position_mm[axis]
    peaks = [
        (k, abs(swing[k]))
        for k in range(1, len(swing) - 1)
        if abs(swing[k]) >= max(abs(swing[k - 1]), abs(swing[k + 1])) and abs(swing[k]) > 0.02 * abs(swing).max()
    ]
    times, heights = np.array(peaks).T
    spacing, _ = np.polyfit(np.arange(len(times)), times, 1)
    slope, _ = np.polyfit(np.arange(len(times)), np.log(heights), 1)
    decrement = -2.0 * slope
    return 1.0 / (2.0 * spacing * 1e-4), decrement / math.hypot(2.0 * math.pi, decrement)


@pytest.mark.parametrize(("axis", "joint", "carried_kg"), [(0, "flex_x", 32.0), (1, "flex_y", 7.0)])
def test_ring_down_is_that_of_a_mass_on_its_spring(bench, axis, joint, carried_kg):
    """While friction holds the carriage: sqrt(k / m) / 2 pi of what the joint carries, read off the drawing."""
    b = bench(start_mm=(20.0, 20.0, 20.0))
    frequency, damping = ring_down(b, axis)
    mode = next(mode for mode in b.plant.machine.structure if mode.joint == joint)
    expected_hz = math.sqrt(mode.stiffness_n_per_m / carried_kg) / (2.0 * math.pi)
    assert frequency == pytest.approx(expected_hz, rel=0.05)
    assert damping == pytest.approx(mode.damping_ratio, rel=0.05)


def test_payload_lowers_the_frequency_of_the_table(bench):
    frequency, _ = ring_down(bench(start_mm=(20.0, 20.0, 20.0)), 1)
    doubled, _ = ring_down(bench({"payload.mass": 7.0}, start_mm=(20.0, 20.0, 20.0)), 1)
    assert doubled == pytest.approx(frequency / math.sqrt(2.0), rel=0.02)


HALVED = {"timing.motor_substep": 12.5, "timing.mujoco_step": 0.25}


@pytest.mark.parametrize(("top_hz", "hz_per_ms"), [(10000, 100), (2000, 1000), (16000, 300)])
def test_halving_the_time_steps_moves_the_end_by_less_than_a_micrometre(bench, top_hz, hz_per_ms):
    ends = []
    for overrides in ({}, HALVED):
        b = bench(overrides)
        for sign in (1, -1):
            b.move((3200 * sign,) * 3, top_hz, hz_per_ms=hz_per_ms)
            b.wait(1000)
            ends.append(b.plant.position_mm)
    default, halved = np.array(ends).reshape(2, 2, 3)
    assert np.abs(default - halved).max() < 1e-3


def test_halving_the_time_steps_keeps_the_ring_down_frequency(bench):
    default, _ = ring_down(bench(start_mm=(20.0, 20.0, 20.0)), 0)
    halved, _ = ring_down(bench(HALVED, start_mm=(20.0, 20.0, 20.0)), 0)
    assert halved == pytest.approx(default, rel=0.01)


def test_imperfections_show_where_they_belong(bench):
    """Lead error 0.046 % of 50 mm: 23 um; squareness 0.1 mm/m of 150 mm in Y and 30 in Z: 18 um; backlash as set."""
    ideal, lead, square = (
        bench({"imperfections": "ideal", **on})
        for on in ({}, {"imperfections.lead_error": True}, {"imperfections.squareness": True})
    )
    for b in (ideal, lead, square):
        b.move((0, 16000, 0), 10000)
        b.wait(500)
    assert ideal.plant.position_mm[1] == pytest.approx(150.0, abs=0.005)
    assert lead.plant.position_mm[1] - ideal.plant.position_mm[1] == pytest.approx(0.023, abs=1e-3)
    assert square.plant.position_mm[0] - ideal.plant.position_mm[0] == pytest.approx(0.1e-3 * (150.0 + 30.0), abs=1e-3)

    def reversal(b) -> float:
        b.move((1600, 0, 0), 2000)
        b.wait(1500)
        forward = b.plant.position_mm[0] - b.plant.rotor[0] / 320.0
        b.move((-1600, 0, 0), 2000)
        b.wait(1500)
        return forward - (b.plant.position_mm[0] - b.plant.rotor[0] / 320.0)

    wide = reversal(bench({"imperfections": "static", "axes.x.backlash": 0.1}))
    none = reversal(bench({"imperfections": "ideal"}))
    assert none - wide == pytest.approx(0.1, abs=0.01), "the carriage coasts a little in its play"


def test_nothing_passes_without_pulses(bench):
    b = bench()
    b.wait(1000)
    assert b.plant.at_rest
    before = b.plant.position_mm
    b.feed(3_600_000 * MS, *NONE)
    assert b.plant.at_rest
    assert np.array_equal(b.plant.position_mm, before)
