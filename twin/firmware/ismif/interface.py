"""The iSMIF stepper interface: host, input and clock, and the commands that are carried out at once.

    host bytes --> lines --> master commands (@), at once
                       `---> jobs --> actions --> motion, outputs
    pin 11 ----------------------------^
    clock -----> ends of motions and waiting times

The status (6.3) is computed from the state.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from isel_twin.controller import Event, Reply, SerialFormat
from isel_twin.firmware.ismif.actions import Actions, Standing
from isel_twin.firmware.ismif.commands import AXIS_LETTERS, LINE_LIMIT, CommandError
from isel_twin.firmware.ismif.jobs import ACKNOWLEDGED, Jobs, read
from isel_twin.motion import Displacement, Motion

VERSION = "SMC-ISMIF 1.00"
CR, LF, START = b"\r", b"\n", b"\x01"
REFERENCE_INPUT = "pin11"


class Ismif:
    """Implements `isel_twin.controller.Controller`. Counters count half steps, independent of F (ismif/4)."""

    serial_format = SerialFormat(19_200)
    direction = (1, 1, 1, 1)

    def __init__(self, *, error_ppm: int = 0) -> None:
        """error_ppm: error of the output frequency (ismif/5)."""
        self._events: list[Event] = []
        self._line = bytearray()
        self._actions = Actions(self._events, error_ppm)
        self._executor = self._actions.executor
        self._jobs = Jobs(self._actions, self._reply)
        self._masters: Mapping[str, Callable[..., bytes | None]] = {
            "@R": self._reset,
            "@V": self._version,
            "@X": self._status,
            "@L": self._position,
            "@B": self._jobs.halt,
            "@S": self._stop,
            "@A": self._jobs.pause,
            "@C": self._jobs.go_on,
        }

    # ---- Controller -------------------------------------------------------------------------------------------------

    @property
    def counts(self) -> Displacement:
        """Half steps of X, Y, Z from the zero point; A is always 0."""
        return self._executor.counts

    @property
    def run(self) -> Motion | None:
        return self._executor.motion

    @property
    def next_ns(self) -> int | None:
        return self._executor.next_ns

    @property
    def idle(self) -> bool:
        """True if nothing moves or will move without host or operator; a pause counts as idle."""
        return self.run is None and self._jobs.idle

    @property
    def fault(self) -> bool:
        """True for an error in the third character of the status, which only `@X` reads (ismif/14)."""
        return bool(self._jobs.error)

    @property
    def fault_cause(self) -> str:
        return self._jobs.error

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        """Mains on. An input that is not wired reads high."""
        self._executor.now_ns = t_ns
        self._actions.power_on(levels.get(REFERENCE_INPUT, True))

    def receive(self, t_ns: int, data: bytes) -> None:
        """Bytes from the host: CR ends a line, 01h ends it and starts the job, LF is ignored."""
        self.advance(t_ns)
        for byte in data:
            if byte in (CR[0], START[0]):
                line, self._line = bytes(self._line), bytearray()
                self._receive_line(line, byte == START[0])
            elif byte != LF[0] and len(self._line) < LINE_LIMIT:  # one byte too many marks it as too long
                self._line.append(byte)

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        """Pin 11 has an effect only during a reference run (ismif/8)."""
        self.advance(t_ns)
        if terminal == REFERENCE_INPUT:
            self._actions.set_input(level)
            self._jobs.work()

    def advance(self, t_ns: int) -> None:
        self._executor.now_ns = t_ns
        self._executor.tick()
        self._jobs.work()

    def take(self) -> list[Event]:
        events = self._events[:]
        self._events.clear()
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """All position switches in series on the one reference input (ismif/8)."""
        return {REFERENCE_INPUT: tuple(f"limit_{letter.lower()}{end}" for letter in AXIS_LETTERS for end in (1, 2))}

    def machine_overrides(self) -> Mapping[str, Any]:
        """Half-step stages of the size that was built for these machines (ismif/7)."""
        return {"axes.all.steps_per_rev": 400, "axes.all.stage.supply": 32.0, "axes.all.stage.current": 2.0}

    def _receive_line(self, line: bytes, starts: bool) -> None:
        """Take a line; a master command that ends with 01h also starts the stored commands."""
        if line.lstrip(b" ").startswith(b"@"):
            self._carry_out_master(line)
            line = b""
        elif not line.strip(b" "):
            line = b""
        self._jobs.receive(line, starts)
        self._jobs.work()

    def _carry_out_master(self, line: bytes) -> None:
        reply = None
        try:
            command = read(line)
            reply = self._masters[command.code](*command.arguments)
        except CommandError as error:
            self._jobs.go_wrong(str(error))
        self._reply(reply or ACKNOWLEDGED)

    def _reply(self, data: bytes) -> None:
        self._events.append(Reply(data + CR))

    # ---- master commands: the reply, None for an acknowledgement ----------------------------------------------------

    def _version(self) -> bytes:
        return f"@V {VERSION}".encode()

    def _status(self) -> bytes:
        """6.3. A reference run is not a job, and counts as moving throughout (ismif/9)."""
        jobs = self._jobs
        bits = (
            self.run is not None or (jobs.referencing and not jobs.paused),
            self._executor.purpose is Standing.WAITING,
            bool(jobs.error),
            not self._actions.position_known,
            jobs.referencing,
            jobs.in_progress and not jobs.referencing,
        )
        return b"@X" + b"".join(b"1" if bit else b"0" for bit in bits)

    def _position(self, axis: int) -> bytes:
        return f"@L{AXIS_LETTERS[axis]}{self._actions.position_steps(axis)}".encode()

    def _reset(self) -> None:
        """6.1: like 6.16, and the fault is cleared; power is requested from the cabinet as at power-on (ismif/11)."""
        self._jobs.error = ""
        self._stop()
        self._actions.request_power()

    def _stop(self) -> None:
        """6.16: no ramp, no job, no position; the settings stay, the signals go off (ismif/11)."""
        self._jobs.clear()
        self._actions.reset()
