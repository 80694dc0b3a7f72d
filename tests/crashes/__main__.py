"""python -m tests.crashes [NUMBER]: so many crashes and near misses on each plant; exit code 1 if one is told wrong."""

from __future__ import annotations

import argparse
import sys

import numpy as np

from .play import STEP_NS, kinematic, physical
from .world import crash, near_miss


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=1000, help="of crashes, and of near misses")
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    asked = parser.parse_args()
    wrong = 0
    for kind, most_ns, plant in (("kinematic", 1.0, kinematic), ("mujoco", float(STEP_NS), physical)):
        for what, draw in (("crashes", crash), ("near misses", near_miss)):
            late, missed, false = [], 0, 0
            for seed in range(asked.first, asked.first + asked.number):
                seen = plant(draw(seed))
                if not seen.holds(most_ns):
                    wrong += 1
                    print(f"seed {seed}, {kind}, {what}: {seen}", flush=True)
                missed += seen.told is None and bool(seen.who)
                false += seen.told is not None and not seen.who
                late += [] if np.isnan(seen.late_ns) else [abs(seen.late_ns) * 1e-3]
            least = f", told at most {max(late):.1f} us beside the instant" if late else ""
            print(f"{kind}: {asked.number} {what}, {missed} missed, {false} false{least}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
