"""Work on whatever there is: every result once, whatever becomes of those who work."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import contextmanager
from typing import Any

import pytest

from isel_twin.base.crew import Crew, Lost, cluster, finished, given_up, here
from isel_twin.base.errors import CallError

ITEMS = [10, 11, 12, 13, 14]


class KilledWorker(Exception):
    """What a cluster says of a task whose workers have died."""


class Fake(Executor):
    """Does at once what is asked, or lets it go wrong: the outcome of an item by its number."""

    def __init__(self, wrong: dict[int, BaseException]) -> None:
        self.wrong = wrong
        self.made: list[int] = []

    def submit(self, function: Callable[..., Any], /, *items: Any, **_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if (error := self.wrong.pop(items[0], None)) is None:
            self.made.append(items[0])
            future.set_result(function(items[0]))
        elif isinstance(error, KeyError):
            future.cancel()
            future.set_running_or_notify_cancel()
        else:
            future.set_exception(error)
        return future


def double(item: int) -> int:
    return 2 * item


def crew(executor: Executor, opened: list[int], ahead: int = 2) -> Crew:
    @contextmanager
    def begin() -> Iterator[Executor]:
        opened.append(1)
        yield executor

    return Crew(begin, ahead)


def test_here_and_with_an_executor() -> None:
    expected = [(index, 2 * item) for index, item in enumerate(ITEMS)]
    assert list(finished(double, ITEMS, here())) == expected
    with ThreadPoolExecutor(2) as threads:
        assert sorted(finished(double, ITEMS, here(threads))) == expected
    assert list(finished(double, [], here())) == []


def test_what_was_on_its_way_when_all_died_is_done_again_and_nothing_else() -> None:
    opened: list[int] = []
    fake = Fake({12: BrokenExecutor("died")})
    found = list(finished(double, ITEMS, crew(fake, opened)))
    assert sorted(found) == [(index, 2 * item) for index, item in enumerate(ITEMS)]
    assert (sorted(fake.made), len(opened)) == (ITEMS, 2)


def test_those_who_die_again_and_again_are_not_waited_for() -> None:
    class Dying(Fake):
        def submit(self, function: Callable[..., Any], /, *items: Any, **_: Any) -> Future[Any]:
            raise BrokenExecutor("died")

    opened: list[int] = []
    with pytest.raises(CallError, match="processes died 3 times in a row"):
        list(finished(double, ITEMS, crew(Dying({}), opened)))
    assert len(opened) == 3


def test_an_item_that_kills_its_workers_is_lost_and_the_others_are_not() -> None:
    fake = Fake({11: KilledWorker("task died on 4 workers"), 13: KeyError()})
    found = dict(finished(double, ITEMS, crew(fake, [])))
    assert found == {0: 20, 1: Lost("task died on 4 workers"), 2: 24, 3: Lost("the cluster is gone"), 4: 28}


def test_an_error_of_the_function_is_raised() -> None:
    with pytest.raises(ZeroDivisionError):
        list(finished(lambda item: 1 // item, [0], here()))
    with ThreadPoolExecutor(1) as threads, pytest.raises(ZeroDivisionError):
        list(finished(lambda item: 1 // item, [0], here(threads)))


def test_a_stop_ends_it_and_is_told_to_what_is_computed_here() -> None:
    told: list[bool] = []

    def function(item: int) -> int:
        told.append(given_up())
        return item

    assert list(finished(function, ITEMS, here(), lambda: len(told) >= 2)) == [(0, 10), (1, 11)]
    assert told == [False, False]
    assert not given_up()
    assert list(finished(double, ITEMS, crew(Fake({}), []), lambda: True)) == []


@pytest.mark.parametrize("address", ["", "scheduler:8786", "tcp://scheduler", "tcp:// a:1"])
def test_what_is_no_address(address: str) -> None:
    with pytest.raises(CallError, match=r"must be the address of a dask scheduler, tcp://HOST:PORT"):
        cluster(address)
