"""An event, which happens at one instant, as a value read from a table. The table comes from a scenario file
(scenario.py), from the control port, a panel or a recording; its keys are in acts.py.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from isel_twin.base.parameters import Limits, Place, known, plain, text
from isel_twin.base.units import SECOND_NS
from isel_twin.controller import Key
from isel_twin.plant import PLACES
from isel_twin.wiring.acts import ACTS, BESIDE, NO_KEYS, Known, Settable, ended
from isel_twin.wiring.when import Trigger

EVENT_KEYS = (*ACTS, *BESIDE)  # keys of an event but its time
_LASTING = tuple(key for key, act in ACTS.items() if act.off is not None or act.by == "input")
_FOR_S = Limits("s", 0.0, 1e9)


@dataclass(frozen=True)
class ScenarioEvent:
    """What happens at one instant."""

    at_ns: int
    acts: Mapping[str, Any] = field(default_factory=dict)  # values of `Act.read` by key of ACTS, in their order
    place: str = ""  # of its forces, one of PLACES; "": what each axis moves
    end: ScenarioEvent | None = None  # the event that ends it, `for_ns` later; None: it lasts
    for_ns: int = 0
    when: Trigger | None = None  # what it waits for, in place of `at_ns`
    delay_ns: int = 0  # from the condition on
    times: int = 1  # how often it happens; 0: each time its condition is met
    every_ns: int = 0  # from one time to the next
    name: str = ""  # what other events call it
    number: int = 0  # its place in the file, from 1
    # the table it was read from, without its time: recordings keep it, `event_now` reads it
    content: Mapping[str, Any] = field(default_factory=dict, compare=False)
    table: Mapping[str, Any] = field(default_factory=dict, compare=False, repr=False)  # the whole table of a scenario

    @property
    def physical(self) -> bool:
        """True if it needs a plant with physics: a push, a cut, a load or a broken motor cable."""
        return any(ACTS[key].physical and _begins(key, value) for key, value in self.acts.items())


def _begins(key: str, value: Any) -> bool:
    """True unless it only ends something."""
    values = value.values() if isinstance(value, Mapping) else (value,)
    return any(one != ACTS[key].off for one in values)


def event_now(
    content: dict[str, Any], place: Place, settable: Settable, keys: Mapping[str, Key] = NO_KEYS
) -> ScenarioEvent:
    """An event without its time (EVENT_KEYS); settable, keys: as of a Twin. Raises the error of `place`."""
    known(content, EVENT_KEYS, place)
    if not any(key in content for key in ACTS):
        raise place.wrong(f"nothing happens; say what: {', '.join(ACTS)}")
    if "place" in content and "force_n" not in content:
        raise place.at("place").wrong("no force acts there; allowed: beside force_n")
    there = Known(settable, keys)
    acts = {key: act.read(act, content[key], place.at(key), there) for key, act in ACTS.items() if key in content}
    where = text(content["place"], place.at("place"), tuple(PLACES)) if "place" in content else ""
    event = ScenarioEvent(at_ns=0, acts=acts, place=where, content=dict(content))
    if "for" not in content:
        return event
    for_ns = round(plain(content["for"], _FOR_S, place.at("for")) * SECOND_NS)
    ends = {key: ended(ACTS[key], value, settable) for key, value in content.items() if key in ACTS}
    what = {key: value for key, value in ends.items() if value is not None}
    if not what:
        raise place.at("for").wrong(f"nothing of it lasts; allowed: beside any of {', '.join(_LASTING)}")
    return dataclasses.replace(event, end=event_now(what, place, settable), for_ns=for_ns)
