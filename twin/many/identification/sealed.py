"""What the twin predicts of a measuring day, written into its form before anybody measures, and the score afterwards.

    form of the day  -- carried out on N machines that this one may be (machine/spread.py, `known`) --> mean m, s
    predicted = m      m -+ U, U = t s sqrt(1 + 1/N)
    score     E_n = (measured - predicted) / U            as ISO/IEC 17043 has it; the gauge's noise is drawn, so in U

t is 97.5 % of Student's, so that the band holds a further machine with 95 %. Of numbers that are positive and vary by
more than LOPSIDED, m and s are those of the logarithm: then U differs on both sides.

Both the plan and the predictions are sealed: their SHA-256 stands in the form and in the first line of the job, and is
shown. What a person fills in (FILLED) is not in it; all else, changed by one digit, does not match any more. Whoever
wants to be believed shows the seal to somebody before the day (many/19).

Beyond |E_n| = 1 lies one result in twenty by chance, beyond 1.5 one in three hundred:

    holds          |E_n| <= 1
    questionable   |E_n| <= 1.5
    differs        beyond

The day as a whole holds if nothing differs and no more is questionable than chance explains (99 %).
"""

from __future__ import annotations

import hashlib
import json
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from isel_twin.base.crew import Crew, in_order
from isel_twin.base.parameters import Limits, Place, parse_toml, plain, read_text, table, text
from isel_twin.base.toml import toml_line
from isel_twin.core.finer import finely
from isel_twin.jobs.robust import perturbation
from isel_twin.machine import Machine, MachineError, with_overrides
from isel_twin.many.identification.experiment import Experiment
from isel_twin.many.identification.measured import GAUGE_SIGMA_MM, MeasuredError, read_measured
from isel_twin.many.identification.protocol import Characteristic, characteristics
from isel_twin.many.identification.stand_in import carry_out

FILLED = frozenset(
    {"mm", "counter_mm", "sigma_mm", "gauge_sigma_mm", "time_sigma_s", "held_hz", "lost_hz", "supply_v"}
    | {"frequency_hz", "damping", "file"}
)
QUESTIONABLE, DIFFERS = 1.0, 1.5
BY_CHANCE, SURE = 0.05, 0.99  # part of true predictions beyond QUESTIONABLE; part of days that chance may explain
LOPSIDED = 2.0  # greatest over least
LEAST_PART = 1e-6  # of U, so that what does not vary at all has a score

SEAL = "# sealed: "  # how the first line of a job begins
_ANY = Limits("", -1e9, 1e9)


@dataclass(frozen=True)
class Predicted:
    """One characteristic before it was measured."""

    what: str
    unit: str
    value: float
    low: float
    high: float  # ends of what holds 95 %


@dataclass(frozen=True)
class Score:
    """One line of the table."""

    predicted: Predicted
    measured: float  # nan: not measured

    @property
    def e_n(self) -> float:
        away, one = self.measured - self.predicted.value, self.predicted
        return away / (one.high - one.value if away > 0.0 else one.value - one.low)

    @property
    def verdict(self) -> str:
        if math.isnan(self.measured):
            return "not measured"
        if abs(self.e_n) <= QUESTIONABLE:
            return "holds"
        return "questionable" if abs(self.e_n) <= DIFFERS else "differs"


@dataclass(frozen=True)
class Day:
    """The score of a measuring day."""

    scores: tuple[Score, ...]
    seal: str

    @property
    def measured(self) -> int:
        return sum(one.verdict != "not measured" for one in self.scores)

    @property
    def beyond(self) -> int:
        """How many are questionable or differ."""
        return sum(one.verdict in ("questionable", "differs") for one in self.scores)

    @property
    def by_chance(self) -> int:
        """So many beyond 1 chance explains."""
        from scipy.stats import binom

        return int(binom.ppf(SURE, self.measured, BY_CHANCE)) if self.measured else 0

    @property
    def holds(self) -> bool:
        """False if nothing was measured, too."""
        differ = any(one.verdict == "differs" for one in self.scores)
        return self.measured > 0 and not differ and self.beyond <= self.by_chance

    def in_words(self) -> str:
        """The verdict of the day."""
        differ = [one.predicted.what for one in self.scores if one.verdict == "differs"]
        head = "the day holds what was predicted" if self.holds else "the day differs from what was predicted"
        if not self.measured:
            head = "nothing of what was predicted has been measured"
        named = f"; it differs in {', '.join(differ)}" if differ else ""
        return f"{head}: {self.beyond} of {self.measured} beyond |E_n| = 1, by chance at most {self.by_chance}{named}"


def predict_day(
    experiment: Experiment,
    machine: Machine,
    controller: str,
    *,
    number: int,
    seed: int,
    crew: Crew | None = None,
    progress: Callable[[int], None] | None = None,
) -> list[Predicted]:
    """Predictions by so many machines, 2 or more; one that cannot be built is left out. progress: called with the
    number carried out. Raises ValueError if none can be built."""
    calls = [(experiment, machine, controller, seed, n) for n in range(1, number + 1)]
    by: dict[tuple[str, str], list[float]] = {}
    for done, found in enumerate(in_order(_carried_out, calls, crew), 1):
        for one in found:
            if math.isfinite(one.value):
                by.setdefault((one.what, one.unit), []).append(one.value)
        if progress is not None:
            progress(done)
    if not by:
        raise ValueError(f"none of {number} machines that {machine.name} may be can be built: {experiment.name}")
    predicted = []
    for (what, unit), values in by.items():
        if len(values) > 1:
            predicted.append(Predicted(what, unit, *_band(values)))
    return predicted


def _band(values: Sequence[float]) -> tuple[float, float, float]:
    """What is predicted of a further one: value, low, high."""
    from scipy.stats import t

    count, lopsided = len(values), min(values) > 0.0 and max(values) > LOPSIDED * min(values)
    own = np.log(values) if lopsided else np.array(values)
    mean = float(own.mean())
    half = float(t.ppf(0.975, count - 1)) * float(own.std(ddof=1)) * math.sqrt(1.0 + 1.0 / count)
    half = max(half, LEAST_PART * abs(mean), 1e-9)
    ends = (mean, mean - half, mean + half)
    return (math.exp(ends[0]), math.exp(ends[1]), math.exp(ends[2])) if lopsided else ends


def _carried_out(call: tuple[Experiment, Machine, str, int, int]) -> list[Characteristic]:
    """On one machine that this one may be, with gauge noise; none if it cannot be built. For worker processes."""
    experiment, machine, controller, seed, number = call
    twin_seed, _, overrides = perturbation(machine, seed, number, "known")

    def made(more: Mapping[str, float]) -> list[Characteristic]:
        drawn = with_overrides(machine, {**overrides, **more})
        _, measured = carry_out(
            experiment, drawn, controller, seed=twin_seed, noise_mm=GAUGE_SIGMA_MM, time_noise_s=0.0
        )
        return characteristics(measured)

    try:
        return finely(machine, made)
    except MachineError:
        return []


# The form ---


def sealed(form: str, job: str, head: Mapping[str, Any], predicted: Sequence[Predicted]) -> tuple[str, str, str]:
    """The form with its predictions and seal, the job with the seal above, and the seal. head: of [protocol]."""
    lines = ["", "# Predicted before anything was measured. The seal holds plan and predictions: do not change them."]
    for one in predicted:
        ends = {key: float(f"{getattr(one, key):.6g}") for key in ("value", "low", "high")}
        values = {"what": one.what, "unit": one.unit, **ends}
        lines += ["", "[[predicted]]", *map(toml_line, values, values.values())]
    body = form + "\n".join(lines) + "\n"
    head = {**head, "job": hashlib.sha256(job.encode()).hexdigest()}
    told = ["", "[protocol]", *map(toml_line, head, head.values())]
    whole = body + "\n".join(told) + "\n"
    seal = seal_of(parse_toml(whole, Place("form", MeasuredError)))
    return whole + toml_line("seal", seal) + "\n", f"{SEAL}{seal}\n{job}", seal


def seal_of(tree: Mapping[str, Any]) -> str:
    """SHA-256 of all that nobody fills in; the seal itself is not in it."""
    kept = _unfilled({key: value for key, value in tree.items() if key != "protocol"})
    head = {key: value for key, value in tree.get("protocol", {}).items() if key != "seal"}
    return hashlib.sha256(json.dumps([head, kept], sort_keys=True).encode()).hexdigest()


def _unfilled(value: Any) -> Any:
    if isinstance(value, Mapping):
        return {key: _unfilled(one) for key, one in value.items() if key not in FILLED}
    return [_unfilled(one) for one in value] if isinstance(value, list) else value


def score(file: Path) -> Day:
    """The score of a filled form. Raises MeasuredError for one that has no predictions, or others than were sealed."""
    place = Place(file, MeasuredError)
    tree = parse_toml(read_text(place), place)
    head = table(tree.get("protocol", {}), place.at("protocol"))
    if "seal" not in head:
        raise place.wrong("has no predictions; `isel-twin experiment NAME --protocol` writes them before the day")
    if head["seal"] != seal_of(tree):
        raise place.at("protocol.seal").wrong(
            "plan or predictions are not those that were sealed; take the file as it was written and fill in values"
        )
    job = file.with_suffix(".txt")
    if job.exists():
        first, _, rest = job.read_text(encoding="utf-8").partition("\n")
        if first != f"{SEAL}{head['seal']}" or hashlib.sha256(rest.encode()).hexdigest() != head.get("job"):
            raise place.wrong(f"{job.name} beside it is not the job that was sealed with it")
    found = {(one.what, one.unit): one.value for one in characteristics(read_measured(file))}
    scores = []
    for number, item in enumerate(tree.get("predicted", []), 1):
        at = place.at(f"predicted {number}")
        what, unit = text(item["what"], at.at("what")), text(item["unit"], at.at("unit"))
        one = Predicted(what, unit, *(plain(item[key], _ANY, at.at(key)) for key in ("value", "low", "high")))
        scores.append(Score(one, found.get((what, unit), math.nan)))
    return Day(tuple(scores), str(head["seal"]))


def as_json(day: Day) -> dict[str, Any]:
    """The score in JSON's types."""
    rows = []
    for one in day.scores:
        known = not math.isnan(one.measured)
        row = {"what": one.predicted.what, "unit": one.predicted.unit, "predicted": one.predicted.value}
        row |= {"low": one.predicted.low, "high": one.predicted.high, "measured": one.measured if known else None}
        rows.append({**row, "e_n": one.e_n if known else None, "verdict": one.verdict})
    return {"seal": day.seal, "holds": day.holds, "beyond": day.beyond, "by_chance": day.by_chance, "scores": rows}
