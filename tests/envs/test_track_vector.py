"""Many environments of set points in one compiled call are, each of them, what it is alone."""

from __future__ import annotations

from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode, SyncVectorEnv

from isel_twin.envs.track_vector import TrackVector
from isel_twin.envs.wrappers import AlongPath, Randomised

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


def test_a_bound_of_steps_ends_episodes_as_in_gymnasiums_own() -> None:
    """Where its wrapper says nothing of why, the vector says that the time is over."""
    own = played(gymnasium.make_vec(ID, num_envs=2, max_episode_steps=4, vectorization_mode="sync", **SHORT), 20)
    ours = played(gymnasium.make_vec(ID, num_envs=2, max_episode_steps=4, **SHORT), 20)
    rows = [[row for row in seen if not isinstance(row, dict)] for seen in (own, ours)]
    assert rows[1] == rows[0]
    assert [True, True] in rows[0]


def told(infos: dict[str, Any]) -> dict[str, Any]:
    """Infos as text, without the options by lot, which the vector does not tell."""
    parts = {name: told(value) if isinstance(value, dict) else repr(value) for name, value in infos.items()}
    return {name: parts[name] for name in sorted(parts) if "randomised" not in name}


def test_begun_anew_in_the_same_step_each_is_what_it_is_in_gymnasiums_own() -> None:
    """Episodes end off the path and by their time; last observations and infos are told."""
    make = lambda: AlongPath(Randomised(gymnasium.make(ID, **SHORT), **RANGES))  # noqa: E731
    ours = TrackVector(3, randomised=RANGES, along={}, autoreset_mode="SameStep", **SHORT)
    seen, draw, finals = [], np.random.default_rng(1), 0
    actions = draw.uniform(-1.2, 1.2, (60, 3, 4)).astype(np.float32)
    for envs in (SyncVectorEnv([make] * 3, autoreset_mode=AutoresetMode.SAME_STEP), ours):
        assert envs.metadata["autoreset_mode"] is AutoresetMode.SAME_STEP
        rows: list[Any] = [envs.reset(seed=5)[0].tobytes()]
        for asked in actions:
            observations, rewards, terminated, truncated, infos = envs.step(asked)
            rows += [observations.tobytes(), rewards.tobytes(), terminated.tolist(), truncated.tolist(), told(infos)]
            finals += "final_obs" in infos
        envs.close()
        seen.append(rows)
    assert finals > 2
    assert seen[1] == seen[0]


def test_machines_by_lot_are_those_of_the_wrapper() -> None:
    own = played(SyncVectorEnv([lambda: Randomised(gymnasium.make(ID, **SHORT), **RANGES)] * 2), 55)
    ours = played(TrackVector(2, randomised=RANGES, **SHORT), 55)
    assert ours[2:] == own[2:]
    assert ours[0] == own[0]


def led(envs: Any) -> list[Any]:
    """All that is said where feed and offset are drawn, past the ends of episodes."""
    draw = np.random.default_rng(1)
    seen = [envs.reset(seed=5)[0].tobytes()]
    for _ in range(55):
        observations, rewards, terminated, truncated, _ = envs.step(draw.uniform(-1.2, 1.2, (3, 4)).astype(np.float32))
        seen += [observations.tobytes(), rewards.tobytes(), terminated.tolist(), truncated.tolist()]
    envs.close()
    return seen


@pytest.mark.parametrize("workers", [1, 3])
def test_along_the_path_each_is_what_the_wrapper_makes_of_it(workers: int) -> None:
    how = {"feed_mm_s": 30.0, "offset_mm": 0.02}
    track = lambda: Randomised(gymnasium.make(ID, **SHORT), **RANGES)  # noqa: E731
    own = led(SyncVectorEnv([lambda: AlongPath(track(), **how)] * 3))
    assert any(seen is True for row in own if isinstance(row, list) for seen in row)
    ours = TrackVector(3, workers=workers, randomised=RANGES, along=how, **SHORT)
    assert ours.action_space.shape == (3, 4)
    assert led(ours) == own


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: TrackVector(0), "num_envs is 0; give at least 1"),
        (lambda: TrackVector(1, max_episode_steps=0), "max_episode_steps is 0; give at least 1"),
        (lambda: TrackVector(1, workers=0), "workers is 0; give at least 1"),
        (
            lambda: TrackVector(1, autoreset_mode="Disabled"),
            "autoreset_mode is 'Disabled'; there are: 'NextStep', 'SameStep'",
        ),
        (lambda: TrackVector(1).reset(seed=[1, 2]), "2 seeds for 1 environments"),
        (lambda: TrackVector(1).step(np.zeros((1, 3))), "call reset"),
        (lambda: TrackVector(1, along={"feed_mm_s": -1.0}), "feed_mm_s is -1.0; allowed: more than 0, up to 1000"),
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
    envs = TrackVector(2, along={})
    envs.reset(seed=0)
    with pytest.raises(ValueError, match=r"actions must be finite numbers, shape \(2, 4\)"):
        envs.step(np.zeros((2, 3)))


def test_a_machine_that_is_refused_ends_its_episode_alone_and_harms_nothing() -> None:
    envs = TrackVector(2, workers=1)
    envs.reset(seed=0)
    with pytest.raises(ValueError, match="option payload_kg is 30"):
        envs.reset(seed=0, options={"payload_kg": 30.0})
    observations, *_ = envs.step(np.zeros((2, 3)))
    assert np.isfinite(observations).all()
