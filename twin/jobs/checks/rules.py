"""What a check demands of a job, and what it finds.

rule          it is broken when                                                       bound
refused       a command is refused, or its reply is not what the job expects          always
restart       the controller starts anew before the last reply                        always
line          a byte is altered, lost or doubled on the line                          always
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
              condition of the job (`! limit_x1 == struck`) expects it; or an axis is
              referenced and none of its is struck                                    always
fault         the controller shows an error at the end, or its flash is damaged       always
margin        the least pull-out margin of a motor in a line                          `margin`
edge          a motor turns faster than the speed from which on it swings, over this   `edge`
deviation     true position and counter differ by more, sampled every 5 ms            `deviation_mm`
contour       the carriages leave what a file of a CAM program cuts by more           `contour_mm`
cycle         first command to end of the last one takes longer                       `cycle_s`
golden        the run differs from the golden run of the job, if it has one           `golden`
luck          repetitions on other machines of the kind end differently               `robust`
doubt         repetitions on what this machine may be, as far as it is known, end     `uncertain`
              differently or break the bounds on margin, edge or time
odd           a line is legal and absurd: a move that crawls (a warning)               always
effect        an event of the scenario came too late, or it or a bound had no effect, always
              or a repetition was not made (a warning)
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.jobs.playing import TIMEOUT_S
from isel_twin.jobs.result import Result

RULES: Mapping[str, str] = {
    "refused": "Every command is accepted, or answered as the job expects.",
    "restart": "The controller does not start anew before the last reply.",
    "line": "Every byte arrives as it was sent.",
    "unmet": "What a job says must be so is so.",
    "unfinished": "Every command is over in time.",
    "unpowered": "No step is made while the stages have no power.",
    "lost": "No motor loses steps.",
    "halfway": "No rotor rests between two places that would hold.",
    "drive": "No servo drive switches itself off.",
    "collision": "Nothing meets what it must not.",
    "clearance": "What must not meet keeps a distance.",
    "switch": "End switches are struck in reference runs, and only there.",
    "fault": "The controller shows no error.",
    "margin": "Every motor keeps a margin of torque.",
    "edge": "Every motor turns slower than it may before it swings.",
    "deviation": "The machine is where the counters say, within a tolerance.",
    "contour": "What is cut is what the file draws, within a tolerance.",
    "cycle": "The job takes no longer than it may.",
    "golden": "The job does what it did.",
    "luck": "The job ends alike on other machines of the kind.",
    "doubt": "The job ends alike, and within its bounds, on all that this machine may be, as far as it is known.",
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
    contour_mm: float | None = None  # most distance of the carriages from what a file of a CAM program cuts
    edge: float | None = None  # least factor on the speed of each motor until it swings, such as 1.2
    cycle_s: float | None = None
    clearance: float | None = None  # least distance of bodies that must not meet, mm
    may_strike: tuple[str, ...] = ()  # end switches that may be struck; "all"
    robust: int = 0  # repetitions on other machines of the kind
    uncertain: int = 0  # and on what this machine may be
    timeout_s: float = TIMEOUT_S


@dataclass(frozen=True)
class Finding:
    """One violation of a rule."""

    rule: str
    message: str
    line: int | None = None  # of the job; None: the job as a whole
    time_ns: int | None = None
    at: tuple[int, int] | None = None  # line and column of the file, in a program of the controller's own
    about: str = ""  # what is off: an axis
    off: float = 0.0  # by how much; 0: that is no question here

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


def farthest(findings: Sequence[Finding]) -> list[Finding]:
    """Of findings of the same rule, line and axis the one that is off by most: a line of a CAM program's file may be
    many commands."""
    kept: dict[object, Finding] = {}
    for number, one in enumerate(findings):
        key = (one.rule, one.line, one.at, one.about) if one.off else number
        kept[key] = max(kept.get(key, one), one, key=lambda each: each.off)
    return list(kept.values())


def few(findings: Sequence[Finding]) -> tuple[Finding, ...]:
    """At most MOST findings of each rule, in the order of lines, and the number of the others."""
    kept: list[Finding] = []
    for rule in RULES:
        own = [finding for finding in findings if finding.rule == rule]
        kept += own[:MOST]
        if len(own) > MOST:
            kept.append(Finding(rule, f"and {len(own) - MOST} more of the same"))
    return tuple(sorted(kept, key=lambda finding: (finding.line or math.inf, finding.time_ns or 0)))


def of_margin(result: Result, bounds: Bounds) -> list[Finding]:
    """Axes whose motors keep less torque in a line than the bound asks for."""
    words = f"{{name}} keeps {{percent:.0f}} % torque; at least {100 * (bounds.margin or 0.0):.0f} %"
    return _below("margin", result, result.margin, bounds.margin, words)


def of_edge(result: Result, bounds: Bounds) -> list[Finding]:
    """Axes that would swing out of step at less than the factor on the speed of a line that the bound asks for."""
    words = f"{{name}}: unstable above {{value:.2f}} times this speed; at least {bounds.edge or 0.0:g} times"
    return _below("edge", result, result.edge, bounds.edge, words)


def of_left_out(option: str, number: int) -> list[Finding]:
    """Repetitions that were not made, as their machines cannot be built."""
    if not number:
        return []
    return [
        Finding("effect", f"{option}: {number} of its machines cannot be built, so the job was not repeated on them")
    ]


def _below(rule: str, result: Result, values: Sequence[float | None], least: float | None, words: str) -> list[Finding]:
    """words: with {name} of the axis, and its {value} or {percent}."""
    if least is None or result.condition:
        return []
    return [
        Finding(
            rule,
            words.format(name=name, value=value, percent=100 * value),
            result.number,
            about=name,
            off=least - value,
        )
        for name, value in zip(AXIS_NAMES, values, strict=False)
        if value is not None and value < least
    ]
