"""The smallest job that shows what tuning is about: a rapid way, a feed, a way back."""

from __future__ import annotations

from isel_twin.core.spec import TwinSpec
from isel_twin.many.tuning import Problem

TEXT = """# a small job
@07
@0d5000,5000,5000
@0R7   => 0 within 60 s
@0M9600,9000,0,30,0,30,0,30    # a rapid way
@0A320,1000,0,30,0,30,0,30
! lost == 0
@0M0,9000,0,30,0,30,0,30 => 0
"""
SAFE = {"speed_hz": 6000, "acceleration_hz_per_ms": 60, "start_stop_hz": 200}
BRAVE = {"speed_hz": 40_000, "acceleration_hz_per_ms": 4000, "start_stop_hz": 4000}


def problem(**words: object) -> Problem:
    """Of a machine whose stages are known."""
    return Problem(TEXT, **{"repetitions": 1, "call": TwinSpec(overrides={"axes.all.stage.kind": "fast"}), **words})
