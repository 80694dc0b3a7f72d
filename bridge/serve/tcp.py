"""A raw TCP port: every byte of the connection is a byte of the serial line.

Addresses: HOST:PORT, [IPV6]:PORT, :PORT or PORT; without a host the loopback interface, and port 0 for a free one.

The controller has one line, so one client is served at a time. A second one gets a line of text and is closed. A client
that closes its sending side (`printf '@07\\r' | nc -N host port`) still gets its replies, unless another one connects.
Who does not begin as a host does is turned away (gate.py). A client that has vanished (a pulled cable) loses the line
within a minute:

    last sign of life --- PROBE_AFTER_S ---> probe --- PROBE_EVERY_S ---> probe ... PROBES in vain: gone, 50 s in all
"""

from __future__ import annotations

import errno
import logging
import os
import select
import selectors
import socket
from collections import deque
from collections.abc import Callable, Iterable, Mapping
from contextlib import suppress
from functools import partial
from typing import Any, Protocol

from isel_twin.bridge.serve.borders import SerialLine
from isel_twin.bridge.serve.gate import Alarm, Gate, GreetingError
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.outbox import Outbox
from isel_twin.controller import SerialFormat

log = logging.getLogger("isel_twin")

REFUSALS = 16  # refused clients whose message is still being sent; more are cut off
PROBE_AFTER_S, PROBE_EVERY_S, PROBES = 20, 10, 3  # keep-alive probes of the operating system
VANISHED_S = PROBE_AFTER_S + PROBE_EVERY_S * PROBES  # also while data are being sent to the client


class CodecError(Exception):
    """A client does not speak the protocol of this endpoint."""


class Codec(Protocol):
    """Converts between the bytes of one connection and those of the serial line."""

    def decode(self, data: bytes) -> bytes:
        """Bytes for the line out of bytes of the connection. Raises CodecError."""

    def encode(self, data: bytes) -> bytes:
        """Bytes for the connection out of bytes of the line."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """The client's port settings; empty if it has none."""


class RawCodec:
    """No conversion. send: to the client directly; form: of the controller's line."""

    settings: Mapping[str, Any] = {}

    def __init__(self, send: Callable[[bytes], None], form: SerialFormat) -> None:
        pass

    def decode(self, data: bytes) -> bytes:
        return data

    def encode(self, data: bytes) -> bytes:
        return data


def parse_address(text: str) -> tuple[str, int]:
    """(host, port) out of HOST:PORT, [IPV6]:PORT, :PORT or PORT. Raises ValueError."""
    host, _, port = text.rpartition(":")
    if not (port.isascii() and port.isdigit() and len(port) <= 5 and int(port) < 65_536):
        raise ValueError(f"address {text!r} is not HOST:PORT with a port from 0 to 65535")
    return host.removeprefix("[").removesuffix("]") or "127.0.0.1", int(port)


def listen(address: str) -> tuple[socket.socket, str]:
    """A listening socket that never blocks, and its address. Raises ValueError for a bad one, OSError if taken."""
    host, port = parse_address(address)
    try:
        family, *_, where = socket.getaddrinfo(host, port, type=socket.SOCK_STREAM)[0]
        listener = socket.create_server(where[:2], family=family)
    except OSError as error:
        reason = (error.strerror or str(error)).split(" (")[0]
        raise OSError(error.errno, f"{reason}; choose another address, or port 0 for a free one", address) from None
    listener.setblocking(False)
    host, port = listener.getsockname()[:2]
    return listener, f"[{host}]:{port}" if ":" in host else f"{host}:{port}"


class Spare:
    """A reserve file descriptor: without a free one the listening socket would stay ready and keep the server busy."""

    def __init__(self) -> None:
        self.file: int | None = None
        self._open()

    def _open(self) -> None:
        with suppress(OSError):
            self.file = os.open(os.devnull, os.O_RDONLY)

    def turn_away(self, listener: socket.socket, kind: str) -> None:
        """Accept and close a waiting client."""
        log.warning("%s: too many open files; a client was turned away", kind)
        self.close()
        with suppress(OSError):
            listener.accept()[0].close()
        self._open()

    def close(self) -> None:
        if self.file is not None:
            os.close(self.file)
            self.file = None


def lacks_files(error: OSError) -> bool:
    return error.errno in (errno.EMFILE, errno.ENFILE)


def _hung_up(connection: socket.socket) -> bool:
    """True if the other side has closed or will send no more; bytes of it may still be unread."""
    if hasattr(select, "POLLRDHUP"):
        poll = select.poll()
        poll.register(connection, select.POLLRDHUP)
        return bool(poll.poll(0))
    try:
        return connection.recv(1, socket.MSG_PEEK) == b""
    except BlockingIOError:
        return False
    except OSError:
        return True


def keep_alive(connection: socket.socket) -> None:
    """Let the operating system detect a vanished client."""
    connection.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for names, value in (
        (("TCP_KEEPIDLE", "TCP_KEEPALIVE"), PROBE_AFTER_S),  # the second is what macOS calls it
        (("TCP_KEEPINTVL",), PROBE_EVERY_S),
        (("TCP_KEEPCNT",), PROBES),
        (("TCP_USER_TIMEOUT",), VANISHED_S * 1000),
    ):
        option = next((getattr(socket, name) for name in names if hasattr(socket, name)), None)
        if option is not None:
            connection.setsockopt(socket.IPPROTO_TCP, option, value)


CodecMaker = Callable[[Callable[[bytes], None], SerialFormat], Codec]


class _Client:
    """The client that holds the line."""

    def __init__(self, connection: socket.socket, codec: CodecMaker, line: SerialLine) -> None:
        self.connection = connection
        self.outbox = Outbox(connection.send)
        self.departing = False  # has closed its sending side
        self.codec = codec(self.outbox.put, line.serial_format)
        self.gate = Gate(line.language)
        self.alarm: Alarm | None = None  # while the gate holds bytes


class TcpEndpoint:
    """A listening TCP socket. Raises ValueError for a bad address and OSError if it cannot listen there."""

    def __init__(self, address: str, kind: str = "tcp", codec: CodecMaker = RawCodec) -> None:
        self.kind = kind
        self.gathers = True
        self._codec = codec
        self._client: _Client | None = None
        self._listening = True
        self._refused: deque[socket.socket] = deque()
        self._listener, self.address = listen(address)
        self._spare = Spare()

    @property
    def busy(self) -> bool:
        return self._client is not None and not self._client.departing and not _hung_up(self._client.connection)

    @property
    def waiting(self) -> int:
        return len(self._client.outbox) if self._client is not None else 0

    @property
    def settings(self) -> Mapping[str, Any]:
        return self._client.codec.settings if self._client is not None else {}

    def attach(self, line: SerialLine) -> None:
        self._line = line

    def watches(self, listening: bool) -> Iterable[FileWatch]:
        yield FileWatch(self._listener, selectors.EVENT_READ, self._accept)
        for connection in self._refused:
            yield FileWatch(connection, selectors.EVENT_READ, partial(self._drain, connection))
        self._listening = listening
        if (client := self._client) is not None:
            reading = listening and not client.departing
            events = (selectors.EVENT_READ if reading else 0) | (selectors.EVENT_WRITE if client.outbox else 0)
            if events:
                yield FileWatch(client.connection, events, self._ready)
            if client.alarm is not None and listening:
                yield FileWatch(client.alarm.file, selectors.EVENT_READ, self._lapse)

    def _accept(self) -> None:
        try:
            connection, peer = self._listener.accept()
        except OSError as error:
            if lacks_files(error):
                self._spare.turn_away(self._listener, self.kind)
            return  # the client has gone
        connection.setblocking(False)
        if not self._line.claim(self):
            self._refuse(connection)
            return
        try:
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            keep_alive(connection)
            self._client = _Client(connection, self._codec, self._line)
        except OSError:
            connection.close()  # the client has gone
        else:
            log.info("%s: client %s:%s connected", self.kind, *peer[:2])

    def _refuse(self, connection: socket.socket) -> None:
        """Send the reason, and close after the client has: closing at once could make its kernel discard the
        message."""
        with suppress(OSError):  # the client has gone
            connection.send(f"isel-twin: port {self.address} is in use by another client\r\n".encode())
            connection.shutdown(socket.SHUT_WR)
        self._refused.append(connection)
        if len(self._refused) > REFUSALS:
            self._refused.popleft().close()

    def _drain(self, connection: socket.socket) -> None:
        if connection not in self._refused:
            return
        try:
            if connection.recv(4096):
                return
        except BlockingIOError:
            return
        except OSError:
            pass
        self._refused.remove(connection)
        connection.close()

    def _ready(self) -> None:
        client = self._client
        if client is None:
            return
        try:
            client.outbox.flush()
            if client.departing or not self._listening:
                return
            data = client.connection.recv(4096)
            line = client.gate.take(client.codec.decode(data)) if data else client.gate.lapse()
        except BlockingIOError:
            return
        except OSError as error:
            self._disconnect(str(error))
            return
        except (GreetingError, CodecError) as error:
            self._turn_away(client, error)
            return
        self._watch_gate(client)
        if not data:
            client.departing = True
        if line:
            self._line.receive(self, line)

    def _watch_gate(self, client: _Client) -> None:
        """Do not wait for the rest of a first line for ever."""
        if client.gate.held:
            client.alarm = client.alarm or Alarm(client.gate.patience_s)
        elif client.alarm is not None:
            client.alarm.close()
            client.alarm = None

    def _turn_away(self, client: _Client, error: Exception) -> None:
        if not client.gate.open:
            log.warning("%s: %s: no host begins so, and not a byte of it reaches the line", self.kind, error)
        self._disconnect("turned away" if not client.gate.open else str(error))

    def _lapse(self) -> None:
        """The first line has not become whole in time."""
        if (client := self._client) is None or client.alarm is None:
            return
        try:
            line = client.gate.lapse()
        except GreetingError as error:
            self._turn_away(client, error)
            return
        self._watch_gate(client)
        if line:
            self._line.receive(self, line)

    def send(self, data: bytes) -> None:
        if self._client is not None:
            try:
                self._client.outbox.put(self._client.codec.encode(data))
            except OSError as error:
                self._disconnect(str(error))

    def give_way(self) -> None:
        client = self._client
        self._listening = True
        while client is not None and self._client is client and not client.departing:
            self._ready()  # bytes sent before it left must not be lost
        self._disconnect("closed by the client")

    def _disconnect(self, reason: str) -> None:
        if self._client is not None:
            log.info("%s: client disconnected: %s", self.kind, reason)
            if self._client.alarm is not None:
                self._client.alarm.close()
            self._client.connection.close()
            self._client = None

    def close(self) -> None:
        self._disconnect("the server stops")
        for connection in (self._listener, *self._refused):
            connection.close()
        self._spare.close()
