"""What the 15-pin socket carries: phase patterns, clock and direction, of a short stream written out by hand."""

from __future__ import annotations

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.firmware.ismif.signals import clock_and_direction, phase_patterns

X, Y, REST = (1, 0, 0, 0), (0, -1, 0, 0), (0, 0, 0, 0)


def stream(*ticks: tuple[int, ...]) -> np.ndarray:
    return np.array(ticks, dtype=np.int8).reshape(-1, 4)


def test_one_turn_of_the_field() -> None:
    """Field angles 45, 90 .. 360 degrees: cosine in winding A, sine in B, each rounded to a sign or nothing."""
    angles = np.deg2rad(np.arange(45, 361, 45))
    expected = np.stack([np.cos(angles), np.sin(angles)], axis=1).round(6)
    assert phase_patterns(stream(*[X] * 8))[:, 0].tolist() == np.sign(expected).astype(int).tolist()


def test_patterns_go_on_where_they_were() -> None:
    whole = phase_patterns(stream(X, X, X, Y, X))
    part = phase_patterns(stream(Y, X), start=(3, 0, 0))
    assert part.tolist() == whole[3:].tolist()


@given(st.lists(st.tuples(*[st.integers(-1, 1)] * 4), max_size=40), st.tuples(*[st.integers(0, 7)] * 3))
def test_a_full_step_is_two_half_steps_at_once(ticks: list[tuple[int, ...]], start: tuple[int, int, int]) -> None:
    half = stream(*ticks)
    slow = phase_patterns(np.repeat(half, 2, axis=0), start)
    assert phase_patterns(2 * half, start).tolist() == slow[1::2].tolist()


def test_full_steps_keep_one_or_two_windings_on() -> None:
    """Whichever parity they began with: from index 0 always one winding has current, from index 1 both."""
    for start, windings in ((0, 1), (1, 2)):
        patterns = phase_patterns(2 * stream(X, X, X, X, Y), (start, start, 0))
        assert np.abs(patterns[:, :2]).sum(axis=2).tolist() == [[windings] * 2] * 5


def test_a_full_step_is_one_clock_pulse() -> None:
    half = stream(X, Y, REST, X)
    for of_full, of_half in zip(clock_and_direction(2 * half), clock_and_direction(half), strict=True):
        assert of_full.tolist() == of_half.tolist()


@given(st.lists(st.tuples(*[st.integers(-2, 2)] * 4), max_size=40))
def test_there_and_back_is_the_same_pattern(ticks: list[tuple[int, int, int, int]]) -> None:
    there = stream(*ticks)
    back = -there[::-1]
    patterns = phase_patterns(np.concatenate([stream(REST), there, back]))
    assert np.array_equal(patterns, patterns[::-1])
    assert (np.abs(patterns).sum(axis=2) >= 1).all()


def test_clock_and_direction() -> None:
    """Lines rest high, hold the last direction, and follow the sign of the step."""
    minus_x = (-1, 0, 0, 0)
    clock, plus = clock_and_direction(stream(REST, minus_x, REST, Y, X))
    assert clock[:, 0].tolist() == [False, True, False, False, True]
    assert clock[:, 1].tolist() == [False, False, False, True, False]
    assert plus[:, 0].tolist() == [True, False, False, False, True]
    assert plus[:, 1].tolist() == [True, True, True, False, False]
    assert plus[:, 2].all()
    assert not clock[:, 2].any()


def test_nothing_in_nothing_out() -> None:
    assert phase_patterns(stream()).shape == (0, 3, 2)
    assert [lines.shape for lines in clock_and_direction(stream())] == [(0, 3), (0, 3)]
