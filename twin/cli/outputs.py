"""Where results go: a table for people, JSON for programs, a recorder for traces."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from os import environ
from typing import TYPE_CHECKING, Any, Protocol

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.printable import shown, shown_line, unchanged
from isel_twin.base.units import SECOND_NS

if TYPE_CHECKING:
    from contextlib import ExitStack
    from pathlib import Path

    from rich.console import Console
    from rich.progress import Progress, ProgressColumn

    from isel_twin.core.twin import Twin
    from isel_twin.jobs.edge import Edge
    from isel_twin.jobs.job import Line
    from isel_twin.jobs.playing import Played
    from isel_twin.jobs.result import Result
    from isel_twin.jobs.robust import Repetition
    from isel_twin.jobs.toolpaths import Source
    from isel_twin.jobs.verdict import Verdict
    from isel_twin.recordings.recorder import Recorder

WIDE = 160  # columns of a table that goes to a file or pipe
MANY_SAMPLES = 10_000_000  # samples of a recorder that are reported, and every tenfold of it
# width of the columns of commands, replies (a position of four axes) and program blocks
LONG_COMMAND, LONG_REPLY, LONG_BLOCK = 56, 25, 100
HEAD = 1 << 16  # characters of a program that are searched for its longest block
MARGIN = 21  # width of the column of margins
NAME = 4  # characters before a block: the program's name
SHOWN_FACTORS = 3  # of a repetition
SHOWN_TRIALS = 5  # most repetitions shown that ended differently


def console() -> Console:
    """Standard output with the terminal's width or, without a terminal, WIDE."""
    from rich.console import Console

    here = Console()
    return here if here.is_terminal else Console(width=WIDE)


def terminals() -> tuple[Console, Console]:
    """Standard output and standard error for a progress bar, which puts streams of its own in their place."""
    from rich.console import Console

    return Console(file=unchanged(sys.stdout)), Console(file=unchanged(sys.stderr), stderr=True)


def _may_be_terminal() -> bool:
    """False if all goes to files or pipes: then rich, whose import takes longer than many a job, need not be asked."""
    asked = not {"FORCE_COLOR", "TTY_COMPATIBLE"}.isdisjoint(environ)
    return asked or any(stream is not None and stream.isatty() for stream in (sys.stdout, sys.stderr))


def progress(console: Console, time: type[ProgressColumn], wanted: bool = True, **more: Any) -> Progress:
    """A progress bar on a terminal that vanishes at the end. time: the column of time."""
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn

    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), time()
    disable = not (wanted and console.is_terminal)
    return Progress(*columns, console=console, transient=True, disable=disable, **more)


@contextmanager
def counted(what: str, total: int | None = None) -> Iterator[Callable[[int], None] | None]:
    """Shows on a terminal how many are done, by the function given, with the number; None without a terminal. total:
    None if nobody knows it."""
    if not _may_be_terminal():
        yield None
        return
    from rich.progress import TimeElapsedColumn

    out, messages = terminals()
    bar = progress(messages, TimeElapsedColumn, redirect_stdout=out.is_terminal, redirect_stderr=messages.is_terminal)
    task = bar.add_task(what, total=total)
    with bar:
        yield lambda number: bar.update(task, completed=number)


def many(number: int, what: str) -> str:
    """A number with its noun: 1 command, 2 commands."""
    return f"{number} {what}{'' if number == 1 else 's'}"


def say(text: str) -> None:
    """Print one line for the user on standard error."""
    print(f"isel-twin: {shown_line(text)}", file=sys.stderr, flush=True)


def say_json(told: object) -> None:
    """Print one line of JSON on standard output."""
    from json import dumps

    print(dumps(told), flush=True)


@contextmanager
def put_off(failures: list[CallError], path: Path | None) -> Iterator[None]:
    """Collect errors of writing for `tell`, so that one file does not prevent the others."""
    try:
        with call_errors(path):
            yield
    except CallError as failure:
        failures.append(failure)


def tell(failures: Sequence[CallError]) -> None:
    """Print the errors of writing, one line each, and raise the last one."""
    for failure in failures[:-1]:
        say(str(failure))
    if failures:
        raise failures[-1]


def record(twin: Twin, interval_s: float, stack: ExitStack) -> Recorder:
    """Record the twin every interval_s of virtual time until the stack is closed; reports very many samples."""
    from isel_twin.recordings.recorder import Recorder

    recorder = stack.enter_context(Recorder(twin, round(interval_s * SECOND_NS)))
    many = MANY_SAMPLES

    def look(_: Twin) -> None:
        nonlocal many
        if len(recorder) >= many:
            size = many * recorder.dtype.itemsize / 1e9
            say(f"trace: {many:,} samples so far ({size:.2g} GB); a longer --interval makes fewer")
            many *= 10

    twin.observe(look, round(interval_s * SECOND_NS) * max(1, MANY_SAMPLES // 1000))
    return recorder


class JobOutput(Protocol):
    """Shows a job as it runs."""

    def result(self, result: Result) -> None:
        """Show a finished line of the job."""

    def source(self, source: Source, results: Sequence[Result]) -> None:
        """Show what the file of a CAM program says that it takes, and what it has taken."""

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        """Show the verdict; `call`: further entries of the summary."""

    def edge(self, edges: Sequence[Edge]) -> None:
        """Show how far the job is from losing steps."""

    def robust(self, verdict: Verdict, trials: Sequence[Repetition], wanted: int) -> bool:
        """Show the repetitions, fewer than wanted if stopped; return whether all ended alike."""

    def uncertain(self, made: Played, trials: Sequence[Repetition], wanted: int) -> bool:
        """Show where the outcome lies, as far as the machine is known; otherwise as `robust`."""


class JsonOutput:
    """One line a command and one for the summary; one line for each repetition. What is found out after the summary
    comes in lines with all of the summary in them, too: the last one has everything."""

    def __init__(self) -> None:
        self._last: dict[str, Any] = {}  # what the last line has of those before
        self._source: dict[str, Any] = {}

    def result(self, result: Result) -> None:
        import dataclasses

        told = dataclasses.asdict(result)
        unknown = [name for name in told if name.endswith("_known")]
        unknown += [name for name in ("why", "event", "parts", "restarts", "disturbed", "astray") if not told[name]]
        if result.expected is None:
            unknown += ["expected", "condition"]
        say_json({key: value for key, value in told.items() if key not in unknown})

    def source(self, source: Source, results: Sequence[Result]) -> None:
        from isel_twin.jobs.toolpaths import compared

        self._source = {
            "job_file": {
                "format": source.title,
                "said_s": round(source.seconds, 3),
                "told": compared(source, results),
                "cautions": list(map(str, source.cautions)),
                **({} if source.zero is None else {"zero_mm": list(source.zero)}),
            }
        }

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        self._last = {"summary": True, **verdict.summary(), **call, **self._source}
        say_json(self._last)

    def edge(self, edges: Sequence[Edge]) -> None:
        from isel_twin.jobs.edge import told

        self._last |= told(edges)
        say_json(self._last)

    def robust(self, verdict: Verdict, trials: Sequence[Repetition], wanted: int) -> bool:
        frequency, rest = self._repeated(verdict, trials, wanted)
        self._last |= {"robust": frequency, **rest}
        say_json(self._last)
        return not rest["other"]

    def uncertain(self, made: Played, trials: Sequence[Repetition], wanted: int) -> bool:
        from isel_twin.jobs.uncertain import bands, coverage, whole

        frequency, rest = self._repeated(made.verdict, trials, wanted)
        found = [one.told() for one in bands(made.verdict, made.results, trials)]
        told = {**frequency, **rest, "coverage": round(coverage(len(whole(trials))), 3), "bands": found}
        self._last |= {"uncertain": told}
        say_json(self._last)
        return not rest["other"]

    def _repeated(
        self, verdict: Verdict, trials: Sequence[Repetition], wanted: int
    ) -> tuple[dict[str, Any], dict[str, Any]]:
        """A line for each repetition; how many lost, and how they ended."""
        from isel_twin.jobs.blame import separates
        from isel_twin.jobs.robust import agree, at_most, losses

        other = [trial for trial in trials if not agree(verdict, trial.verdict)]
        for trial in trials:
            factors = {name: round(factor, 4) for name, factor in trial.factors.items()}
            told = {"trial": trial.number, "agrees": trial not in other, "seed": trial.seed, "factors": factors}
            say_json({**told, **trial.verdict.summary()})
        lost, of = losses(trials)
        frequency = {"lost": lost, "of": of, "at_most": round(at_most(lost, of), 3)}
        sound = verdict.ok and not other and len(trials) == wanted
        return frequency, {"sound": sound, "other": len(other), "separates": separates(trials)}


class TableOutput:
    """A table on stdout with a row for each finished command, and a line of progress on a terminal. A context manager.

    line     time / s  command              reply                X / mm     Y / mm     Z / mm              margin
       3       12.345  @0P                  0003E80001F4...      50.000     25.000      0.000  71 % (66 to 75 %)

    Columns have fixed widths: a table fitted to its contents would have to wait for all rows.
    """

    heads = ("line", "time / s", "command", "reply")
    refused = "refused"

    def __init__(self, twin: Twin, lines: Sequence[Line]) -> None:
        longest = max((len(line.command) for line in lines), default=0)
        self._command = max(min(longest, LONG_COMMAND), len(self.heads[2]))
        head = next((line.source[:HEAD] for line in lines if line.program), "")
        blocks = (len(" ".join(block.split())) for block in head.splitlines())
        self._wide = max(self._command + 2 + LONG_REPLY, min(max(blocks, default=0), LONG_BLOCK) + NAME)
        number = len(str(lines[-1].number)) if lines else 0
        self._before = max(number, len(self.heads[0])) + 15  # columns of number and time
        self._terminal: Console | None = None
        self._progress: Progress | None = None
        if _may_be_terminal():
            self._show_progress(twin, len(lines))
        *beside, command, reply = self.heads
        heads = [f"{axis.upper()} / mm" for axis in CARRIAGES]
        self._row(*beside, self._words(command, reply), *heads, f"{'margin':>{MARGIN}}")

    def _show_progress(self, twin: Twin, total: int) -> None:
        from rich.progress import TimeElapsedColumn

        out, messages = terminals()
        self._terminal = out if out.is_terminal else None
        where = self._terminal or messages
        bar = progress(where, TimeElapsedColumn, redirect_stdout=False, redirect_stderr=messages.is_terminal)
        self._progress, task = bar, bar.add_task("", total=total)

        def look(twin: Twin) -> None:
            bar.update(task, description=f"{twin.time_ns / SECOND_NS:.0f} s of machine time")

        if where.is_terminal:
            twin.observe(look, SECOND_NS)

    def __enter__(self) -> TableOutput:
        if self._progress is not None:
            self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        if self._progress is not None:
            self._progress.stop()

    def result(self, result: Result) -> None:
        if self._progress is not None:
            self._progress.advance(self._progress.task_ids[0])
        blame = result.blame if result.reply and result.expected is None and not result.ok else ""
        self._row(
            str(result.number),
            f"{result.time_ns / SECOND_NS:.3f}",
            self._words(result.command, repr(result.reply if blame else result.shown_reply)[1:-1] or "none"),
            *(f"{position:.3f}" for position in result.position_mm),
            f"{result.margin_told:>{MARGIN}}",
            style="" if result.ok else "bold red",
        )
        if blame:
            self._print(f"{'':{self._before}}{blame}", "bold red")
        for part in result.parts:
            places = [f"{position:.3f}" for position in part.position_mm]
            said = "" if places else "bold red"
            text = " ".join(part.text.split())
            self._row("", f"{part.time_ns / SECOND_NS:.3f}", text if places else f"  {text}", *places, style=said)

    def source(self, source: Source, results: Sequence[Result]) -> None:
        from isel_twin.jobs.toolpaths import compared

        self.__exit__()
        self._print("")
        for caution in source.cautions:
            self._print(f"caution: {caution}")
        self._print(compared(source, results))

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        from isel_twin.jobs.verdict import NOT_SIMULATED

        self.__exit__()
        axes = [axis.upper() for axis in AXIS_NAMES]
        told = [self.counted(verdict), *verdict.problems(self.refused)]
        if verdict.physics and not any(verdict.lost) and None in verdict.following_error[: len(CARRIAGES)]:
            told.append("no steps lost")
        error = zip(axes, verdict.following_error, strict=False)
        lag = ", ".join(f"{axis} {round(e):g}" for axis, e in error if e is not None and round(e))
        told += [f"following error, increments: {lag}"] if lag else []
        told += [f"least torque margin: {verdict.margin_told}"] if verdict.margin_told else []
        if verdict.least_edge is not None:
            edge, axis, line = verdict.least_edge
            told.append(f"{axis.upper()}: unstable above {edge:.2f} times the speed of line {line}")
        told.append(f"{verdict.time_ns / SECOND_NS:.3f} s of machine time")
        told += [verdict.line_told] if verdict.line_told else []
        self._print("")
        style = "bold green" if verdict.ok else "bold red"
        for line, what in verdict.odd:
            self._print(f"remark: line {line}: {what}")
        self._print(f"{verdict.headline}: {', '.join(told)}", style=style)
        if not verdict.physics:
            self._print(f"{NOT_SIMULATED}; use --plant mujoco")

    def edge(self, edges: Sequence[Edge]) -> None:
        if not edges:
            self._print("edge: no motor turned, or no change that was tried loses a step")
        for axis in dict.fromkeys(edge.axis for edge in edges):
            own = [edge for edge in edges if edge.axis == axis]
            at = [
                f"{edge.factor:.2f} times the {edge.quantity} (line {edge.line})"
                for edge in own
                if edge.factor is not None
            ]
            never = [_not_up_to(edge) for edge in own if edge.factor is None]
            what = "its drive switches itself off" if any(edge.closed_loop for edge in own) else "steps are lost"
            lost = [f"{what} at {', '.join(at)}"] if at else []
            held = [f"none up to {', '.join(never)}"] if never else []
            seeds = many(max(edge.seeds for edge in own), "seed")
            self._print(f"edge of {axis.upper()}: {'; '.join([*lost, *held])}; tried on {seeds}")

    def counted(self, verdict: Verdict) -> str:
        """Number of commands and expectations."""
        expected = f", {many(verdict.expectations, 'expectation')}" if verdict.expectations else ""
        return f"{many(verdict.commands, 'command')}{expected}"

    def robust(self, verdict: Verdict, trials: Sequence[Repetition], wanted: int) -> bool:
        return self._repeated(verdict, trials, wanted, "robust", "fragile")

    def uncertain(self, made: Played, trials: Sequence[Repetition], wanted: int) -> bool:
        from isel_twin.jobs.uncertain import bands, coverage, whole

        found = bands(made.verdict, made.results, trials)
        if found:
            number = len(whole(trials))
            self._print(f"as far as this machine is known ({coverage(number):.0%} of {number} draws)")
        for one in found:
            self._print(f"  {one.in_words()}")
        return self._repeated(made.verdict, trials, wanted, "certain", "uncertain")

    def _repeated(
        self, verdict: Verdict, trials: Sequence[Repetition], wanted: int, sound: str, other_word: str
    ) -> bool:
        """Whether all ended alike, and if not, how the others did."""
        from isel_twin.jobs.blame import separates
        from isel_twin.jobs.robust import agree, at_most, losses

        other = [trial for trial in trials if not agree(verdict, trial.verdict)]
        lost, of = losses(trials)
        most = f"at most {100.0 * at_most(lost, of):.0f} % of such machines do (95 %)"
        part = f" ({len(trials) - of} more did not make the whole job)" if of < len(trials) else ""
        frequency = f"{lost} of {many(of, 'machine')}{part} lost steps: {most}"
        if not other and verdict.ok:
            stopped = "" if len(trials) == wanted else f", {wanted - len(trials)} more were not made"
            self._print(f"{'unfinished' if stopped else sound}: {frequency}{stopped}", style="bold green")
        elif not other:
            self._print(f"failed on every machine: all {len(trials)} ended alike", style="bold red")
        else:
            differently = f"{len(other)} of {many(len(trials), 'machine')} ended differently"
            self._print(f"{other_word}: {differently}; {frequency}", style="bold red")
        if (found := separates(trials)) is not None:
            unit = "of it fast" if found.key.endswith(".stage.kind") else "times its value"
            values = f"{found.lost:.3f} {unit} where steps were lost, else {found.held:.3f}, on average"
            self._print(f"  best told apart by {found.key}: {values} (by chance in {found.chance:.1%} of such studies)")
        elif 0 < lost < of:
            self._print("  nothing separates them: what was drawn differs no more than by chance")
        for trial in other[:SHOWN_TRIALS]:
            far = sorted(trial.factors.items(), key=lambda one: -_far(one[1]))
            changed = ", ".join(list(dict.fromkeys(_changed(*one) for one in far))[:SHOWN_FACTORS])
            ended = trial.verdict
            steps = zip(AXIS_NAMES, ended.lost_steps, ended.forgotten_steps, ended.lost, strict=False)
            told = ", ".join(f"{axis.upper()} {now + before:.0f}" for axis, now, before, is_lost in steps if is_lost)
            refused = f"{ended.refused} refused" if ended.refused else "nothing lost or refused"
            what = f"lost {told}" if told else refused
            self._print(f"  repetition {trial.number}: {what} (seed {trial.seed}; largest changes: {changed})")
        return not other

    def _row(self, number: str, time_s: str, words: str, *positions: str, style: str = "") -> None:
        """Print a row; words: both text columns."""
        places = "".join(f"{position:>11}" for position in positions)
        row = f"{number:>{self._before - 15}} {time_s:>12}  "
        self._print(f"{row}{words:<{self._wide}}{places}", style)

    def _words(self, command: str, reply: str) -> str:
        return f"{command:<{self._command}}  {reply}"

    def _print(self, text: str, style: str = "") -> None:
        if self._terminal is None:
            print(text, flush=True)
        else:
            from rich.text import Text

            self._terminal.print(Text(shown(text), style), soft_wrap=True)


class MotionsOutput(TableOutput):
    """Shows the motions of a capture, in steps, and the switches they strike."""

    heads = ("motion", "time / s", "steps", "struck")
    refused = "struck a switch"

    def counted(self, verdict: Verdict) -> str:
        return many(verdict.commands, "motion")


def _not_up_to(edge: Edge) -> str:
    """The factor up to which a job was made without a loss, and why not farther."""
    return f"{edge.tried:.3g} times the {edge.quantity}{edge.ends and f' (beyond, {edge.ends})'}"


def _changed(name: str, factor: float) -> str:
    """A drawn number in words; the decay of the stages, which is one on all axes, by its name."""
    if name.endswith(".stage.kind"):
        return "stages with fast decay" if factor == 1.0 else f"stages with mixed decay, {factor:.0%} of it fast"
    return f"{name} {100.0 * (factor - 1.0):+.0f} %"


def _far(factor: float) -> float:
    """How far a factor is from 1, the same for twice and half; a change of sign is farthest."""
    return abs(math.log(factor)) if factor > 0.0 else math.inf
