"""The tap between a real host and a real controller passes every byte on at once and records both directions.

    host --- endpoint ---.                         .--- RealPort --- controller
                          >--- pass on, unchanged -<
         (pty.py, tcp.py) '          |             '    (real_port.py)
                                     v
                             BookWriter: a recording, in a thread of its own

Times are of this computer's finest monotonic clock since the tap began, when the tap (for the host) or the reader
thread (for the controller) has read a byte. A slow or full disk ends the recording, not the session. A side that is too
fast is not read for a while (HELD_BYTES each way). Port settings of a host (speed, and over RFC 2217 data bits, parity,
stop bits, DTR, RTS, break) are set at the controller's port too, in order with the bytes.
"""

from __future__ import annotations

import logging
import threading
import time
from collections import deque
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

from isel_twin.bridge.serve.borders import Endpoint, WireTap
from isel_twin.bridge.serve.endpoints import claimed
from isel_twin.bridge.serve.loop import FileWatch, FileWatches, Wake, woken_by_signals
from isel_twin.bridge.serve.outbox import OUTBOX_BYTES
from isel_twin.bridge.tap.real_port import HELD_BYTES, PIECE_BYTES, Arrived, RealPort
from isel_twin.controller import SerialFormat
from isel_twin.language import Language
from isel_twin.recordings.mcap import RecordingWriter

log = logging.getLogger("isel_twin")

ROOM_BYTES = 2 * PIECE_BYTES  # room an endpoint needs for a piece: Telnet doubles a byte 255
LOOK_S = 0.2  # interval for checking a silent host's settings and flushing the recording
UNWRITTEN_BYTES = 1 << 24  # most bytes waiting for a slow disk; beyond that the recording ends
PATIENCE_S = 5.0  # a host that does not read for longer is logged


class BookWriter:
    """Writes a recording in a thread of its own; `close` returns whether everything is in it."""

    def __init__(self, book: RecordingWriter) -> None:
        self._book = book
        self._entries: deque[tuple[str, int, bytes | str]] = deque()
        self._unwritten = 0
        self._changed = threading.Condition()
        self._closing, self._whole = False, True
        self._thread = threading.Thread(target=self._write, daemon=True)
        self._thread.start()

    def note(self, kind: str, time_ns: int, data: bytes | str) -> None:
        """kind: `sent` or `received` with bytes, `said` with text. Never blocks."""
        with self._changed:
            if self._unwritten > UNWRITTEN_BYTES:
                if self._whole:
                    log.error("the recording ends here, the session goes on: the disk does not keep up")
                self._whole = False
                return
            self._entries.append((kind, time_ns, data))
            self._unwritten += len(data)
            self._changed.notify()

    def _write(self) -> None:
        flushed = time.monotonic()
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._entries or self._closing, LOOK_S)
                entries, self._entries, self._unwritten = self._entries, deque(), 0
                closing = self._closing
            for kind, time_ns, data in entries:
                if isinstance(data, str):
                    self._book.message("/port", time_ns, {"text": data})
                elif kind == "sent":
                    self._book.sent(time_ns, data)
                else:
                    self._book.received(time_ns, data)
            if time.monotonic() - flushed >= LOOK_S:
                self._book.flush()
                flushed = time.monotonic()
            if closing:
                return

    def close(self) -> bool:
        with self._changed:
            self._closing = True
            self._changed.notify()
        self._thread.join()
        self._book.close()
        return self._whole and not self._book.broken


def port_settings(form: SerialFormat) -> dict[str, Any]:
    """A format of the line as attributes of a pySerial port."""
    return {"baudrate": form.baud, "bytesize": form.data_bits, "parity": form.parity, "stopbits": form.stop_bits}


class Tap:
    """Passes bytes between hosts and a controller's port until `stop`. Raises OSError, ValueError without the port.

    serial_format: of the controller's line, until a host sets another. language: of the controller; tells hosts from
    others (gate.py).
    """

    def __init__(
        self,
        address: str,
        endpoints: Sequence[Endpoint],
        serial_format: SerialFormat,
        wire: WireTap | None = None,
        language: Language | None = None,
    ) -> None:
        self.language = language
        self._line = {**port_settings(serial_format), "dtr": True, "rts": True, "break_condition": False}
        self.endpoints = tuple(endpoints)
        self.writer: BookWriter | None = None  # records the traffic
        self._wire = wire
        self._wake = Wake()
        self._watched = FileWatches()
        self._stopped = self._closed = False
        self._speaker = self.endpoints[0]
        self._slow_since: float | None = None
        self._nowhere = 0
        try:
            self._port = RealPort(address, port_settings(serial_format), self._wake)
        except BaseException:
            self._watched.close()
            self._wake.close()
            raise
        self._start_ns = time.perf_counter_ns()
        for endpoint in self.endpoints:
            endpoint.attach(self)
        self._settings = [dict(endpoint.settings) for endpoint in self.endpoints]

    @property
    def held(self) -> int:
        """Bytes of the controller that wait for the host to read."""
        return self._port.held + self._speaker.waiting

    def stop(self) -> None:
        """End `run` soon. May be called from a signal handler or another thread."""
        self._stopped = True
        self._wake()

    def run(self) -> None:
        """Pass bytes on until `stop`; then close both sides."""
        try:
            with woken_by_signals(self._wake):
                while not self._stopped:
                    self._step()
                self._deliver()
        finally:
            self.close()

    def close(self) -> None:
        """Close both sides. May be called again."""
        if self._closed:
            return
        self._closed = True
        for close in (self._port.close, *(endpoint.close for endpoint in self.endpoints)):
            with suppress(OSError):
                close()
        self._watched.close()
        self._wake.close()
        if self._wire is not None:
            self._wire.close()

    def _step(self) -> None:
        self._deliver()
        self._follow()
        if self._wire is not None:
            self._wire.look(time.perf_counter_ns() - self._start_ns)
        watches: list[FileWatch] = [self._wake.watch]
        listening = not self._port.full
        for endpoint in self.endpoints:
            watches += endpoint.watches(listening)
        self._watched.wait(watches, LOOK_S)

    @property
    def lost_bytes(self) -> int:
        """Bytes of the host that the controller cannot have got."""
        return self._port.nowhere

    # from the controller

    def _deliver(self) -> None:
        """Pass on bytes of the controller, as far as the host takes them."""
        while (room := OUTBOX_BYTES - ROOM_BYTES - self._speaker.waiting) > 0:
            pieces = self._port.take(PIECE_BYTES)
            if not pieces:
                break
            for piece in pieces:
                self._hand_on(piece)
        self._tell_slow(room <= 0)

    def _hand_on(self, piece: Arrived) -> None:
        time_ns = max(0, piece.time_ns - self._start_ns)
        if piece.note:
            log.warning("%s %s", self._port.address, piece.note)
            self._note("said", time_ns, f"{self._port.address} {piece.note}")
            if self._port.nowhere > self._nowhere:
                log.warning("%d bytes of the host went nowhere", self._port.nowhere - self._nowhere)
                self._nowhere = self._port.nowhere
            return
        self._speaker.send(piece.data)
        self._note("received", time_ns, piece.data)

    def _tell_slow(self, slow: bool) -> None:
        now = time.monotonic()
        if not slow:
            self._slow_since = None
        elif self._slow_since is None:
            self._slow_since = now
        elif 0 <= now - self._slow_since >= PATIENCE_S:
            log.warning("the host does not read: %d bytes wait, and the controller is not listened to", HELD_BYTES)
            self._slow_since = float("inf")

    # settings

    @property
    def serial_format(self) -> SerialFormat:
        line = self._line
        return SerialFormat(line["baudrate"], line["bytesize"], line["parity"], line["stopbits"])

    def _follow(self) -> None:
        """Copy a host's port settings to the controller's port."""
        for number, endpoint in enumerate(self.endpoints):
            now = dict(endpoint.settings)
            if now == self._settings[number]:
                continue
            self._settings[number] = now
            changed = {name: value for name, value in now.items() if self._line[name] != value}
            if changed:
                self._line.update(changed)
                self._port.set(changed)
                text = ", ".join(f"{name} {value}" for name, value in changed.items())
                log.info("%s: the host sets %s", endpoint.kind, text)
                self._note("said", time.perf_counter_ns() - self._start_ns, f"host sets {text}")

    def _note(self, kind: str, time_ns: int, data: bytes | str) -> None:
        if self.writer is not None:
            self.writer.note(kind, time_ns, data)
        if self._wire is not None:
            if isinstance(data, str):
                self._wire.act(time_ns, data)
            else:
                self._wire.carry(time_ns, data, sent=kind == "sent")

    # called by endpoints

    def receive(self, endpoint: Endpoint, data: bytes) -> None:
        self._deliver()  # what has come before
        time_ns = time.perf_counter_ns() - self._start_ns
        self._speaker = endpoint
        self._follow()
        self._port.put(data)
        self._note("sent", time_ns, data)

    def claim(self, endpoint: Endpoint) -> bool:
        return claimed(self.endpoints)
