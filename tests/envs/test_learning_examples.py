"""Programs in docs/examples that learn, at small size; of the one that needs PyTorch the wiring, with a stand-in."""

from __future__ import annotations

import importlib.util
import sys
import types
from pathlib import Path
from typing import Any

import numpy as np
import pytest

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


class Fed:
    """Stands for a model of stable-baselines3: along the path at half the feed."""

    def __init__(self, policy: str, vector: Any, **settings: Any) -> None:
        self.policy, self.vector, self.settings = policy, vector, settings

    def learn(self, total_timesteps: int) -> None:
        """Make some steps, as a learner would."""
        observation, _ = self.vector.reset(seed=0)
        for _ in range(total_timesteps):
            observation, *_ = self.vector.step(self.predict(observation)[0])
        assert self.vector.observation_space.contains(observation)

    def save(self, file: str) -> None:
        """Leave a file."""
        Path(file).write_text("a model", encoding="utf-8")

    def predict(self, observation: np.ndarray, deterministic: bool = True) -> tuple[np.ndarray, None]:
        """Half the feed."""
        return np.zeros(4, dtype=np.float32), None


def test_ppo_learns_saves_and_is_judged_beside_plain_feed(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    example = load("track_ppo", monkeypatch)
    asked: dict[str, Any] = {}

    def make_vec_env(make: Any, n_envs: int, seed: int, vec_env_cls: Any) -> Any:
        asked.update(n_envs=n_envs, seed=seed, vec_env_cls=vec_env_cls)
        return make()

    names = ("stable_baselines3", "stable_baselines3.common.env_util", "stable_baselines3.common.vec_env")
    stand_in, env_util, vec_env = (types.ModuleType(name) for name in names)
    stand_in.PPO, env_util.make_vec_env, vec_env.SubprocVecEnv = Fed, make_vec_env, object  # type: ignore[attr-defined]
    for name, module in zip(names, (stand_in, env_util, vec_env), strict=True):
        monkeypatch.setitem(sys.modules, name, module)
    monkeypatch.setitem(sys.modules, "stable_baselines3.common", types.ModuleType("stable_baselines3.common"))
    file = tmp_path / "model.zip"
    found = example.main(["--steps", "20", "--file", str(file), "--episodes", "2"])
    assert file.read_text(encoding="utf-8") == "a model"
    assert asked == {"n_envs": 4, "seed": 0, "vec_env_cls": object}
    assert found["done"] == 2
    assert found == example.judge(example.Plain(), 2), "both do the same on the same paths and machines"
    assert capsys.readouterr().out.splitlines()[1].startswith("learned")
    again = example.main(["--judge", str(file), "--episodes", "2"], load=lambda name: example.Plain())
    assert again == found


@pytest.mark.parametrize(("name", "module"), [("track_cma", "cma"), ("track_ppo", "stable_baselines3")])
def test_what_is_missing_is_one_line(name: str, module: str, monkeypatch: pytest.MonkeyPatch) -> None:
    example = load(name, monkeypatch)
    monkeypatch.setitem(sys.modules, module, None)
    arguments = [example.make(), 1] if name == "track_cma" else [1, "model.zip"]
    with pytest.raises(SystemExit, match=r"is not here: pip install 'isel-twin\[learn\]'"):
        example.learn(*arguments)
