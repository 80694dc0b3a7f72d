"""python -m tests.interop.judges N [--first SEED]: N random parts for four controllers, read by every judge here.

RS274, GCODE_PYTHON, GCODE_TOOLPATH name them: tests/interop/judges/asked.py. Prints what differs. --record takes six
short ones and keeps what was read for test_recorded.py.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from tests.interop.judges.asked import judges
from tests.interop.judges.compared import MACHINES, SETTINGS, astray, decoded, near_mm, program, unlike, written
from tests.interop.judges.parts import part
from tests.interop.rs274.canon import LOOSE, Move

RECORDED = Path(__file__).parent / "recorded.json"
ALL = ("rs274", "pygcode", "gcode-toolpath")
SHORT = {seed: 2 for seed in (10, 16, 19, 21, 29, 170)}  # arcs, turns, holes, mm and inch


def heard(text: str, folder: Path) -> dict[str, Any]:
    """What the judges read in a part and in all that is made of it."""
    asked = judges(folder)
    files = {controller: written(decoded(text, controller)) for controller in MACHINES}
    read = {
        name: {controller: _rounded(judge(file)) for controller, file in files.items()} for name, judge in asked.items()
    }
    rs274 = asked["rs274"]
    return {"part": text, "moves": _rounded(rs274(text)), "bwo900": _rounded(rs274(program(text))), "files": read}


def _rounded(moves: Iterable[Move]) -> list[Move]:
    return [tuple(one if isinstance(one, str) else round(float(one), 5) for one in move) for move in moves]


def verdicts(row: Mapping[str, Any]) -> Iterator[str]:
    """All that a judge read otherwise."""
    moves: Sequence[Move] = row["moves"]
    for controller in MACHINES:
        path = decoded(row["part"], controller)
        for name, files in row["files"].items():
            if why := unlike(path, files[controller]):
                yield f"{name}, file of {controller}: {why}"
        if why := astray(moves, row["files"]["rs274"][controller], near_mm(controller)):
            yield f"file of {controller} {why}"
    if why := astray(moves, row["bwo900"], LOOSE + SETTINGS.tolerance_mm, -1):
        yield f"program of bwo900 {why}"


def main() -> int:
    parser = argparse.ArgumentParser(prog="python -m tests.interop.judges", description=__doc__)
    parser.add_argument("number", type=int, nargs="?", default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--record", action="store_true")
    call = parser.parse_args()
    with TemporaryDirectory() as folder:
        here = judges(Path(folder))
        missing = [name for name in ALL if name not in here]
        if "rs274" in missing or (call.record and missing):
            print(f"not here: {', '.join(missing)} (tests/interop/judges/asked.py says where they are looked for)")
            return 2
        wrong, rows = 0, []
        drawn = SHORT if call.record else dict.fromkeys(range(call.first, call.first + call.number), 7)
        for seed, most in drawn.items():
            try:
                rows.append(heard(part(seed, most), Path(folder)))
                found = list(verdicts(rows[-1]))
            except ValueError as error:
                found = [f"refused: {error}"]
            wrong += len(found)
            for why in found:
                print(f"seed {seed}: {why}", flush=True)
    if call.record:
        RECORDED.write_text("[\n" + ",\n".join(json.dumps(row, separators=(",", ":")) for row in rows) + "\n]\n")
    print(f"{len(drawn)} parts, {wrong} readings differ; not here: {', '.join(missing) or 'none'}")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
