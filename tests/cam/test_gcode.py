"""G-code: ten programs with the canonical moves that LinuxCNC's rs274 makes of them, as points of the machine; what is
refused; what CAM programs write."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.cam.gcode import create
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError
from tests.cam.short import UP, cautions, told

STRICT = dataclasses.replace(UP, strict=True, zeros={n: (0.0, 0.0, 0.0) for n in range(1, 10)})
SQUARE = """%
(square, relative and absolute)
N10 G21 G17 G90 G94
N20 G0 Z5
N30 G0 X10 Y10
N40 G1 Z-1 F120
N50 G91 X20 F600
N60 Y20
N70 X-20
N80 Y-20
N90 G90 G0 Z5
N100 M2
%
"""
ARCS = "G21 G90\nG0 X10 Y0\nF300\nG3 X0 Y10 I-10 J0\nG2 X-10 Y0 R-10\nG3 X-10 Y0 I10\nG2 X-10 Y0 Z-6 I10 P3\nM2\n"
INCHES = "G20 G90\nG0 X1 Y.5\nG1 X2.5 F12\nG21\nG1 X25.4\nG0 X0 Y0\nM30\n"
HOLES = """G21 G90 G98
T1 M6
S10000 M3
G0 Z10
G81 X5 Y5 Z-2 R1 F150
X15
G99 X25
G82 Y15 Z-2 R1 P0.25
G80 M5
M2
"""
PECKS = "G21 G90 G98\nG0 X0 Y0 Z3\nG83 X2 Y3 Z-4 R0.5 Q2 F90\nG73 X8 Z-3 R0.5 Q2\nG80\nM2\n"
OFFSETS = """G21 G90 G54
G0 X100 Y50 Z20
G92 X0 Y0 Z0
G1 X10 F200
G53 G0 Z40
G92.1
G10 L2 P2 X5 Y5 Z0
G55 G0 X0 Y0
M2
"""
PLANES = """G21 G90
G18
G0 X0 Z0
G2 X10 Z0 I5 K0 F240
G19
G0 Y0 Z0
G3 Y0 Z8 K4
G17
G90.1
G2 X20 Y0 I15 J0
G91.1
M2
"""
INVERSE = """G21
G64 P0.02
G93 G1 X60 F3
X0 F6
G94 F300
G4 P0.5
G61 X10
/X99
M8
M0
M9
M30
"""
FREE = "g21g90g0x1y-.5\n  G 01 x +2. 5 f 60 ; spaced\nn30.1y1\n(MSG,change cutter)\nM2\n"

PROGRAMS = {
    SQUARE: "rapid 0 0 5 | rapid 10 10 5 | line 10 10 -1 F2 | line 30 10 -1 F10 | line 30 30 -1 F10 | "
    "line 10 30 -1 F10 | line 10 10 -1 F10 | rapid 10 10 5 | end",
    ARCS: "rapid 10 0 0 | arc 0 10 0 about 0 0 ccw F5 | arc -10 0 0 about 0 0 cw F5 | arc -10 0 0 about 0 0 ccw F5 | "
    "arc -10 0 -6 about 0 0 cw x3 F5 | end",
    INCHES: "rapid 25.4 12.7 0 | line 63.5 12.7 0 F5.08 | line 25.4 12.7 0 F5.08 | rapid 0 0 0 | end",
    HOLES: "tool 1 | spindle cw 10000 | rapid 0 0 10 | rapid 5 5 10 | rapid 5 5 1 | line 5 5 -2 F2.5 | rapid 5 5 10 | "
    "rapid 15 5 10 | rapid 15 5 1 | line 15 5 -2 F2.5 | rapid 15 5 10 | rapid 25 5 10 | rapid 25 5 1 | "
    "line 25 5 -2 F2.5 | rapid 25 5 1 | rapid 25 15 1 | line 25 15 -2 F2.5 | dwell 0.25 | "
    "rapid 25 15 1 | spindle off | end",
    PECKS: "rapid 0 0 3 | rapid 2 3 3 | rapid 2 3 0.5 | line 2 3 -1.5 F1.5 | rapid 2 3 0.5 | rapid 2 3 -1.246 | "
    "line 2 3 -3.5 F1.5 | rapid 2 3 0.5 | rapid 2 3 -3.246 | line 2 3 -4 F1.5 | rapid 2 3 3 | rapid 8 3 3 | "
    "rapid 8 3 0.5 | line 8 3 -1.5 F1.5 | rapid 8 3 -1.246 | line 8 3 -3 F1.5 | rapid 8 3 3 | end",
    OFFSETS: "rapid 100 50 20 | line 110 50 20 F3.3333 | rapid 110 50 40 | rapid 5 5 40 | end",
    PLANES: "rapid 0 0 0 | arc 10 0 0 about 5 0 XZ cw F4 | rapid 10 0 0 | arc 10 0 8 about 0 4 YZ ccw F4 | "
    "arc 20 0 8 about 15 0 cw F4 | caution | end",
    INVERSE: "joined 0.02 | line 60 0 0 F3 | line 0 0 0 F6 | dwell 0.5 | exact | line 10 0 0 F5 | line 99 0 0 F5 | "
    "coolant 1 on | stop | coolant 1 off | coolant 2 off | end",
    FREE: "rapid 1 -0.5 0 | line 2.5 -0.5 0 F1 | line 2.5 1 0 F1 | remark change cutter | end",
}


@pytest.mark.parametrize("strict", [False, True])
@pytest.mark.parametrize("text", PROGRAMS)
def test_canonical_moves(text: str, strict: bool) -> None:
    settings = STRICT if strict else UP
    assert told("gcode", text, settings) == PROGRAMS[text].split(" | ")


def test_an_arc_with_two_radii_is_refused_with_both() -> None:
    with pytest.raises(CamError) as caught:
        told("gcode", "G21 G90\nG0 X10\nG1 X10 F100\nG2 X20.05 Y0 I5\nM2\n")
    assert str(caught.value) == (
        "line 4, column 1: the radii to start and end of the arc differ by 0.0500 mm with I J as offsets (5.0000 and "
        "5.0500), by 10.0500 mm as absolute (5.0000 and 15.0500)"
    )


def test_block_delete_leaves_lines_out() -> None:
    settings = dataclasses.replace(UP, block_delete=True)
    assert "line 99 0 0 F5" not in told("gcode", INVERSE, settings)


BODY = "G21\nG0 X0\nF100\n"


@pytest.mark.parametrize(
    ("line", "error"),
    [
        ("X1 X2", "column 4: X is there twice in one line"),
        ("X1 N20", "column 4: N stands at the beginning of a line only"),
        (":1234", "column 1: ':' is no word of G-code"),
        ("X1e3", "column 1: X: 1e3 has an exponent; write 1000"),
        ("X1,5", "column 1: X: 1,5 has a comma; write 1.5"),
        ("X1.2.3", "column 1: 'X1.2.3' is not a number"),
        ("G1 X", "column 4: X has no number behind it"),
        ("U5", "column 1: this machine has no axis U"),
        ("G1 X1 A5", "column 7: this machine has no axis A"),
        ("G1 X1 A0.", "column 7: this machine has no axis A; leave A0 out"),
        ("G5.7", "column 1: G5.7 is unknown here: what it does is not made"),
        ("G17 G18", "column 5: G17 and G18 exclude each other in one line"),
        ("G0 G1 X1", "column 4: G0 and G1 exclude each other in one line"),
        ("M7 M8", "column 4: M7 and M8 exclude each other in one line"),
        ("M3 M5", "column 4: M3 and M5 exclude each other in one line"),
        ("G1 X1 I2", "column 7: no code of this line takes I: G1 holds here"),
        ("G1 X1 R2", "column 7: no code of this line takes R: G1 holds here"),
        ("H1", "column 1: no code of this line takes H"),
        ("P5", "column 1: no code of this line takes P"),
        ("F-3", "column 1: F must not be negative"),
        ("X1 F-3", "column 4: F must not be negative"),
        ("S-1", "column 1: S must not be negative"),
        ("T-1", "column 1: T must be a whole number, 0 or more"),
        ("G80 X5", "column 5: no motion takes X: none has come yet, or G80 has ended it"),
        ("G28 G0 X5", "column 1: G0 and G28 both take X Y Z; write G0 in a line of its own before it"),
        ("G53 G2 X5 I2", "column 1: G53 goes with G0 or G1 only"),
        (
            "G91 G53 G0 X5",
            "column 1: G53 cannot be used with G91; write G90 in its line, and G91 again in the next one",
        ),
        ("G4", "column 1: G4 wants P, seconds of 0 or more"),
        ("G52", "column 1: G52 wants X, Y or Z"),
        ("G92", "column 1: G92 wants X, Y or Z"),
        ("G2 X5", "column 1: an arc wants its centre I J K, or its radius R"),
        ("G2 X5 I2 R5", "column 1: an arc has R or I J K, not both"),
        ("G2 R5", "column 1: an arc by R cannot end at its start: a full circle wants its centre I J K"),
        ("G2 X10 R4.9", "column 1: R of 4.9 mm is too small to reach the end, which is 10.0000 mm away"),
        ("G2 X10 I5 K1", "column 1: K is not of this plane"),
        ("G2 I5 P1.5", "column 7: P of an arc must be a whole number, 1 or more"),
        ("G90.1 G2 X10 I5", "column 1: with G90.1 an arc wants both I and J"),
        ("G2 I0 J0", "column 1: an arc without radius: start or end is its centre"),
        ("G81 X5 Z-2 R-3", "column 1: R -3 is below Z -2; a hole goes down from R"),
        ("G81 X5 Z-2", "column 1: G81 wants R; write it where G81 begins"),
        ("G83 X5 Z-2 R1", "column 1: G83 wants Q of more than 0, the depth of a peck"),
        ("G73 X5 Z-2 R1", "column 1: G73 wants Q of more than 0, the depth of a peck"),
        ("G83 X5 Z-2 R1 Q0.0001", "column 1: more than 10000 pecks; write a larger Q"),
        ("G82 X5 Z-2 R1", "column 1: G82 wants P, its dwell in seconds"),
        ("G89 X5 Z-2 R1", "column 1: G89 wants P, its dwell in seconds"),
        ("G73 X5 Z-2 R1 Q0.0001", "column 1: more than 10000 pecks; write a larger Q"),
        ("G81 X5 Z-2 R1 L0", "column 15: L must be a whole number 1 .. 10000"),
        ("G93 G1 X5", "column 1: in G93 each line of G1, G2 and G3 wants F"),
        ("G10 L2 P11 X0", "column 8: G10 wants P 0 .. 9, the number of the system"),
        ("G10 L1 P1 Z5", "column 5: G10 wants L2 or L20; tables of tools are in tool_length_mm"),
        ("G55", "column 1: G55 is not known; set zeros.2 = [x, y, z], or G10 L2 P2 before"),
        ("G41 D1", "column 1: G41 is refused: cutter compensation is not made; let the CAM program offset the path"),
        (
            "G84 X1",
            "column 1: G84 is refused: it needs a spindle that the axis follows; drill with G81 and tap by hand",
        ),
        ("G38.2 Z-5", "column 1: G38.2 is refused: probing is not made: nothing is there to be touched"),
        ("M98 P100", "column 1: M98 is refused: subprograms are not read; let the CAM program write them out"),
        ("#1=5", "column 1: parameters # and expressions [ ] are not read; let the CAM program write numbers"),
        ("X[1+2]", "column 1: parameters # and expressions [ ] are not read; let the CAM program write numbers"),
        ("O100 sub", "column 1: O sub is a subprogram, a branch or a loop: these are not read; let the CAM program"),
    ],
)
def test_errors_name_the_place_and_the_remedy(line: str, error: str) -> None:
    with pytest.raises(CamError) as caught:
        told("gcode", f"{BODY}{line}\nM2\n")
    assert str(caught.value).startswith(f"line 4, {error}")
    assert "\n" not in str(caught.value)


def test_r_counts_from_where_the_series_began_in_g91() -> None:
    """From Z5, which is not where the program counts from; Z counts from R."""
    assert told("gcode", "G21 G90 F60\nG0 Z5\nG91 G81 X1 Z-3 R-2\nM2\n", UP)[1:-1] == [
        *("rapid 1 0 5", "rapid 1 0 3", "line 1 0 0 F1", "rapid 1 0 5"),
    ]


def test_s_of_a_dwell_is_its_seconds_unless_p_is() -> None:
    assert told("gcode", "G21\nS100 M3\nG4 S2\nM2\n", UP) == ["spindle cw 100", "dwell 2", "end"]
    assert told("gcode", "G21\nM3\nG4 P2 S100\nM2\n", UP)[-3:] == ["spindle cw 100", "dwell 2", "end"]


def test_a_depth_of_whole_pecks_has_no_peck_more() -> None:
    """0.1 three times is a little more than 0.3 in binary numbers; a dwell of no time is one."""
    made = told("gcode", "G21 G90 F60\nG0 Z1\nG83 X0 Z-0.3 R0 Q0.1\nG82 X1 Z-1 R0 P0\nM2\n", UP)
    assert [each for each in made if each.startswith("line 0")] == [f"line 0 0 -0.{k} F1" for k in (1, 2, 3)]
    assert made.count("dwell 0") == 1


@pytest.mark.parametrize(
    ("text", "caution", "error"),
    [
        ("G21\nG0 X1\n", "the file ends without M2, M30 or %; it may be cut off", "the file ends without % or M2"),
        ("%prog1\nG21\nG0 X1\n%", None, "nothing may stand behind %"),
        ("G21\nG0 X1\n%", "a % ends the file that had none at its beginning", "% stands in the first line"),
        ("G21\nF500 G2 X1 R1 K0\nM2", None, "K is not of this plane; leave it out"),
        ("G21 G71\nM2", None, "G21 and G71 exclude each other"),
        ("G71\nG0 X1\nM2", "G71 is read as mm", "G71 is not of this dialect; write G21"),
        ("G4 S1\nM2", None, "G4 wants P, seconds of 0 or more"),
        ("(a (b) c)\nM2", "a remark in a remark: it goes to the last bracket of its line", "a remark in a remark"),
        ("(a\nM2", "a remark that is not closed goes to the end of its line", "the remark is not closed"),
        (f"G0 {' ' * 260}\nM2", None, "a line has at most 255 characters"),
        ("G0 X1\nM2", "there is no G20 or G21: numbers are read as mm", None),
        ("G4 P61\nM2", "G4 waits 61 s: P is in seconds; ms were meant?", None),
        ("G43 H3\nM2", "the length of tool 3 is taken as 0: it is not in tool_length_mm", None),
    ],
)
def test_habits_are_read_and_refused_only_when_strict(text: str, caution: str | None, error: str | None) -> None:
    if "exclude" not in (error or ""):
        assert cautions("gcode", text) == ([] if caution is None else [caution])
    if error is not None:
        with pytest.raises(CamError, match=error):
            told("gcode", text, STRICT)


PRODUCERS = {
    "Fusion": "%\n(1001)\n(T1 D=3)\nN10 G90 G94\nN15 G17\nN20 G21\nN25 G28 G91 Z0\nN30 G90\nN35 S5000 M3\nN40 G54\n"
    "N45 G0 X-0.7 Y27.\nN50 Z15.\nN55 G1 Z-1 F333.\nN60 G18 G3 X0.3 Z-2. I1. K0 F100\nN62 G1 X5.\n"
    "N65 G17 G2 X7 Y27 I1 J0 Z-1.5\nM30\n%\n",
    "FreeCAD linuxcnc": "(Exported by FreeCAD)\nG17 G54 G40 G49 G80 G90\nG21\n(Begin)\nM5\n M6 T1\nG43 H1\nM3 S1000\n"
    "G0 Z5.000\nG98\nG81 X1 Y1 Z-2 R1 F100\nG81 X2 Y1 Z-2 R1 F100\nG80\nG2 X3 Y2 I0 J1 K0 F50\nM2\n",
    "pcb2gcode": "( pcb2gcode )\nG94\nG20\nG90\nG00 S12000\nG64 P0.002\nG00 Z0.5\nT1\nM5\nG04 P1\nM6\nM0\nM3\nG04 P1\n"
    "G81 R0.02 Z-0.1 F10 X0.1 Y0.2\nX0.3 Y0.2\nG80\nM9\nM2\n",
    "pcb-gcode": "G20 G90 G64 G40  \nG0 Z0.1 \nT01 M06 \nG01 X1.0 Y0 F10 \nM30 \n",
    "FlatCAM": "(ISEL CNC router)\nG71\nG90\nG94\nG01 F120.00\nG00 Z2\nM03 S1000\nG00 X1.0 Y1.0\nG01 Z-0.1\n"
    "G01 X2 Y1\nM05\n",
    "Inkscape": "%\n(Header)\nM3\n(Header end.)\nG21 (All units in mm)\nG00 Z5.000000\nG00 X1 Y1\nG01 Z-0.125 F100.0\n"
    "G02 X2 Y2 Z-0.125000 I1.000000 J0.000000\nM5\nM2\n%\n",
    "marlin": "G21\nG90\nG4 S1\nG0 X1\nG1 X2 F100\nM2\n",
    "uccnc": "%prog1\nG17 G21 G90\nG0 X1 Y1\nG3 X3 Y1 I1 J0 K0 F100\nM30\n",
}


@pytest.mark.parametrize("producer", PRODUCERS)
def test_what_producers_write_is_read(producer: str) -> None:
    path = told("gcode", PRODUCERS[producer])
    assert path[-1] == "end"
    assert sum(move.startswith(("line", "arc")) for move in path) >= 1


HALF_ABSOLUTE, HALF_OFFSET = "G2 X-10 Y0 I0 J0", "G3 X0 Y0 I-5 J0"  # from X10


def test_two_readings_of_centres_under_g71() -> None:
    start = "G71 G90\nG0 X10 Y0\nF60\n"
    assert "arc -10 0 0 about 0 0 cw F1" in told("gcode", f"{start}{HALF_ABSOLUTE}\nM2")
    said = cautions("gcode", f"{start}{HALF_ABSOLUTE}\nM2")[1]
    assert said == "I J K are read as absolute: only so the radii are equal"
    assert "arc 0 0 0 about 5 0 ccw F1" in told("gcode", f"{start}{HALF_OFFSET}\nM2")
    with pytest.raises(CamError, match=r"differ by 0.8310 mm with I J as offsets .*, by 9.1690 mm as absolute"):
        told("gcode", f"{start}G3 X0 Y3 I-5 J0\nM2")
    with pytest.raises(CamError, match=r"I J may be offsets or absolute; write G91.1 or G90.1 before it"):
        told("gcode", "G71 G90\nG0 X0 Y10\nF60\nG2 X10 Y10 I5 J0\nM2")


@pytest.mark.parametrize("dialect", ["", "rs274", "din"])
@pytest.mark.parametrize("unit", ["G71", "G21"])
@pytest.mark.parametrize("order", ["G90 {unit} {code}", "{code} G90\n{unit}", "{unit}\nG91 {code}\nG90"])
def test_an_explicit_code_of_centres_wins(dialect: str, unit: str, order: str) -> None:
    """Beside every unit and distance, in each dialect: what the other reading would fit is refused."""
    if (dialect, unit) == ("rs274", "G71"):
        unit = "G21"
    settings = dataclasses.replace(UP, dialect=dialect)
    for code, fits, other in (("G90.1", HALF_ABSOLUTE, HALF_OFFSET), ("G91.1", HALF_OFFSET, HALF_ABSOLUTE)):
        head = f"{order.format(unit=unit, code=code)}\nG0 X10 Y0\nF60\n"
        assert not [text for text in cautions("gcode", f"{head}{fits}\nM2", settings) if "I J K" in text]
        meant = "write G91.1 before it" if code == "G90.1" else "write G90.1 before it"
        with pytest.raises(CamError, match=rf"differ by .* offsets .* as absolute .*; if they are .*, {meant}"):
            told("gcode", f"{head}{other}\nM2", settings)


def test_arcs_in_inch_have_the_tolerance_of_linuxcnc_in_inch() -> None:
    """2 x 0.001 x sqrt 2 inch, as rs274 has it: of r = 1 inch an end 0.0028 off is taken, 0.0029 is not."""
    start = "G20 G90 F60\nG0 X0 Y0\nG2 X{} Y0 I1 J0{}\nM2\n"
    for more in ("", " K0"):  # a plain arc, and one by a block
        assert told("gcode", start.format("2.0028", more))[1].startswith("arc 50.8711 0 0 about 25.4 0 cw")
        with pytest.raises(CamError, match=r"differ by 0.0029 inch with I J as offsets"):
            told("gcode", start.format("2.0029", more))


def test_g80_beside_a_motion_says_nothing() -> None:
    """As in LinuxCNC 2.9, before and behind any motion; of a series of holes nothing ends."""
    for line in ("G80 G0 X1", "G0 G80 X1", "G80 G0 G80 X1"):
        assert told("gcode", f"G21\n{line}\nM2", STRICT) == ["rapid 1 0 0", "end"]
    ended = told("gcode", "G21\nG81 X1 Y0 Z-1 R1 F60\nG0 G80 X5\nX7\nM2", STRICT)
    assert ended[-3:-1] == ["rapid 5 0 1", "rapid 7 0 1"]
    holes = told("gcode", "G21 F60\nG80 G81 X1 Z-1 R1\nG81 G80 X2\nM2", STRICT)
    assert [each for each in holes if each.startswith("line")] == ["line 1 0 -1 F1", "line 2 0 -1 F1"]
    with pytest.raises(CamError, match="no motion takes X"):
        told("gcode", "G21\nG80 G80 X1\nM2", STRICT)


def test_a_system_is_not_turned() -> None:
    assert told("gcode", "G21\nG10 L2 P1 X5 R0\nG0 X1\nM2", STRICT) == ["rapid 6 0 0", "end"]
    for line in ("G10 L2 P1 R30", "G10 L20 P1 X0 R0"):
        with pytest.raises(CamError, match=r"^line 2, column \d+: R of G10 turns the coordinates: a rotation"):
            told("gcode", f"G21\n{line}\nM2")


def test_cycles_in_three_planes() -> None:
    """Along Y in G18, along X in G19, as rs274 makes them."""
    head = "G21 F60 G98\nG0 X1 Y10 Z2\n"
    assert told("gcode", f"{head}G18 G81 X3 Z4 Y-1 R2\nX5\nM2", STRICT)[1:-1] == [
        *("rapid 3 10 4", "rapid 3 2 4", "line 3 -1 4 F1", "rapid 3 10 4"),
        *("rapid 5 10 4", "rapid 5 2 4", "line 5 -1 4 F1", "rapid 5 10 4"),
    ]
    assert told("gcode", f"{head}G19 G83 Y3 X-4 R0 Q3\nM2", STRICT)[1:-1] == [
        *("rapid 1 3 2", "rapid 0 3 2", "line -3 3 2 F1", "rapid 0 3 2", "rapid -2.746 3 2", "line -4 3 2 F1"),
        "rapid 1 3 2",
    ]
    with pytest.raises(CamError, match="G81 wants Y; write it where G81 begins"):
        told("gcode", f"{head}G18 G81 X3 Z4 R2\nM2")


SERIES = {  # second line of a series that began at Z 10 with R 2 and Z -1, by G99: what is said, what is made
    "G98 X2": ("G98 follows G99: the tool goes across at the R", ["rapid 2 0 2", "line 2 0 -1 F1", "rapid 2 0 10"]),
    "X2 R5": ("R rises: the tool is lifted before", ["rapid 1 0 5", "rapid 2 0 5", "line 2 0 -1 F1", "rapid 2 0 5"]),
    "G20 X1": ("the unit changes: R, depth and Q stay", ["rapid 25.4 0 2", "line 25.4 0 -1 F1", "rapid 25.4 0 2"]),
    "G18 X2 Y-1 R1": ("the plane changes: a new series begins", ["rapid 1 1 2", "rapid 2 1 2", "line 2 -1 2 F1"]),
    "X2": (None, ["rapid 2 0 2", "line 2 0 -1 F1", "rapid 2 0 2"]),
}


@pytest.mark.parametrize("line", SERIES)
def test_a_series_of_holes_that_linuxcnc_makes_otherwise_is_told(line: str) -> None:
    said, made = SERIES[line]
    text = f"G21 G90 F60\nG0 Z10\nG99 G81 X1 Z-1 R2\n{line}\nM2"
    path = [each for each in told("gcode", text)[5:] if each != "caution"]
    assert path[: len(made)] == made
    assert [each.removeprefix("within a series of holes ")[: len(said or "")] for each in cautions("gcode", text)] == (
        [said] if said else []
    )


def test_r_that_falls_below_the_beginning_is_told() -> None:
    text = "G21 G90 F60\nG0 Z0\nG81 X1 Z-1 R5\nX2 R2\nM2"
    assert (
        told("gcode", text)[-5:]
        == ["caution", "rapid 2 0 5", "rapid 2 0 2", "line 2 0 -1 F1", "rapid 2 0 2", "end"][-5:]
    )
    assert "LinuxCNC lowers it before" in cautions("gcode", text)[0]


def test_a_feed_is_forgotten_where_its_mode_changes_and_only_there() -> None:
    """Of one over minutes nothing is left in G94; F before a G94 of the head stays (cam/29)."""
    for changed in ("G94\nF60\nG93\nG94", "F60\nG93\nG94"):
        with pytest.raises(CamError, match="there is no feed yet"):
            told("gcode", f"G21 G90\n{changed}\nG1 X5\nM2")
    assert told("gcode", "G21 G90 F60\nG94\nG1 X5\nM2")[0] == "line 5 0 0 F1"


def test_a_tool_below_r_is_lifted_where_it_stands() -> None:
    path = told("gcode", "G21 G90 F60\nG0 X3 Y5 Z0\nG81 X1 Y2 Z-3 R1\nM2")
    assert path[:4] == ["rapid 3 5 0", "rapid 3 5 1", "rapid 1 2 1", "line 1 2 -3 F1"]


def test_the_dialect_of_din() -> None:
    settings = dataclasses.replace(UP, dialect="din")
    text = "%1\nG71 G90\nM70\nG0 X10\nF60\nG2 X-10 Y0 I0 J0\nG4 F2\nG91 G1 X1\nM-70\nM30\n"
    assert told("gcode", text, settings) == [
        "output M70 1=1",
        "rapid 10 0 0",
        "arc -10 0 0 about 0 0 cw F1",
        "dwell 2",
        "line -9 0 0 F1",
        "output M70 1=0",
        "end",
    ]


def test_home_goes_up_first_unless_strict() -> None:
    text = "G21 G90 G54\nG0 X10 Y10\nG0 Z-10\nG28\nM2\n"
    assert told("gcode", text)[2:] == ["rapid 10 10 0", "rapid 0 0 0", "end"]
    assert told("gcode", text, STRICT)[2:] == ["rapid 0 0 0", "end"]


def test_the_zero_of_the_workpiece_and_lengths_of_tools() -> None:
    settings = dataclasses.replace(UP, zero=(100.0, 50.0, 20.0), tool_length_mm={2: 30.0}, z_sign=-1)
    text = "G21\nT2 M6 G43 H2\nG0 X1 Y2 Z3\nG53 G0 Z0\nG49\nG0 Z1\nM2\n"
    assert told("gcode", text, settings) == [
        "tool 2", "rapid 101 52 13", "rapid 101 52 0", "rapid 101 52 -19", "end"
    ]  # fmt: skip


def test_z_downwards_mirrors_points_cycles_and_senses() -> None:
    settings = dataclasses.replace(UP, file_z_up=False)
    text = "G21\nG0 Z-5\nG81 X1 Z2 R-1 F60\nG80\nG18 G2 X11 I5 K0\nM2\n"
    assert told("gcode", text, settings) == [
        "rapid 0 0 5",
        "rapid 1 0 5",
        "rapid 1 0 1",
        "line 1 0 -2 F1",
        "rapid 1 0 5",
        "arc 11 0 5 about 6 5 XZ ccw F1",
        "end",
    ]


@given(
    st.lists(
        st.tuples(
            st.sampled_from(["G2", "G03", "G1", "G0", ""]),
            *[st.one_of(st.none(), st.integers(-40, 40)) for _ in range(3)],
            st.sampled_from(["I10 J0", "I0 J-10", "I-7.5", "J5", "R10", "R-12.5", "R10 I0", "", "I10 J0 K0"]),
            st.sampled_from(["", "", "F900", "F0"]),
        ),
        max_size=12,
    ),
    st.sampled_from(["G21 G90 G17 F600", "G20 G90 F30", "G21 G91 F600", "G21 G18 F600", "G21 G90.1 F600", "G90 F600"]),
)
def test_a_line_is_read_alike_with_and_without_a_remark(rows: list[tuple[Any, ...]], head: str) -> None:
    """A line with a remark becomes a block; plain moves and arcs are matched as a whole."""
    lines = [head, "G0 X0 Y0 Z5"]
    for g, x, y, z, centre, feed in rows:
        words = [f"{letter}{value}" for letter, value in zip("XYZ", (x, y, z), strict=True) if value is not None]
        lines.append(" ".join(filter(None, [g, *words, centre if g not in ("G1", "G0") else "", feed])))

    def outcome(remark: str) -> list[Any]:
        found: list[Any] = []
        try:
            found.extend(create("gcode").read([f"{line}{remark}\n" for line in [*lines, "M2"]], CamSettings()))
        except CamError as error:
            found.append(str(error))
        return found

    assert outcome("") == outcome(" (a)")


@pytest.mark.parametrize(
    ("program", "said"),
    [
        ("T2\nG0 X1\nM30", ["T2 is selected, and no M6 of the file changes to it"]),
        ("T2\nG0 X1", ["the file ends without M2, M30 or %; it may be cut off", "T2 is selected, and no M6"]),
        ("T2 M6\nT3\nM30", []),  # the next one, made ready
        ("T2\nM6\nM30", []),
        ("F60\nG83 X1 Z-2 R1 Q1 P500\nX2 P500\nG80\nM30", ["P is not of G83: it is not used"]),
        ("F60\nG81 X1 Z-2 R1 Q0 P0\nG80\nM30", []),
        ("M52\nM30", ["M52: nothing adapts the feed here"]),
        ("M52 P0\nM51 P1\nG61\nG64 P0.1\nM30", []),
    ],
)
def test_words_that_nothing_uses_are_told(program: str, said: list[str]) -> None:
    found = cautions("gcode", f"G21 G90\n{program}\n")
    assert len(found) == len(said)
    assert all(text.startswith(begins) for text, begins in zip(found, said, strict=True))
