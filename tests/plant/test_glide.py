"""Steps written out between the stops: MuJoCo's numbers on every machine, and MuJoCo's steps where something is met."""

from __future__ import annotations

from functools import cache
from pathlib import Path
from typing import Any

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from numpy.typing import NDArray

from isel_twin.machine import load_machine, machine_names, models_folder, with_overrides
from isel_twin.native import core
from isel_twin.plant.glide import gliding
from isel_twin.plant.model import load_model
from isel_twin.plant.mujoco import MujocoPlant
from isel_twin.plant.reach import DEFLECTION_M
from tests.thorough import drawn

from .conftest import MS, ramp_ns, ticks

MODELS = [name for name in machine_names() if (models_folder() / name / "scene.xml").is_file()]
"""Machines with a model of their own: MuJoCo's step knows nothing of drives."""

FIXTURE = (
    '<mujoco><worldbody><body><geom type="box" size="0.02 0.02 {half}" pos="0 0 {half}"/></body></worldbody></mujoco>'
)
"""A block on the table."""
HINGED = '<mujoco><worldbody><body><joint/><geom size="0.001" pos="0 0 0.001"/></body></worldbody></mujoco>'

speeds = st.one_of(st.just(0.0), st.floats(-1e-5, 1e-5), st.floats(-0.5, 0.5))
forces = st.one_of(st.floats(-40.0, 40.0), st.floats(-3000.0, 3000.0))


@cache
def model_of(machine: str) -> tuple[Any, NDArray[Any], NDArray[np.float64]]:
    """MuJoCo's model, and what `gliding` makes of it; nobody changes them."""
    model = load_model(load_machine(machine), visual=False)
    return model, *gliding(model)


@pytest.mark.parametrize("machine", MODELS)
@settings(max_examples=drawn(200), deadline=None)
@given(place=st.floats(0.01, 0.99), speed=st.tuples(*[speeds] * 6), force=st.tuples(*[forces] * 6))
def test_a_step_is_mujocos(machine: str, place: float, speed: tuple[float, ...], force: tuple[float, ...]) -> None:
    """Any place, speeds and forces: sliding, creeping and held joints in all combinations. MuJoCo's solver stops at a
    tolerance, which the last digit of its speeds shows."""
    model, joints, mobility = model_of(machine)
    data = mujoco.MjData(model)
    data.qpos[:] = joints["low_m"] + place * (joints["high_m"] - joints["low_m"])
    data.qvel[:], data.qfrc_applied[:] = speed[: model.nv], force[: model.nv]
    q, v, a, a0 = (array.copy() for array in (data.qpos, data.qvel, data.qacc, data.qacc_smooth))
    core.glide_once(joints, mobility, model.opt.timestep, q, v, a, a0, data.qfrc_applied)
    mujoco.mj_step(model, data)
    np.testing.assert_allclose(v, data.qvel, rtol=0.0, atol=1e-9)
    np.testing.assert_allclose(q, data.qpos, rtol=0.0, atol=1e-12)
    np.testing.assert_allclose(a0, data.qacc_smooth, rtol=1e-12, atol=1e-9)
    np.testing.assert_allclose(a, data.qacc, rtol=0.0, atol=2e-6)


def moved(machine: str, written_out: bool) -> tuple[NDArray[np.float64], int]:
    """A move and a push of 2 kN into the stop of X and away from it again: joints in um after each ms [n, nv], and the
    milliseconds that found X at its stop."""
    plant = MujocoPlant(load_machine(machine), (), np.array([1.0, 20.0, 10.0]))
    if not written_out:
        plant.parts.joints_law["low_m"] = np.nan
    plant.set_power(stages=True, brake_released=True, lowering=True)
    move_ns, pushes = 10 * MS + ramp_ns(400, 6000), {100: -2000.0, 200: 2000.0, 210: 0.0}
    place, done, struck = [], 0, 0
    for ms in range(1, 300):
        if ms - 1 in pushes:
            plant.apply_force(0, pushes[ms - 1])
        last = int(np.searchsorted(move_ns, ms * MS, side="right"))
        plant.advance(ms * MS, move_ns[done:last], ticks(last - done, 1, 1, 1))
        done = last
        place.append(plant.data.qpos * 1e6)
        struck += bool(plant.data.qpos[plant.built.dof[0]] <= -0.003)
    return np.array(place), struck


@pytest.mark.parametrize("machine", MODELS)
def test_a_move_and_a_stop_are_mujocos(machine: str) -> None:
    (ours, struck), (theirs, _) = moved(machine, True), moved(machine, False)
    assert struck > 5
    assert np.abs(ours - theirs)[:99].max() < 1e-3, "1 nm before it is pushed"
    assert np.abs(ours - theirs).max() < 5.0


def fixed(folder: Path, text: str) -> MujocoPlant:
    """The 4030 with a fixture; the tool's lowest point is 4 mm above the table."""
    (folder / "fixture.xml").write_text(text)
    machine = with_overrides(load_machine("4030"), {"fixture": str(folder / "fixture.xml")})
    return MujocoPlant(machine, (), np.array([100.0, 100.0, 30.0]))


@pytest.mark.parametrize("machine", MODELS)
def test_every_machine_glides_between_its_stops(machine: str) -> None:
    settings = load_machine(machine)
    plant = MujocoPlant(settings, (), np.array([30.0, 20.0, 10.0]))
    for axis, dof in zip(settings.axes, plant.built.dof, strict=True):
        stops_mm = -axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm
        law = plant.parts.joints_law[dof]
        assert (law["low_m"] * 1e3, law["high_m"] * 1e3) == pytest.approx(stops_mm, abs=1e-9)
    structure = np.delete(plant.parts.joints_law, plant.built.dof)
    assert (structure["low_m"] == -DEFLECTION_M).all()
    assert (structure["high_m"] == DEFLECTION_M).all()


@pytest.mark.parametrize(("half_m", "met"), [(0.0009, False), (0.0035, True)])
def test_with_a_fixture_that_the_tool_may_meet_every_step_is_mujocos(tmp_path: Path, half_m: float, met: bool) -> None:
    """The tool comes down to 4 mm above the table: a block of 1.8 mm is never met, one of 7 mm may be."""
    plant = fixed(tmp_path, FIXTURE.format(half=half_m))
    assert np.isnan(plant.parts.joints_law["low_m"]).all() == met


def test_with_a_fixture_that_turns_every_step_is_mujocos(tmp_path: Path) -> None:
    assert np.isnan(fixed(tmp_path, HINGED).parts.joints_law["low_m"]).all()


SLIDES = """<mujoco><option timestep="0.0005"><flag eulerdamp="disable"/></option><worldbody><body>
<joint name="a" type="slide" axis="1 0 0" frictionloss="30" range="-1 1"/><geom size="0.1" contype="0" conaffinity="0"/>
<body><joint name="b" type="slide" axis="{axis}" frictionloss="30" range="-1 1" damping="{damping}"/>
<geom size="0.1" contype="0" conaffinity="0"/></body></body></worldbody>{more}</mujoco>"""
"""Two slides, one on the other."""


@pytest.mark.parametrize(
    ("axis", "damping", "more", "written_out"),
    [
        ("0 1 0", 5, "", True),
        ("0.6 0.8 0", 5, "", False),
        ("0 1 0", 5, '<equality><joint joint1="a" joint2="b"/></equality>', False),
        ("0 1 0", 5, '<option integrator="implicit"/>', False),
        ("0 1 0", 5, '<option viscosity="100"/>', False),
    ],
    ids=["square", "friction coupled by masses", "equality", "another integrator", "fluid"],
)
def test_what_is_not_of_this_kind_is_mujocos(axis: str, damping: float, more: str, written_out: bool) -> None:
    model = mujoco.MjModel.from_xml_string(SLIDES.format(axis=axis, damping=damping, more=more))
    assert np.isfinite(gliding(model)[0]["low_m"]).all() == written_out


def test_a_plane_has_no_end_that_could_be_passed() -> None:
    """A wall across the way of a slide is met at 0.8 m, wherever its origin is."""
    model = mujoco.MjModel.from_xml_string(
        """<mujoco><option timestep="0.0005"/><worldbody>
        <geom type="plane" size="1 1 0.1" pos="0.9 100 100" zaxis="-1 0 0"/>
        <body><joint type="slide" axis="1 0 0" frictionloss="30" range="-1 1"/><geom size="0.1"/></body>
        </worldbody></mujoco>"""
    )
    assert np.isnan(gliding(model)[0]["low_m"]).all()
    data = mujoco.MjData(model)
    data.qpos[0] = 0.85
    mujoco.mj_forward(model, data)
    assert data.ncon == 1


def test_a_fixture_that_is_met_from_the_side_stops_an_axis_that_could_glide(bench, tmp_path: Path) -> None:
    """A cube of 40 mm amid the table, the cutter's end 27 mm above the table: X stops where the cutter's side meets the
    cube, by the places of the two in the model, less a few bounces of a tenth (a slip of the motor); Y and Z stay where
    they are. A plate of 1.8 mm that the cutter passes above leaves the machine its glide, and the same bits as without.
    """
    (tmp_path / "cube.xml").write_text(FIXTURE.format(half=0.02))
    (tmp_path / "plate.xml").write_text(FIXTURE.format(half=0.0009))
    b = bench({"fixture": str(tmp_path / "cube.xml")}, start_mm=(120.0, 150.0, 120.0))
    model, data = b.plant.scene()
    cutter = data.geom("cutter")
    cubes = [g for g in range(model.ngeom) if (model.geom_size[g] == 0.02).all()]
    (cube,) = cubes
    gap_mm = 1e3 * (abs(data.geom_xpos[cube][0] - cutter.xpos[0]) - 0.02 - model.geom("cutter").size[0])
    assert 20.0 < gap_mm < 100.0
    b.move((round(320 * (gap_mm + 10.0)), 0, 0), 4000.0)
    b.wait(300)
    assert -0.6 < b.plant.position_mm[0] - 120.0 - gap_mm < 0.02
    assert b.plant.position_mm[1:] == pytest.approx([150.0, 120.0], abs=0.02)
    assert b.lost[0] > 9 * 320
    ends = []
    for overrides in ({"fixture": str(tmp_path / "plate.xml")}, {}):
        b = bench(overrides, start_mm=(120.0, 150.0, 120.0))
        assert np.isfinite(b.plant.parts.joints_law["low_m"]).all()
        b.move((round(320 * (gap_mm + 10.0)), 0, 0), 4000.0)
        ends.append(b.plant.position_mm.tobytes())
    assert ends[0] == ends[1]
