"""Work on whatever there is: every result once, whatever becomes of those who work."""

from __future__ import annotations

import math
import os
import platform
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from concurrent.futures import BrokenExecutor, Executor, Future, ThreadPoolExecutor
from contextlib import closing, contextmanager, nullcontext
from itertools import chain
from pathlib import Path
from typing import Any

import pytest

from isel_twin.base.cluster import Shared
from isel_twin.base.crew import (
    Crew,
    Lost,
    LostError,
    MismatchError,
    cluster,
    finished,
    given_up,
    here,
    in_order,
    local,
    versions,
)
from isel_twin.base.errors import CallError

ITEMS = [10, 11, 12, 13, 14]


class KilledWorker(Exception):
    """What a cluster says of a task whose workers have died."""


class Fake(Executor):
    """Does at once what is asked, or lets it go wrong: the outcome of an item by its number."""

    def __init__(self, wrong: dict[int, BaseException]) -> None:
        self.wrong = wrong
        self.made: list[int] = []
        self.tasks: list[list[int]] = []

    def submit(self, function: Callable[..., Any], /, *items: Any, **_: Any) -> Future[Any]:
        future: Future[Any] = Future()
        if (error := self.wrong.pop(items[0], None)) is None:
            self.made.extend(items)
            self.tasks.append(list(items))
            try:
                future.set_result(function(*items))
            except ArithmeticError as error:
                future.set_exception(error)
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


# Shares of a cluster --------------------------------------------------------------------------------------------------


def test_a_task_of_a_cluster_is_twice_what_the_last_one_did_and_at_most_a_part_of_what_is_left() -> None:
    """Two places: two tasks for each are on their way, so that what is left is divided by four."""
    fake = Fake({})
    items = list(range(100, 140))
    found = list(finished(double, items, Crew(lambda: nullcontext(Shared(fake, lambda: 2, there)))))
    assert sorted(found) == [(index, 2 * item) for index, item in enumerate(items)]
    assert list(chain.from_iterable(fake.tasks)) == items, "in order, each once"
    sizes = [len(task) for task in fake.tasks]
    assert sizes[:4] == [1, 1, 1, 1], "nothing is known of them yet"
    left = 40
    for size, before in zip(sizes, [1, *sizes], strict=False):
        assert size <= max(2 * before, 1)
        assert size <= math.ceil(left / 4)
        left -= size
    assert max(sizes) == 4


def test_what_a_worker_did_not_come_to_in_its_time_is_done_by_another_task(monkeypatch: pytest.MonkeyPatch) -> None:
    """Without any time it makes one item of each task."""
    monkeypatch.setattr("isel_twin.base.crew.TASK_S", -1.0)
    made: list[int] = []

    def function(item: int) -> int:
        made.append(item)
        return 2 * item

    found = list(finished(function, ITEMS * 4, Crew(lambda: nullcontext(Shared(Fake({}), lambda: 1, there)))))
    assert sorted(found) == [(index, 2 * item) for index, item in enumerate(ITEMS * 4)]
    assert sorted(made) == sorted(ITEMS * 4), "and nothing twice"


def test_one_item_of_a_task_that_kills_its_workers_is_lost_alone() -> None:
    """Tasks of several items that die are done again item by item; who dies alone is to blame."""

    class Poisoned(Fake):
        def submit(self, function: Callable[..., Any], /, *items: Any, **_: Any) -> Future[Any]:
            future = super().submit(function, *items)
            if 117 in items:
                future = Future()
                future.set_exception(KilledWorker("task died on 4 workers"))
            return future

    fake = Poisoned({})
    items = list(range(100, 140))
    found = list(finished(double, items, Crew(lambda: nullcontext(Shared(fake, lambda: 2, there)))))
    assert any(len(task) > 1 and 117 in task for task in fake.tasks), "it went in company"
    assert [117] in fake.tasks
    assert dict(found) == {
        k: 2 * item if item != 117 else Lost("task died on 4 workers") for k, item in enumerate(items)
    }
    assert len(found) == len(items)


def test_an_error_amid_a_task_comes_after_the_results_before_it() -> None:
    items = [*range(1, 21), 0, *range(22, 62)]
    found: list[tuple[int, float]] = []
    fake = Fake({})
    with pytest.raises(ZeroDivisionError):
        found.extend(finished(inverse, items, Crew(lambda: nullcontext(Shared(fake, lambda: 1, there)))))
    before = next(task for task in fake.tasks if 0 in task[1:])
    assert before[0] != 0
    assert {item - 1 for item in before[: before.index(0)]} <= {index for index, _ in found}
    assert any(task[0] == 0 for task in fake.tasks), "and it was asked for once more, by itself or at the head"


@pytest.mark.parametrize("noticed_by", ["its places", "its status"])
def test_a_scheduler_that_goes_and_comes_back_costs_what_was_on_its_way(noticed_by: str) -> None:
    """It goes after two tasks."""
    opened: list[int] = []
    fake = Fake({})

    def gone() -> bool:
        return len(opened) == 1 and len(fake.tasks) >= 2

    def places() -> int:
        if noticed_by == "its places" and gone():
            raise AttributeError("'NoneType' object has no attribute 'ncores'")
        return 1

    def status() -> bool:
        return noticed_by == "its places" or not gone()

    class Impatient(Shared):
        @property
        def places(self) -> int:
            self._asked_s = -math.inf  # asked each time
            return super().places

    found = list(finished(double, ITEMS, crew(Impatient(fake, places, status), opened)))
    assert sorted(found) == [(index, 2 * item) for index, item in enumerate(ITEMS)]
    assert len(opened) == 2


def there() -> bool:
    return True


def inverse(item: int) -> float:
    return 1.0 / item


@pytest.mark.parametrize(
    ("package", "there", "said"),
    [
        ("mujoco", "3.9.0", "mujoco 3.9.0 instead of {mujoco}"),
        ("Python", "3.99", "Python 3.99 instead of {Python}"),
        ("isel-twin", "0.9", "isel-twin 0.9 instead of {isel-twin}"),
    ],
)
def test_a_worker_of_a_cluster_with_other_versions_computes_nothing(
    package: str, there: str, said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It may join at any time: here before the third item."""
    asked = dict(versions())

    class Elsewhere(Fake):
        def submit(self, function: Callable[..., Any], /, *items: Any, **_: Any) -> Future[Any]:
            found = {**asked, package: there} if items[0] == 12 else asked
            future: Future[Any] = Future()
            with monkeypatch.context() as worker:
                worker.setattr("isel_twin.base.crew.versions", lambda: found)
                try:
                    future.set_result(function(*items))
                except MismatchError as error:
                    future.set_exception(error)
            return future

    remote = Crew(lambda: nullcontext(Elsewhere({})), 1, far="cluster tcp://a:1")
    made: list[tuple[int, Any]] = []
    with pytest.raises(CallError) as caught:
        made.extend(finished(double, ITEMS, remote))
    assert str(caught.value) == (
        f"cluster tcp://a:1: a worker on {platform.node()} has {said.format(**asked)}: install the same there"
    )


@pytest.mark.parametrize(
    "error",
    [
        ModuleNotFoundError("No module named 'isel_twin'"),
        AttributeError("Can't get attribute '_alike' on <module 'isel_twin.base.crew' from 'crew.py'>"),
    ],
)
def test_a_worker_of_a_cluster_without_the_package(error: Exception) -> None:
    remote = Crew(lambda: nullcontext(Fake({11: error})), 1, far="cluster tcp://a:1")
    with pytest.raises(CallError, match=r"cluster tcp://a:1: a worker has no isel-twin .*: install it there"):
        list(finished(double, ITEMS, remote))


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


# Processes of this computer -------------------------------------------------------------------------------------------


def test_results_in_order_whoever_was_first() -> None:
    assert list(in_order(double, ITEMS)) == [2 * item for item in ITEMS]
    assert list(in_order(pow_of_two, [200_000, 1, 2], local(2))) == [pow_of_two(n) for n in (200_000, 1, 2)]


def test_a_lost_result_is_an_error_where_all_must_come() -> None:
    fake = Fake({11: KilledWorker("task died on 4 workers")})
    with pytest.raises(LostError, match="task died on 4 workers"):
        list(in_order(double, ITEMS, crew(fake, [])))


def pow_of_two(exponent: int) -> int:
    return int(2**exponent)


def test_a_local_worker_that_is_killed_costs_no_result() -> None:
    """The first worker to get the item kills itself; who gets it next finds the mark and computes it."""
    with tempfile.TemporaryDirectory() as folder:
        marks = [str(Path(folder) / str(number)) for number in range(6)]
        assert list(in_order(die_once, marks, local(2))) == [True] * 6


def die_once(mark: str) -> bool:
    if mark.endswith("3") and not Path(mark).exists():
        Path(mark).touch()
        os.kill(os.getpid(), signal.SIGKILL)
    return True


def test_who_stops_reading_gives_up_what_is_computed() -> None:
    """Items that would take forever, but for one; threads and processes alike."""
    for others in (here(ThreadPoolExecutor(2)), local(2)):
        with others, closing(in_order(until_given_up, [False, True, True, True], others)) as found:
            assert next(found) == 0


def until_given_up(forever: bool) -> int:
    while forever and not given_up():
        time.sleep(0.01)
    return 0


ENDLESS = """
import os, sys, time
from isel_twin.base.crew import finished, local

def endless(item):
    os.write(1, b"%d\\n" % os.getpid())  # in one piece, as the other one writes, too
    while True:
        sum(range(1000))

if __name__ == "__main__":
    for _ in finished(endless, range(4), local(2)):
        pass
"""


@pytest.mark.skipif(sys.platform == "win32", reason="no SIGKILL")
def test_workers_end_when_their_parent_is_killed(tmp_path: Path) -> None:
    """By SIGKILL, amid work that never ends: no process of the crew, nor the server that forks them, stays."""
    (tmp_path / "endless.py").write_text(ENDLESS)
    words = [sys.executable, str(tmp_path / "endless.py")]
    with subprocess.Popen(words, stdout=subprocess.PIPE, text=True, start_new_session=True) as parent:
        assert parent.stdout is not None
        try:
            workers = [int(parent.stdout.readline()) for _ in range(2)]
        finally:
            parent.kill()
        assert len(set(workers)) == 2
        assert parent.stdout.read() == "", "ends when the last process that holds the pipe is gone"
    assert not any(alive(pid) for pid in workers)


def alive(pid: int) -> bool:
    """True unless the process is gone, or a zombie that nobody has collected."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    status = Path(f"/proc/{pid}/stat")
    return not status.exists() or status.read_text().rpartition(")")[2].split()[0] != "Z"
