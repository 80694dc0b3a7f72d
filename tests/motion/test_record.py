"""The record: motions of both kinds, expanded to arrays, in pieces, and as far as they have happened."""

from __future__ import annotations

import sys

import numpy as np
import pytest
from conformance.closed_forms import times_ns
from motion.plans import table

from isel_twin.motion import SetPointRun, StepRun, Steps, constant, line, trapezoid

START = 7_000_000_000
PERIOD = 4_000_000


def straight(steps: tuple[int, ...], start_ns: int = START) -> StepRun:
    """A line at 10 kHz with ramps."""
    path = line(steps)
    return StepRun(path, trapezoid(path.ticks, 10_000, 400, 100_000), start_ns)


def square() -> Steps:
    """Four lines, a millisecond between them."""
    record, start = Steps(4), START
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
    assert len(record.motions) == 4


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


def test_motions_do_not_overlap_and_have_as_many_axes() -> None:
    record = square()
    with pytest.raises(ValueError, match="before the last one ends"):
        record.append(straight((5, 0, 0, 0), START))
    with pytest.raises(ValueError, match="3 axes in a record of 4"):
        record.append(straight((5, 0, 0), 1 << 60))


@pytest.mark.parametrize("axes", range(1, 9))
def test_nothing_recorded(axes: int) -> None:
    empty = Steps(axes)
    assert (len(empty), empty.t_ns.shape, empty.delta.shape) == (0, (0,), (0, axes))
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

    record, start = Steps(4), 0
    for k in range(720):
        run = StepRun(line((50_000, k, 0, 0)), constant(50_000, 10_000), start)
        record.append(run)
        start = run.end_ns
    assert start == 3600 * 10**9
    assert sum(t.size for t, _ in record.chunks()) == 36_000_000
    assert size(record.motions, set()) < 1_000_000


@pytest.mark.parametrize("size", [1, 2, 1000])
def test_steps_and_set_points_in_one_record(size: int) -> None:
    """Six axes; what the wide ones need, all get: int32."""
    rows = [(0, 0, 0, 0, 40_000, -1), (1, 0, 0, 0, -40_000, 0), (0, 0, 0, 0, 0, 1 << 30)]
    first = StepRun(line((3, 0, 0, 0, 0, -1)), constant(3, 1000), START)
    second = SetPointRun(table(*rows), PERIOD, first.end_ns)
    third = StepRun(line((0, 2, 0, 0, 0, 0)), constant(2, 500), second.end_ns)
    record = Steps(6, [first])
    assert record.dtype == record.delta.dtype == np.int8
    record.append(second)
    record.append(third)
    assert record.dtype == record.delta.dtype == np.int32
    end = START + 3_000_000
    assert record.t_ns.tolist() == [
        *(START + k * 1_000_000 for k in (1, 2, 3)),
        *(end + k * PERIOD for k in (1, 2, 3)),
        *(end + 3 * PERIOD + k * 2_000_000 for k in (1, 2)),
    ]
    steps = [[1, 0, 0, 0, 0, 0], [1, 0, 0, 0, 0, -1], [1, 0, 0, 0, 0, 0]]
    assert record.delta.tolist() == [*steps, *map(list, rows), *[[0, 1, 0, 0, 0, 0]] * 2]
    pieces = list(record.chunks(size))
    assert np.concatenate([delta for _, delta in pieces]).tolist() == record.delta.tolist()
    assert {delta.dtype for _, delta in pieces} == {np.dtype(np.int8), np.dtype(np.int32)}
    for t in (START, end, end + PERIOD, end + PERIOD - 1, end + 3 * PERIOD, 1 << 60):
        seen = record.until(t)
        assert seen.t_ns.tolist() == [at for at in record.t_ns.tolist() if at <= t]
        assert seen.delta.tolist() == record.delta[: len(seen)].tolist()
        assert seen.axes == 6


def test_the_last_motion_is_replaced_by_its_cut() -> None:
    run = SetPointRun(table([5], [5], [5]), PERIOD, START)
    record = Steps(1, [run])
    record.replace_last(run.cut(START + 2 * PERIOD))
    assert record.delta.tolist() == [[5], [5]]
    record.append(StepRun(line((1,)), constant(1, 1000), START + 2 * PERIOD))
    assert record.delta.tolist() == [[5], [5], [1]]


@pytest.mark.parametrize("made", [0, 1, 9, 10, 11, 16, 17])
def test_the_way_since_a_number_of_ticks_is_the_sum_of_the_changes_after_it(made: int) -> None:
    steps = Steps(2, [StepRun(line((10, -4)), constant(10, 1000), 0), StepRun(line((-3, 7)), constant(7, 1000), 10**9)])
    assert steps.since(made) == tuple(steps.delta[made:].sum(axis=0, dtype=int).tolist())
    steps.forget()
    assert steps.since(12) == tuple(steps.delta[2:].sum(axis=0, dtype=int).tolist()), "dropped ones count"
