"""python -m tests.interop.rs274.record: what rs274 makes of thirty random programs, kept for test_recorded.py."""

from __future__ import annotations

import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.interop.rs274.canon import command, interpreted
from tests.interop.rs274.programs import program

FILE = Path(__file__).parent / "recorded.json"


def main() -> int:
    interpreter = command()
    if interpreter is None:
        print("rs274 is not installed: on Debian it is in linuxcnc-uspace; or set RS274 to its path")
        return 2
    with TemporaryDirectory() as folder:
        rows = []
        for seed in range(30):
            moves, error = interpreted(interpreter, program(seed), Path(folder))
            rounded = [[part if isinstance(part, str) else round(part, 5) for part in move] for move in moves]
            rows.append({"program": program(seed), "moves": rounded, "error": error})
    FILE.write_text("[\n" + ",\n".join(json.dumps(row) for row in rows) + "\n]\n")
    return 0


if __name__ == "__main__":
    sys.exit(main())
