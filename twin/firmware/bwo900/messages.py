"""Messages of the control: number, effect and text (manual, chapter 9).

    A     only shown               KS    the channel stops, Start goes on
    KA    the channel breaks off   SA    the system breaks off: drives off

A message of a program names program, block and column in the text of the block.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from enum import Enum, IntEnum
from typing import Final

from isel_twin.firmware.bwo900.numbers import P, Ray


class Effect(Enum):
    """The effect of a message."""

    SHOWN = "A"
    STOP = "KS"
    CHANNEL_ABORT = "KA"
    SYSTEM_ABORT = "SA"


MISSING: Final = "not in this twin"  # details of what the control has and the twin has not begin so


@dataclass(frozen=True, slots=True)
class Message:
    """A message with its place; 0: unknown. infos: numbers for P8505 on."""

    number: int
    effect: Effect
    text: str
    program: str = ""
    block: int = 0
    column: int = 0
    detail: str = ""
    infos: tuple[float, ...] = ()

    def __str__(self) -> str:
        column = f"column {self.column}" if self.column else ""
        place = " ".join(filter(None, (self.program, f"N{self.block}" if self.block else "", column)))
        text = f"{self.text} ({self.detail})" if self.detail else self.text
        if self.detail.startswith(MISSING):  # the number is the control's nearest; its text would mislead
            text = self.detail
        return f"M{self.number}{f' {place}' if place else ''}: {text}"


class ProgramError(Exception):
    """A program cannot go on; column: from 1, 0: unknown; infos: for P8505 on."""

    def __init__(self, number: int, detail: str = "", column: int = 0, infos: tuple[float, ...] = ()) -> None:
        super().__init__(f"M{number}: {detail}")
        self.number, self.detail, self.column, self.infos = int(number), detail, column, infos
        self.place: tuple[str, int] | None = None
        """Program and block, where it is not the one that is analysed."""

    def at(self, program: str, block: int, column: int) -> ProgramError:
        """The error with this place."""
        self.place, self.column = (program, block), column
        return self

    def __reduce__(self) -> tuple[object, ...]:
        return (ProgramError, (self.number, self.detail, self.column, self.infos), {"place": self.place})


_A, _KS, _KA, _SA = Effect.SHOWN, Effect.STOP, Effect.CHANNEL_ABORT, Effect.SYSTEM_ABORT


class Code(IntEnum):
    """The messages that the twin gives: number, effect, text; from 8000 on those of cycles."""

    effect: Effect
    text: str

    def __new__(cls, number: int, effect: Effect, text: str) -> Code:
        code = int.__new__(cls, number)
        code._value_, code.effect, code.text = number, effect, text
        return code

    NOT_REFERENCED = 1008, _KA, "the reference points have not been approached"
    ONLY_BY_WAY_OF_HAND = 1009, _A, "AUTO and POS are changed by way of HAND only"
    NO_TOOL = 1050, _KA, "tool group not found in the tool table"
    TOOL_WORN = 1053, _KA, "the life of the tool group is over"
    PROGRAM_BUSY = 1105, _A, "a program cannot be opened"
    MEMORY_FULL = 1256, _A, "the memory for programs is full"
    PROGRAM_OVERWRITTEN = 1106, _A, "a program is overwritten"
    PROGRAM_KEPT = 1107, _A, "there is such a program, it is not overwritten"
    WRONG_FILE = 1110, _A, "wrong identifier of a file"
    WRONG_LINE = 1111, _A, "a line that has been read makes no sense"
    NO_FILE_CHANNEL = 1112, _A, "there is no such channel"
    LINE_TOO_LONG = 1113, _A, "a line of more than 400 characters"
    CIRCLE_TOO_SMALL = 1152, _KA, "radius of a circle too small"
    NO_APPROACH = 1153, _KA, "tool radius correction: approach or departure impossible"
    CIRCLES_APART = 1156, _KA, "tool radius correction: the circles do not meet"
    TOO_MANY_WITHOUT_PATH = 1157, _KA, "too many blocks without a path"
    NO_CORNER = 1158, _KA, "G12 impossible"
    TOO_LARGE = 1202, _KA, "number too large"
    DIVISION_BY_ZERO = 1203, _KA, "division by zero"
    TOO_MANY_PARAMETERS = 1208, _KA, "more than 32 parameters in a block"
    TOO_DEEP = 1209, _KA, "more than 10 brackets inside each other"
    BRACKET_MISSING = 1210, _KA, "a bracket is missing"
    SYNTAX = 1211, _KA, "syntax"
    ROOT_OF_NEGATIVE = 1212, _KA, "root of a negative number"
    NO_VALUE = 1213, _KA, "function without a value"
    NO_OPERATION = 1214, _KA, "no operation of a parameter"
    UNKNOWN_AXIS = 1216, _KA, "unknown axis"
    NO_LOOP = 1217, _KA, "M25 without M24"
    WRONG_LOOP = 1218, _KA, "M24"
    WRONG_CALL = 1219, _KA, "call of a subprogram"
    CALLS_TOO_DEEP = 1220, _KA, "too many subprograms inside each other"
    TOO_MANY = 1222, _KA, "too many functions in a block"
    CONTOUR = 1223, _KA, "contour"
    NO_SPINDLE = 1224, _KA, "there is no spindle"
    NO_TOOL_TABLE = 1225, _KA, "no tool group is defined"
    NO_NEXT_PATH = 1226, _KA, "contour: the next block with a path is missing"
    M_TOO_LARGE = 1227, _KA, "number of an M function too large"
    M_DEFINED_OTHERWISE = 1228, _KA, "M function and its definition do not agree"
    NO_HALT_HERE = 1229, _KA, "M01 is not allowed here"
    NO_FEED = 1230, _KA, "no feed is programmed"
    CIRCLE_WITHOUT_PATH = 1231, _KA, "circle without a path"
    EXCLUDED = 1232, _KA, "G or M functions that exclude each other"
    CIRCLE_WITHOUT_CENTRE = 1233, _KA, "circle without R and without I, J, K"
    RADIUS_CORRECTED = 1234, _KS, "radius smaller than half the chord; it is corrected"
    SPLINE = 1235, _KA, "a spline needs a path before and after it"
    CIRCLE_DYNAMICS = 1237, _KA, "circle dynamics: the allowed deviation is larger than the radius"
    CENTRE_OFF = 1238, _KA, "centre does not fit start and end"
    NO_WORKSPACE = 1240, _KA, "no valid workspace is defined (P8555)"
    WRONG_START_STATE = 1249, _KA, "wrong start state (P8830, P8853)"
    NO_PROGRAM = 1252, _KA, "program not found"
    NO_BLOCK = 1255, _KA, "block not found"
    NO_ROOM = 1268, _KA, "fed program: no room for what comes; the line's handshake is P11176"
    NOT_WHILE_FED = 1269, _KA, "not possible in a program that is fed"
    NOT_RISING = 1290, _A, "block numbers do not rise"
    DELETED = 1300, _KA, "parameter deleted or never set"
    NO_PARAMETER = 1302, _KA, "number of a parameter too large"
    NO_CHANNEL = 1305, _KA, "there is no such channel"
    NO_SYMBOL = 1307, _KA, "unknown symbol"
    NO_EMERGENCY_PROGRAM = 1310, _KA, "there is no such emergency program (P8820 on)"
    NOT_IN_HAND = 1321, _KA, "the control is not in HAND"
    NOT_IN_AUTO = 1322, _KA, "the control is not in AUTO"
    EMERGENCY_POSITION = 2000, _KA, "an emergency position is approached"
    LAG = 2001, _SA, "following error too large"
    DRIVE_FAULT = 2010, _SA, "a drive has switched itself off"
    NOT_IN_POSITION = 2022, _A, "an axis does not get into position"
    HARDWARE_LIMIT_HIGH = 2101, _KA, "hardware limit +"
    HARDWARE_LIMIT_LOW = 2102, _KA, "hardware limit -"
    SOFTWARE_LIMIT_HIGH = 2103, _KA, "software limit +"
    SOFTWARE_LIMIT_LOW = 2104, _KA, "software limit -"
    APPROACH_REFERENCE = 2110, _A, "approach the reference point"
    EMERGENCY_STOP = 3001, _SA, "emergency stop"
    DRIVES_OFF = 3002, _SA, "drives off"
    POCKET_IMPOSSIBLE = 8001, _KA, "the pocket cannot be milled with this tool"
    CORNER_TOO_LARGE = 8004, _KA, "corner radius too large"
    CYCLE_SEQUENCE = 8006, _KA, "sequence of a cycle"
    POCKET_TOO_SMALL = 8007, _KA, "radius of the pocket smaller than the tool's"
    INFEED_BEYOND_POCKET = 8008, _KA, "radius drilled and infeed are more than that of the pocket"
    INFEED_BEYOND_DEPTH = 8009, _KA, "infeed larger than the depth less its allowance"
    INNER_RADIUS = 8010, _KA, "not valid: inner radius (P11)"
    RAY_1_PLACES_MISSING = 8107, _KA, "division or number of places is missing on ray 1 (P105, P106)"
    RAY_2_PLACES_MISSING = 8117, _KA, "division or number of places is missing on ray 2 (P115, P116)"
    BORE_TOO_SMALL = 8134, _KA, "the bore is smaller than the probe"
    NOT_TOUCHED = 8136, _KA, "the probe does not answer"
    WRONG_MEASURING_KIND = 8137, _KA, "wrong: kind of measuring (P140)"
    WRONG_SAFETY = 8138, _KA, "wrong: safety distance of measuring (P141)"
    WRONG_MEASURING_FEED = 8140, _KA, "wrong: feed of measuring (P143)"
    WRONG_TOUCHES = 8141, _KA, "wrong: number of touches (P144)"
    WRONG_POINTER = 8142, _KA, "wrong: where tolerances, trigger points or gauge are (P147, P149, P150)"
    WRONG_CONFIDENCE = 8149, _KA, "wrong: range of confidence"
    WRONG_MEASURING_AXIS = 8150, _KA, "wrong: axis of measuring (P148)"
    WRONG_TRIGGER_XN = 8151, _KA, "wrong: trigger point XN"
    WRONG_TRIGGER_XP = 8152, _KA, "wrong: trigger point XP"
    WRONG_TRIGGER_YN = 8153, _KA, "wrong: trigger point YN"
    WRONG_TRIGGER_YP = 8154, _KA, "wrong: trigger point YP"
    WRONG_TRIGGER_ZN = 8155, _KA, "wrong: trigger point ZN"
    WRONG_TRIGGER_ZP = 8156, _KA, "wrong: trigger point ZP"
    WRONG_GAUGE_I = 8157, _KA, "wrong: I of the gauge"
    WRONG_GAUGE_J = 8158, _KA, "wrong: J of the gauge"
    WRONG_GAUGE_K = 8159, _KA, "wrong: K of the gauge"
    WRONG_GAUGE_DIAMETER = 8160, _KA, "wrong: diameter of the gauge"
    WRONG_BORE = 8162, _KA, "wrong: expected diameter of the bore (P152)"
    NO_PROBE = 8164, _KA, "no tool is called"
    TOUCHED_TOO_EARLY = 8167, _KA, "the probe answers outside the safety distance"
    WRONG_RESULT = 8168, _KA, "wrong: where results go (P154)"
    NO_SPINDLE_SPEED = 8300, _KA, "no spindle speed is programmed"
    NO_SPINDLE_DIRECTION = 8301, _KA, "no spindle direction is given"
    SPINDLE_SPEED_ZERO = 8302, _KA, "spindle speed is 0"
    SPEED_NOT_REACHED = 8303, _KA, "spindle speed is not reached"
    RAY_1_LENGTH_TWICE = 8311, _KA, "said twice: length of ray 1 and its end (P104)"
    RAY_1_PLACES_TWICE = 8315, _KA, "said twice: division of ray 1 and number of places (P105, P106)"
    RAY_2_LENGTH_TWICE = 8321, _KA, "said twice: length of ray 2 and its end (P114)"
    RAY_2_PLACES_TWICE = 8325, _KA, "said twice: division of ray 2 and number of places (P115, P116)"
    CIRCLE_PLACES_TWICE = 8333, _KA, "said twice: division angle and number of places (P125, P126)"
    DIVISION_ANGLE_ZERO = 8334, _KA, "division angle is 0 (P125)"


LOCKED: Final = 1304  # a locked parameter; without a text of its own

# names of cycle parameters P in the message that they are not valid
_INVALID: Final[Mapping[int, str]] = {
    P.SIZE_1: "first size of the pocket", P.SIZE_2: "second size of the pocket",
    P.POCKET_DEPTH: "depth of the pocket", P.POCKET_RADIUS: "radius", P.ALLOWANCE: "allowance",
    P.INFEED_ACROSS: "infeed across", P.INFEED_DEPTH: "infeed in depth", P.DEPTH_ALLOWANCE: "allowance on the depth",
    P.POCKET_SAFETY: "safety distance", P.FINISHING_INFEED: "infeed of finishing", P.PLUNGING_FEED: "plunging feed",
    P.HOLE_FEED: "feed", P.HOLE_DEPTH: "depth", P.APPROACH_PLANE: "approach plane", P.STROKES: "number of strokes",
    P.FIRST_STROKE: "first stroke", P.HOLE_SAFETY: "safety distance", P.RAY_1 + Ray.X: "X of A to B",
    P.RAY_1 + Ray.Y: "Y of A to B", P.RAY_1 + Ray.ANGLE: "angle of ray 1", P.RAY_1 + Ray.LENGTH: "length of ray 1",
    P.RAY_1 + Ray.DIVISION: "division of ray 1", P.RAY_2 + Ray.X: "X of A to C", P.RAY_2 + Ray.Y: "Y of A to C",
    P.RAY_2 + Ray.ANGLE: "angle of ray 2", P.RAY_2 + Ray.LENGTH: "length of ray 2",
    P.RAY_2 + Ray.DIVISION: "division of ray 2", P.CENTRE_X: "X of the circle's centre",
    P.CENTRE_Y: "Y of the circle's centre", P.DIAMETER: "diameter of the circle", P.START_ANGLE: "start angle",
    P.TRAVEL_ANGLE: "travel angle", P.DIVISION_ANGLE: "division angle", P.PLACES: "number of places",
}  # fmt: skip


def invalid(parameter: int) -> int:
    """Number of the message that a parameter P of a cycle is missing or not valid."""
    return 8000 + parameter


# messages of `Code`, and those about parameters of cycles
MESSAGES: Final[Mapping[int, Message]] = {
    **{code.value: Message(code.value, code.effect, code.text) for code in Code},
    **{
        invalid(number): Message(invalid(number), _KA, f"not valid: {what} (P{number})")
        for number, what in _INVALID.items()
    },
}


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
    """The message of that number; one that is not in the table breaks the channel off."""
    known = MESSAGES.get(number) or Message(number, Effect.CHANNEL_ABORT, "message of a cycle or of the PLC")
    said = replace(known, program=program, block=block, column=column, detail=detail, infos=infos)
    return said if effect is None else replace(said, effect=effect)
