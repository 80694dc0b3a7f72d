"""The pull-out margin: what is left of a motor's torque and angle, from data-sheet values and what hangs on it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.drives.library import MOTORS
from isel_twin.drives.stage import Stage
from isel_twin.native import core
from isel_twin.plant.margin import SPEED_STEP_RAD_S, SPEEDS, available_torque

from .conftest import PERIOD, ramp_ns, ticks

MOTOR = MOTORS["23HS32-4004S"]
PEAK_NM = MOTOR.torque_constant_nm_per_a * 4.2
"""Km I: microstep, both phases on a circle."""
LEAD_M = 5e-3
FREE = {
    "axes.x.shaft_coulomb": 0.0,
    "axes.x.shaft_viscous": 0.0,
    "axes.x.guide_friction": 0.0,
    "axes.x.efficiency": 1.0,
}
"""An axis on which nothing rubs, so that a push arrives at the motor whole."""


@pytest.mark.parametrize("part", [0.1, 0.3, 0.6])
def test_a_steady_push_takes_its_part_of_the_torque(bench, part):
    """F r over Km I; the detent torque (0.06 N m, 3 % of the peak) is what is uncertain."""
    b = bench(FREE, lowering=False)
    b.plant.apply_force(0, -part * PEAK_NM * 2.0 * math.pi / LEAD_M)
    b.wait(1500)
    b.plant.watch_margin()
    assert b.plant.margin[0] == pytest.approx(1.0 - part, abs=0.06 / PEAK_NM + 0.01)


def test_a_motor_of_which_nothing_is_asked_has_all_its_margin(bench):
    b = bench(FREE, lowering=False)
    b.wait(1500)
    b.plant.watch_margin()
    b.wait(500)
    assert b.plant.margin[0] == pytest.approx(1.0, abs=0.01)


def test_a_motor_that_slips_had_none(bench):
    b = bench(FREE, lowering=False)
    b.plant.apply_force(0, -1.2 * PEAK_NM * 2.0 * math.pi / LEAD_M)
    b.wait(100)
    assert abs(b.plant.lag[0]) > PERIOD / 2
    assert b.plant.margin[0] < 0.02


def test_a_motor_without_current_has_nothing_to_lose(bench):
    """What is switched off is not looked at: an axis moved by hand keeps the margin of before."""
    b = bench(power=False)
    b.plant.apply_force(0, 400.0)
    b.wait(300)
    assert b.plant.margin[:3].tolist() == [1.0, 1.0, 1.0]


def test_at_lowered_current_the_same_push_takes_a_larger_part(bench):
    """Half the current: twice the part, but for what the detent torque carries."""
    b = bench({**FREE, "axes.x.stage.idle_current": 0.5}, lowering=False)
    b.plant.apply_force(0, -0.3 * PEAK_NM * 2.0 * math.pi / LEAD_M)
    b.wait(1000)
    b.plant.watch_margin()
    full = b.plant.margin[0]
    b.plant.set_power(stages=True, brake_released=True, lowering=True)
    b.wait(1500)
    b.plant.watch_margin()
    assert (1.0 - b.plant.margin[0]) / (1.0 - full) == pytest.approx(2.0, abs=0.1)


def test_faster_is_nearer_to_the_end_until_nothing_is_left():
    """48 V: every 2000 Hz from 16 to 24 kHz takes something; 40 kHz (1500 rev/min) loses steps."""
    margins, lost = [], []
    for speed_hz in (*range(16_000, 24_001, 2000), 40_000):
        twin = Twin(start_mm=(50.0, 50.0, 50.0))
        for line in ("@07", "@0R7", "@0J100"):
            assert twin.query(line) == "0"
        twin.watch_margin()
        assert twin.query(f"@0A32000,{speed_hz},0,900,0,900,0,900") == "0"
        margins.append(twin.margin[0])
        lost.append(abs(twin.lost_steps[0]) > PERIOD / 2)
    assert (np.diff(margins) < 0.0).all()
    assert lost == [False] * 5 + [True]
    assert margins[-2] > 0.2
    assert margins[-1] < 0.02
    assert np.isnan(twin.margin[3])  # the A axis has no mechanics


def test_who_looks_again_and_again_changes_nothing_for_the_others():
    """Taken every 0.37 ms: the least of it is the margin of the other twin, to the bit, and so is all the rest."""
    seen = []
    for looked_at in (False, True):
        twin = Twin(start_mm=(50.0, 50.0, 50.0))
        assert twin.query("@07") == twin.query("@0R7") == "0"
        twin.watch_margin()
        reader, rare = twin.margin_reader(), twin.margin_reader()
        twin.write(b"@0A3200,8000,0,900,0,900,0,900\r")
        taken = []
        for _ in range(2700):
            twin.run(0.00037)
            if looked_at:
                taken.append(reader.take())
        seen.append((twin.margin[:3].tolist(), twin.position_mm.tolist(), twin.lost_steps.tolist(), twin.time_ns))
    assert seen[0] == seen[1]
    assert np.min(taken, axis=0)[:3].tolist() == rare.take()[:3].tolist() == seen[0][0]
    assert max(margin[0] for margin in taken) > seen[0][0][0]
    twin.watch_margin()
    assert twin.margin[0] > seen[0][0][0]


def test_it_does_not_depend_on_how_time_is_cut(bench):
    margins = []
    for pieces in (1, 37):
        b = bench()
        t_ns, changes = ramp_ns(800, 8000), ticks(800, 1, 0, 0)
        start_ns = b.plant.time_ns
        ends = np.linspace(0, t_ns[-1] + 300_000_000, pieces + 1).astype(np.int64)[1:]
        done = 0
        for end in ends:
            until = int(np.searchsorted(t_ns, end, side="right"))
            b.plant.advance(start_ns + int(end), start_ns + t_ns[done:until], changes[done:until])
            done = until
        margins.append(b.plant.margin.tolist())
    assert margins[0][:3] == margins[1][:3]
    assert margins[0][0] < 0.9


def test_available_torque_is_that_of_the_current_at_rest_and_of_the_supply_beyond_the_knee():
    """Km I at standstill. Far above the knee V Km / (we L), V between the supply as a sine and as a square wave, whose
    fundamental is 4/pi of it (Acarnley); what the back-EMF takes is small there."""
    stage = Twin(plant="kinematic").machine.axes[0].stage
    table = available_torque(MOTOR, stage)
    assert table[0] == pytest.approx(PEAK_NM, rel=0.01)
    omega = 100.0
    electrical = MOTOR.pole_pairs * omega
    mean_v = 0.5 * (stage.drive_v + stage.supply_v)
    sine_nm = mean_v * MOTOR.torque_constant_nm_per_a / (electrical * MOTOR.inductance_h)
    assert 0.97 * sine_nm < table[50] < 4.0 / math.pi * sine_nm
    assert (np.diff(table[table > 0.0]) <= 1e-9).all()


def test_between_two_speeds_of_the_table_it_is_interpolated_and_beyond_the_last_that_one_stands():
    """1 - T / T_max(w) with T_max rising by 0.01 N m from speed to speed, either way round."""
    table = 1.0 + 0.01 * np.arange(SPEEDS)
    for place, largest in ((0.0, 1.0), (2.0, 1.02), (2.25, 1.0225), (SPEEDS - 1.5, 3.545), (SPEEDS - 1, 3.55)):
        for sense in (1.0, -1.0):
            left = core.margin_at(table, sense * 0.5, 0.0, -sense * place * SPEED_STEP_RAD_S, 10.0)
            assert left == pytest.approx(1.0 - 0.5 / largest, rel=1e-12)
    assert core.margin_at(table, 0.25, 0.0, 0.0, 0.5) == pytest.approx(0.5, rel=1e-12), (
        "half the current, half of the first one"
    )
    for beyond in (SPEEDS, SPEEDS + 3, 1e6):
        left = core.margin_at(table, 0.5, 0.0, beyond * SPEED_STEP_RAD_S, 10.0)
        assert left == pytest.approx(1.0 - 0.5 / 3.55, rel=1e-12)


@pytest.mark.parametrize(("lag", "left"), [(0.0, 1.0), (1.0, 0.5), (-1.5, 0.25), (2.0, 0.0), (3.0, 0.5), (-8.5, 0.75)])
def test_by_angle_it_is_what_is_left_to_two_full_steps_of_the_nearest_place(lag, left):
    """Places where the motor would hold as well are four full steps apart."""
    assert core.margin_at(np.ones(SPEEDS), 0.0, lag, 0.0, 1.0) == pytest.approx(left)


def test_where_there_is_no_torque_left_after_iron_loss_there_is_none():
    """5 V of supply do not turn this motor at 2000 rev/min: from there on the table is 0, not the iron's."""
    table = available_torque(MOTOR, Stage(5.0, 4.2, 8))
    beyond = round(2000.0 * math.pi / 30.0 / SPEED_STEP_RAD_S)
    assert table[0] > 1.0
    assert (table[beyond:] == 0.0).all()
    assert core.margin_at(table, 0.1, 0.0, 400.0, 1.0) == 0.0
