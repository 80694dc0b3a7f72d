"""Streams: 10^6 ticks of a motion, beside the cheapest way to fill arrays of that size; target 10^8 ticks a second.

`extra_info` holds ticks per second (from the median); the baseline is a cumulative sum of constant periods and an array
of zeros.
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.motion import SetPointRun, StepPath, StepRun, Steps, TimeLaw, circle, constant, line, trapezoid

TICKS = 1_000_000
CHUNK = 1 << 16

RUNS = {
    "line, trapezoid": (line((TICKS, -333_333, 5, 77)), trapezoid(TICKS, 10_000, 400, 100_000)),
    "line, triangle": (line((TICKS, -333_333, 5, 77)), trapezoid(TICKS, 100_000, 300, 5000)),
    "line, constant": (line((TICKS, 1, 0, 0)), constant(TICKS, 10_000)),
    "circle": (circle(TICKS, -62_500, 125_000, 0, -1, 1, False), trapezoid(TICKS, 10_000, 400, 100_000)),
    "helix": (circle(TICKS, -62_500, 125_000, 0, -1, 1, False, (0, 1), 2, 9999), constant(TICKS, 10_000)),
}


def in_chunks(run: StepRun | SetPointRun) -> int:
    """All windows of a run as the twin asks for them; the time of the last tick."""
    last = 0
    for k in range(0, TICKS, CHUNK):
        t_ns, _ = run.window(k, min(k + CHUNK, TICKS))
        last = int(t_ns[-1])
    return last


def fill() -> int:
    """Arrays of the same types and sizes, filled with the least that looks like a step stream."""
    last = 0
    for k in range(0, TICKS, CHUNK):
        size = min(CHUNK, TICKS - k)
        t_ns = np.cumsum(np.full(size, 100_000, dtype=np.int64)) + last
        np.zeros((size, 4), dtype=np.int8).fill(0)
        last = int(t_ns[-1])
    return last


def note(benchmark: BenchmarkFixture) -> None:
    if benchmark.stats is not None:
        benchmark.extra_info["ticks_per_s"] = TICKS / benchmark.stats.stats.median


@pytest.mark.benchmark(group="step streams, 10^6 ticks")
def test_baseline_fill(benchmark: BenchmarkFixture) -> None:
    assert benchmark(fill) == 100_000 * TICKS
    note(benchmark)


@pytest.mark.benchmark(group="step streams, 10^6 ticks")
@pytest.mark.parametrize(("path", "law"), RUNS.values(), ids=RUNS)
def test_generation(benchmark: BenchmarkFixture, path: StepPath, law: TimeLaw) -> None:
    run = StepRun(path, law, 0)
    assert benchmark(in_chunks, run) == law.duration_ns
    note(benchmark)


class Swing:
    """A plan of six axes with its set points at hand: what a run adds to the cost of a plan."""

    ticks, axes, identity = TICKS, 6, "swing"

    def __init__(self) -> None:
        self._deltas = np.resize(np.arange(-500, 501, dtype=np.int32), (TICKS, 6))

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        return self._deltas[first:last].copy()


@pytest.mark.benchmark(group="step streams, 10^6 ticks")
def test_set_points(benchmark: BenchmarkFixture) -> None:
    run = SetPointRun(Swing(), 4_000_000, 0)  # type: ignore[arg-type]
    assert benchmark(in_chunks, run) == 4_000_000 * TICKS
    note(benchmark)


@pytest.mark.benchmark(group="step streams, 10^6 ticks")
def test_record_to_arrays(benchmark: BenchmarkFixture) -> None:
    record = Steps(4, [StepRun(*RUNS["line, trapezoid"], 0)])
    t_ns, delta = benchmark(lambda: (record.t_ns, record.delta))
    assert (t_ns.size, len(delta)) == (TICKS, TICKS)
    note(benchmark)


@pytest.mark.benchmark(group="step streams, one question")
def test_count(benchmark: BenchmarkFixture) -> None:
    """How many ticks at t, in a motion of 10^6."""
    law = trapezoid(TICKS, 10_000, 400, 100_000)
    assert benchmark(law.count, int(law.times(499_999, 500_000)[0])) == 500_000


@pytest.mark.benchmark(group="step streams, one question")
def test_circle_displacement(benchmark: BenchmarkFixture) -> None:
    """Where is a circle of 10^6 ticks after tick k: from a checkpoint, at the far end of its interval."""
    path, k = RUNS["circle"][0], 61 * 8192 - 1
    made = path.deltas(0, k).sum(axis=0, dtype=int)
    assert benchmark(path.displacement, k) == tuple(made)
