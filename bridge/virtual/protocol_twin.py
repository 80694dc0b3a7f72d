"""pySerial's `twin://`: a whole twin in this process, on virtual time, behind `serial.Serial`'s interface.

    twin://CONTROLLER[?OPTION=VALUE[&OPTION=VALUE...]]

    CONTROLLER   imc-s8, ...; empty: the default controller
    machine      name of a machine, or path of a machine folder
    plant        mujoco | kinematic
    seed         whole number
    speed        max (default): time passes only while the host waits, as fast as it can be computed;
                 a number: that many times real time, with bytes at the line's baud rate
    scenario     path of a scenario file
    flash        path of a flash image, created if missing

    import isel_twin, serial                                   # the import registers the scheme
    port = serial.serial_for_url("twin://imc-s8?machine=4030&speed=max", timeout=5)
    port.write(b"@07\\r"); port.read()                          # b"0"
    port.twin                                                  # the Twin itself: position_mm, lost_steps, set_input ...

Time at speed max: `read` lets virtual time pass until it has its bytes or its timeout (virtual seconds) is over, as
does `flush`. A poll (`in_waiting`, or a read with timeout 0) that finds nothing costs 10 ms, so that time passes for a
polling host. Nothing else takes time. A read without timeout raises SerialException, where a real port would block for
ever, if nothing can happen without the host, or the controller has been idle for PATIENCE_NS.

One thread at a time, as time passes inside the calls: a call during that of another thread raises SerialException;
programs with a reading thread need `isel-twin serve`. The twin belongs to the port object: it stays the same after
closing and reopening; bytes that arrive while the port is closed are lost.
"""

from __future__ import annotations

import threading
import time
import urllib.parse
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Any

from serial.serialutil import SerialException, to_bytes

from isel_twin.bridge.serve.pacing import Pacer, parse_speed
from isel_twin.bridge.virtual.in_process import PATIENCE_NS, STRETCH_NS, NoModemLines
from isel_twin.core.flash import flash_file
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

POLL_NS = 10_000_000  # virtual time of a poll: 10 ms, as a polling host would sleep

OPTIONS = ("machine", "plant", "seed", "speed", "scenario", "flash")


def _seed(text: str) -> int:
    try:
        return int(text)
    except ValueError:
        raise ValueError(f"seed {text!r}: must be a whole number from 0") from None


_VALUES: Mapping[str, Callable[[str], Any]] = {"seed": _seed, "scenario": Path, "flash": Path}  # others stay text


def parse_url(url: str) -> dict[str, str]:
    """Options of a twin:// URL as given, `controller` among them if given. Raises SerialException."""
    parts = urllib.parse.urlsplit(url)
    if parts.scheme != "twin":
        raise SerialException(f"{url!r} does not begin with twin://")
    if parts.path.strip("/") or parts.fragment:
        raise SerialException(f"{url!r}: expected twin://CONTROLLER?option=value, found {parts.path}{parts.fragment!r}")
    options = {"controller": parts.netloc} if parts.netloc else {}
    try:
        pairs = urllib.parse.parse_qsl(parts.query, keep_blank_values=True, strict_parsing=bool(parts.query))
    except ValueError as error:
        raise SerialException(f"{url!r}: {error}") from None
    for option, value in pairs:
        if option not in OPTIONS:
            raise SerialException(f"{url!r}: unknown option {option!r}; there are {', '.join(OPTIONS)}")
        if option in options:
            raise SerialException(f"{url!r}: option {option!r} is given twice")
        if not value:
            raise SerialException(f"{url!r}: option {option!r} has no value")
        options[option] = value
    return options


class Serial(NoModemLines):
    """A serial port with a twin at its other end."""

    is_open: bool

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        self._twin: Twin | None = None
        self._url: str | None = None
        self._pacer = Pacer(None)
        self._buffer = bytearray()
        self._line_free_ns = 0
        self._inside = threading.RLock()
        super().__init__(*args, **kwargs)

    @classmethod
    def on(cls, twin: Twin, **settings: Any) -> Serial:
        """A port, open, with this twin at its other end, at speed max; settings as of a `serial.Serial`."""
        port = cls(None, **settings)
        port._port = port._url = port.name = f"twin://{twin.controller_name}"
        port._twin = twin
        port.open()
        return port

    @property
    def twin(self) -> Twin:
        """The twin at the other end. Raises SerialException before the port was opened."""
        if self._twin is None:
            raise SerialException("the port has not been opened yet, so there is no twin")
        return self._twin

    def open(self) -> None:
        """Power on a twin, or use the earlier one again. Raises SerialException."""
        with self._alone():
            if self.is_open:
                raise SerialException("Port is already open.")
            if self._port is None:
                raise SerialException("Port must be configured before it can be used.")
            if self._twin is None or self._port != self._url:
                self._power_on(self._port)
                self._url = self._port
            elif (keeper := flash_file(self._twin)) is not None:
                try:
                    keeper.hold()
                except OSError as error:
                    raise SerialException(f"{self._port}: {error.strerror}") from error
            self.is_open = True
            self.reset_input_buffer()

    def _power_on(self, url: str) -> None:
        options = parse_url(url)
        try:
            speed = parse_speed(options.pop("speed", "max"))
            values = {option: _VALUES.get(option, str)(text) for option, text in options.items()}
            twin = TwinSpec(**values, line_speed=speed is not None).build()
        except ValueError as error:
            raise SerialException(f"{url}: {error}") from error
        self._twin = twin
        self._pacer = Pacer(speed, twin.time_ns)

    def close(self) -> None:
        """Close the port; the twin stays for the next opening, but releases its flash file."""
        if self._twin is not None and (keeper := flash_file(self._twin)) is not None:
            keeper.release()
        self.is_open = False

    def _reconfigure_port(self) -> None:
        """Line settings are accepted without effect."""

    @contextmanager
    def _alone(self) -> Iterator[None]:
        """While a call is inside the twin, calls of other threads raise SerialException (bridge/3)."""
        if not self._inside.acquire(blocking=False):
            raise SerialException(
                "another thread is in a call of this twin:// port; use one thread, or connect to `isel-twin serve`"
            )
        try:
            yield
        finally:
            self._inside.release()

    @contextmanager
    def _in_use(self) -> Iterator[None]:
        self._check_open()
        with self._alone():
            yield

    # time

    def _pass(self, until_ns: int) -> None:
        """Let virtual time pass to until_ns (at a finite speed not before its time), or until a byte arrives."""
        twin = self.twin
        if self._pacer.speed is not None:
            time.sleep(self._pacer.until_s(until_ns))
        twin.run_until(until_ns, lambda: twin.reply_waiting)
        self._buffer += twin.read()

    def _catch_up(self) -> None:
        """Bring the twin to the present (finite speeds) and fetch what has arrived."""
        present = self._pacer.present_ns()
        self._buffer += self.twin.read()
        while present is not None and self.twin.time_ns < present:
            self._pass(present)

    def _look(self) -> None:
        """Fetch what has arrived; finding nothing takes POLL_NS."""
        self._catch_up()
        if not self._buffer and self._pacer.speed is None:
            self._pass(self.twin.time_ns + POLL_NS)

    # the serial port

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived and not been read."""
        with self._in_use():
            self._look()
            return len(self._buffer)

    def read(self, size: int = 1) -> bytes:
        """Up to `size` bytes: all of them, or those that came before the timeout (virtual seconds)."""
        with self._in_use():
            if self._timeout == 0:
                self._look()
            else:
                self._wait(size)
            data = bytes(self._buffer[:size])
            del self._buffer[:size]
            return data

    def _wait(self, size: int) -> None:
        """Let time pass until `size` bytes are there or the timeouts are over."""
        self._catch_up()
        twin = self.twin
        end_ns = None if self._timeout is None else twin.time_ns + round(self._timeout * 1e9)
        gap_ns = None if self._inter_byte_timeout is None else round(self._inter_byte_timeout * 1e9)
        came_ns = twin.time_ns
        busy_ns = twin.time_ns
        while (waiting := len(self._buffer)) < size:
            limits = [] if end_ns is None else [end_ns]
            if gap_ns is not None and waiting:
                limits.append(came_ns + gap_ns)
            if limits and twin.time_ns >= min(limits):
                return
            if not twin.idle:
                busy_ns = twin.time_ns
            elif end_ns is None and twin.time_ns - busy_ns >= PATIENCE_NS:
                raise SerialException(
                    f"read without timeout, but the controller has been idle for {PATIENCE_NS // 1_000_000_000} s: "
                    "no byte can come"
                )
            if (event := twin.next_event_ns) is not None:
                limits.append(event if self._pacer.speed is not None else twin.time_ns + STRETCH_NS)
            if not limits:
                raise SerialException("read without timeout, but the twin is waiting for the host: no byte can come")
            self._pass(min(limits))
            if len(self._buffer) > waiting:
                came_ns = twin.time_ns

    def write(self, data: Any, /) -> int:
        """Put bytes on the line; returns at once, like a port with room in its buffer."""
        with self._in_use():
            self._catch_up()
            sent = to_bytes(data)
            twin = self.twin
            twin.write(sent)
            if self._pacer.speed is not None:
                self._line_free_ns = max(self._line_free_ns, twin.time_ns) + len(sent) * self._byte_ns
            return len(sent)

    def flush(self) -> None:
        """Wait until everything written has gone over the line."""
        with self._in_use():
            while self.twin.time_ns < self._line_free_ns:
                self._pass(self._line_free_ns)

    @property
    def out_waiting(self) -> int:
        """Bytes written that are not over the line yet."""
        with self._in_use():
            self._catch_up()
            return max(0, -((self.twin.time_ns - self._line_free_ns) // self._byte_ns))

    def reset_input_buffer(self) -> None:
        """Drop what has arrived."""
        with self._in_use():
            self._catch_up()
            self._buffer.clear()

    def reset_output_buffer(self) -> None:
        """No effect: written bytes are already on the line."""
        self._check_open()

    @property
    def _byte_ns(self) -> int:
        return self.twin.serial_format.byte_ns
