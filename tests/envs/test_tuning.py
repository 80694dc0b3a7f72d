"""The environment: what an agent does (stimulus), and what it is told and charged for it (verdict)."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import gymnasium
import numpy as np
import pytest
from conformance.closed_forms import tick_ns
from gymnasium.utils.env_checker import check_env
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.envs import Settings
from isel_twin.envs.tuning import JobTuning, to_action, to_settings

SHORT = [(5.0, 2.0, 1.0), (0.0, 4.0, 2.0)]
OUT_AND_BACK = [(100.0, 0.0, 0.0), (0.0, 0.0, 0.0)]
SANE = Settings(speed_hz=10_000, acceleration_hz_per_ms=100, start_stop_hz=300)
TOO_FAST = Settings(speed_hz=40_000, acceleration_hz_per_ms=4000, start_stop_hz=4000)
HALF_STEPS = Settings(speed_hz=2000, acceleration_hz_per_ms=10, start_stop_hz=300)
"""25 mm/s and 125 mm/s^2 where a mm has 80 steps."""
PERIOD_STEPS = 32
"""Four full steps of 1.8 degrees at 1600 steps a revolution."""


def make(**options: Any) -> JobTuning:
    env = gymnasium.make("isel_twin/JobTuning-v0", **options).unwrapped
    assert isinstance(env, JobTuning)
    return env


def step(env: JobTuning, settings: Settings) -> tuple[np.ndarray, float, bool, bool, dict[str, Any]]:
    observation, reward, terminated, truncated, info = env.step(to_action(settings, env.ranges))
    assert info["settings"] == settings
    terms = {name: value for name, value in info.items() if name.startswith("reward_")}
    assert reward == pytest.approx(sum(terms.values()))
    assert len(terms) == 5
    return observation, reward, terminated, truncated, info


def ramped_s(steps: int, speed_hz: int, acceleration_hz_per_ms: int, start_stop_hz: int) -> float:
    """Duration of a move."""
    return 1e-9 * float(tick_ns(steps, steps, speed_hz, start_stop_hz, 1000 * acceleration_hz_per_ms))


@pytest.mark.filterwarnings("ignore:.*Box observation space m..imum value is.*infinity")
@pytest.mark.parametrize("controller", ["imc-s8", "ismif"])
def test_gymnasium_finds_nothing_wrong(controller: str) -> None:
    check_env(make(job=SHORT, controller=controller), skip_render_check=True)


@pytest.mark.parametrize(
    ("action", "settings"),
    [
        ((-1.0, -1.0, -1.0), Settings(30, 1, 20)),
        ((0.0, 0.0, 0.0), Settings(20_015, 63, 283)),
        ((1.0, 1.0, 1.0), Settings(40_000, 4000, 4000)),
        ((9.0, -9.0, 9.0), Settings(40_000, 1, 4000)),
    ],
)
def test_actions_span_what_the_controller_takes(action: tuple[float, ...], settings: Settings) -> None:
    assert to_settings(np.array(action)) == settings


@given(st.builds(Settings, st.integers(30, 40_000), st.integers(1, 4000), st.integers(20, 4000)))
def test_every_setting_has_its_action(settings: Settings) -> None:
    action = to_action(settings)
    assert np.abs(action).max() <= 1.0
    assert to_settings(action) == settings


@pytest.mark.parametrize("action", [(0.0, 0.0), (0.0, 0.0, math.nan), (math.inf, 0.0, 0.0)])
def test_an_action_that_is_none_is_refused(action: tuple[float, ...]) -> None:
    with pytest.raises(ValueError, match=r"action is .* three finite numbers"):
        to_settings(np.array(action))


def test_same_seed_same_bits_and_another_seed_another_machine() -> None:
    def episode(seed: int | None, env: JobTuning) -> bytes:
        observations = [env.reset(seed=seed)[0], step(env, SANE)[0], step(env, TOO_FAST)[0]]
        return b"".join(observation.tobytes() for observation in observations)

    env = make(job=SHORT)
    first, next_one, again, other = episode(1, env), episode(None, env), episode(1, make(job=SHORT)), episode(2, env)
    assert first == again
    assert len({first, next_one, other}) == 3


def test_a_sane_job_costs_its_time_and_loses_nothing() -> None:
    env = make(job=OUT_AND_BACK)
    start, _ = env.reset(seed=0)
    np.testing.assert_allclose(start[0:3], [100.0, 0.0, 0.0])
    assert start[14] == 2
    duration_s = ramped_s(32_000, 10_000, 100, 300)

    half_way, reward, terminated, truncated, info = step(env, SANE)
    assert (terminated, truncated, info["reply"], info["slipped"]) == (False, False, "0", False)
    assert reward == pytest.approx(-duration_s, abs=1e-3)
    assert info["edge"] == pytest.approx(22_800 / 10_000, rel=0.015), "speed of zero growth over that of the move, Hz"
    assert half_way[12] == pytest.approx(duration_s, abs=1e-3)
    np.testing.assert_allclose(half_way[0:3], [-100.0, 0.0, 0.0])
    assert np.abs(half_way[3:6]).max() < 0.03, "mm, as good as the machine is"
    assert np.abs(half_way[6:9]).max() < 4.0, "load angle only"

    end, reward, terminated, truncated, info = step(env, SANE)
    assert (terminated, truncated) == (True, False)
    assert info["time_s"] == pytest.approx(2.0 * duration_s, abs=2e-3)
    np.testing.assert_array_equal(end[0:3], 0.0)
    assert end[14] == 0


def test_too_fast_loses_whole_periods_and_is_charged_though_the_controller_is_content() -> None:
    env = make(job=OUT_AND_BACK)
    env.reset(seed=0)
    observation, _, terminated, _, info = step(env, TOO_FAST)
    assert (info["reply"], terminated) == ("0", False)
    assert info["slipped"]
    assert (info["reward_lost_steps"], info["reward_tolerance"], info["reward_abort"]) == (-20.0, -10.0, 0.0)
    lost = observation[6]
    assert lost > PERIOD_STEPS
    assert lost == pytest.approx(PERIOD_STEPS * round(lost / PERIOD_STEPS), abs=0.1 * PERIOD_STEPS)
    assert observation[3] == pytest.approx(-lost / 320, abs=0.05), "the carriage is where the rotor is"


def test_after_lost_steps_the_way_back_ends_in_the_limit_switch() -> None:
    env = make(job=OUT_AND_BACK)
    env.reset(seed=0)
    step(env, TOO_FAST)
    observation, _, terminated, truncated, info = step(env, SANE)
    assert (info["reply"], terminated, truncated) == ("2", True, False)
    assert info["reward_abort"] == -200.0
    assert observation[14] == 1, "that move was not made"


def test_on_the_kinematic_plant_nothing_is_ever_lost() -> None:
    env = make(job=OUT_AND_BACK, plant="kinematic")
    env.reset(seed=0)
    observation, reward, *_ = step(env, TOO_FAST)
    np.testing.assert_allclose(observation[3:12], 0.0, atol=1e-9)
    assert reward == pytest.approx(-ramped_s(32_000, 40_000, 4000, 4000), abs=1e-3)


@pytest.mark.parametrize("hz_per_ms", [200, 400, 800])
def test_the_vibration_after_the_stop_is_that_of_the_structure(hz_per_ms: int) -> None:
    # X: 12 kg push off against a portal of 32 kg with them, on a soft 2 N/um (slower than what the motor follows). The
    # push of a ramp of half a period leaves it at (1 + q) m a / k, q what 3 % leave of a swing after half a period; the
    # jump at its end (300 Hz) is a blow beside it.
    stiffness, all_kg, carriage_kg = 2e6, 32.0, 12.0
    omega = math.sqrt(stiffness / all_kg)
    settings = Settings(300 + round(1e3 * math.pi / omega * hz_per_ms), hz_per_ms, 300)
    env = make(job=[(50.0, 0.0, 0.0)], overrides={"structure.flex_x.stiffness": 2.0})
    env.reset(seed=0)
    observation, *_ = step(env, settings)
    left = math.exp(-0.03 * math.pi)
    swing_mm = (1.0 + left) * carriage_kg * (hz_per_ms * 1e3 / 320) / stiffness
    blow_mm = carriage_kg / all_kg * (300 / 320) / omega
    expected_mm = math.hypot(swing_mm, blow_mm) * (1.0 + left) / 2.0
    assert observation[9] == pytest.approx(expected_mm, rel=0.2)


def test_the_time_limit_breaks_a_move_off() -> None:
    env = make(job=OUT_AND_BACK, plant="kinematic", time_limit_s=1.0)
    env.reset(seed=0)
    _, _, terminated, truncated, info = step(env, SANE)
    assert (terminated, truncated, info["reply"]) == (False, True, "")
    assert info["reward_time"] == pytest.approx(-1.0, abs=0.01)
    assert info["reward_abort"] == -200.0
    assert env.twin is not None
    counts = env.twin.counts
    assert 0 < counts[0] < 32_000
    env.twin.run(1.0)
    np.testing.assert_array_equal(env.twin.counts, counts)


def test_a_scenario_happens_in_the_episode(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('[[event]]\nat = 4.0\nset = { estop = "pressed" }', encoding="utf-8")
    env = make(job=OUT_AND_BACK, plant="kinematic", scenario=scenario)
    env.reset(seed=0)
    _, _, terminated, _, info = step(env, SANE)
    assert (info["reply"], terminated) == ("9", True)
    assert info["reward_abort"] == -200.0


def test_a_speed_that_this_controller_refuses_ends_the_episode(tmp_path: Path) -> None:
    (tmp_path / "machine.toml").write_text(
        'based_on = "4030"\nname = "slow"\n[controller]\n'
        'max_speed_hz = { value = 10000, unit = "Hz", grade = "setting", source = "this test" }\n',
        encoding="utf-8",
    )
    env = make(job=OUT_AND_BACK, plant="kinematic", machine=tmp_path)
    env.reset(seed=0)
    _, _, terminated, _, info = step(env, TOO_FAST)
    assert (info["reply"], terminated) == ("D", True)
    assert info["reward_abort"] == -200.0


@pytest.mark.parametrize(
    ("controller", "lowest", "highest"),
    [
        ("imc-s8", Settings(30, 1, 20), Settings(40_000, 4000, 4000)),
        ("c142", Settings(30, 1, 20), Settings(10_000, 4000, 4000)),
        ("ismif", Settings(65, 1, 65), Settings(5000, 4000, 4000)),
    ],
)
def test_the_action_space_is_what_the_controller_takes(controller: str, lowest: Settings, highest: Settings) -> None:
    env = make(job=[(0.1, 0.0, 0.0)], plant="kinematic", controller=controller, settle_s=0.01)
    for action, settings in ((-1.0, lowest), (1.0, highest)):
        env.reset(seed=0)
        *_, terminated, _, info = env.step(np.full(3, action, dtype=np.float32))
        assert info["settings"] == settings
        assert (terminated, info["reward_abort"]) == (True, 0.0), "and it has made the move"
        np.testing.assert_array_equal(to_action(settings, env.ranges), action)


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_the_same_job_by_a_controller_of_another_language(plant: str) -> None:
    """Half steps, jobs instead of moves, a ramp length instead of an acceleration; the same law of motion."""
    env = make(job=OUT_AND_BACK, plant=plant, controller="ismif")
    start, _ = env.reset(seed=0)
    np.testing.assert_allclose(start[0:3], [100.0, 0.0, 0.0])
    duration_s = ramped_s(8000, 2000, 10, 300)
    half_way, reward, terminated, truncated, info = step(env, HALF_STEPS)
    assert (terminated, truncated, info["slipped"]) == (False, False, False)
    assert info["reply"] == "\r\x02\r"
    assert reward == pytest.approx(-duration_s, abs=2e-3)
    assert np.abs(half_way[3:6]).max() < 0.03
    end, _, terminated, truncated, info = step(env, HALF_STEPS)
    assert (terminated, truncated, end[14]) == (True, False, 0)
    assert info["time_s"] == pytest.approx(2.0 * duration_s, abs=4e-3)


def test_the_time_limit_breaks_off_in_another_language_too() -> None:
    env = make(job=OUT_AND_BACK, plant="kinematic", controller="ismif", time_limit_s=1.0)
    env.reset(seed=0)
    _, _, terminated, truncated, info = step(env, HALF_STEPS)
    assert (terminated, truncated, info["reply"], info["reward_abort"]) == (False, True, "", -200.0)
    assert env.twin is not None
    counts = env.twin.counts
    assert 0 < counts[0] < 8000
    env.twin.run(1.0)
    np.testing.assert_array_equal(env.twin.counts, counts)


def test_a_fault_that_no_reply_tells_ends_the_episode() -> None:
    env = make(job=OUT_AND_BACK, plant="kinematic", controller="ismif")
    env.reset(seed=0)
    assert env.twin is not None
    assert env.twin.query("no command") == "\r"
    _, _, terminated, _, info = step(env, HALF_STEPS)
    assert (terminated, info["reward_abort"]) == (True, -200.0)


def test_another_job_for_an_episode() -> None:
    env = make(job=SHORT, plant="kinematic")
    observation, _ = env.reset(seed=0, options={"job": [(0.0, 0.0, 7.0)]})
    np.testing.assert_allclose(observation[0:3], [0.0, 0.0, 7.0])
    with pytest.raises(ValueError, match=r"unknown options .*jobs"):
        env.reset(options={"jobs": SHORT})


def test_no_step_outside_an_episode() -> None:
    env = make(job=[(1.0, 0.0, 0.0)], plant="kinematic")
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(to_action(SANE))
    env.reset(seed=0)
    assert step(env, SANE)[2]
    with pytest.raises(gymnasium.error.ResetNeeded):
        env.step(to_action(SANE))


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"job": []}, "no moves"),
        ({"job": [(1.0, 2.0)]}, "target 1"),
        ({"job": [(1.0, 2.0, math.nan)]}, "target 1"),
        ({"job": [(0.0, 0.0, 0.0), (400.0, 0.0, 0.0)]}, "target 2: x is 400 mm; allowed: 0 to 395"),
        ({"settle_s": 0.0}, "settle_s is 0.0"),
        ({"load_nm": -0.1}, "load_nm is -0.1"),
        ({"machine": "4031"}, "unknown machine '4031'"),
        ({"controller": "imc-s9"}, "unknown controller 'imc-s9'"),
        ({"overrides": {"payload.weight": 1.0}}, "payload.weight"),
    ],
)
def test_bad_arguments_get_one_clear_line(options: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message) as caught:
        make(plant="kinematic", **options).reset(seed=0)
    assert "\n" not in str(caught.value)


def test_a_controller_without_language_is_named(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isel_twin.envs.moves.create_language", lambda name: None)
    with pytest.raises(ValueError, match="controller 'toy' has no language"):
        make(controller="toy")


def test_no_reference_run_is_one_clear_line(tmp_path: Path) -> None:
    scenario = tmp_path / "scenario.toml"
    scenario.write_text('[[event]]\nat = 0.5\nset = { estop = "pressed" }', encoding="utf-8")
    with pytest.raises(
        ValueError, match=r"^no reference run: imc-s8 answers '9' to @0R7<13>.*; take a scenario"
    ) as caught:
        make(job=SHORT, plant="kinematic", scenario=scenario).reset(seed=0)
    assert "\n" not in str(caught.value)


def picture(env: JobTuning) -> np.ndarray | str:
    """What render gives, or the reason why it cannot (a machine without OpenGL)."""
    try:
        image = env.render()
    except RuntimeError as error:
        return str(error)
    assert image is not None
    return image


def test_a_picture_or_one_line_that_says_what_is_missing() -> None:
    env = make(job=SHORT, plant="kinematic", render_mode="rgb_array")
    env.reset(seed=0)
    before = picture(env)
    env.reset(options={"job": [(300.0, 200.0, 60.0)]})
    step(env, TOO_FAST)
    after = picture(env)
    env.close()
    if isinstance(before, str) or isinstance(after, str):
        assert before == after
        assert str(before).startswith("no picture without OpenGL")
        assert "\n" not in str(before)
    else:
        assert before.shape == after.shape == (480, 640, 3)
        assert before.std() > 10.0, "not an empty picture"
        assert (before != after).mean() > 0.02, "the machine has moved"


def test_moves_of_a_control_that_answers_nothing_are_done() -> None:
    """A CNC says nothing on the line when a program is over: that is no move that had to be broken off."""
    env = make(job=[(20, 0, 0), (0, 10, 5)], plant="kinematic", controller="bwo900", machine="4030-servo")
    env.reset(seed=0)
    for _ in range(2):
        _, reward, _, _, info = env.step(np.zeros(3, np.float32))
        assert info["reward_abort"] == 0.0
        assert reward > -10.0
    assert env.twin is not None
    assert tuple(env.twin.counts) == (0, 10_000, 5_000)
