"""What else can be found: a ramp law from durations alone, scatter and place of a switch, a lead error."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from isel_twin.language import create_language, needed
from isel_twin.machine import load_machine, machine_from_tree
from isel_twin.many.identification.experiment import (
    Experiment,
    Step,
    Teller,
    _far,
    _stall,
    _switch,
    assemble,
    series_hz,
    series_text,
)
from isel_twin.many.identification.fit import fit
from isel_twin.many.identification.measured import Measured, Repeats
from isel_twin.many.identification.session import predict, session_of, stand_alone
from isel_twin.many.identification.stand_in import _stalled, carry_out
from isel_twin.many.identification.unknowns import candidate, unknown
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=5)

CONTROLLER = "imc-s8"
MACHINE = load_machine("4030")
LANGUAGE = needed(create_language(CONTROLLER), CONTROLLER)


def test_the_ramp_law_follows_from_durations() -> None:
    """A controller whose default acceleration is not the manual's 100 Hz/ms; no command says it."""
    tree = {**MACHINE.tree, "controller": {**MACHINE.tree["controller"]}}
    tree["controller"]["acceleration_hz_per_ms"] = {
        "value": 80,
        "unit": "Hz/ms",
        "grade": "setting",
        "source": "hidden",
    }
    hidden = machine_from_tree(tree, MACHINE.file)
    moves = [
        f"@0A{steps},{hz},0,30,0,30,0,30" for steps, hz in ((3200, 5000), (-1600, 16000), (6400, 16000), (640, 2000))
    ]
    lines = ["@07", "@0d5000,5000,5000", "@0R7", *moves]
    experiment = Experiment("day", tuple(Step(LANGUAGE.frame(line)) for line in lines), ())
    recorded, measured = carry_out(experiment, hidden, CONTROLLER, seed=3, noise_mm=0.0, time_noise_s=0.0005)
    ramp = unknown(MACHINE, "controller.acceleration_hz_per_ms", (50.0, 200.0))
    result = fit(MACHINE, [ramp], [session_of(recorded, measured, CONTROLLER, MACHINE)], [])
    (found,) = result.estimates
    assert found.value == pytest.approx(80.0, rel=0.05)
    assert found.low < 80.0 < found.high


def test_the_scatter_of_switches_follows_from_reference_runs() -> None:
    """s^2 = scatter^2 + gauge^2; of n values s is known to 1/sqrt(2 (n - 1))."""
    values = np.random.default_rng(1).normal(0.0, 0.025, 40)
    measured = Measured(repeats=(Repeats("day", "x", tuple(values.tolist())),), gauge_sigma_mm=0.005)
    (found,) = fit(
        MACHINE, [unknown(MACHINE, "repeatability")], [stand_alone("day", measured, CONTROLLER)], []
    ).estimates
    assert found.value == pytest.approx(np.sqrt(values.std(ddof=1) ** 2 - 0.005**2), rel=0.1)
    assert found.low < 0.025 < found.high


def test_a_switch_and_a_lead_error_follow_from_a_scale(tmp_path: Path) -> None:
    machine = load_machine(near_switches(tmp_path, 2.0, more=COARSE))
    unknowns = [unknown(machine, "switch.limit_x2"), unknown(machine, "lead.x")]
    hidden = candidate(machine, unknowns, [393.6, 0.04])
    tell = Teller(LANGUAGE, "x", machine.axes[0].steps_per_mm)
    tell.gentle = (15_000, 50, 300)  # a long way
    switch = _switch(tell, LANGUAGE, 395.0, "limit_x2")
    blocks = [_far(tell, 395.0), replace(switch, steps=switch.steps[: -len(LANGUAGE.reference())])]
    recorded, measured = carry_out(
        assemble("day", blocks, LANGUAGE), hidden, CONTROLLER, seed=3, noise_mm=0.01, time_noise_s=0.0
    )
    found, lead = fit(machine, unknowns, [session_of(recorded, measured, CONTROLLER, machine)], []).estimates
    assert found.value == pytest.approx(393.6, abs=0.05)
    assert lead.value == pytest.approx(0.04, abs=0.008)


def test_stalls_at_two_supplies_are_predicted_each_at_its_own() -> None:
    """A series on a twin of the machine itself: held below and lost above the speed that is predicted."""
    series = [_stall("x", MACHINE, CONTROLLER, 15.0, 55.0, 1000, supply_v).stall for supply_v in (36.0, 48.0)]
    done = tuple(replace(_stalled(stall, MACHINE, CONTROLLER, 3), recording="day") for stall in series if stall)
    assert [stall.supply_v for stall in done] == [36.0, 48.0]
    assert done[0].held_hz < done[1].held_hz, "more supply, more speed"
    predicted = np.exp(predict(stand_alone("day", Measured(stalls=done), CONTROLLER), MACHINE))
    measured = [(stall.held_hz * stall.lost_hz) ** 0.5 for stall in done]
    assert predicted == pytest.approx(measured, rel=0.06)


def test_a_series_says_where_z_stays_and_at_which_supply() -> None:
    block = _stall("x", MACHINE, CONTROLLER, 15.0, 55.0, 1000, 36.0)
    text = series_text(assemble("day", [block], LANGUAGE), MACHINE, LANGUAGE)
    assert "# Z stays where the reference run leaves it, at the top; stages at 36 V" in text
    assert block.stall is not None
    speeds = series_hz(block.stall, LANGUAGE)
    middle = (block.stall.held_hz * block.stall.lost_hz) ** 0.5
    assert sum(speed < middle for speed in speeds) <= 10, "few moves before the first that may lose steps"
