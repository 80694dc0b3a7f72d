"""A part is made into commands, and what a host sent for it into a file again: the same way, within a step."""

from __future__ import annotations

import io
import itertools
import math
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from isel_twin.cam import arcs
from isel_twin.cam.files import WRITERS
from isel_twin.cam.reader import text_lines
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Coolant, Element, Line, Place, Rapid, Remark, Spindle
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.recovered import CHORD_MM, recovered
from isel_twin.jobs.toolpaths import source_of
from isel_twin.language import create_language
from tests.in_process import isel_twin

PART = (
    "G21 G90 F600\nM3\nG0 Z5\nG0 X10 Y10\nG1 Z-1 F300\nG1 X20 F600\nG3 X20 Y20 I0 J5\n"
    "G2 X20 Y20 I-4 J3\nG1 X10 Y17\nG0 Z5\nM5\nM2\n"
)
SETTINGS = CamSettings(zero=(20.0, 10.0, 20.0), feed_mm_s=10.0)
STEPS_MM = {"imc-s8": 320.0, "c142": 320.0, "ismif": 80.0, "gmi99": 1000.0, "bwo900": 1000.0}


def sent_for(controller: str, text: str = PART, settings: CamSettings = SETTINGS) -> tuple[TwinSpec, list[bytes]]:
    spec = TwinSpec("4030" if STEPS_MM[controller] < 1000.0 else "4030-servo", controller)
    source = source_of(text.encode(), ".nc", create_language(controller), controller, spec.fitted, settings)
    assert source is not None
    return spec, [line.sent for line in source.lines]


def way(path: Iterable[Element]) -> np.ndarray:
    """Points [n, 3] every 0.02 mm or closer; it begins at the zero of the machine."""
    point, points = np.zeros(3), [np.zeros((1, 3))]
    for element in path:
        if isinstance(element, Arc):
            shape = arcs.shape(element, tuple(point.tolist()))  # type: ignore[arg-type]
            angles = shape.start_angle + shape.sweep * np.linspace(0.0, 1.0, 2 + math.ceil(shape.length / 0.02))
            made = np.tile(np.array(element.to), (len(angles), 1))
            made[:, 0] = element.centre[0] + shape.start_radius * np.cos(angles)
            made[:, 1] = element.centre[1] + shape.start_radius * np.sin(angles)
            points.append(made)
        elif isinstance(element, Line | Rapid):
            share = np.linspace(0.0, 1.0, 2 + math.ceil(math.dist(point, element.to) / 0.02))[:, None]
            points.append(point + share * (np.array(element.to) - point))
        else:
            continue
        point = np.array(element.to)
    return np.vstack(points)


def apart_mm(one: np.ndarray, other: np.ndarray) -> float:
    from scipy.spatial import cKDTree

    return float(max(cKDTree(one).query(other)[0].max(), cKDTree(other).query(one)[0].max()))


@pytest.mark.parametrize("controller", STEPS_MM)
def test_the_way_is_that_of_the_part(controller: str) -> None:
    asked = way(reader_named("gcode").read(text_lines(io.BytesIO(PART.encode())), SETTINGS))
    spec, sent = sent_for(controller)
    path = list(recovered(sent, spec))
    step_mm = 1.0 / STEPS_MM[controller]
    bound_mm = SETTINGS.tolerance_mm + 1.5 * step_mm + 0.02  # chords of arcs, rounding, points apart
    assert apart_mm(way(path), asked) < bound_mm
    for name, write in WRITERS.items():
        text = "\n".join(write(iter(path))).encode()
        again = list(reader_named(name).read(text_lines(io.BytesIO(text)), CamSettings()))
        assert apart_mm(way(again), asked) < bound_mm + 0.001, name


def test_the_words_of_a_toolpath() -> None:
    """Axes and feeds that do not change are left out, and so is a move of no length; NCP has whole um."""
    at = Place(1)
    path = [
        Spindle(at, 1),
        Coolant(at, 1, True),
        Rapid(at, (10.0, 0.0, 5.0)),
        Rapid(at, (10.0, 0.0, 5.0)),
        Line(at, (10.0, 0.0, -1.0), 5.0),
        Line(at, (20.0, 0.0, -1.0), 5.0),
        Arc(at, (20.0, 10.0, -1.0), (20.0, 5.0, 0.0), 2, 1, 10.0),
        Arc(at, (20.0, 10.0, -1.0), (20.0, 7.5, 0.0), 2, -1, 10.0),
        Remark(at, "a (slot)"),
        Coolant(at, 2, True),
        Coolant(at, 2, False),
        Spindle(at, -1),
        Spindle(at, 0),
        Line(at, (20.0 / 3.0, 10.0, -1.0), 1.0 / 7.0),
    ]
    assert [*WRITERS["gcode"](iter(path))][2:-2] == [
        *("M3", "M8", "G0 X10 Z5", "G1 Z-1 F300", "G1 X20", "G3 X20 Y10 I0 J5 F600", "G2 X20 Y10 I0 J-2.5"),
        *("(a [slot])", "M7", "M9", "M4", "M5", "G1 X6.66667 F8.571"),
    ]
    assert [*WRITERS["ncp"](iter(path))][1:-1] == [
        *("SPINDLE CW ON", "COOLANT ON", "FASTABS X10000 Z5000", "VEL 5000", "MOVEABS Z-1000", "MOVEABS X20000"),
        *("VEL 10000", "CCWABS I20000 J5000 X20000 Y10000", "CWABS I20000 J7500", "; a (slot)", "COOLANT2 ON"),
        *("COOLANT2 OFF", "SPINDLE CCW ON", "SPINDLE OFF", "VEL 143", "MOVEABS X6667"),
    ]


@pytest.mark.parametrize("name", WRITERS)
@pytest.mark.parametrize("controller", STEPS_MM)
def test_round_and_round_it_stays_within_a_step(controller: str, name: str) -> None:
    """Job, file, job, file: what is on whole counts once stays there; chords of joined moves are within CHORD_MM."""
    spec, sent = sent_for(controller)
    once = list(recovered(sent, spec))
    text = "\n".join(WRITERS[name](iter(once)))
    _, again = sent_for(controller, text, CamSettings())
    bound_mm = math.sqrt(3.0) / STEPS_MM[controller] + 2.0 * CHORD_MM + 0.01  # and half of what points are apart
    assert apart_mm(way(recovered(again, spec)), way(once)) < bound_mm


def test_arcs_stay_arcs_and_feeds_feeds_where_the_controller_has_them() -> None:
    """A half circle counter-clockwise, a full one clockwise, at 10 mm/s; the plunge at 5."""
    path = list(recovered(*reversed(sent_for("imc-s8"))))
    found = [element for element in path if isinstance(element, Arc)]
    assert [(arc.turns > 0, arc.feed_mm_s) for arc in found] == [
        (True, pytest.approx(10.0, rel=0.02)),
        (False, pytest.approx(10.0, rel=0.02)),
    ]
    assert [arc.centre[:2] for arc in found] == [pytest.approx((40.0, 25.0)), pytest.approx((36.0, 33.0))]
    (plunge,) = [one for one in path if isinstance(one, Line) and one.to[2] == -21.0 and one.to[:2] == (30.0, 20.0)]
    assert plunge.feed_mm_s == pytest.approx(5.0, rel=0.01)
    assert [element.turns for element in path if isinstance(element, Spindle)] == [1, 0]


@pytest.mark.parametrize(("sweep_deg", "turns"), [(30.0, 2), (300.0, 3), (360.0, 3)])
def test_turns_are_circles_and_what_is_left_of_them(sweep_deg: float, turns: int) -> None:
    """LinuxCNC's P: so many turns, the last of them up to the end. Each stays an arc, at the feed of 10 mm/s."""
    x, y = (10.0 * function(math.radians(sweep_deg)) for function in (math.cos, math.sin))
    part = f"G21 G90 F600\nG0 X10 Y0\nG3 X{x:.4f} Y{y:.4f} I-10 J0 P{turns}\nM2\n"
    path = list(recovered(*reversed(sent_for("imc-s8", part))))
    made = [(before.to, one) for before, one in itertools.pairwise(path) if isinstance(one, Arc)]
    length = sum(arcs.shape(arc, begin).length for begin, arc in made)
    assert length == pytest.approx(10.0 * (2.0 * math.pi * (turns - 1) + math.radians(sweep_deg)), abs=0.01)
    assert [arc.feed_mm_s for _, arc in made] == [pytest.approx(10.0, rel=0.02)] * turns


def test_a_helix_is_chords_and_no_staircase() -> None:
    """Its steps are 3.1 um; chords that leave a circle of 10 mm by s have an angle of 2 acos(1 - s / r)."""
    spec, sent = sent_for("imc-s8", "G21 G90 F600\nG0 X10 Y0 Z5\nG3 X10 Y0 Z4.8 I-10 J0\nM2\n")
    assert any(data.startswith(b"@0w") for data in sent)
    path = [one for one in recovered(sent, spec) if isinstance(one, Line)]
    assert len(path) < 2.0 * math.pi / math.acos(1.0 - CHORD_MM / 10.0)
    lengths = [math.dist(before.to, one.to) for before, one in itertools.pairwise(path)]
    seconds = sum(length / one.feed_mm_s for length, one in zip(lengths, path[1:], strict=True))
    assert sum(lengths) / seconds == pytest.approx(10.0, rel=0.02)  # that of the way, not of its single steps


def test_a_recorded_session_becomes_a_file(tmp_path: Path) -> None:
    (tmp_path / "part.nc").write_text("G21 G90 F600\nG0 X10 Y0\nG1 X20\nG2 X20 Y0 I5 J0\nM2\n")
    (tmp_path / "isel-twin.toml").write_text("[cam]\nzero = [50, 50, 0]\n")
    session = tmp_path / "session.mcap"
    assert isel_twin("run", tmp_path / "part.nc", "--plant", "kinematic", "--record", session).returncode == 0
    told = isel_twin("decode", session, "--to", "gcode")
    assert (told.returncode, told.stderr) == (0, "")
    assert [line.partition(" F")[0] for line in told.stdout.splitlines()] == [
        "%", "G21 G90 G91.1 G94 G17 G40 G49 G80", "G1 X60 Y50", "G1 X70", "G2 X70 Y50 I5 J0", "M30", "%"
    ]  # fmt: skip
    told = isel_twin("decode", session, "--to", "ncp")
    moves = [line for line in told.stdout.splitlines() if "ABS" in line]
    assert moves[-2:] == ["MOVEABS X70000", "CWABS I75000 J50000"]


def test_a_recording_says_of_which_machine_it_is(tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text("Q7;1\nf2000\nM5000\n81h 9000\n")
    session, called = (
        tmp_path / "session.mcap",
        ("--machine", "4030-servo", "--controller", "gmi99", "--plant", "kinematic"),
    )
    assert isel_twin("run", tmp_path / "job.txt", *called, "--record", session).returncode == 0
    told = isel_twin("decode", session, "--to", "ncp")
    assert [line for line in told.stdout.splitlines() if "ABS" in line] == ["MOVEABS X9000"]


def test_text_and_the_other_direction(tmp_path: Path) -> None:
    """Relative moves, a zero set on the way, and nothing of what the controller says."""
    told = isel_twin("decode", "@07", "--to", "gcode", "--text")
    assert (told.returncode, told.stdout) == (2, "")
    assert "moves nothing but reference runs" in told.stderr
    for words in (("--json",), ("--received",), ("--machine", "none")):
        told = isel_twin("decode", "@07", "--text", "--to", "ncp", *words)
        assert (told.returncode, told.stdout, told.stderr.count("\n")) == (2, "", 1)
    (tmp_path / "job.bin").write_bytes(b"@07\r@0R7\r@0A320,3000,0,30,0,30,0,30\r@0n7\r@0A0,30,640,3000,0,30,0,30\r")
    told = isel_twin("decode", tmp_path / "job.bin", "--to", "ncp")
    assert [line for line in told.stdout.splitlines() if "ABS" in line] == ["MOVEABS X1000", "MOVEABS Y2000"]
