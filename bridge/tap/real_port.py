"""The port of a real controller, read and written by two threads.

    /dev/ttyUSB0, COM3, /dev/pts/7       a serial device of this computer
    rfc2217://host:port                  one behind RFC 2217 (pySerial speaks it)
    tcp://host:port                      a terminal server's raw connection

    controller --> reader thread --(stamped)--> take()             one bounded queue each way:
    controller <-- writer thread <------------- put(), set()       the faster side waits

A byte gets its time stamp in the reader thread, so a busy loop, or a host that does not read, has no effect on times.
Settings keep their order among the bytes: earlier bytes have left the computer when they change. A port that vanishes
(an unplugged adapter) is tried again every RETRY_S, with its last settings; bytes put meanwhile are lost and counted
(bridge/9).
"""

from __future__ import annotations

import errno
import logging
import re
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple

import serial

from isel_twin.bridge.serve.tcp import parse_address

log = logging.getLogger("isel_twin")

HELD_BYTES = 65_536  # most bytes in one direction; then the port is not read, or `full` is True
PIECE_BYTES = 4096  # read at once

RETRY_S = 1.0
LOOK_S = 0.5  # longest wait of a thread before it checks whether to end

CONNECT_S = 5.0


class Arrived(NamedTuple):
    """Data from the controller's side."""

    time_ns: int  # of time.perf_counter_ns
    data: bytes
    note: str = ""  # instead of bytes: the port has gone, or is back


class _TcpPort:
    """A raw connection: no settings."""

    def __init__(self, address: str) -> None:
        self._socket = socket.create_connection(parse_address(address), CONNECT_S)
        self._socket.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._socket.settimeout(None)

    def read(self) -> bytes:
        data = self._socket.recv(PIECE_BYTES)
        if not data:
            raise OSError("closed by the other side")
        return data

    def write(self, data: bytes) -> None:
        self._socket.sendall(data)

    def set(self, settings: Mapping[str, Any]) -> None:
        pass

    def cancel(self) -> None:
        with suppress(OSError):
            self._socket.shutdown(socket.SHUT_RDWR)

    def close(self) -> None:
        self._socket.close()


class _SerialPort:
    """A device, or a pySerial URL. read: b"" if nothing came for LOOK_S."""

    def __init__(self, address: str, settings: Mapping[str, Any]) -> None:
        with _os_errors():
            self._port = serial.serial_for_url(address, do_not_open=True, timeout=LOOK_S)
            if isinstance(self._port, serial.Serial):
                self._port.exclusive = True  # refuse a port that another program has open
            self.set(settings, flush=False)
            self._port.open()
        # Linux: otherwise an FTDI adapter holds bytes for 16 ms; not every device supports this
        with suppress(Exception):
            self._port.set_low_latency_mode(True)

    def read(self) -> bytes:
        with _os_errors():
            data = self._port.read(1)
            return data + self._port.read(min(self._port.in_waiting, PIECE_BYTES - 1)) if data else b""

    def write(self, data: bytes) -> None:
        with _os_errors():
            self._port.write(data)

    def set(self, settings: Mapping[str, Any], flush: bool = True) -> None:
        """Change the settings after the written bytes have left; unsupported ones are logged."""
        with _os_errors():
            if flush:
                self._port.flush()
        for name, value in settings.items():
            try:
                if getattr(self._port, name) != value:
                    setattr(self._port, name, value)
            except Exception as error:  # a pseudo terminal has no DTR, an adapter not every speed
                log.warning("%s: %s cannot be set to %s: %s", self._port.port, name, value, error)

    def cancel(self) -> None:
        for name in ("cancel_read", "cancel_write"):
            with suppress(Exception):
                getattr(self._port, name)()

    def close(self) -> None:
        with suppress(Exception):
            self._port.close()


@contextmanager
def _os_errors() -> Iterator[None]:
    """Turn anything that pySerial raises for a vanished port (termios.error, TypeError ...) into OSError."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, _plain(error)) from error
    except Exception as error:  # termios.error has the arguments of an OSError, and is none
        numbered = len(error.args) == 2 and isinstance(error.args[0], int)
        raise OSError(*(error.args if numbered else (str(error),))) from error


_PLAIN = {  # plain words for parts of pySerial's messages
    "exclusively lock": "is in use by another program",
    "returned no data": "it was unplugged, or its other end has closed",
}


def _plain(error: OSError) -> str:
    """pySerial's message without repetitions: 'could not open port X: [Errno 2] Y: X' becomes Y."""
    text = str(error)
    if isinstance(error, serial.SerialException):
        cause = re.search(r"\[Errno \d+\] ([^:\]]+)", text.removeprefix(f"[Errno {error.errno}] "))
        for part, plain in _PLAIN.items():
            if part in text:
                return plain
        return cause[1] if cause else text
    return error.strerror or text


# An open port: one thread reads, one writes; `cancel` ends a read or write that blocks in another thread. All methods
# but `cancel` and `close` raise OSError once the port has gone.
Port = _TcpPort | _SerialPort


def open_port(address: str, settings: Mapping[str, Any]) -> Port:
    """Raises OSError if the port cannot be opened, ValueError for a bad address."""
    if address.startswith("tcp://"):
        return _TcpPort(address.removeprefix("tcp://"))
    return _SerialPort(address, settings)


class RealPort:
    """The controller's port and its threads; wake: called when there is something to `take`. Raises as open_port."""

    def __init__(self, address: str, settings: Mapping[str, Any], wake: Callable[[], None]) -> None:
        self.address = address
        self._settings, self._wake = dict(settings), wake
        self._changed = threading.Condition()
        self._arrived: deque[Arrived] = deque()
        self.held = 0  # bytes that have come and were not taken
        self._outgoing: deque[bytes | Mapping[str, Any]] = deque()
        self._waiting, self._ending = 0, False
        self._writing = threading.Lock()
        self._port: Port | None = open_port(address, self._settings)
        self.nowhere = 0  # bytes put while there was no port
        self._threads = [threading.Thread(target=work, daemon=True) for work in (self._read, self._write)]
        for thread in self._threads:
            thread.start()

    # the loop's side

    def take(self, most: int) -> list[Arrived]:
        """The data that have come: pieces of up to `most` bytes in total."""
        taken = []
        with self._changed:
            while self._arrived and len(self._arrived[0].data) <= most:
                piece = self._arrived.popleft()
                most -= len(piece.data)
                self.held -= len(piece.data)
                taken.append(piece)
            if taken:
                self._changed.notify_all()
        return taken

    @property
    def full(self) -> bool:
        """True while nothing should be put, as the line is slower than the host."""
        return self._waiting >= HELD_BYTES

    def put(self, data: bytes) -> None:
        self._queue(data, len(data))

    def set(self, settings: Mapping[str, Any]) -> None:
        """Change the line's settings, after the bytes put before."""
        self._queue(dict(settings), 0)

    def _queue(self, item: bytes | Mapping[str, Any], size: int) -> None:
        with self._changed:
            self._outgoing.append(item)
            self._waiting += size
            self._changed.notify_all()

    def close(self) -> None:
        """Send remaining bytes within a short time, and close the port."""
        with self._changed:
            self._changed.wait_for(lambda: not self._waiting or self._port is None, LOOK_S)
            self._ending = True
            port = self._port
            self._changed.notify_all()
        if port is not None:
            port.cancel()
        for thread in self._threads:
            thread.join(2 * LOOK_S)
        if port is not None:
            port.close()

    # the threads

    def _read(self) -> None:
        while not self._ending:
            port = self._port
            if port is None:
                self._again()
                continue
            try:
                data = port.read()
            except OSError as error:
                if not self._ending:
                    self._gone(port, error)
                continue
            if data:
                self._hand_over(Arrived(time.perf_counter_ns(), data))

    def _hand_over(self, piece: Arrived) -> None:
        with self._changed:
            self._arrived.append(piece)
            self.held += len(piece.data)
        self._wake()
        if self.held >= HELD_BYTES:
            with self._changed:
                self._changed.wait_for(lambda: self.held < HELD_BYTES or self._ending)

    def _gone(self, port: Port, error: OSError) -> None:
        """Handle a vanished port; called only by the reader, which detects it."""
        with self._changed:
            self._port = None
            self._changed.notify_all()
        port.cancel()
        out = self._writing.acquire(timeout=2 * LOOK_S)  # closed during a write, its descriptor could be reused
        port.close()
        if out:
            self._writing.release()
        self._hand_over(Arrived(time.perf_counter_ns(), b"", f"has gone: {error.strerror or error}"))

    def _again(self) -> None:
        with self._changed:
            if self._changed.wait_for(lambda: self._ending, RETRY_S):
                return
        try:
            port = open_port(self.address, self._settings)
        except (OSError, ValueError):
            return  # still away
        with self._changed:
            self._port = port
        self._hand_over(Arrived(time.perf_counter_ns(), b"", "is back"))

    def _write(self) -> None:
        while True:
            with self._changed:
                self._changed.wait_for(lambda: self._outgoing or self._ending)
                if not self._outgoing:
                    return
                item = self._outgoing.popleft()
                port = self._port
            if not isinstance(item, bytes):
                self._settings.update(item)
            try:
                with self._writing:
                    if port is None or port is not self._port:
                        raise OSError("no port")
                    if isinstance(item, bytes):
                        port.write(item)
                    else:
                        port.set(item)
            except OSError:
                self.nowhere += len(item) if isinstance(item, bytes) else 0
            if isinstance(item, bytes):
                with self._changed:
                    full, self._waiting = self.full, self._waiting - len(item)
                    self._changed.notify_all()
                if full and not self.full:
                    self._wake()


def refusal(device: str, error: OSError | ValueError) -> str:
    """Why the controller's port cannot be opened, and the ports there are."""
    reason = f"{device}: {getattr(error, 'strerror', None) or error}"
    if isinstance(error, PermissionError) or "Permission denied" in reason:
        return f"{reason}; ask for the group of serial ports (dialout, uucp), or try as root"
    if "://" in device:
        return f"{reason}; is something listening there?"
    if getattr(error, "errno", None) == errno.EINVAL:
        return f"{reason}; a pseudo terminal has no parity: let the twin serve --rfc2217, and give rfc2217://HOST:PORT"
    if "in use" in reason:
        return f"{reason}; close that one first"
    from serial.tools.list_ports import comports

    known = ", ".join(sorted(port.device for port in comports()))
    return f"{reason}; serial ports here: {known or 'none; is it plugged in?'}"
