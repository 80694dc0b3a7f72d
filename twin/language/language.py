"""What the bytes of a controller mean: the second border of a controller, for people and tools.

A controller (`isel_twin.controller`) takes bytes and returns bytes. Job files, logs and moves need their meaning, which
only the controller's `Language` knows:

    "@07"  --- frame --->  bytes  --->  controller  --->  bytes  --- accepted --->  was that a refusal?
                             |                              |
                             '--------- messages -----------'---->  @07    set the axes X Y Z, initialise
                                                                    0      reply: done
    reference, move, break_off  --->  what a host would send for it
    job_moves, retimed, permanent  -->  roles.py: other settings for a job that exists, and for the controller

It is optional: without one, job files give every byte as a number. A language has no clock and never sees a controller,
only the bytes of both directions in the order in which they went over the line.
"""

from __future__ import annotations

import operator
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

# lowest and highest of each of the `MoveSettings` that a controller has, by name: some have no start-stop frequency
Ranges = Mapping[str, tuple[int, int]]

# widest ranges of `MoveSettings` over all controllers; `Language.ranges`: those of one controller
SETTINGS_RANGES: Ranges = {
    "speed_hz": (30, 200_000),
    "acceleration_hz_per_ms": (1, 4000),
    "start_stop_hz": (20, 4000),
}


class LanguageError(ValueError):
    """A language cannot express this, or there is none; the message is one line with the remedy."""


@dataclass(frozen=True)
class MoveSettings:
    """How fast a move is made. Raises ValueError outside SETTINGS_RANGES."""

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


def check_ranges(settings: MoveSettings, ranges: Ranges) -> None:
    """Raise LanguageError for settings that a controller of these ranges cannot be told."""
    for name, (low, high) in ranges.items():
        if not low <= getattr(settings, name) <= high:
            raise LanguageError(f"{name} is {getattr(settings, name)}; the controller takes {low} to {high}")


@dataclass(frozen=True)
class Message:
    """One message on the line: a command, a control byte, a reply."""

    data: bytes  # as it went over the line, its end included
    text: str  # readable: as in a job file, without the end that `Language.frame` adds
    explanation: str
    sent: bool  # by the host (True) or by the controller


class Language(Protocol):
    """The language of a controller.

    Only `messages` and `rest` have state: decoding a line needs an instance of its own (`create_language`), all other
    uses can share one.
    """

    @property
    def ranges(self) -> Ranges:
        """Range of each of the `MoveSettings` that the controller takes."""

    def frame(self, text: str) -> bytes:
        """The bytes of a line of a job file. Raises LanguageError for text that cannot be sent."""

    def text(self, reply: bytes) -> str:
        """A whole reply as text, as `Twin.query` and results of jobs give it."""

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """True if `reply` (all bytes after `sent`) is no refusal and is not empty if a reply was due."""

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        """Messages completed by these bytes of one direction; an incomplete one is kept until its end comes.

        Never raises, whatever the bytes are: the `data` of all messages of a direction, and its `rest`, are the bytes
        of that direction. The call itself takes all of `data`, even if the iterator is not used.
        """

    def rest(self, sent: bool) -> bytes:
        """The bytes of the incomplete message of one direction."""

    def reference(self) -> Sequence[bytes]:
        """What a host sends to initialise and reference all axes before a `move`, waiting for each reply."""

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """What a host sends to apply the settings and move straight to counter values X Y Z, waiting for each reply,
        that of the move last. Raises LanguageError for a target or settings that cannot be expressed; a refusal by the
        controller is in its replies.
        """

    def break_off(self) -> bytes:
        """What a host sends to stop a motion with its ramp and discard the rest of it."""
