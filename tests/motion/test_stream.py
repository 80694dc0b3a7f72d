"""The stream as time goes on: what is still to be made, what a replaced motion keeps, and the record beside it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from motion.plans import Table, table

from isel_twin.motion import SetPointRun, StepRun, Stream, constant, line, path, stream, trapezoid
from isel_twin.motion.path import between
from tests.thorough import drawn

MS = 1_000_000
PERIOD = 4 * MS


def steps(n: int, start_ns: int = 0, hz: int = 1000) -> StepRun:
    """n steps of X of three axes."""
    return StepRun(line((n, 0, 0)), constant(abs(n), hz), start_ns)


def make(some: Stream, t_ns: int) -> tuple[list[int], list[list[int]]]:
    """Make all ticks up to t_ns, as whoever owns the clock does."""
    times: list[int] = []
    changes: list[list[int]] = []
    while True:
        t, delta = some.until(t_ns)
        assert len(t) == len(delta)
        more = len(t) > 0 and some.more_after(len(t))
        times += t.tolist()
        changes += delta.tolist()
        some.make(len(t))
        if not more:
            return times, changes


def test_nothing_is_made_where_nothing_is_shown() -> None:
    some = Stream(3)
    t_ns, delta = some.until(1 << 60)
    assert (t_ns.dtype, t_ns.shape, delta.shape) == (np.int64, (0,), (0, 3))
    assert (some.moving, some.lead_ns, some.more_after(0)) == (False, 0, False)
    assert not some.follow(None, 5)
    assert len(some.steps(1 << 60)) == 0


@pytest.mark.parametrize("chunk", [1, 3, 7, 1 << 15])
def test_ticks_come_once_and_in_order_however_they_are_expanded(chunk: int, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(stream, "CHUNK", chunk)
    some = Stream(3)
    assert some.follow(steps(20), 0)
    assert some.moving
    made = [make(some, t) for t in (0, 500_000, 3 * MS, 3 * MS, 12 * MS + 1, 1 << 60)]
    assert [t for times, _ in made for t in times] == [k * MS for k in range(1, 21)]
    assert [len(times) for times, _ in made] == [0, 0, 3, 0, 9, 8]
    assert some.steps(12 * MS).t_ns.tolist() == [k * MS for k in range(1, 13)]
    assert some.follow(None, 20 * MS)
    assert not some.moving
    assert some.steps(1 << 60).delta.tolist() == [[1, 0, 0]] * 20


def test_only_part_of_what_was_asked_for_may_be_made() -> None:
    some = Stream(3)
    some.follow(steps(10), 0)
    assert some.until(8 * MS)[0].tolist() == [k * MS for k in range(1, 9)]
    assert not some.more_after(10)
    assert not some.more_after(8), "the last two are expanded, too"
    some.make(3)
    assert some.until(6 * MS)[0].tolist() == [4 * MS, 5 * MS, 6 * MS]


def test_a_continued_run_keeps_what_was_made() -> None:
    """A stop at 40.5 ms in a ramped move of 1000: the ticks made stay made, the rest is that of the stop ramp."""
    path = line((1000, 0, 0))
    run = StepRun(path, trapezoid(1000, 10_000, 400, 100_000), 0)
    some = Stream(3)
    some.follow(run, 0)
    before, _ = make(some, 40_500_000)
    stopped = run.stopped(40_500_000)
    assert some.follow(stopped, 40_500_000)
    assert not some.follow(stopped, 40_500_000), "it has been seen"
    after, _ = make(some, 1 << 60)
    assert before + after == stopped.window(0, stopped.last)[0].tolist()
    assert some.steps(1 << 60).t_ns.tolist() == before + after
    assert len(some.steps(1 << 60).motions) == 1


def test_a_run_that_does_not_continue_cuts_the_one_before() -> None:
    """The same path, begun anew at 5.2 ms: five steps of the first, all of the second."""
    some = Stream(3)
    some.follow(steps(20), 0)
    make(some, 5_200_000)
    assert some.follow(steps(20, start_ns=5_200_000), 5_200_000)
    times, _ = make(some, 1 << 60)
    assert times == [5_200_000 + k * MS for k in range(1, 21)]
    assert some.steps(1 << 60).t_ns.tolist() == [k * MS for k in range(1, 6)] + times
    some.follow(None, 1 << 60)
    assert len(some.steps(1 << 60)) == 25


def test_a_run_that_vanishes_is_cut() -> None:
    some = Stream(3)
    some.follow(steps(20), 0)
    make(some, 7 * MS)
    some.follow(None, 7 * MS)
    assert some.until(1 << 60)[0].size == 0
    assert some.steps(1 << 60).t_ns.tolist() == [k * MS for k in range(1, 8)]


PLAN = table(*[(k, -k) for k in range(1, 21)])


def test_a_replanned_run_of_set_points_keeps_what_was_made() -> None:
    some = Stream(2)
    run = SetPointRun(PLAN, PERIOD, 100)
    some.follow(run, 100)
    assert some.lead_ns == PERIOD
    make(some, 100 + 5 * PERIOD)
    other = replace(run, plan=Table((*PLAN.rows[:5], (7, 7), (1, 1))))
    some.follow(other, 100 + 5 * PERIOD)
    times, changes = make(some, 1 << 60)
    assert times == [100 + 6 * PERIOD, 100 + 7 * PERIOD]
    assert changes == [[7, 7], [1, 1]]
    assert some.steps(1 << 60).delta.tolist() == [list(row) for row in other.plan.rows]
    assert some.steps(1 << 60).delta.dtype == np.int32


def test_a_resumed_plan_goes_on_where_it_was_left() -> None:
    some = Stream(2)
    run = SetPointRun(PLAN, PERIOD, 0)
    some.follow(run, 0)
    make(some, 3 * PERIOD + 1)
    some.follow(None, 3 * PERIOD + 1)
    assert some.lead_ns == 0
    some.follow(SetPointRun(PLAN, PERIOD, 10 * PERIOD, first=3), 10 * PERIOD)
    times, changes = make(some, 12 * PERIOD)
    assert times == [11 * PERIOD, 12 * PERIOD]
    assert changes == [[4, -4], [5, -5]]
    assert some.steps(12 * PERIOD).delta.tolist() == [list(row) for row in PLAN.rows[:5]]


@given(st.lists(st.tuples(st.integers(1, 90), st.sampled_from(["go on", "stop", "cut", "anew", "rest"])), max_size=12))
@settings(deadline=None, max_examples=drawn(100))
@example([(1, "anew"), (1, "go on"), (83, "stop")])
@example([(1, "anew"), (1, "stop"), (1, "stop")])
def test_the_record_is_what_was_made(deeds: list[tuple[int, str]]) -> None:
    """Whatever a controller does: the ticks that were handed out, and no others, are in the record."""
    some, now, motion = Stream(2), 0, None
    times: list[int] = []
    changes: list[list[int]] = []
    for wait, deed in deeds:
        now += wait * MS
        more_times, more_changes = make(some, now)
        times += more_times
        changes += more_changes
        if deed == "anew":
            motion = SetPointRun(PLAN, PERIOD, now) if wait % 2 else StepRun(line((50, -9)), constant(50, 700), now)
        elif deed == "rest" or motion is None:
            motion = None
        elif deed == "stop" and motion.end_ns > now:  # nobody stops what is over
            motion = motion.stopped(now)
        elif deed == "cut":
            motion = motion.cut(now)
        some.follow(motion, now)
    seen = some.steps(now)
    assert (seen.t_ns.tolist(), seen.delta.tolist()) == (times, changes)


def test_the_rate_is_that_of_the_ticks_around_the_present() -> None:
    """1000 Hz forth, 250 Hz back, nothing at rest."""
    some = Stream(3)
    assert some.rate_hz().tolist() == [0.0, 0.0, 0.0]
    some.follow(steps(100, hz=1000), 0)
    make(some, 50 * MS)
    assert some.rate_hz() == pytest.approx([1000.0, 0.0, 0.0])
    some.follow(steps(-40, 100 * MS, hz=250), 100 * MS)
    assert some.rate_hz().tolist() == [0.0, 0.0, 0.0]  # nothing of it is expanded yet
    make(some, 120 * MS)
    assert some.rate_hz() == pytest.approx([-250.0, 0.0, 0.0])
    some.follow(None, 400 * MS)
    assert some.rate_hz().tolist() == [0.0, 0.0, 0.0]


def test_the_rate_on_a_ramp_is_that_of_the_ramp() -> None:
    """f = f0 + a t, within what sixteen ticks on each side cover: 300 Hz and 100 Hz/ms."""
    some = Stream(3)
    run = StepRun(line((20_000, 0, 0)), trapezoid(20_000, 10_000, 300, 100_000), 0)
    some.follow(run, 0)
    for at_ms in (20, 50, 80):
        make(some, at_ms * MS)
        assert some.rate_hz()[0] == pytest.approx(300.0 + 100.0 * at_ms, rel=0.05)


def test_a_line_may_be_made_without_its_ticks() -> None:
    """Half of a line of 30 and 10 steps: as many ticks, and where they lead; the rest comes tick by tick."""
    some, run, wide = Stream(3), StepRun(line((30, -10, 0)), constant(30, 1000), 0), ([-99] * 3, [99] * 3)
    assert some.straight(5 * MS, *wide) is None, "nothing moves"
    some.follow(run, 0)
    assert some.straight(15 * MS, *wide) == (15 * MS, 15, (15, -5, 0))
    some.skip(15)
    assert some.rate_hz() == pytest.approx([1000.0, -1000.0 / 3.0, 0.0], rel=0.1)
    assert some.straight(15 * MS, *wide) == (15 * MS, 0, (0, 0, 0))
    times, changes = make(some, 1 << 60)
    assert times == [k * MS for k in range(16, 31)]
    assert np.sum(changes, axis=0).tolist() == [15, -5, 0]
    assert len(some.steps(1 << 60)) == 30
    some.follow(SetPointRun(table((1, 0, 0)), PERIOD, 30 * MS), 30 * MS)
    assert some.straight(1 << 60, *wide) is None, "what is led has no steps that could be left out"


@pytest.mark.parametrize(("dense", "small"), [(1000, 1 << 30), (0, 1 << 30), (1000, 0)])
def test_where_a_line_is_at_any_times(dense: int, small: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether the ticks between them are timed or counted, and whatever numbers their formula takes."""
    monkeypatch.setattr(stream, "DENSE", dense)
    monkeypatch.setattr(path, "SMALL", small)
    some, run = Stream(3), StepRun(line((300, -101, 0)), trapezoid(300, 5000, 300, 100_000), 7)
    some.follow(run, 0)
    some.skip(11)
    times_ns = np.arange(int(run.window(10, 11)[0][0]), run.end_ns + 20 * MS, 1_234_567)
    expected = [list(between(run.displacement_after(11), run.displacement(t))) for t in times_ns.tolist()]
    assert some.along(times_ns).tolist() == expected


@pytest.mark.parametrize(
    ("below", "above", "tick"),
    [
        ([-9] * 3, [9, 9, 9], 9),  # the leading axis makes a step a tick
        ([-9, -3, -9], [99] * 3, 8),  # 10 steps on 30 ticks fall at ticks 2, 5, 8, ..: decision motion/5
        ([-9, -1, -9], [2, 99, 99], 2),  # both at once
        ([-1] * 3, [99, 1, 1], 2),
    ],
)
def test_a_line_is_made_up_to_the_first_tick_that_takes_an_axis_so_far(below, above, tick) -> None:
    """And what is left ends where all of it does, wherever the first part has ended."""
    for first in (0, 4):
        some, run = Stream(3), StepRun(line((30, -10, 0)), trapezoid(30, 5000, 300, 100_000), 0)
        some.follow(run, 0)
        some.skip(first)
        ends = np.array([run.displacement_after(k) for k in range(first, 31)])
        far = np.flatnonzero(((ends - ends[0] <= below) | (ends - ends[0] >= above)).any(axis=1))[0]
        t_ns = run.window(0, 30)[0][first + far - 1]
        assert some.straight(1 << 60, below, above) == (t_ns, far, tuple(ends[far] - ends[0]))
        if first == 0:
            assert far == tick
