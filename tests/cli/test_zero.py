"""`--zero`, and the remedy of a way beyond the travel, obeyed as it is printed."""

from __future__ import annotations

import json
import re
from pathlib import Path

import pytest

from tests.cam.wild import WILD
from tests.in_process import isel_twin
from tests.near import NEAR

pytestmark = pytest.mark.long(seconds=5)

PART = "G21 G90\nG0 Z5\nG0 X10 Y10\nG1 Z-5 F600\nG1 X60 Y40\nG0 Z5\nM30\n"
CONTROLLERS = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}
FIRST = ("vectric.ncp", "fusion.nc", "estlcam.nc", "inkscape.hpgl")
FITS = re.compile(r"--zero (\S+) fits, or --zero fit \(\[cam\] (\w+) = (\[.*?\]) keeps it\)")


@pytest.fixture
def part(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "part.nc").write_text(PART)
    return Path("part.nc")


@pytest.mark.parametrize("controller", CONTROLLERS)
@pytest.mark.parametrize("name", FIRST)
def test_the_first_file_is_refused_with_what_mends_it(
    name: str, controller: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The number, the word and the line of the settings, each as it is printed, by itself."""
    if (name, controller) == ("fusion.nc", "bwo900"):
        name = "estlcam.nc"  # the other one is a program of this controller's own
    monkeypatch.chdir(tmp_path)
    Path(name).write_bytes(WILD[name])
    call = ("--controller", controller, "--machine", CONTROLLERS[controller], "--plant", "kinematic")
    feeds = "[cam]\nfeed_mm_s = 10.0\n"  # HPGL has none
    Path("isel-twin.toml").write_text(feeds)
    refused = isel_twin("run", name, *call)
    assert (refused.returncode, refused.stdout) == (2, "")
    assert re.match(rf"isel-twin: {name}: line \d+, column \d+: leads to Z -\d.*; the file draws X ", refused.stderr)
    assert "the machine travels X 0 to 395, Y 0 to 300, Z 0 to 140 mm" in refused.stderr
    (fits,) = FITS.finditer(refused.stderr)
    words, key, listed = fits.groups()
    by_hand = isel_twin("run", name, *call, "--zero", words)
    assert (by_hand.returncode, by_hand.stderr) == (0, "")
    chosen = isel_twin("run", name, *call, "--zero", "fit")
    assert (chosen.returncode, chosen.stderr) == (0, f"isel-twin: {name}: fits with the zero of the work at {words}\n")
    assert chosen.stdout == by_hand.stdout
    Path("isel-twin.toml").write_text(f"{feeds}{key} = {listed}\n")
    kept = isel_twin("run", name, *call)
    assert (kept.returncode, kept.stderr, kept.stdout) == (0, "", by_hand.stdout)


@pytest.mark.parametrize("machine", ["4030", "4030-portal", "traverse"])
def test_what_fits_strikes_no_switch(machine: str, part: Path) -> None:
    """A far switch may stand before the end of the travel."""
    travel = re.search(
        r"travels X 0 to ([\d.]+), Y 0 to ([\d.]+), Z 0 to ([\d.]+) mm",
        isel_twin("run", part, "--machine", machine, "--zero", "0,0,0").stderr,
    )
    assert travel is not None
    x, y, z = (float(mm) for mm in travel.groups())
    part.write_text(f"G21 G90\nG0 Z0\nG0 X0 Y0\nG1 X{x - 10} Y{y} F2000\nG1 X0 Y10 Z-{z - 10}\nG0 Z0\nM30\n")
    done = isel_twin("check", part, "--machine", machine, "--plant", "kinematic", "--zero", "fit", "--json")
    findings = [one for one in json.loads(done.stdout)["findings"] if one["level"] == "error"]
    assert {one["rule"] for one in findings} <= {"refused", "switch", "fault"}, "the whole of Y may be too much"
    part.write_text(part.read_text().replace(f"Y{y}", f"Y{y - 10}"))
    done = isel_twin("check", part, "--machine", machine, "--plant", "kinematic", "--zero", "fit")
    assert done.returncode == 0, done.stdout


COMMANDS = [
    ("run",),
    ("check",),
    ("golden", "record"),
    ("convert",),
    ("tune", "--trials", "1", "--confirm", "1", "--set", "axes.all.stage.kind=fast"),
]


@pytest.mark.parametrize("command", COMMANDS, ids=lambda command: command[0])
def test_every_command_refuses_it_alike_and_takes_the_zero(command: tuple[str, ...], part: Path) -> None:
    near = () if command[0] == "convert" else NEAR
    refused = isel_twin(*command, part, *near)
    assert refused.returncode == 2
    assert "part.nc: line 2, column 1: leads to Z -5.000 mm" in refused.stderr
    assert "--zero 0,0,10 fits, or --zero fit" in refused.stderr
    done = isel_twin(*command, part, "--zero", "fit", *near)
    assert (done.returncode, done.stderr.count("fits with the zero of the work at 0,0,10")) == (0, 1)


def test_a_sweep_takes_it_as_an_option_and_in_its_plan(part: Path) -> None:
    plan = f'[sweep]\njob = "{part}"\nplant = "kinematic"\n'
    Path("plan.toml").write_text(plan)
    refused = isel_twin("sweep", "plan.toml", "--workers", "1")
    assert refused.returncode == 2
    assert "--zero 0,0,10 fits, or --zero fit" in refused.stderr
    for number, (more, words) in enumerate(
        [('zero = "fit"', ()), ("zero = [0, 0, 10]", ()), ("", ("--zero", "0,0,10")), ("", ("--zero", "fit"))]
    ):
        Path("plan.toml").write_text(f"{plan}{more}\n")
        done = isel_twin("sweep", "plan.toml", "--workers", "1", "--out", f"{number}.parquet", *words)
        assert (done.returncode, "0 of 1" in done.stdout) == (0, True), done.stderr
    Path("plan.toml").write_text(f'{plan}zero = "best"\n')
    assert "plan.toml:4: sweep.zero: 'best'; allowed: three numbers" in isel_twin("sweep", "plan.toml").stderr


def test_what_was_chosen_stands_in_the_commands_and_in_the_summary(part: Path) -> None:
    assert "# zero of the work: 0,0,10\n" in isel_twin("convert", part, "--zero", "fit").stdout
    told = isel_twin("run", part, "--plant", "kinematic", "--json", "--zero", "fit").stdout.splitlines()[-1]
    assert json.loads(told)["job_file"]["zero_mm"] == [0.0, 0.0, 10.0]


def test_a_zero_may_be_negative(part: Path) -> None:
    made = isel_twin("convert", part, "--zero", "-5,0,10").stdout
    assert made == isel_twin("convert", part, "--zero=-5,0,10").stdout
    assert "@0M1600," in made  # X 10 - 5 mm, 320 steps a mm


def test_a_golden_run_keeps_its_zero(part: Path) -> None:
    """It is compared with that, by another zero differences are told, and by another file as well."""
    assert isel_twin("golden", "record", part, "--plant", "kinematic", "--zero", "fit").returncode == 0
    assert "zero = [0.0, 0.0, 10.0]" in part.with_suffix(".golden").read_text()
    assert isel_twin("golden", "compare", part).returncode == 0
    assert isel_twin("check", part, "--plant", "kinematic", "--zero", "0,0,10", "--golden").returncode == 0
    other = isel_twin("check", part, "--plant", "kinematic", "--zero", "0,0,20")
    assert other.returncode == 1
    assert "zero: [0.0, 0.0, 10.0] -> [0.0, 0.0, 20.0]" in other.stdout
    assert isel_twin("golden", "compare", part, "--zero", "0,0,20").returncode == 1


@pytest.mark.parametrize("text", ["", "1,2", "1,2,3,4", "1;2;3", "nan,0,0", "1e9,0,0", "fit,0,0", "Fit"])
def test_what_is_no_zero_is_one_line(text: str, part: Path) -> None:
    for command in COMMANDS:
        done = isel_twin(*command, part, "--zero", text)
        assert (done.returncode, done.stderr.count("\n")) == (2, 1)
        assert f"--zero {text!r}: must be X,Y,Z in mm, for example 100,80,60, or fit" in done.stderr


@pytest.mark.parametrize("key", ["start", "park", "tool_change"])
def test_a_point_of_the_settings_that_no_zero_moves_is_named(key: str, part: Path) -> None:
    part.write_text(PART.replace("G0 Z5", "T1 M6\nG0 Z5", 1))
    Path("isel-twin.toml").write_text(f"[cam]\nzero = [0, 0, 20]\n{key} = [0, 500, 0]\n")
    for words in ((), ("--zero", "fit")):
        done = isel_twin("run", part, *words)
        assert done.returncode == 2
        assert (
            f"leads to Y 500.000 mm of the machine, which travels from 0 to 300 mm: change [cam] {key}" in done.stderr
        )


def test_a_file_of_no_cam_program_has_no_zero(part: Path) -> None:
    Path("job.txt").write_text("@07\n@0R7\n")
    done = isel_twin("run", "job.txt", "--plant", "kinematic", "--zero", "fit")
    assert (done.returncode, done.stderr) == (0, "isel-twin: job.txt: is a job of commands, which no zero moves\n")
    done = isel_twin("check", "job.txt", "--plant", "kinematic", "--zero", "fit")
    assert (done.returncode, done.stderr) == (0, "isel-twin: --zero moves nothing: all are jobs of commands\n")
