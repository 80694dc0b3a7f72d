"""`p` and `a`: programs of the card and of the PLC (3.1.1 p, 4)."""

from __future__ import annotations

from collections.abc import Generator

from isel_twin.firmware.gmi99 import directly, images
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.settings import PROGRAMS
from isel_twin.firmware.gmi99.waiting import Wait

START, STOP, BEGIN, END, QUIET, LOUD = 1, 2, 100, 101, 110, 111
PLC, AXIS_PROGRAM, PROGRAM, DIRECT, FLAG = 1, 4, 3, 10, 11


def programming(card: Card, instruction: Instruction) -> Generator[Wait, None, None] | None:
    """`p`: P1 says of what."""
    match instruction.p1:
        case 1:
            _plc(card, instruction.p2)
        case 3:
            _program(card, instruction.p2, instruction.p3)
        case 10:
            return directly.direct(card, instruction)
        case 11:
            set_flag_byte(card, instruction)
        case other:
            raise OutOfRangeError(f"there is no p{other} here")
    return None


def set_flag_byte(card: Card, instruction: Instruction) -> None:
    """`p11`: MB(P2) becomes P3, but for the bits of the firmware."""
    if instruction.p2 > 255 or instruction.p3 > 255:
        raise OutOfRangeError("p11 wants a flag byte 0 .. 255 and a value 0 .. 255")
    before = card.images.flag(images.PROGRAM_RUNS)
    card.images.write_flag_byte(instruction.p2, instruction.p3)
    card.flags_changed(program_ran=before)


def _plc(card: Card, what: int) -> None:
    if what == START:
        card.plc.start(card.now_ns)
    elif what == STOP:
        card.plc.stop(card.now_ns)
    elif what == BEGIN:
        card.store.erase()
        card.keep(programs=card.store.kept, plc="")
        card.plc.begin_load()
    elif what == END:
        image = card.plc.end_load()
        card.keep(plc=image.hex() if image is not None else "")
    else:
        raise OutOfRangeError(f"there is no p1;{what}")


def plc_data(card: Card, instruction: Instruction) -> None:
    """`a`: a part of the image of a PLC program."""
    card.plc.load(instruction.p1, instruction.raw)


def _program(card: Card, what: int, number: int) -> None:
    if what in (START, BEGIN) and number >= PROGRAMS:
        raise OutOfRangeError(f"there is no program {number}")
    if what == START:
        card.call(number)
    elif what == STOP:
        card.queue.leave()
    elif what == BEGIN:
        card.store.begin(number)
        card.keep(programs=card.store.kept)
    elif what == END:
        pass  # ends a recording; without one it has nothing to end
    elif what in (QUIET, LOUD):
        pass  # whether the loss of contact is reported: the card has none
    else:
        raise OutOfRangeError(f"there is no p3;{what}")
