"""The parameters: one array q of the system, and P, which each channel sees through its descriptor (manual, 8.1).

    P0 .. P6999       user block 1, q(102) on, q(103) of them        P12000 + 200 (a - 1)   axis a of the channel:
    P7000 .. P9999    behind it                                        2000 + 200 (physical - 1)
    P11000 .. P11999  q1000 on, common to all channels                P20000 .., P30000 ..   user blocks 2 and 3

A value is a number or deleted; every parameter has four bytes of status. Byte 1: bit 0 loaded, bit 2 written when the
block is executed (real time), bit 3 its writing synchronises. What is not said here is deleted.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from string import ascii_uppercase
from typing import Final

from isel_twin.firmware.bwo900.messages import ProgramError

LOADED: Final = 0x01
REAL_TIME: Final = 0x04
SYNCHRONISING: Final = 0x08
LOCKS: Final = 0x0F
"""Of byte 3."""
LARGEST_Q: Final = 59_999
"""60 000 parameters, the largest system."""
AXIS_SIZE: Final = 200
FIRST_LIVE: Final = 8_559
"""Below it no parameter is worked out when it is asked for."""
AXES: Final = 32
MACHINE_AXES: Final = 3
FIXED: Final = 3_000
"""P7000 to P9999."""
CHANNEL_SIZE: Final = 100
"""Of a channel's descriptor: q100, q200 ..."""


def descriptor(letter: str, physical: int, index: int = 0) -> float:
    """The value of q110 .. q141 for an axis: letter, index 1 to 8 or 0, number of the physical axis (manual, 8.3)."""
    return float(ord(letter) | index << 8 | physical << 16 | physical << 24)


def _name(value: float) -> str:
    """Of an axis: its letter, and its index if it has one; empty if there is no letter."""
    letter, index = chr(byte(value, 1)), byte(value, 2)
    return (letter + (str(index) if index else "")) if letter in ascii_uppercase else ""


def byte(value: float, number: int) -> int:
    """One byte of a value, 1 the lowest, as the manual counts."""
    return int(value) >> 8 * (number - 1) & 0xFF


FACTORY: Final[Mapping[int, float]] = {
    1: 3, 2: 1, 101: 1, 102: 10_000, 103: 5_000, 104: 20_000, 105: 2_000, 106: 22_000, 107: 2_000,
    110: descriptor("X", 1), 111: descriptor("Y", 2), 112: descriptor("Z", 3),
    142: 1, 143: 2, 144: 3, 145: 4, 146: 5, 147: 6, 148: 7, 149: 8,
    150: ord("x"), 151: ord("c"), 152: 0x030201, 153: 0x020103, 154: 0x010302, 159: 3,
    170: 20_000, 171: 1, 172: 0, 173: 3, 174: 0, 175: 21_000, 176: 20, 177: 0, 178: 20,
}  # fmt: skip
"""The system's own definitions, by q: three axes, one channel, zero points at P20000, tools at P21000."""


class Parameters:
    """The array. Every access names a parameter as programs do; `q` and `P` of channel 1 are the usual ones."""

    def __init__(self, values: Mapping[int, float] | None = None) -> None:
        """values: by q, in place of FACTORY."""
        self._values: dict[int, float] = dict(FACTORY if values is None else values)
        self._status: dict[int, int] = {}
        self.live: Callable[[int], float | None] | None = None
        """What a P of channel 1 is now, None: what has been written."""
        self.revision = 0
        """Rises with every writing."""

    def address(self, area: str, number: int, channel: int = 1) -> int:
        """The q that a parameter is. Raises ProgramError M1302: no such number, M1305: no such channel."""
        q = number if area == "q" else self._of_channel(number, channel)
        if q is None or not 0 <= q <= LARGEST_Q:
            raise ProgramError(1302, f"{area}{number}")
        return q

    def _of_channel(self, number: int, channel: int) -> int | None:
        base = CHANNEL_SIZE * channel
        if not 1 <= channel <= max(int(self._values.get(2, 1)), 1):
            raise ProgramError(1305, f"channel {channel}")
        values = self._values
        first, size = int(values.get(base + 2, 0)), int(values.get(base + 3, 0))
        if not (first >= 0 and size >= 0 and first + size + FIXED <= LARGEST_Q + 1):
            first, size = int(FACTORY[102]), int(FACTORY[103])
        if 0 <= number < min(size, 7000):
            return first + number
        if 7000 <= number <= 9999:
            return first + size + number - 7000
        if 11_000 <= number <= 11_999:
            return number - 10_000
        if 12_000 <= number < 12_000 + AXIS_SIZE * AXES:
            axis, offset = divmod(number - 12_000, AXIS_SIZE)
            physical = byte(values.get(base + 10 + axis, 0.0), 3) or axis + 1
            return 2000 + AXIS_SIZE * (physical - 1) + offset
        for block, start in ((4, 20_000), (6, 30_000)):
            if start <= number < start + int(values.get(base + block + 1, 0)):
                return int(values.get(base + block, 0)) + number - start
        return None

    def of_channel(self, q: int) -> int | None:
        """The P of channel 1 that is this q, where the control itself may look at it; None: none of those."""
        first = self._of_channel(7_000, 1) or 0
        if first <= q < first + FIXED:
            return q - first + 7_000
        if 1_000 <= q < 2_000:
            return q + 10_000
        for axis in range(MACHINE_AXES):
            begin = self._of_channel(12_000 + AXIS_SIZE * axis, 1) or 0
            if begin <= q < begin + AXIS_SIZE:
                return q - begin + 12_000 + AXIS_SIZE * axis
        return None

    def get(self, number: int, default: float = 0.0, area: str = "P") -> float:
        """The value, `default` if it is deleted."""
        return self._values.get(self.address(area, number), default)

    def given(self, number: int, default: float, area: str = "P") -> float:
        """The value, `default` if it is deleted or 0: the manual's "0 or --"."""
        return self._values.get(self.address(area, number)) or default

    def loaded(self, number: int, area: str = "P", channel: int = 1) -> bool:
        """Whether it has a value."""
        return self.address(area, number, channel) in self._values

    def read(self, area: str, number: int, channel: int = 1) -> float:
        """The value. Raises ProgramError M1300 if it is deleted."""
        value = self._values.get(self.address(area, number, channel))
        if self.live is not None and area == "P" and channel == 1 and number >= FIRST_LIVE:
            now = self.live(number)
            value = value if now is None else now
        if value is None:
            raise ProgramError(1300, f"{area}{number}", infos=(number, 0 if area == "q" else channel))
        return value

    def write(self, number: int, value: float | None, area: str = "P", channel: int = 1) -> None:
        """Set a value; None deletes it. Raises ProgramError M1202 for one that is no number a double holds."""
        q = self.address(area, number, channel)
        if value is not None and not math.isfinite(value):
            raise ProgramError(1202, f"{area}{number}")
        if value is None:
            self._values.pop(q, None)
        else:
            self._values[q] = value
        self.revision += 1

    def status(self, number: int, area: str = "P", channel: int = 1) -> int:
        """The four bytes; `LOADED` as it is."""
        q = self.address(area, number, channel)
        return self._status.get(q, 0) & ~LOADED | (LOADED if q in self._values else 0)

    def set_status(self, number: int, status: int, area: str = "P", channel: int = 1, add: bool = False) -> None:
        """Set the four bytes, or add bits to them. `LOADED` follows the value."""
        q = self.address(area, number, channel)
        self._status[q] = (self._status.get(q, 0) | status if add else status) & ~LOADED

    def has(self, number: int, bits: int, area: str = "P", channel: int = 1) -> bool:
        """Whether bits of the status are set."""
        return bool(self._status.get(self.address(area, number, channel), 0) & bits)

    def locked(self, number: int, area: str = "P", channel: int = 1) -> bool:
        """Whether a program must not write it: byte 3 of its status has the bit of a lock, 1 to 4, that is set.

        P8510 sets locks in AUTO, P11008 = 1 those of P11018 and P11009 = 1 those of P11019, -1 lifts them; P8511 lifts
        them for programs.
        """
        bits = self._status.get(self.address(area, number, channel), 0) >> 16 & LOCKS
        if not bits:
            return False
        set_, lifted = int(self.get(8_510)), int(self.get(8_511))
        for switch in (11_008, 11_009):
            if self.get(switch) == 1.0:
                set_ |= int(self.get(switch + 10))
            elif self.get(switch) == -1.0:
                lifted |= int(self.get(switch + 10))
        return bool(bits & set_ & ~lifted)

    def axis(self, axis: int, offset: int, default: float) -> float:
        """The value of P12000 + 200 axis + offset, axis from 0; `default` if it is deleted."""
        return self.get(12_000 + AXIS_SIZE * axis + offset, default)

    @property
    def axes(self) -> Iterator[tuple[str, int]]:
        """Name and physical number of each axis of the machine, in order.

        A descriptor without a letter, and all of them if two have the same name, are what they are in a new control;
        further ones belong to axes that the machine has not.
        """
        given = [self._values.get(110 + axis, 0.0) for axis in range(MACHINE_AXES)]
        known = [FACTORY[110 + axis] for axis in range(MACHINE_AXES)]
        chosen = [value if _name(value) else other for value, other in zip(given, known, strict=True)]
        if len({_name(value) for value in chosen}) < MACHINE_AXES:
            chosen = known
        for value in chosen:
            yield _name(value), byte(value, 3)

    def zero_point(self, number: int, axis: int, workspace: int = 1) -> float:
        """The shift of a zero point, 0 for G53 to 6 for G59 and on to G154 ..., of an axis from 0.

        With additional groups (q172) it is their sum. Raises ProgramError M1240 for a workspace that there is not.
        """
        if not 1 <= workspace <= int(self.given(171, 1, "q")):
            raise ProgramError(1240, f"workspace {workspace}")
        groups = int(self.get(172, 0, "q"))
        those = range(1, groups + 1) if groups > 0 else (0,)
        return sum(self.get(self.zero_address(number, axis, workspace, group)) for group in those)

    def zero_address(self, number: int, axis: int, workspace: int = 1, group: int = 0) -> int:
        """The P of an entry of the table of zero points (manual, 8.3, q170 to q174); axis from 0."""
        axes = int(self.given(173, 3, "q"))
        points = 7 + 6 * int(self.get(174, 0, "q"))
        groups = int(self.get(172, 0, "q")) + 1
        place = ((workspace - 1) * groups + group) * points + number
        return int(self.get(170, 20_000, "q")) + place * axes + axis

    def items(self) -> Iterable[tuple[int, float]]:
        """All values by q, in order."""
        return sorted(self._values.items())

    def statuses(self) -> Iterable[tuple[int, int]]:
        """All statuses that were set, by q, in order."""
        return sorted((q, status) for q, status in self._status.items() if status)
