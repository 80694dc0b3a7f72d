"""Many environments side by side are, each of them, what it is alone: in threads, processes and Gymnasium's own."""

from __future__ import annotations

import pickle
from contextlib import closing
from functools import partial
from typing import Any, ClassVar

import gymnasium
import numpy as np
import pytest
from gymnasium.vector import AutoresetMode

from isel_twin.envs import Settings
from isel_twin.envs.tuning import JobTuning, to_action
from isel_twin.envs.vector import TwinVector, tuning_vector

pytestmark = pytest.mark.long(seconds=4)

NAME = "isel_twin/JobTuning-v0"
JOB = [(6.0, 4.0, 1.0), (2.0, 8.0, 3.0)]
FAST, SLOW = to_action(Settings(9_000, 200, 300)), to_action(Settings(3_000, 60, 300))
WAYS: dict[str, dict[str, Any]] = {
    "sync": {"vectorization_mode": "sync"},
    "async": {"vectorization_mode": "async"},
    "serial": {"mode": "serial"},
    "threads": {"mode": "threads", "workers": 2},
    "processes": {"mode": "processes", "workers": 2},
}


def actions(step: int) -> np.ndarray:
    """float32 [3, 3], another for each environment and step."""
    return np.array([[FAST, SLOW, FAST], [SLOW, SLOW, FAST], [FAST, FAST, SLOW]][step % 3], dtype=np.float32)


def played(envs: Any, steps: int) -> list[Any]:
    """Everything that envs say."""
    observations, infos = envs.reset(seed=5)
    seen: list[Any] = [observations.tobytes(), sorted(infos)]
    for step in range(steps):
        observations, rewards, terminated, truncated, infos = envs.step(actions(step))
        seen += [observations.tobytes(), rewards.tobytes(), terminated.tolist(), truncated.tolist()]
        seen += [{key: repr(value) for key, value in infos.items()}]
    envs.close()
    return seen


def alone(number: int, steps: int, plant: str) -> list[Any]:
    """Environment `number` by itself, begun anew with the step after an episode."""
    env, over = gymnasium.make(NAME, job=JOB, plant=plant), False
    seen: list[Any] = [env.reset(seed=5 + number)[0].tobytes()]
    for step in range(steps):
        if over:
            observation, reward, over = env.reset()[0], 0.0, False
        else:
            observation, reward, terminated, truncated, _ = env.step(actions(step)[number])
            over = terminated or truncated
        seen.append((observation.tobytes(), reward))
    return seen


@pytest.mark.parametrize("way", WAYS)
def test_each_is_what_it_is_alone(way: str) -> None:
    plant = "mujoco" if way in ("threads", "processes") else "kinematic"
    seen = played(gymnasium.make_vec(NAME, num_envs=3, job=JOB, plant=plant, **WAYS[way]), 4)
    for number in range(3):
        expected = alone(number, 4, plant)
        rows = [np.frombuffer(seen[0]).reshape(3, -1)[number].tobytes()]
        for step in range(4):
            observation, reward = seen[2 + 5 * step : 4 + 5 * step]
            rows.append((np.frombuffer(observation).reshape(3, -1)[number].tobytes(), np.frombuffer(reward)[number]))
        assert rows == expected


@pytest.mark.parametrize("autoreset", ["NextStep", "SameStep"])
@pytest.mark.parametrize("mode", ["serial", "threads", "processes"])
def test_they_begin_anew_as_gymnasiums_own_do(mode: Any, autoreset: str) -> None:
    """Infos and final observations, too; Gymnasium documents both kinds of beginning anew."""
    make = [lambda: gymnasium.make(NAME, job=JOB, plant="kinematic")] * 3
    own = gymnasium.vector.SyncVectorEnv(make, autoreset_mode=AutoresetMode(autoreset))
    assert played(TwinVector(make, mode, 2, autoreset), 5) == played(own, 5)


def test_who_is_over_is_reset_by_the_caller() -> None:
    envs = tuning_vector(2, "serial", autoreset_mode=AutoresetMode.DISABLED, job=JOB[:1], plant="kinematic")
    first, _ = envs.reset(seed=3)
    *_, terminated, _, _ = envs.step(np.array([FAST, FAST]))
    assert terminated.tolist() == [True, True]
    again, _ = envs.reset(seed=[3, None], options={"reset_mask": np.array([True, False])})
    assert again[0].tolist() == first[0].tolist()
    assert again[1].tolist() != first[1].tolist()
    with pytest.raises(gymnasium.error.ResetNeeded):
        envs.step(np.array([FAST, FAST]))
    with pytest.raises(ValueError, match=r"^reset_mask is .*; it must be 2 of True and False, one of them True$"):
        envs.reset(options={"reset_mask": np.array([False, False])})
    assert envs.metadata["autoreset_mode"] is AutoresetMode.DISABLED


@pytest.mark.parametrize("mode", ["threads", "processes"])
def test_attributes_errors_and_spaces(mode: Any) -> None:
    with closing(tuning_vector(2, mode, 2, job=JOB, plant="kinematic")) as envs:
        assert envs.single_observation_space.shape == (15,)
        assert envs.action_space.shape == (2, 3)
        assert [ranges["speed_hz"] for ranges in envs.get_attr("ranges")] == [(30, 40000)] * 2
        with pytest.raises(gymnasium.error.ResetNeeded):
            envs.step(np.array([FAST, FAST]))
        envs.reset(seed=1)
        with pytest.raises(ValueError, match="unknown options"):
            envs.reset(options={"speed": 1})
        envs.reset(seed=1)
        assert envs.step(np.array([FAST, FAST]))[0].shape == (2, 15)


class Counted(gymnasium.Env[Any, Any]):
    """Fails in every step by its number; `closed` counts the ends of those in this process."""

    observation_space = action_space = gymnasium.spaces.Discrete(2)
    closed: ClassVar[list[int]] = []

    def __init__(self, number: int) -> None:
        self.number = number

    def reset(self, *, seed: int | None = None, options: Any = None) -> tuple[int, dict[str, Any]]:
        return 0, {}

    def step(self, action: Any) -> Any:
        raise ValueError(f"environment {self.number}")

    def close(self) -> None:
        self.closed.append(self.number)


@pytest.mark.parametrize(("mode", "at_first", "at_the_end"), [("threads", [], [0, 1, 2]), ("processes", [0], [0])])
def test_the_first_error_is_raised_and_each_environment_closed_once(
    mode: Any, at_first: list[int], at_the_end: list[int]
) -> None:
    """With processes one is made here, too, for its spaces, and closed at once."""
    Counted.closed.clear()
    envs = TwinVector([partial(Counted, number) for number in range(3)], mode, 3, context=None)
    assert Counted.closed == at_first
    envs.reset()
    with pytest.raises(ValueError, match=r"^environment 0$"):
        envs.step(np.array([0, 0, 0]))
    envs.close()
    assert Counted.closed == at_the_end


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"mode": "fast"}, "^unknown mode 'fast'; there are: serial, threads, processes$"),
        ({"workers": 0}, "^workers is 0; give at least 1$"),
        ({"num_envs": 0}, "^there is no environment; give at least one$"),
    ],
)
def test_wrong_arguments_get_one_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        tuning_vector(**{"num_envs": 1, **options})


def test_an_environment_can_be_pickled_in_mid_episode() -> None:
    env = JobTuning(job=JOB)
    assert pickle.loads(pickle.dumps(env)).reset(seed=2)[0].tolist() == env.reset(seed=2)[0].tolist()
    env.step(FAST)
    other = pickle.loads(pickle.dumps(env))
    one, two = env.step(SLOW), other.step(SLOW)
    assert (one[0].tobytes(), *one[1:4], repr(one[4])) == (two[0].tobytes(), *two[1:4], repr(two[4]))
    assert env.reset()[0].tolist() == other.reset()[0].tolist()


def test_same_seed_same_bits_whatever_came_before() -> None:
    """A seed that has been here before is restored; one that is new is not."""
    env, fresh, looks = JobTuning(job=JOB), JobTuning(job=JOB), list[int]()

    def episode(env: JobTuning, seed: int | None) -> list[Any]:
        first, _ = env.reset(seed=seed)
        return [first.tobytes(), *((s[0].tobytes(), s[1], repr(s[4])) for s in (env.step(FAST), env.step(SLOW)))]

    expected = episode(fresh, 7)
    env.reset()
    env.step(SLOW)
    assert episode(env, 7) == expected
    before = env.twin
    assert before is not None
    before.observe(lambda twin: looks.append(twin.time_ns), None)
    looked = len(looks)
    assert episode(env, 7) == expected
    assert env.twin is not before, "somebody looks at the twin of the last episode"
    assert len(looks) == looked
    before = env.twin
    assert episode(env, 7) == expected
    assert env.twin is before
    assert episode(env, None) == episode(fresh, None)


def test_a_search_branches_between_moves() -> None:
    env, other = JobTuning(job=JOB), JobTuning(job=JOB)
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.save()
    env.reset(seed=3)
    env.step(FAST)
    here = env.save()
    seen = [env.step(SLOW)]
    for again in (env, env, other):
        again.restore(pickle.loads(pickle.dumps(here)))
        seen.append(again.step(SLOW))
    assert len({(step[0].tobytes(), step[1], step[2], repr(step[4])) for step in seen}) == 1
    assert env.save().over
    with pytest.raises(ValueError, match=r"^the episode is of another setup; restore it"):
        JobTuning(job=JOB, plant="kinematic").restore(here)
