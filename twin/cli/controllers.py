"""`isel-twin controllers`."""

from __future__ import annotations


def controllers() -> int:
    """List the installed controllers."""
    from isel_twin.controller import controller_names

    print("\n".join(controller_names()))
    return 0
