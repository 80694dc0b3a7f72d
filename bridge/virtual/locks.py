"""Locks, threads, events and queues in virtual time."""

from __future__ import annotations

import _thread
import queue
import threading
from collections.abc import Callable
from typing import Any

from isel_twin.bridge.virtual import cpython
from isel_twin.bridge.virtual.host_thread import HostThread
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns, here

REAL_START: Callable[..., Any] = _thread.start_new_thread

FOR_EVER_S = 1e9  # longer timeouts mean no limit: some hosts use `threading.TIMEOUT_MAX` to stay open to Ctrl-C

_real_join, _real_is_alive = threading.Thread.join, threading.Thread.is_alive
_real_is_set = threading.Event.is_set


class VirtualLock:
    def __init__(self) -> None:
        self._held = False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        _check_timeout(blocking, timeout)
        active = here()
        if active is not None:
            active.free_look()
        if self._held and (not blocking or not _wait_for(lambda: not self._held, timeout, "Lock.acquire")):
            return False
        self._held = True
        return True

    def release(self) -> None:
        if not self._held:
            raise RuntimeError("release unlocked lock")
        self._held = False

    def locked(self) -> bool:
        return self._held

    __enter__ = acquire

    def __exit__(self, *_: object) -> None:
        self.release()

    def _at_fork_reinit(self) -> None:
        self._held = False


class VirtualRLock:
    def __init__(self) -> None:
        self._owner: int | None = None
        self._count = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        _check_timeout(blocking, timeout)
        me = _thread.get_ident()
        active = here()
        if active is not None:
            active.free_look()
        if self._owner not in (None, me) and (
            not blocking or not _wait_for(lambda: self._owner is None, timeout, "RLock.acquire")
        ):
            return False
        self._owner = me
        self._count += 1
        return True

    def release(self) -> None:
        if self._owner != _thread.get_ident():
            raise RuntimeError("cannot release un-acquired lock")
        self._count -= 1
        if not self._count:
            self._owner = None

    def locked(self) -> bool:  # from Python 3.14 on
        return self._owner is not None

    __enter__ = acquire

    def __exit__(self, *_: object) -> None:
        self.release()

    def _recursion_count(self) -> int:  # this and the next are needed by threading.Condition
        return self._count if self._owner == _thread.get_ident() else 0

    def _is_owned(self) -> bool:
        return self._owner == _thread.get_ident()

    def _release_save(self) -> tuple[int, int | None]:
        state, self._count, self._owner = (self._count, self._owner), 0, None
        return state

    def _acquire_restore(self, state: tuple[int, int | None]) -> None:
        self.acquire()
        self._count, self._owner = state

    def _at_fork_reinit(self) -> None:
        self._count, self._owner = 0, None


def _check_timeout(blocking: bool, timeout: float) -> None:
    if not blocking and timeout != -1:
        raise ValueError("can't specify a timeout for a non-blocking call")
    if timeout < 0 and timeout != -1:
        raise ValueError("timeout value must be a non-negative number")


def _wait_for(ready: Callable[[], bool], timeout: float, why: str) -> bool:
    active = here()
    if active is not None:
        return active.wait(ready, None if timeout == -1 or timeout >= FOR_EVER_S else active.deadline(timeout), why)
    return True  # the host has ended, and so has the owner


def _start(real: Callable[..., Any]) -> StandIn:
    """`_thread.start_new_thread`, and its successor of Python 3.13, which takes keywords of its own."""

    def virtual(active: Turns, function: Callable[..., Any], args: Any = (), kwargs: Any = None, /, **own: Any) -> Any:
        def start(task: HostThread) -> Any:
            return cpython.started(real, lambda: active.body(task, function, args, kwargs or {}), own)

        return active.start_thread(function, start)

    return StandIn(real, virtual)


def join(self: threading.Thread, timeout: float | None = None) -> None:
    active = here()
    task = None if active is None else active.task_of(self)
    if active is not None and task is not None and not task.ended and self is not threading.current_thread():
        if not active.wait(lambda: task.ended, active.deadline(timeout), f"join of {self.name}"):
            return
        timeout = None  # the interpreter needs a moment
    _real_join(self, timeout)


def is_alive(self: threading.Thread) -> bool:
    active = here()
    task = None if active is None else active.task_of(self)
    if active is not None and task is not None:
        if task.ended:
            _real_join(self)
        else:
            active.free_look()
    return _real_is_alive(self)


def is_set(self: threading.Event) -> bool:
    if (active := here()) is not None:
        active.free_look()
    return _real_is_set(self)


def stand_ins() -> list[tuple[Any, Any]]:
    return [
        (cpython.allocate_lock, StandIn(cpython.allocate_lock, lambda _: VirtualLock(), VirtualLock)),
        *((real, _start(real)) for real in dict.fromkeys((*cpython.thread_starters, REAL_START))),
        (threading.Lock, StandIn(threading.Lock, lambda _: VirtualLock(), VirtualLock)),
        (threading.RLock, StandIn(threading.RLock, lambda _: VirtualRLock(), VirtualLock)),
        (queue.SimpleQueue, StandIn(queue.SimpleQueue, lambda _: cpython.SimpleQueue())),
    ]
