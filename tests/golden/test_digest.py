"""What a digest tells apart, and what it does not."""

from __future__ import annotations

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from golden.digest import digest, load, save, switches_full_steps

REPLIES = [(1000, b"0"), (2000, b"F")]
COUNTS = [3, -1, 0, 0]
PLACE_MM = [0.1, 0.2, 0.3]


def steps(t_ns: list[int], delta: list[list[int]], dtype: str = "i1") -> Any:
    return SimpleNamespace(t_ns=np.array(t_ns, dtype=np.int64), delta=np.array(delta, dtype=dtype).reshape(-1, 4))


STEPS = steps([100, 200, 300], [[1, -1, 0, 0], [1, 0, 0, 0], [1, 0, 0, 0]])
KNOWN = digest(REPLIES, STEPS, COUNTS, PLACE_MM)


@pytest.mark.parametrize(
    "other",
    [
        digest([(1000, b"0"), (2001, b"F")], STEPS, COUNTS, PLACE_MM),
        digest([(1000, b"0F")], STEPS, COUNTS, PLACE_MM),
        digest(REPLIES, steps([100, 200, 301], STEPS.delta.tolist()), COUNTS, PLACE_MM),
        digest(REPLIES, steps([100, 200, 300], [[1, 0, 0, 0], [1, -1, 0, 0], [1, 0, 0, 0]]), COUNTS, PLACE_MM),
        digest(REPLIES, STEPS, [3, -1, 0, 1], PLACE_MM),
        digest(REPLIES, STEPS, COUNTS, [0.1, 0.2, np.nextafter(0.3, 1)]),
        digest(REPLIES, STEPS, COUNTS, PLACE_MM, coarse=True),
    ],
    ids=["time of a reply", "replies apart", "time of a tick", "order of steps", "counter", "last bit", "coarse"],
)
def test_a_difference_shows(other: str) -> None:
    assert other != KNOWN


def test_widths_of_numbers_do_not_show() -> None:
    assert digest(REPLIES, steps([100, 200, 300], STEPS.delta.tolist(), "i4"), COUNTS, PLACE_MM) == KNOWN
    assert digest(REPLIES, STEPS, np.array(COUNTS, dtype="i2"), PLACE_MM) == KNOWN


def test_a_full_step_may_be_a_pair_or_one() -> None:
    pairs = steps([10, 11, 50, 51, 90], [[1, 1, 0, 0], [1, 1, 0, 0], [0, -1, 0, 0], [0, -1, 0, 0], [1, 0, 0, 0]])
    single = steps([10, 50, 91], [[2, 2, 0, 0], [0, -2, 0, 0], [1, 0, 0, 0]], "i4")
    assert digest([(60, b"\r")], pairs, COUNTS, None, coarse=True) == digest(
        [(61, b"\r")], single, COUNTS, None, coarse=True
    )
    assert digest([], pairs, COUNTS, None) != digest([], single, COUNTS, None)


def test_no_ticks() -> None:
    assert digest([], steps([], []), COUNTS, None, coarse=True) != digest([], STEPS, COUNTS, None, coarse=True)


@pytest.mark.parametrize(("sent", "full"), [(b"L1,x5\rF1\x01", True), (b"F 1\r", True), (b"F0\rL1,x5", False)])
def test_full_steps_are_recognised(sent: bytes, full: bool) -> None:
    assert switches_full_steps(sent) is full


def test_files_keep_names_with_blanks(tmp_path: Any) -> None:
    digests = {"b::test[x y]": "0" * 16, "a": "1" * 16}
    save(tmp_path / "golden.txt", digests)
    assert load(tmp_path / "golden.txt") == digests
    assert load(tmp_path / "none.txt") == {}
