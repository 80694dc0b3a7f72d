"""The MuJoCo plant: a machine's model and drives, put together for the compiled loop of kernel.py.

Goal: turn a `Machine` into the arrays the kernel works on, and say where the carriages are, as a gauge at the tool
would show them (model.py). The rotor, not the carriage, is where lost steps are counted.

Nut and carriage start in balance: an axis that gravity pulls hangs on the flank of its backlash from the beginning.
"""

from __future__ import annotations

import copy
import ctypes
import itertools
import math
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.drives.dynamics import BOTH, OPEN, axis_parameters, stored_energy_j
from isel_twin.drives.motor import Motor
from isel_twin.drives.servo import CAUSES, cool, forget, servo_parameters
from isel_twin.drives.servo_drive import ServoDrive, ServoMotor
from isel_twin.drives.shaft import axis_states
from isel_twin.drives.stage import AnyStage, Stage
from isel_twin.machine import Axis, Machine, MachineError
from isel_twin.plant import PLACES, Samples, Threshold, kernel, memory
from isel_twin.plant.cutting import CUT, Cut, set_cut
from isel_twin.plant.feed import supply_state
from isel_twin.plant.glide import glide, gliding
from isel_twin.plant.lead import all_behind, no_leads
from isel_twin.plant.margin import SPEEDS, available_torque
from isel_twin.plant.model import left_of_x, load_model, reach, tool_motion
from isel_twin.plant.thread import SCREW, feel

REST_TIME_S = 0.025
"""Standstill before the plant is frozen; a swinging joint is slow only at its turning points, never this long."""
LARGEST_STEP_RATIO = 1.9
"""Largest MuJoCo step times the highest frequency (rad/s) of the machine on all its springs, nuts and structure. Above
2 the exchange of forces feeds what swings, and sticking and sliding in turn can (decision P3)."""
NEAR_M = 1e-9
"""From this far before a position switch on the loop asks it itself; rounding is far below."""

_LEAST_V = 5.0
"""Supply below which no stage is known (Stage.supply_v): what a motor can do is not asked below it."""

_PHASES = {"": BOTH, "a": BOTH & ~1, "b": BOTH & ~2, "ab": OPEN}


_NOW, _EDGE, _LOST_DOF, _SAMPLED = map((memory.PLANT.names or ()).index, ("now", "edge", "lost_dof", "sampled"))
"""Places of fields in memory.PLANT."""
_QUANTITIES = {"position": memory.POSITION, "lag": memory.LAG, "fault": memory.FAULT}


_GRID = ("sample_every", "sample_ahead_ns")
_STAYS = ("mj_step", "model", "data", "sample_at", *_GRID)
"""Of memory.PLANT: addresses, and what is no business of a state."""
_SAVED = tuple(name for name in memory.Parts._fields if name != "samples")
"""Parts that a state holds: all but the samples, which have been read."""
_OWN = ("_pushes", "_inertia", "_weight", "_mobility")
"""Arrays beside the kernel's that change."""
_DATA = ("qacc_warmstart", "act", "ctrl", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat", "userdata")
"""What MuJoCo's next step depends on (mjSTATE_INTEGRATION), beside the parts and the time."""


class PlantError(RuntimeError):
    """A joint has run away: the numbers mean nothing any more."""


_LIBRARIES = ("libmujoco.so*", "libmujoco*.dylib", "mujoco*.dll")
"""What the library of the mujoco package is called on Linux, macOS and Windows."""


def _library(folder: Path) -> Path:
    """The library in the folder of the mujoco package. Raises FileNotFoundError if there is none."""
    for pattern in _LIBRARIES:
        for path in sorted(folder.glob(pattern)):
            return path
    raise FileNotFoundError(f"{folder}: no library of MuJoCo here ({', '.join(_LIBRARIES)})")


@cache
def _mj_step_address() -> int:
    """Address of mj_step in the library that the mujoco package has loaded."""
    library = _library(Path(mujoco.__file__).parent)
    return ctypes.cast(ctypes.CDLL(str(library)).mj_step, ctypes.c_void_p).value or 0


class MujocoPlant:
    """Implements `isel_twin.plant.Plant` with motors, screws and MuJoCo."""

    physics = True

    def __init__(
        self,
        machine: Machine,
        thresholds: Sequence[Threshold],
        start_mm: NDArray[np.float64],
        axes: int = 4,
        model: mujoco.MjModel | None = None,
    ) -> None:
        """Place the carriages at start_mm [3] in machine coordinates, stages off, brakes closed.

        axes: number of the controller's axes; those beyond the carriages have no mechanics and follow their command.
        model: the machine's, if somebody has it (`isel_twin.plant.model.dressed`); it belongs to the plant then.

        Raises MachineError if the model does not fit the machine or its time steps are too long for its stiffness.
        """
        self.machine = machine
        self.model = load_model(machine, visual=False) if model is None else model
        self.model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_ACTUATION  # the motors are those of the drives
        self.data = mujoco.MjData(self.model)
        self.time_ns = 0
        self.edge = False
        model, data = self.model, self.data
        self._dof = np.array([model.joint(name).dofadr[0] for name in CARRIAGES])
        self._shape_mm = 1e3 * tool_motion(machine, model)

        substep_s = machine.timing.substep_ns * 1e-9
        self._drives = np.concatenate([_drive(machine, axis, substep_s) for axis in machine.axes])
        self._states = axis_states(memory.AXES)
        self._count = axes
        self._commanded = np.zeros(max(axes, memory.AXES), dtype=np.int64)
        self._leads = no_leads(len(self._commanded))
        self._coulomb_nm = self._drives["coulomb_nm"].copy()
        self._brake_nm = np.array([axis.brake_n for axis in machine.axes]) * self._drives["travel_m_per_rad"]

        data.qpos[self._dof] = np.asarray(start_mm) * 1e-3
        mujoco.mj_forward(model, data)
        self._axes = np.zeros(memory.AXES, memory.AXIS)
        self._axes["dof"] = self._dof
        self._inertia = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, self._inertia)
        self._weight = data.qfrc_bias.copy()
        self._mobility = np.linalg.inv(self._inertia)
        self._axes["mobility_per_kg"] = np.diagonal(self._mobility)[self._dof]
        self._axes["friction_n"] = [axis.guide_friction_n for axis in machine.axes]
        self._axes["phases"] = OPEN
        self._axes["fraction"] = 1.0
        self._axes["idle_fraction"] = 1.0
        for i, axis in enumerate(machine.axes):
            if isinstance(axis.stage, Stage):  # the current of a servo motor is what its drive needs
                self._axes["idle_fraction"][i] = axis.stage.idle_current_fraction
                self._axes["idle_delay"][i] = round(axis.stage.idle_delay_s / substep_s)
                self._axes["full_steps"][i] = 1.0 / axis.stage.microsteps
        self._closed = np.array([axis.closed_loop for axis in machine.axes])
        self._axes["margin"] = 1.0
        self._axes["resistance_ohm"] = [a.motor.resistance_ohm + a.stage.extra_resistance_ohm for a in machine.axes]
        self._axes["inductance_h"] = [axis.motor.inductance_h for axis in machine.axes]
        self._axes["own_w"] = [axis.stage.quiescent_w for axis in machine.axes]
        self._axes["supply_factor"] = [axis.stage.supply_factor for axis in machine.axes]
        self._supply = supply_state(machine.supply, self.stages, machine.timing.mujoco_step_ns * 1e-9)
        self._available = np.zeros((memory.AXES, SPEEDS))
        self._find_available(1.0)
        self._axes["steps_per_rad"] = np.array([axis.steps_per_rev for axis in machine.axes]) / (2.0 * math.pi)
        pull_n = -self._weight[self._dof].round(6)
        self._axes["zero_m"] = data.qpos[self._dof] - np.sign(pull_n) * self._drives["half_backlash_m"]
        self._screws, uneven = self._lay_screws()
        self._check_steps()

        self._thresholds = np.concatenate([np.zeros(0, memory.THRESHOLD), *map(_threshold, thresholds)])
        for number in np.flatnonzero(self._thresholds["quantity"] == memory.POSITION):
            switch = self._thresholds[number]
            switch["passed"] = switch["sense"] * (data.qpos[self._dof[switch["axis"]]] - switch["limit"]) > 0.0

        self._find_free()
        scratch = mujoco.MjData(model)
        self._reach = reach(machine, model, scratch)
        self._pushes = np.zeros((memory.AXES, model.nv))
        """float64 [3, nv], what the push along each axis is at the joints."""
        self._push = np.zeros((2, model.nv))
        """What the pushes are beside `push_n`: now, and a correction of this window's sum for how they were before."""
        self._cuts = np.zeros(1, CUT)
        pulls = [self._split(way) for way in (self._reach["tool"] + self._reach["table"])[:2]]
        self._cut_joints, self._cut_nuts = (np.array(part) for part in zip(*pulls, strict=True))
        self._left = left_of_x(machine, model, scratch)
        self._lost = [""] * memory.AXES
        self._power = (False, False, False)
        self._none = np.empty(0, dtype=np.int64), np.empty((0, axes), dtype=np.int32), np.empty(0, dtype=np.int64)
        self._late = self._none
        """Times, changes and leads of the ticks after the last whole sub-step."""
        self._plant = np.zeros(1, memory.PLANT)
        self._plant["substep_ns"] = machine.timing.substep_ns
        self._plant["window"] = machine.timing.mujoco_step_ns // machine.timing.substep_ns
        self._plant["rest_windows"] = math.ceil(REST_TIME_S / (machine.timing.mujoco_step_ns * 1e-9))
        self._plant["mj_step"] = _mj_step_address()
        self._plant["model"] = model._address
        self._plant["data"] = data._address
        self._plant["lost_dof"] = -1
        self._plant["uneven"] = uneven
        self._plant["sample_at"] = kernel.NEVER
        self._samples = np.zeros((memory.SAMPLES, 2 + 2 * (model.nv + len(self._commanded) + memory.AXES)))
        self._plant["watched"] = (self._thresholds["quantity"] != memory.POSITION).any()
        self._words = self._plant.view(np.int64)
        """The same as whole numbers, by place."""
        self._substep_ns = machine.timing.substep_ns
        self._friction_n = self._axes["friction_n"].copy()
        self._loss_n = model.dof_frictionloss.copy()
        self._stops_m = model.jnt_range.copy()
        self._mass_kg = model.body_mass.copy()
        """What the machine has by itself, before anybody changes it."""
        self._joints_law, mobility = gliding(model, scratch)
        self._before = data.qpos.copy()
        """float64 [nv], joint positions one window ago."""
        self._rates_before = data.qvel.copy()
        stiffness = model.jnt_stiffness[model.dof_jntid]
        self._springs = -np.stack([self._mobility[self._dof] * of for of in (stiffness, model.dof_damping)])
        """float64 [2, 3, nv], acceleration of each carriage by the way and by the speed of each joint on its spring."""
        self._place = data.qpos.copy()
        """float64 [nv], joint positions now, within a sub-step along their velocities."""
        self._parts = memory.Parts(
            plant=self._plant, axes=self._axes, drives=self._drives, screws=self._screws, states=self._states,
            thresholds=self._thresholds, commanded=self._commanded, leads=self._leads, available=self._available,
            joints_law=self._joints_law, mobility=mobility, push=self._push, springs=self._springs, cut=self._cuts,
            cut_nuts=self._cut_nuts, cut_joints=self._cut_joints, supply=self._supply, before=self._before,
            rates=self._rates_before, samples=self._samples, place=self._place, qpos=data.qpos, qvel=data.qvel,
            qacc=data.qacc, qacc_smooth=data.qacc_smooth, qfrc=data.qfrc_applied,
        )  # fmt: skip
        """What the kernel works on; none of these arrays may be replaced. MuJoCo never moves its own."""
        self._memory = memory.memory_of(self._parts)
        self._as_built: dict[str, NDArray[Any]] | None = None
        """The model before it was first changed; None: it has not been."""
        kernel.begin_window(self._memory)

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Neither copy nor pickle: the kernel would go on with the memory of this one, by its address."""
        raise TypeError("a plant cannot be copied or pickled; take `save`, and `restore` into another one")

    def save(self) -> Mapping[str, Any]:
        """See Plant.save."""
        return {
            "parts": {name: getattr(self._parts, name).copy() for name in _SAVED},
            "own": {name: getattr(self, name).copy() for name in _OWN},
            "values": (self.time_ns, self.edge, self._power, tuple(self._lost), tuple(a.copy() for a in self._late)),
            "mujoco": {name: getattr(self.data, name).copy() for name in _DATA} | {"time": self.data.time},
            "model": None if self._as_built is None else _arrays(self.model),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """See Plant.restore. Every array stays where it is: the kernel knows their addresses."""
        own = {name: self._plant[name].copy() for name in _STAYS}
        for name, saved in state["parts"].items():
            getattr(self._parts, name)[...] = saved
        for name, saved in state["own"].items():
            getattr(self, name)[...] = saved
        self.time_ns, self.edge, self._power, lost, late = state["values"]
        self._lost = list(lost)
        self._late = (late[0].copy(), late[1].copy(), late[2].copy())
        for name, saved in state["mujoco"].items():
            if name == "time":
                self.data.time = saved
            else:
                getattr(self.data, name)[...] = saved
        self._set_model(state["model"])
        same = all(own[name][0] == self._plant[name][0] for name in _GRID)
        phase = int(own["sample_at"][0])
        for name, value in own.items():
            if name != "sample_at" or not same:
                self._plant[name] = value
        self._plant["sampled"] = 0
        if not same:
            self._plant["held"] = 0
            self._aim_samples(phase)

    def model_as_built(self) -> mujoco.MjModel:
        """A copy of the model as it was before anything was changed in it: for another plant of this machine."""
        model = copy.copy(self.model)
        for name, array in (self._as_built or {}).items():
            getattr(model, name)[...] = array
        return model

    def _set_model(self, arrays: Mapping[str, NDArray[Any]] | None) -> None:
        """Let the model be as saved; None: as it was built."""
        if arrays is not None:
            self._keep_as_built()
        for name, saved in (arrays or self._as_built or {}).items():
            getattr(self.model, name)[...] = saved

    def _keep_as_built(self) -> None:
        """The model is about to be changed."""
        if self._as_built is None:
            self._as_built = _arrays(self.model)

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        """See Plant.advance. Raises PlantError if a joint runs away."""
        words = self._words
        early_ns, changes, early_lead_ns = self._late
        if len(t_ns):  # whatever the ticks are, one compiled kernel
            changes = delta.astype(np.int32)
            if len(early_ns):
                t_ns, changes = np.concatenate((early_ns, t_ns)), np.concatenate((self._late[1], changes))
        else:
            t_ns = early_ns
        made = kernel.advance(self._memory, until_ns, t_ns, changes, early_lead_ns, lead_ns)
        self.time_ns = words.item(_NOW) * self._substep_ns
        self.edge = words.item(_EDGE) != 0
        if words.item(_LOST_DOF) >= 0:
            joint = self.model.joint(int(self.model.dof_jntid[words.item(_LOST_DOF)])).name
            raise PlantError(
                f"axis {joint}: runs away at {self.time_ns / 1e9:.6f} s, beyond {kernel.FAR_M:g} m or any number; "
                f"look for an enormous force, or shorten the steps in [timing] of {self.machine.file}"
            )
        if self.edge:
            self._find_free()
            self._late = self._none
            return self.time_ns
        if made == len(t_ns):
            self._late = self._none
        else:
            leads_ns = early_lead_ns
            if len(t_ns) > len(early_lead_ns):
                leads_ns = np.append(early_lead_ns, np.full(len(t_ns) - len(early_lead_ns), lead_ns, dtype=np.int64))
            self._late = t_ns[made:], changes[made:], leads_ns[made:]
        return until_ns

    def trips(self) -> NDArray[np.bool_]:
        """See Plant.trips."""
        return self._thresholds["passed"] != 0

    def set_power(self, stages: bool, brake_released: bool, lowering: bool) -> None:
        """See Plant.set_power."""
        power = (stages, brake_released, lowering)
        if power == self._power:
            return
        kernel.wake(self._memory)
        if stages and not self._power[0]:
            self._axes["still_since"] = self._plant["now"]
            self._axes["fraction"] = 1.0
            self._forget_faults()
        if not lowering:
            self._axes["fraction"] = 1.0
        self._power = power
        self._axes["lowering"] = lowering
        self._drives["coulomb_nm"] = self._coulomb_nm + (0.0 if brake_released else 1.0) * self._brake_nm
        self._set_phases()

    def reset_drives(self) -> None:
        """See Plant.reset_drives."""
        kernel.wake(self._memory)
        self._forget_faults()

    def _forget_faults(self) -> None:
        for i in np.flatnonzero(self._closed):
            forget(self._states[i])

    def set_phase_lost(self, axis: int, phases: str) -> None:
        """See Plant.set_phase_lost. Raises ValueError for anything but "a", "b", "ab" and ""."""
        if phases not in _PHASES:
            raise ValueError(f"unknown motor phases {phases!r}; there are: a, b, ab")
        kernel.wake(self._memory)
        self._lost[axis] = phases
        self._set_phases()

    def set_friction(self, axis: int, extra_n: float) -> None:
        """See Plant.set_friction."""
        self._keep_as_built()
        kernel.wake(self._memory)
        dof = self._dof[axis]
        self._axes["friction_n"][axis] = self._friction_n[axis] + extra_n
        self.model.dof_frictionloss[dof] = self._loss_n[dof] + extra_n
        self._remodel()

    def set_obstacle(self, axis: int, position_mm: float | None) -> None:
        """See Plant.set_obstacle: the joint gets another stop, unless its own comes before."""
        self._keep_as_built()
        kernel.wake(self._memory)
        joint = self.model.dof_jntid[self._dof[axis]]
        low_m, high_m = self._stops_m[joint]
        if position_mm is not None and self._axes["x_m"][axis] < 1e-3 * position_mm:
            high_m = min(high_m, 1e-3 * position_mm)
        elif position_mm is not None:
            low_m = max(low_m, 1e-3 * position_mm)
        self.model.jnt_range[joint] = low_m, high_m
        self._remodel()

    def set_payload(self, place: str, mass_kg: float) -> None:
        """See Plant.set_payload. What is pushed now is pushed on."""
        self._keep_as_built()
        kernel.wake(self._memory)
        body = self.model.site(PLACES[place]).bodyid[0]
        self.model.body_mass[body] = self._mass_kg[body] + mass_kg
        self._remodel()
        self._find_mobility()
        self._share_pushes()

    def set_undervoltage(self, missing: float) -> None:
        """See Plant.set_undervoltage."""
        kernel.wake(self._memory)
        left = 1.0 - missing
        if self._supply["on"][0]:
            self._supply["source_v"] = left * self.machine.axes[0].stage.supply_v
            self._supply["steady"] = 0
        else:
            for i, axis in enumerate(self.machine.axes):
                self._drives["drive_v"][i] = left * axis.stage.drive_v
                self._drives["return_v"][i] = left * axis.stage.supply_v
        self._find_available(left)

    def _find_available(self, left: float) -> None:
        """What the motors can do with this part of their voltage."""
        for i, axis in enumerate(self.machine.axes):
            if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
                stage = axis.stage
                if left != 1.0:
                    stage = replace(stage, supply_v=max(left * stage.supply_v, _LEAST_V))
                self._available[i] = available_torque(axis.motor, stage)

    def _remodel(self) -> None:
        """The model has been changed: what follows from it, from MuJoCo's next step on."""
        scratch = mujoco.MjData(self.model)
        mujoco.mj_setConst(self.model, scratch)
        law, mobility = gliding(self.model)
        self._joints_law[:] = law
        self._parts.mobility[:] = mobility

    def _find_mobility(self) -> None:
        """What follows from the masses, as the machine stands now."""
        scratch = mujoco.MjData(self.model)
        scratch.qpos[:] = self.data.qpos
        mujoco.mj_forward(self.model, scratch)
        mujoco.mj_fullM(self.model, scratch, self._inertia)
        self._weight[:] = scratch.qfrc_bias
        self._mobility[:] = np.linalg.inv(self._inertia)
        self._axes["mobility_per_kg"] = np.diagonal(self._mobility)[self._dof]
        model = self.model
        stiffness = model.jnt_stiffness[model.dof_jntid]
        self._springs[:] = -np.stack([self._mobility[self._dof] * of for of in (stiffness, model.dof_damping)])
        pulls = [self._split(way) for way in (self._reach["tool"] + self._reach["table"])[:2]]
        joints, nuts = (np.array(part) for part in zip(*pulls, strict=True))
        self._cut_joints[:], self._cut_nuts[:] = joints, nuts

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        """See Plant.apply_force. Raises ValueError for a force that is not a finite number.

        The sub-steps know carriages and nuts alone, MuJoCo all joints: a carriage is pushed in the sub-steps by what
        would move it alike at the nut, and MuJoCo is told the rest with its next step.
        """
        if not math.isfinite(force_n):
            raise ValueError(f"force on axis {CARRIAGES[axis]}: {force_n!r} N is not a finite number")
        if place and place not in PLACES:
            raise ValueError(f"a force cannot act at {place!r}; there are: {', '.join(PLACES)}")
        kernel.wake(self._memory)
        if not place:
            place = "tool" if self._reach["tool"][axis, self._dof[axis]] else "table"
        self._pushes[axis] = force_n * self._reach[place][axis]
        self._share_pushes()

    def _share_pushes(self) -> None:
        """Tell sub-steps and MuJoCo's steps what each has to do with the pushes."""
        joints_n, nuts_n = self._split(self._pushes.sum(axis=0))
        self._axes["push_n"] = nuts_n
        over = self._plant["now"][0] % self._plant["window"][0]
        self._push[1] += over * (self._push[0] - joints_n)
        self._push[0] = joints_n

    def set_cut(self, cut: Cut | None) -> None:
        """See Plant.set_cut."""
        kernel.wake(self._memory)
        set_cut(self._cuts, cut, int(self._plant["now"][0]), self.machine.timing.substep_ns * 1e-9, self._left)

    @property
    def cut_n(self) -> NDArray[np.float64]:
        """float64 [2], force of the cut on the tool along X and Y in the last sub-step; the table has the opposite."""
        return np.array([self._cuts["x_n"][0], self._cuts["y_n"][0]])

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        """See Plant.set_trip_point."""
        if self._thresholds["quantity"][threshold] != memory.POSITION:
            raise ValueError(f"threshold {threshold} is not a position")
        self._thresholds["limit"][threshold] = position_mm * 1e-3
        self._find_free()

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """See Plant.position_mm; as the drives see it, and within a sub-step along its velocity."""
        position_mm: NDArray[np.float64] = self._shape_mm @ self._place
        return position_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        """See Plant.velocity_mm_s."""
        velocity_mm_s: NDArray[np.float64] = self._shape_mm @ self._rates()
        return velocity_mm_s

    @property
    def commanded(self) -> NDArray[np.int64]:
        """See Plant.commanded."""
        return self._commanded[: self._count].copy()

    @property
    def told(self) -> NDArray[np.int64]:
        """See Plant.told."""
        told = self.commanded
        return told + self._late[1].sum(axis=0) if len(self._late[1]) else told

    @property
    def command(self) -> NDArray[np.float64]:
        """See Plant.command."""
        return (self._commanded - all_behind(self._leads, self.time_ns))[: self._count]

    @property
    def rotor(self) -> NDArray[np.float64]:
        """See Plant.rotor."""
        rotor = self._commanded - all_behind(self._leads, self.time_ns)
        rotor[: memory.AXES] = self._states["theta_rad"] * self._axes["steps_per_rad"]
        return rotor[: self._count]

    @property
    def lag(self) -> NDArray[np.float64]:
        """See Plant.lag."""
        lag = self.command - self.rotor
        lag[: memory.AXES] -= self._states["shift"][: self._count]
        return lag

    @property
    def powered(self) -> NDArray[np.bool_]:
        """See Plant.powered."""
        powered = np.full(len(self._commanded), self._power[0])
        powered[: memory.AXES] = self._live
        return powered[: self._count]

    @property
    def _live(self) -> NDArray[np.bool_]:
        """bool [3], which motors are let have current."""
        live: NDArray[np.bool_] = (self._axes["phases"] & self._supply["gate"] != OPEN) & (self._states["fault"] == 0)
        return live

    @property
    def fault(self) -> NDArray[np.bool_]:
        """See Plant.fault."""
        fault = np.zeros(len(self._commanded), dtype=np.bool_)
        fault[: memory.AXES] = (self._axes["fault"] != 0) | (self._states["fault"] != 0)
        return fault[: self._count]

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        """See Plant.closed_loop."""
        return np.append(self._closed, [False] * self._count)[: self._count]

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        """See Plant.drive_faults."""
        faults = zip(self._states["faults"].tolist(), self._states["cause"].tolist(), strict=True)
        return (*((number, CAUSES[cause]) for number, cause in faults), *[(0, "")] * self._count)[: self._count]

    @property
    def overloaded(self) -> NDArray[np.bool_]:
        """See Plant.overloaded."""
        return np.append(self._states["overloaded"] != 0, [False] * self._count)[: self._count]

    @property
    def in_position(self) -> NDArray[np.bool_]:
        """See Plant.in_position."""
        arrived = (self._states["on"] != 0) & (self._states["arrived"] == self._drives["window_substeps"])
        return np.where(self.closed_loop, np.append(arrived, [True] * self._count)[: self._count], self.lag == 0.0)

    @property
    def rotor_speed(self) -> NDArray[np.float64]:
        """See Plant.rotor_speed."""
        led = self._leads["end_ns"] > self.time_ns
        speed = np.where(led, self._leads["pending"] * 1e9 / self._leads["lead_ns"], 0.0)
        speed[: memory.AXES] = self._states["omega_rad_s"] * self._axes["steps_per_rad"]
        return speed[: self._count]

    @property
    def nut_force_n(self) -> NDArray[np.float64]:
        """float64 [3], force of the screw on each nut in the last sub-step."""
        return self._states["force_n"].copy()

    @property
    def energy_j(self) -> float:
        """Mechanical energy of everything, J: moving masses and their height, rotors, detents, nuts, structure.

        At the last whole sub-step. The structure is not there yet, but at the start of MuJoCo's step, a time of t ago:
        it is taken on by a step of t with the forces there have been since. Its weights and springs have done the work
        that they do in such steps, F (v + v') t / 2 with F as at the start: so springs hold k q_n q_n-1 / 2 at the ends
        of MuJoCo's steps, which, with kinetic energy, is constant for whatever swings freely.
        """
        axes, data, stiffness = self._axes, self.data, self.model.jnt_stiffness[self.model.dof_jntid]
        drives = sum(
            stored_energy_j(self._drives[i], self._states[i], axes["x_m"][i] - axes["zero_m"][i])
            for i in range(memory.AXES)
        )
        rates, went_s = data.qvel.copy(), 0.0
        made = 0 if self._plant["frozen"][0] else int(self._plant["now"][0] % self._plant["window"][0])
        if made:
            forces_n = self._push[0] + self._push[1] / made
            forces_n += np.array([self._cuts["sum_x_n"][0], self._cuts["sum_y_n"][0]]) @ self._cut_joints / made
            forces_n[self._dof] += axes["sum_n"] / made
            went_s = 1e-9 * made * self._substep_ns
            scratch = np.empty((3, len(rates)))
            scratch[0] = data.qpos
            glide(self._joints_law.copy(), self._parts.mobility, went_s, scratch[0], rates, *scratch[1:], forces_n)
        way = 0.5 * went_s * (data.qvel + rates)
        rates[self._dof] = axes["v_m_s"]
        joints = 0.5 * (self._before + data.qpos) + way
        joints[self._dof] = axes["x_m"]
        springs = (stiffness * data.qpos) @ (0.5 * self._before + way)
        return float(drives + 0.5 * rates @ self._inertia @ rates + springs + self._weight @ joints)

    @property
    def stages(self) -> tuple[AnyStage, ...]:
        """See Plant.stages."""
        return tuple(axis.stage for axis in self.machine.axes)

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        """See Plant.current_fraction."""
        fraction = self._axes["fraction"].copy()
        since = int(self._plant["now"][0] - self._plant["frozen_at"][0]) if self._plant["frozen"][0] else 0
        for i in np.flatnonzero(self._closed):
            fraction[i] = math.sqrt(cool(self._drives[i], self._states[i], since))
        return np.where(self._live, fraction, 0.0)

    @property
    def supply_v(self) -> float:
        """See Plant.supply_v."""
        return float(self._supply["voltage_v"][0]) if self._supply["on"][0] else math.nan

    @property
    def margin(self) -> NDArray[np.float64]:
        """See Plant.margin."""
        margin = np.full(len(self._commanded), np.nan)
        margin[: memory.AXES] = self._axes["margin"]
        return margin[: self._count]

    def take_margin(self) -> NDArray[np.float64]:
        """See Plant.take_margin."""
        taken = self.margin
        self._axes["margin"] = 1.0
        return taken

    def watch_margin(self) -> None:
        """See Plant.watch_margin."""
        kernel.look(self._memory)
        self.sample_again()

    # Samples taken in the loop, for recordings: `isel_twin.plant.Sampled`

    def fits(self, interval_ns: int) -> bool:
        """See Sampled.fits."""
        return interval_ns > 0 and interval_ns % self._substep_ns == 0

    def sample_every(self, interval_ns: int, from_ns: int = 0) -> None:
        """See Sampled.sample_every."""
        if interval_ns == 0:
            self._plant["sample_every"] = self._plant["sample_ahead_ns"] = self._plant["sampled"] = 0
            self._plant["sample_at"] = kernel.NEVER
            return
        if not self.fits(interval_ns):
            raise ValueError(f"samples every {interval_ns} ns; allowed: multiples of {self._substep_ns} ns")
        self._plant["sample_every"] = interval_ns // self._substep_ns
        self._plant["sample_ahead_ns"] = from_ns % self._substep_ns
        self._plant["held"] = 0
        self._aim_samples(from_ns // self._substep_ns)

    def _aim_samples(self, phase: int) -> None:
        """The next sample is the first of the grid after now; phase: a sub-step of the grid."""
        now, every = self._words.item(_NOW), int(self._plant["sample_every"][0])
        self._plant["sample_at"] = now + 1 + (phase - now - 1) % every if every else kernel.NEVER

    def sample_again(self) -> None:
        """See Sampled.sample_again."""
        self._plant["held"] = 0

    @property
    def samples_waiting(self) -> int:
        """See Sampled.samples_waiting."""
        return self._words.item(_SAMPLED)

    def take_samples(self) -> Samples:
        """See Sampled.take_samples."""
        rows = self._samples[: self.samples_waiting]
        self._plant["sampled"] = 0
        joints, commands = self.model.nv, len(self._commanded)
        widths = (1, joints, joints, commands, commands, memory.AXES, memory.AXES, 1)
        ends = itertools.accumulate(widths)
        columns = (rows[:, end - width : end].copy() for width, end in zip(widths, ends, strict=True))
        now, place, rates, commanded, rotor, current, margin, supply_v = columns
        count = self._count
        margins = np.full((len(rows), commands), np.nan)
        margins[:, : memory.AXES] = margin
        return Samples(
            time_ns=now[:, 0].astype(np.int64) * self._substep_ns + self._plant["sample_ahead_ns"],
            position_mm=_each(self._shape_mm, place),
            velocity_mm_s=_each(self._shape_mm, rates),
            commanded=commanded[:, :count].astype(np.int64),
            rotor=rotor[:, :count],
            current_fraction=current,
            margin=margins[:, :count],
            supply_v=supply_v[:, 0],
        )

    @property
    def turn_steps(self) -> NDArray[np.float64]:
        """See Plant.turn_steps."""
        turns = [float(axis.steps_per_rev) for axis in self.machine.axes]
        return np.array([*turns, *[1.0] * self._count])[: self._count]

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        """See Plant.slip_steps; one step on an axis that has no motor here."""
        periods = [axis.slip_steps for axis in self.machine.axes]
        return np.array([*periods, *[1.0] * self._count])[: self._count]

    @property
    def at_rest(self) -> bool:
        """See Plant.at_rest."""
        axes = self._axes
        full = (axes["lowering"] != 0) & (axes["phases"] != OPEN) & (axes["fraction"] != axes["idle_fraction"])
        return bool(self._plant["frozen"][0]) and not full.any() and not len(self._late[0])

    # For loops of others, compiled together with the kernel

    @property
    def memory(self) -> NDArray[np.void]:
        """MEMORY [1], for compiled code that calls `kernel.advance` itself, of a plant that it keeps alive. `time_ns`,
        `edge` and all that is made of them stay behind: such a plant is advanced in that way alone."""
        return self._memory

    @property
    def shape_mm(self) -> NDArray[np.float64]:
        """float64 [3, nv], what a metre of each joint moves the tool over the table along X, Y and Z, mm."""
        return self._shape_mm.copy()

    def scene(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The machine as it stands now, with everything there is to see: for pictures and viewers, on a copy."""
        model = load_model(self.machine)
        data = mujoco.MjData(model)
        data.qpos[:] = self._place
        mujoco.mj_forward(model, data)
        return model, data

    def _rates(self) -> NDArray[np.float64]:
        """float64 [nv], joint velocities at this moment."""
        now = self.data.qvel.copy()
        now[self._dof] = self._axes["v_m_s"]
        return now

    def _find_free(self) -> None:
        """Between which positions no threshold of an axis changes: only beyond them the loop looks at each of them."""
        self._axes["free_low_m"], self._axes["free_high_m"] = -math.inf, math.inf
        for t in self._thresholds[self._thresholds["quantity"] == memory.POSITION]:
            axis = self._axes[t["axis"]]
            end_m = t["limit"] - t["sense"] * (t["hysteresis"] if t["passed"] else 0.0)
            if (t["sense"] > 0.0) == (t["passed"] == 0):
                axis["free_high_m"] = min(axis["free_high_m"], end_m - NEAR_M)
            else:
                axis["free_low_m"] = max(axis["free_low_m"], end_m + NEAR_M)

    def _split(self, joints_n: NDArray[np.float64]) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """Forces on the joints [nv]: what is left of them [nv] beside forces on the nuts [3] that would accelerate the
        carriages alike, and those."""
        nuts_n = (self._mobility @ joints_n)[self._dof] / self._axes["mobility_per_kg"]
        joints_n = joints_n.copy()
        joints_n[self._dof] -= nuts_n
        return joints_n, nuts_n

    def _set_phases(self) -> None:
        lost = ["" if closed else lost for lost, closed in zip(self._lost, self._closed, strict=True)]
        self._axes["phases"] = [_PHASES[phases] if self._power[0] else OPEN for phases in lost]
        self._drives["connected"] = [not lost for lost in self._lost]

    def _lay_screws(self) -> tuple[NDArray[np.void], bool]:
        """[3] SCREW, the drives told of them; whether one is not the same everywhere."""
        screws = [axis.screw for axis in self.machine.axes]
        laid = np.zeros(memory.AXES, SCREW)
        laid["start_m"] = self._axes["zero_m"]
        laid["travel_m_per_rad"] = self._drives["travel_m_per_rad"]
        laid["cyclic_m"] = [screw.cyclic_error_m for screw in screws]
        laid["soft_m_per_n"] = [screw.bearing_m_per_n for screw in screws]
        laid["free_m"] = [screw.free_length_m for screw in screws]
        laid["rod_n"] = [screw.rod_n for screw in screws]
        uneven = any(screw.cyclic_error_m or screw.rod_n < math.inf for screw in screws)
        if uneven:
            feel(laid, self._axes, self._drives, self._states)
        return laid, uneven

    def _check_steps(self) -> None:
        """Refuse a MuJoCo step in which the machine would swing too far on its springs."""
        machine, stiffness = self.machine, self.model.jnt_stiffness[self.model.dof_jntid]
        stiffness[self._dof] = [_stiffest_n_per_m(axis) for axis in machine.axes]
        step_s = machine.timing.mujoco_step_ns * 1e-9
        highest_rad_s, strain = _highest(self._inertia, stiffness)
        if step_s * highest_rad_s <= LARGEST_STEP_RATIO:
            return
        dof = int(np.argmax(strain))
        keys = {name: f"axes.{name}.stiffness" for name in CARRIAGES}
        name = self.model.joint(int(self.model.dof_jntid[dof])).name
        key = keys.get(name, f"structure.{name}.stiffness")
        least, most = 0.0, float(stiffness[dof])
        while most - least > 1e-3 * most:  # which stiffness would do, the others as they are
            stiffness[dof] = 0.5 * (least + most)
            holds = step_s * _highest(self._inertia, stiffness)[0] <= LARGEST_STEP_RATIO
            least, most = (float(stiffness[dof]), most) if holds else (least, float(stiffness[dof]))
            if most < 1e3:
                break
        softer = f", or {key} up to {math.floor(least / 1e4) / 100:g} N/um" if least > 1e4 else ""
        raise MachineError(
            f"{machine.file}: timing.mujoco_step: {step_s * 1e3:g} ms is too long for {key} and "
            f"{1.0 / self._mobility[dof, dof]:.3g} kg; "
            f"allowed: up to {math.floor(1e5 * LARGEST_STEP_RATIO / highest_rad_s) / 100:g} ms{softer}"
        )


def _arrays(model: mujoco.MjModel) -> dict[str, NDArray[Any]]:
    """Every number of a model that mj_setConst may change, by name."""
    names = (name for name in dir(model) if not name.startswith("_"))
    arrays = {name: array for name in names if isinstance(array := getattr(model, name), np.ndarray)}
    return {name: array.copy() for name, array in arrays.items() if array.dtype == np.float64 and array.size}


def _each(matrix: NDArray[np.float64], rows: NDArray[np.float64]) -> NDArray[np.float64]:
    """The product with each of some vectors [n, k], to the bit as with one of them."""
    products: NDArray[np.float64] = np.matmul(matrix, rows[:, :, None])[..., 0]
    return products


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
    stiffest = replace(
        axis.screw, stiffness_n_per_m=_stiffest_n_per_m(axis), rod_n=math.inf, free_length_m=0.0, middle_m=0.0
    )
    try:
        if isinstance(axis.stage, ServoDrive) and isinstance(axis.motor, ServoMotor):
            return servo_parameters(axis.motor, axis.stage, stiffest, substep_s)
        if isinstance(axis.stage, Stage) and isinstance(axis.motor, Motor):
            return axis_parameters(axis.motor, axis.stage, stiffest, substep_s)
        raise ValueError("motor and stage of two kinds")
    except ValueError as error:
        raise MachineError(f"{machine.file}: axes.{axis.name}: {error}") from None


def _threshold(threshold: Threshold) -> NDArray[np.void]:
    """One record of memory.THRESHOLD, shape [1]; a position has still to be compared with the carriage."""
    record = np.zeros(1, memory.THRESHOLD)
    record["quantity"] = _QUANTITIES[threshold.quantity]
    record["axis"] = threshold.axis
    record["sense"] = threshold.sense
    scale = 1e-3 if threshold.quantity == "position" else 1.0
    record["limit"] = threshold.limit * scale
    record["hysteresis"] = threshold.hysteresis * scale if threshold.quantity != "fault" else 0.0
    record["passed"] = threshold.quantity == "lag" and threshold.limit < 0.0
    return record
