"""Set points: commands led evenly from tick to tick in both plants, against exact arithmetic."""

from __future__ import annotations

from fractions import Fraction

import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

from isel_twin.machine import load_machine, with_overrides
from isel_twin.plant import Plant, Threshold
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant
from tests.thorough import drawn

from . import told
from .conftest import MS, NONE, ticks

START_MM = (100.0, 100.0, 30.0)
STEP_MM = Fraction(5, 1600)
SUBSTEP = 25_000
PERIOD = 4 * MS
BOTH = pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])


def build(kind: type = KinematicPlant, thresholds=(), axes: int = 4) -> Plant:
    return kind(load_machine("4030"), thresholds, np.array(START_MM), axes)


def points(*changes: int, axis: int = 0, axes: int = 4) -> np.ndarray:
    """int32 [n, axes]: set points of one axis."""
    delta = np.zeros((len(changes), axes), dtype=np.int32)
    delta[:, axis] = changes
    return delta


def of_x(job: list[told.Tick]) -> list[tuple[int, tuple[int, ...], int]]:
    return [(t, (change, 0, 0, 0), lead) for t, change, lead in job]


# --- the kinematic plant ---------------------------------------------------------------------------------------------

CHANGES = [40, 400, -90, 0, 1, -351]
TIMES = PERIOD * np.arange(1, 7, dtype=np.int64)


@pytest.mark.parametrize(
    "t_ms", [0, 3.999999, 4, 4.000001, 5, 7.3, 8, 9.123457, 12, 17, 23.9, 24, 26, 27.999999, 28, 90]
)
def test_set_points_on_time_are_a_sum_of_ramps(t_ms):
    t = round(t_ms * MS)
    plant = build()
    made = int(np.searchsorted(TIMES, t, side="right"))
    assert plant.advance(t, TIMES[:made], points(*CHANGES)[:made], PERIOD) == t
    share = np.clip((t - TIMES) / PERIOD, 0.0, 1.0)
    assert plant.command[0] == pytest.approx(share @ CHANGES, abs=1e-9)
    assert plant.position_mm[0] == pytest.approx(100.0 + share @ CHANGES / 320, abs=1e-11)
    assert plant.commanded.tolist() == [sum(CHANGES[:made]), 0, 0, 0]
    led = 4 * MS <= t < 28 * MS
    assert plant.velocity_mm_s[0] == pytest.approx(CHANGES[made - 1] / 320 / 0.004 if led else 0.0)
    assert plant.at_rest == (not led or made == 4), "the fourth changes nothing"


@BOTH
def test_an_axis_without_a_carriage_is_where_it_is_told_to_be(kind):
    plant = build(kind, axes=6)
    plant.advance(5 * MS, np.array([PERIOD]), points(80, axis=5, axes=6), PERIOD)
    assert plant.command.tolist() == [0, 0, 0, 0, 0, 20]
    assert plant.rotor[3:].tolist() == [0, 0, 20]
    assert plant.lag[3:].tolist() == [0, 0, 0]
    assert plant.commanded.tolist() == [0, 0, 0, 0, 0, 80]
    assert not plant.at_rest


@BOTH
@pytest.mark.parametrize("axes", [1, 2, 3, 8])
def test_a_controller_has_as_many_axes_as_it_likes(kind, axes):
    plant = build(kind, axes=axes)
    plant.advance(9 * MS, np.array([PERIOD]), np.full((1, axes), 16, dtype=np.int32), PERIOD)
    plant.advance(10 * MS, np.array([9 * MS + 1]), np.ones((1, axes), dtype=np.int8))
    assert plant.commanded.tolist() == [17] * axes
    assert plant.command.tolist() == [17.0] * axes
    for several in (plant.rotor, plant.lag, plant.powered, plant.fault, plant.slip_steps):
        assert several.shape == (axes,)


SLOT = 1 << 17
"""ns; times and leads in these and few ticks keep every command a number with 53 bits, so that plants are exact."""
jobs = st.lists(
    st.tuples(st.integers(1, 40), st.integers(-500, 500), st.sampled_from([0, 8, 16, 32])), min_size=1, max_size=8
).map(
    lambda gaps: [
        (SLOT * sum(gap for gap, _, _ in gaps[: k + 1]), change, SLOT * lead)
        for k, (_, change, lead) in enumerate(gaps)
    ]
)
"""Ticks with and without lead; many come before the lead of the one before is over."""


@given(jobs, st.lists(st.integers(0, 50 * MS), max_size=5))
@settings(deadline=None, max_examples=drawn(200))
@example([(4 * SLOT, 80, 32 * SLOT), (5 * SLOT, 1, 0), (6 * SLOT, -7, 8 * SLOT)], [6 * SLOT])
def test_any_ticks_are_led_as_defined(job, looks):
    """No jump but those of steps, what is left of a lead is taken along, and all of it arrives."""
    for t in (*looks, 60 * MS):
        plant = build()
        assert told.drive(plant, of_x([tick for tick in job if tick[0] <= t]), t) == []
        assert plant.command[0] == pytest.approx(float(told.command(job, t)), rel=1e-15)
        assert plant.commanded[0] == sum(change for at, change, _ in job if at <= t)
    assert plant.command[0] == plant.commanded[0]
    assert plant.at_rest


def test_steps_within_a_lead_are_made_at_once_and_the_lead_goes_on():
    """80 led over 4 ms from 4 ms on, four steps from 5 ms on, 0.1 ms apart: at 5.4 ms 28 and 4."""
    plant = build()
    plant.advance(5 * MS, np.array([PERIOD]), points(80), PERIOD)
    plant.advance(5 * MS + 400_000, 5 * MS + 100_000 * np.arange(1, 5, dtype=np.int64), ticks(4, 1))
    assert plant.command[0] == 28 + 4
    assert not plant.at_rest
    plant.advance(8 * MS - 1, *NONE)
    assert plant.command[0] == pytest.approx(84 - 80 / PERIOD, rel=1e-15)
    plant.advance(8 * MS, *NONE)
    assert plant.command[0] == 84
    assert plant.at_rest


def test_a_tick_without_a_change_leaves_the_lead_alone():
    plant = build()
    delta = points(80, 0)
    delta[1, 1] = 5
    plant.advance(5 * MS, np.array([PERIOD, PERIOD + 500_000]), delta, PERIOD)
    assert plant.command.tolist() == [20, 5 / 8, 0, 0]
    plant.advance(8 * MS, *NONE)
    assert plant.command[0] == 80


def test_a_switch_is_struck_at_the_first_nanosecond_beyond_its_trip_point():
    """80 steps a period of 4 ms: 1 mm, 320 steps, is reached at 20 ms; one nanosecond later the carriage is beyond.

    Free again 0.25 mm before, at 240 steps: on the way back, from 28 ms on, that is at 36 ms, and standing there is
    enough.
    """
    plant = build(thresholds=[Threshold(0, "position", limit=101.0, hysteresis=0.25)])
    delta = points(*[80] * 6, *[-80] * 6)
    times = PERIOD * np.arange(1, 13, dtype=np.int64)
    assert plant.advance(90 * MS, times, delta, PERIOD) == 20 * MS + 1
    assert plant.trips().tolist() == [True]
    assert plant.commanded[0] == 400, "the tick at 20 ms has been made"
    assert plant.command[0] == pytest.approx(320 + 80 / PERIOD, rel=1e-15)
    assert plant.advance(90 * MS, times[5:], delta[5:], PERIOD) == 40 * MS
    assert plant.trips().tolist() == [False]
    assert plant.command[0] == 240
    assert plant.advance(90 * MS, times[10:], delta[10:], PERIOD) == 90 * MS


def test_of_several_switches_the_first_one_counts():
    """Within one period from 4 ms on: Y is 5 of 40 steps away, X 5 of 20."""
    thresholds = [
        Threshold(0, "position", limit=100.0 - 5 / 320, sense=-1, hysteresis=0.1),
        Threshold(1, "position", limit=100.0 + 5 / 320, sense=1, hysteresis=0.1),
    ]
    plant = build(thresholds=thresholds)
    edges = told.drive(plant, [(PERIOD, (-20, 40, 0, 0), PERIOD)], 9 * MS)
    assert [passed for _, passed in edges] == [(False, True), (True, True)]
    assert [at for at, _ in edges] == pytest.approx([4_500_000, 5_000_000], abs=1)


@given(jobs, st.integers(-30, 30), st.sampled_from([-1, 1]), st.sampled_from([0.0, 0.125, 0.25]))
@settings(deadline=None, max_examples=drawn(300))
def test_every_edge_falls_on_its_nanosecond(job, eighths, sense, hysteresis):
    """Trip points at multiples of 0.125 mm, 40 steps: standing exactly there and passing through both occur."""
    plant = build(thresholds=[Threshold(0, "position", 100.0 + eighths / 8, sense, hysteresis)])
    expected = told.edges(job, Fraction(40 * eighths), sense, Fraction(hysteresis) / STEP_MM)
    edges = told.drive(plant, of_x(job), 60 * MS)
    assert [(at, passed[0]) for at, passed in edges] == expected


@given(
    st.lists(st.sampled_from([1, 1, 1, -1, 2, -2, 0]), max_size=150),
    st.sampled_from([-5.5, -3.0, 0.0, 2.0, 4.25, 7.0]),
    st.sampled_from([-1, 1]),
    st.sampled_from([0, 1, 3]),
)
@settings(deadline=None, max_examples=drawn(300))
def test_every_edge_of_steps_falls_on_its_tick(changes, limit, sense, hysteresis):
    """Trip points on a step and between two, single and double steps, of 2^-8 mm so that nothing is rounded."""
    machine = with_overrides(load_machine("4030"), {"axes.all.lead": 1600 / 256})
    threshold = Threshold(0, "position", 100.0 + limit / 256, sense, hysteresis / 256)
    plant = KinematicPlant(machine, [threshold], np.array(START_MM))
    job = [(1000 * (k + 1), change, 0) for k, change in enumerate(changes)]
    edges = told.drive(plant, of_x(job), MS)
    assert [(at, passed[0]) for at, passed in edges] == told.edges(job, Fraction(limit), sense, Fraction(hysteresis))
    assert plant.commanded[0] == sum(changes)


@pytest.mark.parametrize("lead_ns", [0, 1000])
def test_ticks_of_one_instant_are_made_together(lead_ns):
    """There and back at once strikes nothing; there and on does, and both ticks have been made."""
    plant = build(thresholds=[Threshold(0, "position", 100.00207, 1, 0.0)])
    assert plant.advance(MS, np.array([9, 9]), ticks(2, 1) * np.array([[1], [-1]], dtype=np.int8), lead_ns) == MS
    at = plant.advance(2 * MS, MS + np.array([9, 9, 50_000]), ticks(3, 1), lead_ns)
    assert at == MS + 9 + (0 if lead_ns == 0 else 332)  # 0.6624 of two steps in 1000 ns
    assert plant.commanded[0] == 2


@pytest.mark.parametrize("change", [100, -100])
def test_a_trip_point_that_passes_the_carriage_counts_from_the_next_nanosecond(change):
    """Whichever way the carriage is going."""
    plant = build(thresholds=[Threshold(0, "position", 105.0, 1, 0.1)])
    plant.advance(5 * MS, np.array([PERIOD]), points(change), PERIOD)
    plant.set_trip_point(0, 95.0)
    assert plant.advance(9 * MS, *NONE) == 5 * MS + 1
    assert plant.trips()[0]


# --- the MuJoCo plant ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "job",
    [
        [(int(t), change, PERIOD) for t, change in zip(TIMES, CHANGES, strict=True)],
        [(MS + 12_345, 33, 333_333), (MS + 200_001, -12, 77_777), (MS + 201_000, 5, 0), (MS + 290_000, 9, 1_000)],
        [(MS, 3, 10_000), (MS + 24_999, 4, 25_000), (MS + 25_000, -4, 50_000), (MS + 120_000, 1, 1)],
    ],
)
def test_drives_are_told_the_mean_over_each_sub_step(job):
    """Also where leads begin and end within a sub-step, where they cut each other short, and with steps between."""
    plant = build(MujocoPlant)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    wide = of_x(job)
    end = job[-1][0] + job[-1][2] + 2 * SUBSTEP
    first = job[0][0] // SUBSTEP * SUBSTEP
    for until in range(first + SUBSTEP, end, SUBSTEP):
        told.drive(plant, wide, until, start_ns=until - SUBSTEP if until > first + SUBSTEP else 0)
        mean = told.mean(job, until - SUBSTEP, until)
        assert plant.parts.states["command"][0] == pytest.approx(float(mean), abs=1e-9)
        assert plant.command[0] == pytest.approx(float(told.command(job, until)), abs=1e-9)


def test_a_motor_follows_its_set_points():
    """Half a revolution in 0.5 s with a cosine of 125 set points: the rotor is within half a full step all the way."""
    plant = build(MujocoPlant)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    way = np.rint(400 * (1 - np.cos(np.pi * np.arange(126) / 125))).astype(np.int64)
    times = 50 * MS + PERIOD * np.arange(1, 126, dtype=np.int64)
    largest = 0.0
    for k, t in enumerate(times.tolist()):
        plant.advance(t, times[k : k + 1], points(*np.diff(way)[k : k + 1]), PERIOD)
        largest = max(largest, abs(plant.lag[0]))
    plant.advance(2_000 * MS, *NONE)
    assert 0.1 < largest < 4.0
    assert plant.commanded[0] == 800
    assert plant.position_mm[0] == pytest.approx(102.5, abs=0.03)
    assert abs(plant.lag[0]) < 1.0


def test_what_is_led_is_not_at_rest_and_keeps_its_current():
    """One microstep in a second: far too slow to be seen in 25 ms, and 0.2 s after its end the current is lowered."""
    plant = build(MujocoPlant)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(1_000 * MS, *NONE)
    assert plant.at_rest
    assert plant.current_fraction[0] < 1.0
    plant.advance(1_010 * MS, np.array([1_010 * MS]), points(1), 1_000 * MS)
    for until in range(1_011, 2_010, 37):
        plant.advance(until * MS, *NONE)
        assert not plant.at_rest
        assert plant.current_fraction[0] == 1.0
        assert plant.command[0] == pytest.approx((until - 1_010) / 1_000, abs=1e-12)
    plant.advance(2_209 * MS, *NONE)
    assert plant.current_fraction[0] == 1.0
    assert not plant.at_rest
    plant.advance(2_300 * MS, *NONE)
    assert plant.current_fraction[0] < 1.0
    assert plant.at_rest
    assert plant.command[0] == 1.0


def test_a_limp_motor_is_told_as_well():
    """Without current nothing moves, but the lead is over when it is over."""
    plant = build(MujocoPlant)
    plant.advance(1_000 * MS, *NONE)
    assert plant.at_rest
    plant.advance(1_100 * MS, np.array([1_001 * MS]), points(500), 200 * MS)
    assert not plant.at_rest
    assert plant.command[0] == pytest.approx(500 * 99 / 200, abs=1e-9)
    assert plant.rotor[0] == 0.0
    assert not plant.powered.any()
    plant.advance(1_300 * MS, *NONE)
    assert plant.at_rest
    assert plant.command[0] == 500


def test_a_tick_that_waits_for_its_sub_step_is_not_rest():
    plant = build(MujocoPlant)
    plant.advance(1_000 * MS, *NONE)
    assert plant.at_rest
    plant.advance(1_000 * MS + 10, np.array([1_000 * MS + 5]), ticks(1, 1))
    assert not plant.at_rest


# --- both: how time is cut -------------------------------------------------------------------------------------------

MIXED: list[tuple[int, tuple[int, ...], int]] = [
    *((4 * MS * k, (30 if k < 12 else -40, 0, 7, 3), PERIOD) for k in range(1, 20)),
    (78_000_100, (12, -9, 0, 0), 3 * MS + 1),
    (78_000_101, (1, 0, 0, 0), 0),
    (78_000_102, (5, 5, 5, 5), 77_777),
    (78_000_103, (0, 1, 0, -1), 0),
    *((90 * MS + 133_337 * k, (1, 0, -1, 0), 0) for k in range(40)),
    (200 * MS + 13, (100, 100, 0, 0), 20 * MS),
]
"""Set points, three leads and steps within one sub-step, steps before a lead is over, a pause, one long lead."""
END = 260 * MS
WATCHED = [
    Threshold(0, "position", 100.5, 1, 0.1),
    Threshold(0, "position", 99.9, -1, 0.05),
    Threshold(0, "lag", 6.0, hysteresis=4.0),
    Threshold(1, "lag", 2.0, hysteresis=1.0),
    Threshold(2, "position", 30.1, 1, 0.05),
]


def whole_story(kind: type, cuts: list[int]) -> tuple[list[told.Edge], list[bytes]]:
    plant = build(kind, WATCHED)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    edges = told.drive(plant, MIXED, END, cuts)
    seen = plant.position_mm, plant.velocity_mm_s, plant.rotor, plant.command, plant.commanded, plant.lag
    return edges, [array.tobytes() for array in seen]


@BOTH
@given(cuts=st.lists(st.one_of(st.integers(0, END), st.integers(77_990_000, 78_030_000)), max_size=12))
@settings(max_examples=drawn(30), deadline=None)
def test_cutting_time_into_calls_changes_no_bit(kind, cuts):
    assert whole_story(kind, cuts) == whole_story(kind, [])


@BOTH
def test_cutting_at_every_tick_and_around_it_changes_no_bit(kind):
    cuts = sorted({t + d for t, _, lead in MIXED for d in (-1, 0, 1, lead - 1, lead, lead + 1)})
    edges, _ = whole_story(kind, [])
    assert len(edges) >= 4, "there is something to miss"
    assert whole_story(kind, cuts) == whole_story(kind, [])
