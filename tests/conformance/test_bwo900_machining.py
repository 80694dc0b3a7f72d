"""BWO 900, chapter 5, sentence by sentence: what the manual's text and tables say of its cycles beyond the examples.

Places are worked out from the printed formulas; the programs are the printed ones, or as near to them as the sentence
asks for.
"""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from conformance.bwo900_desk import analysed
from conformance.rows import case, shows
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.geometry.elements import Arc
from isel_twin.firmware.bwo900.messages import ProgramError

TOOLS = {"p21000": 1.0, "p21010": 4.0, "p21020": 2.0, "p21030": 3.0}
"""T1 with radius 4 mm, T2 with radius 3 mm."""
MILL = "N10 G00 G54 G90 F2500 S900 T02 M06 M03 M07"
DRILL = "N20 G56 G00 X0 Y0 Z100 S1200 F1500 M03 T01 M16"
POCKETS = {
    "G71": "P11:71 P12:41 P13:5 P15:0 P16:4 P17:3 P19:2 P21:100",
    "G72": "P11:66 P12:31 P13:5 P15:0 P16:5,1 P17:3 P19:1",
    "G73": "P11:64 P12:35 P13:5 P15:1 P16:4,5 P17:2 P19:1 P20:1",
    "G74": "P13:27 P14:33 P16:5,1 P17:5 P19:1",
    "G75": "P13:35 P14:28 P15:2 P16:4,1 P17:8 P19:1 P20:2",
}
"""Parameters of the printed examples, P14 of G73 deleted (bwo900/44)."""
HOLES = {
    "G81": "P32:800 P33:0 P34:32 P35:60",
    "G83": "P32:800 P33:0 P34:48 P35:60 P36:3",
    "G84": "P32:10 P33:20 P34:52 P35:60",
    "G85": "P32:800 P33:0 P34:32",
}
RAPID = None


def refused(text: str, **values: float) -> int:
    with pytest.raises(ProgramError) as error:
        analysed(text, **{**TOOLS, **values})
    return error.value.number


def done(text: str, **values: float) -> Analysed:
    return analysed(text, **{**TOOLS, **values})


def moves(program: Analysed, number: int = 20) -> list[tuple[tuple[float, ...], float | None]]:
    """Ends and feeds (None: rapid) of a block's path."""
    return [
        (tuple(round(x, 3) + 0.0 for x in block.finish), block.feed_mm_min)
        for block in program.path
        if block.number == number
    ]


def codes(program: Analysed, number: int) -> list[int]:
    """M functions of a block, in order."""
    return [f.code for b in program.blocks if b.number == number for f in (*b.pre, *b.post)]


def near(found: Sequence[Sequence[float]], wanted: Sequence[Sequence[float]]) -> None:
    assert len(found) == len(wanted), found
    for a, b in zip(found, wanted, strict=True):
        assert tuple(a[: len(b)]) == pytest.approx(tuple(b), abs=6e-4)


# 5.2 Milling


@shows("bwo900-5.2-13")
@pytest.mark.parametrize("cycle", POCKETS)
def test_a_pocket_is_milled_in_its_block_and_its_parameters_stay(cycle: str) -> None:
    program = done(f"{MILL}|N20 {cycle} X50 Y50 Z2 {POCKETS[cycle]}|N30 X60|N40 {cycle} X50|N50 M30")
    first, plain, again = (moves(program, number) for number in (20, 30, 40))
    assert plain == [((60.0, 50.0, 2.0), RAPID)]
    assert again[1:] == first[1:]
    assert len(first) > 10


@shows("bwo900-5.2-14")
@pytest.mark.parametrize("cycle", POCKETS)
def test_a_pocket_begins_where_the_tool_stands(cycle: str) -> None:
    """In the middle, at the safety distance: without words of axes the tool is there already."""
    there = done(f"{MILL}|N20 {cycle} X50 Y50 Z2 {POCKETS[cycle]}|N30 M30")
    before = done(f"{MILL}|N15 X50 Y50 Z2|N20 {cycle} {POCKETS[cycle]}|N30 M30")
    assert moves(there)[0] == ((50.0, 50.0, 2.0), RAPID)
    assert moves(before) == moves(there)[1:]
    top = 2.0 - (2.0 if cycle == "G71" else 1.0)
    floors = {"G71": 5, "G72": 5, "G73": 5, "G74": 27, "G75": 35}
    assert min(place[2] for place, _ in moves(there)) == top - floors[cycle]
    assert moves(there)[-1][0] == (50.0, 50.0, 2.0)


@shows("bwo900-5.2-15")
@pytest.mark.parametrize("cycle", ["G71", "G72", "G73"])
@pytest.mark.parametrize(("sizes", "axis"), [((40, 40), 0), ((41, 40), 0), ((40, 41), 1)])
def test_rows_run_along_the_longer_side_and_along_x_where_both_are_equal(
    cycle: str, sizes: tuple[int, int], axis: int
) -> None:
    words = f"P11:{sizes[0]} P12:{sizes[1]} P13:3 P16:4 P17:3 P19:1"
    program = done(f"{MILL}|N20 {cycle} X50 Y50 Z1 {words}|N30 M30")
    low = [b.elements[0] for b in program.path if b.finish[2] == b.start[2] == -3.0]
    across = [e for e in low if abs(e.end[axis] - e.start[axis]) > 20 and abs(e.end[1 - axis] - 50) < 10]
    assert len(across) >= 4
    assert not [e for e in low if abs(e.end[1 - axis] - e.start[1 - axis]) > 20 and abs(e.end[axis] - 50) < 10]


@shows("bwo900-5.2-10")
@pytest.mark.parametrize("cycle", POCKETS)
def test_all_but_p16_are_positive(cycle: str) -> None:
    numbers = {11: 8011, 12: 8012, 13: 8013, 14: 8014, 15: 8015, 17: 8017, 18: 8018, 19: 8019, 20: 8020, 21: 8021}
    if cycle in ("G74", "G75"):
        numbers |= {11: 8010}
        del numbers[12]
    if cycle not in ("G73", "G75"):
        del numbers[20]
    for number, message in numbers.items():
        text = f"{MILL}|N15 {POCKETS[cycle]}|N20 {cycle} X50 Y50 Z2 P{number}:-1|N30 M30"
        assert refused(text) == message, f"P{number}"
    done(f"{MILL}|N15 {POCKETS[cycle]}|N20 {cycle} X50 Y50 Z2 P16:-4|N30 M30")


@shows("bwo900-5.2-1", "bwo900-5.2-2")
def test_g71_step_by_step() -> None:
    """The printed order of work, with the places of example 1 (the burrs are bwo900/38)."""
    program = done(f"{MILL}|N20 G71 X55,5 Y40,5 Z2 P14:-- {POCKETS['G71']}|N30 M30")
    found = moves(program)
    expected: list[tuple[tuple[float, ...], float | None]] = [((55.5, 40.5, 2.0), RAPID), ((23.0, 23.0, 2.0), RAPID)]
    for floor in (-3.0, -5.0):
        if floor == -5.0:
            expected.append(((23.0, 23.0, -1.0), RAPID))  # the safety distance above what is left (bwo900/39)
        expected.append(((23.0, 23.0, floor), 100.0))
        rows = [23.0, 27.0, 31.0, 35.0, 39.0, 43.0, 47.0, 51.0, 55.0, 58.0]
        for before, y in zip([None, *rows], rows, strict=False):
            if before is not None:
                expected += [
                    ((88.0, before, floor + 2.0), RAPID),  # 2 mm up
                    ((23.0, before, floor + 2.0), RAPID),  # back
                    ((23.0, before, floor), 2500.0),  # down
                    ((23.0, y, floor), 2500.0),  # across
                ]
            expected.append(((88.0, y, floor), 2500.0))
        expected += [((x, y, floor), 2500.0) for x, y in ((88.0, 23.0), (23.0, 23.0), (23.0, 58.0))]  # burrs
        expected += [((23.0, 58.0, 2.0), RAPID), ((23.0, 23.0, 2.0), RAPID)]
    expected.append(((55.5, 40.5, 2.0), RAPID))
    assert found == expected


@shows("bwo900-5.2-3")
def test_g72_step_by_step() -> None:
    program = done(f"{MILL}|N20 G72 X53 Y35,5 Z1 P14:-- {POCKETS['G72']}|N30 M30")
    found = moves(program)
    expected: list[tuple[tuple[float, ...], float | None]] = [((53.0, 35.5, 1.0), RAPID), ((23.0, 23.0, 1.0), RAPID)]
    for floor in (-3.0, -5.0):
        if floor == -5.0:
            expected.append(((23.0, 23.0, -2.0), RAPID))
        expected.append(((23.0, 23.0, floor), 2500.0))
        for number, y in enumerate((23.0, 28.1, 33.2, 38.3, 43.4, 48.0)):
            here, there = (23.0, 83.0) if number % 2 == 0 else (83.0, 23.0)
            if number:
                expected.append(((here, y, floor), 2500.0))
            expected.append(((there, y, floor), 2500.0))
        expected += [
            ((23.0, 23.0, floor), 2500.0),  # burrs of one edge, from where the last row has ended
            ((23.0, 23.0, 1.0), RAPID),
            ((23.0, 23.0, floor + 2.0), RAPID),  # to the height before
            ((23.0, 23.0, floor), 2500.0),
            ((83.0, 23.0, floor), 2500.0),
            ((83.0, 48.0, floor), 2500.0),  # those of the other edge
            ((83.0, 48.0, 1.0), RAPID),
            ((23.0, 23.0, 1.0), RAPID),
        ]
    expected.append(((53.0, 35.5, 1.0), RAPID))
    assert found == expected


@shows("bwo900-5.2-5", "bwo900-5.2-7")
@pytest.mark.parametrize(
    ("block", "centre", "floors", "radii"),
    [
        (f"G74 X53 Y53 Z1 {POCKETS['G74']}", 53, [5, 10, 15, 20, 25, 27], [5.1, 10.2, 15.3, 20.4, 25.5, 30]),
        ("G74 X50 Y50 Z1 P11:10 P13:31 P14:30 P16:4 P17:8 P19:1", 50, [8, 16, 24, 31], [14, 18, 22, 26, 27]),
        (f"G75 X48 Y48 Z1 {POCKETS['G75']}", 48, [8, 16, 24, 32, 35], [4.1, 8.2, 12.3, 16.4, 20.5, 23]),
    ],
)
def test_spirals_in_every_layer(block: str, centre: int, floors: list[int], radii: list[float]) -> None:
    """The spiral crosses the first axis at the printed infeeds; what comes back within the wall is bwo900/42."""
    program = done(f"{MILL}|N20 {block}|N30 M30")
    found: dict[float, list[float]] = {}
    for b in program.path:
        if b.feed_mm_min == 2500.0 and b.start[2] == b.finish[2] < 0 and abs(b.finish[1] - centre) < 1e-9:
            x, height = round(b.finish[0] - centre, 6), -round(b.finish[2], 6)
            crossed = found.setdefault(height, [])
            if x > max(crossed, default=0.0) + 1e-6:
                crossed.append(x)
    assert list(found) == floors
    assert all(crossed == pytest.approx(radii) for crossed in found.values())


@shows("bwo900-5.2-4")
def test_g73_step_by_step() -> None:
    """Contour in all layers, up, rows in all layers (bwo900/40), up, the last contour at half the feed, back."""
    found = moves(done(f"{MILL}|N20 G73 X52,5 Y37,5 Z1 P14:-- {POCKETS['G73']}|N30 M30"))

    def around(left: float, low: float, right: float, high: float, z: float, feed: float) -> list[object]:
        return [((x, y, z), feed) for x, y in ((right, low), (right, high), (left, high), (left, low))]

    begin: list[object] = [((52.5, 37.5, 1.0), RAPID), ((24.5, 24.0, 1.0), RAPID)]
    for floor in (-2.0, -4.0, -5.0):
        begin += [((24.5, 24.0, floor), 2500.0), *around(24.5, 24.0, 80.5, 51.0, floor, 2500.0)]
    begin.append(((24.5, 24.0, 1.0), RAPID))
    assert found[: len(begin)] == begin
    end: list[object] = [((23.5, 23.0, 1.0), RAPID), ((23.5, 23.0, -5.0), 1250.0)]
    end += [*around(23.5, 23.0, 81.5, 52.0, -5.0, 1250.0), ((23.5, 23.0, 1.0), 2500.0), ((52.5, 37.5, 1.0), 2500.0)]
    assert found[-len(end) :] == end
    between = found[len(begin) : -len(end)]
    assert list(dict.fromkeys(place[2] for place, feed in between if feed)) == [-2.0, -4.0, -5.0]
    rows = [place for place, feed in between if feed and place[2] == -2.0]
    assert [y for _, y, _ in rows[1::2]] == [28.5, 33.0, 37.5, 42.0, 46.5], "P16 apart, forth and back"


@shows("bwo900-5.2-16")
def test_finishing_begins_where_p16_says() -> None:
    """P20 goes the way of P16: of G73 from S1 or S2, of G75 in the same sense."""
    words = "P11:65 P12:35 P13:5 P14:11 P15:1,5 P17:2 P19:1 P20:1"
    for infeed, corner in (("4,2", (31.0, 23.5)), ("-4,2", (74.0, 51.5))):
        found = moves(done(f"{MILL}|N20 G73 X52,5 Y37,5 Z1 P16:{infeed} {words}|N30 M30"))
        down = next(place for place, feed in found if feed == 1250.0)
        assert down == (*corner, -5.0)
    for infeed, sense in (("4,1", -1), ("-4,1", 1)):
        program = done(f"{MILL}|N20 G75 X48 Y48 Z1 {POCKETS['G75'].replace('4,1', infeed)}|N30 M30")
        fine = [b.elements[0] for b in program.path if b.feed_mm_min == 1250.0]
        assert {math.copysign(1, e.sweep_rad) for e in fine if isinstance(e, Arc)} == {sense}


@shows("bwo900-5.2-5")
@pytest.mark.parametrize("cycle", ["G74", "G75"])
def test_a_drilled_pocket_begins_at_p11_and_p16(cycle: str) -> None:
    words = "P11:10 P13:31 P14:30 P15:1 P16:4 P17:8 P19:1 P20:1"
    found = moves(done(f"{MILL}|N20 {cycle} X50 Y50 Z1 {words}|N30 M30"))
    assert found[:3] == [((50.0, 50.0, 1.0), RAPID), ((50.0, 50.0, -8.0), 2500.0), ((64.0, 50.0, -8.0), 2500.0)]


# 5.3 Drilling


@pytest.mark.parametrize(
    ("spoken", "number"),
    [
        case("bwo900-5.3-6", "M03", 8300),
        case("bwo900-5.3-6", "S0 M03", 8302),
        case("bwo900-5.3-6", "S1200", 8301),
        case("bwo900-5.3-6", "S1200 M05", 8301),
    ],
)
@pytest.mark.parametrize("cycle", HOLES)
def test_a_spindle_that_does_not_turn(cycle: str, spoken: str, number: int) -> None:
    assert refused(f"N10 G00 Z100 {spoken}|N20 {cycle} X5 {HOLES[cycle]}|N30 M30") == number
    done(f"N10 G00 Z100|N20 {cycle} X5 {HOLES[cycle]} S1200 M04|N30 M30")


@shows("bwo900-5.3-10")
@pytest.mark.parametrize("cycle", HOLES)
def test_a_hole_is_drilled_in_its_block_and_its_parameters_stay(cycle: str) -> None:
    program = done(f"{DRILL}|N30 {cycle} X5 {HOLES[cycle]}|N40 X20|N50 {cycle} X5|N60 M30")
    assert len(moves(program, 40)) == 1
    first, again = ([(m[0][2], m[1]) for m in moves(program, number)] for number in (30, 50))
    assert again[-len(first) + 1 :] == first[1:]
    assert any(feed for _, feed in again)


@pytest.mark.parametrize(
    ("cycle", "missing", "number"),
    [
        *(case("bwo900-5.3-11", cycle, p, m) for cycle in HOLES for p, m in ((32, 8032), (33, 8033), (34, 8034))),
        case("bwo900-5.3-11", "G83", 36, 8036),
        case("bwo900-5.3-11", "G83 P39:1 P36:2", 37, 8037),
    ],
)
def test_what_a_drilling_cycle_needs(cycle: str, missing: int, number: int) -> None:
    words = HOLES[cycle[:3]]
    assert refused(f"{DRILL}|N25 {words}|N30 {cycle} X5 P{missing}:--|N40 M30") == number


@shows("bwo900-5.3-11")
@pytest.mark.parametrize("cycle", HOLES)
def test_dwell_and_retract_plane_may_be_missing(cycle: str) -> None:
    program = done(f"{DRILL}|N30 {cycle} X5 {HOLES[cycle]} P30:-- P35:--|N40 M30")
    assert not [b for b in program.blocks if b.dwell_s]
    approach = float(HOLES[cycle].split("P34:")[1].split()[0])
    assert program.points[-1] == (5.0, 0.0, approach)


@pytest.mark.parametrize(
    ("cycle", "turn", "functions"),
    [
        *(case("bwo900-5.3-12", cycle, "M03", [3, 5]) for cycle in ("G81", "G83", "G85")),
        *(case("bwo900-5.3-12", cycle, "M04", [4, 5]) for cycle in ("G81", "G83", "G85")),
        case("bwo900-5.3-12", "G84", "M03", [3, 4, 5]),
        case("bwo900-5.3-12", "G84 P31:0", "M04", [4, 3, 5]),
        case("bwo900-5.3-12", "G84 P31:3", "M03", [3, 4, 5]),
        case("bwo900-5.3-12", "G84 P31:1", "M03", [3, 4, 5]),
        case("bwo900-5.3-12", "G84 P31:4", "M03", [4, 3, 5]),
    ],
)
def test_the_spindle_is_switched_on_reversed_and_off(cycle: str, turn: str, functions: list[int]) -> None:
    program = done(f"{DRILL.replace('M03', turn)}|N30 {cycle} X5 {HOLES[cycle[:3]]}|N40 M30")
    assert codes(program, 30) == functions
    spoken = [b for b in program.blocks if b.number == 30 and (b.pre or b.post)]
    assert spoken[0].finish == (0.0, 0.0, 100.0), "on before the axes move"
    assert spoken[-1].finish[2] == program.points[-1][2], "off at the end"
    if cycle[:3] == "G84":
        assert spoken[1].finish[2] == 20.0, "reversed at the depth"


@shows("bwo900-5.3-4")
def test_tapping_waits_while_the_spindle_reverses() -> None:
    program = done(f"{DRILL}|N30 G84 Z80 P30:0,5 {HOLES['G84']}|N40 M30")
    cycle = [b for b in program.blocks if b.number == 30]
    reversed_at = next(k for k, b in enumerate(cycle) if [f.code for f in b.post] == [4])
    dwells = [k for k, b in enumerate(cycle) if b.dwell_s]
    assert [cycle[k].dwell_s for k in dwells] == [0.5]
    up = next(k for k, b in enumerate(cycle) if b.elements and b.start[2] == 20.0)
    assert reversed_at < dwells[0] < up
    assert moves(program, 30) == [
        ((0.0, 0.0, 80.0), RAPID),
        ((0.0, 0.0, 52.0), RAPID),
        ((0.0, 0.0, 20.0), 12_000.0),
        ((0.0, 0.0, 52.0), 12_000.0),
        ((0.0, 0.0, 60.0), RAPID),
    ]
    assert (cycle[dwells[0]].finish[2], program.points[-1][2]) == (20.0, 60.0)


@shows("bwo900-5.3-13")
def test_places_are_reached_in_rapid() -> None:
    program = done(f"{DRILL}|N30 G81 X5 Y7 {HOLES['G81']}|N40 M30")
    assert moves(program, 30)[0] == ((5.0, 7.0, 100.0), RAPID)


@shows("bwo900-5.3-13")
@pytest.mark.parametrize(("g", "sweep"), [("G02 R-30", -270.0), ("G03 R30", 90.0)])
def test_polar_places_with_g02_and_g03_are_reached_with_the_feed(g: str, sweep: float) -> None:
    text = f"{DRILL}|N24 G10 X40 Y0|N26 G01 x30 c0|N30 {g} G81 c90 {HOLES['G81']}|N40 M30"
    first = next(b for b in done(text).path if b.number == 30)
    assert first.feed_mm_min == 1500.0
    assert first.finish[:2] == pytest.approx((40.0, 30.0))
    assert isinstance(first.elements[0], Arc)
    assert math.degrees(first.elements[0].sweep_rad) == pytest.approx(sweep)


@shows("bwo900-5.3-14")
@pytest.mark.parametrize(("plane", "words", "place"), [("G17", "X3 Y4", (23, 34, 0)), ("G18", "X3 Z4", (23, 0, 54))])
def test_with_g91_the_place_counts_from_the_last_one(plane: str, words: str, place: tuple[float, ...]) -> None:
    start = "X20 Y30 Z100" if plane == "G17" else "X20 Y100 Z50"
    program = done(f"N20 {plane} G00 {start} S1200 M03|N30 G91 G81 {words} P32:800 P33:0 P34:32|N40 M30")
    bottom = [b.finish for b in program.path if b.feed_mm_min == 800]
    assert bottom == [place]


@shows("bwo900-5.3-15")
def test_g66_acts_in_the_whole_cycle() -> None:
    """From the machine's zero: no zero point, in all of the cycle's moves; in the next block it is over."""
    text = f"N20 G56 G00 X0 Y0 Z100 S1200 M03|N30 G66 G81 X5 Y7 {HOLES['G81']}|N40 X1|N50 M30"
    program = done(text, p20009=10.0, p20010=20.0, p20011=30.0)
    assert moves(program, 30)[1:] == [
        ((5.0, 7.0, 32.0), RAPID),
        ((5.0, 7.0, 0.0), 800.0),
        ((5.0, 7.0, 60.0), RAPID),
    ]
    assert moves(program, 40)[0][0][0] == 11.0


@shows("bwo900-5.3-15")
@pytest.mark.parametrize("words", ["X50 Y50 Z2", ""])
@pytest.mark.parametrize("cycle", POCKETS)
def test_g66_acts_in_all_moves_of_a_pocket(cycle: str, words: str) -> None:
    """Lines and arcs, with a zero point and a mirror that do not count."""
    text = f"{MILL} {{}}|N15 X50 Y50 Z2|N20 {{}} {cycle} {words} {POCKETS[cycle]}|N30 M30"
    plain = done(text.format("", ""))
    bare = done(text.format("G61 G55", "G66").replace("G54", ""), p20006=7.0, p20007=-3.0, p20008=1.0)
    if words:
        assert moves(bare)[1:] == moves(plain), "and the way there"
    else:  # about the place where the axes stand in the machine
        shift = [a - b for a, b in zip(moves(bare)[-1][0], moves(plain)[-1][0], strict=True)]
        assert shift == pytest.approx([-93.0, -3.0, 1.0])
        near([m[0] for m in moves(bare)], [[x + d for x, d in zip(m[0], shift, strict=True)] for m in moves(plain)])


@shows("bwo900-5.3-16")
def test_g63_and_g64_stay_in_a_cycle_and_tapping_sets_g63() -> None:
    for g, free in (("G63", False), ("G64", True)):
        for cycle, words in HOLES.items():
            program = done(f"{DRILL}|N30 {g} {cycle} X5 {words}|N40 G01 X9|N50 M30")
            cutting = [b for b in program.path if b.number == 30 and b.feed_mm_min]
            others = [b for b in program.path if (b.number == 30 and not b.feed_mm_min) or b.number == 40]
            assert {b.override for b in others} == {free}
            assert {b.override for b in cutting} == {free and cycle != "G84"}


@shows("bwo900-5.3-17")
def test_other_functions_come_before_or_after_the_paths_of_a_cycle() -> None:
    program = done(f"{DRILL}|N30 G81 X5 {HOLES['G81']} M07 M09|N40 M30")
    assert codes(program, 30) == [7, 3, 5, 9]
    program = done(f"{MILL}|N20 G71 X50 Y50 Z2 {POCKETS['G71']} M08 M09|N40 M30")
    block = [b for b in program.blocks if b.number == 20]
    assert [f.code for f in block[0].pre] == [8]
    assert [f.code for f in block[-1].post] == [9]


@shows("bwo900-5.3-18")
@pytest.mark.parametrize("words", ["P30:2", "P30:--"])
def test_g82_is_g81_with_p30(words: str) -> None:
    g81, g82 = (done(f"{DRILL}|N30 {g} Z80 {HOLES['G81']} {words}|N40 M30") for g in ("G81", "G82"))
    assert [(b.elements, b.dwell_s) for b in g81.blocks] == [(b.elements, b.dwell_s) for b in g82.blocks]


@shows("bwo900-5.3-2", "bwo900-5.3-3", "bwo900-5.3-5")
def test_the_spindle_is_off_behind_the_printed_cycles() -> None:
    """Feeds, dwells and M05 of the printed G83 and G85."""
    equal = done(f"{DRILL}|N30 G83 Z80 P30:1 P32:800 P33:0 P34:48 P35:60 P36:3 P38:1 P39:0|N40 M30")
    fast: list[float | None] = [RAPID, RAPID, 800, RAPID, RAPID, 800, RAPID, RAPID, 800, RAPID]
    assert [feed for _, feed in moves(equal, 30)] == fast
    assert codes(equal, 30) == [3, 5]
    shrinking = done(f"{DRILL}|N30 G83 Z80 P32:800 P33:0 P34:52 P36:4 P37:15 P38:1 P39:1|N40 M30")
    heights: list[tuple[float, float | None]] = [(80, RAPID), (52, RAPID), (37, 800)]
    for before, depth in ((37, 26), (26, 19), (19, 15), (15, 11), (11, 7), (7, 3.5), (3.5, 0)):
        heights += [(52, RAPID), (before + 1, RAPID), (depth, 800)]
    assert [(place[2], feed) for place, feed in moves(shrinking, 30)] == [*heights, (52, RAPID)]
    assert codes(shrinking, 30) == [3, 5]
    boring = done(f"{DRILL}|N30 G85 Z80 P30:1 P32:800 P33:0 P34:32|N40 M30")
    assert [(place[2], feed) for place, feed in moves(boring, 30)] == [(80, RAPID), (32, RAPID), (0, 800), (32, 800)]
    assert [(b.finish[2], b.dwell_s) for b in boring.blocks if b.dwell_s] == [(0.0, 1.0)]
    assert codes(boring, 30) == [3, 5]
    last = [b for b in boring.blocks if b.number == 30 and b.post][-1]
    assert last.finish[2] == 32.0


@shows("bwo900-5.3-19")
@pytest.mark.parametrize("value", ["1", "0,5", "7"])
def test_any_p39_shrinks_strokes(value: str) -> None:
    """The value does not matter: 15, then 11, then what is left, 6 mm, in two halves: 7 and 4 more are too much."""
    program = done(f"{DRILL}|N30 G83 Z80 P32:800 P33:20 P34:52 P36:4 P37:15 P39:{value}|N40 M30")
    assert [place[2] for place, feed in moves(program, 30) if feed] == [37.0, 26.0, 23.0, 20.0]


# 5.4 Patterns


PATTERNS = {
    "G86": "P100:90 P101:30 P106:4",
    "G87": "P100:90 P101:30 P106:4 P110:20 P111:40 P116:3",
    "G88": "P100:90 P101:30 P106:4 P110:20 P111:40 P116:3",
    "G89": "P120:70 P121:20 P122:100 P123:18 P124:120 P126:5",
}


def pattern(call: str, words: str, before: str = "") -> Analysed:
    """The printed programs."""
    return done(
        f"N10 G00 X20 Y20 Z100 S500 M03 T01 M16 {before}|N20 {words}|N30 P32:800 P33:0 P34:32|N40 {call}|N50 M30"
    )


def holes(program: Analysed) -> list[tuple[float, ...]]:
    return [b.finish for b in program.path if b.feed_mm_min == 800]


def ray(angle_deg: float, length: float) -> tuple[float, float]:
    """X(AB) = P104 cos P103, Y(AB) = P104 sin P103."""
    return length * math.cos(math.radians(angle_deg)), length * math.sin(math.radians(angle_deg))


@shows("bwo900-5.4-10")
@pytest.mark.parametrize("cycle", PATTERNS)
def test_a_pattern_acts_in_its_block_and_its_parameters_stay(cycle: str) -> None:
    program = done(
        f"N10 G00 X20 Y20 Z100 S500 M03|N20 {PATTERNS[cycle]} P32:800 P33:0 P34:32|N40 {cycle} G81|N50 X0 Y0|"
        f"N60 {cycle} G81 X20 Y20|N70 M30"
    )
    by_block = {n: [b.finish for b in program.path if b.feed_mm_min == 800 and b.number == n] for n in (40, 50, 60)}
    assert by_block[50] == []
    assert by_block[60] == by_block[40]
    assert len(by_block[40]) >= 4


@pytest.mark.parametrize(
    ("cycle", "words", "same"),
    [
        case("bwo900-5.4-11", "G86", "P103:380 P104:96 P106:4", "P103:20 P104:96 P106:4"),
        case("bwo900-5.4-11", "G86", "P103:-340 P104:96 P106:4", "P103:20 P104:96 P106:4"),
        case("bwo900-5.4-11", "G86", "P103:20 P104:-96 P105:-32", "P103:20 P104:96 P106:4"),
        case("bwo900-5.4-11", "G86", "P103:20 P105:-32 P106:-4,9", "P103:20 P104:96 P106:4"),
        *(
            case(
                "bwo900-5.4-11",
                cycle,
                "P103:380 P104:-96 P106:-4,9 P113:420 P115:-23 P116:3,2",
                "P103:20 P104:96 P106:4 P113:60 P114:46 P116:3",
            )
            for cycle in ("G87", "G88")
        ),
        case("bwo900-5.4-11", "G89", "P120:70 P121:20 P122:100 P123:378 P124:120 P126:-5,9", PATTERNS["G89"]),
        case("bwo900-5.4-11", "G89", "P120:70 P121:20 P122:100 P123:-342 P124:120 P125:-30", PATTERNS["G89"]),
    ],
)
def test_signs_and_fractions_that_do_not_count(cycle: str, words: str, same: str) -> None:
    near(holes(pattern(f"{cycle} G81", words)), holes(pattern(f"{cycle} G81", same)))


@pytest.mark.parametrize("plane", ["G17", "G18", "G19"])
@pytest.mark.parametrize(
    ("cycle", "words"),
    [
        case("bwo900-5.4-12", "G86", "P103:30 P104:60 P106:3"),
        case("bwo900-5.4-12", "G86", "P100:10 P101:20 P106:3"),
        case("bwo900-5.4-12", "G87", "P103:30 P104:60 P106:3 P110:-5 P111:20 P116:2"),
        case("bwo900-5.4-12", "G88", "P103:-30 P104:60 P106:3 P113:60 P115:7 P116:2"),
        case("bwo900-5.4-12", "G89", "P120:7 P121:8 P122:50 P123:30 P124:100 P126:3"),
    ],
)
def test_vectors_and_angles_are_those_of_the_plane(cycle: str, words: str, plane: str) -> None:
    """P103, P113, P123 count from X, Z, Y with G17, G18, G19."""
    axes = {"G17": (0, 1, 2), "G18": (2, 0, 1), "G19": (1, 2, 0)}
    found = []
    for g in ("G17", plane):
        first, second, third = ("XYZ"[axis] for axis in axes[g])
        text = (
            f"N10 {g} G00 {first}20 {second}30 {third}100 S500 M03|N20 {words} P32:800 P33:0 P34:32|N30 {cycle} G81|"
            "N40 M30"
        )
        found.append([tuple(place[axis] for axis in axes[g]) for place in holes(done(text))])
    near(found[1], found[0])


@shows("bwo900-5.4-13")
def test_where_a_pattern_begins() -> None:
    """A: the words, else where the tool stands; of G89 centre, radius and angle."""
    for cycle in ("G86", "G87", "G88"):
        assert holes(pattern(f"{cycle} G81", PATTERNS[cycle]))[0] == (20.0, 20.0, 0.0)
        assert holes(pattern(f"{cycle} G81 X1 Y2", PATTERNS[cycle]))[0] == (1.0, 2.0, 0.0)
        assert holes(pattern(f"{cycle} G81 Y2", PATTERNS[cycle]))[0] == (20.0, 2.0, 0.0)
    a = 70 + 50 * math.cos(math.radians(18)), 20 + 50 * math.sin(math.radians(18)), 0.0
    for words in ("", "X1 Y2"):
        assert holes(pattern(f"G89 G81 {words}", PATTERNS["G89"]))[0] == pytest.approx(a)


@pytest.mark.parametrize(
    ("words", "angle", "length", "count"),
    [
        case("bwo900-5.4-14", "P103:10 P104:95 P105:32", 10, 95, 3),  # 95 / 32 + 1 = 3.97: 3 places
        case("bwo900-5.4-14", "P103:10 P104:96 P105:32", 10, 96, 4),
        case("bwo900-5.4-14", "P103:10 P104:97 P105:32", 10, 97, 4),
        case("bwo900-5.4-14", "P100:30 P101:40 P105:12", 53.130_102_354, 50, 5),  # 50 / 12 + 1 = 5.17
        case("bwo900-5.4-14", "P103:10 P105:32 P106:4", 10, 96, 4),
        case("bwo900-5.4-14", "P103:10 P105:32 P106:2", 10, 32, 2),
    ],
)
def test_number_and_division_of_a_ray(words: str, angle: float, length: float, count: int) -> None:
    """P106 = AB / P105 + 1, then P105' = AB / (P106 - 1); of both rays."""
    places = [ray(angle, length * k / (count - 1)) for k in range(count)]
    near(holes(pattern("G86 G81", words)), [(20 + u, 20 + v) for u, v in places])
    second = " ".join(f"P1{int(w[2:4]) + 10}:{w.split(':')[1]}" for w in words.split())
    for cycle in ("G87", "G88"):
        found = holes(pattern(f"{cycle} G81", f"P100:0 P101:-7 P106:2 {second}"))
        wanted = sorted((round(20 + u, 6), round(y + v, 6)) for u, v in places for y in (20, 13))
        near(sorted((round(place[0], 6), round(place[1], 6)) for place in found), wanted)


@pytest.mark.parametrize(
    ("words", "travel", "count"),
    [
        case("bwo900-5.4-15", "P124:120 P126:5", 120, 5),
        case("bwo900-5.4-15", "P124:-120 P126:5", -120, 5),  # clockwise
        case("bwo900-5.4-15", "P124:100 P125:30", 100, 4),  # 100 / 30 + 1 = 4.33, then 100 / 3
        case("bwo900-5.4-15", "P124:-100 P125:30", -100, 4),
        case("bwo900-5.4-15", "P125:30 P126:5", 120, 5),
        case("bwo900-5.4-15", "P125:-30 P126:5", -120, 5),
        case("bwo900-5.4-15", "P125:30 P126:1", 0, 1),  # P124 = (P126 - 1) P125
        case("bwo900-5.4-15", "P124:120 P126:1", 120, 1),  # straight to B
    ],
)
def test_places_of_a_circle(words: str, travel: float, count: int) -> None:
    turns = [18 + travel * k / (count - 1) for k in range(count)] if count > 1 else [18 + travel]
    expected = [(70 + 50 * math.cos(math.radians(a)), 20 + 50 * math.sin(math.radians(a))) for a in turns]
    near(holes(pattern("G89 G81", f"P120:70 P121:20 P122:100 P123:18 {words}")), expected)


@shows("bwo900-5.4-5")
@pytest.mark.parametrize("count", [0, 1])
@pytest.mark.parametrize(
    ("cycle", "words", "end"),
    [
        ("G86", "P100:90 P101:30 P106:{n}", (110, 50)),
        ("G86", "P103:0 P104:50 P106:{n}", (70, 20)),
        ("G87", "P100:90 P101:30 P106:{n} P110:20 P111:40 P116:1", (130, 90)),
        ("G88", "P100:90 P101:30 P106:{n} P110:20 P111:40 P116:1", (130, 90)),
        ("G89", "P120:70 P121:20 P122:100 P123:0 P124:90 P126:{n}", (70, 70)),
    ],
)
def test_none_and_one_place_of_every_pattern(cycle: str, words: str, end: tuple[float, float], count: int) -> None:
    """Straight to the end; the cycle is carried out there if there is one place, and not at all if there is none."""
    program = pattern(f"{cycle} G81", words.format(n=count))
    assert end in [tuple(round(x, 6) for x in place[:2]) for place, _ in moves(program, 40)]
    near(holes(program), [end] if count else [])


@shows("bwo900-5.4-5")
def test_a_ray_of_one_division_and_none_or_one_place() -> None:
    """X(AB) = P105 P106 cos P103 for P106 = 0 and 1."""
    assert pattern("G86 G81", "P103:90 P105:32 P106:0").points[-1][:2] == (20.0, 20.0)
    near(holes(pattern("G86 G81", "P103:90 P105:32 P106:1")), [(20, 52)])


@shows("bwo900-5.4-16")
def test_none_or_one_place_of_a_circle_is_reached_from_its_beginning() -> None:
    """From A to B (bwo900/60); with G03 along the circle, with functions before the path at A."""
    for count in (0, 1):
        words = f"P120:70 P121:20 P122:100 P123:0 P124:90 P126:{count}"
        program = pattern("G89 G81 M08", words)
        assert [place[:2] for place, _ in moves(program, 40)][:2] == [(120.0, 20.0), (70.0, 70.0)]
        said = next(b for b in program.blocks if 8 in [f.code for f in b.pre])
        assert said.start[:2] == pytest.approx((120.0, 20.0))
        program = done(f"N10 G00 X20 Y20 Z100 S500 M03|N20 {words} P32:800 P33:0 P34:32|N40 G03 G89 G81|N50 M30")
        arcs = [b.elements[0] for b in program.path if isinstance(b.elements[0], Arc)]
        assert [math.degrees(arc.sweep_rad) for arc in arcs] == pytest.approx([90.0])


@shows("bwo900-5.4-6")
@pytest.mark.parametrize(
    ("g", "travel", "sweep"), [("G03", 90, 90), ("G02", 90, -270), ("G02", -90, -90), ("G03", -90, 270)]
)
def test_circles_with_and_against_their_travel_angle(g: str, travel: int, sweep: int) -> None:
    text = (
        f"N10 G00 X20 Y20 Z100 F300 S500 M03|N20 P120:70 P121:20 P122:100 P123:0 P124:{travel * 2} P126:3|"
        f"N30 P32:800 P33:0 P34:32|N40 {g} G89 G81|N50 M30"
    )
    program = done(text, p8816=4_000)
    arcs = [b for b in program.path if isinstance(b.elements[0], Arc)]
    assert [math.degrees(b.elements[0].sweep_rad) for b in arcs if isinstance(b.elements[0], Arc)] == pytest.approx(
        [sweep, sweep]
    )
    assert {b.feed_mm_min for b in arcs} == {4_000.0}, "the highest feed, not F"
    first = next(b for b in program.path if b.number == 40)
    assert first.rapid
    assert first.finish[:2] == (120.0, 20.0)


@shows("bwo900-5.4-7")
@pytest.mark.parametrize("cycle", PATTERNS)
@pytest.mark.parametrize("g", ["G00", "G01 F500"])
def test_places_of_patterns_are_reached_in_rapid(cycle: str, g: str) -> None:
    program = done(f"N10 G00 X20 Y20 Z100 S500 M03|N20 {PATTERNS[cycle]}|N40 {g} {cycle}|N50 M30")
    made = [b for b in program.path if b.number == 40]
    assert len(made) >= 3
    assert all(b.rapid for b in made)
    assert all(b.end.name == "EXACT_STOP" for b in made[: 4 if cycle == "G86" else -1])


@pytest.mark.parametrize(
    ("cycle", "words", "number"),
    [
        # Twice, and not the same: P104, P105 with P106 and the end that P100, P101 say; of both rays.
        case("bwo900-5.4-8", "G86", "P100:90 P101:30 P104:80 P106:4", 8311),
        case("bwo900-5.4-8", "G86", "P100:90 P101:30 P105:10 P106:4", 8315),
        case("bwo900-5.4-8", "G86", "P100:90 P101:30 P103:50 P106:4", 8103),
        case("bwo900-5.4-8", "G86", "P103:0 P104:80 P105:10 P106:4", 8315),
        case("bwo900-5.4-8", "G87", "P100:90 P101:30 P106:4 P110:20 P111:40 P114:9 P116:3", 8321),
        case("bwo900-5.4-8", "G87", "P100:90 P101:30 P106:4 P110:20 P111:40 P115:9 P116:3", 8325),
        case("bwo900-5.4-8", "G88", "P100:90 P101:30 P106:4 P113:20 P114:40 P115:9 P116:3", 8325),
        case("bwo900-5.4-8", "G88", "P100:90 P101:30 P106:4 P110:20 P111:40 P113:9 P116:3", 8113),
        case("bwo900-5.4-8", "G89", "P120:70 P121:20 P122:100 P123:18 P124:120 P125:31 P126:5", 8333),
        # Not determined.
        case("bwo900-5.4-8", "G86", "P106:4", 8103),
        case("bwo900-5.4-8", "G86", "P101:30 P106:4", 8100),
        case("bwo900-5.4-8", "G86", "P100:90 P106:4", 8101),
        case("bwo900-5.4-8", "G86", "P103:20 P106:4", 8104),
        case("bwo900-5.4-8", "G86", "P103:20 P105:4", 8104),
        case("bwo900-5.4-8", "G86", "P103:20 P104:4 P105:0", 8105),
        case("bwo900-5.4-8", "G86", "P100:90 P101:30", 8107),
        case("bwo900-5.4-8", "G87", "P100:90 P101:30 P106:4", 8113),
        case("bwo900-5.4-8", "G87", "P100:90 P101:30 P106:4 P111:40 P116:3", 8110),
        case("bwo900-5.4-8", "G87", "P100:90 P101:30 P106:4 P110:40 P116:3", 8111),
        case("bwo900-5.4-8", "G88", "P100:90 P101:30 P106:4 P113:20 P116:3", 8114),
        case("bwo900-5.4-8", "G88", "P100:90 P101:30 P106:4 P110:20 P111:40", 8117),
        case("bwo900-5.4-8", "G89", "P120:70 P121:20 P122:100 P123:18 P126:5", 8124),
        case("bwo900-5.4-8", "G89", "P120:70 P121:20 P122:100 P123:18 P124:120", 8126),
        case("bwo900-5.4-8", "G89", "P120:70 P121:20 P122:100 P123:18 P124:120 P125:0", 8334),
    ],
)
def test_ends_that_are_not_determined_or_twice(cycle: str, words: str, number: int) -> None:
    """A message with the number of chapter 9.10, and the program is broken off."""
    with pytest.raises(ProgramError) as error:
        pattern(f"{cycle} G81", words)
    assert error.value.number == number


@shows("bwo900-5.4-8")
def test_what_is_said_twice_may_agree() -> None:
    length = math.hypot(90, 30)
    words = (
        f"P100:90 P101:30 P103:{math.degrees(math.atan2(30, 90)):.6f} P104:{length:.6f} P105:{length / 3:.6f} P106:4"
    )
    near(holes(pattern("G86 G81", words)), [(20, 20), (50, 30), (80, 40), (110, 50)])


# 5.5 Cycles of the user


@shows("bwo900-5.5-1")
@pytest.mark.parametrize("end", ["M30", "M02", "M29"])
def test_the_printed_cycle_of_a_user(end: str) -> None:
    """The program goes on behind the block; the printed Z1001 ends with M30."""
    program = done(f"P2000|N10 P501:7|N60 P500:2 G1001|N70 P502:P500|N90 M30|Z1001|N40 P500:P500+1|N60 {end}")
    assert [program.parameters.get(n) for n in (500, 501, 502)] == [3.0, 7.0, 3.0]


@shows("bwo900-5.5-3")
def test_numbers_of_the_controls_own_functions_are_not_the_users() -> None:
    """Z81, Z1 beside G81 and G1: the control's own are carried out."""
    program = done(f"P1|{DRILL}|N30 G81 X5 {HOLES['G81']}|N40 G01 X7|N50 M30|Z81|N10 P500:1 M30|Z1|N10 P501:1 M30")
    assert not program.parameters.loaded(500)
    assert not program.parameters.loaded(501)
    assert len(moves(program, 30)) == 4
