"""Parameters of a plan, and the check of each against machine, settings, job and scenario."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Limits, Place, boolean, hint, known, plain, rows, text
from isel_twin.language import SETTINGS_RANGES
from isel_twin.machine import LEVELS, Machine
from isel_twin.many.studies.row import OUTCOMES, Work
from isel_twin.wiring import EVENT_KEYS
from isel_twin.wiring.scenario import TIME_KEYS

TIMES = "times"  # unit of a value that multiplies the one in the file
EVENTS = "events"  # the parameter of [scenario] that lists the named events that happen, separated by blanks
_FORM = ("values", "low", "high", "steps", "unit", "name", "log", "whole")  # keys of a parameter
_STEPS = Limits("steps", 2, 100_000, whole=True)
_ANY = Limits("", -1e300, 1e300)
_PLACEHOLDER = re.compile(r"[A-Za-z_]\w*")
_COLUMN = re.compile(r"[A-Za-z_][A-Za-z0-9_]{0,62}")
_OWN = ("row", "point", "seed", *OUTCOMES)  # columns of every table


@dataclass(frozen=True)
class Parameter:
    section: str
    key: str
    name: str
    unit: str = ""  # as in the machine file; TIMES: a factor; "": none
    values: tuple[Any, ...] = ()  # all of one type; none: sampled between `low` and `high`
    low: float = 0.0
    high: float = 0.0
    log: bool = False
    whole: bool = False

    @property
    def sampled(self) -> bool:
        """True with a range instead of values."""
        return not self.values

    @property
    def kind(self) -> str:
        """Type of its column: bool, int64, float64 or string."""
        if self.sampled:
            return "int64" if self.whole else "float64"
        if isinstance(self.values[0], str):
            return "string"
        if isinstance(self.values[0], bool):
            return "bool"
        return "int64" if all(isinstance(value, int) for value in self.values) else "float64"


def flat(content: Mapping[str, Any], place: Place, prefix: str = "") -> list[tuple[str, Any]]:
    """Parameters by dotted keys: `a.b = [1]` and `"a.b" = [1]` are the same. A table with a key of _FORM is a
    parameter."""
    found: list[tuple[str, Any]] = []
    for key, value in content.items():
        if isinstance(value, dict) and not any(name in value for name in ("values", "low", "high")):
            if not value or all(not isinstance(inner, dict | list) for inner in value.values()):
                raise place.at(prefix + key).wrong(
                    f"{value!r}; allowed: values = [...], or low and high, with steps or without"
                )
            found += flat(value, place, f"{prefix}{key}.")
        else:
            found.append((prefix + key, value))
    return found


def read_parameter(section: str, key: str, form: Any, place: Place, work: Work, machine: Machine) -> Parameter:
    content = {"values": form} if isinstance(form, list) else form
    if not isinstance(content, dict):
        raise place.wrong(f"{form!r}; allowed: a list of values, or a table such as {{ low = 1, high = 2 }}")
    known(content, _FORM, place)
    unit = text(content.get("unit", ""), place.at("unit"))
    check = {"machine": _machine_key, "settings": _settings_key, "job": _job_key, "scenario": _scenario_key}[section]
    is_number = check(key, unit, place, work, machine)
    name = text(content.get("name", re.sub(r"\W", "_", key)), place.at("name"))
    if not _COLUMN.fullmatch(name):
        raise place.at("name").wrong(f"{name!r}; allowed: a word of letters, digits and _, for the column")
    log, whole = (boolean(content.get(switch, False), place.at(switch)) for switch in ("log", "whole"))
    if "values" in content:
        for other in ("low", "high", "steps", "log", "whole"):
            if other in content:
                raise place.at(other).wrong("there are values; allowed: either values, or low and high")
        return Parameter(section, key, name, unit, _values(content["values"], is_number, place.at("values")))
    for end in ("low", "high"):
        if end not in content:
            raise place.at(end).wrong("missing; allowed: low and high, or values = [...]")
        if is_number is False:
            raise place.wrong("is no number; allowed: values = [...]")
    low, high = (plain(content[end], _ANY, place.at(end)) for end in ("low", "high"))
    whole = whole or section == "settings"
    if not low < high:
        raise place.at("high").wrong(f"{high:g}; allowed: more than low, {low:g}")
    if log and low <= 0.0:
        raise place.at("low").wrong(f"{low:g}; allowed with log = true: more than 0")
    if whole and (low != int(low) or high != int(high)):
        raise place.wrong(f"{low:g} .. {high:g}; allowed: whole numbers")
    ranged = Parameter(section, key, name, unit, (), low, high, log, whole)
    if "steps" not in content:
        return ranged
    steps = int(checked_number(content["steps"], _STEPS, place.at("steps")))
    spread = dict.fromkeys(between(ranged, n / (steps - 1)) for n in range(steps))
    return replace(ranged, values=tuple(spread))


def between(parameter: Parameter, part: float) -> float:
    """The value at a fraction of a range, from low (0) to high (1); whole numbers are equally frequent."""
    low, high = parameter.low, parameter.high
    value = low * (high / low) ** part if parameter.log else low + part * (high - low)
    value = min(max(value, low), high)
    return round(value) if parameter.whole else value


def _values(value: Any, is_number: bool | None, place: Place) -> tuple[Any, ...]:
    if not isinstance(value, list) or not value:
        raise place.wrong(f"{value!r}; allowed: a list of values")
    kinds = {float if type(one) is int else type(one) for one in value}  # JSON's types: number, text, switch
    one_kind = len(kinds) == 1 and kinds <= {float, str, bool}
    if not one_kind or (is_number is not None and is_number != (kinds == {float})):
        wanted = "numbers" if is_number else "texts or switches" if is_number is False else "all of one kind"
        raise place.wrong(f"{value!r}; allowed: {wanted}")
    for number, one in enumerate(value):
        if one in value[:number]:
            raise place.wrong(f"{one!r} stands twice; allowed: different ones")
    return tuple(value)


def _machine_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    """Check key and unit; return whether it takes numbers (None: as the values are)."""
    if key == "imperfections":
        _no_unit(unit, place, f"nothing; the values are levels: {', '.join(LEVELS)}")
        return False
    listed = {row.parameter: row for row in rows(machine.tree)}
    first = f"axes.{CARRIAGES[0]}."
    for name in [name.removeprefix(first) for name in listed if name.startswith(first)]:
        if all(f"axes.{axis}.{name}" in listed for axis in CARRIAGES):
            listed[f"axes.all.{name}"] = listed[first + name]
    if key not in listed:
        raise place.wrong(f"unknown parameter of {machine.name}; {hint(key, listed, 'isel-twin describe lists them')}")
    row = listed[key]
    if isinstance(row.value, str | bool):
        _no_unit(unit, place, "none")
        return False
    needed = row.unit not in ("", "1")
    allowed = [f"{row.unit!r}"] if needed else []
    if unit == "" and needed:
        raise place.at("unit").wrong(f'missing; allowed: unit = "{row.unit}", or unit = "{TIMES}" for multiples')
    if unit not in ("", row.unit, TIMES):
        raise place.at("unit").wrong(f"{unit!r}; allowed: {', '.join([*allowed, repr(TIMES)])}")
    return True


def _settings_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if key not in SETTINGS_RANGES:
        raise place.wrong(f"unknown setting; {hint(key, SETTINGS_RANGES)}")
    if not work.moves:
        raise place.wrong(
            f"a job file says its settings itself; allowed: write {{{key}}} in the job and {key} in [job], or moves"
        )
    _no_unit(unit, place, "none; the key tells it")
    return True


def _job_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if work.moves:
        raise place.wrong("moves have no text; allowed: parameters of [settings], or job in place of moves")
    _no_unit(unit, place, "none; the command tells it")
    if key.startswith("line "):
        count, number = len(work.job_lines), key.removeprefix("line ")
        if not number.isdigit() or not 1 <= int(number) <= count:
            raise place.wrong(f"{work.job_name} has no such line; allowed: line 1 .. line {count}")
        return None
    if not _PLACEHOLDER.fullmatch(key) or f"{{{key}}}" not in work.job:
        there = dict.fromkeys(re.findall(r"\{([A-Za-z_]\w*)\}", work.job))
        raise place.wrong(
            f"{{{key}}} does not stand in {work.job_name}; " + (hint(key, there) if there else 'allowed: "line N"')
        )
    return None


def _scenario_key(key: str, unit: str, place: Place, work: Work, machine: Machine) -> bool | None:
    if not work.events:
        raise place.wrong("there is no scenario; allowed: beside scenario = FILE in [sweep]")
    if unit not in ("", TIMES):
        raise place.at("unit").wrong(f"{unit!r}; allowed: {TIMES!r}, or none: keys of a scenario tell their unit")
    if key == EVENTS:
        return False
    name, _, rest = key.partition(".")
    names = work.event_names
    numbers = [str(number) for number in range(1, len(work.events) + 1)]
    if name not in (*names, *numbers):
        raise place.wrong(f"there is no event {name!r}; {hint(name, [*names, *numbers, EVENTS])}")
    first = rest.partition(".")[0]
    if first not in (*TIME_KEYS, *EVENT_KEYS):
        raise place.wrong(f"unknown key of an event; {hint(first, (*TIME_KEYS, *EVENT_KEYS))}")
    return True if unit == TIMES else None


def _no_unit(unit: str, place: Place, allowed: str) -> None:
    if unit:
        raise place.at("unit").wrong(f"{unit!r}; allowed: {allowed}")


def check_names(parameters: Sequence[Parameter], place: Place) -> None:
    names: list[str] = []
    for parameter in parameters:
        where = place.at(parameter.section).at(parameter.key)
        if parameter.name in (*names, *_OWN):
            whose = "another parameter" if parameter.name in names else "an outcome"
            raise where.wrong(
                f'the column {parameter.name!r} is that of {whose}; allowed: name = "..." gives it another one'
            )
        names.append(parameter.name)


def check_events(parameters: Sequence[Parameter], work: Work, place: Place) -> None:
    """Check that all events named by `events` exist."""
    names = work.event_names
    for parameter in parameters:
        if (parameter.section, parameter.key) != ("scenario", EVENTS):
            continue
        where = place.at("scenario").at(EVENTS)
        if not names:
            raise where.wrong("no event of the scenario has a name; allowed: beside events with name = '...'")
        for name in " ".join(map(str, parameter.values)).split():
            if name not in names:
                raise where.wrong(f"there is no event {name!r}; {hint(name, names)}")


def checked_number(value: Any, limits: Limits, place: Place) -> float:
    """A number within limits; a whole one stays an integer."""
    held = plain(value, limits, place)
    if limits.whole and not isinstance(value, int):
        raise place.wrong(f"{value}; allowed: a whole number")
    return int(value) if limits.whole else held
