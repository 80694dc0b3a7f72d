"""python -m tests.cam [NUMBER]: so many random toolpaths are written for each family of controllers and played. Exit
code 1 if one ends beside its end, leaves the path by more than the tolerance and a step of each axis, or encircles
another area.

They are short, and a twin plays many of them, one after the other: each is a job of its own, but the reference run is
made once. A toolpath that fails is told by its number; `--first` begins there.
"""

from __future__ import annotations

import argparse
import sys
import time
import traceback
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from random import Random

sys.path.append(str(Path(__file__).parents[1]))  # as pytest does

from cam.alone import Alone
from cam.played import FAST, axes_of, check_played
from cam.random_paths import random_path

from isel_twin.base.quiet import quietly

TURNS = {"imc-s8": 3, "ismif": 2, "gmi99": 2, "bwo900": 2}
LAG_S = {"gmi99": 0.025, "bwo900": 0.025}  # of the 4030-servo: corners are exact stops
MOST = 2  # motions behind the first rapid
PARTS = (0.02, 0.05, 0.1, 0.25)  # of the box: radii up to 0.3 .. 3.75 mm
TOLERANCES = (0.002, 0.01)  # mm
POINTS = 400  # of each that are looked at
TOGETHER = 1000  # by one controller


def checked(controller: str, numbers: Sequence[int], seed: int = 0) -> list[int]:
    """Those that are wrong; the traceback of each is printed."""
    wrong, player = [], None
    for count, number in enumerate(numbers):
        if player is None or count % TOGETHER == 0:
            player = Alone(controller, replace(axes_of(controller), lag_s=LAG_S.get(controller, 0.0)))
        random = Random(f"{seed} {controller} {number}")
        path = random_path(random, TURNS[controller], MOST, random.choice(PARTS))
        settings = replace(FAST, tolerance_mm=random.choice(TOLERANCES))
        try:
            with quietly():  # the BWO 900 says that its program is overwritten
                check_played(player, path, settings, POINTS)
        except AssertionError:
            traceback.print_exc()
            print(f"{controller}: toolpath {number} of seed {seed}: {path}", file=sys.stderr, flush=True)
            wrong.append(number)
            player = None
    return wrong


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=1000, help="of toolpaths for each")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--first", type=int, default=0, help="number of the first one")
    parser.add_argument("--controller", choices=list(TURNS), help="only this family")
    asked = parser.parse_args()
    wrong = 0
    for controller in [asked.controller] if asked.controller else TURNS:
        begin_s = time.process_time()
        found = checked(controller, range(asked.first, asked.first + asked.number), asked.seed)
        verdict = f"{len(found)} are wrong" if found else "all within a step"
        took_s = time.process_time() - begin_s
        print(f"{controller}: {asked.number} toolpaths in {took_s:.0f} s of CPU, {verdict}", flush=True)
        wrong += len(found)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
