"""Random programs on the control, against a second opinion on where they lead (`draughtsman`).

The control runs each program on the desk: linear or sin^2 ramps, single block, stop and start, other overrides on the
way. Its set points, one every 2 ms, are held against the drawn path:

    place     within TOLERANCE of the path, in its order, and at the end of it
    speed     of an axis over m ticks:      |x(k+m) - x(k)|             <= V m T + 2 E
    ramps     of an axis over 2 m ticks:    |x(k+m) - 2 x(k) + x(k-m)|  <= A (m T)^2 + J m T + 4 E
    corners   J = sum over the corners in those ticks of  v_corner |change of direction|,
              v_corner = the lower feed (`f`, too) x cos(change of direction)^P8851, 0 where it stops;
              and m ticks before and behind each it is no further than  v_corner m T + a (m T)^2 / 2,
              a = min(A / |direction|), along the path

V, A: P12004, P12004 / P12008, or P12009 where that is longer and it is no G00; sin^2 ramps are pi/2 steeper. E is 1 um:
the ends of pieces are rounded to an increment, and so is a place between them; each is half an increment at most.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import pytest
from conformance.bwo900_desk import REFERENCE, file, parameters, said, start, value
from firmware.bwo900.draughtsman import CORNER_EXPONENTS, SAGITTA, ZERO_POINTS, Curve, Draughtsman, programs
from firmware.bwo900.retold import retold
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.testing import Desk, switches
from tests.thorough import drawn

pytestmark = pytest.mark.long(seconds=6)

T_S = 0.002
EMPTY_S = 0.0015
"""A block without a path (bwo900/35)."""
E_MM = 1e-3
SPEED = np.array([100.0, 80.0, 60.0])
RAMP_MS, PATH_RAMP_MS = np.array([200.0, 250.0, 200.0]), np.array([0.0, 400.0, 100.0])
"""P12008, P12009: the latter counts where it is longer."""
TOLERANCE_MM = math.sqrt(3.0) * E_MM + SAGITTA + 1e-4
"""Two roundings of half an increment for each of three axes; chords of the drawing; six decimals in the programs."""
MOST_S = 600.0
FAR = switches((10_000_000,) * 3)


@dataclass(frozen=True)
class Done:
    """What a desk has made of a program."""

    stretches: list[NDArray[np.float64]]
    """Places after each tick, mm [n, 3], of each stretch of time without a gap; the first row is where it began."""
    messages: list[int]

    @property
    def places(self) -> NDArray[np.float64]:
        return np.concatenate(self.stretches)


def desk_with(drawn: Draughtsman, corner: float, sine: bool, even: bool = False) -> Desk:
    """A control with this program, its axes at 0, far from all switches. even: all axes are alike."""
    desk = Desk.of("bwo900", carriage=(2_000,) * 3, position_switches=FAR)
    values: dict[str, float] = {"p8851": corner, "p8858": 0 if drawn.rapid_stops else 2}
    values["p8859"] = 2 if drawn.shift_first else 0
    for axis in range(3):
        values[f"p{12_004 + 200 * axis}"] = 60.0 * (60.0 if even else SPEED[axis])
        values[f"p{12_008 + 200 * axis}"] = 200.0 if even else RAMP_MS[axis]
        values[f"p{12_009 + 200 * axis}"] = 0.0 if even else PATH_RAMP_MS[axis]
        values[f"p{12_010 + 200 * axis}"] = float(sine)
        for g, point in ZERO_POINTS.items():
            values[f"p{20_003 + 3 * (g - 54) + axis}"] = point[axis]
    for name, lines in {"P1": drawn.lines, **drawn.called}.items():
        desk.send(file(name, *lines))
    desk.send(file("P2", "N10 G0 X0 Y0 Z0", "N20 M30"))
    desk.send(parameters(**{f"p{12_040 + 200 * axis}": -1_500.0 for axis in range(3)}))
    desk.send(REFERENCE)
    desk.finish()
    desk.send(parameters(**{f"p{12_004 + 200 * axis}": 1e6 for axis in range(3)}))  # there soon
    start(desk, 2)
    desk.finish()
    desk.send(parameters(p8683=1, **values))
    return desk


def made(desk: Desk, first: int) -> Done:
    """What has been made since `first`, from 0."""
    steps = desk.steps_since(first)
    places = np.cumsum(np.vstack([np.zeros((1, 3)), steps.delta[:, :3]]), axis=0) / 1000.0
    gaps = np.flatnonzero(np.diff(steps.t_ns) != 2_000_000) + 1
    ends = [0, *gaps.tolist(), len(steps.t_ns)]
    return Done([places[a : b + 1] for a, b in pairwise(ends)], said(desk))


def ran(drawn: Draughtsman, corner: float = 1.0, sine: bool = False, even: bool = False) -> Done:
    desk = desk_with(drawn, corner, sine, even)
    first = desk.ticks
    start(desk)
    desk.finish(MOST_S)
    return made(desk, first)


# ---- the drawn path --------------------------------------------------------------------------------------------------


class Way:
    """The drawn path by its length: chords, and what belongs to each."""

    def __init__(self, drawn: Draughtsman, corner: float, sine: bool, even: bool = False) -> None:
        curves = drawn.curves
        self.curves, self.corner = curves, corner
        self.corners = np.concatenate([curves[0].points[:1], *(curve.points[1:] for curve in curves)])
        lengths = np.linalg.norm(np.diff(self.corners, axis=0), axis=1)
        self.at = np.concatenate([[0.0], np.cumsum(lengths)])
        ends = np.cumsum([len(curve.points) - 1 for curve in curves])
        self.joint_at = self.at[ends[:-1]]
        speed = np.full(3, 60.0) if even else SPEED
        rapid = speed / ((200.0 if even else RAMP_MS) * 1e-3)
        path = speed / ((200.0 if even else np.maximum(RAMP_MS, PATH_RAMP_MS)) * 1e-3)
        self.steeper = steeper = math.pi / 2.0 if sine else 1.0
        self.speed = speed
        self.feed = np.array([self._feed(curve, speed.max()) for curve in curves])
        self.able = np.array([steeper * (rapid if curve.feed is None else path) for curve in curves])
        self.ends_at = self.at[ends]
        pairs = list(pairwise(zip(curves, self.feed, self.able, strict=True)))
        self.passed = np.array([self._passed(a, b, min(fa, fb), corner) for (a, fa, _), (b, fb, _) in pairs])
        turns = np.array([np.abs(b.begin - a.end) for (a, _, _), (b, _, _) in pairs]).reshape(len(pairs), 3)
        self.jump = self.passed[:, None] * turns
        self.before = np.array([float(np.min(able / np.maximum(np.abs(a.end), 1e-9))) for (a, _, able), _ in pairs])
        self.behind = np.array([float(np.min(able / np.maximum(np.abs(b.begin), 1e-9))) for _, (b, _, able) in pairs])

    @staticmethod
    def _feed(curve: Curve, rapid: float) -> float:
        """Path speed, mm/s: rapid belongs to the axis with the longest way."""
        return float(rapid / np.abs(curve.begin).max()) if curve.feed is None else curve.feed / 60.0

    @staticmethod
    def _passed(a: Curve, b: Curve, feed: float, corner: float) -> float:
        """The highest speed at a joint, mm/s."""
        cosine = min(max(float(a.end @ b.begin), 0.0), 1.0)
        feed = feed if a.end_feed is None else min(feed, a.end_feed / 60.0)
        return 0.0 if a.stops else feed * cosine**corner

    def seconds(self) -> float:
        """How long it moves at the highest speeds that feeds, axes, ramps and corners allow (bwo900/14, bwo900/15).
        sin^2 ramps take as long as linear ones."""
        able = self.able / self.steeper
        laws = [self._law(*one) for one in zip(self.curves, self.feed, able, strict=True)]
        ways = [curve.length_mm for curve in self.curves]
        speeds = [0.0]
        for (a, (first, _)), (b, (second, _)) in pairwise(zip(self.curves, laws, strict=True)):
            speeds.append(self._passed(a, b, min(first, second), self.corner))
        speeds.append(0.0)
        for n in reversed(range(len(ways))):
            speeds[n] = min(speeds[n], math.sqrt(speeds[n + 1] ** 2 + 2.0 * laws[n][1] * ways[n]))
        took = 0.0
        for n, (way, (most, able)) in enumerate(zip(ways, laws, strict=True)):
            speeds[n + 1] = min(speeds[n + 1], math.sqrt(speeds[n] ** 2 + 2.0 * able * way))
            squares = speeds[n] ** 2 + speeds[n + 1] ** 2
            peak = min(most, math.sqrt(able * way + squares / 2.0))
            took += (2.0 * peak - speeds[n] - speeds[n + 1]) / able
            took += max(way - (peak**2 - squares / 2.0) / able, 0.0) / peak
        return took

    def _law(self, curve: Curve, feed: float, able: NDArray[np.float64]) -> tuple[float, float]:
        """Highest speed, mm/s, and acceleration, mm/s^2, along a curve."""
        shares = np.maximum(np.abs(curve.begin), 1e-12)
        if curve.circle is None:
            return min(feed, float(np.min(self.speed / shares))), float(np.min(able / shares))
        u, v, radius = curve.circle
        w = 3 - u - v
        flat, across = math.hypot(shares[u], shares[v]), math.sqrt(0.5) * min(able[u], able[v])
        speed = min(feed, min(self.speed[u], self.speed[v]) / flat, math.sqrt(across * radius) / flat)
        return min(speed, self.speed[w] / shares[w]), min(across / flat, able[w] / shares[w])

    def follow(self, places: NDArray[np.float64], reach: float) -> NDArray[np.float64]:
        """How far along the path each place is, at least: the first point from the last one on that is near enough.

        Raises AssertionError for a place that leaves the path.
        """
        here, chord, found = 0.0, 0, np.empty(len(places))
        for k, place in enumerate(places):
            while chord < len(self.at) - 2 and self.at[chord + 1] <= here - 1e-9:
                chord += 1
            last = min(int(np.searchsorted(self.at, here + reach)) + 1, len(self.at) - 1)
            a, way = self.corners[chord:last], np.diff(self.corners[chord : last + 1], axis=0)
            length = np.diff(self.at[chord : last + 1])
            share = ((place - a) * way).sum(axis=1) / np.maximum(length, 1e-12) ** 2
            low = np.clip((here - self.at[chord:last]) / np.maximum(length, 1e-12), 0.0, 1.0)
            share = np.clip(share, low, 1.0)
            off = np.linalg.norm(place - a - share[:, None] * way, axis=1)
            near = np.flatnonzero(off <= TOLERANCE_MM)
            assert len(near), f"tick {k}: {place} is {off.min():.5f} mm off the path, at {here:.3f} mm of it"
            here = float(self.at[chord + near[0]] + share[near[0]] * length[near[0]])
            found[k] = here
        return found

    def bounds(
        self, along: NDArray[np.float64]
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.float64]]:
        """Of each tick: acceleration and sum of jumps up to here, each axis; feed. `along` may lag by SLACK."""
        curve = np.minimum(np.searchsorted(self.ends_at, along - SLACK_MM), len(self.feed) - 1)
        later = np.minimum(np.searchsorted(self.ends_at, along + SLACK_MM), len(self.feed) - 1)
        able = np.maximum(self.able[curve], self.able[later])
        feed = np.maximum(self.feed[curve], self.feed[later])
        return able, feed

    def check_joints(self, s: NDArray[np.float64]) -> None:
        """One stretch of time passes each of its joints no faster than allowed. s: how far along, each tick."""
        around = (*self.joint_at, self.at[-1])
        for n, joint in enumerate(self.joint_at):
            if not s[0] - TOLERANCE_MM <= joint <= s[-1] + TOLERANCE_MM:
                continue
            later = min(int(np.searchsorted(s, joint + TOLERANCE_MM, side="right")), len(s) - 1)
            sooner = max(int(np.searchsorted(s, joint, side="left")) - 1, 0)
            for m in (2, 5, 12):
                i, k = max(later - m, 0), min(sooner + m, len(s) - 1)
                if s[i] >= (around[n - 1] if n else 0.0):
                    assert joint - s[i] <= self._nearest(n, self.before[n], m), f"before joint {n}, {joint:.3f} mm"
                if s[k] <= around[n + 1]:
                    assert s[k] - joint <= self._nearest(n, self.behind[n], m), f"behind joint {n}, {joint:.3f} mm"

    def _nearest(self, joint: int, able: float, m: int) -> float:
        """How far from the joint m ticks lead, mm. The tick nearest to it may be 2 TOLERANCE_MM away, and faster."""
        speed = math.sqrt(self.passed[joint] ** 2 + 4.0 * able * TOLERANCE_MM)
        return speed * m * T_S + able * (m * T_S) ** 2 / 2.0 + 3.0 * TOLERANCE_MM


SLACK_MM = 0.02
"""By which `follow` may be behind: near a joint that turns by a small angle both sides are near enough."""


def check(
    done: Done,
    drawn: Draughtsman,
    corner: float,
    sine: bool,
    percent: float = 100.0,
    even: bool = False,
    whole: bool = True,
) -> None:
    """All that must hold; see the module. whole: the program has come to its end."""
    assert done.messages == []
    way = Way(drawn, corner, sine, even)
    along = way.follow(done.places, reach=2.0 * float(np.linalg.norm(way.speed)) * T_S)
    if whole:
        assert along[-1] > way.at[-1] - 2.0 * SLACK_MM
        assert np.abs(done.places[-1] - drawn.place).max() <= 0.55 * E_MM
    total = np.vstack([np.zeros(3), np.cumsum(way.jump, axis=0)])
    at = 0
    for stretch in done.stretches:
        mine = along[at : at + len(stretch)]
        at += len(stretch)
        way.check_joints(mine)
        able, feed = way.bounds(mine)
        for m in (1, 3, 12, 40):
            padded = np.vstack([np.repeat(stretch[:1], 2 * m, axis=0), stretch, np.repeat(stretch[-1:], 2 * m, axis=0)])
            s = np.concatenate([np.repeat(mine[:1], 2 * m), mine, np.repeat(mine[-1:], 2 * m)])
            a = np.vstack([np.repeat(able[:1], 2 * m, axis=0), able, np.repeat(able[-1:], 2 * m, axis=0)])
            f = np.concatenate([np.repeat(feed[:1], 2 * m), feed, np.repeat(feed[-1:], 2 * m)])
            ways = padded[m:] - padded[:-m]
            assert (np.abs(ways) <= way.speed * m * T_S + 2.0 * E_MM + 1e-9).all()
            fastest = sliding(f, m + 1) * max(percent, 100.0) / 100.0
            assert (np.linalg.norm(ways, axis=1) <= fastest * m * T_S + 2.0 * math.sqrt(3.0) * E_MM + 1e-9).all()
            second = np.abs(ways[m:] - ways[:-m])
            first = np.searchsorted(way.joint_at, s[: -2 * m] - SLACK_MM, side="left")
            last = np.searchsorted(way.joint_at, s[2 * m :] + SLACK_MM, side="right")
            jumps = total[last] - total[first]
            most = np.stack([sliding(a[:, axis], 2 * m + 1) for axis in range(3)], axis=1)
            bound = most * (m * T_S) ** 2 + jumps * m * T_S + 4.0 * E_MM + 1e-9
            if not (second <= bound).all():
                worst = np.unravel_index(np.argmax(second - bound), second.shape)
                raise AssertionError(
                    f"axis {worst[1]} over {m} ticks: {second[worst]:.4f} mm, allowed {bound[worst]:.4f}, at "
                    f"{s[worst[0] + m]:.3f} of {way.at[-1]:.3f} mm, joints at {way.joint_at}"
                )


def sliding(values: NDArray[np.float64], count: int) -> NDArray[np.float64]:
    """The largest of each `count` values in a row."""
    return np.lib.stride_tricks.sliding_window_view(values, count).max(axis=1)


exponents = st.sampled_from(CORNER_EXPONENTS)


@given(programs(), exponents, st.booleans())
@settings(max_examples=drawn(12), deadline=None, derandomize=True)
def test_set_points_keep_to_path_speeds_ramps_and_corners(drawn: Draughtsman, corner: float, sine: bool) -> None:
    check(ran(drawn, corner, sine), drawn, corner, sine)


some_blocks = programs(14, least=7).filter(lambda drawn: 8 <= len(drawn.lines) <= 22)


@given(some_blocks.flatmap(retold), exponents, st.booleans())
@settings(max_examples=drawn(10), deadline=None, derandomize=True)
def test_programs_of_8_to_22_blocks_in_other_words_take_the_drawn_path_and_time(
    drawn: Draughtsman, corner: float, sine: bool
) -> None:
    """It moves as long as that takes within 0.01 %, and at each standstill what is left of a tick; there it dwells, and
    blocks without a path take their time."""
    desk = desk_with(drawn, corner, sine)
    first = desk.ticks
    start(desk)
    desk.finish(MOST_S)
    done = made(desk, first)
    check(done, drawn, corner, sine)
    way, t_ns = Way(drawn, corner, sine), desk.steps_since(first).t_ns
    moved = T_S * sum(len(stretch) - 1 for stretch in done.stretches)
    stood = T_S + (t_ns[-1] - t_ns[0]) / 1e9 - moved
    rest = T_S * (1 + np.count_nonzero(way.passed == 0.0))
    assert 0.9999 * way.seconds() <= moved <= 1.0001 * way.seconds() + rest
    dwells = sum(curve.dwell_s for curve in drawn.curves[:-1])
    blocks = sum(map(len, (drawn.lines, *drawn.called.values())))
    assert dwells - 1e-9 <= stood <= dwells + EMPTY_S * blocks + rest


@given(programs(most=5), exponents, st.booleans())
@settings(max_examples=drawn(6), deadline=None, derandomize=True)
def test_in_single_block_too(drawn: Draughtsman, corner: float, sine: bool) -> None:
    desk = desk_with(drawn, corner, sine)
    first = desk.ticks
    start(desk, mode=4)
    for _ in range(4 * len(drawn.lines)):
        desk.finish(MOST_S)
        if value(desk, 8685) == 0.0:
            break
        desk.send(parameters(p8684=1))
    check(made(desk, first), drawn, corner, sine)


waits = st.lists(st.integers(1, 2500), min_size=1, max_size=5)


@given(programs(most=6), exponents, st.booleans(), waits)
@settings(max_examples=drawn(8), deadline=None, derandomize=True)
def test_stop_and_start_on_the_way(drawn: Draughtsman, corner: float, sine: bool, waits: list[int]) -> None:
    """Stopped after some ms, and started again when it stands, or at once."""
    desk = desk_with(drawn, corner, sine)
    first = desk.ticks
    start(desk)
    for number, wait in enumerate(waits):
        desk.run(wait * 1e-3)
        if value(desk, 8685) == 0.0:
            break
        desk.send(parameters(p8682=1))
        desk.run(1.0 if number % 2 else wait * 1e-4)
        desk.send(parameters(p8682=2))
    desk.finish(MOST_S)
    check(made(desk, first), drawn, corner, sine)


@given(programs(most=6), exponents, st.booleans(), waits, st.data())
@settings(max_examples=drawn(8), deadline=None, derandomize=True)
def test_other_overrides_on_the_way(
    drawn: Draughtsman, corner: float, sine: bool, waits: list[int], data: st.DataObject
) -> None:
    desk = desk_with(drawn, corner, sine)
    first = desk.ticks
    start(desk)
    for wait in waits:
        desk.run(wait * 1e-3)
        desk.send(parameters(p11310=data.draw(st.sampled_from([0, 5, 30, 80, 100, 120]))))
    desk.run(0.5)
    desk.send(parameters(p11310=110))
    desk.finish(MOST_S)
    check(made(desk, first), drawn, corner, sine, percent=120.0)


@given(programs(most=6), exponents, st.booleans(), st.integers(1, 4000))
@settings(max_examples=drawn(6), deadline=None, derandomize=True)
def test_abort_brakes_on_the_path(drawn: Draughtsman, corner: float, sine: bool, wait: int) -> None:
    desk = desk_with(drawn, corner, sine)
    first = desk.ticks
    start(desk)
    desk.run(wait * 1e-3)
    desk.send(parameters(p8705=1))
    desk.finish(MOST_S)
    assert value(desk, 8685) == 0.0
    check(made(desk, first), drawn, corner, sine, whole=False)


# ---- mirrored and turned ---------------------------------------------------------------------------------------------

plain = programs(most=6, frames=False)


def with_head(drawn: Draughtsman, words: str) -> Draughtsman:
    """The same program behind a block of these words; what it draws stays."""
    return replace(drawn, lines=[f"N1 {words}", *drawn.lines])


def carried(drawn: Draughtsman, matrix: NDArray[np.float64]) -> Draughtsman:
    """The drawn path, carried by a matrix [3, 3]."""
    curves = [replace(c, points=c.points @ matrix.T, begin=matrix @ c.begin, end=matrix @ c.end) for c in drawn.curves]
    return replace(drawn, curves=curves, place=matrix @ drawn.place)


@given(plain, st.sampled_from(["G61", "G62", "G61 G62"]), st.booleans())
@settings(max_examples=drawn(6), deadline=None, derandomize=True)
def test_a_mirrored_program_has_mirrored_set_points(drawn: Draughtsman, mirror: str, sine: bool) -> None:
    """One for one: rounding is the same to both sides, so that only places on the very middle may differ."""
    signs = np.array([-1.0 if "61" in mirror else 1.0, -1.0 if "62" in mirror else 1.0, 1.0])
    as_it_is, mirrored = ran(drawn, sine=sine), ran(with_head(drawn, mirror), sine=sine)
    assert as_it_is.messages == mirrored.messages == []
    assert as_it_is.places.shape == mirrored.places.shape
    assert np.abs(as_it_is.places * signs - mirrored.places).max() <= E_MM + 1e-9


@given(plain, st.sampled_from([90.0, 180.0, -90.0, 450.0]), st.booleans())
@settings(max_examples=drawn(6), deadline=None, derandomize=True)
def test_a_program_turned_by_quarters_has_turned_set_points(drawn: Draughtsman, angle: float, sine: bool) -> None:
    """One for one, where all axes can do the same."""
    as_it_is = ran(drawn, sine=sine, even=True)
    turned = ran(with_head(drawn, f"G45 P160:0 P161:0 P163:{angle}"), sine=sine, even=True)
    assert as_it_is.places.shape == turned.places.shape
    assert np.abs(as_it_is.places @ turn(angle).T - turned.places).max() <= E_MM + 1e-9


@given(plain, st.integers(-3600, 3600), st.booleans())
@settings(max_examples=drawn(6), deadline=None, derandomize=True)
def test_a_turned_program_keeps_to_the_turned_path(drawn: Draughtsman, tenths: int, sine: bool) -> None:
    """And to all limits: the axes share the path otherwise."""
    done = ran(with_head(drawn, f"G45 P160:0 P161:0 P163:{tenths / 10.0}"), sine=sine)
    check(done, carried(drawn, turn(tenths / 10.0)), 1.0, sine)


def turn(angle: float) -> NDArray[np.float64]:
    """About Z, degrees."""
    c, s = math.cos(math.radians(angle)), math.sin(math.radians(angle))
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])
