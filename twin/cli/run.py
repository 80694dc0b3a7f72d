"""`isel-twin run`: a file of commands in virtual time, and the verdict on it.

A job that is stopped by Ctrl-C, or ends because a line is not over in time, keeps what it has: table, traces, report.
"""

from __future__ import annotations

import signal
from collections.abc import Callable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from importlib.util import find_spec
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.units import SECOND_NS
from isel_twin.cli.jobs import check_names, job_name, read_job
from isel_twin.cli.options import (
    ControllerName,
    FlashPath,
    Interval,
    MachineName,
    PlantName,
    ScenarioFile,
    Seed,
    check_seconds,
    check_writable,
    is_standard_input,
)
from isel_twin.cli.recording import RecordPath, begin, check_record, keep
from isel_twin.core.spec import MACHINE, TwinSpec

if TYPE_CHECKING:
    from isel_twin.jobs.job import Line
    from isel_twin.jobs.robust import Trial

MOST_SAMPLES = 100_000_000
"""Samples of a trace beyond which a job is not begun: ten gigabytes, and two hours to take them."""


def run(
    job: Annotated[Path, Parameter(help='Controller commands, one a line, or a program; "-" is standard input.')],
    /,
    *,
    machine: MachineName = MACHINE,
    controller: ControllerName = TwinSpec.controller,
    plant: PlantName = TwinSpec.plant,
    seed: Seed = TwinSpec.seed,
    flash: FlashPath = None,
    scenario: ScenarioFile = None,
    steps: Annotated[Path | None, Parameter(help="Write the step stream (npz: t_ns, delta).")] = None,
    vcd: Annotated[Path | None, Parameter(help="Write step, direction, levels and positions (VCD).")] = None,
    trace: Annotated[Path | None, Parameter(help="Write samples of counters, positions, levels (Parquet).")] = None,
    report: Annotated[
        Path | None, Parameter(help="Write a page about the job (HTML; a picture if it ends in .png).")
    ] = None,
    record: RecordPath = None,
    interval: Interval = 0.01,
    timeout: Annotated[float, Parameter(help="Virtual seconds after which a missing reply is given up.")] = 3600.0,
    robust: Annotated[int, Parameter(help="Repeat the job so many times on slightly different machines.")] = 0,
    jobs: Annotated[int, Parameter(help="Processes that share the repetitions of --robust.")] = 1,
    json: Annotated[bool, Parameter(help="One line of JSON a command, then one with the summary.")] = False,
) -> int:
    """Run a file of controller commands, or a program of the controller's, in virtual time.

    A line is sent as the controller's language has it (an iMC's with a carriage return) and its reply awaited. "# "
    begins a comment. <253> is the byte 253, <0.5s> lets time pass, and text before a <...> is sent as it stands. So
    this starts a motion of an iMC and stops it: `@0A8000,5000,0,30,0,30,0,30<13> <0.2s> <253>`

    `=> 2` behind a command says what must be answered (`*` anything, `none` nothing, `=> 0 within 5 s`), and a line
    `! x == 50 +- 0.03 mm` what must be so after it; docs/hosts.md lists what can be expected.

    A program of a controller that runs programs (DIN 66025, see docs/bwo900.md) is loaded, the axes are referenced, it
    is started, and its blocks are told as they are made.

    Ctrl-C ends the job; what has happened by then is written. So does a command that is not over after --timeout.

    Exit code 0 if every command was accepted ("0", or a longer answer to a query) or answered as expected, every
    condition met, a program at its end and no step lost, else 1. With
    --robust 20, only if 20 repetitions with another power-on position, supply (5 %), friction (20 %) and masses (10 %),
    all drawn from --seed, end as the job itself does: what happens near stall is luck.
    """
    check_seconds("interval", interval, 1e-9)
    check_seconds("timeout", timeout, 0.0)
    lines = read_job(job, controller)
    needs_recorder = vcd is not None or trace is not None or report is not None
    if needs_recorder or record is not None:
        _check_samples(lines, interval)
    if trace is not None:
        need_pyarrow()
    if report is not None:
        need_report(report)
    check_record(record)
    check_writable(steps, vcd, trace, report, record, kept=(job, flash, scenario))
    call = TwinSpec(machine, controller, plant, seed, scenario, flash)
    golden = None
    if report is not None:
        from isel_twin.jobs.golden import called as as_called
        from isel_twin.jobs.golden import golden_file, load

        if not is_standard_input(job) and (file := golden_file(job)).is_file():
            with call_errors(file):
                golden = load(file)
    repetitions = _repetitions(call, lines, robust, jobs, timeout)
    with ExitStack() as stack:
        wants_stream = any(path is not None for path in (steps, vcd, trace, report))
        twin = call.build(keep_motions=None if wants_stream else 1)

        from isel_twin.cli import outputs
        from isel_twin.core.warm import told_of_compiling
        from isel_twin.jobs.checks.job import Bounds, Inspection
        from isel_twin.jobs.job import play
        from isel_twin.jobs.verdict import judge
        from isel_twin.recordings.write import write_trace

        check_names(job, lines, twin)
        stack.enter_context(told_of_compiling())
        recorder = outputs.record(twin, interval, stack) if needs_recorder else None
        recording = None if record is None else begin(record, twin, interval, {"job": job_name(job)}, stack)
        inspection = None if report is None else Inspection(twin, Bounds(timeout_s=timeout))
        show: outputs.JobOutput
        show = outputs.JsonOutput() if json else stack.enter_context(outputs.TableOutput(twin, lines))
        results = []
        with interruption() as stopped:
            for result in play(twin, lines, timeout, lambda: bool(stopped)):
                show.result(result)
                results.append(result)
                if inspection is not None:
                    inspection.take(result)
        whole = len(results) == len(lines) and results[-1].complete
        interrupted = not whole and bool(stopped)
        if not whole:
            unsent = len(lines) - len(results)
            where = ""
            last = results[-1] if results else None
            said = last.why if last is not None and last.expected is None and not last.ok else ""
            if last is not None:
                where = f"{'after ' if last.complete and not said else ''}line {last.number}: "
            why = "interrupted" if interrupted else said or f"no complete reply within {timeout:g} s of virtual time"
            rest = f" and {_lines_are(unsent)} not sent" if unsent else ""
            remedy = "" if interrupted or said else "; --timeout waits longer"
            outputs.say(f"{job_name(job)}: {where}{why}; the job ends there{rest}{remedy}")
        verdict = judge(twin, results, len(lines) - len(results), interrupted)
        called = {"controller": controller, "plant": plant, "seed": seed}
        show.verdict(verdict, called)
        recorded = True
        failures: list[CallError] = []
        for path, kind in ((steps, ".npz"), (vcd, ".vcd"), (trace, ".parquet")):
            if path is not None:
                with outputs.put_off(failures, path):
                    write_trace(path, twin, recorder, kind)
        if record is not None and recording is not None:
            with outputs.put_off(failures, record):
                recorded = keep(recording, record)
        if report is not None and recorder is not None and inspection is not None:
            from isel_twin.report.report import write_report

            with outputs.put_off(failures, report):
                summary = {**verdict.summary(), **called}
                found = inspection.report(job_name(job), verdict)
                if golden is not None:
                    found = found.compared(golden, as_called(found.run, call, job, golden_file(job)))
                title = f"isel-twin: {job_name(job)}"
                write_report(report, title, twin, recorder, results, summary, found, inspection.bounds)
        outputs.tell(failures)
        sound = True
        if repetitions and not interrupted:
            seen = []
            with interruption() as stopped:
                for trial in repetitions(stack, lambda: bool(stopped)):
                    seen.append(trial)
            interrupted = bool(stopped) and len(seen) < robust
            if interrupted:
                outputs.say(f"{job_name(job)}: interrupted after {len(seen)} of {robust} repetitions")
            sound = show.robust(verdict, seen, robust)
    if interrupted:
        return 128 + stopped[0]
    return 0 if verdict.ok and sound and recorded else 1


def _repetitions(
    call: TwinSpec, lines: Sequence[Line], number: int, jobs: int, timeout_s: float
) -> Callable[[ExitStack, Callable[[], bool]], Iterator[Trial]] | None:
    """What makes the repetitions of a job, checked before the job begins; None if none are wanted. Raises CallError.

    They begin with the flash memory as it is now.
    """
    if number < 0:
        raise CallError(f"robust {number}: must be a number of repetitions, such as 20", option=True)
    if jobs < 1:
        raise CallError(f"jobs {jobs}: must be a number of processes from 1", option=True)
    if number == 0:
        return None
    from isel_twin.jobs.robust import check, processes, trials

    check(call, number)
    flash = None
    if isinstance(call.flash, Path) and call.flash.is_file():
        with call_errors(call.flash):
            flash = call.flash.read_bytes()

    def make(stack: ExitStack, stop: Callable[[], bool]) -> Iterator[Trial]:
        executor = stack.enter_context(processes(min(jobs, number))) if jobs > 1 else None
        with without_ctrl_c():
            return trials(call, lines, number, timeout_s=timeout_s, flash=flash, executor=executor, stop=stop)

    return make


@contextmanager
def without_ctrl_c() -> Iterator[None]:
    """Processes begun in the meantime never heed Ctrl-C: the terminal sends it to all, the first decides."""
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def interruption() -> Iterator[list[int]]:
    """A list that is empty until Ctrl-C or SIGTERM comes, and then holds its number; the next one acts as ever."""
    stopped: list[int] = []

    def stop(number: int, _: object) -> None:
        stopped.append(number)
        restore()

    def restore() -> None:
        for number, handler in before.items():
            signal.signal(number, handler)

    before = {number: signal.signal(number, stop) for number in (signal.SIGINT, signal.SIGTERM)}
    try:
        yield stopped
    finally:
        restore()


def _lines_are(number: int) -> str:
    return "1 line is" if number == 1 else f"{number} lines are"


def _check_samples(lines: Sequence[Line], interval_s: float) -> None:
    """Refuse a trace that cannot but be too long: the pauses alone make more samples than MOST_SAMPLES."""
    from isel_twin.jobs.verdict import SETTLE_S

    least_s = SETTLE_S + sum(line.pauses_ns for line in lines) / SECOND_NS
    if least_s / interval_s > MOST_SAMPLES:
        raise CallError(
            f"interval {interval_s:g}: the pauses of the job alone, {least_s:g} s, make {least_s / interval_s:.1e} "
            f"samples; take {least_s / MOST_SAMPLES * 1.01:.3g} or more",
            option=True,
        )


def need_pyarrow() -> None:
    """Raise CallError unless a trace can be written."""
    from isel_twin.recordings.write import check_kind

    try:
        check_kind(".parquet", "trace")
    except ValueError as error:
        raise CallError(str(error), option=True) from None


def need_report(path: Path) -> None:
    """Raise CallError unless a report of that name can be written."""
    if path.suffix.lower() == ".png" and find_spec("matplotlib") is None:
        raise CallError(f"report {path}: a picture needs matplotlib: pip install 'isel-twin[report]'", option=True)
