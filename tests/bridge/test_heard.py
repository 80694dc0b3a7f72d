"""Whatever the twin is busy with, signals and control bytes are heard at once.

The figure is 100 ms (docs/reliability.md). Here they are heard at all, while what is going on would last for ever.
"""

from __future__ import annotations

import json
import signal
import socket
import time

import pytest

from tests.bridge.conftest import REPLY_S, ask

pytestmark = pytest.mark.long(seconds=8)

ENDLESS = ("@07", "@0N7", "@0i", "0100,5000,0,30,0,30,0,30", "0-100,5000,0,30,0,30,0,30", "30,-2", "9")
"""A stored program that goes to and fro for ever."""


@pytest.fixture
def busy(serve):
    """busy(speed) -> a server in the midst of an endless program, and its port."""
    ports = []

    def begin(speed: str):
        served = serve("--pty", "--control", "127.0.0.1:0", speed=speed)
        ports.append(port := served.open())
        assert [ask(port, command) for command in ENDLESS] == ["0"] * len(ENDLESS)
        port.write(b"@0S\r")
        host, number = served.info["control"].rsplit(":", 1)
        with socket.create_connection((host, int(number)), REPLY_S) as line, line.makefile("rw") as control:
            print(json.dumps({"wait": {"output": "moving", "is": 1}}), file=control, flush=True)
            assert "ok" in json.loads(control.readline())
        return served, port

    yield begin
    for port in ports:
        port.close()


@pytest.mark.parametrize(
    ("speed", "interval_s"),
    [("1000", "0.01"), ("1", "0.00001"), ("1000000", "1.0")],
    ids=["speed 1000", "100 000 samples a second", "speed 10^6"],
)
def test_an_idle_server_that_records_can_be_stopped(serve, tmp_path, speed, interval_s):
    served = serve("--record", str(tmp_path / "samples.parquet"), "--interval", interval_s, speed=speed)
    time.sleep(1.5)  # longer than an idle server sleeps, so that there is a stretch of time to look at
    assert served.stop(signal.SIGTERM) == 0
    assert (tmp_path / "samples.parquet").exists()


@pytest.mark.parametrize("speed", ["1", "1000000", "max"])
def test_an_endless_program_can_be_broken_off(busy, speed):
    served, port = busy(speed)
    port.write(b"\xff")
    assert port.read() == b"F"
    assert ask(port, "@0P", 19)[0] == "0"
    assert served.stop(signal.SIGTERM) == 0


@pytest.mark.parametrize("speed", ["1", "1000000", "max"])
def test_a_server_in_the_midst_of_an_endless_program_can_be_stopped(busy, speed):
    served, _ = busy(speed)
    assert served.stop(signal.SIGTERM) == 0


def test_a_hung_up_terminal_ends_the_server_like_any_other_signal(serve, tmp_path):
    link, record = tmp_path / "imc", tmp_path / "session.npz"
    served = serve("--pty", str(link), "--record", str(record))
    assert served.stop(signal.SIGHUP) == 0
    assert record.exists()
    assert not link.is_symlink()
