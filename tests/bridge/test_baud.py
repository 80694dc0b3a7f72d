"""Hosts whose port is set otherwise than the controller's line (19200 8N1)."""

from __future__ import annotations

import logging
import os
import time
from typing import Any

import pytest
import serial

from isel_twin.bridge.serve.borders import Endpoint
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.tcp import TcpEndpoint
from isel_twin.bridge.serve.uart import heard
from isel_twin.controller import SerialFormat
from tests.bridge.conftest import REPLY_S, ask

LINE = SerialFormat(19_200)


def opened(end: Endpoint, **settings: Any) -> serial.Serial:
    where = f"rfc2217://{end.address}" if end.kind == "rfc2217" else end.address
    return serial.serial_for_url(where, **{"baudrate": 19_200, "timeout": REPLY_S, **settings})


def rfc2217() -> TcpEndpoint:
    return TcpEndpoint("127.0.0.1:0", "rfc2217", Rfc2217Codec)


def warnings(caplog: pytest.LogCaptureFixture) -> list[str]:
    return [record.getMessage() for record in caplog.records if "port is set to" in record.getMessage()]


@pytest.mark.parametrize("end", [PtyEndpoint, rfc2217], ids=["pty", "rfc2217"])
def test_another_speed_is_told_once_and_works_all_the_same(serving, caplog, end):
    caplog.set_level(logging.WARNING)
    here = end()
    server = serving(here)
    with opened(here, baudrate=9600) as port:
        for _ in range(3):
            assert ask(port, "@0P", 19) == "0" * 19
        (row,) = server.ports()
        assert row == {"kind": here.kind, "address": here.address, "host": "9600 8N1", "fits": False}
        assert warnings(caplog) == [
            f"{here.kind} {here.address}: the host's port is set to 9600 8N1, the controller's line has 19200 8N1; "
            "a real line would garble each byte, here it does not matter (--strict-baud: as on a real line)"
        ]
    with opened(here) as port:
        assert ask(port, "@0P", 19) == "0" * 19
        assert server.ports()[0]["fits"] is True
    with opened(here, baudrate=9600) as port:  # somebody else, who has to be told, too
        assert ask(port, "@0P", 19) == "0" * 19
    assert len(warnings(caplog)) == 2


@pytest.mark.parametrize("end", [PtyEndpoint, rfc2217], ids=["pty", "rfc2217"])
def test_the_right_speed_and_a_second_stop_bit_are_no_matter(serving, caplog, end):
    here = end()
    serving(here, strict_baud=True)
    with opened(here, stopbits=2) as port:
        assert ask(port, "@0P", 19) == "0" * 19
    assert warnings(caplog) == []


def test_parity_and_data_bits_are_seen_over_rfc_2217(serving, caplog):
    here = rfc2217()
    serving(here)
    with opened(here, parity="E", bytesize=7) as port:
        assert ask(port, "@0P", 19) == "0" * 19
    (told,) = warnings(caplog)
    assert "is set to 19200 7E1" in told


def test_a_raw_port_and_a_program_that_sets_nothing_are_not_suspected(serving, caplog):
    pty, tcp = PtyEndpoint(), TcpEndpoint("127.0.0.1:0")
    serving(pty, tcp)
    with serial.serial_for_url(f"socket://{tcp.address}", timeout=REPLY_S) as port:
        assert ask(port, "@0P", 19) == "0" * 19
    file = os.open(pty.address, os.O_RDWR | os.O_NOCTTY)
    try:
        os.write(file, b"@07\r")
        assert os.read(file, 1) == b"0"
    finally:
        os.close(file)
    assert warnings(caplog) == []


@pytest.mark.parametrize("baud", [300, 19_200, 31_250, 250_000])
def test_a_pseudo_terminal_begins_with_the_speed_of_the_line(baud):
    class Line:
        serial_format = SerialFormat(baud)

    here = PtyEndpoint()
    try:
        here.attach(Line())
        assert here.settings == {"baudrate": baud, "stopbits": 1}
        with opened(here, baudrate=9600):
            assert here.settings == {"baudrate": 9600, "stopbits": 1}
    finally:
        here.close()


class Told:
    """What the twin is told."""

    def __init__(self) -> None:
        self.sent = b""

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        self.sent += data if sent else b""

    def look(self, time_ns: int) -> None: ...
    def act(self, time_ns: int, text: str) -> None: ...
    def close(self) -> None: ...


@pytest.mark.parametrize("end", [PtyEndpoint, rfc2217], ids=["pty", "rfc2217"])
@pytest.mark.parametrize("speed", [None, 1.0], ids=["max", "real time"])
def test_a_strict_line_garbles_what_the_host_says(serving, end, speed):
    here, told = end(), Told()
    serving(here, strict_baud=True, wire=told, speed=speed)
    with opened(here, baudrate=9600) as port:
        port.write(b"@0P\r")
        end_s = time.monotonic() + REPLY_S
        while not told.sent and time.monotonic() < end_s:
            time.sleep(0.01)
    assert told.sent == heard(b"@0P\r", SerialFormat(9600), LINE).data
    assert told.sent != b"@0P\r"


@pytest.mark.parametrize("end", [PtyEndpoint, rfc2217], ids=["pty", "rfc2217"])
@pytest.mark.parametrize("speed", [None, 1.0], ids=["max", "real time"])
def test_a_strict_line_garbles_what_the_controller_says(serving, end, speed):
    """At 0.948 of the speed the host is understood: 9 <= 9.5 * 0.948. It hears 9.5 / 0.948 = 10.02 bits, one too many:
    its last sample falls into the next start bit, which therefore is not seen to begin.
    """
    here, slow = end(), SerialFormat(18_202)
    serving(here, strict_baud=True, speed=speed)
    expected = heard(b"0" * 19, LINE, slow)
    assert expected.framing_errors > 0
    assert expected.data[:1] == b"0"
    assert expected.data != b"0" * 19
    with opened(here, baudrate=slow.baud) as port:
        port.write(b"@0P\r")
        assert port.read(len(expected.data)) == expected.data
