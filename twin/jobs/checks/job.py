"""Checks of a job: findings that name the rule, the line and the moment.

One function plays a job and collects all findings, so that a terminal, an XML file and an annotation in a review say
the same.

    job, machine, bounds  --- check_job --->  Report: findings (rules.py), each with rule, line of the job, virtual time

A reference run strikes switches and sets counters, so `switch` ignores lines that set a counter; a switch that stays
struck is reported once.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.jobs.checks.contour import Contour, Drawing, Way
from isel_twin.jobs.checks.findings import expected, of_answer, of_verdict, placed, repeated
from isel_twin.jobs.checks.machining import Machining, MachiningMark
from isel_twin.jobs.checks.rules import (
    NO_PHYSICS,
    RULES,
    Bounds,
    Finding,
    farthest,
    few,
    of_edge,
    of_margin,
)
from isel_twin.jobs.golden import Golden, Scribe, called, differences, golden_file, load
from isel_twin.jobs.job import Line
from isel_twin.jobs.playing import Played, played
from isel_twin.jobs.result import Result
from isel_twin.jobs.verdict import Verdict, lost, whole_slips

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.toolpaths import Source

LOOK_NS = 5 * MILLISECOND_NS  # sampling interval of the deviation


@dataclass(frozen=True)
class Report:
    """The outcome of a job and its findings."""

    job: str
    findings: tuple[Finding, ...]
    verdict: Verdict
    golden: Golden  # the run, without its call; empty if nobody asked for it
    blind: Mapping[str, str] = field(default_factory=dict)  # rules that this run cannot judge, and why

    def outcome(self, rule: str, bounds: Bounds) -> str:
        """Outcome of a rule in words. "ok": it was asked for, it was measured, and nothing was found."""
        if number := sum(finding.rule == rule for finding in self.findings):
            return f"{number} finding{'' if number == 1 else 's'}"
        if rule == "golden":
            return "ok" if self.golden.call else "not asked"
        if bounds.limit(rule) is None or (rule == "unmet" and not self.verdict.expectations):
            return "not asked"
        if rule in self.blind:
            return f"not looked at: {self.blind[rule]}"
        return f"ok as far as made: {self.verdict.part}" if self.verdict.part else "ok"

    @property
    def ok(self) -> bool:
        """True without findings other than warnings."""
        return all(finding.warning for finding in self.findings)

    @property
    def unseen(self) -> tuple[str, ...]:
        """Lines that were not made, the rest of a job that did not end, and rules that were not simulated."""
        rules = () if self.verdict.physics else tuple(name for name, rule in RULES.items() if rule.physics)
        rest = f"the whole job ({self.verdict.part})" if self.verdict.part else ""
        return (*filter(None, (self.verdict.not_made, rest)), *rules)

    def without(self, not_made: str) -> Report:
        """The report on a part of a file."""
        return replace(self, verdict=replace(self.verdict, not_made=not_made))

    def compared(self, was: Golden, now: Golden) -> Report:
        """The report with the differences from a golden run as findings; now: this run with its call."""
        found = [Finding("golden", each.what, each.line) for each in differences(was, now)]
        return replace(self, golden=now, findings=few([*self.findings, *found]))


class _Watch:
    """Observes a twin during a job: struck switches and the largest deviation, line by line."""

    def __init__(self, twin: Twin, bounds: Bounds, machining: Machining) -> None:
        self._twin, self._machining = twin, machining
        self._ends = frozenset(switch.name for switch in twin.machine.switches)
        self._struck = self._now_struck()
        self._may = self._ends if "all" in bounds.may_strike else frozenset(bounds.may_strike)
        self._most_mm = bounds.deviation_mm
        self.contour: Contour | None = None
        self.begin()
        # switches are observed at each change
        still = bounds.deviation_mm is None and bounds.contour_mm is None
        twin.observe(self._look, None if still else LOOK_NS)

    def begin(self) -> None:
        self.struck: dict[str, int] = {}  # when each switch was struck in this line
        self._worst_mm = np.zeros(len(CARRIAGES))
        self._worst_ns = [0] * len(CARRIAGES)
        if self.contour is not None:
            self.contour.begin()

    def _now_struck(self) -> set[str]:
        return {name for name, state in self._twin.inputs.items() if name in self._ends and state == "struck"}

    def _look(self, twin: Twin) -> None:
        struck = self._now_struck()
        for name in struck - self._struck - self._may:
            self.struck.setdefault(name, twin.time_ns)
        self._struck = struck
        self._machining.look(twin)
        if self._most_mm is not None:
            error_mm = np.abs(twin.position_error_mm)
            for i in np.flatnonzero(error_mm > self._worst_mm):
                self._worst_mm[i], self._worst_ns[i] = error_mm[i], twin.time_ns
        if self.contour is not None:
            self.contour.look(twin.position_mm, twin.time_ns)

    def findings(self, result: Result, counter_set: bool) -> list[Finding]:
        """Findings of the line that has just ended. Setting a counter makes earlier deviations meaningless."""
        if counter_set:
            if self.contour is not None:
                self.contour.restart()
            return []
        found = [
            Finding("switch", f"{name} is struck", result.number, time_ns)
            for name, time_ns in sorted(self.struck.items(), key=lambda item: item[1])
        ]
        if self._most_mm is not None:
            off = f"mm off; at most {self._most_mm:g} mm"
            found += [
                Finding(
                    "deviation",
                    f"{name} is {worst:.3f} {off}{_lag(self._twin, name)}",
                    result.number,
                    time_ns,
                    about=name,
                    off=worst,
                )
                for name, worst, time_ns in zip(CARRIAGES, self._worst_mm, self._worst_ns, strict=True)
                if worst > self._most_mm
            ]
        return [*found, *self._off_the_path(result)]

    def _off_the_path(self, result: Result) -> Iterator[Finding]:
        if self.contour is None:
            return
        for line, worst_mm, time_ns in self.contour.found():
            off = f"{worst_mm:.3f} mm off what the file draws; at most {self.contour.most_mm:g} mm"
            program = (line, 1) if result.parts else None
            yield Finding("contour", off, result.number if program else line, time_ns, program, off=worst_mm)


def _lag(twin: Twin, name: str) -> str:
    """What a servo axis is behind by its nature; "" for a stepper."""
    axis = twin.machine.axes[CARRIAGES.index(name)]
    if not isinstance(axis.stage, ServoDrive):
        return ""
    lag_s = axis.stage.lag_s
    return f" (a servo of its gain follows by {1e3 * lag_s:.4g} ms: {lag_s:.4g} mm for each mm/s)"


@dataclass(frozen=True)
class Mark:
    """How much an `Inspection` has collected; lines before it keep what they have."""

    results: int
    findings: int
    moves: int
    gone: tuple[bool, ...]  # axes that have lost steps
    way: Way  # along the path of the file
    machining: MachiningMark


class Inspection:
    """Follows a job on a twin line by line, from before the first, and collects findings."""

    def __init__(self, twin: Twin, bounds: Bounds | None = None, *, golden: bool = True) -> None:
        """golden: take down the digests of the run, to be compared, which takes as long as a job without physics."""
        self.twin = twin
        self.bounds = bounds or Bounds()
        self.results: list[Result] = []
        self._machining = Machining(twin, self.bounds)
        self._watch = _Watch(twin, self.bounds, self._machining)
        if self.bounds.clearance is not None:
            twin.watch_clearance()
        self._scribe = Scribe(twin) if golden else None
        self._findings: list[Finding] = []
        self._gone = np.zeros(len(twin.counts), dtype=np.bool_)
        self.setting: set[int] = set()  # numbers of the lines that set a counter, such as reference runs
        self._follow()

    def _follow(self) -> None:
        """What the twin has counted up to now has been told."""
        self._met = len(self.twin.collisions)
        self._faults = [number for number, _ in self.twin.drive_faults]
        self._unpowered = int(self.twin.unpowered_steps.sum())
        self._made = self.twin.steps.made
        self._expected = np.array(self.twin.counts)

    def mark(self) -> Mark:
        """Where it is between two lines."""
        contour = self._watch.contour
        way = Way() if contour is None else contour.way
        moves = 0 if self._scribe is None else len(self._scribe.moves)
        return Mark(
            len(self.results), len(self._findings), moves, tuple(self._gone.tolist()), way, self._machining.mark()
        )

    def back(self, mark: Mark, lines: Mapping[int, int]) -> None:
        """Go on from a mark, with the twin in the state that it had then, after a line or more. lines: numbers of the
        lines before it now, by those that they had."""
        self.results[:] = [replace(one, number=lines[one.number]) for one in self.results[: mark.results]]
        self._findings[:] = [replace(one, line=one.line and lines[one.line]) for one in self._findings[: mark.findings]]
        if self._scribe is not None:
            self._scribe.back(mark.moves, lines)
        self.setting = {lines[number] for number in self.setting if number in lines}
        self._gone = np.array(mark.gone, dtype=np.bool_)
        self._machining.back(mark.machining, lines)
        self._watch.begin()
        if self._watch.contour is not None:
            self._watch.contour.restart(mark.way)
        self._follow()

    def draw(self, drawn: Drawing | None) -> None:
        """The path of the file, between two lines, which lead as far along it as along the one before; None: it is no
        file of a CAM program."""
        self._machining.draw(drawn)
        bound_mm, before = self.bounds.contour_mm, self._watch.contour
        nothing = drawn is None or not len(drawn.cuts)
        self._watch.contour = None if drawn is None or nothing or bound_mm is None else Contour(drawn, bound_mm)
        if self._watch.contour is not None and before is not None:
            self._watch.contour.restart(before.way)

    def take(self, result: Result) -> None:
        twin, bounds = self.twin, self.bounds
        self.results.append(result)
        self._findings += of_answer(result, bounds)
        unpowered = int(twin.unpowered_steps.sum())
        if unpowered > self._unpowered:
            made = f"{unpowered - self._unpowered} steps are made while the stages have no power"
            self._findings.append(Finding("unpowered", made, result.number, result.end_ns))
        self._unpowered = unpowered
        if self._scribe is not None:
            self._scribe.take(result)
        steps = twin.steps
        counter_set = bool((np.array(result.counts) != self._expected + steps.since(self._made)).any())
        self._expected, self._made = np.array(result.counts), steps.made
        if counter_set:
            self.setting.add(result.number)
        self._machining.take(result, steps, counter_set)
        self._findings += self._watch.findings(result, counter_set)
        self._watch.begin()
        self._findings += of_margin(result, bounds)
        self._findings += of_edge(result, bounds)
        now = lost(twin.lost_steps, twin.slip_steps) & twin.idle
        gone = np.copysign(whole_slips(twin.lost_steps, twin.slip_steps), twin.lost_steps)
        self._findings += [
            Finding("lost", f"{AXIS_NAMES[i]} has lost {gone[i]:.0f} steps", result.number, result.end_ns)
            for i in np.flatnonzero(now & ~self._gone)
        ]
        self._gone |= now
        faults = [number for number, _ in twin.drive_faults]
        self._findings += [
            Finding("drive", f"{AXIS_NAMES[i]}: {cause}", result.number, result.end_ns)
            for i, (number, cause) in enumerate(twin.drive_faults)
            if number > self._faults[i]
        ]
        self._faults = faults
        self._findings += self._collisions(result.number)

    def _collisions(self, line: int | None) -> list[Finding]:
        """Those that nobody has been told of."""
        new, self._met = self.twin.collisions[self._met :], len(self.twin.collisions)
        return [Finding("collision", str(collision), line, collision.time_ns) for collision in new]

    def _clearance(self) -> list[Finding]:
        """Bodies that came too near to each other; if they met, that has been told."""
        bound, found = self.bounds.clearance, self.twin.clearance
        if bound is None or found is None or not 0.0 < found.apart_mm < bound:
            return []
        lines = [one.number for one in self.results if not one.condition and one.time_ns < found.time_ns]
        return [Finding("clearance", f"{found}; at least {bound:g} mm", lines[-1] if lines else None, found.time_ns)]

    def report(
        self, job: str, verdict: Verdict, others: Sequence[Finding] = (), cautions: Sequence[Finding] | None = None
    ) -> Report:
        """The report at the end of the job. cautions: what its file may mean otherwise, None for no file of a CAM
        program; others: further findings."""
        findings = [finding for finding in self._findings if not expected(finding, verdict, self.results)]
        findings += [*self._collisions(self.results[-1].number if self.results else None), *self._clearance()]
        findings += [*of_verdict(verdict, self._gone, self.results, self.bounds), *others]
        if self.bounds.contour_mm is not None and self._watch.contour is None:
            findings.append(Finding("effect", "contour_mm has no effect: no file of a CAM program, or none that cuts"))
        if self.bounds.clearance is not None and self.twin.clearance is None:
            findings.append(
                Finding("effect", "clearance has no effect: nothing is clamped that could be met ([[fixture]])")
            )
        told = [
            *(placed(finding, self.results) for finding in findings),
            *(cautions or ()),
            *self._machining.findings(),
        ]
        if self.bounds.strict:
            told = [replace(finding, strict=True) for finding in told]
        golden = Golden() if self._scribe is None else self._scribe.golden(verdict)
        return Report(job, few(farthest(told)), verdict, golden, self._blind(verdict, cautions))

    def _blind(self, verdict: Verdict, cautions: Sequence[Finding] | None) -> dict[str, str]:
        twin, bounds = self.twin, self.bounds
        if verdict.physics:
            blind = {} if verdict.least_margin is not None else {"margin": "no motor has turned"}
            if verdict.least_edge is None:
                blind["edge"] = blind.get("margin", "no motor has turned that has a limit of its swing")
        else:
            blind = {
                name: NO_PHYSICS for name, rule in RULES.items() if rule.physics and bounds.limit(name) is not None
            }
        servos = [isinstance(axis.stage, ServoDrive) for axis in twin.machine.axes]
        if all(servos):
            blind |= dict.fromkeys(("lost", "halfway", "edge"), "no stepper motor")
        if not any(servos):
            blind["drive"] = "no servo drive"
        met = {"collision": twin.may_collide, "clearance": twin.clearance is not None}
        blind |= {name: "nothing is clamped that could be met" for name, can in met.items() if not can}
        if cautions is None:
            blind["caution"] = "no file of a CAM program"
        bound = [name for name in RULES if bounds.limit(name) is not None and Bounds().limit(name) is None]
        if twin.origin.scenario is None and not bound:
            blind["effect"] = "no scenario, no bound"
        if self._watch.contour is None:
            blind["contour"] = "no file of a CAM program that cuts"
        return blind | self._machining.blind


def beside_golden(report: Report, job: Path, call: TwinSpec, source: Source | None) -> Report:
    """The report with the differences from the golden run of the job, if it has one. Raises GoldenError, OSError."""
    file = golden_file(job)
    if not file.is_file():
        return report
    zero = None if source is None else source.zero
    return report.compared(load(file), called(report.golden, call, job, file, zero))


def check_job(
    job: Path,
    call: TwinSpec,
    lines: Sequence[Line],
    bounds: Bounds | None = None,
    begun: Callable[[Inspection], None] | None = None,
    drawn: Drawing | None = None,
    cautions: Sequence[Finding] | None = None,
    *,
    golden: bool = True,
) -> Report:
    """Play a job on a twin of its own and report findings; `Report.compared` adds differences from a golden run.

    begun: called with the inspection before the first line. drawn: what a file of a CAM program draws; cautions: what
    it may mean otherwise. golden: as for `Inspection`. Raises CallError for a call that cannot be carried out.
    """
    inspection = Inspection(call.build(), bounds, golden=golden)
    inspection.draw(drawn)
    if begun is not None:
        begun(inspection)
    verdict = played(inspection.twin, lines, [inspection.take], inspection.bounds.timeout_s).verdict
    others = repeated(call, lines, Played(tuple(inspection.results), verdict), inspection.bounds)
    return inspection.report(str(job), verdict, others, cautions)
