"""Bands of an outcome and what contributes to them, each by a closed form: order statistics, ranks of Spearman."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace
from typing import Any

import pytest

from isel_twin.jobs.blame import contributions
from isel_twin.jobs.uncertain import Band, bands

TEN = tuple(range(1, 11))


def swapped(*pairs: tuple[int, int]) -> list[float]:
    """1 to 10 with these exchanged. Spearman's rho is 1 - 6 D / 990, D the sum of 2 d^2 of distances d."""
    found = {at: float(at) for at in TEN}
    for one, two in pairs:
        found[one], found[two] = float(two), float(one)
    return list(found.values())


def number(name: str = "a") -> list[dict[str, float]]:
    return [{name: float(at)} for at in TEN]


def test_a_part_of_the_variance_is_the_square_of_the_rank_correlation() -> None:
    """Neighbours exchanged: rho = 1 - 12/990. It may fall as well as rise."""
    expected = (("a", pytest.approx((1.0 - 12.0 / 990.0) ** 2)),)
    outcome = swapped((4, 5))
    assert contributions(number(), outcome) == expected
    assert contributions(number(), [-one for one in outcome]) == expected
    assert contributions(number(), [one**3 for one in outcome]) == expected  # ranks only


def test_equal_outcomes_share_their_ranks() -> None:
    """0, 0, 0, 1, 2, 3 have the ranks 2, 2, 2, 4, 5, 6, so rho^2 = 15.5 / 17.5."""
    rows = [{"a": float(at)} for at in range(6)]
    assert contributions(rows, [0.0, 0.0, 0.0, 1.0, 2.0, 3.0]) == (("a", pytest.approx(15.5 / 17.5)),)


@pytest.mark.parametrize(("pairs", "named"), [(((1, 6), (2, 4)), True), (((1, 6), (2, 4), (9, 10)), False)])
def test_a_number_is_named_from_the_limit_of_chance_on(pairs: tuple[tuple[int, int], ...], named: bool) -> None:
    """Of ten, Fisher's z with the variance 1.06 / 7 of ranks: 0.643 at 95 %. rho: 1 - 6 58/990 = 0.648, 0.636."""
    assert bool(contributions(number(), swapped(*pairs))) == named


def test_what_does_not_vary_is_no_candidate_and_what_varies_is() -> None:
    """A hundred that stand still leave the limit; one that varies in another way lifts it (2.5 in place of 5 %)."""
    outcome = swapped((1, 6), (2, 4))
    still = [row | {f"n{at}": 1.0 for at in range(100)} for row in number()]
    assert [key for key, _ in contributions(still, outcome)] == ["a"]
    other = [row | {"b": float(at % 2)} for at, row in enumerate(number())]
    assert contributions(other, outcome) == ()


@pytest.mark.parametrize(("count", "named"), [(4, 0), (5, 1)])
def test_of_four_repetitions_nothing_is_said(count: int, named: bool) -> None:
    assert len(contributions(number()[:count], [float(at) for at in range(count)])) == named


def test_two_are_named_the_greater_part_first() -> None:
    rows = [
        {"a": one, "b": at**2.0, "c": two} for at, one, two in zip(TEN, swapped((4, 5)), swapped((4, 6)), strict=True)
    ]
    assert [key for key, _ in contributions(rows, list(map(float, TEN)))] == ["b", "a"]


# Bands ---


def verdict(cycle_s: float, margin: float | None = None, edge: float | None = None, part: str = "") -> Any:
    least = None if edge is None else (edge, 7.0)
    return SimpleNamespace(cycle_s=cycle_s, least_margin=margin, least_edge=least, part=part)


def trial(places_mm: Sequence[tuple[float, ...]] = (), outcome: Any = None) -> Any:
    return SimpleNamespace(verdict=outcome or verdict(10.0), places_mm=places_mm, factors={})


def line(number: int, x_mm: float, *, condition: bool = False, complete: bool = True) -> Any:
    return SimpleNamespace(number=number, condition=condition, complete=complete, position_mm=(x_mm, 0.0, 0.0))


def test_a_band_is_of_all_repetitions_that_made_the_job() -> None:
    told = verdict(9.0, 0.3, 0.7), verdict(12.0, 0.2), verdict(11.0, 0.1, 0.8)
    trials = [trial(outcome=one) for one in told]
    found = {one.what: one for one in bands(verdict(10.0, 0.2, 0.9), [], trials)}
    assert (found["time"].low, found["time"].value, found["time"].high) == (9.0, 10.0, 12.0)
    assert (found["margin"].low, found["margin"].value, found["margin"].high) == (0.1, 0.2, 0.3)
    assert "edge" not in found  # of two of three it would be a choice
    refused = [*trials, trial(outcome=verdict(1.0, 0.9, 5.0, part="1 refused"))]
    assert bands(verdict(10.0, 0.2, 0.9), [], refused) == bands(verdict(10.0, 0.2, 0.9), [], trials)
    both = [trial(outcome=verdict(9.0, 0.3, 0.7)), trials[2]]
    assert {one.what: (one.low, one.value, one.high) for one in bands(verdict(10.0, 0.2, 0.9), [], both)}["edge"] == (
        0.7,
        0.9,
        0.8,
    )
    assert "edge" not in {one.what for one in bands(verdict(10.0, 0.2), [], both)}


def test_the_place_that_is_known_least_is_shown_of_lines_that_were_carried_out() -> None:
    """Line 2 differs by 0.1 mm, 1 by 0.02. 3 was a condition, 4 was broken off: both by 9. Y: less than 0.1 um."""
    lines = [line(1, 5.0), line(2, 8.0), line(3, 0.0, condition=True), line(4, 0.0, complete=False)]
    trials = [
        trial([(5.0 + 0.02 * n, 5e-5 * n, 0.0), (8.0 + 0.1 * n, 0.0, 0.0), (9.0 * n, 0.0, 0.0), (9.0 * n, 0.0, 0.0)])
        for n in range(2)
    ]
    ended = trial([(5.01, 0.0, 0.0)])  # before the others
    (_, x) = bands(verdict(10.0), lines, [*trials, ended])
    assert (x.what, x.line, x.value, x.low) == ("x", 2, 8.0, 8.0)
    assert x.high == pytest.approx(8.1)


@pytest.mark.parametrize(
    ("band", "words"),
    [
        (Band("margin", "", 0.2, 0.1, 0.3, by=(("a", 0.61),)), "margin: 20.0%, 10.0% .. 30.0%; most by a (61%)"),
        (Band("x", "mm", 8.0, 7.9, 8.1, line=2), "X after line 2: 8.000 mm, 7.900 mm .. 8.100 mm"),
        (
            Band("edge", "", 0.9, 0.7, 1.1, by=(("a", 0.5), ("b", 0.3))),
            "edge: 0.900, 0.700 .. 1.100; most by a (50%) and b (30%)",
        ),
    ],
)
def test_a_band_in_words(band: Band, words: str) -> None:
    assert band.in_words() == words
