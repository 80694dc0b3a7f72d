"""A call of C is checked against the prototype that the library carries, and what is wrong is told in one line."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from native.small import SMALL, small, sources

from isel_twin.native import Core, CoreError, address, library

__all__ = ["small", "sources"]

X, K = np.array([1.0, 2.0]), np.array([[10, 20], [30, 40]], np.int32)


def record(b: float) -> Any:
    return np.array([(0, b)], SMALL)


def refused(small: Core, *given: Any) -> str:
    with pytest.raises(TypeError) as caught:
        small.sum(*given)
    assert "\n" not in str(caught.value)
    return str(caught.value)


def test_arrays_and_numbers_arrive_and_come_back(small: Core) -> None:
    s = record(0.5)
    assert small.sum(X, K, s, 1000, 5000.0) == 1.0 + 2.0 + 10 + 20 + 30 + 40 + 0.5 + 1000 + 5000.0
    assert s["a"] == [1]
    y = np.zeros(2)
    assert small.twice(X, y) is None
    assert y.tolist() == [2.0, 4.0]


def test_an_array_may_be_empty(small: Core) -> None:
    assert small.sum(np.empty(0), np.empty((0, 2), np.int32), record(0.5), 0, 0.0) == 0.5


def test_what_c_only_reads_may_be_read_only(small: Core) -> None:
    x = X.copy()
    x.flags.writeable = False
    assert small.sum(x, K[:0], record(0.0), 0, 0.0) == 3.0
    with pytest.raises(TypeError, match=r"^twice: A1\(double, y, n\): got float64 \[2\], read only$"):
        small.twice(X, x)


def test_an_address_is_kept_by_the_caller(small: Core) -> None:
    x = np.array([7, 8])
    assert small.first(address(x)) == 7
    assert small.raw("twice")(address(X), 2, address(y := np.zeros(2)), 2) is None
    assert y.tolist() == [2.0, 4.0]


def test_a_wrong_number_of_arguments(small: Core) -> None:
    assert refused(small, X, K) == (
        "sum: takes 5 arguments, not 2: A1(const double, x), A2(const int32_t, k), R(SMALL, s), int64_t n, double y"
    )


@pytest.mark.parametrize(
    ("place", "value", "said"),
    [
        (0, np.array([1, 2]), "A1(const double, x): got int64 [2]"),
        (0, X.astype(np.float32), "A1(const double, x): got float32 [2]"),
        (0, X.reshape(1, 2), "A1(const double, x): got float64 [1, 2]"),
        (0, np.arange(4.0)[::2], "A1(const double, x): got float64 [2], not in one piece"),
        (0, [1.0, 2.0], "A1(const double, x): got a list, no array"),
        (0, None, "A1(const double, x): got a NoneType, no array"),
        (1, K.T, "A2(const int32_t, k): got int32 [2, 2], not in one piece"),
        (1, K[0], "A2(const int32_t, k): got int32 [2]"),
        (2, np.zeros(1), "R(SMALL, s): got float64 [1]"),
        (2, np.zeros(1, [("a", np.int64), ("c", np.float64)]), "R(SMALL, s): got a record [1]"),
        (2, record(0.0)[:0], "R(SMALL, s): got a record [0]"),
        (2, record(0.0)[0], "R(SMALL, s): got a void, no array"),
    ],
)
def test_a_wrong_array(small: Core, place: int, value: Any, said: str) -> None:
    given = [X, K, record(0.0), 1, 1.0]
    given[place] = value
    assert refused(small, *given) == f"sum: {said}"


@pytest.mark.parametrize(
    ("n", "ends", "table", "said"),
    [
        (2, 2, (4, 3), "A1(const double, ends, n + 1): got float64 [2], with n = 2"),
        (2, 4, (4, 3), "A1(const double, ends, n + 1): got float64 [4], with n = 2"),
        (2, 3, (5, 3), "A2(const double, table, 2 * n, 3): got float64 [5, 3], with n = 2"),
        (2, 3, (4, 4), "A2(const double, table, 2 * n, 3): got float64 [4, 4]"),
        (0, 0, (0, 3), "A1(const double, ends, n + 1): got float64 [0], with n = 0"),
    ],
)
def test_lengths_that_do_not_fit(small: Core, n: int, ends: int, table: tuple[int, int], said: str) -> None:
    with pytest.raises(TypeError) as caught:
        small.joined(np.zeros(n), np.zeros(ends), np.zeros(table))
    assert str(caught.value) == f"joined: {said}"


@pytest.mark.parametrize("n", [0, 1, 5])
def test_lengths_that_fit(small: Core, n: int) -> None:
    assert small.joined(np.zeros(n), np.zeros(n + 1), np.zeros((2 * n, 3))) == n


def test_a_number_that_is_none(small: Core) -> None:
    with pytest.raises(Exception, match="argument"):
        small.sum(X, K, record(0.0), 1.5, 1.0)


def test_a_record_that_python_lays_out_otherwise(small: Core, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(library.RECORDS, "SMALL", np.dtype([("b", np.float64), ("a", np.int64)]))
    with pytest.raises(CoreError, match=r"SMALL is another record here; build it: `python -m") as caught:
        small.sum  # noqa: B018
    assert "\n" not in str(caught.value)


def test_a_record_that_nobody_has_made(small: Core) -> None:
    with pytest.raises(CoreError, match=r"^foreign: R\(UNKNOWN, u\): no record here has that name"):
        small.foreign  # noqa: B018


def test_a_function_that_is_not_there(small: Core) -> None:
    with pytest.raises(CoreError, match="has no function third; build it"):
        small.third  # noqa: B018
