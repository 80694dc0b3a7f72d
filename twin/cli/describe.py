"""`isel-twin describe`: the numbers of a machine."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Annotated

from cyclopts import Parameter

from isel_twin.base.errors import call_errors
from isel_twin.base.parameters import Row
from isel_twin.base.printable import shown
from isel_twin.cli.names import machines
from isel_twin.cli.options import ControllerName, Json, Overrides, parse_overrides
from isel_twin.controller import readings_in_force
from isel_twin.core.spec import TwinSpec


def describe(
    name: Annotated[str | None, Parameter(help="Name of a machine or path of a machine folder.")] = None,
    /,
    *,
    controller: ControllerName = TwinSpec.controller,
    set: Overrides = (),
    json: Json = False,
) -> int:
    """Show the parameters of a machine with value, band, unit, grade and source; without a name, list the machines.

    The band holds a number with 95 %, as far as it is known: as the file says, or as its grade does. `run --uncertain`
    draws from it. A number without one is taken as it stands. Where the manual of the controller can be read in two
    ways, the setting that chooses is shown with the one that holds.
    """
    if name is None:
        return machines(json=json)
    from rich.markup import escape
    from rich.table import Table

    from isel_twin.cli.outputs import console, say_json
    from isel_twin.machine import describe as rows_of
    from isel_twin.machine import load_machine, with_overrides

    with call_errors():
        machine = with_overrides(load_machine(name), parse_overrides(set))
        rows = _with_readings(rows_of(machine), controller, readings_in_force(controller, machine.controller))
    if json:
        from dataclasses import asdict

        say_json([asdict(row) for row in rows])
        return 0
    table = Table("parameter", "value", "95 %", "unit", "grade", "source", box=None)
    table.columns[1].justify = "right"
    for row in rows:
        band = "" if row.interval is None else "{:.4g} .. {:.4g}".format(*row.interval)
        cells = (row.parameter, str(row.value), band, row.unit, row.grade, row.source)
        table.add_row(*(escape(shown(str(cell))) for cell in cells))
    console().print(table)
    return 0


def _with_readings(rows: list[Row], controller: str, readings: Mapping[str, tuple[bool, str]]) -> list[Row]:
    """The rows of a machine, and those of the readings of its controller's manual that hold."""
    held = [
        Row(f"controller.{key}", value, "", f"{controller}: {words}", "setting")
        for key, (value, words) in readings.items()
    ]
    names = {row.parameter for row in held}
    return [*(row for row in rows if row.parameter not in names), *held]
