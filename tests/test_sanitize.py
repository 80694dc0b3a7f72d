"""A debug build of the core ends at the line that would go beyond an array."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
from pathlib import Path

from isel_twin.native import compiling
from tests.forked import PATIENCE_S

TOO_SHORT = """
import numpy as np
from isel_twin.native import core
pool, ends, room = np.frombuffer(b"0!", np.uint8), np.array([0, 2]), np.zeros(99, np.uint8)
core.lay_lines(np.array([7]), np.ones(1, np.uint8), np.array([1]), pool, ends, room)
"""


def test_a_debug_build_tells_of_an_array_that_is_too_short(tmp_path: Path) -> None:
    built = compiling.build(tmp_path / f"core{compiling.suffix()}", extra=("-DDEBUG",))
    done = subprocess.run(
        [sys.executable, "-c", TOO_SHORT], env=os.environ | {"ISEL_TWIN_CORE": str(built)},
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert "vcd.c:" in done.stderr
    assert "which[i] + 1 < ends_n" in done.stderr
    assert done.returncode == -signal.SIGABRT
