"""The loop with all axes side by side, and with one after the other: the same bits of every array after every call.

Where the processor has no AVX2 both are one after the other."""

from __future__ import annotations

import os
import subprocess
import sys
from pathlib import Path

import pytest

from isel_twin.native import core
from tests.lockstep import compare

pytestmark = pytest.mark.long(seconds=12)
ROOT = Path(__file__).parents[2]
SESSIONS = [
    f"fixed/mujoco/{name}"
    for name in ("imc-s8 machine damped with errors", "imc-s8 machine half steps", "external machine stall",
                 "imc-s8 overload", "imc-s8 broken wire", "imc-s8 machine cuts")
]  # fmt: skip


def log(file: Path, abreast: str) -> Path:
    """The log of the sessions, of a process of its own."""
    line = [sys.executable, "-m", "tests.lockstep", str(file), *SESSIONS]
    subprocess.run(line, cwd=ROOT, env={**os.environ, "ISEL_TWIN_ABREAST": abreast}, check=True)
    return file


def test_the_bits_are_those_of_one_axis_after_the_other(tmp_path: Path) -> None:
    assert compare(log(tmp_path / "abreast", "1"), log(tmp_path / "alone", "0")) is None


@pytest.mark.parametrize(("asked", "abreast"), [("0", 0), ("1", core.has_avx2())])
def test_the_environment_switches_it_off(asked: str, abreast: int) -> None:
    tell = "from isel_twin.native import core; core.load(); print(int(core.abreast))"
    environment = {**os.environ, "ISEL_TWIN_ABREAST": asked}
    done = subprocess.run([sys.executable, "-c", tell], env=environment, capture_output=True, text=True, check=True)
    assert int(done.stdout) == abreast
