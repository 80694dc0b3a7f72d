"""Replaces clocks, sleeps, locks and threads while a host runs in virtual time.

    time.sleep, time.time, ...        -->  Turns.wait, .look        for a thread of the host       clocks.py, locks.py
                                      -->  the real function              for any other thread, and for the twin
    asyncio.new_event_loop            -->  a loop in the turns of the host's threads            loops.py
    socket.socket, select.select, ... -->  sockets between the host's own threads               sockets.py, waiting.py
    os.fork, tkinter.Tk, ...          -->  the host ends with a reason                          refusals.py, windows.py

A stand-in checks at each call whether its thread is one of the host (`here`), so it is harmless in modules that have
imported it by name (`from time import sleep`). Names are replaced in all modules loaded when the host begins, except
those of the twin, and restored when it ends.
"""

from __future__ import annotations

import _thread
import atexit
import datetime
import signal
import sys
import threading
import time
from collections.abc import Callable, Sequence
from types import ModuleType
from typing import Any

from serial import serialutil

from isel_twin.bridge.virtual import clocks, locks, loops, refusals, sockets, waiting, windows
from isel_twin.bridge.virtual.cpython import calling_frame
from isel_twin.bridge.virtual.host_code import LIBRARIES
from isel_twin.bridge.virtual.stand_in import StandIn
from isel_twin.bridge.virtual.turns import Turns

_real_monotonic = time.monotonic
_real_signal, _real_getsignal = signal.signal, signal.getsignal
_real_register, _real_unregister = atexit.register, atexit.unregister
_ABSENT = object()  # marks an inherited attribute


def _signal(active: Turns, number: int, handler: Any, /) -> Any:
    before = _real_signal(number, active.signals.deferred(handler) if callable(handler) else handler)
    active.signals.handlers.setdefault(number, before)
    return getattr(before, "__wrapped__", before)


def _getsignal(_: Turns, number: int, /) -> Any:
    now = _real_getsignal(number)
    return getattr(now, "__wrapped__", now)


def _register(active: Turns, function: Callable[..., Any], *args: Any, **kwargs: Any) -> Any:
    frame = calling_frame(2)
    if frame.f_code.co_filename.startswith(LIBRARIES):
        return _real_register(function, *args, **kwargs)
    active.at_exit.append((function, args, kwargs))
    return function


def _unregister(active: Turns, function: Callable[..., Any]) -> None:
    active.at_exit[:] = [entry for entry in active.at_exit if entry[0] != function]
    _real_unregister(function)


_OWN: dict[Any, Callable[..., Any]] = {
    _real_signal: _signal,
    _real_getsignal: _getsignal,
    _real_register: _register,
    _real_unregister: _unregister,
}

# Packages that keep the real functions: the twin, and the import system.
_KEPT_MODULES = ("isel_twin", "_thread", "importlib", "_frozen_importlib", "_bootstrap")


def replace_all(active: Turns, more: Sequence[tuple[Any, Any]] = ()) -> Callable[[], None]:
    """Install the stand-ins and `more` pairs (real, stand-in); return a function that undoes it."""
    refused = [*refusals.methods(), *loops.methods()]  # imports the modules in which they are
    own = [(real, StandIn(real, virtual)) for real, virtual in _OWN.items()]
    rooms = (clocks, locks, loops, sockets, waiting, refusals)
    pairs = [*(pair for room in rooms for pair in room.stand_ins()), *own, *more]
    table = {id(real): (real, stand_in) for real, stand_in in pairs}
    undo: list[tuple[Any, str, Any]] = []
    finder = windows.Finder()

    def put(owner: Any, name: str, value: Any) -> None:
        undo.append((owner, name, vars(owner).get(name, _ABSENT)))
        setattr(owner, name, value)

    def put_back() -> None:
        """Undo all, whatever signal handlers raise meanwhile."""
        try:
            if finder in sys.meta_path:
                sys.meta_path.remove(finder)
            while undo:
                owner, name, value = undo[-1]
                if value is not _ABSENT:
                    setattr(owner, name, value)
                elif name in vars(owner):
                    delattr(owner, name)
                undo.pop()
        except BaseException:
            put_back()
            raise

    try:
        for module_name, module in list(sys.modules.items()):
            if not isinstance(module, ModuleType) or module_name.split(".")[0] in _KEPT_MODULES:
                continue
            for name, value in list(vars(module).items()):
                real, stand_in = table.get(id(value), (_ABSENT, None))
                if real is value:
                    put(module, name, stand_in)
        put(datetime, "datetime", clocks.VirtualDatetime)
        put(datetime, "date", clocks.VirtualDate)
        put(threading.Thread, "join", locks.join)
        put(threading.Thread, "is_alive", locks.is_alive)
        put(threading.Event, "is_set", locks.is_set)
        put(_thread, "start_new_thread", table[id(locks.REAL_START)][1])
        put(serialutil.Timeout, "TIME", table[id(_real_monotonic)][1])
        for owner, name, method in refused:
            put(owner, name, method)
        for module, name, replacement in list(windows.loaded()):
            put(module, name, replacement)
        sys.meta_path.insert(0, finder)
    except BaseException:  # a time limit of a test runner, for one
        put_back()
        raise
    return put_back
