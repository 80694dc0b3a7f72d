"""NCP: five programs with the ends, lengths and times they must give; what its producers write; what is wrong."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.cam.ncp import Ncp
from isel_twin.cam.toolpath import CamError, Line, Rapid
from tests.cam.short import UP, cautions, seconds, told
from tests.thorough import drawn

LINES = """IMF_PBL_V1.0
N10 FASTVEL 40000
N20 VEL 10000
N30 PLANE XY
N40 FASTABS Z5000
N50 FASTABS X10000 Y20000
N60 MOVEABS Z-500
N70 MOVEABS X40000
N80 MOVEABS Y60000
N90 VEL 5000
N100 MOVEABS X10000 Y20000
N110 FASTABS Z5000
N120 PROGEND
"""
RINGS = """IMF_PBL ringe
; bogen, absolute mitte
FASTVEL 50000
VEL 8000
PLANE XY
FASTABS X30000 Y10000
MOVEABS Z-1000
CCWABS I20000 J10000 X20000 Y20000
CWABS I20000 J30000 X20000 Y40000
CCWABS I20000 J20000
FASTABS Z2000
PROGEND
"""
HOLES = """IMF_PBL_V1.0
FASTVEL 10000
DRILLDEF S2000
DRILLDEF V1000
DRILLDEF D1800
DRILLDEF C1 P0
GETTOOL 1
DRILL X005000 Y010000
DRILL X007540 Y010000
DRILLDEF D500 T250
GETTOOL 2
DRILL X-02000 Y000000
PROGEND
"""
RELATIVE = """IMF_PBL_V1.0
FASTVEL 20000
VEL 4000
FASTABS X5000 Y5000 Z0
MOVEREL X10000
MOVEREL X-2500 Y2500 Z-100
CWREL I0 J5000 X5000 Y5000
FASTREL Z2100
PROGEND
"""
OUTPUTS = """IMF_PBL_v1.0
;MATR: POM
FASTVEL 100000
VEL 6000
SPINDLE CW RPM12000 TIME2000
FASTABS X10000 Y0
WAIT 10
SETPORT A4=00000001
WAIT 500
MOVEABS Z-1000
CCWHLXABS I0 J0 W720 X10000 Y0 Z-3000
SETPORT A4=00000000
SPINDLE OFF
WPCLEAR
FASTABS Z0
FASTABS X0 Y0
PROGEND
"""


def times(text: str) -> list[tuple[float, float]]:
    return [(round(mm, 4), round(s, 4)) for mm, s in seconds(Ncp().read(text.splitlines(), UP))]


def test_lines_with_a_modal_speed() -> None:
    assert told("ncp", LINES) == [
        "rapid 0 0 5 F40",
        "rapid 10 20 5 F40",
        "line 10 20 -0.5 F10",
        "line 40 20 -0.5 F10",
        "line 40 60 -0.5 F10",
        "line 10 20 -0.5 F5",
        "rapid 10 20 5 F40",
        "end",
    ]
    assert times(LINES) == [(5, 0.125), (22.3607, 0.559), (5.5, 0.55), (30, 3), (40, 4), (50, 10), (5.5, 0.1375)]
    assert sum(s for _, s in seconds(Ncp().read(LINES.splitlines(), UP))) == pytest.approx(18.3715, abs=5e-5)


def test_arcs_with_absolute_centres() -> None:
    assert told("ncp", RINGS) == [
        "remark ringe",
        "rapid 30 10 0 F50",
        "line 30 10 -1 F8",
        "arc 20 20 -1 about 20 10 ccw F8",
        "arc 20 40 -1 about 20 30 cw F8",
        "arc 20 40 -1 about 20 20 ccw F8",
        "rapid 20 40 2 F50",
        "end",
    ]
    assert times(RINGS) == [
        (31.6228, 0.6325), (1, 0.125), (15.708, 1.9635), (31.4159, 3.927), (125.6637, 15.708), (3, 0.06)
    ]  # fmt: skip


def test_holes_of_two_tools() -> None:
    assert told("ncp", HOLES) == [
        "tool 1",
        "rapid 0 0 2 F10",
        "rapid 5 10 2 F10",
        "line 5 10 -1.8 F1",
        "rapid 5 10 2 F10",
        "rapid 7.54 10 2 F10",
        "line 7.54 10 -1.8 F1",
        "rapid 7.54 10 2 F10",
        "tool 2",
        "rapid -2 0 2 F10",
        "line -2 0 -0.5 F1",
        "dwell 0.25",
        "rapid -2 0 2 F10",
        "end",
    ]
    assert sum(s for _, s in seconds(Ncp().read(HOLES.splitlines(), UP))) == pytest.approx(14.3141, abs=1e-4)


def test_relative_words() -> None:
    assert told("ncp", RELATIVE) == [
        "rapid 5 5 0 F20",
        "line 15 5 0 F4",
        "line 12.5 7.5 -0.1 F4",
        "arc 17.5 12.5 -0.1 about 12.5 12.5 cw F4",
        "rapid 17.5 12.5 2 F20",
        "end",
    ]
    assert times(RELATIVE) == [(7.0711, 0.3536), (10, 2.5), (3.5369, 0.8842), (23.5619, 5.8905), (2.1, 0.105)]


def test_outputs_a_helix_and_machine_zero() -> None:
    assert told("ncp", OUTPUTS) == [
        "spindle cw 12000 wait 2",
        "rapid 10 0 0 F100",
        "dwell 0.01",
        "output A4 255=1",
        "dwell 0.5",
        "line 10 0 -1 F6",
        "arc 10 0 -3 about 0 0 ccw x2 F6",
        "output A4 255=0",
        "spindle off",
        "rapid 10 0 0 F100",
        "rapid 0 0 0 F100",
        "end",
    ]
    assert sum(s for _, s in seconds(Ncp().read(OUTPUTS.splitlines(), UP))) == pytest.approx(23.8533, abs=5e-5)


HEAD = "IMF_PBL_V1.0\nFASTVEL 40000\n"


@pytest.mark.parametrize(
    ("body", "error"),
    [
        (
            "FASTVEL 1000\nREPEAT 5",
            "line 4, column 1: REPEAT: is of a source of ProNC, which is compiled there: its .ncp is run here",
        ),
        ("MOVEABD X5", "line 3, column 1: unknown word 'MOVEABD'; did you mean 'MOVEABS'?"),
        ("FASTABS X1 X2", "line 3, column 12: FASTABS: X is there twice"),
        ("FASTABS X", "line 3, column 9: FASTABS: X has no number"),
        ("FASTABS", "line 3, column 1: FASTABS: names no axis"),
        ("N5 MOVEABS X1", "line 3, column 4: MOVEABS comes before the first VEL; write VEL, or set feed_mm_s"),
        ("CWABS I1000 X2000", "line 3, column 1: CWABS comes before the first VEL; write VEL, or set feed_mm_s"),
        ("VEL 0", "line 3, column 1: VEL: must be more than 0"),
        ("VEL -5", "line 3, column 5: VEL: -5 is out of range; allowed: 0 .. 1e+09"),
        ("GETTOOL -1", "line 3, column 9: GETTOOL: -1 is out of range; allowed: 0 .. 1e+06"),
        ("SPINDLE CW RPM-5", "line 3, column 15: SPINDLE: -5 is out of range; allowed: 0 .. 1e+06"),
        (
            "VEL 10\nCWABS I0 J0",
            "line 4, column 1: CWABS: the radii to start and end are 0.0000 and 0.0000 mm with its centre as an offset",
        ),
        (
            "VEL 10\nCWABS I5000 J0 X9000",
            "line 4, column 1: CWABS: the radii to start and end are 5.0000 and 4.0000 mm with its centre as an offset",
        ),
        ("VEL 10\nCWABS I5000 J0 A5", "line 4, column 1: CWABS: this machine has no axis A"),
        ("VEL 10\nCWABS X5", "line 4, column 1: CWABS: has no centre I J"),
        ("DRILL X1", "line 3, column 1: DRILL comes before the first VEL; write VEL, or set feed_mm_s"),
        ("VEL 10\nDRILL X1", "line 4, column 1: DRILL: its depth is not known; write DRILLDEF D first"),
        ("FASTABS B5", "line 3, column 1: FASTABS: this machine has no axis B"),
        ("VEL 10\nCCWHLXABS I5000 J0 W90", "line 4, column 1: CCWHLXABS: W90 does not lead to its end"),
        ("WPREG2ACT", "line 3, column 1: WPREG: zero 2 is not known; set zeros.2 = [x, y, z]"),
        ("WPREG9ACT", "line 3, column 1: WPREG: wants a number 1 .. 8 and ACT, as WPREG1ACT"),
        ("WPREG1", "line 3, column 1: WPREG: wants a number 1 .. 8 and ACT, as WPREG1ACT"),
        ("WPREG1OFF", "line 3, column 1: WPREG: wants a number 1 .. 8 and ACT, as WPREG1ACT"),
        ("WPZERO", "line 3, column 1: WPZERO: wants STANDARD behind it"),
        ("VEL 10\nCWABS I5 J0 K0 X10", "line 4, column 1: CWABS: K is not of this plane"),
        ("VEL 10\nPLANE XZ\nCWABS I5 J0 K0 X10", "line 5, column 1: CWABS: J is not of this plane"),
        ("VEL 10\nPLANE YZ\nCWABS I0 J5 K0 Y10", "line 5, column 1: CWABS: I is not of this plane"),
        ("SETPORT A4=1", "line 3, column 1: SETPORT: wants a port and its eight bits, as A4=00000001"),
        ("REF A", "line 3, column 1: REF: 'A' names no axes of this machine; allowed: X, Y, Z"),
        ("LIMIT 5", "line 3, column 1: unknown word 'LIMIT'; "),
        ("FASTABS A0 X5", "line 3, column 1: FASTABS: this machine has no axis A; leave A0 out"),
        ("FASTABS X5,5", "line 3, column 10: FASTABS: 5,5 has a comma; write 5.5"),
        ("FASTABS X5e3", "line 3, column 10: FASTABS: 5E3 has an exponent; write 5000"),
        ("FASTABS X99999999999", "line 3, column 10: FASTABS: 99999999999 is out of range; allowed: -1e+09 .. 1e+09"),
        (
            "DRILLDEF C2 D1000000 F1 O1 V10\nDRILL X1",
            "line 4, column 1: DRILL: more than 10000 pecks; write a larger O",
        ),
        (
            "DRILLDEF C2 D1000 V10\nDRILL X1",
            "line 4, column 1: DRILL: C2 drills in pecks; write DRILLDEF F and O",
        ),
        ("DRILLDEF T-5", "line 3, column 1: DRILLDEF: T must not be negative"),
        ("DRILLDEF D-500", "line 3, column 1: DRILLDEF: D must not be negative"),
        ("DRILLDEF R-1", "line 3, column 1: DRILLDEF: R must not be negative"),
        ("DRILLDEF S-1", "line 3, column 1: DRILLDEF: S must not be negative"),
        ("DRILLDEF O0", "line 3, column 1: DRILLDEF: O must be more than 0"),
        ("DRILLDEF I5", "line 3, column 1: DRILLDEF: I, by which pecks shrink, is not made; write I0"),
        ("PLANE AB", "line 3, column 1: PLANE: 'AB' is no plane; allowed: XY, XZ, YZ"),
    ],
)
def test_errors_name_the_place_and_the_remedy(body: str, error: str) -> None:
    with pytest.raises(CamError) as caught:
        told("ncp", f"{HEAD}{body}\nPROGEND\n")
    assert str(caught.value).startswith(error)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "caution"),
    [
        ("IMF_PBL\nfastabs x1\nPROGEND", "words in small letters are read like capitals"),
        ("FASTABS X1\nPROGEND", "there is no line IMF_PBL at the beginning"),
        ("IMF_PBL\nFASTABS X1\n", "the file ends without PROGEND; it may be cut off"),
        ("(Steps per circle: 64)\nIMF_PBL\nPROGEND", "a line that begins with ( is taken as a remark"),
        ("IMF_PBL\nCOOLANT_OFF\nPROGEND", "COOLANT_OFF is read as COOLANT OFF"),
        ("IMF_PBL\nINCH\nPROGEND", "INCH: numbers are read as 1/1000 inch"),
        ("IMF_PBL\nDRILLDEF D90 V5000\nDRILL X1\nPROGEND", "DRILLDEF D is in um: less than 100 is next to nothing; "
         "mm were meant?"),
        ("IMF_PBL\nVEL 5000\nFASTABS X9000 Y5000\nCWABS I14000 X19000\nPROGEND",
         "an arc without I or J: its centre has this axis of its start"),
        ("IMF_PBL\nVEL 5000\nFASTABS X9000 Y5000\nCWABS I5000 J0 X19000 Y5000\nPROGEND",
         "I and J are read as offsets from the start: only so the radii to start and end are equal"),
        ("IMF_PBL\nVEL 5000\nFASTABS Z-5000\nMOVEABS Z1000\nPROGEND",
         "Z of this file seems to count downwards: it cuts above its rapid moves; if so, set file_z_up = false"),
    ],
)  # fmt: skip
def test_what_is_ambiguous_is_said_once(text: str, caution: str) -> None:
    assert caution in cautions("ncp", text)
    assert len(cautions("ncp", text)) == 1


def test_a_default_feed_is_said() -> None:
    settings = dataclasses.replace(UP, feed_mm_s=3.0)
    assert told("ncp", "IMF_PBL\nMOVEABS X1000\nMOVEABS X2000\nPROGEND", settings) == [
        "caution", "line 1 0 0 F3", "line 2 0 0 F3", "end"
    ]  # fmt: skip


@pytest.mark.parametrize("words", ["F500", "O500", "F500 O500"])
def test_one_of_f_and_o_is_every_peck(words: str) -> None:
    body = f"IMF_PBL\nVEL 1000\nDRILLDEF C2 S1000 D1000 {words}\nDRILL X0\nPROGEND"
    assert [each for each in told("ncp", body) if each.startswith("line")] == ["line 0 0 -0.5 F1", "line 0 0 -1 F1"]


def test_pecks_go_back_to_r_above_the_last_depth_and_no_higher_than_the_safe_height() -> None:
    """The first 1 mm, then 0.5 mm each; R 0.3 mm, then 5 mm, which is above the 1 mm of S."""
    body = "IMF_PBL\nVEL 1000\nDRILLDEF C2 S1000 D1500 F1000 O500 R{}\nDRILL X0\nPROGEND"
    first, last = ["rapid 0 0 1", "line 0 0 -1 F1", "rapid 0 0 1"], ["line 0 0 -1.5 F1", "rapid 0 0 1", "end"]
    assert told("ncp", body.format(300)) == [*first, "rapid 0 0 -0.7", *last]
    assert told("ncp", body.format(5000)) == [*first, *last]


PRODUCERS = {
    "Autodesk": "IMF_PBL part\n; 3 min\nN10 METRIC\nN15 WPCLEAR\nN20 FASTABS Z0\nN25 WPZERO STANDARD\nN30 GETTOOL 3\n"
    "N35 SPINDLE CW RPM12000\nN40 FASTABS X1000 Y2000\nN45 COOLANT ON\nN50 VEL 16667\nN55 MOVEABS Z-1000\n"
    "N60 CCWABS I3000 J2000\nN65 COOLANT OFF\nN70 SPINDLE OFF\nN75 PROGEND\n",
    "HSMWorks": "IMF_PBL\nN10 INITTOOL\nN15 SPINDLE ON CW RPM12000\nN20 WPREG 1 ACT\nN25 FASTABS X1000\nN30 VEL 10000\n"
    "N35 PLANE XZ\nN40 CWABS I2000 J0 X3000\nN45 WPCLEAR\nN50 FASTABS Z0\nN55 FASTABS X0 Y0\nN60 PROGEND\n",
    "Vectric": " IMF_PBL_V1.0\r\n ;-----\r\n PLANE XY\r\n FASTVEL 40000\r\n SPINDLE OFF\r\n COOLANT OFF\r\n GETTOOL 1"
    "\r\n SPINDLE CW RPM15000 TIME2000\r\n TYPE Please; wait\r\n FASTABS Z5000\r\n VEL 900\r\n"
    " MOVEABS Z-100\r\n PROGEND\r\n",
    "FlatCAM": "; made\n\nIMF_PBL flatcam\n(Steps per circle: 64)\nVEL 2000\nGETTOOL 1\nSPINDLE CW\nWAIT 1000\n"
    "FASTABS Z2000\nFASTABS X3080 Y1000\nVEL 1000\nMOVEABS Z-100\nVEL 2000\nMOVEABS X4080 Y1000\nMOVEABS Z0\n"
    "FASTABS Z2000\nSPINDLE OFF\nWPCLEAR\nFASTABS Z0\nFASTABS X0 Y0\nPROGEND",
    "FreeCAD": "N000000 IMF_PBL_V1.0\nN000001 ;(Größe)\nN000002 FASTVEL 50000\nN000003 PLANE XY\n"
    "N000004 SPINDLE CW RPM 9000\nN000005 VEL 5000\nN000006 DRILLDEF C2\nN000007 DRILLDEF D3000\n"
    "N000008 DRILLDEF F1000\nN000009 DRILLDEF O1000\n"
    "N000010 DRILL X1000 Y1000\nN000011 SPINDLE OFF\nN000012 PROGEND\n",
    "water jet": "IMF_PBL_v1.0\r\nFASTVEL 166000\r\nVEL 50000\r\n;N10\r\nFASTABS X1000 Y1000\r\nWAIT 10\r\n"
    "SETPORT A4=00000001\r\nWAIT 10\r\nCCWABS I2000 J1000 X3000 Y1000\r\nSETPORT A4=00000000\r\nPROGEND\r\n",
}


@pytest.mark.parametrize("producer", PRODUCERS)
def test_what_producers_write_is_read(producer: str) -> None:
    settings = dataclasses.replace(UP, zeros={1: (0.0, 0.0, 0.0)})
    assert told("ncp", PRODUCERS[producer], settings)[-1] == "end"
    expected = {"FlatCAM": ["a line that begins with ( is taken as a remark"]}.get(producer, [])
    assert [text for text in cautions("ncp", PRODUCERS[producer], settings) if "downwards" not in text] == expected


def test_cw_in_xz_is_clockwise_with_z_up() -> None:
    body = "IMF_PBL\nVEL 1000\nPLANE XZ\nCWABS I5000 K0 X10000\nPROGEND"
    assert told("ncp", body)[0] == "arc 10 0 0 about 5 0 XZ ccw F1"  # ccw seen from +Y: over the top, Z upwards


def test_z_downwards_mirrors_points_and_senses() -> None:
    settings = dataclasses.replace(UP, file_z_up=False)
    body = "IMF_PBL\nVEL 1000\nFASTABS Z-5000\nMOVEABS Z1000\nPLANE XZ\nCWABS I5000 K1000 X10000\nPROGEND"
    assert told("ncp", body, settings)[:3] == ["rapid 0 0 5", "line 0 0 -1 F1", "arc 10 0 -1 about 5 -1 XZ cw F1"]


def test_zeros_and_lengths_of_tools() -> None:
    settings = dataclasses.replace(UP, zero=(100.0, 50.0, 20.0), zeros={2: (1.0, 2.0, 3.0)}, tool_length_mm={4: 10.0})
    body = "IMF_PBL\nFASTABS X1000 Y0 Z5000\nGETTOOL 4\nFASTABS Z5000\nWPREG2ACT\nFASTABS X0 Y0\nFASTABS Z0\nWPCLEAR\n"
    assert told("ncp", body + "FASTABS Z0\nWPZERO STANDARD\nFASTABS X0\nPROGEND", settings) == [
        "rapid 101 50 25",
        "tool 4",
        "rapid 101 50 35",
        "rapid 1 2 35",
        "rapid 1 2 13",
        "rapid 1 2 0",
        "rapid 100 2 0",
        "end",
    ]


UM = st.integers(-400_000, 400_000)
MOVES = st.tuples(
    st.sampled_from(["FASTABS", "MOVEABS", "FASTREL", "MOVEREL"]),
    st.dictionaries(st.sampled_from("XYZ"), UM, min_size=1),
    st.sampled_from(["", "N10 ", "  ", "N5  "]),
    st.sampled_from(["", " ", " ; a remark"]),
)


@given(st.lists(MOVES, max_size=20))
@settings(max_examples=drawn(100), deadline=None)
def test_moves_add_up(moves: list[tuple[str, dict[str, int], str, str]]) -> None:
    at, ends, lines = [0, 0, 0], [], ["IMF_PBL", "VEL 1000"]
    for word, axes, before, behind in moves:
        lines.append(f"{before}{word} {' '.join(f'{letter}{um}' for letter, um in axes.items())}{behind}")
        for letter, um in axes.items():
            at["XYZ".index(letter)] = um + (at["XYZ".index(letter)] if word.endswith("REL") else 0)
        ends.append((Rapid if word.startswith("FAST") else Line, tuple(at)))
    path = [each for each in Ncp().read([*lines, "PROGEND"], UP) if isinstance(each, Rapid | Line)]
    assert [(type(each), tuple(round(mm * 1000) for mm in each.to)) for each in path] == ends


@pytest.mark.parametrize(("plane", "turned"), [("XY", "YX"), ("XZ", "ZX"), ("YZ", "ZY")])
def test_a_plane_may_be_named_in_either_order(plane: str, turned: str) -> None:
    """As FreeCAD writes ZX; half a circle in each."""
    a, b = plane
    centre = {"X": "I5000", "Y": "J5000", "Z": "K5000"}[a], {"X": "I0", "Y": "J0", "Z": "K0"}[b]
    text = f"IMF_PBL\nVEL 10000\nPLANE {{}}\nCWABS {' '.join(centre)} {a}10000 {b}0\nPROGEND"
    made = told("ncp", text.format(plane))
    assert made[0].startswith("arc ")
    assert told("ncp", text.format(turned)) == made
