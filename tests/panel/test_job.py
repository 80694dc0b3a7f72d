"""A job file opened in the panel: sent line by line, with what becomes of it in the frames."""

from __future__ import annotations

import socket
from pathlib import Path

import pytest

from isel_twin.bridge.operate.panel.job import MOST_CHARACTERS
from isel_twin.bridge.serve.tcp import parse_address
from tests.cam.wild import WILD
from tests.panel.conftest import WAIT_S

JOB = "# two moves\n@07\n@0R7\n@0A800,4000,0,30,0,30,0,30\n<0.5s>\n@0P => *\n! x > 2 mm\n"
PART = "G21 G90\nG0 X5\nG1 Y4 F600\nM2\n"


def opened(page, text: str = JOB, name: str = "job.txt"):
    return page.request(job={"open": {"name": name, "text": text}})


def ran(page) -> dict:
    """The job as it is when it is over."""
    started = page.request(job={"start": True})["ok"]["started"]
    page.until(lambda: page.frame["job"].get("started") == started and page.frame["job"]["state"] != "running")
    return page.frame["job"]


@pytest.mark.parametrize("speed", [None, 50.0])
def test_a_job_is_made_line_by_line(bench, browser, speed: float | None) -> None:
    """At any speed: a pause of half a second and a move of 800 steps at 4000 Hz are at least 0.7 s."""
    here = bench(speed=speed)
    page = browser(here)
    assert page.frame["job"] == {}
    told = opened(page)["ok"]
    assert {key: told[key] for key in ("name", "format", "state", "made", "commands", "line")} == {
        "name": "job.txt", "format": "", "state": "ready", "made": 0, "commands": 6, "line": 2
    }  # fmt: skip
    done = ran(page)
    assert (done["state"], done["made"], done["why"]) == ("done", 6, "")
    assert done["seconds"] > 0.7
    assert here.twin.counts[:3].tolist() == [800, 0, 0]
    said = [line["text"] for line in page.lines if line["who"] == "host"]
    assert said == ["@07", "@0R7", "@0A800,4000,0,30,0,30,0,30", "@0P"]
    assert ran(page)["state"] == "done", "it can be made again"


def test_a_file_of_a_cam_program_is_one_of_its_own_lines(bench, browser) -> None:
    here = bench()
    page = browser(here)
    told = opened(page, PART, "part.nc")["ok"]
    assert told["format"].startswith("G-code")
    assert ran(page)["state"] == "done"
    assert here.twin.counts[:3].tolist() == [1600, 1280, 0]
    assert page.frame["job"]["line"] <= 4
    assert page.request(job={"text": True})["ok"] == {"opened": 1, "text": PART}


def test_a_part_of_a_file_is_made_until_another_is_opened(bench, browser) -> None:
    """By the file X 30 alone is passed at Y 0: from line 4 on the way leads over X 5 Y 4 instead."""
    here = bench()
    page = browser(here)
    opened(page, "G21 G90\nG0 X30\nG0 X5 Y4\nG1 Y8 F600\nG1 X9\nM2\n", "part.nc")
    part = page.request(job={"part": {"from_line": 4, "to_line": 4}})["ok"]
    assert (part["from_line"], part["to_line"], part["state"]) == (4, 4, "ready")
    done = ran(page)
    assert (done["state"], done["not_made"]) == ("done", "lines 1 to 3 and all after line 4")
    assert here.twin.counts[:3].tolist() == [1600, 2560, 0]
    assert not [line for line in page.lines if line["who"] == "host" and "9600" in line["text"]], "X 30"
    assert page.request(job={"part": {}})["ok"]["not_made"] == ""
    page.request(job={"part": {"from_line": 5}})
    assert opened(page, PART, "part.nc")["ok"]["from_line"] == 1


@pytest.mark.parametrize(
    ("part", "why"),
    [
        ({"from_line": 5, "to_line": 4}, "to-line 4: is before line 5"),
        ({"from_line": 0}, "request: job.part.from_line: 0"),
        ({"from_line": 1.5}, "request: job.part.from_line: 1.5; allowed: a whole number"),
        ({"from_line": "2"}, "request: job.part.from_line: '2'"),
        ({"line": 2}, "request: job.part.line: unknown key"),
        ({"from_line": 4}, "nothing moves the tool from line 4 on: its last motion before is in line 3"),
    ],
)
def test_a_part_that_is_refused_leaves_the_one_before(bench, browser, part, why: str) -> None:
    page = browser(bench())
    opened(page, PART, "part.nc")
    page.request(job={"part": {"from_line": 3}})
    assert why in page.request(job={"part": part})["error"]
    assert page.request(job={"stop": True})["ok"]["not_made"] == "lines 1 to 2"


def test_a_job_of_commands_has_no_part(bench, browser) -> None:
    page = browser(bench())
    opened(page)
    assert "only a file of a CAM program can be made in part" in page.request(job={"part": {"from_line": 3}})["error"]


def test_a_refusal_ends_it_and_is_told_with_its_line(bench, browser) -> None:
    page = browser(bench(ready=True))
    opened(page, "@0P\n@0A800,99999999,0,30,0,30,0,30\n@0P\n")
    failed = ran(page)
    assert (failed["state"], failed["made"], failed["line"]) == ("failed", 1, 2)
    assert failed["why"].startswith("@0A800,99999999")
    page.until(lambda: [line for line in page.lines if line["who"] == "twin" and line["text"] != "0"])


def test_a_condition_that_is_not_met_ends_it(bench, browser) -> None:
    page = browser(bench(ready=True))
    opened(page, "@0P\n! x > 300 mm\n")
    assert ran(page)["why"].startswith("! x > 300 mm")


def test_stop_breaks_off_what_moves(bench, browser) -> None:
    here = bench(speed=1.0, ready=True)
    page = browser(here)
    opened(page, "@0A64000,4000,0,30,0,30,0,30\n@0P\n")
    assert page.request(job={"start": True})["ok"]["state"] == "running"
    page.until(lambda: page.frame["counts"][0] > 0)
    assert "a job is running" in page.request(say="@0P")["error"]
    assert "is running" in opened(page)["error"]
    assert "is running" in page.request(job={"start": True})["error"]
    assert "it is running; allowed: when it is paused or over" in page.request(job={"line": True})["error"]
    assert page.request(job={"stop": True})["ok"]["state"] == "stopped"
    page.until(lambda: page.frame["idle"])
    assert 0 < page.frame["counts"][0] < 64_000
    assert page.frame["job"]["why"] == "stopped by hand"


def test_a_host_that_takes_the_line_ends_it(bench, browser) -> None:
    here = bench(speed=1.0, ready=True)
    page = browser(here)
    opened(page, "@0A64000,4000,0,30,0,30,0,30\n@0P\n")
    page.request(job={"start": True})
    with socket.create_connection(parse_address(here.line.address), timeout=WAIT_S):
        page.until(lambda: page.frame["job"].get("state") == "stopped")
        assert page.frame["job"]["why"] == "a host has taken the line (tcp)"
        assert "a host holds the line (tcp)" in page.request(job={"start": True})["error"]


def test_it_goes_on_only_while_time_does(bench, browser) -> None:
    page = browser(bench(ready=True))
    page.ask(pause=True)
    opened(page, "@0P\n<1s>\n@0P\n")
    page.request(job={"start": True})
    assert page.request(job={"text": True})["ok"]["text"].startswith("@0P")
    page.until(lambda: page.frame["job"].get("state") == "running")
    assert page.frame["job"]["made"] == 0
    page.ask(resume=True)
    page.until(lambda: page.frame["job"].get("state") == "done")
    assert page.frame["job"]["seconds"] == pytest.approx(1.0, abs=0.1)


def test_a_program_of_a_control_is_started_and_waits_for_its_operator(bench, browser) -> None:
    page = browser(bench(controller="bwo900", machine="4030-servo"))
    opened(page, "P1\nN10 G90 G53 G0 X5\nN20 M30\n#\n", "part.nc")
    done = ran(page)
    assert (done["state"], done["commands"]) == ("done", 3)
    assert page.frame["counts"][0] == 5000


@pytest.mark.parametrize(
    ("request_", "why"),
    [
        ({"open": {"name": "x", "text": "@0P\n<999>"}}, "x: line 2: "),
        ({"open": {"name": "x", "text": ""}}, "x: there is no command in it"),
        ({"open": {"name": "x.nc", "text": "G1 X9999 F100\n"}}, "x.nc: line 1, column "),
        ({"open": {"name": "x", "text": "! spam > 5\n"}}, "x: line 1"),
        ({"open": {"name": "x", "text": "#" * (MOST_CHARACTERS + 1)}}, "isel-twin run takes more"),
        ({"open": {"name": "x", "text": "@0P\ud800"}}, "x: "),
        ({"open": {"name": "\ud800.nc", "text": "<999>"}}, "line 1: "),
        ({"open": 5}, "request: job.open: "),
        ({"open": {"name": 5}}, "request: job.open.name: "),
        ({"open": {"path": "/etc/passwd"}}, "request: job.open.path: unknown key"),
        ({"start": True}, "request: job.start: there is no job"),
        ({"start": 1, "stop": True}, "allowed: one of open, text, part, start, line, pause, go_on, stop"),
        ({"part": {"from_line": 2}}, "request: job.part: there is no job"),
        ({"part": True}, "request: job.part: "),
        ({"stop": False}, "request: job.stop: False; allowed: true"),
        ({"run": True}, "request: job.run: unknown key"),
        (5, "request: job: "),
    ],
)
def test_what_cannot_be_done_is_one_line_and_changes_nothing(bench, browser, request_, why: str) -> None:
    page = browser(bench())
    error = page.request(job=request_)["error"]
    assert why in error
    assert "\n" not in error
    assert page.request(job={"stop": True})["ok"] == {}
    assert page.request(job={"text": True})["ok"] == {"opened": 0, "text": ""}


def test_a_file_that_is_refused_leaves_the_one_before(bench, browser) -> None:
    page = browser(bench(ready=True))
    opened(page, "@0P\n")
    assert "error" in opened(page, "<999>\n", "other.txt")
    assert ran(page)["name"] == "job.txt"


@pytest.mark.parametrize("name", ["fusion.nc", "vectric.ncp", "estlcam.nc"])
def test_a_file_as_owners_have_it_is_run_and_refused_in_its_own_lines(
    bench, browser, name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As a page reads it: what is no UTF-8 becomes a mark. A word that is wrong in the last line leaves the file
    before."""
    (tmp_path / "isel-twin.toml").write_text("[cam]\nzero = [100, 80, 40]\n")
    monkeypatch.chdir(tmp_path)
    here = bench(ready=True)
    page = browser(here)
    text = WILD[name].decode(errors="replace")
    assert opened(page, text, name)["ok"]["format"] == ("NCP" if name == "vectric.ncp" else "G-code")
    seen: set[int] = set()
    page.hear, hear = lambda: (hear(), seen.add(page.frame["job"].get("line", 0)))[0], page.hear
    assert ran(page)["state"] == "done"
    assert seen <= set(range(text.count("\n") + 2))
    assert here.twin.counts[:2].tolist() == [41600, {"fusion.nc": 31360}.get(name, 32000)]
    wrong = text.rstrip("\x1a\r\n%").rpartition("\n")[0] + "\nG1 X1 Q5\n"
    line = wrong.count("\n")
    assert f"{name}: line {line}, column " in opened(page, wrong, name)["error"]
    assert page.request(job={"text": True})["ok"]["text"] == text


def test_what_ends_a_cam_file_half_way_is_told_with_its_line(
    bench, browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "isel-twin.toml").write_text("[cam]\nzero = [100, 80, 40]\n")
    monkeypatch.chdir(tmp_path)
    page = browser(bench(speed=4.0, ready=True))
    opened(page, WILD["vectric.ncp"].decode(errors="replace"), "vectric.ncp")
    page.request(job={"start": True})
    page.until(lambda: page.frame["job"].get("line") == 18)
    page.ask(set={"estop": "pressed"})
    page.until(lambda: page.frame["job"]["state"] != "running")
    assert page.frame["job"]["state"] == "failed"
    assert page.frame["job"]["line"] in (18, 19)
    assert page.frame["job"]["command"].startswith("@0")


def test_a_cam_file_that_became_a_program_is_shown_line_by_line(
    bench, browser, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The BWO 900 makes a program by itself, and tells its blocks: they are lines of the file, and so is the one in
    which the E-stop ends it."""
    (tmp_path / "isel-twin.toml").write_text("[cam]\nzero = [100, 80, 40]\n")
    monkeypatch.chdir(tmp_path)
    page = browser(bench(speed=4.0, controller="bwo900", machine="4030-servo"))
    opened(page, WILD["vectric.ncp"].decode(errors="replace"), "vectric.ncp")
    page.request(job={"start": True})
    page.until(lambda: page.frame["job"].get("line") == 13)
    page.until(lambda: page.frame["job"]["line"] == 18)
    page.ask(set={"estop": "pressed"})
    page.until(lambda: page.frame["job"]["state"] != "running")
    assert page.frame["job"]["state"] == "failed"
    assert page.frame["job"]["line"] in (18, 19)


BELOW = "G21 G90\nG0 Z5\nG0 X10 Y5\nG1 Z-2 F600\nG0 Z5\nM2\n"


def test_a_file_beyond_the_travel_is_opened_with_a_zero_that_fits(bench, browser) -> None:
    """The desk has that zero then, until it is set anew; a refusal changes neither job nor desk."""
    here = bench(ready=True)
    page = browser(here)
    opened(page, PART, "part.nc")
    refused = opened(page, BELOW, "below.nc")["error"]
    assert "below.nc: line 2, column 1: leads to Z -5.000 mm of the machine" in refused
    assert refused.endswith("Fit zero puts the zero of the workpiece to 0,0,10")
    assert "--zero" not in refused
    assert page.request(job={"text": True})["ok"]["text"] == PART
    told = page.request(job={"open": {"name": "below.nc", "text": BELOW, "zero": "fit"}})["ok"]
    assert (told["name"], told["state"]) == ("below.nc", "ready")
    page.until(lambda: page.frame["desk"]["zero_mm"] == [0.0, 0.0, 10.0])
    assert ran(page)["state"] == "done"
    step_mm = here.twin.step_mm[:3]
    assert (here.twin.counts[:3] * step_mm).tolist() == [10.0, 5.0, 5.0]
    assert "ok" in opened(page, BELOW, "below.nc"), "it fits as the desk stands"


def test_a_zero_that_fits_is_of_cam_files_only_and_no_other_word(bench, browser) -> None:
    page = browser(bench(ready=True))
    far = BELOW.replace("X10", "X500")
    for text, zero, why in (
        (JOB, "fit", "is a job of commands, which no zero moves"),
        (far.replace("G0 X500", "G0 X0\nG0 X500"), "fit", "along X the file is longer than the travel by 105 mm"),
        (BELOW, "best", "job.open.zero: 'best'; allowed: 'fit'"),
        (BELOW, [0, 0, 10], "job.open.zero: [0, 0, 10]; allowed: 'fit'"),
    ):
        assert why in page.request(job={"open": {"name": "a.nc", "text": text, "zero": zero}})["error"]
    assert page.frame["job"] == {}
    assert page.frame["desk"]["zero_mm"] == [0.0, 0.0, 0.0]
