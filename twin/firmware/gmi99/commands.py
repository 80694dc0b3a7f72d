"""Every command of the manual in one table: letter, section, kind, handler.

    <address> <command> [<P1> [<P2> [<P3>]]]        P: 24 bits, low byte first; what is left out is 0

    normal        carried out in the order of arrival, when nothing moves                    E5h
    synchronous   in the same order, without separating the moves around it: (F)             E5h
    move          in the same order; joins with the moves around it                          E5h, or buffer full
    immediate     at once, also while others wait                                            E5h, or an answer

A command of unknown letter or wrong length in a long record has no effect and no answer (gmi99/4).
"""

from __future__ import annotations

from collections.abc import Callable, Generator, Mapping
from dataclasses import dataclass
from enum import Enum

from isel_twin.firmware.gmi99 import actions, corrections, directly, programming
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import MOVE_BIT, Instruction
from isel_twin.firmware.gmi99.waiting import Wait

Handler = Callable[[Card, Instruction], Generator[Wait, None, None] | None]

PLC_DATA_BYTES = 128


class Kind(Enum):
    NORMAL = "normal"
    SYNCHRONOUS = "synchronous"
    MOVE = "move"
    IMMEDIATE = "immediate"


def parse(code: int, content: bytes) -> Instruction | None:
    """A command from its code and the bytes after it; None for an unknown command or a wrong length."""
    if code & MOVE_BIT:
        count = (code & 0x3F).bit_count()
        return Instruction(code, _numbers(content, signed_=True)) if len(content) == 3 * count else None
    if chr(code) not in COMMANDS:
        return None
    if code == ord("a"):
        raw = content[3:]
        fits = len(content) >= 3 and 1 <= len(raw) <= PLC_DATA_BYTES
        return Instruction(code, _numbers(content[:3].ljust(9, b"\0")), raw) if fits else None
    if len(content) % 3 or len(content) > 9:
        return None
    return Instruction(code, _numbers(content.ljust(9, b"\0"), signed_=code == ord("V")))


def _numbers(content: bytes, *, signed_: bool = False) -> tuple[int, ...]:
    return tuple(int.from_bytes(content[at : at + 3], "little", signed=signed_) for at in range(0, len(content), 3))


@dataclass(frozen=True)
class Command:
    section: str
    words: str
    run: Handler
    kind: Callable[[Instruction], Kind]


def _always(kind: Kind) -> Callable[[Instruction], Kind]:
    return lambda instruction: kind


def _g_kind(instruction: Instruction) -> Kind:
    low = instruction.p1 & 0xFF
    if low in (2, 3, 90, 91) or (53 <= low <= 57 and instruction.p3 == 0):
        return Kind.SYNCHRONOUS
    return Kind.NORMAL


def _o_kind(instruction: Instruction) -> Kind:
    return Kind.IMMEDIATE if instruction.p1 == 2 else Kind.NORMAL


def _p_kind(instruction: Instruction) -> Kind:
    if instruction.p1 == programming.Of.FLAG:
        return Kind.IMMEDIATE
    flying = instruction.p1 == programming.Of.DIRECT and instruction.p2 in (directly.SETO, directly.RESO)
    return Kind.SYNCHRONOUS if flying else Kind.NORMAL


DUPLICATE = "X"  # placeholder: the letter of axis duplication is missing in print (3.1.1), decision gmi99/10

_NORMAL, _SYNCHRONOUS, _IMMEDIATE = _always(Kind.NORMAL), _always(Kind.SYNCHRONOUS), _always(Kind.IMMEDIATE)

# by letter. The general motion command is `MOVE`; short records are in controller.py.
COMMANDS: Mapping[str, Command] = {
    "a": Command("3.1.1", "data of a PLC program", programming.plc_data, _NORMAL),
    "B": Command("3.1.1", "acceleration", actions.acceleration, _NORMAL),
    "c": Command("3.1.2", "register", actions.register, _IMMEDIATE),
    "d": Command("3.1.1", "data word of the PLC", actions.data_word, _NORMAL),
    "f": Command("3.1.1", "speed", actions.feed, _SYNCHRONOUS),
    "G": Command("3.1.1", "G function", corrections.g_function, _g_kind),
    "H": Command("3.1.1", "auxiliary function", actions.auxiliary, _NORMAL),
    "M": Command("3.1.1", "top speed", actions.top_speed, _NORMAL),
    "m": Command("3.1.1", "M function", actions.m_function, _NORMAL),
    "N": Command("3.1.2", "parameter", actions.parameter, _IMMEDIATE),
    "O": Command("3.1.1", "set the position counter", actions.set_position, _NORMAL),
    "o": Command("3.1.1", "override", actions.override, _o_kind),
    "p": Command("3.1.1", "programming", programming.programming, _p_kind),
    "Q": Command("3.1.1", "reference", actions.reference, _NORMAL),
    "q": Command("3.1.2", "report again", actions.report_again, _IMMEDIATE),
    "R": Command("3.1.1", "reduced speed", actions.reduced_speed, _NORMAL),
    "r": Command("3.1.1", "reset of the firmware", actions.reset, _NORMAL),
    "s": Command("3.1.1", "save", actions.save, _NORMAL),
    "T": Command("3.1.2", "ask", actions.no_action, _IMMEDIATE),
    "V": Command("3.1.1", "move the first three axes", actions.move, _always(Kind.MOVE)),
    "W": Command("3.1.1", "tool speed control", actions.tool_speed, _NORMAL),
    DUPLICATE: Command("3.1.1", "axis duplication", actions.duplicate, _NORMAL),
}

MOVE = Command("3.1.1", "move", actions.move, _always(Kind.MOVE))


def command_of(instruction: Instruction) -> Command:
    return MOVE if instruction.code & MOVE_BIT else COMMANDS[chr(instruction.code)]
