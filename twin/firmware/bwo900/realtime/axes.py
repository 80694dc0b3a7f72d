"""The axes: positions, limits, following errors.

    counts = base + displacement of the run in execution        increments, from the reference point's P12040 on
    position = counts / increments per mm                        P12012 / P12013

A run that does not continue the one before begins at the present positions.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from typing import Final

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.controller import Drives
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte, of_axis
from isel_twin.firmware.bwo900.realtime.lag import LagWatch, window_mm
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, positive
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.motion import SetPointRun

AXES: Final = 3
NAMES: Final = "XYZ"
INCREMENTS_PER_MM: Final = 1_000.0  # P12012 over P12013 if unset
SETTLE_MS: Final = 3_000.0  # P12018 if unset
COARSEST, FINEST = 1e-3, 1e6  # range of increments per mm of a measuring system
ABRUPT: Final = 1e9  # factor of a ramp that is over within less than a nanosecond
PULSES: Final = 5_000  # increments from zero pulse to zero pulse


class Axes:
    def __init__(self, parameters: Parameters, levels: Mapping[str, bool]) -> None:
        """levels: of the inputs, including limit switches, kept up to date by the caller."""
        self._parameters, self._levels = parameters, levels
        self.drives: Drives | None = None
        """Encoders; None: there are none, and the axes stand exactly at their set positions."""
        self.referenced = [False] * AXES
        self.run: SetPointRun | None = None
        self._base: tuple[int, ...] = (0,) * AXES
        self._set: tuple[int, ...] = (0,) * AXES  # what P12110 has added, in increments
        self.now_ns = 0
        self._watch = LagWatch(parameters)
        # the counts last worked out: run, base and time, and the counts; those of now are asked for many times
        self._counted: tuple[object, object, int, tuple[int, ...]] = None, None, 0, ()
        self._locks: tuple[int, Mapping[tuple[int, int], bool]] = (-1, {})  # revision, and the directions locked at it
        self._stops: tuple[int, list[float]] = (-1, [])  # revision, and the exact-stop windows at it, mm
        self._known: tuple[int, MotionLimits] | None = None
        """The limits, and the revision of the parameters they were made from."""

    def counts_at(self, t_ns: int) -> tuple[int, ...]:
        """Set positions in increments, at a time within the run in execution."""
        if self.run is None:
            return self._base
        return tuple(b + m for b, m in zip(self._base, self.run.displacement(t_ns), strict=True))

    @property
    def counts(self) -> tuple[int, ...]:
        run, base, now_ns, counts = self._counted
        if run is not self.run or base is not self._base or now_ns != self.now_ns:
            counts = self.counts_at(self.now_ns)
            self._counted = self.run, self._base, self.now_ns, counts
        return counts

    @property
    def position(self) -> tuple[float, ...]:
        per_mm = self.limits().increments_per_mm
        return tuple(count / per for count, per in zip(self.counts, per_mm, strict=True))

    def actual_mm(self, axis: int) -> float:
        """Measured position of an axis, mm."""
        drives, per_mm = self.drives, self.limits().increments_per_mm[axis]
        return self.position[axis] if drives is None else drives.encoder[axis] / per_mm

    def speed_mm_s(self, axis: int) -> float:
        """Set speed of an axis, mm/s."""
        run = self.run
        if run is None or not (tick := run.count(self.now_ns)) or self.now_ns >= run.end_ns + PERIOD_NS:
            return 0.0
        way = int(run.plan.deltas(tick - 1, tick)[0, axis])
        return way / self.limits().increments_per_mm[axis] / (PERIOD_NS / SECOND_NS)

    def actual_mm_s(self, axis: int) -> float:
        """Measured speed of an axis, mm/s."""
        drives, per_mm = self.drives, self.limits().increments_per_mm[axis]
        return self.speed_mm_s(axis) if drives is None else drives.speed[axis] / per_mm

    def at_limit(self, axis: int) -> tuple[bool, bool]:
        """True if an axis is at its software limit + (P12030), - (P12031), or beyond."""
        place, (low, high) = self.position[axis], self.software_limits(axis)
        return place >= high, place <= low

    def driven(self, axis: int) -> bool:
        """True if an axis moves or is not yet within its exact-stop window."""
        moving = self.run is not None and self.now_ns < self.run.end_ns and self.speed_mm_s(axis) != 0.0
        return moving or axis in self.unsettled()

    def follow(self, run: SetPointRun | None) -> None:
        shown = self.run
        if run is shown:
            return
        if shown is not None and (run is None or not run.continues(shown)):
            self._base = self.counts
        self.run = run

    def place(self, axis: int, past: int = 0) -> int:
        """Set the position of an axis that stands `past` increments behind its reference point, which is at P12040, and
        return it in increments."""
        self.follow(None)
        point = self._parameters.axis(axis, Axis.REFERENCE_MM, 0.0) * self.limits().increments_per_mm[axis]
        value = round(point) + past
        self._base = (*self._base[:axis], value, *self._base[axis + 1 :])
        self._set = (*self._set[:axis], 0, *self._set[axis + 1 :])
        self.referenced[axis] = True
        return value

    def set_place(self, axis: int, mm: float | None) -> int:
        """Set the position of an axis that stands, or with None take that back (P12110); return it in increments."""
        self.follow(None)
        mechanical = self._base[axis] - self._set[axis]
        value = mechanical if mm is None else round(mm * self.limits().increments_per_mm[axis])
        self._base = (*self._base[:axis], value, *self._base[axis + 1 :])
        self._set = (*self._set[:axis], value - mechanical, *self._set[axis + 1 :])
        return value

    def set_mm(self, axis: int) -> float:
        """What P12110 has added to the position of an axis, mm."""
        return self._set[axis] / self.limits().increments_per_mm[axis]

    def forget(self, axis: int) -> None:
        self.referenced[axis] = False
        self._parameters.write(of_axis(axis, Axis.REFERENCED), 0.0)

    def to_pulse(self, axis: int) -> int:
        """Increments to the next zero pulse."""
        past = 0 if self.drives is None else self.drives.past_zero_pulse[axis] % PULSES
        return (PULSES - past) % PULSES

    def limits(self) -> MotionLimits:
        """Limits of axes and path by the parameters as they are now; a stretch is planned with them (bwo900/72)."""
        revision = self._parameters.revision
        if self._known is None or self._known[0] != revision:
            self._known = revision, MotionLimits.of(self._parameters, [self._resolution(axis) for axis in range(AXES)])
        return self._known[1]

    def _resolution(self, axis: int) -> float:
        """Increments per mm: P12012 / P12013, or the default for senseless values."""
        p = self._parameters
        per_mm = positive(p.axis(axis, Axis.INCREMENTS, 0.0), INCREMENTS_PER_MM) / positive(
            p.axis(axis, Axis.INCREMENTS_PER, 0.0), 1.0
        )
        return per_mm if COARSEST <= per_mm <= FINEST else INCREMENTS_PER_MM

    def unsettled(self) -> list[int]:
        """Axes outside the exact-stop window."""
        if (drives := self.drives) is None:
            return []
        per_mm, in_position, lag = self.limits().increments_per_mm, drives.in_position, drives.lag
        windows = self._windows()
        return [a for a in range(AXES) if not in_position[a] or abs(lag[a]) / per_mm[a] > windows[a]]

    def _windows(self) -> list[float]:
        """The exact-stop windows by the parameters as they are now, mm."""
        revision = self._parameters.revision
        if self._stops[0] != revision:
            all_per_mm = self.limits().increments_per_mm
            self._stops = revision, [window_mm(self._parameters, axis, per) for axis, per in enumerate(all_per_mm)]
        return self._stops[1]

    def settling_ns(self, axis: int) -> int:
        """Time limit for an axis to reach its window: P12018."""
        return round(min(positive(self._parameters.axis(axis, Axis.SETTLING_MS, 0.0), SETTLE_MS), 1e9) * MILLISECOND_NS)

    def late(self) -> int | None:
        """Check the following errors while something moves; return an axis that does not follow."""
        if self.run is None or self.drives is None:
            self._watch.end()
            return None
        if self._watch.due_ns is None:
            self._watch.begin(self.now_ns, self.counts)
        if not self._watch.is_due(self.now_ns):
            return None
        return self._watch.look(self.now_ns, self.counts, self.drives.lag, self.limits().increments_per_mm)

    def lags(self, axis: int) -> bool:
        """True if the following error of an axis is too large at this moment."""
        if self.drives is None:
            return False
        return self._watch.exceeds(axis, self.drives.lag[axis], self.limits().increments_per_mm)

    @property
    def next_look_ns(self) -> int | None:
        return self._watch.due_ns

    def struck(self, axis: int, end: int) -> bool:
        """True if the switch at the motor's end (1) or the far end (2) of an axis is struck."""
        return not self._levels.get(f"limit_{'xyz'[axis]}{end}", True)

    def barred(self, axis: int, sign: int) -> bool:
        """True if P12137 locks that direction of an axis: byte 1 +, byte 2 -."""
        return (axis, sign) in self._barred()

    def _barred(self) -> Mapping[tuple[int, int], bool]:
        """Directions that P12137 locks, and whether without ramps (byte 3)."""
        revision = self._parameters.revision
        if self._locks[0] != revision:
            given = [self._parameters.axis(axis, Axis.BARRED, 0.0) for axis in range(AXES)]
            ways = ((a, sign, bits) for a, bits in enumerate(given) for n, sign in ((1, 1), (2, -1)) if byte(bits, n))
            self._locks = revision, {(a, sign): bool(byte(bits, 3)) for a, sign, bits in ways}
        return self._locks[1]

    def bars(self, block: PathBlock) -> bool:
        """True if a block goes in a direction that is locked, or moves an axis of P8891."""
        locked = int(self._parameters.get(P.BLOCK_LOCK))
        both = [(axis, sign) for axis in range(AXES) if locked >> axis & 1 for sign in (1, -1)]
        return any(_goes(block, *way) for way in (*self._barred(), *both))

    @property
    def released(self) -> bool:
        """P8701 is not 0; deleted it is as good as 1."""
        return self._parameters.get(P.TRAVEL_RELEASE, 1.0) != 0.0

    @property
    def halts_at_once(self) -> bool:
        """True if a lock wants a halt without ramps."""
        return not self.released or any(self._barred().values())

    def sharpness(self, axis: int, sign: int) -> float:
        """Factor of the ramp with which an axis brakes that moves this way: none where a lock wants none (P8701, byte 3
        of P12137), unless `Readings.ramped_halts`."""
        return self.sharp(not self.released or self._barred().get((axis, sign), False))

    def path_sharpness(self, blocks: Iterable[PathBlock]) -> float:
        """The same of these blocks."""
        ways = [way for way, without_ramp in self._barred().items() if without_ramp]
        return self.sharp(not self.released or any(_goes(block, *way) for block in blocks for way in ways))

    def sharp(self, without_ramp: bool) -> float:
        """Factor of a ramp, or of none at all."""
        return ABRUPT if without_ramp and not self._parameters.readings.ramped_halts else 1.0

    def obstacle(self, block: PathBlock) -> ProgramError | None:
        """The error that forbids the path of a block: a software limit (P12030, P12031) or a struck switch
        (bwo900/18)."""
        for axis in range(AXES) if block.elements else ():
            extents = [element.extent(axis) for element in block.elements]
            low, high = min(e[0] for e in extents), max(e[1] for e in extents)
            here, (lowest, highest) = block.elements[0].start[axis], self.software_limits(axis)
            if high > highest:
                return ProgramError(Code.SOFTWARE_LIMIT_HIGH, NAMES[axis])
            if low < lowest:
                return ProgramError(Code.SOFTWARE_LIMIT_LOW, NAMES[axis])
            if high > here and self.struck(axis, 2):
                return ProgramError(Code.HARDWARE_LIMIT_HIGH, NAMES[axis])
            if low < here and self.struck(axis, 1):
                return ProgramError(Code.HARDWARE_LIMIT_LOW, NAMES[axis])
        return None

    def software_limits(self, axis: int) -> tuple[float, float]:
        """P12031 and P12030 where the axis is set (P12110), mm; infinite where they are deleted."""
        p, low, high = self._parameters, of_axis(axis, Axis.LIMIT_LOW), of_axis(axis, Axis.LIMIT_HIGH)
        shift = self.set_mm(axis)
        lowest, highest = p.get(low) if p.loaded(low) else -math.inf, p.get(high) if p.loaded(high) else math.inf
        return lowest + shift, highest + shift


def _goes(block: PathBlock, axis: int, sign: int) -> bool:
    """True if a block moves an axis that way, even in a part of an arc."""
    for element in block.elements:
        low, high = element.extent(axis)
        here, there = element.start[axis], element.end[axis]
        if (high > here or there > low) if sign > 0 else (low < here or there < high):
            return True
    return False
