"""The chain of transformations: worked examples of the manual (4.16, 4.21, 4.26) and its way back."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.elements import XY, YZ, ZX, Plane
from isel_twin.firmware.bwo900.geometry.frames import Frame, Rotation, polar

SQUARE = ((0.0, 0.0), (30.0, 0.0), (30.0, 20.0), (0.0, 20.0))


def placed(frame: Frame, corners: tuple = SQUARE, dx: float = 0.0, dy: float = 0.0) -> list[tuple[float, float]]:
    return [frame.machine((x + dx, y + dy, 0.0))[:2] for x, y in corners]


def near(points: list, expected: list) -> None:
    for point, wanted in zip(points, expected, strict=True):
        assert point == pytest.approx(wanted, abs=1e-3)


def test_rotation_of_a_rectangle_and_additions_in_its_own_axes() -> None:
    """P451 and P452 of the manual."""
    frame = Frame(rotation=Rotation(50.0, 10.0, 30.0))
    near(placed(frame), [(50, 10), (75.981, 25), (65.981, 42.321), (40, 27.321)])
    assert frame.rotation is not None
    added = replace(frame, rotation=frame.rotation.added(50.0, 10.0, 30.0))
    near(placed(added), [(66.340, 58.301), (81.340, 84.282), (64.019, 94.282), (49.019, 68.301)])
    assert added.rotation is not None
    assert added.rotation.set(u0=1.0) == Rotation(1.0, 10.0, 30.0, 0.0, 10.0, 30.0)


def test_shift_before_and_after_the_rotation() -> None:
    frame = Frame(rotation=Rotation(50.0, 10.0, 30.0), shift=(60.0, 0.0, 0.0))
    first = replace(frame, shift_first=True)
    near(
        placed(first, dx=10.0, dy=5.0),
        [(108.122, 49.330), (134.103, 64.330), (124.103, 81.651), (98.122, 66.651)],
    )
    near(
        placed(frame, dx=10.0, dy=5.0),
        [(116.160, 19.330), (142.141, 34.330), (132.141, 51.651), (106.160, 36.651)],
    )


def test_triangles_turned_by_quarters_are_exact() -> None:
    rotation = Rotation(angle_deg=0.0)
    seen = []
    for _ in range(4):
        seen.append(Frame(rotation=rotation).machine((10.0, 0.0, 0.0))[:2])
        rotation = rotation.added(dangle_deg=90.0)
    assert seen == [(10.0, 0.0), (0.0, 10.0), (-10.0, 0.0), (0.0, -10.0)]


@pytest.mark.parametrize(
    ("plane", "first", "second"),
    [(XY, (-1, 1, 1), (1, -1, 1)), (ZX, (1, 1, -1), (-1, 1, 1)), (YZ, (1, -1, 1), (1, 1, -1))],
)
def test_mirrors_in_each_plane(plane: Plane, first: tuple, second: tuple) -> None:
    point = (3.0, 5.0, 7.0)
    for g61, g62, signs in (
        (True, False, first),
        (False, True, second),
        (True, True, tuple(a * b for a, b in zip(first, second, strict=True))),
    ):
        frame = Frame(plane=plane, mirror_first=g61, mirror_second=g62)
        assert frame.machine(point) == tuple(p * s for p, s in zip(point, signs, strict=True))
        assert frame.mirrored is (g61 != g62)


def test_zero_points_are_not_mirrored_and_shifts_are() -> None:
    frame = Frame(mirror_first=True, zero=(100.0, 50.0, 0.0), shift=(10.0, 20.0, 5.0))
    assert frame.machine((1.0, 2.0, 3.0)) == (100.0 - 10.0 - 1.0, 50.0 + 20.0 + 2.0, 8.0)


def test_tool_length_lies_along_the_third_axis() -> None:
    assert Frame(length=80.0).machine((1.0, 2.0, 3.0)) == (1.0, 2.0, 83.0)
    assert Frame(plane=ZX, length=80.0).machine((1.0, 2.0, 3.0)) == (1.0, 82.0, 3.0)


def test_axis_correction() -> None:
    """N100 G44 X10 Y20 Z30, N120 ... X100 Y100 Z100."""
    assert Frame(correction=(10.0, 20.0, 30.0)).machine((100.0, 100.0, 100.0)) == (110.0, 120.0, 130.0)


def test_without_everything_for_one_block() -> None:
    frame = Frame(
        correction=(1.0,) * 3, rotation=Rotation(1.0, 2.0, 3.0), mirror_first=True, zero=(1.0,) * 3, length=4.0
    )
    assert frame.bare.machine((1.0, 2.0, 3.0)) == (1.0, 2.0, 3.0)


@pytest.mark.parametrize(
    ("radius", "angle", "point"),
    [
        (90.0, 0.0, (90.0, 0.0)),
        (65.0, 22.619, (60.0, 25.0)),
        (108.166, 33.690, (90.0, 60.0)),
        (-90.138, 70.559, (30.0, 85.0)),
    ],
)
def test_polar_coordinates_of_the_manual(radius: float, angle: float, point: tuple[float, float]) -> None:
    assert polar((0.0, 0.0), radius, angle) == pytest.approx(point, abs=2e-3)


mm = st.floats(-300.0, 300.0)
points = st.tuples(mm, mm, mm)


@given(
    points,
    st.builds(
        Frame,
        st.just(3),
        st.sampled_from([XY, ZX, YZ]),
        points,
        st.one_of(st.none(), st.builds(Rotation, mm, mm, mm, mm, mm, mm)),
        st.booleans(),
        st.booleans(),
        st.booleans(),
        points,
        points,
        mm,
    ),
)
def test_the_way_back(point: tuple[float, float, float], frame: Frame) -> None:
    assert frame.program(frame.machine(point)) == pytest.approx(point, abs=1e-6)
