"""BWO 900, chapter 5: milling, drilling, patterns. The examples stand in tests/firmware/bwo900/test_cycles.py."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from conformance.rows import case, shows
from firmware.bwo900 import test_cycles as cycles
from firmware.bwo900.test_cycles import LINE, RING, analysed, drilled, milled, near, pattern, refused

POCKET = cycles.TestRectangularPockets()
CIRCLE = cycles.TestCircularPockets()
DRILL = cycles.TestDrilling()
MODAL = cycles.TestModalDrilling()
PATTERN = cycles.TestPatterns()


@pytest.mark.parametrize(
    "example",
    [
        case("bwo900-5.2-1", POCKET.test_g71),
        case("bwo900-5.2-1", POCKET.test_g71_along_y_from_the_other_side),
        case("bwo900-5.2-2", POCKET.test_g71_mills_one_way),
        case("bwo900-5.2-3", POCKET.test_g72),
        case("bwo900-5.2-3", POCKET.test_g72_mills_each_edge_on_its_own),
        case("bwo900-5.2-3", POCKET.test_g72_along_y),
        case("bwo900-5.2-4", POCKET.test_g73),
        case("bwo900-5.2-4", POCKET.test_g73_begins_with_the_contour_in_all_layers),
        case("bwo900-5.2-4", POCKET.test_g73_with_corners_finishes_in_two_cuts),
        case("bwo900-5.2-5", CIRCLE.test_g74),
        case("bwo900-5.2-5", CIRCLE.test_g74_drilled),
        case("bwo900-5.2-6", CIRCLE.test_away_from_the_wall_in_a_half_circle),
        case("bwo900-5.2-7", CIRCLE.test_g75),
        case("bwo900-5.2-8", POCKET.test_without_p21_it_plunges_with_f),
        case("bwo900-5.2-9", POCKET.test_radius_correction_is_off_in_it),
        case("bwo900-5.2-10", POCKET.test_corner_radius_below_the_tools_is_8001),
        case("bwo900-5.2-10", POCKET.test_finishing_needs_an_infeed),
        case("bwo900-5.2-10", POCKET.test_a_tool_without_a_radius_is_8001),
        case("bwo900-5.3-8", DRILL.test_heights_are_absolute_with_g91),
        case("bwo900-5.3-9", MODAL.test_a_cycle_stays_until_g80),
        case("bwo900-5.3-9", MODAL.test_f_of_such_a_block_is_no_feed_of_the_path),
        case("bwo900-5.4-5", PATTERN.test_division_is_fitted),
        case("bwo900-5.4-6", PATTERN.test_a_circle_runs_along_it_with_g02_and_g03),
        case("bwo900-5.4-7", PATTERN.test_functions_before_at_the_beginning_and_after_at_the_end),
        case("bwo900-5.4-7", PATTERN.test_places_are_reached_in_rapid_and_exactly),
    ],
)
def test_examples(example: Callable[[], None]) -> None:
    example()


@shows("bwo900-5.2-5")
@pytest.mark.parametrize(("infeed", "sign"), [("4", -1), ("-4", 1)])
def test_the_direction_of_a_circular_pocket(infeed: str, sign: int) -> None:
    CIRCLE.test_the_sign_is_the_direction(infeed, sign)


@shows("bwo900-5.2-11")
def test_p14_of_0_is_refused() -> None:
    block = "G73 X52,5 Y37,5 Z1 P11:64 P12:35 P13:5 P14:0 P15:1 P16:4,5 P17:2 P19:1 P20:1"
    assert refused(f"N10 G00 G54 G90 F1500 T02 M06\nN20 {block}\nN30 M30") == 8001
    assert milled(block.replace("P14:0", "P14:--"), 1500).points[-1] == (52.5, 37.5, 1.0)


@shows("bwo900-5.4-5")
@pytest.mark.parametrize(("count", "places"), [(0, []), (1, LINE[-1:])])
def test_none_and_one(count: int, places: list[tuple[float, float]]) -> None:
    assert drilled(pattern("G86 G81", f"P100:90 P101:30 P106:{count}")) == near(places)


@shows("bwo900-5.4-8")
def test_an_end_that_is_not_determined() -> None:
    whole = "P120:70 P121:20 P122:100 P123:18 P124:120 P126:5"
    assert drilled(pattern("G89 G81", whole)) == near(RING)
    for missing, number in ((120, 8120), (121, 8121), (122, 8122), (123, 8123)):
        text = f"N10 G00 S500 M03\nN20 {whole} P32:800 P33:0 P34:32\nN30 P{missing}:--\nN40 G89 G81\nN50 M30"
        assert refused(text) == number
    assert refused("N10 G00 S500 M03\nN20 G86 P100:90 P101:0 P104:80 P106:3\nN50 M30") == 8311
    assert analysed("N10 G00\nN20 G86 P100:90 P101:0 P104:90 P106:3\nN50 M30").points[-1] == (90.0, 0.0, 0.0)
