"""python -m tests.edges [--every] [--job PART] [--motor NAME] [--supply V]: do edges of --edge hold?

Six jobs, three motors and two supplies: each job with one motor and supply, or all with all (--every); of these, those
whose job has PART in its name, with that motor and supply. Of 20 fresh seeds none may lose a step at 95 % of an edge of
speed, supply or load, and at least 15 must at 105 %. Seeds on whose power-on place the job as it stands meets a switch
are passed over. Prints a table in Markdown; exit code 1 if an edge does not hold what it promises. A minute of
processor time, six with --every.
"""

from __future__ import annotations

import argparse
import itertools
import sys
from collections.abc import Sequence
from dataclasses import dataclass

from isel_twin.base.crew import in_order
from isel_twin.cli.options import crew_of
from isel_twin.core.spec import TwinSpec
from isel_twin.jobs import edge
from isel_twin.jobs.job import Line, parse_job
from isel_twin.jobs.playing import played
from isel_twin.language import create_language

CONTROLLER = "imc-s8"
START = "@07\n@0N7\n"
JOBS = {
    "a way of X, 200 mm": "@0J60\n@0A64000,14000,0,30,0,30,0,30\n",
    "X there and back": "@0J200\n@0A24000,12000,0,30,0,30,0,30\n@0A-24000,12000,0,30,0,30,0,30\n",
    "Y, steep ramp": "@0J1500\n@0A0,30,32000,10000,0,30,0,30\n",
    "X and Y": "@0J100\n@0A32000,13000,32000,13000,0,30,0,30\n",
    "rows": "@0J400\n" + "@0A12800,11000,0,30,0,30,0,30\n@0A0,30,1600,11000,0,30,0,30\n" * 2,
    "a way of Y at speed": "@0J100\n@0A0,30,64000,15000,0,30,0,30\n",
}
MOTORS = {"23HS32-4004S": 4.2, "57HS56-2804": 2.8, "QSH6018-65-28-210": 3.96}  # A of the stage, peak
SUPPLIES_V = (48.0, 36.0)
QUANTITIES = ("speed", "supply", "load")
SEEDS = range(1000, 1060)  # none that an edge was found on
FRESH = 20  # of them
LOSING = 15  # least number of those


@dataclass(frozen=True)
class Held:
    """An edge, and on how many fresh seeds the job was lost at 95 and at 105 % of it."""

    edge: edge.Edge
    before: int
    beyond: int

    @property
    def good(self) -> bool:
        return self.before == 0 and self.beyond >= LOSING


def spec_of(motor: str, supply_v: float) -> TwinSpec:
    stage = {"axes.all.stage.supply": supply_v, "axes.all.stage.current": MOTORS[motor]}
    return TwinSpec(controller=CONTROLLER, overrides={"axes.all.motor": motor, **stage})


def lines_of(text: str) -> Sequence[Line]:
    return parse_job(START + text, create_language(CONTROLLER), CONTROLLER)


def held(spec: TwinSpec, lines: Sequence[Line], quantities: Sequence[str] = QUANTITIES) -> list[Held]:
    """The edges of a job, one of each quantity: that of the axis that loses first."""
    verdict = played(spec.build(), lines).verdict
    if not verdict.ok:
        raise AssertionError(f"the job itself is not well: {verdict.problems}")
    found = [each for each in edge.edges(spec, lines, verdict, timeout_s=60.0) if each.factor is not None]
    nearest = []
    for quantity in quantities:
        own = [each for each in found if each.quantity == quantity]
        nearest += sorted(own, key=lambda each: max(each.factor or 1.0, 1.0 / (each.factor or 1.0)))[:1]
    seeds = edge.alike(spec, lines, SEEDS, FRESH)
    if len(seeds) < FRESH:
        raise AssertionError(f"the job is well on {len(seeds)} of {len(SEEDS)} seeds only")
    shares = (edge.NEARER, edge.FARTHER)
    return [Held(each, *(_lost(spec, lines, each, share, seeds) for share in shares)) for each in nearest]


def _lost(spec: TwinSpec, lines: Sequence[Line], told: edge.Edge, share: float, seeds: Sequence[int]) -> int:
    """On how many seeds the axis loses steps at this share of its edge."""
    assert told.factor is not None
    factor = told.factor * share if told.factor > 1.0 else told.factor / share
    made = (edge.tried(spec, lines, told.quantity, (told.axis,), factor, seed) for seed in seeds)
    return sum(told.axis in trial.lost for trial in made)


def _case(work: tuple[str, str, float]) -> list[str]:
    """Rows of the table; those that are not good begin with !."""
    name, motor, supply_v = work
    rows = []
    for one in held(spec_of(motor, supply_v), lines_of(JOBS[name])):
        told = f"{one.edge.quantity} {one.edge.factor:.2f} ({one.edge.axis.upper()})"
        row = f"| {name} | {motor} | {supply_v:g} V | {told} | {one.before} of {FRESH} | {one.beyond} |"
        rows.append(row if one.good else f"!{row}")
    return rows


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--every", action="store_true", help="every job with every motor and supply")
    parser.add_argument("--job", default="", metavar="PART", help=f"of a name: {', '.join(JOBS)}")
    parser.add_argument("--motor", choices=MOTORS)
    parser.add_argument("--supply", type=float, choices=SUPPLIES_V)
    parser.add_argument("--workers", type=int, default=1)
    asked = parser.parse_args()
    machines = list(itertools.product(MOTORS, SUPPLIES_V))
    work = (
        [(job, *machine) for job in JOBS for machine in machines]
        if asked.every
        else [(job, *machine) for job, machine in zip(JOBS, machines, strict=True)]
    )
    work = [
        (job, motor, supply_v)
        for job, motor, supply_v in work
        if asked.job in job and asked.motor in (None, motor) and asked.supply in (None, supply_v)
    ]
    if not work:
        parser.error("no such job with that motor and supply; without --every each job has one of them")
    good = True
    print("| job | motor | supply | edge | lost at 95 % | at 105 % |\n|---|---|---|---|---|---|")
    for rows in in_order(_case, work, crew_of(asked.workers)):
        good = good and not any(row.startswith("!") for row in rows)
        print("\n".join(rows), flush=True)
    return 0 if good else 1


if __name__ == "__main__":
    sys.exit(main())
