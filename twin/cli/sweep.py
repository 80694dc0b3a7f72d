"""`isel-twin sweep`: a table of a job's outcomes while machine, settings, job, scenario and seed vary."""

from __future__ import annotations

import dataclasses
import functools
import os
from collections.abc import Sequence
from contextlib import ExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from isel_twin.base.errors import CallError, call_errors
from isel_twin.cli import outputs
from isel_twin.cli.interruption import interruption
from isel_twin.cli.jobs import say_cautions, say_zero
from isel_twin.cli.options import (
    AS_IT_LOOKS,
    PICTURE,
    CamOptions,
    Cluster,
    Whole,
    check_one_crew,
    check_workers,
    check_writable,
    crew_of,
    is_standard_input,
    written,
)

if TYPE_CHECKING:
    from isel_twin.base.crew import Crew
    from isel_twin.many.studies.plan import Plan
    from isel_twin.many.studies.row import Point
    from isel_twin.many.studies.sensitivity import Index
    from isel_twin.many.studies.table import Table

MOST_GROUPS = 12  # most values of a parameter that are listed


def sweep(
    plan: Annotated[Path, Parameter(help="What stays the same and what varies (TOML), see docs/sweeps.md.")],
    /,
    *,
    out: Annotated[
        Path | None,
        written("The table (Parquet). PLAN.parquet beside the plan.", ".parquet", bare=True, name=("--out", "-o")),
    ] = None,
    workers: Annotated[
        Whole | None, Parameter(help="Number of processes; without it as many as there are processors.")
    ] = None,
    cluster: Cluster = None,
    cam: CamOptions = AS_IT_LOOKS,
    sensitivity: Annotated[
        Path | None, written("Write a picture of what the outcome depends on (.png, .svg, .pdf).", *PICTURE)
    ] = None,
    json: Annotated[bool, Parameter(help="One line of JSON a row as it comes, and one for all.")] = False,
) -> int:
    """Repeat a job with varying parameters of machine, settings, job and scenario, and make a table of the outcomes.

    Rows go to the table as they come. Called again, it makes only the missing rows: after Ctrl-C or a crash, and after
    values, samples or seeds were added to the plan.

    Exit code 0 if the table is complete, whatever its rows say; 1 if a row could not be computed, or is missing; 2 for
    a call that cannot be carried out.
    """
    if is_standard_input(plan):
        raise CallError("-: a job stands beside its plan; name a file")
    if workers is not None:
        check_workers(workers)
    check_one_crew(workers, cluster)
    from isel_twin.many.studies.plan import load_plan
    from isel_twin.many.studies.points import points
    from isel_twin.many.studies.table import Table, journal_of

    with call_errors(plan):
        read = load_plan(plan, cam.reading())
        wanted = points(read)
    file = out if out is not None else plan.with_suffix(".parquet")
    job = plan.parent / read.work.job_name
    say_zero(job, cam.reading(), None if read.source is None else read.source.zero)
    say_cautions(job, () if read.source is None else read.source.cautions)
    if sensitivity is not None:
        from isel_twin.many.studies.sensitivity import check

        check(read)
    check_writable(file, journal_of(file), sensitivity, kept=(plan, read.call.scenario))
    _try_out(read)
    with Table(file, read, wanted) as table:
        code = _fill(table, read, _crew(workers, cluster, len(table.missing())), json)
    rows = [table.rows[point.id] for point in wanted if point.id in table.rows]
    _tell(read, rows, len(wanted), file, json)
    if code:
        return code
    if sensitivity is not None:
        from isel_twin.many.studies.sensitivity import draw, indices

        found = indices(read, rows)
        with call_errors(sensitivity):
            draw(sensitivity, read, rows, found)
        _tell_indices(found, sensitivity, json)
    return 1 if len(rows) < len(wanted) or any(row["error"] is not None for row in rows) else 0


def _crew(workers: int | None, address: str | None, missing: int) -> Crew:
    affinity = getattr(os, "sched_getaffinity", None)  # processors that this process may use; not on every system
    processors = len(affinity(0)) if affinity is not None else os.cpu_count() or 1
    return crew_of(max(1, min(workers or processors, missing)), address)


def _try_out(plan: Plan) -> None:
    """Check scenario and job before a long sweep. Raises CallError."""
    twin = plan.call.with_(plant="kinematic").build()
    names = {switch.name for switch in twin.machine.switches} | {"all"}
    if unknown := sorted(set(plan.work.bounds.may_strike) - names):
        raise CallError(f"{plan.file}: sweep.may_strike: {unknown[0]!r}; allowed: {', '.join(sorted(names))}")


def _fill(table: Table, plan: Plan, crew: Crew, json: bool) -> int:
    """Make the missing rows; return an exit code if stopped, else 0."""
    from isel_twin.base.crew import Lost, MismatchError, finished
    from isel_twin.many.studies.row import compute

    missing = table.missing()
    had = len(table.rows)
    if had and missing and not json:
        outputs.say(f"{table.file}: continues after {had} rows; {len(missing)} are missing")
    why = ""
    with ExitStack() as stack:
        shown = stack.enter_context(_Progress(len(missing) + had, had, json))
        stopped = stack.enter_context(interruption())
        work = functools.partial(compute, plan.work)
        try:
            for index, outcome in finished(work, missing, crew, lambda: bool(stopped)):
                if isinstance(outcome, Lost):
                    why = why or outcome.why
                else:
                    shown.row(table.add(missing[index], outcome))
        except BrokenPipeError:  # the reader of the rows is gone
            raise
        except (MismatchError, OSError, CallError) as error:
            if isinstance(error, CallError) and error.option:
                raise
            raise CallError(f"{error}; {_resume(table, missing)}") from error
    if stopped:
        outputs.say(f"{table.file}: interrupted; {_resume(table, missing)}")
        return 128 + stopped[0]
    if why:
        outputs.say(f"{table.file}: {why}; {_resume(table, missing)}")
    return 0


def _resume(table: Table, missing: Sequence[Point]) -> str:
    left = sum(point.id not in table.rows for point in missing)
    return f"{len(table.rows)} rows are in the table, {left} are missing; the same call goes on from there"


class _Progress:
    """A bar with the time left on a terminal; with --json the rows. A context manager."""

    def __init__(self, total: int, had: int, json: bool) -> None:
        from rich.progress import TimeRemainingColumn

        self._json = json
        _, messages = outputs.terminals()
        self._bar = outputs.progress(messages, TimeRemainingColumn, wanted=not json, speed_estimate_period=600.0)
        self._task = self._bar.add_task("rows", total=total, completed=had)
        self._failed = 0

    def __enter__(self) -> _Progress:
        self._bar.start()
        return self

    def __exit__(self, *_: object) -> None:
        self._bar.stop()

    def row(self, row: dict[str, Any]) -> None:
        self._failed += row["ok"] is not True
        self._bar.update(self._task, advance=1, description=f"rows, {self._failed} failed")
        if self._json:
            outputs.say_json(row)


def _tell(plan: Plan, rows: Sequence[dict[str, Any]], wanted: int, file: Path, json: bool) -> None:
    """Print the number of failed rows: of all, and for each value of a parameter."""
    failed = [row for row in rows if row["ok"] is False]
    errors = [row for row in rows if row["error"] is not None]
    if json:
        counts = {"rows": len(rows), "ok": len(rows) - len(failed) - len(errors), "failed": len(failed)}
        more = {"errors": len(errors), "missing": wanted - len(rows), "table": str(file)}
        outputs.say_json({"summary": True, **counts, **more})
        return
    print(f"{file}: {len(rows)} of {wanted} rows, {_share(len(failed), len(rows) - len(errors))} failed")
    if not any(row["margin"] is not None for row in rows):
        from isel_twin.jobs.verdict import NOT_SIMULATED

        print(f'  {NOT_SIMULATED}; use plant = "mujoco"')
    if errors:
        print(f"  {len(errors)} could not be computed, the first: {errors[0]['error']}")
    for name in (parameter.name for parameter in plan.parameters if not parameter.sampled):
        by_value: dict[Any, list[dict[str, Any]]] = {}
        for row in rows:
            if row["error"] is None:
                by_value.setdefault(row[name], []).append(row)
        if not 1 < len(by_value) <= MOST_GROUPS:
            continue
        width = max(len(_shown(value)) for value in by_value)
        for value, some in by_value.items():
            bad = [row for row in some if row["ok"] is False]
            rules = _counted([rule for row in bad for rule in row["failure"].split()])
            print(f"  {name} = {_shown(value):<{width}}  {_share(len(bad), len(some))} failed{rules}")


def _tell_indices(found: Sequence[Index], picture: Path, json: bool) -> None:
    """Print the sensitivity of each outcome, the largest first."""
    if json:
        told = [dataclasses.asdict(index) for index in found]
        outputs.say_json({"sensitivity": told, "picture": str(picture)})
        return
    print(f"{picture}: what the outcome depends on (part of the variance)")
    for outcome in dict.fromkeys(index.outcome for index in found):
        some = sorted((i for i in found if i.outcome == outcome), key=lambda i: -max(i.first, i.total or 0.0))
        each = [
            f"{i.parameter} {i.first:.2f}" + ("" if i.total is None else f" (with others {i.total:.2f})") for i in some
        ]
        print(f"  {outcome}: {', '.join(each)}")


def _shown(value: Any) -> str:
    return repr(value) if isinstance(value, str) else f"{value:g}" if isinstance(value, float) else str(value)


def _counted(words: Sequence[str]) -> str:
    counts = {word: words.count(word) for word in dict.fromkeys(words)}
    return f" ({', '.join(f'{word} {count}' for word, count in counts.items())})" if counts else ""


def _share(bad: int, total: int) -> str:
    """`bad` of `total`, with the 95 % interval of the true fraction (E. B. Wilson, 1927)."""
    if not total:
        return "0"
    from isel_twin.many.studies import wilson

    low, high = wilson(bad, total)
    return f"{bad} of {total} ({100.0 * bad / total:.0f} %, {100.0 * low:.0f} to {100.0 * high:.0f} %)"
