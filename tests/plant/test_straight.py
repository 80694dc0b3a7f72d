"""A straight way that the kinematic plant makes as one: as by its steps, and refused where they could matter."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.machine import load_machine
from isel_twin.plant import Threshold
from isel_twin.plant.kinematic import KinematicPlant

MACHINE = load_machine("4030")
START_MM = np.array([100.0, 100.0, 30.0])
STEP_MM = MACHINE.axes[0].step_mm
MS = 1_000_000
NONE = np.empty(0, dtype=np.int64), np.empty((0, 4), dtype=np.int8)
SWITCH = Threshold(0, "position", 100.0 + 99.5 * STEP_MM, 1, 20.0 * STEP_MM)
"""Struck by step 100 of X, free again at step 79."""


def steps(first: int, count: int, sign: int = 1) -> tuple[np.ndarray, np.ndarray]:
    """So many steps of X, one a millisecond."""
    delta = np.zeros((count, 4), dtype=np.int8)
    delta[:, 0] = sign
    return MS * np.arange(first, first + count, dtype=np.int64), delta


def at(plant: KinematicPlant) -> tuple[int, list[int], list[bool]]:
    return plant.time_ns, plant.commanded.tolist(), plant.trips().tolist()


def test_it_is_where_its_steps_would_lead() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    assert plant.go_straight(99 * MS, (99, -40, 7, 3))
    assert at(plant) == (99 * MS, [99, -40, 7, 3], [False])
    assert not plant.edge
    assert plant.position_mm.tolist() == (START_MM + np.array([99, -40, 7]) * STEP_MM).tolist()


def test_a_switch_on_the_way_has_to_be_met_by_its_steps() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    assert plant.go_straight(90 * MS, (90, 0, 0, 0))
    assert not plant.go_straight(120 * MS, (30, 0, 0, 0))
    assert at(plant) == (90 * MS, [90, 0, 0, 0], [False]), "a refusal changes nothing"
    assert plant.advance(120 * MS, *steps(91, 30)) == 100 * MS
    assert at(plant) == (100 * MS, [100, 0, 0, 0], [True])

    assert plant.go_straight(200 * MS, (50, 0, 0, 0)), "further beyond it nothing changes"
    assert plant.go_straight(300 * MS, (-70, 0, 0, 0)), "nor within its hysteresis"
    assert not plant.go_straight(400 * MS, (-2, 0, 0, 0))
    assert plant.advance(400 * MS, *steps(301, 5, -1)) == 301 * MS
    assert at(plant) == (301 * MS, [79, 0, 0, 0], [False])


def test_a_new_trip_point_and_a_saved_state_count_from_then_on() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    saved = plant.save()
    assert plant.go_straight(10 * MS, (90, 0, 0, 0))
    plant.set_trip_point(0, 100.0 + 200.5 * STEP_MM)
    assert plant.go_straight(20 * MS, (100, 0, 0, 0))
    plant.restore(saved)
    assert not plant.go_straight(10 * MS, (101, 0, 0, 0))
    assert plant.go_straight(10 * MS, (99, 0, 0, 0))


@pytest.mark.parametrize("why", ["samples", "leads"])
def test_whoever_looks_at_the_way_gets_it_step_by_step(why: str) -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    if why == "samples":
        plant.sample_every(5 * MS)
    else:
        plant.advance(1 * MS, *steps(1, 1), lead_ns=4 * MS)
    before = at(plant)
    assert not plant.go_straight(10 * MS, (3, 0, 0, 0))
    assert at(plant) == before
    plant.advance(10 * MS, *NONE)
    plant.sample_every(0)
    assert plant.go_straight(20 * MS, (3, 0, 0, 0)), "afterwards as before"
