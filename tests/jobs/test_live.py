"""A job file while it is written: its project's words count at once, and each line has its figures."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.base.errors import CallError
from isel_twin.jobs.checks.live import Figures, LiveJob
from isel_twin.jobs.job import JobError

JOB = b"@07\n@0R7\n@0A1600,3200,0,30,0,30,0,30\n@0P\n"
"""40 steps a mm ... 1600 steps at 3200 Hz, with ramps."""


@pytest.fixture
def live(tmp_path: Path) -> LiveJob:
    (tmp_path / "isel-twin.toml").write_text('[check]\nplant = "kinematic"\n')
    return LiveJob(tmp_path / "job.txt")


def rules(live: LiveJob, data: bytes = JOB) -> list[tuple[str, int | None]]:
    return [(finding.rule, finding.line) for finding in live.report(data).findings]


def test_bounds_that_change_count_at_once(live: LiveJob) -> None:
    settings = live.job.with_name("isel-twin.toml")
    assert (rules(live), live.played) == ([], 4)
    assert (rules(live), live.played) == ([], 1)
    settings.write_text('[check]\nplant = "kinematic"\ncycle_s = 10\n')
    assert (rules(live), live.played) == ([("cycle", 4)], 4)
    settings.write_text("[check]\nmargins = 0.1\n")
    with pytest.raises(CallError, match=r"isel-twin.toml:2: check.margins"):
        live.report(JOB)


def test_a_golden_run_is_compared(live: LiveJob) -> None:
    from tests.in_process import isel_twin

    live.job.write_bytes(JOB)
    assert rules(live, JOB.replace(b"1600", b"1500")) == [], "there is none yet"
    assert isel_twin("golden", "record", live.job, "--plant", "kinematic").returncode == 0
    assert rules(live) == []
    assert ("golden", 3) in rules(live, JOB.replace(b"1600", b"1500"))


def test_a_text_that_is_no_job_is_said_and_forgotten(live: LiveJob) -> None:
    for text, why in ((b"", "there is no command"), (b"\0\0", "UTF-16"), (b"@07 <300>\n", "line 1: <300> is neither")):
        with pytest.raises(JobError, match=why):
            live.report(text)
    assert rules(live) == []


def test_each_line_has_its_figures_and_its_words(live: LiveJob) -> None:
    """Ramps of 100 Hz/ms from 300 Hz: 29 ms up and down, 101.5 steps of 1600, and what is left at 3200 Hz."""
    live.report(JOB)
    of = live.figures[3]
    assert of.seconds == pytest.approx((1600 - 101.5) / 3200 + 2 * 0.029, abs=0.02)
    assert (of.margin, of.edge, of.replies) == (None, None, ("0",))
    words = "1.500 s, x keeps 41 % torque, y: unstable above 1.20 times this speed"
    assert str(Figures(1.5, (0.41, "x"), (1.2, "y"))) == words
    known = Figures(1.5, (0.41, "x"), margin_band=(0.314, 0.473))
    assert str(known) == "1.500 s, x keeps 41 % (31 to 47 %) torque"
    (words,) = live.explained(3, "@0A1600,3200,0,30,0,30,0,30")
    assert "relative move by X 1600 at 3200 Hz" in words
    assert list(live.explained(4, "# a remark")) == []
