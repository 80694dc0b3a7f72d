"""`isel-twin check --watch`: a process that judges a job again whenever its file has changed."""

from __future__ import annotations

import json
import signal
from pathlib import Path
from typing import Any

import pytest

from tests.forked import PATIENCE_S, start
from tests.in_process import isel_twin

JOB = "@07\n@0R7\n@0A1600,3000,0,30,0,30,0,30\n"


def test_a_file_is_judged_as_it_changes(tmp_path: Path) -> None:
    """Replaced as editors do, taken away, written anew; Ctrl-C ends with the code of the last verdict."""
    job, settings = tmp_path / "job.txt", tmp_path / "isel-twin.toml"
    job.write_text(JOB)

    def replaced(text: str) -> None:
        """Whole at any time."""
        (tmp_path / "new").write_text(text)
        (tmp_path / "new").rename(job)

    with start("check", "--watch", job, "--plant", "kinematic", "--json") as process:

        def told() -> dict[str, Any]:
            answer: dict[str, Any] = json.loads(process.stdout.readline())
            return answer

        def found() -> list[tuple[str, int]]:
            return [(each["rule"], each["line"]) for each in told()["findings"]]

        assert found() == []
        replaced(JOB + "@0Jfast\n")
        assert found() == [("refused", 4)]
        job.unlink()
        assert told()["error"] == f"{job}: No such file or directory; waiting for it"
        replaced(JOB + "@07 <300>\n")
        assert told()["error"].startswith(f"{job}: line 4: <300>")
        job.write_text(JOB)
        while (last := told()).get("error"):  # an empty file, if it was looked at then
            pass
        assert last["ok"]
        settings.write_text("[check]\nmargins = 0.1\n")
        while not (error := told().get("error")):  # the same
            pass
        assert error.startswith(f"{settings}:2: check.margins: ")
        settings.write_text("[check]\ncycle_s = 3.0\n")
        while not (found_now := told()).get("findings"):
            pass
        assert [(each["rule"], each["line"]) for each in found_now["findings"]] == [("cycle", 3)]
        process.send_signal(signal.SIGINT)
        assert process.wait(PATIENCE_S) == 1


@pytest.mark.parametrize("more", [("b.txt",), ("--workers", "2"), ("--junit", "x.xml"), ("--report", "pages")])
def test_one_job_is_watched_and_told_here(more: tuple[str, ...]) -> None:
    done = isel_twin("check", "--watch", "a.txt", *more)
    assert (done.returncode, done.stderr.split(":")[1].strip()) == (2, "--watch")
