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


class Fed:
    """Stands for PPO of stable-baselines3: it has learned to go along the path at half the feed."""

    def __init__(self, policy: str, vector: Any, **settings: Any) -> None:
        self.vector, self.settings, self.num_timesteps = vector, settings, 0
        net = types.SimpleNamespace(policy_net=[Layer(35, 64, 0.5), object(), Layer(64, 64)])
        self.policy = types.SimpleNamespace(mlp_extractor=net, action_net=Layer(64, 4))
        self.ep_info_buffer = [{"r": 2.0, "l": 500}, {"r": 4.0, "l": 700}]

    def learn(self, total_timesteps: int, callback: Any) -> None:
        """Make some steps, as a learner would."""
        observation, _ = self.vector.reset(seed=0)
        for _ in range(total_timesteps):
            observation, *_ = self.vector.step(np.zeros(4, dtype=np.float32))
        assert self.vector.observation_space.contains(observation)
        callback.model, callback.num_timesteps = self, total_timesteps
        callback._on_rollout_end()


def test_ppo_is_wired_up_and_kept_without_pytorch(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> None:
    example = load("track_ppo", monkeypatch)
    names = ("torch", "stable_baselines3", "stable_baselines3.common", "stable_baselines3.common.callbacks")
    torch, baselines, common, callbacks = (types.ModuleType(name) for name in names)
    env_util = types.ModuleType("stable_baselines3.common.env_util")
    torch.set_num_threads = lambda number: None  # type: ignore[attr-defined]
    baselines.PPO, callbacks.BaseCallback = Fed, object  # type: ignore[attr-defined]
    env_util.make_vec_env = lambda make, n_envs, seed: make()  # type: ignore[attr-defined]
    for module in (torch, baselines, common, callbacks, env_util):
        monkeypatch.setitem(sys.modules, module.__name__, module)
    file = tmp_path / "policy.npz"
    example.main(["--steps", "20", "--seeds", "1", "--file", str(file)])
    assert file.with_suffix(".csv").read_text(encoding="utf-8") == "seed,steps,reward_mm,episode_s\n0,20,30.0,2.4\n"
    learned, env = example.Net.kept(0, file), example.make()
    assert learned.act(np.ones(35)).tolist() == [0.0, 0.0, 0.0, 0.0]
    half = example.judge(learned, env, range(1000, 1002))
    assert half["done"] == 2
    assert half == example.judge(example.Led(example.CONSTANT), env, range(1000, 1002)), "the same paths and machines"


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
