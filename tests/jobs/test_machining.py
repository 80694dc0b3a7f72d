"""Cuts with a standing spindle and rapids through stock are findings in the line of the file where they are."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.cam.settings import CamSettings
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import Bounds, Finding, Report, check_job
from isel_twin.jobs.checks.contour import Drawing, drawing
from isel_twin.jobs.checks.incremental import IncrementalCheck
from isel_twin.jobs.job import Line, parse_job
from isel_twin.jobs.toolpaths import source_of
from isel_twin.machine.fixture import Fixture
from isel_twin.plant.stock import stocks

pytestmark = pytest.mark.long(seconds=3)

CALLS = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}
CAM = CamSettings(zero=(100.0, 80.0, 89.0))
PLATE = Fixture("plate", "box", (80.0, 60.0, 60.0), (120.0, 95.0, 0.0), stock=True)
# the tip is 147 mm above the table with Z at its switch, and 2 to 7 mm deep in the plate at Z0 of the file, as the
# controllers end reference runs 0 to 5 mm from there
BEGIN = "G21 G90\nT1 M6\n"  # lines 1 and 2
ON = "M3 S10000\nG4 P4\n"
PART = "G0 X10 Y10 Z50\nG1 Z-1 F600\nG1 X30 F900\nG0 Z50\n"


def parsed(text: str, call: TwinSpec, cam: CamSettings = CAM, suffix: str = ".nc") -> tuple[list[Line], Drawing]:
    twin = call.build()
    source = source_of(text.encode(), suffix, twin.language, call.controller, lambda: twin.machine, cam)
    assert source is not None
    return list(source.lines), drawing(source.path(), cam)


def checked(
    text: str, controller: str = "imc-s8", bounds: Bounds | None = None, cam: CamSettings = CAM, **of_call: Any
) -> Report:
    call = TwinSpec(**{"plant": "kinematic", "machine": CALLS[controller], "controller": controller} | of_call)
    lines, drawn = parsed(text, call, cam)
    return check_job(Path("part.nc"), call, lines, bounds, drawn=drawn, cautions=())


def told(report: Report) -> list[tuple[str, int | None, str]]:
    """Rule, line of the file and words of each finding."""
    return [(one.rule, one.line if one.at is None else one.at[0], one.message) for one in report.findings]


def played(report: Report) -> None:
    assert report.verdict.ok, report.verdict
    assert not report.verdict.unsent


# what the words of the file say: lines are counted in the text


@pytest.mark.parametrize("controller", CALLS)
@pytest.mark.parametrize(
    ("text", "line", "why"),
    [
        (BEGIN + ON + PART + "M5\n" + PART + "M30\n", 11, "line 9 has switched it off; and in 1 more line"),
        (BEGIN + ON + PART + "T2 M6\n" + PART + "M30\n", 11, "line 9 has switched it off; and in 1 more line"),
        (BEGIN + PART + ON + PART + "M30\n", 4, "no line before has switched it on; and in 1 more line"),
    ],
    ids=["M5", "M6", "late"],
)
def test_a_cut_behind_what_has_switched_the_spindle_off_is_found(
    controller: str, text: str, line: int, why: str
) -> None:
    report = checked(text, controller)
    played(report)
    assert told(report) == [("spindle", line, f"the spindle stands in this cut: {why}")]
    assert not report.ok


@pytest.mark.parametrize("controller", CALLS)
def test_a_file_in_order_has_no_finding(controller: str) -> None:
    """Neither for M5 before the retract, nor for a change of the tool after which the spindle is switched on again."""
    again = BEGIN.replace("T1", "T2").partition("\n")[2] + ON
    report = checked(BEGIN + ON + PART + again + PART.replace("G0 Z50", "M5\nG0 Z50") + "M30\n", controller)
    played(report)
    assert told(report) == []
    assert report.outcome("spindle", Bounds()) == "ok"


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_file_without_a_word_for_the_spindle_says_so_once(plant: str) -> None:
    report = checked(BEGIN + PART + PART + "M30\n", plant=plant)
    assert [(one.rule, one.line, one.warning) for one in report.findings] == [("caution", 4, True)]
    assert report.ok
    assert told(checked(BEGIN + PART + "M30\n", bounds=Bounds(spindle=False))) == []


def test_the_rule_can_be_switched_off() -> None:
    off = Bounds(spindle=False)
    report = checked(BEGIN + ON + PART + "M5\n" + PART + "M30\n", bounds=off)
    assert told(report) == []
    assert report.outcome("spindle", off) == "not asked"


def test_only_what_leads_below_the_surface_of_stock_is_a_cut() -> None:
    air = "G0 X10 Y10 Z50\nG1 Z45 F600\nG1 X30\nG1 X50 Z40\n"
    assert told(checked(BEGIN + air + ON + "M30\n", fixtures=(PLATE,))) == []
    report = checked(BEGIN + air + ON + "M5\nG1 Z-1\nM30\n", fixtures=(PLATE,))
    assert told(report) == [("spindle", 10, "the spindle stands in this cut: line 9 has switched it off")]
    (found, *_) = told(checked(BEGIN + air + ON + "M30\n"))
    assert found[:2] == ("spindle", 4)  # without stock, the first motion at a feed


# what the twin's spindle does


# 24000 1/min in 3 s: 8000 each second
HF: dict[str, Any] = {"machine": "4030-hf", "overrides": {"spindle.speed_from": "fixed"}}


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
@pytest.mark.parametrize("controller", ["imc-s8", "ismif"])
def test_a_cut_before_the_spindle_has_run_up_is_found(controller: str, plant: str) -> None:
    down = "G0 X10 Y10 Z50\n"
    report = checked(BEGIN + down + "M3\nG4 P1\nG1 Z49 F600\nM30\n", controller, plant=plant, **HF)
    ((rule, line, words),) = told(report)
    assert (rule, line) == ("spindle", 6)
    speed = re.fullmatch(r"the spindle does not have its speed in this cut: (\d+) of 24000 1/min", words)
    assert speed is not None
    assert 8000 - 50 <= int(speed[1]) <= 8000 * 1.1  # a second and the bytes of two commands
    assert told(checked(BEGIN + down + "M3\nG4 P2.75\nG1 Z49 F600\nM30\n", controller, plant=plant, **HF)) == []


def test_a_cut_that_stalls_the_spindle_is_found_where_it_does(tmp_path: Path) -> None:
    """A slot of 6 mm in aluminium wants some N m; the spindle has 0.2."""
    event = '[[event]]\nwhen = "x > 120 mm"\ncut.flutes = 2\ncut.material = "aluminium"\ncut.spindle = 18000\n'
    (tmp_path / "cut.toml").write_text(event + "cut.diameter = 6.0\ncut.depth = 6.0\ncut.width = 6.0\n")
    text = BEGIN + ON + "G0 X10 Y10 Z50\nG1 Z49 F600\nG1 X15\nG1 X40\nM30\n"
    report = checked(text, plant="mujoco", scenario=tmp_path / "cut.toml", **HF)
    assert [found[1] for found in told(report) if found[0] == "spindle"] == [8]


def test_a_converter_that_is_told_no_speed_is_found_in_each_cut() -> None:
    report = checked(BEGIN + "M3 S0\n" + PART + "M30\n", "bwo900", machine="4030-servo-hf")
    words = "the spindle stands in this cut: its converter is told 0 1/min; and in 1 more line"
    assert told(report) == [("spindle", 5, words)]


def test_the_word_of_the_file_counts_on_an_output_of_ones_own() -> None:
    """Nobody knows what a bit of the user port switches."""
    cam = CamSettings(zero=CAM.zero, outputs={"spindle": 1})
    assert told(checked(BEGIN + ON + PART + "M30\n", cam=cam)) == []
    report = checked(BEGIN + ON + PART + "M5\n" + PART + "M30\n", cam=cam)
    assert [found[:2] for found in told(report)] == [("spindle", 11)]


def test_a_contactor_that_drops_is_found_in_the_cut_that_is_made_then(tmp_path: Path) -> None:
    """With the key on setup the axes may move while the hood is open; the spindle may not."""
    (tmp_path / "hood.toml").write_text(
        '[[event]]\nat = 0.01\nset.key = "setup"\n[[event]]\nwhen = "x > 115 mm"\nset.hood = "open"\n'
    )
    text = BEGIN + ON + "G0 X10 Y10 Z50\nG1 Z-1 F600\nG1 X30 F900\nG1 X50\nG0 Z50\nM30\n"
    report = checked(text, scenario=tmp_path / "hood.toml")
    found = [one for one in told(report) if one[0] == "spindle"]
    assert found[0][1] == 7
    assert found[0][2].startswith("the spindle is off in this cut, though the file has switched it on")


# stock


def deep(report: Report, how: str) -> list[tuple[int | None, float]]:
    """Line of each finding about stock that says it so, and how many mm."""
    found = [one for one in told(report) if one[0] == "rapid"]
    texts = [(line, re.search(rf"{how}.* plate, (\d+\.\d\d) mm", words)) for _, line, words in found]
    return [(line, float(text[1])) for line, text in texts if text is not None]


@pytest.mark.parametrize("controller", CALLS)
def test_rapids_and_changes_of_tools_in_stock_are_found(controller: str) -> None:
    def of(text: str, how: str) -> list[tuple[int | None, float]]:
        report = checked(BEGIN + ON + text + "M30\n", controller, fixtures=(PLATE,))
        played(report)
        found = deep(report, how)
        assert len(found) == len([one for one in report.findings if one.rule == "rapid"])
        return found

    ((line, shallow),) = of("G0 X-50 Y10 Z0\nG0 X90\n", "a rapid leads through")
    assert line == 6
    ((line, lower),) = of("G0 X-50 Y10 Z-3\nG0 X90\n", "a rapid leads through")
    assert lower - shallow == pytest.approx(3.0, abs=0.011)
    plunged = of("G0 X10 Y10 Z50\nG0 Z0\n", "a rapid ends in")
    assert plunged == [(6, pytest.approx(shallow, abs=0.011))]
    changed = of("G0 X10 Y10 Z50\nG1 Z0 F3000\nT2 M6\n", "a tool is changed in")
    assert changed == [(7, pytest.approx(shallow, abs=0.011))]
    retracts = of("G0 Z50\nG99 G81 X10 Y10 Z-3 R0 F3000\nX30\n", "a rapid ends in")  # the level is in the stock
    assert [line for line, _ in retracts] == [6, 7]


@pytest.mark.parametrize("controller", CALLS)
def test_a_rapid_where_the_tool_has_cut_is_none_through_stock(controller: str) -> None:
    pocket = "G0 X10 Y10 Z50\nG1 Z0 F3000\nG1 X30\nG1 Y14\nG1 X10\nG1 Y10\nG0 X30\nG0 X20 Y12\nG0 Z50\n"
    pecks = "G83 X40 Y10 Z-3 R45 Q20 F3000\nG80\n"
    report = checked(BEGIN + ON + pocket + pecks + "G0 Z50\nM30\n", controller, fixtures=(PLATE,))
    assert told(report) == []
    assert report.outcome("rapid", Bounds()) == "ok"
    beyond = checked(BEGIN + ON + pocket.replace("G0 X30\n", "G0 X37\n") + "M30\n", controller, fixtures=(PLATE,))
    assert [found[1] for found in told(beyond)] == [11, 12]  # out of the pocket, and back into it
    assert told(checked(BEGIN + ON + "G0 X-50 Y10 Z-3\nG0 X90\nM30\n", bounds=Bounds(rapid=False))) == []


def test_ways_to_a_change_of_the_tool_count() -> None:
    """By way of Z first: 3 mm below the surface they lead through the plate."""
    cam = CamSettings(zero=CAM.zero, tool_change=(30.0, 90.0, 89.0))
    text = BEGIN + ON + PART.replace("G0 Z50\n", "") + "T2 M6\n" + ON + "G0 X10 Y10 Z50\nM30\n"
    report = checked(text, cam=cam, fixtures=(PLATE,))
    assert [line for line, _ in deep(report, "a rapid leads through")] == [8, 11]  # and back again


@pytest.mark.parametrize(
    ("shape", "size_mm", "area_mm2"),
    [("box", (80.0, 60.0, 25.0), 4800.0), ("cylinder", (80.0, 25.0), 5026.5), ("ring", (80.0, 40.0, 25.0), 3769.9)],
)
def test_stock_has_the_shape_of_its_fixture(shape: str, size_mm: tuple[float, ...], area_mm2: float) -> None:
    """Areas: a b, pi r^2; sixteen wedges around a ring are a hundredth more."""
    fixture = Fixture("one", shape, size_mm, (200.0, 160.0, 2.0), turn_deg=30.0, stock=True)
    (stock,), _, _ = stocks(TwinSpec(plant="kinematic", fixtures=(fixture,)).build().machine)
    there = stock.whole_mm > 0.0
    assert there.sum() * stock.cell_mm**2 == pytest.approx(area_mm2, rel=0.02)
    assert stock.whole_mm[there] == pytest.approx(27.0, abs=1e-6)


def test_its_surface_is_where_the_cutter_meets_a_clamp_of_that_shape() -> None:
    """MuJoCo's contact says where that is."""
    clamp = Fixture("plate", *(PLATE.shape, PLATE.size_mm, PLATE.at_mm))
    twin = Twin(plant="mujoco", fixtures=(clamp,))
    for line in ("@07", "@0R7", "@0M38400,8000,28800,8000,0,8000,0,30", "@0M38400,8000,28800,8000,38400,3000,0,30"):
        twin.query(line, 300.0)
    (met, *_) = twin.collisions
    z_mm = met.position_mm[2] + (twin.machine_position_mm - twin.position_mm)[2]
    (stock,), high_mm, _ = stocks(TwinSpec(plant="kinematic", fixtures=(PLATE,)).build().machine)
    assert stock.depth_mm(np.array([[120.0, 90.0, high_mm - z_mm]])) == pytest.approx(0.0, abs=0.02)


# jobs of commands


RAW = "@07\n@0R7\n{}@0M38400,8000,28800,8000,0,8000,0,30\n{}@0M38400,8000,28800,8000,28800,3000,0,30\n"


@pytest.mark.parametrize(
    ("first", "second", "found"),
    [
        ("@0B2,1\n", "", []),
        ("@0B2,1\n", "@0B2,0\n", [("spindle", 6)]),
        ("", "", [("caution", 4)]),
    ],
)
def test_commands_that_go_into_stock_want_the_spindle(first: str, second: str, found: list[tuple[str, int]]) -> None:
    call = TwinSpec(plant="kinematic", fixtures=(PLATE,))
    lines = parse_job(RAW.format(first, second), call.build().language, call.controller)
    report = check_job(Path("job.txt"), call, lines)
    assert [each[:2] for each in told(report)] == found
    assert report.outcome("rapid", Bounds()) == "not looked at: no file of a CAM program that cuts"


# while it is written


def test_a_changed_file_is_judged_as_anew() -> None:
    call = TwinSpec(plant="kinematic", fixtures=(PLATE,), **HF)
    check = IncrementalCheck(Path("part.nc"), call, Bounds())
    good = BEGIN + "G0 X10 Y10 Z50\nM3\nG4 P4\nG1 Z-1 F600\nG1 X30\nG0 Z50\nM30\n"
    change: Callable[[str], str]
    for change in (
        lambda text: text,
        lambda text: text.replace("P4", "P0.1"),
        lambda text: text.replace("G1 X30", "(more)\nG1 X30"),
        lambda text: text.replace("G0 Z50\nM30", "G0 X60\nG0 Z50\nM30"),
        lambda text: text.replace("G1 X30", "M5\nG1 X30"),
        lambda text: text,
    ):
        lines, drawn = parsed(change(good), call)
        again = check.check(lines, drawn=drawn)
        assert again == check_job(Path("part.nc"), call, lines, Bounds(), drawn=drawn)


def test_findings_have_a_level() -> None:
    assert [Finding(rule, "").level for rule in ("spindle", "rapid", "caution")] == ["error", "error", "warning"]
