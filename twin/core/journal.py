"""Notes of all that happens to a twin, with its virtual time.

    twin.listen(note)               note(time_ns, kind, what) from now on

    kind         what
    sent         bytes                       the host sends them by `Twin.write`
    received     Received                    bytes on their way to the host; noted when the controller answers
    lost         Received                    of these, bytes that do not arrive, because the line is cut
    operated     table                       an operation: the keys of a scenario event, or SETTINGS
    scenario     table                       an event of the scenario happens
    motion       Motion or None              the controller's motion has changed
    counter      CounterSet                  it has set a counter without a motion
    flash        bytes                       it has written its flash memory
    remark       text
    collision    Collision                   two bodies have met that must not
    restored     time in ns                  the twin is about to be restored to a state of that time (`Twin.restore`);
                                             a listener that cannot follow raises ValueError (one line) to prevent it

Causes are noted before their effects. `sent` and `operated` are the causes: repeated at the same instants with a twin
of the same `TwinSpec` they give the same bits (recordings/2).
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, Final

from isel_twin.plant import Cut
from isel_twin.wiring import cut_table

Note = Callable[[int, str, Any], None]  # note(time_ns, kind, what), as in the module docstring

# keys of an `operated` table that scenarios do not have: state of the line, reset of the least margins
SETTINGS: Final = ("line_speed", "watch_margin")


@dataclass(frozen=True)
class Received:
    """Bytes for the host: the last one arrives at arrival_ns, each byte_ns after the one before (0: all at once)."""

    data: bytes
    arrival_ns: int
    byte_ns: int


def in_words(what: Any) -> str:
    """what: the table of an event, or a remark."""
    if isinstance(what, Mapping):
        return ", ".join(f"{key} {in_words(value)}" for key, value in what.items())
    return str(what)


def push_content(axis: str, force_n: float, place: str) -> dict[str, Any]:
    """A push as the table of a scenario event."""
    return {"force_n": {axis: force_n}, **({"place": place} if place else {})}


def cut_content(cut: Cut | None) -> dict[str, Any]:
    """A cut, or the end of one, as the table of a scenario event."""
    return {"cut": "off" if cut is None else cut_table(cut)}
