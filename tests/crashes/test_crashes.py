"""A few of the seeded crashes and near misses; `python -m tests.crashes` makes a thousand."""

from __future__ import annotations

import pytest

from .play import STEP_NS, kinematic, physical
from .world import crash, near_miss


@pytest.mark.parametrize("first", range(0, 60, 10))
def test_every_crash_is_told_at_its_tick_without_physics(first: int) -> None:
    seen = [kinematic(crash(seed)) for seed in range(first, first + 10)]
    assert [one for one in seen if not one.who or not one.holds(1.0)] == []


@pytest.mark.parametrize("first", range(0, 60, 20))
def test_every_crash_is_told_within_a_step_of_the_plant(first: int) -> None:
    seen = [physical(crash(seed)) for seed in range(first, first + 4)]
    assert [one for one in seen if not one.who or not one.holds(STEP_NS)] == []


def test_a_tenth_of_a_millimetre_is_no_crash() -> None:
    seen = [plant(near_miss(seed)) for seed in range(4) for plant in (kinematic, physical)]
    assert [one for one in seen if one.told is not None or one.who] == []
