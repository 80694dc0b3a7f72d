"""The lines of another control in words. Implements `isel_twin.language.Language` and `TakesSetPoints`.

There is no reference run and there are no ramps: both are the other control's. So `reference` switches on and calls the
place where the machine stands 0, and `move` goes at one speed (external/6).
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from isel_twin.firmware.external.protocol import (
    END,
    FASTEST_HZ,
    LINE_BYTES,
    LONGEST_NS,
    SHORTEST_NS,
    LineError,
    parse,
)
from isel_twin.language import (
    SETTINGS_RANGES,
    Message,
    MoveSettings,
    Pieces,
    Ranges,
    check_ranges,
    encoded,
    integers,
    readable,
)

AXES = 3  # counters in `reference` and `move`: the machine's carriages
RANGES: Ranges = {"speed_hz": (SETTINGS_RANGES["speed_hz"][0], min(SETTINGS_RANGES["speed_hz"][1], FASTEST_HZ))}
WORDS = tuple([word] for word in (b"row", b"go", b"out", b"set", b"form", b"tell", b"state", b"names"))
ON = "out power_request=1 stages=1 brake=1"


def create(name: str) -> ExternalLanguage:
    """Entry point of `isel_twin.languages`."""
    return ExternalLanguage()


class ExternalLanguage:
    """Implements `isel_twin.language.Language` and `TakesSetPoints`."""

    idle = b"\r\n"
    unwatched: Mapping[str, Any] = {"controller.watchdog_ms": 0}
    shortest_ns, longest_ns = SHORTEST_NS, LONGEST_NS

    def __init__(self) -> None:
        self.ranges = RANGES
        self._pieces = {sent: Pieces(ends=END, longest=2 * LINE_BYTES) for sent in (True, False)}

    def frame(self, text: str) -> bytes:
        return encoded(text) + END

    def begins(self, data: bytes) -> bool | None:
        """With a line of a known word, whatever its numbers are."""
        line, end, _ = data.partition(END)
        if not re.fullmatch(rb"[A-Za-z0-9_ =.\r\t+-]*", line):
            return False
        return line.split()[:1] in WORDS if end else None

    def text(self, reply: bytes) -> str:
        return reply.removesuffix(END).decode("latin-1")

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """Each line is answered, and no answer is an error."""
        answers = reply.split(END)[:-1]
        return len(answers) == sent.count(END) and not any(answer.startswith(b"error") for answer in answers)

    def reference(self) -> Sequence[bytes]:
        return [self.frame(ON), self.frame("set" + " 0" * AXES)]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        check_ranges(settings, self.ranges)
        return [self.frame(f"go {settings.speed_hz} {' '.join(map(str, integers(target, AXES)))}")]

    def break_off(self) -> bytes:
        """A row cannot be broken off, only the stages can go off behind it; hosts send short ones."""
        return self.frame("out stages=0")

    def begin_rows(self) -> Sequence[bytes]:
        return [self.frame("form led"), self.frame(ON)]

    def row(self, duration_ns: int, counters: Sequence[int]) -> bytes:
        return self.frame(f"row {duration_ns} {' '.join(map(str, counters))}")

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        return iter([_message(piece, sent) for piece in self._pieces[sent].cut(data)])

    def rest(self, sent: bool) -> bytes:
        return self._pieces[sent].rest


def _message(piece: bytes, sent: bool) -> Message:
    line = piece.removesuffix(END).removesuffix(b"\r")
    return Message(piece, readable(line) or readable(piece), _sent_words(line) if sent else _answer_words(line), sent)


def _sent_words(data: bytes) -> str:
    try:
        line = parse(data, None)
    except LineError as error:
        return f"refused: {error}"
    outputs = ", ".join(f"{name} {value}" for name, value in line.outputs.items())
    also = f"; outputs: {outputs}" if outputs else ""
    counts = " ".join(map(str, line.counts))
    match line.word:
        case "row":
            return f"to {counts} in {line.number / 1e6:g} ms{also}"
        case "go":
            return f"to {counts} at {line.number} steps/s{also}"
        case "set":
            return f"the counters are {counts}"
        case "out":
            return f"outputs: {outputs}"
        case "form":
            return f"rows become {'steps' if line.words[0] == 'steps' else 'set points, led over the row'}"
        case "tell":
            return f"answers have {' and '.join(line.words) or 'nothing'} at their end"
        case "names":
            return "ask for the names of the terminals"
    return "ask for levels and faults"


def _answer_words(line: bytes) -> str:
    word, *rest = line.split() or [b""]
    if word == b"ok" and len(rest) >= 3:
        return (
            f"done at {int(rest[0]) / 1e9:.9g} s; levels {readable(rest[1])}, drive faults {readable(rest[2])}"
            if (rest[0].isdigit())
            else "no answer of the twin"
        )
    if word == b"error":
        return f"refused: {readable(line[6:])}"
    if word == b"names":
        return f"terminals, from bit 0: {readable(b' '.join(rest[1:]))}"
    return "no answer of the twin"
