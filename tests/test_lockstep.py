"""Two builds in lockstep: the log names the call and the part that differ, and an empty or cut one is refused."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from isel_twin import Twin
from tests.lockstep import compare, logging


def played(file: Path, start_mm: tuple[float, float, float] = (20.0, 30.0, 10.0)) -> Path:
    with logging(file) as log:
        log.mark("a session")
        twin = Twin(start_mm=start_mm)
        for _ in range(5):
            twin.run(0.01)
    return file


@pytest.fixture(scope="module")
def log(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return played(tmp_path_factory.mktemp("lockstep") / "log")


def altered(log: Path, tmp_path: Path, text: str) -> Path:
    other = tmp_path / "other"
    other.write_text(text, encoding="utf-8")
    return other


def test_the_same_twice_is_the_same(log: Path, tmp_path: Path) -> None:
    assert compare(log, played(tmp_path / "again")) is None


def test_a_last_bit_shows_with_call_and_part(log: Path, tmp_path: Path) -> None:
    other = played(tmp_path / "other", (20.0, 30.0, 10.000000000000002))
    difference = compare(log, other)
    assert difference is not None
    assert difference.startswith("line 3, within a session: ")
    assert "qpos" in difference


def test_the_part_that_differs_is_named(log: Path, tmp_path: Path) -> None:
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    place = lines[1].split().index("rates") + 2
    words = lines[-1].split()
    words[place] = "1234abcd"
    difference = compare(log, altered(log, tmp_path, "".join(lines[:-1]) + " ".join(words)))
    assert difference is not None
    assert re.match(rf"line {len(lines)}, within a session: rates\n", difference)


def test_a_part_of_one_build_alone_is_left_out(log: Path, tmp_path: Path) -> None:
    text = re.sub(r"^(parts.*|\d.*)$", r"\1 00000000", log.read_text(encoding="utf-8"), flags=re.M)
    assert compare(log, altered(log, tmp_path, text)) is None


@pytest.mark.parametrize(
    ("cut", "said"), [(0, "no call is logged"), (2, "no call is logged"), (-1, "ends here, within a session")]
)
def test_a_log_that_ends_early_is_refused(log: Path, tmp_path: Path, cut: int, said: str) -> None:
    lines = log.read_text(encoding="utf-8").splitlines(keepends=True)
    other = altered(log, tmp_path, "".join(lines[:cut]))
    assert said in (compare(log, other) or "")
    assert said in (compare(other, log) or "")
