"""The iMC: effects of host, inputs and clock on the device.

    host bytes --> 253, 254, 255 at once
              `-> lines (waiting.py) --> refused, or done: reply now, or a task of the supervisor
    inputs ----> keys, limit switches, safety chain
    clock -----> ends of runs, pauses, supervision cycles

A command begins when its CR arrives, or when the one before it has been answered. Its reply leaves at the time of its
last pulse. There is no processing time in between (imc/21).

A line is handled in two steps: `_admit...` may refuse it (returns an effect, or raises Refusal), and the effect carries
it out and never refuses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from types import GeneratorType
from typing import Any

from isel_twin.controller import CounterSet, Event, SerialFormat
from isel_twin.firmware.imc import commands, grammar, settings
from isel_twin.firmware.imc.device import Device
from isel_twin.firmware.imc.ports import SIGNALS, TERMINALS, Inputs
from isel_twin.firmware.imc.profile import Profile
from isel_twin.firmware.imc.program import Recorder, admit_recording, run_program
from isel_twin.firmware.imc.replies import BAD_AXES, INVALID_FIELD, OK, STOPPED, SYNTAX, Refusal
from isel_twin.firmware.imc.safety import Event as SafetyEvent
from isel_twin.firmware.imc.safety import State, powered
from isel_twin.firmware.imc.supervisor import Supervisor, signal_error, watched
from isel_twin.firmware.imc.waiting import WaitingLines
from isel_twin.motion import Displacement, Motion

SHOWN = ("moving", "lamp_start", "lamp_stop", "lamp_fault")  # outputs that show the state
OPERATING = State.OPERATING  # bound once: looking up a member takes 0.2 us
# the effect of an accepted line; returns the reply, or None if it comes later or never
Effect = Callable[[], str | None]


class Imc:
    """Implements `isel_twin.controller.Controller` and `KeepsBytes`."""

    def __init__(self, profile: Profile, flash: bytes | None) -> None:
        """flash: image from the last power-off; None or empty for a new device."""
        self._profile = profile
        self._events: list[Event] = []
        self._flash = settings.Flash(settings.default_settings(profile)) if not flash else settings.decode(flash)
        self._inputs = Inputs({})
        self._boot(0)
        self._events.clear()

    def _boot(self, now_ns: int) -> None:
        """Set everything to its state after power-on; the inputs stay as they are."""
        self._lines = WaitingLines(self._profile.input_bytes)
        self._assembler = grammar.LineAssembler(self._profile.line_bytes)
        self._recorder: Recorder | None = None
        self._shown: tuple[bool | None, ...] = (None,) * len(SHOWN)  # what SHOWN show
        self._device = Device(self._profile, self._flash, self._inputs, self._events)
        self._device.executor.now_ns = now_ns
        self._supervisor = Supervisor(self._device)
        self._format = SerialFormat(9_600 if self._device.settings.baud_9600 else 19_200)
        self._device.outputs.reset()
        self._device.outputs["flash_fault"] = int(self._flash is None)
        if powered(self._inputs):
            self._device.note(SafetyEvent.INITIALISED)
            self._device.energise()

    def _keep_flash(self) -> None:
        """Keep what the device has written to its flash for the next start."""
        self._flash = None if self._device.outputs["flash_fault"] else self._device.flash

    # ---- Controller -------------------------------------------------------------------------------------------------

    @property
    def serial_format(self) -> SerialFormat:
        """19200 baud, or 9600 if the flash said so at the last power-on or reset (4.2.15)."""
        return self._format

    @property
    def counts(self) -> Displacement:
        return self._device.counts

    @property
    def direction(self) -> Displacement:
        """Motor sense of each counter (4.2.8)."""
        return self._device.direction

    @property
    def run(self) -> Motion | None:
        return self._device.executor.motion

    @property
    def next_ns(self) -> int | None:
        return self._supervisor.next_ns

    @property
    def acting_bytes(self) -> frozenset[int] | None:
        return None if self._supervisor.listening else grammar.ENDS

    @property
    def idle(self) -> bool:
        """True if no command waits or is in progress; commands held by a stop do not count."""
        return self._supervisor.task is None and not self._lines

    @property
    def fault(self) -> bool:
        return bool(self.fault_cause)

    @property
    def fault_cause(self) -> str:
        return self._device.fault_cause

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._inputs = Inputs(levels)
        self._keep_flash()
        self._boot(t_ns)
        self._settle()

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        for run, end in grammar.split_runs(data):
            heard = 0
            while heard < len(run) and self._supervisor.listening:
                if self._hear(run[heard]):
                    self._settle()
                heard += 1
            self._assembler.feed(run[heard:])
            if end and self._receive_end(end[0]):
                self._settle()

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """The edge meets the motion that caused it, even if that motion ends at this instant."""
        device = self._device
        device.executor.now_ns = t_ns
        changed = device.inputs.set(terminal, level)
        if changed is not None:
            self._supervisor.input_changed(*changed)
            if changed == SIGNALS["stop_released"] and not level:
                if self._supervisor.stop_key():
                    self._lines.hold()
            elif changed == SIGNALS["start"] and level:
                self._start_key()
        self._settle()

    def advance(self, t_ns: int) -> None:
        self._device.executor.now_ns = t_ns
        if self._supervisor.tick():
            self._settle()

    def take(self) -> list[Event]:
        events, self._events[:] = self._events[:], ()
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return TERMINALS

    def machine_overrides(self) -> Mapping[str, Any]:
        """The axes have stepper motors; the stages may be any."""
        return {"axes.all.drive": "stepper"}

    def _settle(self) -> None:
        """Do all that is due now: ends of runs and pauses, then the next lines."""
        supervisor = self._supervisor
        while supervisor.tick() or (supervisor.task is None and (self._answer_held() or self._next_line())):
            pass
        self._show()

    def _next_line(self) -> bool:
        """Carry out the next line, or answer one that was lost; False if there is none."""
        line = self._lines.take()
        if line is not None:
            self._execute(line, self._recorder)
        elif self._lines.lost:
            self._lines.lost -= 1
            self._device.send(SYNTAX)
        else:
            return False
        return True

    def _answer_held(self) -> bool:
        """Answer the first line that a stop holds (imc/5); False if there is none or it must wait. A query is answered
        at once, other lines by `F` when nothing is left to resume.
        """
        if not self._lines.held:
            return False
        line = self._lines.held[0]
        code = commands.dnc_code(line, self._device.number)
        question = code in commands.QUESTIONS
        if not question and self._supervisor.parked is not None:
            return False
        self._lines.drop_first_held()
        if question:
            self._execute(line, None)
        elif code is not None:
            self._device.send(STOPPED)
        return True

    def _show(self) -> None:
        """Set the outputs that show the state. A lamp the host has switched stays until its state changes."""
        supervisor = self._supervisor
        moving = supervisor.moving
        shown = (
            moving,
            moving or (supervisor.task is not None and supervisor.task.program),
            supervisor.parked is not None,
            self._device.safety is not OPERATING,
        )
        if shown == self._shown:
            return
        before, self._shown = self._shown, shown
        for number, on in enumerate(shown):
            if on != before[number]:
                self._device.outputs[SHOWN[number]] = int(on)

    # ---- bytes and lines --------------------------------------------------------------------------------------------

    def _hear(self, byte: int) -> bool:
        """Take a byte for a stored program that waits for one; return True if it has an effect now."""
        if byte == grammar.LF:
            return False
        self._device.executor.hear(byte)
        return True

    def _receive_end(self, byte: int) -> bool:
        """Take a CR or a control byte; return True if it has an effect now."""
        if byte in (grammar.STOP, grammar.BREAK):
            self._device.forget_unmade()  # the host does without it
        if byte == grammar.STOP:
            if self._supervisor.stop():
                self._lines.hold()
        elif byte == grammar.BREAK:
            self._supervisor.break_off()
            self._lines.hold()
        elif byte == grammar.RESET:
            self._reset()
        else:
            line = self._assembler.end()
            if line is None:
                return False
            self._lines.put(line)
        return True

    def _reset(self) -> None:
        """Byte 254: as after power-on, at once; the flash stays (2.2.31)."""
        self._supervisor.discard()
        counts = self._device.counts
        self._keep_flash()
        self._boot(self._device.now_ns)
        for axis in range(settings.AXES):
            if counts[axis]:
                self._events.append(CounterSet(axis, 0))

    def _execute(self, line: bytes, recorder: Recorder | None) -> None:
        """Refuse a line, or carry it out: reply, or start a task. recorder: for a line of a data field."""
        try:
            effect = self._admit(line) if recorder is None else self._admit_stored(line, recorder)
        except Refusal as refusal:
            self._device.send(refusal.code)
            self._device.hindered(line, refusal.code)
            return
        reply = effect()
        if reply is not None:
            self._device.send(reply)
            if self._supervisor.task is None:
                self._device.made(line)

    def _admit(self, line: bytes) -> Effect:
        """A DNC line. Raises Refusal."""
        device = self._device
        parts = grammar.split_dnc(line, device.number, commands.DNC_ALIASES)
        if parts is None:
            return lambda: None
        letter, code, text = parts
        if code == "S":
            grammar.read_numbers(text, ())
            return self._admit_start(line, answers=True)
        if code == "i":
            grammar.read_numbers(text, ())
            admit_recording(device)
            return self._begin_recording
        command = commands.find_dnc(device, code)
        values = command.admitted(device, command.read(device, text))
        return lambda: self._carry_out(line, command, values, letter in device.profile.acknowledge_at_once)

    def _carry_out(self, line: bytes, command: commands.Command, values: tuple[Any, ...], at_once: bool) -> str | None:
        """at_once: a command that takes time is acknowledged when it begins."""
        result = command.do(self._device, *values)
        if not isinstance(result, GeneratorType):
            return result or OK
        self._supervisor.forget_parked()
        while self._answer_held():
            pass
        self._supervisor.start(result, line, answers=not at_once)
        return OK if at_once else None

    def _begin_recording(self) -> str:
        self._recorder = Recorder(self._device)
        return OK

    def _admit_stored(self, line: bytes, recorder: Recorder) -> Effect:
        """A line of the data field. A refused one ends the field and makes it invalid (3.1, imc/40)."""
        self._recorder = None
        try:
            code, text = grammar.split_cnc(line, commands.CNC_ALIASES)
            if code == "9":
                grammar.read_numbers(text, ())
                recorder.finish()
            else:
                recorder.add(code, commands.find_cnc(code).read(self._device, text))
                self._recorder = recorder
        except Refusal:
            recorder.spoil()
            raise
        return lambda: OK

    def _admit_start(self, line: bytes, *, answers: bool) -> Effect:
        """Resume a stopped task, or start the stored program (2.2.23). Raises Refusal."""
        device, parked = self._device, self._supervisor.parked
        device.require_supply()
        if parked is None:
            axes, modal = self._admit_program()
            return partial(self._start_program, line, axes, modal, answers=answers)
        device.require_move()
        self._supervisor.require_unchanged()
        if parked.program:
            self._require_watches()
        return partial(self._resume, answers=answers)

    def _resume(self, *, answers: bool) -> None:
        self._lines.release()
        self._supervisor.resume(answers=answers)

    def _start_key(self) -> None:
        """The start key acts only at rest; a failure gives no reply (imc/32)."""
        if self._supervisor.task is not None or self._recorder is not None:
            return
        try:
            effect = self._admit_start(b"", answers=False)
        except Refusal:
            return
        effect()

    def _admit_program(self) -> tuple[int, settings.Modal]:
        """Check that the stored program may run; return its axes and modal values. Raises Refusal."""
        device, program = self._device, self._device.flash.program
        if program.state is not settings.ProgramState.VALID:
            raise Refusal(INVALID_FIELD)
        device.require_power()
        self._require_watches()
        if device.axes not in (0, program.axes):
            raise Refusal(BAD_AXES)
        modal = device.modal.filled(program.modal)
        with device.supposing(program.axes, modal):
            self._require_sound(program)
        return program.axes, modal

    def _start_program(self, line: bytes, axes: int, modal: settings.Modal, *, answers: bool) -> None:
        self._device.axes, self._device.modal = axes, modal
        signal_error(self._device, error=False)
        self._supervisor.start(run_program(self._device, commands.CNC), line, answers=answers, program=True)

    def _require_sound(self, program: settings.StoredProgram) -> None:
        """Raise Refusal(G) unless this firmware accepts every line: the image may come from another one."""
        try:
            for code, values in program.lines:
                commands.find_cnc(code).read(self._device, ",".join(map(str, values)))
        except Refusal:
            raise Refusal(INVALID_FIELD) from None

    def _require_watches(self) -> None:
        """Raise Refusal if a port watched in CNC mode forbids the program to run."""
        code = watched(self._device)
        if code is not None:
            raise Refusal(code)
