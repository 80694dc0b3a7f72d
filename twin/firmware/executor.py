"""Carries out activities, one at a time, in virtual time; has the motion in execution and the counters.

Stopping, setting aside and resuming are implemented here once. The firmware decides what a limit switch, a fault or a
stop byte means, and calls one of these:

    park         stop ramp   the activity is set aside; `resume` goes on with it, `forget` closes it
    event        stop ramp   it goes on, with Ended(by_event=True)
    cut          at once     it goes on, with Ended(by_event=True)
    break_off    stop ramp   it is closed; the callback gets the reason
    abort        at once     it is closed; the callback gets the reason
    discard      at once     it is closed, and a parked one too; no callback

A motion has only one stop ramp. A call during the ramp changes what follows it: a park becomes a break-off, never the
other way; a cut ends the ramp at once.

Time is `now_ns`. The owner sets it, never backwards, never beyond `next_ns`, and calls `tick` when something is `due`.
So a motion ends when the time of its last tick has come *and* `tick` is called: an edge at that very time still meets
the motion, because its tick caused the edge. A stopped or cut motion ends the same way; if no tick is left, it is due
now.

`counts` is the value at the beginning of the present motion plus its ticks since.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

from isel_twin.firmware.activity import Activity, Ended, Listen, Pause, Request, Travel, Unfinished
from isel_twin.motion import Displacement, StepRun
from isel_twin.motion.path import added

# called at the end of an activity: with None if it returned, else with the reason
EndedBy = Callable[[Unfinished | None], None]


@dataclass(frozen=True)
class Parked:
    """An activity set aside: its request, and the result with which it will go on."""

    activity: Activity
    ended: EndedBy
    request: Request
    result: Ended | int | None


@dataclass(frozen=True)
class _Stopping:
    """What follows a stopped or cut motion; without `park` and `reason` the activity goes on."""

    by_event: bool = False
    park: Callable[[], None] | None = None
    reason: Unfinished | None = None


_GOES_ON = _Stopping()


class Executor:
    """Carries out one activity at a time."""

    def __init__(self, axes: int) -> None:
        self.now_ns = 0
        self.parked: Parked | None = None
        self.motion: StepRun | None = None
        """The motion in execution."""
        self.end_ns: int | None = None
        """When the motion or pause in execution ends; None if only an input can change anything."""
        self.request: Request | None = None
        """What the activity in progress waits for; None at rest."""
        self._base: Displacement = (0,) * axes
        self._activity: Activity | None = None
        self._ended: EndedBy | None = None
        self._stopping: _Stopping | None = None

    @property
    def counts(self) -> Displacement:
        """Counters of all axes now."""
        return self._base if self.motion is None else added(self._base, self.motion.displacement(self.now_ns))

    @property
    def purpose(self) -> object:
        """What the request is for, in the firmware's terms."""
        return None if self.request is None else self.request.purpose

    @property
    def busy(self) -> bool:
        """An activity is in progress; a parked one is not."""
        return self._activity is not None

    @property
    def stopping(self) -> bool:
        """The motion in execution has been stopped or cut."""
        return self._stopping is not None

    @property
    def next_ns(self) -> int | None:
        """When something is due; None if only an input can change anything."""
        return None if self.end_ns is None else max(self.end_ns, self.now_ns)

    @property
    def due(self) -> bool:
        return self.end_ns is not None and self.end_ns <= self.now_ns

    def set_counter(self, axis: int, value: int) -> None:
        """Set a counter without a tick; no motion is in execution."""
        assert self.motion is None
        self._base = (*self._base[:axis], value, *self._base[axis + 1 :])

    def start(self, activity: Activity, ended: EndedBy) -> None:
        """Begin an activity at once; none may be in progress. `ended` is called unless it is discarded or forgotten."""
        assert self._activity is None
        self._activity, self._ended = activity, ended
        self._go_on(None)

    def tick(self) -> bool:
        """End the motion or pause that is due, and go on up to the next request that takes time; False if none is."""
        if self.end_ns is None or self.end_ns > self.now_ns:
            return False
        if self.motion is None:
            self._go_on(None)
            return True
        stopping = self._stopping or _GOES_ON
        result = Ended(self._end_motion(), stopping.by_event)
        if stopping.reason is not None:
            self._finish(stopping.reason)
        elif stopping.park is not None:
            self._set_aside(result, stopping.park)
        else:
            self._go_on(result)
        return True

    def hear(self, byte: int) -> None:
        assert isinstance(self.request, Listen)
        self._go_on(byte)

    # ---- stopping ---------------------------------------------------------------------------------------------------

    def park(self, parked: Callable[[], None]) -> None:
        """Set the activity aside; `parked` is called when that is done, now or after the stop ramp. Does nothing at
        rest, or in a stop ramp that will end the activity.
        """
        if self.motion is not None:
            stopping = self._stop()
            if stopping.reason is None:
                self._stopping = replace(stopping, park=parked)
        elif self.end_ns is not None:
            self._set_aside(self.end_ns - self.now_ns, parked)
        elif self._activity is not None:
            self._set_aside(None, parked)

    def resume(self) -> None:
        """Go on with the parked activity; none is in progress."""
        assert self._activity is None
        assert self.parked is not None
        parked, self.parked = self.parked, None
        self._activity, self._ended = parked.activity, parked.ended
        self._go_on(parked.result)

    def forget(self) -> None:
        """Close the parked activity, if any, without a callback."""
        if self.parked is not None:
            self.parked.activity.close()
            self.parked = None

    def event(self) -> None:
        """The expected event has come: the motion ends with the stop ramp and the activity goes on. No effect on a
        motion that is already stopping.
        """
        if self.motion is not None:
            self._stopping = replace(self._stop(), by_event=True)

    def cut(self) -> None:
        """As `event` without a ramp: no more ticks. A parked motion counts as ended by it, too."""
        if self.motion is not None:
            self._make(self.motion.cut(self.now_ns))
            self._stopping = replace(self._stopping or _Stopping(), by_event=True)
        elif self.parked is not None and isinstance(self.parked.result, Ended):
            self.parked = replace(self.parked, result=self.parked.result._replace(by_event=True))

    def break_off(self, reason: Unfinished) -> None:
        """End the activity, after the stop ramp if a motion is in execution. The latest reason holds."""
        if self.motion is not None:
            self._stopping = replace(self._stop(), reason=reason)
        else:
            self.abort(reason)

    def abort(self, reason: Unfinished) -> None:
        """End the activity at once; no more ticks."""
        if self.motion is not None:
            self._end_motion()
        if self._activity is not None:
            self._finish(reason)

    def discard(self) -> None:
        """End everything at once, including the parked activity, without callbacks. Counters stay."""
        if self.motion is not None:
            self._end_motion()
        if self._activity is not None:
            self._release().close()
        self.forget()

    def _go_on(self, result: Ended | int | None) -> None:
        """Continue the activity with the result of its request, up to its next one that takes time."""
        while self._activity is not None:
            self.request = self.end_ns = self._stopping = None
            try:
                request = self._activity.send(result)
            except StopIteration:
                self._finish(None)
                return
            except Unfinished as reason:
                self._finish(reason)
                return
            self.request = request
            if isinstance(request, Pause):
                self.end_ns = self.now_ns + request.ns
            elif isinstance(request, Travel):
                if not request.law.ticks:
                    result = Ended(request.first)
                    continue
                self._make(StepRun(request.path, request.law, self.now_ns, request.first))
            return

    def _make(self, motion: StepRun) -> None:
        self.motion, self.end_ns = motion, motion.end_ns

    def _stop(self) -> _Stopping:
        """Begin the stop ramp of the motion, once; return what follows it."""
        assert self.motion is not None
        if self._stopping is None:
            self._make(self.motion.stopped(self.now_ns))
            self._stopping = _Stopping()
        return self._stopping

    def _end_motion(self) -> int:
        """End the motion; return the number of its last tick made."""
        assert self.motion is not None
        ticks = self.motion.count(self.now_ns)
        self._base = added(self._base, self.motion.displacement_after(ticks))
        self.motion = self.end_ns = None
        return ticks

    def _set_aside(self, result: Ended | int | None, parked: Callable[[], None]) -> None:
        assert self._ended is not None
        assert self.request is not None
        ended, request = self._ended, self.request
        self.parked = Parked(self._release(), ended, request, result)
        parked()

    def _finish(self, reason: Unfinished | None) -> None:
        assert self._ended is not None
        ended = self._ended
        self._release().close()
        ended(reason)

    def _release(self) -> Activity:
        """End the activity in progress without a callback; return it."""
        assert self._activity is not None
        activity = self._activity
        self._activity = self._ended = self.request = self.end_ns = self._stopping = None
        return activity
