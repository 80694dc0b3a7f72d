"""Moves without a program: in mode HAND keys of an axis (jog.py) and reference runs (homing.py), in all modes what the
PLC asks for (placing.py). They wait for the power of the drives; `wants` and `direction` hold the waiting move.
"""

from __future__ import annotations

from isel_twin.controller import CounterSet
from isel_twin.firmware.bwo900.messages import Code, Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES, Axes
from isel_twin.firmware.bwo900.realtime.homing import Homing
from isel_twin.firmware.bwo900.realtime.jog import Jog
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing
from isel_twin.firmware.bwo900.realtime.placing import Placing


class Hand:
    """The present move, and those that wait for power."""

    def __init__(self, parameters: Parameters, axes: Axes, outgoing: Outgoing) -> None:
        self._parameters, self._axes, self._outgoing = parameters, axes, outgoing
        self.homing: Homing | None = None
        self.jog: Jog | None = None
        self.placing = Placing(parameters, axes)
        self.direction = 0  # of a key that waits for power: +1, -1; 0: none
        self.wants: list[int] = []

    @property
    def move(self) -> Homing | Jog | Placing | None:
        return self.homing or self.jog or (self.placing if self.placing.busy else None)

    @property
    def next_ns(self) -> int | None:
        return None if self.move is None else self.move.next_ns

    def advance(self) -> None:
        if self.homing is not None:
            self.homing.advance()
            self._axes.follow(self.homing.run)
            if self.homing.run is None:
                self._homed()
        if self.jog is not None:
            self.jog.advance()
            self._axes.follow(self.jog.run)
            if self.jog.over:
                jog, self.jog = self.jog, None
                if (past := jog.past) is not None:
                    self._outgoing.add(CounterSet(jog.axis, self._axes.place(jog.axis, past)))
                    self._tell_referenced()
        if self.placing.busy:
            self.placing.advance()
            self._axes.follow(self.placing.run)

    def cut(self) -> None:
        self.homing, self.jog, self.direction = None, None, 0
        self.placing.cut()

    def brake(self) -> None:
        """Stop or abort: brake all moves, and drop waiting ones."""
        self.direction, self.wants = 0, []
        self.release(everything=True)
        if self.homing is not None:
            self.homing.brake()

    def release(self, *, everything: bool = False) -> None:
        """The key is released; everything: a step ends, too, and what the PLC asked for."""
        if self.jog is not None:
            self.jog.release(everything=everything)
        if everything:
            self.placing.brake_all()

    def scale(self, override: float) -> None:
        if self.jog is not None:
            self.jog.scale(self._free(self.jog) * override)
        self.placing.scale()

    def press(self, key: int, *, free: bool) -> bool:
        """P8752: 1 and 2 begin a move, 0 ends it. free: mode and program allow it. True if a move is to begin."""
        if self.jog is not None:
            self.release()
            self._axes.follow(self.jog.run)
        if key not in (1, 2) or self.jog is not None:
            return False
        if not free or self.homing is not None or self.placing.busy:
            self._say(message(Code.NOT_IN_HAND, detail="a key of an axis"))
            return False
        self.direction = 1 if key == 1 else -1
        return True

    def begin_jog(self) -> None:
        sign, self.direction = self.direction, 0
        axes = self._axes
        try:
            jog = Jog(self._parameters, axes, sign)
        except ProgramError as error:
            self._say(message(error.number, detail=error.detail, effect=Effect.SHOWN))
            return
        if axes.struck(jog.axis, 2 if sign > 0 else 1):
            number = Code.HARDWARE_LIMIT_HIGH if sign > 0 else Code.HARDWARE_LIMIT_LOW
            self._say(message(number, detail=NAMES[jog.axis]))
            return
        self.jog = jog
        self.scale(overrides.factor(self._parameters, AXES))
        axes.follow(jog.run)

    def _free(self, jog: Jog) -> float:
        """0 if the axis may not move that way (P12137), else 1."""
        return float(not self._axes.barred(jog.axis, jog.sign))

    def refer(self, axis: int, *, free: bool) -> bool:
        """Request a reference run; free: mode and program allow it. True if it is to begin."""
        if not free or self.move is not None:
            under_way = " is under way" if free and self.jog is None else ""
            self._say(message(Code.NOT_IN_HAND, detail=f"a reference run{under_way}"))
            return False
        self.wants.append(axis)
        return True

    def begin_homing(self, axes: list[int]) -> None:
        """Begin reference runs of these axes, Z first; until their end the axes have no reference point."""
        for axis in axes:
            self._axes.forget(axis)
        self._parameters.write(P.ALL_REFERENCED, 0.0)
        self.homing = Homing(sorted(axes, reverse=True), self._axes, self._outgoing)
        self._axes.follow(self.homing.run)

    def _homed(self) -> None:
        assert self.homing is not None
        failed, self.homing = self.homing.failed, None
        if failed is not None:
            said = message(Code.APPROACH_REFERENCE, detail=NAMES[failed])
            self._say(said)
            self._outgoing.fault_cause = str(said)
        self._tell_referenced()

    def _tell_referenced(self) -> None:
        for number in (P.ALL_REFERENCED, P.REFERENCED):
            self._parameters.write(number, float(all(self._axes.referenced)))

    def _say(self, said: Message) -> None:
        self._outgoing.say(self._axes.now_ns, said)
