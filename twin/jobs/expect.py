"""Expectations in a job file: of the reply to a line, and of the machine after it.

    @0M160000,5000,0,30,0,30,0,30 => 2            the reply, byte for byte; a CR or LF at its end need not be written
    @0P => 0*                                     * any bytes, <13> the byte 13
    T0;0 => @500                                  of a controller with binary telegrams: as its language reads them
    <253> => none                                 no reply
    @0R7 => 0 within 60 s                         and the line is over within this time
    @0A8000,900,0,30,0,30,0,30 => none within 1 s      1 s passes without a reply

    ! lost == 0                                   a condition that must hold after a line
    ! x == 50 +- 0.03 mm
    ! hood == open

    what                        value
    lost, lost.x                steps lost since power-on, of all axes or one, by whole slips of the motor
    unpowered                   steps made since power-on while the stages had no power, of all axes
    restarts                    how often the controller was reset or lost its supply since power-on
    bytes, bytes.altered        bytes since power-on that did not arrive as they were sent: altered, lost, doubled
    x, y, z                     true position, mm or um; error.x: true position minus counter
    count.x                     counter, steps
    margin, margin.x            least torque margin during the last command: 0 .. 1, or %
    time, clock                 duration of the last command, virtual time since power-on: s, ms, min
    steps                       ticks of the stream since power-on
    fault                       1: the controller stands in an error that somebody must put in order
    lag, lag.x                  following error of servo drives now, the largest or of one axis, in increments
    drive_faults, .x            how often servo drives have switched themselves off since power-on
    spindle, hood, limit_x1     outputs and relays (numbers); elements, switches and faults of contacts (words)
    output.NAME, input.NAME, level.NAME      the same where a name could be both, and input terminals (0, 1)

`=>`, and `!` at the beginning, need a blank or the end of the line after them. A condition on lost or unpowered steps,
restarts, bytes or a fault that is met makes them expected: the verdict then counts only later ones (jobs/2).
"""

from __future__ import annotations

import math
import operator
import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import AXIS_NAMES, CARRIAGES
from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.jobs.verdict import whole_slips
from isel_twin.language import LanguageError, encoded, readable
from isel_twin.wiring import LineFaults
from isel_twin.wiring.contacts import FAULTS

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin
    from isel_twin.jobs.result import Result

LONGEST_S = 1e9  # longest time in an expectation, as for pauses
EXCERPT = 100  # characters of a line that are shown around a mistake

_ITEM = re.compile(r"<([^<>]*)>|\*")
_BYTE = re.compile(r"0*([0-9]{1,3})")
_WITHIN = re.compile(r"(?:^|[ \t])within(?=[ \t]|$)")
_DURATION = re.compile(r"([0-9]+(?:\.[0-9]*)?|\.[0-9]+)[ \t]*(s|ms|min)")
_NUMBER = re.compile(r"[+-]?(?:[0-9]+(?:\.[0-9]*)?|\.[0-9]+)(?:[eE][+-]?[0-9]+)?")
_NAME = re.compile(r"[A-Za-z_][A-Za-z0-9_.]*")
_OPERATOR = re.compile(r"==|!=|<=|>=|<|>")
_TOLERANCE = re.compile(r"\+-|\+/-|±")
_WORD = re.compile(r"[A-Za-zµμ%]\w*|%")

_COMPARE: Mapping[str, Callable[[float, float], bool]] = {
    "!=": operator.ne,
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
}
_TIME_NS = {"s": SECOND_NS, "ms": MILLISECOND_NS, "min": 60 * SECOND_NS}
_MM = {"mm": 1.0, "um": 1e-3, "µm": 1e-3, "μm": 1e-3}
_S = {unit: ns / SECOND_NS for unit, ns in _TIME_NS.items()}
_STEPS = {"steps": 1.0, "step": 1.0}


@dataclass(frozen=True)
class _Quantity:
    units: Mapping[str, float]  # unit and factor; the first one is the default and is shown
    axes: tuple[str, ...] = ()
    alone: bool = True  # can be used without an axis
    whole: bool = False

    @property
    def unit_names(self) -> str:
        return ", ".join(filter(None, self.units)) or "none"


_QUANTITIES: Mapping[str, _Quantity] = {
    "lost": _Quantity(_STEPS, AXIS_NAMES, whole=True),
    "unpowered": _Quantity(_STEPS, whole=True),
    "restarts": _Quantity({"": 1.0}, whole=True),
    "bytes": _Quantity({"": 1.0}, LineFaults._fields, whole=True),
    **dict.fromkeys(CARRIAGES, _Quantity(_MM)),
    "error": _Quantity(_MM, CARRIAGES, alone=False),
    "count": _Quantity(_STEPS, AXIS_NAMES, alone=False, whole=True),
    "margin": _Quantity({"": 1.0, "%": 0.01}, AXIS_NAMES),
    "time": _Quantity(_S),
    "clock": _Quantity(_S),
    "steps": _Quantity(_STEPS, whole=True),
    "fault": _Quantity({"": 1.0}, whole=True),
    "lag": _Quantity({"": 1.0}, AXIS_NAMES),
    "drive_faults": _Quantity({"": 1.0}, AXIS_NAMES, whole=True),
}
_PLAIN = _Quantity({"": 1.0}, whole=True)
_KINDS = ("output", "input", "level")


class ExpectError(ValueError):
    """An expectation has a syntax error; `at`: index of the character in the parsed text."""

    def __init__(self, message: str, at: int) -> None:
        super().__init__(message)
        self.at = at


def excerpt(line: str, at: int) -> str:
    """Two lines: the text around a place in a line, and a caret below the place."""
    start = max(0, min(at - EXCERPT // 2, len(line) - EXCERPT))
    shown = "".join(c if c.isprintable() else " " if c == "\t" else "?" for c in line[start : start + EXCERPT])
    return f"{shown}\n{' ' * (at - start)}^"


# ---- replies ---------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Expected:
    """The expected reply to a line."""

    text: str
    parts: tuple[bytes, ...] | None  # the reply, with anything between two parts; None: there must be none
    within_ns: int | None = None

    @property
    def wait_ns(self) -> int | None:
        """Time after which the line is over in any case; None: when the controller is idle."""
        return self.within_ns if self.parts is None else None

    def why_not(self, reply: bytes, complete: bool, took_ns: int, text: str | None = None) -> str:
        """Why this reply of a line, over or given up after took_ns, is not as expected; "" if it is. text: the reply in
        the controller's language, an alternative to the bytes."""
        read = reply if text is None else text.encode("latin-1", "replace")
        binary = read.rstrip() != reply.rstrip()
        answered = f"answered {text if binary else readable(reply)}" if reply else "not answered"
        ways = (reply, read, reply.rstrip(), read.rstrip())  # white space at the end is optional
        fits = not reply if self.parts is None else any(_fits(each, self.parts) for each in ways)
        took = f"{took_ns / SECOND_NS:.6g} s"
        if not complete:
            return f"{answered}, not over after {took}"
        if not fits:
            return answered
        if self.wait_ns is None and self.within_ns is not None and took_ns > self.within_ns:
            return f"over after {took}"
        return ""


def _fits(reply: bytes, parts: tuple[bytes, ...]) -> bool:
    """True if a reply consists of the parts in order, with anything between two of them."""
    if len(parts) == 1:
        return reply == parts[0]
    first, *middle, last = parts
    if len(reply) < len(first) + len(last) or not reply.startswith(first) or not reply.endswith(last):
        return False
    at, end = len(first), len(reply) - len(last)
    for part in middle:
        at = reply.find(part, at, end)
        if at < 0:
            return False
        at += len(part)
    return True


def parse_expected(text: str) -> Expected:
    """Parse the text after `=>`. Raises ExpectError."""
    stripped = text.strip(" \t")
    within_ns = None
    body = text.rstrip(" \t")
    if within := _WITHIN.search(text):
        body = text[: within.start()].rstrip(" \t")
        within_ns = _duration(text, within.end())
    wanted = body.strip(" \t")
    if not wanted:
        raise ExpectError(
            "say what is expected: a reply, * (anything) or none", text.find(stripped) if stripped else len(text)
        )
    if wanted == "none":
        return Expected(stripped, None, within_ns)
    parts, place = [b""], body.find(wanted)
    while place < len(body):
        if item := _ITEM.match(body, place):
            if item[0] == "*":
                parts.append(b"")
            elif (byte := _BYTE.fullmatch(item[1])) and int(byte[1]) < 256:
                parts[-1] += bytes([int(byte[1])])
            else:
                raise ExpectError(f"{item[0]} is no byte (<0> to <255>)", place)
            place = item.end()
            continue
        try:
            parts[-1] += encoded(body[place])
        except LanguageError as error:
            raise ExpectError(str(error), place) from None
        place += 1
    return Expected(stripped, tuple(parts), within_ns)


def _duration(text: str, begin: int) -> int:
    """Parse the text from `begin` on as a time, in ns."""
    at = _skip(text, begin)
    found = _DURATION.fullmatch(text[at:].rstrip(" \t"))
    if found is None:
        raise ExpectError("within needs a time, such as 5 s, 200 ms or 2 min", at)
    time_ns = float(found[1]) * _TIME_NS[found[2]]
    if time_ns > LONGEST_S * SECOND_NS:
        raise ExpectError(f"a time of more than {LONGEST_S:.0f} s; make it shorter", at)
    return round(time_ns)


# ---- conditions ------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Seen:
    """The result of a condition."""

    met: bool
    value: str  # for people, with its unit


@dataclass(frozen=True)
class Condition:
    """A condition after a line; `name_at`, `value_at`: indices in the parsed text."""

    text: str
    name: str
    comparison: str
    value: float | str  # in the first unit of its quantity, or a word
    tolerance: float
    name_at: int
    value_at: int

    def check(self, twin: Twin) -> None:
        """Raise ExpectError for a name or a word that this twin does not have."""
        head, _, rest = self.name.partition(".")
        if head in _QUANTITIES:
            axes = AXIS_NAMES[: len(twin.counts)]
            if rest and rest not in CARRIAGES and rest not in axes:
                raise ExpectError(f"{self.name}: the controller has the axes {', '.join(axes)}", self.name_at)
            return
        kind, name = (head, rest) if head in _KINDS else (self._kind(twin), self.name)
        known = _named(twin, kind)
        if kind != "output" and name not in known:
            raise ExpectError(f"unknown {kind} {name}; there are {', '.join(known)}", self.name_at)
        if head not in _KINDS and name not in known:
            names = [*_QUANTITIES, *_named(twin, "output"), *_named(twin, "input")]
            raise ExpectError(f"unknown name {name}; there are {', '.join(dict.fromkeys(names))}", self.name_at)
        if kind == "input" and isinstance(self.value, str):
            switches = [switch.name for switch in twin.machine.switches]
            states = {*twin.settable.get(name, ()), *(("free", "struck") if name in switches else ())}
            if self.value not in states:
                raise ExpectError(f"{name} can be {', '.join(sorted(states))}", self.value_at)

    def look(self, twin: Twin, last: Result | None) -> Seen:
        """Evaluate it now. last: result of the last command of the job."""
        head, _, rest = self.name.partition(".")
        if head not in _QUANTITIES:
            kind, name = (head, rest) if head in _KINDS else (self._kind(twin), self.name)
            found = _named(twin, kind).get(name)
            if found is not None and kind == "input" and self.value in FAULTS:  # it may have both a state and a fault
                found = str(twin.faults.get(name, "ok"))
            if found is None:
                return Seen(False, f"there is no {kind} {name}")
            if isinstance(found, str):
                equal = found == self.value
                return Seen(equal if self.comparison == "==" else not equal, found)
            return Seen(not isinstance(self.value, str) and self._holds(float(found)), str(found))
        value = _measured(twin, head, rest, last)
        if value is None:
            return Seen(False, "has no value here")
        quantity = _QUANTITIES[head]
        unit = next(iter(quantity.units))
        shown = f"{value:.0f}" if quantity.whole else f"{value:.6g}"
        return Seen(self._holds(value), f"{shown} {unit}".strip())

    def _holds(self, value: float) -> bool:
        wanted = float(self.value)
        if self.comparison == "==":
            return abs(value - wanted) <= self.tolerance * (1.0 + 1e-9)  # 50.03 - 50 is more than 0.03 in binary
        return not math.isnan(value) and _COMPARE[self.comparison](value, wanted)

    def _kind(self, twin: Twin) -> str:
        """Kind of a name without a prefix: an input for a word as value, an output for a number."""
        return "input" if isinstance(self.value, str) else "output"


def _named(twin: Twin, kind: str) -> Mapping[str, int | str]:
    if kind == "input":
        return {**dict.fromkeys(twin.settable, "ok"), **twin.inputs}  # a contact without a fault is ok
    return twin.outputs if kind == "output" else {name: int(level) for name, level in twin.levels.items()}


def lost_steps(twin: Twin) -> NDArray[np.float64]:
    """float64 [axes], whole steps that each axis has lost since power-on, forgotten ones included."""
    return whole_slips(twin.lost_steps, twin.slip_steps) + twin.forgotten_steps


def _measured(twin: Twin, name: str, axis: str, last: Result | None) -> float | None:
    if name == "bytes":
        return float(getattr(twin.line_faults, axis) if axis else sum(twin.line_faults))
    own = slice(None) if not axis else slice(AXIS_NAMES.index(axis), AXIS_NAMES.index(axis) + 1)
    if name == "lost":
        return float(lost_steps(twin)[own].sum())
    if name == "unpowered":
        return float(twin.unpowered_steps.sum())
    if name == "restarts":
        return float(twin.restarts)
    if name in CARRIAGES:
        return float(twin.position_mm[CARRIAGES.index(name)])
    if name == "error":
        return float(twin.position_error_mm[CARRIAGES.index(axis)])
    if name == "count":
        return float(twin.counts[AXIS_NAMES.index(axis)])
    if name == "clock":
        return twin.time_ns / SECOND_NS
    if name == "steps":
        return float(twin.steps.made)
    if name == "fault":
        return float(twin.fault)
    if name == "lag":
        return float(twin.following_error[own][0] if axis else np.abs(twin.following_error).max())
    if name == "drive_faults":
        return float(sum(times for times, _ in twin.drive_faults[own]))
    if last is None:
        return None
    if name == "time":
        return (last.end_ns - last.time_ns) / SECOND_NS
    return min((margin for margin in last.margin[own] if margin is not None), default=None)


def parse_condition(text: str) -> Condition:
    """Parse the text after `!`. Raises ExpectError."""
    end = len(text.rstrip(" \t"))
    at = _skip(text, 0)
    name = _NAME.match(text, at, end)
    if name is None:
        raise ExpectError("say what must be so, for example lost == 0 or x == 50 +- 0.03 mm", min(at, end))
    quantity = _quantity(name[0], at)
    at = _skip(text, name.end())
    comparison = _OPERATOR.match(text, at, end)
    if comparison is None:
        raise ExpectError(f"{name[0]} must be followed by one of ==, !=, <, <=, >, >=", min(at, end))
    value_at = at = _skip(text, comparison.end())
    number, word = _NUMBER.match(text, at, end), _WORD.match(text, at, end)
    if number is None and word is None:
        raise ExpectError("a number or a word must follow", min(at, end))
    at = _skip(text, (number or word).end())  # type: ignore[union-attr]
    if number is None and word is not None:
        if quantity is not _PLAIN:
            raise ExpectError(f"{name[0]} is a number", value_at)
        if comparison[0] not in ("==", "!="):
            raise ExpectError("a state is == or !=", comparison.start())
        if at < end:
            raise ExpectError("nothing may follow a state", at)
        return Condition(text.strip(" \t"), name[0], comparison[0], word[0], 0.0, name.start(), value_at)
    assert number is not None
    value, tolerance = float(number[0]), 0.0
    factor, at, unit_at = _unit(text, at, end, quantity)
    if sign := _TOLERANCE.match(text, at, end):
        tolerance_at = _skip(text, sign.end())
        spread = _NUMBER.match(text, tolerance_at, end)
        if spread is None or float(spread[0]) < 0.0:
            raise ExpectError("a tolerance must follow, for example +- 0.03 mm", min(tolerance_at, end))
        if comparison[0] != "==":
            raise ExpectError("a tolerance goes with == only", sign.start())
        tolerance = float(spread[0])
        own, at, own_at = _unit(text, _skip(text, spread.end()), end, quantity)
        if unit_at is None:
            factor = own
        tolerance *= own if own_at is not None else factor
    elif comparison[0] in ("==", "!=") and not quantity.whole:
        raise ExpectError(
            f"{name[0]} is measured: use <, > or == with a tolerance, such as +- 0.03", comparison.start()
        )
    if at < end:
        raise ExpectError(f"this cannot follow; units of {name[0]}: {quantity.unit_names}", at)
    value *= factor
    if not (math.isfinite(value) and math.isfinite(tolerance)):
        raise ExpectError("the number is too large", value_at)
    return Condition(text.strip(" \t"), name[0], comparison[0], value, tolerance, name.start(), value_at)


def _quantity(name: str, at: int) -> _Quantity:
    head, dot, rest = name.partition(".")
    quantity = _QUANTITIES.get(head)
    if quantity is None:
        if head in _KINDS and not rest:
            raise ExpectError(f"{head} needs a name behind it: {head}.NAME", at)
        if dot and head not in _KINDS:
            dotted = [f"{name}.{quantity.axes[0]}" for name, quantity in _QUANTITIES.items() if quantity.axes]
            there = ", ".join([*dotted, *(f"{kind}.NAME" for kind in _KINDS)])
            raise ExpectError(f"unknown name {name}; with a dot there are {there}", at)
        return _PLAIN
    if dot and rest not in quantity.axes:
        some = f"{head}.{', '.join(quantity.axes)}" if quantity.axes else f"{head} alone"
        raise ExpectError(f"unknown name {name}; there is {some}", at)
    if not dot and not quantity.alone:
        raise ExpectError(f"{head} needs an axis: {head}.{quantity.axes[0]}", at)
    return quantity


def _unit(text: str, at: int, end: int, quantity: _Quantity) -> tuple[float, int, int | None]:
    """Factor of the unit at an index, the index after it, and its own; the first unit if there is none."""
    word = _WORD.match(text, at, end)
    if word is None:
        return next(iter(quantity.units.values())), at, None
    if word[0] not in quantity.units:
        raise ExpectError(f"unit {word[0]} does not fit; allowed: {quantity.unit_names}", at)
    return quantity.units[word[0]], _skip(text, word.end()), at


def _skip(text: str, at: int) -> int:
    return len(text) - len(text[at:].lstrip(" \t"))
