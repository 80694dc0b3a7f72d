"""The whole twin: how much faster than the machine it is, what an hour costs, how long the command line takes to start.

Targets (docs/performance.md): kinematic at least 1000 times real time, 500 times with short moves; an hour of motion
adds less than 100 MB; `isel-twin --help` under 0.3 s, compared with what an empty Python process takes.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from typing import Any

import pytest

from isel_twin import Twin

THERE_AND_BACK = ("@0M40000,10000,40000,10000,40000,10000,0,30", "@0M0,10000,0,10000,0,10000,0,30")
"""Three axes at 10 kHz, 8 s of machine time and a little more for the ramps."""
NANOSECOND = 1e9


def ready(plant: str) -> Twin:
    twin = Twin(plant=plant, start_mm=(5.0, 5.0, 5.0))
    for command in ("@07", "@0R7", "@0z1", "@0A100,1000,0,30,0,30,0,30"):
        assert twin.query(command) == "0"
    return twin


@pytest.mark.benchmark(group="twin, three axes at 10 kHz")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_motion(benchmark: Any, plant: str) -> None:
    twin = ready(plant)
    spans = []

    def job() -> None:
        began = twin.time_ns
        for command in THERE_AND_BACK:
            assert twin.query(command) == "0"
        spans.append((twin.time_ns - began) / NANOSECOND)

    benchmark.pedantic(job, rounds=5, warmup_rounds=1)
    benchmark.extra_info["times real time"] = spans[-1] / benchmark.stats.stats.median


@pytest.mark.benchmark(group="twin, short moves")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_short_moves(benchmark: Any, plant: str) -> None:
    """A hundred moves of about 320 steps at 5 kHz, no two alike, with as many questions for the position in between."""
    twin = ready(plant)
    moves = [f"@0A{sign}{320 + k},5000,{sign}{160 + k},5000,0,30,0,30" for k in range(50) for sign in ("", "-")]
    spans: list[float] = []
    asking: list[float] = []

    def ask() -> None:
        began = time.perf_counter()
        for _ in moves:
            twin.query("@0P")
        asking.append(time.perf_counter() - began)

    def job() -> None:
        began = twin.time_ns
        for command in moves:
            assert twin.query(command) == "0"
        spans.append((twin.time_ns - began) / NANOSECOND)

    benchmark.pedantic(job, setup=ask, rounds=21, warmup_rounds=1)
    median = benchmark.stats.stats.median
    benchmark.extra_info["times real time"] = spans[-1] / median
    benchmark.extra_info["us a move"] = median / len(moves) * 1e6
    benchmark.extra_info["times a question for the position"] = median / statistics.median(asking)


@pytest.mark.benchmark(group="twin, one hour at rest")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_idle_hour(benchmark: Any, plant: str) -> None:
    twin = ready(plant)
    twin.run(3.0)
    benchmark.pedantic(lambda: twin.run(3600.0), rounds=5)
    benchmark.extra_info["times real time"] = 3600.0 / benchmark.stats.stats.median


@pytest.mark.benchmark(group="twin, one hour of motion")
def test_memory_of_an_hour(benchmark: Any) -> None:
    twin = ready("kinematic")

    def hour() -> None:
        end_ns = twin.time_ns + 3600e9
        while twin.time_ns < end_ns:
            for command in THERE_AND_BACK:
                twin.query(command)

    tracemalloc.start()
    before, _ = tracemalloc.get_traced_memory()
    benchmark.pedantic(hour, rounds=1)
    after, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    benchmark.extra_info["megabytes added"] = (after - before) / 1e6
    benchmark.extra_info["million ticks recorded"] = len(twin.steps) / 1e6


@pytest.mark.benchmark(group="start of a process")
@pytest.mark.parametrize(
    "arguments", [["-c", "pass"], ["-m", "isel_twin.cli", "--help"]], ids=["python -c pass", "isel-twin --help"]
)
def test_start(benchmark: Any, arguments: list[str]) -> None:
    benchmark.pedantic(
        lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True), rounds=7, warmup_rounds=1
    )
