"""Each remedy that a reader's message gives, obeyed to the letter: the file is read, and is what it meant."""

from __future__ import annotations

import ast
import dataclasses
import gzip
import io
import re
from collections.abc import Iterator, Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import pytest

from isel_twin.cam import reader as readers
from isel_twin.cam.reader import head_of, text_lines
from isel_twin.cam.toolpath import CamError
from tests.cam.short import UP, cautions, told

NOTHING: Mapping[str, Any] = MappingProxyType({})
FEED: dict[str, Any] = {"feed_mm_s": 2.0}
ZEROS: dict[str, Any] = {"zeros": {2: (1.0, 2.0, 3.0)}}
STRICT: dict[str, Any] = {"strict": True}


class Remedy(NamedTuple):
    """A file that is refused, what its message advises, the file that obeys, and the path that was meant."""

    wrong: str
    advice: str
    obeyed: str
    meant: str
    settings: Mapping[str, Any] = NOTHING
    set: Mapping[str, Any] = NOTHING  # by the advice


HEAD = "G21 G90 F60\n"
TEXT = "A job of ours\nX10 of the drawing\n\n%1\nG71 G90\n"
DIALECTS = 'set dialect = "din", or "winpc" where feeds are in mm/s'
HOLE = "rapid 0 0 1 | rapid 1 0 1 | line 1 0 -1 F1 | rapid 1 0 1"
GCODE = (
    Remedy("G1 X1 A0.", "leave A0 out", "G1 X1", "line 1 0 0 F1"),
    Remedy("G1 X1e1", "write 10", "G1 X10", "line 10 0 0 F1"),
    Remedy("G1 Z0,8128", "write 0.8128", "G1 Z0.8128", "line 0 0 0.8128 F1"),
    Remedy("G1 X5,5", "write 5.5", "G1 X5.5", "line 5.5 0 0 F1"),
    Remedy("G1 X5,Y2", "write 5", "G1 X5Y2", "line 5 2 0 F1"),
    Remedy("G1 G28 Z5", "write G1 in a line of its own before it", "G1\nG28 Z5", "rapid 0 0 5 | rapid 0 0 0"),
    Remedy("G0 X1 #1=5\nM2", "let the CAM program write numbers", "G0 X1", "rapid 1 0 0"),
    Remedy(
        "G91 G53 G0 X5\nX2",
        "write G90 in its line, and G91 again in the next one",
        "G90 G53 G0 X5\nG91 X2",
        "rapid 5 0 0 | rapid 7 0 0",
    ),
    Remedy("G53\nG92 X5", "write G54 before it", "G53\nG54\nG92 X5\nG0 X0", "rapid -5 0 0"),
    Remedy("G74 X0", 'if it is a reference run, set dialect = "din"', "G74 X0", "reference X", set={"dialect": "din"}),
    Remedy(
        "G74 X0 Y0\nG0 X10\nG2 X20 I5 J0",
        'if it is a reference run, set dialect = "din"',
        "G74 X0 Y0\nG0 X10\nG2 X20 I5 J0",
        "reference XY | rapid 10 0 0 | arc 20 0 0 about 15 0 cw F1",
        set={"dialect": "din"},
    ),
    *(
        Remedy(f"{line}\nG1 X1", DIALECTS, f"{line}\nG1 X1", f"{meant} | line 1 0 0 {feed}", set={"dialect": dialect})
        for dialect, feed in (("din", "F1"), ("winpc", "F60"))
        for line, meant in (("M70", "output M70 1=1"), ("M-77", "output M77 1=0"), ("G4 F2", "dwell 2"))
    ),
    Remedy("G71\nG0 X1", "write G21", "G21\nG0 X1", "rapid 1 0 0", {"dialect": "rs274"}),
    Remedy("G70\nG0 X1", "write G20", "G20\nG0 X1", "rapid 25.4 0 0", {"dialect": "rs274"}),
    Remedy("G55 G0 X0 Y0 Z0", "set zeros.2 = [x, y, z]", "G55 G0 X0 Y0 Z0", "rapid 1 2 3", set=ZEROS),
    Remedy("G55 G0 X0 Y0 Z0", "or G10 L2 P2 before", "G10 L2 P2 X1 Y2 Z3\nG55 G0 X0 Y0 Z0", "rapid 1 2 3"),
    Remedy("G2 X5 I2.5 K0", "leave it out", "G2 X5 I2.5", "arc 5 0 0 about 2.5 0 cw F1", STRICT),
    Remedy(
        "G71\nG0 X0 Y10\nG2 X10 Y10 I5 J0",
        "write G91.1 or G90.1 before it",
        "G71\nG0 X0 Y10\nG91.1 G2 X10 Y10 I5 J0",
        "rapid 0 10 0 | arc 10 10 0 about 5 10 cw F1",
    ),
    Remedy(
        "G71\nG0 X0 Y10\nG2 X10 Y10 I5 J0",
        "write G91.1 or G90.1 before it",
        "G71\nG0 X0 Y10\nG90.1 G2 X10 Y10 I5 J0",
        "rapid 0 10 0 | arc 10 10 0 about 5 0 cw F1",
    ),
    Remedy(
        "G0 X10\nG2 X-10 I0 J0",
        "if they are absolute, write G90.1 before it",
        "G0 X10\nG90.1\nG2 X-10 I0 J0",
        "rapid 10 0 0 | arc -10 0 0 about 0 0 cw F1",
    ),
    Remedy(
        "G90.1\nG0 X10\nG2 X0 I-5 J0",
        "if they are offsets, write G91.1 before it",
        "G90.1\nG0 X10\nG91.1\nG2 X0 I-5 J0",
        "rapid 10 0 0 | arc 0 0 0 about 5 0 cw F1",
    ),
    Remedy("G81 X1 Z-1", "write it where G81 begins", "G81 X1 Z-1 R1", HOLE),
    Remedy(
        "G81 X1 Z-1 R1\nG82 X2 Z-1 P1",
        "write it where G82 begins",
        "G81 X1 Z-1 R1\nG82 X2 Z-1 R1 P1",
        f"{HOLE} | rapid 2 0 1 | line 2 0 -1 F1 | dwell 1 | rapid 2 0 1",
    ),
    Remedy("G73 X1 Z-1 R1 Q.0001", "write a larger Q", "G73 X1 Z-1 R1 Q2", HOLE),
    Remedy("G84 X1 Z-1 R1", "drill with G81 and tap by hand", "G81 X1 Z-1 R1", HOLE),
    Remedy(
        "G86 X1 Z-1 R1 P0",
        "write G85, which feeds out of the hole instead",
        "G85 X1 Z-1 R1 P0",
        HOLE.replace("-1 F1 | rapid 1 0 1", "-1 F1 | line 1 0 1 F1"),
    ),
    Remedy(
        "G88 X1 Z-1 R1 P1",
        "write G89, which feeds out of the hole instead",
        "G89 X1 Z-1 R1 P1",
        HOLE.replace("-1 F1 | rapid 1 0 1", "-1 F1 | dwell 1 | line 1 0 1 F1"),
    ),
    Remedy("G5.1 Q1\nG0 X1", "leave G5.1 and its Q out", "G0 X1", "rapid 1 0 0"),
    Remedy("G187 P2 E0.1\nG0 X1", "leave G187, its P and E out", "G0 X1", "rapid 1 0 0"),
    Remedy(
        "G43.1 Z5\nG0 X1",
        "write G43 H and that length in tool_length_mm",
        "G43 H1\nG0 X1 Z0",
        "rapid 1 0 5",
        set={"tool_length_mm": {1: 5.0}},
    ),
    Remedy(
        "G43 H1\nG43.2 H2\nG0 Z0",
        "write G43 H and the sum of both lengths in tool_length_mm",
        "G43 H3\nG0 Z0",
        "rapid 0 0 7",
        {"tool_length_mm": {1: 5.0, 2: 2.0}},
        {"tool_length_mm": {3: 7.0}},
    ),
    Remedy("G7\nG0 X20", "write G8, and radii for X", "G8\nG0 X10", "rapid 10 0 0"),
    Remedy(
        "S1000 M3\nG95 G1 X1 F0.06",
        "write G94, and F times S for F",
        "S1000 M3\nG94 G1 X1 F60",
        "spindle cw 1000 | line 1 0 0 F1",
    ),
    Remedy("G96 S31.4159 M3", "write G97, and turns a minute for S", "G97 S1000 M3", "spindle cw 1000"),
    Remedy("M60", "write M0", "M0", "stop"),
    Remedy("M61 Q5", "write T and M6", "T5 M6", "tool 5"),
    Remedy('msg "a tool"\nG0 X1', "write (MSG,a tool)", "(MSG,a tool)\nG0 X1", "remark a tool | rapid 1 0 0"),
    Remedy("G0 X1 (a", "write ) behind it", "G0 X1 (a)", "rapid 1 0 0", STRICT),
    Remedy("G0 X1 (a (b) c)", "leave the inner brackets out", "G0 X1 (a b c)", "rapid 1 0 0", STRICT),
    Remedy("G40.1 G0 X1", "leave it out", "G0 X1", "rapid 1 0 0", STRICT),
)
DEPTH: dict[str, Any] = {"depth_mm": 2.0}
HOLES = "METRIC,TZ,000.000\nT1C1\n%\nT1"
UNCLEAR = "METRIC\nT1C1\n%\nT1\nX12345"
DRILL = (
    Remedy("T1X12.5", 'set drill_format = "inch", or "mm"', "T1X12.5", "rapid 12.5 0 5", DEPTH, {"drill_format": "mm"}),
    Remedy(
        UNCLEAR, 'set drill_format = "3:3 LZ" if it is 123.45 mm', UNCLEAR, "rapid 123.45 0 5", DEPTH,
        {"drill_format": "3:3 LZ"},
    ),
    Remedy(f"{HOLES}\nX1,5", "write 1.5", f"{HOLES}\nX1.5", "rapid 1.5 0 5", DEPTH),
    Remedy(f"{HOLES}\nX1E1", "write 10.0", f"{HOLES}\nX10.0", "rapid 10 0 5", DEPTH),
    Remedy(UNCLEAR, '"3:3 TZ" if it is 12.345 mm', UNCLEAR, "rapid 12.345 0 5", DEPTH, {"drill_format": "3:3 TZ"}),
    Remedy(
        f"{HOLES}\nX0G85X1000", "set feed_mm_s", f"{HOLES}\nX0G85X1000",
        "line 0 0 -2 F5 | line 1 0 -2 F2 | rapid 1 0 5", DEPTH, FEED,
    ),
    Remedy(
        f"{HOLES}\nG00X0\nM15\nG03X2000", "write A, its radius", f"{HOLES}\nG00X0\nM15\nG03X2000A1000",
        "arc 2 0 -2 about 1 0 ccw F2 | rapid 2 0 5", {**DEPTH, **FEED},
    ),
    Remedy(
        f"{HOLES}\nG00X0\nM15\nG03X2000", "or I and J", f"{HOLES}\nG00X0\nM15\nG03X2000I1000J0",
        "arc 2 0 -2 about 1 0 ccw F2 | rapid 2 0 5", {**DEPTH, **FEED},
    ),
    Remedy(
        f"{HOLES}\nX1000\nM01\nM02X5000", "write M25 before it", f"{HOLES}\nM25\nX1000\nM01\nM02X5000",
        "rapid 6 0 5 | line 6 0 -2 F5 | rapid 6 0 5", DEPTH,
    ),
)  # fmt: skip
OTHERS = (
    ("gcode", Remedy("G21\nG1 X1\nM2", "write F before the first cut", "G21 F60\nG1 X1\nM2", "line 1 0 0 F1")),
    ("gcode", Remedy("G21\nG1 X1\nM2", "or set feed_mm_s", "G21\nG1 X1\nM2", "line 1 0 0 F2", set=FEED)),
    ("gcode", Remedy("G21\nG0 X1\n", "write M2 at its end", "G21\nG0 X1\nM2", "rapid 1 0 0", STRICT)),
    *(
        ("gcode", Remedy(f"{TEXT}G0 X1\nM30", DIALECTS, f"{TEXT}G0 X1\nM30", "rapid 1 0 0", set={"dialect": dialect}))
        for dialect in ("din", "winpc")
    ),
    ("ncp", Remedy("MOVEABS X5000", "write VEL", "VEL 1000\nMOVEABS X5000", "line 5 0 0 F1")),
    ("ncp", Remedy("MOVEABS X5000", "or set feed_mm_s", "MOVEABS X5000", "line 5 0 0 F2", set=FEED)),
    ("ncp", Remedy("MOVEABD X5000", "did you mean 'MOVEABS'", "VEL 1000\nMOVEABS X5000", "line 5 0 0 F1")),
    ("ncp", Remedy("FASTABS X5000 A0", "leave A0 out", "FASTABS X5000", "rapid 5 0 0")),
    ("ncp", Remedy("FASTABS X5000,4", "write 5000.4", "FASTABS X5000.4", "rapid 5 0 0")),
    ("ncp", Remedy("FASTABS X5e3", "write 5000", "FASTABS X5000", "rapid 5 0 0")),
    ("ncp", Remedy("WPREG2ACT\nFASTABS X0", "set zeros.2 = [x", "WPREG2ACT\nFASTABS X0", "rapid 1 0 0", set=ZEROS)),
    (
        "ncp",
        Remedy(
            "VEL 1000\nDRILL X0", "write DRILLDEF D first", "VEL 1000\nDRILLDEF D1000\nDRILL X0",
            "rapid 0 0 2 | line 0 0 -1 F1 | rapid 0 0 2",
        ),
    ),
    (
        "ncp",
        Remedy(
            "DRILLDEF C2 D1000 V1000\nDRILL X0", "write DRILLDEF F and O",
            "DRILLDEF C2 D1000 V1000\nDRILLDEF F1000 O1000\nDRILL X0", "rapid 0 0 2 | line 0 0 -1 F1 | rapid 0 0 2",
        ),
    ),
    (
        "ncp",
        Remedy(
            "DRILLDEF C2 D1000000 F1 O1 V1000\nDRILL X0", "write a larger O",
            "DRILLDEF C2 D1000000 F1000000 O1000000 V1000\nDRILL X0", "rapid 0 0 2 | line 0 0 -1000 F1 | rapid 0 0 2",
        ),
    ),
    (
        "ncp",
        Remedy(
            "DRILLDEF D1000 I5 V1000\nDRILL X0", "write I0", "DRILLDEF D1000 I0 V1000\nDRILL X0",
            "rapid 0 0 2 | line 0 0 -1 F1 | rapid 0 0 2",
        ),
    ),
    *(("excellon", row._replace(wrong=f"{row.wrong}\nM30", obeyed=f"{row.obeyed}\nM30")) for row in DRILL),
    ("hpgl", Remedy("PU0,0;PD40,0;", "set feed_mm_s", "PU0,0;PD40,0;", "line 1 0 -0.5 F2 | rapid 1 0 5", set=FEED)),
    ("hpgl", Remedy("PU1e1,0;", "write 10", "PU10,0;", "rapid 0.25 0 5")),
    ("hpgl", Remedy("SC0,1,0,1;PU1,1;", "write IP before it", "IP0,0,40,40;SC0,1,0,1;PU1,1;", "rapid 1 1 5")),
    ("hpgl", Remedy("IR0,0,100,100;SC0,1,0,1;PU1,1;", "write IP", "IP0,0,40,40;SC0,1,0,1;PU1,1;", "rapid 1 1 5")),
)  # fmt: skip
ROWS = [
    *(("gcode", row._replace(wrong=f"{HEAD}{row.wrong}\nM2", obeyed=f"{HEAD}{row.obeyed}\nM2")) for row in GCODE),
    *(
        (name, row._replace(wrong=f"IMF_PBL\n{row.wrong}\nPROGEND", obeyed=f"IMF_PBL\n{row.obeyed}\nPROGEND"))
        if name == "ncp"
        else (name, row)
        for name, row in OTHERS
    ),
]


@cache
def message(number: int) -> str:
    """What the reader says of the wrong file of this row."""
    name, row = ROWS[number]
    with pytest.raises(CamError) as caught:
        told(name, row.wrong, dataclasses.replace(UP, **row.settings))
    return str(caught.value)


@pytest.mark.parametrize("number", range(len(ROWS)), ids=[row.advice for _, row in ROWS])
def test_a_remedy_that_is_obeyed_works(number: int) -> None:
    name, row = ROWS[number]
    assert row.advice in message(number)
    path = told(name, row.obeyed, dataclasses.replace(UP, **{**row.settings, **row.set}))
    made = [each for each in path if each not in ("caution", "end")]
    assert made[-len(row.meant.split(" | ")) :] == row.meant.split(" | ")


ADVICE = re.compile(r"\b(write|set|leave|drill|unpack|save|let|take|put|use|correct)\b")
TO_A_PROGRAM = re.compile(
    r"let the (CAM )?program (that made it )?|in the program that made it|CAM program$|pcb2gcode|gerbv"
)
ELSEWHERE = {  # by the test that obeys them
    "set file_z_up = false": "test_a_file_that_counts_downwards",
    "unpack it": "test_what_is_packed_is_unpacked",
    "save it as UTF-8": "test_what_is_packed_is_unpacked",
    "save the text of the program": "test_what_is_packed_is_unpacked",
    "leave that line out": "test_what_is_packed_is_unpacked",
    "write one statement a line": "test_what_is_packed_is_unpacked",
    "draw it with PD": "test_a_polygon_that_is_too_long",
    "set feed_unit =": "test_feeds_out_of_proportion",
    "set depth_mm": "test_settings_of_drill_files_that_are_said",
    "set drill_format": "test_settings_of_drill_files_that_are_said",
}


def advices() -> Iterator[str]:
    """Each piece of text in the readers that advises something, as an expression that its messages match."""
    folder = Path(readers.__file__).parent
    for path in (
        *(file for room in ("excellon", "gcode", "ncp", "hpgl") for file in (folder / room).glob("*.py")),
        folder / "reader.py",
        folder / "feeds.py",
    ):
        tree = ast.parse(path.read_text())
        said = {id(node.value) for node in ast.walk(tree) if isinstance(node, ast.Expr)}  # docstrings
        parts = {id(part) for node in ast.walk(tree) if isinstance(node, ast.JoinedStr) for part in node.values}
        for node in ast.walk(tree):
            if isinstance(node, ast.JoinedStr):
                text = "".join(
                    re.escape(part.value) if isinstance(part, ast.Constant) else ".*" for part in node.values
                )
            elif isinstance(node, ast.Constant) and isinstance(node.value, str) and not {id(node)} & (said | parts):
                text = re.escape(node.value)
            else:
                continue
            if ADVICE.search(text) and not TO_A_PROGRAM.search(text.replace("\\", "")):
                yield text


def test_every_advice_is_obeyed_by_a_test() -> None:
    messages = [message(number) for number in range(len(ROWS))]
    untried = [
        text
        for text in advices()
        if not any(each in text.replace("\\", "") for each in ELSEWHERE)
        and not any(re.search(text, one) for one in messages)
    ]
    assert untried == []
    assert set(ELSEWHERE.values()) <= set(globals())


def test_a_file_that_counts_downwards() -> None:
    text = "G21 G90 F60\nG0 Z-5\nG1 X1 Z1\nM2"
    assert "set file_z_up = false" in cautions("gcode", text)[0]
    obeyed = dataclasses.replace(UP, file_z_up=False)
    assert told("gcode", text, obeyed) == ["rapid 0 0 5", "line 1 0 -1 F1", "end"]


@pytest.mark.parametrize(
    ("name", "text", "settings", "unit", "meant"),
    [
        ("gcode", "G21 G90\nG1 X300 F15\nM2", {}, "mm/s", "line 300 0 0 F15"),
        ("gcode", "G20 G90\nG1 X10 F1800\nM2", {}, "mm/min", "line 254 0 0 F30"),
        ("gcode", "G71 G90\nG1 X300 F1200\nM2", {"dialect": "winpc"}, "mm/min", "line 300 0 0 F20"),
        ("gcode", "G21 G90\nG1 X300 F5400\nM2", {"feed_unit": "mm/s"}, "mm/min", "line 300 0 0 F90"),
        ("ncp", "IMF_PBL\nVEL 20\nMOVEABS X300000\nPROGEND", {}, "mm/s", "line 300 0 0 F20"),
        ("ncp", "IMF_PBL\nVEL 300\nMOVEABS X300000\nPROGEND", {}, "mm/min", "line 300 0 0 F5"),
        ("ncp", "IMF_PBL\nVEL 5000\nMOVEABS X300000\nPROGEND", {"feed_unit": "mm/s"}, "um/s", "line 300 0 0 F5"),
    ],
)
def test_feeds_out_of_proportion(name: str, text: str, settings: dict[str, Any], unit: str, meant: str) -> None:
    said = cautions(name, text, dataclasses.replace(UP, **settings))
    assert [f'set feed_unit = "{unit}"' in each for each in said] == [True]
    assert told(name, text, dataclasses.replace(UP, **{**settings, "feed_unit": unit})) == [meant, "end"]


def test_settings_of_drill_files_that_are_said() -> None:
    text = "METRIC,TZ\nT1C1\n%\nT1\nX12500\nM30"
    assert "set depth_mm" in cautions("excellon", text)[0]
    assert "if not, set drill_format" in cautions("excellon", text)[1]
    obeyed = dataclasses.replace(UP, depth_mm=1.5, drill_format="4:2")
    assert told("excellon", text, obeyed)[2:] == ["rapid 125 0 5", "line 125 0 -1.5 F5", "rapid 125 0 5", "end"]


def test_what_is_packed_is_unpacked() -> None:
    text = b"G21 G90\nG0 X1\nM2\n"
    for packed, advice in (
        (gzip.compress(text), "unpack it"),
        (text.decode().encode("utf-16"), "save it as UTF-8"),
        (b"P1\n" + text, "leave that line out"),
        (b"%PDF-1.4\n", "save the text of the program"),
    ):
        with pytest.raises(CamError, match=advice):
            head_of(packed)
    assert told("gcode", text_lines(io.BytesIO(text))) == ["rapid 1 0 0", "end"]
    long = b"G21" + 70_000 * b" " + b"G0 X1\nM2\n"
    with pytest.raises(CamError, match="write one statement a line"):
        told("gcode", text_lines(io.BytesIO(long)))
    assert told("gcode", text_lines(io.BytesIO(b"G21\nG0 X1\nM2\n"))) == ["rapid 1 0 0", "end"]


def test_a_polygon_that_is_too_long() -> None:
    points = "PA" + ",".join("40,0" if at % 2 else "0,0" for at in range(100_001)) + ";"
    pen = dataclasses.replace(UP, feed_mm_s=2.0)
    with pytest.raises(CamError, match="draw it with PD"):
        told("hpgl", f"PU0,0;PM0;{points}PM2;EP;", pen)
    assert told("hpgl", f"PU0,0;PD;{points}", pen)[2:4] == ["line 1 0 -0.5 F2", "line 0 0 -0.5 F2"]
