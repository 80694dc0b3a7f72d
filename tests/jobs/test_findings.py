"""Findings that are rare in a job: what each of them says, and of which line (docs/ci.md, rules)."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import Bounds, Finding
from isel_twin.jobs.checks.job import Inspection
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from isel_twin.machine import Fixture

JOB = "@07\n@0N7\n\n@0A320,3000,0,30,0,30,0,30\n"
LAST = 4  # the line of the move


def inspected(bounds: Bounds | None = None, **spec: Any) -> tuple[Inspection, Any]:
    inspection = Inspection(TwinSpec(plant="kinematic", start_mm=(50.0, 50.0, 2.0), **spec).build(), bounds)
    lines = parse_job(JOB, create_language("imc-s8"), "imc-s8")
    return inspection, played(inspection.twin, lines, [inspection.take]).verdict


@pytest.mark.parametrize(
    ("changed", "rule", "line", "message"),
    [
        (
            {"lost_steps": (0.0, 31.0, 0.0, 0.0), "slip_steps": (64.0,) * 4},
            "halfway",
            LAST,
            "y stopped half a slip off, held there by friction alone",
        ),
        ({"stores_lost": 1}, "fault", None, "the flash memory did not keep what was stored"),
        ({"unsent": 1}, "unfinished", LAST, "1 line is not sent"),
        ({"unsent": 3}, "unfinished", LAST, "3 lines are not sent"),
        ({"events_after_end": 1}, "effect", None, "1 event of the scenario after the end of the job"),
        ({"events_after_end": 2}, "effect", None, "2 events of the scenario after the end of the job"),
    ],
)
def test_what_the_end_of_a_job_shows(changed: dict[str, Any], rule: str, line: int | None, message: str) -> None:
    inspection, verdict = inspected()
    (finding,) = inspection.report("job", replace(verdict, **changed)).findings
    assert (finding.rule, finding.line, finding.message) == (rule, line, message)


def test_a_margin_is_told_in_per_cent() -> None:
    inspection, verdict = inspected(Bounds(margin=0.5))
    result = replace(inspection.results[-1], margin=(0.375, None, 0.5, None))
    inspection.take(result)
    findings = inspection.report("job", verdict).findings
    told = [(one.line, one.message) for one in findings if one.rule == "margin"]
    assert told == [(LAST, "x keeps 38 % torque; at least 50 %")]


def test_who_met_behind_the_last_line_is_told_there() -> None:
    """A plate, 100 mm high on its side, under the tool, which is 47 mm above it where Z is 0."""
    inspection, verdict = inspected(fixtures=(Fixture("plate", "box", (40.0, 40.0, 100.0), (51.0, 50.0, 0.0)),))
    inspection.twin.query("@0A0,30,0,30,16000,9600,0,30")
    (finding,) = [one for one in inspection.report("job", verdict).findings if one.rule == "collision"]
    assert finding.line == LAST
    assert "plate" in finding.message


def test_a_place_in_a_program_is_line_and_column() -> None:
    assert Finding("refused", "", 3, at=(3, 7)).place == "line 3, column 7"
    assert (Finding("refused", "", 3).place, Finding("refused", "").place) == ("line 3", "")
