"""The replays of a fit: made by a crew, counted, and kept in a journal, so that a fit that was killed goes on.

    journal    {"key": SHA-256 of session, machine and new numbers, "values": [...]}     a line of JSON for each replay

A replay depends on nothing else (replays have one seed), so one that is in the journal need not be made again: the same
call after a kill reads what was made, asks for the rest, and ends with the same bits. A last line that was torn off is
left out. Another machine file, another recording or another version has other keys.
"""

from __future__ import annotations

import functools
import hashlib
import json
import logging
import math
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.crew import Crew, in_order
from isel_twin.base.files import appending, atomic_write
from isel_twin.base.parameters import parse_json
from isel_twin.machine import Machine, MachineError
from isel_twin.machine.spread import numbers
from isel_twin.many.identification.session import Session, predict
from isel_twin.many.identification.unknowns import Unknown, candidate, changes
from isel_twin.version import VERSION

Floats = NDArray[np.float64]
log = logging.getLogger("isel_twin")

_BEGINS = b'{"key": "'  # a line of a journal

Call = tuple[Session, Machine, tuple[Unknown, ...], list[float]]


class Replays:
    """Makes them. Raises OSError for a journal that cannot be read or written, ValueError for one that is none."""

    def __init__(
        self,
        crew: Crew | None = None,
        progress: Callable[[int], None] | None = None,
        journal: Path | None = None,
    ) -> None:
        """crew: None: this process. progress: called with the number of replays. journal: None: none."""
        self._crew, self._progress, self._journal = crew, progress, journal
        self._known = {} if journal is None else _read(journal)
        self._asked: set[str] = set()

    def make(self, calls: Sequence[Call]) -> list[Floats]:
        """float64 [data of its session] of each call; one that was made before is not made again."""
        keys = [_key(call) for call in calls]
        missing = {key: call for key, call in zip(keys, calls, strict=True) if key not in self._known}
        made = in_order(replayed, list(missing.values()), self._crew)
        for key in dict.fromkeys(keys):
            if key in missing:
                self._keep(key, next(made))
            if key not in self._asked:
                self._asked.add(key)
                if self._progress is not None:
                    self._progress(self.count)
        return [self._known[key] for key in keys]

    @property
    def count(self) -> int:
        """How many different ones there were; those that were read count, too."""
        return len(self._asked)

    def _keep(self, key: str, values: Floats) -> None:
        self._known[key] = values
        if self._journal is not None:
            with appending(self._journal) as file:
                file.write(json.dumps({"key": key, "values": values.tolist()}) + "\n")


def replayed(call: Call) -> Floats:
    """One session on one candidate, for worker processes; nan if it cannot be built. Raises MeasuredError."""
    session, machine, unknowns, values = call
    try:
        return predict(session, candidate(machine, unknowns, values))
    except MachineError:
        return np.full(len(session.data), math.nan)


def _key(call: Call) -> str:
    session, machine, unknowns, values = call
    flags = {item.flag for item in unknowns if item.flag and not getattr(machine.imperfections, item.flag)}
    believed = {key: f"{entry['value']:.12g}" for key, entry in numbers(machine.tree)}
    new = ((key, f"{value:.12g}") for key, value in changes(machine, unknowns, values).items())
    told = sorted(one for one in new if one[1] != believed.get(one[0])), sorted(flags)
    return hashlib.sha256(f"{VERSION} {machine.digest} {_session_key(session)} {told!r}".encode()).hexdigest()


@functools.lru_cache(64)
def _named(text: str) -> str:
    return hashlib.sha256(text.encode()).hexdigest()


def _session_key(session: Session) -> str:
    return _named(repr(session))


def _read(journal: Path) -> dict[str, Floats]:
    """The replays of a journal; damaged lines are left out. Raises ValueError for another file, which stays."""
    lines = journal.read_bytes().split(b"\n") if journal.exists() else [b""]
    kept = [(line, replay) for line in lines[:-1] if (replay := _replay(line)) is not None]
    torn = lines[-1]  # by a kill
    if not kept and not (lines == [torn] and (torn.startswith(_BEGINS) or _BEGINS.startswith(torn))):
        raise ValueError(f"{journal}: is no journal of replays; name another file for the journal")
    if damaged := len(lines) - 1 - len(kept):
        log.warning("%s: %d damaged lines are left out; their replays are made again", journal, damaged)
    if damaged or torn:
        atomic_write(journal, b"".join(line + b"\n" for line, _ in kept))
    return dict(replay for _, replay in kept)


def _replay(line: bytes) -> tuple[str, Floats] | None:
    """Key and values in a line of a journal; None if it is damaged."""
    try:
        content = parse_json(line)
        values = np.array(content["values"], dtype=np.float64)
    except (ValueError, KeyError, TypeError):
        return None
    return (content["key"], values) if isinstance(content.get("key"), str) and values.ndim == 1 else None
