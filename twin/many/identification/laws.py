"""Laws that compete with the fitted ones: numbers that were left alone, freed one at a time, judged by held-back data.

Chi-square says that something is wrong, not what; and where all is well, several laws may say the same of these data
and differ in what they say of a parameter. So each number of LAWS that the fit has left alone is moved by WIDE of a
prior of half to twice at the result u of the cost |r|^2 + |u|^2:

    c = dr/dv               0 if within the scatter of the model; the other way as well if the law seems to help
    r + J du + c v          the data near u, with the law; without it v = 0

**Held back.** The runs (mountings of a gauge, stall series, durations) are dealt into FOLDS parts. Each part is
predicted by a fit, linear in du and v, to the others, with the uncertainty that it leaves, and

    gained = sum over the parts of  ln p(part | others, with the law) - ln p(part | others, without)

A law that only bends to the noise it has seen loses by that. One that has gained DECISIVE predicts better than what
was fitted, and so do those as good as it, within DECISIVE or a fifth of what the best has gained: these data do not
tell them apart. If the fit does not explain its data, a law must also take ENOUGH of the excess of chi-square away
(many/17).

**What they disagree.** With the law free within what is known of its number, the parameters would be elsewhere, by d;
what was fitted is one law among them, with d = 0. Weighed by what they gained, w ~ exp(gained), they add

    spread = sum w d d'

to the covariance of the fit (many/18). Numbers behind a fitted factor are no rivals of it: reach.py has them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import rows
from isel_twin.many.identification.model import STEP, Floats, Model
from isel_twin.many.identification.session import Datum
from isel_twin.many.identification.unknowns import Unknown, changes, unknown

LAWS = {  # numbers of an axis, and what each stands for
    "specimen.torque_constant": "another motor",
    "specimen.iron_loss": "the motor's iron loss",
    "specimen.rotor_inertia": "another rotor",
    "guide_friction": "dry friction of the guide",
    "shaft_coulomb": "dry friction of the screw",
    "shaft_viscous": "viscous friction",
    "stribeck_speed": "friction that falls with speed",
    "lead_error": "an error of the lead",
}
WIDE = 1.5 * STEP
FOLDS = 5
DECISIVE = 3.0  # in natural logarithms of the likelihood of what is held back: twenty times as likely
NEARLY = 0.8  # of what the best one has gained, from which on another is alike
ENOUGH = 0.5  # part of the excess of chi-square that a law must take away to explain data that the fit does not
ZERO_PRECISION = 1e-6  # of the zero of a gauge, 1/mm^2, and of the delay of a line, 1/s^2: next to nothing is known


@dataclass(frozen=True)
class Law:
    """A number that was not fitted, and what would be if it were."""

    key: str  # of the machine file
    law: str
    share: float  # of the excess of chi-square that it takes away, at most 1
    gained: float  # what held-back data say for it, in natural logarithms of their likelihood
    weight: float  # among all laws and what was fitted, with its number as far as it is known
    moved: tuple[float, ...]  # by which it moves what was fitted, in standard deviations of the priors


@dataclass(frozen=True)
class Competition:
    laws: tuple[Law, ...]  # the likeliest first
    spread: Floats  # [n, n], covariance of the u that their disagreement adds

    def rivals(self, explains: bool) -> tuple[Law, ...]:
        """Laws that predict what was held back better than what was fitted, and alike. explains: as of the fit."""
        able = [one for one in self.laws if one.gained >= DECISIVE and (explains or one.share >= ENOUGH)]
        least = min((one.gained - max(DECISIVE, (1.0 - NEARLY) * one.gained) for one in able[:1]), default=0.0)
        return tuple(one for one in able if one.gained >= least)


def compete(model: Model, u: Floats, jacobian: Floats) -> Competition:
    """All laws at u. jacobian: of what was fitted, there."""
    added = _candidates(model, u)
    count, behind = len(u), {key for item in model.unknowns if item.factor for key in item.keys}
    if not added or not model.data:
        return Competition((), np.zeros((count, count)))
    wider = model.wider([item for item, _, _ in added])
    base, here = np.concatenate((u, np.zeros(len(added)))), model.residuals_at(u)
    ways = WIDE * np.eye(len(base))[count:]
    back = [wider.residuals(one) for one in wider.predictions([base - way for way in ways])]
    trial = _Trial(model, u, jacobian, here)
    columns = [wider.told(here - one) / WIDE for one in back]
    helping = [index for index, column in enumerate(columns) if column.any() and trial.gained(column) > 0.0]
    for index, ahead in zip(helping, wider.predictions([base + ways[index] for index in helping]), strict=True):
        columns[index] = wider.told(wider.residuals(ahead) - back[index]) / (2.0 * WIDE)
    excess = float(here @ here) - model.freedom(here)
    found, weights, moves = [], [1.0], [np.zeros(count)]
    for (item, law, known), column in zip(added, columns, strict=True):
        gained = trial.gained(column) if column.any() else 0.0
        share = min(1.0, trial.saved(column) / excess) if excess > 0.0 else 0.0
        rival = item.keys[0] not in behind and column.any()
        weights.append(float(np.exp(np.clip(trial.gained(known * column), -50.0, 50.0))) if rival else 0.0)
        moves.append(trial.moved(known * column))
        found.append((item.keys[0], law, share, gained))
    part = np.array(weights) / sum(weights)
    spread: Floats = np.einsum("i,ij,ik->jk", part, np.array(moves), np.array(moves))
    laws = [
        Law(*told, float(one), tuple(move.tolist())) for told, one, move in zip(found, part[1:], moves[1:], strict=True)
    ]
    return Competition(tuple(sorted(laws, key=lambda one: -one.gained)), spread)


class _Trial:
    """The data near u as linear functions of the parameters, of the zeros of gauges and of one law more."""

    def __init__(self, model: Model, u: Floats, jacobian: Floats, residuals: Floats) -> None:
        zeros = model.zeros()
        self._design = np.column_stack([jacobian, zeros])
        self._precision = np.concatenate((np.ones(len(u)), np.full(zeros.shape[1], ZERO_PRECISION)))
        self._at = np.concatenate((u, np.zeros(zeros.shape[1])))
        self._count, self._residuals, self._part = len(u), residuals, folds(model.data)
        self._without = self._likelihood(np.zeros((len(residuals), 0)))

    def gained(self, column: Floats) -> float:
        """What the law of this column [data] gains in what is held back."""
        return self._likelihood(column[:, None]) - self._without

    def saved(self, column: Floats) -> float:
        """By which the least cost near u is less if it is fitted, too."""
        return self._least(np.zeros((len(column), 0)))[1] - self._least(column[:, None])[1]

    def moved(self, column: Floats) -> Floats:
        """By which the parameters of the least cost are elsewhere if it is fitted, too."""
        return self._least(column[:, None])[0] - self._least(np.zeros((len(column), 0)))[0]

    def _least(self, more: Floats) -> tuple[Floats, float]:
        """Step [n] to the least |r|^2 + |u|^2, the residuals linear about u, and that cost; more: as below. The search
        ends near it only, and a straight line has a slope there."""
        design = np.column_stack([self._design[:, : self._count], more])
        at = np.concatenate((self._at[: self._count], np.zeros(more.shape[1])))
        inner = np.linalg.inv(design.T @ design + np.eye(len(at)))
        step = -inner @ (design.T @ self._residuals + at)
        residuals = self._residuals + design @ step
        return step[: self._count], float(residuals @ residuals + (at + step) @ (at + step))

    def _likelihood(self, more: Floats) -> float:
        """ln of the likelihood of each part by a fit to the others, added up; more: further columns [data, m]."""
        design = np.column_stack([self._design, more])
        precision = np.concatenate((self._precision, np.ones(more.shape[1])))
        at = np.concatenate((self._at, np.zeros(more.shape[1])))
        total = 0.0
        for part in range(FOLDS):
            held, rest = self._part == part, self._part != part
            if not held.any():
                continue
            inner = np.linalg.inv(design[rest].T @ design[rest] + np.diag(precision))
            step = -inner @ (design[rest].T @ self._residuals[rest] + precision * at)
            error = self._residuals[held] + design[held] @ step
            covariance = np.eye(int(held.sum())) + design[held] @ inner @ design[held].T
            total -= 0.5 * (float(error @ np.linalg.solve(covariance, error)) + float(np.linalg.slogdet(covariance)[1]))
        return total


def folds(data: Sequence[Datum]) -> NDArray[np.int64]:
    """The part [data] that each datum is held back with: runs one after the other, by kind. A run is what was read at
    one mounting of a gauge, if there are FOLDS of those, else each reading; and each of the other data."""
    mountings = len({item.group for item in data if item.kind == "reading"})
    runs: dict[str, dict[str, int]] = {}
    found = []
    for index, item in enumerate(data):
        run = item.group if item.kind == "reading" and item.group and mountings >= FOLDS else str(index)
        own = runs.setdefault(item.kind, {})
        found.append(own.setdefault(run, len(own)) % FOLDS)
    return np.array(found, dtype=np.int64)


def _candidates(model: Model, u: Floats) -> list[tuple[Unknown, str, float]]:
    """The numbers that could explain something, with a prior of half to twice what they are at u, their laws, and what
    is known of them over that prior."""
    machine = model.machine
    axes = dict.fromkeys(axis for session in model.sessions for axis in session.measured.axes)
    fitted = {key for item in model.unknowns if len(item.keys) == 1 for key in item.keys}
    now = {row.parameter: float(row.value) for row in rows(machine.tree) if isinstance(row.value, int | float)}
    now |= changes(machine, model.unknowns, model.values(u))
    found = []
    for axis in axes:
        for part, law in LAWS.items():
            key = f"axes.{axis}.{part}"
            if key in fitted or not now.get(key):
                continue
            if part == "lead_error":
                found.append((unknown(machine, f"lead.{axis}"), law, 1.0))
            else:
                wide = replace(unknown(machine, key, (0.5 * now[key], 2.0 * now[key])), prior=now[key])
                found.append((wide, law, min(1.0, unknown(machine, key).deviation / wide.deviation)))
    return found
