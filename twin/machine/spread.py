"""How far a number of a machine may be from what its file says: the one description for all that draws machines.

Two questions are asked of it:

    kind     which machines can one buy?       as makers and shops spread them          --robust, `luck`
    known    which one may this machine be?    as far as the grade of a number says     --uncertain, prior of `identify`

**Kind.** The factor of a number has the law of its key, LAWS:

    motor       R normal 4 % (at most 10), L normal 8 % (at most 20), torque constant +-8 %, rotor inertia normal 5 %,
                detent log-normal 25 %, iron loss 40 %, its knee 30 %
    stage       current normal 3 %, part of the supply that drives it normal 5 % (at most 10), supply -12 to +4 %;
                electronic damping, where the stage has it, log-normal 35 %; current at rest +-40 %, its delay
                log-normal 35 %; how a current falls, where nobody has said it: FAST_STAGES
    friction    of guides and of screws log-normal 35 %
    screw       efficiency 0.80 to 0.95, stiffness log-normal 35 %, backlash log-normal 50 %
    frame       stiffness log-normal 35 %, damping log-normal 47 %; squareness, guides log-normal 50 %
    load        each moving mass normal 5 %, the payload +-10 %

Sources: tolerances printed on sheets (R 10 %, L 20 %), catalogues (friction, efficiency, stiffness), the rest estimates
whose 95 % range is half to twice (jobs/7). Normal draws are cut at 2.5, log-normal ones at 2 times their size.

**Known.** The 95 % interval of a number of this machine (jobs/10):

    interval = [low, high] in the file      that, whatever the grade; `identify` writes it
    measured                                a tenth off at most
    datasheet, setting                      the law of its kind: what one buys or sets comes as makers spread it
    fitted, estimate                        half to twice; of a number that makers do print (SHEET) the law of its kind

A number of no kind, such as a length, is what the file says, unless it has an interval. What is 0 stays 0.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal

Source = Literal["kind", "known"]

NORMAL_95 = 1.96  # standard deviations either way that hold 95 %
MOST_DEVIATIONS = 2.5  # of a draw within an interval

# by grade, for a number that has no interval and whose kind says nothing of it: from value / this to value * this
GRADE_FACTOR: Mapping[str, float] = {
    "measured": 1.1,
    "datasheet": 1.2,
    "setting": 1.2,
    "fitted": 2.0,
    "estimate": 2.0,
}
LEAD_PERCENT = 0.25  # either way, of a lead error: what axes show, not what the class of a screw allows (many/32)


@dataclass(frozen=True)
class Law:
    """Distribution of the factor of a number."""

    shape: Literal["normal", "log-normal", "uniform"]
    size: float = 0.0  # standard deviation, of the factor or of its logarithm
    low: float = 1.0
    high: float = 1.0  # ends, if uniform
    absolute: bool = False  # the ends are values, not factors

    def interval(self, value: float) -> tuple[float, float]:
        """What holds 95 % of it."""
        if self.shape == "uniform":
            tail = 0.025 * (self.high - self.low)
            low, high = self.low + tail, self.high - tail
            return (low, high) if self.absolute else _ordered(value * low, value * high)
        away = NORMAL_95 * self.size
        low, high = (1.0 - away, 1.0 + away) if self.shape == "normal" else (math.exp(-away), math.exp(away))
        return _ordered(value * low, value * high)


def _normal(size: float) -> Law:
    return Law("normal", size)


def _log_normal(size: float) -> Law:
    return Law("log-normal", size)


LAWS: Mapping[str, Law] = {
    "stage.supply": Law("uniform", low=0.88, high=1.04),  # transformer and rectifier; of a servo drive, too
    "stage.current": _normal(0.03),
    "stage.idle_current": Law("uniform", low=0.6, high=1.4),  # of 0.5: usual stages are set to 0.3 to 0.7
    "stage.idle_delay": _log_normal(0.35),
    "specimen.resistance": _normal(0.04),
    "specimen.inductance": _normal(0.08),
    "specimen.torque_constant": Law("uniform", low=0.92, high=1.08),
    "specimen.rotor_inertia": _normal(0.05),
    "specimen.detent_torque": _log_normal(0.25),
    "specimen.iron_loss": _log_normal(0.4),
    "specimen.iron_knee": _log_normal(0.3),
    "specimen.supply_factor": _normal(0.05),
    "specimen.damping_gain": _log_normal(0.35),  # electronic; no maker says how much
    "guide_friction": _log_normal(0.35),
    "shaft_coulomb": _log_normal(0.35),
    "shaft_viscous": _log_normal(0.35),
    "efficiency": Law("uniform", low=0.80, high=0.95, absolute=True),
    "stiffness": _log_normal(0.35),
    "backlash": _log_normal(0.5),
    "squareness": _log_normal(0.5),
    "guides": _log_normal(0.5),
    "structure.stiffness": _log_normal(0.35),
    "structure.damping_ratio": _log_normal(0.47),
    "masses": _normal(0.05),
    "payload": Law("uniform", low=0.9, high=1.1),
}
FAST_STAGES = 0.4  # of the stages whose kind is a guess, the others are mixed (jobs/19)
MIXED_DECAY = Law("uniform", low=0.3, high=0.9, absolute=True)
SHEET = frozenset(
    {"stage.current", "efficiency"}
    | {f"specimen.{name}" for name in ("resistance", "inductance", "torque_constant", "rotor_inertia", "supply_factor")}
)
"""Kinds of numbers that makers print or physics bounds: even an estimate of one is no worse."""


def kind(key: str) -> str:
    """The key of LAWS for a key of a machine file, "" if it has none: axes.x.stage.supply is a `stage.supply`."""
    section, _, rest = key.partition(".")
    inner = rest.partition(".")[2]
    found = {
        "axes": "stage.supply" if inner == "servo.supply" else inner,
        "structure": f"structure.{inner}",
        "payload": "payload" if rest == "mass" else "",
    }.get(section, section)
    return found if found in LAWS else ""


def own(key: str, entry: Mapping[str, Any]) -> tuple[float, float] | None:
    """The 95 % interval that the number itself tells, by its interval or its grade; None: that of its kind, if any."""
    if "interval" in entry:
        low, high = entry["interval"]
        return float(low), float(high)
    value, grade, of = float(entry["value"]), entry["grade"], kind(key)
    if key.startswith("axes.") and key.endswith(".lead_error"):
        return value - LEAD_PERCENT, value + LEAD_PERCENT
    guessed = grade in ("fitted", "estimate")
    if not of or not value or (guessed and of in SHEET) or not (guessed or grade == "measured"):
        return None
    return _ordered(value / GRADE_FACTOR[grade], value * GRADE_FACTOR[grade])


def band(key: str, entry: Mapping[str, Any]) -> tuple[float, float] | None:
    """The 95 % interval of a number of this machine, in the unit of the file; None: taken as it stands."""
    of, value = kind(key), entry["value"]
    if (told := own(key, entry)) is not None or not of or not value:
        return told
    return LAWS[of].interval(float(value))


def within(value: float, interval: tuple[float, float], deviations: float) -> float:
    """The value so many standard deviations from this one, whose 95 % interval may be lopsided: each side has a
    deviation of its own, of the logarithm if all is positive."""
    share = min(max(deviations, -MOST_DEVIATIONS), MOST_DEVIATIONS) / NORMAL_95
    end = interval[1] if share > 0.0 else interval[0]
    if value > 0.0 and interval[0] > 0.0:
        return value * math.exp(abs(share) * math.log(end / value))
    return value + abs(share) * (end - value)


def numbers(tree: Mapping[str, Any], prefix: str = "") -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Key and table of each number of a machine's tree, in its order; words and switches are none."""
    for key, value in tree.items():
        if isinstance(value, Mapping) and "value" in value:
            if not isinstance(value["value"], str):
                yield prefix + key, value
        elif isinstance(value, Mapping):
            yield from numbers(value, f"{prefix}{key}.")


def _ordered(one: float, other: float) -> tuple[float, float]:
    return (one, other) if one <= other else (other, one)
