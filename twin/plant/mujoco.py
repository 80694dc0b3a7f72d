"""The MuJoCo plant: motors, screws and a MuJoCo model, advanced by the compiled loop of kernel.c.

It passes ticks and settings to a built machine (built.py) and reports the carriages as a gauge at the tool would show
them (model.py). Lost steps are counted at the rotor, not at the carriage.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any, NoReturn

import mujoco
import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.dynamics import OPEN
from isel_twin.drives.servo import CAUSES
from isel_twin.drives.stage import AnyStage
from isel_twin.machine import Machine, MachineError
from isel_twin.native import address, core
from isel_twin.plant import PlantError, Threshold, memory, touch
from isel_twin.plant.altered import Alterations
from isel_twin.plant.built import build, find_free, rebuild
from isel_twin.plant.collision import Collision
from isel_twin.plant.contact import Geometry, Least, Sensed
from isel_twin.plant.cutting import Cut, set_cut, turn
from isel_twin.plant.guides import along_guides_mm
from isel_twin.plant.lead import all_behind
from isel_twin.plant.model import dress, load, load_model, same_model
from isel_twin.plant.power import Power
from isel_twin.plant.prepared import Built
from isel_twin.plant.pushing import Pushes
from isel_twin.plant.samples import GRID, LoopSamples
from isel_twin.plant.weighing import share_tip

_index = (memory.PLANT.names or ()).index
_NOW, _EDGE, _STRUCK, _LOST_DOF, _ARRIVED = map(_index, ("now", "edge", "struck", "lost_dof", "arrived"))
_ADDRESSES = ("mj_step", "model", "data", "step_at")  # fields of memory.PLANT that belong to this process
_SAVED = tuple(name for name in memory.Parts._fields if name != "samples")  # which have been read
_OWN = ("inertia", "mobility", "weight")  # arrays of `Built` beside the parts that change
# what MuJoCo's next step depends on (mjSTATE_INTEGRATION), beside the parts and the time
_DATA = ("qacc_warmstart", "act", "ctrl", "xfrc_applied", "eq_active", "mocap_pos", "mocap_quat", "userdata")


class MujocoPlant(LoopSamples):
    """Implements `isel_twin.plant.Plant` and `Sampled` with motors, screws and MuJoCo."""

    physics = True

    def __init__(
        self,
        machine: Machine,
        thresholds: Sequence[Threshold],
        start_mm: NDArray[np.float64],
        axes: int = 4,
        model: mujoco.MjModel | None = None,
    ) -> None:
        """Carriages at start_mm [3] in machine coordinates, stages off, brakes closed.

        axes: number of the controller's axes; those beyond the carriages have no mechanics and follow their command.
        model: the machine's (`isel_twin.plant.model.load_model`), watched by default; the plant then owns it.

        Raises MachineError if the model does not fit the machine or its time steps are too long for its stiffness.
        """
        if model is None:
            model, data = load(machine, visual=False, watched=True)
        else:
            data = mujoco.MjData(model)
        built = build(machine, thresholds, start_mm, axes, model, data)
        self._sensed = Sensed(built.model, built.data, built.parts, built.shape_mm)
        self._start(built, axes)

    def _start(self, built: Built, axes: int) -> None:
        """At power-on, with the numbers of a machine."""
        super().__init__(built, axes)
        self.machine = built.machine
        self.model = built.model
        self.data = built.data
        self.parts = built.parts
        self._memory = built.memory
        self._loop = core.raw("advance")
        self._at = address(built.memory)
        self.time_ns = 0
        self.edge = False
        self._altered = Alterations(built)
        self._collisions: tuple[Collision, ...] = ()
        self.set_friction = self._altered.set_friction
        self.set_obstacle = self._altered.set_obstacle
        self._pushes = Pushes(built)
        self.apply_force = self._pushes.push
        self._power = Power(built)
        self.set_power = self._power.switch
        self.reset_drives = self._power.reset_drives
        self.set_phase_lost = self._power.set_phase_lost
        self.set_undervoltage = self._power.set_undervoltage
        self._none = np.empty(0, dtype=np.int64), np.empty((0, axes), dtype=np.int32), np.empty(0, dtype=np.int64)
        self._late = self._none  # times, changes and leads of the ticks after the last whole sub-step

    def become(self, machine: Machine, start_mm: NDArray[np.float64]) -> None:
        """Begin anew, at power-on, as another machine: to the bit what a new plant would be, in half the time.
        Thresholds and axes stay.

        Raises ValueError for a machine with other bodies, travel or time step, whose model is another one, and
        MachineError as a new plant does; then it stands at power-on as the machine it was.
        """
        if not same_model(machine, self.machine):
            raise ValueError(
                f"{machine.file}: its model is another one than that of {self.machine.name}; build a new plant"
            )
        before, before_mm, bare = self.machine, self.parts.place[self.built.dof] * 1e3, self.built.frame.bare
        self._altered.restore(None)
        try:
            dress(bare, machine, self.model, self.data, before)
            self._start(rebuild(self.built, machine, start_mm), self._count)
        except MachineError:
            dress(bare, before, self.model, self.data)
            self._start(rebuild(self.built, before, before_mm), self._count)
            raise

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse copy and pickle: the kernel would use the memory of this one, by its address."""
        raise TypeError("a plant cannot be copied or pickled; take `save`, and `restore` into another one")

    # The whole state

    def save(self) -> Mapping[str, Any]:
        return {
            "parts": {name: getattr(self.parts, name).copy() for name in _SAVED},
            "own": {name: getattr(self.built, name).copy() for name in _OWN},
            "pushes": self._pushes.joints_n.copy(),
            "values": (
                self.time_ns,
                self.edge,
                self._power.switched,
                tuple(self._power.lost),
                tuple(a.copy() for a in self._late),
            ),
            "mujoco": {name: getattr(self.data, name).copy() for name in _DATA},
            "mujoco_time": self.data.time,
            "model": self._altered.save(),
        }

    def restore(self, state: Mapping[str, Any]) -> None:
        """Arrays are filled in place: the kernel has their addresses."""
        plant = self.parts.plant
        addresses, grid = ({name: plant[name].copy() for name in names} for names in (_ADDRESSES, GRID))
        sample_at = int(plant["sample_at"][0])
        for where, what in ((self.parts, "parts"), (self.built, "own"), (self.data, "mujoco")):
            for name, saved in state[what].items():
                getattr(where, name)[...] = saved
        for name, value in addresses.items():
            plant[name] = value
        self._pushes.joints_n[...] = state["pushes"]
        self.data.time = state["mujoco_time"]
        self.time_ns, self.edge, self._power.switched, lost, late = state["values"]
        self._power.lost = list(lost)
        self._late = (late[0].copy(), late[1].copy(), late[2].copy())
        self._altered.restore(state["model"])
        self.keep_grid(grid, sample_at)

    def model_as_built(self) -> mujoco.MjModel:
        return self._altered.model_as_built()

    # Time

    def advance(self, until_ns: int, t_ns: NDArray[np.int64], delta: NDArray[Any], lead_ns: int = 0) -> int:
        """Raises PlantError if a joint runs away."""
        words = self._words
        early_ns, changes, early_lead_ns = self._late
        if len(t_ns):
            t_ns, changes = self._laid(t_ns, delta)
            if len(early_ns):
                t_ns, changes = np.concatenate((early_ns, t_ns)), np.concatenate((self._late[1], changes))
        else:
            t_ns = early_ns
        ticks = address(t_ns), len(t_ns), address(changes), changes.shape[1]
        leads = address(early_lead_ns), len(early_lead_ns), int(lead_ns)
        made = self._loop(self._at, int(until_ns), *ticks, *leads)
        self.time_ns = words.item(_NOW) * self._substep_ns
        self.edge = words.item(_EDGE) != 0
        if words.item(_LOST_DOF) >= 0:
            joint = self.model.joint(int(self.model.dof_jntid[words.item(_LOST_DOF)])).name
            raise PlantError(
                f"axis {joint}: runs away at {self.time_ns / 1e9:.6f} s, beyond {memory.FAR_M:g} m or any number; "
                f"look for an enormous force, or shorten the steps in [timing] of {self.machine.file}"
            )
        if self.edge:
            if words.item(_STRUCK):
                self._collisions += self._sensed.news(self.time_ns)
                self._collisions += self._broken()
            find_free(self.parts)
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

    def _laid(self, t_ns: NDArray[np.int64], delta: NDArray[Any]) -> tuple[NDArray[np.int64], NDArray[np.int32]]:
        """Ticks as the loop takes them. Raises ValueError for arrays that do not fit."""
        most = len(self.parts.commanded)
        if t_ns.ndim != 1 or delta.ndim != 2 or len(delta) != len(t_ns) or delta.shape[1] > most:
            raise ValueError(
                f"ticks: times {t_ns.shape} and changes {delta.shape} do not fit; allowed: [n] and [n, 1 .. {most}]"
            )
        return np.ascontiguousarray(t_ns, np.int64), delta.astype(np.int32, order="C")

    def finds_arrival(self, period_ns: int) -> bool:
        return self._count >= memory.AXES and bool(self.built.closed.all()) and period_ns % self._substep_ns == 0

    def arrive(self, until_ns: int, first_ns: int, period_ns: int) -> tuple[int, bool]:
        plant = self.parts.plant
        plant["look_at"], plant["look_ahead_ns"] = divmod(first_ns, self._substep_ns)
        plant["look_every"] = period_ns // self._substep_ns
        reached = self.advance(until_ns, *self._none[:2])
        plant["look_every"] = 0
        arrived = bool(self._words.item(_ARRIVED))
        return self.time_ns + int(plant["look_ahead_ns"][0]) if arrived else reached, arrived

    @property
    def at_rest(self) -> bool:
        axes = self.parts.axes
        full = (axes["lowering"] != 0) & (axes["phases"] != OPEN) & (axes["fraction"] != axes["idle_fraction"])
        return bool(self.parts.plant["frozen"][0]) and not full.any() and not len(self._late[0])

    # Thresholds and contacts

    def take_collisions(self) -> tuple[Collision, ...]:
        taken, self._collisions = self._collisions, ()
        return taken

    def _broken(self) -> tuple[Collision, ...]:
        """The feeler, if it has just given way too far."""
        feeler = self.parts.feeler
        if feeler["broken"][0] != touch.NEWS:
            return ()
        feeler["broken"] = 1
        place, speed = self.position_mm, float(np.linalg.norm(self.velocity_mm_s))
        return (touch.crash(self.machine, int(feeler["at"][0]), place, self.time_ns, speed),)

    @property
    def may_collide(self) -> bool:
        return len(self.parts.touching) > 0 or (self.machine.probe is not None and self.machine.probe.enabled)

    def watch_clearance(self) -> Least | None:
        """It has to be told of the path. None if no two bodies can meet."""
        geometry = Geometry(self.model_as_built())
        return Least(geometry) if geometry.pairs else None

    def trips(self) -> NDArray[np.bool_]:
        return self.parts.thresholds["passed"] != 0

    def set_trip_point(self, threshold: int, position_mm: float) -> None:
        if self.parts.thresholds["quantity"][threshold] not in (memory.POSITION, memory.TOUCH):
            raise ValueError(f"threshold {threshold} is neither a position nor a touch")
        self.parts.thresholds["limit"][threshold] = position_mm * 1e-3
        find_free(self.parts)

    # Forces and changes from outside

    def set_payload(self, place: str, mass_kg: float) -> None:
        self._altered.set_payload(place, mass_kg)
        self._pushes.share()

    def set_cut(self, cut: Cut | None) -> None:
        core.wake(self._memory)
        share_tip(self.built)
        now, substep_s, holder = int(self.parts.plant["now"][0]), self._substep_ns * 1e-9, self.built.machine.holder
        stiffness_n_per_m = math.inf if holder is None else holder.stiffness_n_per_m
        set_cut(self.parts.cut, cut, now, substep_s, self.built.frame.left, stiffness_n_per_m)

    def turn_cut(self, speed_rev_min: float) -> None:
        if self.parts.cut["on"][0]:
            turn(self.parts.cut, speed_rev_min, int(self.parts.plant["now"][0]), self._substep_ns * 1e-9)

    # Places and speeds

    @property
    def position_mm(self) -> NDArray[np.float64]:
        """As the drives see it; within a sub-step extrapolated by its velocity."""
        position_mm = along_guides_mm(self.built.machine, self.built.shape_mm @ self.parts.place)
        if self.parts.cut["on"][0]:
            return self._bent_mm(position_mm, self.parts.cut["bend_m"][0])
        return position_mm

    @property
    def velocity_mm_s(self) -> NDArray[np.float64]:
        rates = self.data.qvel.copy()
        rates[self.built.dof] = self.parts.axes["v_m_s"]
        velocity_mm_s: NDArray[np.float64] = self.built.shape_mm @ rates
        return velocity_mm_s

    @property
    def commanded(self) -> NDArray[np.int64]:
        return self.parts.commanded[: self._count].copy()

    @property
    def told(self) -> NDArray[np.int64]:
        told = self.commanded
        return told + self._late[1].sum(axis=0) if len(self._late[1]) else told

    @property
    def command(self) -> NDArray[np.float64]:
        return self._led[: self._count]

    @property
    def _led(self) -> NDArray[np.float64]:
        """float64, all commands as far as they have been led by now."""
        if self.parts.plant["led_until_ns"][0] <= self.time_ns:
            return self.parts.commanded.astype(np.float64)
        return self.parts.commanded - all_behind(self.parts.leads, self.time_ns)

    @property
    def rotor(self) -> NDArray[np.float64]:
        rotor = self._led
        rotor[: memory.AXES] = self.parts.states["theta_rad"] * self.parts.axes["steps_per_rad"]
        return rotor[: self._count]

    @property
    def rotor_speed(self) -> NDArray[np.float64]:
        leads = self.parts.leads
        speed = np.where(leads["end_ns"] > self.time_ns, leads["pending"] * 1e9 / leads["lead_ns"], 0.0)
        speed[: memory.AXES] = self.parts.states["omega_rad_s"] * self.parts.axes["steps_per_rad"]
        return speed[: self._count]

    @property
    def lag(self) -> NDArray[np.float64]:
        command, states = self._led, self.parts.states
        lag = np.zeros(len(command))  # what has no mechanics follows at once
        rotor = states["theta_rad"] * self.parts.axes["steps_per_rad"]
        lag[: memory.AXES] = command[: memory.AXES] - rotor - states["shift"]
        return lag[: self._count]

    # Drives

    @property
    def stages(self) -> tuple[AnyStage, ...]:
        return tuple(axis.stage for axis in self.machine.axes)

    @property
    def turn_steps(self) -> NDArray[np.float64]:
        return self._all([float(axis.steps_per_rev) for axis in self.machine.axes], 1.0)

    @property
    def slip_steps(self) -> NDArray[np.float64]:
        return self._all([float(axis.slip_steps) for axis in self.machine.axes], 1.0)

    @property
    def powered(self) -> NDArray[np.bool_]:
        return self._all(self._live, self._power.stages)

    @property
    def _live(self) -> NDArray[np.bool_]:
        """bool [3], which motors may have current."""
        phases = self.parts.axes["phases"] & self.parts.supply["gate"]
        live: NDArray[np.bool_] = (phases != OPEN) & (self.parts.states["fault"] == 0)
        return live

    @property
    def fault(self) -> NDArray[np.bool_]:
        return self._all((self.parts.axes["fault"] != 0) | (self.parts.states["fault"] != 0), False)

    @property
    def closed_loop(self) -> NDArray[np.bool_]:
        return self._all(self.built.closed, False)

    @property
    def drive_faults(self) -> tuple[tuple[int, str], ...]:
        faults = zip(self.parts.states["faults"].tolist(), self.parts.states["cause"].tolist(), strict=True)
        return (*((number, CAUSES[cause]) for number, cause in faults), *[(0, "")] * self._count)[: self._count]

    @property
    def overloaded(self) -> NDArray[np.bool_]:
        return self._all(self.parts.states["overloaded"] != 0, False)

    @property
    def in_position(self) -> NDArray[np.bool_]:
        states = self.parts.states
        arrived = (states["on"] != 0) & (states["arrived"] == self.parts.drives["window_substeps"])
        return np.where(self.closed_loop, self._all(arrived, True), self.lag == 0.0)

    @property
    def current_fraction(self) -> NDArray[np.float64]:
        fraction = self.parts.axes["fraction"].copy()
        if self.built.closed.any():
            plant = self.parts.plant[0]
            since = int(plant["now"] - plant["frozen_at"]) if plant["frozen"] else 0
            for i in np.flatnonzero(self.built.closed):
                drive, state = self.parts.drives[i : i + 1], self.parts.states[i : i + 1]
                fraction[i] = math.sqrt(core.cooled(drive, state, since))
        return np.where(self._live, fraction, 0.0)

    @property
    def force_n(self) -> NDArray[np.float64]:
        return self.parts.axes["mean_nut_n"].copy()

    @property
    def supply_v(self) -> float:
        supply = self.parts.supply
        return float(supply["voltage_v"][0]) if supply["on"][0] else math.nan

    @property
    def margin(self) -> NDArray[np.float64]:
        return self._all(self.parts.axes["margin"], math.nan)

    @property
    def fastest_rad_s(self) -> NDArray[np.float64]:
        steppers = np.where(self.built.closed, math.nan, self.parts.axes["fastest_rad_s"])
        return self._all(steppers, math.nan)

    def take_margin(self) -> NDArray[np.float64]:
        taken = self._all(self.parts.axes["untaken"], math.nan)
        self.parts.axes["untaken"] = 1.0
        return taken

    def watch_margin(self) -> None:
        core.look(self._memory)
        self.sample_again()

    def _all(self, carriages: Sequence[Any] | NDArray[Any], others: Any) -> NDArray[Any]:
        """[axes]: values of the axes with mechanics, then `others` for the rest."""
        return np.concatenate((carriages, [others] * self._count))[: self._count]

    # For loops of others, compiled together with the kernel, and for pictures

    @property
    def memory(self) -> NDArray[np.void]:
        """MEMORY [1], for compiled code that calls `advance` itself and keeps the plant alive. `time_ns`, `edge`
        and what follows from them are then not updated: advance such a plant only in that way."""
        return self._memory

    @property
    def shape_mm(self) -> NDArray[np.float64]:
        return self.built.shape_mm.copy()

    def scene(self) -> tuple[mujoco.MjModel, mujoco.MjData]:
        """The machine as it is now, with all visible parts, as a copy for pictures and viewers."""
        model = load_model(self.machine)
        data = mujoco.MjData(model)
        data.qpos[:] = self.parts.place
        mujoco.mj_forward(model, data)
        return model, data
