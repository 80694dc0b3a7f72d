"""How many hidden numbers do intervals of 90 % hold? A study of many machines, each hidden from its fit.

    python -m tests.many.identification.coverage 200                 real fits of a whole day: hours
    python -m tests.many.identification.coverage 200 --first 57      goes on after 56

Each machine is drawn from what is believed: its numbers are u ~ N(0, 1) in the priors, cut at MOST, and in the whole
study those of the laws that no fit is told of are drawn within their bands, too. The same job is carried out on it,
with noise of its own; fitted; and it is counted, per parameter, whether the interval of 90 % holds the truth. Right are
85 to 95 % of them.

`Surface` makes twenty of them a matter of seconds: the day is always the same, so its predictions are one function of
u, a cubic through a few real replays; the data are those of real twins.
"""

from __future__ import annotations

import argparse
import itertools
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, qmc

from isel_twin.language import create_language, needed
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.machine.spread import NORMAL_95, band, numbers, within
from isel_twin.many.identification.experiment import Block, assemble, blocks
from isel_twin.many.identification.fit import Fit, fit
from isel_twin.many.identification.laws import LAWS
from isel_twin.many.identification.replays import Call
from isel_twin.many.identification.session import Session, predict, session_of
from isel_twin.many.identification.stand_in import carry_out
from isel_twin.many.identification.unknowns import Unknown, candidate, changes, default_names, unknown
from isel_twin.recordings.compare import traffic

CONTROLLER = "imc-s8"
MOST = 1.8  # standard deviations: beyond them a candidate may be no machine
NORMAL_90 = 1.645
GAUGE_MM = 0.005

Floats = NDArray[np.float64]


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
    more: Mapping[str, float] | None = None,
) -> Session:
    """A day at the machine of these u. like: another such day, whose commands mean the same. more: other numbers of
    the machine."""
    language = needed(create_language(CONTROLLER), CONTROLLER)
    values = [item.value(one) for item, one in zip(unknowns, u.tolist(), strict=True)]
    recorded, measured = carry_out(
        assemble("day", chosen, language),
        with_overrides(candidate(machine, unknowns, values), more or {}),
        CONTROLLER,
        seed=seed,
        noise_mm=GAUGE_MM,
        time_noise_s=0.0005,
    )
    if like is not None:
        return replace(like, pieces=tuple(traffic(recorded)), measured=measured)
    return session_of(recorded, measured, CONTROLLER, machine)


def unfitted(machine: Machine, unknowns: Sequence[Unknown], seed: int) -> dict[str, float]:
    """Numbers of X of the laws that no unknown sets, each drawn within its band."""
    draw, set_ = np.random.default_rng([seed, 31]), {key for item in unknowns for key in item.keys}
    found = {}
    for key, entry in numbers(machine.tree):
        span = band(key, entry) if key.removeprefix("axes.x.") in LAWS and key not in set_ else None
        if span is not None:
            found[key] = within(float(entry["value"]), span, float(np.clip(draw.normal(), -MOST, MOST)))
    return found


def held(result: Fit, u: Floats) -> list[bool]:
    """By parameter: does the interval of 90 % hold the truth?"""
    told = []
    for one, true in zip(result.estimates, u.tolist(), strict=True):
        at, low, high = (one.unknown.at(value) for value in (one.value, one.low, one.high))
        part = NORMAL_90 / NORMAL_95
        told.append(at - part * (at - low) <= true <= at + part * (high - at))
    return told


def bounds(number: int) -> tuple[int, int]:
    """How many of so many may be held if the true part is 85 to 95 %: what lies beyond has a chance of 2.5 %."""
    return int(binom.ppf(0.025, number, 0.85)), int(binom.ppf(0.975, number, 0.95))


class Surface:
    """Predictions of one day as cubics of u, by replays at points that fill the priors evenly."""

    def __init__(self, machine: Machine, unknowns: Sequence[Unknown], session: Session, points: int) -> None:
        self._unknowns = unknowns
        tried = 2.4 * MOST * (qmc.Halton(len(unknowns), seed=1).random(points) - 0.5)
        found = [
            predict(session, candidate(machine, unknowns, [i.value(x) for i, x in zip(unknowns, u, strict=True)]))
            for u in tried.tolist()
        ]
        self._terms = np.linalg.lstsq(np.array([self._powers(u) for u in tried]), np.array(found), rcond=None)[0]

    @staticmethod
    def _powers(u: Floats) -> list[float]:
        """All products of at most three of the u."""
        every = (itertools.combinations_with_replacement(u.tolist(), degree) for degree in range(4))
        return [float(np.prod(factors)) for degree in every for factors in degree]

    def replayed(self, call: Call) -> Floats:
        """In place of a replay; of a factor the first number counts."""
        _, machine, unknowns, values = call
        told = changes(machine, unknowns, values)
        own = changes(machine, self._unknowns, [1.0 if item.factor else item.prior for item in self._unknowns])
        u = [item.at(told[item.keys[0]] / (own[item.keys[0]] if item.factor else 1.0)) for item in self._unknowns]
        predicted: Floats = np.array(self._powers(np.array(u))) @ self._terms
        return predicted


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("number", type=int)
    parser.add_argument("--first", type=int, default=1)
    call = parser.parse_args()
    machine = load_machine("4030")
    unknowns = [unknown(machine, name) for name in default_names(["x"], machine)]
    every = blocks(machine, CONTROLLER, ["x"], unknowns, seed=0)
    count = np.zeros(len(unknowns), dtype=int)
    for done, seed in enumerate(range(call.first, call.number + 1), 1):
        u = drawn(seed, len(unknowns))
        day = hidden_day(machine, unknowns, u, every, seed, more=unfitted(machine, unknowns, seed))
        result = fit(machine, unknowns, [day], [])
        told = held(result, u)
        count += told
        named = ", ".join(item.name for item, one in zip(unknowns, told, strict=True) if not one) or "none"
        parts = ", ".join(f"{item.name} {n / done:.0%}" for item, n in zip(unknowns, count.tolist(), strict=True))
        print(f"machine {seed}: not held: {named}; chi-square {result.chi2:.2f}; so far {parts}", flush=True)
    low, high = bounds(done)
    for item, n in zip(unknowns, count.tolist(), strict=True):
        print(f"{item.name:<14} {n} of {done} held; {'right' if low <= n <= high else 'WRONG'}: {low} to {high}")


if __name__ == "__main__":
    main()
