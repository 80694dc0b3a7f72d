"""The serial port of a host in virtual time, under the name of the twin's port.

    serial.Serial("COM4", 19200, timeout=1)  -.
    serial.serial_for_url("COM4")            -+--> VirtualSerial --> Turns --> the twin's line
    serial.tools.list_ports.comports()  lists it

It behaves like pySerial's ports, in virtual time: reads wait for their bytes or timeouts, writes return at once unless
BUFFER bytes are waiting for the line, one program can open it at a time. Line settings are accepted without effect;
settings other than the controller's give a note at the end (`Ports.notes`).
"""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

from serial.serialutil import SerialException, SerialTimeoutException, to_bytes

from isel_twin.bridge.virtual.in_process import NoModemLines
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns, here

if TYPE_CHECKING:
    from serial.tools.list_ports_common import ListPortInfo

DEFAULT_PORT = "COM1" if os.name == "nt" else "/dev/ttyUSB0"  # listed if the port has no name
BUFFER = 4096  # bytes that wait for the line before a write blocks, as in the drivers of Linux


class Ports:
    """The one port of a virtual host. name: its name; None: any name."""

    def __init__(self, time: Turns, name: str | None = None) -> None:
        self.time = time
        self.name = name
        self.open: VirtualSerial | None = None
        self.line_free_ns = 0  # when everything written so far has gone over the line
        self.notes: list[str] = []  # notes for the end, one line each

    @property
    def shown(self) -> str:
        """Name under which it is listed."""
        return self.name or (self.open.port if self.open is not None and self.open.port else DEFAULT_PORT)

    def claim(self, port: VirtualSerial) -> None:
        """A host opens the port. Raises SerialException as pySerial does."""
        name = port.port or ""
        if self.name is not None and _plain(name) != _plain(self.name):
            reason = f"[Errno {errno.ENOENT}] No such file or directory: {name!r} (the twin is at {self.name!r})"
            raise SerialException(errno.ENOENT, f"could not open port {name}: {reason}")
        if self.open is not None:
            where = "" if _plain(self.open.port or "") == _plain(name) else f" (the twin is open as {self.open.port!r})"
            reason = f"[Errno {errno.EACCES}] Access is denied{where}"
            raise SerialException(errno.EACCES, f"could not open port {name!r}: {reason}")
        self.open = port

    def check_settings(self, port: VirtualSerial) -> None:
        """Make a note if the host's port settings differ from the line's. Stop bits do not matter."""
        line = self.time.twin.serial_format
        if (port.baudrate, port.bytesize, port.parity) != (line.baud, line.data_bits, line.parity):
            host = f"{port.baudrate} {port.bytesize}{port.parity}{port.stopbits:g}"
            where = f"the host's port is set to {host}, the controller's line has {line}"
            note = f"{where}; a real line would garble each byte, here it does not matter"
            if note not in self.notes:
                self.notes.append(note)

    def listed(self) -> list[ListPortInfo]:
        """What `serial.tools.list_ports.comports` returns."""
        from serial.tools.list_ports_common import ListPortInfo

        info = ListPortInfo(self.shown, skip_link_detection=True)
        info.description = info.manufacturer = info.hwid = "isel-twin"
        info.product = self.time.twin.controller_name
        return [info]


def _plain(name: str) -> str:
    """A normalised port name: COM names have no case, and may begin with \\\\.\\."""
    plain = name.removeprefix("\\\\.\\")
    return plain.upper() if plain.upper().startswith("COM") else plain


class VirtualSerial(NoModemLines):
    """pySerial's `Serial` on virtual time. In a thread that is not the host's a real one is made."""

    ports: Ports  # set on the subclass of each host (`stand_ins`)
    real: Any
    is_open: bool

    def __new__(cls, *args: Any, **kwargs: Any) -> Any:
        if here() is None:
            return cls.real(*args, **kwargs)
        return super().__new__(cls)

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._cancelled = False
        self._fd: int | None = None
        super().__init__(*args, **kwargs)

    @property
    def _time(self) -> Turns:
        return self.ports.time

    # opening

    def open(self) -> None:
        """Open the port. Raises SerialException if it has another name, or is open already (bridge/18)."""
        if self.is_open:
            raise SerialException("Port is already open.")
        if self._port is None:
            raise SerialException("Port must be configured before it can be used.")
        self.ports.claim(self)
        self.is_open = True
        self._time.fetch().clear()

    def close(self) -> None:
        """Close the port; a read in progress raises SerialException."""
        if self.is_open:
            self.is_open = False
            if self.ports.open is self:
                self.ports.open = None
            if self._fd is not None:
                os.close(self._fd)
                self._fd = None

    def _reconfigure_port(self) -> None:
        """No effect: settings are checked at the first write, as many hosts set them after opening."""

    @contextmanager
    def _waiting(self) -> Iterator[Turns]:
        """Guards a call that may wait: in a thread of the host, on a port that is open before and after."""
        self._check_open()
        time = here()
        if time is None:
            raise SerialException("this port belongs to a host in virtual time, and can be used by its threads only")
        yield time
        if not self.is_open:
            raise SerialException("the port was closed by another thread")

    # reading

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived and not been read."""
        with self._waiting() as time:
            time.look()
            return len(time.fetch())

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes: all of them, or those that came before the timeout (virtual seconds)."""
        with self._waiting() as time:
            inbox = time.fetch()
            if self._timeout == 0:
                time.look()
            elif len(inbox) < size:
                self._wait(time, size)
            data = bytes(inbox[:size]) if self.is_open else b""
            del inbox[: len(data)]
        return data

    def _wait(self, time: Turns, size: int) -> None:
        """Wait until `size` bytes are there, the timeouts are over, or another thread cancels or closes."""
        inbox = time.inbox
        why = f"read of {self._port}"
        self._cancelled = False
        end_ns = time.deadline(self._timeout)
        gap = self._inter_byte_timeout
        while True:
            had = len(inbox)
            limit_ns = end_ns
            if gap is not None and had:
                gap_ns = time.deadline(gap)
                limit_ns = gap_ns if end_ns is None or gap_ns is None else min(end_ns, gap_ns)
            wanted = size if gap is None else had + 1

            def enough(wanted: int = wanted) -> bool:
                return len(inbox) >= wanted or self._over

            if not time.wait(enough, limit_ns, why, hears=True) or self._over or len(inbox) >= size:
                return

    @property
    def _over(self) -> bool:
        return self._cancelled or not self.is_open

    def cancel_read(self) -> None:
        """Let a read of another thread return with its bytes."""
        self._cancelled = True

    def reset_input_buffer(self) -> None:
        """Drop what has arrived."""
        self._check_open()
        self._time.fetch().clear()

    # writing

    def write(self, data: Any, /) -> int:
        """Returns at once unless BUFFER bytes are waiting; raises SerialTimeoutException after write_timeout."""
        with self._waiting() as time:
            sent = to_bytes(data)
            self.ports.check_settings(self)
            byte_ns = self._byte_ns
            time.look()
            room_ns = self.ports.line_free_ns + (len(sent) - BUFFER) * byte_ns
            if room_ns > time.now_ns and self.out_waiting:
                end_ns = time.deadline(self._write_timeout)
                if end_ns is not None and end_ns < room_ns:
                    time.wait(None, end_ns, f"write to {self._port}")
                    raise SerialTimeoutException("Write timeout")
                time.wait(None, room_ns, f"write to {self._port}")
                self._check_open()
            time.send(sent)
            self.ports.line_free_ns = max(self.ports.line_free_ns, time.now_ns) + len(sent) * byte_ns
        return len(sent)

    def flush(self) -> None:
        """Wait until everything written has gone over the line."""
        with self._waiting() as time:
            if self.ports.line_free_ns > time.now_ns:
                time.wait(None, self.ports.line_free_ns, f"flush of {self._port}")

    @property
    def out_waiting(self) -> int:
        """Bytes written that are not over the line yet."""
        self._check_open()
        left_ns = self.ports.line_free_ns - self._time.now_ns
        return max(0, -(-left_ns // self._byte_ns)) if self._byte_ns else 0

    def cancel_write(self) -> None:
        """No effect: written bytes are already on the line."""

    def reset_output_buffer(self) -> None:
        """No effect: written bytes are already on the line."""
        self._check_open()

    @property
    def _byte_ns(self) -> int:
        twin = self._time.twin
        return twin.serial_format.byte_ns if twin.line_speed else 0

    # the rest of a serial port

    def fileno(self) -> int:
        """A number for `select.select`; nothing can be read from it."""
        self._check_open()
        if self._fd is None:
            self._fd = os.open(os.devnull, os.O_RDWR)
        return self._fd


def stand_ins(ports: Ports) -> list[tuple[Any, Any]]:
    """Pairs of pySerial's real functions and their stand-ins for these ports."""
    import serial
    from serial.tools import list_ports

    def for_url(_: Turns, url: str, *args: Any, do_not_open: bool = False, **kwargs: Any) -> VirtualSerial:
        port: VirtualSerial = made[0][1](None, *args, **kwargs)
        port.port = url
        if not do_not_open:
            port.open()
        return port

    made = [
        (real, type("Serial", (VirtualSerial,), {"ports": ports, "real": real, "__module__": "serial"}))
        for name in ("Serial", "PosixPollSerial", "VTIMESerial")
        if (real := getattr(serial, name, None)) is not None
    ]
    return [
        *made,
        (serial.serial_for_url, StandIn(serial.serial_for_url, for_url)),
        (list_ports.comports, StandIn(list_ports.comports, lambda _, include_links=False: ports.listed())),
    ]
