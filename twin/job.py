"""Job files: commands for a controller, one a line, played in virtual time.

    # a comment: "#" at the start of a line or after a blank, not followed by a letter or digit (`#DX,...` is a command)
    @07                                      the text and a carriage return are sent, then the reply is awaited
    @0M16000,5000,0,30,0,30,0,30<13> <0.5s> <253>     <N> is the byte N, <Ns> lets N seconds pass
    <254>                                    a line that ends in <...> gets no carriage return

Lines end in LF, CR LF or CR. A file is UTF-8 or, where it is not valid UTF-8, Latin-1; what is sent is Latin-1.
A line is over when the controller has answered and stands still; its reply is everything that came meanwhile.

A reply is a refusal if it is a single printable character other than "0", or missing: every controller of the family
says so with one character, and answers a query with several, or with a bare line end or control character.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from isel_twin.snapshot import snapshot

if TYPE_CHECKING:
    from isel_twin.twin import Twin

__all__ = ["JobError", "Line", "Result", "decode_job", "parse_job", "play"]

LONGEST_PAUSE_S = 1e9
"""Longest pause in virtual seconds, as for the times of a scenario."""

_LINE_END = re.compile(r"\r\n|\r|\n")  # and nothing else: str.splitlines also splits at controls such as 85h
_BLANKS = " \t"
_COMMENT = re.compile(r"(^|[ \t])#(?![A-Za-z0-9]).*", re.DOTALL)
_ITEM = re.compile(r"[ \t]*<([^<>]*)>[ \t]*")
_BYTE = re.compile(r"0*([0-9]{1,3})")
_PAUSE = re.compile(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)[ \t]*s")


class JobError(ValueError):
    """A job file is wrong; the message is one line that names the line and the remedy."""


@dataclass(frozen=True)
class Line:
    """One line of a job: `actions` are bytes to send and pauses in ns."""

    number: int
    command: str
    actions: tuple[bytes | int, ...]

    @property
    def sent(self) -> bytes:
        """All bytes that are sent."""
        return b"".join(action for action in self.actions if isinstance(action, bytes))


@dataclass(frozen=True)
class Result:
    """What became of a line: sent at time_ns, over at end_ns; counters [axes] and true positions [3] mm at its end."""

    number: int
    command: str
    reply: str
    ok: bool
    time_ns: int
    end_ns: int
    counts: tuple[int, ...]
    position_mm: tuple[float, ...]


def decode_job(data: bytes) -> str:
    """Text of a job file: UTF-8 (with or without byte order mark), or Latin-1 if it is not valid UTF-8."""
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError:
        return data.decode("latin-1")


def parse_job(text: str) -> list[Line]:
    """Lines of a job, without empty lines and comments. Raises JobError."""
    lines = []
    for number, raw in enumerate(_LINE_END.split(text), 1):
        command = _COMMENT.sub("", raw).strip(_BLANKS)
        if command:
            lines.append(Line(number, command, tuple(_actions(command, number))))
    return lines


def _actions(command: str, number: int) -> Iterator[bytes | int]:
    """Bytes and pauses in their order; neighbouring bytes are sent together."""
    together = b""
    *pieces, rest = _ITEM.split(command)  # text, item, text, item, ..., text
    for text, item in zip(pieces[::2], pieces[1::2], strict=True):
        together += _encoded(text, number)
        if (byte := _BYTE.fullmatch(item)) and int(byte[1]) < 256:
            together += bytes([int(byte[1])])
        elif pause := _PAUSE.fullmatch(item):
            if together:
                yield together
            together = b""
            seconds = float(pause[1])
            if seconds > LONGEST_PAUSE_S:
                raise JobError(f"line {number}: a pause of more than {LONGEST_PAUSE_S:.0f} s; make it shorter")
            yield round(seconds * 1e9)
        else:
            raise JobError(f"line {number}: <{item}> is neither a byte (<0> to <255>) nor a pause (<0.5s>)")
    if rest:
        together += _encoded(rest, number) + b"\r"
    if together:
        yield together


def _encoded(text: str, number: int) -> bytes:
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise JobError(f"line {number}: {text[error.start]!r} is not a character a serial line can carry") from None


def play(twin: Twin, lines: Sequence[Line], timeout_s: float) -> Iterator[Result]:
    """Send the lines one after the other, each when the one before is over.

    timeout_s: virtual seconds after which a line without complete reply counts as refused; the job goes on.
    """
    for line in lines:
        time_ns = twin.time_ns
        reply = _converse(twin, line, timeout_s)
        seen = snapshot(twin)
        yield Result(
            number=line.number,
            command=line.command,
            reply=reply,
            ok=twin.idle and _accepted(line, reply),
            time_ns=time_ns,
            end_ns=seen.time_ns,
            counts=tuple(seen.counts.tolist()),
            position_mm=tuple(seen.position_mm.tolist()),
        )


def _converse(twin: Twin, line: Line, timeout_s: float) -> str:
    for action in line.actions:
        if isinstance(action, bytes):
            twin.write(action)
        else:
            twin.run_until(twin.time_ns + action)
    twin.run_until_idle(timeout_s)
    return twin.read().decode("latin-1")


def _accepted(line: Line, reply: str) -> bool:
    if not reply:
        return not any(byte >= 32 and byte < 127 for byte in line.sent)
    text = reply.strip("\r\n")
    return len(text) != 1 or text == "0" or not text.isprintable()
