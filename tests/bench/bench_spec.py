"""What a twin and a row of a sweep cost beside what they are for: their recipe has been built before.

Targets (docs/performance.md): a kinematic twin from a spec that has been built before takes at most 10 ms of CPU time,
about as much as parsing its machine file; a row of a kinematic sweep takes at most 10 ms more than its
job on a twin that is there already.
"""

from __future__ import annotations

import statistics
import time
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from isel_twin.machine import load_machine
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import compute

JOB = "@07\n@0R7\n@0A {x},2000,0,30,0,30,0,30\n"
PLAN = """
[sweep]
job = "job.txt"
plant = "kinematic"
scenario = "hood.toml"
start_mm = [1.0, 1.0, 1.0]
seeds = 8
[machine]
"payload.mass" = { values = [0.0, 1.0, 2.0, 4.0, 8.0], unit = "kg" }
[job]
x = [100, 200, 300, 400, 500, 600, 700, 800]
"""


def cpu_s(work: Callable[[], object]) -> float:
    """CPU time, which other work leaves alone."""
    began_s = time.process_time()
    work()
    return time.process_time() - began_s


@pytest.mark.benchmark(group="spec")
def test_a_twin_from_a_spec_that_has_been_built(benchmark: Any) -> None:
    spec = TwinSpec(plant="kinematic", overrides={"payload.mass": 4.0})
    text = load_machine("4030").file.read_text()
    spec.build()
    building_s = statistics.median(cpu_s(spec.build) for _ in range(20))
    reading_s = statistics.median(cpu_s(lambda: tomllib.loads(text)) for _ in range(20))
    benchmark.pedantic(spec.build, rounds=5)
    benchmark.extra_info["CPU ms"] = 1e3 * building_s
    benchmark.extra_info["share of reading its machine file"] = building_s / reading_s
    assert building_s <= 0.010


@pytest.mark.benchmark(group="spec")
def test_a_row_beside_its_job_alone(benchmark: Any, tmp_path: Path) -> None:
    (tmp_path / "job.txt").write_text(JOB)
    (tmp_path / "hood.toml").write_text("[[event]]\nat = 50.0\nset = { hood = 'open' }\n")
    (tmp_path / "plan.toml").write_text(PLAN)
    plan = load_plan(tmp_path / "plan.toml")
    rows = points(plan)
    assert len(rows) == 320
    compute(plan.work, rows[0])
    row_s, job_s = [], []
    for point in rows[::20]:
        row_s.append(cpu_s(lambda point=point: compute(plan.work, point)))  # type: ignore[misc]
        twin = plan.work.spec.with_(seed=point.seed).build()
        lines = parse_job(JOB.replace("{x}", str(point.values[-1])), create_language("imc-s8"), "imc-s8")
        job_s.append(cpu_s(lambda twin=twin, lines=lines: played(twin, lines)))  # type: ignore[misc]
    benchmark.pedantic(lambda: compute(plan.work, rows[0]), rounds=5)
    benchmark.extra_info["CPU ms of a row"] = 1e3 * statistics.median(row_s)
    benchmark.extra_info["CPU ms of its job alone"] = 1e3 * statistics.median(job_s)
    assert statistics.median(row_s) <= statistics.median(job_s) + 0.010
