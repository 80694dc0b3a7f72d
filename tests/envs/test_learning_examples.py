"""Programs in docs/examples that learn, at small size; of the one that needs PyTorch the wiring, with a stand-in."""

from __future__ import annotations

import importlib.util
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from isel_twin.machine import load_machine, with_overrides

pytestmark = pytest.mark.long(seconds=4)

EXAMPLES = Path(__file__).parents[2] / "docs" / "examples"


def load(name: str, monkeypatch: pytest.MonkeyPatch) -> Any:
    """The program as a module."""
    spec = importlib.util.spec_from_file_location(name, EXAMPLES / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    monkeypatch.setitem(sys.modules, name, module)
    spec.loader.exec_module(module)
    return module


def test_cma_beats_plain_ramps_in_no_more_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """On machines that it has not learned on, after two generations on three."""
    example = load("track_cma", monkeypatch)
    monkeypatch.setattr(example, "LEARNED_ON", range(3))
    found = example.main(["--generations", "2"])
    plain, learned = found["plain"], found["learned"]
    assert learned["done"] == plain["done"] == 10
    assert learned["time s"] <= plain["time s"]
    assert learned["rms um"] < 0.9 * plain["rms um"]


def test_a_plain_way_is_ramps_from_corner_to_corner(monkeypatch: pytest.MonkeyPatch) -> None:
    """20 mm at 40 mm/s with 400 mm/s2 from 1 mm/s: 2 (v - v0) / a + (L - (v^2 - v0^2) / a) / v."""
    example = load("track_cma", monkeypatch)
    way = example.Way(40.0, 400.0, 1.0)
    made = example.ramp(way, 20.0, 0.002)
    whole_s = 2.0 * 39.0 / 400.0 + (20.0 - (1600.0 - 1.0) / 400.0) / 40.0
    assert len(made) == np.ceil(whole_s / 0.002)
    assert made[-1] == pytest.approx(20.0)
    speeds = np.diff(made[:-1], prepend=0.0) / 0.002
    assert speeds[0] == pytest.approx(1.0 + 0.5 * 400.0 * 0.002)
    assert speeds.max() == pytest.approx(40.0)
    assert np.abs(np.diff(speeds)).max() <= 400.0 * 0.002 + 1e-9


def test_take_up_follows_the_direction_of_each_axis(monkeypatch: pytest.MonkeyPatch) -> None:
    example = load("track_cma", monkeypatch)
    points = np.array([(0.0, 0.0, 0.0), (5.0, 0.0, 0.0), (0.0, 0.0, 0.0)])
    plain = example.targets(example.Way(), points, 0.002)
    taken = example.targets(example.Way(take_up_x_mm=0.01), points, 0.002) - plain
    turn = int(plain[:, 0].argmax())
    np.testing.assert_allclose(taken[:turn, 0], 0.01)
    np.testing.assert_allclose(taken[turn + 2 :, 0], -0.01)
    assert not taken[:, 1:].any()


class Layer:
    """Stands for a layer of PyTorch: zeros, but for the bias of the feed."""

    def __init__(self, inputs: int, outputs: int, feed: float = 0.0) -> None:
        self.weight, self.bias = Part(np.zeros((outputs, inputs))), Part(np.zeros(outputs))
        self.bias.values[0] = feed


class Part:
    def __init__(self, values: Any) -> None:
        self.values = values

    def detach(self) -> Part:
        return self

    def numpy(self) -> Any:
        return self.values


class VecEnv:
    """Stands for the class of that name: many environments, as learners call them."""

    def __init__(self, num_envs: int, observation_space: Any, action_space: Any) -> None:
        self.num_envs, self.observation_space, self.action_space = num_envs, observation_space, action_space
        self._seeds: list[int | None] = [None] * num_envs

    def seed(self, seed: int) -> None:
        self._seeds = [seed + k for k in range(self.num_envs)]

    def _reset_seeds(self) -> None:
        self._seeds = [None] * self.num_envs


class VecNormalize:
    """Stands for the class of that name: it has found all to be 0, give or take 1."""

    def __init__(self, vector: Any, gamma: float, clip_obs: float, clip_reward: float) -> None:
        self.vector, self.epsilon = vector, 0.0
        self.obs_rms = types.SimpleNamespace(mean=np.zeros(40), var=np.ones(40))


class Fed:
    """Stands for PPO: it has learned to go along the path at half the feed."""

    def __init__(self, policy: str, normalised: Any, seed: int, **settings: Any) -> None:
        self.vector, self.num_timesteps, self.seed = normalised.vector, 0, seed
        self.vector.seed(seed)
        net = types.SimpleNamespace(policy_net=[Layer(40, 64, 0.5), object(), Layer(64, 64)])
        self.policy = types.SimpleNamespace(mlp_extractor=net, action_net=Layer(64, 4))
        self.ep_info_buffer = [{"r": 20.0, "l": 500}, {"r": 40.0, "l": 700}]

    def learn(self, total_timesteps: int, callback: Any) -> None:
        """Make some steps, as a learner would; at full speed, so that episodes end."""
        vector, ended = self.vector, 0
        observations = vector.reset()
        assert np.array_equal(observations[0, :35], track_ppo().make().reset(seed=self.seed)[0])
        for _ in range(0, total_timesteps, vector.num_envs):
            vector.step_async(np.ones((vector.num_envs, 4)))
            observations, rewards, over, infos = vector.step_wait()
            assert all(vector.observation_space.contains(of.astype(np.float32)) for of in observations)
            assert [bool(info) for info in infos] == over.tolist()
            assert all(rewards[over] < -50.0), "broken off"
            for k in np.flatnonzero(over):
                assert infos[k]["terminal_observation"][34] < observations[k, 34] == 1.0, "all the time is left"
                assert not infos[k]["TimeLimit.truncated"]
            ended += int(over.sum())
        assert ended
        vector.close()
        callback.model, callback.num_timesteps = self, total_timesteps
        callback._on_rollout_end()


def track_ppo() -> Any:
    return sys.modules["track_ppo"]


def test_ppo_is_wired_up_and_kept_without_pytorch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    example = load("track_ppo", monkeypatch)
    names = ("torch", "stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.callbacks")
    torch, baselines, common, callbacks = (types.ModuleType(name) for name in names)
    vec_env = types.ModuleType("stable_baselines3.common.vec_env")
    torch.set_num_threads = lambda number: None  # type: ignore[attr-defined]
    baselines.PPO, callbacks.BaseCallback = Fed, object  # type: ignore[attr-defined]
    vec_env.VecEnv, vec_env.VecNormalize = VecEnv, VecNormalize  # type: ignore[attr-defined]
    vec_env.VecMonitor = lambda vector: vector  # type: ignore[attr-defined]
    for module in (torch, baselines, common, callbacks, vec_env):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    monkeypatch.setattr(example, "ENVIRONMENTS", 3)
    file = tmp_path / "policy.npz"
    example.main(["--steps", "300", "--seeds", "0", "7", "--file", str(file)])
    curves = "seed,steps,reward_mm,episode_s\n0,300,30.0,2.4\n7,300,30.0,2.4\n"
    assert file.with_suffix(".csv").read_text(encoding="utf-8") == curves
    learned, env = example.Net.kept(7, file), example.make()
    assert learned.act(np.ones(35)).tolist() == [0.0, 0.0, 0.0, 0.0]
    half = example.judge(learned, env, range(1000, 1002))
    assert half["done"] == 2
    assert half == example.judge(example.Led(example.CONSTANT), env, range(1000, 1002)), "the same paths and machines"


def test_how_far_the_path_goes_straight_on_is_seen(monkeypatch: pytest.MonkeyPatch) -> None:
    """A right angle 3 mm ahead: 4 and 8 mm along the path are sqrt(3^2 + 1^2) and sqrt(3^2 + 5^2) mm away."""
    example = load("track_ppo", monkeypatch)
    observation = np.zeros(35)
    for k, ahead in enumerate((0.5, 1.0, 2.0, 4.0, 8.0)):
        observation[18 + 3 * k : 20 + 3 * k] = min(ahead, 3.0) / ahead, max(ahead - 3.0, 0.0) / ahead
    straight = [1.0, 1.0, 1.0, np.sqrt(10.0) / 4.0, np.sqrt(34.0) / 8.0]
    assert example.seen(observation)[35:] == pytest.approx(straight)
    assert np.array_equal(example.seen(np.stack([observation, observation]))[1], example.seen(observation))


def test_the_policies_that_are_kept_follow_paths_that_nobody_has_learned_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without PyTorch."""
    example = load("track_ppo", monkeypatch)
    learned = [name for name in example.everybody() if name.startswith("PPO")]
    assert learned
    for name in learned:
        found = example.judge(example.everybody()[name], example.make(), range(1000, 1003))
        assert found["done"] == 3
        assert found["mm/s"] > 15.0


def test_the_closed_form_of_take_up(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half the backlash; guide friction over the screw's stiffness; all friction over that of the motor's torque."""
    example = load("track_ppo", monkeypatch)
    machine = load_machine("4030")
    bare = {"axes.all.backlash": 0.0, "axes.all.guide_friction": 0.0, "axes.all.shaft_coulomb": 0.0}
    assert example.take_up_mm(with_overrides(machine, bare)).tolist() == [0.0, 0.0, 0.0]
    play = with_overrides(machine, {**bare, "axes.all.backlash": 0.02})
    assert example.take_up_mm(play) == pytest.approx([0.01] * 3)
    stuck = with_overrides(machine, {**bare, "axes.x.shaft_coulomb": 0.09})
    axis = stuck.axes[0]
    radians = 0.09 / (50 * axis.motor.torque_constant_nm_per_a * axis.stage.current_a)
    assert example.take_up_mm(stuck)[0] == pytest.approx(radians * 5.0 * (1.0 + axis.screw.lead_error) / (2.0 * np.pi))
    soft = with_overrides(machine, {**bare, "axes.x.guide_friction": 30.0, "axes.x.stiffness": 30.0})
    assert example.take_up_mm(soft)[0] > 1e-3, "30 N over 30 N/um, and what the motor yields"


def test_a_corner_is_seen_as_far_ahead_as_it_is(monkeypatch: pytest.MonkeyPatch) -> None:
    """Right angles 3 and 0.7 mm ahead: no faster than sqrt(v0^2 + 2 a s), from which a ramp leads down to v0."""
    example = load("track_ppo", monkeypatch)
    led = example.Led(example.Numbers(40.0, 400.0, 4.0))
    led.begin(load_machine("4030"))
    seen = np.zeros(35)
    for k, ahead in enumerate((0.5, 1.0, 2.0, 4.0, 8.0)):
        seen[18 + 3 * k : 20 + 3 * k] = min(ahead, 3.0) / ahead, max(ahead - 3.0, 0.0) / ahead
    speeds = [20.0 * (1.0 + float(led.act(seen)[0])) for _ in range(100)]
    assert speeds[0] == pytest.approx(4.0 + 400.0 * 0.004, rel=1e-5), "it speeds up by its ramp"
    assert speeds[-1] == pytest.approx(40.0), "at the feed, as it could still stop"
    near = seen.copy()
    for k, ahead in enumerate((0.5, 1.0, 2.0, 4.0, 8.0)):
        near[18 + 3 * k : 20 + 3 * k] = min(ahead, 0.7) / ahead, max(ahead - 0.7, 0.0) / ahead
    assert 20.0 * (1.0 + float(led.act(near)[0])) == pytest.approx(np.sqrt(16.0 + 2.0 * 400.0 * 0.7), rel=1e-4)


@pytest.mark.parametrize(("name", "module"), [("track_cma", "cma"), ("track_ppo", "stable_baselines3")])
def test_what_is_missing_is_one_line(name: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    example = load(name, monkeypatch)
    monkeypatch.setitem(sys.modules, module, None)
    arguments = [example.make(), 1] if name == "track_cma" else [1, 0]
    with pytest.raises(SystemExit, match=r"is not here: pip install 'isel-twin\[learn\]'"):
        example.learn(*arguments)
