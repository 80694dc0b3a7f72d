"""Work on whatever there is: here, on processes, on a cluster; every result once, whoever dies.

    items --- submit, a few ahead ---> crew: here | processes | cluster | any Executor
                                         |
    (index, result) <-- as they come ----'        a worker that dies costs what it was at, which is done again

A function of one item that depends on nothing else gives the same results in all of them. A result is taken once: what
has come is never asked for again, and what was on its way when a worker died is computed anew.
"""

from __future__ import annotations

import logging
import re
import signal
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, BrokenExecutor, CancelledError, Executor, Future, wait
from contextlib import AbstractContextManager, contextmanager, nullcontext
from dataclasses import dataclass
from typing import Any, TypeVar

from isel_twin.base.errors import CallError
from isel_twin.jobs.robust import giving_up, processes

Item = TypeVar("Item")
Result = TypeVar("Result")

log = logging.getLogger("isel_twin")

_ADDRESS = re.compile(r"(tcp|tls|ws|wss|ucx)://[^\s/]+:\d+")

POLL_S = 0.1
"""How often one that waits asks whether it should."""
TRIES = 3
"""How often in a row all processes may die before anything has come of it."""


@dataclass(frozen=True)
class Crew:
    """Who works."""

    open: Callable[[], AbstractContextManager[Executor | None]]
    """Their executor, begun; None: whoever asks does it himself. May be opened again after its processes have died."""
    ahead: int = 1
    """How many items they are given at a time."""


@dataclass(frozen=True)
class Lost:
    """In place of a result: whoever had the item died with it, again and again, or could not begin."""

    why: str


def here(executor: Executor | None = None) -> Crew:
    """Work with an executor that somebody else has opened; None: in this process, one by one."""
    return Crew(lambda: nullcontext(executor), 1 if executor is None else 1024)


def local(count: int) -> Crew:
    """So many processes of this computer."""
    return here() if count == 1 else Crew(lambda: _processes(count), 2 * count)


def cluster(address: str) -> Crew:
    """The workers of a dask scheduler, as many as there are. Raises CallError for no address, or without distributed.

    Whoever opens it is told by a CallError if the scheduler is not there.
    """
    if not _ADDRESS.fullmatch(address):
        raise CallError(f"cluster {address!r}: must be the address of a dask scheduler, tcp://HOST:PORT", option=True)
    try:
        import distributed  # noqa: F401
    except ImportError:
        raise CallError("cluster needs distributed: pip install 'isel-twin[cluster]'", option=True) from None
    return Crew(lambda: _dask(address), 256)


@contextmanager
def _processes(count: int) -> Iterator[Executor]:
    with processes(count) as executor:
        with _without_ctrl_c():  # the terminal sends it to all; the first decides
            for _ in range(count):
                executor.submit(int)
        yield executor


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


@contextmanager
def _dask(address: str) -> Iterator[Executor]:
    from distributed import Client

    with _silent("distributed"), _connected(Client, address) as client:
        if not client.ncores():
            log.warning("%s: the cluster has no workers yet", address)
        executor = client.get_executor(pure=False)
        yield executor
        executor.shutdown(wait=False)


@contextmanager
def _connected(kind: Any, address: str) -> Iterator[Any]:
    """A client of a scheduler."""
    try:
        client = kind(address, timeout="10s", set_as_default=False)
    except (OSError, ValueError, TypeError) as error:
        why = " ".join(str(error).split()) or type(error).__name__
        raise CallError(f"cluster {address}: {why}", option=True) from None
    try:
        yield client
    finally:
        client.close(timeout=5)


@contextmanager
def _silent(package: str) -> Iterator[None]:
    """What a package logs of connections that end is told in one line at the end."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == package]
    before = {name: logging.getLogger(name).level for name in names}
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)


def finished(
    function: Callable[[Item], Result], items: Sequence[Item], crew: Crew, stop: Callable[[], bool] | None = None
) -> Iterator[tuple[int, Result | Lost]]:
    """Index and result of each item, as they come; once each.

    stop: asked now and then; once it returns True nothing more comes. An exception of the function is raised, but for
    one that says that its worker is gone. Raises CallError if all processes die again and again.
    """
    to_do = list(range(len(items)))
    to_do.reverse()
    deaths = 0
    while to_do:
        with crew.open() as executor:
            if executor is None:
                with giving_up(stop):
                    while to_do and not (stop is not None and stop()):
                        index = to_do.pop()
                        yield index, function(items[index])
                return
            pending: dict[Future[Result], int] = {}
            broken = False
            while (to_do or pending) and not broken:
                if stop is not None and stop():
                    for future in pending:
                        future.cancel()
                    return
                while to_do and len(pending) < crew.ahead:
                    try:
                        future = executor.submit(function, items[to_do[-1]])
                    except BrokenExecutor:
                        broken = True
                        break
                    pending[future] = to_do.pop()
                for future in wait(pending, POLL_S if stop else None, FIRST_COMPLETED).done:
                    index = pending.pop(future)
                    try:
                        result: Result | Lost = future.result()
                    except BrokenExecutor:
                        to_do.append(index)
                        broken = True
                        continue
                    except CancelledError:
                        result = Lost("the cluster is gone")
                    except Exception as error:
                        if type(error).__name__ != "KilledWorker":  # distributed's, which need not be installed
                            raise
                        result = Lost(" ".join(str(error).split()))
                    deaths = 0
                    yield index, result
            to_do += pending.values()
        deaths += 1
        if to_do and deaths == TRIES:
            raise CallError(f"processes died {TRIES} times in a row, by somebody or for want of memory; take fewer")
