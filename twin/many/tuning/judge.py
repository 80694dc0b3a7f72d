"""One setting, judged: the job on the machine as it is, and on others of its kind, until something is wrong.

    repetition 0      the machine as it is          time, from the first move to the end of the last line
    repetition n      `isel_twin.jobs.robust`: other power-on position, supply, friction, masses and payload

The same numbers are the same machines for every setting (common random numbers), so that two settings differ by what
they are and not by the weather they met. The first lost step ends the repetition and the judgement: what is lost stays
lost, and the rest of the job would tell nothing.

    margin of a setting = the least pull-out margin of any motor, in any line from the first move on, in any repetition
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Executor, Future
from dataclasses import dataclass
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.units import SECOND_NS
from isel_twin.jobs.job import Result, play
from isel_twin.jobs.robust import POLL_S, given_up, perturbed_twin
from isel_twin.jobs.verdict import judge, lost
from isel_twin.many.tuning.space import Candidate, Problem

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin

Stop = Callable[[], bool]
Made = TypeVar("Made")


@dataclass(frozen=True)
class Weather:
    """Where jobs are made: what is the same for all settings. Goes to other processes."""

    call: TwinSpec
    timeout_s: float
    flash: bytes | None

    @classmethod
    def of(cls, problem: Problem) -> Weather:
        """That of a problem."""
        return cls(problem.call, problem.timeout_s, problem.flash)


@dataclass(frozen=True)
class Repetition:
    """A job made once."""

    number: int
    time_s: float
    """From the first move to the end of the last line that was made."""
    margin: float
    """Least of all motors from the first move on; 0 if anything is wrong."""
    why: str = ""
    """What is wrong, with the line; nothing if all is well."""
    slipped: bool = False
    """It is that steps were lost."""
    moves: tuple[tuple[float, float], ...] = ()
    """Time and margin of each move that was made, the one in which anything went wrong the last."""


@dataclass(frozen=True)
class Judgement:
    """What is known of a setting."""

    time_s: float
    """On the machine as it is."""
    margin: float
    """Least of all repetitions; 0 if anything is wrong."""
    why: str = ""
    """What is wrong, with line and repetition; nothing if all is well."""
    repetitions: int = 0
    """That were made, the machine as it is among them."""
    slipped: bool = False
    """What is wrong is that steps were lost."""
    moves: tuple[tuple[float, float], ...] = ()
    """Time of each move on the machine as it is, and its least margin in all repetitions. If anything is wrong, it was
    in the last of these moves."""

    @property
    def good(self) -> bool:
        """Nothing is wrong."""
        return not self.why

    @classmethod
    def of(cls, made: Sequence[Repetition]) -> Judgement:
        """From repetitions, the machine as it is first."""
        wrong = next((each for each in made if each.why), None)
        why = ""
        if wrong is not None:
            why = f"{wrong.why}{f', repetition {wrong.number}' if wrong.number else ''}"
        slipped = wrong is not None and wrong.slipped
        margin = min(each.margin for each in made)
        each_move = zip(*(each.moves for each in made), strict=False)  # as far as all of them came
        moves = tuple((move[0][0], min(margin for _, margin in move)) for move in each_move)
        return cls(made[0].time_s, margin, why, len(made), slipped, moves)


def make(candidate: Candidate, weather: Weather, number: int, stop: Stop | None = None) -> Repetition | None:
    """Make a job once, None if it was stopped; a function of its arguments alone, so it can run in another process."""
    stop = stop or given_up
    twin = _twin(weather, number)
    results: list[Result] = []
    why = ""
    for result in play(twin, candidate.lines, weather.timeout_s, stop):
        results.append(result)
        if why := _lost(twin):
            break
    if stop():
        return None
    slipped = bool(why)
    if not why:
        verdict = judge(twin, results, len(candidate.lines) - len(results))
        if not verdict.ok:
            slipped = any(verdict.lost) or any(verdict.halfway) or any(verdict.switched_off)
            why = (
                _wrong(results) or _lost(twin) or ("a rotor rests halfway" if slipped else "the controller is in error")
            )
    if why:
        why = f"line {results[-1].number}: {why}"
    counted = [result for result in results if result.number >= candidate.first]
    margins = [margin for result in counted for margin in result.margin if margin is not None]
    time_s = (counted[-1].end_ns - counted[0].time_ns) / SECOND_NS if counted else 0.0
    moves = tuple(
        ((result.end_ns - result.time_ns) / SECOND_NS, min((m for m in result.margin if m is not None), default=0.0))
        for result in results
        if result.number in candidate.moves
    )
    return Repetition(number, time_s, 0.0 if why else min(margins, default=0.0), why, slipped, moves)


def _twin(weather: Weather, number: int) -> Twin:
    if number:
        return perturbed_twin(weather.call, number, weather.flash)[0]
    return weather.call.with_(flash=weather.flash).build()


def _lost(twin: Twin) -> str:
    """What has been lost up to the end of a line; a servo drive that has switched itself off counts as that."""
    gone = lost(twin.lost_steps, twin.slip_steps) | (twin.forgotten_steps != 0.0)
    steps = np.abs(twin.lost_steps) + np.abs(twin.forgotten_steps)
    found = [f"{AXIS_NAMES[axis].upper()} has lost {steps[axis]:.0f} steps" for axis in np.flatnonzero(gone)]
    found += [f"{name.upper()}: {why}" for name, (n, why) in zip(AXIS_NAMES, twin.drive_faults, strict=False) if n]
    return ", ".join(found)


def _wrong(results: Sequence[Result]) -> str:
    last = results[-1]
    if not last.complete:
        return f"{last.command} is not over in time"
    wrong = next((result for result in results if not result.ok), None)
    return "" if wrong is None else f"{wrong.command} (line {wrong.number}): {wrong.shown_reply or 'no reply'}"


def judged(
    candidate: Candidate, weather: Weather, numbers: Sequence[int], least: float = 0.0, stop: Stop | None = None
) -> Judgement | None:
    """Make a job with these repetitions, in their order, until one is wrong or keeps less than this margin.

    None if it was stopped.
    """
    made = []
    for number in numbers:
        repetition = make(candidate, weather, number, stop)
        if repetition is None:
            return None
        made.append(repetition)
        if repetition.why or repetition.margin < least:
            break
    return Judgement.of(made)


def repetitions(
    candidate: Candidate, weather: Weather, numbers: Sequence[int], executor: Executor | None, stop: Stop | None
) -> Iterator[Repetition | None]:
    """Repetitions of a job in their order, whatever makes them; those that nobody asks for any more are not begun."""
    if executor is None:
        yield from (make(candidate, weather, number, stop) for number in numbers)
        return
    futures = [executor.submit(make, candidate, weather, number) for number in numbers]
    try:
        for future in futures:
            yield waited_for(future, stop)
    finally:
        for future in futures:
            future.cancel()


def waited_for(future: Future[Made], stop: Stop | None) -> Made | None:
    """What a future gives, None if it is to be waited for no longer."""
    while stop is None or not stop():
        try:
            return future.result(None if stop is None else POLL_S)
        except TimeoutError:
            if future.done():
                raise
    return None
