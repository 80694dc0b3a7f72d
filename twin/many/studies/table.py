"""The table of a sweep: one Parquet file that is always complete, and a journal of rows that are not in it yet
(many/1).

    new row   ->  sweep.parquet.journal   a line of JSON, written at once
                        | now and then, and at the end
                        v
                  sweep.parquet      rewritten, sorted by row, and renamed over the old one

A killed process loses no row: the next call reads both, and a row in both counts once. Other readers (DuckDB, polars)
always find a complete file, at most a sixteenth of its rows behind. Rows are sorted and depend on their points alone,
so the finished file is the same, byte for byte, whatever computed the rows in any order.

The metadata of each column have `key`, `unit` ("1": a count; none for text) and `description`.
"""

from __future__ import annotations

import json
import logging
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

from isel_twin.base.errors import CallError, call_errors
from isel_twin.base.files import Claim, appending, replacing
from isel_twin.base.parameters import parse_json
from isel_twin.many.studies.row import OUTCOMES, Point
from isel_twin.version import VERSION

if TYPE_CHECKING:
    import pyarrow as pa

    from isel_twin.many.studies.plan import Plan

log = logging.getLogger("isel_twin")

MOST_WAITING = 10_000  # most rows in the journal
PART_WAITING = 16  # and at most one in this many rows of the table


def journal_of(file: Path) -> Path:
    return file.with_name(f"{file.name}.journal")


class Table:
    """The table of a plan in a file that this process owns until `close`. A context manager. Raises CallError if the
    file is in use, is no table of a sweep, or has rows of another plan."""

    def __init__(self, file: Path, plan: Plan, points: Sequence[Point]) -> None:
        _need_pyarrow()
        self.file = file
        self.rows: dict[str, dict[str, Any]] = {}  # by id of the point
        self._points = {point.id: point for point in points}
        self._plan = plan
        self._schema = _schema(plan)
        self._waiting = 0
        with call_errors(file):
            self._claim = Claim(file)
            try:
                self._take_in()
                self._write()
                self._journal = appending(journal_of(file))  # also after it was emptied
                self._journal.truncate(0)
            except BaseException:
                self._claim.release()
                raise

    def __enter__(self) -> Table:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def missing(self) -> list[Point]:
        """Points without a row, in their order."""
        return [point for point in self._points.values() if point.id not in self.rows]

    def add(self, point: Point, outcome: Mapping[str, Any]) -> dict[str, Any]:
        """Store a row and return it as in the table. Raises CallError."""
        row = self._row(point, outcome)
        self.rows[point.id] = row
        self._waiting += 1
        with call_errors(self.file):
            self._journal.write(json.dumps(row) + "\n")
            self._journal.flush()
            if self._waiting >= min(MOST_WAITING, max(1, len(self.rows) // PART_WAITING)):
                self._write()
                self._journal.truncate(0)
        return row

    def close(self) -> None:
        """Write waiting rows and release the file; one without rows is removed. May be called again. Raises
        CallError."""
        if self._journal.closed:
            return
        try:
            with call_errors(self.file):
                if self._waiting:
                    self._write()
                self._journal.close()
                journal_of(self.file).unlink(missing_ok=True)
                if not self.rows:
                    self.file.unlink(missing_ok=True)
        finally:
            with suppress(OSError):  # of the rest of a full disk
                self._journal.close()
            self._claim.release()

    def _row(self, point: Point, outcome: Mapping[str, Any]) -> dict[str, Any]:
        given = {parameter.name: value for parameter, value in zip(self._plan.parameters, point.values, strict=True)}
        return {"row": point.number, "point": point.id, **given, "seed": point.seed, **outcome}

    def _take_in(self) -> None:
        """Read the rows of an earlier call."""
        found: dict[str, Mapping[str, Any]] = {}
        if self.file.exists():
            found |= {row["point"]: row for row in read_rows(self.file)}
        waiting, damaged = journal_of(self.file), 0
        if waiting.exists():
            for line in waiting.read_bytes().split(b"\n")[:-1]:  # the last line may be incomplete
                if (computed := _journal_row(line)) is not None:
                    found[computed["point"]] = computed
                else:
                    damaged += 1
            if damaged:  # as after a power cut
                log.warning("%s: %d damaged lines are left out; their rows are computed again", waiting, damaged)
        if strange := sum(point not in self._points for point in found):
            raise CallError(
                f"{self.file}: {strange} of {len(found)} rows are not of this plan: job, machine, scenario, values "
                f"or the version have been changed; undo that, or name another file with --out"
            )
        for point, row in found.items():
            outcome = {name: row[name] for name in OUTCOMES}
            self.rows[point] = self._row(self._points[point], outcome)

    def _write(self) -> None:
        import pyarrow as pa
        import pyarrow.parquet as pq

        rows = sorted(self.rows.values(), key=lambda row: row["row"])
        columns = [[row[name] for row in rows] for name in self._schema.names]
        arrays = [pa.array(column, kind) for column, kind in zip(columns, self._schema.types, strict=True)]
        with replacing(self.file) as file:
            pq.write_table(pa.table(arrays, schema=self._schema), file, compression="zstd")
        self._waiting = 0


def _journal_row(line: bytes) -> dict[str, Any] | None:
    """The row in a line of a journal; None if it is damaged."""
    try:
        row: dict[str, Any] = parse_json(line)
        whole = isinstance(row["point"], str) and all(
            row[name] is None or _fits(row[name], kind) for name, (kind, *_) in OUTCOMES.items()
        )
    except (ValueError, TypeError, KeyError):
        return None
    return row if whole else None


def _fits(value: Any, kind: str) -> bool:
    """True for a value of a column of this kind."""
    match kind:
        case "bool":
            return type(value) is bool
        case "int64":
            return type(value) is int and -(2**63) <= value < 2**63
        case "float64":
            return type(value) is float or (type(value) is int and abs(value) <= 2**53)
    return isinstance(value, str) and value == value.encode("utf-8", "replace").decode()  # no half of a character


def read_rows(file: Path) -> list[dict[str, Any]]:
    """The rows of a table. Raises CallError for another file, OSError."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        found = pq.read_table(file)
    except (pa.ArrowException, OSError, ValueError) as error:
        if isinstance(error, OSError) and error.errno is not None:  # Arrow's own have none
            raise
        raise CallError(f"{file}: is no Parquet file; name another one with --out") from error
    if not {"row", "point", *OUTCOMES} <= set(found.column_names):
        raise CallError(f"{file}: is no table of a sweep; name another file with --out")
    rows: list[dict[str, Any]] = found.to_pylist()
    return rows


def _need_pyarrow() -> None:
    try:
        import pyarrow  # noqa: F401
    except ImportError:
        raise CallError("a table needs pyarrow: pip install 'isel-twin[tune]'") from None


def _schema(plan: Plan) -> pa.Schema:
    import pyarrow as pa

    kinds = {"bool": pa.bool_(), "int64": pa.int64(), "float64": pa.float64(), "string": pa.string()}
    described: list[tuple[str, str, Mapping[str, str]]] = [
        ("row", "int64", {"unit": "1", "description": "number of the row in the plan, from 1"}),
        ("point", "string", {"description": "digest of all that the row depends on"}),
    ]
    for parameter in plan.parameters:
        told = {"key": f"{parameter.section}.{parameter.key}", "description": "what varies"}
        described.append((parameter.name, parameter.kind, told | _unit(parameter.unit, parameter.kind)))
    described.append(("seed", "int64", {"unit": "1", "description": "of power-on positions, switch scatter, bounce"}))
    for name, (kind, unit, text) in OUTCOMES.items():
        described.append((name, kind, {"description": text, **_unit(unit, kind)}))
    fields = [pa.field(name, kinds[kind]).with_metadata(told) for name, kind, told in described]
    return pa.schema(fields, metadata={"creator": f"isel-twin {VERSION}", "plan": plan.text})


def _unit(unit: str, kind: str) -> dict[str, str]:
    return {"unit": unit or "1"} if kind in ("int64", "float64") else {}
