"""G and M codes: the modal group of each, of which a line may have one code; what is refused, and why.

A code is a whole number of tenths: G38.2 is 382.
"""

from __future__ import annotations

from collections.abc import Mapping

MOTION, ONCE, PLANE, DISTANCE, CENTRE, FEED, UNIT, CUTTER, LENGTH, RETRACT, SYSTEM, PATH, TURNING, LATHE, CLEAR = (
    "motion",
    "one-shot",
    "plane",
    "distance",
    "centre",
    "feed",
    "unit",
    "cutter",
    "length",
    "retract",
    "system",
    "path",
    "turning",
    "lathe",
    "clear",
)
G_GROUPS: Mapping[int, str] = {
    **dict.fromkeys((0, 10, 20, 30, 730, 800, 810, 820, 830, 850, 890), MOTION),
    **dict.fromkeys((40, 100, 280, 281, 300, 301, 520, 530, 740, 920), ONCE),
    **dict.fromkeys((921, 922, 923), CLEAR),
    **dict.fromkeys((170, 180, 190), PLANE),
    **dict.fromkeys((900, 910), DISTANCE),
    **dict.fromkeys((901, 911), CENTRE),
    **dict.fromkeys((930, 940), FEED),
    **dict.fromkeys((200, 210, 700, 710), UNIT),
    **dict.fromkeys((400, 401), CUTTER),
    **{code: f"G{code // 10}" for code in (150, 500, 690)},
    **dict.fromkeys((430, 490), LENGTH),
    **dict.fromkeys((980, 990), RETRACT),
    **dict.fromkeys((540, 550, 560, 570, 580, 590, 591, 592, 593), SYSTEM),
    **dict.fromkeys((610, 611, 640), PATH),
    970: TURNING,
    80: LATHE,
}
SYSTEMS = {code: number for number, code in enumerate((540, 550, 560, 570, 580, 590, 591, 592, 593), 1)}
STRAIGHT_OR_ARC = frozenset((0, 10, 20, 30))
CYCLES = frozenset((730, 810, 820, 830, 850, 890))
TAKES_AXES = frozenset((100, 280, 300, 520, 740, 920))  # of the one-shot codes
CANCELS = frozenset((150, 401, 500, 690))  # what is never begun: polar, 3D compensation, scaling, rotation (cam/36)

STOP, TOOL, SPINDLE, COOLANT, OVERRIDE, SWITCH, DIGITAL = (
    "stop",
    "tool",
    "spindle",
    "coolant",
    "override",
    "switch",
    "digital",
)
M_GROUPS: Mapping[int, str] = {
    **dict.fromkeys((0, 1, 2, 30), STOP),
    6: TOOL,
    **dict.fromkeys((3, 4, 5), SPINDLE),
    **dict.fromkeys((7, 8, 9), COOLANT),
    **dict.fromkeys((48, 49, 50, 51, 52, 53), OVERRIDE),
    **dict.fromkeys((62, 63, 64, 65), DIGITAL),
}
TAKES_P = frozenset((50, 51, 52, 53, 62, 63, 64, 65))  # of the M codes
DIN_SWITCHES = frozenset((*range(70, 78), *range(-77, -69)))  # M70 .. M77 switch an output on, M-70 .. M-77 off

DIALECTS = 'set dialect = "din", or "winpc" where feeds are in mm/s'

_CUTTER = "cutter compensation is not made; let the CAM program offset the path"
_THREAD = "it needs a spindle that the axis follows"
_TAPPING = f"{_THREAD}; drill with G81 and tap by hand"
_POCKET = "round pockets are not made; let the CAM program write their lines and arcs"
_PROBING = "probing is not made: nothing is there to be touched"
_MACRO = "macros are not read; let the CAM program write them out"
G_REFUSED: Mapping[int, str] = {
    **dict.fromkeys((410, 411, 420, 421), _CUTTER),
    **dict.fromkeys((330, 331, 760), _THREAD),
    840: _TAPPING,
    860: "this boring cycle is not made; write G85, which feeds out of the hole instead",
    870: "back boring is not made",
    880: "this boring cycle is not made; write G89, which feeds out of the hole instead",
    **dict.fromkeys((310, 382, 383, 384, 385), _PROBING),
    **dict.fromkeys((120, 130), _POCKET),
    160: "polar coordinates are not read; let the CAM program write X and Y",
    510: "scaling is not made; let the CAM program write the moves as they shall be",
    680: "rotation is not made; let the CAM program write the moves as they shall be",
    **dict.fromkeys((650, 660, 670), _MACRO),
    **dict.fromkeys((50, 52, 53), "splines are not made; let the CAM program write lines and arcs"),
    51: "splines are not made; if it is the look-ahead of a Fanuc, leave G5.1 and its Q out: moves are joined anyhow",
    **dict.fromkeys((171, 181, 191), "this machine has no axes U V W"),
    431: "write G43 H and that length in tool_length_mm",
    432: "write G43 H and the sum of both lengths in tool_length_mm",
    1870: "smoothing is a Haas's own; leave G187, its P and E out: controllers join moves as they can",
    70: "diameters are for lathes; write G8, and radii for X",
    **dict.fromkeys((711, 712, 720, 721, 722), "it is a cycle of lathes"),
    950: "feed per turn is not made; write G94, and F times S for F, a feed in a minute",
    960: "constant surface speed is for lathes; write G97, and turns a minute for S",
}
M_REFUSED: Mapping[int, str] = {
    19: "the spindle cannot be turned to an angle",
    60: "there is no pallet; write M0",
    61: "the tool is not changed by it; write T and M6",
    66: "inputs are not waited for",
    **dict.fromkeys((67, 68), "analog outputs are not reached so"),
    **dict.fromkeys(DIN_SWITCHES, f"modes are not kept and restored; if it switches an output, {DIALECTS}"),
    **dict.fromkeys((98, 99), "subprograms are not read; let the CAM program write them out"),
    **dict.fromkeys(range(100, 200), "commands of one's own are not read"),
}
WINPC_REFUSED: Mapping[int, str] = {
    **dict.fromkeys(
        sorted(CYCLES), "holes of WinPC-NC have heights of their own; let the CAM program write their moves"
    ),
    980: "a subprogram of WinPC-NC begins; let the CAM program write it out",
}


def name(letter: str, code: int) -> str:
    """As people write it: G38.2, M3."""
    return f"{letter}{code / 10:g}" if letter == "G" else f"{letter}{code}"
