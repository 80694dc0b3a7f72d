"""G-code: one row a case, the program and its toolpath in short words, or how the error begins."""

from __future__ import annotations

import dataclasses
import math
import re
from typing import Any

import pytest
from conformance.rows import case

from isel_twin.cam.registry import reader_named
from isel_twin.cam.toolpath import Arc, CamError
from tests.cam.short import UP, length, told

SETTINGS = dataclasses.replace(
    UP,
    zero=(0.0, 0.0, 0.0),
    zeros={2: (1.0, 2.0, 3.0)} | {number: (float(number), 0.0, 0.0) for number in range(3, 10)},
    tool_length_mm={4: 10.0},
    strict=True,
)
ELSEWHERE = dataclasses.replace(SETTINGS, zero=(100.0, 50.0, 20.0), start=(100.0, 50.0, 20.0))


@pytest.mark.parametrize(
    ("program", "verdict"),
    [
        case("gcode-1-1", "G21\nF60\nG0 X1 Y2 Z3\nM2", "rapid 1 2 3 | end"),
        case("gcode-1-2", "G21\nF60\nG1 X1 Y2 Z3\nM2", "line 1 2 3 F1 | end"),
        case("gcode-1-3", "G21\nF60\nG2 X10 I5\nM2", "arc 10 0 0 about 5 0 cw F1 | end"),
        case("gcode-1-4", "G21\nF60\nG3 X10 I5\nM2", "arc 10 0 0 about 5 0 ccw F1 | end"),
        case("gcode-1-5", "G21\nF60\nG4 P0.5\nM2", "dwell 0.5 | end"),
        case("gcode-1-6", "G21\nF60\nG10 L2 P1 X5\nG0 X0\nG10 L20 P1 X3\nG0 X0\nM2", "rapid 5 0 0 | rapid 2 0 0 | end"),
        case("gcode-1-7", "G21\nF60\nG18\nG17 G2 X10 I5\nM2", "arc 10 0 0 about 5 0 cw F1 | end"),
        case("gcode-1-8", "G21\nF60\nG18 G2 X10 I5\nM2", "arc 10 0 0 about 5 0 XZ cw F1 | end"),
        case("gcode-1-9", "G21\nF60\nG19 G3 Z8 K4\nM2", "arc 0 0 8 about 0 4 YZ ccw F1 | end"),
        case("gcode-1-10", "G20\nF60\nG1 X1\nM2", "line 25.4 0 0 F25.4 | end"),
        case("gcode-1-11", "G21\nF60\nG1 X1\nM2", "line 1 0 0 F1 | end"),
        case("gcode-1-12", "G21\nF60\nG0 X5 Y5\nG28 X7\nM2", "rapid 5 5 0 | rapid 7 5 0 | rapid 0 5 0 | end"),
        case(
            "gcode-1-13", "G21\nF60\nG0 X5 Y5\nG28.1\nG0 X9\nG28\nM2", "rapid 5 5 0 | rapid 9 5 0 | rapid 5 5 0 | end"
        ),
        case(
            "gcode-1-14",
            "G21\nF60\nG0 X5\nG30.1\nG0 X9\nG30\nG28\nM2",
            "rapid 5 0 0 | rapid 9 0 0 | rapid 5 0 0 | rapid 0 0 0 | end",
        ),
        case("gcode-1-15", "G21\nF60\nG0 X5\nG30.1\nG0 X9\nG30\nM2", "rapid 5 0 0 | rapid 9 0 0 | rapid 5 0 0 | end"),
        case("gcode-1-16", "G21\nF60\nG40\nG41\nM2", "G41 is refused: cutter compensation"),
        case("gcode-1-17", "G21\nF60\nG43 H4\nG0 X1 Z0\nM2", "rapid 1 0 10 | end"),
        case("gcode-1-18", "G21\nF60\nG43 H4\nG49\nG0 X1 Z0\nM2", "rapid 1 0 0 | end"),
        case("gcode-1-19", "G21\nF60\nG52 X3\nG0 X1\nG52 X0\nG0 X1\nM2", "rapid 4 0 0 | rapid 1 0 0 | end"),
        case("gcode-1-20", "G21\nF60\nG53 G0 X1\nG0 X1\nM2", "rapid 1 50 20 | rapid 101 50 20 | end"),
        case("gcode-1-21", "G21\nF60\nG55 G0 X0\nG54 G0 X0\nM2", "rapid 1 0 0 | rapid 0 0 0 | end"),
        case("gcode-1-22", "G21\nF60\nG61\nG61.1\nG64 P0.1 Q0.1\nM2", "exact | exact | joined 0.1 | end"),
        case(
            "gcode-1-23",
            "G21\nF60\nG73 X1 Z-3 R0 Q2\nM2",
            "rapid 1 0 0 | line 1 0 -2 F1 | rapid 1 0 -1.746 | line 1 0 -3 F1 | rapid 1 0 0 | end",
        ),
        case("gcode-1-24", "G21\nF60\nG81 X1 Z-3 R0\nG80\nX5\nM2", "no motion takes X"),
        case(
            "gcode-1-25",
            "G21\nF60\nG81 X1 Z-3 R1\nM2",
            "rapid 0 0 1 | rapid 1 0 1 | line 1 0 -3 F1 | rapid 1 0 1 | end",
        ),
        case(
            "gcode-1-26",
            "G21\nF60\nG82 X1 Z-3 R1 P0.5\nM2",
            "rapid 0 0 1 | rapid 1 0 1 | line 1 0 -3 F1 | dwell 0.5 | rapid 1 0 1 | end",
        ),
        case(
            "gcode-1-27",
            "G21\nF60\nG83 X0 Z-3 R0 Q2\nM2",
            "line 0 0 -2 F1 | rapid 0 0 0 | rapid 0 0 -1.746 | line 0 0 -3 F1 | rapid 0 0 0 | end",
        ),
        case("gcode-1-28", "G21\nF60\nG85 X0 Z-3 R0\nM2", "line 0 0 -3 F1 | line 0 0 0 F1 | end"),
        case("gcode-1-29", "G21\nF60\nG89 X0 Z-3 R0 P1\nM2", "line 0 0 -3 F1 | dwell 1 | line 0 0 0 F1 | end"),
        case("gcode-1-30", "G21\nF60\nG91\nG0 X1\nG90\nG0 X1 Y1\nM2", "rapid 1 0 0 | rapid 1 1 0 | end"),
        case("gcode-1-31", "G21\nF60\nG91\nG0 X1\nX1\nM2", "rapid 1 0 0 | rapid 2 0 0 | end"),
        case(
            "gcode-1-32",
            "G21\nF60\nG0 X10\nG90.1 G2 X20 I15 J0\nM2",
            "rapid 10 0 0 | arc 20 0 0 about 15 0 cw F1 | end",
        ),
        case(
            "gcode-1-33",
            "G21\nF60\nG0 X10\nG90.1\nG91.1 G2 X20 I5\nM2",
            "rapid 10 0 0 | arc 20 0 0 about 15 0 cw F1 | end",
        ),
        case("gcode-1-34", "G21\nF60\nG0 X5\nG92 X0\nG0 X1\nM2", "rapid 5 0 0 | rapid 6 0 0 | end"),
        case("gcode-1-35", "G21\nF60\nG0 X5\nG92 X0\nG92.1\nG92.3\nG0 X1\nM2", "rapid 5 0 0 | rapid 1 0 0 | end"),
        case("gcode-1-36", "G21\nF60\nG0 X5\nG92 X0\nG92.2\nG0 X1\nM2", "rapid 5 0 0 | rapid 1 0 0 | end"),
        case("gcode-1-37", "G21\nF60\nG0 X5\nG92 X0\nG92.2\nG92.3\nG0 X1\nM2", "rapid 5 0 0 | rapid 6 0 0 | end"),
        case("gcode-1-38", "G21\nF60\nG93 G1 X60 F3\nM2", "line 60 0 0 F3 | end"),
        case("gcode-1-39", "G21\nF60\nG93\nG94 G1 X5\nM2", "there is no feed yet"),
        case(
            "gcode-1-40",
            "G21\nF60\nG98 G0 Z5\nG81 X1 Z-3 R1\nM2",
            "rapid 0 0 5 | rapid 1 0 5 | rapid 1 0 1 | line 1 0 -3 F1 | rapid 1 0 5 | end",
        ),
        case(
            "gcode-1-41",
            "G21\nF60\nG99 G0 Z5\nG81 X1 Z-3 R1\nM2",
            "rapid 0 0 5 | rapid 1 0 5 | rapid 1 0 1 | line 1 0 -3 F1 | rapid 1 0 1 | end",
        ),
        case("gcode-1-42", "G21\nF60\nM0 G0 X5\nM2", "rapid 5 0 0 | stop | end"),
        case("gcode-1-43", "G21\nF60\nM1\nM2", "stop optional | end"),
        case("gcode-1-44", "G21\nF60\nM2\nnonsense", "end"),
        case("gcode-1-45", "G21\nF60\nM30\nnonsense", "end"),
        case("gcode-1-46", "G21\nF60\nS100 M3\nM2", "spindle cw 100 | end"),
        case("gcode-1-47", "G21\nF60\nS100 M4\nM2", "spindle ccw 100 | end"),
        case("gcode-1-48", "G21\nF60\nM3 S100\nM5\nM2", "spindle cw 100 | spindle off | end"),
        case("gcode-1-49", "G21\nF60\nM3 S9\nT5\nM6\nM2", "spindle cw 9 | spindle off | tool 5 | end"),
        case("gcode-1-50", "G21\nF60\nM7\nM2", "coolant 2 on | end"),
        case("gcode-1-51", "G21\nF60\nM8\nM2", "coolant 1 on | end"),
        case("gcode-1-52", "G21\nF60\nM9\nM2", "coolant 1 off | coolant 2 off | end"),
        case("gcode-1-53", "G21\nF60\nM48\nM49\nM50 P1\nM51\nM52 P0\nM53 P0\nM2", "end"),
        *(
            case("gcode-1-54", f"G21\nF60\n{code} G0 X0\nM2", f"rapid {number} 0 0 | end")
            for number, code in enumerate(("G56", "G57", "G58", "G59", "G59.1", "G59.2", "G59.3"), 3)
        ),
        case("gcode-1-55", "G21\nF60\nG8 G97\nG0 X1\nM2", "rapid 1 0 0 | end"),
        case("gcode-1-56", "G70\nF60\nG1 X1\nM2", "line 1, column 1: G70 is not of this dialect"),
        case("gcode-1-56", "G71\nF60\nG1 X1\nM2", "line 1, column 1: G71 is not of this dialect"),
        case("gcode-2-1", "g 2 1\n g 0 x 1 . 5\nM2", "rapid 1.5 0 0 | end"),
        case("gcode-2-2", "G21\nG0 X+2. Y-.5\nX1e3\nM2", "1e3 has an exponent"),
        case("gcode-2-3", "G21 (mm) G0 X1 (there) Y2 ; done\nM2", "rapid 1 2 0 | end"),
        case("gcode-2-4", "G21\n(MSG,wait here)\nM2", "remark wait here | end"),
        case("gcode-2-5", "G21\nG0 X1 X2\nM2", "X is there twice in one line"),
        case("gcode-2-6", "G21\nG0 G1 X2\nM2", "G0 and G1 exclude each other in one line"),
        case("gcode-2-7", "G21\n/G0 X1\nM2", "rapid 1 0 0 | end"),
        case("gcode-2-8", "N30 G21\nN10.5 G0 X1\nX1 N20\nM2", "N stands at the beginning of a line only"),
        case("gcode-2-9", "%\nG21\nG0 X1\n%\nnonsense", "rapid 1 0 0 | end"),
        case("gcode-2-10", "G21\nG0 X1\n", "the file ends without % or M2"),
        case("gcode-2-11", "G21\nO100 (NAME)\nM2", "end"),
        case("gcode-2-12", "G21\nG0 X1\nG1 X1 P5\nM2", "no code of this line takes P"),
        case("gcode-2-13", "G21\nX5\nM2", "no motion takes X"),
        case("gcode-2-14", "G20\nF60\nG1 X1\nG21\nG1 Y1\nM2", "line 25.4 0 0 F25.4 | line 25.4 1 0 F25.4 | end"),
        case("gcode-2-15", "G21\nF60\nG93 G1 X1 F1\nX2\nM2", "in G93 each line of G1, G2 and G3 wants F"),
        case("gcode-2-16", "G21\nF60\nS-5\nM2", "S must not be negative"),
        case(
            "gcode-3-1",
            "G21\nF60\nG2 X10 R10\nG2 X0 R-10\nM2",
            "arc 10 0 0 about 5 -8.6603 cw F1 | arc 0 0 0 about 5 -8.6603 cw F1 | end",
        ),
        case("gcode-3-2", "G21\nF60\nG2 I5\nM2", "arc 0 0 0 about 5 0 cw F1 | end"),
        case("gcode-3-3", "G21\nF60\nG2 X0 R5\nM2", "an arc by R cannot end at its start"),
        case("gcode-3-4", "G21\nF60\nG3 I5 Z-2 P3\nM2", "arc 0 0 -2 about 5 0 ccw x3 F1 | end"),
        case("gcode-3-5", "G21\nF60\nG2 X10 I5 Z-2\nM2", "arc 10 0 -2 about 5 0 cw F1 | end"),
        case("gcode-3-6", "G21\nF60\nG2 X10.02 I5\nM2", "arc 10.02 0 0 about 5 0 cw F1 | end"),
        case("gcode-3-7", "G21\nF60\nG2 X10.06 I5\nM2", "differ by 0.0600 mm with I J as offsets (5.0000 and 5.0600)"),
        case("gcode-3-8", "G21\nF60\nG2 X10 R4.9988\nM2", "arc 10 0 0 about 5 0 cw F1 | end"),
        case("gcode-3-8", "G21\nF60\nG2 X10 R4.9986\nM2", "R"),
        case("gcode-3-9", "G21\nF60\nG2 X10\nM2", "an arc wants its centre I J K, or its radius R"),
        case("gcode-3-10", "G21\nF60\nG2 X10 I5 R5\nM2", "an arc has R or I J K, not both"),
        case("gcode-3-11", "G21\nF60\nG2 X10 I5 K0\nM2", "K is not of this plane"),
        case("gcode-4-1", "G21\nF60\nG53 G2 X1 I1\nM2", "G53 goes with G0 or G1 only"),
        case("gcode-4-2", "G21\nF60\nG91\nG53 G0 X1\nM2", "G53 cannot be used with G91"),
        case("gcode-4-3", "G21\nF60\nG92 G0 X1\nM2", "G0 and G92 both take X Y Z"),
        case("gcode-5-1", "G21\nF60\nG81 X1 Z-2 R1\nG82 X2 P1\nM2", "G82 wants R"),
        case(
            "gcode-5-2",
            "G21\nF60\nG81 X1 Z-2 R0\nX2\nM2",
            "rapid 1 0 0 | line 1 0 -2 F1 | rapid 1 0 0 | rapid 2 0 0 | line 2 0 -2 F1 | rapid 2 0 0 | end",
        ),
        case(
            "gcode-5-3",
            "G21\nF60\nG91 G81 X1 Z-2 R0 L2\nM2",
            "rapid 1 0 0 | line 1 0 -2 F1 | rapid 1 0 0 | rapid 2 0 0 | line 2 0 -2 F1 | rapid 2 0 0 | end",
        ),
        case("gcode-5-5", "G21\nF60\nG81 X1 Z-2 R1 P1\nM2", "P is not of G81"),
        case("gcode-5-5", "G21\nF60\nG83 X1 Z-2 R1 Q1 P1\nM2", "P is not of G83"),
        case("gcode-5-5", "G21\nF60\nG82 X1 Z-2 R1 Q1 P1\nM2", "Q is not of G82"),
        case("gcode-5-4", "G21\nF60\nG81 X1 Z-2 R-3\nM2", "R -3 is below Z -2"),
        case(
            "gcode-6-1",
            "G21\nF60\nG1 X2 M9 M3 S5\nM2",
            "spindle cw 5 | coolant 1 off | coolant 2 off | line 2 0 0 F1 | end",
        ),
        case("gcode-6-2", "G21\nF60\nM3 S5\nS6\nM2", "spindle cw 5 | spindle cw 6 | end"),
        *(
            case("gcode-6-5", f"G21\nF60\n{code} P3\nM2", f"output P3 1={value} | end")
            for code, value in (("M62", 1), ("M63", 0), ("M64", 1), ("M65", 0))
        ),
        case("gcode-6-5", "G21\nF60\nM64 P1.5\nM2", "M64 wants P, the number of an output"),
        case("gcode-6-5", "G21\nF60\nM62\nM2", "M62 wants P, the number of an output"),
        case("gcode-6-3", "G21\nF60\nM7 M8\nM2", "M7 and M8 exclude each other in one line"),
        case("gcode-6-4", "G21\nF60\nG59.4\nM2", "G59.4 is unknown"),
    ],
)
def test_code(program: str, verdict: str) -> None:
    settings = ELSEWHERE if "WPCLEAR" in program or "WPREG2" in program or "G53" in program else SETTINGS
    if verdict.endswith("end"):
        assert told("gcode", program, settings) == verdict.split(" | ")
    else:
        with pytest.raises(CamError) as caught:
            told("gcode", program, settings)
        assert verdict in str(caught.value)


def refused(row: str, codes: str) -> list[Any]:
    return [case(row, code, code) for code in codes.split()]


@pytest.mark.parametrize(
    ("word", "named"),
    [
        *refused("gcode-7-1", "G41 G42 G41.1 G42.1"),
        *refused("gcode-7-2", "G33 G33.1 G76 G84"),
        *refused("gcode-7-3", "G86 G87 G88"),
        *refused("gcode-7-4", "G38.2 G38.3 G38.4 G38.5"),
        *refused("gcode-7-5", "G5 G5.1 G5.2 G5.3"),
        *refused("gcode-7-6", "G17.1 G18.1 G19.1"),
        *refused("gcode-7-7", "G43.1 G43.2"),
        *refused("gcode-7-8", "G7 G71.1 G71.2 G72 G72.1 G72.2 G95 G96"),
        *refused("gcode-7-9", "M19 M60 M61"),
        *refused("gcode-7-10", "M66 M67 M68"),
        *refused("gcode-7-11", "M70 M71 M72 M73"),
        *refused("gcode-7-12", "M98 M99"),
        *refused("gcode-7-13", "M100 M101 M150 M199"),
    ],
)
def test_code_is_refused(word: str, named: str) -> None:
    """As the second word of its line, so that the place is its own."""
    with pytest.raises(CamError, match=rf"^line 3, column 6: {re.escape(named)} is refused: "):
        told("gcode", f"G21\nF60\nS100 {word}\nM2", SETTINGS)


@pytest.mark.parametrize(
    ("line", "error"),
    [
        case("gcode-7-12", "O100 sub", "column 1: O sub is a subprogram"),
        case("gcode-7-12", "O<bore> call [1]", "column 1: "),
        *(case("gcode-7-14", f"G1 X1 {axis}2", f"column 7: this machine has no axis {axis}") for axis in "ABCUVW"),
        case("gcode-7-15", "G1 X#1", "column 4: parameters # and expressions"),
        case("gcode-7-15", "#5=[1+2]", "column 1: parameters # and expressions"),
        case("gcode-7-15", "G1 X[2*3]", "column 4: parameters # and expressions"),
        case("gcode-7-2", "G74", "column 1: G74 is tapping"),
        case("gcode-7-16", "G1 @10 ^45", "column 4: '@' is no word of G-code"),
        case("gcode-7-16", "G1 X1 E5", "column 7: E is no word of G-code here"),
        case("gcode-7-16", "G1 X1 D5", "column 7: no code of this line takes D"),
    ],
)
def test_word_is_refused(line: str, error: str) -> None:
    with pytest.raises(CamError, match=f"^line 3, {re.escape(error)}"):
        told("gcode", f"G21\nF60\n{line}\nM2", SETTINGS)


@pytest.mark.parametrize(
    "words",
    [
        case("gcode-1-7", "G17 G2 X5 Y5 I5"),  # from +Z, X to the right, Y up: from nine o'clock to twelve
        case("gcode-1-8", "G18 G2 Z-5 X5 I5"),  # from +Y, Z to the right, X up: from six to nine
        case("gcode-1-9", "G19 G3 Y4 Z4 K4"),  # from +X, Y to the right, Z up: from six to three
    ],
)
def test_the_sense_of_arcs_is_seen_from_the_positive_axis(words: str) -> None:
    """Each is a quarter; the other way round it would be three."""
    (arc, *_) = reader_named("gcode").read(["G21", "F60", words, "M2"], SETTINGS)
    assert isinstance(arc, Arc)
    radius = 4.0 if "G19" in words else 5.0
    assert length(arc, (0.0, 0.0, 0.0)) == pytest.approx(math.pi / 2 * radius)
