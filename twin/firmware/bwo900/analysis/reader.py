"""Reads G and M functions, tools and speeds of a block (manual 4, 5, 7.1).

    G        modal in its group; blockwise; a cycle; a program Z of that number
    M        program organisation (0, 1, 2, 16, 23 to 30), cycles, the rest to the PLC, before or after the path
    T t tr tl tq S      tool and spindles

Two of a group in one block, unknown numbers and functions that the twin lacks are errors with their column.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from typing import Final

from isel_twin.firmware.bwo900.analysis.coordinates import Coordinates
from isel_twin.firmware.bwo900.analysis.functions import Functions
from isel_twin.firmware.bwo900.analysis.handed import handed
from isel_twin.firmware.bwo900.analysis.said import Called, Said
from isel_twin.firmware.bwo900.analysis.stack import Goal, Stack
from isel_twin.firmware.bwo900.analysis.tools import Tools
from isel_twin.firmware.bwo900.analysis.values import Values
from isel_twin.firmware.bwo900.geometry.blocks import MFunction, Stop
from isel_twin.firmware.bwo900.geometry.groups import (
    BEYOND,
    BLOCKWISE,
    GROUPS,
    MIRROR,
    SHIFT,
    TURNING,
    ZERO,
    ZERO_POINTS,
)
from isel_twin.firmware.bwo900.messages import MISSING, Code, ProgramError
from isel_twin.firmware.bwo900.numbers import G, M, P, Q
from isel_twin.firmware.bwo900.parameters import Parameters, byte
from isel_twin.firmware.bwo900.programs.expressions import whole
from isel_twin.firmware.bwo900.programs.stored import Store
from isel_twin.firmware.bwo900.programs.words import MWord, ProgramBlock, Word

CENTRES: Final = "IJK"
LONGEST_DWELL_S: Final = 999_999.999
DRILLING: Final = frozenset((G.DRILLING, G.DRILLING_WITH_DWELL, G.DEEP_HOLE, G.TAPPING, G.BORING))
STAYING, ADDRESSED = 0x01, 0x02  # bits of P8806, byte 3: drilling cycles stay until G80; their parameters are words
WITH_Z5, WITHOUT_TABLE = 0x01, 0x02  # bits of P8807, byte 1: T needs Z5; T takes nothing from the table


class Reader:
    """Reads blocks; keeps spindle and drilling cycle."""

    def __init__(
        self,
        parameters: Parameters,
        store: Store,
        stack: Stack,
        values: Values,
        coordinates: Coordinates,
        tools: Tools,
        cycles: Collection[int],
    ) -> None:
        """cycles: numbers of the G functions that are cycles."""
        self._parameters, self._store, self._stack, self._values = parameters, store, stack, values
        self._coordinates, self._tools, self._cycles = coordinates, tools, cycles
        self.functions = Functions(parameters)
        self.clear()

    def clear(self) -> None:
        """A program begins."""
        self.speed_rpm: float | None = None  # S of the first spindle
        self.turning = 0  # +1 M03, -1 M04, 0 M05
        self._tool: int | None = None
        self.drilling: int | None = None  # the drilling cycle in force

    def read(self, said: Said) -> None:
        """G functions, tools and speeds, M functions. A zero point ends G92."""
        if (cycle := self._cycle_of_user(said.block)) is not None:
            said.block = handed(said.block, self._parameters, self._values, self._coordinates.names)
            said.call = cycle
        block, before = said.block, self._coordinates.modal
        for g in block.g:
            self._g(g.number, said, g.column)
            if g.number == G.DWELL:
                if g.extension is None:
                    raise ProgramError(Code.SYNTAX, "G04 without a time", g.column)
                said.dwell_s = self._values.of(g.extension)
                if said.dwell_s > LONGEST_DWELL_S:
                    raise ProgramError(Code.SYNTAX, f"a dwell of {said.dwell_s:g} s", g.column)
        now = self._coordinates.modal
        if now.plane != before.plane and G.RADIUS_OFF not in (before.radius, now.radius):
            raise ProgramError(Code.EXCLUDED, f"G{now.plane} with G{before.radius}; G40 comes first")
        for word in block.words:
            self._tool_word(word, said)
        for m in block.m:
            self._m(m, said)
        if said.zero_cleared:
            self._coordinates.shift = (0.0,) * len(self._coordinates.names)
        self._coordinates.renew()

    # G functions

    def _cycle_of_user(self, block: ProgramBlock) -> Called | None:
        for n in (g.number for g in block.g):
            own = n in GROUPS or n in BLOCKWISE or n in BEYOND or (n in self._cycles and n != G.MEASURING)
            if not own and n not in (G.DRILLING_OFF, G.DRILLING_WITH_DWELL) and f"Z{n}" in self._store:
                return f"Z{n}", None, None
        return None

    def _g(self, number: int, said: Said, column: int) -> None:
        group = GROUPS.get(number)
        if number in BLOCKWISE:
            said.blockwise.add(number)
        elif group is not None:
            self._of_group(number, group, said, column)
        elif number in BEYOND:
            raise ProgramError(Code.EXCLUDED, f"{MISSING}: G{number}, {BEYOND[number]}", column)
        elif number == G.MEASURING and f"Z{number}" in self._store:
            said.call = (f"Z{number}", None, None)
        elif number in self._cycles or number == G.DRILLING_WITH_DWELL:
            said.cycles.append(number)
            if number in DRILLING and self._drill_flags & STAYING:
                self.drilling = number
        elif number == G.DRILLING_OFF:
            self.drilling = None
        elif f"Z{number}" in self._store:
            said.call = (f"Z{number}", None, None)
        else:
            raise ProgramError(Code.NO_PROGRAM, f"G{number} is no path condition, and there is no Z{number}", column)

    def _of_group(self, number: int, group: int, said: Said, column: int) -> None:
        if group in said.groups and said.groups[group] != number and group != MIRROR:
            raise ProgramError(Code.EXCLUDED, f"G{said.groups[group]} and G{number}", column)
        said.groups[group] = number
        if number in TURNING and not self._parameters.has_spindle:
            raise ProgramError(Code.NO_SPINDLE, f"G{number} on a machine without one", column)
        additional = number in ZERO_POINTS and number >= G.ZERO_7
        if additional and number // 100 > int(self._parameters.get(Q.ZERO_MORE, 0.0, "q")):
            raise ProgramError(Code.EXCLUDED, f"G{number}: q174 allows no such zero point", column)
        said.shifts = said.shifts or group == SHIFT
        said.zero_cleared = said.zero_cleared or group == ZERO
        self._coordinates.g(number)

    @property
    def _drill_flags(self) -> int:
        return byte(self._parameters.get(P.START_FLAGS_1), 3)

    def drilling_words(self, said: Said) -> frozenset[str]:
        """Names of words that are parameters of the block's drilling cycle."""
        if not DRILLING.intersection(said.cycles) or not self._drill_flags & ADDRESSED:
            return frozenset()
        third = self._coordinates.frame.plane.third
        axis = next(name for name, number in self._coordinates.names.items() if number == third)
        numbers = {
            "F": P.HOLE_FEED,
            axis: P.HOLE_DEPTH,
            "R": P.APPROACH_PLANE,
            CENTRES[self._coordinates.logical(third)]: P.RETRACT_PLANE,
            "H": P.STROKES,
        }
        taken = [word for word in said.block.words if word.name in numbers]
        for word in taken:
            self._parameters.write(numbers[word.name], self._values.of(word.value))
        return frozenset(word.name for word in taken)

    # Tools and speeds

    def _tool_word(self, word: Word, said: Said) -> None:
        p, value = self._parameters, self._values.of
        match word.name:
            case "T":
                said.tool = whole(value(word.value))
            case "t":
                p.write(P.TOOL_RADIUS_CORRECTION, value(word.value))
            case "tr":
                p.write(P.TOOL_RADIUS, value(word.value))
                p.write(P.TOOL_RADIUS_CORRECTION, 0.0)
            case "tl":
                p.write(P.TOOL_LENGTH, value(word.value))
                p.write(P.TOOL_LENGTH_CORRECTION, 0.0)
                said.length = True
            case "tq":
                p.write(P.TOOL_QUADRANT, value(word.value))
            case _ if word.name[0] == "S":
                spindle = int(word.name[1:] or "1")
                said.speeds[spindle] = value(word.value)
                if spindle == 1:
                    self.speed_rpm = said.speeds[spindle]

    def select_tool(self, said: Said) -> None:
        """The tool of a T word, and M16."""
        if said.tool is None:
            return
        flags = byte(self._parameters.get(P.START_FLAGS_2), 1)
        info = M.TOOL_DATA if said.activates else M.TOOL_CHANGE if said.changes else 0
        self._parameters.write(P.TOOL_INFO, float(info))
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

    # M functions

    def _m(self, m: MWord, said: Said) -> None:
        values = tuple(None if e is None else whole(self._values.of(e)) for e in m.extensions)
        match m.number:
            case M.HALT:
                self._without_correction(Code.EXCLUDED, "M00", m.column)
                said.stop = Stop.MEASURING_STOP
                self._machine_function(m, (), said)
            case M.SYNCHRONISE:
                self._without_correction(Code.NO_HALT_HERE, "M01", m.column)
                if G.THREE_POINTS in said.blockwise:
                    raise ProgramError(Code.NO_NEXT_PATH, "G123 with M01", m.column)
                said.stop = Stop.SYNCHRONISE
            case M.RETURN:
                said.returns = True
            case M.TOOL_DATA:
                said.activates = True
                if self.functions.defined(m.number):
                    self._machine_function(m, values, said)
            case M.JUMP:
                goal = self._goal(values, m)
                said.goal = said.goal or goal  # the first one wins, as for comparisons
            case M.LOOP:
                if len(values) != 1 or values[0] is None or values[0] < 1:
                    raise ProgramError(Code.WRONG_LOOP, "M24.passes, at least 1", m.column)
                said.passes = values[0]
            case M.LOOP_END:
                if not self._stack.top.loops:
                    raise ProgramError(Code.NO_LOOP, column=m.column)
                said.loops_back = True
            case M.DELETE_DISTANCE:
                self._without_correction(Code.NO_HALT_HERE, "M26", m.column)
                if G.THREE_POINTS in said.blockwise:
                    raise ProgramError(Code.NO_NEXT_PATH, "G123 with M26", m.column)
                said.watches = True
            case M.CALL:
                said.call = self._called(values, m)
            case M.REPEAT:
                said.stop = Stop.REPEAT
            case M.END:
                said.stop = Stop.END
            case _:
                self._machine_function(m, values, said)

    def _without_correction(self, error: int, name: str, column: int) -> None:
        if self._coordinates.modal.radius != G.RADIUS_OFF:
            raise ProgramError(error, f"{name} with radius correction", column)

    def _goal(self, values: Sequence[int | None], m: MWord) -> Goal:
        """M23.block, M23.program.block."""
        if len(values) == 1 and values[0] is not None:
            return self._stack.top.program.name, values[0]
        if len(values) == 2 and values[0] is not None and values[1] is not None:
            return f"P{values[0]}", values[1]
        raise ProgramError(Code.SYNTAX, f"M{m.number}.block or M{m.number}.program.block", m.column)

    def _called(self, values: Sequence[int | None], m: MWord) -> Called:
        """M28.P, M28.P.start, M28.P.start_end, M28..start."""
        if not 1 <= len(values) <= 2 or (values[0] is None and (len(values) == 1 or values[1] is None)):
            raise ProgramError(Code.WRONG_CALL, "M28.program, M28.program.start_end or M28..start", m.column)
        name = self._stack.top.program.name if values[0] is None else f"P{values[0]}"
        last = None if m.last is None else whole(self._values.of(m.last))
        return name, values[1] if len(values) == 2 else None, last

    def _machine_function(self, m: MWord, values: tuple[int | None, ...], said: Said) -> None:
        if m.number == M.TOOL_CHANGE and "Z6" in self._store:
            said.call, said.changes = ("Z6", None, None), True
            return
        defined = self.functions.of(m.number)
        if defined.cycle:
            if values:
                raise ProgramError(
                    Code.M_DEFINED_OTHERWISE, f"M{m.number} is a cycle: nothing may stand behind it", m.column
                )
            if f"Z{m.number}" not in self._store:
                raise ProgramError(Code.NO_PROGRAM, f"Z{m.number}", m.column)
            said.call = (f"Z{m.number}", None, None)
            return
        if defined.jump != bool(values) and (defined.jump or m.number > M.END):
            wrong = "is defined with a jump and has none" if defined.jump else "has a jump and is not defined with one"
            raise ProgramError(Code.M_DEFINED_OTHERWISE, f"M{m.number} {wrong}", m.column)
        if defined.jump:
            said.jump = self._goal(values, m)
        function = MFunction(m.number, tuple(float(v or 0) for v in values), defined.halt, defined.jump)
        if defined.pre:
            said.pre.append(function)
        if defined.post:
            said.post.append(function)
        self.turning = {M.SPINDLE_RIGHT: 1, M.SPINDLE_LEFT: -1, M.SPINDLE_OFF: 0}.get(m.number, self.turning)
        said.synchronises = said.synchronises or defined.synchronises
        said.changes = said.changes or m.number == M.TOOL_CHANGE


@contextmanager
def _at(column: int) -> Iterator[None]:
    """Give errors this column."""
    try:
        yield
    except ProgramError as error:
        error.column = error.column or column
        raise
