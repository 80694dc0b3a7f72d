"""When the ticks of a motion fall: the trapezoidal time law, exact to the nanosecond (motion/6).

The phase s(t) of a motion counts its ticks as a real number; tick k falls where s(t) = k. With the start-stop frequency
f0, the acceleration a and the speed V

    rise     s = f0 t + a t^2 / 2                up to V, or to the peak sqrt(f0^2 + a n) at s = n/2 of a short motion
    cruise   s = s_r + V (t - t_r)               t_r = (V - f0) / a,  s_r = (V^2 - f0^2) / (2 a)
    fall     n - s = f0 (T - t) + a (T - t)^2 / 2,   so that s(T) = n

and V <= f0 has no ramps: s = V t. Solved for the time, with x(d) = (sqrt(f0^2 + 2 a d) - f0) / a,

    rise  t_k = x(k)        cruise  t_k = t_r + (k - s_r) / V        fall  t_k = T - x(S - k),  S = n

A stop at time t_q keeps the ticks up to t_q and falls from the momentary phase s_q and frequency f_q: the same `fall`
with S = s_q + (f_q^2 - f0^2) / (2 a) and T = t_q + (f_q - f0) / a; the last tick is floor(S) (motion/2).

Every t_k is rounded to the nearest nanosecond, ties to even. Cruise times are rational: an integer accumulator gives
them without a division per tick. Ramp times are computed in double precision as x(d) = 2 d / (sqrt(f0^2 + 2 a d) + f0),
which cancels no digits. Both are in time_law.c; the few too near to the middle between two nanoseconds are decided here
in exact arithmetic.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from fractions import Fraction
from functools import lru_cache
from typing import NamedTuple, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.native import core, record

Rational = int | Fraction  # frequencies and accelerations are exact numbers; floats would be rounded
LONGEST_NS = 1 << 62  # times must stay below this (146 years), so that sums of two fit into 64 bits

PATH_DIGITS = 64  # binary digits after the point of a frequency that is irrational
REST = 1 << 60  # parts of a nanosecond in which a rest that does not fit into 64 bits is kept
ROOT_DIGITS = 128  # binary digits after the point to which irrational times are known

PHASE = record(
    "PHASE",
    [
        ("first", "i8"),  # ticks first + 1 .. last
        ("last", "i8"),
        ("t", "i8"),  # of a cruise the whole nanoseconds at tick `first`, of a ramp those at its end
        # a cruise: the rest, and what a tick adds, in whole nanoseconds and parts
        ("rest", "i8"),
        ("step", "i8"),
        ("step_rest", "i8"),
        ("den", "i8"),  # parts of a nanosecond; 0: a ramp
        ("rounded", "i8"),  # 1: rests are rounded down
        # a ramp
        ("sign", "i8"),
        ("s", "i8"),  # its end in ticks, whole and rest
        ("s_rest", "f8"),
        ("f0", "f8"),
        ("two_a", "f8"),
        ("two_units", "f8"),  # units of time of the law in 2 s
        ("t_rest", "f8"),
    ],
)


class TimeLaw(Protocol):
    """The time law of a `StepRun`. Immutable; controllers may have their own."""

    @property
    def ticks(self) -> int: ...

    @property
    def duration_ns(self) -> int:
        """Time of the last tick, 0 if there is none."""

    def times(self, first: int, last: int) -> NDArray[np.int64]:
        """int64 [last - first], never decreasing: times of ticks first + 1 .. last. IndexError if there are fewer."""

    def count(self, t_ns: int) -> int:
        """Number of ticks at or before t_ns; agrees with `times`."""

    def cut(self, t_ns: int) -> TimeLaw:
        """Only the ticks at or before t_ns."""

    def stopped(self, t_ns: int) -> TimeLaw:
        """The same up to t_ns, then the ramp from the momentary frequency to standstill, if there is one."""


def along_path(speed_hz: int, steps: Sequence[int]) -> Rational:
    """Frequency of the leading axis of a line whose speed along the path is `speed_hz`: V N / sqrt(sum n^2), exactly
    or to 2^-64 Hz."""
    square, leading = sum(n * n for n in steps), speed_hz * max(map(abs, steps))
    length = math.isqrt(square)
    if length * length == square:
        return Fraction(leading, length)
    return Fraction(math.isqrt((leading * leading << 2 * PATH_DIGITS) // square), 1 << PATH_DIGITS)


def constant(ticks: int, speed_hz: Rational) -> Trapezoid:
    """Constant frequency; the first tick falls 1/speed_hz after the start. Raises ValueError like `trapezoid`."""
    return trapezoid(ticks, speed_hz, speed_hz, 1)


def trapezoid(ticks: int, speed_hz: Rational, start_stop_hz: Rational, acceleration_hz_per_s: Rational) -> Trapezoid:
    """A ramp from the start-stop frequency to `speed_hz`, or as far as the ticks allow, and down again; no ramps if
    speed_hz <= start_stop_hz.

    Raises ValueError for a negative number of ticks, numbers that are not positive, or a time beyond 64 bits.
    """
    slowest = min(speed_hz, start_stop_hz)
    if ticks < 0:
        raise ValueError(f"ticks must not be negative, got {ticks}")
    if slowest <= 0 or acceleration_hz_per_s <= 0:
        given = {"speed_hz": speed_hz, "start_stop_hz": start_stop_hz, "acceleration_hz_per_s": acceleration_hz_per_s}
        name = next(name for name, value in given.items() if value <= 0)
        raise ValueError(f"{name} must be positive, got {given[name]}")
    if ticks * SECOND_NS >= LONGEST_NS * slowest:
        raise ValueError(f"{ticks} ticks at {slowest} Hz take longer than 64 bits of nanoseconds")
    unit_s = math.lcm(speed_hz.denominator, start_stop_hz.denominator, acceleration_hz_per_s.denominator)
    speed, start_stop = int(speed_hz * unit_s), int(start_stop_hz * unit_s)
    return Trapezoid(ticks, _Law(ticks, speed, start_stop, int(acceleration_hz_per_s * unit_s**2), unit_s * SECOND_NS))


@dataclass(frozen=True, slots=True)
class Trapezoid:
    """The first `ticks` ticks of a law."""

    ticks: int
    _law: _Law
    duration_ns: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "duration_ns", self._time(self.ticks) if self.ticks else 0)

    @property
    def speed_hz(self) -> float:
        """The speed that it would reach on a long way."""
        return self._law.speed * SECOND_NS / self._law.unit_ns

    def times(self, first: int, last: int) -> NDArray[np.int64]:
        if not 0 <= first <= last <= self.ticks:
            raise IndexError(f"ticks {first}..{last} of a time law of {self.ticks}")
        phases, table = _phases(self._law)
        out, done = np.empty(last - first, dtype=np.int64), 0
        while (done := core.tick_times(out, done, first, table)) < len(out):
            out[done] = _exact(phases, first + 1 + done)
            done += 1
        return out

    def count(self, t_ns: int) -> int:
        if t_ns >= self.duration_ns:
            return self.ticks
        made = core.ticks_by(t_ns, self.ticks, _phases(self._law)[1])
        return made if made >= 0 else bisect_right(range(1, self.ticks + 1), t_ns, key=self._time)

    def cut(self, t_ns: int) -> Trapezoid:
        return self if t_ns >= self.duration_ns else replace(self, ticks=self.count(t_ns))

    def stopped(self, t_ns: int) -> Trapezoid:
        """Unchanged on its last ramp; ends at once if it has no ramps."""
        if self._law.flat:
            return self.cut(t_ns)
        end = _stop_ramp(self._law, t_ns)
        if end is None:
            return self
        last = max(self.count(t_ns), math.floor(end[0]))
        return Trapezoid(min(last, self.ticks), self._law._replace(stop_ns=t_ns))

    def _time(self, k: int) -> int:
        """Time of one tick."""
        phases, table = _phases(self._law)
        time_ns = core.tick_time(k, table)
        return time_ns if time_ns >= 0 else _exact(phases, k)


def law_numbers(law: Trapezoid) -> list[int | None]:
    """A law as plain numbers, for `law_from_numbers`."""
    return [law.ticks, *law._law]


def law_from_numbers(numbers: Sequence[int | None]) -> Trapezoid:
    """The inverse of `law_numbers`. Raises ValueError for numbers that are not a law."""
    *of_law, stop_ns = numbers
    if len(of_law) != 6 or not all(isinstance(n, int) and n > 0 for n in of_law[2:]):
        raise ValueError(f"no numbers of a time law: {list(numbers)!r}")
    law_ticks, all_ticks, speed, start_stop, acceleration, unit_ns = (int(n) for n in of_law if n is not None)
    if not 0 <= law_ticks <= all_ticks:
        raise ValueError(f"a time law of {all_ticks} ticks that makes {law_ticks}")
    return Trapezoid(law_ticks, _Law(all_ticks, speed, start_stop, acceleration, unit_ns, stop_ns))


# ---- the law and its phases ----------------------------------------------------------------------------------------


class _Law(NamedTuple):
    """The planned motion, and when it was stopped. All numbers are whole: the unit of time, one second as a rule, is
    chosen so that frequencies and acceleration are."""

    ticks: int
    speed: int
    start_stop: int
    acceleration: int
    unit_ns: int
    stop_ns: int | None = None

    @property
    def flat(self) -> bool:
        return self.speed <= self.start_stop

    @property
    def double_rise(self) -> int:
        """2 a s_r = V^2 - f0^2; more than a n if the motion is too short to reach its speed."""
        return self.speed**2 - self.start_stop**2


def _stop_ramp(law: _Law, t_ns: int) -> tuple[Fraction, Fraction] | None:
    """Phase S and time T (units of the law) of the end of a stop ramp begun at t_ns; None on the last ramp."""
    if law.stop_ns is not None and t_ns >= law.stop_ns:
        return None
    n, v, f0, a = law.ticks, law.speed, law.start_stop, law.acceleration
    t = Fraction(max(t_ns, 0), law.unit_ns)
    short = law.double_rise > a * n
    s_r = Fraction(n, 2) if short else Fraction(law.double_rise, 2 * a)
    phase = f0 * t + a * t * t / 2
    if phase < s_r:
        return 2 * phase, 2 * t  # the stop ramp is the mirror image of the rise so far
    if short:
        return None
    t_r = Fraction(v - f0, a)
    phase = s_r + v * (t - t_r)
    return (phase + s_r, t + t_r) if phase < n - s_r else None


_Phases = tuple["_Cruise | _Ramp", ...]


@lru_cache(maxsize=64)
def _phases(law: _Law) -> tuple[_Phases, NDArray[np.void]]:
    """The phases of a law in order, none of them empty, and what C knows of them: PHASE [n]."""
    phases = _planned(law)
    return phases, np.array([phase.numbers for phase in phases], PHASE)


def _exact(phases: _Phases, k: int) -> int:
    """Time of tick k in exact arithmetic."""
    return next(phase for phase in phases if k <= phase.last).time(k)


def _planned(law: _Law) -> _Phases:
    n, v, f0, a, unit_ns, stop_ns = law
    if law.flat:
        return (_cruise(0, n, unit_ns, 0, v),) if n else ()
    double_rise = law.double_rise
    if double_rise > a * n:  # T = 2 (sqrt(f0^2 + a n) - f0) / a
        peak = 4 * (f0 * f0 + a * n)
        risen = n // 2
        end = _root(peak) - (2 * f0 << ROOT_DIGITS)
        rest: list[_Cruise | _Ramp] = [_Ramp(risen, n, -1, law, n, end * unit_ns, a << ROOT_DIGITS, peak)]
    else:  # t_r - s_r / V = (V - f0)^2 / (2 a V),  T = 2 t_r + (n - 2 s_r) / V
        risen, fall = double_rise // (2 * a), (2 * a * n - double_rise) // (2 * a)
        rest = [
            _cruise(risen, fall, 2 * a * unit_ns, (v - f0) ** 2 * unit_ns, 2 * a * v),
            _Ramp(fall, n, -1, law, n, ((v - f0) ** 2 + a * n) * unit_ns, a * v),
        ]
    phases = [_Ramp(0, risen, +1, law, 0, 0, 1), *rest]
    if stop_ns is not None:
        planned = law._replace(stop_ns=None)
        stop = _stop_ramp(planned, stop_ns)
        assert stop is not None, "a law is stopped before its last ramp only"
        made = Trapezoid(n, planned).count(stop_ns)
        phases = [phase._replace(last=min(phase.last, made)) for phase in phases if phase.first < made]
        end_ns = stop[1] * unit_ns
        phases.append(_Ramp(made, math.floor(stop[0]), -1, law, stop[0], end_ns.numerator, end_ns.denominator))
    return tuple([phase for phase in phases if phase.first < phase.last])


# ---- constant frequency --------------------------------------------------------------------------------------------


class _Cruise(NamedTuple):
    """Ticks first + 1 .. last at t_k = (slope k + offset) / denominator ns, all integers."""

    first: int
    last: int
    slope: int
    offset: int
    denominator: int

    def time(self, k: int) -> int:
        whole, rest = divmod(self.slope * k + self.offset, self.denominator)
        return whole + (2 * rest > self.denominator or (2 * rest == self.denominator and whole & 1))

    @property
    def numbers(self) -> tuple[float, ...]:
        """PHASE of it; rests that do not fit into 64 bits are rounded down."""
        den, rounded = self.denominator, self.denominator >= 1 << 61
        (whole, rest), (step, step_rest) = divmod(self.slope * self.first + self.offset, den), divmod(self.slope, den)
        if rounded:
            rest, step_rest, den = rest * REST // den, step_rest * REST // den, REST
        return self.first, self.last, whole, rest, step, step_rest, den, rounded, 0, 0, 0.0, 0.0, 0.0, 0.0, 0.0


def _cruise(first: int, last: int, slope: int, offset: int, denominator: int) -> _Cruise:
    common = math.gcd(slope, offset, denominator)
    return _Cruise(first, last, slope // common, offset // common, denominator // common)


# ---- ramps ---------------------------------------------------------------------------------------------------------


class _Ramp(NamedTuple):
    """Ticks first + 1 .. last at t_k = T + sign x(sign (k - S)): sign +1 rises from S at T, sign -1 falls to it.

    Exactly: a t_k = shift + sqrt(peak) - sqrt(r_k) when falling and shift + sqrt(r_k) when rising (peak = 0), with
    r_k = f0^2 + 2 a sign (k - S); so T = (shift + sqrt(peak) + sign f0) / a.
    """

    first: int
    last: int
    sign: int
    law: _Law
    s: Rational
    end: int
    over: int  # T is end / over ns, exact without a peak, else far more precise than double precision
    peak: int = 0

    @property
    def numbers(self) -> tuple[float, ...]:
        """PHASE of it, in double precision."""
        law, (t, t_rest) = self.law, divmod(self.end, self.over)
        f0, two_a, two_units = float(law.start_stop), float(2 * law.acceleration), float(2 * law.unit_ns)
        ramp = self.sign, math.floor(self.s), float(self.s % 1), f0, two_a, two_units, t_rest / self.over
        return self.first, self.last, t, 0, 0, 0, 0, 0, *ramp

    def time(self, k: int) -> int:
        f0, a, unit_ns = self.law.start_stop, self.law.acceleration, self.law.unit_ns
        shift = -f0 if self.peak else Fraction(a * self.end, self.over * unit_ns) - self.sign * f0
        r = f0 * f0 + 2 * a * self.sign * (k - self.s)
        plus, minus = (r, 0) if self.sign > 0 else (self.peak, r)
        # n is right or off by one; which of them depends on which side of the middle between two t_k lies.
        roots = Fraction(_root(plus) - _root(minus), 1 << ROOT_DIGITS)
        n = round((shift + roots) * unit_ns / a)
        for middle in (2 * n - 1, 2 * n + 1):
            side = _sign(plus, minus, Fraction(a * middle, 2 * unit_ns) - shift)
            if side == 0:
                return round(Fraction(middle, 2))
            if middle < 2 * n and side < 0:
                return n - 1
            if middle > 2 * n and side > 0:
                return n + 1
        return n


def _root(x: Rational) -> int:
    """sqrt(x) 2^ROOT_DIGITS, rounded down."""
    return math.isqrt((x.numerator << 2 * ROOT_DIGITS) // x.denominator)


def _sign(p: Rational, q: Rational, y: Rational) -> int:
    """Sign of sqrt(p) - sqrt(q) - y, exactly: compare squares until no root is left."""
    if y < 0:
        return -_sign(q, p, -y)
    d = p - q - y * y  # sqrt(p) against y + sqrt(q): d against 2 y sqrt(q)
    if d < 0:
        return -1
    left, right = d * d, 4 * y * y * q
    return (left > right) - (left < right)
