"""HPGL: two plots with what they must draw; what producers write; what is wrong."""

from __future__ import annotations

import dataclasses

import pytest

from isel_twin.cam.hpgl import Hpgl
from isel_twin.cam.toolpath import Arc, CamError, Line, Point, Rapid
from tests.cam.short import UP, cautions, length, told

PEN = dataclasses.replace(UP, feed_mm_s=10.0)
UPWARDS, DOWN, RAISED = "rapid 0 0 5", "-0.5", "5"
STAR = "IN;SP1;PU400,400;PD1200,400,1200,800;PU;PA0,0;SP0;"
FIGURES = "IN;SP1;PU800,800;CI400;PR400,0;PD;AA800,800,180;ER200,-100;PU;SP;"


def drawn(text: str) -> tuple[float, float]:
    """Millimetres with the pen down and in the air, straight up and down left out."""
    at: Point = (0.0, 0.0, 0.0)
    ways = [0.0, 0.0]
    for element in Hpgl().read([text], PEN):
        if isinstance(element, Rapid | Line | Arc):
            if element.to[:2] != at[:2] or isinstance(element, Arc):
                ways[isinstance(element, Rapid)] += length(element, at)
            at = element.to
    return round(ways[0], 3), round(ways[1], 3)


def test_lines() -> None:
    assert told("hpgl", STAR, PEN) == [
        "rapid 0 0 5",
        "tool 1",
        "rapid 10 10 5",
        "line 10 10 -0.5 F5",
        "line 30 10 -0.5 F10",
        "line 30 20 -0.5 F10",
        "rapid 30 20 5",
        "rapid 0 0 5",
        "end",
    ]
    assert drawn(STAR) == (30.0, round(14.142 + 36.056, 3))


def test_circle_arc_and_rectangle() -> None:
    assert told("hpgl", FIGURES, PEN) == [
        "rapid 0 0 5",
        "tool 1",
        "rapid 20 20 5",
        "rapid 30 20 5",
        "line 30 20 -0.5 F5",
        "arc 30 20 -0.5 about 20 20 ccw F10",
        "rapid 30 20 5",
        "rapid 20 20 5",
        "rapid 30 20 5",
        "line 30 20 -0.5 F5",
        "arc 10 20 -0.5 about 20 20 ccw F10",
        "line 15 20 -0.5 F10",
        "line 15 17.5 -0.5 F10",
        "line 10 17.5 -0.5 F10",
        "line 10 20 -0.5 F10",
        "rapid 10 20 5",
        "end",
    ]
    assert drawn(FIGURES)[0] == pytest.approx(62.832 + 31.416 + 15, abs=1e-3)


@pytest.mark.parametrize(
    ("text", "path"),
    [
        ("PU0,0;PD;AR400,0,-90;", "arc 10 10 -0.5 about 10 0 cw F10"),
        ("PU400,0;PD;AT0,400,-400,0;", "arc -10 0 -0.5 about 0 0 ccw F10"),
        ("PU400,0;PD;RT-400,-400,-800,0;", "arc -10 0 -0.5 about 0 0 cw F10"),
        ("PU700,1200;PD;AT400,1300,-100,800;", "arc -2.5 20 -0.5 about 10 20 ccw F10"),
        ("PU700,1200;PD;RT200,-400,-300,-900;", "arc 10 7.5 -0.5 about 10 20 cw F10"),
        ("PU400,0;PD;AT0,400,-400,0,5;", "arc -10 0 -0.5 about 0 0 ccw F10"),
        ("PU400,0;PD;AA0,0,90,5;", "arc 0 10 -0.5 about 0 0 ccw F10"),
        ("PU0,0;PD;AR400,0,-90,5;", "arc 10 10 -0.5 about 10 0 cw F10"),
        ("PU400,0;PD;AT800,0,1200,0;", "line 30 0 -0.5 F10"),
        ("PU400,0;PD;AA0,0,720;", "arc 10 0 -0.5 about 0 0 ccw x2 F10"),
        ("IP0,0,8128,8128;SC0,10000,0,10000;PU0,0;PD10000,5000;", "line 203.2 101.6 -0.5 F10"),
        ("IP0,0,8128,8128;SC0,10000,0,10000;SC;PU0,0;PD400,0;", "line 10 0 -0.5 F10"),
        ("PU0,0;PM0;PD400,0,400,400;PM2;EP;", "line 0 0 -0.5 F10"),
        ("PU0,0;EW400,0,90;", "arc 0 10 -0.5 about 0 0 ccw F10"),
        ("pu0 0pd400 0", "line 10 0 -0.5 F10"),
        ("PU;PA40.0000,40.0000;PD;PA80.0000,40.0000;", "line 2 1 -0.5 F10"),
        ("\x1b.(\x1b.I81;;17:IN;PU0,0;PD400,0;", "line 10 0 -0.5 F10"),
        ("\x1bE\x1b%0BIN;PU0,0;PD400,0;", "line 10 0 -0.5 F10"),
        ("LBPD9,9;\x03PU0,0;PD400,0;", "line 10 0 -0.5 F10"),
        ("DT#;LBPD9,9;#PU0,0;PD400,0;", "line 10 0 -0.5 F10"),
        ("BP;IN;PS0;IP0,0,8128,8128;SC0,10000,0,10000;WU1;SP1;TR0;LT;LA1,4;PW0;PU0,0;PM0;PD1000,0;PM2;EP;",
         "line 20.32 0 -0.5 F10"),
        ("IN;VS32;FS8;PU0,0;PD0,90,40,90;", "line 1 2.25 -0.5 F10"),
    ],
)  # fmt: skip
def test_instructions(text: str, path: str) -> None:
    assert path in told("hpgl", text, PEN)
    assert "line 9 9" not in " ".join(told("hpgl", text, PEN))


@pytest.mark.parametrize(
    ("text", "caution"),
    [
        ("PU0,0;PD400,0,5;", "a number too many: points are pairs, the last number is left out"),
        ("PU0,0;XX5,5;PD400,0;XX;", "XX is not known and left out"),
        ("LBtext\x03;LBmore\x03;", "LB: text is not drawn"),
        ("PU0,0;RR400,400;", "RR fills an area: only its edge is drawn"),
        ("IW0,0,100,100;", "IW: the window is not kept: everything is drawn"),
    ],
)
def test_what_is_left_out_is_said_once(text: str, caution: str) -> None:
    assert cautions("hpgl", text, PEN) == [caution]


@pytest.mark.parametrize(
    ("text", "error"),
    [
        ("PU0,0;\nPE<=>;", "line 2, column 1: PE is refused: let the program that made it write PD"),
        ("ZP5,5;", "line 1, column 1: ZP is refused: heights are in safe_mm and depth_mm"),
        ("RO90;", "line 1, column 1: RO is refused: turn the drawing in the program that made it"),
        ("SC0,1,0,1;", "line 1, column 1: SC without IP: the size of the plotter is not known; write IP before it"),
        ("IP0,0,9,9;SC0,1,0,1,1;", "line 1, column 11: SC of type 1 or 2 is not read; let the program that made it"),
        ("IP0,0,9,18;SC0,1,0,1;CI1;", "line 1, column 22: a circle under SC with different scales is an ellipse"),
        ("IP0,0,9,18;SC0,1,0,1;AA1,1,90;", "line 1, column 22: a circle under SC with different scales is an ellipse"),
        ("IP0,0,9,18;SC0,1,0,1;AT1,1,2,0;", "line 1, column 22: a circle under SC with different scales is an ellipse"),
        ("AT5,5,9;", "line 1, column 1: AT wants 4 numbers"),
        ("IN;?;", "line 1, column 4: '?' is no instruction of HPGL"),
        ("5,5;", "line 1, column 1: 5 stands behind no instruction"),
        ("AA5,5;", "line 1, column 1: AA wants 3 numbers"),
        ("PU99999999999,0;", "line 1, column 3: 99999999999 is out of range; allowed: up to 1e+09"),
        ("SP-1;", "line 1, column 1: SP must not be negative"),
    ],
)
def test_errors_name_the_place_and_the_remedy(text: str, error: str) -> None:
    with pytest.raises(CamError) as caught:
        told("hpgl", text, PEN)
    assert str(caught.value).startswith(error)


def test_a_plot_needs_a_feed() -> None:
    with pytest.raises(CamError, match="line 1, column 9: a plot has no feed; set feed_mm_s"):
        told("hpgl", "PU0,0;PD400,0;", UP)


def test_depths_and_lengths_are_of_the_pen() -> None:
    settings = dataclasses.replace(PEN, pen_depth_mm={2: 1.5}, tool_length_mm={2: 20.0}, zero=(1.0, 2.0, 3.0))
    assert told("hpgl", "SP1;PU0,0;PD400,0;SP2;PD800,0;SP0;", settings) == [
        "rapid 0 0 8", "tool 1", "rapid 1 2 8", "line 1 2 2.5 F5", "line 11 2 2.5 F10", "rapid 11 2 8", "tool 2",
        "rapid 11 2 28", "line 11 2 21.5 F5", "line 21 2 21.5 F10", "rapid 21 2 28", "end",
    ]  # fmt: skip


def test_polygon_of_two_parts_is_closed_twice() -> None:
    text = "PU0,0;PM0;PD400,0,400,400;PM1;PU800,0;PD1200,0,1200,400;PM2;EP;"
    lines = [move for move in told("hpgl", text, PEN) if move.startswith("line")]
    assert [move.removesuffix(" -0.5 F10") for move in lines if "F10" in move] == [
        "line 10 0", "line 10 10", "line 0 0", "line 30 0", "line 30 10", "line 20 0"
    ]  # fmt: skip


def test_a_polygon_has_100_000_points_and_no_more() -> None:
    text = "PU0,0;PM0;PD" + ",".join(["1,1"] * 100_000)
    assert told("hpgl", f"{text};PM2;", PEN)[-1] == "end"
    with pytest.raises(CamError, match="a polygon of more than 100000 points; draw it with PD"):
        told("hpgl", f"{text},1,1;PM2;", PEN)


@pytest.mark.parametrize(("degrees", "end", "sense"), [(90, "30 30", "ccw"), (-90, "10 10", "cw")])
def test_an_arc_by_an_angle_turns_about_its_centre(degrees: int, end: str, sense: str) -> None:
    """From (10, -10) beside the centre (20, 20)."""
    path = told("hpgl", f"IN;PU1200,400;PD;AA800,800,{degrees};PU;", PEN)
    (arc,) = [element for element in path if element.startswith("arc ")]
    assert arc.startswith(f"arc {end} ")
    assert f" about 20 20 {sense} " in arc


def test_speed_and_force_of_the_pen_are_told() -> None:
    assert [text[:2] for text in cautions("hpgl", "IN;VS10;AS2;FS3;VS20;PU0,0;PD100,0;PU;", PEN)] == ["VS", "AS", "FS"]
