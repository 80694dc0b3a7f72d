"""M functions as the table in the parameters defines them (manual 6.2; 8.6, P11050; P8250).

Four of them share a parameter, the lowest number in byte 1. Bits of a byte, as the manual's example has them:

    01h before the path    02h after it    04h halt until acknowledged    10h with a jump
    08h synchronises       20h a cycle of that number                     (these two: picture lost, ours)
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from isel_twin.firmware.bwo900.numbers import M, P, Q
from isel_twin.firmware.bwo900.parameters import Parameters, byte

PRE, POST, HALT, SYNCHRONISES, JUMP, CYCLE = 0x01, 0x02, 0x04, 0x08, 0x10, 0x20

# M functions that control the program (manual 6.1), without M06, which also goes to the PLC
CONTROLLING: Final = frozenset((
    M.HALT, M.SYNCHRONISE, M.RETURN, M.TOOL_DATA, M.JUMP, M.LOOP, M.LOOP_END, M.DELETE_DISTANCE, M.CALL, M.REPEAT,
    M.END,
))  # fmt: skip
IN_SYSTEM: Final = 200  # M0 to M199 are defined in P11050 .. P11099 unless q158 says otherwise
HIGHEST: Final = 999


@dataclass(frozen=True, slots=True)
class Definition:
    pre: bool = True
    post: bool = False
    halt: bool = False
    jump: bool = False
    cycle: bool = False
    synchronises: bool = False


class Functions:
    """The table, as last read at the change from HAND to AUTO."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self.take_over()

    def take_over(self) -> None:
        """Read the table again."""
        p = self._parameters
        words = p.row(P.M_TABLE, HIGHEST // 4 + 1)
        if not p.get(Q.M_IN_CHANNEL, 0.0, "q"):
            in_system = math.ceil(IN_SYSTEM / 4)
            words[:in_system] = p.row(P.M_TABLE_COMMON, in_system)
        self._bits = {place: bits for place, bits in enumerate(words) if bits}
        """Four definitions each, by their lowest number / 4; without empty places."""

    def defined(self, number: int) -> bool:
        """True if the table has a definition of an M function."""
        place, part = divmod(number, 4)
        return bool(byte(self._bits.get(place, 0.0), part + 1))

    def of(self, number: int) -> Definition:
        """The definition of an M function; without one it goes before the path, without halt."""
        place, part = divmod(number, 4)
        bits = byte(self._bits.get(place, 0.0), part + 1)
        if not bits:
            return Definition()
        jump = bool(bits & JUMP)
        return Definition(
            pre=bool(bits & PRE) or jump,
            post=bool(bits & POST) and not jump,
            halt=bool(bits & HALT) or jump,
            jump=jump,
            cycle=bool(bits & CYCLE) and number > M.END,
            synchronises=bool(bits & SYNCHRONISES),
        )


def _packed(definitions: Mapping[int, int]) -> dict[int, float]:
    packed: dict[int, float] = {}
    for number, bits in definitions.items():
        place, part = divmod(number, 4)
        packed[P.M_TABLE_COMMON + place] = packed.get(P.M_TABLE_COMMON + place, 0.0) + (bits << 8 * part)
    return packed


# by P: the table that the control comes with; the manual's is empty
FACTORY_FUNCTIONS: Final[Mapping[int, float]] = _packed(
    {
        M.HALT: POST | HALT, M.SYNCHRONISE: POST, M.SPINDLE_RIGHT: PRE, M.SPINDLE_LEFT: PRE, M.SPINDLE_OFF: POST,
        M.TOOL_CHANGE: PRE | HALT | SYNCHRONISES, M.COOLANT_1_ON: PRE, M.COOLANT_2_ON: PRE, M.COOLANT_OFF: POST,
    }
)  # fmt: skip
