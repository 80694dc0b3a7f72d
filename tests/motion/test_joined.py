"""Joined motion: set points and times equal their closed forms, no limit is exceeded, no set point is taken back."""

from __future__ import annotations

import math
import pickle
import random
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from motion.joined_forms import Law, Part, braking, displacement, law
from mpmath import mpf
from numpy.typing import NDArray

from isel_twin.motion import SetPointRun
from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import Pieces, chain, piece
from isel_twin.motion.stretch import Stretch, since, written
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=4)

PERIOD_NS = 4_000_000
PERIOD_S = 0.004

ALONG = Part((20_000.0, 0.0), 20_000, 10_000, 50_000)


def pieces(parts: Sequence[Part]) -> Pieces:
    return chain([piece(p.way, p.length, p.speed, p.acceleration, entry=p.entry) for p in parts])


def plan(parts: Sequence[Part], sine: bool = False) -> Joined:
    return joined(pieces(parts), PERIOD_NS, sine=sine)


def places(motion: Joined) -> NDArray[np.int64]:
    """int64 [ticks + 1, axes]: displacement at every tick."""
    deltas = motion.deltas(0, motion.ticks)
    return np.vstack((np.zeros((1, motion.axes), dtype=np.int64), np.cumsum(deltas, axis=0, dtype=np.int64)))


def check(motion: Joined, parts: Sequence[Part], form: Law, first: int = 0, every: int = 7) -> None:
    """Its set points are the closed form to the rounding, its end falls in the tick of the closed form."""
    assert motion.duration_s == pytest.approx(float(form.end), abs=1e-9)
    assert abs(motion.ticks - float(form.end) / PERIOD_S) <= 1
    at = places(motion)
    for k in {*range(first, motion.ticks + 1, every), motion.ticks}:
        expected = displacement(parts, form, mpf(k) * PERIOD_NS / 10**9)
        assert np.all(np.abs(at[k] - np.array(expected, dtype=float)) <= 0.5 + 1e-6), k
        assert motion.displacement(k) == tuple(at[k])


CHAINS = {
    "one": [ALONG],
    "short": [Part((500.0, 0.0), 500, 10_000, 50_000)],
    "joined straight on": [ALONG, ALONG],
    "slower": [ALONG, replace(ALONG, speed=5000)],
    "faster": [replace(ALONG, speed=5000), ALONG],
    "corner": [ALONG, Part((0.0, 20_000.0), 20_000, 10_000, 50_000, 1000)],
    "full stop": [ALONG, Part((0.0, 20_000.0), 20_000, 10_000, 50_000, 0)],
    "many short ones": [Part((100.0, -33.0), 100, 8333, 50_000)] * 20,
    "accelerations differ": [ALONG, replace(ALONG, acceleration=8000), replace(ALONG, acceleration=200_000)],
    "corners within the braking distance": [
        Part((100.0, 0.0), 100, 10_000, 50_000),
        Part((0.0, 700.0), 700, 10_000, 50_000, 2500),
        Part((300.0, 400.0), 500, 10_000, 50_000, 1800),
        Part((90.0, 0.0), 90, 10_000, 50_000, 2000),
        Part((7.0, 0.0), 7, 10_000, 50_000, 10),
    ],
    "goes nowhere but in length": [Part((0.0, 0.0), 1000, 10_000, 50_000), Part((3.0, 0.0), 3, 10_000, 50_000)],
}


@pytest.mark.parametrize("sine", [False, True], ids=["linear", "sin2"])
@pytest.mark.parametrize("parts", CHAINS.values(), ids=CHAINS)
def test_set_points_equal_the_closed_form(parts: list[Part], sine: bool) -> None:
    check(plan(parts, sine), parts, law(parts, sine=sine))


def test_the_figures_of_one_move() -> None:
    """Worked out by hand: A = 50 Hz/ms, 10 000 Hz, 20 000 increments; sin^2 ramps last pi/2 as long."""
    linear = plan([ALONG])
    assert [linear.displacement(k)[0] for k in (2, 5, 25, 50, 51, 250, 525, 550)] == [
        *(2, 10, 250, 1000, 1040, 9000, 19_750, 20_000)
    ]
    assert linear.ticks == 550
    sine = plan([ALONG], sine=True)
    assert [sine.displacement(k)[0] for k in (25, 50, 78, 250)] == [79, 545, 1549, 8429]
    assert sine.duration_s == pytest.approx(2 + math.pi / 2 * 0.2, abs=1e-12)
    assert sine.ticks == 579


def test_an_end_on_a_tick_is_that_tick_however_the_sum_is_rounded() -> None:
    """0.1 s + 1.9 s + 0.1 s and the like miss the tick by some 10^-16 s; no tick more may come of it."""
    for n in range(200, 4000, 40):
        ticks = n * 5 // 40  # n increments at 10 000 Hz; the ramps take 200 ms each
        motion = plan([Part((float(n * 5 + 2000),), n * 5 + 2000, 10_000, 50_000)])
        assert motion.ticks == 100 + ticks, n
        assert motion.displacement(motion.ticks) == (n * 5 + 2000,)


def test_ties_go_to_the_even_number() -> None:
    """5 increments a tick on axis 0 and 2.5 on axis 1; with ticks of 1/256 s everything is exact."""
    motion = joined(pieces([Part((1000.0, 500.0), 1000, 1280, 1280 * 8)]), 10**9 // 256)
    at = places(motion)[32:-32]
    assert set(np.diff(at[:, 0])) == {5}
    assert [int(y) for y in at[:, 1]] == [round(int(x) / 2) for x in at[:, 0]]  # python rounds ties to even, too
    assert len({int(x) % 4 for x in at[:, 0]}) == 4  # ties whose lower number is even, and odd


# ---- replanned -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class At:
    """The closed form of a motion at tick k."""

    t: mpf
    part: int
    s: mpf
    v: mpf


def state(form: Law, k: int) -> At:
    t = mpf(k) * PERIOD_NS / 10**9
    return At(t, *form.at(t))


def same_until(k: int, before: Joined, after: Joined) -> None:
    n = min(k, before.ticks)
    assert np.array_equal(before.deltas(0, n), after.deltas(0, n))
    for j in (0, n // 2, n):
        assert before.displacement(j) == after.displacement(j)


@pytest.mark.parametrize("k", [1, 13, 49, 50, 51, 300, 499, 501, 530, 549, 550])
def test_a_move_that_arrives_in_motion_is_joined(k: int) -> None:
    """Linear ramps: from the momentary speed on. Rising, cruising, falling already, at the very end."""
    before, form = plan([ALONG]), law([ALONG])
    more = [ALONG, Part((0.0, 5000.0), 5000, 10_000, 50_000, 3000)]
    after = before.replanned(k, append=pieces(more))
    at, parts = state(form, k), [ALONG, *more]
    if k == 550:
        form = form.until(at.t, law(more, t=at.t, first=1))
    else:
        form = form.until(at.t, law(parts[at.part :], t=at.t, v=at.v, s=at.s, first=at.part))
    same_until(k, before, after)
    check(after, parts, form)


def test_a_sine_ramp_under_way_goes_on_if_the_new_plan_has_it_too() -> None:
    """To the same speed: as if both had been known from the beginning."""
    both = [ALONG, ALONG]
    for k in (1, 40, 79, 200, 400):  # rise, cruise
        check(plan([ALONG], sine=True).replanned(k, append=pieces([ALONG])), both, law(both, sine=True))


def test_a_sine_ramp_to_another_speed_begins_anew_at_the_momentary_one() -> None:
    """1000 increments rise to a peak below 10 000 Hz; what arrives makes the rise go on from where it is."""
    short, k = Part((1000.0, 0.0), 1000, 10_000, 50_000), 20
    form = law([short], sine=True)
    at = state(form, k)
    after = plan([short], sine=True).replanned(k, append=pieces([ALONG]))
    parts = [short, ALONG]
    check(after, parts, form.until(at.t, law(parts, sine=True, t=at.t, v=at.v, s=at.s)))


@pytest.mark.parametrize("k", [505, 515, 530, 560, 575])
def test_a_falling_sine_ramp_is_finished_if_a_joint_needs_it(k: int) -> None:
    """In its first half a fresh ramp to the same place would not do: it stops as it was going to, then goes on."""
    stop = Part((0.0, 5000.0), 5000, 10_000, 50_000, 0)
    before, form = plan([ALONG], sine=True), law([ALONG], sine=True)
    after = before.replanned(k, append=pieces([stop]))
    check(after, [ALONG, stop], form.until(form.end, law([stop], sine=True, t=form.end, first=1)))
    same_until(k, before, after)


@pytest.mark.parametrize("sine", [False, True], ids=["linear", "sin2"])
@pytest.mark.parametrize("k", [3, 30, 50, 100, 250, 480])
def test_a_hold_brakes_along_the_path_and_goes_on(k: int, sine: bool) -> None:
    parts = [Part((10_000.0, 0.0), 10_000, 10_000, 50_000), Part((6000.0, 8000.0), 10_000, 10_000, 50_000)]
    before, form = plan(parts, sine), law(parts, sine=sine)
    at = state(form, k)
    stop = form.until(at.t, braking(parts[at.part :], sine=sine, t=at.t, v=at.v, s=at.s, first=at.part))
    held = before.replanned(k, hold=True)
    same_until(k, before, held)
    check(held, parts, stop)
    assert held.held
    assert held.replanned(k + 1, hold=True) is held
    on, last = held.ticks + 77, stop.phases[-1]
    at = At(mpf(on) * PERIOD_NS / 10**9, last.part, last.at(stop.end, sine)[0], mpf(0))
    again = held.replanned(on, hold=False)
    same_until(held.ticks, held, again)
    rest = law(parts[at.part :], sine=sine, t=at.t, s=at.s, first=at.part)
    check(again, parts, stop.until(at.t, rest), first=on)
    assert places(again)[held.ticks : on + 1].min(axis=0).tolist() == list(held.displacement(held.ticks))
    # or the same as a motion of its own, that begins where it stands
    left = held.remainder("another")
    assert left.identity == "another"
    assert np.array_equal(left.deltas(0, left.ticks), again.deltas(on, again.ticks))


@pytest.mark.parametrize("sine", [False, True])
def test_a_rest_that_is_held_before_it_has_begun_stays_where_it_is(sine: bool) -> None:
    """In the middle of a piece, as often as one likes; and pieces may be appended to it meanwhile."""
    held = plan([ALONG, ALONG], sine=sine).replanned(100, hold=True)
    (x, y), left = held.displacement(held.ticks), held.remainder()
    assert 0 < x < 20_000
    for _ in range(3):
        left = left.replanned(0, hold=True)
        assert (left.ticks, left.displacement(0)) == (0, (0, 0))
        left = left.replanned(0, append=pieces([ALONG]))
        assert (left.ticks, left.displacement(0)) == (0, (0, 0))
        left = left.remainder()
    assert left.displacement(left.ticks) == (100_000 - x, -y)
    assert left.replanned(0, hold=True).stopped(0).displacement(0) == (0, 0)


def test_a_hold_in_the_first_half_of_a_sine_fall_to_a_corner_keeps_the_corner() -> None:
    parts = [ALONG, Part((0.0, 20_000.0), 20_000, 10_000, 50_000, 1000)]
    form = law(parts, sine=True)
    fall = next(phase for phase in form.phases if phase.part == 0 and phase.v1 < phase.v0)
    k = int(fall.t / mpf("0.004")) + 10
    held = plan(parts, sine=True).replanned(k, hold=True)
    rest = braking(parts[1:], sine=True, t=fall.t + fall.dt, v=fall.v1, s=0, first=1)
    check(held, parts, form.until(fall.t + fall.dt, rest))


def test_a_stop_forgets_the_rest() -> None:
    stopped = plan([ALONG, ALONG]).stopped(250)
    assert (stopped.ticks, stopped.displacement(stopped.ticks)) == (300, (10_000, 0))
    assert (stopped.pieces, stopped.finished(stopped.ticks), stopped.dropped) == (1, 0, True)
    assert stopped.replanned(400, hold=False) is stopped
    with pytest.raises(ValueError, match="dropped"):
        stopped.replanned(400, append=pieces([ALONG]))


def test_a_stop_across_a_joint_ends_in_the_next_piece() -> None:
    """9000 increments in 1 s and 1000 to brake: 500 of them on the second piece."""
    stopped = plan([replace(ALONG, way=(9500.0, 0.0), length=9500), ALONG, ALONG]).stopped(250)
    assert (stopped.displacement(stopped.ticks), stopped.pieces) == ((10_000, 0), 2)


def test_a_sharper_stop_is_as_much_shorter() -> None:
    """4 x 50 Hz/ms from 10 000 Hz: 50 ms, 250 increments."""
    stopped = plan([ALONG]).replanned(250, hold=True, drop=True, sharpness=4)
    assert stopped.duration_s == pytest.approx(1.05, abs=1e-12)
    assert stopped.displacement(stopped.ticks) == (9250, 0)


def test_other_pieces_instead_of_those_that_wait() -> None:
    back = Part((-20_000.0, 0.0), 20_000, 10_000, 50_000, 0)
    motion = plan([ALONG, ALONG, ALONG]).replanned(250, drop=True, append=pieces([back]))
    check(motion, [ALONG, back], law([ALONG, back]))
    assert motion.pieces == 2


def test_pieces_needed_for_braking_are_not_dropped() -> None:
    """500 increments each; at tick 62 it is on the 4th, at 8 660 Hz at most, and needs 750 increments to stop."""
    short = Part((500.0, 0.0), 500, 10_000, 50_000)
    parts, k = [short] * 20, 62
    form = law(parts)
    at = state(form, k)
    motion = plan(parts).replanned(k, drop=True)
    left = mpf(500) - at.s
    needed = math.ceil((at.v**2 / 100_000 - left) / 500)
    assert needed > 0
    assert motion.pieces == at.part + 1 + needed
    rest = law([short] * (1 + needed), t=at.t, v=at.v, s=at.s, first=at.part)
    check(motion, parts[: motion.pieces], form.until(at.t, rest))


# ---- override ------------------------------------------------------------------------------------------------------


def test_override_before_the_move() -> None:
    """50 %: 5000 Hz, T = 20 000 / 5000 + 0.1. 120 %: 12 000 Hz, T = 20 000 / 12 000 + 0.24."""
    for factor, seconds in ((0.5, 4.1), (1.2, 20 / 12 + 0.24)):
        assert joined(pieces([ALONG]), PERIOD_NS, scale=factor).duration_s == pytest.approx(seconds, abs=1e-12)


def test_neither_limit_nor_ceiling_is_exceeded_by_an_override() -> None:
    limited = piece((20_000.0, 0.0), 20_000, 10_000, 50_000, limit=11_000)
    assert joined(limited, PERIOD_NS, scale=1.25).duration_s == pytest.approx(20 / 11 + 0.22, abs=1e-12)
    assert joined(limited, PERIOD_NS, scale=1.25, ceiling=4000).duration_s == pytest.approx(5.08, abs=1e-12)


@pytest.mark.parametrize("sine", [False, True], ids=["linear", "sin2"])
def test_override_in_motion(sine: bool) -> None:
    """From 10 000 to 4000 Hz at 1 s, and to 10 000 again at 2 s, from one ramp to the other."""
    slope = 50_000 * (2 / math.pi if sine else 1)
    slower = plan([ALONG, ALONG], sine).replanned(250, scale=0.4)
    faster = slower.replanned(500, scale=1.0)
    ramp = 6000 / slope
    passed = 10_000 * (1 - 5000 / slope)  # at 1 s: 10 000 (1 - t_r) + 10 000 t_r / 2, t_r = 10 000 / slope
    assert slower.speed(250) == pytest.approx(10_000)
    assert slower.speed(251 + math.ceil(ramp / PERIOD_S)) == pytest.approx(4000)
    at_2_s = passed + 7000 * ramp + 4000 * (1 - ramp)
    assert slower.displacement(500)[0] == pytest.approx(at_2_s, abs=0.5 + 1e-6)
    same_until(500, slower, faster)
    rest = 40_000 - at_2_s - 7000 * ramp - 5000 * (10_000 / slope)
    assert faster.duration_s == pytest.approx(2 + ramp + rest / 10_000 + 10_000 / slope, abs=1e-9)
    assert faster.displacement(faster.ticks) == (40_000, 0)


def test_override_zero_stands_and_goes_on() -> None:
    standing = joined(pieces([ALONG]), PERIOD_NS, scale=0.0)
    assert (standing.ticks, standing.held, standing.pieces) == (0, True, 1)
    going = standing.replanned(100, scale=1.0)
    assert (going.ticks, going.displacement(100), going.displacement(650)) == (650, (0, 0), (20_000, 0))
    stopped = going.replanned(350, scale=0.0)
    assert (stopped.ticks, stopped.displacement(stopped.ticks)) == (400, (10_000, 0))
    assert stopped.remainder().ticks == 0
    assert stopped.remainder(scale=1.0).ticks == 300


# ---- counting pieces -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sine", [False, True])
def test_another_wanted_speed_to_the_end_of_a_piece(sine: bool) -> None:
    """The piece under way at 6000/s from now on, its joint at the entry speed, the next one at its own 10 000/s."""
    parts = [ALONG, ALONG]
    motion = plan(parts, sine)
    slower = motion.replanned(150, wanted=(1, 6000.0))
    assert motion.speed(150) == pytest.approx(10_000.0)
    assert np.array_equal(places(motion)[:151], places(slower)[:151])
    joint = slower.passed(1)
    assert slower.speed(joint - 20) == pytest.approx(6000.0)
    assert max(slower.speed(k) for k in range(joint, slower.ticks)) == pytest.approx(10_000.0)
    assert slower.displacement(slower.ticks) == motion.displacement(motion.ticks)
    assert motion.speed(300) == pytest.approx(10_000.0)  # the other plan has kept its own
    held = motion.replanned(150, hold=True).replanned(160, wanted=(1, 6000.0))
    resumed = held.replanned(held.ticks + 100, hold=False)
    assert resumed.speed(resumed.passed(1) - 20) == pytest.approx(6000.0)
    rest = held.remainder()
    assert rest.speed(rest.passed(1) - 20) == pytest.approx(6000.0)
    with pytest.raises(ValueError, match="no plan"):
        motion.replanned(150, wanted=(1, 0.0))


def test_pieces_are_counted_when_their_ends_are_passed() -> None:
    motion = plan([ALONG, ALONG])  # 20 000 passed at 2.1 s, the end at 4.2 s
    assert [motion.passed(j) for j in (0, 1, 2)] == [0, 525, 1050]
    assert [motion.finished(k) for k in (0, 524, 525, 1049, 1050, 2000)] == [0, 0, 1, 1, 2, 2]
    held = motion.replanned(100, hold=True)
    assert held.finished(10_000) == 0
    with pytest.raises(IndexError, match="not reached"):
        held.passed(1)
    with pytest.raises(IndexError):
        motion.passed(3)


def test_an_empty_chain_stands_and_can_be_continued() -> None:
    empty = joined(Pieces(np.empty((0, 2)), *(np.empty(0),) * 5), PERIOD_NS)
    assert (empty.ticks, empty.pieces, empty.displacement(5), empty.speed(0)) == (0, 0, (0, 0), 0)
    assert empty.stopped(0).ticks == 0
    motion = empty.replanned(7, append=pieces([ALONG]))
    assert (motion.ticks, motion.displacement(7), motion.displacement(557)) == (557, (0, 0), (20_000, 0))


def test_what_waits_at_rest_can_be_dropped() -> None:
    standing = joined(pieces([ALONG, ALONG]), PERIOD_NS, scale=0.0)
    for k in (0, 9):
        other = standing.replanned(k, drop=True, append=None, hold=False, scale=1.0)
        assert (other.ticks, other.pieces, other.displacement(1000)) == (0, 0, (0, 0))
    assert plan([ALONG]).replanned(900, drop=True, append=pieces([ALONG])).displacement(2000) == (40_000, 0)


# ---- values --------------------------------------------------------------------------------------------------------


def test_it_is_a_plan_of_a_set_point_run() -> None:
    before = joined(pieces([ALONG]), PERIOD_NS, identity=7)
    after = before.replanned(100, append=pieces([ALONG]))
    run = SetPointRun(before, PERIOD_NS, 40 * PERIOD_NS)
    assert replace(run, plan=after).continues(run)
    assert not replace(run, plan=joined(pieces([ALONG]), PERIOD_NS, identity=8)).continues(run)
    stopped = run.stopped(40 * PERIOD_NS + 250 * PERIOD_NS + 1)
    assert stopped.end_ns == (40 + 300) * PERIOD_NS
    assert run.window(0, 550)[1].dtype == np.int32


def test_it_can_be_kept_and_brought_back() -> None:
    motion = plan([ALONG, ALONG], sine=True).replanned(100, scale=0.7)
    again = pickle.loads(pickle.dumps(motion))
    assert np.array_equal(again.deltas(0, again.ticks), motion.deltas(0, motion.ticks))


@dataclass(frozen=True)
class Arc:
    """A quarter of a circle of 1000 increments, counter-clockwise, from (1000, 0)."""

    def displacement(self, s: NDArray[np.float64]) -> NDArray[np.float64]:
        angle = s / 1000
        return np.column_stack((1000 * np.cos(angle) - 1000, 1000 * np.sin(angle)))


def test_a_curve_is_followed() -> None:
    parts = [
        piece((0.0, 300.0), 300, 2000, 50_000),
        piece((-1000.0, 1000.0), 500 * math.pi, 2000, 50_000, curve=Arc()),
        piece((-300.0, 0.0), 300, 2000, 50_000),
    ]
    motion = joined(chain(parts), PERIOD_NS)
    held = motion.replanned(200, hold=True)
    left = held.remainder()
    assert motion.duration_s == pytest.approx((600 + 500 * math.pi) / 2000 + 2000 / 50_000, abs=1e-12)
    assert motion.displacement(motion.ticks) == (-1300, 1300)
    for k in range(motion.ticks + 1):
        s = motion_s(k * PERIOD_S)
        if 300 < s < 300 + 500 * math.pi:
            angle = (s - 300) / 1000
            x, y = 1000 * math.cos(angle) - 1000, 300 + 1000 * math.sin(angle)
            assert motion.displacement(k) == pytest.approx((x, y), abs=0.5 + 1e-6)
    assert np.abs(held.deltas(0, held.ticks)).sum() > 0
    assert since(motion, 0) is None
    assert tuple(np.add(held.displacement(held.ticks), left.displacement(left.ticks))) == (-1300, 1300)


def motion_s(t: float) -> float:
    """2000 a second with ramps of 40 ms, in the middle part."""
    return 2000 * (t - 0.02)


REFUSED = {
    "no period": lambda: joined(pieces([ALONG]), 0),
    "negative scale": lambda: joined(pieces([ALONG]), PERIOD_NS, scale=-1),
    "no ceiling": lambda: joined(pieces([ALONG]), PERIOD_NS, ceiling=0),
    "before its beginning": lambda: plan([ALONG]).replanned(-1),
    "no sharpness": lambda: plan([ALONG]).replanned(1, hold=True, sharpness=0),
    "other axes": lambda: plan([ALONG]).replanned(1, append=piece((1.0,), 1, 1, 1)),
    "chain of other axes": lambda: chain([piece((1.0,), 1, 1, 1), pieces([ALONG])]),
    "no chain": lambda: chain([]),
    "no length": lambda: piece((1.0,), 0, 1, 1),
    "no speed": lambda: piece((1.0,), 1, 0, 1),
    "no acceleration": lambda: piece((1.0,), 1, 1, 0),
    "no end of speed": lambda: piece((1.0,), 1, math.inf, 1),
    "entry below 0": lambda: piece((1.0,), 1, 1, 1, entry=-1),
    "not a number": lambda: piece((math.nan,), 1, 1, 1),
    "finer than sums are exact": lambda: piece((2.0**-17,), 1, 1, 1),
    "too far": lambda: piece((2.0**31,), 1, 1, 1),
    "too many axes": lambda: piece((1.0,) * 9, 1, 1, 1),
    "rows missing": lambda: Pieces(np.ones((2, 1)), np.ones(2), np.ones(1), np.ones(2), np.ones(2), np.ones(2)),
}


@pytest.mark.parametrize("call", REFUSED.values(), ids=REFUSED)
def test_what_is_no_plan_is_refused(call: object) -> None:
    with pytest.raises(ValueError, match=r"\w"):
        call()  # type: ignore[operator]


def test_set_points_that_are_not_there() -> None:
    motion = plan([ALONG])
    for first, last in ((-1, 3), (5, 4), (0, 551)):
        with pytest.raises(IndexError):
            motion.deltas(first, last)
    with pytest.raises(IndexError):
        motion.displacement(-1)


def test_a_plan_can_be_written_down_and_what_is_new_of_it() -> None:
    """Through blocks of thousands of pieces, from the middle on, to the bit."""
    motion = plan([replace(ALONG, way=(50.0, float(j % 3)), length=50, speed=3000) for j in range(3000)])
    stretch = since(motion, 0)
    assert stretch is not None
    known = written(stretch, PERIOD_NS, sine=False)
    for k, factor in ((100, 0.5), (3000, 0.9), (3001, 1.0), (9000, 0.3)):
        motion = motion.replanned(k, scale=factor)
        stretch = since(motion, k)
        assert stretch is not None
        known = written(stretch, PERIOD_NS, sine=False, before=known)
        assert known.ticks == motion.ticks
        assert np.array_equal(known.deltas(0, known.ticks), motion.deltas(0, motion.ticks))
    assert len(stretch.phases) < 2 * (3000 - motion.finished(9000)) + 3
    assert known.replanned(0, scale=0.1) is known


WRONG = {
    "piece that is not there": {"piece": np.array([0, 1], dtype=np.int32)},
    "piece below 0": {"piece": np.array([-1, 0], dtype=np.int32)},
    "backwards in time": {"phases": np.array([[1.0, 1, 0, 1, 1, 1], [0, 1, 0, 1, 1, 1]])},
    "never": {"phases": np.full((2, 6), np.nan)},
    "no corners": {"corner": np.zeros((0, 2))},
    "no length": {"length": np.zeros(1)},
    "no phases": {"phases": np.zeros((0, 6)), "piece": np.zeros(0, dtype=np.int32)},
    "ticks below 0": {"ticks": -1},
    "first below 0": {"first": -1},
}


@pytest.mark.parametrize("wrong", WRONG.values(), ids=WRONG)
def test_what_was_not_written_by_us_is_refused(wrong: dict[str, object]) -> None:
    sound = Stretch(
        0,
        3,
        np.array([[0.0, 1, 0, 1, 1, 1], [1, 1, 0, 1, 1, 1]]),
        np.zeros(2, dtype=np.int32),
        np.zeros((2, 2)),
        np.ones(1),
    )
    written(sound, PERIOD_NS, sine=False)
    written(sound._replace(phases=np.array([[0.0, 1, 0, 1, 1, 1]] * 2)), PERIOD_NS, sine=False)  # one takes no time
    with pytest.raises(ValueError, match="stretch"):
        written(sound._replace(**wrong), PERIOD_NS, sine=False)  # type: ignore[arg-type]


def test_a_stretch_of_another_plan_is_refused() -> None:
    stretch = since(plan([ALONG] * 3), 700)
    assert stretch is not None
    assert stretch.first == 1
    for other in (
        plan([ALONG], sine=True),
        joined(pieces([ALONG] * 3), 1_000_000),
        joined(piece((1.0,), 1, 1, 1), PERIOD_NS),
    ):
        with pytest.raises(ValueError, match="another plan"):
            written(stretch, PERIOD_NS, sine=False, before=other)


# ---- random jobs ---------------------------------------------------------------------------------------------------

ROUNDING = 1 + 1e-6
"""A difference of two set points misses that of the motion by less than one increment: each by half of one."""

parts_of_jobs = st.lists(
    st.builds(
        lambda x, y, speed, acceleration, entry: Part(
            (float(x), float(y)), max(math.hypot(x, y), 1.0), speed, acceleration, entry
        ),
        st.integers(-9000, 9000),
        st.integers(-300, 300),
        st.integers(1000, 50_000),
        st.integers(5000, 500_000),
        st.one_of(st.integers(0, 20_000), st.just(math.inf)),
    ),
    min_size=1,
    max_size=12,
)


def total(parts: Sequence[Part]) -> tuple[int, ...]:
    return tuple(int(sum(axis)) for axis in zip(*(part.way for part in parts), strict=True))


def within_limits(motion: Joined, parts: Sequence[Part], free: Sequence[tuple[int, int]] = ()) -> None:
    """No speed, acceleration or joint is exceeded, as far as set points can tell; free: ticks from .. to between which
    a speed may be too great since the limit has only just fallen."""
    at = places(motion)
    passed = [motion.passed(j) for j in range(motion.pieces + 1)]
    for j, part in enumerate(parts):
        share = np.abs(np.array(part.way)) / part.length
        low, high = passed[j], passed[j + 1]
        inside = at[low:high]  # the ticks at which it is on this piece and no other
        steps = np.abs(np.diff(inside, axis=0))
        fast = [k for k in range(len(steps)) if not any(a <= low + k <= b for a, b in free)]
        assert np.all(steps[fast] <= part.speed * PERIOD_S * share + ROUNDING), j
        change = np.abs(np.diff(inside, 2, axis=0))
        assert np.all(change <= part.acceleration * PERIOD_S**2 * share + 2 * ROUNDING), j
        if j and passed[j] < motion.ticks:
            around = parts[motion.finished(passed[j] - 1) : motion.finished(passed[j]) + 1]
            slope = max(other.acceleration for other in around)
            most = part.entry if free else min(part.entry, part.speed, parts[j - 1].speed)
            for k in (passed[j] - 1, passed[j]):
                assert motion.speed(k) <= most * (1 + 1e-9) + slope * PERIOD_S, j


@settings(max_examples=drawn(60), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans())
def test_no_limit_is_exceeded_and_the_end_is_exact(parts: list[Part], sine: bool) -> None:
    motion = plan(parts, sine)
    assert motion.displacement(motion.ticks) == total(parts)
    assert motion.finished(motion.ticks) == motion.pieces == len(parts)
    within_limits(motion, parts)
    form = law(parts, sine=sine)
    assert motion.duration_s == pytest.approx(float(form.end), abs=1e-7)
    for k in range(0, motion.ticks + 1, max(motion.ticks // 9, 1)):
        expected = displacement(parts, form, mpf(k) * PERIOD_NS / 10**9)
        assert np.all(np.abs(np.array(motion.displacement(k)) - np.array(expected, dtype=float)) <= 0.5 + 1e-4)


@settings(max_examples=drawn(40), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans(), st.integers(1, 400))
def test_windows_of_a_plan_do_not_depend_on_how_they_are_cut(parts: list[Part], sine: bool, size: int) -> None:
    motion = plan(parts, sine)
    whole = motion.deltas(0, motion.ticks)
    size = max(size, motion.ticks // 30)
    cut = [motion.deltas(k, min(k + size, motion.ticks)) for k in range(0, motion.ticks, size)]
    assert np.array_equal(whole, np.vstack(cut) if cut else whole)
    for k in range(0, motion.ticks, size):
        assert motion.displacement(k) == tuple(whole[:k].sum(axis=0, dtype=np.int64))


@settings(max_examples=drawn(40), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans())
def test_mirrored_jobs_mirror(parts: list[Part], sine: bool) -> None:
    mirrored = [replace(part, way=(-part.way[0], part.way[1])) for part in parts]
    there, back = plan(parts, sine), plan(mirrored, sine)
    assert np.array_equal(there.deltas(0, there.ticks) * np.array([-1, 1]), back.deltas(0, back.ticks))


@settings(max_examples=drawn(40), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans(), st.integers(1, 5))
def test_a_chain_that_came_in_bits_is_that_which_came_at_once(parts: list[Part], sine: bool, size: int) -> None:
    at_once, motion = plan(parts, sine), plan(parts[:size], sine)
    for j in range(size, len(parts), size):
        motion = motion.replanned(0, append=pieces(parts[j : j + size]))
    assert np.array_equal(motion.deltas(0, motion.ticks), at_once.deltas(0, at_once.ticks))
    assert motion.duration_s == at_once.duration_s


happenings = st.lists(
    st.tuples(
        st.floats(0.0, 1.0),
        st.one_of(
            st.tuples(st.just("append"), parts_of_jobs),
            st.tuples(st.just("scale"), st.sampled_from([0.0, 0.3, 0.7, 1.0, 1.25])),
            st.tuples(st.just("ceiling"), st.sampled_from([700.0, 5000.0, math.inf])),
            st.tuples(st.just("hold"), st.booleans()),
        ),
    ),
    max_size=6,
)


@settings(max_examples=drawn(120), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans(), happenings)
def test_replanned_motions_keep_what_was_made_and_every_limit(
    parts: list[Part], sine: bool, what: list[tuple[float, tuple[str, object]]]
) -> None:
    motion, k, free = plan(parts, sine), 0, []
    known = written(since(motion, 0), PERIOD_NS, sine=sine)  # type: ignore[arg-type]
    parts = list(parts)
    for part_of_rest, (name, value) in what:
        k += round(part_of_rest * max(motion.ticks - k, 30))
        given_now = pieces(value) if name == "append" else value  # type: ignore[arg-type]
        later = motion.replanned(k, **{name: given_now})  # type: ignore[arg-type]
        parts += value if name == "append" else []  # type: ignore[operator]
        same_until(k, motion, later)
        stretch = since(later, min(k, motion.ticks))
        assert stretch is not None
        known = written(stretch, PERIOD_NS, sine=sine, before=known)
        assert np.array_equal(known.deltas(0, known.ticks), later.deltas(0, later.ticks))
        assert later.speed(k) == pytest.approx(motion.speed(k), abs=1e-6)
        assert later.pieces == len(parts)
        slowest = min(part.acceleration for part in parts) * 2 / math.pi
        free.append((k, k + math.ceil(motion.speed(k) / slowest / PERIOD_S) + 1))
        motion = later
    if motion.held:
        k = max(k, motion.ticks) + 5
        later = motion.replanned(k, hold=False, scale=1.0)
        same_until(k, motion, later)
        motion = later
    within_limits(motion, [replace(part, speed=part.speed * 1.25) for part in parts], free)
    assert motion.displacement(motion.ticks) == total(parts)
    stopped = motion.stopped(k)
    same_until(k, motion, stopped)
    assert stopped.speed(stopped.ticks) == 0
    assert stopped.finished(stopped.ticks) <= stopped.pieces <= motion.pieces


# ---- long chains ---------------------------------------------------------------------------------------------------

SHORT = Part((1000.0, 0.0), 1000, 2_000_000, 6_700_000)
"""0.1 mm at 10 000 increments a mm, 12 m/min, 0.67 m/s^2: it takes 299 of them to reach the speed, or to stop."""


def test_short_pieces_run_at_full_speed_if_enough_of_them_are_known() -> None:
    """10 000 pieces at 1 ms, handed over 20 at a time: as one straight move, as long as 300 are known ahead."""
    some = pieces([SHORT] * 20)
    plan = joined(chain([some] * 20), 1_000_000)
    k = 0
    while plan.pieces < 10_000:
        while plan.finished(k) + 380 < plan.pieces:
            k += 1
        plan = plan.replanned(k, append=some)
    assert plan.duration_s == pytest.approx(10_000_000 / 2e6 + 2e6 / 6.7e6, abs=1e-9)
    assert plan.displacement(plan.ticks) == (10_000_000, 0)
    assert set(plan.deltas(400, 4600)[:, 0]) == {2000}


def test_a_piece_more_leaves_what_is_settled_as_it_is() -> None:
    """What is shared is neither planned nor copied again: all but a block and the braking distance."""
    plan = joined(pieces([SHORT] * 5000), 1_000_000)
    later = plan.replanned(0, append=pieces([SHORT]))
    assert later.blocks[0] is plan.blocks[0]
    assert len(plan.blocks[-1].table) <= 300
    for _ in range(1000):
        later = later.replanned(0, append=pieces([SHORT]))
        assert len(later.blocks[-1].table) <= 300 + 512 + 1
    at_once = joined(pieces([SHORT] * 6001), 1_000_000)
    assert np.array_equal(later.deltas(0, later.ticks), at_once.deltas(0, at_once.ticks))


def test_a_long_chain_is_replanned_from_the_middle() -> None:
    """Ends of blocks, what was appended, and another speed, all at once: still one path, limits kept."""
    parts = [replace(SHORT, way=(1000.0, float(j % 5)), speed=2e6 if j % 900 else 3e5) for j in range(4000)]
    plan = joined(pieces(parts[:2500]), PERIOD_NS)
    plan = plan.replanned(3, append=pieces(parts[2500:]))
    slow = plan.replanned(plan.passed(1700), scale=0.25)
    same_until(plan.passed(1700), plan, slow)
    fast = slow.replanned(slow.passed(3000), scale=1.0)
    same_until(slow.passed(3000), slow, fast)
    assert fast.displacement(fast.ticks) == plan.displacement(plan.ticks) == (4_000_000, 4000 * 2)
    assert fast.speed(fast.passed(2900)) == pytest.approx(0.25 * 2e6)
    passed = [fast.passed(j) for j in range(0, 4001, 50)]
    assert passed == sorted(passed)
    assert np.abs(np.diff(fast.deltas(0, fast.ticks)[:, 0])).max() <= 6.7e6 * PERIOD_S**2 + 2 * ROUNDING


def test_what_is_forgotten_takes_no_room_and_changes_nothing_that_comes() -> None:
    """A path that never stops, 20 pieces at a time, a new beginning every 2000: the same set points, little memory."""
    some = pieces([SHORT] * 20)
    plan = whole = joined(chain([some] * 20), 1_000_000)
    k, most, made = 0, 0, [np.empty((0, 2), dtype=np.int32)]
    while plan.pieces < 20_000:
        while plan.finished(k) + 380 < plan.pieces:
            k += 1
        plan, whole = plan.replanned(k, append=some), whole.replanned(k, append=some)
        most = max(most, plan.known_pieces)
        if plan.known_pieces > 4000:
            made.append(plan.deltas(plan.forgotten, k))
            plan = plan.forgetting(k)
            assert plan.known_pieces < 380 + 20 + 2 * 512
    made.append(plan.deltas(plan.forgotten, plan.ticks))
    assert most <= 4020
    assert len(made) > 5
    assert np.array_equal(np.vstack(made), whole.deltas(0, whole.ticks))


@settings(max_examples=drawn(100), deadline=None, derandomize=True)
@given(parts_of_jobs, st.booleans(), happenings, st.randoms(use_true_random=False))
def test_a_plan_that_forgets_goes_on_like_one_that_does_not(
    parts: list[Part], sine: bool, what: list[tuple[float, tuple[str, object]]], chance: random.Random
) -> None:
    monkey = pytest.MonkeyPatch()
    with monkey.context() as patched:
        patched.setattr("isel_twin.motion.blocks.BLOCK", 2)  # blocks end everywhere
        motion = plan(parts * 5, sine)
        short, k = motion, 0
        for part_of_rest, (name, value) in what:
            k += round(part_of_rest * max(motion.ticks - k, 30))
            given_now = pieces(value) if name == "append" else value  # type: ignore[arg-type]
            if chance.random() < 0.7:
                short = short.forgetting(k)
            motion = motion.replanned(k, **{name: given_now})  # type: ignore[arg-type]
            short = short.replanned(k, **{name: given_now})  # type: ignore[arg-type]
            assert short.ticks == motion.ticks
            if k <= motion.ticks:
                assert np.array_equal(short.deltas(k, motion.ticks), motion.deltas(k, motion.ticks))
            ticks = sorted({k, *(chance.randint(k, max(k, motion.ticks)) for _ in range(5))})
            assert [short.finished(n) for n in ticks] == [motion.finished(n) for n in ticks]
            assert [short.speed(n) for n in ticks] == [motion.speed(n) for n in ticks]
            assert [short.displacement(n) for n in ticks] == [motion.displacement(n) for n in ticks]
            later = range(motion.finished(k) + 1, motion.finished(motion.ticks) + 1)
            assert [short.passed(j) for j in later] == [motion.passed(j) for j in later]
            stretch, same = since(short, k), since(motion, k)
            assert stretch is not None
            assert same is not None
            assert all(np.array_equal(a, b) for a, b in zip(stretch, same, strict=True))
        if motion.held:
            rest, same_rest = short.remainder(1), motion.remainder(1)
            assert np.array_equal(rest.deltas(0, rest.ticks), same_rest.deltas(0, same_rest.ticks))


def test_what_is_forgotten_cannot_be_asked() -> None:
    plan = joined(pieces([SHORT] * 3000), 1_000_000).forgetting(1500)
    assert plan.displacement(1500)[0] > 1_000_000
    for ask in (
        lambda: plan.displacement(1499),
        lambda: plan.deltas(1499, 1510),
        lambda: plan.forgetting(1499),
        lambda: plan.passed(1),
    ):
        with pytest.raises(IndexError):
            ask()


def test_a_day_is_described_and_not_stored() -> None:
    """2 x 10^7 set points in a few kilobytes, each found without those before it."""
    plan = joined(piece((25_000_000.0, 7.0), 25_000_000, 25_000_000 / 86_400, 50_000), PERIOD_NS)
    assert plan.ticks > 21_600_000
    assert len(pickle.dumps(plan)) < 4000
    assert plan.displacement(10_800_001)[0] == pytest.approx(12_500_000, abs=2)
    assert len(plan.deltas(20_000_000, 20_000_100)) == 100
