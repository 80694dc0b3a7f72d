"""Laws that were not fitted, compared with what was by data held back from both."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from isel_twin.many.identification.fit import Fit
from isel_twin.many.identification.laws import FOLDS, Competition, Law, _Trial, folds
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.patch import as_json
from isel_twin.many.identification.session import Datum
from tests.many.identification.test_doubts import coasting


def reading(run: str, kind: str = "reading") -> Datum:
    return Datum(kind, run, "day", 0.0, 1.0, "mm", run)


def test_a_run_is_held_back_whole() -> None:
    """Ten readings at five mountings make five parts, at two mountings ten runs; stall series count for themselves."""
    five = [reading(run) for run in "aabbccddee"]
    assert folds(five).tolist() == [0, 0, 1, 1, 2, 2, 3, 3, 4, 4]
    two = [reading(run) for run in "ab" * 5]
    assert folds(two).tolist() == [n % FOLDS for n in range(10)]
    assert folds([*five, *(reading("line", "duration") for _ in range(6))]).tolist()[10:] == [0, 1, 2, 3, 4, 0]


def trial(residuals: list[float], jacobian: list[list[float]] | None = None, u: float = 0.0) -> _Trial:
    """Of data without zeros; a fit of one parameter, if there is a Jacobian."""
    rows = np.array(jacobian) if jacobian else np.zeros((len(residuals), 0))
    data = tuple(Datum("stall", str(n), "day", 0.0, 1.0, "ln Hz") for n in range(len(residuals)))
    model = cast(Model, SimpleNamespace(data=data, zeros=lambda: np.zeros((len(data), 0))))
    return _Trial(model, np.full(rows.shape[1], u), rows, np.array(residuals))


@pytest.mark.parametrize(("one", "other"), [(3.0, 3.0), (0.1, -2.0), (0.0, 0.0)])
def test_what_a_law_gains_is_how_it_predicts_each_part_from_the_others(one: float, other: float) -> None:
    """Both data shift by a v, v of variance 1: from the other one, v = -a r/(1 + a^2) with variance 1/(1 + a^2)."""
    a = 2.0
    left = 1.0 + a * a

    def surprise(here: float, there: float) -> float:
        error, variance = here - a * a * there / left, 1.0 + a * a / left
        return 0.5 * (error**2 / variance + math.log(variance) - here**2)

    gained = trial([one, other]).gained(np.array([a, a]))
    assert gained == pytest.approx(-surprise(one, other) - surprise(other, one))
    assert (gained > 0.0) == (one == 3.0)


@pytest.mark.parametrize("u", [0.0, -0.9])
def test_a_law_moves_what_was_fitted_to_where_both_would_be(u: float) -> None:
    """Least squares over both, and over what was fitted: u need not be the least cost's."""
    jacobian, column = np.array([2.0, 1.0, 0.0]), np.array([1.0, 1.0, 2.0])
    residuals = np.array([0.5, -1.0, 4.0])

    def least(design: np.ndarray, at: np.ndarray) -> tuple[np.ndarray, float]:
        whole = np.concatenate((residuals, at))
        every = np.concatenate((design, np.eye(len(at))))
        step = np.linalg.lstsq(every, -whole, rcond=None)[0]
        return step, float(((whole + every @ step) ** 2).sum())

    one, alone = least(jacobian[:, None], np.array([u]))
    both, less = least(np.column_stack([jacobian, column]), np.array([u, 0.0]))
    told = trial(residuals.tolist(), jacobian[:, None].tolist(), u)
    assert told.moved(column).tolist() == pytest.approx([both[0] - one[0]])
    assert told.saved(column) == pytest.approx(alone - less)


def law(key: str, gained: float, share: float = 1.0) -> Law:
    return Law(key, key, share, gained, 0.1, (0.0,))


@pytest.mark.parametrize(
    ("gained", "explains", "named"),
    [
        ((2.9, 0.0), True, []),
        ((3.0, 0.0), True, ["0"]),
        ((5.0, 3.1), True, ["0", "1"]),  # within 3 of the best
        ((6.0, 3.0), True, ["0", "1"]),
        ((50.0, 41.0, 39.0), False, ["0", "1"]),  # within a fifth of it
    ],
)
def test_laws_as_good_as_the_best_are_alike(gained: tuple[float, ...], explains: bool, named: list[str]) -> None:
    told = Competition(tuple(law(str(n), one) for n, one in enumerate(gained)), np.zeros((1, 1)))
    assert [one.key for one in told.rivals(explains)] == named


def test_what_takes_little_of_the_excess_explains_nothing() -> None:
    told = Competition((law("0", 9.0, share=0.4),), np.zeros((1, 1)))
    assert not told.rivals(explains=False)
    assert len(told.rivals(explains=True)) == 1


@pytest.fixture(scope="module")
def damped() -> Fit:
    """Twice the viscous friction, and nothing but viscous friction fitted: the data are explained."""
    with pytest.MonkeyPatch.context() as patched:
        return coasting(patched, {"shaft_viscous": 2.0}, "axes.x.shaft_viscous")


def test_laws_that_predict_as_well_widen_the_interval_by_what_they_disagree(damped: Fit) -> None:
    """A lighter rotor and dry friction bend overruns nearly as viscous friction does."""
    assert damped.explains
    (estimate,) = damped.estimates
    moved = sum(one.weight * one.moved[0] ** 2 for one in damped.competition.laws)
    (times,) = damped.widened
    alone = damped.covariance[0, 0] - moved
    assert times == pytest.approx(math.sqrt(damped.covariance[0, 0] / alone))
    assert estimate.low < 2.0 * estimate.unknown.prior < estimate.high
    assert (damped.doubts != ()) == (times >= 1.5)
    told = as_json(damped, ["day"], [])
    assert {one["law"] for one in told["laws"]} >= {"another rotor", "dry friction of the guide"}
    assert sum(one["weight"] for one in told["laws"]) < 1.0
