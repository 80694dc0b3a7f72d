"""Try every cell and write docs/faults.md: python -m tests.matrix"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.matrix.cells import cells, outcome
from tests.matrix.table import write_table


def main() -> int:
    found, broken = {}, 0
    for cell in cells():
        with TemporaryDirectory() as folder:
            made = outcome(*cell, Path(folder))
        found[cell] = made.words
        print(f"{' '.join(cell)}: {made.words}", flush=True)
        if made.broken:
            broken += 1
            print(f"{' '.join(cell)}: {made.broken}", file=sys.stderr)
    write_table(found)
    print(f"{len(found)} cells, {broken} broken")
    return 1 if broken else 0


if __name__ == "__main__":
    sys.exit(main())
