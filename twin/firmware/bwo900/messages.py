"""Messages of the control: number, effect, and what they say (manual, chapter 9).

    A     shown, no more           KS    the channel stops, Start goes on
    KA    the channel breaks off   SA    the system breaks off: drives off

A message of a program names program, block and column: where in the text of the block it is to be looked for.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum
from typing import Final


class Effect(Enum):
    """What a message does."""

    SHOWN = "A"
    STOP = "KS"
    CHANNEL_ABORT = "KA"
    SYSTEM_ABORT = "SA"


@dataclass(frozen=True, slots=True)
class Message:
    """A message as it is given. program, block, column: where; 0: nowhere, not known. detail: what exactly; infos: the
    numbers that P8505 on are given with it."""

    number: int
    effect: Effect
    text: str
    program: str = ""
    block: int = 0
    column: int = 0
    detail: str = ""
    infos: tuple[float, ...] = ()

    def __str__(self) -> str:
        place = " ".join(
            part
            for part in (
                self.program,
                f"N{self.block}" if self.block else "",
                f"column {self.column}" if self.column else "",
            )
            if part
        )
        detail = f" ({self.detail})" if self.detail else ""
        return f"M{self.number}{f' {place}' if place else ''}: {self.text}{detail}"


class ProgramError(Exception):
    """A program cannot go on: a message, and the column where known (from 1); infos: for P8505 on."""

    def __init__(self, number: int, detail: str = "", column: int = 0, infos: tuple[float, ...] = ()) -> None:
        super().__init__(f"M{number}: {detail}")
        self.number, self.detail, self.column, self.infos = number, detail, column, infos
        self.place: tuple[str, int] | None = None
        """Program and block, where it is not the one that is analysed."""

    def at(self, program: str, block: int, column: int) -> ProgramError:
        """The same, about this block."""
        self.place, self.column = (program, block), column
        return self

    def __reduce__(self) -> tuple[object, ...]:
        return (ProgramError, (self.number, self.detail, self.column, self.infos), {"place": self.place})


def message(
    number: int,
    *,
    program: str = "",
    block: int = 0,
    column: int = 0,
    detail: str = "",
    infos: tuple[float, ...] = (),
    effect: Effect | None = None,
) -> Message:
    """The message of that number; one that is not in the table breaks the channel off, as those of cycles do."""
    known = MESSAGES.get(number) or Message(number, Effect.CHANNEL_ABORT, "message of a cycle or of the PLC")
    said = replace(known, program=program, block=block, column=column, detail=detail, infos=infos)
    return said if effect is None else replace(said, effect=effect)


_A, _KS, _KA, _SA = Effect.SHOWN, Effect.STOP, Effect.CHANNEL_ABORT, Effect.SYSTEM_ABORT

_TEXTS: Final[Mapping[int, tuple[Effect, str]]] = {
    1008: (_KA, "the reference points have not been approached"),
    1009: (_A, "AUTO and POS are changed by way of HAND only"),
    1050: (_KA, "tool group not found in the tool table"),
    1053: (_KA, "the life of the tool group is over"),
    1105: (_A, "a program cannot be opened"),
    1106: (_A, "a program is overwritten"),
    1107: (_A, "there is such a program, it is not overwritten"),
    1110: (_A, "wrong identifier of a file"),
    1111: (_A, "a line that has been read makes no sense"),
    1112: (_A, "there is no such channel"),
    1113: (_A, "a line of more than 400 characters"),
    1152: (_KA, "radius of a circle too small"),
    1153: (_KA, "tool radius correction: approach or departure impossible"),
    1156: (_KA, "tool radius correction: the circles do not meet"),
    1157: (_KA, "too many blocks without a path"),
    1158: (_KA, "G12 impossible"),
    1202: (_KA, "number too large"),
    1203: (_KA, "division by zero"),
    1208: (_KA, "more than 32 parameters in a block"),
    1209: (_KA, "more than 10 brackets inside each other"),
    1210: (_KA, "a bracket is missing"),
    1211: (_KA, "syntax"),
    1212: (_KA, "root of a negative number"),
    1213: (_KA, "function without a value"),
    1214: (_KA, "no operation of a parameter"),
    1216: (_KA, "unknown axis"),
    1217: (_KA, "M25 without M24"),
    1218: (_KA, "M24"),
    1219: (_KA, "call of a subprogram"),
    1220: (_KA, "too many subprograms inside each other"),
    1222: (_KA, "too many functions in a block"),
    1223: (_KA, "contour"),
    1225: (_KA, "no tool group is defined"),
    1226: (_KA, "contour: the next block with a path is missing"),
    1227: (_KA, "number of an M function too large"),
    1228: (_KA, "M function and its definition do not agree"),
    1229: (_KA, "M01 is not allowed here"),
    1230: (_KA, "no feed is programmed"),
    1231: (_KA, "circle without a path"),
    1232: (_KA, "G or M functions that exclude each other"),
    1233: (_KA, "circle without R and without I, J, K"),
    1234: (_KS, "radius smaller than half the chord; it is corrected"),
    1237: (_KA, "circle dynamics: the allowed deviation is larger than the radius"),
    1238: (_KA, "centre does not fit start and end"),
    1240: (_KA, "no valid workspace is defined (P8555)"),
    1249: (_KA, "wrong start state (P8830, P8853)"),
    1252: (_KA, "program not found"),
    1255: (_KA, "block not found"),
    1268: (_KA, "fed program: no room for what comes; the line's handshake is P11176"),
    1269: (_KA, "not possible in a program that is fed"),
    1290: (_A, "block numbers do not rise"),
    1300: (_KA, "parameter deleted or never set"),
    1302: (_KA, "number of a parameter too large"),
    1305: (_KA, "there is no such channel"),
    1307: (_KA, "unknown symbol"),
    1321: (_KA, "the control is not in HAND"),
    1322: (_KA, "the control is not in AUTO"),
    2001: (_SA, "following error too large"),
    2022: (_A, "an axis does not get into position"),
    2101: (_KA, "hardware limit +"),
    2102: (_KA, "hardware limit -"),
    2103: (_KA, "software limit +"),
    2104: (_KA, "software limit -"),
    2110: (_A, "approach the reference point"),
    3001: (_SA, "emergency stop"),
    3002: (_SA, "drives off"),
    8001: (_KA, "the pocket cannot be milled with this tool"),
    8004: (_KA, "corner radius too large"),
    8006: (_KA, "sequence of a cycle"),
    8007: (_KA, "radius of the pocket smaller than the tool's"),
    8008: (_KA, "radius drilled and infeed are more than that of the pocket"),
    8009: (_KA, "infeed larger than the depth less its allowance"),
    8010: (_KA, "not valid: inner radius (P11)"),
    8011: (_KA, "not valid: first size of the pocket (P11)"),
    8012: (_KA, "not valid: second size of the pocket (P12)"),
    8013: (_KA, "not valid: depth of the pocket (P13)"),
    8014: (_KA, "not valid: radius (P14)"),
    8015: (_KA, "not valid: allowance (P15)"),
    8016: (_KA, "not valid: infeed across (P16)"),
    8017: (_KA, "not valid: infeed in depth (P17)"),
    8018: (_KA, "not valid: allowance on the depth (P18)"),
    8019: (_KA, "not valid: safety distance (P19)"),
    8020: (_KA, "not valid: infeed of finishing (P20)"),
    8021: (_KA, "not valid: plunging feed (P21)"),
    8032: (_KA, "not valid: feed (P32)"),
    8033: (_KA, "not valid: depth (P33)"),
    8034: (_KA, "not valid: approach plane (P34)"),
    8036: (_KA, "not valid: number of strokes (P36)"),
    8037: (_KA, "not valid: first stroke (P37)"),
    8038: (_KA, "not valid: safety distance (P38)"),
    8100: (_KA, "not valid: X of A to B (P100)"),
    8101: (_KA, "not valid: Y of A to B (P101)"),
    8103: (_KA, "not valid: angle of ray 1 (P103)"),
    8104: (_KA, "not valid: length of ray 1 (P104)"),
    8105: (_KA, "not valid: division of ray 1 (P105)"),
    8107: (_KA, "division or number of places is missing on ray 1 (P105, P106)"),
    8110: (_KA, "not valid: X of A to C (P110)"),
    8111: (_KA, "not valid: Y of A to C (P111)"),
    8113: (_KA, "not valid: angle of ray 2 (P113)"),
    8114: (_KA, "not valid: length of ray 2 (P114)"),
    8115: (_KA, "not valid: division of ray 2 (P115)"),
    8117: (_KA, "division or number of places is missing on ray 2 (P115, P116)"),
    8120: (_KA, "not valid: X of the circle's centre (P120)"),
    8121: (_KA, "not valid: Y of the circle's centre (P121)"),
    8122: (_KA, "not valid: diameter of the circle (P122)"),
    8123: (_KA, "not valid: start angle (P123)"),
    8124: (_KA, "not valid: travel angle (P124)"),
    8125: (_KA, "not valid: division angle (P125)"),
    8126: (_KA, "not valid: number of places (P126)"),
    8300: (_KA, "no spindle speed is programmed"),
    8301: (_KA, "no spindle direction is given"),
    8302: (_KA, "spindle speed is 0"),
    8311: (_KA, "said twice: length of ray 1 and its end (P104)"),
    8315: (_KA, "said twice: division of ray 1 and number of places (P105, P106)"),
    8321: (_KA, "said twice: length of ray 2 and its end (P114)"),
    8325: (_KA, "said twice: division of ray 2 and number of places (P115, P116)"),
    8333: (_KA, "said twice: division angle and number of places (P125, P126)"),
    8334: (_KA, "division angle is 0 (P125)"),
}

MESSAGES: Final[Mapping[int, Message]] = {
    number: Message(number, effect, text) for number, (effect, text) in _TEXTS.items()
}
"""Those that the twin gives, by number; 8000 to 8999 are those of cycles."""
