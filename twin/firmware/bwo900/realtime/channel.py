"""The channel in real time: it executes analysed blocks one after the other.

    interpreter --> ahead.py --> waiting blocks --> channel.py: states --> stretch.py --> set points

Before a block's path come its parameters, S, T and pre functions, after it the exact stop, the dwell, the post
functions and stops. Blocks with only a path need no action while the stretch runs; others are handled in the tick in
which they begin.

    IDLE -> READY -> (PRE_FUNCTIONS) -> (SPINDLE) -> PATH -> SETTLE -> DWELL -> POST_FUNCTIONS -> READY ...
            EMPTY instead of READY after a block without a path

    Stop, M00, single block   HELD before a block, HELD_AT_PATH before its path, HELD_ON_PATH where the axes have braked
    override 0, safety stop   HELD_ON_PATH
    abort                     PATH -> ABORTING -> IDLE, from any other state to IDLE at once
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace
from enum import Enum
from typing import Final

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import MFunction, PathBlock, Stop
from isel_twin.firmware.bwo900.messages import Code, ProgramError, message
from isel_twin.firmware.bwo900.realtime.ahead import BLOCK_NS, Ahead
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES
from isel_twin.firmware.bwo900.realtime.joining import released, waits_for_start
from isel_twin.firmware.bwo900.realtime.length import add_length
from isel_twin.firmware.bwo900.realtime.path_run import Cut, PathRun, has_jump
from isel_twin.firmware.bwo900.realtime.spindle import LOOK_NS, PATIENCE_NS
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.firmware.bwo900.realtime.surroundings import Surroundings, enter, mute, send, speak, unmoved
from isel_twin.motion import SetPointRun

# time that an M function with a jump and without a path waits for its acknowledgement
JUMP_NS: Final = 20 * MILLISECOND_NS


class State(Enum):
    IDLE = "no program"
    READY = "the next block begins"
    EMPTY = "a block without a path takes its time, or analysis has no block yet"
    PRE_FUNCTIONS = "functions with halt before a path wait for their acknowledgement"
    SPINDLE = "a path with feed waits until the spindle has its speed"
    PATH = "set points are made"
    ABORTING = "the axes brake along the path; then the program is broken off"
    SETTLE = "exact stop: the following error is not within its window yet"
    DWELL = "G04"
    POST_FUNCTIONS = "functions with halt, or with a jump, wait for their acknowledgement"
    HELD = "Start begins the next block"
    HELD_AT_PATH = "Start begins the path of the block, whose functions have been sent"
    HELD_ON_PATH = "the axes have braked on the path; Start, or an override above 0, goes on"


MOVING: Final = (State.PATH, State.ABORTING)
HELD: Final = (State.HELD, State.HELD_AT_PATH, State.HELD_ON_PATH)


class Channel:
    def __init__(self, interpreter: Interpreter, around: Surroundings) -> None:
        self._interpreter, self._around = interpreter, around
        self._axes, self._plc, self._deletion = around.axes, around.plc, around.deletion
        self.executed = around.executed
        self._ahead = Ahead(interpreter, around)
        self.path = PathRun(interpreter, self._ahead, around)
        self.state = State.IDLE
        self._current: PathBlock | None = None  # block whose path has ended, during the actions at its end
        self._due_ns: int | None = None  # when the state ends or is checked again; None: it waits for something else
        self._stands_ns = 0  # when the axes should be at rest
        self._waits_ns = 0  # since when a path has waited for the spindle
        self._holds = False  # after Stop: hold as soon as the axes are at rest

    # ---- state ------------------------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """True if a program is in execution, held or not."""
        return self.state is not State.IDLE

    @property
    def held(self) -> bool:
        """True if Start continues the program."""
        return self.state in HELD

    @property
    def run(self) -> SetPointRun | None:
        return self.path.stretch.run

    @property
    def next_ns(self) -> int | None:
        return self.path.next_ns if self.state in MOVING else self._due_ns

    @property
    def settles_until_ns(self) -> int | None:
        """At an exact stop, the first look that may give up waiting for an axis; None: no look may be left out."""
        if self.state is not State.SETTLE or self._due_ns is None or self._axes.drives is None:
            return None
        longest_ns = min(map(self._axes.settling_ns, range(AXES)))
        until_ns = self._stands_ns - -longest_ns // PERIOD_NS * PERIOD_NS
        return until_ns if until_ns > self._due_ns else None

    @property
    def unmoved(self) -> bool:
        """True if a program runs without moving."""
        return self.active and unmoved(self._around)

    @property
    def halted(self) -> bool:
        """True if an M function with halt is not acknowledged."""
        return self.state in (State.PRE_FUNCTIONS, State.POST_FUNCTIONS) and self._due_ns is None

    @property
    def speed_mm_s(self) -> float:
        """Present speed along the path."""
        return self.path.stretch.speed_mm_s(self._axes.now_ns)

    @property
    def dwell_left_s(self) -> float:
        """Remaining dwell of the block in execution; 0: none."""
        if self.state is not State.DWELL or self._due_ns is None:
            return 0.0
        return (self._due_ns - self._axes.now_ns) / SECOND_NS

    # ---- operating --------------------------------------------------------------------------------------------------

    def start(self) -> None:
        self._ahead.start()
        self.path.stretch.clear()
        self.path.stand()
        self.executed.start()
        self._current, self._holds, self.path.cut = None, False, Cut.NONE
        self._enter(State.READY, self._axes.now_ns)
        self.advance()

    def go_on(self) -> None:
        """Continue after Stop or M00."""
        self._holds = False
        if self.state is State.PATH and self.path.stretch.brakes:
            self.path.hold(False)
        elif self.held:
            self._resume()
        self.advance()

    def stop(self) -> None:
        """Stop: brake along the path, and wait for Start."""
        self._holds = True
        if self.state in MOVING:
            self.path.hold(True)
        elif self.state in (State.READY, State.EMPTY):
            self._enter(State.HELD)

    def abort(self) -> None:
        """Brake along the path and forget the rest."""
        if self.state in MOVING and self.path.stretch.runs and not self.path.over:
            self.state = State.ABORTING
            self.path.hold(True)
        elif self.state is not State.IDLE:
            self._end(aborted=True)

    def cut(self) -> None:
        """End everything at once: emergency stop."""
        self.path.stretch.run = None
        if self.state is not State.IDLE:
            self._end(aborted=True)

    def set_override(self, factor: float) -> None:
        """Set the override, 0 to 1.2."""
        self.path.override = factor
        self._rescale()

    def lock(self, locked: bool) -> None:
        """P8701, P8702: the axes brake along the path, and wait until they may move again."""
        self.path.locked = locked
        self._rescale()

    def _rescale(self) -> None:
        """Change the speed of the present path; one held only by the override goes on."""
        if self.state in MOVING:
            self.path.rescale()
        elif self.state is State.HELD_ON_PATH and not self._holds and self.path.scale > 0.0:
            self._resume()

    # ---- progress ---------------------------------------------------------------------------------------------------

    def advance(self) -> None:
        for _ in range(100_000):
            before = self._progress()
            self._step()
            if before == self._progress():
                return

    def _progress(self) -> tuple[object, ...]:
        """A value that changes whenever a step has an effect."""
        return self.state, len(self.path.stretch), len(self._ahead.blocks), self.run, self._due_ns

    def _step(self) -> None:
        now_ns = self._axes.now_ns
        due = self._due_ns is not None and now_ns >= self._due_ns
        match self.state:
            case State.READY:
                self._begin()
            case State.PATH | State.ABORTING:
                self._follow()
            case State.SETTLE if due:
                self._look_settled()
            case State.DWELL:
                block = self._current
                if block is not None and block.watched and self._deletion.deletes(block):
                    self._deletion.deleted()
                    self._post()
                elif due:
                    self._post()
            case State.PRE_FUNCTIONS if self._plc.idle:
                self.path.cut &= ~Cut.JUMP
                self._begin_path()
            case State.SPINDLE if due:
                self._await_spindle()
            case State.HELD_ON_PATH if due:
                self._due_ns = now_ns + LOOK_NS
                self._rescale()
            case State.POST_FUNCTIONS:
                if self._plc.idle:
                    jumps = self._current is not None and has_jump(self._current) and not mute(self._around)
                    self.path.cut = self.path.cut & ~Cut.JUMP | (Cut.JUMP if jumps else Cut.NONE)
                    self._block_over()
                elif due:
                    self._block_over()
            case State.EMPTY if due:
                self._enter(State.READY, now_ns)

    def _enter(self, state: State, due_ns: int | None = None) -> None:
        self.state, self._due_ns = state, due_ns

    def _begin(self) -> None:
        if self._holds:
            self._enter(State.HELD)
            return
        if not self._plc.room or not released(self._around):
            self._enter(State.EMPTY, self._axes.now_ns + BLOCK_NS)
            return
        if self._ahead.fill(0):
            self._holds = True
        if not self._ahead.blocks:
            self._nothing()
            return
        block = self._ahead.blocks[0]
        if self._axes.bars(block):
            self._enter(State.EMPTY, self._axes.now_ns + BLOCK_NS)
            return
        enter(self._around, block, self._axes.now_ns)
        if (obstacle := self._axes.obstacle(block)) is not None:
            self._break_off(obstacle.at(block.program, block.number, block.column))
            return
        speak(self._around, block)
        if not block.elements:
            self._current = self._ahead.blocks.popleft()
            self._without_path(block)
        elif _halting(block.pre) and not self._plc.idle:
            self._current = None
            self._enter(State.PRE_FUNCTIONS)
        else:
            self._begin_path()

    def _break_off(self, error: ProgramError) -> None:
        """Break off: the path of a block cannot be made; the error has its place."""
        program, block = error.place or ("", 0)
        place = message(error.number, program=program, block=block, column=error.column)
        self._around.say(replace(place, detail=error.detail, infos=error.infos))
        self._end(aborted=True)

    def _nothing(self) -> None:
        """Handle an empty queue: the program has ended, failed, or waits for something."""
        if self._ahead.error is not None:
            self._around.say(self._ahead.error)
            self._end(aborted=True)
        elif self._ahead.ended:
            self._end(aborted=False)
        else:  # waituntil, or an acknowledgement
            self._enter(State.EMPTY, self._axes.now_ns + BLOCK_NS)

    def _without_path(self, block: PathBlock) -> None:
        if block.stands:
            self._settle()
        elif _halting(block.pre):
            self._after_stop()
        else:
            self._post()

    def _begin_path(self) -> None:
        """Begin a stretch with the first of the waiting blocks, whose functions have been sent."""
        if self._holds:
            self._enter(State.HELD_AT_PATH)
            return
        block = self._ahead.blocks[0]
        if block.watched and self._deletion.deletes(block):
            self._current = replace(self._ahead.blocks.popleft(), elements=())  # it still takes its time
            self.path.delete()
            self._settle()
            return
        if self._waits_for_spindle(block):
            self._waits_ns = self._axes.now_ns
            self._enter(State.SPINDLE, self._waits_ns + LOOK_NS)
            return
        try:
            self.path.begin()
            self.state = State.PATH
        except ProgramError as error:
            self._break_off(error)

    def _waits_for_spindle(self, block: PathBlock) -> bool:
        spindle = self._around.spindle
        return not block.rapid and (not spindle.ready or (block.per_turn and not spindle.wanted))

    def _await_spindle(self) -> None:
        """Look at the spindle again; a cycle does not wait for ever: M8303 (bwo900/81)."""
        block, now_ns = self._ahead.blocks[0], self._axes.now_ns
        if self._holds or not self._waits_for_spindle(block):
            self._begin_path()
        elif block.in_force.cycle is not None and now_ns - self._waits_ns >= PATIENCE_NS:
            measured = self._around.spindle.measured
            error = ProgramError(Code.SPEED_NOT_REACHED, f"it turns at {measured:.0f} 1/min")
            self._break_off(error.at(block.program, block.number, block.column))
        else:
            self._due_ns = now_ns + LOOK_NS

    def _follow(self) -> None:
        """Follow the running stretch: pass from block to block, append analysed blocks, end."""
        path = self.path
        if not path.stretch.runs or path.give_up():
            return
        path.pass_on()
        path.follow_spindle()
        if path.over:
            self._path_ended()
            return
        try:
            if path.extend(holds=self._holds):
                self._holds = True
        except ProgramError as error:
            self._break_off(error)

    def _path_ended(self) -> None:
        if self.state is State.ABORTING:
            self._end(aborted=True)
            return
        self._current = self.path.finish()
        if self._current is None:
            follows = self.path.per_turn and not self._holds
            self._enter(State.HELD_ON_PATH, self._axes.now_ns + LOOK_NS if follows else None)
            return
        if not self.path.cut:
            add_length(self._around.parameters, self._current)
        if self._current.stands:
            self._settle()
        else:
            self._post()

    def _resume(self) -> None:
        match self.state:
            case State.HELD:
                self._enter(State.READY, self._axes.now_ns)
            case State.HELD_AT_PATH:
                self._begin_path()
            case State.HELD_ON_PATH:
                self.path.resume()
                self.state = State.PATH

    def _settle(self) -> None:
        self._stands_ns = self._axes.now_ns
        self._enter(State.SETTLE, self._stands_ns)

    def _look_settled(self) -> None:
        """Check the axes once a cycle of position control, so that the result does not depend on the calls. Looks that
        were left out have found nothing (`Arrival`)."""
        assert self._due_ns is not None
        self._due_ns -= (self._due_ns - self._axes.now_ns) // PERIOD_NS * PERIOD_NS
        if self._due_ns > self._axes.now_ns:
            return
        waited_ns, unsettled = self._due_ns - self._stands_ns, self._axes.unsettled()
        if any(waited_ns < self._axes.settling_ns(axis) for axis in unsettled):
            self._due_ns += PERIOD_NS
            return
        for axis in unsettled:
            self._around.say(self.executed.message(Code.NOT_IN_POSITION, NAMES[axis]))
        self._after_stop()

    def _after_stop(self) -> None:
        block = self._current
        if block is not None and block.dwell_s is not None:
            self._enter(State.DWELL, self._axes.now_ns + round(block.dwell_s * SECOND_NS))
        else:
            self._post()

    def _post(self) -> None:
        block = self._current
        assert block is not None
        send(self._around, block.post)
        jumping = has_jump(block) and not block.elements and not mute(self._around)
        if jumping or (_halting((*block.pre, *block.post)) and not self._plc.idle):
            self._enter(State.POST_FUNCTIONS, self._axes.now_ns + JUMP_NS if jumping else None)
        else:
            self._block_over()

    def _block_over(self) -> None:
        block, self._current = self._current, None
        assert block is not None
        path = self.path
        if path.cut & Cut.SIGNAL:
            path.cut &= ~Cut.SIGNAL
            path.begin_anew()
        if block.watched:
            self._interpreter.measured(self._deletion.place)
        if block.stop is Stop.SYNCHRONISE or block.stop is Stop.MEASURING_STOP:
            self._interpreter.executed()
        if self._interpreter.waiting is Waiting.ACKNOWLEDGEMENT and not self._ahead.blocks:
            jumps = bool(path.cut & Cut.JUMP)
            if jumps:
                path.begin_anew()
            elif not self._plc.idle:
                self._plc.leave()
            try:
                self._interpreter.acknowledged(jumps)
            except ProgramError as error:
                self._break_off(error.at(block.program, block.number, block.column))
                return
            path.cut &= ~Cut.JUMP
        if block.stop is Stop.END:
            self._end(aborted=False)
        elif self._holds or waits_for_start(block, self._around):
            self._holds = True
            self._enter(State.HELD)
        elif block.elements:
            self._enter(State.READY, self._axes.now_ns)
        else:
            self._enter(State.EMPTY, self._axes.now_ns + BLOCK_NS)

    def _end(self, *, aborted: bool) -> None:
        self._ahead.end()
        self.path.stretch.clear()
        self._current, self._holds = None, False
        self.executed.end()
        self._enter(State.IDLE)
        self._around.ended(self.executed.place if aborted else None)


def _halting(functions: Iterable[MFunction]) -> bool:
    return any(function.halt and not function.jump for function in functions)
