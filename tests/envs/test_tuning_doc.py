"""The programs of docs/tuning.md run as they stand there and give what the text says.

Left out are the one that needs Optuna, the one with a process pool and the search for the fastest setting: the last two
do what tests/envs/test_sweep.py does.
"""

from __future__ import annotations

import re
from pathlib import Path
from typing import Any

TEXT = (Path(__file__).parents[2] / "docs" / "tuning.md").read_text(encoding="utf-8")


def run_program(heading: str, number: int = 0) -> dict[str, Any]:
    """The names that a program under a heading leaves behind, the first by itself."""
    section = TEXT.split(f"## {heading}\n")[1]
    program = re.findall(r"```python\n(.*?)```", section, re.DOTALL)[number]
    names: dict[str, Any] = {}
    exec(compile(program, f"docs/tuning.md, {heading}", "exec"), names)
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


def test_the_search_that_branches() -> None:
    """The long way wants the speed and the steep ramp, whatever the short one wants."""
    names = run_program("Going back: searches that branch")
    assert [settings.speed_hz for settings in names["plan"]] == [16_000, 16_000]
    assert 0.0 < names["time_s"] < 10.0, "seconds; any penalty is at least ten"
    env = names["env"]
    env.reset(seed=0)
    straight = [env.step(names["to_action"](settings))[1] for settings in names["plan"]]
    assert -sum(straight) == names["time_s"], "the plan, made from the start, takes to the bit the time that was found"


def test_the_branch_in_mid_move() -> None:
    ends = run_program("Going back: searches that branch", 1)["ends"]
    assert ends[0.0] > ends[-80.0] > 0.0, "a push against the motion takes torque"
