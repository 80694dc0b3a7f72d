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
      { id = "imc-2.2.1-3", statement = "...", status = "torn: imc/8", places = ["2.2.1", "5, `4`"],
        against = "...", follows = "5, `4`" },                                    # on one line, as TOML wants it
    ]

A statement says what the manual says there, whether the twin follows or not. Where the manual says something else in
another place the row is torn: the twin follows one of both places. A row that begins to hold with another statement
names the decision for it (`turned = "imc/7"`); test_statements.py knows all statements that ever did not hold.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

FOLDER = Path(__file__).parent
STATUS = re.compile(r"holds|(torn|deviates|not on this machine): [a-z0-9]+/\d+")


@dataclass(frozen=True)
class Row:
    """A statement of the manual in our words; `status` is one of

    - holds
    - torn: <decision>. The first of `places` says the statement, the second one `against`; the twin `follows` one
    - deviates: <decision>
    - not on this machine: <decision>, for axes, ports and units that a gantry of three axes has not: they are refused
      or have no effect
    """

    id: str
    section: str
    statement: str
    status: str
    places: Sequence[str] = ()
    against: str = ""
    follows: str = ""
    turned: str = ""

    @property
    def kind(self) -> str:
        """Status without its decision."""
        return self.status.partition(":")[0]

    @property
    def manual(self) -> str:
        """Statement, and what another place of the manual says against it."""
        if self.kind != "torn":
            return self.statement
        return f"{self.statement} ({self.places[0]}) But: {self.against} ({self.places[1]}) Followed: {self.follows}."


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
