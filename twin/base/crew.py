"""Parallel work: in this process, on local processes or on a cluster, with the same results.

    items --- submit, a few ahead ---> crew: here | local processes | cluster | any concurrent.futures.Executor
                                         |
    (index, result) <-- as they come ----'        if a worker dies, what it was computing is computed again

An item's result depends on the item alone, and each item gives one result. A task is one item, on a cluster as many as
a worker does in TASK_S: each task costs caller, scheduler and worker some milliseconds (many/27).

Local workers
- are forked on Linux, from a server process that has imported everything and has no other Python thread; elsewhere each
  starts anew. A fork of this process could copy a lock that one of its threads holds.
- ignore Ctrl-C: a terminal sends it to all processes, and this one decides.
- end when this process is gone, even by SIGKILL: a thread of each waits for the end of a pipe that only this process
  holds open. (PR_SET_PDEATHSIG would report the death of the server, which lives as long as a worker does.)
- can be asked to give up: long work calls `given_up()` now and then.
"""

from __future__ import annotations

import functools
import importlib.metadata
import logging
import math
import multiprocessing
import os
import platform
import re
import signal
import sys
import threading
import time
from collections.abc import Callable, Generator, Iterator, MutableSequence, Sequence
from concurrent import futures
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import AbstractContextManager, ExitStack, closing, contextmanager, nullcontext, suppress
from dataclasses import dataclass
from itertools import chain, count
from typing import Any, TypeVar

from isel_twin.base.cluster import Shared, workers_of
from isel_twin.base.errors import CallError, one_line
from isel_twin.version import VERSION

Item = TypeVar("Item")
Result = TypeVar("Result")
Stop = Callable[[], bool]

log = logging.getLogger("isel_twin")

_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s/]+:\d+")

POLL_S = 0.1  # between two questions whether to stop, while waiting for results
TRIES = 3  # times in a row that all workers may die before any result has come
TASK_S = 1.0  # from which on a task for a cluster begins no further item
CALLS = 256  # calls of `finished` that can be told apart when one is given up


class GivenUp(BaseException):
    """Nobody waits for this result any more. A BaseException, so that handlers of Exception let it pass."""


class LostError(RuntimeError):
    """A result that has to come in order was lost: its workers died again and again."""


@dataclass(frozen=True)
class Lost:
    """In place of a result: all workers that tried the item have died."""

    why: str


class MismatchError(RuntimeError):
    """The computing process has other versions than the one that asks, or another machine of that name."""


@functools.cache
def versions() -> dict[str, str]:
    """What results depend on, in this process: a worker must have the same (many/21)."""
    found = {"Python": ".".join(platform.python_version_tuple()[:2]), "isel-twin": VERSION}
    return {**found, "mujoco": importlib.metadata.version("mujoco")}


class Crew:
    """Workers, started when first needed. They stay within `with crew:`, otherwise for one call of `finished`."""

    def __init__(
        self,
        begin: Callable[[], AbstractContextManager[Executor | None]],
        ahead: int = 1,
        flags: MutableSequence[int] | None = None,
        far: str = "",
    ) -> None:
        """begin: makes the executor, and another one after its workers have died; None: compute here. ahead: tasks
        submitted at a time, where the executor is not `Shared`. flags [CALLS]: shared with the workers; 1: that call of
        `finished` is given up. far: name of a crew whose workers may have other versions."""
        self._begin = begin
        self.ahead = ahead
        self.far = far
        self._flags = flags
        self._calls = count()
        self._users = 0
        self._open = ExitStack()
        self._begun: tuple[Executor | None] | tuple[()] = ()

    def __enter__(self) -> Crew:
        self._users += 1
        return self

    def __exit__(self, *_: object) -> None:
        self._users -= 1
        if not self._users:
            self._end()

    def _executor(self) -> Executor | None:
        if not self._begun:
            self._begun = (self._open.enter_context(self._begin()),)
        return self._begun[0]

    def _end(self) -> None:
        self._begun = ()
        if self._flags is not None:
            self._flags[:] = [1] * CALLS
        self._open.close()


def here(executor: Executor | None = None) -> Crew:
    """Work on an executor that is already open; None: in this process, one item after the other."""
    flags = bytearray(CALLS) if isinstance(executor, futures.ThreadPoolExecutor) else None
    return Crew(lambda: nullcontext(executor), 1 if executor is None else 1024, flags)


def local(number: int, preload: Sequence[str] = ()) -> Crew:
    """`number` processes of this computer. preload: modules that the first crew of this process imports, once for all
    workers, where processes can fork."""
    if number == 1:
        return here()
    with _shared_memory():
        flags: Any = multiprocessing.RawArray("b", CALLS)
    return Crew(lambda: _processes(number, preload, flags), 2 * number, flags)


def cluster(address: str) -> Crew:
    """All workers of a dask scheduler. Raises CallError for a wrong address or without the package distributed; the
    first use raises it if no scheduler answers."""
    if not _ADDRESS.fullmatch(address):
        raise CallError(f"cluster {address!r}: must be the address of a dask scheduler, tcp://HOST:PORT", option=True)
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise CallError("cluster needs distributed: pip install 'isel-twin[cluster]'", option=True) from None
    return Crew(lambda: workers_of(address), far=f"cluster {address}")


def finished(
    function: Callable[[Item], Result], items: Sequence[Item], crew: Crew, stop: Stop | None = None
) -> Generator[tuple[int, Result | Lost], None, None]:
    """Index and result of each item, in the order of completion. Closing the iterator gives up the rest.

    stop: called now and then; True ends the iteration. An exception of the function is raised here, unless it says that
    its worker is gone. Raises CallError if all workers die again and again, and for a worker of a cluster that has
    other `versions`: it may come at any time, so it is asked with each item.
    """
    to_do = list(range(len(items)))[::-1]
    slot = next(crew._calls) % CALLS
    pending: dict[Future[list[Result]], list[int]] = {}
    deaths, most = 0, 1
    with crew:
        try:
            while to_do or pending:
                if stop is not None and stop():
                    return
                executor = crew._executor()
                if executor is None:
                    index = to_do.pop()
                    with _asking(stop):
                        result = function(items[index])
                    yield index, result
                    continue
                broken = not _submit(executor, function, items, to_do, pending, crew, slot, most)
                for future in (
                    () if broken else futures.wait(pending, POLL_S if stop else None, futures.FIRST_COMPLETED).done
                ):
                    share = pending.pop(future)
                    try:
                        made = _result(future)
                    except BrokenExecutor:
                        to_do += share[::-1]
                        broken = True
                        continue
                    except Exception as error:
                        if crew.far and (why := _mismatch(error)):
                            raise CallError(f"{crew.far}: {why}") from error
                        raise
                    deaths = 0
                    if isinstance(made, Lost) and len(share) > 1:  # one of them is to blame: each by itself from now on
                        most, made = 0, []
                    elif isinstance(made, Lost):
                        made = [made]
                    else:
                        most = min(most, 1) * 2 * len(made)
                    to_do += share[len(made) :][::-1]
                    yield from zip(share, made, strict=False)
                if broken:
                    deaths += 1
                    if deaths == TRIES:
                        raise CallError(
                            f"processes died {TRIES} times in a row, by somebody or for want of memory; take fewer"
                        )
                    to_do = sorted([*to_do, *chain.from_iterable(pending.values())], reverse=True)
                    pending.clear()
                    crew._end()
        except GivenUp:
            return
        finally:
            for future in pending:
                with suppress(Exception):  # of a cluster that is gone
                    future.cancel()
            if pending and crew._flags is not None:
                crew._flags[slot] = 1


def in_order(
    function: Callable[[Item], Result], items: Sequence[Item], crew: Crew | None = None, stop: Stop | None = None
) -> Generator[Result, None, None]:
    """As `finished`, in the order of the items; crew None: here. Raises LostError for a result that was lost."""
    waiting: dict[int, Result] = {}
    upcoming = 0
    with closing(finished(function, items, crew or here(), stop)) as found:
        for index, result in found:
            if isinstance(result, Lost):
                raise LostError(result.why)
            waiting[index] = result
            while upcoming in waiting:
                yield waiting.pop(upcoming)
                upcoming += 1


def _submit(
    executor: Executor,
    function: Callable[[Item], Result],
    items: Sequence[Item],
    to_do: list[int],
    pending: dict[Future[list[Result]], list[int]],
    crew: Crew,
    slot: int,
    most: int,
) -> bool:
    """Fill the executor's queue; return False if it refused an item. most: items in a share."""
    work: Callable[..., list[Result]] = functools.partial(_share, function)
    if crew._flags is not None:
        crew._flags[slot] = 0
        shared = crew._flags if isinstance(crew._flags, bytearray) else None
        work = functools.partial(_work, work, shared, slot)
    elif crew.far:
        work = functools.partial(_alike, work, versions())
    try:
        ahead = 2 * executor.places if to_do and isinstance(executor, Shared) else crew.ahead
        while to_do and len(pending) < ahead:
            size = min(most, math.ceil(len(to_do) / ahead)) if isinstance(executor, Shared) else 1
            share = to_do[: -1 - max(1, size) : -1]
            pending[executor.submit(work, *(items[index] for index in share))] = share
            del to_do[-len(share) :]
    except BrokenExecutor:
        return False
    return True


def _result(future: Future[list[Result]]) -> list[Result | Lost] | Lost:
    try:
        return [*future.result()]
    except futures.CancelledError:
        return Lost("the cluster is gone")
    except Exception as error:
        if type(error).__name__ != "KilledWorker":  # distributed's, which need not be installed
            raise
        return Lost(one_line(str(error)))


def _mismatch(error: Exception) -> str:
    """Why a worker of a cluster is none for this caller; "" if the error is the function's own."""
    if isinstance(error, MismatchError):
        return str(error)
    if isinstance(error, ModuleNotFoundError | AttributeError) and "isel_twin" in str(error):
        return f"a worker has no isel-twin {VERSION} ({one_line(str(error))}): install it there"
    return ""


_asked = threading.local()
_flags: Sequence[int] = ()  # set in a local worker: the flags of its crew


def given_up() -> bool:
    """True if the caller has cancelled what this thread computes; no result may depend on it."""
    stop: Stop | None = getattr(_asked, "stop", None)
    return stop is not None and stop()


@contextmanager
def _asking(stop: Stop | None) -> Iterator[None]:
    """`given_up` calls `stop` within the block; None: what it called before."""
    before = getattr(_asked, "stop", None)
    _asked.stop = before if stop is None else stop
    try:
        yield
    finally:
        _asked.stop = before


def _share(function: Callable[[Item], Result], *items: Item) -> list[Result]:
    """Results of the first of these items, in a worker: of no further one after TASK_S, or from one on that raises an
    error, which is raised where it is the first."""
    began_s = time.monotonic()
    made: list[Result] = []
    for item in items:
        if made and time.monotonic() - began_s > TASK_S:
            break
        try:
            made.append(function(item))
        except Exception:
            if not made:
                raise
            break
    return made


def _work(function: Callable[..., list[Result]], shared: Sequence[int] | None, slot: int, *items: Any) -> list[Result]:
    """The function's result, in a worker. shared: flags, where workers are threads; None: use those of the process."""
    flags = _flags if shared is None else shared
    with _asking(lambda: bool(flags[slot])):
        return function(*items)


def _alike(function: Callable[..., list[Result]], asked: dict[str, str], *items: Any) -> list[Result]:
    """The function's result, in a worker of a cluster. Raises MismatchError if it is another worker than asked for."""
    here = versions()
    other = [f"{name} {here[name]} instead of {version}" for name, version in asked.items() if here[name] != version]
    if other:
        raise MismatchError(f"a worker on {platform.node()} has {', '.join(other)}: install the same there")
    return function(*items)


@contextmanager
def _processes(number: int, preload: Sequence[str], flags: Any) -> Iterator[Executor]:
    forks = sys.platform.startswith("linux")
    context = multiprocessing.get_context("forkserver" if forks else "spawn")
    with _shared_memory():
        executor = futures.ProcessPoolExecutor(number, mp_context=context, initializer=_serve, initargs=(flags,))
    with _without_ctrl_c():  # processes started in the block ignore it, and so do those that the server forks
        if forks:
            from multiprocessing import forkserver

            forkserver.set_forkserver_preload(["__main__", *preload])
            forkserver.ensure_running()
        else:
            for _ in range(number):
                executor.submit(int)
    try:
        yield executor
    finally:
        executor.shutdown(cancel_futures=True)


@contextmanager
def _shared_memory() -> Iterator[None]:
    """Say of locks and flags that cannot be made where they would be: the system's error names no file, or one of its
    own. Raises CallError."""
    try:
        yield
    except OSError as error:
        why = f"need shared memory, and /dev/shm cannot be used ({error.strerror}); mount it, or take one: --workers 1"
        raise CallError(f"several processes {why}") from error


@contextmanager
def _without_ctrl_c() -> Iterator[None]:
    if threading.current_thread() is not threading.main_thread():
        yield
        return
    before = signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        yield
    finally:
        signal.signal(signal.SIGINT, before)


def _serve(flags: Sequence[int]) -> None:
    global _flags
    _flags = flags
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    threading.Thread(target=_end_with_parent, name="parent", daemon=True).start()


def _end_with_parent() -> None:
    parent = multiprocessing.parent_process()
    if parent is not None:
        parent.join()
        os._exit(1)
