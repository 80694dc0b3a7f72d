"""python -m tests.cam [NUMBER]: so many random toolpaths are written for each family of controllers and played. Exit
code 1 if one ends beside its end, leaves the path by more than the tolerance and a step, or is faster than asked."""

from __future__ import annotations

import argparse
import sys
import traceback
from pathlib import Path

from hypothesis import HealthCheck, Phase, given, seed, settings

sys.path.append(str(Path(__file__).parents[1]))  # as pytest does

from cam.played import check_made
from cam.random_paths import paths

from isel_twin.cam.toolpath import Element

TURNS = {"imc-s8": 3, "ismif": 2, "gmi99": 2, "bwo900": 2}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("number", nargs="?", type=int, default=1000, help="of toolpaths for each")
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    many = settings(
        max_examples=asked.number,
        deadline=None,
        database=None,
        phases=(Phase.generate, Phase.shrink),
        suppress_health_check=list(HealthCheck),
    )
    wrong = 0
    for controller, turns in TURNS.items():

        @seed(asked.seed)
        @many
        @given(path=paths(turns=turns))
        def made(path: list[Element]) -> None:
            check_made(controller, path)  # noqa: B023  (called within the loop)

        verdict = "all within a step"
        try:
            made()
        except AssertionError:
            wrong, verdict = wrong + 1, "one is wrong"
            traceback.print_exc()
        print(f"{controller}: {asked.number} toolpaths, {verdict}", flush=True)
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
