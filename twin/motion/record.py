"""The record of what was commanded: a list of motions, expanded to arrays on demand.

A motion needs about a kilobyte, whatever its length. A twin that runs for weeks can keep only the last ones:

    dropped                    motions
    - - - - - - - - - - - -|---|--|----|---|-----|      keep = 5
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Iterator
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement, added


class Steps:
    """The kept motions, in the order of time.

    A motion is appended when it starts and replaced by `replace_last` when it is stopped or cut, so the last one may
    reach into the future: `until(t)` is the record of what has been commanded by t.

        record.append(run)                      # a motion begins
        record.replace_last(run.stopped(t))     # the stop key
        record.until(now).t_ns                  # what has happened
    """

    def __init__(self, axes: int, motions: Iterable[Motion] = (), keep: int | None = None) -> None:
        """keep: how many motions to keep, the last ones; None: all. Raises ValueError below 1, or as `append`."""
        if keep is not None and keep < 1:
            raise ValueError(f"a record keeps at least one motion, not {keep}")
        self.axes = axes
        self.dropped = 0  # motions at the beginning that were dropped
        self.dropped_ticks = 0
        self._ticks = 0  # of the kept motions
        self._motions: deque[Motion] = deque(maxlen=keep)
        for motion in motions:
            self.append(motion)

    @property
    def keep(self) -> int | None:
        return self._motions.maxlen

    @property
    def motions(self) -> tuple[Motion, ...]:
        return tuple(self._motions)

    def append(self, motion: Motion) -> None:
        """Add a motion. Raises ValueError if it starts before the end of the last one or has another number of axes."""
        if motion.axes != self.axes:
            raise ValueError(f"a motion of {motion.axes} axes in a record of {self.axes}")
        if self._motions and motion.start_ns < self._motions[-1].end_ns:
            raise ValueError(
                f"a motion starts at {motion.start_ns} ns, before the last one ends at {self._motions[-1].end_ns} ns"
            )
        if len(self._motions) == self._motions.maxlen:
            self._drop()
        self._motions.append(motion)
        self._ticks += motion.last - motion.first

    def replace_last(self, motion: Motion) -> None:
        """Put the stopped or cut version of the last motion in its place."""
        before, self._motions[-1] = self._motions[-1], motion
        self._ticks += (motion.last - motion.first) - (before.last - before.first)

    def forget(self) -> None:
        """Drop all motions but the last one, if that has ticks; `made` counts them still."""
        while len(self._motions) > 1 and self._motions[-1].last > self._motions[-1].first:
            self._drop()

    def _drop(self) -> None:
        oldest = self._motions.popleft()
        self.dropped += 1
        self.dropped_ticks += oldest.last - oldest.first
        self._ticks -= oldest.last - oldest.first

    def until(self, t_ns: int) -> Steps:
        """The record of the ticks at or before t_ns."""
        steps = Steps(self.axes)
        steps.dropped, steps.dropped_ticks = self.dropped, self.dropped_ticks
        steps._motions.extend(self._motions)
        steps._ticks = self._ticks
        while steps._motions and steps._motions[-1].start_ns > t_ns:
            later = steps._motions.pop()
            steps._ticks -= later.last - later.first
        if steps._motions:
            steps.replace_last(steps._motions[-1].cut(t_ns))
        return steps

    def since(self, made: int) -> Displacement:
        """Sum of the changes of each axis after the first `made` ticks, of which those of dropped motions count."""
        way, left = (0,) * self.axes, self.made - made
        for motion in reversed(self._motions):
            ticks = motion.last - motion.first
            if left < ticks:
                _, delta = motion.window(motion.last - max(left, 0), motion.last)
                return added(way, delta.sum(axis=0, dtype=np.int64).tolist())
            way, left = added(way, motion.displacement(motion.end_ns)), left - ticks
        return way

    @property
    def made(self) -> int:
        """Number of ticks, including those of dropped motions; `len` is without them."""
        return self.dropped_ticks + len(self)

    def __len__(self) -> int:
        return self._ticks

    @property
    def dtype(self) -> np.dtype[Any]:
        """int8 for steps; int32 as soon as one motion has set points."""
        return np.dtype(np.int32 if any(motion.lead_ns for motion in self._motions) else np.int8)

    def chunks(self, size: int = 1 << 16) -> Iterator[tuple[NDArray[np.int64], NDArray[Any]]]:
        """The stream in pieces of at most `size` ticks: times in ns int64 [m], changes int8 or int32 [m, axes]."""
        for motion in self._motions:
            for k in range(motion.first, motion.last, size):
                yield motion.window(k, min(k + size, motion.last))

    @property
    def t_ns(self) -> NDArray[np.int64]:
        """int64 [n], times of all ticks in ns."""
        return self._filled(np.empty(len(self), dtype=np.int64), 0)

    @property
    def delta(self) -> NDArray[Any]:
        """int8 or int32 [n, axes], change of each axis at each tick; -1, 0 or +1 where steps are made."""
        return self._filled(np.empty((len(self), self.axes), dtype=self.dtype), 1)

    def _filled(self, out: NDArray[Any], column: int) -> NDArray[Any]:
        done = 0
        for chunk in self.chunks():
            out[done : done + len(chunk[column])] = chunk[column]
            done += len(chunk[column])
        return out
