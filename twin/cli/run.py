"""`isel-twin run`: a file of commands in virtual time, and the verdict on it. A job that ends early, by Ctrl-C or a
timeout, keeps its results: table, traces, report.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import ExitStack
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cam.section import WHOLE
from isel_twin.cli import options, outputs
from isel_twin.cli.files import MOST_SAMPLES, Files, RecordPath, ReportPath, StepsPath, TracePath, VcdPath
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import DEFAULT_PART, PartOptions, check_names, clamped, job_name, read_source, say_zero

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.checks.job import Inspection
    from isel_twin.jobs.edge import Edge
    from isel_twin.jobs.golden import Golden
    from isel_twin.jobs.job import Line
    from isel_twin.jobs.playing import Played
    from isel_twin.jobs.robust import Repetition
    from isel_twin.jobs.toolpaths import Source as JobSource
    from isel_twin.jobs.verdict import Verdict
    from isel_twin.machine.spread import Source
    from isel_twin.recordings.recorder import Recorder


def run(
    job: Annotated[Path, Parameter(help='Controller commands, one a line, or a program; "-" is standard input.')],
    /,
    *,
    twin: options.TwinOptions = options.DEFAULT_TWIN,
    steps: StepsPath = None,
    vcd: VcdPath = None,
    trace: TracePath = None,
    report: ReportPath = None,
    record: RecordPath = None,
    interval: options.Interval = 0.01,
    timeout: options.Timeout = 3600.0,
    edge: Annotated[
        bool, Parameter(help="How much more speed, less supply, more inductance, more friction it takes to lose steps.")
    ] = False,
    robust: options.Robust = 0,
    uncertain: options.Uncertain = 0,
    workers: options.Workers = 1,
    line: options.LineOptions = options.NO_LINE,
    cam: options.CamOptions = options.AS_IT_LOOKS,
    part: PartOptions = DEFAULT_PART,
    json: Annotated[bool, Parameter(help="One line of JSON a command, then one with the summary.")] = False,
) -> int:
    """Run a file of controller commands, or a program of the controller's, in virtual time.

    A line is sent as the controller's language has it (an iMC's with a carriage return) and its reply awaited. "# "
    begins a comment. <253> is the byte 253, <0.5s> lets time pass, and text before a <...> is sent as it stands. So
    this starts a motion of an iMC and stops it: `@0A8000,5000,0,30,0,30,0,30<13> <0.2s> <253>`

    `=> 2` after a command is the expected reply (`*` anything, `none` nothing, `=> 0 within 5 s`), and a line `! x ==
    50 +- 0.03 mm` a condition after it; docs/hosts.md lists all.

    A file of a CAM program (NCP, G-code, HPGL; docs/jobfiles.md) is made into the commands of the controller, by the
    [cam] table of isel-twin.toml; findings name its own lines. --from-line 42 makes it from there on: tool, spindle and
    all that holds are set, and the tool goes down to the beginning of that line from above.

    A program of a controller that runs programs (DIN 66025, see docs/bwo900.md) is loaded, the axes are referenced, it
    is started, and its blocks are shown as they are made.

    Ctrl-C, or a command that is not over after --timeout, ends the job; all files are still written.

    Exit code 0 if every command was accepted ("0", or a longer answer to a query) or answered as expected, every
    condition met, a program at its end and no step lost, else 1. With
    --robust 20, only if the job ends on 20 other machines of the kind as on this one (motors, stages, supply, friction,
    masses, power-on position: drawn from --seed as makers and shops spread them): what happens near stall is luck.

    --uncertain 40 makes the job on 40 machines that this one may be: each number within its band (see `describe`),
    which is narrow if it was measured and wide if it is an estimate. It says where places, time, margin and edge lie,
    and which number contributes most; exit code 0 wants all to end as the job itself.

    Bytes take no time on the line between host and controller. What they would take is told where it is more than 2 %;
    --line-speed lets them take it, and --adapter-ms lets replies wait for a USB adapter.

    --edge makes a job that is well again with ever more speed, less supply voltage, more inductance and more friction,
    until it loses steps, and says at which factor: how far it is from the edge.
    """
    options.check_seconds("interval", interval, 1e-9)
    options.check_seconds("timeout", timeout, 0.0)
    call = clamped(line.on(twin.spec()), job)
    asked = replace(cam.reading(), part=part.lines())
    lines, source = read_source(job, call, asked)
    say_zero(job, asked, None if source is None else source.zero)
    files = Files(steps, vcd, trace, report, record, interval)
    if files.sampled:
        _check_samples(lines, interval)
    files.check(job, *twin.files)
    golden = None if report is None or asked.part != WHOLE else _golden(job)
    others = _others(call, lines, {"kind": robust, "known": uncertain}, workers, timeout)
    search = _edges(call, lines, workers, timeout) if edge else None
    with ExitStack() as stack:
        made_on = call.build(keep_motions=None if files.needs_stream else 1)

        from isel_twin.jobs.playing import played

        check_names(job, lines, made_on)
        writing = files.begin(made_on, {"job": job_name(job)}, stack)
        show: outputs.JobOutput
        show = outputs.JsonOutput() if json else stack.enter_context(outputs.TableOutput(made_on, lines))
        inspection = None if report is None else _inspection(made_on, timeout, golden is not None)
        watchers = [show.result] if inspection is None else [show.result, inspection.take]
        with interruption() as stopped:
            made = played(made_on, lines, watchers, timeout, lambda: bool(stopped))
        if source is not None:
            made = replace(made, verdict=replace(made.verdict, not_made=source.not_made))
        if not made.whole:
            outputs.say(f"{job_name(job)}: {_why_it_ended(made, timeout)}")
        called = {"controller": twin.controller, "plant": twin.plant, "seed": twin.seed}
        unwritten = writing.write(partial(_write_page, job, call, made_on, made, called, inspection, golden, source))
        verdict = replace(made.verdict, unwritten=tuple(unwritten.names))
        if source is not None:
            show.source(source, made.results)
        show.verdict(verdict, called)
        outputs.tell(unwritten.failures)
        if verdict.interrupted:
            return 128 + stopped[0]
        if search is not None and (code := _tell_edges(job, made.verdict, search, show)) is not None:
            return code
        return _tell_others(job, made, others, show) or int(not verdict.ok)


def _golden(job: Path) -> Golden | None:
    """The golden run beside a job, or None. Raises CallError."""
    from isel_twin.jobs.golden import golden_file, load

    if options.is_standard_input(job) or not (file := golden_file(job)).is_file():
        return None
    with call_errors(file):
        return load(file)


def _inspection(twin: Twin, timeout_s: float, golden: bool) -> Inspection:
    from isel_twin.jobs.checks.job import Inspection
    from isel_twin.jobs.checks.rules import Bounds

    return Inspection(twin, Bounds(timeout_s=timeout_s), golden=golden)


def _write_page(
    job: Path,
    call: TwinSpec,
    twin: Twin,
    made: Played,
    called: Mapping[str, Any],
    inspection: Inspection | None,
    golden: Golden | None,
    source: JobSource | None,
    path: Path,
    recorder: Recorder,
) -> None:
    """A page about the job, with what `check` would find in it, compared with its golden run if there is one."""
    from isel_twin.jobs.checks.rules import of_cautions
    from isel_twin.jobs.golden import called as as_called
    from isel_twin.jobs.golden import golden_file
    from isel_twin.report.report import write_report

    assert inspection is not None
    found = inspection.report(job_name(job), made.verdict, cautions=of_cautions(source))
    if golden is not None:
        zero = None if source is None else source.zero
        found = found.compared(golden, as_called(found.golden, call, job, golden_file(job), zero))
    title, summary = f"isel-twin: {job_name(job)}", {**made.verdict.summary(), **called}
    write_report(path, title, twin, recorder, made.results, summary, found, inspection.bounds)


def _why_it_ended(made: Played, timeout_s: float) -> str:
    last = made.results[-1] if made.results else None
    unsent, interrupted = made.verdict.unsent, made.verdict.interrupted
    said = last.why if last is not None and last.expected is None and not last.ok else ""
    place = next((part.at for part in reversed(last.parts) if part.at and not part.position_mm), None) if last else None
    number = last.number if last is not None and place is None else (place or (0, 0))[0]
    where = f"{'after ' if last.complete and not said else ''}line {number}: " if last is not None else ""
    why = "interrupted" if interrupted else said or f"no complete reply within {timeout_s:g} s of virtual time"
    rest = f" and {'1 line is' if unsent == 1 else f'{unsent} lines are'} not sent" if unsent else ""
    remedy = "" if interrupted or said else "; --timeout waits longer"
    return f"{where}{why}; the job ends there{rest}{remedy}"


class _Others(NamedTuple):
    """Repetitions of the job on other machines."""

    source: Source
    wanted: int
    repeat: Callable[..., Iterator[Repetition]]  # takes `stop`


def _others(
    call: TwinSpec, lines: Sequence[Line], wanted: Mapping[Source, int], workers: int, timeout_s: float
) -> list[_Others]:
    """Repetitions that are wanted, each with the present flash memory. Raises CallError."""
    for source, number in wanted.items():
        if number < 0:
            option = "robust" if source == "kind" else "uncertain"
            raise CallError(f"{option} {number}: must be a number of repetitions, such as 20", option=True)
    options.check_workers(workers)
    others = []
    for source, number in wanted.items():
        if number:
            from isel_twin.jobs.robust import check, repetitions

            check(call, number, source)
            how: dict[str, Any] = {"timeout_s": timeout_s, "flash": _flash(call), "source": source}
            how["crew"] = options.crew_of(min(workers, number))
            others.append(_Others(source, number, partial(repetitions, call, lines, number, **how)))
    return others


def _tell_others(job: Path, made: Played, others: Sequence[_Others], show: outputs.JobOutput) -> int:
    """Make the repetitions and show them: exit code 0 if all end as the job, 1 if not, more if interrupted."""
    code = 0
    for other in others:
        with interruption() as stopped:
            seen = list(other.repeat(stop=partial(bool, stopped)))
        cut = bool(stopped) and len(seen) < other.wanted
        if cut:
            outputs.say(f"{job_name(job)}: interrupted after {len(seen)} of {other.wanted} repetitions")
        if other.source == "kind":
            alike = show.robust(made.verdict, seen, other.wanted)
        else:
            alike = show.uncertain(made, seen, other.wanted)
        if cut:
            return 128 + stopped[0]
        code = code if alike else 1
    return code


def _edges(
    call: TwinSpec, lines: Sequence[Line], workers: int, timeout_s: float
) -> Callable[[Verdict, Callable[[], bool]], Iterator[Edge]]:
    """A function that finds the edges of a job, with the present flash memory. Raises CallError."""
    from isel_twin.jobs.edge import check, edges

    check(call)
    flash, crew = _flash(call), options.crew_of(workers)
    return lambda verdict, stop: edges(call, lines, verdict, timeout_s=timeout_s, flash=flash, crew=crew, stop=stop)


def _tell_edges(
    job: Path,
    verdict: Verdict,
    search: Callable[[Verdict, Callable[[], bool]], Iterator[Edge]],
    show: outputs.JobOutput,
) -> int | None:
    """Look for the edges of a job that is well, and show them; the exit code if it was interrupted."""
    if not verdict.ok:
        outputs.say(f"{job_name(job)}: no edge is searched for, as the job itself fails")
        return None
    with interruption() as stopped:
        found = list(search(verdict, lambda: bool(stopped)))
    if stopped:
        outputs.say(f"{job_name(job)}: interrupted; not all edges were found")
    if found or not stopped:
        show.edge(found)
    return 128 + stopped[0] if stopped else None


def _flash(call: TwinSpec) -> bytes | None:
    if isinstance(call.flash, Path) and call.flash.is_file():
        with call_errors(call.flash):
            return call.flash.read_bytes()
    return None


def _check_samples(lines: Sequence[Line], interval_s: float) -> None:
    """Refuse a trace whose pauses alone make more samples than MOST_SAMPLES."""
    from isel_twin.jobs.verdict import SETTLE_S

    least_s = SETTLE_S + sum(line.pauses_ns for line in lines) / SECOND_NS
    if least_s / interval_s > MOST_SAMPLES:
        raise CallError(
            f"interval {interval_s:g}: the pauses of the job alone, {least_s:g} s, make {least_s / interval_s:.1e} "
            f"samples; take {least_s / MOST_SAMPLES * 1.01:.3g} or more",
            option=True,
        )
