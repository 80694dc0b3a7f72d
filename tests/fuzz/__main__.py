"""python -m tests.fuzz N [READER ...] [--first SEED]: N mutated files for each reader; prints what is wrong,
and how many got past the first refusal."""

from __future__ import annotations

import argparse
import math
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
    parser.add_argument("--seconds", type=float, default=math.inf, help="most for each reader")
    parser.add_argument("--refusals", action="store_true", help="print the most frequent ones")
    call = parser.parse_args()
    wrong = 0
    for name in call.readers or READERS:
        with TemporaryDirectory() as folder:
            found = trials(READERS[name], Path(folder), call.number, call.first, call.seconds)
        wrong += len(found.wrong)
        shares = f"{found.past:.0%} past the first refusal, {found.read / max(1, found.tried):.0%} read"
        print(f"{name}: {found.tried} files, {shares}, {len(found.wrong)} wrong", flush=True)
        for seed, why in found.wrong[:5]:
            print(f"  seed {seed}: {why}", flush=True)
        for words, times in found.refusals.most_common(5 if call.refusals else 0):
            print(f"  {times} times: {words}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
