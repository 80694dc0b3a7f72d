"""The syntax of a condition: the text after `when` in a scenario file.

    sent @0M                     a message of the host that begins with this text, once the controller has its last byte
    replied 0                    a message of the controller that begins with this text, once it is on the line
    x > 120 mm, z < 5 mm         true position of a carriage in machine coordinates: 0 at the switch at the motor end
    output spindle == 1          an output of the controller, or a relay of the cabinet
    input hood == open           an element, a position switch (free, struck), or a contact (its fault, or ok)
    collision                    two bodies meet that must not; collision cutter vise: these two, or this one with any
    0.5 s after trip             this long after the event of this name; ms, too

Messages are as the controller's language writes them, without the end of line. Without a language the text means bytes
found anywhere, with <13> for the byte 13.
"""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

from isel_twin.base.axes import CARRIAGES
from isel_twin.base.parameters import Limits, Place, hint, plain

EXAMPLES = (
    *("sent TEXT", "replied TEXT", "x > 120 mm", "output spindle == 1", "input hood == open"),
    *("collision", "0.5 s after NAME"),
)
SWITCH_STATES = ("free", "struck")  # states of a position switch, beside its faults
_MM = Limits("mm", -1e5, 1e5)
_LATER_S = Limits("s", 0.0, 1e9)
_OUTPUT = Limits("", 0, 255)
_SECONDS = {"s": 1.0, "ms": 1e-3}


@dataclass(frozen=True)
class Trigger:
    """What an event waits for.

    sent, replied     a message of the host, of the controller: begins with `name`
    position          carriage `name` is beyond `value` mm of machine coordinates, above (sense 1) or below it (-1)
    output, input     `name` is `value`
    collision         bodies meet: those that `name` has, with a blank between
    after             the event called `name` has happened, `value` seconds ago
    """

    kind: Literal["sent", "replied", "position", "output", "input", "collision", "after"]
    name: str
    value: float | str = 0.0
    sense: int = 0


def condition(
    words: object,
    place: Place,
    settable: Mapping[str, tuple[str, ...]],
    switches: Sequence[str],
    outputs: Sequence[str],
    names: Sequence[str],
) -> Trigger:
    """Parse a condition. settable: `Wiring.settable`; switches: contacts that are position switches; outputs: with
    relays; names: of events. Raises the error of `place`."""
    if not isinstance(words, str) or not words.strip():
        raise place.wrong(f"{words!r}; {_examples()}")
    kind, _, rest = words.strip().partition(" ")
    rest = rest.strip()
    if kind in ("sent", "replied"):
        if not rest:
            raise place.wrong(f"{words!r}: {kind} what? allowed: how the message begins, such as '{kind} TEXT'")
        return Trigger("sent" if kind == "sent" else "replied", rest)
    if re.match(rf"[{''.join(CARRIAGES)}]\s*([^\w\s]|$)", words.strip()):
        return _position(words.strip(), place)
    if kind in ("output", "input"):
        found = re.fullmatch(r"(\S+)\s*==\s*(\S+)", rest)
        if found is None:
            example = "output spindle == 1" if kind == "output" else "input hood == open"
            raise place.wrong(f"{words!r}; allowed: {kind} NAME == VALUE, such as {example!r}")
        name, value = found.groups()
        if kind == "output":
            return _output(name, value, place, outputs)
        return _input(name, value, place, settable, switches)
    if kind == "collision":
        if len(rest.split()) > 2:
            raise place.wrong(f"{words!r}: more than two names; allowed: collision, or with one or two names of bodies")
        return Trigger("collision", " ".join(rest.split()))
    found = re.fullmatch(r"(\S+)\s+(\S+)\s+after\s+(\S+)", words.strip())
    if found is not None:
        return _after(found[1], found[2], found[3], place, names)
    raise place.wrong(f"{words!r}; {_examples()}")


def _examples() -> str:
    return f"allowed: {', '.join(repr(example) for example in EXAMPLES)}"


def _position(words: str, place: Place) -> Trigger:
    axis = words[0]
    found = re.fullmatch(r".\s*([<>])\s*(\S+?)\s*([a-z]*)", words)
    number = _number(found[2]) if found else None
    if found is None or number is None:
        raise place.wrong(f"{words!r}; allowed: {axis} > NUMBER mm or {axis} < NUMBER mm")
    if found[3] != "mm":
        raise place.wrong(f"{words!r}: unit {found[3]!r}; allowed: 'mm'")
    return Trigger("position", axis, plain(number, _MM, place), 1 if found[1] == ">" else -1)


def _output(name: str, value: str, place: Place, outputs: Sequence[str]) -> Trigger:
    if name not in outputs:
        raise place.wrong(f"unknown output {name!r}; {hint(name, outputs, 'there are')}")
    if not value.isdigit():
        raise place.wrong(f"output {name!r} cannot be {value!r}; allowed: a whole number")
    return Trigger("output", name, plain(int(value), _OUTPUT, place))


def _input(
    name: str, value: str, place: Place, settable: Mapping[str, tuple[str, ...]], switches: Sequence[str]
) -> Trigger:
    if name not in settable:
        raise place.wrong(f"unknown input {name!r}; {hint(name, tuple(settable), 'there are')}")
    states = (*(SWITCH_STATES if name in switches else ()), *settable[name])
    if value not in states:
        raise place.wrong(f"input {name!r} cannot be {value!r}; it can be: {', '.join(states)}")
    return Trigger("input", name, value)


def _after(number: str, unit: str, name: str, place: Place, names: Sequence[str]) -> Trigger:
    value = _number(number)
    if value is None:
        raise place.wrong(f"{number!r} is no number; {_examples()}")
    if unit not in _SECONDS:
        raise place.wrong(f"unit {unit!r}; allowed: {', '.join(map(repr, _SECONDS))}")
    if name not in names:
        there = hint(name, names, "there are") if names else "no event has a name"
        raise place.wrong(f"unknown event {name!r}; {there}")
    return Trigger("after", name, plain(value * _SECONDS[unit], _LATER_S, place))


def _number(text: str) -> float | None:
    try:
        return float(text)
    except ValueError:
        return None
