"""Feeds in the unit of a file: times by hand; feeds out of proportion in it are told, usual ones not."""

from __future__ import annotations

import dataclasses
import math
from collections import deque
from typing import Any

import pytest
from cam.played import played

from isel_twin.cam.estimate import Estimate
from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Element
from tests.cam.short import UP, cautions, told

WINPC = dataclasses.replace(UP, dialect="winpc")
BRACKET = """Bracket of sheet metal
X in the drawing is along the fence

%1
N10 G71 G90 T1 M6
N20 M70
N30 G0 X10 Y10 Z5
N40 G1 Z-1 F5
N50 G4 F2
N60 G1 X60 F15
N70 G2 X80 I10 J0
N80 M-70
N90 M30
"""


def of(**settings: Any) -> CamSettings:
    return dataclasses.replace(UP, **settings)


def path_of(name: str, text: str, settings: CamSettings) -> list[Element]:
    return list(reader_named(name).read(text.splitlines(), settings))


def seconds(name: str, text: str, settings: CamSettings) -> float:
    sums = Estimate(settings)
    deque(sums.watched(iter(path_of(name, text, settings))), maxlen=0)
    return sums.seconds


@pytest.mark.parametrize(
    ("settings", "text", "expected_s"),
    [
        ({}, "G21\nG1 X300 F15\nM2", 300 / (15 / 60)),
        ({"feed_unit": "mm/min"}, "G21\nG1 X300 F15\nM2", 1200.0),
        ({"feed_unit": "mm/s"}, "G21\nG1 X300 F15\nM2", 20.0),
        ({"feed_unit": "um/s"}, "G21\nG1 X300 F15000\nM2", 20.0),
        ({}, "G20\nG1 X10 F15\nM2", 10 / (15 / 60)),  # inch and inch/min
        ({"feed_unit": "mm/min"}, "G20\nG1 X10 F1270\nM2", 254 / (1270 / 60)),
        ({"feed_unit": "mm/s"}, "G20 F12.7\nG1 X10\nM2", 254 / 12.7),
        ({"feed_unit": "mm/s"}, "G20 F20\nG1 X10\nG21\nX0\nM2", 2 * 254 / 20),
        ({"feed_unit": "mm/s"}, "G21\nG93 G1 X300 F3\nM2", 20.0),  # a third of a minute
        ({"feed_unit": "mm/s", "feed_mm_s": 30.0}, "G21\nG1 X300\nX0 F15\nM2", 300 / 30 + 300 / 15),
        ({"feed_unit": "mm/s"}, "G21\nF15\nG2 X0 Y0 I10 J0\nM2", 20 * math.pi / 15),
        ({"feed_unit": "mm/s"}, "G21\nG81 X0 Y0 Z-10 R0 F5\nM2", 10 / 5 + 10 / 40),
        ({"dialect": "winpc"}, "G71\nG1 X300 F15\nM30", 20.0),
        ({"dialect": "winpc", "feed_unit": "mm/min"}, "G71\nG1 X300 F900\nM30", 20.0),
        ({"dialect": "winpc"}, "G70\nG1 X10 F12.7\nM30", 254 / 12.7),
        ({"dialect": "din"}, "G71\nG1 X300 F900\nM30", 20.0),
        ({"dialect": "winpc"}, BRACKET, 15 / 40 + 6 / 5 + 2 + 50 / 15 + 10 * math.pi / 15),
    ],
)
def test_times_of_gcode(settings: dict[str, Any], text: str, expected_s: float) -> None:
    assert seconds("gcode", text, of(**settings)) == pytest.approx(expected_s, rel=1e-9)


@pytest.mark.parametrize(
    ("settings", "text", "expected_s"),
    [
        ({}, "FASTVEL 40000\nVEL 15000\nMOVEABS X300000\nFASTABS X0", 20 + 7.5),
        ({"feed_unit": "um/s"}, "FASTVEL 40000\nVEL 15000\nMOVEABS X300000\nFASTABS X0", 20 + 7.5),
        ({"feed_unit": "mm/s"}, "FASTVEL 40\nVEL 15\nMOVEABS X300000\nFASTABS X0", 20 + 7.5),
        ({"feed_unit": "mm/min"}, "FASTVEL 2400\nVEL 900\nMOVEABS X300000\nFASTABS X0", 20 + 7.5),
        ({}, "INCH\nVEL 500\nMOVEABS X10000", 10 / 0.5),  # 1/1000 inch
        ({"feed_unit": "mm/s"}, "INCH\nVEL 12\nMOVEABS X10000", 254 / 12),
        ({}, "FASTVEL 12000\nDRILLDEF S2000 D10000 V5000\nDRILL X0", 2 / 12 + 12 / 5 + 12 / 12),
        ({"feed_unit": "mm/s"}, "FASTVEL 12\nDRILLDEF S2000 D10000 V5\nDRILL X0", 2 / 12 + 12 / 5 + 12 / 12),
        ({"feed_unit": "mm/s"}, "FASTVEL 12\nDRILLDEF S2000 D10000 V5\nINCH\nDRILL X0", 2 / 12 + 12 / 5 + 12 / 12),
        ({}, "FASTVEL 12000\nDRILLDEF S2000 D10000 V5000\nINCH\nDRILL X0", 2 / 12 + 12 / 5 + 12 / 12),
    ],
)
def test_times_of_ncp(settings: dict[str, Any], text: str, expected_s: float) -> None:
    assert seconds("ncp", f"IMF_PBL\n{text}\nPROGEND", of(**settings)) == pytest.approx(expected_s, rel=1e-9)


def test_the_machine_takes_the_time_of_the_file() -> None:
    """300 mm at 15 mm/s, and ramps."""
    run = played("imc-s8", path_of("gcode", "G21\nG1 X300 F15\nM2", of(feed_unit="mm/s")))
    moving = run.t_ns[(run.counts[1:] != run.counts[:-1]).any(axis=1)]
    assert float(moving[-1] - moving[0]) / 1e9 == pytest.approx(20.0, abs=0.1)


def test_a_program_of_winpc() -> None:
    assert told("gcode", BRACKET, WINPC) == [
        "tool 1",
        "output M70 1=1",
        "rapid 10 10 5",
        "line 10 10 -1 F5",
        "dwell 2",
        "line 60 10 -1 F15",
        "arc 80 10 -1 about 70 10 cw F15",
        "output M70 1=0",
        "end",
    ]


@pytest.mark.parametrize(
    ("text", "moves"),
    [
        ("%\nG71\nG0 X1\nM30\n%\n", ["rapid 1 0 0"]),
        ("G71\nG0 X1\nM30\n%\nwords", ["rapid 1 0 0"]),
        ("G71\nG0 X1\n%\n\n", ["caution", "rapid 1 0 0"]),  # % ends it
        ("G71\nG0 X1", ["rapid 1 0 0", "caution"]),
        ("T5 M6\n\n%text of ours\nG71\nG0 X1\nM30", ["rapid 1 0 0"]),
        ("%a\nG71\nG0 X1\n%b\nG0 X2\nM30", ["rapid 1 0 0"]),
    ],
)
def test_text_above_a_program(text: str, moves: list[str]) -> None:
    path = told("gcode", text, WINPC)
    assert [each for each in path if each != "caution"] == [*(each for each in moves if each != "caution"), "end"]
    assert ("caution" in path) == ("caution" in moves)


def test_lines_keep_their_numbers_below_text() -> None:
    with pytest.raises(CamError, match="line 4, column 4: X: 1,5 has a comma"):
        told("gcode", "words\nof ours\n%\nG0 X1,5\nM30", WINPC)


@pytest.mark.parametrize(
    ("line", "why"),
    [
        ("G81 X1 Y1 Z-1 R1", "G81 is refused: holes of WinPC-NC"),
        ("G98 L1", "G98 is refused: a subprogram"),
        ("G54 X10", "X Y Z behind G54"),
        ("G1 X5 Y5\nG2 X15 Y5 I10 J5", "if they are absolute, write G90.1 before it"),
    ],
)
def test_what_winpc_has_otherwise_is_refused(line: str, why: str) -> None:
    with pytest.raises(CamError, match=why):
        told("gcode", f"%1\nG71 F10\n{line}\nM30", WINPC)


def test_arcs_of_din_that_fit_as_offsets_alone_are_offsets_from_there_on() -> None:
    """The last arc fits both ways: about (30, 5) with offsets, about (20, 5) with absolute coordinates."""
    first, last = "G0 X10 Y5\nG2 X20 Y5 I5 J0\n", "G0 X10 Y0\nG3 X10 Y10 I20 J5\nM2"
    made = told("gcode", f"G21 F600\n{first}{last}", of(dialect="din"))
    assert made[1:3] == ["caution", "arc 20 5 0 about 15 5 cw F10"]
    assert made[4] == "arc 10 10 0 about 30 5 ccw F10"
    assert told("gcode", f"G21 F600\n{last}", of(dialect="din"))[1] == "arc 10 10 0 about 20 5 ccw F10"


@pytest.mark.parametrize(
    ("name", "text", "line"),
    [
        ("gcode", "G21\nG0 Z5\nG1 Z-1 F5\nG1 X300 F15\nM2", 4),
        ("gcode", "G21\nM3 S800\nG1 X300 F15\nM2", 3),
        ("gcode", "G21\nM3 S18000\nG1 X300 F30\nX0 F50\nM2", 4),
        ("gcode", "G21\nG81 X10 Y10 Z-3 R1 F3\nX20\nM2", 2),
        ("gcode", "G71\nF20\nG3 X0 Y0 I5 J0\nM2", 3),
        ("gcode", "G20\nG1 X10 F0.5\nM2", 2),
        ("gcode", "G20\nG1 X10 F1300\nM2", 2),  # 550 mm/s
        ("ncp", "IMF_PBL\nVEL 5\nMOVEABS X300000\nPROGEND", 3),
        ("ncp", "IMF_PBL\nDRILLDEF D3000 V2\nDRILL X1000\nPROGEND", 3),
    ],
)
def test_feeds_out_of_proportion_are_told_with_their_line(name: str, text: str, line: int) -> None:
    said = [str(each) for each in path_of(name, text, UP) if "out of proportion" in str(getattr(each, "text", ""))]
    assert [each.partition(":")[0] for each in said] == [f"line {line}"]


@pytest.mark.parametrize(
    ("name", "text", "settings"),
    [
        ("gcode", "G21\nM3 S12000\nG1 Z-0.1 F20\nG1 X300 F60\nM2", {}),  # tracks of a board
        ("gcode", "G21\nM3 S800\nG1 X300 F32\nM2", {}),  # steel, 6 mm: 20 um a tooth
        ("gcode", "G21\nM3 S24000\nG1 X300 F80\nM2", {}),  # a cutter of 0.2 mm
        ("gcode", "G21\nM3 S1000\nG1 X300 F30000\nM2", {}),  # a laser
        ("gcode", "G20\nG1 Z-0.1 F1\nG1 X10 F3\nM2", {}),
        ("gcode", "G21\nG81 X10 Y10 Z-3 R1 F20\nM2", {}),
        ("gcode", "G21\nG1 X1 F600\nX300 F6\nM2", {}),  # one of its cuts is usual
        ("gcode", "G21\nG93 G1 X300 F0.01\nM2", {}),
        ("gcode", "G21\nG1 X300\nM2", {"feed_mm_s": 0.01}),  # the user's own
        ("gcode", "G71\nG1 X300 F15\nM2", {"dialect": "winpc"}),
        ("gcode", "G21\nG1 X300 F100000\nM2", {}),  # in no unit; the machine's own limit is told
        ("ncp", "IMF_PBL\nVEL 5000\nMOVEABS Z-1000\nVEL 100000\nMOVEABS X300000\nPROGEND", {}),
    ],
)
def test_usual_feeds_are_not_remarked(name: str, text: str, settings: dict[str, Any]) -> None:
    assert [each for each in cautions(name, text, of(**settings)) if "proportion" in each] == []


def test_no_unit_is_named_where_none_fits() -> None:
    (said,) = cautions("gcode", "G21\nG1 X300 F0.001\nM2")
    assert said == "feeds out of proportion: the fastest cut of this file is at 1.67e-05 mm/s"
