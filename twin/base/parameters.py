"""Numbers in files: TOML in which a number says its unit, its grade and its source, and a limit stands once.

Goal: a wrong value, in a file, in an override or in Python, gives one line that names the place, the value and what is
allowed. A number may say the `interval = [low, high]`, too, that holds it with 95 %. The allowed range is written once,
at the field that holds the number:

    file        backlash = { value = 0.02, unit = "mm", grade = "estimate", source = "0.01 to 0.02 mm remain" }
                    | section, read: the key, the unit, the range
    field       backlash_mm: float = number("mm", 0.0, 1.0, key="backlash")
                    | check, in __post_init__: the same range
    Python      Screw(backlash_mm=0.02)

    file: axes.x.backlash: 2; allowed: 0 .. 1 mm           a `Place`, what is wrong there, and the remedy

A tree is the content of a TOML file, dictionaries in dictionaries. Trees are combined before they are read: `merge`
lays one over another, `spread` copies a table `all` to several names, `override` changes one value, `rows` lists all
values. Words and switches are plain values in the file. Files without units (events, plans) use only `table`, `known`,
`plain` and `text`.
"""

from __future__ import annotations

import copy
import dataclasses
import difflib
import json
import sys
import tomllib
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import MISSING, dataclass, field
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar, cast

from isel_twin.base.printable import shown_line

# how reliable a number is: fitted to data by a model that may be wrong; a setting is chosen by people
GRADES = ("measured", "fitted", "datasheet", "estimate", "setting")

T = TypeVar("T")

MOST_DEPTH = 50  # of tables and lists in each other, in any file


class FileError(ValueError):
    """A file is wrong; one line that names the file, the key, the value and what is allowed."""


@dataclass(frozen=True)
class Place:
    """Where in a file a value stands, and the error that says what is wrong with it."""

    file: Path | str
    error: type[FileError] = FileError
    key: str = ""  # keys from the top of the file, with dots; "" is the file as a whole

    def at(self, key: str) -> Place:
        """The place of a key of the table that stands here."""
        there = object.__new__(type(self))  # dataclasses.replace takes five times as long
        vars(there).update(vars(self), key=f"{self.key}.{key}" if self.key else key)
        return there

    def wrong(self, what: str) -> FileError:
        """The error to raise for a value that stands here."""
        return self.error(shown_line(f"{self}: {what}"))

    def __str__(self) -> str:
        return f"{self.file}: {self.key}" if self.key else str(self.file)


# Fields --------------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Limits:
    """Allowed range [low, high] of a number in a file, in `unit`; the field holds value * scale."""

    unit: str
    low: float
    high: float
    scale: float = 1.0
    whole: bool = False  # the field is an integer

    def __str__(self) -> str:
        return f"{self.low:g} .. {self.high:g} {self.unit}".rstrip()


def number(
    unit: str,
    low: float,
    high: float,
    *,
    key: str = "",
    scale: float = 1.0,
    whole: bool = False,
    optional: bool = False,
    default: Any = MISSING,
) -> Any:
    """A dataclass field within [low, high]. It stands in files under `key` ("": in no file) in `unit`; the field holds
    value * scale.

    default: for Python, allowed even outside the range: it may mean "none" or "unknown". A file must give the number
    unless it is optional.
    """
    limits = Limits(unit, low, high, scale, whole)
    return field(default=default, metadata={"key": key, "rule": limits, "optional": optional})


def word(*choices: str, default: Any = MISSING) -> Any:
    """A dataclass field that is one of `choices` (none: any string), in files under its own name."""
    return field(default=default, metadata={"rule": choices})


def flag(default: Any = MISSING) -> Any:
    """A dataclass field that is true or false, in files under its own name."""
    return field(default=default, metadata={"rule": bool})


def check(instance: Any) -> None:
    """Raise ValueError if a number or word of a dataclass is outside what its field allows."""
    kind: Any = type(instance)
    for name, default, rule, low, high in _checks(kind):
        value = getattr(instance, name)
        if low is None:
            if value not in rule:
                raise ValueError(f"{kind.__name__.lower()}: {name} must be one of {_listed(rule)}, not {value!r}")
        elif (low <= value <= high and not rule.whole) or value == default or (value != value and default != default):
            continue
        elif not low <= value <= high:
            raise ValueError(f"{kind.__name__.lower()}: {name} must lie in {low:g} .. {high:g}, not {value!r}")
        elif value != int(value):
            raise ValueError(f"{kind.__name__.lower()}: {name} must be a whole number, not {value!r}")


def changed(instance: T, **values: Any) -> T:
    """As dataclasses.replace, of a dataclass of fields of this module without slots, in a third of the time."""
    kind: Any = type(instance)
    made: Any = object.__new__(kind)
    held = vars(instance)
    made.__dict__.update(held if len(held) == len(_names(kind)) else {name: held[name] for name in _names(kind)})
    made.__dict__.update(values)
    if hasattr(kind, "__post_init__"):
        made.__post_init__()
    return cast(T, made)


@lru_cache(128)
def _names(cls: Any) -> tuple[str, ...]:
    return tuple(item.name for item in dataclasses.fields(cls))


@lru_cache(128)
def _checks(cls: Any) -> tuple[tuple[str, Any, Any, float | None, float | None], ...]:
    """Of each field with limits or choices: name, default, rule, and the limits in the field's own unit."""
    found: list[tuple[str, Any, Any, float | None, float | None]] = []
    for item, rule in _rules(cls):
        if isinstance(rule, Limits):
            found.append((item.name, item.default, rule, rule.low * rule.scale, rule.high * rule.scale))
        elif isinstance(rule, tuple) and rule:
            found.append((item.name, item.default, rule, None, None))
    return tuple(found)


@lru_cache(128)
def _rules(cls: Any) -> tuple[tuple[dataclasses.Field[Any], Any], ...]:
    return tuple((item, item.metadata["rule"]) for item in dataclasses.fields(cls) if "rule" in item.metadata)


# Sections: dataclasses from tables -----------------------------------------------------------------------------------


def keys(cls: Any) -> tuple[str, ...]:
    """The keys in files for the fields of a dataclass."""
    return tuple(key for key, _ in _fields(cls))


def limits_of(cls: Any, key: str) -> Limits | None:
    """The range of the field of a dataclass that stands in files under this key; None for another key, or no number."""
    rule = next((item.metadata["rule"] for name, item in _fields(cls) if name == key), None)
    return rule if isinstance(rule, Limits) else None


def section(cls: type[T], value: Any, place: Place, **given: Any) -> T:
    """An instance of the dataclass from its table; `given`: fields that are not in files."""
    content = table(value, place)
    known(content, keys(cls), place)
    values = read(cls, content, place)
    try:
        return cls(**values, **given)
    except ValueError as error:
        raise place.wrong(str(error)) from None


def read(cls: Any, content: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Values by field name, for the fields of the dataclass that are in files; other keys are ignored."""
    values: dict[str, Any] = {}
    for key, item in _fields(cls):
        where, rule = place.at(key), item.metadata["rule"]
        if key not in content:
            if not item.metadata.get("optional", item.default is not MISSING):
                raise where.wrong("missing")
        elif isinstance(rule, Limits):
            values[item.name] = quantity(content[key], rule, where)
        else:
            values[item.name] = _word(content[key], rule, where)
    return values


@lru_cache(128)
def _fields(cls: Any) -> tuple[tuple[str, dataclasses.Field[Any]], ...]:
    named = ((item.metadata.get("key", item.name), item) for item, _ in _rules(cls))
    return tuple((key, item) for key, item in named if key)


# Values --------------------------------------------------------------------------------------------------------------


def read_toml(place: Place) -> dict[str, Any]:
    """The tree of a whole file. Raises OSError if it cannot be opened."""
    return parse_toml(read_text(place), place)


def read_text(place: Place) -> str:
    """The text of a whole file. Raises OSError if it cannot be opened."""
    try:
        return Path(place.file).read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise place.wrong(f"not a TOML file: {error}") from None


def parse_toml(content: str, place: Place) -> dict[str, Any]:
    try:
        return _flat_enough(tomllib.loads(content))
    except (tomllib.TOMLDecodeError, DepthError) as error:
        raise place.wrong(f"not a TOML file: {error}") from None
    except RecursionError:
        raise place.wrong(f"not a TOML file: {DepthError()}") from None


class DepthError(ValueError):
    """Tables or lists stand in each other deeper than anybody writes them."""

    def __init__(self) -> None:
        super().__init__(f"nested too deeply; allowed: up to {MOST_DEPTH} tables or lists in each other")


def parse_json(text: str | bytes, **hooks: Any) -> Any:
    """The value of a JSON text. hooks: of `json.loads`. Raises ValueError, also for one that is nested too deeply."""
    try:
        return _flat_enough(json.loads(text, **hooks))
    except RecursionError:
        raise DepthError from None


def _flat_enough(tree: Any) -> Any:
    """The tree. Raises DepthError."""
    level = [tree]
    for _ in range(MOST_DEPTH):
        level = [
            inner
            for each in level
            if isinstance(each, dict | list)
            for inner in (each.values() if isinstance(each, dict) else each)
            if isinstance(inner, dict | list)
        ]
        if not level:
            return tree
    raise DepthError


def table(value: Any, place: Place) -> dict[str, Any]:
    """The value; raises unless it is a table."""
    if not isinstance(value, dict):
        raise place.wrong(f"{value!r}; allowed: a table such as {{ name = value }}")
    return value


def known(content: Iterable[str], allowed: Collection[str], place: Place) -> None:
    """Raise for an unknown key."""
    for key in content:
        if key not in allowed:
            raise place.at(key).wrong(f"unknown key; {hint(key, allowed)}")


def hint(name: str, allowed: Collection[str], otherwise: str = "allowed") -> str:
    """For an error message: names similar to an unknown one, else all allowed names."""
    match = difflib.get_close_matches(name, allowed, 1, 0.5)
    return f"did you mean {match[0]!r}?" if match else f"{otherwise}: {', '.join(dict.fromkeys(allowed))}"


def text(value: Any, place: Place, choices: Sequence[str] = ()) -> str:
    """The value; raises unless it is one of `choices` (none: any string)."""
    if not isinstance(value, str) or (choices and value not in choices):
        raise place.wrong(f"{value!r}; allowed: {_listed(choices) or 'text'}")
    return value


def plain(value: Any, limits: Limits, place: Place) -> float:
    """The value, not scaled; raises unless it is a number within `limits`."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise place.wrong(f"{value!r}; allowed: {limits}")
    if not limits.low <= value <= limits.high:
        raise place.wrong(f"{value}; allowed: {limits}")
    return float(value)


def quantity(value: Any, limits: Limits, place: Place) -> float:
    """The number in a table of value, unit, grade, source and perhaps interval: value * scale, an int if whole."""
    if not isinstance(value, Mapping):
        example = f'{{ value = {limits.low:g}, unit = "{limits.unit}", grade = "estimate", source = "..." }}'
        raise place.wrong(f"{value!r}; allowed: a table such as {example}, {limits}")
    parts = ("value", "unit", "grade", "source")
    known(value, (*parts, "interval"), place)
    for part in parts:
        if part not in value:
            raise place.at(part).wrong("missing")
    if value["unit"] != limits.unit:
        raise place.wrong(f"unit {value['unit']!r}; allowed: {limits.unit!r}")
    given = plain(value["value"], limits, place)
    text(value["grade"], place.at("grade"), GRADES)
    text(value["source"], place.at("source"))
    if "interval" in value:
        _check_interval(value["interval"], given, limits, place.at("interval"))
    held = float(given * limits.scale)
    if not limits.whole:
        return held
    if abs(held - round(held)) > 1e-6:
        raise place.wrong(f"{given}; allowed: whole numbers")
    return round(held)


def _check_interval(value: Any, given: float, limits: Limits, place: Place) -> None:
    if not isinstance(value, list | tuple) or len(value) != 2:
        raise place.wrong(f"{value!r}; allowed: [low, high], which holds the value with 95 %")
    low, high = (plain(end, limits, place) for end in value)
    if not low <= given <= high:
        raise place.wrong(f"{low:g} .. {high:g}; allowed: two numbers with the value, {given:g}, between them")


def free(value: Any, rule: Limits | tuple[str, ...] | type[bool], place: Place) -> Any:
    """A value checked by another module's rule: plain, or a number in any unit, not converted."""
    if isinstance(value, Mapping):
        any_number = Limits(value.get("unit", ""), -sys.float_info.max, sys.float_info.max)
        held = quantity(value, any_number, place)
        value = int(held) if isinstance(value["value"], int) else held
    if not isinstance(rule, Limits):
        return _word(value, rule, place)
    plain(value, rule, place)
    if rule.whole and not isinstance(value, int):
        raise place.wrong(f"{value}; allowed: whole numbers")
    return value


def _word(value: Any, rule: tuple[str, ...] | type[bool], place: Place) -> str | bool:
    """The word or switch; a word may stand in a table of value, grade and source, as a number does."""
    if isinstance(value, Mapping) and isinstance(rule, tuple):
        parts = ("value", "grade", "source")
        known(value, parts, place)
        for part in parts:
            if part not in value:
                raise place.at(part).wrong("missing")
        text(value["grade"], place.at("grade"), GRADES)
        text(value["source"], place.at("source"))
        value = value["value"]
    return text(value, place, rule) if isinstance(rule, tuple) else boolean(value, place)


def boolean(value: Any, place: Place) -> bool:
    """The value; raises unless it is true or false."""
    if not isinstance(value, bool):
        raise place.wrong(f"{value!r}; allowed: true, false")
    return value


def _listed(choices: Sequence[str]) -> str:
    return ", ".join(choice or '""' for choice in choices)


# Trees ---------------------------------------------------------------------------------------------------------------


def merge(base: Mapping[str, Any], change: Mapping[str, Any]) -> dict[str, Any]:
    """`change` laid over `base`; numbers (tables with a value) are replaced as a whole."""
    result = dict(base)
    for key, value in change.items():
        old = result.get(key)
        if isinstance(old, Mapping) and isinstance(value, Mapping) and "value" not in value:
            value = merge(old, value)
        result[key] = value
    return result


def spread(tree: dict[str, Any], name: str, members: Sequence[str], place: Place) -> None:
    """Copy tree[name]["all"] to every member; the member's own values win."""
    content = table(tree.get(name, {}), place.at(name))
    shared = table(content.pop("all", {}), place.at(name).at("all"))
    known(content, members, place.at(name))
    for member in members:
        own = table(content.get(member, {}), place.at(name).at(member))
        content[member] = merge(copy.deepcopy(shared), own)
    tree[name] = content


def override(tree: Mapping[str, Any], key: str, value: Any, place: Place) -> dict[str, Any]:
    """The tree with one value changed, in the file's unit; branches without it are shared. `key`: as in `rows`. Raises
    for an unknown key."""
    *path, last = key.split(".")
    result = content = dict(tree)
    for name in path:
        inner = content.get(name)
        content[name] = content = dict(inner) if isinstance(inner, dict) else {}
    if last not in content:
        raise place.at(key).wrong(f"unknown key; {hint(key, [row.parameter for row in rows(tree)])}")
    if not isinstance(content[last], dict):
        content[last] = value
    elif "value" in content[last]:
        said = {part: told for part, told in content[last].items() if part != "interval"}
        content[last] = {**said, "value": value, "grade": "setting", "source": "override"}
    else:
        raise place.at(key).wrong(f"is a section; allowed: one of its keys: {', '.join(content[last])}")
    return result


@dataclass(frozen=True)
class Row:
    """One value of a tree, for people."""

    parameter: str  # keys from the top of the file, joined by dots
    value: Any
    unit: str
    source: str
    grade: str
    interval: tuple[float, float] | None = None  # what holds it with 95 %


def rows(tree: Mapping[str, Any], prefix: str = "") -> Iterator[Row]:
    """All values of a tree, in its order."""
    for key, value in tree.items():
        if isinstance(value, Mapping) and "value" in value:
            told = value.get("interval")
            interval = None if told is None else (told[0], told[1])
            yield Row(prefix + key, value["value"], value.get("unit", ""), value["source"], value["grade"], interval)
        elif isinstance(value, Mapping):
            yield from rows(value, f"{prefix}{key}.")
        else:
            yield Row(prefix + key, value, "", "", "setting")


def gather(listed: Iterable[Row], name: str, members: Sequence[str]) -> list[Row]:
    """The inverse of `spread`: rows of tree[name] that are equal for all members become one row "name.all..."."""
    by_key = {row.parameter: row for row in listed}
    result = []
    for row in by_key.values():
        section_name, _, rest = row.parameter.partition(".")
        member, _, key = rest.partition(".")
        if section_name != name or not key:
            result.append(row)
            continue
        common = dataclasses.replace(row, parameter=f"{name}.all.{key}")
        others = (by_key.get(f"{name}.{other}.{key}") for other in members)
        if not all(other and dataclasses.replace(other, parameter=common.parameter) == common for other in others):
            result.append(row)
        elif member == members[0]:
            result.append(common)
    return result
