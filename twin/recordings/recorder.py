"""Samples of a twin, on a grid of virtual time and at every change of a level, input or output, and these changes.
Samples go to a temporary file, so that a long job needs little memory; changes are few and stay in memory. If the disk
is full, the recording ends and the machine goes on.

    time    0      1 ms    2 ms         3 ms
    sample  |       |       |    |       |
                                 limit_x2 struck

The plant takes the samples of the grid (twin/core/sampling.py). It takes none while nothing moves: the last one is
written again for each time of the grid.
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
    from isel_twin.core.sampling import TwinSamples
    from isel_twin.core.twin import Twin

BUFFER = 4096  # samples kept before they go to the file
PIECE = 65_536  # samples that are made of one that is held, at a time
MOST_LOOKS = 100  # most samples at changes that wait for those of the grid, to be put in order together
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
        self._ended = False
        self.counters_set_ns: list[int] = []  # times at which counters were set: the jump of positions is no motion
        self.events: list[tuple[int, str, str]] = []
        """(time in ns, kind, in words) of what a scenario or somebody did, and remarks."""
        self._last: dict[str, dict[str, int | str]] = {"level": {}, "input": {}, "output": {}}
        self._twin, self._interval_ns = twin, interval_ns
        self._kept = [np.empty(0, dtype=self.dtype)]  # samples that are not in the file
        self._buffered = self._stored = 0  # samples kept and in the file
        self._file = tempfile.TemporaryFile()  # noqa: SIM115  (closed by close())
        self._looks: list[tuple[Any, ...]] = []  # samples at changes, since the last ones of the grid
        self._held = np.array([self._now()], dtype=self.dtype)  # the last one that the plant took
        self._grid_ns = (twin.time_ns // interval_ns + 1) * interval_ns  # the next time of the grid
        twin.listen(self._hear)
        self._sampler = twin.sample(self._take, interval_ns)
        twin.observe(self._look, interval_ns if self._sampler is None else None)

    def __enter__(self) -> Recorder:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        if self._sampler is not None:
            self._twin.sample_no_more(self._take)
            self._sampler = None
        self._file.close()

    @property
    def ended(self) -> bool:
        """True after a full disk: nothing more is recorded."""
        self._catch_up()
        return self._ended

    def __len__(self) -> int:
        self._catch_up()
        return self._stored + self._buffered

    def _hear(self, time_ns: int, kind: str, what: Any) -> None:
        if kind == "counter":
            if not self.counters_set_ns or self.counters_set_ns[-1] != time_ns:
                self.counters_set_ns.append(time_ns)
            if self._sampler is not None and time_ns % self._interval_ns == 0 and not self._ended:
                self._looks.append(self._now())  # the plant took its sample in the old zero
        elif kind == "restored" and not self._file.closed:
            raise StateError("a twin that is being recorded cannot go to another time; close its recording before")
        elif kind == "collision":
            self.events.append((time_ns, kind, str(what)))
        # each line of a job does this
        elif kind in ("scenario", "operated", "remark") and what != {"watch_margin": True}:
            self.events.append((time_ns, kind, in_words(what)))

    def _now(self) -> tuple[Any, ...]:
        twin = self._twin
        return twin.time_ns, twin.counts, twin.position_mm, twin.lost_steps

    def _look(self, twin: Twin) -> None:
        if self._ended:
            return
        self._looks.append(self._now())
        if len(self._looks) >= MOST_LOOKS:
            self._catch_up()
        for group, values in (("level", twin.levels), ("input", twin.inputs), ("output", twin.outputs)):
            changed = changes(self._last[group], values)
            self.changes += [Change(twin.time_ns, group, name, value) for name, value in changed.items()]

    def _take(self, samples: TwinSamples) -> None:
        rows = np.empty(len(samples.time_ns), dtype=self.dtype)
        for name in self.dtype.names or ():
            rows[name] = getattr(samples, name)
        self._go_on(rows)

    def _catch_up(self) -> None:
        """Keep all samples to the present."""
        if self._sampler is not None:
            self._sampler.hand_on()
        self._go_on(self._held[:0])

    def _go_on(self, taken: NDArray[np.void]) -> None:
        """Keep the samples of the grid to the present, of which the plant has taken these, and those at changes."""
        known = np.concatenate([self._held, taken])
        self._held = known[-1:]
        looks, self._looks = np.array(self._looks, dtype=self.dtype), []
        now_ns, every = self._twin.time_ns, self._interval_ns
        while not self._ended:
            last_ns = min(now_ns, self._grid_ns + (PIECE - 1) * every)
            rows = looks[:0]
            if self._sampler is not None and self._grid_ns <= last_ns:
                grid_ns = np.arange(self._grid_ns, last_ns + 1, every, dtype=np.int64)
                self._grid_ns = int(grid_ns[-1]) + every
                rows = known[np.searchsorted(known["time_ns"], grid_ns, side="right") - 1]
                rows["time_ns"] = grid_ns
            else:
                last_ns = now_ns
            due = int(np.searchsorted(looks["time_ns"], last_ns, side="right"))
            self._keep(np.concatenate([rows, looks[:due]]))
            looks = looks[due:]
            if last_ns == now_ns:
                return

    def _keep(self, rows: NDArray[np.void]) -> None:
        """Keep rows in the order of time; the last of several samples at one instant counts."""
        if not len(rows):
            return
        rows = np.concatenate([self._kept[-1][-1:], rows])
        self._kept[-1] = self._kept[-1][:-1]
        rows = rows[np.argsort(rows["time_ns"], kind="stable")]
        rows = rows[np.append(np.diff(rows["time_ns"]) != 0, True)]
        self._kept.append(rows)
        self._buffered = sum(len(part) for part in self._kept)
        if self._buffered > BUFFER:
            self._store()

    def _store(self) -> None:
        """Move what is kept to the file, but for the last sample. No room for it ends the recording."""
        rows = np.concatenate(self._kept)
        try:
            rows[:-1].tofile(self._file)
        except OSError:  # numpy does not give the reason
            self._ended = True
            rows = rows[:BUFFER]
            self._kept, self._buffered = [rows], len(rows)
            now_s, folder = rows["time_ns"][-1] / 1e9, tempfile.gettempdir()
            log.error("the recording ends at %.3f s: no room for it in %s", now_s, folder)
            return
        self._stored += len(rows) - 1
        self._kept, self._buffered = [rows[-1:].copy()], 1

    def samples(self, size: int = 65_536) -> Iterator[NDArray[np.void]]:
        """All samples so far in pieces of at most `size`, dtype `sample_dtype(axes)`, in the order of time."""
        self._catch_up()
        self._file.seek(0)
        remaining = self._stored
        while remaining:
            piece = np.fromfile(self._file, dtype=self.dtype, count=min(size, remaining))
            remaining -= len(piece)
            yield piece
        self._file.seek(0, 2)
        kept = np.concatenate(self._kept)
        for first in range(0, len(kept), size):
            yield kept[first : first + size]

    def names(self) -> list[tuple[str, str]]:
        """(group, name) of everything that had a value, group by group."""
        return [(group, name) for group, values in self._last.items() for name in values]
