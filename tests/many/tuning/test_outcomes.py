"""What held and what lost says of the edge."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.many.tuning.outcomes import MISTAKEN, Thresholds

THOUGHT = Thresholds((5000.0, 200.0, 1000.0))
NONE = np.empty((0, 3))
SMALL = (1.0, 1.0, 1.0)  # far within all that is thought


def chance(place: tuple[float, float, float], held: object = NONE, lost: object = NONE) -> float:
    return float(THOUGHT.chance(np.array(place), np.asarray(held), np.asarray(lost)))


def test_before_any_trial_the_middle_of_one_threshold_holds_in_half_of_all_cases() -> None:
    assert chance(SMALL) == pytest.approx(1.0)
    for number, middle in enumerate(THOUGHT.middles):
        place = [*SMALL]
        place[number] = middle
        assert chance((place[0], place[1], place[2])) == pytest.approx(0.5, abs=0.01)
    assert chance(THOUGHT.middles) == pytest.approx(0.125, abs=0.005)
    assert chance((8000.0, 1.0, 1.0)) == 0.0  # 4.7 standard deviations beyond the middle


def test_what_held_takes_all_that_is_slower_with_it() -> None:
    """By Bayes: 1/8 of the weight is at or beyond the middles, and 3 % of the rest is believed all the same."""
    held = 0.125 / (0.125 + MISTAKEN * 0.875)
    assert chance(THOUGHT.middles, held=[THOUGHT.middles]) == pytest.approx(held, abs=0.01)
    assert chance((4800.0, 100.0, 500.0), held=[THOUGHT.middles]) > held
    assert chance((4800.0, 100.0, 1500.0), held=[THOUGHT.middles]) < 0.6, "a steeper start has not been tried"


def test_what_lost_is_the_fault_of_what_was_boldest() -> None:
    """A place that lost with a start alone beyond its middle says that the start was it, and nothing of the rest. By
    Bayes: 0.209 of the weight is beyond ln 1.5 / 0.5 standard deviations, of which 3 % is left."""
    lost = [(1.0, 1.0, 1500.0)]
    assert chance((1.0, 1.0, 1500.0), lost=lost) < MISTAKEN
    assert chance((5000.0, 200.0, 1.0), lost=lost) == pytest.approx(0.25, abs=0.01)
    left = 0.03 * 0.209
    assert chance((1.0, 1.0, 1000.0), lost=lost) == pytest.approx((0.291 + left) / (0.791 + left), abs=0.015)


def test_closed_forms_are_about_where_the_4030_fails_in_half_steps() -> None:
    """By hand: rotor, screw and 1.0 N m at rest are 760 Hz/ms, of which 0.3; 2 half steps, 113 Hz, 6 full steps."""
    axis = TwinSpec("4030", "ismif").fitted().axes[0]
    assert Thresholds.of(axis, 5133.0).middles == pytest.approx((5133.0, 228.0, 1360.0), rel=0.01)
