"""The channel in real time: blocks that have been analysed are carried out, one after the other, on one clock.

    interpreter --> contour --> radius correction --> waiting blocks --> stretch --> set points
                                                                          |
    a stretch: blocks that run into each other, one `Joined` plan, appended to while it runs

Before a block's path come its parameters, S, T and pre functions, after it the exact stop, the dwell, the post
functions and what stops. Blocks with nothing but a path pass unseen; the others are looked at in the tick in which they
begin.

    phases    IDLE -> READY -> PATH -> SETTLE -> DWELL -> FUNCTIONS -> READY ...
              READY: the next block begins. FUNCTIONS: functions with halt wait for their acknowledgement.
              HELD: Stop, or M00; Start goes on. EMPTY: a block without a path takes its time.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final, Protocol

from isel_twin.firmware.bwo900.blocks import BlockEnd, Machine, PathBlock, Stop
from isel_twin.firmware.bwo900.elements import Arc
from isel_twin.firmware.bwo900.interpreter import Interpreter, Waiting
from isel_twin.firmware.bwo900.messages import Effect, Message, ProgramError, message
from isel_twin.firmware.bwo900.path import Limits, Path
from isel_twin.motion import SetPointRun
from isel_twin.motion.joined import Joined, Pieces, joined
from isel_twin.units import MILLISECOND_NS, SECOND_NS

__all__ = ["BLOCK_NS", "PERIOD_NS", "Channel", "Phase", "Services"]

PERIOD_NS: Final = 2 * MILLISECOND_NS
"""From set point to set point: the position control of the manual takes 0.25 to 3 ms."""
BLOCK_NS: Final = 1_500_000
"""Block cycle time (manual: below 1.5 to 6 ms), of blocks without a path."""
AHEAD: Final = 400
"""Blocks that are analysed ahead of the one that is made."""
REFILL: Final = 200
"""Analysis goes on when so few wait."""
WITHOUT_MOVING, WITHOUT_FUNCTIONS, EVERY_BLOCK, START_FLAGS = 8_812, 8_813, 8_814, 8_806
LONGEST_SETTLING: Final = 12_018
ONLY_REAL_TIME: Final = 0x1010
"""Of P8806: single block stops only after blocks that are something to the real time (byte 1 or 2, bit 4)."""
JUMP_NS: Final = 20 * MILLISECOND_NS
"""How long an M function with a jump waits for its acknowledgement where there is no path."""
SETTLE_NS: Final = 3_000 * MILLISECOND_NS
"""Longest time to get within the exact-stop window (P12018): then M2022."""


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


class Filter(Protocol):
    """What blocks pass on their way; raises ProgramError."""

    def push(self, block: PathBlock) -> list[PathBlock]: ...
    def flush(self) -> list[PathBlock]: ...


@dataclass(frozen=True)
class Services:
    """What the control does for its channel."""

    function: Callable[[Machine], None]
    """Send an M function to the PLC."""
    acknowledged: Callable[[], bool]
    """Whether all of them have been."""
    room: Callable[[], bool]
    """Whether the PLC takes more of them."""
    withdraw: Callable[[], None]
    """Take back those that have not been."""
    speed: Callable[[int, float], None]
    """S of a spindle, 1/min."""
    tool: Callable[[int], None]
    parameter: Callable[[int, float | None], None]
    say: Callable[[Message], None]
    text: Callable[[object], None]
    settled: Callable[[], bool]
    """Whether all axes are within the exact-stop window."""
    limits: Callable[[], Limits]
    counts: Callable[[], tuple[int, ...]]
    begun: Callable[[int, PathBlock], None]
    """A block of a program has begun: when, and which."""
    ended: Callable[[tuple[str, int] | None], None]
    """A program has ended by itself (None), or was broken off in a block of a program."""
    option: Callable[[int], int]
    """A parameter P of the start data, 0 if it is deleted."""
    allowed: Callable[[PathBlock], str]
    """Why a block's path must not be made, such as a software limit; empty: it may."""


@dataclass
class _Entry:
    """A block of the stretch, and how many of its pieces are to be made before it is over."""

    block: PathBlock
    until: int


class Channel:
    """Carries out what an interpreter analyses."""

    def __init__(self, interpreter: Interpreter, services: Services, filters: Callable[[], Sequence[Filter]]) -> None:
        """filters: makes new ones, objects with `push(block)` and `flush()`, in their order."""
        self._interpreter, self._do, self._new_filters = interpreter, services, filters
        self._filters: Sequence[Filter] = ()
        self.phase = Phase.IDLE
        self.run: SetPointRun | None = None
        self.single = False
        """Stop after every block."""
        self.override = 1.0
        self.block = ("", 0)
        """Program and block in execution."""
        self.column = 0
        """Where to look for its path in its text."""
        self._blocks: deque[PathBlock] = deque()
        self._stretch: deque[_Entry] = deque()
        self._plan: Joined | None = None
        self._path: Path | None = None
        self._made = 0
        """Pieces of the stretch that were made in earlier runs of it."""
        self._current: PathBlock | None = None
        """Block whose path has ended, and whose end is being carried out."""
        self._due_ns: int | None = None
        self._settles_until_ns = 0
        self._serial = 0
        self._ended = True
        """Nothing more comes from the interpreter."""
        self._holds = False
        self._drops = False
        self._branches = False
        self._poll_ns: int | None = None
        """When analysis is looked at again, that waits for a condition or supervises."""
        self._error: Message | None = None
        self._now_ns = 0

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """A program is in execution, held or not."""
        return self.phase is not Phase.IDLE

    @property
    def next_ns(self) -> int | None:
        """When `advance` is due."""
        if self.phase is Phase.PATH:
            return self._next_of_path()
        return self._due_ns

    def _next_of_path(self) -> int | None:
        """The end of the set points, the next block that speaks, and when analysis has to go on."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return self._now_ns
        marks = [run.end_ns]
        if self._poll_ns is not None:
            marks.append(self._poll_ns)
        if not plan.held:
            before = self._made
            for number, entry in enumerate(self._stretch):
                if number and _begins_with(entry.block):
                    marks.append(self._time_of(before))
                    break
                if entry.block.post and entry is not self._stretch[-1]:
                    marks.append(self._time_of(entry.until))
                    break
                before = entry.until
            if not self._ended and len(self._stretch) > REFILL:
                marks.append(self._time_of(self._stretch[-REFILL].until))
        return max(min(marks), self._now_ns)

    def _time_of(self, pieces: int) -> int:
        """When so many pieces of the stretch have been made."""
        assert self.run is not None
        assert self._plan is not None
        try:
            tick = self._plan.passed(pieces - self._made)
        except IndexError:
            return self.run.end_ns
        return self.run.start_ns + tick * PERIOD_NS

    @property
    def _shown(self) -> PathBlock | None:
        return self._current if self._current is not None else self._stretch[0].block if self._stretch else None

    @property
    def feed_mm_min(self) -> float | None:
        """Programmed feed of the block in execution."""
        return None if self._shown is None else self._shown.feed_mm_min

    @property
    def motion(self) -> float | None:
        """0 to 3, for G00 to G03, of the block in execution."""
        block = self._shown
        if block is None or not block.elements:
            return None
        element = block.elements[0]
        return 0.0 if block.rapid else (2.0 if element.sweep_rad < 0.0 else 3.0) if isinstance(element, Arc) else 1.0

    @property
    def speed_mm_s(self) -> float:
        """Along the path, now."""
        run, plan = self.run, self._plan
        if run is None or plan is None or self._now_ns >= run.end_ns:
            return 0.0
        return plan.speed(max(run.count(self._now_ns) - run.first, 0))

    @property
    def dwell_s(self) -> tuple[float | None, float | None]:
        """Of the block in execution, and what is left of it."""
        if self._shown is None or self._shown.dwell_s is None:
            return None, None
        left = 0.0
        if self.phase is Phase.DWELL and self._due_ns is not None:
            left = (self._due_ns - self._now_ns) / SECOND_NS
        return self._shown.dwell_s, left

    # ---- operating --------------------------------------------------------------------------------------------------

    def start(self, now_ns: int) -> None:
        """A program has been begun in the interpreter; carry it out."""
        self._now_ns = now_ns
        self._filters = self._new_filters()
        self._path = Path(self._do.limits(), self._position())
        self.block = ("", 0)
        self._blocks.clear()
        self._stretch.clear()
        self._ended = self._holds = self._drops = self._branches = False
        self._poll_ns = None
        self._plan, self.run, self._current, self._error = None, None, None, None
        self.phase, self._due_ns = Phase.READY, now_ns
        self.advance(now_ns)

    def go_on(self, now_ns: int) -> None:
        """Start, after Stop or M00."""
        self._now_ns = now_ns
        self._holds = False
        if self.phase is Phase.PATH and self._plan is not None and self._plan.hold and not self._drops:
            self._replan(hold=False)
        elif self.phase is Phase.HELD:
            self._resume()
        self.advance(now_ns)

    def stop(self, now_ns: int) -> None:
        """Stop: brake along the path, and wait for Start."""
        self._now_ns = now_ns
        self._holds = True
        if self.phase is Phase.PATH:
            self._replan(hold=True)
        elif self.phase in (Phase.READY, Phase.EMPTY):
            self.phase, self._due_ns = Phase.HELD, None

    def abort(self, now_ns: int) -> None:
        """Brake along the path and forget the rest."""
        self._now_ns = now_ns
        if self.phase is Phase.IDLE:
            return
        self._drops = True
        if self.phase is Phase.PATH and self._plan is not None and self.run is not None and now_ns < self.run.end_ns:
            self._replan(hold=True)
            return
        self._end(aborted=True)

    def cut(self, now_ns: int) -> None:
        """Everything ends at once: emergency stop."""
        self._now_ns = now_ns
        if self.run is not None:
            self.run = None
        if self.phase is not Phase.IDLE:
            self._end(aborted=True)

    def set_override(self, factor: float, now_ns: int) -> None:
        """Another override, 0 to 1.2."""
        self._now_ns = now_ns
        self.override = factor
        if self.phase is Phase.PATH:
            self._replan(scale=self._scale())
        elif self.phase is Phase.HELD and not self._holds and self._plan is not None and factor > 0.0:
            self._resume()

    def branch(self, now_ns: int) -> None:
        """The M function with a jump was acknowledged: its path is deleted, and the program goes on elsewhere."""
        self._now_ns = now_ns
        if self._interpreter.waiting is not Waiting.ACKNOWLEDGEMENT or self._do.option(WITHOUT_FUNCTIONS):
            return
        self._branches = True
        if self.phase is Phase.PATH:
            self._replan(hold=True, drop=True)

    # ---- going on ---------------------------------------------------------------------------------------------------

    def advance(self, now_ns: int) -> None:
        """Let time pass to now_ns: everything that is due."""
        self._now_ns = now_ns
        for _ in range(100_000):
            before = (self.phase, len(self._stretch), len(self._blocks), self.run, self._due_ns)
            self._step()
            if before == (self.phase, len(self._stretch), len(self._blocks), self.run, self._due_ns):
                return

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
                if self._due_ns is not None and self._now_ns >= self._due_ns:
                    self._after_dwell()
            case Phase.FUNCTIONS:
                if self._do.acknowledged():
                    self._branches = self._jumps and not self._do.option(WITHOUT_FUNCTIONS)
                    self._after_functions()
                elif self._due_ns is not None and self._now_ns >= self._due_ns:
                    self._after_functions()
            case Phase.EMPTY:
                if self._due_ns is not None and self._now_ns >= self._due_ns:
                    self.phase, self._due_ns = Phase.READY, self._now_ns

    # Analysis

    def _fill(self) -> None:
        """Analyse ahead, as far as there is room for it."""
        if self._poll_ns is not None and self._now_ns < self._poll_ns:
            return
        self._poll_ns = None
        if self._interpreter.waiting is Waiting.BEGINNING and not self._blocks and len(self._stretch) <= 1:
            self._interpreter.begun()
        while not self._ended and self._error is None and len(self._blocks) + len(self._stretch) < AHEAD:
            try:
                block = self._interpreter.next()
            except ProgramError as error:
                program, number = self._interpreter.place
                self._error = message(
                    error.number, program=program, block=number, column=error.column, detail=error.detail
                )
                self._flush()
                return
            for note in self._interpreter.notes:
                self._do.say(note)
                if note.effect is Effect.STOP:
                    self._holds = True
            self._interpreter.notes.clear()
            if block is None:
                self._ended = True
                self._flush()
                return
            if isinstance(block, Waiting):
                if block in (Waiting.CONDITION, Waiting.PASS, Waiting.BEGINNING):
                    self._poll_ns = self._now_ns + BLOCK_NS
                self._flush()
                return
            self._push(block)
            if block.stop in (Stop.END,):
                self._ended = True
                self._flush()
                return
            if block.stop is not Stop.NONE:
                self._flush()
                if self._interpreter.waiting is not None:
                    return

    def _push(self, block: PathBlock) -> None:
        if self._do.option(WITHOUT_MOVING):
            block = replace(block, elements=())
        self._through([block], 0)

    def _flush(self) -> None:
        try:
            for number, item in enumerate(self._filters):
                self._through(item.flush(), number + 1)
        except ProgramError as error:
            self._fault(error)

    def _through(self, blocks: list[PathBlock], first: int) -> None:
        """Blocks through the filters from one on."""
        try:
            for item in self._filters[first:]:
                blocks = [out for block in blocks for out in item.push(block)]
        except ProgramError as error:
            self._fault(error, blocks[0] if blocks else None)
            return
        self._blocks.extend(blocks)

    def _fault(self, error: ProgramError, block: PathBlock | None = None) -> None:
        program, number = (block.program, block.number) if block else self._interpreter.place
        column = error.column or (block.column if block else 0)
        self._error = message(error.number, program=program, block=number, column=column, detail=error.detail)

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
        if not self._blocks:
            self._nothing()
            return
        block = self._blocks[0]
        self._enter(block, self._now_ns)
        if why := self._do.allowed(block):
            self._blocks.clear()
            self._fail(why, block)
            return
        if not block.elements:
            self._blocks.popleft()
            self._speak(block)
            self._current = block
            self._after_functions_pre(block)
            return
        self._speak(block)
        if not self._do.acknowledged() and any(function.halt and not function.jump for function in block.pre):
            self.phase, self._due_ns = Phase.FUNCTIONS, None
            self._current = None
            return
        self._begin_path()

    def _enter(self, block: PathBlock, t_ns: int) -> None:
        """A block begins, or has begun at t_ns."""
        if self.block != (block.program, block.number) and block.number:
            self._do.begun(t_ns, block)
        self.block, self.column = (block.program, block.number), block.column

    def _fail(self, why: str, block: PathBlock) -> None:
        number, _, detail = why.partition(" ")
        self._do.say(
            message(int(number), program=block.program, block=block.number, column=block.column, detail=detail)
        )
        self._end(aborted=True)

    def _nothing(self) -> None:
        """No block waits: the program has ended, failed, or waits for something."""
        if self._error is not None:
            self._do.say(self._error)
            self._end(aborted=True)
        elif self._ended:
            self._end(aborted=False)
        else:
            self._due_ns = self._now_ns + BLOCK_NS  # waituntil, or an acknowledgement: look again
            self.phase = Phase.EMPTY

    def _after_functions_pre(self, block: PathBlock) -> None:
        """A block without a path: on with what comes behind one."""
        if block.end is BlockEnd.EXACT_STOP or block.dwell_s is not None or block.stop is not Stop.NONE:
            self._settle()
        elif any(function.halt and not function.jump for function in block.pre):
            self._after_stop()
        else:
            self._post()

    def _speak(self, block: PathBlock) -> None:
        """What happens as a block begins."""
        for number, value in block.parameters:
            self._do.parameter(number, value)
        for spindle, speed in block.speeds.items():
            self._do.speed(spindle, speed)
        if block.tool is not None:
            self._do.tool(block.tool)
        if block.text is not None:
            self._do.text(block.text)
        for function in block.pre:
            self._function(function)

    def _function(self, function: Machine) -> None:
        if not self._do.option(WITHOUT_FUNCTIONS):
            self._do.function(function)

    def _halts(self, block: PathBlock) -> bool:
        """Whether single block stops after it."""
        if not self.single or not (block.main or self._do.option(EVERY_BLOCK)):
            return False
        flags = self._do.option(START_FLAGS)
        return not flags & ONLY_REAL_TIME or _in_real_time(block)

    @property
    def _jumps(self) -> bool:
        """The block in execution has an M function with a jump."""
        return self._shown is not None and any(function.jump for function in self._shown.pre)

    # The path

    def _begin_path(self) -> None:
        """A stretch begins with the first of the waiting blocks."""
        assert self._path is not None
        self._path.limits = self._do.limits()
        self._stretch.clear()
        self._made = 0
        self._path.stop()
        pieces = self._take()
        if pieces is None:
            return
        self._serial += 1
        sine = self._path.limits.sine
        self._plan = joined(pieces, PERIOD_NS, sine=sine, scale=self._scale(), identity=self._serial)
        self.run = SetPointRun(self._plan, PERIOD_NS, self._now_ns)
        self.phase = Phase.PATH

    def _take(self) -> Pieces | None:
        """Pieces of the waiting blocks that belong to the stretch; None after an error."""
        assert self._path is not None
        chosen: list[PathBlock] = []
        while self._blocks:
            block = self._blocks[0]
            last = chosen[-1] if chosen else (self._stretch[-1].block if self._stretch else None)
            if last is not None and not _joins(last, block, self._halts(last), self._halts(block)):
                break
            if last is not None and (self._do.allowed(block) or not self._do.room()):
                break
            chosen.append(self._blocks.popleft())
        done = self._stretch[-1].until if self._stretch else 0
        try:
            pieces, counts = self._path.pieces(chosen)
        except ProgramError as error:
            first = chosen[0]
            self._do.say(
                message(
                    error.number, program=first.program, block=first.number, column=first.column, detail=error.detail
                )
            )
            self._end(aborted=True)
            return None
        for block, count in zip(chosen, counts, strict=True):
            done += count
            self._stretch.append(_Entry(block, done))
        return pieces

    @property
    def _open(self) -> bool:
        """Whether the stretch could go on with another block."""
        return (
            bool(self._stretch)
            and not _breaks_after(last := self._stretch[-1].block, self._halts(last))
            and not self._holds
        )

    def _follow(self) -> None:
        """The stretch runs: pass on from block to block, append what has been analysed, end."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return
        free = not self._branches and not self._do.option(WITHOUT_FUNCTIONS)
        if free and self._jumps and self._do.acknowledged():
            self.branch(self._now_ns)
            return
        made = self._made + plan.finished(max(run.count(self._now_ns) - run.first, 0))
        while len(self._stretch) > 1 and self._stretch[0].until <= made:
            began_ns = min(self._time_of(self._stretch[0].until), self._now_ns)
            over = self._stretch.popleft()
            for function in over.block.post:
                self._function(function)
            block = self._stretch[0].block
            self._enter(block, began_ns)
            self._speak(block)
        if self._now_ns >= run.end_ns:
            self._path_ended()
            return
        goes_on = self._open and len(self._stretch) <= REFILL
        if not self._ended and not plan.held and (goes_on or self._poll_ns is not None):
            self._fill()
        if self._blocks and self._open and not plan.held:
            pieces = self._take()
            if pieces is not None and len(pieces):
                self._replan(append=pieces)

    def _path_ended(self) -> None:
        """Set points have come to an end: of the stretch, or because it was held."""
        assert self._plan is not None
        assert self.run is not None
        plan = self._plan
        self.run = None
        if self._drops:
            self._end(aborted=True)
            return
        over = self._made + plan.finished(plan.ticks)
        if plan.held and over < self._stretch[-1].until and not self._branches:
            self._made = over
            self.phase, self._due_ns = Phase.HELD, None
            return
        self._plan = None
        self._current = self._stretch[-1].block
        self._stretch.clear()
        waits = self._current.end is BlockEnd.EXACT_STOP or self._current.dwell_s is not None
        if waits or self._current.stop is not Stop.NONE:
            self._settle()
        else:
            self._post()

    def _resume(self) -> None:
        """Go on where it was held."""
        if self._plan is None:
            self.phase, self._due_ns = Phase.READY, self._now_ns
            return
        self._serial += 1
        self._plan = self._plan.remainder(self._serial, scale=self._scale())
        self.run = SetPointRun(self._plan, PERIOD_NS, self._now_ns)
        self.phase = Phase.PATH

    def _replan(self, **changes: object) -> None:
        """Another future from the next tick on."""
        run, plan = self.run, self._plan
        if run is None or plan is None:
            return
        tick = max(0, -((run.start_ns - self._now_ns) // PERIOD_NS))
        self._plan = plan.replanned(tick, **changes)  # type: ignore[arg-type]
        self.run = replace(run, plan=self._plan)

    def _scale(self) -> float:
        block = self._stretch[0].block if self._stretch else (self._blocks[0] if self._blocks else None)
        return 1.0 if block is not None and not block.override else self.override

    # The end of a block

    def _settle(self) -> None:
        self.phase, self._due_ns = Phase.SETTLE, self._now_ns
        longest = self._do.option(LONGEST_SETTLING) * MILLISECOND_NS or SETTLE_NS
        self._settles_until_ns = self._now_ns + longest

    def _look_settled(self, now_ns: int) -> None:
        """Whether the axes are in position is asked in every cycle, and at no other time: however time is cut."""
        if self._do.settled():
            self._after_stop()
        elif now_ns >= self._settles_until_ns:
            self._do.say(self.message(2022))
            self._after_stop()
        else:
            self._due_ns = now_ns + PERIOD_NS

    def _after_stop(self) -> None:
        block = self._current
        if block is not None and block.dwell_s is not None:
            self.phase, self._due_ns = Phase.DWELL, self._now_ns + round(block.dwell_s * SECOND_NS)
            return
        self._after_dwell()

    def _after_dwell(self) -> None:
        self._post()

    def _post(self) -> None:
        """Post functions, and the wait for those with halt."""
        block = self._current
        assert block is not None
        for function in block.post:
            self._function(function)
        halting = any(function.halt and not function.jump for function in (*block.pre, *block.post))
        jumping = self._jumps and not block.elements
        jumping = jumping and not self._do.option(WITHOUT_FUNCTIONS)
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
        if block.stop is Stop.SYNCHRONISE or block.stop is Stop.MEASURING_STOP:
            self._interpreter.executed()
        if self._interpreter.waiting is Waiting.ACKNOWLEDGEMENT and not self._blocks:
            if self._branches:
                self._interpreter.stand(self._position())
                self._path = Path(self._do.limits(), self._position())
                self._filters = self._new_filters()
            elif not self._do.acknowledged():
                self._do.withdraw()
            self._interpreter.acknowledged(self._branches)
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

    def _end(self, *, aborted: bool) -> None:
        """No program any more."""
        self._interpreter.end()
        self._blocks.clear()
        self._stretch.clear()
        self._plan, self.run, self._current, self._error = None, None, None, None
        self._ended, self._holds, self._drops = True, False, False
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


def _begins_with(block: PathBlock) -> bool:
    """Whether something happens as it begins."""
    return bool(block.pre or block.parameters or block.speeds or block.text is not None or block.tool is not None)


def _in_real_time(block: PathBlock) -> bool:
    """Whether it is more than parameters and jumps."""
    return bool(
        block.elements or block.post or block.dwell_s is not None or block.stop is not Stop.NONE or _begins_with(block)
    )


def _breaks_after(block: PathBlock, halts: bool) -> bool:
    """Whether the axes stand at its end, and something is waited for. halts: single block stops there."""
    return (
        block.end is BlockEnd.EXACT_STOP
        or block.dwell_s is not None
        or block.stop is not Stop.NONE
        or any(function.halt for function in block.post)
        or halts
    )


def _joins(block: PathBlock, following: PathBlock, halts: bool, next_halts: bool) -> bool:
    """Whether a block belongs to the stretch of the one before it."""
    return (
        not _breaks_after(block, halts)
        and not any(function.halt for function in following.pre)
        and following.override == block.override
        and not (not following.elements and _breaks_after(following, next_halts))
    )
