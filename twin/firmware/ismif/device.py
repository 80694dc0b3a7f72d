"""The iSMIF stepper interface: what it does with commands, time and its one input.

Goal: a small machine with three layers, each fed by the one above it.

    receive     lines ----> master commands, at once
                      `---> job memory ----> `_work`: the next command, when nothing is going on
    command     actions:    Wait, Travel, Referenced, in a queue; a reference run of an axis is seven of them
    action      a run of the step stream, or a time to wait; `advance` and `set_input` end it

    reference run of an axis         switch free            struck
      rest, search    start ----------------------------------->|      until the input goes low, stopped there
      rest, free run                                      |<----|      until the input goes high, stopped there
      rest, offset                          0 <-----------|            #O steps, then the counter is set to 0

The status (6.3) is read off that state, it is not kept beside it. Sections are those of the manual; S1, S2 ... are in
docs/decisions.md.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any

from isel_twin.controller import CounterSet, Event, Output, Reply, SerialFormat
from isel_twin.firmware.ismif.commands import (
    AXIS_LETTERS,
    LINE_LIMIT,
    STEPS_LIMIT,
    Command,
    CommandError,
    Target,
    parse,
)
from isel_twin.firmware.ismif.configuration import SETTINGS, Configuration
from isel_twin.firmware.ismif.memory import ROOM, Entry, JobMemory, ReceiveQueue
from isel_twin.firmware.ismif.moves import FullSteps, ramp
from isel_twin.motion import Displacement, Path, StepRun, line
from isel_twin.units import MILLISECOND_NS

VERSION = "SMC-ISMIF 1.00"
FORMAT = SerialFormat(19_200)
CR, LF, START, READY, FULL = b"\r", b"\n", b"\x01", b"\x02", b"\x03"
REFERENCE_INPUT = "pin11"
REST_NS = 50 * MILLISECOND_NS
"""Standstill before each motion of a reference run: the carriage settles, the switch stops bouncing (S8)."""
SEARCH_LIMIT = 200_000
FREE_LIMIT = 4_000
"""Half steps after which a search or a free run has failed (S8)."""
AXES = range(3)


@dataclass(frozen=True)
class Wait:
    """Let time pass; `told`: a waiting time of the job, which the status shows."""

    ns: int
    told: bool


@dataclass(frozen=True)
class Travel:
    """Move along a straight line of `steps` (X, Y, Z); with `until`, only to the change of the input to that level."""

    steps: tuple[int, int, int]
    speed_hz: int
    until: bool | None = None


@dataclass(frozen=True)
class Referenced:
    """This is the zero point of the axis."""

    axis: int


class Ismif:
    """Implements `isel_twin.controller.Controller`. Counters count half steps of the stage, whatever F says (S4)."""

    serial_format = FORMAT
    direction = (1, 1, 1, 1)

    def __init__(self, *, error_ppm: int = 0) -> None:
        """`error_ppm`: how far the output frequency is off, in millionths (S5)."""
        self.run: StepRun | None = None
        self._error_ppm = error_ppm
        self._configuration = Configuration()
        self._memory = JobMemory()
        self._events: list[Event] = []
        self._t_ns = 0
        self._input = True
        self._line = bytearray()
        self._waiting_lines = ReceiveQueue()
        self._void = False
        self._told_full = False
        self._error = False
        self._known = [False for _ in AXES]
        self._pen = 0
        self._made = (0, 0, 0, 0)
        self._idle_state()
        self._masters: dict[str, Callable[..., bytes]] = {
            "@R": self._reset,
            "@V": self._version,
            "@X": self._status,
            "@L": self._position,
            "@B": self._halt,
            "@S": self._stop,
            "@A": self._pause,
            "@C": self._continue,
        }
        self._handlers: dict[str, Callable[..., None]] = {
            "$H": self._begin_reference,
            "L": self._begin_vector,
            "A": self._set_signal,
            "W": self._begin_wait,
        }

    def _idle_state(self) -> None:
        """Nothing is being carried out."""
        self._entry: Entry | None = None
        self._actions: deque[Wait | Travel | Referenced] = deque()
        self._travel: Travel | None = None
        self._path: Path | None = None
        self._path_made = 0
        self._wait: Wait | None = None
        self._wait_until: int | None = None
        self._paused = False
        self._braking = False
        self._abandoned = False
        self._edge = False

    # ---- the border -------------------------------------------------------------------------------------------------

    @property
    def counts(self) -> Displacement:
        """Half steps of X, Y, Z from the zero point at the time of the last call; A is always 0."""
        if self.run is None:
            return self._made
        return _sum(self._made, self.run.displacement(self._t_ns))

    @property
    def next_ns(self) -> int | None:
        """End of the run or of the wait in progress."""
        return self.run.end_ns if self.run is not None else self._wait_until

    @property
    def idle(self) -> bool:
        """Nothing moves and nothing will before the host or the operator does something; a pause counts as idle."""
        if self.run is not None:
            return False
        return self._paused or not (self._entry or self._memory.released or self._waiting_lines)

    @property
    def fault(self) -> bool:
        """The third character of the status, which no answer but that of `@X` shows (S15)."""
        return self._error

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """Mains on: the drive signals come up, nothing is referenced. An input that is not wired reads high."""
        self._t_ns = t_ns
        self._input = levels.get(REFERENCE_INPUT, True)
        self._request_power()
        for name in ("stages", "brake"):
            self._events.append(Output(name, 1))
        self._events.append(Output("current_lowering", 0))
        self._put_signals()
        self._safe_outputs()

    def receive(self, t_ns: int, data: bytes) -> None:
        """Bytes from the host: CR ends a line, 01h ends it and starts the job, LF is not there."""
        self.advance(t_ns)
        for byte in data:
            if byte in (CR[0], START[0]):
                line, self._line = bytes(self._line), bytearray()
                self._receive_line(line, byte == START[0])
            elif byte != LF[0] and len(self._line) < LINE_LIMIT:  # one byte too long says enough
                self._line.append(byte)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """Pin 11 matters during a reference run only (S8)."""
        self.advance(t_ns)
        if terminal != REFERENCE_INPUT:
            return
        self._input = level
        if self._travel is not None and self._travel.until == level:
            self._end_at_edge()
        self._work()

    def advance(self, t_ns: int) -> None:
        """Pulses up to t_ns; then what is due."""
        self._t_ns = t_ns
        if self.run is not None and self.run.end_ns <= t_ns:
            self._run_ended()
        if self._wait_until is not None and self._wait_until <= t_ns:
            self._wait, self._wait_until = None, None
        self._work()

    def take(self) -> list[Event]:
        """Events since the last call."""
        events, self._events = self._events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """All position switches in series on the one reference input (S8)."""
        return {REFERENCE_INPUT: tuple(f"limit_{letter.lower()}{end}" for letter in AXIS_LETTERS for end in (1, 2))}

    def machine_overrides(self) -> Mapping[str, Any]:
        """Half-step stages of the size that was built for these machines (S7)."""
        return {"axes.all.steps_per_rev": 400, "axes.all.stage.supply": 32.0, "axes.all.stage.current": 2.0}

    # ---- lines and jobs (5.2) ---------------------------------------------------------------------------------------

    def _receive_line(self, line: bytes, starts: bool) -> None:
        if line.lstrip(b" ").startswith(b"@"):
            self._carry_out_master(line)
            line = b""
        elif not line.strip(b" "):
            line = b""
        if line or starts:
            self._error |= not self._waiting_lines.append(line, starts)
            self._store_lines()
        self._work()

    def _carry_out_master(self, line: bytes) -> None:
        try:
            command = _parse(line)
        except CommandError:
            self._error = True
            self._reply(b"")
            return
        self._reply(self._masters[command.code](*command.arguments))

    def _store_lines(self) -> None:
        """Take lines into the memory as long as they fit; the others stay in the line's queue, unanswered (S2)."""
        while self._waiting_lines:
            line, starts = self._waiting_lines.head
            if line is None:
                self._waiting_lines.take()
                self._void_job()
                continue
            if len(line) + 1 > self._memory.free:
                return
            self._waiting_lines.take()
            command = self._checked(line)
            if command is not None or starts:
                self._memory.store(Entry(command, len(line) + 1, starts))
            if starts:
                self._void = False
            if self._memory.full:
                self._told_full = True
            if starts or self._memory.full:
                self._memory.release()
            if line:
                self._reply(FULL if self._memory.full else b"")

    def _checked(self, line: bytes) -> Command | None:
        """The command to store; None for an empty line and in a void job. A wrong command voids its job (S1)."""
        command = None
        try:
            command = _parse(line) if line else None
        except CommandError:
            self._void_job()
        return None if self._void else command

    def _void_job(self) -> None:
        """Forget what is stored of the job that is being received, and the rest of it up to its 01h (S1)."""
        self._error = self._void = True
        self._memory.drop_stored()

    def _work(self) -> None:
        """Carry out what can be carried out now, until something takes time or nothing is left."""
        while self.run is None and self._wait_until is None and not self._paused:
            if self._travel is not None:
                self._set_off()
            elif self._wait is not None:
                self._wait_until = self._t_ns + self._wait.ns
            elif self._actions:
                self._begin_action(self._actions.popleft())
            elif self._entry is not None:
                self._end_command(self._entry)
            elif self._memory.released:
                self._begin_command(self._memory.take())
            else:
                return

    def _begin_command(self, entry: Entry) -> None:
        self._entry = entry
        self._use_room()
        command = entry.command
        if command is None:
            return
        if command.code in SETTINGS:
            self._configure(command)
        else:
            self._handlers[command.code](*command.arguments)

    def _use_room(self) -> None:
        """Commands have left the memory: take in waiting lines, or tell the host."""
        self._store_lines()
        if self._told_full and self._memory.free >= ROOM:
            self._told_full = False
            self._reply(READY)

    def _end_command(self, entry: Entry) -> None:
        self._entry = None
        if entry.ends_job:
            self._reply(READY)

    def _fail(self) -> None:
        """A command cannot be carried out: the rest of its job is dropped, in the memory and still to come (S1)."""
        self._error = True
        self._actions.clear()
        while self._entry is not None and not self._entry.ends_job and self._memory.released:
            self._entry = self._memory.take()
        if self._entry is not None and self._entry.ends_job:
            self._entry = Entry(None, 0, ends_job=True)
        else:  # a full memory has started it: its 01h is not in the memory yet, and gets the 02h
            self._entry = None
            self._void_job()
        self._use_room()

    # ---- actions ----------------------------------------------------------------------------------------------------

    def _begin_action(self, action: Wait | Travel | Referenced) -> None:
        match action:
            case Wait():
                self._wait = action
            case Travel():
                path = line((*action.steps, 0))
                self._travel, self._path_made = action, 0
                self._path = FullSteps(path) if self._configuration.half_steps == 2 else path
            case Referenced(axis):
                counts = list(self._made)
                counts[axis] = 0
                self._set_counts(tuple(counts), axis)
                self._known[axis] = True

    def _set_off(self) -> None:
        """Make the rest of the path of the travel, if there is something left to make."""
        travel, path = self._travel, self._path
        assert travel is not None
        assert path is not None
        rest = path.ticks - self._path_made
        if travel.until == self._input or rest == 0:
            self._travel = None
            return
        settings = self._configuration
        law = ramp(rest, travel.speed_hz, settings.start_hz, settings.ramp_ms, self._error_ppm)
        self.run = StepRun(path, law, self._t_ns, self._path_made)

    def _run_ended(self) -> None:
        """The pulses of the run have been made: its travel is over, or it was braked on the way."""
        run, travel = self.run, self._travel
        assert run is not None
        assert travel is not None
        self._made = _sum(self._made, run.displacement(run.end_ns))
        self._path_made = run.last
        self.run = None
        exhausted = travel.until is not None and not self._edge and run.last == run.path.ticks
        if self._edge or run.last == run.path.ticks:
            self._travel = None
        self._braking = self._edge = False
        if self._abandoned:
            self._abandon()
        elif exhausted:
            self._fail()

    def _end_at_edge(self) -> None:
        """The switch has changed: stop there."""
        if self.run is None:
            self._travel = None
            return
        self._edge = True
        self.run = self.run.cut(self._t_ns)
        if self.run.end_ns <= self._t_ns:
            self._run_ended()

    def _brake(self) -> None:
        """Ramp down; `_run_ended` follows when the axes stand."""
        if self.run is not None and not (self._braking or self._edge):
            self._braking = True
            self.run = self.run.stopped(self._t_ns)
            if self.run.end_ns <= self._t_ns:
                self._run_ended()

    def _abandon(self) -> None:
        """Leave out the rest of the vector or the reference run; a waiting time of the job is not a motion."""
        self._abandoned = False
        self._actions.clear()
        self._travel = None
        if self._wait is not None and not self._wait.told:
            self._wait, self._wait_until = None, None

    # ---- master commands --------------------------------------------------------------------------------------------

    def _version(self) -> bytes:
        return f"@V {VERSION}".encode()

    def _status(self) -> bytes:
        """6.3. A reference run is not a job, and moves from its beginning to its end (S9)."""
        referencing = self._entry is not None and self._entry.command is not None and self._entry.command.code == "$H"
        bits = (
            self.run is not None or (referencing and not self._paused),
            self._wait_until is not None and self._wait is not None and self._wait.told,
            self._error,
            not self._position_known,
            referencing,
            not referencing and bool(self._entry or self._memory.released),
        )
        return b"@X" + b"".join(b"1" if bit else b"0" for bit in bits)

    def _position(self, axis: int) -> bytes:
        return f"@L{AXIS_LETTERS[axis]}{self._position_steps(axis)}".encode()

    def _halt(self) -> bytes:
        """6.15: this motion is over, the next command follows."""
        self._brake()
        if self.run is not None:
            self._abandoned = True
        else:
            self._abandon()
        return b""

    def _pause(self) -> bytes:
        """6.17: ramp down and stand; a waiting time stands still too (S10)."""
        if not self._paused:
            self._paused = True
            self._brake()
            if self._wait is not None and self._wait_until is not None:
                self._wait = replace(self._wait, ns=self._wait_until - self._t_ns)
                self._wait_until = None
        return b""

    def _continue(self) -> bytes:
        self._paused = False
        return b""

    def _reset(self) -> bytes:
        """6.1: like 6.16, and the fault is forgotten too; the cabinet is asked for power as at power-on (S11)."""
        self._error = False
        reply = self._stop()
        self._request_power()
        return reply

    def _stop(self) -> bytes:
        """6.16: no ramp, no job, no position; the settings stay, the signals go off (S11)."""
        self.run = None
        self._idle_state()
        self._memory.clear()
        self._waiting_lines.clear()
        self._void = self._told_full = False
        self._known = [False for _ in AXES]
        self._pen = 0
        self._set_counts((0, 0, 0, 0), *AXES)
        self._safe_outputs()
        return b""

    # ---- stored commands --------------------------------------------------------------------------------------------

    def _configure(self, command: Command) -> None:
        self._configuration.set(command)
        if command.code in ("T", "F"):
            self._put_signals()
        elif command.code == "Z":
            self._set_pen(0)

    def _set_signal(self, on: int) -> None:
        self._events += [Output("pin12", on), Output("spindle", on)]

    def _begin_wait(self, ms: int) -> None:
        self._actions.append(Wait(ms * MILLISECOND_NS, told=True))

    def _begin_reference(self, axes: tuple[int, ...]) -> None:
        """6.13: each axis in turn, in three motions. Z of a plotter has nothing to search for (S12)."""
        settings = self._configuration
        for axis in axes:
            self._known[axis] = False
        for axis in axes:
            if settings.plotter and axis == 2:
                self._set_pen(0)
                continue
            reference = settings.reference[axis]
            towards = 1 if reference.positive else -1
            for steps, index, until in (
                (SEARCH_LIMIT // self._configuration.half_steps * towards, reference.search, False),
                (FREE_LIMIT // self._configuration.half_steps * -towards, reference.free, True),
                (reference.offset * -towards, reference.offset_speed, None),
            ):
                x, y, z = (steps if axis == i else 0 for i in AXES)
                self._actions += [Wait(REST_NS, told=False), Travel((x, y, z), settings.speed_hz[index], until)]
            self._actions.append(Referenced(axis))

    def _begin_vector(self, index: int, *targets: Target) -> None:
        """6.14: all axes together, led by the longest way. Z of a plotter is the relay, switched first (S12)."""
        steps = [0, 0, 0]
        ends = [self._position_steps(axis) for axis in AXES]
        for target in targets:
            start = ends[target.axis]
            ends[target.axis] = target.steps + (start if target.relative else 0)
            steps[target.axis] = ends[target.axis] - start
        if any(abs(end) > STEPS_LIMIT for end in ends):
            self._fail()
            return
        if self._configuration.plotter:
            self._set_pen(ends[2])
            steps[2] = 0
        self._actions.append(Travel((steps[0], steps[1], steps[2]), self._configuration.speed_hz[index]))

    # ---- state ------------------------------------------------------------------------------------------------------

    @property
    def _position_known(self) -> bool:
        """Every axis that has a motor has been referenced."""
        return all(self._known[: 2 if self._configuration.plotter else 3])

    def _position_steps(self, axis: int) -> int:
        """Position of an axis in the steps that commands count in."""
        if self._configuration.plotter and axis == 2:
            return self._pen
        return self.counts[axis] // self._configuration.half_steps

    def _set_counts(self, counts: Displacement, *axes: int) -> None:
        self._made = counts
        self._events += [CounterSet(axis, counts[axis]) for axis in axes]

    def _set_pen(self, position: int) -> None:
        """The plotter's relay is on wherever Z is not 0 (S12)."""
        self._pen = position
        self._events.append(Output("z_relay", int(position != 0)))

    def _put_signals(self) -> None:
        self._events.append(Output("clock_signals", int(self._configuration.clock)))
        self._events.append(Output("full_steps", int(self._configuration.full_step)))

    def _request_power(self) -> None:
        """A pulse: the safety relay closes at its rising edge, if nothing speaks against it."""
        self._events += [Output("power_request", 1), Output("power_request", 0)]

    def _safe_outputs(self) -> None:
        self._set_signal(0)
        self._set_pen(0)

    def _reply(self, data: bytes) -> None:
        self._events.append(Reply(data + CR))


def _parse(line: bytes) -> Command:
    """Read a line; one that has reached LINE_LIMIT has lost its end. Raises CommandError."""
    if len(line) >= LINE_LIMIT:
        raise CommandError(f"a line of {LINE_LIMIT} bytes or more")
    return parse(line)


def _sum(a: Displacement, b: Displacement) -> Displacement:
    return tuple(m + n for m, n in zip(a, b, strict=True))
