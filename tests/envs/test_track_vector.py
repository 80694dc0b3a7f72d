"""Many environments of set points in one compiled call are, each of them, what it is alone."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import SyncVectorEnv

from isel_twin.envs.track_vector import TrackVector
from isel_twin.envs.wrappers import Randomised

ID = "isel_twin.envs:isel_twin/TrackPath-v0"
SHORT: dict[str, Any] = {"path": "random", "time_limit_s": 0.1, "tolerance_mm": 0.03, "reference_mm": 0.005}
RANGES = {"payload_kg": (0.0, 8.0), "friction": (0.8, 1.2)}


def played(envs: Any, steps: int = 60) -> list[Any]:
    """All that is said in so many steps, in which episodes end by their time and off the path."""
    observations, infos = envs.reset(seed=3)
    seen = [observations.tobytes(), {name: repr(value) for name, value in sorted(infos.items())}]
    for step in range(steps):
        way = observations[:, 18:21] * np.array([0.05, 0.1, 0.2])[: len(observations), None]
        if step == 30:
            way[-1] = 1.0
        observations, rewards, terminated, truncated, infos = envs.step(way.astype(np.float32))
        seen += [observations.tobytes(), rewards.tobytes(), terminated.tolist(), truncated.tolist()]
        seen.append({name: repr(value) for name, value in sorted(infos.items()) if "randomised" not in name})
    envs.close()
    return seen


@pytest.mark.parametrize("workers", [1, 2])
def test_each_is_what_it_is_in_gymnasiums_own(workers: int) -> None:
    own = played(SyncVectorEnv([lambda: gymnasium.make(ID, **SHORT)] * 3))
    assert any(seen is True for row in own if isinstance(row, list) for seen in row)
    assert played(gymnasium.make_vec(ID, num_envs=3, workers=workers, **SHORT)) == own


def test_machines_by_lot_are_those_of_the_wrapper() -> None:
    own = played(SyncVectorEnv([lambda: Randomised(gymnasium.make(ID, **SHORT), **RANGES)] * 2), 55)
    ours = played(TrackVector(2, randomised=RANGES, **SHORT), 55)
    assert ours[2:] == own[2:]
    assert ours[0] == own[0]


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TrackVector(0), "num_envs is 0; give at least 1"),
        (lambda: TrackVector(1, workers=0), "workers is 0; give at least 1"),
        (lambda: TrackVector(1).reset(seed=[1, 2]), "2 seeds for 1 environments"),
        (lambda: TrackVector(1).step(np.zeros((1, 3))), "call reset"),
    ],
)
def test_what_is_wrong_is_one_clear_line(make: Any, message: str) -> None:
    with pytest.raises((ValueError, gymnasium.error.ResetNeeded), match=message):
        make()


def test_actions_that_are_none_are_refused() -> None:
    envs = TrackVector(2)
    envs.reset(seed=0)
    for actions in (np.zeros((2, 2)), np.full((2, 3), np.nan)):
        with pytest.raises(ValueError, match=r"actions must be finite numbers, shape \(2, 3\)"):
            envs.step(actions)
