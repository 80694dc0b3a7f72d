"""Files that are programs of the control: run, checked, told block by block, and failed with the block's name."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import pytest

from isel_twin.cli import main

CONTROL = ("--controller", "bwo900", "--machine", "4030-servo", "--plant", "kinematic")
ARC = "P1\nN10 G90 F1200\nN20 G1 X40\nN30 G2 X60 Y20 I0 J5\nN40 M30\n"
"""The centre of N30 does not fit: 40.3 mm from its start, 61.8 mm from its end."""


def call(*arguments: object) -> int:
    with pytest.raises(SystemExit) as caught:
        main([*map(str, arguments)])
    return int(caught.value.code or 0)


@pytest.fixture
def program(tmp_path: Path):
    def write(text: str) -> Path:
        file = tmp_path / "part.nc"
        file.write_text(text)
        return file

    return write


def ran(capsys: pytest.CaptureFixture[str]) -> list[dict]:
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


def test_each_block_is_told_with_its_time_and_where_it_ends(program, capsys) -> None:
    """40 mm and 30 mm at 1200 mm/min take 2.0 and 1.5 s, and a little more for the ramps of both ends."""
    file = program("P1\nN10 G90 F1200 G28\nN20 G1 X40\nN30 Y30\nN40 M30\n")
    assert call("run", file, *CONTROL, "--json") == 0
    *_, started, _ = ran(capsys)
    parts = started["parts"]
    assert [part["text"] for part in parts] == ["P1 N10 G90 F1200 G28", "P1 N20 G1 X40", "P1 N30 Y30", "P1 N40 M30"]
    assert parts[1]["position_mm"] == pytest.approx([40.0, 0.0, 0.0], abs=0.01)
    assert parts[2]["position_mm"] == pytest.approx([40.0, 30.0, 0.0], abs=0.01)
    times = [part["time_ns"] / 1e9 for part in parts]
    assert times[2] - times[1] == pytest.approx(2.05, abs=0.1)
    assert times[3] - times[2] == pytest.approx(1.55, abs=0.1)


def test_blocks_that_run_into_each_other_have_their_times_too(program, capsys) -> None:
    """Ten pieces of 2 mm at 20 mm/s: 0.1 s each, however they were looked at."""
    pieces = "".join(f"N{20 + n} G1 X{2 * n}\n" for n in range(1, 11))
    assert call("run", program(f"P1\nN10 G90 F1200\n{pieces}N90 M30\n"), *CONTROL, "--json") == 0
    *_, started, _ = ran(capsys)
    times = [part["time_ns"] / 1e9 for part in started["parts"] if "G1" in part["text"]]
    assert len(times) == 10
    assert [after - before for before, after in pairwise(times[1:])] == pytest.approx([0.1] * 8, abs=0.003)


@pytest.mark.parametrize(
    ("text", "line", "said"),
    [
        (ARC, "start P1", "M1238 P1 N30 column 16: centre does not fit start and end"),
        ("P1\nN10 F1200\nN20 G1 X Y5\nN30 M30\n", "start P1", "M1211 P1 N20 column "),
        ("P1\nN10 G1 F1200\nN20 X2000\nN30 M30\n", "start P1", "M2101 P1 N20 column 5: hardware limit + (X)"),
        ("P1\nN10 F1200\nN5 G1 X20\nN30 M30\n", "P1, 3 blocks", "M1290: block numbers do not rise (N5 after N10"),
    ],
)
def test_a_message_fails_the_run_and_names_program_block_and_column(program, capsys, text, line, said) -> None:
    assert call("run", program(text), *CONTROL, "--json") == 1
    lines = ran(capsys)
    (wrong,) = [one for one in lines if one.get("command") == line]
    assert not wrong["ok"]
    assert said in wrong["why"]
    assert lines[-1]["refused"] >= 1


def test_what_one_line_has_said_is_not_told_by_the_next(program, capsys) -> None:
    assert call("run", program("P1\nN10 F1200\nN5 G1 X20\n"), *CONTROL, "--json") == 1
    first, reference, *_ = ran(capsys)
    assert len(first["parts"]) == 1
    assert "parts" not in reference


def test_the_table_has_a_row_a_block(program, capsys) -> None:
    assert call("run", program(ARC), *CONTROL) == 1
    out = capsys.readouterr().out
    assert "P1 N20 G1 X40" in out
    assert "start P1" in next(row for row in out.splitlines() if "M1238 P1 N30 column 16" in row)


def test_a_check_names_the_block(program, capsys, tmp_path: Path) -> None:
    junit = tmp_path / "checks.xml"
    assert call("check", program(ARC), *CONTROL, "--junit", junit) == 1
    assert "refused    line 4, column 16" in capsys.readouterr().out
    assert "start P1: M1238 P1 N30 column 16: centre does not fit" in junit.read_text()


def test_an_emergency_stop_names_the_block_it_came_in(program, capsys, tmp_path: Path) -> None:
    scenario = tmp_path / "stop.toml"
    scenario.write_text('[[event]]\nwhen = "output active == 2"\ndelay = 1.0\nset = { estop = "pressed" }\n')
    text = "P1\nN10 G90 F1200\nN20 G1 X100\nN30 M30\n"
    assert call("run", program(text), *CONTROL, "--scenario", scenario, "--json") == 1
    *_, started, _ = ran(capsys)
    assert started["why"].startswith("M3001 P1 N20 column 8: emergency stop")


TOOL = "P1\nN1 P21000:2 P21010:3\nN10 G90 {plane} F2400 T2 M06\nN20 G0 {to}\nN30 G1 {cut}\nN40 M30\n"
"""Tool 2 has a radius of 3 mm."""


@pytest.mark.parametrize(
    ("plane", "to", "cut", "view"),
    [("G17", "X10 Y10", "X60", "xy"), ("G18", "X10 Z10", "X60", "xz"), ("G19", "Y10 Z10", "Y60", "yz")],
)
def test_the_report_draws_the_tool_as_wide_as_it_is_in_the_plane_it_cuts_in(
    program, capsys, tmp_path: Path, plane: str, to: str, cut: str, view: str
) -> None:
    """Lines of the grid give the scale: so many px are so many mm, and the tool is 6 mm wide."""
    page = tmp_path / "report.html"
    assert call("run", program(TOOL.format(plane=plane, to=to, cut=cut)), *CONTROL, "--report", page) == 0
    text = page.read_text()
    drawings = {name: re.search(rf"aria-labelledby='path-{name}-title.*?</svg>", text) for name in ("xy", "xz", "yz")}
    drawn = [name for name, found in drawings.items() if found and "class='swath'" in found[0]]
    assert drawn == [view]
    svg = drawings[view][0]
    wide = float(re.search(r"class='swath' stroke-width='([\d.]+)'", svg)[1])
    ticks = re.findall(r"<text x='([\d.]+)' y='[\d.]+' text-anchor='middle'>(-?[\d.]+)</text>", svg)
    (x0, mm0), *_, (x1, mm1) = [(float(x), float(mm)) for x, mm in ticks]
    assert wide == pytest.approx(6.0 * (x1 - x0) / (mm1 - mm0), rel=0.01)
    assert "<td class='code command'>P1 N30 G1" in text


def test_what_a_check_finds_stands_at_its_line_and_column_of_the_file(program, capsys, tmp_path: Path) -> None:
    """N30 is line 6 of the file: blank lines count."""
    file, found = program("\nP1\n\n" + ARC.removeprefix("P1\n")), tmp_path / "found.sarif"
    assert call("check", file, *CONTROL, "--sarif", found) == 1
    assert "line 6, column 16" in capsys.readouterr().out
    results = json.loads(found.read_text())["runs"][0]["results"]
    regions = {one["ruleId"]: one["locations"][0]["physicalLocation"]["region"] for one in results}
    assert regions == {"refused": {"startLine": 6, "startColumn": 16}, "fault": {"startLine": 6, "startColumn": 16}}


def test_what_happens_in_a_block_stands_at_its_line(program, capsys) -> None:
    """The axis runs into its switch in N20, line 3."""
    assert call("check", program("P1\nN10 G1 F1200\nN20 X2000\nN30 M30\n"), *CONTROL, "--json") == 1
    (report,) = (json.loads(line) for line in capsys.readouterr().out.splitlines() if '"findings"' in line)
    assert {one["rule"]: one["line"] for one in report["findings"]} == {"switch": 3, "refused": 3, "fault": 3}


def test_a_golden_run_names_the_blocks_in_which_it_first_differs(program, capsys) -> None:
    """Twelve sides of 10 mm; the eighth is 1 mm longer now."""
    sides = [f"N{10 * n} G1 {'XY'[n % 2]}{10 * (n // 2 + 1)}" for n in range(1, 13)]
    text = "\n".join(["P1", "N5 G90 F600 G28", *sides, "N200 M30", ""])
    file = program(text)
    assert call("golden", "record", file, *CONTROL) == 0
    program(text.replace("N80 G1 X50", "N80 G1 X51"))
    assert call("golden", "compare", file) == 1
    out = capsys.readouterr().out
    first = next(line for line in out.splitlines() if "stream first from" in line)
    named = re.search(r"\(P1 N(\d+) .*? to P1 N(\d+) |\(P1 N(\d+) [^)]*\)", first)
    assert named
    begin, end = int(named[1] or named[3]), int(named[2] or named[3])
    assert begin <= 80 <= end
    assert end - begin <= 10


LONG = "P1\n" + "".join(f"N{n} G1 F3000 X{n % 7}\n" for n in range(1, 300)) + "N300 M30\n#\nZ500\nN1 G0 Z2\nN2 M02\n#\n"


@pytest.mark.parametrize("text", [LONG, LONG.replace("N9 G1", "N9 G500 G1")], ids=["plain", "calls a cycle"])
def test_a_program_longer_than_the_memory_is_fed(program, capsys, monkeypatch, text: str) -> None:
    """And ends where, and after as long as, one that is kept."""
    file = program(text)
    assert call("run", file, *CONTROL, "--json") == 0
    *_, kept, kept_all = ran(capsys)
    monkeypatch.setattr("isel_twin.firmware.bwo900.language.KEPT", 1000)
    assert call("run", file, *CONTROL, "--json") == 0
    *steps, fed, fed_all = ran(capsys)
    assert [step["command"] for step in steps] == ["Z500, 2 blocks", "reference"]
    assert (kept["command"], fed["command"]) == ("start P1", "start P1, fed: 300 blocks")
    assert len(fed["parts"]) == len(kept["parts"]) >= 300
    assert [part["text"] for part in fed["parts"]] == [part["text"] for part in kept["parts"]]
    later_ns = fed["end_ns"] - fed["time_ns"] - (kept["end_ns"] - kept["time_ns"])
    assert 0 <= later_ns <= 1_500_000  # it is started before its first block comes, and looks again after a block cycle
    assert (fed_all["counts"], fed_all["steps"]) == (kept_all["counts"], kept_all["steps"])


@pytest.mark.parametrize("block", ["M24.2", "M23.5", "P500<3.5", "M29"])
def test_one_that_leads_back_is_kept_however_long_it_is(program, capsys, monkeypatch, block: str) -> None:
    monkeypatch.setattr("isel_twin.firmware.bwo900.language.KEPT", 1000)
    call("run", program(LONG.replace("N300 M30", f"N300 {block}")), *CONTROL, "--timeout", "60", "--json")
    assert next(line["command"] for line in ran(capsys) if "command" in line) == "P1, 300 blocks"


def test_a_message_in_a_fed_program_names_line_and_column(program, capsys, monkeypatch) -> None:
    monkeypatch.setattr("isel_twin.firmware.bwo900.language.KEPT", 1000)
    assert call("run", program(LONG.replace("N200 G1", "N200 G999")), *CONTROL, "--json") == 1
    *_, fed, _ = ran(capsys)
    assert "M1252 P1 N200 column 6" in fed["why"]
    assert fed["complete"]


def test_a_text_that_no_line_carries_is_refused_before_it_begins(program, capsys) -> None:
    assert call("run", program("P1\nN10 G0 X1 ;\u2192\nN20 M30\n"), *CONTROL) == 2
    assert "'\u2192' is not a character a serial line can carry" in capsys.readouterr().err
