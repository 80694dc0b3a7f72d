"""python -m tests.interop.dumps: has other programs read a dump, and keeps what they say for test_recorded.py.

sigrok-cli 0.7.2 (libsigrok 0.5.2), GTKWave 3.3 (vcd2fst, fst2vcd) and pywellen 0.25.7, which uv fetches.
"""

from __future__ import annotations

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.interop.dumps import readers

RECORDED = Path(__file__).parent / "recorded.json"


def main() -> int:
    if missing := readers.missing():
        print(f"not installed: {', '.join(missing)}")
        return 2
    with TemporaryDirectory() as folder:
        path = Path(folder) / "job.vcd"
        readers.written(path)
        kept = {
            "dump": path.read_text(),
            "sigrok": readers.by_sigrok(path),
            "stepper_motor": {axis: readers.stepper_positions(path, axis) for axis in "xy"},
            "gtkwave": readers.by_gtkwave(path),
            "wellen": readers.by_wellen(path),
        }
    RECORDED.write_text("{\n" + ",\n".join(f'"{name}": {json.dumps(what)}' for name, what in kept.items()) + "\n}\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
