"""A plant of another machine: in place, new, and new with its model compiled, in turns; and the table of a large sweep.

The same bits each time (tests/plant/test_become.py), so only the time differs.
"""

from __future__ import annotations

import statistics
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin.jobs.robust import perturbation
from isel_twin.machine import load_machine, with_overrides
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import OUTCOMES
from isel_twin.many.studies.table import Table
from isel_twin.plant import built, model
from isel_twin.plant.mujoco import MujocoPlant

START_MM = np.array([100.0, 100.0, 30.0])
MACHINE = load_machine("4030")
OTHERS = [with_overrides(MACHINE, perturbation(MACHINE, 0, number)[2]) for number in range(1, 31)]
ROWS = 20_000
PLAN = f"""
[sweep]
moves = [[10, 0, 0]]
plant = "kinematic"
seeds = {ROWS}
"""


def cpu_s(work: Callable[[], object]) -> float:
    began = time.process_time()
    work()
    return time.process_time() - began


def from_scratch(machine: Any) -> MujocoPlant:
    model.bare.cache_clear()
    built._frame.cache_clear()
    return MujocoPlant(machine, (), START_MM)


@pytest.mark.benchmark(group="a plant of another machine")
def test_in_place_beside_new(benchmark: Any) -> None:
    plant, machines = MujocoPlant(MACHINE, (), START_MM), iter(OTHERS)
    spent: dict[str, list[float]] = {"in place": [], "new": [], "compiled": []}

    def turn() -> None:
        machine = next(machines)
        spent["compiled"].append(cpu_s(lambda: from_scratch(machine)))
        spent["new"].append(cpu_s(lambda: MujocoPlant(machine, (), START_MM)))
        spent["in place"].append(cpu_s(lambda: plant.become(machine, START_MM)))

    benchmark.pedantic(turn, rounds=25, warmup_rounds=2)
    compiled, new, in_place = (statistics.median(spent[way]) for way in ("compiled", "new", "in place"))
    benchmark.extra_info["in place over compiled"] = in_place / compiled
    benchmark.extra_info["new over compiled"] = new / compiled
    benchmark.extra_info["in place, ms, least"] = 1e3 * min(spent["in place"])
    assert in_place < 0.2 * compiled


@pytest.mark.benchmark(group="the table of a sweep")
def test_table(benchmark: Any, tmp_path: Path) -> None:
    """What it costs to keep a row, beside what it holds."""
    (tmp_path / "plan.toml").write_text(PLAN, encoding="utf-8")
    plan = load_plan(tmp_path / "plan.toml")
    wanted, draw = points(plan), np.random.default_rng(0)
    outcome = dict.fromkeys(OUTCOMES) | {"ok": True, "commands": 3, "refused": 0, "lost_x": 0, "lost_y": 0, "lost_z": 0}
    times_s = draw.uniform(5.0, 6.0, ROWS).tolist()
    spent: list[float] = []

    def fill() -> None:
        began = time.process_time()
        with Table(tmp_path / "rows.parquet", plan, wanted) as table:
            for point, cycle_s in zip(wanted, times_s, strict=True):
                table.add(point, {**outcome, "cycle_s": cycle_s})
        spent.append(time.process_time() - began)

    benchmark.pedantic(fill, rounds=1)
    benchmark.extra_info["us a row"] = 1e6 * spent[0] / ROWS
    benchmark.extra_info["bytes a row"] = (tmp_path / "rows.parquet").stat().st_size / ROWS
