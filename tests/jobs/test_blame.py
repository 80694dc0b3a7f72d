"""What tells machines that lose steps from those that hold: rank sums beside the count of all subsets, and chance."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from itertools import combinations
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from isel_twin.jobs import blame
from isel_twin.jobs.blame import separates
from isel_twin.jobs.robust import losses


def trials(rows: Sequence[Mapping[str, float]], losers: Sequence[int], part: Sequence[int] = ()) -> Any:
    """part: those that were not made to their end."""
    return [
        SimpleNamespace(
            factors=row, verdict=SimpleNamespace(lost=(number in losers,), part="1 refused" if number in part else "")
        )
        for number, row in enumerate(rows)
    ]


def test_a_machine_that_refuses_has_neither_lost_nor_held() -> None:
    """Of twenty four lose and six others refuse a line: 4 of 14. If all others refuse there is none to compare."""
    rows = [{"supply": float(n)} for n in range(20)]
    made = trials(rows, [0, 1, 2, 3], part=[2, *range(14, 20)])
    assert losses(made) == (4, 14)
    found = separates(made)
    assert found is not None
    assert found.held == pytest.approx(sum(range(4, 14)) / 10)
    assert separates(trials(rows, [0, 1, 2, 3], part=range(4, 20))) is None


def test_what_is_in_order_is_told_with_means_and_chance() -> None:
    """The last three of ten: 2 of the 120 ways to choose three are as far, and there are two candidates."""
    rows = [{"noise": (7 * n) % 5, "supply": 1.0 - 0.01 * n} for n in range(10)]
    found = separates(trials(rows, [7, 8, 9]))
    assert found == ("supply", pytest.approx(0.92), pytest.approx(0.97), pytest.approx(2 * 2 / 120))
    assert separates(trials(rows, [])) is None
    assert separates(trials(rows, range(10))) is None


@pytest.mark.parametrize(("of", "lost", "named"), [(20, 4, True), (20, 3, False), (7, 3, False), (149, 2, True)])
def test_few_losers_among_fifty_candidates_name_nothing(of: int, lost: int, named: bool) -> None:
    """2 / C(n, m) times 50: 0.021 of 4 of 20, 0.088 of 3 of 20, 2.9 of 3 of 7; 149 and 2 make 0.0091."""
    draw = np.random.default_rng(2)
    rows = [{f"n{k}": draw.normal() for k in range(49)} | {"cause": float(n)} for n in range(of)]
    found = separates(trials(rows, range(lost)))
    assert (found is not None and found.key == "cause") == named


@pytest.mark.parametrize("lost", [2, 3, 6])
def test_equal_values_are_no_order(lost: int) -> None:
    """A stiffness that is cut at 0.95 on most machines; every way to choose the losers is counted."""
    values = np.array([0.95, 0.95, 0.80, 0.95, 0.95, 0.91, 0.95, 0.95, 0.88])
    halves = (values[:, None] > values).sum(axis=1) + 0.5 * (values[:, None] == values).sum(axis=1)
    sums = [halves[list(chosen)].sum() for chosen in combinations(range(9), lost)]
    away = np.abs(np.array(sums) - halves.mean() * lost)
    assert blame._by_chance(values, lost) == pytest.approx((away >= away[0] - 1e-9).mean())


def test_what_is_the_same_on_most_machines_is_not_named() -> None:
    rows = [{"stiffness": 0.95 if n % 5 else 0.7 + 0.01 * n} for n in range(20)]
    assert separates(trials(rows, [1, 2, 3, 4, 6, 7, 8, 9])) is None  # all at 0.95: 4 of 12 others are below


@pytest.mark.parametrize("ties", [0.0, 0.6])
def test_the_normal_law_of_many_is_the_exact_one_of_fewer(ties: float, monkeypatch: pytest.MonkeyPatch) -> None:
    draw = np.random.default_rng(4)
    values = np.concatenate([draw.normal(0.5, 1.0, 40), draw.normal(0.0, 1.0, 80)])
    values[draw.random(120) < ties] = 3.0
    exact = blame._by_chance(values, 40)
    monkeypatch.setattr(blame, "EXACT", 0)
    assert blame._by_chance(values, 40) == pytest.approx(exact, rel=0.05)


def test_pure_chance_is_named_no_oftener_than_stated_and_a_cause_is_found() -> None:
    """400 studies of 20 machines with 40 numbers, a quarter of them cut as a stiffness is. Of 400 at 5 % more than 33
    would be three deviations too many. The cause: eight of twenty lie beyond a limit, nine of ten of them lose."""
    draw = np.random.default_rng(6)
    by_chance = found = 0
    for _ in range(400):
        table = draw.normal(size=(20, 40))
        table[:, :10] = np.minimum(table[:, :10], 0.0)
        rows = [{f"n{k}": float(value) for k, value in enumerate(row)} for row in table]
        losers = np.flatnonzero(draw.random(20) < draw.uniform(0.2, 0.6))
        beyond = np.argsort(table[:, 39])[-8:]
        told = separates(trials(rows, beyond[draw.random(8) < 0.9]))
        by_chance += separates(trials(rows, losers)) is not None
        found += told is not None and told.key == "n39"
    assert by_chance <= 33
    assert found >= 300
