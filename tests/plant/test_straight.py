"""A straight way that the kinematic plant makes as one: as by its steps, up to the one that strikes a switch."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.machine import load_machine
from isel_twin.plant import Threshold
from isel_twin.plant.kinematic import KinematicPlant

MACHINE = load_machine("4030")
FAR = 1 << 62  # further than any axis goes
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


def room(plant: KinematicPlant) -> tuple[int, int] | None:
    """How far X may go, below and above."""
    found = plant.room(1000 * MS)
    return None if found is None else (found[0][0], found[1][0])


def test_it_is_where_its_steps_would_lead() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    plant.room(99 * MS)
    plant.go_straight(99 * MS, (99, -40, 7, 3))
    assert at(plant) == (99 * MS, [99, -40, 7, 3], [False])
    assert not plant.edge
    assert plant.position_mm.tolist() == (START_MM + np.array([99, -40, 7]) * STEP_MM).tolist()


def test_a_switch_on_the_way_is_where_its_room_ends() -> None:
    """As by its steps: struck by step 100, and free again where the last one of 79 is left."""
    straight, stepped = (KinematicPlant(MACHINE, [SWITCH], START_MM) for _ in range(2))
    assert room(straight) == (-FAR, 100)
    straight.go_straight(100 * MS, (100, 0, 0, 0))
    assert stepped.advance(120 * MS, *steps(1, 120)) == 100 * MS
    assert (straight.edge, at(straight)) == (True, at(stepped)) == (True, (100 * MS, [100, 0, 0, 0], [True]))

    assert room(straight) == (-21, FAR - 100), "within its hysteresis nothing changes, nor further beyond it"
    straight.go_straight(120 * MS, (20, 0, 0, 0))
    assert not straight.edge
    straight.go_straight(161 * MS, (-41, 0, 0, 0))
    stepped.advance(120 * MS, *steps(101, 20))
    assert stepped.advance(200 * MS, *steps(121, 50, -1)) == 161 * MS
    assert (straight.edge, at(straight)) == (True, at(stepped)) == (True, (161 * MS, [79, 0, 0, 0], [False]))


def test_a_new_trip_point_and_a_saved_state_count_from_then_on() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    saved = plant.save()
    assert room(plant) == (-FAR, 100)
    plant.go_straight(10 * MS, (90, 0, 0, 0))
    plant.set_trip_point(0, 100.0 + 200.5 * STEP_MM)
    assert room(plant) == (-FAR - 90, 201 - 90)
    plant.set_trip_point(0, 100.0 + 50.5 * STEP_MM)
    assert room(plant) is None, "it stands beyond a switch that no step has struck yet: the next one does"
    plant.restore(saved)
    assert room(plant) == (-FAR, 100)


@pytest.mark.parametrize("why", ["samples", "leads"])
def test_whoever_looks_at_the_way_gets_it_step_by_step(why: str) -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    if why == "samples":
        plant.sample_every(5 * MS)
    else:
        plant.advance(1 * MS, *steps(1, 1), lead_ns=4 * MS)
    assert room(plant) is None
    plant.advance(10 * MS, *NONE)
    plant.sample_every(0)
    assert room(plant) is not None, "afterwards as before"


@pytest.mark.parametrize("machine", ["4030", "4030-portal"])
def test_a_twin_that_is_looked_at_does_the_same(machine: str) -> None:
    """Reference run, moves and switches that are struck on the way: the same ticks, whether one looks or not."""
    job = (
        "@07",
        "@0R7",
        "@0A6000,9000,-700,4000,0,30,0,30",
        "@0A-90000,9000,300,4000,0,30,0,30",
        "@0R7",
        "@0A9,900,0,30,0,30,0,30",
    )
    twins = [Twin(machine=machine, plant="kinematic", start_mm=(3.0, 2.0, 4.0), seed=3) for _ in range(2)]
    assert twins[1].sample(lambda _: None, 10 * MS) is not None
    told = [[(twin.query(line), twin.time_ns, twin.counts.tolist(), twin.inputs) for line in job] for twin in twins]
    assert told[0] == told[1]
    assert "0" in {reply for reply, *_ in told[0]} != {"0"}, "a switch has been struck"
    assert twins[0].steps.t_ns.tobytes() == twins[1].steps.t_ns.tobytes()
    assert twins[0].steps.delta.tobytes() == twins[1].steps.delta.tobytes()
