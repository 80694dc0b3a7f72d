"""What step streams and arcs must be, from closed forms, exactly; nothing here is the twin's code.

Ramp law of a move of n ticks at v Hz with start-stop frequency f0 and acceleration a (Hz/s): the phase s(t) of the
leading axis starts with frequency f0, rises at a to v or to the middle of the move, stays, falls symmetrically to f0.

    s(t) = f0 t + a t^2 / 2   while rising, so   t(k) = (sqrt(f0^2 + 2 a k) - f0) / a

Times are computed with 60 decimal digits. An irrational time is never a tie between two nanoseconds, and not within
1e-19 ns of one with the numbers of a controller; so what is within 1e-30 ns of a tie is one.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable
from decimal import ROUND_HALF_EVEN, Context, Decimal, localcontext
from fractions import Fraction

import numpy as np
from numpy.typing import NDArray

Number = int | float | Decimal | Fraction

_EXACT = Context(prec=60)
_NOTHING = Decimal("1e-30")


# ---- when ticks fall -----------------------------------------------------------------------------------------------


def ramp_s(d: Number, f0: Number, a: Number) -> Decimal:
    """Time in s in which a ramp that starts with f0 covers d steps: f0 t + a t^2 / 2 = d."""
    with localcontext(_EXACT):
        return _ramp_s(*map(_decimal, (d, f0, a)))


def tick_ns(k: int, n: int, v: Number, f0: Number, a: Number) -> Decimal:
    """Time in ns of tick k of a move of n ticks, to 30 decimals."""
    with localcontext(_EXACT):
        return _ns(_law(n, v, f0, a)(k))


def times_ns(n: int, v: Number, f0: Number, a: Number, ticks: Iterable[int] | None = None) -> list[int]:
    """Times in ns of all ticks of a move, or of those given, after its start: the nearest, ties to even."""
    with localcontext(_EXACT):
        tick_s = _law(n, v, f0, a)
        return [_round(tick_s(k)) for k in ticks or range(1, n + 1)]


def stop_times_ns(n: int, v: Number, f0: Number, a: Number, stop_ns: int) -> list[int]:
    """The same of a move that gets a stop at stop_ns.

    The ticks up to the stop are those of the whole move. At the stop the phase is s and the frequency f; from there
    s + f u - a u^2 / 2 down to f0, unless the move has no ramps (it ends) or is falling already (nothing changes).
    Only whole ticks count.
    """
    move = times_ns(n, v, f0, a)
    made = [t for t in move if t <= stop_ns]
    if v <= f0:
        return made
    with localcontext(_EXACT):
        n_, v_, f0_, a_ = map(_decimal, (n, v, f0, a))
        t, rise = Decimal(stop_ns) / 10**9, _rise(n_, v_, f0_, a_)
        rise_s = _ramp_s(rise, f0_, a_)
        if t < rise_s:
            s, f = f0_ * t + a_ * t * t / 2, f0_ + a_ * t
        elif t < rise_s + (n_ - 2 * rise) / v_:
            s, f = rise + v_ * (t - rise_s), v_
        else:
            return move
        end = (s + (f * f - f0_ * f0_) / (2 * a_)).quantize(_NOTHING)
        rest = range(len(made) + 1, math.floor(end) + 1)
        return made + [_round(t + (f - (f * f - 2 * a_ * (k - s)).sqrt()) / a_) for k in rest]


def pulse_times_ns(ticks: int, speed_hz: int, start_stop_hz: int = 300, acceleration_hz_ms: int = 100) -> list[int]:
    """`times_ns` in the units of the iMC's commands, with its factory settings."""
    return times_ns(ticks, speed_hz, start_stop_hz, 1000 * acceleration_hz_ms)


def _law(n: Number, v: Number, f0: Number, a: Number) -> Callable[[int], Decimal]:
    """Time in s of a tick."""
    n, v, f0, a = map(_decimal, (n, v, f0, a))
    if v <= f0:
        return lambda k: k / v
    rise = _rise(n, v, f0, a)
    rise_s = _ramp_s(rise, f0, a)
    total_s = 2 * rise_s + (n - 2 * rise) / v

    def tick_s(k: int) -> Decimal:
        if k <= rise:
            return _ramp_s(Decimal(k), f0, a)
        if k <= n - rise:
            return rise_s + (k - rise) / v
        return total_s - _ramp_s(n - k, f0, a)

    return tick_s


def _rise(n: Decimal, v: Decimal, f0: Decimal, a: Decimal) -> Decimal:
    """Steps of the rise: to v, or to the middle of a short move."""
    return min((v * v - f0 * f0) / (2 * a), n / 2)


def _ramp_s(d: Decimal, f0: Decimal, a: Decimal) -> Decimal:
    return ((f0 * f0 + 2 * a * d).sqrt() - f0) / a


def _decimal(x: Number) -> Decimal:
    return Decimal(x.numerator) / x.denominator if isinstance(x, Fraction) else Decimal(x)


def _ns(seconds: Decimal) -> Decimal:
    return (seconds * 10**9).quantize(_NOTHING)


def _round(seconds: Decimal) -> int:
    return int(_ns(seconds).to_integral_value(rounding=ROUND_HALF_EVEN))


# ---- which axes step -----------------------------------------------------------------------------------------------


def made_after(k: int | NDArray[np.int64], n: int, lead: int) -> int | NDArray[np.int64]:
    """The floor rule: an axis with n of the lead's steps has made floor((2 k |n| + lead) / (2 lead)) after tick k."""
    return ((2 * k * abs(n) + lead) // (2 * lead)) * (1 if n > 0 else -1)


def line(*steps: int) -> NDArray[np.int8]:
    """int8 [N, 4]: the steps of each axis at each pulse of the leading one, by the floor rule."""
    lead = max(abs(n) for n in steps)
    k = np.arange(lead + 1, dtype=np.int64)
    made = np.stack([made_after(k, n, lead) for n in (*steps, 0, 0, 0, 0)[:4]], axis=1)
    return np.diff(made, axis=0).astype(np.int8)


# ---- arcs ----------------------------------------------------------------------------------------------------------


READINGS = ("meant", "printed", "slipped")
"""How hosts may read the formula for D in 2.3.6, whose worked example contradicts it twice.

meant: Summe(n) = n (|n| + 1), which gives the example's 119 from the formula as it stands. printed: the formula with
Summe(n) = |n| (n + 1), as the example computes Summe(-141). slipped: both slips of the example, |n| (n + 1) and
Ys + (Rx - Ry) / 2, which gives 119 again.
"""


def interpolation_parameter(
    radius: int, xs: int, ys: int, rx: int, ry: int, clockwise: bool = False, reading: str = "meant"
) -> int:
    """D of section 2.3.6; clockwise is the mirror image: the same with the roles of the two axes exchanged."""
    if clockwise:
        xs, ys, rx, ry = ys, xs, ry, rx

    def summe(n: int) -> int:
        return n * (abs(n) + 1) if reading == "meant" else abs(n) * (n + 1)

    y_shift = (rx - ry if reading == "slipped" else rx + ry) // 2
    twice = rx * ry * (radius + summe(radius - 1)) - rx * summe(xs + (rx - ry) // 2) + ry * summe(ys + y_shift)
    return round(twice / 2)


def directions(xs: int, ys: int, clockwise: bool) -> tuple[int, int]:
    """Rx, Ry of section 2.3.5 at a start point: the way the arc leaves it; on an axis, that of the quadrant entered."""
    sense = -1 if clockwise else 1
    tangent_x, tangent_y = -sense * ys, sense * xs
    rx = int(math.copysign(1, tangent_x)) if tangent_x else int(math.copysign(1, -xs))
    ry = int(math.copysign(1, tangent_y)) if tangent_y else int(math.copysign(1, -ys))
    return rx, ry


def off_circle(points: NDArray[np.int64], radius: float) -> float:
    """Largest distance of points [n, 2] from a circle around 0."""
    return float(np.abs(np.hypot(points[:, 0], points[:, 1]) - radius).max())


def turned_deg(points: NDArray[np.int64]) -> float:
    """Angle through which the path [n, 2] runs around 0 in degrees, counter-clockwise positive."""
    angle = np.unwrap(np.arctan2(points[:, 1], points[:, 0]))
    return float(np.degrees(angle[-1] - angle[0]))


def hex24(*positions: int) -> str:
    """The reply to `@0P`: `0`, then each position as six hexadecimal digits, two's complement."""
    return "0" + "".join(f"{position & 0xFFFFFF:06X}" for position in positions)
