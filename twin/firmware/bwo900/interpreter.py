"""The interpreter: blocks of a program to blocks of a path, as far ahead as it is asked (manual 3.6, 4, 6, 7.1).

    next() ---> PathBlock     the next block that has something for the real time
           ---> Waiting       for a block to be executed (M01), a parameter (waituntil), an M function with a jump
           ---> None          the program has ended

In a block: parameters, jumps by comparison, jumps by M functions, then G functions, tool, path; the subprogram call is
the last thing. What a block does to the path is one PathBlock; what a cycle does is one for each of its moves.

Everything that it knows is in its attributes, so that a control is copied with it. Whoever executes its blocks calls
`executed` when M01 has come by, and `acknowledged` for an M function with a jump.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from enum import Enum
from itertools import islice
from typing import Final

from isel_twin.firmware.bwo900.blocks import BlockEnd, Correction, Machine, PathBlock, Stop
from isel_twin.firmware.bwo900.circles import arc_by_centre, arc_by_radius
from isel_twin.firmware.bwo900.cycles.call import Call, Kind, Move
from isel_twin.firmware.bwo900.elements import XY, YZ, ZX, Element, Line, Plane, Point
from isel_twin.firmware.bwo900.expressions import Expression, Number, Parameter, Symbol, evaluate, whole
from isel_twin.firmware.bwo900.frames import Frame, Rotation, polar
from isel_twin.firmware.bwo900.functions import definition
from isel_twin.firmware.bwo900.groups import BEYOND, BLOCKWISE, GROUPS, SHIFT, START, ZERO, ZERO_POINTS, Modal
from isel_twin.firmware.bwo900.messages import Message, ProgramError, message
from isel_twin.firmware.bwo900.parameters import REAL_TIME, SYNCHRONISING, Parameters, byte
from isel_twin.firmware.bwo900.programs import Program, Store
from isel_twin.firmware.bwo900.syntax import Assign, Block, MWord, Word
from isel_twin.firmware.bwo900.tools import Tools, told

__all__ = ["DEEPEST_CALLS", "Interpreter", "Waiting"]

DEEPEST_CALLS: Final = 6
"""Subprograms inside each other (M1220)."""
DEEPEST_LOOPS: Final = 32
"""M24 inside each other (M1218); the manual names no number."""
NEAR_MM: Final = 1e-9
"""Paths shorter than this are none."""
ROTATION_SET: Final[Mapping[int, str]] = {160: "u0", 161: "v0", 163: "angle_deg"}
ROTATION_ADDED: Final[Mapping[int, str]] = {165: "du", 166: "dv", 168: "dangle_deg"}
CENTRES: Final = "IJK"
DRILLING: Final = frozenset((81, 82, 83, 84, 85))
CYCLE_PARAMETERS: Final = (*range(10, 40), *range(100, 160))
"""P that a cycle is told, as they are when it begins."""
MOST_KEPT: Final = 100_000
"""Moves of a cycle that supervision keeps (M8006)."""
STAYING, ADDRESSED = 0x01, 0x02
"""Bits of P8806, byte 3: drilling cycles stay until G80; their parameters are words."""


class Waiting(Enum):
    """What analysis waits for."""

    EXECUTION = "the last block, to be executed"
    CONDITION = "the parameters that waituntil asks for"
    ACKNOWLEDGEMENT = "the M function with a jump"
    BEGINNING = "the path of the last block, to begin (sc:2)"
    PASS = "the next pass: a block of supervision (sc:1) has been analysed"


@dataclass
class _Level:
    """A program that is being executed: the place of the next block, where it ends, and its loops."""

    program: Program
    place: int = 0
    last: int | None = None
    """Place of the last block to be executed, of a call with an end."""
    loops: list[tuple[int, int, int]] = field(default_factory=list)
    """Place after M24, passes that are left, this one included, and all of them."""
    cycle: bool = False
    """It was called as a cycle: its blocks are intermediate ones."""
    change: bool = False
    """It is Z6: at its end the tool data are activated."""


class Interpreter:
    """One channel's interpreter."""

    def __init__(self, parameters: Parameters, store: Store, *, cycles: Mapping[int, object] | None = None) -> None:
        """cycles: functions of cycles by their G number, `Call -> Iterator[Move]`; None: those of `cycles.table`."""
        if cycles is None:
            from isel_twin.firmware.bwo900.cycles.table import CYCLES

            cycles = CYCLES
        self._parameters, self._store, self._cycles = parameters, store, dict(cycles)
        self._tools = Tools(parameters)
        self.notes: list[Message] = []
        """Messages that stop or are shown, and do not break off; whoever executes takes them."""
        self._reset((0.0, 0.0, 0.0))

    # Programs

    def _reset(self, position: Point) -> None:
        self._names = {name: axis for axis, (name, _) in enumerate(self._parameters.axes)}
        axes = len(self._names)
        self._levels: list[_Level] = []
        self._ready: deque[PathBlock] = deque()
        self._cycle_now: _Cycle | None = None
        self._waiting: Waiting | None = None
        self._supervises = False
        """sc:1, sc:2: what blocks come to stays here."""
        self._kept: list[PathBlock] = []
        self._stale = self._measured = False
        """A block that was waited for has been executed; it had M00."""
        self._lets_go = False
        """The block has said sc:0 or sc:100."""
        self._symbols: dict[str, float] = {}
        self._bound: dict[str, int] = {}
        self._modal = START
        self._planes = {number: self._plane(number) for number in (17, 18, 19)}
        self._rotation, self._shift, self._correction = Rotation(), (0.0,) * axes, (0.0,) * axes
        self._length = self._tools.length_mm
        self._position = tuple(position) + (0.0,) * (axes - len(position))
        """Where the path has got to, in machine coordinates."""
        self._known_frame: tuple[object, ...] | None = None
        """What the frame has been worked out from."""
        self._frame = self._frame_now()
        self._program_position = self._frame.program(self._position)
        self._centre: dict[str, float] = {}
        self._radius: float | None = None
        self._feed: float | None = None
        self._speed: float | None = None
        self._turning = 0
        self._pole, self._polar = (0.0, 0.0), (0.0, 0.0)
        self._tool: int | None = None
        self._jump_to: tuple[str, int] | None = None
        self._skips = False
        self._drilling: int | None = None
        """The drilling cycle that stays."""
        self._block_now: Block | None = None

    def begin(self, name: str, position: Point, block: int | None = None, skips: bool = False) -> None:
        """Begin a program, at a block if one is given. position: of the axes, machine coordinates, mm. skips: `/` does.

        Raises ProgramError: M1252 there is no such program, M1255 no such block.
        """
        program = self._store.find(name)
        place = 0 if block is None else program.place(block)
        self._reset(position)
        self._levels, self._skips = [_Level(program, place)], skips
        for number in self._starting():
            self._modal = self._modal.with_g(number)
        self._renew()

    def _starting(self) -> Iterator[int]:
        """G functions that a program begins with, beyond START (P8830, P8853, P8650 to the first deleted one)."""
        p = self._parameters
        if zero := int(p.get(8_830)):
            yield self._known(zero, ZERO, 1249)
        if coordinates := int(p.get(8_853)):
            yield self._known(coordinates, GROUPS[147], 1249)
        for number in range(8_650, 8_660):
            if not p.loaded(number):
                return
            yield self._known(int(p.get(number)), None, 1249)

    def _known(self, number: int, group: int | None, error: int) -> int:
        if GROUPS.get(number) is None or (group is not None and GROUPS[number] != group):
            raise ProgramError(error, f"G{number} at the start of a program")
        return number

    @property
    def active(self) -> bool:
        """A program is being analysed."""
        return bool(self._levels)

    @property
    def waiting(self) -> Waiting | None:
        """What it waits for."""
        return self._waiting

    @property
    def place(self) -> tuple[str, int]:
        """Name of the program and number of the block that is analysed, 0 if it has none."""
        if not self._levels:
            return "", 0
        level = self._levels[-1]
        number = level.program.number(min(level.place, len(level.program) - 1)) if len(level.program) else 0
        return level.program.name, max(number, 0)

    @property
    def modal(self) -> Modal:
        """What is in force for the next block."""
        return self._modal

    @property
    def frame(self) -> Frame:
        """The same, of coordinates."""
        return self._frame

    @property
    def depth(self) -> int:
        """Subprograms that are open."""
        return max(len(self._levels) - 1, 0)

    @property
    def loops(self) -> list[tuple[int, int]]:
        """Passes and passes left of each open loop of the program that is analysed, the innermost last."""
        return [(passes, left) for _, left, passes in self._levels[-1].loops] if self._levels else []

    @property
    def feed_mm_min(self) -> float | None:
        """F, None before there is one."""
        return self._feed

    @property
    def program_position(self) -> Point:
        """The target that has been analysed last, in the program's coordinates."""
        return self._program_position

    def put_back(self, *blocks: PathBlock) -> None:
        """Blocks that are to come next."""
        self._ready.extendleft(reversed(blocks))

    def end(self) -> None:
        """The program has ended or is broken off: its symbols, corrections and tool are gone."""
        self._levels, self._waiting = [], None
        self._ready.clear()
        self._cycle_now = None
        self._tools.end()

    def executed(self) -> None:
        """The block that analysis waits for has been executed; tool data may have changed."""
        if self._waiting is Waiting.EXECUTION:
            self._waiting = None
            self._stale = True

    def _refresh(self) -> None:
        """What may have changed while a block was waited for; after M00 the tool's length, too."""
        self._stale = False
        if self._measured:
            self._length = self._tools.length_mm
        self._renew()

    def begun(self) -> None:
        """The path of the last block has begun."""
        if self._waiting is Waiting.BEGINNING:
            self._waiting = None

    def acknowledged(self, jumps: bool) -> None:
        """The M function with a jump was acknowledged and its path deleted (jumps), or the path has been made."""
        if self._waiting is Waiting.ACKNOWLEDGEMENT:
            self._waiting = None
            if jumps and self._jump_to is not None:
                self._go(*self._jump_to)
            self._jump_to = None

    def stand(self, position: Point) -> None:
        """The axes stand elsewhere than the path has got to: a deleted path, a move in another mode."""
        self._position = tuple(position) + self._position[len(position) :]
        self._program_position = self._frame.program(self._position)

    # Analysis

    def next(self) -> PathBlock | Waiting | None:
        """Analyse until there is a block for the path, or nothing; one block of the program at most.

        Raises ProgramError with the column; `place` tells which block. A block without anything for the path gives
        an empty PathBlock, so that analysis takes its time with it, too.
        """
        if self._ready:
            return self._ready.popleft()
        if self._stale:
            self._refresh()
        if self._cycle_now is not None:
            return self._next_of_cycle(self._cycle_now)
        if self._waiting is Waiting.CONDITION and self._block_now is not None and self._holds(self._block_now):
            self._waiting = None
        if self._waiting is not None:
            return self._waiting
        if not self._levels:
            return None
        level = self._levels[-1]
        if level.place >= len(level.program) or (level.last is not None and level.place > level.last):
            return self._returned(level)
        block = level.program.block(level.place)
        level.place += 1
        if block.skip and self._skips:
            return self._empty(block)
        self._block_now = block
        if block.wait is not None and not self._holds(block):
            self._waiting = Waiting.CONDITION
            return self._waiting
        try:
            self._execute(block)
        except ProgramError as error:
            level.place -= 1
            error.column = error.column or block.column
            raise
        if self._supervises and not self._lets_go and self._stays():
            return Waiting.PASS
        return self._ready.popleft() if self._ready else self._empty(block)

    def _stays(self) -> bool:
        """Keep what a block of supervision has come to, unless it has functions or ends something."""
        speaks = any(b.pre or b.post or b.stop is not Stop.NONE or b.parameters for b in self._ready)
        if speaks or self._waiting not in (None, Waiting.BEGINNING) or not self._levels:
            return False
        self._kept += [made for made in self._ready if made.elements or made.dwell_s is not None or made.speeds]
        self._ready.clear()
        return True

    def _call_system(self, block: Block) -> None:
        """`sc:n`: 0 blocks go on, 1 and 2 they stay (supervision), 100 those that stay go on now."""
        self._lets_go = False
        for expression in block.calls:
            number = whole(self._value(expression))
            if number not in (0, 1, 2, 100):
                raise ProgramError(1211, f"sc:{number}; there are 0, 1, 2 and 100")
            if number in (0, 100):
                self._ready.extendleft(reversed(self._kept))
                self._kept.clear()
                self._lets_go = True
            if number != 100:
                self._supervises = number in (1, 2)
            if number == 2:
                self._waiting = Waiting.BEGINNING

    def _empty(self, block: Block) -> PathBlock:
        level = self._levels[-1] if self._levels else None
        name = level.program.name if level else ""
        return PathBlock(name, block.number or 0, block.column, start=self._position, plane=self._frame.plane)

    def _returned(self, level: _Level) -> PathBlock | None:
        """A subprogram has come to its end, or the main program has without M30."""
        self._levels.pop()
        if level.change:
            self._activate_tool()
        if self._levels:
            return PathBlock(level.program.name, 0, start=self._position, plane=self._frame.plane, main=False)
        self._tools.end()
        return PathBlock(level.program.name, 0, start=self._position, plane=self._frame.plane, stop=Stop.END)

    def _holds(self, block: Block) -> bool:
        wait = block.wait
        return wait is None or _compare(self._value(wait.left), wait.relation, self._value(wait.right))

    def _execute(self, block: Block) -> None:
        """One block, in the manual's order."""
        level = self._levels[-1]
        self._call_system(block)
        later = self._assign(block)
        goal = self._parameter_jump(block)
        spoken = _Spoken(block, level.program.name, main=not any(level.cycle for level in self._levels))
        spoken.parameters = later
        spoken.synchronises = any(self._synchronises(assign) for assign in block.assignments)
        self._functions(block, spoken)
        if goal is None:
            goal = spoken.goal
        self._words(block, spoken)
        if self._cycle_now is not None:
            self._cycle_now.goal = goal
        else:
            self._conclude(goal, spoken, level)

    def _conclude(self, goal: tuple[str, int] | None, spoken: _Spoken, level: _Level) -> None:
        """What a block does last: it leads elsewhere."""
        if goal is not None and spoken.jump is None:
            self._go(*goal)
        elif spoken.call is not None:
            self._call(spoken)
        self._loop(spoken, level)

    # Parameters

    def parameter(self, area: str, number: int, channel: int) -> float:
        """See expressions.Environment; records of tools say T0 where there has never been one."""
        if area == "P" and channel == 1 and told(number):
            return self._parameters.get(number)
        return self._parameters.read(area, number, channel)

    def symbol(self, name: str, index: int) -> float:
        """See expressions.Environment: a bound symbol is its parameter, another one a variable, 0 before it is set."""
        if name in self._bound:
            return self._parameters.read("P", self._bound[name] + index)
        return self._symbols.get(self._internal(name, index), 0.0)

    def _internal(self, name: str, index: int) -> str:
        """The name of an internal variable, which has no index (manual 3.6: only those of parameters have)."""
        if index:
            raise ProgramError(1307, f"{name}[{index}]: an index needs a symbol that is bound to a parameter")
        return name

    def _value(self, expression: Expression) -> float:
        return expression.value if isinstance(expression, Number) else evaluate(expression, self)

    def _assign(self, block: Block) -> tuple[tuple[int, float | None], ...]:
        """Carry out the assignments; what is to be written in real time is returned."""
        later: list[tuple[int, float | None]] = []
        for assign in block.assignments:
            value = None if assign.value is None else self._value(assign.value)
            target = assign.target
            if isinstance(target, Symbol):
                index = 0 if target.index is None else whole(self._value(target.index), 1202)
                if assign.bind:
                    self._bound[target.name] = whole(value or 0.0, 1202)
                elif target.name in self._bound:
                    self._write("P", self._bound[target.name] + index, 1, value, later)
                else:
                    self._symbols[self._internal(target.name, index)] = 0.0 if value is None else value
            else:
                number = whole(self._value(target.number), 1202)
                self._write(target.area, number, target.channel, value, later)
        return tuple(later)

    def _write(
        self, area: str, number: int, channel: int, value: float | None, later: list[tuple[int, float | None]]
    ) -> None:
        p = self._parameters
        if area == "P" and channel == 1 and p.has(number, REAL_TIME):
            later.append((number, value))
            return
        p.write(number, value, area, channel)
        if area == "P" and channel == 1:
            self._follow(number, value)

    def _follow(self, number: int, value: float | None) -> None:
        """What a parameter does besides being kept."""
        if number in ROTATION_SET:
            self._rotation = self._rotation.set(**{ROTATION_SET[number]: value or 0.0})
            self._renew()
        elif number in ROTATION_ADDED:
            self._rotation = self._rotation.added(**{ROTATION_ADDED[number]: value or 0.0})
            self._renew()
        elif number == 8_045 and value == 1.0:
            self._tools.change()
        elif number == 8_047 and value == 1.0:
            self._tools.put_back()

    def _synchronises(self, assign: Assign) -> bool:
        target = assign.target
        if not isinstance(target, Parameter) or not isinstance(target.number, Number):
            return False
        return self._parameters.has(int(target.number.value), SYNCHRONISING, target.area, target.channel)

    def _parameter_jump(self, block: Block) -> tuple[str, int] | None:
        """Where the first comparison that is true leads to."""
        for jump in block.jumps:
            if _compare(self._value(jump.left), jump.relation, self._value(jump.right)):
                return self._levels[-1].program.name, whole(self._value(jump.target), 1255)
        return None

    # Functions

    def _functions(self, block: Block, spoken: _Spoken) -> None:
        """G and M functions, tool and speeds."""
        for g in block.g:
            self._g(g.number, spoken, g.column)
            if g.number == 4:
                if g.extension is None:
                    raise ProgramError(1211, "G04 without a time", g.column)
                spoken.dwell_s = self._value(g.extension)
        for word in block.words:
            self._tool_word(word, spoken)
        for m in block.m:
            self._m(m, spoken)
        if spoken.zero_cleared:
            self._shift = (0.0,) * len(self._names)
        self._renew()

    def _g(self, number: int, spoken: _Spoken, column: int) -> None:
        group = GROUPS.get(number)
        if number in BLOCKWISE:
            spoken.blockwise.add(number)
        elif group is not None:
            if group in spoken.groups and spoken.groups[group] != number and group != GROUPS[61]:
                raise ProgramError(1232, f"G{spoken.groups[group]} and G{number}", column)
            spoken.groups[group] = number
            if number in ZERO_POINTS and number >= 154 and number // 100 > int(self._parameters.get(174, 0.0, "q")):
                raise ProgramError(1232, f"G{number}: q174 allows no such zero point", column)
            if group == SHIFT:
                spoken.shifts = True
            if group == ZERO:
                spoken.zero_cleared = True
            if number == 46:
                self._rotation = replace(self._rotation, du=0.0, dv=0.0, dangle_deg=0.0)
            self._modal = self._modal.with_g(number)
        elif number in BEYOND:
            raise ProgramError(1232, f"G{number}: {BEYOND[number]} are not in this twin", column)
        elif number in self._cycles or number == 82:
            spoken.cycles.append(number)
            if number in DRILLING and self._drill_flags & STAYING:
                self._drilling = number
        elif number == 80:
            self._drilling = None
        elif f"Z{number}" in self._store:
            spoken.call = (f"Z{number}", None, None)
        else:
            raise ProgramError(1252, f"G{number} is no path condition, and there is no Z{number}", column)

    def _tool_word(self, word: Word, spoken: _Spoken) -> None:
        p = self._parameters
        match word.name:
            case "T":
                spoken.tool = whole(self._value(word.value))
            case "t":
                p.write(8_162, self._value(word.value))
            case "tr":
                p.write(8_160, self._value(word.value))
                p.write(8_162, 0.0)
            case "tl":
                p.write(8_161, self._value(word.value))
                p.write(8_163, 0.0)
                spoken.length = True
            case "tq":
                p.write(8_164, self._value(word.value))
            case _ if word.name[0] == "S":
                spindle = int(word.name[1:] or "1")
                spoken.speeds[spindle] = self._value(word.value)
                if spindle == 1:
                    self._speed = spoken.speeds[spindle]

    def _m(self, m: MWord, spoken: _Spoken) -> None:
        values = tuple(None if e is None else whole(self._value(e)) for e in m.extensions)
        match m.number:
            case 0:
                self._without_correction(1232, "M00", m.column)
                spoken.stop = Stop.MEASURING_STOP
                self._machine_function(m, (), spoken)
            case 1:
                self._without_correction(1229, "M01", m.column)
                if 123 in spoken.blockwise:
                    raise ProgramError(1226, "G123 with M01", m.column)
                spoken.stop = Stop.SYNCHRONISE
            case 2:
                spoken.returns = True
            case 16:
                spoken.activates = True
            case 23:
                spoken.goal = self._goal(values, m)
            case 24:
                if len(values) != 1 or values[0] is None or values[0] < 1:
                    raise ProgramError(1218, "M24.passes, at least 1", m.column)
                spoken.passes = values[0]
            case 25:
                if not self._levels[-1].loops:
                    raise ProgramError(1217, column=m.column)
                spoken.loops_back = True
            case 26:
                pass  # accepted, without effect: nothing deletes a path (Z14)
            case 28:
                spoken.call = self._called(values, m)
            case 29:
                spoken.stop = Stop.REPEAT
            case 30:
                spoken.stop = Stop.END
            case _:
                self._machine_function(m, values, spoken)

    def _without_correction(self, error: int, name: str, column: int) -> None:
        if self._modal.radius != 40:
            raise ProgramError(error, f"{name} with radius correction", column)

    def _goal(self, values: Sequence[int | None], m: MWord) -> tuple[str, int]:
        """M23.block, M23.program.block."""
        if len(values) == 1 and values[0] is not None:
            return self._levels[-1].program.name, values[0]
        if len(values) == 2 and values[0] is not None and values[1] is not None:
            return f"P{values[0]}", values[1]
        raise ProgramError(1211, f"M{m.number}.block or M{m.number}.program.block", m.column)

    def _called(self, values: Sequence[int | None], m: MWord) -> tuple[str, int | None, int | None]:
        """M28.P, M28.P.start, M28.P.start_end, M28..start."""
        if not 1 <= len(values) <= 2 or (values[0] is None and (len(values) == 1 or values[1] is None)):
            raise ProgramError(1219, "M28.program, M28.program.start_end or M28..start", m.column)
        name = self._levels[-1].program.name if values[0] is None else f"P{values[0]}"
        last = None if m.last is None else whole(self._value(m.last))
        return name, values[1] if len(values) == 2 else None, last

    def _machine_function(self, m: MWord, values: tuple[int | None, ...], spoken: _Spoken) -> None:
        """One for the PLC, or a cycle, or with a jump."""
        if m.number == 6 and "Z6" in self._store:
            spoken.call, spoken.changes = ("Z6", None, None), True
            return
        defined = definition(m.number, self._parameters)
        if defined.cycle:
            if values:
                raise ProgramError(1228, f"M{m.number} is a cycle: nothing may stand behind it", m.column)
            if f"Z{m.number}" not in self._store:
                raise ProgramError(1252, f"Z{m.number}", m.column)
            spoken.call = (f"Z{m.number}", None, None)
            return
        if defined.jump != bool(values) and (defined.jump or m.number > 30):
            wrong = "is defined with a jump and has none" if defined.jump else "has a jump and is not defined with one"
            raise ProgramError(1228, f"M{m.number} {wrong}", m.column)
        if defined.jump:
            spoken.jump = self._goal(values, m)
        function = Machine(m.number, tuple(float(v or 0) for v in values), defined.halt, defined.jump)
        if defined.pre:
            spoken.pre.append(function)
        if defined.post:
            spoken.post.append(function)
        self._turning = {3: 1, 4: -1, 5: 0}.get(m.number, self._turning)
        spoken.synchronises = spoken.synchronises or defined.synchronises
        spoken.changes = spoken.changes or m.number == 6

    # Words and paths

    def _words(self, block: Block, spoken: _Spoken) -> None:
        """Path, feed, and what goes with them: a PathBlock, or those of a cycle."""
        self._select(spoken)
        taken = self._drilling_words(block, spoken)
        self._feed_words(block, spoken, taken)
        targets = self._axis_words(block, spoken, taken)
        if self._drilling is not None and targets and not spoken.cycles:
            spoken.cycles.append(self._drilling)
        if spoken.cycles:
            self._cycle(block, spoken, targets)
            return
        elements: tuple[Element, ...] = ()
        if targets is not None:
            elements = self._path(block, targets, spoken)
        self._emit(spoken, elements)
        self._after(spoken)

    def _select(self, spoken: _Spoken) -> None:
        """The tool of a T word, and M16."""
        if spoken.tool is not None and spoken.tool != self._tool:
            self._tools.request(spoken.tool)
            self._tool = spoken.tool
            if "Z5" in self._store and spoken.call is None:
                spoken.call = ("Z5", None, None)
        if spoken.activates and spoken.tool is not None:
            self._tools.reckon(spoken.tool)

    def _after(self, spoken: _Spoken) -> None:
        """What becomes true at the end of the block."""
        if spoken.changes and spoken.call is None:
            self._tools.change()
        if spoken.activates or spoken.length or (spoken.changes and spoken.call is None):
            self._activate_tool()

    def _activate_tool(self) -> None:
        self._length = self._tools.length_mm
        self._renew()

    @property
    def _drill_flags(self) -> int:
        return byte(self._parameters.get(8_806), 3)

    def _drilling_words(self, block: Block, spoken: _Spoken) -> frozenset[str]:
        """Words that are parameters of the block's drilling cycle; their names."""
        if not DRILLING.intersection(spoken.cycles) or not self._drill_flags & ADDRESSED:
            return frozenset()
        third = self._frame.plane.third
        axis = next(name for name, number in self._names.items() if number == third)
        numbers = {"F": 32, axis: 33, "R": 34, CENTRES[third]: 35, "H": 36}
        taken = [word for word in block.words if word.name in numbers]
        for word in taken:
            self._parameters.write(numbers[word.name], self._value(word.value))
        return frozenset(word.name for word in taken)

    def _feed_words(self, block: Block, spoken: _Spoken, taken: frozenset[str]) -> None:
        for word in block.words:
            if word.name in taken:
                continue
            if word.name == "F":
                self._feed = self._value(word.value)
            elif word.name == "f":
                spoken.end_feed = self._value(word.value)
            elif word.name in CENTRES:
                self._centre[word.name] = self._value(word.value)
                self._radius = None
            elif word.name == "R":
                self._radius = self._value(word.value)

    def _axis_words(self, block: Block, spoken: _Spoken, taken: frozenset[str]) -> dict[int, float] | None:
        """Targets in program coordinates by axis; None if the block has none. G44, G92 and poles take theirs.

        taken: words of a drilling cycle; its depth alone drills where the tool stands.
        """
        named: dict[int, float] = {}
        radial: dict[str, float] = {}
        letters = {chr(int(self._parameters.get(q, d, "q"))): part for q, d, part in ((150, 120, "r"), (151, 99, "a"))}
        for word in block.words:
            if word.name in taken:
                if word.name in self._names:
                    first = self._frame.plane.first
                    named.setdefault(first, 0.0 if self._modal.dimension == 91 else self._program_position[first])
            elif word.name in self._names:
                named[self._names[word.name]] = self._value(word.value)
            elif word.name in letters and self._modal.polar == 10:
                radial[letters[word.name]] = self._value(word.value)
            elif word.name[0] not in "FSTIJKRft":
                raise ProgramError(1216, word.name, word.column)
        if spoken.shifts or spoken.groups.get(GROUPS[44]) == 44:
            self._consume(named, spoken)
            return None
        plane = self._frame.plane
        if self._modal.polar == 10:
            u, v = named.pop(plane.first, None), named.pop(plane.second, None)
            if u is not None or v is not None:
                pole = self._pole
                self._pole = (pole[0] if u is None else u, pole[1] if v is None else v)
            if radial:
                self._polar = (radial.get("r", self._polar[0]), radial.get("a", self._polar[1]))
                named[plane.first], named[plane.second] = polar(self._pole, *self._polar)
                return self._absolute(named, set(named) - {plane.first, plane.second})
        return self._absolute(named, set(named)) if named else None

    def _consume(self, named: dict[int, float], spoken: _Spoken) -> None:
        """G92, G44: the words are a shift or a correction, nothing moves."""
        values = tuple(named.get(axis, 0.0) for axis in range(len(self._names)))
        if spoken.shifts:
            self._shift = values
            for axis, value in enumerate(values):
                self._parameters.write(9_500 + axis, value)
        else:
            self._correction = tuple(named.get(axis, before) for axis, before in enumerate(self._correction))
        self._renew()

    def _absolute(self, named: Mapping[int, float], relative: set[int]) -> dict[int, float]:
        """Targets from words: with G91 those of `relative` count from where the program is."""
        if self._modal.dimension == 90:
            return dict(named)
        now = self._program_position
        return {axis: value + (now[axis] if axis in relative else 0.0) for axis, value in named.items()}

    def _path(self, block: Block, targets: Mapping[int, float], spoken: _Spoken) -> tuple[Element, ...]:
        """The elements to a target. Moves the position there."""
        frame = self._frame.bare if 66 in spoken.blockwise else self._frame
        start_program = frame.program(self._position) if 66 in spoken.blockwise else self._program_position
        goal = tuple(targets.get(axis, value) for axis, value in enumerate(start_program))
        motion = self._modal.motion
        if 123 in spoken.blockwise and motion == 0:
            self._modal = self._modal.with_g(1)
            motion = 1
        end = self._machine(frame, goal, targets)
        if motion in (2, 3) and self._turns(goal, start_program, targets):
            element: Element | None = self._circle(frame, start_program, goal, end, motion, block)
        else:
            element = Line(self._position, end) if math.dist(self._position, end) > NEAR_MM else None
        if element is not None and motion and self._feed is None and spoken.feed is None:
            raise ProgramError(1230)
        self._position = end
        self._program_position = goal if 66 not in spoken.blockwise else self._frame.program(end)
        return () if element is None else (element,)

    def _machine(self, frame: Frame, goal: Point, targets: Mapping[int, float]) -> Point:
        """The machine's place of a target; axes without a word stay, unless the plane turns with them."""
        place = frame.machine(goal)
        plane = frame.plane
        turned = frame.rotation is not None and (plane.first in targets or plane.second in targets)
        moving = set(targets) | ({plane.first, plane.second} if turned else set())
        return tuple(place[axis] if axis in moving else now for axis, now in enumerate(self._position))

    def _turns(self, goal: Point, start: Point, targets: Mapping[int, float]) -> bool:
        """Whether a block with G02 or G03 has a circle to make."""
        plane = self._frame.plane
        return plane.first in targets or plane.second in targets or bool(self._centre or self._radius)

    def _circle(
        self, frame: Frame, start_program: Point, goal: Point, end: Point, motion: int, block: Block
    ) -> Element:
        """The arc to a target: by radius, or by the centre of I, J, K."""
        plane = frame.plane
        turn = 1 if (motion == 3) != frame.mirrored else -1
        if self._radius is not None:
            arc, corrected = arc_by_radius(self._position, end, plane, self._radius, turn)
            if corrected:
                self.notes.append(self._said(1234, f"half of the chord is {abs(arc.radius_mm):.4g} mm"))
            return arc
        if not self._centre:
            raise ProgramError(1233)
        if all(block.word(name) for name in (*CENTRES, *list(self._names)[:3])):
            raise ProgramError(1232, "circles in space are not in this twin")
        letters = (CENTRES[plane.first], CENTRES[plane.second])
        base = plane.of(start_program) if self._modal.dimension == 91 else (0.0, 0.0)
        here = plane.of(start_program)
        u, v = (
            base[i] + self._centre[letter] if letter in self._centre else (here[i] if base[i] else 0.0)
            for i, letter in enumerate(letters)
        )
        centre = frame.centre((u, v))
        return arc_by_centre(self._position, end, plane, centre, turn, self._parameters.given(8_843, 0.003))

    def _said(self, number: int, detail: str) -> Message:
        name, block = self._levels[-1].program.name, self._block_now.number if self._block_now else 0
        return message(number, program=name, block=block or 0, detail=detail)

    def _emit(self, spoken: _Spoken, elements: tuple[Element, ...], **changes: object) -> None:
        """A PathBlock of what the block has said."""
        rapid = self._modal.motion == 0
        start = elements[0].start if elements else self._position
        p = self._parameters
        g12 = 12 in spoken.blockwise
        made = PathBlock(
            program=spoken.program,
            number=spoken.block.number or 0,
            column=spoken.block.column,
            start=start,
            elements=elements,
            plane=self._frame.plane,
            rapid=rapid,
            feed_mm_min=None if rapid else (spoken.feed if spoken.feed is not None else self._feed),
            end_feed_mm_min=spoken.end_feed,
            override=self._modal.override != 63,
            end=self._block_end(spoken, rapid),
            correction=self._correction_of(spoken),
            tool_mm=abs(self._tools.radius_mm) if elements and not rapid else 0.0,
            chamfer_mm=p.get(70) if g12 and p.given(70, 0.0) and not p.given(71, 0.0) else None,
            rounding_mm=p.get(71) if g12 and p.given(71, 0.0) else None,
            three_points=123 in spoken.blockwise,
            pre=tuple(spoken.pre),
            post=tuple(spoken.post),
            dwell_s=spoken.dwell_s,
            speeds=dict(spoken.speeds),
            tool=spoken.tool,
            parameters=spoken.parameters,
            text=spoken.block.message,
            stop=spoken.stop,
            main=spoken.main,
        )
        if changes:
            made = replace(made, **changes)  # type: ignore[arg-type]
        self._ready.append(made)
        if made.stop is Stop.SYNCHRONISE or made.stop is Stop.MEASURING_STOP or spoken.synchronises:
            self._waiting = Waiting.EXECUTION
            self._measured = made.stop is Stop.MEASURING_STOP
            if made.stop is Stop.NONE:
                self._ready[-1] = replace(made, stop=Stop.SYNCHRONISE)
        if spoken.jump is not None:
            self._waiting, self._jump_to = Waiting.ACKNOWLEDGEMENT, spoken.jump

    def _block_end(self, spoken: _Spoken, rapid: bool) -> BlockEnd:
        halting = any(function.halt for function in (*spoken.pre, *spoken.post))
        if 8 in spoken.blockwise or spoken.dwell_s is not None or halting:
            return BlockEnd.EXACT_STOP
        if 9 in spoken.blockwise:
            return BlockEnd.CONTINUOUS
        if self._modal.exact == 28:
            return BlockEnd.EXACT_STOP
        if rapid:
            return (BlockEnd.EXACT_STOP, BlockEnd.FEED_STOP, BlockEnd.CONTINUOUS)[
                min(max(int(self._parameters.get(8_858)), 0), 2)
            ]
        return BlockEnd.CONTINUOUS

    def _correction_of(self, spoken: _Spoken) -> Correction:
        if self._modal.radius == 40 or 66 in spoken.blockwise:
            return Correction()
        side = 1 if self._modal.radius == 41 else -1
        radius = self._tools.radius_mm
        if (radius < 0.0) != self._frame.mirrored:
            side = -side
        return Correction(side, abs(radius))

    # Cycles

    def _cycle(self, block: Block, spoken: _Spoken, targets: Mapping[int, float] | None) -> None:
        """The moves of a cycle, each a PathBlock of its own."""
        numbers = [81 if number == 82 else number for number in spoken.cycles]
        outer = next((n for n in numbers if 86 <= n <= 89), None)
        inner = next((n for n in numbers if n != outer), None if outer is None else self._drilling)
        first = outer if outer is not None else numbers[0]
        if len(numbers) > (2 if outer is not None else 1):
            raise ProgramError(1232, f"cycles {', '.join(f'G{n}' for n in numbers)} in one block")
        after, stop = list(spoken.post), spoken.stop
        spoken.post, spoken.stop = [], Stop.NONE
        moves = _Moves(self._cycles, first, self._call_of(targets or {}, inner))
        plane = self._frame.plane
        comes = outer == 89 or (outer is not None and not {plane.first, plane.second}.isdisjoint(targets or {}))
        self._cycle_now = _Cycle(spoken, self._levels[-1], moves, after, stop, self._modal, comes)
        self._go_on_with(self._cycle_now)
        while self._supervises and self._cycle_now is not None:
            if self._cycle_now.moves.made >= MOST_KEPT:
                raise ProgramError(8006, f"more than {MOST_KEPT} moves under supervision")
            self._go_on_with(self._cycle_now)

    def _go_on_with(self, cycle: _Cycle) -> None:
        """The next move of a cycle, or its end."""
        spoken = cycle.spoken
        move = next(cycle.moves, None)
        if move is not None:
            pre: list[Machine] = []
            if cycle.comes and cycle.moves.made == 1:
                pre, spoken.pre = spoken.pre, []
            self._move(move, spoken)
            spoken.pre, spoken.speeds, spoken.parameters, spoken.tool = pre, {}, (), None
            return
        self._cycle_now, self._modal = None, cycle.modal
        spoken.post, spoken.stop, spoken.dwell_s, spoken.feed = cycle.post, cycle.stop, None, None
        self._emit(spoken, (), main=spoken.main)
        self._after(spoken)

    def _next_of_cycle(self, cycle: _Cycle) -> PathBlock:
        """The block of a cycle's next move; with its end, what else its block does."""
        try:
            self._go_on_with(cycle)
            if self._cycle_now is None:
                self._conclude(cycle.goal, cycle.spoken, cycle.level)
        except ProgramError:
            self._cycle_now = None
            cycle.level.place -= 1
            raise
        return self._ready.popleft()

    def _call_of(self, targets: Mapping[int, float], inner: int | None) -> Call:
        p = self._parameters
        loaded = {number: p.get(number) for number in CYCLE_PARAMETERS if p.loaded(number)}
        return Call(
            parameters=loaded,
            position=self._program_position,
            plane=self._frame.plane,
            words=dict(targets),
            feed_mm_min=self._feed,
            rapid_mm_min=self._rapid,
            speed_rpm=self._speed,
            turning=self._turning,
            motion=self._modal.motion,
            tool_radius_mm=abs(self._tools.radius_mm),
            inner=inner,
            strict=True,
        )

    @property
    def _rapid(self) -> float:
        """Rapid speed in mm/min: P8816, or the fastest axis."""
        p = self._parameters
        fastest = max((p.axis(axis, 4, 0.0) for axis in range(len(self._names))), default=0.0)
        return p.given(8_816, fastest)

    def _move(self, move: Move, spoken: _Spoken) -> None:
        """One move of a cycle as a PathBlock."""
        kinds = {Kind.RAPID: 0, Kind.LINE: 1, Kind.CLOCKWISE: 2, Kind.COUNTER_CLOCKWISE: 3, Kind.TAP: 1}
        self._modal = self._modal.with_g(kinds[move.kind])
        spoken.feed = move.feed_mm_min
        spoken.dwell_s = move.dwell_s
        elements: tuple[Element, ...] = ()
        if move.centre is not None:
            goal = tuple(move.target.get(axis, value) for axis, value in enumerate(self._program_position))
            end = self._machine(self._frame, goal, move.target)
            turn = 1 if (move.kind is Kind.COUNTER_CLOCKWISE) != self._frame.mirrored else -1
            centre = self._frame.centre(move.centre)
            tolerance = self._parameters.given(8_843, 0.003)
            elements = (arc_by_centre(self._position, end, self._frame.plane, centre, turn, tolerance),)
            self._position, self._program_position = end, goal
        elif move.target:
            elements = self._path(spoken.block, move.target, spoken)
        functions = tuple(Machine(code, (), definition(code, self._parameters).halt) for code in move.m)
        end_kind = BlockEnd.EXACT_STOP if move.exact_stop or move.dwell_s is not None else None
        changes: dict[str, object] = {"post": functions, "main": False, "correction": Correction()}
        if end_kind is not None:
            changes["end"] = end_kind
        if move.kind is Kind.TAP:
            changes["override"] = False
        self._emit(spoken, elements, **changes)

    # Going elsewhere

    def _go(self, name: str, number: int) -> None:
        """Continue at a block of a program."""
        level = self._levels[-1]
        if name != level.program.name:
            program = self._store.find(name)
            self._levels[-1] = level = _Level(program, cycle=level.cycle, change=level.change)
        level.place = level.program.place(number)

    def _call(self, spoken: _Spoken) -> None:
        assert spoken.call is not None
        name, start, last = spoken.call
        if len(self._levels) > DEEPEST_CALLS:
            raise ProgramError(1220, f"{name} on level {len(self._levels)}; allowed: {DEEPEST_CALLS}")
        program = self._store.find(name)
        place = 0 if start is None else program.place(start)
        end = None if last is None else program.place(last)
        cycle = name[0] == "Z"
        self._levels.append(_Level(program, place, end, cycle=cycle, change=spoken.changes and name == "Z6"))

    def _loop(self, spoken: _Spoken, level: _Level) -> None:
        """M24, M25, and the ends of programs."""
        if spoken.passes is not None:
            if len(level.loops) >= DEEPEST_LOOPS:
                raise ProgramError(1218, f"more than {DEEPEST_LOOPS} loops inside each other")
            level.loops.append((level.place, spoken.passes, spoken.passes))
        if spoken.loops_back:
            place, left, passes = level.loops.pop()
            if left > 1:
                level.loops.append((place, left - 1, passes))
                level.place = place
        if spoken.stop in (Stop.END, Stop.REPEAT) or spoken.returns:
            in_subprogram = len(self._levels) > 1 and self._levels[-1] is level
            if in_subprogram:
                if self._ready and self._ready[-1].stop in (Stop.END, Stop.REPEAT):
                    self._ready[-1] = replace(self._ready[-1], stop=Stop.NONE)
                level.place, level.last = len(level.program), None
            elif spoken.stop is Stop.REPEAT:
                level.place, level.loops = 0, []
            else:
                if self._ready and self._ready[-1].stop is Stop.NONE:
                    self._ready[-1] = replace(self._ready[-1], stop=Stop.END)
                self._levels = []
                self._tools.end()

    # Frames

    def _plane(self, number: int) -> Plane:
        """G17, G18, G19 as q152 to q154 define them."""
        default = {17: XY, 18: ZX, 19: YZ}[number]
        value = self._parameters.get(135 + number, 0.0, "q")
        return Plane(byte(value, 1) - 1, byte(value, 2) - 1, byte(value, 3) - 1) if value else default

    def _free_plane(self, number: int) -> Plane:
        """G117 to G119 as P8840 to P8842 define them."""
        value = self._parameters.get(8_723 + number)
        if not value:
            return {117: XY, 118: ZX, 119: YZ}[number]
        return Plane(byte(value, 1) - 1, byte(value, 2) - 1, byte(value, 3) - 1)

    def _frame_now(self) -> Frame:
        modal, axes = self._modal, len(self._names)
        nothing = (0.0,) * axes
        plane = self._planes[modal.plane] if modal.plane < 100 else self._free_plane(modal.plane)
        bound = modal.coordinates == 47
        zero = nothing
        if not bound and modal.zero != 153:
            hundred, number = divmod(modal.zero, 100)
            entry = number - 53 + 6 * hundred
            workspace = int(self._parameters.given(8_555, 1.0))
            mask = int(self._parameters.get(8_556))
            zero = tuple(
                0.0 if mask >> axis & 1 else self._parameters.zero_point(entry, axis, workspace) for axis in range(axes)
            )
        return Frame(
            axes=axes,
            plane=plane,
            correction=self._correction if modal.correction == 44 else nothing,
            rotation=self._rotation if modal.rotation == 45 else None,
            shift_first=int(self._parameters.get(8_859)) >= 2,
            mirror_first=modal.mirror_first,
            mirror_second=modal.mirror_second,
            shift=self._shift,
            zero=zero,
            length=0.0 if bound else self._length,
        )

    def _renew(self) -> None:
        """The frame may have changed: the axes stand where they do, and have other coordinates in the program."""
        known = (self._modal, self._rotation, self._shift, self._correction, self._length, self._parameters.revision)
        if known == self._known_frame:
            return
        self._known_frame = known
        frame = self._frame_now()
        if frame != self._frame:
            self._frame = frame
            self._program_position = frame.program(self._position)


class _Moves(Iterator[Move]):
    """Moves of a cycle, one after the other; at each place of a pattern those of the machining cycle.

    Cycles are pure functions: a copy begins anew and leaves out what has been.
    """

    def __init__(self, cycles: Mapping[int, object], number: int, call: Call) -> None:
        self._cycles, self._number, self._call = cycles, number, call
        self.made = 0
        self._rest: Iterator[Move] | None = None

    def __next__(self) -> Move:
        if self._rest is None:
            self._rest = islice(self._all(), self.made, None)
        move = next(self._rest)
        self.made += 1
        return move

    def __getstate__(self) -> dict[str, object]:
        return {**self.__dict__, "_rest": None}

    def _all(self) -> Iterator[Move]:
        call = self._call
        place = call.position
        for move in self._cycles[self._number](call):  # type: ignore[operator]
            yield move
            place = tuple(move.target.get(axis, value) for axis, value in enumerate(place))
            if move.cycle is not None:
                here = {axis: place[axis] for axis in (call.plane.first, call.plane.second)}
                within = replace(call, position=place, words=here, inner=None)
                for step in self._cycles[move.cycle](within):  # type: ignore[operator]
                    yield step
                    place = tuple(step.target.get(axis, value) for axis, value in enumerate(place))


@dataclass
class _Cycle:
    """A cycle that is being carried out: what its block has said, and what comes at the end of it."""

    spoken: _Spoken
    level: _Level
    moves: _Moves
    post: list[Machine]
    stop: Stop
    modal: Modal
    comes: bool
    """Its first move only comes to where a pattern begins: functions before the path wait for that."""
    goal: tuple[str, int] | None = None


@dataclass
class _Spoken:
    """What a block has said so far."""

    block: Block
    program: str
    main: bool
    parameters: tuple[tuple[int, float | None], ...] = ()
    blockwise: set[int] = field(default_factory=set)
    groups: dict[int, int] = field(default_factory=dict)
    cycles: list[int] = field(default_factory=list)
    pre: list[Machine] = field(default_factory=list)
    post: list[Machine] = field(default_factory=list)
    speeds: dict[int, float] = field(default_factory=dict)
    dwell_s: float | None = None
    feed: float | None = None
    end_feed: float | None = None
    tool: int | None = None
    stop: Stop = Stop.NONE
    goal: tuple[str, int] | None = None
    jump: tuple[str, int] | None = None
    call: tuple[str, int | None, int | None] | None = None
    passes: int | None = None
    loops_back: bool = False
    returns: bool = False
    activates: bool = False
    changes: bool = False
    length: bool = False
    shifts: bool = False
    zero_cleared: bool = False
    synchronises: bool = False


def _compare(left: float, relation: str, right: float) -> bool:
    match relation:
        case "=":
            return left == right
        case "<>":
            return left != right
        case ">":
            return left > right
        case "<":
            return left < right
        case ">=":
            return left >= right
    return left <= right
