"""The parameters: one array q of the system, and P, the view of each channel by its descriptor (manual, 8.1).

    P0 .. P6999       user block 1, q(102) on, q(103) of them        P12000 + 200 (a - 1)   axis a of the channel:
    P7000 .. P9999    behind it                                        2000 + 200 (physical - 1)
    P11000 .. P11999  q1000 on, common to all channels                P20000 .., P30000 ..   user blocks 2 and 3

A value is a number or deleted; every parameter has four bytes of status. Byte 1: bit 0 loaded, bit 2 written when the
block is executed (real time), bit 3 its writing synchronises.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping
from string import ascii_uppercase
from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Descriptor, P, Q
from isel_twin.firmware.bwo900.readings import Readings

LOADED: Final = 0x01
REAL_TIME: Final = 0x04
SYNCHRONISING: Final = 0x08
LOCKS: Final = 0x0F  # of byte 3
LARGEST_Q: Final = 59_999  # 60 000 parameters, the largest system
AXIS_SIZE: Final = 200
FIRST_LIVE: Final = P.M_WAITS  # parameters below are never computed on reading
MOST_AXES: Final = 32
MACHINE_AXES: Final = 3
FIXED: Final = P.FIXED_LAST + 1 - P.FIXED_FIRST  # P7000 to P9999
CHANNEL_SIZE: Final = Q.CHANNEL_1  # of a channel's descriptor: q100, q200

_FIXED_FIRST, _FIXED_LAST, _COMMON_FIRST, _COMMON_LAST = P.FIXED_FIRST, P.FIXED_LAST, P.COMMON_FIRST, P.COMMON_LAST
# bound once for speed: every access needs them
_CHANNELS, _USER_1, _SIZE_1, _AXES_FIRST = Q.CHANNELS, Descriptor.USER_1, Descriptor.SIZE_1, P.AXES_FIRST


def descriptor(letter: str, physical: int, index: int = 0) -> float:
    """The value of q110 .. q141 for an axis: letter, index 1 to 8 or 0, number of the physical axis (manual, 8.3)."""
    return float(ord(letter) | index << 8 | physical << 16 | physical << 24)


def _name(value: float) -> str:
    """Letter and index of an axis; empty without a letter."""
    letter, index = chr(byte(value, 1)), byte(value, 2)
    return (letter + (str(index) if index else "")) if letter in ascii_uppercase else ""


def of_axis(axis: int, offset: int = 0) -> int:
    """The P of an axis, from 0; offset: of `Axis`."""
    return P.AXES_FIRST + AXIS_SIZE * axis + offset


def byte(value: float, number: int) -> int:
    """One byte of a value, 1 the lowest, as the manual counts."""
    return int(value) >> 8 * (number - 1) & 0xFF


# the system's own definitions, by q: three axes, one channel, zero points at P20000, tools at P21000
FACTORY: Final[Mapping[int, float]] = {
    Q.LANGUAGE: 3, Q.CHANNELS: 1, CHANNEL_SIZE + Descriptor.NUMBER: 1, CHANNEL_SIZE + Descriptor.USER_1: 10_000,
    CHANNEL_SIZE + Descriptor.SIZE_1: 5_000, CHANNEL_SIZE + Descriptor.USER_2: 20_000,
    CHANNEL_SIZE + Descriptor.SIZE_2: 2_000, CHANNEL_SIZE + Descriptor.USER_3: 22_000,
    CHANNEL_SIZE + Descriptor.SIZE_3: 2_000,
    **{Q.AXIS_1 + axis: descriptor(letter, axis + 1) for axis, letter in enumerate("XYZ")},
    **{Q.SPINDLE_1 + spindle: spindle + 1 for spindle in range(8)}, Q.POLAR_RADIUS: ord("x"), Q.POLAR_ANGLE: ord("c"),
    Q.PLANE_XY: 0x030201, Q.PLANE_ZX: 0x020103, Q.PLANE_YZ: 0x010302, Q.DECIMALS: 3, Q.ZERO_TABLE: 20_000,
    Q.ZERO_SETS: 1, Q.ZERO_GROUPS: 0, Q.ZERO_AXES: 3, Q.ZERO_MORE: 0, Q.TOOL_TABLE: 21_000, Q.TOOLS: 20,
    Q.TOOL_SUB_RECORDS: 0, Q.TOOL_SIZE: 20,
}  # fmt: skip


class Parameters:
    """The array, addressed as in programs, by default as P of channel 1."""

    def __init__(self, values: Mapping[int, float] | None = None) -> None:
        """values: by q, in place of FACTORY."""
        self._values: dict[int, float] = dict(FACTORY if values is None else values)
        self._status: dict[int, int] = {}
        self._places: dict[int, int] = {}
        """The q of each P of channel 1 that was asked for; forgotten when a definition changes."""
        self.live: Callable[[int], float | None] | None = None
        """The present value of a P of channel 1, None: as written."""
        self.readings = Readings()  # settings of the machine file, not of the control
        self.revision = 0  # counts every write that changes a value

    def address(self, area: str, number: int, channel: int = 1) -> int:
        """The q of a parameter. Raises ProgramError M1302: no such number, M1305: no such channel."""
        q = number if area == "q" else self._place(number) if channel == 1 else self._of_channel(number, channel)
        if q is None or not 0 <= q <= LARGEST_Q:
            raise ProgramError(Code.NO_PARAMETER, f"{area}{number}")
        return q

    def _place(self, number: int) -> int | None:
        q = self._places.get(number)
        if q is None and (q := self._of_channel(number, 1)) is not None:
            self._places[number] = q
        return q

    def _of_channel(self, number: int, channel: int) -> int | None:
        base = CHANNEL_SIZE * channel
        if not 1 <= channel <= max(int(self._values.get(_CHANNELS, 1)), 1):
            raise ProgramError(Code.NO_CHANNEL, f"channel {channel}")
        values = self._values
        first, size = int(values.get(base + _USER_1, 0)), int(values.get(base + _SIZE_1, 0))
        if not (first >= 0 and size >= 0 and first + size + FIXED <= LARGEST_Q + 1):
            first, size = int(FACTORY[CHANNEL_SIZE + _USER_1]), int(FACTORY[CHANNEL_SIZE + _SIZE_1])
        if 0 <= number < min(size, _FIXED_FIRST):
            return first + number
        if _FIXED_FIRST <= number <= _FIXED_LAST:
            return first + size + number - _FIXED_FIRST
        if _COMMON_FIRST <= number <= _COMMON_LAST:
            return number - _COMMON_FIRST + Q.COMMON_FIRST
        if _AXES_FIRST <= number < _AXES_FIRST + AXIS_SIZE * MOST_AXES:
            axis, offset = divmod(number - _AXES_FIRST, AXIS_SIZE)
            physical = byte(values.get(base + Descriptor.AXES + axis, 0.0), 3) or axis + 1
            return Q.AXES_FIRST + AXIS_SIZE * (physical - 1) + offset
        for block, start in ((Descriptor.USER_2, P.BLOCK_2), (Descriptor.USER_3, P.BLOCK_3)):
            if start <= number < start + int(values.get(base + block + 1, 0)):
                return int(values.get(base + block, 0)) + number - start
        return None

    def of_channel(self, q: int) -> int | None:
        """The P of channel 1 for this q, if the control uses it."""
        first = self._place(P.FIXED_FIRST) or 0
        if first <= q < first + FIXED:
            return q - first + P.FIXED_FIRST
        if Q.COMMON_FIRST <= q < Q.COMMON_END:
            return q - Q.COMMON_FIRST + P.COMMON_FIRST
        for axis in range(MACHINE_AXES):
            begin = self._place(of_axis(axis)) or 0
            if begin <= q < begin + AXIS_SIZE:
                return q - begin + of_axis(axis)
        return None

    has_spindle = False
    """The machine has a spindle whose speed can be measured."""

    def get(self, number: int, default: float = 0.0, area: str = "P") -> float:
        return self._values.get(self.address(area, number), default)

    def row(self, number: int, count: int) -> list[float]:
        """The values of `count` P, 0 for deleted ones. All of them in P7000 to P9999 or in P11000 to P11999, where q
        follows q."""
        q = self.address("P", number)
        return [self._values.get(at, 0.0) for at in range(q, q + count)]

    def given(self, number: int, default: float, area: str = "P") -> float:
        """The value, `default` if it is deleted or 0: the manual's "0 or --"."""
        return self._values.get(self.address(area, number)) or default

    def loaded(self, number: int, area: str = "P", channel: int = 1) -> bool:
        """True if it is not deleted."""
        return self.address(area, number, channel) in self._values

    def read(self, area: str, number: int, channel: int = 1) -> float:
        """The value. Raises ProgramError M1300 if it is deleted."""
        value = self._values.get(self.address(area, number, channel))
        if self.live is not None and area == "P" and channel == 1 and number >= FIRST_LIVE:
            now = self.live(number)
            value = value if now is None else now
        if value is None:
            raise ProgramError(Code.DELETED, f"{area}{number}", infos=(number, 0 if area == "q" else channel))
        return value

    def write(self, number: int, value: float | None, area: str = "P", channel: int = 1) -> None:
        """Set a value; None deletes it. Raises ProgramError M1202 if it is not finite."""
        q = self.address(area, number, channel)
        if value is not None and not math.isfinite(value):
            raise ProgramError(Code.TOO_LARGE, f"{area}{number}")
        if value != self._values.get(q):
            self.revision += 1
            if q < Q.COMMON_FIRST:
                self._places.clear()
        if value is None:
            self._values.pop(q, None)
        else:
            self._values[q] = value

    def status(self, number: int, area: str = "P", channel: int = 1) -> int:
        """The four bytes; `LOADED` as it is."""
        q = self.address(area, number, channel)
        return self._status.get(q, 0) & ~LOADED | (LOADED if q in self._values else 0)

    def set_status(self, number: int, status: int, area: str = "P", channel: int = 1, add: bool = False) -> None:
        """Set the four bytes, or add bits to them. `LOADED` follows the value."""
        q = self.address(area, number, channel)
        self._status[q] = (self._status.get(q, 0) | status if add else status) & ~LOADED

    def has(self, number: int, bits: int, area: str = "P", channel: int = 1) -> bool:
        """True if any of these bits of the status is set."""
        return bool(self._status.get(self.address(area, number, channel), 0) & bits)

    def locked(self, number: int, area: str = "P", channel: int = 1) -> bool:
        """True if a program must not write it: byte 3 of its status has the bit of a lock that is set.

        P8510 sets locks in AUTO, P11008 = 1 those of P11018 and P11009 = 1 those of P11019, -1 clears them; P8511
        clears them for programs.
        """
        bits = self._status.get(self.address(area, number, channel), 0) >> 16 & LOCKS
        if not bits:
            return False
        set_, lifted = int(self.get(P.LOCKS_SET)), int(self.get(P.LOCKS_LIFTED))
        for switch, locks in ((P.SOFTWARE_LOCK_1, P.LOCKS_OF_1), (P.SOFTWARE_LOCK_2, P.LOCKS_OF_2)):
            if self.get(switch) == 1.0:
                set_ |= int(self.get(locks))
            elif self.get(switch) == -1.0:
                lifted |= int(self.get(locks))
        return bool(bits & set_ & ~lifted)

    def axis(self, axis: int, offset: int, default: float) -> float:
        """The value of P12000 + 200 axis + offset, axis from 0; `default` if it is deleted."""
        return self.get(of_axis(axis, offset), default)

    @property
    def axes(self) -> Iterator[tuple[str, int]]:
        """Name and physical number of each axis of the machine, in order. A descriptor without a letter has its
        default; if two names are equal, all have."""
        given = [self._values.get(Q.AXIS_1 + axis, 0.0) for axis in range(MACHINE_AXES)]
        known = [FACTORY[Q.AXIS_1 + axis] for axis in range(MACHINE_AXES)]
        chosen = [value if _name(value) else other for value, other in zip(given, known, strict=True)]
        if len({_name(value) for value in chosen}) < MACHINE_AXES:
            chosen = known
        for value in chosen:
            yield _name(value), byte(value, 3)

    def zero_point(self, number: int, axis: int, workspace: int = 1) -> float:
        """The shift of a zero point, 0 for G53 to 6 for G59 and on to G154 ..., of an axis from 0. With additional
        groups (q172) it is their sum (bwo900/11). Raises ProgramError M1240: no such workspace."""
        if not 1 <= workspace <= int(self.given(Q.ZERO_SETS, 1, "q")):
            raise ProgramError(Code.NO_WORKSPACE, f"workspace {workspace}")
        groups = int(self.get(Q.ZERO_GROUPS, 0, "q"))
        those = range(1, groups + 1) if groups > 0 else (0,)
        return sum(self.get(self.zero_address(number, axis, workspace, group)) for group in those)

    def zero_address(self, number: int, axis: int, workspace: int = 1, group: int = 0) -> int:
        """The P of an entry of the table of zero points (manual, 8.3, q170 to q174); axis from 0."""
        axes = max(int(self.given(Q.ZERO_AXES, 3, "q")), 1)
        points = 7 + 6 * int(self.get(Q.ZERO_MORE, 0, "q"))
        groups = int(self.get(Q.ZERO_GROUPS, 0, "q")) + 1
        place = ((workspace - 1) * groups + group) * points + number
        return int(self.get(Q.ZERO_TABLE, 20_000, "q")) + place * axes + axis

    def items(self) -> Iterable[tuple[int, float]]:
        """All values by q, in order."""
        return sorted(self._values.items())

    def statuses(self) -> Iterable[tuple[int, int]]:
        """All statuses that were set, by q, in order."""
        return sorted((q, status) for q, status in self._status.items() if status)
