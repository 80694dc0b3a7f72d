"""Random programs, and a tiny evaluator that knows nothing of the reader: the same points, feeds and arcs."""

from __future__ import annotations

import math
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.cam.gcode import GCode
from isel_twin.cam.toolpath import Arc, CamError, Line, Rapid
from tests.cam.short import UP
from tests.thorough import drawn

NUMBERS = st.integers(-99_999, 99_999).map(lambda thousandths: f"{thousandths / 1000:.3f}")
MODES = st.sampled_from(["G90", "G91", "G20", "G21", "F120", "F33.5", "(remark)", "", "G40 G49"])
AXES = st.dictionaries(st.sampled_from("XYZ"), NUMBERS, min_size=1)
MOVES = st.tuples(st.sampled_from(["G0", "G1", "g01", "", "G 00"]), AXES, st.booleans(), st.sampled_from(["", "F77"]))
CIRCLES = st.tuples(st.sampled_from(["G2", "G3"]), st.integers(1, 50), st.integers(-50, 50), st.integers(1, 3))
SHIFTS = st.dictionaries(st.sampled_from("XYZ"), NUMBERS, min_size=1)
BLOCKS = st.one_of(
    MODES, MOVES, MOVES, MOVES, CIRCLES, SHIFTS.map(lambda axes: ("G92", axes)), st.just("G92.1"), st.just("G53")
)


class Evaluator:
    """Machine points by addition, one block after the other."""

    def __init__(self) -> None:
        self.machine, self.shift = [0.0, 0.0, 0.0], [0.0, 0.0, 0.0]
        self.unit, self.relative, self.feed, self.code = 1.0, False, 0.0, "G0"
        self.lines = ["G21 G90 G17", "F600", "G0 X0"]
        self.feed = 600.0
        self.path: list[tuple[Any, ...]] = [("rapid", 0.0, 0.0, 0.0)]

    def block(self, block: Any) -> None:
        if isinstance(block, str) and block != "G53":
            self.lines.append(block)
            self.unit = {"G20": 25.4, "G21": 1.0}.get(block, self.unit)
            self.relative = {"G90": False, "G91": True}.get(block, self.relative)
            if block.startswith("F"):
                self.feed = float(block[1:]) * self.unit
            if block == "G92.1":
                self.shift = [0.0, 0.0, 0.0]
        elif block == "G53":
            self.lines.append("G90 G53 G0 X1 Y2 Z3")
            self.relative, self.code = False, "G0"
            self.machine = [self.unit, 2 * self.unit, 3 * self.unit]
            self.path.append(("rapid", *self.machine))
        elif len(block) == 2:
            for letter, number in block[1].items():
                axis = "XYZ".index(letter)
                self.shift[axis] = self.machine[axis] - float(number) * self.unit
            self.lines.append("G92 " + " ".join(letter + number for letter, number in block[1].items()))
        elif isinstance(block[1], dict):
            self.move(*block)
        else:
            self.circle(*block)

    def move(self, code: str, axes: dict[str, str], backwards: bool, feed: str) -> None:
        words = [letter + number for letter, number in axes.items()] + [feed]
        self.lines.append(f"{code} {' '.join(reversed(words) if backwards else words)}")
        self.code = {"G0": "G0", "G 00": "G0", "": self.code}.get(code, "G1")
        self.feed = float(feed[1:]) * self.unit if feed else self.feed
        for letter, number in axes.items():
            axis, value = "XYZ".index(letter), float(number) * self.unit
            self.machine[axis] = value + (self.machine if self.relative else self.shift)[axis]
        kind = ("rapid",) if self.code == "G0" else ("line", self.feed / 60.0)
        self.path.append((kind[0], *self.machine, *kind[1:]))

    def circle(self, code: str, i: int, j: int, turns: int) -> None:
        self.lines += [f"{code} I{i} J{j} P{turns}", "G1"]
        self.code = "G1"
        x, y, _ = self.machine
        centre = (x + i * self.unit, y + j * self.unit)
        self.path.append(("arc", *self.machine, *centre, turns * (1 if code == "G3" else -1), self.feed / 60.0))


def flat(element: object) -> tuple[Any, ...]:
    if isinstance(element, Rapid):
        return ("rapid", *element.to)
    if isinstance(element, Line):
        return ("line", *element.to, element.feed_mm_s)
    assert isinstance(element, Arc)
    return ("arc", *element.to, *element.centre[:2], element.turns, element.feed_mm_s)


@given(st.lists(BLOCKS, max_size=25))
@settings(max_examples=drawn(150), deadline=None)
def test_as_a_tiny_evaluator(blocks: list[Any]) -> None:
    by_hand = Evaluator()
    for block in blocks:
        by_hand.block(block)
    path = list(GCode().read([*by_hand.lines, "M2"], UP))
    made = [flat(element) for element in path if isinstance(element, Rapid | Line | Arc)]
    assert [move[0] for move in made] == [move[0] for move in by_hand.path]
    for own, other in zip(made, by_hand.path, strict=True):
        assert all(math.isclose(p, q, abs_tol=1e-6) for p, q in zip(own[1:], other[1:], strict=True)), (own, other)


WORDS = st.lists(st.builds("".join, st.tuples(st.sampled_from("XXYYZFSIJR"), NUMBERS)), min_size=1, max_size=4)
LINES = st.tuples(st.sampled_from(["", "", "G0 ", "G1 ", "g02", "N7 G3 "]), WORDS.map(" ".join)).map("".join)


def elements(lines: list[str]) -> list[Any]:
    """Of a program, up to what is refused, and that."""
    found: list[Any] = []
    try:
        found += GCode().read(["G21 G17", "M3 S5000", *lines, "M2"], UP)
    except CamError as refused:
        found.append(str(refused))
    return found


@given(st.sampled_from(["G90", "G91", "G20", "G18", "G90 G19"]), st.lists(LINES, max_size=12))
@settings(max_examples=drawn(300), deadline=None)
def test_a_plain_move_is_what_its_block_is(mode: str, moves: list[str]) -> None:
    """A remark behind a line makes a block of it."""
    begin = [f"{mode} G1 F600 X0 Y0", "G1 X10 Y0"]
    assert elements([*begin, *moves]) == elements([*begin, *(f"{line} ()" for line in moves)])
