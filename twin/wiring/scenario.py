"""Scenario files: what happens around the machine, and when, in virtual time.

    # scenario.toml
    [[event]]
    at = 2.5                                 # seconds of virtual time since power-on
    set = { hood = "open" }                  # as Twin.set_input: an element, or a contact with a fault

    [[event]]
    name = "jam"
    when = "x > 120 mm"                      # or a condition (when.py) becomes true
    delay = 0.1                              # s; times = 3 or always = true: several times
    friction_n = { x = 40 }                  # what else an event can do: acts.py
    for = 0.3                                # s, after which it is ended again

    [[event]]
    at = 4.0
    repeat = 3                               # at 4, 4.5 and 5 s
    every = 0.5
    force_n = { x = 50.0 }                   # a hand pushes along the axis, in N, in the direction of rising positions;
    0 ends it
    place = "tool"                           # it pushes the tool or the table; by default the one that the axis moves

All changes of an event happen together; events at the same instant happen in the order of the file. The file is checked
when it is read. More in docs/scenarios.md, with the table of a cut.
"""

from __future__ import annotations

import dataclasses
import json
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from isel_twin.base.parameters import FileError, Limits, Place, known, plain, text
from isel_twin.base.toml_lines import read_lines
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import OUTPUTS, Key
from isel_twin.wiring.acts import NO_KEYS, Settable
from isel_twin.wiring.event import EVENT_KEYS, ScenarioEvent, event_now
from isel_twin.wiring.when import EXAMPLES, condition

# keys in a file for the time of an event
TIME_KEYS = ("at", "repeat", "every", "when", "delay", "times", "always", "name")
_AT_S = Limits("s", 0.0, 1e9)
_EVERY_S = Limits("s", 1e-6, 1e9)
_TIMES = Limits("", 1, 1e6, whole=True)
_NAME = re.compile(r"[^\s]{1,60}")


class ScenarioError(FileError):
    """A scenario file is wrong; the message is one line that names the file, line, event, key and remedy."""


def load_scenario(
    path: str | Path,
    settable: Settable,
    switches: Sequence[str] = (),
    outputs: Sequence[str] = tuple(OUTPUTS),
    keys: Mapping[str, Key] = NO_KEYS,
) -> tuple[ScenarioEvent, ...]:
    """Events sorted by time, in file order at equal times, those with a condition last.

    settable: `Wiring.settable`; switches: position switches among them; outputs: of the controller, and relays; keys:
    of the controller. Raises ScenarioError for anything wrong, OSError if the file cannot be read.
    """
    document, place = read_lines(path, ScenarioError)
    for key in document:
        if key != "event":
            raise place.at(key).wrong("unknown key; a scenario is a list of [[event]] tables")
    tables = document.get("event", [])
    if not isinstance(tables, list) or not all(isinstance(entry, dict) for entry in tables):
        raise place.at("event").wrong(f"{tables!r}; it must be written as [[event]] tables")
    return read_events(tables, place, settable, switches, outputs, keys)


def read_events(
    tables: Sequence[dict[str, Any]],
    place: Place,
    settable: Settable,
    switches: Sequence[str] = (),
    outputs: Sequence[str] = tuple(OUTPUTS),
    keys: Mapping[str, Key] = NO_KEYS,
) -> tuple[ScenarioEvent, ...]:
    """As `load_scenario`, from the tables of a scenario. Raises the error of `place`."""
    names = _names(tables, place)
    events = []
    for number, entry in enumerate(tables, 1):
        where = place.at(f"event {number}")
        known(entry, (*TIME_KEYS, *EVENT_KEYS), where)
        what = {key: value for key, value in entry.items() if key not in TIME_KEYS}
        if "when" in entry:
            awaited = condition(entry["when"], where.at("when"), settable, switches, outputs, names)
            times = _conditional(entry, where) | {"when": awaited}
        else:
            times = _timed(entry, where)
        event = event_now(what, where, settable, keys)
        events.append(dataclasses.replace(event, number=number, name=entry.get("name", ""), table=entry, **times))
    _check_chains(events, place)
    return tuple(sorted(events, key=lambda event: (event.when is not None, event.at_ns)))


def scenario_text(events: Sequence[ScenarioEvent]) -> str:
    """The text of a scenario file with these events."""
    tables = (event.table for event in sorted(events, key=lambda event: event.number))
    lines = (
        ("[[event]]", *(f"{json.dumps(key)} = {_toml(value)}" for key, value in table.items())) for table in tables
    )
    return "".join(f"{line}\n" for table in lines for line in table)


def _toml(value: Any) -> str:
    """A value as TOML writes it, tables in line."""
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{json.dumps(key)} = {_toml(inner)}" for key, inner in value.items()) + " }"
    if isinstance(value, list | tuple):
        return "[" + ", ".join(map(_toml, value)) + "]"
    return json.dumps(value, ensure_ascii=False)


def _names(tables: Sequence[Mapping[str, Any]], place: Place) -> tuple[str, ...]:
    names: list[str] = []
    for number, entry in enumerate(tables, 1):
        if "name" not in entry:
            continue
        where = place.at(f"event {number}").at("name")
        name = text(entry["name"], where)
        if not _NAME.fullmatch(name):
            raise where.wrong(f"{name!r}; allowed: a word, without spaces")
        if name in names:
            raise where.wrong(f"{name!r} is the name of another event; allowed: one that there is not")
        names.append(name)
    return tuple(names)


def _timed(entry: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Fields of an event with `at`."""
    if "at" not in entry:
        raise place.at("at").wrong(f"missing; allowed: {_AT_S}, or a condition: when = {EXAMPLES[0]!r}")
    for key in ("delay", "times", "always"):
        if key in entry:
            raise place.at(key).wrong("there is no condition; allowed: beside when; with at: repeat and every")
    times: dict[str, Any] = {"at_ns": _ns(entry["at"], _AT_S, place.at("at"))}
    for key, other in (("repeat", "every"), ("every", "repeat")):
        if key in entry and other not in entry:
            raise place.at(key).wrong(f"{other} is missing; allowed: repeat = NUMBER with every = SECONDS")
    if "repeat" in entry:
        times["times"] = _count(entry["repeat"], place.at("repeat"))
        times["every_ns"] = _ns(entry["every"], _EVERY_S, place.at("every"))
    return times


def _conditional(entry: Mapping[str, Any], place: Place) -> dict[str, Any]:
    """Fields of an event with `when`, without the condition."""
    for key in ("at", "repeat", "every"):
        if key in entry:
            raise place.at(key).wrong(
                "there is a condition; allowed: either at or when; with when: times, always, delay"
            )
    if "times" in entry and "always" in entry:
        raise place.at("always").wrong("there is times, too; allowed: one of the two")
    if entry.get("always", True) is not True:
        raise place.at("always").wrong(f"{entry['always']!r}; allowed: true")
    count = _count(entry["times"], place.at("times")) if "times" in entry else 1
    return {
        "at_ns": 0,
        "times": 0 if "always" in entry else count,
        "delay_ns": _ns(entry.get("delay", 0), _AT_S, place.at("delay")),
    }


def _ns(value: Any, limits: Limits, place: Place) -> int:
    return round(plain(value, limits, place) * SECOND_NS)


def _count(value: Any, place: Place) -> int:
    count = plain(value, _TIMES, place)
    if count != int(count):
        raise place.wrong(f"{value}; allowed: a whole number, {_TIMES}")
    return int(count)


def _check_chains(events: Sequence[ScenarioEvent], place: Place) -> None:
    """Refuse events that wait for each other in a circle."""
    waits = {e.name: e.when.name for e in events if e.name and e.when is not None and e.when.kind == "after"}
    for event in events:
        name, steps = event.name, 0
        while name in waits and steps <= len(events):
            name, steps = waits[name], steps + 1
        if steps > len(events):
            where = place.at(f"event {event.number}").at("when")
            raise where.wrong(f"waits for itself, by way of {waits[event.name]!r}; allowed: an event that begins")
