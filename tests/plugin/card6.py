"""A controller that is nothing like those of the package, to show that its borders are wide enough.

Six axes, set points every 4 ms, binary frames with a checksum, 38400 baud 8E1, drives that report, and a second device
on the same line:

    request   02h  address  length  command  payload ...  checksum      length: of command and payload
    reply     02h  address + 80h  length  status  payload ...  checksum      checksum: sum of all bytes before, mod 256

    address 1, the card     M  6 x int32 target, uint32 increments/s    answered K at the end, L at a switch, F stopped
                            Z  counters to zero here                    K
                            P  positions                                K, 6 x int32
                            E  encoders and lag in 1/10 increment       K, 6 x int32, 6 x int32
                            S  stop with a ramp                         K; the move answers F
    address 2, a keypad     ?  which lamps are lit                      K, one byte: bit 0 moving, bit 1 lag alarm

A frame that is damaged is answered N by the card. A command it does not know, or a move while one is made: ?.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.controller import CounterSet, DriveInput, Drives, Event, Output, Reply, SerialFormat
from isel_twin.language import Language, LanguageError, Message, MoveSettings
from isel_twin.motion import Displacement, SetPointRun

AXES = 6
PERIOD_NS = 4 * MILLISECOND_NS
ACCELERATION = 200_000
"""Increments/s^2."""
LAG_LIMIT = 400.0
START, CARD, KEYPAD = 2, 1, 2


def frame(address: int, content: bytes) -> bytes:
    """Content in a frame."""
    head = bytes([START, address, len(content)]) + content
    return head + bytes([sum(head) % 256])


# ---- set points ----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Plan:
    """A straight line of `steps`; its leading axis (N increments) rises at a to v and falls again, or stops before.

    With T = v / a and D = N / v: s(t) = a t^2 / 2, v (t - T / 2), N - a (T + D - t)^2 / 2. A plan stopped at tick k
    goes on from s and v there: s + v u - a u^2 / 2, u up to v / a. Set point k of axis i is n_i s(k period) / N,
    rounded.
    """

    steps: Displacement
    speed: Fraction
    identity: object = field(default_factory=object, repr=False)
    stop: int | None = None

    @property
    def axes(self) -> int:
        return len(self.steps)

    @property
    def way(self) -> int:
        return max(abs(n) for n in self.steps)

    @property
    def ticks(self) -> int:
        if self.stop is not None:
            return self.stop - int(-self._speed(self.stop) / ACCELERATION * SECOND_NS // PERIOD_NS)
        return -int(-(self.speed / ACCELERATION + self.way / self.speed) * SECOND_NS // PERIOD_NS)

    def _phase(self, k: int) -> Fraction:
        t, a, v = Fraction(k * PERIOD_NS, SECOND_NS), ACCELERATION, self.speed
        if self.stop is not None and k > self.stop:
            u = min(t - Fraction(self.stop * PERIOD_NS, SECOND_NS), self._speed(self.stop) / a)
            return self._phase(self.stop) + self._speed(self.stop) * u - a * u * u / 2
        rise, end = v / a, v / a + self.way / v
        if t < rise:
            return a * t * t / 2
        return v * (t - rise / 2) if t < end - rise else self.way - a * max(end - t, 0) ** 2 / 2

    def _speed(self, k: int) -> Fraction:
        t, end = Fraction(k * PERIOD_NS, SECOND_NS), self.speed / ACCELERATION + self.way / self.speed
        return max(min(ACCELERATION * t, self.speed, ACCELERATION * (end - t)), Fraction(0))

    def displacement(self, k: int) -> Displacement:
        return tuple(round(n * self._phase(k) / self.way) for n in self.steps)

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"set points {first}..{last} of {self.ticks}")
        points = np.array([self.displacement(k) for k in range(first, last + 1)], dtype=np.int64)
        return np.diff(points, axis=0).astype(np.int32)

    def stopped(self, k: int) -> Plan:
        return self if self.stop is not None else Plan(self.steps, self.speed, self.identity, k)


def plan(steps: Sequence[int], speed: int) -> Plan:
    """The move, slower if it is too short to reach the speed."""
    fastest = Fraction(int((max(abs(n) for n in steps) * ACCELERATION) ** 0.5))
    return Plan(tuple(steps), min(Fraction(speed), fastest))


# ---- the devices on the line ---------------------------------------------------------------------------------------


class Card6:
    """Implements isel_twin.controller.Controller and UsesDrives: the card, and the keypad on the same line."""

    serial_format = SerialFormat(38_400, parity="E")
    direction = (1,) * AXES
    fault = False

    def __init__(self) -> None:
        self.run: SetPointRun | None = None
        self._made: Displacement = (0,) * AXES
        self._t_ns = 0
        self._buffer = b""
        self._alarm = False
        self._ending = b"K"
        self._events: list[Event] = []

    @property
    def counts(self) -> Displacement:
        if self.run is None:
            return self._made
        return tuple(m + n for m, n in zip(self._made, self.run.displacement(self._t_ns), strict=True))

    @property
    def next_ns(self) -> int | None:
        return None if self.run is None else self.run.end_ns

    @property
    def idle(self) -> bool:
        return self.run is None

    def drive_inputs(self) -> Sequence[DriveInput]:
        return [DriveInput("lag_x", 0, "lag", LAG_LIMIT, LAG_LIMIT / 2)]

    def use_drives(self, drives: Drives) -> None:
        self._drives = drives

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return {"ends": tuple(f"limit_{axis}{end}" for axis in "xyz" for end in (1, 2))}

    def machine_overrides(self) -> Mapping[str, Any]:
        return {}

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._t_ns = t_ns
        self._events += [Output("stages", 1), Output("brake", 1)]

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        self._buffer += data
        while len(self._buffer) >= 3:
            if self._buffer[0] != START:
                self._buffer = self._buffer[1:]
                continue
            size = self._buffer[2] + 4
            if len(self._buffer) < size:
                return
            whole, self._buffer = self._buffer[:size], self._buffer[size:]
            if sum(whole[:-1]) % 256 != whole[-1]:
                self._reply(CARD, b"N")
            elif whole[1] == CARD:
                self._card(whole[3:4], whole[4:-1])
            elif whole[1] == KEYPAD:
                self._reply(KEYPAD, b"K" + bytes([(self.run is not None) | self._alarm << 1]))

    def _card(self, command: bytes, payload: bytes) -> None:
        if command == b"M" and len(payload) == 28 and self.run is None:
            *target, speed = struct.unpack(">6iI", payload)
            steps = [t - n for t, n in zip(target, self.counts, strict=True)]
            if speed and any(steps):
                self.run, self._ending = SetPointRun(plan(steps, speed), PERIOD_NS, self._t_ns), b"K"
            else:
                self._reply(CARD, b"K")
        elif command == b"Z" and self.run is None:
            self._made = (0,) * AXES
            self._events += [CounterSet(axis, 0) for axis in range(AXES)]
            self._reply(CARD, b"K")
        elif command == b"P":
            self._reply(CARD, b"K" + struct.pack(">6i", *self.counts))
        elif command == b"E":
            lag = [round(10 * n) for n in self._drives.lag]
            self._reply(CARD, b"K" + struct.pack(">12i", *self._drives.encoder, *lag))
        elif command == b"S":
            self._reply(CARD, b"K")
            if self.run is not None and self._ending == b"K":
                self.run, self._ending = self.run.stopped(self._t_ns), b"F"
        else:
            self._reply(CARD, b"?")

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._t_ns = t_ns
        if terminal == "lag_x":
            self._alarm = level
        elif not level and self.run is not None:
            self._ending = b"L"
            self._finish()

    def advance(self, t_ns: int) -> None:
        self._t_ns = t_ns
        if self.run is not None and t_ns >= self.run.end_ns:
            self._finish()

    def _finish(self) -> None:
        self._made, self.run = self.counts, None
        self._reply(CARD, self._ending)

    def _reply(self, address: int, content: bytes) -> None:
        self._events.append(Reply(frame(address + 0x80, content)))

    def take(self) -> list[Event]:
        events, self._events = self._events, []
        return events


def create(name: str, *, flash: bytes | None, settings: Mapping[str, Any]) -> Card6:
    """Entry point of isel_twin.controllers."""
    return Card6()


# ---- what its bytes mean -------------------------------------------------------------------------------------------

WORDS = {"zero": b"Z", "where": b"P", "encoders": b"E", "stop": b"S"}
STATUS = {75: "done", 70: "stopped", 76: "limit switch", 78: "damaged frame", 63: "not understood"}


class Card6Language:
    """Implements isel_twin.language.Language: `move X Y Z A B C speed`, `zero`, `where`, `encoders`, `stop`,
    `lamps`."""

    ranges: Mapping[str, tuple[int, int]] = {
        "speed_hz": (1, 100_000),
        "acceleration_hz_per_ms": (200, 200),
        "start_stop_hz": (1, 1),
    }

    def __init__(self) -> None:
        self._rest = {True: b"", False: b""}

    def frame(self, text: str) -> bytes:
        word, *numbers = text.split()
        if word == "lamps" and not numbers:
            return frame(KEYPAD, b"?")
        if word in WORDS and not numbers:
            return frame(CARD, WORDS[word])
        if word == "move" and len(numbers) == AXES + 1:
            return frame(CARD, b"M" + struct.pack(">6iI", *map(int, numbers)))
        raise LanguageError(f"{text!r} is none of: move X Y Z A B C speed, lamps, {', '.join(WORDS)}")

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        rest = self._rest[sent] + data
        while len(rest) >= 3 and len(rest) >= rest[2] + 4:
            whole, rest = rest[: rest[2] + 4], rest[rest[2] + 4 :]
            words = "request" if sent else STATUS.get(whole[3], "?")
            yield Message(whole, whole.hex(" "), f"{words}, device {whole[1] & 0x7F}", sent)
        self._rest[sent] = rest

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        return (not sent and not reply) or (len(reply) >= 5 and reply[3:4] == b"K")

    def reference(self) -> Sequence[bytes]:
        return [self.frame("zero")]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        numbers = [*target, *[0] * AXES][:AXES]
        return [self.frame(" ".join(["move", *map(str, numbers), str(settings.speed_hz)]))]

    def text(self, reply: bytes) -> str:
        return reply.hex(" ")


def create_language(name: str) -> Language:
    """Entry point of isel_twin.languages."""
    return Card6Language()
