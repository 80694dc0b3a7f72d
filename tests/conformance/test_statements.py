"""No statement is bent until it holds: those that ever did not hold are kept in not_held.txt, as they were.

A row that holds says one of the statements it had when it did not hold, or names the decision for its new one
(`turned`, rows.py). New lines are added by hand; no line is ever taken away.
"""

from __future__ import annotations

import re
import subprocess
from collections.abc import Iterable

from conformance.rows import FOLDER, Row, tables

ROWS = {row.id: row for table in tables() for row in table.rows}
NOT_HELD = FOLDER / "not_held.txt"
_ADDED = re.compile(r'^\+ *\{ id = "([^"]+)", statement = "([^"]+)", (?:.*, )?status = "(?!holds)', re.M)
_CITATION = re.compile(r" \([a-z0-9]+/\d+\)")


def plain(statement: str) -> str:
    """A statement without the decision it cites."""
    return _CITATION.sub("", statement)


def kept() -> dict[str, set[str]]:
    """Row -> statements that did not hold."""
    statements: dict[str, set[str]] = {}
    for line in NOT_HELD.read_text(encoding="utf-8").splitlines():
        row, _, statement = line.partition(" ")
        statements.setdefault(row, set()).add(statement)
    return statements


def committed() -> Iterable[tuple[str, str]]:
    """Row and statement of all that any commit had and that did not hold; none where there is no history."""
    call = ["git", "-C", str(FOLDER), "log", "-p", "--unified=0", "--format=", "--", "*.toml"]
    try:
        history = subprocess.run(call, capture_output=True, text=True, encoding="utf-8", check=True).stdout
    except (OSError, subprocess.CalledProcessError):
        return []
    return _ADDED.findall(history)


def unnamed(rows: Iterable[Row], statements: dict[str, set[str]]) -> list[str]:
    """Rows that hold with a statement which is none of those that did not, and that name no decision for it."""
    said = [(row, plain(row.statement)) for row in rows if row.kind == "holds" and not row.turned]
    return [row.id for row, statement in said if statement not in statements.get(row.id, [statement])]


def test_a_row_that_begins_to_hold_with_another_statement_names_its_decision() -> None:
    assert unnamed(ROWS.values(), kept()) == []


def test_a_statement_that_is_turned_into_its_opposite_is_found() -> None:
    was = {"imc-1-1": {"Red comes before green."}}
    turned = Row("imc-1-1", "1", "Green comes before red (imc/7).", "holds")
    assert unnamed([turned], was) == ["imc-1-1"]
    assert unnamed([Row("imc-1-1", "1", "Green comes before red.", "holds", turned="imc/7")], was) == []
    assert unnamed([Row("imc-1-1", "1", "Red comes before green (imc/7).", "holds")], was) == []
    assert unnamed([Row("imc-1-2", "1", "Green comes before red.", "holds")], was) == []


def test_every_statement_that_did_not_hold_is_kept() -> None:
    """Of the tables as they are, and as any commit has had them: add the lines that are missing to not_held.txt."""
    seen = {(row.id, plain(row.statement)) for row in ROWS.values() if row.kind != "holds"}
    seen |= {(row, plain(statement)) for row, statement in committed()}
    statements = kept()
    assert sorted(f"{row} {text}" for row, text in seen if text not in statements.get(row, set())) == []


def test_no_row_that_did_not_hold_is_taken_out() -> None:
    assert sorted(kept().keys() - ROWS.keys()) == []


def test_turned_names_a_decision() -> None:
    """Only rows that once did not hold have it; tests/test_decisions.py looks whether the decision exists."""
    turned = [row for row in ROWS.values() if row.turned]
    assert [row.id for row in turned if not re.fullmatch(r"[a-z0-9]+/\d+", row.turned) or row.id not in kept()] == []
