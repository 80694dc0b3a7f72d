"""The card's state that its parts share, and what they ask of each other.

settings   what a host sets            path     interpolator         queue    order of commands
stored     what survives the mains     drives   readiness, faults    store    programs
images     inputs, outputs, flags      offsets  zero points          plc      see plc.py

The parts name this module, not one another: `Interpolator`, `Bank` and `Order` say what path, drives and queue are
asked for by the others. device.py puts them together.
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Sequence
from dataclasses import replace
from typing import Any, Protocol

from isel_twin.controller import CounterSet, Event, FlashWrite, Output, Remark
from isel_twin.firmware.gmi99 import images as places
from isel_twin.firmware.gmi99.images import DIGITAL, Images
from isel_twin.firmware.gmi99.instruction import Instruction
from isel_twin.firmware.gmi99.offsets import Offsets
from isel_twin.firmware.gmi99.plc import Plc
from isel_twin.firmware.gmi99.settings import SLOTS, Settings, Stored, decode, encode
from isel_twin.firmware.gmi99.store import Store
from isel_twin.firmware.gmi99.waiting import Wait
from isel_twin.motion import SetPointRun
from isel_twin.motion.path import added

SPINDLE, HOOD_LOCK = (0, 0), (0, 1)
"""Outputs of slot 0 that the fixture uses (G19)."""


class Interpolator(Protocol):
    """What the others ask of path.py; attributes and methods are described there."""

    feed_hz: int | None
    absolute: bool
    per_turn: bool
    shortest_way: bool
    sources: list[int]
    run: SetPointRun | None
    ghost: bool

    @property
    def at_rest(self) -> bool: ...
    @property
    def accepts(self) -> bool: ...
    @property
    def moves(self) -> int: ...
    @property
    def host_moves(self) -> int: ...
    def grid_ns(self, t_ns: int) -> int: ...
    def move(self, instruction: Instruction) -> None: ...
    def begin_circle(self, *, clockwise: bool) -> None: ...
    def on_the_way(self, act: Callable[[], None]) -> None: ...
    def speeds_changed(self) -> None: ...
    def break_off(self) -> None: ...
    def cut(self) -> None: ...
    def release(self) -> SetPointRun: ...


class Bank(Protocol):
    """What the others ask of drives.py."""

    run: SetPointRun | None
    ready: bool
    searching: int

    @property
    def estop(self) -> bool: ...
    @property
    def at_rest(self) -> bool: ...
    def status(self, slot: int) -> int: ...
    def blocked(self, slot: int) -> bool: ...
    def is_overloaded(self, slot: int) -> bool: ...
    def in_position(self, mask: int) -> Generator[Wait, None, None]: ...
    def struck_ahead(self, way: Sequence[int]) -> int | None: ...
    def lose(self, why: str, *, stages: bool) -> None: ...
    def brake(self) -> None: ...
    def make_ready(self, mask: int, *, run: bool, indexer: bool = True) -> Generator[Wait, None, None]: ...


class Order(Protocol):
    """What the others ask of queue.py."""

    @property
    def busy(self) -> bool: ...
    @property
    def in_program(self) -> bool: ...
    @property
    def block_number(self) -> int: ...
    def call(self, number: int) -> None: ...
    def leave(self) -> None: ...
    def drop(self) -> None: ...


class Board:
    """See the module. All times are those of the controller's last call."""

    path: Interpolator
    drives: Bank
    queue: Order
    plc: Plc

    def __init__(self, flash: bytes | None, override_pot_percent: int, plc: bytes) -> None:
        """`flash`: None for a new card, which then has the PLC program `plc`."""
        stored = Stored(plc=plc.hex()) if flash is None else decode(flash)
        self.flash_fault = stored is None
        self.stored = stored or Stored()
        self.settings: Settings = self.stored.settings
        self.now_ns = 0
        self.power_on_ns = 0
        self.events: list[Event] = []
        self._moving = False
        self._analog = 0
        self.fault = False
        self._made = (0,) * SLOTS
        """Counters when the motion in execution began."""
        self._apart = (0,) * SLOTS
        """How far T0 is from the counters: motions that left no set point (N17)."""
        self.override_given: int | None = None
        """Percent of `o2`."""
        self.override_external: int | None = None
        """Percent of #9."""
        self.reduced_mode = 1
        """FB 254.33: 0 never, 1 by M3.6, 2 always."""
        self.image_mode = 0
        """FB 254.2."""
        self.analog_drives = 0
        """Drives whose analog output leaves the image (FB 254.8)."""
        self.contact_loss_reported = True
        self.pot_percent = override_pot_percent
        """Where the potentiometer stands."""
        self._levels: dict[tuple[int, int], int] = {}
        """Outputs of the drives as they are, by byte and bit."""
        self.images = Images(self._output_changed)
        self.offsets = Offsets(self.stored.zero_points, self.stored.fine)
        self.store = Store(self.stored.programs)

    # ---- events ------------------------------------------------------------------------------------------------------

    def output(self, name: str, value: int) -> None:
        """An output of the card has this level now."""
        self.events.append(Output(name, value))

    def refuse(self, why: str) -> None:
        """A command has no effect, or something has failed, and no reply tells."""
        self.fault = True
        self.events.append(Remark(why))

    def _output_changed(self, byte: int, value: int) -> None:
        slot_byte = byte - self.images.drives_at
        if not 0 <= slot_byte < DIGITAL:
            return
        for bit in range(8):
            level = value >> bit & 1
            if self._levels.get((slot_byte, bit), 0) == level:
                continue
            self._levels[slot_byte, bit] = level
            self.output(f"a{slot_byte}.{bit}", level)
            if (slot_byte, bit) == SPINDLE:
                self.output("spindle", level)
            elif (slot_byte, bit) == HOOD_LOCK:
                self.output("hood_release", 1 - level)

    @property
    def analog_asked(self) -> bool:
        """M3.2."""
        return self.images.flag(places.ANALOG)

    def put_analog_outputs(self) -> None:
        """The analog output of slot 0 leaves the image (M3.2, FB 254.8)."""
        value = self.images.outputs[self.images.drives_at + DIGITAL]
        if value != self._analog:
            self._analog = value
            self.output("analog", value)

    # ---- settings and memories ---------------------------------------------------------------------------------------

    def set(self, **values: Any) -> None:
        """Settings become these."""
        self.settings = replace(self.settings, **values)

    def parameters_changed(self) -> None:
        """N parameters have changed."""
        cards = bool(self.settings.input_cards or self.settings.output_cards)
        self.images.arrange(cards=cards, mode=self.image_mode)
        self.path.speeds_changed()

    def keep(self, **values: Any) -> None:
        """The memories hold these now."""
        self.stored = replace(self.stored, **values)
        self.events.append(FlashWrite(encode(self.stored)))

    def keep_data(self) -> None:
        """The static data words are kept."""
        data = self.images.static.rstrip(b"\0").hex()
        if data != self.stored.data:
            self.keep(data=data)

    def erase(self) -> None:
        """All memories are as new."""
        self.stored = Stored()
        self.store.erase()
        self.offsets = Offsets(self.stored.zero_points, self.stored.fine)
        self.images.data[:] = bytes(len(self.images.data))
        self.flash_fault = self.store.error = False
        self.output("flash_fault", 0)
        self.events.append(FlashWrite(encode(self.stored)))

    # ---- positions ---------------------------------------------------------------------------------------------------

    @property
    def position(self) -> tuple[int, ...]:
        """Set positions, as T0 gives them."""
        made = self.counts
        ghost = self.path.run
        if ghost is not None and self.path.ghost:
            made = added(made, ghost.displacement(self.now_ns))
        return added(made, self._apart)

    @property
    def counts(self) -> tuple[int, ...]:
        """Counters: the sum of the set points that have left the card."""
        run = self.drives.run or (None if self.path.ghost else self.path.run)
        return self._made if run is None else added(self._made, run.displacement(self.now_ns))

    def take_in(self, displacement: Sequence[int], *, ghost: bool) -> None:
        """A motion has ended that went so far."""
        if ghost:
            self._apart = added(self._apart, displacement)
        else:
            self._made = added(self._made, displacement)

    def set_counter(self, axis: int, value: int) -> None:
        """The counter of an axis becomes a value; nothing moves."""
        self._made = (*self._made[:axis], value, *self._made[axis + 1 :])
        self._apart = (*self._apart[:axis], 0, *self._apart[axis + 1 :])
        self.events.append(CounterSet(axis, value))

    # ---- what holds and slows ----------------------------------------------------------------------------------------

    @property
    def override_percent(self) -> int:
        """Override in force."""
        if not self.settings.override:
            return 100
        if self.override_given is not None:
            return self.override_given
        return self.pot_percent if self.override_external is None else self.override_external

    @property
    def enable_missing(self) -> bool:
        """E0.0 is the enable (N51) and low."""
        return bool(self.settings.enable_input) and not self.images.inputs[self.images.drives_at] & 1

    @property
    def stopped(self) -> bool:
        """Stop flag or missing enable hold the motion."""
        flags = self.images
        return self.enable_missing or (flags.flag(places.STOP) and not flags.flag(places.STOP_SUPPRESSED))

    @property
    def reduced(self) -> bool:
        """The reduced speed is in force."""
        asked = self.reduced_mode == 2 or (self.reduced_mode == 1 and self.images.flag(places.REDUCED))
        return asked and self.settings.r_hz[0] > 0

    @property
    def in_program(self) -> bool:
        """A program runs."""
        return self.queue.in_program

    # ---- what ends things --------------------------------------------------------------------------------------------

    def abort(self) -> None:
        """#0, M0.1: everything under way brakes and is forgotten."""
        self.drop()
        self.path.break_off()
        self.drives.brake()

    def drop(self) -> None:
        """Queue, program and recording are over."""
        self.queue.drop()

    # ---- status ------------------------------------------------------------------------------------------------------

    @property
    def moving(self) -> bool:
        """A motion or a reference run is being made."""
        return self.path.run is not None or self.drives.run is not None

    @property
    def busy(self) -> bool:
        """A command or program is being carried out."""
        return self.queue.busy or not self.path.at_rest or not self.drives.at_rest

    @property
    def information(self) -> int:
        """Information character but for the message (3.2)."""
        return self.drives.estop << 3 | self.moving << 4 | (not self.drives.ready) << 6 | self.busy << 7

    @property
    def memory_status(self) -> int:
        """T3;4."""
        bad = self.flash_fault
        return (self.plc.load_error or bad) | (not self.plc.running) << 1 | (self.store.error or bad) << 4 | bad << 5

    @property
    def safety_status(self) -> int:
        """T3;8."""
        stop = self.images.flag(places.STOP)
        blocked = any(self.drives.blocked(slot) for slot in range(SLOTS) if self.settings.axis_mask >> slot & 1)
        return self.reduced | blocked << 1 | stop << 2 | self.enable_missing << 3

    def refresh_flags(self) -> None:
        """Flags of the firmware, and the output that tells of motion, show what is."""
        if self.moving != self._moving:
            self._moving = self.moving
            self.output("moving", int(self._moving))
        set_flag = self.images.set_flag
        set_flag(places.INDEXER_RUNS, self.path.run is not None)
        set_flag(places.NO_ESTOP, not self.drives.estop)
        set_flag(places.NOT_READY, not self.drives.ready)
        set_flag(places.READY, not self.busy)
        set_flag(places.FROZEN, bool(self.settings.motion_off))

    def ask_drives(self) -> None:
        """Flags that only the drives know are as they are now: before somebody looks at them."""
        self.images.set_flag(places.I2T, any(map(self.drives.is_overloaded, range(SLOTS))))

    def flags_changed(self, *, program_ran: bool) -> None:
        """Host or PLC have written flags; `program_ran`: M0.2 before."""
        flags = self.images
        if flags.flag(places.BREAK_OFF):
            flags.set_flag(places.BREAK_OFF, False)
            self.abort()
        if flags.flag(places.PROGRAM_RUNS) and not program_ran and not self.in_program:
            flags.set_flag(places.PROGRAM_RUNS, False)
            self.queue.call(flags.flags[places.PROGRAM_NUMBER])
        flags.set_flag(places.PROGRAM_RUNS, self.in_program)
        if self.analog_asked:
            self.put_analog_outputs()
        self.path.speeds_changed()
