"""`isel-twin machines` and `isel-twin controllers`: lists of what is installed."""

from __future__ import annotations

from collections.abc import Iterable

from isel_twin.cli.options import Json


def machines(*, json: Json = False) -> int:
    """List the machines that come with the package."""
    from isel_twin.models import machine_names

    return _tell(machine_names(), json)


def controllers(*, json: Json = False) -> int:
    """List the installed controllers."""
    from isel_twin.controller import controller_names

    return _tell(controller_names(), json)


def _tell(names: Iterable[str], json: bool) -> int:
    from isel_twin.cli.outputs import say_json

    if json:
        say_json(list(names))
    else:
        print("\n".join(names))
    return 0
