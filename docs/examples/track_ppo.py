"""What PPO learns on random paths and machines, beside what a formula and CMA-ES do there.

    python docs/examples/track_ppo.py --judge                      the table of docs/learning.md, without PyTorch
    python docs/examples/track_ppo.py --search 14                  the numbers of CMA-ES anew
    python docs/examples/track_ppo.py --seeds 0 1 2 3 4            PPO anew: three minutes of one core a seed
                                                                   pip install isel-twin[learn] (brings PyTorch)
    python docs/examples/track_ppo.py --picture curves.png         its curves

All act through `AlongPath`, every 4 ms: feed, and an offset of the counters from the path. What each of them knows:

    constant     the feed alone
    plain        feed, ramp and corner speed of a controller that sees corners coming
    formula      and the take-up after reversals in closed form, of the machine's own numbers or those of its file
    CMA-ES       the same five numbers as found on the training machines by reward
    PPO          all 35 observations, the tool's own place among them, and how far the path goes straight on

Learned policies are kept as plain arrays (track_ppo.npz), so that whoever judges them needs numpy alone; their curves,
by the reward that they learn by, in track_ppo.csv.
"""

from __future__ import annotations

import argparse
import csv
import math
from collections.abc import Mapping, Sequence
from dataclasses import astuple, dataclass
from pathlib import Path
from typing import Any, Protocol

import gymnasium
import numpy as np
from numpy.typing import NDArray

from isel_twin.envs.track import TrackPath
from isel_twin.envs.track_vector import TrackVector
from isel_twin.envs.tracking import PREVIEW_MM, SIZE
from isel_twin.envs.variations import varied
from isel_twin.envs.wrappers import AlongPath, Randomised
from isel_twin.machine import Machine, load_machine

FEED_MM_S, OFFSET_MM, STEP_S = 40.0, 0.03, 0.004
MACHINES = {
    "payload_kg": (0.0, 8.0),
    "friction": (0.7, 1.5),
    "stiffness": (0.5, 1.0),
    "supply": (0.8, 1.1),
    "backlash": (0.5, 2.0),
}
WORSE = {
    "payload_kg": (8.0, 12.0),
    "friction": (1.5, 2.0),
    "stiffness": (0.4, 0.5),
    "supply": (0.7, 0.8),
    "backlash": (2.0, 2.5),
}
"""Machines that nobody has learned on."""
HELD_OUT: Mapping[str, tuple[str, Mapping[str, Any]]] = {
    "new random paths, machines as in training": ("random", MACHINES),
    "new random paths, machines beyond": ("random", WORSE),
    "square": ("square", MACHINES),
    "circle": ("circle", MACHINES),
}
TRAINED_ON, JUDGED_ON = range(8), range(1000, 1040)
"""Seeds of paths and machines: of CMA-ES, and of the judge."""
STEPS, ENVIRONMENTS = 2_000_000, 128
GAMMA = 0.99
"""Of PPO: a tenth as important after 0.9 s."""
DEVIATION_WEIGHT = 100.0
"""Of its reward while it learns; judged is the environment's own, 20."""
SEEN = 10.0
"""So many standard deviations off the mean an observation is cut off, as VecNormalize does."""
DATA = Path(__file__).with_name("track_ppo.npz")

Layer = tuple[NDArray[np.float64], NDArray[np.float64]]


class Policy(Protocol):
    """What is asked of whoever acts."""

    def begin(self, machine: Machine) -> None:
        """An episode begins on this machine; who may not know its numbers does not look at them."""

    def act(self, observation: NDArray[np.float64]) -> NDArray[np.float32]:
        """float32 [4], the action of AlongPath."""


@dataclass(frozen=True)
class Numbers:
    """How a path is led: feed, ramp and corners in mm and s, take-up of X and Y."""

    feed_mm_s: float
    ramp_mm_s2: float = math.inf
    corner_mm_s: float = math.inf
    take_up_x_mm: float = 0.0
    take_up_y_mm: float = 0.0


CONSTANT, PLAIN = Numbers(20.0), Numbers(40.0, 400.0, 4.0)
LOW, HIGH = Numbers(10.0, 100.0, 0.5, 0.0, 0.0), Numbers(40.0, 3000.0, 30.0, 0.03, 0.03)
"""Where CMA-ES looks."""


class Led:
    """Goes along the path by numbers, at corners and at the end no faster than they say."""

    def __init__(self, numbers: Numbers, own: Machine | bool = False) -> None:
        """own: the take-up is the closed form, of this machine's numbers (True: those of the machine at hand)."""
        self._numbers, self._own = numbers, own

    def begin(self, machine: Machine) -> None:
        self._take_up = np.array([self._numbers.take_up_x_mm, self._numbers.take_up_y_mm, 0.0])
        if self._own:
            self._take_up = take_up_mm(machine if self._own is True else self._own)
        self._along, self._signs = np.zeros(3), np.zeros(3)
        self._feed = min(self._numbers.corner_mm_s, self._numbers.feed_mm_s)

    def act(self, observation: NDArray[np.float64]) -> NDArray[np.float32]:
        numbers = self._numbers
        ahead = observation[18:33].reshape(5, 3) * np.array(PREVIEW_MM)[:, None]
        free_mm = self._free_mm(ahead)
        self._signs = np.where(np.abs(self._along) > 1e-3, np.sign(self._along), self._signs)
        if numbers.ramp_mm_s2 < math.inf:
            allowed = math.sqrt(numbers.corner_mm_s**2 + 2.0 * numbers.ramp_mm_s2 * free_mm)
            self._feed = min(numbers.feed_mm_s, allowed, self._feed + numbers.ramp_mm_s2 * STEP_S)
        offset = (self._take_up * self._signs / OFFSET_MM).clip(-1.0, 1.0)
        return np.array([2.0 * self._feed / FEED_MM_S - 1.0, *offset], dtype=np.float32)

    def _free_mm(self, ahead: NDArray[np.float64]) -> float:
        """How far the path goes straight on, as far as it is seen; takes over its direction."""
        for k, whole in enumerate(PREVIEW_MM):
            length = float(np.linalg.norm(ahead[k]))
            if length < (1.0 - 1e-3) * whole:
                on = float(ahead[k] @ self._along)
                aside = float(np.linalg.norm(ahead[k] - on * self._along))
                if aside < 1e-3 * whole or not self._along.any():  # the end
                    return max(on, 0.0)
                return max(0.0, (whole**2 - on**2 - aside**2) / (2.0 * (whole - on)))
            if k == 0:
                self._along = ahead[0] / length
        return PREVIEW_MM[-1]


def take_up_mm(machine: Machine) -> NDArray[np.float64]:
    """float64 [3], by what a counter leads the carriage on its way: half the backlash, and friction over stiffness, of
    the screw for that of the guides, of the motor for all."""
    found = []
    for axis in machine.axes:
        radius_m = axis.screw.travel_m_per_rad
        friction_nm = axis.screw.coulomb_nm + axis.guide_friction_n * radius_m / axis.screw.efficiency
        motor_nm_per_rad = axis.motor.pole_pairs * axis.motor.torque_constant_nm_per_a * axis.stage.current_a
        yields_m = axis.guide_friction_n / axis.screw.stiffness_n_per_m + friction_nm / motor_nm_per_rad * radius_m
        found.append(0.5 * axis.screw.backlash_mm + 1e3 * yields_m)
    return np.array(found)


def seen(observations: NDArray[np.float64]) -> NDArray[np.float64]:
    """float64 [..., 40]: observations [..., 35], and how far away the five points ahead are in a straight line, over
    their distances along the path: 1 where it goes straight on, less from a corner or the end on."""
    ahead = observations[..., 18:33].reshape(*observations.shape[:-1], len(PREVIEW_MM), 3)
    return np.concatenate([observations, np.linalg.norm(ahead, axis=-1)], axis=-1)


class Net:
    """A policy of stable-baselines3 without it: tanh layers from normalised observation to the mean of the action."""

    def __init__(self, layers: Sequence[Layer], mean: NDArray[np.float64], deviation: NDArray[np.float64]) -> None:
        """layers: weights [out, in] and biases [out]; mean, deviation [40]: of what was `seen` while it learned."""
        self.layers, self.mean, self.deviation = layers, mean, deviation

    def begin(self, machine: Machine) -> None:
        """It has nothing to remember."""

    def act(self, observation: NDArray[np.float64]) -> NDArray[np.float32]:
        value = ((seen(observation) - self.mean) / self.deviation).clip(-SEEN, SEEN)
        for weights, biases in self.layers[:-1]:
            value = np.tanh(weights @ value + biases)
        weights, biases = self.layers[-1]
        return (weights @ value + biases).clip(-1.0, 1.0).astype(np.float32)

    @classmethod
    def kept(cls, seed: int, file: Path = DATA) -> Net:
        """The policy that was learned with this seed."""
        with np.load(file) as data:
            count = sum(name.startswith(f"{seed}.weights") for name in data)
            layers = [(data[f"{seed}.weights{n}"], data[f"{seed}.biases{n}"]) for n in range(count)]
            return cls(layers, data[f"{seed}.mean"], data[f"{seed}.deviation"])


def make(path: str = "random", machines: Mapping[str, Any] = MACHINES) -> Any:
    """The environment."""
    track = gymnasium.make("isel_twin.envs:isel_twin/TrackPath-v0", path=path, step_s=STEP_S)
    return AlongPath(Randomised(track, **machines), FEED_MM_S, OFFSET_MM)


def judge(policy: Policy, env: Any, seeds: Sequence[int] = JUDGED_ON) -> dict[str, float]:
    """What a policy does on these paths and machines, the same ones for every policy."""
    ended: list[str] = []
    rewards, speeds, squares = [], [], []
    for seed in seeds:
        observation, info = env.reset(seed=seed)
        track = env.unwrapped
        assert isinstance(track, TrackPath)
        policy.begin(varied(track.machine, info["randomised"]))
        total, over = 0.0, False
        while not over:
            observation, reward, terminated, truncated, info = env.step(policy.act(observation))
            total, over = total + reward, terminated or truncated
            squares.append((1e3 * info["deviation_mm"]) ** 2)
        rewards.append(total)
        speeds.append(info["way_mm"] / info["time_s"])
        ended.append(info["ended"])
    return {
        "reward mm": float(np.mean(rewards)),
        "done": ended.count("done"),
        "mm/s": float(np.mean(speeds)),
        "rms um": float(np.sqrt(np.mean(squares))),
    }


def search(generations: int, seed: int = 1) -> Numbers:
    """The numbers that CMA-ES finds by the reward of the training machines."""
    try:
        import cma
    except ImportError:
        raise SystemExit("cma is not here: pip install 'isel-twin[learn]'") from None
    env, low, high = make(), np.array(astuple(LOW)), np.array(astuple(HIGH))
    start = (np.array(astuple(PLAIN)) - low) / (high - low)
    options = {"bounds": [0.0, 1.0], "seed": seed, "maxiter": generations, "popsize": 8, "verbose": -9}
    strategy = cma.CMAEvolutionStrategy(start.clip(0.05, 0.95), 0.2, options)
    best, most = PLAIN, judge(Led(PLAIN), env, TRAINED_ON)["reward mm"]
    while not strategy.stop():
        asked = strategy.ask()
        tried = [Numbers(*(low + np.asarray(x) * (high - low)).round(6).tolist()) for x in asked]
        gained = [judge(Led(numbers), env, TRAINED_ON)["reward mm"] for numbers in tried]
        strategy.tell(asked, [-gain for gain in gained])
        if max(gained) > most:
            most, best = max(gained), tried[int(np.argmax(gained))]
    return best


def learn(steps: int, seed: int) -> tuple[Net, list[tuple[int, float, float]]]:
    """Learn for so many steps; the policy, and its curve: steps, reward in mm and seconds of the last 500 episodes."""
    try:
        import torch
        from stable_baselines3 import PPO
        from stable_baselines3.common.callbacks import BaseCallback
        from stable_baselines3.common.vec_env import VecMonitor, VecNormalize
    except ImportError:
        raise SystemExit("stable-baselines3 is not here: pip install 'isel-twin[learn]'") from None
    torch.set_num_threads(1)
    curve: list[tuple[int, float, float]] = []

    class Curve(BaseCallback):
        def _on_step(self) -> bool:
            return True

        def _on_rollout_end(self) -> None:
            last = list(self.model.ep_info_buffer or ())
            if last:
                reward, length = (float(np.mean([episode[of] for episode in last])) for of in "rl")
                curve.append((self.num_timesteps, round(reward, 2), round(STEP_S * length, 3)))

    vector: Any = VecNormalize(VecMonitor(side_by_side(ENVIRONMENTS)), gamma=GAMMA, clip_obs=SEEN, clip_reward=np.inf)
    model: Any = PPO(
        "MlpPolicy",
        vector,
        n_steps=128,
        batch_size=2048,
        n_epochs=6,
        gamma=GAMMA,
        learning_rate=lambda left: 7e-4 * left,
        policy_kwargs={"log_std_init": -2.5, "net_arch": [64, 64]},
        stats_window_size=500,
        seed=seed,
    )
    model.learn(total_timesteps=steps, callback=Curve())
    linear = [*(layer for layer in model.policy.mlp_extractor.policy_net if hasattr(layer, "weight"))]
    layers = [
        tuple(part.detach().numpy() for part in (of.weight, of.bias)) for of in [*linear, model.policy.action_net]
    ]
    statistics = vector.obs_rms
    return Net(layers, statistics.mean, np.sqrt(statistics.var + vector.epsilon)), curve


def side_by_side(count: int) -> Any:
    """The environments of `make`, so many in one compiled call, as stable-baselines3 takes them."""
    from stable_baselines3.common.vec_env import VecEnv

    along = {"feed_mm_s": FEED_MM_S, "offset_mm": OFFSET_MM}
    track = {"path": "random", "step_s": STEP_S, "deviation_weight": DEVIATION_WEIGHT}
    envs = TrackVector(count, 1, MACHINES, along, "SameStep", **track)

    class Beside(VecEnv):
        def reset(self) -> Any:
            observations, _ = envs.reset(seed=self._seeds[0])
            self._reset_seeds()
            return seen(observations)

        def step_async(self, actions: Any) -> None:
            self._asked = actions

        def step_wait(self) -> Any:
            observations, rewards, terminated, truncated, infos = envs.step(self._asked)
            said: list[dict[str, Any]] = [{} for _ in range(count)]
            for k in np.flatnonzero(terminated | truncated):
                said[k] = {
                    "terminal_observation": seen(infos["final_obs"][k]),
                    "TimeLimit.truncated": bool(truncated[k]),
                }
            return seen(observations), rewards, terminated | truncated, said

        def close(self) -> None:
            envs.close()

        def get_attr(self, attr_name: str, indices: Any = None) -> list[Any]:
            return [getattr(env, attr_name) for env in envs.envs]

        def set_attr(self, attr_name: str, value: Any, indices: Any = None) -> None:
            raise NotImplementedError("the environments are as they were made")

        def env_method(self, method_name: str, *args: Any, indices: Any = None, **kwargs: Any) -> list[Any]:
            return [getattr(env, method_name)(*args, **kwargs) for env in envs.envs]

        def env_is_wrapped(self, wrapper_class: Any, indices: Any = None) -> list[bool]:
            return [False] * count

    return Beside(count, gymnasium.spaces.Box(-1.0, 1.0, (SIZE + len(PREVIEW_MM),)), envs.single_action_space)


def keep(nets: Mapping[int, Net], curves: Mapping[int, Sequence[tuple[int, float, float]]], file: Path) -> None:
    """Write policies to `file`, curves beside it."""
    parts = {
        f"{seed}.{kind}{n}": layer[of].astype(np.float32)
        for seed, net in nets.items()
        for n, layer in enumerate(net.layers)
        for of, kind in enumerate(("weights", "biases"))
    }
    for seed, net in nets.items():
        parts |= {f"{seed}.mean": net.mean.astype(np.float32), f"{seed}.deviation": net.deviation.astype(np.float32)}
    np.savez_compressed(file, **parts)  # type: ignore[arg-type]
    with file.with_suffix(".csv").open("w", newline="", encoding="utf-8") as out:
        write = csv.writer(out, lineterminator="\n")
        write.writerow(["seed", "steps", "reward_mm", "episode_s"])
        write.writerows((seed, *row) for seed, rows in curves.items() for row in rows)


FOUND = Numbers(39.919367, 1315.018379, 17.137498, 0.005948, 0.005599)
"""What `search(14)` has found."""


def everybody() -> dict[str, Policy]:
    """All that are compared."""
    nominal = load_machine("4030")
    nets: dict[str, Policy] = {}
    if DATA.exists():
        with np.load(DATA) as data:
            seeds = sorted({int(name.partition(".")[0]) for name in data})
        nets = {f"PPO, seed {seed}": Net.kept(seed) for seed in seeds}
    return {
        "constant 20 mm/s": Led(CONSTANT),
        "constant 22.4 mm/s, the mean of PPO": Led(Numbers(22.4)),
        "constant 30 mm/s": Led(Numbers(30.0)),
        "plain ramps": Led(PLAIN),
        "and take-up by formula, numbers of the file": Led(PLAIN, nominal),
        "and take-up by formula, the machine's own": Led(PLAIN, True),
        "CMA-ES": Led(FOUND),
        "CMA-ES, take-up by formula, the machine's own": Led(FOUND, True),
        **nets,
    }


def draw(file: Path, picture: str) -> None:
    """The curves beside `file`: reward over steps, a line for each seed."""
    from matplotlib.figure import Figure

    with file.with_suffix(".csv").open(encoding="utf-8") as lines:
        rows = list(csv.DictReader(lines))
    figure = Figure(figsize=(7.0, 3.5), layout="constrained")
    axes = figure.subplots()
    for seed in sorted({row["seed"] for row in rows}, key=int):
        curve = [(1e-6 * int(row["steps"]), float(row["reward_mm"])) for row in rows if row["seed"] == seed]
        axes.plot(*zip(*curve, strict=True), label=f"seed {seed}", linewidth=1.0)
    axes.set(xlabel="million steps", ylabel="training reward, 500 episodes, mm", ylim=(0.0, None))
    axes.legend()
    figure.savefig(picture, dpi=120)


def main(arguments: Sequence[str] | None = None) -> None:
    """Learn, search, draw or judge, and print."""
    parser = argparse.ArgumentParser(description="PPO on TrackPath-v0")
    parser.add_argument("--judge", action="store_true", help="judge what is kept; nothing is learned")
    parser.add_argument("--search", type=int, default=0, help="generations of CMA-ES; nothing else is done")
    parser.add_argument("--picture", default="", help="a PNG file to draw the kept curves into; nothing else is done")
    parser.add_argument("--steps", type=int, default=STEPS)
    parser.add_argument("--seeds", type=int, nargs="+", default=[0, 1, 2, 3, 4])
    parser.add_argument("--file", type=Path, default=DATA)
    given = parser.parse_args(arguments)
    if given.search:
        print(search(given.search))
    elif given.picture:
        draw(given.file, given.picture)
    elif given.judge:
        for name, (path, machines) in HELD_OUT.items():
            print(f"\n{name}, {len(JUDGED_ON)} episodes")
            compare(make(path, machines))
    else:
        nets, curves = {}, {}
        for seed in given.seeds:
            nets[seed], curves[seed] = learn(given.steps, seed)
            keep(nets, curves, given.file)


def compare(env: Any) -> None:
    """Judge everybody in this environment and print it; of PPO also mean and standard deviation over its seeds."""
    learned = []
    for who, policy in everybody().items():
        found = judge(policy, env)
        print(f"  {who:48}", ", ".join(f"{figure} {value:.4g}" for figure, value in found.items()))
        if isinstance(policy, Net):
            learned.append(found)
    if len(learned) > 1:
        over = {figure: [found[figure] for found in learned] for figure in learned[0]}
        spread = (f"{figure} {np.mean(of):.4g} +- {np.std(of, ddof=1):.2g}" for figure, of in over.items())
        print(f"  {'PPO, mean and standard deviation over seeds':48}", ", ".join(spread))


if __name__ == "__main__":
    main()
