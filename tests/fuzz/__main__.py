"""python -m tests.fuzz N [READER ...] [--first SEED]: N mutated files for each reader; prints what is wrong."""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.fuzz.readers import READERS
from tests.fuzz.trial import trials


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.fuzz", description=__doc__)
    parser.add_argument("number", type=int)
    parser.add_argument("readers", nargs="*", choices=[*READERS, []], default=[])
    parser.add_argument("--first", type=int, default=0)
    call = parser.parse_args()
    wrong = 0
    for name in call.readers or READERS:
        with TemporaryDirectory() as folder:
            found = list(trials(READERS[name], Path(folder), call.number, call.first))
        wrong += len(found)
        print(f"{name}: {call.number} files, {len(found)} wrong", flush=True)
        for seed, why in found[:5]:
            print(f"  seed {seed}: {why}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
