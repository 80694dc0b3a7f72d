"""`Twin.save` and `Twin.restore`; states are in state.py."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import cached_property
from typing import Any, NoReturn

from isel_twin.controller import Controller
from isel_twin.core.assembly import Plans
from isel_twin.core.observers import Observers
from isel_twin.core.position import Position
from isel_twin.core.sampling import Sampler
from isel_twin.core.spec import TwinSpec
from isel_twin.core.state import BY_CHANCE, Kind, StateError, TwinState, pack, unpack
from isel_twin.core.told import Told
from isel_twin.machine import Machine
from isel_twin.motion import Stream
from isel_twin.plant import Plant
from isel_twin.wiring import SerialLine, Wiring

# further attributes of a twin in a state
_OWN = (
    *("remarks", "acts", "collisions", "_restarts", "restarts", "unpowered_steps", "stores_lost"),
    *("_sense", "_untold", "_levels", "margin_since_ns"),
)


class Saved:
    """The part of a `Twin` that is saved and restored."""

    origin: TwinSpec
    controller_name: str
    machine: Machine
    time_ns: int
    flash: bytes | None
    on_flash: Callable[[bytes], None] | None
    stores_lost: int
    _plans: Plans
    _controller: Controller
    _told: Told
    _plant: Plant
    _position: Position
    _line: SerialLine
    _wiring: Wiring
    _stream: Stream
    _sampler: Sampler | None
    _least: Any
    _observers: Observers[Any]
    _settling: bool
    _due_ns: int
    _advanced_ns: int

    def _note(self, kind: str, what: Any) -> None:
        raise NotImplementedError

    def _tell(self) -> None:
        raise NotImplementedError

    def _adopt(self, controller: Controller) -> None:
        raise NotImplementedError

    def _next_due_ns(self, controller_ns: int | None) -> int:
        raise NotImplementedError

    def save(self) -> TwinState:
        """The whole state, in mid-motion too.

        Raises StateError (ValueError) with one line for a controller that cannot be saved now (told.py), and when
        called by an observer or a listener.
        """
        self._check_between()
        self._tell()
        if self._sampler is not None:
            self._sampler.hand_on()
        own = {name: getattr(self, name) for name in _OWN}
        return TwinState(
            kind=self._kind,
            origin={name: getattr(self.origin, name) for name in BY_CHANCE},
            time_ns=self.time_ns,
            flash=self.flash,
            life=self._told.save(),
            parts=pack(own, self._parts, self._known),
            plant=self._plant.save(),
        )

    def restore(self, state: TwinState) -> None:
        """Take over a saved state: the same calls then give the same bits as there. Its seed may differ.

        Observers are called at once and keep their grids. Listeners get `restored` before; one that cannot go back (a
        recording) raises ValueError, and nothing happens. Raises StateError (ValueError) with one line for a state of
        another machine, controller, plant or scenario.
        """
        self._check_between()
        self._kind.check(state)
        self._note("restored", state.time_ns)
        if self._sampler is not None:
            self._sampler.hand_on()
        self._told.restore(state.life, self._plans.new_controller, self._position)
        self._adopt(self._told.controller)
        for name, value in unpack(state.parts, self._parts, self._known).items():
            setattr(self, name, value)
        self._plant.restore(state.plant)
        self.time_ns = self._advanced_ns = state.time_ns
        self.origin = replace(self.origin, **state.origin)
        if self._sampler is not None:
            self._sampler.begin_anew()
        if self._least is not None:
            self._least.begin_anew()
        flash, self.flash = self.flash, state.flash
        if self.flash is not None and self.flash != flash and self.on_flash is not None:
            try:
                self.on_flash(self.flash)
            except OSError:  # already reported by the caller that stores it
                self.stores_lost += 1
        self._settling = True
        try:
            self._observers.restored(self, self._wiring.changes)
        finally:
            self._settling = False
        self._due_ns = self._next_due_ns(self._controller.next_ns)

    def _check_between(self) -> None:
        if self._settling:
            raise StateError("a twin is saved and restored between two calls, not by an observer or listener of one")

    @cached_property
    def _kind(self) -> Kind:
        return Kind.of(
            self.controller_name, self.machine, self.origin.plant, len(self._controller.counts), self._plans.events
        )

    @property
    def _parts(self) -> dict[str, object]:
        return {"position": self._position, "line": self._line, "wiring": self._wiring, "stream": self._stream}

    @property
    def _known(self) -> dict[str, object]:
        """By name, what all twins of the same kind have."""
        machine = self.machine
        return {
            **self._parts,
            "controller": self._controller,
            "run": self._controller.run,
            "plant": self._plant,
            "machine": machine,
            "contacts": machine.contacts,
            "spindle": machine.spindle,
            "switches": machine.switches,
            "heated": tuple(axis.stage for axis in machine.axes),
            "events": self._plans.events,
        }

    def __reduce_ex__(self, protocol: object) -> NoReturn:
        """Refuse copy and pickle: a copy would share the plant's memory."""
        raise TypeError("a twin cannot be copied or pickled; take `save`, and `restore` into another one built alike")
