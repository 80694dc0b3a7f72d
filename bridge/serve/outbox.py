"""Replies on their way to a host or client that may be slow."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress

log = logging.getLogger("isel_twin")

# most bytes for a host that does not read; more is lost, as on a line without flow control (bridge/2)
OUTBOX_BYTES = 65_536


class Outbox:
    """Bounded, never blocking."""

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
        with suppress(BlockingIOError):
            while self._waiting:
                del self._waiting[: self._write(bytes(self._waiting))]
