"""Numbers of drawn machines that go with the outcome of a job: what contributes to it, and what tells losers apart.

Of some sixty numbers the best goes with any outcome by chance, too (jobs/11). One is named only if chance would do as
much in 5 % of such studies at most, for as many numbers as were drawn:

    contributions    rank correlation with the outcome, squared, about its part of the variance; Fisher's z
    separates        rank sum of those that lost (Wilcoxon, Mann and Whitney), equal values sharing their ranks; exact,
                     of many repetitions by the normal law

                     of n machines of which m lost, one number in order gives 2 / C(n, m) by chance: of 20 machines at
                     least four must lose before one of fifty can be named
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from statistics import NormalDist
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from isel_twin.jobs.robust import Repetition

CHANCE = 0.05  # part of studies in which nothing matters and yet something would be named
NAMED = 2  # contributions named at most
EXACT = 10_000  # machines times those of the smaller side up to which each subset is counted

Floats = NDArray[np.float64]


class Separation(NamedTuple):
    """A number that tells machines on which a job loses steps from the others."""

    key: str
    lost: float  # mean factor where steps were lost
    held: float  # and where none were
    chance: float  # part of studies in which nothing matters and yet some number separates as well


def separates(trials: Sequence[Repetition]) -> Separation | None:
    """The number that tells losers from the others best; None for what chance explains."""
    lost = [trial.factors for trial in trials if any(trial.verdict.lost)]
    held = [trial.factors for trial in trials if not any(trial.verdict.lost) and not trial.verdict.part]
    if not lost or not held:
        return None
    found = _columns([*lost, *held])
    by_chance = {key: _by_chance(values, len(lost)) for key, values in found.items()}
    best = min(by_chance, key=lambda key: by_chance[key], default=None)
    if best is None or (chance := by_chance[best] * len(found)) > CHANCE:
        return None
    values = found[best]
    return Separation(best, float(values[: len(lost)].mean()), float(values[len(lost) :].mean()), chance)


def _by_chance(values: Floats, first: int) -> float:
    """The probability that the rank sum of so many of these values is as far from its mean as that of the first."""
    number, ranks = len(values), np.rint(2.0 * _ranks(values)).astype(int)
    few = min(first, number - first)
    away = abs(int(ranks[:first].sum()) - first * (number + 1))
    if number * few <= EXACT:
        sums = _rank_sums(tuple(sorted(ranks.tolist())), few)
        return float(sums[np.abs(np.arange(len(sums)) - few * (number + 1)) >= away].sum())
    variance = few * (number - few) / (number - 1) * float(ranks.var())
    return math.erfc(max(0.0, away - 1.0) / math.sqrt(2.0 * variance))


@functools.lru_cache(maxsize=8)
def _rank_sums(ranks: tuple[int, ...], few: int) -> Floats:
    """The probability of each sum of so many of these whole numbers."""
    ways = np.zeros((few + 1, sum(ranks[-few:]) + 1))
    ways[0, 0] = 1.0
    for rank in ranks:
        ways[1:, rank:] += ways[:-1, : ways.shape[1] - rank]
    sums: Floats = ways[few] / ways[few].sum()
    return sums


def contributions(drawn: Sequence[Mapping[str, float]], outcome: Sequence[float]) -> tuple[tuple[str, float], ...]:
    """The numbers that contribute most to an outcome, with their part of its variance; those that chance explains are
    not among them. drawn: the factors of each repetition."""
    if len(drawn) < 5 or len(set(outcome)) == 1:
        return ()
    columns = _columns(drawn)
    limit = math.tanh(
        NormalDist().inv_cdf(1.0 - 0.5 * CHANCE / max(1, len(columns))) / math.sqrt((len(drawn) - 3) / 1.06)
    )
    ranks = np.array([_ranks(each) for each in (np.array(outcome), *columns.values())])
    ranks -= ranks.mean(axis=1, keepdims=True)
    ranks /= np.linalg.norm(ranks, axis=1, keepdims=True)
    found = dict(zip(columns, (ranks[1:] @ ranks[0]).tolist(), strict=True))
    best = sorted(((key, rho**2) for key, rho in found.items() if abs(rho) > limit), key=lambda one: -one[1])
    return tuple(best[:NAMED])


def _columns(drawn: Sequence[Mapping[str, float]]) -> dict[str, Floats]:
    """Factors of the numbers that vary, by key; what is drawn as one for all axes once, as axes.all."""
    found: dict[str, Floats] = {}
    for key in drawn[0]:
        column = np.array([factors[key] for factors in drawn])
        if column.min() == column.max():
            continue
        first = key.replace(f"axes.{key.split('.')[1]}.", "axes.all.", 1) if key.startswith("axes.") else key
        twin = next((name for name, other in found.items() if np.array_equal(other, column)), None)
        if twin is None:
            found[key] = column
        elif first != key:
            found[first] = found.pop(twin)
    return found


def _ranks(values: Floats) -> Floats:
    """Ranks from 1; equal values share the mean of theirs."""
    _, which, counts = np.unique(values, return_inverse=True, return_counts=True)
    ranks: Floats = (np.cumsum(counts) - 0.5 * (counts - 1))[which]
    return ranks
