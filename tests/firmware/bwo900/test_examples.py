"""Worked examples of the manual (the numbers of its lines beside each), as paths in machine coordinates."""

from __future__ import annotations

import math

import pytest
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import Arc, Element
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.programs.expressions import evaluate
from isel_twin.firmware.bwo900.programs.syntax import parse_block, parse_expression
from isel_twin.firmware.bwo900.realtime.path import corner_factor

T1 = {"p21000": 1.0, "p21020": 2.0, "p21030": 3.0}
"""Tools: T1 without radius and length, T2 with radius 3."""


def flat(points: list, count: int = 2) -> list[tuple[float, ...]]:
    return [tuple(round(x, 3) for x in point[:count]) for point in points]


def near(points: list, expected: list, tolerance: float = 2e-3) -> None:
    assert len(points) == len(expected), points
    for point, wanted in zip(points, expected, strict=True):
        assert tuple(point[: len(wanted)]) == pytest.approx(wanted, abs=tolerance)


def elements(blocks: list[PathBlock]) -> list[Element]:
    """All elements, corners done."""
    contour, done = Contour(), list[PathBlock]()
    for block in blocks:
        done += contour.push(block)
    done += contour.flush()
    return [element for block in done for element in block.elements]


def test_jumps_by_comparison() -> None:
    """L4149."""
    text = "N5 P500:{} P10:3\nN7 {}\n" + "\n".join(f"N{n} P1:{n} M30" for n in (8, 10, 30, 40, 50, 80))
    for value, jump, goal in (
        (110, "P500=110.50", 50),
        (109, "P500=110.50", 8),
        (4, "P500>P10.10", 10),
        (250, "P500<250.15.30", 30),
        (251, "P500<250.15.30", 8),
        (1, "P500<>0.40", 40),
        (0, "P500>=0.50", 50),
        (-1, "P500<=0.80", 80),
        (0, "P500<>0.40", 8),
    ):
        assert Analysed(text.format(value, jump)).parameters.get(1) == goal, jump


class Known:
    def __init__(self, **values: float) -> None:
        self.values = {int(name[1:]): value for name, value in values.items()}

    def parameter(self, area: str, number: int, channel: int) -> float:
        if number not in self.values:
            raise ProgramError(1300)
        return self.values[number]

    def symbol(self, name: str, index: int) -> float:
        return 0.0


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("sin(90)", 1.0),
        ("sqr(P20)", 3.0),
        ("int(1.667)", 1.0),
        ("intr(1.667)", 2.0),
        ("abs(-1,2)", 1.2),
        ("ln(148.413)", 4.99999),
        ("log(100)", 2.0),
        ("exp(5)", 148.413),
        ("P500 or $100;", 0x2101),
        ("(P20+35)*3", 132.0),
        ("P20mod4", 1.0),
        ("sinP1", 0.5),
        ("2+3*4-6/3", 12.0),
        ("tan(45)", 1.0),
    ],
)
def test_functions(text: str, value: float) -> None:
    """L4161."""
    assert evaluate(parse_expression(text), Known(p20=9, p500=0x2001, p1=30)) == pytest.approx(value, rel=1e-5)


@pytest.mark.parametrize(
    ("text", "number"), [("1/0", 1203), ("sqr(-1)", 1212), ("log(0)", 1213), ("tan(90)", 1213), ("P77", 1300)]
)
def test_functions_without_a_value(text: str, number: int) -> None:
    with pytest.raises(ProgramError) as error:
        evaluate(parse_expression(text), Known())
    assert error.value.number == number


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("N10 " + " ".join(f"G{n}" for n in (0, 17, 29, 40, 43, 46, 53, 60, 90)), 1222),
        ("N10 " + "M3 " * 9, 1222),
        ("N10 " + " ".join(f"P{n}:1" for n in range(33)), 1208),
        ("N10 X" + "(" * 11 + "1" + ")" * 11, 1209),
        ("N10 X(1", 1210),
        ("N10 M1000", 1227),
        ("N10 X1 X2", 1222),
        ("N10 " + "Y1 (" + "x" * 200 + ")", 1222),
        ("N100 waituntil P1+P2+P3+P4+P5 > P6+P7+P8+P9", 1222),
        ("N10 P5", 1214),
        ("N10 X:", 1211),
    ],
)
def test_limits_of_a_block(text: str, number: int) -> None:
    with pytest.raises(ProgramError) as error:
        parse_block(text)
    assert error.value.number == number
    assert error.value.column <= len(text) + 1


def test_symbols() -> None:
    """L4197."""
    run = Analysed("N5 P12:7\nN10 _test1::=12\nN20 _test2:=10\nN30 G00 X:_test1 Y:_test2\nN40 _test1[1]:=11 M30")
    assert flat(run.points) == [(7.0, 10.0)]
    assert run.parameters.get(13) == 11.0


POINTS = [(0, 0), (90, 0), (60, 25), (90, 60), (30, 85), (45, 55), (0, 0)]


def check_polar_contour(run: Analysed) -> None:
    path = [block for block in run.path if not block.rapid]
    near([block.finish for block in path], POINTS[1:])
    arcs = [element for block in path for element in block.elements if isinstance(element, Arc)]
    near([arc.centre for arc in arcs], [(56.159, 63.281), (31.652, 67.076)], 6e-3)
    assert [math.degrees(arc.sweep_rad) for arc in arcs] == pytest.approx([145.83, -137.40], abs=0.02)


def test_a_contour_in_cartesian_and_in_polar_coordinates() -> None:
    """L6218 P656, L6242 P657, L6267 P659."""
    head = "N10 G0 X0 Y0 Z2 F1000\n"
    check_polar_contour(
        Analysed(
            head + "N20 G1 X90\nN30 X60 Y25\nN40 X90 Y60\nN50 G3 X30 Y85 R34\nN60 G2 X45 Y55 R18\nN70 G1 X0 Y0\nN80 M30"
        )
    )
    check_polar_contour(
        Analysed(
            head + "N15 G10 X0 Y0\nN20 G1 x:90 c:0\nN30 x:65 c:22.619\nN40 x:108.166 c:33.690\n"
            "N50 G3 x:90.138 c:70.559 R:34\nN60 G2 x:71.063 c:50.710 R:18\nN70 G1 x:0 c:0\nN80 G11 M30"
        )
    )


def test_rotated_triangles_and_a_row_of_them() -> None:
    """L6636, L6696."""
    run = Analysed(
        "N10 G45 G00 G54 Z2 P160:0 P161:0 P163:0 F2000 M24.4\nN20 G00 X10 Y0\nN30 G01 Z-1,5\nN40 X40\nN50 Y15\n"
        "N60 X10 Y0\nN70 Z2 P168:90 M25\nN80 M30"
    )
    starts = [block.start[:2] for block in run.path if block.number == 40]
    near(starts, [(10, 0), (0, 10), (-10, 0), (0, -10)], 1e-9)
    assert run.path[-1].finish == pytest.approx((10.0, 0.0, 2.0))
    run = Analysed(
        "N10 G45 G0 Z0 P160:0 P161:0 P163:45 F2000 M24.2\nN20 G00 X10 Y0\nN30 G01 Z50\nN40 X40\nN50 Y15\nN60 X10 Y0\n"
        "N70 Z70 P165:55 M25\nN80 M30"
    )
    corners = [place[:2] for block in run.path if block.number in (40, 50) for place in (block.start, block.finish)]
    corners = [place for number, place in enumerate(corners) if number % 4 != 2]
    near(corners[:3], [(7.071, 7.071), (28.284, 28.284), (17.678, 38.891)])
    near(corners[3:], [(45.962, 45.962), (67.175, 67.175), (56.569, 77.782)])


def test_a_part_turned_and_moved_by_a_subprogram() -> None:
    """L6745."""
    run = Analysed(
        "P451\nN10 T1 M16 G0\nN20 G55 G49 G60 G0 F3000 X0 Y0 Z2 M28.452\n"
        "N30 G45 P160:50 P161:10 P163:30 X0 Y0 Z2 M28.452\nN40 P165:50 P166:10 P168:30 X0 Y0 Z2 M28.452\n"
        "N50 G46 G90\nN60 M30\n"
        "P452\nN10 G0 F3000 Z1.5\nN20 G1 G91 X0 Y0 Z-2.5\nN30 X30\nN40 Y20\nN50 X-30\nN60 Y-20\nN70 Z2.5\nN80 G90 M02",
        **T1,
    )
    corners = [block.finish[:2] for block in run.path if block.program == "P452" and 30 <= block.number <= 60]
    near(corners[:4], [(30, 0), (30, 20), (0, 20), (0, 0)])
    near(corners[4:8], [(75.981, 25), (65.981, 42.321), (40, 27.321), (50, 10)])
    near(corners[8:], [(81.340, 84.282), (64.019, 94.282), (49.019, 68.301), (66.340, 58.301)])


def test_mirrored_programs_turn_circles_and_sides() -> None:
    """L7185, L7206."""
    text = "N10 {} G0 X10 Y20 F1000 tr:2\nN20 G41 G2 X20 Y30 I20 J20\nN30 M30"
    for g, factor, turned in (("G60", (1, 1), 1), ("G61", (-1, 1), -1), ("G62", (1, -1), -1), ("G61 G62", (-1, -1), 1)):
        run = Analysed(text.format(g))
        near(run.points, [(10 * factor[0], 20 * factor[1]), (20 * factor[0], 30 * factor[1])], 1e-9)
        arc = run.path[1].elements[0]
        assert isinstance(arc, Arc)
        assert math.copysign(1, arc.sweep_rad) == -turned
        assert run.path[1].correction.side == turned


def test_axis_correction_and_shift_move_nothing_by_themselves() -> None:
    """L6531, L7278."""
    run = Analysed("N100 G44 X10 Y20 Z30\nN120 G01 F1000 X100 Y100 Z100\nN130 G43\nN140 X100 Y100 Z100\nN150 M30")
    near(run.points, [(110, 120, 130), (100, 100, 100)], 1e-9)
    run = Analysed("N1 G0 X5\nN123 G92 X10 Y10 Z10\nN130 X1 Y1\nN140 G53 X1 Y1\nN150 M30")
    near(run.points, [(5, 0, 0), (11, 11, 0), (1, 1, 0)], 1e-9)


def test_roundings_between_lines_and_circles() -> None:
    """L6327 P391."""
    run = Analysed(
        "N10 G55 G29 G48 G00 F2000 T1 M16 X0 Y0 Z2\nN20 G01 Z:-1\nN30 G12 P71:8 X:40 Y:0\n"
        "N40 G12 G02 R65 P71:28 X62.5 Y:91\n"
        "N50 G12 G02 R65 P71:15 X95 Y:35\nN60 G12 G01 P71:8 X120 Y:35\nN70 G12 G02 P71:12 I95 J35 X95 Y:10\n"
        "N80 G12 G03 P71:10 I70 J10 X45 Y:10\nN90 G01 X34.5 Y:10\nN100 G00 Z:2\nN110 M30",
        **T1,
    )
    arcs = {round(e.radius_mm): e for e in elements(run.blocks) if isinstance(e, Arc)}
    expected = {
        28: ((62.490, 52.413), (37.911, 65.825), (87.076, 65.812)),
        15: ((108.526, 50.000), (93.802, 47.133), (108.526, 35.0)),
        12: ((103.679, 25.321), (111.690, 16.387), (92.756, 20.352)),
        10: ((36.459, 20.000), (46.042, 17.143), (36.459, 10.0)),
    }
    for radius, (centre, start, end) in expected.items():
        near([arcs[radius].centre, arcs[radius].start, arcs[radius].end], [centre, start, end])
    eights = [e for e in elements(run.blocks) if isinstance(e, Arc) and round(e.radius_mm) == 8]
    near([e.centre for e in eights], [(27.023, 8.0), (110.0, 27.0)])
    near([e.end for e in eights], [(34.469, 10.925), (117.059, 23.235)])


def test_lines_and_circles_through_three_points() -> None:
    """L6087 P2050, L3239."""
    run = Analysed(
        "N10 G49 G56 G0 F3000 X:0 Y:0 Z:2\nN20 X:21.1 Y:9.300 Z:-1\nN30 G123 G1 X:19.6 Y:54.3\n"
        "N40 X:45.0 Y:61.0\n"
        "N50 G123 X:63.0 Y:46.7\nN60 X:82.9 Y:30.5\nN70 G123 X:81.2 Y:18.8\nN80 X:108.8 Y:21.6\n"
        "N90 G123 X:101.0 Y:33.0\n"
        "N100 X:110.3 Y:64.4\nN110 G123 X:108.2 Y:40.6\nN120 X:131.8 Y:25.5\nN130 G123 X:135.7 Y:13.8\n"
        "N140 X:138.447 Y:4.4\n"
        "N150 Z:2\nN160 M30"
    )
    made = [e for e in elements(run.blocks)][2:-1]
    kinds = [math.copysign(e.radius_mm, e.sweep_rad) if isinstance(e, Arc) else 0.0 for e in made]
    assert kinds == pytest.approx(
        [-29.212, -29.212, 0, 0, 14.116, 14.116, -27.601, -27.601, 25.070, 25.070, 0, 0], abs=2e-3
    )
    near(
        [e.centre for e in made if isinstance(e, Arc)][::2],
        [(38.955, 32.420), (94.736, 22.807), (126.955, 42.390), (131.205, 50.563)],
    )


def test_corner_factors() -> None:
    """L13276, angles between the lines."""
    for exponent, expected in ((1.0, (0, 0.5, 0.707, 0.866, 1)), (3.0, (0, 0.125, 0.354, 0.650, 1))):
        for angle, factor in zip((90, 120, 135, 150, 180), expected, strict=True):
            cosine = math.cos(math.radians(180 - angle))
            assert corner_factor(cosine, exponent) == pytest.approx(factor, abs=1e-3)
    assert corner_factor(-1.0, -1.0) == 1.0


def test_a_user_cycle_and_loops() -> None:
    """L9353, L9495."""
    run = Analysed("P2000\nN60 P500:2 G1001\nN70 M30\nZ1001\nN10 P500:P500+1\nN20 M02")
    assert run.parameters.get(500) == 3.0
    run = Analysed("N10 G91 G0 M24.07\nN20 X1 M24.2\nN30 Y1 M25\nN40 M25\nN50 M30")
    assert run.points[-1] == pytest.approx((7.0, 14.0, 0.0))


def test_subprograms_and_their_parts() -> None:
    """L9527."""
    sub = "P40\nN10 P1:P1+1\nN20 P1:P1+10\nN30 P1:P1+100\nN40 P1:P1+1000\nN50 M30"
    for call, value in (("M28.40", 1111), ("M28.40.20", 1110), ("M28.40.10_30", 111), ("M28..30", 1000)):
        run = Analysed(f"P1\nN5 P1:0\nN10 {call}\nN20 M30\nN30 P1:P1+1000\nN40 M02\n{sub}")
        assert run.parameters.get(1) == value, call


def test_six_levels_and_no_more() -> None:
    def nested(levels: int) -> str:
        calls = [f"P{n}\nN10 M28.{n + 1}\nN20 M30" for n in range(1, levels + 1)]
        return "\n".join([*calls, f"P{levels + 1}\nN10 P9:1\nN20 M30"])

    assert Analysed(nested(6), first="P1").parameters.get(9) == 1.0
    with pytest.raises(ProgramError) as error:
        Analysed(nested(7), first="P1")
    assert error.value.number == 1220


def test_zero_points_of_the_table() -> None:
    """L11110."""
    run = Analysed("N10 G54 G0 X1\nN20 G55 X1\nN30 G153 X1\nN40 M30", p20003=100.0, p20006=200.0)
    near(run.points, [(101,), (201,), (1,)], 1e-9)


def test_tool_words() -> None:
    """L9671, L12776."""
    run = Analysed("N10 G0 X0 tr:50 t:0.5 F100\nN20 G1 X10 G42\nN30 G40 M30")
    assert (run.path[0].correction.side, run.path[0].correction.radius_mm) == (-1, 50.5)
    run = Analysed("N10 F100 tr:10\nN20 G1 X10 G42\nN30 G40 M30", p8748=2.5)
    assert run.path[0].correction.radius_mm == 7.5
    run = Analysed("N10 G0 Z5 tl:80\nN20 Z5\nN30 M30")
    near(run.points, [(0, 0, 5), (0, 0, 85)], 1e-9)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        ("N10 G2 X10 Y0 F100", 1233),
        ("N10 G2 X0 Y0 R5 F100", 1231),
        ("N10 G1 X10", 1230),
        ("N10 G2 X10 Y0 I5 J1 F100\nN20 G2 X20 Y5 I15 J0", 1238),
        ("N10 M25", 1217),
        ("N10 M24", 1218),
        ("N10 M23.99", 1255),
        ("N10 M28.99", 1252),
        ("N10 G54 G55 X1", 1232),
        ("N10 G1234", 1252),
        ("N10 Q5", 1216),
        ("N10 G41 G1 F100 X10 M00", 1232),
        ("N10 G41 G1 F100 X10 M01", 1229),
        ("N10 T77", 1050),
        ("N10 G95", 1224),
    ],
)
def test_messages(text: str, number: int) -> None:
    with pytest.raises(ProgramError) as error:
        Analysed(text + "\nN900 M30", **T1)
    assert error.value.number == number


def test_a_radius_too_small_is_corrected_and_stops() -> None:
    run = Analysed("N10 G2 X10 Y0 R3 F100\nN20 M30")
    assert [note.number for note in run.interpreter.notes] == [1234]
    arc = run.path[0].elements[0]
    assert isinstance(arc, Arc)
    assert arc.radius_mm == pytest.approx(5.0)
