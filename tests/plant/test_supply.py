"""The common supply of the stages: sag, rise, chopper, under-voltage, and the energy that goes through it."""

from __future__ import annotations

import math

import numpy as np
import pytest
from plant.energy import mechanical_energy_j

from isel_twin.machine import MachineError, load_machine, with_overrides
from isel_twin.plant.kinematic import KinematicPlant

from .conftest import MS, ramp_ns, ticks

ON = {"supply.enabled": True}
VOLTS, OHM, FARAD = 48.0, 0.3, 0.01
"""The shipped supply."""
PHASE_OHM = 0.65 + 0.2
"""Winding of the 23HS32-4004S and what the stage adds."""
HOLD_W = 3.0 * (PHASE_OHM * 4.2**2 + 2.0)
"""Three axes at full current, i_a^2 + i_b^2 = I^2, and 2 W a stage."""


def sagged(power_w: float) -> float:
    """Steady voltage under a constant power, from U0 - U = R P / U."""
    return 0.5 * (VOLTS + math.sqrt(VOLTS**2 - 4.0 * OHM * power_w))


def test_off_there_is_no_supply_and_not_a_bit_changes(bench):
    plain, off = bench({"supply.capacitance": 5000.0, "supply.source_resistance": 5.0}), bench()
    for b in (plain, off):
        b.move((800, 800, 0), 8000.0)
        b.wait(100)
    assert math.isnan(off.plant.supply_v)
    assert (plain.plant.position_mm == off.plant.position_mm).all()
    assert (plain.plant.rotor == off.plant.rotor).all()


def test_a_supply_of_no_resistance_and_much_capacitance_is_the_stiff_one(bench):
    """10 mohm and 1 F: the voltage moves by less than 0.1 V, and so does nothing else."""
    stiff, supplied = bench(), bench({**ON, "supply.source_resistance": 0.01, "supply.capacitance": 1e6})
    for b in (stiff, supplied):
        b.move((1600, 0, 0), 8000.0)
    assert supplied.plant.supply_v == pytest.approx(VOLTS, abs=0.1)
    assert supplied.plant.rotor == pytest.approx(stiff.plant.rotor, abs=0.1)


def test_a_steady_load_sags_by_its_current_through_the_source(bench):
    b = bench(ON, lowering=False)
    b.wait(500)
    assert b.plant.supply_v == pytest.approx(sagged(HOLD_W), abs=2e-3)
    assert b.plant.at_rest
    steady_v = b.plant.supply_v
    b.wait(1000)
    assert b.plant.supply_v == steady_v


def test_lowered_current_lets_it_rise_again(bench):
    b = bench(ON)
    b.wait(1000)
    assert b.plant.supply_v == pytest.approx(sagged(3.0 * (PHASE_OHM * 2.1**2 + 2.0)), abs=2e-3)


def test_a_joint_acceleration_sags_more_than_one_axis(bench):
    lowest = []
    for steps in ((3200, 0, 0), (3200, 3200, 3200)):
        b = bench(ON, lowering=False)
        b.wait(200)
        t_ns = ramp_ns(3200, 16000.0, 500.0, 100.0)
        volts, done_ns = [], 0
        while done_ns < t_ns[-1] // 2:
            now = t_ns[(t_ns > done_ns) & (t_ns <= done_ns + MS)] - done_ns
            b.feed(MS, now, ticks(len(now), *np.sign(steps)))
            done_ns += MS
            volts.append(b.plant.supply_v)
        lowest.append(min(volts))
    assert lowest[1] < lowest[0] < sagged(HOLD_W) - 0.1


def cruise(b, hz: float, seconds: float) -> tuple[float, float]:
    """A long move of X against 600 N at an even rate, the margin of its last fifth, and the voltage at the end."""
    ramp = ramp_ns(40_000, hz, 500.0, 50.0)
    ramp = ramp[: len(ramp) // 2]
    b.plant.apply_force(0, -600.0)
    b.wait(100)
    t_ns = np.concatenate((ramp, ramp[-1] + (np.arange(1, round(hz * seconds)) * (1e9 / hz)).astype(np.int64)))
    done_ns = 0
    for until_ns in (round(0.8 * t_ns[-1]), int(t_ns[-1])):
        now = t_ns[(t_ns > done_ns) & (t_ns <= until_ns)] - done_ns
        b.plant.watch_margin()
        b.feed(until_ns - done_ns, now, ticks(len(now), 1))
        done_ns = until_ns
    return float(b.plant.margin[0]), b.plant.supply_v


def test_a_sagging_supply_takes_from_the_margin(bench):
    """15 000 Hz are beyond the knee: the same move on stiff stages of the voltage to which the supply sags has the same
    margin, within the 2 % of the torque by which the law of U0 / U is off; on stiff 48 V it has more."""
    margin, volts = cruise(bench({**ON, "supply.source_resistance": 5.0}, lowering=False), 15_000.0, 2.0)
    assert volts < 38.0
    stiff, _ = cruise(bench({"axes.all.stage.supply": volts}, lowering=False), 15_000.0, 2.0)
    nominal, _ = cruise(bench(lowering=False), 15_000.0, 2.0)
    assert margin == pytest.approx(stiff, abs=0.02)
    assert nominal > stiff + 0.1


def test_the_energy_of_a_move_adds_up(bench):
    """Change of the capacitor = charge from the source - what stages took - chopper, to 1 % of what went through."""
    b = bench(ON, lowering=False)
    supply = b.plant.parts.supply
    t_ns = ramp_ns(3200, 16000.0, 500.0, 200.0)
    before_v, before_j = b.plant.supply_v, supply["drawn_j"][0]
    done_ns, source_j, last_v = 0, 0.0, before_v
    while done_ns < t_ns[-1] + 20 * MS:
        now = t_ns[(t_ns > done_ns) & (t_ns <= done_ns + MS // 2)] - done_ns
        b.feed(MS // 2, now, ticks(len(now), 1, 1, 1))
        done_ns += MS // 2
        volts = 0.5 * (last_v + b.plant.supply_v)
        source_j += max(0.0, VOLTS - volts) / OHM * volts * 0.5e-3
        last_v = b.plant.supply_v
    drawn_j = supply["drawn_j"][0] - before_j
    stored_j = 0.5 * FARAD * (last_v**2 - before_v**2)
    assert drawn_j > 5.0
    assert stored_j == pytest.approx(source_j - drawn_j - supply["dumped_j"][0], abs=0.01 * drawn_j)


RATE_HZ = 16000.0
"""Of the pulses before the stop: 10 rev/s."""
STOP_S = 0.016


def stop_from_speed(bench, overrides):
    """All three axes up to RATE_HZ in 0.2 s, a while there, and down in STOP_S: voltages every window from the
    beginning of the stop on, and the mechanical energy at that moment less that at the end."""
    b = bench({**ON, **overrides}, start_mm=(100.0, 100.0, 30.0), lowering=False)
    up = np.sqrt(2.0 * np.arange(1, 1600) * 0.2 / RATE_HZ)
    even = up[-1] + np.arange(1, 3200) / RATE_HZ
    count = int(0.5 * RATE_HZ * STOP_S)
    down = even[-1] + STOP_S - np.sqrt(2.0 * np.arange(count, 0, -1) * STOP_S / RATE_HZ)
    t_ns = (1e9 * np.concatenate([up, even, down])).astype(np.int64)
    begin_ns = int(1e9 * even[-1]) // MS * MS
    first = t_ns <= begin_ns
    b.feed(begin_ns, t_ns[first], ticks(int(first.sum()), 1, 1, 1))
    energy_j, volts = mechanical_energy_j(b.plant.built), [b.plant.supply_v]
    for start_ns in range(begin_ns, begin_ns + 40 * MS, MS // 2):
        now = t_ns[(t_ns > start_ns) & (t_ns <= start_ns + MS // 2)] - start_ns
        b.feed(MS // 2, now, ticks(len(now), 1, 1, 1))
        volts.append(b.plant.supply_v)
    return b, np.array(volts), energy_j - mechanical_energy_j(b.plant.built)


LIVELY = {"axes.all.stage.current": 3.0, "supply.source_resistance": 0.05, "axes.all.coupling_inertia": 1e-4}
"""Much to brake, little current to heat, and a voltage near U0 before the stop."""
STOP_LOSS_W = 3.0 * (PHASE_OHM * 3.0**2 + 2.0)


@pytest.mark.parametrize("microfarad", [5000.0, 10000.0])
def test_a_joint_stop_raises_it_by_what_the_losses_leave(bench, microfarad):
    """Above U0 the source is blocked: C/2 (U^2 - U0^2) is at most the energy set free, and at least half of what is
    left after windings and stages; friction and iron take the rest."""
    b, volts, freed_j = stop_from_speed(bench, {**LIVELY, "supply.capacitance": microfarad})
    assert abs(b.lost[:3]).max() < 8.0
    raised_j = 0.5e-6 * microfarad * (volts.max() ** 2 - VOLTS**2)
    assert 0.5 * (freed_j - STOP_LOSS_W * STOP_S) < raised_j < freed_j
    assert volts[-1] < volts.max()


def test_the_chopper_holds_it(bench):
    b, volts, freed_j = stop_from_speed(bench, {**LIVELY, "supply.chopper_voltage": 48.2})
    assert volts.max() == pytest.approx(48.2)
    assert 0.0 < b.plant.parts.supply["dumped_j"][0] < freed_j


def test_a_chopper_that_is_too_weak_does_not(bench):
    """1000 ohm take 2.3 W at 48 V, 0.04 J in the stop."""
    b, volts, _ = stop_from_speed(
        bench, {**LIVELY, "supply.chopper_voltage": 48.2, "supply.chopper_resistance": 1000.0}
    )
    assert volts.max() > 48.7
    assert b.plant.parts.supply["dumped_j"][0] < volts.max() ** 2 / 1000.0 * 0.045


WEAK = {**ON, "supply.source_resistance": 8.0, "supply.undervoltage": 34.0, "supply.release": 35.0}
"""Gives at most U0^2 / 4 R = 72 W: enough to hold three motors (51 W), not to move them."""


def weak_move(b, piece_ns):
    """Three axes through 10 mm, cut into pieces: was under-voltage told?"""
    t_ns = ramp_ns(3200, 16000.0, 500.0, 200.0)
    told = False
    for start_ns in range(0, int(t_ns[-1]) + 200 * MS, piece_ns):
        now = t_ns[(t_ns > start_ns) & (t_ns <= start_ns + piece_ns)] - start_ns
        b.feed(piece_ns, now, ticks(len(now), 1, 1, 1))
        told = told or bool(b.plant.fault[:3].all() and not b.plant.powered[:3].any())
        assert (b.plant.fault[:3] != b.plant.powered[:3]).all()
    return told


def test_under_voltage_drops_the_stages_and_steps_are_lost(bench):
    b = bench(WEAK, lowering=False)
    assert weak_move(b, MS)
    b.wait(500)
    assert abs(b.lost[:3]).max() > 16.0
    assert not b.plant.fault.any()
    fine = bench({**WEAK, "supply.undervoltage": 5.0, "supply.source_resistance": OHM}, lowering=False)
    assert not weak_move(fine, MS)
    assert abs(fine.lost[:3]).max() < 4.0


def test_how_time_is_cut_does_not_matter(bench):
    ends = []
    for piece_ns in (MS, 7 * MS, 333_333):
        b = bench(WEAK)
        weak_move(b, piece_ns)
        b.wait((2000 * MS - b.now_ns) / MS)
        assert b.plant.at_rest
        ends.append((b.plant.supply_v, *b.plant.position_mm, *b.plant.rotor))
    assert ends[0] == ends[1] == ends[2]


@pytest.mark.parametrize("wait_ms", [600.0, 600.1, 600.33])
def test_woken_amid_a_window_the_voltage_does_not_move(bench, wait_ms):
    b = bench(ON, lowering=False)
    b.wait(wait_ms)
    assert b.plant.at_rest
    steady_v = b.plant.supply_v
    b.plant.apply_force(0, 1e-6)
    b.wait(20)
    assert b.plant.supply_v == pytest.approx(steady_v, abs=1e-6)


@pytest.mark.parametrize(
    ("overrides", "words"),
    [
        ({"axes.x.stage.supply": 36.0}, "36 and 48 V; allowed: the same supply on all axes"),
        ({"supply.release": 50.0}, "allowed: release below the stages' 48 V"),
        ({"supply.chopper_voltage": 47.0}, "chopper_voltage above"),
        ({"supply.capacitance": 1000.0}, "allowed: from 37"),
        ({"supply.undervoltage": 30.0}, "release must not lie below undervoltage"),
    ],
)
def test_a_supply_that_does_not_fit_is_refused_in_a_line(overrides, words):
    with pytest.raises(MachineError, match=words) as caught:
        with_overrides(load_machine("4030"), {**ON, **overrides})
    assert "supply" in str(caught.value)
    assert "\n" not in str(caught.value)


def test_the_kinematic_plant_has_none():
    plant = KinematicPlant(with_overrides(load_machine("4030"), ON), (), np.array([100.0, 100.0, 30.0]))
    assert math.isnan(plant.supply_v)
