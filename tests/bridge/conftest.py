"""Real `isel-twin serve` processes, and in-process servers, for the tests of the bridge."""

from __future__ import annotations

import json
import select
import signal
import threading
import time
from collections.abc import Callable, Iterator
from typing import Any

import pytest
import serial

from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.server import Server
from isel_twin.core.twin import Twin
from tests.forked import PATIENCE_S, start

START_S = STOP_S = REPLY_S = PATIENCE_S


def until(true: Callable[[], object]) -> None:
    """Wait for it, however busy the computer is: what never comes takes REPLY_S to fail."""
    end = time.monotonic() + REPLY_S
    while not true():
        assert time.monotonic() < end
        time.sleep(0.01)


class Served:
    """A running `isel-twin serve`, or another command that listens, and what it said when it did."""

    def __init__(self, arguments: tuple[str, ...], name: str = "serve", start: Callable[..., Any] = start) -> None:
        self.process = start(name, *arguments)
        ready, _, _ = select.select([self.process.stdout], [], [], START_S)
        line = self.process.stdout.readline() if ready else ""
        if not line:
            self.process.kill()
            pytest.fail(f"{name} did not listen: {self.process.communicate()[1]}")
        self.info: dict[str, Any] = json.loads(line)

    def open(self, key: str = "pty") -> serial.Serial:
        """A host program's port: the device, or the network address behind `key`."""
        address = self.info[key]
        urls = {"pty": address, "tcp": f"socket://{address}", "rfc2217": f"rfc2217://{address}"}
        return serial.serial_for_url(urls[key], baudrate=19_200, timeout=REPLY_S)

    def stop(self, number: int) -> int:
        """Send a signal; return the exit code."""
        self.process.send_signal(number)
        return self.process.wait(STOP_S)

    def end(self) -> None:
        """End it if it still runs."""
        if self.process.poll() is None:
            self.process.terminate()
        try:
            self.process.communicate(timeout=STOP_S)
        finally:
            self.process.kill()


@pytest.fixture(autouse=True, scope="session")
def a_hang_up_is_heard() -> Iterator[None]:
    """Also if these tests were started by `nohup`, which would have the servers ignore it as they should."""
    before = signal.signal(signal.SIGHUP, signal.SIG_DFL)
    yield
    signal.signal(signal.SIGHUP, before)


@pytest.fixture
def serve() -> Iterator[Callable[..., Served]]:
    """serve(*arguments) starts a process and waits until it listens. Protocol only, as fast as possible by default."""
    started: list[Served] = []

    def start(*arguments: str, speed: str = "max", plant: str = "kinematic") -> Served:
        started.append(Served(("--plant", plant, "--speed", speed, *arguments)))
        return started[-1]

    yield start
    for served in started:
        served.end()


@pytest.fixture
def serving() -> Iterator[Callable[..., Server]]:
    """serving(endpoint, ...) runs a server in a thread of this process."""
    running: list[tuple[Server, threading.Thread]] = []

    def start(*endpoints: Endpoint, speed: float | None = None, **options: Any) -> Server:
        twin = Twin(plant="kinematic", line_speed=speed is not None)
        server = Server(twin, Pacer(speed), endpoints, **options)
        thread = threading.Thread(target=server.run, daemon=True)
        thread.start()
        running.append((server, thread))
        return server

    yield start
    for server, thread in running:
        server.stop()
        thread.join(STOP_S)
        assert not thread.is_alive()


def ask(port: serial.Serial, command: str, size: int = 1) -> str:
    """Send a command with CR, read a reply of `size` bytes."""
    port.write(command.encode() + b"\r")
    return port.read(size).decode()
