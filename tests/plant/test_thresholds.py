"""Thresholds of lag and fault beside those of positions: at which sub-step they are passed, and what they refuse."""

from __future__ import annotations

from itertools import pairwise

import numpy as np
import pytest

from isel_twin.machine import load_machine
from isel_twin.plant import Plant, Threshold
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant

from . import told
from .conftest import MS, NONE, ramp_ns, ticks

SUBSTEP = 25_000
BOTH = pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])


def build(kind: type, *thresholds: Threshold, axes: int = 4) -> Plant:
    return kind(load_machine("4030"), thresholds, np.array([100.0, 100.0, 30.0]), axes)


def test_following_error_of_a_limp_motor():
    """It stands, so the lag is the command: 400 microsteps in 4 ms, 2.5 a sub-step, then back.

    Above 100: the 41st sub-step after 4 ms (102.5). Left at 100 - 30 = 70: on the way back from 400 at 8 ms, after 132
    sub-steps. On the other side |-100| is the limit itself, so it takes one sub-step more.
    """
    plant = build(MujocoPlant, Threshold(1, "lag", 100.0, hysteresis=30.0))
    job = [(4 * MS * (k + 1), (0, change, 0, 0), 4 * MS) for k, change in enumerate((400, -400, -400, 400))]
    edges = told.drive(plant, job, 30 * MS)
    first = [4 * MS + 41 * SUBSTEP, 8 * MS + 132 * SUBSTEP, 12 * MS + 41 * SUBSTEP, 16 * MS + 132 * SUBSTEP]
    assert edges == [(at, (k % 2 == 0,)) for k, at in enumerate(first)]
    assert plant.lag[1] == 0.0


def test_following_error_of_steps_of_a_limp_motor():
    """Steps at 10 kHz, one every fourth sub-step; the 13th is one too many for 12.5."""
    plant = build(MujocoPlant, Threshold(0, "lag", 12.5))
    t_ns = 100_000 * np.arange(1, 21, dtype=np.int64)
    assert plant.advance(10 * MS, t_ns, ticks(20, -1)) == 1_300_000
    assert plant.trips().tolist() == [True]
    assert plant.lag[0] == -13.0
    assert plant.commanded[0] == -13


def test_following_error_of_a_motor_that_is_too_slow():
    """Watched or not, the same motion: it ends with the first sub-step at whose end the unwatched one lags as much."""

    def moving(*thresholds: Threshold) -> MujocoPlant:
        plant = build(MujocoPlant, *thresholds)
        plant.set_power(stages=True, brake_released=True, lowering=True)
        plant.advance(50 * MS, *NONE)
        return plant

    t_ns, delta = 50 * MS + ramp_ns(3000, 40_000, hz_per_ms=4000), ticks(3000, 1)
    free, lags = moving(), []
    for until in range(50 * MS, 250 * MS, SUBSTEP):
        made = slice(*np.searchsorted(t_ns, (until, until + SUBSTEP), side="right"))
        free.advance(until + SUBSTEP, t_ns[made], delta[made])
        lags.append((until + SUBSTEP, abs(free.lag[0])))
    limits = (1.0, 5.0, 20.0)
    watched = moving(*(Threshold(0, "lag", limit, hysteresis=0.5) for limit in limits))
    edges = told.drive(watched, [(int(t), (1, 0, 0, 0), 0) for t in t_ns], 250 * MS, start_ns=50 * MS)
    assert np.array_equal(watched.rotor, free.rotor)
    for number, limit in enumerate(limits):
        passed, expected = False, []
        for at, lag in lags:
            if (lag > limit) if not passed else (lag <= limit - 0.5):
                passed = not passed
                expected.append((at, passed))
        assert expected, "the motor lags this much"
        states = [(0, False), *((at, flags[number]) for at, flags in edges)]
        assert [b for a, b in pairwise(states) if a[1] != b[1]] == expected


@BOTH
def test_where_nothing_can_lag_nothing_is_passed(kind):
    """An axis without a carriage has no lag, an exact plant has none at all; only a negative limit is below that."""
    thresholds = [Threshold(4, "lag", 0.0), Threshold(4, "lag", -1.0), Threshold(4, "fault"), Threshold(7, "fault")]
    if kind is KinematicPlant:
        thresholds.append(Threshold(0, "lag", 0.0))
    plant = build(kind, *thresholds, axes=6)
    delta = np.full((1, 6), 500, dtype=np.int32)
    assert plant.advance(20 * MS, np.array([4 * MS]), delta, 8 * MS) == 20 * MS
    assert plant.trips().tolist() == [False, True, False, False, False][: len(thresholds)]
    assert not plant.fault.any()


def test_a_fault_ends_the_sub_step_in_which_it_comes():
    plant = build(MujocoPlant, Threshold(0, "fault"), Threshold(1, "fault"))
    plant.advance(10 * MS, *NONE)
    plant.parts.axes["fault"][1] = 1
    assert plant.advance(20 * MS, *NONE) == 10 * MS + SUBSTEP
    assert plant.trips().tolist() == [False, True]
    assert plant.fault.tolist() == [False, True, False, False]
    plant.parts.axes["fault"][1] = 0
    assert plant.advance(20 * MS, *NONE) == 10 * MS + 2 * SUBSTEP
    assert not plant.trips().any()


@BOTH
def test_thresholds_keep_the_order_in_which_they_are_given(kind):
    plant = build(
        kind,
        Threshold(0, "lag", -1.0),
        Threshold(0, "position", 99.0, 1, 0.1),
        Threshold(2, "fault"),
        Threshold(0, "position", 101.0, 1, 0.1),
        Threshold(1, "position", 101.0, -1, 0.1),
    )
    assert plant.trips().tolist() == [True, True, False, False, True]
    plant.set_trip_point(3, 99.5)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    at = plant.advance(2 * MS, np.array([MS]), ticks(1, 1))
    assert at < 2 * MS
    assert plant.trips().tolist() == [True, True, False, True, True]
    for number in (0, 2):
        with pytest.raises(ValueError, match="position"):
            plant.set_trip_point(number, 1.0)


@BOTH
def test_current_is_where_the_stages_are_on(kind):
    plant = build(kind, axes=5)
    assert plant.powered.tolist() == [False] * 5
    plant.set_power(stages=True, brake_released=True, lowering=True)
    assert plant.powered.tolist() == [True] * 5
    if kind is MujocoPlant:
        plant.set_phase_lost(1, "a")
        plant.set_phase_lost(2, "ab")
        assert plant.powered.tolist() == [True, True, False, True, True]


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0, "speed", 1.0), "quantity 'speed'; there are: position, lag, fault"),
        ((3, "position", 1.0), "axis 3 has no position; allowed: 0 to 2"),
        ((8, "lag", 1.0), "axis 8 has no lag; allowed: 0 to 7"),
        ((-1, "fault"), "axis -1"),
        ((0, "position", 1.0, 0), "sense 0; allowed: -1, 1"),
        ((0, "lag", float("nan")), "finite"),
        ((0, "lag", 1.0, 1, -0.5), "finite"),
    ],
)
def test_what_is_no_threshold(arguments, message):
    with pytest.raises(ValueError, match=message):
        Threshold(*arguments)
