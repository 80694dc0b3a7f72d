"""The fastest setting that holds, and its transfer to the real controller.

    front, fastest first --> repetitions that are new to the study --> the first that loses nothing and keeps `least`

A study takes the best of many, which may fit only the few machines it was tried on. So the promised margin comes from
machines that had no part in the choice. A setting is dropped at the first failure.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from isel_twin.base.crew import Crew, Stop
from isel_twin.jobs.robust import perturbation
from isel_twin.jobs.uncertain import Band, band
from isel_twin.language import MoveSettings
from isel_twin.many.tuning.judge import Judgement, Weather, repeated
from isel_twin.many.tuning.space import Candidate, Problem

ALONE = 5  # per cent of the repetitions with less than the margin `nearly_all`
PUT_TOGETHER = -1  # in place of the number of a trial: its moves are from several trials


@dataclass(frozen=True)
class Tried:
    number: int
    values: Mapping[str, int]  # of the parameters of the problem
    judgement: Judgement


@dataclass(frozen=True)
class Held:
    """Result of a setting on machines that are new to the study."""

    made: int  # number of repetitions; the first failure ends them
    margin: float  # least of all
    nearly_all: float  # margin of all but ALONE per cent of them
    last: Judgement
    why: str = ""  # what was wrong in the last one

    @property
    def good(self) -> bool:
        return not self.why

    @property
    def lost(self) -> int:
        """Number of failed repetitions, without those with only too little margin."""
        return int(not self.last.good)


@dataclass(frozen=True)
class Tuned:
    tried: Tried
    candidate: Candidate
    held: Held
    permanent: tuple[str, ...]  # lines that make its ramps, those of the most careful move, its own (many/6)
    kept: MoveSettings  # the stored settings; the speed is in the job
    may_be: tuple[Band, ...] = ()  # time and margin, as far as the machine is known


def front(tried: Sequence[Tried]) -> list[Tried]:
    """Trials that no other beats in both time and margin, the fastest first; the first of equals."""
    best: list[Tried] = []
    for each in sorted(tried, key=lambda one: (one.judgement.time_s, -one.judgement.margin, one.number)):
        if each.judgement.good and (not best or each.judgement.margin > best[-1].judgement.margin):
            best.append(each)
    return best


def to_confirm(tried: Sequence[Tried], least: float) -> list[Tried]:
    """Trials that lost nothing and kept the margin, the fastest first: those of the front, and what is next to each
    of them where it does not hold on other machines."""
    good = (each for each in tried if each.judgement.good and each.judgement.margin >= least)
    return sorted(good, key=lambda one: (one.judgement.time_s, -one.judgement.margin, one.number))


def confirm(
    problem: Problem,
    candidate: Candidate,
    wanted: int,
    least: float = 0.0,
    crew: Crew | None = None,
    stop: Stop | None = None,
    told: Callable[[Judgement], None] | None = None,
    hard: Sequence[int] = (),
) -> Held | None:
    """Make a job `wanted` times on machines that are new to the study; otherwise as `repeated`. hard: repetitions to
    make first, at which others have failed."""
    those = range(problem.repetitions + 1, problem.repetitions + 1 + wanted)
    numbers = [*(number for number in hard if number in those), *(number for number in those if number not in hard)]
    made = repeated(candidate, Weather.of(problem), numbers, least, crew, stop, told)
    if not made:
        return None
    last = made[-1]
    little = f"keeps {100 * last.margin:.1f} %, repetition {last.number}" if last.margin < least else ""
    margins = sorted(each.margin for each in made)
    return Held(len(made), margins[0], margins[len(margins) * ALONE // 100], last, last.why or little)


def tuned(problem: Problem, tried: Tried, held: Held) -> Tuned:
    """A setting with all that is needed to transfer it."""
    settings = problem.settings(tried.values).values()
    kept = MoveSettings(
        speed_hz=max(each.speed_hz for each in settings),
        acceleration_hz_per_ms=min(each.acceleration_hz_per_ms for each in settings),
        start_stop_hz=min(each.start_stop_hz for each in settings),
    )
    permanent = tuple(problem.language.permanent(kept))
    return Tuned(tried, problem.candidate(tried.values), held, permanent, kept)


def may_be(
    problem: Problem, candidate: Candidate, as_it_is: Judgement, crew: Crew | None = None, stop: Stop | None = None
) -> tuple[Band, ...]:
    """Bands of time and margin of a job on the machines that this one may be; none if stopped, or if it fails there."""
    made = repeated(candidate, Weather.of(problem), problem.may_be, 0.0, crew, stop)
    if not made or made[-1].why:
        return ()
    call = problem.call
    drawn = [perturbation(call.fitted(), call.seed, -one.number, "known")[1] for one in made]
    outcomes = (("time", "s", as_it_is.time_s), ("margin", "", as_it_is.margin))
    values = ([one.time_s for one in made], [one.margin for one in made])
    return tuple(band(*of, drawn, each) for of, each in zip(outcomes, values, strict=True) if len(made) > 1)


def gain(now_s: float, before_s: float) -> float:
    """Saved part of the time."""
    return 1.0 - now_s / before_s if before_s > 0.0 else 0.0


def as_json(judgement: Judgement) -> dict[str, Any]:
    return {
        "good": judgement.good,
        "time_s": round(judgement.time_s, 6),
        "margin": round(judgement.margin, 4),
        "torque": [round(judgement.torque, 4), round(judgement.weakest, 4)],
        "why": judgement.why,
        "repetitions": judgement.repetitions,
        **({"line": judgement.line} if judgement.line else {}),
    }
