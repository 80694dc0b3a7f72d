"""`isel-twin describe`: the numbers of a machine."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import call_errors


def describe(name: Annotated[str, Parameter(help="Name of a machine or path of a machine folder.")]) -> int:
    """Show every parameter of a machine with value, unit, source and grade."""
    from rich.markup import escape
    from rich.table import Table

    from isel_twin.cli.outputs import console
    from isel_twin.machine import describe as rows_of
    from isel_twin.machine import load_machine

    with call_errors():
        rows = rows_of(load_machine(name))
    table = Table("parameter", "value", "unit", "grade", "source", box=None)
    table.columns[1].justify = "right"
    for row in rows:
        cells = (row.parameter, str(row.value), row.unit, row.grade, row.source)
        table.add_row(*(escape(str(cell)) for cell in cells))
    console().print(table)
    return 0
