"""A format and a controller of somebody else's: one reader is one class, one writer one method of a language."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from importlib.metadata import EntryPoint
from typing import Any

import pytest
from cam.played import lines_of

from isel_twin.base import plugins
from isel_twin.cam import registry
from isel_twin.cam.settings import CamSettings
from isel_twin.cam.toolpath import CamError, End, Line, Place, Toolpath
from isel_twin.cam.written import MachineAxes, Written
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.toolpaths import source_of
from isel_twin.language import create_language


class Dots:
    """`dot X Y` a line: the tool goes there at 10 mm/s."""

    name, title, suffixes = "dots", "Dots", (".dots",)

    def claims(self, head: str) -> bool:
        return head.startswith("dot ")

    def read(self, lines: Iterable[str], settings: CamSettings) -> Toolpath:
        for number, text in enumerate(lines, 1):
            word, *numbers = text.split()
            if word != "dot" or len(numbers) != 2:
                raise CamError(f"{word!r} is no dot", Place(number))
            yield Line(Place(number), (float(numbers[0]), float(numbers[1]), 0.0), 10.0)
        yield End(Place(number))


def create_dots(name: str) -> Dots:
    return Dots()


class Plotter:
    """A language that writes toolpaths and passes on everything else."""

    def __init__(self, inner: Any) -> None:
        self._inner = inner

    def __getattr__(self, name: str) -> Any:
        return getattr(self._inner, name)

    def written(self, path: Toolpath, axes: MachineAxes, settings: CamSettings) -> Iterator[Written]:
        for element in path:
            if isinstance(element, Line):
                steps = [round(mm * per_mm) for mm, per_mm in zip(element.to, axes.steps_mm, strict=True)]
                yield Written(f"@0M{steps[0]},900,{steps[1]},900,0,900,0,30", element.place)


@pytest.fixture(autouse=True)
def dots(monkeypatch: pytest.MonkeyPatch) -> None:
    entry = EntryPoint("dots", f"{__name__}:create_dots", registry._GROUP)
    found = plugins.installed
    monkeypatch.setattr(registry, "installed", lambda group: (*found(group), entry))


def made(text: str) -> list[tuple[int, str]]:
    language = Plotter(create_language("imc-s8"))
    spec = TwinSpec("4030", "imc-s8")
    source = source_of(text.encode(), "", language, "imc-s8", spec.fitted, CamSettings())
    assert source is not None
    assert source.title == "Dots"
    return [(line.number, line.command) for line in source.lines]


def test_its_file_is_known_by_its_content_and_written_by_its_language() -> None:
    assert registry.reader_names() == ["dots", "excellon", "gcode", "hpgl", "ncp"]
    assert made("dot 1 2\ndot 10 20\n") == [
        (1, "@0M320,900,640,900,0,900,0,30"),
        (2, "@0M3200,900,6400,900,0,900,0,30"),
    ]


def test_its_errors_have_their_place() -> None:
    with pytest.raises(ValueError, match=r"^line 2, column 1: 'line' is no dot$"):
        made("dot 1 2\nline 3 4\n")


def test_the_writers_of_the_package_take_its_toolpath() -> None:
    lines = lines_of("ismif", Dots().read(["dot 1 2"], CamSettings()))
    assert any("X80" in line.text and "Y160" in line.text for line in lines if line.place == Place(1))
