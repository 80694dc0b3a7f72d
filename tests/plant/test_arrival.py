"""When all drives are in position: what a plant finds by itself is what one that is asked at each look would say."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.machine import load_machine
from isel_twin.plant import FindsArrival, Threshold
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.mujoco import MujocoPlant

from .conftest import MS, NONE

LOOK = 2 * MS
LATEST = 900 * MS
BOTH = pytest.mark.parametrize("kind", [KinematicPlant, MujocoPlant])
Kind = type[KinematicPlant] | type[MujocoPlant]


def led(kind: Kind, *thresholds: Threshold, powered: bool = True) -> KinematicPlant | MujocoPlant:
    """Servo axes led 40 mm/s for 0.2 s in X and half as fast in Y, at the end of the last lead."""
    plant = kind(load_machine("4030-servo"), thresholds, np.array([100.0, 100.0, 30.0]), 4)
    plant.set_power(stages=powered, brake_released=True, lowering=False)
    t_ns = 50 * MS + LOOK * np.arange(100, dtype=np.int64)
    plant.advance(50 * MS + LOOK * 100, t_ns, np.tile(np.int32([80, 40, 0, 0]), (100, 1)), LOOK)
    return plant


def asked(plant: KinematicPlant | MujocoPlant, first_ns: int) -> int | None:
    """The first look at which all axes are in position, by asking at each; None: none up to LATEST."""
    for look_ns in range(first_ns, LATEST, LOOK):
        plant.advance(look_ns, *NONE)
        if plant.in_position.all():
            return look_ns
    return None


@BOTH
@pytest.mark.parametrize("first_ns", [251 * MS, 252 * MS + 1, 253 * MS + 24_999, 600 * MS + 3])
def test_the_look_is_found_that_asking_would_find(kind: Kind, first_ns: int) -> None:
    one, other = led(kind), led(kind)
    expected = asked(one, first_ns)
    assert expected is not None
    assert isinstance(other, FindsArrival)
    assert other.finds_arrival(LOOK)
    assert other.arrive(LATEST, first_ns, LOOK) == (expected, True)
    for plant in (one, other):
        plant.advance(expected + 7 * MS + 11, *NONE)
    np.testing.assert_array_equal(one.position_mm, other.position_mm)
    np.testing.assert_array_equal(one.rotor, other.rotor)


@BOTH
def test_calls_may_cut_the_wait_anywhere(kind: Kind) -> None:
    one, other = led(kind), led(kind)
    first_ns = 250 * MS + 13
    expected = asked(one, first_ns)
    reached, found, cuts = 0, False, np.random.default_rng(3)
    until_ns = 250 * MS
    while not found:
        until_ns += int(cuts.integers(1, 3 * LOOK))
        next_ns = first_ns + -(-max(reached - first_ns, 0) // LOOK) * LOOK
        reached, found = other.arrive(until_ns, next_ns, LOOK)
        assert reached == until_ns or found
    assert reached == expected
    np.testing.assert_array_equal(one.position_mm, other.position_mm)


@BOTH
def test_a_wait_that_is_too_short_finds_nothing(kind: Kind) -> None:
    plant = led(kind)
    assert plant.arrive(252 * MS, 251 * MS, LOOK) == (252 * MS, False)
    assert not plant.in_position.all()


def test_drives_without_current_are_never_in_position() -> None:
    plant = led(MujocoPlant, powered=False)
    assert plant.arrive(LATEST, 251 * MS, LOOK) == (LATEST, False)


def test_at_rest_the_next_look_finds_them_in_position() -> None:
    plant = led(MujocoPlant)
    plant.advance(20_000 * MS, *NONE)
    assert plant.at_rest
    assert plant.arrive(90_000 * MS, 30_000 * MS + 5, LOOK) == (30_000 * MS + 5, True)


def test_a_threshold_ends_the_wait() -> None:
    """The carriage lags by a millimetre when the last set point is made, at 108 mm."""
    plant = led(MujocoPlant, Threshold(0, "position", 107.9, 1, 0.1))
    reached, found = plant.arrive(LATEST, 251 * MS, LOOK)
    assert not found
    assert plant.edge
    assert 250 * MS < reached < 400 * MS
    assert plant.arrive(LATEST, 251 * MS - -(reached - 251 * MS) // LOOK * LOOK, LOOK)[1]


def test_stepper_axes_and_uneven_grids_are_to_be_asked() -> None:
    steppers = MujocoPlant(load_machine("4030"), (), np.array([100.0, 100.0, 30.0]), 4)
    assert not steppers.finds_arrival(LOOK)
    assert not led(MujocoPlant).finds_arrival(LOOK + 1)
    two = MujocoPlant(load_machine("4030-servo"), (), np.array([100.0, 100.0, 30.0]), 2)
    assert not two.finds_arrival(LOOK)
