"""How far the outcome of a job is known, as the numbers of the machine are: bands, and what contributes most to each.

The job is repeated on machines that this one may be (robust.py, source `known`). Of n repetitions the k-th least and
the k-th greatest outcome hold a further one in n + 1 - 2 k of n + 1 cases, whatever its distribution:

    k = 1 up to 78 repetitions, then 2.5 % of them        20 repetitions: 90 %        39 and more: 95 %

What contributes is in blame.py; the rest is scatter of switches and numbers that nobody can tell from these few
repetitions.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.jobs.blame import contributions
from isel_twin.jobs.result import Result
from isel_twin.jobs.robust import Repetition
from isel_twin.jobs.verdict import Verdict

TAIL = 0.025  # on each side, of a band of 95 %
LEAST_MM = 1e-4  # band of a position that counts


@dataclass(frozen=True)
class Band:
    """An outcome on the machine as it is in the file, and where it lies as far as that is known."""

    what: str  # "time", "margin", "edge", or an axis
    unit: str
    value: float
    low: float
    high: float
    line: int | None = None  # of the job, after which an axis stands there
    by: tuple[tuple[str, float], ...] = ()  # numbers that contribute most, with their part of the variance

    def in_words(self) -> str:
        """In words."""
        place = f"{self.what.upper()} after line {self.line}" if self.line is not None else self.what
        each = (self.value, self.low, self.high)
        texts = [f"{one:.1%}" if self.what == "margin" else f"{one:.3f} {self.unit}".rstrip() for one in each]
        by = f"; most by {' and '.join(f'{key} ({share:.0%})' for key, share in self.by)}" if self.by else ""
        return f"{place}: {texts[0]}, {texts[1]} .. {texts[2]}{by}"

    def told(self) -> dict[str, Any]:
        """In JSON's types."""
        numbers = {name: round(getattr(self, name), 6) for name in ("value", "low", "high")}
        line = {} if self.line is None else {"line": self.line}
        return {"what": self.what, "unit": self.unit, **line, **numbers, "by": {key: round(s, 3) for key, s in self.by}}


def outside(number: int) -> int:
    """How many of so many outcomes lie on each side at the end of a band or beyond."""
    return max(1, int(TAIL * (number + 1)))


def coverage(number: int) -> float:
    """The part of further outcomes that a band of so many holds."""
    return max(0.0, 1.0 - 2.0 * outside(number) / (number + 1))


def whole(trials: Sequence[Repetition]) -> list[Repetition]:
    """Those that made the job to its end: the others say nothing of its time, margin and places (jobs/18)."""
    return [one for one in trials if not one.verdict.part]


def bands(verdict: Verdict, results: Sequence[Result], trials: Sequence[Repetition]) -> tuple[Band, ...]:
    """Of time, margin, edge and, for each axis, the place that is known least; none of fewer than two repetitions that
    made the whole job.

    verdict, results: of the machine as it is.
    """
    trials = whole(trials)
    if len(trials) < 2:
        return ()
    found = [_band("time", "s", verdict.cycle_s, [(one, one.verdict.cycle_s) for one in trials])]
    for what, unit, value, each in (
        ("margin", "", verdict.least_margin, [one.verdict.least_margin for one in trials]),
        ("edge", "", _edge(verdict), [_edge(one.verdict) for one in trials]),
    ):
        known = [(one, told) for one, told in zip(trials, each, strict=True) if told is not None]
        if value is not None and 1 < len(known) == len(trials):  # of some alone it would be a choice
            found.append(_band(what, unit, value, known))
    found += _places(results, trials)
    return tuple(found)


def _edge(verdict: Verdict) -> float | None:
    return verdict.least_edge and verdict.least_edge[0]


def _places(results: Sequence[Result], trials: Sequence[Repetition]) -> list[Band]:
    """The place of each axis at rest after a line with the widest band."""
    lines = [(at, result) for at, result in enumerate(results) if not result.condition and result.complete]
    widest: list[Band] = []
    for axis, name in enumerate(CARRIAGES):
        every = []
        for at, result in lines:
            there = [(one, one.places_mm[at][axis]) for one in trials if at < len(one.places_mm)]
            if len(there) > 1:
                every.append((ends([mm for _, mm in there]), result, there))
        if every:
            (low, high), result, there = max(every, key=lambda one: one[0][1] - one[0][0])
            if high - low >= LEAST_MM:
                widest.append(_band(name, "mm", result.position_mm[axis], there, result.number))
    return widest


def ends(values: Sequence[float]) -> tuple[float, float]:
    """Both ends of the band of these values."""
    ordered, beyond = sorted(values), outside(len(values))
    return ordered[beyond - 1], ordered[-beyond]


def _band(
    what: str, unit: str, value: float, known: Sequence[tuple[Repetition, float]], line: int | None = None
) -> Band:
    return band(what, unit, value, [one.factors for one, _ in known], [told for _, told in known], line)


def band(
    what: str,
    unit: str,
    value: float,
    drawn: Sequence[Mapping[str, float]],
    values: Sequence[float],
    line: int | None = None,
) -> Band:
    """A band of these values, two or more; drawn: the factors of the machine that each is of."""
    low, high = ends(values)
    return Band(what, unit, value, low, high, line, contributions(drawn, values))
