"""The programs of docs/learning.md run as they stand there."""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

import pytest

pytestmark = pytest.mark.long(seconds=14)

TEXT = (Path(__file__).parents[2] / "docs" / "learning.md").read_text(encoding="utf-8")
PROGRAMS = re.findall(r"```python\n(.*?)```", TEXT, re.DOTALL)


def test_side_by_side() -> None:
    """Two of each, where the page has eight."""
    program = PROGRAMS[2].replace("num_envs=8", "num_envs=2").replace("TrackVector(8", "TrackVector(2")
    assert program.count("2, ") == PROGRAMS[2].count("8, ") >= 2
    names: dict[str, Any] = {}
    exec(compile(program, "docs/learning.md", "exec"), names)
    assert (names["infos"]["way_mm"] > 0.5).all(), "10 mm/s for 0.2 s, or a path begun anew"


@pytest.mark.parametrize("program", PROGRAMS[:2], ids=["a circle", "along random paths"])
def test_a_program_ends_at_the_end_of_its_path(program: str) -> None:
    names: dict[str, Any] = {}
    exec(compile(program, "docs/learning.md", "exec"), names)
    assert names["info"]["ended"] == "done"
