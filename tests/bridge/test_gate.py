"""No web page moves a machine: who is no host is turned away before a byte reaches the line, and hosts get through."""

from __future__ import annotations

import logging
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.bridge.serve.gate import HOLD_S, Gate, GreetingError
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.tcp import TcpEndpoint
from tests.bridge.conftest import REPLY_S, ask
from tests.bridge.test_network import LOOPBACK, connect, read_all, read_exactly
from tests.bridge.test_tap import opened, tapping

BODY = b"@07\r@0A1600,800,0,30,0,30,0,30\r"
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1:5000\r\nContent-Type: text/plain\r\nContent-Length: 32\r\n\r\n" + BODY
FOREIGN = {
    "a form": POST,
    "an image": b"GET /@07 HTTP/1.1\r\nHost: x\r\n\r\n",
    "a socket": b"GET /chat HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n",
    "asked before": b"OPTIONS / HTTP/1.1\r\nOrigin: http://evil.example\r\n\r\n",
    "HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "https": bytes.fromhex("1603010200010001fc0303") + BODY,
    "WebRTC": bytes.fromhex("000300002112a442") + bytes(12),
    "ssh": b"SSH-2.0-OpenSSH_9.6\r\n",
    "smb": bytes.fromhex("00000054ff534d42") + bytes(20),
    "smb2": bytes.fromhex("00000054fe534d42") + bytes(20),
}
HOSTS = {
    "iMC": b"@07\r",
    "iMC, a stop": b"\xfd",
    "iSMIF": b"L1,X3000<1>\r",
    "GMI99": b"Q7;1\r",
    "a program": b"P1\rN10 G1 X10\r",
    "letters of GET": b"GE",
    "letters of POST": b"POS1\r",
    "a nought": b"\x00",
    "a frame": b"\x02\x00\x16\x01",
    "Telnet": b"\xff\xfb\x2c\xff\xfd\x2c",
}


@pytest.mark.parametrize("data", FOREIGN.values(), ids=FOREIGN)
@pytest.mark.parametrize("piece", [1, 2, 4096])
def test_nothing_of_a_foreign_greeting_goes_on(data: bytes, piece: int) -> None:
    gate, passed, turned_away = Gate(), b"", False
    for at in range(0, len(data), piece):
        try:
            passed += gate.take(data[at : at + piece])
        except GreetingError:
            turned_away = True
            break
    assert (passed, turned_away) == (b"", True)


@pytest.mark.parametrize("data", HOSTS.values(), ids=HOSTS)
@pytest.mark.parametrize("piece", [1, 4096])
def test_all_of_a_host_goes_on(data: bytes, piece: int) -> None:
    gate = Gate()
    passed = b"".join(gate.take(data[at : at + piece]) for at in range(0, len(data), piece))
    assert passed + gate.release() == data


@given(st.lists(st.binary(max_size=12), max_size=6))
def test_nothing_is_lost_or_out_of_order(pieces: list[bytes]) -> None:
    gate, passed = Gate(), b""
    try:
        for piece in pieces:
            passed += gate.take(piece)
    except GreetingError:
        assert passed == b""
    else:
        assert passed + gate.release() == b"".join(pieces)


@pytest.fixture(params=["tcp", "rfc2217"])
def endpoint(request: pytest.FixtureRequest) -> TcpEndpoint:
    return TcpEndpoint(LOOPBACK) if request.param == "tcp" else TcpEndpoint(LOOPBACK, "rfc2217", Rfc2217Codec)


def test_a_served_machine_hears_none_of_them(serving, endpoint: TcpEndpoint, caplog) -> None:
    server = serving(endpoint)
    with caplog.at_level(logging.WARNING, "isel_twin"):
        for name, data in FOREIGN.items():
            with connect(endpoint.address) as browser:
                browser.sendall(data)
                assert _closed(browser), name
    with opened(endpoint) as host:
        assert ask(host, "@07") == "0"
    warnings = [record for record in caplog.records if "no host begins so" in record.getMessage()]
    assert len(warnings) == len(FOREIGN)
    assert server.twin.steps.made == 0


def test_a_real_controller_behind_a_tap_does_not_hear_it(serving) -> None:
    """The controller is a twin of its own behind a pseudo terminal."""
    terminal, endpoint = PtyEndpoint(), TcpEndpoint(LOOPBACK)
    machine = serving(terminal)
    with tapping(terminal.address, endpoint):
        with connect(endpoint.address) as browser:
            browser.sendall(POST)
            assert _closed(browser)
        with connect(endpoint.address) as host:
            host.sendall(b"@07\r")
            assert read_exactly(host, 1) == b"0"
    assert machine.twin.steps.made == 0


def test_a_host_that_begins_with_a_letter_of_theirs_is_heard_after_a_moment(serving) -> None:
    """G, and silence; the controller answers what is no command only at its end."""
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as host:
        host.sendall(b"G")
        host.settimeout(2.0 * HOLD_S)
        with pytest.raises(TimeoutError):
            host.recv(1)
        host.settimeout(REPLY_S)
        host.sendall(b"\r@07\r")
        assert read_exactly(host, 2)[-1:] == b"0"


def _closed(connection: socket.socket) -> bool:
    try:
        return read_all(connection)[:1] in (b"", b"\xff")  # Telnet greets first
    except ConnectionResetError:
        return True
