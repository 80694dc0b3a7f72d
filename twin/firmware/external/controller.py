"""The place of another control, as a controller (external/1): lines in, set points out, an answer for each line.

    lines -----> queue -----> one at a time --- row ---> ticks, then an answer at its end
                                            '-- else --> an answer at once

A row begins at the time at which it is taken: when it arrives, or at the end of the row before. So no set point lies in
the past, rows sent ahead follow each other without a gap, and whoever waits for each answer goes in lockstep with the
twin (external/3). In a wide queue the line's handshake makes the host wait.

A pause of REST_NS without a step ends a motion. Silence of the host for the watchdog's time switches the outputs off,
as step generators on a network do (external/4).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import CounterSet, Drives, Event, Output, Remark, Reply, SerialFormat
from isel_twin.firmware.external.protocol import END, FORMS, LINE_BYTES, SHORTEST_NS, Line, LineError, parse, row_of
from isel_twin.machine import CABINETS
from isel_twin.motion import Displacement, Listed
from isel_twin.motion.spreading import spread

REST_NS = 100 * MILLISECOND_NS  # pause without a step that ends a motion
QUEUED = 64  # waiting lines beyond which the host has to wait
WATCHDOG_MS = 1000
GUARDED = ("stages", "brake", "spindle", "power_request")  # outputs that go off with the watchdog
CONTACTS = (
    *(f"limit_{axis}{side}" for axis in (*CARRIAGES, "a") for side in (1, 2)),
    *dict.fromkeys(name for names in CABINETS.values() for name in names),
)


class External:
    """Implements isel_twin.controller.Controller, UsesDrives and HoldsHost."""

    # a socket is no serial line: a byte takes 10 ns
    serial_format = SerialFormat(1_000_000_000)

    def __init__(self, axes: int = 3, form: str = FORMS[0], watchdog_ms: int = WATCHDOG_MS) -> None:
        self.direction = (1,) * axes
        self.run: Listed | None = None
        self._lapsed = False  # the watchdog has switched the outputs off, and no answer has said so
        self.fault_cause = ""
        self._axes, self._form = axes, form
        self._watchdog_ns = watchdog_ms * MILLISECOND_NS
        self._t_ns = 0
        self._made: Displacement = (0,) * axes  # counters at the beginning of `run`
        self._target: Displacement = (0,) * axes  # at the end of the last row
        self._row_end_ns: int | None = None
        self._rest_ns = 0  # when a motion without further steps is over
        self._heard_ns = 0  # end of what the host has last asked for
        self._guarded = False  # the watchdog runs: one of its outputs is on
        self._queue: deque[Line | LineError] = deque()
        self._rest = b""
        self._overlong = False  # within a line that is too long
        self._outputs = dict.fromkeys(GUARDED, 0)
        self._names: tuple[str, ...] = ()
        self._bit: dict[str, int] = {}
        self._levels = 0
        self._told: tuple[str, ...] = ()
        self._drives: Drives | None = None
        self._events: list[Event] = []

    # What is seen of it

    @property
    def counts(self) -> Displacement:
        run = self.run
        if run is None:
            return self._made
        if self._row_end_ns is None:
            return self._target
        return tuple([made + by for made, by in zip(self._made, run.displacement(self._t_ns), strict=True)])

    @property
    def next_ns(self) -> int | None:
        if self._row_end_ns is not None:
            return self._row_end_ns
        due_ns = self._watchdog_due_ns
        if self.run is not None and (due_ns is None or self._rest_ns < due_ns):
            return self._rest_ns
        return due_ns

    @property
    def idle(self) -> bool:
        return self._row_end_ns is None and not self._queue

    @property
    def fault(self) -> bool:
        """The watchdog has switched the outputs off, and the host has not set one of them again."""
        return bool(self.fault_cause)

    @property
    def clear_to_send(self) -> bool:
        return len(self._queue) < QUEUED

    @property
    def _watchdog_due_ns(self) -> int | None:
        return self._heard_ns + self._watchdog_ns if self._guarded else None

    # Calls

    def use_drives(self, drives: Drives) -> None:
        self._drives = drives

    def drive_inputs(self) -> Sequence[Any]:
        return ()

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._t_ns = t_ns
        self._names = tuple(levels)
        self._bit = {name: 1 << bit for bit, name in enumerate(levels)}
        self._levels = sum(self._bit[name] for name, level in levels.items() if level)
        self._events.append(Output("current_lowering", 1))  # drives with step inputs do this by themselves

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self.advance(t_ns)
        if level:
            self._levels |= self._bit[terminal]
        else:
            self._levels &= ~self._bit[terminal]

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        *lines, self._rest = (self._rest + data).split(END)
        for line in lines:
            if self._overlong:
                self._overlong = False
                continue
            self._queue.append(self._read(line))
        if len(self._rest) > LINE_BYTES:
            if not self._overlong:
                self._queue.append(LineError(f"a line of more than {LINE_BYTES} bytes"))
            self._rest, self._overlong = b"", True
        self._work()

    def advance(self, t_ns: int) -> None:
        self._t_ns = t_ns
        if self._row_end_ns is not None and t_ns >= self._row_end_ns:
            self._row_end_ns = None
            self._answer()
            self._work()
        if self._row_end_ns is not None:
            return
        if self.run is not None and t_ns >= self._rest_ns:
            self._made, self.run = self._target, None
        due_ns = self._watchdog_due_ns
        if due_ns is not None and t_ns >= due_ns:
            self._lapse()

    def take(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        """Each contact has a terminal of its own name."""
        return {name: (name,) for name in CONTACTS}

    def machine_overrides(self) -> Mapping[str, Any]:
        return {}

    # Inside

    def _read(self, line: bytes) -> Line | LineError:
        try:
            if len(line) > LINE_BYTES:
                raise LineError(f"a line of more than {LINE_BYTES} bytes")
            return parse(line, self._axes)
        except LineError as error:
            return error

    def _work(self) -> None:
        """Carry out what waits, up to the next row."""
        while self._queue and self._row_end_ns is None:
            line = self._queue.popleft()
            try:
                self._heard_ns = self._t_ns
                if isinstance(line, LineError):
                    raise line
                if self._lapsed:
                    self._lapsed = False
                    raise LineError(
                        "the watchdog has switched the outputs off: nothing was sent in time; out sets them"
                    )
                self._carry_out(line)
            except LineError as error:
                self._events.append(Reply(b"error %s\n" % str(error).encode("latin-1", "replace")))

    def _carry_out(self, line: Line) -> None:
        word = line.word
        if word == "row" or word == "go":
            self._begin(*row_of(line, self._target), line.outputs)
            return
        if word == "names":
            names = " ".join(self._names).encode("latin-1", "replace")
            self._events.append(Reply(b"names axes=%d %s\n" % (self._axes, names)))
            return
        if word == "out":
            self._begin(SHORTEST_NS, (0,) * self._axes, line.outputs)  # external/7
            return
        if word == "set":
            self._set(line.counts)
        elif word == "form":
            self._form = line.words[0]
        elif word == "tell":
            self._told = line.words
        self._answer()

    def _begin(self, duration_ns: int, changes: tuple[int, ...], outputs: Mapping[str, int]) -> None:
        t_ns = self._t_ns
        self._put_out(outputs)
        if any(changes):
            self._made, self._target = (
                self._target,
                tuple([at + by for at, by in zip(self._target, changes, strict=True)]),
            )
            if self._form == "steps":
                times_ns, delta = spread(np.array(changes, np.int64), t_ns, duration_ns)
                self.run = Listed(times_ns, delta, t_ns)
            else:
                self.run = Listed(np.array([t_ns]), np.array([changes], np.int32), t_ns, duration_ns)
            self._rest_ns = t_ns + duration_ns + REST_NS
        self._row_end_ns = self._heard_ns = t_ns + duration_ns

    def _set(self, counts: tuple[int, ...]) -> None:
        self.run = None
        self._made = self._target = counts
        self._events += [CounterSet(axis, value) for axis, value in enumerate(counts)]

    def _put_out(self, outputs: Mapping[str, int]) -> None:
        if self.fault_cause and any(outputs.get(name) for name in GUARDED):
            self.fault_cause = ""
        for name, value in outputs.items():
            if name in self._outputs:
                if self._outputs[name] == value:
                    continue
                self._outputs[name] = value
                self._guarded = self._watchdog_ns > 0 and any(self._outputs.values())
            self._events.append(Output(name, value))

    def _lapse(self) -> None:
        self._put_out(dict.fromkeys(GUARDED, 0))
        self._lapsed = True
        self.fault_cause = f"nothing was sent for {self._watchdog_ns // MILLISECOND_NS} ms: outputs go off"
        self._events.append(Remark(self.fault_cause))

    def _answer(self) -> None:
        drives = self._drives
        faults = 0
        if drives is not None and True in (off := drives.fault):
            faults = sum(1 << axis for axis, fault in enumerate(off) if fault)
        text = b"ok %d %x %x" % (self._t_ns, self._levels, faults)
        if drives is not None and self._told:
            for name in self._told:
                values = drives.encoder if name == "encoder" else drives.past_zero_pulse
                text += b"".join([b" %d" % value for value in values])
        self._events.append(Reply(text + END))
