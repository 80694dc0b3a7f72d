"""A job played to its end and judged.

    lines --- play ---> Result, Result, ...  --- judge --->  Played: results and verdict
                          |
                          `--> watchers: golden run, inspection, first loss, table, ...

Terms for the outcome of a job:

    Result    a line       number, command, reply, ok, why, time_ns, end_ns, margin     result.py
    Verdict   the machine  ok, refused, lost, unsent, interrupted, cycle_s, margin      verdict.py
    Played    the job      results, verdict                                             here
    Golden    as a file    call, moves, end                                             golden.py
    Finding   a violation  rule, message, line, time_ns                                checks/job.py
    Report    checked      findings, verdict, golden run                                checks/job.py
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.base.crew import GivenUp, Stop, given_up
from isel_twin.jobs.job import Line
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import play
from isel_twin.jobs.verdict import Verdict, judge, lost

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

TIMEOUT_S = 3600.0  # default virtual time that a line may take


@dataclass(frozen=True)
class Played:
    """The outcome of a job."""

    results: tuple[Result, ...]  # of the lines that were sent
    verdict: Verdict

    @property
    def ok(self) -> bool:
        return self.verdict.ok

    @property
    def whole(self) -> bool:
        """True if every line was sent and the last one was over."""
        return not self.verdict.unsent and bool(self.results) and self.results[-1].complete


def played(
    twin: Twin,
    lines: Sequence[Line],
    watchers: Sequence[Callable[[Result], object]] = (),
    timeout_s: float = TIMEOUT_S,
    stop: Stop | None = None,
    begins: Callable[[Line], object] | None = None,
    edges: bool = True,
) -> Played:
    """Play a job, let the machine come to rest, and judge.

    watchers: called in order with the result of each line. timeout_s: as for `play`. stop: called whenever something
    has happened; True ends the job, which is then judged as interrupted unless it was over. begins: called with each
    line before it is sent. edges: as for `play`. Raises GivenUp if the caller has cancelled this work before the job
    was over.
    """

    def ends() -> bool:
        return given_up() or (stop is not None and stop())

    return followed(twin, lines, play(twin, lines, timeout_s, ends, edges=edges), watchers, stop, begins)


def followed(
    twin: Twin,
    lines: Sequence[Line],
    results: Iterator[Result],
    watchers: Sequence[Callable[[Result], object]] = (),
    stop: Stop | None = None,
    begins: Callable[[Line], object] | None = None,
) -> Played:
    """As `played`, with given results instead of `play`; fewer than lines mean that the job ended early."""
    seen: list[Result] = []
    for line in lines:
        if begins is not None:
            begins(line)
        result = next(results, None)
        if result is None:
            break
        seen.append(result)
        for watcher in watchers:
            watcher(result)
    whole = len(seen) == len(lines) and all(result.complete for result in seen[-1:])
    if not whole and given_up():
        raise GivenUp
    interrupted = not whole and stop is not None and stop()
    return Played(tuple(seen), judge(twin, seen, len(lines) - len(seen), interrupted))


class FirstLoss:
    """A watcher that finds the first line after which steps are lost; `stop` then ends the job."""

    def __init__(self, twin: Twin) -> None:
        self._twin = twin
        self.why = ""  # what is lost; "" for nothing

    def take(self, result: Result) -> None:
        self.why = self.why or losses(self._twin)

    def stop(self) -> bool:
        return bool(self.why)


def out_of_step(twin: Twin) -> tuple[int, ...]:
    """Axes that have lost steps so far, or whose servo drive has switched itself off."""
    off = {axis for axis, (number, _) in enumerate(twin.drive_faults) if number}
    return tuple(sorted(off.union(_gone(twin))))


def losses(twin: Twin) -> str:
    """What is lost so far, in words; a servo drive that has switched itself off counts as a loss."""
    steps = np.abs(twin.lost_steps) + np.abs(twin.forgotten_steps)
    found = [f"{AXIS_NAMES[axis].upper()} has lost {steps[axis]:.0f} steps" for axis in _gone(twin)]
    found += [f"{name.upper()}: {why}" for name, (n, why) in zip(AXIS_NAMES, twin.drive_faults, strict=False) if n]
    return ", ".join(found)


def _gone(twin: Twin) -> list[int]:
    gone = lost(twin.lost_steps, twin.slip_steps) | (twin.forgotten_steps != 0.0)
    return [int(axis) for axis in np.flatnonzero(gone)]
