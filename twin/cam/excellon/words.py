"""A line of a drill file as words: letters with their numbers, as they are written."""

from __future__ import annotations

import re
from typing import NamedTuple

from isel_twin.cam.reader import unusual
from isel_twin.cam.toolpath import CamError, Place

_WORD = re.compile(r"[ \t]*([A-Z])[ \t]*([-+]?(?:[0-9]+\.?[0-9]*|\.[0-9]+))(,[0-9]+|E[-+]?[0-9]{1,2})?", re.I | re.A)
_MOST_DIGITS = 20


class Word(NamedTuple):
    letter: str  # capital
    text: str  # its number as it is written
    place: Place

    @property
    def whole(self) -> int:
        """The number of a code, tool or count."""
        if not self.text.isdigit():
            raise CamError(f"{self.place.word[:20]}: a whole number is wanted", self.place)
        return int(self.text)


def words(text: str, line: int) -> list[Word]:
    """The words of a statement. Raises CamError for what is none."""
    found, at, end = [], 0, len(text.rstrip())
    while at < end:
        match = _WORD.match(text, at)
        if match is None:
            at += len(text[at:]) - len(text[at:].lstrip())
            word = text[at:].split()[0]
            raise CamError(f"{word[:20]!r} is no word of Excellon", Place(line, at + 1, word))
        place = Place(line, match.start(1) + 1, match[0].strip())
        if match[3]:
            why = unusual(match[2] + match[3])
            pointed = "." in why.rpartition(" ")[2]  # digits without a point are other numbers
            raise CamError(f"{match[1]}: {why}{'' if pointed else '.0'}", place)
        if len(match[2]) > _MOST_DIGITS:
            raise CamError(f"{place.word[:20]} .. has too many digits", place)
        found.append(Word(match[1].upper(), match[2], place))
        at = match.end()
    return found


def at_most_once(found: list[Word], letters: str) -> dict[str, Word]:
    """The words of these letters. Raises CamError for one that is there twice."""
    by_letter: dict[str, Word] = {}
    for word in found:
        if word.letter in letters:
            if word.letter in by_letter:
                raise CamError(f"{word.letter} is there twice in one line", word.place)
            by_letter[word.letter] = word
    return by_letter
