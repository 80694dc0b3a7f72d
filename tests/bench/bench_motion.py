"""Step streams: 10^6 ticks of a run, beside the cheapest way to fill arrays of that size; target 2e7 ticks a second.

`extra_info` holds ticks per second (from the median); the baseline is a cumulative sum of constant periods and an array
of constant codes.
"""

from __future__ import annotations

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.motion import Path, Profile, StepRun, Steps, circle, constant, helix, line, trapezoid

TICKS = 1_000_000
CHUNK = 1 << 16

RUNS = {
    "line, trapezoid": (line((TICKS, -333_333, 5, 77)), trapezoid(TICKS, 10_000, 400, 100_000)),
    "line, triangle": (line((TICKS, -333_333, 5, 77)), trapezoid(TICKS, 100_000, 300, 5000)),
    "line, constant": (line((TICKS, 1, 0, 0)), constant(TICKS, 10_000)),
    "circle": (circle(TICKS, -62_500, 125_000, 0, -1, 1, False), trapezoid(TICKS, 10_000, 400, 100_000)),
    "helix": (helix(TICKS, -62_500, 125_000, 0, -1, 1, False, (0, 1), 2, 9999), constant(TICKS, 10_000)),
}


def in_chunks(run: StepRun) -> int:
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
        np.full(size, 5, dtype=np.uint8)
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
@pytest.mark.parametrize(("path", "profile"), RUNS.values(), ids=RUNS)
def test_generation(benchmark: BenchmarkFixture, path: Path, profile: Profile) -> None:
    run = StepRun(path, profile, 0)
    assert benchmark(in_chunks, run) == profile.duration_ns
    note(benchmark)


@pytest.mark.benchmark(group="step streams, 10^6 ticks")
def test_record_to_arrays(benchmark: BenchmarkFixture) -> None:
    record = Steps([StepRun(*RUNS["line, trapezoid"], 0)])
    t_ns, delta = benchmark(lambda: (record.t_ns, record.delta))
    assert (t_ns.size, len(delta)) == (TICKS, TICKS)
    note(benchmark)


@pytest.mark.benchmark(group="step streams, one question")
def test_count(benchmark: BenchmarkFixture) -> None:
    """How many ticks at t, in a motion of 10^6."""
    profile = trapezoid(TICKS, 10_000, 400, 100_000)
    assert benchmark(profile.count, int(profile.times(499_999, 500_000)[0])) == 500_000


@pytest.mark.benchmark(group="step streams, one question")
def test_circle_displacement(benchmark: BenchmarkFixture) -> None:
    """Where is a circle of 10^6 ticks after tick k: from a checkpoint, at the far end of its interval."""
    path, k = RUNS["circle"][0], 61 * 8192 - 1
    made = path.deltas(0, k).sum(axis=0, dtype=int)
    assert benchmark(path.displacement, k) == tuple(made)
