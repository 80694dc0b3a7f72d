"""Operating: modes, Start and Stop, what keys and parameters that are keys ask for (manual 7.5, 8.4).

    written(P8684, 1) --> keys.wish --> START --> power, nothing moves in HAND any more --> interpreter, channel
                                        STOP, ABORT, MODE, MOVE, REFERENCE, OVERRIDE ...

A parameter may be written by the line, a key, or the program that is carried out; what a program asks for waits until
the channel has come to rest (`ask`, `answer`).
"""

from __future__ import annotations

from collections.abc import Callable
from enum import IntEnum
from typing import Final

from isel_twin.controller import Reply
from isel_twin.firmware.bwo900 import keys
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.analysis.restart import find
from isel_twin.firmware.bwo900.feeder import Feeder
from isel_twin.firmware.bwo900.messages import Code, Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes
from isel_twin.firmware.bwo900.realtime.channel import Channel, Phase
from isel_twin.firmware.bwo900.realtime.hand import Hand
from isel_twin.firmware.bwo900.realtime.jog import step_on
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing
from isel_twin.firmware.bwo900.realtime.power import Power
from isel_twin.firmware.bwo900.realtime.watch import Watch
from isel_twin.firmware.bwo900.status import NUMBERS
from isel_twin.firmware.bwo900.transfer import end_of_file, parameter_file

POSITIONED: Final = "P0"
"""The program whose first block a positioning block is."""


class Mode(IntEnum):
    """P8683, P8703."""

    HAND = 1
    AUTO = 2
    SINGLE = 4
    POSITIONING = 8


class Operating:
    """What the operator has put the control to, and what is done about it."""

    def __init__(
        self,
        parameters: Parameters,
        store: Store,
        *,
        interpreter: Interpreter,
        channel: Channel,
        outgoing: Outgoing,
        axes: Axes,
        power: Power,
        hand: Hand,
        feeder: Feeder,
        watch: Watch,
        function: Callable[[int], None],
    ) -> None:
        """function: sends an M function to the PLC."""
        self._parameters, self._store = parameters, store
        self._interpreter, self._channel, self._outgoing, self._axes = interpreter, channel, outgoing, axes
        self._power, self._hand, self._feeder, self._watch = power, hand, feeder, watch
        self._function = function
        self.mode = Mode.HAND
        self.starts = False
        """Start waits for power, or for what moves in HAND."""
        self._began_at: tuple[float, ...] = (0.0,) * AXES
        """Where the axes stood as the last program was started."""
        self._broken = ""
        """Where the last program was broken off."""
        self._asked: list[tuple[int, float | None]] = []
        """Parameters that the program has written, and that ask for something."""

    @property
    def _now_ns(self) -> int:
        return self._axes.now_ns

    @property
    def unfinished(self) -> str:
        """Why the last program has not come to its end; empty: it has."""
        if self._channel.phase is Phase.HELD:
            program, number = self._channel.block
            wanted = "Start" if self._channel.override > 0.0 else "an override above 0 %"
            if self._channel.locked:
                wanted = "its release (P8701, P8702)"
            return f"{program} N{number} waits for {wanted}"
        return self._broken

    # ---- parameters that are keys -----------------------------------------------------------------------------------

    def ask(self, number: int, value: float | None) -> None:
        """The program has written a parameter: what that asks for is done as soon as the channel has got to rest."""
        if keys.wish(number, value, AXES) is not None:
            self._asked.append((number, value))

    def answer(self) -> None:
        """Do what the program has asked for."""
        while self._asked:
            self.written(*self._asked.pop(0), "P", 1)

    def written(self, number: int, value: float | None, area: str, channel: int) -> None:
        """A parameter has been written: some are keys. Those are named by their P; as q they are part of a backup."""
        if area == "P" and channel == 1:
            self._watch.written(number, value)
            self._interpreter.command(number, value, in_hand=self.mode is Mode.HAND)
        known = self._parameters.of_channel(number) if area == "q" else number if channel == 1 else None
        wanted = None if known is None else keys.wish(known, value, AXES)
        if wanted is None or (area == "q" and wanted[0] is not keys.Wish.OVERRIDE):
            return
        wish, given = wanted
        match wish:
            case keys.Wish.MODE:
                self._set_mode(int(given))
            case keys.Wish.START:
                self.start()
            case keys.Wish.STOP:
                self.stop()
            case keys.Wish.ABORT:
                self.starts = False
                self._hand.brake(self._now_ns)
                self._channel.abort(self._now_ns)
                self._parameters.write(number, 0.0)
            case keys.Wish.MOVE:
                self._move(int(given))
            case keys.Wish.PUT_OUT:
                self._parameters.write(number, 0.0)
                self._put_out(int(given))
            case keys.Wish.CLEAR:
                self._outgoing.acknowledge()
                self._parameters.write(number, 0.0)
            case keys.Wish.OVERRIDE:
                overrides.written(self._parameters, int(given))
                override = overrides.factor(self._parameters, AXES)
                self._channel.set_override(override, self._now_ns)
                self._hand.scale(override, self._now_ns)
            case keys.Wish.FUNCTION:
                self._send_in_hand(int(given))
            case keys.Wish.NEXT_STEP:
                step_on(self._parameters)
            case keys.Wish.LOCK:
                p = self._parameters
                locked = p.get(P.TRAVEL_RELEASE, 1.0) == 0.0 or p.get(P.SAFETY_HALT) == 1.0
                if locked:
                    self._hand.release(self._now_ns, everything=True)
                self._channel.lock(locked, self._now_ns)
            case keys.Wish.FEED:
                self._channel.set_feed(given, self._now_ns)
            case keys.Wish.MAP:
                self._parameters.write(P.MAP_Q, self._mapped(int(given)))
            case keys.Wish.REFERENCE:
                self._parameters.write(number, 0.0)
                self._refer(int(given))

    def _send_in_hand(self, code: int) -> None:
        """P8690: an M function to the PLC."""
        if not self._free:
            self._say(message(Code.NOT_IN_HAND, detail="an M function"))
        elif not 0 <= code <= keys.HIGHEST_FUNCTION:
            self._say(message(Code.M_TOO_LARGE, detail=f"M{code}", effect=Effect.SHOWN))
        else:
            self._function(code)

    def _mapped(self, number: int) -> float | None:
        """P8553: the q that a P is; None: there is no such P."""
        try:
            return float(self._parameters.address("P", number))
        except ProgramError:
            return None

    @property
    def _free(self) -> bool:
        """Whether axes may be moved without a program."""
        return self.mode is Mode.HAND and not self._channel.active and not self._channel.locked

    def _move(self, key: int) -> None:
        if not self._hand.press(key, self._now_ns, free=self._free):
            return
        if self._power.there:
            self._hand.begin_jog(self._now_ns)
        else:
            self._power.request(self._now_ns)

    def _refer(self, axis: int) -> None:
        if self._hand.refer(axis, free=self._free) and self._power.until_ns is None:
            self._power.request(self._now_ns)

    def _put_out(self, kind: int) -> None:
        """All parameters as a file, 5 with their status."""
        live = self._parameters.live
        assert live is not None
        self._rest()
        for number in NUMBERS:
            self._parameters.write(number, live(number))
        self._reply(parameter_file(self._parameters, status=kind == 5))

    def put_out_programs(self, number: int) -> None:
        """A program P as a file, 0: all programs and cycles in one."""
        names = [f"P{number}"] if number else sorted(self._store)
        if number and names[0] not in self._store:
            self._say(message(Code.NO_PROGRAM, detail=names[0], effect=Effect.SHOWN))
            return
        self._reply("".join(self._store[name].file for name in names))

    def _reply(self, text: str) -> None:
        """A file goes out."""
        sign = bytes([end_of_file(self._parameters)])
        self._outgoing.add(Reply(b"\r\n" + text.encode("latin-1", errors="replace") + sign + b"\r\n"))

    def _set_mode(self, given: int) -> None:
        try:
            mode = Mode(given)
        except ValueError:
            self._say(message(Code.NOT_IN_AUTO, detail=f"mode {given}; allowed: 1, 2, 4, 8"))
            return
        if Mode.POSITIONING in (mode, self.mode) and Mode.HAND not in (mode, self.mode) and mode is not self.mode:
            self._say(message(Code.ONLY_BY_WAY_OF_HAND))
            return
        if mode is Mode.HAND:
            self.starts = False
            self._channel.abort(self._now_ns)
            self._outgoing.clear()
            self._interpreter.forget_in_hand()
        elif self.mode is Mode.HAND:
            self._interpreter.take_over_functions()
        self._hand.release(self._now_ns, everything=True)
        self.mode = mode
        for number in (P.MODE_ACTIVE, P.MODE):
            self._parameters.write(number, float(mode))
        self._channel.single = mode is Mode.SINGLE
        if mode in (Mode.AUTO, Mode.SINGLE):
            self._feeder.automatic(self._started)
        else:
            self._feeder.end()
        self._rest()

    def _rest(self) -> None:
        """Without a program HAND has coordinates of its own."""
        if self._free:
            self._interpreter.hand(self._axes.position)

    # ---- programs ---------------------------------------------------------------------------------------------------

    def start(self) -> None:
        """Start: the program of P8800, or on with the one that is held."""
        if self._channel.active and not self._channel.ending:
            self._channel.go_on(self._now_ns)
            return
        if self.mode is Mode.HAND:
            self._say(message(Code.NOT_IN_AUTO, detail="Start"))
            return
        if not all(self._axes.referenced):
            missing = "".join(name for name, known in zip("XYZ", self._axes.referenced, strict=True) if not known)
            self._say(message(Code.NOT_REFERENCED, detail=missing))
            return
        self.starts = True
        if not self._power.there:
            self._power.request(self._now_ns)
        else:
            self.start_at_rest()

    def start_at_rest(self) -> None:
        """The program that is to start begins when nothing moves any more: of HAND, of one that was broken off."""
        free = self._hand.move is None and not self._channel.active
        if self.starts and free and self._power.until_ns is None:
            self.starts = False
            self._begin_program()

    def stop(self) -> None:
        """Stop: of a program, or of what moves in HAND."""
        self.starts = False
        self._hand.brake(self._now_ns)
        self._channel.stop(self._now_ns)

    @property
    def _started(self) -> str:
        """The program that Start starts."""
        return f"P{int(self._parameters.get(P.PROGRAM))}"

    def _begin_program(self) -> None:
        p = self._parameters
        positioning = self.mode is Mode.POSITIONING
        name = POSITIONED if positioning else self._started
        block = None if positioning else int(p.get(P.START_BLOCK)) or None
        self._outgoing.fault = False
        try:
            again = bool(p.get(P.RESTART) and p.get(P.BROKEN_PROGRAM))
            if not positioning:
                self._feeder.start(name, from_the_middle=again or block is not None)
            self._began_at = self._began_at if again else self._axes.position
            self._interpreter.begin(name, self._began_at, block, bool(p.get(P.SKIP)))
            if again:
                find(
                    self._interpreter,
                    f"P{int(p.get(P.BROKEN_PROGRAM))}",
                    int(p.get(P.BROKEN_BLOCK)),
                    self._axes.position,
                    self._parameters.write,
                )
        except ProgramError as error:
            self._say(message(error.number, program=name, detail=error.detail))
            return
        self._channel.single = self.mode is Mode.SINGLE
        self._broken = ""
        self._channel.start(self._now_ns)

    def ended(self, broken: tuple[str, int] | None) -> None:
        """M30, or the last block: None; or broken off in a block."""
        self._feeder.end()
        if self._parameters.get(P.RESTART_STATE):
            self._parameters.write(P.RESTART_STATE, 0.0)
        self._rest()
        name, block = broken or ("", 0)
        self._broken = f"{name} N{block} is broken off" if broken else ""
        for number, value in (
            (P.BROKEN_PROGRAM, name[1:]),
            (P.BROKEN_BLOCK, block),
            (P.ABORTED_PROGRAM, name[1:]),
            (P.ABORTED_BLOCK, block),
        ):
            self._parameters.write(number, float(value or 0))

    def _say(self, said: Message) -> None:
        self._outgoing.say(self._now_ns, said)
