"""Dripfeed: a program executed while it arrives on the line (manual 2.5.1, P8811).

    line ---> lines wait ........ ---> block in execution ---> the last ones, for messages and texts ---> dropped
              HIGH: the host waits     (place)              KEPT
              LOW: it goes on

It is linear: no jumps, but calls of stored programs. Lines without a handshake that exceed the room give M1268.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.programs.lines import Lines, without_number
from isel_twin.firmware.bwo900.programs.syntax import parse_block
from isel_twin.firmware.bwo900.programs.words import ProgramBlock

ROOM: Final = 65_536  # bytes of lines that can wait; the manual gives no number
HIGH: Final = ROOM // 2  # waiting bytes from which on the host must wait
LOW: Final = ROOM // 4  # waiting bytes up to which it may go on
KEPT: Final = 2048  # analysed lines that are kept: more than are ever analysed ahead


class Feed:
    """A program while it arrives. Implements `stored.Blocks`."""

    linear: Final = True

    def __init__(self, name: str) -> None:
        """name: of the started program, regardless of the file."""
        self.name = name
        self.complete = False  # its last line has come
        self.level = 0  # bytes received but not analysed (P8561)
        self.waits = False  # the host must wait
        self.begun = False  # its file has begun to arrive
        self.given_up = False  # no more of it is needed
        self._lines = Lines(numbered=True)
        self._known: deque[tuple[str, int]] = deque()  # text and number of the kept blocks
        self._texts: dict[int, str] = {}  # the same by number
        self._dropped = 0  # blocks that are forgotten
        self._analysed = 0

    def add(self, number: int, line: str) -> None:
        """The next line, and its number. Raises ProgramError: M1113, M1268, M1290."""
        if self.given_up or (made := self._lines.block(number, line)) is None:
            return
        text, own = made
        if self.level + len(text) > ROOM:
            raise ProgramError(Code.NO_ROOM, f"line {number} of {self.name}")
        self._known.append(made)
        if own >= 0:
            self._texts[own] = text
        self.level += len(text)
        self.waits = self.waits or self.level >= HIGH

    def end(self) -> None:
        """Take the end of the file. Raises ProgramError M1111 if the last line is chained to nothing."""
        self.complete, self.waits = True, False
        self._lines.end()

    def give_up(self) -> None:
        """Discard the lines that still come: the program is aborted."""
        self.given_up, self.waits, self.level = True, False, 0
        self._known.clear()
        self._texts.clear()

    def __len__(self) -> int:
        return self._dropped + len(self._known)

    def line(self, place: int) -> str:
        """The text of the block at a place, from 0; it and those before count as analysed."""
        text, _ = self._known[place - self._dropped]
        self.analysed(place + 1)
        return text

    def lines(self, place: int, most: int) -> str:
        """The texts of at most so many known blocks from a place on, each ended by LF; none counts as analysed."""
        first = place - self._dropped
        return "".join(f"{self._known[n][0]}\n" for n in range(first, min(first + most, len(self._known))))

    def analysed(self, place: int) -> None:
        """The blocks before this place count as analysed."""
        for each in range(self._analysed, place):
            self.level -= len(self._known[each - self._dropped][0])
        if place > self._analysed:
            self._analysed = place
            self.waits = self.waits and self.level > LOW
        while self._analysed - self._dropped > KEPT:
            self._texts.pop(self._known.popleft()[1], None)
            self._dropped += 1

    def block(self, place: int) -> ProgramBlock:
        """The block at a place, as `line`. Raises ProgramError."""
        return parse_block(self.line(place), place + 1)

    def number(self, place: int) -> int:
        return self._known[place - self._dropped][1] if self._dropped <= place < len(self) else -1

    def after(self, number: int) -> str:
        return without_number(self._texts.get(number, ""))

    def place(self, number: int) -> int:
        """Raises ProgramError M1269."""
        raise ProgramError(Code.NOT_WHILE_FED, f"N{number} in {self.name}: a program that is fed has no jumps")
