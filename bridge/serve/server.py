"""One twin behind any number of endpoints: the loop of `isel-twin serve`.

Every endpoint behaves like the controller's own serial port. The controller has one line, so a reply goes to the
endpoint that sent last, and one network client at a time holds the line. A host that disconnects never stops the
machine (bridge/1).

    while not stopped:
        let virtual time catch up, about 5 ms of computing at most      (pacing.py)
        send replies to the host
        sleep until the next event or byte

So hosts and signals are handled within some 30 ms, even if the twin is busy. A host is read while there is room on the
line in both directions; replies it does not read are lost beyond OUTBOX_BYTES.
"""

from __future__ import annotations

import gc
import logging
import math
from collections.abc import Iterable, Sequence
from contextlib import suppress
from typing import Any, Protocol

from isel_twin.bridge.serve.borders import Endpoint, SerialTwin, WireTap
from isel_twin.bridge.serve.endpoints import claimed, name_of
from isel_twin.bridge.serve.host_settings import MisfitLog, fits, host_format
from isel_twin.bridge.serve.loop import FileWatch, FileWatches, Wake, woken_by_signals
from isel_twin.bridge.serve.pacing import Pacer
from isel_twin.bridge.serve.uart import heard
from isel_twin.controller import SerialFormat
from isel_twin.language import Language

log = logging.getLogger("isel_twin")

# Most bytes taken from a host ahead of a paced line, as much as an operating system buffers; most bytes of replies on a
# paced line before no more commands are taken.
LINE_BYTES = 4096

SILENCE_BYTES = 2  # byte times of silence on a paced line that end a piece
PIECE_BYTES = 1024  # largest such piece
MEASURED_S = 1.0  # wall time over which a speed is measured before it is said not to be reached


class Guest(Protocol):
    """A participant that is no host, such as the control port; called in every round of the loop."""

    def attach(self, server: Server) -> None:
        """Take the server."""
        return

    def watches(self) -> Iterable[FileWatch]:
        """Files to wait for now."""

    def wait_s(self) -> float | None:
        """Wall seconds until `look` must be called; None: no limit."""

    def look(self) -> None:
        """Called when something may have happened. Never blocks."""

    def close(self) -> None:
        """Called at the end of the server: inform clients and close everything."""


class _Piece:
    """Replies of a paced line, gathered until it falls silent or virtual time stands still (bridge/5)."""

    def __init__(self) -> None:
        self._data = bytearray()
        self._last_ns = 0

    def __bool__(self) -> bool:
        return bool(self._data)

    def add(self, time_ns: int, data: bytes) -> None:
        self._data += data
        self._last_ns = time_ns

    def complete_ns(self, byte_ns: int) -> int | None:
        """When the piece is complete without further bytes; None if there is none."""
        if not self._data:
            return None
        return self._last_ns + (SILENCE_BYTES * byte_ns if len(self._data) < PIECE_BYTES else 0)

    def take(self) -> bytes:
        data = bytes(self._data)
        self._data.clear()
        return data


def _three_digits(factor: float) -> str:
    """Text of a factor, rounded down: never the speed that it is short of."""
    unit = 10.0 ** (math.floor(math.log10(factor)) - 2) if factor > 0.0 else 1.0
    return f"{math.floor(factor / unit) * unit:.3g}"


class Server:
    """Serves one twin on some endpoints until `stop` is called."""

    def __init__(
        self,
        twin: SerialTwin,
        pacer: Pacer,
        endpoints: Sequence[Endpoint],
        wire: WireTap | None = None,
        guests: Sequence[Guest] = (),
        strict_baud: bool = False,
    ) -> None:
        """wire: gets the traffic of both directions, in virtual time. strict_baud: with wrong port settings of a host,
        bytes are garbled as on a real line (uart.py). Bytes that it sends at once have no pause between them; replies
        are delivered after a silence of the line (bridge/12).
        """
        self.twin, self.pacer, self.endpoints = twin, pacer, tuple(endpoints)
        self._wire = wire
        self._strict_baud = strict_baud
        self._misfits = MisfitLog(strict_baud)
        self._speaker: Endpoint | None = None
        self._line_free_ns = 0
        self._piece = _Piece()
        self._behind = self._said_slow = False
        self._stopped = False
        self._watched = FileWatches()
        self._wake = Wake()
        self._guests = tuple(guests)
        self._unheard = 0  # bytes of hosts taken while virtual time stands still
        for endpoint in self.endpoints:
            endpoint.attach(self)
        for guest in self._guests:
            guest.attach(self)

    def stop(self) -> None:
        """End `run` soon. May be called from a signal handler or another thread."""
        self._stopped = True
        self.wake()

    def wake(self) -> None:
        """End the present sleep of `run`; may be called from anywhere."""
        self._wake()

    def run(self) -> None:
        """Serve until `stop`; then close the endpoints, even after an exception."""
        gc.freeze()  # otherwise full collections take tens of milliseconds now and then
        try:
            with woken_by_signals(self._wake):
                while not self._stopped:
                    self._step()
            self._hand_on()
        finally:
            gc.unfreeze()
            if self._wire is not None:
                self._wire.close()
            parts: list[Guest | Endpoint] = [*self._guests, *self.endpoints]
            for part in parts:
                with suppress(OSError):  # the others must be closed, too
                    part.close()
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
        """Say that the speed is not reached, measured for MEASURED_S, and is again; of a single stall, its length."""
        pacer, was, self._behind = self.pacer, self._behind, self.pacer.behind
        if not self._said_slow and pacer.slips > 1 and pacer.behind and pacer.behind_s >= MEASURED_S:
            self._said_slow = True
            told = "this computer does not reach speed %g: %s times real time"
        elif was and not pacer.behind:
            told = "speed %g is reached again; it was %s times real time meanwhile"
            if not self._said_slow:
                told = "this computer was late once at speed %g: %s times real time for " + f"{pacer.behind_s:.2g} s"
            self._said_slow = False
        else:
            return
        log.warning(told, pacer.speed, _three_digits(pacer.reached))

    def _watches(self) -> list[FileWatch]:
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
        complete_ns = self._piece.complete_ns(self.twin.serial_format.byte_ns)
        if complete_ns is not None:
            waits.append(self.pacer.until_s(complete_ns) if self._gathering else 0.0)
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
        """True if the line has room for bytes of a host."""
        return self._backlog_s() <= 0 and not self._piles_up() and not self._filled_up()

    def _piles_up(self) -> bool:
        """True if the line is too full in either direction."""
        return self.twin.replies_due > LINE_BYTES or self.twin.commands_due > 2 * LINE_BYTES

    def _filled_up(self) -> bool:
        """True if virtual time is stopped and hosts have sent as much as the line can hold."""
        if not self.pacer.paused:
            self._unheard = 0
        return self._unheard > LINE_BYTES

    def _reply(self) -> None:
        """Send what has arrived to the host, in pieces or byte by byte."""
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
        return self._speaker or (self.endpoints[0] if self.endpoints else None)

    @property
    def _gathering(self) -> bool:
        listener = self._listener
        if self.pacer.speed is None or listener is None:
            return False
        return (listener.gathers and not self.pacer.paused) or self._garbles(listener)

    def _hand_on(self) -> None:
        data, listener = self._piece.take(), self._listener
        if data and listener is not None:
            if self._garbles(listener):
                data = heard(data, self.serial_format, host_format(listener, self.serial_format)).data
            listener.send(data)

    def _garbles(self, endpoint: Endpoint) -> bool:
        """True if this host has the wrong speed or format."""
        return self._strict_baud and not fits(endpoint, self.serial_format)

    # called by endpoints

    @property
    def serial_format(self) -> SerialFormat:
        return self.twin.serial_format

    @property
    def language(self) -> Language | None:
        return self.twin.language

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        self.pacer.catch_up(self.twin, self._reply)
        if endpoint is not self._speaker:
            self._hand_on()
            self._speaker = endpoint
        self._misfits.compare(endpoint, self.serial_format)
        if self._garbles(endpoint):
            data = heard(data, host_format(endpoint, self.serial_format), self.serial_format).data
            if not data:
                return
        if self._wire is not None:
            self._wire.carry(self.twin.time_ns, data, sent=True)
        self.twin.write(data)
        self._unheard += len(data)
        if self.pacer.speed is None:
            self._reply()  # there may be an answer already
            return
        start_ns = max(self._line_free_ns, self.twin.time_ns)
        self._line_free_ns = start_ns + len(data) * self.twin.serial_format.byte_ns

    # called by guests

    def ports(self) -> list[dict[str, Any]]:
        """Each endpoint with its host's format `host`, and whether it `fits` the line."""
        return [
            {
                "kind": endpoint.kind,
                "address": name_of(endpoint),
                "host": str(host_format(endpoint, self.serial_format)),
                "fits": fits(endpoint, self.serial_format),
            }
            for endpoint in self.endpoints
        ]

    def present(self) -> None:
        """Bring the twin to the present before an operation on it or its time."""
        self.pacer.catch_up(self.twin, self._reply)

    def act(self, text: str) -> None:
        """Report an operation on the machine to the taps."""
        if self._wire is not None:
            self._wire.act(self.twin.time_ns, text)

    def go_on(self, speed: float | None, paused: bool = False) -> None:
        """Change the speed from now on, or, if still paused, after the pause."""
        self.pacer.go_on(speed, self.twin.time_ns, paused)
        self._behind = self._said_slow = False
        if speed is None:
            self._line_free_ns = min(self._line_free_ns, self.twin.time_ns)

    def claim(self, endpoint: Endpoint) -> bool:
        return claimed(self.endpoints)
