"""G functions, and among them those that enter and choose zero points and corrections (3.1.1 G, offsets.py).

Choosing one moves nothing.
"""

from __future__ import annotations

from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, signed
from isel_twin.firmware.gmi99.settings import SLOTS, ZERO_POINTS

PRESELECTED = 0xFF


def g_function(card: Card, instruction: Instruction) -> None:
    number = instruction.p1 & 0xFF
    if 53 <= number <= 59:
        _correction(card, number, instruction)
        return
    if instruction.p1 != number:
        raise OutOfRangeError(f"there is no G{instruction.p1}")
    interpolator = card.interpolator
    if number == 0:
        interpolator.feed_hz = None
    elif number in (2, 3):
        interpolator.begin_circle(clockwise=number == 2)
    elif number == 36:
        interpolator.shortest_way = True
    elif number in (90, 91):
        interpolator.absolute = number == 90
    elif number in (94, 95):
        interpolator.per_turn = number == 95
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
