"""Circles of the GMI99: within one increment of the arc, as many chords and as fast as the manual says (1.2)."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
from firmware.gmi99.rules import Rules
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.firmware.gmi99.circle import chords, circle, fastest_hz
from isel_twin.firmware.gmi99.planner import PreparedMove, line, start
from isel_twin.motion.joined import Joined
from tests.thorough import drawn

WITHIN = 3 / 8 + math.sqrt(1 / 2) + 1e-9
"""Increments: first and last chords, of sagitta 1/2 from the arc to a corner 1/4 outside, lie 3/8 inside at most; and
set points are rounded on both axes."""
RULES = replace(Rules().with_speed(1_000_000), free_circles=True)


def way(*n: int) -> tuple[int, ...]:
    return (*n, *(0,) * (6 - len(n)))


def places(plan: Joined) -> NDArray[np.int64]:
    return np.vstack((np.zeros((1, 6), dtype=np.int64), np.cumsum(plan.deltas(0, plan.ticks), axis=0, dtype=np.int64)))


def seconds(pieces: PreparedMove) -> float:
    return start([pieces], RULES).duration_s


def test_the_printed_speed() -> None:
    """1.2: R = 100 000 gives 52 700 Hz, 3.1 m/min at 1 um."""
    assert round(fastest_hz(100_000), 2) == 52_704.63
    assert round(fastest_hz(100_000) * 60e-6, 3) == 3.162
    assert round(fastest_hz(1000), 2) == 5270.46


@pytest.mark.parametrize(
    ("radius", "angle", "count"),
    [
        (10_000, math.pi / 2, 79),  # d = 2 asin(1/100) = 0.0200003; 78.54
        (1000, 2 * math.pi, 100),  # d = 2 asin(1/31.6) = 0.0632561; 99.33
        (1, 2 * math.pi, 4),  # d = pi, and no chord over 90 degrees
        (1, math.pi, 2),
        (2, math.pi / 2, 1),  # d = 90 degrees
        (100_000, 0.001, 1),
    ],
)
def test_number_of_chords(radius: int, angle: float, count: int) -> None:
    assert chords(radius, angle) == count


def test_quarter_circle() -> None:
    """79 chords: 77 of 2 (R + 1/4) sin(phi / 158), two from R to R + 1/4; at 10 000 Hz with 200 ms ramps."""
    rules = replace(Rules().with_speed(50_000), free_circles=True)
    move = circle({0: -10_000, 1: 0}, way(-10_000, 10_000), False, 10_000, rules)
    assert len(move.pieces) == 79
    plan = start([move], rules)
    assert plan.displacement(plan.ticks) == way(-10_000, 10_000)
    step = math.pi / 2 / 79
    outer, inner = 10_000.25, 10_000
    path = 77 * 2 * outer * math.sin(step / 2) + 2 * math.sqrt(outer**2 + inner**2 - 2 * outer * inner * math.cos(step))
    assert plan.duration_s == pytest.approx(path / 10_000 + 0.2, abs=1e-8)
    assert round(plan.duration_s, 6) == 1.770809
    at = places(plan) + np.array(way(10_000))
    assert np.abs(np.hypot(at[:, 0], at[:, 1]) - 10_000).max() < 1
    assert np.all(np.diff(np.arctan2(at[:, 1], at[:, 0])) >= 0)  # counter-clockwise


def test_full_circle_is_limited_by_its_radius() -> None:
    rules = replace(Rules().with_speed(50_000), free_circles=True)
    plan = start([circle({0: 1000, 1: 0}, way(), True, 10_000, rules)], rules)
    assert plan.pieces == 100
    assert max(plan.speed(k) for k in range(plan.ticks)) == pytest.approx(math.sqrt(4000) / 0.012)
    assert round(plan.duration_s, 6) == 1.297659
    at = places(plan) - [1000, 0, 0, 0, 0, 0]
    assert np.array_equal(at[0], at[-1])
    turned = np.unwrap(np.arctan2(at[:, 1], at[:, 0]))
    assert turned[-1] - turned[0] == pytest.approx(-2 * math.pi)  # clockwise
    assert np.abs(np.hypot(at[:, 0], at[:, 1]) - 1000).max() < 1


def test_corners_between_chords_count_unless_switched_off() -> None:
    """N14 = 0, FS0 = 50, R = 10 000: chords meet at 1.14 degrees; near an axis the velocity changes by 0.02 in
    one component: 49.4 / 0.0199 Hz; half a chord from 45 degrees by cos(45 deg - half a chord) of it."""
    rules = Rules().with_speed(50_000)
    move = circle({0: -10_000, 1: 0}, way(-10_000, 10_000), False, 10_000, rules)
    step = math.pi / 2 / 79
    jump = 50 - 50 * math.degrees(step) / 90
    slowest, fastest = (
        jump / (2 * math.sin(step / 2)),
        jump / (2 * math.sin(step / 2) * math.cos(math.pi / 4 - step / 2)),
    )
    inner = move.pieces.entry[2:-1]
    assert inner.min() == pytest.approx(slowest, rel=1e-3)
    assert inner.max() == pytest.approx(fastest, rel=1e-3)
    assert np.all(np.isinf(circle({0: -10_000, 1: 0}, way(-10_000, 10_000), False, 10_000, RULES).pieces.entry))


def test_entry_and_exit_corners_always_count() -> None:
    """Tangential in, at a right angle out: through at full speed, and at a stop (N16 = 0)."""
    rules = replace(Rules().with_speed(50_000), free_circles=True, jump_hz=1000)
    arc = circle({0: 0, 1: 10_000}, way(10_000, 10_000), False, 10_000, rules)
    plan = start([line(way(10_000), 10_000, rules), arc, line(way(10_000), 10_000, rules)], rules)
    assert plan.speed(plan.passed(1)) == pytest.approx(10_000)
    assert plan.speed(plan.passed(80)) < 50_000 * 0.004
    assert plan.speed(plan.passed(80) - 1) < 50_000 * 0.004


def test_helix_goes_along_with_the_chords() -> None:
    rules = replace(Rules().with_speed(50_000), free_circles=True)
    plan = start([circle({0: -5000, 1: 0}, way(0, 0, 3000, -77), False, 5000, rules)], rules)
    at = places(plan)
    assert tuple(at[-1]) == way(0, 0, 3000, -77)
    angle = np.unwrap(np.arctan2(at[:, 1], at[:, 0] + 5000))
    assert np.abs(at[:, 2] - 3000 * angle / (2 * math.pi)).max() < 2
    assert np.abs(np.hypot(at[:, 0] + 5000, at[:, 1]) - 5000).max() < 1


def test_plane_of_other_slots() -> None:
    """The lower slot to the right, the higher one up, however they are named."""
    rules = replace(Rules().with_speed(50_000), free_circles=True)
    for first, second in ((0, 1), (1, 4), (2, 5)):
        end = [0] * 6
        end[first], end[second] = -2000, 2000
        plan = start([circle({second: 0, first: -2000}, end, False, 5000, rules)], rules)
        at = places(plan)[:, [first, second]] + [2000, 0]
        assert np.abs(np.hypot(at[:, 0], at[:, 1]) - 2000).max() < 1
        assert at[len(at) // 2].min() > 1000


def test_the_radius_runs_with_the_angle() -> None:
    """From 2000 at 0 degrees to 3000 at 180."""
    rules = replace(Rules().with_speed(50_000), free_circles=True)
    plan = start([circle({0: -2000, 1: 0}, way(-5000), False, 5000, rules)], rules)
    at = places(plan)[:, :2] + [2000, 0]
    angle = np.unwrap(np.arctan2(at[:, 1], at[:, 0]))
    assert np.abs(np.hypot(at[:, 0], at[:, 1]) - 2000 - 1000 * angle / math.pi).max() < 1.5


@pytest.mark.parametrize(
    ("centre", "end"),
    [
        ({0: 100}, way()),
        ({0: 100, 1: 0, 2: 0}, way()),
        ({0: 100, 6: 0}, way()),
        ({0: 0, 1: 0}, way(5)),
        ({0: 100, 1: 0}, way(100)),
        ({0: 100, 1: 0}, (1, 2)),
    ],
)
def test_no_circle(centre: dict[int, int], end: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match=r"cent(re|er)"):
        circle(centre, end, False, 1000, RULES)


@settings(max_examples=drawn(80), deadline=None, derandomize=True)
@given(st.integers(-60_000, 60_000), st.integers(-60_000, 60_000), st.floats(0.01, 2 * math.pi), st.booleans())
def test_random_arcs_stay_within_one_increment(x: int, y: int, angle: float, clockwise: bool) -> None:
    """From (x, y) around the origin to the grid point nearest to the end of the arc."""
    radius = math.hypot(x, y)
    if radius < 10:
        return
    at = math.atan2(y, x) + (-angle if clockwise else angle)
    end = round(radius * math.cos(at)), round(radius * math.sin(at))
    move = circle({0: -x, 1: -y}, way(end[0] - x, end[1] - y), clockwise, None, RULES)
    plan = start([move], RULES)
    way_there = places(plan)[:, :2] + [x, y]
    assert tuple(way_there[-1]) == end
    last = math.hypot(*end)
    turned = np.unwrap(np.arctan2(way_there[:, 1], way_there[:, 0]))
    total = turned[-1] - turned[0]
    part = (turned - turned[0]) / total if total else np.zeros(len(turned))
    assert np.abs(np.hypot(way_there[:, 0], way_there[:, 1]) - radius - (last - radius) * part).max() <= WITHIN
    assert max(plan.speed(k) for k in range(plan.ticks)) <= math.sqrt(4 * max(radius, last)) / 0.012 * (1 + 1e-9)
    # mirrored at the X axis, the other way round
    back = start([circle({0: -x, 1: y}, way(end[0] - x, y - end[1]), not clockwise, None, RULES)], RULES)
    assert back.ticks == plan.ticks
    assert np.abs(places(back)[:, :2] * [1, -1] - places(plan)[:, :2]).max() <= 1
