"""All private parts of CPython that virtual threads use, checked at import.

Tried with Python 3.11 to 3.14. Imports nothing of the twin, so any interpreter can be asked alone:
`python cpython.py`. A missing name is an ImportError of one line.
"""

from __future__ import annotations

import importlib
import os
import queue
import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import Any

_STARTERS = ("_start_joinable_thread", "_start_new_thread")  # called by `Thread.start` from Python 3.13 on; before it

# Functions below `subprocess` that a host must not reach, by module.
PRIVATE_FUNCTIONS: dict[str, tuple[str, ...]] = {
    "_winapi" if os.name == "nt" else "_posixsubprocess": ("CreateProcess" if os.name == "nt" else "fork_exec",),
}

CONDITION_WANTS = ("_is_owned", "_release_save", "_acquire_restore")  # of an RLock, so a virtual one has them


def _check() -> None:
    places = [
        ("threading", "_allocate_lock"),
        ("threading.Thread", "_bootstrap"),
        ("queue", "_PySimpleQueue"),
        ("sys", "_getframe"),
        ("sys", "_current_frames"),
        ("concurrent.futures.thread", "_threads_queues"),
        ("concurrent.futures.thread", "_shutdown"),
        *((module, name) for module, names in PRIVATE_FUNCTIONS.items() for name in names),
    ]
    missing = [f"{module}.{name}" for module, name in places if not hasattr(_found(module), name)]
    if not any(hasattr(threading, name) for name in _STARTERS):
        missing.append(f"threading.{_STARTERS[0]}")
    thread = threading.Thread()
    if not hasattr(thread, "_invoke_excepthook"):
        missing.append("threading.Thread._invoke_excepthook")
    if not (hasattr(threading, "_shutdown_locks") or hasattr(threading, _STARTERS[0])):
        missing.append("threading._shutdown_locks")
    wanted = threading.Condition.__init__.__code__.co_names
    missing += [f"threading.RLock.{name}" for name in CONDITION_WANTS if name not in wanted]
    if missing:
        version = ".".join(map(str, sys.version_info[:2]))
        raise ImportError(
            f"virtual time needs {missing[0]}, which Python {version} does not have: use Python 3.11 to 3.14, "
            "or `isel-twin serve` in real time"
        )


def _found(place: str) -> Any:
    """A module, or a class in one; None if there is none."""
    module, _, name = place.rpartition(".")
    try:
        return importlib.import_module(place)
    except ImportError:
        return getattr(sys.modules.get(module), name, None)


_check()

calling_frame = sys._getframe  # the frame so many calls up
frames_of_threads = sys._current_frames  # the innermost frame of each thread, by its ident
allocate_lock: Callable[[], Any] = threading._allocate_lock  # type: ignore[attr-defined]

SimpleQueue: Callable[[], Any] = queue._PySimpleQueue  # type: ignore[attr-defined]  # on a semaphore of `threading`
thread_starters: tuple[Callable[..., Any], ...] = tuple(
    getattr(threading, name) for name in _STARTERS if hasattr(threading, name)
)


def hear_uncaught(thread: threading.Thread, tell: Callable[[Callable[[], None]], None]) -> None:
    """Call `tell(report)` when an exception ends a thread, in `sys.exc_info`; `report` prints it as usual."""
    usual = thread._invoke_excepthook  # type: ignore[attr-defined]
    thread._invoke_excepthook = lambda thread: tell(lambda: usual(thread))  # type: ignore[attr-defined]


def started(start: Callable[..., Any], run: Callable[[], None], options: dict[str, Any]) -> Any:
    """Start a thread by one of `thread_starters` or `_thread.start_new_thread`. options: its caller's keywords.

    Since Python 3.13 the interpreter waits at its end for threads that are not daemons; here the host's turns do that,
    and a thread that they have abandoned must not block.
    """
    return start(run, **(options | {"daemon": True})) if "daemon" in options else start(run, (), **options)


def let_exit_without(thread: threading.Thread) -> None:
    """Let the interpreter not wait for this thread at its end (from Python 3.13 on done by `started`)."""
    getattr(threading, "_shutdown_locks", set()).discard(getattr(thread, "_tstate_lock", None))


@contextmanager
def pools_told_to_end(ours: Callable[[threading.Thread], object]) -> Iterator[list[threading.Thread]]:
    """Tell our workers of thread pools (yielded) to end, as `concurrent.futures` does at exit. Other pools accept work
    again after the block.
    """
    pools: Any = sys.modules.get("concurrent.futures.thread")
    workers = [(thread, work) for thread, work in list(pools._threads_queues.items()) if ours(thread)]
    if not workers:
        yield []
        return
    pools._shutdown = True
    try:
        for _, work in workers:
            work.put(None)
        yield [thread for thread, _ in workers]
    finally:
        pools._shutdown = False
