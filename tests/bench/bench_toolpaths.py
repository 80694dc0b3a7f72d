"""Toolpaths to commands: lines and circles as the four languages write them.

`extra_info` holds elements per second (from the median). Target: 50 000 lines a second a core.
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


@pytest.mark.benchmark(group="toolpaths to commands")
@pytest.mark.parametrize(("path", "count"), [(lines, ELEMENTS), (circles, CIRCLES)], ids=["lines", "circles"])
@pytest.mark.parametrize("controller", ["imc-s8", "ismif", "gmi99", "bwo900"])
def test_writing(
    benchmark: BenchmarkFixture, controller: str, path: Callable[[], Iterator[Element]], count: int
) -> None:
    language = create_language(controller)
    assert offers(language, WritesToolpaths)
    axes = axes_of(controller)
    assert benchmark(lambda: sum(1 for _ in language.written(path(), axes, FAST))) > count // 60
    if benchmark.stats is not None:
        benchmark.extra_info["elements_per_s"] = count / benchmark.stats.stats.median
