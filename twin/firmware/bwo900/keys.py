"""The operator's keys, and the parameters with the same effect (manual 7.5, 8.4: P8682 on; P8800 on).

key            parameter
mode           P8683            hand 1, auto 2, single 4, positioning 8
start, stop    P8684 = 1, 0
abort          P8705 = 1
clear          P8508 = 1        acknowledges the messages
override       P11310           %
skip           P8810            blocks with / are skipped
program        P8800            that Start begins; block: where, P8801 (0: at the first)
reference      P12130 ...       reference run of an axis, or of all of them: Z, Y, X
axis           P8751            that moves in hand
step           P8750, P8760     mm in hand; 0: as long as the key is held
move           P8752            + and - move the axis in hand, off ends a move without steps
output                          sends a program over the line, like the panel's copy key
copy                            sends tool data (W) or zero points (N)
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from enum import Enum
from typing import Final

from isel_twin.base.parameters import Limits
from isel_twin.controller import Key, KeyValue
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import AXIS_SIZE, Parameters, of_axis
from isel_twin.firmware.bwo900.realtime import placing
from isel_twin.firmware.bwo900.realtime.overrides import is_override

MODES: Final[Mapping[str, int]] = {"hand": 1, "auto": 2, "single": 4, "positioning": 8}
MOVES: Final[Mapping[str, int]] = {"off": 0, "+": 1, "-": 2}
AXES: Final = ("z", "y", "x")  # in the order of a reference run of all axes
OUTPUT, COPY = "output", "copy"
COPIES: Final[Mapping[str, str]] = {"tools": "W", "zero_points": "N"}  # identifiers of files
HIGHEST_FUNCTION: Final = 999
CONTINUOUS, BY_STEPS = 1.0, 2.0

KEYS: Final[Mapping[str, Key]] = {
    "mode": Key("what the control does", tuple(MODES)),
    "start": Key("begin the program, or go on with it"),
    "stop": Key("brake along the path, and wait for start"),
    "abort": Key("brake along the path, and forget the rest of the program"),
    "clear": Key("take note of the messages that stand"),
    "override": Key("part of the programmed feed", Limits("%", 0.0, 120.0)),
    "skip": Key("blocks with / are skipped; before start", bool),
    "program": Key("number of the program that start begins", Limits("", 0, 999_999, whole=True)),
    "block": Key("block at which start begins it; 0: the first", Limits("", 0, 999_999_999, whole=True)),
    "reference": Key("reference run of an axis, in mode hand", ("all", *AXES)),
    "axis": Key("the axis that moves in mode hand", ("x", "y", "z")),
    "step": Key("how far it moves at a time; 0: as long as the key is held", Limits("mm", 0.0, 100.0)),
    "move": Key("move it, in mode hand", tuple(MOVES), held=True),
    OUTPUT: Key(
        "put out a program over the line, by its number; 0: all of them", Limits("", 0, 9_999_999_999, whole=True)
    ),
    COPY: Key("put out the tool table or the zero points over the line, as a file", tuple(COPIES)),
}


def writes(name: str, value: KeyValue) -> Iterator[tuple[int, float]]:
    """Parameter and value of each write that a key makes."""
    if name == "mode":
        yield P.MODE_TO_PLC, float(MODES[str(value)])
    elif name in ("start", "stop"):
        yield P.START_TO_PLC, float(name == "start")
    elif name == "reference":
        for axis in AXES if value == "all" else (str(value),):
            yield of_axis("xyz".index(axis), Axis.REFERENCE_RUN), 1.0
    elif name == "axis":
        yield P.HAND_AXIS, float("xyz".index(str(value)) + 1)
    elif name == "step":
        yield P.HAND_KIND, BY_STEPS if value else CONTINUOUS
        yield P.STEP, float(value)
    elif name == "move":
        yield P.HAND_MOVE, float(MOVES[str(value)])
    elif name in ("abort", "clear"):
        yield {"abort": P.ABORT, "clear": P.ACKNOWLEDGE}[name], 1.0
    else:
        yield {"override": P.OVERRIDE, "skip": P.SKIP, "program": P.PROGRAM, "block": P.START_BLOCK}[name], float(value)


class Wish(Enum):
    """The request of a written parameter, and its value."""

    MODE = "a mode, by its number"
    START = "begin the program, or go on with it"
    STOP = "brake, and wait for start"
    ABORT = "brake, and forget the rest"
    MOVE = "1 +, 2 -: move the axis; 0: the key is released"
    PUT_OUT = "all parameters as a file; 5: with their status"
    CLEAR = "the messages that stand"
    OVERRIDE = "a parameter of an override"
    FUNCTION = "an M function, in HAND"
    NEXT_STEP = "the next step of the table"
    LOCK = "the channel may not move, or may again"
    FEED = "of the block in execution, mm/min"
    EMERGENCY = "an emergency program, 0 or 1"
    MAP = "say which q a P is"
    LENGTH = "length of paths counts from 0"
    CHANGE = "a tool, in HAND"
    REFERENCE = "reference run of an axis, from 0"
    SET = "position of an axis, from 0"
    PLACE = "a move of an axis, by the parameter that asks for it"


def wish(number: int, value: float | None, axes: int) -> tuple[Wish, float] | None:
    """The request of a written parameter P, or None. axes: number of the machine's axes."""
    given = int(value or 0)
    match number:
        case P.MODE_TO_PLC | P.MODE:
            return Wish.MODE, given
        case P.START_TO_PLC | P.START:
            return (Wish.START if given else Wish.STOP), given
        case P.START_KEY if given:
            return (Wish.START if given == 2 else Wish.STOP), given
        case P.ABORT if given:
            return Wish.ABORT, given
        case P.HAND_MOVE:
            return Wish.MOVE, given
        case P.PUT_OUT:
            return Wish.PUT_OUT, given
        case P.ACKNOWLEDGE:
            return Wish.CLEAR, given
        case P.M_CODE if value is not None:
            return Wish.FUNCTION, given
        case P.NEXT_STEP if given == 1:
            return Wish.NEXT_STEP, given
        case P.TRAVEL_RELEASE | P.SAFETY_HALT | P.BLOCK_LOCK:
            return Wish.LOCK, given
        case P.FEED_NOW:
            return Wish.FEED, value or 0.0
        case P.EMERGENCY_1 | P.EMERGENCY_2 if given == 1:
            return Wish.EMERGENCY, number - P.EMERGENCY_1
        case P.LENGTH_AXES:
            return Wish.LENGTH, given
        case P.HAND_CHANGE if value is not None:
            return Wish.CHANGE, given
        case P.MAP_P:
            return Wish.MAP, given
    if is_override(number):
        return Wish.OVERRIDE, number
    axis, offset = divmod(number - P.AXES_FIRST, AXIS_SIZE)
    if not 0 <= axis < axes:
        return None
    if offset == Axis.OVERRIDE:
        return Wish.OVERRIDE, number
    if offset == Axis.BARRED:
        return Wish.LOCK, given
    if offset == Axis.SET:
        return Wish.SET, axis
    if offset in placing.COMMANDS:
        return Wish.PLACE, number
    return (Wish.REFERENCE, axis) if offset == Axis.REFERENCE_RUN and given else None


def values(parameters: Parameters, mode: int, override: float) -> dict[str, KeyValue]:
    """The state of the keys. mode: of MODES; override: 1 is 100 %."""
    return {
        "mode": next(name for name, number in MODES.items() if number == mode),
        "override": round(100.0 * override, 6),
        "skip": bool(parameters.get(P.SKIP)),
        "program": int(parameters.get(P.PROGRAM)),
        "block": int(parameters.get(P.START_BLOCK)),
        "axis": "xyz"[min(max(int(parameters.given(P.HAND_AXIS, 1.0)), 1), 3) - 1],
        "step": parameters.get(P.STEP) if parameters.get(P.HAND_KIND) == BY_STEPS else 0.0,
        "move": next((name for name, number in MOVES.items() if number == parameters.get(P.HAND_MOVE)), "off"),
    }
