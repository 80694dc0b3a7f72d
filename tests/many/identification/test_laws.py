"""Laws that were not fitted, compared with what was by data held back from both."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from isel_twin.machine import load_machine
from isel_twin.many.identification.fit import Fit
from isel_twin.many.identification.laws import FOLDS, LAWS, MATTERS, Law, _Trial, beside, folds, left_alone, rivals
from isel_twin.many.identification.model import STEP, Model
from isel_twin.many.identification.page import page
from isel_twin.many.identification.patch import as_json, patch
from isel_twin.many.identification.session import Datum
from isel_twin.many.identification.unknowns import unknown
from tests.many.identification.test_doubts import CONTROLLER, coasting

MACHINE = load_machine("4030")


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
    none, ones = np.zeros((len(data), 0)), np.ones(len(data))
    return _Trial(model, np.full(rows.shape[1], u), rows, np.array(residuals), none, ones)


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
def test_the_cost_of_a_law_is_the_least_over_it_and_what_was_fitted(u: float) -> None:
    """By least squares over residuals and priors; u need not be the least cost's."""
    jacobian, column = np.array([2.0, 1.0, 0.0]), np.array([1.0, 1.0, 2.0])
    residuals = np.array([0.5, -1.0, 4.0])

    def least(design: np.ndarray, at: np.ndarray) -> tuple[float, float]:
        whole = np.concatenate((residuals, at))
        every = np.concatenate((design, np.eye(len(at))))
        left = whole + every @ np.linalg.lstsq(every, -whole, rcond=None)[0]
        return float((left[: len(residuals)] ** 2).sum()), float((left**2).sum())

    told = trial(residuals.tolist(), jacobian[:, None].tolist(), u)
    assert told.least() == pytest.approx(least(jacobian[:, None], np.array([u])))
    assert told.least(column) == pytest.approx(least(np.column_stack([jacobian, column]), np.array([u, 0.0])))


def law(key: str, gained: float, share: float = 1.0) -> Law:
    return Law(key, key, share, gained)


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
    told = [law(str(n), one) for n, one in enumerate(gained)]
    assert [one.key for one in rivals(told, explains)] == named


def test_what_takes_little_of_the_excess_explains_nothing() -> None:
    told = (law("0", 9.0, share=0.4),)
    assert not rivals(told, explains=False)
    assert len(rivals(told, explains=True)) == 1


# Fitted beside ---


def names(*fitted: str) -> list[str]:
    return [item.name for item in left_alone(MACHINE, [unknown(MACHINE, name) for name in fitted], ["x"])]


def test_numbers_that_were_not_asked_for_are_left_alone_once() -> None:
    """Friction of which nothing was asked is one factor; whoever names a part of it knows the others."""
    numbers = [f"axes.x.{part}" for part in LAWS if part.startswith("specimen.")] + ["axes.x.stribeck_speed", "lead.x"]
    assert names("supply") == ["friction.x", *numbers]
    assert names("friction.x") == numbers
    assert names("axes.x.guide_friction") == numbers
    assert names("friction.x", "lead.x", "axes.x.stribeck_speed") == numbers[:3]


def test_what_is_left_alone_is_as_wide_as_it_is_known() -> None:
    """A torque constant comes as it is bought (95 % within 7.6 %), an iron loss is an estimate: half to twice."""
    found = {item.name: (item.low, item.high) for item in left_alone(MACHINE, [], ["x"])}
    assert found["axes.x.specimen.torque_constant"] == pytest.approx((0.924, 1.076))
    assert found["axes.x.specimen.iron_loss"] == pytest.approx((0.5, 2.0))
    assert found["lead.x"] == pytest.approx((-0.25, 0.25))


def test_what_the_data_see_is_fitted_beside_be_it_chance_or_not() -> None:
    """Moved down by STEP, the lead changes two data by MATTERS together, the rotor by less."""
    moved = {"lead.x": MATTERS * STEP * np.array([0.61, 0.8]), "axes.x.specimen.rotor_inertia": np.array([0.0, 0.39])}

    def apart(u: np.ndarray, more: list[tuple[Any, float]]) -> list[np.ndarray]:
        assert [by for _, by in more] == [-STEP] * len(more)
        return [moved.get(item.name, np.zeros(2)) for item, _ in more]

    content = {"machine": MACHINE, "unknowns": (unknown(MACHINE, "friction.x"),), "axes": ["x"]}
    told = {"residuals_at": lambda u: np.zeros(2), "apart": apart}
    assert [item.name for item in beside(cast(Model, SimpleNamespace(**content, **told)))] == ["lead.x"]


@pytest.fixture(scope="module")
def heavier() -> Fit:
    """A rotor 10 % heavier, two deviations of what is known of it; dry friction as in the file, asked for."""
    with pytest.MonkeyPatch.context() as patched:
        return coasting(patched, {"specimen.rotor_inertia": 1.1}, "axes.x.guide_friction")


def test_an_interval_holds_what_other_numbers_leave_open(heavier: Fit) -> None:
    """Overruns grow with the rotor as with less friction; as it is fitted beside, both are found."""
    (estimate,), (rotor,) = heavier.estimates, heavier.beside
    (times,) = heavier.widened
    assert rotor.unknown.name == "axes.x.specimen.rotor_inertia"
    assert heavier.explains
    assert rotor.low < 1.1 < rotor.high
    assert estimate.low < estimate.unknown.prior < estimate.high
    narrow = (estimate.high / estimate.low) ** (1.0 / times)
    assert (
        estimate.value * narrow**0.5 < estimate.unknown.prior or estimate.value > estimate.unknown.prior * narrow**0.5
    )
    assert times > 1.5
    assert (
        f"{times:.1f} times as wide, as other numbers are known only roughly: axes.x.specimen.rotor_inertia"
        in heavier.doubts[0]
    )
    told = as_json(heavier, ["day"], [])
    assert [one["name"] for one in told["beside"]] == ["axes.x.specimen.rotor_inertia"]
    assert {one["law"] for one in told["laws"]} >= {"another rotor", "dry friction of the screw"}
    assert "specimen.rotor_inertia" in page("found", heavier, ["day"], [])


def test_a_number_beside_is_no_measured_one(heavier: Fit) -> None:
    text = patch(heavier, MACHINE, "4030", "found", CONTROLLER, ["day"], ["other"])
    (line,) = (line for line in text.splitlines() if line.startswith("rotor_inertia"))
    assert 'grade = "fitted"' in line


def test_a_number_beside_costs_what_it_is_off(monkeypatch: pytest.MonkeyPatch) -> None:
    """A rotor of twice the inertia is no rotor of that kind: what would explain it explains nothing."""
    result = coasting(monkeypatch, {"specimen.rotor_inertia": 2.0}, "axes.x.guide_friction")
    assert not result.explains
    assert "another rotor" in {one.law for one in result.suspects}
