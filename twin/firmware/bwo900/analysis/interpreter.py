"""The interpreter: blocks of a program to blocks of a path, called ahead of the execution (manual 3.6, 4, 6, 7.1).

    next() ---> PathBlock     the next block with something for the real time
           ---> Waiting       for a block to be executed (M01), a parameter (waituntil), an M function with a jump
           ---> None          the program has ended

    stack --> block --> values (expressions), reader (G, M, S, T --> said), targets (axes, circles), cycle --> output

Within a block: parameters, jumps by comparison, M functions with a jump, then G functions, tool, path; last the call of
a subprogram. A block of the program makes one PathBlock, a cycle one for each of its moves.

All state is in attributes, so that a control can be copied. The execution calls `executed` after M01, and
`acknowledged` for an M function with a jump.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates, start_state
from isel_twin.firmware.bwo900.analysis.cycle import Cycle, call_of, chosen, comes_first, step
from isel_twin.firmware.bwo900.analysis.cycles.moves import Moves
from isel_twin.firmware.bwo900.analysis.cycles.table import CYCLES
from isel_twin.firmware.bwo900.analysis.flow import lead_on
from isel_twin.firmware.bwo900.analysis.handed import clear
from isel_twin.firmware.bwo900.analysis.output import Output
from isel_twin.firmware.bwo900.analysis.plain import Plain
from isel_twin.firmware.bwo900.analysis.reader import Reader
from isel_twin.firmware.bwo900.analysis.said import Said
from isel_twin.firmware.bwo900.analysis.stack import Goal, Level, Stack
from isel_twin.firmware.bwo900.analysis.supervision import OFF, ON, Supervision
from isel_twin.firmware.bwo900.analysis.targets import Targets
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.analysis.values import Values
from isel_twin.firmware.bwo900.analysis.waiting import Renewal, Waiting
from isel_twin.firmware.bwo900.geometry.blocks import MFunction, PathBlock, Stop
from isel_twin.firmware.bwo900.geometry.curves import Bent
from isel_twin.firmware.bwo900.geometry.elements import Element, Point
from isel_twin.firmware.bwo900.geometry.frames import Frame
from isel_twin.firmware.bwo900.geometry.in_force import AT_REST, InForce
from isel_twin.firmware.bwo900.messages import Code, Message, ProgramError
from isel_twin.firmware.bwo900.numbers import G, P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.expressions import whole
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

MOST_KEPT: Final = 100_000  # most moves of a cycle that supervision keeps (M8006)


class Interpreter:
    def __init__(self, parameters: Parameters, store: Store, *, cycles: Mapping[int, object] = CYCLES) -> None:
        """cycles: functions by G number, `Call -> Iterator[CycleMove]`."""
        self._parameters, self._store, self._cycles = parameters, store, dict(cycles)
        self._tools = Tools(parameters)
        self.on_write: Callable[[int, float | None], None] | None = None
        """Told of parameters P that programs write."""
        self.stack = Stack(store)  # read-only for others
        self._values = Values(parameters, self._written)
        self._coordinates = Coordinates(parameters, self._tools.length_mm)
        self._reader = Reader(parameters, store, self.stack, self._values, self._coordinates, self._tools, self._cycles)
        self._targets = Targets(parameters, self._values, self._coordinates)
        self._output = Output(parameters, self.stack, self._coordinates, self._targets, self._tools)
        self._plain = Plain(parameters, self._coordinates, self._targets, self._output)
        self._ready = self._output.ready
        self._supervision = Supervision(self._ready)
        self._clear()

    def _clear(self) -> None:
        self.stack.clear()
        self._values.clear()
        self._reader.clear()
        self._targets.clear()
        self._output.clear()
        self._plain.forget()
        self._supervision.clear()
        self._cycle_now: Cycle | None = None
        self._waiting: Waiting | None = None
        self._due = Renewal.NOTHING  # what to renew after the awaited block
        self._renewal: Renewal | None = None  # then to renew with the next block
        self._jump_to: Goal | None = None
        self._otherwise: Goal | None = None
        """Where the block leads to if its M function with a jump is not acknowledged."""
        self._watched = False  # a block with M26 is not yet executed: analyse no path
        self._skips = False

    def begin(self, name: str, position: Point, block: int | None = None, skips: bool = False) -> None:
        """Begin a program, at a block if given. position: machine coordinates, mm. skips: blocks with `/` are left out.
        Raises ProgramError: M1252 there is no such program, M1255 no such block."""
        program = self._store.find(name)
        place = 0 if block is None else program.place(block)
        self._clear()
        self._coordinates.reset(position, self._tools.length_mm)
        self.stack.begin(program, place)
        self._skips = skips
        if self._parameters.get(P.TOOL_LOCK):
            self._parameters.write(P.TOOL_LOCK, 0.0)
        clear(self._parameters)
        for number in start_state(self._parameters):
            self._coordinates.g(number)
        self._coordinates.renew()

    # State

    @property
    def active(self) -> bool:
        return bool(self.stack)

    @property
    def waiting(self) -> Waiting | None:
        return self._waiting

    @property
    def notes(self) -> list[Message]:
        """Messages that do not break off, for the execution to take."""
        return self._targets.notes

    @property
    def frame(self) -> Frame:
        """Coordinates of the next block; without a program those of the last one."""
        return self._coordinates.frame

    @property
    def in_force(self) -> InForce:
        """The modal state of the next block."""
        return self._output.in_force(None) if self.stack else AT_REST

    @property
    def program_position(self) -> Point:
        """The last target, in the program's coordinates."""
        return self._coordinates.program_position

    # Reports of the execution

    def put_back(self, *blocks: PathBlock) -> None:
        """Put these blocks first again."""
        self._ready.extendleft(reversed(blocks))

    def end(self) -> None:
        """The program has ended or is broken off."""
        self.stack.clear()
        self.stack.opened = frozenset()
        self._waiting = None
        self._ready.clear()
        self._cycle_now = None
        self._tools.end()

    def executed(self) -> None:
        """The awaited block has been executed; tool data may have changed."""
        self._watched = False
        if self._waiting is Waiting.EXECUTION:
            self._waiting = None
            self._renewal, self._due = self._due, Renewal.NOTHING

    def measured(self, place: Point | None) -> None:
        """Where the axes were, machine coordinates, when a signal ended the executed block with M26; None: none did."""
        if self._cycle_now is not None and self._cycle_now.measures:
            frame = self._coordinates.frame
            self._cycle_now.moves.answer(None if place is None else frame.program(place))

    def pass_over(self) -> None:
        """A search for a block measures nothing: what has been measured stands."""
        if self._cycle_now is not None and self._cycle_now.measures:
            self._cycle_now.moves.pass_over()

    def begun(self) -> None:
        """The path of the last block has begun."""
        if self._waiting is Waiting.BEGINNING:
            self._waiting = Waiting.EXECUTION if self._watched else None

    def take_over_functions(self) -> None:
        """Read the table of M functions anew."""
        self._reader.functions.take_over()

    def acknowledged(self, jumps: bool) -> None:
        """The M function with a jump was acknowledged and its path deleted (jumps), or the path has been made. Raises
        ProgramError for an unknown goal. With M30 in the block there is no jump."""
        if self._waiting is Waiting.ACKNOWLEDGEMENT:
            self._waiting = None
            goal = self._jump_to if jumps else self._otherwise
            self._jump_to = self._otherwise = None
            if goal is not None and self.stack:
                self.stack.go(goal)

    def stand(self, position: Point) -> None:
        """Set the position of axes that are not at the end of the path: it was deleted, or another mode has moved
        them."""
        self._coordinates.stand(position)

    def hand(self, position: Point) -> None:
        """HAND: take its zero point (P8758) and plane (P8757) for the display. position: of the axes, mm."""
        self._coordinates.hand(self._tools.length_mm, position)

    # Analysis

    def next(self) -> PathBlock | Waiting | None:
        """Analyse at most one block of the program. A block without a path gives an empty PathBlock, so that its
        analysis takes time, too. Raises ProgramError with the column; `stack.place` is the block."""
        if self._ready:
            return self._ready.popleft()
        if self._renewal is not None:
            self._renew(self._renewal)
        if self._cycle_now is not None:
            if self._cycle_now.measures and self._waiting is not None:
                return self._waiting
            return self._next_of_cycle(self._cycle_now)
        if self._waiting is Waiting.CONDITION:
            self._waiting = None  # analyse the block again
        if self._waiting is not None and not self.supervises_watched:
            return self._waiting
        if not self.stack:
            return None
        level = self.stack.top
        if level.over:
            return self._returned(level) if level.program.complete else Waiting.FEED
        if plain := self._plain.run(level, 1):
            return plain[0]
        self._plain.forget()
        block = level.take()
        if block.skip and self._skips:
            return self._output.empty(block)
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
        if self._supervision.keeping is ON and self._stays():
            return Waiting.PASS
        if not self._ready:
            return self._output.empty(block)
        made = self._ready.popleft()
        waits = self._ready or self._waiting is not None or self._watched
        if not waits and self._supervision.keeping is OFF and self._reader.drilling is None:
            self._plain.learn(level, block, made)
        return made

    def run(self, most: int) -> list[PathBlock]:
        """Analyse at most so many plain blocks (plain.py) at once, which ask no filter for anything; none if the next
        one is for `next`."""
        waits = self._renewal is not None or self._waiting is not None or self._cycle_now is not None
        if waits or self._ready or not self._plain.passes_filters or self.stack.top.over:
            return []
        return self._plain.run(self.stack.top, most)

    def _renew(self, renewal: Renewal) -> None:
        self._renewal = None
        self._plain.forget()
        if renewal is Renewal.TOOL:
            self._tools.change()
        if renewal is not Renewal.NOTHING:
            self._coordinates.use_length(self._tools.length_mm)
        self._coordinates.renew()

    def _returned(self, level: Level) -> PathBlock:
        """End a subprogram, or the main program without M30."""
        self.stack.pop()
        if level.cycle:
            clear(self._parameters)
        if not self.stack:
            return self._output.nothing(level.program.name, stop=Stop.END)
        if not level.change:
            return self._output.nothing(level.program.name, main=False)
        self._waiting = Waiting.EXECUTION
        if self._due is not Renewal.TOOL:
            self._due = Renewal.LENGTH
        return self._output.nothing(level.program.name, main=False, stop=Stop.SYNCHRONISE)

    # One block

    def _execute(self, block: ProgramBlock) -> None:
        level = self.stack.top
        self._coordinates.carried = {}
        if (block.calls or self._supervision.keeping is not OFF) and self._supervision.call(
            whole(self._values.of(number)) for number in block.calls
        ):
            self._waiting = Waiting.BEGINNING
        later = self._values.assign(block)
        jump = self._values.jump(block)
        said = Said(block, level.program.name, not self.stack.in_cycle, later, self._values.synchronises(block))
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
        """Effects of writing a parameter P."""
        self._coordinates.written(number, value)
        self._tools.command(number, value)
        if number == P.DELETE and not value:
            self._parameters.write(P.DELETED, 0.0)
        if self.on_write is not None:
            self.on_write(number, value)

    def request_tool(self, group: int) -> None:
        """A tool is called in HAND: its record goes to that of the PLC and that of the real time. Raises as `find`."""
        self._tools.request_in_hand(group)

    def command(self, number: int, value: float | None, *, in_hand: bool) -> None:
        """Take a parameter P written by the line: it may copy tool records, or exchange or reverse axes."""
        self._tools.command(number, value, in_hand=in_hand)
        if P.EXCHANGE <= number <= P.MIRRORED:
            self._coordinates.renew()

    def forget_in_hand(self) -> None:
        """HAND: end the reversal of axes (P8892), and their exchange if P8880 = 2."""
        self._coordinates.forget_in_hand()

    def _words(self, said: Said) -> None:
        self._reader.select_tool(said)
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

    def _emit(self, said: Said, elements: tuple[Element | Bent, ...], **changes: object) -> None:
        """Make the block's PathBlock, and set what analysis waits for after it."""
        made = self._output.append(said, elements, **changes)
        self._watched = self._watched or made.watched
        measured = made.stop is Stop.MEASURING_STOP
        if made.stop is Stop.SYNCHRONISE or measured or said.synchronises or made.watched:
            self._waiting = Waiting.EXECUTION
            if self._due in (Renewal.NOTHING, Renewal.MEASURED):
                self._due = Renewal.MEASURED if measured else Renewal.NOTHING
            if made.stop is Stop.NONE:
                self._output.restop(Stop.SYNCHRONISE)
        if said.jump is not None:
            self._waiting, self._jump_to = Waiting.ACKNOWLEDGEMENT, said.jump

    def _conclude(self, goal: Goal | None, said: Said, level: Level) -> None:
        """What comes last in a block: jumps, calls, loops, ends. goal: of a jump; level: of the block."""
        if said.jump is not None:
            self._otherwise = goal
        lead_on(self.stack, self._output, None if said.jump is not None else goal, said, level)

    def _after(self, said: Said) -> None:
        """Tool change and length at the end of the block; if the PLC changes the tool, after its acknowledgement."""
        changed = said.changes and said.call is None
        if changed and self._waiting is Waiting.EXECUTION:
            self._due = Renewal.TOOL
        elif changed:
            self._tools.change()
        if said.activates or said.length or (changed and self._due is not Renewal.TOOL):
            self._coordinates.use_length(self._tools.length_mm)

    # Cycles

    def _begin_cycle(self, said: Said, targets: Mapping[int, float]) -> None:
        first, pattern, machining = chosen(said.cycles, self._reader.drilling)
        after, stop = list(said.post), said.stop
        said.post, said.stop, said.watches = [], Stop.NONE, False
        here, bare = self._coordinates, G.BARE in said.blockwise
        measures = first == G.MEASURING
        if measures:
            if self._supervision.on:
                raise ProgramError(Code.NO_HALT_HERE, "G69 waits for the probe, in a block of supervision")
            here.g(G.RADIUS_OFF)
        given = self._parameters, here, self._targets, self._reader, self._tools, targets, machining
        call = call_of(*given, bare=bare, measures=measures)
        moves, comes = Moves(self._cycles, first, call), comes_first(pattern, here, targets)
        if measures and self._parameters.get(P.WITHOUT_MOVING):
            moves.pass_over()
        self._cycle_now = Cycle(said, self.stack.top, moves, after, stop, here.modal, comes)
        self._go_on_with(self._cycle_now)
        while self._supervision.on and self._cycle_now is not None:
            if self._cycle_now.moves.made >= MOST_KEPT:
                raise ProgramError(Code.CYCLE_SEQUENCE, f"more than {MOST_KEPT} moves under supervision")
            self._go_on_with(self._cycle_now)

    def _go_on_with(self, cycle: Cycle) -> None:
        said = cycle.said
        if (move := next(cycle.moves, None)) is not None:
            pre: list[MFunction] = []
            if cycle.comes and cycle.moves.made == 1:
                pre, said.pre = said.pre, []
            for number, value in move.writes.items():
                self._parameters.write(number, value)
            elements, changes = step(
                *(move, said, self._coordinates, self._targets, self._reader.functions, cycle.modal.motion),
                coupled=self._parameters.has_spindle,
            )
            self._emit(said, elements, **changes)
            said.pre, said.speeds, said.parameters, said.tool = pre, {}, [], None
            return
        self._cycle_now, self._coordinates.modal = None, cycle.modal
        said.post, said.stop, said.dwell_s, said.feed = cycle.post, cycle.stop, None, None
        self._emit(said, (), main=said.main)
        self._after(said)

    def _next_of_cycle(self, cycle: Cycle) -> PathBlock:
        """The block of a cycle's next move; at the end of the cycle with its jumps and calls."""
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

    @property
    def supervises_watched(self) -> bool:
        """True if a block with M26 is in execution and the next one has no path: it belongs to the supervision."""
        if not self._watched or self._waiting is not Waiting.EXECUTION or not self.stack or self.stack.top.over:
            return False
        try:
            block = self.stack.top.program.block(self.stack.top.place)
        except ProgramError:  # reported when it is analysed
            return False
        return not block.may_move and (self._supervision.on or bool(block.calls))

    def _stays(self) -> bool:
        """True if the blocks of supervision are kept; False if analysis waits for something."""
        waits = None if self._watched else self._waiting
        return waits in (None, Waiting.BEGINNING) and bool(self.stack) and self._supervision.keep()
