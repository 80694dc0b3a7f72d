"""Whatever the twin is busy with, signals and control bytes are heard at once.

The figure is 100 ms (docs/reliability.md); the limit here allows for a computer that has other things to do.
"""

from __future__ import annotations

import signal
import time

import pytest

from tests.bridge.conftest import STOP_S, Served, ask

HEARD_S = STOP_S
"""Far more than it takes on the busiest computer, and less than what is going on would: that lasts for ever."""

ENDLESS = ("@07", "@0N7", "@0i", "0100,5000,0,30,0,30,0,30", "0-100,5000,0,30,0,30,0,30", "30,-2", "9")
"""A stored program that goes to and fro for ever."""


def seconds_to_stop(served: Served, number: int) -> float:
    began = time.monotonic()
    assert served.stop(number) == 0
    return time.monotonic() - began


@pytest.mark.parametrize(
    ("speed", "interval_s"),
    [("1000", "0.01"), ("1", "0.00001"), ("1000000", "0.01")],
    ids=["speed 1000", "100 000 samples a second", "speed 10^6"],
)
def test_an_idle_server_that_records_can_be_stopped(serve, tmp_path, speed, interval_s):
    served = serve("--record", str(tmp_path / "samples.parquet"), "--interval", interval_s, speed=speed)
    time.sleep(1.5)  # longer than an idle server sleeps, so that there is a stretch of time to look at
    assert seconds_to_stop(served, signal.SIGTERM) < HEARD_S
    assert (tmp_path / "samples.parquet").exists()


@pytest.mark.parametrize("speed", ["1", "1000000", "max"])
def test_an_endless_program_can_be_broken_off(serve, speed):
    served = serve(speed=speed)
    with served.open() as port:
        assert [ask(port, command) for command in ENDLESS] == ["0"] * len(ENDLESS)
        port.write(b"@0S\r")
        time.sleep(0.5)
        began = time.monotonic()
        port.write(b"\xff")
        assert port.read() == b"F"
        assert time.monotonic() - began < HEARD_S
        assert ask(port, "@0P", 19)[0] == "0"
    assert seconds_to_stop(served, signal.SIGTERM) < HEARD_S


@pytest.mark.parametrize("speed", ["1", "1000000", "max"])
def test_a_server_in_the_midst_of_an_endless_program_can_be_stopped(serve, speed):
    served = serve(speed=speed)
    with served.open() as port:
        assert [ask(port, command) for command in ENDLESS] == ["0"] * len(ENDLESS)
        port.write(b"@0S\r")
        time.sleep(0.5)
        assert seconds_to_stop(served, signal.SIGTERM) < HEARD_S


def test_a_hung_up_terminal_ends_the_server_like_any_other_signal(serve, tmp_path):
    link, record = tmp_path / "imc", tmp_path / "session.npz"
    served = serve("--pty", str(link), "--record", str(record))
    assert seconds_to_stop(served, signal.SIGHUP) < HEARD_S
    assert record.exists()
    assert not link.is_symlink()
