"""One toolpath on four controllers: the same way, the same end; a path of any length in the same memory."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Iterator
from itertools import islice, pairwise

import numpy as np
import pytest
from cam.__main__ import checked
from cam.played import END, FAST, P, arc, axes_of, check_made, distance_mm, line, lines_of, played, rapid
from cam.random_paths import paths
from hypothesis import given
from hypothesis import settings as hypothesis_settings

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Caution, Dwell, Element, Line, Place, Remark, Spindle
from isel_twin.controller import offers
from isel_twin.language import WritesToolpaths, create_language
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=6)

CONTROLLERS = ["imc-s8", "ismif", "gmi99", "bwo900"]
FINE = CamSettings(rapid_mm_s=30.0, tolerance_mm=0.002)
ALIKE_MM = 0.02


def check_alike(path: list[Element]) -> None:
    first, *others = [check_made(controller, path, FINE) for controller in CONTROLLERS]
    way = first.mm[np.unique(np.linspace(0, len(first.mm) - 1, 6000).astype(int))]
    spacing = float(np.linalg.norm(np.diff(way, axis=0), axis=1).max()) ** 2
    for other in others:
        assert np.abs(other.mm[-1] - first.mm[-1]).max() <= ALIKE_MM
        some = np.unique(np.linspace(0, len(other.mm) - 1, 1000).astype(int))
        assert distance_mm(other.mm[some], way) <= ALIKE_MM + spacing


def test_four_controllers_make_the_same_path() -> None:
    check_alike(
        [
            rapid(50, 50, -5),
            line(50, 50, -7, 5.0),
            line(60, 55, -7),
            arc((60, 65, -7), (60, 60, 0)),
            arc((60, 65, -9), (55, 65, 0), -1),
            arc((60, 71, -9), (60, 68, -9), 1, plane=0),
            arc((56, 71, -9), (58, 71, -9), -1, plane=1),
            rapid(56, 71, 0),
            END,
        ]
    )


@given(path=paths(turns=1, most=2))
@hypothesis_settings(max_examples=drawn(2), deadline=None)
def test_four_controllers_make_any_path_alike(path: list[Element]) -> None:
    check_alike(path)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_short_toolpaths_are_made_one_after_the_other(controller: str) -> None:
    """The first of those that `python -m tests.cam` plays by the thousand."""
    assert checked(controller, range(4)) == []


@pytest.mark.parametrize("controller", ["imc-s8", "imc-m", "ismif", "gmi99"])
def test_the_spindle_turns_until_the_file_says_so(controller: str) -> None:
    path = [rapid(10, 0, 0), Spindle(P, 1, 12000.0, 0.5), line(20, 0, 0), Spindle(P, 0), rapid(0, 0, 0), END]
    turning = played(controller, path).spindle
    assert [turning[0], turning[-1]] == [0, 0]
    assert [after - before for before, after in pairwise(turning) if after != before] == [1, -1]


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_pause_behind_the_last_motion_is_waited_for(controller: str) -> None:
    """`G4 P2 M30`, and an NCP file that ends with `SPINDLE OFF TIME2000`."""
    path = [rapid(10, 0, 0), line(20, 0, 0)]
    without, dwelled, run_out = [
        played(controller, [*path, Spindle(P, 0), *end, END]).twin.time_ns
        for end in ((), [Dwell(P, 2.0)], [Spindle(P, 0, None, 2.0)])
    ]
    assert [(each - without) / 1e9 for each in (dwelled, run_out)] == pytest.approx([2.0, 2.0], abs=0.1)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_an_arc_is_made_at_its_feed(controller: str) -> None:
    """A half circle of r = 10 mm, 31.4 mm, at 10 and at 2 mm/s; the iSMIF and the GMI99 stop or slow down at chords."""
    seconds = [
        played(controller, [rapid(50, 50, -5), arc((30, 50, -5), (40, 50, 0), feed=feed), END]).seconds
        for feed in (10.0, 2.0)
    ]
    assert math.pi * 0.99 <= seconds[0] < seconds[1]
    assert seconds[1] >= 5.0 * math.pi * 0.99
    if controller in ("imc-s8", "bwo900"):
        assert seconds[1] - seconds[0] == pytest.approx(4.0 * math.pi, rel=0.01)


def endless() -> Iterator[Element]:
    """A spiral staircase that never leaves the travel."""
    k = 0
    while True:
        k += 1
        angle = 0.001 * k
        to = 100 + 50 * math.cos(angle), 100 + 50 * math.sin(angle), -10 - 5 * math.sin(0.1 * angle)
        yield Line(Place(k, 1, "MOVEABS"), to, 10.0)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_lines_are_made_while_they_are_taken(controller: str) -> None:
    """An endless path has lines; after three thousand of them the writer has no more in memory than after ten."""
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    lines = language.written(endless(), axes_of(controller), FAST)
    taken = 3000 if controller != "gmi99" else 150  # it has sixty moves in a line
    tracemalloc.start()
    try:
        assert len(list(islice(lines, 10))) == 10
        before, _ = tracemalloc.get_traced_memory()
        tracemalloc.reset_peak()
        assert sum(1 for _ in islice(lines, taken)) == taken
        _, peak = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
    assert peak - before < 200_000


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_moves_of_no_length_make_no_line(controller: str) -> None:
    path = [rapid(10, 10, 0), line(10, 10, 0), line(10.0001, 10, 0), rapid(10, 10, 0), line(20, 10, 0)]
    once = lines_of(controller, [path[0], path[-1], END])
    assert lines_of(controller, [*path, END]) == once


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_a_reader_says_stands_in_the_job(controller: str) -> None:
    path = [Remark(P, "pocket\n2"), Caution(Place(9), "no feed: 5 mm/s"), END]
    said = [each for each in lines_of(controller, path) if each.text[0] in "#;" and len(each.text) > 1]
    assert [each.text[1:] for each in said] == [" pocket 2", " caution: no feed: 5 mm/s"]
    assert [each.caution is not None for each in said] == [False, True]
    assert said[1].place == Place(9)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_leaves_the_travel_is_refused_before_its_line(controller: str) -> None:
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    path = [line(10, 0, 0), line(10, 301, 0)._replace(place=Place(5))]
    lines = language.written(iter(path), axes_of(controller), FAST)
    made: list[str] = []
    with pytest.raises(
        CamError, match=r"^line 5, column 1: leads to Y 301.000 mm of the machine, which travels from 0 to"
    ):
        made.extend(each.text for each in lines)
    assert not any("301" in text or "24080" in text for text in made)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_an_arc_about_its_own_end_is_refused(controller: str) -> None:
    path = [line(10, 0, 0), arc((20, 0, 0), (10, 0, 0))._replace(place=Place(5))]
    with pytest.raises(CamError, match="line 5, column 1: an arc begins or ends at its centre"):
        lines_of(controller, path)
