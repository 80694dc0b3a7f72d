"""Sessions tapped from a machine equal to the twin, on a computer with other things to do: `compare` marks nothing.

The load comes and goes: one process a core computes for up to a second and rests for up to three, so that quick
replies may fall into rest and moves into work, and the other way round. A session takes about 20 s.
"""

from __future__ import annotations

import multiprocessing
import os
import random
import sys
import tempfile
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from tests.reliability.differences import KINDS, in_words, tapped, told
from tests.reliability.figures import Figure, main

NUMBER = 20
WORK_S, REST_S = 1.0, 3.0  # longest stretch of each


def _busy(seed: int) -> None:
    chance = random.Random(seed)
    while True:
        end = time.monotonic() + chance.uniform(0.0, WORK_S)
        while time.monotonic() < end:
            pass
        time.sleep(chance.uniform(0.0, REST_S))


@contextmanager
def load() -> Iterator[None]:
    """One process for each core, now working, now not, while the block lasts."""
    context = multiprocessing.get_context("spawn")
    processes = [context.Process(target=_busy, args=(seed,), daemon=True) for seed in range(os.cpu_count() or 1)]
    for process in processes:
        process.start()
    try:
        yield
    finally:
        for process in processes:
            process.kill()
            process.join()


def measure(number: int) -> list[Figure]:
    equal = next(kind for kind in KINDS if not kind.names)
    marked, largest_s = 0, 0.0
    for _ in range(number):
        with tempfile.TemporaryDirectory() as folder:
            file = Path(folder) / "real.mcap"
            with load():
                tapped(equal, file)
            summary = told(equal, file)
        marked += bool(summary["causes"] or summary["unexplained"] or summary["differences"])
        largest_s = max(largest_s, summary["jitter"]["largest_s"])
        print(in_words(summary), file=sys.stderr, flush=True)
    return [
        Figure(f"anything marked, of {number} tapped sessions of an equal machine under load", marked, "", 0),
        Figure("longest delay in them", 1e3 * largest_s, "ms"),
    ]


if __name__ == "__main__":
    main(measure, NUMBER)
