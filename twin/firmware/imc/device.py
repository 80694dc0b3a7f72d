"""The state of the controller without its protocol: motion, counters, references, settings, outputs. Counters count
ticks, and jump only with a CounterSet event.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from typing import Any

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.controller import CounterSet, Event, FlashWrite, Remark, Reply
from isel_twin.firmware.executor import Executor
from isel_twin.firmware.imc import settings as flash_image
from isel_twin.firmware.imc.limits import LimitSwitches, name_of
from isel_twin.firmware.imc.ports import Inputs, Outputs
from isel_twin.firmware.imc.profile import Profile
from isel_twin.firmware.imc.replies import (
    BAD_NUMBER,
    FAULT,
    HINDERED,
    HOOD_OPEN,
    LIMIT_SWITCH,
    NO_AXES,
    NOT_REFERENCED,
    SYNTAX,
    WORDS,
    Refusal,
)
from isel_twin.firmware.imc.safety import TRANSITIONS, State, hood_safe, open_circuit, power_loss, powered
from isel_twin.firmware.imc.safety import Event as SafetyEvent
from isel_twin.firmware.imc.settings import AXES, Flash, Modal, Settings, StoredProgram, axes_of
from isel_twin.motion import Displacement, Rational, TimeLaw, trapezoid
from isel_twin.motion.path import added

KINDER = (
    "the reference run alone ends the state after a limit switch (reference_ends_limit); the manual's controller "
    "answers 2 until the axes have been set anew (@07)"
)
POSITION_LIMIT = 1 << 23  # counters have 24 bits, two's complement


class Device:
    """State of one controller from power-on or reset to the next."""

    def __init__(self, profile: Profile, flash: Flash | None, inputs: Inputs, events: list[Event]) -> None:
        """flash: its content (None: unreadable); events: list that gets all events."""
        self.profile = profile
        self.executor = Executor(AXES)
        self.flash = flash or Flash(flash_image.default_settings(profile))
        self.settings = self.flash.settings
        self.inputs = inputs
        self.limits = LimitSwitches(inputs, self._present_settings, profile.debounce_ms * MILLISECOND_NS)
        self.outputs = Outputs(events)
        self.safety = State.FAULT
        self._left_by = ""  # the event that has led out of OPERATING
        self._unmade: tuple[bytes, str] | None = None  # a line that the machine's state has hindered, and its reply
        self.number = 0
        self.axes = 0
        self.referenced = [False] * AXES
        self.virtual_zero = [0] * AXES
        self.modal = Modal()
        self.port_condition: tuple[int, int, int] | None = None
        """Port, mask, value that ends the next move of a stored program (3.2.7)."""
        self._events = events

    def _present_settings(self) -> Settings:
        return self.settings

    @property
    def now_ns(self) -> int:
        return self.executor.now_ns

    @property
    def counts(self) -> Displacement:
        """Counters X, Y, Z, A now."""
        return self.executor.counts

    @property
    def direction(self) -> Displacement:
        """Motor sense of each counter (`@0ID`)."""
        return _senses(self.settings.inverted)

    @property
    def axis_list(self) -> tuple[int, ...]:
        """Axes that are set, in the order X, Y, Z, A."""
        return axes_of(self.axes)

    def set_reference(self, axis: int) -> None:
        """Reference an axis at the present position: counter 0, no virtual zero."""
        self.executor.set_counter(axis, 0)
        self._events.append(CounterSet(axis, 0))
        self.referenced[axis] = True
        self.virtual_zero[axis] = 0

    def lose_references(self) -> None:
        self.referenced = [False] * AXES

    @property
    def fault_cause(self) -> str:
        """The fault that stands, or the line that it has hindered (imc/52); "" if there is none."""
        if cause := self._left_by or open_circuit(self.inputs):
            return cause
        if self._unmade is None:
            return ""
        line, code = self._unmade
        return f"{line.decode('latin-1')} not made: {code}: {WORDS[code]}"

    def hindered(self, line: bytes, code: str) -> None:
        """Keep a line that has been refused or broken off by the machine's state."""
        if code in HINDERED:
            self._unmade = line, code

    def made(self, line: bytes) -> None:
        """A line has been carried out: one like it is no longer owed."""
        if self._unmade is not None and self._unmade[0] == line:
            self._unmade = None

    def forget_unmade(self) -> None:
        self._unmade = None

    def note(self, event: SafetyEvent, cause: str = "") -> None:
        """cause: in words, of an event that leads out of OPERATING."""
        self.safety = TRANSITIONS.get((self.safety, event), self.safety)
        self._left_by = "" if self.safety is State.OPERATING else cause or self._left_by
        if event in (SafetyEvent.INITIALISED, SafetyEvent.REFERENCE_BEGUN):
            self.forget_unmade()

    def limit_struck(self, axis: int, cause: str = "") -> None:
        """End motion at a limit switch: moves are forbidden, positions are lost. cause: in words; "": the switches."""
        struck = " and ".join(map(name_of, self.limits.struck(axis)))
        self.note(SafetyEvent.LIMIT_STRUCK, cause or f"{struck} struck")
        self.lose_references()

    def require_axes(self) -> None:
        """Raise Refusal(4) unless axes are set."""
        if not self.axes:
            raise Refusal(NO_AXES)

    def require_supply(self) -> None:
        """Raise Refusal(9) unless the safety chain is closed and the axes have been initialised since it was open."""
        if self.safety is State.FAULT or not powered(self.inputs):
            raise Refusal(FAULT)

    def require_hood(self) -> None:
        """Raise Refusal(H) if the hood is open in automatic."""
        if not hood_safe(self.inputs):
            raise Refusal(HOOD_OPEN)

    def require_power(self) -> None:
        """Raise Refusal unless axes may move: IO-only mode (5), supply and stages (9), hood (H)."""
        if self.settings.io_only:
            raise Refusal(SYNTAX)
        self.require_supply()
        if not self.outputs["stages"]:
            raise Refusal(FAULT)
        self.require_hood()

    def require_reference_run(self) -> None:
        """Raise Refusal unless a reference run may begin: after a limit switch set the axes anew first (2, imc/47)."""
        self.require_power()
        if self.safety is State.LIMIT and not self.profile.reference_ends_limit:
            raise Refusal(LIMIT_SWITCH)

    def begin_reference_run(self) -> None:
        """Take note that one begins, real or simulated."""
        if self.safety is State.LIMIT:
            self.remark(KINDER)
        self.note(SafetyEvent.REFERENCE_BEGUN)

    def require_move(self) -> None:
        """Raise Refusal unless axes may move and no limit switch has been struck since (2)."""
        self.require_power()
        if self.safety is State.LIMIT:
            raise Refusal(LIMIT_SWITCH)

    def guards(self, axis: int) -> bool:
        """True if limit switches end motions of this axis; False in test mode and for a rotary axis (imc/29)."""
        return bool(self.axes >> axis & 1) and not self.settings.rotary >> axis & 1 and not self.test_mode

    def require_room(self, *legs: Displacement, unreferenced: bool = False) -> None:
        """Raise Refusal unless these legs may follow each other: 24 bits (1, imc/15), reference unless
        `unreferenced` (R, imc/3)."""
        counts = self.executor.counts
        for leg in legs:
            counts = added(counts, leg)
            if min(counts) < -POSITION_LIMIT or max(counts) >= POSITION_LIMIT:
                raise Refusal(BAD_NUMBER)
        if not unreferenced:
            self.require_reference([axis for leg in legs for axis in range(AXES) if leg[axis]])

    def require_reference(self, axes: Iterable[int]) -> None:
        """Raise Refusal(R) unless these axes are referenced."""
        for axis in axes:
            if not self.referenced[axis]:
                raise Refusal(NOT_REFERENCED)

    def energise(self) -> None:
        """Stages on, brake released."""
        self.outputs["stages"] = int(not self.settings.io_only)
        self.outputs["brake"] = self.outputs["stages"]

    def shut_down(self) -> None:
        """Fault: switch off stages, brake and spindle; positions are lost."""
        self.note(SafetyEvent.POWER_LOST, power_loss(self.inputs))
        for name in ("stages", "brake", "spindle"):
            self.outputs[name] = 0
        self.lose_references()

    @property
    def start_stop_hz(self) -> int:
        """In force now: from `@0j`, or the default."""
        return self.modal.start_stop_hz or self.settings.start_stop_hz

    @property
    def acceleration_hz_per_ms(self) -> int:
        """In force now: from `@0J`, or the default."""
        return self.modal.acceleration_hz_per_ms or self.settings.acceleration_hz_per_ms

    def reference_hz(self, axis: int) -> int:
        """In force now: from `@0d`, or the default."""
        return (self.modal.reference_hz or self.settings.reference_hz)[axis]

    @property
    def three_d(self) -> bool:
        return bool(self.modal.three_d)

    @property
    def test_mode(self) -> bool:
        return bool(self.modal.test_mode)

    @property
    def plane(self) -> int:
        """Plane of arcs: 0 XY (default), 1 XZ, 2 YZ."""
        return self.modal.plane or 0

    @property
    def clockwise(self) -> bool:
        """Direction of arcs; clockwise by default (imc/34)."""
        return self.modal.clockwise is not False

    def law(self, speed_hz: Rational) -> Callable[[int], TimeLaw]:
        """A function of a number of ticks that gives the time law with the present ramps, even if called later."""
        start_stop_hz, acceleration_hz_per_s = self.start_stop_hz, 1000 * self.acceleration_hz_per_ms
        return lambda ticks: trapezoid(ticks, speed_hz, start_stop_hz, acceleration_hz_per_s)

    def store(self, *, settings: Settings | None = None, program: StoredProgram | None = None) -> None:
        """Write new settings or a new program to the flash; the other stays."""
        self.flash = Flash(settings or self.flash.settings, program or self.flash.program)
        self.outputs["flash_fault"] = 0
        self._events.append(FlashWrite(flash_image.encode(self.flash)))

    def send(self, text: str) -> None:
        self._events.append(Reply(text.encode("latin-1")))

    def tell(self, event: Event) -> None:
        self._events.append(event)

    def remark(self, text: str) -> None:
        self._events.append(Remark(text))

    def set_settings(self, **values: Any) -> None:
        """Change initialisation values (chapter 4) until the next reset; `@0IW` makes them last."""
        self.settings = replace(self.settings, **values)

    @contextmanager
    def supposing(self, axes: int, modal: Modal) -> Iterator[None]:
        """Within the block these axes and modal values are set."""
        kept = self.axes, self.modal
        self.axes, self.modal = axes, modal
        try:
            yield
        finally:
            self.axes, self.modal = kept

    def set_modal(self, **values: Any) -> None:
        """Change values that last until the next reset."""
        self.modal = replace(self.modal, **values)


@cache
def _senses(inverted: int) -> Displacement:
    """+1, or -1 for the axes whose bit is set."""
    return tuple(-1 if inverted >> axis & 1 else 1 for axis in range(AXES))
