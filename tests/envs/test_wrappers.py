"""Wrappers: observations within their box, other machines by lot, feed along a path."""

from __future__ import annotations

import copy
import pickle
import subprocess
import sys
from typing import Any

import gymnasium
import numpy as np
import pytest
from gymnasium.utils.env_checker import check_env

from isel_twin.envs import Settings
from isel_twin.envs.track import TrackPath
from isel_twin.envs.tuning import to_action
from isel_twin.envs.wrappers import AlongPath, Randomised, Scaled

pytestmark = [
    pytest.mark.filterwarnings("error"),
    # of what other files have left to the garbage collector
    pytest.mark.filterwarnings("default::pytest.PytestUnraisableExceptionWarning"),
    pytest.mark.filterwarnings("ignore:.*is different from the unwrapped version"),  # it is: that is what is checked
]
JOB = "isel_twin.envs:isel_twin/JobTuning-v0"
TRACK = "isel_twin.envs:isel_twin/TrackPath-v0"
SHORT = [(60.0, 2.0, 1.0), (0.0, 4.0, 2.0)]


def test_make_finds_both_without_an_import() -> None:
    """By the module in front of the id: Gymnasium reads no entry points since its version 1.0."""
    program = f"import gymnasium; print([gymnasium.make(i).spec.id for i in ({JOB!r}, {TRACK!r})])"
    said = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout
    assert said.strip() == "['isel_twin/JobTuning-v0', 'isel_twin/TrackPath-v0']"


@pytest.mark.parametrize("mode", ["sync", "async"])
def test_vectors_are_single_ones_side_by_side(mode: str) -> None:
    vector = gymnasium.make_vec(TRACK, num_envs=2, vectorization_mode=mode)
    singles = [gymnasium.make(TRACK) for _ in range(2)]
    seen, _ = vector.reset(seed=5)
    mine = np.array([env.reset(seed=5 + k)[0] for k, env in enumerate(singles)])
    np.testing.assert_array_equal(seen, mine)
    actions = np.array([[0.05, 0.0, 0.0], [0.02, 0.001, 0.0]], dtype=np.float32)
    for _ in range(10):
        seen = vector.step(actions)[0]
        mine = np.array([env.step(action)[0] for env, action in zip(singles, actions, strict=True)])
    np.testing.assert_array_equal(seen, mine)
    vector.close()


def test_scaled_observations_stay_in_their_box_and_lose_nothing() -> None:
    env = gymnasium.make(JOB, job=SHORT, disable_env_checker=True)
    scaled = Scaled(gymnasium.make(JOB, job=SHORT, disable_env_checker=True))
    check_env(scaled, skip_render_check=True)
    plain, (seen, _) = env.reset(seed=0)[0], scaled.reset(seed=0)
    np.testing.assert_allclose(seen[:3], np.array(SHORT[0]) / (395.0, 300.0, 140.0), rtol=1e-12)
    assert seen[14] == 1.0
    for settings in (Settings(40_000, 4000, 4000), Settings(5000, 100, 300)):
        plain = env.step(to_action(settings))[0]
        seen = scaled.step(to_action(settings))[0]
        assert np.abs(seen).max() <= 1.0
        units = np.array([0.05] * 3 + [16.0] * 3 + [0.05] * 3 + [1.0])
        np.testing.assert_allclose(seen[3:13] * units / (1.0 - np.abs(seen[3:13])), plain[3:13], rtol=1e-9)
    assert seen[6] > 0.5, "lost"
    assert (seen[13], seen[14]) == (plain[13] / 0.2, plain[14] / 2)


def test_scaled_follows_another_job() -> None:
    env = Scaled(gymnasium.make(JOB, job=SHORT, plant="kinematic"))
    assert env.reset(seed=0, options={"job": [*SHORT, *SHORT]})[0][14] == 1.0


def test_randomised_machines_come_from_the_seed_and_options_go_first() -> None:
    env = Randomised(gymnasium.make(TRACK), backlash=(0.0, 2.0), payload_kg=(1.0, 8.0))
    check_env(env, skip_render_check=True)
    first = env.reset(seed=1)[1]["randomised"]
    second = env.reset()[1]["randomised"]
    assert first.keys() == {"payload_kg", "backlash"}
    assert 1.0 <= first["payload_kg"] <= 8.0
    assert first != second
    env.step(np.zeros(3, np.float32))
    for other in (env, Randomised(gymnasium.make(TRACK), payload_kg=(1.0, 8.0), backlash=(0.0, 2.0))):
        assert other.reset(seed=1)[1]["randomised"] == first
        assert other.reset()[1]["randomised"] == second
    track = env.unwrapped
    assert isinstance(track, TrackPath)
    env.reset(seed=1, options={"payload_kg": 3.0})
    alone = gymnasium.make(TRACK)
    alone.reset(seed=1, options={"payload_kg": 3.0, "backlash": first["backlash"]})
    for _ in range(20):
        action = np.array([0.0, 0.05, 0.0], np.float32)
        np.testing.assert_array_equal(env.step(action)[0], alone.step(action)[0])
    assert pickle.loads(pickle.dumps(env)).reset()[1] == copy.deepcopy(env).reset()[1] == env.reset()[1]


def test_along_the_path_an_agent_that_does_nothing_arrives() -> None:
    env = AlongPath(gymnasium.make(TRACK, path="circle"), feed_mm_s=20.0)
    check_env(env, skip_render_check=True)
    env.reset(seed=0)
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(np.zeros(4, np.float32))
        over = terminated or truncated
    assert info["time_s"] == pytest.approx(5.0, abs=0.01), "at 10 mm/s the time limit comes before the end"
    assert info["way_mm"] == pytest.approx(50.0, abs=0.2)
    env.reset(seed=0)
    over = False
    while not over:
        *_, terminated, truncated, info = env.step(np.array([1.0, 0.0, 0.0, 0.0], np.float32))
        over = terminated or truncated
    assert info["ended"] == "done"
    assert info["time_s"] == pytest.approx(np.pi + 0.02, abs=0.02), "20 ms at rest"


def test_the_counters_are_sent_to_the_point_that_is_led() -> None:
    """By numpy: the point at the way that feeds have made, beside it the offset, and there at the end of a step."""
    env = AlongPath(gymnasium.make(TRACK, path="circle", tolerance_mm=5.0), feed_mm_s=10.0, offset_mm=0.002)
    env.reset(seed=0)
    track = env.unwrapped
    assert isinstance(track, TrackPath)
    sent = []
    track.step, step = lambda action: sent.append(action) or step(action), track.step  # type: ignore[method-assign]
    way_mm, draw = 0.0, np.random.default_rng(2)
    for _ in range(40):
        asked, before_mm = draw.uniform(-0.5, 0.5, 4).astype(np.float32), track.counter_mm
        env.step(asked)
        feed, *offset = asked.astype(np.float64)
        way_mm += 0.5 * (1.0 + feed) * 10.0 * 0.002
        at_mm = [np.interp(way_mm, track.path_mm[:, 3], track.path_mm[:, i]) for i in range(3)]
        expected = (np.array(at_mm) + 0.002 * np.array(offset) - before_mm) / 0.002 / 50.0
        np.testing.assert_allclose(sent[-1], expected, rtol=1e-6, atol=1e-7)


def test_the_offset_moves_the_counters_off_the_path() -> None:
    env = AlongPath(gymnasium.make(TRACK), offset_mm=0.02)
    env.reset(seed=0)
    env.step(np.array([-1.0, 0.5, -1.0, 0.0], np.float32))
    track = env.unwrapped
    assert isinstance(track, TrackPath)
    np.testing.assert_allclose(track.counter_mm, (0.01, -0.02, 0.0), atol=0.5 / 320 + 1e-9)


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda job, track: Scaled(track), "Scaled is for isel_twin/JobTuning-v0, not for TrackPath"),
        (lambda job, track: Randomised(job), "Randomised is for isel_twin/TrackPath-v0, not for JobTuning"),
        (lambda job, track: AlongPath(job), "AlongPath is for isel_twin/TrackPath-v0, not for JobTuning"),
        (lambda job, track: AlongPath(track, feed_mm_s=0.0), "feed_mm_s is 0.0; allowed"),
        (lambda job, track: Randomised(track, mass=(0, 1)), "unknown range 'mass'; there are: payload_kg, friction"),
        (lambda job, track: Randomised(track, friction=(2, 1)), r"range friction is \(2, 1\); allowed: two numbers"),
    ],
)
def test_what_does_not_fit_is_one_clear_line(make: Any, message: str) -> None:
    with pytest.raises(ValueError, match=message):
        make(gymnasium.make(JOB, plant="kinematic"), gymnasium.make(TRACK))


def test_a_range_that_the_machine_does_not_take_is_refused_before_the_first_episode() -> None:
    """0.5 mm of play times 3 are more than the 1 mm that a machine file allows."""
    track = gymnasium.make(TRACK, overrides={"axes.x.backlash": 0.5})
    with pytest.raises(ValueError, match=r"the machine does not take these options: .*backlash_mm must lie in 0"):
        Randomised(track, backlash=(0.0, 3.0))
