"""Answers to `T` (3.1.2): `<address> <ident> <value>`, the value low byte first.

    T0   @ 3 bytes      T1  V or I, 2      T3  ident only      T5  N, 3      T8  Z, 3      T11  C, 3      T12  x 6, e 2

Widths and idents that the manual does not print: decision gmi99/8. An unknown question gets no answer (gmi99/4).
"""

from __future__ import annotations

from isel_twin.controller import Remark
from isel_twin.firmware.gmi99.actions import parameter_value
from isel_twin.firmware.gmi99.device import Card
from isel_twin.firmware.gmi99.instruction import Instruction, signed
from isel_twin.firmware.gmi99.settings import SLOTS

VERSION = 488
STATUS = b""  # marks the status record as the answer (T3;0)


def answer(card: Card, instruction: Instruction) -> bytes | None:
    """Ident and value; STATUS for the status record; None for an unknown question."""
    what, second, third = instruction.values
    match what:
        case 0:
            return position(card, second, card.position[second]) if second < SLOTS else None
        case 1:
            return _image(card, second, third)
        case 3:
            return _status(card, second)
        case 5:
            value = parameter_value(card.settings, second, third)
            return None if value is None else b"N" + _three(value)
        case 8:
            return None if third >= SLOTS else _zero_point(card, second, third)
        case 11:
            return b"C" + _three(0)
        case 12:
            return _plc(card, signed(second))
    return None


def position(card: Card, slot: int, value: int) -> bytes:
    """Ident and three bytes of a position; a remark when one does not fit, as of an axis that turns (gmi99/35)."""
    fits = -(1 << 23) <= value < 1 << 23
    if not fits and slot not in card.told_modulo:
        card.events.append(Remark(f"slot {slot} is at {value}; T0 has three bytes and tells it modulo 2^24"))
    card.told_modulo = card.told_modulo - {slot} if fits else card.told_modulo | {slot}
    return b"@" + _three(value)


def _image(card: Card, area: int, byte: int) -> bytes | None:
    images = card.images
    if area == 0:
        return b"V" + VERSION.to_bytes(2, "little")
    if area == 12:
        return b"I" + card.offsets.preselected.to_bytes(2, "little")
    areas = {1: card.plc.inputs, 2: images.outputs, 3: images.flags, 6: images.data}
    if area not in areas or byte >= len(areas[area]):
        return None
    card.refresh_flags()
    card.ask_drives()
    return b"I" + images.word(areas[area], byte)


def _status(card: Card, what: int) -> bytes | None:
    match what:
        case 0:
            return STATUS
        case 4:
            return bytes([card.memory_status])
        case 5:
            return b"\0"
        case 8:
            return bytes([card.safety_status])
    return None


def _zero_point(card: Card, which: int, axis: int) -> bytes | None:
    number, middle, high = which & 0xFF, which >> 8 & 0xFF, which >> 16
    offsets = card.offsets
    if which == 53:
        value = 0
    elif number == 53 and 0x80 <= high < 0x90:
        value = offsets.fine[high & 0x0F][axis]
    elif number == 54 and middle < len(offsets.zero_points) and not high:
        value = offsets.zero_points[middle][axis]
    elif 55 <= which <= 57:
        value = offsets.zero_points[which - 54][axis]
    elif which == 100:
        value = offsets.plc_zero[axis]
    else:
        return None
    return b"Z" + _three(value)


def _plc(card: Card, offset: int) -> bytes | None:
    if offset < 0:
        entry = card.plc.entry(-offset)
        return None if entry is None else b"e" + entry.to_bytes(2, "little")
    code = card.plc.code(offset, 6)
    return b"x" + code if code else None


def _three(value: int) -> bytes:
    return (value & 0xFFFFFF).to_bytes(3, "little")
