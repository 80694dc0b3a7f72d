"""A job file while it is written: one text of it after the other, judged by the bounds of its project.

    text  ---\
              LiveJob ---> Report          as `isel-twin check` makes it, from the changed line on (incremental.py)
    files ---/        ---> Figures         of each line: time, margin, edge, reply
    isel-twin.toml, machine, scenario, golden run: looked at each time

What a machine's folder, a scenario and the settings file say is read again, and the job played from its beginning, when
one of them has changed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.crew import Stop
from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs import project
from isel_twin.jobs.checks import settings as demanded
from isel_twin.jobs.checks.contour import drawing
from isel_twin.jobs.checks.incremental import IncrementalCheck
from isel_twin.jobs.checks.job import Report, beside_golden
from isel_twin.jobs.checks.rules import of_cautions
from isel_twin.jobs.decode import DecodeError, Piece, explain, typed
from isel_twin.jobs.golden import golden_file
from isel_twin.jobs.job import JobError, Line
from isel_twin.jobs.result import Ends, Result, in_percent, least_band
from isel_twin.jobs.toolpaths import lines_of, source_of, times
from isel_twin.language import create_language

if TYPE_CHECKING:
    from isel_twin.cam.toolpath import Point
    from isel_twin.jobs.checks.settings import Task

Stamp = tuple[str, int, int]  # path, time of its last change in ns, length in bytes


@dataclass(frozen=True)
class Figures:
    """What is known of a line of the file when the job has been played."""

    seconds: float = 0.0
    margin: tuple[float, str] | None = None  # the least of all axes, and whose
    edge: tuple[float, str] | None = None  # the same of the factor until a motor swings
    replies: tuple[str, ...] = ()  # as a job's results show them
    margin_band: Ends | None = None  # of the margin

    def __str__(self) -> str:
        words = [f"{self.seconds:.3f} s"]
        if self.margin:
            words.append(f"{self.margin[1]} keeps {in_percent(self.margin[:1], [self.margin_band])} torque")
        words += [f"{self.edge[1]}: unstable above {self.edge[0]:.2f} times this speed"] if self.edge else []
        return ", ".join(words)


class LiveJob:
    """Judges the texts of a job file. Only for one thread at a time."""

    def __init__(self, job: Path, settings: Path | None = None, options: Mapping[str, Any] | None = None) -> None:
        """job: it need not exist. settings, options: as for `isel_twin.jobs.checks.settings.task`; without settings the
        file isel-twin.toml beside the job or above it."""
        self.job = job
        self.figures: Mapping[int, Figures] = {}  # by lines of the file, of the last report
        self._settings = settings
        self._options = options or {}
        self._asked: tuple[Path | None, tuple[Stamp, ...], Task] | None = None  # what the settings file said
        self._made: _Made | None = None
        self._lines: Sequence[Line] = ()
        self._converted = False  # the file is one of a CAM program
        self.zero: Point | None = None  # of the work, if the options ask for one, or for one that fits

    @property
    def played(self) -> int:
        """Lines that were played for the last report."""
        return 0 if self._made is None else self._made.check.played

    def stamps(self) -> tuple[Stamp, ...]:
        """What shows that another report is due, the job itself left out."""
        try:
            settings, task = self._task()
        except CallError:  # the settings file is wrong, or being written
            return tuple(stamp_of(self._settings or project.find(self.job)))
        return _stamps(settings, task, golden_file(self.job))

    def report(self, data: bytes, stop: Stop | None = None) -> Report:
        """The report on a text of the file. stop: called now and then; True: nobody waits for this report any more.

        Raises GivenUp then, JobError for what is wrong with the text, CallError for anything else.
        """
        settings, task = self._task()
        files = _stamps(settings, task, golden_file(self.job))
        made = self._made
        if made is None or (made.task, made.files) != (task, files):
            with call_errors(settings):
                made = self._made = _Made(task, files, settings)
        call = task.call
        language, controller = made.language, call.controller
        source = source_of(data, self.job.suffix, language, controller, lambda: made.machine, made.cam, task.reading)
        lines = lines_of(source, data, language, controller)
        if not lines:
            raise JobError("there is no command in it")
        drawn = None
        if source is not None:
            drawn = drawing(source.path(), made.cam, task.bounds.contour_mm)
        report = made.check.check(lines, stop, drawn, of_cautions(source)).without(
            "" if source is None else source.not_made
        )
        self._lines, self._converted = lines, source is not None
        self.zero = None if source is None else source.zero
        self.figures = figures(made.check.results)
        with call_errors(golden_file(self.job)):
            return beside_golden(report, self.job, call, source) if task.golden else report

    def explained(self, number: int, text: str) -> Iterator[str]:
        """What a line of the file means, a row for each command; text: the line as it stands there now."""
        if self._made is None or (language := create_language(self._made.task.call.controller)) is None:
            return
        if self._converted:
            pieces = [Piece(line.sent, True) for line in self._lines if line.number == number and not line.program]
        else:
            try:
                pieces = typed(text, True, language, self._made.task.call.controller)
            except DecodeError as error:
                yield str(error)
                return
        for row in explain(pieces, language):
            yield f"{row.text}: {row.explanation}" if row.explanation else row.text

    def _task(self) -> tuple[Path | None, Task]:
        settings = self._settings or project.find(self.job)
        stamp = tuple(stamp_of(settings))
        if self._asked is None or (settings, stamp) != self._asked[:2]:
            with call_errors(settings):
                self._asked = settings, stamp, demanded.task(self.job, settings, self._options)
        return settings, self._asked[2]


class _Made:
    """All that follows from what the project says, and does not change with the text."""

    def __init__(self, task: Task, files: tuple[Stamp, ...], settings: Path | None) -> None:
        self.task, self.files = task, files
        self.machine = task.call.fitted()
        self.cam = project.cam(settings, task.call.as_built)
        self.language = create_language(task.call.controller)
        golden = task.golden and golden_file(task.job).is_file()
        self.check = IncrementalCheck(task.job, task.call, task.bounds, golden=golden)
        demanded.check_switches(task.bounds, self.machine)


def _stamps(settings: Path | None, task: Task, *more: Path) -> tuple[Stamp, ...]:
    folder = Path(task.call.machine) if isinstance(task.call.machine, str | Path) else Path()
    own = sorted(folder.rglob("*")) if task.call.machine and folder.is_dir() else []
    return tuple(stamp for path in (settings, task.call.scenario, *own, *more) for stamp in stamp_of(path))


def stamp_of(path: Path | None) -> Iterator[Stamp]:
    """One for a file that is there, none for any other."""
    try:
        if path is not None:
            seen = path.stat()
            yield str(path), seen.st_mtime_ns, seen.st_size
    except OSError:
        return


def figures(results: Sequence[Result]) -> dict[int, Figures]:
    """Of each line of the file; a line may have become several commands, or be a block of a program."""
    found: dict[int, Figures] = {}
    for number, begin_ns, end_ns in times(results):
        before = found.get(number, Figures())
        found[number] = replace(before, seconds=before.seconds + (end_ns - begin_ns) / SECOND_NS)
    for result in results:
        if result.number in found and not result.parts:
            before = found[result.number]
            found[result.number] = Figures(
                before.seconds,
                _less(before.margin, result.margin),
                _less(before.edge, result.edge),
                (*before.replies, *filter(None, [result.shown_reply])),
                least_band([before.margin_band, *result.margin_band]),
            )
    return found


def _less(before: tuple[float, str] | None, now: Sequence[float | None]) -> tuple[float, str] | None:
    values = [(value, name) for name, value in zip(AXIS_NAMES, now, strict=False) if value is not None]
    return min([*values, *([before] if before else [])], default=None)
