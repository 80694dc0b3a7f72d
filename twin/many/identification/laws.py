"""Numbers of an axis that a fit leaves alone: as far as they are known they are fitted beside it, and beyond that they
are laws that compete with it, judged by held-back data.

**Beside.** No number of the file is exact. Those of LAWS that were not asked for, and the friction of an axis of which
none was, are parameters like the others within what is known of them (machine/spread.py), if the data see that:

    |dr/dv| >= MATTERS          v: in standard deviations of what is known

be that by chance, which confounds like any effect (many/26). So an interval holds what they leave open, once, and what
the data say of them themselves (many/18). Numbers behind a fitted factor are left out: reach.py has them; whoever names
one of them says that the others are known.

**Laws.** Chi-square says that something is wrong, not what. So at the result u other laws are tried, one by one, as
far as a straight line tells:

    a number of LAWS    is off by more than is known of it: its prior is half to twice
    one of SPLITS       some data see another friction, backlash or stiffness than others: the shape of friction that
                        sticks (Stribeck) or differs with direction, of a nut that is softer at small force, of a frame
                        that keeps what it was pulled by. Costs no replay: it is the Jacobian of those data alone

    c = dr/dv               0 if within the scatter of the model; the other way as well if the law seems to help
    r + J du + c v          the data near u, with the law; without it v = 0

If the fit does not explain its data, the numbers beside are as in the file for that: else they would take in what they
can, however unlikely that is, and no law would be named.

**Held back.** The runs (mountings of a gauge, stall series, durations) are dealt into FOLDS parts. Each part is
predicted by a fit, linear in du and v, to the others, with the uncertainty that it leaves, and

    gained = sum over the parts of  ln p(part | others, with the law) - ln p(part | others, without)

A law that only bends to the noise it has seen loses by that. One that has gained DECISIVE predicts better than what
the file says, and so do those as good as it, within DECISIVE or a fifth of what the best has gained: these data do not
tell them apart. If the fit does not explain its data, a law must also take ENOUGH of the excess of chi-square away
(many/17).

**What they leave open.** What may be off in the numbers of LAWS is in the intervals, as they are fitted beside. And no
split is dismissed for gaining nothing: the data may just not see it. With the weight that held-back data give it, all n
of them together ODDS times as likely beforehand as none,

    w = e^gained ODDS / n / (1 + sum of e^gained ODDS / n)
    widens = w ((variance of a number with the law + (how far the law moves it)^2) / variance without - 1)

is what the interval of each number grows by (many/29).
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.parameters import rows
from isel_twin.machine import Machine
from isel_twin.machine.spread import band, numbers
from isel_twin.many.identification.chi_square import ZERO_PRECISION
from isel_twin.many.identification.model import STEP, WIDE, Floats, Model
from isel_twin.many.identification.recovery import family
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
HALF_TO_TWICE = 0.35  # deviation of a logarithm
KEPT_MM = 0.012  # what a frame keeps of a pull, or a gauge of lost motion


@dataclass(frozen=True)
class Split:
    """A law by which some data see another number than the others do."""

    family: str  # of the parameter
    law: str
    part: Callable[[Datum], float]  # of the number's effect on a datum that is off by a number of its own
    most: float  # standard deviation of that number, at most: mm, else relative; below it that of the prior
    tells: str  # what would tell

    def parts(self, data: Sequence[Datum]) -> Floats:
        return np.array([self.part(datum) for datum in data])

    def size(self, item: Unknown, u: float) -> float:
        """Standard deviation of that number, over that of the parameter's prior; u: of the parameter."""
        lengths = item.unit == "mm" and item.logarithmic
        return min(1.0, self.most / (item.deviation * (item.value(u) if lengths else 1.0)))


SPLITS = (
    Split(
        "friction",
        "friction that is another one when slow (Stribeck)",
        lambda datum: float(datum.kind in ("reading", "pull")),
        HALF_TO_TWICE,
        "the force that moves the axis slowly with its motor off, by a spring scale",
    ),
    Split(
        "friction",
        "friction that differs with direction",
        lambda datum: float(datum.way),
        HALF_TO_TWICE,
        "coasts in both directions, repeated",
    ),
    Split(
        "stiffness",
        "a nut softer at small force",
        lambda datum: 1.0 - datum.load if datum.kind in ("reading", "pull") else 0.0,
        HALF_TO_TWICE,
        "pulls at three or more forces",
    ),
    Split(
        "backlash",
        "a frame that keeps what it was pulled by",
        lambda datum: float(datum.kind == "pull"),
        KEPT_MM,
        "a gauge read before a pull and after it is gone, and a second one between nut and carriage",
    ),
    Split(
        "backlash",
        "lost motion that pulls do not show, as of a gauge that sticks",
        lambda datum: float(datum.kind == "reading"),
        KEPT_MM,
        "reversals read by another gauge",
    ),
)
MATTERS = 0.5  # standard deviations of the data, of all together, from which a number is fitted beside the others
FOLDS = 5
MOST_GAINED = 50.0
ODDS = 2.0  # of all SPLITS together, beforehand, to none of them
DECISIVE = 3.0  # in natural logarithms of the likelihood of what is held back: twenty times as likely
NEARLY = 0.8  # of what the best one has gained, from which on another is alike
ENOUGH = 0.5  # part of the excess of chi-square that a law must take away to explain data that the fit does not


@dataclass(frozen=True)
class Law:
    """A number that is not as the file says, and what the data say for that."""

    key: str  # of the machine file, or the parameter that it splits
    law: str
    share: float  # of the excess of chi-square that it takes away, at most 1
    gained: float  # what held-back data say for it, in natural logarithms of their likelihood
    widens: tuple[float, ...] = ()  # by parameter asked for: what it adds to the variance, over that without any law
    tells: str = ""  # what would tell, of a split


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


def compete(
    model: Model, asked: int, u: Floats, jacobian: Floats, chance: Floats, scale: Floats, explains: bool
) -> tuple[Law, ...]:
    """All laws at u, the likeliest first. asked: how many of the model's parameters were, the others are beside.
    jacobian: at u; chance: [data, m], effects of further numbers there. scale: [data], variance of each over its
    noise's, as the intervals have it. explains: as of the fit."""
    fitted = {item.keys[0]: (at, item) for at, item in enumerate(model.unknowns) if at >= asked and not item.factor}
    own = {key: pair for key, pair in fitted.items() if jacobian[:, pair[0]].any()}  # else seen by a wide step, maybe
    added, here = _candidates(model, asked, u), model.residuals_at(u)
    whole = _Trial(model, u, jacobian, here, chance, scale)
    bare = _Trial(model, u[:asked], jacobian[:, :asked], here - jacobian[:, asked:] @ u[asked:], chance, scale)
    alone = whole if explains else bare  # what is known of a number takes in what it can, however unlikely
    moved = _moved_alone(model, [item for item, _ in added if item.keys[0] not in own], u, alone)
    found = []
    for item, law in added:
        key = item.keys[0]
        if key in own:
            at, known = own[key]
            moved[key] = jacobian[:, at] * item.deviation / known.deviation
        found.append(Law(key, law, alone.share(moved[key], asked), alone.gained(moved[key]), (0.0,) * asked))
    tried = [
        (split, item.name, split.size(item, u[at]) * split.parts(model.data) * jacobian[:, at])
        for split in SPLITS
        for at, item in enumerate(model.unknowns)
        if family(item.name) == split.family
    ]
    gained = [whole.gained(column) for *_, column in tried]
    likely = np.exp(np.minimum(gained, MOST_GAINED)) * ODDS / max(1, len(tried))
    for (split, name, column), gain, part in zip(tried, gained, likely / (1.0 + likely.sum()), strict=True):
        widens = tuple((part * whole.more(column)[:asked]).tolist())
        found.append(Law(name, split.law, whole.share(column, asked), gain, widens, split.tells))
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

    def __init__(
        self, model: Model, u: Floats, jacobian: Floats, residuals: Floats, chance: Floats, scale: Floats
    ) -> None:
        """chance, scale: as of `compete`."""
        zeros, self._model = model.zeros(), model
        self._chance, self._scale = chance, scale
        self._design = np.column_stack([jacobian, zeros])
        self._precision = np.concatenate((np.ones(len(u)), np.full(zeros.shape[1], ZERO_PRECISION)))
        self._at = np.concatenate((u, np.zeros(zeros.shape[1])))
        self._count, self._residuals, self._part = len(u), residuals, folds(model.data)
        self._without = self._likelihood(np.zeros((len(residuals), 0)))

    def gained(self, column: Floats) -> float:
        """What the law of this column [data] gains in what is held back."""
        return self._likelihood(column[:, None]) - self._without

    def share(self, column: Floats, asked: int) -> float:
        """The part of the excess of chi-square that it takes away. asked: how many parameters were."""
        squares, cost = self.least()
        excess = squares + float(self._at[asked : self._count] @ self._at[asked : self._count])
        excess -= self._model.freedom(self._residuals, asked)
        return min(1.0, (cost - self.least(column)[1]) / excess) if excess > 0.0 else 0.0

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

    def more(self, column: Floats) -> Floats:
        """By parameter: the variance with this law and the square of how far it moves, over the variance without it,
        less 1."""
        (variance, at), (other, moved) = (
            self._posterior(np.column_stack([self._chance, *more])) for more in ([], [column])
        )
        return np.maximum(0.0, (other + (moved - at) ** 2) / variance - 1.0)

    def _posterior(self, more: Floats) -> tuple[Floats, Floats]:
        """Variance and step from u of each parameter."""
        scale = np.sqrt(self._scale)
        design = np.column_stack([self._design, more]) / scale[:, None]
        precision = np.concatenate((self._precision, np.ones(more.shape[1])))
        at = np.concatenate((self._at, np.zeros(more.shape[1])))
        inner = np.linalg.inv(design.T @ design + np.diag(precision))
        step = -inner @ (design.T @ (self._residuals / scale) + precision * at)
        return np.diag(inner)[: self._count], step[: self._count]

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
    one mounting of a gauge, if there are FOLDS of those of its kind, else each reading; and each of the other data."""
    groups: dict[str, set[str]] = {}
    for item in data:
        groups.setdefault(item.kind, set()).add(item.group)
    runs: dict[str, dict[str, int]] = {}
    found = []
    for index, item in enumerate(data):
        mounted = item.unit == "mm" and item.group and len(groups[item.kind]) >= FOLDS
        run = item.group if mounted else str(index)
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
