"""A machine as numbers for the compiled loop: its MuJoCo model, and the arrays of memory.py filled for it.

    Machine, thresholds, start --- build ---> Built: model, data, Parts and what it takes to change them later
    Machine, start ------------- rebuild ---> the same arrays with other numbers, to the bit what `build` would give

Nut and carriage start in balance: an axis pulled by gravity rests on the flank of its backlash from the beginning
(plant/8).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.drives.dynamics import OPEN, axis_parameters
from isel_twin.drives.motor import Motor
from isel_twin.drives.servo import servo_parameters
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.shaft import AXIS_PARAMETERS, axis_states
from isel_twin.drives.stage import Stage
from isel_twin.machine import Axis, Machine, MachineError
from isel_twin.plant import Threshold, kernel, memory, touch
from isel_twin.plant.cutting import CUT
from isel_twin.plant.feed import SUPPLY, supply_state
from isel_twin.plant.glide import JOINT, gliding, stands_alone
from isel_twin.plant.lead import no_leads
from isel_twin.plant.margin import SPEEDS, available_torque
from isel_twin.plant.memory import Parts
from isel_twin.plant.model import MODELS, Asked, asked_of, compiled, found_targets, left_of_x, reach, tool_motion
from isel_twin.plant.native import mj_step_address, time_step_address
from isel_twin.plant.thread import SCREW, feel

REST_TIME_S = 0.025  # standstill before the plant is frozen; a swinging joint is never slow for this long
# Largest MuJoCo step times the highest frequency (rad/s) of the machine on all its springs, nuts and structure. Above 2
# the exchange of forces feeds oscillations; stick-slip can feed them below that (decision plant/3).
LARGEST_STEP_RATIO = 1.9
FINER = 4, 5, 3, 2  # parts of a window while the structure is shaken: the first that divides it
NEAR_M = 1e-9  # distance from a position switch at which the loop begins to compare; rounding is far below
_LEAST_V = 5.0  # least Stage.supply_v; below it a motor's torque is taken as at this voltage
_QUANTITIES = {"position": memory.POSITION, "lag": memory.LAG, "fault": memory.FAULT, "touch": memory.TOUCH}


@dataclass(frozen=True, eq=False)
class Built:
    """A machine prepared for the loop. Arrays change in place; never replace one, as the loop has its address."""

    machine: Machine
    model: mujoco.MjModel
    data: mujoco.MjData
    parts: Parts
    memory: NDArray[np.void]  # MEMORY [1] of the parts
    dof: NDArray[np.int64]  # [3], index of the joint of X, Y and Z in qpos and qvel
    shape_mm: NDArray[np.float64]  # [3, nv], mm of tool over table by a metre of each joint
    reach: Mapping[str, NDArray[np.float64]]  # by place (model.py)
    left: float  # `left_of_x` of model.py
    alone: bool  # `stands_alone` of glide.py
    targets: NDArray[np.void]  # TARGET [t], as they were found
    thresholds: NDArray[np.void]  # THRESHOLD [k], as they were given
    closed: NDArray[np.bool_]  # [3], which axes have servo drives
    coulomb_nm: NDArray[np.float64]  # [3], dry friction of each shaft with its brake released
    brake_nm: NDArray[np.float64]  # [3], what the brake adds when it holds (plant/9)
    inertia: NDArray[np.float64]  # [nv, nv], kg
    mobility: NDArray[np.float64]  # [nv, nv], its inverse
    weight: NDArray[np.float64]  # [nv], N

    def split(self, joints_n: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Split forces on the joints [nv]: forces on the nuts [3] with the same acceleration of the carriages (second),
        for the sub-steps, and the rest [nv] (first), for MuJoCo."""
        nuts_n = (self.mobility @ joints_n)[self.dof] / self.parts.axes["mobility_per_kg"]
        joints_n = joints_n.copy()
        joints_n[self.dof] -= nuts_n
        return joints_n, nuts_n


@dataclass(frozen=True)
class _Frame:
    """What follows from the bodies of a model, whatever they weigh."""

    reach: Mapping[str, NDArray[np.float64]]
    left: float
    alone: bool
    targets: NDArray[np.void]


@lru_cache(MODELS)
def _frame(asked: Asked) -> _Frame:
    model = compiled(asked)
    data = mujoco.MjData(model)
    found = reach(asked.machine, model, data)
    targets = found_targets(asked.machine, model, data)
    for kept in (*found.values(), targets):
        kept.flags.writeable = False
    return _Frame(found, left_of_x(asked.machine, model, data), stands_alone(model, data), targets)


def build(
    machine: Machine,
    thresholds: Sequence[Threshold],
    start_mm: NDArray[np.float64],
    axes: int,
    model: mujoco.MjModel,
    data: mujoco.MjData,
) -> Built:
    """data: of the model. Other arguments and errors: `MujocoPlant`."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION  # the motors are those of the drives
    nv, frame = model.nv, _frame(asked_of(machine, visual=False, watched=model.nsensor > 0))
    laid = np.concatenate([np.zeros(0, memory.THRESHOLD), *map(_threshold, thresholds)])
    parts = _parts(model, data, laid, max(axes, memory.AXES), len(frame.targets))
    built = Built(
        machine=machine,
        model=model,
        data=data,
        parts=parts,
        memory=memory.memory_of(parts),
        dof=np.array([model.joint(name).dofadr[0] for name in CARRIAGES]),
        shape_mm=np.zeros((len(CARRIAGES), nv)),
        reach=frame.reach,
        left=frame.left,
        alone=frame.alone,
        targets=frame.targets,
        thresholds=laid.copy(),
        closed=np.zeros(memory.AXES, np.bool_),
        coulomb_nm=np.zeros(memory.AXES),
        brake_nm=np.zeros(memory.AXES),
        inertia=np.zeros((nv, nv)),
        mobility=np.zeros((nv, nv)),
        weight=np.zeros(nv),
    )
    _fill(built, start_mm)
    return built


def rebuild(built: Built, machine: Machine, start_mm: NDArray[np.float64]) -> Built:
    """The same arrays, at power-on, for another machine, whose numbers the model already has. Errors: `build`."""
    built = replace(built, machine=machine)
    _fill(built, start_mm)
    return built


def _fill(built: Built, start_mm: NDArray[np.float64]) -> None:
    """All numbers of the machine, at power-on, whatever was there before."""
    machine, model, data, parts, dof = built.machine, built.model, built.data, built.parts, built.dof
    substep_s = machine.timing.substep_ns * 1e-9
    for i, axis in enumerate(machine.axes):
        parts.drives[i] = _drive(machine, axis, substep_s)[0]
    parts.joints_law[:], parts.mobility[:] = gliding(model, data, built.alone)
    mujoco.mj_resetData(model, data)
    data.qpos[dof] = np.asarray(start_mm) * 1e-3
    mujoco.mj_forward(model, data)
    _power_on(machine, built)
    parts.shape[:] = tool_motion(machine, model)
    built.shape_mm[:] = 1e3 * parts.shape
    built.closed[:] = [axis.closed_loop for axis in machine.axes]
    built.coulomb_nm[:] = parts.drives["coulomb_nm"]
    built.brake_nm[:] = [axis.brake_n for axis in machine.axes]
    built.brake_nm[:] *= parts.drives["travel_m_per_rad"]
    _fill_axes(machine, parts.axes, dof)
    weigh(built, data)
    pull_n = -built.weight[dof].round(6)
    parts.axes["zero_m"] = data.qpos[dof] - np.sign(pull_n) * parts.drives["half_backlash_m"]
    parts.plant["uneven"] = _lay_screws(machine, parts)
    _check_steps(built)
    find_available(built, 1.0)
    for switch in parts.thresholds:
        if switch["quantity"] == memory.POSITION:
            switch["passed"] = switch["sense"] * (data.qpos[dof[switch["axis"]]] - switch["limit"]) > 0.0
    find_free(parts)
    kernel.begin_window(built.memory)
    kernel.feel_now(built.memory)


def weigh(built: Built, data: mujoco.MjData) -> None:
    """Fill in what follows from the masses. data: MuJoCo's, after `mj_forward` at the present place."""
    model, parts, dof = built.model, built.parts, built.dof
    mujoco.mj_fullM(model, data, built.inertia)
    built.weight[:] = data.qfrc_bias
    built.mobility[:] = np.linalg.inv(built.inertia)
    parts.axes["mobility_per_kg"] = np.diagonal(built.mobility)[dof]
    stiffness = model.jnt_stiffness[model.dof_jntid]
    parts.springs[:] = -np.stack([built.mobility[dof] * of for of in (stiffness, model.dof_damping)])
    pulls = [built.split(way) for way in built.reach["tool"] + built.reach["table"]]
    joints, nuts = (np.array(part) for part in zip(*pulls, strict=True))
    parts.tip_joints[:], parts.tip_nuts[:] = joints, nuts


def find_available(built: Built, left: float) -> None:
    """Fill in the available torque of the stepper motors at this part of their supply voltage."""
    for i, axis in enumerate(built.machine.axes):
        if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
            stage = axis.stage
            if left != 1.0:
                stage = replace(stage, supply_v=max(left * stage.supply_v, _LEAST_V))
            built.parts.available[i] = available_torque(axis.motor, stage)


def find_free(parts: Parts) -> None:
    """Fill in the range of positions in which no switch of an axis changes; the loop compares only outside it."""
    parts.axes["free_low_m"], parts.axes["free_high_m"] = -math.inf, math.inf
    for t in parts.thresholds[parts.thresholds["quantity"] == memory.POSITION]:
        axis = parts.axes[t["axis"]]
        end_m = t["limit"] - t["sense"] * (t["hysteresis"] if t["passed"] else 0.0)
        if (t["sense"] > 0.0) == (t["passed"] == 0):
            axis["free_high_m"] = min(axis["free_high_m"], end_m - NEAR_M)
        else:
            axis["free_low_m"] = max(axis["free_low_m"], end_m + NEAR_M)


def _parts(
    model: mujoco.MjModel, data: mujoco.MjData, thresholds: NDArray[np.void], commands: int, targets: int
) -> Parts:
    """All arrays of the loop; the numbers come later."""
    nv, pairs = model.nv, len(data.sensordata)
    return Parts(
        plant=np.zeros(1, memory.PLANT),
        axes=np.zeros(memory.AXES, memory.AXIS),
        drives=np.zeros(memory.AXES, AXIS_PARAMETERS),
        screws=np.zeros(memory.AXES, SCREW),
        states=axis_states(memory.AXES),
        thresholds=thresholds,
        commanded=np.zeros(commands, dtype=np.int64),
        leads=no_leads(commands),
        available=np.zeros((memory.AXES, SPEEDS)),
        joints_law=np.zeros(nv, JOINT),
        mobility=np.zeros((nv, nv)),
        push=np.zeros((2, nv)),
        springs=np.zeros((2, memory.AXES, nv)),
        cut=np.zeros(1, CUT),
        tip_nuts=np.zeros((memory.AXES, memory.AXES)),
        tip_joints=np.zeros((memory.AXES, nv)),
        feeler=np.zeros(1, touch.FEELER),
        targets=np.zeros(targets, touch.TARGET),
        shape=np.zeros((memory.AXES, nv)),
        supply=np.zeros(1, SUPPLY),
        before=np.zeros(nv),
        rates=np.zeros(nv),
        touching=np.zeros(pairs, dtype=np.int64),
        touched_m=np.zeros((pairs, memory.AXES)),
        found=data.sensordata,
        samples=np.zeros((memory.SAMPLES, 2 + 2 * (nv + commands) + 3 * memory.AXES)),
        kept=np.zeros(kernel.AXIS_WORDS + kernel.STATE_WORDS + 3 * nv, np.int64),
        place=np.zeros(nv),
        qpos=data.qpos,
        qvel=data.qvel,
        qacc=data.qacc,
        qacc_smooth=data.qacc_smooth,
        qfrc=data.qfrc_applied,
    )


def _power_on(machine: Machine, built: Built) -> None:
    """The state of the loop at power-on; MuJoCo's is there already."""
    model, data, parts, plant = built.model, built.data, built.parts, built.parts.plant
    step_s = machine.timing.mujoco_step_ns * 1e-9
    step_at = int(plant["step_at"][0]) or time_step_address(model)  # the model stays
    for part in (plant, parts.axes, parts.screws, parts.commanded, parts.push, parts.cut, parts.touching, parts.kept):
        part.view(np.uint8).fill(0)
    parts.touched_m.fill(0.0)
    parts.states[:] = axis_states(memory.AXES)
    parts.leads[:] = no_leads(len(parts.commanded))
    parts.thresholds[:] = built.thresholds
    parts.targets[:] = built.targets
    parts.feeler[:] = touch.feelers(machine)
    parts.supply[:] = supply_state(machine.supply, [axis.stage for axis in machine.axes], step_s)
    parts.before[:] = parts.place[:] = data.qpos
    parts.rates[:] = data.qvel
    plant["substep_ns"] = machine.timing.substep_ns
    window = machine.timing.mujoco_step_ns // machine.timing.substep_ns
    plant["window"] = plant["usual"] = window
    plant["fine"] = next((window // parts for parts in FINER if window % parts == 0), window)
    plant["rest_windows"] = math.ceil(REST_TIME_S / step_s)
    plant["mj_step"] = mj_step_address()
    plant["model"] = model._address
    plant["step_at"] = step_at
    plant["data"] = data._address
    plant["lost_dof"] = -1
    plant["sample_at"] = kernel.NEVER
    plant["watched"] = (parts.thresholds["quantity"] != memory.POSITION).any()


def _fill_axes(machine: Machine, axes: NDArray[np.void], dof: NDArray[np.int64]) -> None:
    axes["dof"] = dof
    axes["friction_n"] = [axis.guide_friction_n for axis in machine.axes]
    axes["phases"] = OPEN
    axes["fraction"] = 1.0
    axes["idle_fraction"] = 1.0
    for i, axis in enumerate(machine.axes):
        if isinstance(axis.stage, Stage):  # the current of a servo motor is what its drive needs
            axes["idle_fraction"][i] = axis.stage.idle_current_fraction
            axes["idle_delay"][i] = round(axis.stage.idle_delay_s / (machine.timing.substep_ns * 1e-9))
            axes["full_steps"][i] = 1.0 / axis.stage.microsteps
    axes["margin"] = axes["untaken"] = 1.0
    axes["resistance_ohm"] = [axis.motor.resistance_ohm + axis.stage.extra_resistance_ohm for axis in machine.axes]
    axes["inductance_h"] = [axis.motor.inductance_h for axis in machine.axes]
    axes["own_w"] = [axis.stage.quiescent_w for axis in machine.axes]
    axes["supply_factor"] = [axis.stage.supply_factor for axis in machine.axes]
    axes["steps_per_rad"] = np.array([axis.steps_per_rev for axis in machine.axes]) / (2.0 * math.pi)


def _lay_screws(machine: Machine, parts: Parts) -> bool:
    """Fill in the screws and the drives' values of them; return whether a screw is uneven."""
    screws, laid = [axis.screw for axis in machine.axes], parts.screws
    laid["start_m"] = parts.axes["zero_m"]
    laid["travel_m_per_rad"] = parts.drives["travel_m_per_rad"]
    laid["cyclic_m"] = [screw.cyclic_error_m for screw in screws]
    laid["soft_m_per_n"] = [screw.bearing_m_per_n for screw in screws]
    laid["free_m"] = [screw.free_length_m for screw in screws]
    laid["rod_n"] = [screw.rod_n for screw in screws]
    uneven = any(screw.cyclic_error_m or screw.rod_n < math.inf for screw in screws)
    if uneven:
        feel(laid, parts.axes, parts.drives, parts.states)
    return uneven


def _check_steps(built: Built) -> None:
    """Refuse a MuJoCo step that is too long for the springs of the machine."""
    machine, model = built.machine, built.model
    stiffness = model.jnt_stiffness[model.dof_jntid]
    stiffness[built.dof] = [_stiffest_n_per_m(axis) for axis in machine.axes]
    step_s = machine.timing.mujoco_step_ns * 1e-9
    highest_rad_s, strain = _highest(built.inertia, stiffness)
    if step_s * highest_rad_s <= LARGEST_STEP_RATIO:
        return
    dof = int(np.argmax(strain))
    keys = {name: f"axes.{name}.stiffness" for name in CARRIAGES}
    name = model.joint(int(model.dof_jntid[dof])).name
    key = keys.get(name, f"structure.{name}.stiffness")
    least, most = 0.0, float(stiffness[dof])
    while most - least > 1e-3 * most:  # find the stiffness that would do, the others unchanged
        stiffness[dof] = 0.5 * (least + most)
        holds = step_s * _highest(built.inertia, stiffness)[0] <= LARGEST_STEP_RATIO
        least, most = (float(stiffness[dof]), most) if holds else (least, float(stiffness[dof]))
        if most < 1e3:
            break
    softer = f", or {key} up to {math.floor(least / 1e4) / 100:g} N/um" if least > 1e4 else ""
    raise MachineError(
        f"{machine.file}: timing.mujoco_step: {step_s * 1e3:g} ms is too long for {key} and "
        f"{1.0 / built.mobility[dof, dof]:.3g} kg; "
        f"allowed: up to {math.floor(1e5 * LARGEST_STEP_RATIO / highest_rad_s) / 100:g} ms{softer}"
    )


def _highest(inertia: NDArray[np.float64], stiffness: NDArray[np.float64]) -> tuple[float, NDArray[np.float64]]:
    """Highest frequency in rad/s of masses [nv, nv] on springs [nv], and the energy in each spring as it swings so."""
    half = np.linalg.inv(np.linalg.cholesky(inertia))
    squares, shapes = np.linalg.eigh(half @ np.diag(stiffness) @ half.T)
    return math.sqrt(max(squares[-1], 0.0)), stiffness * (half.T @ shapes[:, -1]) ** 2


def _stiffest_n_per_m(axis: Axis) -> float:
    """Stiffness of the screw where its nut is nearest to the fixed bearing."""
    return axis.screw.stiffness_at(-1e-3 * axis.stop_margin_mm)


def _drive(machine: Machine, axis: Axis, substep_s: float) -> NDArray[np.void]:
    """One record of AXIS_PARAMETERS, shape [1], with the screw where it is stiffest. Raises MachineError."""
    stiffest = _stiffest_n_per_m(axis)
    try:
        if isinstance(axis.stage, ServoDrive) and isinstance(axis.motor, ServoMotor):
            return servo_parameters(axis.motor, axis.stage, axis.screw, substep_s, stiffest)
        if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
            return axis_parameters(axis.motor, axis.stage, axis.screw, substep_s, stiffest)
        raise ValueError("motor and stage of two kinds")
    except ValueError as error:
        raise MachineError(f"{machine.file}: axes.{axis.name}: {error}") from None


def _threshold(threshold: Threshold) -> NDArray[np.void]:
    """One record of memory.THRESHOLD, shape [1]; a position is not yet compared with the carriage."""
    record = np.zeros(1, memory.THRESHOLD)
    record["quantity"] = _QUANTITIES[threshold.quantity]
    record["axis"] = threshold.axis
    record["sense"] = threshold.sense
    scale = 1e-3 if threshold.quantity in ("position", "touch") else 1.0
    record["limit"] = threshold.limit * scale
    record["hysteresis"] = threshold.hysteresis * scale if threshold.quantity != "fault" else 0.0
    record["passed"] = threshold.quantity == "lag" and threshold.limit < 0.0
    return record
