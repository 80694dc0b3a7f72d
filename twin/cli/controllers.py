"""`isel-twin controllers`."""

from __future__ import annotations

from isel_twin.cli.options import Json


def controllers(*, json: Json = False) -> int:
    """List the installed controllers."""
    from isel_twin.cli.outputs import names
    from isel_twin.controller import controller_names

    return names(controller_names(), json)
