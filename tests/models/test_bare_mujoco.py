"""The model folders in MuJoCo alone: they load, hold, move and give as machine.toml says, without the plant."""

from __future__ import annotations

import itertools
import math
import re

import mujoco
import numpy as np
import pytest

from isel_twin.machine import Axis, load_machine, machine_names, models_folder
from isel_twin.plant.model import load_model
from isel_twin.plant.picture import draw

from .test_picture import drawn

MACHINES = [name for name in machine_names() if (models_folder() / name / "scene.xml").is_file()]
"""Those with a model of their own."""
SHOWN_MM = {"4030": (150.0, 100.0, 50.0), "4030-portal": (150.0, 100.0, 50.0), "traverse": (500.0, 500.0, 400.0)}
"""Where the machines stand in the pictures of their folders."""


def bare(name: str) -> tuple[mujoco.MjModel, mujoco.MjData]:
    """The scene as MuJoCo loads it, at home."""
    model = mujoco.MjModel.from_xml_path(str(models_folder() / name / "scene.xml"))
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    return model, data


def run(model: mujoco.MjModel, data: mujoco.MjData, seconds: float) -> None:
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)


def positions_m(data: mujoco.MjData) -> np.ndarray:
    return np.array([data.joint(name).qpos[0] for name in "xyz"])


def radius_m(axis: Axis) -> float:
    """Travel for a radian of the shaft."""
    return axis.screw.lead_mm * 1e-3 / (2.0 * math.pi)


def servo_n_per_m(axis: Axis) -> float:
    """Motor field (Nr Km I / r^2) and nut, one behind the other."""
    torque_nm = axis.motor.torque_constant_nm_per_a * axis.stage.current_a
    return 1.0 / (radius_m(axis) ** 2 / (axis.motor.pole_pairs * torque_nm) + 1.0 / axis.screw.stiffness_n_per_m)


@pytest.mark.parametrize("name", MACHINES)
def test_armature_friction_and_damping_are_those_of_rotor_screw_and_guide(name):
    machine = load_machine(name)
    model, _ = bare(name)
    for axis in machine.axes:
        dof, r = model.joint(axis.name).dofadr[0], radius_m(axis)
        inertia = axis.motor.rotor_inertia_kgm2 + axis.screw.inertia_kgm2
        friction_n = axis.guide_friction_n + axis.screw.coulomb_nm / r
        assert model.dof_armature[dof] == pytest.approx(inertia / r**2, rel=1e-3)
        assert model.dof_frictionloss[dof] == pytest.approx(friction_n, rel=1e-3)
        assert model.dof_damping[dof] == pytest.approx(axis.screw.viscous_nm_s_per_rad / r**2, rel=1e-3)


def test_rotor_and_screw_of_the_default_x_axis_weigh_132_kg_at_the_nut():
    """5.3e-5 (data sheet) and 0.85 x 1.58 kg/m x 0.6 m x (8 mm)^2 / 2 + 5e-6 kg m2 (coupling), at 5 mm."""
    model, _ = bare("4030")
    screw = 0.85 * 1.58 * 0.6 * 0.008**2 / 2.0 + 5e-6
    expected_kg = (5.3e-5 + screw) * (2.0 * math.pi / 5e-3) ** 2
    assert expected_kg == pytest.approx(132.0, rel=0.01)
    assert model.dof_armature[model.joint("x").dofadr[0]] == pytest.approx(expected_kg, rel=0.01)


@pytest.mark.parametrize("name", MACHINES)
def test_actuators_are_servos_as_stiff_and_as_strong_as_the_drives(name):
    machine = load_machine(name)
    model, _ = bare(name)
    assert model.nu == len(machine.axes)
    for number, axis in enumerate(machine.axes):
        actuator = model.actuator(number)
        assert actuator.name == axis.name
        assert model.joint(actuator.trnid[0]).name == axis.name
        np.testing.assert_allclose(actuator.ctrlrange, (0.0, axis.travel_mm * 1e-3))
        assert actuator.gainprm[0] == pytest.approx(servo_n_per_m(axis), rel=1e-3)
        assert actuator.biasprm[1] == -actuator.gainprm[0]
        torque_nm = axis.motor.torque_constant_nm_per_a * axis.stage.current_a
        pull_n = axis.screw.efficiency * torque_nm / radius_m(axis)
        np.testing.assert_allclose(actuator.forcerange, (-pull_n, pull_n), rtol=1e-3)


@pytest.mark.parametrize("name", MACHINES)
def test_nothing_moves_at_home_and_z_does_not_fall(name):
    model, data = bare(name)
    np.testing.assert_array_equal(positions_m(data), 0.0)
    run(model, data, 5.0)
    assert np.abs(data.qpos).max() < 1e-6
    model.actuator_gainprm[:] = model.actuator_biasprm[:] = 0.0
    run(model, data, 5.0)
    assert np.abs(data.qpos).max() < 1e-6, "nor without its motor: friction holds a 5 mm screw"


@pytest.mark.parametrize("name", MACHINES)
def test_it_goes_where_it_is_told_and_its_sensors_say_so(name):
    model, data = bare(name)
    machine = load_machine(name)
    end_m = 0.8 * model.actuator_ctrlrange[:, 1]
    mujoco.mj_forward(model, data)
    before = data.sensor("tool_over_table").data.copy()
    steps = round(6.0 / model.opt.timestep)
    for k in range(steps):
        share = min(k / (0.9 * steps), 1.0)
        data.ctrl[:] = end_m * share**2 * (3.0 - 2.0 * share)
        mujoco.mj_step(model, data)
    stuck_m = [model.dof_frictionloss[model.joint(a.name).dofadr[0]] / servo_n_per_m(a) for a in machine.axes]
    assert np.all(np.abs(positions_m(data) - end_m) <= np.array(stuck_m) + 2e-6)
    moved = data.sensor("tool_over_table").data - before
    np.testing.assert_allclose(np.abs(moved), end_m, atol=2e-5)
    assert moved[2] < 0.0
    for number, axis in enumerate("xyz"):
        assert data.sensor(f"{axis}_position").data[0] == pytest.approx(positions_m(data)[number], abs=1e-9)
        assert abs(data.sensor(f"{axis}_speed").data[0]) < 1e-5
        assert abs(data.sensor(f"{axis}_force").data[0]) < 200.0


@pytest.mark.parametrize("name", MACHINES)
def test_a_push_on_the_tool_gives_as_much_as_frame_and_servo(name):
    """Along X, without dry friction, as in the plant: F (1 / k_frame + 1 / k_servo)."""
    machine = load_machine(name)
    model, data = bare(name)
    model.dof_frictionloss[:] = 0.0
    data.qpos[model.joint("x").qposadr[0]] = data.ctrl[0] = 0.1
    run(model, data, 3.0)
    before = data.site("tool").xpos[0]
    body = model.body(model.site_bodyid[model.site("tool").id]).id
    data.xfrc_applied[body, 0] = 100.0
    run(model, data, 3.0)
    frame = next(mode for mode in machine.structure if mode.axis == "x").stiffness_n_per_m
    expected_m = 100.0 / frame + 100.0 / servo_n_per_m(machine.axes[0])
    assert data.site("tool").xpos[0] - before == pytest.approx(expected_m, rel=0.02)


@pytest.mark.parametrize("name", MACHINES)
def test_the_plant_takes_none_of_it(name):
    """Its rotors and screws are simulated beside the model and would count twice; what is read by nobody costs time."""
    machine = load_machine(name)
    model = load_model(machine, visual=False)
    assert (model.nu, model.nsensor, model.nkey) == (0, 0, 0)
    assert not model.dof_armature.any()
    for axis in machine.axes:
        dof = model.joint(axis.name).dofadr[0]
        assert model.dof_frictionloss[dof] == axis.guide_friction_n
        assert model.dof_damping[dof] == 0.0


@pytest.mark.parametrize("name", [name for name in MACHINES if name != "traverse"])
def test_the_hood_encloses_everything_wherever_it_stands(name):
    machine = load_machine(name)
    model, data = bare(name)
    hood = model.geom("hood").id
    low, high = model.geom_pos[hood] - model.geom_size[hood], model.geom_pos[hood] + model.geom_size[hood]
    ends = [(-axis.stop_margin_mm, axis.travel_mm + axis.stop_margin_mm) for axis in machine.axes]
    for corner in itertools.product(*ends):
        for axis, mm in zip("xyz", corner, strict=True):
            data.joint(axis).qpos[0] = mm * 1e-3
        mujoco.mj_forward(model, data)
        for geom in set(range(model.ngeom)) - {hood, model.geom("floor").id}:
            turned = data.geom_xmat[geom].reshape(3, 3)
            middle = data.geom_xpos[geom] + turned @ model.geom_aabb[geom, :3]
            half = np.abs(turned) @ model.geom_aabb[geom, 3:]
            assert np.all(middle - half >= low - 1e-9), model.geom(geom).name
            assert np.all(middle + half <= high + 1e-9), model.geom(geom).name


@pytest.mark.parametrize("name", MACHINES)
def test_links_of_the_readme_lead_somewhere_in_the_package(name):
    folder = models_folder() / name
    text = (folder / "README.md").read_text()
    links = re.findall(r"\]\(([^)\s]+)\)", text)
    assert f"{name}.png" in links
    assert "LICENSE" in links
    for link in links:
        file, _, heading = link.partition("#")
        target = (folder / file).resolve() if file else folder / "README.md"
        assert target.is_file(), link
        assert target.is_relative_to(models_folder().resolve()), link
        if heading:
            headings = re.findall(r"^#+ (.*)$", target.read_text(), re.MULTILINE)
            assert heading in {re.sub(r"[^\w\- ]", "", line.lower()).replace(" ", "-") for line in headings}, link


def test_the_program_of_the_readme_runs(monkeypatch):
    text = (models_folder() / "4030" / "README.md").read_text()
    program = re.search(r"```python\n(.*?)```", text, re.DOTALL)
    assert program is not None
    monkeypatch.chdir(models_folder() / "4030")
    names: dict[str, object] = {}
    exec(compile(program[1], "models/4030/README.md", "exec"), names)
    assert "data" in names


@pytest.mark.parametrize("name", MACHINES)
def test_the_picture_in_the_folder_is_the_machine_of_today(name):
    """Drivers differ in the last bits of a colour and at edges, nothing more."""
    from matplotlib import image

    kept = np.rint(255.0 * image.imread(models_folder() / name / f"{name}.png")[..., :3])
    assert kept.shape == (600, 800, 3)
    assert kept.std() > 10.0
    now = drawn(lambda: draw(load_machine(name), SHOWN_MM[name], height=600, width=800, camera="front"))
    if now is not None:
        assert (np.abs(now - kept).max(axis=2) > 30.0).mean() < 0.02
