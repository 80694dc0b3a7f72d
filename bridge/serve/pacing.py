"""Wall clock and virtual time: the only place of the project where a wall clock is read.

    virtual time = virtual_0 + speed * (wall time - wall_0)

At speed `max` there is no such relation: virtual time runs as fast as it can be computed while something is in
progress, and stops while all wait for the host. Even a slow host gets the same answers at the same virtual times. A
twin that cannot keep up with a finite speed slips: the relation starts again from the present.

The twin is advanced for about a tick of wall time, then hosts and signals are checked:

    wall time   |-- advance --|- look -|-- advance --|- look -|        5 ms each advance
    virtual     |==== slice ====|======= slice =======|====            slices so long that each takes about a tick
"""

from __future__ import annotations

import math
import sys
import time
from collections.abc import Callable
from typing import Protocol

TICK_NS = 5_000_000  # target wall time of one advance of a moving machine: 5 ms
SHORTEST_S = 0.001  # shortest sleep of a busy twin: bytes within it arrive together, as from a serial port's FIFO
LONGEST_S = 0.1  # longest sleep of an idle twin, short enough not to cause a slip with a recording
SLIP_NS = 250_000_000  # wall time that a twin may fall behind before it slips: 0.25 s
PATIENCE_NS = 20_000_000  # wall time that bytes of a host wait for the twin to catch up with the present: 20 ms
REPLY_NS = 1_000_000  # wall time of computing after which a reply is delivered first: 1 ms
STEADY_NS = 1_000_000_000  # wall time without a slip after which a twin counts as caught up: 1 s
SHORTEST_SLICE_NS = 100_000  # least virtual time to be computed at once: 0.1 ms

# A twin in motion announces an event every 10 ms: nothing moves before a later one, so that time costs next to nothing.
NEAR_NS = 10_000_000  # events within this virtual time are met in slices, later ones one by one

LOWEST_SPEED, HIGHEST_SPEED = 1e-6, 1e6  # wider than needed; a computer that is too slow slips


class Clocked(Protocol):
    """The twin, as needed by pacing."""

    @property
    def time_ns(self) -> int: ...
    @property
    def next_event_ns(self) -> int | None: ...
    @property
    def idle(self) -> bool: ...
    @property
    def reply_waiting(self) -> bool: ...
    def run_until(self, time_ns: int, stop: Callable[[], bool] | None = None) -> None: ...


class Onlooker(Protocol):
    """An observer that must not miss an event of the twin, however fast time runs."""

    def look_ns(self) -> int | None:
        """Latest virtual time of the next `look`; None: only when something has happened."""

    def look(self) -> bool:
        """Check the twin; True: stop computing, there is something to report."""


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
    """Keeps a twin in step with wall time. `speed`: times real time, or None for as fast as possible."""

    def __init__(
        self, speed: float | None, virtual_ns: int = 0, clock: Callable[[], int] = time.perf_counter_ns
    ) -> None:
        self.speed = speed
        self.behind = False  # the speed is not kept at present
        self.reached = 0.0  # times real time, from falling behind to the last slip
        self.slips = 0  # since falling behind
        self.onlookers: list[Onlooker] = []
        self._clock = clock
        self.hold_ns: int | None = None  # while paused: the virtual time of the stop, after all steps
        self._slices_ns = {False: TICK_NS, True: TICK_NS}
        self._late = False
        self._anchor(virtual_ns)
        self._even = self._wall_0, virtual_ns  # when the twin was at the present last
        self._fell = self._even  # when it fell behind
        self._slipped = self._even

    def _anchor(self, virtual_ns: int) -> None:
        self._wall_0 = self._clock()
        self._virtual_0 = virtual_ns

    @property
    def wall_s(self) -> float:
        """Wall time, from no particular instant."""
        return self._clock() / 1e9

    @property
    def paused(self) -> bool:
        """True if virtual time is stopped except for steps; the server goes on (bridge/7)."""
        return self.hold_ns is not None

    def pause(self, virtual_ns: int) -> None:
        """Stop virtual time at virtual_ns, the present; during a pause this aborts steps."""
        self.hold_ns = virtual_ns

    def step(self, step_ns: int) -> int:
        """Let step_ns of virtual time pass as fast as possible; return its end. Raises ValueError unless paused."""
        if self.hold_ns is None:
            raise ValueError("virtual time is not paused")
        self.hold_ns += step_ns
        return self.hold_ns

    def go_on(self, speed: float | None, virtual_ns: int, paused: bool = False) -> None:
        """Keep this speed from now, virtual_ns; if still paused, after the pause."""
        self.speed = speed
        if not paused:
            self.hold_ns = None
        self._anchor(virtual_ns)
        self._even = self._fell = self._slipped = self._wall_0, virtual_ns
        self.behind = self._late = False

    def present_ns(self) -> int | None:
        """Virtual time that belongs to the present; None at speed `max`."""
        if self.hold_ns is not None:
            return self.hold_ns
        if self.speed is None:
            return None
        return self._virtual_0 + int((self._clock() - self._wall_0) * self.speed)

    def advance(self, twin: Clocked) -> None:
        """Let the twin catch up to the present, for a tick of computing at most; to a reply if that takes long.

        At speed `max` there is no present: it runs to the next reply, or until there is nothing more to do.
        """
        present = self.present_ns()
        if present is None:
            if not twin.idle and twin.next_event_ns is not None:
                self._compute(twin, sys.maxsize, lambda: twin.idle or twin.reply_waiting)
            return
        began = self._clock()
        self._compute(twin, present, lambda: twin.reply_waiting and self._clock() - began >= REPLY_NS)
        if self.hold_ns is not None:
            return
        if present - twin.time_ns > SLIP_NS * (self.speed or 1.0):
            self._slip(twin)
        self._judge(twin, present)

    def catch_up(self, twin: Clocked, replies: Callable[[], None]) -> None:
        """Bring the twin to the present because a host has sent something; `replies` is called whenever some may have
        arrived. A twin that is too slow slips, so that the host's bytes need not wait (bridge/6).
        """
        present = self.present_ns()
        if present is None or self.paused:
            return
        began = self._clock()
        while not self.paused and twin.time_ns < present:
            if self._clock() - began > (0 if self.behind else PATIENCE_NS):
                self._slip(twin)
                return
            self.advance(twin)
            replies()

    def _compute(self, twin: Clocked, until_ns: int, stop: Callable[[], bool]) -> None:
        """Advance at most to until_ns, for about a tick of wall time, in slices whose length adapts to that."""
        end = self._clock() + TICK_NS
        onlookers, told = tuple(self.onlookers), False

        def over() -> bool:
            nonlocal told
            told = told or any([onlooker.look() for onlooker in onlookers])  # each of them, told or not
            return told or stop() or self._clock() >= end

        while twin.time_ns < until_ns and not over():
            began, start_ns, event = self._clock(), twin.time_ns, twin.next_event_ns
            near = event is not None and event <= start_ns + NEAR_NS
            slice_ns = self._slices_ns[near]
            aim_ns = min(until_ns, start_ns + slice_ns)
            if event is not None and not near:
                aim_ns = min(aim_ns, event)
            for onlooker in onlookers:
                if (look_ns := onlooker.look_ns()) is not None:
                    aim_ns = min(aim_ns, max(look_ns, start_ns))
            twin.run_until(aim_ns, over)
            took_ns = self._clock() - began
            if took_ns > TICK_NS:
                self._slices_ns[near] = max(slice_ns // 2, SHORTEST_SLICE_NS)
            elif took_ns < TICK_NS // 2 and twin.time_ns == start_ns + slice_ns:
                self._slices_ns[near] *= 2

    def _slip(self, twin: Clocked) -> None:
        """Make the twin's time the present."""
        self._anchor(twin.time_ns)
        self._slipped = self._wall_0, twin.time_ns
        if not self.behind:
            self.behind = True
            self._fell, self.slips = self._even, 0
        self.slips += 1
        self.reached = self._factor()
        self._even = self._slipped

    def _judge(self, twin: Clocked, present: int) -> None:
        self._late = twin.time_ns < present
        if self._late:
            return
        if self.behind and self._clock() - self._slipped[0] >= STEADY_NS:
            self.behind = False
        assert self.speed is not None
        self._even = self._wall_0 + round((present - self._virtual_0) / self.speed), twin.time_ns

    @property
    def behind_s(self) -> float:
        """Wall seconds over which `reached` was measured."""
        return (self._slipped[0] - self._fell[0]) / 1e9

    def _factor(self) -> float:
        wall_ns, virtual_ns = (slipped - fell for slipped, fell in zip(self._slipped, self._fell, strict=True))
        return virtual_ns / max(wall_ns, 1)

    def wait_s(self, twin: Clocked) -> float | None:
        """Wall seconds until the twin must be advanced again without the host; None: not before it sends something."""
        if self.hold_ns is not None:
            return 0.0 if twin.time_ns < self.hold_ns else None
        if self.speed is None:
            return None if twin.idle or twin.next_event_ns is None else 0.0
        if self._late:
            return 0.0
        event = twin.next_event_ns
        due_s = LONGEST_S if event is None else self.until_s(event)
        return min(due_s, LONGEST_S) if twin.idle else min(max(due_s, SHORTEST_S), TICK_NS / 1e9)

    def until_s(self, time_ns: int) -> float:
        """Wall seconds until virtual time reaches time_ns; 0 if past, or at speed `max`; inf if paused before it."""
        if self.hold_ns is not None:
            return 0.0 if time_ns <= self.hold_ns else math.inf
        if self.speed is None:
            return 0.0
        wall_ns = self._wall_0 + (time_ns - self._virtual_0) / self.speed
        return max(0.0, (wall_ns - self._clock()) / 1e9)
