"""A line of G-code as a block: words, codes by modal group, messages; by the rules of LinuxCNC (docs/jobfiles.md).

    /N10 G1 X1.5 Y-.5 (a remark) F300 ; another

Blanks mean nothing, not even in numbers; letters are read like capitals; a letter stands once in a line, G and M once a
group.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field

from isel_twin.cam.gcode import codes
from isel_twin.cam.reader import Once, unusual
from isel_twin.cam.toolpath import CamError, Caution, Place

MOST = 1e7  # of any number
_WORD = re.compile(r"[ \t]*([A-Z])[ \t]*([-+]?(?:[ \t]*[0-9.,])+(?:E[-+]?[0-9]{1,2}(?![0-9.]))?)", re.I | re.A)
_START = re.compile(r"[ \t]*/?[ \t]*(?:N[ \t]*[0-9][0-9. \t]*)?", re.I | re.A)
_LABEL = re.compile(r"O[ \t]*[0-9][0-9 \t]*(.*)", re.I | re.A | re.S)
_ACTIVE = re.compile(r"[ \t]*(MSG|DEBUG|PRINT|LOG)[ \t]*,(.*)", re.I | re.S)
_EDING = re.compile(
    r"[ \t]*(msg|(?:dlg|warn|err|log)msg|logfile|print|gosub|(?:end)?(?:sub|if|while)|else)\b(?:[ \t]*\"([^\"]*)\"?)?",
    re.I,
)
_BRACKETS = str.maketrans("()", "[]")
NO_AXIS = "ABCUVW"
LETTERS = "XYZIJKRFSTPQLHD"


@dataclass
class Block:
    """A line. place: of its first word; words: numbers as written, by letter; g, m: code by modal group."""

    place: Place
    words: dict[str, float] = field(default_factory=dict)
    g: dict[str, int] = field(default_factory=dict)
    m: dict[str, int] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)  # of letters, and of codes as "G1"
    messages: list[str] = field(default_factory=list)

    def at(self, letter: str, code: int) -> Place:
        return self.places.get(codes.name(letter, code), self.place)

    def wrong(self, what: str, letter: str = "") -> CamError:
        return CamError(what, self.places.get(letter, self.place))


class Lines:
    """Reads lines. strict: as LinuxCNC, no remarks in remarks; dialect: of the settings."""

    def __init__(self, strict: bool, dialect: str, once: Once) -> None:
        self._strict = strict
        self._din, self._winpc = dialect in ("din", "winpc"), dialect == "winpc"
        self._once = once

    def block(self, text: str, number: int) -> tuple[Block, list[Caution]]:
        """The block of a line that is no % line. Raises CamError."""
        if self._strict and len(text) > 255:
            raise CamError("a line has at most 255 characters", Place(number))
        said: list[Caution] = []
        block = Block(Place(number))
        if "(" in text or ";" in text:
            text = self._without_remarks(text, number, block, said)
        at = _START.match(text).end()  # type: ignore[union-attr]
        label = _LABEL.match(text, at)
        if label is not None:
            if label[1].strip():
                word = label[1].split()[0]
                raise CamError(
                    f"O {word[:20]} is a subprogram, a branch or a loop: these are not read; let the CAM "
                    "program write them out",
                    Place(number, at + 1, text[at:].strip()[:20]),
                )
            return block, said
        if eding := _EDING.match(text, at):
            raise _of_eding(eding, Place(number, eding.start(1) + 1, eding[1]))
        for letter, value, place in self._words(text, at, number):
            if not block.places:
                block.place = place
            self._put(block, letter, value, place)
        return block, said

    def _words(self, text: str, at: int, number: int) -> Iterator[tuple[str, float, Place]]:
        match = _WORD.match(text, at)
        while match is not None:
            letter, written = match.groups()
            place = Place(number, match.start(1) + 1, match[0].strip())
            plain = "".join(written.split())
            if wrong := unusual(plain):
                raise CamError(f"{letter.upper()}: {wrong}", place)
            try:
                value = float(plain)
            except ValueError:
                raise CamError(f"{match[0].strip()[:30]!r} is not a number", place) from None
            if not abs(value) <= MOST:
                raise CamError(f"{match[0].strip()[:30]} is out of range; allowed: up to {MOST:g}", place)
            yield letter.upper(), value, place
            at = match.end()
            match = _WORD.match(text, at)
        rest = text[at:].strip()
        if rest:
            raise _not_a_word(rest, Place(number, at + 1 + text[at:].index(rest[0]), rest.split()[0][:20]))

    def _put(self, block: Block, letter: str, value: float, place: Place) -> None:
        if letter in "GM":
            code = round(value * 10) if letter == "G" else round(value)
            block.places[codes.name(letter, code)] = place
            if letter == "M" and self._din and code in codes.DIN_SWITCHES:
                group = f"{codes.SWITCH} {abs(code)}"
            else:
                if letter == "G" and self._winpc and code in codes.WINPC_REFUSED:
                    raise CamError(f"{codes.name(letter, code)} is refused: {codes.WINPC_REFUSED[code]}", place)
                group = _group(letter, code, value, place)
                if self._strict and letter == "G" and code in codes.CANCELS:
                    raise CamError(f"{place.word[:20]} is unknown to LinuxCNC; leave it out", place)
            groups = block.g if letter == "G" else block.m
            if 800 in (code, groups.get(group)) and group in groups:
                code = code if groups[group] == 800 else groups[group]  # G80 says nothing beside a motion
            elif group in groups:
                first = codes.name(letter, groups[group])
                raise CamError(f"{first} and {codes.name(letter, code)} exclude each other in one line", place)
            groups[group] = code
            return
        if letter in NO_AXIS:
            leave = "" if value else f"; leave {letter}0 out"  # of more it makes another part (cam/37)
            raise CamError(f"this machine has no axis {letter}{leave}", place)
        if letter == "N":
            raise CamError("N stands at the beginning of a line only", place)
        if letter not in LETTERS:
            raise CamError(f"{letter} is no word of G-code here", place)
        if letter in block.words:
            raise CamError(f"{letter} is there twice in one line", place)
        block.words[letter] = value
        block.places[letter] = place

    def _without_remarks(self, text: str, number: int, block: Block, said: list[Caution]) -> str:
        """The line with blanks in place of remarks."""
        kept: list[str] = []
        at = 0
        while True:
            begin = min((i for i in (text.find("(", at), text.find(";", at)) if i >= 0), default=-1)
            if begin < 0:
                return "".join([*kept, text[at:]])
            end = text.find(")", begin)
            kept.append(text[at:begin])
            if text[begin] == ";":
                return "".join(kept)
            place = Place(number, begin + 1, "(")
            if end < 0:
                if self._strict:
                    raise CamError("the remark is not closed; write ) behind it", place)
                said += self._once("unclosed", place, "a remark that is not closed goes to the end of its line")
                end = len(text)
            elif "(" in text[begin + 1 : end]:
                if self._strict:
                    raise CamError("a remark in a remark; leave the inner brackets out", place)
                said += self._once("nested", place, "a remark in a remark: it goes to the last bracket of its line")
                end = text.rindex(")")
            if active := _ACTIVE.match(text[begin + 1 : end]):
                block.messages.append(" ".join(active[2].split()))
            kept.append(" " * (end + 1 - begin))
            at = end + 1


def _group(letter: str, code: int, value: float, place: Place) -> str:
    refused = (codes.G_REFUSED if letter == "G" else codes.M_REFUSED).get(code)
    group = (codes.G_GROUPS if letter == "G" else codes.M_GROUPS).get(code)
    scaled = value * 10 if letter == "G" else value
    if abs(scaled - code) > 1e-6 or (refused is None and group is None):
        raise CamError(f"{place.word[:20]} is unknown here: what it does is not made", place)
    if refused is not None:
        raise CamError(f"{codes.name(letter, code)} is refused: {refused}", place)
    return str(group)


def _not_a_word(rest: str, place: Place) -> CamError:
    if "#" in rest[:2] or "[" in rest[:2]:
        return CamError("parameters # and expressions [ ] are not read; let the CAM program write numbers", place)
    if rest[0].isascii() and rest[0].isalpha():
        return CamError(f"{rest[0].upper()} has no number behind it", place)
    return CamError(f"{rest[0]!r} is no word of G-code", place)


def _of_eding(match: re.Match[str], place: Place) -> CamError:
    word, text = match[1].lower(), match[2]
    if word == "msg" and text:
        return CamError(f"msg is a command of EdingCNC; write (MSG,{text.translate(_BRACKETS)[:60]})", place)
    return CamError(f"{word} is a command of EdingCNC, whose macros are not read", place)
