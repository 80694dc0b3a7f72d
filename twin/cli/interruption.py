"""Signals: a command ends early and keeps its results, or runs until it is told to stop."""

from __future__ import annotations

import signal
import sys
from collections.abc import Iterator
from contextlib import contextmanager


@contextmanager
def interruption(at_once: bool = False) -> Iterator[list[int]]:
    """A list that is empty until Ctrl-C or SIGTERM comes, and then holds its number; a second signal acts as usual.
    at_once: the signal ends the block where it is, and what follows the block is done."""
    stopped: list[int] = []

    def stop(number: int, _: object) -> None:
        restore()
        stopped.append(number)
        if at_once:
            raise KeyboardInterrupt

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    except KeyboardInterrupt:
        if not (at_once and stopped):
            raise
    finally:
        restore()


@contextmanager
def until_told() -> Iterator[None]:
    """Around all of a process that is ended by a signal: exit code 0, also if more of them come while it ends."""
    numbers = [signal.SIGINT, signal.SIGTERM]
    if hasattr(signal, "SIGHUP") and signal.getsignal(signal.SIGHUP) is not signal.SIG_IGN:
        numbers.append(signal.SIGHUP)

    def ignore() -> None:
        for number in numbers:
            signal.signal(number, signal.SIG_IGN)  # any other handler goes before the interpreter does

    def stop(*_: object) -> None:
        ignore()  # at once: it may be too late for the end of the block
        sys.exit(0)

    for number in numbers:
        signal.signal(number, stop)
    try:
        yield
    finally:
        ignore()
