"""The iSMIF on the test desk, and what its streams must be, from closed forms; nothing here is the twin's code.

Ramp law: the leading axis starts with f0, rises evenly to V within R, stays, falls the same way: that of closed_forms
with a = (V - f0) / R.
"""

from __future__ import annotations

from collections.abc import Iterable
from fractions import Fraction

import numpy as np
from conformance.closed_forms import times_ns

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


def pulse_times_ns(
    steps: int, v: int, f0: int = 200, ramp_ms: int = 500, error_ppm: int = 0, ticks: Iterable[int] | None = None
) -> list[int]:
    """Times in ns of leading pulses 1 .. steps after the start, or of those given; the error is that of the output
    frequency."""
    scale = 1 + Fraction(error_ppm, 1_000_000)
    if v <= f0 or ramp_ms == 0:
        return times_ns(steps, v * scale, v * scale, 1, ticks)
    return times_ns(steps, v * scale, f0 * scale, (v - f0) * scale * 1000 / ramp_ms, ticks)


def top_speed_hz(stream: Ticks) -> float:
    """Highest step frequency in a stream."""
    return float(1e9 / np.diff(stream.t_ns).min())
