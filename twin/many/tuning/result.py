"""The fastest setting that holds, and how it is brought back to the real controller.

    front, fastest first --> repetitions that the study has not seen --> the first that loses nothing and keeps `least`

A study takes the best of many; what is best on a few machines may owe it to them. So the margin that is promised comes
from machines on which nothing was chosen. A setting is given up at the first that goes wrong.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from isel_twin.base.crew import Crew, Stop
from isel_twin.language import MoveSettings
from isel_twin.many.tuning.judge import Judgement, Weather, repeated
from isel_twin.many.tuning.space import Candidate, Problem

ALONE = 5  # per cent of the repetitions that may have kept less than the margin that nearly all keep
PUT_TOGETHER = -1  # in place of the number of a trial: no trial was made of it, its moves are from several


@dataclass(frozen=True)
class Tried:
    number: int
    values: Mapping[str, int]  # of the parameters of the problem
    judgement: Judgement


@dataclass(frozen=True)
class Held:
    """How a setting did on machines that the study has not seen."""

    made: int  # repetitions; the first that goes wrong ends them
    margin: float  # least of all
    nearly_all: float  # margin that all but ALONE per cent of them keep
    last: Judgement
    why: str = ""  # what was wrong in the last one

    @property
    def good(self) -> bool:
        return not self.why

    @property
    def lost(self) -> int:
        """Repetitions in which something was wrong, and not only little margin."""
        return int(not self.last.good)


@dataclass(frozen=True)
class Tuned:
    tried: Tried
    candidate: Candidate
    held: Held
    permanent: tuple[str, ...]  # lines that make its ramps, those of the most careful move, its own (many/6)
    kept: MoveSettings  # what these make permanent; its speed stands in the job


def front(tried: Sequence[Tried]) -> list[Tried]:
    """Trials of which none else is both faster and has more margin, the fastest first; of equals the first."""
    best: list[Tried] = []
    for each in sorted(tried, key=lambda one: (one.judgement.time_s, -one.judgement.margin, one.number)):
        if each.judgement.good and (not best or each.judgement.margin > best[-1].judgement.margin):
            best.append(each)
    return best


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
    """Make a job `wanted` times on machines that no trial has seen; otherwise as `repeated`. hard: repetitions that go
    first, as others have failed there."""
    those = range(problem.repetitions + 1, problem.repetitions + 1 + wanted)
    numbers = [*(number for number in hard if number in those), *(number for number in those if number not in hard)]
    made = repeated(candidate, Weather.of(problem), numbers, least, crew, stop, told)
    if made is None:
        return None
    last = made[-1]
    little = f"keeps {100 * last.margin:.1f} %, repetition {last.number}" if last.margin < least else ""
    margins = sorted(each.margin for each in made)
    return Held(len(made), margins[0], margins[len(margins) * ALONE // 100], last, last.why or little)


def tuned(problem: Problem, tried: Tried, held: Held) -> Tuned:
    """A setting with what is needed to bring it back."""
    settings = problem.settings(tried.values).values()
    kept = MoveSettings(
        speed_hz=max(each.speed_hz for each in settings),
        acceleration_hz_per_ms=min(each.acceleration_hz_per_ms for each in settings),
        start_stop_hz=min(each.start_stop_hz for each in settings),
    )
    permanent = tuple(problem.language.permanent(kept))
    return Tuned(tried, problem.candidate(tried.values), held, permanent, kept)


def gain(now_s: float, before_s: float) -> float:
    """Part of the time that is saved."""
    return 1.0 - now_s / before_s if before_s > 0.0 else 0.0


def as_json(judgement: Judgement) -> dict[str, Any]:
    return {
        "good": judgement.good,
        "time_s": round(judgement.time_s, 6),
        "margin": round(judgement.margin, 4),
        "why": judgement.why,
        "repetitions": judgement.repetitions,
    }
