"""Tools: the table, and the records that programs, PLC and path work with (manual 7.1; 8.3 q175 to q179).

    table (q175 ...) --- T ---> P8050 requested, PLC --- change ---> P8100 in the spindle, P8150 for the path
                        `--- T .. M16 ------------------------------------------------------------^

A record has 50 parameters: 0 group, 1 number, 10 radius, 11 length, 12 and 13 their corrections, 14 quadrant.
"""

from __future__ import annotations

from typing import Final

from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.parameters import Parameters

__all__ = ["PATH", "REQUESTED", "SPINDLE", "Tools", "told"]

REQUESTED: Final = 8_050
"""First parameter of the record for the PLC: the tool that T has asked for."""
SPINDLE: Final = 8_100
"""Of the tool in the spindle."""
PATH: Final = 8_150
"""Of the one that is reckoned with."""
SIZE: Final = 50
GROUP, LIFE_SET, LIFE, RADIUS, LENGTH, RADIUS_CORRECTION, LENGTH_CORRECTION, QUADRANT = 0, 6, 7, 10, 11, 12, 13, 14
SUB_RECORDS: Final = 8
"""Where the sub records of an entry begin."""
TEACH_RADIUS: Final = 8_748


def told(number: int) -> bool:
    """Whether a parameter is one of those of a record that have a value without a tool, too: 0, as of T0."""
    return REQUESTED <= number < PATH + SIZE and (number - REQUESTED) % SIZE <= QUADRANT


class Tools:
    """The tools of a control, all of it in its parameters."""

    def __init__(self, parameters: Parameters) -> None:
        self._parameters = parameters
        self._radius: tuple[int, float] = (-1, 0.0)
        """Revision of the parameters, and the radius that they have come to: every block asks for it."""

    @property
    def radius_mm(self) -> float:
        """Of the path's tool, with correction, less that of the teach tool; negative: the other side."""
        p = self._parameters
        if self._radius[0] != p.revision:
            radius = p.get(PATH + RADIUS) + p.get(PATH + RADIUS_CORRECTION) - p.get(TEACH_RADIUS)
            self._radius = p.revision, radius
        return self._radius[1]

    @property
    def length_mm(self) -> float:
        """Of the path's tool, with correction."""
        return self._parameters.get(PATH + LENGTH) + self._parameters.get(PATH + LENGTH_CORRECTION)

    def address(self, number: int, sub_record: int = 0) -> int:
        """First parameter of an entry of the table, from 1; of one of its sub records, from 1 (manual, q177)."""
        p = self._parameters
        size = int(p.given(178, 20.0, "q"))
        first = int(p.get(175, 21_000, "q")) + (number - 1) * size
        if not sub_record:
            return first
        return first + SUB_RECORDS + (sub_record - 1) * ((size - SUB_RECORDS) // int(p.given(177, 1.0, "q")))

    def find(self, group: int) -> int:
        """First parameter of the entry of a tool group.

        Raises ProgramError: M1225 no table, M1050 no such group, M1053 all its tools have lived their time.
        """
        p = self._parameters
        count = int(p.get(176, 0.0, "q"))
        if not p.loaded(175, "q") or count <= 0:
            raise ProgramError(1225)
        worn = False
        for number in range(1, count + 1):
            first = self.address(number)
            if p.loaded(first) and p.get(first) == group:
                if not p.get(first + LIFE_SET) or p.get(first + LIFE) < p.get(first + LIFE_SET):
                    return first
                worn = True
        raise ProgramError(1053 if worn else 1050, f"T{group}")

    def request(self, group: int) -> None:
        """T: the entry goes to the PLC's record; the tool in the spindle comes from there. Raises as `find` does."""
        if group == 0:
            self._clear(REQUESTED)
        elif self._parameters.get(SPINDLE) == group:
            self.copy(SPINDLE, REQUESTED)
        else:
            self._fetch(self.find(group), REQUESTED)

    def reckon(self, group: int) -> None:
        """T with M16: the entry goes to the path's record. Raises as `find` does."""
        if group == 0:
            self._clear(PATH)
        else:
            self._fetch(self.find(group), PATH)

    def change(self) -> None:
        """The requested tool is in the spindle, and reckoned with: P8045 = 1, and the acknowledgement of M06."""
        self.copy(REQUESTED, SPINDLE)
        self.copy(REQUESTED, PATH)

    def put_back(self) -> None:
        """P8047: the spindle's record goes back into the table, and is cleared; nothing for T0."""
        group = int(self._parameters.get(SPINDLE))
        if group:
            first = self.find(group)
            for offset in range(self._size):
                self._move(SPINDLE + offset, first + offset)
        self._clear(SPINDLE)

    def end(self) -> None:
        """The program has ended or was broken off: the tool in the spindle is reckoned with."""
        self.copy(SPINDLE, PATH)

    def copy(self, source: int, target: int) -> None:
        """A whole record to another."""
        for offset in range(SIZE):
            self._move(source + offset, target + offset)

    @property
    def _size(self) -> int:
        return min(int(self._parameters.given(178, 20.0, "q")), SIZE)

    def _fetch(self, first: int, target: int) -> None:
        self._clear(target)
        for offset in range(self._size):
            self._move(first + offset, target + offset)

    def _clear(self, first: int) -> None:
        for offset in range(SIZE):
            self._parameters.write(first + offset, 0.0 if offset <= QUADRANT else None)

    def _move(self, source: int, target: int) -> None:
        p = self._parameters
        p.write(target, p.get(source) if p.loaded(source) else None)
