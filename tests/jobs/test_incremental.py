"""A job judged again after a change is judged as if for the first time, and most of it is not played again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import pytest

from isel_twin.base.crew import GivenUp
from isel_twin.cam.settings import CamSettings
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import Bounds, check_job
from isel_twin.jobs.checks.contour import Drawing, drawing
from isel_twin.jobs.checks.incremental import MOST, IncrementalCheck
from isel_twin.jobs.golden import Golden
from isel_twin.jobs.job import JobError, Line, parse_job
from isel_twin.jobs.toolpaths import source_of
from isel_twin.language import create_language
from isel_twin.machine import Fixture
from tests.jobs.edits import LINES, differences

pytestmark = pytest.mark.long(seconds=4)

CALL = TwinSpec(plant="kinematic")
JOB = "@07\n@0R7\n" + "".join(f"@0A{step},2000,0,30,0,30,0,30\n" for step in range(40, 60))
HERE = Path("job.txt")


def lines(text: str) -> Sequence[Line]:
    return parse_job(text, create_language("imc-s8"), "imc-s8")


def checked(*texts: str, call: TwinSpec = CALL, bounds: Bounds | None = None) -> list[int]:
    """How many lines are played for each text, whose report is that of a fresh check."""
    bounds = bounds or Bounds()
    check, played = IncrementalCheck(HERE, call, bounds), []
    for text in texts:
        assert check.check(lines(text)) == check_job(HERE, call, lines(text), bounds)
        played.append(check.played)
    return played


@pytest.mark.parametrize("controller", LINES)
def test_random_changes(controller: str) -> None:
    """Lines of it put in, taken out and changed, conditions, refusals, remarks, judgements given up half-way; more of
    it: python -m tests.jobs.edits 200."""
    assert differences(controller, "kinematic", seed=1, number=6, length=10) == []


def test_random_changes_with_physics() -> None:
    assert differences("imc-s8", "mujoco", seed=2, number=3, length=6) == []


@pytest.mark.parametrize("refused", [False, True])
def test_without_a_golden_run_to_compare_with_all_else_is_the_same(refused: bool) -> None:
    text = JOB.replace("@0A55,", "@0A9999999,") if refused else JOB
    whole = check_job(HERE, CALL, lines(text))
    assert check_job(HERE, CALL, lines(text), golden=False) == replace(whole, golden=Golden())
    assert len(whole.golden.moves) == text.count("\n")
    check = IncrementalCheck(HERE, CALL, Bounds(), golden=False)
    check.check(lines(text.replace("@0A58,", "@0A7,")))
    assert check.check(lines(text)) == replace(whole, golden=Golden())


def test_what_a_change_costs() -> None:
    """The lines from the changed one on; a remark or an empty line the last line only; a line more itself and the one
    before it; one less the last one that is left."""
    changed = JOB.replace("@0A55,", "@0A8,")
    remark = "# remark\n\n" + changed
    more = remark + "@0P\n"
    assert checked(JOB, changed, remark, more, remark, JOB.replace("@07", "@0n7")) == [22, 5, 1, 2, 1, 22]


def test_what_was_found_before_has_the_numbers_of_its_lines() -> None:
    job = JOB.replace("@0A41,", "@0Jfast\n@0A41,")
    check = IncrementalCheck(HERE, CALL, Bounds())
    assert [finding.line for finding in check.check(lines(job)).findings] == [4]
    assert [finding.line for finding in check.check(lines("\n\n" + job)).findings] == [6]
    assert check.played == 1


def test_a_line_that_ends_the_job_ends_it_again() -> None:
    """5000 steps at 30 a second are not over in 40 s."""
    waits = JOB.replace("@0A50,2000", "@0A5000,30")
    assert checked(JOB, waits, waits + "@0P\n", JOB, bounds=Bounds(timeout_s=40.0)) == [22, 1, 1, 10]


def test_a_judgement_that_nobody_waits_for_is_given_up_and_goes_on_from_there() -> None:
    check, left = IncrementalCheck(HERE, CALL, Bounds()), iter(range(60))
    with pytest.raises(GivenUp):
        check.check(lines(JOB), lambda: next(left, None) is None)
    assert check.check(lines(JOB)) == check_job(HERE, CALL, lines(JOB))
    assert 0 < check.played < 22


def test_a_condition_that_cannot_be_looked_at_leaves_all_as_it_was() -> None:
    check = IncrementalCheck(HERE, CALL, Bounds())
    check.check(lines(JOB))
    with pytest.raises(JobError, match="line 23"):
        check.check(lines(JOB + "! nonsense == 1\n"))
    check.check(lines(JOB))
    assert check.played == 1


def test_the_states_that_are_kept_are_bounded() -> None:
    check, text = IncrementalCheck(HERE, CALL, Bounds()), "@07\n" + "@0P\n" * 100
    check.check(lines(text))
    for _ in range(4):
        text += "@0P\n"
        check.check(lines(text))
    assert len(check._saved) == MOST
    assert check.played == 2


def test_what_is_nearest_is_looked_for_from_the_beginning() -> None:
    block = Fixture("block", "box", (20.0, 20.0, 20.0), (200.0, 100.0, 10.0))
    assert checked(JOB, JOB, call=CALL.with_(fixtures=(block,)), bounds=Bounds(clearance=20.0)) == [22, 22]


def test_of_a_cam_program_the_written_lines_are_compared() -> None:
    part = "G21 G90 F600\nG1 X5\nG1 X7\nG1 X9 Y3\nG1 X2\nM2\n"

    def written(text: str) -> tuple[Sequence[Line], Drawing]:
        language = create_language("imc-s8")
        source = source_of(text.encode(), ".nc", language, "imc-s8", CALL.fitted, CamSettings())
        assert source is not None
        return source.lines, drawing(source.path(), CamSettings(), 1e-4)

    bounds = Bounds(contour_mm=1e-4, spindle=False)  # of which half a step is more
    check = IncrementalCheck(Path("part.nc"), CALL, bounds)
    played = []
    for text in (part, part.replace("G1 X7", "(deeper)\nG1 X7"), part.replace("X2", "X3")):
        lines, drawn = written(text)
        again = check.check(lines, drawn=drawn)
        assert again == check_job(Path("part.nc"), CALL, lines, bounds, drawn=drawn)
        assert {finding.rule for finding in again.findings} == {"contour"}
        played.append(check.played)
    assert played[0] == len(written(part)[0])
    assert played[1] == 1
    assert 1 <= played[2] <= 3
