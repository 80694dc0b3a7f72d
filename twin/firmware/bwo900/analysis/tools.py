"""Tools: the table, and the records for programs, PLC and path (manual 7.1; 8.3 q175 to q179).

    table (q175 ...) --- T ---> P8050 requested, PLC --- change ---> P8100 in the spindle, P8150 for the path
                        |--- T .. M16 ----------------------------------------------------------^
                        `--- T, when its block is executed ---> P8200

A record has 50 parameters: 0 group, 1 its place in the table from 1, 8 whether its life is over, 10 radius, 11 length,
12 and 13 their corrections, 14 quadrant. Records are copied by T, M06 and M16, and by commands: P8045 to P8047.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Final

from isel_twin.firmware.bwo900.messages import MISSING, Code, ProgramError
from isel_twin.firmware.bwo900.numbers import P, Q
from isel_twin.firmware.bwo900.parameters import Parameters, byte

SIZE: Final = 50
GROUP, NUMBER, PLACE, KIND, LIFE_SET, LIFE, WORN, RADIUS, LENGTH = 0, 1, 2, 4, 6, 7, 8, 10, 11
LATHE: Final = (500, 599)  # kinds of tools with two lengths
RADIUS_CORRECTION, LENGTH_CORRECTION, QUADRANT = 12, 13, 14
SUB_RECORDS: Final = 8  # where the sub records of an entry begin

# copies of records, (from, to), by parameter and byte 1 of its value (8.5)
COPIES: Final[Mapping[tuple[int, int], Sequence[tuple[int, int]]]] = {
    (P.TOOL_TAKE, 1): ((P.TOOL_REQUESTED, P.TOOL_SPINDLE), (P.TOOL_REQUESTED, P.TOOL_PATH)),
    (P.TOOL_TAKE, 10): ((P.TOOL_REQUESTED, P.TOOL_SPINDLE),),
    (P.TOOL_COPY, 1): ((P.TOOL_SPINDLE, P.TOOL_PATH),),
    (P.TOOL_COPY, 2): ((P.TOOL_REQUESTED, P.TOOL_PATH),),
}
TAKE_REAL_TIME, PUT_BACK = (P.TOOL_TAKE, 2), (P.TOOL_PUT_BACK, 1)


def told(number: int) -> bool:
    """True for a parameter of a record that reads 0 without a tool (T0)."""
    return P.TOOL_REQUESTED <= number < P.TOOL_REAL_TIME + SIZE and (number - P.TOOL_REQUESTED) % SIZE <= QUADRANT


class Tools:
    """The tools of a control; all their data are in its parameters."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._radius: tuple[int, float] = (-1, 0.0)
        """Cache: revision of the parameters and the radius at it, for every block asks."""

    @property
    def radius_mm(self) -> float:
        """Of the path's tool, corrected, minus the teach tool's; negative: the other side."""
        p = self._parameters
        if self._radius[0] != p.revision:
            radius = p.get(P.TOOL_PATH + RADIUS) + p.get(P.TOOL_PATH + RADIUS_CORRECTION) - p.get(P.TEACH_RADIUS)
            self._radius = p.revision, radius
        return self._radius[1]

    @property
    def length_mm(self) -> float:
        """Of the path's tool, corrected."""
        return self._parameters.get(P.TOOL_PATH + LENGTH) + self._parameters.get(P.TOOL_PATH + LENGTH_CORRECTION)

    def address(self, number: int, sub_record: int = 0) -> int:
        """First parameter of an entry of the table, or of its sub record; both from 1 (manual, q177)."""
        p = self._parameters
        size = int(p.given(Q.TOOL_SIZE, 20.0, "q"))
        first = int(p.get(Q.TOOL_TABLE, 21_000, "q")) + (number - 1) * size
        if not sub_record:
            return first
        each = (size - SUB_RECORDS) // int(p.given(Q.TOOL_SUB_RECORDS, 1.0, "q"))
        return first + SUB_RECORDS + (sub_record - 1) * each

    def find(self, group: int) -> int:
        """Place in the table, from 1, of a tool of this group that is not worn. Raises ProgramError: M1225 no table,
        M1050 no such group, M1053 all its tools are worn, M1232 it is one for lathes."""
        p = self._parameters
        if not p.loaded(Q.TOOL_TABLE, "q") or not self._count:
            raise ProgramError(Code.NO_TOOL_TABLE)
        worn = False
        for number in range(1, self._count + 1):
            first = self.address(number)
            if p.loaded(first) and p.get(first) == group:
                lives = not p.get(first + LIFE_SET) or p.get(first + LIFE) < p.get(first + LIFE_SET)
                if lives and p.get(first + WORN) != 1.0:
                    if LATHE[0] <= p.get(first + KIND) <= LATHE[1]:
                        kind = f"T{group} is of type {p.get(first + KIND):g}"
                        raise ProgramError(Code.EXCLUDED, f"{MISSING}: tools for lathes, and {kind}")
                    return number
                worn = True
        raise ProgramError(Code.TOOL_WORN if worn else Code.NO_TOOL, f"T{group}")

    @property
    def _count(self) -> int:
        return max(int(self._parameters.get(Q.TOOLS, 0.0, "q")), 0)

    def request(self, group: int) -> None:
        """T: the entry, or the spindle's record, goes to the PLC's record. Raises as `find` does."""
        if group == 0:
            self._clear(P.TOOL_REQUESTED)
        elif self._parameters.get(P.TOOL_SPINDLE) == group:
            self.copy(P.TOOL_SPINDLE, P.TOOL_REQUESTED)
        else:
            self._fetch(self.find(group), P.TOOL_REQUESTED)

    def requested(self) -> list[tuple[int, float | None]]:
        """Parameters to write to the real-time record when the block of the last `request` is executed."""
        p = self._parameters
        values = (p.get(P.TOOL_REQUESTED + n) if p.loaded(P.TOOL_REQUESTED + n) else None for n in range(SIZE))
        return [(P.TOOL_REAL_TIME + n, value) for n, value in enumerate(values)]

    def request_in_hand(self, group: int) -> None:
        """P8043: `request`, and the record goes to that of the real time, too."""
        self.request(group)
        for number, value in self.requested():
            self._parameters.write(number, value)

    def reckon(self, group: int) -> None:
        """T with M16: the entry goes to the path's record. Raises as `find` does."""
        if group == 0:
            self._clear(P.TOOL_PATH)
        else:
            self._fetch(self.find(group), P.TOOL_PATH)

    def change(self) -> None:
        """M06 is acknowledged: the old tool goes to the table, the requested one to spindle and path (bwo900/23)."""
        self.put_back()
        self.copy(P.TOOL_REQUESTED, P.TOOL_SPINDLE)
        self.copy(P.TOOL_REQUESTED, P.TOOL_PATH)

    def put_back(self) -> None:
        """The spindle's record goes back to its place in the table, and is cleared; nothing for T0."""
        group = int(self._parameters.get(P.TOOL_SPINDLE))
        if not group:
            return
        if (number := self._entry(group)) is not None:
            for offset in range(self._size):
                self._move(P.TOOL_SPINDLE + offset, self.address(number) + offset)
        self._clear(P.TOOL_SPINDLE)

    def _entry(self, group: int) -> int | None:
        """Place in the table of the tool in the spindle: P8101, or else the first of its group."""
        p = self._parameters
        own = int(p.get(P.TOOL_SPINDLE + NUMBER))
        if 1 <= own <= self._count:
            return own
        return next((n for n in range(1, self._count + 1) if p.get(self.address(n)) == group), None)

    def command(self, number: int, value: float | None, *, in_hand: bool = False) -> None:
        """A parameter has been written: P8045 to P8047 copy records; the command is byte 1. in_hand: mode HAND."""
        command = number, byte(value or 0.0, 1)
        for source, target in COPIES.get(command, ()):
            self.copy(source, target)
        if command == TAKE_REAL_TIME:
            self._take_real_time(in_hand=in_hand)
        elif command == PUT_BACK:
            self.put_back()

    def _take_real_time(self, *, in_hand: bool) -> None:
        """P8045 = 2: the real-time record goes to the spindle, its place in the magazine is empty, and T is free
        again."""
        p = self._parameters
        self.copy(P.TOOL_REAL_TIME, P.TOOL_SPINDLE)
        p.write(P.TOOL_LOCK, 0.0)
        if in_hand:
            self.copy(P.TOOL_SPINDLE, P.TOOL_PATH)
        if (number := self._entry(int(p.get(P.TOOL_SPINDLE)))) is not None:
            p.write(self.address(number) + PLACE, 0.0)

    def end(self) -> None:
        """The program has ended: the path's tool is that of the spindle."""
        self.copy(P.TOOL_SPINDLE, P.TOOL_PATH)

    def copy(self, source: int, target: int) -> None:
        """Copy a record."""
        for offset in range(SIZE):
            self._move(source + offset, target + offset)

    @property
    def _size(self) -> int:
        return min(int(self._parameters.given(Q.TOOL_SIZE, 20.0, "q")), SIZE)

    def _fetch(self, number: int, target: int) -> None:
        """Copy an entry of the table to a record, with its number."""
        self._clear(target)
        for offset in range(self._size):
            self._move(self.address(number) + offset, target + offset)
        self._parameters.write(target + NUMBER, float(number))

    def _clear(self, first: int) -> None:
        for offset in range(SIZE):
            self._parameters.write(first + offset, 0.0 if offset <= QUADRANT else None)

    def _move(self, source: int, target: int) -> None:
        p = self._parameters
        p.write(target, p.get(source) if p.loaded(source) else None)
