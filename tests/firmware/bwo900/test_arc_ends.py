"""Arcs whose ends miss the programmed circle by as much as P8843 allows: cut where the circle is programmed."""

from __future__ import annotations

import math

import pytest
from conformance.bwo900_desk import analysed
from hypothesis import example, given, settings
from hypothesis import strategies as st

from isel_twin.firmware.bwo900.geometry.elements import Arc

TOLERANCE_MM = 0.003  # P8843 as delivered
PLANES = {"G17": ("X", "Y", "I", "J"), "G18": ("Z", "X", "K", "I"), "G19": ("Y", "Z", "J", "K")}
INDEX = "XYZ"


def arc_of(text: str) -> Arc:
    made = [element for block in analysed(text).blocks for element in block.elements if isinstance(element, Arc)]
    assert len(made) == 1
    return made[0]


@settings(max_examples=300, deadline=None)
@given(
    plane=st.sampled_from(sorted(PLANES)),
    clockwise=st.booleans(),
    absolute=st.booleans(),
    mirror=st.sampled_from(["", "G61", "G62", "G61 G62"]),
    radius=st.floats(0.5, 80.0),
    begin=st.floats(0.0, 2.0 * math.pi),
    share=st.one_of(st.just(1.0), st.floats(0.02, 0.98)),
    miss=st.floats(-0.99, 0.99),
)
@example("G17", True, True, "", 10.0, 0.0, 1.0, 1e-6 / TOLERANCE_MM)
@example("G17", False, True, "", 10.0, 0.0, 1.0, -1e-6 / TOLERANCE_MM)
@example("G17", True, False, "G61", 10.0, 0.0, 1.0, 0.99)
def test_the_programmed_circle_is_cut(
    plane: str, clockwise: bool, absolute: bool, mirror: str, radius: float, begin: float, share: float, miss: float
) -> None:
    """Every point of the path is as far from the programmed centre as the radius, but for the tolerance, and goes the
    programmed way round: share of a full turn."""
    a, b, i, j = PLANES[plane]
    turn = (-1.0 if clockwise else 1.0) * 2.0 * math.pi * share
    start = (40.0, 55.0)
    centre = (start[0] - radius * math.cos(begin), start[1] - radius * math.sin(begin))
    out = radius + miss * TOLERANCE_MM
    end = (centre[0] + out * math.cos(begin + turn), centre[1] + out * math.sin(begin + turn))
    base = (0.0, 0.0) if absolute else start
    g = "G2" if clockwise else "G3"
    words = (
        f"{a}{end[0] - base[0]:.9f} {b}{end[1] - base[1]:.9f} {i}{centre[0] - base[0]:.9f} {j}{centre[1] - base[1]:.9f}"
    )
    way_in = f"N5 {plane} {mirror} F500|N10 G90 G0 {a}{start[0]} {b}{start[1]}"
    program = f"{way_in}|N20 {'G90' if absolute else 'G91'} {g} {words}|N30 M30"
    arc = arc_of(program)
    first, second = INDEX.index(a), INDEX.index(b)
    u, v = (-1.0 if name in mirror else 1.0 for name in ("G61", "G62"))  # of the plane's first and second axis
    wanted, way = (u * centre[0], v * centre[1]), turn * u * v
    assert arc.sweep_rad == pytest.approx(way, abs=2.5 * TOLERANCE_MM / radius + 1e-6)
    for n in range(33):
        point = arc.point(n / 32)
        away = math.dist((point[first], point[second]), wanted)
        assert abs(away - radius) <= 2.0 * TOLERANCE_MM + 1e-6


def test_a_full_circle_whose_end_misses_by_a_rounded_digit() -> None:
    for x, y in ((60.000001, 50.0), (59.999999, 50.0), (60.0, 50.000001), (60.0, 49.999999)):
        for g, turn in (("G2", -1.0), ("G3", 1.0)):
            arc = arc_of(f"N10 G0 X50 Y50|N20 G1 F3000 X60|N30 {g} X{x:.6f} Y{y:.6f} I50 J50|N40 M30")
            assert arc.centre == pytest.approx((50.0, 50.0), abs=1e-4)
            assert arc.sweep_rad == pytest.approx(turn * 2.0 * math.pi, abs=1e-6)
