"""Cycles G71 to G89 and user cycles: the manual's own examples (chapter 5) and what its text says of them.

Places and heights are those that the manual prints or that follow from its formulas; what its lost figures showed is
decided in bwo900/36 to bwo900/45 and drawn in docs/images/bwo900_pockets.png.
"""

from __future__ import annotations

import gc
import itertools
import math
import pickle
import tracemalloc
from typing import Any, Final

import pytest
from firmware.bwo900.run import Analysed, programs
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.elements import Arc
from isel_twin.firmware.bwo900.messages import MESSAGES, Effect, ProgramError
from isel_twin.testing import Desk
from tests.thorough import drawn

DRILL: Final = "N20 G56 G00 X0 Y0 Z100 S1200 F1500 M03 T01 M16"
"""First block of the manual's drilling examples."""
TOOLS: Final = {"p21000": 1, "p21010": 4, "p21020": 2, "p21030": 3}
"""T1 with radius 4 mm, T2 with radius 3 mm."""


def analysed(text: str, **parameters: float) -> Analysed:
    values: dict[str, Any] = {**TOOLS, **parameters}
    return Analysed(text, **values)


def heights(program: Analysed, block: int = 30) -> list[tuple[float, float | None]]:
    """Height and feed (None: rapid) of each move of the block that goes along Z."""
    return [
        (round(b.finish[2], 3), b.feed_mm_min)
        for b in program.path
        if b.number == block and b.elements[0].start[2] != b.finish[2]
    ]


def refused(text: str, **parameters: float) -> int:
    with pytest.raises(ProgramError) as error:
        analysed(text, **parameters)
    return error.value.number


class TestDrilling:
    def test_g81(self) -> None:
        program = analysed(f"{DRILL}\nN30 G81 Z80 P30:1 P32:800 P33:0 P34:32 P35:60\nN40 M05 M30")
        assert heights(program) == [(80, None), (32, None), (0, 800), (60, None)]
        cycle = [b for b in program.blocks if b.number == 30]
        assert [b.dwell_s for b in cycle if b.dwell_s] == [1.0]
        assert [b.finish[2] for b in cycle if b.dwell_s] == [0.0]
        down = next(b for b in cycle if b.feed_mm_min == 800)
        assert down.length_mm / down.feed_mm_min * 60.0 == pytest.approx(2.40)
        assert [f.code for b in cycle for f in (*b.pre, *b.post)] == [3, 5], "spindle on first, off last"
        assert [f.code for f in cycle[-2].post] == [5]
        assert cycle[-2].finish[2] == 60.0

    def test_g82_is_g81_with_a_dwell(self) -> None:
        rest = "Z80 P30:1 P32:800 P33:0 P34:32 P35:60 M30"
        assert heights(analysed(f"{DRILL}\nN30 G82 {rest}")) == heights(analysed(f"{DRILL}\nN30 G81 {rest}"))

    def test_g83_in_equal_strokes(self) -> None:
        program = analysed(f"{DRILL}\nN30 G83 Z80 P30:1 P32:800 P33:0 P34:48 P35:60 P36:3 P38:1 P39:0\nN40 M05 M30")
        expected = [(80, None), (48, None), (32, 800), (48, None), (33, None), (16, 800), (48, None), (17, None)]
        assert heights(program) == [*expected, (0, 800), (60, None)]
        assert [(b.finish[2], b.dwell_s) for b in program.blocks if b.dwell_s] == [(0.0, 1.0)]

    def test_g83_degressive(self) -> None:
        program = analysed(f"{DRILL}\nN30 G83 Z80 P32:800 P33:0 P34:52 P36:4 P37:15 P38:1 P39:1\nN40 M05 M30")
        depths = [37, 26, 19, 15, 11, 7, 3.5, 0]
        expected: list[tuple[float, float | None]] = [(80, None), (52, None), (37, 800)]
        for before, depth in itertools.pairwise(depths):
            expected += [(52, None), (before + 1, None), (depth, 800)]
        assert heights(program) == [*expected, (52, None)]

    def test_safety_distance_is_1_mm_where_none_is_programmed(self) -> None:
        program = analysed(f"{DRILL}\nN30 G83 Z80 P32:800 P33:0 P34:48 P36:2\nN40 M30")
        assert heights(program) == [(80, None), (48, None), (24, 800), (48, None), (25, None), (0, 800), (48, None)]

    def test_g84(self) -> None:
        program = analysed(f"{DRILL}\nN30 G84 Z80 P32:10 P33:20 P34:52 P35:60\nN40 M05 M30")
        assert heights(program) == [(80, None), (52, None), (20, 12_000), (52, 12_000), (60, None)]
        cycle = [b for b in program.blocks if b.number == 30]
        assert [f.code for b in cycle for f in (*b.pre, *b.post)] == [3, 4, 5], "on, reversed at the depth, off"
        assert [b.override for b in cycle if b.feed_mm_min == 12_000] == [False, False], "G63 while it taps"

    def test_g84_left(self) -> None:
        program = analysed(f"{DRILL}\nN30 G84 Z80 P31:4 P32:10 P33:20 P34:52 P35:60\nN40 M05 M30")
        cycle = [b for b in program.blocks if b.number == 30]
        assert [f.code for b in cycle for f in (*b.pre, *b.post)] == [4, 3, 5]

    def test_g85(self) -> None:
        program = analysed(f"{DRILL}\nN30 G85 Z80 P30:1 P32:800 P33:0 P34:32\nN40 M05 M30")
        assert heights(program) == [(80, None), (32, None), (0, 800), (32, 800)]
        assert [(b.finish[2], b.dwell_s) for b in program.blocks if b.dwell_s] == [(0.0, 1.0)]

    def test_without_a_coordinate_nothing_is_drilled(self) -> None:
        assert heights(analysed(f"{DRILL}\nN30 G81 P32:800 P33:0 P34:32\nN40 M30")) == []

    def test_it_acts_in_its_block_only(self) -> None:
        program = analysed(f"{DRILL}\nN30 G81 X10 P32:800 P33:0 P34:32\nN40 X20 M30")
        assert heights(program, 40) == []

    def test_heights_are_absolute_with_g91(self) -> None:
        program = analysed(f"{DRILL}\nN30 G91 G81 X10 Y5 P32:800 P33:0 P34:32\nN40 G81 X10 M30")
        assert [z for z, _ in heights(program)] == [32, 0, 32]
        assert [z for z, _ in heights(program, 40)] == [0, 32]
        assert program.points[-1] == (20.0, 5.0, 32.0)

    @pytest.mark.parametrize(("plane", "axis"), [("G17", 2), ("G18", 1), ("G19", 0)])
    def test_the_axis_across_the_plane_drills(self, plane: str, axis: int) -> None:
        letters = [letter for number, letter in enumerate("XYZ") if number != axis]
        text = (
            f"N20 {plane} G00 X50 Y50 Z50 S100 M03\nN30 G81 {letters[0]}1 {letters[1]}2 P32:800 P33:0 P34:32\nN40 M30"
        )
        moved = [b for b in analysed(text).path if b.feed_mm_min == 800]
        assert [(b.start[axis], b.finish[axis]) for b in moved] == [(32.0, 0.0)]

    @pytest.mark.parametrize(
        ("first", "block", "number"),
        [
            ("M03", "P32:800 P33:0 P34:32", 8300),
            ("S0 M03", "P32:800 P33:0 P34:32", 8302),
            ("S1200", "P32:800 P33:0 P34:32", 8301),
            ("S1200 M03", "P33:0 P34:32", 8032),
            ("S1200 M03", "P32:800 P34:32", 8033),
            ("S1200 M03", "P32:800 P33:0", 8034),
        ],
    )
    def test_what_is_missing_is_a_message(self, first: str, block: str, number: int) -> None:
        found = refused(f"N20 G00 X0 Y0 Z100 {first}\nN30 G81 X1 {block}\nN40 M30")
        assert found == number


class TestModalDrilling:
    """P8806 byte 3: bit 0 cycles stay until G80, bit 1 address words (manual 8.5, L13016 to L13029)."""

    def test_a_cycle_stays_until_g80(self) -> None:
        text = f"{DRILL}\nN30 G81 X10 P32:800 P33:0 P34:32\nN40 X20\nN50 P500:1\nN60 G80 X30\nN70 X40 M30"
        program = analysed(text, p8806=0x010000)
        assert [z for z, _ in heights(program, 30)] == [32, 0, 32]
        assert [z for z, _ in heights(program, 40)] == [0, 32]
        assert heights(program, 50) == heights(program, 60) == heights(program, 70) == []

    def test_without_the_bit_g80_does_nothing(self) -> None:
        program = analysed(f"{DRILL}\nN30 G81 X10 P32:800 P33:0 P34:32\nN40 G80 X20 M30")
        assert heights(program, 40) == []
        assert program.points[-1] == (20.0, 0.0, 32.0)

    @pytest.mark.parametrize(
        ("plane", "words", "across"), [("G17", "Z1 R32 K60", 2), ("G18", "Y1 R32 J60", 1), ("G19", "X1 R32 I60", 0)]
    )
    def test_address_words_go_into_parameters(self, plane: str, words: str, across: int) -> None:
        other = "XYZ"[(across + 1) % 3]
        text = f"N20 {plane} G00 X100 Y100 Z100 S1200 F1500 M03\nN30 G83 {other}5 F800 {words} H3\nN40 M30"
        program = analysed(text, p8806=0x020000)
        assert [program.parameters.get(p) for p in (32, 33, 34, 35, 36)] == [800, 1, 32, 60, 3]
        moves = [b for b in program.path if b.number == 30]
        assert [b.finish[across] for b in moves if b.feed_mm_min == 800] == pytest.approx([32 - 31 / 3, 32 - 62 / 3, 1])
        assert moves[-1].finish[across] == 60

    def test_f_of_such_a_block_is_no_feed_of_the_path(self) -> None:
        text = f"{DRILL}\nN30 G81 X5 F800 Z0 R32 K60\nN40 G01 X10\nN50 M30"
        assert [b.feed_mm_min for b in analysed(text, p8806=0x020000).path if b.number == 40] == [1500]


LINE: Final = [(20, 20), (50, 30), (80, 40), (110, 50)]
BEAM: Final = [(20, 20), (50.070, 30.945), (80.140, 41.889), (110.210, 52.834)]
PERIMETER: Final = [*BEAM, (121.710, 72.753), (133.210, 92.671), (103.140, 81.726), (73.070, 70.782), (43.000, 59.837)]
"""Without its last place, (31.500, 39.919)."""
GRID: Final = [
    *BEAM, (121.710, 72.753), (91.640, 61.808), (61.570, 50.863), (31.500, 39.919),
    (43.000, 59.837), (73.070, 70.782), (103.140, 81.726), (133.210, 92.671),
]  # fmt: skip
RING: Final = [(117.553, 35.451), (103.457, 57.157), (80.396, 68.907), (54.549, 67.553), (32.843, 53.457)]


def drilled(program: Analysed) -> list[tuple[float, float]]:
    return [(b.finish[0], b.finish[1]) for b in program.path if b.feed_mm_min == 800]


def pattern(call: str, parameters: str, before: str = "") -> Analysed:
    return analysed(f"""
        N10 G00 X20 Y20 Z100 S500 M03 T01 M16 {before}
        N20 {parameters}
        N30 P32:800 P33:0 P34:32
        N40 {call}
        N50 M30""")


def near(places: list[tuple[float, float]]) -> object:
    return [pytest.approx(place, abs=6e-4) for place in places]


class TestPatterns:
    @pytest.mark.parametrize(
        ("cycle", "parameters", "places"),
        [
            ("G86", "P100:90 P101:30 P106:4", LINE),
            ("G86", "P103:20 P104:96 P106:4", BEAM),
            ("G86", "P103:20 P105:32 P106:4", BEAM),
            ("G86", "P103:20 P104:96 P105:32", BEAM),
            ("G86", "P103:380 P104:-96 P106:-4,9", BEAM),
            (
                "G87",
                "P100:90 P101:30 P106:4 P110:20 P111:40 P116:3",
                [*LINE, (120, 70), (130, 90), (100, 80), (70, 70), (40, 60), (30, 40)],
            ),
            ("G87", "P103:20 P104:96 P106:4 P113:60 P114:46 P116:3", [*PERIMETER, (31.5, 39.919)]),
            ("G87", "P103:20 P105:32 P106:4 P113:60 P115:23 P116:3", [*PERIMETER, (31.5, 39.919)]),
            (
                "G88",
                "P100:90 P101:30 P106:4 P110:20 P111:40 P116:3",
                [*LINE, (120, 70), (90, 60), (60, 50), (30, 40), (40, 60), (70, 70), (100, 80), (130, 90)],
            ),
            ("G88", "P103:20 P104:96 P106:4 P113:60 P114:46 P116:3", GRID),
            ("G88", "P103:20 P105:32 P106:4 P113:60 P115:23 P116:3", GRID),
            ("G89", "P120:70 P121:20 P122:100 P123:18 P124:120 P126:5", RING),
            ("G89", "P120:70 P121:20 P122:100 P123:18 P124:120 P125:30", RING),
            ("G89", "P120:70 P121:20 P122:100 P123:18 P125:30 P126:5", RING),
        ],
    )
    def test_places_of_the_examples(self, cycle: str, parameters: str, places: list[tuple[float, float]]) -> None:
        assert drilled(pattern(f"{cycle} G81", parameters)) == near(places)

    def test_a_grid_ends_where_it_began(self) -> None:
        program = pattern("G88 G81", "P100:90 P101:30 P106:4 P110:20 P111:40 P116:3")
        assert program.points[-1][:2] == (20.0, 20.0)

    def test_a_circle_without_an_end_is_a_full_one(self) -> None:
        found = drilled(pattern("G89 G81", "P120:70 P121:20 P122:100 P123:18 P125:30"))
        assert found == near([(70 + 50 * math.cos(math.radians(a)), 20 + 50 * math.sin(math.radians(a)))
                              for a in range(18, 378, 30)])  # fmt: skip

    def test_division_is_fitted(self) -> None:
        """95 / 32 + 1 is 3 places, floor; then the division is 95 / 2."""
        found = drilled(pattern("G86 G81", "P103:0 P104:95 P105:32"))
        assert found == near([(20, 20), (67.5, 20), (115, 20)])

    @pytest.mark.parametrize(("count", "places"), [(0, []), (1, [(110, 50)])])
    def test_none_or_one_goes_straight_to_the_end(self, count: int, places: list[tuple[float, float]]) -> None:
        program = pattern("G86 G81", f"P100:90 P101:30 P106:{count}")
        assert drilled(program) == near(places)
        assert program.points[-1][:2] == (110.0, 50.0)

    def test_the_block_says_where_it_begins(self) -> None:
        assert drilled(pattern("G86 G81 X0 Y10", "P100:90 P101:30 P106:2")) == near([(0, 10), (90, 40)])

    def test_angles_count_from_the_planes_first_axis(self) -> None:
        program = analysed("""
            N10 G18 G00 X20 Y100 Z20 S500 M03
            N20 P103:0 P104:90 P106:2 P32:800 P33:0 P34:32
            N30 G86 G81
            N40 M30""")
        assert [b.finish for b in program.path if b.feed_mm_min == 800] == [(20, 0, 20), (20, 0, 110)]

    def test_places_are_reached_in_rapid_and_exactly(self) -> None:
        program = pattern("G86", "P100:90 P101:30 P106:4")
        moves = [b for b in program.path if b.number == 40]
        assert [b.finish[:2] for b in moves] == LINE[1:]
        assert all(b.rapid and b.end.name == "EXACT_STOP" for b in moves)

    def test_a_circle_runs_along_it_with_g02_and_g03(self) -> None:
        """Against the travel angle, too: then it goes the long way round."""
        for g, sweep in (("G03", 30.0), ("G02", -330.0)):
            program = analysed(f"""
                N10 G00 X20 Y20 Z100 S500 M03
                N20 {g} P120:70 P121:20 P122:100 P123:18 P124:120 P126:5 P32:800 P33:0 P34:32
                N40 G89 G81
                N50 M30""")
            arcs = [b for b in program.path if isinstance(b.elements[0], Arc)]
            assert [math.degrees(b.elements[0].sweep_rad) for b in arcs] == pytest.approx([sweep] * 4)
            assert drilled(program) == near(RING)

    def test_functions_before_at_the_beginning_and_after_at_the_end(self) -> None:
        program = pattern("G86 G85 M07 M09", "P100:90 P101:30 P106:3")
        where = {f.code: b.finish[:2] for b in program.blocks for f in (*b.pre, *b.post) if f.code in (7, 9)}
        assert where == {7: (20.0, 20.0), 9: (110.0, 50.0)}
        codes = [f.code for b in program.blocks if b.number == 40 for f in (*b.pre, *b.post) if f.code in (3, 5)]
        assert codes == [3, 5] * 3, "those of the cycle at each place"

    @pytest.mark.parametrize(
        ("call", "first"),
        [
            ("G86 G85 X0 Y10", (0.0, 10.0)),
            ("G88 G85 X0 Y10", (0.0, 10.0)),
            ("G86 X0 Y10", (0.0, 10.0)),
            ("G89 G85", (117.553, 35.451)),
        ],
    )
    def test_the_beginning_is_that_of_the_block(self, call: str, first: tuple[float, float]) -> None:
        parameters = "P100:90 P101:30 P106:3 P110:20 P111:40 P116:3 P120:70 P121:20 P122:100 P123:18 P124:120 P126:5"
        program = pattern(f"{call} M07", parameters)
        before = [[f.code for f in b.pre] for b in program.blocks if b.number == 40]
        where = [b.start[:2] for b in program.blocks if b.number == 40]
        number = next(k for k, codes in enumerate(before) if 7 in codes)
        assert where[number] == pytest.approx(first, abs=6e-4)

    def test_pockets_at_places(self) -> None:
        program = analysed("""
            N10 G00 X30 Y30 Z2 T02 M06 F900 S100 M03
            N20 G86 G74 P100:100 P101:0 P106:2 P13:3 P14:10 P16:4 P17:3 P19:2
            N30 M30""")
        bottoms = [b for b in program.path if b.finish[2] == -3.0 and not b.rapid]
        wanted = {30.0 + c + x for c in (0, 100) for x in (0, 4, -4, 7, -7, -5.5, 2)}
        assert {round(b.finish[0], 3) for b in bottoms} == wanted, "radii 4 and 7, half a turn at 5.5, 5 mm away"
        assert program.points[-1] == (130.0, 30.0, 2.0)

    @pytest.mark.parametrize(
        ("cycle", "parameters", "number"),
        [
            ("G86", "P103:20 P106:4", 8104),
            ("G86", "P104:20 P106:4", 8103),
            ("G86", "P100:90 P101:30", 8107),
            ("G86", "P100:90 P101:30 P104:20 P106:4", 8311),
            ("G88", "P100:90 P101:0 P106:4 P113:20 P116:4", 8114),
            ("G88", "P100:90 P101:0 P106:4 P110:1 P111:1", 8117),
            ("G88", "P100:90 P101:0 P106:4 P110:30 P111:40 P114:51 P116:2", 8321),
            ("G89", "P121:20 P122:100 P123:18 P124:120 P126:5", 8120),
            ("G89", "P120:70 P122:100 P123:18 P124:120 P126:5", 8121),
            ("G89", "P120:70 P121:20 P123:18 P124:120 P126:5", 8122),
            ("G89", "P120:70 P121:20 P122:100 P124:120 P126:5", 8123),
            ("G89", "P120:70 P121:20 P122:100 P123:18 P124:120 P125:31 P126:5", 8333),
        ],
    )
    def test_too_little_and_too_much_is_a_message(self, cycle: str, parameters: str, number: int) -> None:
        with pytest.raises(ProgramError) as error:
            pattern(f"{cycle} G81", parameters)
        assert error.value.number == number

    def test_places_without_end_are_analysed_as_they_are_made(self) -> None:
        """10^10 holes: nothing is reckoned before it is asked for, and nothing is kept."""
        text = (
            "N10 G00 X20 Y20 Z100 S500 M03\nN20 P100:90 P101:0 P106:100000 P110:20 P111:0 P116:100000\n"
            "N30 P32:800 P33:0 P34:32\nN40 G88 G81\nN50 M30"
        )
        one = Interpreter(Analysed("N10 M30").parameters, programs(text))
        one.begin("P1", (0.0, 0.0, 0.0))
        tracemalloc.start()
        blocks = [one.next() for _ in range(500)]
        for _ in range(500):
            one.next()
        gc.collect()
        before = tracemalloc.get_traced_memory()[0]
        for _ in range(1000):
            one.next()
        gc.collect()
        assert tracemalloc.get_traced_memory()[0] - before < 20_000
        tracemalloc.stop()
        assert len({b.finish[0] for b in blocks if isinstance(b, PathBlock)}) > 80, "six moves a hole"

    def test_a_copy_goes_on_with_the_same_move(self) -> None:
        text = (
            "N10 G00 X20 Y20 Z100 S500 M03\nN20 P100:90 P101:0 P106:4 P110:20 P111:0 P116:3 P32:800 P33:0 P34:32\n"
            "N40 G88 G81\nN50 M30"
        )
        one = Interpreter(Analysed("N10 M30").parameters, programs(text))
        one.begin("P1", (0.0, 0.0, 0.0))
        for _ in range(20):
            one.next()
        two = pickle.loads(pickle.dumps(one))
        rest = [(one.next(), two.next()) for _ in range(60)]
        assert all(a == b for a, b in rest)
        assert any(isinstance(a, PathBlock) and a.stop is Stop.END for a, _ in rest)


MILL: Final = "N10 G00 G54 G90 F{feed} S900 T02 M06 M03 M07"


def milled(block: str, feed: int = 1000) -> Analysed:
    return analysed(f"{MILL.format(feed=feed)}\nN20 {block} M30")


def cutting(program: Analysed, height: float | None = None) -> list[PathBlock]:
    """Blocks with feed in the plane, at a height."""
    return [
        b
        for b in program.path
        if not b.rapid and b.start[2] == b.finish[2] and (height is None or abs(b.finish[2] - height) < 1e-9)
    ]


def floors(program: Analysed) -> list[float]:
    """Heights that are milled at, in order."""
    found = dict.fromkeys(round(b.finish[2], 6) for b in cutting(program))
    return [z for z in found if z < 0]


def envelope(blocks: list[PathBlock]) -> tuple[float, ...]:
    """Smallest and largest X, then Y."""
    points = [e.point(k / 8) for b in blocks for e in b.elements for k in range(9)]
    xs, ys = [p[0] for p in points], [p[1] for p in points]
    return tuple(round(v, 6) for v in (min(xs), max(xs), min(ys), max(ys)))


def long_rows(program: Analysed, height: float, axis: int) -> list[float]:
    """Where rows along an axis lie across it: lines of more than half the longest."""
    lines = [b.elements[0] for b in cutting(program, height) if not isinstance(b.elements[0], Arc)]
    ways = [
        (abs(e.end[axis] - e.start[axis]), e.start[1 - axis]) for e in lines if e.start[1 - axis] == e.end[1 - axis]
    ]
    longest = max(way for way, _ in ways)
    return sorted({round(across, 6) for way, across in ways if way > longest / 2})


class TestRectangularPockets:
    def test_g71(self) -> None:
        program = milled("G71 X55,5 Y40,5 Z2 P11:71 P12:41 P13:5 P14:-- P15:0 P16:4 P17:3 P19:2 P21:100", 2500)
        assert envelope(cutting(program)) == (23, 88, 23, 58)
        assert floors(program) == [-3, -5]
        assert long_rows(program, -3, 0) == [23, 27, 31, 35, 39, 43, 47, 51, 55, 58]
        assert program.points[0] == (55.5, 40.5, 2.0)
        assert program.points[-1] == (55.5, 40.5, 2.0)
        plunges = [b for b in program.path if b.feed_mm_min == 100]
        assert [b.finish for b in plunges] == [(23, 23, -3), (23, 23, -5)], "S1, with P21"
        assert {b.feed_mm_min for b in cutting(program)} == {2500}
        lifts = [b for b in program.path if b.rapid and b.start[2] == -3 and b.finish[2] > -3]
        assert [b.finish[2] for b in lifts] == [-1] * 9 + [2], "2 mm between rows, then the safety distance"

    def test_g71_mills_one_way(self) -> None:
        """Conventional with M03: what is still there lies on the left of the way."""
        program = milled("G71 X55,5 Y40,5 Z2 P11:71 P12:41 P13:3 P16:4 P17:3 P19:2")
        ways = [b.elements[0] for b in cutting(program, -3)]
        assert [e.end[0] - e.start[0] for e in ways if abs(e.end[0] - e.start[0]) > 60][:10] == [65.0] * 10

    def test_g71_along_y_from_the_other_side(self) -> None:
        program = milled("G71 X43 Y60,5 Z1 P11:46 P12:81 P13:30 P14:13 P16:-4 P17:7 P19:1 P21:400")
        assert envelope(cutting(program)) == (23, 63, 23, 98)
        assert floors(program) == [-7, -14, -21, -28, -30]
        assert long_rows(program, -7, 1) == [23 + 4 * k for k in range(11)]
        assert program.points[1] == (63, 33, 1), "S2: the largest X, the corner's radius of 10 from the edge"
        assert program.points[-1] == (43, 60.5, 1)

    def test_corner_radius_below_the_tools_is_8001(self) -> None:
        block = "N20 G71 X43 Y60,5 Z1 P11:46 P12:81 P13:30 P14:{} P16:-4 P17:7 P19:1 P21:400 M30"
        first = MILL.format(feed=1000)
        assert refused(f"{first}\n{block.format(0)}") == 8001
        assert refused(f"{first}\n{block.format('2,9')}") == 8001

    def test_g72(self) -> None:
        program = milled("G72 X53 Y35,5 Z1 P11:66 P12:31 P13:5 P14:-- P15:0 P16:5,1 P17:3 P19:1", 2000)
        assert envelope(cutting(program)) == (23, 83, 23, 48)
        assert floors(program) == [-3, -5]
        assert long_rows(program, -3, 0) == pytest.approx([23, 28.1, 33.2, 38.3, 43.4, 48])
        ways = [b.elements[0] for b in cutting(program, -3)]
        signs = [math.copysign(1, e.end[0] - e.start[0]) for e in ways if abs(e.end[0] - e.start[0]) > 50]
        assert signs[:6] == [1, -1, 1, -1, 1, -1]
        assert program.points[-1] == (53, 35.5, 1)

    def test_g72_mills_each_edge_on_its_own(self) -> None:
        program = milled("G72 X53 Y35,5 Z1 P11:66 P12:31 P13:3 P16:5,1 P17:3 P19:1", 2000)
        edges = [b for b in cutting(program, -3) if abs(b.finish[1] - b.start[1]) == 25]
        assert sorted(b.finish[0] for b in edges) == [23, 83]
        between = program.path[program.path.index(edges[0]) : program.path.index(edges[1])]
        assert (23, 23, 1) in [b.finish for b in between], "up, and to the start, between them"

    def test_g72_along_y(self) -> None:
        program = milled("G72 X42 Y54,5 Z1 P11:44 P12:69 P13:3 P14:15 P15:0 P16:5,5 P17:3 P19:1 P21:100", 2000)
        assert envelope(cutting(program)) == (23, 61, 23, 86)
        assert floors(program) == [-3]
        # Rows near the sides are shorter than half by the corners of 12 mm, but not than half of the longest.
        assert long_rows(program, -3, 1) == pytest.approx([23, 28.5, 34, 39.5, 45, 50.5, 56, 61])
        assert program.points[-1] == (42, 54.5, 1)

    def test_g73(self) -> None:
        program = milled("G73 X52,5 Y37,5 Z1 P11:64 P12:35 P13:5 P15:1 P16:4,5 P17:2 P19:1 P20:1", 1500)
        rough = [b for b in cutting(program) if b.feed_mm_min == 1500 and b.finish[2] < 0]
        fine = [b for b in cutting(program) if b.feed_mm_min == 750]
        assert envelope(rough) == (24.5, 80.5, 24, 51)
        assert envelope(fine) == (23.5, 81.5, 23, 52)
        assert floors(program) == [-2, -4, -5]
        assert {b.finish[2] for b in fine} == {-5}
        assert math.isclose(sum(b.length_mm for b in fine), 2 * (58 + 29)), "once around"
        downs = [b for b in program.path if b.feed_mm_min == 750 and b.finish[2] < b.start[2]]
        assert [(b.start[2], b.finish[2]) for b in downs] == [(1, -5)], "down with half the feed"
        assert program.points[-1] == (52.5, 37.5, 1)
        assert not program.path[-1].rapid, "back with the programmed feed"

    def test_g73_begins_with_the_contour_in_all_layers(self) -> None:
        program = milled("G73 X52,5 Y37,5 Z1 P11:64 P12:35 P13:5 P15:1 P16:4,5 P17:2 P19:1 P20:1", 1500)
        heights = [b.finish[2] for b in cutting(program)]
        changes = [z for z, before in zip(heights, [None, *heights], strict=False) if z != before]
        assert changes[:7] == [-2, -4, -5, -2, -4, -5, 1]

    def test_g73_with_corners_finishes_in_two_cuts(self) -> None:
        text = "G73 X52,5 Y37,5 Z1 P11:65 P12:35 P13:5 P14:11 P15:1,5 P16:4,2 P17:2 P19:1 P20:1"
        program = milled(text, 1500)
        rough = [b for b in cutting(program) if b.feed_mm_min == 1500 and b.finish[2] < 0]
        assert envelope(rough) == (24.5, 80.5, 24.5, 50.5)
        arcs = [b.elements[0] for b in cutting(program) if isinstance(b.elements[0], Arc) and b.feed_mm_min == 750]
        assert [round(a.radius_mm, 6) for a in arcs] == [7.5] * 4 + [8.0] * 4, "11 - 3, and 0.5 less before"
        # A radius of 8 at the corners: 29 x 59 straight on to the tool's centre.
        assert envelope([b for b in cutting(program) if b.feed_mm_min == 750]) == (23, 82, 23, 52)

    @pytest.mark.parametrize(
        ("word", "number"),
        [
            ("P11:--", 8011), ("P12:-1", 8012), ("P13:0", 8013), ("P14:-3", 8014), ("P15:-1", 8015), ("P16:0", 8016),
            ("P16:--", 8016), ("P17:0", 8017), ("P18:-1", 8018), ("P18:5", 8018), ("P19:--", 8019), ("P21:-1", 8021),
            ("P17:6", 8009), ("P12:5", 8001), ("P14:21", 8004),
        ],
    )  # fmt: skip
    def test_messages(self, word: str, number: int) -> None:
        good = "P11:71 P12:41 P13:5 P15:0 P16:4 P17:3 P19:2 P21:100"
        assert refused(f"{MILL.format(feed=1000)}\nN15 {good}\nN20 G71 X0 Y0 Z2 {word} M30") == number

    def test_finishing_needs_an_infeed(self) -> None:
        good = "P11:64 P12:35 P13:5 P15:1 P16:4,5 P17:2 P19:1"
        assert refused(f"{MILL.format(feed=1000)}\nN20 G73 X0 Y0 Z1 {good} M30") == 8020

    def test_a_tool_without_a_radius_is_8001(self) -> None:
        good = "P11:71 P12:41 P13:5 P15:0 P16:4 P17:3 P19:2 P21:100"
        assert refused(f"N10 G00 F1000 S900 M03\nN20 G71 X0 Y0 Z2 {good} M30") == 8001

    def test_without_p21_it_plunges_with_f(self) -> None:
        program = milled("G71 X55,5 Y40,5 Z2 P11:71 P12:41 P13:5 P16:4 P17:3 P19:2", 2500)
        first = next(b for b in program.path if b.finish[2] == -3)
        assert first.feed_mm_min == 2500

    def test_radius_correction_is_off_in_it(self) -> None:
        text = MILL.format(feed=1000) + "\nN15 G41 G01 X0 Y0\nN20 G71 P11:71 P12:41 P13:5 P16:4 P17:3 P19:2\nN30 M30"
        assert {b.correction.side for b in analysed(text).blocks if b.number == 20 and b.elements} == {0}


def radii(program: Analysed, height: float, centre: tuple[float, float]) -> list[float]:
    """Where the path crosses the first axis beyond the centre: full circles and turns of the spiral, in order."""
    found = [b.finish[0] - centre[0] for b in cutting(program, height) if abs(b.finish[1] - centre[1]) < 1e-9]
    outwards: list[float] = []
    for x in found:
        if x > (outwards[-1] if outwards else 0.0) + 1e-9:
            outwards.append(round(x, 6))
    return outwards


class TestCircularPockets:
    def test_g74(self) -> None:
        program = milled("G74 X53 Y53 Z1 P13:27 P14:33 P16:5,1 P17:5 P19:1", 1500)
        assert floors(program) == [-5, -10, -15, -20, -25, -27]
        for floor in floors(program):
            assert radii(program, floor, (53, 53)) == pytest.approx([5.1, 10.2, 15.3, 20.4, 25.5, 30])
        assert envelope(cutting(program)) == (23, 83, 23, 83)
        assert program.points[-1] == (53, 53, 1)

    def test_g74_drilled(self) -> None:
        program = milled("G74 X50 Y50 Z1 P11:10 P13:31 P14:30 P16:4 P17:8 P19:1", 1500)
        assert floors(program) == [-8, -16, -24, -31]
        assert radii(program, -8, (50, 50)) == [14, 18, 22, 26, 27]

    @pytest.mark.parametrize(("infeed", "sign"), [("4", -1), ("-4", 1)])
    def test_the_sign_is_the_direction(self, infeed: str, sign: int) -> None:
        program = milled(f"G74 X50 Y50 Z1 P13:8 P14:30 P16:{infeed} P17:8 P19:1", 1500)
        turns = {math.copysign(1, b.elements[0].sweep_rad) for b in program.path if isinstance(b.elements[0], Arc)}
        assert turns == {sign}, "+: G02, -: G03"

    def test_away_from_the_wall_in_a_half_circle(self) -> None:
        program = milled("G74 X53 Y53 Z1 P13:27 P14:33 P16:5,1 P17:5 P19:1", 1500)
        arcs = [b for b in cutting(program, -5) if isinstance(b.elements[0], Arc)]
        last = arcs[-1].elements[0]
        assert isinstance(last, Arc)
        assert last.radius_mm == pytest.approx(2.5)
        assert abs(last.sweep_rad) == pytest.approx(math.pi)
        after = program.path[program.path.index(arcs[-1]) + 1 :]
        assert [b.finish for b in after[:2]] == [pytest.approx((78, 53, -3)), (53, 53, -3)], "2 mm up, to the middle"
        assert after[0].rapid

    def test_g75(self) -> None:
        program = milled("G75 X48 Y48 Z1 P13:35 P14:28 P15:2 P16:4,1 P17:8 P19:1 P20:2", 1500)
        assert floors(program) == [-8, -16, -24, -32, -35]
        assert radii(program, -8, (48, 48)) == pytest.approx([4.1, 8.2, 12.3, 16.4, 20.5, 23])
        fine = [b for b in cutting(program) if b.feed_mm_min == 750]
        assert {b.finish[2] for b in fine} == {-35}
        arcs = [b.elements[0] for b in fine]
        assert all(isinstance(a, Arc) for a in arcs)
        full = [a for a in arcs if isinstance(a, Arc) and a.radius_mm == pytest.approx(25)]
        assert sum(abs(a.sweep_rad) for a in full) == pytest.approx(2 * math.pi), "one circle of 28 - 3"
        halves = [a for a in arcs if a not in full]
        assert all(abs(a.sweep_rad) == pytest.approx(math.pi) for a in halves if isinstance(a, Arc))
        assert len(halves) == 2
        assert program.points[-1] == (48, 48, 1)
        assert not program.path[-1].rapid

    @pytest.mark.parametrize(
        ("word", "number"),
        [("P14:2", 8007), ("P11:26", 8008), ("P11:-1", 8010), ("P14:--", 8014), ("P17:40", 8009), ("P20:0", 8020)],
    )
    def test_messages(self, word: str, number: int) -> None:
        good = "P13:35 P14:28 P15:2 P16:4,1 P17:8 P19:1 P20:2"
        assert refused(f"{MILL.format(feed=1000)}\nN15 {good}\nN20 G75 X0 Y0 Z2 {word} M30") == number


class TestUserCycles:
    def test_a_cycle_is_the_program_of_its_number(self) -> None:
        program = Analysed(
            """
            P2000
            N60 P500:2 G1001
            N90 M30
            Z1001
            N40 P500:P500+1
            N60 M30
            """
        )
        assert program.parameters.get(500) == 3

    def test_a_cycle_that_there_is_not(self) -> None:
        assert refused("N10 G1001\nN20 M30") == 1252

    def test_an_m_function_defined_as_a_cycle(self) -> None:
        """M234 starts Z234 at the end of its block, and no code goes to the PLC (P8308, byte 3)."""
        program = Analysed("P1\nN10 G00 X10 M234\nN20 X20 M30\nZ234\nN10 X15 Y5\nN20 M30", p8308=0x20 << 16)
        assert program.points == [(10, 0, 0), (15, 5, 0), (20, 5, 0)]
        assert not [f for b in program.blocks for f in (*b.pre, *b.post) if f.code == 234]

    def test_an_m_function_as_a_cycle_has_nothing_behind_it(self) -> None:
        with pytest.raises(ProgramError) as error:
            Analysed("P1\nN10 M234.5\nN20 M30\nZ234\nN20 M30", p8308=0x20 << 16)
        assert error.value.number == 1228


class TestToolChange:
    SHORT: Final = "Z6\nN10 P8047:1\nN20 P8045:1\nN30 M30"
    LONG: Final = """
        Z6
        N10 _wzwxl_x_pos := 1000; _wzwxl_y_pos := 300;
        N30 P8100=P8050.200
        N40 P8100=0.100
        N50 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01
        N60 P8047:1
        N100 P8050=0.200
        N120 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01
        N140 P8045:1
        N200 M30
        """

    def test_z6_puts_back_and_takes(self) -> None:
        program = Analysed(
            f"P1\nN10 T1 M06\nN15 P600:P8160\nN20 T2 M06\nN30 P601:P8160\nN40 M30\n{self.SHORT}", **TOOLS
        )
        assert program.parameters.get(600) == 4
        assert program.parameters.get(601) == 3
        assert program.parameters.get(8100) == 2

    def test_z6_goes_to_the_place_of_change(self) -> None:
        text = f"P1\nN10 T2 M06\nN20 G00 X0 Y0\nN30 T2 M06\nN40 T1 M06\nN50 M30\n{self.LONG}"
        program = Analysed(text, **TOOLS)
        assert [p[:2] for p in program.points] == [(1000, 300), (0, 0), (1000, 300)], "the same tool: no change"
        assert program.parameters.get(8100) == 1

    def test_z6_on_a_new_control(self) -> None:
        """The manual's Z6 asks for P8100 of a control that has never had a tool: T0."""
        desk = Desk.of("bwo900", carriage=(20_000, 20_000, 20_000))
        cycle = self.LONG.replace("1000", "10").replace("300", "30").strip().splitlines()
        tools = [f"K1:{name.upper()}: {value}" for name, value in TOOLS.items()]
        for lines in (
            ["P1", "N10 T2 M06", "N20 G00 X0 Y0", "N30 M30"],
            cycle,
            ["D", *tools],
            ["D", "K1:P8683: 1", "K1:P12530: 1", "K1:P12330: 1", "K1:P12130: 1"],
            ["D", "K1:P8800: 1", "K1:P8683: 2", "K1:P8684: 1"],
        ):
            desk.send("".join(f"{line.strip()}\r\n" for line in ("", *lines, "#")).encode() + b"\x04\r\n")
            desk.finish()
        assert desk.remarks == []

    def test_z5_runs_with_every_new_t(self) -> None:
        program = Analysed("P1\nN10 T2\nN20 G00 X1 M30\nZ5\nN10 P600:P8050\nN20 M30", **TOOLS)
        assert program.parameters.get(600) == 2


SOUND: Final = {
    11: 30, 12: 20, 13: 5, 14: 9, 15: 1, 16: 4, 17: 2, 18: 1, 19: 1, 20: 1, 21: 100, 30: 0.1, 32: 800, 33: 0, 34: 5,
    35: 9, 36: 3, 37: 2, 38: 1, 39: 0, 100: 90, 101: 30, 106: 4, 110: 20, 111: 40, 116: 3, 120: 70, 121: 20, 122: 100,
    123: 18, 124: 120, 126: 5,
}  # fmt: skip
"""Parameters with which every cycle does something."""
VALUES: Final = st.sampled_from([None, 0, 1, -1, 2, 3, -4, 5.5, 10, 40, 200, -200, 360, 1e-6, 1e6, 123456.789])
CYCLE_NUMBERS: Final = st.sampled_from(["G71", "G72", "G73", "G74", "G75", "G81", "G83", "G84", "G85"])


@settings(max_examples=drawn(150), deadline=None, derandomize=True)
@given(
    cycle=CYCLE_NUMBERS,
    pattern=st.sampled_from(["", "", "G86", "G87", "G88", "G89"]),
    changed=st.dictionaries(st.sampled_from([*SOUND, 31, 103, 104, 105, 113, 114, 115, 125]), VALUES, max_size=4),
    plane=st.sampled_from(["G17", "G18", "G19"]),
    words=st.sampled_from(["", "X1 Y2 Z3", "Z5", "X-3"]),
    flags=st.sampled_from([0, 0x010000, 0x020000, 0x030000]),
)
def test_any_parameters_are_moves_or_a_message(
    cycle: str, pattern: str, changed: dict[int, float | None], plane: str, words: str, flags: int
) -> None:
    first = f"N10 G00 {plane} T02 M06 F900 S100 M03"
    text = f"{first}\nN20 {pattern} {cycle} {words}\nN30 X1 M30"
    parameters = Analysed("N10 M30", **TOOLS, p8806=flags).parameters
    for number, value in {**SOUND, **changed}.items():
        parameters.write(number, value)
    one = Interpreter(parameters, programs(text))
    one.begin("P1", (0.0, 0.0, 0.0))
    try:
        for _ in range(100):
            block = one.next()
            if isinstance(block, PathBlock):
                assert all(math.isfinite(x) for e in block.elements for x in e.end)
            elif block is Waiting.EXECUTION:
                one.executed()
    except ProgramError as error:
        assert error.number in MESSAGES  # noqa: PT017


def test_every_message_of_cycles_breaks_off() -> None:
    """Manual 9.10."""
    of_cycles = [known.effect for number, known in MESSAGES.items() if number >= 8_000]
    assert len(of_cycles) > 40
    assert set(of_cycles) == {Effect.CHANNEL_ABORT}
