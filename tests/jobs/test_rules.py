"""Rules stand in one list, whatever shows them has them from there, and "ok" is said only of what was asked for and
measured."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import RULES, Bounds, Report, check_job
from isel_twin.jobs.checks.settings import KEYS
from isel_twin.jobs.job import parse_job

pytestmark = pytest.mark.long(seconds=3)

DOCS = Path(__file__).parents[2] / "docs"
OF_CAPTURES = "signal"  # bounds of `drive`, not of [check]
HOME = "@07\n@0R7\n"
PROGRAM = "N10 G90 G0 X10\nN20 M30\n"
MOVE = HOME + "@0A1600,3000,0,30,0,30,0,30\n"


def checked(job: str, bounds: Bounds | None = None, plant: str = "kinematic", servo: bool = False) -> Report:
    call = TwinSpec(plant=plant, **({"machine": "4030-servo", "controller": "bwo900"} if servo else {}))
    return check_job(Path("job.txt"), call, parse_job(job, call.build().language, call.controller), bounds)


def outcomes(report: Report, bounds: Bounds | None = None) -> dict[str, str]:
    return {rule: report.outcome(rule, bounds or Bounds()) for rule in RULES}


def test_the_page_about_checks_has_each_rule_with_its_bound() -> None:
    table = (DOCS / "ci.md").read_text().partition("| rule |")[2].partition("\n\n")[0]
    rows = [line for line in table.splitlines() if line.startswith("| `")]
    found = {}
    for row in rows:
        names, broken, bound = row.strip("|").split(" | ")
        for name in re.findall(r"`(\w+)`", names):
            found[name] = ", ".join(re.findall(r"`(\w+)`", bound)), broken.endswith(": a warning")
            assert re.sub(r"\[(.*?)\]\(.*?\)", r"\1", broken).startswith(RULES[name].broken)
    assert found == {name: (rule.bound, rule.warning) for name, rule in RULES.items()}


def test_each_bound_is_a_key_of_a_project_and_an_option(capsys: pytest.CaptureFixture[str]) -> None:
    from isel_twin.cli import main

    bounds = {rule.bound for name, rule in RULES.items() if rule.bound and name != OF_CAPTURES}
    assert bounds <= set(KEYS)
    with pytest.raises(SystemExit):
        main(["check", "--help"])
    options = set(re.findall(r"--([a-z-]+)", capsys.readouterr().out))
    assert {bound.replace("_", "-") for bound in bounds} - {"timeout-s"} <= options


def test_without_bounds_and_physics_few_things_are_ok() -> None:
    told = outcomes(checked(MOVE))
    unasked = "unmet clearance margin edge deviation contour cycle golden luck doubt signal".split()  # noqa: SIM905
    assert {rule: told[rule] for rule in unasked} == dict.fromkeys(unasked, "not asked")
    assert told["lost"] == told["halfway"] == "not looked at: no physics"
    assert told["drive"] == "not looked at: no servo drive"
    assert told["collision"] == "not looked at: nothing is clamped that could be met"
    assert told["caution"] == "not looked at: no file of a CAM program"
    assert told["spindle"] == "not looked at: no file of a CAM program that cuts, and no stock"
    assert told["rapid"] == "not looked at: nothing that is clamped is stock"
    assert told["effect"] == "not looked at: no scenario, no bound"
    rest = "unread refused restart line unfinished unpowered switch fault odd".split()  # noqa: SIM905
    assert {rule: told[rule] for rule in rest} == dict.fromkeys(rest, "ok")
    assert len(told) == len(unasked) + len(rest) + 8


@pytest.mark.parametrize(
    ("rule", "bounds"),
    [
        ("margin", Bounds(margin=0.0)),
        ("edge", Bounds(edge=1.01)),
        ("deviation", Bounds(deviation_mm=10.0)),
        ("cycle", Bounds(cycle_s=1e6)),
    ],
)
def test_what_is_asked_and_measured_is_ok(rule: str, bounds: Bounds) -> None:
    assert outcomes(checked(MOVE, bounds, "mujoco"), bounds)[rule] == "ok"
    assert outcomes(checked(MOVE, bounds), bounds)["effect"] in ("ok", "1 finding")
    without = outcomes(checked(MOVE, bounds), bounds)[rule]
    assert without == ("ok" if rule == "cycle" else "not looked at: no physics")


def test_what_is_asked_and_cannot_be_measured_is_not_ok() -> None:
    bounds = Bounds(margin=0.2, edge=1.1, contour_mm=0.1, clearance=2.0)
    told = outcomes(checked("@0?\n", bounds, "mujoco"), bounds)
    assert told["edge"] == "not looked at: no motor has turned that has a limit of its swing"
    assert told["contour"] == "not looked at: no file of a CAM program that cuts"
    assert told["clearance"] == "not looked at: nothing is clamped that could be met"


def test_servo_drives_lose_no_steps_and_stepper_motors_do_not_switch_off() -> None:
    servo = outcomes(checked(PROGRAM, None, "mujoco", servo=True))
    assert servo["lost"] == servo["halfway"] == "not looked at: no stepper motor"
    assert servo["drive"] == "ok"


def test_programs_are_told_what_physics_would_have_judged() -> None:
    assert checked(MOVE).unseen == ("lost", "halfway", "margin", "edge", "deviation")
    assert checked(MOVE, None, "mujoco").unseen == ()


def test_of_a_job_that_was_not_made_to_its_end_no_rule_is_simply_ok() -> None:
    """The second of three commands is refused: no step is lost in what was made."""
    report = checked("@07\n@0Q9\n@0P\n", Bounds(cycle_s=9.0))
    told = outcomes(report, Bounds(cycle_s=9.0))
    assert told["refused"] == "1 finding"
    assert told["cycle"] == told["unpowered"] == "ok as far as made: 1 refused, of 3 commands"
    assert "the whole job (1 refused, of 3 commands)" in report.unseen
