"""Roles: what a language may offer beside `Language`. Whoever needs one asks `isel_twin.controller.offers` for it."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Protocol

from isel_twin.language.language import Language, MoveSettings


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


class RetimesJobs(Language, Protocol):
    """What a language offers beside `Language` if it can bring settings into a job that exists.

    Lines are those of a job file, as `Language.frame` takes them, without comments and without what is expected; a line
    with <...> in it is as it stands there. What the language does not understand of them stays as it is.
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


class LoadsPlc(Protocol):
    """What a language offers beside `Language` if its controller has a PLC."""

    def plc_lines(self, image: bytes) -> Sequence[str]:
        """Lines of a job that load this program and start it."""
