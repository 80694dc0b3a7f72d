"""`isel-twin machines`."""

from __future__ import annotations


def machines() -> int:
    """List the machines that come with the package."""
    from isel_twin.models import machine_names

    print("\n".join(machine_names()))
    return 0
