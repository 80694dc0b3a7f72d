"""What a command that takes time asks for: to be gone on with when a condition holds.

A handler of a normal command is a plain function, or a generator that yields Waits:

    def wait(card, instruction):
        yield Wait(at_ns=card.now_ns + 100_000_000)

It is gone on with when the time has come or the condition holds, whichever is first; conditions are looked at after
everything that happens. What it holds it gives back in a `finally`: a break-off closes it.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass


@dataclass(frozen=True)
class Wait:
    """Until a condition holds or a time has come, whichever is first."""

    until: Callable[[], bool] = lambda: False
    at_ns: int | None = None
