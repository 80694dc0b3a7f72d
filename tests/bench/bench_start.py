"""What a process costs before it works: CPU time beside that of importing numba and MuJoCo, taken in the same run.

Targets (docs/performance.md): three lines of a job take at most the time of that import without physics, 1.7 times it
with physics, `check` of the sample job 1.8 times; what needs no twin takes at most 0.4 times. On a new machine, with
the lowered code that a wheel brings, three lines with physics take ten times: 6 s.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from isel_twin.core.warm import warm_up

JOB = "@07\n@0R7\n@0A8000,5000,0,30,0,30,0,30\n"
IMPORTS = "import numba, mujoco"
COMMAND = "from isel_twin.cli import main; main()"
ROUNDS = 5


def cpu_s(code: str, *words: str) -> float:
    """CPU time of a process, its children included; its modules are kept as byte code, as in an installation."""
    environment = {name: value for name, value in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    before = os.times()
    subprocess.run([sys.executable, "-c", code, *words], env=environment, check=True, stdout=subprocess.DEVNULL)
    after = os.times()
    return sum(after[2:4]) - sum(before[2:4])


@pytest.mark.benchmark(group="start")
@pytest.mark.parametrize(
    ("words", "most"),
    [
        (["--version"], 0.4),
        (["run", "job.txt", "--plant", "kinematic"], 1.0),
        (["run", "job.txt", "--plant", "mujoco"], 1.7),
        (["check", "sample.txt"], 1.8),
    ],
    ids=["version", "kinematic", "mujoco", "check"],
)
def test_a_process(
    benchmark: Any, words: list[str], most: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "job.txt").write_text(JOB)
    (tmp_path / "sample.txt").write_text((resources.files("isel_twin.firmware.imc") / "square.txt").read_text())
    for plant in ("kinematic", "mujoco"):
        warm_up(plant)
    monkeypatch.chdir(tmp_path)
    benchmark.pedantic(cpu_s, (COMMAND, *words), rounds=1)
    imports_s, whole_s = map(min, zip(*((cpu_s(IMPORTS), cpu_s(COMMAND, *words)) for _ in range(ROUNDS)), strict=True))
    benchmark.extra_info["CPU s"] = whole_s
    benchmark.extra_info["times the import of numba and mujoco"] = whole_s / imports_s
    assert whole_s <= most * imports_s


@pytest.mark.benchmark(group="first start")
def test_a_new_machine(benchmark: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """All kernels from lowered code, and a first run with physics; no code is kept yet."""
    (tmp_path / "job.txt").write_text(JOB)
    monkeypatch.chdir(tmp_path)
    lowered = f"from pathlib import Path; from isel_twin.base import lowered; lowered.FOLDER = Path({str(tmp_path)!r})"
    monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / "of the builder"))
    subprocess.run([sys.executable, "-m", "isel_twin.core.lower", str(tmp_path)], check=True, stderr=subprocess.DEVNULL)
    imports_s = min(cpu_s(IMPORTS) for _ in range(ROUNDS))
    for words in (["warm"], ["run", "job.txt", "--plant", "mujoco"]):
        monkeypatch.setenv("NUMBA_CACHE_DIR", str(tmp_path / words[0]))
        spent_s = cpu_s(f"{lowered}; {COMMAND}", *words)
        benchmark.extra_info[f"first {words[0]}, times the import of numba and mujoco"] = spent_s / imports_s
        assert spent_s <= 10.0 * imports_s
    benchmark.pedantic(cpu_s, (f"{lowered}; {COMMAND}", "warm"), rounds=1)
