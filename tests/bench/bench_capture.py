"""Captures: 10^6 edges of a dump and of a table to ticks, beside the cheapest way to find the lines of such a file.

`extra_info` holds edges per second (from the median).
"""

from __future__ import annotations

from pathlib import Path

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.capture.load import load

STEPS = 500_000
EDGES = 2 * STEPS


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder with the same pulses as a dump and as a table."""
    folder = tmp_path_factory.mktemp("captures")
    rises = range(20_000, 20_000 * (STEPS + 1), 20_000)
    header = (
        "$timescale 1 ns $end\n$var wire 1 ! step_x $end\n$var wire 1 ? dir_x $end\n$enddefinitions $end\n#0 0! 1?\n"
    )
    (folder / "a.vcd").write_text(header + "".join(f"#{t}\n1!\n#{t + 5000}\n0!\n" for t in rises))
    rows = "".join(f"{t / 1e9:.9f},1,1\n{(t + 5000) / 1e9:.9f},0,1\n" for t in rises)
    (folder / "a.csv").write_text("Time [s],step_x,dir_x\n0.000000000,0,1\n" + rows)
    return folder


def note(benchmark: BenchmarkFixture) -> None:
    if benchmark.stats is not None:
        benchmark.extra_info["edges_per_s"] = EDGES / benchmark.stats.stats.median


@pytest.mark.benchmark(group="captures, 10^6 edges")
def test_baseline_lines(benchmark: BenchmarkFixture, folder: Path) -> None:
    assert benchmark(lambda: (folder / "a.csv").read_bytes().count(b"\n")) == EDGES + 2
    note(benchmark)


@pytest.mark.benchmark(group="captures, 10^6 edges")
@pytest.mark.parametrize("name", ["a.vcd", "a.csv"])
def test_read(benchmark: BenchmarkFixture, folder: Path, name: str) -> None:
    assert len(benchmark(load, folder / name).t_ns) == STEPS
    note(benchmark)
