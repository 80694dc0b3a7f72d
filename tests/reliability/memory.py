"""Thirty days of dense short moves: what a twin that keeps its last motions only would need.

Memory is measured exactly (tracemalloc) over so many moves, and carried forward to thirty days of nothing but those.
"""

from __future__ import annotations

import gc
import os
import tracemalloc

from isel_twin import Twin
from tests.reliability.figures import Figure, main, resident_mb

NUMBER = 20_000
KEEP = 1000
STEPS = 320
LIMIT_MB = 200.0
THIRTY_DAYS_NS = 30 * 86_400 * 1_000_000_000


def moves(twin: Twin, number: int) -> None:
    """To and fro, each move ending where the next one begins."""
    for index in range(number):
        if twin.query(f"@0A{-STEPS if index % 2 else STEPS},10000,0,30,0,30,0,30") != "0":
            raise RuntimeError("a move was refused")


def measure(number: int) -> list[Figure]:
    keep = min(KEEP, number)
    twin = Twin(plant="kinematic", start_mm=(30.0, 30.0, 30.0), keep_motions=keep)
    for command in ("@07", "@0R7"):
        twin.query(command)
    moves(twin, 2 * keep)
    before_ns = twin.time_ns
    gc.collect()
    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    moves(twin, keep)  # from here on all motions kept are traced ones
    gc.collect()
    kept, _ = tracemalloc.get_traced_memory()
    moves(twin, number)
    gc.collect()
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    lived_ns = twin.time_ns - before_ns
    a_move_ns = lived_ns / (number + keep)
    grown_mb = max(0.0, (after - kept) / number * THIRTY_DAYS_NS / a_move_ns / 1e6)
    now_mb = resident_mb(os.getpid())
    return [
        Figure(f"the last {keep} motions", max(0.0, (kept - before) / 1e6), "MB"),
        Figure(f"growth over {number} moves of {STEPS} steps", (after - kept) / 1e3, "kB"),
        Figure("growth carried forward to thirty days of such moves", grown_mb, "MB"),
        Figure("memory of the process then (kinematic plant)", now_mb + grown_mb, "MB", LIMIT_MB),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
