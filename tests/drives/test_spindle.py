"""The spindle: closed forms of its run-up, its coasting and its load, by the numbers of the machine 4030-hf."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from isel_twin.base.units import SECOND_NS
from isel_twin.drives.spindle import Spindle, Turning, turning
from isel_twin.machine import MachineError, load_machine, with_overrides
from isel_twin.plant import Cut, cutting_torque_nm

HF = Spindle(24_000.0, 3.0, 0.2, 3e-5, 0.01, 800.0)
PER_NM = 60.0 / (2.0 * math.pi) / 3e-5  # rev/min a second


def after(seconds: float, at: Turning) -> tuple[float, float]:
    t_ns = round(seconds * SECOND_NS)
    return at.speed_rev_min(t_ns), at.turns(t_ns)


def test_the_converter_s_ramp_is_a_line_and_the_angle_a_parabola():
    up = turning(HF, Turning(), 0, 12_000.0, 0.0, live=True)
    assert up.end_ns == pytest.approx(1.5 * SECOND_NS, abs=1)
    assert after(0.6, up) == pytest.approx((4_800.0, 0.5 * 4_800.0 / 60.0 * 0.6), rel=1e-12)
    assert after(2.0, up) == pytest.approx((12_000.0, 0.5 * 200.0 * 1.5 + 200.0 * 0.5), rel=1e-9)


def test_a_weak_motor_takes_what_torque_and_inertia_allow():
    weak = replace(HF, torque_nm=0.02)
    up = turning(weak, Turning(), 0, 24_000.0, 0.0, live=True)
    assert after(1.0, up)[0] == pytest.approx(0.01 * PER_NM, rel=1e-12)


def test_without_current_it_coasts_and_a_brake_stops_it_sooner():
    at = Turning(0, 24_000.0, 24_000.0)
    coasting = turning(HF, at, 0, 24_000.0, 0.0, live=False)
    braked = turning(replace(HF, brake_nm=0.09), at, 0, 24_000.0, 0.0, live=False)
    assert coasting.end_ns / SECOND_NS == pytest.approx(24_000.0 / (0.01 * PER_NM), rel=1e-8)
    assert braked.end_ns / SECOND_NS == pytest.approx(24_000.0 / (0.1 * PER_NM), rel=1e-8)
    assert after(60.0, coasting) == pytest.approx((0.0, 24_000.0**2 / (2.0 * 0.01 * PER_NM) / 60.0), rel=1e-6)


def test_it_gives_way_under_load_and_stalls_beyond_its_torque():
    at = Turning(0, 24_000.0, 24_000.0)
    assert turning(HF, at, 0, 24_000.0, 0.1, live=True).goal == 24_000.0 - 0.5 * 800.0
    stalls = turning(HF, at, 0, 24_000.0, 0.25, live=True)
    assert (stalls.goal, stalls.ramp) == (0.0, pytest.approx(-(0.25 + 0.01 - 0.2) * PER_NM))


def test_it_turns_round_by_way_of_standstill():
    at = Turning(0, 6_000.0, 6_000.0)
    down = turning(HF, at, 0, -6_000.0, 0.0, live=True)
    assert (down.goal, down.end_ns) == (0.0, round(0.75 * SECOND_NS))
    back = turning(HF, down, down.end_ns, -6_000.0, 0.0, live=True)
    assert after(1.5, back) == pytest.approx((-6_000.0, 0.0), abs=1e-6)


@pytest.mark.parametrize("feed_mm_s", [5.0, 20.0])
def test_torque_of_a_cut_is_its_power_over_the_speed(feed_mm_s):
    """Power of a cut: kc times the volume a second (Altintas, chapter 2), whatever the number of teeth."""
    for width, flutes in ((6.0, 2), (2.0, 3)):
        cut = Cut(6.0, flutes, 1.5, width, 18_000.0, 800.0)
        power_w = 800.0 * 1.5 * width * feed_mm_s * 1e-3
        omega = 12_000.0 * 2.0 * math.pi / 60.0
        assert cutting_torque_nm(cut, feed_mm_s, 12_000.0) == pytest.approx(power_w / omega, rel=1e-12)
    assert cutting_torque_nm(cut, 0.0, 12_000.0) == 0.0


def test_torque_of_a_thin_chip_and_a_blunt_edge():
    """Kienzle: h^(1-m) over half a turn of a slot; its integral for m = 0.5 is the Beta function B(3/4, 1/2)."""
    cut = Cut(6.0, 2, 1.0, 6.0, 18_000.0, 700.0, m=0.5, edge_n_mm=10.0)
    tooth_mm = 10.0 * 60.0 / (12_000.0 * 2)
    beta = math.gamma(0.75) * math.gamma(0.5) / math.gamma(1.25)
    force = 700.0 * math.sqrt(tooth_mm) * beta + 10.0 * math.pi
    assert cutting_torque_nm(cut, 10.0, 12_000.0) == pytest.approx(2 / (2 * math.pi) * force * 3e-3, rel=2e-3)


def test_a_machine_file_says_what_is_wrong_with_its_spindle():
    machine = load_machine("4030-hf")
    assert machine.spindle == HF
    assert load_machine("4030").spindle is None
    with pytest.raises(MachineError, match=r"spindle.*friction must be less than torque"):
        with_overrides(machine, {"spindle.friction": 0.3})
    with pytest.raises(MachineError, match=r"spindle\.max_speed"):
        with_overrides(machine, {"spindle.max_speed": 10})
    assert with_overrides(machine, {"spindle.run_up": 1.0}).spindle == replace(HF, run_up_s=1.0)
