"""A part of a job file: what holds at its first line, how the tool comes there, and how it ends."""

from __future__ import annotations

import math
from itertools import pairwise
from random import Random

import pytest
from cam.played import check_made
from cam.random_paths import random_path
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.cam.registry import reader_named
from isel_twin.cam.section import LineRange, Section
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, CamError, Element, Line, Place, Point, Rapid
from tests.cam.short import UP, short
from tests.thorough import drawn

CONTOUR = """(plate)
G21 G90 G17 G94
T1 M6
M3 S12000
G4 P2
M8
G0 Z5
G0 X10 Y10
G1 Z-2 F120
G1 X40 F600
Y40
G2 X50 Y50 I10 J0
G1 X60
G0 Z5

(holes)
G81 X80 Y20 Z-4 R1 F90
X90
X100
G80
T2 M6
M3
G0 X20 Y60
G1 Z-1 F100
X30
G0 Z5
M9
M5
M30
"""
TOOL_1 = ["tool 1", "spindle cw 12000 wait 2", "coolant 1 on"]


def part(text: str, first: int = 1, last: int | None = None, name: str = "gcode", known: CamSettings = UP) -> list[str]:
    """The elements of these lines in short words."""
    path = reader_named(name).read(text.splitlines(keepends=True), known)
    return [short(element) for element in Section(LineRange(first, last), known).made(path)]


def not_made(text: str, first: int = 1, last: int | None = None) -> str:
    section = Section(LineRange(first, last), UP)
    list(section.made(reader_named("gcode").read(text.splitlines(), UP)))
    return section.not_made


def test_in_a_contour_the_tool_comes_down_where_the_line_begins() -> None:
    """Spindle on for as long as the file waits for its speed, up to 5 mm, across, and from there on at the feed of the
    file's plunge, 120 mm/min, to the depth."""
    begin = [*TOOL_1, "rapid 0 0 5", "rapid 40 10 5", "line 40 10 -2 F2", "line 40 40 -2 F10"]
    assert part(CONTOUR, 11)[: len(begin)] == begin


def test_an_arc_begins_where_it_begins() -> None:
    begin = ["rapid 0 0 5", "rapid 40 40 5", "line 40 40 -2 F2", "arc 50 50 -2 about 50 40 cw F10"]
    assert part(CONTOUR, 12)[3:7] == begin


@pytest.mark.parametrize("first", [14, 15, 16, 17])
def test_a_rapid_is_led_to_its_end_and_a_blank_line_to_the_next_motion(first: int) -> None:
    """Line 14 is a retract out of the slot, into which nothing leads; behind it come a blank line and a remark."""
    made = part(CONTOUR, first)
    assert made[:3] == TOOL_1
    assert "line 60 50 -2 F2" not in made
    over = ["rapid 0 0 5", "rapid 60 50 5", "rapid 60 50 5"] if first == 14 else ["rapid 0 0 5"]
    assert made[3 : 3 + len(over)] == over
    assert made[3 + len(over) :][:3] == (
        ["rapid 80 20 5", "rapid 80 20 1", "line 80 20 -4 F1.5"]
        if first == 14
        else ["rapid 80 20 5", "rapid 80 20 5", "rapid 80 20 1"]
    )


def test_within_a_series_of_holes_the_cycle_holds() -> None:
    assert part(CONTOUR, 18)[3:8] == [
        "rapid 0 0 5", "rapid 90 20 5", "rapid 90 20 5", "rapid 90 20 1", "line 90 20 -4 F1.5"
    ]  # fmt: skip


@pytest.mark.parametrize("first", [20, 21, 22, 23])
def test_between_the_change_of_a_tool_and_the_cut_only_that_tool_is_asked_for(first: int) -> None:
    """Its spindle has the speed that was told before, and no wait that the file has not."""
    made = part(CONTOUR, first)
    assert made[:3] == ["coolant 1 on", "tool 2", "spindle cw 12000"]
    assert made[3:6] == ["rapid 0 0 5", "rapid 20 60 5", "rapid 20 60 5"]
    assert made[6:8] == ["line 20 60 -1 F1.6667", "line 30 60 -1 F1.6667"]


def test_an_end_lifts_the_tool() -> None:
    assert part(CONTOUR, last=10)[-3:] == ["line 40 10 -2 F10", "rapid 40 10 5", "end"]
    assert part(CONTOUR, 12, 12)[-3:] == ["arc 50 50 -2 about 50 40 cw F10", "rapid 50 50 5", "end"]
    assert part(CONTOUR, last=14)[-2:] == ["rapid 60 50 5", "end"]


@pytest.mark.parametrize(
    ("first", "last", "told"),
    [
        (1, None, ""),
        (1, 99, ""),
        (2, None, ""),
        (8, None, "lines 1 to 7"),
        (1, 12, "all after line 12"),
        (12, 12, "lines 1 to 11 and all after line 12"),
    ],
)
def test_what_was_left_out_is_known(first: int, last: int | None, told: str) -> None:
    assert not_made(CONTOUR, first, last) == told


def test_the_first_line_alone_is_one() -> None:
    assert not_made("G0 X1\nG0 X2\nM2\n", 2) == "line 1"


def test_what_is_behind_the_end_of_the_part_is_not_read() -> None:
    assert part("G21\nG0 X1\nG0 X2\nG41 D1\n", last=3)[-2:] == ["rapid 2 0 0", "end"]
    with pytest.raises(CamError, match="line 4"):
        part("G21\nG0 X1\nG0 X2\nG41 D1\n", last=4)


@pytest.mark.parametrize(
    ("first", "last", "told"),
    [
        (27, None, "nothing moves the tool from line 27 on: its last motion before is in line 26"),
        (999, None, "nothing moves the tool from line 999 on: its last motion before is in line 26"),
        (15, 16, "in lines 15 to 16: its last motion before is in line 14, it goes on in line 17"),
        (1, 3, "in lines 1 to 3: it goes on in line 4"),
    ],
)
def test_a_part_without_motion_is_refused(first: int, last: int | None, told: str) -> None:
    with pytest.raises(CamError) as caught:
        part(CONTOUR, first, last)
    assert told in str(caught.value)


@pytest.mark.parametrize(("first", "last"), [(0, None), (-3, None), (5, 4)])
def test_lines_that_cannot_be_are_refused(first: int, last: int | None) -> None:
    with pytest.raises(ValueError, match=r"(from|to)-line"):
        LineRange(first, last)


def test_units_zeros_and_modes_are_those_of_the_line() -> None:
    """Inch, incremental, in G55 at X 100: line 5 leads from X 100 + 25.4 by 25.4 mm, at 254 mm/min."""
    text = "G20 G90 G55 F10\nG0 X1 Y0 Z0.2\nG1 Z-0.1\nG91\nX1\nM2\n"
    known = CamSettings(z_sign=1, zeros={2: (100.0, 0.0, 0.0)})
    assert part(text, 5, known=known)[-3:] == ["line 125.4 0 -2.54 F4.2333", "line 150.8 0 -2.54 F4.2333", "end"]


def test_the_same_part_of_other_formats() -> None:
    """A slot of 20 mm, from its second half on."""
    ncp = "IMF_PBL_V1.0\nGETTOOL 3\nSPINDLE CW RPM9000\nVEL 5000\nFASTABS Z5000\nFASTABS X10000 Y10000\nMOVEABS Z-500\n"
    ncp += "MOVEABS X20000\nMOVEABS X30000\nPROGEND\n"
    made = part(ncp, 9, name="ncp")
    assert made[:2] == ["tool 3", "spindle cw 9000"]
    slot = ["rapid 0 0 5", "rapid 20 10 5", "line 20 10 -0.5 F5", "line 30 10 -0.5 F5"]
    assert [words for words in made if words in slot] == slot
    hpgl = "IN;\nSP3;\nPU400,400;\nPD800,400;\nPD1200,400;\nPU;\n"
    pen = CamSettings(z_sign=1, feed_mm_s=5.0)
    drawn_from = part(hpgl, 5, name="hpgl", known=pen)
    assert [words for words in drawn_from if words in ["tool 3", *slot]] == ["tool 3", *slot]


def test_a_file_that_lifts_high_between_its_parts_does_not_crawl_down_all_the_way() -> None:
    """It travels at 50 mm and begins its plunges at 2: so does the part."""
    text = "G21 F60\nG0 Z50\nG0 X10\nG0 Z2\nG1 Z-1\nX20\nX30\nM2\n"
    assert part(text, 7)[:4] == ["rapid 0 0 50", "rapid 20 0 50", "rapid 20 0 2", "line 20 0 -1 F1"]


def test_a_reference_run_is_where_it_stands() -> None:
    """Of X alone, in the work by the file: made from where the tool is, and then the cut goes on from X 0."""
    text = "G21 F60\nG0 Z5\nG1 Z-1\nX20\nG74 X0\nX3\nM2\n"
    known = CamSettings(z_sign=1, dialect="din", start=(7.0, 0.0, 0.0))
    cut = ["rapid 0 0 5", "line 0 0 -1 F1", "line 3 0 -1 F1", "end"]
    assert part(text, 5, known=known) == ["reference X", "rapid 0 0 5", *cut]
    assert part(text, 6, known=known) == ["rapid 7 0 5", *cut]


def test_outputs_and_coolant_are_as_they_were_last() -> None:
    text = "G21 F60\nM70\nM71\nM-70\nM7\nM8\nM9\nG0 Z2\nG1 Z-1\nX9\nM2\n"
    din = CamSettings(z_sign=1, dialect="din")
    assert part(text, 10, known=din)[:2] == ["output M71 1=1", "output M70 1=0"]


def numbered(seed: int) -> list[Element]:
    """A random path, an element a line."""
    path = random_path(Random(seed), most=8)
    return [element._replace(place=Place(number)) for number, element in enumerate(path, 1)]


@settings(max_examples=drawn(200), deadline=None)
@given(st.integers(0, 2**32), st.integers(2, 9))
def test_no_rapid_leads_through_what_stands(seed: int, first: int) -> None:
    """Whatever the file does: the lines are made as they are, from where they begin; the rapids before them go up, go
    across at least as high as any of the file before, and down no lower than a cut has begun, or than they lead."""
    path = numbered(seed)
    first = min(first, len(path) - 1)
    known = CamSettings(start=(0.0, 0.0, 70.0))
    own = path[first - 1 : -1]
    made = list(Section(LineRange(first), known).made(iter(path)))
    before = made[: -len(own) - 1]
    assert made[len(before) : -1] == own
    rapids = [element.to[2] for element in path[: first - 1] if isinstance(element, Rapid)]
    highest = max([-70.0, *rapids])
    at: Point = (0.0, 0.0, -70.0)
    begins = own[0].to if isinstance(own[0], Rapid) else path[first - 2].to  # type: ignore[union-attr]
    entries = [
        old.to[2] for old, new in pairwise(path[: first - 1]) if isinstance(old, Rapid) and isinstance(new, Line | Arc)
    ]
    for element in before:
        assert isinstance(element, Rapid | Line)
        across = element.to[:2] != at[:2]
        if isinstance(element, Rapid):
            assert not across or min(at[2], element.to[2]) >= highest
            assert element.to[2] >= min([max([begins[2], *entries]), highest]) or element.to[2] >= begins[2]
        else:
            assert not across
            assert element.to[2] < at[2]
        at = element.to
    assert math.dist(at, begins) == 0.0


@pytest.mark.long(seconds=6)
@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_every_controller_makes_a_part(controller: str) -> None:
    known = CamSettings(rapid_mm_s=30.0, tolerance_mm=0.002)
    for seed, first in ((1, 3), (5, 2), (9, 4)):
        path = numbered(seed)
        lines = LineRange(min(first, len(path) - 1))
        check_made(controller, list(Section(lines, known).made(iter(path))), known)
