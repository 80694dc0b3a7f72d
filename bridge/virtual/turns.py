"""Virtual time for a host program in this process: its threads take turns, and its waits use the twin's clock.

    thread of the host        blocks: sleep, Lock.acquire, Serial.read ...   --.
                                                                               v
    can another thread go on?   yes: it gets its turn          no: the twin runs on to the earliest deadline of
                                                                   any thread, or to the byte that one waits for

One thread of the host runs at a time, until it blocks or looks; deadlines and the order of waiting determine the next
one. So the same program makes the same calls at the same virtual times (bridge/16).

Waiting takes virtual time, computing does not. A look without waiting (at a clock, at the port, at something that
another thread may change) costs (bridge/17)

    min(max(LOOK_NS, spun / SPIN), LONGEST_LOOK_NS)

where `spun` is the cost of this thread's looks since it last waited: a loop that spins for a time T ends after about
SPIN (1 + ln(T / 10 ms)) looks, up to 100 s of T, and one more for each 10 ms beyond, with an error of at most T / SPIN,
SPIN = 10000. For occasional looks the cost is negligible.

This applies only to threads of the host: those inside a `Turns` and those that they start. Other threads of the process
(a test runner's) and the twin itself use the real functions.
"""

from __future__ import annotations

import _thread
import sys
import threading
import weakref
from collections import deque
from collections.abc import Callable, Mapping
from types import TracebackType
from typing import TYPE_CHECKING, Any, Self

from isel_twin.base.units import MILLISECOND_NS, SECOND_NS
from isel_twin.bridge.serve.borders import WireTap
from isel_twin.bridge.virtual.cpython import frames_of_threads, hear_uncaught, let_exit_without
from isel_twin.bridge.virtual.host_code import host_line
from isel_twin.bridge.virtual.host_thread import Ending, HostEnded, HostThread
from isel_twin.bridge.virtual.in_process import PATIENCE_NS, STRETCH_NS
from isel_twin.bridge.virtual.signals import Signals

if TYPE_CHECKING:
    from isel_twin.core.twin import Twin

LOOK_NS = 1_000  # virtual time of a look that does not wait: 1 us
LONGEST_LOOK_NS = 10 * MILLISECOND_NS  # and of one in a long row of them: 10 ms
# Number of looks in a row that cost LOOK_NS each; later each costs this fraction of the row. Also the number of free
# looks at locks and threads.
SPIN = 10_000

EPOCH_NS = 1_767_225_600 * SECOND_NS  # `time.time_ns()` at power-on: 2026-01-01 00:00 UTC (bridge/20)
UPTIME_NS = 1000 * SECOND_NS  # `time.monotonic_ns()` then: hosts may take 0 for "never"
STRIKES = 3  # times a thread may ignore the end of the host
GRACE_S = 2.0  # real time for a thread to end
LOOK_UP_S = 0.1  # real time for which the main thread does not hear a signal

_get_ident = _thread.get_ident


class Turns:
    """While this context is open, the thread in it and those it starts take turns in the virtual time of a twin.

    `VirtualTime` (virtual_time.py) installs it and explains the arguments. One at a time in a process: RuntimeError
    otherwise. At its end the remaining threads are ended: `HostEnded` is raised where they wait.
    """

    ports: Any  # `isel_twin.bridge.virtual.virtual_serial.Ports`
    network: Any  # `isel_twin.bridge.virtual.sockets.Network`

    def __init__(self, twin: Twin, wire: WireTap | None, limit_s: float | None) -> None:
        self.twin, self._wire, self._limit_s = twin, wire, limit_s
        self._lead_ns = 0  # time taken by looks that the twin has not yet run
        self.at_exit: list[tuple[Callable[..., Any], tuple[Any, ...], dict[str, Any]]] = []  # `atexit.register`
        self.signals = Signals(self._at_work)
        self.inbox = bytearray()  # bytes that have arrived and not been read
        self.ending: Ending | None = None  # set when the host cannot go on
        self.broken: BaseException | None = None  # an error in the twin itself
        self.left: list[str] = []  # threads that did not end
        self._limit_ns = self.deadline(limit_s)
        self.give_up: Callable[[], object] | None = None  # called if the main thread does not end; does not return
        self._main = self._running = HostThread("MainThread", daemon=False)
        self._waiting: deque[HostThread] = deque()
        self._tasks: weakref.WeakKeyDictionary[threading.Thread, HostThread] = weakref.WeakKeyDictionary()
        self._inside = self._exempt = False
        self._busy_ns = 0
        self._undo: Callable[[], None] | None = None

    def __enter__(self) -> Self:
        global _active
        if _active is not None:
            raise RuntimeError("there is a host in virtual time in this process already; one at a time")
        self._main.ident = _get_ident()
        self._main.name = threading.current_thread().name
        self._busy_ns = self.twin.time_ns
        try:
            self._undo = self._replace()
            self.signals.defer()
        except BaseException:  # of a signal handler
            self._as_before()
            raise
        _active = self
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, tb: TracebackType | None) -> None:
        self.over()
        try:
            self._catch_up()
            self._end_threads()
        finally:
            self._as_before()

    def over(self) -> None:
        """The host has ended: signals wait from here on, until all is as before."""
        self._inside = True

    def _as_before(self) -> None:
        global _active
        if self._undo is not None:
            self._undo()
        _active = None
        self.signals.restore()

    def _replace(self) -> Callable[[], None]:
        """Install stand-ins; return a function that removes them."""
        raise NotImplementedError

    # Time for the host

    @property
    def now_ns(self) -> int:
        """Virtual time since the twin was switched on."""
        return self.twin.time_ns + self._lead_ns

    def deadline(self, seconds: float | None) -> int | None:
        """Virtual time `seconds` from now; None stays None."""
        return None if seconds is None else self.now_ns + max(0, round(min(seconds, 1e9) * SECOND_NS))

    def look(self) -> None:
        """A look without waiting: takes a moment, in which others may have their turn."""
        task = self._running
        cost = min(max(LOOK_NS, task.spun_ns // SPIN), LONGEST_LOOK_NS)
        spun_ns = task.spun_ns + cost
        if self._waiting:
            self.wait(None, self.now_ns + cost, "look")
        else:
            self._check(task)
            self._lead_ns += cost
        task.spun_ns = spun_ns

    def free_look(self) -> None:
        """A look that costs nothing, unless there are very many in a row."""
        task = self._running
        task.free_looks += 1
        if task.free_looks > SPIN:
            self.look()
            task.free_looks = SPIN

    def wait(self, ready: Callable[[], bool] | None, deadline_ns: int | None, why: str, *, hears: bool = False) -> bool:
        """Block the host's calling thread until `ready` or the deadline; return whether it is ready.

        hears: a byte of the twin may meet the condition. Raises HostEnded, and whatever the host's signal handlers
        raise.
        """
        task = self._running
        while True:
            self._check(task)
            self._inside = True
            self._catch_up()
            self._busy_ns = self.twin.time_ns
            task.ready, task.deadline_ns, task.why, task.hears = ready, deadline_ns, why, hears
            task.spun_ns = task.free_looks = 0
            self._waiting.append(task)
            chosen = self._choose()
            if chosen is not task:
                self._hand_over(chosen)
                self._take_turn(task)
            self._inside = False
            self._check(task)
            if task is self._main:
                self.signals.deliver()
            if ready is not None and ready():
                return True
            if deadline_ns is not None and self.now_ns >= deadline_ns:
                return False
            # otherwise a signal was handled, and the wait goes on

    def _take_turn(self, task: HostThread) -> None:
        if task is not self._main:
            task.turn.acquire()
        else:  # looks up now and then: a signal to another thread, or just before it waits, does not wake it
            while not task.turn.acquire(timeout=LOOK_UP_S):
                pass

    def in_real_time(self, call: Callable[..., Any], *args: Any) -> Any:
        """Make a call of a library with the real functions, while virtual time stands still."""
        self._inside = True
        try:
            return call(*args)
        finally:
            self._go_on()

    def _go_on(self) -> None:
        """Back to the host's code, and to signals that have come meanwhile."""
        self._inside = False
        if self.signals and self._running is self._main:
            self.signals.deliver()

    def end(self, kind: str, reason: str) -> None:
        """End the host: HostEnded is raised in all its threads, in the calling one at its next wait."""
        if self.ending is None:
            self.ending = Ending(kind, reason)

    # Threads

    def start_thread(self, function: Callable[..., object], start: Callable[[HostThread], Any]) -> Any:
        """Put a new thread of the host last in the row and start it, both or neither, whatever signal comes.

        start: starts a thread that runs `body(task, ...)`; what it returns is returned.
        """
        thread = getattr(function, "__self__", None)
        if isinstance(thread, threading.Thread):
            task = self._tasks[thread] = HostThread(thread.name, daemon=thread.daemon)
            self._listen(thread)
        else:
            task = HostThread("a thread", daemon=True)
        task.deadline_ns = self.now_ns
        self._inside = True
        try:
            self._waiting.append(task)
            return start(task)
        except BaseException:
            self._waiting.remove(task)
            raise
        finally:
            self._go_on()

    def _listen(self, thread: threading.Thread) -> None:
        """Print nothing for HostEnded in a thread, and note uncaught exceptions."""

        def tell(report: Callable[[], None]) -> None:
            error = sys.exc_info()[1]
            if not isinstance(error, SystemExit):
                self.ports.notes.append(f"the thread {thread.name} has ended with {type(error).__name__}: {error}")
            if not isinstance(error, HostEnded):
                report()

        hear_uncaught(thread, tell)

    def body(
        self, task: HostThread, function: Callable[..., object], args: tuple[Any, ...], kwargs: Mapping[str, Any]
    ) -> None:
        task.ident = _get_ident()
        task.turn.acquire()
        self._inside = False
        try:
            if self.ending is None:
                function(*args, **kwargs)
        except HostEnded:
            pass
        finally:
            self._inside = True
            task.ended = True
            self._hand_over(self._main if self._exempt else self._choose())

    def task_of(self, thread: threading.Thread) -> HostThread | None:
        """None for a thread that the host has not started."""
        return self._tasks.get(thread)

    def wait_for_threads(self) -> None:
        """Wait for the end of all non-daemon threads, as an interpreter does at its end."""
        main = self._main
        self.wait(lambda: all(task.daemon or task is main for task in self._waiting), None, "the end of its threads")

    def _end_threads(self) -> None:
        """End all threads but the calling one, the main one; those that do not end are abandoned."""
        self.end("over", "the host is over")
        self._exempt = True
        while self._waiting:
            task = self._waiting.popleft()
            self._hand_over(task)
            if not self._main.turn.acquire(timeout=GRACE_S):
                task.strikes = STRIKES  # it computes, or waits in real time
                self._running = self._main
            self._inside = True
            if not task.ended:
                self._leave(task)

    def _leave(self, task: HostThread) -> None:
        """Let the process end without this thread."""
        self.left.append(task.name)
        for thread, its in self._tasks.items():
            if its is task:
                let_exit_without(thread)

    def places(self) -> str:
        """What each thread waits for, and where in the host's code, for the message about a deadlock."""
        frames = frames_of_threads()
        told = []
        for task in sorted(self._waiting, key=lambda task: (task is not self._main, task.name)):
            where = host_line(frames.get(task.ident or 0))
            told.append(f"{task.name} in {task.why}{f' ({where})' if where else ''}")
        return ", ".join(told)

    def _at_work(self) -> bool:
        """True while a signal must wait: time passes, or another thread has its turn."""
        return self._inside or self._running.ident != _get_ident()

    # The row

    def _check(self, task: HostThread) -> None:
        if self._limit_ns is not None and self.now_ns >= self._limit_ns:
            self.fetch()  # the twin runs on for the looks up to here
            self._end_late()
        if self.ending is None or (self._exempt and task is self._main):
            return
        if task is not self._main and task.strikes >= STRIKES:
            if not self._exempt:
                self._leave(task)
                self._inside = True
                self._hand_over(self._choose())
            else:
                self._hand_over(self._main)
            task.turn.acquire()  # for ever: it will not go
        if task is self._main and task.strikes >= STRIKES**4 and self.give_up is not None:
            self.give_up()
        task.strikes += 1
        raise HostEnded(1)

    def _end_late(self) -> None:
        self.end("timeout", f"the host has not ended within {self._limit_s:g} s of virtual time")

    def _catch_up(self) -> None:
        """Run the twin for the time taken by looks, not at each of them."""
        end_ns = self.now_ns
        while self.twin.time_ns < end_ns and not self.signals and self.ending is None:
            self._run_until(end_ns, self._wire is not None)
            self._fetch()
        self._lead_ns = max(0, end_ns - self.twin.time_ns)

    def _run_until(self, until_ns: int, hears: bool) -> None:
        """Let time pass, at most to the next signal and, with `hears`, to the next byte for the host."""
        twin = self.twin
        try:
            twin.run_until(until_ns, lambda: bool(self.signals) or (hears and twin.reply_waiting))
        except Exception as error:  # an error in the twin ends all threads and is reported
            self.broken = error
            self.end("broken", "the twin has broken")

    def _hand_over(self, task: HostThread) -> None:
        self._running = task
        task.turn.release()

    def _choose(self) -> HostThread:
        """Remove the next task from the row; let time pass until there is one."""
        while True:
            self._fetch()
            if (task := self._runnable()) is not None:
                self._waiting.remove(task)
                return task
            self._advance()

    def _runnable(self) -> HostThread | None:
        if self._main.ended:
            raise AssertionError("the main thread has ended")
        if self.ending is not None:
            return next((task for task in self._waiting if task is self._main), self._waiting[0])
        now_ns = self.now_ns
        best, best_ns = None, 0
        for task in self._waiting:
            if task is self._main and self.signals:
                return task
            if task.ready is not None and task.ready():
                since_ns = now_ns
            elif task.deadline_ns is not None and task.deadline_ns <= now_ns:
                since_ns = task.deadline_ns
            else:
                continue
            if best is None or since_ns < best_ns:
                best, best_ns = task, since_ns
        return best

    def _advance(self) -> None:
        """Let time pass to the earliest deadline, or until a byte or a signal comes; end the host if there is none."""
        twin = self.twin
        until_ns = min((task.deadline_ns for task in self._waiting if task.deadline_ns is not None), default=None)
        hears = any(task.hears for task in self._waiting)
        if until_ns is None:
            if not twin.idle:
                self._busy_ns = twin.time_ns
            if not hears or twin.next_event_ns is None or twin.time_ns - self._busy_ns >= PATIENCE_NS:
                self.end("deadlock", f"all threads wait for what cannot come: {self.places()}")
                return
            until_ns = twin.time_ns + STRETCH_NS
        if self._limit_ns is not None:
            if twin.time_ns >= self._limit_ns:
                self._end_late()
                return
            until_ns = min(until_ns, self._limit_ns)
        self._run_until(until_ns, hears or self._wire is not None)

    def _fetch(self) -> None:
        if self.twin.reply_waiting:
            data = self.twin.read()
            self.inbox += data
            self._busy_ns = self.twin.time_ns
            if self._wire is not None:
                self._wire.carry(self.twin.time_ns, data, False)

    # The line

    def fetch(self) -> bytearray:
        """Unread bytes that have arrived; a reader removes them."""
        self._inside = True
        try:
            self._catch_up()
            self._fetch()
        finally:
            self._go_on()
        return self.inbox

    def send(self, data: bytes) -> None:
        self._inside = True
        try:
            self._catch_up()
            self.twin.write(data)
            self._busy_ns = self.twin.time_ns
            if self._wire is not None:
                self._wire.carry(self.twin.time_ns, data, True)
        finally:
            self._go_on()


_active: Turns | None = None


def here() -> Turns | None:
    """The virtual time of the calling thread; None: real time."""
    active = _active
    if active is None or active._inside or active._running.ident != _get_ident():
        return None
    return active
