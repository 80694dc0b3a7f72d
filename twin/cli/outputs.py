"""Where results go: a table for people, JSON for programs, a recorder for traces."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol

from isel_twin.axes import AXIS_NAMES, CARRIAGES
from isel_twin.units import SECOND_NS

if TYPE_CHECKING:
    from contextlib import ExitStack

    from rich.console import Console

    from isel_twin.job import Line, Result
    from isel_twin.trace.recorder import Recorder
    from isel_twin.twin import Twin
    from isel_twin.verdict import Verdict

WIDE = 160
"""Columns of a table that goes to a file or pipe."""


def console() -> Console:
    """Standard output, as wide as it is or, if it is no terminal, WIDE."""
    from rich.console import Console

    here = Console()
    return here if here.is_terminal else Console(width=WIDE)


def record(twin: Twin, interval_s: float, stack: ExitStack) -> Recorder:
    """Samples of the twin every interval_s of virtual time, kept until the stack is unwound."""
    from isel_twin.trace.recorder import Recorder

    return stack.enter_context(Recorder(twin, round(interval_s * SECOND_NS)))


class JobOutput(Protocol):
    """Shows a job as it runs."""

    def result(self, result: Result) -> None:
        """A line of the job is over."""

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        """So is the job; `call`: what else belongs to its summary."""


class JsonOutput:
    """One line a command and one for the summary."""

    def result(self, result: Result) -> None:
        """See JobOutput."""
        import dataclasses
        import json

        print(json.dumps(dataclasses.asdict(result)), flush=True)

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        """See JobOutput."""
        import json

        print(json.dumps({"summary": True, **verdict.summary(), **call}), flush=True)


class TableOutput:
    """A table on stdout, and on a terminal a progress line while the job runs. Use it as a context manager."""

    def __init__(self, twin: Twin, lines: Sequence[Line]) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeElapsedColumn
        from rich.table import Table

        self._console = console()
        positions = (f"{axis.upper()} / mm" for axis in CARRIAGES)
        self._table = Table("line", "time / s", "command", "reply", *positions, box=None)
        for column in (0, 1, 4, 5, 6):
            self._table.columns[column].justify = "right"
        messages = Console(stderr=True)
        columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), TimeElapsedColumn()
        self._progress = Progress(*columns, console=messages, transient=True, disable=not messages.is_terminal)
        self._task = self._progress.add_task("", total=len(lines))
        if messages.is_terminal:
            twin.observe(self._look, SECOND_NS)

    def _look(self, twin: Twin) -> None:
        self._progress.update(self._task, description=f"{twin.time_ns / SECOND_NS:.0f} s of machine time")

    def __enter__(self) -> TableOutput:
        self._progress.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._progress.stop()

    def result(self, result: Result) -> None:
        """See JobOutput."""
        from rich.markup import escape

        self._progress.advance(self._task)
        reply = escape(repr(result.reply)[1:-1])
        self._table.add_row(
            str(result.number),
            f"{result.time_ns / SECOND_NS:.3f}",
            escape(result.command),
            reply if result.ok else f"[bold red]{reply or 'none'}[/]",
            *(f"{position:.3f}" for position in result.position_mm),
        )

    def verdict(self, verdict: Verdict, call: Mapping[str, Any]) -> None:
        """See JobOutput."""
        self._progress.stop()
        self._console.print(self._table)
        axes = [axis.upper() for axis in AXIS_NAMES]
        lost = ", ".join(f"{axis} {round(steps, 3):g}" for axis, steps in zip(axes, verdict.lost_steps, strict=False))
        if any(verdict.forgotten_steps):
            before = zip(axes, verdict.forgotten_steps, strict=False)
            lost += f" (and before a reference run: {', '.join(f'{axis} {int(n)}' for axis, n in before if n)})"
        if verdict.controller_fault:
            lost += ", the controller shows an error"
        words = "[bold green]all well[/]" if verdict.ok else "[bold red]not as it should be[/]"
        self._console.print(
            f"\n{words}: {verdict.commands} commands, {verdict.refused} refused, lost steps: {lost}, "
            f"{verdict.time_ns / SECOND_NS:.3f} s of machine time"
        )
