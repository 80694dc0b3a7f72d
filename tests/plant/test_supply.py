"""The common supply of the stages: sag, rise, chopper, under-voltage, and the energy that goes through it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from isel_twin.machine import MachineError, load_machine, with_overrides
from isel_twin.plant import Threshold
from isel_twin.plant.kinematic import KinematicPlant

from .conftest import MS, NONE, ramp_ns, ticks

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


def test_the_energy_of_a_move_adds_up(bench):
    """Change of the capacitor = charge from the source - what stages took - chopper, to 1 % of what went through."""
    b = bench(ON, lowering=False)
    supply = b.plant._supply
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
STOP_S = 0.010


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
    energy_j, volts = b.plant.energy_j, [b.plant.supply_v]
    for start_ns in range(begin_ns, begin_ns + 40 * MS, MS // 2):
        now = t_ns[(t_ns > start_ns) & (t_ns <= start_ns + MS // 2)] - start_ns
        b.feed(MS // 2, now, ticks(len(now), 1, 1, 1))
        volts.append(b.plant.supply_v)
    return b, np.array(volts), energy_j - b.plant.energy_j
