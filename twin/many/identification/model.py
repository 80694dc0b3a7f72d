"""Predictions of several sessions by a candidate machine, their residuals, and how these change.

    r(u) = (measured - predicted(u)) / sigma          less the weighted mean within a group that shares a zero
           of a bound, a speed that held or lost:     r^2 = -2 ln P(that outcome | predicted(u)), the normal P
    J    = dr/du                                      by finite differences of large steps

**Steps of the differences.** On a small scale the model is not smooth: counters are whole steps of 3 um, the backlash
is a dead zone, dry friction lets a carriage rest anywhere in 1 to 3 um, stall occurs in bands of speed. A step of 1e-8
would measure these corners, and 2 % still their scatter, which exceeds the effect of any parameter. So the step is
always STEP of the prior's standard deviation, some 30 % of an estimate, and differences are central, free of the
curvature (many/9).
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import NDArray

from isel_twin.machine import Machine
from isel_twin.many.identification.replays import Replays
from isel_twin.many.identification.session import MISSED, Datum, Session
from isel_twin.many.identification.unknowns import Unknown

STEP = 0.8  # step of the differences, in standard deviations of the prior
LEAST_STEP = 0.25 * STEP  # near the end of what is allowed
WIDE = 2.0 * STEP  # of a number that is moved alone, to see what it would explain
CLIFF = 5.0  # largest ratio of the differences of a step up and a step down; beyond it one of them is no slope
CHANCE = 4.0  # standard deviations by which the sum of squares of differences must exceed the scatter to count
BOUND = 3.0  # limit of the search, in standard deviations of the prior
NOT_IDENTIFIED = 0.9  # standard deviation over that of the prior from which a parameter is not identified
WEAK = 0.5  # the same from which it is known only roughly
HALF = 2.0 * math.log(2.0)  # r^2 of a bound that is what is predicted

Floats = NDArray[np.float64]


def searched(item: Unknown) -> tuple[float, float]:
    """Ends of the search for a number, in standard deviations of the prior."""
    least, most = item.ends
    return max(-BOUND, least), min(BOUND, most)


def _steps(item: Unknown, u: float, central: bool) -> tuple[float, ...]:
    """Steps of the differences from u: up and down, or one of them. Less than STEP where the range of the number ends;
    none that way where it ends at once."""
    least, most = item.ends
    up, down = min(STEP, most - u), max(-STEP, least - u)
    if not central or -down < LEAST_STEP:
        return (up,) if up >= LEAST_STEP else (down,)
    return (up, down) if up >= LEAST_STEP else (down,)


class Model:
    """Predictions of all sessions on candidate machines, cached."""

    def __init__(
        self,
        machine: Machine,
        unknowns: Sequence[Unknown],
        sessions: Sequence[Session],
        replays: Replays | None = None,
    ) -> None:
        """replays: who makes them; None: this process."""
        self.machine = machine
        self.unknowns = tuple(unknowns)
        self.sessions = tuple(sessions)
        self.data: tuple[Datum, ...] = tuple(item for session in sessions for item in session.data)
        self.replays = replays or Replays()
        self._known: dict[tuple[float, ...], Floats] = {}
        self._value = np.array([item.value for item in self.data])
        self._sigma = np.array([item.sigma for item in self.data])
        self._scatter = np.array([item.scatter for item in self.data])
        self._kinds = self._alike(lambda item: True)
        self._batches = self._alike(lambda item: item.scatter > 0.0)
        self._groups = self._alike(lambda item: bool(item.group))
        self._side = np.array([item.side for item in self.data])

    def _alike(self, counts: Callable[[Datum], bool]) -> list[NDArray[np.int64]]:
        """Indices of the selected data, by group or, without one, by kind."""
        found: dict[str, list[int]] = {}
        for index, item in enumerate(self.data):
            if counts(item):
                found.setdefault(item.group or item.kind, []).append(index)
        return [np.array(indices) for indices in found.values()]

    def wider(self, more: Sequence[Unknown]) -> Model:
        """The same data, with more parameters behind the others."""
        return Model(self.machine, [*self.unknowns, *more], self.sessions, self.replays)

    @property
    def axes(self) -> list[str]:
        """Those that something was measured of."""
        return list(dict.fromkeys(axis for session in self.sessions for axis in session.measured.axes))

    def values(self, u: Floats) -> list[float]:
        return [item.value(float(one)) for item, one in zip(self.unknowns, u, strict=True)]

    def predictions(self, points: Sequence[Floats]) -> list[Floats]:
        """float64 [data] for each of several u."""
        keys = [tuple(np.round(point, 12).tolist()) for point in points]
        new = list(dict.fromkeys(key for key in keys if key not in self._known))
        told = self._made([(self.unknowns, self.values(np.array(key))) for key in new])
        self._known |= dict(zip(new, told, strict=True))
        return [self._known[key] for key in keys]

    def apart(self, u: Floats, more: Sequence[tuple[Unknown, float]]) -> list[Floats]:
        """Residuals [data] at u with one number more each, so many deviations from its prior."""
        points = [((*self.unknowns, item), [*self.values(u), item.value(by)]) for item, by in more]
        return [self.residuals(one) for one in self._made(points)]

    def _made(self, points: Sequence[tuple[tuple[Unknown, ...], list[float]]]) -> list[Floats]:
        """Predictions of all sessions with each of these numbers."""
        pieces = self.replays.make([(session, self.machine, *point) for point in points for session in self.sessions])
        count = len(self.sessions)
        return [np.concatenate([np.zeros(0), *pieces[at * count : (at + 1) * count]]) for at in range(len(points))]

    def between(self, wanted: Floats, predicted: Floats) -> Floats:
        """r [data] of other data in the place of those measured, bounds left out."""
        found = self.residuals(self._value - wanted + predicted)
        found[self._side != 0] = 0.0
        return found

    def residuals(self, predicted: Floats) -> Floats:
        """r [data], without the zeros of gauges (many/10)."""
        found = self.deviations(predicted)
        bounds = self._side != 0
        if bounds.any():
            from scipy.special import log_ndtr

            side = self._side[bounds]
            found[bounds] = side * np.sqrt(-2.0 * log_ndtr(-side * found[bounds]))
        return np.clip(found, -MISSED, MISSED)

    def deviations(self, predicted: Floats) -> Floats:
        """(measured - predicted) / sigma [data] without the zeros of gauges: r, but of bounds."""
        difference = self._value - predicted
        weight = 1.0 / self._sigma**2
        for indices in self._groups:
            own = indices[np.isfinite(difference[indices])]
            if len(own):
                difference[own] -= np.average(difference[own], weights=weight[own])
        return np.clip(np.where(np.isfinite(difference), difference / self._sigma, MISSED), -MISSED, MISSED)

    def slope(self, deviations: Floats) -> Floats:
        """dr [data] by these deviations: 1, but of bounds, where the normal density over P goes with it."""
        found, bounds = np.ones(len(deviations)), self._side != 0
        if bounds.any():
            from scipy.special import log_ndtr

            at = -self._side[bounds] * deviations[bounds]
            likely = log_ndtr(at)
            density = np.exp(-0.5 * at**2 - likely) / math.sqrt(2.0 * math.pi)
            found[bounds] = density / np.sqrt(np.maximum(-2.0 * likely, 1e-12))
        return found

    def zeros(self) -> Floats:
        """dr [data, groups] by the unknown zero of each group, per its unit."""
        found = np.zeros((len(self.data), len(self._groups)))
        for column, indices in enumerate(self._groups):
            found[indices, column] = 1.0 / self._sigma[indices]
        return found

    def freedom(self, residuals: Floats, parameters: int) -> int:
        """Data less zeros less parameters, at least 1, and the bounds that are missed."""
        values = int((self._side == 0).sum()) - len(self._groups) - parameters
        return max(1, values) + int(self.missed(residuals).sum())

    def missed(self, residuals: Floats) -> NDArray[np.bool_]:
        """[data], True for a bound on whose other side the prediction is."""
        return np.asarray((self._side != 0) & (residuals**2 > HALF))

    def each_square(self, residuals: Floats) -> Floats:
        """[data]; a bound adds what it costs beyond a prediction that is the bound."""
        squares = np.clip(residuals, -50.0, 50.0) ** 2
        squares[self._side != 0] = np.maximum(0.0, squares[self._side != 0] - HALF)
        return squares

    def squares(self, residuals: Floats) -> float:
        """Their sum."""
        return float(self.each_square(residuals).sum())

    def residuals_at(self, u: Floats) -> Floats:
        return self.residuals(self.predictions([u])[0])

    def jacobian(self, u: Floats, *, central: bool = True) -> Floats:
        """dr/du [data, n] by differences of STEP; not central: upwards only, for a first look at half the cost."""
        return self._differences(self.residuals, u, central)

    def by_chance(self, u: Floats) -> Floats:
        """dr/du [data, m] that the Jacobian leaves out, as it is within the scatter of the model, of the m parameters
        that have any. No replay more than the Jacobian."""
        here, found = self._moved(self.residuals, u, True)
        left = []
        for each in found:
            (up, ahead), (down, back) = each if len(each) > 1 else (*each, (0.0, here))
            left.append(((ahead - back) - self.told(ahead - back)) / (up - down))
        some = [one for one in left if one.any()]
        return np.array(some).reshape(len(some), len(self.data)).T

    def trend(self, u: Floats) -> Floats:
        """d(deviations)/du [data, n] by central differences of STEP."""
        return self._differences(self.deviations, u, True)

    def _differences(self, of: Callable[[Floats], Floats], u: Floats, central: bool) -> Floats:
        here, found = self._moved(of, u, central)
        columns = []
        for each in found:
            slopes = [(there - here) * (STEP / by) for by, there in each]
            columns.append((self._between(*slopes) if len(slopes) > 1 else self.told(*slopes)) / STEP)
        return np.array(columns).T.reshape(len(self.data), len(u))

    def _moved(
        self, of: Callable[[Floats], Floats], u: Floats, central: bool
    ) -> tuple[Floats, list[list[tuple[float, Floats]]]]:
        """Value at u, and by parameter the steps from there with the value after each."""
        steps = [_steps(item, at, central) for item, at in zip(self.unknowns, u.tolist(), strict=True)]
        points = [u + by * way for each, way in zip(steps, np.eye(len(u)), strict=True) for by in each]
        here, *told = [of(one) for one in self.predictions([u, *points])]
        after = iter(told)
        return here, [[(by, next(after)) for by in each] for each in steps]

    def _between(self, ahead: Floats, back: Floats) -> Floats:
        """The mean of the differences [data] of two steps. In a batch where they differ much (CLIFF) one candidate has
        lost steps and the other has not: then the smaller one."""
        mean = self.told(ahead + back) / 2.0
        for indices in self._kinds:
            one, two = float(np.linalg.norm(ahead[indices])), float(np.linalg.norm(back[indices]))
            if max(one, two) > CLIFF * max(min(one, two), 1.0):
                mean[indices] = self.told(ahead if one < two else back)[indices]
        return mean

    def told(self, difference: Floats) -> Floats:
        """Differences [data] of two residuals, 0 in a batch in which they are within the scatter of the model."""
        told = difference.copy()
        for indices in self._batches:
            by_chance = 2.0 * float(((self._scatter[indices] / self._sigma[indices]) ** 2).sum())
            if float((told[indices] ** 2).sum()) <= by_chance * (1.0 + CHANCE * math.sqrt(2.0 / len(indices))):
                told[indices] = 0.0
        return told
