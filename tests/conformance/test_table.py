"""The conformance tables themselves: complete, and consistent with the tests."""

from __future__ import annotations

import re
import subprocess
import sys

import pytest
from conformance.record import Record, covers_folder
from conformance.report import collect, markdown
from conformance.rows import FOLDER, STATUS, Table, tables
from golden.conformance import Golden

TABLES = tables()
each_table = pytest.mark.parametrize("table", TABLES, ids=lambda table: table.name)


@pytest.fixture
def collected(request: pytest.FixtureRequest, record: Record) -> Record:
    """Which test shows which row: from this session if it has all tests of the folder, else collected anew."""
    return record if covers_folder(request.config, request.session.items) else collect()


@each_table
def test_rows_are_well_formed(table: Table) -> None:
    ids = [row.id for row in table.rows]
    assert len(set(ids)) == len(ids)
    for row in table.rows:
        assert row.id.startswith(f"{table.name}-{row.section}-"), row.id
        assert row.statement.strip().endswith("."), row.id
        assert STATUS.fullmatch(row.status), row.id
        if row.kind == "torn":
            assert len(set(row.places)) == 2, row.id
            assert row.follows in row.places, row.id
            assert row.against.endswith("."), row.id
        else:
            assert (row.places, row.against, row.follows) == ((), "", ""), row.id


@each_table
def test_every_command_of_the_overview_has_a_row(table: Table) -> None:
    """A row for each line of the manual's overview, in its chapter, and rows in the section the line points to."""
    sections = {row.section for row in table.rows}
    overview = " ".join(row.statement for row in table.rows if row.section == table.overview_chapter)
    for line in table.overview:
        assert line.section in sections, f"{line.command}: no row in section {line.section}"
        assert f"`{line.command}`" in overview, f"{line.command}: no row in the overview"


def test_no_test_names_an_unknown_row(collected: Record) -> None:
    known = {row.id for table in TABLES for row in table.rows}
    assert set(collected.tests) - known == set()


@each_table
def test_every_row_has_a_test(table: Table, collected: Record) -> None:
    assert [row.id for row in table.rows if not collected.tests.get(row.id)] == []


@each_table
@pytest.mark.verdict_on_table
def test_every_row_that_was_tried_holds(table: Table, record: Record) -> None:
    """Last in the session: a row whose tests were skipped, expected to fail or failing does not hold. Several workers
    have each tried some; `make conformance` tries all in one."""
    tried = [row.id for row in table.rows if row.id in record.outcomes]
    assert [row for row in tried if not record.holds(row)] == []


def test_the_page_names_every_row_and_its_tests(collected: Record) -> None:
    rows = [line.split(" | ") for line in markdown(collected).splitlines() if re.match(r"\| [\w.-]+-\d+ \|", line)]
    assert [cells[0].removeprefix("| ") for cells in rows] == [row.id for table in TABLES for row in table.rows]
    assert all("`test_" in cells[-1] for cells in rows)


def test_every_golden_session_has_its_test(request: pytest.FixtureRequest, golden: Golden) -> None:
    items = request.session.items
    if covers_folder(request.config, items) and not golden.update:
        assert golden.missing({f"{item.path.name}::{item.name}" for item in items}) == [], "run make golden"


def test_the_report_names_an_unknown_table() -> None:
    call = subprocess.run(
        [sys.executable, str(FOLDER / "report.py"), "nonesuch"], capture_output=True, text=True, check=False
    )
    assert call.returncode == 2
    assert "no table nonesuch" in call.stderr
