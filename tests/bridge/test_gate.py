"""No web page moves a machine: who is no host is turned away before a byte reaches the line, and hosts get through.

Expected: the first line of HTTP from RFC 9112, 3 (a token, a blank, a target), STUN from RFC 8489, 5 and its frame on
TCP from RFC 4571, 2 (two bytes of length); first lines of hosts from the manuals of the controllers and docs/hosts.md.
"""

from __future__ import annotations

import logging
import socket

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.bridge.serve import gate as gates
from isel_twin.bridge.serve.gate import LONGEST, Gate, GreetingError
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import Rfc2217Codec
from isel_twin.bridge.serve.tcp import TcpEndpoint
from isel_twin.language import create_language
from tests.bridge.conftest import REPLY_S, ask
from tests.bridge.test_network import LOOPBACK, connect, read_all, read_exactly
from tests.bridge.test_tap import opened, tapping

CONTROLLERS = ("imc-s8", "ismif", "gmi99", "bwo900", "external")
BODY = b"@07\r@0A1600,800,0,30,0,30,0,30\r"
POST = b"POST / HTTP/1.1\r\nHost: 127.0.0.1:5000\r\nContent-Type: text/plain\r\nContent-Length: 32\r\n\r\n" + BODY
STUN = bytes.fromhex("000100002112a442") + bytes(12)
LONG = bytes.fromhex("68 05 05 68 e0 81 ee 00 00 4f 16")
METHODS = ("POST", "patch", "PROPFIND", "x", "P1", "D", "state", "row", "$HZXY", "L1", "W", "*")


def _framed_request() -> bytes:
    """The method is the head of a long record, a header has its checksum and its end: a page may send such a request to
    the origin from which it was loaded (Fetch, 2.2.2: a value may have any bytes but 00h, CR and LF)."""
    request = b"h~~h / HTTP/1.1\r\nHost: 127.0.0.1:5000\r\nConnection: keep-alive\r\nX: ".ljust(4 + ord("~"), b"x")
    return request + bytes([sum(request[4:]) % 256, 0x16]) + b"\r\n\r\n" + LONG


FOREIGN = {
    **{f"the method {method}": f"{method} / HTTP/1.1\r\nHost: x\r\n\r\n".encode() + BODY for method in METHODS},
    "a method and a header that are a frame of DIN 19244": _framed_request(),
    "an image": b"GET /@07 HTTP/1.1\r\nHost: x\r\n\r\n",
    "a socket": b"GET /chat HTTP/1.1\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\r\n",
    "HTTP/2": b"PRI * HTTP/2.0\r\n\r\nSM\r\n\r\n",
    "https": bytes.fromhex("1603010200010001fc0303") + BODY,
    "a greeting like TLS, by WebRTC": bytes.fromhex(
        "80460103010 02d000000100100800300800700c0060040020080".replace(" ", "")
    ),
    "STUN": STUN,
    "framed STUN": b"\x00\x14" + STUN,
    "a longer frame": b"\x01\x14" + STUN + BODY,
    "ssh": b"SSH-2.0-OpenSSH_9.6\r\n",
    "smb": bytes.fromhex("00000054ff534d42") + bytes(20),
    "smb2": bytes.fromhex("00000054fe534d42") + bytes(20),
    "nothing but a word": b"x" * (LONGEST + 1),
}
HOSTS = {
    ("imc-s8", "a line"): b"@07\r",
    ("imc-s8", "several lines"): b"@07\r@0R7\r@0P\r",
    ("imc-s8", "another device"): b"@1V\r",
    ("imc-s8", "a stop"): b"\xfd",
    ("imc-s8", "a reset"): b"\xfe@07\r",
    ("imc-s8", "a break-off"): b"\xff",
    ("imc-s8", "ends of lines"): b"\r\n\r@07\r\n",
    ("imc-s8", "an end of a line alone"): b"\r",
    ("imc-s8", "a stop in a line"): b"@0A\xfd",
    ("imc-s8", "a line of a program"): b"0 800,900,-0.5,21,0,21,0,30\r\n9\r\n",
    ("imc-s8", "a line of a program, LF first"): b"m1000,500\n\r",
    ("imc-s8", "the end of a program"): b"9\r",
    ("ismif", "a vector"): b"L1,X4000,Y4000\x01",
    ("ismif", "a wrong number"): b"#E1,1\r",
    ("ismif", "a status"): b"\r@X\r",
    ("ismif", "blanks"): b"$H ZXY\r",
    ("gmi99", "a short record"): bytes.fromhex("10e001e116"),
    ("gmi99", "of the other variant"): bytes.fromhex("1001e0e116"),
    ("gmi99", "a long record"): LONG,
    ("bwo900", "a program"): b"\r\nP1\r\nN10 G1 X10\r\n#\r\n\x04\r\n",
    ("bwo900", "parameters"): b"D\rK1:P8683: 1\r#\r",
    ("bwo900", "an end, XON, a table"): b"\x04\x11W\nK1:P 21000: 1\n",
    ("bwo900", "an end alone"): b"\x04",
    ("external", "a row"): b"row 1000000 7 0 0\n",
    ("external", "outputs"): b"out power_request=1 stages=1\r\n",
    ("external", "a question"): b"names\n",
    ("", "bytes of a controller without a language"): b"\x02\x00\x16\x01\x00\x00\x00\x00\x00\x00",
    ("", "the same, few"): b"\x00",
    ("", "a line without a blank"): b"MOVE,10,20\r",
}


def gate_of(controller: str) -> Gate:
    return Gate(create_language(controller) if controller else None)


def taken(gate: Gate, pieces: list[bytes]) -> tuple[bytes, bool]:
    """What goes on of a connection with these pieces, and is it turned away?"""
    passed = b""
    try:
        for piece in pieces:
            passed += gate.take(piece)
        return passed + gate.lapse(), False
    except GreetingError:
        return passed, True


@pytest.mark.parametrize(
    "data",
    [b"\x11@07\r", b"\x13@07\r", b"!\r", b"9 HTTP/1.1\r", b"m 10.0.0.1:80 HTTP/1.1\r\n", b"91\x01\r", b"9" * 1025],
)
@pytest.mark.parametrize("piece", [1, 4096])
def test_no_host_of_an_imc_begins_so(data: bytes, piece: int) -> None:
    """It has no XON and XOFF (its handshake is the reply), and a byte for a program that waits for one can be any."""
    assert taken(gate_of("imc-s8"), cut(data, piece)) == (b"", True)


def cut(data: bytes, size: int) -> list[bytes]:
    return [data[at : at + size] for at in range(0, len(data), size)]


@pytest.mark.parametrize("controller", [*CONTROLLERS, ""])
@pytest.mark.parametrize("piece", [1, 3, 4096])
@pytest.mark.parametrize("data", FOREIGN.values(), ids=FOREIGN)
def test_nothing_of_a_foreign_greeting_goes_on(controller: str, data: bytes, piece: int) -> None:
    assert taken(gate_of(controller), cut(data, piece)) == (b"", True)


@pytest.mark.parametrize("piece", [1, 4096])
@pytest.mark.parametrize(("host", "data"), HOSTS.items(), ids=[" ".join(key) for key in HOSTS])
def test_all_of_a_host_goes_on(host: tuple[str, str], data: bytes, piece: int) -> None:
    assert taken(gate_of(host[0]), cut(data, piece)) == (data, False)


@pytest.mark.parametrize("controller", CONTROLLERS)
def test_what_the_product_itself_sends_first_is_of_a_host(controller: str) -> None:
    language = create_language(controller)
    for first in (language.reference()[0], language.break_off()):
        assert taken(gate_of(controller), [first]) == (first, False)


@pytest.mark.parametrize("controller", CONTROLLERS)
@given(
    method=st.from_regex(r"[!#$%&'*+.^_`|~0-9A-Za-z-]{1,20}", fullmatch=True),
    target=st.from_regex(r"/[!-~]{0,40}", fullmatch=True),
    body=st.binary(max_size=20),
)
def test_no_method_whatever_it_is_called_opens(controller: str, method: str, target: str, body: bytes) -> None:
    request = f"{method} {target} HTTP/1.1\r\nHost: x\r\n\r\n".encode() + body
    assert taken(gate_of(controller), [request]) == (b"", True)


@pytest.mark.parametrize("controller", CONTROLLERS)
@given(attributes=st.binary(max_size=600), of=st.binary(min_size=12, max_size=12), framed=st.booleans())
def test_no_stun_message_opens_whatever_is_in_it(controller: str, attributes: bytes, of: bytes, framed: bool) -> None:
    message = b"\x00\x01" + len(attributes).to_bytes(2, "big") + bytes.fromhex("2112a442") + of + attributes
    frame = len(message).to_bytes(2, "big") if framed else b""
    assert taken(gate_of(controller), [frame + message]) == (b"", True)


@pytest.mark.parametrize("controller", [*CONTROLLERS, ""])
@given(pieces=st.lists(st.binary(max_size=12), max_size=6))
def test_nothing_is_lost_or_out_of_order(controller: str, pieces: list[bytes]) -> None:
    passed, turned_away = taken(gate_of(controller), pieces)
    data = b"".join(pieces)
    assert data.startswith(passed) if turned_away else passed == data


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
    with tapping(terminal.address, endpoint, language=create_language("imc-s8")):
        for data in (POST, b"\x00\x14" + STUN + BODY, b"patch / HTTP/1.1\r\n\r\n" + BODY):
            with connect(endpoint.address) as browser:
                browser.sendall(data)
                assert _closed(browser)
        with connect(endpoint.address) as host:
            host.sendall(b"@07\r")
            assert read_exactly(host, 1) == b"0"
    assert machine.twin.steps.made == 0


def test_a_first_line_that_does_not_end_is_turned_away_in_time(serving, monkeypatch, caplog) -> None:
    """The next host gets the line, and the log names what has come."""
    monkeypatch.setattr(gates, "PATIENCE_S", 0.2)
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with caplog.at_level(logging.WARNING, "isel_twin"), connect(endpoint.address) as slow:
        slow.sendall(b"@0")
        assert _closed(slow)
    with opened(endpoint) as host:
        assert ask(host, "@07") == "0"
    assert [record.getMessage().split(": ")[:2] for record in caplog.records] == [["tcp", "@0 and no more"]]


def test_a_host_that_types_is_heard_at_the_end_of_its_line(serving) -> None:
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as host:
        for byte in b"\r\n@07\r":
            host.sendall(bytes([byte]))
        host.settimeout(REPLY_S)
        assert read_exactly(host, 1) == b"0"


def _closed(connection: socket.socket) -> bool:
    try:
        return read_all(connection)[:1] in (b"", b"\xff")  # Telnet greets first
    except ConnectionResetError:
        return True
