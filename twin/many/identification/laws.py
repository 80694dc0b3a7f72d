"""Numbers of an axis that a fit leaves alone: as far as they are known they are fitted beside it, and beyond that they
are laws that compete with it, judged by held-back data.

**Beside.** No number of the file is exact. Those of LAWS that were not asked for, and the friction of an axis of which
none was, are parameters like the others within what is known of them (machine/spread.py), if the data see that:

    |dr/dv| >= MATTERS          v: in standard deviations of what is known

be that by chance, which confounds like any effect (many/26). So an interval holds what they leave open, once, and what
the data say of them themselves (many/18). Numbers behind a fitted factor are left out: reach.py has them; whoever names
one of them says that the others are known.

**Laws.** Chi-square says that something is wrong, not what. So each number of LAWS is moved by WIDE of a prior of half
to twice at the result u, where those beside are what the file says, as far as a straight line tells:

    c = dr/dv               0 if within the scatter of the model; the other way as well if the law seems to help
    r + J du + c v          the data near u, with the law; without it v = 0

**Held back.** The runs (mountings of a gauge, stall series, durations) are dealt into FOLDS parts. Each part is
predicted by a fit, linear in du and v, to the others, with the uncertainty that it leaves, and

    gained = sum over the parts of  ln p(part | others, with the law) - ln p(part | others, without)

A law that only bends to the noise it has seen loses by that. One that has gained DECISIVE predicts better than what
the file says, and so do those as good as it, within DECISIVE or a fifth of what the best has gained: these data do not
tell them apart. If the fit does not explain its data, a law must also take ENOUGH of the excess of chi-square away
(many/17).
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import rows
from isel_twin.machine import Machine
from isel_twin.machine.spread import band, numbers
from isel_twin.many.identification.model import STEP, WIDE, Floats, Model
from isel_twin.many.identification.session import Datum
from isel_twin.many.identification.unknowns import FRICTION_KEYS, Unknown, changes, unknown

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
MATTERS = 0.5  # standard deviations of the data, of all together, from which a number is fitted beside the others
FOLDS = 5
DECISIVE = 3.0  # in natural logarithms of the likelihood of what is held back: twenty times as likely
NEARLY = 0.8  # of what the best one has gained, from which on another is alike
ENOUGH = 0.5  # part of the excess of chi-square that a law must take away to explain data that the fit does not
ZERO_PRECISION = 1e-6  # of the zero of a gauge, 1/mm^2, and of the delay of a line, 1/s^2: next to nothing is known


@dataclass(frozen=True)
class Law:
    """A number that is not as the file says, and what the data say for that."""

    key: str  # of the machine file
    law: str
    share: float  # of the excess of chi-square that it takes away, at most 1
    gained: float  # what held-back data say for it, in natural logarithms of their likelihood


def rivals(laws: Sequence[Law], explains: bool) -> tuple[Law, ...]:
    """Of laws, the likeliest first, those that predict what was held back better than the file does, and alike.
    explains: as of the fit."""
    able = [one for one in laws if one.gained >= DECISIVE and (explains or one.share >= ENOUGH)]
    least = min((one.gained - max(DECISIVE, (1.0 - NEARLY) * one.gained) for one in able[:1]), default=0.0)
    return tuple(one for one in able if one.gained >= least)


def left_alone(machine: Machine, unknowns: Sequence[Unknown], axes: Iterable[str]) -> list[Unknown]:
    """What is known of these axes' numbers that no unknown sets."""
    fitted, entries = {key for item in unknowns for key in item.keys}, dict(numbers(machine.tree))
    found = []
    for axis in axes:
        if not any(f"axes.{axis}.{part}" in fitted for part in FRICTION_KEYS):
            found.append(unknown(machine, f"friction.{axis}"))
        for part in LAWS:
            key = f"axes.{axis}.{part}"
            if part in FRICTION_KEYS or key in fitted or not entries.get(key, {}).get("value"):
                continue
            name = f"lead.{axis}" if part == "lead_error" else key
            found.append(unknown(machine, name, None if part == "lead_error" else band(key, entries[key])))
    return found


def beside(model: Model) -> list[Unknown]:
    """Those of them that the data see, at the prior."""
    able, zero = left_alone(model.machine, model.unknowns, model.axes), np.zeros(len(model.unknowns))
    here, found = model.residuals_at(zero), model.apart(zero, [(item, -STEP) for item in able])
    seen = (float(np.linalg.norm(here - one)) / STEP for one in found)  # what may be chance, too
    return [item for item, size in zip(able, seen, strict=True) if size >= MATTERS]


def compete(model: Model, asked: int, u: Floats, jacobian: Floats) -> tuple[Law, ...]:
    """All laws at u, the likeliest first. asked: how many of the model's parameters were, the others are beside.
    jacobian: at u."""
    numbers_beside = [(at, item) for at, item in enumerate(model.unknowns) if at >= asked and not item.factor]
    own = {item.keys[0]: at for at, item in numbers_beside if jacobian[:, at].any()}  # else seen by a wide step, maybe
    added = _candidates(model, asked, u)
    if not added or not model.data:
        return ()
    here = model.residuals_at(u) - jacobian[:, asked:] @ u[asked:]
    trial = _Trial(model, u[:asked], jacobian[:, :asked], here)
    columns = {
        item.keys[0]: jacobian[:, own[item.keys[0]]] * item.deviation / model.unknowns[own[item.keys[0]]].deviation
        for item, _ in added
        if item.keys[0] in own
    }
    columns |= _moved_alone(model, [item for item, _ in added if item.keys[0] not in own], u, trial)
    found = []
    squares, cost = trial.least()
    excess = squares - model.freedom(here, asked)
    for item, law in added:
        column = columns[item.keys[0]]
        gained = trial.gained(column) if column.any() else 0.0
        share = min(1.0, (cost - trial.least(column)[1]) / excess) if excess > 0.0 else 0.0
        found.append(Law(item.keys[0], law, share, gained))
    return tuple(sorted(found, key=lambda one: -one.gained))


def _moved_alone(model: Model, added: Sequence[Unknown], u: Floats, trial: _Trial) -> dict[str, Floats]:
    """By key: dr [data] by one of these numbers more."""
    here, back = model.residuals_at(u), model.apart(u, [(item, -WIDE) for item in added])
    columns = [model.told(here - one) / WIDE for one in back]
    helping = [index for index, column in enumerate(columns) if column.any() and trial.gained(column) > 0.0]
    for index, ahead in zip(helping, model.apart(u, [(added[index], WIDE) for index in helping]), strict=True):
        columns[index] = model.told(ahead - back[index]) / (2.0 * WIDE)
    return {item.keys[0]: column for item, column in zip(added, columns, strict=True)}


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

    def least(self, column: Floats | None = None) -> tuple[float, float]:
        """|r|^2 and the least |r|^2 + |u|^2, the residuals linear about u, with this law or without. The search ends
        near it only, and a straight line has a slope there."""
        design, at = self._design[:, : self._count], self._at[: self._count]
        if column is not None:
            design, at = np.column_stack([design, column]), np.append(at, 0.0)
        step = -np.linalg.inv(design.T @ design + np.eye(len(at))) @ (design.T @ self._residuals + at)
        residuals = self._residuals + design @ step
        squares = float(residuals @ residuals)
        return squares, squares + float((at + step) @ (at + step))

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


def _candidates(model: Model, asked: int, u: Floats) -> list[tuple[Unknown, str]]:
    """The numbers that could explain something, with a prior of half to twice what they are at u, and their laws."""
    machine = model.machine
    fitted = {key for item in model.unknowns[:asked] if len(item.keys) == 1 for key in item.keys}
    now = {row.parameter: float(row.value) for row in rows(machine.tree) if isinstance(row.value, int | float)}
    now |= changes(machine, model.unknowns, model.values(u))
    found = []
    for axis in model.axes:
        for part, law in LAWS.items():
            key = f"axes.{axis}.{part}"
            if key in fitted or not now.get(key):
                continue
            if part == "lead_error":
                found.append((unknown(machine, f"lead.{axis}"), law))
            else:
                found.append((replace(unknown(machine, key, (0.5 * now[key], 2.0 * now[key])), prior=now[key]), law))
    return found
