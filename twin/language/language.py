"""What the bytes of a controller mean: the second border of a controller, for people and tools.

A controller (`isel_twin.controller`) takes bytes and gives bytes. Whoever writes a job file, reads a log or wants a
move made needs to know what they mean, and only the controller's `Language` does:

    "@07"  --- frame --->  bytes  --->  controller  --->  bytes  --- accepted --->  was that a refusal?
                             |                              |
                             '--------- messages -----------'---->  @07    set the axes X Y Z, initialise
                                                                    0      reply: done
    reference, move, break_off  --->  what a host would send for it
    job_moves, retimed, permanent  -->  roles.py: other settings for a job that exists, and for the controller

It is optional: the job files of a controller without one give every byte as a number. A language has no clock and never
sees a controller: it knows the bytes of both directions, in the order in which they went over the line.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

Ranges = Mapping[str, tuple[int, int]]  # lowest and highest value of each of the `MoveSettings`, by its name

# what `MoveSettings` can be, the widest of all controllers; `Language.ranges` is what one of them takes
SETTINGS_RANGES: Ranges = {
    "speed_hz": (30, 40_000),
    "acceleration_hz_per_ms": (1, 4000),
    "start_stop_hz": (20, 4000),
}


class LanguageError(ValueError):
    """A language cannot say this, or there is none; the message is one line that names the remedy."""


@dataclass(frozen=True)
class MoveSettings:
    """How fast a move is made. Raises ValueError for what no controller takes, see SETTINGS_RANGES."""

    speed_hz: int = 10_000  # step frequency of the leading axis, the one with the most steps
    acceleration_hz_per_ms: int = 100
    start_stop_hz: int = 300  # frequency at which ramps begin and end

    def __post_init__(self) -> None:
        for name, (low, high) in SETTINGS_RANGES.items():
            given = getattr(self, name)
            try:
                value = operator.index(given)  # numpy's integers become plain ones
            except TypeError:
                value = -1
            if not low <= value <= high:
                raise ValueError(f"{name} is {given!r}; it must be a whole number from {low} to {high}")
            object.__setattr__(self, name, value)


@dataclass(frozen=True)
class Message:
    """One message on the line: a command, a control byte, a reply."""

    data: bytes  # as it went over the line, its end included
    text: str  # readable: as in a job file, without the end that `Language.frame` adds
    explanation: str
    sent: bool  # by the host (True) or by the controller


class Language(Protocol):
    """The language of a controller.

    Only `messages` and `rest` keep something from call to call: whoever decodes a line needs an instance of its own
    (`create_language`), all other uses can share one.
    """

    @property
    def ranges(self) -> Ranges:
        """What the controller takes for each of the `MoveSettings`."""

    def frame(self, text: str) -> bytes:
        """A line of a job file as it is sent. Raises LanguageError for text that cannot be."""

    def text(self, reply: bytes) -> str:
        """A whole reply, as `Twin.query` and results of jobs give it."""

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """True if `reply`, all bytes that came for `sent`, refuses nothing, and is empty only if none was demanded."""

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        """Messages that are complete with these bytes of one direction; a message begun is kept until its end comes.

        Never raises, whatever the bytes are: the `data` of all messages of a direction, and its `rest`, are the bytes
        of that direction. All of `data` is taken in by the call itself, whether the messages are looked at or not.
        """

    def rest(self, sent: bool) -> bytes:
        """The bytes of the message begun in one direction."""

    def reference(self) -> Sequence[bytes]:
        """What a host sends to initialise and reference all axes, so that `move` can follow; each reply is awaited."""

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """What a host sends to put the settings in force and move straight to counter values, X Y Z.

        Each reply is awaited; the last one is that of the move. Raises LanguageError for a target or settings that
        cannot be said; the controller's own refusals are its replies.
        """

    def break_off(self) -> bytes:
        """What a host sends to end a motion with its stop ramp and forget the rest of it."""
