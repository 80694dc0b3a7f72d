"""Rows: what varies reaches the machine, the controller, the job and the scenario, and what goes wrong is told."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import pytest

from isel_twin import Twin
from isel_twin.base.crew import MismatchError
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.robust import repetitions
from isel_twin.many.studies import wilson
from isel_twin.many.studies.plan import PlanError, load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import OUTCOMES, compute
from tests.many.studies.test_plan import plan

HEAD = """
[sweep]
job = "job.txt"
plant = "kinematic"
start_mm = [2, 2, 2]
"""
BOTH = "[job]\nspeed = [8000]\nramp = [100]\n"


def rows(path: Path) -> list[dict[str, Any]]:
    """Values and outcomes of all points."""
    read = load_plan(path)
    names = [parameter.name for parameter in read.parameters]
    found = []
    for point in points(read):
        outcome = compute(read.work, point)
        assert outcome is not None
        assert outcome.keys() == OUTCOMES.keys()
        found.append({**dict(zip(names, point.values, strict=True)), "seed": point.seed, **outcome})
    return found


def test_words_of_a_job_and_whole_lines(plans: Path) -> None:
    """25 mm of 320 steps/mm take 8000 steps / v, ramps of 100 Hz/ms from 300 Hz (v - 300 Hz)^2 / (v 100 Hz/ms) more."""
    (plans / "job.txt").write_text("@07\n@0R7\n@0J{ramp}\n@0A8000,{speed},0,30,0,30,0,30\n@0P\n", encoding="utf-8")
    words = '[job]\nspeed = [1000, 4000.0]\nramp = [100]\n"line 5" = ["@0P", "! count.x == 8000 steps"]\n'
    slow, checked, fast, _ = rows(plan(plans, HEAD + words))
    assert [row["ok"] for row in (slow, checked, fast)] == [True, True, True]
    assert (slow["commands"], checked["commands"]) == (5, 4)
    ramps_s = [(v - 300.0) ** 2 / (v * 100.0) * 1e-3 for v in (4000.0, 1000.0)]
    assert slow["cycle_s"] - fast["cycle_s"] == pytest.approx(8.0 - 2.0 + ramps_s[1] - ramps_s[0], abs=0.02)


def test_a_machine_out_of_its_limits_and_a_job_that_is_none_are_rows(plans: Path) -> None:
    heavy = '[machine]\npayload.mass = { values = [1, 101], unit = "kg" }\n'
    well, wrong = rows(plan(plans, HEAD + BOTH + heavy))
    assert (well["ok"], well["error"]) == (True, None)
    assert (wrong["ok"], wrong["cycle_s"]) == (None, None)
    assert "payload.mass: 101; allowed: 0 .. 100 kg" in wrong["error"]
    words = BOTH.replace("[100]", '["100", "<300>"]')
    well, wrong = rows(plan(plans, HEAD + words))
    assert (well["ok"], well["error"]) == (True, None)
    assert wrong["error"] == "line 4: <300> is neither a byte (<0> to <255>) nor a pause (<0.5s>)"


def test_a_refused_command_is_a_row_that_says_so(plans: Path) -> None:
    well, wrong = rows(plan(plans, HEAD + BOTH.replace("[8000]", "[8000, 99999999]")))
    assert (well["ok"], well["failure"], well["refused"]) == (True, None, 0)
    assert (wrong["ok"], wrong["failure"], wrong["refused"]) == (False, "refused", 2)
    assert wrong["finding"].startswith("line 5: @0A8000,99999999,0,30,0,30,0,30: ")


MOVES = """
[sweep]
moves = [[4, 2, 1], [0, 0, 0]]
plant = "kinematic"
start_mm = [2, 2, 2]
"""


def test_moves_with_settings(plans: Path) -> None:
    """4 mm and back at 320 steps/mm: 2560 steps take 1.28 s at 2000 Hz and 0.32 s at 8000 Hz, without ramps."""
    ramps = "acceleration_hz_per_ms = [4000]\n"
    slow, fast, none = rows(plan(plans, MOVES + f"[settings]\nspeed_hz = [2000, 8000, 50000]\n{ramps}"))
    assert (slow["ok"], fast["ok"]) == (True, True)
    assert slow["cycle_s"] - fast["cycle_s"] == pytest.approx(0.96, abs=0.02)
    assert none["error"] == "speed_hz is 50000; the controller takes 30 to 40000"
    (out,) = rows(plan(plans, MOVES.replace("[4, 2, 1]", "[395, 2, 1]")))
    assert out["error"] == "moves: x is 395 mm; allowed: 0 to 395 mm"


def test_moves_go_where_they_should_whatever_the_lead(plans: Path) -> None:
    lead = '[machine]\naxes.all.lead = { values = [5, 10], unit = "mm" }\n'
    five, ten = rows(plan(plans, MOVES.replace(", [0, 0, 0]", "") + lead))
    assert (five["ok"], ten["ok"]) == (True, True)
    assert five["cycle_s"] > ten["cycle_s"], "half as many steps"


def test_faults_by_name_and_keys_of_events(plans: Path) -> None:
    scenario = HEAD + 'scenario = "stuck.toml"\n' + BOTH + "[scenario]\n"
    by_name = rows(plan(plans, scenario + 'events = ["", "stick", "broken", "stick broken"]\n'))
    assert [row["ok"] for row in by_name] == [True, False, False, False]
    healed = rows(plan(plans, scenario + 'events = ["stick"]\nstick.set.limit_x1 = ["ok", "stuck_closed", "broke"]\n'))
    assert [row["ok"] for row in healed] == [True, False, None], "a switch that never opens: no reference run"


def test_times_of_events(plans: Path) -> None:
    """An event after the end of the job is one that never came."""
    scenario = HEAD + 'scenario = "stuck.toml"\n' + BOTH + "[scenario]\nevents = ['broken']\n"
    early, late = rows(plan(plans, scenario + "broken.at = [0.0, 1000.0]\n"))
    assert (early["ok"], early["events_late"], late["ok"], late["events_late"]) == (False, 0, True, 1)


@pytest.mark.parametrize(
    ("form", "line"),
    [
        ("broken.at.first = [1]", "scenario.broken.at.first: at is no table in the event"),
        (
            'broken.set.limit_x1 = { values = [2], unit = "times" }',
            "scenario.broken.set.limit_x1: the event has no number there to be multiplied",
        ),
        (
            'broken.noise = { values = [2], unit = "times" }',
            "scenario.broken.noise: the event has no number there to be multiplied",
        ),
    ],
)
def test_a_key_that_the_event_has_no_place_for_is_a_row_that_says_so(plans: Path, form: str, line: str) -> None:
    (row,) = rows(plan(plans, HEAD + 'scenario = "stuck.toml"\n' + BOTH + f"[scenario]\n{form}\n"))
    assert (row["ok"], row["error"]) == (None, line)


def test_physics_margins_and_multiples(plans: Path) -> None:
    """A multiple of 1 changes nothing, and 4 times 30 N is 120 N."""
    friction = '[machine]\naxes.all.guide_friction = { values = [1, 4], unit = "times" }\n'
    plain, more = rows(plan(plans, MOVES.replace("kinematic", "mujoco") + friction))
    (same,) = rows(plan(plans, MOVES.replace("kinematic", "mujoco")))
    assert {key: plain[key] for key in OUTCOMES} == {key: same[key] for key in OUTCOMES}
    assert (more["ok"], more["limiting"]) == (True, plain["limiting"])
    assert more["margin"] != plain["margin"]
    assert plain["edge"] > 1.0
    four = '[machine]\naxes.all.guide_friction = { values = [120], unit = "N" }\n'
    (absolute,) = rows(plan(plans, MOVES.replace("kinematic", "mujoco") + four))
    assert {key: absolute[key] for key in OUTCOMES} == {key: more[key] for key in OUTCOMES}, (
        "30 N of the machine, 4 times"
    )


def test_perturbed_machines_are_those_of_run_robust(plans: Path) -> None:
    text = "@07\n@0R7\n@0A3200,8000,0,30,0,30,0,30\n"
    (plans / "job.txt").write_text(text, encoding="utf-8")
    head = HEAD.replace("kinematic", "mujoco").replace("start_mm = [2, 2, 2]", "perturbed = true\nseeds = [1, 2]")
    found = rows(plan(plans, head))
    lines = parse_job(text, Twin(plant="kinematic").language, "imc-s8")
    repeated = [trial.verdict for trial in repetitions(TwinSpec(), lines, 2, timeout_s=60.0)]
    least = [min(each for each in verdict.margin if each is not None) for verdict in repeated]
    assert [row["margin"] for row in found] == least
    assert least[0] != least[1]


def test_seeds_may_be_machines_that_this_one_may_be(plans: Path) -> None:
    text = "@07\n@0R7\n@0A3200,8000,0,30,0,30,0,30\n"
    (plans / "job.txt").write_text(text, encoding="utf-8")
    head = HEAD.replace("kinematic", "mujoco").replace("start_mm =", 'perturbed = "uncertain"\nseeds = [2]\nstart_mm =')
    (row,) = rows(plan(plans, head))
    lines = parse_job(text, Twin(plant="kinematic").language, "imc-s8")
    call = TwinSpec(start_mm=(2.0, 2.0, 2.0))
    *_, trial = repetitions(call, lines, 2, timeout_s=60.0, source="known")  # its stages decay fast, and keep a margin
    assert (row["margin"], row["cycle_s"]) == (trial.verdict.least_margin, trial.verdict.cycle_s)
    bands = [ends for ends in trial.verdict.margin_band if ends is not None]
    assert row["margin_low"] == min(low for low, _ in bands) < row["margin"]
    assert row["margin_high"] == min(high for _, high in bands) > row["margin"]
    with pytest.raises(PlanError, match="perturbed: 'no'; allowed: true, false, 'uncertain'"):
        load_plan(plan(plans, head.replace('"uncertain"', '"no"')))


def test_a_worker_with_another_machine_computes_nothing(plans: Path) -> None:
    read = load_plan(plan(plans, HEAD + BOTH))
    point = points(read)[0]
    with pytest.raises(MismatchError, match="the machine 4030 is another one there"):
        compute(dataclasses.replace(read.work, machine_digest="0"), point)
    with pytest.raises(MismatchError, match="the machine mine cannot be read there: unknown machine 'mine'"):
        compute(dataclasses.replace(read.work, spec=read.work.spec.with_(machine="mine")), point)


@pytest.mark.parametrize(
    ("hits", "total", "low", "high"), [(0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634), (10, 10, 0.7225, 1.0)]
)
def test_the_interval_of_a_share(hits: int, total: int, low: float, high: float) -> None:
    """Values of R. G. Newcombe, Statistics in Medicine 17 (1998) 857, and tables of the score interval."""
    assert wilson(hits, total) == pytest.approx((low, high), abs=2e-4)


def test_the_interval_of_a_share_lies_between_nothing_and_all() -> None:
    """To the last bit: at both ends the formula gives 0 and 1, which rounding may miss."""
    for total in range(1, 100):
        assert wilson(0, total)[0] >= 0.0
        assert wilson(total, total)[1] <= 1.0


def test_a_plan_with_something_of_each_section(plans: Path) -> None:
    """Four samples of mass, friction, speed and a jam, with physics: all that varies has an effect of its own."""
    found = rows(plans / "everything.toml")
    assert [(row["ok"], row["error"], row["limiting_line"] > 2) for row in found] == [(True, None, True)] * 4
    assert len({row["cycle_s"] for row in found}) == 4
    slowest = max(found, key=lambda row: row["cycle_s"])
    assert slowest["speed_hz"] == min(row["speed_hz"] for row in found)


def test_perturbed_machines_at_the_end_of_a_range_are_rows(plans: Path) -> None:
    """48 V times 200 / 48 are all that a machine file allows; no draw goes beyond."""
    head = HEAD.replace("kinematic", "mujoco").replace("start_mm = [2, 2, 2]", "perturbed = true\nseeds = 8")
    most = '[machine]\n"axes.all.stage.supply" = { values = [200.0], unit = "V" }\n'
    (plans / "job.txt").write_text("@07\n@0P\n", encoding="utf-8")
    found = rows(plan(plans, head + most))
    assert [row["error"] for row in found] == [None] * 8
