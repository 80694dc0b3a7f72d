"""What must hold in every world, whatever is drawn.

At the controller's border, at every call (`Border`): time never runs back and never passes `next_ns`; a level is told
once; the motor sense never changes within a motion; a counter that is said to be set has that value.

At every look (`Watch`): all numbers are finite; carriages stay between their stops, or follow their counters if there
is no physics; switches follow the carriages and terminals their contacts; a contact that must cut the power has cut it;
a limp machine gains no energy; while nothing moves nothing happens before `next_event_ns`.

At every read of the host (`check_read`): it gets the bytes that have arrived by now, all of them and no others.

Over a whole life (`check_counters`, `difference`):

    counter(t) - counter(t0) = sum of the recorded ticks in (t0, t]         t0: the last time it was set
    command of the drives    = sum of the recorded ticks in the sense of the motors
    two lives of one world   = the same replies, events, ticks, positions, to the bit, however time is cut
"""

from __future__ import annotations

from bisect import bisect_right
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np
from numpy.typing import NDArray
from plant.energy import mechanical_energy_j

from isel_twin.base.axes import CARRIAGES
from isel_twin.controller import Controller, CounterSet, Event, Reply, SerialFormat
from isel_twin.core.twin import Twin
from isel_twin.machine import Contact
from isel_twin.motion import Motion
from isel_twin.plant.margin import SPEED_STEP_RAD_S
from isel_twin.wiring import FAULTS

COUNTED = 16
"""Calls of which one is followed by a look at the counters, whether anything came of it or not."""
SCATTERS = 8.0
"""Standard deviations of a trip point beyond which no switch trips."""
PUSHED_N = 800.0
"""Most that hands push with (tests/hunt/world.py)."""
STOP_MM = 0.2
"""Most that a stop gives under what motors and hands can do (the models say so)."""
STOP_S = 1e-3
"""And the time in which it brings a carriage to a stop, beside a step of MuJoCo (`solreflimit` of the models)."""
EXACT_MM = 1e-6
"""What is left of rounding where nothing is elastic."""
GAIN = 1e-4
"""Energy that a limp machine may seem to gain, as a share of what it has spent: the stops' springs are not in it.
Beside `exchanged_j`."""
ROUNDING_J = 1e-9


class Broken(Exception):
    """An invariant does not hold."""


class Border:
    """A controller as the twin sees it, with every call checked and written down. Implements `Controller`."""

    def __init__(self, controller: Controller, *, line_speed: bool = False) -> None:
        """line_speed: bytes take their time on the line between it and its host."""
        self.inside = controller
        self._timed = line_speed
        self.happened: list[tuple[int, Any]] = []
        """(time, event) of everything that came over the border: events of the controller, and its inputs."""
        self.times: list[int] = []
        self.counted: list[tuple[int, ...]] = []
        self.senses: list[tuple[int, ...]] = []
        self.was_set: list[tuple[int, ...]] = []
        """At calls that something came of, and some others: time, counters, sense of the motors, counters set."""
        self.known: dict[str, bool] = {}
        """Levels that the controller has been told."""
        self.arrivals: list[int] = []
        """When each byte of its replies has to arrive at the host: at once, or one by one on a line that takes time."""
        self._stretches: list[int] = []
        """Number of the byte with which the line has begun to be busy, each time."""
        self._now_ns = 0
        self._due_ns: int | None = None
        self._run: Motion | None = None
        self._takes = 0

    # What it says

    @property
    def serial_format(self) -> SerialFormat:
        return self.inside.serial_format

    @property
    def counts(self) -> tuple[int, ...]:
        return self.inside.counts

    @property
    def direction(self) -> tuple[int, ...]:
        return self.inside.direction

    @property
    def run(self) -> Motion | None:
        return self.inside.run

    @property
    def next_ns(self) -> int | None:
        return self.inside.next_ns

    @property
    def idle(self) -> bool:
        return self.inside.idle

    @property
    def fault(self) -> bool:
        return self.inside.fault

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return self.inside.terminals()

    def machine_overrides(self) -> Mapping[str, Any]:
        return self.inside.machine_overrides()

    # What it is told

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self.known = dict(levels)
        self.inside.power_on(t_ns, levels)

    def receive(self, t_ns: int, data: bytes) -> None:
        self._at(t_ns)
        self.inside.receive(t_ns, data)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._at(t_ns)
        if self.known[terminal] == level:
            raise Broken(f"the controller is told twice that {terminal} is {_word(level)}")
        self.known[terminal] = level
        self.happened.append((t_ns, (terminal, level)))
        self.inside.set_input(t_ns, terminal, level)

    def advance(self, t_ns: int) -> None:
        self._at(t_ns)
        self.inside.advance(t_ns)

    def take(self) -> list[Event]:
        events = self.inside.take()
        run = self.inside.run
        self._takes += 1
        if events or run is not self._run or self._takes % COUNTED == 0:
            self._write_down(events, run)
        self._run = run
        self._due_ns = self.inside.next_ns
        return events

    def _write_down(self, events: list[Event], run: Motion | None) -> None:
        now_ns, counts, sense = self._now_ns, self.inside.counts, self.inside.direction
        self.happened += [(now_ns, event) for event in events]
        for event in events:
            if isinstance(event, Reply):
                self._say(len(event.data))
        jumps = {event.axis: event.value for event in events if isinstance(event, CounterSet)}
        for axis, value in jumps.items():
            if counts[axis] != value:
                raise Broken(f"the counter of axis {axis} is set to {value}, and shows {counts[axis]}")
        goes_on = self._run is not None and run is not None and (run is self._run or run.continues(self._run))
        if goes_on and sense != self.senses[-1]:
            raise Broken(f"the motor sense changes from {self.senses[-1]} to {sense} in motion")
        self.times.append(now_ns)
        self.counted.append(counts)
        self.senses.append(sense)
        self.was_set.append(tuple(jumps))

    def _say(self, count: int) -> None:
        """So many bytes go on the line now, behind those that are on it."""
        byte_ns = self.inside.serial_format.byte_ns if self._timed else 0
        free_ns = self.arrivals[-1] if self.arrivals else 0
        if free_ns <= self._now_ns:
            self._stretches.append(len(self.arrivals))
        begin_ns = max(free_ns, self._now_ns)
        self.arrivals += [begin_ns + number * byte_ns for number in range(1, count + 1)]

    def silent_ns(self, number: int) -> int:
        """When the line falls silent after a byte, as far as can be said yet."""
        after = bisect_right(self._stretches, number)
        end = self._stretches[after] if after < len(self._stretches) else len(self.arrivals)
        return self.arrivals[end - 1]

    def _at(self, t_ns: int) -> None:
        if t_ns < self._now_ns:
            raise Broken(f"the controller is told of {t_ns} ns after {self._now_ns} ns")
        if self._due_ns is not None and t_ns > max(self._due_ns, self._now_ns):
            raise Broken(f"time has passed {self._due_ns} ns, when the controller wanted to be called, to {t_ns} ns")
        self._now_ns = t_ns


@dataclass(frozen=True)
class Sight:
    """What is to be seen of a twin at one instant, and the little of it that cannot be seen from outside."""

    inputs: Mapping[str, str]
    outputs: Mapping[str, int]
    levels: Mapping[str, bool]
    place_mm: Sequence[float]
    """Carriages on their guides, where stops and switches are; the tool is elsewhere, if the frame gives."""
    elements: Mapping[str, str]
    """What people operate: a fault of the contact with the same name hides its state in `inputs`."""
    bouncing: bool
    swapped: Mapping[str, str]
    """Contacts whose wires are exchanged, both ways round."""
    """A position switch still chatters."""
    powered: bool
    """A motor has current."""

    @staticmethod
    def of(twin: Twin) -> Sight:
        """Look at a twin."""
        return Sight(
            inputs=twin.inputs,
            outputs=twin.outputs,
            levels=twin.levels,
            place_mm=_on_guides_mm(twin).tolist(),
            elements=dict(twin._wiring._cabinet.states),
            bouncing=twin._wiring.contacts.next_ns is not None,
            swapped=dict(twin._wiring.contacts._swapped),
            powered=bool(twin._plant.powered.any()),
        )


class Watch:
    """Looks at a twin from time to time. `look` raises Broken for what must not be."""

    def __init__(self, twin: Twin, border: Border) -> None:
        self._twin = twin
        self._border = border
        self._physics = twin._plant.stages != ()
        self._frame = Frame(twin._plant) if self._physics else None
        self._contacts = {contact.name: contact for contact in twin.machine.contacts}
        self._switches_there = twin.machine.switches
        wired = {
            t: [self._contacts[n] for n in names if n in self._contacts] for t, names in border.terminals().items()
        }
        self._wired = {terminal: contacts for terminal, contacts in wired.items() if contacts}
        self._scatter_mm = {c.name: SCATTERS * c.repeatability_mm + EXACT_MM for c in twin.machine.switches}
        self._promised_ns: int | None = None
        self._still = False
        self._happened = 0
        self._limp_j: list[float] = []
        self._exchanged_j = 0.0

    def look(self, *, acted: bool, pushed: bool) -> None:
        """acted: something was done to the twin since the last look; pushed: a force acts on a carriage."""
        if acted:
            self._promised_ns = 0
        sight = Sight.of(self._twin)
        self._numbers()
        if self._frame is not None:
            self._frame.look(self._twin.time_ns, pushed=pushed)
        self._carriages(sight)
        self._switches(sight)
        self._terminals(sight)
        self._power(sight)
        self._promise()
        if self._physics:
            self._energy(sight, pushed)

    def _numbers(self) -> None:
        twin = self._twin
        for name in ("position_mm", "position_error_mm", "machine_position_mm", "lost_steps", "forgotten_steps"):
            if not np.isfinite(getattr(twin, name)).all():
                raise Broken(f"{name} is {getattr(twin, name).tolist()}")

    def _carriages(self, sight: Sight) -> None:
        """With physics they stay between their stops; without it they follow their counters."""
        if not self._physics:
            error_mm = self._twin.position_error_mm
            if abs(error_mm).max() > EXACT_MM or self._twin.lost_steps.any():
                raise Broken(f"without physics, carriages are {error_mm.tolist()} mm away from their counters")
            return
        assert self._frame is not None
        given_mm = STOP_MM + 1e3 * self._frame.stop_s * self._frame.fastest_m_s
        for x_mm, axis, most_mm in zip(sight.place_mm, self._twin.machine.axes, given_mm, strict=True):
            if not -axis.stop_margin_mm - most_mm < x_mm < axis.travel_mm + axis.stop_margin_mm + most_mm:
                raise Broken(f"the carriage of {axis.name} stands at {x_mm:.6f} mm, beyond its stop")

    def _switches(self, sight: Sight) -> None:
        for switch in self._switches_there:
            axis, sense = CARRIAGES.index(switch.axis), -1 if switch.end == "motor" else 1
            beyond_mm = sense * (sight.place_mm[axis] - switch.position_mm)
            slack_mm = self._scatter_mm[switch.name]
            state = sight.inputs[switch.name]
            if (state == "free" and beyond_mm > slack_mm) or (
                state == "struck" and beyond_mm < -switch.hysteresis_mm - slack_mm
            ):
                raise Broken(f"{switch.name} is {state}, with its carriage {beyond_mm:+.6f} mm beyond it")

    def _terminals(self, sight: Sight) -> None:
        levels = sight.levels
        for terminal, told in self._border.known.items():
            if levels[terminal] != told:
                raise Broken(f"{terminal} is {_word(levels[terminal])}, and the controller was told {_word(told)}")
        closed = {name: _closed(contact, sight) for name, contact in self._contacts.items()}
        for terminal, wired in self._wired.items():
            contacts = [self._contacts[sight.swapped.get(contact.name, contact.name)] for contact in wired]
            worn = any(sight.inputs.get(contact.name) == "bounce" for contact in contacts)
            if worn or (sight.bouncing and any(contact.kind == "switch" for contact in contacts)):
                continue
            high = all(closed[contact.name] != contact.inverted for contact in contacts)
            if levels[terminal] != high:
                states = ", ".join(f"{contact.name} {_state(closed[contact.name])}" for contact in contacts)
                raise Broken(f"{terminal} is {_word(not high)}, with {states}")

    def _power(self, sight: Sight) -> None:
        states, outputs = sight.elements, sight.outputs
        opened = [name for name in ("estop_1", "estop_2") if not _closed(self._contacts[name], sight)]
        if states["overtemperature"] == "hot" or states["power"] == "off":
            opened.append("supply or temperature")
        moving = self._border.run is not None
        if moving and states["hood"] != "closed" and states["key"] == "automatic":
            opened.append("hood in motion")
        if opened and outputs["power"]:
            raise Broken(f"the stages have power with {', '.join(opened)} open")
        if outputs["spindle_runs"] and not (outputs["power"] and states["hood"] == "closed"):
            raise Broken("the spindle runs without power, or with the hood open")
        if sight.powered and not (outputs["power"] and outputs.get("stages")):
            raise Broken("motors have current, with the power or the stages off")
        if moving and self._twin.idle:
            raise Broken("the twin is idle in motion")

    def _promise(self) -> None:
        """While nothing moves, nothing happens before `next_event_ns`; in motion it says when to look again."""
        twin, happened = self._twin, len(self._border.happened)
        early = self._still and (self._promised_ns is None or twin.time_ns < self._promised_ns)
        if early and happened != self._happened:
            raise Broken(f"{self._border.happened[self._happened]} came before next_event_ns, {self._promised_ns}")
        self._happened = happened
        self._still = not twin._stream.moving and twin._plant.at_rest
        self._promised_ns = twin.next_event_ns
        if self._promised_ns is not None and self._promised_ns < twin.time_ns:
            raise Broken(f"next_event_ns is {self._promised_ns} at {twin.time_ns} ns")

    def _energy(self, sight: Sight, pushed: bool) -> None:
        """While the stages are off and nobody pushes, energy only falls, but for carriages at their stops."""
        plant: Any = self._twin._plant
        at_stop = any(
            not -axis.stop_margin_mm < x < axis.travel_mm + axis.stop_margin_mm
            for x, axis in zip(sight.place_mm, self._twin.machine.axes, strict=True)
        )
        if sight.powered or pushed or at_stop:
            self._limp_j.clear()
            self._exchanged_j = 0.0
            return
        self._exchanged_j = max(self._exchanged_j, exchanged_j(plant))
        self._limp_j.append(mechanical_energy_j(plant.built))
        lowest, highest = min(self._limp_j), max(self._limp_j)
        gain = self._limp_j[-1] - lowest
        if gain > ROUNDING_J + self._exchanged_j + GAIN * (highest - lowest):
            raise Broken(f"the limp machine has gained {gain:.3g} J, from {lowest:.6g} J")


class Frame:
    """How fast carriages may have been, and how far the frame of a machine with physics may be bent by that."""

    def __init__(self, plant: Any) -> None:
        self._plant = plant
        modes = plant.machine.structure if plant.machine.imperfections.structure else ()
        self._axis = np.array([CARRIAGES.index(mode.axis) for mode in modes], dtype=np.int64)
        bends = np.array([plant.model.joint(mode.joint).dofadr[0] for mode in modes], dtype=np.int64)
        self._bends = bends
        self._stiffness = plant.model.jnt_stiffness[plant.model.dof_jntid][bends]
        self._s = np.sqrt(np.diagonal(plant.built.inertia)[bends] / self._stiffness)
        travel, drives = plant.parts.drives["travel_m_per_rad"], plant.parts.drives
        self._kg = 1.0 / plant.parts.axes["mobility_per_kg"] + drives["inertia_kgm2"] / travel**2
        last = [np.flatnonzero(torque).max(initial=0) for torque in plant.parts.available]
        self._motor_m_s = travel * SPEED_STEP_RAD_S * np.array(last)
        self._pushed_n = 0.0
        self._then_ns = 0
        self.stop_s = 1e-9 * plant.machine.timing.mujoco_step_ns + STOP_S
        self.fastest_m_s = np.zeros(len(CARRIAGES))
        """float64 [3], most that a carriage can have moved with so far: at any look, as fast as its motor turns if it
        has had current, and as fast as hands can have made it since the look before."""

    def look(self, now_ns: int, *, pushed: bool) -> None:
        """Bent by no more than v sqrt(m / k) when what moves with v is stopped, twice that when it is thrown back, and
        2 F / k by a sudden force. Raises Broken."""
        plant = self._plant
        self._pushed_n = PUSHED_N if pushed else self._pushed_n
        seen_m_s = np.abs(plant.parts.axes["v_m_s"])
        seen_m_s += self._pushed_n / self._kg * 1e-9 * (now_ns - self._then_ns)
        seen_m_s = np.maximum(seen_m_s, np.where(plant.powered[: len(CARRIAGES)], self._motor_m_s, 0.0))
        self.fastest_m_s = np.maximum(self.fastest_m_s, seen_m_s)
        self._then_ns = now_ns
        bent_m = np.abs(plant.data.qpos[self._bends])
        most_m = 2.0 * (self.fastest_m_s[self._axis] * self._s + self._pushed_n / self._stiffness)
        if (bent_m > most_m + 1e-3 * EXACT_MM).any():
            raise Broken(
                f"the frame is bent by {(1e3 * bent_m).tolist()} mm, no more than {(1e3 * most_m).tolist()} mm"
            )


def _on_guides_mm(twin: Twin) -> NDArray[np.float64]:
    """float64 [3], where the carriages stand on their guides at the last whole sub-step."""
    plant: Any = twin._plant
    return 1e3 * plant.parts.axes["x_m"] if plant.stages else twin.machine_position_mm


def exchanged_j(plant: Any) -> float:
    """Most by which the energy of a limp machine that swings as it now does can differ from one moment to another.

    plant: a MujocoPlant. Its steps keep an energy that is not quite the mechanical one. Over a window of h MuJoCo makes
    of the nut's force its mean, while rotor and nut do work along the way, so that a force that changes by F' t under
    an acceleration a from elsewhere (weight, structure) finds F' a h^3 / 12 more or less: what has been F comes back,

        h^2 / 12 F a      F: amplitude of the nut's force, a: of what structure and weight give the carriage

    either way, at both ends of the time between two looks. The sub-steps of dt are those of Verlet, which keep the
    energy less dt^2 / 8 of stiffness times the speed on it squared: of the nut K u^2 = F^2 / m at most, m the
    mass of rotor and carriage against one another, and of the detent 4 Nr Td w^2.

        amplitudes        F^2 = F(t)^2 + K m u^2          (k s)^2 = (k s(t))^2 + k m_s s'(t)^2
    """
    drives, states, axes, model = plant.parts.drives, plant.parts.states, plant.parts.axes, plant.model
    h_s, dt_s = 1e-9 * plant.machine.timing.mujoco_step_ns, 1e-9 * plant.machine.timing.substep_ns
    travel, stiffness, omega = drives["travel_m_per_rad"], drives["stiffness_n_per_m"], states["omega_rad_s"]
    mass = 1.0 / (axes["mobility_per_kg"] + travel**2 / drives["inertia_kgm2"])
    force = np.hypot(states["force_n"], np.sqrt(stiffness * mass) * (travel * omega - axes["v_m_s"]))
    spring = model.jnt_stiffness[model.dof_jntid]
    swing = np.hypot(spring * plant.data.qpos, np.sqrt(spring / np.diagonal(plant.built.mobility)) * plant.data.qvel)
    elsewhere = np.abs(plant.built.mobility)[plant.built.dof] @ (swing + np.abs(plant.built.weight))
    detent = 4.0 * drives["pole_pairs"] * drives["detent_torque_nm"] * omega**2
    return float((h_s**2 / 6.0 * force * elsewhere + dt_s**2 / 4.0 * (force**2 / mass + detent)).sum())


def _word(level: bool) -> str:
    return "high" if level else "low"


def _state(closed: bool) -> str:
    return "closed" if closed else "open"


def _closed(contact: Contact, sight: Sight) -> bool:
    """Whether a contact should be closed by what is to be seen of the machine."""
    state = sight.inputs.get(contact.name, "")
    held = FAULTS.get(state)
    if held is not None:
        return held
    if contact.kind == "switch":
        return (contact.type == "opener") != (state == "struck")
    return contact.kind == "bridge" or _signal(contact.name, sight.elements, sight.outputs)


def _signal(name: str, states: Mapping[str, str], outputs: Mapping[str, int]) -> bool:
    closed, setup = states["hood"] == "closed", states["key"] == "setup"
    match name:
        case "estop_1" | "estop_2":
            return states["estop"] == "released"
        case "overtemperature":
            return states["overtemperature"] == "normal"
        case "start":
            return states["start"] == "down"
        case "stop":
            return states["stop"] == "up"
        case "probe":
            return states["probe"] == "touched"
        case "spindle":
            return bool(outputs["spindle_runs"])
        case "power_ok":
            return bool(outputs["power"])
        case "hood_automatic":
            return closed and not setup
        case "hood_setup":
            return closed or setup
        case "key":
            return setup
    return states[name] == "high"


# ---- over a whole life -----------------------------------------------------------------------------------------------


@dataclass(frozen=True, eq=False)
class Life:
    """What a world did, as bits: of two lives of the same world all of it is the same."""

    said: bytes
    """What arrived at the host; `check_read` says when."""
    happened: tuple[tuple[int, Any], ...]
    """What came over the border, and when."""
    t_ns: NDArray[np.int64]
    delta: NDArray[Any]
    counts: NDArray[np.int64]
    position_mm: NDArray[np.float64]
    machine_position_mm: NDArray[np.float64]
    lost_steps: NDArray[np.float64]
    inputs: Mapping[str, str]
    outputs: Mapping[str, int]
    levels: Mapping[str, bool]
    flash: bytes | None


def check_counters(twin: Twin, border: Border) -> None:
    """Counters and commands are the sums of the stream. Raises Broken."""
    steps = twin.steps
    t_ns, delta = steps.t_ns, steps.delta
    if (np.diff(t_ns) < 0).any() or (len(t_ns) and not 0 <= t_ns[0] <= t_ns[-1] <= twin.time_ns):
        raise Broken("the recorded stream is not in the order of time")
    times = np.array(border.times, dtype=np.int64)
    counted = np.array(border.counted, dtype=np.int64)
    made = np.searchsorted(t_ns, times, side="right")
    for axis in range(delta.shape[1]):
        total = np.concatenate(([0], np.cumsum(delta[:, axis], dtype=np.int64)))[made]
        begins = np.array([i == 0 or axis in jumps for i, jumps in enumerate(border.was_set)])
        begin = np.maximum.accumulate(np.where(begins, np.arange(len(times)), 0))
        wrong = np.flatnonzero(counted[:, axis] - counted[begin, axis] != total - total[begin])
        if len(wrong):
            at = int(wrong[0])
            raise Broken(
                f"axis {axis} counts {counted[at, axis]} at {times[at]} ns; since {times[begin[at]]} ns, when it was "
                f"{counted[begin[at], axis]}, the stream has made {total[at] - total[begin[at]]} steps"
            )
    if tuple(twin.counts.tolist()) != border.counts:
        raise Broken(f"counters are {twin.counts.tolist()}, the controller's are {border.counts}")
    senses = np.array(border.senses, dtype=np.int64)[np.searchsorted(times, t_ns, side="left") - 1]
    motors = (delta * senses).sum(axis=0, dtype=np.int64)
    commanded = twin._plant.commanded
    if (motors != commanded).any():
        raise Broken(f"the drives were commanded {commanded.tolist()} steps, the stream makes {motors.tolist()}")


def check_read(border: Border, before: int, count: int, now_ns: int, late_ns: int | None) -> None:
    """`count` bytes are read at now_ns, after `before` others. Raises Broken.

    A byte can be read from the instant on in which it arrives, and not before: so far nobody can tell how time is cut.
    When it *is* read depends on when somebody looks. A run that stops when there is something to read looks whenever
    anything happens, which bytes on a line that takes time do not do one by one: it stops at the latest when the line
    falls silent, and earlier if something else has happened meanwhile. A server at a finite speed (late_ns) looks so
    much later at most.
    """
    arrivals, end = border.arrivals, before + count
    if end > len(arrivals) or (count and arrivals[end - 1] > now_ns):
        raise Broken(f"at {now_ns} ns the host reads a byte that has not arrived yet")
    if end < len(arrivals) and arrivals[end] <= now_ns:
        raise Broken(f"at {now_ns} ns the host does not get the byte that has arrived at {arrivals[end]} ns")
    if count:
        latest_ns = border.silent_ns(before) if late_ns is None else arrivals[before] + late_ns
        if now_ns > latest_ns:
            raise Broken(f"the host reads a byte at {now_ns} ns, and should have by {latest_ns} ns")


def difference(first: Life, second: Life) -> str | None:
    """The first thing in which two lives of one world differ, in words; None if there is nothing."""
    for field in fields(Life):
        a, b = getattr(first, field.name), getattr(second, field.name)
        if isinstance(a, tuple):
            for number, (left, right) in enumerate(zip(a, b, strict=False)):
                if left != right:
                    return f"{field.name}[{number}]: {left!r}, then {right!r}"
            if len(a) != len(b):
                return f"{field.name}: {len(a)}, then {len(b)}; next is {(a + b)[min(len(a), len(b))]!r}"
        elif isinstance(a, np.ndarray):
            if a.shape != b.shape:
                return f"{field.name}: {len(a)} rows, then {len(b)}"
            if a.tobytes() != b.tobytes():
                at = int(np.flatnonzero(np.reshape(a != b, (len(a), -1)).any(axis=1))[0])
                return f"{field.name}[{at}]: {a[at]!r}, then {b[at]!r}"
        elif a != b:
            return f"{field.name}: {a!r}, then {b!r}"
    return None
