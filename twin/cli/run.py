"""`isel-twin run`: a file of commands in virtual time, and the verdict on it."""

from __future__ import annotations

import sys
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from isel_twin.call import CallError, TwinCall, call_errors
from isel_twin.cli.options import (
    STANDARD_INPUT,
    ControllerName,
    FlashPath,
    Interval,
    MachineName,
    PlantName,
    ScenarioFile,
    Seed,
    check_seconds,
    check_writable,
)

if TYPE_CHECKING:
    from isel_twin.job import Line


def run(
    job: Annotated[Path, Parameter(help='File of controller commands, one a line; "-" is standard input.')],
    /,
    *,
    machine: MachineName = TwinCall.machine,
    controller: ControllerName = TwinCall.controller,
    plant: PlantName = TwinCall.plant,
    seed: Seed = TwinCall.seed,
    flash: FlashPath = None,
    scenario: ScenarioFile = None,
    steps: Annotated[Path | None, Parameter(help="Write the step stream (npz: t_ns, delta).")] = None,
    vcd: Annotated[Path | None, Parameter(help="Write step, direction, levels and positions (VCD).")] = None,
    trace: Annotated[Path | None, Parameter(help="Write samples of counters, positions, levels (Parquet).")] = None,
    report: Annotated[Path | None, Parameter(help="Write an HTML page about the job.")] = None,
    interval: Interval = 0.01,
    timeout: Annotated[float, Parameter(help="Virtual seconds after which a missing reply is given up.")] = 3600.0,
    json: Annotated[bool, Parameter(help="One line of JSON a command, then one with the summary.")] = False,
) -> int:
    """Run a file of controller commands in virtual time.

    A line is sent as the controller's language has it (an iMC's with a carriage return) and its reply awaited. "# "
    begins a comment. <253> is the byte 253, <0.5s> lets time pass, and text before a <...> is sent as it stands. So
    this starts a motion of an iMC and stops it: `@0A8000,5000,0,30,0,30,0,30<13> <0.2s> <253>`

    Exit code 0 if every command was accepted ("0", or a longer answer to a query) and no step was lost, else 1.
    """
    check_seconds("interval", interval, 1e-9)
    check_seconds("timeout", timeout, 0.0)
    lines = _lines(job, controller)
    if report is not None:
        _need_matplotlib()
    check_writable(steps, vcd, trace, report, kept=(job, flash, scenario))
    call = TwinCall(machine, controller, plant, seed, scenario, flash)
    with ExitStack() as stack:
        twin = call.build()

        from isel_twin.cli import outputs
        from isel_twin.job import play
        from isel_twin.trace.write import write_trace
        from isel_twin.verdict import judge

        recorder = outputs.record(twin, interval, stack) if vcd or trace or report else None
        show: outputs.JobOutput
        show = outputs.JsonOutput() if json else stack.enter_context(outputs.TableOutput(twin, lines))
        results = []
        for result in play(twin, lines, timeout):
            show.result(result)
            results.append(result)
        verdict = judge(twin, results)
        called = {"controller": controller, "plant": plant, "seed": seed}
        with call_errors():
            for path, kind in ((steps, ".npz"), (vcd, ".vcd"), (trace, ".parquet")):
                if path is not None:
                    write_trace(path, twin, recorder, kind)
            if report is not None and recorder is not None:
                from isel_twin.trace.report import write_report

                summary = {**verdict.summary(), **called}
                write_report(report, f"isel-twin: {job}", twin, recorder, results, summary)
        show.verdict(verdict, called)
    return 0 if verdict.ok else 1


def _lines(job: Path, controller: str) -> list[Line]:
    """The lines of a job file, or of standard input, for a controller. Raises CallError."""
    from isel_twin.job import decode_job, parse_job
    from isel_twin.language import create_language

    with call_errors(job):
        language = create_language(controller)
        data = sys.stdin.buffer.read() if str(job) == STANDARD_INPUT else job.read_bytes()
        try:
            return parse_job(decode_job(data), language, controller)
        except ValueError as error:
            raise CallError(f"{job}: {error}") from None


def _need_matplotlib() -> None:
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise CallError("report needs matplotlib: pip install 'isel-twin[report]'", option=True)
