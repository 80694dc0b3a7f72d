"""Excellon: what each word makes, how numbers are read, what is refused; gerbv's reading is in tests/interop/gerbv."""

from __future__ import annotations

import dataclasses

import pytest

from isel_twin.cam.excellon import Excellon
from isel_twin.cam.reader import head_of
from isel_twin.cam.registry import reader_for
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Line
from tests.cam.short import UP, cautions, told

DRILL = dataclasses.replace(UP, feed_mm_s=10.0, depth_mm=2.0)
HEAD = "M48\nMETRIC,TZ,000.000\nT1C0.8\nT2C1\n%\nT1\n"
KICAD = """M48
; DRILL file {KiCad 7.0.1} date 2023
; FORMAT={-:-/ absolute / metric / decimal}
; #@! TF.GenerationSoftware,Kicad,Pcbnew,7.0.1
FMAT,2
METRIC
T1C0.800
T2C1.000
%
G90
G05
T1
X10.0Y-5.5
X12.54
T2
X20.0Y-5.5G85X24.0Y-5.5
T0
M30
"""
EAGLE = "%\nM48\nM72\nT01C0.0236\nT02C0.0315\n%\nT01\nX6250Y7325\nX625\nT02\nX-625Y500\nM30\n"
ALTIUM = (
    "M48\n;Layer_Color=9474304\n;FILE_FORMAT=4:4\nMETRIC,LZ\n;TYPE=PLATED\nT1F00S00C0.300\n%\nT01\nX00125Y0007\nM30\n"
)
PCB = "M48\r\nINCH\r\nT11C0.035\r\n%\r\nT11\r\nX010000Y005000\r\nX015000\r\nM30\r\n"
ORCAD = "%\nT01\nX10000Y5000\nX15000\nT02\nX2000Y500\nM30\n"


def holes(text: str, settings: CamSettings = DRILL) -> list[str]:
    """X and Y of the holes."""
    return [" ".join(move.split()[1:3]) for move in told("excellon", text, settings) if move.startswith("line")]


def number(text: str, header: str, setting: str = "") -> float:
    """X of a hole, mm."""
    (hole,) = holes(f"M48\n{header}\n%\nT1\nX{text}Y0\nM30\n", dataclasses.replace(DRILL, drill_format=setting))
    return float(hole.split()[0])


def refused(text: str, settings: CamSettings = DRILL) -> str:
    with pytest.raises(CamError) as caught:
        told("excellon", text, settings)
    return str(caught.value)


def test_a_file_of_holes_and_a_slot() -> None:
    assert told("excellon", KICAD, DRILL) == [
        "rapid 0 0 5", "tool 1",
        "rapid 10 -5.5 5", "line 10 -5.5 -2 F5", "rapid 10 -5.5 5",
        "rapid 12.54 -5.5 5", "line 12.54 -5.5 -2 F5", "rapid 12.54 -5.5 5",
        "tool 2",
        "rapid 20 -5.5 5", "line 20 -5.5 -2 F5", "line 24 -5.5 -2 F10", "rapid 24 -5.5 5",
        "end",
    ]  # fmt: skip
    assert cautions("excellon", KICAD, DRILL) == []


@pytest.mark.parametrize(
    ("text", "at"),
    [
        (EAGLE, ["15.875 18.6055", "1.5875 18.6055", "-1.5875 1.27"]),  # 0.625, 0.7325, 0.0625, 0.05 inch
        (ALTIUM, ["12.5 7"]),
        (PCB, ["25.4 12.7", "38.1 12.7"]),
    ],
)
def test_files_in_the_hand_of_board_programs(text: str, at: list[str]) -> None:
    assert holes(text) == at


@pytest.mark.parametrize(
    ("text", "header", "setting", "mm"),
    [
        ("012345", "INCH,TZ", "", 31.3563),  # 1.2345 inch
        ("12345", "INCH,TZ", "", 31.3563),
        ("012345", "INCH,LZ", "", 31.3563),
        ("0123", "INCH,LZ", "", 31.242),  # 1.23 inch
        ("1", "INCH,TZ", "", 0.0025),
        ("01", "INCH,LZ", "", 25.4),
        ("-1", "METRIC,TZ", "", -0.001),
        ("+12500", "METRIC,TZ", "", 12.5),
        ("0125", "METRIC,LZ", "", 12.5),
        ("-0125", "METRIC,LZ", "", -12.5),
        ("1250", "METRIC,TZ,000.00", "", 12.5),
        ("1250", "METRIC,000.00,TZ", "", 12.5),
        ("1250", "METRIC, TZ, 0000.00", "", 12.5),
        ("00125", "METRIC,LZ,0000.00", "", 12.5),
        ("125000", ";FILE_FORMAT=4:4\nMETRIC,TZ", "", 12.5),
        ("00125", ";FILE_FORMAT=4:4\nMETRIC,LZ", "", 12.5),
        ("0060743", ";FILE_FORMAT=2:5\nINCH,LZ", "", 15.4287),
        ("006281", ";FILE_FORMAT=2:5\nINCH,LZ", "", 15.9537),
        ("0125", ";FORMAT={3:3/ absolute / metric / suppress trailing zeros}", "", 12.5),
        ("12500", ";FORMAT={3:3/ absolute / metric / suppress leading zeros}", "", 12.5),
        ("012500", ";FORMAT={3:3/ absolute / metric / keep zeros}", "", 12.5),
        ("12.5", "METRIC,LZ", "", 12.5),
        (".5", "INCH,TZ", "", 12.7),
        ("12.", "M71", "", 12.0),
        ("1250", "METRIC,TZ", "3:2", 12.5),  # the setting wins
        ("125", "METRIC,TZ", "LZ", 125.0),
        ("12345", "METRIC,TZ", "inch 2:4", 31.3563),
        ("12345", "FMAT,2", "inch 2:4 TZ", 31.3563),
    ],
)
def test_numbers(text: str, header: str, setting: str, mm: float) -> None:
    assert number(text, header, setting) == mm


@pytest.mark.parametrize(
    ("points", "mm", "zeros"),
    [
        ("X12345\nX12500", "12.345", "TZ"),  # it ends with a zero, and leading ones are missing
        ("X12345\nX0125", "123.45", "LZ"),
    ],
)
def test_zeros_are_concluded_from_a_number_behind_and_said(points: str, mm: str, zeros: str) -> None:
    text = f"M48\nMETRIC\n%\nT1\n{points}\nM30\n"
    assert holes(text)[0].split()[0] == mm
    (said,) = [each for each in cautions("excellon", text, DRILL) if "numbers" in each]
    assert f"({zeros}), which the file does not say; so X goes from" in said


def test_what_was_assumed_is_said_with_the_size_that_it_makes() -> None:
    text = "M48\nMETRIC,TZ\nT1C1.0\n%\nT1\nX12500Y7000\nX2000Y-1000\nM30\n"
    path = told("excellon", text, DRILL)
    assert path.count("caution") == 1
    assert cautions("excellon", text, DRILL) == [
        "numbers are read as mm 3:3, trailing zeros written (TZ), which the file does not say; so X goes from 2 to "
        "12.5 mm, Y from -1 to 7 mm; if not, set drill_format"
    ]
    assert cautions("excellon", text, dataclasses.replace(DRILL, drill_format="3:3")) == []


def test_a_file_that_makes_no_hole_has_no_size_to_be_said() -> None:
    assert cautions("excellon", "M48\nMETRIC,TZ\nT1C1.0\n%\nT1\nG00X12500Y7000\nM30\n", DRILL) == [
        "numbers are read as mm 3:3, trailing zeros written (TZ), which the file does not say; if not, set drill_format"
    ]


AMBIGUOUS = "M48\nMETRIC\nT1C1.0\n%\nT1\nX12345Y0\nM30\n"
CONTRADICTORY = "M48\nMETRIC\nT1C1.0\n%\nT1\nX12500Y0\nX0125Y0\nM30\n"
SHORT = "M48\nINCH,TZ\nT1C0.03\n%\nT1\nX0060743Y0\nM30\n"


@pytest.mark.parametrize(
    ("text", "why", "remedies"),
    [
        (
            AMBIGUOUS,
            "line 6, column 1: the file does not say which zeros of X12345 are left out",
            {"3:3 LZ": "123.45 0", "3:3 TZ": "12.345 0"},
        ),
        (
            CONTRADICTORY,
            "line 7, column 1: X0125 begins with a zero, which TZ leaves out",
            {"3:3 LZ": "12.5 0", "3:3 TZ": "0.125 0"},
        ),
        (
            SHORT,
            "line 6, column 1: X0060743 begins with a zero, which TZ leaves out",
            {"2:4 LZ": "15.4287 0", "2:4 TZ": "154.287 0"},
        ),
        (
            "%\nT1\nX12500Y0\nM30\n",
            "line 3, column 1: the file says neither INCH nor METRIC",
            {"inch": "31.75 0", "mm": "12.5 0"},
        ),
    ],
)
def test_where_readings_are_as_likely_the_file_is_refused_and_the_setting_decides(
    text: str, why: str, remedies: dict[str, str]
) -> None:
    message = refused(text)
    assert message.startswith(why)
    for setting, hole in remedies.items():
        assert f'"{setting}"' in message
        assert holes(text, dataclasses.replace(DRILL, drill_format=setting))[-1] == hole


@pytest.mark.parametrize(
    ("body", "at"),
    [
        ("X1000Y2000\nY3000\nX2000\n", ["1 2", "1 3", "2 3"]),
        ("G91\nX1000Y2000\nY3000\nX-500\n", ["1 2", "1 5", "0.5 5"]),
        ("ICI,ON\nX1000\nX1000\nICI,OFF\nX1000\n", ["1 0", "2 0", "1 0"]),
        ("X1000Y2000\nR02X500Y-500\nX9000\n", ["1 2", "1.5 1.5", "2 1", "9 1"]),
        ("M25\nX1000Y1000\nX2000\nM01\nM02X5000Y100\nM02X5000\nM08\nX3000\n",
         ["1 1", "2 1", "6 1.1", "7 1.1", "11 1.1", "12 1.1", "3 1"]),
        ("M25\nX1000Y1000\nM01\nR3M02Y1000\nM08\n", ["1 1", "1 2", "1 3", "1 4"]),
        ("X1000\nG91\nM25\nX1000\nX1000\nM01\nM02Y1000\nM08\nX1000\n",
         ["1 0", "2 0", "3 0", "2 1", "3 1", "4 0"]),
        ("G93X5000Y1000\nX1000Y1000\nG93X0Y0\nX1000Y1000\n", ["6 2", "1 1"]),
        ("M72\nX12345\nM71\nX12500\n", ["31.3563 0", "12.5 0"]),
        ("N10X1000\nN20 X2000 Y1000\n", ["1 0", "2 1"]),
        ("T2X1000\n", ["1 0"]),
        ("X1000Y1000G85X3000\n", ["1 1", "3 1"]),
        ("X1000\nG85Y2000\n", ["1 0", "1 0", "1 2"]),
        ("G91\nX1000\nX1000G85X500\n", ["1 0", "2 0", "2.5 0"]),
        ("FMAT,1\nG81\nM26\n", None),
        ("x1000y500\n", ["1 0.5"]),
        ("G05G90X1000\nG91G05X1000\n", ["1 0", "2 0"]),
        ("G00X1000M15\nG01X2000M16\nG05X3000\n", ["1 0", "2 0", "3 0"]),
        ("/X1000\nX2000\n", ["1 0", "2 0"]),
    ],
)  # fmt: skip
def test_points(body: str, at: list[str] | None) -> None:
    text = f"{HEAD}{body}M30\n"
    if at is None:
        assert "repeats a pattern" in refused(text)
    else:
        assert holes(text) == at


def test_what_a_pattern_makes_again_is_of_the_line_that_asks_for_it() -> None:
    text = f"{HEAD}M25\nX1000\nX2000\nM01\nM02Y1000\nM08\nX9000\nM30\n"
    path = [element for element in Excellon().read(text.splitlines(), DRILL) if isinstance(element, Line)]
    assert [element.place.line for element in path] == [8, 9, 11, 11, 13]


def test_the_codes_of_format_1_are_translated() -> None:
    """G81 M25 M24 M26 M27 M01 M00 M02 are G05 M25 M01 M02 M08 M06 M09 M00 of format 2."""
    text = "M48\nFMAT,1\nMETRIC,TZ,000.000\nT1C1\n%\nT1\nG81\nM25\nX1000\nM24\nM26X1000\nM27\nM01\nM00\nM02\nX9\n"
    path = told("excellon", text, DRILL)
    assert holes(text) == ["1 0", "2 0"]
    assert path[-3:] == ["stop optional", "stop", "end"]


def test_t0_is_a_tool_where_it_has_a_diameter() -> None:
    assert "tool 0" in told("excellon", "M48\nMETRIC,TZ,000.000\nT0C1\n%\nT0\nX1000\nM30\n", DRILL)
    assert [each for each in told("excellon", f"{HEAD}X1000\nT0\nX2000\nM30\n", DRILL) if "tool" in each] == ["tool 1"]


def test_block_delete_is_a_setting() -> None:
    assert holes(f"{HEAD}/X1000\nX2000\nM30\n", dataclasses.replace(DRILL, block_delete=True)) == ["2 0"]


ROUT = HEAD + "G00X10000Y10000\nM15\nG01X30000\n{}\nM16\nG05\nX50000\nM30\n"


@pytest.mark.parametrize(
    ("word", "made"),
    [
        ("G01Y20000", "line 30 20 -2 F10"),
        ("X40000", "line 40 10 -2 F10"),
        ("G03X30000Y20000A5000", "arc 30 20 -2 about 30 15 ccw F10"),
        ("G02X30000Y20000A5000", "arc 30 20 -2 about 30 15 cw F10"),
        ("G03X35000Y15000A5000", "arc 35 15 -2 about 30 15 ccw F10"),
        ("G03X30000Y20000J5000", "arc 30 20 -2 about 30 15 ccw F10"),
        ("G02X30000Y10000I5000J0", "arc 30 10 -2 about 35 10 cw F10"),
    ],
)
def test_routs(word: str, made: str) -> None:
    end = made.removeprefix("arc ").removeprefix("line ").split(" -2")[0]
    assert told("excellon", ROUT.format(word), DRILL) == [
        "rapid 0 0 5", "tool 1", "rapid 10 10 5", "line 10 10 -2 F5", "line 30 10 -2 F10", made, f"rapid {end} 5",
        f"rapid 50 {end.split()[1]} 5", f"line 50 {end.split()[1]} -2 F5", f"rapid 50 {end.split()[1]} 5", "end",
    ]  # fmt: skip


def test_depths_and_lengths_are_of_the_tool() -> None:
    settings = dataclasses.replace(DRILL, pen_depth_mm={2: 1.5}, tool_length_mm={2: 20.0}, zero=(1.0, 2.0, 3.0))
    assert told("excellon", f"{HEAD}X10000\nT2\nX20000\nM30\n", settings) == [
        "rapid 0 0 8", "tool 1", "rapid 11 2 8", "line 11 2 1 F5", "rapid 11 2 8", "tool 2", "rapid 11 2 28",
        "rapid 21 2 28", "line 21 2 21.5 F5", "rapid 21 2 28", "end",
    ]  # fmt: skip


@pytest.mark.parametrize(
    ("text", "caution"),
    [
        (f"{HEAD}T5\nX1000\nM30\n", "T5 has no diameter in this file"),
        (f"{HEAD[:-3]}X1000\nM30\n", "no tool is selected yet: the one in the spindle is taken"),
        (f"{HEAD}X1000\n", "the file ends without M30; it may be cut off"),
        (f"{HEAD}G00X0\nG41\nM15\nG01X1000\nM30\n", "G41 is not made: the centre of the tool goes where the file"),
        (f"{HEAD}G00X0\nG01X1000\nM30\n", "G01 before M15 moves above the work"),
        (f"{HEAD}G93X1000\nX1000\nM30\n", "G93: points count from there on from this one"),
        (f"{HEAD}X1000\nM30X0Y0\n", "X and Y behind M30 are left out"),
        (f"{HEAD}X1000\nM06X0Y0\nM30\n", "X and Y behind M06 are left out"),
        (f"{HEAD}F50X1000\nM30\n", "F50: feeds, speeds and strokes of drilling machines have no effect; plunge_mm_s"),
        (f"{HEAD}M97,TEXT\nX1000\nM30\n", "M97: text is not drilled"),
        (f"{HEAD}G04X500\nX1000\nM30\n", "G04: a setting of drilling machines, without effect"),
        ("M48\nDETECT,ON\nMETRIC,TZ,000.000\nT1C1\n%\nT1\nX1000\nM30\n", "DETECT,ON: a setting of drilling machines"),
        ("M48\nMETRIC,TZ,000.000\nT1F200S65C0.8\n%\nT1\nX1000\nM30\n", "F200: feeds, speeds and strokes of drilling"),
        ("M48\n;FILE_FORMAT=4:4\nMETRIC,TZ,000.000\nT1C1\n%\nT1\nX1000\nM30\n",
         "the file says 4:4 and 3:3: 3:3 is taken"),
        ("M48\nMETRIC,LZ,000.000\nT1C1\n%\nT1\nX1250\nM30\n", "X1250 ends with a zero, which LZ leaves out; "),
    ],
)  # fmt: skip
def test_what_is_taken_or_left_out_is_said_once(text: str, caution: str) -> None:
    (said,) = cautions("excellon", text, DRILL)
    assert said.startswith(caution)


def test_a_depth_that_nobody_has_set_is_said() -> None:
    unset = dataclasses.replace(DRILL, depth_mm=None)
    text = f"{HEAD}X1000\nX2000\nM30\n"
    assert "line 1 0 -1.8 F5" in told("excellon", text, unset)
    assert cautions("excellon", text, unset) == [
        "the file has no depth: 1.8 mm is taken, for a board of 1.5 mm; set depth_mm"
    ]
    assert cautions("excellon", text, dataclasses.replace(unset, pen_depth_mm={1: 1.8})) == []


@pytest.mark.parametrize(
    ("body", "error"),
    [
        ("G82X1000", "line 7, column 1: G82 is not read; let the program that made the file write each hole"),
        ("G84X1000", "line 7, column 1: G84 is not read; "),
        ("M61", "line 7, column 1: M61 is not read; "),
        ("M25\nX1\nM01\nM02X1000M80", "line 10, column 9: M80 is not read; let the program that made the file write"),
        ("G92X5", "line 7, column 1: G92 is not read; "),
        ("X5C1", "line 7, column 3: C1 is no word of Excellon here"),
        (
            "M02X1000",
            "line 7, column 1: M02 repeats a pattern, which M25 begins and M01 ends; the end of a file is M30",
        ),
        ("M01", "line 7, column 1: M01 ends a pattern that has no beginning; write M25 before it"),
        ("X1000X2000", "line 7, column 6: X is there twice in one line"),
        ("X1E5", "line 7, column 1: X: 1E5 has an exponent; write 100000.0"),
        ("X1000Q5", "line 7, column 6: Q5 is no word of Excellon here"),
        ("X1,5Y2", "line 7, column 1: X: 1,5 has a comma; write 1.5"),
        ("X", "line 7, column 1: 'X' is no word of Excellon"),
        ("T1.5", "line 7, column 1: T1.5: a whole number is wanted"),
        ("R5X1\nR99995X1\nR1X1", "line 9, column 1: more than 100000 repeats in a file"),
        ("X9999999.0", "line 7, column 1: X9999999.0 is out of range; allowed: up to 1e+06 mm"),
        ("X111111111111111111111", "line 7, column 1: X1111111111111111111 .. has too many digits"),
        ("G00X0\nM15\nG02X1000", "line 9, column 1: G02 has no centre; write A, its radius, or I and J"),
        ("G00X0\nM15\nG02X1000I400", "line 9, column 1: radii to start and end are 0.4000 and 0.6000 mm"),
        (
            "G00X0\nM15\nG02X9000A1000",
            "line 9, column 1: A of 1 mm is too small to reach the end, which is 9.0000 mm",
        ),
        ("A5", "line 7, column 1: A5 without X and Y"),
    ],
)
def test_errors_name_the_place_and_the_remedy(body: str, error: str) -> None:
    assert refused(f"{HEAD}{body}\nM30\n").startswith(error)


@pytest.mark.parametrize("body", ["X1000G85X2000", "G00X1000\nM15\nG01X2000"])
def test_slots_and_routs_need_a_feed_and_holes_do_not(body: str) -> None:
    assert "slots and routs have no feed; set feed_mm_s" in refused(
        f"{HEAD}{body}\nM30\n", dataclasses.replace(DRILL, feed_mm_s=0.0)
    )
    assert holes(f"{HEAD}X1000\nM30\n", dataclasses.replace(DRILL, feed_mm_s=0.0)) == ["1 0"]


@pytest.mark.parametrize(
    "text",
    [
        KICAD,
        EAGLE,
        ALTIUM,
        PCB,
        ORCAD,
        HEAD,
        "M48\n;by hand\nM71\n%\nT1\nX1Y1\nM30\n",
        "G90\nM72\nM48\nT1C0.012\n%\nM30\n",
    ],
)
def test_a_drill_file_is_known_by_its_content(text: str) -> None:
    for suffix in ("", ".drl", ".xln", ".exc", ".txt", ".nc", ".tap", ".ncp"):
        assert reader_for(head_of(text.encode()), suffix).name == "excellon"


@pytest.mark.parametrize(
    "text",
    [
        "M48\nG21 G90\nG0 X1\nM2\n",
        "%\nM48\nG21 G90\nG0 X1\nM30\n%\n",
        "M48\nT1 M6\nG0 X1\nM2\n",
        "%\nT1 M6\nG0 X1 Y1\nX2\nM30\n%\n",
        "G21\nT1\nM6\nG81 X1 Y1 Z-1 R1 F60\nX2Y2\nX3\nG80\nM30\n",
        "G90\nG0X1Y1\nX2\nM2\n",
    ],
)
def test_g_code_is_not_taken_for_a_drill_file(text: str) -> None:
    for suffix in ("", ".nc", ".txt"):
        assert reader_for(head_of(text.encode()), suffix).name == "gcode"
