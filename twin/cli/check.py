"""`isel-twin check`: jobs against their bounds, for the terminal and for CI."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Sequence
from contextlib import ExitStack
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.crew import in_order
from isel_twin.base.errors import CallError, call_errors
from isel_twin.cam.section import WHOLE
from isel_twin.cli import options
from isel_twin.cli.chosen import chosen, job_suffixes
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import (
    DEFAULT_PART,
    JobTwin,
    PartOptions,
    SettingsFile,
    cam_settings,
    check_file,
    check_names,
    read_source,
    say_zero,
)
from isel_twin.cli.options import Whole
from isel_twin.cli.outputs import many, put_off, say, tell
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.bridge.tap.real_job import RealReport
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.checks import Report
    from isel_twin.jobs.checks.formats import Told, Unread
    from isel_twin.jobs.checks.settings import Task

INTERVAL_NS = 10_000_000  # sampling interval of the pages


@Parameter(name="*")
@dataclass(frozen=True)
class Demands(JobTwin, options.CamOptions):
    """The twin that jobs are played on, and the bounds that they must keep."""

    seed: Annotated[
        Whole | None, Parameter(help="A number: seed of power-on positions, switch scatter and bounce.")
    ] = None
    scenario: Annotated[Path | None, Parameter(help="Events around the machine (TOML).")] = None
    set: options.Overrides = ()
    margin: Annotated[float | None, Parameter(help="Least pull-out margin of each motor, a share from 0 to 1.")] = None
    edge: Annotated[float | None, Parameter(help="Least factor on each speed until the motor swings, such as 1.2.")] = (
        None
    )
    deviation_mm: Annotated[float | None, Parameter(help="Most difference of counter and true position, mm.")] = None
    contour_mm: Annotated[
        float | None, Parameter(help="Most distance of the carriages from what a file of a CAM program cuts, mm.")
    ] = None
    cycle_s: Annotated[float | None, Parameter(help="Most time from first command to end of the last, s.")] = None
    clearance: Annotated[float | None, Parameter(help="Least distance of what must not meet, mm.")] = None
    spindle: Annotated[
        bool | None,
        Parameter(negative="no-spindle", help="The spindle turns in every cut; no: it is switched by hand."),
    ] = None
    rapid: Annotated[
        bool | None, Parameter(negative="no-rapid", help="No rapid and no change of a tool is in the stock.")
    ] = None
    may_strike: Annotated[str | None, Parameter(help="End switches that may be struck, with commas; all.")] = None
    robust: Annotated[
        Whole | None, Parameter(help="Number of other machines, as one can buy them, on which it is repeated.")
    ] = None
    uncertain: Annotated[
        Whole | None, Parameter(help="Number of machines that this one may be, as far as its numbers are known.")
    ] = None
    line: options.LineOptions = options.NO_LINE
    timeout: Annotated[float | None, Parameter(help="Virtual seconds a command may take.")] = None
    golden: Annotated[bool | None, Parameter(negative="no-golden", help="Compare with golden runs.")] = None
    strict: Annotated[
        bool | None, Parameter(negative="no-strict", help="Warnings make a job fail, too: cautions of a CAM file ...")
    ] = None

    def asked(self) -> dict[str, Any]:
        """The demands in the words of isel-twin.toml. Raises CallError for a wrong --set."""
        self.line.on(TwinSpec())
        asked = vars(self) | vars(self.line) | {"timeout_s": self.timeout, "reading": self.reading()}
        asked["set"] = options.parse_overrides(self.set) or None
        for name in ("timeout", "may_strike", "line", "form", "zero"):
            del asked[name]
        if self.may_strike is not None:
            asked["may_strike"] = tuple(name for name in self.may_strike.split(",") if name)
        return asked


DEFAULT_DEMANDS = Demands()


def check(
    *jobs: Annotated[
        Path, Parameter(help="Files of controller commands, one a line, programs, or folders. [check] jobs.")
    ],
    settings: SettingsFile = None,
    demands: Demands = DEFAULT_DEMANDS,
    part: PartOptions = DEFAULT_PART,
    workers: options.Workers = 1,
    junit: Annotated[Path | None, options.written("Write the findings as JUnit XML.", ".xml", bare=True)] = None,
    sarif: Annotated[
        Path | None, options.written("Write the findings as SARIF 2.1.0.", ".sarif", ".json", bare=True)
    ] = None,
    report: Annotated[Path | None, options.written("Folder for a page about each job (HTML).")] = None,
    json: Annotated[bool, Parameter(help="One line of JSON a job, or a judgement.")] = False,
    isel_port: Annotated[
        str | None, Parameter(help="Send the jobs to the real controller at this port: /dev/ttyUSB0, COM3, tcp://H:P.")
    ] = None,
    watch: Annotated[bool, Parameter(help="Judge the job again after each change of its file, until Ctrl-C.")] = False,
) -> int:
    """Play jobs and report what is wrong: refused commands, lost steps, struck switches, margins, tolerances, time.

    Bounds come from options, or from isel-twin.toml in the folder of a job or above it ([check], see docs/ci.md). All
    other rules always apply. A job with a golden run beside it is compared with it, a part of one is not. Of a folder
    all files below it are taken whose suffix a job has. Without a job: what [check] jobs of isel-twin.toml names.

    Each file is judged by itself; one that cannot be read is an error of that file. Exit code 0 if nothing is wrong, 1
    if something is, 2 if nothing can be judged or for a wrong call, 130 after Ctrl-C and 143 after SIGTERM: reports
    then hold what was judged, and name as errors the jobs that were not. In a workflow of GITHUB_ACTIONS the findings
    are also annotations. With --watch the code is that of the last verdict, and what comes before a changed line is not
    played again.

    With --isel-port the machine is a real one, and is moved by the jobs: replies and times are judged, what needs a
    look inside is named as not looked at. One file that cannot be read keeps all from it. Ctrl-C breaks the motion off.
    """
    asked = demands.asked()
    asked["reading"] = replace(asked["reading"], part=part.lines())
    _check_options(asked, workers)
    if isel_port is not None:
        inside = {"set": demands.set, "report": report, "watch": watch}
        _check_outside(asked, inside, workers)
        if not jobs:
            raise CallError("name the jobs that are to move the machine: isel-twin check JOB... --isel-port PORT")
        asked |= {"plant": "kinematic", "golden": False}  # of the twin that only knows names
    if settings is not None and not settings.is_file():
        raise CallError(f"{settings}: there is no such file")
    jobs = tuple(chosen(jobs, settings))
    _check_part(jobs, asked)
    if watch:
        if len(jobs) != 1 or options.is_standard_input(jobs[0]) or junit or sarif or report or workers != 1:
            raise CallError("watch: names one job, and goes without junit, sarif, report and workers", option=True)
        from isel_twin.cli.watch import watch as watch_job

        return watch_job(jobs[0], settings, asked, json)
    from isel_twin.jobs.checks.formats import Unread, as_annotations, as_json, as_words
    from isel_twin.jobs.checks.formats import junit as as_junit
    from isel_twin.jobs.checks.formats import sarif as as_sarif

    taken = _taken(jobs, settings, asked)
    tasks = [one for one in taken if not isinstance(one, Unread)]
    if isel_port is not None:  # a real machine is moved by all of them or by none
        _tell_unread(taken)
    pages = _pages(tasks, report)
    options.check_writable(junit, sarif, *pages, kept=(*jobs, settings, demands.scenario))
    reports: list[Told] = []
    crew = options.crew_of(min(workers, len(tasks)))
    every: Iterator[Told]
    every = _real(tasks, isel_port) if isel_port else in_order(perform, list(zip(tasks, pages, strict=True)), crew)
    with interruption(at_once=True) as stopped:
        for one in taken:
            if (made := one if isinstance(one, Unread) else next(every, None)) is None:
                break
            reports.append(made)
            if json or tasks:
                print(as_json(made) if json else as_words(made), flush=True)
    unjudged = [str(one.job) for one in taken[len(reports) :]]
    if stopped:
        judged = sum(not isinstance(made, Unread) for made in reports)
        say(f"interrupted: {judged} of {many(len(taken), 'job')} judged")
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in as_annotations(reports):
            print(line)
    if not json and tasks:
        print(_in_a_line(reports, unjudged))
    failures: list[CallError] = []
    for path, write in ((junit, as_junit), (sarif, as_sarif)):
        if path is not None:
            from isel_twin.base.files import atomic_write

            with put_off(failures, path):
                atomic_write(path, write(reports, unjudged).encode())
    tell(failures)
    if stopped:
        return 128 + stopped[0]
    if all(isinstance(made, Unread) for made in reports):
        _tell_unread(reports)
    return 0 if all(made.ok for made in reports) else 1


def _tell_unread(found: Sequence[object]) -> None:
    """Say of the files that cannot be read why, each reason once, and raise the last one as CallError."""
    from isel_twin.jobs.checks.formats import Unread

    tell([*{one.why: CallError(one.why, excerpt=one.excerpt) for one in found if isinstance(one, Unread)}.values()])


def _in_a_line(reports: Sequence[Told], unjudged: Sequence[str]) -> str:
    from isel_twin.jobs.checks.formats import Unread

    unread = sum(isinstance(made, Unread) for made in reports)
    numbers = {"failed": sum(not made.ok for made in reports) - unread, "not read": unread, "not judged": len(unjudged)}
    wrong = ", ".join(f"{number} {what}" for what, number in numbers.items() if number)
    well = "all well as far as looked at" if any(made.unseen for made in reports) else "all well"
    return f"{many(len(reports) + len(unjudged), 'job')}: {wrong or well}"


def _check_options(asked: dict[str, Any], workers: int) -> None:
    from isel_twin.jobs.robust import MOST_REPETITIONS
    from isel_twin.jobs.sending import MOST_EDGE
    from isel_twin.plant import MOST_CLEARANCE_MM

    for key, option in (("cycle_s", "cycle-s"), ("timeout_s", "timeout")):
        if asked[key] is not None:
            options.check_seconds(option, asked[key], 0.0)
    if asked["margin"] is not None and not 0.0 <= asked["margin"] <= 1.0:
        raise CallError(f"margin {asked['margin']:g}: must be from 0 to 1", option=True)
    if asked["edge"] is not None and not 0.0 < asked["edge"] <= MOST_EDGE:
        raise CallError(f"edge {asked['edge']:g}: must be a factor up to {MOST_EDGE:g}, such as 1.2", option=True)
    for key in ("deviation_mm", "contour_mm"):
        if asked[key] is not None and not asked[key] >= 0.0:
            raise CallError(f"{key.replace('_', '-')} {asked[key]:g}: must be a distance from 0", option=True)
    if asked["clearance"] is not None and not 0.0 <= asked["clearance"] <= MOST_CLEARANCE_MM:
        allowed = f"from 0 to {MOST_CLEARANCE_MM:g} mm"
        raise CallError(f"clearance {asked['clearance']:g}: must be a distance {allowed}", option=True)
    for key in ("robust", "uncertain"):
        if asked[key] is not None and not 0 <= asked[key] <= MOST_REPETITIONS:
            allowed = f"a number of repetitions up to {MOST_REPETITIONS}, such as 20"
            raise CallError(f"{key} {asked[key]}: must be {allowed}", option=True)
    options.check_workers(workers)


def _check_part(jobs: Sequence[Path], asked: dict[str, Any]) -> None:
    """Raise CallError for a part of several files, whose lines have the same numbers, or beside a golden run."""
    if asked["reading"].part == WHOLE:
        return
    if len(jobs) > 1:
        raise CallError(f"from-line, to-line: are lines of one file, not of {len(jobs)}; name one job", option=True)
    if asked["golden"]:
        raise CallError("golden: a golden run is one of the whole file; leave from-line and to-line out", option=True)


def _taken(jobs: Sequence[Path], settings: Path | None, asked: dict[str, Any]) -> list[Task | Unread]:
    """The jobs in their order, all read before the first begins. Raises CallError for a wrong call."""
    from isel_twin.jobs.checks.formats import Unread

    taken: list[Task | Unread] = []
    twins: dict[str, Twin] = {}
    for job in jobs:
        if str(job) == options.STANDARD_INPUT:
            raise CallError("-: bounds stand beside a job; name a file")
        try:
            taken.append(_task(job, settings, asked, twins))
        except CallError as error:
            if error.option:
                raise
            taken.append(Unread(str(job), str(error), error.excerpt))
    if asked["reading"].zero is not None and not any(isinstance(one, Unread) or one.reading.zero for one in taken):
        say("--zero moves nothing: all are jobs of commands")
    return taken


def _task(job: Path, settings: Path | None, asked: dict[str, Any], twins: dict[str, Twin]) -> Task:
    """twins: those built for the jobs before. Raises CallError."""
    from isel_twin.jobs import project
    from isel_twin.jobs.checks import settings as demanded
    from isel_twin.jobs.golden import golden_file, load

    check_file(job)
    if job.is_dir():
        with call_errors(job):
            os.listdir(job)
        raise CallError(f"{job}: there is no job file in this folder ({', '.join(sorted(job_suffixes()))})")
    with call_errors(job):
        found = settings if settings is not None else project.find(job)
        task = demanded.task(job, found, asked)
        lines, source = read_source(job, task.call, task.reading)
        if task.golden and (file := golden_file(job)).is_file():
            load(file)
        elif asked["golden"]:
            raise CallError(f"{file}: there is no golden run of {job}; isel-twin golden record {job} makes it")
    if (twin := twins.get(repr(task.call))) is None:
        twin = twins[repr(task.call)] = task.call.build()
    demanded.check_switches(task.bounds, twin.machine)
    check_names(task.job, lines, twin)
    if source is None:
        return replace(task, reading=replace(task.reading, zero=None))
    say_zero(job, task.reading, source.zero)
    return replace(task, reading=replace(task.reading, zero=source.zero))


def _check_outside(asked: dict[str, Any], others: dict[str, Any], workers: int) -> None:
    """Raise CallError for an option that only a twin can satisfy."""
    from isel_twin.jobs.checks.rules import RULES

    bounds = [rule.bound for rule in RULES.values() if rule.bound in asked and not rule.heard]
    names = ["plant", "seed", "scenario", "line_speed", "adapter_ms", *bounds]
    given = {name.replace("_", "-"): asked[name] for name in names} | others | {"workers": workers > 1 or None}
    for option, value in given.items():
        if value is not None and value is not False and value != ():
            raise CallError(
                f"{option}: needs the twin, of which isel-port has no use; leave one of them out", option=True
            )


def _real(tasks: Sequence[Task], port: str) -> Iterator[RealReport]:
    """The jobs one after the other at a real controller. Raises CallError if there is none."""
    from isel_twin.bridge.tap import real_job
    from isel_twin.bridge.tap.real_port import refusal
    from isel_twin.jobs.checks.rules import of_cautions
    from isel_twin.jobs.playing import TIMEOUT_S

    every = [read_source(task.job, task.call, task.reading) for task in tasks]
    for task, (lines, _) in zip(tasks, every, strict=True):
        if why := real_job.unfit(lines, task.call.controller):
            raise CallError(f"{task.job}: {why}")
    with interruption() as stopped:
        for task, (lines, source) in zip(tasks, every, strict=True):
            bounds, cautions = task.bounds, of_cautions(source) or ()
            if bounds.timeout_s == TIMEOUT_S:  # nobody asked for another one
                bounds = replace(bounds, timeout_s=real_job.TIMEOUT_S)
            form = task.call.build().serial_format
            try:
                real = real_job.RealController(port, task.call.controller, form)
            except (OSError, ValueError) as error:
                raise CallError(refusal(port, error)) from None
            try:
                made = real_job.check_real(
                    str(task.job), lines, task.call.controller, real, bounds, lambda: bool(stopped), cautions
                )
            except real_job.SilentError as error:
                raise CallError(str(error)) from None
            finally:
                real.close()
            if made.stopped:
                why = "interrupted" if stopped else "the job has ended early"
                print(
                    f"isel-twin: {why}: {made.stopped} was sent to {port}, which breaks a motion off", file=sys.stderr
                )
            yield replace(made, not_made="" if source is None else source.not_made)
            if stopped:
                return


def _pages(tasks: Sequence[Task], folder: Path | None) -> list[Path | None]:
    """A page for each task in the folder, which is created: NAME.html, then NAME-2.html and so on for jobs of one
    name."""
    if folder is None:
        return [None] * len(tasks)
    if folder.is_file():
        raise CallError(f"{folder}: is a file; name a folder for the pages")
    with call_errors(folder):
        folder.mkdir(parents=True, exist_ok=True)
    names: list[str] = []
    for task in tasks:
        name, number = task.job.stem, 1
        while name in names:
            number += 1
            name = f"{task.job.stem}-{number}"
        names.append(name)
    return [folder / f"{name}.html" for name in names]


def perform(asked: tuple[Task, Path | None]) -> Report | Unread:
    """Check one job, and write a page about it if asked; in this process or another. A file may have gone by now."""
    task, page = asked
    from isel_twin.jobs.checks.contour import drawing
    from isel_twin.jobs.checks.formats import Unread
    from isel_twin.jobs.checks.job import Inspection, beside_golden, check_job
    from isel_twin.jobs.checks.rules import of_cautions
    from isel_twin.jobs.golden import golden_file
    from isel_twin.recordings.recorder import Recorder

    try:
        lines, source = read_source(task.job, task.call, task.reading)
    except CallError as error:
        return Unread(str(task.job), str(error), error.excerpt)
    drawn = None
    if source is not None:
        made = cam_settings(task.job, task.call)
        drawn = drawing(source.path(), made, task.bounds.contour_mm, spindle_off=source.spindle_off)
    with ExitStack() as stack:
        watched: list[tuple[Inspection, Recorder]] = []

        def begun(inspection: Inspection) -> None:
            recorder = stack.enter_context(Recorder(inspection.twin, INTERVAL_NS))
            watched.append((inspection, recorder))

        golden = task.golden and golden_file(task.job).is_file()
        looked = None if page is None else begun
        cautions = of_cautions(source)
        report = check_job(task.job, task.call, lines, task.bounds, looked, drawn, cautions, golden=golden)
        report = report.without("" if source is None else source.not_made)
        if golden:
            report = beside_golden(report, task.job, task.call, source)
        for inspection, recorder in watched:
            from isel_twin.report.report import write_report

            call = {"controller": task.call.controller, "plant": task.call.plant, "seed": task.call.seed}
            summary, shown = {**report.verdict.summary(), **call}, (inspection.twin, recorder, inspection.results)
            with call_errors(page):
                write_report(page or "", f"isel-twin: {task.job}", *shown, summary, report, task.bounds)
    return report
