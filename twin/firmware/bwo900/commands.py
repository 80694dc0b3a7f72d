"""Parameters that act as keys: requests by the line, a panel key or the program (manual 8.4).

    written(P8684, 1) --> keys.wish --> START --> operating.py
                                        STOP, ABORT, MODE, MOVE, REFERENCE, OVERRIDE ...

A program's request waits until the channel is at rest (`answer`).
"""

from __future__ import annotations

from isel_twin.controller import Reply
from isel_twin.firmware.bwo900 import keys
from isel_twin.firmware.bwo900.execution import Execution
from isel_twin.firmware.bwo900.keys import Wish
from isel_twin.firmware.bwo900.messages import Code, Effect, ProgramError, message
from isel_twin.firmware.bwo900.modes import Mode
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.operating import Operating
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime import spindle as of_spindle
from isel_twin.firmware.bwo900.realtime.axes import AXES
from isel_twin.firmware.bwo900.realtime.jog import step_on
from isel_twin.firmware.bwo900.status import NUMBERS
from isel_twin.firmware.bwo900.transfer import end_of_file, parameter_file, table_file


class Commands:
    def __init__(self, operating: Operating, execution: Execution, store: Store) -> None:
        self._operating, self._execution, self._store = operating, execution, store
        self._parameters = execution.parameters

    def answer(self) -> None:
        """Carry out the requests of the program."""
        asked = self._execution.asked
        while asked:
            self.written(*asked.pop(0), "P", 1)

    def written(self, number: int, value: float | None, area: str, channel: int) -> None:
        """Take a written parameter, which may act as a key if written as P; a write to its q is part of a backup."""
        p = self._parameters
        if area == "P" and channel == 1:
            self._execution.deletion.written(number, value)
            self._execution.interpreter.command(number, value, in_hand=self._execution.mode is Mode.HAND)
        known = p.of_channel(number) if area == "q" else number if channel == 1 else None
        wanted = None if known is None else keys.wish(known, value, AXES)
        if wanted is None or (area == "q" and wanted[0] is not Wish.OVERRIDE):
            return
        wish, given = wanted
        if wish in (Wish.PUT_OUT, Wish.REFERENCE):
            p.write(number, 0.0)
        self._carry_out(wish, given)
        if wish in (Wish.ABORT, Wish.CLEAR):
            p.write(number, 0.0)

    def _carry_out(self, wish: Wish, given: float) -> None:
        operating, p = self._operating, self._parameters
        match wish:
            case Wish.MODE:
                operating.set_mode(int(given))
            case Wish.START:
                operating.start()
            case Wish.STOP:
                operating.stop()
            case Wish.ABORT:
                operating.abort()
            case Wish.MOVE:
                operating.move(int(given))
            case Wish.PUT_OUT:
                self._put_out(int(given))
            case Wish.CLEAR:
                self._execution.hardware.outgoing.acknowledge()
            case Wish.OVERRIDE:
                overrides.written(p, int(given))
                operating.override_changed()
            case Wish.FUNCTION:
                operating.send_function(int(given))
            case Wish.NEXT_STEP:
                step_on(p)
            case Wish.LOCK:
                operating.lock()
            case Wish.FEED:
                self._execution.channel.path.set_feed(given)
            case Wish.EMERGENCY:
                operating.call_emergency(int(given))
            case Wish.MAP:
                p.write(P.MAP_Q, self._mapped(int(given)))
            case Wish.LENGTH:
                p.write(P.LENGTH, 0.0)
            case Wish.CHANGE:
                operating.change_tool(int(given))
            case Wish.REFERENCE:
                operating.refer(int(given))
            case Wish.SET:
                operating.set_place(int(given))
            case Wish.PLACE:
                operating.place(int(given))

    def _mapped(self, number: int) -> float | None:
        """P8553: the q of a P; None: no such P."""
        try:
            return float(self._parameters.address("P", number))
        except ProgramError:
            return None

    def _put_out(self, kind: int) -> None:
        """P11181: send all parameters as a file; 5: with their status."""
        p = self._parameters
        assert p.live is not None
        self._execution.rest()
        numbers = (*NUMBERS, *(of_spindle.NUMBERS if p.has_spindle else ()))
        for number, value in [(number, p.live(number)) for number in numbers]:
            p.write(number, value)
        self._reply(parameter_file(p, status=kind == 5))

    def put_out_programs(self, number: int) -> None:
        """Send a program P as a file; 0: all programs and cycles in one."""
        names = [f"P{number}"] if number else sorted(self._store)
        if number and names[0] not in self._store:
            self._execution.say(message(Code.NO_PROGRAM, detail=names[0], effect=Effect.SHOWN))
        else:
            self._reply("".join(self._store[name].file for name in names))

    def put_out_table(self, kind: str) -> None:
        """Send the tool table (W) or the zero points (N) as a file."""
        self._reply(table_file(self._parameters, kind))

    def _reply(self, text: str) -> None:
        file = text.encode("latin-1", errors="replace") + bytes([end_of_file(self._parameters)])
        self._execution.hardware.outgoing.add(Reply(b"\r\n" + file + b"\r\n"))
