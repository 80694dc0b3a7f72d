"""Roles: optional protocols beside `Language`; `isel_twin.controller.offers` tells whether a language has one."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Protocol

from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Toolpath
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.language.language import Language, MoveSettings


@dataclass(frozen=True)
class JobMove:
    """A line of a job that makes a motion with ramps."""

    line: int  # from 0
    speeds_hz: tuple[int, ...]  # speeds in it that can be changed, even without effect on this move; may be empty
    # of its ramps, by the lines alone, which do not show changed defaults of the controller
    acceleration_hz_per_ms: int
    start_stop_hz: int
    straight: bool = True  # one straight move: what it makes is the difference of the counters before and after it


class RetimesJobs(Language, Protocol):
    """A language that can change the settings in a job. Lines are those of a job file, as `Language.frame` takes them,
    without comments and expected replies, with <...> as in the file; of a program (`RunsPrograms`) the lines of its
    text. A line that it does not understand stays (many/7).
    """

    @property
    def defaults(self) -> Mapping[str, int]:
        """`acceleration_hz_per_ms` and, if it has one, `start_stop_hz` of a controller as it was delivered."""

    def job_moves(self, lines: Sequence[str]) -> Sequence[JobMove]:
        """The motions with ramps, in their order."""

    def retimed(
        self, lines: Sequence[str], settings: Mapping[int, MoveSettings], rapid_hz: int
    ) -> Sequence[Sequence[str]]:
        """The replacement of each line: one line or several, the last of which has its place.

        settings: for the lines of `job_moves`, or some of them; ramps are set for all of these. rapid_hz: speeds from
        here upwards are set; slower ones are feeds that a process needs, and stay.
        """

    def faster(self, lines: Sequence[str], factor: float) -> Sequence[str]:
        """The lines with all speeds of their straight moves times a factor, also beyond what the controller takes."""

    def permanent(self, settings: MoveSettings) -> Sequence[str]:
        """Lines that make acceleration and start-stop frequency the controller's own defaults, also after power-off;
        none if it forgets them."""


@dataclass(frozen=True)
class Example:
    """A job to begin with: a square of 40 mm from X 20, Y 20 mm on."""

    text: str
    suffix: str  # of its file
    machine: str  # of the package, on which it is well

    @classmethod
    def kept(cls, package: str, file: str, machine: str) -> Example:
        """From a file of a package."""
        return cls(files(package).joinpath(file).read_text(encoding="utf-8"), Path(file).suffix, machine)


class HasExample(Protocol):
    """A language with a job to begin with (`isel-twin init`)."""

    def example(self) -> Example:
        """The job, with comments for who sees such commands for the first time."""


class RunsPrograms(Protocol):
    """A language of a controller that runs programs: a file can be a program instead of a job."""

    def claims(self, text: str) -> bool:
        """True if the text can only be a program of this controller."""

    def job(self, text: str) -> Sequence[tuple[str, Iterable[bytes]]] | None:
        """What a host sends to run this program: names of steps, and the bytes of each in one piece or several.

        A piece is sent when the controller has taken the one before. Pieces may be made during iteration, as programs
        are long. None if the text is a job. Raises LanguageError.
        """

    def lines(self, text: str, names: Collection[str]) -> Mapping[str, int]:
        """Lines of the text, from 1, by the names of these steps (`Step.name`)."""

    def place(self, said: str, step: str) -> tuple[str, int]:
        """Name of the step that a remark of the controller names, and column, from 1; "" and 0: none."""


class KnowsCommands(Protocol):
    """A language that tells its commands from those of others, so that a job for another controller is named."""

    def knows(self, line: str) -> bool:
        """Does a line of a job begin like a command of this controller? What follows may be wrong."""


class TakesSetPoints(Protocol):
    """A language in which another control sends set points row by row (`isel-twin fmu --interface steps`)."""

    unwatched: Mapping[str, Any]  # overrides of a twin whose control may be silent as long as it likes
    shortest_ns: int  # of a row
    longest_ns: int

    def begin_rows(self) -> Sequence[bytes]:
        """Switch power and stages on; rows that follow are led evenly."""

    def row(self, duration_ns: int, counters: Sequence[int]) -> bytes:
        """The counters at the end of the row."""


class LoadsPlc(Protocol):
    """A language whose controller has a PLC."""

    def plc_lines(self, image: bytes) -> Sequence[str]:
        """Lines of a job that load this program and start it."""


class WritesToolpaths(Protocol):
    """A language that can write what a file of a CAM program asks for."""

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        """Lines of a job, or of a program of the controller (`RunsPrograms`), that reference the machine and make this
        path. They are made while they are taken, as a path may have millions of elements.

        Raises CamError at the element that cannot be made, before the line that would make it.
        """


@dataclass(frozen=True)
class Act:
    """What a command makes the machine do."""

    # of a motion: speed of each axis in Hz, as far as the command says; empty for other motions; None: no motion
    speeds_hz: tuple[int, ...] | None = None
    references: int = 0  # axes whose reference points it finds, from wherever the machine stands: a mask
    stops: bool = False  # breaks a motion off


@dataclass(frozen=True)
class FlashSetting:
    """A number that the controller keeps without power."""

    command: str  # line of a job that sets it, with {} for the number
    low: int
    high: int
    usual: int  # of a controller as it was delivered
    unit: str
    of_references: bool = False  # shows in reference runs; otherwise in moves


class TellsCounters(Language, Protocol):
    """A language that can read counters out of replies."""

    def counters(self, sent: bytes, reply: bytes) -> tuple[Mapping[int, int], bytes] | None:
        """The counters in the reply to this command, by axis from 0, and what else the reply says, without anything
        that follows from counters; None if it tells none."""


class KnowsBeginnings(Protocol):
    """A language that tells hosts of its controller from other programs, by the first bytes of a connection."""

    @property
    def idle(self) -> bytes:
        """Bytes that a host may send before its first line or frame, and that do nothing there."""

    def begins(self, data: bytes) -> bool | None:
        """True if a host begins so: `data` is a whole line or frame of this language, and maybe more. False if none
        does, whatever follows. None if it is incomplete. `data` is not empty and does not begin with `idle` bytes."""


class HoldsMotion(Protocol):
    """A language whose controller can be told over the line to hold a motion and to go on with it."""

    def hold(self) -> bytes:
        """Stop what moves with its ramp, and keep the rest of it."""

    def held(self, reply: bytes) -> bool:
        """True if a reply, all bytes since the command, tells that a motion is held."""

    def go_on(self) -> bytes:
        """Make the rest of what is held."""

    def give_up(self) -> bytes:
        """Forget the rest of what is held."""


class TellsActs(TellsCounters, Protocol):
    """A language that can tell from the bytes of a session what the machine was made to do."""

    def act(self, sent: bytes) -> Act: ...

    @property
    def flash_settings(self) -> Mapping[str, FlashSetting]:
        """By name, what `flash_lines` can set."""

    def flash_lines(self, values: Mapping[str, int]) -> Sequence[str]:
        """Lines of a job that make these settings the controller's own, also after power-off; the others stay."""
