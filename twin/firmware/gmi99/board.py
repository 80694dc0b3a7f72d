"""The card's state, shared by its parts.

settings   set by the host              images   inputs, outputs, flags     events   of the controller
stored     kept without mains           store    programs                   struck   limit switches
offsets    zero points                  path_run, drives_run   motion in execution, and how far the ended ones went

    Board <- Interpolator <- DriveBank, Queue, CardPlc <- Card (device.py) <- actions and commands <- Sequencer, Gmi99
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

from isel_twin.controller import CounterSet, Event, FlashWrite, Output, Remark
from isel_twin.firmware.gmi99 import images as places
from isel_twin.firmware.gmi99.images import DIGITAL, Images
from isel_twin.firmware.gmi99.offsets import Offsets
from isel_twin.firmware.gmi99.settings import SLOTS, Settings, Stored, decode, encode
from isel_twin.firmware.gmi99.store import Store
from isel_twin.firmware.gmi99.under_way import UnderWay
from isel_twin.motion import SetPointRun
from isel_twin.motion.path import added

SPINDLE, HOOD_LOCK = (0, 0), (0, 1)  # outputs of slot 0 that the fixture uses (gmi99/19)


class Board:
    def __init__(self, flash: bytes | None, override_pot_percent: int, new: Stored) -> None:
        """`flash`: None for a new card, in whose memories is `new`."""
        stored = new if flash is None else decode(flash)
        self.flash_fault = stored is None
        self.stored = stored or Stored()
        self.settings: Settings = self.stored.settings
        self.now_ns = 0
        self.power_on_ns = 0
        self.events: list[Event] = []
        self.refused = ""  # the last failure that no reply has told
        self.path_run: SetPointRun | None = None  # the interpolator's motion, even a ghost
        self.ghost = False  # path_run sends no set points (N17)
        self.drives_run: SetPointRun | None = None  # motion of the drives' own indexers
        self.uncoupled_run: SetPointRun | None = None  # of axes that have left the interpolation
        self.uncoupled = 0  # which ones, bits
        self._under_way = UnderWay()
        self._made = (0,) * SLOTS  # counters when the motion in execution began
        self._apart = (0,) * SLOTS  # T0 minus counters: the displacement of ghosts
        self.struck: dict[tuple[int, int], bool] = {}
        """Limit switches that are wired, by slot and end (0: motor, 1: far)."""
        self.override_given: int | None = None  # percent of `o2`
        self.override_external: int | None = None  # percent of #9
        self.reduced_mode = 1  # FB 254.33: 0 never, 1 by M3.6, 2 always
        self.image_mode = 0  # FB 254.2
        self.analog_drives = 0  # drives whose analog output leaves the image (FB 254.8)
        self._analog = 0
        self.told_modulo: frozenset[int] = frozenset()  # slots whose position did not fit into its last answer
        self.pot_percent = override_pot_percent  # where the potentiometer stands
        self._levels: dict[tuple[int, int], int] = {}  # present outputs of the drives, by byte and bit
        self.images = Images(self._output_changed)
        self.offsets = Offsets(self.stored.zero_points, self.stored.fine)
        self.store = Store(self.stored.programs)

    def output(self, name: str, value: int) -> None:
        self.events.append(Output(name, value))

    def refuse(self, why: str) -> None:
        """Report a failure for which the host gets no reply."""
        self.refused = why
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

    def put_analog_outputs(self) -> None:
        """Send the analog output of slot 0 from the image (M3.2, FB 254.8)."""
        value = self.images.outputs[self.images.drives_at + DIGITAL]
        if value != self._analog:
            self._analog = value
            self.output("analog", value)

    def set(self, **values: Any) -> None:
        self.settings = replace(self.settings, **values)

    def arrange_images(self) -> None:
        """Give drives and cards their places in the images, chosen by N12, N13 and FB 254.2."""
        cards = bool(self.settings.input_cards or self.settings.output_cards)
        self.images.arrange(cards=cards, mode=self.image_mode)

    def keep(self, **values: Any) -> None:
        """Change stored values and write the flash."""
        self.stored = replace(self.stored, **values)
        self.events.append(FlashWrite(encode(self.stored)))

    def keep_data(self) -> None:
        """Write the static data words to the flash if they have changed."""
        data = self.images.static.rstrip(b"\0").hex()
        if data != self.stored.data:
            self.keep(data=data)

    def erase(self) -> None:
        self.stored = Stored()
        self.store.erase()
        self.offsets = Offsets(self.stored.zero_points, self.stored.fine)
        self.images.data[:] = bytes(len(self.images.data))
        self.flash_fault = self.store.error = False
        self.output("flash_fault", 0)
        self.events.append(FlashWrite(encode(self.stored)))

    @property
    def run(self) -> SetPointRun | None:
        """The motion whose set points are sent."""
        return self._under_way.run

    def send_motions(self) -> None:
        """Take the motions under way now as what is sent; after everything that happens."""
        self._under_way.take(self._motions, self.now_ns, self.power_on_ns)

    @property
    def _motions(self) -> tuple[SetPointRun, ...]:
        runs = self.drives_run or (None if self.ghost else self.path_run), self.uncoupled_run
        return tuple(run for run in runs if run is not None)

    @property
    def moving(self) -> bool:
        return any(run is not None for run in (self.path_run, self.drives_run, self.uncoupled_run))

    @property
    def position(self) -> tuple[int, ...]:
        """Set positions, as T0 gives them."""
        made = self.counts
        if self.path_run is not None and self.ghost:
            made = added(made, self.path_run.displacement(self.now_ns))
        return added(made, self._apart)

    @property
    def counts(self) -> tuple[int, ...]:
        """Counters: the sum of the set points sent."""
        made = self._made
        for run in self._motions:
            made = added(made, run.displacement(self.now_ns))
        return made

    def take_in(self, displacement: Sequence[int], *, ghost: bool) -> None:
        """Add the displacement of an ended motion."""
        if ghost:
            self._apart = added(self._apart, displacement)
        else:
            self._made = added(self._made, displacement)

    def set_counter(self, axis: int, value: int) -> None:
        """Set the counter of an axis; nothing moves."""
        base = value - (self.counts[axis] - self._made[axis])
        self._made = (*self._made[:axis], base, *self._made[axis + 1 :])
        self._apart = (*self._apart[:axis], 0, *self._apart[axis + 1 :])
        self.events.append(CounterSet(axis, value))

    def struck_ahead(self, way: Sequence[int]) -> int | None:
        """A slot that would move further onto its struck limit switch."""
        for (slot, end), struck in self.struck.items():
            if struck and way[slot] * (1 if end else -1) > 0:
                return slot
        return None

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
        """True if the stop flag or a missing enable holds the motion."""
        flags = self.images
        return self.enable_missing or (flags.flag(places.STOP) and not flags.flag(places.STOP_SUPPRESSED))

    @property
    def reduced_m_hz(self) -> tuple[int, ...]:
        """M, and of each axis whose reduced speed is asked for, that (gmi99/30)."""
        settings = self.settings
        if not self._reduction_asked:
            return settings.m_hz
        single = zip(settings.m_hz[1:], settings.r_hz[1:], strict=True)
        return (settings.m_hz[0], *(min(m, r) if r else m for m, r in single))

    @property
    def reduced(self) -> bool:
        return self._reduction_asked and self.settings.r_hz[0] > 0

    @property
    def _reduction_asked(self) -> bool:
        return self.reduced_mode == 2 or (self.reduced_mode == 1 and self.images.flag(places.REDUCED))
