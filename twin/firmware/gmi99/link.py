"""Frames of DIN 19244: bytes to frames and back, in both variants, and the DIL switches.

                     variant E (switch 7 on)               variant S (switch 7 off)
    single           E5                                    E5
    short record     10 A c [AE ..] CS 16                  10 c A [AE ..] CS 16
    long record      68 L L 68 A c p .. CS 16              68 L L 68 C A c p .. CS 16

A address, c command or information character, AE extension of the address field, C control field; CS is the sum of all
bytes between the start (10h, or the second 68h) and CS modulo 256, L their number (2 .. 250).

The manual (2.1, 3, 3.1, 3.2) names the three kinds of telegram and prints no frame: order, checksum and lengths are
those of FT1.2, decisions gmi99/1 to gmi99/6.

Unreadable bytes have no effect: the first one is dropped and the rest parsed again, so noise before a frame does no
harm. An incomplete frame is dropped after a pause of GAP_NS.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Literal

from isel_twin.base.units import MILLISECOND_NS

Variant = Literal["E", "S"]

ACKNOWLEDGED = b"\xe5"  # the single character: received
GAP_NS = 50 * MILLISECOND_NS  # longest pause between two bytes of a frame (gmi99/5)
# commands in a short record, and their bytes of extension (3.2)
SHORT_COMMANDS: Mapping[int, int] = {0: 0, 1: 0, 8: 2, 9: 1}

_SHORT, _LONG, _END = 0x10, 0x68, 0x16
_LONGEST = 250
_CONTROL_OF_CARD = 0x08  # control field of a long record from the card, in variant S
_CONTROL_OF_HOST = 0x43

FIRST_ADDRESS = 224
LOADER = 239  # the address at which only the loader listens (2.2): it is silent
ADDRESSES = range(FIRST_ADDRESS, LOADER + 1)


@dataclass(frozen=True)
class Frame:
    """A record: its bytes, the address, the character after it, and the rest."""

    data: bytes
    address: int
    command: int
    content: bytes
    short: bool


@dataclass(frozen=True)
class Dil:
    """The eight switches, read at power-on (2.2)."""

    switches: str = "11111111"  # switch 1 first; 1 is on

    def __post_init__(self) -> None:
        if len(self.switches) != 8 or set(self.switches) - {"0", "1"}:
            raise ValueError(f"dil_switches is {self.switches!r}; it has eight characters, 1 (on) or 0 (off)")

    @property
    def address(self) -> int:
        """224 .. 239; 239 is the loader."""
        return FIRST_ADDRESS + sum(1 << bit for bit in range(4) if self.switches[bit] == "0")

    @property
    def variant(self) -> Variant:
        return "E" if self.switches[6] == "1" else "S"

    @property
    def baud(self) -> int:
        return 38_400 if self.switches[7] == "1" else 9600


def short_record(variant: Variant, address: int, command: int, extension: bytes = b"") -> bytes:
    head = bytes([address, command] if variant == "E" else [command, address])
    return _framed(bytes([_SHORT]), head + extension)


def long_record(variant: Variant, address: int, content: bytes, *, from_card: bool = True) -> bytes:
    """A long record; `content` begins with the command or ident."""
    control = b"" if variant == "E" else bytes([_CONTROL_OF_CARD if from_card else _CONTROL_OF_HOST])
    body = control + bytes([address]) + content
    if not 2 <= len(body) <= _LONGEST:
        raise ValueError(f"a long record of {len(body)} bytes; it has 2 to {_LONGEST}")
    return _framed(bytes([_LONG, len(body), len(body), _LONG]), body)


def _framed(start: bytes, body: bytes) -> bytes:
    return start + body + bytes([sum(body) % 256, _END])


class Receiver:
    """Cuts the bytes of one direction into frames. The caller has the time: `expire` drops an incomplete frame."""

    def __init__(self, variant: Variant, *, from_host: bool) -> None:
        """`from_host`: short records are commands, otherwise they carry an information character."""
        self._variant = variant
        self._from_host = from_host
        self.rest = b""  # the frame begun

    def expire(self) -> None:
        self.rest = b""

    def take(self, data: bytes) -> list[Frame | bytes]:
        """Complete frames, single characters of the card, and bytes of neither, in order."""
        pieces: list[Frame | bytes] = []
        rest = self.rest + data
        at = noise = 0
        while at < len(rest):
            found = self._read(rest, at)
            if found is None:
                break
            if not found:
                at += 1
                continue
            if noise < at:
                pieces.append(rest[noise:at])
            pieces.append(found)
            at += len(found.data if isinstance(found, Frame) else found)
            noise = at
        if noise < at:
            pieces.append(rest[noise:at])
        self.rest = rest[at:]
        return pieces

    def _read(self, data: bytes, at: int) -> Frame | bytes | None:
        """The frame or single character that begins here; None if incomplete, empty if none begins."""
        if data[at] == _SHORT:
            return self._short(data, at)
        if data[at] == _LONG:
            return self._long(data, at)
        return ACKNOWLEDGED if data[at] == ACKNOWLEDGED[0] and not self._from_host else b""

    def _short(self, data: bytes, at: int) -> Frame | bytes | None:
        if len(data) < at + 3:
            return None
        address, command = data[at + 1 : at + 3] if self._variant == "E" else data[at + 1 : at + 3][::-1]
        if self._from_host:
            if command not in SHORT_COMMANDS:
                return b""
            extension = SHORT_COMMANDS[command]
        else:
            extension = command >> 1 & 1  # the message from MB4, if bit 1 of the information character is set (3.2)
        size = 5 + extension
        if len(data) < at + size:
            return None
        whole = data[at : at + size]
        return Frame(whole, address, command, whole[3:-2], short=True) if _sound(whole, 1) else b""

    def _long(self, data: bytes, at: int) -> Frame | bytes | None:
        head = data[at : at + 4]
        if len(head) > 1 and not 2 <= head[1] <= _LONGEST:
            return b""
        if (len(head) > 2 and head[2] != head[1]) or (len(head) > 3 and head[3] != _LONG):
            return b""
        if len(head) < 4 or len(data) < at + head[1] + 6:
            return None
        whole = data[at : at + head[1] + 6]
        body = whole[4:-2] if self._variant == "E" else whole[5:-2]
        sound = _sound(whole, 4) and len(body) >= 2
        return Frame(whole, body[0], body[1], body[2:], short=False) if sound else b""


def _sound(whole: bytes, start: int) -> bool:
    return whole[-1] == _END and sum(whole[start:-2]) % 256 == whole[-2]
