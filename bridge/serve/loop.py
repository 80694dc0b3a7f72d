"""Sleep of the loops of this folder: until a file is ready, a wake-up, or a timeout.

watches of endpoints and guests --.
Wake.watch -----------------------+-->  FileWatches.wait(watches, timeout_s)  -->  handlers of those that are ready
    ^                             |
    '-- threads, signals (woken_by_signals)
"""

from __future__ import annotations

import selectors
import signal
import socket
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any, NamedTuple


class FileWatch(NamedTuple):
    """A file to wait for: its `handler` is called when it is ready for `events` (of `selectors`).

    Another handler may have run before, so it must accept a file that is closed or no longer ready.
    """

    file: Any
    events: int
    handler: Callable[[], None]


class Wake:
    """Ends the sleep of a loop from a signal handler or another thread."""

    def __init__(self) -> None:
        self._in, self._out = socket.socketpair()
        self._in.setblocking(False)
        self._out.setblocking(False)
        self.watch = FileWatch(self._out, selectors.EVENT_READ, self._awake)  # one of the files to wait for

    def __call__(self) -> None:
        with suppress(OSError):  # already awake or closed
            self._in.send(b"\0")

    def fileno(self) -> int:
        """Descriptor to which the operating system writes a byte for each signal."""
        return self._in.fileno()

    def _awake(self) -> None:
        with suppress(BlockingIOError):
            self._out.recv(4096)

    def close(self) -> None:
        self._in.close()
        self._out.close()


@contextmanager
def woken_by_signals(wake: Wake) -> Iterator[None]:
    """While the block lasts each signal writes a byte to `wake`.

    Python only runs the handler in the main thread: a signal that another thread gets, or that comes just before the
    main thread falls asleep, would not end that sleep.
    """
    if threading.current_thread() is not threading.main_thread():  # signals go to the main thread
        yield
        return
    before = signal.set_wakeup_fd(wake.fileno(), warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(before)


@contextmanager
def on_signals(action: Callable[[], object]) -> Iterator[None]:
    """Call `action` at SIGINT, SIGTERM and SIGHUP (the terminal has gone; ignored under `nohup`) during the block."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)
    before = {number: signal.signal(number, lambda *_: action()) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


class FileWatches:
    """The files waited for now. Registers with the operating system only what has changed since the last time."""

    def __init__(self) -> None:
        self._selector = selectors.DefaultSelector()
        self._watches: list[FileWatch] = []
        self._files: dict[int, FileWatch] = {}

    def wait(self, watches: list[FileWatch], timeout_s: float | None) -> None:
        """Sleep until one of the files is ready, then call the handlers of those that are."""
        if watches != self._watches:
            self._change(watches)
        for key, _ in self._selector.select(timeout_s):
            self._files[key.fd].handler()

    def _change(self, watches: list[FileWatch]) -> None:
        now = {watch.file if isinstance(watch.file, int) else watch.file.fileno(): watch for watch in watches}
        for number, old in self._files.items():
            if (new := now.get(number)) is None or new.file is not old.file:
                self._selector.unregister(number)
            elif new.events != old.events:
                self._selector.modify(number, new.events)
        for number, watch in now.items():
            if number not in self._selector.get_map():
                self._selector.register(number, watch.events)
        self._watches, self._files = watches, now

    def close(self) -> None:
        self._selector.close()
