"""How the GMI99 plans moves: its figures, worked out from the manual's rules, not from the code.

Times are closed forms: a move of length L at F with ramps A takes L/F + F/A (linear), and pi/2 F/A instead under sin^2.
Section numbers are those of the manual; what it leaves open is in docs/decisions.md.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from fractions import Fraction

import numpy as np
import pytest
from firmware.gmi99.rules import Rules
from hypothesis import given, settings
from hypothesis import strategies as st
from motion.joined_forms import Part, displacement, law
from mpmath import mpf

from isel_twin.firmware.gmi99.planner import (
    PERIOD_NS,
    PreparedMove,
    corner_hz,
    factor,
    line,
    more,
    scale,
    start,
    useful_hz,
)
from isel_twin.motion.joined import Joined
from tests.thorough import drawn

RULES = Rules().with_speed(50_000)
"""M 50 kHz; B 50 Hz/ms, N11 = 50, N16 = 0, W1 and linear ramps are the card's defaults."""


def way(*n: int) -> tuple[int, ...]:
    return (*n, *(0,) * (6 - len(n)))


def at(plan: Joined, seconds: float, axes: int = 2) -> tuple[int, ...]:
    return plan.displacement(round(seconds / 0.004))[:axes]


def seconds(plan: Joined) -> float:
    return plan.duration_s


def moved(moves: Sequence[PreparedMove], rules: Rules = RULES, **options: float) -> Joined:
    return start(moves, rules, **options)  # type: ignore[arg-type]


# ---- 1.1, 1.3, W: leading axis and tool speed -----------------------------------------------------------------------


def test_straight_move_with_linear_ramps() -> None:
    """200 ms ramps over 1000 increments each, 1.8 s at 40 increments a tick."""
    plan = moved([line(way(20_000), 10_000, RULES)])
    assert [at(plan, t)[0] for t in (0.008, 0.02, 0.1, 0.2, 0.204, 1, 2.1, 2.2)] == [
        *(2, 10, 250, 1000, 1040, 9000, 19_750, 20_000)
    ]
    assert plan.ticks == 550


def test_sine_ramps_take_pi_half_as_long() -> None:
    rules = replace(RULES, sine=True)
    plan = moved([line(way(20_000), 10_000, rules)], rules)
    assert [at(plan, t)[0] for t in (0.1, 0.2, 0.312, 1.0)] == [79, 545, 1549, 8429]
    assert seconds(plan) == pytest.approx(2 + 0.2 * math.pi / 2, abs=1e-12)
    assert plan.ticks == 579


def test_short_move_has_its_peak_in_the_middle() -> None:
    """sqrt(50 000 x 500) = 5000 Hz after 100 ms."""
    plan = moved([line(way(500), 10_000, RULES)])
    assert plan.speed(25) == pytest.approx(5000)
    assert (at(plan, 0.1), plan.ticks) == ((250, 0), 50)


def test_tool_speed_control_on() -> None:
    """3000, 4000 are 5000 of path: T = 1 + 0.1, (0.5 - 0.05) 5000 = 2250 after half a second, 0.6 and 0.8 of it."""
    plan = moved([line(way(3000, 4000), 5000, RULES)])
    assert seconds(plan) == pytest.approx(1.1, abs=1e-12)
    assert at(plan, 0.5) == (1350, 1800)


def test_tool_speed_control_off_leads_the_longest_axis() -> None:
    off = replace(RULES, tool_speed=False)
    plan = moved([line(way(2000, 4000), 5000, off)], off)
    assert (seconds(plan), at(plan, 0.5)) == (pytest.approx(0.9, abs=1e-12), (1125, 2250))
    on = moved([line(way(2000, 4000), 5000, RULES)])
    assert seconds(on) == pytest.approx(math.sqrt(20) * 0.2 + 0.1, abs=1e-12)
    assert at(on, 0.5) == (1006, 2012)


def test_an_axis_of_twice_the_resolution_runs_twice_as_fast() -> None:
    """1.1: ratio 0.5 (32 768 / 65 535), 1000 Hz programmed: 2000 of its increments a second, ramps of 20 ms."""
    rules = RULES.with_ratio(32_768, 1)
    plan = moved([line(way(0, 2000), 1000, rules)], rules)
    assert (at(plan, 0.1), at(plan, 0.5)) == ((0, 180), (0, 980))
    assert seconds(plan) == pytest.approx(2000 * 32_768 / 65_535 / 1000 + 0.02, abs=1e-9)


def test_axes_without_influence_share_the_time() -> None:
    """A rotary axis of 8000 increments (it may have 80 Hz/ms) leaves the 5000 of X and Y as they are."""
    rules = RULES.with_ratio(65_535 + 65_536, 3).with_acceleration(80, 3)
    assert rules.influence == (True, True, True, False, True, True)
    assert seconds(moved([line(way(3000, 4000, 0, 8000), 5000, rules)], rules)) == pytest.approx(1.1, abs=1e-12)
    assert seconds(moved([line(way(0, 0, 0, 8000), 5000, rules)], rules)) == pytest.approx(1.7, abs=1e-12)
    assert rules.with_ratio(65_535, 3).influence == (True,) * 6


# ---- M, B, f, G0, 5: limits ----------------------------------------------------------------------------------------


def test_speed_and_acceleration_of_single_axes() -> None:
    """Y may do 3000 Hz and 20 Hz/ms: on (3000, 4000) the path does 5/4 of that."""
    rules = RULES.with_speed(3000, 1).with_acceleration(20, 1)
    assert rules.speed_hz == (50_000, 50_000, 3000, *(50_000,) * 4)
    assert rules.acceleration_hz_per_ms == (50, 50, 20, 50, 50, 50, 50)
    plan = moved([line(way(3000, 4000), 5000, rules)], rules)
    assert seconds(plan) == pytest.approx(5000 / 3750 + 3750 / 25_000, abs=1e-12)
    assert rules.with_speed(7000).speed_hz == (7000,) * 7
    assert rules.with_acceleration(7).acceleration_hz_per_ms == (7,) * 7


def test_the_limit_of_an_axis_is_in_effective_increments() -> None:
    """Ratio 0.5: 3000 effective are 6000 of its increments a second."""
    rules = RULES.with_ratio(32_768, 1).with_speed(3000, 1)
    plan = moved([line(way(0, 20_000), 50_000, rules)], rules)
    ticks = plan.deltas(200, 204)[:, 1]
    assert ticks.sum() == pytest.approx(4 * 24 * 65_535 / 65_536, abs=1)


def test_speed_above_m_is_m() -> None:
    rules = Rules().with_speed(5000)
    assert set(moved([line(way(20_000), 9000, rules)], rules).deltas(100, 200)[:, 0]) == {20}
    assert set(moved([line(way(20_000), None, rules)], rules).deltas(100, 200)[:, 0]) == {20}  # G0


@pytest.mark.parametrize(
    ("m", "k"),
    [
        *((5, 1), (50_000, 1), (50_001, 2), (100_000, 2), (100_001, 4), (200_000, 4), (200_001, 8), (400_000, 8)),
        *((400_001, 10), (500_000, 10), (500_001, 20), (1_000_000, 20)),
    ],
)
def test_v_factor(m: int, k: int) -> None:
    """5: the table, and what it makes of f."""
    assert factor(m) == k
    rules = Rules().with_speed(m)
    assert useful_hz(1, rules) == 2 * k
    if m >= 10_003:
        assert useful_hz(10_003, rules) == 10_003 // k * k
    assert useful_hz(2_000_000, rules) == m // k * k


def test_v_factor_in_motion() -> None:
    """Factor 4: 10 003 becomes 10 000, exactly 40 increments a tick."""
    rules = RULES.with_speed(150_000)
    assert set(moved([line(way(20_000), 10_003, rules)], rules).deltas(60, 500)[:, 0]) == {40}


def test_a_piece_takes_12_ms() -> None:
    """1.2: 20 pieces of 100 increments run at 100 / 0.012 Hz."""
    plan = moved([line(way(100), 10_000, RULES)] * 20)
    top = 100 / 0.012
    assert seconds(plan) == pytest.approx(2000 / top + top / 50_000, abs=1e-12)
    assert round(seconds(plan), 6) == 0.406667


# ---- override, G95 ---------------------------------------------------------------------------------------------------


def test_override() -> None:
    move = line(way(20_000), 10_000, RULES)
    assert seconds(moved([move], scale=scale(50))) == pytest.approx(4.1, abs=1e-12)
    assert seconds(moved([move], scale=scale(120))) == pytest.approx(20 / 12 + 0.24, abs=1e-12)
    assert (scale(), scale(0), scale(125), scale(200), scale(-5)) == (1, 0, 1.25, 1.25, 0)
    slow = RULES.with_speed(10_500)
    assert seconds(moved([line(way(20_000), 10_000, slow)], slow, scale=1.25)) == pytest.approx(20 / 10.5 + 0.21)


def test_feed_per_revolution() -> None:
    """G95: 250 increments a revolution at 1200 rpm are 5000 Hz; at 50 % 2500; a spindle that stands stands."""
    move = line(way(20_000), 250, RULES, per_revolution=True)
    assert seconds(moved([move], scale=scale(spindle_rpm=1200))) == pytest.approx(4.1, abs=1e-12)
    assert seconds(moved([move], scale=scale(50, 1200))) == pytest.approx(8.05, abs=1e-12)
    assert moved([move], scale=scale(100, 0)).ticks == 0


def test_reduced_speed() -> None:
    assert seconds(moved([line(way(20_000), 10_000, RULES)], ceiling_hz=4000)) == pytest.approx(5.08, abs=1e-12)


# ---- N11, N16: corners ----------------------------------------------------------------------------------------------


def test_collinear_moves_join() -> None:
    plan = moved([line(way(10_000), 10_000, RULES)] * 2)
    assert seconds(plan) == pytest.approx(2.2, abs=1e-12)
    assert plan.passed(1) == 275
    assert set(plan.deltas(60, 500)[:, 0]) == {40}


def test_another_speed_between_two_moves() -> None:
    """10 000 is passed at 5000 Hz: 0.2 s, 0.825 s at 10 000 Hz, 0.1 s down; 1.95 s at 5000 Hz and 0.1 s to stop."""
    plan = moved([line(way(10_000), 10_000, RULES), line(way(10_000), 5000, RULES)])
    assert at(plan, 1.124)[0] <= 10_000 <= at(plan, 1.128)[0]
    assert plan.speed(282) == pytest.approx(5000)
    assert seconds(plan) == pytest.approx(1.125 + 2.05, abs=1e-12)


@pytest.mark.parametrize(("sharp", "total"), [(0, 2.4), (1000, 2.362)])
def test_right_angle(sharp: int, total: float) -> None:
    """N16 = 0 stands at the corner; 1000 Hz: each half is 10 000 from 0 to 1000 Hz, 0.2 + 0.18 s of ramps."""
    rules = replace(RULES, jump_hz=1000, sharp_jump_hz=sharp)
    plan = moved([line(way(10_000), 10_000, rules), line(way(0, 10_000), 10_000, rules)], rules)
    assert seconds(plan) == pytest.approx(total, abs=1e-12)
    assert plan.passed(1) == math.ceil(total / 2 / 0.004 - 1e-9)


@pytest.mark.parametrize(
    ("first", "second", "jump"),
    [
        # 45 degrees: FS = 1000 - 800/2 = 600, the velocity changes by (1 - 1/sqrt 2, 1/sqrt 2)
        (way(100), way(100, 100), 600 * math.sqrt(2)),
        # 90 degrees and beyond: FS = 200
        (way(100), way(0, 77), 200),
        (way(100), way(-5), 100),  # back: the velocity changes by 2
        (way(100), way(-100, 100), 200 / (1 + math.sqrt(0.5))),
        # 60 degrees in space: (1, 1, 0), (1, 0, 1): FS = 1000 - 800 x 2/3, change (0, 1, 1)/sqrt 2
        (way(100, 100), way(100, 0, 100), (1000 - 1600 / 3) * math.sqrt(2)),
        (way(100, 300), way(7, 21), math.inf),
        (way(-1), way(-8_000_000), math.inf),
    ],
)
def test_corner_rule(first: tuple[int, ...], second: tuple[int, ...], jump: float) -> None:
    rules = replace(RULES, jump_hz=1000, sharp_jump_hz=200)
    a, b = line(first, 10_000, rules), line(second, 10_000, rules)
    assert a.last is not None
    assert b.first is not None
    assert corner_hz(a.last, b.first, rules) == pytest.approx(jump, rel=1e-9)
    assert corner_hz(b.first, a.last, rules) == pytest.approx(jump, rel=1e-9)


def test_sharp_jump_is_never_above_the_other() -> None:
    """3.1.2 N16: FS90 is limited by FS0."""
    rules = replace(RULES, jump_hz=300, sharp_jump_hz=1000)
    a, b = line(way(100), 10_000, rules), line(way(0, 100), 10_000, rules)
    assert a.last is not None
    assert b.first is not None
    assert corner_hz(a.last, b.first, rules) == pytest.approx(300)


def test_what_arrives_in_motion_is_joined_with_its_corner() -> None:
    rules = replace(RULES, jump_hz=1000, sharp_jump_hz=1000)
    a, b = line(way(10_000), 10_000, rules), line(way(0, 10_000), 10_000, rules)
    at_once, later = start([a, b], rules), more(start([a], rules), 200, [b], rules, a.last)
    assert np.array_equal(at_once.deltas(0, at_once.ticks), later.deltas(0, later.ticks))


def test_a_move_that_goes_nowhere_does_not_part_others() -> None:
    a, nothing = line(way(10_000), 10_000, RULES), line(way(), 10_000, RULES)
    assert (len(nothing.pieces), nothing.first, nothing.last) == (0, None, None)
    assert seconds(start([a, nothing, a], RULES)) == pytest.approx(2.2, abs=1e-12)
    assert start([nothing], RULES).ticks == 0
    plan = start([a], RULES)
    assert more(plan, 10, [nothing], RULES, a.last).ticks == plan.ticks


@pytest.mark.parametrize(("n", "feed"), [((1, 2, 3), 100), (way(1), 0), (way(1), -4)])
def test_no_move(n: tuple[int, ...], feed: int) -> None:
    with pytest.raises(ValueError, match=r"increments|feed"):
        line(n, feed, RULES)


# ---- stop, hold, abort ----------------------------------------------------------------------------------------------


def test_stop_flag_and_on() -> None:
    """M0.0 at 1.0 s: 200 ms, 1000 increments; on at 2.0 s: the second half is a move of 10 000 from standstill."""
    plan = moved([line(way(20_000), 10_000, RULES)])
    held = plan.replanned(250, hold=True)
    assert (held.ticks, at(held, 1.2)) == (300, (10_000, 0))
    on = held.replanned(500, hold=False)
    assert (on.ticks, at(on, 2.0), at(on, 3.2)) == (800, (10_000, 0), (20_000, 0))


def test_abort() -> None:
    plan = moved([line(way(20_000), 10_000, RULES), line(way(-20_000), 10_000, RULES)]).stopped(250)
    assert (plan.ticks, at(plan, 9.0)) == (300, (10_000, 0))


# ---- random jobs -----------------------------------------------------------------------------------------------------

some_rules = st.builds(
    lambda m, b, single_m, single_b, slot, ratio, tool, fs0, fs90, sine: replace(
        Rules()
        .with_speed(m)
        .with_acceleration(b)
        .with_speed(single_m, slot)
        .with_acceleration(single_b, slot)
        .with_ratio(ratio, (slot + 1) % 3),
        tool_speed=tool,
        jump_hz=fs0,
        sharp_jump_hz=fs90,
        sine=sine,
    ),
    st.integers(2000, 200_000),
    st.integers(5, 1000),
    st.integers(2000, 200_000),
    st.integers(5, 1000),
    st.integers(0, 2),
    st.integers(20_000, 65_535),
    st.booleans(),
    st.integers(0, 5000),
    st.integers(0, 5000),
    st.booleans(),
)
some_moves = st.lists(
    st.tuples(*(st.integers(-9000, 9000),) * 3, st.one_of(st.none(), st.integers(1000, 60_000))), min_size=1, max_size=9
)


def closed_form(moves: Sequence[tuple[int, int, int, int | None]], rules: Rules) -> list[Part]:
    """The pieces, from the manual's rules, one formula after the other."""
    parts: list[Part] = []
    m, b = rules.speed_hz, rules.acceleration_hz_per_ms
    k = next(k for most, k in ((50e3, 1), (100e3, 2), (200e3, 4)) if m[0] <= most)
    before: list[float] = []
    for *n, f in moves:
        if not any(n):
            continue
        e = [i * r / 65_535 for i, r in zip(n, rules.ratio, strict=False)]
        length = math.hypot(*e) if rules.tool_speed else float(max(map(abs, n)))
        feed = m[0] if f is None else max(min(f, m[0]) // k * k, 2 * k)
        single = [(m[i + 1] * length / abs(e[i]), b[i + 1] * length / abs(e[i])) for i in range(3) if e[i]]
        top = min(feed, m[0], length / 0.012, *(s[0] for s in single))
        slope = 1000 * min(b[0], *(s[1] for s in single))
        entry = math.inf
        here = [i / length for i in e]
        if before:
            u, w = ([i / math.hypot(*v) for i in v] for v in (before, here))
            phi = math.degrees(math.acos(min(1.0, max(-1.0, sum(i * j for i, j in zip(u, w, strict=True))))))
            fs90 = min(rules.sharp_jump_hz, rules.jump_hz)
            fs = rules.jump_hz + (fs90 - rules.jump_hz) * min(phi, 90) / 90
            change = max(abs(i - j) for i, j in zip(before, here, strict=True))
            entry = fs / change if change > 1e-9 else math.inf
        before = here
        parts.append(Part(tuple(map(float, n)), length, top, slope, entry))
    return parts


@settings(max_examples=drawn(80), deadline=None, derandomize=True)
@given(some_moves, some_rules, st.booleans())
def test_random_jobs_equal_the_closed_form(
    moves: list[tuple[int, int, int, int | None]], rules: Rules, mirrored: bool
) -> None:
    if mirrored:
        moves = [(-x, -y, -z, f) for x, y, z, f in moves]
    plan = start([line(way(x, y, z), f, rules) for x, y, z, f in moves], rules)
    parts = closed_form(moves, rules)
    assert plan.displacement(plan.ticks)[:3] == tuple(sum(n) for n in zip(*(move[:3] for move in moves), strict=True))
    if not parts:
        return
    form = law(parts, sine=rules.sine)
    assert abs(plan.ticks - math.ceil(float(form.end) / 0.004)) <= 1
    for k in range(0, plan.ticks + 1, max(plan.ticks // 12, 1)):
        expected = displacement(parts, form, mpf(k) * PERIOD_NS / 10**9)
        for n, exact in zip(plan.displacement(k), expected, strict=False):
            assert abs(n - exact) <= 0.51, k


@settings(max_examples=drawn(60), deadline=None, derandomize=True)
@given(
    some_moves,
    some_rules,
    st.lists(st.tuples(st.integers(0, 400), st.sampled_from(("50", "125", "on", "off", "move"))), max_size=4),
)
def test_no_axis_is_faster_or_steeper_than_it_may_be(
    moves: list[tuple[int, int, int, int | None]], rules: Rules, what: list[tuple[int, str]]
) -> None:
    """Whatever happens on the way: M of each axis, and B of each axis, in effective increments."""
    lines = [line(way(x, y, z), f, rules) for x, y, z, f in moves]
    plan, k, last = start(lines, rules), 0, next((move.last for move in reversed(lines) if move.last), None)
    for later, event in what:
        k += later
        if event == "move":
            another = line(way(500, -300), 5000, rules)
            plan, last = more(plan, k, [another], rules, last), another.last
        elif event in ("on", "off"):
            plan = plan.replanned(k, hold=event == "on")
        else:
            plan = plan.replanned(k, scale=scale(int(event)))
    deltas = plan.deltas(0, plan.ticks).astype(np.int64)
    passed = [plan.passed(j) for j in range(plan.pieces + 1) if j <= plan.finished(plan.ticks)]
    for slot in range(3):
        ratio = Fraction(rules.ratio[slot], 65_535)
        top = min(rules.speed_hz[0], rules.speed_hz[slot + 1]) / ratio
        assert np.all(np.abs(deltas[:, slot]) <= float(top) * 0.004 + 1.001)
        slope = rules.acceleration_hz_per_ms[slot + 1] * 1000 / ratio
        for low, high in zip(passed, [*passed[1:], plan.ticks], strict=True):
            change = np.abs(np.diff(deltas[low : max(high - 1, low), slot]))
            assert np.all(change <= float(slope) * 0.004**2 + 2.001)
