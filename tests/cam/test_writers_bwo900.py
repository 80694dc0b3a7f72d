"""Toolpaths as programs of the BWO 900, played on the 4030-servo."""

from __future__ import annotations

import math

import numpy as np
import pytest
from cam.played import END, FAST, P, arc, check_made, line, lines_of, played, rapid, texts
from cam.random_paths import paths
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Coolant, Dwell, Element, Output, Rapid, Remark, Spindle, Stop, Tool
from isel_twin.controller import offers
from isel_twin.language import RunsPrograms, create_language
from tests.thorough import drawn

BEGIN = ["P1", "N10 G17 G40 G53 G90 G94", "N20 P8816:1800"]


def blocks(path: list[Element], settings: CamSettings = FAST) -> list[str]:
    lines = texts(lines_of("bwo900", path, settings))
    assert lines[:3] == BEGIN
    assert lines[-1] == "#"
    assert lines[-2].endswith(" M30")
    return [text.split(" ", 1)[1] if text[0] == "N" else text for text in lines[3:-2]]


def test_words_that_change_feeds_in_mm_a_minute() -> None:
    path = [rapid(10, 0, 0), line(10, 0, -2), line(40.5, 40, -2), line(50, 40, -2, 2.5), rapid(50, 40, 0), END]
    assert blocks(path) == ["G0 X10", "G1 Z2 F600", "G1 X40.5 Y40", "G1 X50 F150", "G0 Z0"]


def test_it_is_a_program_of_the_control() -> None:
    text = "\n".join(texts(lines_of("bwo900", [Remark(P, "part 7"), rapid(10, 0, 0), Tool(P, 1), END])))
    language = create_language("bwo900")
    assert offers(language, RunsPrograms)
    assert language.claims(text)


def test_centres_are_absolute_and_arcs_half_a_turn_at_most() -> None:
    lines = blocks([rapid(50, 50, -5), arc((50, 50, -5), (40, 50, 0), -1), arc((40, 60, -5), (40, 50, 0)), END])
    assert lines[1:] == ["G2 X30 Y50 I40 J50 F600", "G2 X50 Y50 I40 J50", "G3 X40 Y60 I40 J50"]


@pytest.mark.parametrize(
    ("element", "made"),
    [
        (arc((50, 50, -30), (50, 50, -25), 1, plane=0), "G19 G2 Y50 Z30 J50 K25 F600"),
        (arc((40, 50, -20), (45, 50, -20), 1, plane=1), "G18 G2 X40 Z20 I45 K20 F600"),
        (arc((30, 50, -25), (40, 50, 0), 1), "G3 X30 Y50 Z25 I40 J50 F600"),
    ],
    ids=["YZ", "ZX", "helix"],
)
def test_planes_with_z_are_mirrored(element: Element, made: str) -> None:
    """Counter-clockwise with Z up is clockwise where Z is counted downwards."""
    path = [rapid(50, 50, -20), element, END]
    assert blocks(path)[-1] == made
    check_made("bwo900", path)


def test_a_plane_is_selected_where_it_changes() -> None:
    yz = arc((50, 50, -20), (50, 50, -25), 1, plane=0)
    lines = blocks([rapid(50, 50, -20), yz, yz, arc((50, 50, -20), (45, 50, 0)), END])
    assert [text.split(" ")[0] for text in lines[1:]] == ["G19", "G2", "G2", "G2", "G17", "G3"]


def test_spirals_beyond_the_tolerance_of_centres_are_chords() -> None:
    run = check_made("bwo900", [rapid(50, 50, -20), arc((30, 50, -20), (41, 50, 0)), END])
    assert not any("G3" in each.text for each in run.lines)


def test_a_short_arc_is_not_a_full_circle() -> None:
    """An end within half a digit of the start's direction would be one (bwo900/8)."""
    run = check_made("bwo900", [rapid(50, 50, -20), arc((50, 50.0004, -20), (30, 50, 0)), line(50, 51, -20), END])
    assert run.mm[:, 0].min() >= 0
    assert run.seconds < 10


def test_a_helix_of_no_way_in_its_plane_is_no_full_turn() -> None:
    """It ends half a micrometre beside its start, 0.4 mm higher: the same digits in the plane."""
    run = check_made("bwo900", [rapid(50, 50, -20), arc((50.4, 50, -19.9995), (0, 51, -20), -1, plane=0), END])
    assert np.abs(run.mm[-1] - (50.4, 50.0, 19.9995)).max() < 0.001
    assert np.ptp(run.mm[run.mm[:, 0] >= 50.0], axis=0).max() < 0.5


def test_functions() -> None:
    path = [
        Spindle(P, 1, 12000.0, 2.0), Coolant(P, 1, True), Coolant(P, 2, True), Dwell(P, 0.25), Coolant(P, 1, False),
        Output(P, "PUMP", 1, 1), Output(P, "PUMP", 1, 0), Spindle(P, -1), END,
    ]  # fmt: skip
    assert blocks(path, CamSettings(rapid_mm_s=30.0, outputs={"PUMP": 10})) == [
        "M3 S12000", "G04.2.000", "M7", "M8", "G04.0.250", "M9 M8", "M10", "M11", "M4 S12000", "M5", "M9",
    ]  # fmt: skip
    with pytest.raises(CamError, match="PUMP = 100; it is the M function"):
        blocks(path, CamSettings(rapid_mm_s=30.0, outputs={"PUMP": 100}))


def test_remarks_and_stops_do_not_halt_it() -> None:
    path = [Remark(P, "äöü €\\"), Stop(P), Tool(P, 3, "ball"), rapid(1, 0, 0), END]
    assert blocks(path)[:3] == [
        "; äöü ?/",
        "; stop: the operator goes on from here",
        "; change to tool 3 (ball); the spindle is off",
    ]
    check_made("bwo900", path)


def test_a_rapid_with_a_speed_of_its_own_is_a_line_with_an_exact_stop() -> None:
    path = [Rapid(P, (10.0, 0.0, 0.0), 15.0), line(20, 0, 0, 15.0), Rapid(P, (30.0, 0.0, 0.0), 30.0), END]
    assert blocks(path) == ["G1 G8 X10 F900", "G1 X20", "G0 X30"]
    check_made("bwo900", path)


def test_a_line_takes_its_length_by_feed_and_its_ramps() -> None:
    """100 mm at 20 mm/s. Ramps reach 100 mm/s in 250 ms: v/a = 0.05 s more; set points of 2 ms."""
    run = played("bwo900", [line(100, 0, 0, 20.0), END])
    assert run.seconds == pytest.approx(5.0 + 0.05, abs=0.006)


def test_a_circle_takes_its_length_by_feed_and_its_ramps() -> None:
    run = played("bwo900", [line(50, 0, 0), arc((50, 0, 0), (50, 10, 0), feed=10.0), END])
    assert run.seconds == pytest.approx(5.0 + 0.025 + 2 * math.pi + 0.025, abs=0.05)


@given(path=paths())
@hypothesis_settings(max_examples=drawn(10), deadline=None)
def test_any_path_is_made(path: list[Element]) -> None:
    check_made("bwo900", path)
