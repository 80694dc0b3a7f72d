"""docs/sweeps.md is true: its plans are read and run, its programs give what the text says."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

from isel_twin.cli import main
from isel_twin.many.studies.plan import KEYS, SECTIONS, load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import OUTCOMES
from tests import printed

FILE = printed.ROOT / "docs" / "sweeps.md"
PAGE = FILE.read_text(encoding="utf-8")


@pytest.fixture
def here(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A folder with the files of the page."""
    printed.show_files("docs/sweeps.md", tmp_path)
    monkeypatch.chdir(tmp_path)
    return tmp_path


def as_printed(plan: str, capsys: pytest.CaptureFixture[str]) -> None:
    """Sweep, and compare the answer with that of the page."""
    (answer,) = (block.answer for block in printed.blocks((FILE,)) if block.answer and block.text.endswith(plan))
    with pytest.raises(SystemExit) as caught:
        main(["sweep", plan, "--workers", "1"])
    out, err = capsys.readouterr()
    assert (caught.value.code, err) == (0, "")
    assert answer is not None
    assert printed.fits(out, answer), out


def programs(file: str) -> list[dict[str, Any]]:
    """The names that each program about a table leaves behind."""
    found = []
    for program in re.findall(r"```python\n(.*?)```", PAGE, flags=re.DOTALL):
        if file in program:
            names: dict[str, Any] = {}
            exec(compile(program, "docs/sweeps.md", "exec"), names)
            found.append(names)
    return found


@pytest.mark.usefixtures("here")
def test_speeds_and_reading_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    as_printed("speeds.toml", capsys)
    by_duckdb, by_polars = programs("speeds.parquet")
    assert len(by_duckdb["worst"]) == 4
    assert by_duckdb["worst"][-1][3] == 4, "30000 Hz: all of them fail"
    assert by_polars["fastest"].collect().height == 4


@pytest.mark.usefixtures("here")
def test_a_switch_that_sticks(capsys: pytest.CaptureFixture[str]) -> None:
    as_printed("stuck.toml", capsys)
    (names,) = programs("stuck.parquet")
    assert 0.0 < names["fails_s"] < names["works_s"] < 3.0, "the reference run is over after two seconds"


@pytest.mark.usefixtures("here")
def test_the_plan_of_the_picture_has_as_many_rows_as_it_says() -> None:
    read = load_plan("limits.toml")
    assert len(points(read)) == 64 * (5 + 2) == 448


def test_every_key_and_column_is_explained() -> None:
    for name in (*KEYS, *OUTCOMES, *(f"[{section}]" for section in SECTIONS)):
        assert f"`{name}`" in PAGE, name


def test_the_lines_of_mistakes_are_those_that_are_told(here: Path) -> None:
    lines = re.findall(r"^    (speeds\.toml:\d+: .*)$", PAGE, flags=re.MULTILINE)
    text = (here / "speeds.toml").read_text(encoding="utf-8")
    for wrong, line in zip(("payload.mas ", '"g"'), lines, strict=True):
        old = "payload.mass " if wrong.startswith("payload") else '"kg"'
        (here / "speeds.toml").write_text(text.replace(old, wrong), encoding="utf-8")
        with pytest.raises(ValueError, match="speeds") as caught:
            load_plan("speeds.toml")
        assert str(caught.value) == line
