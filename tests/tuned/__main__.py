"""python -m tests.tuned grid | others JOB: what `isel-twin tune` finds, judged by what did not find it.

    grid           four jobs on the iMC: 25 trials against a fine grid, of which everything is tried that is faster than
                   the fastest that holds (what loses steps loses them with more of anything)
    others JOB     a job on 200 machines that are drawn as somebody else would: uniformly within the tolerances of
                   sheets and catalogues, all at once

Both take minutes. Exit code 1 if a tuned job is slower than the grid's, or more than 2 % of the machines lose steps.
"""

from __future__ import annotations

import argparse
import math
import sys
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from isel_twin.base.crew import in_order
from isel_twin.cli.options import crew_of
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs.job import parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language
from isel_twin.many.tuning import Problem
from isel_twin.many.tuning.judge import Weather, judged
from isel_twin.many.tuning.study import Study

JOBS = Path(__file__).parents[1] / "jobs/imc"
MARGIN = 0.2
TRIALS = 25
SLOWER = 1.01  # of the tuned job's time over the grid's: the grid's own step is more
MOST_LOST = 0.02
START = "@07\n@0R7\n@0j300\n@0J100\n"


def long() -> str:
    """Eight ways of 200 mm."""
    return START + "@0A64000,10000,0,30,0,30,0,30\n@0A-64000,10000,0,30,0,30,0,30\n" * 4


def zigzag() -> str:
    """Rows of 60 mm, 4 mm apart, both axes in each."""
    row = "@0A19200,10000,1280,667,0,30,0,30\n@0A-19200,10000,1280,667,0,30,0,30\n"
    return START + row * 10


GRID_JOBS = {"long": long, "zigzag": zigzag} | {
    name: (JOBS / f"{name}.txt").read_text for name in ("placing", "circles")
}
SPEEDS = np.unique(np.round(np.geomspace(5000, 21_000, 36))).astype(int).tolist()
RAMPS = np.unique(np.round(np.geomspace(60, 3000, 36))).astype(int).tolist()
STARTS = (300, 500, 800, 1200)


def grid(name: str, workers: int) -> bool:
    """Whether 25 trials are as good as the grid."""
    problem = Problem(GRID_JOBS[name](), TwinSpec(), repetitions=5, speed_share=1.0 - MARGIN)
    study = Study(problem, least=MARGIN)
    study.judge_references(lambda: False)
    study.run(TRIALS, crew_of(workers))
    held = [one for one in study.tried if one.judgement.good and one.judgement.margin >= MARGIN]
    found = min(held, key=lambda one: one.judgement.time_s)
    low, high = problem.parameters[0].low, problem.parameters[0].high
    places = [(v, a, f) for v in SPEEDS if low <= v <= high for a in RAMPS for f in STARTS]
    by_time = sorted(places, key=lambda place: _time_s(problem, place))
    lost: list[tuple[int, int, int]] = []
    tried = 0
    for place in by_time:
        if any(all(mine >= theirs for mine, theirs in zip(place, gone, strict=True)) for gone in lost):
            continue
        tried += 1
        candidate = problem.candidate(_values(place))
        outcome = judged(candidate, Weather.of(problem), range(problem.repetitions + 1), MARGIN)
        assert outcome is not None
        if outcome.good and outcome.margin >= MARGIN:
            break
        lost.append(place)
    else:
        raise AssertionError("nothing on the grid holds")
    good = found.judgement.time_s <= SLOWER * outcome.time_s
    print(
        f"{name}: tuned {found.judgement.time_s:.3f} s in {len(study.tried)} trials {dict(found.values)}; grid "
        f"{outcome.time_s:.3f} s in {tried} {place}",
        flush=True,
    )
    return good


def _values(place: tuple[int, int, int]) -> dict[str, int]:
    return dict(zip(("speed_hz", "acceleration_hz_per_ms", "start_stop_hz"), place, strict=True))


def _time_s(problem: Problem, place: tuple[int, int, int]) -> float:
    """By the closed form of each straight move, for the order only."""
    speed, ramp, start = place
    total = 0.0
    for move in problem.moves:
        text = problem.lines[move.line].command
        numbers = [int(number) for number in text[3:].split(",")] if text[2] in "AM" else []
        steps = max((abs(number) for number in numbers[::2]), default=0)
        top = speed if max(move.speeds_hz, default=0) >= problem.rapid_from_hz else max(move.speeds_hz, default=start)
        top = max(top, start)
        rise = min((top**2 - start**2) / (2e3 * ramp), steps / 2)
        peak = math.sqrt(start**2 + 2e3 * ramp * rise)
        total += 2.0 * (peak - start) / (1e3 * ramp) + (steps - 2.0 * rise) / top
    return total


def machines(spec: TwinSpec, number: int, seed: int) -> Iterator[tuple[int, Mapping[str, Any]]]:
    """Seeds and overrides of machines as somebody else would draw them."""
    tree = spec.fitted().tree
    random = np.random.default_rng([seed, 1_000_003])
    for each in range(number):
        overrides: dict[str, Any] = {}

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


def others(job: Path, number: int, seed: int, workers: int) -> bool:
    spec = TwinSpec()
    work = [
        (job.read_text(), spec.with_(seed=each, overrides=overrides))
        for each, overrides in machines(spec, number, seed)
    ]
    lost = [axes for axes in in_order(_lost, work, crew_of(workers)) if axes]
    print(f"{job}: {len(lost)} of {number} machines lose steps, on {', '.join(sorted(set(lost))) or 'no axis'}")
    return len(lost) <= MOST_LOST * number


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("what", choices=("grid", "others"))
    parser.add_argument("jobs", nargs="*", help="of grid: long, zigzag, placing, circles; of others: files")
    parser.add_argument("--number", type=int, default=200, help="of machines")
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    if asked.what == "grid":
        good = [grid(name, asked.workers) for name in asked.jobs or GRID_JOBS]
    else:
        good = [others(Path(job), asked.number, asked.seed, asked.workers) for job in asked.jobs]
    return 0 if all(good) else 1


if __name__ == "__main__":
    sys.exit(main())
