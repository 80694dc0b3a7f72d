"""The first spindle: programmed speed, what its drive is told, whether it has reached it (manual 3.8, 4.28, 8.6).

    S, G96, G97 of the block in execution --> n --> override 2, highest speed --> output spindle_speed --> drive
    M03, M04, M05 --> PLC: A 0.0, A 0.1 ------------------^                                                 |
    paths with feed wait <-- reached: |measured - n| <= P11653 <-------------------------- measured speed --+

    G97    n = S               1/min; with P11646 = 1 degrees a minute; at most P11645
    G96    n = v / (pi d)      v = S mm/min, times P11643; d twice the place of axis P11641, or P11642; at most P11644

Only on a machine with a spindle that it can measure; without one S is a number for the PLC (bwo900/81).
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.firmware.bwo900.geometry.blocks import MFunction, PathBlock
from isel_twin.firmware.bwo900.geometry.elements import Point
from isel_twin.firmware.bwo900.machine_plc import MachinePlc
from isel_twin.firmware.bwo900.numbers import G, M, P
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.realtime import overrides
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes

LOOK_NS: Final = 8 * MILLISECOND_NS  # between two looks at the measured speed, and at the place of G96
TOLERANCE: Final = 0.05  # P11653 unless set: part of the programmed speed
PATIENCE_NS: Final = 60 * SECOND_NS  # that a cycle waits: M8303
LEAST_MM: Final = 1e-3  # diameter at which G96 has its highest speed at the latest
FASTEST: Final = 100_000.0  # rev/min that a drive can be told
SECOND_OVERRIDE: Final = 2  # the panel's second potentiometer (bwo900/51)
DEGREES: Final = 360.0


class Spindle:
    def __init__(self, parameters: Parameters, axes: Axes, plc: MachinePlc) -> None:
        self._parameters, self._axes, self._plc = parameters, axes, plc
        self.present = False
        """The machine has one, whose speed can be measured."""
        self._programmed = 0.0  # S
        self._kind: int = G.TURNS_PER_MINUTE
        self._shift_mm: Point = (0.0,) * AXES  # machine place minus program place, for G96

    def look_for(self) -> None:
        """Power-on: look whether there is one."""
        self.present = self._axes.drives is not None and self._axes.drives.spindle_rev_min is not None
        self._parameters.has_spindle = self.present

    def take(self, block: PathBlock) -> None:
        """A block begins: its S, G96 or G97, and zero point."""
        self._kind = block.in_force.modal.speed
        self._programmed = block.speeds.get(1, self._programmed)
        frame = block.in_force.frame
        self._shift_mm = tuple(zero + shift for zero, shift in zip(frame.zero, frame.shift, strict=True))

    @property
    def next_ns(self) -> int | None:
        """While axes move at a constant cutting speed, the next time to change the speed."""
        follows = self.present and self._kind == G.CUTTING_SPEED and self._plc.spindle and self._axes.run is not None
        return (self._axes.now_ns // LOOK_NS + 1) * LOOK_NS if follows else None

    @property
    def measured(self) -> float:
        """Speed in 1/min, signed."""
        drives = self._axes.drives
        return 0.0 if drives is None else drives.spindle_rev_min or 0.0

    @property
    def wanted(self) -> int:
        """Speed that the drive is told (bwo900/83), 1/min: positive M03, negative M04, 0 off."""
        if not self._plc.spindle:
            return 0
        speed = self._turns() * overrides.percent(self._parameters, SECOND_OVERRIDE) / 100.0
        return round(min(speed, FASTEST)) * self._plc.spindle

    def _turns(self) -> float:
        p = self._parameters
        if self._kind == G.CUTTING_SPEED:
            speed = self._programmed * p.given(P.CUTTING_FACTOR, 1.0) / (math.pi * max(self._diameter_mm(), LEAST_MM))
            most = p.get(P.MOST_CUTTING)
        else:
            speed = self._programmed / (DEGREES if p.get(P.TURNS_FACTOR) == 1.0 else 1.0)
            most = p.get(P.MOST_TURNS)
        return max(min(speed, most) if most > 0.0 else speed, 0.0)

    def _diameter_mm(self) -> float:
        axis = int(self._parameters.get(P.CUTTING_AXIS)) - 1
        if 0 <= axis < AXES:
            return 2.0 * abs(self._axes.position[axis] - self._shift_mm[axis])
        return abs(self._parameters.get(P.CUTTING_PLACE))

    @property
    def ready(self) -> bool:
        """True if a path with feed may begin: M functions are acknowledged, and the speed is reached."""
        return not self.present or (self._plc.idle and self.reached)

    @property
    def reached(self) -> bool:
        wanted = self.wanted
        percent = self._parameters.get(P.SPEED_TOLERANCE)
        tolerance = percent / 100.0 if percent > 0.0 else TOLERANCE
        return not wanted or abs(self.measured - wanted) <= tolerance * abs(wanted)

    def value(self, number: int) -> float | None:
        """P11648 to P11651; None: not one of them, or no spindle."""
        if not self.present:
            return None
        measured = abs(self.measured)
        match number:
            case P.SPEED_PROGRAMMED:
                return self._programmed
            case P.SPEED_MEASURED:
                if self._kind == G.CUTTING_SPEED:
                    cut = measured * math.pi * self._diameter_mm()
                    return cut / self._parameters.given(P.CUTTING_FACTOR, 1.0)
                return measured * (DEGREES if self._parameters.get(P.TURNS_FACTOR) == 1.0 else 1.0)
            case P.SPINDLE_SENSE:
                return float(self._plc.spindle)
            case P.SPINDLE_STATE:
                stands = measured < self._parameters.get(P.STANDSTILL)
                return (self.wanted != 0 and self.reached) + 65_536.0 * (measured >= 1.0) + 16_777_216.0 * stands
        return None


NUMBERS: Final = (P.SPEED_PROGRAMMED, P.SPEED_MEASURED, P.SPINDLE_SENSE, P.SPINDLE_STATE)
"""Parameters that `Spindle.value` knows."""


def commands(functions: Iterable[MFunction], block: PathBlock) -> bool:
    """True if these functions or the block's S change the speed or the sense of the spindle."""
    switches = (M.SPINDLE_RIGHT, M.SPINDLE_LEFT, M.SPINDLE_OFF)
    return bool(block.speeds) or any(function.code in switches for function in functions)
