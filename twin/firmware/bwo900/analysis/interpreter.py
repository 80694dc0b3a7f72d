"""The interpreter: blocks of a program to blocks of a path, as far ahead as it is asked (manual 3.6, 4, 6, 7.1).

    next() ---> PathBlock     the next block that has something for the real time
           ---> Waiting       for a block to be executed (M01), a parameter (waituntil), an M function with a jump
           ---> None          the program has ended

    stack.py       which block is next: programs inside each other, loops, jumps, calls
    values.py      what its expressions are worth: parameters, symbols
    reader.py      what it says: G, M, S, T            --> said.py
    targets.py     where it leads: axes, circles       --> elements, by coordinates.py
    cycle.py       the moves of a cycle

In a block: parameters, jumps by comparison, jumps by M functions, then G functions, tool, path; the subprogram call is
the last thing. What a block does to the path is one PathBlock; what a cycle does is one for each of its moves.

Everything that it knows is in its attributes, so that a control is copied with it. Whoever executes its blocks calls
`executed` when M01 has come by, and `acknowledged` for an M function with a jump.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from enum import Enum
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.cycle import Cycle, call_of, chosen, comes_first, step
from isel_twin.firmware.bwo900.analysis.cycles.moves import Moves
from isel_twin.firmware.bwo900.analysis.handed import clear
from isel_twin.firmware.bwo900.analysis.reader import Reader
from isel_twin.firmware.bwo900.analysis.said import Said, correction, path_block
from isel_twin.firmware.bwo900.analysis.stack import Goal, Level, Stack
from isel_twin.firmware.bwo900.analysis.targets import Targets
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.analysis.values import Values
from isel_twin.firmware.bwo900.geometry.blocks import Machine, PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.elements import Element, Point
from isel_twin.firmware.bwo900.geometry.frames import Frame
from isel_twin.firmware.bwo900.geometry.groups import COORDINATES, GROUPS, PLANE, ZERO, ZERO_POINTS
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.messages import Code, Message, ProgramError
from isel_twin.firmware.bwo900.numbers import SC, G, M, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte
from isel_twin.firmware.bwo900.programs.expressions import whole
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.programs.syntax import Block

MOST_KEPT: Final = 100_000
"""Moves of a cycle that supervision keeps (M8006)."""
WITH_Z5, WITHOUT_TABLE = 0x01, 0x02
"""Bits of P8807, byte 1: T needs Z5; T takes nothing from the table."""


class Waiting(Enum):
    """What analysis waits for."""

    EXECUTION = "the last block, to be executed"
    CONDITION = "the parameters that waituntil asks for"
    ACKNOWLEDGEMENT = "the M function with a jump"
    BEGINNING = "the path of the last block, to begin (sc:2)"
    FEED = "the next block of a program that is fed"
    PASS = "the next pass: a block of supervision (sc:1) has been analysed"


class Interpreter:
    """One channel's interpreter."""

    def __init__(self, parameters: Parameters, store: Store, *, cycles: Mapping[int, object] | None = None) -> None:
        """cycles: functions of cycles by their G number, `Call -> Iterator[Move]`; None: those of `cycles.table`."""
        if cycles is None:
            from isel_twin.firmware.bwo900.analysis.cycles.table import CYCLES

            cycles = CYCLES
        self._parameters, self._store, self._cycles = parameters, store, dict(cycles)
        self._tools = Tools(parameters)
        self.on_write: Callable[[int, float | None], None] | None = None
        """Told of parameters P that programs write."""
        self._stack = Stack(store)
        self._values = Values(parameters, self._written)
        self._coordinates = Coordinates(parameters, self._tools.length_mm)
        self._reader = Reader(parameters, store, self._stack, self._values, self._coordinates, self._cycles)
        self._targets = Targets(parameters, self._values, self._coordinates)
        self._reset((0.0, 0.0, 0.0))

    def _reset(self, position: Point) -> None:
        self._stack.clear()
        self._values.clear()
        self._coordinates.reset(position, self._tools.length_mm)
        self._reader.clear()
        self._targets.clear()
        self._ready: deque[PathBlock] = deque()
        self._cycle_now: Cycle | None = None
        self._waiting: Waiting | None = None
        self._supervises = False
        """sc:1, sc:2: what blocks come to stays here."""
        self._kept: list[PathBlock] = []
        self._stale = self._measured = False
        """A block that was waited for has been executed; it had M00."""
        self._changing = self._activating = False
        """The block that is waited for changes the tool, activates its data."""
        self._lets_go = False
        """The block has said sc:0 or sc:100."""
        self._tool: int | None = None
        self._jump_to: Goal | None = None
        self._otherwise: Goal | None = None
        """Where the block leads to if its M function with a jump is not acknowledged."""
        self._watched = False
        """A block with M26 has not been executed yet: nothing with a path is analysed."""
        self._skips = False
        self._told: tuple[object, InForce] = (None, AT_REST)
        """What holds, and what the last block has been told of it: one for all until it changes."""

    def begin(self, name: str, position: Point, block: int | None = None, skips: bool = False) -> None:
        """Begin a program, at a block if one is given. position: of the axes, machine coordinates, mm. skips: `/` does.

        Raises ProgramError: M1252 there is no such program, M1255 no such block.
        """
        program = self._store.find(name)
        place = 0 if block is None else program.place(block)
        self._reset(position)
        self._stack.begin(program, place)
        self._skips = skips
        if self._parameters.get(P.TOOL_LOCK):
            self._parameters.write(P.TOOL_LOCK, 0.0)
        clear(self._parameters)
        for number in _starting(self._parameters):
            self._coordinates.g(number)
        self._coordinates.renew()

    # ---- what there is to see ---------------------------------------------------------------------------------------

    @property
    def active(self) -> bool:
        """A program is being analysed."""
        return bool(self._stack)

    @property
    def waiting(self) -> Waiting | None:
        """What it waits for."""
        return self._waiting

    @property
    def notes(self) -> list[Message]:
        """Messages that stop or are shown, and do not break off; whoever executes takes them."""
        return self._targets.notes

    @property
    def place(self) -> Goal:
        """Name of the program and number of the block that is analysed, 0 if it has none."""
        return self._stack.place

    @property
    def opened(self) -> frozenset[str]:
        """Programs that have been, or are, open since it was begun."""
        return self._stack.opened

    @property
    def open(self) -> frozenset[str]:
        """Those that are open."""
        return self._stack.open

    @property
    def frame(self) -> Frame:
        """Coordinates of the next block, and of the last one without a program."""
        return self._coordinates.frame

    @property
    def loop(self) -> tuple[int, int]:
        """Passes and the present pass of the innermost loop of the program that is analysed; 0, 0: none is open."""
        return self._stack.loop

    @property
    def loops(self) -> int:
        """Loops that are open in the program that is analysed."""
        return self._stack.loops

    @property
    def in_force(self) -> InForce:
        """What holds for the next block; without a program, what one begins with."""
        return self._in_force(None) if self._stack else AT_REST

    @property
    def program_position(self) -> Point:
        """The target that has been analysed last, in the program's coordinates."""
        return self._coordinates.program_position

    # ---- what whoever executes tells it -----------------------------------------------------------------------------

    def put_back(self, *blocks: PathBlock) -> None:
        """Blocks that are to come next."""
        self._ready.extendleft(reversed(blocks))

    def end(self) -> None:
        """The program has ended or is broken off: its symbols, corrections and tool are gone."""
        self._stack.clear()
        self._stack.opened = frozenset()
        self._waiting = None
        self._ready.clear()
        self._cycle_now = None
        self._tools.end()

    def executed(self) -> None:
        """The block that analysis waits for has been executed; tool data may have changed."""
        self._watched = False
        if self._waiting is Waiting.EXECUTION:
            self._waiting = None
            self._stale = True

    def begun(self) -> None:
        """The path of the last block has begun."""
        if self._waiting is Waiting.BEGINNING:
            self._waiting = Waiting.EXECUTION if self._watched else None

    def take_over_functions(self) -> None:
        """The definitions of M functions are from now on as the table says now."""
        self._reader.functions.take_over()

    def acknowledged(self, jumps: bool) -> None:
        """The M function with a jump was acknowledged and its path deleted (jumps), or the path has been made.

        Raises ProgramError: there is no such goal. Beside M30 nothing is left that could go on elsewhere.
        """
        if self._waiting is Waiting.ACKNOWLEDGEMENT:
            self._waiting = None
            goal = self._jump_to if jumps else self._otherwise
            self._jump_to = self._otherwise = None
            if goal is not None and self._stack:
                self._stack.go(goal)

    def stand(self, position: Point) -> None:
        """The axes stand elsewhere than the path has got to: a deleted path, a move in another mode."""
        self._coordinates.stand(position)

    def hand(self, position: Point) -> None:
        """HAND: its zero point (P8758) and plane (P8757) are those of what is shown. position: of the axes, mm."""
        zero, plane = int(self._parameters.get(P.HAND_ZERO)), int(self._parameters.get(P.HAND_PLANE))
        plane = plane if GROUPS.get(plane) == PLANE else G.PLANE_XY
        length = self._tools.length_mm
        try:
            self._coordinates.without_program(zero if zero in ZERO_POINTS else G.NO_ZERO, plane, length, position)
        except ProgramError:  # the table of zero points is not where it ought to be
            self._coordinates.without_program(G.NO_ZERO, plane, length, position)

    # ---- analysis ---------------------------------------------------------------------------------------------------

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
        if self._waiting is Waiting.CONDITION:
            self._waiting = None  # the block is looked at again
        if self._waiting is not None and not self.supervises_watched:
            return self._waiting
        if not self._stack:
            return None
        level = self._stack.top
        if level.over:
            return self._returned(level) if level.program.complete else Waiting.FEED
        block = level.take()
        if block.skip and self._skips:
            return self._empty(block)
        try:
            locked = self._parameters.get(P.TOOL_LOCK) and block.word("T")
            if locked or (block.wait is not None and not self._values.holds(block)):
                level.place -= 1
                self._waiting = Waiting.CONDITION
                return self._waiting
            self._execute(block)
        except ProgramError as error:
            level.place -= 1
            error.column = error.column or block.column
            raise
        if self._watched and self._waiting is None:
            self._waiting = Waiting.EXECUTION
        if self._supervises and not self._lets_go and self._stays():
            return Waiting.PASS
        return self._ready.popleft() if self._ready else self._empty(block)

    def _refresh(self) -> None:
        """What has changed while a block was waited for: the tool by M06; after M00 and Z6 its length counts anew."""
        self._stale = False
        if self._changing:
            self._tools.change()
        if self._measured or self._changing or self._activating:
            self._activate_tool()
        self._changing = self._activating = False
        self._coordinates.renew()

    def _empty(self, block: Block) -> PathBlock:
        name = self._stack.top.program.name if self._stack else ""
        return self._nothing(name, number=block.number or 0, column=block.column)

    def _nothing(self, name: str, **others: object) -> PathBlock:
        """A block of a program without a path."""
        here = self._coordinates
        fields: dict[str, object] = {"number": 0, "start": here.position, "plane": here.frame.plane, **others}
        fields |= {"target": here.program_position, "in_force": self._in_force(None)}
        fields |= {"correction": correction(here, self._tools)}
        return PathBlock(name, **fields)  # type: ignore[arg-type]

    def _in_force(self, cycle: int | None) -> InForce:
        """What holds for a block; cycle: number of the one that it is a move of."""
        here, stack = self._coordinates, self._stack
        user, called_by = stack.cycle or ("", None)
        number = int(user[1:]) if user else cycle
        feed = self._targets.feed_mm_min or 0.0
        now = here.modal, here.frame, feed, stack.depth, stack.caller, number, called_by, stack.loop
        if now != self._told[0]:
            self._told = now, InForce(*now)
        return self._told[1]

    def _returned(self, level: Level) -> PathBlock:
        """A subprogram has come to its end, or the main program has without M30."""
        self._stack.pop()
        if level.cycle:
            clear(self._parameters)
        if not self._stack:
            return self._nothing(level.program.name, stop=Stop.END)
        if not level.change:
            return self._nothing(level.program.name, main=False)
        self._waiting, self._measured, self._activating = Waiting.EXECUTION, False, True
        return self._nothing(level.program.name, main=False, stop=Stop.SYNCHRONISE)

    # One block

    def _execute(self, block: Block) -> None:
        """One block, in the manual's order."""
        level = self._stack.top
        self._call_system(block)
        later = self._values.assign(block)
        jump = self._values.jump(block)
        said = Said(block, level.program.name, not self._stack.in_cycle, later, self._values.synchronises(block))
        self._reader.read(said)
        waits = said.synchronises or said.jump is not None or (said.changes and said.call is not None)
        if waits and self._coordinates.modal.radius != G.RADIUS_OFF:
            raise ProgramError(Code.NO_HALT_HERE, "analysis would wait, with radius correction", block.column)
        goal = said.goal
        if jump is not None:
            goal = level.program.name, jump
            said.goes_elsewhere()
        self._words(said)
        if self._cycle_now is not None:
            self._cycle_now.goal = goal
        else:
            self._conclude(goal, said, level)

    def _written(self, number: int, value: float | None) -> None:
        """What a parameter P does besides being kept."""
        self._coordinates.written(number, value)
        self._tools.command(number, value)
        if number == P.DELETE and not value:
            self._parameters.write(P.DELETED, 0.0)
        if self.on_write is not None:
            self.on_write(number, value)

    def command(self, number: int, value: float | None, *, in_hand: bool) -> None:
        """The line has written a parameter P that may copy records of tools, or exchange and turn axes."""
        self._tools.command(number, value, in_hand=in_hand)
        if P.EXCHANGE <= number <= P.MIRRORED:
            self._coordinates.renew()

    def forget_in_hand(self) -> None:
        """HAND: the mirror of axes ends (P8892), and their exchange if it is to (P8880 = 2)."""
        p = self._parameters
        for number in (P.MIRRORED, *((P.EXCHANGE,) if p.get(P.EXCHANGE) == 2.0 else ())):
            if p.loaded(number):
                p.write(number, None)
                self._coordinates.renew()

    def _words(self, said: Said) -> None:
        """Path, feed, and what goes with them: a PathBlock, or those of a cycle."""
        self._select(said)
        taken = self._reader.drilling_words(said)
        self._targets.read_feed(said, taken)
        targets = self._targets.read_axes(said, taken)
        if self._reader.drilling is not None and targets and not said.cycles:
            said.cycles.append(self._reader.drilling)
        if said.cycles:
            self._begin_cycle(said, targets or {})
            return
        self._emit(said, () if targets is None else self._targets.path(said, targets))
        self._after(said)

    def _emit(self, said: Said, elements: tuple[Element, ...], **changes: object) -> None:
        """A PathBlock of what the block has said, and what analysis waits for behind it."""
        feed = self._targets.feed_mm_min
        number = said.cycles[0] if said.cycles else None
        told = self._in_force(number)
        made = path_block(said, elements, self._coordinates, feed, self._tools, self._parameters, told)
        if changes:
            made = replace(made, **changes)  # type: ignore[arg-type]
        self._ready.append(made)
        self._watched = self._watched or made.watched
        if made.stop is Stop.SYNCHRONISE or made.stop is Stop.MEASURING_STOP or said.synchronises or made.watched:
            self._waiting = Waiting.EXECUTION
            self._measured = made.stop is Stop.MEASURING_STOP
            if made.stop is Stop.NONE:
                self._ready[-1] = replace(made, stop=Stop.SYNCHRONISE)
        if said.jump is not None:
            self._waiting, self._jump_to = Waiting.ACKNOWLEDGEMENT, said.jump

    def _conclude(self, goal: Goal | None, said: Said, level: Level) -> None:
        """What a block does last: it leads elsewhere. goal: of a jump; level: that of the block."""
        if said.jump is not None:
            self._otherwise = goal
        elif goal is not None:
            self._stack.go(goal)
        elif said.call is not None:
            self._stack.call(*said.call, change=said.changes)
        if said.hidden:
            self._stack.call("Z5", None, None, change=False)
        if said.passes is not None:
            level.open_loop(said.passes)
        if said.loops_back:
            level.close_loop()
        if said.stop in (Stop.END, Stop.REPEAT) or said.returns:
            self._leave(said, level)

    def _leave(self, said: Said, level: Level) -> None:
        """M02, M29, M30: a subprogram ends; the main program ends, or begins again."""
        if self._stack.is_subprogram(level):
            if self._ready and self._ready[-1].stop in (Stop.END, Stop.REPEAT):
                self._ready[-1] = replace(self._ready[-1], stop=Stop.NONE)
            level.leave()
        elif said.stop is Stop.REPEAT:
            level.repeat()
        else:
            if self._ready and self._ready[-1].stop is Stop.NONE:
                self._ready[-1] = replace(self._ready[-1], stop=Stop.END)
            self._stack.clear()

    # Tools

    def _select(self, said: Said) -> None:
        """The tool of a T word, and M16."""
        if said.tool is None:
            return
        flags = byte(self._parameters.get(P.START_FLAGS_2), 1)
        self._parameters.write(
            P.TOOL_INFO, float(M.TOOL_DATA if said.activates else M.TOOL_CHANGE if said.changes else 0)
        )
        word = said.block.word("T")
        column = word.column if word else 0
        if said.tool != self._tool and not flags & WITHOUT_TABLE:
            with _at(column):
                self._tools.request(said.tool)
        self._tool = said.tool
        said.parameters.append((P.TOOL_ASKED, float(said.tool)))
        if said.activates:
            with _at(column):
                self._tools.reckon(said.tool)
        else:
            said.parameters += self._tools.requested()
        said.hidden = "Z5" in self._store or bool(flags & WITH_Z5)

    def _after(self, said: Said) -> None:
        """What becomes true at the end of the block; the tool that the PLC changes, when it says so."""
        changed = said.changes and said.call is None
        if changed and self._waiting is Waiting.EXECUTION:
            self._changing = True
        elif changed:
            self._tools.change()
        if said.activates or said.length or (changed and not self._changing):
            self._activate_tool()

    def _activate_tool(self) -> None:
        self._coordinates.use_length(self._tools.length_mm)

    # Cycles

    def _begin_cycle(self, said: Said, targets: Mapping[int, float]) -> None:
        """The moves of a cycle, each a PathBlock of its own."""
        first, pattern, machining = chosen(said.cycles, self._reader.drilling)
        after, stop = list(said.post), said.stop
        said.post, said.stop, said.watches = [], Stop.NONE, False
        here = self._coordinates
        bare = G.BARE in said.blockwise
        call = call_of(self._parameters, here, self._targets, self._reader, self._tools, targets, machining, bare=bare)
        moves, comes = Moves(self._cycles, first, call), comes_first(pattern, here, targets)
        self._cycle_now = Cycle(said, self._stack.top, moves, after, stop, here.modal, comes)
        self._go_on_with(self._cycle_now)
        while self._supervises and self._cycle_now is not None:
            if self._cycle_now.moves.made >= MOST_KEPT:
                raise ProgramError(Code.CYCLE_SEQUENCE, f"more than {MOST_KEPT} moves under supervision")
            self._go_on_with(self._cycle_now)

    def _go_on_with(self, cycle: Cycle) -> None:
        """The next move of a cycle, or its end."""
        said = cycle.said
        move = next(cycle.moves, None)
        if move is not None:
            pre: list[Machine] = []
            if cycle.comes and cycle.moves.made == 1:
                pre, said.pre = said.pre, []
            elements, changes = step(
                move, said, self._coordinates, self._targets, self._reader.functions, cycle.modal.motion
            )
            self._emit(said, elements, **changes)
            said.pre, said.speeds, said.parameters, said.tool = pre, {}, [], None
            return
        self._cycle_now, self._coordinates.modal = None, cycle.modal
        said.post, said.stop, said.dwell_s, said.feed = cycle.post, cycle.stop, None, None
        self._emit(said, (), main=said.main)
        self._after(said)

    def _next_of_cycle(self, cycle: Cycle) -> PathBlock:
        """The block of a cycle's next move; with its end, what else its block does."""
        try:
            self._go_on_with(cycle)
            if self._cycle_now is None:
                self._conclude(cycle.goal, cycle.said, cycle.level)
        except ProgramError:
            self._cycle_now = None
            cycle.level.place -= 1
            raise
        return self._ready.popleft()

    # Supervision

    def _call_system(self, block: Block) -> None:
        """`sc:n`: 0 blocks go on, 1 and 2 they stay (supervision), 100 those that stay go on now."""
        self._lets_go = False
        for expression in block.calls:
            number = whole(self._values.of(expression))
            if number not in SC.ALL:
                raise ProgramError(Code.SYNTAX, f"sc:{number}; there are 0, 1, 2 and 100")
            if number in (SC.GO_ON, SC.GO_NOW):
                self._ready.extendleft(reversed(self._kept))
                self._kept.clear()
                self._lets_go = True
            if number != SC.GO_NOW:
                self._supervises = number in (SC.STAY, SC.STAY_AND_WAIT)
            if number == SC.STAY_AND_WAIT:
                self._waiting = Waiting.BEGINNING

    @property
    def supervises_watched(self) -> bool:
        """A block with M26 is being executed, and the next one belongs to its supervision: it has no path."""
        if not self._watched or self._waiting is not Waiting.EXECUTION or not self._stack or self._stack.top.over:
            return False
        try:
            block = self._stack.top.program.block(self._stack.top.place)
        except ProgramError:  # said when its turn comes
            return False
        moves = block.g or any(word.name[0] not in "FSTft" for word in block.words)
        return not moves and (self._supervises or bool(block.calls))

    def _stays(self) -> bool:
        """Keep what a block of supervision has come to, unless it has functions or ends something."""
        speaks = any(b.pre or b.post or b.stop is not Stop.NONE or b.parameters for b in self._ready)
        waits = None if self._watched else self._waiting
        if speaks or waits not in (None, Waiting.BEGINNING) or not self._stack:
            return False
        self._kept += [made for made in self._ready if made.elements or made.dwell_s is not None or made.speeds]
        self._ready.clear()
        return True


@contextmanager
def _at(column: int) -> Iterator[None]:
    """What is wrong is wrong with the word there."""
    try:
        yield
    except ProgramError as error:
        error.column = error.column or column
        raise


def _starting(p: Parameters) -> Iterator[int]:
    """G functions that a program begins with, beyond START (P8830, P8853, P8650 to the first deleted one)."""
    if zero := int(p.get(P.START_ZERO)):
        yield _known(zero, ZERO)
    if coordinates := int(p.get(P.START_COORDINATES)):
        yield _known(coordinates, COORDINATES)
    for number in range(P.START_G_FIRST, P.START_G_LAST + 1):
        if not p.loaded(number):
            return
        yield _known(int(p.get(number)), None)


def _known(number: int, group: int | None) -> int:
    """A G function that stays, of that group if one is given. Raises ProgramError M1249."""
    if GROUPS.get(number) is None or (group is not None and GROUPS[number] != group):
        raise ProgramError(Code.WRONG_START_STATE, f"G{number} at the start of a program")
    return number
