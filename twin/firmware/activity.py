"""What takes time: activities, and what they may ask for.

An activity is a generator. It yields a request, is suspended while the request is carried out, and goes on with the
result. So what a command does reads from top to bottom:

    ended = yield Travel(path, law)      make these ticks              -> Ended: ticks made so far, by an event?
    left = yield Pause(50_000_000)       let time pass                 -> None, or the ns left of it
    byte = yield Listen()                wait for a byte               -> the byte, or None

A stop sets the activity aside wherever it is. When it goes on, it gets the second kind of result: fewer ticks than it
asked for, time left, no byte. What is left, the activity asks for again, or not.

    made = 0
    while made < path.ticks:
        ended = yield Travel(path, law(path.ticks - made), made)
        made = ended.ticks

It ends by returning, or early by an exception of the kind `Unfinished`. Whatever it holds it gives back in a `finally`:
an activity that is broken off or forgotten is closed. `purpose` is what a request is for, in the firmware's own terms
(towards this switch, a rest before the next motion); only the firmware looks at it.
"""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass
from typing import Any

from isel_twin.motion import StepPath, TimeLaw


class Unfinished(Exception):
    """An activity has ended before its work was done. Firmwares derive their own."""


@dataclass(frozen=True)
class Travel:
    """Make the ticks first + 1 .. first + law.ticks of a path. Result: `Ended`."""

    path: StepPath
    law: TimeLaw
    first: int = 0
    purpose: object = None


@dataclass(frozen=True)
class Ended:
    """How a motion has ended: number of the last tick made (those before its first included); by an event?"""

    ticks: int
    by_event: bool = False


@dataclass(frozen=True)
class Pause:
    """Let time pass. Result: None when it has passed, or how many ns were left when a stop came."""

    ns: int
    purpose: object = None


@dataclass(frozen=True)
class Listen:
    """Wait for one byte from the host. Result: its value, or None when a stop came."""

    purpose: object = None


Request = Travel | Pause | Listen
Activity = Generator[Request, Any, Any]
