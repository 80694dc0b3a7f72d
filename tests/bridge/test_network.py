"""Raw TCP and RFC 2217: one client at a time, and nobody can harm the twin."""

from __future__ import annotations

import errno
import os
import socket

import pytest
import serial

from isel_twin.bridge.serve.outbox import OUTBOX_BYTES, Outbox
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.pty import PtyEndpoint
from isel_twin.bridge.serve.rfc2217 import SUBOPTION_BYTES, Rfc2217Codec
from isel_twin.bridge.serve.server import LINE_BYTES, PIECE_BYTES, SILENCE_BYTES, Server, _Piece
from isel_twin.bridge.serve.tcp import CodecError, RawCodec, TcpEndpoint, parse_address
from isel_twin.core.twin import Twin
from tests.bridge.conftest import REPLY_S, ask
from tests.bridge.test_pacing import MS, Clock

LOOPBACK = "127.0.0.1:0"


def connect(address: str) -> socket.socket:
    return socket.create_connection(parse_address(address), timeout=REPLY_S)


def read_all(connection: socket.socket) -> bytes:
    """Everything until the other side closes."""
    data = b""
    while piece := connection.recv(4096):
        data += piece
    return data


def read_exactly(connection: socket.socket, size: int) -> bytes:
    data = b""
    while len(data) < size:
        piece = connection.recv(size - len(data))
        assert piece, f"closed after {data!r}"
        data += piece
    return data


def test_a_session_over_tcp(serve):
    with serve("--tcp", LOOPBACK).open("tcp") as port:
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
        assert ask(port, "@0P", 19) == "0" * 19


def test_a_second_client_is_told_and_closed_and_the_first_undisturbed(serving):
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as first:
        first.sendall(b"@07\r")
        assert read_exactly(first, 1) == b"0"
        for _ in range(3):
            with connect(endpoint.address) as second:
                second.sendall(b"@0P\r")
                told = read_all(second)
            assert b"in use" in told
            assert told.count(b"\n") == 1
            assert told.endswith(b"\n")
        first.sendall(b"@0P\r")
        assert read_exactly(first, 19) == b"0" * 19


def test_a_refused_client_of_another_endpoint_too(serving):
    raw, telnet = TcpEndpoint(LOOPBACK), TcpEndpoint(LOOPBACK, "rfc2217", Rfc2217Codec)
    serving(raw, telnet)
    with connect(raw.address) as first:
        first.sendall(b"@07\r")
        assert read_exactly(first, 1) == b"0"
        with connect(telnet.address) as second:
            assert b"in use" in read_all(second)


def test_the_port_is_free_again_when_the_client_has_gone(serving):
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    for _ in range(5):
        with connect(endpoint.address) as client:
            client.sendall(b"@07\r")
            assert read_exactly(client, 1) == b"0"


def test_a_client_that_has_sent_everything_still_gets_its_replies(serving):
    """As `printf '@07\\r@0P\\r' | nc -N host port` does."""
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as client:
        client.sendall(b"@07\r@0R7\r@0P\r")
        client.shutdown(socket.SHUT_WR)
        assert read_exactly(client, 21) == b"00" + b"0" * 19


def test_a_client_that_vanishes_is_found_out_by_the_operating_system(serving):
    """The options say within a minute; that they do it is measured, see docs/reliability.md."""
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as client:
        client.sendall(b"@07\r")
        assert read_exactly(client, 1) == b"0"
        assert endpoint._client is not None
        asked = endpoint._client.connection.getsockopt
        assert asked(socket.SOL_SOCKET, socket.SO_KEEPALIVE)
        idle = socket.TCP_KEEPIDLE if hasattr(socket, "TCP_KEEPIDLE") else socket.TCP_KEEPALIVE
        after_s, every_s, times = (
            asked(socket.IPPROTO_TCP, option) for option in (idle, socket.TCP_KEEPINTVL, socket.TCP_KEEPCNT)
        )
        assert after_s + times * every_s <= 60
        if hasattr(socket, "TCP_USER_TIMEOUT"):
            assert asked(socket.IPPROTO_TCP, socket.TCP_USER_TIMEOUT) <= 60_000


def test_a_server_without_a_free_file_turns_clients_away_and_sleeps(serving, monkeypatch, caplog):
    """EMFILE: the listening socket stays ready for ever unless somebody takes what waits there."""
    endpoint = TcpEndpoint(LOOPBACK)
    accept, failed = socket.socket.accept, []

    def full(listener: socket.socket):
        """As long as the spare file is open there is none to be had."""
        if endpoint._spare.file is not None and not released:
            failed.append(1)
            raise OSError(errno.EMFILE, "Too many open files")
        return accept(listener)

    released: list[int] = []
    close = os.close

    def closing(file: int) -> None:
        if file == endpoint._spare.file:
            released.append(file)
        close(file)

    monkeypatch.setattr(socket.socket, "accept", full)
    monkeypatch.setattr(os, "close", closing)
    serving(endpoint)
    with connect(endpoint.address) as client:
        assert client.recv(1) == b""
    assert len(failed) == 1
    assert "too many open files" in caplog.text
    with connect(endpoint.address) as client:
        client.sendall(b"@07\r")
        assert read_exactly(client, 1) == b"0"


@pytest.mark.parametrize("codec", [RawCodec, Rfc2217Codec])
@pytest.mark.parametrize("speed", [0.2, 1.0])
def test_a_reply_over_the_network_comes_in_one_piece(serving, codec, speed):
    """19 bytes take 9.9 ms on the line at speed 1 and 50 ms at 0.2, and come at once when they have come."""
    endpoint = TcpEndpoint(LOOPBACK, codec=codec)
    serving(endpoint, speed=speed)
    with connect(endpoint.address) as client:
        client.sendall(b"@07\r")
        while client.recv(4096)[-1:] != b"0":  # Telnet's options come before it
            pass
        for _ in range(10):
            client.sendall(b"@0P\r")
            assert client.recv(4096) == b"0" * 19


def test_a_long_stream_of_replies_is_not_kept_back(serving):
    """What comes without a pause is handed on in pieces of at most PIECE_BYTES."""
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint, speed=20.0)
    with connect(endpoint.address) as client:
        client.sendall(b"@07\r" + b"@0P\r" * 200)
        assert read_exactly(client, 1 + 200 * 19) == b"0" * (1 + 200 * 19)


def test_a_piece_is_complete_after_silence_or_when_it_is_long():
    piece = _Piece()
    assert piece.complete_ns(10) is None
    piece.add(100, b"0")
    assert piece.complete_ns(10) == 100 + SILENCE_BYTES * 10
    piece.add(110, b"0" * 18)
    assert piece.complete_ns(10) == 110 + SILENCE_BYTES * 10
    piece.add(120, b"0" * PIECE_BYTES)
    assert piece.complete_ns(10) == 120
    assert piece.take() == b"0" * (19 + PIECE_BYTES)
    assert piece.complete_ns(10) is None


def test_many_refused_clients_that_never_leave_do_no_harm(serving):
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as first:
        first.sendall(b"@07\r")
        assert read_exactly(first, 1) == b"0"
        others = [connect(endpoint.address) for _ in range(40)]
        assert all(b"in use" in other.recv(4096) for other in others)
        for _ in range(60):  # and some that leave at once, while old ones are cut off
            connect(endpoint.address).close()
        first.sendall(b"@0P\r")
        assert read_exactly(first, 19) == b"0" * 19
        for other in others:
            other.close()


def test_a_client_that_writes_without_reading_is_served_and_forgotten(serving):
    endpoint = TcpEndpoint(LOOPBACK)
    serving(endpoint)
    with connect(endpoint.address) as flood:
        flood.sendall(b"@07\r" + b"@0P\r" * 2000)
    with connect(endpoint.address) as client:
        client.sendall(b"@0P\r")
        assert read_exactly(client, 19) == b"0" * 19


@pytest.mark.parametrize("codec", [RawCodec, Rfc2217Codec])
@pytest.mark.parametrize("sent", [b"", b"@07\r"])
def test_closing_with_a_reset_does_no_harm(serving, codec, sent):
    endpoint, other = TcpEndpoint(LOOPBACK, codec=codec), TcpEndpoint(LOOPBACK)
    serving(endpoint, other)
    for _ in range(20):
        client = connect(endpoint.address)
        client.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, b"\1\0\0\0\0\0\0\0")  # close by RST
        client.sendall(sent)
        client.close()
    with connect(other.address) as survivor:
        survivor.sendall(b"@0P\r")
        assert len(read_exactly(survivor, 19)) == 19


def test_a_reply_goes_to_the_endpoint_that_spoke_last(serving):
    pty, tcp = PtyEndpoint(), TcpEndpoint(LOOPBACK)
    serving(pty, tcp)
    with serial.Serial(pty.address, timeout=REPLY_S) as device, connect(tcp.address) as client:
        for _ in range(3):
            assert ask(device, "@07") == "0"
            client.sendall(b"@0P\r")
            assert read_exactly(client, 19) == b"0" * 19
        assert device.in_waiting == 0


class Mouth:
    """An endpoint without a host: says one thing, then keeps an eye on whether it is still listened to."""

    kind, address, gathers, busy, waiting, settings = "mouth", "", False, False, 0, {}

    def __init__(self, words: bytes, clock: Clock, looks: int = 40, look_ns: int = 50 * MS) -> None:
        self._words = words
        self._clock = clock
        self._looks = looks
        self._look_ns = look_ns
        self.heard: list[bool] = []

    def attach(self, server: Server) -> None:
        self._server = server

    def watches(self, listening: bool):
        self.heard.append(listening)
        if len(self.heard) == 1:
            self._server.receive(self, self._words)
        self._clock.now += self._look_ns
        if len(self.heard) == self._looks:
            self._server.stop()
        else:
            self._server.wake()
        return []

    def send(self, data: bytes) -> None: ...
    def give_way(self) -> None: ...
    def close(self) -> None: ...


def test_a_paced_line_is_not_filled_further_than_it_can_carry():
    """6000 bytes at 19200 baud take 3125 ms; 4096 of them (2133 ms) may wait, so no more is read for 992 ms."""
    clock = Clock()
    mouth = Mouth(b"\n" * 6000, clock)
    Server(Twin(plant="kinematic", line_speed=True), Pacer(1.0, clock=clock), [mouth]).run()
    assert mouth.heard == [True] + [False] * 19 + [True] * 20


class CountingTwin(Twin):
    """Tells what is on its line."""

    @property
    def replies_due(self) -> int:
        return self._line.replies_due


class Flood(Mouth):
    """Asks whenever it is listened to, and far more than the line can answer."""

    most = 0

    def watches(self, listening: bool):
        if listening:
            self._server.receive(self, b"@0P\r" * (LINE_BYTES // 4))
        self.most = max(self.most, self._server.twin.replies_due)
        return super().watches(listening)


def test_a_host_that_asks_faster_than_the_line_can_answer_is_made_to_wait():
    """`@0P` is answered with 19 bytes for 4: in 20 s the replies to what the line carries would be 140 KB in arrears.

    At most the answers to a full line of questions come on top of what is there when no more is taken.
    """
    clock = Clock()
    flood = Flood(b"\n", clock, looks=400)
    twin = CountingTwin(plant="kinematic", line_speed=True)
    Server(twin, Pacer(1.0, clock=clock), [flood]).run()
    assert flood.most <= LINE_BYTES + 2 * LINE_BYTES // 4 * 19
    assert flood.heard.count(True) > 2, "it is listened to again"


def test_an_unpaced_line_takes_everything():
    clock = Clock()
    mouth = Mouth(b"\n" * 100_000, clock)
    Server(Twin(plant="kinematic"), Pacer(None, clock=clock), [mouth]).run()
    assert mouth.heard == [True] * 40


def test_rfc2217_negotiates_with_pyserial(serve):
    served = serve("--rfc2217", LOOPBACK)
    with served.open("rfc2217") as port:
        assert port.baudrate == 19_200
        port.baudrate = 9600
        port.rts = False
        assert port.cts
        assert ask(port, "@07") == "0"
        assert ask(port, "@0R7") == "0"
        port.write(b"\xff@0P\r")  # byte 255 is Telnet's escape character and must pass
        assert port.read(19) == b"0" * 19
    with served.open("rfc2217") as port:
        assert ask(port, "@0P", 19) == "0" * 19


def test_telnet_bytes_pass_both_ways():
    sent: list[bytes] = []
    codec = Rfc2217Codec(sent.append)
    assert sent  # the server offers its options at once
    assert codec.decode(b"a\xff\xffb") == b"a\xffb"
    assert codec.encode(b"a\xffb") == b"a\xff\xffb"


@pytest.mark.parametrize(
    "data",
    [
        b"\xff\xf0",  # end of an option that was not begun
        b"\xff\xfa\x2c\x01\xff\xf0",  # baud rate without a rate
        b"\xff\xfa\x2c\x03\xee\xff\xf0",  # parity 238
        b"\xff\xfa" + b"x" * (SUBOPTION_BYTES + 1),  # an option without end
    ],
    ids=["no begin", "no rate", "parity 238", "no end"],
)
def test_malformed_options_are_an_error_of_the_client(data):
    codec = Rfc2217Codec(lambda _: None)
    with pytest.raises(CodecError):
        codec.decode(data)


def test_a_client_with_malformed_options_is_disconnected(serving):
    endpoint = TcpEndpoint(LOOPBACK, "rfc2217", Rfc2217Codec)
    serving(endpoint)
    with connect(endpoint.address) as client:
        client.sendall(b"\xff\xf0")
        read_all(client)
    url = f"rfc2217://{endpoint.address}"
    with serial.serial_for_url(url, timeout=REPLY_S) as port:
        assert ask(port, "@07") == "0"


def test_an_outbox_is_bounded_and_loses_whole_replies():
    taken = bytearray()
    reading = False

    def write(data: bytes) -> int:
        if not reading:
            raise BlockingIOError
        taken.extend(data[:1000])
        return len(data[:1000])

    outbox = Outbox(write)
    reply = bytes(range(250)) * 4
    for _ in range(100):
        outbox.put(reply)
    assert len(outbox) == OUTBOX_BYTES // 1000 * 1000
    reading = True
    outbox.flush()
    assert taken == reply * (OUTBOX_BYTES // 1000)
    assert len(outbox) == 0


@pytest.mark.parametrize(
    ("text", "address"),
    [
        ("127.0.0.1:4000", ("127.0.0.1", 4000)),
        ("4000", ("127.0.0.1", 4000)),
        (":0", ("127.0.0.1", 0)),
        ("0.0.0.0:1", ("0.0.0.0", 1)),
        ("[::1]:65535", ("::1", 65535)),
    ],
)
def test_addresses(text, address):
    assert parse_address(text) == address


@pytest.mark.parametrize("text", ["", "host", "host:", "host:http", "host:65536", "host:-1", "host:1.0", "host:²"])
def test_bad_addresses_are_named(text):
    with pytest.raises(ValueError, match="is not HOST:PORT"):
        parse_address(text)
