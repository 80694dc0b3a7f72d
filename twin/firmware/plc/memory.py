"""The memory of a PLC program: images of inputs and outputs, flags, data words; and its rights to the flags."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Final

IMAGE_BYTES: Final = 48
FLAG_BYTES: Final = 256
DATA_BYTES: Final = 256


@dataclass(slots=True)
class PlcMemory:
    """Bytes by area, named as in programs. Words have their low byte first: MW n = MB n + 256 MB(n + 1)."""

    e: bytearray = field(default_factory=lambda: bytearray(IMAGE_BYTES))
    # process images of the inputs (e) and the outputs
    a: bytearray = field(default_factory=lambda: bytearray(IMAGE_BYTES))
    m: bytearray = field(default_factory=lambda: bytearray(FLAG_BYTES))
    # 128 data words; DW n are bytes 2 n (DR, low) and 2 n + 1 (DL, high)
    d: bytearray = field(default_factory=lambda: bytearray(DATA_BYTES))

    def copy(self) -> PlcMemory:
        return PlcMemory(bytearray(self.e), bytearray(self.a), bytearray(self.m), bytearray(self.d))

    def areas(self) -> Iterator[bytearray]:
        """The areas that a program may write, outputs, flags, data: always in this order."""
        yield from (self.a, self.m, self.d)


@dataclass(frozen=True, slots=True)
class Rights:
    """Which bits of the flags a program may set, and which it may reset: bytes [256] of masks."""

    may_set: bytes = b"\xff" * FLAG_BYTES
    may_reset: bytes = b"\xff" * FLAG_BYTES

    def allowed(self, number: int, before: int, wanted: int) -> int:
        """The flag byte `number` after a program has tried to change it from `before` to `wanted`."""
        set_bits = wanted & ~before & self.may_set[number]
        reset_bits = before & ~wanted & self.may_reset[number]
        return (before | set_bits) & ~reset_bits & 0xFF
