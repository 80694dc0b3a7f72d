"""The record of what was stepped: a list of runs, expanded to arrays where it is looked at."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.path import decode
from isel_twin.motion.run import Run

__all__ = ["Steps"]


class Steps:
    """The step stream of all runs so far, in the order of time.

    Whoever executes runs appends each one when it starts and calls `replace_last` when it was stopped or cut, so the
    last run may lie in the future: `until(t)` is the record of what has been stepped by t.

        record.append(run)                      # a motion begins
        record.replace_last(run.stopped(t))     # the stop key
        record.until(now).t_ns                  # what has happened
    """

    def __init__(self, runs: Iterable[Run] = ()) -> None:
        self._runs: list[Run] = []
        for run in runs:
            self.append(run)

    @property
    def runs(self) -> tuple[Run, ...]:
        """The runs, in the order of time."""
        return tuple(self._runs)

    def append(self, run: Run) -> None:
        """Add a run. Raises ValueError if it starts before the end of the last one."""
        if self._runs and run.start_ns < self._runs[-1].end_ns:
            raise ValueError(
                f"a run starts at {run.start_ns} ns, before the last one ends at {self._runs[-1].end_ns} ns"
            )
        self._runs.append(run)

    def replace_last(self, run: Run) -> None:
        """Put the stopped or cut version of the last run in its place."""
        self._runs[-1] = run

    def until(self, t_ns: int) -> Steps:
        """The record of the ticks at or before t_ns."""
        steps = Steps()
        steps._runs = [run for run in self._runs if run.start_ns <= t_ns]
        if steps._runs:
            steps._runs[-1] = steps._runs[-1].cut(t_ns)
        return steps

    def __len__(self) -> int:
        """Number of ticks."""
        return sum(run.profile.ticks for run in self._runs)

    def packed(self, size: int = 1 << 16) -> Iterator[tuple[NDArray[np.int64], NDArray[np.uint8]]]:
        """The stream in pieces of at most `size` ticks: times in ns int64 [m], packed steps uint8 [m]."""
        for run in self._runs:
            for k in range(run.first, run.last, size):
                yield run.window(k, min(k + size, run.last))

    def chunks(self, size: int = 1 << 16) -> Iterator[tuple[NDArray[np.int64], NDArray[np.int8]]]:
        """The stream in pieces of at most `size` ticks: times in ns int64 [m], steps of the four axes int8 [m, 4]."""
        for t_ns, code in self.packed(size):
            yield t_ns, decode(code)

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """int64 [n], times of all ticks in ns."""
        out = np.empty(len(self), dtype=np.int64)
        done = 0
        for t_ns, _ in self.packed():
            out[done : done + t_ns.size] = t_ns
            done += t_ns.size
        return out

    @property
    def delta(self) -> NDArray[np.int8]:
        """int8 [n, 4], steps of X, Y, Z, A at each tick: -1, 0 or +1."""
        out = np.empty((len(self), 4), dtype=np.int8)
        done = 0
        for _, delta in self.chunks():
            out[done : done + len(delta)] = delta
            done += len(delta)
        return out
