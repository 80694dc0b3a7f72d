"""The call stack: the next block, loops, jumps, calls (manual 6).

    top ->   | P200   place 3   loops (2 of 5 passes)  |    M28, G of a Z program: `call`
             | P100   place 17                         |    M23, a true comparison: `go`
    main ->  | P1     place 4                          |    M24: `open_loop`, M25: `close_loop`

A level ends behind its program's last block, behind the last block of its call, at M02, M29 and M30.
"""

from __future__ import annotations

from dataclasses import dataclass, field
from itertools import pairwise
from typing import Final, TypeAlias

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.programs.stored import Blocks, Store
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

DEEPEST_CALLS: Final = 6  # nested subprograms (M1220)
DEEPEST_LOOPS: Final = 32  # nested M24 (M1218); the manual gives no number

Goal: TypeAlias = tuple[str, int]  # a program and the number of a block of it


@dataclass
class Level:
    """An open program: the place of its next block, its end, its loops."""

    program: Blocks
    place: int = 0
    last: int | None = None  # place of the last block to be executed, of a call with an end
    # place after M24, passes left, with the present one, and all passes
    loops: list[tuple[int, int, int]] = field(default_factory=list)
    cycle: bool = False  # called as a cycle: its blocks are intermediate ones
    change: bool = False  # Z6: at its end the tool data are activated

    @property
    def over(self) -> bool:
        """True if there is no next block, or a fed one has not arrived yet."""
        return self.place >= len(self.program) or (self.last is not None and self.place > self.last)

    @property
    def last_taken(self) -> Goal:
        """Its name, and the number of its last block taken."""
        return self.program.name, max(self.program.number(max(self.place - 1, 0)), 0)

    def take(self) -> ProgramBlock:
        """Return the next block and advance. Raises ProgramError for a block that cannot be read."""
        block = self.program.block(self.place)
        self.place += 1
        return block

    @property
    def left(self) -> int:
        """Known blocks up to its end."""
        return (len(self.program) if self.last is None else min(len(self.program), self.last + 1)) - self.place

    def pass_over(self, blocks: int) -> None:
        """Advance by so many blocks, whose texts have been read."""
        self.place += blocks
        self.program.analysed(self.place)

    def leave(self) -> None:
        self.place, self.last = len(self.program), None

    def repeat(self) -> None:
        """Begin again. Raises ProgramError M1269."""
        self._leads_back("M29")
        self.place, self.loops = 0, []

    def open_loop(self, passes: int) -> None:
        """M24. Raises ProgramError M1218, M1269."""
        self._leads_back("M24")
        if len(self.loops) >= DEEPEST_LOOPS:
            raise ProgramError(Code.WRONG_LOOP, f"more than {DEEPEST_LOOPS} loops inside each other")
        self.loops.append((self.place, passes, passes))

    def _leads_back(self, what: str) -> None:
        if self.program.linear:
            raise ProgramError(Code.NOT_WHILE_FED, f"{what} in {self.program.name}, a program that is fed")

    def close_loop(self) -> None:
        """M25: go back to the block after M24, or on after the last pass."""
        place, left, passes = self.loops.pop()
        if left > 1:
            self.loops.append((place, left - 1, passes))
            self.place = place


class Stack:
    """The main program and the open subprograms."""

    def __init__(self, store: Store) -> None:
        self._store = store
        self._levels: list[Level] = []
        self.opened: frozenset[str] = frozenset()
        """Programs that have been open since the start; the interpreter clears it at the end."""

    def __len__(self) -> int:
        return len(self._levels)

    @property
    def top(self) -> Level:
        return self._levels[-1]

    @property
    def place(self) -> Goal:
        """Name of the program and number of the next block, 0 if it has none."""
        if not self._levels:
            return "", 0
        level = self._levels[-1]
        number = level.program.number(min(level.place, len(level.program) - 1)) if len(level.program) else 0
        return level.program.name, max(number, 0)

    @property
    def open(self) -> frozenset[str]:
        return frozenset(level.program.name for level in self._levels)

    @property
    def depth(self) -> int:
        return max(len(self._levels) - 1, 0)

    @property
    def loops(self) -> int:
        return len(self._levels[-1].loops) if self._levels else 0

    @property
    def loop(self) -> tuple[int, int]:
        """Passes of the innermost loop on top, and the present one; 0, 0 without a loop."""
        if not self._levels or not self._levels[-1].loops:
            return 0, 0
        _, left, passes = self._levels[-1].loops[-1]
        return passes, passes - left + 1

    @property
    def caller(self) -> Goal:
        """Program and block that called the one on top; "", 0 for a main program."""
        return self._levels[-2].last_taken if len(self._levels) > 1 else ("", 0)

    @property
    def cycle(self) -> tuple[str, Goal] | None:
        """The open user cycle, and where a program called it; None: there is none."""
        for below, level in pairwise(self._levels):
            if level.cycle:
                return level.program.name, below.last_taken
        return None

    @property
    def in_cycle(self) -> bool:
        """A program that was called as a cycle is open."""
        return any(level.cycle for level in self._levels)

    def is_subprogram(self, level: Level) -> bool:
        """True if this level is on top, and not the main program's."""
        return len(self._levels) > 1 and self._levels[-1] is level

    def begin(self, program: Blocks, place: int) -> None:
        self._levels = [Level(program, place)]
        self.opened = self.open

    def clear(self) -> None:
        self._levels = []

    def pop(self) -> None:
        self._levels.pop()

    def go(self, goal: Goal) -> None:
        """Continue at a block of a program. Raises ProgramError: M1252 no such program, M1255 no such block, M1269."""
        name, number = goal
        level = self._levels[-1]
        if level.program.linear:
            raise ProgramError(
                Code.NOT_WHILE_FED, f"a jump to N{number} of {name} in {level.program.name}, a program that is fed"
            )
        if name != level.program.name:
            program = self._store.find(name)
            self._levels[-1] = level = Level(program, cycle=level.cycle, change=level.change)
            self.opened |= {name}
        level.place = level.program.place(number)

    def call(self, name: str, start: int | None, last: int | None, *, change: bool) -> None:
        """Begin a subprogram, optionally from block to block. change: it changes the tool. Raises ProgramError: M1220
        too deep, M1252 no such program, M1255 no such block, M1269 it is fed."""
        if len(self._levels) > DEEPEST_CALLS:
            raise ProgramError(Code.CALLS_TOO_DEEP, f"{name} on level {len(self._levels)}; allowed: {DEEPEST_CALLS}")
        program = self._store.find(name)
        if program.linear:
            raise ProgramError(Code.NOT_WHILE_FED, f"{name} is fed, and called by itself")
        place = 0 if start is None else program.place(start)
        end = None if last is None else program.place(last)
        self.opened |= {name}
        self._levels.append(Level(program, place, end, cycle=name[0] == "Z", change=change and name == "Z6"))
