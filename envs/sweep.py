"""One job with many settings: a table of the results, on any number of processes, threads or machines.

    from concurrent.futures import ProcessPoolExecutor
    from isel_twin.envs import Setup, fastest, grid, sweep

    rows = sweep(Setup(), grid(speed_hz=[10_000, 20_000, 30_000], acceleration_hz_per_ms=[100, 400, 1600]))
    with ProcessPoolExecutor() as pool:
        rows = sweep(Setup(), trials, pool)                # the same rows, bit for bit
    best = fastest(Setup(), Settings(20_000), "acceleration_hz_per_ms", margin_nm=0.3)

A trial is a plain function of two frozen values, `run_job(setup, settings)`, so any `concurrent.futures.Executor` can
run it, by the same code as `isel-twin sweep` (twin/many/studies), which varies anything and keeps its rows in a file.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
import math
from collections.abc import Iterable
from concurrent.futures import Executor
from dataclasses import dataclass

import numpy as np

from isel_twin.base.crew import Lost, finished, here
from isel_twin.envs.moves import Settings, Setup, make_move, referenced_twin, spoken


@dataclass(frozen=True)
class Row:
    """One trial: the settings, and the result of the job. `dataclasses.asdict` makes a table row of it."""

    speed_hz: int
    acceleration_hz_per_ms: int
    start_stop_hz: int
    load_nm: float
    time_s: float  # all moves, from command to reply
    settling_s: float  # all moves, from the reply until the error stays within the tolerance
    lost_steps: float  # largest, of any axis, at rest after any move; fractions of a step are load angle
    deviation_mm: float  # largest position error of any axis at any time, sampled
    error_mm: float  # largest position error of any axis at rest after any move
    vibration_mm: float  # largest, of any axis, after any move
    margin: float | None  # least pull-out margin of any motor: 1 no load, 0 steps may be lost; None without physics
    edge: float | None  # least factor on the speed of any motor until it swings; None without physics
    moves: int  # moves begun; the job ends with the first that the controller refuses or does not finish
    reply: str  # the controller's last reply; "" if the time was up
    good: bool  # the whole job was made, no step was lost, and every error at rest was within the tolerance


@dataclass(frozen=True)
class Fastest:
    """The fastest good setting, its rows without and with the margin, and the row of the slowest that is not good."""

    settings: Settings
    row: Row
    loaded: Row
    failed: Row | None


def grid(
    speed_hz: Iterable[int] = (10_000,),
    acceleration_hz_per_ms: Iterable[int] = (100,),
    start_stop_hz: Iterable[int] = (300,),
) -> list[Settings]:
    """All combinations, the last parameter changing fastest. Raises ValueError for a value out of range."""
    return [Settings(*values) for values in itertools.product(speed_hz, acceleration_hz_per_ms, start_stop_hz)]


def run_job(setup: Setup, settings: Settings) -> Row:
    """Make the whole job with the same settings for every move, on a new twin."""
    twin = referenced_twin(setup)
    moves = []
    left_s = setup.time_limit_s
    for target in setup.job:
        move = make_move(twin, target, settings, setup, left_s)
        moves.append(move)
        left_s -= move.time_s
        if not move.done:
            break
    return Row(
        **dataclasses.asdict(settings),
        load_nm=setup.load_nm,
        time_s=math.fsum(move.time_s for move in moves),
        settling_s=math.fsum(move.settling_s for move in moves),
        lost_steps=max(float(np.abs(move.lost_steps).max()) for move in moves),
        deviation_mm=max(move.deviation_mm for move in moves),
        error_mm=max(float(np.abs(move.error_mm).max()) for move in moves),
        vibration_mm=max(float(move.vibration_mm.max()) for move in moves),
        margin=min((move.margin for move in moves if move.margin is not None), default=None),
        edge=min((move.edge for move in moves if move.edge is not None), default=None),
        moves=len(moves),
        reply=moves[-1].reply,
        good=all(move.good(setup.tolerance_mm) for move in moves),
    )


def sweep(setup: Setup, trials: Iterable[Settings], executor: Executor | None = None) -> list[Row]:
    """A row for each trial, in their order. executor None: in this process. Raises RuntimeError for lost trials."""
    made = dict(finished(functools.partial(run_job, setup), list(trials), here(executor)))
    rows = [made[index] for index in range(len(made))]
    if lost := [row.why for row in rows if isinstance(row, Lost)]:
        raise RuntimeError(f"{len(lost)} of {len(rows)} trials were lost: {lost[0]}")
    return [row for row in rows if isinstance(row, Row)]


def fastest(
    setup: Setup,
    settings: Settings,
    vary: str,
    *,
    margin_nm: float,
    low: int | None = None,
    high: int | None = None,
    resolution: float = 0.02,
) -> Fastest:
    """The largest value of one setting for which the job is good, with and without an extra load; by bisection.

    vary: "speed_hz", "acceleration_hz_per_ms" or "start_stop_hz"; the others stay as `settings` has them.
    margin_nm: the margin of safety, a load torque added to `setup.load_nm` against every motion.
    low, high: range of the search; by default from the value in `settings` to the controller's maximum.
    resolution: the answer is within this fraction below the first value found that is not good.

    Bisection assumes that all values beyond a bad one are bad, too, which a resonance may violate: check with a sweep
    around the answer. Raises ValueError if even `low` is not good.
    """
    ranges = spoken(setup).ranges
    if vary not in ranges:
        raise ValueError(f"vary is {vary!r}; it can be: {', '.join(ranges)}")
    if not resolution > 0.0:
        raise ValueError(f"resolution is {resolution!r}; it must be positive, such as 0.02")
    loaded = dataclasses.replace(setup, load_nm=setup.load_nm + margin_nm)

    def trial(value: int) -> tuple[Settings, Row, Row]:
        chosen = dataclasses.replace(settings, **{vary: value})
        with_load = run_job(loaded, chosen)
        return chosen, run_job(setup, chosen) if with_load.good else with_load, with_load

    good_value = getattr(settings, vary) if low is None else low
    bad_value = ranges[vary][1] if high is None else high
    best = trial(good_value)
    if not (best[1].good and best[2].good):
        raise ValueError(f"{vary} = {good_value} is already too fast; begin lower, or slow down the other settings")
    top = trial(bad_value)
    if top[1].good and top[2].good:
        return Fastest(*top, failed=None)
    failed = top[1] if not top[1].good else top[2]
    while bad_value > good_value + max(1, int(resolution * good_value)):
        middle = max(good_value + 1, min(bad_value - 1, round(math.sqrt(good_value * bad_value))))
        candidate = trial(middle)
        if candidate[1].good and candidate[2].good:
            good_value, best = middle, candidate
        else:
            bad_value, failed = middle, candidate[1]
    return Fastest(*best, failed=failed)
