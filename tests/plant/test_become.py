"""A plant becomes another machine without being built anew, and nobody can tell it from a new one."""

from __future__ import annotations

from functools import cache
from typing import Any

import mujoco
import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.jobs.robust import perturbation
from isel_twin.machine import Fixture, Machine, MachineError, load_machine, machine_names, with_fixtures, with_overrides
from isel_twin.plant import Threshold
from isel_twin.plant.cutting import Cut
from isel_twin.plant.mujoco import MujocoPlant

MS = 1_000_000
START_MM, OTHER_MM = np.array([100.0, 90.0, 20.0]), np.array([60.0, 110.0, 30.0])
THRESHOLDS = [Threshold(0, "position", 61.0, 1, 0.1), Threshold(1, "lag", 3.0), Threshold(0, "touch", 0.008, 1, 0.002)]
PLATE = Fixture("plate", "cylinder", (30.0, 20.0), (60.0, 60.0, 0.0), plate=True)


@cache
def drawn(name: str, number: int) -> Machine:
    machine = load_machine(name)
    return with_overrides(machine, perturbation(machine, 0, number)[2])


def flat(state: Any) -> list[Any]:
    """All bytes of a saved state but addresses, which differ from plant to plant."""
    if isinstance(state, dict):
        return [(key, flat(value)) for key, value in state.items()]
    if isinstance(state, tuple | list):
        return [flat(value) for value in state]
    if isinstance(state, np.ndarray):
        if state.dtype.names and "mj_step" in state.dtype.names:
            state = state.copy()
            state["model"] = state["data"] = state["step_at"] = 0
        return [state.dtype.str, state.shape, state.tobytes()]
    return [repr(state)]


def moved(plant: MujocoPlant) -> list[Any]:
    """What the plant is at power-on, on its way and behind a move of all axes, with all that the loop can tell."""
    model = np.empty(mujoco.mj_sizeModel(plant.model), np.uint8)
    mujoco.mj_saveModel(plant.model, None, model)
    seen = [model.tobytes(), flat(plant.save()), plant.position_mm.tobytes()]
    plant.set_power(stages=True, brake_released=True, lowering=True)
    t_ns = 5 * MS + np.arange(1, 401) * 50_000
    delta = np.ones((400, 4), np.int32)
    made = 0
    for until_ns in (10 * MS, 40 * MS, 90 * MS):
        plant.apply_force(0, 1e-6 * until_ns)
        while plant.time_ns < until_ns:
            last = int(np.searchsorted(t_ns, until_ns, side="right"))
            reached = plant.advance(until_ns, t_ns[made:last], delta[made:last])
            made = int(np.searchsorted(t_ns, reached, side="right"))
        seen += [flat(plant.save()), plant.position_mm.tobytes(), plant.margin.tobytes(), plant.trips().tobytes()]
    return seen


def used(machine: Machine, start_mm: NDArray[np.float64] = START_MM) -> MujocoPlant:
    """A plant to which everything has happened that can happen to one."""
    plant = MujocoPlant(machine, THRESHOLDS, start_mm)
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.sample_every(MS)
    plant.set_payload("table", 3.0)
    plant.set_friction(1, 25.0)
    plant.set_obstacle(0, 130.0)
    plant.set_phase_lost(2, "a")
    plant.set_undervoltage(0.2)
    plant.set_cut(Cut(6.0, 2, 1.0, 2.0, 12_000.0, 800.0))
    plant.apply_force(0, 40.0)
    plant.advance(30 * MS + 7, 3 * MS + np.arange(1, 200) * 100_000, np.ones((199, 4), np.int32), 5000)
    plant.set_trip_point(0, 62.0)
    plant.set_trip_point(2, 0.010)
    return plant


@pytest.mark.parametrize("name", machine_names())
def test_it_is_to_the_bit_a_new_one(name: str) -> None:
    """Whatever has happened to it: pulses that wait, payload, friction, obstacle, phase, supply, cut, push, samples."""
    other, start_mm = drawn(name, 2), 0.3 * START_MM
    plant = used(drawn(name, 1))
    plant.become(other, start_mm)
    assert moved(plant) == moved(MujocoPlant(other, THRESHOLDS, start_mm))
    assert (plant.machine, plant.time_ns, plant.take_collisions()) == (other, 90 * MS, ())


@pytest.mark.parametrize(
    ("overrides", "other", "fixtures", "touched_mm"),
    [
        ({"probe.enabled": True}, {"probe.pretravel": 12.0, "probe.force": 0.9}, (), 107.0),
        ({"probe.enabled": True}, {"probe.lobing": 1.0, "probe.rate": 0.5}, (PLATE,), 87.0),
        ({}, {"plate.pretravel": 12.0, "plate.force_z": 2.0}, (PLATE,), 127.0),
    ],
    ids=["probe", "probe on a plate", "plate"],
)
def test_what_feels_is_new_too(
    overrides: dict[str, Any], other: dict[str, Any], fixtures: tuple[Fixture, ...], touched_mm: float
) -> None:
    """It was broken, and is another one that is touched from the start. touched_mm: Z at which it would begin."""
    was = with_fixtures(with_overrides(drawn("4030", 1), overrides), fixtures)
    other_machine = with_fixtures(with_overrides(drawn("4030", 2), {**overrides, **other}), fixtures)
    over_mm = was.feeler.overtravel_mm if was.feeler else 0.0
    plant = used(was, np.array([60.0, 60.0, touched_mm + over_mm + 0.1]))
    assert plant.parts.feeler["broken"][0]
    start_mm = np.array([60.0, 60.0, touched_mm + 0.05])
    plant.become(other_machine, start_mm)
    new = MujocoPlant(other_machine, THRESHOLDS, start_mm)
    assert plant.trips().tolist() == new.trips().tolist() == [False, False, True]
    assert moved(plant) == moved(new)
    assert plant.take_collisions() == new.take_collisions()


def test_it_becomes_what_it_was() -> None:
    machine = load_machine("4030")
    plant = used(machine)
    plant.become(drawn("4030", 1), START_MM)
    plant.become(machine, START_MM)
    assert moved(plant) == moved(MujocoPlant(machine, THRESHOLDS, START_MM))


@pytest.mark.parametrize(
    "overrides",
    [{"axes.x.travel": 250.0}, {"imperfections": "ideal"}, {"timing.mujoco_step": 0.25}, {"probe.enabled": True}],
    ids=lambda overrides: next(iter(overrides)),
)
def test_another_model_is_refused_and_nothing_has_changed(overrides: dict[str, Any]) -> None:
    plant = used(load_machine("4030"))
    before = flat(plant.save())
    with pytest.raises(ValueError, match="its model is another one than that of 4030; build a new plant"):
        plant.become(with_overrides(load_machine("4030"), overrides), START_MM)
    assert flat(plant.save()) == before


def test_what_no_plant_can_be_is_refused_and_it_stands_at_power_on_as_what_it_was() -> None:
    machine = load_machine("4030")
    stiff = with_overrides(machine, {"axes.y.stiffness": 90.0})
    with pytest.raises(MachineError, match="too long"):
        MujocoPlant(stiff, THRESHOLDS, START_MM)
    plant = MujocoPlant(machine, THRESHOLDS, START_MM)
    plant.set_payload("table", 3.0)
    with pytest.raises(MachineError, match="too long"):
        plant.become(stiff, START_MM)
    assert moved(plant) == moved(MujocoPlant(machine, THRESHOLDS, START_MM))
