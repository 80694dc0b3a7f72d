"""The iSMIF's command language: one line of text becomes one command, or is refused.

All twenty commands of the manual are in `COMMANDS`, with their parameters:

    #E25,400 + CR   ->   Instruction("#E", (25, 400))
    L1,x-50,Y100    ->   Instruction("L", (1, Target(axis=0, relative=True, steps=-50), Target(1, False, 100)))

A line that begins with @ is a master command and is carried out at once; others go into the job memory (section 5.2).
Case matters, as printed: only the axes of a vector may be small, and then mean a relative distance. Blanks are ignored.
Limits that the manual does not print: decision ismif/3.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

AXIS_LETTERS = "XYZ"
SPEEDS_HZ = range(65, 5001)  # step frequencies the interface can put out (technical data)
TABLE_SIZE = 100  # entries of the table of end speeds (6.9)
STEPS_LIMIT = 8_388_607  # largest distance and position, steps either way (ismif/3)
WORD_LIMIT = 65_535  # largest ramp and waiting time in ms and largest reference offset in steps (ismif/3)
LINE_LIMIT = 128  # longest line in bytes, its end included (ismif/3)


class CommandError(ValueError):
    """A line that is not a command of the manual; the message says why."""


@dataclass(frozen=True)
class Target:
    """Target of an axis (0 X .. 2 Z) in a vector: `steps` from the zero point, or from the position if relative."""

    axis: int
    relative: bool
    steps: int


@dataclass(frozen=True)
class Instruction:
    """A command with its parameters read and checked; `code` is a key of COMMANDS."""

    code: str
    arguments: tuple[Any, ...] = ()


@dataclass(frozen=True)
class Command:
    """A row of the table: a reader for each comma-separated parameter, the last for up to `repeat` of them."""

    section: str
    meaning: str
    readers: tuple[Callable[[str], Any], ...] = ()
    repeat: int = 1


def parse(line: bytes) -> Instruction:
    """Read one line without its end. Raises CommandError if it is not a command of the manual."""
    text = line.decode("latin-1").replace(" ", "")
    code = code_of(text)
    command = COMMANDS.get(code)
    if command is None:
        raise CommandError(f"unknown command {code!r}")
    rest = text[len(code) :]
    parts = rest.split(",") if rest else []
    readers = command.readers
    if not len(readers) <= len(parts) <= len(readers) + command.repeat - 1:
        raise CommandError(f"{code}: {len(parts)} parameters")
    readers += readers[-1:] * (len(parts) - len(readers))
    instruction = Instruction(code, tuple(reader(part) for reader, part in zip(readers, parts, strict=True)))
    targets = [argument.axis for argument in instruction.arguments if isinstance(argument, Target)]
    if len(set(targets)) < len(targets):
        raise CommandError(f"{code}: the same axis twice")
    return instruction


def code_of(text: str) -> str:
    """The code with which a line begins, known or not."""
    return text[: 2 if text[:1] in ("@", "#", "$") else 1]


def _number(low: int, high: int) -> Callable[[str], int]:
    def read(text: str) -> int:
        if not re.fullmatch(r"[0-9]{1,7}", text) or not low <= int(text) <= high:
            raise CommandError(f"{text!r} is not a number from {low} to {high}")
        return int(text)

    return read


def _axes(text: str, most: int = 3) -> tuple[int, ...]:
    if not re.fullmatch(r"[XYZ]{1,3}", text) or len(text) > most or len(set(text)) < len(text):
        raise CommandError(f"{text!r} is not X, Y or Z")
    return tuple(AXIS_LETTERS.index(letter) for letter in text)


def _axis(text: str) -> int:
    return _axes(text, 1)[0]


def _target(text: str) -> Target:
    match = re.fullmatch(r"([XYZxyz])([+-]?[0-9]{1,7})", text)
    if match is None or abs(int(match[2])) > STEPS_LIMIT:
        raise CommandError(f"{text!r} is not an axis with a number of steps")
    return Target(AXIS_LETTERS.index(match[1].upper()), match[1].islower(), int(match[2]))


_speed = _number(SPEEDS_HZ[0], SPEEDS_HZ[-1])
_index = _number(0, TABLE_SIZE - 1)
_word = _number(0, WORD_LIMIT)
_switch = _number(0, 1)

# every command of the manual by its code
COMMANDS: dict[str, Command] = {
    "@R": Command("6.1", "reset"),
    "@V": Command("6.2", "ask for the version"),
    "@X": Command("6.3", "ask for the status"),
    "@L": Command("6.4", "ask for the position of an axis", (_axis,)),
    "T": Command("6.5", "drive signals: 0 PBL, 1 clock and direction", (_switch,)),
    "F": Command("6.6", "0 half steps, 1 full steps", (_switch,)),
    "Z": Command("6.7", "Z axis: 1 a motor, 2 a plotter's relay", (_number(1, 2),)),
    "#S": Command("6.8", "start speed in Hz", (_speed,)),
    "#E": Command("6.9", "end speed in Hz at an index of the table", (_index, _speed)),
    "#R": Command("6.10", "ramp length in ms", (_word,)),
    "#D": Command("6.11", "reference run: direction and three speeds", (_axis, _switch, _index, _index, _index)),
    "#O": Command("6.12", "offset after the reference run in steps", (_axis, _word)),
    "$H": Command("6.13", "reference run of the axes in the order given", (_axes,)),
    "L": Command("6.14", "vector", (_index, _target), repeat=3),
    "@B": Command("6.15", "stop the axes with a ramp"),
    "@S": Command("6.16", "stop the axes at once"),
    "@A": Command("6.17", "pause"),
    "@C": Command("6.18", "end the pause"),
    "A": Command("6.19", "signal on pin 12", (_switch,)),
    "W": Command("6.20", "wait, in ms", (_word,)),
}
