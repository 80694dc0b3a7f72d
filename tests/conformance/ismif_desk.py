"""The iSMIF on the test desk, and what its streams must be, from closed forms; nothing here is the twin's code.

Ramp law: the leading axis starts with f0, rises evenly to V within R, stays, falls the same way: a = (V - f0) / R and

    t(k) = (sqrt(f0^2 + 2 a k) - f0) / a    while rising, up to k = (V^2 - f0^2) / (2 a) or the middle of the motion
"""

from __future__ import annotations

from decimal import ROUND_HALF_EVEN, Decimal, localcontext

import numpy as np
from numpy.typing import NDArray

from isel_twin.testing import Desk, Ticks, switches

TRAVEL = (31_600, 24_000, 11_200)
"""The 4030 in half steps: 395, 300, 140 mm at 80 a mm."""
START = (400, 300, 200, 0)
"""Carriages at power-on, in half steps from the motor-end switches."""
HYSTERESIS = 8
ACK, DONE, FULL = "\r", "\x02\r", "\x03\r"
CONFIGURATION = {"V": 600, "f0": 200, "R": 500}
"""Factory settings (5.2): end and start speed in Hz, ramp length in ms."""


def fresh(**settings: object) -> Desk:
    """An interface that has just been switched on."""
    return Desk.of("ismif", settings=settings, carriage=START, position_switches=switches(TRAVEL, HYSTERESIS))


def referenced(*configuration: str) -> Desk:
    """Referenced in all axes with the factory settings, then configured."""
    desk = fresh()
    assert job(desk, "$HZXY") == ACK + DONE
    assert status(desk) == "000000"
    if configuration:
        assert job(desk, *configuration) == ACK * len(configuration) + DONE
    return desk


def send_job(desk: Desk, *commands: str) -> None:
    """Send commands, the last one with 01h instead of CR, and do not wait."""
    desk.send("\r".join(commands).encode("latin-1") + b"\x01")


def job(desk: Desk, *commands: str) -> str:
    """Send a job, wait until it is over; return everything the interface has sent."""
    send_job(desk, *commands)
    return desk.finish()


def now(desk: Desk, command: str) -> str:
    """Send a command and return what comes back without any time passing."""
    desk.read()
    desk.start(command)
    return desk.read()


def status(desk: Desk) -> str:
    """The six characters of the status, now."""
    reply = now(desk, "@X")
    assert reply.startswith("@X")
    assert reply.endswith("\r")
    assert len(reply) == 9
    return reply[2:8]


def moved(desk: Desk, *commands: str) -> Ticks:
    """Run a job that must succeed; return the ticks it made, the first job time being 0."""
    mark, start_ns = desk.ticks, desk.time_ns
    assert job(desk, *commands) == ACK * len(commands) + DONE
    stream = desk.steps_since(mark)
    return Ticks(stream.t_ns - start_ns, stream.delta)


def pulse_times_ns(steps: int, v: int, f0: int = 200, ramp_ms: int = 500, error_ppm: int = 0) -> list[int]:
    """Times of leading pulses 1 .. steps after the start, nearest nanosecond, ties to even."""
    with localcontext() as context:
        context.prec = 60
        n, scale = Decimal(steps), 1 + Decimal(error_ppm) / 1_000_000
        if v <= f0 or ramp_ms == 0:
            return [_ns(k / (v * scale)) for k in range(1, steps + 1)]
        high, low = v * scale, f0 * scale
        a = (high - low) * 1000 / Decimal(ramp_ms)
        rise = min((high * high - low * low) / (2 * a), n / 2)
        rise_s = ((low * low + 2 * a * rise).sqrt() - low) / a
        end_s = 2 * rise_s + (n - 2 * rise) / high
        times = []
        for k in range(1, steps + 1):
            if k <= rise:
                times.append(((low * low + 2 * a * k).sqrt() - low) / a)
            elif k < n - rise:
                times.append(rise_s + (k - rise) / high)
            else:
                times.append(end_s - ((low * low + 2 * a * (n - k)).sqrt() - low) / a)
        return [_ns(t) for t in times]


def _ns(seconds: Decimal) -> int:
    return int((seconds * 10**9).to_integral_value(rounding=ROUND_HALF_EVEN))


def line(x: int = 0, y: int = 0, z: int = 0) -> NDArray[np.int8]:
    """int8 [N, 4]: axis i has made floor((2 k n_i + N) / (2 N)) of its steps after leading pulse k."""
    lead = max(abs(x), abs(y), abs(z))
    k = np.arange(lead + 1, dtype=np.int64)
    made = np.stack([np.sign(n) * ((2 * k * abs(n) + lead) // (2 * lead)) for n in (x, y, z, 0)], axis=1)
    return np.diff(made, axis=0).astype(np.int8)


def top_speed_hz(stream: Ticks) -> float:
    """Highest step frequency in a stream."""
    return float(1e9 / np.diff(stream.t_ns).min())
