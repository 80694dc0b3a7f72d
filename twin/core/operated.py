"""Operating and observing a twin. Listeners get every operation before it happens, so that it can be repeated."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Self

import numpy as np

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Place
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import Controller, Key, KeyValue
from isel_twin.core.journal import SETTINGS, Note, Received, cut_content, in_words, push_content
from isel_twin.core.margins import MarginReader, MarginReaders
from isel_twin.core.observers import Observers
from isel_twin.core.position import Position
from isel_twin.core.sampling import Sampler, TwinSamples
from isel_twin.motion import Stream
from isel_twin.plant import PLACES, Clearance, Cut, Plant, Sampled
from isel_twin.wiring import ScenarioError, ScenarioEvent, SerialLine, Wiring, check_input, event_now

CLEARANCE_NS = 5 * MILLISECOND_NS  # between two looks at how near bodies come


class Operated:
    """The part of a `Twin` for operation and observation."""

    time_ns: int
    keys: Mapping[str, Key]
    on_flash: Callable[[bytes], None] | None
    _controller: Controller
    _plant: Plant
    _position: Position
    _line: SerialLine
    _wiring: Wiring
    _stream: Stream
    _observers: Observers[Any]
    _notes: list[Note]
    _sampler: Sampler | None
    _sampled: Sampled | None
    acts: deque[tuple[int, str]]
    _margin_readers: MarginReaders
    margin_since_ns: int
    _least: Any  # keeps the least distance; None: not asked for
    _due_ns: int

    def _settle(self) -> None:
        raise NotImplementedError

    def _tell(self) -> None:
        raise NotImplementedError

    def _next_due_ns(self, controller_ns: int | None) -> int:
        raise NotImplementedError

    def margin_reader(self) -> MarginReader:
        """A reader of the least margins since its own last look, independent of other readers."""
        return self._margin_readers.reader(self._plant)

    def watch_margin(self) -> None:
        """Reset the least margins, as before each line of a job."""
        self._note("operated", {"watch_margin": True})
        self._plant.watch_margin()
        self.margin_since_ns = self.time_ns

    def forget_motions(self) -> None:
        """Keep of `steps` the last motion only; `steps.made` counts on. A state saved then is small."""
        self._stream.forget()

    @property
    def line_speed(self) -> bool:
        """True if bytes take their time on the line. May be changed; bytes under way keep their times."""
        return self._line.timed

    @line_speed.setter
    def line_speed(self, timed: bool) -> None:
        if timed != self._line.timed:
            self._note("operated", {"line_speed": timed})
        self._line.timed = timed

    def set_input(self, name: str, state: str) -> str:
        """Operate an element or give a contact a fault now; return its new state.

        Elements are listed in `isel_twin.wiring.cabinet.ELEMENTS`, faults in `isel_twin.wiring.FAULTS`. A locked
        element does not change. Raises ValueError, which lists the known ones, for an unknown name or state.
        """
        check_input(name, state, self._wiring.settable, "set_input", ScenarioError)
        self._note("operated", {"set": {name: state}})
        self._wiring.operate(name, state)
        self._settle()
        return self._wiring.inputs.get(name, state)

    def carry_out(self, event: ScenarioEvent) -> None:
        """Let an event of a scenario happen now (`isel_twin.wiring.event_now` checks it)."""
        self._note("operated", event.content)
        self._wiring.carry_out(event, self.time_ns)
        self._settle()

    def press(self, name: str, value: KeyValue = True) -> None:
        """Press a key of the controller's panel, or set it to a value. Raises ValueError, which lists the known ones,
        for an unknown key or value (`keys`)."""
        place = Place("press", ScenarioError)
        self.carry_out(event_now({"key": {name: value}}, place, self._wiring.settable, self.keys))

    def apply_force(self, axis: int, force_n: float, place: str = "") -> None:
        """Push the machine with force_n newton along an axis (0 X .. 2 Z), until the next call. Raises ValueError.

        place: "tool" or "table"; "": the one that this axis moves. A positive force pushes it so that the position of
        the axis rises. A new push of an axis replaces the old one.
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
        """Begin a cut, or end it (None)."""
        acts = {"cut": "off" if cut is None else cut}
        self.carry_out(ScenarioEvent(self.time_ns, acts, content=cut_content(cut)))

    def observe(self, callback: Callable[[Self], None], interval_ns: int | None) -> None:
        """Call `callback(twin)` now, at every input or output change and, with interval_ns, at this interval."""
        if interval_ns is not None and interval_ns <= 0:
            raise ValueError(f"observation interval must be positive, not {interval_ns} ns")
        self._observers.add(callback, interval_ns, self, self._wiring.changes)
        self._observers.look(self, False, self._wiring.changes)
        self._due_ns = self._next_due_ns(self._controller.next_ns)

    def sample(self, take: Callable[[TwinSamples], None], interval_ns: int, from_ns: int = 0) -> Sampler | None:
        """Let the plant take samples every interval_ns, one at from_ns, and call `take` with batches of them later.

        While nothing moves and no counter is set there is only the first one: all would be equal. The returned sampler
        can hand on waiting samples at once. None if the plant cannot sample (then use `observe`), or uses another grid
        already.
        """
        if self._sampled is None or not self.can_sample(interval_ns, from_ns):
            return None
        self._tell()
        if self._sampler is None:
            self._sampler = Sampler(self._sampled, self._position, interval_ns, take, from_ns)
        else:
            self._sampler.share(take)
        return self._sampler

    def can_sample(self, interval_ns: int, from_ns: int = 0) -> bool:
        """True if `sample` would succeed."""
        one = self._sampler
        same = one is None or (one.interval_ns == interval_ns and (one.from_ns - from_ns) % interval_ns == 0)
        return same and self._sampled is not None and self._sampled.fits(interval_ns)

    def sample_no_more(self, take: Callable[[TwinSamples], None]) -> None:
        """Hand on the last samples to `take`, then stop."""
        if self._sampler is not None and self._sampler.leave(take):
            self._sampler = None

    def watch_clearance(self) -> None:
        """Keep the least distance of bodies that must not meet, from now on (`clearance`). Without physics the whole
        path is looked at, with it a place every CLEARANCE_NS and the straight way between."""
        self._least = self._plant.watch_clearance()
        if self._least is None or not self._plant.physics:
            return
        least = self._least

        def look(twin: Self) -> None:
            least.look(np.array([twin.time_ns]), self._plant.position_mm[None])

        if self.sample(lambda samples: least.look(samples.time_ns, samples.machine_position_mm), CLEARANCE_NS) is None:
            self.observe(look, CLEARANCE_NS)

    @property
    def clearance(self) -> Clearance | None:
        """The least distance of bodies that must not meet, since `watch_clearance`; None if there are none that can."""
        if self._sampler is not None:
            self._sampler.hand_on()
        if self._least is None or self._least.found is None:
            return None
        x, y, z = self._position.of_carriages_mm(np.array(self._least.found.position_mm)).tolist()
        return replace(self._least.found, position_mm=(x, y, z))

    def listen(self, note: Note) -> None:
        """Call `note(time_ns, kind, what)` for all that happens from now on (isel_twin.core.journal)."""
        self._notes.append(note)
        self._line.on_reply = lambda arrival_ns, data, byte_ns: self._note(
            "received", Received(data, arrival_ns, byte_ns)
        )
        self._line.on_lost = lambda arrival_ns, data: self._note("lost", Received(data, arrival_ns, 0))

    def _note(self, kind: str, what: Any) -> None:
        if kind in ("scenario", "operated") and not set(what) <= set(SETTINGS):
            self.acts.append((self.time_ns, in_words(what)))
        for note in self._notes:
            note(self.time_ns, kind, what)

    @property
    def followed(self) -> bool:
        """True if there is an observer, a sampler, a listener or a flash file."""
        return bool(self._observers.any or self._notes or self._sampler or self.on_flash)
