"""Rules and bounds of a check, and its findings.

RULES is the one list of them: reports, JUnit, SARIF, the page, editors and docs/ci.md, which says when each is broken,
have theirs from here.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from isel_twin.base.axes import AXIS_NAMES
from isel_twin.jobs.playing import TIMEOUT_S
from isel_twin.jobs.result import Result, in_percent

if TYPE_CHECKING:
    from isel_twin.jobs.toolpaths import Source

NO_PHYSICS = "no physics"


@dataclass(frozen=True)
class Rule:
    """A demand on a job."""

    demand: str
    bound: str = ""  # its key in [check]; "": it always applies
    limit: str = ""  # the bound in words, {} for its value
    warning: bool = False  # it does not make a job fail, unless that is asked for (`strict`)
    physics: bool = False  # nobody can judge it without physics
    heard: bool = False  # a real controller's replies tell


RULES: Mapping[str, Rule] = {
    "unread": Rule("The file can be read, and this machine can make it.", heard=True),
    "refused": Rule("Every command is accepted, or answered as the job expects.", heard=True),
    "restart": Rule("The controller does not start anew before the last reply."),
    "line": Rule("Every byte arrives as it was sent."),
    "unmet": Rule("What a job says must be so is so.", heard=True),
    "unfinished": Rule("Every command is over in time.", "timeout_s", "{:g} s a command", heard=True),
    "unpowered": Rule("No step is made while the stages have no power."),
    "lost": Rule("No motor loses steps.", physics=True),
    "halfway": Rule("No rotor rests between two places that would hold.", physics=True),
    "drive": Rule("No servo drive switches itself off."),
    "collision": Rule("Nothing meets what it must not."),
    "clearance": Rule("What must not meet keeps a distance.", "clearance", "at least {:g} mm"),
    "switch": Rule("End switches are struck in reference runs, and only there.", "may_strike", "may be struck: {}"),
    "fault": Rule("The controller shows no error."),
    "margin": Rule("Every motor keeps a margin of torque.", "margin", "at least {:.4g} %", physics=True),
    "edge": Rule("Every motor turns slower than it may before it swings.", "edge", "at least {:g}", physics=True),
    "deviation": Rule(
        "The machine is where the counters say, within a tolerance.", "deviation_mm", "at most {:g} mm", physics=True
    ),
    "contour": Rule("What is cut is what the file draws, within a tolerance.", "contour_mm", "at most {:g} mm"),
    "spindle": Rule("The spindle turns, as fast as it is to, in every cut.", "spindle"),
    "rapid": Rule("No rapid and no change of a tool is in the stock.", "rapid"),
    "cycle": Rule("The job takes no longer than it may.", "cycle_s", "at most {:g} s", heard=True),
    "golden": Rule("The job does what it did.", "golden"),
    "luck": Rule("The job ends alike on other machines of the kind.", "robust", "{} repetitions"),
    "doubt": Rule(
        "The job ends alike, and within its bounds, on all that this machine may be, as far as it is known.",
        "uncertain",
        "{} repetitions",
    ),
    "signal": Rule("Captured signals give the drives the times that they need.", "pulse_us, setup_us, hold_us"),
    "odd": Rule("No move crawls.", warning=True),
    "caution": Rule(
        "A file of a CAM program can be meant in one way, and is made as it says.", warning=True, heard=True
    ),
    "effect": Rule("Every event of the scenario comes in time, and has an effect as every bound has.", warning=True),
}
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
    spindle: bool = True  # cuts with a standing spindle are findings
    rapid: bool = True  # rapids and changes of tools in stock are
    may_strike: tuple[str, ...] = ()  # end switches that may be struck; "all"
    robust: int = 0  # repetitions on other machines of the kind
    uncertain: int = 0  # and on what this machine may be
    timeout_s: float = TIMEOUT_S
    strict: bool = False  # warnings make the job fail, too

    def limit(self, rule: str) -> str | None:
        """The bound of a rule in words, "" if it has none to tell; None: nobody has asked for this rule."""
        key, words = RULES[rule].bound, RULES[rule].limit
        if not hasattr(self, key):
            return None if key else ""
        value, usual = getattr(self, key), getattr(Bounds, key)
        if value is False or (value == usual and usual in (None, 0)):
            return None
        told = ", ".join(value) if isinstance(value, tuple) else 100.0 * value if "%" in words else value
        return words.format(told) if told != "" else ""


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
    strict: bool = False  # it makes the job fail, even if its rule only warns

    @property
    def warning(self) -> bool:
        """True if it does not make the job fail."""
        return RULES[self.rule].warning and not self.strict

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
    """Keep of findings of the same rule, line and axis the one that is off by most: a line of a CAM program's file may
    be many commands."""
    kept: dict[object, Finding] = {}
    for number, one in enumerate(findings):
        key = (one.rule, one.line, one.at, one.about) if one.off else number
        kept[key] = max(kept.get(key, one), one, key=lambda each: each.off)
    return list(kept.values())


def of_cautions(source: Source | None) -> tuple[Finding, ...] | None:
    """Other meanings that a file of a CAM program may have; None for any other file."""
    if source is None:
        return None
    return tuple(Finding("caution", one.text, one.place.line) for one in source.cautions)


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
    bands = result.margin_band or (None,) * len(result.margin)
    told = [in_percent([margin], [ends]) for margin, ends in zip(result.margin, bands, strict=True)]
    words = f"{{name}} keeps {{told}} torque; at least {100 * (bounds.margin or 0.0):.0f} %"
    return _below("margin", result, result.margin, bounds.margin, words, told)


def of_edge(result: Result, bounds: Bounds) -> list[Finding]:
    """Axes that would swing out of step at less than the factor on the speed of a line that the bound asks for."""
    told = ["" if edge is None else f"{edge:.2f}" for edge in result.edge]
    words = f"{{name}}: unstable above {{told}} times this speed; at least {bounds.edge or 0.0:g} times"
    return _below("edge", result, result.edge, bounds.edge, words, told)


def of_left_out(option: str, number: int) -> list[Finding]:
    """Repetitions that were not made, as their machines cannot be built."""
    if not number:
        return []
    return [
        Finding("effect", f"{option}: {number} of its machines cannot be built, so the job was not repeated on them")
    ]


def _below(
    rule: str,
    result: Result,
    values: Sequence[float | None],
    least: float | None,
    words: str,
    told: Sequence[str],
) -> list[Finding]:
    """words: with {name} of the axis and what is {told} of its value."""
    if least is None or result.condition:
        return []
    return [
        Finding(
            rule,
            words.format(name=name, told=text),
            result.number,
            about=name,
            off=least - value,
        )
        for name, value, text in zip(AXIS_NAMES, values, told, strict=False)
        if value is not None and value < least
    ]
