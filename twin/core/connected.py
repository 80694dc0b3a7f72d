"""What passes between the controller and the rest of a twin: bytes, levels and keys to it; motion, outputs, replies,
flash images and remarks from it. The clock (twin.py) says when.
"""

from __future__ import annotations

import logging
from collections import deque
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.controller import (
    BYTES_AT_ONCE,
    Arrival,
    AwaitsArrival,
    Controller,
    CounterSet,
    FlashWrite,
    HoldsHost,
    KeepsBytes,
    Output,
    ReferenceSearch,
    Remark,
    Reply,
    SerialFormat,
    Step,
    offers,
)
from isel_twin.core.assembly import Plans
from isel_twin.core.observers import Observers
from isel_twin.core.position import Position
from isel_twin.core.told import Told
from isel_twin.core.unpowered import Unpowered
from isel_twin.motion import Stream
from isel_twin.plant import FindsArrival
from isel_twin.wiring import SerialLine, Wiring

log = logging.getLogger("isel_twin")


class Connected:
    """The part of a `Twin` that connects its controller."""

    time_ns: int
    flash: bytes | None
    on_flash: Callable[[bytes], None] | None
    remarks: deque[tuple[int, str]]
    steps_made: deque[Step]
    restarts: int
    stores_lost: int
    _plans: Plans
    _controller: Controller
    _handshake: HoldsHost | None
    _awaits: AwaitsArrival | None
    _told: Told
    _levels: Mapping[str, bool]
    _line: SerialLine
    _wiring: Wiring
    _position: Position
    _stream: Stream
    _finds: FindsArrival | None
    _sense: NDArray[np.int8] | None
    _observers: Observers[Any]
    _restarts: int

    @property
    def serial_format(self) -> SerialFormat:
        raise NotImplementedError

    def _note(self, kind: str, what: Any) -> None:
        raise NotImplementedError

    def _adopt(self, controller: Controller) -> None:
        self._controller = controller
        self._handshake = controller if offers(controller, HoldsHost) else None
        self._line.keeps = controller if offers(controller, KeepsBytes) else None
        self._awaits = controller if offers(controller, AwaitsArrival) else None
        if self._handshake is None:
            self._line.clear_to_send(self.time_ns, True)

    def _restart(self) -> bool:
        """Restart the controller with its flash, or without supply, as the wiring has asked; return whether it did. A
        controller that the caller gave is not restarted.
        """
        self._restarts = self._wiring.restarts
        if self._plans.new_controller is None:
            self._remark("no reset and no brown-out of a controller that was handed in: there is no other")
            return False
        self.restarts += not isinstance(self._controller, Unpowered)
        self._wiring.outputs_lost()
        mains = self._wiring.mains
        controller = self._plans.new_controller(self.flash) if mains else Unpowered(self._controller)
        self._adopt(controller)
        self._told = Told(controller, self.flash, rebuilt=mains)
        self._told.use_drives(self._position)
        self._position.start_anew(controller)
        self._levels = self._wiring.levels
        self._told.power_on(self.time_ns, self._levels)
        for axis, value in enumerate(controller.counts):
            self._note("counter", CounterSet(axis, int(value)))
        self._take_events()
        return True

    def _hand_over_kept(self) -> None:
        """Hand over the bytes that have arrived before the present, and that the controller only keeps."""
        at_ns, data = self._line.overtaken(self.time_ns)
        if data:
            self._wiring.heard(data, sent=True)
            self._told.receive(at_ns, data)
            self._take_events()

    def _hand_over_bytes(self) -> bool:
        data = self._line.at_controller(self.time_ns, None if self._handshake is None else BYTES_AT_ONCE)
        if data:
            if isinstance(self._controller, Unpowered):
                self._line.miss(len(data))
            self._wiring.heard(data, sent=True)
            self._told.receive(self.time_ns, data)
            self._take_events()
        return bool(data)

    def _hand_over_levels(self) -> bool:
        levels = self._wiring.levels
        if levels is self._levels:
            return False
        before, self._levels = self._levels, levels
        for terminal, level in levels.items():
            if before[terminal] != level:
                self._told.set_input(self.time_ns, terminal, level)
                self._take_events()
        self._observers.look(self, True, self._wiring.changes)
        return True

    def _hand_over_keys(self) -> None:
        for name, value in self._wiring.take_pressed():
            if self._told.press(self.time_ns, name, value):
                self._take_events()

    def _awaited(self, controller: AwaitsArrival) -> Arrival | None:
        """What the controller waits for, if the plant finds it."""
        arrival = None if self._finds is None or self._stream.ahead else controller.arrival
        found = arrival is not None and self._finds is not None and self._finds.finds_arrival(arrival.period_ns)
        return arrival if found else None

    def _show_inputs(self) -> None:
        """Let the observers look at what has changed, or because it is time."""
        changes = self._wiring.changes
        self._observers.look(self, self._observers.shown_changed(self, changes), changes)

    def _take_events(self) -> None:
        """Take the controller's events after a call, and its motion."""
        events = self._controller.take()
        if self._handshake is not None:
            self._line.clear_to_send(self.time_ns, self._handshake.clear_to_send)
        run = self._controller.run
        moved = self._stream.follow(run, self.time_ns)
        if moved:
            self._note("motion", run)
            if run is not None:  # the direction changes only between motions
                direction = self._position.follow_direction()
                self._sense = None if min(direction) > 0 else np.array(direction, dtype=np.int8)
            self._wiring.motion(run is not None)
        outputs_changed = False
        for event in events:
            if isinstance(event, Output):
                self._wiring.output(event.name, event.value)
                outputs_changed = True
            elif isinstance(event, Reply):
                self._wiring.heard(event.data, sent=False)
                self._line.from_controller(self.time_ns, event.data, self.serial_format.byte_ns)
            elif isinstance(event, CounterSet):
                self._position.counter_set(event.axis, event.value)
                self._note("counter", event)
            elif isinstance(event, ReferenceSearch):
                self._wiring.search(event.axis, event.found)
            elif isinstance(event, FlashWrite):
                self._store(event.image)
            elif isinstance(event, Remark):
                self._remark(event.text)
            elif isinstance(event, Step):
                self.steps_made.append(event)
        if moved or outputs_changed:
            self._wiring.follow_controller()
        if outputs_changed and self._observers.any:
            self._observers.look(self, True, self._wiring.changes)

    def _store(self, image: bytes) -> None:
        """What cannot be stored is lost, as in a flash that is worn out; no controller knows a reply for that."""
        try:
            if self.on_flash is not None:
                self.on_flash(image)
        except OSError as error:
            self.stores_lost += 1
            self._remark(f"the flash has not kept what was stored: {error.strerror or error}")
            return
        self.flash = image
        self._note("flash", image)

    def _remark(self, text: str) -> None:
        self.remarks.append((self.time_ns, text))
        self._note("remark", text)
        log.warning("at %.3f s: %s", self.time_ns / SECOND_NS, text)
