"""CMA-ES learns how to lead a tool round a square: less deviation than a plain ramp, in no more time.

    python docs/examples/track_cma.py [--generations 25] [--picture track_cma.png]          pip install isel-twin[learn]

The plain way is what a controller does: each side of the square is a move with its own ramp. The learned way has the
same ramps, whose numbers are free, and three things more that a controller could do without any sensor:

    corners      the feed with which a side begins and ends
    shaping      targets are the mean of the last tau: what the ramp's corners make swing is smoothed away
    take-up      whenever an axis reverses, its counter goes a way c further: backlash, friction and load angle

    cost = rms deviation of the tool from the path in um, mean over some machines
           + 1000 a second that it takes longer than the plain way + 1000 for an episode that is broken off

Learned on machines drawn at random (payload, friction, stiffness, backlash), judged on others of the same kind.
"""

from __future__ import annotations

import argparse
import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import gymnasium
import numpy as np
from numpy.typing import NDArray

from isel_twin.envs.paths import lay_path
from isel_twin.envs.track import TrackPath
from isel_twin.envs.wrappers import Randomised

PATH = "square"
MACHINES = {"payload_kg": (0.0, 8.0), "friction": (0.8, 1.25), "stiffness": (0.7, 1.0), "backlash": (0.8, 1.25)}
LEARNED_ON, JUDGED_ON = range(8), range(100, 110)
"""Seeds."""


@dataclass(frozen=True)
class Way:
    """How a path is led: feed, ramp and corners in mm and s, shaping, take-up of X and Y."""

    feed_mm_s: float = 40.0
    ramp_mm_s2: float = 400.0
    corner_mm_s: float = 1.0
    shaping_s: float = 0.0
    take_up_x_mm: float = 0.0
    take_up_y_mm: float = 0.0


PLAIN = Way()
LOW = Way(20.0, 200.0, 0.2, 0.0, 0.0, 0.0)
HIGH = Way(50.0, 3000.0, 8.0, 0.04, 0.03, 0.03)
"""Where the learner looks."""


def targets(way: Way, points: NDArray[np.float64], step_s: float) -> NDArray[np.float64]:
    """float64 [n, 3], where the counters are to be at the end of each step, mm."""
    made = [points[0]]
    for start, end in itertools.pairwise(points):
        length = float(np.linalg.norm(end - start))
        made.extend(start + s / length * (end - start) for s in ramp(way, length, step_s))
    places = np.array(made)
    width = max(1, round(way.shaping_s / step_s))
    reach = np.concatenate([places, np.repeat(places[-1:], width, axis=0)])
    sums = np.cumsum(np.concatenate([np.repeat(reach[:1], width, axis=0), reach]), axis=0)
    shaped: NDArray[np.float64] = (sums[width:] - sums[:-width]) / width
    for axis, take_up_mm in enumerate((way.take_up_x_mm, way.take_up_y_mm)):
        signs = np.sign(np.diff(shaped[:, axis], prepend=shaped[0, axis]).round(9))
        last = np.maximum.accumulate(np.where(signs != 0.0, np.arange(len(signs)), 0))
        shaped[:, axis] += take_up_mm * signs[last]
    return shaped[1:]


def ramp(way: Way, length_mm: float, step_s: float) -> NDArray[np.float64]:
    """float64 [k], the way at the end of each step of a straight move: a trapezoid of speed from corner to corner."""
    low, a = way.corner_mm_s, way.ramp_mm_s2
    top = max(low, min(way.feed_mm_s, math.sqrt(low * low + a * length_mm)))
    rise_s, rise_mm = (top - low) / a, (top * top - low * low) / (2.0 * a)
    whole_s = 2.0 * rise_s + (length_mm - 2.0 * rise_mm) / top
    t = np.append(np.arange(step_s, whole_s, step_s), whole_s)
    up, down = np.minimum(t, rise_s), np.maximum(t - (whole_s - rise_s), 0.0)
    made: NDArray[np.float64] = low * up + 0.5 * a * up**2 + top * (t - up) - 0.5 * a * down**2
    return np.minimum(made, length_mm)


def lead(env: Any, way: Way, seed: int) -> tuple[NDArray[np.float64], float, str]:
    """Deviation at each step in um [n], time in s, and how the episode ended."""
    env.reset(seed=seed)
    track = env.unwrapped
    assert isinstance(track, TrackPath)
    plan = targets(way, lay_path(PATH, np.random.default_rng(0)), track.step_s)
    deviations = []
    for target in [*plan, *[plan[-1]] * 50]:
        speed_mm_s = (target - track.counter_mm) / track.step_s
        *_, terminated, truncated, info = env.step((speed_mm_s / track.highest_mm_s).astype(np.float32))
        deviations.append(1e3 * info["deviation_mm"])
        if terminated or truncated:
            break
    return np.array(deviations), info["time_s"], info.get("ended", "never arrived")


def cost(env: Any, way: Way, seeds: Sequence[int], limit_s: float) -> float:
    """See above."""
    total = 0.0
    for seed in seeds:
        deviations, time_s, ended = lead(env, way, seed)
        late_s = max(0.0, time_s - limit_s)
        total += math.sqrt(np.mean(deviations**2)) + 1000.0 * late_s + (1000.0 if ended != "done" else 0.0)
    return total / len(seeds)


def learn(env: Any, generations: int, population: int = 8, seed: int = 1) -> Way:
    """The best way that CMA-ES finds, from the plain one on."""
    try:
        import cma
    except ImportError:
        raise SystemExit("cma is not here: pip install 'isel-twin[learn]'") from None
    low, high = (np.array(list(vars(way).values())) for way in (LOW, HIGH))
    start = (np.array(list(vars(PLAIN).values())) - low) / (high - low)
    limit_s = max(lead(env, PLAIN, seed)[1] for seed in LEARNED_ON)
    options = {"bounds": [0.0, 1.0], "popsize": population, "seed": seed, "maxiter": generations, "verbose": -9}
    search = cma.CMAEvolutionStrategy(start.clip(0.05, 0.95), 0.2, options)
    best, least = PLAIN, cost(env, PLAIN, LEARNED_ON, limit_s)
    while not search.stop():
        asked = search.ask()
        ways = [Way(*(low + np.asarray(x) * (high - low)).round(6).tolist()) for x in asked]
        costs = [cost(env, way, LEARNED_ON, limit_s) for way in ways]
        search.tell(asked, costs)
        if min(costs) < least:
            least, best = min(costs), ways[int(np.argmin(costs))]
    return best


def judge(env: Any, way: Way, seeds: Sequence[int] = JUDGED_ON) -> dict[str, Any]:
    """What a way does on machines that nobody has learned on."""
    runs = [lead(env, way, seed) for seed in seeds]
    return {
        "rms um": float(np.mean([math.sqrt(np.mean(deviations**2)) for deviations, _, _ in runs])),
        "largest um": float(max(deviations.max() for deviations, _, _ in runs)),
        "time s": float(max(time_s for _, time_s, _ in runs)),
        "done": sum(ended == "done" for _, _, ended in runs),
    }


def make() -> Any:
    """The environment: another machine in every episode, decided by its seed."""
    return Randomised(gymnasium.make("isel_twin.envs:isel_twin/TrackPath-v0", path=PATH, reference_mm=0.0), **MACHINES)


def main(arguments: Sequence[str] | None = None) -> dict[str, dict[str, Any]]:
    """Learn, judge, print and draw; return what the plain and the learned way do."""
    parser = argparse.ArgumentParser(description="CMA-ES on TrackPath-v0")
    parser.add_argument("--generations", type=int, default=25)
    parser.add_argument("--picture", default="", help="a PNG file to draw into")
    given = parser.parse_args(arguments)
    env = make()
    learned = learn(env, given.generations)
    found = {name: judge(env, way) for name, way in (("plain", PLAIN), ("learned", learned))}
    print(learned)
    for name, figures in found.items():
        print(f"{name:8}", ", ".join(f"{figure} {value:.4g}" for figure, value in figures.items()))
    if given.picture:
        draw(env, learned, given.picture)
    return found


def draw(env: Any, learned: Way, file: str) -> None:
    """Deviation over time of both ways on one machine."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(7.0, 3.0), layout="constrained")
    axes = figure.subplots()
    for way, label in ((PLAIN, "plain ramps"), (learned, "learned")):
        deviations, _, _ = lead(env, way, JUDGED_ON[0])
        axes.plot(np.arange(1, len(deviations) + 1) * env.unwrapped.step_s, deviations, label=label, linewidth=1.0)
    axes.set(xlabel="time, s", ylabel="tool off the path, um", ylim=(0.0, None))
    axes.legend()
    figure.savefig(file, dpi=120)


if __name__ == "__main__":
    main()
