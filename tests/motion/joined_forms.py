"""A chain of joined pieces in closed form, written from the rules alone, in 30 digits.

The greatest speed at joint j that ramps of mean acceleration A_i on pieces of length L_i allow, if no joint i may be
passed faster than c_i (c is 0 where the chain ends, and the speed it has where it begins), needs no passes:

    v_j^2 = min over i of (c_i^2 + 2 sum of A_m L_m over the pieces m between i and j)

A piece rises to min(F, sqrt((2 A L + v^2 + w^2) / 2)), cruises, and falls; a ramp from v0 to v1 takes t = |v1 - v0| / A
and the path (v0 + v1) t / 2, and sin^2 ramps have A = 2 a / pi and run as v0 + (v1 - v0) sin^2(pi x / 2 t).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import mpmath
from mpmath import mpf

mpmath.mp.dps = 30


@dataclass(frozen=True)
class Part:
    """One piece: increments of each axis, length, greatest speed, acceleration, speed at its beginning at most."""

    way: tuple[float, ...]
    length: float
    speed: float
    acceleration: float
    entry: float = float("inf")


@dataclass(frozen=True)
class Phase:
    """From place s of a piece on, at time t: a ramp from v0 to v1, or a constant speed, that lasts dt."""

    part: int
    t: mpf
    dt: mpf
    s: mpf
    v0: mpf
    v1: mpf

    def at(self, t: mpf, sine: bool) -> tuple[mpf, mpf]:
        """Place and speed at this time."""
        x, dv = min(max(t - self.t, mpf(0)), self.dt), self.v1 - self.v0
        if not self.dt:
            return self.s, self.v1
        if sine:
            turn = mpmath.pi * x / self.dt
            way = self.v0 * x + dv * (x / 2 - self.dt / (2 * mpmath.pi) * mpmath.sin(turn))
            return self.s + way, self.v0 + dv * mpmath.sin(turn / 2) ** 2
        return self.s + self.v0 * x + dv * x * x / (2 * self.dt), self.v0 + dv * x / self.dt


@dataclass(frozen=True)
class Law:
    """Phases in the order of time."""

    phases: tuple[Phase, ...]
    sine: bool

    @property
    def end(self) -> mpf:
        return self.phases[-1].t + self.phases[-1].dt

    def at(self, t: mpf) -> tuple[int, mpf, mpf]:
        """Piece, place on it, speed."""
        phase = next((phase for phase in reversed(self.phases) if phase.t <= t), self.phases[0])
        return phase.part, *phase.at(t, self.sine)

    def until(self, t: mpf, later: Law) -> Law:
        """This one up to t, then the other."""
        return Law((*(phase for phase in self.phases if phase.t < t), *later.phases), self.sine)


def mean(part: Part, sine: bool) -> mpf:
    return mpf(part.acceleration) * (2 / mpmath.pi if sine else 1)


def speeds(parts: Sequence[Part], sine: bool, v: mpf, s: mpf) -> list[mpf]:
    """At all joints, the first being the place s of the first piece."""
    gains = [2 * mean(part, sine) * (mpf(part.length) - (s if j == 0 else 0)) for j, part in enumerate(parts)]
    sums = [mpf(0)]
    for gain in gains:
        sums.append(sums[-1] + gain)
    most = [v]
    most += [mpf(min(b.entry, a.speed, b.speed)) for a, b in pairwise(parts)]
    most.append(mpf(0))
    return [mpmath.sqrt(min(c * c + abs(sums[j] - sums[i]) for i, c in enumerate(most))) for j in range(len(most))]


def law(parts: Sequence[Part], *, sine: bool = False, t: float = 0, v: float = 0, s: float = 0, first: int = 0) -> Law:
    """From place s of the first part and speed v (not above its greatest) to standstill at the end."""
    time, place = mpf(t), mpf(s)
    joints = speeds(parts, sine, mpf(v), place)
    phases: list[Phase] = []
    for j, part in enumerate(parts):
        a, before, after = mean(part, sine), joints[j], joints[j + 1]
        rest = mpf(part.length) - place
        peak = min(mpf(part.speed), mpmath.sqrt((2 * a * rest + before**2 + after**2) / 2))
        up, down = (peak**2 - before**2) / (2 * a), (peak**2 - after**2) / (2 * a)
        for way, v0, v1 in ((up, before, peak), (rest - up - down, peak, peak), (down, peak, after)):
            if way > mpf(10) ** -18:
                dt = 2 * way / (v0 + v1)
                phases.append(Phase(first + j, time, dt, place, v0, v1))
                time, place = time + dt, place + way
        place = mpf(0)
    return Law(tuple(phases), sine)


def braking(parts: Sequence[Part], *, sine: bool, t: float, v: float, s: float, first: int = 0) -> Law:
    """From there to standstill, as soon as can be."""
    time, place, speed = mpf(t), mpf(s), mpf(v)
    phases: list[Phase] = []
    for j, part in enumerate(parts):
        a, rest = mean(part, sine), mpf(part.length) - place
        after = mpmath.sqrt(max(speed**2 - 2 * a * rest, mpf(0)))
        dt = (speed - after) / a
        phases.append(Phase(first + j, time, dt, place, speed, after))
        if not after:
            break
        time, place, speed = time + dt, mpf(0), after
    return Law(tuple(phases), sine)


def displacement(parts: Sequence[Part], law: Law, t: mpf) -> list[mpf]:
    """Increments of each axis at this time, not rounded."""
    number, place, _ = law.at(t)
    before = [sum(mpf(part.way[axis]) for part in parts[:number]) for axis in range(len(parts[0].way))]
    part = parts[number]
    return [b + mpf(n) * place / mpf(part.length) for b, n in zip(before, part.way, strict=True)]
