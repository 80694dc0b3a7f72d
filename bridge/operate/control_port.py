"""The control port: JSON lines over TCP, one request a line, one answer a line, in the order of the requests.

    {"set": {"estop": "pressed"}}      --->
                                       <---      {"ok": {"time_s": 12.5, "time_ns": 12500000000, "inputs": {...}}}
    {"set": {"estop": "half"}}         --->
                                       <---      {"error": "request: set: input 'estop' cannot be 'half'; ..."}

Requests: control.py. Up to CLIENTS clients; each has one request at a time in progress, and at most LINE_BYTES waiting.
A client that does not read its answers is not read either. No client can block the server: reading, writing and the
requests in one round of its loop are bounded.

Beyond the loopback interface a token is needed, as the first request: {"token": "..."}, within TOKEN_S. A client that
has vanished makes room within a minute. A connection that begins with anything but a JSON object, such as a browser's,
is closed (bridge/8).
"""

from __future__ import annotations

import json
import logging
import selectors
import socket
import time
from collections.abc import Iterable, Iterator
from contextlib import suppress
from functools import partial
from typing import Any, NoReturn

from isel_twin.base.parameters import parse_json
from isel_twin.bridge.operate.control import ControlError, Operator, Pending
from isel_twin.bridge.operate.token import is_token, token_for
from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.outbox import Outbox
from isel_twin.bridge.serve.server import Guest, Server
from isel_twin.bridge.serve.tcp import Spare, keep_alive, lacks_files, listen
from isel_twin.core.twin import Twin

log = logging.getLogger("isel_twin")

LINE_BYTES = 65_536  # longest request, and most bytes waiting
CLIENTS = 16  # connections at once
TOKEN_S = 10.0  # wall time in which a client has to send the token; who does not makes room for others
UNREAD_BYTES = 16_384  # unread answers beyond which a client is not read
ROUND = 8  # most requests of a client in one round of the server's loop
ERROR_CHARACTERS = 600  # longest error message
NO_OBJECT = 'request: no object; allowed: one object a line, {"state": true}'


def parse_request(line: bytes) -> dict[str, Any]:
    """The object in a line. Raises ControlError for anything else; nothing in it is ever evaluated."""
    try:
        content = parse_json(line.decode("utf-8"), parse_constant=_refuse, object_pairs_hook=_table)
    except ValueError as error:
        raise ControlError(f'request: no JSON: {error}; allowed: one object a line, {{"state": true}}') from None
    if not isinstance(content, dict):
        raise ControlError(NO_OBJECT)
    return content


def _refuse(constant: str) -> NoReturn:
    raise ValueError(f"{constant} is no number")


def _table(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    content = dict(pairs)
    if len(content) < len(pairs):
        raise ValueError("a key stands twice in an object")
    return content


class _Client:
    """One connection."""

    def __init__(self, connection: socket.socket, trusted: bool, until_s: float) -> None:
        self.connection = connection
        self.outbox = Outbox(connection.send)
        self.buffer = bytearray()
        self.trusted = trusted
        self.until_s = until_s  # of time.monotonic: for the token
        self.begun = False  # it has sent an object
        self.skipping = False  # within a line that is too long
        self.leaving = False  # it sends no more, or is to be closed after its answers
        self.pending: Pending | None = None

    @property
    def has_line(self) -> bool:
        return b"\n" in self.buffer

    @property
    def ready(self) -> bool:
        """True if its next request can be handled."""
        return self.pending is None and self.has_line and len(self.outbox) <= UNREAD_BYTES

    @property
    def overlong(self) -> bool:
        """True if its next request is longer than LINE_BYTES."""
        return self.pending is None and len(self.buffer) > LINE_BYTES and not self.has_line

    @property
    def strange(self) -> bool:
        """True if it begins with no object; what a browser sends may have no end of line."""
        return not (self.begun or self.skipping) and self.buffer.lstrip()[:1] not in (b"", b"{")

    def lines(self) -> Iterator[bytes]:
        """Requests to handle in this round."""
        for _ in range(ROUND):
            if not self.ready:
                return
            line, _, self.buffer = self.buffer.partition(b"\n")
            if self.skipping:
                self.skipping = False
            elif line.strip():
                yield bytes(line)


class ControlPort(Guest):
    """Lets clients operate a server's twin. Raises ValueError, OSError as `TcpEndpoint`."""

    kind = "control"

    def __init__(self, address: str, token: str | None = None, token_s: float = TOKEN_S) -> None:
        """token: needed by clients, within token_s; None: none on the loopback interface, elsewhere a random one."""
        self._token_s = token_s
        self._listener, self.address = listen(address)
        self.token = token_for(self.address, token)
        self._spare = Spare()
        self._clients: list[_Client] = []
        self._operator: Operator | None = None

    def attach(self, server: Server) -> None:
        """Take the server whose twin is operated. Raises TypeError if it serves something else."""
        if not isinstance(server.twin, Twin):
            raise TypeError("a control port operates a Twin")
        self._operator = Operator(server, server.twin)

    @property
    def operator(self) -> Operator:
        """Raises RuntimeError before there is a server."""
        if self._operator is None:
            raise RuntimeError("the control port has no server yet")
        return self._operator

    def watches(self) -> Iterable[FileWatch]:
        yield FileWatch(self._listener, selectors.EVENT_READ, self._accept)
        for client in self._clients:
            room = not client.leaving and len(client.buffer) <= LINE_BYTES and len(client.outbox) <= UNREAD_BYTES
            events = (selectors.EVENT_READ if room else 0) | (selectors.EVENT_WRITE if client.outbox else 0)
            if events:
                yield FileWatch(client.connection, events, partial(self._ready, client))

    def wait_s(self) -> float | None:
        if any(client.ready or client.overlong for client in self._clients):
            return 0.0
        now_s = time.monotonic()
        waits = [max(0.0, client.until_s - now_s) for client in self._clients if not client.trusted]
        return min((wait for wait in (*waits, self.operator.wait_s) if wait is not None), default=None)

    def look(self) -> None:
        self.operator.look()
        now_s = time.monotonic()
        for client in list(self._clients):
            self._serve(client)
            if not client.trusted and now_s > client.until_s:
                self._drop(client)
        if self.operator.look():  # the last request may have met the condition of a wait
            for client in list(self._clients):
                self._answer_pending(client)

    def close(self) -> None:
        """End all waits with an error and close all connections. May be called again, and before there is a server."""
        if self._operator is not None:
            self._operator.end()
        for client in list(self._clients):
            self._answer_pending(client)
            self._drop(client)
        self._listener.close()
        self._spare.close()

    def _accept(self) -> None:
        try:
            connection, _ = self._listener.accept()
        except OSError as error:
            if lacks_files(error):
                self._spare.turn_away(self._listener, self.kind)
            return  # the client has gone
        connection.setblocking(False)
        with suppress(OSError):
            connection.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            keep_alive(connection)
        client = _Client(connection, self.token is None, time.monotonic() + self._token_s)
        self._clients.append(client)
        if len(self._clients) > CLIENTS:
            self._put(client, {"error": f"the control port has {CLIENTS} clients already; let one of them go"})
            self._drop(client)

    def _ready(self, client: _Client) -> None:
        if client not in self._clients:
            return
        try:
            client.outbox.flush()
            if client.leaving or len(client.buffer) > LINE_BYTES:
                return
            data = client.connection.recv(LINE_BYTES)
        except BlockingIOError:
            return
        except OSError:
            self._drop(client)
            return
        if not data:
            client.leaving = True
            if client.pending is not None:  # the client has gone
                self._drop(client)
                return
        client.buffer += data

    def _serve(self, client: _Client) -> None:
        self._answer_pending(client)
        for line in client.lines():
            self._put(client, self._ask(client, line))
            if client not in self._clients:
                return
        if client.overlong:
            client.buffer.clear()
            if not client.skipping:
                self._put(client, {"error": f"request: longer than {LINE_BYTES} bytes; allowed: one object a line"})
            client.skipping = True
        if client.strange:
            client.buffer.clear()
            self._put(client, _error(NO_OBJECT))
            client.leaving = True
        if client.leaving and not client.outbox and not client.ready and client.pending is None:
            self._drop(client)

    def _answer_pending(self, client: _Client) -> None:
        pending = client.pending
        if pending is not None and pending.over:
            client.pending = None
            self._put(client, _error(pending.error, timeout=True) if pending.error else {"ok": pending.answer})

    def _ask(self, client: _Client, line: bytes) -> dict[str, Any] | None:
        """The answer to a request; None if it is still to come."""
        try:
            if len(line) > LINE_BYTES:
                raise ControlError(f"request: longer than {LINE_BYTES} bytes; allowed: one object a line")
            request = parse_request(line)
            client.begun = True
            if "token" in request:
                client.trusted = is_token(request["token"], self.token) and len(request) == 1
                if client.trusted:
                    return {"ok": {}}
                raise ControlError(
                    "request: token: not the one of this server; allowed: the one it was started with, alone"
                )
            if not client.trusted:
                raise ControlError('request: token: missing; allowed: {"token": "..."} before anything else')
            result = self.operator.ask(request)
        except ControlError as error:
            if not (client.begun and client.trusted):
                client.leaving = True
                client.buffer.clear()
            return _error(str(error))
        if not isinstance(result, Pending):
            return {"ok": result}
        client.pending = result
        self._answer_pending(client)
        return None

    def _put(self, client: _Client, answer: dict[str, Any] | None) -> None:
        if answer is None:
            return
        try:
            client.outbox.put(json.dumps(answer, allow_nan=False).encode() + b"\n")
        except OSError:
            self._drop(client)

    def _drop(self, client: _Client) -> None:
        if client in self._clients:
            self._clients.remove(client)
            if client.pending is not None:
                self.operator.forget(client.pending)
            client.connection.close()


def _error(text: str, timeout: bool = False) -> dict[str, Any]:
    line = " ".join(text.split())
    short = line if len(line) <= ERROR_CHARACTERS else f"{line[:ERROR_CHARACTERS]} ..."
    return {"error": short, "timeout": True} if timeout else {"error": short}
