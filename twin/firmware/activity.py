"""Activities, which take time, and their requests.

An activity is a generator. It yields a request, is suspended while the request is carried out, and goes on with the
result. So a command reads from top to bottom:

    ended = yield Travel(path, law)      make these ticks              -> Ended: ticks made so far, ended by an event or
    not
    left = yield Pause(50_000_000)       let time pass                 -> None, or the ns left of it
    byte = yield Listen()                wait for a byte               -> the byte, or None

A stop sets the activity aside at its request. When it goes on, the result is incomplete: fewer ticks than requested,
time left, no byte. The activity may then request the rest:

    made = 0
    while made < path.ticks:
        ended = yield Travel(path, law(path.ticks - made), made)
        made = ended.ticks

It ends by returning, or early by an `Unfinished` exception. It must release what it holds in a `finally`, because an
activity that is broken off or forgotten is closed. `purpose` tells the firmware, in its own terms, what a request is
for (towards this switch, a rest before the next motion).
"""

from __future__ import annotations

from collections.abc import Generator
from typing import Any, NamedTuple

from isel_twin.motion import StepPath, TimeLaw


class Unfinished(Exception):
    """An activity ended before its work was done. Firmwares derive their own."""


class Travel(NamedTuple):
    """Make the ticks first + 1 .. first + law.ticks of a path. Result: `Ended`."""

    path: StepPath
    law: TimeLaw
    first: int = 0
    purpose: object = None


class Ended(NamedTuple):
    """How a motion ended: number of the last tick made (including those before its first), and whether by an event."""

    ticks: int
    by_event: bool = False


class Pause(NamedTuple):
    """Let time pass. Result: None when it has passed, or the ns left when a stop came."""

    ns: int
    purpose: object = None


class Listen(NamedTuple):
    """Wait for one byte from the host. Result: its value, or None when a stop came."""

    purpose: object = None


Request = Travel | Pause | Listen
Activity = Generator[Request, Any, Any]
