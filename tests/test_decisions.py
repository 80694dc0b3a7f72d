"""Decisions stand in docs/decisions, a file a room, and are cited by room and number."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = {path.stem: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "decisions").glob("*.md"))}
NUMBERS = {room: [int(number) for number in re.findall(r"^\*\*(\d+)\. ", text, re.M)] for room, text in ROOMS.items()}
CITED = re.compile(rf"(?<![\w/.])({'|'.join(ROOMS)})/(\d+)\b(?!/)")


def files() -> Iterator[Path]:
    for folder in ("twin", "bridge", "envs", "models", "tests", "docs"):
        yield from (p for p in sorted((ROOT / folder).rglob("*")) if p.suffix in (".py", ".md", ".toml", ".xml"))


@pytest.mark.parametrize("room", ROOMS)
def test_numbers_run_from_one(room: str) -> None:
    assert NUMBERS[room] == list(range(1, len(NUMBERS[room]) + 1))


def test_every_citation_leads_to_a_decision() -> None:
    cited = {(path, *found) for path in files() for found in CITED.findall(path.read_text(encoding="utf-8"))}
    lost = [f"{p.relative_to(ROOT)}: {room}/{n}" for p, room, n in sorted(cited) if int(n) not in NUMBERS[room]]
    assert lost == []
    assert len(cited) > 250


def test_the_index_names_every_room() -> None:
    index = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    assert re.findall(r"decisions/(\w+)\.md\)", index) == [*re.findall(r"^- \[(\w+)\]", index, re.M)]
    assert set(re.findall(r"^- \[(\w+)\]", index, re.M)) == set(ROOMS)
