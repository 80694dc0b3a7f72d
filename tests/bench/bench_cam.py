"""Job files: 200 000 lines to a toolpath, beside the cheapest look at each line: one regular expression.

Target (docs/performance.md): a typical line costs at most 25 such looks, one that needs the whole interpreter 250; a
line of a laser's raster at most twice a plain one.
`extra_info` holds lines per second (from the median).
"""

from __future__ import annotations

import re
import time
from collections import deque

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings

LINES = 200_000
SETTINGS = CamSettings(feed_mm_s=10.0)
FILES = {
    "gcode": ("G21\nG1 F300 X0\n", "G1 X{:.3f} Y{:.3f}\n", "M2\n"),
    "gcode, raster": ("G21\nG1 F300 X0\n", "G1 X{:.3f} S{:.0f}\n", "M2\n"),
    "gcode, raster in G91": ("G21 G91\nG1 F300 X0\n", "X{:.3f}S{:.0f}\n", "M2\n"),
    "gcode, whole interpreter": ("G21\nG1 F300 X0\n", "G1 G90 X{:.3f} Y{:.3f}\n", "M2\n"),
    "ncp": ("IMF_PBL\nVEL 5000\n", "MOVEABS X{:.0f} Y{:.0f}\n", "PROGEND\n"),
    "hpgl": ("IN;\nPD;\n", "PA{:.0f},{:.0f};\n", "PU;\n"),
}
_LOOK = re.compile(r"G1 X([-+.0-9]+) Y([-+.0-9]+)\n")


def lines(name: str) -> list[str]:
    begin, line, end = FILES[name]
    return [*begin.splitlines(True), *(line.format(at * 37 % 9999 / 9, at * 11 % 7777 / 9) for at in range(LINES)), end]


def note(benchmark: BenchmarkFixture) -> None:
    if benchmark.stats is not None:
        benchmark.extra_info["lines_per_s"] = LINES / benchmark.stats.stats.median


@pytest.mark.benchmark(group="job files, 2 10^5 lines")
def test_baseline_one_expression(benchmark: BenchmarkFixture) -> None:
    file = lines("gcode")
    assert benchmark(lambda: sum(_LOOK.match(line) is not None for line in file)) == LINES
    note(benchmark)


@pytest.mark.benchmark(group="job files, 2 10^5 lines")
@pytest.mark.parametrize("name", FILES)
def test_read(benchmark: BenchmarkFixture, name: str) -> None:
    file, reader = lines(name), reader_named(name.partition(",")[0])
    assert benchmark(lambda: len(deque(reader.read(file, SETTINGS), maxlen=1))) == 1
    note(benchmark)


@pytest.mark.benchmark(group="job files, over plain lines")
@pytest.mark.parametrize("name", ["gcode, raster", "gcode, raster in G91"])
def test_a_raster_over_plain_lines(benchmark: BenchmarkFixture, name: str) -> None:
    """Both in turn, CPU time, least of each."""
    files, turns = (lines("gcode"), lines(name)), list[tuple[float, ...]]()

    def read_s(file: list[str]) -> float:
        began = time.process_time()
        deque(reader_named("gcode").read(file, SETTINGS), maxlen=1)
        return time.process_time() - began

    benchmark.pedantic(lambda: turns.append(tuple(map(read_s, files))), rounds=8, warmup_rounds=1)
    plain_s, raster_s = (min(column) for column in zip(*turns, strict=True))
    benchmark.extra_info.update({"raster over plain": raster_s / plain_s, "lines_per_s": LINES / raster_s})
    assert raster_s <= 2.0 * plain_s
