"""`p` and `a`: programs of the card and of the PLC (3.1.1 p, 4)."""

from __future__ import annotations

from collections.abc import Generator
from enum import IntEnum

from isel_twin.firmware.gmi99 import directly, images
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError
from isel_twin.firmware.gmi99.settings import PROGRAMS
from isel_twin.firmware.gmi99.waiting import Wait


class Of(IntEnum):
    """P1 of `p`: the object."""

    PLC = 1
    PROGRAM = 3
    DIRECT = 10
    FLAG = 11


class Do(IntEnum):
    """P2: the action."""

    START = 1
    STOP = 2
    BEGIN = 100
    END = 101
    QUIET = 110
    LOUD = 111


def programming(card: Card, instruction: Instruction) -> Generator[Wait, None, None] | None:
    """`p`: dispatch by P1."""
    match instruction.p1:
        case Of.PLC:
            _plc(card, instruction.p2)
        case Of.PROGRAM:
            _program(card, instruction.p2, instruction.p3)
        case Of.DIRECT:
            return directly.direct(card, instruction)
        case Of.FLAG:
            set_flag_byte(card, instruction)
        case other:
            raise OutOfRangeError(f"there is no p{other} here")
    return None


def set_flag_byte(card: Card, instruction: Instruction) -> None:
    """`p11`: MB(P2) becomes P3, except the bits of the firmware."""
    if instruction.p2 > 255 or instruction.p3 > 255:
        raise OutOfRangeError("p11 wants a flag byte 0 .. 255 and a value 0 .. 255")
    before = card.images.flag(images.PROGRAM_RUNS)
    card.images.write_flag_byte(instruction.p2, instruction.p3)
    card.flags_changed(program_ran=before)


def _plc(card: Card, what: int) -> None:
    match what:
        case Do.START:
            card.plc.start(card.now_ns)
        case Do.STOP:
            card.plc.stop(card.now_ns)
        case Do.BEGIN:
            card.store.erase()
            card.keep(programs=card.store.kept, plc="")
            card.plc.begin_load()
        case Do.END:
            image = card.plc.end_load()
            card.keep(plc=image.hex() if image is not None else "")
        case _:
            raise OutOfRangeError(f"there is no p1;{what}")


def plc_data(card: Card, instruction: Instruction) -> None:
    """`a`: a part of the image of a PLC program."""
    card.plc.load(instruction.p1, instruction.raw)


def _program(card: Card, what: int, number: int) -> None:
    if what in (Do.START, Do.BEGIN) and number >= PROGRAMS:
        raise OutOfRangeError(f"there is no program {number}")
    match what:
        case Do.START:
            card.call(number)
        case Do.STOP:
            card.queue.leave()
        case Do.BEGIN:
            card.store.begin(number)
            card.keep(programs=card.store.kept)
        case Do.END | Do.QUIET | Do.LOUD:
            pass  # an end without a recording; reports of lost contact, of which the card has none
        case _:
            raise OutOfRangeError(f"there is no p3;{what}")
