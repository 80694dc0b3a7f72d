"""Everything an event can do: one record a key, from which files are checked and menus are built.

A key is the one name of what it does: in scenario files, at the control port and in `isel-twin ctl`, in a panel, in
recordings and in `Twin.faults`. What a key sets, the same key ends, with its `off`:

    phase_lost = { x = "a" }   ...   phase_lost = { x = "" }          a table by axis, a word each
    noise = 0.01               ...   noise = 0                        one number
    key = { mode = "auto" }          key = { start = true }           a table by key of the controller's (HasKeys)
    set = { hood = "open" }          set = { limit_x1 = "broken" }    a table by input; states: Wiring.settable

Beside them an event may have `place` (where its forces act) and `for`, after which everything it has set is ended.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Literal, TypeAlias

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, hint, known, plain, table, text
from isel_twin.controller import Key
from isel_twin.plant import PLACES
from isel_twin.wiring.contacts import FAULTS

Form: TypeAlias = Limits | tuple[str, ...] | type[bool] | Literal["state", "contact", "cut", "key"]
"""What a value may be: a number within limits, one of some words, true and false, a state of an input as
`Wiring.settable` lists them, the name of a contact, the table of a cut (isel_twin.plant.Cut), or what
a key of the controller's takes (isel_twin.controller.Key)."""


@dataclass(frozen=True)
class Act:
    """One thing that an event can do."""

    key: str
    meaning: str
    """In a few words, for people."""
    value: Form
    by: Literal["", "axis", "place", "input", "contact", "key"] = ""
    """What a table of such values is by; "": the value stands alone."""
    off: Any = None
    """The value that ends it; None: that depends on what it is done to, or it is over at once."""
    physical: bool = False
    """It takes a plant with physics."""
    fault: bool = True
    """While it lasts it stands in `Twin.faults`, under its key, or `key.member` if it is by something."""

    @property
    def members(self) -> tuple[str, ...]:
        """Keys of its table, where they are the same for every machine."""
        return {"axis": tuple(CARRIAGES), "place": tuple(PLACES)}.get(self.by, ())

    @property
    def allowed(self) -> str:
        """Its values in words."""
        if isinstance(self.value, Limits):
            return f"{self.value}" + (f", or {self.off!r}" if isinstance(self.off, str) else "")
        if isinstance(self.value, tuple):
            return ", ".join(word or '""' for word in self.value)
        words = {"state": "a state", "contact": 'a contact, or ""', "cut": 'a table, or "off"', "key": "a value"}
        if isinstance(self.value, str):
            return words[self.value]
        return "true" if self.off is None else "true, false"


_PART = Limits("", 0.0, 1.0)
NO_KEYS: Mapping[str, Key] = {}
"""Of a controller without any."""

_LIST = (
    Act("set", "elements and contacts get a state; a fault of a contact is one, ok heals it", "state", "input"),
    Act("force_n", "a push along an axis", Limits("N", -1e5, 1e5), "axis", 0.0, physical=True, fault=False),
    Act("phase_lost", "motor phases are interrupted", ("a", "b", "ab", ""), "axis", "", physical=True),
    Act("noise", "chance of a flipped bit in each byte on the line", _PART, off=0.0),
    Act("cut", "a cutter is in the material", "cut", off="off", physical=True, fault=False),
    Act("swapped", "the wires of two contacts are exchanged where they lead", "contact", "contact", ""),
    Act("friction_n", "the guides of an axis rub more", Limits("N", 0.0, 1e5), "axis", 0.0, physical=True),
    Act(
        "obstacle_mm",
        "something firm stands in the way of a carriage, at a place in machine coordinates",
        Limits("mm", -1e4, 1e4),
        "axis",
        "off",
        physical=True,
    ),
    Act("payload_kg", "a load on tool or table", Limits("kg", 0.0, 1000.0), "place", 0.0, physical=True),
    Act("undervoltage", "part of the drives' supply voltage that is missing", Limits("", 0.0, 0.95), "", 0.0, True),
    Act("hot_stage_k", "a stage is warmer than its losses make it", Limits("K", 0.0, 500.0), "axis", 0.0, True),
    Act("dropped", "chance that a byte on the line is lost", _PART, off=0.0),
    Act("doubled", "chance that a byte on the line comes twice", _PART, off=0.0),
    Act("line_cut", "nothing passes on the line", bool, off=False),
    Act("reset", "the controller starts anew, as by a reset button", bool, fault=False),
    Act("key", "keys of the control's own panel are pressed, or put to a value", "key", "key", fault=False),
    Act("brownout", "the mains is gone; when it is back, controller and cabinet start anew", bool, off=False),
)

ACTS: Mapping[str, Act] = {act.key: act for act in _LIST}
"""By key."""

BESIDE: Mapping[str, str] = {
    "place": "where its forces act: tool or table",
    "for": "seconds after which all that it has set is ended",
}
"""Keys that say more of the others, and what."""


def read_act(
    act: Act, value: Any, event: Place, settable: Mapping[str, tuple[str, ...]], keys: Mapping[str, Key] = NO_KEYS
) -> Any:
    """The value as the wiring takes it: numbers as float, a table as a dictionary. Raises the error of `event`.

    A cut is left as it is. event: where its key stands; settable: what can be set, and the states of each; keys: of the
    controller.
    """
    place = event.at(act.key)
    if not act.by:
        return _value(act, value, place)
    values = table(value, place)
    if act.by == "input":
        for name, state in values.items():
            check_input(name, state, settable, str(place), event.error)
        return dict(values)
    if act.by == "contact":
        return _pairs(values, place, [name for name, states in settable.items() if "broken" in states])
    if act.by == "key":
        return {name: _key(name, entry, place, keys) for name, entry in values.items()}
    known(values, act.members, place)
    return {name: _value(act, entry, place.at(name)) for name, entry in values.items()}


def _value(act: Act, value: Any, place: Place) -> Any:
    form = act.value
    if isinstance(form, Limits):
        if isinstance(act.off, str) and isinstance(value, str):
            return text(value, place, (act.off,))
        return plain(value, form, place)
    if isinstance(form, tuple):
        return text(value, place, form)
    if form is bool and (not isinstance(value, bool) or (act.off is None and not value)):
        raise place.wrong(f"{value!r}; allowed: {act.allowed}")
    return value


def _key(name: str, value: Any, place: Place, keys: Mapping[str, Key]) -> Any:
    """What a key is put to; it is one of the controller's."""
    if not keys:
        raise place.wrong("the controller has no keys; allowed: a controller with a panel of its own")
    if name not in keys:
        raise place.at(name).wrong(f"unknown key; {hint(name, tuple(keys), 'there are')}")
    key, where = keys[name], place.at(name)
    if isinstance(key.value, Limits):
        return plain(value, key.value, where)
    if isinstance(key.value, tuple):
        return text(value, where, key.value)
    if not isinstance(value, bool) or (key.value is None and not value):
        raise where.wrong(f"{value!r}; allowed: {key.allowed}")
    return value


def _pairs(values: Mapping[str, Any], place: Place, contacts: Sequence[str]) -> dict[str, str]:
    """Two contacts that exist for each entry, or a contact and ""."""
    for name, other in values.items():
        if name not in contacts:
            raise place.at(name).wrong(f"unknown contact; {hint(name, contacts, 'there are')}")
        if other != "" and (not isinstance(other, str) or other not in contacts or other == name):
            others = [contact for contact in contacts if contact != name]
            raise place.at(name).wrong(f"{other!r}; {hint(str(other), others)}")
    return dict(values)


def ended(act: Act, value: Any, settable: Mapping[str, tuple[str, ...]]) -> Any:
    """The value that ends what `value`, which has been checked, has set; None if it does not last.

    An element goes back to its state at power-on, a contact is healed.
    """
    if act.by == "key":
        return None
    if act.by == "input":
        return {name: "ok" if state in FAULTS else settable[name][0] for name, state in value.items()}
    return dict.fromkeys(value, act.off) if act.by else act.off


def check_input(
    name: str, state: Any, settable: Mapping[str, tuple[str, ...]], where: str, error: type[FileError] = FileError
) -> None:
    """Raise `error` unless `name` is something that can be set to `state`."""
    states = settable.get(name, ())
    if not states:
        raise error(f"{where}: unknown input {name!r}; {hint(name, tuple(settable), 'there are')}")
    if state not in states:
        raise error(f"{where}: input {name!r} cannot be {state!r}; it can be: {', '.join(states)}")
