"""Servo axes in the whole machine: how far they lag, what pushes them off, and what it takes to go on.

Expected: a cascade without feed-forward lags by v / Kv; one increment is 1 um (5000 a revolution of 5 mm).
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.plant import Threshold

from .conftest import MS, NONE, Bench

PERIOD = 4 * MS
KV = 40.0
LIMIT = 4000


def way(seconds: float, top: float, per_s2: float = 500_000.0) -> NDArray[np.int32]:
    """int32 [n]: set points every 4 ms, from rest up to a speed in increments/s, which is kept."""
    t = PERIOD * 1e-9 * np.arange(round(seconds / (PERIOD * 1e-9)) + 1)
    rise = top / per_s2
    made = np.where(t < rise, 0.5 * per_s2 * t * t, top * (t - 0.5 * rise))
    return np.diff(np.round(made)).astype(np.int32)


class Line:
    """A machine whose X axis is led along set points."""

    def __init__(self, bench: Callable[..., Bench], overrides=None, thresholds=(), **others) -> None:
        self.bench = bench(overrides, machine="4030-servo", thresholds=thresholds, **others)
        self.plant = self.bench.plant

    def go(self, changes: NDArray[np.int32]) -> None:
        """Make these set points one after the other; a threshold may stop it early."""
        for change in changes:
            delta = np.zeros((1, 4), dtype=np.int32)
            delta[0, 0] = change
            t = self.plant.time_ns + PERIOD
            if self.plant.advance(t, np.array([t]), delta, PERIOD) < t:
                return

    def rest(self, ms: float) -> None:
        until = self.plant.time_ns + round(ms * MS)
        self.plant.advance(until, *NONE)


@pytest.mark.parametrize("speed", [10_000, 20_000, -50_000])
def test_the_lag_at_constant_speed_is_speed_over_gain(bench, speed):
    line = Line(bench)
    line.go(np.sign(speed) * way(0.6, abs(speed)))
    lags = []
    for change in way(0.8, abs(speed))[150:]:
        line.go(np.array([np.sign(speed) * change]))
        lags.append(line.plant.lag[0])
    assert np.mean(lags) == pytest.approx(speed / KV, rel=0.02)
    assert not line.plant.fault.any()


def test_feed_forward_takes_the_lag_away(bench):
    line = Line(bench, {"axes.all.servo.feed_forward": 1.0})
    line.go(way(0.8, 20_000))
    assert abs(line.plant.lag[0]) < 10.0


def test_after_the_end_it_is_where_it_was_told_and_at_rest(bench):
    line = Line(bench)
    line.go(way(0.8, 20_000))
    line.rest(1500)
    assert abs(line.plant.lag[0]) <= 1.0
    assert line.plant.in_position.all()
    assert line.plant.at_rest


def test_a_push_beyond_the_motors_torque_is_a_fault(bench):
    """G-62 of the card's acceptance tests: 2500 N against the motion at 20 mm/s."""
    line = Line(bench, thresholds=[Threshold(0, "fault")])
    line.go(way(1.0, 20_000))
    began, plant = line.plant.time_ns, line.plant
    plant.apply_force(0, -2500.0)
    line.go(way(1.2, 20_000)[250:])
    assert plant.trips().all()
    assert 20 * MS <= plant.time_ns - began <= 60 * MS
    assert plant.fault.tolist() == [True, False, False, False]
    assert plant.powered.tolist() == [False, True, True, True]
    assert abs(plant.lag[0]) == pytest.approx(LIMIT, abs=20)
    assert plant._states["current_a_a"][0] == 0.0
    line.rest(1)
    assert plant.take_margin()[0] == 0.0


def test_a_push_that_the_motor_holds_is_none(bench):
    """G-63: 500 N, lag below 800 increments."""
    line = Line(bench, thresholds=[Threshold(0, "fault")])
    line.go(way(1.0, 20_000))
    line.plant.apply_force(0, -500.0)
    most = 0.0
    for change in way(1.6, 20_000)[250:]:
        line.go(np.array([change]))
        most = max(most, abs(line.plant.lag[0]))
    assert 500.0 + 50.0 < most < 800.0
    assert not line.plant.fault.any()
