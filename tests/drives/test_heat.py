"""Heat of the power stages: the closed form of one thermal mass, and what the machine does when a stage is too hot."""

from __future__ import annotations

import math

import pytest

from isel_twin import Twin
from isel_twin.drives.heat import StageHeat, later_c, steady_c
from isel_twin.drives.stage import Stage

# 2 W quiescent and 0.2 ohm x (4 A)^2 = 3.2 W at full current; a quarter of that at half current.
STAGE = Stage(supply_v=48.0, current_a=4.0, ambient_c=25.0, thermal_resistance_k_per_w=10.0, thermal_limit_c=60.0)


@pytest.mark.parametrize(("fraction", "expected_c"), [(1.0, 25 + 52), (0.5, 25 + 28), (0.0, 25)])
def test_steady_temperature(fraction: float, expected_c: float) -> None:
    assert steady_c(STAGE, fraction) == pytest.approx(expected_c)


def test_after_one_time_constant_all_but_1_over_e_is_there() -> None:
    tau_s = STAGE.thermal_time_constant_s
    assert later_c(STAGE, 25.0, 1.0, tau_s) == pytest.approx(25 + 52 * (1 - math.exp(-1)))
    assert later_c(STAGE, 77.0, 0.0, tau_s) == pytest.approx(25 + 52 * math.exp(-1))


def test_contact_opens_at_the_limit_and_closes_10_k_below() -> None:
    heat = StageHeat([STAGE])
    seconds = 0
    while not heat.hot:
        heat.advance([1.0])
        seconds += 1
    # 60 = 25 + 52 (1 - exp(-t / 300)), seen on a grid of one second
    assert seconds == math.ceil(-300 * math.log(1 - 35 / 52))
    while heat.hot:
        heat.advance([0.0])
    assert heat.temperature_c[0] == pytest.approx(50.0, abs=0.2)


def test_stages_that_cannot_reach_their_limit_are_not_looked_at() -> None:
    assert StageHeat([Stage(supply_v=48.0, current_a=4.0)]).next_ns is None
    assert StageHeat([STAGE]).next_ns == 1_000_000_000
    assert StageHeat([]).next_ns is None


def test_a_hot_cabinet_cuts_the_power_until_it_is_cool_and_initialised() -> None:
    # At rest and half current: 2 + 0.2 * 2.1^2 = 2.882 W, 8 K/W: 23.06 K above 70 degrees; limit at 85.
    twin = Twin(overrides={"axes.all.stage.ambient": 70.0}, start_mm=(5.0, 5.0, 5.0))
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    trip_s = -300 * math.log(1 - 15 / 23.06)
    twin.run(trip_s - 5 - twin.time_ns / 1e9)
    assert twin.outputs["power"] == 1
    assert twin.inputs["overtemperature"] == "normal"
    twin.run(5.0)
    assert twin.outputs["power"] == 0
    assert twin.inputs["overtemperature"] == "hot"
    assert twin.query("@0b1") == "013", "bit 2 of port 1 is low: too hot"
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "9"
    assert twin.query("@07") == "9"
    # Switched off, it cools from 15 K above ambient to 5 K.
    cool_s = 300 * math.log(15 / 5)
    twin.run(cool_s - 10)
    assert twin.query("@07") == "9"
    twin.run(15)
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]


def test_the_default_machine_stays_cool() -> None:
    twin = Twin(start_mm=(5.0, 5.0, 5.0))
    assert [twin.query(command) for command in ("@07", "@0R7")] == ["0", "0"]
    twin.run(36_000.0)
    assert twin.outputs["power"] == 1
