"""How soon a control byte and a signal are heard, whatever the twin is busy with: within 100 ms of wall time."""

from __future__ import annotations

import os
import signal
import tempfile
import time
from pathlib import Path

from tests.reliability.figures import Figure, Process, ask, main, serving

NUMBER = 20
LIMIT_MS = 100.0

ENDLESS = ("@07", "@0N7", "@0i", "0100,5000,0,30,0,30,0,30", "0-100,5000,0,30,0,30,0,30", "30,-2", "9")
"""A stored program that goes to and fro for ever."""

STATES = (("1", "kinematic"), ("1", "mujoco"), ("100", "mujoco"), ("1000000", "kinematic"), ("max", "kinematic"))
"""Speed and plant."""


def heard_ms(served: Process, times: int) -> list[float]:
    """Time from byte 255 to the reply of the program that it breaks off."""
    taken = []
    with served.open("pty") as port:
        for command in ENDLESS:
            if ask(port, command) != "0":
                raise RuntimeError(f"{command} was refused")
        for _ in range(times):
            port.write(b"@0S\r")
            time.sleep(0.1)
            began = time.perf_counter()
            port.write(b"\xff")
            if port.read() != b"F":
                raise RuntimeError("the program was not broken off")
            taken.append((time.perf_counter() - began) * 1e3)
        port.write(b"@0S\r")
        time.sleep(0.1)
    return taken


def stopped_ms(served: Process, link: Path) -> float:
    """Time from SIGTERM until the server has let go of its port."""
    began = time.perf_counter()
    served.process.send_signal(signal.SIGTERM)
    while os.path.lexists(link):
        time.sleep(0.001)
    return (time.perf_counter() - began) * 1e3


def measure(number: int) -> list[Figure]:
    figures = []
    with tempfile.TemporaryDirectory() as folder:
        link = Path(folder, "imc")
        for speed, plant in STATES:
            with serving("--pty", str(link), speed=speed, plant=plant) as served:
                slowest = max(heard_ms(served, number))
                stopped = stopped_ms(served, link)
                served.process.wait(60)
            ramp = "" if speed != "1" else ", stop ramp and line included"
            figures += [
                Figure(
                    f"speed {speed}, {plant}: byte 255 in an endless program, slowest of {number}{ramp}",
                    slowest,
                    "ms",
                    LIMIT_MS,
                ),
                Figure(f"speed {speed}, {plant}: SIGTERM in an endless program", stopped, "ms", LIMIT_MS),
            ]
        for speed, interval_s in (("1000", "0.01"), ("1", "0.00001")):
            record = ("--record", str(Path(folder, "samples.parquet")), "--interval", interval_s)
            with serving("--pty", str(link), *record, speed=speed) as served:
                time.sleep(2.0)
                stopped = stopped_ms(served, link)
                served.process.wait(60)
            figures.append(
                Figure(f"speed {speed}, idle, a sample every {interval_s} s: SIGTERM", stopped, "ms", LIMIT_MS)
            )
    return figures


if __name__ == "__main__":
    main(measure, NUMBER)
