"""A tap between a host and a twin that stands in for the real controller."""

from __future__ import annotations

import json
import os
import select
import signal
import socket
import subprocess
import sys
import threading
import time
import tty
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
import serial
from mcap.reader import NonSeekingReader

from tests.bridge.conftest import REPLY_S, STOP_S, Served, ask

SESSION = (("@07", 1), ("@0R7", 1), ("@0A 1600,5000,800,5000,0,5000,0,30", 1), ("@0P", 19), ("@0Q", 1), ("@0P", 19))


@pytest.fixture
def tap() -> Iterator[Callable[..., Served]]:
    """tap(*arguments) starts one and waits until it listens."""
    started: list[Served] = []

    def start(*arguments: str) -> Served:
        started.append(Served(arguments, "tap"))
        return started[-1]

    yield start
    for tapped in started:
        if tapped.process.poll() is None:
            tapped.process.terminate()
        tapped.process.communicate(timeout=STOP_S)


def recorded(file: Path) -> tuple[bytes, bytes]:
    """Bytes sent and received in a recording, also in one that is cut off."""
    found = {"/host/sent": b"", "/host/received": b""}
    for _, channel, message in messages(file):
        if channel in found:
            found[channel] += bytes.fromhex(json.loads(message)["hex"])
    return found["/host/sent"], found["/host/received"]


def messages(file: Path) -> list[tuple[int, str, bytes]]:
    rows = []
    with file.open("rb") as stream:
        try:
            for _, channel, message in NonSeekingReader(stream).iter_messages(log_time_order=False):
                rows.append((message.log_time, channel.topic, message.data))
        except Exception:  # it is cut off in the middle
            pass
    return rows


def talk(port: serial.Serial) -> tuple[bytes, bytes]:
    """The session; what was sent and what came."""
    replies = [ask(port, command, size) for command, size in SESSION]
    return b"".join(command.encode() + b"\r" for command, _ in SESSION), "".join(replies).encode()


@pytest.mark.parametrize("controllers_side", ["pty", "tcp", "rfc2217"])
@pytest.mark.parametrize("hosts_side", ["pty", "tcp", "rfc2217"])
def test_everything_passes_and_is_recorded(serve, tap, tmp_path, controllers_side, hosts_side):
    served = serve(f"--{controllers_side}", *([] if controllers_side == "pty" else ["127.0.0.1:0"]))
    address = served.info[controllers_side]
    device = address if controllers_side == "pty" else f"{controllers_side}://{address}"
    where = [str(tmp_path / "imc")] if hosts_side == "pty" else ["127.0.0.1:0"]
    tapped = tap(device, f"--{hosts_side}", *where, "--record", str(tmp_path / "real.mcap"))
    with tapped.open(hosts_side) as port:
        sent, came = talk(port)
        assert len(came) == sum(size for _, size in SESSION)
    assert tapped.stop(signal.SIGTERM) == 0
    assert recorded(tmp_path / "real.mcap") == (sent, came)
