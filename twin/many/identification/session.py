"""A recording with its measurements, and their prediction by a machine with other numbers.

    recording    sent --------- reply   gap   sent ----- reply     bytes and their times, of any machine
    measured         act   at_s       reading

    replay       the same bytes to a twin of the candidate machine, with the recorded delays after replies;
                 acts and readings at their commands, in the order of the file

Measured and predicted numbers are compared one by one (`Datum`):

    duration     of each command that takes LEAST_S or longer, from its last byte to the last one of its reply, but not
                 of the first reference run of an axis, whose start is unknown, nor of one that also moves an axis of
                 which nothing was measured (many/23), nor while an act interferes
    reading      position at rest
    pull         the same at a mounting where somebody pulled
    overrun      the same less the counter, which an emergency stop left elsewhere
    motion       position in motion
    stall        logarithm of the speed at which loss of steps begins, found as at the machine, by increasing the speed
    bound        the same of a series that never lost steps, or lost them at its first speed: known from one side
    ring         logarithms of frequency and damping of a machine that was let go at rest
    scatter      logarithm of the standard deviation over reference runs

The model is deterministic: one seed, switches without scatter. Only the data have noise, so two candidates differ by
their numbers alone (common random numbers).
"""

from __future__ import annotations

import itertools
import math
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Place
from isel_twin.base.units import SECOND_NS
from isel_twin.core.finer import finely
from isel_twin.core.journal import Received
from isel_twin.core.twin import Twin
from isel_twin.jobs.verdict import lost
from isel_twin.language import Language, MoveSettings, create_language, needed
from isel_twin.machine import Machine, with_overrides
from isel_twin.many.identification.hands import SETTLE_S, Pulls, let_go, shown_mm
from isel_twin.many.identification.measured import Act, Measured, MeasuredError, Reading, Ring, Stall
from isel_twin.recordings.compare import paired, traffic
from isel_twin.recordings.reading import Recorded, RecordingError
from isel_twin.wiring import EVENT_KEYS, ScenarioError, event_now

LEAST_S = 0.05  # shorter durations depend on the controller and its line, not on the machine
# relative standard deviation of a stall speed, beside the interval of its two speeds: near stall the outcome is chaotic
# in narrow bands of speed
STALL_SCATTER = 0.03
START_MM = 3.0  # model's carriages at power-on: near the switch, so that the first reference run is short
STALL_LOW, STALL_HIGH = 0.6, 1.7  # range of the search, over the measured speed,
STALL_HELD = 1.1  # and its upper end for a series that never lost: three deviations above, all is as likely
# ratio of successive speeds: until steps are lost, then again from the last that held
STALL_COARSE, STALL_FINE = 1.1, 1.02
# standard deviation of a place of rest, beside the gauge's: dry friction lets rotor and carriage rest anywhere in a
# narrow band (0.7 to 1.5 um on the 4030, over forty places)
REST_SIGMA_MM = 0.001
REFERENCE_SIGMA_S = 0.015  # of a reference run, beside the clock's: a switch scatters by 10 to 15 um, left at 1 mm/s
RING_SIGMA, DAMPING_SIGMA = 0.02, 0.3  # relative standard deviations: where rotors rest and how nuts seat vary
MISSED = 1e4  # residual, in standard deviations, where the model has no value because the command got no reply
_PATIENCE_S = 3600.0


@dataclass(frozen=True)
class Datum:
    """One measured number."""

    kind: str  # duration, reading, pull, overrun, motion, ring, stall, bound, scatter
    label: str
    recording: str
    value: float
    sigma: float
    unit: str
    group: str = ""  # readings of a group share an unknown zero, durations an unknown delay of line, adapter and host
    scatter: float = 0.0  # standard deviation of the model's own value; part of sigma
    side: int = 0  # 1: what was measured is this value or more, -1: or less, 0: is this value
    load: float = 0.0  # of a pull, over the largest one of its mounting
    way: int = 0  # of an overrun: 1 upwards, -1 downwards


@dataclass(frozen=True)
class Session:
    """A recording for replay; can be pickled."""

    name: str
    controller: str
    pieces: tuple[tuple[int, bytes, bool, int], ...]  # time in ns, bytes, True if from the host, ns a byte
    operated: tuple[tuple[int, Mapping[str, Any]], ...]  # time in ns, and keys of a scenario event
    measured: Measured
    line_speed: bool = True
    untimed: frozenset[int] = frozenset()  # reference runs whose duration depends on what nobody has measured
    references: frozenset[int] = frozenset()  # commands that are reference runs

    @property
    def last(self) -> float:
        """The last command that is replayed."""
        return min((stall.command - 1 for stall in self.measured.stalls if stall.command is not None), default=math.inf)

    @property
    def data(self) -> tuple[Datum, ...]:
        """The measured data, in the order of `predict`."""
        found = []
        for number, exchange in enumerate(exchanges_of(self), 1):
            if self.timed(number) and exchange.duration_ns is not None and exchange.duration_ns >= LEAST_S * 1e9:
                scatter = REFERENCE_SIGMA_S if number in self.references else 0.0
                sigma, label = math.hypot(self.measured.time_sigma_s, scatter), f"{number}: {exchange.text}"
                seconds = exchange.duration_ns / SECOND_NS
                found.append(Datum("duration", label, self.name, seconds, sigma, "s", f"{self.name}/line", scatter))
        mountings: dict[tuple[str, str], list[Reading]] = {}
        for reading in self.measured.readings:
            mountings.setdefault((reading.axis, reading.gauge), []).append(reading)
        stopped = {act.command for act in self.measured.acts}
        found += [_of(one, mountings[one.axis, one.gauge], stopped, self.name) for one in self.measured.readings]
        found += [datum for ring in self.measured.rings for datum in _ring_data(ring, self.name)]
        found += [_stall_datum(stall, self.name) for stall in self.measured.stalls]
        for repeats in self.measured.repeats:
            values = np.array(repeats.mm)
            sigma = 1.0 / math.sqrt(2.0 * (len(values) - 1))
            label = f"{repeats.axis}, {len(values)} times"
            found.append(Datum("scatter", label, self.name, math.log(max(values.std(ddof=1), 1e-6)), sigma, "ln mm"))
        return tuple(found)

    def timed(self, number: int) -> bool:
        """True if the duration of a command depends on the machine alone."""
        acts = any(act.command == number for act in self.measured.acts)
        return number <= self.last and not acts and number not in self.untimed


def _of(reading: Reading, mounting: Sequence[Reading], stopped: Collection[int], name: str) -> Datum:
    """A reading of this mounting as a datum. stopped: commands that were interfered with."""
    value = reading.mm - (reading.counter_mm or 0.0)
    push = f", {reading.push_n:g} N at the {reading.push_at}" if reading.push_n else ""
    when = "" if reading.at_s is None else f", {reading.at_s:g} s"
    label, group = f"{reading.command}: {reading.axis}{push}{when}", f"{name}/{reading.axis}/{reading.gauge}"
    most_n, way = max(abs(one.push_n) for one in mounting), 0
    if any(one.command in stopped for one in mounting):
        kind, (first, last) = "overrun", (one.counter_mm or 0.0 for one in (mounting[0], mounting[-1]))
        way = (last > first) - (last < first)
    else:
        kind = "motion" if reading.at_s is not None else "pull" if most_n else "reading"
    sigma, load = math.hypot(reading.sigma_mm, REST_SIGMA_MM), abs(reading.push_n) / (most_n or 1.0)
    return Datum(kind, label, name, value, sigma, "mm", group, REST_SIGMA_MM, load=load, way=way)


def _ring_data(ring: Ring, name: str) -> list[Datum]:
    label = f"{ring.command}: {ring.axis}, {ring.push_n:g} N off the {ring.push_at}"
    found = [Datum("ring", f"{label}, Hz", name, math.log(ring.frequency_hz), RING_SIGMA, "ln Hz", "", RING_SIGMA)]
    if ring.damping > 0.0:
        value = math.log(ring.damping)
        found.append(Datum("ring", f"{label}, damping", name, value, DAMPING_SIGMA, "ln", "", DAMPING_SIGMA))
    return found


def _stall_datum(stall: Stall, name: str) -> Datum:
    """ln of the stall speed in Hz: uniform between the two speeds, or beyond the only one."""
    label = f"{stall.axis}, {stall.acceleration_hz_per_ms} Hz/ms"
    label += "" if stall.supply_v is None else f", {stall.supply_v:g} V"
    value = math.log(stall.middle_hz)
    if stall.held_hz == 0.0 or stall.lost_hz == math.inf:
        side = -1 if stall.held_hz == 0.0 else 1
        return Datum("bound", label, name, value, STALL_SCATTER, "ln Hz", "", STALL_SCATTER, side)
    sigma = math.hypot(math.log(stall.lost_hz / stall.held_hz) / math.sqrt(12.0), STALL_SCATTER)
    return Datum("stall", label, name, value, sigma, "ln Hz", "", STALL_SCATTER)


def _language(controller: str) -> Language:
    return needed(create_language(controller), controller)


def exchanges_of(session: Session) -> list[Any]:
    """Commands and replies of the recording, in order."""
    return paired(session.pieces, _language(session.controller)) if session.pieces else []


def session_of(recorded: Recorded, measured: Measured, controller: str, machine: Machine) -> Session:
    """A recording with its measurements. machine: any, to find where reference runs begin. Raises RecordingError."""
    name = recorded.path.stem
    own = measured.of(name)
    controller = recorded.controller or controller
    if not controller:
        raise RecordingError(f"{recorded.path}: does not say which controller it is of; --controller NAME does")
    operated = tuple((entry.time_ns, entry.content) for entry in recorded.of("/operator"))
    events = tuple((time_ns, content) for time_ns, content in operated if not set(content) - set(EVENT_KEYS))
    line_speed = not recorded.of_twin or recorded.metadata.get("line_speed") != "false"
    pieces = tuple(traffic(recorded))
    session = Session(name, controller, pieces, events, own, line_speed)
    commands = len(paired(pieces, _language(controller)))
    entries: tuple[Reading | Act | Ring, ...] = (*own.readings, *own.acts, *own.rings)
    if late := [item.command for item in entries if item.command > commands]:
        raise RecordingError(
            f"{recorded.path}: something was measured after command {late[0]}; the recording has {commands}"
        )
    player = Player(session, machine)
    player.play()
    runs, referenced, untimed = player.references, set[int](), set[int]()
    measured_axes = {CARRIAGES.index(axis) for axis in own.axes}
    for command, axes in runs.items():
        if axes - measured_axes or axes - referenced:  # what it depends on, or where it began, is unknown
            untimed.add(command)
        referenced |= axes
    return replace(session, untimed=frozenset(untimed), references=frozenset(runs))


def stand_alone(name: str, measured: Measured, controller: str) -> Session:
    """Measurements without a recording: stall speeds, repeats."""
    return Session(name, controller, (), (), measured.of(name))


def predict(session: Session, machine: Machine) -> NDArray[np.float64]:
    """float64 [n], prediction of each of `session.data` by the machine; nan: none."""
    found: list[float] = []
    data = session.data
    if session.pieces and any(item.kind not in ("stall", "bound", "scatter") for item in data):
        player = Player(session, machine)
        player.play()
        durations = dict(enumerate((exchange.duration_ns for exchange in player.exchanges()), 1))
        for item in data:
            if item.kind == "duration":
                ns = durations.get(int(item.label.partition(":")[0]))
                found.append(math.nan if ns is None else ns / SECOND_NS)
        found += player.readings
        for ring in session.measured.rings:
            hz, damping = player.rang.get(ring, (math.nan, math.nan))
            found += [math.log(hz), math.log(max(damping, 1e-6))][: len(_ring_data(ring, session.name))]
    for supply_v, stalls_there in itertools.groupby(session.measured.stalls, key=lambda stall: stall.supply_v):
        twin = referenced(session.controller, with_supply(machine, supply_v))
        found += [math.log(stall_speed_hz(twin, stall)) for stall in stalls_there]
    scatter = machine.tree["switches"]["repeatability"]["value"]
    sigma = session.measured.gauge_sigma_mm
    found += [math.log(math.hypot(scatter, sigma)) for _ in session.measured.repeats]
    return np.array(found)


class Player:
    """One replay of a session on a candidate machine."""

    def __init__(self, session: Session, machine: Machine) -> None:
        self._session = session
        self._twin = model_twin(machine, session.controller, session.line_speed)
        self._pieces: list[tuple[int, bytes, bool, int]] = []
        self._twin.listen(self._note)
        self._command = 0
        self.readings: list[float] = []  # of the session's readings, mm; nan: the command was never sent
        self.rang: dict[Ring, tuple[float, float]] = {}  # frequency and damping
        self.references: dict[int, set[int]] = {}  # by command: the axes whose reference it runs to, in order of time
        self._place = Place(session.name, ScenarioError)

    def _note(self, time_ns: int, kind: str, what: Any) -> None:
        if kind == "sent":
            self._pieces.append((time_ns, what, True, 0))
        elif kind == "received":
            received: Received = what
            self._pieces.append((received.arrival_ns, received.data, False, received.byte_ns))
        elif kind == "counter" and time_ns - self._began_ns > LEAST_S * SECOND_NS:
            self.references.setdefault(self._command, set()).add(what.axis)

    _began_ns = 0

    def exchanges(self) -> list[Any]:
        return paired(sorted(self._pieces, key=lambda piece: piece[0]), _language(self._session.controller))

    def play(self) -> None:
        """Replay up to the last command that counts."""
        session, twin = self._session, self._twin
        language = _language(session.controller)
        found: dict[Reading, float] = {}
        then = now = 0
        past_ns = resumed_ns = 0  # the last common instant, in the recording and now
        entries: list[tuple[int, int, Any]] = [(piece[0], 1, piece) for piece in session.pieces]
        entries += [(time_ns, 0, content) for time_ns, content in session.operated]
        for time_ns, kind, content in sorted(entries, key=lambda entry: entry[:2]):
            if kind and not content[2]:  # a reply
                then += len(content[1])
                past_ns = time_ns
                continue
            now = self._await(then, now)
            resumed_ns = max(resumed_ns, twin.time_ns)
            self._read(found)
            twin.run_until(max(twin.time_ns, resumed_ns + max(0, time_ns - past_ns)))
            past_ns, resumed_ns = time_ns, twin.time_ns
            if not kind:
                self._carry_out(content)
                continue
            messages = sum(1 for _ in language.messages(content[1], True))
            if self._command + messages > session.last:
                break
            self._began_ns = twin.time_ns
            twin.write(content[1])
            self._command += messages
            self._meanwhile(found)
        else:
            self._await(then, now)
        self._read(found)
        self.readings = [found.get(reading, math.nan) for reading in session.measured.readings]

    def _carry_out(self, content: Mapping[str, Any]) -> None:
        twin = self._twin
        twin.carry_out(event_now(dict(content), self._place, twin.settable, twin.keys))

    def _await(self, then: int, now: int) -> int:
        """Let time pass until as many bytes have come as in the recording, or no more will come."""
        twin = self._twin
        end_ns = twin.time_ns + round(_PATIENCE_S * SECOND_NS)
        while (now := now + len(twin.read())) < then and twin.time_ns < end_ns and not twin.idle:
            twin.run_until(end_ns, lambda: twin.reply_waiting or twin.idle)
        return now

    def _meanwhile(self, found: dict[Reading, float]) -> None:
        """Carry out the acts and readings during the command just sent."""
        measured, twin, sent_ns = self._session.measured, self._twin, self._twin.time_ns
        happened: list[tuple[float, Act | Reading]] = [(act.after_s, act) for act in measured.acts]
        happened += [(reading.at_s, reading) for reading in measured.readings if reading.at_s is not None]
        own = (each for each in happened if each[1].command == self._command)
        for after_s, what in sorted(own, key=lambda each: each[0]):  # acts first at equal times
            twin.run_until(max(twin.time_ns, sent_ns + round(after_s * SECOND_NS)))
            if isinstance(what, Act):
                self._carry_out(what.content)
            else:
                found[what] = self._position_mm(what)

    def _read(self, found: dict[Reading, float]) -> None:
        """Read the gauges at rest after the last command."""
        twin, pulls = self._twin, Pulls(self._twin)
        for reading in self._session.measured.readings:
            if reading.command != self._command or reading.at_s is not None or reading in found:
                continue
            pulls.pull(reading)
            twin.run(SETTLE_S)
            found[reading] = self._position_mm(reading)
        pulls.end()
        for ring in self._session.measured.rings:
            if ring.command == self._command and ring not in self.rang:
                self.rang[ring] = let_go(twin, ring)

    def _position_mm(self, reading: Reading) -> float:
        position_mm, axis = shown_mm(self._twin, reading), CARRIAGES.index(reading.axis)
        if reading.counter_mm is not None:
            position_mm -= float(self._twin.counts[axis] * self._twin.step_mm[axis])
        return position_mm


def model_twin(machine: Machine, controller: str, line_speed: bool = False) -> Twin:
    """A twin of a candidate, near its switches. If its masses and stiffness need shorter time steps than the original
    machine, the steps are halved. Raises MachineError.
    """
    x, y, z = (min(START_MM, 0.5 * axis.travel_mm) for axis in machine.axes)

    def made(more: Mapping[str, float]) -> Twin:
        finer = with_overrides(machine, more)
        return Twin(finer, controller, "mujoco", 0, line_speed=line_speed, start_mm=(x, y, z), keep_motions=1)

    return finely(machine, made)


def referenced(controller: str, machine: Machine) -> Twin:
    twin = model_twin(machine, controller)
    for command in _language(controller).reference():
        converse(twin, command)
    return twin


def converse(twin: Twin, data: bytes) -> bytes:
    """Send, run until the twin is idle, and return the reply."""
    twin.read()
    twin.write(data)
    twin.run_until_idle(_PATIENCE_S)
    return twin.read()


def with_supply(machine: Machine, supply_v: float | None) -> Machine:
    """The machine with this voltage at all stages; None: as it is."""
    return machine if supply_v is None else with_overrides(machine, {"axes.all.stage.supply": supply_v})


def stall_speed_hz(twin: Twin, stall: Stall) -> float:
    """The speed at which the move there and back begins to lose steps, found as at the machine, by increasing the
    speed: bisection would fail, as near stall some bands of higher speed hold again. The highest speed, if none loses
    steps.
    """
    language = needed(twin.language, twin.controller_name)
    lowest, highest = language.ranges["speed_hz"]
    middle = stall.middle_hz
    beyond = STALL_HELD if stall.lost_hz == math.inf else STALL_HIGH
    held, top = max(float(lowest), STALL_LOW * middle), min(float(highest), beyond * middle)
    for factor in (STALL_COARSE, STALL_FINE):
        while held < top:
            faster = min(held * factor, top)
            if stalls(twin, stall, round(faster)):
                for command in language.reference():  # its position is unknown now
                    converse(twin, command)
                top = faster
                break
            held = faster
    return math.sqrt(held * top)


def stalls(twin: Twin, stall: Stall, speed_hz: int) -> bool:
    """True if the move there and back loses steps at that speed. Raises MeasuredError if it is not made: then it has
    neither held nor lost (jobs/18).
    """
    axis = CARRIAGES.index(stall.axis)
    language = needed(twin.language, twin.controller_name)
    settings = MoveSettings(speed_hz, stall.acceleration_hz_per_ms, stall.start_stop_hz)
    gentle = MoveSettings(min(6000, language.ranges["speed_hz"][1]), 50, stall.start_stop_hz)
    for mm, how in ((stall.from_mm, gentle), (stall.to_mm, settings), (stall.from_mm, settings)):
        before = twin.lost_steps[axis]
        target = [int(count) for count in twin.counts[: len(CARRIAGES)]]
        if how is gentle and target[axis] == round(mm / float(twin.step_mm[axis])):
            continue  # the move before has ended there
        target[axis] = round(mm / float(twin.step_mm[axis]))
        for data in language.move(target, how):
            converse(twin, data)
        twin.run(SETTLE_S)
        if twin.counts[axis] != target[axis] and not twin.drive_faults[axis][0]:
            raise MeasuredError(
                f"stall of {stall.axis}: the controller does not make the move to {mm:g} mm at {how.speed_hz} Hz, so "
                "it says nothing of losses; look at from_mm, to_mm and its ramp"
            )
        if how is settings and bool(lost(twin.lost_steps[axis] - before, twin.slip_steps[axis])):
            return True
    return False
