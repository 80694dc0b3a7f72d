"""`@0P` over a pseudo terminal at speed max, against a process that does nothing but echo: at most three times as long.

Both are asked by turns, so that whatever else the computer does troubles both alike; the ratio is the median of those
of neighbouring batches.
"""

from __future__ import annotations

import os
import statistics
import subprocess
import sys
import time

from tests.reliability.figures import Figure, main, serving

NUMBER = 20_000
BATCH = 50
LIMIT = 3.0

ECHO = """
import os, tty
master, slave = os.openpty()
tty.setraw(slave)
print(os.ttyname(slave), flush=True)
while True:
    for _ in range(os.read(master, 4096).count(b"\\r")):
        os.write(master, b"0" * 19)
"""


def round_trips_s(device: int, number: int) -> list[float]:
    """Times from the command to the last byte of its 19-byte reply."""
    times = []
    for _ in range(number):
        began = time.perf_counter()
        os.write(device, b"@0P\r")
        missing = 19
        while missing:
            missing -= len(os.read(device, missing))
        times.append(time.perf_counter() - began)
    return times


def measure(number: int) -> list[Figure]:
    echo = subprocess.Popen([sys.executable, "-c", ECHO], stdout=subprocess.PIPE, text=True)
    assert echo.stdout is not None
    try:
        with serving("--pty") as served:
            devices = [
                os.open(name, os.O_RDWR | os.O_NOCTTY) for name in (echo.stdout.readline().strip(), served.info["pty"])
            ]
            for device in devices:
                round_trips_s(device, BATCH)
            batches = [
                [statistics.median(round_trips_s(device, BATCH)) for device in devices]
                for _ in range(max(1, number // BATCH))
            ]
            for device in devices:
                os.close(device)
    finally:
        echo.kill()
        echo.wait()
    bare, twin = (statistics.median(taken) for taken in zip(*batches, strict=True))
    return [
        Figure("round trip of a bare echo over a pseudo terminal, median", bare * 1e6, "us"),
        Figure("round trip of `@0P`, median", twin * 1e6, "us"),
        Figure("ratio", statistics.median(twin / bare for bare, twin in batches), "", LIMIT),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
