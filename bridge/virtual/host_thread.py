"""A thread of a host in virtual time, and why all of them are ended."""

from __future__ import annotations

import _thread
from collections.abc import Callable
from dataclasses import dataclass


class HostEnded(SystemExit):
    """Raised in all threads of a host that cannot go on. As a SystemExit, so that nothing is printed for it
    (bridge/19)."""


@dataclass(frozen=True)
class Ending:
    """Why a host was ended from outside."""

    kind: str  # `deadlock`, `timeout`, `refused`, `broken` (the twin) or `over`
    reason: str  # one line for people


class HostThread:
    """A thread of the host, as a task of its `Turns`."""

    def __init__(self, name: str, *, daemon: bool, ident: int | None = None) -> None:
        self.name = name
        self.daemon = daemon
        self.ident = ident
        self.turn = _thread.allocate_lock()  # this thread waits for it; released to give it its turn
        self.turn.acquire()
        self.ready: Callable[[], bool] | None = None  # its condition; None: it waits only for its time
        self.deadline_ns: int | None = None
        self.why = "start"
        self.hears = False  # it waits for bytes
        self.spun_ns = self.free_looks = self.strikes = 0
        self.ended = False
