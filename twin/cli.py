"""The command `isel-twin`.

    serve        a twin behind a serial port that host programs connect to
    run          a file of commands in virtual time
    machines, describe, controllers, motor      what there is, and its numbers

Exit codes: 0 all well; 1 a job in which a command was refused or steps were lost; 2 a call that cannot be carried out,
with one line on stderr that says why. Everything heavy is imported by the command that needs it.
"""

from __future__ import annotations

import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import App, CycloptsError, Parameter

if TYPE_CHECKING:
    from rich.console import Console

    from isel_twin.bridge.server import Endpoint
    from isel_twin.job import Line, Result
    from isel_twin.trace.recorder import Recorder
    from isel_twin.twin import Twin

__all__ = ["main"]

app = App(
    name="isel-twin",
    help="Digital twin of a 3-axis isel gantry: controller, motors, mechanics and switches on one virtual clock.",
    version_flags=["--version"],
    default_parameter=Parameter(negative=()),
)


class BadCall(Exception):
    """The call cannot be carried out; the message is one line that says why and what to do."""


# What serve and run have in common

MachineName = Annotated[str, Parameter(help="Name of a machine (see `machines`) or path of a machine folder.")]
ControllerName = Annotated[str, Parameter(help="Name of a controller (see `controllers`).")]
PlantName = Annotated[str, Parameter(help="mujoco: physics. kinematic: the carriage follows the counter.")]
Seed = Annotated[int, Parameter(help="Seed of power-on positions, switch scatter and bounce.")]
ScenarioFile = Annotated[Path | None, Parameter(help="Timed events (TOML): hood, E-stop, faults, forces.")]
FlashPath = Annotated[Path | None, Parameter(help="The controller's flash memory; created if missing.")]
Interval = Annotated[float, Parameter(help="Time between two samples of a trace, in virtual seconds.")]


STANDARD_INPUT = "/dev/stdin"
"""What `-` stands for."""


def main(argv: Sequence[str] | None = None) -> None:
    """Run the command line, then exit."""
    tokens = list(_plain_tokens(sys.argv[1:] if argv is None else argv))
    try:
        code = app(tokens, print_error=False, exit_on_error=False, result_action="return_value")
        sys.stdout.flush()
    except (BadCall, CycloptsError) as error:
        print(f"isel-twin: {_one_line(str(error))}", file=sys.stderr)
        code = 2
    except KeyboardInterrupt:
        code = 130
    except BrokenPipeError:  # nobody reads our output any more, for example `| head`
        sys.stderr.close()
        code = 1
    except OSError as error:  # standard output cannot be written, for example a full disk
        print(f"isel-twin: {_one_line(str(error.strerror or error))}", file=sys.stderr)
        sys.stdout = None  # type: ignore[assignment]  # or the interpreter tries to flush it once more
        code = 1
    sys.exit(code)


def _plain_tokens(tokens: Iterable[str]) -> Iterator[str]:
    """Give a `--pty` that stands alone an empty value, and standard input (`-`) its name."""
    pending = False
    for token in tokens:
        if pending:
            yield "--pty=" if token.startswith("-") else f"--pty={token}"
            pending = False
            if not token.startswith("-"):
                continue
        if token == "--pty":
            pending = True
        else:
            yield STANDARD_INPUT if token == "-" else token
    if pending:
        yield "--pty="


def _one_line(text: str) -> str:
    return " ".join(text.split())


@contextmanager
def _bad_call(about: object = None) -> Iterator[None]:
    """What a caller may have got wrong becomes one line, about a file if the error does not name one itself."""
    try:
        yield
    except FileNotFoundError as error:
        raise BadCall(f"{error.filename2 or error.filename}: there is no such file") from error
    except OSError as error:
        where = error.filename2 or error.filename or about
        raise BadCall(f"{f'{where}: ' if where else ''}{error.strerror or error}") from error
    except ValueError as error:
        raise BadCall(str(error)) from error


def _build(
    machine: str,
    controller: str,
    plant: str,
    seed: int,
    scenario: Path | None,
    flash: Path | None,
    line_speed: bool,
) -> Twin:
    if seed < 0:
        raise BadCall(f"--seed {seed}: must be a whole number from 0")
    with _bad_call(flash):
        from isel_twin.files import FlashFile
        from isel_twin.twin import Twin

        keeper = FlashFile(flash) if flash is not None else None
        twin = Twin(
            machine,
            controller,
            plant,
            seed,
            flash=keeper.image if keeper is not None else None,
            scenario=scenario,
            line_speed=line_speed,
        )
        if keeper is not None:
            # A damaged image is the controller's business; a file that never was one is the caller's, and kept.
            if twin.outputs.get("flash_fault") and not (keeper.image or b"").startswith(b"isel-twin "):
                raise BadCall(f"{flash}: is no flash image of {controller}; remove it or name another file")
            keeper.attach(twin)
    return twin


LONGEST_S = 1e9
"""Longest time a call may name, in virtual seconds, as for the times of a scenario."""


def _seconds(option: str, value: float, low: float) -> float:
    """The value of an option that is a time, if it is one from `low` to LONGEST_S seconds."""
    if not low <= value <= LONGEST_S:  # false for nan, too
        raise BadCall(f"{option} {value:g}: must be a time from {low:g} to {LONGEST_S:g} s")
    return value


def _check_writable(*paths: Path | None, kept: Sequence[Path | None] = ()) -> None:
    """Find out before a long job that its results have nowhere to go, or would replace a file it needs."""
    import os

    taken = {path.resolve() for path in kept if path is not None}
    for path in paths:
        if path is None:
            continue
        if path.is_dir():
            raise BadCall(f"{path}: is a folder, not a file")
        if not os.access(path.parent, os.W_OK):
            raise BadCall(f"{path}: cannot write in folder {path.parent}; choose another place")
        if path.resolve() in taken and not path.is_char_device():
            raise BadCall(f"{path}: is named twice in this call; choose another name for what is written")
        taken.add(path.resolve())


@app.command
def serve(
    *,
    machine: MachineName = "4030",
    controller: ControllerName = "imc-s8",
    plant: PlantName = "mujoco",
    seed: Seed = 0,
    pty: Annotated[
        str | None, Parameter(help="A pseudo terminal, and a link to it if a name is given. The default.")
    ] = None,
    tcp: Annotated[str | None, Parameter(help="HOST:PORT for raw TCP; port 0: a free one.")] = None,
    rfc2217: Annotated[str | None, Parameter(help="HOST:PORT for RFC 2217 (Telnet with line settings).")] = None,
    panel: Annotated[str | None, Parameter(help="HOST:PORT for the operator panel; not built yet.")] = None,
    speed: Annotated[str, Parameter(help="Times real time, or max: as fast as possible.")] = "1",
    flash: FlashPath = None,
    scenario: ScenarioFile = None,
    record: Annotated[
        Path | None, Parameter(help="Keep what happens: .npz (steps), .vcd, or .parquet; written at the end.")
    ] = None,
    interval: Interval = 0.01,
) -> int:
    """Put a twin behind a serial port and let host programs drive it until it is told to stop (Ctrl-C).

    Prints one line of JSON with the addresses once everything listens. Logs go to stderr.
    """
    if panel is not None:
        raise BadCall("--panel: there is no operator panel yet; use --scenario to operate hood, key and E-stop")
    import json
    import logging

    from isel_twin.bridge.pacing import Pacer, parse_speed
    from isel_twin.bridge.server import Server, on_signals

    logging.basicConfig(stream=sys.stderr, level=logging.INFO, format="isel-twin: %(message)s")
    _seconds("--interval", interval, 1e-9)
    with _bad_call():
        factor = parse_speed(speed)
    if record is not None and record.suffix not in (".npz", ".vcd", ".parquet"):
        raise BadCall(f"--record {record}: the name must end in .npz, .vcd or .parquet")
    _check_writable(record, kept=(flash, scenario))
    with ExitStack() as stack:
        stack.enter_context(on_signals(lambda: sys.exit(0)))  # until the server can be stopped by them
        endpoints = _endpoints(pty, tcp, rfc2217, stack)
        twin = _build(machine, controller, plant, seed, scenario, flash, line_speed=factor is not None)
        recorder = _recorder(twin, interval, stack) if record is not None else None
        server = Server(twin, Pacer(factor, twin.time_ns), endpoints)
        stack.enter_context(on_signals(server.stop))
        where = {endpoint.kind: endpoint.address for endpoint in endpoints}
        if pty:
            where = {**where, "pty": pty, "device": where["pty"]}
        print(json.dumps({**where, "machine": twin.machine.name, "controller": controller}), flush=True)
        server.run()
        if record is not None and recorder is not None:
            with _bad_call():
                _write_trace(record, twin, recorder)
    return 0


def _endpoints(pty: str | None, tcp: str | None, rfc2217: str | None, stack: ExitStack) -> list[Endpoint]:
    """Listen everywhere, so that a taken port is found before anything else."""
    endpoints: list[Endpoint] = []
    with _bad_call():
        if pty is not None or (tcp is None and rfc2217 is None):
            from isel_twin.bridge.pty import PtyEndpoint

            endpoints.append(PtyEndpoint(pty or None))
            stack.callback(endpoints[-1].close)
        if tcp is not None:
            from isel_twin.bridge.tcp import TcpEndpoint

            endpoints.append(TcpEndpoint(tcp))
            stack.callback(endpoints[-1].close)
        if rfc2217 is not None:
            from isel_twin.bridge.rfc2217 import Rfc2217Codec
            from isel_twin.bridge.tcp import TcpEndpoint

            endpoints.append(TcpEndpoint(rfc2217, "rfc2217", Rfc2217Codec))
            stack.callback(endpoints[-1].close)
    return endpoints


def _recorder(twin: Twin, interval_s: float, stack: ExitStack) -> Recorder:
    from isel_twin.trace.recorder import Recorder

    return stack.enter_context(Recorder(twin, round(interval_s * 1e9)))


def _write_trace(path: Path, twin: Twin, recorder: Recorder) -> None:
    """Write the kind of trace that the file name ends in."""
    if path.suffix == ".npz":
        from isel_twin.trace.npz import write_npz

        write_npz(path, twin.steps)
    elif path.suffix == ".vcd":
        from isel_twin.trace.vcd import write_vcd

        write_vcd(path, twin.steps, recorder)
    else:
        from isel_twin.trace.parquet import write_parquet

        write_parquet(path, recorder)


@app.command
def run(
    job: Annotated[Path, Parameter(help='File of controller commands, one a line; "-" is standard input.')],
    /,
    *,
    machine: MachineName = "4030",
    controller: ControllerName = "imc-s8",
    plant: PlantName = "mujoco",
    seed: Seed = 0,
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

    A line is sent with a carriage return and its reply awaited. "# " begins a comment. <253> is the byte 253, <0.5s>
    lets time pass, and a line that ends in <...> gets no carriage return. So this starts a motion and stops it:
    `@0A8000,5000,0,30,0,30,0,30<13> <0.2s> <253>`

    Exit code 0 if every command was accepted ("0", or a longer answer to a query) and no step was lost, else 1.
    """
    from isel_twin.job import decode_job, parse_job, play
    from isel_twin.language import create_language

    _seconds("--interval", interval, 1e-9)
    _seconds("--timeout", timeout, 0.0)
    with _bad_call(job):
        language = create_language(controller)
        try:
            data = sys.stdin.buffer.read() if str(job) == STANDARD_INPUT else job.read_bytes()
            lines = parse_job(decode_job(data), language, controller)
        except ValueError as error:
            raise BadCall(f"{job}: {error}") from None
        if report is not None:
            _need_matplotlib()
    _check_writable(steps, vcd, trace, report, kept=(job, flash, scenario))
    with ExitStack() as stack:
        twin = _build(machine, controller, plant, seed, scenario, flash, line_speed=False)
        recorder = _recorder(twin, interval, stack) if vcd or trace or report else None
        show = _JsonOutput() if json else stack.enter_context(_TableOutput(twin, lines))
        results = []
        for result in play(twin, lines, timeout):
            show.result(result)
            results.append(result)
        summary = _summary(twin, results, controller=controller, plant=plant, seed=seed)
        with _bad_call():
            if steps is not None:
                from isel_twin.trace.npz import write_npz

                write_npz(steps, twin.steps)
            if recorder is not None and vcd is not None:
                from isel_twin.trace.vcd import write_vcd

                write_vcd(vcd, twin.steps, recorder)
            if recorder is not None and trace is not None:
                from isel_twin.trace.parquet import write_parquet

                write_parquet(trace, recorder)
            if recorder is not None and report is not None:
                from isel_twin.trace.report import write_report

                write_report(report, f"isel-twin: {job}", twin, recorder, results, summary)
        show.summary(summary)
    return 0 if summary["ok"] else 1


def _need_matplotlib() -> None:
    from importlib.util import find_spec

    if find_spec("matplotlib") is None:
        raise BadCall("--report needs matplotlib: pip install 'isel-twin[report]'")


SETTLE_S = 0.5
"""Virtual time for the machine to come to rest after the last command, before it is asked what it has lost."""


def _summary(twin: Twin, results: list[Result], **call: Any) -> dict[str, Any]:
    """The verdict on a job. Steps are lost in whole slips, so half of one is the limit; less is load angle.

    What was lost and then forgotten by a reference run counts too.
    """
    twin.run(SETTLE_S)
    lost, forgotten = twin.lost_steps, twin.forgotten_steps
    refused = sum(not result.ok for result in results)
    nothing_lost = bool((abs(lost) < twin.slip_steps / 2).all() and not forgotten.any())
    return {
        "ok": refused == 0 and nothing_lost and not twin.fault,
        "commands": len(results),
        "refused": refused,
        "lost_steps": [round(float(steps), 3) for steps in lost],
        "lost_before_reference": [int(steps) for steps in forgotten],
        "controller_fault": twin.fault,
        "steps": len(twin.steps),
        "counts": [int(count) for count in twin.counts],
        "position_mm": [round(float(position), 6) for position in twin.position_mm],
        "time_ns": twin.time_ns,
        "machine": twin.machine.name,
        **call,
    }


class _JsonOutput:
    """One line a command and one for the summary."""

    def result(self, result: Result) -> None:
        import dataclasses
        import json

        print(json.dumps(dataclasses.asdict(result)), flush=True)

    def summary(self, summary: dict[str, Any]) -> None:
        import json

        print(json.dumps({"summary": True, **summary}), flush=True)


WIDE = 160
"""Columns of a table that goes to a file or pipe."""


def _console() -> Console:
    from rich.console import Console

    console = Console()
    return console if console.is_terminal else Console(width=WIDE)


class _TableOutput:
    """A table on stdout, and on a terminal a progress line while the job runs."""

    def __init__(self, twin: Twin, lines: list[Line]) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Table

        self._console = _console()
        self._table = Table("line", "time / s", "command", "reply", "X / mm", "Y / mm", "Z / mm", box=None)
        for column in (0, 1, 4, 5, 6):
            self._table.columns[column].justify = "right"
        messages = Console(stderr=True)
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        self._progress = Progress(*columns, console=messages, transient=True, disable=not messages.is_terminal)
        self._task = self._progress.add_task("", total=len(lines))
        if messages.is_terminal:
            twin.observe(self._look, 1_000_000_000)

    def _look(self, twin: Twin) -> None:
        self._progress.update(self._task, description=f"{twin.time_ns / 1e9:.0f} s of machine time")

    def __enter__(self) -> _TableOutput:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def result(self, result: Result) -> None:
        from rich.markup import escape

        self._progress.advance(self._task)
        reply = escape(repr(result.reply)[1:-1])
        self._table.add_row(
            str(result.number),
            f"{result.time_ns / 1e9:.3f}",
            escape(result.command),
            reply if result.ok else f"[bold red]{reply or 'none'}[/]",
            *(f"{position:.3f}" for position in result.position_mm),
        )

    def summary(self, summary: dict[str, Any]) -> None:
        self._progress.stop()
        self._console.print(self._table)
        lost = ", ".join(f"{axis} {steps:g}" for axis, steps in zip("XYZA", summary["lost_steps"], strict=True))
        if any(summary["lost_before_reference"]):
            before = zip("XYZA", summary["lost_before_reference"], strict=True)
            lost += f" (and before a reference run: {', '.join(f'{axis} {steps}' for axis, steps in before if steps)})"
        if summary["controller_fault"]:
            lost += ", the controller shows an error"
        verdict = "[bold green]all well[/]" if summary["ok"] else "[bold red]not as it should be[/]"
        self._console.print(
            f"\n{verdict}: {summary['commands']} commands, {summary['refused']} refused, lost steps: {lost}, "
            f"{summary['time_ns'] / 1e9:.3f} s of machine time"
        )


@app.command
def machines() -> int:
    """List the machines that come with the package."""
    from isel_twin.machine import machine_names

    print("\n".join(machine_names()))
    return 0


@app.command
def controllers() -> int:
    """List the installed controllers."""
    from isel_twin.controller import controller_names

    print("\n".join(controller_names()))
    return 0


@app.command
def describe(name: Annotated[str, Parameter(help="Name of a machine or path of a machine folder.")]) -> int:
    """Show every parameter of a machine with value, unit, source and grade."""
    from rich.markup import escape
    from rich.table import Table

    with _bad_call():
        from isel_twin.machine import describe as rows_of
        from isel_twin.machine import load_machine

        rows = rows_of(load_machine(name))
    table = Table("parameter", "value", "unit", "grade", "source", box=None)
    table.columns[1].justify = "right"
    for row in rows:
        cells = (row.parameter, str(row.value), row.unit, row.grade, row.source)
        table.add_row(*(escape(str(cell)) for cell in cells))
    _console().print(table)
    return 0


@app.command
def motor(
    name: Annotated[str, Parameter(help="Type name of a motor, such as 23HS32-4004S.")],
    *,
    picture: Annotated[Path | None, Parameter(help="Draw the curve into a file (.png, .svg, .pdf).")] = None,
) -> int:
    """Show a motor's torque curve with its closed-form envelope."""
    from tempfile import TemporaryDirectory

    _check_writable(picture)
    with _bad_call(), TemporaryDirectory() as folder:
        from isel_twin.drives.report import show_motor
        from isel_twin.files import atomic_write

        drawn = Path(folder) / picture.name if picture is not None else None
        show_motor(name, picture=drawn)
        if picture is not None and drawn is not None:
            atomic_write(picture, drawn.read_bytes())
    return 0


if __name__ == "__main__":
    main()
