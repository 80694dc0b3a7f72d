"""The stream of a controller as time goes on: the motion it is making, the ticks still to be made, the record.

The owner of the clock asks for the ticks up to a time, reports how many of them were made, and hands over the
controller's motion whenever that may have changed (`follow`).

            made         expanded               motion.last
    - made --|- to be made --|- - - not expanded - - -|
             at              len(window)
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
from numpy.typing import NDArray

from isel_twin.base.units import SECOND_NS
from isel_twin.motion.motion import Motion
from isel_twin.motion.path import Displacement, StepLine, between
from isel_twin.motion.record import Steps
from isel_twin.motion.step_run import StepRun

CHUNK = 1 << 15  # ticks of a motion expanded at once; bounds the memory of long moves
DENSE = 1000  # ticks between two times from which on it is cheaper to count them than to find the time of each
RATE_TICKS = 16  # ticks before and after the present over which a step frequency is averaged


class Stream:
    def __init__(self, axes: int, keep: int | None = None) -> None:
        """keep: how many motions the record keeps, the last ones; None: all. Raises ValueError below 1."""
        self._record = Steps(axes, keep=keep)
        self._none = np.empty(0, dtype=np.int64), np.empty((0, axes), dtype=np.int8)
        self._motion: Motion | None = None
        self._made = 0
        self._at = 0
        self._t_ns, self._delta = self._none

    @property
    def keep(self) -> int | None:
        return self._record.keep

    @property
    def moving(self) -> bool:
        return self._motion is not None

    @property
    def lead_ns(self) -> int:
        return 0 if self._motion is None else self._motion.lead_ns

    def steps(self, t_ns: int) -> Steps:
        """Record of what has been made by t_ns, the present."""
        return self._record.until(t_ns)

    def forget(self) -> None:
        """Drop the record of earlier motions (`Steps.forget`)."""
        self._record.forget()

    def rate_hz(self) -> NDArray[np.float64]:
        """float64 [axes], changes of each command in a second, mean over some ticks around the present; 0 at rest."""
        motion = self._motion
        first, end = max(0, self._at - RATE_TICKS), min(len(self._t_ns), self._at + RATE_TICKS)
        t_ns, delta = self._t_ns[first:end], self._delta[first:end]
        if motion is not None and end == 0 and self._made > motion.first:  # they have been skipped
            around = max(motion.first, self._made - RATE_TICKS), min(motion.last, self._made + RATE_TICKS)
            t_ns, delta = motion.window(*around)
        if motion is None or len(t_ns) < 2:
            return np.zeros(self._delta.shape[1])
        changes = delta[1:].sum(axis=0, dtype=np.int64)
        return changes * (SECOND_NS / float(t_ns[-1] - t_ns[0]))

    def follow(self, motion: Motion | None, t_ns: int) -> bool:
        """Take over the controller's motion at t_ns; return whether it has changed. Raises ValueError for a new motion
        with ticks before t_ns, which nobody would make."""
        before = self._motion
        if motion is before:
            return False
        self._motion = motion
        self._at = 0
        self._t_ns, self._delta = self._none
        if before is not None and motion is not None and motion.continues(before):
            self._record.replace_last(motion)
            return True
        if motion is not None and motion.start_ns < t_ns and (late := motion.count(t_ns - 1) - motion.first):
            raise ValueError(
                f"the controller lays {late} of its ticks in the past, before {t_ns} ns: nobody makes them"
            )
        if before is not None and (cut := before.cut(t_ns)) is not before:
            self._record.replace_last(cut)
        if motion is not None:
            self._record.append(motion)
            self._made = motion.first
        return True

    def until(self, t_ns: int) -> tuple[NDArray[np.int64], NDArray[Any]]:
        """Times int64 [n] and changes [n, axes] of the expanded ticks still to be made up to t_ns.

        `more_after(n)` tells whether there are others.
        """
        motion, at = self._motion, self._at
        if at == len(self._t_ns) and motion is not None and self._made < motion.last:
            self._t_ns, self._delta = motion.window(self._made, min(self._made + CHUNK, motion.last))
            self._at = at = 0
        end = int(self._t_ns.searchsorted(t_ns, "right"))
        return (self._t_ns[at:end], self._delta[at:end]) if end > at else self._none

    def straight(self, t_ns: int, below: Sequence[int], above: Sequence[int]) -> tuple[int, int, Displacement] | None:
        """The ticks still to be made up to t_ns, or up to the first one that takes an axis as far from here as below or
        above [axes] say: time, number, and where they lead, on a line: no axis turns on the way. None for other
        motions, and without one: `until` tells each tick."""
        motion = self._motion
        if not isinstance(motion, StepRun) or not isinstance(motion.path, StepLine):
            return None
        path, made, tick = motion.path, self._made, motion.count(t_ns)
        here = path.displacement(made)
        way = between(here, path.displacement(tick))
        out = [i for i, n in enumerate(way) if not below[i] < n < above[i]]
        if out:
            tick = min(path.tick_of(i, here[i] + (above[i] if way[i] > 0 else below[i])) for i in out)
            t_ns = motion.start_ns + int(motion.law.times(tick - motion.first - 1, tick - motion.first)[0])
            tick = motion.count(t_ns)
            way = between(here, path.displacement(tick))
        return t_ns, tick - made, way

    def along(self, times_ns: NDArray[np.int64]) -> NDArray[np.int64]:
        """int64 [n, axes], where the ticks still to be made have led by each of these rising times, on a line (as
        `straight` says)."""
        motion, made = self._motion, self._made
        assert isinstance(motion, StepRun)
        assert isinstance(motion.path, StepLine)
        last = motion.count(int(times_ns[-1]))
        if last - made < DENSE * len(times_ns):
            ticks_ns = motion.start_ns + motion.law.times(made - motion.first, last - motion.first)
            ticks = made + ticks_ns.searchsorted(times_ns, side="right")
        else:
            ticks = np.array([motion.count(time_ns) for time_ns in times_ns.tolist()], dtype=np.int64)
        return motion.path.displacements(ticks) - np.array(motion.path.displacement(made), dtype=np.int64)

    @property
    def ahead(self) -> bool:
        """True if the motion has ticks that are still to be made."""
        return self._motion is not None and self._made < self._motion.last

    def more_after(self, count: int) -> bool:
        """True if ticks follow that are not expanded yet once `count` of the present ones are made."""
        motion = self._motion
        return self._at + count == len(self._t_ns) and motion is not None and self._made + count < motion.last

    def make(self, count: int) -> None:
        """The next `count` ticks have been made."""
        self._made += count
        self._at += count

    def skip(self, count: int) -> None:
        """The next `count` ticks have been made, and nobody has looked at them."""
        self._made += count
        self._at = 0
        self._t_ns, self._delta = self._none
