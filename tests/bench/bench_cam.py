"""Job files: 200 000 lines to a toolpath, beside the cheapest look at each line: one regular expression.

Target (docs/performance.md): a typical line costs at most 25 such looks, one that needs the whole interpreter 250.
`extra_info` holds lines per second (from the median).
"""

from __future__ import annotations

import re
from collections import deque

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings

LINES = 200_000
SETTINGS = CamSettings(feed_mm_s=10.0)
FILES = {
    "gcode": ("G21\nG1 F300 X0\n", "G1 X{:.3f} Y{:.3f}\n", "M2\n"),
    "gcode, whole interpreter": ("G21\nG1 F300 X0\n", "G1 Y{:.3f} X{:.3f}\n", "M2\n"),
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
