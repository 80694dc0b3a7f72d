"""A server that another program has started, and that must not outlive it.

The program keeps the writing end of a pipe, the server's standard input. However the program ends, also by `kill -9`,
the operating system closes that end, and the server stops as at a signal: recordings are finished.
"""

from __future__ import annotations

import os
import selectors
import stat
from collections.abc import Iterable

from isel_twin.bridge.serve.loop import FileWatch
from isel_twin.bridge.serve.server import Server


class Parent:
    """A guest of the server: stops it when the file ends. What the file says is dropped."""

    def __init__(self, file: int) -> None:
        """file: descriptor of a pipe or socket. Raises ValueError for anything else."""
        mode = os.fstat(file).st_mode
        if not (stat.S_ISFIFO(mode) or stat.S_ISSOCK(mode)):
            raise ValueError("standard input is no pipe: start it by a program that holds one")
        self._file = file

    def attach(self, server: Server) -> None:
        self._server = server

    def watches(self) -> Iterable[FileWatch]:
        yield FileWatch(self._file, selectors.EVENT_READ, self._read)

    def wait_s(self) -> float | None:
        return None

    def look(self) -> None:
        return

    def close(self) -> None:
        return

    def _read(self) -> None:
        if not os.read(self._file, 4096):
            self._server.stop()
