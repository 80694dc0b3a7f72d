"""HPGL as instructions: two letters and numbers, wherever lines end, a pair of numbers at a time."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from isel_twin.cam.reader import LONGEST, unusual
from isel_twin.cam.toolpath import CamError, Place

MOST = 1e9
_TOKEN = re.compile(
    r"[\s,]+|([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:E[-+]?[0-9]{1,2})?)|([A-Z]{2})|(;)|"
    r"(\x1b\.[()YZ]|\x1b\.[^:]{0,40}:|\x1b%-?[0-9]*[A-Z]|\x1bE)|(.)",
    re.I | re.A | re.S,
)
_PLAIN = r"([-+]?[0-9]{1,8}(?:\.[0-9]{0,8})?)"
_PAIR = re.compile(rf"[\s,]*(?:(P[ADRU])[ \t]*)?{_PLAIN}[, ]{_PLAIN}(?=[;,\s])(;?)", re.I | re.A)  # most of a file
_POINTS = frozenset(("PU", "PD", "PA", "PR"))
_PLAIN_TEXT = {"LB": "\x03", "CO": ";", "BP": ";", "PE": ";"}  # what ends it; LB as DT says
_MOST_NUMBERS = 16


class Instruction(NamedTuple):
    """place: of its letters, or of the first number of this pair of points. numbers: all, or of points one pair (first:
    the first of its instruction); odd: a number was left over."""

    place: Place
    code: str
    numbers: tuple[float, ...] = ()
    first: bool = True
    odd: bool = False


def instructions(lines: Iterable[str]) -> Iterator[Instruction]:
    """Instructions of a file. Points come pair by pair, so that one of any length needs little memory. Raises
    CamError for what is neither letters nor numbers."""
    return _Scanner().scan(lines)


class _Scanner:
    def __init__(self) -> None:
        self._code = ""  # the instruction being read
        self._place = Place(1)
        self._numbers: list[float] = []
        self._first = True
        self._until = ""  # the character that ends a text
        self._label_end = "\x03"

    def scan(self, lines: Iterable[str]) -> Iterator[Instruction]:
        line, before, rest = 1, 0, ""
        for piece in lines:
            whole = len(piece) < LONGEST or piece.endswith("\n")
            text = rest + piece
            cut = len(text) if whole else max(text.rfind(";"), text.rfind(","), text.rfind(" "), 0) or len(text)
            text, rest = text[:cut], text[cut:]
            yield from self._text(text, line, before)
            line, before = (line + 1, 0) if whole else (line, before + cut)
        yield from self._text(rest, line, before)
        yield from self._ended()

    def _text(self, text: str, line: int, before: int) -> Iterator[Instruction]:
        at, end = 0, len(text)
        while at < end:
            if self._until:
                found = text.find(self._until, at)
                if found < 0:
                    return
                self._until, at = "", found + 1
                continue
            pair = _PAIR.match(text, at)
            if pair is not None and (pair[1] or (self._code in _POINTS and not self._numbers)):
                letters, x, y, ended = pair.groups()
                if letters is not None:
                    yield from self._ended()
                    self._code, self._first = letters.upper(), True
                at = pair.end()
                place = Place(line, before + pair.start(2) + 1, self._code)
                yield Instruction(place, self._code, (float(x), float(y)), self._first)
                self._first = False
                if ended:
                    self._code = ""
                continue
            match = _TOKEN.match(text, at)
            assert match is not None  # its last branch takes any character
            at = match.end()
            number, letters, semicolon, _, other = match.groups()
            if number is not None:
                yield from self._number(number, Place(line, before + match.start() + 1, self._code))
            elif letters is not None:
                yield from self._ended()
                self._code, self._first = letters.upper(), True
                self._place = Place(line, before + match.start() + 1, letters)
                if self._code == "DT" and at < end and text[at] != ";":
                    self._label_end, at = text[at], at + 1
                elif self._code in _PLAIN_TEXT:
                    self._until = self._label_end if self._code == "LB" else _PLAIN_TEXT[self._code]
                    yield from self._ended()
            elif semicolon is not None:
                yield from self._ended()
            elif other is not None and other not in "\x00\x03\x1a":
                place = Place(line, before + match.start() + 1, other)
                raise CamError(f"{other!r} is no instruction of HPGL", place)

    def _number(self, number: str, place: Place) -> Iterator[Instruction]:
        if wrong := unusual(number):
            raise CamError(wrong, place)
        value = float(number)
        if not self._code:
            raise CamError(f"{number[:20]} stands behind no instruction", place)
        if not abs(value) <= MOST:
            raise CamError(f"{number[:20]} is out of range; allowed: up to {MOST:g}", place)
        if self._code in _POINTS:
            if not self._numbers:
                self._place = place
            self._numbers.append(value)
            if len(self._numbers) == 2:
                yield Instruction(self._place, self._code, tuple(self._numbers), self._first)
                self._numbers.clear()
                self._first = False
        elif len(self._numbers) < _MOST_NUMBERS:
            self._numbers.append(value)

    def _ended(self) -> Iterator[Instruction]:
        code, numbers = self._code, tuple(self._numbers)
        self._code = ""
        self._numbers.clear()
        if not code:
            return
        if code not in _POINTS:
            yield Instruction(self._place, code, numbers)
        elif self._first or numbers:
            yield Instruction(self._place, code, (), self._first, bool(numbers))
