"""The state of a twin, which it, or another twin of the same kind, can restore.

    state = twin.save()          controller, line, wiring, scenario, plant, random generators: to the bit
    twin.restore(state)          also in another twin, in another process (pickle)

    controller            its first state and the calls since, or a pickle (isel_twin.core.told)
    position, line,       one pickle of all their attributes, so that shared objects stay shared; what all twins of a
    wiring, stream        kind have (machine, plant, controller, events) is a name in it, not a copy
    plant                 copies of its arrays (Plant.save)

Observers, samplers, listeners and the flash file are not in it (core/8).
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

# attributes of the parts that are callbacks
_OUTSIDE = ("before_change", "spindle_now", "on_reply", "on_lost", "on_event")

BY_CHANCE = (
    "seed",
    "flash",
    "line_speed",
    "adapter_ms",
    "start_mm",
)  # fields of `TwinSpec` in which twins of one kind may differ


@dataclass(frozen=True)
class Kind:
    """Kind of a twin: twins with equal kinds can exchange states. They may differ in seed, start, flash and line
    speed."""

    about: str
    digest: str

    @classmethod
    def of(cls, controller: str, machine: Machine, plant: str, axes: int, events: Sequence[ScenarioEvent]) -> Kind:
        """machine: with its overrides; axes: of the controller."""
        files = (machine.model_file.name, machine.fixture_file and machine.fixture_file.name)
        bare = replace(machine, folder=Path(), model_file=Path(), fixture_file=None)
        whole = repr((VERSION, controller, bare, files, plant, axes, tuple(events)))
        return cls(f"{controller} on {machine.name}, plant {plant}", sha256(whole.encode()).hexdigest())

    def check(self, state: TwinState) -> None:
        """Raise StateError unless a twin of this kind can restore the state."""
        if not isinstance(state, TwinState):
            raise StateError(f"restore takes a state that save has returned, not {type(state).__name__}")
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
    """Result of `Twin.save`, immutable. It can be pickled. Unpickling runs code, so load only states from sources that
    you trust."""

    kind: Kind
    origin: Mapping[str, Any]  # fields of `TwinSpec` that may differ in twins of this kind
    time_ns: int
    flash: bytes | None
    life: Life  # of the controller
    parts: bytes  # by `pack`
    plant: Mapping[str, Any]  # by `Plant.save`


class _Pickler(pickle.Pickler):
    """Writes names in place of known objects."""

    names: dict[int, str]

    def persistent_id(self, thing: Any) -> str | None:
        return self.names.get(id(thing))


class _Unpickler(pickle.Unpickler):
    """Puts known objects in place of names."""

    things: dict[str, object]

    def persistent_load(self, name: Any) -> Any:
        return self.things[name]


def pack(own: Mapping[str, Any], parts: Mapping[str, object], known: Mapping[str, object]) -> bytes:
    """Attributes of a twin and of its parts in one pickle. known: objects stored by name, parts included. Raises
    StateError for what cannot be pickled."""
    attributes = {
        name: {key: value for key, value in vars(part).items() if key not in _OUTSIDE} for name, part in parts.items()
    }
    out = io.BytesIO()
    pickler = _Pickler(out, pickle.HIGHEST_PROTOCOL)
    pickler.names = {id(thing): name for name, thing in _named(known)}
    try:
        pickler.dump((dict(own), attributes))
    except Exception as error:  # a plug-in's language or motion may raise anything
        reason = " ".join(f"{type(error).__name__}: {error}".split())
        raise StateError(f"the twin cannot be saved: {reason}; see docs/controllers.md") from error
    return out.getvalue()


def unpack(data: bytes, parts: Mapping[str, object], known: Mapping[str, object]) -> dict[str, Any]:
    """Set the attributes of the parts; return those of the twin."""
    unpickler = _Unpickler(io.BytesIO(data))
    unpickler.things = dict(_named(known))
    own, attributes = unpickler.load()
    for name, part in parts.items():
        vars(part).update(attributes[name])
    return dict(own)


def _named(known: Mapping[str, object]) -> Iterator[tuple[str, object]]:
    """Pairs of name and object, also for each member of a tuple, without None."""
    for name, thing in known.items():
        if isinstance(thing, tuple):
            yield from ((f"{name}.{number}", member) for number, member in enumerate(thing))
        if thing is not None:
            yield name, thing
