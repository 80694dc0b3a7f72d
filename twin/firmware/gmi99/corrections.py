"""G functions, and among them the zero points and corrections (3.1.1 G).

    machine target = programmed target (absolute) + zero point + fine correction + temporary ones + PLC zero point

One table of 16 zero points, G54 to G57 being its first four. Selecting one moves nothing. Tool offsets have no command
that enters them and are 0 (G13).
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, signed
from isel_twin.firmware.gmi99.settings import SLOTS, ZERO_POINTS

if TYPE_CHECKING:
    from isel_twin.firmware.gmi99.device import Card

PLC_ZERO_LIMIT = 1000
PRESELECTED = 0xFF


class Offsets:
    """What is added to programmed positions."""

    def __init__(self, zero_points: tuple[tuple[int, ...], ...], fine: tuple[tuple[int, ...], ...]) -> None:
        self.zero_points = [list(values) for values in zero_points]
        self.fine = [list(values) for values in fine]
        self.temporary = {58: [0] * SLOTS, 59: [0] * SLOTS}
        self.plc_zero = [0] * SLOTS
        self.preselected = 0
        """Number of the fine correction the PLC has chosen (Vx, FB 254.5)."""
        self._active: tuple[int, int | None] | None = None
        self._last: tuple[int, int | None] | None = None

    def total(self, axis: int) -> int:
        """Sum of all offsets in force for an axis, in increments."""
        zero = 0
        if self._active is not None:
            number, fine = self._active
            zero = self.zero_points[number][axis] + (0 if fine is None else self.fine[fine][axis])
        return zero + self.temporary[58][axis] + self.temporary[59][axis] + self.plc_zero[axis]

    def select(self, number: int, fine: int | None) -> None:
        """A zero point, and a fine correction with it."""
        self._active = self._last = (number, fine)

    def select_again(self) -> None:
        """The zero point last in force."""
        self._active = self._last

    def deselect(self) -> None:
        """No zero point, no fine correction."""
        self._active = None


def g_function(card: Card, instruction: Instruction) -> None:
    """`G`."""
    number = instruction.p1 & 0xFF
    if 53 <= number <= 59:
        _correction(card, number, instruction)
        return
    if instruction.p1 != number:
        raise OutOfRangeError(f"there is no G{instruction.p1}")
    path = card.path
    if number == 0:
        path.feed_hz = None
    elif number in (2, 3):
        path.begin_circle(clockwise=number == 2)
    elif number == 36:
        path.shortest_way = True
    elif number in (90, 91):
        path.absolute = number == 90
    elif number in (94, 95):
        path.per_turn = number == 95
    else:
        raise OutOfRangeError(f"there is no G{number}")


def _correction(card: Card, number: int, instruction: Instruction) -> None:
    offsets = card.offsets
    middle, high = instruction.p1 >> 8 & 0xFF, instruction.p1 >> 16
    value, slot = signed(instruction.p2), instruction.p3
    if slot > SLOTS or (middle and number != 54) or middle >= ZERO_POINTS:
        raise OutOfRangeError(f"G{number} has no axis {slot}, or no zero point {middle}")
    if high and not (0x80 <= high < 0x90 or high == PRESELECTED):
        raise OutOfRangeError(f"G{number} has no fine correction {high:02X}h")
    fine = None if not high else offsets.preselected if high == PRESELECTED else high & 0x0F
    if number in (58, 59):
        if not slot:
            raise OutOfRangeError(f"G{number} wants an axis")
        if not card.in_program:
            raise OutOfRangeError(f"G{number} is for programs")
        offsets.temporary[number][slot - 1] = value
    elif slot and number == 53:
        if fine is None:
            raise OutOfRangeError("G53 has no value")
        offsets.fine[fine][slot - 1] = value
        card.keep(fine=tuple(map(tuple, offsets.fine)))
    elif slot:
        offsets.zero_points[middle if number == 54 else number - 54][slot - 1] = value
        card.keep(zero_points=tuple(map(tuple, offsets.zero_points)))
    elif number == 53:
        offsets.deselect()
    elif value == 1:
        offsets.select_again()
    else:
        offsets.select(middle if number == 54 else number - 54, fine)
