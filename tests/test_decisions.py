"""Decisions stand in docs/decisions, a file a room, and are cited by room and number."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
ROOMS = {path.stem: path.read_text(encoding="utf-8") for path in sorted((ROOT / "docs" / "decisions").glob("*.md"))}
NUMBERS = {room: [int(number) for number in re.findall(r"^\*\*(\d+)\. ", text, re.M)] for room, text in ROOMS.items()}
CITED = re.compile(rf"(?<![\w/.])({'|'.join(ROOMS)})/(\d+)\b(?!/)")


SUFFIXES = (".py", ".c", ".h", ".md", ".toml", ".xml")


def files() -> Iterator[Path]:
    for folder in ("twin", "bridge", "envs", "models", "tests", "docs"):
        yield from (p for p in sorted((ROOT / folder).rglob("*")) if p.suffix in SUFFIXES)


@cache
def citations() -> frozenset[tuple[Path, str, int]]:
    """File, room and number of each."""
    found = ((path, CITED.findall(path.read_text(encoding="utf-8"))) for path in files())
    return frozenset((path, room, int(number)) for path, several in found for room, number in several)


@pytest.mark.parametrize("room", ROOMS)
def test_numbers_run_from_one(room: str) -> None:
    assert NUMBERS[room] == list(range(1, len(NUMBERS[room]) + 1))


def test_every_citation_leads_to_a_decision() -> None:
    lost = [f"{p.relative_to(ROOT)}: {room}/{n}" for p, room, n in sorted(citations()) if n not in NUMBERS[room]]
    assert lost == []


def test_no_decision_is_cited_without_its_room() -> None:
    """As they were until they had rooms: a letter and a number."""
    roomless = re.compile(r'(?:"""|[(:] ?|\bis |\bare |\bin |\), )([DZ]\d{1,2})(?=[:;)]|\.(?: |$)| to [DZ]\d)', re.M)
    found = {str(path.relative_to(ROOT)): roomless.findall(path.read_text(encoding="utf-8")) for path in files()}
    assert {path: numbers for path, numbers in found.items() if numbers} == {}


@pytest.mark.parametrize("room", ROOMS)
def test_every_decision_is_cited_where_it_is_kept(room: str) -> None:
    """Who changes the code must meet the decision there; one that nobody cites decides nothing."""
    cited = {n for path, name, n in citations() if name == room and path.parent.name != "decisions"}
    assert sorted(set(NUMBERS[room]) - cited) == []


def test_the_index_names_every_room() -> None:
    index = (ROOT / "docs" / "decisions.md").read_text(encoding="utf-8")
    assert re.findall(r"decisions/(\w+)\.md\)", index) == [*re.findall(r"^- \[(\w+)\]", index, re.M)]
    assert set(re.findall(r"^- \[(\w+)\]", index, re.M)) == set(ROOMS)
