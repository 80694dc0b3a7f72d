"""The workers of a dask cluster as an executor for a crew (crew.py): a task is a share of the items, and a result
that is lost on the way is made once more."""

from __future__ import annotations

import functools
import logging
import math
import time
from collections.abc import Callable, Iterator
from concurrent import futures
from concurrent.futures import BrokenExecutor, Executor, Future
from contextlib import ExitStack, contextmanager, suppress
from typing import Any, TypeVar

from isel_twin.base.errors import CallError, one_line

Result = TypeVar("Result")

log = logging.getLogger("isel_twin")


class Shared(Executor):
    """An executor whose tasks are shares: several items each."""

    def __init__(self, executor: Executor, places: Callable[[], int], there: Callable[[], bool]) -> None:
        """places: how many tasks its workers do at a time; they may come and go, and it is asked once a second at most.
        there: False when nobody does them any more; then it is broken, and so it is if `places` raises an error."""
        self._executor, self._ask, self._there = executor, places, there
        self._places, self._asked_s = 0, -math.inf

    def submit(self, function: Callable[..., Any], /, *items: Any, **named: Any) -> Future[Any]:
        if not self._there():
            raise BrokenExecutor("the cluster is gone")
        return self._executor.submit(function, *items, **named)

    @property
    def places(self) -> int:
        """At least 1. Raises BrokenExecutor."""
        if (now_s := time.monotonic()) - self._asked_s > 1.0:
            try:
                self._places, self._asked_s = self._ask(), now_s
            except Exception as error:  # of any kind: connections break in many ways
                raise BrokenExecutor(one_line(str(error))) from error
        return max(1, self._places)


@contextmanager
def workers_of(address: str) -> Iterator[Executor]:
    """Those of the scheduler at this address, within the block. Raises CallError if none answers."""
    from distributed import Client

    with _silent("distributed"), ExitStack() as open_:
        try:
            client: Any = Client(address, timeout="10s", set_as_default=False)
        except (OSError, ValueError, TypeError) as error:
            why = one_line(str(error)) or type(error).__name__
            raise CallError(f"cluster {address}: {why}", option=True) from None
        open_.callback(client.close, timeout=5)
        if not client.ncores():
            log.warning("%s: the cluster has no workers yet", address)
        executor = _OfCluster(client)
        yield Shared(executor, lambda: sum(client.nthreads().values()), lambda: client.status == "running")


class _OfCluster(Executor):
    """In place of distributed's own executor, which takes a result for an error if the worker that has made it dies
    while it is handed over."""

    def __init__(self, client: Any) -> None:
        self._client = client

    def submit(self, function: Callable[..., Result], /, *arguments: Any, **named: Any) -> Future[Result]:
        mine: Future[Result] = Future()
        theirs = self._client.submit(function, *arguments, pure=False, **named)
        theirs.add_done_callback(functools.partial(_handed_over, mine))
        mine.add_done_callback(functools.partial(_given_up, theirs))
        return mine


def _given_up(theirs: Any, mine: Future[Any]) -> None:
    if mine.cancelled():
        with suppress(Exception):  # of a cluster that is gone
            theirs.cancel()


def _handed_over(mine: Future[Any], theirs: Any) -> None:
    with suppress(futures.InvalidStateError):  # nobody waits for it any more
        try:
            result = theirs.result()  # once more from another worker, if it was lost meanwhile
        except BaseException as error:
            if theirs.status != "cancelled":
                mine.set_exception(error)
            elif mine.cancel():
                mine.set_running_or_notify_cancel()
        else:
            mine.set_result(result)


@contextmanager
def _silent(package: str) -> Iterator[None]:
    """Silence a package's log of broken connections: the caller reports them in one line."""
    names = [name for name in logging.root.manager.loggerDict if name.split(".")[0] == package]
    before = {name: logging.getLogger(name).level for name in names}
    try:
        for name in names:
            logging.getLogger(name).setLevel(logging.CRITICAL)
        yield
    finally:
        for name, level in before.items():
            logging.getLogger(name).setLevel(level)
