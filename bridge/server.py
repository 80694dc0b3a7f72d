"""One twin behind any number of endpoints: the loop of `isel-twin serve`.

The goal of this code is a serial port that behaves like the controller's own, whatever it is reached by. The controller
has one line; so a reply goes to the endpoint that spoke last, and one network client at a time holds the line. A host
that goes away never stops the machine.

    while not stopped:
        let virtual time catch up            (pacing.py)
        hand replies to the host
        sleep until the next event or until somebody speaks
"""

from __future__ import annotations

import logging
import selectors
import signal
import socket
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple, Protocol

from isel_twin.bridge.pacing import Clocked, Pacer
from isel_twin.controller import SerialFormat

__all__ = ["Endpoint", "Outbox", "SerialTwin", "Server", "Watch", "on_signals"]

log = logging.getLogger("isel_twin")

OUTBOX_BYTES = 65_536
"""Replies kept for a host that does not read. What is beyond is lost, as on a serial line without flow control."""

LINE_BYTES = 4096
"""Bytes taken from a host ahead of what a paced line can have carried; as much as an operating system buffers."""


class SerialTwin(Clocked, Protocol):
    """What the server needs of a twin."""

    @property
    def serial_format(self) -> SerialFormat: ...
    def write(self, data: bytes) -> None: ...
    def read(self) -> bytes: ...


class Watch(NamedTuple):
    """A file to wait for: its `handler` is called when it is ready for `events` (of `selectors`).

    Another handler may have been called in between, so it must bear with a file that is gone or not ready any more.
    """

    file: Any
    events: int
    handler: Callable[[], None]


class Endpoint(Protocol):
    """A place where hosts connect. It is given its `Server` by `attach`, and from then on watched."""

    kind: str
    """`pty`, `tcp`, `rfc2217`: the key of its address in the line that `serve` prints."""
    address: str
    """What a host connects to."""

    @property
    def busy(self) -> bool:
        """True while a network client holds the line here."""

    def attach(self, server: Server) -> None:
        """The server that will watch this endpoint, to be told what hosts send."""

    def watches(self, listening: bool) -> Iterable[Watch]:
        """Files to wait for now; no host is to be read while not `listening`: the line is full."""

    def send(self, data: bytes) -> None:
        """Bytes for the host. Never blocks; without a host they are lost."""

    def give_way(self) -> None:
        """A new network client takes the line: let go of one that only waits for its last replies."""

    def close(self) -> None:
        """Stop listening, let go of everything."""


class Outbox:
    """Bytes on their way to a host that may be slow: bounded, never blocking."""

    def __init__(self, write: Callable[[bytes], int]) -> None:
        self._write = write
        self._waiting = bytearray()

    def __len__(self) -> int:
        return len(self._waiting)

    def put(self, data: bytes) -> None:
        """Take all of `data` or, when the host has not read for too long, nothing. Raises OSError as `write` does."""
        if len(self._waiting) + len(data) > OUTBOX_BYTES:
            log.warning("the host does not read: %d reply bytes are lost", len(data))
            return
        self._waiting += data
        self.flush()

    def flush(self) -> None:
        """Send what the host takes now."""
        with suppress(BlockingIOError):
            while self._waiting:
                del self._waiting[: self._write(bytes(self._waiting))]


@contextmanager
def on_signals(action: Callable[[], object]) -> Iterator[None]:
    """Call `action` at SIGINT (Ctrl-C) and SIGTERM while the block lasts."""
    before = {number: signal.signal(number, lambda *_: action()) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class Server:
    """Serves one twin on some endpoints until `stop` is called. See the module."""

    def __init__(self, twin: SerialTwin, pacer: Pacer, endpoints: Sequence[Endpoint]) -> None:
        self.twin = twin
        self.pacer = pacer
        self.endpoints = tuple(endpoints)
        self._speaker: Endpoint | None = None
        self._line_free_ns = 0
        self._stopped = False
        self._wake_in, self._wake_out = socket.socketpair()
        self._wake_in.setblocking(False)
        self._wake_out.setblocking(False)
        for endpoint in self.endpoints:
            endpoint.attach(self)

    def stop(self) -> None:
        """End `run` soon. May be called from a signal handler or another thread."""
        self._stopped = True
        self.wake()

    def wake(self) -> None:
        """End the present sleep of `run`. May be called from a signal handler or another thread."""
        with suppress(OSError):  # awake already, or closed already
            self._wake_in.send(b"\0")

    def run(self) -> None:
        """Serve until `stop`; then let go of the endpoints."""
        try:
            while not self._stopped:
                self._step()
        finally:
            for endpoint in self.endpoints:
                endpoint.close()
            self._wake_in.close()
            self._wake_out.close()

    def _step(self) -> None:
        slipped = self.pacer.slipped
        self.pacer.advance(self.twin)
        if self.pacer.slipped and not slipped:
            log.warning("this computer does not reach speed %g; running slower", self.pacer.speed)
        self._reply()
        with selectors.DefaultSelector() as selector:
            selector.register(self._wake_out, selectors.EVENT_READ, self._awake)
            for watch in self._watches():
                selector.register(watch.file, watch.events, watch.handler)
            for key, _ in selector.select(self._sleep_s()):
                key.data()

    def _watches(self) -> Iterator[Watch]:
        listening = self._backlog_s() <= 0
        for endpoint in self.endpoints:
            yield from endpoint.watches(listening)

    def _sleep_s(self) -> float | None:
        waits = [self.pacer.wait_s(self.twin)]
        if (backlog := self._backlog_s()) > 0:
            waits.append(backlog)
        known = [wait for wait in waits if wait is not None]
        return min(known) if known else None

    def _backlog_s(self) -> float:
        """Wall seconds until the line has room for more; <= 0: now. Unpaced lines always have."""
        if self.pacer.speed is None:
            return 0.0
        room_ns = LINE_BYTES * self.twin.serial_format.byte_ns
        return self.pacer.until_s(self._line_free_ns - room_ns)

    def _awake(self) -> None:
        with suppress(BlockingIOError):
            self._wake_out.recv(4096)

    def _reply(self) -> None:
        if data := self.twin.read():
            speaker = self._speaker or (self.endpoints[0] if self.endpoints else None)
            if speaker is not None:
                speaker.send(data)

    # called by endpoints

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        """A host of this endpoint has sent `data` just now."""
        present = self.pacer.present_ns()
        while present is not None and self.twin.time_ns < present:
            self.pacer.advance(self.twin)
            self._reply()
        self._speaker = endpoint
        self.twin.write(data)
        start_ns = max(self._line_free_ns, self.twin.time_ns)
        self._line_free_ns = start_ns + len(data) * self.twin.serial_format.byte_ns

    def claim(self, endpoint: Endpoint) -> bool:
        """A network client of this endpoint asks for the line; True if it may have it.

        A client that has closed its sending side and only waits for its last replies gives way.
        """
        if any(other.busy for other in self.endpoints):
            return False
        for other in self.endpoints:
            other.give_way()
        return True
