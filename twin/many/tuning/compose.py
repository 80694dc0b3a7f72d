"""What to try next: each move is a small problem of its own. The machine is at rest between two moves, so the behaviour
of a move depends on its own settings, and

    time of the job   = sum of the times of its moves and pauses
    margin of the job = least margin of its moves

Sixty trials are too few for thirty parameters at once, but enough for three: every trial gives a result for every move,
and a lost step belongs to the move in which it was lost. A new trial is composed: (many/5)

    move     1        2        3        4
            best     NEW      best     NEW      best: the fastest known settings of that move that keep the margin
                                                new:  a step from its best, the best of another move, or from an
                                                      estimator of its own (TPE); more often for long moves

If all moves share their settings there is one such problem, and every trial tries something new. Half of the trials aim
at the wanted margin, half at more, to fill the front.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isel_twin.many.tuning.result import Tried
from isel_twin.many.tuning.space import Group, Parameter, Problem

if TYPE_CHECKING:
    import optuna

NEW = 3  # most moves of a trial with new settings: with more, one of them nearly always loses steps
# standard deviation of a large step from the best, in the logarithm; smaller steps go down to a tenth of it
STEP = {"speed_hz": 0.2, "acceleration_hz_per_ms": 0.6, "start_stop_hz": 0.6}


@dataclass(frozen=True)
class Known:
    """Result of some settings in the moves of a group; `margin` 0 if they lost steps there."""

    values: dict[str, int]
    time_s: float
    margin: float


def known(problem: Problem, tried: Sequence[Tried]) -> list[list[Known]]:
    """For each group the results of its settings; equal settings once, with their least margin. A failed trial gives
    the result of the failing move and of those before it, even if these were made on too few machines: a trial that
    uses them as the best will show more.
    """
    places = {move.line: at for at, move in enumerate(problem.moves)}
    found = []
    for group in problem.groups:
        own = [places[move.line] for move in group.moves]
        seen: dict[tuple[int, ...], Known] = {}
        for each in tried:
            moves = each.judgement.moves
            whole = len(moves) if each.judgement.good else len(moves) - 1
            if max(own) < whole:
                time_s, margin = sum(moves[at].time_s for at in own), min(moves[at].margin for at in own)
            elif moves and whole in own:
                time_s, margin = 0.0, 0.0
            else:
                continue
            values = group.own(each.values)
            before = seen.get(key := tuple(values.values()))
            if before is None or margin < before.margin:
                seen[key] = Known(values, time_s, margin)
        found.append(list(seen.values()))
    return found


def composed(problem: Problem, tried: Sequence[Tried], least: float, seed: int, number: int) -> dict[str, int] | None:
    """Values of all parameters for a trial; None if nothing is known yet. least: the wanted margin."""
    groups = known(problem, tried)
    if not all(any(each.margin > 0.0 for each in seen) for seen in groups):
        return None
    draw = np.random.default_rng([seed, number, 2])
    most = max(each.judgement.margin for each in tried)
    wanted = least if number % 2 else draw.uniform(least, max(least, most))
    best = [_best(seen, wanted) for seen in groups]
    share = np.array([each.time_s for each in best])
    many = min(int(draw.integers(1, NEW + 1)), len(groups))
    new = draw.choice(len(groups), many, replace=False, p=share / share.sum())
    values: dict[str, int] = {}
    for at, (group, seen) in enumerate(zip(problem.groups, groups, strict=True)):
        values.update(best[at].values)
        if at in new:
            way, other = int(draw.integers(3)), int(draw.integers(len(groups)))
            if way == 0 and other != at:
                values.update(_borrowed(group, problem.groups[other], best[other]))
            elif way < 2:
                values.update(_step(group, best[at], draw))
            else:
                values.update(_estimated(group, seen, wanted, seed, number))
    return values


def _step(group: Group, best: Known, draw: np.random.Generator) -> dict[str, int]:
    part = 10.0 ** draw.uniform(-1.0, 0.0)
    times = {one: math.exp(part * STEP[one.setting] * draw.standard_normal()) for one in group.parameters}
    return {one.name: one.nearest(round(best.values[one.name] * factor)) for one, factor in times.items()}


def _borrowed(group: Group, other: Group, best: Known) -> dict[str, int]:
    """The best settings of other moves, limited to the ranges of these."""
    theirs = {one.setting: best.values[one.name] for one in other.parameters}
    return {one.name: one.nearest(theirs[one.setting]) for one in group.parameters if one.setting in theirs}


def best_of_each(problem: Problem, tried: Sequence[Tried], least: float) -> dict[str, int]:
    """For every move the fastest known settings with this margin, else those with the most."""
    return {name: value for seen in known(problem, tried) for name, value in _best(seen, least).values.items()}


def _best(seen: Sequence[Known], wanted: float) -> Known:
    """The fastest with this margin, else the one with the most."""
    keeping = [each for each in seen if each.margin > 0.0 and each.margin >= wanted]
    return min(keeping, key=lambda each: each.time_s) if keeping else max(seen, key=lambda each: each.margin)


def _estimated(group: Group, seen: Sequence[Known], wanted: float, seed: int, number: int) -> dict[str, int]:
    """Settings that may be faster with this margin."""
    import optuna
    from optuna.trial import TrialState, create_trial

    slowest_s = max(each.time_s for each in seen)
    place = distributions(group.parameters)
    study = optuna.create_study(sampler=sampler(seed, number))
    for each in seen:
        short = max(0.0, wanted - each.margin)
        value = None if each.margin <= 0.0 else slowest_s * (1.0 + short) if short else each.time_s
        state = TrialState.PRUNED if value is None else TrialState.COMPLETE
        study.add_trial(create_trial(params=dict(each.values), distributions=place, value=value, state=state))
    return study.ask(place).params


def distributions(parameters: Sequence[Parameter]) -> dict[str, optuna.distributions.BaseDistribution]:
    """Ranges of parameters, as Optuna has them."""
    from optuna.distributions import IntDistribution

    return {one.name: IntDistribution(one.low, one.high, log=one.log) for one in parameters}


def sampler(seed: int, number: int) -> optuna.samplers.BaseSampler:
    """The estimator that chooses a trial; the same for the same seed and number."""
    from optuna.samplers import TPESampler

    own = int(np.random.default_rng([seed, number, 1]).integers(2**31))
    return TPESampler(seed=own, multivariate=True, constant_liar=True, n_startup_trials=0)
