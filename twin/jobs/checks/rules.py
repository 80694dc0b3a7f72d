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
    broken: str  # when it is broken, as docs/ci.md has it
    remedy: str  # what to do then
    bound: str = ""  # its key in [check]; "": it always applies
    limit: str = ""  # the bound in words, {} for its value
    warning: bool = False  # it does not make a job fail, unless that is asked for (`strict`)
    physics: bool = False  # nobody can judge it without physics
    heard: bool = False  # a real controller's replies tell


RULES: Mapping[str, Rule] = {
    "unread": Rule(
        "The file can be read, and this machine can make it.",
        "the file cannot be read, is wrong, or cannot be made on this machine",
        "Mend the line that is named, or choose the controller and the machine that the file is for.",
        heard=True,
    ),
    "refused": Rule(
        "Every command is accepted, or answered as the job expects.",
        "a command is refused, or answered otherwise than the job expects (`=>`)",
        "Mend the command; the reply says what is wrong. Where the refusal is wanted, write it behind `=>`.",
        heard=True,
    ),
    "restart": Rule(
        "The controller does not start anew before the last reply.",
        "the controller starts anew before the last reply (`! restarts == 1` expects it)",
        "Look at the command and at the events of the scenario just before: a reset, or the mains.",
    ),
    "line": Rule(
        "Every byte arrives as it was sent.",
        "a byte is altered, lost or doubled on the line, whatever was answered (`! bytes > 0` expects it)",
        "Give host and controller the same speed and frame, and look at the events of the scenario.",
    ),
    "unpowered": Rule(
        "No step is made while the stages have no power.",
        "steps are made while the stages have no power (`! unpowered > 0` expects it)",
        "Switch the stages on before the first move: key, hood and E-stop, then the command for power.",
    ),
    "unmet": Rule(
        "What a job says must be so is so.",
        "a condition of the job (`! x == 50 +- 0.03 mm`) is not so",
        "The message has the value found: mend the moves before it, or the condition.",
        heard=True,
    ),
    "unfinished": Rule(
        "Every command is over in time.",
        "a command is not over in time; the job ends there",
        "Shorten the move, raise its speed, or give commands more time (`timeout_s`).",
        "timeout_s",
        "{:g} s a command",
        heard=True,
    ),
    "lost": Rule(
        "No motor loses steps.",
        "steps are lost",
        "Lower speed or acceleration of the line, or its load; `isel-twin tune` looks for the fastest that hold.",
        physics=True,
    ),
    "halfway": Rule(
        "No rotor rests between two places that would hold.",
        "a rotor rests between two places that would hold",
        "Lower speed or acceleration, or the friction and load at the end of the line.",
        physics=True,
    ),
    "drive": Rule(
        "No servo drive switches itself off.",
        "a servo drive switches itself off: `x: following error exceeded`; it rests short of its command",
        "Lower speed or acceleration of that axis, or allow its drive a larger following error.",
    ),
    "collision": Rule(
        "Nothing meets what it must not.",
        "two bodies meet that must not",
        "Lead the tool around the body that is named, or lift it first; check work zero and tool length.",
    ),
    "clearance": Rule(
        "What must not meet keeps a distance.",
        "two bodies that must not meet come nearer to each other",
        "Lead the tool around at a larger distance, or ask for less.",
        "clearance",
        "at least {:g} mm",
    ),
    "switch": Rule(
        "End switches are struck in reference runs, and only there.",
        "an end switch is struck in a line that sets no counter, so in no reference run",
        "Keep the move within the travel: check work zero, and whether steps were lost before. `may_strike` allows it.",
        "may_strike",
        "may be struck: {}",
    ),
    "fault": Rule(
        "The controller shows no error.",
        "the controller stands in an error that the job does not expect; its flash is damaged",
        "Take away what caused it, named in the message, and clear the error as the controller's manual says.",
    ),
    "margin": Rule(
        "Every motor keeps a margin of torque.",
        "a motor keeps less pull-out margin in a line",
        "Lower speed or acceleration of that line.",
        "margin",
        "at least {:.4g} %",
        physics=True,
    ),
    "edge": Rule(
        "Every motor turns slower than it may before it swings.",
        "a motor turns so fast that it swings itself out of step at less than this factor more, such as 1.2",
        "Lower the speed of that line.",
        "edge",
        "at least {:g}",
        physics=True,
    ),
    "deviation": Rule(
        "The machine is where the counters say, within a tolerance.",
        "counter and true position differ by more, looked at every 5 ms, load angle included",
        "Lower the acceleration; for a difference at rest look at backlash, friction and lost steps.",
        "deviation_mm",
        "at most {:g} mm",
        physics=True,
    ),
    "contour": Rule(
        "What is cut is what the file draws, within a tolerance.",
        "the carriages leave what a file of a CAM program cuts by more",
        "Lower the feed there, ask for exact stops (G61), or let arcs have shorter chords.",
        "contour_mm",
        "at most {:g} mm",
    ),
    "spindle": Rule(
        "The spindle turns, as fast as it is to, in every cut.",
        "a cut is made while the spindle stands, or has not reached its speed (below)",
        "Switch the spindle on before the cut, and give it the time to come to its speed.",
        "spindle",
    ),
    "rapid": Rule(
        "No rapid and no change of a tool is in the stock.",
        "a rapid leads through what is left of stock, or a tool is changed in it (below)",
        "Lift the tool above the stock first.",
        "rapid",
    ),
    "cycle": Rule(
        "The job takes no longer than it may.",
        "from the first command to the end of the last takes longer, the line if it counts",
        "Raise speeds or ramps as far as the motors go (`isel-twin tune`), or allow more time.",
        "cycle_s",
        "at most {:g} s",
        heard=True,
    ),
    "golden": Rule(
        "The job does what it did.",
        "the job has a golden run and does something else",
        "The message has the first difference; if it is wanted, make the golden run anew.",
        "golden",
    ),
    "luck": Rule(
        "The job ends alike on other machines of the kind.",
        "repetitions on other machines, as one can buy them, end differently (`run --robust`)",
        "Lower speed or acceleration where the losers lose; the message says what they have in common.",
        "robust",
        "{} repetitions",
    ),
    "doubt": Rule(
        "The job ends alike, and within its bounds, on all that this machine may be, as far as it is known.",
        "on what this machine may be, it ends otherwise or breaks `margin`, `edge` or `cycle_s`",
        "Measure the number that separates them (`isel-twin identify`), or keep more margin.",
        "uncertain",
        "{} repetitions",
    ),
    "signal": Rule(
        "Captured signals are whole, and give the drives the times that they need.",
        "`drive`: a gap in the capture; pulses, or times around a turn, that are shorter than the drives need",
        "Capture without a pause; give the source of the pulses longer ones, or more time between direction and step.",
        "pulse_us, setup_us, hold_us",
    ),
    "odd": Rule(
        "No move crawls.",
        "a move crawls: another axis times it, or a thousand times slower than possible",
        "Give the axis with the longest way the speed, and moves of no length none.",
        warning=True,
    ),
    "caution": Rule(
        "A file of a CAM program can be meant in one way, and is made as it says.",
        "a CAM program's file can be meant otherwise, or is not made as it says",
        "Say in [cam] of isel-twin.toml how it is meant, or change the word that is named.",
        warning=True,
        heard=True,
    ),
    "effect": Rule(
        "Every event of the scenario comes in time, and has an effect as every bound has.",
        "an event of the scenario came too late, it or a bound had no effect, a machine cannot be built",
        "Give the event an earlier time, or take away the bound or event that can do nothing here.",
        warning=True,
    ),
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
