"""Scenario files: what happens around the machine, and when, in virtual time.

    # scenario.toml
    [[event]]
    at = 2.5                                 # seconds of virtual time since power-on
    set = { hood = "open" }                  # as Twin.set_input: an element, or a contact with a fault

    [[event]]
    at = 3.0
    set = { limit_x2 = "broken" }            # a wire comes off

    [[event]]
    at = 4.0
    force_n = { x = 50.0 }                   # a hand pushes along the axis, in N, the way positions rise; 0 lets go
    place = "tool"                           # what it pushes, tool or table; without it, what the axis moves

    [[event]]
    at = 5.0
    phase_lost = { x = "a" }                 # a motor phase is interrupted: "a", "b", "ab"; "" restores it

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

    [[event]]
    at = 6.5
    noise = 0.01                             # chance of a flipped bit in each byte on the serial line

What one event sets changes together, in whatever order it is written; events at the same instant happen one after the
other, in the order of the file. One file serves the command line, tests and environments. All of it is checked when
the file is read.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from isel_twin.axes import CARRIAGES
from isel_twin.parameters import FileError, Limits, Place, known, plain, read_toml, section, table, text
from isel_twin.plant import PLACES, Cut
from isel_twin.units import SECOND_NS
from isel_twin.wiring.acts import ACTS, BESIDE, read_act

EVENT_KEYS = (*ACTS, *BESIDE)
"""What an event says beside its time."""
_AT_S = Limits("s", 0.0, 1e9)


class ScenarioError(FileError):
    """A scenario file is wrong; the message is one line that names file, event, key and remedy."""


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
    content: Mapping[str, Any] = field(default_factory=dict, compare=False)
    """The table it was read from, without its time: what a recording keeps and `event_now` takes again."""

    @property
    def physical(self) -> bool:
        """It pushes the machine, cuts or interrupts a motor phase, which takes a plant with physics."""
        return any(self.force_n.values()) or any(self.phase_lost.values()) or isinstance(self.cut, Cut)


def load_scenario(path: str | Path, settable: Mapping[str, tuple[str, ...]]) -> tuple[ScenarioEvent, ...]:
    """Read a scenario file; events sorted by time, in file order at equal times.

    settable: what can be set and the states of each, see `Wiring.settable`.

    Raises ScenarioError for anything wrong in it, OSError if it cannot be read.
    """
    place = Place(path, ScenarioError)
    document = read_toml(place)
    for key in document:
        if key != "event":
            raise place.at(key).wrong("unknown key; a scenario is a list of [[event]] tables")
    tables = document.get("event", [])
    if not isinstance(tables, list) or not all(isinstance(entry, dict) for entry in tables):
        raise place.at("event").wrong(f"{tables!r}; it must be written as [[event]] tables")
    events = [_event(entry, place.at(f"event {number}"), settable) for number, entry in enumerate(tables, 1)]
    return tuple(sorted(events, key=lambda event: event.at_ns))


def _event(content: dict[str, Any], place: Place, settable: Mapping[str, tuple[str, ...]]) -> ScenarioEvent:
    known(content, ("at", *EVENT_KEYS), place)
    if "at" not in content:
        raise place.at("at").wrong(f"missing; allowed: {_AT_S}")
    at_s = plain(content["at"], _AT_S, place.at("at"))
    what = {key: value for key, value in content.items() if key != "at"}
    return dataclasses.replace(event_now(what, place, settable), at_ns=round(at_s * SECOND_NS))


def event_now(content: dict[str, Any], place: Place, settable: Mapping[str, tuple[str, ...]]) -> ScenarioEvent:
    """An event without its time, EVENT_KEYS, for whoever lets it happen at once. Raises the error of `place`."""
    known(content, EVENT_KEYS, place)
    if not any(key in content for key in ACTS):
        raise place.wrong(f"nothing happens; say what: {', '.join(ACTS)}")
    if "place" in content and "force_n" not in content:
        raise place.at("place").wrong("no force acts there; allowed: beside force_n")
    done = {key: read_act(act, content[key], place, settable) for key, act in ACTS.items() if key in content}
    where = text(content["place"], place.at("place"), tuple(PLACES)) if "place" in content else ""
    return ScenarioEvent(
        at_ns=0,
        inputs=done.pop("set", {}),
        force_n=_by_number(done.pop("force_n", {})),
        phase_lost=_by_number(done.pop("phase_lost", {})),
        noise=done.pop("noise", None),
        place=where,
        cut=_cut(done.pop("cut"), place.at("cut")) if "cut" in done else "",
        content=dict(content),
    )


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


def _by_number(values: Mapping[str, Any]) -> dict[int, Any]:
    """A table by axis, by the number of the axis."""
    return {CARRIAGES.index(name): value for name, value in values.items()}
