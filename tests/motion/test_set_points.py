"""Set-point runs against the table of their plan: windows, stops, cuts, resumed plans, and what continues what."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion.plans import Table, table

from isel_twin.motion import SetPointRun
from tests.thorough import drawn

START = 7_000_000_001
PERIOD = 4_000_000

rows = st.integers(1, 8).flatmap(
    lambda axes: st.lists(st.tuples(*[st.integers(-(1 << 31), (1 << 31) - 1)] * axes), min_size=1, max_size=40)
)


def expanded(run: SetPointRun, plan: Table) -> list[tuple[int, tuple[int, ...]]]:
    """All ticks of a run one by one, as the definition has them."""
    return [
        (run.start_ns + (k - run.first) * run.period_ns, plan.rows[k - 1]) for k in range(run.first + 1, run.last + 1)
    ]


def ticks_of(run: SetPointRun, k0: int, k1: int) -> list[tuple[int, tuple[int, ...]]]:
    t_ns, delta = run.window(k0, k1)
    assert (t_ns.dtype, delta.dtype, delta.shape) == (np.int64, np.int32, (k1 - k0, run.axes))
    return list(zip(t_ns.tolist(), map(tuple, delta.tolist()), strict=True))


@given(rows, st.integers(1, 10**10), st.data())
@settings(deadline=None, max_examples=drawn(100))
def test_any_window_is_the_part_of_the_plan(
    plan_rows: list[tuple[int, ...]], period_ns: int, data: st.DataObject
) -> None:
    plan = Table(tuple(plan_rows))
    first = data.draw(st.integers(0, plan.ticks))
    end = data.draw(st.one_of(st.none(), st.integers(first, plan.ticks)))
    run = SetPointRun(plan, period_ns, START, first, end)
    whole = expanded(run, plan)
    k0 = data.draw(st.integers(first, run.last))
    k1 = data.draw(st.integers(k0, run.last))
    assert ticks_of(run, k0, k1) == whole[k0 - first : k1 - first]
    assert (run.axes, run.lead_ns, run.first) == (plan.axes, period_ns, first)
    assert run.end_ns == (whole[-1][0] if whole else START)
    t = data.draw(st.integers(START - 5, START + 45 * period_ns))
    made = [delta for at, delta in whole if at <= t]
    assert run.count(t) == first + len(made)
    assert run.displacement(t) == tuple(sum(delta[axis] for delta in made) for axis in range(plan.axes))


def test_a_tick_falls_on_its_nanosecond() -> None:
    run = SetPointRun(table([8], [6], [0]), PERIOD, START)
    assert ticks_of(run, 0, 3) == [(START + PERIOD, (8,)), (START + 2 * PERIOD, (6,)), (START + 3 * PERIOD, (0,))]
    assert [run.count(START + 2 * PERIOD + d) for d in (-1, 0, 1)] == [1, 2, 2]
    assert run.count(0) == 0
    assert run.count(1 << 62) == 3
    assert [run.next_tick(START + d) for d in (-3 * PERIOD, 0, 1, PERIOD, PERIOD + 1)] == [0, 0, 1, 1, 2]


FAST = table([1, 0], [3, -2], [5, -4], [5, -4], [5, -4], [3, -2], [1, 0])


def test_a_stop_keeps_what_was_made_and_brakes_from_there() -> None:
    """After the third tick the speeds are 5 and -4: 4 3 2 1 0 and -3 -2 -1 0 0 follow."""
    run = SetPointRun(FAST, PERIOD, START)
    stopped = run.stopped(START + 4 * PERIOD - 1)
    assert [delta for _, delta in ticks_of(stopped, 0, 3)] == list(FAST.rows[:3])
    assert [delta for _, delta in ticks_of(stopped, 3, stopped.last)] == [(4, -3), (3, -2), (2, -1), (1, 0), (0, 0)]
    assert stopped.end_ns == START + 8 * PERIOD
    assert run.stopped(START).last == 0
    cut = run.cut(START + 5 * PERIOD)
    assert cut.stopped(START + 3 * PERIOD) == run.stopped(START + 3 * PERIOD), "a stop leaves nothing of a later end"
    assert cut.stopped(START + 5 * PERIOD) == cut.stopped(START + 9 * PERIOD) == cut, "it is over already"
    assert run.stopped(run.end_ns) == run.stopped(run.end_ns + 9 * PERIOD) == run, "nothing is added to the past"


@pytest.mark.parametrize("made", range(8))
def test_a_cut_ends_it_at_once(made: int) -> None:
    run = SetPointRun(FAST, PERIOD, START)
    for t in (START + made * PERIOD, START + (made + 1) * PERIOD - 1):
        cut = run.cut(t)
        assert (cut.first, cut.last, cut.end_ns) == (0, made, START + made * PERIOD)
        assert ticks_of(cut, 0, made) == ticks_of(run, 0, made)
        assert cut.count(1 << 62) == made
        assert cut.displacement(1 << 62) == FAST.displacement(made)
        assert cut.cut(START + PERIOD).last == min(made, 1)
        with pytest.raises(IndexError, match=f"from 0 to {made}"):
            cut.window(0, made + 1)


def test_a_plan_is_resumed_where_it_was_left() -> None:
    run = SetPointRun(FAST, PERIOD, START)
    left = run.cut(START + 3 * PERIOD)
    resumed = SetPointRun(FAST, PERIOD, START + 10 * PERIOD, first=left.last)
    assert resumed.last == 7
    assert ticks_of(resumed, 3, 5) == [(START + 11 * PERIOD, (5, -4)), (START + 12 * PERIOD, (5, -4))]
    assert resumed.displacement(START + 12 * PERIOD) == (10, -8)
    there = [sum(n) for n in zip(left.displacement(1 << 62), resumed.displacement(1 << 62), strict=True)]
    assert tuple(there) == FAST.displacement(7)
    with pytest.raises(IndexError, match="from 3 to 7"):
        resumed.window(2, 4)
    again = resumed.stopped(START + 11 * PERIOD + 1)
    assert [delta for _, delta in ticks_of(again, 3, again.last)] == [
        (5, -4),
        (4, -3),
        (3, -2),
        (2, -1),
        (1, 0),
        (0, 0),
    ]


def test_what_continues_a_run_has_at_most_another_future() -> None:
    run = SetPointRun(FAST, PERIOD, START)
    t = START + 3 * PERIOD
    replanned = replace(run, plan=table(*FAST.rows[:3], [2, -2], [0, 0]))
    for other in (run, run.stopped(t), run.cut(t), replanned, replanned.cut(t)):
        assert other.continues(run)
        assert run.continues(other)
    for another in (
        replace(run, start_ns=START + 1),
        replace(run, first=1),
        replace(run, period_ns=PERIOD + 1),
        replace(run, plan=table(*FAST.rows, identity="another")),
    ):
        assert not another.continues(run)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((FAST, 0, 0), "period of set points must be positive, got 0"),
        ((FAST, PERIOD, 0, 8), "set points 8..7 of a plan of 7"),
        ((FAST, PERIOD, 0, 3, 2), "set points 3..2"),
        ((FAST, PERIOD, 0, 0, 8), "set points 0..8"),
        ((FAST, PERIOD, 0, -1), "set points -1..7"),
    ],
)
def test_what_is_no_run(arguments: tuple, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        SetPointRun(*arguments)


def test_runs_are_values() -> None:
    assert SetPointRun(FAST, PERIOD, START) == SetPointRun(table(*FAST.rows), PERIOD, START)
    assert hash(SetPointRun(FAST, PERIOD, START)) == hash(SetPointRun(FAST, PERIOD, START))
    assert SetPointRun(FAST, PERIOD, START) != SetPointRun(FAST, PERIOD, START, 1)
