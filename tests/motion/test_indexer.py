"""Moves of one axis to a place: their speed is changed on the way, the place and the acceleration are kept."""

from __future__ import annotations

import numpy as np

from isel_twin.motion.indexer import at_rest

PERIOD_NS = 2_000_000
PERIOD_S = PERIOD_NS / 1e9
ACCELERATION = 1000.0


def test_another_speed_on_the_way() -> None:
    chance = np.random.default_rng(1)
    for trial in range(60):
        plan = at_rest(1, PERIOD_NS, ACCELERATION, ("move", trial)).to(0, 0, 5000.0, float(chance.uniform(10, 800)))
        for tick in sorted(chance.integers(1, int(plan.ticks), 4)):
            if tick < plan.ticks:
                plan = plan.towards(0, int(tick), 5000.0, float(chance.uniform(5, 800)))
        steps = np.asarray(plan.deltas(0, plan.ticks))[:, 0]
        assert plan.displacement(plan.ticks)[0] == 5000
        assert steps.min() >= 0
        assert steps.max() <= 801.0 * PERIOD_S + 1
        change = np.abs(np.diff(np.concatenate([[0], steps, [0]])))
        assert change.max() <= ACCELERATION * PERIOD_S**2 + 1  # and one increment of rounding


def test_the_speed_that_is_asked_for_is_reached() -> None:
    plan = at_rest(1, PERIOD_NS, ACCELERATION, "move").to(0, 0, 50_000.0, 1000.0).towards(0, 900, 50_000.0, 250.0)
    assert np.asarray(plan.deltas(1400, 1900))[:, 0].mean() / PERIOD_S == 250.0
    plan = plan.towards(0, 1900, 50_000.0, 500.0)
    assert np.asarray(plan.deltas(2200, 2700))[:, 0].mean() / PERIOD_S == 500.0
