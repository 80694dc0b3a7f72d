"""The control: host, inputs and clock. Implements `isel_twin.controller.Controller`.

bytes     files of programs and parameters (transfer.py); some parameters are keys, as for a PLC (commands.py)
keys      of the operator (keys.py)
inputs    start, stop, E-stop, limit switches, hood, key
outputs   stages, brake, spindle, coolant ...: a0.0 on, of the PLC
run       set points of the channel, or of a move in hand
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from isel_twin.controller import Arrival, DriveInput, Drives, Event, Key, KeyValue, Reply, SerialFormat
from isel_twin.firmware.bwo900 import keys, memory
from isel_twin.firmware.bwo900.commands import Commands
from isel_twin.firmware.bwo900.execution import Execution
from isel_twin.firmware.bwo900.hardware import Hardware
from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.messages import Code, Effect, Message, message
from isel_twin.firmware.bwo900.modes import Mode
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.operating import Operating
from isel_twin.firmware.bwo900.ports import TERMINALS, serial_format
from isel_twin.firmware.bwo900.readings import Readings
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES
from isel_twin.firmware.bwo900.realtime.deletion import PROBE
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.firmware.bwo900.status import at_power_on
from isel_twin.firmware.bwo900.transfer import Receiver
from isel_twin.motion import SetPointRun


class Control:
    """Implements isel_twin.controller.Controller, UsesDrives, AwaitsArrival, NamesOutputs, HasKeys, EndsPrograms and
    HoldsHost."""

    direction = (1,) * AXES
    output_names: Sequence[str] = (*MachinePlc.OUTPUTS, "spindle_speed", "drive_reset", "auto", "active", "message")

    def __init__(
        self,
        flash: bytes | None,
        *,
        plc: str | None = None,
        memory_bytes: int = 0,
        readings: Readings = Readings(),  # noqa: B008 -- frozen
    ) -> None:
        """flash: stored programs and parameters. plc: STEP 5 text in place of the default program. memory_bytes: of all
        programs; 0: as many as there are."""
        self._parameters, store, self._flash_fault = memory.read(flash)
        self._parameters.readings = readings
        self._hardware = hardware = Hardware(self._parameters, plc)
        self._axes, self._power, self._hand = hardware.axes, hardware.power, hardware.hand
        self._plc, self._outgoing = hardware.plc, hardware.outgoing
        self._execution = Execution(hardware, store, memory.Memory(self._parameters, store))
        self._channel, self._feeder = self._execution.channel, self._execution.feeder
        self._operating = Operating(self._execution)
        self._commands = Commands(self._operating, self._execution, store)
        self._receiver = Receiver(self._parameters, store, self._commands.written, self._execution.locked, memory_bytes)

    # ---- state ------------------------------------------------------------------------------------------------------

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
        return bool(self.fault_cause)

    @property
    def fault_cause(self) -> str:
        """The last message that is a fault; one that HAND has cleared while its cause stands, too."""
        if self._outgoing.fault_cause:
            return self._outgoing.fault_cause
        return "emergency stop" if not self._hardware.levels.get("estop", True) else ""

    @property
    def messages(self) -> list[Message]:
        """The uncleared messages, the newest last."""
        return self._outgoing.standing

    @property
    def history(self) -> list[tuple[int, Message]]:
        """All messages with their times in ns."""
        return self._outgoing.history

    @property
    def next_ns(self) -> int | None:
        return self._next_ns(self._channel.next_ns)

    @property
    def arrival(self) -> Arrival | None:
        first_ns, until_ns = self._channel.next_ns, self._next_ns(self._channel.settles_until_ns)
        if self._channel.settles_until_ns is None or first_ns is None or until_ns is None:
            return None
        return Arrival(first_ns, PERIOD_NS, until_ns)

    def _next_ns(self, channel_ns: int | None) -> int | None:
        """When something is due. channel_ns: in the channel."""
        times = [channel_ns, self._plc.next_ns, self._power_due_ns, self._hand.next_ns]
        times += [self._axes.next_look_ns, self._hardware.spindle.next_ns]
        if self.run is not None and self._channel.run is None and self._hand.move is None:
            times.append(self.run.end_ns)
        known = [t for t in times if t is not None]
        return max(min(known), self._axes.now_ns) if known else None

    @property
    def idle(self) -> bool:
        works = (self._channel.active and not self._channel.held) or self._hand.move is not None
        return not works and self._power_due_ns is None and self._plc.idle

    @property
    def mode(self) -> Mode:
        return self._execution.mode

    @property
    def unfinished(self) -> str:
        return self._execution.unfinished

    @property
    def clear_to_send(self) -> bool:
        return self._feeder.clear_to_send

    @property
    def keys(self) -> Mapping[str, Key]:
        return keys.KEYS

    @property
    def key_values(self) -> Mapping[str, KeyValue]:
        return keys.values(self._parameters, self.mode, self._channel.path.override)

    @property
    def _power_due_ns(self) -> int | None:
        """Time limit of the wait for the drives; None: no wait, or until the end of the file that needs them."""
        return None if self._receiver.busy else self._power.until_ns

    # ---- inputs -----------------------------------------------------------------------------------------------------

    def power_on(self, t_ns: int, levels: Mapping[str, bool]) -> None:
        self._axes.now_ns = t_ns
        self._hardware.spindle.look_for()
        self._hardware.levels.clear()
        self._hardware.levels.update(levels)
        self._parameters.write(1, float(AXES), "q")
        for number, value in at_power_on():
            self._parameters.write(number, value)
        self._outgoing.acknowledge()
        self._outgoing.output("software_ok", 1)
        if self._flash_fault:
            self._outgoing.output("flash_fault", 1)
        for terminal, level in levels.items():
            self._plc.set_input(t_ns, terminal, level)
        self._plc.power_on(t_ns)
        self._operating.override_changed()
        self._show_status()

    def receive(self, t_ns: int, data: bytes) -> None:
        self.advance(t_ns)
        for error in self._receiver.take(data):
            if lost := self._feeder.failed:
                self._hardware.say(message(error.number, program=lost, detail=error.detail, infos=error.infos))
                self._channel.abort()
                self._feeder.end()
            else:
                said = message(error.number, detail=error.detail, infos=error.infos, effect=Effect.SHOWN)
                self._hardware.say(said)
                if error.number != Code.PROGRAM_OVERWRITTEN:
                    self._outgoing.fault_cause = self._outgoing.fault_cause or str(said)
        if self._receiver.changed and not self._receiver.busy:
            self._receiver.changed = False
            self._execution.keep()
        self._settle()

    def press(self, t_ns: int, name: str, value: KeyValue) -> None:
        self.advance(t_ns)
        if name == keys.OUTPUT:
            self._commands.put_out_programs(int(value))
            return
        if name == keys.COPY:
            self._commands.put_out_table(keys.COPIES[str(value)])
            return
        for number, wanted in keys.writes(name, value):
            self._parameters.write(number, wanted)
            self._commands.written(number, wanted, "P", 1)
        self._execution.keep()
        self._settle()

    def set_input(self, t_ns: int, terminal: str, level: bool) -> None:
        self._axes.now_ns = t_ns
        levels = self._hardware.levels
        before, levels[terminal] = levels.get(terminal), level
        self._plc.set_input(t_ns, terminal, level)
        if terminal in ("estop", "power") and not level:
            self._operating.lose(Code.EMERGENCY_STOP if terminal == "estop" else Code.DRIVES_OFF)
        elif terminal.startswith("fault"):
            axis = int(terminal[-1])
            self._power.faulty[axis] = level
            if level:
                self._axes.referenced[axis] = False
                self._operating.lose(Code.LAG if self._axes.lags(axis) else Code.DRIVE_FAULT, NAMES[axis])
        elif terminal.startswith("limit") and before and not level:
            self._operating.limit("xyz".index(terminal[6]), int(terminal[7]))
        elif terminal == PROBE:
            self._operating.probed()
        elif terminal == "e0.1" and level and not before:
            self._operating.start()
        elif terminal == "e0.2" and not level and before:
            self._operating.stop()
        self._settle()

    def advance(self, t_ns: int) -> None:
        self._axes.now_ns = t_ns
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

    # ---- progress ---------------------------------------------------------------------------------------------------

    def _settle(self) -> None:
        now_ns = self._axes.now_ns
        if (until_ns := self._power_due_ns) is not None and (self._power.ready or now_ns >= until_ns):
            self._operating.powered()
        self._plc.advance(now_ns)
        self._hand.advance()
        self._channel.advance()
        self._operating.place_at_rest()
        self._operating.start_at_rest()
        self._commands.answer()
        self._axes.follow((self._hand.move or self._channel).run)
        if self._hand.homing is None and (axis := self._axes.late()) is not None:
            self._operating.lose(Code.LAG, NAMES[axis])
        for name, value in self._plc.take().items():
            self._outgoing.output(name, value)
        if self._hardware.spindle.present:
            self._outgoing.output("spindle_speed", self._hardware.spindle.wanted)
        if told := self._feeder.say():
            self._outgoing.add(Reply(told))
        self._show_status()

    def _show_status(self) -> None:
        """Update parameters and outputs about the channel and the line."""
        p, channel = self._parameters, self._channel
        state = 0.0 if not channel.active else 1.0 if channel.held else 2.0
        if p.get(P.PROGRAM_ACTIVE) != state:
            p.write(P.PROGRAM_ACTIVE, state)
            p.write(P.PROGRAM_RUNS, 1.0 if channel.active else 0.0)
        if p.get(P.FED_LEVEL) != self._feeder.level:
            p.write(P.FED_LEVEL, float(self._feeder.level))
        self._outgoing.output("active", int(state))
        self._outgoing.output("moving", int(self.run is not None))
        self._outgoing.output("auto", int(self.mode is not Mode.HAND))
