"""A command with its parameters, as it comes out of a long record or out of the program store."""

from __future__ import annotations

from dataclasses import dataclass

from isel_twin.firmware.gmi99.settings import HIGHEST, LOWEST

MOVE_BIT = 0x80  # in a command character: general motion command; its lower bits are the mask of axes


class OutOfRangeError(Exception):
    """A parameter is out of range; the message says which. The command has no effect (gmi99/6)."""


@dataclass(frozen=True)
class Instruction:
    code: int
    # P1 .. P3 as unsigned numbers, always three; the coordinates of a move, signed, one an axis of its mask.
    values: tuple[int, ...]
    raw: bytes = b""  # the bytes of a PLC program (`a`)

    @property
    def p1(self) -> int:
        """P1, 0 .. 2^24 - 1."""
        return self.values[0]

    @property
    def p2(self) -> int:
        return self.values[1]

    @property
    def p3(self) -> int:
        return self.values[2]

    @property
    def axes(self) -> tuple[int, ...]:
        return tuple(axis for axis in range(6) if self.code >> axis & 1) if self.code & MOVE_BIT else (0, 1, 2)

    @property
    def is_move(self) -> bool:
        return self.code >= MOVE_BIT or self.code == ord("V")


def require_place(slot: int, position: int) -> None:
    """Raise OutOfRangeError for a position that `O` could not set and T0 not tell (gmi99/35)."""
    if not LOWEST <= position <= HIGHEST:
        raise OutOfRangeError(f"slot {slot} would come to {position}; positions lie in {LOWEST} .. {HIGHEST}")


def signed(value: int) -> int:
    return value - (1 << 24) if value >> 23 else value
