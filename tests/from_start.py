"""Streams of the same moves made at other times are equal from their first tick on."""

from __future__ import annotations

from dataclasses import replace

from isel_twin.testing import Ticks


def from_start(ticks: Ticks) -> Ticks:
    """The same ticks with the first one at time 0."""
    return replace(ticks, t_ns=ticks.t_ns - ticks.t_ns[0]) if len(ticks) else ticks
