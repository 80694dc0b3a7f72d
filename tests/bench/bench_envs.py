"""The tuning environment: moves and episodes a second, measurements after each move included."""

from __future__ import annotations

from typing import Any

import gymnasium
import pytest

import isel_twin.envs
from isel_twin.envs import JOB, Settings
from isel_twin.envs.tuning import to_action

SETTINGS = Settings(20_000, 400, 300)
"""Good for the whole job, 5.9 s of machine time and 1.2 s at rest."""
ENVIRONMENT = "isel_twin/JobTuning-v0"


@pytest.mark.benchmark(group="tuning environment")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_reset(benchmark: Any, plant: str) -> None:
    env = gymnasium.make(ENVIRONMENT, plant=plant)
    benchmark.pedantic(lambda: env.reset(seed=0), rounds=5, warmup_rounds=1)


@pytest.mark.benchmark(group="tuning environment")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_moves(benchmark: Any, plant: str) -> None:
    env = gymnasium.make(ENVIRONMENT, plant=plant)
    spans = []

    def job() -> None:
        for _ in JOB:
            *_, info = env.step(to_action(SETTINGS))
        spans.append(info["time_s"])

    def begin() -> None:
        env.reset(seed=0)

    benchmark.pedantic(job, setup=begin, rounds=5, warmup_rounds=1)
    benchmark.extra_info["moves a second"] = len(JOB) / benchmark.stats.stats.median
    benchmark.extra_info["times real time"] = spans[-1] / benchmark.stats.stats.median


@pytest.mark.benchmark(group="tuning environment")
def test_whole_job(benchmark: Any) -> None:
    """One trial of a sweep: mains, reference run, six moves."""
    benchmark.pedantic(lambda: isel_twin.envs.run_job(isel_twin.envs.Setup(), SETTINGS), rounds=5, warmup_rounds=1)
