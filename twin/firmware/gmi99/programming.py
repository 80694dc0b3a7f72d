"""`p` and `a`: programs of the card and of the PLC (3.1.1 p, 4)."""

from __future__ import annotations

from collections.abc import Generator
from enum import IntEnum

from isel_twin.firmware.gmi99 import directly, images
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, OutOfRangeError, signed
from isel_twin.firmware.gmi99.settings import PROGRAMS, SLOTS
from isel_twin.firmware.gmi99.waiting import Wait


class Of(IntEnum):
    """P1 of `p`: the object."""

    PLC = 1
    PROGRAM = 3
    AXIS = 4
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
        case Of.AXIS:
            return _axis(card, instruction)
        case Of.DIRECT:
            return directly.direct(card, instruction)
        case Of.FLAG:
            set_flag_byte(card, instruction)
        case other:
            raise OutOfRangeError(f"there is no p{other} here")
    return None


def _axis(card: Card, instruction: Instruction) -> Generator[Wait, None, None] | None:
    """`p4`: P3 is an axis, and what it does: 0 end its program, which is waited for; 1 program P2; 2 turn, P2 1/min."""
    axis, what = instruction.p3 >> 8, instruction.p3 & 0xFF
    if not (axis < SLOTS and card.settings.axis_mask >> axis & 1 and what <= 2):
        raise OutOfRangeError(f"there is no p4 of axis {axis} with {what}")
    if what == 0:
        return card.off_path.wait(axis)
    if not card.drives.ready:
        raise OutOfRangeError("p4 while the indexer is not ready")
    if card.settings.motion_off:
        raise OutOfRangeError("p4 while nothing moves (N17)")
    if what == 2:
        card.off_path.turn(axis, signed(instruction.p2))
        return None
    commands = card.store.program(instruction.p2) if instruction.p2 < PROGRAMS else ()
    if not commands:
        raise OutOfRangeError(f"there is no program {instruction.p2}")
    return card.off_path.start(axis, commands, lambda step: directly.direct(card, step))


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
