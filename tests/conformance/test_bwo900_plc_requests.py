"""BWO 900: what the PLC asks of the channel (manual 8.5: P8706, P8710, P8711), and files of tables (2.8.4)."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import T1, file, fresh, mm, parameters, said, start, value
from conformance.rows import shows

from isel_twin.testing import Desk

LONG = "P1|N10 G1 F1200 X40|N20 Y10|N30 X0|N40 M30"
RESCUE = "P50|N10 G0 Z5|N20 G1 F600 X3|N30 M30"


# 8.5, P8706


@shows("bwo900-8.5-72")
def test_the_plc_releases_block_by_block() -> None:
    """0 holds before the next block, 1 lets it begin; each one ends with a standstill (bwo900/90)."""
    desk = fresh(LONG)
    desk.send(parameters(p8706=0))
    start(desk)
    desk.run(3.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    for place in ((40.0, 0.0, 0.0), (40.0, 10.0, 0.0), (0.0, 10.0, 0.0)):
        desk.send(parameters(p8706=1))
        desk.run(0.01)
        desk.send(parameters(p8706=0))
        desk.run(4.0)
        assert mm(desk) == place
        assert not desk.controller.idle
    desk.send(parameters(p8706=1))
    desk.finish()
    assert said(desk) == []


@shows("bwo900-8.5-72")
def test_deleted_it_releases() -> None:
    desk = fresh(LONG, p8706=0)
    desk.send(file("D", "K1:P 8706: --"))
    start(desk)
    desk.finish()
    assert mm(desk)[1] == 10.0


def test_abort_ends_the_wait_for_a_release() -> None:
    desk = fresh(LONG, p8706=0)
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8705=1))
    desk.finish()
    assert mm(desk) == (0.0, 0.0, 0.0)


# 8.5, P8710, P8711


@shows("bwo900-8.5-73")
@pytest.mark.parametrize("which", [0, 1])
def test_an_emergency_program_takes_the_place_of_the_running_one(which: int) -> None:
    """P8820 and P8822 are their programs, P8821 and P8823 the blocks; the mode stays AUTO, P8710 is 0 again."""
    desk = fresh(LONG, RESCUE, **{f"p{8820 + 2 * which}": 50, f"p{8821 + 2 * which}": 20})
    start(desk)
    desk.run(1.0)
    assert mm(desk)[0] > 5.0
    desk.send(parameters(**{f"p{8710 + which}": 1}))
    desk.finish()
    assert mm(desk) == (3.0, 0.0, 0.0), "from N20 on: Z stays"
    assert [value(desk, n) for n in (8_710 + which, 8_703, 8_802)] == [0.0, 2.0, 0.0]
    assert said(desk) == []


@shows("bwo900-8.5-73")
@pytest.mark.parametrize("mode", [1, 4, 8])
def test_it_is_called_in_any_mode(mode: int) -> None:
    desk = fresh(RESCUE, p8820=50)
    desk.send(parameters(p8683=mode))
    desk.send(parameters(p8710=1))
    desk.finish()
    assert mm(desk) == (3.0, 0.0, 5.0)
    assert value(desk, 8_688) == 2.0


@shows("bwo900-8.5-73")
def test_one_that_is_not_there_breaks_off() -> None:
    """M1310; the program that ran is broken off, and Start begins what P8800 says."""
    desk = fresh(LONG, p8820=77)
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8710=1))
    desk.finish()
    assert said(desk) == [1310]
    assert 0.0 < mm(desk)[0] < 40.0
    assert value(desk, 8_710) == 0.0
    desk.send(parameters(p8683=1, p8508=1))
    start(desk)
    desk.finish()
    assert mm(desk) == (0.0, 10.0, 0.0)


def test_without_reference_points_no_emergency_program() -> None:
    """M1008, as for any program; HAND takes the call back."""
    desk = fresh(RESCUE, LONG, referenced=False, p8820=50)
    desk.send(parameters(p8710=1))
    desk.finish()
    assert said(desk) == [1008]
    desk.send(parameters(p8683=1))
    assert value(desk, 8_710) == 0.0


# 2.8.4


def lines(desk: Desk, what: str) -> list[str]:
    before = len(desk.replies)
    desk.controller.press(desk.time_ns, "copy", what)  # type: ignore[attr-defined]
    desk.run(1.0)
    text = b"".join(data for _, data in desk.replies[before:]).decode("latin-1")
    return [line for line in text.replace("\x04", "").split("\r\n") if line]


@shows("bwo900-2.8.4-4")
@pytest.mark.parametrize(("what", "letter", "number"), [("tools", "W", 21_030), ("zero_points", "N", 20_005)])
def test_tables_are_put_out_and_read(what: str, letter: str, number: int) -> None:
    """What one control puts out another one takes, and nothing else is in it."""
    desk = fresh(**T1, p20005=30.5, p500=7)
    told = lines(desk, what)
    assert told[0] == letter
    assert told[-1] == "#"
    first = {"W": 21_000, "N": 20_000}[letter]
    numbers = [int(line.split(":")[1][2:]) for line in told[1:-1]]
    assert numbers == sorted(numbers)
    assert all(first <= one < first + 1000 for one in numbers)
    other = fresh()
    other.send(file(*told[:-1]))
    assert said(other) == []
    assert value(other, number) == value(desk, number)


@shows("bwo900-2.8.4-4")
@pytest.mark.parametrize(("letter", "number"), [("W", 20_005), ("N", 21_010), ("B", 500), ("W", 22_000)])
def test_what_is_not_of_the_table_is_refused(letter: str, number: int) -> None:
    desk = fresh()
    desk.send(file(letter, f"K1:P {number}: 5"))
    assert said(desk) == [1111]


def test_chapter_9_writes_b_for_zero_points() -> None:
    desk = fresh()
    desk.send(file("B", "K1:P 20005: 12.5"))
    assert value(desk, 20_005) == 12.5


# 7.1


@pytest.mark.parametrize("kind", [500, 599])
def test_tools_for_lathes_are_refused_in_words(kind: int) -> None:
    desk = fresh("P1|N10 T2 M16|N20 G0 X5|N30 M30", **T1, p21024=kind)
    start(desk)
    desk.finish()
    assert said(desk) == [1232]
    assert "not in this twin: tools for lathes" in " ".join(text for _, text in desk.remarks)
    assert mm(desk)[0] == 0.0


def test_other_kinds_of_tools_are_not() -> None:
    desk = fresh("P1|N10 T2 M16|N20 G0 X5|N30 M30", **T1, p21024=499)
    start(desk)
    desk.finish()
    assert said(desk) == []
