"""Random changes of a job, as who writes it makes them: each text is judged again, and must be judged as if for the
first time.

python -m tests.jobs.edits 200          so many changes for each controller, on both plants
"""

from __future__ import annotations

import contextlib
import random
import sys
from collections.abc import Iterator
from pathlib import Path

from isel_twin.base.crew import GivenUp
from isel_twin.cam.settings import CamSettings
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.checks import Bounds, check_job
from isel_twin.jobs.checks.incremental import IncrementalCheck
from isel_twin.jobs.job import JobError
from isel_twin.jobs.toolpaths import lines_of, source_of
from isel_twin.language import create_language

IMC = ("@07", "@0R7", "@0A{a},2000,{b},2000,0,30,0,30", "@0A{a},{b}000,0,30,0,30,0,30", "@0P", "@0j{b}00", "@0Jfast",
       "! x < {a} mm", "! steps > {a}", "@0P => * within 0.01 s", "<0.1s> @0n1")  # fmt: skip
LINES = {
    "imc-s8": ("4030", IMC),
    "c142": ("4030", IMC),
    "ismif": ("4030", ("R7<1>", "L1,X{a}<1>", "L1,X{a},Y{b}<1>", "! x < {a} mm", "nonsense<1>")),
    "gmi99": ("4030-servo", ("Q7;1", "f{a}", "M{a}", "81h {a}", "! x < {a} mm", "nonsense")),
    "bwo900": ("4030-servo", ("N{a} G1 F300 G91 X{b}",)),
}
ALL = ("", "# a remark", "   ")


class Writer:
    """Writes and changes a job."""

    def __init__(self, controller: str, seed: int, length: int) -> None:
        self.machine, self._lines = LINES[controller]
        self._draw = random.Random(seed)
        self.lines = [*self._lines[:2], *(self._line() for _ in range(length))]

    def _line(self) -> str:
        text = self._draw.choice((*self._lines, *self._lines, *ALL))
        return text.format(a=self._draw.randint(1, 800), b=self._draw.randint(1, 9))

    def texts(self) -> Iterator[str]:
        """Without end: one line is put in, taken out, changed or doubled, or many are."""
        while True:
            yield "\n".join(self.lines) + "\n"
            at, many = self._draw.randrange(len(self.lines)), self._draw.choice((1, 1, 1, 4))
            match self._draw.randrange(4):
                case 0:
                    self.lines[at:at] = [self._line() for _ in range(many)]
                case 1 if len(self.lines) > many + 2:
                    del self.lines[at : at + many]
                case 2:
                    self.lines.append(self._line())
                case _:
                    self.lines[at] = self._line()


def differences(controller: str, plant: str, seed: int, number: int, length: int = 12) -> list[tuple[str, str]]:
    """Texts that are judged otherwise than for the first time, after each of so many changes; what was found then.
    Now and then nobody waits for the report any more."""
    writer, draw = Writer(controller, seed, length), random.Random(seed)
    call = TwinSpec(machine=writer.machine, controller=controller, plant=plant, start_mm=(3.0, 3.0, 3.0))
    bounds = Bounds(timeout_s=60.0, margin=0.5, deviation_mm=0.02, edge=4.0)
    language = create_language(controller)
    check, found = IncrementalCheck(Path("job.txt"), call, bounds), []
    for text, _ in zip(writer.texts(), range(number), strict=False):
        try:
            source = source_of(text.encode(), ".txt", language, controller, call.fitted, CamSettings())
            lines = lines_of(source, text.encode(), language, controller)
        except JobError:
            continue
        if not lines:
            continue
        if draw.random() < 0.2:
            asked = iter(range(draw.randrange(30)))
            with contextlib.suppress(GivenUp):
                check.check(lines, lambda asked=asked: next(asked, None) is None)  # type: ignore[misc]
        again, fresh = check.check(lines), check_job(Path("job.txt"), call, lines, bounds)
        if again != fresh:
            parts = [(name, vars(again)[name], vars(fresh)[name]) for name in vars(again)]
            found.append((text, "\n".join(f"{name} {a} not {b}" for name, a, b in parts if a != b)))
    return found


def main(number: int) -> int:
    wrong = 0
    for controller in LINES:
        for plant in ("kinematic", "mujoco"):
            for seed in range(4):
                found = differences(controller, plant, seed, number, length=30)
                wrong += len(found)
                print(controller, plant, seed, f"{len(found)} of {number} otherwise", *found[:1])
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1])))
