"""What the bytes of a controller mean: the second border of a controller, for people and tools.

A controller (`isel_twin.controller`) takes bytes and gives bytes. Whoever writes a job file, reads a log or wants a
move made needs to know what they mean, and only the controller's `Language` does:

    "@07"  --- frame --->  bytes  --->  controller  --->  bytes  --- accepted --->  was that a refusal?
                             |                              |
                             '--------- messages -----------'---->  @07    set the axes X Y Z, initialise
                                                                    0      reply: done
    reference, move, break_off  --->  what a host would send for it
    job_moves, retimed, permanent  -->  `RetimesJobs`: other settings for a job that exists, and for the controller

It is optional. A controller without one runs like any other, and its job files give every byte as a number; nothing
here guesses how a line might end. A language has no clock and never sees a controller: it knows the bytes of both
directions, in the order in which they went over the line.

Third parties add a language by an entry point in the group `isel_twin.languages`, under the name of the controller; see
docs/controllers.md.
"""

from __future__ import annotations

import importlib.metadata
import operator
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from functools import partial
from typing import Protocol, runtime_checkable

from isel_twin.base.plugins import installed
from isel_twin.controller import PluginError, UnknownNameError, controller_names, plugin_errors

Ranges = Mapping[str, tuple[int, int]]
"""Lowest and highest value of each of the `MoveSettings`, by its name."""

SETTINGS_RANGES: Ranges = {
    "speed_hz": (30, 40_000),
    "acceleration_hz_per_ms": (1, 4000),
    "start_stop_hz": (20, 4000),
}
"""What `MoveSettings` can be, the widest of all controllers; `Language.ranges` is what one of them takes."""


class LanguageError(ValueError):
    """A language cannot say this, or there is none; the message is one line that names the remedy."""


@dataclass(frozen=True)
class MoveSettings:
    """How fast a move is made. Raises ValueError for what no controller takes, see SETTINGS_RANGES."""

    speed_hz: int = 10_000
    """Step frequency of the leading axis, the one with the most steps."""
    acceleration_hz_per_ms: int = 100
    """Of the ramps."""
    start_stop_hz: int = 300
    """Frequency at which ramps begin and end."""

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

    data: bytes
    """As it went over the line, its end included."""
    text: str
    """Readable: as in a job file, without the end that `Language.frame` adds."""
    explanation: str
    """A few plain words."""
    sent: bool
    """By the host (True) or by the controller."""


class Language(Protocol):
    """The language of a controller. Only `messages` and `rest` keep something from call to call.

    So whoever decodes a line takes an instance of its own (`create_language`); for the rest one will do for everybody.
    """

    @property
    def ranges(self) -> Ranges:
        """What the controller takes for each of the `MoveSettings`."""

    def frame(self, text: str) -> bytes:
        """A line of a job file as it is sent. Raises LanguageError for text that cannot be."""

    def text(self, reply: bytes) -> str:
        """A reply as `Twin.query` and results of jobs give it; nothing is left out."""

    def accepted(self, sent: bytes, reply: bytes) -> bool:
        """Whether `reply`, all bytes that came for `sent`, refuses nothing.

        An empty reply is accepted only if nothing that was sent demanded one.
        """

    def messages(self, data: bytes, sent: bool) -> Iterator[Message]:
        """Messages that are complete with these bytes of one direction; a message begun is kept until its end comes.

        Never raises, whatever the bytes are: the `data` of all messages of a direction, and its `rest`, are the bytes
        of that direction. All of `data` is taken in by the call itself, whether the messages are looked at or not.
        """

    def rest(self, sent: bool) -> bytes:
        """The message of one direction that has been begun and not ended."""

    def reference(self) -> Sequence[bytes]:
        """What a host sends to initialise and reference all axes, so that `move` can follow; each reply is awaited."""

    def move(self, target: Sequence[int], settings: MoveSettings) -> Sequence[bytes]:
        """What a host sends to put the settings in force and move straight to counter values, X Y Z.

        Each reply is awaited; the last one is that of the move. Raises LanguageError for a target or settings that
        cannot be said; the controller's own refusals are its replies.
        """

    def break_off(self) -> bytes:
        """What a host sends to end a motion with its stop ramp and forget the rest of it."""


@dataclass(frozen=True)
class JobMove:
    """A line of a job that makes a motion with ramps, as the job stands."""

    line: int
    """Which line, from 0."""
    speeds_hz: tuple[int, ...]
    """Speeds that stand in it and can be others, whether they matter for this way or not; none if there are none."""
    acceleration_hz_per_ms: int
    """Of its ramps, as far as the lines tell: a controller whose own defaults have been changed does not say so."""
    start_stop_hz: int


@runtime_checkable
class RetimesJobs(Protocol):
    """What a language offers beside `Language` if it can bring settings into a job that exists.

    Lines are those of a job file, as `Language.frame` takes them, without comments and without what is expected; a line
    with <...> in it is as it stands there. What the language does not understand of them stays as it is.
    """

    @property
    def ranges(self) -> Ranges:
        """See Language.ranges."""

    @property
    def defaults(self) -> Mapping[str, int]:
        """`acceleration_hz_per_ms` and `start_stop_hz` of a controller as it was delivered."""

    def job_moves(self, lines: Sequence[str]) -> Sequence[JobMove]:
        """The motions with ramps, in their order."""

    def retimed(
        self, lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int
    ) -> Sequence[Sequence[str]]:
        """What stands in place of each line: one line or several, of which the last has taken its place.

        settings: for the lines of `job_moves`, or some of them; ramps are set for all of these. rapid_hz: speeds from
        here upwards become the setting's; slower ones are feeds, which a process demands, and stay.
        """

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """Lines that make acceleration and start-stop frequency the controller's own defaults, also after power-off."""


LanguageFactory = Callable[[str], Language]
"""factory(name) -> a fresh Language, `name` being the entry point's and the controller's."""

_GROUP = "isel_twin.languages"


def language_names() -> list[str]:
    """Names of all controllers whose language is installed, sorted."""
    return sorted(entry.name for entry in installed(_GROUP))


def create_language(controller: str) -> Language | None:
    """A fresh language of the controller with this name, None if it has none.

    Raises UnknownNameError if no installed controller has that name either, PluginError if the language does not work.
    """
    return language_factory(controller)()


def language_factory(controller: str) -> Callable[[], Language | None]:
    """What makes a fresh language of the controller with this name, or None if it has none, again and again; it raises,
    and this does, as `create_language` does."""
    for entry in installed(_GROUP):
        if entry.name == controller:
            with plugin_errors("language", entry):
                factory: LanguageFactory = entry.load()
            return partial(_build, entry, factory)
    if controller not in (names := controller_names()):
        raise UnknownNameError(f"unknown controller {controller!r}; installed: {', '.join(names)}")
    return partial(_none, controller)


def programs_for(text: str) -> list[str]:
    """Names of the installed controllers that a text can only be a program of, sorted; see `RunsPrograms.claims`.

    A language that does not work claims nothing: whoever names its controller is told so.
    """
    found: list[str] = []
    for name in language_names():
        with suppress(PluginError):
            language = create_language(name)
            if isinstance(language, RunsPrograms) and language.claims(text):
                found.append(name)
    return found


def _build(entry: importlib.metadata.EntryPoint, factory: LanguageFactory) -> Language:
    with plugin_errors("language", entry):
        return factory(entry.name)


def _none(controller: str) -> None:
    """It has none."""


def needed(language: Language | None, controller: str) -> Language:
    """The language, for whoever cannot do without. Raises LanguageError if there is none."""
    if language is None:
        raise LanguageError(f"controller {controller!r} has no language: send its bytes as <13> or by write()")
    return language


# ---- for languages of text -------------------------------------------------------------------------------------------


def encoded(text: str) -> bytes:
    """One byte a character (Latin-1). Raises LanguageError for a character that has none."""
    try:
        return text.encode("latin-1")
    except UnicodeEncodeError as error:
        raise LanguageError(f"{text[error.start]!r} is not a character a serial line can carry") from None


_READABLE = tuple(chr(byte) if 32 <= byte < 127 and byte != ord("<") else f"<{byte}>" for byte in range(256))


def readable(data: bytes) -> str:
    """Bytes as a job file has them: printable ASCII as it is, any other byte as its number, <13>."""
    return "".join(map(_READABLE.__getitem__, data))


def integers(values: Sequence[int], count: int) -> list[int]:
    """`count` plain whole numbers, for a target. Raises LanguageError for anything else."""
    try:
        numbers = [operator.index(value) for value in values]
    except TypeError:
        numbers = []
    if len(numbers) != count:
        raise LanguageError(f"the target is {values!r}; give {count} whole numbers, the counters to move to")
    return numbers


@runtime_checkable
class RunsPrograms(Protocol):
    """What a language offers beside `Language` if a file can be a program of its controller, and not a job."""

    def claims(self, text: str) -> bool:
        """Whether a text can only be such a program: whoever gives it to another controller has named the wrong one."""

    def job(self, text: str) -> Sequence[tuple[str, Iterable[bytes]]] | None:
        """What is sent to run a text that is a program: what each step is called, and its bytes, in one piece or
        several, each sent when the controller has taken the one before. None: it is a job.

        The pieces can be made as they are asked for, again and again: programs are long. Raises LanguageError.
        """

    def lines(self, text: str, names: Collection[str]) -> Mapping[str, int]:
        """Line of such a text, from 1, of these steps, by the name that the controller gives them (`Step.name`)."""

    def place(self, said: str) -> tuple[str, int]:
        """The step that a remark of the controller is about, and the column there, from 1; "" and 0: none."""


@runtime_checkable
class LoadsPlc(Protocol):
    """What a language offers beside `Language` if its controller has a PLC."""

    def plc_lines(self, image: bytes) -> Sequence[str]:
        """Lines of a job that load this program and start it."""


class Pieces:
    """Cuts the bytes of one direction into pieces as they come.

    A piece ends with one of the bytes `ends`. A byte of `alone` is a piece by itself, wherever it stands, and cuts off
    what has come before it. So does a length of `longest` bytes, so that memory is bounded whatever comes.
    """

    def __init__(self, ends: bytes, alone: bytes = b"", longest: int = 4096) -> None:
        self._ends = ends
        self._alone = alone
        self._longest = longest
        self._rest = bytearray()

    @property
    def rest(self) -> bytes:
        """The piece begun."""
        return bytes(self._rest)

    def cut(self, data: bytes) -> list[bytes]:
        """The pieces that are whole with these bytes."""
        pieces = []
        for byte in data:
            if byte in self._alone and self._rest:
                pieces.append(self._take())
            self._rest.append(byte)
            if byte in self._ends or byte in self._alone or len(self._rest) >= self._longest:
                pieces.append(self._take())
        return pieces

    def _take(self) -> bytes:
        piece = bytes(self._rest)
        self._rest.clear()
        return piece
