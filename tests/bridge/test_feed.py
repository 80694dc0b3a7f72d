"""A host that feeds a program to a control over a real port: it is held back, and nothing is lost."""

from __future__ import annotations

import json
import os
import socket

import pytest

from isel_twin.bridge.serve.server import LINE_BYTES
from tests.bridge.conftest import REPLY_S, until

CONTROL = ("--controller", "bwo900", "--machine", "4030-servo", "--control", "127.0.0.1:0")
REFERENCE = b"D\r\nP8683: 1\r\nP12530: 1\r\nP12330: 1\r\nP12130: 1\r\n#\r\n"
FEED = b"D\r\nP8811: 1\r\nP8800: 1\r\nP8683: 2\r\nP8684: 1\r\n#\r\n"


def program(blocks: int) -> bytes:
    """Short moves that end at 7 mm, 9 mm."""
    rows = [f"N{n} X{n % 50}.{n % 10:03d} Y{n // 50 % 50}.000" for n in range(2, blocks - 1)]
    rows = ["P1", "N1 G1 F6000 X0", *rows, f"N{blocks - 1} X7 Y9", f"N{blocks} M30", "#", ""]
    return "\r\n".join(rows).encode()


def ask(served, **request) -> dict:
    """What the control port answers; the server has looked at its line before."""
    host, _, number = served.info["control"].rpartition(":")
    with socket.create_connection((host, int(number)), timeout=REPLY_S) as line, line.makefile("rw") as file:
        print(json.dumps(request), file=file, flush=True)
        return json.loads(file.readline())["ok"]


@pytest.fixture
def fed(serve):
    """A served machine whose reference runs are over, and its port."""
    served = serve(*CONTROL)
    with served.open() as port:
        port.write(REFERENCE)
        until(lambda: (now := ask(served, state=True))["time_ns"] > 5e9 and not now["outputs"].get("moving"))
        yield served, port


def held_at(served, port, data: bytes) -> int:
    """How much of it the port takes before the host would have to wait: also after three looks there is no room."""
    at = looks = 0
    while at < len(data) and looks < 3:
        try:
            at += os.write(port.fd, data[at : at + 1024])
            looks = 0
        except BlockingIOError:
            ask(served, state=True)
            looks += 1
    return at


def test_a_host_that_writes_without_looking_is_held_back_and_nothing_is_lost(fed) -> None:
    """Three times what the control and all buffers hold, in one write."""
    served, port = fed
    port.write(FEED + program(5000))
    until(lambda: ask(served, state=True)["counts"] == [7000, 9000, 0])


def test_a_paced_machine_takes_no_more_than_it_needs(fed) -> None:
    served, port = fed
    ask(served, speed=0.01)
    data = FEED + program(20_000)
    assert LINE_BYTES < held_at(served, port, data) < len(data) // 2
