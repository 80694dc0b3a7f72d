"""10^5 queries over each transport: every reply right and in its place, and the server does not grow.

Each query sets the user information to a number of its own and asks for it, some of them on their way at once:

    host   @0IU17 @0U @0IU18 @0U ...
    twin   0 0UserInfo: 17 0 0UserInfo: 18 ...
"""

from __future__ import annotations

import subprocess
import sys
from collections.abc import Iterator

import serial

from tests.reliability.figures import Figure, growth_mb, main, serving

NUMBER = 100_000
WARM = 2_000
"""Queries before memory is looked at for the first time: caches fill, code is compiled."""
AT_ONCE = 8
GROWTH_MB = 5.0


def wrong_replies(port: serial.Serial, first: int, last: int) -> int:
    """Set and ask for the numbers first .. last - 1; return how many were answered wrongly."""
    wrong = 0
    for begin in range(first, last, AT_ONCE):
        numbers = range(begin, min(begin + AT_ONCE, last))
        port.write("".join(f"@0IU{number}\r@0U\r" for number in numbers).encode())
        for number in numbers:
            expected = f"00UserInfo: {number}".encode()
            got = port.read(len(expected))
            end = port.read_until(b"\n")
            if got != expected or end.strip():
                wrong += 1
    return wrong


def over(kind: str, number: int) -> Iterator[Figure]:
    """Figures of one endpoint of a server."""
    options = {"pty": "--pty"}.get(kind, f"--{kind}=127.0.0.1:0")
    with serving(options) as served, served.open(kind) as port:
        warm = min(WARM, number)
        wrong = wrong_replies(port, 0, warm)

        def work() -> None:
            nonlocal wrong
            wrong += wrong_replies(port, warm, warm + number // 2)

        grown = growth_mb(served.pid, work)
    yield Figure(f"{kind}: wrong or missing replies to {number} queries", wrong, "", 0)
    yield Figure(f"{kind}: growth", grown, "MB", GROWTH_MB)


IN_PROCESS = """
import os, sys
import isel_twin, serial
from tests.reliability.figures import growth_mb
from tests.reliability.queries import WARM, wrong_replies
number = int(sys.argv[1])
with serial.serial_for_url("twin://imc-s8?plant=kinematic", timeout=60) as port:
    warm = min(WARM, number)
    wrong = [wrong_replies(port, 0, warm)]
    grown = growth_mb(os.getpid(), lambda: wrong.append(wrong_replies(port, warm, warm + number // 2)))
print(sum(wrong), grown)
"""


def in_process(number: int) -> Iterator[Figure]:
    """Figures of `twin://`, in a process of its own."""
    run = subprocess.run([sys.executable, "-c", IN_PROCESS, str(number)], stdout=subprocess.PIPE, text=True, check=True)
    wrong, grown = run.stdout.split()
    yield Figure(f"twin://: wrong or missing replies to {number} queries", int(wrong), "", 0)
    yield Figure("twin://: growth", float(grown), "MB", GROWTH_MB)


def measure(number: int) -> list[Figure]:
    return [figure for kind in ("pty", "tcp", "rfc2217") for figure in over(kind, number)] + list(in_process(number))


if __name__ == "__main__":
    main(measure, NUMBER)
