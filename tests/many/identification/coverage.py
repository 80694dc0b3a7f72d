"""How many hidden numbers do intervals of 90 % hold? A study of many machines, each hidden from its fit.

    python -m tests.many.identification.coverage FOLDER 200                 real fits of a whole day: hours
    python -m tests.many.identification.coverage FOLDER 200 --surface       fits on a surface: minutes
    the same again                                                          goes on where it was ended
    python -m tests.many.identification.coverage OTHER 101 200              from that machine on: for another core

Each machine is drawn from what is believed: its numbers are u ~ N(0, 1) in the priors, cut at MOST, and those that the
fit is not asked for, within what is known of them, too. The same job is carried out on it, with noise of its own;
fitted; and it is counted, per parameter, whether the interval of 90 % holds the truth. Right are 85 to 95 % of them.
Numbers behind factors, on which no interval depends, are left out.

    python -m tests.many.identification.coverage FOLDER 100 --surface --unlike      machines unlike the model

has each of them differ from the model in one of twenty ways (unlike.py), and counts those that are graded `measured`
by themselves: of these, too, 85 to 95 % must be held, else their family is no such number (fit.PROVEN, many/30).

`Surface` makes many of them a matter of minutes: a day is always the same, so its predictions are one function of u, a
cubic through 250 real replays; the data are those of real twins. It leaves out stall series, whose outcome is no cubic,
and with them the supply. How far the cubic is off, by leaving each replay out, is printed in standard deviations.
"""

from __future__ import annotations

import argparse
import itertools
import json
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine
from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification import fit as fit_module
from isel_twin.many.identification import replays as replays_module
from isel_twin.many.identification.experiment import Block, assemble, blocks
from isel_twin.many.identification.fit import Fit, fit
from isel_twin.many.identification.laws import left_alone
from isel_twin.many.identification.replays import Call, Replays
from isel_twin.many.identification.session import Session, model_twin, session_of
from isel_twin.many.identification.unknowns import Unknown, candidate, changes, default_names, unknown
from isel_twin.recordings.compare import traffic
from tests.many.identification.unlike import NONE, Effect, carry_out, effect_of
from tests.near import near_switches

CONTROLLER = "imc-s8"
HALF_TO_TWICE = 0.3  # deviation of a logarithm, from which the curvature of a prediction bends, too
MOST = 1.8  # standard deviations: beyond them a candidate may be no machine
NORMAL_90 = 1.645
GAUGE_MM = 0.005

Floats = NDArray[np.float64]
Told = dict[str, Any]


def drawn(seed: int, count: int) -> Floats:
    """The hidden u [count] of a machine."""
    return np.clip(np.random.default_rng([seed, 29]).normal(size=count), -MOST, MOST)


def hidden_day(
    machine: Machine,
    unknowns: Sequence[Unknown],
    u: Floats,
    chosen: Sequence[Block],
    seed: int,
    like: Session | None = None,
    effect: Effect = NONE,
) -> Session:
    """A day at the machine of these u. like: another such day, whose commands mean the same. effect: what makes it
    unlike the model."""
    language = needed(create_language(CONTROLLER), CONTROLLER)
    hidden = candidate(machine, unknowns, [item.value(one) for item, one in zip(unknowns, u.tolist(), strict=True)])
    recorded, measured = carry_out(
        effect,
        assemble("day", chosen, language),
        model_twin(hidden, CONTROLLER).machine,  # with steps as short as it needs
        CONTROLLER,
        seed=seed,
        noise_mm=GAUGE_MM,
        time_noise_s=0.0005,
    )
    if like is not None:
        return replace(like, pieces=tuple(traffic(recorded)), measured=measured)
    return session_of(recorded, measured, CONTROLLER, machine)


def intervals(result: Fit) -> list[tuple[float, float]]:
    """By parameter: the ends of its interval of 90 %, as u."""
    found, part = [], NORMAL_90 / NORMAL_95
    for one in result.estimates:
        at, low, high = (one.unknown.at(value) for value in (one.value, one.low, one.high))
        found.append((at - part * (at - low), at + part * (high - at)))
    return found


def held(result: Fit, u: Floats) -> list[bool]:
    """By parameter: does the interval of 90 % hold the truth?"""
    return [low <= true <= high for (low, high), true in zip(intervals(result), u.tolist(), strict=True)]


def bounds(number: int) -> tuple[int, int]:
    """How many of so many may be held if the true part is 85 to 95 %: what lies beyond has a chance of 2.5 %."""
    from scipy.stats import binom

    return int(binom.ppf(0.025, number, 0.85)), int(binom.ppf(0.975, number, 0.95))


class Surface:
    """Predictions of one day as cubics of u, by replays at points that fill the priors evenly."""

    def __init__(
        self,
        machine: Machine,
        unknowns: Sequence[Unknown],
        session: Session,
        points: int,
        replays: Replays | None = None,
    ) -> None:
        from scipy.stats import qmc

        self._unknowns = unknowns
        self._wide = np.array([item.deviation >= HALF_TO_TWICE for item in unknowns])
        tried = 2.4 * MOST * (qmc.Halton(len(unknowns), seed=1).random(points) - 0.5)
        values = ([i.value(x) for i, x in zip(unknowns, u, strict=True)] for u in tried.tolist())
        calls = [(session, machine, tuple(unknowns), one) for one in values]
        powers, found = np.array([self._powers(u) for u in tried]), np.array((replays or Replays()).make(calls))
        self._terms = np.linalg.lstsq(powers, found, rcond=None)[0]
        leverage = np.einsum("ij,ji->i", powers, np.linalg.pinv(powers))
        left_out = (found - powers @ self._terms) / np.maximum(1.0 - leverage, 1e-9)[:, None]
        self.off = np.sqrt(np.mean((left_out / [item.sigma for item in session.data]) ** 2, axis=0))  # [data]

    def _powers(self, u: Floats) -> list[float]:
        """All products of at most two of the u, and of three of those that are hardly known."""
        several = [(u, 0), (u, 1), (u, 2), (u[self._wide], 3)]
        every = (itertools.combinations_with_replacement(of.tolist(), degree) for of, degree in several)
        return [float(np.prod(factors)) for degree in every for factors in degree]

    def replayed(self, call: Call) -> Floats:
        """In place of a replay; of a factor the first number counts, none alone; what is not told is as believed."""
        _, machine, unknowns, values = call
        known = {item.keys for item in self._unknowns}
        told: dict[str, float] = {}
        for item, value in zip(unknowns, values, strict=True):
            if item.keys in known:
                told |= changes(machine, [item], [value])
        own = changes(machine, self._unknowns, [1.0 if item.factor else item.prior for item in self._unknowns])
        found = ((item, told.get(item.keys[0], own[item.keys[0]])) for item in self._unknowns)
        u = [item.at(value / (own[item.keys[0]] if item.factor else 1.0)) for item, value in found]
        predicted: Floats = np.array(self._powers(np.array(u))) @ self._terms
        return predicted


@dataclass(frozen=True)
class Study:
    """The same job at each hidden machine."""

    machine: Machine
    unknowns: list[Unknown]
    chosen: list[Block]
    folder: Path
    unlike: bool = False

    def effect(self, seed: int) -> Effect:
        return effect_of(seed) if self.unlike and seed else NONE

    @property
    def every(self) -> list[Unknown]:
        """What is drawn: what is asked for, and then what is not."""
        return [*self.unknowns, *left_alone(self.machine, self.unknowns, ["x"])]

    def day(self, seed: int, like: Session | None = None) -> Session:
        return hidden_day(
            self.machine, self.every, drawn(seed, len(self.every)), self.chosen, seed, like, self.effect(seed)
        )


def whole_day(folder: Path) -> Study:
    machine = load_machine("4030")
    unknowns = [unknown(machine, name) for name in default_names(["x"], machine)]
    return Study(machine, unknowns, blocks(machine, CONTROLLER, ["x"], unknowns, seed=0), folder)


def stall_free_day(folder: Path) -> Study:
    (folder / "machine").mkdir(exist_ok=True)
    machine = load_machine(near_switches(folder / "machine", 2.0))
    unknowns = [unknown(machine, name) for name in ("friction.x", "backlash.x", "stiffness.x", "mass")]
    every = blocks(machine, CONTROLLER, ["x"], unknowns, seed=0)
    return Study(machine, unknowns, [block for block in every if block.stall is None], folder)


def studied(study: Study, seed: int, day: Session, journal: Path | None) -> Told:
    """What is kept of one machine: by parameter the truth, the estimate, its interval of 90 %, all as u, and grade."""
    result, truths = fit(study.machine, study.unknowns, [day], [], journal=journal), drawn(seed, len(study.unknowns))
    found = {
        one.unknown.name: {
            "true": true,
            "found": one.unknown.at(one.value),
            "low": low,
            "high": high,
            "wider": wider,
            "open": open_,
            "measured": result.measured(one),
        }
        for one, true, (low, high), wider, open_ in zip(
            result.estimates, truths.tolist(), intervals(result), result.widened, result.open, strict=True
        )
    }
    kept = {"chi2": result.chi2, "explains": result.explains, "suspects": [one.law for one in result.suspects]}
    kinds = {one.kind: [one.value, one.limit] for one in result.kinds}
    effect = study.effect(seed).name
    return {"machine": seed, "effect": effect, **kept, "kinds": kinds, "replays": result.replays, "parameters": found}


def table(told: Sequence[Told]) -> str:
    """By parameter: how many truths the intervals hold, how many are right, and how wide the intervals are; the same of
    those that are graded measured."""
    doubted = sum(not one["explains"] or bool(one["suspects"]) for one in told)
    lines = [f"{len(told)} machines, {doubted} of them doubted; truths in intervals of 90 %, right are 85 to 95 %:"]
    for name in told[0]["parameters"]:
        own = [one["parameters"][name] for one in told]
        for what, some in (("", own), (" measured", [one for one in own if one["measured"]])):
            if not some:
                continue
            n, (low, high) = sum(one["low"] <= one["true"] <= one["high"] for one in some), bounds(len(some))
            wide = float(np.median([one["high"] - one["low"] for one in some])) / (2.0 * NORMAL_90)
            said = "right" if low <= n <= high else "too narrow" if n < low else "too wide"
            part = f"{n} of {len(some)} held, {n / len(some):.0%}"
            lines.append(f"{name + what:<20} {part}, may be {low} to {high}: {said}; {wide:.0%} of the prior's")
    return "\n".join(lines)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path, help="what is known by now, a line of JSON for each machine, and replays")
    parser.add_argument("number", type=int, nargs="+", help="the last machine, or the first and the last")
    parser.add_argument("--unlike", action="store_true", help="machines that are unlike the model, in twenty ways")
    parser.add_argument("--surface", type=int, nargs="?", const=250, help="through so many replays, 250")
    call = parser.parse_args()
    call.folder.mkdir(parents=True, exist_ok=True)
    fit_module.behind_factors = lambda *_: ((), ())
    done = call.folder / "machines.jsonl"
    told = [json.loads(line) for line in done.read_text().splitlines()] if done.exists() else []
    study = replace((stall_free_day if call.surface else whole_day)(call.folder), unlike=call.unlike)
    like = study.day(0) if call.surface else None
    if like is not None:
        surface = Surface(study.machine, study.every, like, call.surface, Replays(journal=call.folder / "surface"))
        off = ", ".join(f"{item.label} {one:.1f}" for item, one in zip(like.data, surface.off, strict=True))
        print(f"the surface is off by, in standard deviations: {off}", flush=True)
        replays_module.replayed = surface.replayed
    first, last = call.number[0] if len(call.number) == 2 else 1, call.number[-1]
    for seed in sorted(set(range(first, last + 1)) - {one["machine"] for one in told}):
        began_s = time.process_time()
        journal = None if call.surface else call.folder / f"{seed}.replays"
        told.append(studied(study, seed, study.day(seed, like), journal))
        with done.open("a") as file:
            file.write(json.dumps(told[-1]) + "\n")
        print(f"machine {seed}: {time.process_time() - began_s:.0f} s of CPU time; {table(told)}\n", flush=True)
    print(table(told))


if __name__ == "__main__":
    main()
