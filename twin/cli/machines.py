"""`isel-twin machines`."""

from __future__ import annotations

from isel_twin.cli.options import Json


def machines(*, json: Json = False) -> int:
    """List the machines that come with the package."""
    from isel_twin.cli.outputs import names
    from isel_twin.models import machine_names

    return names(machine_names(), json)
