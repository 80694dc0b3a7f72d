"""What is given for a job and is none, and jobs of controllers from outside: each command runs it, or says in a line
why not."""

from __future__ import annotations

import os
import threading
from pathlib import Path
from typing import Any

import pytest

from isel_twin.firmware import imc
from tests.cam.wild import WILD
from tests.in_process import isel_twin
from tests.near import NEAR

pytestmark = pytest.mark.long(seconds=5)

COMMANDS = [("run",), ("check",), ("convert",), ("tune",), ("golden", "record")]
TWICE = COMMANDS[1:]  # read it twice, or keep something beside it
PART = "G21 G90\nG0 X10 Y5\nG1 X20 F600\nM2\n"
SETTINGS = "[cam]\nzero = [100, 80, 40]\ndepth_mm = 1.0\nfeed_mm_s = 10.0\n"


def refused(*words: object) -> str:
    done = isel_twin(*words)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (2, "", 1), done.stderr
    return done.stderr


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_what_is_no_file_is_one_line(command: tuple[str, ...], tmp_path: Path) -> None:
    (tmp_path / "empty.nc").touch()
    (tmp_path / "folder.nc").mkdir()
    nothing = "no line of a CAM program in it" if command == ("convert",) else "there is no command in it"
    assert f"empty.nc: there is {nothing.removeprefix('there is ')}" in refused(*command, tmp_path / "empty.nc")
    assert f"{os.devnull}: there is {nothing.removeprefix('there is ')}" in refused(*command, os.devnull)
    folder = "there is no job file in this folder" if command == ("check",) else "is a folder, not a file"
    assert f"folder.nc: {folder}" in refused(*command, tmp_path / "folder.nc")
    assert "missing.nc: there is no such file" in refused(*command, tmp_path / "missing.nc")
    assert sorted(file.name for file in tmp_path.iterdir()) == ["empty.nc", "folder.nc"]


@pytest.mark.parametrize("command", COMMANDS, ids=" ".join)
def test_a_file_that_may_not_be_read_is_one_line(
    command: tuple[str, ...], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    file = tmp_path / "part.nc"
    file.write_text(PART)
    opened = Path.open

    def denied(path: Path, *how: Any, **further: Any) -> Any:
        if path == file:
            raise PermissionError(13, "Permission denied", str(path))
        return opened(path, *how, **further)

    monkeypatch.setattr(Path, "open", denied)
    assert "part.nc: Permission denied" in refused(*command, file)


@pytest.mark.parametrize("command", TWICE, ids=" ".join)
def test_a_pipe_is_refused_where_a_job_is_read_twice(command: tuple[str, ...], tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    assert "pipe: is a pipe, which can be read only once; save it to a file" in refused(*command, tmp_path / "pipe")


def test_a_pipe_is_run(tmp_path: Path) -> None:
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    writer = threading.Thread(target=pipe.write_text, args=(PART,))
    writer.start()
    done = isel_twin("run", pipe, "--plant", "kinematic")
    writer.join()
    assert (done.returncode, done.stderr) == (0, "")
    assert "G-code: " in done.stdout


@pytest.fixture
def plotter(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A controller of somebody else's, installed in a folder of its own: an iMC whose language writes toolpaths of X
    and Y in its own way, and one that cannot."""
    info = tmp_path / "plugins" / "plotter-0.1.dist-info"
    info.mkdir(parents=True)
    (info / "METADATA").write_text("Metadata-Version: 2.1\nName: plotter\nVersion: 0.1\n")
    (info / "entry_points.txt").write_text(
        "[isel_twin.controllers]\nplotter = plotter:create\nmute = plotter:create\n"
        "[isel_twin.languages]\nplotter = plotter:language\nmute = plotter:mute\n"
    )
    (info.parent / "plotter.py").write_text(PLOTTER)
    monkeypatch.syspath_prepend(info.parent)
    (tmp_path / "part.nc").write_text(PART)
    (tmp_path / "isel-twin.toml").write_text("[cam]\nz_sign = -1\n")
    return tmp_path


PLOTTER = f"""
from {imc.__name__} import create as create_imc
from isel_twin.cam.toolpath import CamError, Line, Rapid
from isel_twin.cam.written import Written
from isel_twin.language import create_language

def create(name, **given):
    return create_imc("imc-s8", **given)

class Mute:
    def __init__(self):
        inner = create_language("imc-s8")
        for each in ("frame", "text", "accepted", "messages", "rest", "reference", "move", "break_off", "ranges"):
            setattr(self, each, getattr(inner, each))

class Plotter(Mute):
    def written(self, path, axes, settings):
        yield Written("@07")
        yield Written("@0R7")
        for element in path:
            if isinstance(element, Rapid | Line):
                if element.to[2]:
                    raise CamError("the pen has one height", element.place)
                x, y = (round(mm * steps) for mm, steps in zip(element.to, axes.steps_mm[:2]))
                yield Written(f"@0M{{x}},4000,{{y}},4000,0,4000,0,30", element.place)

def language(name):
    return Plotter()

def mute(name):
    return Mute()
"""


def test_a_file_is_converted_and_run_in_the_words_of_a_controller_from_outside(plotter: Path) -> None:
    job = plotter / "job.txt"
    assert isel_twin("convert", plotter / "part.nc", "--controller", "plotter", "-o", job).returncode == 0
    assert job.read_text() == ("@07\n@0R7\n@0M3200,4000,1600,4000,0,4000,0,30\n@0M6400,4000,1600,4000,0,4000,0,30\n")
    done = isel_twin("run", plotter / "part.nc", "--controller", "plotter", "--plant", "kinematic", "--json")
    assert (done.returncode, done.stderr) == (0, "")
    assert '"position_mm": [20.0, 5.0, 0.0]' in done.stdout


def test_what_it_cannot_make_is_refused_in_the_line_of_the_file(plotter: Path) -> None:
    (plotter / "part.nc").write_text(PART.replace("G1 X20", "G1 X20 Z-1"))
    for command in (("run",), ("check",), ("convert", "-o", plotter / "job.txt")):
        told = refused(*command, plotter / "part.nc", "--controller", "plotter")
        assert "part.nc: line 3, column 1: the pen has one height" in told


def test_a_language_that_writes_no_toolpaths_says_so(plotter: Path) -> None:
    told = refused("convert", plotter / "part.nc", "--controller", "mute")
    assert "part.nc: the language of mute cannot write toolpaths; name another controller" in told


def test_files_as_owners_have_them_are_swept(tmp_path: Path) -> None:
    (tmp_path / "isel-twin.toml").write_text(SETTINGS)
    call = {"imc-s8": "4030", "ismif": "4030", "gmi99": "4030-servo", "bwo900": "4030-servo"}
    for name, controller in zip(WILD, [*call, *call], strict=False):
        (tmp_path / name).write_bytes(WILD[name])
        plan = f'[sweep]\njob = "{name}"\ncontroller = "{controller}"\nmachine = "{call[controller]}"\n'
        (tmp_path / "plan.toml").write_text(f'{plan}plant = "kinematic"\n')
        done = isel_twin("sweep", tmp_path / "plan.toml", "--out", tmp_path / f"{name}.parquet", "--workers", "1")
        assert done.returncode == 0
        assert all(": caution: line " in line for line in done.stderr.splitlines()), done.stderr
        assert "1 of 1 rows" in done.stdout


def test_a_file_as_an_owner_has_it_is_tuned(tmp_path: Path) -> None:
    (tmp_path / "isel-twin.toml").write_text(SETTINGS)
    (tmp_path / "vectric.ncp").write_bytes(WILD["vectric.ncp"])
    known = ("--set", "axes.all.stage.kind=fast")
    done = isel_twin("tune", tmp_path / "vectric.ncp", "--trials", "1", "--confirm", "1", *known, *NEAR)
    assert done.returncode == 0
    said = [line.split(": caution: ")[1] for line in done.stderr.splitlines()]
    assert [text[:28] for text in said] == ["line 10: a spindle speed of ", "line 14: coolant is not swit"]
    assert "@0M" in (tmp_path / "vectric.tuned.ncp").read_text()
