"""What a fit costs: five unknowns of X, one measuring day of 40 s at the machine, two stall series.

Target (docs/identification.md): at most 60 s of CPU time on one core.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from isel_twin.many.identification.fit import Fit, fit
from tests.bench.bench_spec import cpu_s
from tests.many.identification.coverage import whole_day

TARGET_S = 60.0


@pytest.mark.benchmark(group="identify")
def test_a_fit_of_five_unknowns_on_one_day(benchmark: Any, tmp_path: Path) -> None:
    study, found = whole_day(tmp_path), list[Fit]()
    day = study.day(1)
    assert len(study.unknowns) == 5

    def fitted() -> float:
        return cpu_s(lambda: found.append(fit(study.machine, study.unknowns, [day], [])))

    spent_s = benchmark.pedantic(fitted, rounds=1)
    benchmark.extra_info["CPU time, s"] = spent_s
    benchmark.extra_info["replays"] = found[-1].replays
    assert spent_s <= TARGET_S
