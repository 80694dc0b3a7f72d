"""Signals of a host in virtual time: no handler interrupts the twin. A signal that comes while time passes, or during
the turn of another thread of the host, waits until the main thread continues.
"""

from __future__ import annotations

import signal
import threading
from collections.abc import Callable
from types import FrameType
from typing import Any

Handler = Callable[[int, FrameType | None], Any]


class Signals:
    """Waiting signals. at_work: True while none may be delivered."""

    def __init__(self, at_work: Callable[[], bool]) -> None:
        self._at_work = at_work
        self.handlers: dict[int, Any] = {}  # by number of the signal, handlers that were replaced
        self._come: list[tuple[Handler, int, FrameType | None]] = []

    def __bool__(self) -> bool:
        return bool(self._come)

    def deferred(self, handler: Handler) -> Callable[[int, FrameType | None], None]:
        """A signal handler that runs `handler` at once, or at the next `deliver` while `at_work`."""

        def heard(number: int, frame: FrameType | None) -> None:
            if self._at_work():
                self._come.append((handler, number, frame))
            else:
                handler(number, frame)

        heard.__wrapped__ = handler  # type: ignore[attr-defined]
        return heard

    def defer(self) -> None:
        """Defer the present handlers until `restore`."""
        if threading.current_thread() is threading.main_thread():
            for number in (signal.SIGINT, signal.SIGTERM):
                handler = signal.getsignal(number)
                if callable(handler):
                    self.handlers[number] = signal.signal(number, self.deferred(handler))

    def restore(self) -> None:
        """Restore every handler, including those that the host replaced, and raise again what none has handled."""
        for number, handler in reversed(self.handlers.items()):  # Ctrl-C, which may raise, comes last
            if handler is not None:  # None: installed by C code, cannot be restored
                signal.signal(number, handler)
        while self._come:
            signal.raise_signal(self._come.pop(0)[1])

    def deliver(self) -> None:
        while self._come:
            handler, number, frame = self._come.pop(0)
            handler(number, frame)
