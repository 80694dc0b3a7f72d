"""A measuring day from end to end, on a stand-in that differs from the model in five ways of which no fit is told.

    python -m tests.many.identification.day FOLDER [N]          N machines for the bands, 20: some minutes of CPU time

Day 1 is planned and sealed on the 4030, a twin of the stand-in is measured: the score names what differs. Day 2 is
planned on the stand-in's own numbers: nothing is left to differ in.
"""

from __future__ import annotations

import sys
from pathlib import Path

from isel_twin.cli import main as isel_twin

AXES = ("--axes", "x,y")
STAND_IN = """based_on = "4030"
name = "stand-in"

[axes.x]
lead_error = { value = 0.04, unit = "%", grade = "setting", source = "1: a long lead" }
guide_friction = { value = 90.0, unit = "N", grade = "setting", source = "2: tight guides" }

[structure.flex_x]
stiffness = { value = 1.5, unit = "N/um", grade = "setting", source = "3: a loose portal" }

[squareness]
xy = { value = 0.5, unit = "mm/m", grade = "setting", source = "4: out of square" }

[guides]
x_y = { value = 80.0, unit = "um", grade = "setting", source = "5: a bent guide" }

[imperfections]
lead_error = true
squareness = true
straightness = true
"""


def call(*arguments: object) -> int:
    """A command, shown as it would be typed; returns its exit code."""
    words = [str(argument) for argument in arguments]
    print(f"\n$ isel-twin {' '.join(words)}", flush=True)
    try:
        isel_twin(words)
    except SystemExit as ended:
        return int(ended.code or 0)
    return 0


def main(folder: Path, machines: int) -> int:
    """Returns 1 if the days do not end as they should."""
    real = folder / "stand-in"
    real.mkdir(parents=True, exist_ok=True)
    (real / "machine.toml").write_text(STAND_IN)
    codes = []
    for name, machine, seed in (("day1", "4030", 1), ("day2", real, 2)):
        plan = ("--protocol", *AXES, "--machine", machine, "--seed", seed, "--uncertain", machines)
        call("experiment", folder / name, *plan, "--carry-out", real, "--carry-out-seed", 10 + seed)
        codes.append(call("identify", "--score", folder / f"{name}.toml"))
    print(f"\nplanned on the 4030: exit code {codes[0]}; on the machine as it is: exit code {codes[1]}")
    return 0 if codes == [1, 0] else 1


if __name__ == "__main__":
    sys.exit(main(Path(sys.argv[1]), int(sys.argv[2]) if len(sys.argv) > 2 else 20))
