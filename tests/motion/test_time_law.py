"""When ticks fall: every time equals its closed form to the nanosecond, ties to even."""

from __future__ import annotations

from decimal import Decimal
from fractions import Fraction
from itertools import pairwise

import numpy as np
import pytest
from conformance.closed_forms import ramp_s, stop_times_ns, tick_ns, times_ns
from hypothesis import example, given, settings
from hypothesis import strategies as st

from isel_twin.motion import constant, trapezoid
from tests.thorough import drawn

NS = 10**9

LAWS = [
    pytest.param(3000, 10_000, 400, 100_000, id="ramped"),
    pytest.param(3000, 300, 400, 100_000, id="unramped"),
    pytest.param(50, 400, 400, 100_000, id="as fast as the start-stop frequency"),
    pytest.param(3000, 40_000, 300, 100_000, id="triangular, even"),
    pytest.param(3001, 40_000, 300, 100_000, id="triangular, odd"),
    pytest.param(1, 10_000, 400, 100_000, id="single step"),
    pytest.param(2, 10_000, 400, 100_000, id="two steps"),
    pytest.param(500, 401, 400, 4_000_000, id="ramp shorter than a step"),
    pytest.param(499, 10_000, 400, 100_000, id="ramps just do not meet"),
    pytest.param(1000, 10_000, 400, 99_840, id="ramps just meet"),
    pytest.param(2000, 100_000, 1, 1000, id="slowest acceleration, start at 1 Hz"),
    pytest.param(2000, 100_000, 4000, 4_000_000, id="fastest"),
    pytest.param(700, 30, 1, 1000, id="slow"),
    pytest.param(900, Fraction(9973, 7), Fraction(1000, 3), Fraction(70_001, 11), id="rational numbers"),
]


@pytest.mark.parametrize(("n", "v", "f0", "a"), LAWS)
def test_times_equal_the_closed_form(n: int, v: int, f0: int, a: int) -> None:
    assert trapezoid(n, v, f0, a).times(0, n).tolist() == times_ns(n, v, f0, a)


@pytest.mark.parametrize("v", [1, 7, 30, 1024, 9999, 100_000, Fraction(100_003, 7)])
def test_constant_frequency_has_no_ramps(v: int) -> None:
    assert constant(2000, v).times(0, 2000).tolist() == [round(Fraction(NS * k) / v) for k in range(1, 2001)]


MILLION = 1_000_000
MILLION_STEP_LAWS = [
    pytest.param(10_000, 400, 100_000, id="ramped"),
    pytest.param(10_007, 301, 99_991, id="ramped, primes"),
    pytest.param(40_000, 300, 1000, id="triangular in ten seconds and more"),
    pytest.param(30, 400, 100_000, id="unramped, nine hours"),
]


@pytest.mark.parametrize(("v", "f0", "a"), MILLION_STEP_LAWS)
def test_a_million_steps(v: int, f0: int, a: int) -> None:
    """Around the ends of the phases every tick, elsewhere every 211th; a part of a window is the same as alone."""
    times = trapezoid(MILLION, v, f0, a).times(0, MILLION)
    rise = min((v * v - f0 * f0) // (2 * a) if v > f0 else 0, MILLION // 2)
    seen = [range(1, MILLION, 211)]
    seen += [range(max(k - 60, 1), min(k + 60, MILLION) + 1) for k in (1, rise, MILLION - rise, MILLION)]
    for ticks in seen:
        assert times[[k - 1 for k in ticks]].tolist() == times_ns(MILLION, v, f0, a, ticks)
    assert (np.diff(times) > 0).all()


def test_every_one_of_a_million_steps() -> None:
    """The phase half a nanosecond before each time is below k, half a nanosecond after it above: whole numbers only."""
    n, v, f0, a = MILLION, 10_000, 400, 100_000
    half = 2 * trapezoid(n, v, f0, a).times(0, n).astype(object)  # in units of half a nanosecond
    k = np.arange(1, n + 1).astype(object)
    rise = (v * v - f0 * f0) // (2 * a)  # 499 of 499.2

    def ramp(h):  # phase of a ramp times 8e18
        return 4 * NS * f0 * h + a * h * h

    def cruise(h):  # (2 a V) (s - s_r) = 2 a V (V t - (V - f0) V / a), times 1e9
        return a * v * v * h - 2 * NS * v * v * (v - f0)

    total = 2 * NS * (Fraction(2 * (v - f0), a) + Fraction(n) / v - Fraction(v * v - f0 * f0, a * v))
    assert total.denominator == 1  # these numbers give a whole number of half nanoseconds
    up, flat, down = slice(0, rise), slice(rise, n - rise - 1), slice(n - rise - 1, n)
    assert (ramp(half[up] - 1) < 8 * NS**2 * k[up]).all()
    assert (ramp(half[up] + 1) > 8 * NS**2 * k[up]).all()
    goal = NS * v * (2 * a * k[flat] - (v * v - f0 * f0))
    assert (cruise(half[flat] - 1) <= goal).all()
    assert (cruise(half[flat] + 1) >= goal).all()
    left = int(total) - half[down]
    assert (ramp(left + 1) > 8 * NS**2 * (n - k[down])).all()
    assert (ramp(np.maximum(left - 1, 0)) <= 8 * NS**2 * (n - k[down])).all()


def test_ramps_of_a_hundred_seconds() -> None:
    """Where doubles alone are a nanosecond off: times as long as these, close to the middle between two nanoseconds."""
    law = trapezoid(1 << 23, 100_000, 1, 1000)
    close = [319_323, 763_228, 960_587, 1_234_073, 1_350_927, 7_311_610, 7_402_182, 7_687_913, 7_762_618, 7_765_585]
    for k in close:
        exact = times_ns(1 << 23, 100_000, 1, 1000, range(k, k + 1))
        assert law.times(k - 1, k).tolist() == exact
        assert law.times(k - 500, k + 500)[[499]].tolist() == exact


def test_ties_go_to_even() -> None:
    """1 / 1024 Hz is 976562.5 ns; f0 = 524, a = 1024000 put tick 1 of a ramp at (1524 - 524) / a, the same time."""
    assert constant(4, 1024).times(0, 4).tolist() == [976_562, 1_953_125, 2_929_688, 3_906_250]
    assert tick_ns(1, 1000, 10_000, 524, 1_024_000) == Decimal("976562.5")
    assert trapezoid(1000, 10_000, 524, 1_024_000).times(0, 1).tolist() == [976_562]


@pytest.mark.parametrize(
    ("n", "v"), [(383, 1524), (764, 1524), (1145, 1524), (2, 1524), (2, 200_000), (15_621, 200_000), (15_869, 200_000)]
)
def test_ties_on_the_falling_ramp(n: int, v: int) -> None:
    """The last tick but one falls 976562.5 ns, as above, before an end at a whole number of nanoseconds."""
    tick = tick_ns(n - 1, n, v, 524, 1_024_000)
    assert tick % 1 == Decimal("0.5")
    time = int(trapezoid(n, v, 524, 1_024_000).times(n - 2, n - 1)[0])
    assert abs(time - tick) == Decimal("0.5")
    assert time % 2 == 0


numbers = st.tuples(
    st.integers(1, 400),
    st.one_of(st.integers(1, 100_000), st.sampled_from([1024, 1 << 16, 100_000])),
    st.one_of(st.integers(1, 4000), st.sampled_from([128, 512, 1024])),
    st.one_of(st.integers(1000, 4_000_000), st.sampled_from([1024, 1_024_000, 1 << 20])),
)


@given(numbers)
@settings(deadline=None, max_examples=drawn(60))
@example((4, 100_000, 524, 1_024_000))
def test_any_move_equals_the_closed_form(move: tuple[int, int, int, int]) -> None:
    assert trapezoid(*move).times(0, move[0]).tolist() == times_ns(*move)


large = st.tuples(
    st.integers(1 << 20, 1 << 25), st.integers(1, 100_000), st.integers(1, 4000), st.integers(1000, 4_000_000)
)


@given(large, st.integers(0, (1 << 25) - 1))
@settings(deadline=None, max_examples=drawn(60))
def test_any_window_of_the_longest_moves(move: tuple[int, int, int, int], where: int) -> None:
    n = move[0]
    k = where % n
    last = min(k + 20, n)
    assert trapezoid(*move).times(k, last).tolist() == times_ns(*move, range(k + 1, last + 1))


@given(numbers, st.lists(st.integers(0, 400), max_size=6))
@settings(deadline=None, max_examples=drawn(60))
def test_windows_do_not_depend_on_how_they_are_cut(move: tuple[int, int, int, int], cuts: list[int]) -> None:
    law = trapezoid(*move)
    edges = sorted({0, move[0], *(min(cut, move[0]) for cut in cuts)})
    parts = [law.times(a, b) for a, b in pairwise(edges)]
    assert np.concatenate(parts).tolist() == law.times(0, move[0]).tolist()


@given(numbers)
@settings(deadline=None, max_examples=drawn(60))
def test_times_never_decrease_and_end_with_the_duration(move: tuple[int, int, int, int]) -> None:
    law = trapezoid(*move)
    times = law.times(0, move[0])
    assert (np.diff(times) >= 0).all()
    assert times[0] > 0
    assert law.duration_ns == times[-1]


@given(numbers, st.integers(0, 400))
@settings(deadline=None, max_examples=drawn(80))
def test_count_agrees_with_the_rounded_times(move: tuple[int, int, int, int], k: int) -> None:
    law = trapezoid(*move)
    times = law.times(0, move[0])
    moment = int(times[k % move[0]])
    for t in (moment - 1, moment, moment + 1, 2 * moment, -1, 0):
        assert law.count(t) == np.searchsorted(times, t, side="right")


@given(large, st.integers(0, 1 << 25))
@settings(deadline=None, max_examples=drawn(60))
def test_count_in_the_longest_moves(move: tuple[int, int, int, int], where: int) -> None:
    law = trapezoid(*move)
    k = where % move[0] + 1
    time = times_ns(*move, range(k, k + 1))[0]
    assert law.count(time) == k
    assert law.count(time - 1) == k - 1


@given(numbers, st.fractions(0, 1))
@settings(deadline=None, max_examples=drawn(150))
@example((400, 10_000, 400, 100_000), Fraction(1, 2))
@example((10, 401, 400, 4_000_000), Fraction(1, 2))
def test_stop_ramp(move: tuple[int, int, int, int], part: Fraction) -> None:
    """A stop anywhere: at a tick, between ticks, in every phase."""
    law = trapezoid(*move)
    for stop_ns in (int(part * law.duration_ns), int(law.times(0, move[0])[int(part * (move[0] - 1))])):
        stopped = law.stopped(stop_ns)
        assert stopped.times(0, stopped.ticks).tolist() == stop_times_ns(*move, stop_ns)


def test_stop_while_rising_takes_as_long_as_the_rise() -> None:
    """50 ms at 100000 Hz/s from 400 Hz: 145 steps and 5400 Hz; the mirror image ends after 290 steps and 100 ms."""
    stopped = trapezoid(100_000, 20_000, 400, 100_000).stopped(50_000_000)
    assert stopped.ticks == 290
    assert stopped.duration_ns == 100_000_000


def test_stop_at_speed() -> None:
    """(10000^2 - 400^2) / 200000 = 499.2 steps of ramp; 0.5 s is step 499.2 + 10000 (0.5 - 0.096) = 4539.2."""
    stopped = trapezoid(100_000, 10_000, 400, 100_000).stopped(500_000_000)
    assert stopped.ticks == 5038  # floor of 5038.4
    assert stopped.times(0, 4539).tolist() == trapezoid(100_000, 10_000, 400, 100_000).times(0, 4539).tolist()
    end_s = Decimal("0.596") - ramp_s(Decimal("0.4"), 400, 100_000)
    assert stopped.duration_ns == round(NS * end_s)


def test_stop_on_the_last_ramp_changes_nothing() -> None:
    law = trapezoid(1000, 10_000, 400, 100_000)
    late = law.duration_ns - 20_000_000
    assert law.stopped(late) == law
    once = law.stopped(40_000_000)
    assert once.stopped(60_000_000) == once
    assert once.stopped(10**12) == once


def test_stop_before_the_start_and_without_ramps() -> None:
    assert trapezoid(1000, 10_000, 400, 100_000).stopped(0).ticks == 0
    assert trapezoid(1000, 10_000, 400, 100_000).stopped(-5).ticks == 0
    assert constant(1000, 1000).stopped(2_500_000).ticks == 2


@given(numbers, st.fractions(0, 1))
@settings(deadline=None, max_examples=drawn(60))
def test_cut_keeps_the_ticks_up_to_then(move: tuple[int, int, int, int], part: Fraction) -> None:
    law = trapezoid(*move)
    times = law.times(0, move[0])
    t = int(part * law.duration_ns)
    cut = law.cut(t)
    assert cut.times(0, cut.ticks).tolist() == times[times <= t].tolist()
    assert cut.count(2 * law.duration_ns) == cut.ticks


def test_a_stopped_law_can_be_cut() -> None:
    stopped = trapezoid(100_000, 10_000, 400, 100_000).stopped(500_000_000)
    cut = stopped.cut(550_000_000)
    assert cut.ticks == stopped.count(550_000_000)
    assert cut.times(0, cut.ticks).tolist() == stopped.times(0, cut.ticks).tolist()
    assert cut.stopped(560_000_000) == cut


def test_no_ticks() -> None:
    law = trapezoid(0, 10_000, 400, 100_000)
    assert (law.ticks, law.duration_ns, law.count(10**9)) == (0, 0, 0)
    assert law.times(0, 0).size == 0
    assert law.stopped(5) == law


def test_denominators_beyond_64_bits_stay_exact() -> None:
    """The accumulator would need 2^61 and more: whole numbers of any length take over."""
    v = Fraction((1 << 62) + 1, (1 << 49) + 3)
    assert constant(50, v).times(0, 50).tolist() == [round(NS * k / v) for k in range(1, 51)]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((-1, 1000, 400, 1000), "ticks"),
        ((10, 0, 400, 1000), "speed_hz"),
        ((10, 1000, 0, 1000), "start_stop_hz"),
        ((10, 1000, 400, -1), "acceleration_hz_per_s"),
        ((1 << 40, 100, 1, 1000), "64 bits"),
    ],
)
def test_what_cannot_be_is_refused(arguments: tuple[int, int, int, int], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        trapezoid(*arguments)


@pytest.mark.parametrize(("first", "last"), [(-1, 5), (5, 4), (0, 11)])
def test_ticks_that_do_not_exist(first: int, last: int) -> None:
    with pytest.raises(IndexError, match="10"):
        constant(10, 1000).times(first, last)
