"""Wall clock and virtual time: the only place of the project where a wall clock is read.

    virtual time = virtual_0 + speed * (wall time - wall_0)

At speed `max` there is no such relation: virtual time runs as fast as it can be computed while something is to be
done, and stands still while everybody waits for the host. A host then gets the same answers at the same virtual
times however slow it is itself.

A twin that cannot keep up with the speed asked for slips: the relation is anchored anew, nothing is made up later.
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Protocol

__all__ = ["Clocked", "Pacer", "parse_speed"]

TICK_NS = 5_000_000
"""Wall time between two looks at a machine in motion, and aim for the computing time of one advance: 5 ms."""

SHORTEST_S = 0.001
"""Shortest sleep of a busy twin: bytes that arrive within it arrive together, as from the FIFO of a serial port."""

LONGEST_S = 1.0
"""Longest sleep of an idle twin, so that no stretch of time gets long; a recording has to look at all of it."""

SLIP_NS = 250_000_000
"""Wall time a twin may fall behind before the relation is anchored anew: 0.25 s."""


LOWEST_SPEED, HIGHEST_SPEED = 1e-6, 1e6
"""Range of finite speeds, wide beyond any use; what a computer cannot reach slips."""


class Clocked(Protocol):
    """What pacing needs of a twin."""

    @property
    def time_ns(self) -> int: ...
    @property
    def next_event_ns(self) -> int | None: ...
    @property
    def idle(self) -> bool: ...
    @property
    def reply_waiting(self) -> bool: ...
    def run_until(self, time_ns: int, stop: Callable[[], bool] | None = None) -> None: ...


def parse_speed(text: str) -> float | None:
    """`1`, `0.5`, `20`: times real time; `max` -> None: as fast as possible. Raises ValueError."""
    if text == "max":
        return None
    try:
        speed = float(text)
    except ValueError:
        speed = math.nan
    if not LOWEST_SPEED <= speed <= HIGHEST_SPEED:  # false for nan, too
        raise ValueError(
            f"speed {text!r} is neither a positive number ({LOWEST_SPEED:g} to {HIGHEST_SPEED:g}) nor 'max'"
        )
    return speed


class Pacer:
    """Keeps a twin at its place in wall time. `speed`: times real time, or None for as fast as possible."""

    def __init__(self, speed: float | None, virtual_ns: int = 0, clock: Callable[[], int] = time.monotonic_ns) -> None:
        self.speed = speed
        self.slipped = False  # True once the speed could not be kept
        self._clock = clock
        self._slice_ns = TICK_NS
        self._behind = False
        self._anchor(virtual_ns)

    def _anchor(self, virtual_ns: int) -> None:
        self._wall_0 = self._clock()
        self._virtual_0 = virtual_ns

    def present_ns(self) -> int | None:
        """Virtual time that belongs to the present; None at speed `max`."""
        if self.speed is None:
            return None
        return self._virtual_0 + int((self._clock() - self._wall_0) * self.speed)

    def advance(self, twin: Clocked) -> None:
        """Let the twin catch up to the present, as far as a tick of computing gets it; at most to its next reply.

        So its replies leave in time, and the host is heard between two calls. At speed `max` there is no present: it
        runs until there is nothing more to do.
        """
        present = self.present_ns()
        if present is None:
            if not twin.idle and twin.next_event_ns is not None:
                self._compute(twin, sys.maxsize, lambda: twin.idle or twin.reply_waiting)
            return
        if twin.idle:  # nothing to compute: any stretch of time is cheap
            twin.run_until(present, lambda: twin.reply_waiting)
        else:
            self._compute(twin, present, lambda: twin.reply_waiting)
            if present - twin.time_ns > SLIP_NS * (self.speed or 1.0):
                self.slipped = True
                self._anchor(twin.time_ns)
        self._behind = twin.time_ns < present

    def _compute(self, twin: Clocked, until_ns: int, stop: Callable[[], bool] | None = None) -> None:
        """Advance at most to until_ns, in a slice whose length adapts so that it takes about a tick."""
        began, start_ns = self._clock(), twin.time_ns
        twin.run_until(max(start_ns, min(until_ns, start_ns + self._slice_ns)), stop)
        took_ns = self._clock() - began
        if took_ns > 2 * TICK_NS:
            self._slice_ns = max(self._slice_ns // 2, 100_000)
        elif took_ns < TICK_NS // 2 and twin.time_ns == start_ns + self._slice_ns:
            self._slice_ns *= 2

    def wait_s(self, twin: Clocked) -> float | None:
        """Wall seconds until the twin must be advanced again, if the host keeps still; None: not before it speaks."""
        event = twin.next_event_ns
        if self.speed is None:
            return None if twin.idle or event is None else 0.0
        if self._behind:
            return 0.0
        due_s = LONGEST_S if event is None else self.until_s(event)
        return min(due_s, LONGEST_S) if twin.idle else min(max(due_s, SHORTEST_S), TICK_NS / 1e9)

    def until_s(self, time_ns: int) -> float:
        """Wall seconds until virtual time reaches time_ns; 0 if that is past, or at speed `max`."""
        if self.speed is None:
            return 0.0
        wall_ns = self._wall_0 + (time_ns - self._virtual_0) / self.speed
        return max(0.0, (wall_ns - self._clock()) / 1e9)
