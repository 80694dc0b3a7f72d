"""Predictions of a measuring day: bands by Student's t, what the seal holds, and the score of what was measured."""

from __future__ import annotations

import dataclasses
import json
import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import pytest

from isel_twin.jobs.robust import perturbation
from isel_twin.machine import Machine, load_machine, with_overrides
from isel_twin.many.identification import sealed as sealed_module
from isel_twin.many.identification.experiment import Experiment
from isel_twin.many.identification.measured import Measured, MeasuredError, Ring
from isel_twin.many.identification.protocol import Characteristic
from isel_twin.many.identification.sealed import Day, Predicted, Score, as_json, predict_day, score, seal_of, sealed

MACHINE = load_machine("4030")
NOTHING = Experiment("day", (), ())
T_2, T_1 = 4.302653, 12.706205  # 97.5 % of Student's t, by tables, of two degrees of freedom and of one
LINE = Predicted("a", "mm", 0.0, -1.0, 1.0)


def predicted(monkeypatch: pytest.MonkeyPatch, values: Sequence[float]) -> list[Predicted]:
    """By machines on which a day gives these values of one number."""
    monkeypatch.setattr(sealed_module, "_carried_out", lambda call: [Characteristic("a", "mm", values[call[-1] - 1])])
    return predict_day(NOTHING, MACHINE, "imc-s8", number=len(values), seed=1)


@pytest.mark.parametrize(
    ("values", "mean", "half"),
    [
        ((9.0, 10.0, 11.0), 10.0, T_2 * math.sqrt(4.0 / 3.0)),
        ((-1.0, 0.0, 4.0), 1.0, T_2 * math.sqrt(7.0) * math.sqrt(4.0 / 3.0)),
        ((10.0, 20.0), 15.0, T_1 * math.sqrt(50.0) * math.sqrt(1.5)),  # twice is not lopsided
        ((5.0, 5.0, 5.0), 5.0, 5e-6),  # never without a width: a score is over it
        ((0.0, 0.0), 0.0, 1e-9),
    ],
)
def test_a_band_holds_a_further_machine(
    values: tuple[float, ...], mean: float, half: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """m -+ t s sqrt(1 + 1/n)."""
    (one,) = predicted(monkeypatch, values)
    assert one.value == pytest.approx(mean)
    assert (one.value - one.low, one.high - one.value) == pytest.approx((half, half), rel=1e-6)


def test_a_lopsided_number_has_the_band_of_its_logarithm(monkeypatch: pytest.MonkeyPatch) -> None:
    (one,) = predicted(monkeypatch, (1.0, math.e, math.e**2))
    times = math.exp(T_2 * math.sqrt(4.0 / 3.0))
    assert (one.value, one.low, one.high) == pytest.approx((math.e, math.e / times, math.e * times), rel=1e-6)


def test_what_two_machines_give_is_predicted_and_what_one_gives_is_not(monkeypatch: pytest.MonkeyPatch) -> None:
    """A coast that ends in a stall, a machine that does not ring: no number there."""
    (one,) = predicted(monkeypatch, (math.nan, 9.0, math.inf, 11.0))
    assert one.value == 10.0
    assert predicted(monkeypatch, (math.nan, 9.0, math.nan)) == []


def test_a_prediction_is_of_machines_that_this_one_may_be_and_of_a_gauge(monkeypatch: pytest.MonkeyPatch) -> None:
    """As far as its numbers are known, not as machines are sold; with 5 um of noise, and a seed each."""
    made: list[tuple[Machine, dict[str, Any]]] = []

    def carry_out(experiment: Experiment, machine: Machine, controller: str, **how: Any) -> tuple[None, Measured]:
        made.append((machine, how))
        return None, Measured(rings=(Ring("", 1, "x", 100.0, frequency_hz=10.0),))

    monkeypatch.setattr(sealed_module, "carry_out", carry_out)
    told: list[int] = []
    (one,) = predict_day(NOTHING, MACHINE, "imc-s8", number=2, seed=3, progress=told.append)
    assert (one.what, told) == ("ring x: frequency", [1, 2])
    for number, (machine, how) in enumerate(made, 1):
        seed, _, overrides = perturbation(MACHINE, 3, number, "known")
        assert machine.digest == with_overrides(MACHINE, overrides).digest
        assert how == {"seed": seed, "noise_mm": 0.005, "time_noise_s": 0.0}


FORM = {
    "gauge_sigma_mm": 0.005,
    "time_sigma_s": 0.005,
    "reading": [{"command": 3, "axis": "x", "gauge": "1 push", "push_n": 90.0, "mm": 0.0, "counter_mm": 0.0}],
    "stall": [{"from_mm": 15.0, "acceleration_hz_per_ms": 400, "held_hz": 0.0, "lost_hz": 0.0, "supply_v": 0.0}],
    "ring": [{"command": 9, "file": "", "frequency_hz": 0.0, "damping": 0.0}],
    "act": [{"command": 4, "after_s": 0.5, "set": {"estop": "pressed"}}],
    "predicted": [{"what": "a", "unit": "mm", "value": 1.0, "low": 0.5, "high": 2.0}],
    "protocol": {"machine": "4030", "job": "0" * 64, "seal": ""},
}


def changed(part: str, key: str, value: object) -> dict[str, Any]:
    tree = json.loads(json.dumps(FORM))
    if isinstance(tree[part], list):
        tree[part][0][key] = value
    elif key:
        tree[part][key] = value
    else:
        tree[part] = value
    return tree


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [
        ("gauge_sigma_mm", "", 0.002),
        ("time_sigma_s", "", 0.001),
        *(("reading", key, 0.412) for key in ("mm", "counter_mm", "sigma_mm")),
        *(("stall", key, 21_000.0) for key in ("held_hz", "lost_hz", "supply_v")),
        *(("ring", key, 38.4) for key in ("frequency_hz", "damping")),
        ("ring", "file", "ring.csv"),
        ("protocol", "seal", "f" * 64),
    ],
)
def test_what_a_person_fills_in_leaves_the_seal_as_it_is(part: str, key: str, value: object) -> None:
    assert seal_of(changed(part, key, value)) == seal_of(FORM)


@pytest.mark.parametrize(
    ("part", "key", "value"),
    [
        *(("reading", key, 4) for key in ("command", "push_n", "axis", "gauge", "at_s")),
        *(("stall", key, 4) for key in ("from_mm", "acceleration_hz_per_ms")),
        ("ring", "command", 8),
        ("act", "after_s", 0.6),
        ("act", "set", {"estop": "released"}),
        *(("predicted", key, 1.1) for key in ("what", "unit", "value", "low", "high")),
        *(("protocol", key, "9030") for key in ("machine", "job")),
    ],
)
def test_plan_and_predictions_are_under_the_seal(part: str, key: str, value: object) -> None:
    assert seal_of(changed(part, key, value)) != seal_of(FORM)


@pytest.mark.parametrize("at", [0, 1])
def test_a_job_is_sealed_by_its_first_line_and_its_content(at: int, tmp_path: Path) -> None:
    form, job, seal = sealed("", "@07\n@0R7\n", {}, [LINE])
    (tmp_path / "day.toml").write_text(form)
    (tmp_path / "day.txt").write_text(job)
    assert job.splitlines()[0] == f"# sealed: {seal}"
    assert score(tmp_path / "day.toml").scores[0].predicted == LINE
    lines = job.splitlines()
    lines[at] += "0"
    (tmp_path / "day.txt").write_text("\n".join(lines) + "\n")
    with pytest.raises(MeasuredError, match=r"day\.txt beside it is not the job that was sealed with it"):
        score(tmp_path / "day.toml")


@pytest.mark.parametrize(
    ("measured", "e_n", "verdict"),
    [
        (11.0, 0.5, "holds"),
        (12.0, 1.0, "holds"),
        (12.1, 1.05, "questionable"),
        (13.1, 1.55, "differs"),
        (6.0, -1.0, "holds"),
    ],
)
def test_the_score_is_e_n(measured: float, e_n: float, verdict: str) -> None:
    """ISO/IEC 17043; each side has its own band."""
    told = Score(Predicted("a", "mm", 10.0, 6.0, 12.0), measured)
    assert (told.e_n, told.verdict) == (pytest.approx(e_n), verdict)


def scores(*e_n: float) -> tuple[Score, ...]:
    return tuple(Score(LINE, value) for value in e_n)


@pytest.mark.parametrize(
    ("beyond", "of", "unmeasured", "holds"),
    [(3, 10, 0, True), (4, 10, 0, False), (4, 10, 20, False), (5, 30, 0, True), (6, 30, 0, False), (0, 0, 5, False)],
)
def test_chance_is_that_of_what_was_measured(beyond: int, of: int, unmeasured: int, holds: bool) -> None:
    """Binomial, 5 % each, 99 %: at most 3 of 10, 5 of 30."""
    each = scores(*(1.2 if n < beyond else 0.5 for n in range(of)), *([math.nan] * unmeasured))
    told = Day(each, "")
    assert (told.measured, told.beyond, told.holds) == (of, beyond, holds)


def test_one_that_differs_is_named_and_counted() -> None:
    differs = dataclasses.replace(LINE, what="circle: squareness")
    told = Day((*scores(*[0.0] * 9), Score(differs, -1.6)), "")
    assert not told.holds
    assert told.in_words() == (
        "the day differs from what was predicted: 1 of 10 beyond |E_n| = 1, by chance at most 3; it differs in circle: "
        "squareness"
    )


def test_what_was_not_measured_is_null_in_json() -> None:
    told = as_json(Day(scores(1.2, math.nan), "5ea1"))
    assert json.loads(json.dumps(told, allow_nan=False)) == told
    one, none = told["scores"]
    assert (one["measured"], one["e_n"], one["verdict"]) == (1.2, pytest.approx(1.2), "questionable")
    assert (none["measured"], none["e_n"], none["verdict"]) == (None, None, "not measured")
    assert (told["seal"], told["beyond"], told["holds"]) == ("5ea1", 1, True)
