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
from isel_twin.capture.vcd import SCAN
from isel_twin.native import core
data, keys, levels = np.frombuffer(b"1!", np.uint8), np.array([33]), np.zeros(1, np.int8)
core.scan_dump(data, keys, np.zeros(1, SCAN), levels, levels, levels, np.zeros(9, np.int64), np.zeros(9, np.uint8))
"""


def test_a_debug_build_tells_of_an_array_that_is_too_short(tmp_path: Path) -> None:
    built = compiling.build(tmp_path / f"core{compiling.suffix()}", extra=("-DDEBUG",))
    done = subprocess.run(
        [sys.executable, "-c", TOO_SHORT], env=os.environ | {"ISEL_TWIN_CORE": str(built)},
        capture_output=True, text=True, check=False, timeout=PATIENCE_S,
    )  # fmt: skip
    assert "vcd.c:" in done.stderr
    assert "lost_n == keys_n + 1" in done.stderr
    assert done.returncode == -signal.SIGABRT
