"""Chamfers, roundings and radius correction at single corners: closed forms worked out by hand."""

from __future__ import annotations

import itertools
import math

import pytest
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import XY, Arc, Element, Straight
from isel_twin.firmware.bwo900.geometry.offset import Offset, corner_arc
from isel_twin.firmware.bwo900.geometry.plane import meetings, share_of
from isel_twin.firmware.bwo900.messages import ProgramError


def corrected(text: str, threshold: float | None = None, **parameters: float) -> list[PathBlock]:
    """The blocks of a program, corners and correction done."""
    blocks, contour, offset = list[PathBlock](), Contour(), Offset(threshold)
    for block in Analysed(text, **parameters).blocks:
        for done in contour.push(block):
            blocks += offset.push(done)
    for done in contour.flush():
        blocks += offset.push(done)
    return blocks + offset.flush()


def path(blocks: list[PathBlock]) -> list[Element]:
    return [element for block in blocks for element in block.elements]


def ends(blocks: list[PathBlock]) -> list[tuple[float, ...]]:
    return [tuple(round(x, 6) for x in element.end) for element in path(blocks)]


def refused(text: str, **parameters: float) -> int:
    with pytest.raises(ProgramError) as error:
        corrected(text, **parameters)
    return error.value.number


def test_a_chamfer_between_two_lines() -> None:
    """Legs of 5 on the lines (3, 4) / 5 and (1, 0): (21, 28) and (29, 32)."""
    blocks = corrected("N10 G1 F100 G12 P70:5 X24 Y32\nN15 P500:1\nN20 X60\nN30 M30")
    assert ends(blocks) == [(21.0, 28.0, 0.0), (29.0, 32.0, 0.0), (60.0, 32.0, 0.0)]
    assert [block.number for block in blocks if block.number] == [10, 15, 20, 30]


def test_one_corner_after_the_other() -> None:
    blocks = corrected("N10 G1 F100 G12 P70:1 X10\nN20 G12 Y10\nN30 X0\nN40 M30")
    assert ends(blocks) == [(9, 0, 0), (10, 1, 0), (10, 9, 0), (9, 10, 0), (0, 10, 0)]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("N10 G1 F100 G12 P70:5 X4\nN20 Y40\nN30 M30", 1158),
        ("N10 G1 F100 G12 P70:5 X40\nN20 Y5\nN30 M30", 1158),
        ("N10 G1 F100 G12 P70:2 X40\nN20 G2 X60 Y20 R20\nN30 M30", 1158),
        ("N10 G1 F100 G12 P71:50 X40\nN20 Y40\nN30 M30", 1158),
        ("N10 G1 F100 G12 P71:5 X40\nN20 X80\nN30 M30", 1158),
        ("N10 G1 F100 G12 P71:5 X40\nN30 M30", 1226),
        ("N10 G1 F100 G123 X40\nN30 M30", 1226),
    ],
)
def test_corners_that_are_not_possible(text: str, number: int) -> None:
    assert refused(text) == number


def test_a_rounding_fits_up_to_the_whole_of_both_lines() -> None:
    blocks = corrected("N10 G1 F100 G12 P71:10 X10\nN20 Y20\nN30 M30")
    arc = next(element for element in path(blocks) if isinstance(element, Arc))
    assert (arc.centre, round(math.degrees(arc.sweep_rad))) == ((0.0, 10.0), 90)
    assert refused("N10 G1 F100 G12 P71:10.01 X10\nN20 Y20\nN30 M30") == 1158


@pytest.mark.parametrize(("threshold", "corner"), [(None, True), (110.0, True), (130.0, False), (0.0, False)])
def test_an_outer_corner_of_120_degrees(threshold: float | None, corner: bool) -> None:
    """P8845: an arc about the corner, or the meeting point, 2 r away from it."""
    assert corner_arc(120.0, threshold) is corner
    turned = math.radians(119.9)
    text = (
        f"N5 tr:2\nN10 G0 X-50 Y-9 F100\nN20 G41 G1 X-40 Y0\nN30 X0\n"
        f"N40 X{50 * math.cos(turned):.6f} Y{-50 * math.sin(turned):.6f}\nN50 G40 X90\nN60 M30"
    )
    made = path(corrected(text, threshold))
    arcs = [element for element in made if isinstance(element, Arc)]
    assert len(arcs) == corner
    if not corner:
        tips = [element.end for element in made if math.hypot(*element.end[:2]) < 4.5]
        assert math.hypot(*tips[0][:2]) == pytest.approx(2.0 / math.cos(turned / 2.0), abs=1e-4)
    else:
        assert arcs[0].centre == pytest.approx((0.0, 0.0), abs=1e-6)
        assert arcs[0].radius_mm == pytest.approx(2.0)
        assert abs(math.degrees(arcs[0].sweep_rad)) == pytest.approx(119.9, abs=1e-3)


def test_moves_across_the_plane_stand_where_the_tool_is() -> None:
    blocks = corrected(
        "N5 tr:5\nN10 G0 X-20 Y0 Z5 F100\nN20 G41 G1 X0 Y0\nN30 Z-1\nN40 Y30\nN50 Z-2\nN60 X40\n"
        "N70 G40 X60 Y40\nN80 M30"
    )
    heights = {block.number: block.elements[0] for block in blocks if block.number in (30, 50)}
    assert heights[30] == Straight((-5.0, 0.0, 5.0), (-5.0, 0.0, -1.0))
    assert heights[50] == Straight((0.0, 35.0, -1.0), (0.0, 35.0, -2.0))  # at the end of the arc about the corner


def test_the_other_side_is_reached_on_an_arc_about_the_corner() -> None:
    made = path(corrected("N5 tr:3\nN10 G0 X-20 F100\nN20 G41 G1 X0\nN30 X20\nN40 G42 X40\nN50 G40 X60\nN60 M30"))
    arc = next(element for element in made if isinstance(element, Arc))
    assert arc.centre == (20.0, 0.0)
    assert (arc.start[:2], arc.end[:2]) == ((20.0, 3.0), (20.0, -3.0))
    assert abs(math.degrees(arc.sweep_rad)) == pytest.approx(180.0)


def test_another_radius_makes_the_line_oblique() -> None:
    made = path(corrected("N5 tr:3\nN10 G0 X-20 F100\nN20 G41 G1 X0\nN30 X20\nN35 tr:1\nN40 X40\nN50 G40 X60\nN60 M30"))
    assert [element.end[:2] for element in made[2:4]] == [(20.0, 3.0), (40.0, 1.0)]


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("N20 G41 G2 X20 Y0 R10\nN30 M30", 1153),
        ("N20 G41 G1 X20\nN30 X40\nN40 G40 G2 X60 Y0 R20\nN50 M30", 1153),
        ("N20 G41 G1 X20\nN30 X30\nN40 G3 X34 Y0 R2\nN50 G1 X60\nN60 G40 X80\nN70 M30", 1152),
        ("N20 G41 G1 X20\nN30 X40\n" + "\n".join(f"N{n} P500:{n}" for n in range(31, 45)) + "\nN50 X60\nN60 M30", 1157),
        ("N20 G41 G1 X20\nN30 X30\nN40 Y4\nN50 X20\nN60 Y40\nN70 G40 X0\nN80 M30", 1223),
    ],
)
def test_contours_that_a_tool_of_radius_5_cannot_follow(text: str, number: int) -> None:
    assert refused("N5 tr:5\nN10 G0 X0 Y0 F100\n" + text) == number


def test_twelve_blocks_without_a_path_may_stand_between_two_with() -> None:
    between = "\n".join(f"N{n} P500:{n}" for n in range(31, 43))
    blocks = corrected(f"N5 tr:5\nN10 G0 X0 F100\nN20 G41 G1 X20\nN30 X40\n{between}\nN50 Y40\nN60 G40 X80\nN70 M30")
    assert ends(blocks)[-2] == (35.0, 40.0, 0.0)


def test_meeting_points_and_shares() -> None:
    line, circle = (
        Straight((0.0, 1.0, 0.0), (10.0, 11.0, 0.0)),
        Arc((5.0, 0.0, 0.0), (0.0, 5.0, 0.0), XY, (0.0, 0.0), math.pi / 2),
    )
    points = sorted(meetings(line, circle, XY))
    assert points[0] == pytest.approx((-4.0, -3.0))
    assert points[1] == pytest.approx((3.0, 4.0))
    assert [list(p) for p in sorted(meetings(circle, line, XY))] == [pytest.approx(list(p)) for p in points]
    other = Arc((13.0, 0.0, 0.0), (3.0, 0.0, 0.0), XY, (8.0, 0.0), math.pi)
    low, high = sorted(meetings(circle, other, XY))
    assert low == pytest.approx((4.0, -3.0))
    assert high == pytest.approx((4.0, 3.0))
    assert share_of(circle, XY, (3.0, 4.0)) == pytest.approx(math.atan2(4, 3) / (math.pi / 2))
    assert share_of(circle, XY, (4.0, -3.0)) == pytest.approx(math.atan2(-3, 4) / (math.pi / 2))
    assert share_of(line, XY, (3.0, 4.0)) == pytest.approx(0.3)
    assert meetings(line, Straight((0.0, 2.0, 0.0), (10.0, 12.0, 0.0)), XY) == []


def test_moves_across_the_plane_are_blocks_without_a_path() -> None:
    """In 7.2 the manual calls `G40 Z100` in G17 a block with a path of 0: twelve of them, not thirteen."""
    down = [f"N{31 + n} Z{-n - 1}" for n in range(13)]
    begin, end = "N5 tr:5\nN10 G0 X0 F100\nN20 G41 G1 X20\nN30 X40\n", "\nN50 X60\nN60 G40 X80\nN70 M30"
    assert corrected(begin + "\n".join(down[:12]) + end)
    assert refused(begin + "\n".join(down) + end) == 1157


def test_without_correction_blocks_need_no_path() -> None:
    """G40 in a block without a path ends the corrected path there: what follows waits for nothing."""
    after = "\n".join(f"N{n} P500:{n}" for n in range(51, 71))
    blocks = corrected(f"N10 F100 tr:5\nN20 G41 G1 X20\nN30 X40\nN40 G40\n{after}\nN80 X60\nN90 M30")
    assert ends(blocks) == [(20.0, 5.0, 0.0), (40.0, 5.0, 0.0), (60.0, 0.0, 0.0)]
    blocks = corrected(f"N10 F100 tr:5\nN20 G41 G1 X20\nN40 G40\n{after}\nN80 X60\nN90 M30")
    assert ends(blocks) == [(20.0, 0.0, 0.0), (60.0, 0.0, 0.0)]


@pytest.mark.parametrize(
    ("line", "place"),
    [("N200 G40 Z100", (45.0, 50.0, 100.0)), ("N200 G40 X40 Y100 Z100", (40.0, 100.0, 100.0))],
)
def test_switched_off_before_another_plane(line: str, place: tuple[float, ...]) -> None:
    """Printed example of 7.2 (N200, N210): without a path N210 takes the offset along, 5 mm in X; there is no gap."""
    blocks = corrected(f"N10 F100 tr:5\nN20 G41 G1 X50 Y-50\nN30 Y50\n{line}\nN210 G18 X20 Y50\nN220 M30")
    assert ends(blocks)[-2:] == [place, (15.0 if place[0] == 45.0 else 20.0, 50.0, 100.0)]
    assert all(a.end == b.start for a, b in itertools.pairwise(path(blocks)))


def test_another_plane_while_it_is_on() -> None:
    assert refused("N10 F100 tr:5\nN20 G41 G1 X20\nN30 X40\nN40 G18 X60\nN50 M30") == 1232


def test_another_radius_makes_a_circle_a_spiral() -> None:
    """From 8 mm to 6 mm about (20, 10) within a quarter of a turn, between tangential lines."""
    made = path(
        corrected(
            "N10 F100 tr:2\nN20 G41 G1 X10\nN30 X20\nN40 tr:4 G3 X30 Y10 I20 J10\nN50 G1 Y30\nN60 G40 X0\nN70 M30"
        )
    )
    arc = made[2]
    assert isinstance(arc, Arc)
    assert (arc.start[:2], arc.end[:2]) == (pytest.approx((20.0, 2.0)), pytest.approx((26.0, 10.0)))
    assert arc.point(0.5)[:2] == pytest.approx((20.0 + 7.0 * math.sqrt(0.5), 10.0 - 7.0 * math.sqrt(0.5)))
    assert made[3].end[:2] == pytest.approx((26.0, 30.0))


def test_radius_0_is_a_radius_too() -> None:
    """7.4 with a new radius of 0: back to the contour with the next element, a circle, and no arc at its corners."""
    made = path(
        corrected(
            "N10 F100 tr:2\nN20 G41 G1 X10\nN30 X20\nN40 tr:0 G3 X30 Y10 I20 J10\nN50 G1 X60\nN60 G40 X90\nN70 M30"
        )
    )
    assert made[2].end[:2] == pytest.approx((30.0, 10.0))
    assert [type(element) for element in made] == [Straight, Straight, Arc, Straight, Straight]


def test_a_program_may_end_with_correction() -> None:
    """The last element ends at right angles to its end, the line that switched it on where it is programmed."""
    assert ends(corrected("N10 F100 tr:2\nN20 G41 G1 X10\nN30 X30\nN40 M30")) == [(10, 2, 0), (30, 2, 0)]
    assert ends(corrected("N10 F100 tr:2\nN20 G41 G1 X10\nN40 M30")) == [(10, 0, 0)]


@pytest.mark.parametrize(
    ("back", "number"),
    [("N40 G3 X10 R12", 1223), ("N40 G3 X10 R10.2", 1223), ("N40 G1 X20 Y1\nN50 X10 Y0", 1223)],
)
def test_a_contour_that_leaves_no_room(back: str, number: int) -> None:
    """A segment of 20 mm and up to 8.2 mm, a wedge of 1 mm: no tool of 5 mm fits in."""
    assert refused(f"N5 tr:5 F100\nN20 G41 G1 X10\nN30 X30\n{back}\nN60 G1 X0 Y-20\nN70 M30") == number


def test_a_lens_that_leaves_no_room() -> None:
    """Two circles of 5 mm over a chord of 8 mm, 4 mm high: moved by 3 mm they do not meet."""
    assert refused("N5 tr:3 F100\nN20 G42 G1 X26 Y30\nN30 G2 X34 R5\nN40 G2 X26 R5\nN50 G1 X10\nN60 M30") == 1156


def test_moves_across_the_plane_between_a_corner_s_paths() -> None:
    """Blocks without a path in the plane: at the beginning of what is put in, with G123 at the middle point."""
    for words, place in (("P71:5 P70:--", (15, 0)), ("P70:5 P71:--", (15, 0))):
        blocks = corrected(f"N10 G1 F100 G12 {words} X20\nN15 P500:1\nN17 Z-3\nN20 Y20\nN30 M30")
        assert [block.number for block in blocks if block.elements] == [10, 17, 20]
        assert ends(blocks) == [(*place, 0), (*place, -3), (20, 5, -3), (20, 20, -3)]
        assert all(a.end == b.start for a, b in itertools.pairwise(path(blocks)))
    made = path(corrected("N10 G1 F100 G123 X20 Y5\nN17 Z-3\nN20 X40 Y0\nN30 M30"))
    assert [type(element) for element in made] == [Arc, Straight, Arc]
    assert made[1] == Straight((20.0, 5.0, 0.0), (20.0, 5.0, -3.0))


def test_without_a_path_in_the_plane_there_is_no_corner() -> None:
    assert ends(corrected("N10 G1 F100 G12 P71:5 Z-3\nN20 X20\nN30 M30")) == [(0, 0, -3), (20, 0, -3)]


def test_a_rounding_between_slanting_lines() -> None:
    """Directions (3, 4) / 5 and (-4, 3) / 5, 5 mm: from (37, 56) to (36, 63) about (33, 59)."""
    made = path(corrected("N5 G0 X10 Y20 F100\nN10 G1 G12 P71:5 X40 Y60\nN20 X0 Y90\nN30 M30"))
    assert isinstance(made[2], Arc)
    assert (made[2].start[:2], made[2].end[:2]) == (pytest.approx((37.0, 56.0)), pytest.approx((36.0, 63.0)))
    assert made[2].centre == pytest.approx((33.0, 59.0))
    assert math.degrees(made[2].sweep_rad) == pytest.approx(90.0)


@pytest.mark.parametrize(
    ("points", "sense"), [(((26, 23), (35, 50), (57, 54)), -1), (((57, 54), (35, 50), (26, 23)), 1)]
)
def test_a_circle_through_three_points_anywhere(points: tuple[tuple[float, float], ...], sense: int) -> None:
    """All 25 mm from (50, 30): (-24, -7), (-15, 20), (7, 24)."""
    (a, b), (c, d), (e, f) = points
    made = path(corrected(f"N5 G0 X{a} Y{b} F100\nN10 G123 X{c} Y{d}\nN20 X{e} Y{f}\nN30 M30"))
    for arc in made[1:]:
        assert isinstance(arc, Arc)
        assert arc.centre == pytest.approx((50.0, 30.0))
        assert arc.sweep_rad * sense > 0.0
    assert made[1].end[:2] == (c, d)


def test_a_circle_through_three_points_behind_a_rounding() -> None:
    """The rounding stays, and the circle begins where it has ended."""
    made = path(corrected("N10 G1 F100 G12 P71:2 X10\nN20 G123 Y20\nN30 X30 Y30\nN40 M30"))
    assert [type(element) for element in made] == [Straight, Arc, Arc, Arc]
    assert (made[1].end[:2], made[2].start[:2], made[2].end[:2]) == ((10.0, 2.0), (10.0, 2.0), (10.0, 20.0))


def test_a_rounding_between_a_line_and_a_circle() -> None:
    """About (70, 40) with 50 mm, 10 mm put in from outside: its centre is 60 mm away and 10 mm below the line."""
    made = path(corrected("N10 G1 F100 G12 P71:10 X40\nN20 G3 X110 Y10 I70 J40\nN30 M30"))
    away = math.sqrt(60.0**2 - 50.0**2)
    assert isinstance(made[1], Arc)
    assert made[1].centre == pytest.approx((70.0 - away, -10.0))
    assert made[1].start[:2] == pytest.approx((70.0 - away, 0.0))
    assert made[1].end[:2] == pytest.approx((70.0 - away * 50.0 / 60.0, 40.0 - 50.0 * 50.0 / 60.0))


@pytest.mark.parametrize(("x", "turn"), [(20, 1), (-20, -1)])
def test_the_side_of_the_middle_point_is_the_sense(x: float, turn: int) -> None:
    """(0, 100), (20, 110), (0, 120): to the left, about (7.5, 110)."""
    made = path(corrected(f"N5 G0 X0 Y100 F100\nN10 G123 X{x} Y110\nN20 X0 Y120\nN30 M30"))
    assert all(isinstance(arc, Arc) and arc.sweep_rad * turn > 0.0 for arc in made[1:])
    assert all(isinstance(arc, Arc) and arc.centre == pytest.approx((7.5 * turn, 110.0)) for arc in made[1:])


@pytest.mark.parametrize("between", ["N40 M28.2", "/N40 P1:1", "N40 M24.2\nN41 M25", "N40 T0 M16", "N40 M8"])
def test_what_stands_between_the_elements_of_a_corner_does_not_change_it(between: str) -> None:
    """Subprograms that return, skipped blocks, loops, tools of the same radius: the inner corner at (28, 2) stays."""
    text = f"P1\nN10 F100\nN20 G41 G1 X10\nN30 X30\n{between}\nN50 Y20\nN60 G40 X0\nN70 M30\nP2\nN10 P2:1\nN20 M30"
    tool = {"p8748": -2.0}
    assert ends(corrected(text, **tool)) == [(10, 2, 0), (28, 2, 0), (28, 20, 0), (0, 20, 0)]
