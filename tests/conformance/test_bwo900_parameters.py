"""BWO 900, chapter 8: parameters of motion, overrides, status cells, limits, parameters that make no sense."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.bwo900_desk import fresh, mm, said, start
from conformance.rows import shows

from isel_twin.firmware.bwo900.path import circumradius
from isel_twin.testing import Desk


def feeds(desk: Desk, limit_s: float = 60.0) -> tuple[np.ndarray, np.ndarray]:
    """Places in mm [n, 3] and path speeds in mm/min [n], one every 2 ms, from Start of P1 to its end."""
    first = desk.ticks
    start(desk)
    desk.finish(limit_s)
    return moved(desk, first)


def moved(desk: Desk, first: int) -> tuple[np.ndarray, np.ndarray]:
    steps = desk.steps_since(first).delta[:, :3] / 1000.0
    return np.cumsum(steps, axis=0), np.hypot.reduce(steps, axis=1) / 0.002 * 60.0


# P8848 to P8850, P8857: formulas of the manual, worked out by hand


@shows("bwo900-8.5-10", "bwo900-8.5-11")
@pytest.mark.parametrize(
    ("g", "turn", "radius", "factor"),
    [
        ("G41", "G3", 10.0, 1.0 - 0.5 * (20.0 - 10.0) / (20.0 - 2.0)),  # inside: concave, P8849
        ("G41", "G2", 10.0, 1.0 + 0.3 * (20.0 - 10.0) / (20.0 - 2.0)),  # outside: convex, P8848
        ("G42", "G2", 10.0, 1.0 - 0.5 * (20.0 - 10.0) / (20.0 - 2.0)),
        ("G42", "G3", 10.0, 1.0 + 0.3 * (20.0 - 10.0) / (20.0 - 2.0)),
        ("G41", "G3", 25.0, 1.0),  # R above P8850
        ("G40", "G3", 10.0, 1.0),  # no contour
    ],
)
def test_feed_dynamics(g: str, turn: str, radius: float, factor: float) -> None:
    """F (1 + p / 100 (P8850 - R) / (P8850 - WR)), P8850 = 20 mm, WR = 2 mm."""
    side = 1.0 if turn == "G3" else -1.0
    way, end = f"X{10 + radius} Y{70 + side * radius} I10 J{70 + side * radius}", 70 + side * 60
    text = f"P1|N5 G0 Y70|N10 F1200 tr:2|N20 {g} G1 X10|N30 {turn} {way}|N40 G1 Y{end}|N50 M30"
    places, speeds = feeds(fresh(text, p8848=30, p8849=-50, p8850=20))
    on = (places[:, 0] > 12.5) & (places[:, 0] < 10 + radius - 2.5)
    assert np.median(speeds[on]) == pytest.approx(1200.0 * factor, rel=0.01)


@shows("bwo900-8.5-12")
@pytest.mark.parametrize(("turn", "centre"), [("G3", 8.0), ("G2", 12.0)])
def test_the_feed_of_the_point_of_contact(turn: str, centre: float) -> None:
    """P8850 = 1: the contour's radius 10 mm is passed with F, the tool's centre with F r / 10."""
    side = 1.0 if turn == "G3" else -1.0
    way, end = f"X20 Y{70 + side * 10} I10 J{70 + side * 10}", 70 + side * 60
    text = f"P1|N5 G0 Y70|N10 F1200 tr:2|N20 G41 G1 X10|N30 {turn} {way}|N40 G1 Y{end}|N50 M30"
    places, speeds = feeds(fresh(text, p8850=1))
    on = (places[:, 0] > 12.5) & (places[:, 0] < 17.0)
    assert np.median(speeds[on]) == pytest.approx(1200.0 * centre / 10.0, rel=0.01)


@pytest.mark.parametrize(
    "values",
    [
        {"p8850": 2, "p8849": -50},  # the tool is as large as the reference
        {"p8850": -5, "p8849": -50},
        {"p8850": 0.5, "p8849": -50},
        {"p8850": 20, "p8849": 1e30, "p8848": 1e30},
        {"p8850": 1e30, "p8849": -1e30, "p8848": -1e30},
    ],
)
def test_feed_dynamics_that_make_no_sense(values: dict[str, float]) -> None:
    """It is off, or at the ends of -100 to 100 %, and the program comes to its end (Z82)."""
    text = "P1|N10 F1200 tr:2|N20 G41 G1 X10|N30 G3 X20 Y10 I10 J10|N35 G2 X30 Y20 I30 J10|N40 G1 X40|N50 M30"
    desk = fresh(text, **values)
    start(desk)
    desk.finish(300.0)
    assert (said(desk), mm(desk)[:2]) == ([], (40.0, 22.0))


@shows("bwo900-8.5-14")
def test_contour_dynamics() -> None:
    """Points on a circle of 20 mm, 5 degrees apart: v = KV sqrt(2 R d), 16 / s, d 0.05 mm; arcs alike; not rapid."""
    most = 16.0 * math.sqrt(2 * 20 * 0.05) * 60.0
    points = [(20 * math.sin(math.radians(a)), 20 - 20 * math.cos(math.radians(a))) for a in range(5, 91, 5)]
    lines = "|".join(f"N{20 + n} X{x:.6f} Y{y:.6f}" for n, (x, y) in enumerate(points))
    places, speeds = feeds(fresh(f"P1|N10 G1 F3000|{lines}|N90 M30", p8857=0.05))
    on = (places[:, 1] > 1.0) & (places[:, 1] < 18.0)
    assert np.median(speeds[on]) == pytest.approx(most, rel=0.01)
    assert speeds[on].max() <= most * 1.1  # rounding of both axes to 1 um in 2 ms
    places, speeds = feeds(fresh("P1|N10 G3 F3000 X20 Y20 I0 J20|N90 M30", p8857=0.05))
    assert np.median(speeds) == pytest.approx(most, rel=0.01)
    _, speeds = feeds(fresh("P1|N10 G1 F3000 X40|N20 X80|N90 M30", p8857=0.05))
    assert speeds.max() == pytest.approx(3000.0, rel=0.02)  # straight on
    _, speeds = feeds(fresh(f"P1|N10 G0|{lines}|N90 M30", p8857=0.05, p8858=2))
    assert speeds.max() > 1.5 * most


def test_the_circle_through_three_points() -> None:
    assert circumradius((0.0, 0.0), (3.0, 0.0), (3.0, 4.0)) == pytest.approx(2.5)
    assert circumradius((0.0, 0.0, 0.0), (3.0, 0.0, 0.0), (3.0, 0.0, 4.0)) == pytest.approx(2.5)
    assert circumradius((0.0, 0.0), (3.0, 0.0), (5.0, 0.0)) == math.inf
    assert circumradius((0.0, 0.0), (3.0, 0.0), (0.0, 0.0)) == math.inf
    assert circumradius((0.0, 0.0), (0.0, 0.0), (5.0, 0.0)) == math.inf
