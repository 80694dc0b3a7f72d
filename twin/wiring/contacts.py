"""From contacts to terminal levels: switch types, series circuits, bounce and broken wires.

Contacts are in series at a terminal, which is high while all of them are closed (one marked `inverted` in the machine
file: open). An end switch is an opener: closed unless struck.

Bounce: a struck or released position switch changes at once and then chatters for at most `bounce_ms`:

    struck    ____|~|_|~~~~~~~~~~~          t0: first change, when the controller is told
                  t0      t0 + bounce       an even number of further changes, seeded

Faults of one contact: `broken` (a wire is off: open), `stuck_open`, `stuck_closed`, `bounce` (worn: it chatters for
WORN_MS at each change), `ok` (healed). Two contacts may be swapped: each leads to the other's terminal.
"""

from __future__ import annotations

import heapq
from collections.abc import Mapping, Sequence

import numpy as np

from isel_twin.machine import Contact

# faults, and the state in which each holds the contact; None: as operated
FAULTS: Mapping[str, bool | None] = {
    "ok": None,
    "broken": False,
    "stuck_open": False,
    "stuck_closed": True,
    "bounce": None,
}

WORN_MS = 20.0  # time for which a worn contact chatters; good switches take 1 to 5 ms
_MAX_BOUNCES = 3
_WORN_BOUNCES = 12


class Contacts:
    """States of all contacts of a machine, and the levels at the controller's terminals."""

    def __init__(
        self,
        contacts: Sequence[Contact],
        terminals: Mapping[str, tuple[str, ...]],
        signals: Sequence[str],
        random: np.random.Generator,
    ) -> None:
        """Wire `contacts` in series to the `terminals` of a controller, without those that the machine lacks
        (wiring/7).
        `signals` of the cabinet that the machine file does not list lead to no terminal."""
        self._contacts = {contact.name: contact for contact in contacts}
        wired = {terminal: tuple(n for n in names if n in self._contacts) for terminal, names in terminals.items()}
        self._terminals = {terminal: names for terminal, names in wired.items() if names}
        self._leads_to = {name: [t for t, names in self._terminals.items() if name in names] for name in self._contacts}
        self._closed = dict.fromkeys(signals, True) | {contact.name: contact.type == "opener" for contact in contacts}
        self._faults: dict[str, str] = {}
        self._random = random
        self._pending: list[tuple[int, int, str, bool]] = []
        self._sequence = 0
        self._levels: dict[str, bool] = {}
        self._stale = True  # wires have changed, so that any level may have
        self._moved: list[str] = []  # contacts that have changed since levels were last asked for
        self._swapped: dict[str, str] = {}  # the partner of each swapped contact, both ways
        self._worn: list[str] = []  # worn contacts that changed at this instant, whose chatter is not yet drawn

    @property
    def names(self) -> tuple[str, ...]:
        return tuple(self._contacts)

    @property
    def next_ns(self) -> int | None:
        """Time of the next bounce, None for none; `advance` begins those of contacts that have just changed."""
        return self._pending[0][0] if self._pending else None

    def closed(self, name: str) -> bool:
        """True if the contact is closed, its fault included."""
        held = FAULTS[self.fault(name)]
        return self._closed[name] if held is None else held

    @property
    def faults(self) -> Mapping[str, str]:
        """Faults by contact, in the order of `names`."""
        return {name: self._faults[name] for name in self.names if name in self._faults}

    def fault(self, name: str) -> str:
        return self._faults.get(name, "ok")

    def heeded(self, name: str) -> bool:
        """True if a contact does as it is operated, worn or not."""
        return FAULTS[self.fault(name)] is None

    def levels(self) -> dict[str, bool]:
        """Level (True: high) of every wired terminal."""
        if self._stale:
            self._levels = {terminal: self._level(terminal) for terminal in self._terminals}
            self._stale = False
            self._moved.clear()
        elif self._moved:
            moved = [self._swapped.get(name, name) for name in self._moved]
            terminals = [terminal for name in moved for terminal in self._leads_to.get(name, ())]
            self._levels = self._levels | {terminal: self._level(terminal) for terminal in terminals}
            self._moved.clear()
        return self._levels

    def set_fault(self, name: str, fault: str) -> None:
        self._stale = True
        if fault == "ok":
            self._faults.pop(name, None)
        else:
            self._faults[name] = fault

    @property
    def swapped(self) -> Mapping[str, str]:
        """Contacts with exchanged wires, each pair once."""
        names = list(self._contacts)
        return {name: other for name, other in self._swapped.items() if names.index(name) < names.index(other)}

    def swap(self, name: str, other: str) -> None:
        """Exchange the wires of two contacts; "": restore those of `name`. Contacts that are already swapped are
        restored first."""
        self._stale = True
        for one in (name, other):
            partner = self._swapped.pop(one, None)
            if partner is not None:
                self._swapped.pop(partner, None)
        if other:
            self._swapped |= {name: other, other: name}

    def set_closed(self, name: str, closed: bool) -> None:
        """Change a contact, without bounce unless it is worn."""
        if self._closed[name] != closed:
            if self._faults.get(name) == "bounce":
                self._worn.append(name)
            self._closed[name] = closed
            self._moved.append(name)

    def strike(self, name: str, struck: bool, t_ns: int) -> None:
        """Strike or release a position switch at t_ns: it changes now and then chatters."""
        contact = self._contacts[name]
        closed = struck != (contact.type == "opener")
        self._forget(name)
        self.set_closed(name, closed)
        bounce_ns = int(contact.bounce_ms * 1e6)
        if bounce_ns > 0 and name not in self._worn:
            self._chatter(name, t_ns, bounce_ns, 2 * int(self._random.integers(0, _MAX_BOUNCES + 1)))

    def advance(self, t_ns: int) -> bool:
        """Apply the bounces due at t_ns; return whether there were any."""
        due = False
        if not self._worn and not self._pending:
            return False
        for name in dict.fromkeys(self._worn):
            self._forget(name)
            changes = 2 * int(self._random.integers(_MAX_BOUNCES, _WORN_BOUNCES + 1))
            self._chatter(name, t_ns, int(WORN_MS * 1e6), changes)
        self._worn.clear()
        while self._pending and self._pending[0][0] <= t_ns:
            _, _, name, closed = heapq.heappop(self._pending)
            if self._closed[name] != closed:
                self._closed[name] = closed
                self._moved.append(name)
            due = True
        return due

    def _chatter(self, name: str, t_ns: int, within_ns: int, changes: int) -> None:
        """Let a contact change an even number of times, so that it ends as it is."""
        closed = self._closed[name]
        for i, delay in enumerate(sorted(self._random.integers(1, within_ns + 1, changes).tolist())):
            state = closed if i % 2 else not closed
            heapq.heappush(self._pending, (t_ns + delay, self._sequence, name, state))
            self._sequence += 1

    def _forget(self, name: str) -> None:
        """Drop the bounces of a contact that are still to come."""
        self._pending = [entry for entry in self._pending if entry[2] != name]
        heapq.heapify(self._pending)

    def _level(self, terminal: str) -> bool:
        return all([self._high(name) for name in self._terminals[terminal]])

    def _high(self, name: str) -> bool:
        name = self._swapped.get(name, name)
        return self.closed(name) != self._contacts[name].inverted
