"""What people, scenarios and hosts of a recording do to a twin, and who looks on.

Whatever changes what the twin will do is noted for its listeners before it happens, so that it can be done again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, Self

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Place
from isel_twin.controller import Key, KeyValue
from isel_twin.core.journal import Note, Received, cut_content, push_content
from isel_twin.core.observers import Observers
from isel_twin.core.position import Position
from isel_twin.core.sampling import Sampler, TwinSamples
from isel_twin.plant import PLACES, Cut, Plant, Sampled
from isel_twin.wiring import ScenarioError, ScenarioEvent, SerialLine, Wiring, check_input, event_now


class Operated:
    """The part of a `Twin` that is operated and watched."""

    time_ns: int
    keys: Mapping[str, Key]
    on_flash: Callable[[bytes], None] | None
    _plant: Plant
    _position: Position
    _line: SerialLine
    _wiring: Wiring
    _observers: Observers[Any]
    _notes: list[Note]
    _sampler: Sampler | None
    _sampled: Sampled | None
    _least_margin: NDArray[np.float64]
    _due_ns: int

    def _settle(self) -> None:
        """Hand over everything that is due at this instant, until nothing more is."""
        raise NotImplementedError

    def _tell(self) -> None:
        """Let the controller know of the time that has passed, if it does not yet."""
        raise NotImplementedError

    def _next_due_ns(self) -> int:
        """When the twin has to settle next; far away if nobody knows of anything."""
        raise NotImplementedError

    def take_margin(self) -> NDArray[np.float64]:
        """float64 [axes], as `margin`, but since the last call of this: for one who looks at it again and again, as a
        panel does. Nobody else notices."""
        taken = self._plant.take_margin()
        self._least_margin = np.minimum(self._least_margin, taken)
        return taken

    def watch_margin(self) -> None:
        """Begin anew with the least margins, before a move; whoever plays a job does so for each of its lines."""
        self._note("operated", {"watch_margin": True})
        self._least_margin = np.ones(len(self._plant.margin))
        self._plant.watch_margin()

    @property
    def line_speed(self) -> bool:
        """Whether bytes take their time on the line. May be changed; bytes on their way keep their times."""
        return self._line.timed

    @line_speed.setter
    def line_speed(self, timed: bool) -> None:
        if timed != self._line.timed:
            self._note("operated", {"line_speed": timed})
        self._line.timed = timed

    def set_input(self, name: str, state: str) -> str:
        """Operate an element or give a contact a fault, now; return the state it is in afterwards.

        The names and their states are those of the machine's wiring: what people operate is listed in
        `isel_twin.wiring.cabinet.ELEMENTS`, what can be wrong with a contact in `isel_twin.wiring.FAULTS`. An element
        that is locked stays as it is. Raises ValueError, which lists what there is, for a name or state that does not
        exist.
        """
        check_input(name, state, self._wiring.settable, "set_input", ScenarioError)
        self._note("operated", {"set": {name: state}})
        self._wiring.operate(name, state)
        self._settle()
        return self._wiring.inputs.get(name, state)

    def carry_out(self, event: ScenarioEvent) -> None:
        """Let what a scenario may say happen now, all of it at once (`isel_twin.wiring.event_now` checks it)."""
        self._note("operated", event.content)
        self._wiring.carry_out(event, self.time_ns)
        self._settle()

    def press(self, name: str, value: KeyValue = True) -> None:
        """Press a key of the controller's own panel, or put it to a value, now. Raises ValueError, which lists what
        there is, for a key or value that does not exist (`keys`)."""
        place = Place("press", ScenarioError)
        self.carry_out(event_now({"key": {name: value}}, place, self._wiring.settable, self.keys))

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        """Push the machine with force_n newton along an axis (0 X .. 2 Z), until told otherwise. Raises ValueError.

        place: "tool" or "table"; "": the one that this axis moves. A positive force pushes it the way that the position
        of the axis rises. An axis has one push: a new one replaces it, wherever it was.
        """
        if axis not in range(len(CARRIAGES)):
            raise ValueError(f"axis {axis!r} has no carriage; there are: 0 (X), 1 (Y), 2 (Z)")
        if not math.isfinite(force_n):
            raise ValueError(f"a force of {force_n} N cannot be applied; give a finite number")
        if place and place not in PLACES:
            raise ValueError(f"a force cannot act at {place!r}; there are: {', '.join(PLACES)}")
        acts = {"force_n": {CARRIAGES[axis]: force_n}}
        content = push_content(CARRIAGES[axis], force_n, place)
        self.carry_out(ScenarioEvent(self.time_ns, acts, place, content=content))

    def set_cut(self, cut: Cut | None) -> None:
        """Let the cutter be in the material from now on (`isel_twin.plant.Cut`), or not any more."""
        acts = {"cut": "off" if cut is None else cut}
        self.carry_out(ScenarioEvent(self.time_ns, acts, content=cut_content(cut)))

    def observe(self, callback: Callable[[Self], None], interval_ns: int | None) -> None:
        """Call `callback(twin)` now and at every input or output change; given interval_ns, every so often, too."""
        if interval_ns is not None and interval_ns <= 0:
            raise ValueError(f"observation interval must be positive, not {interval_ns} ns")
        self._observers.add(callback, interval_ns, self, self._wiring.changes)
        self._observers.look(self, False, self._wiring.changes)
        self._due_ns = self._next_due_ns()

    def sample(self, take: Callable[[TwinSamples], None], interval_ns: int, from_ns: int = 0) -> Sampler | None:
        """Have the plant take samples every interval_ns, at from_ns among other times (0: power-on), handed on by
        `take` some time later.

        While nothing moves and no counter is set there are none but the first: the others would be the same. Returns
        what hands them on when asked; None if the plant does not take any, or not so often: then `observe` does.
        Whoever asks second shares those of the first, or gets None if they come at other times.
        """
        if self._sampled is None or not self.can_sample(interval_ns, from_ns):
            return None
        self._tell()  # what counters have to do with the plant is looked at now
        if self._sampler is None:
            self._sampler = Sampler(self._sampled, self._position, interval_ns, take, from_ns)
        else:
            self._sampler.share(take)
        return self._sampler

    def can_sample(self, interval_ns: int, from_ns: int = 0) -> bool:
        """Whether `sample` would do it."""
        one = self._sampler
        same = one is None or (one.interval_ns == interval_ns and (one.from_ns - from_ns) % interval_ns == 0)
        return same and self._sampled is not None and self._sampled.fits(interval_ns)

    def sample_no_more(self, take: Callable[[TwinSamples], None]) -> None:
        """Hand on what waits for `take`, and no more after that. `sample` has taken it on."""
        if self._sampler is not None and self._sampler.leave(take):
            self._sampler = None

    def listen(self, note: Note) -> None:
        """Have `note(time_ns, kind, what)` called with all that happens from now on; see isel_twin.core.journal."""
        self._notes.append(note)
        self._line.on_reply = lambda arrival_ns, data, byte_ns: self._note(
            "received", Received(data, arrival_ns, byte_ns)
        )
        self._line.on_lost = lambda arrival_ns, data: self._note("lost", Received(data, arrival_ns, 0))
        self._wiring.on_event = lambda event: self._note("scenario", event.content)

    def _note(self, kind: str, what: Any) -> None:
        for note in self._notes:
            note(self.time_ns, kind, what)

    @property
    def followed(self) -> bool:
        """Somebody observes, samples, listens or keeps the flash: `restore` would be noticed."""
        return bool(self._observers or self._notes or self._sampler or self.on_flash)
