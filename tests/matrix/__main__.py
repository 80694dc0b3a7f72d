"""Try every cell of the table against the specification, and write docs/faults.md from it: python -m tests.matrix"""

from __future__ import annotations

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.matrix.cells import cells, outcome
from tests.matrix.expected import allowed
from tests.matrix.table import DOCUMENT, page


def main(tools: list[str]) -> int:
    """tools: those to try; none: all."""
    DOCUMENT.write_text(page(), encoding="utf-8")
    tried = [cell for cell in cells() if not tools or cell[0] in tools]
    wrong = 0
    for cell in tried:
        with TemporaryDirectory() as folder:
            made = outcome(*cell, Path(folder))
        right = not made.broken and made.code in allowed(cell)
        wrong += not right
        print(f"{'' if right else 'WRONG '}{' '.join(cell)}: {made.words}", flush=True)
        if not right:
            print(made.broken or made.out + made.err, file=sys.stderr)
    print(f"{len(tried)} cells, {wrong} wrong")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
