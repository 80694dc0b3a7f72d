"""Job files as arguments of commands: read and checked, with errors that name the place."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cam.section import LineRange
from isel_twin.cli.options import Whole, is_standard_input, standard_input
from isel_twin.cli.outputs import say

if TYPE_CHECKING:
    from isel_twin.cam.settings import CamSettings
    from isel_twin.cam.toolpath import Caution, Point
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.job import Line
    from isel_twin.jobs.toolpaths import Reading, Source
    from isel_twin.machine import Machine

SettingsFile = Annotated[
    Path | None, Parameter(help="File of bounds; without it isel-twin.toml beside each job, or above.")
]


@Parameter(name="*")
@dataclass(frozen=True)
class JobTwin:
    """The twin that jobs are played on; None: as isel-twin.toml says, or by default."""

    machine: Annotated[str | None, Parameter(help="Name of a machine, or path of a machine folder.")] = None
    controller: Annotated[str | None, Parameter(help="Name of a controller.")] = None
    plant: Annotated[str | None, Parameter(help="mujoco or kinematic.")] = None


AS_THE_FILE_SAYS = JobTwin()


@Parameter(name="*")
@dataclass(frozen=True)
class PartOptions:
    """The lines of a file of a CAM program that are made."""

    from_line: Annotated[
        Whole | None, Parameter(help="Number of the line at which a CAM file is begun, with all that holds there.")
    ] = None
    to_line: Annotated[Whole | None, Parameter(help="Number of the last line made; the tool is lifted behind it.")] = (
        None
    )

    def lines(self) -> LineRange:
        """Raises CallError."""
        try:
            return LineRange(1 if self.from_line is None else self.from_line, self.to_line)
        except ValueError as error:
            raise CallError(str(error), option=True) from None


DEFAULT_PART = PartOptions()
JOB_BYTES = 1 << 24  # longest job file: 16 MiB, some four hundred thousand moves
PROGRAM_BYTES = 1 << 30  # longest file for a controller that runs programs


def job_name(job: Path) -> str:
    return "standard input" if is_standard_input(job) else str(job)


def check_file(job: Path) -> None:
    """Raise CallError for a pipe: only `run` reads a job once and keeps nothing beside it; and for a dangling link."""
    with call_errors(job):
        if job.is_symlink() and not job.exists():
            raise CallError(f"{job}: is a link to {job.readlink()}, which is not there")
        if job.is_fifo():
            raise CallError(f"{job}: is a pipe, which can be read only once; save it to a file")


def read_job(job: Path, call: TwinSpec) -> Sequence[Line]:
    """The lines of a job file, or of standard input, for the controller of a call. Raises CallError."""
    return read_source(job, call)[0]


def read_source(job: Path, call: TwinSpec, reading: Reading | None = None) -> tuple[Sequence[Line], Source | None]:
    """The same, and what the file was if it is one of a CAM program."""
    from isel_twin.controller import offers
    from isel_twin.jobs.toolpaths import AS_IT_LOOKS, lines_of, source_of
    from isel_twin.language import RunsPrograms, create_language

    with call_errors(job_name(job)):
        language = create_language(call.controller)
        most = PROGRAM_BYTES if offers(language, RunsPrograms) else JOB_BYTES
        data = _read(job, most)
        if len(data) > most:
            raise CallError(f"{job_name(job)}: is longer than {most >> 20} MiB; cut it into several")
        settings = cam_settings(job, call)
        with _told(job):
            source = source_of(
                data, job.suffix, language, call.controller, lambda: _machine(call), settings, reading or AS_IT_LOOKS
            )
            lines = lines_of(source, data, language, call.controller)
    if not lines:
        raise CallError(f"{job_name(job)}: there is no command in it")
    return lines, source


def say_zero(job: Path, reading: Reading, zero: Point | None) -> None:
    """Tell on standard error which zero of the work was chosen, or that the file has none (None)."""
    from isel_twin.cam.fitting import in_words

    if zero is None and reading.zero is not None:
        say(f"{job_name(job)}: is a job of commands, which no zero moves")
    elif zero is not None and zero != reading.zero:
        say(f"{job_name(job)}: fits with the zero of the work at {in_words(zero)}")


def say_cautions(job: Path, cautions: Iterable[Caution]) -> None:
    """Tell what a file may mean otherwise, on standard error."""
    for caution in cautions:
        say(f"{job}: caution: {caution}")


def _machine(call: TwinSpec) -> Machine:
    """Raises CallError, which names the machine's own file."""
    with call_errors():
        return call.fitted()


def cam_settings(job: Path, call: TwinSpec) -> CamSettings:
    """Settings of a file on this machine, by [cam] of the project and of the machine. Raises CallError."""
    from isel_twin.jobs import project

    file = None if is_standard_input(job) else project.find(job)
    with call_errors(file):
        return project.cam(file, call.as_built)


def clamped(call: TwinSpec, job: Path) -> TwinSpec:
    """The call with what the settings file of the job has on the table. Raises CallError."""
    from isel_twin.jobs import project

    if is_standard_input(job) or (file := project.find(job)) is None:
        return call
    with call_errors(file):
        return call.with_(fixtures=project.fixtures(file))


def _read(job: Path, most: int) -> bytes:
    """The file, or its first most + 1 bytes."""
    if is_standard_input(job):
        return standard_input().read(most + 1)
    with job.open("rb") as file:
        return file.read(most + 1)


def check_names(job: Path, lines: Sequence[Line], twin: Twin) -> None:
    """Raise CallError for a condition about something that this twin does not have."""
    from isel_twin.jobs.job import check_conditions

    with _told(job):
        check_conditions(lines, twin)


@contextmanager
def _told(job: Path) -> Iterator[None]:
    """Turn ValueError into CallError about the job."""
    try:
        yield
    except CallError:
        raise
    except ValueError as error:
        raise CallError(f"{job_name(job)}: {error}", excerpt=getattr(error, "excerpt", "")) from None
