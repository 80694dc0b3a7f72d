"""The state from earlier lines that determines how the iMC's lines are read and answered."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial

from isel_twin.firmware.imc import commands, grammar, replies
from isel_twin.firmware.imc.query import AXIS_NAMES, END, positions
from isel_twin.language import readable

OK = replies.OK.encode()
LF = bytes([grammar.LF])
END_OF_FIELD = "9"  # ends the data field (3.2.9)


@dataclass(frozen=True)
class AnswerForm:
    """Length of an answer: the code and a number of hexadecimal digits or lines; or lines and, `code_last`, the
    code."""

    digits: int = 0
    lines: int = 0
    code_last: bool = False
    # explains an answer (without its code) to a query with these parameters; None: the answer is only a code
    words: Callable[[str, str], str] | None = None

    def whole(self, answer: bytes | bytearray) -> bool:
        if self.code_last:
            last = answer.rpartition(LF)[2]
            return len(last) == 1 and chr(last[0]) in replies.WORDS
        if not answer.startswith(OK):
            return True
        return len(answer) > self.digits and answer.count(LF) >= self.lines

    def fits(self, byte: int) -> bool:
        """True if the byte can continue the answer."""
        return not self.digits or chr(byte) in "0123456789ABCDEF"


@dataclass
class ReadingState:
    """State for reading lines: axes set (a mask, 0: unknown), device number, data field begun. set_axes_only: of the
    profile."""

    set_axes_only: bool = False
    axes: int = 0
    number: int = 0
    storing: bool = False

    def split(self, line: bytes) -> tuple[str, str] | None:
        """Code and parameters of a DNC line, ("", "") for another line; None: for another device."""
        try:
            parts = grammar.split_dnc(line, self.number, commands.DNC_ALIASES)
        except replies.Refusal:
            return "", ""
        return None if parts is None else parts[1:]

    def form(self, line: bytes) -> AnswerForm | None:
        """The form of the line's answer; None: no answer."""
        if self.storing:
            return AnswerForm()
        parts = self.split(line)
        if parts is None:
            return None
        if parts[0] == "P":
            told = positions(self.axes, set_axes_only=self.set_axes_only)
            return AnswerForm(digits=6 * len(told), words=partial(_position_words, told))
        return QUERIES.get(parts[0], AnswerForm())

    def follow(self, line: bytes, *, accepted: bool) -> None:
        """Update the state by a line that was or will be answered."""
        if self.storing:
            self.storing = accepted and stored(line)[0] != END_OF_FIELD
            return
        code, text = self.split(line) or ("", "")
        if not accepted or code not in (commands.AXES_CODE, "G", "i"):
            return
        match code, numbers(text):
            case commands.AXES_CODE, [1 | 3 | 7 as mask]:
                self.axes = mask
            case commands.AXES_CODE, [8]:
                self.axes |= 8
            case "G", [number]:
                self.number = number
            case "i", []:
                self.storing = True


def stored(line: bytes) -> tuple[str, str]:
    return grammar.split_cnc(line, commands.CNC_ALIASES)


def numbers(text: str) -> list[int] | None:
    """The numbers of a command; None if a field is no number."""
    try:
        return [grammar.read_number(field) for field in text.split(",")] if text.strip(" ") else []
    except replies.Refusal:
        return None


def plain(text: str) -> str:
    return readable(text.strip(" ").encode("latin-1"))


def _position_words(told: Sequence[int], answer: str, text: str) -> str:
    """24 bits an axis, two's complement (2.2.21)."""
    counts = [(int(answer[at : at + 6], 16) ^ 1 << 23) - (1 << 23) for at in range(0, len(answer), 6)]
    return "position " + " ".join(f"{AXIS_NAMES[axis]} {count}" for axis, count in zip(told, counts, strict=False))


def _byte_words(about: str) -> Callable[[str, str], str]:
    return lambda answer, text: f"{about} {plain(text)}: {int(answer, 16)} (bits {int(answer, 16):08b})"


def _lines_words(about: str) -> Callable[[str, str], str]:
    """The lines of the answer, without the code after them."""
    return lambda answer, text: f"{about}: {', '.join(plain(line) for line in answer.split(END)[:-1])}"


# queries that answer with more than a code, by their code; `@0P` is in `ReadingState.form`
QUERIES: Mapping[str, AnswerForm] = {
    "b": AnswerForm(digits=2, words=_byte_words("port")),
    "D": AnswerForm(digits=2, words=_byte_words("diagnosis")),
    "h": AnswerForm(code_last=True, words=_lines_words("limit switches, 1 struck")),
    "H": AnswerForm(code_last=True, words=_lines_words("state")),
    "U": AnswerForm(lines=1, words=_lines_words("answer")),
    "V": AnswerForm(lines=2, words=_lines_words("version")),
}
