"""A part of a CAM program's file by `run`, `check` and `convert`: the verdict names what is missing."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import pytest

from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=6)

SLOT = "G21 G90 F600\nM3 S9000\nG0 Z-5\nG0 X10 Y10\nG1 Z-8 F300\nG1 X30 F600\nG1 Y40\nG1 X50\nG0 Z-5\nM30\n"
KINEMATIC = ("--plant", "kinematic")
PART = ("--from-line", "7", "--to-line", "8")
MISSING = "lines 1 to 6 and all after line 8"


@pytest.fixture
def slot(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "slot.nc").write_text(SLOT)
    return tmp_path / "slot.nc"


def test_run_tells_what_is_not_made_and_makes_the_rest(slot: Path) -> None:
    """320 steps a millimetre: down at X 30 Y 10 to Z 8, lines 7 and 8, and up to where the tool came from."""
    made = isel_twin("run", "slot.nc", *PART, *KINEMATIC, "--json")
    *results, summary = map(json.loads, made.stdout.splitlines())
    assert made.returncode == 0
    assert summary["not_made"] == MISSING
    motions = [result for result in results if result["command"].startswith("@0M")]
    at = [[round(count / 320, 6) for count in result["counts"][:3]] for result in motions]
    assert at == [[30, 10, 0], [30, 10, 5], [30, 10, 8], [30, 40, 8], [50, 40, 8], [50, 40, 0]]
    assert [result["number"] for result in motions] == [7, 7, 7, 7, 8, 8]
    assert [result["number"] for result in results if result["command"] == "@0B2,1"] == [2], "spindle"
    told = isel_twin("run", "slot.nc", *PART, *KINEMATIC, "--report", "run.html").stdout
    assert f">OK, but {MISSING} not made</p>" in Path("run.html").read_text()
    assert f"all well as far as simulated, but {MISSING} not made: " in told
    whole = isel_twin("run", "slot.nc", *KINEMATIC, "--json").stdout.splitlines()[-1]
    assert "not_made" not in json.loads(whole)


def test_a_part_that_fails_names_it_too(slot: Path) -> None:
    """A reference run takes longer than half a second."""
    made = isel_twin("run", "slot.nc", *PART, *KINEMATIC, "--timeout", "0.5")
    assert made.returncode == 1
    assert f"failed, but {MISSING} not made: " in made.stdout


def test_check_counts_it_to_what_was_not_looked_at(slot: Path) -> None:
    made = isel_twin(
        "check", "slot.nc", *PART, *KINEMATIC, "--junit", "j.xml", "--sarif", "s.sarif", "--report", "page"
    )
    assert made.returncode == 0
    assert f"\n  not looked at: {MISSING}, lost," in made.stdout
    assert made.stdout.endswith("1 job: all well as far as looked at\n")
    case = ElementTree.parse("j.xml").getroot().find(".//testcase/system-out")
    assert case is not None
    assert MISSING in str(case.text)
    assert MISSING in Path("s.sarif").read_text()
    assert f">OK, but {MISSING} not made</p>" in Path("page/slot.html").read_text()
    told = json.loads(isel_twin("check", "slot.nc", *PART, *KINEMATIC, "--json").stdout)
    assert told["not_looked_at"][0] == told["verdict"]["not_made"] == MISSING


def test_findings_stand_in_the_lines_of_the_file(slot: Path) -> None:
    """Line 8 leads to X 999, beyond the travel; a part before it does not."""
    slot.write_text(SLOT.replace("X50", "X999"))
    beyond = isel_twin("check", "slot.nc", "--from-line", "7", *KINEMATIC)
    assert beyond.returncode != 0
    assert "line 8, column 1: leads to X 999.000 mm" in beyond.stdout + beyond.stderr
    assert isel_twin("check", "slot.nc", "--from-line", "6", "--to-line", "7", *KINEMATIC).returncode == 0


def test_the_way_of_a_part_is_judged_from_where_it_begins(slot: Path) -> None:
    made = isel_twin("check", "slot.nc", *PART, "--contour-mm", "0.05")
    assert (made.returncode, made.stdout.splitlines()[-1]) == (0, "1 job: all well as far as looked at")


def test_a_golden_run_is_not_compared_with_a_part(slot: Path) -> None:
    assert isel_twin("golden", "record", "slot.nc", *KINEMATIC).returncode == 0
    assert isel_twin("check", "slot.nc", *KINEMATIC).returncode == 0
    assert isel_twin("check", "slot.nc", *PART, *KINEMATIC).returncode == 0
    refused = isel_twin("check", "slot.nc", *PART, *KINEMATIC, "--golden")
    assert refused.returncode == 2
    assert refused.stderr.startswith("isel-twin: --golden: a golden run is one of the whole file")


def test_convert_tells_it_beside_the_commands(slot: Path) -> None:
    made = isel_twin("convert", "slot.nc", *PART)
    assert made.stderr.splitlines()[-1] == f"isel-twin: slot.nc: {MISSING} not made"
    targets = [line.split(",")[0:5:2] for line in made.stdout.splitlines() if line.startswith("@0M")]
    assert targets[-2:] == [["@0M16000", "12800", "2560"], ["@0M16000", "12800", "0"]]


@pytest.mark.parametrize("command", ["run", "check", "convert"])
@pytest.mark.parametrize(
    ("lines", "why"),
    [
        (("--from-line", "0"), "--from-line 0: lines of a file count from 1"),
        (("--from-line", "5", "--to-line", "4"), "--to-line 4: is before line 5"),
        (("--from-line", "10"), "slot.nc: nothing moves the tool from line 10 on: its last motion before is in line 9"),
        (("--from-line", "1.5"), "1.5 is no whole number"),
    ],
)
def test_lines_without_a_part_are_one_line_of_refusal(slot: Path, command: str, lines: Any, why: str) -> None:
    made = isel_twin(command, "slot.nc", *lines)
    assert made.returncode == 2
    assert why in made.stderr
    assert len(made.stderr.splitlines()) == 1


@pytest.mark.parametrize("off", ["M5", "M6 T2"])
def test_a_part_behind_what_has_switched_the_spindle_off_fails_as_the_whole_file(slot: Path, off: str) -> None:
    slot.write_text(SLOT.replace("G0 X10 Y10\n", f"G0 X10 Y10 {off}\n"))
    for part in ((), ("--from-line", "7"), ("--from-line", "4")):
        made = isel_twin("check", "slot.nc", *part)
        assert made.returncode == 1
        assert "the spindle stands in this cut: line 4 has switched it off" in made.stdout


def test_a_part_behind_a_spindle_that_never_turned_says_so_once(slot: Path) -> None:
    slot.write_text(SLOT.replace("M3 S9000", "M5"))
    made = isel_twin("check", "slot.nc", "--from-line", "7")
    assert made.returncode == 0
    assert made.stdout.count("nothing in it switches a spindle on") == 1


@pytest.mark.parametrize("named", [("slot.nc", "other.nc"), (".",), ()], ids=["files", "folder", "project"])
def test_lines_of_two_files_are_not_one_part(slot: Path, named: tuple[str, ...]) -> None:
    (slot.parent / "other.nc").write_text(SLOT)
    with (slot.parent / "isel-twin.toml").open("a") as settings:
        settings.write('[check]\njobs = ["*.nc"]\n')
    made = isel_twin("check", *named, *PART)
    assert made.returncode == 2
    assert "name one job" in made.stderr


@pytest.mark.parametrize(
    ("text", "how"),
    [
        ("# home\n@07\n@0R7\n@0P\n", ()),
        ("P1\nN10 G90 G53 G0 X5\nN20 M30\n#\n", ("--controller", "bwo900", "--machine", "4030-servo")),
    ],
)
def test_a_job_of_commands_and_a_program_have_no_part(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, text: str, how: tuple[str, ...]
) -> None:
    monkeypatch.chdir(tmp_path)
    Path("job").write_text(text)
    for command in ("run", "check"):
        made = isel_twin(command, "job", "--from-line", "2", *how, *KINEMATIC)
        assert made.returncode == 2
        assert "job: only a file of a CAM program can be made in part" in made.stderr


def test_the_remedy_for_a_job_of_commands_is_one(tmp_path: Path) -> None:
    """The last move of two as a file of its own, behind the reference run."""
    job = tmp_path / "own.txt"
    job.write_text("@07\n@0R7\n@0M3200,3000,1600,3000,0,30,0,30\n")
    made = isel_twin("run", job, *KINEMATIC, "--json")
    assert (made.returncode, json.loads(made.stdout.splitlines()[-1])["counts"][:2]) == (0, [3200, 1600])
