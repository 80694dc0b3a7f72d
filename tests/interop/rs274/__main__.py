"""python -m tests.interop.rs274 N [--first SEED]: N random programs, read here and by rs274; prints what differs.

LinuxCNC's interpreter is found on the path or by the variable RS274 (on Debian: package linuxcnc-uspace).
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.interop.rs274.canon import command, interpreted, verdict
from tests.interop.rs274.programs import program


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.interop.rs274", description=__doc__)
    parser.add_argument("number", type=int)
    parser.add_argument("--first", type=int, default=0)
    call = parser.parse_args()
    interpreter = command()
    if interpreter is None:
        print("rs274 is not installed: on Debian it is in linuxcnc-uspace; or set RS274 to its path")
        return 2
    wrong = refused = told = 0
    with TemporaryDirectory() as folder:
        for seed in range(call.first, call.first + call.number):
            text = program(seed)
            theirs, their_error = interpreted(interpreter, text, Path(folder))
            refused += bool(their_error)
            why, is_told = verdict(text, theirs, their_error)
            told += is_told
            if why and not is_told:
                wrong += 1
                print(f"seed {seed}: {why}", flush=True)
    told_so = f"{told} differ as the reader tells (docs/jobfiles.md)"
    print(f"{call.number} programs, {refused} refused by rs274, {told_so}, {wrong} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
