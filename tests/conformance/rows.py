"""Conformance tables: one row for every statement of a manual that a host can observe.

A table is a TOML file of this folder, `<controller>.toml`; which test shows which row stands at the test, nowhere else:

    [table]                                       @shows("imc-2.2.1-1")
    title = "iMC"                                 def test_...():
    manual = "programming manual, edition ..."
    overview_chapter = "1"                        # where the manual's overview is; 1 unless said

    [[overview]]                                  # a line of the manual's overview of commands
    command = "@0a"
    section = "2.2.2"

    [[section]]
    number = "2.2.1"
    title = "Set the number of axes"
    rows = [
      { id = "imc-2.2.1-1", statement = "...", status = "holds" },
      { id = "imc-2.2.1-2", statement = "...", status = "deviates: imc/7" },      # docs/decisions/imc.md
    ]
"""

from __future__ import annotations

import tomllib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent


@dataclass(frozen=True)
class Row:
    """A statement of the manual in our words; `status` is "holds", "deviates: <decision>", or "not on this machine:
    <decision>" for axes, ports and units that a gantry of three axes has not: they are refused or have no effect."""

    id: str
    section: str
    statement: str
    status: str


@dataclass(frozen=True)
class Overview:
    """A line of the manual's overview: a command and the section that describes it."""

    command: str
    section: str


@dataclass(frozen=True)
class Table:
    """All rows of one controller, in the order of its manual."""

    name: str
    title: str
    manual: str
    rows: tuple[Row, ...]
    overview: tuple[Overview, ...]
    overview_chapter: str
    sections: Mapping[str, str]


def shows(*rows: str) -> pytest.MarkDecorator:
    """Mark a test as showing that these rows hold."""
    return pytest.mark.shows(*rows)


def case(row: str, *values: Any) -> Any:
    """A line of a parametrised test that shows `row`; the row's id is the line's name."""
    return pytest.param(*values, id=row, marks=shows(row))


def load(path: Path) -> Table:
    """Read one table. Raises KeyError or TypeError for a row with missing or surplus fields."""
    data = tomllib.loads(path.read_text(encoding="utf-8"))
    return Table(
        name=path.stem,
        title=data["table"]["title"],
        manual=data["table"]["manual"],
        rows=tuple(Row(section=part["number"], **row) for part in data["section"] for row in part["rows"]),
        overview=tuple(Overview(**line) for line in data.get("overview", [])),
        overview_chapter=data["table"].get("overview_chapter", "1"),
        sections={part["number"]: part["title"] for part in data["section"]},
    )


def tables() -> list[Table]:
    """All tables of this folder, by name."""
    return [load(path) for path in sorted(FOLDER.glob("*.toml"))]
