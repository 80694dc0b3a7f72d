"""Toolpaths to commands: lines, circles and short arcs as the four languages write them.

`extra_info` holds elements, and lines written, per second (from the median). Target: 50 000 lines a second a core.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator

import pytest
from cam.played import END, FAST, axes_of
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.cam.toolpath import Arc, Element, Line, Place, Rapid
from isel_twin.controller import offers
from isel_twin.language import WritesToolpaths, create_language

ELEMENTS = 50_000
CIRCLES = 5_000


def lines() -> Iterator[Element]:
    for k in range(1, ELEMENTS + 1):
        angle = 0.001 * k
        to = 100 + 50 * math.cos(angle), 100 + 50 * math.sin(angle), -10 - 5 * math.sin(3 * angle)
        yield Line(Place(k, 1, "MOVEABS"), to, 10.0)
    yield END


def circles() -> Iterator[Element]:
    yield Rapid(Place(1), (50.0, 50.0, -1.0))
    for k in range(1, CIRCLES + 1):
        yield Arc(Place(k, 1, "CWABS"), (50.0, 50.0, -1.0), (60.0, 50.0, 0.0), 2, -1, 10.0)
    yield END


def arcs() -> Iterator[Element]:
    """Of 17 degrees: each costs its controller as much as a circle."""
    yield Rapid(Place(1), (110.0, 100.0, -10.0))
    for k in range(1, CIRCLES + 1):
        to = 100 + 10 * math.cos(0.3 * k), 100 + 10 * math.sin(0.3 * k), -10.0
        yield Arc(Place(k, 1, "CCWABS"), to, (100.0, 100.0, 0.0), 2, 1, 10.0)
    yield END


@pytest.mark.benchmark(group="toolpaths to commands")
@pytest.mark.parametrize(("path", "count"), [(lines, ELEMENTS), (circles, CIRCLES), (arcs, CIRCLES)])
@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_writing(
    benchmark: BenchmarkFixture, controller: str, path: Callable[[], Iterator[Element]], count: int
) -> None:
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    axes = axes_of(controller)
    made = benchmark(lambda: sum(1 for _ in language.written(path(), axes, FAST)))
    assert made > count // 60
    if benchmark.stats is not None:
        took_s = benchmark.stats.stats.median
        benchmark.extra_info.update(elements_per_s=count / took_s, lines_per_s=made / took_s)
