"""One twin behind any number of endpoints: the loop of `isel-twin serve`.

The goal of this code is a serial port that behaves like the controller's own, whatever it is reached by. The controller
has one line; so a reply goes to the endpoint that spoke last, and one network client at a time holds the line. A host
that goes away never stops the machine.

    while not stopped:
        let virtual time catch up, about 5 ms of computing at most      (pacing.py)
        hand replies to the host
        sleep until the next event or until somebody speaks

So hosts and signals are heard within some 30 ms, whatever the twin is busy with. Nothing grows without end: a host is
listened to as long as there is room on the line in both directions, and replies it does not read are lost beyond
OUTBOX_BYTES.
"""

from __future__ import annotations

import gc
import logging
import math
import signal
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from typing import Any, Protocol

from isel_twin.bridge.serve.loop import Wake, Watch, Watched, woken_by_signals
from isel_twin.bridge.serve.pacing import Clocked, Pacer
from isel_twin.bridge.serve.uart import heard
from isel_twin.controller import SerialFormat

log = logging.getLogger("isel_twin")

OUTBOX_BYTES = 65_536
"""Replies kept for a host that does not read. What is beyond is lost, as on a serial line without flow control."""

LINE_BYTES = 4096
"""Bytes taken from a host ahead of what a paced line can have carried; as much as an operating system buffers. And
bytes of replies still on a paced line beyond which no more commands are taken."""

SILENCE_BYTES = 2
"""Byte times of silence on a paced line after which what has come before it is handed on in one piece."""

PIECE_BYTES = 1024
"""Largest such piece."""


class SerialTwin(Clocked, Protocol):
    """What the server needs of a twin."""

    @property
    def replies_due(self) -> int:
        """Bytes of replies still on the line; from a host that asks faster than it can answer, no more is taken."""

    @property
    def commands_due(self) -> int:
        """Bytes that were written and have not arrived: if it lets its host wait, no more is taken."""

    @property
    def serial_format(self) -> SerialFormat: ...
    def write(self, data: bytes) -> None: ...
    def read(self) -> bytes: ...


class WireTap(Protocol):
    """Somebody who follows the traffic; see wire_log.py."""

    def carry(self, time_ns: int, data: bytes, sent: bool) -> None:
        """Bytes have been sent by the host (`sent`) or have arrived there."""

    def look(self, time_ns: int) -> None:
        """Time has passed."""

    def act(self, time_ns: int, text: str) -> None:
        """Somebody beside the host has done something to the machine or to its time."""

    def close(self) -> None:
        """That was all."""


class Guest(Protocol):
    """Somebody at the server who is no host: looked after in every round of the loop. See control_port.py."""

    def attach(self, server: Server) -> None:
        """The server whose guest this is."""

    def watches(self) -> Iterable[Watch]:
        """Files to wait for now."""

    def wait_s(self) -> float | None:
        """Wall seconds until `look` must be called, whatever happens; None: not by itself."""

    def look(self) -> None:
        """Something may have happened. Never blocks."""

    def close(self) -> None:
        """The server ends: say so, let go of everything."""


class Line(Protocol):
    """What endpoints are attached to: the controller's line, a twin's (`Server`) or a real one's (tap.py)."""

    @property
    def serial_format(self) -> SerialFormat:
        """How the controller's bytes go over the line."""

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        """A host of this endpoint has sent `data` just now."""

    def claim(self, endpoint: Endpoint) -> bool:
        """A network client of this endpoint asks for the line; True if it may have it."""


class Endpoint(Protocol):
    """A place where hosts connect. It is given its `Line` by `attach`, and from then on watched."""

    kind: str
    """`pty`, `tcp`, `rfc2217`: the key of its address in the line that `serve` prints."""
    address: str
    """What a host connects to."""
    gathers: bool
    """Whether bytes that follow each other on a paced line are handed on in one piece, as a terminal server does."""

    @property
    def busy(self) -> bool:
        """True while a network client holds the line here."""

    @property
    def waiting(self) -> int:
        """Bytes for the host that it has not taken yet."""

    @property
    def settings(self) -> Mapping[str, Any]:
        """How the host has set the port, as far as that can be seen: attributes of a pySerial port, baudrate first."""

    def attach(self, line: Line) -> None:
        """The line that will watch this endpoint, to be told what hosts send."""

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
    """Call `action` at SIGINT (Ctrl-C), SIGTERM and SIGHUP (the terminal has gone) while the block lasts.

    A SIGHUP that is ignored already stays so: that is how `nohup` works.
    """
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: action()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class _Piece:
    """Replies of a paced line, gathered until it falls silent."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._last_ns = 0

    def __bool__(self) -> bool:
        return bool(self._data)

    def add(self, time_ns: int, data: bytes) -> None:
        """Bytes have arrived at time_ns."""
        self._data += data
        self._last_ns = time_ns

    def complete_ns(self, byte_ns: int) -> int | None:
        """When the piece is complete unless something is added; None if there is none."""
        if not self._data:
            return None
        return self._last_ns + (SILENCE_BYTES * byte_ns if len(self._data) < PIECE_BYTES else 0)

    def take(self) -> bytes:
        data = bytes(self._data)
        self._data.clear()
        return data


def host_format(endpoint: Endpoint, line: SerialFormat) -> SerialFormat:
    """How a host has set its port; what cannot be seen is taken to be as on the line."""
    settings = endpoint.settings
    return SerialFormat(
        settings.get("baudrate", line.baud),
        settings.get("bytesize", line.data_bits),
        settings.get("parity", line.parity),
        math.ceil(settings.get("stopbits", line.stop_bits)),
    )


def _name(endpoint: Endpoint) -> str:
    """What a host knows it by."""
    return getattr(endpoint, "link", None) or endpoint.address


def _needed(form: SerialFormat) -> tuple[int, int, str]:
    """What both sides must agree on."""
    return form.baud, form.data_bits, form.parity


def claimed(endpoints: Iterable[Endpoint]) -> bool:
    """Whether a network client may have the line that these endpoints share; one that has left gives way to it."""
    endpoints = tuple(endpoints)
    if any(endpoint.busy for endpoint in endpoints):
        return False
    for endpoint in endpoints:
        endpoint.give_way()
    return True


class Server:
    """Serves one twin on some endpoints until `stop` is called. See the module."""

    def __init__(
        self,
        twin: SerialTwin,
        pacer: Pacer,
        endpoints: Sequence[Endpoint],
        wire: WireTap | None = None,
        guests: Sequence[Guest] = (),
        strict_baud: bool = False,
    ) -> None:
        """wire: follows the traffic in both directions, in virtual time.

        strict_baud: a host whose port is set otherwise than the controller's line hears and is heard as over a real
        one (uart.py). What it sends at once goes without a pause; what it hears is handed on once the line is silent.
        """
        self.twin = twin
        self.pacer = pacer
        self.endpoints = tuple(endpoints)
        self._wire = wire
        self._strict_baud = strict_baud
        self._warned: dict[Endpoint, SerialFormat] = {}
        """Settings of hosts that do not fit, as they were told."""
        self._speaker: Endpoint | None = None
        self._line_free_ns = 0
        self._piece = _Piece()
        self._behind = False
        self._stopped = False
        self._watched = Watched()
        self._wake = Wake()
        self._guests = tuple(guests)
        self._unheard = 0
        """Bytes of hosts taken while virtual time stands still."""
        for endpoint in self.endpoints:
            endpoint.attach(self)
        for guest in self._guests:
            guest.attach(self)

    def stop(self) -> None:
        """End `run` soon. May be called from a signal handler or another thread."""
        self._stopped = True
        self.wake()

    def wake(self) -> None:
        """End the present sleep of `run`. May be called from a signal handler or another thread."""
        self._wake()

    def run(self) -> None:
        """Serve until `stop`; then let go of the endpoints, also if something in it raises."""
        gc.freeze()  # or every now and then the collector looks at all there is, which takes tens of milliseconds
        try:
            with woken_by_signals(self._wake):
                while not self._stopped:
                    self._step()
            self._hand_on()
        finally:
            gc.unfreeze()
            if self._wire is not None:
                self._wire.close()
            closes = [part.close for part in self._guests] + [part.close for part in self.endpoints]
            for close in closes:
                with suppress(OSError):  # the others must be let go of, too
                    close()
            self._watched.close()
            self._wake.close()

    def _step(self) -> None:
        self.pacer.advance(self.twin)
        self._say_pace()
        self._reply()
        for guest in self._guests:
            guest.look()
        if self._wire is not None:
            self._wire.look(self.twin.time_ns)
        self._watched.wait(self._watches(), self._sleep_s())

    def _say_pace(self) -> None:
        if self.pacer.behind == self._behind:
            return
        self._behind = self.pacer.behind
        if self._behind:
            log.warning(
                "this computer does not reach speed %g: %.3g times real time", self.pacer.speed, self.pacer.reached
            )
        else:
            log.warning(
                "speed %g is reached again; it was %.3g times real time meanwhile",
                self.pacer.speed,
                self.pacer.reached,
            )

    def _watches(self) -> list[Watch]:
        watches = [self._wake.watch]
        listening = self.listening
        for endpoint in self.endpoints:
            watches += endpoint.watches(listening)
        for guest in self._guests:
            watches += guest.watches()
        return watches

    def _sleep_s(self) -> float | None:
        waits = [self.pacer.wait_s(self.twin), *(guest.wait_s() for guest in self._guests)]
        if (backlog := self._backlog_s()) > 0:
            waits.append(backlog)
        if self.pacer.speed is not None and self._piece:
            complete_ns = self._piece.complete_ns(self.twin.serial_format.byte_ns)
            waits.append(None if complete_ns is None else self.pacer.until_s(complete_ns))
        known = [wait for wait in waits if wait is not None and wait < math.inf]
        return min(known) if known else None

    def _backlog_s(self) -> float:
        """Wall seconds until the line has room for more; <= 0: now. Unpaced lines always have."""
        if self.pacer.speed is None:
            return 0.0
        room_ns = LINE_BYTES * self.twin.serial_format.byte_ns
        return self.pacer.until_s(self._line_free_ns - room_ns)

    @property
    def listening(self) -> bool:
        """Whether the line has room for what a host says now."""
        return self._backlog_s() <= 0 and not self._piles_up() and not self._filled_up()

    def _piles_up(self) -> bool:
        """Whether the line to the host is so far behind that no more questions should be asked, or the controller lets
        its host wait."""
        return self.twin.replies_due > LINE_BYTES or self.twin.commands_due > 2 * LINE_BYTES

    def _filled_up(self) -> bool:
        """Whether virtual time stands still, and hosts have said as much meanwhile as a line can hold."""
        if not self.pacer.paused:
            self._unheard = 0
        return self._unheard > LINE_BYTES

    def _reply(self) -> None:
        """Hand what has arrived to the host, in pieces or as it comes."""
        twin = self.twin
        if data := twin.read():
            if self._wire is not None:
                self._wire.carry(twin.time_ns, data, sent=False)
            self._piece.add(twin.time_ns, data)
        if not self._piece:
            return
        if self._gathering:
            complete_ns = self._piece.complete_ns(twin.serial_format.byte_ns)
            if complete_ns is None or complete_ns > twin.time_ns:
                return
        self._hand_on()

    @property
    def _listener(self) -> Endpoint | None:
        """Who gets the replies."""
        return self._speaker or (self.endpoints[0] if self.endpoints else None)

    @property
    def _gathering(self) -> bool:
        listener = self._listener
        if self.pacer.speed is None or listener is None:
            return False
        return listener.gathers or (self._strict_baud and not self.fits(listener))

    def _hand_on(self) -> None:
        """Send the piece gathered so far."""
        data, listener = self._piece.take(), self._listener
        if data and listener is not None:
            if self._strict_baud and not self.fits(listener):
                data = heard(data, self.serial_format, host_format(listener, self.serial_format)).data
            listener.send(data)

    # called by endpoints

    @property
    def serial_format(self) -> SerialFormat:
        """How the controller's bytes go over the line."""
        return self.twin.serial_format

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        """A host of this endpoint has sent `data` just now."""
        self.pacer.catch_up(self.twin, self._reply)
        if endpoint is not self._speaker:
            self._hand_on()
            self._speaker = endpoint
        self._compare(endpoint)
        if self._strict_baud and not self.fits(endpoint):
            data = heard(data, host_format(endpoint, self.serial_format), self.serial_format).data
            if not data:
                return
        if self._wire is not None:
            self._wire.carry(self.twin.time_ns, data, sent=True)
        self.twin.write(data)
        self._unheard += len(data)
        if self.pacer.speed is None:
            self._reply()  # it may have been answered already
            return
        start_ns = max(self._line_free_ns, self.twin.time_ns)
        self._line_free_ns = start_ns + len(data) * self.twin.serial_format.byte_ns

    def fits(self, endpoint: Endpoint) -> bool:
        """Whether the host has set its port there as the controller's line is, as far as that matters and can be seen.

        A second stop bit is a pause, which nobody minds.
        """
        return _needed(host_format(endpoint, self.serial_format)) == _needed(self.serial_format)

    def _compare(self, endpoint: Endpoint) -> None:
        """Tell a host's settings that do not fit, once."""
        if self.fits(endpoint):
            self._warned.pop(endpoint, None)
            return
        host = host_format(endpoint, self.serial_format)
        if self._warned.get(endpoint) == host:
            return
        self._warned[endpoint] = host
        what = "as here" if self._strict_baud else "here it does not matter (--strict-baud: as on a real line)"
        log.warning(
            "%s %s: the host's port is set to %s, the controller's line has %s; a real line would garble each byte, %s",
            endpoint.kind,
            _name(endpoint),
            host,
            self.serial_format,
            what,
        )

    # called by guests

    def ports(self) -> list[dict[str, Any]]:
        """Each endpoint, and what its host has set: `host` is its format, `fits` whether that is the line's."""
        return [
            {
                "kind": endpoint.kind,
                "address": _name(endpoint),
                "host": str(host_format(endpoint, self.serial_format)),
                "fits": self.fits(endpoint),
            }
            for endpoint in self.endpoints
        ]

    def present(self) -> None:
        """Bring the twin to the present, because somebody wants to do something to it or to its time."""
        self.pacer.catch_up(self.twin, self._reply)

    def act(self, text: str) -> None:
        """Have it written down what is done, where the traffic is."""
        if self._wire is not None:
            self._wire.act(self.twin.time_ns, text)

    def go_on(self, speed: float | None, paused: bool = False) -> None:
        """Keep another speed from now on, or, if still paused, when time goes on."""
        self.pacer.go_on(speed, self.twin.time_ns, paused)
        self._behind = False
        self._line_free_ns = min(self._line_free_ns, self.twin.time_ns) if speed is None else self._line_free_ns

    def claim(self, endpoint: Endpoint) -> bool:
        """A network client of this endpoint asks for the line; True if it may have it.

        A client that has closed its sending side and only waits for its last replies gives way.
        """
        return claimed(self.endpoints)
