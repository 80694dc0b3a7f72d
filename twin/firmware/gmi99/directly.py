"""Direct inputs and outputs, `p10;opcode;operand` (6.1.2).

An operand counts the bits of the first 12 bytes of E or A, of the first 32 flag bytes (gmi99/15). Outputs act at once,
not at the end of a pass of the PLC.
"""

from __future__ import annotations

from collections.abc import Generator

from isel_twin.base.units import MILLISECOND_NS
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.waiting import Wait

WOSI, WORI, WOSO, WORO, WOSF, WORF, WAIT, SETO, RESO, INVO, CLAO = 2, 3, 6, 7, 10, 11, 14, 16, 17, 24, 26
WORDS = {
    WOSI: "wait until input is set",
    WORI: "wait until input is reset",
    WOSO: "wait until output is set",
    WORO: "wait until output is reset",
    WOSF: "wait until flag is set",
    WORF: "wait until flag is reset",
    WAIT: "wait, tenths of a second",
    SETO: "output on",
    RESO: "output off",
    INVO: "invert output",
    CLAO: "all outputs off",
}
BITS = 96  # of inputs and outputs; there are 256 flags and tenths of a second
TENTH_NS = 100 * MILLISECOND_NS


def direct(card: Card, instruction: Instruction) -> Generator[Wait, None, None] | None:
    """`p10`: P2 opcode, P3 operand."""
    code, operand = instruction.p2, instruction.p3
    if code not in WORDS:
        raise OutOfRangeError(f"there is no direct command {code}")
    most = 1 if code == CLAO else 256 if code in (WOSF, WORF, WAIT) else BITS
    if operand >= most:
        raise OutOfRangeError(f"the operand of {code} is {operand}; it must be below {most}")
    if code in (SETO, RESO):
        card.images.set_output_bit(operand, code == SETO)
    elif code == INVO:
        card.images.set_output_bit(operand, not _bit(card.images.outputs, operand))
    elif code == CLAO:
        card.images.clear_outputs()
    else:
        return _wait(card, code, operand)
    return None


def _wait(card: Card, code: int, operand: int) -> Generator[Wait, None, None]:
    if code == WAIT:
        yield Wait(at_ns=card.now_ns + operand * TENTH_NS)
        return
    images = card.images
    area = images.inputs if code in (WOSI, WORI) else images.outputs if code in (WOSO, WORO) else images.flags
    wanted = code in (WOSI, WOSO, WOSF)
    yield Wait(until=lambda: _bit(area, operand) == wanted)


def _bit(area: bytearray, number: int) -> bool:
    return bool(area[number >> 3] >> (number & 7) & 1)
