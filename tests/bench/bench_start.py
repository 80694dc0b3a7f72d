"""What a process costs before it works: CPU time beside that of importing MuJoCo, taken in the same run.

Targets (docs/performance.md): three lines of a job take at most 1.7 times that import without physics, 2.6 times with
physics, `check` of the sample job 2.8 times; what needs no twin takes at most 0.6 times.
"""

from __future__ import annotations

import os
import subprocess
import sys
from importlib import resources
from pathlib import Path
from typing import Any

import pytest

from isel_twin.native import core

JOB = "@07\n@0R7\n@0A8000,5000,0,30,0,30,0,30\n"
IMPORTS = "import mujoco"
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
        (["--version"], 0.6),
        (["run", "job.txt", "--plant", "kinematic"], 1.7),
        (["run", "job.txt", "--plant", "mujoco"], 2.6),
        (["check", "sample.txt"], 2.8),
    ],
    ids=["version", "kinematic", "mujoco", "check"],
)
def test_a_process(
    benchmark: Any, words: list[str], most: float, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "job.txt").write_text(JOB)
    (tmp_path / "sample.txt").write_text((resources.files("isel_twin.firmware.imc") / "square.txt").read_text())
    core.load()  # in a checkout it may have to be built
    monkeypatch.chdir(tmp_path)
    benchmark.pedantic(cpu_s, (COMMAND, *words), rounds=1)
    imports_s, whole_s = map(min, zip(*((cpu_s(IMPORTS), cpu_s(COMMAND, *words)) for _ in range(ROUNDS)), strict=True))
    benchmark.extra_info["CPU s"] = whole_s
    benchmark.extra_info["times the import of mujoco"] = whole_s / imports_s
    assert whole_s <= most * imports_s
