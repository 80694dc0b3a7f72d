"""Machines unlike the model: what a fit must not call measured, and intervals that hold all the same."""

from __future__ import annotations

import math
from types import SimpleNamespace
from typing import cast

import numpy as np
import pytest

from isel_twin.language import create_language, needed
from isel_twin.machine import load_machine
from isel_twin.many.identification import fit as fit_module
from isel_twin.many.identification import replays as replays_module
from isel_twin.many.identification.chi_square import ChiSquare, chi_squares
from isel_twin.many.identification.experiment import Teller, _coast, _push, _reversal, blocks
from isel_twin.many.identification.fit import Fit, fit
from isel_twin.many.identification.laws import SPLITS, _Trial
from isel_twin.many.identification.measured import Act, Measured, Reading
from isel_twin.many.identification.model import Model
from isel_twin.many.identification.session import Datum, Session
from isel_twin.many.identification.unknowns import unknown
from tests.many.identification.conftest import short
from tests.many.identification.coverage import CONTROLLER, Surface, bounds, drawn, held, hidden_day
from tests.many.identification.unlike import EFFECTS
from tests.near import COARSE, near_switches

pytestmark = pytest.mark.long(seconds=12)

NAMES = ("friction.x", "backlash.x", "stiffness.x")
TEN = tuple(range(10))
"""Of EFFECTS: friction that varies, a soft nut, a frame that keeps, gauges that stick, show too much and drift."""


@pytest.fixture(scope="module")
def fits(tmp_path_factory: pytest.TempPathFactory) -> list[tuple[Fit, np.ndarray]]:
    """Of ten machines, each with an effect at its full size, and what is true of them. The days are those of real
    twins, the fits on a surface (coverage.py)."""
    machine = load_machine(near_switches(tmp_path_factory.mktemp("near"), 2.0, more=COARSE))
    unknowns = [unknown(machine, name) for name in NAMES]
    language = needed(create_language(CONTROLLER), CONTROLLER)
    tell = Teller(language, "x", machine.axes[0].steps_per_mm)
    coasts = [_coast(tell, machine, language, hz, down=down) for hz, down in ((9700, False), (7900, True))]
    chosen = [short(_reversal(tell, 20.0)), _push(tell, 25.0, 150.0, "tool"), *coasts]
    truths = [drawn(seed, len(NAMES)) for seed in TEN]
    like = hidden_day(machine, unknowns, truths[0], chosen, 0)
    days = [
        hidden_day(machine, unknowns, u, chosen, seed, like, EFFECTS[seed]) for seed, u in zip(TEN, truths, strict=True)
    ]
    with pytest.MonkeyPatch.context() as patched:
        patched.setattr(fit_module, "behind_factors", lambda *_: ((), ()))
        patched.setattr(replays_module, "replayed", Surface(machine, unknowns, like, 22).replayed)
        return [(fit(machine, unknowns, [day], []), u) for day, u in zip(days, truths, strict=True)]


def test_intervals_hold_on_machines_that_are_unlike_the_model(fits: list[tuple[Fit, np.ndarray]]) -> None:
    """85 to 95 % of the truths in intervals of 90 %: of thirty, by the binomial distribution, 21 to 30."""
    count = int(np.sum([held(result, u) for result, u in fits]))
    low, high = bounds(len(fits) * len(NAMES))
    assert (low, high) == (21, 30)
    assert low <= count <= high


def test_what_is_measured_is_in_its_interval(fits: list[tuple[Fit, np.ndarray]]) -> None:
    """95 % of the numbers that nothing speaks against: of so many no more are missed than chance makes it in 39 of 40
    studies."""
    from scipy.stats import binom

    told = [
        (one, true) for result, u in fits for one, true in zip(result.estimates, u, strict=True) if result.measured(one)
    ]
    missed = [one for one, true in told if not one.unknown.at(one.low) <= true <= one.unknown.at(one.high)]
    assert len(told) >= 10, "a fit that doubts all is worth nothing"
    assert len(missed) <= binom.ppf(0.975, len(told), 0.05)
    assert {one.unknown.name for one, _ in told} == {"backlash.x", "stiffness.x"}


@pytest.mark.parametrize("effect", ["a nut softer at small force", "a frame that keeps 12 um"])
def test_a_backlash_that_pulls_falsify_is_not_measured(fits: list[tuple[Fit, np.ndarray]], effect: str) -> None:
    """Both add 8 to 12 um to the lost motion of pulls, and one of reversals is all that speaks against it."""
    result, _ = fits[[one.name for one in EFFECTS].index(effect)]
    assert not result.measured(result.estimates[1])


def test_friction_that_differs_with_direction_is_named_with_what_would_tell(fits: list[tuple[Fit, np.ndarray]]) -> None:
    result, _ = fits[[one.name for one in EFFECTS].index("friction that differs with direction")]
    assert result.suspects[0].law == "friction that differs with direction"
    assert not any(result.measured(one) for one in result.estimates)
    assert any("(friction that differs with direction, " in line for line in result.doubts)


# Laws that split a number ---


def datum(kind: str, load: float = 0.0, way: int = 0) -> Datum:
    return Datum(kind, "", "day", 0.0, 1.0, "mm", load=load, way=way)


@pytest.mark.parametrize(
    ("law", "parts"),
    [
        ("friction that is another one when slow (Stribeck)", (1.0, 1.0, 1.0, 0.0, 0.0)),
        ("friction that differs with direction", (0.0, 0.0, 0.0, 1.0, -1.0)),
        ("a nut softer at small force", (1.0, 0.0, 0.5, 0.0, 0.0)),
        ("a frame that keeps what it was pulled by", (0.0, 1.0, 1.0, 0.0, 0.0)),
        ("lost motion that pulls do not show, as of a gauge that sticks", (1.0, 0.0, 0.0, 0.0, 0.0)),
    ],
)
def test_a_split_is_a_number_that_some_data_see_otherwise(law: str, parts: tuple[float, ...]) -> None:
    """A reversal, a full and a half pull, a coast upwards and one downwards."""
    data = (datum("reading"), datum("pull", 1.0), datum("pull", 0.5), datum("overrun", way=1), datum("overrun", way=-1))
    (split,) = (one for one in SPLITS if one.law == law)
    assert tuple(split.parts(data)) == parts


def test_a_split_is_no_wider_than_such_things_are() -> None:
    """A backlash of 0.02 mm, half to twice, keeps 7 um, its deviation; one of 0.6 mm keeps 12 um of 0.18 mm."""
    machine, split = load_machine("4030"), next(one for one in SPLITS if one.law.startswith("a frame"))
    assert split.size(unknown(machine, "backlash.x"), 0.0) == 1.0
    wide = unknown(machine, "backlash.x", (0.3, 1.2))
    assert split.size(wide, math.log(0.6 / wide.prior) / wide.deviation) == pytest.approx(
        0.012 / (0.6 * math.log(4) / 4)
    )


@pytest.mark.parametrize("apart", [0.0, 3.0])
def test_a_law_that_the_data_do_not_exclude_widens_an_interval(apart: float) -> None:
    """Two data see a number by a; by the law the second one sees v more. r1 = a u, r2 = a (u + v) - apart, both priors
    1: by hand, from the normal equations of both."""
    a = 3.0
    none, data = np.zeros((2, 0)), (datum("reading"), datum("pull", 1.0))
    model = cast(Model, SimpleNamespace(data=data, zeros=lambda: none))
    trial = _Trial(model, np.zeros(1), np.full((2, 1), a), np.array([0.0, -apart]), none, np.ones(2))
    without = 1.0 / (1.0 + 2.0 * a**2)
    inner = np.linalg.inv([[1.0 + 2.0 * a**2, a**2], [a**2, 1.0 + a**2]])
    moved = (inner @ [a * apart, a * apart])[0] - a * apart * without
    assert trial.more(np.array([0.0, a])) == pytest.approx([(inner[0, 0] + moved**2) / without - 1.0])


# What a datum is ---


def test_a_reading_is_of_the_kind_that_its_mounting_is_of() -> None:
    """A coast downwards from 40 mm, a reversal, pulls by 100 and 50 N, a scale that is logged."""
    readings = (
        Reading("day", 1, "x", 40.0, gauge="coast", counter_mm=40.0),
        Reading("day", 2, "x", 24.9, gauge="coast", counter_mm=25.0),
        Reading("day", 3, "x", 1.0, gauge="reversal"),
        Reading("day", 4, "x", 1.0, gauge="push", push_n=-100.0),
        Reading("day", 4, "x", 1.0, gauge="push", push_n=50.0),
        Reading("day", 5, "x", 1.0, gauge="log", at_s=0.1),
    )
    acts = (Act("day", 2, 0.5, {"set": {"estop": "pressed"}}),)
    data = Session("day", CONTROLLER, (), (), Measured(readings, acts)).data
    assert [(one.kind, one.load, one.way) for one in data] == [
        ("overrun", 0.0, -1),
        ("overrun", 0.0, -1),
        ("reading", 0.0, 0),
        ("pull", 1.0, 0),
        ("pull", 0.5, 0),
        ("motion", 0.0, 0),
    ]


def test_coasts_go_both_ways() -> None:
    """Friction that differs with direction is seen by coasts in both."""
    machine = load_machine("4030")
    every = blocks(machine, CONTROLLER, ["x"], [], seed=0)
    assert [block.what.split(":")[0] for block in every if block.name.startswith("coast")] == ["x up", "x down", "x up"]


# Chi-square by kind ---


def judged(residuals: list[float], kinds: list[str], jacobian: np.ndarray, asked: int = 1) -> tuple[ChiSquare, ...]:
    data = tuple(Datum(kind, "", "day", 0.0, 1.0, "mm") for kind in kinds)
    told = {"missed": lambda r: np.zeros(len(r), dtype=bool), "each_square": lambda r: r**2}
    told |= {"residuals_at": lambda u: np.array(residuals), "zeros": lambda: np.zeros((len(data), 0))}
    return chi_squares(cast(Model, SimpleNamespace(data=data, **told)), asked, np.zeros(jacobian.shape[1]), jacobian)


def test_durations_that_carry_nothing_do_not_hide_pulls_that_misfit() -> None:
    """Forty of 0.1 deviations and eight of 2.5: 1.05 a datum together, 6.25 a pull. Of eight a true model leaves 3.27 a
    datum at most in 99.9 % (26.1, tables of chi-square)."""
    duration, pull = judged([0.1] * 40 + [2.5] * 8, ["duration"] * 40 + ["pull"] * 8, np.zeros((48, 1)))
    assert (duration.value, duration.fits) == (pytest.approx(0.01), True)
    assert (pull.value, pull.fits) == (pytest.approx(6.25), False)
    assert 26.1 / 8.0 < pull.limit < 1.1 * 26.1 / 8.0  # both kinds together keep 99.9 %


def test_what_a_fit_has_bent_to_is_no_degree_of_freedom() -> None:
    """One parameter that ten pulls see alike, by much: they have nine; of what is known of it nothing is left."""
    (pull,) = judged([1.0] * 10, ["pull"] * 10, np.full((10, 1), 100.0))
    assert pull.freedom == pytest.approx(9.0, abs=1e-3)
    assert pull.value == pytest.approx(10.0 / 9.0, rel=1e-3)


def test_what_is_known_of_a_number_beside_is_judged_like_data() -> None:
    """Four pulls see it by much and find it: three are left, and what was known of it is a datum of its own."""
    told = judged([1.0] * 4, ["pull"] * 4, np.column_stack([np.zeros(4), np.full(4, 100.0)]))
    freedom = {one.kind: one.freedom for one in told}
    assert freedom == pytest.approx({"pull": 3.0, "beside": 1.0}, abs=1e-3)
