"""The control: host, inputs and clock. Implements `isel_twin.controller.Controller`.

    bytes     files of programs and parameters (transfer.py); some parameters are keys, as for a PLC (keys.py)
    keys      of the operator (keys.py)
    inputs    start, stop, E-stop, limit switches, hood, key
    outputs   stages, brake, spindle, coolant ...: a0.0 on, of the PLC
    run       set points of the channel, or of a move in hand

    power.py      drives on and off        axes.py   where the axes stand     hand.py   moves without a program
    outgoing.py   events and messages      channel.py   the program           feeder.py   programs that are fed
    operating.py  modes, Start, Stop, and what else the operator asks for

Modes: HAND 1, AUTO 2, single block 4, positioning 8. A program starts in AUTO or single block, with all axes referenced
and the drives on.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Final

from isel_twin.controller import (
    DriveInput,
    Drives,
    Event,
    FlashWrite,
    Key,
    KeyValue,
    Remark,
    Reply,
    SerialFormat,
    Step,
)
from isel_twin.firmware.bwo900 import keys, memory
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.feeder import Feeder
from isel_twin.firmware.bwo900.geometry.blocks import Machine, PathBlock
from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.messages import Code, Effect, Message, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.operating import Mode, Operating
from isel_twin.firmware.bwo900.parameters import byte
from isel_twin.firmware.bwo900.ports import TERMINALS, serial_format
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes
from isel_twin.firmware.bwo900.realtime.channel import Channel, Phase
from isel_twin.firmware.bwo900.realtime.hand import Hand
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing
from isel_twin.firmware.bwo900.realtime.power import Power
from isel_twin.firmware.bwo900.realtime.services import Services
from isel_twin.firmware.bwo900.realtime.watch import PROBE, Watch
from isel_twin.firmware.bwo900.status import at_power_on, cell, in_force, shown
from isel_twin.firmware.bwo900.transfer import Receiver
from isel_twin.motion import SetPointRun

OVERWRITTEN: Final = Code.PROGRAM_OVERWRITTEN
"""Message of a file that is taken, and replaces one."""


class Control:
    """Implements isel_twin.controller.Controller, UsesDrives, NamesOutputs, HasKeys, EndsPrograms and HoldsHost."""

    direction = (1,) * AXES
    output_names: Sequence[str] = (*MachinePlc.OUTPUTS, "drive_reset", "auto", "active", "message")

    def __init__(self, flash: bytes | None, *, plc: str | None = None) -> None:
        """flash: programs and parameters that were kept. plc: STEP 5 text in place of the default program."""
        self._parameters, self._store, self._flash_fault = memory.read(flash)
        self._memory = memory.Memory(self._parameters, self._store)
        self._parameters.live = self._cell
        self._interpreter = Interpreter(self._parameters, self._store)
        self._plc = MachinePlc(plc)
        self._receiver = Receiver(self._parameters, self._store, self._written, self._locked)
        self._feeder = Feeder(self._parameters, self._store)
        self._levels: dict[str, bool] = {}
        """Of the inputs."""
        self._outgoing = Outgoing(self._parameters)
        self._axes = Axes(self._parameters, self._levels)
        self._power = Power(self._levels, AXES, self._outgoing)
        self._hand = Hand(self._parameters, self._axes, self._outgoing)
        self._watch = Watch(self._parameters, self._levels, self._places, self._executed)
        self._channel = Channel(self._interpreter, self._services(), partial(memory.filters, self._parameters))
        self._now_ns = 0
        self._operating = Operating(
            self._parameters,
            self._store,
            interpreter=self._interpreter,
            channel=self._channel,
            outgoing=self._outgoing,
            axes=self._axes,
            power=self._power,
            hand=self._hand,
            feeder=self._feeder,
            watch=self._watch,
            function=self._send,
        )
        self._interpreter.on_write = self._operating.ask

    def _services(self) -> Services:
        return Services(
            function=self._function,
            acknowledged=self._acknowledged,
            room=self._room,
            withdraw=self._plc.withdraw,
            speed=self._plc.speed,
            tool=self._plc.tool,
            parameter=self._write,
            say=self._say,
            text=self._show,
            unsettled=self._axes.unsettled,
            settling_ns=self._axes.settling_ns,
            limits=self._axes.limits,
            counts=self._counts,
            begun=self._block_begun,
            ended=self._program_ended,
            option=self._option,
            watch=self._watch,
            allowed=self._axes.allowed,
        )

    def _locked(self, name: str) -> bool:
        """A program that is, or has been, analysed for the one under way; with P8806, byte 2, bit 0 it must be open."""
        if not self._channel.active:
            return False
        only_open = byte(self._parameters.get(P.START_FLAGS_1), 2) & 1
        return name in (self._interpreter.open if only_open else self._interpreter.opened)

    def _acknowledged(self) -> bool:
        return self._plc.idle

    def _room(self) -> bool:
        return self._plc.room

    def _counts(self) -> tuple[int, ...]:
        return self._axes.counts

    def _places(self) -> list[tuple[float, float]]:
        """Of each axis, mm: where it is, in the machine and on the display."""
        frame = in_force(self._interpreter, self._channel)
        return [(mm, mm - shown(axis, frame)) for axis, mm in enumerate(map(self._axes.actual_mm, range(AXES)))]

    def _executed(self) -> tuple[str, int]:
        return self._channel.block

    def _written(self, number: int, value: float | None, area: str, channel: int) -> None:
        self._operating.written(number, value, area, channel)

    def _program_ended(self, broken: tuple[str, int] | None) -> None:
        if broken is not None:
            self._plc.forget()
        self._operating.ended(broken)
        self._outgoing.add(FlashWrite(self._memory.image()))

    def _write(self, number: int, value: float | None) -> None:
        """A parameter that a block writes as it is executed."""
        self._parameters.write(number, value)
        self._watch.written(number, value)
        self._operating.ask(number, value)

    def _option(self, number: int) -> int:
        return int(self._parameters.get(number))

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def serial_format(self) -> SerialFormat:
        return serial_format(self._parameters)

    @property
    def counts(self) -> tuple[int, ...]:
        return self._axes.counts

    @property
    def run(self) -> SetPointRun | None:
        return self._axes.run

    @property
    def fault(self) -> bool:
        return self._outgoing.fault

    @property
    def messages(self) -> list[Message]:
        """Those that stand, the newest last."""
        return self._outgoing.standing

    @property
    def history(self) -> list[tuple[int, Message]]:
        """What has been said, and when, ns."""
        return self._outgoing.history

    @property
    def next_ns(self) -> int | None:
        times = [self._channel.next_ns, self._plc.next_ns, self._power_due_ns]
        if self._hand.homing is not None:
            times.append(self._hand.homing.next_ns)
        if self._hand.jog is not None:
            times.append(self._hand.jog.next_ns)
        times.append(self._axes.next_look_ns)
        if self.run is not None and self._channel.run is None and self._hand.move is None:
            times.append(self.run.end_ns)
        known = [t for t in times if t is not None]
        return max(min(known), self._now_ns) if known else None

    @property
    def idle(self) -> bool:
        held = self._channel.phase is Phase.HELD
        working = self._channel.active and not held
        asked = self._power_due_ns is not None or not self._plc.idle
        return not (working or self._hand.move is not None or asked)

    @property
    def mode(self) -> Mode:
        return self._operating.mode

    @property
    def unfinished(self) -> str:
        return self._operating.unfinished

    @property
    def clear_to_send(self) -> bool:
        return self._feeder.clear_to_send

    @property
    def keys(self) -> Mapping[str, Key]:
        return keys.KEYS

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        return keys.values(self._parameters, self.mode, self._channel.override)

    # ---- what happens -----------------------------------------------------------------------------------------------

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._at(t_ns)
        self._levels.clear()
        self._levels.update(levels)
        self._parameters.write(1, float(AXES), "q")
        for number, value in at_power_on(AXES):
            self._parameters.write(number, value)
        self._outgoing.acknowledge()
        self._outgoing.output("software_ok", 1)
        if self._flash_fault:
            self._outgoing.output("flash_fault", 1)
        for terminal, level in levels.items():
            self._plc.set_input(t_ns, terminal, level)
        self._plc.power_on(t_ns)
        self._channel.override = overrides.factor(self._parameters, AXES)
        self._status()

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        for error in self._receiver.take(data):
            if lost := self._feeder.failed:
                self._say(message(error.number, program=lost, detail=error.detail, infos=error.infos))
                self._channel.abort(t_ns)
                self._feeder.end()
                continue
            self._say(message(error.number, detail=error.detail, infos=error.infos, effect=Effect.SHOWN))
            self._outgoing.fault = self.fault or error.number != OVERWRITTEN
        if self._receiver.changed and not self._receiver.busy:
            self._receiver.changed = False
            self._outgoing.add(FlashWrite(self._memory.image()))
        self._settle()

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        self.advance(t_ns)
        if name == keys.OUTPUT:
            self._operating.put_out_programs(int(value))
            return
        for number, wanted in keys.writes(name, value):
            self._parameters.write(number, wanted)
            self._operating.written(number, wanted, "P", 1)
        self._outgoing.add(FlashWrite(self._memory.image()))
        self._settle()

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._at(t_ns)
        before, self._levels[terminal] = self._levels.get(terminal), level
        self._plc.set_input(t_ns, terminal, level)
        if terminal in ("estop", "power") and not level:
            self._lose(Code.EMERGENCY_STOP if terminal == "estop" else Code.DRIVES_OFF)
        elif terminal.startswith("fault"):
            axis = int(terminal[-1])
            self._power.faulty[axis] = level
            if level:
                self._axes.referenced[axis] = False
                self._lose(Code.LAG, "XYZ"[axis])
        elif terminal.startswith("limit") and before and not level:
            self._limit("xyz".index(terminal[6]), int(terminal[7]))
        elif terminal == PROBE:
            self._watch.touched()
        elif terminal == "e0.1" and level and not before:
            self._operating.start()
        elif terminal == "e0.2" and not level and before:
            self._operating.stop()
        self._settle()

    def advance(self, t_ns: int) -> None:
        self._at(t_ns)
        self._settle()

    def take(self) -> list[Event]:
        return self._outgoing.take()

    def terminals(self) -> Mapping[str, tuple[str, ...]]:
        return TERMINALS

    def machine_overrides(self) -> Mapping[str, Any]:
        return {"axes.all.drive": "servo"}

    def drive_inputs(self) -> Sequence[DriveInput]:
        return [DriveInput(f"fault{axis}", axis, "fault") for axis in range(AXES)]

    def use_drives(self, drives: Drives) -> None:
        self._axes.drives = drives

    # ---- going on ---------------------------------------------------------------------------------------------------

    def _at(self, t_ns: int) -> None:
        """It is so late."""
        self._now_ns = self._axes.now_ns = t_ns

    def _settle(self) -> None:
        """Everything that is due now."""
        if (until_ns := self._power_due_ns) is not None and (self._power.ready or self._now_ns >= until_ns):
            self._powered()
        self._plc.advance(self._now_ns)
        self._hand.advance(self._now_ns)
        self._channel.advance(self._now_ns)
        self._operating.start_at_rest()
        self._operating.answer()
        self._axes.follow((self._hand.move or self._channel).run)
        if self._hand.homing is None and (axis := self._axes.late()) is not None:
            self._lose(Code.LAG, "XYZ"[axis])
        for name, value in self._plc.take().items():
            self._outgoing.output(name, value)
        if told := self._feeder.say():
            self._outgoing.add(Reply(told))
        self._status()

    def _status(self) -> None:
        p = self._parameters
        channel = self._channel
        state = 0.0 if not channel.active else 1.0 if channel.phase is Phase.HELD else 2.0
        if p.get(P.PROGRAM_ACTIVE) != state:
            p.write(P.PROGRAM_ACTIVE, state)
            p.write(P.PROGRAM_RUNS, 1.0 if channel.active else 0.0)
        if p.get(P.FED_LEVEL) != self._feeder.level:
            p.write(P.FED_LEVEL, float(self._feeder.level))
        self._outgoing.output("active", int(state))
        self._outgoing.output("moving", int(self.run is not None))
        self._outgoing.output("auto", int(self.mode is not Mode.HAND))

    # ---- power ------------------------------------------------------------------------------------------------------

    @property
    def _power_due_ns(self) -> int | None:
        """Until when the drives are waited for; None: for nothing, or for the end of the file that asks for them."""
        return None if self._receiver.busy else self._power.until_ns

    def _powered(self) -> None:
        """The drives are there, or have not come: what has waited for them begins."""
        power, hand = self._power, self._hand
        power.until_ns = None
        wants, hand.wants = hand.wants, []
        if not power.ready:
            self._operating.starts = False
            self._say(message(power.missing))
            return
        power.switch(on=True)
        if wants:
            hand.begin_homing(wants, self._now_ns)
        elif hand.direction:
            hand.begin_jog(self._now_ns)

    def _lose(self, number: int, detail: str = "") -> None:
        """Drives off, everything ends."""
        moving = self._channel.active or self._hand.move is not None
        said = self._channel.message(number, detail)
        self._operating.starts = False
        self._hand.cut()
        self._channel.cut(self._now_ns)
        self._axes.follow(None)
        self._interpreter.end()
        if self._power.on:
            self._power.switch(on=False)
            self._say(said)
        elif moving:
            self._say(said)

    def _limit(self, axis: int, end: int) -> None:
        """A limit switch is struck: outside of a reference run everything ends."""
        if self._hand.homing is not None or self.run is None:
            return
        self._say(self._channel.message(Code.HARDWARE_LIMIT_LOW if end == 1 else Code.HARDWARE_LIMIT_HIGH, "XYZ"[axis]))
        self._hand.release(self._now_ns, everything=True)
        self._channel.abort(self._now_ns)

    def _block_begun(self, t_ns: int, block: PathBlock) -> None:
        text = self._store.text(block.program, block.number)
        counts = self._axes.counts_at(t_ns)
        plane = (block.plane.first, block.plane.second)
        self._outgoing.add(Step(t_ns, f"{block.program} N{block.number}", text, counts, plane, block.tool_mm))

    def _function(self, function: Machine) -> None:
        self._send(function.code)

    def _send(self, code: int) -> None:
        """An M function to the PLC."""
        self._plc.function(self._now_ns, code)

    # ---- what it tells about itself ---------------------------------------------------------------------------------

    def _cell(self, number: int) -> float | None:
        return cell(number, self._interpreter, self._channel, self._axes)

    def _say(self, said: Message) -> None:
        self._outgoing.say(self._now_ns, said)

    def _show(self, text: object) -> None:
        """A text of the program for the operator."""
        words = getattr(text, "text", None)
        if words:
            self._outgoing.add(Remark(f"{self._channel.block[0]} N{self._channel.block[1]}: {words}"))
