"""Least squares over several sessions: identifiability, estimates, and prediction of held-back data.

    r(u) = (measured - predicted(u)) / sigma          less the weighted mean within a group that shares a zero
           of a bound, a speed that held or lost:     r^2 = -2 ln P(that outcome | predicted(u)), the normal P
    cost = |r(u)|^2 + |u|^2                           u: standard deviations from the prior (unknowns.py)
    J    = dr/du                                      by finite differences of large steps, below

**Before the fit**: the singular values of J at the prior. A direction of u with singular value s has 1/sqrt(1 + s^2) of
its prior standard deviation afterwards; for s < 1 the data say less than the prior. So the rank is the number of s >=
1, and a parameter counts as not identified if its interval stays wider than NOT_IDENTIFIED of the prior's.

**Steps of the differences.** On a small scale the model is not smooth: counters are whole steps of 3 um, the backlash
is a dead zone, dry friction lets a carriage rest anywhere in 1 to 3 um, stall occurs in bands of speed. A step of 1e-8
would measure these corners, and 2 % still their scatter, which exceeds the effect of any parameter. So the step is
always STEP of the prior's standard deviation, some 30 % of an estimate. The first and the last Jacobian use central
differences, free of the curvature; those between only give the direction of descent, and are one-sided (many/9).

**After it**: cov = (J'J + 1)^-1, times chi^2 per degree of freedom if that is above 1, so that a bad fit does not claim
precision; 95 % intervals are in u, so never negative for a positive value.

**Held back**: the root mean square of r over recordings that are not fitted, before (at the prior) and after. If it
grows, the result is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.crew import Crew, in_order
from isel_twin.machine import Machine
from isel_twin.many.identification.session import MISSED, Datum, Session, predict
from isel_twin.many.identification.unknowns import Unknown, candidate

STEP = 0.8  # step of the differences, in standard deviations of the prior
CLIFF = 5.0  # largest ratio of the differences of a step up and a step down; beyond it one of them is no slope
CHANCE = 4.0  # standard deviations by which the sum of squares of differences must exceed the scatter to count
BOUND = 3.0  # limit of the search, in standard deviations of the prior
NOT_IDENTIFIED = 0.9  # standard deviation over that of the prior from which a parameter is not identified,
WEAK = 0.5  # and from which it is known only roughly
NORMAL_95 = 1.96
TOLD = 0.3  # a parameter with at least this part of a direction is named in it
ENOUGH = 0.01  # relative change of cost and point at which the search ends: below the scatter of the model
HALF = 2.0 * math.log(2.0)  # r^2 of a bound that is what is predicted
MOST_CALLS = 8  # evaluations in the search, without those for Jacobians

Floats = NDArray[np.float64]


class Model:
    """Predictions of all sessions on candidate machines, cached."""

    def __init__(
        self,
        machine: Machine,
        unknowns: Sequence[Unknown],
        sessions: Sequence[Session],
        crew: Crew | None = None,
        progress: Callable[[int], None] | None = None,
    ) -> None:
        """crew: for the replays; None: this process. progress: called with the number of replays."""
        self.machine = machine
        self.unknowns = tuple(unknowns)
        self.sessions = tuple(sessions)
        self.data: tuple[Datum, ...] = tuple(item for session in sessions for item in session.data)
        self._crew = crew
        self._progress = progress
        self._known: dict[tuple[float, ...], Floats] = {}
        self.replays = 0
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

    def values(self, u: Floats) -> list[float]:
        return [item.value(float(one)) for item, one in zip(self.unknowns, u, strict=True)]

    def predictions(self, points: Sequence[Floats]) -> list[Floats]:
        """float64 [data] for each of several u."""
        keys = [tuple(np.round(point, 12).tolist()) for point in points]
        new = list(dict.fromkeys(key for key in keys if key not in self._known))
        calls = [
            (session, self.machine, self.unknowns, self.values(np.array(key)))
            for key in new
            for session in self.sessions
        ]
        pieces = []
        for piece in in_order(_predict, calls, self._crew):
            pieces.append(piece)
            self.replays += 1
            if self._progress is not None:
                self._progress(self.replays)
        count = len(self.sessions)
        for index, key in enumerate(new):
            self._known[key] = np.concatenate([np.zeros(0), *pieces[index * count : (index + 1) * count]])
        return [self._known[key] for key in keys]

    def residuals(self, predicted: Floats) -> Floats:
        """r [data], without the zeros of gauges (many/10)."""
        difference = self._value - predicted
        weight = 1.0 / self._sigma**2
        for indices in self._groups:
            own = indices[np.isfinite(difference[indices])]
            if len(own):
                difference[own] -= np.average(difference[own], weights=weight[own])
        found = np.where(np.isfinite(difference), difference / self._sigma, MISSED)
        bounds = self._side != 0
        if bounds.any():
            from scipy.special import log_ndtr

            side = self._side[bounds]
            found[bounds] = side * np.sqrt(-2.0 * log_ndtr(-side * found[bounds]))
        return np.clip(found, -MISSED, MISSED)

    def freedom(self, residuals: Floats) -> int:
        """Data less zeros less parameters, at least 1, and the bounds that are missed."""
        values = int((self._side == 0).sum()) - len(self._groups) - len(self.unknowns)
        return max(1, values) + int(((self._side != 0) & (residuals**2 > HALF)).sum())

    def chi2(self, residuals: Floats) -> float:
        """Per degree of freedom; a bound adds what it costs beyond a prediction that is the bound."""
        squares = np.clip(residuals, -50.0, 50.0) ** 2
        squares[self._side != 0] = np.maximum(0.0, squares[self._side != 0] - HALF)
        return float(squares.sum()) / self.freedom(residuals)

    def residuals_at(self, u: Floats) -> Floats:
        return self.residuals(self.predictions([u])[0])

    def jacobian(self, u: Floats, steps: Floats, central: bool) -> Floats:
        """dr/du [data, n] by differences of steps [n]."""
        points: list[Floats] = []
        for index, step in enumerate(steps):
            away = np.zeros(len(u))
            away[index] = step if u[index] + step <= BOUND else -step
            points += [u + away, u - away] if central else [u + away]
        here, *found = [self.residuals(one) for one in self.predictions([u, *points])]
        columns = []
        for index in range(len(u)):
            if central:
                way = points[2 * index][index] - u[index]
                columns.append(self._between(found[2 * index] - here, here - found[2 * index + 1]) / way)
            else:
                columns.append(self._told(found[index] - here) / (points[index][index] - u[index]))
        return np.array(columns).T.reshape(len(self.data), len(u))

    def _between(self, ahead: Floats, back: Floats) -> Floats:
        """The mean of the differences [data] of two steps. In a batch where they differ much (CLIFF) one candidate has
        lost steps and the other has not: then the smaller one."""
        mean = self._told(ahead + back) / 2.0
        for indices in self._kinds:
            one, two = float(np.linalg.norm(ahead[indices])), float(np.linalg.norm(back[indices]))
            if max(one, two) > CLIFF * max(min(one, two), 1.0):
                mean[indices] = self._told(ahead if one < two else back)[indices]
        return mean

    def _told(self, difference: Floats) -> Floats:
        """Differences [data] of two residuals, 0 in a batch in which they are within the scatter of the model."""
        told = difference.copy()
        for indices in self._batches:
            by_chance = 2.0 * float(((self._scatter[indices] / self._sigma[indices]) ** 2).sum())
            if float((told[indices] ** 2).sum()) <= by_chance * (1.0 + CHANCE * math.sqrt(2.0 / len(indices))):
                told[indices] = 0.0
        return told


def _predict(call: tuple[Session, Machine, tuple[Unknown, ...], list[float]]) -> Floats:
    """One session on one candidate, for worker processes."""
    session, machine, unknowns, values = call
    return predict(session, candidate(machine, unknowns, values))


@dataclass(frozen=True)
class Prospect:
    """Identifiability, known before the fit."""

    singular: tuple[float, ...]  # descending; standard deviations of the data per standard deviation of the prior
    remaining: tuple[float, ...]  # by parameter: expected standard deviation afterwards over that of the prior
    lines: tuple[str, ...]

    @property
    def rank(self) -> int:
        """Directions in which the data say more than the prior."""
        return sum(value >= 1.0 for value in self.singular)


def prospect(unknowns: Sequence[Unknown], jacobian: Floats) -> Prospect:
    """Identifiability with this Jacobian [data, n]."""
    count = len(unknowns)
    _, values, ways = np.linalg.svd(jacobian, full_matrices=True)
    singular = np.zeros(count)
    singular[: len(values)] = values
    remaining = np.sqrt(np.diag(np.linalg.inv(jacobian.T @ jacobian + np.eye(count))))
    lines = [
        f"rank {int((singular >= 1.0).sum())} of {count}; singular values {', '.join(f'{s:.3g}' for s in singular)}"
    ]
    for item, left in zip(unknowns, remaining, strict=True):
        if left >= NOT_IDENTIFIED:
            lines.append(f"{item.name}: cannot be identified from these data, its interval stays that of the prior")
        elif left >= WEAK:
            lines.append(f"{item.name}: only roughly, its interval shrinks to {left:.0%} of the prior's")
    for s, way in zip(singular, ways, strict=True):
        named = [(item.name, part) for item, part in zip(unknowns, way, strict=True) if abs(part) >= TOLD]
        if s < 1.0 and len(named) > 1:
            together = ", ".join(f"{part:+.2f} {name}" for name, part in named)
            lines.append(
                f"not to be told apart: {together} (together they change the data by {s:.2g} standard deviations)"
            )
    return Prospect(tuple(singular.tolist()), tuple(remaining.tolist()), tuple(lines))


@dataclass(frozen=True)
class Estimate:
    """One parameter after the fit."""

    unknown: Unknown
    value: float
    low: float
    high: float  # 95 % interval
    remaining: float  # standard deviation over that of the prior

    @property
    def identified(self) -> bool:
        """True if the data have narrowed it down."""
        return self.remaining < NOT_IDENTIFIED

    @property
    def note(self) -> str:
        """The reason for a wide interval, else ""."""
        if not self.identified:
            return "not identified: the data say no more than the prior"
        if self.remaining >= WEAK:
            return "only roughly"
        at_bound = abs(self.unknown.at(self.value)) >= BOUND - 0.01
        return "at the end of what was searched: widen its --prior" if at_bound else ""


@dataclass(frozen=True)
class Fit:
    estimates: tuple[Estimate, ...]
    correlation: Floats  # [n, n]
    covariance: Floats  # [n, n], of the u
    u: Floats
    chi2: float  # per degree of freedom, of the data fitted
    prospect: Prospect
    before: Mapping[str, float]  # held back: root mean square of r at the prior, by kind and in `all`; empty: nothing
    after: Mapping[str, float]
    fitted_before: Mapping[str, float]
    fitted_after: Mapping[str, float]
    held: tuple[tuple[Datum, float, float], ...]  # held back: prediction before and after, without zeros of gauges
    replays: int

    @property
    def worse(self) -> bool:
        """True if held-back data are predicted worse than by the prior."""
        return bool(self.before) and self.after["all"] > self.before["all"]

    @property
    def times(self) -> float:
        """Improvement factor of the prediction of held-back data; nan without any."""
        return self.before["all"] / self.after["all"] if self.before else math.nan


def fit(
    machine: Machine,
    unknowns: Sequence[Unknown],
    fitted: Sequence[Session],
    held: Sequence[Session],
    *,
    crew: Crew | None = None,
    told: Callable[[Prospect], None] | None = None,
    progress: Callable[[int], None] | None = None,
) -> Fit:
    """Fit and validate. told: called with the identifiability before the fit. Raises ImportError without SciPy."""
    from scipy.optimize import least_squares

    model = Model(machine, unknowns, fitted, crew, progress)
    count = len(unknowns)
    zero = np.zeros(count)
    steps = np.full(count, STEP)
    first = model.jacobian(zero, steps, central=True)
    expected = prospect(unknowns, first)
    if told is not None:
        told(expected)

    def residuals(u: Floats) -> Floats:
        return np.concatenate((model.residuals_at(u), u))

    def slope(u: Floats) -> Floats:
        jacobian = first if not u.any() else model.jacobian(u, steps, central=False)
        return np.concatenate((jacobian, np.eye(count)))

    solved = least_squares(
        residuals, zero, jac=slope, bounds=(-BOUND, BOUND), ftol=ENOUGH, xtol=ENOUGH, max_nfev=MOST_CALLS
    )
    u = np.asarray(solved.x, dtype=np.float64)
    last = model.jacobian(u, steps, central=True)
    after = model.residuals_at(u)
    chi2 = model.chi2(after)
    covariance: Floats = np.asarray(np.linalg.inv(last.T @ last + np.eye(count)) * max(1.0, chi2), dtype=np.float64)
    deviation = np.sqrt(np.diag(covariance))
    estimates = []
    for index, item in enumerate(unknowns):
        half = NORMAL_95 * deviation[index]
        low, high = item.value(u[index] - half), item.value(u[index] + half)
        estimates.append(Estimate(item, item.value(u[index]), low, high, float(deviation[index])))
    other = Model(machine, unknowns, held, crew, progress)
    before_held, after_held = (other.residuals(one) for one in other.predictions([zero, u]))
    return Fit(
        tuple(estimates),
        covariance / np.outer(deviation, deviation),
        covariance,
        u,
        chi2,
        expected,
        by_kind(other.data, before_held),
        by_kind(other.data, after_held),
        by_kind(model.data, model.residuals_at(zero)),
        by_kind(model.data, after),
        tuple(
            (item, item.value - item.sigma * one, item.value - item.sigma * two)
            for item, one, two in zip(other.data, before_held.tolist(), after_held.tolist(), strict=True)
        ),
        model.replays + other.replays,
    )


def by_kind(data: Sequence[Datum], residuals: Floats) -> dict[str, float]:
    """Root mean square of r, by kind and of all."""
    if not len(data):
        return {}
    of = np.array([item.kind for item in data])
    found = {"all": math.sqrt(float(np.mean(residuals**2)))}
    kinds = dict.fromkeys(item.kind for item in data)
    return found | {kind: math.sqrt(float(np.mean(residuals[of == kind] ** 2))) for kind in kinds}
