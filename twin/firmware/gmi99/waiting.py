"""Waits of commands that take time.

A handler of a normal command is a plain function, or a generator that yields Waits:

    def wait(card, instruction):
        yield Wait(at_ns=card.now_ns + 100_000_000)

It continues when the time has come or the condition holds, whichever is first; conditions are checked after every
event. It must release what it holds in a `finally`: a break-off closes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Wait:
    """Until a condition holds or a time has come, whichever is first."""

    until: Callable[[], bool] = lambda: False
    at_ns: int | None = None
