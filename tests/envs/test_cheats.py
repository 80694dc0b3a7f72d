"""Flights that would collect reward without doing the job: five for each environment, and what each gets."""

from __future__ import annotations

from collections.abc import Iterable
from typing import Any

import gymnasium
import numpy as np
import pytest
from numpy.typing import ArrayLike

from isel_twin.envs.track import TrackPath
from isel_twin.envs.tuning import JobTuning, to_action
from isel_twin.language import MoveSettings

pytestmark = pytest.mark.long(seconds=8)

TRACK = "isel_twin.envs:isel_twin/TrackPath-v0"
STEPS_PER_MM = 320
HIGHEST_MM_S = 50.0


def track(path: ArrayLike, **options: Any) -> TrackPath:
    env = gymnasium.make(TRACK, path=path, reference_mm=0.0, disable_env_checker=True, **options).unwrapped
    assert isinstance(env, TrackPath)
    env.reset(seed=0)
    return env


def fly(env: TrackPath, corners: Iterable[tuple[float, float]], mm_s: float, mm_s2: float = 400.0) -> list[Any]:
    """The steps of a flight straight from corner to corner by the counters, each leg with a ramp at both ends."""
    steps: list[Any] = []
    for corner in corners:
        start = env.counter_mm
        leg = np.array([*corner, 0.0]) - start
        length, gone, speed = float(np.linalg.norm(leg)), 0.0, 0.0
        while gone < length - 1e-6:
            speed = min(mm_s, speed + mm_s2 * env.step_s, max(1.0, np.sqrt(2.0 * mm_s2 * (length - gone))))
            gone = min(length, gone + speed * env.step_s)
            target = start + leg * gone / length
            steps.append(env.step((target - env.counter_mm) / env.step_s / HIGHEST_MM_S))
            if steps[-1][2] or steps[-1][3]:
                return steps
    return steps


def stand(env: TrackPath, flown: list[Any] | None = None) -> list[Any]:
    """The steps of a machine that is told to stand, behind those it has flown, until its episode is over."""
    steps = list(flown or [])
    while not (steps and (steps[-1][2] or steps[-1][3])):
        steps.append(env.step(np.zeros(3, np.float32)))
    return steps


def progress(steps: list[Any]) -> float:
    return float(sum(info["reward_progress"] for *_, info in steps))


@pytest.mark.parametrize(("mm_s", "ends"), [(30.0, "done"), (36.0, "lost steps"), (45.0, "lost steps")])
def test_an_end_in_full_flight_is_not_done(mm_s: float, ends: str) -> None:
    """A motor that is told to stand at once may stop, or slip: known only when it stands, 20 ms later at least."""
    env = track([(0, 0), (30, 0)])
    way_mm, steps = 0.0, 0
    while way_mm < 29.9:
        steps += 1
        speed = min(mm_s, 0.8 * steps)
        *_, over, _, info = env.step(np.array([speed / HIGHEST_MM_S, 0.0, 0.0], np.float32))
        way_mm = info["way_mm"]
        assert not over
    stopped = stand(env)
    assert stopped[-1][-1]["ended"] == ends
    assert len(stopped) >= 10 or ends != "done"


def test_who_is_done_stays_done() -> None:
    """Half a second later the tool is still where it has to be, and no rotor has slipped."""
    env = track([(0, 0), (10, 0)])
    assert stand(env, fly(env, [(10.0, 0.0)], 30.0))[-1][-1]["ended"] == "done"
    for _ in range(250):
        env.steps_left = 2
        observation, *_, info = env.step(np.zeros(3, np.float32))
        assert info["ended"] == "done"
    assert np.linalg.norm(env.tool_mm - (10.0, 0.0, 0.0)) < 0.1
    assert np.abs(observation[9:12]).max() < 0.5


def test_straight_through_a_zigzag_is_paid_by_what_was_flown() -> None:
    """Legs of 0.1 mm to and fro, 0.12 mm aside: a path of 31 mm within the tolerance of 20 mm of straight line."""
    env = track([(0.1 * k, 0.12 * (k % 2)) for k in range(201)], time_limit_s=2.0)
    assert env.path_mm[-1, 3] > 31.0
    steps = fly(env, [(0.05, 0.06), (20.0, 0.06)], 30.0)
    assert steps[-1][-1]["way_mm"] > 31.0
    assert 15.0 < progress(steps) < 20.1


def test_the_tip_of_a_hairpin_cannot_be_left_out() -> None:
    """Back 0.4 mm before the tip: on the path at every moment, and yet four tolerances from what it asks for."""
    env = track([(0, 0), (10, 0), (0, 0.01)])
    steps = fly(env, [(9.6, 0.0), (9.6, 0.02), (0.0, 0.0)], 20.0)
    assert steps[-1][-1]["ended"] == "outside"
    assert progress(steps) < 9.7
    env = track([(0, 0), (10, 0), (0, 0.01)])
    flown = fly(env, [(9.96, 0.0), (9.96, 0.02), (0.0, 0.02)], 20.0)  # within the tolerance
    assert stand(env, flown)[-1][-1]["ended"] == "done"


def test_there_and_back_gains_nothing() -> None:
    """Round the tip the whole way is paid; back over the gap between its legs it is taken away again."""
    env = track([(0, 0), (10, 0), (0, 0.05)], time_limit_s=10.0)
    steps = fly(env, [(9.6, 0.0), *[(10.0, 0.0), (10.0, 0.05), (9.6, 0.05), (9.6, 0.0)] * 5], 10.0)
    assert progress(steps) < steps[-1][-1]["way_mm"] + 0.05
    steps += fly(env, [(x, 0.0) for x in (5.0, 9.0) * 3], 20.0)
    assert progress(steps) < steps[-1][-1]["way_mm"] + 0.05


def test_to_stand_or_to_break_off_costs_more_than_the_way() -> None:
    still = sum(reward for _, reward, *_ in stand(track("corner", time_limit_s=1.0)))
    env = track("corner", time_limit_s=1.0)
    away = sum(reward for _, reward, *_ in fly(env, [(0.0, 5.0)], 20.0))
    env = track("corner", time_limit_s=5.0)
    done = stand(env, fly(env, [(20.0, 0.0), (20.0, 15.0)], 20.0))
    assert done[-1][-1]["ended"] == "done"
    assert still == pytest.approx(-10.0, abs=0.1)  # the time
    assert away < still < 0.0 < sum(reward for _, reward, *_ in done)


# JobTuning: each move is one step


SANE = MoveSettings(8000, 100, 300)
TOO_FAST = MoveSettings(40_000, 4000, 4000)
THERE_AND_BACK = [(40.0, 0.0, 0.0), (0.0, 0.0, 0.0)]


def made(env: JobTuning, *settings: MoveSettings) -> list[Any]:
    """The steps of an episode with these settings, one for each move."""
    env.reset(seed=0)
    return [env.step(to_action(each, env.ranges)) for each in settings]


def total(steps: list[Any]) -> float:
    return float(sum(reward for _, reward, *_ in steps))


def test_steps_lost_in_the_last_move_are_charged() -> None:
    """The controller has answered, and the job is over: the loss is measured at rest, all the same."""
    env = JobTuning(job=THERE_AND_BACK)
    sane, greedy = made(env, SANE, SANE), made(env, SANE, TOO_FAST)
    assert [step[2] for step in greedy] == [False, True]
    assert greedy[-1][-1]["slipped"]
    assert greedy[-1][-1]["reward_lost_steps"] == -20.0
    assert total(greedy) < total(sane) - 10.0


def test_what_is_lost_there_and_won_back_is_charged_twice() -> None:
    env = JobTuning(job=THERE_AND_BACK)
    steps = made(env, TOO_FAST, TOO_FAST)
    assert [info["reward_lost_steps"] for *_, info in steps] == [-20.0, -20.0]


def test_to_be_refused_early_costs_more_than_the_job() -> None:
    env = JobTuning(job=THERE_AND_BACK, time_limit_s=1.0)
    env.reset(seed=0)
    *_, terminated, truncated, info = env.step(to_action(MoveSettings(30, 1, 20), env.ranges))
    assert (terminated, truncated) == (False, True)
    assert info["reward_abort"] == -200.0
    assert info["reward_abort"] < total(made(JobTuning(job=THERE_AND_BACK), SANE, SANE))


def test_an_action_beyond_the_space_is_no_faster_controller() -> None:
    env = JobTuning(job=THERE_AND_BACK[:1], plant="kinematic")
    env.reset(seed=0)
    *_, most = env.step(np.array([1.0, 1.0, 1.0], np.float32))
    env.reset(seed=0)
    *_, beyond = env.step(np.array([9.0, 9.0, 9.0], np.float32))
    assert beyond == most


def test_time_before_the_machine_rests_is_paid_for() -> None:
    """A stop from 4000 Hz at once is over sooner, and the tool swings: reply plus settling is what counts."""
    env = JobTuning(job=THERE_AND_BACK[:1], machine="4030-portal", tolerance_mm=0.01)
    (_, reward, *_, info) = made(env, MoveSettings(12_000, 400, 4000))[0]
    assert info["reward_settling"] < -0.05
    assert reward == pytest.approx(info["reward_time"] + info["reward_settling"])
