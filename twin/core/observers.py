"""Observers of a twin: called on a grid of virtual time, and whenever an input or output changes."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Generic, Protocol, TypeVar


class _Seen(Protocol):
    @property
    def time_ns(self) -> int: ...
    @property
    def inputs(self) -> Mapping[str, str]: ...
    @property
    def outputs(self) -> Mapping[str, int]: ...


Seen = TypeVar("Seen", bound=_Seen)


class Observers(Generic[Seen]):
    """All observers, in the order of `add`."""

    def __init__(self) -> None:
        self._all: list[_Observer[Seen]] = []
        self.any = False  # there are some
        self._changes = 0  # `Wiring.changes` at the last look
        self._shown: tuple[Mapping[str, str], Mapping[str, int]] = {}, {}  # inputs and outputs at that time

    def add(self, callback: Callable[[Seen], None], interval_ns: int | None, twin: Seen, changes: int) -> None:
        """Add an observer and call it at once. changes: `Wiring.changes`."""
        self._all.append(_Observer(callback, interval_ns, twin.time_ns))
        self.any = True
        self._changes, self._shown = changes, (twin.inputs, twin.outputs)

    @property
    def next_ns(self) -> int | None:
        """When the next call on a grid is due."""
        return min((one.next_ns for one in self._all if one.next_ns is not None), default=None)

    def look(self, twin: Seen, changed: bool, changes: int) -> None:
        """Call the observers that are due; all of them if something has changed."""
        if not self._all:
            return
        if changed:
            self.shown_changed(twin, changes)
        for one in self._all:
            one.look(twin, changed)

    def shown_changed(self, twin: Seen, changes: int) -> bool:
        """True if an input, or an output that changes by itself, has changed since the last look."""
        if not self._all or self._changes == changes:
            return False
        self._changes = changes
        before, self._shown = self._shown, (twin.inputs, twin.outputs)
        return before != self._shown

    def restored(self, twin: Seen, changes: int) -> None:
        """Call all observers after the twin was restored to another time; their grids stay."""
        for one in self._all:
            one.go_on(twin.time_ns)
        self._changes, self._shown = changes, (twin.inputs, twin.outputs) if self._all else ({}, {})
        for one in self._all:
            one.look(twin, changed=True)


class _Observer(Generic[Seen]):
    def __init__(self, callback: Callable[[Seen], None], interval_ns: int | None, start_ns: int) -> None:
        self._callback = callback
        self._interval_ns = interval_ns
        self.next_ns: int | None = start_ns

    def look(self, twin: Seen, changed: bool) -> None:
        due = self.next_ns is not None and twin.time_ns >= self.next_ns
        if self._interval_ns is None:
            self.next_ns = None
        elif self.next_ns is not None:
            while self.next_ns <= twin.time_ns:
                self.next_ns += self._interval_ns
        if due or changed:
            self._callback(twin)

    def go_on(self, time_ns: int) -> None:
        if self.next_ns is not None and self._interval_ns is not None:
            self.next_ns = time_ns + 1 + (self.next_ns - time_ns - 1) % self._interval_ns
