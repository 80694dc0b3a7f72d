"""Circles and helices: the manual's two printed commands, every octant, both directions, every way to compute D."""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.motion import circle
from isel_twin.motion.circle import Circle, squared_radius
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=5)

RADII = [7, 8, 9, 10, 13, 20, 25, 64, 99, 100, 200, 401, 1000, 5001, 20_000]
OCTANTS = [8 + 45 * k for k in range(8)]
AXES = [0, 90, 180, 270]


def on_circle(radius: float, degrees: float) -> tuple[int, int]:
    """Start point, manual 2.3.4, rounded."""
    angle = math.radians(degrees)
    return round(radius * math.cos(angle)), round(radius * math.sin(angle))


def senses(x: int, y: int, clockwise: bool) -> tuple[int, int]:
    """Rx, Ry, manual 2.3.5: the way the path leaves the point; on an axis that of the quadrant it enters."""
    forward = -1 if clockwise else 1
    rx = -forward * y or -x
    ry = forward * x or -y
    return (1 if rx > 0 else -1), (1 if ry > 0 else -1)


def summe_printed(n: int) -> int:
    """Summe(n) as the worked example computes it: Summe(-141) = 141 (-141 + 1)."""
    return abs(n) * (n + 1)


def summe_odd(n: int) -> int:
    """Summe(n) as it makes the register exact: an odd function."""
    return n * (abs(n) + 1)


def manual_d(r: int, x: int, y: int, rx: int, ry: int, clockwise: bool, summe: Callable[[int], int]) -> float:
    """D of manual 2.3.6; clockwise is its mirror image."""
    if clockwise:
        x, y, rx, ry = y, x, ry, rx
    sums = rx * ry * (r + summe(r - 1)) - rx * summe(x + (rx - ry) // 2) + ry * summe(y + (rx + ry) // 2)
    return sums / 2


def slipped_d(r: int, x: int, y: int, rx: int, ry: int) -> float:
    """D with both slips of the worked example: Summe(n) as printed, and Ys + (Rx - Ry)/2; counter-clockwise."""
    sums = rx * ry * (r + summe_printed(r - 1))
    sums += -rx * summe_printed(x + (rx - ry) // 2) + ry * summe_printed(y + (rx - ry) // 2)
    return sums / 2


def field_d(r: float, x: int, y: int, rx: int, ry: int) -> float:
    """D as hosts in the field compute it."""
    return (r * r - x * (x - rx) - y * (y - ry)) / 2


def points(path: Circle, x: int, y: int) -> NDArray[np.int64]:
    """int64 [ticks + 1, 2] around the centre; every tick must be one step of one of the two axes."""
    delta = path.deltas(0, path.ticks)[:, :2].astype(np.int64)
    assert (np.abs(delta).sum(axis=1) == 1).all()
    return np.concatenate([[(x, y)], np.array((x, y)) + np.cumsum(delta, axis=0)])


def off(path: NDArray[np.int64], radius: float) -> float:
    """Largest distance from the circle."""
    return float(np.abs(np.hypot(path[:, 0], path[:, 1]) - radius).max())


def turns(path: NDArray[np.int64]) -> float:
    """Turns made around the centre, counter-clockwise positive."""
    angle = np.unwrap(np.arctan2(path[:, 1], path[:, 0]))
    return float(angle[-1] - angle[0]) / (2 * math.pi)


def test_the_arc_printed_in_the_manual() -> None:
    """y400,1500,119,-141,141,-1,-1 after f-1: a quarter of R = 200 from 135 to 225 degrees."""
    path = points(circle(400, 119, -141, 141, -1, -1, clockwise=False), -141, 141)
    assert len(path) == 401
    assert path[-1].tolist() == [-141, -141]
    assert off(path, 200) <= 1
    assert path[:, 0].min() == -200
    assert turns(path) == pytest.approx(0.25)


def test_the_helix_printed_in_the_manual() -> None:
    """w32000,600,-1000,-2000,0,1,-1,6000: 32000 = 2 x 8 x 2000, two turns of R = 2000 from 180 degrees."""
    spiral = circle(32_000, -1000, -2000, 0, 1, -1, False, (0, 1), 2, 6000)
    path = points(spiral, -2000, 0)
    assert off(path, 2000) <= 1
    assert turns(path) == pytest.approx(2)
    assert spiral.displacement(32_000) == (0, 0, 6000, 0)
    third = np.cumsum(spiral.deltas(0, 32_000)[:, 2].astype(int))
    assert third.tolist() == [(2 * k * 6000 + 32_000) // 64_000 for k in range(1, 32_001)]


def test_the_arc_of_a_field_host() -> None:
    """f0, y2400,400,-200,0,-400,-1,1: three quarters of R = 400, clockwise from the bottom."""
    path = points(circle(2400, -200, 0, -400, -1, 1, clockwise=True), 0, -400)
    assert off(path, 400) <= 1
    assert path[-1].tolist() == [400, 0]
    assert turns(path) == pytest.approx(-0.75)


@pytest.mark.parametrize("summe", [summe_printed, summe_odd])
@pytest.mark.parametrize("clockwise", [False, True], ids=["ccw", "cw"])
@pytest.mark.parametrize("radius", RADII)
def test_octants_with_the_manuals_formula(radius: int, clockwise: bool, summe: Callable[[int], int]) -> None:
    """One turn from a point in each octant: never more than a step off, whichever way D is made a whole number."""
    for degrees in OCTANTS:
        x, y = on_circle(radius, degrees)
        rx, ry = senses(x, y, clockwise)
        d = manual_d(radius, x, y, rx, ry, clockwise, summe)
        for whole in {math.floor(d), math.ceil(d)}:
            path = points(circle(8 * radius, whole, x, y, rx, ry, clockwise), x, y)
            assert off(path, radius) <= 1
            assert turns(path) == pytest.approx(-1 if clockwise else 1, abs=2 / radius)


@pytest.mark.parametrize("radius", [7, 8, 20, 33, 141, 1000])
def test_every_reading_of_the_manuals_text(radius: int) -> None:
    """Sixteen directions. R = 8 from 157.5 degrees is also a reading for R = 7, but farther from the start point."""
    for degrees in range(0, 720, 45):
        x, y = on_circle(radius, degrees / 2)
        rx, ry = senses(x, y, False)
        readings = [manual_d(radius, x, y, rx, ry, False, summe) for summe in (summe_printed, summe_odd)]
        for d in (*readings, slipped_d(radius, x, y, rx, ry)):
            path = points(circle(8 * radius, math.floor(d), x, y, rx, ry, False), x, y)
            assert off(path, radius) <= 1


@pytest.mark.parametrize("summe", [summe_printed, summe_odd])
@pytest.mark.parametrize("clockwise", [False, True], ids=["ccw", "cw"])
@pytest.mark.parametrize("radius", RADII)
def test_full_circles_from_an_axis_close(radius: int, clockwise: bool, summe: Callable[[int], int]) -> None:
    for degrees in AXES:
        x, y = on_circle(radius, degrees)
        rx, ry = senses(x, y, clockwise)
        d = manual_d(radius, x, y, rx, ry, clockwise, summe)
        for whole in {math.floor(d), math.ceil(d)}:
            full = circle(8 * radius, whole, x, y, rx, ry, clockwise)
            path = points(full, x, y)
            assert path[-1].tolist() == [x, y]
            assert full.displacement(full.ticks) == (0, 0, 0, 0)
            assert off(path, radius) <= 0.75
            assert np.abs(path).max() == radius


@pytest.mark.parametrize("whole", [int, round], ids=["cut", "rounded"])
@pytest.mark.parametrize("clockwise", [False, True], ids=["ccw", "cw"])
@pytest.mark.parametrize("radius", [*RADII, 7.5, 12.34, 99.9, 400.4])
def test_octants_with_the_formulas_of_the_field(radius: float, clockwise: bool, whole: Callable[[float], int]) -> None:
    for degrees in OCTANTS + AXES:
        angle = math.radians(degrees)
        x, y = whole(radius * math.cos(angle)), whole(radius * math.sin(angle))
        rx, ry = senses(x, y, clockwise)
        for factor in (1, -rx * ry):
            d = whole(factor * field_d(radius, x, y, rx, ry))
            path = points(circle(round(8 * radius), d, x, y, rx, ry, clockwise), x, y)
            assert off(path, radius) <= 4
            # The same number of steps is a longer arc on a smaller circle: 1.5 turns at 5 instead of 7.5 steps.
            assert 0.7 < turns(path) * (-1 if clockwise else 1) < 1.6


@given(
    st.integers(-(1 << 70), 1 << 70),
    st.integers(-(1 << 24), 1 << 24),
    st.integers(-(1 << 24), 1 << 24),
    st.sampled_from([-1, 0, 1]),
    st.sampled_from([-1, 0, 1]),
    st.booleans(),
)
@settings(deadline=None, max_examples=drawn(200))
def test_any_parameters_make_one_step_a_tick(d: int, x: int, y: int, rx: int, ry: int, clockwise: bool) -> None:
    path = points(circle(300, d, x, y, rx, ry, clockwise), x, y)
    assert off(path, math.hypot(x, y)) <= 3.5


@given(st.integers(-3, 3), st.integers(-3, 3), st.integers(-100, 100), st.booleans())
@settings(deadline=None, max_examples=drawn(100))
def test_the_centre_is_no_trap(x: int, y: int, d: int, clockwise: bool) -> None:
    path = points(circle(200, d, x, y, 1, 1, clockwise), x, y)
    assert np.abs(path).max() <= 6


@pytest.mark.parametrize("axes", [(0, 1), (0, 2), (1, 2), (2, 0)])
def test_planes(axes: tuple[int, int]) -> None:
    """A quarter of R = 100 from the first towards the second axis of the plane."""
    displacement = [0, 0, 0, 0]
    displacement[axes[0]], displacement[axes[1]] = -100, 100
    assert circle(200, -50, 100, 0, -1, 1, False, axes).displacement(200) == tuple(displacement)


@pytest.mark.parametrize("axis_count", [2, 3, 6, 8])
def test_as_many_axes_as_the_controller_has(axis_count: int) -> None:
    plane = (axis_count - 1, 0)
    arc = circle(200, -50, 100, 0, -1, 1, False, plane, axis_count=axis_count)
    delta = arc.deltas(0, 200)
    assert (arc.axes, delta.shape, delta.dtype) == (axis_count, (200, axis_count), np.int8)
    assert (np.abs(delta).sum(axis=1) == 1).all()
    expected = [0] * axis_count
    expected[plane[0]], expected[plane[1]] = -100, 100
    assert arc.displacement(200) == tuple(expected)
    with pytest.raises(ValueError, match=f"out of 0..{axis_count - 1}"):
        circle(200, -50, 100, 0, -1, 1, False, (0, axis_count), axis_count=axis_count)


@pytest.mark.parametrize("third_steps", [0, 1, -1, 777, -3200, 3200])
@pytest.mark.parametrize("third_axis", [2, 3])
def test_helix_spreads_the_third_axis(third_axis: int, third_steps: int) -> None:
    flat = circle(3200, -200, 400, 0, -1, 1, False)
    spiral = circle(3200, -200, 400, 0, -1, 1, False, (0, 1), third_axis, third_steps)
    delta = spiral.deltas(0, 3200)
    assert delta[:, :2].tolist() == flat.deltas(0, 3200)[:, :2].tolist()
    made = np.cumsum(delta[:, third_axis].astype(int))
    sign = -1 if third_steps < 0 else 1
    assert made.tolist() == [sign * ((2 * k * abs(third_steps) + 3200) // 6400) for k in range(1, 3201)]
    assert spiral.displacement(1234)[third_axis] == made[1233]


@pytest.mark.parametrize("third_steps", [3201, -5000, 64_000])
def test_a_third_axis_with_more_steps_leads(third_steps: int) -> None:
    """It steps at every tick; step j of the arc falls at the first tick k with 2 k B + N >= 2 N j, as in a line."""
    arc = circle(3200, -200, 400, 0, -1, 1, False)
    steep = circle(3200, -200, 400, 0, -1, 1, False, (0, 1), 2, third_steps)
    n = abs(third_steps)
    delta = steep.deltas(0, n)
    assert delta[:, 2].tolist() == [np.sign(third_steps)] * n
    falls = [-(-(2 * n * j - n) // 6400) for j in range(1, 3201)]
    assert (np.flatnonzero(delta[:, :2].any(axis=1)) + 1).tolist() == falls
    assert delta[np.array(falls) - 1, :2].tolist() == arc.deltas(0, 3200)[:, :2].tolist()
    assert np.array_equal(np.vstack([steep.deltas(0, 1001), steep.deltas(1001, n)]), delta)
    for k in (0, 1, 1000, n):
        assert steep.displacement(k) == tuple(delta[:k].sum(axis=0, dtype=int).tolist())


@given(st.lists(st.integers(0, 160_000), min_size=1, max_size=6))
@settings(deadline=None, max_examples=drawn(30))
def test_windows_and_displacements_do_not_depend_on_how_they_are_cut(cuts: list[int]) -> None:
    """160000 ticks: some twenty checkpoints."""
    spiral = circle(160_000, -10_000, 20_000, 0, -1, 1, False, (1, 0), 3, -5000)
    whole = spiral.deltas(0, 160_000)
    made = np.cumsum(whole.astype(np.int64), axis=0)
    edges = sorted({0, 160_000, *cuts})
    for first, last in pairwise(edges):
        assert np.array_equal(spiral.deltas(first, last), whole[first:last])
        assert spiral.displacement(last) == tuple(made[last - 1])


@pytest.mark.parametrize("ticks", [0, 1, 8191, 8192, 8193, 16_384])
def test_lengths_around_a_checkpoint(ticks: int) -> None:
    arc = circle(ticks, -10_000, 20_000, 0, -1, 1, False)
    made = arc.deltas(0, ticks).sum(axis=0, dtype=int)
    assert arc.displacement(ticks) == tuple(made)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((10, 0, 5, 0, -1, 1, False, (0, 0), None, 0), "different axes"),
        ((10, 0, 5, 0, -1, 1, False, (0, 4), None, 0), "different axes"),
        ((10, 0, 5, 0, -1, 1, False, (0, 1), 1, 5), "different axes"),
        ((-1, 0, 5, 0, -1, 1, False, (0, 1), None, 0), "ticks"),
        ((10, 0, 1 << 28, 0, -1, 1, False, (0, 1), None, 0), "below"),
        ((10, 0, 5, 0, -1, 1, False, (0, 1), 2, -1 << 28), "below"),
    ],
)
def test_what_is_no_circle(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        circle(*arguments)


def test_ticks_that_do_not_exist() -> None:
    with pytest.raises(IndexError, match="of 10"):
        circle(10, 0, 5, 0, -1, 1, False).deltas(0, 11)
    with pytest.raises(IndexError, match="of 10"):
        circle(10, 0, 5, 0, -1, 1, False).displacement(11)


def test_a_tie_steps_outwards() -> None:
    """Radius 1: from (1, 0) the centre and (1, 1) are as near in c, |c| = 1 both; the path goes round the centre."""
    path = Circle(8, 1, 0, 1, (0, 1), None, 0, 4)
    corners = [(1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1), (1, 0)]
    assert points(path, 1, 0)[-8:].tolist() == [list(point) for point in corners]


@pytest.mark.parametrize(("meant", "r2"), [(10_100, 10_100), (9_900, 9_900), (1_000_000, 10_303), (400, 9_702)])
def test_a_radius_that_is_not_whole_stays_near_the_start_point(meant: int, r2: int) -> None:
    """Start (100, 0), Rx = -1, Ry = 1: 2 D = Xs (Xs + Rx) - R^2. At most 1.5 steps off: 98.5^2 and 101.5^2, rounded."""
    assert squared_radius((100 * 99 - meant) // 2, 100, 0, -1, 1) == r2


@pytest.mark.parametrize(("x", "r2"), [(100, 9702), (1, 0)])
def test_from_outside_on_its_axis_the_path_goes_inwards(x: int, r2: int) -> None:
    """The step inwards ends nearer to the circle: (x - 1)^2 - R^2 against x^2 + 1 - R^2."""
    path = Circle(1, x, 0, r2, (0, 1), None, 0, 4)
    assert points(path, x, 0)[1].tolist() == [x - 1, 0]
