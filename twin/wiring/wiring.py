"""Everything between machine, people and the controller's input terminals, as one thing that settles itself.

Goal: whoever owns the clock says what time it is, what the controller puts out and what a person does, and is told when
to come back and which levels the terminals have. What happens in between is decided here:

    position switches --> contacts --> terminals          bounce, broken wires: contacts.py
    drives -------------------------->     "              lag, fault: `DriveInput`
    people, outputs ----> cabinet ---> contacts           safety relay, hood, keys: cabinet.py
                             `-------> power of the stages and brakes
    stages -------------> heat ------> cabinet
    scenario -----------> all of them, at its times       scenario.py

Order at one instant: what the plant has done, bounces, temperatures, one event of the scenario; then again, until
nothing is due.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np

from isel_twin.axes import CARRIAGES
from isel_twin.controller import DriveInput
from isel_twin.drives.heat import StageHeat
from isel_twin.machine import Contact, Machine
from isel_twin.plant import Cut, Plant, Threshold
from isel_twin.wiring.acts import check_input
from isel_twin.wiring.cabinet import CABINETS
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.line import SerialLine
from isel_twin.wiring.scenario import ScenarioError, ScenarioEvent

__all__ = ["Wiring", "thresholds"]


def thresholds(machine: Machine, drive_inputs: Sequence[DriveInput]) -> list[Threshold]:
    """What the plant has to watch: the position switches of a machine, then the quantities of `drive_inputs`."""
    switches = [
        Threshold(
            CARRIAGES.index(switch.axis),
            "position",
            switch.position_mm,
            -1 if switch.end == "motor" else 1,
            switch.hysteresis_mm,
        )
        for switch in machine.switches
    ]
    return switches + [Threshold(i.axis, i.quantity, i.limit, 1, i.hysteresis) for i in drive_inputs]


class Wiring:
    """Between plant, people and terminals; see the module."""

    def __init__(
        self,
        machine: Machine,
        plant: Plant,
        line: SerialLine,
        terminals: Mapping[str, tuple[str, ...]],
        drive_inputs: Sequence[DriveInput],
        trips: np.random.Generator,
        bounces: np.random.Generator,
    ) -> None:
        """Wire a machine to a controller's `terminals`.

        plant: built with `thresholds` of this machine and these drive inputs. line: where a scenario makes noise.
        trips, bounces: where trip points and bounces are drawn from.
        """
        self._plant = plant
        self._line = line
        self._switches: tuple[Contact, ...] = machine.switches
        self._drive_terminals = tuple(drive_input.terminal for drive_input in drive_inputs)
        self._trips = trips
        self._cabinet = CABINETS[machine.cabinet]()
        self._contacts = Contacts(machine.contacts, terminals, self._cabinet.signals, bounces)
        self._heat = StageHeat(plant.stages)
        self._scenario: deque[ScenarioEvent] = deque()
        self.events_without_effect = 0
        """Events, of the scenario or a call, that have happened and could not do anything: the plant has no physics."""
        self._phases_lost: dict[str, str] = {}
        self._outputs: dict[str, int] = {}
        self._shown: Mapping[str, bool] = {}
        self._signals: Mapping[str, bool] = {}
        """What the cabinet's contacts are since they were last told."""
        self._active = plant.trips()
        for switch, struck in zip(self._switches, self._active, strict=False):
            self._contacts.set_closed(switch.name, bool(struck) != (switch.type == "opener"))
        self._settle_cabinet()

    # Time

    @property
    def next_ns(self) -> int | None:
        """When there is something to do by itself."""
        return min((t for t in (self.next_event_ns, self._heat.next_ns) if t is not None), default=None)

    @property
    def next_event_ns(self) -> int | None:
        """The same without the regular look at the temperatures, which hardly ever changes anything."""
        event_ns = self._scenario[0].at_ns if self._scenario else None
        return min((t for t in (self._contacts.next_ns, event_ns) if t is not None), default=None)

    def settle(self, t_ns: int) -> bool:
        """Do what is due at t_ns, the present; return whether there was anything. Levels may have changed then."""
        if self._follow_plant(t_ns):
            return True
        if self._heat.next_ns is not None and self._heat.next_ns <= t_ns:
            self._heat.advance(self._plant.current_fraction.tolist())
            self._cabinet.heat(self._heat.hot)
            self._settle_cabinet()
            return True
        if self._scenario and self._scenario[0].at_ns <= t_ns:
            self.carry_out(self._scenario.popleft())
            return True
        return False

    # What is done to it

    @property
    def settable(self) -> Mapping[str, tuple[str, ...]]:
        """Everything `operate` takes, and the states each can be given: elements of the cabinet, faults of contacts."""
        names = dict.fromkeys((*self._cabinet.elements, *self._contacts.names))
        return {
            name: self._cabinet.elements.get(name, ()) + (tuple(FAULTS) if name in self._contacts.names else ())
            for name in names
        }

    def operate(self, name: str, state: str) -> None:
        """Give an element of the cabinet or a contact one of its states in `settable`.

        Raises ScenarioError (ValueError) for any other name or state, and nothing has changed then.
        """
        check_input(name, state, self.settable, "wiring", ScenarioError)
        self._operate_all({name: state})

    def carry_out(self, event: ScenarioEvent) -> None:
        """Let an event happen now, whatever its time; all of it has been checked."""
        self.events_without_effect += event.physical and not self._plant.physics
        if event.inputs:
            self._operate_all(event.inputs)
        for axis, force_n in event.force_n.items():
            self._plant.apply_force(axis, force_n, event.place)
        if event.cut:
            self._plant.set_cut(event.cut if isinstance(event.cut, Cut) else None)
        for axis, phases in event.phase_lost.items():
            self._plant.set_phase_lost(axis, phases)
            self._phases_lost[CARRIAGES[axis]] = phases
        if event.noise is not None:
            self._line.noise = event.noise

    def schedule(self, events: Sequence[ScenarioEvent]) -> None:
        """Let these events happen, each at its time; they are sorted by it."""
        self._scenario = deque(events)

    @property
    def events_left(self) -> int:
        """Events of the scenario that are still to come."""
        return len(self._scenario)

    def output(self, name: str, value: int) -> None:
        """A controller output has a new level. `outputs_changed` follows when all of an instant have been told."""
        self._outputs[name] = value
        self._cabinet.output(name, value)

    def outputs_changed(self) -> None:
        """Carry the outputs told by `output` to contacts and drives."""
        self._settle_cabinet()

    def motion(self, moving: bool) -> None:
        """Tell whether a motion is being made, whatever the controller says of it."""
        self._cabinet.motion(moving)
        self._settle_cabinet()

    # What there is to see

    @property
    def levels(self) -> Mapping[str, bool]:
        """Level (True: high) of every wired terminal; the same object as long as nothing has changed."""
        levels = self._contacts.levels()
        if self._drive_terminals:
            active = self._active[len(self._switches) :].tolist()
            levels = levels | dict(zip(self._drive_terminals, active, strict=True))
        if levels is not self._shown and levels != self._shown:
            self._shown = levels
        return self._shown

    @property
    def inputs(self) -> Mapping[str, str]:
        """State of every element and position switch (`free`, `struck`), and the fault of each contact that has one."""
        states = dict(self._cabinet.states)
        for switch, struck in zip(self._switches, self._active, strict=False):
            states[switch.name] = "struck" if struck else "free"
        for name in self._contacts.names:
            if self._contacts.fault(name) != "ok":
                states[name] = self._contacts.fault(name)
        return states

    @property
    def faults(self) -> Mapping[str, str | float]:
        """What is wrong now: faults of contacts by name, motor phases lost (`phase_lost.x`), `noise` on the line."""
        of_contacts = {name: self._contacts.fault(name) for name in self._contacts.names}
        found: dict[str, str | float] = {name: fault for name, fault in of_contacts.items() if fault != "ok"}
        found |= {f"phase_lost.{axis}": phases for axis, phases in self._phases_lost.items() if phases}
        return found | ({"noise": self._line.noise} if self._line.noise else {})

    @property
    def outputs(self) -> Mapping[str, int]:
        """Outputs of the controller, and the relays of the cabinet that they act on."""
        return {**self._outputs, **self._cabinet.relays}

    # Inside

    def _follow_plant(self, t_ns: int) -> bool:
        """Take over what the plant has struck or released, and the bounces due; return whether there was anything."""
        active = self._plant.trips()
        changed = (active != self._active).nonzero()[0].tolist()
        self._active = active
        for number in changed:
            if number < len(self._switches):
                self._contacts.strike(self._switches[number].name, bool(active[number]), t_ns)
                if not active[number]:
                    self._draw_trip_point(number)
        return self._contacts.advance(t_ns) or bool(changed)

    def _draw_trip_point(self, number: int) -> None:
        """A switch trips a little elsewhere each time: draw where it will the next time."""
        switch = self._switches[number]
        scatter_mm = self._trips.normal(0.0, switch.repeatability_mm)
        self._plant.set_trip_point(number, switch.position_mm + scatter_mm)

    def _operate_all(self, changes: Mapping[str, str]) -> None:
        """Elements and contacts change together; all of it has been checked."""
        elements = self._cabinet.elements
        self._cabinet.operate_all({name: state for name, state in changes.items() if state in elements.get(name, ())})
        for name, state in changes.items():
            if name in self._contacts.names and state in FAULTS:
                self._contacts.set_fault(name, state)
        self._settle_cabinet()

    def _settle_cabinet(self) -> None:
        """Carry the cabinet's signals to the contacts, their real states back, and its power to the stages."""
        self._follow_cabinet()
        self._cabinet.sense(self._contacts.closed)
        self._follow_cabinet()
        live = self._cabinet.powered
        self._plant.set_power(
            stages=live and bool(self._outputs.get("stages")),
            brake_released=live and bool(self._outputs.get("brake")),
            lowering=bool(self._outputs.get("current_lowering")),
        )

    def _follow_cabinet(self) -> None:
        signals = self._cabinet.contacts()
        if signals != self._signals:
            self._signals = signals
            for name, closed in signals.items():
                self._contacts.set_closed(name, closed)
