"""The tuning environment: moves and episodes a second, measurements after each move included; states of twins."""

from __future__ import annotations

import time
from contextlib import closing
from typing import Any

import gymnasium
import numpy as np
import pytest

import isel_twin.envs
from isel_twin.envs import JOB, Settings
from isel_twin.envs.moves import Setup, referenced_twin
from isel_twin.envs.tuning import to_action
from isel_twin.envs.vector import tuning_vector
from isel_twin.plant.mujoco import MujocoPlant

SETTINGS = Settings(20_000, 400, 300)
"""Good for the whole job, 5.9 s of machine time and 1.2 s at rest."""
ENVIRONMENT = "isel_twin/JobTuning-v0"
SIDE_BY_SIDE = 4


@pytest.mark.benchmark(group="tuning environment")
@pytest.mark.parametrize("seed", ["new", "known"])
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_reset(benchmark: Any, plant: str, seed: str) -> None:
    """The first reset builds the machine and is left out; a known seed is restored."""
    env = gymnasium.make(ENVIRONMENT, plant=plant)
    benchmark.pedantic(lambda: env.reset(seed=0 if seed == "known" else None), rounds=5, warmup_rounds=1)


@pytest.mark.benchmark(group="tuning environment")
@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_moves(benchmark: Any, plant: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Six moves. What is outside the plant is measured in CPU time, which other work on the machine leaves alone."""
    env = gymnasium.make(ENVIRONMENT, plant=plant)
    spans, inside_s, whole_s = [], [0.0], []
    advance = MujocoPlant.advance

    def timed(*arguments: Any) -> Any:
        began_s = time.process_time()
        made = advance(*arguments)
        inside_s[-1] += time.process_time() - began_s
        return made

    monkeypatch.setattr(MujocoPlant, "advance", timed)

    def job() -> None:
        began_s = time.process_time()
        inside_s.append(0.0)
        for _ in JOB:
            *_, info = env.step(to_action(SETTINGS))
        whole_s.append(time.process_time() - began_s)
        spans.append(info["time_s"])

    def begin() -> None:
        env.reset(seed=0)

    benchmark.pedantic(job, setup=begin, rounds=5, warmup_rounds=1)
    benchmark.extra_info["moves a second"] = len(JOB) / benchmark.stats.stats.median
    benchmark.extra_info["times real time"] = spans[-1] / benchmark.stats.stats.median
    if plant == "mujoco":
        outside = [1.0 - inside / whole for inside, whole in zip(inside_s[1:], whole_s, strict=True)]
        benchmark.extra_info["share of time outside the plant"] = float(np.median(outside))


@pytest.mark.benchmark(group="tuning environment")
def test_a_move_without_physics_beside_one_with(benchmark: Any) -> None:
    """Six moves each, in CPU time, the least of each: at most an eighth, goal a tenth."""
    envs = {plant: gymnasium.make(ENVIRONMENT, plant=plant) for plant in ("kinematic", "mujoco")}
    spent: dict[str, list[float]] = {plant: [] for plant in envs}

    def turn() -> None:
        for plant, env in envs.items():
            env.reset(seed=0)
            began_s = time.process_time()
            for _ in JOB:
                env.step(to_action(SETTINGS))
            spent[plant].append(time.process_time() - began_s)

    benchmark.pedantic(turn, rounds=40, warmup_rounds=1)
    ratio = min(spent["kinematic"]) / min(spent["mujoco"])
    benchmark.extra_info["a move without physics over one with"] = ratio
    assert ratio <= 0.2


@pytest.mark.benchmark(group="tuning environments side by side")
@pytest.mark.parametrize("mode", ["serial", "threads", "processes"])
def test_side_by_side(benchmark: Any, mode: Any) -> None:
    """Whole episodes of four environments on two workers, resets included: the job has six moves, a step more begins
    the next one."""
    actions = np.array([to_action(SETTINGS)] * SIDE_BY_SIDE)
    with closing(tuning_vector(SIDE_BY_SIDE, mode, workers=2)) as envs:
        envs.reset(seed=0)

        def episode() -> None:
            for _ in range(len(JOB) + 1):
                envs.step(actions)

        benchmark.pedantic(episode, rounds=5, warmup_rounds=1)
    benchmark.extra_info["steps a second"] = SIDE_BY_SIDE * (len(JOB) + 1) / benchmark.stats.stats.median


@pytest.mark.benchmark(group="states of a twin")
@pytest.mark.parametrize("what", ["save", "restore", "another", "built anew"])
def test_states(benchmark: Any, what: str) -> None:
    """After a reference run."""
    twin = referenced_twin(Setup())
    state = twin.save()
    ways = {
        "save": twin.save,
        "restore": lambda: twin.restore(state),
        "another": lambda: twin.another(3),
        "built anew": lambda: referenced_twin(Setup()),
    }
    benchmark.pedantic(ways[what], rounds=10, warmup_rounds=1)
    benchmark.extra_info["per second"] = 1.0 / benchmark.stats.stats.median


@pytest.mark.benchmark(group="tuning environment")
def test_whole_job(benchmark: Any) -> None:
    """One trial of a sweep: mains, reference run, six moves."""
    benchmark.pedantic(lambda: isel_twin.envs.run_job(isel_twin.envs.Setup(), SETTINGS), rounds=5, warmup_rounds=1)
