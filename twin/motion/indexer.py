"""Set points of axes that move independently, on one grid: reference runs, jogging, emergency ramps.

    speed     toward(v)              brake           to(target)
      |        ________                \\                ___
      |       /        ...              \\              /   \\
      +------/------------ path          \\____        /     \\____

An axis has phases, each a parabola s(t) = s0 + v0 t + a t^2 / 2. When a switch is met, the plan is replaced by one with
other phases after a tick. Times are seconds from the start of the plan, distances increments.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.motion.path import Displacement, added
from isel_twin.motion.set_points import SetPoints


@dataclass(frozen=True)
class Phase:
    """From t on: s0 + v0 u + a u^2 / 2 with u = time - t."""

    t: float
    s: float
    v: float
    a: float = 0.0

    def at(self, t: float) -> tuple[float, float]:
        """Distance and speed."""
        u = t - self.t
        return self.s + self.v * u + self.a * u * u / 2, self.v + self.a * u


@dataclass(frozen=True, eq=False)
class Indexer:
    """Implements `isel_twin.motion.SetPoints`. In its last phase an axis is at rest."""

    phases: tuple[tuple[Phase, ...], ...]
    period_ns: int
    acceleration: float  # increments/s^2, for `stopped`
    identity: object

    @property
    def axes(self) -> int:
        return len(self.phases)

    @property
    def ticks(self) -> int:
        return max(map(self.stands_at, range(self.axes)))

    def displacement(self, k: int) -> Displacement:
        t = self._time_s(k)
        return tuple(round(_phase(phases, t).at(t)[0]) for phases in self.phases)

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"set points {first}..{last} of {self.ticks}")
        t = np.arange(first, last + 1) * (self.period_ns / SECOND_NS)
        points = np.zeros((len(t), self.axes), dtype=np.int64)
        for axis, phases in enumerate(self.phases):
            table = np.array([(phase.t, phase.s, phase.v, phase.a) for phase in phases])
            t0, s, v, a = table[np.searchsorted(table[1:, 0], t, side="right")].T
            u = t - t0
            points[:, axis] = np.rint(s + v * u + a * u * u / 2)
        return np.diff(points, axis=0).astype(np.int32)

    def stopped(self, k: int) -> Indexer:
        plan = self
        for axis in range(self.axes):
            plan = plan.braked(axis, k)
        return plan

    def stands_at(self, axis: int) -> int:
        return math.ceil(round(self.phases[axis][-1].t * SECOND_NS / self.period_ns, 6))

    def stands(self, axis: int, k: int) -> bool:
        return k >= self.stands_at(axis)

    def braked(self, axis: int, k: int, sharpness: float = 1.0) -> Indexer:
        """The axis brakes to standstill from tick k on, with `sharpness` times the plan's acceleration."""
        t, s, v = self._state(axis, k)
        if v == 0.0:
            return self._with(axis, k, [Phase(t, s, 0.0)])
        a = -math.copysign(self.acceleration * sharpness, v)
        ramp = Phase(t, s, v, a)
        return self._with(axis, k, [ramp, Phase(t - v / a, ramp.at(t - v / a)[0], 0.0)])

    def to(self, axis: int, k: int, target: float, speed: float) -> Indexer:
        """The axis moves from standstill to a place (distance from the start of the plan), at most at this speed."""
        t, s, _ = self._state(axis, k)
        way = target - s
        if way == 0.0:
            return self._with(axis, k, [Phase(t, s, 0.0)])
        sign, a = math.copysign(1.0, way), self.acceleration
        v = min(speed, math.sqrt(abs(way) * a))
        rise, cruise = v / a, abs(way) / v - v / a
        first = Phase(t, s, 0.0, sign * a)
        second = Phase(t + rise, s + sign * a * rise * rise / 2, sign * v)
        third = Phase(second.t + cruise, second.s + sign * v * cruise, sign * v, -sign * a)
        return self._with(axis, k, [first, second, third, Phase(third.t + rise, target, 0.0)])

    def towards(self, axis: int, k: int, target: float, speed: float) -> Indexer:
        """The axis goes on to the place it is moving to, at another speed above 0.

        v^2 = min(speed^2, a way + u^2 / 2)         u, v: the speed now and the new one
        way = |v^2 - u^2| / 2a + cruise + v^2 / 2a
        """
        t, s, velocity = self._state(axis, k)
        way, u, a = abs(target - s), abs(velocity), self.acceleration
        if velocity == 0.0 or way == 0.0:
            return self.to(axis, k, target, speed)
        sign = math.copysign(1.0, velocity)
        v = min(speed, max(math.sqrt(a * way + u * u / 2.0), 0.0)) if speed > u else speed
        turn, change = abs(v - u) / a, abs(v * v - u * u) / (2.0 * a)
        cruise = max(way - change - v * v / (2.0 * a), 0.0) / v
        first = Phase(t, s, velocity, sign * math.copysign(a, v - u))
        second = Phase(t + turn, s + sign * change, sign * v)
        third = Phase(second.t + cruise, second.s + sign * v * cruise, sign * v, -sign * a)
        return self._with(axis, k, [first, second, third, Phase(third.t + v / a, target, 0.0)])

    def _state(self, axis: int, k: int) -> tuple[float, float, float]:
        t = self._time_s(k)
        return (t, *_phase(self.phases[axis], t).at(t))

    def _with(self, axis: int, k: int, phases: list[Phase]) -> Indexer:
        t = self._time_s(k)
        kept = tuple(phase for phase in self.phases[axis] if phase.t < t)
        new = (*self.phases[:axis], (*kept, *phases), *self.phases[axis + 1 :])
        return Indexer(new, self.period_ns, self.acceleration, self.identity)

    def _time_s(self, k: int) -> float:
        return k * self.period_ns / SECOND_NS


def at_rest(axes: int, period_ns: int, acceleration: float, identity: object) -> Indexer:
    return Indexer(((Phase(0.0, 0.0, 0.0),),) * axes, period_ns, acceleration, identity)


def _phase(phases: tuple[Phase, ...], t: float) -> Phase:
    return phases[max(bisect_right(phases, t, key=lambda phase: phase.t) - 1, 0)]


@dataclass(frozen=True, eq=False)
class Braked:
    """Implements `isel_twin.motion.SetPoints`: `plan` up to tick k, then each axis brakes to standstill by `ramp`."""

    plan: SetPoints
    k: int
    ramp: Indexer

    @property
    def axes(self) -> int:
        return self.plan.axes

    @property
    def identity(self) -> object:
        return self.plan.identity

    @property
    def ticks(self) -> int:
        return self.k + self.ramp.ticks

    def displacement(self, k: int) -> Displacement:
        made = self.plan.displacement(min(k, self.k))
        return added(made, self.ramp.displacement(max(0, k - self.k)))

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"set points {first}..{last} of {self.ticks}")
        parts = [np.zeros((0, self.axes), np.int32)]
        if first < self.k:
            parts.append(self.plan.deltas(first, min(last, self.k)))
        if last > self.k:
            parts.append(self.ramp.deltas(max(first - self.k, 0), last - self.k))
        return np.concatenate(parts)

    def stopped(self, k: int) -> Braked:
        return self


def braked(plan: SetPoints, k: int, period_ns: int, acceleration: float) -> Braked:
    """The plan up to tick k, then all axes brake to standstill together, the fastest with this acceleration."""
    last = np.asarray(plan.displacement(k), dtype=float) - np.asarray(plan.displacement(max(0, k - 1)), dtype=float)
    speeds = last * (SECOND_NS / period_ns)
    fastest = float(np.abs(speeds).max())
    ramp = at_rest(plan.axes, period_ns, acceleration, None)
    if fastest:
        t = fastest / acceleration
        ramp = Indexer(
            tuple((Phase(0.0, 0.0, v, -v / t), Phase(t, v * t / 2, 0.0)) for v in speeds.tolist()),
            period_ns,
            acceleration,
            None,
        )
    return Braked(plan, k, ramp)
