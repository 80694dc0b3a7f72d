"""HAND: one axis moved by its keys, while they are held or by one step (manual 8.5, P8750 to P8769).

P8751 axis    P8750 1 continuous, 2 step    P8755 speed, mm/min, at most P8754, times the override (P8756, bwo900/54)
P8760 step, mm
P8752 1 +, 2 -: begins; 0: a continuous move brakes. The other kinds (hand wheel, divide, home) are not emulated.

An axis without a reference point that leaves its reference switch in + gets it (2.3.2): P12044, byte 1 allows that,
byte 3 has it at the next zero pulse, or where the switch opens. The axis brakes there; `past` is how far behind it
stands.
"""

from __future__ import annotations

import math
from typing import Final

from isel_twin.firmware.bwo900.messages import Code, ProgramError
from isel_twin.firmware.bwo900.numbers import Axis, P
from isel_twin.firmware.bwo900.parameters import Parameters, byte
from isel_twin.firmware.bwo900.realtime.axes import AXES, NAMES, Axes
from isel_twin.firmware.bwo900.realtime.homing import under_way
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import at_rest

CONTINUOUS, STEP = 1, 2
FURTHEST_MM: Final = 10_000.0  # a continuous move without software limits ends here
SPEED_MM_MIN: Final = 1_000.0  # P8755 if unset
REFERENCE_LOGIC: Final = float(0x00010001)  # P12044 if unset
STEPS_MM: Final = (10.0, 1.0, 0.1, 0.01, 0.001, 0.0, 0.0)  # P8763 to P8769 if unset


def step_mm(parameters: Parameters) -> float:
    """The step: P8760, or the entry of the table at P8762, by default the first."""
    if step := parameters.get(P.STEP):
        return step
    place = min(max(int(parameters.given(P.STEP_POINTER, 1.0)), 1), len(STEPS_MM)) - 1
    return parameters.get(P.STEPS_FIRST + place, STEPS_MM[place])


def step_on(parameters: Parameters) -> None:
    """P8761: select the next step of the table that is not 0, cyclically."""
    place = min(max(int(parameters.given(P.STEP_POINTER, 1.0)), 1), len(STEPS_MM))
    for _ in STEPS_MM:
        place = place % len(STEPS_MM) + 1
        step = parameters.get(P.STEP_POINTER + place, STEPS_MM[place - 1])
        if step > 0.0:
            parameters.write(P.STEP_POINTER, float(place))
            parameters.write(P.STEP, step)
            break
    parameters.write(P.NEXT_STEP, 0.0)


class Jog:
    def __init__(self, parameters: Parameters, axes: Axes, sign: int) -> None:
        """sign: +1, -1; `scale` begins it. Raises ProgramError: M1216 no such axis, M1321 no such
        kind, M2103, M2104 a step would leave the limits."""
        p, limits, counts = parameters, axes.limits(), axes.counts
        axis = int(p.given(P.HAND_AXIS, 1.0)) - 1
        if not 0 <= axis < AXES:
            raise ProgramError(Code.UNKNOWN_AXIS, f"P8751 is {axis + 1}; allowed: 1 to {AXES}")
        kind = int(p.given(P.HAND_KIND, 1.0))
        if kind not in (CONTINUOUS, STEP):
            raise ProgramError(Code.NOT_IN_HAND, f"P8750 is {kind}; there are 1 continuous and 2 step")
        per_mm = limits.increments_per_mm[axis]
        far = axes.software_limits(axis)[sign > 0]
        far = far if math.isfinite(far) else sign * FURTHEST_MM
        here = counts[axis] / per_mm
        way = far - here if kind == CONTINUOUS else sign * step_mm(p)
        if sign * (here + way) > sign * far or (sign * way <= 0.0 and kind == CONTINUOUS):
            raise ProgramError(Code.SOFTWARE_LIMIT_HIGH if sign > 0 else Code.SOFTWARE_LIMIT_LOW, NAMES[axis])
        fastest = min(p.given(P.HAND_FASTEST, limits.hand[axis] * 60.0) / 60.0, limits.hand[axis])
        self.axis, self.sign, self._kind = axis, sign, kind
        self._parameters, self._axes, self._per_mm = p, axes, per_mm
        self._speed_mm_s = min(p.given(P.HAND_FEED, SPEED_MM_MIN) / 60.0, fastest)
        self._acceleration = limits.rapid_acceleration[axis] * per_mm
        self._left = float(round(way * per_mm))  # distance left at the beginning of the present run
        self._override = 0.0
        self._released = False  # the key is released, the axis brakes
        self._seeks = sign > 0 and not axes.referenced[axis] and bool(byte(self._logic, 1))
        self._on_switch = axes.struck(axis, 1)  # it has been struck
        self._point: int | None = None  # where the reference point is, in increments as they count now
        self.over = False
        self.run: SetPointRun | None = None

    @property
    def next_ns(self) -> int | None:
        if self.run is None:
            return None
        seeks = self._point is not None and not self._released
        return min(self.run.end_ns, self._axes.now_ns + PERIOD_NS) if seeks else self.run.end_ns

    @property
    def past(self) -> int | None:
        """How far an axis that stands is behind the reference point it has passed; None: it has passed none."""
        if not self.over or self._point is None:
            return None
        past = self._axes.counts[self.axis] - self._point
        return past if past >= 0 else None

    @property
    def _logic(self) -> float:
        return self._parameters.axis(self.axis, Axis.REFERENCE_LOGIC, REFERENCE_LOGIC)

    def advance(self) -> None:
        run = self.run
        if run is not None and self._seeks:
            self._seek()
        run = self.run
        if run is not None and self._axes.now_ns >= run.end_ns:
            self._left -= float(run.displacement(run.end_ns)[self.axis])
            self.run, self.over = None, self._released or self._override > 0.0

    def _seek(self) -> None:
        """Look whether the reference switch has opened, and whether the point behind it is passed."""
        axes, axis = self._axes, self.axis
        if axes.struck(axis, 1):
            self._on_switch = True
        elif self._on_switch and self._point is None:
            self._point = axes.counts[axis] + (axes.to_pulse(axis) if byte(self._logic, 3) & 1 else 0)
        if self._point is not None and axes.counts[axis] >= self._point and not self._released:
            self.release(everything=True)

    def scale(self, override: float) -> None:
        """Change the override; 0 holds the axis."""
        if self._released:
            return
        self._override = override
        self._parameters.write(P.HAND_FEED_NOW, override * self._speed_mm_s * 60.0)
        speed, now_ns = override * self._speed_mm_s * self._per_mm, self._axes.now_ns
        if self.run is not None:
            plan, tick = under_way(self.run, now_ns)
            if override > 0.0:
                plan = plan.towards(self.axis, tick, self._left, speed)
            else:
                plan = plan.braked(self.axis, tick, self._axes.sharpness(self.axis, self.sign))
            self.run = self.run.with_plan(plan)
        elif override > 0.0:
            plan = at_rest(AXES, PERIOD_NS, self._acceleration, ("jog", now_ns, self.axis))
            self.run = SetPointRun(plan.to(self.axis, 0, self._left, speed), PERIOD_NS, now_ns)

    def release(self, *, everything: bool = False) -> None:
        """Take the release of the key: brake a continuous move; everything: brake a step, too."""
        if self._kind == STEP and not everything:
            return
        self._released = True
        if self.run is None:
            self.over = True
        else:
            plan, tick = under_way(self.run, self._axes.now_ns)
            self.run = self.run.with_plan(plan.braked(self.axis, tick, self._axes.sharpness(self.axis, self.sign)))
