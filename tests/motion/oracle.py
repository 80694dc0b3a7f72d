"""Closed forms of docs/step_streams.md in exact arithmetic, written for readability; nothing here is the twin's code.

Square roots are exact where the root is rational and cut to 300 binary digits where it is not. An irrational time is
never a tie, and 300 digits are far more than any tie can be missed by here.
"""

from __future__ import annotations

import math
from fractions import Fraction

NS = 10**9


def root(x: Fraction) -> Fraction:
    """Square root of a non-negative rational number."""
    p, q = math.isqrt(x.numerator), math.isqrt(x.denominator)
    if p * p == x.numerator and q * q == x.denominator:
        return Fraction(p, q)
    return Fraction(math.isqrt((x.numerator << 600) // x.denominator), 1 << 300)


def ramp_s(d: Fraction, f0: Fraction, a: Fraction) -> Fraction:
    """Time in s in which a ramp that starts with f0 covers d steps: f0 t + a t^2 / 2 = d."""
    return (root(f0 * f0 + 2 * a * d) - f0) / a


def ramp_steps(n: int, v: Fraction, f0: Fraction, a: Fraction) -> Fraction:
    """Steps of the rise: to v, or to the middle of a short move."""
    return min((v * v - f0 * f0) / (2 * a), Fraction(n, 2))


def tick_s(k: int, n: int, v: Fraction, f0: Fraction, a: Fraction) -> Fraction:
    """Time in s of tick k of a move of n ticks."""
    if v <= f0:
        return Fraction(k) / v
    rise = ramp_steps(n, v, f0, a)
    rise_s = ramp_s(rise, f0, a)
    if k <= rise:
        return ramp_s(Fraction(k), f0, a)
    if k <= n - rise:
        return rise_s + (k - rise) / v
    return 2 * rise_s + (n - 2 * rise) / v - ramp_s(Fraction(n - k), f0, a)


def times_ns(n: int, v: Fraction | int, f0: Fraction | int, a: Fraction | int, ticks: range | None = None) -> list[int]:
    """Times of all ticks (or of those given) of a move in ns; round() of a Fraction takes ties to even."""
    numbers = [Fraction(x) for x in (v, f0, a)]
    return [round(NS * tick_s(k, n, *numbers)) for k in ticks or range(1, n + 1)]


def stop_times_ns(n: int, v: int, f0: int, a: int, stop_ns: int) -> list[int]:
    """Times of all ticks of a move in ns that gets a stop at stop_ns.

    The ticks up to the stop are those of the whole move. At the stop the phase is s and the frequency f; from there
    s + f u - a u^2 / 2 down to f0, unless the move has no ramps (it ends) or is falling already (nothing changes).
    """
    move = times_ns(n, v, f0, a)
    made = [t for t in move if t <= stop_ns]
    if v <= f0:
        return made
    t = Fraction(stop_ns, NS)
    rise = ramp_steps(n, Fraction(v), Fraction(f0), Fraction(a))
    rise_s = ramp_s(rise, Fraction(f0), Fraction(a))
    if t < rise_s:
        s, f = f0 * t + a * t * t / 2, f0 + a * t
    elif t < rise_s + (n - 2 * rise) / v:
        s, f = rise + v * (t - rise_s), Fraction(v)
    else:
        return move
    end = s + (f * f - f0 * f0) / (2 * a)
    rest = range(len(made) + 1, math.floor(end) + 1)
    return made + [round(NS * (t + (f - root(f * f - 2 * a * (k - s))) / a)) for k in rest]
