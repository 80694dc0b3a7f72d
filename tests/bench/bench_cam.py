"""Job files: 200 000 lines to a toolpath, beside the cheapest look at each line: one regular expression; toolpaths to
the lines of a controller, beside an empty loop over their elements.

Target (docs/performance.md): a typical line costs at most 25 such looks, one that needs the whole interpreter 250.
`extra_info` holds lines per second of the file, or elements of the toolpath, and lines written (from the median).
"""

from __future__ import annotations

import math
import re
from collections import deque
from collections.abc import Callable, Iterator

import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.cam.registry import reader_named
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import Arc, Element, End, Line, Place
from isel_twin.cam.written import MachineAxes
from isel_twin.controller import offers
from isel_twin.language import WritesToolpaths, create_language

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


ELEMENTS = 20_000
STEPS_MM = {"imc-s8": 320.0, "ismif": 80.0, "gmi99": 1000.0, "bwo900": 1000.0}


def cuts() -> Iterator[Element]:
    """Short lines on a spiral staircase."""
    for at in range(ELEMENTS):
        x, y = 100.0 + 50.0 * math.cos(0.001 * at), 100.0 + 50.0 * math.sin(0.001 * at)
        yield Line(Place(at + 1), (x, y, -10.0 - 5.0 * math.sin(1e-4 * at)), 10.0)
    yield End(Place(1))


def arcs(plane: int = 2, elements: int = ELEMENTS) -> Iterator[Element]:
    """Of 17 degrees, radius 10 mm."""
    yield Line(Place(1), (110.0, 100.0, -50.0) if plane == 2 else (100.0, 100.0, -40.0), 10.0)
    for at in range(1, elements):
        u, v = 10.0 * math.cos(0.3 * at), 10.0 * math.sin(0.3 * at)
        to = (100.0 + u, 100.0 + v, -50.0) if plane == 2 else (100.0 + v, 100.0, -50.0 + u)
        yield Arc(Place(at + 1), to, (100.0, 100.0, -50.0), plane, 1, 10.0)
    yield End(Place(1))


def upright() -> Iterator[Element]:
    """In XZ: chords, where the controller has no arc for it."""
    return arcs(1, ELEMENTS // 4)


@pytest.mark.benchmark(group="toolpaths written, 2 10^4 elements")
@pytest.mark.parametrize("path", [cuts, arcs, upright])
def test_baseline_empty_loop(benchmark: BenchmarkFixture, path: Callable[[], Iterator[Element]]) -> None:
    elements = list(path())
    assert benchmark(lambda: sum(1 for _ in iter(elements))) == len(elements)


@pytest.mark.benchmark(group="toolpaths written, 2 10^4 elements")
@pytest.mark.parametrize("path", [cuts, arcs, upright])
@pytest.mark.parametrize("controller", STEPS_MM)
def test_written(benchmark: BenchmarkFixture, controller: str, path: Callable[[], Iterator[Element]]) -> None:
    elements, steps = list(path()), STEPS_MM[controller]
    axes = MachineAxes((steps, steps, steps), ((0.0, 395.0), (0.0, 300.0), (0.0, 140.0)))

    def write() -> int:
        language = create_language(controller)
        assert offers(language, WritesToolpaths)
        return sum(1 for _ in language.written(iter(elements), axes, SETTINGS))

    written = benchmark(write)
    assert written
    if benchmark.stats is not None:
        took = benchmark.stats.stats.median
        benchmark.extra_info.update(elements_per_s=len(elements) / took, lines_per_s=written / took)
