"""Workers that die: every row exactly once, on a dask cluster and on processes of this computer."""

from __future__ import annotations

import json
import os
import signal
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

from isel_twin.base.crew import versions
from isel_twin.cli import main
from tests import forked
from tests.forked import PATIENCE_S
from tests.near import near_switches

pytestmark = pytest.mark.long(seconds=10)

ROWS = 24
PLAN = """
[sweep]
job = "job.txt"
plant = "kinematic"
start_mm = [2, 2, 2]
seeds = 4

[job]
speed = { low = 1000, high = 9000, steps = 6 }
ramp = [100]
"""


@pytest.fixture(scope="module")
def dask() -> Iterator[tuple[str, list[int]]]:
    """Address of a scheduler with two workers, and the process ids of these: forked, after all imports."""
    import dask
    from distributed import LocalCluster
    from distributed.utils import get_mp_context

    with dask.config.set({"distributed.worker.multiprocessing-method": "forkserver"}):
        get_mp_context().set_forkserver_preload(["distributed", "isel_twin.jobs.ready"])
        with LocalCluster(
            n_workers=2, threads_per_worker=1, processes=True, host="127.0.0.1", dashboard_address=None
        ) as cluster:
            yield cluster.scheduler_address, [worker.pid for worker in cluster.workers.values()]


def expected(plan: Path, file: Path) -> bytes:
    """The table that one process makes."""
    with pytest.raises(SystemExit) as caught:
        main(["sweep", str(plan), "--out", str(file), "--workers", "1"])
    assert caught.value.code == 0
    return file.read_bytes()


def rows_while(process: Any, after: int, kill: list[int]) -> list[int]:
    """Numbers of the rows as they are told; so many have come, the first of these processes is killed."""
    rows: list[int] = []
    for line in process.stdout:
        row = json.loads(line)
        if "summary" not in row:
            rows.append(row["row"])
        if len(rows) == after and kill:
            os.kill(kill.pop(0), signal.SIGKILL)
    return rows


@pytest.mark.slow
def test_a_cluster_of_two_of_which_one_is_killed(dask: tuple[str, list[int]], plans: Path) -> None:
    address, pids = dask
    plan = plans / "many.toml"
    plan.write_text(PLAN, encoding="utf-8")
    with forked.start("sweep", plan, "--cluster", address, "--json", stderr=None) as process:
        rows = rows_while(process, ROWS // 2, pids)
        assert process.wait(PATIENCE_S) == 0
    assert len(pids) == 1, "one was killed, half-way"
    assert sorted(rows) == list(range(1, ROWS + 1)), "every row exactly once"
    assert (plans / "many.parquet").read_bytes() == expected(plan, plans / "here.parquet")


@pytest.mark.slow
def test_a_job_is_tuned_on_a_cluster_as_here(
    dask: tuple[str, list[int]], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    job, machine = tmp_path / "job.txt", near_switches(tmp_path, 2.0)
    job.write_text("@07\n@0R7\n@0M1600,5000,0,30,0,30,0,30\n", encoding="utf-8")
    few = ("--trials", "2", "--robust", "1", "--confirm", "1", "--margin", "0", "--json", "--machine", str(machine))
    told = []
    for name, crew in (("cluster", ("--cluster", dask[0])), ("here", ())):
        with pytest.raises(SystemExit) as caught:
            main(["tune", str(job), *few, *crew, "--storage", str(tmp_path / f"{name}.db")])
        assert caught.value.code == 0
        told.append([json.loads(line) for line in capsys.readouterr().out.splitlines()])
    assert told[0] == told[1]
    assert told[0][-1]["confirmed"]["lost"] == 0


@pytest.mark.slow
def test_nothing_is_tuned_on_workers_with_other_versions(
    dask: tuple[str, list[int]], tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    here = versions()
    monkeypatch.setattr("isel_twin.base.crew.versions", lambda: {**here, "mujoco": "4.99"})
    job = tmp_path / "job.txt"
    job.write_text("@07\n@0R7\n@0M1600,5000,0,30,0,30,0,30\n", encoding="utf-8")
    with pytest.raises(SystemExit) as caught:
        main(["tune", str(job), "--trials", "1", "--cluster", dask[0], "--storage", str(tmp_path / "tune.db")])
    assert caught.value.code == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith(f"isel-twin: cluster {dask[0]}: a worker on ")
    assert line.endswith(f" has mujoco {here['mujoco']} instead of 4.99: install the same there")
    assert not (tmp_path / "job.tuned.txt").exists()


def test_processes_of_this_computer_of_which_one_is_killed(plans: Path) -> None:
    plan = plans / "many.toml"
    plan.write_text(PLAN.replace("seeds = 4", "seeds = 2"), encoding="utf-8")
    with forked.start("sweep", plan, "--workers", "2", "--json", stderr=None) as process:
        rows = [json.loads(process.stdout.readline())["row"]]
        os.kill(workers_of(process.pid)[0], signal.SIGKILL)
        rows += rows_while(process, 0, [])
        assert process.wait(PATIENCE_S) == 0
    assert sorted(rows) == list(range(1, ROWS // 2 + 1)), "every row exactly once"


def workers_of(pid: int) -> list[int]:
    """Process ids of a process's local workers: children of the server that forks them."""
    servers = [child for child in children(pid) if b"forkserver" in Path(f"/proc/{child}/cmdline").read_bytes()]
    return [worker for server in servers for worker in children(server)]


def children(pid: int) -> list[int]:
    return [int(child) for child in Path(f"/proc/{pid}/task/{pid}/children").read_text(encoding="utf-8").split()]
