"""Step runs: what has been stepped by when, stops, resumed motions, and what continues what."""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np
import pytest
from conformance.closed_forms import times_ns
from hypothesis import given, settings
from hypothesis import strategies as st

from isel_twin.motion import StepRun, Steps, circle, constant, line, trapezoid
from tests.thorough import drawn

START = 7_000_000_000


def straight(steps: tuple[int, ...], start_ns: int = START) -> StepRun:
    """A line at 10 kHz with ramps."""
    path = line(steps)
    return StepRun(path, trapezoid(path.ticks, 10_000, 400, 100_000), start_ns)


def total(run: StepRun) -> list[int]:
    """Sum of the stream of a run."""
    return run.window(run.first, run.last)[1].sum(axis=0, dtype=int).tolist()


def test_a_run_is_a_path_in_time() -> None:
    run = straight((800, -2000, 3, 0))
    t_ns, delta = run.window(0, 2000)
    assert t_ns.tolist() == [START + t for t in times_ns(2000, 10_000, 400, 100_000)]
    assert delta[:, 1].tolist() == [-1] * 2000
    assert (run.last, run.end_ns) == (2000, t_ns[-1])
    assert (t_ns.dtype, delta.dtype, delta.shape) == (np.int64, np.int8, (2000, 4))
    assert (run.axes, run.lead_ns) == (4, 0)


def test_displacement_counts_the_ticks_made() -> None:
    run = straight((800, -2000, 3, 0))
    t_ns, delta = run.window(0, 2000)
    made = np.cumsum(delta.astype(int), axis=0)
    for tick in (1, 2, 777, 2000):
        t = int(t_ns[tick - 1])
        assert run.count(t) == tick
        assert run.displacement(t) == tuple(made[tick - 1])
        assert run.count(t - 1) == tick - 1
    assert run.displacement(START) == (0, 0, 0, 0)
    assert run.displacement(10**12) == (800, -2000, 3, 0)


steps = st.tuples(*[st.integers(-3000, 3000)] * 4).filter(any)


@given(steps, st.lists(st.floats(0, 1), min_size=1, max_size=4))
@settings(deadline=None, max_examples=drawn(60))
def test_stopped_and_resumed_moves_make_exactly_the_commanded_steps(n: tuple[int, ...], stops: list[float]) -> None:
    path, first, start = line(n), 0, START
    record = Steps(4)
    for part in stops:
        planned = StepRun(path, trapezoid(path.ticks - first, 10_000, 400, 100_000), start, first)
        record.append(planned)
        t = planned.start_ns + int(part * (planned.end_ns - planned.start_ns))
        stopped = planned.stopped(t)
        record.replace_last(stopped)
        made = planned.count(t)
        before = planned.window(first, made)
        assert [a.tolist() for a in stopped.window(first, made)] == [a.tolist() for a in before]
        first, start = stopped.last, stopped.end_ns + 1_000_000
    record.append(StepRun(path, trapezoid(path.ticks - first, 10_000, 400, 100_000), start, first))
    assert record.delta.sum(axis=0, dtype=int).tolist() == list(n)
    assert record.delta.tolist() == path.deltas(0, path.ticks).tolist()
    assert (np.diff(record.t_ns) >= 0).all()


@pytest.mark.parametrize("signs", list(itertools.product((-1, 1), repeat=4)))
def test_sum_of_a_stream_for_every_sign_and_set_of_axes(signs: tuple[int, ...]) -> None:
    for used in itertools.product((0, 1), repeat=4):
        x, y, z, a = (s * u * m for s, u, m in zip(signs, used, (90, 31, 64, 90), strict=True))
        assert total(straight((x, y, z, a))) == [x, y, z, a]


def test_a_limit_switch_ends_the_stream_at_once() -> None:
    run = straight((2000, 0, 0, 0))
    t_ns, _ = run.window(0, 2000)
    edge = int(t_ns[700])
    assert run.cut(edge).last == 701
    assert run.cut(edge - 1).last == 700
    assert run.cut(edge).end_ns == edge


def test_a_run_that_begins_within_its_path() -> None:
    path = circle(3200, -200, 400, 0, -1, 1, False)
    run = StepRun(path, constant(1200, 1000), START, first=2000)
    t_ns, delta = run.window(2500, 2503)
    assert t_ns.tolist() == [START + k * 1_000_000 for k in (501, 502, 503)]
    assert delta.tolist() == path.deltas(2500, 2503).tolist()
    assert run.displacement(10**12) == tuple(-n for n in path.displacement(2000))
    assert (run.count(0), run.last) == (2000, 3200)


def test_a_law_must_fit_its_path() -> None:
    with pytest.raises(ValueError, match="path of 10"):
        StepRun(line((10, 0, 0, 0)), constant(11, 1000), 0)
    with pytest.raises(ValueError, match="path of 10"):
        StepRun(line((10, 0, 0, 0)), constant(5, 1000), 0, first=6)


def test_runs_are_values() -> None:
    assert straight((1, 2, 3, 4)) == straight((1, 2, 3, 4))
    assert hash(straight((1, 2, 3, 4))) == hash(straight((1, 2, 3, 4)))
    assert straight((1, 2, 3, 4)) != straight((1, 2, 3, 5))


def test_what_continues_a_run_has_at_most_another_future() -> None:
    run = straight((800, -2000, 3, 0))
    t = START + 100_000_000
    again = StepRun(line((800, -2000, 3, 0)), trapezoid(2000, 5_000, 400, 100_000), START)
    for other in (run, run.stopped(t), run.cut(t), run.stopped(t).cut(t + 1), again):
        assert other.continues(run)
        assert run.continues(other)
    for another in (
        replace(run, start_ns=START + 1),
        StepRun(run.path, constant(1999, 1000), START, first=1),
        straight((800, -2000, 4, 0)),
        straight((800, -2000, 3)),
    ):
        assert not another.continues(run)
        assert not run.continues(another)


@pytest.mark.parametrize("axes", range(1, 9))
def test_any_number_of_axes(axes: int) -> None:
    n = tuple((-1) ** axis * (500 - 60 * axis) for axis in range(axes))
    run = straight(n)
    t_ns, delta = run.window(0, 500)
    assert delta.shape == (500, axes)
    assert total(run) == list(n)
    assert run.displacement(int(t_ns[-1])) == n
