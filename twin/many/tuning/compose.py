"""What to try next: moves know of each other only what the clock tells, so each is a small problem of its own.

Between two moves the machine stands. So what a move does depends on its own settings, and

    time of the job   = sum of the times of its moves, and what lies between
    margin of the job = least margin of its moves

Sixty trials are too few for thirty parameters at once, but plenty for three: every trial tells of every move what its
settings did there, and a lost step is the fault of the move in which it was lost (many/5). A new trial is put
together:

    move     1        2        3        4
            best     NEW      best     NEW      best: the fastest known of that move that keeps the margin looked for
                                                new:  a step from its best, the best of another move, or from an
                                                      estimator of its own (TPE); oftener where much time goes

Where all moves share their settings there is one such problem, and every trial tries something new. Half of the trials
look for the margin that is wanted, half for more, so that the front is filled.
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

NEW = 3  # most moves of a trial that try something new: with more, one of them nearly always loses steps
# standard deviation of a large step from the best, as the logarithm of a ratio; others are down to a tenth of it
STEP = {"speed_hz": 0.2, "acceleration_hz_per_ms": 0.6, "start_stop_hz": 0.6}


@dataclass(frozen=True)
class Known:
    """What some settings did in the moves of a group; `margin` 0 if they lost steps there."""

    values: dict[str, int]
    time_s: float
    margin: float


def known(problem: Problem, tried: Sequence[Tried]) -> list[list[Known]]:
    """Of each group what its settings did; the same settings once, with the least margin that they ever kept.

    Of a trial that went wrong the move to blame is known, and those before it as far as they were made: if that was on
    too few machines to tell, the trial that takes them for the best will.
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
                time_s, margin = sum(moves[at][0] for at in own), min(moves[at][1] for at in own)
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
    """Values of all parameters for a trial; None if nothing is known yet. least: the margin that is wanted."""
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
    """The best of other moves, as far as it is one for these."""
    theirs = {one.setting: best.values[one.name] for one in other.parameters}
    return {one.name: one.nearest(theirs[one.setting]) for one in group.parameters if one.setting in theirs}


def best_of_each(problem: Problem, tried: Sequence[Tried], least: float) -> dict[str, int]:
    """Of every move the fastest settings that are known to keep a margin, or those that keep most."""
    return {name: value for seen in known(problem, tried) for name, value in _best(seen, least).values.items()}


def _best(seen: Sequence[Known], wanted: float) -> Known:
    """The fastest that keeps a margin, or what keeps most."""
    keeping = [each for each in seen if each.margin > 0.0 and each.margin >= wanted]
    return min(keeping, key=lambda each: each.time_s) if keeping else max(seen, key=lambda each: each.margin)


def _estimated(group: Group, seen: Sequence[Known], wanted: float, seed: int, number: int) -> dict[str, int]:
    """Something that may be faster and keep the margin."""
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
