"""Files of CAM programs as jobs: with every controller, on every command, in the user's own lines."""

from __future__ import annotations

import itertools
import json
import math
import re
import sys
from pathlib import Path
from typing import Any

import pytest

from isel_twin.cam.registry import reader_for
from tests import forked
from tests.forked import PATIENCE_S
from tests.in_process import isel_twin
from tests.smoke.test_every_command import JOBS

pytestmark = pytest.mark.long(seconds=5)

FILES = {
    "NCP": "; a part\nIMF_PBL_V1.0\nFASTVEL 40000\nVEL 10000\nFASTABS Z5000\nFASTABS X10000 Y10000\nMOVEABS Z-1000\n"
    "MOVEABS X40000\nMOVEABS Y30000\nFASTABS Z5000\nPROGEND\n",
    "G-code": "%\n(a part)\nG21 G90\nF600\nG0 Z5\nG0 X10 Y10\nG1 Z-1\nG1 X40\nG1 Y30\nG0 Z5\nM30\n%\n",
    "HPGL": "IN;SP1;\n\n\n\n\nPU400,400;\nPD;\nPA1600,400;\nPA1600,1200;\nPU;\nSP0;\n",
}
"""A corner of 30 and 20 mm, cut 1 mm deep; the first cut ends in line 8 and the second in line 9 of each."""
SETTINGS = "[cam]\nzero = [100, 80, 30]\nfeed_mm_s = 10.0\nplunge_mm_s = 10.0\ndepth_mm = 1.0\n"
CONTROLLERS = {"imc-s8": "4030", "c142": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    (tmp_path / "isel-twin.toml").write_text(SETTINGS)
    for title, text in FILES.items():
        (tmp_path / f"part.{title.lower()}").write_text(text)
    return tmp_path


def told(file: Path, *words: str, code: int = 0) -> list[dict[str, Any]]:
    done = isel_twin("run", file, "--plant", "kinematic", "--json", *words)
    assert (done.returncode, done.stderr) == (code, "")
    return [json.loads(line) for line in done.stdout.splitlines()]


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("title", FILES)
def test_it_runs_and_ends_where_it_should(title: str, controller: str, folder: Path) -> None:
    """X 140, Y 110 and Z 5 mm above a work at 30 mm from the top, in counters that grow downwards: 25."""
    *_, summary = told(
        folder / f"part.{title.lower()}", "--controller", controller, "--machine", CONTROLLERS[controller]
    )
    assert summary["ok"]
    assert summary["position_mm"] == pytest.approx([140.0, 110.0, 25.0], abs=0.02)
    assert summary["job_file"]["format"] == title
    # 30 and 20 mm and the plunge of 6 at 10 mm/s; the air at 40
    air_mm = 25.0 + (110.0**2 + 90.0**2) ** 0.5 + 6.0
    assert summary["job_file"]["said_s"] == pytest.approx(5.6 + air_mm / 40.0, abs=0.2)


@pytest.mark.parametrize("title", FILES)
def test_results_have_the_lines_of_the_file(title: str, folder: Path) -> None:
    *results, _ = told(folder / f"part.{title.lower()}")
    ends = {result["number"]: result["position_mm"][:2] for result in results}
    assert (ends[8], ends[9]) == (pytest.approx([140.0, 90.0]), pytest.approx([140.0, 110.0]))


def test_a_move_that_leaves_the_travel_is_refused_before_anything_moves(folder: Path) -> None:
    file = folder / "far.nc"
    file.write_text("G21 G90 F600\nG0 Z5\nG1 X400\nM2\n")
    done = isel_twin("run", file, "--plant", "kinematic")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"isel-twin: {file}: line 3, column ")
    assert done.stderr.count("\n") == 1


def test_what_is_wrong_in_a_file_is_one_line_with_its_place(folder: Path) -> None:
    file = folder / "wrong.nc"
    file.write_text("G21 G90 F600\nG0 X1\nG41 D1\nG1 X2\nM2\n")
    done = isel_twin("run", file, "--plant", "kinematic")
    assert (done.returncode, done.stdout) == (2, "")
    assert done.stderr.startswith(f"isel-twin: {file}: line 3, column 1: ")
    assert "G41" in done.stderr


@pytest.mark.parametrize("words", [("run",), ("check",), ("golden", "record"), ("tune",), ("convert",)], ids=" ".join)
def test_a_machine_that_does_not_fit_is_told_by_its_own_file(words: tuple[str, ...], folder: Path) -> None:
    done = isel_twin(*words, folder / "part.ncp", "--controller", "bwo900")
    assert (done.returncode, done.stdout) == (2, "")
    assert "machine.toml: axes.x.drive: servo drives are asked for" in done.stderr
    assert "part.ncp" not in done.stderr


def test_a_finding_of_check_names_the_line_of_the_file(folder: Path) -> None:
    (folder / "isel-twin.toml").write_text(SETTINGS + "[check]\nplant = 'kinematic'\nspindle = false\ncycle_s = 5.0\n")
    done = isel_twin("check", folder / "part.ncp", "--json")
    assert done.returncode == 1
    (report,) = [json.loads(line) for line in done.stdout.splitlines() if "findings" in line][:1]
    assert [finding["rule"] for finding in report["findings"]] == ["cycle"]


def test_a_golden_run_of_it_is_kept_and_met(folder: Path) -> None:
    assert isel_twin("golden", "record", folder / "part.ncp", "--plant", "kinematic").returncode == 0
    assert isel_twin("check", folder / "part.ncp", "--plant", "kinematic").returncode == 0


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_convert_writes_runs_as_it_is(controller: str, folder: Path) -> None:
    """The commands in a file of their own make the same, and say nothing of a CAM program."""
    words = ("--controller", controller, "--machine", CONTROLLERS[controller])
    made = folder / "made.txt"
    done = isel_twin("convert", folder / "part.g-code", *words, "--out", made)
    assert (done.returncode, done.stdout) == (0, "")
    assert not done.stderr or (controller == "c142" and "line 5: a rapid of 40 mm/s is more than" in done.stderr)
    *_, summary = told(made, *words)
    *_, direct = told(folder / "part.g-code", *words)
    assert "job_file" not in summary
    assert summary["counts"] == direct["counts"]
    assert summary["time_ns"] == direct["time_ns"]


@pytest.mark.skipif(sys.platform == "win32", reason="pipes there do not break like that")
def test_convert_ends_when_nobody_reads_on(tmp_path: Path) -> None:
    """As `| head -1` does, with more lines than a pipe holds: no word, and no success."""
    (tmp_path / "long.nc").write_text(
        "G21 G90 G94 F600\n" + "".join(f"G1 X{at % 50}\n" for at in range(20_000)) + "M2\n"
    )
    with forked.start("convert", tmp_path / "long.nc") as child:
        assert child.stdout.readline() == "@07\n"
        child.stdout.close()
        assert (child.wait(PATIENCE_S), child.stderr.read()) == (1, "")


def test_convert_leaves_no_file_where_something_is_wrong(folder: Path) -> None:
    file, made = folder / "far.nc", folder / "made.txt"
    file.write_text("G21 G90 F600\nG0 Z5\nG1 X400\nM2\n")
    made.write_text("mine\n")
    done = isel_twin("convert", file, "--out", made)
    assert done.returncode == 2
    assert "line 3" in done.stderr
    assert made.read_text() == "mine\n"


@pytest.mark.parametrize(
    ("words", "why"),
    [
        (("part.ncp", "--controller", "external"), "the language of external cannot write toolpaths; name another"),
        (("part.ncp", "--controller", "bwo900"), "take a machine with servo drives, such as 4030-servo"),
        (("part.ncp", "-o", "part.ncp"), "is named twice in this call"),
        (("part.ncp", "-o", "."), "is a folder, not a file"),
        (("part.ncp", "-o", "nowhere/made.txt"), "cannot write in folder nowhere"),
        (("empty.nc",), "there is no line of a CAM program in it"),
        (("nothing.nc",), "there is no such file"),
        (("part.ncp", "--controller", "imc-s9"), "unknown controller 'imc-s9'"),
        *(
            [(("part.ncp", "-o", "/dev/full"), "/dev/full: No space left on device")]
            if Path("/dev/full").exists()
            else []
        ),
    ],
)
def test_what_cannot_be_converted_is_one_line_and_changes_nothing(
    words: tuple[str, ...], why: str, folder: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(folder)
    (folder / "empty.nc").touch()
    before = {file.name: file.read_bytes() for file in folder.iterdir()}
    done = isel_twin("convert", *words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1)
    assert why in done.stderr
    assert {file.name: file.read_bytes() for file in folder.iterdir()} == before


def test_a_file_of_no_format_is_said_and_a_format_can_be_forced(folder: Path) -> None:
    file = folder / "odd.txt"
    file.write_text("what is this\n")
    done = isel_twin("convert", file)
    assert (done.returncode, done.stdout) == (2, "")
    assert "none of the formats excellon, gcode, hpgl, ncp; if it is in one, say which by --format" in done.stderr
    file.write_text("X10\n")
    forced = isel_twin("convert", file, "--format", "gcode")
    assert forced.returncode == 2
    assert "line 1, column 1: " in forced.stderr
    assert "unknown format 'dxf'" in isel_twin("convert", file, "--format", "dxf").stderr


@pytest.mark.parametrize("words", [("run",), ("check",), ("golden", "record"), ("tune",), ("convert",)], ids=" ".join)
def test_a_format_can_be_forced_by_an_option_and_by_the_settings(words: tuple[str, ...], folder: Path) -> None:
    """G-code read as HPGL is wrong from its first letter on."""
    file = folder / "part.g-code"
    said = isel_twin(*words, file, "--format", "hpgl")
    (folder / "isel-twin.toml").write_text(f'{SETTINGS}format = "hpgl"\n')
    settled = isel_twin(*words, file)
    back = isel_twin("convert", file, "--format", "gcode")
    assert said.returncode == settled.returncode == 2
    assert said.stderr == settled.stderr
    assert "line 1, column 1: " in said.stderr
    assert "HPGL" in said.stderr
    assert back.returncode == 0


RING = "".join(f"MOVEABS X{1e4 * math.cos(k * math.tau / 158):.0f} Y{1e4 * math.sin(k * math.tau / 158):.0f}\n"
               for k in range(1, 159))  # fmt: skip
"""A circle of r = 10 mm in chords that leave it by 2 um."""


def ramped_s(steps: int, hz: float) -> float:
    """What an iMC takes for a move: 300 Hz at its begin and end, 100 000 Hz/s."""
    ramp = (hz**2 - 300**2) / 2e5
    if steps < 2 * ramp:
        return 2 * ((300**2 + 1e5 * steps) ** 0.5 - 300) / 1e5
    return 2 * (hz - 300) / 1e5 + (steps - 2 * ramp) / hz


def ring_s() -> float:
    """The ring on an iMC, at 10 mm/s along each chord."""
    points = [(round(float(x) * 0.32), round(float(y) * 0.32)) for x, y in re.findall(r"X(\S+) Y(\S+)", RING)]
    ways = [(abs(x - u), abs(y - v)) for (u, v), (x, y) in itertools.pairwise([(3200, 0), *points])]
    return sum(ramped_s(max(way), round(3200 * max(way) / math.hypot(*way))) for way in ways)


@pytest.mark.parametrize(
    ("controller", "where"),
    [
        ("imc-s8", f"{1e3 * (ring_s() - math.tau) / 158:.0f} ms in each of 158 lines, from rest to rest"),
        ("gmi99", "lines 63 to 122 +"),  # sixty moves in a line of the job
        ("ismif", "ms in each of 158 lines"),
    ],
)
def test_where_the_time_goes_is_said(controller: str, where: str, folder: Path) -> None:
    """By the feeds 2 pi s; in the lines of the file that are made together."""
    file = folder / "ring.ncp"
    (folder / "isel-twin.toml").write_text("[cam]\nstart = [110, 80, 0]\nzero = [100, 80, 0]\n")
    file.write_text(f"IMF_PBL\nVEL 10000\n{RING}PROGEND\n")
    *_, summary = told(file, "--controller", controller, "--machine", CONTROLLERS[controller])
    said, _, here = summary["job_file"]["told"].partition(" s by its feeds, ")
    assert float(said.removeprefix("NCP: ")) == pytest.approx(math.tau, abs=0.06)
    if controller == "imc-s8":
        assert float(here.partition(" s here")[0]) == pytest.approx(ring_s(), abs=0.06)
    assert where in here


@pytest.mark.parametrize(
    ("line", "x_y_z_mm"),
    [
        ("", (140.0, 110.0, 25.0)),
        ("park = [1, 2, 3]", (1.0, 2.0, 3.0)),
        ("start = [5, 5, 5]", (140.0, 110.0, 25.0)),
        ("safe_mm = 9.0", (140.0, 110.0, 25.0)),
        ("z_sign = 1", (140.0, 110.0, 35.0)),
        ("rapid_mm_s = 10.0", (140.0, 110.0, 25.0)),
        ("tolerance_mm = 0.1", (140.0, 110.0, 25.0)),
        ("tool_length_mm = { 1 = 12.5 }", (140.0, 110.0, 25.0)),
    ],
)
def test_a_key_of_the_settings_does_what_it_says(line: str, x_y_z_mm: tuple[float, ...], folder: Path) -> None:
    """The work is 30 mm from the zero of Z: 5 mm above it is 25 in counters that grow downwards, else 35."""
    (folder / "isel-twin.toml").write_text(f"{SETTINGS}{line}\n")
    *_, summary = told(folder / "part.ncp")
    assert summary["position_mm"] == pytest.approx(x_y_z_mm, abs=0.01)


@pytest.mark.parametrize(
    "line",
    [
        "park = [1, 2]", "park = [900, 0, 0]", "tool_change = 3", "start = ['a', 0, 0]", "z_sign = 2", "safe_mm = -1",
        "rapid_mm_s = 0", "tolerance_mm = 0", "tool_length_mm = { a = 1 }", "outputs = { spindle = 99999 }",
    ],
)  # fmt: skip
@pytest.mark.parametrize("words", [("run",), ("convert",)], ids=" ".join)
def test_a_wrong_value_in_the_settings_is_one_line(line: str, words: tuple[str, ...], folder: Path) -> None:
    (folder / "isel-twin.toml").write_text(f"{SETTINGS}{line}\n")
    done = isel_twin(*words, folder / "part.ncp")
    assert (done.returncode, done.stderr.count("\n")) == (2, 1)
    if line == "park = [900, 0, 0]":
        assert "leads to X 900.000 mm of the machine" in done.stderr
    else:
        assert f"isel-twin.toml:6: cam.{line.partition(' ')[0]}" in done.stderr


def test_a_wrong_key_in_the_settings_is_named(folder: Path) -> None:
    (folder / "isel-twin.toml").write_text("[cam]\nzeros_mm = 3\n")
    done = isel_twin("run", folder / "part.ncp", "--plant", "kinematic")
    assert done.returncode == 2
    assert "isel-twin.toml:2: cam.zeros_mm: unknown key; did you mean 'zeros'?" in done.stderr


@pytest.mark.parametrize(
    "job", [*(job for _, job in JOBS.values()), "Q7;1\nG53\nf2000\nM5000\n81h 9000\n", "", "# nothing\n"]
)
def test_a_job_is_none_of_them(job: str) -> None:
    assert reader_for(job.replace("N10 G1 F300 G91 X10\nN20 M30\n", "")) is None


def test_one_command_among_them_makes_it_a_job() -> None:
    assert reader_for(FILES["G-code"] + "@0A100,900,0,30,0,30,0,30\n") is None


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_example_of_the_readme_runs_everywhere(controller: str) -> None:
    """It ends where it began to go round: 1.5 mm outside the corner of the plate, 5 mm above it."""
    plate = Path(__file__).parents[2] / "twin" / "cli" / "starter" / "plate.nc"
    *_, summary = told(plate, "--controller", controller, "--machine", CONTROLLERS[controller])
    assert summary["ok"]
    assert summary["position_mm"] == pytest.approx([118.5, 98.5, 55.0], abs=0.02)
    assert " s here" in summary["job_file"]["told"]


def test_a_machine_has_settings_of_its_own_and_the_project_has_the_last_word(folder: Path) -> None:
    shop = folder / "shop"
    shop.mkdir()
    (shop / "machine.toml").write_text('based_on = "4030"\n[cam]\nzero = [10, 20, 30]\nfeed_mm_s = 4.0\n')
    *_, summary = told(folder / "part.ncp", "--machine", str(shop))
    assert summary["position_mm"] == pytest.approx([140.0, 110.0, 25.0], abs=0.02)
    (folder / "isel-twin.toml").unlink()
    *_, summary = told(folder / "part.ncp", "--machine", str(shop))
    assert summary["position_mm"] == pytest.approx([50.0, 50.0, 25.0], abs=0.02)


def test_a_sweep_takes_it(folder: Path) -> None:
    plan = folder / "plan.toml"
    plan.write_text('[sweep]\njob = "part.ncp"\nplant = "kinematic"\nseeds = 2\n')
    done = isel_twin("sweep", plan, "--workers", "1")
    assert (done.returncode, done.stderr) == (0, "")
