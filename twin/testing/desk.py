"""The desk drives one controller with ideal carriages."""

from __future__ import annotations

import heapq
import itertools
import re
from collections.abc import Callable, Iterable, Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import (
    Controller,
    CounterSet,
    Drives,
    FlashWrite,
    Output,
    Remark,
    Reply,
    UsesDrives,
    create_controller,
    offers,
)
from isel_twin.language import Language, create_language
from isel_twin.motion import Motion
from isel_twin.testing.drives import IdealDrives
from isel_twin.testing.switches import PositionSwitch, Ticks, switches
from isel_twin.wiring.cabinet import SafetyCabinet

_CHUNK = 1 << 16
_SPIN_LIMIT = 100_000
_LIMIT_SWITCH = re.compile(f"limit_[{''.join(AXIS_NAMES)}][12]")


class ProtocolError(AssertionError):
    """The controller broke the protocol of time or its own counters; the message says how."""


class StillBusyError(AssertionError):
    """The controller did not come to rest within the virtual time allowed."""


class Desk:
    """Drives one controller. Time is `time_ns`, integer nanoseconds since the desk was built."""

    # set this to a list to collect every desk that is built; desks then keep what is `sent`
    built: ClassVar[list[Desk] | None] = None

    def __init__(
        self,
        factory: Callable[[bytes | None], Controller],
        *,
        language: Language | None = None,
        carriage: Iterable[int] | None = None,
        position_switches: Iterable[PositionSwitch] | None = None,
        terminals: Mapping[str, tuple[str, ...]] | None = None,
        flash: bytes | None = None,
        drives: Callable[[Desk], Drives] = IdealDrives,
        power: bool = True,
    ) -> None:
        """`factory(flash)` builds the controller.

        language: for `query` and `start`; None: only `send` can be used. carriage: positions of the axes at first
        power-on, in steps (default 2000). terminals: instead of the controller's own. drives: what a controller that
        `UsesDrives` reads.
        """
        self.factory = factory
        self._language = language
        self.time_ns = 0
        self.controller = self.factory(flash)
        axes = len(self.counts)
        stands = [*(carriage or ()), *[2000] * axes][:axes]
        self.carriage = np.array(stands, dtype=np.int64)
        given = switches() if position_switches is None else position_switches
        self.position_switches = [switch for switch in given if switch.axis < axes]
        self.flash = flash
        self.flash_log: list[tuple[int, bytes]] = []
        self.remarks: list[tuple[int, str]] = []
        self.sent = bytearray()
        self.replies: list[tuple[int, bytes]] = []
        self.output_log: list[tuple[int, str, int]] = []
        self.outputs: dict[str, int] = {}
        self.inputs_log: list[tuple[int, str, bool]] = []
        self.levels: dict[str, bool] = {}
        self.steps_without_stages = 0
        self._terminals_given = terminals
        self._new_drives = drives
        self._chunks: list[tuple[NDArray[np.int64], NDArray[np.int8]]] = []
        self._unread = 0
        self._settled: Mapping[str, bool] | None = None  # contacts of the cabinet that all levels follow
        self._agenda: list[tuple[int, int, Callable[[], object]]] = []
        self._entry_numbers = itertools.count()
        self._forced_contacts: dict[str, bool] = {}
        self._forced_terminals: dict[str, bool] = {}
        self._struck = {switch.contact: False for switch in self.position_switches}
        self._looked_at: list[int] | None = None  # positions at which the switches were switched last
        self._strike()
        self.cabinet = SafetyCabinet()
        if Desk.built is not None:
            Desk.built.append(self)
        if power:
            self.power_on()

    @classmethod
    def of(cls, name: str, *, settings: Mapping[str, Any] | None = None, **options: Any) -> Desk:
        """A desk for the installed controller `name` with these settings, and its language."""
        options.setdefault("language", create_language(name))
        return cls(lambda flash: create_controller(name, flash=flash, settings=settings), **options)

    def power_on(self) -> None:
        """Mains on: the controller gets the present levels and starts with its counters at 0."""
        self.terminals = dict(self._terminals_given or self.controller.terminals())
        self._check_terminals()
        self._fed_by_drives: list[str] = []
        if offers(self.controller, UsesDrives):
            self._fed_by_drives = [fed.terminal for fed in self.controller.drive_inputs()]
            self.controller.use_drives(self._new_drives(self))
        self.levels = self._levels()
        self._expected = [0] * len(self.counts)
        self.controller.power_on(self.time_ns, dict(self.levels))
        self._collect()

    def power_cycle(self, off_s: float = 1.0, flash: bytes | None = None) -> None:
        """Mains off at once, on again after `off_s` seconds with the flash image kept (or another one: `flash`).

        Replies not yet read and everything on the agenda are lost; all outputs go to 0, elements stay as they are.
        """
        self.read()
        self._agenda.clear()
        for name, value in list(self.outputs.items()):
            if value:
                self._output(name, 0)
        self.cabinet.output("moving", 0)
        self.time_ns += round(off_s * SECOND_NS)
        if flash is not None:
            self.flash = flash
        self.controller = self.factory(self.flash)
        self.power_on()

    # --- host ------------------------------------------------------------------------------------------------------

    def send(self, data: bytes, *, byte_time_ns: int = 0) -> None:
        """Bytes reach the controller now all at once, or one every `byte_time_ns` from now on."""
        if Desk.built is not None:
            self.sent += data
        for piece in [bytes([value]) for value in data] if byte_time_ns else [data]:
            if byte_time_ns:
                self.advance_to(self.time_ns + byte_time_ns)
            self.controller.receive(self.time_ns, piece)
            self._collect()

    def start(self, text: str) -> None:
        """Send a command as the language frames it; no time passes."""
        if self._language is None:
            raise ValueError("this desk was given no language: use send")
        self.send(self._language.frame(text))

    def query(self, text: str, limit_s: float = 900.0) -> str:
        """Send a command, let time pass until the controller is idle; return the reply text since now."""
        self._unread = len(self.replies)
        self.start(text)
        return self.finish(limit_s)

    def finish(self, limit_s: float = 900.0) -> str:
        """Let time pass until the controller is idle; return all reply text not read before.

        Raises StillBusyError if `limit_s` seconds of virtual time do not suffice.
        """
        deadline = self.time_ns + round(limit_s * SECOND_NS)
        if not self.controller.idle:
            self._advance(deadline, until_idle=True)
        if not self.controller.idle:
            raise StillBusyError(f"still busy after {limit_s} s; replies so far: {self.replies[-5:]}")
        return self.read()

    def read(self) -> str:
        """Reply text not read before; no time passes."""
        data = b"".join(data for _, data in self.replies[self._unread :])
        self._unread = len(self.replies)
        return data.decode("latin-1") if self._language is None else self._language.text(data)

    # --- operator --------------------------------------------------------------------------------------------------

    def set(self, name: str, state: str | bool) -> None:
        """Set something by hand, now.

        An element of the cabinet (hood, estop, key, start, stop, user_0 ...) to one of its states; a contact
        ("limit_x1", "estop_2") to "open", "closed" or "free" (as wired); a terminal ("p0.2", by its level True or
        False, or "free").
        """
        elements = self.cabinet.elements
        if name in elements:
            if isinstance(state, bool):
                state = elements[name][int(state)]
            self.cabinet.operate(name, state)
        elif name in self.terminals or name in self._fed_by_drives:
            if isinstance(state, bool):
                self._forced_terminals[name] = state
            else:
                self._forced_terminals.pop(name, None)
        elif any(name in contacts for contacts in self.terminals.values()):
            if state == "free":
                self._forced_contacts.pop(name, None)
            else:
                self._forced_contacts[name] = state == "closed"
        else:
            raise KeyError(f"the desk has no element, terminal or contact {name!r}")
        self._wires_changed()

    def press(self, name: str, seconds: float = 0.05) -> None:
        """Push a button ("start", "stop", "estop") for `seconds`, then let it go."""
        self.set(name, True)
        self.run(seconds)
        self.set(name, False)

    def at(self, seconds: float, action: Callable[[], object]) -> None:
        """Call an action that takes no time (set, send) `seconds` from now, whichever call lets the time pass."""
        heapq.heappush(self._agenda, (self.time_ns + round(seconds * SECOND_NS), next(self._entry_numbers), action))

    # --- observation -----------------------------------------------------------------------------------------------

    @property
    def counts(self) -> tuple[int, ...]:
        """The controller's counters, one an axis."""
        return tuple(int(n) for n in self.controller.counts)

    @property
    def steps(self) -> Ticks:
        """Every tick made since the first power-on."""
        if len(self._chunks) > 1:
            t_ns, delta = zip(*self._chunks, strict=True)
            self._chunks = [(np.concatenate(t_ns), np.concatenate(delta))]
        if not self._chunks:
            return Ticks(np.zeros(0, np.int64), np.zeros((0, len(self.counts)), np.int8))
        return Ticks(*self._chunks[0])

    @property
    def ticks(self) -> int:
        """Number of ticks made since the first power-on: a mark for `steps_since`."""
        return sum(len(t_ns) for t_ns, _ in self._chunks)

    def steps_since(self, mark: int) -> Ticks:
        """The ticks after the first `mark` ones."""
        stream = self.steps
        return Ticks(stream.t_ns[mark:], stream.delta[mark:])

    def struck(self, contact: str) -> bool:
        """True if this position switch is struck by its carriage."""
        return self._struck[contact]

    # --- time ------------------------------------------------------------------------------------------------------

    def run(self, seconds: float) -> None:
        """Let `seconds` of virtual time pass."""
        self.advance_to(self.time_ns + round(seconds * SECOND_NS))

    def advance_to(self, until_ns: int) -> None:
        """Let time pass to `until_ns`: never beyond `next_ns`, switch edges at the exact tick."""
        self._advance(until_ns, until_idle=False)

    def _advance(self, until_ns: int, until_idle: bool) -> None:
        spins = 0
        while True:
            due = self._next_event(until_ns)
            spins = spins + 1 if due == self.time_ns else 0
            if spins > _SPIN_LIMIT:
                raise ProtocolError(f"next_ns stays at {due}: the controller never lets time pass")
            reached = self.time_ns = self._make_steps(due)
            if self._strike():
                self._wires_changed()
            self.controller.advance(reached)
            self._collect()
            while self._agenda and self._agenda[0][0] <= reached:
                heapq.heappop(self._agenda)[2]()
            next_ns = self.controller.next_ns
            if next_ns is not None and next_ns <= reached:
                continue
            if reached >= until_ns or (until_idle and self.controller.idle):
                return

    def _next_event(self, until_ns: int) -> int:
        next_ns = self.controller.next_ns
        if next_ns is not None and next_ns < self.time_ns:
            raise ProtocolError(f"next_ns {next_ns} lies before the present {self.time_ns}")
        agenda_ns = self._agenda[0][0] if self._agenda else until_ns
        return max(self.time_ns, min(until_ns, agenda_ns, until_ns if next_ns is None else next_ns))

    def _make_steps(self, until_ns: int) -> int:
        """Make the pulses in (time_ns, until_ns], up to the first that changes a switch; return the time reached."""
        run = self.controller.run
        if run is None or until_ns <= self.time_ns:
            return until_ns
        first, last = run.count(self.time_ns), run.count(until_ns)
        size = 1 << 10  # small at first: a reference run meets its switch long before the end of its path
        while first < last:
            stop = min(last, first + size)
            edge_ns = self._make_chunk(run, first, stop)
            if edge_ns is not None:
                return edge_ns
            first, size = stop, min(2 * size, _CHUNK)
        return until_ns

    def _make_chunk(self, run: Motion, first: int, stop: int) -> int | None:
        t_ns, delta = run.window(first, stop)
        sense = self.controller.direction
        motor = delta if min(sense) > 0 else delta * np.array(sense, dtype=np.int8)
        positions = self.carriage + np.cumsum(motor, axis=0, dtype=np.int64)
        n, changes = len(t_ns), False
        lows, highs = positions.min(axis=0).tolist(), positions.max(axis=0).tolist()
        for switch in self.position_switches:
            low, high = lows[switch.axis] - switch.trip, highs[switch.axis] - switch.trip
            least, most = (low, high) if switch.side > 0 else (-high, -low)
            struck = self._struck[switch.contact]
            if least >= -switch.hysteresis if struck else most < 0:
                continue
            beyond = switch.side * (positions[:, switch.axis] - switch.trip)
            changed = beyond < -switch.hysteresis if struck else beyond >= 0
            if changed[:n].any():
                n, changes = int(np.argmax(changed)) + 1, True
        self._chunks.append((t_ns[:n], delta[:n]))
        if not (self.outputs.get("stages") and self.cabinet.relay):
            self.steps_without_stages += n
        before, self.carriage = self.carriage, positions[n - 1].copy()
        moved = zip(self._expected, sense, (self.carriage - before).tolist(), strict=True)
        self._expected = [have + turned * way for have, turned, way in moved]
        return int(t_ns[n - 1]) if changes else None

    def _now_struck(self, places: list[int]) -> dict[str, bool]:
        """Which switches are struck at these positions, by their contacts."""
        struck = self._struck
        return {
            switch.contact: switch.side * (places[switch.axis] - switch.trip)
            >= (-switch.hysteresis if struck[switch.contact] else 0)
            for switch in self.position_switches
        }

    def _strike(self) -> bool:
        """Switch the position switches; True if one has changed."""
        places = self.carriage.tolist()
        if places == self._looked_at:
            return False
        self._looked_at = places
        before, self._struck = self._struck, self._now_struck(places)
        return before != self._struck

    # --- wires -----------------------------------------------------------------------------------------------------

    def _check_terminals(self) -> None:
        """Raise ProtocolError for a contact that no machine has: it would silently never be wired."""
        for terminal, names in self.terminals.items():
            for name in names:
                if name not in self.cabinet.signals and not _LIMIT_SWITCH.fullmatch(name) and name not in self._struck:
                    raise ProtocolError(f"terminal {terminal!r} is wired to {name!r}, a contact that no machine has")

    def _levels(self) -> dict[str, bool]:
        contacts = dict(self.cabinet.contacts())
        contacts.update({contact: not struck for contact, struck in self._struck.items()})
        contacts.update(self._forced_contacts)
        levels = {fed: all(contacts.get(name, True) for name in names) for fed, names in self.terminals.items()}
        return {**levels, **dict.fromkeys(self._fed_by_drives, False), **self._forced_terminals}

    def _wires_changed(self) -> None:
        """Pass every changed level to the controller; its reaction may change further levels."""
        contacts = {**self.cabinet.contacts(), **self._forced_contacts}
        self.cabinet.sense(contacts.__getitem__)
        for _ in range(_SPIN_LIMIT):
            changed = [(name, level) for name, level in self._levels().items() if level != self.levels[name]]
            if not changed:
                self._settled = self.cabinet.contacts()
                return
            terminal, level = changed[0]
            self.levels[terminal] = level
            self.inputs_log.append((self.time_ns, terminal, level))
            self.controller.set_input(self.time_ns, terminal, level)
            self._take()
        raise ProtocolError("the controller and its inputs never settle")

    def _collect(self) -> None:
        self._take()
        if self.cabinet.contacts() is not self._settled:
            self._wires_changed()
        if tuple(self._expected) != self.counts:
            raise ProtocolError(f"counters {self.counts} differ from the stream's sum {tuple(self._expected)}")

    def _take(self) -> None:
        for event in self.controller.take():
            match event:
                case Reply(data):
                    self.replies.append((self.time_ns, data))
                case Output(name, value):
                    self._output(name, value)
                case CounterSet(axis, value):
                    self._expected[axis] = value
                case FlashWrite(image):
                    self.flash = image
                    self.flash_log.append((self.time_ns, image))
                case Remark(text):
                    self.remarks.append((self.time_ns, text))
        self.cabinet.output("moving", int(self.controller.run is not None))

    def _output(self, name: str, value: int) -> None:
        self.outputs[name] = value
        self.output_log.append((self.time_ns, name, value))
        self.cabinet.output(name, value)
