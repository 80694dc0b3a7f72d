"""BWO 900: what the PLC decides about paths and tools (manual 7.1, 8.5, 8.7): M00, lengths, locks, changes in HAND."""

from __future__ import annotations

import math

import pytest
from conformance.bwo900_desk import T1, analysed, fresh, mm, parameters, run, said, start, value
from conformance.rows import shows

M06_AFTER = {"p11051": 0x01060201}
"""M04 before, M05 after, M06 after with halt (two seconds), M07 before."""


# 8.5, P8828


@shows("bwo900-8.5-74")
def test_m00_does_not_stop_unless_the_plc_asks() -> None:
    desk = run("P1|N10 G0 X5|N20 M00|N30 X8|N40 M30", p8828=1)
    assert (mm(desk)[0], value(desk, 8_687)) == (8.0, 0.0)


@shows("bwo900-8.5-74")
@pytest.mark.parametrize("stops", [True, False])
def test_a_stop_before_the_acknowledgement(stops: bool) -> None:
    """The PLC takes two seconds for M06, which is sent with M00."""
    desk = fresh("P1|N10 G0 X5 M00 M06|N30 X8|N40 M30", p8828=1, **M06_AFTER)
    start(desk)
    desk.run(2.0)
    assert value(desk, 8_559) == 1.0
    if stops:
        desk.send(parameters(p8704=0))
    desk.run(4.0)
    assert mm(desk)[0] == (5.0 if stops else 8.0)
    if stops:
        desk.send(parameters(p8704=1))
        desk.finish()
        assert mm(desk)[0] == 8.0


def test_without_it_m00_stops() -> None:
    desk = run("P1|N10 G0 X5 M00|N30 X8|N40 M30", p8828=2)
    assert mm(desk)[0] == 5.0


# 8.5, P8870, P8871


@shows("bwo900-8.5-75")
@pytest.mark.parametrize(
    ("mask", "mm_long"),
    [(0, 0.0), (1, 3.0 + 12.0), (2, 4.0 + 12.0), (3, 5.0 + 6.0 * math.pi), (4, 12.0), (7, 13.0 + 6.0 * math.pi)],
)
def test_length_of_paths(mask: int, mm_long: float) -> None:
    """A line 3, 4, 12 mm long and a full circle of 3 mm: 4 R along each axis of its plane, 2 pi R along both."""
    program = "P1|N10 G1 F6000 X3 Y4 Z12|N20 G2 X3 Y4 I6 J4|N30 M30"
    desk = run(program, p8870=mask)
    assert value(desk, 8_871) == pytest.approx(mm_long, abs=1e-3)


@shows("bwo900-8.5-75")
def test_lengths_add_up_until_the_mask_is_written() -> None:
    desk = run("P1|N10 G0 X5|N20 X0|N30 M30", p8870=1)
    start(desk)
    desk.finish()
    assert value(desk, 8_871) == pytest.approx(20.0)
    desk.send(parameters(p8870=1))
    assert value(desk, 8_871) == 0.0


def test_a_path_that_is_broken_off_has_no_length() -> None:
    desk = fresh("P1|N10 G1 F600 X5|N20 G1 X50|N30 M30", p8870=1)
    start(desk)
    desk.run(3.0)
    desk.send(parameters(p8705=1))
    desk.finish()
    assert value(desk, 8_871) == pytest.approx(5.0)


# 8.7, P12137


@shows("bwo900-8.7-23")
@pytest.mark.parametrize(("byte", "block", "waits"), [
    (1, "N20 X20", True), (256, "N20 X20", False), (1, "N20 X5", False), (256, "N20 X5", True), (1, "N20 Y5", False),
    (1, "N20 G2 F6000 X10 Y10 I5 J10", True),
])  # fmt: skip
def test_a_locked_direction_holds_a_block(byte: int, block: str, waits: bool) -> None:
    """X stands at 10 when the block comes; without the lock it is carried out."""
    desk = fresh(f"P1|N10 G0 X10 Y10|N15 M00|{block}|N30 M30")
    start(desk)
    desk.finish()
    desk.send(parameters(p12137=byte))
    desk.send(parameters(p8684=1))
    desk.run(4.0)
    assert (value(desk, 8_687) == 1.0) is waits
    assert (mm(desk) == (10.0, 10.0, 0.0)) is waits
    desk.send(parameters(p12137=0))
    desk.finish()
    assert (value(desk, 8_687), said(desk)) == (0.0, [])


@shows("bwo900-8.7-23")
def test_a_moving_axis_stops_with_its_ramp_and_goes_on() -> None:
    desk = fresh("P1|N10 G1 F1200 X40|N20 Y10|N30 M30")
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p12137=1))
    desk.run(1.0)
    held = mm(desk)
    desk.run(1.0)
    assert mm(desk) == held
    assert 10.0 < held[0] < 40.0
    desk.send(parameters(p12137=0))
    desk.finish()
    assert mm(desk) == (40.0, 10.0, 0.0)


@shows("bwo900-8.7-23")
def test_keys_do_not_move_an_axis_that_is_locked() -> None:
    desk = fresh(p8750=1, p8751=1, p8755=600, p12137=1)
    desk.send(parameters(p8752=1))
    desk.run(1.0)
    assert mm(desk)[0] == 0.0
    desk.send(parameters(p12137=0))
    desk.run(1.0)
    assert mm(desk)[0] > 5.0
    desk.send(parameters(p12137=1))
    desk.run(1.0)
    held = mm(desk)[0]
    desk.run(1.0)
    assert mm(desk)[0] == held
    desk.send(parameters(p8752=0))
    desk.send(parameters(p8752=2))
    desk.run(0.5)
    assert mm(desk)[0] < held


# 7.1, P8041 to P8044

Z6 = "Z6|N10 G0 Z5|N20 P8045:1|N30 M30"


@shows("bwo900-7.1-34")
def test_a_tool_is_changed_in_hand_by_z6() -> None:
    desk = fresh(Z6, **T1)
    desk.send(parameters(p8043=2))
    desk.finish()
    assert [value(desk, n) for n in (8_050, 8_060, 8_200, 8_100, 8_160)] == [2.0, 3.0, 2.0, 2.0, 3.0]
    assert (mm(desk)[2], value(desk, 8_688), said(desk)) == (5.0, 1.0, [])


@shows("bwo900-7.1-34")
def test_the_mode_is_auto_meanwhile() -> None:
    desk = fresh(Z6, **T1)
    desk.send(parameters(p8043=2))
    desk.run(0.2)
    assert (value(desk, 8_688), value(desk, 8_687)) == (2.0, 1.0)


@shows("bwo900-7.1-34")
def test_without_z6_the_plc_gets_m06() -> None:
    desk = fresh(**T1)
    desk.send(parameters(p8043=2))
    desk.run(1.0)
    assert not desk.controller.idle, "M06 takes two seconds"
    desk.finish()
    assert [value(desk, n) for n in (8_050, 8_200, 8_688)] == [2.0, 2.0, 1.0]


@shows("bwo900-7.1-34")
@pytest.mark.parametrize(("wrong", "number"), [
    ({"p8041": 1, "p8043": 2}, None), ({"p8043": 9}, 1050), ({"p8044": 2, "p8043": 2}, 1232),
    ({"p8683": 2, "p8043": 2}, 1321),
])  # fmt: skip
def test_what_is_not_changed(wrong: dict[str, float], number: int | None) -> None:
    desk = fresh(Z6, **T1, p8050=0)
    desk.send(parameters(**wrong))
    desk.finish()
    assert said(desk) == ([] if number is None else [number])
    assert (mm(desk)[2], value(desk, 8_050)) == (0.0, 0.0)


def test_t0_clears() -> None:
    desk = fresh(Z6, **T1)
    for group in (2, 0):
        desk.send(parameters(p8043=group))
        desk.finish()
    assert [value(desk, n) for n in (8_050, 8_060, 8_200)] == [0.0, 0.0, 0.0]


def test_no_reference_point_no_change() -> None:
    desk = fresh(Z6, referenced=False, **T1)
    desk.send(parameters(p8043=2))
    desk.finish()
    assert (said(desk), value(desk, 8_688)) == ([1008], 1.0)


def test_a_change_that_is_broken_off_stays_in_auto_with_its_message() -> None:
    desk = fresh("Z6|N10 G0 Z5|N20 Q9|N30 M30", "P1|N10 G0 X3|N20 M30", **T1)
    desk.send(parameters(p8043=2))
    desk.finish()
    assert (said(desk), value(desk, 8_688)) == ([1216], 2.0)
    start(desk)
    desk.finish()
    assert (mm(desk)[0], value(desk, 8_688)) == (3.0, 2.0), "the next program is no change of tools"


# 7.2, M16


@shows("bwo900-7.1-36")
@pytest.mark.parametrize(("definition", "sent"), [(0, []), (1, [16])])
def test_m16_for_the_plc(definition: int, sent: list[int]) -> None:
    """P11054 defines M16 in byte 1."""
    done = analysed("N10 T2 M16|N20 M30", p11054=definition, **T1)
    assert [function.code for block in done.blocks for function in block.pre] == sent


@shows("bwo900-7.1-37")
def test_records_of_other_channels_are_not_there() -> None:
    """P8042 and P8045 = 3 are kept, and change no record."""
    desk = fresh(**T1, p8050=2, p8100=0, p8150=0)
    desk.send(parameters(p8042=2, p8045=3))
    desk.finish()
    assert [value(desk, n) for n in (8_042, 8_045, 8_050, 8_100, 8_150)] == [2.0, 3.0, 2.0, 0.0, 0.0]
    assert said(desk) == []
