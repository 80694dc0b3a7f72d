"""The control: host, inputs and clock. Implements `isel_twin.controller.Controller`.

    bytes     files of programs and parameters (transfer.py); some parameters are keys, as for a PLC
    keys      of the operator (keys.py)
    inputs    start, stop, E-stop, limit switches, hood, key
    outputs   stages, brake, spindle, coolant ...: a0.0 on, of the PLC
    run       set points of the channel, or of a reference run

Modes: HAND 1, AUTO 2, single block 4, positioning 8. A program starts in AUTO or single block, with all axes referenced
and the drives on.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from enum import IntEnum
from typing import Any, Final

from isel_twin.controller import (
    CounterSet,
    DriveInput,
    Drives,
    Event,
    FlashWrite,
    Key,
    KeyValue,
    Output,
    Remark,
    Reply,
    SerialFormat,
    Step,
)
from isel_twin.firmware.bwo900 import keys, memory
from isel_twin.firmware.bwo900.blocks import Machine, PathBlock
from isel_twin.firmware.bwo900.channel import Channel, Phase
from isel_twin.firmware.bwo900.homing import Homing
from isel_twin.firmware.bwo900.interpreter import Interpreter
from isel_twin.firmware.bwo900.jog import Jog
from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.messages import Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE
from isel_twin.firmware.bwo900.path import Limits, positive
from isel_twin.firmware.bwo900.restart import find
from isel_twin.firmware.bwo900.services import Services
from isel_twin.firmware.bwo900.status import NUMBERS, cell
from isel_twin.firmware.bwo900.stretch import PERIOD_NS
from isel_twin.firmware.bwo900.transfer import Receiver, parameter_file
from isel_twin.motion import SetPointRun
from isel_twin.units import MILLISECOND_NS, SECOND_NS

__all__ = ["Control", "Mode"]

AXES: Final = 3
INCREMENTS_PER_MM: Final = 1_000.0
"""P12012 over P12013 where nobody has set them."""
PULSES: Final = 5_000
"""Increments from zero pulse to zero pulse."""
POWER_NS: Final = 500 * MILLISECOND_NS
POSITIONED: Final = "P0"
"""The program whose first block a positioning block is."""
AT_POWER_ON: Final = (8_579, 8_685, 8_687, 8_709)
"""Parameters that say what is, and are 0 then: references, state of the program."""
OVERWRITTEN: Final = 1106
"""Message of a file that is taken, and replaces one."""
MOST_MESSAGES: Final = 1_000
"""Of the history."""

TERMINALS: Final[Mapping[str, tuple[str, ...]]] = {
    "estop": ("estop_1", "estop_2", "overtemperature"),
    "power": ("power_ok",),
    "e0.1": ("start",),
    "e0.2": ("stop",),
    "e0.3": ("hood_automatic",),
    "e0.4": ("hood_setup",),
    "e0.5": ("key",),
    "e0.6": ("probe",),
    "e0.7": ("spindle",),
    **{f"limit_{'xyz'[axis]}{end + 1}": (f"limit_{'xyz'[axis]}{end + 1}",) for axis in range(AXES) for end in (0, 1)},
}
"""Where the contacts of machine and cabinet lead to."""


class Mode(IntEnum):
    """P8683, P8703."""

    HAND = 1
    AUTO = 2
    SINGLE = 4
    POSITIONING = 8


class Control:
    """Implements isel_twin.controller.Controller, UsesDrives, NamesOutputs and HasKeys."""

    direction = (1,) * AXES
    output_names: Sequence[str] = (*MachinePlc.OUTPUTS, "drive_reset", "auto", "active", "message")

    def __init__(self, flash: bytes | None, *, plc: str | None = None) -> None:
        """flash: programs and parameters that were kept. plc: STEP 5 text in place of the default program."""
        self._parameters, self._store, self._flash_fault = memory.read(flash)
        self._parameters.live = self._cell
        self._interpreter = Interpreter(self._parameters, self._store)
        self._plc = MachinePlc(plc)
        self._receiver = Receiver(self._parameters, self._store, self._written)
        self._channel = Channel(
            self._interpreter,
            Services(
                function=self._function,
                acknowledged=lambda: self._plc.idle,
                room=lambda: self._plc.room,
                withdraw=self._plc.withdraw,
                speed=self._plc.speed,
                tool=self._plc.tool,
                parameter=self._parameters.write,
                say=self._say,
                text=self._show,
                settled=self._settled,
                limits=self._limits,
                counts=lambda: self.counts,
                begun=self._block_begun,
                ended=self._program_ended,
                option=lambda number: int(self._parameters.get(number)),
                allowed=self._allowed,
            ),
            lambda: memory.filters(self._parameters),
        )
        self._drives: Drives | None = None
        self._events: list[Event] = []
        self._now_ns = 0
        self._base: tuple[int, ...] = (0,) * AXES
        self._homing: Homing | None = None
        self._jog: Jog | None = None
        self._jog_sign = 0
        """Of a key that waits for power."""
        self._referenced = [False] * AXES
        self._levels: dict[str, bool] = {}
        self._faulty = [False] * AXES
        self.mode = Mode.HAND
        self.messages: list[Message] = []
        """Those that stand, the newest last."""
        self.history: list[tuple[int, Message]] = []
        self._enabled = False
        self._began_at: tuple[float, ...] = (0.0,) * AXES
        """Where the axes stood as the last program was started."""
        self._power_until_ns: int | None = None
        self._wants: list[int] = []
        """Axes that a reference run has been asked for."""
        self._outputs: dict[str, int] = {}
        self._starts = False
        self.fault = False

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def serial_format(self) -> SerialFormat:
        p = self._parameters
        parity = ("N", "O", "E")[min(max(int(p.get(11_175)), 0), 2)]
        return SerialFormat(
            int(p.given(11_172, 9600.0)),
            int(p.given(11_173, 8.0)),
            parity,  # type: ignore[arg-type]
            int(p.given(11_174, 2.0)),
        )

    @property
    def counts(self) -> tuple[int, ...]:
        run = self.run
        if run is None:
            return self._base
        return tuple(b + m for b, m in zip(self._base, run.displacement(self._now_ns), strict=True))

    @property
    def run(self) -> SetPointRun | None:
        return self._shown

    _shown: SetPointRun | None = None

    @property
    def next_ns(self) -> int | None:
        times = [self._channel.next_ns, self._plc.next_ns, self._power_due_ns]
        if self._homing is not None:
            times.append(self._homing.next_ns)
        if self._jog is not None:
            times.append(self._jog.next_ns)
        if self._shown is not None and self._channel.run is None and self._homing is None and self._jog is None:
            times.append(self._shown.end_ns)
        known = [t for t in times if t is not None]
        return max(min(known), self._now_ns) if known else None

    @property
    def idle(self) -> bool:
        held = self._channel.phase is Phase.HELD
        working = self._channel.active and not held
        asked = self._power_until_ns is not None or not self._plc.idle
        return not (working or self._homing is not None or self._jog is not None or asked or self._receiver.busy)

    @property
    def keys(self) -> Mapping[str, Key]:
        return keys.KEYS

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        return keys.values(self._parameters, self.mode, self._channel.override)

    # ---- what happens -----------------------------------------------------------------------------------------------

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._now_ns = t_ns
        self._levels = dict(levels)
        for number in (*AT_POWER_ON, *(12_180 + AXIS_SIZE * axis for axis in range(AXES))):
            self._parameters.write(number, 0.0)
        self._output("software_ok", 1)
        if self._flash_fault:
            self._output("flash_fault", 1)
        for terminal, level in levels.items():
            self._plc.set_input(t_ns, terminal, level)
        self._plc.power_on(t_ns)
        self._status()

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        for error in self._receiver.take(data):
            self._say(message(error.number, detail=error.detail, effect=Effect.SHOWN))
            self.fault = self.fault or error.number != OVERWRITTEN
        if self._receiver.changed and not self._receiver.busy:
            self._receiver.changed = False
            self._events.append(FlashWrite(memory.image(self._parameters, self._store)))
        self._settle()

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        self.advance(t_ns)
        for number, wanted in keys.writes(name, value):
            self._parameters.write(number, wanted)
            self._written(number, wanted, "P", 1)
        self._events.append(FlashWrite(memory.image(self._parameters, self._store)))
        self._settle()

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._now_ns = t_ns
        before, self._levels[terminal] = self._levels.get(terminal), level
        self._plc.set_input(t_ns, terminal, level)
        if terminal in ("estop", "power") and not level:
            self._lose(3001 if terminal == "estop" else 3002)
        elif terminal.startswith("fault"):
            axis = int(terminal[-1])
            self._faulty[axis] = level
            if level:
                self._referenced[axis] = False
                self._lose(2001)
        elif terminal.startswith("limit") and before and not level:
            self._limit("xyz".index(terminal[6]), int(terminal[7]))
        elif terminal == "e0.1" and level and not before:
            self._start()
        elif terminal == "e0.2" and not level and before:
            self._channel.stop(t_ns)
        self._settle()

    def advance(self, t_ns: int) -> None:
        self._now_ns = t_ns
        self._settle()

    def take(self) -> list[Event]:
        events, self._events = self._events, []
        return events

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return TERMINALS

    def machine_overrides(self) -> Mapping[str, Any]:
        return {"axes.all.drive": "servo"}

    def drive_inputs(self) -> Sequence[DriveInput]:
        return [DriveInput(f"fault{axis}", axis, "fault") for axis in range(AXES)]

    def use_drives(self, drives: Drives) -> None:
        self._drives = drives

    # ---- going on ---------------------------------------------------------------------------------------------------

    def _settle(self) -> None:
        """Everything that is due now."""
        if (until_ns := self._power_due_ns) is not None and (self._ready or self._now_ns >= until_ns):
            self._powered()
        self._plc.advance(self._now_ns)
        if self._homing is not None:
            self._homing.advance(self._now_ns)
            self._follow(self._homing.run)
            if not self._homing.active:
                self._homed()
        if self._jog is not None:
            self._jog.advance(self._now_ns)
            self._follow(self._jog.run)
            if self._jog.run is None:
                self._jog = None
        self._channel.advance(self._now_ns)
        moved = self._homing or self._jog or self._channel
        self._follow(moved.run)
        for name, value in self._plc.take().items():
            self._output(name, value)
        self._status()

    def _follow(self, run: SetPointRun | None) -> None:
        """The motion in execution is this one now."""
        shown = self._shown
        if run is shown:
            return
        if shown is not None and (run is None or not run.continues(shown)):
            self._base = tuple(b + m for b, m in zip(self._base, shown.displacement(self._now_ns), strict=True))
        self._shown = run

    def _status(self) -> None:
        p = self._parameters
        channel = self._channel
        state = 0.0 if not channel.active else 1.0 if channel.phase is Phase.HELD else 2.0
        if p.get(8_685) != state:
            p.write(8_685, state)
            p.write(8_687, 1.0 if channel.active else 0.0)
        self._output("active", int(state))
        self._output("moving", int(self._shown is not None))
        self._output("auto", int(self.mode is not Mode.HAND))

    def _output(self, name: str, value: int) -> None:
        if self._outputs.get(name) != value:
            self._outputs[name] = value
            self._events.append(Output(name, value))

    # ---- drives -----------------------------------------------------------------------------------------------------

    @property
    def _ready(self) -> bool:
        """E-stop, supply and drives let the axes move."""
        return self._levels.get("estop", True) and self._levels.get("power", True) and not any(self._faulty)

    @property
    def _power_due_ns(self) -> int | None:
        """Until when the drives are waited for; None: for nothing, or for the end of the file that asks for them."""
        return None if self._receiver.busy else self._power_until_ns

    def _request_power(self) -> None:
        """Ask the cabinet for its relay, the drives to forget their faults; `_settle` goes on when they are there."""
        self._events += [Output("power_request", 1), Output("power_request", 0)]
        if any(self._faulty):
            self._events += [Output("drive_reset", 1), Output("drive_reset", 0)]
        self._power_until_ns = self._now_ns + POWER_NS

    def _powered(self) -> None:
        self._power_until_ns = None
        starts, self._starts = self._starts, False
        wants, self._wants = self._wants, []
        if not self._ready:
            self._say(message(3001 if not self._levels.get("estop", True) else 3002))
            return
        self._enable(on=True)
        if wants:
            self._home(wants)
        elif starts:
            self._begin_program()
        elif self._jog_sign:
            self._begin_jog()

    def _enable(self, *, on: bool) -> None:
        self._enabled = on
        self._output("stages", int(on))
        self._output("brake", int(on))

    def _lose(self, number: int) -> None:
        """Drives off, everything ends."""
        moving = self._channel.active or self._homing is not None or self._jog is not None
        said = self._channel.message(number)
        if self._homing is not None:
            self._homing.stop()
            self._homing = None
        self._jog, self._jog_sign = None, 0
        self._channel.cut(self._now_ns)
        self._follow(None)
        self._interpreter.end()
        if self._enabled:
            self._enable(on=False)
            self._say(said)
        elif moving:
            self._say(said)

    def _limit(self, axis: int, end: int) -> None:
        """A limit switch is struck: outside of a reference run everything ends."""
        if self._homing is not None or self._shown is None:
            return
        self._say(self._channel.message(2102 if end == 1 else 2101, "XYZ"[axis]))
        if self._jog is not None:
            self._jog.release(self._now_ns, everything=True)
        self._channel.abort(self._now_ns)

    def _settled(self) -> bool:
        if self._drives is None:
            return True
        p, per_mm = self._parameters, self._limits().increments_per_mm
        for axis, per in enumerate(per_mm):
            window = positive(p.axis(axis, 16, 0.0), math.sqrt(1.0 / per))
            if not self._drives.in_position[axis] or abs(self._drives.lag[axis]) / per > window:
                return False
        return True

    # ---- reference runs ---------------------------------------------------------------------------------------------

    def _home(self, axes: list[int]) -> None:
        self._homing = Homing(
            sorted(axes, reverse=True),
            AXES,
            PERIOD_NS,
            self._now_ns,
            struck=lambda axis: self._struck(axis, 1),
            to_pulse=self._to_pulse,
            done=self._at_reference,
        )
        self._follow(self._homing.run)

    def _to_pulse(self, axis: int) -> int:
        past = 0 if self._drives is None else self._drives.past_zero_pulse[axis] % PULSES
        return (PULSES - past) % PULSES

    def _at_reference(self, axis: int) -> None:
        """An axis stands at its reference point: its position is P12040."""
        self._follow(None)
        place = self._parameters.axis(axis, 40, 0.0)
        value = round(place * self._limits().increments_per_mm[axis])
        self._base = (*self._base[:axis], value, *self._base[axis + 1 :])
        self._events.append(CounterSet(axis, value))
        self._referenced[axis] = True
        self._parameters.write(12_180 + AXIS_SIZE * axis, 1.0)

    def _homed(self) -> None:
        assert self._homing is not None
        failed, self._homing = self._homing.failed, None
        if failed is not None:
            self._say(message(2110, detail="XYZ"[failed]))
            self.fault = True
        self._parameters.write(8_579, float(all(self._referenced)))
        self._parameters.write(8_709, float(all(self._referenced)))

    # ---- programs ---------------------------------------------------------------------------------------------------

    def _written(self, number: int, value: float | None, area: str, channel: int) -> None:
        """A parameter has been written from the line: some are keys."""
        if area != "P" or channel != 1:
            return
        given = int(value or 0)
        if number in (8_683, 8_703):
            self._set_mode(given)
        elif number in (8_684, 8_704):
            self._start() if given else self._channel.stop(self._now_ns)
        elif number == 8_682 and given:
            self._start() if given == 2 else self._channel.stop(self._now_ns)
        elif number == 8_705 and given:
            self._channel.abort(self._now_ns)
            self._parameters.write(8_705, 0.0)
        elif number == 8_752:
            self._jog_key(given)
        elif number == 11_181:
            self._put_out(given)
        elif number == 8_508:
            self.messages.clear()
        elif number == 11_310:
            self._channel.set_override(min(max(value or 0.0, 0.0), 120.0) / 100.0, self._now_ns)
        elif 12_000 <= number < 12_000 + AXIS_SIZE * AXES and (number - 12_000) % AXIS_SIZE == 130 and given:
            self._parameters.write(number, 0.0)
            self._reference((number - 12_000) // AXIS_SIZE)

    def _put_out(self, kind: int) -> None:
        """P11181: all parameters as a file, 5 with their status."""
        self._parameters.write(11_181, 0.0)
        for number in NUMBERS:
            if (now := self._cell(number)) is not None:
                self._parameters.write(number, now)
        text = "\r\n" + parameter_file(self._parameters, status=kind == 5)
        self._events.append(Reply(text.encode() + bytes([int(self._parameters.given(11_177, 4.0)) & 0xFF]) + b"\r\n"))

    def _jog_key(self, key: int) -> None:
        """P8752: 1 and 2 begin a move in HAND, 0 ends it."""
        if self._jog is not None:
            self._jog.release(self._now_ns)
            self._follow(self._jog.run)
        if key not in (1, 2) or self._jog is not None:
            return
        if self.mode is not Mode.HAND or self._channel.active or self._homing is not None:
            self._say(message(1321, detail="a key of an axis"))
            return
        self._jog_sign = 1 if key == 1 else -1
        if self._enabled and self._ready:
            self._begin_jog()
        else:
            self._request_power()

    def _begin_jog(self) -> None:
        sign, self._jog_sign = self._jog_sign, 0
        try:
            jog = Jog(self._parameters, self._limits(), self.counts, sign, PERIOD_NS, self._now_ns)
        except ProgramError as error:
            self._say(message(error.number, detail=error.detail, effect=Effect.SHOWN))
            return
        if self._struck(jog.axis, 2 if sign > 0 else 1):
            self._say(message(2101 if sign > 0 else 2102, detail="XYZ"[jog.axis]))
            return
        self._jog = jog
        self._follow(self._jog.run)

    def _reference(self, axis: int) -> None:
        if self.mode is not Mode.HAND or self._channel.active or self._jog is not None:
            self._say(message(1321, detail="a reference run"))
            return
        if self._homing is not None:
            self._say(message(1321, detail="a reference run is under way"))
            return
        self._wants.append(axis)
        if self._power_until_ns is None:
            self._request_power()

    def _set_mode(self, given: int) -> None:
        try:
            mode = Mode(given)
        except ValueError:
            self._say(message(1322, detail=f"mode {given}; allowed: 1, 2, 4, 8"))
            return
        if Mode.POSITIONING in (mode, self.mode) and Mode.HAND not in (mode, self.mode) and mode is not self.mode:
            self._say(message(1009))
            return
        if mode is Mode.HAND:
            self._channel.abort(self._now_ns)
            self.messages.clear()
            self.fault = False
            self._output("message", 0)
        if self._jog is not None:
            self._jog.release(self._now_ns, everything=True)
        self.mode = mode
        self._channel.single = mode is Mode.SINGLE

    def _start(self) -> None:
        """Start: the program of P8800, or on with the one that is held."""
        if self._channel.active:
            self._channel.go_on(self._now_ns)
            return
        if self.mode is Mode.HAND:
            self._say(message(1322, detail="Start"))
            return
        if not all(self._referenced):
            missing = "".join(name for name, known in zip("XYZ", self._referenced, strict=True) if not known)
            self._say(message(1008, detail=missing))
            return
        self._starts = True
        if self._enabled and self._ready:
            self._starts = False
            self._begin_program()
        else:
            self._request_power()

    def _begin_program(self) -> None:
        p = self._parameters
        positioning = self.mode is Mode.POSITIONING
        name = POSITIONED if positioning else f"P{int(p.get(8_800))}"
        block = None if positioning else int(p.get(8_801)) or None
        self.fault = False
        try:
            again = bool(p.get(8_804) and p.get(8_802))
            self._began_at = self._began_at if again else self._position
            self._interpreter.begin(name, self._began_at, block, bool(p.get(8_810)))
            if again:
                find(
                    self._interpreter,
                    f"P{int(p.get(8_802))}",
                    int(p.get(8_803)),
                    self._position,
                    self._parameters.write,
                )
                p.write(8_804, 0.0)
        except ProgramError as error:
            self._say(message(error.number, program=name, detail=error.detail))
            return
        self._channel.single = self.mode is Mode.SINGLE
        self._channel.start(self._now_ns)

    @property
    def _position(self) -> tuple[float, ...]:
        per_mm = self._limits().increments_per_mm
        return tuple(count / per for count, per in zip(self.counts, per_mm, strict=True))

    def _block_begun(self, t_ns: int, block: PathBlock) -> None:
        stored = self._store.get(block.program)
        text = "" if stored is None else stored.after(block.number)
        run = self._shown
        way = (0,) * AXES if run is None else run.displacement(t_ns)
        counts = tuple(b + m for b, m in zip(self._base, way, strict=True))
        plane = (block.plane.first, block.plane.second)
        self._events.append(Step(t_ns, f"{block.program} N{block.number}", text, counts, plane, block.tool_mm))

    def _program_ended(self, broken: tuple[str, int] | None) -> None:
        """M30, or the last block: None; or broken off in a block."""
        name, block = broken or ("", 0)
        for number, value in ((8_802, name[1:]), (8_803, block), (8_906, name[1:]), (8_907, block)):
            self._parameters.write(number, float(value or 0))

    # ---- what it tells about itself ---------------------------------------------------------------------------------

    def _cell(self, number: int) -> float | None:
        return cell(number, self._interpreter, self._channel, self, AXES)

    def set_mm(self, axis: int) -> float:
        """Set position of an axis, mm."""
        return self._position[axis]

    def actual_mm(self, axis: int) -> float:
        """Measured position of an axis, mm."""
        drives, per_mm = self._drives, self._limits().increments_per_mm[axis]
        return self.set_mm(axis) if drives is None else drives.encoder[axis] / per_mm

    def speed_mm_s(self, axis: int) -> float:
        """Speed of an axis, mm/s, of its set points."""
        run = self.run
        if run is None or not (tick := run.count(self._now_ns)) or self._now_ns >= run.end_ns + PERIOD_NS:
            return 0.0
        way = int(run.plan.deltas(tick - 1, tick)[0, axis])
        return way / self._limits().increments_per_mm[axis] / (PERIOD_NS / SECOND_NS)

    def _limits(self) -> Limits:
        p = self._parameters
        per_mm = [
            positive(p.axis(a, 12, 0.0), INCREMENTS_PER_MM) / positive(p.axis(a, 13, 0.0), 1.0) for a in range(AXES)
        ]
        return Limits.of(p, per_mm)

    def _allowed(self, block: PathBlock) -> str:
        """Software limits (P12030, P12031), and switches that are struck already."""
        p = self._parameters
        for axis in range(AXES):
            extents = [element.extent(axis) for element in block.elements]
            if not extents:
                continue
            low, high = min(e[0] for e in extents), max(e[1] for e in extents)
            here = block.elements[0].start[axis]
            highest, lowest = 12_030 + AXIS_SIZE * axis, 12_031 + AXIS_SIZE * axis
            if p.loaded(highest) and high > p.get(highest):
                return f"2103 {'XYZ'[axis]}"
            if p.loaded(lowest) and low < p.get(lowest):
                return f"2104 {'XYZ'[axis]}"
            if high > here and self._struck(axis, 2):
                return f"2101 {'XYZ'[axis]}"
            if low < here and self._struck(axis, 1):
                return f"2102 {'XYZ'[axis]}"
        return ""

    def _struck(self, axis: int, end: int) -> bool:
        """Whether the switch at the motor's end (1) or the far end (2) of an axis is struck."""
        return not self._levels.get(f"limit_{'xyz'[axis]}{end}", True)

    def _function(self, function: Machine) -> None:
        self._plc.function(self._now_ns, function.code)

    # ---- messages ---------------------------------------------------------------------------------------------------

    def _say(self, said: Message) -> None:
        """A message: shown, kept in the history, and what it does."""
        self.messages.append(said)
        del self.messages[:-MOST_MESSAGES]
        self.history.append((self._now_ns, said))
        del self.history[:-MOST_MESSAGES]
        self._parameters.write(8_501 if said.effect is not Effect.SHOWN else 8_503, float(said.number))
        if said.program:
            self._parameters.write(8_910, float(said.program[1:]))
            self._parameters.write(8_911, float(said.block))
        if said.effect is not Effect.SHOWN:
            self.fault = True
        self._output("message", said.number)
        self._events.append(Remark(str(said)))

    def _show(self, text: object) -> None:
        """A text of the program for the operator."""
        words = getattr(text, "text", None)
        if words:
            self._events.append(Remark(f"{self._channel.block[0]} N{self._channel.block[1]}: {words}"))
