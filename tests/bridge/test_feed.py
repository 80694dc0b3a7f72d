"""A host that feeds a program to a control over a real port: it is held back, and nothing is lost."""

from __future__ import annotations

import json
import socket
import time

import serial

from isel_twin.bridge.serve.server import LINE_BYTES

CONTROL = ("--controller", "bwo900", "--machine", "4030-servo", "--control", "127.0.0.1:0")
REFERENCE = b"D\r\nP8683: 1\r\nP12530: 1\r\nP12330: 1\r\nP12130: 1\r\n#\r\n"
FEED = b"D\r\nP8811: 1\r\nP8800: 1\r\nP8683: 2\r\nP8684: 1\r\n#\r\n"


def program(blocks: int) -> bytes:
    """Short moves that end at 7 mm, 9 mm."""
    rows = [f"N{n} X{n % 50}.{n % 10:03d} Y{n // 50 % 50}.000" for n in range(2, blocks - 1)]
    rows = ["P1", "N1 G1 F6000 X0", *rows, f"N{blocks - 1} X7 Y9", f"N{blocks} M30", "#", ""]
    return "\r\n".join(rows).encode()


def state(served) -> dict:
    """As the control port tells it."""
    host, _, number = served.info["control"].rpartition(":")
    with socket.create_connection((host, int(number)), timeout=30.0) as line, line.makefile("rw") as file:
        file.write('{"state": true}\n')
        file.flush()
        return json.loads(file.readline())["ok"]


def referenced(served):
    """A port of a machine whose reference runs are over."""
    port = served.open()
    port.write(REFERENCE)
    port.write_timeout = 60.0
    wait(lambda: (now := state(served))["time_ns"] > 5e9 and not now["outputs"].get("moving"))
    return port


def held_at(port, data: bytes) -> int:
    """How much of it the port takes before the host has to wait for long."""
    for at in range(0, len(data), 1024):
        try:
            port.write(data[at : at + 1024])
        except serial.SerialTimeoutException:
            return at
    return len(data)


def wait(ready) -> None:
    until = time.monotonic() + 60.0
    while not ready() and time.monotonic() < until:
        time.sleep(0.1)
    assert ready()


def test_a_host_that_writes_without_looking_is_held_back_and_nothing_is_lost(serve) -> None:
    """Three times what the control and all buffers hold, in one write."""
    served = serve(*CONTROL)
    port = referenced(served)
    port.write(FEED + program(12_000))
    wait(lambda: state(served)["counts"] == [7000, 9000, 0])
    port.close()


def test_a_paced_machine_takes_no_more_than_it_needs(serve) -> None:
    served = serve(*CONTROL, speed="50")
    port = referenced(served)
    port.write(FEED)
    port.write_timeout = 2.0
    data = program(20_000)
    sent = held_at(port, data)
    assert LINE_BYTES < sent < len(data) // 2
    port.close()
