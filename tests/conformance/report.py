"""Run the conformance tests, print their tables and write them to build/conformance.md (make conformance).

python tests/conformance/report.py [TABLE ...]     run, print, write; exit 1 if any row does not hold
python tests/conformance/report.py --write         only write them (collects, runs nothing)
"""

from __future__ import annotations

import argparse
import contextlib
import io
import sys
from collections import Counter
from pathlib import Path

import pytest
from rich.console import Console
from rich.table import Table as RichTable

sys.path.insert(0, str(Path(__file__).resolve().parent.parent))

from conformance.record import Record
from conformance.rows import FOLDER, Table, tables

DOCUMENT = FOLDER.parent.parent / "build" / "conformance.md"


def collect() -> Record:
    """Which test shows which row, without running anything."""
    record = Record()
    with contextlib.redirect_stdout(io.StringIO()):
        pytest.main([str(FOLDER), "--collect-only", "-q"], plugins=[record])
    return record


def run(names: list[str]) -> Record:
    """Run the tests of these tables."""
    record = Record()
    files = [str(path) for name in names for path in sorted(FOLDER.glob(f"test_{name}_*.py"))]
    pytest.main([*files, "-q", "--no-header", "--tb=line", "-rN"], plugins=[record])
    return record


def markdown(record: Record) -> str:
    """The tables as a page: a summary, then every row with the tests that show it."""
    lines = [
        "# Conformance",
        "",
        "| table | rows | hold | torn | deviate | not on this machine | commands of the overview |",
        "|---|---|---|---|---|---|---|",
    ]
    for table in tables():
        kinds = Counter(row.kind for row in table.rows)
        counts = (kinds[kind] for kind in ("holds", "torn", "deviates", "not on this machine"))
        columns = (table.title, len(table.rows), *counts, len(table.overview))
        lines.append(f"| {' | '.join(map(str, columns))} |")
    for table in tables():
        lines += ["", f"## {table.title}", "", f"Source: {table.manual}."]
        for number, title in table.sections.items():
            lines += ["", f"### {number} {title}", "", "| row | statement | status | shown by |", "|---|---|---|---|"]
            for row in table.rows:
                if row.section == number:
                    names = ", ".join(f"`{name}`" for name in sorted(record.tests.get(row.id, [])))
                    lines.append(f"| {row.id} | {row.manual.replace('|', '/')} | {row.status} | {names} |")
    return "\n".join(lines) + "\n"


def write(record: Record) -> None:
    """Write the page of all tables."""
    DOCUMENT.parent.mkdir(exist_ok=True)
    DOCUMENT.write_text(markdown(record), encoding="utf-8")
    print(f"all tables: {DOCUMENT.relative_to(FOLDER.parent.parent)}")


def print_table(table: Table, record: Record, console: Console) -> int:
    """Print one table; return how many of its rows do not hold."""
    shown = RichTable(title=f"{table.title}: {table.manual}", title_justify="left")
    for column in ("row", "statement", "status", "shown by", "result"):
        shown.add_column(column, overflow="fold")
    failing = 0
    for row in table.rows:
        good = record.holds(row.id)
        failing += not good
        result = "[green]holds[/green]" if good else "[bold red]FAILS[/bold red]"
        shown.add_row(row.id, row.manual, row.status, "\n".join(record.tests.get(row.id, [])), result)
    console.print(shown)
    console.print(f"{table.title}: {len(table.rows)} rows, {failing} failing\n")
    return failing


def main() -> int:
    """Command line; see the module."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("table", nargs="*", help="tables to print (default: all)")
    parser.add_argument("--write", action="store_true", help="write the tables, run nothing")
    arguments = parser.parse_args()
    if arguments.write:
        write(collect())
        return 0
    known = {table.name: table for table in tables()}
    unknown = [name for name in arguments.table if name not in known]
    if unknown:
        parser.error(f"no table {', '.join(unknown)}; there are: {', '.join(known)}")
    names = arguments.table or list(known)
    record = run(names)
    console = Console(width=None if sys.stdout.isatty() else 160)
    failing = [print_table(known[name], record, console) for name in names]
    if not arguments.table:
        write(record)
    return 1 if sum(failing) else 0


if __name__ == "__main__":
    sys.exit(main())
