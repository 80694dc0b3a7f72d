"""Toolpaths as vectors of the iSMIF, played on the 4030: 80 half steps a mm."""

from __future__ import annotations

import pytest
from cam.played import END, FAST, P, arc, check_made, line, lines_of, played, rapid, texts
from cam.random_paths import paths
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Coolant, Dwell, Element, Spindle
from tests.thorough import drawn


def job(path: list[Element], settings: CamSettings = FAST) -> list[str]:
    first, *lines = texts(lines_of("ismif", path, settings))
    assert first == "$HZXY<1>"
    return lines


def test_cuts_are_one_job_and_a_rapid_is_another() -> None:
    """30 mm/s and 10 mm/s along X; the Z of (30, 40, 0) stays and is not sent."""
    path = [rapid(10, 0, 0), line(10, 0, -5), line(40, 40, -5), line(50, 40, -5), rapid(50, 40, 0), END]
    assert job(path) == [
        "#E0,2400",
        "L0,X800<1>",
        "#E0,800",
        "L0,Z400",
        "#E0,640",
        "L0,X3200,Y3200",
        "#E0,800",
        "L0,X4000<1>",
        "#E0,2400",
        "L0,Z0<1>",
    ]


def test_a_job_is_not_longer_than_a_host_waits() -> None:
    """At 2 mm/s a way of 20 mm takes ten seconds and its ramps: no two of them are one job."""
    lines = job([line(20.0 * k, 0, 0, 2.0) for k in range(1, 5)] + [END])
    assert [text for text in lines if text[0] == "L"] == [f"L0,X{1600 * k}<1>" for k in range(1, 5)]


def test_events_end_a_job() -> None:
    path = [Spindle(P, 1, None, 1.5), line(1, 0, 0), Dwell(P, 0.5), line(2, 0, 0), Spindle(P, 0), END]
    assert job(path) == ["A1<1>", "<1.500s>", "#E0,800", "L0,X80<1>", "<0.500s>", "L0,X160<1>", "A0<1>"]


def test_outputs_other_than_pin_12_are_refused() -> None:
    assert job([Coolant(P, 1, True), END], CamSettings(outputs={"coolant": 12})) == ["A1<1>", "A0<1>"]
    with pytest.raises(CamError, match="coolant = 3; the interface switches pin 12 only"):
        job([Coolant(P, 1, True), END], CamSettings(outputs={"coolant": 3}))


def test_speeds_are_clipped_at_5000_and_65_hz() -> None:
    lines = lines_of("ismif", [line(10, 0, 0, 100.0), line(20, 0, 0, 0.5), END])
    assert [line.text for line in lines if line.text.startswith("#E")] == ["#E0,5000", "#E0,65"]
    assert sum(line.caution is not None for line in lines) == 2


def test_a_line_takes_its_length_by_feed_and_its_ramps() -> None:
    """30 mm at 10 mm/s: 2400 half steps at 800 Hz; a ramp from 200 Hz takes 500 ms and 250 steps (ismif.md, ramp law).
    The first pulse falls at (sqrt(200^2 + 2 a) - 200) / a."""
    run = played("ismif", [line(30, 0, 0), END])
    a = (800 - 200) / 0.5
    first = ((200**2 + 2 * a) ** 0.5 - 200) / a
    assert run.seconds + first == pytest.approx(2 * 0.5 + (2400 - 2 * 250) / 800, abs=2e-9)


@pytest.mark.parametrize(
    "element",
    [
        arc((50, 50, -20), (40, 50, 0)),
        arc((50, 50, -30), (45, 50, 0), -2),
        arc((50, 30, -20), (50, 40, -20), 1, plane=0),
        arc((58, 50, -20), (54, 50, -20), 1, plane=1),
    ],
    ids=["XY", "helix", "YZ", "ZX"],
)
def test_arcs_are_chords(element: Element) -> None:
    check_made("ismif", [rapid(50, 50, -20), element, END])


@given(path=paths())
@hypothesis_settings(max_examples=drawn(8), deadline=None)
def test_any_path_is_made(path: list[Element]) -> None:
    check_made("ismif", path)
