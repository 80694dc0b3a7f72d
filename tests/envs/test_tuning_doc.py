"""The programs of docs/tuning.md run as they stand there and give what the text says.

Left out are the one that needs Optuna, the one with a process pool and the search for the fastest setting: the last two
do what tests/envs/test_sweep.py does.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

TEXT = (Path(__file__).parents[2] / "docs" / "tuning.md").read_text(encoding="utf-8")


def run_program(heading: str) -> dict[str, Any]:
    """The names that the first program under a heading leaves behind."""
    section = TEXT.split(f"## {heading}\n")[1]
    program = re.search(r"```python\n(.*?)```", section, re.DOTALL)
    assert program is not None
    names: dict[str, Any] = {}
    exec(compile(program[1], f"docs/tuning.md, {heading}", "exec"), names)
    return names


def test_the_table() -> None:
    rows = run_program("Tables")["rows"]
    assert [(row.speed_hz, row.acceleration_hz_per_ms) for row in rows] == [
        (10_000, 100), (10_000, 1600), (25_000, 100), (25_000, 1600)
    ]  # fmt: skip
    assert rows[0].good
    assert rows[0].time_s > rows[2].time_s > rows[3].time_s
    assert rows[1].settling_s > rows[0].settling_s, "the steep ramp makes the table with its 8 kg ring"


def test_random_search() -> None:
    reward, plan = run_program("The environment")["best"]
    assert len(plan) == 2
    assert -10.0 < reward < 0.0, "seconds; any penalty is at least ten"
