"""A program as bytes, for loading by a host and for the flash.

    53 35 01 n | n x (kind, number, offset, length) | code of the blocks        offset, length: 16 bit, low byte first

Offsets count from the start of the image. The maker's format is unknown, so programs of the maker's assembler cannot be
loaded.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Final

from isel_twin.firmware.plc.codes import BLOCK_TYPES, ENDS, FORMS, Instruction, encode

MAGIC: Final = b"\x53\x35\x01"
LARGEST: Final = 0xFFFF  # bytes of an image: offsets have 16 bits
_ENTRY: Final = struct.Struct("<BBHH")
_KINDS: Final = {code: kind for kind, code in BLOCK_TYPES.items()}
_END_CODES: Final = tuple(encode(Instruction(FORMS[end, ""])) for end in ENDS)


class ImageError(ValueError):
    """Bytes are not a program; the message is one line with the reason."""


@dataclass(frozen=True, slots=True)
class PlcBlock:
    """A block: kind (OB, PB, FB, SB), number 0 to 255, and its code."""

    kind: str
    number: int
    code: bytes

    @property
    def name(self) -> str:
        return f"{self.kind} {self.number}"


@dataclass(frozen=True, slots=True)
class PlcProgram:
    """The blocks of a PLC program, in the order of the image."""

    blocks: tuple[PlcBlock, ...]

    @classmethod
    def of(cls, blocks: Iterable[PlcBlock]) -> PlcProgram:
        """A program of blocks. Raises ImageError for a repeated block, and for more than an image holds."""
        program = cls(tuple(blocks))
        names = [block.name for block in program.blocks]
        if doubled := next((name for name in names if names.count(name) > 1), None):
            raise ImageError(f"{doubled} is there twice")
        if len(names) > 255:
            raise ImageError(f"{len(names)} blocks; an image holds 255")
        if (size := len(MAGIC) + 1 + sum(_ENTRY.size + len(block.code) for block in program.blocks)) > LARGEST:
            raise ImageError(f"{size} bytes; an image holds {LARGEST}")
        return program

    @classmethod
    def read(cls, image: bytes) -> PlcProgram:
        """The program of an image. Raises ImageError: magic, bounds, an end of each block."""
        if image[: len(MAGIC)] != MAGIC or len(image) <= len(MAGIC):
            raise ImageError("no image of a PLC program: it begins with 53 35 01 and the number of blocks")
        count, at = image[len(MAGIC)], len(MAGIC) + 1
        first = at + count * _ENTRY.size
        if first > len(image):
            raise ImageError(f"the list of {count} blocks is cut off")
        blocks = []
        for number in range(count):
            kind, name, offset, length = _ENTRY.unpack_from(image, at + number * _ENTRY.size)
            if kind not in _KINDS:
                raise ImageError(f"block {number} of the list has the unknown kind {kind}")
            if offset < first or offset + length > len(image) or length % 2 or not length:
                raise ImageError(f"{_KINDS[kind]} {name} lies outside the image")
            code = image[offset : offset + length]
            if not code.endswith(_END_CODES):
                raise ImageError(f"{_KINDS[kind]} {name} does not end with BE")
            blocks.append(PlcBlock(_KINDS[kind], name, code))
        return cls.of(blocks)

    @property
    def entries(self) -> Mapping[tuple[str, int], int]:
        """Offset of each block in the image, by kind and number."""
        at = len(MAGIC) + 1 + _ENTRY.size * len(self.blocks)
        entries = {}
        for block in self.blocks:
            entries[block.kind, block.number] = at
            at += len(block.code)
        return entries

    @property
    def image(self) -> bytes:
        entries = self.entries
        heads = (
            _ENTRY.pack(BLOCK_TYPES[block.kind], block.number, entries[block.kind, block.number], len(block.code))
            for block in self.blocks
        )
        return MAGIC + bytes((len(self.blocks),)) + b"".join(heads) + b"".join(block.code for block in self.blocks)

    def block(self, kind: str, number: int) -> PlcBlock | None:
        """The block of that name, None if there is none."""
        return next((block for block in self.blocks if (block.kind, block.number) == (kind, number)), None)
