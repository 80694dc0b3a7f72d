"""The zero with which a file fits: expected ones by hand, from ends of the travel and of the drawing."""

from __future__ import annotations

import io
import re

import pytest

from isel_twin.cam.course import TravelError
from isel_twin.cam.fitting import Read, advised, extents, fitted, with_zero
from isel_twin.cam.reader import text_lines
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Point
from isel_twin.cam.written import MachineAxes

AXES = MachineAxes(steps_mm=(320.0, 320.0, 320.0), travel_mm=((0.0, 400.0), (0.0, 300.0), (0.0, 140.0)))
HEAD = "G21 G90 G17 F600\n"
CUT = HEAD + "G0 Z5\nG0 X10 Y10\nG1 Z-5\nG1 X60 Y40\nG0 Z5\nM30\n"


def read_as(text: str, name: str = "gcode") -> Read:
    return lambda settings: reader_named(name).read(text_lines(io.BytesIO(text.encode())), settings)


def zero_of(text: str, settings: CamSettings | None = None, name: str = "gcode") -> Point:
    return fitted(read_as(text, name), AXES, settings or CamSettings()).zero


@pytest.mark.parametrize(
    ("text", "settings", "zero"),
    [
        # Z 5 above the work is counter 0 at zero 5; 5 mm of room are left above it
        (CUT, CamSettings(), (0.0, 0.0, 10.0)),
        # with Z that counts upwards the deepest cut is the lowest counter
        (CUT, CamSettings(z_sign=1), (0.0, 0.0, 10.0)),
        # a cut that is positive in the file
        (CUT.replace("Z5", "Z-1").replace("Z-5", "Z2"), CamSettings(file_z_up=False), (0.0, 0.0, 6.0)),
        # what fits stays
        (CUT, CamSettings(zero=(100.0, 80.0, 60.0)), (100.0, 80.0, 60.0)),
        # X up to 460 is 60 too far, and 5 mm of room
        (CUT, CamSettings(zero=(400.0, 80.0, 60.0)), (335.0, 80.0, 60.0)),
        (CUT.replace("X10 Y10", "X-30 Y10"), CamSettings(zero=(0.0, 0.0, 60.0)), (35.0, 0.0, 60.0)),
        # to the end of the travel and no further: a far switch may stand before it
        (CUT.replace("X60 Y40", "X60 Y300"), CamSettings(zero=(0.0, 0.0, 60.0)), (0.0, -5.0, 60.0)),
        # no whole mm: half of what is left on both sides
        (CUT.replace("X60", "X409.5"), CamSettings(zero=(0.0, 0.0, 60.0)), (-9.75, 0.0, 60.0)),
        # the whole travel
        (CUT.replace("X60", "X410"), CamSettings(zero=(0.0, 0.0, 60.0)), (-10.0, 0.0, 60.0)),
        # a half circle from (0, 0) to (0, 100) about (0, 50) to the left: X down to -50
        (HEAD + "G0 X0 Y0 Z5\nG1 Z0\nG2 X0 Y100 I0 J50\nM30\n", CamSettings(zero=(0.0, 0.0, 60.0)), (55.0, 0.0, 60.0)),
        # the same from where the tool stands: X and Y are taken as they are
        (HEAD + "G0 Z5\nG1 Z0\nG3 X0 Y100 I0 J50\nM30\n", CamSettings(), (0.0, 0.0, 10.0)),
        # in the zero that the file chooses by G54, which [cam] zeros may have, too
        (CUT.replace("G17", "G17 G54"), CamSettings(zeros={1: (0.0, 0.0, 0.0)}), (0.0, 0.0, 10.0)),
        # G55 and G53 lead where they lead
        (CUT.replace("M30", "G55 G0 X5\nM30"), CamSettings(zeros={2: (0.0, 0.0, 20.0)}), (0.0, 0.0, 10.0)),
        (CUT.replace("M30", "G53 G0 Z-1\nM30"), CamSettings(), (0.0, 0.0, 10.0)),
        # incremental; the length of a tool
        (HEAD + "G0 X0 Y0 Z5\nG91\nG1 Z-10\nG1 X50\nG90\nG0 Z5\nM30\n", CamSettings(), (0.0, 0.0, 10.0)),
        (CUT.replace("G0 Z5\nG0", "T1 M6\nG0 G43 H1 Z5\nG0", 1), CamSettings(tool_length_mm={1: 30.0}), (0, 0, 40)),
    ],
)  # fmt: skip
def test_the_nearest_zero_that_fits(text: str, settings: CamSettings, zero: Point) -> None:
    assert zero_of(text, settings) == zero
    assert zero_of(text, with_zero(settings, zero)) == zero, "it fits"


@pytest.mark.parametrize(
    ("name", "text", "zero"),
    [
        # 5 mm above the work until 0.5 mm below it
        ("hpgl", "IN;SP1;PU400,400;PD;PA1600,1200;PU;SP0;", (0.0, 0.0, 10.0)),
        # um
        ("ncp", "IMF_PBL_V1.0\nVEL 10000\nFASTABS Z3000\nFASTABS X-2000\nMOVEABS Z-1000\nPROGEND\n", (7.0, 0.0, 8.0)),
        # a reference run leads to 0 of the machine, wherever the zero is
        ("ncp", "IMF_PBL_V1.0\nVEL 10000\nFASTABS Z3000\nMOVEABS X9000 Z-1000\nREF XYZ\nPROGEND\n", (0.0, 0.0, 8.0)),
        # a hole at X 10 and Y -5.5 of the board
        ("excellon", "M48\nMETRIC\nT1C0.8\n%\nT1\nX10.0Y-5.5\nM30\n", (0.0, 11.0, 10.0)),
    ],
)
def test_every_format_has_it(name: str, text: str, zero: Point) -> None:
    assert zero_of(text, CamSettings(feed_mm_s=10.0), name) == zero


@pytest.mark.parametrize(
    ("text", "why"),
    [
        (
            CUT.replace("X60", "X420").replace("Z-5", "Z-9"),
            r"draws X 10 to 420, Y 10 to 40, Z -9 to 5 mm about its zero",
        ),
        (CUT.replace("X60", "X420"), r"draws X 10 to 420, .*: along X the file is longer than the travel by 10 mm"),
        # 5 inches above and below the work
        (
            CUT.replace("G21", "G20").replace("X60 Y40", "X1 Y1"),
            r"along Z the file is longer than the travel by 114 mm",
        ),
        (CUT.replace("M30", "G53 G0 X500\nM30"), r"line 7 leads to X 500 mm wherever the zero of the work is"),
        (CUT.replace("M30", "G53 G0 Z1\nM30"), r"line 7 leads to Z -1 mm wherever"),
        (HEAD + "G91\nG0 X-5\nM30\n", r"line 3 leads to X -5 mm wherever"),
        (CUT.replace("G1 X60 Y40", "G2 X60 Y40 I1 J1"), r"told: line 5, column 1: "),
    ],
)
def test_why_none_fits(text: str, why: str) -> None:
    read, settings = read_as(text), CamSettings()
    error = advised(TravelError("leads beyond"), read, AXES, settings)
    assert error.zero is None
    assert re.search(why, str(error))


def test_the_extents_are_those_of_the_drawing() -> None:
    """As the counters count: Z of the cut is deepest where it is greatest. The start of the tool is fixed."""
    found = extents(read_as(CUT), CamSettings(zero=(7.0, 8.0, 9.0)))
    assert [tuple(map(float, span)) for span in found.work if span is not None] == [(10, 60), (10, 40), (-5, 5)]
    assert [None if ends is None else (ends[0][0], ends[1][0]) for ends in found.fixed] == [(0, 0), (0, 0), None]
