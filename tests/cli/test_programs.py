"""Files that are programs of the control: run, checked, told block by block, and failed with the block's name."""

from __future__ import annotations

import json
import re
from itertools import pairwise
from pathlib import Path

import pytest

from isel_twin import Twin
from isel_twin.cli import main
from isel_twin.language import MoveSettings, create_language, needed

pytestmark = pytest.mark.long(seconds=4)

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
    assert times[2] - times[1] == pytest.approx(2.15, abs=0.05)
    assert times[3] - times[2] == pytest.approx(1.65, abs=0.05)


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


def test_what_cannot_be_loaded_is_not_started(program, capsys) -> None:
    assert call("run", program("P1\nN10 F1200\nN5 G1 X20\n"), *CONTROL, "--json") == 1
    told = capsys.readouterr()
    first, summary = (json.loads(line) for line in told.out.splitlines())
    assert len(first["parts"]) == 1
    assert (summary["refused"], summary["unsent"]) == (1, 2)
    assert "line 3: M1290: block numbers do not rise" in told.err
    assert "; the job ends there and 2 lines are not sent\n" in told.err


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
    assert regions == {"refused": {"startLine": 6, "startColumn": 16}}


def test_what_happens_in_a_block_stands_at_its_line(program, capsys) -> None:
    """The axis runs into its switch in N20, line 3."""
    assert call("check", program("P1\nN10 G1 F1200\nN20 X2000\nN30 M30\n"), *CONTROL, "--json") == 1
    (report,) = (json.loads(line) for line in capsys.readouterr().out.splitlines() if '"findings"' in line)
    assert {one["rule"]: one["line"] for one in report["findings"]} == {"switch": 3, "refused": 3}


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


PART = "P1\nN10 G90 F1200\nN20 G1 X40\nN30 M30\n#\n"
NAMED = r"part.nc: is a program for bwo900, which imc-s8 cannot run: --controller bwo900 --machine 4030-servo"


@pytest.mark.parametrize("text", [PART, f"; my part\n{PART}", "Z1\nN10 X5\nN20 M02\n#\n"])
def test_a_program_given_to_a_controller_that_runs_none_is_one_line(program, capsys, text, tmp_path: Path) -> None:
    """It is not sent line by line to be refused line by line, nor written down as a golden run."""
    file = program(text)
    plan = tmp_path / "plan.toml"
    plan.write_text('[sweep]\njob = "part.nc"\nplant = "kinematic"\n[machine]\n"payload.mass" = [0.0, 1.0]\n')
    calls = [("run", file), ("check", file), ("golden", "record", file), ("tune", file), ("sweep", plan)]
    for words in calls:
        assert call(*words) == 2, words
        told = capsys.readouterr()
        assert told.out == ""
        assert re.search(NAMED, told.err), words
        assert len(told.err.splitlines()) == 1, words
    assert not file.with_suffix(".golden").exists()


def test_a_remark_at_its_beginning_makes_any_file_a_job(program, capsys) -> None:
    assert call("run", program(f"# for an iMC\n{PART}"), "--plant", "kinematic") == 1
    assert "commands, 4 refused" in capsys.readouterr().out


def test_decode_suggests_the_controller_of_a_program(program, capsys) -> None:
    assert call("decode", program(PART)) == 0
    told = capsys.readouterr()
    assert re.search(NAMED, told.err)
    assert "P1<10>" in told.out


@pytest.mark.parametrize("head", ["; my part\n", "%\n", "\n; one\n\n; two\n", "%\n; tape\n"])
def test_what_stands_before_the_first_program_is_no_part_of_it(program, capsys, head) -> None:
    assert call("run", program(head + PART), *CONTROL, "--json") == 0
    loaded, *_, started, _ = ran(capsys)
    assert loaded["command"] == "P1, 3 blocks"
    assert started["position_mm"][0] == pytest.approx(40.0, abs=0.01)


def test_blocks_without_numbers_are_g_code_and_are_given_them(program, capsys) -> None:
    assert call("run", program("G90 G21 F1200\nG1 X40\nM30\n"), *CONTROL, "--json") == 0
    *_, summary = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert summary["job_file"]["format"] == "G-code"
    assert summary["counts"] == [40_000, 0, 0]


def test_cycles_alone_cannot_be_started(program, capsys) -> None:
    assert call("run", program("Z1\nN10 G0 X10\nN20 M02\n#\n"), *CONTROL) == 2
    assert capsys.readouterr().err == (
        f"isel-twin: {program('Z1')}: there is no program in it to be started, a line P and its number, but Z1\n"
    )


def test_one_block_is_one_block(program, capsys) -> None:
    assert call("run", program("; mine\nP2\n; a remark\nN10 G1 F1200 \\\nX40\n#\n"), *CONTROL, "--json") == 0
    assert ran(capsys)[0]["command"] == "P2, 1 block"


def test_columns_of_the_table_stand_below_each_other(program, capsys) -> None:
    """Also where a block is long: what is in a column ends where its head does."""
    assert (
        call("run", program("P1\nN10 G90 F1200 {a long remark about   what comes next here}\nN20 G1 X40\n"), *CONTROL)
        == 0
    )
    head, *rows = capsys.readouterr().out.split("\n\n")[0].splitlines()
    ends = [match.end() for match in re.finditer(r"[XYZ] / mm", head)]
    assert len(rows) == 5
    for row in rows:
        assert [match.end() for match in re.finditer(r"-?\d+\.\d{3}(?= |$)", row)][1:] == ends, row


def test_the_page_names_the_same_place_as_the_terminal(program, capsys, tmp_path: Path) -> None:
    """Line and column of the file; the link leads to the step of the job."""
    assert call("check", program(ARC), *CONTROL, "--report", tmp_path / "pages") == 1
    assert "line 4, column 16" in capsys.readouterr().out
    assert "<a href='#line-3'>line 4, column 16</a>" in (tmp_path / "pages" / "part.html").read_text()


def test_a_message_is_told_once(program, capsys) -> None:
    """It is not a second finding that the controller shows the error that was told."""
    assert call("check", program(ARC), *CONTROL) == 1
    out = capsys.readouterr().out
    assert out.count("M1238") == 1
    assert "no reply has told" not in out


def test_the_example_of_the_page_does_what_it_says(program, capsys) -> None:
    """The first program of docs/bwo900.md: three rounds, the tool's centre 3 mm beside the contour."""
    page = (Path(__file__).parents[2] / "docs" / "bwo900.md").read_text()
    example = re.search(r"(?:^    .*\n)+", page[page.index("Samples are in") :], re.MULTILINE)
    assert example
    text = "".join(line.removeprefix("    ") for line in example[0].splitlines(keepends=True))
    assert call("run", program(text), *CONTROL, "--json") == 0
    *_, started, _ = ran(capsys)
    rounds = [part["position_mm"] for part in started["parts"] if part["text"].startswith("P1 N50")]
    assert len(rounds) == 3
    assert all(place[:2] == pytest.approx([87.0, 60.0], abs=0.01) for place in rounds)


def test_a_job_of_another_controller_is_no_program(program, capsys) -> None:
    file = program("@07\n@0R7\n")
    assert call("run", file, *CONTROL) == 2
    assert capsys.readouterr().err == (
        f"isel-twin: {file}: line 1: '@07' is a command of c142, imc-m, imc-mp, imc-s8 or it116, not of bwo900: "
        "--controller imc-s8 --machine 4030\n"
    )


def test_moves_of_the_language_take_the_time_that_their_settings_say() -> None:
    """x / v + v / a, or 2 sqrt(x / a) where v is not reached; each with a block's cycles of 2 ms beside it."""
    twin = Twin("4030-servo", "bwo900", "kinematic")
    language = needed(twin.language, "bwo900")
    for data in language.reference():
        twin.write(data)
        assert twin.run_until_idle(100)
    for to_mm, speed_mm_s, a_m_s2 in ((50, 40, 0.4), (0, 40, 0.1), (50, 30, 4.0), (0, 40, 0.01)):
        *before, start = language.move((1000 * to_mm, 0, 0), MoveSettings(1000 * speed_mm_s, round(1000 * a_m_s2)))
        for data in before:
            twin.write(data)
            assert twin.run_until_idle(1)
        began_ns = twin.time_ns
        twin.write(start)
        assert twin.run_until_idle(100)
        a_mm_s2 = 1000 * a_m_s2
        reached = speed_mm_s**2 / a_mm_s2 <= 50
        time_s = 50 / speed_mm_s + speed_mm_s / a_mm_s2 if reached else 2 * (50 / a_mm_s2) ** 0.5
        stop_s = (twin.time_ns - began_ns) * 1e-9 - time_s
        assert 0.0 <= stop_s <= 0.14, "an exact stop: the loops settle (plant/22)"
        assert tuple(twin.counts) == (1000 * to_mm, 0, 0)
    assert not twin.remarks


def test_a_move_can_follow_one_that_was_broken_off() -> None:
    twin = Twin("4030-servo", "bwo900", "kinematic")
    language = needed(twin.language, "bwo900")
    for data in (*language.reference(), *language.move((50_000, 0, 0), MoveSettings(3000))):
        twin.write(data)
        twin.run(30.0 if data in language.reference() else 1.0)
    twin.write(language.break_off())
    assert twin.run_until_idle(5)
    assert 1000 < twin.counts[0] < 10_000
    for data in language.move((0, 5000, 0), MoveSettings(3000)):
        twin.write(data)
        assert twin.run_until_idle(20)
    assert tuple(twin.counts) == (0, 5000, 0)


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
    call("run", program(LONG.replace("N300 M30", f"N300 {block}")), *CONTROL, "--timeout", "1", "--json")
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


STOPS = """
[[event]]
name = "stop"
when = "x > 25 mm"
key = {{ stop = true }}

[[event]]
when = "2 s after stop"
{then}
"""


def scenario_file(folder: Path, then: str) -> Path:
    file = folder / "stops.toml"
    file.write_text(STOPS.format(then=then) if then else STOPS.partition("\n[[event]]\nwhen")[0].format())
    return file


@pytest.mark.parametrize(
    ("text", "then", "said"),
    [
        (PART, "", "P1 N20 waits for Start"),
        (PART, "key = { abort = true }", "P1 N20 is broken off"),
        (PART.replace("N30 M30", "N25 M00\nN30 M30"), "key = { start = true }", "P1 N25 waits for Start"),
        (PART, "key = { override = 0, start = true }", "P1 N20 waits for an override above 0 %"),
    ],
    ids=["stop", "abort", "M00", "override"],
)
def test_a_program_that_stands_before_its_end_is_not_well(program, capsys, tmp_path: Path, text, then, said) -> None:
    """Nobody goes on with it, so the job ends there, at once, and says where it stands."""
    scenario = scenario_file(tmp_path, then)
    assert call("run", program(text), *CONTROL, "--scenario", scenario, "--json") == 1
    told = capsys.readouterr()
    *_, started, summary = (json.loads(line) for line in told.out.splitlines())
    assert (started["why"], started["complete"], summary["ok"]) == (said, False, False)
    assert summary["time_ns"] < 50e9
    assert told.err.endswith(f"line 3: {said}; the job ends there\n")
    assert call("check", program(text), *CONTROL, "--scenario", scenario) == 1
    assert f"start P1: {said}" in capsys.readouterr().out


def test_one_that_a_scenario_stops_and_starts_comes_to_its_end(program, capsys, tmp_path: Path) -> None:
    scenario = scenario_file(tmp_path, "key = { start = true }")
    assert call("run", program(PART), *CONTROL, "--scenario", scenario, "--json") == 0
    *_, started, summary = ran(capsys)
    assert started["position_mm"][0] == pytest.approx(40.0, abs=0.01)
    assert summary["events_after_end"] == 0


def test_a_remark_is_explained_as_one() -> None:
    (message,) = needed(create_language("bwo900"), "bwo900").messages(b"; outer contour\r\n", True)
    assert message.explanation == "a remark"


def test_a_program_may_be_longer_than_a_job(program, capsys, monkeypatch) -> None:
    """A contour of a free form has millions of blocks, and cannot be cut like a job."""
    monkeypatch.setattr("isel_twin.cli.jobs.JOB_BYTES", 100)
    assert call("run", program(LONG), *CONTROL, "--json") == 0
    assert call("run", program("@07\n" * 26), "--plant", "kinematic") == 2
    assert "is longer than 0 MiB; cut it into several" in capsys.readouterr().err


TABLE = "D\nK1:P21000: 1\nP21010: 2.5\n#\n"
"""The tool table has tool 1, with a radius of 2.5 mm."""
CUTS = "P1\nN10 G0 X10 T1 M16\nN20 M30\n#\n"


@pytest.mark.parametrize("text", [TABLE + CUTS, CUTS + TABLE, CUTS.replace("#\n", "") + TABLE.replace("#\n", "")])
def test_parameters_beside_a_program_are_loaded_with_it(program, capsys, text) -> None:
    """Without them T1 is M1050."""
    assert call("run", program(text), *CONTROL, "--json") == 0
    first, second, *_ = ran(capsys)
    assert {first["command"], second["command"]} == {"P1, 2 blocks", "D, 2 lines"}
    assert call("run", program(text), "--plant", "kinematic") == 2
    assert call("run", program(CUTS), *CONTROL) == 1


def test_parameters_alone_are_loaded_and_kept(program, capsys, tmp_path: Path) -> None:
    flash = tmp_path / "flash.bin"
    assert call("run", program(TABLE), *CONTROL, "--flash", flash) == 0
    assert call("run", program(CUTS), *CONTROL, "--flash", flash) == 0


BY_LINES = """# parameters line by line, and what they have done
D
K1:P8683: 1
K1:P12130: 1
<35>
<4>
! x == 0 +- 0.01 mm
! auto == 0
"""


def test_a_job_of_lines_goes_on_within_a_file(program, capsys) -> None:
    """A control in the middle of a file has dealt with all that came, and waits for its host."""
    assert call("run", program(BY_LINES), *CONTROL, "--json") == 0
    *lines, summary = ran(capsys)
    assert [line["ok"] for line in lines] == [True] * 7
    assert summary["time_ns"] < 60e9


def test_an_order_that_is_no_file_is_over_at_once() -> None:
    twin = Twin("4030-servo", "bwo900", "kinematic")
    assert twin.query("G0 X5") == ""
    assert twin.time_ns == 0
    assert "M1110" in twin.remarks[-1][1]
