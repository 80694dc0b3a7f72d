"""What the step streams and arcs of the manual must be, from closed forms, exactly; nothing here is the twin's code.

Ramp law of a move of n ticks at v Hz with start-stop frequency f and acceleration a (Hz/s): the phase s(t) of the
leading axis starts with frequency f, rises at a to v or to the middle of the move, stays, falls symmetrically to f.

    s(t) = f t + a t^2 / 2   while rising, so   t(k) = (sqrt(f^2 + 2 a k) - f) / a
"""

from __future__ import annotations

import math
from decimal import ROUND_HALF_EVEN, Decimal, localcontext

import numpy as np
from numpy.typing import NDArray


def pulse_times_ns(ticks: int, speed_hz: int, start_stop_hz: int = 300, acceleration_hz_ms: int = 100) -> list[int]:
    """Times of ticks 1..n after the start of the move, nearest nanosecond, ties to even."""
    with localcontext() as context:
        context.prec = 50
        n, v, f, a = Decimal(ticks), Decimal(speed_hz), Decimal(start_stop_hz), Decimal(1000 * acceleration_hz_ms)
        if v <= f:
            return [_round(k / v) for k in range(1, ticks + 1)]
        rise = min((v * v - f * f) / (2 * a), n / 2)
        rise_s = ((f * f + 2 * a * rise).sqrt() - f) / a
        total_s = 2 * rise_s + (n - 2 * rise) / v
        times = []
        for k in range(1, ticks + 1):
            if k <= rise:
                times.append(((f * f + 2 * a * k).sqrt() - f) / a)
            elif k <= n - rise:
                times.append(rise_s + (k - rise) / v)
            else:
                times.append(total_s - ((f * f + 2 * a * (n - k)).sqrt() - f) / a)
        return [_round(t) for t in times]


def stop_times_ns(
    at_ns: int, speed_hz: int, start_stop_hz: int = 300, acceleration_hz_ms: int = 100
) -> tuple[int, list[int]]:
    """Stop in the constant part of a move, `at_ns` after its start: ticks made by then, times of those that follow.

    From the phase s0 reached the frequency falls from v at a to f: s(t) = s0 + v t - a t^2 / 2; only whole ticks count.
    """
    with localcontext() as context:
        context.prec = 50
        v, f, a = Decimal(speed_hz), Decimal(start_stop_hz), Decimal(1000 * acceleration_hz_ms)
        at = Decimal(at_ns) / 10**9
        s0 = (v * v - f * f) / (2 * a) + v * (at - (v - f) / a)
        end = s0 + (v * v - f * f) / (2 * a)
        ticks = range(int(s0) + 1, int(end) + 1)
        return int(s0), [_round(at + (v - (v * v - 2 * a * (k - s0)).sqrt()) / a) for k in ticks]


def _round(seconds: Decimal) -> int:
    return int((Decimal(seconds) * 10**9).to_integral_value(rounding=ROUND_HALF_EVEN))


def line(*steps: int) -> NDArray[np.int8]:
    """int8 [N, 4]: the floor rule; axis i has made floor((2 k n_i + N) / (2 N)) of its steps after leading pulse k."""
    lead = max(abs(n) for n in steps)
    k = np.arange(lead + 1, dtype=np.int64)
    made = np.stack([np.sign(n) * ((2 * k * abs(n) + lead) // (2 * lead)) for n in (*steps, 0, 0, 0, 0)[:4]], axis=1)
    return np.diff(made, axis=0).astype(np.int8)


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
