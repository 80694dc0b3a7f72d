"""Programs in the control's memory, and their files (manual 3.1, 3.10).

    CR LF  P123456 CR LF  N10 ... CR LF  ...  # CR LF  EOT

`P` programs and `Z` cycles. Blocks are stored as text and parsed (with a cache) when they are executed: a long program
costs its bytes and a number for each line.
"""

from __future__ import annotations

from array import array
from bisect import bisect_left
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar, Protocol

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.programs.feed import Feed
from isel_twin.firmware.bwo900.programs.lines import END, Lines, without_number
from isel_twin.firmware.bwo900.programs.syntax import parse_block
from isel_twin.firmware.bwo900.programs.words import ProgramBlock


@lru_cache(maxsize=4096)
def _parsed(text: str, line: int) -> ProgramBlock:
    return parse_block(text, line)


class Blocks(Protocol):
    """A program for the interpreter: `StoredProgram` or `feed.Feed`."""

    @property
    def name(self) -> str:
        """P or Z, and its number."""

    @property
    def linear(self) -> bool:
        """True for a fed program, without jumps and loops."""

    @property
    def complete(self) -> bool:
        """True if its last block is known."""

    def __len__(self) -> int:
        """Number of known blocks."""

    def line(self, place: int) -> str:
        """The text of the block at a place, from 0."""

    def lines(self, place: int, most: int) -> str:
        """The texts of at most so many known blocks from a place on, each ended by LF, to look at."""

    def analysed(self, place: int) -> None:
        """The blocks before this place have been analysed."""

    def block(self, place: int) -> ProgramBlock:
        """The block at a place, from 0. Raises ProgramError if it cannot be parsed."""

    def number(self, place: int) -> int:
        """The number of the block at a place, -1 if it has none."""

    def after(self, number: int) -> str:
        """The text after a block's number; empty if there is no such block."""

    def place(self, number: int) -> int:
        """The place of the block with that number. Raises ProgramError M1255, M1269."""


@dataclass(frozen=True, eq=False)
class StoredProgram:
    """A program: name (P or Z and its number), and its blocks, chained lines joined."""

    linear: ClassVar = False
    complete: ClassVar = True
    name: str
    text: bytes  # of all blocks, each ended by LF, Latin-1
    begins: array[int]  # beginning of each in it, and end of the last
    numbers: array[int]  # of each, -1 without one; they rise
    highest: array[int]  # the highest number up to each

    @classmethod
    def of(cls, name: str, blocks: Iterable[str]) -> StoredProgram:
        """Raises ProgramError as `Builder` does."""
        builder = Builder(name)
        for number, line in enumerate(blocks, start=1):
            builder.add(number, line)
        return builder.program()

    def __len__(self) -> int:
        return len(self.numbers)

    @property
    def blocks(self) -> Iterator[str]:
        return (self.line(place) for place in range(len(self)))

    def line(self, place: int) -> str:
        """The text of the block at a place, from 0."""
        return self.text[self.begins[place] : self.begins[place + 1] - 1].decode("latin-1")

    def lines(self, place: int, most: int) -> str:
        return self.text[self.begins[place] : self.begins[min(place + most, len(self))]].decode("latin-1")

    def analysed(self, place: int) -> None:
        """Changes nothing: a program that is stored stays."""

    def block(self, place: int) -> ProgramBlock:
        return _parsed(self.line(place), place + 1)

    def number(self, place: int) -> int:
        return self.numbers[place]

    def after(self, number: int) -> str:
        try:
            return without_number(self.line(self.place(number)))
        except ProgramError:
            return ""

    def place(self, number: int) -> int:
        at = bisect_left(self.highest, number)
        if at == len(self) or self.numbers[at] != number:
            raise ProgramError(Code.NO_BLOCK, f"N{number} in {self.name}")
        return at

    @property
    def file(self) -> str:
        """The program as a file, lines with CR LF."""
        return "".join(f"{line}\r\n" for line in (self.name, *self.blocks, END))


class Builder:
    """Builds a program line by line, so that a long one is in memory only once."""

    def __init__(self, name: str, *, numbered: bool = False) -> None:
        """numbered: every block must begin with N or /N."""
        self._name = name
        self._lines = Lines(numbered=numbered)
        self._text = bytearray()
        self._begins, self._numbers, self._highest = array("q", (0,)), array("q"), array("q")

    def add(self, number: int, line: str) -> None:
        """The next line, and its number. Raises ProgramError as `Lines.block` does."""
        if (made := self._lines.block(number, line)) is None:
            return
        text, own = made
        self._text += text.encode("latin-1", errors="replace") + b"\n"
        self._begins.append(len(self._text))
        self._numbers.append(own)
        self._highest.append(self._lines.highest)

    def program(self) -> StoredProgram:
        """Raises ProgramError M1111 if the last line is chained to nothing."""
        self._lines.end()
        return StoredProgram(self._name, bytes(self._text), self._begins, self._numbers, self._highest)


class Store(dict[str, StoredProgram]):
    """Programs by name; a fed one hides a stored one of the same name."""

    feed: Feed | None = None

    def find(self, name: str) -> Blocks:
        """The program. Raises ProgramError M1252 if there is none."""
        if self.feed is not None and self.feed.name == name:
            return self.feed
        if name not in self:
            raise ProgramError(Code.NO_PROGRAM, name)
        return self[name]

    def text(self, name: str, number: int) -> str:
        """The text after the number of a block; empty if there is no such block."""
        try:
            return self.find(name).after(number)
        except ProgramError:
            return ""
