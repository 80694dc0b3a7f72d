"""HAND: one axis moved by its keys, as far as they are held or by one step (manual 8.5, P8750 to P8769).

P8751 axis    P8750 1 continuous, 2 step    P8755 speed, mm/min, at most P8754    P8760 step, mm
P8752 1 +, 2 -: begins; 0: a continuous move brakes. The other kinds (hand wheel, divide, home) are not there.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final

from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.path import Limits
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest

__all__ = ["Jog"]

CONTINUOUS, STEP = 1, 2
FURTHEST_MM: Final = 10_000.0
"""A continuous move without software limits ends here."""
SPEED_MM_MIN: Final = 1_000.0
"""P8755 where nobody has set it."""
STEPS_MM: Final = (10.0, 1.0, 0.1, 0.01, 0.001, 0.0, 0.0)
"""P8763 to P8769 where nobody has set them."""


def step_mm(parameters: Parameters) -> float:
    """The step: P8760, or that of the table that P8762 points to, the first one if it does not."""
    if step := parameters.get(8_760):
        return step
    place = min(max(int(parameters.given(8_762, 1.0)), 1), len(STEPS_MM)) - 1
    return parameters.get(8_763 + place, STEPS_MM[place])


class Jog:
    """A move in HAND."""

    def __init__(
        self, parameters: Parameters, limits: Limits, counts: Sequence[int], sign: int, period_ns: int, now_ns: int
    ) -> None:
        """counts: where the axes stand, increments. sign: +1, -1.

        Raises ProgramError: M1216 no such axis, M1321 no such kind, M2103, M2104 a step would leave the limits.
        """
        p, self._period_ns = parameters, period_ns
        axis = int(p.given(8_751, 1.0)) - 1
        if not 0 <= axis < len(counts):
            raise ProgramError(1216, f"P8751 is {axis + 1}; allowed: 1 to {len(counts)}")
        kind = int(p.given(8_750, 1.0))
        if kind not in (CONTINUOUS, STEP):
            raise ProgramError(1321, f"P8750 is {kind}; there are 1 continuous and 2 step")
        self.axis, self._kind = axis, kind
        per_mm = limits.increments_per_mm[axis]
        high, low = 12_030 + 200 * axis, 12_031 + 200 * axis
        edge = high if sign > 0 else low
        far = p.get(edge) if p.loaded(edge) else sign * FURTHEST_MM
        here = counts[axis] / per_mm
        way = far - here if kind == CONTINUOUS else sign * step_mm(p)
        if sign * (here + way) > sign * far or (sign * way <= 0.0 and kind == CONTINUOUS):
            raise ProgramError(2103 if sign > 0 else 2104, "XYZ"[axis])
        fastest = min(p.given(8_754, limits.hand[axis] * 60.0) / 60.0, limits.hand[axis])
        speed = min(p.given(8_755, SPEED_MM_MIN) / 60.0, fastest)
        p.write(8_756, speed * 60.0)
        plan = at_rest(len(counts), period_ns, limits.rapid_acceleration[axis] * per_mm, ("jog", now_ns, axis))
        plan = plan.to(axis, 0, float(round(way * per_mm)), speed * per_mm)
        self.run: SetPointRun | None = SetPointRun(plan, period_ns, now_ns)

    @property
    def next_ns(self) -> int | None:
        """When `advance` is due."""
        return None if self.run is None else self.run.end_ns

    def advance(self, now_ns: int) -> None:
        """Let time pass."""
        if self.run is not None and now_ns >= self.run.end_ns:
            self.run = None

    def release(self, now_ns: int, *, everything: bool = False) -> None:
        """The key is released: brake, unless it is a step; everything: a step as well."""
        run = self.run
        if run is None or (self._kind == STEP and not everything):
            return
        assert isinstance(run.plan, Indexer)
        tick = max(0, -((run.start_ns - now_ns) // self._period_ns))
        self.run = replace(run, plan=run.plan.braked(self.axis, tick))
