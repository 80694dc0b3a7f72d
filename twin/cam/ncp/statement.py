"""A statement of NCP: its word, and what follows it."""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from isel_twin.cam.reader import unusual
from isel_twin.cam.toolpath import CamError, Place

MOST_UM = 1e9
_NUMBERED = re.compile(r"[ \t]*(?:N[0-9]+[ \t]*)?", re.I)
_TOKEN = re.compile(r"COOLANT2|POPTION[12]|[A-Z_]+|[-+]?[0-9]+(?:[.,][0-9]*)?(?:E[-+]?[0-9]{1,2})?|[^ \t]", re.I | re.A)

_OF_PRONC = re.compile(
    r"((END)?(IF|FOR|WHILE)|THEN|ELSE|REPEAT|UNTIL|LABEL|GOTO|(SUBR|PROC)(BEGIN|END)?|CALL|RETURN)\Z"
)
_PRONC = "of a source of ProNC, which is compiled there: its .ncp is run here"
_MEASURED = ("FAST", "MOVE", "CW", "CCW", "VEL", "DRILL")  # how words with lengths begin


@dataclass
class Statement:
    """One statement: its word, and what follows. text: as it is written behind the word."""

    place: Place
    word: str
    text: str
    tokens: list[tuple[str, int]]  # upper case, column

    def wrong(self, what: str, at: int | None = None) -> CamError:
        place = self.place if at is None else Place(self.place.line, at, self.word)
        return CamError(f"{self.word}: {what}", place)

    def check_compiled(self, named: bool) -> None:
        """Raise CamError for a statement of a source of ProNC, which has branches, and mm. named: IMF_PBL has come."""
        if _OF_PRONC.match(self.word):
            raise self.wrong(f"is {_PRONC}")
        if not named and self.word.startswith(_MEASURED):
            for token, at in self.tokens:
                if "." in token:
                    raise self.wrong(f"{token} has a point, and no line IMF_PBL stands before it: {_PRONC}", at)

    def nothing(self) -> None:
        if self.tokens:
            token, at = self.tokens[0]
            raise self.wrong(f"{token!r} is too much here", at)

    def number(self, most: float, least: float = 0.0) -> float:
        """The only argument, rounded to a whole number."""
        if len(self.tokens) != 1:
            raise self.wrong("wants one number behind it")
        return self.value(*self.tokens[0], least, most)

    def value(self, token: str, at: int, least: float, most: float) -> float:
        if wrong := unusual(token):
            raise self.wrong(wrong, at)
        try:
            value = float(token)
        except ValueError:
            raise self.wrong(f"{token!r} is not a number", at) from None
        if not least <= value <= most:
            raise self.wrong(f"{token[:20]} is out of range; allowed: {least:g} .. {most:g}", at)
        return math.copysign(math.floor(abs(value) + 0.5), value) if "." in token else value

    def letters(self, allowed: str) -> dict[str, float]:
        """Arguments such as X1000 Y-200."""
        found: dict[str, float] = {}
        tokens = iter(self.tokens)
        for letter, at in tokens:
            if letter not in allowed or len(letter) != 1:
                raise self.wrong(f"{letter!r} is none of its letters {' '.join(allowed)}", at)
            if letter in found:
                raise self.wrong(f"{letter} is there twice", at)
            token, there = next(tokens, ("", at))
            if not token:
                raise self.wrong(f"{letter} has no number", at)
            found[letter] = self.value(token, there, -MOST_UM, MOST_UM)
        return found


def parsed(line: str, number: int) -> Statement | Place | None:
    """The statement of a line; None for none, a place for a line that begins with a bracket."""
    text = line.rstrip("\r\n")
    begin = _NUMBERED.match(text).end()  # type: ignore[union-attr]
    if text[begin : begin + 7].upper() == "IMF_PBL":
        return Statement(Place(number, begin + 1, text[begin:].split()[0]), "IMF_PBL", text[begin + 7 :], [])
    body = text.partition(";")[0]
    if body.startswith("(", begin):
        return Place(number, begin + 1, "(")
    found = list(_TOKEN.finditer(body, begin))
    if not found:
        return None
    word, *rest = found
    behind = text if word[0].upper() == "TYPE" else body
    tokens = [(token[0].upper(), token.start() + 1) for token in rest]
    return Statement(Place(number, word.start() + 1, word[0]), word[0].upper(), behind[word.end() :], tokens)
