"""Roles: what a language may offer beside `Language`. Whoever needs one asks `isel_twin.controller.offers` for it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from isel_twin.language.language import Language, MoveSettings


@dataclass(frozen=True)
class JobMove:
    """A line of a job that makes a motion with ramps, as the job stands."""

    line: int  # from 0
    # speeds in it that can be changed, also those that do not matter for this move; may be empty
    speeds_hz: tuple[int, ...]
    # of its ramps, as far as the lines tell: they do not show changed defaults of the controller
    acceleration_hz_per_ms: int
    start_stop_hz: int


class RetimesJobs(Language, Protocol):
    """Offered by a language that can bring other settings into a job (many/7).

    Lines are those of a job file, as `Language.frame` takes them, without comments and expected replies; <...> stands
    as in the file. A line that the language does not understand stays as it is.
    """

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


class RunsPrograms(Protocol):
    """Offered by a language of a controller that runs programs: a file can be one, and not a job."""

    def claims(self, text: str) -> bool:
        """True if the text can only be such a program: no other controller can be meant."""

    def job(self, text: str) -> Sequence[tuple[str, Iterable[bytes]]] | None:
        """What a host sends to run this program: names of steps, and the bytes of each in one piece or several.

        A piece is sent when the controller has taken the one before. Pieces may be generated anew for each iteration,
        as programs are long. None if the text is a job. Raises LanguageError.
        """

    def lines(self, text: str, names: Collection[str]) -> Mapping[str, int]:
        """Lines of the text, from 1, by the names of these steps (`Step.name`)."""

    def place(self, said: str) -> tuple[str, int]:
        """Name of the step that a remark of the controller is about, and column, from 1; "" and 0: none."""


class LoadsPlc(Protocol):
    """Offered by a language whose controller has a PLC."""

    def plc_lines(self, image: bytes) -> Sequence[str]:
        """Lines of a job that load this program and start it."""
