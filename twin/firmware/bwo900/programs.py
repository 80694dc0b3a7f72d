"""Programs in the control's memory, and the files that they come in (manual 3.1, 3.10).

    CR LF  P123456 CR LF  N10 ... CR LF  ...  # CR LF  EOT

`P` programs and `Z` cycles. Blocks are kept as text and read when they are executed, the last ones from a cache, so
that a long program costs its bytes and a number for each line.
"""

from __future__ import annotations

import re
from array import array
from bisect import bisect_left
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Final

from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.syntax import Block, parse_block

__all__ = ["END", "MOST_LINE", "Program", "read_program"]

END: Final = "#"
"""What stands behind the last block of a file."""
MOST_LINE: Final = 400
"""Characters of a line of a file (M1113)."""
_NAME = re.compile(r"\s*([PZ])\s*(\d{1,10})\s*$")
_NUMBER = re.compile(r"\s*/?\s*N\s*(\d+)")


@lru_cache(maxsize=4096)
def _parsed(text: str, line: int) -> Block:
    return parse_block(text, line)


@dataclass(frozen=True)
class Program:
    """A program: name (P or Z and its number), and its blocks as they are in the file, chained lines joined."""

    name: str
    blocks: tuple[str, ...]
    lines: array[int] = field(default_factory=lambda: array("q"))
    """Line of the file of each block."""

    def __post_init__(self) -> None:
        numbers = array("q", (int(m[1]) if (m := _NUMBER.match(text)) else -1 for text in self.blocks))
        object.__setattr__(self, "_numbers", numbers)
        order = sorted((number, place) for place, number in enumerate(numbers) if number >= 0)
        object.__setattr__(self, "_order", order)

    def __len__(self) -> int:
        return len(self.blocks)

    def block(self, place: int) -> Block:
        """The block at a place, from 0. Raises ProgramError if it cannot be read."""
        return _parsed(self.blocks[place], self.lines[place] if place < len(self.lines) else place + 1)

    def number(self, place: int) -> int:
        """The number of the block at a place, -1 if it has none."""
        return int(self._numbers[place])  # type: ignore[attr-defined]

    def place(self, number: int) -> int:
        """The place of the block with that number. Raises ProgramError M1255 if there is none."""
        order: list[tuple[int, int]] = self._order  # type: ignore[attr-defined]
        at = bisect_left(order, (number, 0))
        if at == len(order) or order[at][0] != number:
            raise ProgramError(1255, f"N{number} in {self.name}")
        return order[at][1]

    @property
    def text(self) -> str:
        """The program as a file, lines ended by CR LF."""
        return "".join(f"{line}\r\n" for line in (self.name, *self.blocks, END))


def read_program(lines: Iterator[tuple[int, str]], name: str) -> Program:
    """The program of numbered lines up to its end. Raises ProgramError: M1113 line too long, M1111 a line that is none,
    M1290 block numbers that do not rise, M1256 nothing."""
    blocks: list[str] = []
    places = array("q")
    last, chained = -1, ""
    for number, line in lines:
        text = line.rstrip("\r\n")
        if len(text) > MOST_LINE:
            raise ProgramError(1113, f"line {number}")
        if text.strip() == END:
            break
        if not text.strip() or text.lstrip().startswith(";"):
            continue
        if text.rstrip().endswith("\\"):
            chained += text.rstrip()[:-1] + " "
            continue
        text, chained = (chained + text).strip(), ""
        if (found := _NUMBER.match(text)) is not None:
            if int(found[1]) <= last:
                raise ProgramError(1290, f"N{found[1]} after N{last}, line {number}")
            last = int(found[1])
        blocks.append(text)
        places.append(number)
    if chained:
        raise ProgramError(1111, "the last line is chained to nothing")
    return Program(name, tuple(blocks), places)


def program_name(line: str) -> str:
    """The name that a line of a file begins a program with, empty if it is none."""
    match = _NAME.match(line)
    return "" if match is None else f"{match[1]}{int(match[2])}"


class Store(dict[str, Program]):
    """The memory for programs, by name."""

    def find(self, name: str) -> Program:
        """The program. Raises ProgramError M1252 if there is none."""
        program = self.get(name)
        if program is None:
            raise ProgramError(1252, name)
        return program

    def of(self, programs: Mapping[str, Program]) -> Store:
        """These as well."""
        self.update(programs)
        return self
