"""Several plans on one grid, added."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.motion.indexer import Indexer, at_rest
from isel_twin.motion.together import Part, Together

PERIOD_NS = 4_000_000


def plan(axis: int, way: float, speed: float) -> Indexer:
    return at_rest(2, PERIOD_NS, 50_000.0, axis).to(axis, 0, way, speed)


X, Y = plan(0, 1_000.0, 5_000.0), plan(1, -700.0, 2_000.0)


def alone(one: Indexer, first: int = 0) -> np.ndarray:
    return one.deltas(first, one.ticks)


@pytest.mark.parametrize(("of_x", "of_y"), [(0, 0), (0, 5), (-7, 3), (-7, -2), (4, -11)])
def test_the_sum_is_that_of_the_parts_where_they_lie(of_x: int, of_y: int) -> None:
    both = Together((Part(X, of_x), Part(Y, of_y)), "both")
    wanted = np.zeros((both.ticks, 2), np.int32)
    for one, offset in ((X, of_x), (Y, of_y)):
        ticks = alone(one, max(0, -offset))
        wanted[max(offset, 0) : max(offset, 0) + len(ticks)] += ticks
    assert both.ticks == max(X.ticks + of_x, Y.ticks + of_y)
    assert (both.deltas(0, both.ticks) == wanted).all()
    for first, last in ((0, 1), (3, 9), (8, both.ticks), (5, 5)):
        assert (both.deltas(first, last) == wanted[first:last]).all()
    for k in (0, 1, 7, both.ticks):
        assert both.displacement(k) == tuple(wanted[:k].sum(axis=0))


def test_a_part_that_ended_before_the_sum_began_counts_for_nothing() -> None:
    both = Together((Part(X, -X.ticks - 3), Part(Y, 2)), "both")
    assert both.ticks == Y.ticks + 2
    assert both.displacement(both.ticks) == (0, -700)


def test_stopping_brakes_each_part_from_there_on() -> None:
    both = Together((Part(X, 0), Part(Y, 5)), "both")
    k = 20
    stopped = both.stopped(k)
    assert (stopped.deltas(0, k) == both.deltas(0, k)).all()
    rest = np.abs(stopped.deltas(k, stopped.ticks))
    assert rest[-1].max() <= 1
    assert 0 < stopped.displacement(stopped.ticks)[0] < 1_000
    assert both.stopped(3).displacement(both.stopped(3).ticks)[1] == 0, "Y has not begun"


def test_ticks_that_there_are_not() -> None:
    both = Together((Part(X, 0),), "one")
    with pytest.raises(IndexError, match="set points 0"):
        both.deltas(0, both.ticks + 1)
