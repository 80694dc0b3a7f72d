"""Toolpaths as telegrams of the GMI99, played on the 4030-servo: 1000 increments a mm."""

from __future__ import annotations

import math

import pytest
from cam.played import END, FAST, TRAVEL, P, arc, check_made, line, lines_of, played, rapid, texts
from cam.random_paths import paths
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Coolant, Dwell, Element, Place, Rapid, Spindle
from isel_twin.cam.written import MachineAxes
from tests.thorough import drawn

BEGIN = ["Q4;1", "Q3;1", "G90", "G94", "M50000"]


def job(path: list[Element], settings: CamSettings = FAST) -> list[str]:
    lines = texts(lines_of("gmi99", path, settings))
    assert lines[:5] == BEGIN
    return lines[5:]


def test_cuts_are_one_line_and_f_is_the_speed_along_the_path() -> None:
    path = [rapid(10, 0, 0), rapid(10, 0, -2), line(40, 40, -2), line(50, 40, -2, 5.0), rapid(50, 40, 0), END]
    assert job(path) == [
        "f30000 | 81h 10000 | 84h 2000",
        "f10000 | 83h 40000 40000 | f5000 | 81h 50000",
        "f30000 | 84h 0",
    ]


def test_arcs_are_halves_at_most() -> None:
    """A full circle about (40, 50), counter-clockwise seen from +Z: over (30, 50)."""
    *_, cut = job([rapid(50, 50, -5), arc((50, 50, -5), (40, 50, 0)), END])
    assert cut == "f10000 | G3 | 83h -10000 0 | 83h 30000 50000 | G3 | 83h 10000 0 | 83h 50000 50000"


@pytest.mark.parametrize(
    ("plane", "element", "made"),
    [
        # seen from +X, Y to the right and Z up: from the upper point counter-clockwise to the left
        ("YZ", arc((50, 50, -30), (50, 50, -25), 1, plane=0), "G2 | 86h 0 5000 | 86h 50000 30000"),
        # seen from +Y, Z to the right and X up: from the upper point to the left, which is down
        ("ZX", arc((40, 50, -20), (45, 50, -20), 1, plane=1), "G3 | 85h -5000 0 | 85h 40000 20000"),
    ],
)
def test_a_plane_with_z_is_mirrored(plane: str, element: Element, made: str) -> None:
    """The middle of each half: Z -25 is +25 for the counter."""
    *_, cut = job([rapid(50, 50, -20), element, END])
    assert cut == f"f10000 | {made}"
    run = check_made("gmi99", [rapid(50, 50, -20), element, END])
    middle = {"YZ": (50, 45, 25), "ZX": (45, 50, 25)}[plane]
    assert abs(run.mm - middle).max(axis=1).min() < 0.05


def test_a_helix_and_a_spiral_are_chords() -> None:
    """The manual says nothing of either."""
    for element in (arc((50, 50, -30), (45, 50, 0), 2), arc((30, 50, -20), (41, 50, 0))):
        run = check_made("gmi99", [rapid(50, 50, -20), element, END])
        assert not any("G3" in each.text for each in run.lines)


def test_a_line_has_moves_for_the_buffer_and_for_twenty_seconds_at_most() -> None:
    lines = job([line(0.1 * k, 0, 0) for k in range(1, 151)] + [END])
    assert [text.count("h") for text in lines] == [60, 60, 30]
    lines = job([line(9.0 * k, 0, 0, 1.0) for k in range(1, 6)] + [END])
    assert [text.count("h") for text in lines] == [2, 2, 1]


def test_the_place_of_a_line_is_that_of_its_first_move() -> None:
    path = [Rapid(Place(3), (10.0, 0.0, 0.0)), line(20, 0, 0)._replace(place=Place(4)), line(30, 0, 0), END]
    assert [each.place and each.place.line for each in lines_of("gmi99", path)] == [None] * 5 + [3, 4]


def test_joined_cuts_do_not_stop_where_the_card_need_not() -> None:
    """40 pieces of 1 mm in one direction at 10 mm/s, 50 Hz/ms: v/a = 0.2 s more than 4 s, and the grid of 4 ms."""
    run = played("gmi99", [line(float(k), 0, 0) for k in range(1, 41)] + [END])
    assert run.seconds == pytest.approx(4.0 + 0.2, abs=0.012)


def test_resolutions_that_differ_are_told_to_the_card() -> None:
    """X and Y 1000, Z 2000 counts a mm: Z counts half; arcs with Z are chords."""
    axes = MachineAxes((1000.0, 1000.0, 2000.0), TRAVEL)
    lines = texts(lines_of("gmi99", [line(3, 0, -4), arc((3, 0, -8), (3, 0, -6), -1, plane=0), END], axes=axes))
    assert f"W1;{round(65535 / 2)};3" in lines
    assert "f10000 | 85h 3000 8000" in lines[-1]
    assert "G2" not in lines[-1]
    assert "G3" not in lines[-1]


def test_outputs() -> None:
    """The spindle is A0.0; operands count bits: A1.3 is 11."""
    path = [Spindle(P, 1), Dwell(P, 0.5), Coolant(P, 1, True), END]
    settings = CamSettings(outputs={"coolant": 11})
    assert job(path, settings)[-5:] == ["p10;16;0", "<0.500s>", "p10;16;11", "p10;17;0", "p10;17;11"]
    with pytest.raises(CamError, match="coolant = 96; the card has 0 to 95"):
        job(path, CamSettings(outputs={"coolant": 96}))


def test_feeds_are_clipped_at_the_top_speed() -> None:
    lines = lines_of("gmi99", [line(10, 0, 0, 80.0), END])
    assert [each.text for each in lines[-2:]] == [
        "# caution: a feed of 80 mm/s is more than the machine makes: 50 mm/s here",
        "f50000 | 81h 10000",
    ]


def test_a_circle_takes_its_length_by_feed() -> None:
    """r = 10 mm at 10 mm/s: 2 pi s; with N14 = 0 the card slows down at its chords, never up."""
    run = played("gmi99", [rapid(50, 50, -5), arc((50, 50, -5), (40, 50, 0)), END])
    assert run.seconds >= 2 * math.pi


@given(path=paths())
@hypothesis_settings(max_examples=drawn(8), deadline=None)
def test_any_path_is_made(path: list[Element]) -> None:
    check_made("gmi99", path)
