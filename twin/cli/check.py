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
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import (
    DEFAULT_PART,
    FormatName,
    JobTwin,
    PartOptions,
    SettingsFile,
    cam_settings,
    check_file,
    check_names,
    read_job,
    read_source,
)
from isel_twin.cli.options import Whole
from isel_twin.cli.outputs import many, put_off, say, tell

if TYPE_CHECKING:
    from isel_twin.bridge.tap.real_job import RealReport
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.checks import Report
    from isel_twin.jobs.checks.formats import Told
    from isel_twin.jobs.checks.settings import Task

INTERVAL_NS = 10_000_000  # sampling interval of the pages


@Parameter(name="*")
@dataclass(frozen=True)
class Demands(JobTwin):
    """What jobs are played on, and what they must keep."""

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
    may_strike: Annotated[str | None, Parameter(help="End switches that may be struck, with commas; all.")] = None
    robust: Annotated[
        Whole | None, Parameter(help="Number of other machines, as one can buy them, on which it is repeated.")
    ] = None
    uncertain: Annotated[
        Whole | None, Parameter(help="Number of machines that this one may be, as far as its numbers are known.")
    ] = None
    form: FormatName = None
    timeout: Annotated[float | None, Parameter(help="Virtual seconds a command may take.")] = None
    golden: Annotated[bool | None, Parameter(negative="no-golden", help="Compare with golden runs.")] = None
    strict: Annotated[
        bool | None, Parameter(negative="no-strict", help="Warnings make a job fail, too: cautions of a CAM file ...")
    ] = None

    def asked(self) -> dict[str, Any]:
        """The demands in the words of isel-twin.toml. Raises CallError for a wrong --set."""
        asked = vars(self) | {"timeout_s": self.timeout, "set": options.parse_overrides(self.set) or None}
        del asked["timeout"], asked["may_strike"]
        if self.may_strike is not None:
            asked["may_strike"] = tuple(name for name in self.may_strike.split(",") if name)
        return asked


DEFAULT_DEMANDS = Demands()


def check(
    *jobs: Annotated[Path, Parameter(help="Files of controller commands, one a line, or programs.")],
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
    other rules always apply. A job with a golden run beside it is compared with it, a part of one is not.

    Exit code 0 if nothing is wrong, 1 if something is, 2 for a call that cannot be carried out, 130 after Ctrl-C and
    143 after SIGTERM: reports then hold what was judged, and name as errors the jobs that were not. In a workflow of
    GITHUB_ACTIONS the findings are also annotations. With --watch the code is that of the last verdict, and what comes
    before a changed line is not played again.

    With --isel-port the machine is a real one, and is moved by the jobs: replies and times are judged, what needs a
    look inside is named as not looked at. Ctrl-C breaks the motion off.
    """
    asked = demands.asked() | {"part": part.lines()}
    _check_options(asked, workers)
    _check_part(jobs, asked)
    if isel_port is not None:
        inside = {"set": demands.set, "report": report, "watch": watch}
        _check_outside(asked, inside, workers)
        asked |= {"plant": "kinematic", "golden": False}  # of the twin that only knows names
    if watch:
        if len(jobs) != 1 or options.is_standard_input(jobs[0]) or junit or sarif or report or workers != 1:
            raise CallError("watch: names one job, and goes without junit, sarif, report and workers", option=True)
        from isel_twin.cli.watch import watch as watch_job

        return watch_job(jobs[0], settings, asked, json)
    tasks = _tasks(jobs, settings, asked)
    pages = _pages(tasks, report)
    options.check_writable(junit, sarif, *pages, kept=(*jobs, settings, demands.scenario))

    from isel_twin.jobs.checks.formats import as_annotations, as_json, as_words
    from isel_twin.jobs.checks.formats import junit as as_junit
    from isel_twin.jobs.checks.formats import sarif as as_sarif

    reports: list[Told] = []
    crew = options.crew_of(min(workers, len(tasks)))
    every = _real(tasks, isel_port) if isel_port else in_order(perform, list(zip(tasks, pages, strict=True)), crew)
    with interruption(at_once=True) as stopped:
        for made in every:
            reports.append(made)
            print(as_json(made) if json else as_words(made), flush=True)
    unjudged = [str(task.job) for task in tasks[len(reports) :]]
    if stopped:
        say(f"interrupted: {len(reports)} of {many(len(tasks), 'job')} judged")
    if os.environ.get("GITHUB_ACTIONS") == "true":
        for line in as_annotations(reports):
            print(line)
    failed = sum(not made.ok for made in reports)
    if not json:
        wrong = [f"{failed} failed"] * bool(failed) + [f"{len(unjudged)} not judged"] * bool(unjudged)
        well = "all well as far as looked at" if any(made.unseen for made in reports) else "all well"
        print(f"{many(len(tasks), 'job')}: {', '.join(wrong) or well}")
    failures: list[CallError] = []
    for path, write in ((junit, as_junit), (sarif, as_sarif)):
        if path is not None:
            from isel_twin.base.files import atomic_write

            with put_off(failures, path):
                atomic_write(path, write(reports, unjudged).encode())
    tell(failures)
    if stopped:
        return 128 + stopped[0]
    return 1 if failed else 0


def _check_options(asked: dict[str, Any], workers: int) -> None:
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
        if asked[key] is not None and asked[key] < 0:
            raise CallError(f"{key} {asked[key]}: must be a number of repetitions, such as 20", option=True)
    options.check_workers(workers)


def _check_part(jobs: Sequence[Path], asked: dict[str, Any]) -> None:
    """Raise CallError for a part of several files, whose lines have the same numbers, or beside a golden run."""
    if asked["part"] == WHOLE:
        return
    if len(jobs) > 1:
        raise CallError("from-line, to-line: are lines of one file; name one job", option=True)
    if asked["golden"]:
        raise CallError("golden: a golden run is one of the whole file; leave from-line and to-line out", option=True)


def _tasks(jobs: Sequence[Path], settings: Path | None, asked: dict[str, Any]) -> list[Task]:
    """The tasks, all checked before the first begins. Raises CallError."""
    from isel_twin.jobs import project
    from isel_twin.jobs.checks import settings as demanded
    from isel_twin.jobs.golden import golden_file, load

    if not jobs:
        raise CallError("name the jobs: isel-twin check JOB...")
    if settings is not None and not settings.is_file():
        raise CallError(f"{settings}: there is no such file")
    tasks = []
    for job in jobs:
        if str(job) == options.STANDARD_INPUT:
            raise CallError("-: bounds stand beside a job; name a file")
        check_file(job)
        if job.is_dir():
            raise CallError(f"{job}: is a folder, not a file; name its jobs")
        with call_errors(job):
            found = settings if settings is not None else project.find(job)
            task = demanded.task(job, found, asked)
            read_job(job, task.call, task.form, task.part)
            if task.golden and (file := golden_file(job)).is_file():
                load(file)
            elif asked["golden"]:
                raise CallError(f"{file}: there is no golden run of {job}; isel-twin golden record {job} makes it")
        tasks.append(task)
    twins: dict[str, Twin] = {}
    for task in tasks:
        if (twin := twins.get(repr(task.call))) is None:
            twin = twins[repr(task.call)] = task.call.build()
        demanded.check_switches(task.bounds, twin.machine)
        check_names(task.job, read_job(task.job, task.call, task.form, task.part), twin)
    return tasks


def _check_outside(asked: dict[str, Any], others: dict[str, Any], workers: int) -> None:
    """Raise CallError for an option that only a twin can satisfy."""
    from isel_twin.jobs.checks.rules import RULES

    bounds = [rule.bound for rule in RULES.values() if rule.bound in asked and not rule.heard]
    names = ["plant", "seed", "scenario", *bounds]
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

    every = [read_source(task.job, task.call, task.form, task.part) for task in tasks]
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


def perform(asked: tuple[Task, Path | None]) -> Report:
    """Check one job, and write a page about it if asked; in this process or another."""
    task, page = asked
    from isel_twin.jobs.checks.contour import drawing
    from isel_twin.jobs.checks.job import Inspection, beside_golden, check_job
    from isel_twin.jobs.checks.rules import of_cautions
    from isel_twin.jobs.golden import golden_file
    from isel_twin.recordings.recorder import Recorder

    lines, source = read_source(task.job, task.call, task.form, task.part)
    drawn = None
    if source is not None and task.bounds.contour_mm is not None:
        drawn = drawing(source.path(), cam_settings(task.job, task.call), task.bounds.contour_mm)
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
            report = beside_golden(report, task.job, task.call)
        for inspection, recorder in watched:
            from isel_twin.report.report import write_report

            call = {"controller": task.call.controller, "plant": task.call.plant, "seed": task.call.seed}
            summary, shown = {**report.verdict.summary(), **call}, (inspection.twin, recorder, inspection.results)
            with call_errors(page):
                write_report(page or "", f"isel-twin: {task.job}", *shown, summary, report, task.bounds)
    return report
