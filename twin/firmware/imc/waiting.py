"""Waiting lines, and lines that a stop holds back (imc/5, imc/18).

    received ----> waiting --first in first out--> carried out
                     |  ^
             stopped |  | the stopped motion goes on
                     v  |
                     held -------> dropped, if the rest of the stopped motion is forgotten

A stop holds earlier lines; later ones are carried out at once. So nothing moves without a command after the stop, and
queries work. Memory is bounded: lines that do not fit are lost and counted.
"""

from __future__ import annotations

from collections import deque


class WaitingLines:
    def __init__(self, limit: int) -> None:
        """limit: bytes, line ends included, that may wait; twice as many may be held."""
        self._limit = limit
        self._waiting: deque[bytes] = deque()
        self.held: deque[bytes] = deque()
        """Lines that a stop holds."""
        self._waiting_bytes = 0
        self._held_bytes = 0
        self.lost = 0
        """Lines lost and not answered yet."""

    def __bool__(self) -> bool:
        """True if a line waits that is not held."""
        return bool(self._waiting or self.lost)

    def put(self, line: bytes) -> None:
        """Queue a line. Once one does not fit, it and all later ones are lost until the others have been taken."""
        size = len(line) + 1
        if self.lost or self._waiting_bytes + size > self._limit:
            self.lost += 1
        else:
            self._waiting.append(line)
            self._waiting_bytes += size

    def take(self) -> bytes | None:
        if not self._waiting:
            return None
        line = self._waiting.popleft()
        self._waiting_bytes -= len(line) + 1
        return line

    def hold(self) -> None:
        while (line := self.take()) is not None:
            size = len(line) + 1
            if self._held_bytes + size > 2 * self._limit:
                self.lost += 1
            else:
                self.held.append(line)
                self._held_bytes += size

    def release(self) -> None:
        """Queue the held lines again, before later ones."""
        self._waiting.extendleft(reversed(self.held))
        self._waiting_bytes += self._held_bytes
        self.held.clear()
        self._held_bytes = 0

    def drop_first_held(self) -> None:
        self._held_bytes -= len(self.held.popleft()) + 1
