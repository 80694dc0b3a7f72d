"""Logging of a server: it never blocks, and repeated messages are counted.

A log that nobody reads must not stop the machine. Lines go into a bounded queue, and a thread writes them; when the
queue is full, lines are lost and counted.

    loop ---- line ----> queue (QUEUE_LINES) ---- thread ----> standard error, however slow

A repeated message is printed SHOWN times and then counted; at the end of the minute one line has the number:

    isel-twin: tcp: client 127.0.0.1:40116 connected
    isel-twin: tcp: client 127.0.0.1:40262 connected (17 times more in the last minute)
"""

from __future__ import annotations

import logging
import os
import threading
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import TextIO

from isel_twin.base.printable import shown

QUEUE_LINES = 1000  # lines kept for a slow reader
SHOWN = 3  # times that a message is printed within PERIOD_S before it is counted
PERIOD_S = 60.0  # over which repeated messages are counted
FAREWELL_S = 0.5  # wall time to write the rest at the end, so that a missing reader does not keep the server


@dataclass
class _Repeated:
    """A message within its minute."""

    until_s: float
    last: str
    times: int = 1


class PatientHandler(logging.Handler):
    """Writes log records to `stream` from a thread of its own.

    stream: a file descriptor, or a text stream. Its buffer is bypassed if it has a descriptor, as a thread that blocks
    with the buffer's lock would keep the interpreter from ending.
    count: whether to count messages with the same format string; a record with the attribute `each` is always printed.
    """

    def __init__(self, stream: int | TextIO, count: bool = True, period_s: float = PERIOD_S) -> None:
        super().__init__()
        self._stream, self._count, self._period_s = stream, count, period_s
        self._file = stream if isinstance(stream, int) else None
        with suppress(AttributeError, OSError, ValueError):  # a stream in memory has no descriptor
            self._file = stream.fileno()  # type: ignore[union-attr]
        self._queue: deque[bytes] = deque()
        self._lost = 0
        self._repeated: dict[str, _Repeated] = {}  # by text before its arguments
        self._changed = threading.Condition()
        self._closing = False
        self._thread = threading.Thread(target=self._write, name="log", daemon=True)
        self._thread.start()

    def emit(self, record: logging.LogRecord) -> None:
        try:
            line = self.format(record)
        except Exception:
            self.handleError(record)
            return
        with self._changed:
            if self._count and not getattr(record, "each", False) and self._is_repeated(str(record.msg), line):
                return
            self._put(line)

    def _is_repeated(self, key: str, line: str) -> bool:
        """True if the line is to be counted, not printed. The first of its kind begins a minute."""
        repeated = self._repeated.get(key)
        if repeated is None:
            self._repeated[key] = _Repeated(time.monotonic() + self._period_s, line)
            self._changed.notify()
            return False
        repeated.times += 1
        repeated.last = line
        return repeated.times > SHOWN

    def _put(self, line: str) -> None:
        if len(self._queue) >= QUEUE_LINES:
            self._lost += 1
            return
        if self._lost:
            self._queue.append(f"isel-twin: {self._lost} lines of this log are lost, nobody read them\n".encode())
            self._lost = 0
        self._queue.append(f"{shown(line)}\n".encode())
        self._changed.notify()

    def _tell_repeated(self, everything: bool = False) -> float | None:
        """Report the numbers of messages whose minute is over; return the seconds until the next one is."""
        now = time.monotonic()
        for key, repeated in list(self._repeated.items()):
            if everything or repeated.until_s <= now:
                del self._repeated[key]
                if (more := repeated.times - SHOWN) > 0:
                    self._put(f"{repeated.last} ({more} times more in the last minute)")
        return min((repeated.until_s - now for repeated in self._repeated.values()), default=None)

    def _write(self) -> None:
        while True:
            with self._changed:
                while not self._queue:
                    wait_s = self._tell_repeated()
                    if self._queue:
                        break
                    if self._closing:
                        return
                    self._changed.wait(wait_s)
                data = b"".join(self._queue)
                self._queue.clear()
            try:
                while data:
                    data = data[self._write_some(data) :]
            except BlockingIOError:  # the descriptor is non-blocking: try again a little later
                time.sleep(0.01)
                with self._changed:
                    self._queue.appendleft(data)
            except OSError:  # the reader has gone for good
                with self._changed:
                    self._closing = True
                return

    def _write_some(self, data: bytes) -> int:
        if self._file is not None:
            return os.write(self._file, data)
        assert not isinstance(self._stream, int)
        self._stream.write(data.decode())
        return len(data)

    def close(self) -> None:
        """Write the rest within FAREWELL_S."""
        with self._changed:
            self._tell_repeated(everything=True)
            self._closing = True
            self._changed.notify()
        if self._thread is not threading.current_thread():
            self._thread.join(FAREWELL_S)
        super().close()


@contextmanager
def log_to(stream: int | TextIO, count: bool = True) -> Iterator[None]:
    """While the block lasts, everything logged from INFO on goes to this stream (see `PatientHandler`)."""
    root = logging.getLogger()
    handler = PatientHandler(stream, count)
    handler.setFormatter(logging.Formatter("isel-twin: %(message)s"))
    level = root.level
    root.addHandler(handler)
    root.setLevel(logging.INFO)
    try:
        yield
    finally:
        root.removeHandler(handler)
        root.setLevel(level)
        with suppress(OSError):
            handler.close()
