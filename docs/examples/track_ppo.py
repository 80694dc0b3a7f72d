"""PPO learns feed and offsets along random paths, on machines drawn at random.

    pip install isel-twin[learn]                                              (brings PyTorch, some gigabytes)
    python docs/examples/track_ppo.py --steps 1000000 --file track_ppo.zip    learn
    python docs/examples/track_ppo.py --judge track_ppo.zip                   20 paths that it has not seen

The agent acts through `AlongPath`: feed, and an offset of the counters from the path. So from its first step on it goes
along the path, and has to learn where to slow down (corners, soft machines) and where to aim (take-up after reversals).
It makes a step every 4 ms. What it sees is scaled by the environment; rewards are millimetres, a whole path about 50,
and are divided by 10 for the learner.
"""

from __future__ import annotations

import argparse
from collections.abc import Callable, Sequence
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from isel_twin.envs.wrappers import AlongPath, Randomised

MACHINES = {
    "payload_kg": (0.0, 8.0),
    "friction": (0.7, 1.5),
    "stiffness": (0.5, 1.0),
    "supply": (0.8, 1.1),
    "backlash": (0.5, 2.0),
}


class Policy(Protocol):
    """What is asked of whoever acts; a model of stable-baselines3 is one."""

    def predict(self, observation: NDArray[np.float64], deterministic: bool = True) -> tuple[NDArray[Any], Any]:
        """The action for an observation, and a state that nobody uses here."""


class Plain:
    """A policy that goes along the path at a fixed feed, without an offset: what there is to beat."""

    def __init__(self, feed: float = 0.0) -> None:
        """feed: -1 .. 1, as AlongPath takes it."""
        self._action = np.array([feed, 0.0, 0.0, 0.0], dtype=np.float32)

    def predict(self, observation: NDArray[np.float64], deterministic: bool = True) -> tuple[NDArray[Any], Any]:
        """Always the same: at the end of the path AlongPath stands by itself."""
        return self._action, None


def make() -> Any:
    """The environment as the agent has it."""
    track = gymnasium.make("isel_twin.envs:isel_twin/TrackPath-v0", path="random", step_s=0.004)
    scaled = gymnasium.wrappers.TransformReward(AlongPath(Randomised(track, **MACHINES)), _tenth)
    return gymnasium.wrappers.RecordEpisodeStatistics(scaled)


def _tenth(reward: Any) -> float:
    return 0.1 * float(reward)


def learn(steps: int, file: str, environments: int = 4, seed: int = 0) -> Any:
    """Learn for so many steps of the environment and save the model."""
    try:
        from stable_baselines3 import PPO
        from stable_baselines3.common.env_util import make_vec_env
        from stable_baselines3.common.vec_env import SubprocVecEnv
    except ImportError:
        raise SystemExit("stable-baselines3 is not here: pip install 'isel-twin[learn]'") from None
    vector = make_vec_env(make, n_envs=environments, seed=seed, vec_env_cls=SubprocVecEnv)
    model = PPO(
        "MlpPolicy",
        vector,
        n_steps=2048,
        batch_size=512,
        gamma=0.995,
        learning_rate=3e-4,
        policy_kwargs={"log_std_init": -1.0, "net_arch": [128, 128]},
        seed=seed,
        verbose=1,
    )
    model.learn(total_timesteps=steps)
    model.save(file)
    return model


def judge(policy: Policy, episodes: int = 20, seed: int = 1000, env: Any = None) -> dict[str, float]:
    """What a policy does on so many paths and machines, the same ones for every policy."""
    env = make() if env is None else env
    ended: list[str] = []
    rewards, speeds, deviations = [], [], []
    for episode in range(episodes):
        observation, _ = env.reset(seed=seed + episode)
        total, over = 0.0, False
        while not over:
            action, _ = policy.predict(observation, deterministic=True)
            observation, reward, terminated, truncated, info = env.step(action)
            total, over = total + reward, terminated or truncated
            deviations.append(1e3 * info["deviation_mm"])
        rewards.append(10.0 * total)
        speeds.append(info["way_mm"] / info["time_s"])
        ended.append(info["ended"])
    return {
        "reward mm": float(np.mean(rewards)),
        "done": ended.count("done"),
        "mm a second": float(np.mean(speeds)),
        "rms um": float(np.sqrt(np.mean(np.square(deviations)))),
    }


def main(arguments: Sequence[str] | None = None, load: Callable[[str], Policy] | None = None) -> dict[str, float]:
    """Learn or judge; `load` reads a model, by default one of stable-baselines3."""
    parser = argparse.ArgumentParser(description="PPO on TrackPath-v0")
    parser.add_argument("--steps", type=int, default=1_000_000)
    parser.add_argument("--file", default="track_ppo.zip")
    parser.add_argument("--judge", default="", help="a model to judge; nothing is learned then")
    parser.add_argument("--episodes", type=int, default=20)
    given = parser.parse_args(arguments)
    if given.judge:
        if load is None:
            from stable_baselines3 import PPO

            load = PPO.load
        policy = load(given.judge)
    else:
        policy = learn(given.steps, given.file)
    found = judge(policy, given.episodes)
    for name, figures in (("plain", judge(Plain(), given.episodes)), ("learned", found)):
        print(f"{name:8}", ", ".join(f"{figure} {value:.4g}" for figure, value in figures.items()))
    return found


if __name__ == "__main__":
    main()
