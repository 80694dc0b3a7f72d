"""The reference run of an axis: to its reference switch, off it, on to the next zero pulse (manual 2, P12040 on).

    speed     -fast until the switch is struck, brake          the motor-end switch is the reference switch
              ______
                    \\      ___ +slow until it is free
                     \\____/   \\__ on to the next zero pulse: there the axis is at P12040

One axis after the other, Z first. What the drives report decides; no switch within the way, or a lost drive, ends it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from enum import Enum
from typing import Final

from isel_twin.motion import SetPointRun
from isel_twin.motion.indexer import Indexer, at_rest

FAST, SLOW = 10_000.0, 2_000.0
"""Increments a second."""
ACCELERATION: Final = 100_000.0
SEARCH: Final = 1_200_000
"""Increments after which a search ends without a switch."""
FREE: Final = 40_000


class _Step(Enum):
    SEARCH = "towards the switch"
    BRAKE = "the switch is struck"
    FREE = "off the switch"
    PULSE = "to the zero pulse"
    DONE = ""


class Homing:
    """Reference runs of some axes, one after the other. `advance` after everything that happens."""

    def __init__(
        self,
        axes: list[int],
        count: int,
        period_ns: int,
        now_ns: int,
        *,
        struck: Callable[[int], bool],
        to_pulse: Callable[[int], int],
        done: Callable[[int], None],
    ) -> None:
        """count: of all axes. struck: whether an axis' switch is. to_pulse: increments to its next zero pulse. done:
        called with an axis that stands at its reference point."""
        self._axes, self._count, self._period_ns = list(axes), count, period_ns
        self._struck, self._to_pulse, self._done = struck, to_pulse, done
        self._serial = 0
        self._step = _Step.DONE
        self.run: SetPointRun | None = None
        self.failed: int | None = None
        """The axis that has found no switch."""
        self._next(now_ns)

    @property
    def active(self) -> bool:
        """Something is left to be done."""
        return self.run is not None

    @property
    def next_ns(self) -> int | None:
        """When `advance` is due."""
        return None if self.run is None else self.run.end_ns

    def advance(self, now_ns: int) -> None:
        """Let time pass, or a switch change."""
        while self.run is not None and self._go_on(now_ns):
            pass

    def stop(self) -> None:
        """It ends here."""
        self.run, self._axes = None, []

    def brake(self, now_ns: int) -> None:
        """The axis brakes, and that is the end."""
        if self.run is not None:
            self._brake(self._axes[0], now_ns)
            self._step = _Step.DONE

    def _next(self, now_ns: int) -> None:
        if not self._axes:
            self.run = None
            return
        axis = self._axes[0]
        plan = at_rest(self._count, self._period_ns, ACCELERATION, ("homing", self._serial, axis))
        self._serial += 1
        self.run = SetPointRun(plan, self._period_ns, now_ns)
        if self._struck(axis):
            self._to(axis, now_ns, FREE, SLOW)
            self._step = _Step.FREE
        else:
            self._to(axis, now_ns, -SEARCH, FAST)
            self._step = _Step.SEARCH

    def _go_on(self, now_ns: int) -> bool:
        """One step further; whether there may be another one now."""
        assert self.run is not None
        axis, stands = self._axes[0], now_ns >= self.run.end_ns
        match self._step:
            case _Step.SEARCH:
                if self._struck(axis):
                    self._brake(axis, now_ns)
                    self._step = _Step.BRAKE
                    return True
                if stands:
                    self.failed, self.run, self._axes = axis, None, []
            case _Step.BRAKE:
                if stands:
                    self._to(axis, now_ns, FREE, SLOW)
                    self._step = _Step.FREE
                    return True
            case _Step.FREE:
                if not self._struck(axis):
                    self._to_here(axis, now_ns)
                    self._step = _Step.PULSE
                    return True
                if stands:
                    self.failed, self.run, self._axes = axis, None, []
            case _Step.DONE:
                if stands:
                    self.stop()
            case _Step.PULSE:
                if stands:
                    left = self._to_pulse(axis)
                    if self._waits_for_pulse and left:
                        self._waits_for_pulse = False
                        self._to(axis, now_ns, left, SLOW)
                        return True
                    self._done(axis)
                    self._axes.pop(0)
                    self._next(now_ns)
                    return True
        return False

    _waits_for_pulse = False

    def _to_here(self, axis: int, now_ns: int) -> None:
        """Brake; from where it stands the zero pulse is approached."""
        self._brake(axis, now_ns)
        self._waits_for_pulse = True

    def _to(self, axis: int, now_ns: int, way: float, speed: float) -> None:
        plan, k = self._plan(now_ns)
        self._replace(plan.to(axis, k, plan.displacement(k)[axis] + way, speed), now_ns)

    def _brake(self, axis: int, now_ns: int) -> None:
        plan, k = self._plan(now_ns)
        self._replace(plan.braked(axis, k), now_ns)

    def _plan(self, now_ns: int) -> tuple[Indexer, int]:
        assert self.run is not None
        assert isinstance(self.run.plan, Indexer)
        return self.run.plan, max(0, -((self.run.start_ns - now_ns) // self._period_ns))

    def _replace(self, plan: Indexer, now_ns: int) -> None:
        assert self.run is not None
        self.run = replace(self.run, plan=plan)
