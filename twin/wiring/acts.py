"""Everything an event can do: one record a key, used to read files, build menus and carry out events.

A key has the same name in scenario files, at the control port, in `isel-twin ctl`, in a panel, in recordings and in
`Twin.faults`. Its `off` value ends what it has set:

    phase_lost = { x = "a" }   ...   phase_lost = { x = "" }          a table by axis, a word each
    noise = 0.01               ...   noise = 0                        one number
    key = { mode = "auto" }          key = { start = true }           a table by key of the controller's (HasKeys)
    set = { hood = "open" }          set = { limit_x1 = "broken" }    a table by input; states: Wiring.settable

An event may also have `place` (where its forces act) and `for`, the time after which all that it has set ends.
"""

from __future__ import annotations

import dataclasses
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, Protocol, TypeAlias

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import FileError, Limits, Place, hint, known, plain, section, table, text
from isel_twin.controller import Key, KeyValue
from isel_twin.plant import PLACES, Cut, Plant
from isel_twin.plant.materials import MATERIALS
from isel_twin.wiring.contacts import FAULTS, Contacts
from isel_twin.wiring.line import SerialLine

Settable: TypeAlias = Mapping[str, tuple[str, ...]]  # what can be set, and the states of each
# kinds of values: a number, one of some words, a switch, a state of an input (`Wiring.settable`), the name of a
# contact, the table of a cut (isel_twin.plant.Cut), or what a key takes (isel_twin.controller.Key)
Form: TypeAlias = Limits | tuple[str, ...] | type[bool] | Literal["state", "contact", "cut", "key"]
NO_KEYS: Mapping[str, Key] = {}  # for a controller without keys


class Site(Protocol):
    """What deeds act on, such as `Wiring`. All values are valid."""

    @property
    def plant(self) -> Plant: ...

    @property
    def line(self) -> SerialLine: ...

    @property
    def contacts(self) -> Contacts: ...

    def set_states(self, changes: Mapping[str, str]) -> None:
        """Set elements and contacts to these states, all at once."""

    def press(self, keys: Mapping[str, KeyValue]) -> None:
        """Set keys of the controller to these values (wiring/13)."""

    def restart(self) -> None:
        """Restart the controller."""

    def set_mains(self, on: bool) -> None:
        """Switch the mains on or off."""

    def begin_cut(self, cut: Cut | None) -> None:
        """Begin a cut in place of the present one; None ends it."""

    def warm(self, axis: int, extra_k: float, t_ns: int) -> None:
        """Make the stage of an axis warmer by this from t_ns, the present, on."""


class Moment(NamedTuple):
    """When an event happens, and where its forces act."""

    t_ns: int
    place: str  # one of PLACES; "": what each axis moves


class Known(NamedTuple):
    """Names of machine and controller that a reader of values needs."""

    settable: Settable
    keys: Mapping[str, Key]

    @property
    def contacts(self) -> tuple[str, ...]:
        return tuple(name for name, states in self.settable.items() if "broken" in states)


# converts a value of a file for the deed: numbers to float, a cut to a Cut; raises the error of the place
Reader: TypeAlias = Callable[["Act", Any, Place, Known], Any]
Deed: TypeAlias = Callable[[Site, Any, Moment], None]  # carries it out with the value from the reader


# ---- readers ---------------------------------------------------------------------------------------------------------


def _one(act: Act, value: Any, place: Place, _: Known) -> Any:
    return _value(act, value, place)


def _each(act: Act, value: Any, place: Place, _: Known) -> Any:
    values = table(value, place)
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


def _states(act: Act, value: Any, place: Place, there: Known) -> dict[str, str]:
    values = table(value, place)
    for name, state in values.items():
        check_input(name, state, there.settable, place, place.error)
    return dict(values)


def _keys(act: Act, value: Any, place: Place, there: Known) -> dict[str, Any]:
    return {name: _key(name, entry, place, there.keys) for name, entry in table(value, place).items()}


def _key(name: str, value: Any, place: Place, keys: Mapping[str, Key]) -> Any:
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


def _pairs(act: Act, value: Any, place: Place, there: Known) -> dict[str, str]:
    """Pairs of contacts to swap; "": swap back."""
    values, contacts = table(value, place), there.contacts
    for name, other in values.items():
        if name not in contacts:
            raise place.at(name).wrong(f"unknown contact; {hint(name, contacts, 'there are')}")
        if other != "" and (not isinstance(other, str) or other not in contacts or other == name):
            others = [contact for contact in contacts if contact != name]
            raise place.at(name).wrong(f"{other!r}; {hint(str(other), others)}")
    return dict(values)


def _cut(act: Act, value: Any, place: Place, _: Known) -> Cut | str:
    """A cut or "off". Settings are plain numbers; material constants have a source."""
    if isinstance(value, str):
        return text(value, place, (act.off,))
    numbers = _of_material(dict(table(value, place)), place)
    for item in dataclasses.fields(Cut):
        key, rule = item.metadata.get("key") or item.name, item.metadata["rule"]
        if key != "kc" and isinstance(rule, Limits) and key in numbers and not isinstance(numbers[key], dict):
            numbers[key] = {"value": numbers[key], "unit": rule.unit, "grade": "setting", "source": "scenario"}
    return section(Cut, numbers, place)


def _of_material(numbers: dict[str, Any], place: Place) -> dict[str, Any]:
    """The table with kc and m of the material that it names, if it does."""
    if "material" not in numbers:
        return numbers
    for key in ("kc", "m"):
        if key in numbers:
            raise place.at(key).wrong("the material says it; allowed: material, or kc and m")
    found = MATERIALS[text(numbers.pop("material"), place.at("material"), tuple(MATERIALS))]
    kc = {"value": found.kc1_n_mm2, "unit": "N/mm2", "grade": "estimate", "source": found.source}
    return {**numbers, "kc": kc, "m": found.m}


def cut_table(cut: Cut) -> dict[str, Any]:
    """The inverse of `_cut`."""
    numbers = {item.metadata.get("key") or item.name: getattr(cut, item.name) for item in dataclasses.fields(Cut)}
    kc = {"value": cut.kc_n_mm2, "unit": "N/mm2", "grade": "setting", "source": "set_cut"}
    return numbers | {"kc": kc}


# ---- deeds -----------------------------------------------------------------------------------------------------------


def _push(site: Site, values: Any, moment: Moment) -> None:
    for name, force_n in values.items():
        site.plant.apply_force(CARRIAGES.index(name), force_n, moment.place)


def _lose_phases(site: Site, values: Any, _: Moment) -> None:
    for name, phases in values.items():
        site.plant.set_phase_lost(CARRIAGES.index(name), phases)


def _rub(site: Site, values: Any, _: Moment) -> None:
    for name, extra_n in values.items():
        site.plant.set_friction(CARRIAGES.index(name), extra_n)


def _obstruct(site: Site, values: Any, _: Moment) -> None:
    for name, place_mm in values.items():
        site.plant.set_obstacle(CARRIAGES.index(name), None if place_mm == "off" else place_mm)


def _load(site: Site, values: Any, _: Moment) -> None:
    for place, mass_kg in values.items():
        site.plant.set_payload(place, mass_kg)


def _warm(site: Site, values: Any, moment: Moment) -> None:
    for name, extra_k in values.items():
        site.warm(CARRIAGES.index(name), extra_k, moment.t_ns)


def _swap(site: Site, values: Any, _: Moment) -> None:
    for name, other in values.items():
        site.contacts.swap(name, other)


def _begin_cut(site: Site, cut: Any, _: Moment) -> None:
    site.begin_cut(cut if isinstance(cut, Cut) else None)


def _of_line(chance: Literal["noise", "dropped", "doubled"]) -> Deed:
    return lambda site, value, _: setattr(site.line, chance, value)


@dataclass(frozen=True)
class Act:
    """One thing that an event can do."""

    key: str
    meaning: str  # in a few words, for people
    value: Form
    do: Deed
    told: tuple[str, ...]  # rules (isel_twin.jobs.checks) one of which tells of it when it has changed what was made
    read: Reader = _one
    # what the keys of its table are; "": a single value
    by: Literal["", "axis", "place", "input", "contact", "key"] = ""
    off: Any = None  # the value that ends it; None: depends on what is set, or it is over at once
    physical: bool = False  # needs a plant with physics
    fault: bool = True  # while it lasts it is in `Twin.faults`, under its key, or `key.member` for a table

    def faults(self, value: Any) -> Iterator[tuple[str, Any]]:
        """Names in `Twin.faults` and their values, except contacts, which report their own."""
        if self.fault and self.by in ("axis", "place"):
            yield from ((f"{self.key}.{name}", one) for name, one in value.items())
        elif self.fault and not self.by:
            yield self.key, value

    @property
    def members(self) -> tuple[str, ...]:
        """Keys of its table that every machine has."""
        return {"axis": tuple(CARRIAGES), "place": tuple(PLACES)}.get(self.by, ())

    @property
    def allowed(self) -> str:
        if isinstance(self.value, Limits):
            return f"{self.value}" + (f", or {self.off!r}" if isinstance(self.off, str) else "")
        if isinstance(self.value, tuple):
            return ", ".join(word or '""' for word in self.value)
        words = {"state": "a state", "contact": 'a contact, or ""', "cut": 'a table, or "off"', "key": "a value"}
        if isinstance(self.value, str):
            return words[self.value]
        return "true" if self.off is None else "true, false"


_PART = Limits("", 0.0, 1.0)

# what becomes of an act that changes anything, by rules of a check
_OF_LINE = ("line",)
_OF_DRIVES = ("lost", "halfway", "drive")
_OF_CONTROLLER = ("refused", "fault", "unfinished")
_OF_CONTACTS = (*_OF_CONTROLLER, "unpowered", "lost", "switch")
_OF_SUPPLY = ("restart", "unpowered", "line")

_LIST = (
    Act(
        "set", "elements and contacts get a state; a fault of a contact is one, ok heals it", "state",
        lambda site, states, _: site.set_states(states), _OF_CONTACTS, _states, "input",
    ),
    Act(
        "force_n", "a push along an axis", Limits("N", -1e5, 1e5),
        _push, _OF_DRIVES, _each, "axis", 0.0, True, fault=False,
    ),
    Act(
        "phase_lost", "motor phases are interrupted", ("a", "b", "ab", ""),
        _lose_phases, _OF_DRIVES, _each, "axis", "", True,
    ),
    Act("noise", "chance of a flipped bit in each byte on the line", _PART, _of_line("noise"), _OF_LINE, off=0.0),
    Act(
        "cut", "a cutter is in the material", "cut",
        _begin_cut, _OF_DRIVES, _cut, off="off", physical=True, fault=False,
    ),
    Act(
        "swapped", "the wires of two contacts are exchanged where they lead", "contact",
        _swap, _OF_CONTACTS, _pairs, "contact", "",
    ),
    Act(
        "friction_n", "the guides of an axis rub more", Limits("N", 0.0, 1e5),
        _rub, _OF_DRIVES, _each, "axis", 0.0, True,
    ),
    Act(
        "obstacle_mm", "something firm stands in the way of a carriage, at a place in machine coordinates",
        Limits("mm", -1e4, 1e4), _obstruct, _OF_DRIVES, _each, "axis", "off", True,
    ),
    Act(
        "payload_kg", "a load on tool or table", Limits("kg", 0.0, 1000.0),
        _load, _OF_DRIVES, _each, "place", 0.0, True,
    ),
    Act(
        "undervoltage", "part of the drives' supply voltage that is missing", Limits("", 0.0, 0.95),
        lambda site, missing, _: site.plant.set_undervoltage(missing), _OF_DRIVES, off=0.0, physical=True,
    ),
    Act(
        "hot_stage_k", "a stage is warmer than its losses make it", Limits("K", 0.0, 500.0),
        _warm, _OF_CONTACTS, _each, "axis", 0.0, True,
    ),
    Act("dropped", "chance that a byte on the line is lost", _PART, _of_line("dropped"), _OF_LINE, off=0.0),
    Act("doubled", "chance that a byte on the line comes twice", _PART, _of_line("doubled"), _OF_LINE, off=0.0),
    Act(
        "line_cut", "nothing passes on the line", bool,
        lambda site, is_cut, moment: site.line.cut(moment.t_ns, is_cut), _OF_LINE, off=False,
    ),
    Act(
        "reset", "the controller starts anew, as by a reset button", bool,
        lambda site, _, __: site.restart(), _OF_SUPPLY, fault=False,
    ),
    Act(
        "key", "keys of the control's own panel are pressed, or put to a value", "key",
        lambda site, keys, _: site.press(keys), _OF_CONTROLLER, _keys, "key", fault=False,
    ),
    Act(
        "brownout", "the mains is gone; when it is back, controller and cabinet start anew", bool,
        lambda site, gone, _: site.set_mains(not gone), _OF_SUPPLY, off=False,
    ),
)  # fmt: skip

ACTS: Mapping[str, Act] = {act.key: act for act in _LIST}  # by key

# keys that qualify the others, and their meaning
BESIDE: Mapping[str, str] = {
    "place": "where its forces act: tool or table",
    "for": "seconds after which all that it has set is ended",
}


def ended(act: Act, value: Any, settable: Settable) -> Any:
    """The value that ends what `value` has set, None if it does not last. An element returns to its state at power-on,
    a contact is healed."""
    if act.by == "key":
        return None
    if act.by == "input":
        return {name: "ok" if state in FAULTS else settable[name][0] for name, state in value.items()}
    return dict.fromkeys(value, act.off) if act.by else act.off


def check_input(name: str, state: Any, settable: Settable, where: object, error: type[FileError] = FileError) -> None:
    """Raise `error` unless `name` can be set to `state`."""
    states = settable.get(name, ())
    if not states:
        raise error(f"{where}: unknown input {name!r}; {hint(name, tuple(settable), 'there are')}")
    if state not in states:
        raise error(f"{where}: input {name!r} cannot be {state!r}; it can be: {', '.join(states)}")
