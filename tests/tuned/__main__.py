"""python -m tests.tuned grid | beyond | others JOB: what `isel-twin tune` finds, judged by what did not find it.

    grid [NAME]    jobs on all controllers: 25 trials against a grid, of which everything is tried that is faster, from
                   the slowest of it on (what loses steps loses them with more of anything)
    beyond         ways of 200 mm with speeds beyond that from which on a swing grows: on the machine as it is, against
                   the best by hand; and whether anything there holds on 149 machines
    others JOB     a job on 200 machines that are drawn as somebody else would: uniformly within the tolerances of
                   sheets and catalogues, all at once; stages that fall for 0.3 to 1 of the time (--fast: 1)

All take minutes. Exit code 1 if a tuned job is slower than the grid's or the one by hand, if anything
beyond holds, or if more than 2 % of the machines lose steps.
"""

from __future__ import annotations

import argparse
import itertools
import math
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from isel_twin.base.crew import in_order
from isel_twin.base.units import SECOND_NS
from isel_twin.cli.options import crew_of
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from isel_twin.many.tuning import Judgement, Problem, confirm
from isel_twin.many.tuning.judge import Weather, repeated
from isel_twin.many.tuning.study import Study

JOBS = Path(__file__).parents[1] / "jobs"
TRIALS = 25
SLOWER = 1.05  # most of the tuned job's time over that of the fastest on the grid
MOST_LOST = 0.02
START = "@07\n@0R7\n@0j300\n@0J100\n"


@dataclass(frozen=True)
class Case:
    """A job, and the grid of settings that is to be beaten."""

    text: str
    controller: str = "imc-s8"
    machine: str = "4030"
    margin: float = 0.2
    fine: int = 36  # speeds, and ramps

    @cached_property
    def problem(self) -> Problem:
        return Problem(self.text, TwinSpec(self.machine, self.controller), speed_share=1.0 - self.margin)

    def places(self) -> list[dict[str, int]]:
        """All settings of the grid."""
        values = [
            np.unique(np.round(np.geomspace(one.low, one.high, 4 if one.setting == "start_stop_hz" else self.fine)))
            for one in self.problem.parameters
        ]
        names = [one.name for one in self.problem.parameters]
        return [dict(zip(names, map(int, place), strict=True)) for place in itertools.product(*values)]

    def time_s(self, place: Mapping[str, int]) -> float:
        """Of a twin without physics, on which everything holds; for the order only."""
        candidate = self.problem.candidate(place)
        results = played(self.problem.call.with_(plant="kinematic").build(), candidate.lines).results
        first = next(result for result in results if result.number >= candidate.first)
        return (results[-1].end_ns - first.time_ns) / SECOND_NS


def read(name: str) -> str:
    return (JOBS / name).read_text()


THREE = START + "@0A64000,10000,0,30,0,30,0,30\n@0A-64000,10000,0,30,0,30,0,30\n@0A64000,10000,0,30,0,30,0,30\n"
BEYOND = 0.8  # least edge: speeds up to 1.25 times that from which on a swing grows
BY_HAND_S = 8.08  # 24 000 Hz, 900 Hz/ms
MACHINES = 149
SERVO: Mapping[str, Any] = {"machine": "4030-servo", "fine": 16}
CASES = {
    # eight ways of 200 mm
    "long": Case(START + "@0A64000,10000,0,30,0,30,0,30\n@0A-64000,10000,0,30,0,30,0,30\n" * 4),
    # rows of 60 mm, 4 mm apart, both axes in each
    "zigzag": Case(START + "@0A19200,10000,1280,667,0,30,0,30\n@0A-19200,10000,1280,667,0,30,0,30\n" * 10),
    "placing": Case(read("imc/placing.txt")),
    "circles": Case(read("imc/circles.txt")),
    # in half steps a motor has no margin for instants, at any speed
    "ismif drilling": Case(read("ismif/drilling.txt"), "ismif", margin=0.0, fine=16),
    # rows of 60 mm, 10 mm apart
    "ismif rows": Case(
        "$HZXY<1>\n#E1,1200\nL1,X4800\nL1,Y800\nL1,X0\nL1,Y1600\nL1,X4800<1>\n", "ismif", margin=0.0, fine=16
    ),
    "gmi99 drilling": Case(read("gmi99/drilling.txt"), "gmi99", **SERVO),
    # ways of 100 mm, both axes
    "gmi99 ways": Case("Q4;1\nQ3;1\nM40000\nB100\n" + "83h 100000 60000\n83h 0 0\n" * 2, "gmi99", **SERVO),
    "bwo900 plate": Case(read("bwo900/plate.nc"), "bwo900", **SERVO),
    "bwo900 loop": Case(read("bwo900/loop.nc"), "bwo900", **SERVO),
}


def grid(name: str, workers: int) -> bool:
    """Whether 25 trials are as good as the grid."""
    case = CASES[name]
    problem = case.problem
    study = Study(problem, least=case.margin)
    study.judge_references(lambda: False)
    study.run(TRIALS, crew_of(workers))
    held = [one for one in study.tried if one.judgement.good and one.judgement.margin >= case.margin]
    found = min(held, key=lambda one: one.judgement.time_s)
    fastest_s, fastest = found.judgement.time_s, "none faster"
    lost: list[dict[str, int]] = []
    tried = 0
    faster = [(time_s, place) for place in case.places() if (time_s := case.time_s(place)) < fastest_s]
    for time_s, place in sorted(faster, key=lambda one: -one[0]):
        if time_s >= fastest_s or any(all(place[key] >= theirs for key, theirs in gone.items()) for gone in lost):
            continue
        tried += 1
        numbers = range(problem.repetitions + 1)
        made = repeated(problem.candidate(place), Weather.of(problem), numbers, case.margin)
        assert made is not None
        outcome = Judgement.of(made)
        if outcome.good and outcome.margin >= case.margin:
            fastest_s, fastest = outcome.time_s, f"{outcome.time_s:.3f} s {place}"
        else:
            lost.append(place)
    print(
        f"{name}: tuned {found.judgement.time_s:.3f} s in {len(study.tried)} trials {dict(found.values)}; grid: "
        f"{fastest}, {tried} tried of {len(faster)} that would be faster, of {len(case.places())}",
        flush=True,
    )
    return found.judgement.time_s <= SLOWER * fastest_s


def beyond(workers: int) -> bool:
    """Whether tuning beyond the speed from which on a swing grows is as fast as the best by hand on the machine as it
    is, and nothing there is held by MACHINES that no trial has seen."""
    alone, kind = (Problem(THREE, TwinSpec(), repetitions=number, speed_share=BEYOND, edge=BEYOND) for number in (0, 5))
    found_s = []
    for problem in (alone, kind):
        study = Study(problem)
        study.judge_references(lambda: False)
        study.run(TRIALS, crew_of(workers))
        found_s.append(min(one.judgement.time_s for one in study.tried if one.judgement.good))
        print(f"{problem.repetitions + 1} machines: {found_s[-1]:.3f} s in {len(study.tried)} trials", flush=True)
    limit_hz = kind.fails_from_hz * BEYOND
    places = [
        {"speed_hz": int(speed), "acceleration_hz_per_ms": ramp, "start_stop_hz": 300}
        for speed, ramp in itertools.product(limit_hz * np.linspace(1.25, 0.95, 13), (1200, 600, 300, 150))
    ]
    hard, holding = list[int](), list[dict[str, int]]()
    for place in places:
        held = confirm(kind, kind.candidate(place), MACHINES, hard=hard)
        assert held is not None
        if held.good:
            holding.append(place)
        elif held.last.number not in hard:
            hard.insert(0, held.last.number)
    print(f"{MACHINES} more: {len(holding)} of {len(places)} settings hold, from 0.95 to 1.25 of that speed: {holding}")
    return found_s[0] <= BY_HAND_S and not holding


def machines(spec: TwinSpec, number: int, seed: int, fast: bool) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Seeds and overrides of machines as somebody else would draw them. fast: stages of all decay fast."""
    tree = spec.fitted().tree
    random, decays = np.random.default_rng([seed, 1_000_003]), np.random.default_rng([seed, 1_000_033])
    for each in range(number):
        stages = {"kind": "mixed", "mixed_decay": 1.0 if fast else decays.uniform(0.3, 1.0)}
        overrides: dict[str, Any] = {f"axes.all.stage.{key}": value for key, value in stages.items()}

        def put(key: str, factor: float) -> None:
            entry: Any = tree
            for name in key.split("."):
                entry = entry[name]
            overrides[key] = entry["value"] * factor  # noqa: B023  (called within the loop)

        supply, warm_k = random.uniform(0.88, 1.06), random.uniform(0.0, 60.0)
        for name in "xyz":
            axis = f"axes.{name}"
            put(f"{axis}.stage.supply", supply)
            put(f"{axis}.stage.current", random.uniform(0.95, 1.05))
            put(f"{axis}.specimen.resistance", random.uniform(0.9, 1.1) * (1.0 + 0.0039 * warm_k))
            put(f"{axis}.specimen.inductance", random.uniform(0.8, 1.2))
            put(f"{axis}.specimen.torque_constant", random.uniform(0.9, 1.1) * (1.0 - 0.001 * warm_k))
            put(f"{axis}.specimen.rotor_inertia", random.uniform(0.9, 1.1))
            put(f"{axis}.specimen.detent_torque", random.uniform(0.8, 1.2))
            put(f"{axis}.specimen.iron_loss", math.exp(random.uniform(-math.log(2.0), math.log(2.0))))
            put(f"{axis}.guide_friction", math.exp(random.uniform(-math.log(2.0), math.log(2.0))))
            screw = math.exp(random.uniform(-math.log(2.0), math.log(2.0)))
            put(f"{axis}.shaft_coulomb", screw)
            put(f"{axis}.shaft_viscous", screw)
            put(f"{axis}.efficiency", random.uniform(0.80, 0.95) / tree["axes"][name]["efficiency"]["value"])
            put(f"{axis}.stiffness", random.uniform(0.5, 1.0))
        put("payload.mass", random.uniform(0.9, 1.1))
        yield each, overrides


def _lost(work: tuple[str, TwinSpec]) -> str:
    """The axes that lost steps."""
    text, spec = work
    verdict = played(spec.build(), parse_job(text, create_language(spec.controller), spec.controller)).verdict
    return "".join(
        axis for axis, lost, halfway in zip("xyz", verdict.lost, verdict.halfway, strict=False) if lost or halfway
    )


def others(job: Path, number: int, seed: int, workers: int, fast: bool) -> bool:
    spec = TwinSpec()
    work = [
        (job.read_text(), spec.with_(seed=each, overrides=overrides))
        for each, overrides in machines(spec, number, seed, fast)
    ]
    lost = [axes for axes in in_order(_lost, work, crew_of(workers)) if axes]
    print(f"{job}: {len(lost)} of {number} machines lose steps, on {', '.join(sorted(set(lost))) or 'no axis'}")
    return len(lost) <= MOST_LOST * number


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("grid", "beyond", "others"))
    parser.add_argument("jobs", nargs="*", help=f"of grid: {', '.join(CASES)}; of others: files")
    parser.add_argument("--number", type=int, default=200, help="of machines")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--fast", action="store_true", help="others: with stages of fast decay, as the job was tuned")
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    if asked.what == "grid":
        good = [grid(name, asked.workers) for name in asked.jobs or CASES]
    elif asked.what == "beyond":
        good = [beyond(asked.workers)]
    else:
        good = [others(Path(job), asked.number, asked.seed, asked.workers, asked.fast) for job in asked.jobs]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
