"""Least squares over several sessions: identifiability, estimates, and prediction of held-back data.

    cost = |r(u)|^2 + |u|^2                           u: standard deviations from the prior (unknowns.py)
    J    = dr/du                                      residuals r and their differences: model.py

**Before the fit**: the singular values of J at the prior. A direction of u with singular value s has 1/sqrt(1 + s^2) of
its prior standard deviation afterwards; for s < 1 the data say less than the prior. So the rank is the number of s >=
1, and a parameter counts as not identified if its interval stays wider than NOT_IDENTIFIED of the prior's.

The noise of gauges and clocks is estimated from repeats first (noise.py).

**Beside** what was asked for, numbers that were left alone and that the data see are fitted within what is known of
them (laws.py). They are parameters of u like the others, behind them, and a datum each: u^2 counts in chi^2.

**After it**: cov = (J'J / s + 1)^-1 with s = max(1, chi^2 of the datum's kind): a bad fit claims no precision, and no
fit is less sure than the prior. Differences within the scatter of the model, which J leaves out, may be effects all the
same: they stand in J as those of further numbers of that prior, so they tell nothing and confound (many/24). 95 %
intervals are in u, so never negative for a positive value, and as wide as the profile of the likelihood wants them
(profile.py). A chi^2 beyond its quantile, of all data or of one kind (chi_square.py), says that the model does not
explain the data: then no number is `measured`, whatever its interval, and the data that misfit most are named
(many/15). Laws that predict better than what the file says, by data held back from both, are named, and what laws that
no datum excludes leave open is in the intervals (laws.py). Numbers behind a common factor that no datum moves, or that
the data do not tell apart, are found as well (reach.py).

**Grades.** `measured` is a number only if nothing here speaks against it, and if it is of a family whose intervals hold
what they say on machines that differ from the model (PROVEN, many/30). All else is `fitted`.

**The search** asks for a Jacobian by differences at its start only, as each costs 2 n replays; on its way it is
corrected by the steps taken. Where the search ends another one starts, until one ends near its start. If MOST_SEARCHES
are made and the last one has still lowered the cost by SETTLED or more, the result says so.

**Held back**: the root mean square of r over recordings that are not fitted, before (at the prior) and after. If it
grows, the result is refused.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from isel_twin.base.crew import Crew
from isel_twin.machine import Machine
from isel_twin.machine.spread import NORMAL_95
from isel_twin.many.identification.chi_square import FITS, ChiSquare, chi_squares
from isel_twin.many.identification.chi_square import scale as scale_of
from isel_twin.many.identification.laws import LAWS, Law, beside, compete, rivals
from isel_twin.many.identification.model import BOUND, NOT_IDENTIFIED, WEAK, Floats, Model, searched
from isel_twin.many.identification.noise import Noise, student, with_noise
from isel_twin.many.identification.profile import profile
from isel_twin.many.identification.reach import Alike, OutOfReach, behind_factors
from isel_twin.many.identification.recovery import family, unrecovered
from isel_twin.many.identification.replays import Replays
from isel_twin.many.identification.session import Datum, Session, model_twin
from isel_twin.many.identification.unknowns import Unknown, candidate

MISFIT, MOST_MISFITS = 2.0, 5  # residual from which a datum is named, and how many are
TOLD = 0.3  # a parameter with at least this part of a direction is named in it
ENOUGH = 0.01  # relative change of cost and point at which the search ends: below the scatter of the model
MOST_CALLS = 12  # evaluations in the search, each a replay of what is fitted
NEAR = 0.25  # way of a search, in standard deviations of the prior, over which a Jacobian stays that of its start
MOST_SEARCHES = 3
SETTLED = 1.0  # of the cost, which the scatter of the model moves by one or two: less is no gain
WIDER = 1.5  # times as wide an interval by what was fitted beside, from which it is said
OPEN = 1.5  # times as wide an interval by laws that the data do not exclude, from which it is no measured one
# families of which a study of machines unlike the model has shown that 90 % intervals hold 85 to 95 % (many/30)
PROVEN = frozenset({"backlash", "stiffness"})
ELSEWHERE = {  # what would measure some of the others
    "friction": "the force that moves the axis with its motor off, by a spring scale",
    "supply": "a voltmeter at the stages",
    "mass": "scales",
}
BLAMED = 0.3  # correlation from which what was fitted beside is named for that


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
        if self.value in (self.unknown.least, self.unknown.most):
            return "at the end of what a machine file allows"
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
    chi2_limit: float = math.inf  # quantile FITS of chi2
    misfits: tuple[tuple[Datum, float], ...] = ()  # fitted data of the largest residuals beyond MISFIT, and these
    unreached: tuple[OutOfReach, ...] = ()
    alike: tuple[Alike, ...] = ()
    laws: tuple[Law, ...] = ()  # the likeliest first
    noise: tuple[Noise, ...] = ()
    beside: tuple[Estimate, ...] = ()  # numbers that were not asked for and that the data see
    shared: Floats = field(default_factory=lambda: np.zeros((0, 0)))  # [n, beside], correlation
    widened: tuple[float, ...] = ()  # by parameter: what these make of the interval, at least 1
    unrecovered: tuple[str, ...] = ()  # families that the fit does not find back
    unsettled: float = 0.0  # of the cost, that the last search has gained, if none ended near its start
    kinds: tuple[ChiSquare, ...] = ()

    @property
    def explains(self) -> bool:
        """False if the data, or those of one kind, differ from the fitted model by more than their noise."""
        return self.chi2 <= self.chi2_limit and all(one.fits for one in self.kinds)

    @property
    def open(self) -> tuple[float, ...]:
        """By parameter: what laws that the data do not exclude make of its interval, at least 1."""
        return _open(self.laws, len(self.estimates))

    def measured(self, one: Estimate) -> bool:
        """True if nothing speaks against this number, once held-back data are predicted better."""
        if one not in self.estimates or one.remaining >= WEAK or not self.explains or self.suspects:
            return False
        name, alike = family(one.unknown.name), {each.unknown for each in self.alike}
        if name not in PROVEN or name in self.unrecovered or one.unknown.name in alike:
            return False
        return self.open[self.estimates.index(one)] < OPEN

    @property
    def doubts(self) -> tuple[str, ...]:
        """What must be said of this result, a line each."""
        lines = [*(one.line for one in self.unreached), *(one.line for one in self.alike)]
        lines += [
            f"{name}: put elsewhere by a standard deviation, the fit does not find it back; so it is no measured one"
            for name in self.unrecovered
        ]
        if self.unsettled >= SETTLED:
            lines.append(
                f"the search had not ended: the last of {MOST_SEARCHES} still lowered chi-square by "
                f"{self.unsettled:.1f}, so the best numbers may lie elsewhere; begin nearer to them (--set), or fit "
                "fewer (--fit)"
            )
        lines += [self._wider(at) for at, times in enumerate(self.widened) if times >= WIDER]
        lines += [self._left_open(at) for at, times in enumerate(self.open) if times >= OPEN]
        names = {one.unknown.name: family(one.unknown.name) for one in self.estimates if one.remaining < WEAK}
        if unproven := {name: of for name, of in names.items() if of not in PROVEN}:
            tell = "; ".join(f"{ELSEWHERE[of]} ({name})" for name, of in unproven.items() if of in ELSEWHERE)
            lines.append(
                f"{', '.join(unproven)}: fitted, not measured: not shown to hold on machines unlike the model"
                + (f"; what would tell: {tell}" if tell else "")
            )
        would = [f"{one.key} ({one.law}, {self._said(one)})" for one in self.suspects]
        apart = "; these data do not tell them apart" if len(would) > 1 else "; fit it, too"
        if not self.explains:
            worst = "; ".join(f"{item.recording} {item.label} ({r:+.1f})" for item, r in self.misfits)
            whole = [ChiSquare("", self.chi2, self.chi2_limit, 0.0)]
            beyond = "; ".join(one.line for one in (*whole, *self.kinds) if not one.fits)
            lines.append(
                f"the model does not explain these data: {beyond}; no number is measured by this. Largest residuals: "
                f"{worst}"
            )
            lines.append(
                f"what would explain it: {' or '.join(would)}{apart}"
                if would
                else "no law known here would explain it; look at these readings first"
            )
        elif would:
            lines.append(f"what was held back from it speaks for another law: {' or '.join(would)}{apart}")
        return tuple(lines)

    @property
    def suspects(self) -> tuple[Law, ...]:
        """Laws that predict better what is held back than the file does, and alike."""
        return rivals(self.laws, self.explains)

    def _said(self, one: Law) -> str:
        return f"{one.share:.0%} of the excess" if not self.explains else f"e^{one.gained:.0f} times as likely"

    def _left_open(self, at: int) -> str:
        """A parameter whose interval is wider by laws that the data do not exclude, the one that does most, and what
        would tell."""
        most = max(self.laws, key=lambda one: one.widens[at])
        return (
            f"{self.estimates[at].unknown.name}: its interval is {self.open[at]:.1f} times as wide, as these data do "
            f"not exclude {most.law} ({most.key}); what would tell: {most.tells}"
        )

    def _wider(self, at: int) -> str:
        """A parameter whose interval is wider by what was fitted beside, and the two numbers that did most."""
        shared, items = np.abs(self.shared[at]), [one.unknown for one in self.beside]
        named = " and ".join(_in_words(items[index]) for index in np.argsort(-shared)[:2] if shared[index] >= BLAMED)
        wide = f"{self.estimates[at].unknown.name}: its interval is {self.widened[at]:.1f} times as wide"
        return f"{wide}, as other numbers are known only roughly: {named}"

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
    journal: Path | None = None,
    gate: bool = False,
) -> Fit:
    """Fit and validate. told: called with the identifiability before the fit. progress: with the number of replays.
    journal: of replays, to go on from. gate: try whether each family is found back (recovery.py). Raises ImportError
    without SciPy, OSError and ValueError for the journal.
    """
    from scipy.stats import chi2 as chi2_of

    known, noise = zip(*(with_noise(session) for session in (*fitted, *held)), strict=True)
    fitted, held = known[: len(fitted)], known[len(fitted) :]
    model, asked = Model(machine, unknowns, fitted, Replays(crew, progress, journal)), len(unknowns)
    model = model.wider(beside(model))
    zero = np.zeros(len(model.unknowns))
    model_twin(candidate(machine, model.unknowns, model.values(zero)), known[0].controller)  # refuse it now
    expected = prospect(unknowns, model.jacobian(zero)[:, :asked])
    if told is not None:
        told(expected)
    u, at, unsettled = _searched(model)
    last, chance = model.jacobian(at), model.by_chance(at)
    after = model.residuals_at(u)
    freedom = model.freedom(after, asked)
    chi2 = (model.squares(after) + float(u[asked:] @ u[asked:])) / freedom
    limit = float(chi2_of.ppf(FITS, freedom)) / freedom
    kinds = chi_squares(model, asked, u, last)
    scale = scale_of(model, kinds)
    unreached, alike = behind_factors(model, u, last, scale)
    explains = chi2 <= limit and all(one.fits for one in kinds)
    laws = compete(model, asked, u, last, chance, scale, explains)
    covariance, alone = _covariance(last, chance, scale), _covariance(last[:, :asked], chance, scale)
    ends = NORMAL_95 * np.outer(np.sqrt(np.diag(covariance)), np.ones(2))
    ends[:asked] = profile(model, asked, u, last, chance, covariance, scale)
    narrow = np.sqrt(np.diag(covariance)[:asked] / np.diag(alone))
    wider = np.ones(len(u))
    few = student(one for each in noise[: len(fitted)] for one in each)
    wider[:asked] = np.minimum(few * np.array(_open(laws, asked)), 1.0 / np.sqrt(np.diag(covariance)[:asked]))
    covariance, ends = covariance * np.outer(wider, wider), ends * wider[:, None]
    deviation = np.sqrt(np.diag(covariance))
    estimates = tuple(
        Estimate(item, item.value(at), item.value(at - down), item.value(at + up), float(own))
        for item, at, (down, up), own in zip(model.unknowns, u.tolist(), ends.tolist(), deviation, strict=True)
    )
    correlation = covariance / np.outer(deviation, deviation)
    lost = unrecovered(model, u, last, deviation[:asked]) if gate else ()
    other = Model(machine, model.unknowns, held, model.replays)
    before_held, after_held = (other.residuals(one) for one in other.predictions([zero, u]))
    return Fit(
        estimates=estimates[:asked],
        correlation=correlation[:asked, :asked],
        covariance=covariance[:asked, :asked],
        u=u[:asked],
        chi2=chi2,
        prospect=expected,
        before=by_kind(other.data, before_held),
        after=by_kind(other.data, after_held),
        fitted_before=by_kind(model.data, model.residuals_at(zero)),
        fitted_after=by_kind(model.data, after),
        held=tuple(
            (item, item.value - item.sigma * one, item.value - item.sigma * two)
            for item, one, two in zip(other.data, before_held.tolist(), after_held.tolist(), strict=True)
        ),
        replays=model.replays.count,
        chi2_limit=limit,
        misfits=_misfits(model.data, after),
        unreached=unreached,
        alike=alike,
        laws=laws,
        noise=tuple(one for each in noise for one in each),
        beside=estimates[asked:],
        shared=correlation[:asked, asked:],
        widened=tuple(narrow.tolist()),
        unrecovered=lost,
        unsettled=unsettled,
        kinds=kinds,
    )


def _in_words(item: Unknown) -> str:
    """A number that is fitted beside: its name and what it stands for."""
    return item.name if item.factor else f"{item.name} ({LAWS[item.keys[0].split('.', 2)[2]]})"


def _searched(model: Model) -> tuple[Floats, Floats, float]:
    """The u of the least cost, where the Jacobian is, there or near, and `unsettled`."""
    from scipy.optimize import least_squares

    u, gained = np.zeros(len(model.unknowns)), 0.0
    for _ in range(MOST_SEARCHES):
        secants = _Secants(model, u)
        solved = least_squares(
            lambda u: np.concatenate((model.residuals_at(u), u)),
            u,
            jac=secants,
            bounds=tuple(zip(*(searched(item) for item in model.unknowns), strict=True)),
            ftol=ENOUGH,
            xtol=ENOUGH,
            max_nfev=MOST_CALLS,
        )
        start, u = u, np.round(solved.x, 12)  # as predictions are known by
        if float(np.abs(u - start).max(initial=0.0)) < NEAR:
            return u, start, 0.0
        gained = _cost(model, start) - _cost(model, u)
    return u, u, gained


def _cost(model: Model, u: Floats) -> float:
    return float((model.residuals_at(u) ** 2).sum() + u @ u)


def _covariance(jacobian: Floats, chance: Floats, scale: Floats) -> Floats:
    """[n, n] with J [data, n], effects of further numbers [data, m] and s [data]."""
    design = np.column_stack([jacobian, chance]) / np.sqrt(scale)[:, None]
    count = jacobian.shape[1]
    return np.asarray(np.linalg.inv(design.T @ design + np.eye(design.shape[1]))[:count, :count], dtype=np.float64)


def _open(laws: Sequence[Law], count: int) -> tuple[float, ...]:
    return tuple(math.sqrt(1.0 + sum(one.widens[at] for one in laws if one.widens)) for at in range(count))


class _Secants:
    """A Jacobian for the search that costs no replay: that of the start, corrected by each step that was taken.

    Broyden (1965): J += (dz - J du) du' / |du|^2, so that J explains the last step exactly. z are the deviations, which
    go on evenly where the residual of a bound bends (model.py).
    """

    def __init__(self, model: Model, u: Floats) -> None:
        self._model, self._u, self._trend = model, u, model.trend(u)

    def _deviations(self, u: Floats) -> Floats:
        return self._model.deviations(self._model.predictions([u])[0])

    def __call__(self, u: Floats) -> Floats:
        du, now = u - self._u, self._deviations(u)
        if du.any():
            dz = now - self._deviations(self._u)
            self._trend = self._trend + np.outer(dz - self._trend @ du, du) / float(du @ du)
            self._u = u.copy()
        return np.concatenate((self._model.slope(now)[:, None] * self._trend, np.eye(len(u))))


def _misfits(data: Sequence[Datum], residuals: Floats) -> tuple[tuple[Datum, float], ...]:
    worst = np.argsort(-np.abs(residuals))[:MOST_MISFITS]
    return tuple((data[index], float(residuals[index])) for index in worst if abs(residuals[index]) > MISFIT)


def by_kind(data: Sequence[Datum], residuals: Floats) -> dict[str, float]:
    """Root mean square of r, by kind and of all."""
    if not len(data):
        return {}
    of = np.array([item.kind for item in data])
    found = {"all": math.sqrt(float(np.mean(residuals**2)))}
    kinds = dict.fromkeys(item.kind for item in data)
    return found | {kind: math.sqrt(float(np.mean(residuals[of == kind] ** 2))) for kind in kinds}
