"""Samples of a twin, on a grid of virtual time and at every change of a level, input or output, and these changes.
Samples go to a temporary file, so that a long job needs little memory; changes are few and stay in memory. If the disk
is full, the recording ends and the machine goes on.

    time    0      1 ms    2 ms         3 ms
    sample  |       |       |    |       |
                                 limit_x2 struck
"""

from __future__ import annotations

import logging
import tempfile
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Protocol

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.axes import CARRIAGES
from isel_twin.core.journal import in_words
from isel_twin.core.told import StateError

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

BUFFER = 4096  # samples kept before they go to the file
log = logging.getLogger("isel_twin")


@dataclass(frozen=True)
class Change:
    """From time_ns on, `name` of `group` (`level`, `input` or `output`) has this value."""

    time_ns: int
    group: str
    name: str
    value: int | str


def changes(last: dict[str, int | str], values: Mapping[str, int | str]) -> dict[str, int | str]:
    """The values that differ from `last`, which is updated; numbers in JSON's types."""
    if values == last:
        return {}
    plain = {name: value if isinstance(value, str) else int(value) for name, value in values.items()}
    changed = {name: value for name, value in plain.items() if last.get(name) != value}
    last |= changed
    return changed


def sample_dtype(axes: int) -> np.dtype[np.void]:
    """The type of a sample of a controller with that many axes."""
    counts, lost = ("counts", np.int64, (axes,)), ("lost_steps", np.float64, (axes,))
    return np.dtype([("time_ns", np.int64), counts, ("position_mm", np.float64, (len(CARRIAGES),)), lost])


class Samples(Protocol):
    """Samples and changes for the writers of traces, from a `Recorder` or read back (reading.py)."""

    axes: int
    dtype: np.dtype[np.void]
    changes: list[Change]

    def __len__(self) -> int: ...
    def samples(self, size: int = 65_536) -> Iterator[NDArray[np.void]]: ...
    def names(self) -> list[tuple[str, str]]: ...


class Recorder:
    """Samples of one twin every interval_ns of virtual time, from now on. Use it as a context manager."""

    def __init__(self, twin: Twin, interval_ns: int) -> None:
        self.changes: list[Change] = []
        self.axes = len(twin.counts)
        self.dtype = sample_dtype(self.axes)
        self.ended = False  # True after a full disk: nothing more is recorded
        self.counters_set_ns: list[int] = []  # times at which counters were set: the jump of positions is no motion
        self.events: list[tuple[int, str, str]] = []
        """(time in ns, kind, in words) of what a scenario or somebody did, and remarks."""
        self._last: dict[str, dict[str, int | str]] = {"level": {}, "input": {}, "output": {}}
        self._buffer = np.empty(BUFFER, dtype=self.dtype)
        self._buffered = self._stored = 0
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  (closed by close())
        twin.listen(self._hear)
        twin.observe(self._look, interval_ns)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        self._file.close()

    def __len__(self) -> int:
        return self._stored + self._buffered

    def _hear(self, time_ns: int, kind: str, what: Any) -> None:
        if kind == "counter":
            if not self.counters_set_ns or self.counters_set_ns[-1] != time_ns:
                self.counters_set_ns.append(time_ns)
        elif kind == "restored" and not self._file.closed:
            raise StateError("a twin that is being recorded cannot go to another time; close its recording before")
        elif kind == "collision":
            self.events.append((time_ns, kind, str(what)))
        # each line of a job does this
        elif kind in ("scenario", "operated", "remark") and what != {"watch_margin": True}:
            self.events.append((time_ns, kind, in_words(what)))

    def _look(self, twin: Twin) -> None:
        time_ns = twin.time_ns
        again = self._buffered > 0 and self._buffer["time_ns"][self._buffered - 1] == time_ns
        if self.ended or (self._buffered == BUFFER and not again and not self._store()):
            return
        if not again:  # the last of several samples at one instant counts
            self._buffered += 1
        self._buffer[self._buffered - 1] = (time_ns, twin.counts, twin.position_mm, twin.lost_steps)
        for group, values in (("level", twin.levels), ("input", twin.inputs), ("output", twin.outputs)):
            changed = changes(self._last[group], values)
            self.changes += [Change(time_ns, group, name, value) for name, value in changed.items()]

    def _store(self) -> bool:
        """Move the buffer to the file. False if there is no room for it, which ends the recording."""
        try:
            self._buffer.tofile(self._file)
        except OSError:  # numpy does not give the reason
            self.ended = True
            now_s, folder = self._buffer["time_ns"][-1] / 1e9, tempfile.gettempdir()
            log.error("the recording ends at %.3f s: no room for it in %s", now_s, folder)
            return False
        self._stored += BUFFER
        self._buffered = 0
        return True

    def samples(self, size: int = 65_536) -> Iterator[NDArray[np.void]]:
        """All samples so far in pieces of at most `size`, dtype `sample_dtype(axes)`, in the order of time."""
        self._file.seek(0)
        remaining = self._stored
        while remaining:
            piece = np.fromfile(self._file, dtype=self.dtype, count=min(size, remaining))
            remaining -= len(piece)
            yield piece
        self._file.seek(0, 2)
        for first in range(0, self._buffered, size):
            yield self._buffer[first : min(first + size, self._buffered)].copy()

    def names(self) -> list[tuple[str, str]]:
        """(group, name) of everything that had a value, group by group."""
        return [(group, name) for group, values in self._last.items() for name in values]
