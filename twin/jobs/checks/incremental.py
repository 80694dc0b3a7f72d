"""A job checked again and again while somebody changes it: only from the last saved state before the change on.

    lines of the first text    | a | b | c | d | e | f | g | h |
    saved states                       ^       ^       ^   ^            before a line; at most MOST, thinned out
    lines of the next one      | a | b | c | d | e | X | g | h |
                                               |---------------|        played; what is known of a .. d stays

The report is that of a fresh check, to the bit (jobs/8): a twin that is restored goes on as the one that was saved, and
what was found before it is only given the new numbers of its lines. A line is what it sends and expects, so that
comments and empty lines cost nothing but the last line.

With a bound for the clearance every job is played from its beginning: what is nearest is looked for along the whole
way. So is one that is a single line, such as a program of the controller's own.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from isel_twin.base.crew import GivenUp, Stop, given_up
from isel_twin.core.spec import TwinSpec
from isel_twin.core.state import StateError, TwinState
from isel_twin.jobs.checks.contour import Drawing
from isel_twin.jobs.checks.findings import repeated
from isel_twin.jobs.checks.job import Inspection, Mark, Report
from isel_twin.jobs.checks.rules import Bounds, Finding
from isel_twin.jobs.job import JobError, Line, check_conditions
from isel_twin.jobs.playing import Played
from isel_twin.jobs.result import Result
from isel_twin.jobs.sending import ends_job, play
from isel_twin.jobs.verdict import judge

MOST = 64  # saved states of a job


@dataclass(frozen=True)
class _Saved:
    """The state before a line, which is not the first."""

    index: int
    twin: TwinState
    mark: Mark


class IncrementalCheck:
    """Checks one text of a job after the other, always with the same twin and bounds."""

    def __init__(self, job: Path, call: TwinSpec, bounds: Bounds, *, golden: bool = True) -> None:
        """call: without a flash file. golden: as for `Inspection`."""
        self.job, self.call, self.bounds, self._golden = job, call, bounds, golden
        self.played = 0  # lines that the last check has played
        self._inspection: Inspection | None = None
        self._used = False  # its twin has played
        self._lines: Sequence[Line] = ()  # those whose results are in it
        self._saved: list[_Saved] = []

    @property
    def results(self) -> Sequence[Result]:
        """Of the lines that were played in the last check or before it."""
        return () if self._inspection is None else self._inspection.results

    def check(
        self,
        lines: Sequence[Line],
        stop: Stop | None = None,
        drawn: Drawing | None = None,
        cautions: Sequence[Finding] | None = None,
    ) -> Report:
        """The report on these lines, as `check_job` makes it. stop: as for `play`; what was played until then is kept.

        Raises GivenUp if it was stopped, JobError for a condition on what this twin does not have, CallError.
        """
        try:
            return self._check(lines, stop, drawn, cautions)
        except (GivenUp, JobError):
            raise
        except BaseException:  # the twin stands in the middle of something
            self._inspection, self._saved = None, []
            raise

    def _check(
        self, lines: Sequence[Line], stop: Stop | None, drawn: Drawing | None, cautions: Sequence[Finding] | None
    ) -> Report:
        check_conditions(lines, (self._inspection or self._begin()).twin)
        numbers, changed = _alike(self._lines, lines)
        inspection, start = self._at(min(changed, len(lines) - 1), numbers)
        inspection.draw(drawn)
        try:
            self._play(inspection, lines, start, changed, stop)
        finally:
            self._lines = lines[: len(inspection.results)]
        self.played = len(inspection.results) - start
        verdict = judge(inspection.twin, inspection.results, len(lines) - len(inspection.results))
        others = repeated(self.call, lines, Played(tuple(inspection.results), verdict), self.bounds)
        return inspection.report(str(self.job), verdict, others, cautions)

    def _begin(self) -> Inspection:
        self._inspection, self._used = Inspection(self.call.build(), self.bounds, golden=self._golden), False
        return self._inspection

    def _at(self, index: int, numbers: Mapping[int, int]) -> tuple[Inspection, int]:
        """The inspection in the last saved state before this line or at it, and before which line that is."""
        inspection = self._inspection
        self._saved = [one for one in self._saved if one.index <= index]
        if inspection is None or (self._used and not self._saved):
            inspection = self._begin()
        if not self._saved:
            return inspection, 0
        last = self._saved[-1]
        inspection.twin.restore(last.twin)
        inspection.back(last.mark, numbers)
        return inspection, last.index

    def _play(self, inspection: Inspection, lines: Sequence[Line], start: int, changed: int, stop: Stop | None) -> None:
        """Play from this line to the end of the job. changed: the first line that is another, which may change again:
        so its state is saved, and that of the last line, after which jobs grow."""

        def ends() -> bool:
            return given_up() or (stop is not None and stop())

        self._used, twin = True, inspection.twin
        last = next((one for one in reversed(inspection.results) if not one.condition), None)
        results = play(twin, lines[start:], self.bounds.timeout_s, ends, last)
        apart, whole = max(1, len(lines) // MOST), self.bounds.clearance is not None
        for index in range(start, len(lines)):
            twin.forget_motions()
            before = self._saved[-1].index if self._saved else 0
            if index > before and (index - before >= apart or index in (changed, len(lines) - 1)) and not whole:
                self._save(index, inspection)
            result = next(results, None)
            if result is None or ends():
                raise GivenUp
            inspection.take(result)
            if ends_job(lines[index], result):
                return

    def _save(self, index: int, inspection: Inspection) -> None:
        """Save the state before a line; of too many the one goes whose neighbours are nearest to each other."""
        try:
            state = inspection.twin.save()
        except StateError:  # a controller that cannot be saved now: an earlier state will do
            return
        self._saved.append(_Saved(index, state, inspection.mark()))
        if len(self._saved) > MOST:
            gaps = [after.index - before.index for before, after in zip(self._saved, self._saved[2:], strict=False)]
            del self._saved[1 + gaps.index(min(gaps))]


def _alike(before: Sequence[Line], now: Sequence[Line]) -> tuple[dict[int, int], int]:
    """New numbers of the lines that are the same at the beginning of both, by their old ones; and how many these are.
    Lines of one number that have become lines of two are not the same."""
    numbers: dict[int, int] = {}
    for index, (old, new) in enumerate(zip(before, now, strict=False)):
        if _what(old) != _what(new) or numbers.setdefault(old.number, new.number) != new.number:
            return numbers, index
    return numbers, min(len(before), len(now))


def _what(line: Line) -> tuple[Any, ...]:
    """A line without its place. A program is known by its source."""
    return line.command, line.actions, line.expected, line.condition, line.source, line.places
