"""The spindle of a machine: contactor, analog output, E-stop, hood, cuts, and what is seen of it."""

from __future__ import annotations

import math

import pytest

from isel_twin import Twin
from isel_twin.plant import Cut


def at_speed(volts_255: int = 128, **changes: object) -> Twin:
    """An iMC whose spindle runs at volts_255 / 255 of 24000 rev/min."""
    twin = Twin("4030-hf", "imc-s8", plant="kinematic", **changes)
    for command in ("@07", f"@0B4,{volts_255}", "@0B2,1"):
        assert twin.query(command) == "0"
    twin.run(3.5)
    assert twin.spindle_rev_min == pytest.approx(24_000.0 * volts_255 / 255)
    return twin


def test_a_machine_without_one_is_as_before():
    twin = Twin(plant="kinematic")
    assert math.isnan(twin.spindle_rev_min)
    assert "spindle_rev_min" not in twin.outputs


def test_the_analog_output_of_the_imc_drives_it():
    """2.2.4: port 4 is the analog output, 0 to 255 for 0 to 10 V; port 2 switches the spindle."""
    twin = at_speed(255)
    twin.query("@0B4,51")
    twin.run(3.0)
    assert twin.spindle_rev_min == pytest.approx(4_800.0)
    assert twin.outputs["spindle_rev_min"] == 4800
    twin.query("@0B2,0")
    twin.run(3.0)
    assert twin.spindle_rev_min == 0.0


def test_a_knob_in_place_of_the_analog_output():
    twin = at_speed(overrides={"spindle.speed_from": "fixed", "spindle.max_speed": 12_047.0588235294}, volts_255=128)
    assert twin.outputs["analog"] == 128
    twin.query("@0B4,0")
    twin.run(1.0)
    assert twin.outputs["spindle_rev_min"] == 12_047


@pytest.mark.parametrize(("name", "state"), [("estop", "pressed"), ("hood", "forced"), ("power", "off")])
def test_it_coasts_down_when_its_contactor_drops(name, state):
    twin = at_speed()
    before = twin.spindle_rev_min
    twin.set_input(name, state)
    twin.run(1.0)
    coasting = 0.01 / 3e-5 * 60.0 / (2.0 * math.pi)
    assert twin.spindle_rev_min == pytest.approx(before - coasting, rel=1e-9)
    assert twin.outputs["spindle_runs"] == 0
    twin.run(5.0)
    assert twin.spindle_rev_min == 0.0


def test_saved_in_its_run_up_it_goes_on_as_it_would_have():
    twin = at_speed()
    twin.query("@0B4,255")
    twin.run(0.7)
    state = twin.save()
    twin.run(1.1)
    then = twin.spindle_rev_min, twin.spindle_turns, dict(twin.outputs)
    twin.restore(state)
    twin.run(1.1)
    assert (twin.spindle_rev_min, twin.spindle_turns, dict(twin.outputs)) == then


def test_looking_does_not_change_it():
    twins = at_speed(), at_speed()
    for twin in twins:
        twin.query("@0B4,40")
    twins[0].run(2.0)
    for _ in range(200):
        twins[1].run(0.01)
    assert twins[0].spindle_rev_min == twins[1].spindle_rev_min
    assert twins[0].spindle_turns == pytest.approx(twins[1].spindle_turns, rel=1e-12)


def test_a_cut_loads_it():
    """A slot of 6 mm at 20 mm/s: the mean torque is power over speed; the speed falls by slip in its proportion."""
    twin = Twin("4030-hf", "imc-s8", start_mm=(2.0, 2.0, 2.0), overrides={"imperfections": "ideal"})
    for command in ("@07", "@0R7", "@0B4,255", "@0B2,1"):
        assert twin.query(command) == "0"
    twin.run(3.2)
    assert twin.spindle_rev_min == 24_000.0
    cut = Cut(6.0, 2, 1.0, 6.0, 10_000.0, 700.0)
    twin.set_cut(cut)
    twin.run(0.1)
    assert twin.spindle_rev_min == 24_000.0, "no feed, no chip"
    twin.write(b"@0A9600,6400,0,100,0,100,0,100\r")
    twin.run(1.2)
    load_nm = 700.0 * 6.0 * 20.0 * 1e-3 / (24_000.0 * 2.0 * math.pi / 60.0)
    assert twin.spindle_rev_min == pytest.approx(24_000.0 - 800.0 * load_nm / 0.2, rel=2e-3)
    twin.set_cut(None)
    twin.run(1.0)
    assert twin.spindle_rev_min == 24_000.0
