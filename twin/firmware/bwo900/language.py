"""The control's language: what its bytes mean to people and tools. Implements `isel_twin.language.Language`.

What a host sends are lines of files (transfer.py); the control answers nothing. A program file is a job by itself: it
is transferred, the axes are referenced, the program is started:

    P1 ... #  EOT        D  P8683: 1, P12130: 1 ...  #  EOT        D  P8800: 1, P8683: 2, P8684: 1  #  EOT
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from typing import Final

from isel_twin.firmware.bwo900.groups import BEYOND
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.programs import END, program_name
from isel_twin.firmware.bwo900.syntax import Block, parse_block
from isel_twin.language import (
    SETTINGS_RANGES,
    LanguageError,
    Message,
    MoveSettings,
    Pieces,
    encoded,
    integers,
    readable,
)

__all__ = ["Bwo900Language", "create"]

END_OF_LINE: Final = b"\r\n"
END_OF_FILE: Final = b"\x04"
AXES: Final = ("X", "Y", "Z")
PER_MM: Final = 1000.0
RAPID_HZ: Final = 100_000.0
"""Of an axis at the speed that P12004 is delivered with, 6000 mm/min."""
MOVE: Final = 9_999
"""The program that `move` starts."""
WORDS: Final = (4_990, 4_991, 4_992, 4_993)
"""Parameters that are its feed in mm/min, X, Y and Z in mm."""
NUMBER: Final = 1
"""Of a program whose file does not say its number."""

G_WORDS: Final[Mapping[int, str]] = {
    0: "rapid", 1: "line", 2: "circle clockwise", 3: "circle counter-clockwise", 4: "dwell", 8: "exact stop",
    9: "no exact stop", 10: "polar coordinates", 11: "no polar coordinates", 12: "chamfer or rounding", 17: "plane XY",
    18: "plane ZX", 19: "plane YZ", 28: "exact stops on", 29: "exact stops off", 40: "radius correction off",
    41: "radius correction left", 42: "radius correction right", 43: "axis correction off", 44: "axis correction",
    45: "rotation", 46: "rotation off", 47: "machine coordinates", 48: "tool coordinates", 49: "workpiece coordinates",
    53: "machine zero", 60: "mirror off", 61: "mirror first axis", 62: "mirror second axis", 63: "override 100 %",
    64: "override free", 66: "without corrections", 71: "rectangular pocket", 72: "rectangular pocket, zigzag",
    73: "rectangular pocket, finished", 74: "circular pocket", 75: "circular pocket, finished", 81: "drill",
    83: "deep hole", 84: "tap", 85: "bore", 86: "ray of places", 87: "parallelogram of places", 88: "grid of places",
    89: "circle of places", 90: "absolute", 91: "incremental", 92: "shift of zero", 94: "feed in mm/min",
    97: "speed in 1/min", 123: "line or circle by three points", 147: "no transformation", 153: "no zero point",
}  # fmt: skip
M_WORDS: Final[Mapping[int, str]] = {
    0: "measuring stop", 1: "synchronise", 2: "return", 3: "spindle right", 4: "spindle left", 5: "spindle off",
    6: "tool change", 7: "coolant 1 on", 8: "coolant 2 on", 9: "coolant off", 16: "tool data", 23: "jump",
    24: "loop", 25: "end of the loop", 28: "call", 29: "end, again", 30: "end",
}  # fmt: skip
KEYS: Final[Mapping[int, str]] = {
    8_683: "mode", 8_684: "start (1) or stop (0)", 8_705: "abort", 8_800: "program", 8_801: "start block",
    8_810: "skip blocks with /", 11_310: "feed override, %", 8_508: "acknowledge messages",
}  # fmt: skip
SURE: Final = 100
"""Lines by which a program is known."""
SHOWN: Final = 40
"""Characters of a line that is told."""
_BLOCK = re.compile(r"\s*(?:/?\s*N\s*\d+\s*(?:[A-Za-z_!({/]|$)|;)")
_JOB = re.compile(r"\s*(?:D\+?\s*$|[<#!])")
"""How a job begins: parameters, bytes, a remark."""
_PARAMETER = re.compile(r"\s*(?:K\d+\s*:?\s*)?([Pq])\s*(\d+)\s*:\s*(\S+)")


def create(name: str) -> Bwo900Language:
    """Entry point of `isel_twin.languages`."""
    return Bwo900Language()


class Bwo900Language:
    """Implements `isel_twin.language.Language` and `RunsPrograms`."""

    ranges = SETTINGS_RANGES  # of no use: it has no moves

    def __init__(self) -> None:
        self._sent = Pieces(ends=b"\n\x04")
        self._received = Pieces(ends=b"\n\x04")

    def frame(self, text: str) -> bytes:
        """A line of a file."""
        return encoded(text) + END_OF_LINE

    def text(self, reply: bytes) -> str:
        """See Language.text."""
        return readable(reply)

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """It refuses nothing on the line: what is wrong is a message, and `Controller.fault`."""
        return True

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        """See Language.messages."""
        for piece in (self._sent if sent else self._received).cut(data):
            text = piece.rstrip(b"\r\n\x04").decode("latin-1")
            words = "end of the file" if piece.endswith(END_OF_FILE) else explain(text)
            yield Message(piece, text, words, sent=sent)

    def rest(self, sent: bool) -> bytes:
        """See Language.rest."""
        return (self._sent if sent else self._received).rest

    def reference(self) -> Sequence[bytes]:
        """The program that `move` starts, whose words are parameters: a control that gets a program anew each time
        remarks each time that it replaces one. Then the reference runs of all axes."""
        words = " ".join(f"{word}:P{number}" for word, number in zip(("F", *AXES), WORDS, strict=True))
        return [_file([f"P{MOVE}", f"N10 G90 G1 {words}", "N20 M30"]), _REFERENCE]

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """Ramps, words of the program, and its start, by way of HAND; servo drives know no start-stop frequency.

        A count is 0.001 mm, and an axis reaches 100 mm/s in the time of its ramp, as P12012 and P12004 are delivered.
        """
        counts = integers(target, len(AXES))
        values = settings.speed_hz / PER_MM * 60.0, *(count / PER_MM for count in counts)
        words = [f"K1:P{number}: {value:.3f}" for number, value in zip(WORDS, values, strict=True)]
        ramp_ms = RAPID_HZ / settings.acceleration_hz_per_ms
        words += [f"K1:P{12_008 + 200 * axis}: {ramp_ms:.3f}" for axis in range(len(AXES))]
        return [_file(["D", "K1:P8683: 1", *words]), _file(["D", *_started(MOVE)])]

    def break_off(self) -> bytes:
        """Abort."""
        return _file(["D", "K1:P8705: 1"])

    def claims(self, text: str) -> bool:
        """See RunsPrograms: names of programs and numbered blocks, and nothing else."""
        lines = _significant(text)
        known = all(program_name(line) or line.strip() == END or _BLOCK.match(line) for line in lines[:SURE])
        return known and any(_BLOCK.match(line) for line in lines[:SURE])

    def job(self, text: str) -> Sequence[tuple[str, bytes]] | None:
        """See RunsPrograms: a text that does not begin as a job does."""
        lines = _significant(text)
        if not lines or _JOB.match(lines[0]):
            return None
        if not (program_name(lines[0]) or _BLOCK.match(lines[0])):
            try:
                parse_block(lines[0])
            except ProgramError:
                begins = f"{lines[0].strip()[:SHOWN]!r} begins neither a program (P1), a block (N10 ...)"
                raise LanguageError(f"{begins}, nor a file of parameters (D)") from None
        files = list(_programs(lines))
        first = next((name for name, _ in files if name[0] == "P"), None)
        if first is None:
            others = ", ".join(name for name, _ in files) or "nothing"
            raise LanguageError(f"there is no program in it to be started, a line P and its number, but {others}")
        steps = [(f"{name}, {_counted(blocks)}", _file([name, *blocks])) for name, blocks in files]
        start = _file(["D", *_started(int(first[1:]))])
        return [*steps, ("reference", _REFERENCE), (f"start {first}", start)]

    def lines(self, text: str) -> Mapping[str, int]:
        """See RunsPrograms."""
        found: dict[str, int] = {}
        name = ""
        for number, line in enumerate(text.splitlines(), 1):
            word = line.strip()
            if program := program_name(word):
                name = program
            elif word == END:
                name = ""
            elif block := re.match(r"/?\s*N\s*(\d+)", word):
                found.setdefault(f"{name or f'P{NUMBER}'} N{int(block[1])}", number)
        return found

    def place(self, said: str) -> tuple[str, int]:
        """See RunsPrograms."""
        found = re.match(r"M\d+ ([PZ]\d+ N\d+)(?: column (\d+))?", said)
        return ("", 0) if found is None else (found[1], int(found[2] or 1))


def _significant(text: str) -> list[str]:
    """Lines without blank ones, remarks before the first program, and the beginning and end of a tape."""
    lines = [line for line in text.splitlines() if line.strip(" \t\x04") and not line.lstrip().startswith("%")]
    first = next((at for at, line in enumerate(lines) if not line.lstrip().startswith(";")), len(lines))
    return lines[first:]


def _counted(blocks: Sequence[str]) -> str:
    """How many blocks, in words; chained lines are one."""
    number = sum(not line.lstrip().startswith(";") and not line.rstrip().endswith("\\") for line in blocks)
    return "1 block" if number == 1 else f"{number} blocks"


def _programs(lines: Sequence[str]) -> Iterator[tuple[str, list[str]]]:
    """The programs of a file, each with its blocks."""
    name, blocks = "", list[str]()
    for line in lines:
        word = line.strip()
        if found := program_name(word):
            if blocks:
                yield name or f"P{NUMBER}", blocks
            name, blocks = found, []
        elif word == END:
            yield name or f"P{NUMBER}", blocks
            name, blocks = "", []
        else:
            blocks.append(line.rstrip())
    if blocks:
        yield name or f"P{NUMBER}", blocks


def _file(lines: Sequence[str]) -> bytes:
    """A file as it goes over the line."""
    text = "".join(f"{line}\r\n" for line in ("", *lines, END))
    return encoded(text) + END_OF_FILE + END_OF_LINE


def _started(program: int) -> list[str]:
    """Parameters that start a program."""
    return [f"K1:P8800: {program}", "K1:P8683: 2", "K1:P8684: 1"]


_REFERENCE: Final = _file(["D", "K1:P8683: 1", *(f"K1:P{12_130 + 200 * axis}: 1" for axis in (2, 1, 0))])


def explain(text: str) -> str:
    """A line of a file in a few words."""
    word = text.strip()
    if not word:
        return "blank line"
    if word == END:
        return "end of a program or of parameters"
    if word in ("D", "D+"):
        return "parameters"
    if name := program_name(word):
        return f"{'program' if name[0] == 'P' else 'cycle'} {name[1:]}"
    if (match := _PARAMETER.match(word)) is not None and not re.match(r"\s*/?\s*N", word):
        number = int(match[2])
        known = KEYS.get(number, "") if match[1] == "P" else ""
        if 12_130 <= number < 18_400 and (number - 12_130) % 200 == 0:
            known = f"reference run of axis {(number - 12_130) // 200 + 1}"
        return f"{known or 'parameter'}: {match[3]}"
    try:
        return _explained(parse_block(word))
    except ProgramError as error:
        return f"no block: M{error.number} {error.detail}".rstrip()


def _explained(block: Block) -> str:
    parts = [] if block.number is None else [f"block {block.number}"]
    if block.skip:
        parts.append("may be skipped")
    parts += [G_WORDS.get(g.number, BEYOND.get(g.number, f"G{g.number}")) for g in block.g]
    axes = [word.name for word in block.words if word.name[0] not in "FSTIJKRft"]
    if axes:
        parts.append(f"to {' '.join(axes)}")
    parts += [
        {"F": "feed", "S": "speed", "T": "tool", "R": "radius"}.get(word.name[0], "")
        for word in block.words
        if word.name[0] in "FSTR"
    ]
    parts += [M_WORDS.get(m.number, f"M{m.number}") for m in block.m]
    parts += ["sets parameters"] * bool(block.assignments) + ["jumps by comparison"] * bool(block.jumps)
    if block.wait is not None:
        parts.append("waits for a condition")
    if block.message is not None:
        parts.append("clears its text" if block.message.text is None else "shows a text")
    return ", ".join(part for part in parts if part) or "nothing"
