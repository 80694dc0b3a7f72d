"""Checks of a job: findings that name the rule, the line and the moment.

One function plays a job and collects all findings, so that a terminal, an XML file and an annotation in a review say
the same.

    job, machine, bounds  --- check_job --->  Report: findings, each with rule, line of the job, virtual time

    rule          it is broken when                                                       bound
    refused       a command is refused, or its reply is not what the job expects          always
    restart       the controller starts anew before the last reply                        always
    unmet         a condition of the job (`! lost == 0`) is false                         always
    unfinished    a command is not over in time; the job ends there                       `timeout`
    collision     two bodies meet that must not: cutter and vise (docs/machines.md)       always
    clearance     two bodies that must not meet come nearer to each other                 `clearance`
    unpowered     steps are made while the stages have no power                           always
    lost          an axis has lost steps; with the first line after which it had          always
    halfway       a rotor rests between two stable places                                 always
    drive         a servo drive has switched itself off; with the line, or rests short     always
                  of its command
    switch        an end switch is struck in a line that sets no counter, and no          `may_strike`
                  condition of the job (`! limit_x1 == struck`) expects it
    fault         the controller shows an error at the end, or its flash is damaged       always
    margin        the least pull-out margin of a motor in a line                          `margin`
    edge          a motor turns faster than the speed from which on it swings, over this   `edge`
    deviation     true position and counter differ by more, sampled every 5 ms            `deviation_mm`
    cycle         first command to end of the last one takes longer                       `cycle_s`
    golden        the run differs from the golden run of the job, if it has one           `golden`
    luck          repetitions on slightly different machines end differently              `robust`
    odd           a line is legal and absurd: a move that crawls (a warning)               always
    effect        an event of the scenario came too late, or it or a bound had no effect  always
                  (a warning)

A reference run strikes switches and sets counters, so `switch` ignores lines that set a counter; a switch that stays
struck is reported once.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import MILLISECOND_NS
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.jobs.golden import Golden, Scribe, differences
from isel_twin.jobs.job import Line
from isel_twin.jobs.playing import TIMEOUT_S, played
from isel_twin.jobs.result import Result
from isel_twin.jobs.verdict import Verdict, lost
from isel_twin.jobs.why import RESTARTED

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.core.twin import Twin

LOOK_NS = 5 * MILLISECOND_NS  # sampling interval of the deviation

RULES: Mapping[str, str] = {
    "refused": "Every command is accepted, or answered as the job expects.",
    "restart": "The controller does not start anew before the last reply.",
    "unmet": "What a job says must be so is so.",
    "unfinished": "Every command is over in time.",
    "unpowered": "No step is made while the stages have no power.",
    "lost": "No motor loses steps.",
    "halfway": "No rotor rests between two places that would hold.",
    "drive": "No servo drive switches itself off.",
    "collision": "Nothing meets what it must not.",
    "clearance": "What must not meet keeps a distance.",
    "switch": "No end switch is struck but in a reference run.",
    "fault": "The controller shows no error.",
    "margin": "Every motor keeps a margin of torque.",
    "edge": "Every motor turns slower than it may before it swings.",
    "deviation": "The machine is where the counters say, within a tolerance.",
    "cycle": "The job takes no longer than it may.",
    "golden": "The job does what it did.",
    "luck": "The job ends alike on slightly different machines.",
    "odd": "No move crawls.",
    "effect": "Every event of the scenario comes in time, and has an effect as every bound has.",
}
WARNINGS = ("odd", "effect")  # rules that do not make a job fail
MOST = 20  # findings of one rule that a report names one by one


@dataclass(frozen=True)
class Bounds:
    """Bounds of a job; None: no bound."""

    margin: float | None = None  # least pull-out margin of each motor, 0 .. 1
    deviation_mm: float | None = None
    edge: float | None = None  # least factor on the speed of each motor until it swings, such as 1.2
    cycle_s: float | None = None
    clearance: float | None = None  # least distance of bodies that must not meet, mm
    may_strike: tuple[str, ...] = ()  # end switches that may be struck; "all"
    robust: int = 0  # repetitions
    timeout_s: float = TIMEOUT_S


@dataclass(frozen=True)
class Finding:
    """One violation of a rule."""

    rule: str
    message: str
    line: int | None = None  # of the job; None: the job as a whole
    time_ns: int | None = None
    at: tuple[int, int] | None = None  # line and column of the file, in a program of the controller's own

    @property
    def warning(self) -> bool:
        """True if it does not make the job fail."""
        return self.rule in WARNINGS

    @property
    def level(self) -> str:
        """The level in the words of CI services."""
        return "warning" if self.warning else "error"

    @property
    def place(self) -> str:
        """The place in the file, in words; "" for the job as a whole."""
        if self.at is not None:
            return f"line {self.at[0]}, column {self.at[1]}"
        return "" if self.line is None else f"line {self.line}"


@dataclass(frozen=True)
class Report:
    """The outcome of a job and its findings."""

    job: str
    findings: tuple[Finding, ...]
    verdict: Verdict
    golden: Golden  # the run, without its call

    @property
    def ok(self) -> bool:
        """True without findings other than warnings."""
        return all(finding.warning for finding in self.findings)

    def compared(self, was: Golden, now: Golden) -> Report:
        """The report with the differences from a golden run as findings; now: this run with its call."""
        found = [Finding("golden", each.what, each.line) for each in differences(was, now)]
        return replace(self, golden=now, findings=_few([*self.findings, *found]))


class _Watch:
    """Observes a twin during a job: struck switches and the largest deviation, line by line."""

    def __init__(self, twin: Twin, bounds: Bounds) -> None:
        self._twin = twin
        self._ends = frozenset(switch.name for switch in twin.machine.switches)
        self._struck = self._now_struck()
        self._may = self._ends if "all" in bounds.may_strike else frozenset(bounds.may_strike)
        self._most_mm = bounds.deviation_mm
        self.begin()
        # switches are observed at each change
        twin.observe(self._look, None if bounds.deviation_mm is None else LOOK_NS)

    def begin(self) -> None:
        self.struck: dict[str, int] = {}  # when each switch was struck in this line
        self._worst_mm = np.zeros(len(CARRIAGES))
        self._worst_ns = [0] * len(CARRIAGES)

    def _now_struck(self) -> set[str]:
        return {name for name, state in self._twin.inputs.items() if name in self._ends and state == "struck"}

    def _look(self, twin: Twin) -> None:
        struck = self._now_struck()
        for name in struck - self._struck - self._may:
            self.struck.setdefault(name, twin.time_ns)
        self._struck = struck
        if self._most_mm is not None:
            error_mm = np.abs(twin.position_error_mm)
            for i in np.flatnonzero(error_mm > self._worst_mm):
                self._worst_mm[i], self._worst_ns[i] = error_mm[i], twin.time_ns

    def findings(self, result: Result, counter_set: bool) -> list[Finding]:
        """Findings of the line that has just ended. Setting a counter makes earlier deviations meaningless."""
        if counter_set:
            return []
        found = [
            Finding("switch", f"{name} is struck", result.number, time_ns)
            for name, time_ns in sorted(self.struck.items(), key=lambda item: item[1])
        ]
        if self._most_mm is not None:
            off = f"mm off; at most {self._most_mm:g} mm"
            found += [
                Finding("deviation", f"{name} is {worst:.3f} {off}{_lag(self._twin, name)}", result.number, time_ns)
                for name, worst, time_ns in zip(CARRIAGES, self._worst_mm, self._worst_ns, strict=True)
                if worst > self._most_mm
            ]
        return found


def _lag(twin: Twin, name: str) -> str:
    """What a servo axis is behind by its nature; "" for a stepper."""
    axis = twin.machine.axes[CARRIAGES.index(name)]
    if not isinstance(axis.stage, ServoDrive):
        return ""
    lag_s = (1.0 - axis.stage.feed_forward) / axis.stage.position_gain_per_s
    return f" (a servo of its gain follows by {1e3 * lag_s:.4g} ms: {lag_s:.4g} mm for each mm/s)"


class Inspection:
    """Follows a job on a twin line by line, from before the first, and collects findings."""

    def __init__(self, twin: Twin, bounds: Bounds | None = None) -> None:
        self.twin = twin
        self.bounds = bounds or Bounds()
        self.results: list[Result] = []
        self._watch = _Watch(twin, self.bounds)
        self._met = len(twin.collisions)  # collisions that have been told
        if self.bounds.clearance is not None:
            twin.watch_clearance()
        self._scribe = Scribe(twin)
        self._findings: list[Finding] = []
        self._gone = np.zeros(len(twin.counts), dtype=np.bool_)
        self._faults = [number for number, _ in twin.drive_faults]
        self._unpowered = int(twin.unpowered_steps.sum())
        self._expected = np.array(twin.counts)
        self.setting: set[int] = set()  # numbers of the lines that set a counter, such as reference runs

    def take(self, result: Result) -> None:
        twin, bounds = self.twin, self.bounds
        self.results.append(result)
        self._findings += _of_answer(result, bounds)
        unpowered = int(twin.unpowered_steps.sum())
        if unpowered > self._unpowered:
            made = f"{unpowered - self._unpowered} steps are made while the stages have no power"
            self._findings.append(Finding("unpowered", made, result.number, result.end_ns))
        self._unpowered = unpowered
        self._scribe.take(result)
        counter_set = bool((np.array(result.counts) != self._expected + self._scribe.way).any())
        self._expected = np.array(result.counts)
        if counter_set:
            self.setting.add(result.number)
        self._findings += self._watch.findings(result, counter_set)
        self._watch.begin()
        self._findings += _of_margin(result, bounds)
        self._findings += _of_edge(result, bounds)
        now = lost(twin.lost_steps, twin.slip_steps) & twin.idle
        self._findings += [
            Finding("lost", f"{AXIS_NAMES[i]} has lost {twin.lost_steps[i]:.0f} steps", result.number, result.end_ns)
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

    def report(self, job: str, verdict: Verdict, others: Sequence[Finding] = ()) -> Report:
        """The report at the end of the job; others: further findings."""
        findings = [finding for finding in self._findings if not _expected(finding, verdict, self.results)]
        findings += [*self._collisions(self.results[-1].number if self.results else None), *self._clearance()]
        findings += [*_of_verdict(verdict, self._gone, self.results, self.bounds), *others]
        placed = [_placed(finding, self.results) for finding in findings]
        return Report(job, _few(placed), verdict, self._scribe.golden(verdict))


def check_job(
    job: Path,
    call: TwinSpec,
    lines: Sequence[Line],
    bounds: Bounds | None = None,
    begun: Callable[[Inspection], None] | None = None,
) -> Report:
    """Play a job on a twin of its own and report findings; `Report.compared` adds differences from a golden run.

    begun: called with the inspection before the first line. Raises CallError for a call that cannot be carried out.
    """
    inspection = Inspection(call.build(), bounds)
    if begun is not None:
        begun(inspection)
    verdict = played(inspection.twin, lines, [inspection.take], inspection.bounds.timeout_s).verdict
    others = _of_repetitions(call, lines, verdict, inspection.bounds) if inspection.bounds.robust else ()
    return inspection.report(str(job), verdict, others)


def _expected(finding: Finding, verdict: Verdict, results: Sequence[Result]) -> bool:
    """True if the job itself expects it by a condition that is met: `! lost > 0`, `! limit_x2 == struck`."""
    if finding.rule in ("unpowered", "restart"):
        return not (verdict.unpowered_steps if finding.rule == "unpowered" else verdict.restarts)
    name = finding.message.partition(" ")[0]
    if finding.rule == "drive":
        return not verdict.switched_off[AXIS_NAMES.index(name.rstrip(":"))]
    if finding.rule == "lost":
        return not verdict.lost[AXIS_NAMES.index(name)]
    wanted = (f"{name} == struck", f"input.{name} == struck")
    said = [" ".join(result.command.strip("! \t").split()) for result in results if result.condition and result.ok]
    return finding.rule == "switch" and any(text in wanted for text in said)


def _placed(finding: Finding, results: Sequence[Result]) -> Finding:
    """The finding with its place in the file if its line runs a program: the place of the controller's remark, else the
    step at that time."""
    result = next((one for one in results if one.number == finding.line and one.parts), None)
    if result is None:
        return finding
    parts = [part for part in result.parts if part.at is not None]
    said = [part for part in parts if not part.position_mm] if finding.rule in ("refused", "fault") else []
    made = [part for part in parts if finding.time_ns is None or part.time_ns <= finding.time_ns]
    found = (said or made or parts)[-1:]
    return replace(finding, at=found[0].at) if found else finding


def _of_answer(result: Result, bounds: Bounds) -> list[Finding]:
    if not result.complete:
        stands = result.why if result.expected is None else ""
        what = f"{result.command}: {stands or f'no complete reply within {bounds.timeout_s:g} s'}"
        return [Finding("unfinished", what, result.number, result.end_ns)]
    if result.restarts:
        return [Finding("restart", f"{result.command}: {RESTARTED}; {result.event}", result.number, result.end_ns)]
    if result.ok:
        return []
    if result.condition:
        return [Finding("unmet", f"{result.command}: {result.why or result.reply}", result.number, result.end_ns)]
    return [Finding("refused", f"{result.command}: {result.shown_reply or 'no reply'}", result.number, result.end_ns)]


def _of_margin(result: Result, bounds: Bounds) -> list[Finding]:
    if bounds.margin is None or result.condition:
        return []
    return [
        Finding("margin", f"{name} keeps {100 * margin:.0f} %; at least {100 * bounds.margin:.0f} %", result.number)
        for name, margin in zip(AXIS_NAMES, result.margin, strict=False)
        if margin is not None and margin < bounds.margin
    ]


def _of_edge(result: Result, bounds: Bounds) -> list[Finding]:
    if bounds.edge is None or result.condition:
        return []
    return [
        Finding("edge", f"{name} swings from {edge:.2f} times this speed on; at least {bounds.edge:g}", result.number)
        for name, edge in zip(AXIS_NAMES, result.edge, strict=False)
        if edge is not None and edge < bounds.edge
    ]


def _of_verdict(verdict: Verdict, gone: NDArray[np.bool_], results: Sequence[Result], bounds: Bounds) -> list[Finding]:
    last = results[-1].number if results else None
    found = [
        Finding("lost", f"{name} has lost {steps + before:.0f} steps", last, verdict.time_ns)
        for name, is_lost, told, steps, before in zip(
            AXIS_NAMES, verdict.lost, gone, verdict.whole_steps_lost, verdict.forgotten_steps, strict=False
        )
        if is_lost and not told
    ]
    found += [
        Finding("halfway", f"{name} rests between two places that would hold", last, verdict.time_ns)
        for name, is_halfway in zip(AXIS_NAMES, verdict.halfway, strict=False)
        if is_halfway
    ]
    found += [
        Finding("drive", f"{name} rests {abs(error):.0f} increments from its command", last, verdict.time_ns)
        for name, is_off, error in zip(AXIS_NAMES, verdict.off_position, verdict.following_error, strict=False)
        if is_off and error is not None
    ]
    told = any(result.why and not result.ok and result.parts for result in results)
    if verdict.controller_fault and not verdict.fault_known and not told:
        found.append(Finding("fault", "the controller shows an error that no reply has told", last, verdict.time_ns))
    if verdict.stores_lost:
        found.append(Finding("fault", "the flash memory has not kept what was stored"))
    if verdict.flash_fault:
        found.append(Finding("fault", "the flash memory could not be read"))
    if bounds.cycle_s is not None and verdict.cycle_s > bounds.cycle_s:
        takes = f"takes {verdict.cycle_s:.3f} s; at most {bounds.cycle_s:g} s"
        found.append(Finding("cycle", takes, last, verdict.ended_ns))
    found += [Finding("odd", what, line) for line, what in verdict.odd]
    if verdict.unsent:
        many = f"{verdict.unsent} line{'s are' if verdict.unsent > 1 else ' is'}"
        found.append(Finding("unfinished", f"{many} not sent any more", last, verdict.ended_ns))
    asked = (("margin", bounds.margin), ("edge", bounds.edge), ("deviation_mm", bounds.deviation_mm))
    if in_vain := [] if verdict.physics else [name for name, bound in asked if bound is not None]:
        found.append(Finding("effect", f"without physics nobody can judge {', '.join(in_vain)}: the plant mujoco does"))
    for number, what in (
        (verdict.events_after_end, "to come when the job is over"),
        (verdict.events_without_effect, "without effect: the plant has no physics"),
    ):
        if number:
            found.append(Finding("effect", f"{number} event{'s' if number > 1 else ''} of the scenario {what}"))
    return found


def _of_repetitions(call: TwinSpec, lines: Sequence[Line], verdict: Verdict, bounds: Bounds) -> list[Finding]:
    from isel_twin.jobs.robust import agree, repetitions

    others = repetitions(call, lines, bounds.robust, timeout_s=bounds.timeout_s)
    differ = [other.number for other in others if not agree(verdict, other.verdict)]
    numbers = ", ".join(map(str, differ[:10]))
    told = f"{len(differ)} of {bounds.robust} repetitions end otherwise: number {numbers}"
    return [Finding("luck", told)] if differ else []


def _few(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """At most MOST findings of each rule, in the order of lines, and the number of the others."""
    kept: list[Finding] = []
    for rule in RULES:
        own = [finding for finding in findings if finding.rule == rule]
        kept += own[:MOST]
        if len(own) > MOST:
            kept.append(Finding(rule, f"and {len(own) - MOST} more of the same"))
    return tuple(sorted(kept, key=lambda finding: (finding.line or math.inf, finding.time_ns or 0)))
