"""M26: a signal deletes the rest of a path or a dwell, and positions of the axes are stored (manual 6.1.7, 8.5, 8.7).

P8715 = 1, or the probe (e0.6) as P12045 of a moving axis releases it --> the path brakes, the next block comes

P8695    -1: a block with M26 has begun    number of the block: it was deleted    0: P8715 = 0
P12153   of each axis: stored position in mm, of the machine; P8855, byte 1 = 1: of the display
P12181   byte 1: stored since the last M26; byte 2: the probe
P8716    1: store now, without deleting anything; P8696 is the block's number, 0 with P8716 = 0
P8717    1: store at the next edge of the probe, 2: at each; P8696 is -1 until then. P12131, byte 3: of one axis
P8895    bits of the axes that take part; 0: all of them

P12045   byte 1, 2 = 1: released in +, in -; byte 4, bit 0: while the probe is off; deleted: both, while it is on
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte, of_axis
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes
from isel_twin.firmware.bwo900.realtime.executed import Executed

PROBE: Final = "e0.6"
ONCE, ALWAYS = 1.0, 2.0  # P8717


class DeletionWatch:
    """Detects the signal that deletes a path, and stores positions of the axes."""

    def __init__(self, parameters: Parameters, levels: Mapping[str, bool], axes: Axes, executed: Executed) -> None:
        """levels: of the inputs, kept up to date by the caller."""
        self._parameters, self._levels, self._axes, self._executed = parameters, levels, axes, executed
        self.place: tuple[float, ...] | None = None
        """Where the axes were at the signal of the last block with M26, machine coordinates; None: there was none."""

    def begins(self) -> None:
        self.place = None
        self._parameters.write(P.DELETED, -1.0)
        for axis in range(AXES):
            self._state(axis, taken=False)

    def deletes(self, block: PathBlock) -> bool:
        """True if a signal, P8715 or the probe, deletes the path or dwell of a block with M26."""
        return bool(self._parameters.get(P.DELETE)) or self._probed(block)

    def deleted(self) -> None:
        self.place = tuple(self._axes.actual_mm(axis) for axis in range(AXES))
        self._parameters.write(P.DELETED, float(self._executed.place[1]))
        self.keep()

    def keep(self) -> None:
        mask = int(self._parameters.get(P.KEEP_MASK))
        for axis in range(AXES):
            if mask <= 0 or mask >> axis & 1:
                self.take(axis)

    def take(self, axis: int) -> None:
        """Store the position of one axis."""
        shown = bool(byte(self._parameters.get(P.MEASURED_DISPLAY), 1))
        shift_mm = self._executed.display_shift_mm(axis) if shown else 0.0
        self._parameters.write(of_axis(axis, Axis.MEASURED_PLACE), self._axes.actual_mm(axis) - shift_mm)
        self._state(axis, taken=True)

    def written(self, number: int, value: float | None) -> None:
        """Take a written parameter P: P8715 and P8716 are signals."""
        if number == P.DELETE and not value:
            self._parameters.write(P.DELETED, 0.0)
        elif number == P.KEEP:
            if value == 1.0:
                self.keep()
            self._parameters.write(P.KEPT, float(self._executed.place[1]) if value == 1.0 else 0.0)
        elif number == P.RELEASE and value in (ONCE, ALWAYS):
            self._parameters.write(P.KEPT, -1.0)

    def touched(self) -> None:
        """Take a change of the probe: P12181 has its level, and positions are stored where P8717 or P12131 releases
        it."""
        p = self._parameters
        for axis in range(AXES):
            taken = bool(byte(p.axis(axis, Axis.MEASURED, 0.0), 1))
            self._state(axis, taken=taken)
            if byte(p.axis(axis, Axis.MEASURE, 0.0), 3) and not taken and self.acts(axis):
                self.take(axis)
        released = p.get(P.RELEASE)
        if released in (ONCE, ALWAYS) and any(self.acts(axis) for axis in range(AXES)):
            self.keep()
            p.write(P.KEPT, float(self._executed.place[1]))
            if released == ONCE:
                p.write(P.RELEASE, 0.0)

    def _state(self, axis: int, *, taken: bool) -> None:
        probe = self._levels.get(PROBE, False)
        self._parameters.write(of_axis(axis, Axis.MEASURED), float(taken | probe << 8))

    def _probed(self, block: PathBlock) -> bool:
        """True if the probe is enabled for an axis in its direction of motion; without a path for any axis."""
        ways = [b - a for a, b in zip(block.elements[0].start, block.finish, strict=True)] if block.elements else []
        for axis in range(AXES):
            way = ways[axis] if ways else 0.0
            if (way or not ways) and self.acts(axis, way):
                return True
        return False

    def acts(self, axis: int, way: float = 0.0) -> bool:
        """True if the probe acts for an axis, as P12045 has it, on a way in + or -; 0: in either."""
        forth, back, opens = self._logic(axis)
        if self._levels.get(PROBE, False) is opens:
            return False
        return (forth and way >= 0.0) or (back and way <= 0.0)

    def _logic(self, axis: int) -> tuple[bool, bool, bool]:
        """P12045 of an axis: the probe acts in +, in -; True if it acts while it is off."""
        number = of_axis(axis, Axis.PROBE_LOGIC)
        if not self._parameters.loaded(number):
            return True, True, False
        value = self._parameters.get(number)
        return bool(byte(value, 1) & 1), bool(byte(value, 2) & 1), bool(byte(value, 4) & 1)
