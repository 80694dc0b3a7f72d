"""A machine as numbers for the compiled loop: its MuJoCo model, and the arrays of memory.py filled for it.

    Machine, thresholds, start --- build ---> Built (prepared.py)
    Machine, start ------------- rebuild ---> the same arrays with other numbers, to the bit what `build` would give

Nut and carriage start in balance: an axis pulled by gravity rests on the flank of its backlash from the beginning
(plant/8).
"""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import replace
from functools import lru_cache
from typing import Any

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.dynamics import OPEN, axis_parameters
from isel_twin.drives.motor import Motor
from isel_twin.drives.servo import servo_parameters
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.shaft import AXIS_PARAMETERS, AXIS_STATE, axis_states, lay_shaft
from isel_twin.drives.stage import Stage
from isel_twin.machine import Axis, Machine, MachineError
from isel_twin.native import core
from isel_twin.plant import Threshold, memory, touch
from isel_twin.plant.cutting import CUT
from isel_twin.plant.feed import SUPPLY, supply_state
from isel_twin.plant.glide import JOINT, slides, written_out
from isel_twin.plant.lead import LEAD, no_leads
from isel_twin.plant.margin import SPEEDS, available_torque
from isel_twin.plant.memory import Parts
from isel_twin.plant.model import MODELS, Asked, asked_of, bare, found_targets, left_of_x, reach, tool_motion
from isel_twin.plant.native import mj_step_address, time_step_address
from isel_twin.plant.prepared import Built, Frame
from isel_twin.plant.thread import SCREW, laid_screw
from isel_twin.plant.weighing import check_steps, stiffest_n_per_m, weigh

REST_TIME_S = 0.025  # standstill before the plant is frozen; a swinging joint is never slow for this long
FINER = 4, 5, 3, 2  # parts of a window while the structure is shaken: the first that divides it
NEAR_M = 1e-9  # distance from a position switch at which the loop begins to compare; rounding is far below
_LEAST_V = 5.0  # least Stage.supply_v; below it a motor's torque is taken as at this voltage
_QUANTITIES = {"position": memory.POSITION, "lag": memory.LAG, "fault": memory.FAULT, "touch": memory.TOUCH}


@lru_cache(MODELS)
def _frame(asked: Asked) -> Frame:
    known = bare(asked)
    data = mujoco.MjData(known.model)
    found = reach(asked.machine, known.model, data)
    targets = found_targets(asked.machine, known.model, data)
    for kept in (*found.values(), targets):
        kept.flags.writeable = False
    return Frame(known, slides(known.model, data), found, left_of_x(asked.machine, known.model, data), targets)


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
    parts, own, room = _parts(model, data, len(laid), max(axes, memory.AXES), len(frame.targets))
    built = Built(
        machine=machine,
        model=model,
        data=data,
        scratch=data,
        parts=parts,
        memory=memory.memory_of(parts),
        dof=frame.bare.axes,
        frame=frame,
        room=room,
        begun=[part.copy() for part in room],
        inertia=np.zeros((nv, nv)),
        mobility=np.zeros((nv, nv)),
        weight=np.zeros(nv),
        **own,
    )
    _power_on(built, laid)
    _copy(room, built.begun)
    _fill(built, start_mm, None)
    return built


def rebuild(built: Built, machine: Machine, start_mm: NDArray[np.float64]) -> Built:
    """The same arrays, at power-on, for another machine, whose numbers the model already has. Errors: `build`; then
    they are to be rebuilt for the machine they were for."""
    scratch = built.scratch if built.scratch is not built.data else mujoco.MjData(built.model)
    worn, built = built.machine, replace(built, machine=machine, scratch=scratch)
    _copy(built.begun, built.room)
    _fill(built, start_mm, worn)
    return built


def _fill(built: Built, start_mm: NDArray[np.float64], worn: Machine | None) -> None:
    """All numbers of the machine, at power-on. worn: whose numbers are there already; None: nobody's."""
    _wear(built, worn)
    begun = [part.copy() for part in built.room]
    data, parts, dof = built.data, built.parts, built.dof
    _stand(built, start_mm)
    weigh(built, data)
    check_steps(built)
    _copy(begun, built.begun)
    written_out(built.frame.slides, built.model, built.scratch, built.mobility, built.weight, parts.joints_law)
    parts.mobility[:] = built.mobility
    if built.scratch is data:
        _stand(built, start_mm)
    core.balance(built.memory, data.qpos, built.weight)
    if parts.plant["uneven"][0]:
        core.feel_nuts(built.memory)
    for switch in parts.thresholds:
        if switch["quantity"] == memory.POSITION:
            switch["passed"] = switch["sense"] * (data.qpos[dof[switch["axis"]]] - switch["limit"]) > 0.0
    if len(parts.thresholds):
        find_free(parts)
    core.begin_window(built.memory)
    if parts.feeler["on"][0]:
        core.feel_now(built.memory)


def _copy(source: list[NDArray[np.uint8]], target: list[NDArray[np.uint8]]) -> None:
    for have, into in zip(source, target, strict=True):
        into[:] = have


def _stand(built: Built, start_mm: NDArray[np.float64]) -> None:
    """MuJoCo's state at power-on."""
    mujoco.mj_resetData(built.model, built.data)
    built.data.qpos[built.dof] = np.asarray(start_mm) * 1e-3
    mujoco.mj_forward(built.model, built.data)


def find_available(built: Built, left: float) -> None:
    """Fill in the available torque of the stepper motors at this part of their supply voltage."""
    for i, axis in enumerate(built.machine.axes):
        if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
            stage = replace(axis.stage, supply_v=max(left * axis.stage.supply_v, _LEAST_V))
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
    model: mujoco.MjModel, data: mujoco.MjData, thresholds: int, commands: int, targets: int
) -> tuple[Parts, dict[str, NDArray[Any]], list[NDArray[np.uint8]]]:
    """All arrays of the loop, those of `Built` that go with them, and the bytes of both but what is MuJoCo's: each in
    memory of its own, so that a sanitizer sees who goes beyond. The numbers come later."""
    nv, pairs, three = model.nv, len(data.sensordata), memory.AXES
    laid: dict[str, tuple[tuple[int, ...], Any]] = {
        "plant": ((1,), memory.PLANT),
        "axes": ((three,), memory.AXIS),
        "drives": ((three,), AXIS_PARAMETERS),
        "screws": ((three,), SCREW),
        "states": ((three,), AXIS_STATE),
        "thresholds": ((thresholds,), memory.THRESHOLD),
        "commanded": ((commands,), np.int64),
        "leads": ((commands,), LEAD),
        "available": ((three, SPEEDS), np.float64),
        "joints_law": ((nv,), JOINT),
        "mobility": ((nv, nv), np.float64),
        "push": ((2, nv), np.float64),
        "springs": ((2, three, nv), np.float64),
        "cut": ((1,), CUT),
        "tip_nuts": ((three, three), np.float64),
        "tip_joints": ((three, nv), np.float64),
        "feeler": ((1,), touch.FEELER),
        "targets": ((targets,), touch.TARGET),
        "shape": ((three, nv), np.float64),
        "supply": ((1,), SUPPLY),
        "before": ((nv,), np.float64),
        "rates": ((nv,), np.float64),
        "touching": ((pairs,), np.int64),
        "touched_m": ((pairs, three), np.float64),
        "kept": ((three * (memory.AXIS.itemsize + AXIS_STATE.itemsize) // 8 + 3 * nv,), np.int64),
        "place": ((nv,), np.float64),
        "shape_mm": ((three, nv), np.float64),
        "coulomb_nm": ((three,), np.float64),
        "brake_nm": ((three,), np.float64),
        "closed": ((three,), np.bool_),
    }
    room = [np.zeros(math.prod(shape) * np.dtype(kind).itemsize, np.uint8) for shape, kind in laid.values()]
    own = {name: part.view(kind).reshape(shape) for part, (name, (shape, kind)) in zip(room, laid.items(), strict=True)}
    parts = Parts(
        samples=np.zeros((memory.SAMPLES, 4 + 2 * (nv + commands) + 3 * memory.AXES)),
        found=data.sensordata,
        qpos=data.qpos,
        qvel=data.qvel,
        qacc=data.qacc,
        qacc_smooth=data.qacc_smooth,
        qfrc=data.qfrc_applied,
        **{name: own.pop(name) for name in laid if name in Parts._fields},
    )
    return parts, own, room


def _power_on(built: Built, thresholds: NDArray[np.void]) -> None:
    """The state of the loop at power-on, as far as it is that of any machine."""
    model, parts, plant, axes = built.model, built.parts, built.parts.plant, built.parts.axes
    parts.states[:] = axis_states(memory.AXES)
    parts.leads[:] = no_leads(len(parts.commanded))
    parts.thresholds[:] = thresholds
    parts.targets[:] = built.frame.targets
    plant["mj_step"] = mj_step_address()
    plant["model"] = model._address
    plant["step_at"] = time_step_address(model)
    plant["data"] = built.data._address
    plant["lost_dof"] = -1
    plant["sample_at"] = memory.NEVER
    plant["watched"] = (parts.thresholds["quantity"] != memory.POSITION).any()
    axes["dof"] = built.dof
    axes["phases"] = OPEN
    axes["fraction"] = axes["margin"] = axes["untaken"] = 1.0
    find_free(parts)


def _wear(built: Built, worn: Machine | None) -> None:
    """The numbers of the machine that hold wherever it stands, as far as they are not those of the worn one."""
    machine, parts = built.machine, built.parts
    timed = worn is None or machine.timing != worn.timing
    if timed:
        _wind(machine, parts.plant)
    electric = timed
    for i, axis in enumerate(machine.axes):
        was = worn.axes[i] if worn is not None else axis
        driven = timed or axis.motor is not was.motor or axis.stage is not was.stage
        if driven or axis.screw is not was.screw:
            _drive(built, axis, i, electric=driven)
        if driven:
            electric = True
            _power(machine, axis, parts.axes[i])
            if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
                parts.available[i] = available_torque(axis.motor, axis.stage)
        parts.axes[i]["friction_n"] = axis.guide_friction_n
        built.brake_nm[i] = axis.brake_n * parts.drives[i]["travel_m_per_rad"]
    screws = [axis.screw for axis in machine.axes]
    parts.plant["uneven"] = any(screw.cyclic_error_m or screw.rod_n < math.inf for screw in screws)
    if electric or worn is None or machine.supply is not worn.supply:
        step_s = machine.timing.mujoco_step_ns * 1e-9
        parts.supply[:] = supply_state(machine.supply, [axis.stage for axis in machine.axes], step_s)
    if worn is None or machine.probe is not worn.probe or machine.plate is not worn.plate:
        parts.feeler[:] = touch.feelers(machine)
    if worn is None or (machine is not worn and _geometry(machine) != _geometry(worn)):
        parts.shape[:] = tool_motion(machine, built.model)
        built.shape_mm[:] = 1e3 * parts.shape


def _wind(machine: Machine, plant: NDArray[np.void]) -> None:
    """The numbers of the grid of time."""
    window = machine.timing.mujoco_step_ns // machine.timing.substep_ns
    plant["substep_ns"] = machine.timing.substep_ns
    plant["window"] = plant["usual"] = window
    plant["fine"] = next((window // parts for parts in FINER if window % parts == 0), window)
    plant["rest_windows"] = math.ceil(REST_TIME_S / (machine.timing.mujoco_step_ns * 1e-9))


def _geometry(machine: Machine) -> Hashable:
    """What `tool_motion` looks at."""
    return machine.imperfections, machine.squareness, tuple((mode.joint, mode.axis) for mode in machine.structure)


def _power(machine: Machine, axis: Axis, record: np.void) -> None:
    """What the loop has to know of motor and stage beside the drive itself."""
    record["idle_fraction"], record["idle_delay"], record["full_steps"] = 1.0, 0, 0.0
    if isinstance(axis.stage, Stage):  # the current of a servo motor is what its drive needs
        record["idle_fraction"] = axis.stage.idle_current_fraction
        record["idle_delay"] = round(axis.stage.idle_delay_s / (machine.timing.substep_ns * 1e-9))
        record["full_steps"] = 1.0 / axis.stage.microsteps
    record["resistance_ohm"] = axis.motor.resistance_ohm + axis.stage.extra_resistance_ohm
    record["inductance_h"] = axis.motor.inductance_h
    record["own_w"] = axis.stage.quiescent_w
    record["supply_factor"] = axis.stage.supply_factor
    record["steps_per_rad"] = axis.steps_per_rev / (2.0 * math.pi)


def _drive(built: Built, axis: Axis, i: int, *, electric: bool) -> None:
    """Drive and screw, with the nut where that is stiffest; electric: motor and stage, too. Raises MachineError."""
    machine, screw, drives = built.machine, axis.screw, built.parts.drives
    substep_s, stiffest = machine.timing.substep_ns * 1e-9, stiffest_n_per_m(axis)
    try:
        if isinstance(axis.stage, ServoDrive) and isinstance(axis.motor, ServoMotor):
            drives[i] = servo_parameters(axis.motor, axis.stage, screw, substep_s, stiffest)[0]
        elif isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
            if electric:
                drives[i] = axis_parameters(axis.motor, axis.stage, screw, substep_s, stiffest)[0]
            else:
                lay_shaft(drives[i : i + 1], screw, axis.motor.rotor_inertia_kgm2, substep_s, stiffest)
        else:
            raise ValueError("motor and stage of two kinds")
    except ValueError as error:
        raise MachineError(f"{machine.file}: axes.{axis.name}: {error}") from None
    built.closed[i] = axis.closed_loop
    built.coulomb_nm[i] = screw.coulomb_nm
    built.parts.screws[i] = laid_screw(screw)


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
