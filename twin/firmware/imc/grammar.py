"""From bytes to commands: lines, codes, numbers, without their meaning.

    bytes  ->  LineAssembler  ->  lines  ->  split_dnc / split_cnc  ->  code, parameter text  ->  read_numbers

A line is everything up to CR. LF is ignored everywhere, and an empty line is no command (imc/6). The control bytes 253,
254 and 255 never come here. Nothing from the line is evaluated: a number is matched by a pattern and converted
(imc/14).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from isel_twin.firmware.imc.replies import BAD_NUMBER, PARAMETER_COUNT, SYNTAX, Refusal

CR, LF = 13, 10
STOP, RESET, BREAK = 253, 254, 255  # control bytes (2.2.31)
AXES_CODE = "axes"  # code given to `@0<number>`, the command without a letter

_NUMBER = re.compile(r"([+-]?)(?:([0-9]+)(?:\.[0-9]*)?|\.[0-9]+)")
_WHOLE_NUMBERS = re.compile(r"[+-]?[0-9]+(?:,[+-]?[0-9]+)*")
ENDS = frozenset((CR, STOP, RESET, BREAK))  # what may have an effect of its own
_RUNS = re.compile(rb"(?!\Z)([^\r\xfd-\xff]*)([\r\xfd-\xff]?)")  # up to one of the same, or to the end


class LineAssembler:
    """Collects bytes into lines of at most `limit` bytes; more are dropped, so that memory is bounded."""

    def __init__(self, limit: int) -> None:
        self._limit = limit
        self._line = bytearray()
        self._too_long = False

    def feed(self, run: bytes) -> None:
        """Take bytes without a CR."""
        room = self._limit - len(self._line)
        run = run.replace(b"\n", b"")
        self._line += run[:room]
        self._too_long |= len(run) > room

    def end(self) -> bytes | None:
        """Take a CR; return the line that it ends, None for an empty one. One that was too long is returned empty."""
        line = b"" if self._too_long else bytes(self._line)
        complete = self._too_long or line.strip()
        self._line.clear()
        self._too_long = False
        return line if complete else None


def split_runs(data: bytes) -> Iterator[tuple[bytes, bytes]]:
    """Runs of bytes, each with the CR or control byte that ends it, b"" at the end of the data."""
    for found in _RUNS.finditer(data):
        yield found[1], found[2]


@dataclass(frozen=True)
class Number:
    """One numeric parameter: allowed range, and the reply when it is outside."""

    low: int = -(1 << 23)
    high: int = (1 << 23) - 1
    code: str = BAD_NUMBER

    def check(self, value: int) -> int:
        """Return the value; raise Refusal if it is out of range."""
        if not self.low <= value <= self.high:
            raise Refusal(self.code)
        return value


def split_dnc(line: bytes, device_number: int, aliases: Mapping[str, str]) -> tuple[str, str, str] | None:
    """Split `@<number><letter(s)><parameters>` into (letter as sent, code, parameter text); None: for another device.

    Raises Refusal(5) for anything that does not begin like a command.
    """
    text = line.decode("latin-1").strip(" ")
    if len(text) < 3 or text[0] != "@" or text[1] not in "0123456789":
        raise Refusal(SYNTAX)
    if int(text[1]) != device_number:
        return None
    rest = text[2:].lstrip(" ")
    letter = rest[:1]
    if letter in "0123456789":
        return letter, AXES_CODE, rest
    if letter == "I":
        return letter, rest[:2], rest[2:]
    return letter, aliases.get(letter, letter), rest[1:]


def split_cnc(line: bytes, aliases: Mapping[str, str]) -> tuple[str, str]:
    """Split a storable command into (code, parameter text)."""
    text = line.decode("latin-1").strip(" ")
    return aliases.get(text[:1], text[:1]), text[1:]


def cut(text: str, wanted: int, most: int) -> str:
    """The first `wanted` of up to `most` parameters; more than that are left as they are."""
    fields = text.split(",")
    return ",".join(fields[:wanted]) if len(fields) <= most else text


def read_numbers(text: str, numbers: Sequence[Number]) -> tuple[int, ...]:
    """Read comma-separated parameters, as many as `numbers` has.

    Raises Refusal: 7 for another count, 1 for a field that is no number, the parameter's own code when out of range.
    """
    fields = text.split(",") if text.strip(" ") else []
    if len(fields) != len(numbers):
        raise Refusal(PARAMETER_COUNT)
    values = tuple(map(int if _WHOLE_NUMBERS.fullmatch(text) else read_number, fields))
    for number, value in zip(numbers, values, strict=True):
        if not number.low <= value <= number.high:
            raise Refusal(number.code)
    return values


def read_number(field: str) -> int:
    """Read one number; a decimal fraction is cut off (imc/6). Raises Refusal(1)."""
    match = _NUMBER.fullmatch(field.strip(" "))
    if match is None:
        raise Refusal(BAD_NUMBER)
    sign, digits = match[1], match[2] or "0"
    return -int(digits) if sign == "-" else int(digits)
