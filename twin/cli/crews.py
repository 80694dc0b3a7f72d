"""Processes that share the work of a command."""

from __future__ import annotations

from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from isel_twin.base.crew import Crew


def crew_of(number: int) -> Crew:
    """So many processes of this computer, ready to play jobs; 1: this one."""
    from isel_twin.base.crew import local

    return local(number, preload=("isel_twin.jobs.ready",))
