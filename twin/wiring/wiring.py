"""Everything between machine, operators and the controller's input terminals, as one object.

The owner of the clock passes in the time, the controller's outputs and operations, and reads `next_ns` and the levels
of the terminals. In between:

    position switches --> contacts --> terminals          bounce, broken wires: contacts.py
    drives -------------------------->     "              lag, fault: `DriveInput`
    people, outputs ----> cabinet ---> contacts           safety relay, hood, keys: cabinet.py
                             `-------> power of the stages and brakes
    stages -------------> heat ------> cabinet
    contactor, command -> spindle ---> speed, teeth of a cut
    scenario -----------> all of them, at its times       scenario.py

Order at one instant: changes of the plant, bounces, spindle, temperatures, one event of the scenario; repeated until
nothing is due.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.controller import OUTPUTS, DriveInput, KeyValue
from isel_twin.drives.heat import StageHeat
from isel_twin.drives.spindle import Turning
from isel_twin.machine import Contact, Machine
from isel_twin.plant import Cut, Plant, Threshold
from isel_twin.wiring import spindle as of_spindle
from isel_twin.wiring.acts import ACTS, Moment, Settable, check_input
from isel_twin.wiring.cabinet import CABINETS
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.event import ScenarioEvent
from isel_twin.wiring.line import SerialLine
from isel_twin.wiring.scenario import ScenarioError
from isel_twin.wiring.schedule import Decoder, Schedule
from isel_twin.wiring.trips import TripPoints
from isel_twin.wiring.when import Trigger

PASSED_MM = 0.05  # hysteresis of positions that events wait for


def settable(machine: Machine) -> Settable:
    """What `operate` takes, and the states of each: elements of the cabinet, faults of contacts."""
    elements = CABINETS[machine.cabinet]().elements
    contacts = [contact.name for contact in machine.contacts]
    names = dict.fromkeys((*elements, *contacts))
    return {name: elements.get(name, ()) + (tuple(FAULTS) if name in contacts else ()) for name in names}


def outputs(machine: Machine) -> tuple[str, ...]:
    """Outputs that every controller may use, relays of the machine's cabinet, and what a spindle shows."""
    shown = () if machine.spindle is None else of_spindle.OUTPUTS
    return (*OUTPUTS, *CABINETS[machine.cabinet]().relays, *shown)


def thresholds(
    machine: Machine, drive_inputs: Sequence[DriveInput], trips: TripPoints, schedule: Schedule | None = None
) -> list[Threshold]:
    """What the plant must watch: position switches, quantities of `drive_inputs`, positions that events wait for
    (wiring/10), and the feeler, if the machine has one."""
    switches = [
        Threshold(CARRIAGES.index(s.axis), "position", trip_mm, -1 if s.end == "motor" else 1, s.hysteresis_mm)
        for s, trip_mm in zip(machine.switches, trips.switches_mm, strict=True)
    ]
    places = [
        Threshold(CARRIAGES.index(wait.name), "position", float(wait.value), wait.sense, PASSED_MM)
        for wait in (schedule.positions if schedule is not None else ())
    ]
    feeler = machine.feeler
    touch = [] if feeler is None else [Threshold(0, "touch", trips.feeler_mm, 1, feeler.hysteresis_mm)]
    return switches + [Threshold(i.axis, i.quantity, i.limit, 1, i.hysteresis) for i in drive_inputs] + places + touch


class Wiring:
    def __init__(
        self,
        machine: Machine,
        plant: Plant,
        line: SerialLine,
        terminals: Mapping[str, tuple[str, ...]],
        drive_inputs: Sequence[DriveInput],
        trips: TripPoints,
        bounces: np.random.Generator,
        schedule: Schedule | None = None,
    ) -> None:
        """Wire a machine to a controller's `terminals`. plant: built with the `thresholds` of the same machine, drive
        inputs, trip points and schedule. bounces: random generator."""
        self.plant = plant
        self.line = line
        self._switches: tuple[Contact, ...] = machine.switches
        self._drive_terminals = tuple(drive_input.terminal for drive_input in drive_inputs)
        self._trips = trips
        self._cabinet = CABINETS[machine.cabinet]()
        self.contacts = Contacts(machine.contacts, terminals, self._cabinet.signals, bounces)
        self._heat = StageHeat(plant.stages)
        self._spindle = None if machine.spindle is None else of_spindle.RunningSpindle(machine.spindle)
        self.on_event: Callable[[ScenarioEvent], None] | None = None
        """Called with each event of the scenario just before it happens."""
        self.settable = settable(machine)
        """Everything `operate` takes, and the states of each."""
        self._schedule = Schedule() if schedule is None else schedule
        self.events_without_effect = 0  # because the plant has no physics (core/4)
        self._faults: dict[str, str | float] = {}  # of acts, by key or `key.member`; contacts keep their own
        self.changes = 0  # counts up whenever an input may have changed
        self.restarts = 0  # how often the controller was restarted or lost its supply
        self.astray: tuple[str, ...] = ()  # axes that have been referenced though no end switch of theirs was struck
        self._sought: dict[str, bool] = {}  # axes whose reference points are sought, and whether one has been since
        self.pressed: list[tuple[str, KeyValue]] = []  # keys since `take_pressed`, and their values
        self.mains = True  # the controller has supply
        self.stages_powered = False
        self._outputs: dict[str, int] = {}
        self._shown: Mapping[str, bool] = {}
        self._drives_told = False  # an output that drives follow has changed since the cabinet settled
        self._stirred = False  # the power of the drives may have changed since `settle` was called
        self._signals: Mapping[str, bool] = {}  # the cabinet's contacts at the last update of the terminals
        self._active = plant.trips()
        self._touch = len(self._active) - (machine.feeler is not None)  # number of its threshold, if there is one
        self._cabinet.touch(bool(self._active[self._touch :].any()))
        for switch, struck in zip(self._switches, self._active, strict=False):
            self.contacts.set_closed(switch.name, bool(struck) != (switch.type == "opener"))
        for number, beyond in enumerate(self._active[self._places : self._touch]):
            self._schedule.passed(number, bool(beyond))
        self._settle_cabinet()

    # Time

    @property
    def next_ns(self) -> int | None:
        """When `settle` must be called next."""
        event_ns, heat_ns = self.next_event_ns, self._heat.next_ns
        if event_ns is None or (heat_ns is not None and heat_ns < event_ns):
            return heat_ns
        return event_ns

    @property
    def next_event_ns(self) -> int | None:
        """`next_ns` without the regular check of the temperatures, which hardly ever changes anything."""
        due_ns, planned_ns = self.contacts.next_ns, self._schedule.next_ns
        if due_ns is None or (planned_ns is not None and planned_ns < due_ns):
            due_ns = planned_ns
        turning_ns = None if self._spindle is None else self._spindle.next_ns
        if due_ns is None or (turning_ns is not None and turning_ns < due_ns):
            due_ns = turning_ns
        return due_ns

    def settle(self, t_ns: int) -> bool:
        """Do what is due at t_ns, the present; return whether levels may have changed."""
        self._stirred = False
        if self._follow_plant(t_ns) or (self._spindle is not None and self._follow_spindle(t_ns)):
            return True
        if self._heat.next_ns is not None and self._heat.next_ns <= t_ns:
            self._heat.advance(self.plant.current_fraction.tolist())
            self._cabinet.heat(self._heat.hot)
            self._settle_cabinet()
            return True
        event = self._schedule.take(t_ns)
        if event is not None:
            if self.on_event is not None:
                self.on_event(event)
            self.carry_out(event, t_ns)
        return event is not None

    @property
    def stirred(self) -> bool:
        """True if `settle` may have something to do once more at the same instant, because of what the controller has
        done since."""
        return self._stirred or self._spindle is not None or self._schedule.conditional

    # Operation

    def operate(self, name: str, state: str) -> None:
        """Give an element of the cabinet or a contact one of its states in `settable`.

        Raises ScenarioError (ValueError) for any other name or state, and changes nothing.
        """
        check_input(name, state, self.settable, "wiring", ScenarioError)
        self.set_states({name: state})

    def carry_out(self, event: ScenarioEvent, t_ns: int) -> None:
        """Let a valid event happen at t_ns, the present, whatever its own time."""
        self.changes += 1
        self.events_without_effect += event.physical and not self.plant.physics
        moment = Moment(t_ns, event.place)
        for key, value in event.acts.items():
            ACTS[key].do(self, value, moment)
            for fault, now in ACTS[key].faults(value):
                self._note(fault, now)
        if event.end is not None:
            self._schedule.end_later(t_ns + event.for_ns, event.end)

    # Deeds of events: `isel_twin.wiring.acts.Site`

    def set_states(self, changes: Mapping[str, str]) -> None:
        self.changes += 1
        elements = self._cabinet.elements
        self._cabinet.operate_all({name: state for name, state in changes.items() if state in elements.get(name, ())})
        for name, state in changes.items():
            if name in self.contacts.names and state in FAULTS:
                self.contacts.set_fault(name, state)
        self._settle_cabinet()

    def press(self, keys: Mapping[str, KeyValue]) -> None:
        """The controller gets them by `take_pressed`."""
        self.pressed.extend(keys.items())

    def restart(self) -> None:
        """The owner of the clock builds the controller anew (wiring/11)."""
        self.restarts += 1

    def set_mains(self, on: bool) -> None:
        if on != self.mains:
            self.mains = on
            self.restart()
            self._cabinet.mains(on)
            self._settle_cabinet()

    def begin_cut(self, cut: Cut | None) -> None:
        self.plant.set_cut(cut)
        if self._spindle is not None and self.plant.physics:
            self._spindle.begin_cut(cut)

    def warm(self, axis: int, extra_k: float, t_ns: int) -> None:
        self._heat.warm(axis, extra_k, t_ns)
        self._cabinet.heat(self._heat.hot)
        self._settle_cabinet()

    def schedule(self, events: Sequence[ScenarioEvent], decoder: Decoder | None = None) -> None:
        """Replace the schedule by these events; none of them may wait for a position."""
        self._schedule = Schedule(events, decoder)
        self._look()

    def take_pressed(self) -> list[tuple[str, KeyValue]]:
        """Keys that events have pressed since the last call, with their values, in order."""
        pressed, self.pressed = self.pressed, []
        return pressed

    @property
    def events_left(self) -> int:
        return self._schedule.left

    def heard(self, data: bytes, sent: bool) -> None:
        """Take bytes that the controller gets from the host now (sent), or sends. Call `settle` afterwards."""
        self._schedule.heard(data, sent)

    def search(self, axis: int, found: bool) -> None:
        """The controller begins to seek the reference switch of an axis, or has taken its reference point (jobs/14)."""
        name = dict(enumerate(CARRIAGES)).get(axis, "")
        switches = [switch for switch in self._switches if switch.axis == name]
        if not found:
            self._sought[name] = not switches or any(self.inputs[switch.name] == "struck" for switch in switches)
        elif not self._sought.pop(name, True):
            self.astray = (*self.astray, name)

    def collided(self, first: str, second: str) -> None:
        """Two bodies have met that must not. `settle` follows."""
        self._schedule.collided(first, second)

    def output(self, name: str, value: int) -> None:
        """Take the new level of a controller output. Call `follow_controller` after all those of an instant."""
        if name == "drive_reset" and value and not self._outputs.get(name):
            self.plant.reset_drives()
            self._stirred = True
        self._outputs[name] = value
        if name in ("stages", "brake", "current_lowering"):
            self._drives_told = True
        self._cabinet.output(name, value)
        if self._schedule.of_states:
            self._look()

    def outputs_lost(self) -> None:
        """Reset the outputs to their state at power-on: the controller restarts or has no supply (wiring/8)."""
        for name in self._outputs:
            self.output(name, OUTPUTS.get(name, 0))
        self._settle_cabinet()

    def motion(self, moving: bool) -> None:
        """Take the begin or end of a motion. Call `follow_controller` after all that happens at the same instant."""
        self._cabinet.motion(moving)

    def follow_controller(self) -> None:
        """Apply outputs and motion to contacts and drives, if any of these follows them."""
        if self._drives_told or self._cabinet.contacts() is not self._signals:
            self._settle_cabinet()

    # State

    @property
    def levels(self) -> Mapping[str, bool]:
        """Level (True: high) of every wired terminal; the same object while nothing changes."""
        levels = self.contacts.levels()
        if self._drive_terminals:
            active = self._active[len(self._switches) : self._places].tolist()
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
        return states | dict(self.contacts.faults)

    @property
    def faults(self) -> Mapping[str, str | float]:
        """Faults now: of contacts by name, others by key of ACTS: `noise`, `phase_lost.x`."""
        found: dict[str, str | float] = dict(self.contacts.faults)
        found |= {f"swapped.{name}": other for name, other in self.contacts.swapped.items()}
        return found | self._faults

    @property
    def turning(self) -> Turning | None:
        """Motion of the spindle; None if the machine file has none."""
        return None if self._spindle is None else self._spindle.turning

    @property
    def outputs(self) -> Mapping[str, int]:
        """Outputs of the controller, the relays of the cabinet that they act on, and the spindle's speed."""
        shown = {} if self._spindle is None else self._spindle.outputs
        return {**self._outputs, **self._cabinet.relays, **shown}

    # Inside

    def _follow_plant(self, t_ns: int) -> bool:
        """Apply switches that the plant has struck or released, and the bounces due; return whether there were any."""
        active = self.plant.trips()
        acted = active.tobytes() != self._active.tobytes()  # far faster than to look for which
        if acted:
            self._pass(active, t_ns)
        if self.contacts.advance(t_ns):
            acted = True
            self._settle_cabinet()  # a worn contact of the cabinet chatters, too
        self.changes += acted
        return acted

    def _pass(self, active: NDArray[np.bool_], t_ns: int) -> None:
        """Take thresholds that have been passed, either way."""
        changed = (active != self._active).nonzero()[0].tolist()
        self._active = active
        for number in changed:
            if number < len(self._switches):
                self.contacts.strike(self._switches[number].name, bool(active[number]), t_ns)
                switch = self._switches[number]
                if active[number] and switch.axis in self._sought and self.contacts.heeded(switch.name):
                    self._sought[switch.axis] = True
                if not active[number]:
                    self.plant.set_trip_point(number, self._trips.next_of(number, switch))
            elif number == self._touch:
                self._touched(bool(active[number]))
            elif number >= self._places:
                self._schedule.passed(number - self._places, bool(active[number]))
        self._look()

    def _follow_spindle(self, t_ns: int) -> bool:
        """Let the spindle take contactor, command and load; return whether its shown speed has changed."""
        if self._spindle is None:
            return False
        live = bool(self._cabinet.relays.get("spindle_runs"))
        if not self._spindle.follow(t_ns, self._outputs, live, self.plant):
            return False
        self.changes += 1
        self._look()
        return True

    @property
    def _places(self) -> int:
        """Number of the first threshold that is a position an event waits for."""
        return len(self._switches) + len(self._drive_terminals)

    def _note(self, fault: str, value: str | float) -> None:
        self._faults.pop(fault, None)
        if value != ACTS[fault.partition(".")[0]].off:
            self._faults[fault] = value

    def _look(self) -> None:
        if self._schedule.of_states:
            self._schedule.look(self._holds)

    def _holds(self, condition: Trigger) -> bool:
        name, value = condition.name, condition.value
        if condition.kind == "output":
            return bool(self.outputs.get(name, OUTPUTS.get(name, 0)) == value)
        if value == "ok":
            return self.contacts.fault(name) == "ok"
        return self.inputs.get(name) == value

    def _touched(self, touched: bool) -> None:
        """Let the feeler close or open its contact; from then on its next trip point counts."""
        self._cabinet.touch(touched)
        if not touched:
            self.plant.set_trip_point(self._touch, self._trips.next_of_feeler())
        self._settle_cabinet()

    def _settle_cabinet(self) -> None:
        """Set contacts from the cabinet, let it read them as wired, and switch the power of the stages."""
        self._drives_told, self._stirred = False, True
        self._follow_cabinet()
        self._cabinet.sense(self.contacts.closed)
        self._follow_cabinet()
        live = self._cabinet.powered
        self.stages_powered = live and bool(self._outputs.get("stages"))
        self.plant.set_power(
            stages=self.stages_powered,
            brake_released=live and bool(self._outputs.get("brake")),
            lowering=bool(self._outputs.get("current_lowering")),
        )
        self._look()

    def _follow_cabinet(self) -> None:
        signals = self._cabinet.contacts()
        if signals is not self._signals:
            self._signals = signals
            for name, closed in signals.items():
                self.contacts.set_closed(name, closed)
