"""Lines and arcs: closed forms."""

from __future__ import annotations

import math

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.elements import XY, YZ, ZX, Arc, Plane, Straight

mm = st.floats(-500.0, 500.0)


def test_a_quarter_of_a_circle() -> None:
    arc = Arc((10.0, 0.0, 0.0), (0.0, 10.0, 4.0), XY, (0.0, 0.0), math.pi / 2.0)
    assert arc.radius_mm == 10.0
    assert arc.length_mm == pytest.approx(math.hypot(5.0 * math.pi, 4.0))
    assert arc.point(0.5) == pytest.approx((math.sqrt(50.0), math.sqrt(50.0), 2.0))
    assert arc.tangent(0.0) == pytest.approx((0.0, 5.0 * math.pi / arc.length_mm, 4.0 / arc.length_mm))


@pytest.mark.parametrize(("plane", "axis"), [(XY, 2), (ZX, 1), (YZ, 0)])
def test_counter_clockwise_is_seen_against_the_third_axis(plane: Plane, axis: int) -> None:
    """From the first axis to the second: their cross product is the third."""
    first = tuple(float(i == plane.first) for i in range(3))
    second = tuple(float(i == plane.second) for i in range(3))
    cross = tuple(first[(i + 1) % 3] * second[(i + 2) % 3] - first[(i + 2) % 3] * second[(i + 1) % 3] for i in range(3))
    assert cross == tuple(float(i == axis) for i in range(3))
    arc = Arc(first, second, plane, (0.0, 0.0), math.pi / 2.0)
    assert arc.point(0.5) == pytest.approx(tuple((a + b) * math.sqrt(0.5) for a, b in zip(first, second, strict=True)))


@given(st.tuples(mm, mm, mm), st.tuples(mm, mm, mm), st.floats(0.0, 1.0))
def test_a_line_and_its_reverse(start: tuple, end: tuple, share: float) -> None:
    line = Straight(start, end)
    assert line.point(0.0) == start
    assert line.point(1.0) == end
    assert line.reversed().point(1.0 - share) == pytest.approx(line.point(share), abs=1e-9)


@given(mm, mm, st.floats(0.1, 300.0), st.floats(-math.pi, math.pi), st.floats(-6.28, 6.28), st.floats(0.01, 0.99))
def test_points_of_an_arc(u: float, v: float, radius: float, begin: float, sweep: float, share: float) -> None:
    def at(angle: float) -> tuple[float, float, float]:
        return (u + radius * math.cos(angle), v + radius * math.sin(angle), 1.0)

    arc = Arc(at(begin), at(begin + sweep), XY, (u, v), sweep)
    assert arc.point(share) == pytest.approx(at(begin + share * sweep), abs=1e-6)
    assert arc.length_mm == pytest.approx(radius * abs(sweep), rel=1e-6, abs=1e-6)
    assert arc.reversed().point(1.0 - share) == pytest.approx(arc.point(share), abs=1e-6)
    if abs(sweep) > 1e-3:
        near = arc.point(share + 1e-7)
        step = [b - a for a, b in zip(arc.point(share), near, strict=True)]
        slope = arc.tangent(share)
        assert sum(a * b for a, b in zip(step, slope, strict=True)) == pytest.approx(
            math.hypot(*step), rel=1e-3, abs=1e-9
        )


@given(
    st.floats(-math.pi, math.pi), st.floats(-6.28, 6.28).filter(lambda s: abs(s) > 1e-3), st.sampled_from([XY, ZX, YZ])
)
def test_an_extent_is_what_a_thousand_points_reach(begin: float, sweep: float, plane: Plane) -> None:
    def at(angle: float) -> tuple[float, ...]:
        return plane.into((0.0, 0.0, 0.0), 3.0 + 10.0 * math.cos(angle), 4.0 + 10.0 * math.sin(angle))

    arc = Arc(at(begin), at(begin + sweep), plane, (3.0, 4.0), sweep)
    points = [arc.point(n / 1000.0) for n in range(1001)]
    for axis in range(3):
        seen = [point[axis] for point in points]
        assert arc.extent(axis) == pytest.approx((min(seen), max(seen)), abs=1e-4)
    assert Straight((1.0, 5.0, 0.0), (2.0, 3.0, 0.0)).extent(1) == (3.0, 5.0)
