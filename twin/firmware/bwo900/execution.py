"""The program in execution: its beginning, the effects of its blocks on the control, its end (manual 7.5).

Start --> begin: feeder.py, interpreter, restart --> channel --> ended: place of an interruption, image for the flash
"""

from __future__ import annotations

from typing import Final

from isel_twin.controller import FlashWrite, Remark, Step
from isel_twin.firmware.bwo900 import keys, status
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.analysis.restart import find
from isel_twin.firmware.bwo900.feeder import Feeder
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.hardware import Hardware
from isel_twin.firmware.bwo900.memory import Memory
from isel_twin.firmware.bwo900.messages import MISSING, Code, Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.modes import Mode
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import byte
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.programs.words import Text
from isel_twin.firmware.bwo900.realtime import spindle as of_spindle
from isel_twin.firmware.bwo900.realtime.axes import AXES
from isel_twin.firmware.bwo900.realtime.channel import Channel, State
from isel_twin.firmware.bwo900.realtime.deletion import DeletionWatch
from isel_twin.firmware.bwo900.realtime.executed import Executed
from isel_twin.firmware.bwo900.transfer import POSITIONED

TOOL_CHANGE: Final = "Z6"  # the cycle that changes tools


class Execution:
    """Programs and their channel; implements the `Surroundings` of that channel."""

    def __init__(self, hardware: Hardware, store: Store, memory: Memory) -> None:
        self.hardware, self._store, self._memory = hardware, store, memory
        self.parameters, self.axes, self.plc = hardware.parameters, hardware.axes, hardware.plc
        self.spindle = hardware.spindle
        self.parameters.live = self._value
        self.interpreter = Interpreter(self.parameters, store)
        self.interpreter.on_write = self._ask
        self.executed = Executed(self.interpreter)
        self.deletion = DeletionWatch(self.parameters, hardware.levels, self.axes, self.executed)
        self.channel = Channel(self.interpreter, self)
        self.feeder = Feeder(self.parameters, store)
        self.mode = Mode.HAND
        self.asked: list[tuple[int, float | None]] = []
        """Parameters that the program has written, and that are keys: they act once the channel has come to rest."""
        self._began_at: tuple[float, ...] = (0.0,) * AXES  # positions of the axes at the last start, mm
        self.changes_tool = False  # Z6 is the program: a tool is changed in HAND (P8043)
        self._broken = ""  # where the last program was interrupted, for people; empty: it was not

    @property
    def single(self) -> bool:
        return self.mode is Mode.SINGLE  # bwo900/25

    def write(self, number: int, value: float | None) -> None:
        self.parameters.write(number, value)
        self.deletion.written(number, value)
        self._ask(number, value)

    def say(self, said: Message) -> None:
        self.hardware.say(said)

    def show(self, text: Text) -> None:
        program, block = self.executed.place
        if text.text:
            self.hardware.outgoing.add(Remark(f"{program} N{block}: {text.text}"))

    def begun(self, t_ns: int, block: PathBlock) -> None:
        place, text = f"{block.program} N{block.number}", self._store.text(block.program, block.number)
        plane = (block.plane.first, block.plane.second)
        self.hardware.outgoing.add(Step(t_ns, place, text, self.axes.counts_at(t_ns), plane, block.tool_mm))

    def ended(self, broken: tuple[str, int] | None) -> None:
        p = self.parameters
        if broken is not None:
            self.plc.forget()
        self.feeder.end()
        if p.get(P.RESTART_STATE):
            p.write(P.RESTART_STATE, 0.0)
        if self.changes_tool and broken is None:
            self.asked.append((P.MODE_TO_PLC, float(Mode.HAND)))
        self.changes_tool = False
        self.rest()
        name, block = broken or ("", 0)
        self._broken = f"{name} N{block} is broken off" if broken else ""
        for program, number in ((P.BROKEN_PROGRAM, P.BROKEN_BLOCK), (P.ABORTED_PROGRAM, P.ABORTED_BLOCK)):
            p.write(program, float(name[1:] or 0))
            p.write(number, float(block))
        self.keep()

    def _ask(self, number: int, value: float | None) -> None:
        """Take a parameter P written by the program: one that acts as a key waits for `answer`."""
        if keys.wish(number, value, AXES) is not None:
            self.asked.append((number, value))

    @property
    def program(self) -> str:
        """Name of the program that Start begins."""
        return f"P{int(self.parameters.get(P.PROGRAM))}"

    @property
    def unfinished(self) -> str:
        """Why the last program did not reach its end; empty: it did."""
        if self.channel.held:
            program, number = self.executed.place
            wanted = "Start" if self.channel.path.override > 0.0 else "an override above 0 %"
            if self.channel.path.locked:
                wanted = "its release (P8701, P8702)"
            return f"{program} N{number} waits for {wanted}"
        if self.channel.state is State.SPINDLE:
            program, number = self.executed.place
            return f"{program} N{number} waits for the spindle, which turns at {self.spindle.measured:.0f} 1/min"
        return self._broken

    @property
    def hand_is_free(self) -> bool:
        """True if axes may be moved without a program."""
        return self.mode is Mode.HAND and not self.channel.active and not self.channel.path.locked

    def begin(self) -> None:
        """Begin the program of P8800, or the positioning block."""
        p = self.parameters
        positioning = self.mode is Mode.POSITIONING
        name = POSITIONED if positioning else self.program
        block = None if positioning else int(p.get(P.START_BLOCK)) or None
        emergency = self._emergency()
        if self.changes_tool:
            emergency = TOOL_CHANGE, None
        if emergency is not None:
            name, block = emergency
            self.forget_emergencies()
        self.hardware.outgoing.fault_cause = ""
        try:
            again = bool(p.get(P.RESTART) and p.get(P.BROKEN_PROGRAM)) and emergency is None
            if not positioning and emergency is None:
                self.feeder.start(name, from_the_middle=again or block is not None)
            self._began_at = self._began_at if again else self.axes.position
            self.interpreter.begin(name, self._began_at, block, bool(p.get(P.SKIP)))
            if again:
                broken = f"P{int(p.get(P.BROKEN_PROGRAM))}", int(p.get(P.BROKEN_BLOCK))
                find(self.interpreter, *broken, self.axes.position, p.write)
        except ProgramError as error:
            self.say(message(error.number, program=name, detail=error.detail))
            return
        self._broken = ""
        self.channel.start()

    def request_tool(self, group: int) -> Message | None:
        """P8043: the data of a tool go to the records of PLC and real time, and Z6, if there is one, is the next
        program; or the message that it cannot be."""
        p = self.parameters
        try:
            if p.get(P.HAND_SUB_RECORD) > 1.0:
                raise ProgramError(Code.EXCLUDED, f"{MISSING}: sub records of tools, and P8044 is not 0 or 1")
            self.interpreter.request_tool(group)
        except ProgramError as error:
            return message(error.number, detail=error.detail, effect=Effect.SHOWN)
        self.changes_tool = TOOL_CHANGE in self._store
        return None

    def missing_emergency(self, which: int) -> Message | None:
        """The message that an emergency program (0 or 1) is not in the memory, or nothing; then it is not called."""
        name = f"P{int(self.parameters.get(P.EMERGENCY_PROGRAM + 2 * which))}"
        if name in self._store:
            return None
        self.forget_emergencies()
        return message(Code.NO_EMERGENCY_PROGRAM, program=name)

    def forget_emergencies(self) -> None:
        """No emergency program is called any more."""
        for number in (P.EMERGENCY_1, P.EMERGENCY_2):
            if self.parameters.get(number):
                self.parameters.write(number, 0.0)

    def _emergency(self) -> tuple[str, int | None] | None:
        """Program and block of the emergency program that is called."""
        p = self.parameters
        for which in (0, 1):
            if p.get(P.EMERGENCY_1 + which) == 1.0:
                first = P.EMERGENCY_PROGRAM + 2 * which
                return f"P{int(p.get(first))}", int(p.get(first + 1)) or None
        return None

    def rest(self) -> None:
        """Set the coordinates of HAND without a program."""
        if self.hand_is_free:
            self.interpreter.hand(self.axes.position)

    def keep(self) -> None:
        """Write programs and parameters to the flash."""
        self.hardware.outgoing.add(FlashWrite(self._memory.image()))

    def locked(self, name: str) -> bool:
        """True for a program that was analysed for the one in execution; with P8806, byte 2, bit 0 only if it is
        open."""
        if not self.channel.active:
            return False
        only_open = byte(self.parameters.get(P.START_FLAGS_1), 2) & 1
        return name in (self.interpreter.stack.open if only_open else self.interpreter.stack.opened)

    def _value(self, number: int) -> float | None:
        if number in of_spindle.NUMBERS:
            return self.spindle.value(number)
        return status.value(number, self.interpreter, self.channel, self.axes)
