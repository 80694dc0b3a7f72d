"""Files of CAM programs as jobs: read, written as the commands of a controller, each with its line in the user's file.

    part.ncp --- reader ---> toolpath --- language (WritesToolpaths) ---> text of a job, or of a program
                                                                           |  parse_job
                                                                           v
                                              Line, Line, ...   number: line of part.ncp

A file is known by its content, not by its name (isel_twin.cam.registry). One with a command of a controller, or that
begins with a remark (# ...), is a job whatever else is in it, and so is a program of the controller itself (jobs/3).
"""

from __future__ import annotations

import io
from collections import defaultdict
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import TYPE_CHECKING, Literal

from isel_twin.base.units import SECOND_NS
from isel_twin.cam.course import TravelError
from isel_twin.cam.estimate import Estimate
from isel_twin.cam.fitting import FIT, Read, advised, fitted, remarked, with_zero
from isel_twin.cam.reader import Reader, head_of, statements, text_lines
from isel_twin.cam.registry import reader_for, reader_named
from isel_twin.cam.section import WHOLE, LineRange, Section
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, Caution, Element, End, Point, Toolpath
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.controller import offers
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.jobs.foreign import check_controller
from isel_twin.jobs.job import JobError, Line, decode_job, parse_job
from isel_twin.jobs.result import Result
from isel_twin.language import Language, RunsPrograms, WritesToolpaths, programs_for

if TYPE_CHECKING:
    from isel_twin.machine import Machine


_NO_PART = (
    "only a file of a CAM program can be made in part, as what holds at a line is known of no other: leave from-line "
    "and to-line out, or save the lines as a file of their own, behind those that reference the machine and set what "
    "holds"
)


@dataclass(frozen=True)
class Source:
    """A file of a CAM program, and what it says that it takes."""

    title: str  # of its format
    text: str  # the job or program that it became
    lines: tuple[Line, ...]
    cautions: tuple[Caution, ...] = ()
    seconds: float = 0.0  # ways at their feeds, without ramps
    of_lines_s: Mapping[int, float] = field(default_factory=dict)  # the same of each line of the file
    path: Callable[[], Toolpath] = field(default=lambda: iter(()), repr=False)  # reads the file once more
    not_made: str = ""  # lines of the file that are left out, as a part was asked for
    zero: Point | None = None  # of the work, if the call has asked for one, or for one that fits
    spindle_off: int = 0  # line that is left out, and has switched the spindle off


@dataclass(frozen=True)
class Reading:
    """Options of a call for files of CAM programs, whatever they look like and their settings say."""

    form: str | None = None  # the format
    zero: Point | Literal["fit"] | None = None  # of the work; "fit": one with which the file is within the travel
    part: LineRange = WHOLE  # of its lines

    def taken(self, read: Read, axes: MachineAxes, settings: CamSettings) -> tuple[Read, CamSettings]:
        """The settings with the zero asked for, and the file, which says a chosen one. Raises JobError if none fits."""
        if self.zero is None:
            return read, settings
        if self.zero != FIT:
            return read, with_zero(settings, self.zero)
        try:
            chosen = fitted(read, axes, settings)
        except CamError as error:
            raise JobError(str(error)) from None
        return lambda settings: remarked(read(settings), settings), chosen


AS_IT_LOOKS = Reading()


def machine_axes(machine: Machine) -> MachineAxes:
    """Axes as a writer of toolpaths has them; the counters are 0 at the end of the reference run and grow from there
    (imc/8, ismif/8, gmi99/17).

    machine: as the controller changes it (`TwinSpec.fitted`). How far behind its switch an axis comes to its zero is
    the controller's: the last millimetres of the travel may be beyond the far switch.
    """
    x, y, z = machine.axes
    spindle = machine.spindle
    fixed = spindle is not None and spindle.speed_from == "fixed"
    servos = [(axis, axis.stage) for axis in (x, y, z) if isinstance(axis.stage, ServoDrive)]
    return MachineAxes(
        steps_mm=(1.0 / x.step_mm, 1.0 / y.step_mm, 1.0 / z.step_mm),
        travel_mm=((0.0, x.travel_mm), (0.0, y.travel_mm), (0.0, z.travel_mm)),
        speed_along_path=bool(machine.controller.get("path_speed", False)),
        lag_s=max((abs(drive.lag_s) for _, drive in servos), default=0.0),
        held_mm=max((axis.held_mm for axis, _ in servos), default=0.0),
        reset_s=max((drive.reset_s for _, drive in servos), default=1.0),
        spindle_max_rpm=0.0 if spindle is None or fixed else spindle.max_rev_min,
        spindle_fixed_rpm=spindle.max_rev_min if spindle is not None and fixed else 0.0,
    )


def lines_of(source: Source | None, data: bytes, language: Language | None, controller: str) -> Sequence[Line]:
    """The lines of a file: of what `source_of` has made of it, or of a job as it is. Raises JobError."""
    return parse_job(own_text(data, language, controller), language, controller) if source is None else source.lines


def own_text(data: bytes, language: Language | None, controller: str) -> str:
    """The text of a job of this controller. Raises JobError for that of another."""
    text = decode_job(data)
    check_controller(text, language, controller)
    return text


def source_of(
    data: bytes,
    suffix: str,
    language: Language | None,
    controller: str,
    machine: Callable[[], Machine],
    settings: CamSettings,
    reading: Reading = AS_IT_LOOKS,
) -> Source | None:
    """A file of a CAM program as a job; None for anything else. machine: asked for such a file only. Raises
    JobError, also for a part of anything else (cam/42)."""
    named = reading.form or settings.format or None
    try:
        reader = reader_of(data, suffix, language, named)
    except ValueError as error:
        raise JobError(str(error)) from None
    if reader is not None:
        try:
            return converted(data, reader, language, controller, machine_axes(machine()), settings, reading)
        except JobError:
            if named is not None or not _is_program(head_of(data), language):
                raise
    if reading.part != WHOLE:
        raise JobError(_NO_PART)
    return None


def _is_program(head: str, language: Language | None) -> bool:
    """May a text that looks like G-code be a program of this controller, or can it only be one of another?"""
    if not offers(language, RunsPrograms):
        return bool(programs_for(head))
    return any(language.claims(line) for line in statements(head))


def reader_of(data: bytes, suffix: str, language: Language | None, named: str | None = None) -> Reader | None:
    """The reader of a file; None for jobs, for programs of this controller, and for a controller that cannot be written
    for. named: a format whatever it looks like. Raises ValueError for a format that is not installed."""
    if named is not None:
        return reader_named(named)
    if not offers(language, WritesToolpaths):
        return None
    head = head_of(data)
    if offers(language, RunsPrograms) and language.claims(head):
        return None
    return reader_for(head, suffix)


def written(
    read: Read, watched: Watched, language: Language | None, controller: str, axes: MachineAxes
) -> Iterator[Written]:
    """The lines of a job of the file that is read. Raises JobError for what cannot be made, with its place, and for a
    controller that cannot be written for."""
    settings = watched.settings
    if not offers(language, WritesToolpaths):
        raise JobError(f"the language of {controller} cannot write toolpaths; name another controller")
    try:
        yield from language.written(watched.through(read(settings)), axes, settings)
    except TravelError as error:
        beyond = advised(error, read, axes, settings)
        raise JobError(str(beyond)) from beyond
    except CamError as error:
        raise JobError(str(error)) from None


def converted(
    data: bytes,
    reader: Reader,
    language: Language | None,
    controller: str,
    axes: MachineAxes,
    settings: CamSettings,
    reading: Reading = AS_IT_LOOKS,
) -> Source:
    """A file, or a part of it, as a job. Raises JobError for anything in it that cannot be made, with its place."""

    def read(settings: CamSettings) -> Toolpath:
        return reader.read(text_lines(io.BytesIO(data)), settings)

    taken, settings = reading.taken(read, axes, settings)
    watched = Watched(settings, reading.part)
    made = list(written(taken, watched, language, controller, axes))
    places = _places(made)
    text = "\n".join(one.text for one in made) + "\n"
    lines = []
    for line in parse_job(text, language, controller):
        if line.program:
            lines.append(replace(line, places=places))
        else:
            lines.append(replace(line, number=places[line.number - 1]))
    cautions = (*watched.cautions, *(one.caution for one in made if one.caution is not None))
    zero = None if reading.zero is None else settings.zero
    again = partial(_again, taken, settings, reading.part)
    section = watched.section
    told = watched.seconds, watched.of_lines_s, again, section.not_made, zero, section.spindle_off
    return Source(reader.title, text, tuple(lines), cautions, *told)


def _again(read: Read, settings: CamSettings, part: LineRange) -> Toolpath:
    return Section(part, settings).made(read(settings))


def _places(made: Sequence[Written]) -> tuple[int, ...]:
    """The line in the user's file of each written one; of what no line asked for that before, or the first."""
    places, last = [], 1
    for one in made:
        last = one.place.line if one.place is not None else last
        places.append(last)
    return tuple(places)


class Watched:
    """Elements on their way from reader to writer, with the cautions of both: the lines that are made, times by line,
    unless they are not asked for, and a caution about a file that moves nothing."""

    def __init__(self, settings: CamSettings, part: LineRange = WHOLE, by_line: bool = True) -> None:
        self.settings = settings
        self.section = Section(part, settings)
        self._sums = Estimate(settings)
        self._by_line = by_line
        self.cautions: list[Caution] = []
        self.of_lines_s: dict[int, float] = defaultdict(float)

    @property
    def seconds(self) -> float:
        return self._sums.seconds

    def through(self, path: Toolpath) -> Iterator[Element]:
        before = 0.0
        for element in self._sums.watched(self.section.made(path)):
            if isinstance(element, End) and not before:
                self.cautions.append(Caution(element.place, "nothing in this file moves the tool"))
            if self._sums.seconds > before:
                if self._by_line:
                    self.of_lines_s[element.place.line] += self._sums.seconds - before
                before = self._sums.seconds
            yield element


QUEUED_S = 0.001  # a command that takes less is only taken in: it is made with one behind it


def compared(source: Source, results: Sequence[Result]) -> str:
    """Compare what CAM would say that the job takes with what it has taken, and where the difference is, in a line."""
    told = f"{source.title}: {source.seconds:.1f} s by its feeds"
    groups = _groups(source, results)
    if not groups:
        return told
    told += f", {sum(made_s for _, made_s in groups.values()):.1f} s here"
    more = {lines: made_s - said_s for lines, (said_s, made_s) in groups.items()}
    surplus = sum(more.values())
    if surplus < 0.02 * source.seconds:
        return told
    worst = sorted(more, key=lambda lines: -more[lines])[:3]
    if sum(more[lines] for lines in worst) > 0.5 * surplus:
        great = [lines for lines in worst if more[lines] > 0.05 * surplus]
        return f"{told}: {', '.join(f'{_named(lines)} {more[lines]:+.1f} s' for lines in great)}"
    number = sum(last - first + 1 for first, last in groups)
    rest = ", from rest to rest" if all(first == last for first, last in groups) else ""
    return f"{told}: {1e3 * surplus / number:.0f} ms in each of {number} lines{rest}"


def _named(lines: tuple[int, int]) -> str:
    first, last = lines
    return f"line {first}" if first == last else f"lines {first} to {last}"


def _groups(source: Source, results: Sequence[Result]) -> dict[tuple[int, int], tuple[float, float]]:
    """Seconds by the feeds, and those taken, of lines of the file that are made together, by the first and the last."""
    taken: dict[int, float] = defaultdict(float)
    for number, begin_ns, end_ns in times(results):
        taken[number] += (end_ns - begin_ns) / SECOND_NS
    groups: dict[tuple[int, int], tuple[float, float]] = {}
    lines: list[int] = []
    said_s = made_s = 0.0
    for number in sorted(source.of_lines_s):
        if number not in taken:  # made with the command before it
            if groups:
                (first, _), (before_said_s, before_s) = groups.popitem()
                groups[first, number] = before_said_s + source.of_lines_s[number], before_s
            continue
        lines.append(number)
        said_s, made_s = said_s + source.of_lines_s[number], made_s + taken[number]
        if made_s >= QUEUED_S:
            groups[lines[0], number] = said_s, made_s
            lines, said_s, made_s = [], 0.0, 0.0
    return groups


def times(results: Sequence[Result]) -> Iterator[tuple[int, int, int]]:
    """Line of the file, begin and end of each command, or of each step of a program."""
    for result in results:
        steps = [(part.at[0], part.time_ns) for part in result.parts if part.at is not None and part.position_mm]
        if steps:
            ends_ns = [*(time_ns for _, time_ns in steps[1:]), result.end_ns]
            yield from ((line, begin_ns, end_ns) for (line, begin_ns), end_ns in zip(steps, ends_ns, strict=True))
        else:
            yield result.number, result.time_ns, result.end_ns
