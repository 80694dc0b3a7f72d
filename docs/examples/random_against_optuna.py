"""Random search against Optuna's sampler: the same job, the same ranges, as many trials; who finds the faster one?

    python docs/examples/random_against_optuna.py --trials 40 --seeds 3

A trial makes a job of straight moves on a twin that has just been switched on and referenced (`isel_twin.envs`), with
an extra drag of LOAD_NM at every shaft as a margin, and costs the time it took, settling included; a job that loses
steps or ends in the wrong place costs PENALTY_S more. Printed is the best cost after each quarter of the trials.
"""

from __future__ import annotations

import argparse
import warnings
from collections.abc import Callable, Sequence

import numpy as np
import optuna

from isel_twin.envs import Settings, Setup, run_job

JOB = ((150.0, 80.0, 0.0), (155.0, 80.0, 20.0), (0.0, 0.0, 0.0))
"""Targets in mm: a long way, where speed counts, a short one, where the ramp does, and back."""
LOAD_NM = 0.3
PENALTY_S = 100.0

Sampler = Callable[[int], optuna.samplers.BaseSampler]
SAMPLERS: dict[str, Sampler] = {
    "random": lambda seed: optuna.samplers.RandomSampler(seed=seed),
    "Optuna": lambda seed: optuna.samplers.TPESampler(seed=seed, multivariate=True),
}


def cost_s(setup: Setup, trial: optuna.Trial) -> float:
    """What a trial costs in seconds."""
    settings = Settings(
        trial.suggest_int("speed_hz", 5000, 40_000),
        trial.suggest_int("acceleration_hz_per_ms", 50, 4000, log=True),
        trial.suggest_int("start_stop_hz", 100, 4000, log=True),
    )
    row = run_job(setup, settings)
    return row.time_s + row.settling_s + (0.0 if row.good else PENALTY_S)


def best_so_far(sampler: optuna.samplers.BaseSampler, setup: Setup, trials: int) -> list[float]:
    """float [trials], the best cost after each trial."""
    study = optuna.create_study(sampler=sampler)
    study.optimize(lambda trial: cost_s(setup, trial), n_trials=trials)
    costs = [trial.value for trial in study.trials if trial.value is not None]
    return [float(best) for best in np.minimum.accumulate(costs)]


def compare(trials: int, seeds: int, setup: Setup | None = None) -> dict[str, list[list[float]]]:
    """`best_so_far` of each search, by its name, for every seed."""
    setup = setup or Setup(job=JOB, load_nm=LOAD_NM)
    return {name: [best_so_far(make(seed), setup, trials) for seed in range(seeds)] for name, make in SAMPLERS.items()}


def main(words: Sequence[str] | None = None) -> None:
    """Compare and print a table: the mean over the seeds, and in brackets the worst of them."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--trials", type=int, default=40)
    parser.add_argument("--seeds", type=int, default=3)
    given = parser.parse_args(words)
    optuna.logging.set_verbosity(optuna.logging.WARNING)
    warnings.simplefilter("ignore", optuna.exceptions.ExperimentalWarning)
    found = compare(given.trials, given.seeds)
    after = sorted({max(1, given.trials * quarter // 4) for quarter in (1, 2, 3, 4)})
    print(f"{'best cost / s after':<20}" + "".join(f"{f'{number} trials':>18}" for number in after))
    for name, runs in found.items():
        at = [[run[number - 1] for run in runs] for number in after]
        print(f"{name:<20}" + "".join(f"{f'{np.mean(best):.2f} ({max(best):.2f})':>18}" for best in at))


if __name__ == "__main__":
    main()
