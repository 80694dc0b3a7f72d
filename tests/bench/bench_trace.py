"""Traces and report of a job of an hour: time and memory of `isel-twin run`, in a process of its own.

`extra_info` holds the peak of its resident memory in MB, beside that of a job of a minute: traces go to the disk as
they come, so the difference is small, whatever the length. The dump (VCD) of an hour, which has a line for each edge,
is left out.

Targets (docs/performance.md), in CPU time, start included: an hour with its trace at most 7 times the import of
MuJoCo; with physics at most twice the run without.
"""

from __future__ import annotations

import subprocess
import sys
from pathlib import Path

import pytest
from bench.bench_start import COMMAND, IMPORTS, cpu_s
from pytest_benchmark.fixture import BenchmarkFixture

ROUND = "@0M80000,4000,40000,4000,0,30,0,30\n@0M0,4000,0,4000,0,30,0,30\n"
"""Forty seconds of two axes at 4000 steps/s."""
RUN = """
import sys
from isel_twin.cli import main
try:
    main(sys.argv[1:])
finally:
    told = dict(line.split(":", 1) for line in open("/proc/self/status"))
    print("peak", int(told["VmHWM"].split()[0]) // 1000, file=sys.stderr)
"""
"""Of its own memory: `ru_maxrss` of a process counts that of the one which started it, too."""
NAMES = {"steps": "out.npz", "trace": "out.parquet", "report": "out.html"}
MOST_MB = {"steps": 500, "trace": 220, "report": 500, "steps+trace+report": 500}


def peak_mb(folder: Path, rounds: int, *names: str) -> int:
    """Peak memory of a job of that many rounds and its traces."""
    (folder / "job.txt").write_text("@07\n@0R7\n" + ROUND * rounds)
    options = [word for name in names for word in (f"--{name}", str(folder / NAMES[name]))]
    command = [sys.executable, "-c", RUN, "run", str(folder / "job.txt"), "--plant", "kinematic", *options]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return int(done.stderr.split("peak")[1])


@pytest.mark.benchmark(group="traces of an hour")
@pytest.mark.parametrize("names", [("steps",), ("trace",), ("report",), ("steps", "trace", "report")], ids="+".join)
def test_an_hour(benchmark: BenchmarkFixture, tmp_path: Path, names: tuple[str, ...]) -> None:
    minute = peak_mb(tmp_path, 1, *names)
    hour = benchmark.pedantic(peak_mb, (tmp_path, 88, *names), rounds=1)
    benchmark.extra_info |= {"peak_mb": hour, "peak_mb_of_a_minute": minute}
    assert hour < MOST_MB["+".join(names)]


@pytest.mark.benchmark(group="an hour's trace")
@pytest.mark.parametrize(("plant", "rounds", "most"), [("kinematic", 88, 7.0), ("mujoco", 9, 2.0)])
def test_an_hours_trace(benchmark: BenchmarkFixture, tmp_path: Path, plant: str, rounds: int, most: float) -> None:
    """Without physics the motion of an hour is described, in 0.03 s: so its trace is set against an import. With
    physics a tenth of an hour is made, with and without its trace."""
    (tmp_path / "job.txt").write_text("@07\n@0R7\n" + ROUND * rounds)
    call = ["run", str(tmp_path / "job.txt"), "--plant", plant]
    trace = ["--trace", str(tmp_path / "out.parquet")]

    def beside() -> float:
        return cpu_s(COMMAND, *call) if plant == "mujoco" else cpu_s(IMPORTS)

    benchmark.pedantic(cpu_s, (COMMAND, *call, *trace), rounds=1)
    turns = [(beside(), cpu_s(COMMAND, *call, *trace)) for _ in range(3)]
    other_s, trace_s = map(min, zip(*turns, strict=True))
    benchmark.extra_info |= {"CPU s": trace_s, "times what it is set against": trace_s / other_s}
    assert trace_s <= most * other_s


MOVES = "@0M80000,20000,40000,20000,0,30,0,30\n@0M0,20000,0,20000,0,30,0,30\n"
CPU = """
import sys, time
from isel_twin.cli import main
try:
    main(sys.argv[1:])
finally:
    print("cpu", time.process_time(), file=sys.stderr)
"""


@pytest.mark.benchmark(group="cost of outputs")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
@pytest.mark.parametrize("name", ["trace.parquet", "dump.vcd", "report.html"])
def test_outputs(benchmark: BenchmarkFixture, tmp_path: Path, name: str, plant: str) -> None:
    """CPU time that an output adds to a run of ten moves, start included: at most half the run beside physics. Where
    nothing but a counter is computed the run is its start: at most 2.6 times the import of MuJoCo."""
    (tmp_path / "job.txt").write_text("@07\n@0R7\n" + MOVES * 5)
    option = f"--{Path(name).suffix[1:].replace('parquet', 'trace').replace('html', 'report')}"

    def cpu_of_run_s(*options: str) -> float:
        command = [sys.executable, "-c", CPU, "run", str(tmp_path / "job.txt"), "--plant", plant, *options]
        done = subprocess.run(command, capture_output=True, text=True, check=True)
        return float(done.stderr.split("cpu")[1])

    path = str(tmp_path / name)
    turns = [(cpu_of_run_s(), cpu_of_run_s(option, path), cpu_s(IMPORTS)) for _ in range(3)]
    alone_s, both_s, imports_s = map(min, zip(*turns, strict=True))
    benchmark.extra_info["added, over the run"] = both_s / alone_s - 1.0
    benchmark.extra_info["added, over an import"] = (both_s - alone_s) / imports_s
    benchmark.pedantic(cpu_of_run_s, (option, path), rounds=1)
    assert both_s - alone_s <= (0.5 * alone_s if plant == "mujoco" else 2.6 * imports_s)
