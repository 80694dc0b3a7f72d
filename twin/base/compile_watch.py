"""Who waits for the compiler is told so: when it begins, and how long it took."""

from __future__ import annotations

import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager

Tell = Callable[[str], None]

_WATCHES: list[_Watch] = []  # those who are told, the last first


def log_compiling(text: str) -> None:
    """A line on standard error."""
    print(f"isel-twin: {text}", file=sys.stderr, flush=True)


@contextmanager
def told_of_compiling(tell: Tell = log_compiling) -> Iterator[None]:
    """Report in a line of text when numba begins to compile in the block, and at the end how long it took; nothing if
    all is cached."""
    watch = _Watch(tell)
    _WATCHES.append(watch)
    try:
        yield
    finally:
        _WATCHES.remove(watch)
    if watch.spent_s > 0.0:
        tell(f"compiled in {watch.spent_s:.1f} s")


def compiling(begins: bool) -> None:
    """A compilation begins or ends: those who want to know are told."""
    for watch in _WATCHES:
        watch.take(begins)


class _Watch:
    """Times compilation (not loading); a compilation within another counts once."""

    def __init__(self, tell: Tell) -> None:
        self._tell = tell
        self._depth = 0
        self._began_s = 0.0
        self.spent_s = 0.0

    def take(self, begins: bool) -> None:
        if begins and self._depth == 0:
            if self.spent_s == 0.0:
                self._tell("compiling the physics (once per installation) ...")
            self._began_s = time.perf_counter()
        self._depth += 1 if begins else -1
        if not begins and self._depth == 0:
            self.spent_s += time.perf_counter() - self._began_s
