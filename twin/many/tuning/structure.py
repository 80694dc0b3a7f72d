"""What to try next where all moves share their settings: the time is known, only the edge is not.

The time of a move of N steps with top speed V, acceleration a and start-stop frequency f is a closed form,

    d = (V^2 - f^2) / 2a       t = 2 (V - f)/a + (N - 2d)/V        if N >= 2d, else 2 (sqrt(f^2 + a N) - f)/a

and N follows from one trial. Where a trial tells no times of single moves, as they are stored first or belong to a
program, what all of them take is a sum of the first of these, t0 + S/V + n (V - f)^2 / aV, and t0, S and n follow from
some trials. What holds is known only where it has been tried, but it has a shape:

    a  |  . . x x x      faster in any of the three, from something that lost steps: loses as well
       |  o . . x x      slower in all three than something that held: holds as well, and takes longer
       |  o o o * x      between: the margins of the moves that held say how far it is, each by itself, by
       +------------ V       torque   1 - m = (c + b a (1 + (f/f_b)^2)) / T(V)      T: closed form of the weakest axis
                             speed    1 - m = s V / V_lim                         s: Problem.speed_share

Moves whose speed is their own, such as arcs, say nothing of that: what they need of torque no setting changes.

A trial is the place, on a grid of all three, where (time that would be saved) times (chance that it keeps the wanted
margin) is greatest; each further one of a batch is chosen as if those before had come out as is likely (many/11). Where
no margin is asked for, lost steps alone decide, of which margins tell nothing: outcomes.py has that chance (many/20).
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.drives.curves import pull_out_prediction
from isel_twin.drives.motor import Motor
from isel_twin.drives.stage import Stage
from isel_twin.machine import Axis
from isel_twin.many.tuning.judge import LEAST
from isel_twin.many.tuning.outcomes import Thresholds
from isel_twin.many.tuning.result import Tried
from isel_twin.many.tuning.space import SETTINGS, Problem, fails_from_hz

SPEEDS = 64  # of a table of torques
POINTS = {"speed_hz": 41, "acceleration_hz_per_ms": 121, "start_stop_hz": 9}  # of the grid
POINTS_OF_OUTCOMES = {**POINTS, "start_stop_hz": 33}  # where no margin says how far a start is from failing
UNSURE = 0.06  # standard deviation of a margin of torque that the model says
SHARES = (0.3, 0.5, 0.2)  # of the time of a job: that which no setting changes, ways, ramps
STORED = 0.01  # of the mean time of lines with moves: where most take less, they only store them
SURPLUS = 0.09  # margin beyond the wanted one at which every third trial aims
WORTH = 2e-4  # least chance of saving, over the time of the job, for which a trial is made
APART = (0.03, 0.12, 0.8)  # logarithm of a setting over another's in the same batch
PART = 4  # where outcomes decide, so much of a batch goes before the next ones are chosen
CAREFUL = (1.05, 1.25, 1.25)  # how much more of each setting every third trial then wants to hold
FAR = 0.03  # logarithm of a setting over the best one's, below which nothing is gained by halving
BETWEEN = 3  # most trials of halving in a batch
MISSED = 0.03  # of the margin, that less speed can mend
SLOWER = 2  # most trials of a batch that mend others
HEDGES = (0.25, 0.5, 1.0, 2.0)  # on the torque for acceleration while only one acceleration is known
APART_PULLS = 1.25  # ratio of two accelerations that tell torque for acceleration from the rest
START_HZ = 2000.0  # start-stop frequency at which a start needs twice the torque, before anything is known of it

Grid = NDArray[np.float64]  # [..., 3]: speed_hz, acceleration_hz_per_ms, start_stop_hz


def move_time_s(steps: Any, speed_hz: Any, acceleration_hz_per_ms: Any, start_stop_hz: Any) -> Any:
    """Time of a move by its ramps (broadcast)."""
    a = 1e3 * np.asarray(acceleration_hz_per_ms, dtype=np.float64)
    low = np.minimum(start_stop_hz, speed_hz)
    ways = (np.square(speed_hz, dtype=np.float64) - np.square(low, dtype=np.float64)) / (2.0 * a)
    full = 2.0 * (speed_hz - low) / a + (steps - 2.0 * ways) / speed_hz
    short = 2.0 * (np.sqrt(np.square(low, dtype=np.float64) + a * steps) - low) / a
    return np.where(steps >= 2.0 * ways, full, short)


def steps_of(time_s: float, speed_hz: float, acceleration_hz_per_ms: float, start_stop_hz: float) -> float:
    """Steps of a move that takes so long: the inverse, by halving."""
    low, high = 0.0, time_s * max(speed_hz, start_stop_hz)
    for _ in range(60):
        middle = 0.5 * (low + high)
        if move_time_s(middle, speed_hz, acceleration_hz_per_ms, start_stop_hz) < time_s:
            low = middle
        else:
            high = middle
    return high


class Structure:
    """The times and the torque of a problem; `chosen` picks trials."""

    def __init__(self, problem: Problem) -> None:
        self.problem = problem
        (group,) = problem.groups
        self._names = {one.setting: one for one in group.parameters}
        self._axis, self._limit_hz = self._weakest()

    def _weakest(self) -> tuple[Axis | None, float]:
        """The axis that fails first, and from which speed on. None for a servo drive, whose margin is that of its
        following error: no share is taken of it."""
        axes = enumerate(self.problem.call.fitted().axes)
        limit_hz, _, axis = min((fails_from_hz(axis), number, axis) for number, axis in axes)
        return (None, limit_hz * self.problem.speed_share) if axis.closed_loop else (axis, limit_hz)

    def _torque(self, speeds_hz: NDArray[np.float64]) -> NDArray[np.float64]:
        """Torque of that axis at each speed, over that at rest."""
        axis = self._axis
        if axis is None:
            return np.ones(speeds_hz.shape)
        motor, stage = axis.motor, axis.stage
        assert isinstance(motor, Motor)
        assert isinstance(stage, Stage)
        table_hz = np.linspace(0.0, float(speeds_hz.max()), SPEEDS)
        torque = [pull_out_prediction(motor, stage, hz * 60.0 / axis.steps_per_rev) for hz in table_hz]
        return np.interp(speeds_hz, table_hz, np.array(torque) / torque[0])

    def place(self, values: Mapping[str, int]) -> NDArray[np.float64]:
        """The point of these values of the parameters."""
        settings = next(iter(self.problem.settings(values).values()))
        return np.array([float(getattr(settings, setting)) for setting in SETTINGS])

    def _grid(self, speeds_hz: Sequence[float] = (), points: Mapping[str, int] = POINTS) -> Grid:
        """All places, and those with further speeds."""
        fixed = self.place(self.problem.nearest())
        axes = []
        for value, setting in zip(fixed, SETTINGS, strict=True):
            one = self._names.get(setting)
            if one is None:
                places = np.array([value])
            elif one.log:
                places = np.geomspace(one.low, one.high, points[setting])
            else:
                more = [min(max(speed, one.low), one.high) for speed in speeds_hz if math.isfinite(speed)]
                places = np.concatenate([np.linspace(one.low, one.high, points[setting]), more])
            axes.append(np.unique(np.floor(places)))
        return np.stack(np.meshgrid(*axes, indexing="ij"), axis=-1)

    def chosen(self, tried: Sequence[Tried], least: float, many: int) -> list[dict[str, int]]:
        """The next trials; fewer if nothing faster can hold any more. Every third wants a little more margin, as the
        fastest may not hold on machines that no trial has seen."""
        good = [each for each in tried if each.judgement.good]
        if not good:
            return []
        if self._axis is not None and least < LEAST:
            return self._by_outcomes(tried, max(1, many // PART))
        points = np.array([self.place(each.values) for each in tried])
        margins = np.array([each.judgement.margin if each.judgement.good else 0.0 for each in tried])
        torques, speeds = np.array([self._kept(each) for each in tried]).T
        limit_hz = 0.999 * self._shown_limit_hz(points, speeds)  # speeds are whole numbers, margins just kept
        fastest_hz = {
            wanted: (1.0 - wanted) / self.problem.speed_share * limit_hz for wanted in (least, least + SURPLUS)
        }
        grid = self._grid([*fastest_hz.values()])
        time_s, (c, b), known = self._times(grid, good), *self._fitted(points, torques, limit_hz)
        torque = self._torque(grid[:, 0, 0, 0])[:, None, None]
        best = {wanted: _best(good, wanted) for wanted in fastest_hz}
        taken = np.zeros(time_s.shape, dtype=np.bool_)
        found: list[dict[str, int]] = []
        for number in range(many):
            wanted = least + SURPLUS * (number % 3 == 2)
            hedge = 1.0 if known else HEDGES[number % len(HEDGES)]
            by_torque = 1.0 - (c + hedge * b * _pull(grid)) / torque
            chance = 0.5 * (1.0 + _erf((by_torque - wanted) / (UNSURE * math.sqrt(2.0))))
            chance[grid[..., 0] > fastest_hz[wanted]] = 0.0
            keeps = (margins > 0.0) & (margins >= wanted)
            for point in points[~keeps]:
                chance[np.all(grid >= point, axis=-1)] = 0.0
            for point in points[keeps]:
                chance[np.all(grid <= point, axis=-1)] = 0.0
            bound_s = min(best[wanted], float(time_s.max()))
            worth = np.where(taken, 0.0, np.maximum(bound_s - time_s, 0.0) * chance)
            at = np.unravel_index(int(worth.argmax()), worth.shape)
            if worth[at] <= WORTH * bound_s:
                continue
            found.append(self._values(grid[at]))
            if chance[at] > 0.5:
                best[wanted] = min(best[wanted], float(time_s[at]))
            taken |= (np.abs(np.log(grid / grid[at])) / APART).max(axis=-1) < 1.0
        been = [each.values for each in tried]
        again = [each for each in self._slower(good, least) if each not in been][:SLOWER]
        halfway = [each for each in self._between(tried, least) if each not in (*been, *again, *found)]
        if not found:
            return [*again, *halfway[:BETWEEN]]
        return [*again, *found][: many - len(halfway[:1])] + halfway[:1]

    def _by_outcomes(self, tried: Sequence[Tried], many: int) -> list[dict[str, int]]:
        """The next trials where nothing but lost steps decides, which no margin foretells. Every third wants that more
        than itself holds: CAREFUL times as much of everything."""
        good = [each for each in tried if each.judgement.good]
        assert self._axis is not None
        thresholds, grid = Thresholds.of(self._axis, self._limit_hz), self._grid(points=POINTS_OF_OUTCOMES)
        time_s, places = self._times(grid, good, tried), self._over_torque(grid)
        points = self._over_torque(np.array([self.place(each.values) for each in tried]))
        times_s = np.array([each.judgement.time_s for each in tried])
        holds = np.array([each.judgement.good for each in tried])
        speeds = np.array([self._kept(each)[1] for each in tried])
        within = grid[..., 0] <= 0.999 * self._shown_limit_hz(points, speeds) / self.problem.speed_share
        been, found = [each.values for each in tried], list[dict[str, int]]()
        for number in range(len(tried), len(tried) + many):
            more = np.array(CAREFUL if number % 3 == 2 else (1.0, 1.0, 1.0))
            chances, chance = (thresholds.chance(at * more, points[holds], points[~holds]) for at in (points, places))
            chance = np.where(within, chance, 0.0)  # the edge that is asked for
            best_s = times_s[holds & ((chances > 0.5) | bool(np.all(more == 1.0)))].min(initial=times_s[holds].max())
            worth = np.maximum(best_s - time_s, 0.0) * chance
            at = np.unravel_index(int(worth.argmax()), worth.shape)
            while worth[at] > 0.0 and self._values(grid[at]) in (*been, *found):
                worth[at] = 0.0
                at = np.unravel_index(int(worth.argmax()), worth.shape)
            if worth[at] > WORTH * best_s:
                found.append(self._values(grid[at]))
                points, times_s = np.concatenate([points, places[at][None]]), np.append(times_s, time_s[at])
                holds = np.append(holds, chance[at] > 0.5)
        return found

    def _over_torque(self, points: Grid) -> Grid:
        """Places with their acceleration over the torque at their speed."""
        made = points.copy()
        made[..., 1] /= np.maximum(self._torque(points[..., 0].ravel()).reshape(points.shape[:-1]), 0.01)
        return made

    def _slower(self, good: Sequence[Tried], least: float) -> list[dict[str, int]]:
        """Those that missed the margin by little, with as much less speed, the fastest first. The speed of zero growth
        is one number for all ramps only to 1 %: a rotor overshoots at the end of a ramp, by more or less."""
        missed = [each for each in good if least - MISSED < each.judgement.margin < least]
        if not missed:
            return []
        points = np.array([self.place(each.values) for each in missed])
        points[:, 0] *= [0.999 * (1.0 - least) / (1.0 - each.judgement.margin) for each in missed]
        times_s = self._times(np.floor(points), good)
        values = [self._values(points[at]) for at in np.argsort(times_s) if times_s[at] < _best(good, least)]
        return [each for n, each in enumerate(values) if each not in values[:n]]

    def _between(self, tried: Sequence[Tried], least: float) -> list[dict[str, int]]:
        """Where the model is wrong: halfway from the best to what lost, while that is far. One of each batch."""
        keeping = [each for each in tried if each.judgement.good and each.judgement.margin >= least]
        if not keeping:
            return []
        best = self.place(min(keeping, key=lambda each: each.judgement.time_s).values)
        lost = [self.place(each.values) for each in tried if each.judgement.margin < least or not each.judgement.good]
        halfway = [np.sqrt(best * np.maximum(point, best)) for point in lost]
        far = [point for point in halfway if np.log(point / best).max() > FAR]
        values = [self._values(np.floor(point)) for point in sorted(far, key=lambda point: point[0])]
        return [each for n, each in enumerate(values) if each not in values[:n]]

    def _values(self, point: NDArray[np.float64]) -> dict[str, int]:
        values = dict(zip(SETTINGS, point.tolist(), strict=True))
        return {one.name: one.nearest(round(values[setting])) for setting, one in self._names.items()}

    def _times(self, grid: Grid, good: Sequence[Tried], tried: Sequence[Tried] = ()) -> NDArray[np.float64]:
        """Time of the job at each place of a grid. tried: others, which tell of it as well if they came to its end:
        a controller takes as long whether its motors follow or not."""
        problem, known = self.problem, good[0]
        if self._at_once(known):
            whole = len(known.judgement.moves)
            ended = [each for each in tried if not each.judgement.good and len(each.judgement.moves) == whole]
            return self._times_at_once(grid, [*good, *ended])
        settings = problem.settings(known.values)
        total = np.full(grid.shape[:-1], known.judgement.time_s)
        for move, made in zip(problem.moves, known.judgement.moves, strict=True):
            if not move.speeds_hz:  # an arc: its speed is its own
                continue
            used = settings[move.line]
            rapid = max(move.speeds_hz) >= problem.rapid_from_hz
            speed_hz = float(used.speed_hz if rapid else max(move.speeds_hz))
            steps = steps_of(made.time_s, speed_hz, used.acceleration_hz_per_ms, used.start_stop_hz)
            speeds = grid[..., 0] if rapid else speed_hz
            total += move_time_s(steps, speeds, grid[..., 1], grid[..., 2]) - made.time_s
        return total

    def _at_once(self, one: Tried) -> bool:
        """True if its moves were not made line by line: they belong to a program, or were stored before."""
        times_s = [made.time_s for made in one.judgement.moves]
        return self.problem.is_program or bool(np.median(times_s) < STORED * np.mean(times_s))

    def _times_at_once(self, grid: Grid, good: Sequence[Tried]) -> NDArray[np.float64]:
        """The same by t0, S and n, for which SHARES of the first trial's time stand while nothing else is known."""
        points = np.array([self.place(each.values) for each in good])
        times_s = np.array([each.judgement.time_s for each in good])
        scale = _terms(points[0]) / (times_s[0] * np.array(SHARES))
        weight = 0.05  # of what was thought before
        a = np.concatenate([_terms(points) / scale / times_s[:, None], weight * np.eye(len(SHARES))])
        y = np.concatenate([np.ones(len(points)), np.full(len(SHARES), weight)])
        found: NDArray[np.float64] = _terms(grid) / scale @ np.maximum(np.linalg.lstsq(a, y, rcond=None)[0], 0.0)
        return found

    def _kept(self, one: Tried) -> tuple[float, float]:
        """The least margins of torque and of speed in the moves of a trial that its settings are for; 0 if it lost, and
        LEAST tells nothing: in half steps motors are at their limits for instants, whatever the settings."""
        made = one.judgement
        if not made.good:
            return 0.0, 0.0
        if self._axis is None:
            return made.margin, made.margin
        if self._at_once(one):
            return made.torque, made.speed
        moves = [each for each, move in zip(made.moves, self.problem.moves, strict=True) if move.speeds_hz]
        return min(each.torque for each in moves), min(each.speed for each in moves)

    def _shown_limit_hz(self, points: NDArray[np.float64], speeds: NDArray[np.float64]) -> float:
        """The speed of zero growth of the weakest machine, as every trial shows it. A servo drive lags by its ramps,
        too, and on short ways by less, so that each shows a lower bound; 0.85 of the closed form is another."""
        moved = (speeds > LEAST) & (speeds < 1.0)
        bounds_hz = points[moved, 0] * self.problem.speed_share / (1.0 - speeds[moved])
        if self._axis is not None and len(bounds_hz):
            return min(self._limit_hz, float(np.median(bounds_hz)))
        if self._axis is not None:
            return self._limit_hz
        return float(bounds_hz.max(initial=0.85 * self._limit_hz))

    def _fitted(
        self, points: NDArray[np.float64], torques: NDArray[np.float64], limit_hz: float
    ) -> tuple[tuple[float, float], bool]:
        """c and b of the torque that is used, and whether trials have told them apart."""
        good = torques > 0.0
        needs = np.stack([np.ones(len(points)), _pull(points)], axis=-1) / self._torque(points[:, 0])[:, None]
        told = torques > LEAST
        if self._axis is None:
            told = good & (1.0 - torques > 1.02 * self.problem.speed_share * points[:, 0] / limit_hz)
        c, b = _fit(needs[told], 1.0 - torques[told])
        pulls = _pull(points[told])
        apart = len(pulls) > 0 and bool(pulls.max() > APART_PULLS * pulls.min())
        if self._axis is not None:
            return (c, b), apart
        # what was limited by speed says that no more torque was used
        most = float(np.min((1.0 - torques[good]) / (needs[good] @ (c, b)), initial=1.0))
        return (c * most, b * most), apart


def _terms(points: Grid) -> NDArray[np.float64]:
    """What t0, S and n are multiplied by."""
    speed, low = points[..., 0], np.minimum(points[..., 2], points[..., 0])
    return np.stack([np.ones(speed.shape), 1.0 / speed, np.square(speed - low) / (1e3 * points[..., 1] * speed)], -1)


_erf = np.vectorize(math.erf, otypes=[float])


def _best(good: Sequence[Tried], wanted: float) -> float:
    return min((one.judgement.time_s for one in good if one.judgement.margin >= wanted), default=math.inf)


def _pull(points: Grid) -> NDArray[np.float64]:
    """Acceleration, with the surplus that a start at the start-stop frequency needs."""
    pull: NDArray[np.float64] = points[..., 1] * (1.0 + (points[..., 2] / START_HZ) ** 2)
    return pull


def _fit(needs: NDArray[np.float64], shares: NDArray[np.float64]) -> tuple[float, float]:
    """c, b >= 0 with needs @ (c, b) = shares; before anything is known a tenth of the torque, and 1500 Hz/ms for the
    rest."""
    prior = np.array([0.1, 0.9 / 1500.0])
    scale = prior[None, :]
    weight = 0.1  # of what was thought before
    a = np.concatenate([needs * scale, weight * np.eye(2)])
    y = np.concatenate([shares, np.full(2, weight)])
    found = np.linalg.lstsq(a, y, rcond=None)[0]
    c, b = (np.maximum(found, 0.02) * prior).tolist()
    return c, b
