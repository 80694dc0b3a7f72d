"""Job files: commands for a controller, one a line, played in virtual time.

    # a comment: "#" at the start of a line or after a blank, not followed by a letter or digit (`#DX,...` is a command)
    @07                                      text is framed by the controller's language; the reply is awaited
    @0M16000,5000,0,30,0,30,0,30<13> <0.5s> <253>     <N> is the byte N, <Ns> lets N seconds pass
    <254>                                    text before a <...> is sent unchanged, only text after it is framed
    @0M160000,5000,0,30,0,30,0,30 => 2       expected reply, and a condition after it: expect.py
    ! x < 396 mm

Lines end in LF, CR LF or CR. A file is UTF-8 or, where it is not valid UTF-8, Latin-1; what is sent is Latin-1. UTF-16
is refused.

The controller's language (`isel_twin.language`) defines frames and refusals. A controller without one takes bytes only,
and no reply counts as a refusal.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from isel_twin.base.units import SECOND_NS
from isel_twin.controller import offers
from isel_twin.jobs import expect
from isel_twin.jobs.expect import Condition, Expected, ExpectError
from isel_twin.language import Language, LanguageError, RunsPrograms, encoded, needed

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

LONGEST_PAUSE_S = 1e9  # longest pause in virtual seconds, as for the times of a scenario

_LINE_END = re.compile(r"\r\n|\r|\n")  # str.splitlines would also split at controls such as 85h
_BLANKS = " \t"
_COMMENT = re.compile(r"(^|[ \t])#(?![A-Za-z0-9]).*", re.DOTALL)
_EXPECTED = re.compile(r"=>(?=[ \t]|$)")
_CONDITION = re.compile(r"[ \t]*(!)(?=[ \t]|$)")
_ITEM = re.compile(r"[ \t]*<([^<>]*)>[ \t]*")
_BYTE = re.compile(r"0*([0-9]{1,3})")
_PAUSE = re.compile(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)[ \t]*s")
_END = "\x1a"  # of a text, where old systems write one


class JobError(ValueError):
    """A job file is wrong; the message is one line that names the line and the remedy.

    excerpt: the line with a caret below the error, if its column is known.
    """

    def __init__(self, message: str, excerpt: str = "") -> None:
        super().__init__(message)
        self.excerpt = excerpt


@dataclass(frozen=True)
class Line:
    """One line of a job: `actions` are bytes to send and pauses in ns; none for a condition."""

    number: int
    command: str
    actions: tuple[bytes | int, ...]
    expected: Expected | None = None
    condition: Condition | None = None
    source: str = ""  # the line in the file; of a program the whole text
    begin: int = 0  # index at which the parsed condition begins
    # in place of actions, if it loads or runs a program: the bytes to send (RunsPrograms)
    program: Iterable[bytes] = ()
    # of a program that was made of a CAM program's file: the line there of each of its lines
    places: tuple[int, ...] = ()

    @property
    def sent(self) -> bytes:
        return b"".join((*(action for action in self.actions if isinstance(action, bytes)), *self.program))

    @property
    def pauses_ns(self) -> int:
        return sum(action for action in self.actions if isinstance(action, int))


def decode_job(data: bytes) -> str:
    """Text of a job file, without the Ctrl-Z that old systems end a text with. Raises JobError for UTF-16 and binary
    data."""
    if b"\0" in data or data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise JobError("is UTF-16 or no text at all; save it as UTF-8, and write a byte 0 in a command as <0>")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.rstrip(_END)


def parse_job(text: str, language: Language | None, controller: str) -> list[Line]:
    """Lines of a job without empty lines and comments. Only text to be framed needs the language. Raises JobError."""
    if offers(language, RunsPrograms):
        try:
            steps = language.job(text)
        except LanguageError as error:
            raise JobError(str(error)) from None
        if steps is not None:
            return [Line(number, step, (), source=text, program=data) for number, (step, data) in enumerate(steps, 1)]
    lines: list[Line] = []
    for number, raw in enumerate(_LINE_END.split(text), 1):
        told = _COMMENT.sub("", raw)
        marker = _EXPECTED.search(told)
        command = (told[: marker.start()] if marker else told).strip(_BLANKS)
        try:
            if not marker and (sign := _CONDITION.match(told)):
                if not any(line.actions for line in lines):
                    raise ExpectError("a condition stands after a command", sign.start(1))
                lines.append(_condition_line(number, raw, told, sign.end()))
            elif marker and (not command or _CONDITION.match(told)):
                raise ExpectError("a reply is expected of a command, which is missing before it", marker.start())
            elif command:
                actions = tuple(_actions(command, language, controller))
                lines.append(Line(number, command, actions, _expected(told, marker)))
        except (JobError, LanguageError) as error:
            raise JobError(f"line {number}: {error}") from None
        except ExpectError as error:
            raise expect_error(error, number, raw) from None
    return lines


def commands(text: str) -> Iterator[tuple[int, str]]:
    """Line and text of each command of a job, as it is written, without conditions, remarks and expected replies."""
    for number, raw in enumerate(_LINE_END.split(text), 1):
        told = _COMMENT.sub("", raw)
        command = _EXPECTED.split(told, maxsplit=1)[0].strip(_BLANKS)
        if command and not _CONDITION.match(told):
            yield number, command


def expects(text: str) -> bool:
    """Does a line of a job say which reply it expects?"""
    return _EXPECTED.search(text) is not None


def expect_error(error: ExpectError, number: int, source: str, begin: int = 0) -> JobError:
    """The error of a line of a job. begin: index at which the parsed text begins."""
    at = begin + error.at
    return JobError(f"line {number}, column {at + 1}: {error}", expect.excerpt(source, at))


def check_conditions(lines: Sequence[Line], twin: Twin) -> None:
    """Raise JobError for a condition with a name that this twin does not have."""
    for line in lines:
        if line.condition is not None:
            try:
                line.condition.check(twin)
            except ExpectError as error:
                raise expect_error(error, line.number, line.source, line.begin) from None


def _condition_line(number: int, raw: str, told: str, begin: int) -> Line:
    try:
        condition = expect.parse_condition(told[begin:])
    except ExpectError as error:
        raise ExpectError(str(error), begin + error.at) from None
    return Line(number, told.strip(_BLANKS), (), None, condition, raw, begin)


def _expected(told: str, marker: re.Match[str] | None) -> Expected | None:
    if marker is None:
        return None
    try:
        return expect.parse_expected(told[marker.end() :])
    except ExpectError as error:
        raise ExpectError(str(error), marker.end() + error.at) from None


def _actions(command: str, language: Language | None, controller: str) -> Iterator[bytes | int]:
    """Bytes and pauses in their order; neighbouring bytes are sent together."""
    together = b""
    *pieces, rest = _ITEM.split(command)  # text, item, text, item, ..., text
    for text, item in zip(pieces[::2], pieces[1::2], strict=True):
        together += encoded(text)
        if (byte := _BYTE.fullmatch(item)) and int(byte[1]) < 256:
            together += bytes([int(byte[1])])
        elif pause := _PAUSE.fullmatch(item):
            if together:
                yield together
            together = b""
            seconds = float(pause[1])
            if seconds > LONGEST_PAUSE_S:
                raise JobError(f"a pause of more than {LONGEST_PAUSE_S:.0f} s; make it shorter")
            yield round(seconds * SECOND_NS)
        else:
            raise JobError(f"<{item}> is neither a byte (<0> to <255>) nor a pause (<0.5s>)")
    if rest:
        together += needed(language, controller).frame(rest)
    if together:
        yield together
