"""What stands in for clocks, sleeps, locks and threads while a host runs in virtual time.

    time.sleep, time.time, ...        -->  Turns.wait, .look        for a thread of the host
                                      -->  the real function              for any other thread, and for the twin

A stand-in asks whose thread it is called in (`here`) at each call. So it may be left in a module that has imported it
by name (`from time import sleep`), and nobody else in the process is disturbed. Names are replaced in all modules that
are there when the host begins, except those of the twin, and put back when it ends; modules that the host imports find
them.

What would wait in real time, or leave the process, is refused: the host ends with one line that says what to do.
"""

from __future__ import annotations

import _thread
import atexit
import datetime
import importlib
import queue
import select
import signal
import sys
import threading
import time
import typing
import warnings
from collections.abc import Callable, Sequence
from types import FrameType, ModuleType
from typing import Any

from isel_twin.base.units import SECOND_NS
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import EPOCH_NS, LIBRARIES, UPTIME_NS, HostEnded, Turns, here, host_line

SERVE = "use `isel-twin serve --pty`, in real time"

_real_join = threading.Thread.join
_real_is_alive = threading.Thread.is_alive
_real_is_set = threading.Event.is_set


FOR_EVER_S = 1e9
"""A timeout from which on nobody means it: `threading.TIMEOUT_MAX` is taken by hosts that want to hear Ctrl-C."""


# Clocks


def _clock(real: Callable[[], Any], zero_ns: int, whole: bool) -> StandIn:
    def virtual(active: Turns) -> float | int:
        active.look()
        now_ns = zero_ns + active.now_ns
        return now_ns if whole else now_ns / SECOND_NS

    return StandIn(real, virtual)


_ZERO_NS = {"time": EPOCH_NS, "monotonic": UPTIME_NS, "perf_counter": UPTIME_NS, "process_time": 0, "thread_time": 0}


def _epoch_s(active: Turns) -> float:
    active.look()
    return (EPOCH_NS + active.now_ns) / SECOND_NS


def _sleep(active: Turns, seconds: float, /) -> None:
    if seconds != seconds:
        raise ValueError("Invalid value NaN (not a number)")
    if seconds < 0:
        raise ValueError("sleep length must be non-negative")
    if seconds == 0:
        active.look()
    else:
        active.wait(None, active.deadline(seconds), "sleep")


def _now_or(position: int, real: Callable[..., Any]) -> StandIn:
    """Functions of `time` that take the present time if an argument is left out."""

    def virtual(active: Turns, *args: Any) -> Any:
        if len(args) <= position or args[position] is None:
            present: Any = _epoch_s(active)
            if real.__name__ in ("strftime", "asctime"):
                present = time.localtime(present)
            args = (*args[:position], present)
        return real(*args)

    return StandIn(real, virtual)


def _clock_gettime(whole: bool) -> Callable[..., Any]:
    def virtual(active: Turns, clock: int) -> float | int:
        active.look()
        now_ns = active.now_ns + (EPOCH_NS if clock == time.CLOCK_REALTIME else UPTIME_NS)
        return now_ns if whole else now_ns / SECOND_NS

    return virtual


class _DateMeta(type):
    """Real dates are instances of what stands in for their class, too; a host's own subclasses are as ever."""

    def __instancecheck__(cls, value: object) -> bool:
        return isinstance(value, _REAL_DATES[cls]) if cls in _REAL_DATES else type.__instancecheck__(cls, value)

    def __subclasscheck__(cls, other: type) -> bool:
        return issubclass(other, _REAL_DATES[cls]) if cls in _REAL_DATES else type.__subclasscheck__(cls, other)


class _Date(datetime.date, metaclass=_DateMeta):
    @classmethod
    def today(cls) -> Any:
        active = here()
        return super().today() if active is None else cls.fromtimestamp(_epoch_s(active))

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}" if type(self) is _Date else super().__repr__()


class _Datetime(datetime.datetime, metaclass=_DateMeta):
    @classmethod
    def now(cls, tz: datetime.tzinfo | None = None) -> Any:
        active = here()
        return super().now(tz) if active is None else cls.fromtimestamp(_epoch_s(active), tz)

    @classmethod
    def utcnow(cls) -> Any:
        return cls.now(datetime.UTC).replace(tzinfo=None)

    @classmethod
    def today(cls) -> Any:
        return cls.now()

    def date(self) -> Any:
        return _Date(self.year, self.month, self.day)

    def __repr__(self) -> str:
        return f"datetime.{super().__repr__()}" if type(self) is _Datetime else super().__repr__()


_REAL_DATES: dict[type, type] = {_Date: datetime.date, _Datetime: datetime.datetime}
for _stand, _name in ((_Date, "date"), (_Datetime, "datetime")):
    _stand.__name__ = _stand.__qualname__ = _name
    _stand.__module__ = "datetime"


# Locks and threads


class VirtualLock:
    """`threading.Lock` of a host."""

    def __init__(self) -> None:
        self._held = False

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """See threading.Lock."""
        _check_timeout(blocking, timeout)
        active = here()
        if active is not None:
            active.free_look()
        if self._held and (not blocking or not _wait_for(lambda: not self._held, timeout, "Lock.acquire")):
            return False
        self._held = True
        return True

    def release(self) -> None:
        """See threading.Lock."""
        if not self._held:
            raise RuntimeError("release unlocked lock")
        self._held = False

    def locked(self) -> bool:
        """See threading.Lock."""
        return self._held

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    def _at_fork_reinit(self) -> None:
        self._held = False


class VirtualRLock:
    """`threading.RLock` of a host."""

    def __init__(self) -> None:
        self._owner: int | None = None
        self._count = 0

    def acquire(self, blocking: bool = True, timeout: float = -1) -> bool:
        """See threading.RLock."""
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
        """See threading.RLock."""
        if self._owner != _thread.get_ident():
            raise RuntimeError("cannot release un-acquired lock")
        self._count -= 1
        if not self._count:
            self._owner = None

    def __enter__(self) -> bool:
        return self.acquire()

    def __exit__(self, *_: object) -> None:
        self.release()

    # what threading.Condition wants of it

    def _recursion_count(self) -> int:
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
    return True  # the host is over, and so is whoever held it


_real_start = _thread.start_new_thread


def _start(real: Callable[..., Any]) -> StandIn:
    """`_thread.start_new_thread`, and its successor of Python 3.13, which takes keywords of its own."""

    def virtual(active: Turns, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
        arguments = args[0] if args else ()
        named = args[1] if len(args) > 1 else {}
        task = active.spawn(function)
        if real is _real_start:
            return real(active.body, (task, function, arguments, named))
        return real(lambda: active.body(task, function, arguments, named), **kwargs)

    return StandIn(real, virtual)


def _join(self: threading.Thread, timeout: float | None = None) -> None:
    active = here()
    task = None if active is None else active.task_of(self)
    if active is not None and task is not None and not task.ended and self is not threading.current_thread():
        if not active.wait(lambda: task.ended, active.deadline(timeout), f"join of {self.name}"):
            return
        timeout = None  # the interpreter has a moment's work left
    _real_join(self, timeout)


def _is_alive(self: threading.Thread) -> bool:
    active = here()
    task = None if active is None else active.task_of(self)
    if active is not None and task is not None:
        if task.ended:
            _real_join(self)
        else:
            active.free_look()
    return _real_is_alive(self)


def _is_set(self: threading.Event) -> bool:
    if (active := here()) is not None:
        active.free_look()
    return _real_is_set(self)


def _simple_queue(_: Turns) -> Any:
    return queue._PySimpleQueue()  # type: ignore[attr-defined]  # the same, on a semaphore of `threading`


# Waiting for files


def _select(active: Turns, r: Any, w: Any, x: Any, timeout: float | None = None, /) -> Any:
    from isel_twin.bridge.virtual.virtual_serial import VirtualSerial

    def port_of(item: Any) -> VirtualSerial | None:
        port = active.ports.open
        return port if port is not None and (item is port or item == port._fd) else None

    reading, writing, other = list(r), list(w), list(x)
    real = [item for item in (*reading, *writing, *other) if port_of(item) is None]

    def look() -> tuple[list[Any], list[Any], list[Any]]:
        files = [[item for item in items if port_of(item) is None] for items in (reading, writing, other)]
        found = _real_select(files[0], files[1], files[2], 0) if real else ([], [], [])
        come = [item for item in reading if port_of(item) is not None and active.inbox]
        free = [item for item in writing if port_of(item) is not None]
        return found[0] + come, found[1] + free, found[2]

    if timeout is None and real:
        refuse("select.select without timeout on something else than the port", SERVE)
    active.fetch()
    if timeout == 0:
        active.look()
    elif not any(look()):
        hears = any(port_of(item) is not None for item in reading)
        active.wait(lambda: hears and bool(active.inbox), active.deadline(timeout), "select", hears=hears)
    return look()


_real_select = select.select


# What cannot be done


def refuse(what: str, remedy: str) -> typing.NoReturn:
    """End the host, because virtual time cannot do what it wants."""
    active = here()
    if active is not None:
        where = host_line(sys._getframe(1))
        active.end("refused", f"{f'{where}: ' if where else ''}{what} cannot be had in virtual time: {remedy}")
    raise HostEnded(2)


def _called_by(*packages: str) -> str | None:
    """The first of these packages that has a function in the stack of calls."""
    frame: FrameType | None = sys._getframe(1)
    while frame is not None:
        package = str(frame.f_globals.get("__name__", "")).split(".")[0]
        if package in packages:
            return package
        frame = frame.f_back
    return None


def _refused(what: str) -> Callable[..., Any]:
    def virtual(_: Turns, *args: Any, **kwargs: Any) -> Any:
        by = _called_by("asyncio", "multiprocessing", "concurrent", "subprocess")
        told = {
            "asyncio": "asyncio, whose loop waits in real time,",
            "multiprocessing": "multiprocessing",
            "concurrent": "a pool of processes",
            "subprocess": "subprocess",
        }
        if by == "asyncio":
            warnings.filterwarnings("ignore", message="coroutine .* was never awaited")  # nor will it be
        refuse(told.get(by or "", what), SERVE)

    return virtual


_REFUSED: dict[str, tuple[str, ...]] = {
    "os": ("fork", "forkpty", "system", "posix_spawn", "posix_spawnp", "execv", "execve", "startfile"),
    "_posixsubprocess": ("fork_exec",),
    "_winapi": ("CreateProcess",),
    "select": ("poll", "epoll", "kqueue", "devpoll"),
    "signal": ("setitimer", "alarm", "pause", "sigwait", "sigwaitinfo", "sigtimedwait"),
    "_socket": ("socketpair",),
}
"""Functions that are refused, by the module in which they are at home."""

_REFUSED_METHODS: dict[tuple[str, str], tuple[str, ...]] = {
    ("socket", "socket"): ("connect", "connect_ex", "accept", "bind", "listen", "recv", "recvfrom", "sendto"),
    ("selectors", "_BaseSelectorImpl"): ("__init__",),
    ("asyncio.base_events", "BaseEventLoop"): ("__new__",),
}
"""Methods that are refused, by module and class."""

REFUSED_MODULES = frozenset({"_tkinter", "PyQt5", "PyQt6", "PySide2", "PySide6", "wx"})
"""Packages whose main loops wait in real time."""


class _Finder:
    """Refuses the import of REFUSED_MODULES by a host."""

    def find_spec(self, name: str, path: object = None, target: object = None) -> None:
        if name in REFUSED_MODULES | {"tkinter"} and here() is not None:
            refuse(f"{name.lstrip('_')}, whose main loop waits in real time,", SERVE)


# Where a host is


# All together


def _signal(active: Turns, number: int, handler: Any, /) -> Any:
    before = signal_function(number, active.deferred(handler) if callable(handler) else handler)
    active.handlers.setdefault(number, before)
    return getattr(before, "__wrapped__", before)


def _getsignal(_: Turns, number: int, /) -> Any:
    now = getsignal_function(number)
    return getattr(now, "__wrapped__", now)


signal_function = signal.signal
getsignal_function = signal.getsignal


def _register(active: Turns, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    frame = sys._getframe(2)
    if frame.f_code.co_filename.startswith(LIBRARIES):
        return _real_register(function, *args, **kwargs)
    active.at_exit.append((function, args, kwargs))
    return function


def _unregister(active: Turns, function: Callable[..., Any]) -> None:
    active.at_exit[:] = [entry for entry in active.at_exit if entry[0] != function]
    _real_unregister(function)


_real_register = atexit.register
_real_unregister = atexit.unregister


def _stand_ins() -> dict[int, tuple[Any, Any]]:
    """By id of what is real: it, and what stands in for it."""
    pairs: list[tuple[Any, Any]] = [(time.sleep, StandIn(time.sleep, _sleep))]
    for name, zero_ns in _ZERO_NS.items():
        for suffix in ("", "_ns"):
            if (real := getattr(time, name + suffix, None)) is not None:
                pairs.append((real, _clock(real, zero_ns, bool(suffix))))
    for name, position in (("localtime", 0), ("gmtime", 0), ("ctime", 0), ("asctime", 0), ("strftime", 1)):
        pairs.append((getattr(time, name), _now_or(position, getattr(time, name))))
    for name in ("clock_gettime", "clock_gettime_ns"):
        if (real := getattr(time, name, None)) is not None:
            pairs.append((real, StandIn(real, _clock_gettime(name.endswith("_ns")))))
    pairs.append((threading._allocate_lock, StandIn(threading._allocate_lock, lambda _: VirtualLock(), VirtualLock)))  # type: ignore[attr-defined]
    for name in ("_start_new_thread", "_start_joinable_thread"):
        if (real := getattr(threading, name, None)) is not None:
            pairs.append((real, _start(real)))
    pairs += [
        (threading.Lock, StandIn(threading.Lock, lambda _: VirtualLock(), VirtualLock)),
        (threading.RLock, StandIn(threading.RLock, lambda _: VirtualRLock(), VirtualLock)),
        (queue.SimpleQueue, StandIn(queue.SimpleQueue, _simple_queue)),
        (select.select, StandIn(select.select, _select)),
        (signal.signal, StandIn(signal.signal, _signal)),
        (signal.getsignal, StandIn(signal.getsignal, _getsignal)),
        (atexit.register, StandIn(atexit.register, _register)),
        (atexit.unregister, StandIn(atexit.unregister, _unregister)),
    ]
    for module, names in _REFUSED.items():
        for name in names:
            if (real := getattr(sys.modules.get(module), name, None)) is not None:
                pairs.append((real, StandIn(real, _refused(f"{module.lstrip('_')}.{name}"))))
    return {id(real): (real, stand_in) for real, stand_in in pairs}


_KEPT_MODULES = ("isel_twin", "_thread", "importlib", "_frozen_importlib", "_bootstrap")
"""Modules that keep the real functions, with all below them: the twin, and what imports modules."""


def replace_all(active: Turns, more: Sequence[tuple[Any, Any]] = ()) -> Callable[[], None]:
    """Put the stand-ins in place, and `more` pairs of what is real and what stands in; return what undoes it."""
    for module_name, _ in _REFUSED_METHODS:
        importlib.import_module(module_name)

    table = _stand_ins() | {id(real): (real, stand_in) for real, stand_in in more}
    undo: list[tuple[Any, str, Any]] = []

    def put(owner: Any, name: str, value: Any) -> None:
        undo.append((owner, name, vars(owner).get(name, _ABSENT)))
        setattr(owner, name, value)

    for module_name, module in list(sys.modules.items()):
        if not isinstance(module, ModuleType) or module_name.split(".")[0] in _KEPT_MODULES:
            continue
        for name, value in list(vars(module).items()):
            entry = table.get(id(value))
            if entry is not None and entry[0] is value:
                put(module, name, entry[1])
    put(datetime, "datetime", _Datetime)
    put(datetime, "date", _Date)
    for name, method in (("join", _join), ("is_alive", _is_alive)):
        put(threading.Thread, name, method)
    put(threading.Event, "is_set", _is_set)
    put(_thread, "start_new_thread", table[id(_real_start)][1])
    from serial import serialutil

    put(serialutil.Timeout, "TIME", table[id(_real_monotonic)][1])
    for (module_name, class_name), names in _REFUSED_METHODS.items():
        owner = getattr(sys.modules[module_name], class_name)
        for name in names:
            real = getattr(owner, name)
            put(owner, name, _method(real, f"{module_name}.{class_name}.{name}"))
    finder = _Finder()
    sys.meta_path.insert(0, finder)

    def put_back() -> None:
        sys.meta_path.remove(finder)
        for owner, name, value in reversed(undo):
            if value is _ABSENT:
                delattr(owner, name)
            else:
                setattr(owner, name, value)

    return put_back


_real_monotonic = time.monotonic
_ABSENT = object()
"""What a class does not have itself, but inherits."""


def _method(real: Callable[..., Any], what: str) -> Callable[..., Any]:
    virtual = _refused(what.removesuffix(".__init__"))

    def method(self: Any, *args: Any, **kwargs: Any) -> Any:
        active = here()
        if active is not None:
            virtual(active)
        return real(self) if real is object.__new__ else real(self, *args, **kwargs)

    return method
