"""What a file of a CAM program may mean otherwise: every tool that takes the file says it, once, with its line.

The file names no unit; it wants 24 000 mm/min, 400 mm/s, of a machine that makes 125 mm/s or less; and it cuts
above the height at which it travels.
"""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from sarif_pydantic import Sarif

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.jobs.checks.live import LiveJob
from isel_twin.jobs.checks.watched import Watched

pytestmark = pytest.mark.long(seconds=3)

FILE = "G0 X10 Y10 Z1\nG1 X20 F24000\nG1 Z5\nM2\n"
SAID = {1: "numbers are read as mm", 2: "a feed of 400 mm/s is more than the machine makes", 4: "count downwards"}
SETTINGS = '[cam]\nzero = [100, 80, 30]\n[check]\nplant = "kinematic"\nspindle = false\n'
CALLS = [("imc-s8", "4030"), ("ismif", "4030"), ("gmi99", "4030-servo"), ("bwo900", "4030-servo")]

Call = Callable[..., tuple[int, str, str]]


@pytest.fixture
def job(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "isel-twin.toml").write_text(SETTINGS)
    (tmp_path / "part.nc").write_text(FILE)
    return Path("part.nc")


@pytest.fixture
def call(capsys: pytest.CaptureFixture[str]) -> Call:
    def run(*words: object) -> tuple[int, str, str]:
        with pytest.raises(SystemExit) as ended:
            main([str(word) for word in words])
        said = capsys.readouterr()
        return int(ended.value.code or 0), said.out, said.err

    return run


def once(told: str, *without: int) -> None:
    """Each of them stands in it once, its line before it."""
    for number, words in SAID.items():
        if number in without:
            continue
        assert told.count(words) == 1, told
        assert f"line {number}: " in told.partition(words)[0].splitlines()[-1]


@pytest.mark.parametrize(("controller", "machine"), CALLS)
def test_run_and_check_say_each_once(controller: str, machine: str, job: Path, call: Call) -> None:
    """A BWO 900 takes every feed, and has its own limits."""
    without = [2] if controller == "bwo900" else []
    twin = ("--controller", controller, "--machine", machine, "--plant", "kinematic")
    code, out, _ = call("run", job, *twin)
    assert code == 0
    once(out, *without)
    code, out, _ = call("check", job, *twin)
    assert code == 0
    once(out, *without)


def test_so_do_formats_for_programs(job: Path, call: Call, monkeypatch: pytest.MonkeyPatch) -> None:
    (*_, summary) = map(json.loads, call("run", job, "--plant", "kinematic", "--json")[1].splitlines())
    once("\n".join(summary["job_file"]["cautions"]))
    code, out, _ = call("check", job, "--json", "--junit", "out.xml", "--sarif", "out.sarif")
    assert code == 0
    found = json.loads(out)["findings"]
    assert [(one["rule"], one["level"], one["line"]) for one in found] == [("caution", "warning", n) for n in SAID]
    assert Path("out.xml").read_text().count("caution: ") == len(SAID)
    (run,) = Sarif.model_validate_json(Path("out.sarif").read_text()).runs
    assert [one.rule_id for one in run.results or []] == ["caution"] * len(SAID)
    assert [one.locations[0].physical_location.region.start_line for one in run.results or []] == list(SAID)
    monkeypatch.setenv("GITHUB_ACTIONS", "true")
    assert call("check", job)[1].count("::warning file=part.nc,line=") == len(SAID)


@pytest.mark.parametrize("how", ["option", "file", "both"])
def test_strict_makes_them_a_failure(how: str, job: Path, call: Call) -> None:
    Path("isel-twin.toml").write_text(SETTINGS + ("strict = true\n" if how != "option" else ""))
    options = {"option": ["--strict"], "file": [], "both": ["--no-strict"]}[how]
    code, out, _ = call("check", job, *options, "--junit", "out.xml", "--sarif", "out.sarif")
    assert code == (0 if how == "both" else 1)
    once(out)
    assert (": failed (" in out) == (how != "both")
    assert ("<failure" in Path("out.xml").read_text()) == (how != "both")
    (run,) = json.loads(Path("out.sarif").read_text())["runs"]
    assert [one["level"] for one in run["results"]].count("error") == (0 if how == "both" else len(SAID))


def test_strict_makes_every_warning_a_failure(job: Path, call: Call) -> None:
    """A bound for the contour of a job that is no file of a CAM program has no effect, which is a warning."""
    Path("job.txt").write_text("@07\n@0R7\n")
    assert call("check", "job.txt", "--contour-mm", "1")[0] == 0
    assert call("check", "job.txt", "--contour-mm", "1", "--strict")[0] == 1
    assert call("check", "job.txt", "--strict")[0] == 0


def test_golden_runs_pages_and_what_plays_the_file_otherwise_say_them(job: Path, call: Call) -> None:
    once(call("golden", "record", job, "--plant", "kinematic")[1])
    once(call("golden", "compare", job)[1])
    once("\n".join(json.loads(call("golden", "compare", job, "--json")[1])["cautions"]))
    once(call("convert", job, "-o", "made.txt")[2])
    Path("plan.toml").write_text('[sweep]\njob = "part.nc"\nplant = "kinematic"\n')
    once(call("sweep", "plan.toml", "--workers", "1")[2])
    call("run", job, "--plant", "kinematic", "--report", "run.html")
    call("check", job, "--report", "pages")
    for page in (Path("run.html"), Path("pages/part.html")):
        text = page.read_text()
        for number, words in SAID.items():
            assert len(re.findall(f"<p>[^<]*{words}[^<]*</p>", text)) == 1
            assert text.count(f"<a href='#line-{number}'>line {number}</a>") == 1


def test_an_editor_and_a_test_are_told(job: Path) -> None:
    report = LiveJob(job).report(FILE.encode())
    assert [(one.rule, one.line, one.warning) for one in report.findings] == [("caution", n, True) for n in SAID]
    with pytest.warns(UserWarning, match="line") as warned:
        Watched(Twin(plant="kinematic")).play(job)
    once("\n".join(str(one.message) for one in warned))
    assert all(str(one.message).startswith("part.nc: line ") for one in warned)


def test_a_file_that_moves_nothing_says_so_with_its_line(job: Path, call: Call) -> None:
    job.write_text("G21\nM2\n")
    assert call("check", job)[1].count("line 2: nothing in this file moves the tool") == 1


def test_the_panel_keeps_them_in_sight(job: Path) -> None:
    from isel_twin.bridge.operate.panel.job import PanelJob

    panel: Any = PanelJob(None, Twin(plant="kinematic"), Path("isel-twin.toml"), None)
    panel.ask({"open": {"name": "part.nc", "text": FILE}})
    once("\n".join(panel.shown["cautions"]))
    panel.ask({"open": {"name": "job.txt", "text": "@07\n"}})
    assert panel.shown["cautions"] == []
