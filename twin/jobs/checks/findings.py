"""Findings out of outcomes: of a reply, of the verdict at the end, of repetitions.

Result --- of_answer ---> findings          Verdict --- of_verdict ---> findings, and which are `expected`
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.jobs.checks.rules import RULES, Bounds, Finding, of_left_out
from isel_twin.jobs.job import Line
from isel_twin.jobs.playing import Played
from isel_twin.jobs.result import Result
from isel_twin.jobs.verdict import AFTER_END, HALF_A_SLIP, Verdict
from isel_twin.jobs.why import RESTARTED

if TYPE_CHECKING:
    from isel_twin.core.spec import TwinSpec
    from isel_twin.jobs.robust import Repetition


def expected(finding: Finding, verdict: Verdict, results: Sequence[Result]) -> bool:
    """True if the job itself expects it by a condition that is met: `! lost > 0`, `! limit_x2 == struck`."""
    if finding.rule in ("unpowered", "restart", "line"):
        left = {"unpowered": verdict.unpowered_steps, "restart": verdict.restarts, "line": sum(verdict.line_faults)}
        return not left[finding.rule]
    name = finding.message.partition(" ")[0]
    if finding.rule == "drive":
        return not verdict.switched_off[AXIS_NAMES.index(name.rstrip(":"))]
    if finding.rule == "lost":
        return not verdict.lost[AXIS_NAMES.index(name)]
    wanted = (f"{name} == struck", f"input.{name} == struck")
    said = [" ".join(result.command.strip("! \t").split()) for result in results if result.condition and result.ok]
    return finding.rule == "switch" and any(text in wanted for text in said)


def placed(finding: Finding, results: Sequence[Result]) -> Finding:
    """The finding with its place in the file if its line runs a program: the place of the controller's remark, else the
    step at that time."""
    result = next((one for one in results if one.number == finding.line and one.parts), None)
    if result is None or finding.at is not None:
        return finding
    parts = [part for part in result.parts if part.at is not None]
    said = [part for part in parts if not part.position_mm] if finding.rule in ("refused", "fault") else []
    made = [part for part in parts if finding.time_ns is None or part.time_ns <= finding.time_ns]
    found = (said or made or parts)[-1:]
    return replace(finding, at=found[0].at) if found else finding


def of_answer(result: Result, bounds: Bounds) -> list[Finding]:
    """What is wrong with the reply to a line, or with a condition."""

    def found(rule: str, what: str) -> Finding:
        return Finding(rule, f"{result.command}: {what}", result.number, result.end_ns)

    line = [found("line", "; ".join(filter(None, (result.disturbed, result.event))))] if result.disturbed else []
    if not result.complete:
        stands = result.why if result.expected is None else ""
        return [*line, found("unfinished", stands or f"no complete reply within {bounds.timeout_s:g} s")]
    if result.restarts:
        return [*line, found("restart", f"{RESTARTED}; {result.event}")]
    if result.astray:
        line.append(found("switch", "; ".join(filter(None, (result.astray, result.event)))))
    if result.ok or (line and result.expected is None):
        return line
    if result.condition:
        return [found("unmet", result.why or result.reply)]
    return [*line, found("refused", result.shown_reply or "no reply")]


def of_cycle(cycle_s: float, bounds: Bounds, line: int | None, time_ns: int) -> list[Finding]:
    if bounds.cycle_s is None or cycle_s <= bounds.cycle_s:
        return []
    return [Finding("cycle", f"takes {cycle_s:.3f} s; at most {bounds.cycle_s:g} s", line, time_ns)]


def of_unsent(unsent: int, line: int | None, time_ns: int) -> list[Finding]:
    if not unsent:
        return []
    many = f"{unsent} line{'s are' if unsent > 1 else ' is'}"
    return [Finding("unfinished", f"{many} not sent", line, time_ns)]


def of_verdict(verdict: Verdict, gone: NDArray[np.bool_], results: Sequence[Result], bounds: Bounds) -> list[Finding]:
    last = results[-1].number if results else None
    found = [
        Finding("lost", f"{name} has lost {steps + before:.0f} steps", last, verdict.time_ns)
        for name, is_lost, told, steps, before in zip(
            AXIS_NAMES, verdict.lost, gone, verdict.whole_steps_lost, verdict.forgotten_steps, strict=False
        )
        if is_lost and not told
    ]
    found += [
        Finding("halfway", f"{name} {HALF_A_SLIP}", last, verdict.time_ns)
        for name, is_halfway in zip(AXIS_NAMES, verdict.halfway, strict=False)
        if is_halfway
    ]
    found += [
        Finding("drive", f"{name} rests {abs(error):.0f} increments from its command", last, verdict.time_ns)
        for name, is_off, error in zip(AXIS_NAMES, verdict.off_position, verdict.following_error, strict=False)
        if is_off and error is not None
    ]
    told = any(result.why and not result.ok and result.parts for result in results)
    if verdict.fault_left and not told:
        found.append(Finding("fault", f"left in the controller: {verdict.fault_left}", last, verdict.time_ns))
    if verdict.stores_lost:
        found.append(Finding("fault", "the flash memory did not keep what was stored"))
    if verdict.flash_fault:
        found.append(Finding("fault", "the flash memory cannot be read"))
    found += of_cycle(verdict.cycle_s, bounds, last, verdict.ended_ns)
    found += [Finding("odd", what, line) for line, what in verdict.odd]
    found += of_unsent(verdict.unsent, last, verdict.ended_ns)
    asked = [rule.bound for name, rule in RULES.items() if rule.physics and bounds.limit(name)]
    if in_vain := [] if verdict.physics else asked:
        found.append(Finding("effect", f"not simulated: {', '.join(in_vain)}; use --plant mujoco"))
    for number, what in (
        (verdict.events_after_end, AFTER_END),
        (verdict.events_without_effect, "without effect: the plant has no physics"),
    ):
        if number:
            found.append(Finding("effect", f"{number} event{'s' if number > 1 else ''} of the scenario {what}"))
    return found


def repeated(call: TwinSpec, lines: Sequence[Line], made: Played, bounds: Bounds) -> list[Finding]:
    """What repetitions of the job show, if there are to be any."""
    from isel_twin.jobs.robust import agree, repetitions

    found = []
    if bounds.robust:
        others = list(repetitions(call, lines, bounds.robust, timeout_s=bounds.timeout_s))
        differ = [other.number for other in others if not agree(made.verdict, other.verdict)]
        found += [Finding("luck", _otherwise(differ, len(others), "end differently"))] if differ else []
        found += of_left_out("robust", bounds.robust - len(others))
    if bounds.uncertain:
        may_be = list(repetitions(call, lines, bounds.uncertain, timeout_s=bounds.timeout_s, source="known"))
        found += _doubts(made, may_be, bounds)
        found += of_left_out("uncertain", bounds.uncertain - len(may_be))
    return found


def _otherwise(numbers: Sequence[int], of: int, how: str) -> str:
    return f"{len(numbers)} of {of} repetitions {how}: number {', '.join(map(str, numbers[:10]))}"


def _doubts(made: Played, may_be: Sequence[Repetition], bounds: Bounds) -> Iterator[Finding]:
    """What repetitions on machines that this one may be show, each with the band of what it is about."""
    from isel_twin.jobs.robust import agree
    from isel_twin.jobs.uncertain import bands

    known = {band.what: band for band in bands(made.verdict, made.results, may_be)}

    def doubt(what: str, how: str, wrong: Callable[[Verdict], bool]) -> Iterator[Finding]:
        numbers = [one.number for one in may_be if wrong(one.verdict)]
        if numbers and not wrong(made.verdict):  # else that is told of the machine as it is
            where = f"; {known[what].in_words()}" if what in known else ""
            yield Finding("doubt", f"{_otherwise(numbers, len(may_be), how)}{where}")

    yield from doubt("", "end differently", lambda verdict: not agree(made.verdict, verdict))
    if (cycle_s := bounds.cycle_s) is not None:
        yield from doubt("time", f"take more than {cycle_s:g} s", lambda verdict: verdict.cycle_s > cycle_s)
    if (margin := bounds.margin) is not None:
        few = f"keep less than {100.0 * margin:g} %"
        yield from doubt("margin", few, lambda v: v.least_margin is not None and v.least_margin < margin)
    if (edge := bounds.edge) is not None:
        swing = f"swing below {edge:g} times their speed"
        yield from doubt("edge", swing, lambda v: v.least_edge is not None and v.least_edge[0] < edge)
        if untold := sum(one.verdict.least_edge is None for one in may_be):
            why = "no limit of the swing is told there, so edge is not judged"
            yield Finding("effect", f"uncertain: {untold} of {len(may_be)} repetitions: {why}")
