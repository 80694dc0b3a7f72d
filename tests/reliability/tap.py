"""A tap between a host and a twin at speed 1: every byte that the twin saw, and its time within 2 ms.

    host --pty--> isel-twin tap --pty--> Server with a twin, which notes bytes and virtual times itself
                       |                    |
                    real.mcap            its own notes         byte by byte: same bytes, same times but for one offset

The offset, between the tap's start and the twin's power-on, is the median of all differences. The session is questions
and answers, each byte of which takes its time on the line (19200 baud: 0.52 ms).
"""

from __future__ import annotations

import json
import signal
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import serial
from mcap.reader import make_reader

from isel_twin import Twin
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.server import Server
from tests.reliability.figures import REPLY_S, Figure, ask, main

NUMBER = 500
LIMIT_MS = 2.0
Timed = list[tuple[int, int]]
"""A byte and its time in ns."""


class Notes:
    """What the twin's server sees."""

    def __init__(self) -> None:
        self.bytes: dict[bool, Timed] = {True: [], False: []}

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        self.bytes[sent] += [(byte, time_ns) for byte in data]

    def look(self, time_ns: int) -> None:
        pass

    def act(self, time_ns: int, text: str) -> None:
        pass

    def close(self) -> None:
        pass


def recorded(file: Path) -> dict[bool, Timed]:
    found: dict[bool, Timed] = {True: [], False: []}
    with file.open("rb") as stream:
        for _, channel, message in make_reader(stream).iter_messages(topics=["/host/sent", "/host/received"]):
            data = bytes.fromhex(json.loads(message.data)["hex"])
            found[channel.topic == "/host/sent"] += [(byte, message.log_time) for byte in data]
    return found


@contextmanager
def tapped(twin: Twin, file: Path, wire: Notes | None = None) -> Iterator[serial.Serial]:
    """A port whose host speaks through `isel-twin tap` with this twin at speed 1; the recording is whole at the end."""
    endpoint = PtyEndpoint()
    server = Server(twin, Pacer(1.0), [endpoint], wire=wire)
    thread = threading.Thread(target=server.run)
    thread.start()
    command = [sys.executable, "-m", "isel_twin", "tap", endpoint.address, "--record", str(file)]
    tap = subprocess.Popen(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True)
    try:
        assert tap.stdout is not None
        with serial.Serial(json.loads(tap.stdout.readline())["pty"], 19_200, timeout=REPLY_S) as port:
            yield port
        tap.send_signal(signal.SIGTERM)
        tap.wait(REPLY_S)
    finally:
        tap.kill()
        tap.communicate()
        server.stop()
        thread.join()


def session(number: int, folder: Path) -> tuple[dict[bool, Timed], dict[bool, Timed]]:
    """So many questions; what the twin saw, and what was recorded."""
    seen, file = Notes(), folder / "real.mcap"
    with tapped(Twin(plant="kinematic", line_speed=True), file, seen) as port:
        for _ in range(number):
            ask(port, "@0P", 19)
            time.sleep(0.005)
    return seen.bytes, recorded(file)


def measure(number: int) -> list[Figure]:
    with tempfile.TemporaryDirectory() as folder:
        seen, noted = session(number, Path(folder))
    wrong, apart = 0, []
    for sent in (True, False):
        wrong += abs(len(seen[sent]) - len(noted[sent]))
        for (theirs, theirs_ns), (ours, ours_ns) in zip(seen[sent], noted[sent], strict=False):
            wrong += theirs != ours
            apart.append((theirs_ns - ours_ns) / 1e6)
    offset = statistics.median(apart)
    farthest = sorted(abs(value - offset) for value in apart)
    return [
        Figure(f"bytes of {number} questions and answers that a tap recorded otherwise than the twin", wrong, "", 0),
        Figure("their times apart, 99 of 100", farthest[int(0.99 * (len(farthest) - 1))], "ms", LIMIT_MS),
        Figure("the farthest apart", farthest[-1], "ms"),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
