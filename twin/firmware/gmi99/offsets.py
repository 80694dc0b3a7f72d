"""Zero points and corrections, which are added to programmed positions (3.1.1 G, 6.1.3 FB 254).

    machine target = programmed target (absolute) + zero point + fine correction + temporary ones + PLC zero point

One table has 16 zero points; G54 to G57 are the first four. No command sets tool offsets, so they are 0 (gmi99/13).
"""

from __future__ import annotations

from isel_twin.firmware.gmi99.settings import SLOTS

PLC_ZERO_LIMIT = 1000


class Offsets:
    def __init__(self, zero_points: tuple[tuple[int, ...], ...], fine: tuple[tuple[int, ...], ...]) -> None:
        self.zero_points = [list(values) for values in zero_points]
        self.fine = [list(values) for values in fine]
        self.temporary = {58: [0] * SLOTS, 59: [0] * SLOTS}
        self.plc_zero = [0] * SLOTS
        self.preselected = 0  # number of the fine correction the PLC has chosen (Vx, FB 254.5)
        self._active: tuple[int, int | None] | None = None
        self._last: tuple[int, int | None] | None = None

    def total(self, axis: int) -> int:
        """Sum of all offsets in force for an axis, in increments."""
        zero = 0
        if self._active is not None:
            number, fine = self._active
            zero = self.zero_points[number][axis] + (0 if fine is None else self.fine[fine][axis])
        return zero + self.temporary[58][axis] + self.temporary[59][axis] + self.plc_zero[axis]

    def select(self, number: int, fine: int | None) -> None:
        self._active = self._last = (number, fine)

    def select_again(self) -> None:
        """Select the last zero point again."""
        self._active = self._last

    def deselect(self) -> None:
        self._active = None
