"""Rows with physics on a dask cluster of two local workers, beside the same rows in this process.

Target (docs/performance.md): two workers do at least 1.8 times the work of one process. By the clock that needs two
cores with nothing else to do; in CPU time, which other work leaves alone, caller, scheduler and workers together spend
at most 2 / 1.8 of what one process does. Each side makes rows whose motors no row before has had. Scheduler and workers
are started as docs/sweeps.md says.
"""

from __future__ import annotations

import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Any

import psutil
import pytest

from isel_twin.base.crew import Crew, cluster, finished, here
from isel_twin.many.studies.plan import load_plan
from isel_twin.many.studies.points import points
from isel_twin.many.studies.row import Point, Work, compute

JOB = "@07\n@0R7\n" + "@0A19200,12000,0,30,0,30,0,30\n@0A-19200,12000,0,30,0,30,0,30\n" * 4
PLAN = '[sweep]\njob = "job.txt"\nstart_mm = [2, 2, 2]\nseeds = 180\nperturbed = true\n'
QUIET = {  # docs/sweeps.md
    "DASK_DISTRIBUTED__WORKER__PROFILE__ENABLED": "False",
    "DASK_DISTRIBUTED__ADMIN__TICK__INTERVAL": "500ms",
    "MALLOC_TRIM_THRESHOLD_": "268435456",
    "MALLOC_MMAP_THRESHOLD_": "33554432",
}
WARM = 12  # rows that each process makes before
TURNS, ROWS = 2, 36  # of each side, one after the other, so that other work troubles both alike


def spent_s() -> float:
    """CPU time of this process and of those that live below it."""
    processes = [psutil.Process(), *psutil.Process().children(recursive=True)]
    return sum(sum(process.cpu_times()[:2]) for process in processes)


@pytest.mark.benchmark(group="cluster")
def test_two_workers_beside_one_process(benchmark: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import dask
    from distributed import LocalCluster

    for name, value in QUIET.items():
        monkeypatch.setenv(name, value)
    dask.config.refresh()

    (tmp_path / "job.txt").write_text(JOB)
    (tmp_path / "plan.toml").write_text(PLAN)
    plan = load_plan(tmp_path / "plan.toml")
    rows = points(plan)
    ahead = iter(rows)

    def take(number: int) -> list[Point]:
        return [next(ahead) for _ in range(number)]

    def made(crew: Crew, some: Sequence[Point], work: Work = plan.work) -> tuple[float, float]:
        began_s, began_cpu_s = time.perf_counter(), spent_s()
        assert len(list(finished(partial(compute, work), some, crew))) == len(some)
        return time.perf_counter() - began_s, spent_s() - began_cpu_s

    alone: list[tuple[float, float]] = []
    both: list[tuple[float, float]] = []
    made(here(), take(WARM))
    with (
        LocalCluster(n_workers=2, threads_per_worker=1, host="127.0.0.1", dashboard_address=None) as two,
        cluster(two.scheduler_address) as remote,
    ):
        made(remote, take(2 * WARM))
        benchmark.pedantic(
            lambda: both.append(made(remote, take(ROWS))),
            setup=lambda: alone.append(made(here(), take(ROWS))),
            rounds=TURNS,
        )
    (alone_s, alone_cpu_s), (both_s, both_cpu_s) = (map(sum, zip(*spent, strict=True)) for spent in (alone, both))
    benchmark.extra_info |= {
        "CPU ms a row, here": 1e3 * alone_cpu_s / (TURNS * ROWS),
        "CPU ms a row, on the cluster": 1e3 * both_cpu_s / (TURNS * ROWS),
        "work done in the time of one, by the clock": alone_s / both_s,
        "CPU time over that of one process": both_cpu_s / alone_cpu_s,
    }
    assert both_cpu_s <= 2.0 / 1.8 * alone_cpu_s
