"""The channel in real time: blocks that have been analysed are carried out, one after the other, on one clock.

    interpreter --> ahead.py --> waiting blocks --> channel.py: phases --> stretch.py --> set points

Before a block's path come its parameters, S, T and pre functions, after it the exact stop, the dwell, the post
functions and what stops. Blocks with nothing but a path pass unseen while the stretch runs; the others are looked at in
the tick in which they begin.

    phases    IDLE -> READY -> PATH -> SETTLE -> DWELL -> FUNCTIONS -> READY ...
              READY: the next block begins. FUNCTIONS: functions with halt wait for their acknowledgement.
              HELD: Stop, or M00; Start goes on. EMPTY: a block without a path takes its time.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from enum import Enum
from typing import Final

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.elements import Point
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.messages import Code, Message, ProgramError, message
from isel_twin.firmware.bwo900.numbers import P
from isel_twin.firmware.bwo900.realtime.ahead import BLOCK_NS, REFILL, Ahead, Filter
from isel_twin.firmware.bwo900.realtime.services import Services
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS, Stretch, breaks_after, joining
from isel_twin.motion import SetPointRun

ONLY_REAL_TIME: Final = 0x1010
"""Of P8806: single block stops only after blocks that are something to the real time (byte 1 or 2, bit 4)."""
JUMP_NS: Final = 20 * MILLISECOND_NS
"""How long an M function with a jump waits for its acknowledgement where there is no path."""


class Phase(Enum):
    """What a channel is at."""

    IDLE = "no program"
    READY = "the next block begins"
    PATH = "set points are made"
    SETTLE = "exact stop: the following error is not within its window yet"
    DWELL = "G04"
    FUNCTIONS = "functions wait for their acknowledgement"
    EMPTY = "a block without a path takes its time"
    HELD = "Start goes on"


class Channel:
    """Carries out what an interpreter analyses."""

    def __init__(self, interpreter: Interpreter, services: Services, filters: Callable[[], Sequence[Filter]]) -> None:
        """filters: makes new ones, objects with `push(block)` and `flush()`, in their order."""
        self._interpreter, self._do = interpreter, services
        self._ahead = Ahead(interpreter, services, filters)
        self._stretch = Stretch()
        self.phase = Phase.IDLE
        self.single = False
        """Stop after every block."""
        self.override = 1.0
        self.locked = False
        """The axes may not move."""
        self.block = ("", 0)
        """Program and block in execution."""
        self.column = 0
        """Where to look for its path in its text."""
        self._entered: PathBlock | None = None
        """The block in execution; None: no program."""
        self._current: PathBlock | None = None
        """Block whose path has ended, and whose end is being carried out."""
        self._due_ns: int | None = None
        self._stands_ns = 0
        """When the axes ought to have come to a stand."""
        self._holds = False
        """Stop: wait for Start as soon as the axes stand."""
        self._drops = False
        """The program is broken off as soon as the axes stand."""
        self._branches = False
        """The M function with a jump was acknowledged in time."""
        self._sent = False
        """Held between the functions before a path and the path itself."""
        self._deleted = False
        """A signal has deleted the path of the block with M26."""
        self._now_ns = 0

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def ending(self) -> bool:
        """It is broken off, and still brakes."""
        return self._drops

    @property
    def active(self) -> bool:
        """A program is in execution, held or not."""
        return self.phase is not Phase.IDLE

    @property
    def run(self) -> SetPointRun | None:
        """Set points, while there are any."""
        return self._stretch.run

    @property
    def next_ns(self) -> int | None:
        """When `advance` is due."""
        if self.phase is not Phase.PATH:
            return self._due_ns
        next_ns = self._stretch.next_ns(self._now_ns, None if self._ahead.ended else REFILL)
        if self._ahead.poll_ns is not None and not self._stretch.held:  # analysis waits while the axes do
            next_ns = min(next_ns, self._ahead.poll_ns)
        return max(next_ns, self._now_ns)

    @property
    def _shown(self) -> PathBlock | None:
        """The block in execution, as far as it is under way."""
        return self._current if self._current is not None else self._stretch.first

    @property
    def in_force(self) -> InForce:
        """What holds for the block in execution; without a program, what one begins with."""
        return AT_REST if self._entered is None else self._entered.in_force

    @property
    def feed_mm_min(self) -> tuple[float, float]:
        """Programmed feed of the block in execution, and the one at its end; 0: none."""
        block = self._entered
        if block is None:
            return 0.0, 0.0
        return block.feed_mm_min or block.in_force.feed_mm_min, block.end_feed_mm_min or 0.0

    @property
    def halted(self) -> bool:
        """An M function with halt has not been acknowledged."""
        return self.phase is Phase.FUNCTIONS and self._due_ns is None

    @property
    def target(self) -> Point | None:
        """Where the block in execution ends, in the program's coordinates; None: no program."""
        return None if self._entered is None else self._entered.target

    @property
    def motion(self) -> float:
        """0 to 3, for G00 to G03, of the block in execution, or as they are in force."""
        motion = None if self._entered is None else self._entered.motion
        return float(self.in_force.modal.motion) if motion is None else motion

    @property
    def speed_mm_s(self) -> float:
        """Along the path, now."""
        return self._stretch.speed_mm_s(self._now_ns)

    @property
    def dwell_s(self) -> tuple[float, float]:
        """Of the block in execution, and what is left of it; 0: none."""
        left = 0.0
        if self.phase is Phase.DWELL and self._due_ns is not None:
            left = (self._due_ns - self._now_ns) / SECOND_NS
        return (0.0 if self._entered is None else self._entered.dwell_s or 0.0), left

    # ---- operating --------------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """A program has been begun in the interpreter; carry it out."""
        self._now_ns = now_ns
        self._ahead.start()
        self._stretch.clear()
        self._stretch.stand(self._do.limits(), self._position())
        self.block, self._current = ("", 0), None
        self._holds = self._drops = self._branches = self._deleted = self._sent = False
        self.phase, self._due_ns = Phase.READY, now_ns
        self.advance(now_ns)

    def go_on(self, now_ns: int) -> None:
        """Start, after Stop or M00."""
        self._now_ns = now_ns
        self._holds = False
        if self.phase is Phase.PATH and self._stretch.brakes and not self._drops:
            self._stretch.replan(now_ns, hold=False)
        elif self.phase is Phase.HELD:
            self._resume()
        self.advance(now_ns)

    def stop(self, now_ns: int) -> None:
        """Stop: brake along the path, and wait for Start."""
        self._now_ns = now_ns
        self._holds = True
        if self.phase is Phase.PATH:
            self._stretch.replan(now_ns, hold=True)
        elif self.phase in (Phase.READY, Phase.EMPTY):
            self.phase, self._due_ns = Phase.HELD, None

    def abort(self, now_ns: int) -> None:
        """Brake along the path and forget the rest."""
        self._now_ns = now_ns
        if self.phase is Phase.IDLE:
            return
        self._drops = True
        if self.phase is Phase.PATH and self._stretch.runs and not self._stretch.over(now_ns):
            self._stretch.replan(now_ns, hold=True)
            return
        self._end(aborted=True)

    def cut(self, now_ns: int) -> None:
        """Everything ends at once: emergency stop."""
        self._now_ns = now_ns
        self._stretch.run = None
        if self.phase is not Phase.IDLE:
            self._end(aborted=True)

    def set_override(self, factor: float, now_ns: int) -> None:
        """Another override, 0 to 1.2."""
        self.override = factor
        self._rescale(now_ns)

    def lock(self, locked: bool, now_ns: int) -> None:
        """P8701, P8702: the axes brake along the path, and wait until they may move again."""
        self.locked = locked
        self._rescale(now_ns)

    def _rescale(self, now_ns: int) -> None:
        """Another speed for the path under way; what stood for nothing else goes on."""
        self._now_ns = now_ns
        if self.phase is Phase.PATH:
            self._stretch.replan(now_ns, scale=self._scale())
        elif self.phase is Phase.HELD and not self._holds and self._stretch.begun and self._scale() > 0.0:
            self._resume()

    def set_feed(self, mm_min: float, now_ns: int) -> None:
        """P8817: another feed for what is left of the block in execution; 0 and less: none. Rapid has no feed."""
        self._now_ns = now_ns
        block = self._stretch.first
        if mm_min > 0.0 and block is not None and not block.rapid:
            self._stretch.hasten(mm_min / 60.0, now_ns)

    def branch(self, now_ns: int) -> None:
        """The M function with a jump was acknowledged: its path is deleted, and the program goes on elsewhere."""
        self._now_ns = now_ns
        if self._interpreter.waiting is not Waiting.ACKNOWLEDGEMENT or self._do.mute:
            return
        self._branches = True
        if self.phase is Phase.PATH:
            self._stretch.replan(now_ns, hold=True, drop=True)
            self._do.watch.keep()

    def _delete(self) -> None:
        """A signal deletes the path of the block with M26."""
        self._deleted = True
        self._do.watch.deleted()
        if self.phase is Phase.PATH:
            self._stretch.replan(self._now_ns, hold=True, drop=True)

    # ---- going on ---------------------------------------------------------------------------------------------------

    def advance(self, now_ns: int) -> None:
        """Let time pass to now_ns: everything that is due."""
        self._now_ns = now_ns
        for _ in range(100_000):
            before = self._state()
            self._step()
            if before == self._state():
                return

    def _state(self) -> tuple[object, ...]:
        """Something has happened if it is another one."""
        return self.phase, len(self._stretch), len(self._ahead.blocks), self.run, self._due_ns

    def _step(self) -> None:
        match self.phase:
            case Phase.READY:
                self._begin()
            case Phase.PATH:
                self._follow()
            case Phase.SETTLE:
                if self._due_ns is not None and self._now_ns >= self._due_ns:
                    self._look_settled(self._due_ns)
            case Phase.DWELL:
                block = self._current
                if block is not None and block.watched and self._do.watch.deletes(block):
                    self._do.watch.deleted()
                    self._post()
                elif self._due_ns is not None and self._now_ns >= self._due_ns:
                    self._post()
            case Phase.FUNCTIONS:
                if self._do.acknowledged():
                    self._branches = self._jumps and not self._do.mute
                    self._after_functions()
                elif self._due_ns is not None and self._now_ns >= self._due_ns:
                    self._after_functions()
            case Phase.EMPTY:
                if self._due_ns is not None and self._now_ns >= self._due_ns:
                    self.phase, self._due_ns = Phase.READY, self._now_ns

    # Blocks

    def _begin(self) -> None:
        """The next block, if there is one."""
        if self._drops:
            self._end(aborted=True)
            return
        if self._holds:
            self.phase, self._due_ns = Phase.HELD, None
            return
        if not self._do.room():
            self.phase, self._due_ns = Phase.EMPTY, self._now_ns + BLOCK_NS
            return
        self._fill()
        if not self._ahead.blocks:
            self._nothing()
            return
        block = self._ahead.blocks[0]
        self._enter(block, self._now_ns)
        if why := self._do.allowed(block):
            number, _, detail = why.partition(" ")
            self._break_off(ProgramError(int(number), detail), block)
            return
        if not block.elements:
            self._ahead.blocks.popleft()
            self._do.speak(block)
            self._current = block
            self._without_path(block)
            return
        self._do.speak(block)
        if not self._do.acknowledged() and any(function.halt and not function.jump for function in block.pre):
            self.phase, self._due_ns = Phase.FUNCTIONS, None
            self._current = None
            return
        self._begin_path()

    def _fill(self) -> None:
        """Let analysis go on."""
        if self._ahead.fill(self._now_ns, len(self._stretch)):
            self._holds = True

    def _enter(self, block: PathBlock, t_ns: int) -> None:
        """A block begins, or has begun at t_ns."""
        if self.block != (block.program, block.number) and block.number:
            self._do.begun(t_ns, block)
        self.block, self.column, self._entered = (block.program, block.number), block.column, block

    def _break_off(self, error: ProgramError, block: PathBlock) -> None:
        """The path of a block cannot be made."""
        self._do.say(
            message(
                error.number,
                program=block.program,
                block=block.number,
                column=block.column,
                detail=error.detail,
                infos=error.infos,
            )
        )
        self._end(aborted=True)

    def _nothing(self) -> None:
        """No block waits: the program has ended, failed, or waits for something."""
        if self._ahead.error is not None:
            self._do.say(self._ahead.error)
            self._end(aborted=True)
        elif self._ahead.ended:
            self._end(aborted=False)
        else:
            self._due_ns = self._now_ns + BLOCK_NS  # waituntil, or an acknowledgement: look again
            self.phase = Phase.EMPTY

    def _without_path(self, block: PathBlock) -> None:
        """A block without a path: on with what comes behind one."""
        if block.stands:
            self._settle()
        elif any(function.halt and not function.jump for function in block.pre):
            self._after_stop()
        else:
            self._post()

    def _halts(self, block: PathBlock) -> bool:
        """Whether single block stops after it."""
        if not self.single or not (block.main or self._do.option(P.SINGLE_EVERY)):
            return False
        flags = self._do.option(P.START_FLAGS_1)
        return not flags & ONLY_REAL_TIME or block.in_real_time

    @property
    def _jumps(self) -> bool:
        """The block in execution has an M function with a jump."""
        return self._shown is not None and any(function.jump for function in self._shown.pre)

    # The path

    def _begin_path(self) -> None:
        """A stretch begins with the first of the waiting blocks, whose functions have been sent."""
        self._sent = self._holds
        if self._holds:
            self.phase, self._due_ns = Phase.HELD, None
            return
        block = self._ahead.blocks[0]
        if block.watched and self._do.watch.deletes(block):
            self._current = replace(self._ahead.blocks.popleft(), elements=())  # it takes its time all the same
            self._delete()
            self._settle()
            return
        limits = self._do.limits()
        chosen = joining(self._ahead.blocks, None, self._halts, self._do)
        try:
            self._stretch.begin(chosen, limits, self._scale_of(chosen[0]), self._now_ns)
        except ProgramError as error:
            self._break_off(error, chosen[0])
            return
        self.phase = Phase.PATH

    @property
    def _open(self) -> bool:
        """Whether the stretch could go on with another block."""
        last = self._stretch.last
        return last is not None and not breaks_after(last, self._halts(last)) and not self._holds

    def _follow(self) -> None:
        """The stretch runs: pass on from block to block, append what has been analysed, end."""
        stretch = self._stretch
        if not stretch.runs:
            return
        free = not self._branches and not self._do.mute
        if free and self._jumps and self._do.acknowledged():
            self.branch(self._now_ns)
            return
        first = stretch.first
        if first is not None and first.watched and not self._deleted and self._do.watch.deletes(first):
            self._delete()
            return
        for over, block, began_ns in stretch.passed(self._now_ns):
            for function in over.post:
                self._do.send(function)
            self._enter(block, began_ns)
            self._do.speak(block)
        if stretch.over(self._now_ns):
            self._path_ended()
            return
        goes_on = self._open and len(stretch) <= REFILL
        if not self._ahead.ended and not stretch.held and (goes_on or self._ahead.poll_ns is not None):
            self._fill()
        if self._ahead.blocks and self._open and not stretch.held:
            chosen = joining(self._ahead.blocks, stretch.last, self._halts, self._do)
            if not chosen:
                return
            try:
                stretch.append(chosen, self._now_ns)
            except ProgramError as error:
                self._break_off(error, chosen[0])

    def _path_ended(self) -> None:
        """Set points have come to an end: of the stretch, or because it was held."""
        if self._drops:
            self._end(aborted=True)
            return
        last = self._stretch.finish(gives_up=self._branches or self._deleted)
        if last is None:
            self.phase, self._due_ns = Phase.HELD, None
            return
        self._current = last
        if last.stands:
            self._settle()
        else:
            self._post()

    def _resume(self) -> None:
        """Go on where it was held."""
        if self._sent:
            self._begin_path()
            return
        if not self._stretch.begun:
            self.phase, self._due_ns = Phase.READY, self._now_ns
            return
        self._stretch.resume(self._scale(), self._now_ns)
        self.phase = Phase.PATH

    def _scale(self) -> float:
        """The override, as it counts for the path under way."""
        waiting = self._ahead.blocks
        return self._scale_of(self._stretch.first or (waiting[0] if waiting else None))

    def _scale_of(self, block: PathBlock | None) -> float:
        return 0.0 if self.locked else 1.0 if block is not None and not block.override else self.override

    # The end of a block

    def _settle(self) -> None:
        self.phase, self._due_ns = Phase.SETTLE, self._now_ns
        self._stands_ns = self._now_ns

    def _look_settled(self, now_ns: int) -> None:
        """Whether the axes are in position is asked in every cycle, and at no other time: however time is cut."""
        unsettled = self._do.unsettled()
        if any(now_ns - self._stands_ns < self._do.settling_ns(axis) for axis in unsettled):
            self._due_ns = now_ns + PERIOD_NS
            return
        for axis in unsettled:
            self._do.say(self.message(Code.NOT_IN_POSITION, "XYZ"[axis]))
        self._after_stop()

    def _after_stop(self) -> None:
        block = self._current
        if block is not None and block.dwell_s is not None:
            self.phase, self._due_ns = Phase.DWELL, self._now_ns + round(block.dwell_s * SECOND_NS)
            return
        self._post()

    def _post(self) -> None:
        """Post functions, and the wait for those with halt."""
        block = self._current
        assert block is not None
        for function in block.post:
            self._do.send(function)
        halting = any(function.halt and not function.jump for function in (*block.pre, *block.post))
        jumping = self._jumps and not block.elements and not self._do.mute
        if (halting and not self._do.acknowledged()) or jumping:
            self.phase, self._due_ns = Phase.FUNCTIONS, self._now_ns + JUMP_NS if jumping else None
            return
        self._block_over()

    def _after_functions(self) -> None:
        if self._current is None:  # functions before a path
            self._begin_path()
        else:
            self._block_over()

    def _block_over(self) -> None:
        """A block has been carried out whole."""
        block, self._current = self._current, None
        assert block is not None
        if self._deleted:
            self._deleted = False
            self._begin_anew()
        if block.stop is Stop.SYNCHRONISE or block.stop is Stop.MEASURING_STOP:
            self._interpreter.executed()
        if self._interpreter.waiting is Waiting.ACKNOWLEDGEMENT and not self._ahead.blocks:
            if self._branches:
                self._begin_anew()
            elif not self._do.acknowledged():
                self._do.withdraw()
            try:
                self._interpreter.acknowledged(self._branches)
            except ProgramError as error:
                self._break_off(error, block)
                return
            self._branches = False
        if block.stop is Stop.END:
            self._end(aborted=False)
            return
        if block.stop is Stop.MEASURING_STOP or self._holds or self._halts(block):
            self._holds = True
            self.phase, self._due_ns = Phase.HELD, None
            return
        if block.elements:
            self.phase, self._due_ns = Phase.READY, self._now_ns
        else:
            self.phase, self._due_ns = Phase.EMPTY, self._now_ns + BLOCK_NS

    def _begin_anew(self) -> None:
        """A path has been deleted: the next one begins where the axes stand, without corrections of the one before."""
        self._interpreter.stand(self._position())
        self._stretch.stand(self._do.limits(), self._position())
        self._ahead.renew_filters()

    def _end(self, *, aborted: bool) -> None:
        """No program any more."""
        self._ahead.end()
        self._stretch.clear()
        self._current = self._entered = None
        self._holds = self._drops = self._sent = False
        self.phase, self._due_ns = Phase.IDLE, None
        self._do.ended(self.block if aborted else None)

    def _position(self) -> tuple[float, ...]:
        per_mm = self._do.limits().increments_per_mm
        return tuple(count / per for count, per in zip(self._do.counts(), per_mm, strict=True))

    def message(self, number: int, detail: str = "") -> Message:
        """The message of that number, about the block in execution if there is one."""
        if not self.active:
            return message(number, detail=detail)
        program, block = self.block
        return message(number, program=program, block=block, column=self.column, detail=detail)
