"""Files as owners have them: run, refused and judged in their own lines, whatever the tool that tells it."""

from __future__ import annotations

import json
import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import pytest

from tests.cam.wild import WILD
from tests.in_process import isel_twin

pytestmark = pytest.mark.long(seconds=6)

CONTROLLERS = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}
ORDER = [*CONTROLLERS]
SETTINGS = "[cam]\nzero = [100, 80, 40]\nplunge_mm_s = 10.0\ndepth_mm = 1.0\nfeed_mm_s = 10.0\nrapid_mm_s = 30.0\n"
CUTS = {  # lines in which each of them cuts, and where it stands at the end: mm as the counters show it
    "flatcam.nc": ({25, 27, 28}, (130.0, 100.0, 35.0)),
    "fusion.nc": ({17, 18, 19, 20, 21, 22}, (130.0, 98.0, 0.0)),
    "vectric.ncp": ({16, 18, 19}, (130.0, 100.0, 35.0)),
    "pcb2gcode.ngc": ({18, 19, 20}, (130.0, 100.0, 34.92)),
    "gerbv.ncp": ({14, 15, 16}, (130.0, 100.0, 38.0)),
    "inkscape.hpgl": ({1}, (100.0, 80.0, 35.0)),
    "kicad.drl": ({13, 14, 16}, (130.0, 100.0, 35.0)),
    "estlcam.nc": ({12, 13, 14}, (130.0, 100.0, 35.0)),
}
MOVES = {"imc-s8": "@0", "ismif": "L0", "gmi99": "h ", "bwo900": "N"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "isel-twin.toml").write_text(SETTINGS)
    for name, content in WILD.items():
        (tmp_path / name).write_bytes(content)
    return tmp_path


def call(controller: str) -> tuple[str, ...]:
    return "--controller", controller, "--machine", CONTROLLERS[controller]


@pytest.mark.parametrize(("name", "controller"), list(zip(WILD, [*ORDER, *ORDER], strict=False)))
def test_it_runs_in_its_own_lines(name: str, controller: str, folder: Path) -> None:
    done = isel_twin("run", folder / name, "--plant", "kinematic", "--json", *call(controller))
    assert (done.returncode, done.stderr) == (0, "")
    *results, summary = [json.loads(line) for line in done.stdout.splitlines()]
    lines, end_mm = CUTS[name]
    assert summary["position_mm"] == pytest.approx(end_mm, abs=0.02)
    named = {result["number"] for result in results if "number" in result}
    if controller != "bwo900":  # one result a program
        assert named & lines
        assert max(named) <= WILD[name].count(b"\n") + 1


@pytest.mark.parametrize("name", WILD)
def test_an_error_in_its_last_line_is_told_there_and_nothing_is_left(name: str, folder: Path) -> None:
    ends = {"fusion.nc": b"N110 M30", "vectric.ncp": b" PROGEND", "pcb2gcode.ngc": b"M2 ", "gerbv.ncp": b"PROGEND"}
    ends |= {"kicad.drl": b"M30", "inkscape.hpgl": b"IN; ", "estlcam.nc": b"m30", "flatcam.nc": b"M05\r\n"}
    wrong = {".ncp": b"MOVEABS Q5", ".hpgl": b"PE1;"}.get(Path(name).suffix, b"G1 X1 Q5")
    before, end, behind = WILD[name].rpartition(ends[name])
    (folder / name).write_bytes(before + wrong + b"\r\n" + end + behind)
    line = before.count(b"\n") + 1
    for words in (("run", folder / name), ("check", folder / name), ("convert", folder / name, "-o", folder / "out")):
        done = isel_twin(*words)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert f"{name}: line {line}, column " in done.stderr
    assert not (folder / "out").exists()


def lines_told(findings: list[dict[str, Any]], rule: str) -> list[int]:
    return [one["line"] for one in findings if one["rule"] == rule]


def test_findings_are_in_its_lines_in_every_form_and_each_is_told_once(folder: Path) -> None:
    """X sticks: it loses steps in the first rapid, and all that is cut then is beside its place."""
    names = ["flatcam.nc", "fusion.nc", "vectric.ncp"]
    forms = ("--junit", folder / "j.xml", "--sarif", folder / "s.sarif", "--report", folder / "pages", "--json")
    weak = ("--contour-mm", "0.05", "--set", "axes.x.guide_friction=1500")
    done = isel_twin("check", *(folder / name for name in names), *weak, *forms)
    assert done.returncode == 1
    told = {Path(one["job"]).name: one["findings"] for one in map(json.loads, done.stdout.splitlines())}
    for name in names:
        lines = lines_told(told[name], "contour")
        assert set(lines) <= CUTS[name][0]
        assert len(lines) == len(set(lines)) >= 2
    placed = [
        (place["artifactLocation"]["uri"].rpartition("/")[2], place["region"]["startLine"])
        for one in json.loads((folder / "s.sarif").read_text("utf-8"))["runs"][0]["results"]
        if one["ruleId"] == "contour"
        for place in (one["locations"][0]["physicalLocation"],)
    ]
    assert placed == [(name, line) for name in names for line in lines_told(told[name], "contour")]
    for case in ET.parse(folder / "j.xml").iter("testcase"):
        name = case.attrib["name"]
        text = "".join(failure.text or "" for failure in case.iter("failure"))
        assert all(f"(line {line}, " in text for line in lines_told(told[name], "contour"))
        page = (folder / "pages" / name).with_suffix(".html").read_text("utf-8")
        assert all(f"line {line}" in page for line in lines_told(told[name], "contour"))


def test_a_program_of_a_control_is_judged_in_the_lines_of_the_file(folder: Path) -> None:
    """Drives that may round corners as they like do so where the file has them."""
    (folder / "isel-twin.toml").write_text(f"{SETTINGS}following_mm = 0\n")
    done = isel_twin("check", folder / "vectric.ncp", *call("bwo900"), "--contour-mm", "0.02", "--json")
    lines = lines_told(json.loads(done.stdout)["findings"], "contour")
    assert {18, 19} <= set(lines) <= CUTS["vectric.ncp"][0]
    assert len(lines) == len(set(lines))


def test_a_golden_run_is_met_and_what_differs_is_in_its_line(folder: Path) -> None:
    kinematic = ("--plant", "kinematic")
    for name in WILD:
        assert isel_twin("golden", "record", folder / name, *kinematic).returncode == 0
    assert isel_twin("check", *(folder / name for name in WILD), *kinematic).returncode == 0
    file = folder / "vectric.ncp"
    file.write_bytes(WILD["vectric.ncp"].replace(b"MOVEABS X30000", b"MOVEABS X30100"))
    done = isel_twin("check", file, *kinematic, "--json")
    assert done.returncode == 1
    golden = [one for one in json.loads(done.stdout)["findings"] if one["rule"] == "golden"]
    assert golden
    assert "18" in json.dumps(golden)
