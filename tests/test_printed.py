"""The table of tests/printed.py fits the pages, and what README shows in Python is run here."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.printed import LEFT_OUT, ROOT, blocks, left_out

BLOCKS = blocks()


def test_most_kinds_of_blocks_are_there_and_every_reason_is_needed() -> None:
    """The first reason that fits counts; one that no block has is stale."""
    reasons = [left_out(page, block) for page, block in BLOCKS]
    assert {why for _, why in LEFT_OUT} == set(reasons) - {None}
    assert reasons.count(None) >= 30
    assert sum(not block.startswith("isel-twin") for _, block in BLOCKS) > 20


def test_the_reasons_name_tests_that_there_are() -> None:
    names = {path.name for path in (ROOT / "tests").rglob("*.py")}
    for _, why in LEFT_OUT:
        for word in re.findall(r"[\w/]*test[\w/]*(?:\.py)?", why):
            if word.endswith(".py"):
                assert Path(word).name in names, why
            elif word.startswith("tests/"):
                assert (ROOT / word).is_dir(), why


PROGRAMS = [
    (page, block) for page, block in BLOCKS if not block.startswith("isel-twin") and left_out(page, block) is None
]


@pytest.mark.parametrize(("page", "program"), PROGRAMS, ids=[page for page, _ in PROGRAMS])
def test_a_program_runs_as_printed(page: str, program: str) -> None:
    names: dict[str, object] = {}
    exec(compile(program, page, "exec"), names)
    assert names
