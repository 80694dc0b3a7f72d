"""Model folders: the MJCF says what machine.toml says, and is kept tidy."""

from __future__ import annotations

import fnmatch
import math
import re
import tomllib
import xml.etree.ElementTree as ElementTree
from pathlib import Path

import mujoco
import numpy as np
import pytest

from isel_twin.machine import MachineError, load_machine, machine_names, models_folder, with_overrides
from isel_twin.plant.model import load_model, mode_hz
from isel_twin.plant.mujoco import MujocoPlant

MACHINES = machine_names()
OWN = [name for name in MACHINES if (models_folder() / name / "scene.xml").is_file()]
"""Machines with a model of their own; the others borrow that of the one they are based on."""


@pytest.mark.parametrize("name", MACHINES)
def test_folder_holds_model_scene_numbers_and_readme(name):
    folder = models_folder() / name
    model = {f"{name}.xml", "scene.xml", f"{name}.png"} if name in OWN else set()
    assert {path.name for path in folder.iterdir()} == {"machine.toml", "README.md", "LICENSE"} | model
    assert (folder / "LICENSE").read_text() == (Path(__file__).parents[2] / "LICENSE").read_text()
    readme = (folder / "README.md").read_text()
    assert readme.startswith(f"# {name}\n")
    assert "estimate" in readme


@pytest.mark.parametrize("file", [f"{name}/{part}.xml" for name in OWN for part in (name, "scene")])
def test_xml_is_tidy(file):
    path = models_folder() / file
    text = path.read_text()
    for number, line in enumerate(text.splitlines(), 1):
        assert len(line) <= 120, f"{file}:{number}"
        assert line == line.rstrip(), f"{file}:{number}"
        assert "\t" not in line, f"{file}:{number}"
        if line.lstrip().startswith("<"):
            assert (len(line) - len(line.lstrip())) % 2 == 0, f"{file}:{number}"
    root = ElementTree.fromstring(text)
    for body in root.iter("body"):
        assert "name" in body.attrib
        if body.find("joint") is not None:
            assert body.find("inertial") is not None, f"{body.get('name')}: moving bodies have explicit inertias"


@pytest.mark.parametrize("name", OWN)
def test_scene_includes_the_machine_and_adds_no_body(name):
    root = ElementTree.parse(models_folder() / name / "scene.xml").getroot()
    assert [e.get("file") for e in root.iter("include")] == [f"{name}.xml"]
    assert root.find(".//light") is not None
    assert root.find(".//camera") is not None
    assert root.find(".//body") is None


@pytest.mark.parametrize("name", OWN)
def test_visual_shapes_neither_collide_nor_weigh(name):
    spec = mujoco.MjSpec.from_file(str(models_folder() / name / "scene.xml"))
    model = spec.compile()
    for geom in range(model.ngeom):
        visual = model.geom_group[geom] != 3 and model.geom(geom).name != "floor"
        assert (model.geom_contype[geom] == 0 and model.geom_conaffinity[geom] == 0) or not visual
    assert sum(model.geom_group == 3) <= 4, "few collision shapes"


@pytest.mark.parametrize("name", MACHINES)
def test_mjcf_and_machine_file_say_the_same(name):
    machine = load_machine(name)
    model = mujoco.MjModel.from_xml_path(str(machine.model_file))
    assert model.opt.timestep == machine.timing.mujoco_step_ns * 1e-9
    assert model.opt.disableflags & mujoco.mjtDisableBit.mjDSBL_AUTORESET
    for axis in machine.axes:
        joint = model.joint(axis.name)
        low, high = -axis.stop_margin_mm * 1e-3, (axis.travel_mm + axis.stop_margin_mm) * 1e-3
        np.testing.assert_allclose(joint.range, (low, high), atol=1e-9)
    moving = {model.body(int(b)).name for b in model.jnt_bodyid}
    assert moving <= set(machine.masses_kg)
    for body, mass_kg in machine.masses_kg.items():
        assert model.body(body).mass[0] == mass_kg
    assert {mode.joint for mode in machine.structure} == {model.joint(j).name for j in range(model.njnt)} - set("xyz")
    for mode in machine.structure:
        joint = model.joint(mode.joint)
        mass_kg = model.body_subtreemass[model.jnt_bodyid[joint.id]]
        damping = 2.0 * mode.damping_ratio * math.sqrt(mode.stiffness_n_per_m * mass_kg)
        assert model.jnt_stiffness[joint.id] == pytest.approx(mode.stiffness_n_per_m, rel=1e-5)
        assert model.dof_damping[joint.dofadr[0]] == pytest.approx(damping, rel=1e-5)


@pytest.mark.parametrize("name", MACHINES)
def test_axes_move_the_tool_where_the_machine_file_says(name):
    """Each joint moves the tool against the table by its own amount along one world axis; Z downwards."""
    machine = load_machine(name)
    model = mujoco.MjModel.from_xml_path(str(machine.model_file))

    def between(**joints: float) -> np.ndarray:
        data = mujoco.MjData(model)
        for joint, value in joints.items():
            data.joint(joint).qpos = value
        mujoco.mj_forward(model, data)
        return data.site("tool").xpos - data.site("table_top").xpos

    for number, axis in enumerate("xyz"):
        moved = between(**{axis: 0.1}) - between()
        np.testing.assert_allclose(np.abs(moved), np.eye(3)[number] * 0.1, atol=1e-12)
    assert (between(z=0.1) - between())[2] < 0.0


@pytest.mark.parametrize("name", MACHINES)
def test_nothing_touches_anywhere_in_the_travel(name):
    machine = load_machine(name)
    model = mujoco.MjModel.from_xml_path(str(machine.model_file))
    data = mujoco.MjData(model)
    corners = [(-axis.stop_margin_mm * 1e-3, (axis.travel_mm + axis.stop_margin_mm) * 1e-3) for axis in machine.axes]
    for x in corners[0]:
        for y in corners[1]:
            for z in corners[2]:
                for joint, value in zip("xyz", (x, y, z), strict=True):
                    data.joint(joint).qpos = value
                mujoco.mj_forward(model, data)
                assert data.ncon == 0


@pytest.mark.parametrize("name", MACHINES)
def test_overrides_reach_the_model(name):
    machine = with_overrides(
        load_machine(name),
        {
            "masses.z_slide": 9.0,
            "axes.x.guide_friction": 12.0,
            "axes.y.travel": 250.0,
            "structure.flex_x.stiffness": 2.0,
        },
    )
    model = load_model(machine)
    assert model.body("z_slide").mass[0] == 9.0
    assert model.dof_frictionloss[model.joint("x").dofadr[0]] == 12.0
    assert model.joint("y").range[1] == pytest.approx(0.253)
    joint = model.joint("flex_x")
    carried_kg = model.body_subtreemass[model.jnt_bodyid[joint.id]]
    assert model.jnt_stiffness[joint.id] == pytest.approx(2e6)
    assert model.dof_damping[joint.dofadr[0]] == pytest.approx(2.0 * 0.03 * math.sqrt(2e6 * carried_kg))
    assert mode_hz(machine, model)["flex_x"] == pytest.approx(math.sqrt(2e6 / carried_kg) / (2.0 * math.pi))


def test_a_motor_of_0_9_degrees_travels_as_far():
    machine = with_overrides(load_machine("4030"), {"axes.x.motor": "57STH56-2804MAC", "axes.x.stage.current": 2.8})
    plant = MujocoPlant(machine, [], np.array([100.0, 100.0, 50.0]))
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(
        2_500_000_000,
        np.arange(1, 1601, dtype=np.int64) * 500_000,
        np.tile(np.array([1, 0, 0, 0], dtype=np.int8), (1600, 1)),
    )
    assert plant.position_mm[0] == pytest.approx(105.0, abs=0.03)


def test_ideal_machine_has_no_structure():
    model = load_model(with_overrides(load_machine("4030"), {"imperfections": "ideal"}))
    assert sorted(model.joint(j).name for j in range(model.njnt)) == ["x", "y", "z"]


@pytest.mark.parametrize("name", MACHINES)
def test_every_machine_moves_and_can_be_looked_at(name):
    machine = load_machine(name)
    plant = MujocoPlant(machine, [], np.array([100.0, 100.0, 50.0]))
    plant.set_power(stages=True, brake_released=True, lowering=True)
    steps = round(5.0 * machine.axes[0].steps_per_mm)
    t_ns = np.arange(1, steps + 1, dtype=np.int64) * (800_000_000 // steps)
    plant.advance(2_500_000_000, t_ns, np.tile(np.array([1, 1, 1, 0], dtype=np.int8), (steps, 1)))
    np.testing.assert_allclose(plant.position_mm, (105.0, 105.0, 55.0), atol=0.03)
    model, data = plant.scene()
    assert model.ngeom > plant.model.ngeom
    np.testing.assert_allclose([data.joint(j).qpos[0] for j in "xyz"], plant.position_mm * 1e-3, atol=1e-6)


LOOSE = '<mujoco><worldbody><body name="b"><joint type="{}"/><geom size="0.01" mass="1"/></body></worldbody></mujoco>'


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        (
            '[masses]\nwheel = { value = 1.0, unit = "kg", grade = "estimate", source = "test" }',
            "no body 'wheel'; allowed",
        ),
        ('[axes.x]\nmotor = "steam"', "axes.x.motor: 'steam'; allowed: 23HS32-4004S"),
        (
            '[axes.x]\nmotor = "57STH56-2804MAC"\n'
            'steps_per_rev = { value = 600, unit = "1", grade = "setting", source = "test" }',
            "axes.x.steps_per_rev: 600; allowed with the motor 57STH56-2804MAC: whole multiples of 400",
        ),
        ('fixture = "ball.xml"', "a ball or free joint; allowed: slide and hinge"),
        ('fixture = "free.xml"', "free joint can only be used on top level"),
        ('fixture = "broken.xml"', "broken.xml: XML"),
        ('model = "empty.xml"', "no joint 'x'; allowed"),
    ],
)
def test_a_model_that_does_not_fit_its_machine_is_named(tmp_path, changes, message):
    (tmp_path / "ball.xml").write_text(LOOSE.format("ball"))
    (tmp_path / "free.xml").write_text(LOOSE.format("free"))
    (tmp_path / "broken.xml").write_text("<mujoco><worldbody>")
    (tmp_path / "empty.xml").write_text("<mujoco><worldbody/></mujoco>")
    (tmp_path / "machine.toml").write_text(f'based_on = "4030"\n{changes}\n')
    with pytest.raises(MachineError, match=re.escape(message)) as error:
        MujocoPlant(load_machine(tmp_path), [], np.zeros(3))
    assert "\n" not in str(error.value)


def test_models_are_packaged():
    """Every file of a model folder is one that the package takes along."""
    settings = tomllib.loads((Path(__file__).parents[2] / "pyproject.toml").read_text())
    patterns = settings["tool"]["setuptools"]["package-data"]["isel_twin.models"]
    for name in MACHINES:
        for file in (models_folder() / name).iterdir():
            assert any(fnmatch.fnmatch(f"{name}/{file.name}", pattern) for pattern in patterns), file
