"""BWO 900, chapters 4, 5 and 7, and what chapter 8 says of motion: path conditions, cycles, tools, speeds, corners."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.bwo900_desk import T1, analysed, fresh, mm, parameters, put_out, run, said, seconds, start, value
from conformance.rows import case, shows

from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element, Straight
from isel_twin.firmware.bwo900.geometry.offset import Offset
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.testing import Desk

XY = tuple[float, float]


def refused(text: str, **values: float) -> int:
    with pytest.raises(ProgramError) as error:
        elements(text, **values)
    return error.value.number


def elements(text: str, threshold: float | None = None, **values: float) -> list[Element]:
    """All elements of a program, corners and radius correction done."""
    done = analysed(text, **values).blocks
    for item in (Contour(), Offset(threshold)):
        done = [out for block in done for out in item.push(block)] + item.flush()
    return [element for block in done for element in block.elements]


def near(points: list, expected: list, tolerance: float = 2e-3) -> None:
    assert len(points) == len(expected), points
    for point, wanted in zip(points, expected, strict=True):
        assert tuple(point[: len(wanted)]) == pytest.approx(wanted, abs=tolerance)


def feeds(desk: Desk, limit_s: float = 30.0) -> tuple[np.ndarray, np.ndarray]:
    """Places in mm [n, 3] and path speeds in mm/min [n], one every 2 ms, from Start of P1 to its end."""
    first = desk.ticks
    start(desk)
    desk.finish(limit_s)
    steps = desk.steps_since(first).delta[:, :3] / 1000.0
    return np.cumsum(steps, axis=0), np.hypot.reduce(steps, axis=1) / 0.002 * 60.0


# 4.1 to 4.3


@shows("bwo900-4-1", "bwo900-4-2", "bwo900-4-3")
def test_path_conditions_take_effect_before_the_path_and_stay() -> None:
    done = analysed("N10 F500 X10|N20 X20 G0|N30 X30|N40 G53 G1 X40|N50 M30")
    assert [block.rapid for block in done.path] == [False, True, True, False]
    assert refused("N10 G54 G55 X1") == 1232


@pytest.mark.parametrize(
    ("number", "cell", "content"),
    [
        case("bwo900-4-4", 1, 9340, 1),
        case("bwo900-4-4", 11, 9345, 11),
        case("bwo900-4-4", 17, 9350, 17),
        case("bwo900-4-4", 29, 9358, 29),
        case("bwo900-4-4", 40, 9364, 40),
        case("bwo900-4-4", 43, 9365, 43),
        case("bwo900-4-4", 46, 9366, 46),
        case("bwo900-4-4", 147, 9367, 147),
        case("bwo900-4-4", 53, 9369, 53),
        case("bwo900-4-4", 60, 9370, 60),
        case("bwo900-4-4", 60, 9371, 60),
        case("bwo900-4-4", 64, 9372, 64),
        case("bwo900-4-4", 90, 9378, 90),
        case("bwo900-4-4", 94, 9380, 94),
        case("bwo900-4-4", 97, 9381, 97),
    ],
)
def test_the_start_state(number: int, cell: int, content: int) -> None:
    desk = run(f"P1|N10 P500:P{cell}|N20 M30")
    assert value(desk, 500) == content == number


@shows("bwo900-4.1-1", "bwo900-4.1-2")
def test_rapid_runs_at_its_own_speed() -> None:
    """P8816 1200 mm/min; the axis with the longest way has it, the other half of it."""
    desk = fresh("P1|N10 G0 F100 X60 Y30|N20 M30", p8816=1200)
    places, speeds = feeds(desk)
    assert speeds.max() == pytest.approx(1200.0 * math.hypot(1.0, 0.5), rel=0.01)
    assert places[:, 1] == pytest.approx(places[:, 0] / 2.0, abs=2e-3)


@shows("bwo900-4.1-3", "bwo900-8.5-3")
def test_rapid_without_a_speed_is_that_of_the_fastest_axis() -> None:
    _, speeds = feeds(fresh("P1|N10 G0 X100|N20 M30", p8816=0, p12004=9000))
    assert speeds.max() == pytest.approx(9000.0, rel=0.01)


@shows("bwo900-4.1-4")
def test_override_acts_on_rapid() -> None:
    _, speeds = feeds(fresh("P1|N10 G0 X60|N20 M30", p8816=1200, p11310=50))
    assert speeds.max() == pytest.approx(600.0, rel=0.01)


@shows("bwo900-4.2-1", "bwo900-4.2-2")
def test_a_line_at_its_feed() -> None:
    places, speeds = feeds(fresh("P1|N10 F1500 X40 Y30 Z10|N20 M30"))
    assert np.median(speeds) == pytest.approx(1500.0, rel=0.01)
    assert speeds.max() == pytest.approx(1500.0, abs=52.0)  # one increment of three axes in 2 ms
    ways = places @ np.array([40.0, 30.0, 10.0]) / math.hypot(40, 30, 10) ** 2
    assert np.abs(places - ways[:, None] * np.array([40.0, 30.0, 10.0])).max() < 2e-3


@shows("bwo900-4.3-1", "bwo900-4.3-2", "bwo900-4.3-3")
def test_circles_by_centre() -> None:
    right, left = elements("N10 F500 X10 Y0|N20 G2 X0 Y-10 I0 J0|N30 G3 X10 Y0 I0 J0|N40 M30")[1:]
    assert isinstance(right, Arc)
    assert isinstance(left, Arc)
    assert (math.degrees(right.sweep_rad), math.degrees(left.sweep_rad)) == pytest.approx((-90.0, 90.0))
    (arc,) = elements("N10 F500 G91 G2 X10 Y-10 I0 J-10|N40 M30")
    assert isinstance(arc, Arc)
    assert (arc.centre, math.degrees(arc.sweep_rad)) == (pytest.approx((0.0, -10.0)), pytest.approx(-90.0))


@shows("bwo900-4.3-4")
def test_a_full_circle() -> None:
    (arc,) = elements("N10 F500 G2 X0 Y0 I10 J0|N40 M30")
    assert isinstance(arc, Arc)
    assert abs(arc.sweep_rad) == pytest.approx(2.0 * math.pi)
    assert refused("N10 F500 G2 X0 Y0 R10|N40 M30") == 1231


@shows("bwo900-4.3-5")
def test_the_centre_between_two_radii() -> None:
    """Start 10.002 from the programmed centre, end 10: R is the mean of both (P8843 = 0.02 allows it)."""
    (arc,) = elements("N10 F500 G3 X10.002 Y10.002 I0.002 J10.002|N40 M30", p8843=0.02)[:1]
    assert isinstance(arc, Arc)
    first, last = math.dist(arc.start[:2], arc.centre), math.dist(arc.end[:2], arc.centre)
    assert first == pytest.approx(last, abs=1e-9)
    assert first == pytest.approx((math.hypot(0.002, 10.002) + 10.0) / 2.0, abs=1e-6)


@shows("bwo900-4.3-6")
def test_a_centre_too_far_off_is_refused() -> None:
    assert refused("N10 F500 G3 X10.1 Y10 I0 J10|N40 M30") == 1238


@shows("bwo900-4.3-7", "bwo900-4.12-1")
@pytest.mark.parametrize(
    ("g", "block", "centre"),
    [
        ("G17", "X10 Y10 I0 J10", (0.0, 10.0)),
        ("G18", "Z10 X10 K0 I10", (0.0, 10.0)),
        ("G19", "Y10 Z10 J0 K10", (0.0, 10.0)),
    ],
)
def test_planes(g: str, block: str, centre: XY) -> None:
    (arc,) = elements(f"N10 {g} F500 G3 {block}|N40 M30")
    assert isinstance(arc, Arc)
    assert arc.centre == pytest.approx(centre)
    assert math.degrees(arc.sweep_rad) == pytest.approx(90.0)
    assert (arc.plane.first, arc.plane.second) == {"G17": (0, 1), "G18": (2, 0), "G19": (1, 2)}[g]


@shows("bwo900-4.3-8")
def test_circles_by_radius() -> None:
    for radius, sweep in ((10, 90.0), (-10, 270.0)):
        (arc,) = elements(f"N10 F500 G3 X10 Y10 R{radius}|N40 M30")
        assert isinstance(arc, Arc)
        assert math.degrees(arc.sweep_rad) == pytest.approx(sweep)
        assert arc.radius_mm == pytest.approx(10.0)


@shows("bwo900-4.3-9")
def test_a_radius_below_half_the_chord() -> None:
    desk = fresh("P1|N5 G0 Y30|N10 F500 G3 X20 R3|N20 M30")
    start(desk)
    desk.run(2.0)
    assert said(desk) == [1234]
    assert value(desk, 8685) == 1.0
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[0] == 20.0


@shows("bwo900-4.3-10")
def test_a_circle_needs_a_centre_or_a_radius() -> None:
    assert refused("N10 F500 G2 X10|N40 M30") == 1233


@shows("bwo900-4.3-12")
def test_a_circle_runs_at_its_feed() -> None:
    places, speeds = feeds(fresh("P1|N10 G0 X20 Y20|N20 G2 F1200 X20 Y20 I40 J20|N30 M30"))
    assert np.percentile(speeds, 60) == pytest.approx(1200.0, rel=0.01)
    turned = places[np.hypot(places[:, 0] - 20, places[:, 1] - 20) > 1.0]
    inside = turned[np.abs(np.arctan2(turned[:, 1] - 20, turned[:, 0] - 40)) < 2.5]
    assert np.abs(np.hypot(inside[:, 0] - 40, inside[:, 1] - 20) - 20.0).max() < 2e-3


@shows("bwo900-4.3-11")
def test_a_helix() -> None:
    (arc,) = elements("N10 F500 G3 X10 Y10 Z5 I0 J10|N40 M30")
    assert arc.point(0.5) == pytest.approx((10 * math.sin(math.pi / 4), 10 - 10 * math.cos(math.pi / 4), 2.5))
    assert refused("N10 F500 G3 X10 Y10 Z5 I0 J10 K0|N40 M30") == 1238, "with three centres it is a circle in space"


# 4.4 to 4.13


@shows("bwo900-4.4-1", "bwo900-4.4-2")
def test_lines_and_circles_through_three_points() -> None:
    for middle, kind in (("X70 Y45", 0), ("X70 Y71.5", -106.509), ("X70 Y18", 106.260)):
        end = {"X70 Y45": "X130 Y40", "X70 Y71.5": "X130 Y63", "X70 Y18": "X130 Y18"}[middle]
        first, second = elements(f"N10 G0 X20 Y50|N20 G123 G1 F500 {middle}|N30 {end}|N40 M30")[1:]
        for element in (first, second):
            if kind:
                assert isinstance(element, Arc)
                assert math.copysign(element.radius_mm, element.sweep_rad) == pytest.approx(kind, abs=2e-3)
            else:
                assert isinstance(element, Straight)
    assert refused("N10 G123 G1 F500 X5 Y5|N20 M30") == 1226
    assert refused("N10 G123 G1 F500 X5 Y5 M01|N20 X9|N30 M30") == 1226


@shows("bwo900-4.5-1", "bwo900-4.5-2", "bwo900-4.5-3")
def test_dwells() -> None:
    desk = fresh("P1|N10 G1 F3000 X10 G04.3.5 M9|N20 X20|N30 M30")
    start(desk)
    desk.run(2.0)
    assert mm(desk)[0] == 10.0
    assert value(desk, 8941) == 3.5
    assert 1.5 < value(desk, 8942) < 2.5
    plain = seconds("P1|N10 G1 F3000 X10 G08|N20 X20|N30 M30")
    assert seconds("P1|N10 G1 F3000 X10 G04.3.5|N20 X20|N30 M30") - plain == pytest.approx(3.5, abs=0.02)
    assert seconds("P1|N10 G1 F3000 X10 G04.1|N20 X20|N30 M30") - plain == pytest.approx(1.0, abs=0.02)
    with pytest.raises(ProgramError):
        analysed("N10 G04|N20 M30")


def slowest_inside(text: str, **values: float) -> float:
    """Lowest path speed around x = 20, mm/min, of two blocks that meet there."""
    places, speeds = feeds(fresh(text, **values))
    return float(speeds[(places[:, 0] > 18.0) & (places[:, 0] < 22.0)].min())


@shows("bwo900-4.7-1", "bwo900-4.7-2", "bwo900-4.7-3", "bwo900-4.13-1", "bwo900-4.13-2", "bwo900-4.13-3")
def test_exact_stops() -> None:
    for head, first, stops in (
        ("", "", False),
        ("", "G08", True),
        ("G28", "", True),
        ("G28", "G09", False),
        ("G28 M16|N12 G29", "", False),
    ):
        slowest = slowest_inside(f"P1|N10 {head}|N15 G1 F1200 X20 {first}|N20 X40|N30 M30")
        assert (slowest < 60.0) == stops, (head, first)


@shows("bwo900-4.7-4", "bwo900-8.5-9")
def test_rapid_ends_with_an_exact_stop_unless_told_otherwise() -> None:
    for mode, stops in ((0, True), (1, True), (2, False)):
        slowest = slowest_inside("P1|N10 G0 X20|N20 X40|N30 M30", p8858=mode, p8816=1200)
        assert (slowest < 60.0) == stops, mode


@shows("bwo900-4.8-1", "bwo900-4.8-2", "bwo900-4.8-3", "bwo900-4.8-4", "bwo900-4.8-5")
def test_polar_coordinates() -> None:
    head = "N10 G0 F3000 X:0 Y:0|"
    done = analysed(
        head + "N30 G1 G10 X:90 Y:0|N50 x:39.05 c:140.194|N60 X:60 Y:25|N70 x:46.09 c:49.398|N80 G11 X5|N90 M30"
    )
    near(done.points[-3:], [(60.0, 25.0), (90.0, 60.0), (5.0, 60.0)], 7e-3)
    near(analysed(head + "N20 G10 G1|N30 x:-10 c:90|N40 c:180|N50 M30").points, [(0, 10), (-10, 0)])
    near(analysed("N10 G18 G10 G1 F100|N30 x:10 c:30|N50 M30").points, [(5.0, 0.0, 8.66025)])
    near(analysed("N10 G10 G1 F100 X5|N20 r:10 a:90|N50 M30", q150=114, q151=97).points, [(5.0, 10.0)])


@shows("bwo900-4.9-1", "bwo900-4.9-2", "bwo900-4.9-3")
def test_roundings_and_chamfers() -> None:
    made = elements("N10 F500 G12 P71:5 X20|N20 P1:1|N30 Y20|N40 M30")
    assert isinstance(made[1], Arc)
    assert (made[0].end[:2], made[1].end[:2], made[1].centre) == ((15.0, 0.0), pytest.approx((20.0, 5.0)), (15.0, 5.0))
    made = elements("N10 F500 G12 P70:4 X20|N30 Y20|N40 M30")
    near([e.end for e in made], [(16, 0), (20, 4), (20, 20)])
    assert refused("N10 F500 G12 P70:40 X20|N30 Y20|N40 M30") == 1158
    assert refused("N10 F500 G12 P71:4 X20|N40 M30") == 1226


# 4.14 to 4.27


@shows("bwo900-4.15-1", "bwo900-4.15-2")
def test_corrections_of_axes() -> None:
    done = analysed("N100 G44 X10 Y20 Z30|N120 G01 F1000 X100 Y100 Z100|N130 G43|N140 X100 Y100 Z100|N150 M30")
    near(done.points, [(110, 120, 130), (100, 100, 100)], 1e-9)


TURNED = "N10 G45 G00 P160:{} P161:{} P163:{} X0|N20 X10 Y5|N30 X20|N40 M30"


@shows("bwo900-4.16-1", "bwo900-4.16-2")
def test_rotation_about_a_point() -> None:
    """X = U cos E - V sin E + U0, Y = U sin E + V cos E + V0."""
    c, s = math.cos(math.radians(30)), math.sin(math.radians(30))
    done = analysed(TURNED.format(50, 10, 30))
    near(done.points[-2:], [(10 * c - 5 * s + 50, 10 * s + 5 * c + 10), (20 * c - 5 * s + 50, 20 * s + 5 * c + 10)])
    near(analysed("N10 G45 P163:90|N20 G0 X10 Y5|N30 G46 X10 Y5|N40 M30").points, [(-5, 10), (10, 5)])


@shows("bwo900-4.16-3", "bwo900-4.16-4")
def test_rotations_add_up() -> None:
    text = "N10 G45 P160:0 P161:0 P163:0 G0|N20 P168:30 X10 Y0|N30 P168:30 X10 Y0|N40 P163:0 X10 Y0|N50 M30"
    c30, s30, c60, s60 = (f(math.radians(a)) for a in (30, 60) for f in (math.cos, math.sin))
    near(analysed(text).points, [(10 * c30, 10 * s30), (10 * c60, 10 * s60), (10, 0)])
    text = "N10 G45 P160:0 P161:0 P163:90 G0|N20 P165:5 X10 Y0|N30 G46|N40 G45 X10 Y0|N50 M30"
    near(analysed(text).points, [(0, 15), (0, 10)])


@shows("bwo900-4.16-5")
def test_the_printed_examples_of_shift_and_rotation() -> None:
    """P8859 = 2: shifted, then turned; 0: turned, then shifted."""
    sub = "P452|N10 G0 Z1.5|N30 X0 Y0|N40 X30|N50 Y20|N60 X0|N80 M02"
    text = "P1|N20 G0 G45 P160:50 P161:10 P163:30|N25 G92 X60 Y0|N27 X10 Y5|N30 M30|"
    for order, place in ((2, (108.122, 49.330)), (0, (116.160, 19.330))):
        near(analysed(text + sub, p8859=order).points[:1], [place])


@shows("bwo900-4.17-1", "bwo900-4.17-2")
def test_machine_coordinates() -> None:
    done = analysed("N10 G54 G0 X10 Z0|N20 G47 X10 Z0|N30 G147 X10 Z0|N40 M30", p20003=5, p8161=7)
    near(done.points, [(15, 0, 7), (10, 0, 0), (15, 0, 7)])


@shows("bwo900-4.19-1", "bwo900-4.19-2", "bwo900-4.20-1", "bwo900-4.20-2", "bwo900-4.26-2")
def test_zero_points() -> None:
    done = analysed("N10 G54 G0 X1|N20 G55 X1|N25 G92 X30|N27 X1|N30 G53 X1|N40 M30", p20003=100, p20006=200)
    near(done.points, [(101,), (201,), (231,), (1,)])
    done = analysed("N10 G0 X1|N20 G153 X1|N30 G92 X30|N32 X1|N35 G54 X1|N40 M30", p20000=7, p20003=100)
    near(done.points, [(8,), (1,), (31,), (101,)])
    assert refused("N10 G54 X1", p8555=4) == 1240


@shows("bwo900-4.21-1", "bwo900-4.21-2", "bwo900-4.21-3")
@pytest.mark.parametrize(("plane", "first", "second"), [("G17", 0, 1), ("G18", 2, 0), ("G19", 1, 2)])
def test_mirrors(plane: str, first: int, second: int) -> None:
    for g, signs in (("G61", (-1, 1)), ("G62", (1, -1)), ("G61 G62", (-1, -1)), ("G61 G62|N11 G60", (1, 1))):
        expected = [10.0, 20.0, 30.0]
        expected[first] *= signs[0]
        expected[second] *= signs[1]
        near(analysed(f"N10 {plane} {g}|N20 G0 X10 Y20 Z30|N30 M30").points, [expected])


@shows("bwo900-4.21-4", "bwo900-4.21-5", "bwo900-4.21-6", "bwo900-4.21-7", "bwo900-4.21-8", "bwo900-4.21-9")
def test_what_is_mirrored() -> None:
    (arc,) = elements("N10 G61 F500 G2 X10 Y10 I10 J0|N20 M30")
    assert isinstance(arc, Arc)
    assert (arc.centre, math.degrees(arc.sweep_rad)) == (pytest.approx((-10, 0)), pytest.approx(90.0))
    (arc,) = elements("N10 G61 G62 F500 G2 X10 Y10 I10 J0|N20 M30")
    assert isinstance(arc, Arc)
    assert math.degrees(arc.sweep_rad) == pytest.approx(-90.0)
    near(analysed("N10 G54 G61 G0 X10|N20 G92 X3|N30 X10|N40 M30", p20003=100).points, [(90,), (87,)])
    done = analysed("N10 G61 tr:2 F100|N20 G41 X10|N30 G62 X20|N40 M30")
    assert [block.correction.side for block in done.path] == [-1, 1]
    near(analysed("N10 G61 G0 X10|N20 G91 X5|N30 G66 G90 X5|N40 X5|N50 M30").points, [(-10,), (-15,), (5,), (-5,)])


@shows("bwo900-4.22-1")
def test_override_can_be_locked() -> None:
    for g, feed in (("G63", 1200.0), ("G64", 600.0), ("G63|N12 G64", 600.0)):
        _, speeds = feeds(fresh(f"P1|N10 {g}|N20 F1200 X30|N30 M30", p11310=50))
        assert speeds.max() == pytest.approx(feed, rel=0.01), g


@shows("bwo900-4.23-1", "bwo900-4.23-2")
def test_a_block_without_corrections() -> None:
    done = analysed("N5 G54 G45 P163:90 G0|N7 G92 X3|N10 G66 X5 Y0 Z1|N20 X5 Y0 Z1|N30 M30", p20003=10, p8161=7)
    near(done.points, [(5, 0, 1), (13, 5, 8)])


@shows("bwo900-4.24-1", "bwo900-4.25-1")
def test_absolute_and_incremental() -> None:
    near(
        analysed("N10 G0 X10 Y5|N20 G91 X10|N30 Y5 X-3|N40 G90 X1|N50 M30").points,
        [(10, 5), (20, 5), (17, 10), (1, 10)],
    )


@shows("bwo900-4.26-1")
def test_a_shift_moves_nothing_and_does_not_add_up() -> None:
    done = analysed("N10 G0 X5 Y5|N123 G92 X10 Y10 Z10|N130 X1 Y1|N140 G92 X20|N150 X1 Y1|N160 M30")
    near(done.points, [(5, 5, 0), (11, 11, 0), (21, 1, 0)])
    desk = run("P1|N10 G92 X10|N20 G0 X5 M01|N30 P500:P12154 P501:P12157 P502:P12155|N40 M30")
    assert [value(desk, n) for n in (500, 501, 502)] == [5.0, 10.0, 5.0]


@pytest.mark.parametrize(
    "g",
    [
        case("bwo900-4.6-1", "G5"),
        case("bwo900-4.6-1", "G7"),
        case("bwo900-4.10-1", "G14"),
        case("bwo900-4.11-1", "G16"),
        case("bwo900-4.29-1", "G170"),
    ],
)
def test_what_is_not_there_is_refused(g: str) -> None:
    assert refused(f"N10 {g} X5|N20 M30") == 1232


@shows("bwo900-3.9-1")
def test_elements_of_c_are_not_there() -> None:
    assert said(run("P1|N10 int idx=0;|N20 M30", p8805=1)) == [1216]


@shows("bwo900-8.7-5")
def test_sine_ramps_take_as_long_as_linear_ones() -> None:
    """v = V sin^2(pi t / 2 T) with T = P12008."""
    dynamics = {"p12004": 6000, "p12008": 400, "p12010": 1}
    _, speeds = feeds(fresh("P1|N10 F6000 X100|N30 M30", **dynamics))
    times_ms = 200.0 + 2.0 * (np.arange(len(speeds)) - int(np.argmax(speeds >= 3000.0)))  # half of the speed at T / 2
    for part in (0.125, 0.25, 0.75, 0.875):
        law = 6000.0 * math.sin(math.pi / 2 * part) ** 2
        assert np.interp(400.0 * part, times_ms, speeds) == pytest.approx(law, abs=60.0)
    assert speeds.max() == pytest.approx(6000.0, rel=0.01)


@shows("bwo900-8.7-8")
def test_ramps_are_linear_and_the_lag_is_the_drives_business() -> None:
    desk = fresh("P1|N10 F6000 X60|N30 M30", p12024=1, p12025=1)
    _, speeds = feeds(desk)
    rise = np.diff(speeds[speeds > 0][2:100])
    assert said(desk) == []
    assert rise.max() - rise.min() <= 62.0  # a place is whole increments: one more and one less, 30 mm/min each
    assert mm(desk)[0] == 60.0


# 5


DRILL = {"p32": 800, "p33": 0, "p34": 32, "p35": 60}


def z_of(text: str, **values: float) -> list[float]:
    done = analysed(f"N20 G0 X0 Y0 Z100 S1200 F1500 M03|N30 {text}|N90 M30", **values)
    return [round(point[2], 3) for point in done.points[1:]]


@pytest.mark.parametrize(
    ("block", "places"),
    [
        case("bwo900-5.3-1", "G81 X5 Z80 P30:1 P32:800 P33:0 P34:32 P35:60", [80, 32, 0, 60]),
        case(
            "bwo900-5.3-2",
            "G83 X5 Z80 P30:1 P32:800 P33:0 P34:48 P35:60 P36:3 P38:1 P39:0",
            [80, 48, 32, 48, 33, 16, 48, 17, 0, 60],
        ),
        case("bwo900-5.3-4", "G84 X5 Z80 P32:10 P33:20 P34:52 P35:60", [80, 52, 20, 52, 60]),
        case("bwo900-5.3-5", "G85 X5 Z80 P30:1 P32:800 P33:0 P34:32", [80, 32, 0, 32]),
    ],
)
def test_drilling(block: str, places: list[float]) -> None:
    assert z_of(block) == places


@shows("bwo900-5.3-3")
def test_deep_holes_by_shrinking_strokes() -> None:
    """Printed depths: 37, 26, 19, 15, 11, 7, 3.5, 0."""
    places = z_of("G83 X5 Z80 P32:800 P33:0 P34:52 P36:4 P37:15 P38:1 P39:1")
    assert [z for z in (37, 26, 19, 15, 11, 7, 3.5, 0) if z in places] == [37, 26, 19, 15, 11, 7, 3.5, 0]
    assert places[-1] == 52.0


@shows("bwo900-5.3-6", "bwo900-5.3-7")
def test_drilling_needs_a_spindle_and_an_axis() -> None:
    assert 8300 <= refused("N30 G81 X5 P32:800 P33:0 P34:32|N90 M30") <= 8303
    done = analysed("N10 S1 M3 G0 Z50|N30 G81 P32:800 P33:0 P34:32|N90 M30")
    assert done.points == [(0.0, 0.0, 50.0)]


@pytest.mark.parametrize(
    ("block", "places"),
    [
        case("bwo900-5.4-1", "G86 P100:90 P101:30 P106:4", [(20, 20), (50, 30), (80, 40), (110, 50)]),
        case(
            "bwo900-5.4-1",
            "G86 P103:20 P104:96 P106:4",
            [(20, 20), (50.070, 30.945), (80.140, 41.889), (110.210, 52.834)],
        ),
        case(
            "bwo900-5.4-1",
            "G86 P103:20 P105:32 P106:4",
            [(20, 20), (50.070, 30.945), (80.140, 41.889), (110.210, 52.834)],
        ),
        case(
            "bwo900-5.4-2",
            "G87 P100:90 P101:30 P106:4 P110:20 P111:40 P116:3",
            [(20, 20), (50, 30), (80, 40), (110, 50), (120, 70), (130, 90), (100, 80), (70, 70), (40, 60), (30, 40)],
        ),
        case(
            "bwo900-5.4-4",
            "G89 P120:70 P121:20 P122:100 P123:18 P124:120 P126:5",
            [(117.553, 35.451), (103.457, 57.157), (80.396, 68.907), (54.549, 67.553), (32.843, 53.457)],
        ),
    ],
)
def test_patterns(block: str, places: list[XY]) -> None:
    done = analysed(f"N20 G0 X20 Y20 Z100 S1200 F1500 M03|N30 {block} G81 P32:800 P33:0 P34:32|N90 M30")
    near([block.finish for block in done.path if block.finish[2] == 0.0], places)


@shows("bwo900-5.4-3")
def test_a_grid_goes_forth_and_back() -> None:
    done = analysed(
        "N20 G0 X20 Y20 Z100 S1200 F1500 M03|"
        "N30 G88 P100:90 P101:30 P106:4 P110:20 P111:40 P116:3 G81 P32:800 P33:0 P34:32|N90 M30"
    )
    rows = [[(20 + 30 * i + 10 * j, 20 + 10 * i + 20 * j) for i in range(4)] for j in range(3)]
    near([block.finish for block in done.path if block.finish[2] == 0.0], [*rows[0], *rows[1][::-1], *rows[2]])
    near([done.points[-1]], [(20, 20)])


@shows("bwo900-5.5-1", "bwo900-5.5-2")
def test_cycles_of_the_user() -> None:
    done = analysed("P2000|N60 P500:2 G1001|N70 M30|Z1001|N10 P500:P500+1|N20 M02")
    assert done.parameters.get(500) == 3.0
    assert refused("N10 G1234") == 1252


# 7


@shows("bwo900-7.1-1", "bwo900-7.1-2")
def test_the_tool_of_a_program() -> None:
    done = analysed("N10 T2|N20 M30", **T1, p21035=17)
    assert [done.parameters.get(8050 + n) for n in (0, 10, 15)] == [2.0, 3.0, 17.0]
    done = analysed("N10 T2|N20 M30", **T1, p8100=2, p8110=9)
    assert done.parameters.get(8060) == 9.0
    assert refused("N10 T7", **T1) == 1050
    assert refused("N10 T1", **T1, p21006=5, p21007=6) == 1053


@shows("bwo900-7.1-3", "bwo900-7.1-4", "bwo900-7.1-5", "bwo900-7.1-6")
@pytest.mark.parametrize(
    ("word", "radius"), [("tr:50", 50.0), ("tr:50|N12 t:0.5", 50.5), ("t:0.5|N12 tr:50", 50.0), ("tr:50 tq:4", 50.0)]
)
def test_words_for_tools(word: str, radius: float) -> None:
    done = analysed(f"N10 {word}|N30 G1 F100 X100 Y100 G42|N40 M30")
    assert (done.path[0].correction.side, done.path[0].correction.radius_mm) == (-1, radius)


@shows("bwo900-7.1-5")
@pytest.mark.parametrize(("word", "z"), [("", 10.0), ("tl:80", 83.0)])
def test_a_new_length_has_no_correction(word: str, z: float) -> None:
    """P8163 is the correction of the length in force."""
    done = analysed(f"N5 P8163:7|N8 M16|N10 {word}|N30 G0 Z3|N40 M30")
    assert (done.points[-1][2], done.parameters.get(8163)) == (z, z - 3.0 if not word else 0.0)


@shows("bwo900-7.1-5", "bwo900-7.1-7")
@pytest.mark.parametrize(("g", "axis"), [("G17", 2), ("G18", 1), ("G19", 0)])
def test_the_length_acts_along_the_third_axis(g: str, axis: int) -> None:
    expected = [1.0, 2.0, 3.0]
    expected[axis] += 80.0
    near(analysed(f"N10 {g} tl:80|N30 G0 X1 Y2 Z3|N40 M30").points, [expected])


@shows("bwo900-7.1-8", "bwo900-7.1-9")
def test_tool_data_are_called() -> None:
    done = analysed("N10 T2 M16|N20 G1 F100 X5 G42 Z0|N30 G40 T0 M16|N40 X9 Z0|N50 M30", **{**T1, "p21031": 12.0})
    assert done.path[0].correction.radius_mm == 3.0
    near([point[2:] for point in done.points], [(12.0,), (0.0,)])
    done = analysed("N10 T2 M16 G0 Z5|N20 Z5|N50 M30", **{**T1, "p21031": 12.0})
    near([point[2:] for point in done.points], [(5.0,), (17.0,)])


@shows("bwo900-7.1-10")
def test_the_spindle_s_tool_is_reckoned_with_after_the_end() -> None:
    desk = fresh("P1|N10 T2 M16|N20 M30", **T1, p8100=1, p8110=1.5)
    start(desk)
    desk.finish()
    assert value(desk, 8160) == 1.5


@shows("bwo900-7.1-11", "bwo900-7.1-12")
def test_a_change_of_tools() -> None:
    z6 = "Z6|N10 P8047:1|N20 P8045:1|N30 M30"
    done = analysed(f"P1|N100 T2 M6|N110 G1 F100 G41 X5|N120 M30|{z6}", **T1, p8100=1, p8110=1.25)
    assert done.path[0].correction.radius_mm == 3.0
    assert done.parameters.get(8100) == 2.0
    assert done.parameters.get(21010) == 1.25
    desk = run("P1|N100 T2 M6|N110 G1 F100 X5|N120 M30", **T1)
    assert (value(desk, 8100), value(desk, 8160)) == (2.0, 3.0)


CORRECTED = "N10 F500 tr:2|N20 {} G1 X10 Y10|N30 X30|N40 {}|N50 X{} |N60 G40 X0 Y0|N70 M30"


@shows("bwo900-7.2-1", "bwo900-7.2-2", "bwo900-7.2-3")
@pytest.mark.parametrize(("g", "radius", "side"), [("G41", 2, 1), ("G42", 2, -1), ("G41", -2, -1), ("G42", -2, 1)])
def test_sides(g: str, radius: float, side: int) -> None:
    made = elements(f"N10 F500 tr:{radius}|N20 {g} G1 X10 Y10|N30 X30|N40 X50|N60 G40 X0 Y0|N70 M30")
    near([made[0].end, made[1].end], [(10, 10 + 2 * side), (30, 10 + 2 * side)])


@shows("bwo900-7.3-1", "bwo900-7.3-2", "bwo900-7.3-3")
def test_corners_outside_and_inside() -> None:
    right = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 Y-20|N50 Y-30|N60 M30")
    assert isinstance(right[2], Arc)
    assert (right[2].centre, right[2].radius_mm) == ((30.0, 0.0), 2.0)
    assert math.degrees(right[2].sweep_rad) == pytest.approx(-90.0)
    left = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 Y20|N50 Y30|N60 M30")
    assert not any(isinstance(element, Arc) for element in left)
    near([left[1].end], [(28, 2)])
    straight = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 G2 X40 Y-10 I30 J-10|N50 M30")
    near([e.end for e in straight[1:]], [(30, 2), (42, -10)])


@shows("bwo900-8.5-8")
@pytest.mark.parametrize(
    ("threshold", "turned", "arcs"),
    [(None, 20, 1), (110.0, 119, 1), (130.0, 119, 0), (0.0, 119, 0), (0.0, 121, 1), (None, 121, 1)],
)
def test_corner_arcs_by_angle(threshold: float | None, turned: float, arcs: int) -> None:
    """P8845 deleted: always an arc; 0: above a change of direction of 120 degrees; otherwise above its own angle."""
    s, c = 20 * math.sin(math.radians(turned)), 20 * math.cos(math.radians(turned))
    text = f"N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 G91 X{c:.6f} Y{-s:.6f}|N50 X{c:.6f} Y{-s:.6f}|N60 M30"
    assert sum(isinstance(element, Arc) for element in elements(text, threshold)) == arcs


@shows("bwo900-7.3-1")
@pytest.mark.parametrize(("g", "side"), [("G41", 1.0), ("G42", -1.0)])
@pytest.mark.parametrize("way", [("X30", "X20"), ("Y30", "Y20")])
def test_the_way_back_is_an_outer_corner(g: str, side: float, way: tuple[str, str]) -> None:
    made = elements(f"N10 F500 tr:2|N20 {g} G1 X10 Y10|N30 {way[0]}|N40 {way[1]}|N60 M30")
    assert isinstance(made[2], Arc)
    assert math.degrees(made[2].sweep_rad) == pytest.approx(-180.0 * side)
    assert made[2].radius_mm == pytest.approx(2.0)


@shows("bwo900-7.3-4")
def test_changing_sides_inserts_an_arc() -> None:
    made = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 G42 X50 Y10|N50 X70 Y20|N60 M30")
    arcs = [element for element in made if isinstance(element, Arc)]
    assert [arc.centre for arc in arcs] == [(30.0, 0.0)]


@shows("bwo900-7.4-1")
def test_another_radius_makes_a_line_oblique() -> None:
    made = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 tr:4 X50|N50 X70|N60 X80|N70 M30")
    near([e.end for e in made[1:4]], [(30, 2), (50, 4), (70, 4)])


@shows("bwo900-7.5-1", "bwo900-7.6-1")
def test_switching_on_and_off() -> None:
    made = elements("N10 F500 tr:2|N20 G41 G1 X10 Y10|N30 X30|N40 Y30|N50 G40 X50 Y50|N60 M30")
    near([e.end for e in made], [(10, 12), (28, 12), (28, 30), (50, 50)])
    assert refused("N10 F500 tr:2|N20 G41 G2 X10 Y10 R10|N30 X30|N60 M30") == 1153


@shows("bwo900-7.2-4", "bwo900-7.2-5")
def test_blocks_without_a_path_between_corrected_ones() -> None:
    empty = "".join(f"N{31 + n} P1:{n}|" for n in range(12))
    made = elements("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|" + empty + "N50 Y20|N60 Y30|N70 M30")
    near([made[1].end], [(28, 2)])
    more = empty + "N45 P1:1|"
    assert refused("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|" + more + "N50 Y20|N60 Y30|N70 M30") == 1157


@shows("bwo900-7.7-1", "bwo900-7.7-2")
def test_contours_that_the_tool_cannot_follow() -> None:
    assert refused("N10 F500 tr:5|N20 G41 G1 X10|N30 X30|N40 Y3|N50 X60|N60 Y50|N70 M30") == 1223
    assert refused("N10 F500 tr:15|N20 G41 G1 X10|N30 X30|N40 G3 X40 Y10 R10|N50 Y30|N70 M30") == 1152


@shows("bwo900-8.5-7")
def test_the_teach_tool_s_radius_is_taken_off() -> None:
    done = analysed("N10 tr:10|N20 G42 G1 F100 X5|N40 M30", p8748=2.5)
    assert done.path[0].correction.radius_mm == 7.5


# 8: speeds, corners, limits of axes


@shows("bwo900-8.5-1")
def test_a_test_feed_replaces_all_feeds() -> None:
    _, speeds = feeds(fresh("P1|N10 F1200 X30|N20 M30", p8815=300))
    assert speeds.max() == pytest.approx(300.0, rel=0.01)


@shows("bwo900-8.5-4")
def test_feeds_are_changed_by_a_percentage() -> None:
    _, speeds = feeds(fresh("P1|N10 F1200 X30|N20 M30", p8818=25))
    assert speeds.max() == pytest.approx(300.0, rel=0.01)


@shows("bwo900-8.5-5")
@pytest.mark.parametrize(("angle", "factor"), [(90, 0.0), (120, 0.5), (135, 0.7071), (150, 0.8660), (180, 1.0)])
@pytest.mark.parametrize("exponent", [1, 3])
def test_corners(angle: float, factor: float, exponent: float) -> None:
    """Table of P8851: cos(180 - angle) to the exponent, of the feed. The tick that the corner lies in is shorter; from
    tick to tick 400 mm/s^2 change the speed by 48 mm/min."""
    turn = math.radians(180 - angle)
    x, y = 20 + 20 * math.cos(turn), 20 * math.sin(turn)
    desk = fresh(f"P1|N10 F1200 X20|N20 X{x:.4f} Y{y:.4f}|N30 M30", p8851=exponent)
    places, speeds = feeds(desk)
    corner = np.sort(speeds[np.hypot(places[:, 0] - 20, places[:, 1]) < 0.3])[1]
    assert corner == pytest.approx(1200.0 * factor**exponent, abs=60.0)


@shows("bwo900-8.5-6")
def test_circles_are_slowed_by_the_allowed_deviation() -> None:
    """v = KV sqrt(2 R d): 16 / s, R 10 mm, d 0.01 mm."""
    desk = fresh("P1|N10 F6000 G2 X0 Y0 I10 J0|N30 M30", p8852=0.01)
    _, speeds = feeds(desk)
    assert np.median(speeds) == pytest.approx(16.0 * math.sqrt(2 * 10 * 0.01) * 60.0, rel=0.01)
    assert said(run("P1|N10 F6000 G2 X0 Y0 I1 J0|N30 M30", p8852=2)) == [1237]


@shows("bwo900-8.7-1", "bwo900-8.7-2", "bwo900-8.7-3")
@pytest.mark.parametrize(("first", "second", "taken"), [(300, 0, 300), (300, 600, 600), (300, 100, 300)])
def test_dynamics_of_axes(first: float, second: float, taken: float) -> None:
    """From 0 to P12004 in P12008 ms; in P12009 ms on paths where that is longer."""
    dynamics = {"p12004": 6000, "p12008": first, "p12009": second}
    _, speeds = feeds(fresh("P1|N10 F6000 X100|N30 M30", **dynamics))
    ramp = (np.argmax(speeds > 0.95 * 6000) - np.argmax(speeds > 0.05 * 6000)) * 2.0 / 0.9
    assert speeds.max() == pytest.approx(6000.0, rel=0.01)
    assert ramp == pytest.approx(taken, rel=0.03)
    _, speeds = feeds(fresh("P1|N10 G0 X100|N30 M30", **dynamics))
    ramp = (np.argmax(speeds > 0.95 * 6000) - np.argmax(speeds > 0.05 * 6000)) * 2.0 / 0.9
    assert ramp == pytest.approx(first, rel=0.03)


@shows("bwo900-8.7-1")
def test_no_axis_exceeds_its_speed() -> None:
    places, speeds = feeds(fresh("P1|N10 F6000 X40 Y30|N30 M30", p12004=6000, p12204=1200))
    assert np.abs(np.diff(places[:, 1])).max() / 0.002 * 60.0 <= 1200.0 * 1.03
    assert speeds.max() == pytest.approx(2000.0, rel=0.01)


@shows("bwo900-8.7-6", "bwo900-9.7-1")
@pytest.mark.parametrize(("limit", "ways", "number"), [("p12030", (20, 49, 51), 2103), ("p12031", (60, 51, 49), 2104)])
def test_software_limits(limit: str, ways: tuple[int, ...], number: int) -> None:
    first, near, beyond = ways
    desk = run(f"P1|N5 F3000 X{first} M01|N7 {limit.upper()}:50 M01|N10 X{near}|N20 X{beyond}|N30 M30")
    assert said(desk) == [number]
    assert mm(desk)[0] == ways[1]


@shows("bwo900-8.7-7")
def test_positions_can_be_read() -> None:
    desk = run(
        "P1|N10 G54 tl:3|N20 G0 X5 Z2 M01|N30 P500:P12151 P501:P12154 P502:P12557 P503:P12554 P504:P12152|N40 M30",
        p20003=10,
    )
    assert [value(desk, n) for n in range(500, 505)] == [15.0, 5.0, 3.0, 2.0, 15.0]
    desk = fresh("P1|N10 F1200 X60|N30 M30")
    start(desk)
    desk.run(1.0)
    assert value(desk, 12170) == pytest.approx(1200.0, rel=0.03)
    assert value(desk, 8938) == pytest.approx(1200.0, rel=0.01)
    assert (value(desk, 8900), value(desk, 8901), value(desk, 8940), value(desk, 8936)) == (1.0, 10.0, 1.0, 1200.0)


@shows("bwo900-8.3-1", "bwo900-8.3-2")
def test_addresses_of_zero_points_and_tools() -> None:
    """Printed tables: 2 workspaces, 2 groups; tools of 38 parameters with 3 sub records."""
    desk = fresh("P1|N10 G54 G0 X1|N20 M30", q171=2, q172=2, p20024=5, p20045=7, p8555=1)
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 13.0
    done = analysed("N10 T2 M16 G1 F1|N20 G41 X5|N30 M30", q177=3, q178=38, p21000=1, p21038=2, p21048=4)
    assert done.path[0].correction.radius_mm == 4.0


@shows("bwo900-8.1-1")
def test_where_parameters_are_kept() -> None:
    content = put_out(fresh(p500=1, p7500=2, p11500=3, p12004=4000, p20000=5, p12204=6000, referenced=False))
    assert [content[q] for q in (10_500, 15_500, 1_500, 2_004, 20_000, 2_204)] == [1, 2, 3, 4000, 5, 6000]
