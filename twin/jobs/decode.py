"""Bytes of a line explained message by message, for `isel-twin decode`.

    pieces of bytes, each with its direction  --- explain --->  Row, Row, Row ...     as the messages become complete
    text typed in                             --- typed ----->  such pieces

The `data` of all rows of a direction, joined, is exactly the input of that direction. The language (isel_twin.language)
knows the meaning.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import count

from isel_twin.jobs.job import JobError, parse_job
from isel_twin.language import Language, encoded, readable

_LINE_END = re.compile(r"\r\n|\r|\n")
_BYTE = re.compile(r"<0*([0-9]{1,3})>")


class DecodeError(ValueError):
    """Text is not valid as bytes of a line; the message is one line with the place."""


@dataclass(frozen=True)
class Piece:
    """Bytes on the line, from the host (`sent`) or from the controller."""

    data: bytes
    sent: bool
    time_ns: int | None = None  # when the last of them came, if known


@dataclass(frozen=True)
class Row:
    """One message, or an incomplete one at the end."""

    number: int  # from 1, in the order in which messages became complete
    offset: int  # of its first byte among the bytes of its direction, from 0
    sent: bool
    data: bytes
    text: str  # readable: as in a job file; never empty
    explanation: str
    complete: bool
    time_ns: int | None = None  # when it was complete, if known


def explain(pieces: Iterable[Piece], language: Language) -> Iterator[Row]:
    """Rows as they become complete, then the rest of each direction. `language`: a fresh one."""
    numbers, offsets = count(1), {True: 0, False: 0}

    def row(data: bytes, text: str, explanation: str, sent: bool, time_ns: int | None, complete: bool = True) -> Row:
        offset = offsets[sent]
        offsets[sent] += len(data)
        return Row(next(numbers), offset, sent, data, text or readable(data), explanation, complete, time_ns)

    for piece in pieces:
        for message in language.messages(piece.data, piece.sent):
            yield row(message.data, message.text, message.explanation, piece.sent, piece.time_ns)
    for sent in (True, False):
        if begun := language.rest(sent):
            yield row(begun, "", "not complete", sent, None, complete=False)


def typed(text: str, sent: bool, language: Language, controller: str) -> list[Piece]:
    """Typed text: commands as in a job file, or a reply in which <13> is the byte 13. Raises DecodeError for text that
    no line can carry."""
    try:
        if not sent:
            return [Piece(_BYTE.sub(_byte, encoded(text).decode("latin-1")).encode("latin-1"), sent)]
        return [Piece(line.sent, sent) for line in parse_job(text, language, controller)]
    except (JobError, ValueError) as error:
        raise DecodeError(re.sub(r"^line 1(?=[:,])[:,] ", "", str(error))) from None


def marked(text: str, language: Language, controller: str) -> Iterator[Piece]:
    """Typed text of both directions: lines from the host begin with `>`, lines from the controller with `<`. Raises
    DecodeError for a line that is not marked."""
    for number, line in enumerate(_LINE_END.split(text), 1):
        if not line.strip():
            continue
        if line[0] not in "><":
            raise DecodeError(f"line {number}: begins neither with > (sent by the host) nor with < (by the controller)")
        try:
            yield from typed(line[1:].removeprefix(" "), line[0] == ">", language, controller)
        except DecodeError as error:
            raise DecodeError(f"line {number}: {error}") from None


def _byte(found: re.Match[str]) -> str:
    """The byte of a <N>; other text stays."""
    return chr(int(found[1])) if int(found[1]) < 256 else found[0]
