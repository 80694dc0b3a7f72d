"""What a block hands to a cycle of the user (manual 8.5: P8640, P8642, P9700 to P9799)."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import mm, run, said, value
from conformance.rows import shows

LIST = {"p8642": 100, "p100": 72, "p101": 75, "p102": 79, "p103": 0}
"""As printed: H, K, O."""


@shows("bwo900-5.5-5")
def test_words_of_the_list_are_handed_over() -> None:
    desk = run("P1|N10 G1001 H3 K-1.5|N20 M30", "Z1001|N10 P500:P9790 P501:P9791|N20 M30", **LIST)
    assert said(desk) == []
    assert (value(desk, 500), value(desk, 501)) == (3.0, -1.5)


@shows("bwo900-5.5-5")
def test_what_is_not_programmed_is_not_loaded() -> None:
    """M1300 of a parameter that is deleted."""
    desk = run("P1|N10 G1001 H3|N20 M30", "Z1001|N10 P500:P9792|N20 M30", **LIST)
    assert said(desk) == [1300]


@shows("bwo900-5.5-5")
def test_without_a_cycle_they_are_words_as_any_other() -> None:
    desk = run("P1|N10 H3|N20 M30", **LIST)
    assert said(desk) == [1216]


def test_other_words_of_the_block_are_done() -> None:
    """The axes move before the cycle begins."""
    desk = run("P1|N10 G0 X5 H2 G1001|N20 M30", "Z1001|N10 G91 G0 X:P9790|N20 G90 M30", **LIST)
    assert mm(desk) == (7.0, 0.0, 0.0)


@shows("bwo900-5.5-4")
@pytest.mark.parametrize(
    ("words", "number", "expected"),
    [
        ("X10 Y-20.5", 9_700, 10.0),
        ("X10 Y-20.5", 9_701, -20.5),
        ("I1 J2 K3 R4", 9_732, 1.0),
        ("I1 J2 K3 R4", 9_733, 2.0),
        ("I1 J2 K3 R4", 9_734, 3.0),
        ("I1 J2 K3 R4", 9_735, 4.0),
        ("T2", 9_736, 2.0),
        ("F500 f30", 9_738, 30.0),
        ("F500 f30", 9_739, 500.0),
        ("G2", 9_740, 1001.0),
        ("G2", 9_741, 2.0),
        ("G04.1.5", 9_748, 1.5),
        ("M7 M41.3.20", 9_750, 7.0),
        ("M7 M41.3.20", 9_753, 41.0),
        ("M7 M41.3.20", 9_754, 3.0),
        ("M7 M41.3.20", 9_755, 20.0),
        ("S700 S2:90", 9_780, 700.0),
        ("S700 S2:90", 9_781, 90.0),
    ],
)
def test_a_block_is_handed_over_and_not_done(words: str, number: int, expected: float) -> None:
    desk = run(f"P1|N10 G1001 {words}|N20 M30", f"Z1001|N10 P500:P{number}|N20 M30", p8640=1)
    assert said(desk) == []
    assert value(desk, 500) == expected
    assert mm(desk) == (0.0, 0.0, 0.0)


@shows("bwo900-5.5-4")
def test_a_block_without_a_cycle_is_done_as_ever() -> None:
    desk = run("P1|N10 G0 X10 Z10 M3 S500|N20 G81 Z9 P32:500 P33:5 P34:7|N30 M30", p8640=1)
    assert said(desk) == []
    assert mm(desk)[0] == 10.0


@shows("bwo900-5.5-6")
@pytest.mark.parametrize(("settings", "words", "number"), [(LIST, "H3", 9_790), ({"p8640": 1}, "X3", 9_700)])
def test_they_are_gone_when_the_cycle_has_returned(settings: dict[str, float], words: str, number: int) -> None:
    text = f"P1|N10 G1001 {words}|N20 P501:P{number}|N30 M30"
    assert said(run(text, "Z1001|N10 P500:1|N20 M30", **settings)) == [1300]
    start = f"P1|N10 P501:P{number}|N20 M30"
    assert said(run(start, **settings, **{f"p{number}": 8})) == [1300]
