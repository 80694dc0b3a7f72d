"""A push bends the frame: every joint between the place of a force and the ground gives as its spring says.

Static give is the sum of compliances, the peak after a step of force that of two masses on two springs; both in closed
form, for machines without dry friction, play and detent (which would hide some of it).
"""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin.machine import MachineError, load_machine, machine_names, models_folder
from isel_twin.plant import PLACES
from isel_twin.plant.model import load_model, reach, tool_motion
from isel_twin.plant.mujoco import MujocoPlant

from .conftest import Bench

FREE = {"shaft_coulomb": 0.0, "guide_friction": 0.0, "backlash": 0.0, "efficiency": 1.0}
KM_NM_A, CURRENT_A, POLE_PAIRS, RADIUS_M = 0.424, 4.2, 50, 5e-3 / (2.0 * math.pi)
"""Torque constant, peak current and pole pairs of the motor, nut travel for a radian."""
PUSH_N = 100.0

STRUCTURE = {
    ("4030", 0, "tool"): ["flex_x"],
    ("4030", 1, "tool"): ["nod_y"],
    ("4030", 1, "table"): ["flex_y", "y"],
    ("4030-portal", 1, "tool"): ["flex_y", "y"],
    ("4030-portal", 1, "table"): [],
    ("traverse", 1, "tool"): ["flex_y", "y"],
}
"""Joints that a force along an axis loads, beside the axis joint of those that carry the tool: read off the drawing."""


def without_detent(folder: Path, base: str) -> Path:
    """A machine whose motors have no detent torque."""
    number = '{{ value = {}, unit = "{}", grade = "setting", source = "test" }}'
    (folder / "machine.toml").write_text(
        f'name = "ideal"\nbased_on = "{base}"\n[motors.ideal]\n'
        + "".join(
            f"{key} = {number.format(value, unit)}\n"
            for key, value, unit in (
                ("resistance_ohm", 0.65, "ohm"),
                ("inductance_h", 3.2e-3, "H"),
                ("torque_constant_nm_per_a", KM_NM_A, "N m/A"),
                ("rotor_inertia_kgm2", 5.3e-5, "kg m2"),
                ("detent_torque_nm", 0.0, "N m"),
            )
        )
        + '[axes.all]\nmotor = "ideal"\n'
    )
    return folder


def magnetic_m(force_n: float) -> float:
    """Way of a nut by the lag of its motor at full current: asin(T / T_peak) / pole pairs."""
    return RADIUS_M * math.asin(force_n * RADIUS_M / (KM_NM_A * CURRENT_A)) / POLE_PAIRS


@pytest.mark.parametrize("name", machine_names())
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("place", ["tool", "table"])
def test_static_give_is_the_sum_of_the_compliances(tmp_path, bench, name, axis, place):
    free = {f"axes.all.{key}": value for key, value in FREE.items()}
    servo = load_machine(name).axes[0].closed_loop
    b = bench(free, machine=name if servo else without_detent(tmp_path, name), lowering=False)
    machine = b.plant.machine
    b.wait(3000)
    before = b.plant.position_mm
    b.plant.apply_force(axis, PUSH_N, place)
    b.wait(4000)
    name = name.removesuffix("-hf").removesuffix("-servo")  # the same gantry
    carries_tool = not (name == "4030" and axis == 1)
    loaded = STRUCTURE.get((name, axis, place))
    if loaded is None:
        flexible = [mode.joint for mode in machine.structure if mode.axis == "xyz"[axis]]
        loaded = [*flexible, "xyz"[axis]] if (place == "tool") == carries_tool else []
    if (name, axis, place) == ("4030", 0, "tool"):
        loaded = ["flex_x", "x"]
    expected_m = sum(PUSH_N / mode.stiffness_n_per_m for mode in machine.structure if mode.joint in loaded)
    if "xyz"[axis] in loaded:
        expected_m += PUSH_N / machine.axes[axis].screw.stiffness_n_per_m + (0.0 if servo else magnetic_m(PUSH_N))
    give_mm = b.plant.position_mm - before
    increment_mm = 2e-3 if servo else 0.0  # its integral takes the rest away, but for what the encoder does not see
    assert give_mm[axis] == pytest.approx(1e3 * expected_m, rel=0.02, abs=1e-6 + increment_mm)
    others = np.delete(give_mm, axis)
    np.testing.assert_allclose(others, 0.0, atol=1e-5 + increment_mm)


def two_masses_peak_m(carried_kg: float, axis_kg: float, frame: tuple[float, float], nut: tuple[float, float]) -> float:
    """Highest way of the tool after a step of PUSH_N: a frame that carries carried_kg in all on a spring and a damper
    (N/m, N s/m) to the ground, on it a carriage of axis_kg on a nut; modes of the state matrix.
    """
    masses = np.array([[carried_kg, axis_kg], [axis_kg, axis_kg]])
    stiffness, damping = np.diag([frame[0], nut[0]]), np.diag([frame[1], nut[1]])
    inverse = np.linalg.inv(masses)
    states = np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ stiffness, -inverse @ damping]])
    values, vectors = np.linalg.eig(states)
    end = np.array([PUSH_N / frame[0], PUSH_N / nut[0], 0.0, 0.0])
    shares = np.linalg.solve(vectors, -end)
    t_s = np.arange(0.0, 0.05, 2e-5)
    way = end[:, None] + (vectors @ (shares[:, None] * np.exp(values[:, None] * t_s))).real
    return float((way[0] + way[1]).max())


def peak_mm(b: Bench, axis: int, place: str = "") -> float:
    """Furthest that a step of PUSH_N at rest moves the machine along an axis."""
    b.wait(500)
    before = b.plant.position_mm[axis]
    b.plant.apply_force(axis, PUSH_N, place)
    trace = []
    for _ in range(500):
        b.wait(0.1)
        trace.append(b.plant.position_mm[axis] - before)
    return max(trace)


@pytest.mark.parametrize(
    ("name", "axis", "carried_kg", "axis_kg", "mode"),
    [("4030", 0, 32.0, 12.0, "flex_x"), ("4030-portal", 0, 24.0, 10.0, "flex_x"), ("traverse", 1, 21.0, 3.0, "flex_y")],
)
def test_peak_of_a_step_of_force_at_the_tool_is_that_of_two_masses(bench, name, axis, carried_kg, axis_kg, mode):
    """The shaft stands: its friction is beyond what the nut can turn. Masses read off the drawings."""
    held = {f"axes.all.{key}": value for key, value in {**FREE, "shaft_coulomb": 1.9}.items()}
    b = bench(held, machine=name)
    frame = next(m for m in b.plant.machine.structure if m.joint == mode)
    screw = b.plant.machine.axes[axis].screw
    k = frame.stiffness_n_per_m
    damper = 2.0 * frame.damping_ratio * math.sqrt(k * carried_kg)
    nut = screw.stiffness_n_per_m, screw.damping_n_s_per_m
    expected_m = two_masses_peak_m(carried_kg, axis_kg, (k, damper), nut)
    assert peak_mm(b, axis) == pytest.approx(1e3 * expected_m, rel=0.02)


def test_peak_of_a_step_of_force_at_the_table_is_that_of_two_masses(bench):
    """Here the frame, the table plate, sits on the carriage: 10 kg on the nut, 7 kg of them on the plate's spring."""
    b = bench({f"axes.all.{key}": value for key, value in {**FREE, "shaft_coulomb": 1.9}.items()})
    plate = next(m for m in b.plant.machine.structure if m.joint == "flex_y")
    screw = b.plant.machine.axes[1].screw
    damper = 2.0 * plate.damping_ratio * math.sqrt(plate.stiffness_n_per_m * 7.0)
    nut = screw.stiffness_n_per_m, screw.damping_n_s_per_m
    expected_m = two_masses_peak_m(10.0, 7.0, nut, (plate.stiffness_n_per_m, damper))
    assert peak_mm(b, 1) == pytest.approx(1e3 * expected_m, rel=0.02)


def test_an_axis_pushes_what_it_moves_unless_told_otherwise(bench):
    def pushed(axis: int, place: str) -> NDArray[np.float64]:
        b = bench()
        b.plant.apply_force(axis, 300.0, place)
        b.wait(100)
        return b.plant.data.qpos.copy()

    for axis, place in enumerate(("tool", "table", "tool")):
        np.testing.assert_array_equal(pushed(axis, ""), pushed(axis, place))
    with pytest.raises(ValueError, match=r"cannot act at 'spindle'; there are: tool, table"):
        pushed(0, "spindle")


def test_a_new_push_replaces_the_one_before_wherever_it_was(bench):
    b = bench()
    b.wait(1000)
    before = b.plant.position_mm[1]
    b.plant.apply_force(1, 200.0, "tool")
    b.wait(1000)
    assert b.plant.position_mm[1] - before == pytest.approx(200.0 / 5e3, rel=0.02), "the portal nods"
    b.plant.apply_force(1, 0.0)
    b.wait(2000)
    assert b.plant.position_mm[1] == pytest.approx(before, abs=1e-4)


@pytest.mark.parametrize(("start_ms", "length_ms"), [(0.0, 0.4), (0.1, 0.4), (0.3, 0.4), (0.3, 0.1), (0.2, 1.3)])
def test_a_push_acts_in_the_very_time_it_lasts(bench, start_ms, length_ms):
    """Momentum is force times time, wherever on the grid of MuJoCo's steps (0.5 ms); the nut is free in its play."""
    b = bench({"axes.x.guide_friction": 0.0, "axes.x.backlash": 0.5}, power=False)
    b.wait(100 + start_ms)
    b.plant.apply_force(0, 1000.0)
    b.wait(length_ms)
    b.plant.apply_force(0, 0.0)
    b.wait(2.0 - start_ms - length_ms)
    assert b.plant.parts.axes["v_m_s"][0] == pytest.approx(1000.0 * 1e-3 * length_ms / 12.0, rel=0.02)


@pytest.mark.parametrize("name", machine_names())
def test_what_a_place_reaches_is_what_a_gauge_sees(name):
    """Tool and table together are what `position_mm` is made of; no joint belongs to both."""
    machine = load_machine(name)
    model = load_model(machine)
    places = reach(machine, model)
    assert set(places) == set(PLACES)
    np.testing.assert_array_equal(places["tool"] + places["table"], tool_motion(machine, model))
    assert not (places["tool"] * places["table"]).any()


@pytest.mark.parametrize("axis", ["-1 0 0", "0 0 1"])
def test_a_structural_joint_that_goes_another_way_is_named(tmp_path, bench, axis):
    """What a push and what a gauge would say of it could not both be right."""
    text = (models_folder() / "4030" / "4030.xml").read_text()
    turned = text.replace(
        '<joint name="flex_x" class="flex" axis="1 0 0"', f'<joint name="flex_x" axis="{axis}" type="slide"'
    )
    assert turned != text
    (tmp_path / "turned.xml").write_text(turned)
    parent = (models_folder() / "4030" / "machine.toml").read_text()
    (tmp_path / "machine.toml").write_text(parent.replace("scene.xml", "turned.xml"))
    with pytest.raises(MachineError, match=r"structure\.flex_x: its joint moves .*; allowed: by 1 along x$"):
        bench(machine=tmp_path)


@pytest.mark.parametrize(
    ("overrides", "message"),
    [
        ({"structure.flex_x.stiffness": 500.0}, r"structure\.flex_x\.stiffness: 500\.0; allowed: 0\.05 \.\. 200 N/um"),
        (
            {"structure.flex_y.stiffness": 30.0},
            r"timing\.mujoco_step: 0\.5 ms is too long for .*stiffness and .* kg; "
            r"allowed: up to 0\.\d+ ms, or .*stiffness up to [\d.]+ N/um",
        ),
        ({"payload.mass": 500.0}, r"payload\.mass: 500\.0; allowed: 0 \.\. 100 kg"),
    ],
)
def test_a_refused_number_names_the_range_that_would_be_taken(bench, overrides, message):
    with pytest.raises(MachineError, match=message) as error:
        bench(overrides)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("key", ["axes.y.stiffness", "structure.flex_y.stiffness"])
def test_the_stiffness_that_would_be_taken_is_taken(bench, key):
    """And a little more is not."""
    with pytest.raises(MachineError) as error:
        bench({key: 80.0})
    named, most = str(error.value).rsplit(", or ", 1)[1].removesuffix(" N/um").split(" up to ")
    assert named == key
    MujocoPlant(bench({key: float(most)}).plant.machine, [], np.array([100.0, 100.0, 30.0]))
    with pytest.raises(MachineError):
        bench({key: 1.01 * float(most)})
