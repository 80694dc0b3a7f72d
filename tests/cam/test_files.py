"""Files of every format: which reader takes them, bytes, size, and the same drawing in all three."""

from __future__ import annotations

import io
import itertools
import re
import tracemalloc
from collections import deque
from collections.abc import Iterable, Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.base.parameters import FileError, Place
from isel_twin.cam.reader import LONGEST, head_of, mostly, text_lines
from isel_twin.cam.registry import reader_for, reader_named, reader_names
from isel_twin.cam.settings import CamSettings, read_cam
from isel_twin.cam.toolpath import CamError, Element, End
from isel_twin.language import create_language
from tests.cam.short import UP, cautions, told
from tests.cam.test_excellon import ALTIUM, EAGLE, KICAD, PCB
from tests.cam.test_gcode import PRODUCERS as GCODE
from tests.cam.test_gcode import PROGRAMS
from tests.cam.test_hpgl import FIGURES, PEN, STAR
from tests.cam.test_ncp import HOLES, LINES, OUTPUTS, RELATIVE, RINGS
from tests.cam.test_ncp import PRODUCERS as NCP
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=6)

FILES = [
    *(("ncp", text) for text in (LINES, RINGS, HOLES, RELATIVE, OUTPUTS, *NCP.values())),
    *(("gcode", text) for text in (*PROGRAMS, *GCODE.values())),
    *(("excellon", text) for text in (KICAD, EAGLE, ALTIUM, PCB)),
    *(("hpgl", text) for text in (STAR, FIGURES, "IN;\nPU0,0;\nPD400,0;\n", "\x1b%0BIN;PU;PA40.0,40.0;")),
]


@pytest.mark.parametrize(("name", "text"), FILES)
def test_a_file_is_known_by_its_content(name: str, text: str) -> None:
    for suffix in ("", ".txt", ".ncp", ".nc", ".plt"):
        reader = reader_for(text, suffix)
        assert reader is not None
        assert reader.name == name


def test_the_suffix_decides_where_the_content_does_not() -> None:
    unclear = "T1\n(nothing)\n"
    assert reader_for(unclear) is None
    assert [reader_for(unclear, suffix).name for suffix in (".NC", ".ncp", ".plt")] == ["gcode", "ncp", "hpgl"]
    assert reader_for("@07\n", ".nc") is None


def test_readers_by_name() -> None:
    assert reader_names() == ["excellon", "gcode", "hpgl", "ncp"]
    assert [reader_named(name).title for name in reader_names()] == ["Excellon", "G-code", "HPGL", "NCP"]
    with pytest.raises(ValueError, match="unknown format 'dxf'; installed: excellon, gcode, hpgl, ncp"):
        reader_named("dxf")


def test_every_line_end_and_both_encodings() -> None:
    data = "a Größe\r\nb\rc\n\nd".encode() + "Größe\n".encode("latin-1") + b"last"
    assert list(text_lines(io.BytesIO(data))) == ["a Größe\n", "b\n", "c\n", "\n", "dGröße\n", "last"]


def test_the_same_drawing_in_three_formats() -> None:
    ncp = (
        "IMF_PBL\nVEL 10000\nFASTABS Z5000\nFASTABS X10000 Y10000\nVEL 5000\nMOVEABS Z-500\nVEL 10000\nMOVEABS X30000\n"
    )
    ncp += "CCWABS I30000 J20000 X30000 Y30000\nFASTABS Z5000\nPROGEND\n"
    gcode = "G21 G90\nG0 Z5\nG0 X10 Y10\nG1 Z-.5 F300\nX30 F600\nG3 Y30 J10\nG0 Z5\nM2\n"
    hpgl = "IN;PU400,400;PD1200,400;AA1200,800,180;PU;"
    paths = [told("ncp", ncp), told("gcode", gcode), told("hpgl", hpgl, PEN)]
    assert paths[0] == paths[1] == paths[2]
    assert paths[0][4] == "arc 30 30 -0.5 about 30 20 ccw F10"


def lines(name: str, number: int) -> Iterator[str]:
    """A file of so many lines, of which the last one is wrong."""
    begin, line, last = {
        "ncp": ("IMF_PBL\nVEL 100\n", "MOVEABS X{} Y{}\n", "MOVEABS Q5\n"),
        "gcode": ("G21\nG1 F100 X0\n", "X{} Y{}\n", "X1 Q5\n"),
        "hpgl": ("IN;\nPD;\n", "PA{},{};\n", "PE1;\n"),
        "excellon": ("METRIC,TZ\nT1\n", "X{}Y{}\n", "X1 Q5\n"),
    }[name]
    yield from begin.splitlines(keepends=True)
    for at in range(number - 3):
        yield line.format(at % 100, -at % 50)
    yield last


def refused(path: Iterable[Element]) -> str:
    """The error that ends it."""
    with pytest.raises(CamError) as caught:
        deque(path, maxlen=0)
    return str(caught.value)


@pytest.mark.parametrize("name", ["ncp", "gcode", "hpgl", "excellon"])
def test_a_file_is_not_kept(name: str) -> None:
    refused(reader_named(name).read(lines(name, 10), PEN))  # loads what it needs
    tracemalloc.start()
    try:
        error = refused(reader_named(name).read(lines(name, 10_000), PEN))
        assert tracemalloc.get_traced_memory()[1] < 1_000_000
    finally:
        tracemalloc.stop()
    assert error.startswith("line 10000, column ")


@pytest.mark.parametrize(
    ("name", "remark", "number"), [("ncp", ";\n", 99_999), ("gcode", "()\n", 99_999), ("hpgl", "\n", 999_999)]
)
def test_an_error_at_the_end_of_a_million_lines(name: str, remark: str, number: int) -> None:
    """Or of a hundred thousand, where a line takes longer to read."""
    remarks = itertools.repeat(remark, number - 5_000)
    error = refused(reader_named(name).read(itertools.chain(remarks, lines(name, 5_000)), PEN))
    assert error.startswith(f"line {number}, column ")


def test_a_plot_in_one_line_needs_little_memory() -> None:
    data = b"IN;PU0,0;PD" + b",".join(b"%d,%d" % (at % 1000, at % 777) for at in range(30_000)) + b";PU;?"
    tracemalloc.start()
    try:
        error = refused(reader_named("hpgl").read(text_lines(io.BytesIO(data)), PEN))
        assert tracemalloc.get_traced_memory()[1] < 2_000_000
    finally:
        tracemalloc.stop()
    assert error.startswith(f"line 1, column {len(data)}: '?' is no instruction")
    assert len(data) > 3 * LONGEST


@pytest.mark.parametrize("name", ["ncp", "gcode"])
def test_a_line_in_pieces_is_refused_with_its_own_number(name: str) -> None:
    """No piece is taken for a line: the number of the next line would be wrong, and a number cut in two."""
    begin = {"ncp": b"IMF_PBL\nVEL 9\n", "gcode": b"G21 F60\nG1 X0\n"}[name]
    data = begin + b" " * (LONGEST - 1) + b"X12\n"
    error = refused(reader_named(name).read(text_lines(io.BytesIO(data)), PEN))
    assert error.startswith(f"line 3, column 1: the line is longer than {LONGEST} characters")


WORDS = st.lists(
    st.sampled_from(
        [
            *("MOVEABS", "FASTABS", "CWABS", "DRILL", "DRILLDEF", "X1000", "Y-5", "I5", "SPINDLE", "IMF_PBL", "VEL 5"),
            *(
                "G1",
                "G2",
                "G81",
                "X1",
                "Y",
                "Z-2",
                "R1",
                "F5",
                "M3",
                "(",
                ")",
                ";",
                "%",
                "G21",
                "#1",
                "[",
                "N5",
                "O1",
                "L9",
            ),
            *(
                "PU",
                "PD",
                "1,1",
                "AA0,0,90",
                "CI5",
                "PM0",
                "PM2",
                "EP",
                "SC",
                "IP0,0,9,9",
                "LB",
                "\x03",
                "\x1b.",
                "\n",
                " ",
            ),
        ]
    ),
    max_size=40,
).map(lambda words: "".join(words).encode())


@pytest.mark.parametrize("name", ["ncp", "gcode", "hpgl", "excellon"])
@given(data=st.one_of(st.binary(max_size=300), WORDS, WORDS.map(lambda data: b"IMF_PBL\nVEL 9\n" + data)))
@settings(max_examples=drawn(150), deadline=None)
def test_any_bytes_are_read_or_refused_in_one_line(name: str, data: bytes) -> None:
    head = data.decode("latin-1")
    assert reader_for(head) is None or reader_for(head).name in reader_names()
    made, error = [], None
    try:
        made.extend(reader_named(name).read(text_lines(io.BytesIO(data)), PEN))
    except CamError as caught:
        error = caught
    if error is None:
        assert [type(element) for element in made].index(End) == len(made) - 1
    else:
        assert "\n" not in str(error)
        assert error.place is not None


@pytest.mark.parametrize(
    ("data", "why"),
    [
        (b"\x1f\x8b\x08\x00", "is packed by gzip"),
        (b"PK\x03\x04", "is a zip archive"),
        (b"%PDF-1.4\n%", "is a PDF"),
        ("G21\nG0 X1\n".encode("utf-16"), "is UTF-16"),
        ("G21\nG0 X1\n".encode("utf-16-le"), "is no text, or UTF-16"),
    ],
)
def test_what_is_no_text_says_what_it_is(data: bytes, why: str) -> None:
    with pytest.raises(CamError, match=f"^line 1, column 1: the file {why}"):
        head_of(data)


def test_the_marks_of_editors_and_of_old_systems_are_no_text() -> None:
    """A mark of UTF-8 before it, Ctrl-Z behind it; a 0 that pstoedit leaves in a remark."""
    marked = b"\xef\xbb\xbfIMF_PBL\r\nVEL 9\r\n\x1a\x00\x00"
    assert list(text_lines(io.BytesIO(marked))) == ["IMF_PBL\n", "VEL 9\n"]
    assert list(text_lines(io.BytesIO(b"(by a program\0)\nG21\n"))) == ["(by a program\0)\n", "G21\n"]


def test_tabs_and_a_few_marks_of_plotters_are_text() -> None:
    """Four control characters are; five in the first 512 bytes are not, behind them they are."""
    for mark in b"\x03\t\x0b\x0c\r\x1b":
        assert head_of(b"LB" + 5 * bytes([mark]) + b";G1 X1\n")
    assert head_of(b"G1 X\x01\x02\x04\x05\n")
    assert head_of(b"G1 X1\n" * 100 + b"\x01\x02\x04\x05\x06\n")
    with pytest.raises(CamError, match="the file is no text"):
        head_of(b"G1 X\x01\x02\x04\x05\x06\n")


@pytest.mark.parametrize(
    ("reader", "text", "said"),
    [
        ("ncp", "IMF_PBL\nVEL 10000\nFASTABS Z5\nMOVEABS Z-3\nMOVEABS X100\nPROGEND\n", "3 um below"),
        ("gcode", "G21 G90 F60\nG0 Z1\nG1 Z-0.003\nM2\n", "3 um below"),
        ("ncp", "IMF_PBL\nVEL 10000\nFASTABS Z5000\nMOVEABS Z-3000\nPROGEND\n", ""),
        ("gcode", "G21 G90 F60\nG0 Z1\nG1 Z-0.02\nM2\n", ""),
        ("gcode", "G21 G90 F60\nG0 Z9\nG1 Z0\nM2\n", ""),
    ],
)
def test_a_cut_of_some_micrometres_is_said_to_be_in_another_unit(reader: str, text: str, said: str) -> None:
    """NCP counts in 1/1000 mm."""
    found = cautions(reader, text)
    assert [said in one for one in found] == [True] * bool(said)


def test_a_file_that_cuts_as_high_as_it_travels_is_plausible() -> None:
    assert told("gcode", "G21 G90 F60\nG0 X1\nG1 X2\nM2\n", UP) == ["rapid 1 0 0", "line 2 0 0 F1", "end"]
    assert told("gcode", "G21 G90 F60\nG0 X1\nG1 X2 Z0.001\nM2\n", UP)[-2:] == ["caution", "end"]
    for body in (
        "G0 X1 Z5\nG1 X2 Z1",
        "G0 X1\nG1 Z-1\nX2\nZ5\nG0 X0",  # drawn back by a feed, as posts without rapids write it
        "G0 X1 Z5\nG1 Z-9\nX2\nG0 Z-8\nX1\nG1 X2 Z-2\nG0 Z-8\nX0\nG1 Z-2\nG0 Z5",  # rapids within a pocket
    ):
        assert "caution" not in told("gcode", f"G21 G90 F60\n{body}\nM2\n", UP)


def test_a_format_is_claimed_by_more_than_a_quarter_of_its_statements() -> None:
    pattern = re.compile("G")
    assert not mostly("G1\nG2\n" + "X\n" * 6, pattern)
    assert mostly("G1\nG2\nG3\n" + "X\n" * 5, pattern)


def test_a_file_is_known_behind_any_number_of_remarks() -> None:
    for begins in (b"; a tool\n" * 3000, b"\n" * 3000, b" " * 300_000):
        assert reader_for(head_of(begins + b"G21 G90\nG0 X1\n")).name == "gcode"


def test_a_line_of_blanks_takes_no_longer_than_its_length() -> None:
    """Expressions that look for what is optional behind blanks would take hours."""
    language = create_language("bwo900")
    assert not language.claims(" " * 300_000 + "G1 X1\n")
    assert language.claims(" " * 300_000 + "\n" + " " * 300_000 + "N10 G1 X1\n")


def test_settings_are_read_from_a_table() -> None:
    content = {
        "zero": [1, 2, 3],
        "zeros": {"2": [4, 5, 6]},
        "z_sign": 1,
        "dialect": "din",
        "tool_length_mm": {"1": 32.5},
    }
    content |= {"outputs": {"A4.1": 3}, "park": [0, 0, 0], "strict": True, "feed_mm_s": 5}
    assert read_cam(content, Place("isel-twin.toml", key="cam")) == CamSettings(
        zero=(1.0, 2.0, 3.0), zeros={2: (4.0, 5.0, 6.0)}, z_sign=1, dialect="din", tool_length_mm={1: 32.5},
        outputs={"A4.1": 3}, park=(0.0, 0.0, 0.0), strict=True, feed_mm_s=5.0,
    )  # fmt: skip
    assert read_cam({}, Place("isel-twin.toml")) == CamSettings()


@pytest.mark.parametrize(
    ("content", "error"),
    [
        ({"zeroo": [1, 2, 3]}, "cam.zeroo: unknown key; did you mean 'zero'?"),
        ({"zero": [1, 2]}, "cam.zero: [1, 2]; allowed: three numbers [x, y, z], mm"),
        ({"zero": [1, 2, float("nan")]}, "cam.zero: nan; allowed: -100000 .. 100000 mm"),
        ({"zeros": {"12": [1, 2, 3]}}, "cam.zeros.12: is no number; allowed: 1 .. 9"),
        ({"zeros": 3}, "cam.zeros: 3; allowed: a table such as { name = value }"),
        ({"z_sign": 0}, "cam.z_sign: 0; allowed: 1, -1"),
        ({"rapid_mm_s": -1}, "cam.rapid_mm_s: -1; allowed: 0.001 .. 10000 mm/s"),
        ({"dialect": "fanuc"}, "cam.dialect: 'fanuc'; allowed: \"\", rs274, din, winpc"),
        ({"strict": 1}, "cam.strict: 1; allowed: true, false"),
        ({"outputs": {"spindle": 1.5}}, "cam.outputs.spindle: 1.5; allowed: a whole number"),
    ],
)
def test_settings_that_are_wrong_are_one_line(content: dict[str, object], error: str) -> None:
    with pytest.raises(FileError) as caught:
        read_cam(content, Place("isel-twin.toml", key="cam"))
    assert str(caught.value) == f"isel-twin.toml: {error}"


@pytest.mark.parametrize("wrong", [{"z_sign": 0}, {"rapid_mm_s": 0.0}, {"zero": (1, 2)}, {"zeros": {10: (0, 0, 0)}}])
def test_settings_in_python_are_checked(wrong: dict[str, object]) -> None:
    with pytest.raises(ValueError, match=next(iter(wrong))):
        CamSettings(**wrong)


def test_a_reader_stops_at_the_end_of_the_program() -> None:
    endless = iter(["G21\n", "M2\n", "never read"])
    assert told("gcode", endless, UP) == ["end"]
    assert next(endless) == "never read"


@pytest.mark.parametrize(
    ("content", "what"),
    [
        (b"  0\r\nSECTION\r\n  2\r\nHEADER\r\n", "a DXF drawing"),
        (b"999\ndxfrw 0.6.3\n  0\nSECTION\n", "a DXF drawing"),
        (b'<?xml version="1.0"?>\n<!-- made by Inkscape -->\n<svg width="10">\n', "an SVG drawing"),
        (b"<!DOCTYPE html>\n<html>\n", "XML or HTML"),
        (b"solid cube\nfacet normal 0 0 1\n", "an STL body"),
        (b"ISO-10303-21;\nHEADER;\n", "a STEP body"),
        (b"%!PS-Adobe-3.0 EPSF-3.0\n", "PostScript"),
        (b"G04 a board*\n%FSLAX46Y46*%\n%MOMM*%\n", "a Gerber drawing"),
        (b"P1\nG90 G0 X1\nM30\n", "a program of the BWO 900 without numbers of blocks"),
        (b"\x89PNG\r\n\x1a\n", "a picture"),
        (b'{"a": 1}\n', "JSON"),
        (b'[\n  {"x": 1}]\n', "JSON"),
        (b"[1, 2]\n", "JSON"),
        (b"<a>1</a>\n", "XML or HTML"),
        (b"[cam]\nzero = [1, 2, 3]\n", "a table of settings"),
        (b"G1 X\x01\x02\x04\x05\x06\x07\x10", "no text"),
    ],
)
def test_what_is_no_job_is_named(content: bytes, what: str) -> None:
    with pytest.raises(CamError, match=f"the file is {what}"):
        head_of(content)


@pytest.mark.parametrize(
    "content",
    [
        b"<0.5s>\n<64>@07\n",
        b"P1\nN10 G0 X1\n",
        b"\x1b%0BIN;LBa\x03;PU;\n",
        b"PU1,1;\n",
        b"M48\nG21 G90\nG0 X1\nM2\n",  # LinuxCNC: overrides count
        b"M48\nT1 M6\nG0 X1\nM2\n",
    ],
)
def test_jobs_are_not_taken_for_drawings(content: bytes) -> None:
    assert head_of(content)


@pytest.mark.parametrize(
    ("content", "suffix", "what"),
    [
        (b"#axis xyz;\n#steps 80,80,80;\n#input\nreference xyz;\nmove 10(5000),0(3000);\nstop.\n", ".pal", "PAL-PC"),
        (b"; a plate\n{ by hand }\n#axis xyz;\nreference xyz;\nmoverel 10(5000),0(3000);\nstop.\n", ".txt", "PAL-PC"),
        (b"ProgBegin\nFastVel 50.0\nRef xyz\nFastAbs X10.0 Y5.0\nProgEnd\n", ".iso", "ProNC"),
        (b"N1 ProgBegin\nN2 FOR R1 = 1, 10, 1\nN3 MoveAbs X10 Y20\nN4 ENDFOR\nN5 ProgEnd\n", ".pal", "ProNC"),
        (b'G21 G90\nmsg "insert the tool"\nG0 X5\nM30\n', ".nc", "EdingCNC"),
        (b"G21 G90\nG0 X5\ngosub change_tool\nM30\n", ".cnc", "EdingCNC"),
    ],
)
def test_sources_of_other_programs_are_named(content: bytes, suffix: str, what: str) -> None:
    with pytest.raises(CamError, match=what):
        deque(reader_for(head_of(content), suffix).read(text_lines(io.BytesIO(content)), UP), maxlen=0)
