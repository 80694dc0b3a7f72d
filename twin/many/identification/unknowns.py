"""Named parameters of a machine to identify, and their prior distributions.

    name             stands for                                                       as
    friction.x       axes.x.guide_friction, shaft_coulomb, shaft_viscous              a common factor
    stiffness.x      axes.x.stiffness and the structure's modes along X               a common factor
    backlash.x       axes.x.backlash                                                  mm
    lead.x           axes.x.lead_error (and the imperfection of that name, on)        %
    iron_loss.x      axes.x.specimen.iron_loss                                        a factor on the motor's
    damping.x        axes.x.shaft_viscous                                             N m s
    supply           axes.all.stage.supply                                            V
    mass             all [masses]                                                     a common factor
    switch.limit_x2  contacts.limit_x2.position                                       mm
    repeatability    switches.repeatability                                           mm
    squareness.xy, guides.x_y, guides.turn_x, axes.x.screw_warming                    mm/m, um, mm/m, K
    any key          of `isel-twin describe`: axes.z.brake, controller.start_stop_hz ...

Keys that measurements cannot separate have a common factor: guides and shaft both brake, and a gauge at the tool sees
screw and frame in series. If you can separate them, name single keys.

In the fit each is a number u, 0 at the prior value, in standard deviations of the prior:

    value = prior exp(s u)      if positive                  value = prior + s u      if 0 or negative is possible

and ends where the range of the machine file does. The prior range holds 95 %, so s is a quarter of its width (in the
logarithm). By default it is the interval that the machine file tells, else what its grade means (machine/spread.py); of
a common factor the widest of its numbers.
"""

from __future__ import annotations

import copy
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Row, hint, rows
from isel_twin.machine import Machine, machine_from_tree
from isel_twin.machine.ranges import limits
from isel_twin.machine.spread import GRADE_FACTOR, LEAD_PERCENT

SWITCH_MM = 2.0  # prior range of a switch position, either way: cams are clamped by hand
# errors of geometry that may be of either sign: beginning and end of the key, the imperfection, half of the prior range
GEOMETRY = (
    ("squareness.", "", "squareness", 0.5),
    ("guides.turn_", "", "abbe", 0.3),
    ("guides.", "_x", "straightness", 50.0),
    ("guides.", "_y", "straightness", 50.0),
    ("guides.", "_z", "straightness", 50.0),
    ("axes.", ".screw_warming", "growth", 10.0),
)

FRICTION_KEYS = ("guide_friction", "shaft_coulomb", "shaft_viscous")  # of an axis

_SD_PER_RANGE = 4.0  # standard deviations in a range that holds 95 % (3.92, rounded up)


@dataclass(frozen=True)
class Unknown:
    name: str
    keys: tuple[str, ...]  # keys of the machine file that it sets
    prior: float
    low: float
    high: float  # ends of the 95 % prior range
    unit: str
    source: str  # where the prior comes from
    factor: bool = False  # the value multiplies the numbers in the machine file
    whole: bool = False  # the file has whole numbers only
    flag: str = ""  # imperfection that must be on for an effect
    place: bool = False  # a position from an arbitrary zero: the prior is additive
    least: float = -math.inf
    most: float = math.inf  # ends of what a machine file allows

    @property
    def logarithmic(self) -> bool:
        return self.low > 0.0 and not self.place

    @property
    def deviation(self) -> float:
        """s in the module docstring: of the logarithm, or of the value."""
        width = math.log(self.high / self.low) if self.logarithmic else self.high - self.low
        return width / _SD_PER_RANGE

    def value(self, u: float) -> float:
        """The value at u standard deviations from the prior, or the nearest one that is allowed."""
        free = self.prior * math.exp(self.deviation * u) if self.logarithmic else self.prior + self.deviation * u
        return min(max(free, self.least), self.most)

    @property
    def ends(self) -> tuple[float, float]:
        """The u of the least and the greatest value that are allowed."""
        least, most = (math.isfinite(end) and (end > 0.0 or not self.logarithmic) for end in (self.least, self.most))
        return self.at(self.least) if least else -math.inf, self.at(self.most) if most else math.inf

    def at(self, value: float) -> float:
        """u of a value, the inverse of `value`."""
        if self.logarithmic:
            return math.log(value / self.prior) / self.deviation
        return (value - self.prior) / self.deviation


def parse_prior(text: str) -> tuple[str, float, float]:
    """Parse NAME=LOW..HIGH. Raises ValueError with one line."""
    name, equals, span = (part.strip() for part in text.partition("="))
    low_text, dots, high_text = span.partition("..")
    try:
        low, high = float(low_text), float(high_text)
    except ValueError:
        low = high = math.nan
    if not (equals and dots and name and low < high and math.isfinite(high - low)):
        raise ValueError(f"prior {text!r}: must be NAME=LOW..HIGH, for example backlash.x=0.005..0.08")
    return name, low, high


def default_names(axes: Iterable[str], machine: Machine) -> list[str]:
    """Parameters fitted by default, for the measured axes; only stages of stepper motors have a supply."""
    axes = list(dict.fromkeys(axes))
    named = [f"{what}.{axis}" for axis in axes for what in ("friction", "backlash", "stiffness")]
    return [*named, *_supply(machine), "mass"]


@dataclass(frozen=True)
class _Meaning:
    keys: tuple[str, ...]
    factor: bool = False
    flag: str = ""
    half: float | None = None  # half of the prior range, if the grade of the number does not give it
    prior: float | None = None  # None: that of the first key
    unit: str = "1"  # if the machine file does not have the key


def _meaning(machine: Machine, name: str) -> _Meaning:
    what, _, of = name.partition(".")
    if of in CARRIAGES:
        match what:
            case "friction":
                return _Meaning(tuple(f"axes.{of}.{key}" for key in FRICTION_KEYS), factor=True)
            case "stiffness":
                modes = machine.structure if machine.imperfections.structure else ()
                of_modes = (f"structure.{mode.joint}.stiffness" for mode in modes if mode.axis == of)
                return _Meaning((f"axes.{of}.stiffness", *of_modes), factor=True)
            case "iron_loss":
                return _Meaning((f"axes.{of}.specimen.iron_loss",))
            case "damping":
                return _Meaning((f"axes.{of}.shaft_viscous",))
            case "backlash":
                return _Meaning((f"axes.{of}.backlash",), flag="backlash")
            case "lead":
                prior = None if machine.imperfections.lead_error else 0.0
                return _Meaning((f"axes.{of}.lead_error",), flag="lead_error", half=LEAD_PERCENT, prior=prior)
    if name == "supply":
        return _Meaning(tuple(f"axes.{axis}.stage.supply" for axis in CARRIAGES))
    if name == "mass":
        return _Meaning(tuple(f"masses.{body}" for body in machine.tree["masses"]), factor=True)
    if name == "repeatability":
        return _Meaning(("switches.repeatability",))
    if what == "switch":
        for contact in machine.switches:
            if contact.name == of:
                key = f"contacts.{of}.position"
                return _Meaning((key,), half=SWITCH_MM, prior=contact.position_mm, unit="mm")
    for begin, end, flag, half in GEOMETRY:
        if name.startswith(begin) and name.endswith(end):
            prior = None if getattr(machine.imperfections, flag) else 0.0
            return _Meaning((name,), flag=flag, half=half, prior=prior)
    if name.startswith("axes.all."):
        return _Meaning(tuple(f"axes.{axis}.{name.removeprefix('axes.all.')}" for axis in CARRIAGES))
    return _Meaning((name,))


def unknown(machine: Machine, name: str, span: tuple[float, float] | None = None) -> Unknown:
    """The parameter of that name; span: its prior range. Raises ValueError with one line."""
    meaning, setting = _meaning(machine, name), name.startswith("controller.")
    by_key = {row.parameter: row for row in rows(machine.tree)}
    found = [by_key[key] for key in meaning.keys if key in by_key]
    prior = meaning.prior
    if prior is None and len(found) < len(meaning.keys) and not (setting and span):
        raise ValueError(
            f"fit {name!r}: no such parameter; {hint(name, [*_names(machine), *by_key])} (see isel-twin describe)"
        )
    for row in found:
        if isinstance(row.value, bool | str):
            raise ValueError(f"fit {name!r}: {row.parameter} is {row.value!r}, which is no number")
    first = found[0] if found else None
    source = "estimate" if first is None else f"{first.grade}: {first.source}" if first.source else first.grade
    if prior is None:
        prior = 1.0 if meaning.factor else math.nan if first is None else float(first.value)
    if span is not None:
        low, high = span
        source = f"range of {low:g} .. {high:g}"
        if not low <= prior <= high:
            prior = math.sqrt(low * high) if low > 0.0 and meaning.half is None else 0.5 * (low + high)
    elif (told := _told(found, meaning)) is not None and told[0] < prior < told[1]:
        low, high = told
    elif meaning.half is not None:
        low, high = prior - meaning.half, prior + meaning.half
    elif prior > 0.0:
        low = prior * min(_share(row, 0) for row in found)
        high = prior * max(_share(row, 1) for row in found)
    else:
        raise ValueError(f"prior {name}: is {prior:g} in the machine file; say a range: --prior {name}=LOW..HIGH")
    ranges = [_allowed(machine, key, meaning.factor) for key in meaning.keys]
    return Unknown(
        name,
        meaning.keys,
        prior,
        low,
        high,
        unit="1" if meaning.factor else meaning.unit if first is None else first.unit,
        source=source,
        factor=meaning.factor,
        whole=(setting and (first is None or isinstance(first.value, int))) or _whole(meaning.keys[0]),
        flag=meaning.flag,
        place=meaning.half is not None,
        least=max(least for least, _ in ranges),
        most=min(most for _, most in ranges),
    )


def _whole(key: str) -> bool:
    """True if a machine file has whole numbers there, in its own unit."""
    allowed = limits(key)
    return allowed.whole and allowed.scale == 1.0


def _allowed(machine: Machine, key: str, factor: bool) -> tuple[float, float]:
    """The range of a number of the machine file, or of a factor on it."""
    allowed, number = limits(key), _number(machine.tree, key) if factor else 1.0
    return (allowed.low / number, allowed.high / number) if number > 0.0 else (-math.inf, math.inf)


def _told(found: Sequence[Row], meaning: _Meaning) -> tuple[float, float] | None:
    """The interval that the file tells of the one number that a parameter is."""
    return found[0].interval if len(found) == 1 and not meaning.factor else None


def _share(row: Row, end: int) -> float:
    """The lower (0) or upper (1) end of the prior range of a number over it."""
    if row.interval is not None:
        return row.interval[end] / float(row.value)
    return GRADE_FACTOR[row.grade] ** (2 * end - 1)


def _supply(machine: Machine) -> list[str]:
    return [] if any(axis.closed_loop for axis in machine.axes) else ["supply"]


def _names(machine: Machine) -> list[str]:
    per_axis = [
        f"{what}.{axis}"
        for what in ("friction", "backlash", "stiffness", "lead", "iron_loss", "damping")
        for axis in CARRIAGES
    ]
    switches = [f"switch.{contact.name}" for contact in machine.switches]
    return [*per_axis, *_supply(machine), "mass", "repeatability", *switches]


def changes(machine: Machine, unknowns: Sequence[Unknown], values: Sequence[float]) -> dict[str, float]:
    found: dict[str, float] = {}
    for item, value in zip(unknowns, values, strict=True):
        for key in item.keys:
            times = _number(machine.tree, key) if item.factor else 1.0
            found[key] = round(value) if item.whole else value * times
    return found


def _number(tree: Mapping[str, Any], key: str) -> float:
    content: Any = tree
    for part in key.split("."):
        content = content[part]
    return float(content["value"])


def candidate(machine: Machine, unknowns: Sequence[Unknown], values: Sequence[float]) -> Machine:
    """The machine with these values [n] of the unknowns, and switches without scatter.

    Raises MachineError for a value out of its limits.
    """
    tree: dict[str, Any] = copy.deepcopy(dict(machine.tree))
    units = {item.keys[0]: item.unit for item in unknowns}
    for key, value in changes(machine, unknowns, values).items():
        *path, last = key.split(".")
        content = tree
        for part in path:
            content = content.setdefault(part, {})
        old = content.get(last) or {"unit": units.get(key, "1")}
        said = {part: told for part, told in old.items() if part != "interval"}
        content[last] = {**said, "value": value, "grade": "measured", "source": "candidate"}
    for item in unknowns:
        if item.flag:
            tree["imperfections"][item.flag] = True
    tree["imperfections"]["repeatability"] = False
    return machine_from_tree(tree, machine.file)
