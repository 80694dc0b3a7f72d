"""Operating: modes, Start and Stop, moves in HAND, and their ends (manual 7.5).

mode      HAND <--> AUTO, SINGLE, POSITIONING       AUTO, SINGLE <--> POSITIONING only through HAND (M1009)
Start     referenced (M1008) --> power --> HAND moves have ended --> execution.py
move      HAND, no program --> power --> hand.py          (Start, Stop and abort there: bwo900/53)
"""

from __future__ import annotations

from isel_twin.controller import CounterSet, Remark
from isel_twin.firmware.bwo900 import keys
from isel_twin.firmware.bwo900.execution import Execution
from isel_twin.firmware.bwo900.messages import Code, Effect, ProgramError, message
from isel_twin.firmware.bwo900.modes import Mode
from isel_twin.firmware.bwo900.numbers import Axis, M, P
from isel_twin.firmware.bwo900.parameters import of_axis
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES
from isel_twin.firmware.bwo900.realtime.channel import State

RAMPED = "axes that P8701 or P12137 stops brake with ramps (ramped_halts); those of the manual's control have none"


class Operating:
    def __init__(self, execution: Execution) -> None:
        self._execution, self._channel = execution, execution.channel
        self._hardware = hardware = execution.hardware
        self._axes, self._power, self._hand = hardware.axes, hardware.power, hardware.hand
        self._starts = False  # Start waits for power, or for a move in HAND

    def set_mode(self, given: int) -> None:
        """Change to a mode by its number: M1322 there is no such mode, M1009."""
        execution, before = self._execution, self._execution.mode
        try:
            mode = Mode(given)
        except ValueError:
            self._hardware.say(message(Code.NOT_IN_AUTO, detail=f"mode {given}; allowed: 1, 2, 4, 8"))
            return
        if Mode.POSITIONING in (mode, before) and Mode.HAND not in (mode, before) and mode is not before:
            self._hardware.say(message(Code.ONLY_BY_WAY_OF_HAND))
            return
        if mode is Mode.HAND:
            self._starts = False
            self._channel.abort()
            self._hardware.outgoing.clear()
            execution.interpreter.forget_in_hand()
            execution.forget_emergencies()
        elif before is Mode.HAND:
            execution.interpreter.take_over_functions()
        self._hand.release(everything=True)
        execution.mode = mode
        for number in (P.MODE_ACTIVE, P.MODE):
            execution.parameters.write(number, float(mode))
        if mode in (Mode.AUTO, Mode.SINGLE):
            execution.feeder.automatic(execution.program)
        else:
            execution.feeder.end()
        execution.rest()

    def start(self) -> None:
        """Start the program of P8800, or continue a held one."""
        if self._channel.active and self._channel.state is not State.ABORTING:
            self._channel.go_on()
        elif self._execution.mode is Mode.HAND:
            self._hardware.say(message(Code.NOT_IN_AUTO, detail="Start"))
        elif missing := "".join(name for name, known in zip(NAMES, self._axes.referenced, strict=True) if not known):
            self._hardware.say(message(Code.NOT_REFERENCED, detail=missing))
        else:
            self._starts = True
            if self._power.there:
                self.start_at_rest()
            else:
                self._power.request(self._axes.now_ns)

    def start_at_rest(self) -> None:
        """Begin the waiting program once moves in HAND, or of an aborted program, have ended."""
        free = self._hand.move is None and not self._channel.active
        if self._starts and free and self._power.until_ns is None:
            self._starts = False
            self._execution.begin()

    def call_emergency(self, which: int) -> None:
        """P8710, P8711: break off what runs, and start an emergency program (0, 1) in AUTO. M1310: it is not there."""
        execution = self._execution
        if (missing := execution.missing_emergency(which)) is not None:
            self._channel.abort()
            self._hardware.say(missing)
            return
        self.abort()
        if execution.mode is Mode.POSITIONING:
            self.set_mode(Mode.HAND)
        if execution.mode is not Mode.AUTO:
            self.set_mode(Mode.AUTO)
        execution.parameters.write(P.EMERGENCY_1 + which, 1.0)
        self.start()

    def stop(self) -> None:
        self._starts = False
        self._hand.brake()
        self._channel.stop()

    def abort(self) -> None:
        self._starts = False
        self._hand.brake()
        self._channel.abort()

    def override_changed(self) -> None:
        override = overrides.factor(self._execution.parameters, AXES)
        self._channel.set_override(override)
        self._hand.scale(override)

    def lock(self) -> None:
        """P8701 = 0 or P8702 = 1: the axes may not move."""
        p = self._execution.parameters
        locked = not self._axes.released or p.get(P.SAFETY_HALT) == 1.0
        if locked:
            self._hand.brake()
        self._channel.lock(locked)
        self.override_changed()
        if p.readings.ramped_halts and self._axes.halts_at_once:
            self._hardware.outgoing.add(Remark(RAMPED))

    def move(self, key: int) -> None:
        """P8752, a key of an axis: 1 +, 2 -, 0 is released."""
        if not self._hand.press(key, free=self._execution.hand_is_free):
            return
        if self._power.there:
            self._hand.begin_jog()
        else:
            self._power.request(self._axes.now_ns)

    def change_tool(self, group: int) -> None:
        """P8043: a tool is changed in HAND, by Z6 in AUTO, or by M06 to the PLC where there is no Z6 (bwo900/65)."""
        execution = self._execution
        if execution.parameters.get(P.HAND_CHANGE_LOCKED):
            return
        if not execution.hand_is_free or self._hand.move is not None:
            self._hardware.say(message(Code.NOT_IN_HAND, detail="a change of tools"))
        elif (refused := execution.request_tool(group)) is not None:
            self._hardware.say(refused)
        elif execution.changes_tool:
            self.set_mode(Mode.AUTO)
            self.start()
            execution.changes_tool = self._starts or self._channel.active
            if not execution.changes_tool:
                self.set_mode(Mode.HAND)
        else:
            self._hardware.plc.function(self._axes.now_ns, M.TOOL_CHANGE)

    def refer(self, axis: int) -> None:
        """P12130: a reference run of an axis, from 0."""
        if self._hand.refer(axis, free=self._execution.hand_is_free) and self._power.until_ns is None:
            self._power.request(self._axes.now_ns)

    def set_place(self, axis: int) -> None:
        """P12110: the position of an axis that stands becomes that value; deleted: it is again what it was."""
        execution, number = self._execution, of_axis(axis, Axis.SET)
        if self._channel.active or self._hand.move is not None:
            self._hardware.say(message(Code.NOT_IN_HAND, detail=f"P{number}: axes move"))
            return
        p = execution.parameters
        counts = self._axes.set_place(axis, p.get(number) if p.loaded(number) else None)
        self._hardware.outgoing.add(CounterSet(axis, counts))
        execution.rest()

    def place(self, number: int) -> None:
        """P12111, P12112, P12131 to P12133: moves that the PLC asks for."""
        placing = self._hand.placing
        for axis, kind in placing.written(number):
            free = not (self._channel.active or self._channel.path.locked or self._hand.jog or self._hand.homing)
            if kind.takes:
                self._execution.deletion.take(axis)
                continue
            if kind.emergency:
                self.abort()
                self._hardware.say(message(Code.EMERGENCY_POSITION, detail=NAMES[axis]))
            elif not free:
                self._hardware.say(message(Code.NOT_IN_HAND, detail=f"P{number}: other axes move"))
                continue
            try:
                placing.want(axis, kind)
            except ProgramError as error:
                self._hardware.say(message(error.number, detail=error.detail))
        if placing.wants and not self._power.there and self._power.until_ns is None:
            self._power.request(self._axes.now_ns)

    def place_at_rest(self) -> None:
        """Begin moves that the PLC asks for, once nothing else moves."""
        hand = self._hand
        if hand.placing.wants and self._power.there and not (self._channel.active or hand.jog or hand.homing):
            hand.placing.begin()
            self._touch()
            self._axes.follow(hand.placing.run)

    def probed(self) -> None:
        """The probe has changed."""
        self._execution.deletion.touched()
        self._touch()

    def _touch(self) -> None:
        """End the measuring moves of axes for which the probe acts."""
        for axis, sense in list(self._hand.placing.measuring()):
            if self._execution.deletion.acts(axis, sense):
                self._execution.deletion.take(axis)
                self._hand.placing.brake(axis)

    def send_function(self, code: int) -> None:
        """P8690: an M function to the PLC."""
        if not self._execution.hand_is_free:
            self._hardware.say(message(Code.NOT_IN_HAND, detail="an M function"))
        elif not 0 <= code <= keys.HIGHEST_FUNCTION:
            self._hardware.say(message(Code.M_TOO_LARGE, detail=f"M{code}", effect=Effect.SHOWN))
        else:
            self._hardware.plc.function(self._axes.now_ns, code)

    def powered(self) -> None:
        """The wait for the drives is over, with or without success: begin what waited for them."""
        power, hand = self._power, self._hand
        power.until_ns = None
        wants, hand.wants = hand.wants, []
        if not power.ready:
            self._starts = False
            hand.placing.wants.clear()
            self._hardware.say(message(power.missing))
            return
        power.switch(on=True)
        if wants:
            hand.begin_homing(wants)
        elif hand.direction:
            hand.begin_jog()

    def lose(self, number: int, detail: str = "") -> None:
        """Switch the drives off and end everything, with that message."""
        matters = self._power.on or self._channel.active or self._hand.move is not None
        said = self._execution.executed.message(number, detail)
        self._starts = False
        self._hand.cut()
        self._channel.cut()
        self._axes.follow(None)
        self._execution.interpreter.end()
        if self._power.on:
            self._power.switch(on=False)
        if matters:
            self._hardware.say(said)

    def limit(self, axis: int, end: int) -> None:
        """Take a struck limit switch at an end (1, 2) of an axis: outside a reference run everything ends."""
        if self._hand.homing is not None or self._axes.run is None:
            return
        number = Code.HARDWARE_LIMIT_LOW if end == 1 else Code.HARDWARE_LIMIT_HIGH
        self._hardware.say(self._execution.executed.message(number, NAMES[axis]))
        self._hand.release(everything=True)
        self._channel.abort()
