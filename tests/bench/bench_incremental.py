"""What a change of a job of 1000 lines costs until its verdict is there, beside a check of the whole.

Targets (docs/editors.md), CPU time: a change in the last tenth takes at most a fifth of a fresh check, 200 ms without
physics; one near the beginning at most 0.4 more than a fresh check: what is kept of 64 states costs what it did
when moves without physics took a fifth longer.
"""

from __future__ import annotations

import random
import statistics
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import Bounds, check_job
from isel_twin.jobs.checks.incremental import IncrementalCheck
from isel_twin.jobs.job import Line, parse_job
from isel_twin.language import create_language
from tests.bench.bench_spec import cpu_s

HERE, LENGTH = Path("job.txt"), 1000
HEAD = ("@07", "@0R7", "@0j300", "@0M3200,4000,3200,4000,0,10000,0,30")


def rows(seed: int = 1) -> list[str]:
    """Moves of at most 2.5 mm in X and Y, as CAM programs write them."""
    draw, x, y = random.Random(seed), 3200, 3200
    made = [*HEAD]
    while len(made) < LENGTH:
        to_x, to_y = (min(max(at + draw.randint(-800, 800), 500), 9000) for at in (x, y))
        made.append(f"@0A{to_x - x},3000,{to_y - y},3000,0,10000,0,30")
        x, y = to_x, to_y
    return made


def lines(made: Sequence[str]) -> Sequence[Line]:
    return parse_job("\n".join(made) + "\n", create_language("imc-s8"), "imc-s8")


@pytest.mark.benchmark(group="incremental")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_a_change_of_a_line(plant: str, benchmark: Any) -> None:
    call, bounds, draw = TwinSpec(plant=plant), Bounds(), random.Random(2)
    check_job(HERE, call, lines(rows()[:20]), bounds)
    check, made = IncrementalCheck(HERE, call, bounds), rows()
    first_s = cpu_s(lambda: check.check(lines(made)))
    fresh_s = cpu_s(lambda: check_job(HERE, call, lines(made), bounds))

    def changed_s(first: int, last: int) -> float:
        """After a change of one of these lines."""
        at = draw.randint(first, last)
        made[at] = made[at].replace("A", "A1", 1) if len(made[at]) % 2 else made[at].replace(",3000", ",2900", 1)
        return cpu_s(lambda: check.check(lines(made)))

    late_s = [changed_s(900, 999) for _ in range(9)]
    anywhere_s = [changed_s(4, 40) for _ in range(3)]
    benchmark.pedantic(changed_s, (900, 999), rounds=3)
    benchmark.extra_info["CPU ms, in the last tenth"] = 1e3 * statistics.median(late_s)
    benchmark.extra_info["CPU ms, in the last tenth, most"] = 1e3 * max(late_s)
    benchmark.extra_info["CPU ms, near the beginning"] = 1e3 * statistics.median(anywhere_s)
    benchmark.extra_info["CPU ms, a fresh check"] = 1e3 * fresh_s
    benchmark.extra_info["last tenth by fresh check"] = statistics.median(late_s) / fresh_s
    benchmark.extra_info["first judgement by fresh check"] = first_s / fresh_s
    assert statistics.median(late_s) <= 0.2 * fresh_s
    assert statistics.median(late_s) <= 0.2 or plant != "kinematic"
    assert statistics.median(anywhere_s) <= 1.4 * fresh_s
