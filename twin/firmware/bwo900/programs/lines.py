"""Lines of a program's file to blocks (manual 3.1, 3.10)."""

from __future__ import annotations

import re
from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError

END: Final = "#"  # after the last block of a file
TABLES: Final = {"W": "tool table", "N": "zero points", "B": "zero points"}
PARAMETERS: Final = ("D", "D+", *TABLES)  # what files of parameters begin with
# characters that are ignored at the ends of a line: blanks, and ends of files of another setting
BLANK: Final = "".join(chr(code) for code in range(33))
HANDSHAKE: Final = b"\x11\x13"  # Xon and Xoff of a host, which are ignored
MOST_LINE: Final = 400  # characters of a line of a file (M1113)
MOST_DIGITS: Final = 10  # of a block's number
_NAME = re.compile(r"\s*([PZ])\s*(\d{1,10})\s*$")
_NUMBER = re.compile(r"\s*+/?\s*+N\s*(\d+)")


class Lines:
    """Makes blocks of lines: drops comments and blank lines, joins chained ones, checks that numbers rise."""

    def __init__(self, *, numbered: bool = False) -> None:
        """numbered: every block must begin with N or /N."""
        self._numbered = numbered
        self.highest = -1  # highest number of a block so far, -1 without one
        self._chained = ""

    def block(self, number: int, line: str) -> tuple[str, int] | None:
        """Text and number (-1: none) of the block that ends with this line, None if none does. number: of the line.
        Raises ProgramError: M1113 too long, M1111 no number or more than ten digits, M1290 numbers that do not rise."""
        if len(line) > MOST_LINE:
            raise ProgramError(Code.LINE_TOO_LONG, f"line {number}", infos=(number,))
        text = line.rstrip()
        if not text.strip() or text.lstrip().startswith(";"):
            return None
        if text.endswith("\\"):
            self._chained += text[:-1] + " "
            return None
        text, self._chained = (self._chained + text).strip(), ""
        found = _NUMBER.match(text)
        if found is None:
            if self._numbered:
                raise ProgramError(
                    Code.WRONG_LINE, f"line {number}: {text[:20]!r}; a block begins with N or /N", infos=(number,)
                )
            return text, -1
        if len(found[1].lstrip("0")) > MOST_DIGITS:
            raise ProgramError(
                Code.WRONG_LINE, f"line {number}: N{found[1][:20]}; allowed: {MOST_DIGITS} digits", infos=(number,)
            )
        if int(found[1]) <= self.highest:
            raise ProgramError(
                Code.NOT_RISING, f"N{found[1]} after N{self.highest}, line {number}", infos=(number, int(found[1]))
            )
        self.highest = int(found[1])
        return text, self.highest

    def end(self) -> None:
        """Take the end of the file. Raises ProgramError M1111 if the last line is chained to nothing."""
        if self._chained:
            raise ProgramError(Code.WRONG_LINE, "the last line is chained to nothing")


def without_number(block: str) -> str:
    """The text after the number of a block."""
    found = _NUMBER.match(block)
    return block[found.end() :].strip() if found else block


def program_name(line: str) -> str:
    """The name in a line that begins a program, else empty."""
    match = _NAME.match(line)
    return "" if match is None else f"{match[1]}{int(match[2])}"
