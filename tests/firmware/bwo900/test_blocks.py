"""What one block does, and in which order: statements of the manual (the numbers of its lines beside each)."""

from __future__ import annotations

import pytest
from firmware.bwo900.run import Analysed

DRILLING = "P32:800 P33:0 P34:32"
"""G81: feed, depth, retract plane."""


def places(run: Analysed) -> list[tuple[float, ...]]:
    """Where paths end, in the plane, each once after the other."""
    found: list[tuple[float, ...]] = []
    for point in run.points:
        if not found or found[-1] != point[:2]:
            found.append(point[:2])
    return found


def test_a_loop_may_end_in_the_block_of_a_cycle() -> None:
    """L9511: behind the block with M25 the program jumps back, and the cycle belongs to the block."""
    run = Analysed(f"N10 G00 Z50 S100 M03 M24.3\nN20 G91 G81 X10 {DRILLING} M25\nN30 G90 G00 X0\nN40 M30")
    assert places(run) == [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0), (30.0, 0.0), (0.0, 0.0)]


@pytest.mark.parametrize("leads", ["M23.40", "P500=0.40"])
def test_a_jump_may_stand_in_the_block_of_a_cycle(leads: str) -> None:
    """L9485: the program goes on there, after the block."""
    run = Analysed(f"N10 G00 Z50 S100 M03 P500:0\nN20 G81 X10 {DRILLING} {leads}\nN30 G00 X77\nN40 X20\nN50 M30")
    assert places(run) == [(0.0, 0.0), (10.0, 0.0), (20.0, 0.0)]


def test_g46_takes_back_what_was_added_to_the_rotation() -> None:
    """L6597: additive values are given up by the set values anew, or by G46; G45 again changes nothing."""
    turned = "N10 G45 G00 P160:0 P161:0 P163:0\nN20 P165:10 P168:90 X0 Y0\nN30 G45 X10 Y0"
    run = Analysed(f"{turned}\nN40 G46 X0 Y0\nN50 G45 X10 Y0\nN60 M30")
    assert [tuple(round(x, 6) for x in point[:2]) for point in run.points] == [(0, 10), (0, 20), (0, 0), (10, 0)]
