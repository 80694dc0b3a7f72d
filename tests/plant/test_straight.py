"""A straight way that the kinematic plant makes as one: as by its steps, up to the one that strikes a switch."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.core.sampling import TwinSamples
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


def along(times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
    """Of these steps."""
    counts = np.zeros((len(times_ns), 4), dtype=np.int64)
    counts[:, 0] = times_ns // MS
    return counts


def at(plant: KinematicPlant) -> tuple[int, list[int], list[bool]]:
    return plant.time_ns, plant.commanded.tolist(), plant.trips().tolist()


def room(plant: KinematicPlant) -> tuple[int, int] | None:
    """How far X may go, below and above."""
    found = plant.room()
    return None if found is None else (found[0][0], found[1][0])


def test_it_is_where_its_steps_would_lead() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    assert room(plant) == (-FAR, 100)
    plant.go_straight(99 * MS, (99, -40, 7, 3), along)
    assert at(plant) == (99 * MS, [99, -40, 7, 3], [False])
    assert not plant.edge
    assert plant.position_mm.tolist() == (START_MM + np.array([99, -40, 7]) * STEP_MM).tolist()


def test_a_switch_on_the_way_is_where_its_room_ends() -> None:
    """As by its steps: struck by step 100, and free again where the last one of 79 is left."""
    straight, stepped = (KinematicPlant(MACHINE, [SWITCH], START_MM) for _ in range(2))
    assert room(straight) == (-FAR, 100)
    straight.go_straight(100 * MS, (100, 0, 0, 0), along)
    assert stepped.advance(120 * MS, *steps(1, 120)) == 100 * MS
    assert (straight.edge, at(straight)) == (True, at(stepped)) == (True, (100 * MS, [100, 0, 0, 0], [True]))

    assert room(straight) == (-21, FAR - 100), "within its hysteresis nothing changes, nor further beyond it"
    straight.go_straight(120 * MS, (20, 0, 0, 0), along)
    assert not straight.edge
    straight.go_straight(161 * MS, (-41, 0, 0, 0), along)
    stepped.advance(120 * MS, *steps(101, 20))
    assert stepped.advance(200 * MS, *steps(121, 50, -1)) == 161 * MS
    assert (straight.edge, at(straight)) == (True, at(stepped)) == (True, (161 * MS, [79, 0, 0, 0], [False]))


def test_a_new_trip_point_and_a_saved_state_count_from_then_on() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    saved = plant.save()
    assert room(plant) == (-FAR, 100)
    plant.go_straight(10 * MS, (90, 0, 0, 0), along)
    plant.set_trip_point(0, 100.0 + 200.5 * STEP_MM)
    assert room(plant) == (-FAR - 90, 201 - 90)
    plant.set_trip_point(0, 100.0 + 50.5 * STEP_MM)
    assert room(plant) is None, "it stands beyond a switch that no step has struck yet: the next one does"
    plant.restore(saved)
    assert room(plant) == (-FAR, 100)


def test_what_is_led_is_told_step_by_step() -> None:
    plant = KinematicPlant(MACHINE, [SWITCH], START_MM)
    plant.advance(1 * MS, *steps(1, 1), lead_ns=4 * MS)
    assert room(plant) is None
    plant.advance(10 * MS, *NONE)
    assert room(plant) is not None, "afterwards as before"


def test_its_samples_are_those_of_its_steps() -> None:
    straight, stepped = (KinematicPlant(MACHINE, [SWITCH], START_MM) for _ in range(2))
    for plant in (straight, stepped):
        plant.sample_every(7 * MS, from_ns=3 * MS)
    assert room(straight) is not None
    straight.go_straight(60 * MS, (60, 0, 0, 0), along)
    straight.advance(100 * MS, *NONE)
    stepped.advance(100 * MS, *steps(1, 60))
    found, expected = straight.take_samples(), stepped.take_samples()
    assert found.commanded[:, 0].tolist() == [3, 10, 17, 24, 31, 38, 45, 52, 59, 60]
    for name in vars(expected):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name), err_msg=name)


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


@pytest.mark.parametrize("machine", ["4030", "4030-portal"])
def test_samples_of_a_twin_are_what_its_record_says(machine: str) -> None:
    twin, samples = Twin(machine=machine, plant="kinematic", start_mm=(3.0, 2.0, 4.0)), list[TwinSamples]()
    assert [twin.query(line) for line in ("@07", "@0R7")] == ["0", "0"]
    before = len(twin.steps)
    take = samples.append
    assert twin.sample(take, 3 * MS) is not None
    assert twin.query("@0A6000,9000,-70,4000,0,30,0,30") == "0"
    twin.sample_no_more(take)
    t_ns, delta = twin.steps.t_ns[before:], twin.steps.delta[before:]
    assert np.abs(delta).sum(axis=0).tolist()[:2] == [6000, 70]
    for part in samples:
        for time_ns, counts in zip(part.time_ns, part.counts, strict=True):
            assert counts.tolist() == delta[t_ns <= time_ns].sum(axis=0, dtype=np.int64).tolist()
