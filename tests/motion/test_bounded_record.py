"""A record that keeps the last motions only: bounded, and otherwise the same."""

from __future__ import annotations

import tracemalloc

import pytest

from isel_twin.motion import StepRun, Steps, Stream, constant, line

GAP_NS = 1_000_000


def motion(number: int, ticks: int = 10) -> StepRun:
    """Ten steps at 1 kHz, X to and fro."""
    sign = -1 if number % 2 else 1
    return StepRun(line((sign * ticks, 0, 0)), constant(ticks, 1000), number * (ticks * 1_000_000 + GAP_NS))


def test_the_last_motions_are_kept_and_the_others_counted() -> None:
    record = Steps(3, (motion(number) for number in range(7)), keep=3)
    assert record.motions == tuple(motion(number) for number in (4, 5, 6))
    assert record.dropped == 4
    assert len(record) == 30
    assert record.t_ns[0] == motion(4).window(0, 1)[0][0]
    assert record.delta[:, 0].tolist() == [1] * 10 + [-1] * 10 + [1] * 10


def test_a_record_that_keeps_everything_drops_nothing() -> None:
    record = Steps(3, (motion(number) for number in range(7)))
    assert (len(record.motions), record.dropped) == (7, 0)
    assert Steps(3, (motion(number) for number in range(7)), keep=7).dropped == 0


def test_what_has_been_made_by_a_time_is_cut_in_a_bounded_record_too() -> None:
    record = Steps(3, (motion(number) for number in range(7)), keep=3)
    now_ns = motion(6).start_ns + 4_000_000
    made = record.until(now_ns)
    assert (len(made), made.dropped, made.made) == (24, 4, 64)
    assert (len(record), record.made) == (30, 70)
    record.replace_last(motion(6).cut(now_ns))
    assert len(record) == 24


def test_what_is_forgotten_is_counted_and_the_last_ticks_stay() -> None:
    record = Steps(3, (motion(number) for number in range(7)))
    record.forget()
    assert (record.motions, len(record), record.made, record.dropped) == ((motion(6),), 10, 70, 6)
    stopped = motion(7).cut(motion(7).start_ns)
    record.append(stopped)
    record.forget()
    assert record.motions == (motion(6), stopped)


def test_at_least_the_motion_being_made_is_kept() -> None:
    with pytest.raises(ValueError, match="at least one motion, not 0"):
        Stream(3, keep=0)


def make(stream: Stream, number: int) -> None:
    """A motion from its start to its end."""
    now = motion(number)
    stream.follow(now, now.start_ns)
    stream.make(len(stream.until(now.end_ns)[0]))
    stream.follow(None, now.end_ns)


def test_a_bounded_stream_makes_the_same_ticks() -> None:
    all_of_it, last = Stream(3), Stream(3, keep=2)
    for number in range(10):
        make(all_of_it, number)
        make(last, number)
    end_ns = motion(9).end_ns
    assert last.steps(end_ns).motions == all_of_it.steps(end_ns).motions[-2:]
    assert last.steps(end_ns).dropped == 8


def test_memory_of_a_bounded_stream_does_not_grow() -> None:
    stream, keep = Stream(3, keep=100), 100
    for number in range(2 * keep):
        make(stream, number)
    tracemalloc.start()
    try:
        before, _ = tracemalloc.get_traced_memory()
        for number in range(2 * keep, 40 * keep):
            make(stream, number)
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert grown < 200_000, "the motions kept are new ones, so at most as much as they need"
