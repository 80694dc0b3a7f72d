"""`isel-twin golden record|compare`: jobs that must behave as before."""

from __future__ import annotations

import dataclasses
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import options
from isel_twin.cli.jobs import check_file, check_names, clamped, read_source, say_zero
from isel_twin.cli.options import Whole
from isel_twin.cli.outputs import many, say_json
from isel_twin.core.spec import TwinSpec

if TYPE_CHECKING:
    from isel_twin.cam.toolpath import Caution
    from isel_twin.jobs.golden import Difference, Golden
    from isel_twin.jobs.toolpaths import Reading

golden = App(name="golden", help="Jobs that have to do what they did: write down a run, compare with it.")

MOST = 20  # differences of a job that are shown
Jobs = Annotated[Path, Parameter(help="Files of controller commands, one a line.")]


@golden.command
def record(
    *jobs: Jobs,
    twin: options.TwinOptions = options.DEFAULT_TWIN,
    line: options.LineOptions = options.NO_LINE,
    cam: options.CamOptions = options.AS_IT_LOOKS,
    timeout: options.Timeout = 3600.0,
    replace: options.Replace = False,
) -> int:
    """Run jobs and write a golden run beside each: that of job.txt is job.golden, a small text file for version control
    with one line a command: reply, time, counters, digests of the step stream.
    """
    files = _files(jobs)
    options.check_seconds("timeout", timeout, 0.0)
    for job, file in files:
        options.check_writable(file, kept=(job, *twin.files))
        if file.exists() and not replace:
            raise CallError(f"{file}: is there already; --replace replaces it, golden compare compares with it")
    call, asked = line.on(twin.spec()), cam.reading()
    for job, file in files:
        run, cautions = _play(job, file, call, asked, timeout)
        _write(file, run)
        print("\n".join([f"{file}: {_in_words(run)}", *_cautioned(cautions)]))
    return 0


@golden.command
def compare(
    *jobs: Jobs,
    machine: Annotated[str | None, Parameter(help="Another machine than that of the golden run.")] = None,
    controller: Annotated[str | None, Parameter(help="Another controller.")] = None,
    plant: Annotated[str | None, Parameter(help="Another plant.")] = None,
    seed: Annotated[Whole | None, Parameter(help="A number: another seed.")] = None,
    set: Annotated[options.Overrides, Parameter(help="KEY=VALUE: another parameter of the machine.")] = (),
    cam: options.CamOptions = options.AS_IT_LOOKS,
    timeout: options.Timeout = 3600.0,
    replace: Annotated[bool, Parameter(help="Replace the golden runs that differ.")] = False,
    json: Annotated[bool, Parameter(help="One line of JSON a job.")] = False,
) -> int:
    """Run jobs as their golden runs were made, and show the differences, the first one first.

    Exit code 0 without differences (or with --replace), 1 with differences, 2 if a golden run is missing.
    """
    from isel_twin.jobs.golden import differences, load

    files = _files(jobs)
    options.check_seconds("timeout", timeout, 0.0)
    asked: dict[str, Any] = {"machine": machine, "controller": controller, "plant": plant, "seed": seed}
    asked["set"], read_as = options.parse_overrides(set) or None, cam.reading()
    kept = []
    for job, file in files:
        with call_errors(file):
            if not file.exists():
                raise CallError(f"{file}: there is no golden run of {job}; isel-twin golden record {job} makes it")
            kept.append(load(file))
        if replace:
            options.check_writable(file, kept=(job,))
    same = True
    for (job, file), was in zip(files, kept, strict=True):
        wanted = {**was.call, **{key: value for key, value in asked.items() if value is not None}}
        call = _call(wanted, file, asked)
        zero = was.call.get("zero") if read_as.zero is None else read_as.zero
        taken = dataclasses.replace(read_as, zero=tuple(zero) if isinstance(zero, list) else zero)
        run, cautions = _play(job, file, call, taken, timeout)
        found = list(differences(was, run))
        _tell(job, run, found, cautions, json)
        if found and replace:
            _write(file, run)
            if not json:
                print(f"  {file}: replaced")
        same = same and (replace or not found)
    return 0 if same else 1


def _files(jobs: Sequence[Path]) -> list[tuple[Path, Path]]:
    """Each job with its golden file. Raises CallError."""
    from isel_twin.jobs.golden import golden_file

    if not jobs:
        raise CallError("name the jobs: isel-twin golden record JOB...")
    files = [(job, golden_file(job)) for job in jobs]
    for job, file in files:
        if str(job) == options.STANDARD_INPUT:
            raise CallError("-: a golden run stands beside its job; name a file")
        if job == file:
            raise CallError(f"{job}: is a golden run, not a job; name the job itself")
        check_file(job)
        if job.is_dir() or not job.exists():
            raise CallError(f"{job}: {'is a folder, not a file' if job.is_dir() else 'there is no such file'}")
    if len({file.resolve() for _, file in files}) < len(files):
        raise CallError("two of the jobs share one golden file; give them different names")
    return files


def _play(
    job: Path, file: Path, call: TwinSpec, reading: Reading, timeout_s: float
) -> tuple[Golden, Sequence[Caution]]:
    """The run, and what the file of a CAM program may mean otherwise."""
    from isel_twin.jobs.golden import Scribe, called
    from isel_twin.jobs.playing import played

    twin = clamped(call, job).build()
    lines, source = read_source(job, call, reading)
    say_zero(job, reading, None if source is None else source.zero)
    check_names(job, lines, twin)
    scribe = Scribe(twin)
    run = scribe.golden(played(twin, lines, [scribe.take], timeout_s).verdict)
    if source is None:
        return called(run, call, job, file), ()
    return called(run, call, job, file, source.zero), source.cautions


def _call(head: dict[str, Any], file: Path, asked: dict[str, Any]) -> TwinSpec:
    """The call of a golden run; its paths are relative to its file."""
    folder = file.resolve().parent
    machine = head["machine"]
    if asked["machine"] is None and (folder / machine).is_dir():
        machine = str(folder / machine)
    scenario = folder / head["scenario"] if head.get("scenario") else None
    call = TwinSpec(machine, head["controller"], head["plant"], head.get("seed", 0), scenario)
    with call_errors(file):
        line = {key: head[key] for key in ("line_speed", "adapter_ms") if key in head}
        return call.with_(overrides=head.get("set", {}), **line)


def _write(file: Path, run: Golden) -> None:
    from isel_twin.base.files import atomic_write
    from isel_twin.jobs.golden import dumps

    with call_errors(file):
        atomic_write(file, dumps(run).encode())


def _in_words(run: Golden) -> str:
    return f"{many(len(run.moves), 'command')}, {run.end['cycle_s']:.3f} s, {'ok' if run.end['ok'] else 'failed'}"


def _tell(job: Path, run: Golden, found: Sequence[Difference], cautions: Sequence[Caution], json: bool) -> None:
    if json:
        told = [{"line": difference.line, "what": difference.what} for difference in found]
        said = {"cautions": list(map(str, cautions))} if cautions else {}
        say_json({"job": str(job), "same": not found, "differences": told, **said})
        return
    rows = [f"{job}: {many(len(found), 'difference')} from its golden run"]
    if not found:
        rows = [f"{job}: unchanged ({_in_words(run)})"]
    rows += [f"  {difference}" for difference in found[:MOST]]
    if len(found) > MOST:
        rows.append(f"  and {len(found) - MOST} more; --json lists all")
    print("\n".join([*rows, *_cautioned(cautions)]))


def _cautioned(cautions: Sequence[Caution]) -> list[str]:
    return [f"  caution: {caution}" for caution in cautions]
