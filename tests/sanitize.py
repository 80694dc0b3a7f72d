"""Run tests with a core that looks at every address, sum and shift: AddressSanitizer, UBSan and the CHECKs of a debug
build.

    python -m tests.sanitize                      the files of TESTS
    python -m tests.sanitize tests/plant -k cut   these

Without a gcc that has both sanitizers one line says so, and nothing is run.
"""

from __future__ import annotations

import os
import shutil
import subprocess
import sys
from pathlib import Path

from isel_twin.native import compiling

ROOT = Path(__file__).parents[1]
LIBRARY = ROOT / "build" / "sanitized" / f"core{compiling.suffix()}"
FLAGS = "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-g", "-O1", "-DDEBUG"
TOO_LONG = "tests/recordings/test_trace.py::test_npz_of_ten_million_steps_needs_little_memory"  # of memory, too
TESTS = (
    "tests/test_sanitize.py",
    "tests/capture/test_scanners.py",
    "tests/capture/test_readers.py",
    "tests/recordings/test_trace.py",
    "tests/plant/test_become.py",
    "tests/plant/test_cutting.py",
    "tests/plant/test_supply.py",
    "tests/plant/test_touch.py",
    "tests/drives/test_step_loss.py",
    "tests/envs/test_track_vector.py",
)


def runtimes() -> list[str]:
    """The libraries of gcc's sanitizers, first to be loaded by a process that loads such a core; none without them."""
    gcc = shutil.which("gcc")
    if gcc is None:
        return []
    asked = [
        subprocess.run([gcc, f"-print-file-name={name}"], capture_output=True, text=True, check=True).stdout.strip()
        for name in ("libasan.so", "libubsan.so")
    ]
    return asked if all(Path(path).is_absolute() for path in asked) else []


def environment() -> dict[str, str]:
    """Variables for a process with the core that is built here. Raises BuildError."""
    LIBRARY.parent.mkdir(parents=True, exist_ok=True)
    compiling.build(LIBRARY, ["gcc"], FLAGS)
    return os.environ | {
        "ISEL_TWIN_CORE": str(LIBRARY),
        "LD_PRELOAD": " ".join(runtimes()),
        "ASAN_OPTIONS": "detect_leaks=0",  # Python leaves much to the end of the process
        "UBSAN_OPTIONS": "print_stacktrace=1",
        "PYTHONMALLOC": "malloc",
    }


def main(arguments: list[str]) -> int:
    """Returns pytest's exit code; 0 if there is nothing to look with."""
    if not runtimes():
        print("sanitize: no gcc with AddressSanitizer and UBSan is here, so nothing was looked at")
        return 0
    chosen = arguments or [*TESTS, "-m", "not slow", "--deselect", TOO_LONG]
    command = [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *chosen]
    return subprocess.run(command, cwd=ROOT, env=environment(), check=False).returncode


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
