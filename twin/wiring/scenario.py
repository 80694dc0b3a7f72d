"""Scenario files: what happens around the machine, and when, in virtual time.

    # scenario.toml
    [[event]]
    at = 2.5                                 # seconds of virtual time since power-on
    set = { hood = "open" }                  # as Twin.set_input: an element, or a contact with a fault

    [[event]]
    name = "jam"
    when = "x > 120 mm"                      # or when something becomes so, see when.py
    delay = 0.1                              # s; times = 3 or always = true: several times
    friction_n = { x = 40 }                  # what else an event can do: acts.py
    for = 0.3                                # s, after which it is ended again

    [[event]]
    at = 4.0
    repeat = 3                               # at 4, 4.5 and 5 s
    every = 0.5
    force_n = { x = 50.0 }                   # a hand pushes along the axis, in N, the way positions rise; 0 lets go
    place = "tool"                           # what it pushes, tool or table; without it, what the axis moves

    [[event]]
    at = 6.0
    [event.cut]                              # a cutter is in the material, until an event with cut = "off"
    diameter = 6.0                           # mm; and so are depth and width, across the feed (6 of 6: a slot)
    flutes = 2
    depth = 0.5
    width = 6.0
    spindle = 18000                          # turns a minute
    kc = { value = 800, unit = "N/mm2", grade = "estimate", source = "aluminium" }     # specific cutting force
    radial = 0.3                             # radial over tangential force; may be left out, and so may
    climb = true                             # the material right of the feed; false: left; see plant/cutting.py

What one event sets changes together, in whatever order it is written; events at the same instant happen one after the
other, in the order of the file. One file serves the command line, tests and environments: docs/scenarios.md. All of it
is checked when the file is read.
"""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import (
    FileError,
    Limits,
    Place,
    known,
    parse_toml,
    plain,
    read_text,
    section,
    table,
    text,
)
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import OUTPUTS, Key
from isel_twin.plant import PLACES, Cut
from isel_twin.wiring.acts import ACTS, BESIDE, NO_KEYS, ended, read_act
from isel_twin.wiring.when import EXAMPLES, Condition, condition

EVENT_KEYS = (*ACTS, *BESIDE)
"""What an event says beside its time."""
TIME_KEYS = ("at", "repeat", "every", "when", "delay", "times", "always", "name")
"""What it says of its time, in a file."""
_AT_S = Limits("s", 0.0, 1e9)
_EVERY_S = Limits("s", 1e-6, 1e9)
_TIMES = Limits("", 1, 1e6, whole=True)
_NAME = re.compile(r"[^\s]{1,60}")


class ScenarioError(FileError):
    """A scenario file is wrong; the message is one line that names the file, line, event, key and remedy."""


@dataclass(frozen=True)
class ScenarioEvent:
    """What happens at one instant."""

    at_ns: int
    inputs: Mapping[str, str] = field(default_factory=dict)
    force_n: Mapping[int, float] = field(default_factory=dict)
    phase_lost: Mapping[int, str] = field(default_factory=dict)
    noise: float | None = None
    place: str = ""
    """Of the forces, one of `isel_twin.plant.PLACES`; "": what each axis moves."""
    cut: Cut | str = ""
    """A cut that begins; "off": it ends; "": nothing of the kind."""
    others: Mapping[str, Any] = field(default_factory=dict)
    """The rest of `isel_twin.wiring.ACTS` by key: a number, a word or a switch, or a table of them by name."""
    end: ScenarioEvent | None = None
    """What ends all of it, `for_ns` later; None: it lasts."""
    for_ns: int = 0
    when: Condition | None = None
    """What it waits for, in place of `at_ns`."""
    delay_ns: int = 0
    """From the condition on."""
    times: int = 1
    """How often it happens; 0: each time its condition is met."""
    every_ns: int = 0
    """From one time to the next, if it has a time and happens several times."""
    name: str = ""
    """What other events call it."""
    number: int = 0
    """Its place in the file, from 1."""
    content: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """The table it was read from, without its time: what a recording keeps and `event_now` takes again."""

    @property
    def physical(self) -> bool:
        """It pushes, cuts, loads or breaks what only a plant with physics has."""
        return (
            any(self.force_n.values())
            or any(self.phase_lost.values())
            or isinstance(self.cut, Cut)
            or any(ACTS[key].physical and _lasts(key, value) for key, value in self.others.items())
        )


def _lasts(key: str, value: Any) -> bool:
    """It does something, and does not only end it."""
    values = value.values() if isinstance(value, Mapping) else (value,)
    return any(one != ACTS[key].off for one in values)


@dataclass(frozen=True)
class _FilePlace(Place):
    """A place in a file of [[event]] tables, which knows its line."""

    lines: tuple[str, ...] = ()

    def __str__(self) -> str:
        line = _line(self.lines, self.key)
        return f"{self.file}:{line}: {self.key}" if line else super().__str__()


def _line(lines: Sequence[str], key: str) -> int:
    """Number of the line in which a key stands, "event 2.set.hood", or as near to it as is to be seen; 0: nowhere."""
    first, *keys = key.split(".")
    headers = [number for number, line in enumerate(lines, 1) if re.match(r"\s*\[\[\s*event\s*\]\]", line)]
    event = re.fullmatch(r"event (\d+)", first)
    if event is None:
        begin, end, keys = 0, headers[0] - 1 if headers else len(lines), [first] if first else []
    elif int(event[1]) > len(headers):
        return 0
    else:
        begin = headers[int(event[1]) - 1]
        end = headers[int(event[1])] - 1 if int(event[1]) < len(headers) else len(lines)
    at = begin
    for name in keys:
        pattern = rf"(^|[\s{{,.\[\"']){re.escape(name)}[\"']?\s*[=.\]]"
        found = [n for n in range(max(at, begin + 1), end + 1) if re.search(pattern, lines[n - 1])]
        if not found:
            break
        at = found[0]
    return at


def load_scenario(
    path: str | Path,
    settable: Mapping[str, tuple[str, ...]],
    switches: Sequence[str] = (),
    outputs: Sequence[str] = tuple(OUTPUTS),
    keys: Mapping[str, Key] = NO_KEYS,
) -> tuple[ScenarioEvent, ...]:
    """Read a scenario file; events sorted by time, in file order at equal times, those with a condition last.

    settable: what can be set and the states of each, see `Wiring.settable`; switches: which of them are position
    switches; outputs: of the controller, and relays; keys: of the controller.

    Raises ScenarioError for anything wrong in it, OSError if it cannot be read.
    """
    words = read_text(Place(path, ScenarioError))
    document = parse_toml(words, Place(path, ScenarioError))
    place = _FilePlace(path, ScenarioError, lines=tuple(words.splitlines()))
    for key in document:
        if key != "event":
            raise place.at(key).wrong("unknown key; a scenario is a list of [[event]] tables")
    tables = document.get("event", [])
    if not isinstance(tables, list) or not all(isinstance(entry, dict) for entry in tables):
        raise place.at("event").wrong(f"{tables!r}; it must be written as [[event]] tables")
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
        events.append(dataclasses.replace(event, number=number, name=entry.get("name", ""), **times))
    _check_chains(events, place)
    return tuple(sorted(events, key=lambda event: (event.when is not None, event.at_ns)))


def _names(tables: Sequence[Mapping[str, Any]], place: Place) -> tuple[str, ...]:
    """Names of the events that have one."""
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
    """Fields of an event with `when`, but for the condition."""
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
    """Refuse events that wait for each other: nothing would ever begin."""
    waits = {e.name: e.when.name for e in events if e.name and e.when is not None and e.when.kind == "after"}
    for event in events:
        name, steps = event.name, 0
        while name in waits and steps <= len(events):
            name, steps = waits[name], steps + 1
        if steps > len(events):
            where = place.at(f"event {event.number}").at("when")
            raise where.wrong(f"waits for itself, by way of {waits[event.name]!r}; allowed: an event that begins")


def event_now(
    content: dict[str, Any], place: Place, settable: Mapping[str, tuple[str, ...]], keys: Mapping[str, Key] = NO_KEYS
) -> ScenarioEvent:
    """An event without its time, EVENT_KEYS, for whoever lets it happen at once: `Twin.settable` and `Twin.keys` say
    what there is. Raises the error of `place`."""
    known(content, EVENT_KEYS, place)
    if not any(key in content for key in ACTS):
        raise place.wrong(f"nothing happens; say what: {', '.join(ACTS)}")
    if "place" in content and "force_n" not in content:
        raise place.at("place").wrong("no force acts there; allowed: beside force_n")
    done = {key: read_act(act, content[key], place, settable, keys) for key, act in ACTS.items() if key in content}
    where = text(content["place"], place.at("place"), tuple(PLACES)) if "place" in content else ""
    event = ScenarioEvent(
        at_ns=0,
        inputs=done.pop("set", {}),
        force_n=_by_number(done.pop("force_n", {})),
        phase_lost=_by_number(done.pop("phase_lost", {})),
        noise=done.pop("noise", None),
        place=where,
        cut=_cut(done.pop("cut"), place.at("cut")) if "cut" in done else "",
        others=done,
        content=dict(content),
    )
    if "for" not in content:
        return event
    for_ns = _ns(content["for"], _AT_S, place.at("for"))
    ends = {key: ended(ACTS[key], value, settable) for key, value in content.items() if key in ACTS}
    what = {key: value for key, value in ends.items() if value is not None}
    if not what:
        raise place.at("for").wrong(f"nothing of it lasts; allowed: beside any of {', '.join(_LASTING)}")
    return dataclasses.replace(event, end=event_now(what, place, settable), for_ns=for_ns)


_LASTING = tuple(key for key, act in ACTS.items() if act.off is not None or act.by == "input")


def _cut(content: Any, place: Place) -> Cut | str:
    """A cut from its table, or "off". What somebody sets is a plain number; what the material does has a source."""
    if isinstance(content, str):
        return text(content, place, ("off",))
    numbers = dict(table(content, place))
    for item in dataclasses.fields(Cut):
        key, rule = item.metadata.get("key") or item.name, item.metadata["rule"]
        if key != "kc" and isinstance(rule, Limits) and key in numbers and not isinstance(numbers[key], dict):
            numbers[key] = {"value": numbers[key], "unit": rule.unit, "grade": "setting", "source": "scenario"}
    return section(Cut, numbers, place)


def cut_table(cut: Cut) -> dict[str, Any]:
    """The table of an event that begins this cut: what `event_now` makes the same cut of."""
    numbers = {item.metadata.get("key") or item.name: getattr(cut, item.name) for item in dataclasses.fields(Cut)}
    kc = {"value": cut.kc_n_mm2, "unit": "N/mm2", "grade": "setting", "source": "set_cut"}
    return numbers | {"kc": kc}


def _by_number(values: Mapping[str, Any]) -> dict[int, Any]:
    """A table by axis, by the number of the axis."""
    return {CARRIAGES.index(name): value for name, value in values.items()}
