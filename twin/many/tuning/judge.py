"""Judges one setting: the job on the machine as it is, and on similar machines, until something is wrong.

    repetition 0      the machine as it is          time, from the first move to the end of the last line
    repetition n      another machine of the kind, of `isel_twin.jobs.robust`
    repetition -n     the n-th that this machine may be, as far as its numbers are known

Equal numbers mean equal machines for every setting (common random numbers), so that two settings differ only by
themselves. The first lost step ends the repetition and the judgement: the rest of the job would have no meaning.

    margin of a setting = the least of any motor, of torque and of speed, in any line from the first move on, in any
                          repetition
"""

from __future__ import annotations

import functools
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

from isel_twin.base.crew import Crew, Stop, in_order
from isel_twin.base.quiet import quietly
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.playing import FirstLoss, losses, played
from isel_twin.jobs.result import Result, least_band
from isel_twin.jobs.robust import perturbed_twin
from isel_twin.many.tuning.settling import Settling
from isel_twin.many.tuning.space import Candidate, Problem
from isel_twin.plant import PlantError

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec


@dataclass(frozen=True)
class Weather:
    """What is common to all settings; sent to other processes."""

    call: TwinSpec
    timeout_s: float
    flash: bytes | None
    speed_share: float = 1.0
    settle_mm: float | None = None

    @classmethod
    def of(cls, problem: Problem) -> Weather:
        """That of a problem."""
        return cls(problem.call, problem.timeout_s, problem.flash, problem.speed_share, problem.settle_mm)


LEAST = 0.001  # margin of a motor at or beyond a limit that has lost nothing


class Made(NamedTuple):
    """A move of a job that was made, and what the motors kept in it; 0 where steps were lost."""

    time_s: float
    torque: float  # least margin; of a servo drive that of its following error
    speed: float = 1.0  # least margin

    @property
    def margin(self) -> float:
        return min(self.torque, self.speed)


@dataclass(frozen=True)
class Judgement:
    """The outcome of a job with a setting, in one or several repetitions."""

    # from the first move (many/3) to the end of the last line that was made; with `settle_mm` until that one rings no
    # more, and those before; of the first repetition
    time_s: float
    margin: float  # least of all motors from the first move on, in all repetitions; 0 if anything is wrong
    why: str = ""  # what is wrong, with line and repetition; "" for nothing
    repetitions: int = 0  # number of repetitions made, including the machine as it is
    slipped: bool = False  # steps were lost
    # each move: its time in the first repetition, its least margins in all; the last one is the failing one
    moves: tuple[Made, ...] = ()
    number: int = 0  # of the last repetition
    # least margins of all motors in all repetitions, from the first move on
    torque: float = 1.0
    speed: float = 1.0
    line: str = ""  # of the first repetition: `Verdict.line_told`
    weakest: float = 1.0  # `torque` if the motors are as weak as their bands say (drives/bands.py); 0: none is left

    @property
    def good(self) -> bool:
        return not self.why

    @classmethod
    def of(cls, made: Sequence[Judgement]) -> Judgement:
        """The judgement of all these repetitions, of which only the last may have failed."""
        last = made[-1]
        margin = min(each.margin for each in made)
        each_move = zip(*(each.moves for each in made), strict=False)  # moves that all of them made
        moves = tuple(
            Made(move[0].time_s, min(one.torque for one in move), min(one.speed for one in move)) for move in each_move
        )
        kept = min(each.torque for each in made), min(each.speed for each in made)
        weakest = min(each.weakest for each in made)
        return cls(
            made[0].time_s, margin, last.why, len(made), last.slipped, moves, last.number, *kept, made[0].line, weakest
        )


def make(candidate: Candidate, weather: Weather, number: int) -> Judgement | None:
    """Make a job once; depends only on its arguments, so that it can run in another process. None for a repetition
    whose machine cannot be built."""
    if number:
        try:
            twin, _, _ = perturbed_twin(weather.call, abs(number), weather.flash, "kind" if number > 0 else "known")
        except ValueError:
            return None
    else:
        twin = weather.call.with_(flash=weather.flash).build()
    first = FirstLoss(twin)
    watchers: list[Callable[[Result], object]] = [first.take]
    settling = None if weather.settle_mm is None else Settling(twin, weather.settle_mm, candidate.moves)
    if settling is not None:
        watchers.append(settling.take)
    try:
        with quietly():
            job = played(twin, candidate.lines, watchers, weather.timeout_s, first.stop)
    except PlantError as error:  # a motor that stalls may shake an axis beyond what its time step can follow
        return Judgement(0.0, 0.0, str(error), 1, True, number=number)
    results, why, slipped = job.results, first.why, bool(first.why)
    if not why and not job.ok:
        verdict = job.verdict
        slipped = any(verdict.lost) or any(verdict.halfway) or any(verdict.switched_off)
        met = next(map(str, verdict.collisions), "")
        rest = met or ("the controller is in error" if verdict.fault_left else verdict.problems()[0])
        why = _wrong(results) or losses(twin) or rest
    if why:
        where = f", repetition {number}" if number > 0 else f", number {-number} of what this machine may be"
        why = f"line {results[-1].number}: {why}{where if number else ''}"
    counted = [result for result in results if result.number >= candidate.first]
    margins = [_kept(result, weather.speed_share) for result in counted]
    torque, speed = (min(kept, default=1.0) for kept in zip(*margins, strict=True)) if margins else (1.0, 1.0)
    rings_ns = {} if settling is None else settling.of_line_ns
    time_s = (counted[-1].end_ns - counted[0].time_ns) / SECOND_NS if counted else 0.0
    if settling is not None and counted:
        # the dwell after the last line stands behind its end
        behind_ns = settling.last_ns if counted[-1].number in rings_ns else 0
        time_s += (behind_ns - settling.spared_ns) / SECOND_NS
    moves = tuple(
        Made(
            (result.end_ns - result.time_ns + rings_ns.get(result.number, 0)) / SECOND_NS,
            *_kept(result, weather.speed_share),
        )
        for result in results
        if result.number in candidate.moves
    )
    margin = min(torque, speed) if counted and not why else 0.0
    ends = least_band([band for result in counted for band in result.margin_band])
    weakest = torque if ends is None else ends[0]
    return Judgement(time_s, margin, why, 1, slipped, moves, number, torque, speed, job.verdict.line_told, weakest)


def _kept(result: Result, speed_share: float) -> tuple[float, float]:
    """The least margins of a line: of torque, and of speed, as a motor with torque to spare may swing itself out of
    step. Never 0, which is of lost steps; 1 where nothing moves."""
    torque = (max(LEAST, margin) for margin in result.margin if margin is not None)
    speed = (max(LEAST, 1.0 - speed_share / edge) for edge in result.edge if edge is not None)
    return min(torque, default=1.0), min(speed, default=1.0)


def _wrong(results: Sequence[Result]) -> str:
    last = results[-1]
    if not last.complete:
        return f"{last.command} is not over in time"
    wrong = next((result for result in results if not result.ok), None)
    return "" if wrong is None else f"{wrong.command} (line {wrong.number}): {wrong.shown_reply or 'no reply'}"


def judged(
    candidate: Candidate, weather: Weather, numbers: Sequence[int], least: float = 0.0, stop: Stop | None = None
) -> Judgement | None:
    """As `repeated`, combined into one judgement."""
    made = repeated(candidate, weather, numbers, least, stop=stop)
    return None if made is None else Judgement.of(made)


def repeated(
    candidate: Candidate,
    weather: Weather,
    numbers: Sequence[int],
    least: float,
    crew: Crew | None = None,
    stop: Stop | None = None,
    told: Callable[[Judgement], None] | None = None,
) -> list[Judgement] | None:
    """Make a job with these repetitions, in order, until one fails or has less than this margin; those whose machine
    cannot be built are left out. None if stopped. told: called with each when it is over."""
    made: list[Judgement] = []
    over = 0
    for each in in_order(functools.partial(make, candidate, weather), numbers, crew, stop):
        over += 1
        if each is None:
            continue
        made.append(each)
        if told is not None:
            told(each)
        if each.why or each.margin < least:
            return made
    return made if over == len(numbers) else None
