"""The twin: one virtual clock for controller, serial line, wiring and plant.

At every instant each part has seen exactly what happened before, so that nothing is ever taken back. Every part has a
`next_ns`, the time at which it acts by itself (None: never). The loop is

    settle:   process everything that is due now, until nothing is left
    advance:  let the plant run to the least `next_ns`, or until it passes a threshold, whichever comes first

docs/one_move.md follows one command through all of it. A run that ends with nothing due advances only the plant; the
controller is advanced when it is next called or its counters are read.

What time means: `time_ns` counts virtual nanoseconds since power-on. It advances only inside `run`, `run_until` and
`query`; there is no wall clock here. The same arguments and calls give the same bits.
"""

from __future__ import annotations

import logging
import math
from collections import deque
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from itertools import count
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.controller import (
    BYTES_AT_ONCE,
    Arrival,
    Controller,
    HasKeys,
    Key,
    Step,
    UsesDrives,
    offers,
)
from isel_twin.core.assembly import PLANTS, HasModel, Plans, build_plant, chances, draw_up, power_on_mm
from isel_twin.core.connected import Connected
from isel_twin.core.journal import Note
from isel_twin.core.margins import MarginReaders
from isel_twin.core.observers import Observers
from isel_twin.core.operated import Operated
from isel_twin.core.position import Position
from isel_twin.core.sampling import Sampler
from isel_twin.core.saved import Saved
from isel_twin.core.seen import Seen
from isel_twin.core.spec import TwinSpec
from isel_twin.core.state import StateError
from isel_twin.core.told import Told
from isel_twin.language import Language, needed
from isel_twin.machine import Fixture, Machine
from isel_twin.motion import Stream
from isel_twin.plant import Collision, FindsArrival, GoesStraight, Sampled
from isel_twin.wiring import Schedule, SerialLine, TripPoints, Wiring, thresholds

_NEVER_NS = 1 << 62
# rounds of `_settle` at one instant, one of which has an event of a scenario; else a controller is broken
_ENDLESS = 50_000
_REMARKS = 1000  # remarks of the controller that are kept
_STEPS = 10_000  # steps of a program that are kept

log = logging.getLogger("isel_twin")


class Twin(Operated, Seen, Connected, Saved):
    """A digital twin of a controller and the gantry it drives.

    Axes are in the order X, Y, Z, A ...: as many as the controller has. Counts are steps of the controller; positions
    are in mm in the zero and direction of the counters, as the controller last set them (reference run).
    """

    def __init__(
        self,
        machine: str | Path | Machine = "4030",
        controller: str | Controller = "imc-s8",
        plant: str = "mujoco",
        seed: int = 0,
        *,
        flash: bytes | None = None,
        scenario: str | Path | None = None,
        line_speed: bool | int = False,
        overrides: Mapping[str, Any] | None = None,
        start_mm: Sequence[float] | None = None,
        fixtures: Sequence[Fixture] = (),
        keep_motions: int | None = None,
    ) -> None:
        """Build a twin and switch it on.

        machine: name of a machine, folder of a user's own, or a loaded Machine.
        controller: name of an installed controller (`isel-twin controllers`), or a built one that is not switched on
        yet, which has no language.
        plant: "mujoco" (physics) or "kinematic" (the carriage follows the counter).
        seed: of power-on positions, switch repeatability, bounce and line noise.
        flash: an earlier flash image of the controller (`Twin.flash`), None for a new device.
        scenario: file of events (docs/scenarios.md).
        line_speed: bytes take their time on the serial line (True; a number: at this speed, baud) or arrive at once.
        overrides: machine parameters to change (`isel_twin.machine.with_overrides`).
        start_mm: carriage positions at power-on in machine coordinates instead of random ones.
        fixtures: what is clamped on the table, beside the fixtures of the machine.
        keep_motions: how many of the last motions `steps` keeps; None: all since power-on.

        Raises ValueError (UnknownNameError, MachineError, ScenarioError) with one clear line for anything wrong, and
        OSError for a scenario file that cannot be read.
        """
        spec = TwinSpec(
            machine=machine,
            controller=controller if isinstance(controller, str) else type(controller).__name__.lower(),
            plant=plant,
            seed=seed,
            scenario=None if scenario is None else Path(scenario),
            flash=flash,
            line_speed=line_speed,
            overrides=dict(overrides or {}),
            start_mm=None if start_mm is None else tuple(start_mm),
            fixtures=tuple(fixtures),
        )
        self._begin(spec, keep_motions, None if isinstance(controller, str) else controller)

    @classmethod
    def of(cls, spec: TwinSpec, keep_motions: int | None = None, controller: Controller | None = None) -> Twin:
        """A twin of this spec, whose flash is an image (`TwinSpec.build` takes files). Raises as `Twin` does.
        controller: one already built, in place of the named one."""
        twin = cls.__new__(cls)
        twin._begin(spec, keep_motions, controller)
        return twin

    def another(self, seed: int, start_mm: Sequence[float] | None = None) -> Twin:
        """A new twin that differs in seed and start_mm. No file is read again, so it takes a tenth of the time. Raises
        StateError if the caller gave the controller."""
        if self._plans.new_controller is None:
            raise StateError("there is no other controller like the one that was handed in: build one for another twin")
        origin = self.origin.with_(seed=seed, start_mm=None if start_mm is None else tuple(start_mm))
        model = self._plant.model_as_built() if isinstance(self._plant, HasModel) else None
        twin = Twin.__new__(Twin)
        twin._switch_on(origin, self._plans, self._plans.new_controller(origin.image), self._stream.keep, model)
        return twin

    def _begin(self, spec: TwinSpec, keep_motions: int | None, controller: Controller | None) -> None:
        if spec.plant not in PLANTS:
            raise ValueError(f"unknown plant {spec.plant!r}; there are: {', '.join(PLANTS)}")
        origin = spec.with_(machine=spec.as_built)
        plans, first = draw_up(origin, controller)
        self._switch_on(origin, plans, first, keep_motions)
        if not self.physics and (idle := sum(event.physical for event in plans.events)):
            what = f"{spec.scenario or 'events'}: {idle} of {len(plans.events)} events"
            log.warning("%s have no effect without physics; use the plant mujoco", what)

    def _switch_on(
        self, origin: TwinSpec, plans: Plans, controller: Controller, keep_motions: int | None, model: Any = None
    ) -> None:
        self._plans = plans
        self.controller_name = origin.controller
        self.language: Language | None = None if plans.new_language is None else plans.new_language()
        """None for a controller that was handed in. Decoders need one of their own."""
        self.machine = plans.machine
        start, trips_random, bounces, noise = chances(origin.seed)
        self.origin = origin  # what it was built from
        self.time_ns = 0
        self.keys: Mapping[str, Key] = dict(controller.keys) if offers(controller, HasKeys) else {}
        """Keys of the controller's panel, by name: see `press`."""
        self.flash = origin.image
        self.on_flash: Callable[[bytes], None] | None = None
        """Called with each new flash image; raises OSError if it cannot keep it."""
        self.remarks: deque[tuple[int, str]] = deque(maxlen=_REMARKS)
        """Time in ns and text of the controller's last remarks, which are logged, too."""
        self.collisions: list[Collision] = []  # first contacts of bodies that must not meet, since power-on
        self.acts: deque[tuple[int, str]] = deque(maxlen=_REMARKS)
        """Time in ns and words of the last events of the scenario, and of what somebody has done."""
        self.steps_made: deque[Step] = deque(maxlen=_STEPS)
        """Last steps of the controller's program; whoever shows them clears them."""
        asking = controller if offers(controller, UsesDrives) else None
        drive_inputs = () if asking is None else tuple(asking.drive_inputs())
        axes = len(controller.counts)
        schedule = Schedule(plans.events, None if plans.new_language is None else plans.new_language())
        start_at_mm = power_on_mm(self.machine, start, origin.start_mm)
        trips = TripPoints(self.machine, trips_random)
        watched = thresholds(self.machine, drive_inputs, trips, schedule)
        self._plant = build_plant(origin.plant, self.machine, watched, start_at_mm, axes, model)
        self._position = Position(controller, self._plant, np.array([axis.step_mm for axis in self.machine.axes]))
        self._line = SerialLine(bool(origin.line_speed), noise, round(origin.adapter_ms * 1e6))
        self._wiring = Wiring(
            self.machine, self._plant, self._line, controller.terminals(), drive_inputs, trips, bounces, schedule
        )
        if self._wiring.turning is not None:
            self._position.spindle_now = lambda: self.spindle_rev_min
        self._wiring.on_event = lambda event: self._note("scenario", event.content)
        self._restarts = 0  # of those that the wiring counts, as many have been followed
        self.restarts = 0
        """How often the controller was reset or lost its supply since power-on."""
        self.unpowered_steps: NDArray[np.int64] = np.zeros(axes, dtype=np.int64)
        """int64 [axes], steps that the controller has made since power-on while the motors had no current."""
        self.stores_lost = 0
        """How often `on_flash` could not store what the controller wrote: the flash still holds what it held."""
        self._stream = Stream(axes, keep=keep_motions)
        self._arrival: Arrival | None = None  # what the controller waits for while the plant advances
        self._adopt(controller)
        self._observers: Observers[Twin] = Observers()
        self._sampler: Sampler | None = None
        self._sampled = self._plant if isinstance(self._plant, Sampled) else None
        self._finds = self._plant if isinstance(self._plant, FindsArrival) else None
        self._straight = self._plant if isinstance(self._plant, GoesStraight) else None
        self._notes: list[Note] = []
        self._margin_readers = MarginReaders()
        self.margin_since_ns = 0
        """From when on `margin` and `speed_edge` are the least: the last `watch_margin`."""
        self._least: Any = None
        self._sense: NDArray[np.int8] | None = None
        """Directions of the motors in a motion, if one is turned round."""
        self._due_ns = 0
        """The least `next_ns`, when the twin last settled."""
        self._untold = False  # the plant has advanced since the twin last settled
        self._advanced_ns = 0  # to where the controller has been advanced
        self._settling = False

        self._told = Told(controller, self.flash, rebuilt=plans.new_controller is not None)
        self._told.use_drives(self._position)
        self._levels = self._wiring.levels
        self._told.power_on(0, self._levels)
        self._take_events()
        self._settle()

    # The host's side

    def write(self, data: bytes) -> None:
        """The host sends bytes now. Raises TypeError for anything else, such as text."""
        if not isinstance(data, bytes | bytearray | memoryview):
            raise TypeError(f"write takes bytes, not {type(data).__name__}: b'...', or query for a line of text")
        if data:
            self._note("sent", bytes(data))
        at_once = None if self._handshake is None else BYTES_AT_ONCE
        self._line.from_host(self.time_ns, bytes(data), self.serial_format.byte_ns, at_once)
        self._settle()

    def read(self) -> bytes:
        """Take the bytes that have arrived at the host."""
        return self._line.at_host(self.time_ns)

    def query(self, text: str, timeout_s: float = 3600.0) -> str:
        """Send a line of text, run until the controller has answered and is idle, return the reply.

        Unread bytes from before are dropped. After a TimeoutError use `run_until_idle` and `read` for the rest of the
        reply, or it becomes part of the next one.

        Raises TimeoutError after timeout_s of virtual time,
        LanguageError (ValueError) for a text that cannot be sent or a controller without language: use `write`.
        """
        language = needed(self.language, self.controller_name)
        data = language.frame(text)
        self.read()
        self.write(data)
        if not self.run_until_idle(timeout_s):
            raise TimeoutError(f"no complete reply to {text!r} within {timeout_s:g} s of virtual time")
        return language.text(self.read())

    def run_until_idle(self, timeout_s: float = 3600.0) -> bool:
        """Let virtual time pass until the controller is idle and its replies have arrived, at most timeout_s.

        Returns whether it is idle.
        """
        return self._advance(self.time_ns + round(timeout_s * SECOND_NS), lambda: self.idle) or self.idle

    # Time

    def run(self, seconds: float) -> None:
        """Let virtual time pass. Raises ValueError unless seconds is from 0 to the clock's end at 146 years."""
        if not 0.0 <= seconds < (_NEVER_NS - self.time_ns) / SECOND_NS:
            raise ValueError(f"virtual time cannot pass by {seconds} s; give a number from 0 to 4e9, in all")
        self._advance(self.time_ns + round(seconds * SECOND_NS))

    def run_until(self, time_ns: int, stop: Callable[[], bool] | None = None) -> None:
        """Let virtual time pass to time_ns, or until `stop` (called whenever something has happened) returns True. A
        time in the past does nothing.
        """
        self._advance(time_ns, stop)

    def settle(self) -> None:
        """The controller has something new: its motion, outputs and replies are taken over now. For controllers that
        were handed in and are told things by calls of their own; bytes and operations settle by themselves.

        Raises ValueError if its new motion has ticks in the past.
        """
        self._told.advance(self.time_ns)
        self._take_events()
        self._settle()

    # The clock

    def _advance(self, until_ns: int, stop: Callable[[], bool] | None = None) -> bool:
        """Return whether `stop` has ended it."""
        while self.time_ns < until_ns:
            if stop is not None and stop():
                return True
            due_ns = self._due_ns
            if due_ns < until_ns:  # comparisons take a quarter of the time of `min` and `max`
                self._advance_plant(due_ns if due_ns > self.time_ns else self.time_ns)
            else:
                self._advance_plant(until_ns)
            if self.time_ns >= self._due_ns or self._plant.edge:
                self._settle()
            else:
                self._untold = True
        return False

    def _advance_plant(self, until_ns: int) -> None:
        """Let the plant make the ticks to until_ns, the first threshold passed or the end of a chunk."""
        if self._sampler is not None:
            self._sampler.prepare()
            until_ns = min(until_ns, self.time_ns + self._sampler.span_ns)
        if self._straight is not None and self._go_straight(self._straight, until_ns):
            if self._sampler is not None:
                self._sampler.keep_up()
            return
        t_ns, delta = self._stream.until(until_ns)
        count = len(t_ns)
        if count and self._stream.more_after(count):
            until_ns = int(t_ns[-1])
        if count and self._sense is not None:
            delta = delta * self._sense.astype(delta.dtype)
        if self._arrival is None:
            reached = self._plant.advance(until_ns, t_ns, delta, self._stream.lead_ns)
        else:
            reached = self._arrive(until_ns, self._arrival)
        if count:
            made = count if reached >= until_ns else int(np.searchsorted(t_ns, reached, side="right"))
            self._stream.make(made)
            if not self._wiring.stages_powered:
                self.unpowered_steps = self.unpowered_steps + np.abs(delta[:made].astype(np.int64)).sum(axis=0)
        self.time_ns = reached
        if self._plant.edge:
            self._collide()
        if self._sampler is not None:
            self._sampler.keep_up()

    def _arrive(self, until_ns: int, arrival: Arrival) -> int:
        """Let the plant advance to until_ns, or to the first look of the controller at which its drives are in
        position; the looks before it are left out. Return the time reached."""
        assert self._finds is not None
        reached, arrived = self._finds.arrive(until_ns, arrival.look_ns(self.time_ns), arrival.period_ns)
        if arrived:
            self._due_ns = reached
        return reached

    def _go_straight(self, plant: GoesStraight, until_ns: int) -> bool:
        """Let the plant make the ticks to until_ns as one; False if it has to be told of each."""
        room = plant.room()
        if room is None:
            return False
        if self._sense is not None:
            room = _turned(room, self._sense.tolist())
        ahead = self._stream.straight(until_ns, *room)
        if ahead is None:
            return False
        until_ns, count, way = ahead
        if self._sense is not None:
            way = tuple([n * sense for n, sense in zip(way, self._sense.tolist(), strict=True)])
        plant.go_straight(until_ns, way, self._along)
        self._stream.skip(count)
        if not self._wiring.stages_powered:
            self.unpowered_steps = self.unpowered_steps + np.abs(way)
        self.time_ns = until_ns
        return True

    def _along(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """Where a straight way is at these times (`isel_twin.plant.Along`)."""
        way = self._stream.along(times_ns)
        return way if self._sense is None else way * self._sense

    def _collide(self) -> None:
        """Take over who has met."""
        for seen in self._plant.take_collisions():
            x, y, z = self._position.of_carriages_mm(np.array(seen.position_mm)).tolist()
            speed_mm_s = seen.speed_mm_s
            if math.isnan(speed_mm_s):
                speed_mm_s = float(np.linalg.norm(self._stream.rate_hz()[: len(self.step_mm)] * self.step_mm))
            collision = replace(seen, position_mm=(x, y, z), speed_mm_s=speed_mm_s)
            self.collisions.append(collision)
            self._note("collision", collision)
            log.warning("%s", collision)
            self._wiring.collided(collision.first, collision.second)

    def _tell(self) -> None:
        """Advance the controller to the present."""
        if self._untold:
            self._settle()

    def _next_due_ns(self, controller_ns: int | None) -> int:
        """When the twin has to settle next, with a controller that has something to do at controller_ns. Its looks at
        its drives count only if the plant has to be asked: `_arrival`."""
        self._arrival = None if self._awaits is None else self._awaited(self._awaits)
        due_ns = _NEVER_NS if controller_ns is None else controller_ns
        if self._arrival is not None:
            due_ns = self._arrival.until_ns
        if (line_ns := self._line.next_ns) is not None and line_ns < due_ns:
            due_ns = line_ns
        if (wiring_ns := self._wiring.next_ns) is not None and wiring_ns < due_ns:
            due_ns = wiring_ns
        if self._observers.any and (look_ns := self._observers.next_ns) is not None and look_ns < due_ns:
            due_ns = look_ns
        if self.time_ns < self._line.quiet_ns < due_ns:
            due_ns = self._line.quiet_ns
        return due_ns

    def _settle(self) -> None:
        """Process everything that is due at this instant, until nothing is left."""
        self._settling = True
        try:
            self._settle_all()
        finally:
            self._settling = False

    def _settle_all(self) -> None:
        self._hand_over_kept()
        self._untold = False
        self._due_ns = self.time_ns
        left = None
        for rounds in count(1):
            if rounds % _ENDLESS == 0:
                if left == self._wiring.events_left:  # their number is finite
                    raise RuntimeError(f"the controller does not come to an end at {self.time_ns} ns")
                left = self._wiring.events_left
            next_ns = self._controller.next_ns if self._advanced_ns == self.time_ns else self.time_ns
            if next_ns is not None and next_ns <= self.time_ns:
                self._advanced_ns = self.time_ns
                self._told.advance(self.time_ns)
                self._take_events()
            if self._wiring.settle(self.time_ns) or (self._restarts != self._wiring.restarts and self._restart()):
                continue
            handed_over = self._hand_over_bytes()
            next_ns = self._controller.next_ns
            due = next_ns is not None and next_ns <= self.time_ns
            if handed_over and (due or self._wiring.stirred or self._handshake is not None):
                continue
            if self._hand_over_levels():
                continue
            if self._wiring.pressed:
                self._hand_over_keys()
            elif not due:
                if self._observers.any:
                    self._show_inputs()
                    next_ns = self._controller.next_ns  # an observer may have written
                self._due_ns = self._next_due_ns(next_ns)
                return


def _turned(room: tuple[list[int], list[int]], sense: Sequence[int]) -> tuple[list[int], list[int]]:
    """The room of each axis below and above, with the axes of sense -1 the other way round."""
    ways = [(low, high) if way > 0 else (-high, -low) for way, low, high in zip(sense, *room, strict=False)]
    return [low for low, _ in ways], [high for _, high in ways]
