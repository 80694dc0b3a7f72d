"""python -m tests.interop.gerbv N [--first SEED]: N random drill files, read here and by gerbv; prints what differs.

--record keeps what gerbv reads in them for test_recorded.py. On Debian gerbv is a package of this name.
"""

from __future__ import annotations

import argparse
import json
import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from tests.interop.gerbv.files import file
from tests.interop.gerbv.image import command, differ, ncp, ncp_differs, read, seen

RECORDED = Path(__file__).parent / "recorded.json"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.interop.gerbv", description=__doc__)
    parser.add_argument("number", type=int)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--record", action="store_true")
    call = parser.parse_args()
    gerbv = command()
    if gerbv is None:
        print("gerbv is not installed: on Debian it is a package of this name")
        return 2
    wrong = refused = 0
    rows = []
    with TemporaryDirectory() as folder:
        for seed in range(call.first, call.first + call.number):
            text, _ = file(seed)
            theirs = seen(gerbv, text, Path(folder))
            nc = ncp(gerbv, Path(folder))
            rows.append({"file": text, "marks": [[round(value, 5) for value in mark] for mark in theirs], "ncp": nc})
            ours, said = read(text.splitlines(keepends=True))
            if said and "which zeros" in said[-1]:  # gerbv takes TZ; here nothing is concluded (cam/43)
                refused += 1
            elif why := differ(ours, theirs) or ncp_differs(nc, theirs):
                wrong += 1
                print(f"seed {seed}: {why} {said}", flush=True)
    if call.record:
        RECORDED.write_text("[\n" + ",\n".join(map(json.dumps, rows)) + "\n]\n")
    print(f"{call.number} files, {refused} refused here, {wrong} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
