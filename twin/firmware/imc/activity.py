"""What takes time: activities, and what they ask of the executor.

An activity is a generator. It yields a request, is suspended while the request is carried out, and goes on with the
result. What it does reads from top to bottom, whatever may happen in between:

    ended = yield Travel(path, law)      make these steps; ended.ticks made, ended.by_event?
    yield Pause(50_000_000)                  let time pass
    char = yield Listen()                    wait for a byte from the host

The executor (executor.py) ends it early for a limit switch, a fault or a break; a stop (byte 253, stop key) parks it,
and a start resumes it with the number of ticks made so far. An activity ends by returning (reply `0`) or by Refusal.
"""

from __future__ import annotations

from collections.abc import Callable, Generator
from dataclasses import dataclass
from typing import Any

from isel_twin.motion import Path, TimeLaw


@dataclass(frozen=True)
class Travel:
    """Make the ticks first + 1 .. first + law.ticks of a path.

    until: condition on inputs that ends it with the stop ramp. reference: part of a reference run, which a stop breaks
    off instead of parking it. seek: axis whose limit switches, or the stop key, end it at once.
    """

    path: Path
    law: TimeLaw
    first: int = 0
    until: Callable[[], bool] | None = None
    reference: bool = False
    seek: int | None = None


@dataclass(frozen=True)
class Ended:
    """How a Travel ended: path ticks made so far (those before `first` included); by its condition or seek?"""

    ticks: int
    by_event: bool = False


@dataclass(frozen=True)
class Pause:
    """Let time pass. `reference`: part of a reference run, as in Travel; `stoppable`: a stop parks it here."""

    ns: int
    reference: bool = False
    stoppable: bool = False


@dataclass(frozen=True)
class Listen:
    """Wait for one byte from the host; its value is the result (None after a stop and a start: ask again)."""


Request = Travel | Pause | Listen
Activity = Generator[Request, Any, Any]
