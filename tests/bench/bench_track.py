"""TrackPath-v0 beside Gymnasium's Reacher-v5, in turns, at equal physics steps for each step of the environment.

Target (docs/performance.md): at least as many environment steps a second. Beside 4 steps of MuJoCo a step of TrackPath
makes 80 sub-steps of three drives.
"""

from __future__ import annotations

import statistics
import time
from typing import Any

import gymnasium
import numpy as np
import pytest

STEPS = 400
PHYSICS_STEPS = 4
TRACK = "isel_twin.envs:isel_twin/TrackPath-v0"
ACTION = np.array([0.3, 0.0, 0.0], dtype=np.float32)
"""15 mm/s along the first leg, on which it stays for 1.3 s."""


def cpu_s(env: Any, action: Any) -> float:
    """Time of the process for so many steps."""
    env.reset(seed=0)
    began = time.process_time()
    for _ in range(STEPS):
        env.step(action)
    return time.process_time() - began


@pytest.mark.benchmark(group="environment of set points")
def test_track_path_beside_reacher(benchmark: Any) -> None:
    track = gymnasium.make(TRACK, step_s=PHYSICS_STEPS * 0.5e-3)
    reacher = gymnasium.make("Reacher-v5", frame_skip=PHYSICS_STEPS, max_episode_steps=10 * STEPS)
    torques = np.full(2, 0.1, dtype=np.float32)
    ours: list[float] = []
    theirs: list[float] = []
    for env, action in ((track, ACTION), (reacher, torques)):
        cpu_s(env, action)
    benchmark.pedantic(
        lambda: ours.append(cpu_s(track, ACTION)), setup=lambda: theirs.append(cpu_s(reacher, torques)), rounds=15
    )
    ratio = statistics.median(theirs) / statistics.median(ours)
    benchmark.extra_info["environment steps a second"] = STEPS / statistics.median(ours)
    benchmark.extra_info["the same of Reacher-v5"] = STEPS / statistics.median(theirs)
    benchmark.extra_info["times those of Reacher-v5"] = ratio
    benchmark.extra_info["times real time"] = STEPS * PHYSICS_STEPS * 0.5e-3 / statistics.median(ours)
    assert ratio >= 1.0


@pytest.mark.benchmark(group="environment of set points")
def test_reset(benchmark: Any) -> None:
    """On another machine and on the same, in CPU time, the least of each; and on one all of whose numbers differ, for
    which the torque that its motors have at each speed is found anew."""
    same, other, any_other = (gymnasium.make(TRACK) for _ in range(3))
    draw = np.random.default_rng(0)
    spent: dict[str, list[float]] = {"the same machine": [], "another machine": [], "another, all options": []}

    def turn() -> None:
        drawn = {"friction": draw.uniform(0.8, 1.2), "payload_kg": draw.uniform(0.0, 8.0)}
        factors = {name: draw.uniform(0.8, 1.0) for name in ("stiffness", "supply", "backlash")}
        for each, env, options in zip(
            spent.values(), (same, other, any_other), ({}, drawn, {**drawn, **factors}), strict=True
        ):
            began = time.process_time()
            env.reset(seed=0, options=options)
            each.append(time.process_time() - began)

    benchmark.pedantic(turn, rounds=200, warmup_rounds=3)
    for name, each in spent.items():
        benchmark.extra_info[f"{name}, ms"] = 1e3 * min(each[3:])
    ratio = min(spent["another machine"][3:]) / min(spent["the same machine"][3:])
    benchmark.extra_info["another over the same"] = ratio
    assert ratio <= 4.5


@pytest.mark.benchmark(group="environment of set points, 128 side by side")
@pytest.mark.parametrize("way", ["gymnasium's own", "one thread", "two threads"])
def test_vectors(benchmark: Any, way: str) -> None:
    options: dict[str, Any] = {"vectorization_mode": "sync"} if way == "gymnasium's own" else {}
    if not options:
        options = {"workers": 1 if way == "one thread" else 2}
    envs = gymnasium.make_vec(TRACK, num_envs=128, **options)
    actions = np.tile(ACTION, (128, 1))

    spent: list[float] = []

    def steps() -> None:
        began = time.process_time()
        for _ in range(50):
            envs.step(actions)
        spent.append(time.process_time() - began)

    benchmark.pedantic(steps, setup=lambda: envs.reset(seed=0) and None, rounds=9, warmup_rounds=1)
    benchmark.extra_info["environment steps a second of CPU time, best"] = 6400 / min(spent)
    benchmark.extra_info["environment steps a second by the clock, best"] = 6400 / benchmark.stats.stats.min
    envs.close()
