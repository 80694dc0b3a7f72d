"""Which axes step: the floor rule of lines, for any number of axes and in any window."""

from __future__ import annotations

import itertools

import numpy as np
import pytest
from conformance.closed_forms import made_after
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.motion import line
from tests.thorough import drawn

steps = st.lists(st.integers(-300, 300), min_size=1, max_size=8).map(tuple)


def floor_rule(n: tuple[int, ...], k: int) -> tuple[int, ...]:
    """Steps of each axis after leading pulse k."""
    return tuple(made_after(k, i, max(abs(j) for j in n)) for i in n)


def positions_of(delta: NDArray[np.int8]) -> NDArray[np.int64]:
    """int64 [n + 1, axes]: position after each tick, before the first one included."""
    assert delta.dtype == np.int8
    made = np.cumsum(delta.astype(np.int64), axis=0)
    return np.concatenate([np.zeros((1, delta.shape[1]), dtype=np.int64), made])


def test_one_to_three() -> None:
    """Y makes its steps with the second, fifth and eighth of nine X steps."""
    delta = line((9, 3, 0, 0)).deltas(0, 9)
    assert delta[:, 0].tolist() == [1] * 9
    assert np.flatnonzero(delta[:, 1]).tolist() == [1, 4, 7]


@pytest.mark.parametrize("signs", list(itertools.product((-1, 1), repeat=4)))
def test_every_sign_and_every_set_of_axes(signs: tuple[int, ...]) -> None:
    for used in itertools.product((0, 1), repeat=4):
        n = tuple(s * u * m for s, u, m in zip(signs, used, (70, 41, 70, 13), strict=True))
        motion = line(n)
        assert motion.ticks == max(abs(i) for i in n)
        assert motion.deltas(0, motion.ticks).sum(axis=0).tolist() == list(n)


@given(steps)
@settings(deadline=None, max_examples=drawn(100))
def test_any_line_follows_the_floor_rule(n: tuple[int, ...]) -> None:
    motion = line(n)
    assert (motion.axes, motion.ticks) == (len(n), max(abs(i) for i in n))
    positions = positions_of(motion.deltas(0, motion.ticks)).tolist()
    assert positions == [list(floor_rule(n, k)) if any(n) else [0] * len(n) for k in range(motion.ticks + 1)]
    assert [list(motion.displacement(k)) for k in range(motion.ticks + 1)] == positions


@given(steps, st.lists(st.integers(0, 300), max_size=5))
@settings(deadline=None, max_examples=drawn(60))
def test_windows_do_not_depend_on_how_they_are_cut(n: tuple[int, ...], cuts: list[int]) -> None:
    motion = line(n)
    edges = sorted({0, motion.ticks, *(min(cut, motion.ticks) for cut in cuts)})
    parts = [motion.deltas(a, b) for a, b in itertools.pairwise(edges)]
    assert np.concatenate([motion.deltas(0, 0), *parts]).tolist() == motion.deltas(0, motion.ticks).tolist()


def test_a_window_is_an_array_of_its_own() -> None:
    """Whoever gets it may write to it, and compiled code sees the same kind of array from every path."""
    motion = line((50, -50, 7))
    delta = motion.deltas(10, 20)
    assert delta.shape == (10, 3)
    assert delta.flags.c_contiguous
    delta[:] = 5
    assert motion.deltas(10, 11).tolist()[0][:2] == [1, -1]


@pytest.mark.parametrize("lead", [1 << 25, (1 << 40) - 1])
def test_the_longest_lines_do_not_overflow(lead: int) -> None:
    n = (lead, -(lead // 3), 7, lead - 1)
    motion = line(n)
    for first in (0, lead // 2, lead - 50):
        positions = positions_of(motion.deltas(first, first + 50)) + floor_rule(n, first)
        assert positions.tolist() == [list(floor_rule(n, first + k)) for k in range(51)]
    assert motion.displacement(lead) == n


def test_no_steps() -> None:
    assert line((0, 0, 0, 0)).ticks == 0
    assert line((0, 0, 0, 0)).deltas(0, 0).shape == (0, 4)
    assert line((0, 0, 0, 0)).displacement(0) == (0, 0, 0, 0)


@pytest.mark.parametrize("n", [(), (1,) * 9, (1 << 40, 0, 0, 0)])
def test_what_is_no_line(n: tuple[int, ...]) -> None:
    with pytest.raises(ValueError, match="1 to 8 step numbers below"):
        line(n)


def test_ticks_that_do_not_exist() -> None:
    for first, last in ((-1, 3), (3, 2), (0, 6)):
        with pytest.raises(IndexError, match="of 5"):
            line((5, 1, 0, 0)).deltas(first, last)
    with pytest.raises(IndexError, match="of 5"):
        line((5, 1, 0, 0)).displacement(6)
