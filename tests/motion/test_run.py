"""Runs and their record: what has been stepped by when, stops, resumed motions, and the arrays made of it."""

from __future__ import annotations

import itertools
import sys

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion.oracle import times_ns

from isel_twin.motion import StepRun, Steps, circle, constant, line, trapezoid

START = 7_000_000_000


def straight(steps: tuple[int, int, int, int], start_ns: int = START) -> StepRun:
    """A line at 10 kHz with ramps."""
    path = line(steps)
    return StepRun(path, trapezoid(path.ticks, 10_000, 400, 100_000), start_ns)


def total(run: StepRun) -> list[int]:
    """Sum of the stream of a run."""
    return run.window(run.first, run.last)[1].sum(axis=0, dtype=int).tolist()


def test_a_run_is_a_path_in_time() -> None:
    run = straight((800, -2000, 3, 0))
    t_ns, code = run.window(0, 2000)
    assert t_ns.tolist() == [START + t for t in times_ns(2000, 10_000, 400, 100_000)]
    assert code[:, 1].tolist() == [-1] * 2000
    assert (run.last, run.end_ns) == (2000, t_ns[-1])
    assert (t_ns.dtype, code.dtype) == (np.int64, np.uint8)


def test_displacement_counts_the_ticks_made() -> None:
    run = straight((800, -2000, 3, 0))
    t_ns, code = run.window(0, 2000)
    made = np.cumsum(code.astype(int), axis=0)
    for tick in (1, 2, 777, 2000):
        t = int(t_ns[tick - 1])
        assert run.count(t) == tick
        assert run.displacement(t) == tuple(made[tick - 1])
        assert run.count(t - 1) == tick - 1
    assert run.displacement(START) == (0, 0, 0, 0)
    assert run.displacement(10**12) == (800, -2000, 3, 0)


steps = st.tuples(*[st.integers(-3000, 3000)] * 4).filter(any)


@given(steps, st.lists(st.floats(0, 1), min_size=1, max_size=4))
@settings(deadline=None, max_examples=60)
def test_stopped_and_resumed_moves_make_exactly_the_commanded_steps(n: tuple[int, ...], stops: list[float]) -> None:
    path, first, start = line(n), 0, START
    record = Steps()
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
    t_ns, code = run.window(2500, 2503)
    assert t_ns.tolist() == [START + k * 1_000_000 for k in (501, 502, 503)]
    assert code.tolist() == path.deltas(2500, 2503).tolist()
    assert run.displacement(10**12) == tuple(-n for n in path.displacement(2000))
    assert (run.count(0), run.last) == (2000, 3200)


def test_a_profile_must_fit_its_path() -> None:
    with pytest.raises(ValueError, match="path of 10"):
        StepRun(line((10, 0, 0, 0)), constant(11, 1000), 0)
    with pytest.raises(ValueError, match="path of 10"):
        StepRun(line((10, 0, 0, 0)), constant(5, 1000), 0, first=6)


def test_runs_are_values() -> None:
    assert straight((1, 2, 3, 4)) == straight((1, 2, 3, 4))
    assert hash(straight((1, 2, 3, 4))) == hash(straight((1, 2, 3, 4)))
    assert straight((1, 2, 3, 4)) != straight((1, 2, 3, 5))


# --- record ----------------------------------------------------------------------------------------------------------


def square() -> Steps:
    """Four lines, a millisecond between them."""
    record, start = Steps(), START
    for x, y in ((500, 0), (0, 400), (-500, 0), (0, -400)):
        run = straight((x, y, 0, 0), start)
        record.append(run)
        start = run.end_ns + 1_000_000
    return record


def test_record_of_a_square() -> None:
    record = square()
    assert len(record) == 1800
    assert (record.t_ns.dtype, record.t_ns.shape) == (np.int64, (1800,))
    assert (record.delta.dtype, record.delta.shape) == (np.int8, (1800, 4))
    assert (np.diff(record.t_ns) > 0).all()
    assert np.abs(record.delta).sum(axis=0).tolist() == [1000, 800, 0, 0]
    assert record.delta.sum(axis=0).tolist() == [0, 0, 0, 0]
    assert record.t_ns[0] == START + times_ns(500, 10_000, 400, 100_000)[0]
    assert len(record.runs) == 4


@pytest.mark.parametrize("size", [1, 7, 500, 10_000])
def test_chunks_are_the_stream_in_pieces(size: int) -> None:
    record = square()
    pieces = list(record.chunks(size))
    assert max(len(t) for t, _ in pieces) <= size
    assert np.concatenate([t for t, _ in pieces]).tolist() == record.t_ns.tolist()
    assert np.concatenate([d for _, d in pieces]).tolist() == record.delta.tolist()


def test_only_what_has_happened() -> None:
    record = square()
    times = record.t_ns
    for t in (START, int(times[0]), int(times[499]) + 5, int(times[900]), int(times[900]) - 1, int(times[-1])):
        seen = record.until(t)
        assert seen.t_ns.tolist() == times[times <= t].tolist()
        assert seen.delta.tolist() == record.delta[: len(seen)].tolist()
    assert len(record.until(0)) == 0
    assert len(record) == 1800


def test_runs_do_not_overlap() -> None:
    record = square()
    with pytest.raises(ValueError, match="before the last one ends"):
        record.append(straight((5, 0, 0, 0), START))


def test_nothing_recorded() -> None:
    empty = Steps()
    assert (len(empty), empty.t_ns.shape, empty.delta.shape) == (0, (0,), (0, 4))
    assert list(empty.chunks()) == []
    assert len(empty.until(5)) == 0


def test_an_hour_of_motion_needs_little_memory() -> None:
    """36 million ticks in 720 runs of 5 s at 10 kHz, kept and read through once: below 1 MB stays."""

    def size(thing: object, seen: set[int]) -> int:
        if id(thing) in seen:
            return 0
        seen.add(id(thing))
        names = getattr(type(thing), "__slots__", ())
        parts = [getattr(thing, name) for name in names] if names else list(thing) if isinstance(thing, tuple) else []
        return sys.getsizeof(thing) + sum(size(part, seen) for part in parts)

    record, start = Steps(), 0
    for k in range(720):
        run = StepRun(line((50_000, k, 0, 0)), constant(50_000, 10_000), start)
        record.append(run)
        start = run.end_ns
    assert start == 3600 * 10**9
    assert sum(t.size for t, _ in record.packed()) == 36_000_000
    assert size(record.runs, set()) < 1_000_000
