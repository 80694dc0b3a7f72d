"""The reference run of an axis: to its reference switch, off it, on to the next zero pulse (manual 2, P12040 on).

    speed     -fast until the switch is struck, brake          the motor-end switch is the reference switch
              ______
                    \\      ___ +slow until it is free
                     \\____/   \\__ on to the next zero pulse: there the axis is at P12040

One axis after the other, Z first. A search without a switch, or a lost drive, ends it.
"""

from __future__ import annotations

from enum import Enum

from isel_twin.controller import CounterSet, ReferenceSearch
from isel_twin.firmware.bwo900.realtime.axes import AXES, Axes
from isel_twin.firmware.bwo900.realtime.outgoing import Outgoing
from isel_twin.firmware.bwo900.realtime.stretch import PERIOD_NS
from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest

FAST_HZ, SLOW_HZ = 10_000.0, 2_000.0
ACCELERATION_HZ_S = 100_000.0
SEARCH = 1_200_000  # increments after which a search ends without a switch
FREE = 40_000  # increments within which the switch must open


class Leg(Enum):
    SEARCH = "towards the switch"
    BRAKE = "the switch is struck: brake"
    FREE = "off the switch"
    BRAKE_FREE = "the switch is free: brake"
    PULSE = "on to the zero pulse"
    STOP = "broken off: brake"


class Homing:
    """Reference runs of some axes, one after the other. `advance` after everything that happens."""

    def __init__(self, order: list[int], axes: Axes, outgoing: Outgoing) -> None:
        """order: the axes in the order of their runs."""
        self._order, self._axes, self._outgoing = order, axes, outgoing
        self._serial = 0
        self._leg = Leg.STOP
        self.run: SetPointRun | None = None
        self.failed: int | None = None  # the axis that found no switch
        self._next()

    @property
    def next_ns(self) -> int | None:
        return None if self.run is None else self.run.end_ns

    def advance(self) -> None:
        while self.run is not None and self._go_on():
            pass

    def stop(self) -> None:
        self.run, self._order = None, []

    def brake(self) -> None:
        if self.run is not None:
            self._brake(self._order[0], Leg.STOP)

    def _next(self) -> None:
        if not self._order:
            self.run = None
            return
        axis = self._order[0]
        self._outgoing.add(ReferenceSearch(axis))
        plan = at_rest(AXES, PERIOD_NS, ACCELERATION_HZ_S, ("homing", self._serial, axis))
        self._serial += 1
        self.run = SetPointRun(plan, PERIOD_NS, self._axes.now_ns)
        if self._axes.struck(axis, 1):
            self._move(axis, FREE, SLOW_HZ, Leg.FREE)
        else:
            self._move(axis, -SEARCH, FAST_HZ, Leg.SEARCH)

    def _go_on(self) -> bool:
        """Check the present leg; True if another one has begun, which must be checked, too."""
        assert self.run is not None
        axis, stands, leg = self._order[0], self._axes.now_ns >= self.run.end_ns, self._leg
        struck = self._axes.struck(axis, 1)
        if leg is Leg.SEARCH and struck:
            self._brake(axis, Leg.BRAKE)
        elif leg is Leg.FREE and not struck:
            self._brake(axis, Leg.BRAKE_FREE)
        elif not stands:
            return False
        elif leg in (Leg.SEARCH, Leg.FREE):
            self.failed = axis
            self.stop()
        elif leg is Leg.STOP:
            self.stop()
        elif leg is Leg.BRAKE:
            self._move(axis, FREE, SLOW_HZ, Leg.FREE)
        elif leg is Leg.BRAKE_FREE and (left := self._axes.to_pulse(axis)):
            self._move(axis, left, SLOW_HZ, Leg.PULSE)
        else:
            self._outgoing.add(ReferenceSearch(axis, found=True))
            self._outgoing.add(CounterSet(axis, self._axes.place(axis)))
            self._order.pop(0)
            self._next()
        return True

    def _move(self, axis: int, way: float, speed_hz: float, leg: Leg) -> None:
        plan, k = under_way(self.run, self._axes.now_ns)
        self._begin(plan.to(axis, k, plan.displacement(k)[axis] + way, speed_hz), leg)

    def _brake(self, axis: int, leg: Leg) -> None:
        plan, k = under_way(self.run, self._axes.now_ns)
        self._begin(plan.braked(axis, k, self._axes.sharpness(axis, 0)), leg)

    def _begin(self, plan: Indexer, leg: Leg) -> None:
        assert self.run is not None
        self.run, self._leg = self.run.with_plan(plan), leg


def under_way(run: SetPointRun | None, now_ns: int) -> tuple[Indexer, int]:
    """The plan of a run, and its next tick."""
    assert run is not None
    assert isinstance(run.plan, Indexer)
    return run.plan, run.next_tick(now_ns)
