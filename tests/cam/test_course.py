"""The way of the tool in counts, where axes differ and where numbers are extreme."""

from __future__ import annotations

import math
import re

import pytest
from cam.played import END, FAST, TRAVEL, arc, axes_of, line, lines_of, rapid, texts

from isel_twin import Twin
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError
from isel_twin.cam.written import MachineAxes
from isel_twin.jobs.toolpaths import machine_axes

COARSE_Y = MachineAxes((320.0, 160.0, 320.0), TRAVEL)


def test_the_leading_axis_has_most_counts_and_not_most_millimetres() -> None:
    """(30, 40) mm are 9600 and 6400 steps: X leads, at 10 mm/s with 9600 / 50 * 10 Hz."""
    (*_, cut) = texts(lines_of("imc-s8", [line(30, 40, 0), END], axes=COARSE_Y))
    assert cut == "@0M9600,1920,6400,1920,0,1920,0,30"


def test_an_arc_of_axes_that_differ_is_chords() -> None:
    """The lower half about (60, 60): every corner within half a step of it, in the coarser axis 3 um."""
    path = [rapid(50, 60, 0), arc((70, 60, 0), (60, 60, 0)), END]
    lines = texts(lines_of("imc-s8", path, axes=COARSE_Y))[5:]
    corners = [tuple(map(int, text[3:].split(",")[:3:2])) for text in lines]
    radii = [math.hypot(x / 320 - 60, y / 160 - 60) for x, y in corners]
    assert len(corners) == math.ceil(math.pi / (2 * math.acos(1 - 0.01 / 10)))
    assert max(abs(r - 10) for r in radii) <= math.hypot(0.5 / 320, 0.5 / 160)
    assert min(y for _, y in corners) == 50 * 160


@pytest.mark.parametrize("controller", ["imc-s8", "gmi99", "bwo900"])
def test_an_arc_that_is_nearly_a_line_has_parameters_within_24_bits(controller: str) -> None:
    """r = 20 km: 1 mm of it is a line."""
    lines = texts(lines_of(controller, [rapid(50, 60, 0), arc((51, 60, 0), (50.5, 20_000_060.0, 0)), END]))
    numbers = [int(number) for text in lines for number in re.findall(r"\d+", text)]
    assert max(numbers) < 1 << 23
    assert len(lines) < 10


@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_a_tiny_circle_is_no_farther_off_than_the_tolerance(controller: str) -> None:
    """r = 5 um, tolerance 10 um: whatever is written ends where it began."""
    axes = axes_of(controller)
    path = [rapid(50, 60, 0), arc((50, 60, 0), (50.005, 60, 0)), rapid(60, 60, 0), END]
    begin = texts(lines_of(controller, [path[0], path[2], END]))
    made = texts(lines_of(controller, path))
    assert made[0] == begin[0]
    assert len(made) - len(begin) <= 3
    assert axes.count == 3


def test_a_feed_of_nearly_nothing_is_still_a_feed() -> None:
    lines = lines_of("bwo900", [line(1, 0, 0, 1e-7), END])
    assert [each.text for each in lines if "G1 " in each.text and not each.caution] == ["N30 G1 X1 F0.01"]
    assert sum(each.caution is not None for each in lines) == 1


def test_the_axes_of_a_machine() -> None:
    for controller, machine, steps in (("imc-s8", "4030", 320), ("ismif", "4030", 80), ("gmi99", "4030-servo", 1000)):
        axes = machine_axes(Twin(machine=machine, controller=controller, plant="kinematic").machine)
        assert axes.steps_mm == pytest.approx((steps,) * 3)
        assert axes.travel_mm == TRAVEL


@pytest.mark.parametrize(
    "values",
    [
        ((0.0, 320.0, 320.0), TRAVEL, None),
        ((320.0,) * 3, ((1.0, 0.0), TRAVEL[1], TRAVEL[2]), None),
        ((320.0,) * 3, TRAVEL, (1.0, -1.0, 1.0)),
    ],
    ids=["steps", "travel", "speeds"],
)
def test_axes_that_are_not_possible(values: tuple[object, ...]) -> None:
    with pytest.raises(ValueError, match="is "):
        MachineAxes(*values)  # type: ignore[arg-type]


def test_a_fine_tolerance_makes_more_chords() -> None:
    path = [rapid(50, 60, -20), arc((50, 60, -25), (60, 60, 0)), END]
    coarse, fine = (
        len(lines_of("imc-s8", path, CamSettings(rapid_mm_s=30.0, tolerance_mm=e))) - 5 for e in (0.01, 0.0025)
    )
    assert (coarse, fine) == (71, 141)
    assert fine == math.ceil(2 * math.pi / (2 * math.acos(1 - 0.0025 / 10)))
    assert FAST.tolerance_mm == 0.01


def test_a_helix_that_leaves_the_travel_at_its_end_is_refused() -> None:
    with pytest.raises(CamError, match=r"leads to Z 142\.000 mm of the machine, which travels from 0 to 140"):
        lines_of("bwo900", [rapid(50, 60, -138), arc((50, 60, -142), (60, 60, 0)), END])
