"""M26: a signal deletes what is left of a path or of a dwell, and where the axes were is kept (manual 6.1.7, 8.5, 8.7).

P8715 = 1, or the probe (e0.6) as P12045 of a moving axis releases it --> the path brakes, the next block comes

P8695    -1: a block with M26 has begun    number of the block: it was deleted    0: P8715 = 0
P12153   of each axis: where it was, mm, of the machine; P8855, byte 1 = 1: of the display
P12181   byte 1: it has been kept since the last M26; byte 2: the probe
P8716    1: keep it now, without deleting anything; P8696 is the block's number, 0 with P8716 = 0
P8895    bits of the axes that take part; 0: all of them

P12045   byte 1, 2 = 1: released in +, in -; byte 4, bit 0: while the probe is off; deleted: both, while it is on
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Final

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte, of_axis

PROBE: Final = "e0.6"
"""Terminal of the probe."""


class Watch:
    """What is watched for, and what it leaves behind."""

    def __init__(
        self,
        parameters: Parameters,
        levels: Mapping[str, bool],
        places_mm: Callable[[], Sequence[tuple[float, float]]],
        block: Callable[[], tuple[str, int]],
    ) -> None:
        """levels: of inputs. places_mm: of each axis, measured: in the machine, on the display. block: in execution."""
        self._parameters, self._levels, self._places_mm, self._block = parameters, levels, places_mm, block

    def begins(self) -> None:
        """A block with M26 begins."""
        self._parameters.write(P.DELETED, -1.0)
        for axis, _ in enumerate(self._places_mm()):
            self._state(axis, taken=False)

    def deletes(self, block: PathBlock) -> bool:
        """Whether the signal is there that deletes the path or the dwell of a block with M26."""
        return bool(self._parameters.get(P.DELETE)) or self._probed(block)

    def deleted(self) -> None:
        """A path or a dwell has been deleted."""
        self._parameters.write(P.DELETED, float(self._block()[1]))
        self.keep()

    def keep(self) -> None:
        """Where the axes are is kept."""
        p = self._parameters
        mask, shown = int(p.get(P.KEEP_MASK)), bool(byte(p.get(P.MEASURED_DISPLAY), 1))
        for axis, (machine_mm, display_mm) in enumerate(self._places_mm()):
            if mask <= 0 or mask >> axis & 1:
                p.write(of_axis(axis, Axis.MEASURED_PLACE), display_mm if shown else machine_mm)
                self._state(axis, taken=True)

    def written(self, number: int, value: float | None) -> None:
        """A parameter P was written: some are signals."""
        if number == P.DELETE and not value:
            self._parameters.write(P.DELETED, 0.0)
        elif number == P.KEEP:
            if value == 1.0:
                self.keep()
            self._parameters.write(P.KEPT, float(self._block()[1]) if value == 1.0 else 0.0)

    def touched(self) -> None:
        """The probe has changed."""
        for axis, _ in enumerate(self._places_mm()):
            self._state(axis, taken=bool(int(self._parameters.get(of_axis(axis, Axis.MEASURED))) & 1))

    def _state(self, axis: int, *, taken: bool) -> None:
        probe = self._levels.get(PROBE, False)
        self._parameters.write(of_axis(axis, Axis.MEASURED), float(taken | probe << 8))

    def _probed(self, block: PathBlock) -> bool:
        """Whether the probe is as an axis that the block moves is released for; without a path any axis counts."""
        probe = self._levels.get(PROBE, False)
        ways = [b - a for a, b in zip(block.elements[0].start, block.finish, strict=True)] if block.elements else []
        for axis, _ in enumerate(self._places_mm()):
            forth, back, opens = self._logic(axis)
            if probe is opens:
                continue
            way = ways[axis] if ways else 0.0
            if (forth and way > 0.0) or (back and way < 0.0) or (not ways and (forth or back)):
                return True
        return False

    def _logic(self, axis: int) -> tuple[bool, bool, bool]:
        """Released in +, in -; and whether it acts while it is off."""
        number = of_axis(axis, Axis.PROBE_LOGIC)
        if not self._parameters.loaded(number):
            return True, True, False
        value = self._parameters.get(number)
        return bool(byte(value, 1) & 1), bool(byte(value, 2) & 1), bool(byte(value, 4) & 1)
