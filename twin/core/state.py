"""The state of a twin: all that its past has left, so that it, or another one built alike, can go on from there.

    state = twin.save()          controller, line, wiring, scenario, plant, and all that is random: to the bit
    twin.restore(state)          as if nothing had happened since; also in another twin, in another process (pickle)

What is in it, and how it gets there:

    controller            how it began and what it was told since (isel_twin.core.told), or a pickle of it
    position, line,       a pickle of all their attributes in one piece, so that what they share they share again; what
    wiring, stream        is built alike in every such twin (machine, plant, controller, events) is named, not copied
    plant                 copies of its arrays (Plant.save); where the arrays are is each plant's own

Who looks on from outside - observers, samplers, listeners, whoever keeps the flash - is not in it: they stay with the
twin they look at.
"""

from __future__ import annotations

import io
import pickle
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import sha256
from pathlib import Path
from typing import Any

from isel_twin.core.told import Life, StateError
from isel_twin.machine import Machine
from isel_twin.version import VERSION
from isel_twin.wiring import ScenarioEvent

_OUTSIDE = ("before_change", "on_reply", "on_lost", "on_event")
"""Attributes of the parts that lead out of the twin: to whoever is told of something."""

BY_CHANCE = ("seed", "flash", "line_speed", "start_mm")  # fields of `TwinSpec` in which twins of one kind may differ


@dataclass(frozen=True)
class Kind:
    """Which twins can have a state: those built alike, but for seed, start position, flash and line speed."""

    about: str
    """In words."""
    digest: str
    """Of all that matters."""

    @classmethod
    def of(cls, controller: str, machine: Machine, plant: str, axes: int, events: Sequence[ScenarioEvent]) -> Kind:
        """Of a twin with this machine, its overrides made, this controller of so many axes, and these events."""
        files = (machine.model_file.name, machine.fixture_file and machine.fixture_file.name)
        bare = replace(machine, folder=Path(), model_file=Path(), fixture_file=None)
        whole = repr((VERSION, controller, bare, files, plant, axes, tuple(events)))
        return cls(f"{controller} on {machine.name}, plant {plant}", sha256(whole.encode()).hexdigest())

    def check(self, state: TwinState) -> None:
        """Raise StateError unless a twin of this kind can have the state."""
        if state.kind == self:
            return
        differs = (
            "they differ in overrides, machine file, scenario or version" if state.kind.about == self.about else ""
        )
        raise StateError(
            f"a state of {state.kind.about} cannot be restored into {self.about}{differs and f': {differs}'}"
        )


@dataclass(frozen=True, eq=False)
class TwinState:
    """What `Twin.save` gives and `Twin.restore` takes: immutable, and good for as many twins as there are. It can be
    pickled; unpickling runs code, so take states only from whom you would take programs from."""

    kind: Kind
    origin: Mapping[str, Any]
    """Of `TwinSpec`, what may differ in twins of this kind."""
    time_ns: int
    flash: bytes | None
    life: Life
    """Of the controller."""
    parts: bytes
    """By `pack`."""
    plant: Mapping[str, Any]
    """By `Plant.save`."""


class _Pickler(pickle.Pickler):
    """Writes names in place of what has one."""

    names: dict[int, str]

    def persistent_id(self, thing: Any) -> str | None:
        return self.names.get(id(thing))


class _Unpickler(pickle.Unpickler):
    """Reads things in place of names."""

    things: dict[str, object]

    def persistent_load(self, name: Any) -> Any:
        return self.things[name]


def pack(own: Mapping[str, Any], parts: Mapping[str, object], known: Mapping[str, object]) -> bytes:
    """Attributes of a twin, and all attributes of its parts, in one piece.

    known: what has a name in every twin built alike, parts included, and is not to be copied. Raises StateError for
    what cannot be pickled.
    """
    attributes = {
        name: {key: value for key, value in vars(part).items() if key not in _OUTSIDE} for name, part in parts.items()
    }
    out = io.BytesIO()
    pickler = _Pickler(out, pickle.HIGHEST_PROTOCOL)
    pickler.names = {id(thing): name for name, thing in _named(known)}
    try:
        pickler.dump((dict(own), attributes))
    except Exception as error:  # whatever a language or a motion of other people raises
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise StateError(f"the twin cannot be saved: {reason}; see docs/controllers.md") from error
    return out.getvalue()


def unpack(data: bytes, parts: Mapping[str, object], known: Mapping[str, object]) -> dict[str, Any]:
    """Give the parts the attributes that `pack` has seen; return those of the twin."""
    unpickler = _Unpickler(io.BytesIO(data))
    unpickler.things = dict(_named(known))
    own, attributes = unpickler.load()
    for name, part in parts.items():
        vars(part).update(attributes[name])
    return dict(own)


def _named(known: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Name and thing; the members of a tuple one by one. What is None is not there."""
    for name, thing in known.items():
        if isinstance(thing, tuple):
            yield from ((f"{name}.{number}", member) for number, member in enumerate(thing))
        if thing is not None:
            yield name, thing
