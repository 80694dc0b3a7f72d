"""`isel-twin describe`: the numbers of a machine."""

from __future__ import annotations

from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import call_errors
from isel_twin.cli.names import machines
from isel_twin.cli.options import Json, Overrides, parse_overrides


def describe(
    name: Annotated[str | None, Parameter(help="Name of a machine or path of a machine folder.")] = None,
    /,
    *,
    set: Overrides = (),
    json: Json = False,
) -> int:
    """Show the parameters of a machine with value, band, unit, grade and source; without a name, list the machines.

    The band holds a number with 95 %, as far as it is known: as the file says, or as its grade does. `run --uncertain`
    draws from it. A number without one is taken as it stands.
    """
    if name is None:
        return machines(json=json)
    from rich.markup import escape
    from rich.table import Table

    from isel_twin.cli.outputs import console, say_json
    from isel_twin.machine import describe as rows_of
    from isel_twin.machine import load_machine, with_overrides

    with call_errors():
        rows = rows_of(with_overrides(load_machine(name), parse_overrides(set)))
    if json:
        from dataclasses import asdict

        say_json([asdict(row) for row in rows])
        return 0
    table = Table("parameter", "value", "95 %", "unit", "grade", "source", box=None)
    table.columns[1].justify = "right"
    for row in rows:
        band = "" if row.interval is None else "{:.4g} .. {:.4g}".format(*row.interval)
        cells = (row.parameter, str(row.value), band, row.unit, row.grade, row.source)
        table.add_row(*(escape(str(cell)) for cell in cells))
    console().print(table)
    return 0
