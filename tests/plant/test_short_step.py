"""Short MuJoCo steps: the bits of whole ones, on every machine, and whole ones wherever something may be met."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from isel_twin.machine import load_machine, machine_names, with_overrides
from isel_twin.plant.mujoco import MujocoPlant
from isel_twin.plant.short_step import DEFLECTION_M

from .conftest import MS, ramp_ns, ticks

FIXTURE = (
    '<mujoco><worldbody><body><geom type="box" size="0.02 0.02 {half}" pos="0 0 {half}"/></body></worldbody></mujoco>'
)
"""A block on the table."""
HINGED = '<mujoco><worldbody><body><joint/><geom size="0.001" pos="0 0 0.001"/></body></worldbody></mujoco>'


def fixed(folder: Path, text: str) -> MujocoPlant:
    """The 4030 with a fixture; the tool's lowest point is 4 mm above the table."""
    (folder / "fixture.xml").write_text(text)
    machine = with_overrides(load_machine("4030"), {"fixture": str(folder / "fixture.xml")})
    return MujocoPlant(machine, (), np.array([100.0, 100.0, 30.0]))


def moved(machine: str, short: bool) -> tuple[list[bytes], int, int]:
    """A move, a push of 2 kN into the stop of X, one away from it and rest: everything after each ms, and how many of
    the windows were short and whole."""
    plant = MujocoPlant(load_machine(machine), (), np.array([1.0, 20.0, 10.0]))
    if not short:
        plant._bounds[:] = np.nan
    plant.set_power(stages=True, brake_released=True, lowering=True)
    move_ns, pushes = 10 * MS + ramp_ns(400, 6000), {100: -2000.0, 300: 2000.0, 350: 0.0}
    state: list[bytes] = []
    within = done = 0
    for ms in range(1, 500):
        if ms - 1 in pushes:
            plant.apply_force(0, pushes[ms - 1])
        last = int(np.searchsorted(move_ns, ms * MS, side="right"))
        plant.advance(ms * MS, move_ns[done:last], ticks(last - done, 1, 1, 1))
        done = last
        within += int(plant._plant["within"][0])
        data = plant.data
        state.append(b"".join(a.tobytes() for a in (data.qpos, data.qvel, data.qacc, data.qacc_smooth, plant.rotor)))
    return state, within, 499 - within


@pytest.mark.parametrize("machine", machine_names())
def test_short_steps_give_the_bits_of_whole_ones(machine: str) -> None:
    short, within, whole = moved(machine, short=True)
    assert within > 200
    assert whole > 5, "it has been at the stop"
    assert short == moved(machine, short=False)[0]


@pytest.mark.parametrize("machine", machine_names())
def test_every_machine_steps_short_between_its_stops(machine: str) -> None:
    settings = load_machine(machine)
    plant = MujocoPlant(settings, (), np.array([30.0, 20.0, 10.0]))
    for axis, dof in zip(settings.axes, plant._dof, strict=True):
        stops_mm = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        np.testing.assert_allclose(plant._bounds[:, dof] * 1e3, stops_mm, atol=1e-9)
    structure = np.delete(plant._bounds, plant._dof, axis=1)
    assert (structure == [[-DEFLECTION_M], [DEFLECTION_M]]).all()


@pytest.mark.parametrize(("half_m", "met"), [(0.0009, False), (0.0035, True)])
def test_only_a_fixture_that_the_tool_may_meet_takes_whole_steps(tmp_path: Path, half_m: float, met: bool) -> None:
    """The tool comes down to 4 mm above the table: a block of 1.8 mm is never met, one of 7 mm may be."""
    plant = fixed(tmp_path, FIXTURE.format(half=half_m))
    assert np.isnan(plant._bounds).all() == met


def test_a_fixture_that_turns_takes_whole_steps(tmp_path: Path) -> None:
    assert np.isnan(fixed(tmp_path, HINGED)._bounds).all()
