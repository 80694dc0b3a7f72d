"""The whole twin: how much faster than the machine it is, what an hour costs, how long the command line takes to start.

Targets (docs/performance.md): with physics at most the time of bare `mj_step`, kinematic at least 1000 times real time,
a short move there at most that of six questions for the position; sampling every millisecond costs less than bare
`mj_step`; an hour of motion adds less than 100 MB; a recording at 100 Hz costs less than 5 % of the time of a twin in
motion, ten minutes of it less than 20 MB; `isel-twin --help` under 0.3 s, compared with what an empty Python process
takes.
"""

from __future__ import annotations

import statistics
import subprocess
import sys
import time
import tracemalloc
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from bench.bench_plant import SECONDS, bare

from isel_twin import Twin
from isel_twin.plant.mujoco import MujocoPlant
from isel_twin.recordings.recording import FileRecording

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


@pytest.mark.benchmark(group="twin, three axes at 10 kHz")
def test_physics_and_samples_beside_bare_mujoco(benchmark: Any) -> None:
    """A job as it is, the same looked at every millisecond, and the bare steps of its MuJoCo model, in turn, for a
    second of machine time, in CPU time: the least of each, as what other work adds is never negative."""
    twin = ready("mujoco")
    plant = twin._plant
    assert isinstance(plant, MujocoPlant)
    step = bare(plant.model)

    def job() -> float:
        began, cpu = twin.time_ns, time.process_time()
        for command in THERE_AND_BACK:
            assert twin.query(command) == "0"
        return (time.process_time() - cpu) / (twin.time_ns - began) * NANOSECOND

    def sampled() -> float:
        began, cpu = twin.time_ns, time.process_time()
        for command in THERE_AND_BACK:
            twin.write(command.encode() + b"\r")
            while not twin.idle:
                twin.run(0.001)
                assert twin.position_mm.shape == (3,)
            assert twin.read() == b"0"
        return (time.process_time() - cpu) / (twin.time_ns - began) * NANOSECOND

    def steps() -> float:
        cpu = time.process_time()
        step()
        return (time.process_time() - cpu) / SECONDS

    for warm in (job, sampled, steps):
        warm()
    turns = [(job(), sampled(), steps()) for _ in range(20)]
    benchmark.pedantic(lambda: turns.append((job(), sampled(), steps())), rounds=1)
    job_s, sampled_s, steps_s = np.min(turns, axis=0).tolist()
    alone, looking = job_s / steps_s, (sampled_s - job_s) / steps_s
    benchmark.extra_info["whole twin, times bare mj_step"] = alone
    benchmark.extra_info["sampling every ms, times bare mj_step"] = looking
    benchmark.extra_info["sampling every ms, us a sample"] = (sampled_s - job_s) * 1e3
    benchmark.extra_info["whole twin, times real time by CPU"] = 1.0 / job_s
    assert alone <= 0.6
    assert looking <= 1.8


@pytest.mark.benchmark(group="twin, recorded")
def test_recording_at_100_hz(benchmark: Any, tmp_path: Path) -> None:
    """A job of a twin that is recorded and of one that is not, in turn, in CPU time; the file of ten minutes of it."""
    plain, recorded = ready("mujoco"), ready("mujoco")
    path = tmp_path / "job.mcap"
    recording = FileRecording(path, recorded, 10_000_000)
    began = recorded.time_ns

    def job(twin: Twin) -> float:
        cpu = time.process_time()
        for command in THERE_AND_BACK:
            assert twin.query(command) == "0"
        return time.process_time() - cpu

    turns = [(job(plain), job(recorded)) for _ in range(28)][1:]
    benchmark.pedantic(lambda: turns.append((job(plain), job(recorded))), rounds=1)
    recording.close()
    minutes = (recorded.time_ns - began) / NANOSECOND / 60.0
    spans = np.array(turns).reshape(7, 4, 2).sum(axis=1)  # four jobs: a chunk is written about every second one
    least = spans.min(axis=0)  # what other work adds is never negative
    size_mb = path.stat().st_size / minutes * 10.0 / 1e6
    benchmark.extra_info["recorded over not recorded, least of each"] = float(least[1] / least[0])
    benchmark.extra_info["recorded over not recorded, median of turns"] = statistics.median(b / a for a, b in turns)
    benchmark.extra_info["MB in ten minutes of motion"] = size_mb
    assert least[1] / least[0] <= 1.15
    assert size_mb <= 20.0


@pytest.mark.benchmark(group="twin, short moves")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_short_moves(benchmark: Any, plant: str) -> None:
    """A hundred moves of about 320 steps at 5 kHz, no two alike, with as many questions for the position in between, in
    CPU time, the least of each."""
    twin = ready(plant)
    moves = [f"@0A{sign}{320 + k},5000,{sign}{160 + k},5000,0,30,0,30" for k in range(50) for sign in ("", "-")]
    spans: list[float] = []
    spent: list[float] = []
    asking: list[float] = []

    def ask() -> None:
        cpu = time.process_time()
        for _ in moves:
            twin.query("@0P")
        asking.append(time.process_time() - cpu)

    def job() -> None:
        began, cpu = twin.time_ns, time.process_time()
        for command in moves:
            assert twin.query(command) == "0"
        spent.append(time.process_time() - cpu)
        spans.append((twin.time_ns - began) / NANOSECOND)

    benchmark.pedantic(job, setup=ask, rounds=41, warmup_rounds=1)
    questions = min(spent) / min(asking)
    benchmark.extra_info["times real time, by CPU"] = spans[-1] / min(spent)
    benchmark.extra_info["us a move, by CPU"] = min(spent) / len(moves) * 1e6
    benchmark.extra_info["times a question for the position"] = questions
    assert plant != "kinematic" or questions <= 6.0


@pytest.mark.benchmark(group="twin, short moves")
def test_short_moves_on_a_timed_line(benchmark: Any) -> None:
    """The same moves, each byte at its time, over those whose bytes take none, in turn, in CPU time, the least of each:
    a command is one event."""
    timed, untimed = ready("kinematic"), ready("kinematic")
    timed.line_speed = True
    moves = [f"@0A{sign}{320 + k},5000,{sign}{160 + k},5000,0,30,0,30" for k in range(50) for sign in ("", "-")]

    def spent(twin: Twin) -> float:
        cpu = time.process_time()
        for command in moves:
            assert twin.query(command) == "0"
        return time.process_time() - cpu

    turns = [(spent(timed), spent(untimed)) for _ in range(20)]
    benchmark.pedantic(lambda: turns.append((spent(timed), spent(untimed))), rounds=1)
    least = np.min(turns, axis=0)
    benchmark.extra_info["us a move, by CPU"] = least[0] / len(moves) * 1e6
    benchmark.extra_info["over moves whose bytes take no time"] = least[0] / least[1]
    assert least[0] / least[1] <= 2.0


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
    "arguments", [["-c", "pass"], ["-m", "isel_twin", "--help"]], ids=["python -c pass", "isel-twin --help"]
)
def test_start(benchmark: Any, arguments: list[str]) -> None:
    benchmark.pedantic(
        lambda: subprocess.run([sys.executable, *arguments], check=True, capture_output=True), rounds=7, warmup_rounds=1
    )
