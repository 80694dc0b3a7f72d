"""BWO 900, chapter 6 and the definition of M functions (8.3 q158, 8.5 P8250, 8.6 P11050), sentence by sentence."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import (
    CARRIAGE,
    REFERENCE,
    analysed,
    file,
    fresh,
    mm,
    parameters,
    put_out,
    run,
    said,
    seconds,
    start,
    value,
)
from conformance.rows import case, shows

from isel_twin.firmware.bwo900.geometry.blocks import Stop
from isel_twin.firmware.bwo900.messages import ProgramError
from isel_twin.testing import Desk

DEAF = "OB 1\nBE\n"
"""A PLC that acknowledges nothing."""
BY_KEY = "OB 1\nU E 0.5\nR M 32.0\nBE\n"
"""One that acknowledges while the key (E 0.5) is on setup."""
M41_JUMPS = float(0x10 << 8)
"""P11060: M41 with a jump."""
M50_BEFORE, M50_BEFORE_HALT, M50_AFTER_HALT = (float(bits << 16) for bits in (0x01, 0x05, 0x06))
"""P11062."""


def with_plc(plc: str, *programs: str, **before: float) -> Desk:
    """A referenced control with that program of the PLC."""
    desk = Desk.of("bwo900", carriage=CARRIAGE, settings={"plc_program": plc})
    for text in programs:
        desk.send(file(*text.split("|")))
    if before:
        desk.send(parameters(**before))
    desk.send(REFERENCE)
    desk.finish()
    return desk


# 6.1


@shows("bwo900-6.1-22")
def test_m02_returns_behind_its_block_without_a_stop() -> None:
    program = "P1|N10 G1 F3000 X10 M28.2|N20 X30|N30 M30|P2|N10 X20 M02|N20 X99 M02"
    done = analysed(program)
    assert [point[0] for point in done.points] == [10.0, 20.0, 30.0]
    assert [block.stop for block in done.path] == [Stop.NONE] * 3
    assert {block.end.name for block in done.path} == {"CONTINUOUS"}


@pytest.mark.parametrize(
    ("word", "program"),
    [
        case("bwo900-6.1-23", "M23.30", "N10 P1:1|N20 P1=1.50 {}|N30 P2:1 M30|N50 P3:1|N60 M30"),
        case("bwo900-6.1-23", "M28.2", "N10 P1:1|N20 P1=1.50 {}|N30 P2:1 M30|N50 P3:1|N60 M30"),
        case("bwo900-6.1-23", "M30", "N10 P1:1|N20 P1=1.50 {}|N30 P2:1 M30|N50 P3:1|N60 M30"),
        case("bwo900-6.1-23", "M29", "N10 P1:1|N20 P1=1.50 {}|N30 P2:1 M30|N50 P3:1|N60 M30"),
        case("bwo900-6.1-23", "M02", "N10 P1:1|N20 P1=1.50 {}|N30 P2:1 M30|N50 P3:1|N60 M30"),
        case("bwo900-6.1-23", "M25", "N5 P1:0|N10 M24.5|N20 P1:P1+1|N30 P1=1.50 {}|N40 P2:1 M30|N50 P3:1|N60 M30"),
    ],
)
def test_jumps_by_comparison_come_first(word: str, program: str) -> None:
    """Functions that control the program are not carried out where a jump by comparison is taken."""
    done = analysed(f"P1|{program.format(word)}|P2|N10 P2:1 M02")
    assert done.parameters.get(1) == 1.0
    assert not done.parameters.loaded(2)
    assert done.parameters.loaded(3)


@shows("bwo900-6.1-24")
def test_the_blocks_of_a_loop() -> None:
    """The one with M24 is executed once, that with M25 in each pass; then comes the one behind it."""
    done = analysed("N5 G91|N10 G0 X1 M24.03|N20 Y1|N30 Z1 M25|N40 X5|N50 M30")
    assert done.points[-1] == (6.0, 3.0, 3.0)
    assert len(done.points) == 1 + 2 * 3 + 1


@shows("bwo900-6.1-25")
def test_m30_waits_for_the_path_of_its_block() -> None:
    desk = fresh("P1|N10 G1 F3000 X50 M30")
    start(desk)
    desk.run(0.5)
    assert 0.0 < mm(desk)[0] < 50.0
    assert value(desk, 8687) == 1.0
    desk.finish()
    assert mm(desk)[0] == 50.0
    assert (value(desk, 8687), value(desk, 8685)) == (0.0, 0.0)


@shows("bwo900-6.1-12")
def test_the_printed_call() -> None:
    done = analysed("P1|N10 P1:1 M28.300|N20 P3:P1+P2 M30|P300|N10 P2:10|N20 M02")
    assert done.parameters.get(3) == 11.0


# 6.2


@shows("bwo900-6.2-10")
def test_functions_without_halt_do_not_stop_the_path() -> None:
    text = "P1|N10 G1 F3000 X20|N20 X40 {}|N30 X60|N40 M30"
    plain = seconds(text.format(""))
    assert seconds(text.format("M50"), p11062=M50_BEFORE) == plain
    assert seconds(text.format("M50"), p11062=float(0x02 << 16)) == plain
    assert seconds(text.format("M50"), p11062=M50_BEFORE_HALT) > plain + 0.05


@shows("bwo900-6.2-11", "bwo900-6.2-4")
@pytest.mark.parametrize(("bits", "place"), [(M50_BEFORE_HALT, 20.0), (M50_AFTER_HALT, 40.0)], ids=["before", "after"])
def test_a_function_with_halt_waits_while_analysis_goes_on(bits: float, place: float) -> None:
    """The axes reach their target; blocks behind are analysed; acknowledged, the program goes on."""
    desk = with_plc(BY_KEY, "P1|N10 G1 F3000 X20|N20 X40 M50|N30 X60|N40 P100:7|N50 M30", p11062=bits, p100=0)
    start(desk)
    desk.run(30.0)
    assert mm(desk)[0] == place
    assert value(desk, 100) == 7.0
    assert value(desk, 8685) == 2.0
    assert value(desk, 8559) == 1.0
    assert not desk.controller.idle
    desk.set("key", "setup")
    desk.finish()
    assert mm(desk)[0] == 60.0
    assert value(desk, 8559) == 0.0
    assert said(desk) == []


@shows("bwo900-6.2-12")
@pytest.mark.parametrize("end", ["abort", "hand", "estop"])
def test_a_function_that_is_never_acknowledged_can_be_broken_off(end: str) -> None:
    desk = with_plc(DEAF, "P1|N10 G1 F3000 X20 M50|N20 X40|N30 M30", p11062=M50_AFTER_HALT)
    start(desk)
    desk.run(100.0)
    assert mm(desk)[0] == 20.0
    if end == "estop":
        desk.set("estop", "pressed")
    else:
        desk.send(parameters(p8705=1) if end == "abort" else parameters(p8683=1))
    desk.run(1.0)
    assert value(desk, 8685) == 0.0
    assert (value(desk, 8802), value(desk, 8803)) == (1.0, 10.0)


@shows("bwo900-6.2-5")
def test_a_path_is_deleted_at_any_time() -> None:
    desk = with_plc(BY_KEY, "P1|N10 G1 F1200 X50 M41.30|N20 Y50|N30 G91 Z10|N40 M30", p11060=M41_JUMPS)
    start(desk)
    desk.run(1.0)
    there = mm(desk)[0]
    assert 10.0 < there < 40.0
    desk.set("key", "setup")
    desk.finish()
    assert there < mm(desk)[0] < there + 5.0, "braked, and not gone on"
    assert mm(desk)[1:] == (0.0, 10.0)


@shows("bwo900-6.2-7")
@pytest.mark.parametrize("path", ["X50", ""])
def test_a_jump_that_is_never_acknowledged_is_none(path: str) -> None:
    desk = with_plc(DEAF, f"P1|N10 G1 F3000 {path} M41.30|N20 Y50|N30 Z10|N40 M30", p11060=M41_JUMPS)
    start(desk)
    desk.finish()
    assert mm(desk) == (50.0 if path else 0.0, 50.0, 10.0)


FLAG = "OB 1\nU M 32.0\n= A 0.6\nBE\n"
"""A PLC that acknowledges nothing, and shows the flag of a function at A 0.6."""


@shows("bwo900-6.2-13")
def test_the_flag_of_a_jump_that_was_not_acknowledged_stands_and_nobody_waits() -> None:
    desk = with_plc(FLAG, "P1|N10 G1 F3000 X5 M41.30|N20 G04.60.0|N30 M30", p11060=M41_JUMPS)
    start(desk)
    desk.run(10.0)
    assert (mm(desk)[0], desk.outputs["a0.6"]) == (5.0, 1)
    desk.send(parameters(p8705=1))
    desk.finish(1.0)
    assert desk.controller.idle, "nothing is waited for"


@shows("bwo900-6.2-13")
def test_that_flag_ends_with_the_next_function_with_halt() -> None:
    """M50, with halt, is shown in its place, and acknowledged by the key."""
    desk = with_plc(BY_KEY, "P1|N10 M41.40|N20 X5 G1 F3000 M50|N30 X8|N40 M30",
                    p11060=M41_JUMPS, p11062=M50_BEFORE_HALT)  # fmt: skip
    start(desk)
    desk.run(5.0)
    assert (mm(desk)[0], value(desk, 8_559)) == (0.0, 1.0), "M50 is waited for"
    desk.set("key", "setup")
    desk.finish()
    assert (mm(desk)[0], said(desk)) == (8.0, [])


@shows("bwo900-6.2-3")
def test_where_functions_are_defined() -> None:
    """M0 to M199 in P11050 on, or in P8250 on where q158 is 1; those above always there."""
    after = float(0x02)
    for number, place in ((0, 0), (50, 12), (199, 49)):
        bits = after * 256.0 ** (number % 4)
        system, channel = {f"p{11_050 + place}": bits}, {f"p{8_250 + place}": bits}
        text = f"N10 G0 X5 M{number}|N20 M30"
        for where, q158, behind in (
            (system, 0, True),
            (channel, 0, number == 0),  # M00 is after the path as delivered
            (channel, 1, True),
            (system, 1, False),
        ):
            done = analysed(text, **where, q158=float(q158))
            assert bool(done.blocks[0].post) == behind, (number, q158)
            assert bool(done.blocks[0].pre) != behind
    done = analysed("N10 G0 X5 M200 M999|N20 M30", p8300=after, p8499=after * 256.0**3)
    assert [f.code for f in done.blocks[0].post] == [200, 999]


@shows("bwo900-6.2-14")
def test_a_cycle_has_no_other_definition() -> None:
    """No code is sent, whatever else is defined; it begins at the end of the block, and has a number above 30."""
    text = "P1|N10 G0 X5 M31|N20 M30|Z31|N10 Y7|N20 M02|Z30|N10 P1:1 M02|Z20|N10 P1:1 M02"
    done = analysed(text, p11057=float((0x20 | 0x01 | 0x04 | 0x02) << 24))
    assert done.points == [(5.0, 0.0, 0.0), (5.0, 7.0, 0.0)]
    assert not [f for block in done.blocks for f in (*block.pre, *block.post)]
    done = analysed(text.replace("M31", "M20"), p11055=float(0x21))
    assert [f.code for block in done.blocks for f in block.pre] == [20]
    assert not done.parameters.loaded(1)


@shows("bwo900-6.2-15")
def test_definitions_are_taken_over_from_hand_to_auto() -> None:
    text = "P1|N10 G1 F3000 X20|N20 X40 M50|N30 X60|N40 M30"
    desk = with_plc(DEAF, text)
    desk.send(parameters(p8683=2))
    desk.send(parameters(p11062=M50_BEFORE_HALT))
    start(desk)
    desk.run(10.0)
    assert mm(desk)[0] == 60.0
    desk.send(parameters(p8683=1))
    desk.run(0.1)
    start(desk)
    desk.run(20.0)
    assert mm(desk)[0] == 20.0


# 6.1.7 M26


PROBED = "P1|N10 G1 F1200 X50 M26|N20 Y5|N30 M30"


@shows("bwo900-6.1-21", "bwo900-6.1-26")
@pytest.mark.parametrize("signal", ["parameter", "probe"])
def test_a_watched_path_is_deleted_by_its_signal(signal: str) -> None:
    """P8715 = 1, or the probe: the path is braked, the next block comes."""
    desk = fresh(PROBED)
    start(desk)
    desk.run(1.0)
    there = mm(desk)[0]
    assert 10.0 < there < 40.0
    if signal == "parameter":
        desk.send(parameters(p8715=1))
    else:
        desk.set("probe", "touched")
    desk.finish()
    assert there < mm(desk)[0] < there + 5.0
    assert mm(desk)[1] == 5.0
    assert said(desk) == []


@pytest.mark.parametrize(("deleted", "told"), [(False, []), (True, [1235])])
def test_a_deleted_path_is_none_before_a_spline(deleted: bool, told: list[int]) -> None:
    """It does not end with the direction that it was to end with (bwo900/85)."""
    desk = fresh("P1|N10 G1 F1200 X50 M26|N20 G50 X60 Y5|N30 G1 X70|N40 M30")
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8715=float(deleted)))
    desk.finish()
    assert said(desk) == told


@shows("bwo900-6.1-21")
def test_paths_without_m26_are_not_watched() -> None:
    for text in ("P1|N10 G1 F1200 X50|N20 M30", "P1|N10 G1 F1200 X5 M26|N20 X50|N30 M30"):
        desk = fresh(text)
        start(desk)
        desk.run(1.5)
        desk.send(parameters(p8715=1))
        desk.set("probe", "touched")
        desk.finish()
        assert mm(desk)[0] == 50.0


@shows("bwo900-6.1-21")
def test_a_watched_path_without_a_signal_is_made() -> None:
    assert mm(run(PROBED)) == (50.0, 5.0, 0.0)


@shows("bwo900-6.1-27")
@pytest.mark.parametrize("signal", ["parameter", "probe"])
def test_a_signal_that_is_there_already_deletes_at_once(signal: str) -> None:
    desk = fresh(PROBED)
    if signal == "parameter":
        desk.send(parameters(p8715=1))
    else:
        desk.set("probe", "touched")
    start(desk)
    desk.finish()
    assert mm(desk)[0] < 0.1
    assert mm(desk)[1] == 5.0


@shows("bwo900-6.1-28")
@pytest.mark.parametrize("signal", ["before", "while"])
def test_a_dwell_is_deleted(signal: str) -> None:
    desk = fresh("P1|N10 G04.100.0 M26|N20 G0 Y5|N30 M30")
    begin = desk.time_ns
    if signal == "before":
        desk.send(parameters(p8715=1))
    start(desk)
    desk.run(2.0)
    desk.send(parameters(p8715=1))
    desk.finish()
    assert (desk.time_ns - begin) / 1e9 < 5.0
    assert mm(desk)[1] == 5.0


@shows("bwo900-6.1-29")
def test_what_a_deleted_path_is_told_by() -> None:
    """P8695: -1 as a block with M26 begins, its number when it is deleted, 0 with P8715 = 0."""
    desk = fresh("P1|N10 G1 F1200 X50 M26|N20 Y50|N30 M30")
    start(desk)
    desk.run(1.0)
    assert value(desk, 8695) == -1.0
    assert value(desk, 12_181) == 0.0
    desk.send(parameters(p8715=1))
    desk.run(0.2)
    assert value(desk, 8695) == 10.0
    desk.send(parameters(p8715=0))
    assert value(desk, 8695) == 0.0


@shows("bwo900-6.1-30", "bwo900-6.2-16")
@pytest.mark.parametrize("by", ["probe", "jump"])
def test_where_the_axes_were_is_kept(by: str) -> None:
    """P12153 of each axis, in machine coordinates, at the signal; P12181 byte 1 is 1 (a probe or a jump)."""
    if by == "probe":
        desk = fresh("P1|N10 G54 G0 X0 Y7|N20 G1 F1200 X50 M26|N30 M30", p20003=2.0)
        start(desk)
        desk.run(1.5)
        there = mm(desk)
        desk.set("probe", "touched")
    else:
        text = "P1|N10 G54 G0 X0 Y7|N20 G1 F1200 X50 M41.30|N30 M30"
        desk = with_plc(BY_KEY, text, p11060=M41_JUMPS, p20003=2.0)
        start(desk)
        desk.run(1.5)
        there = mm(desk)
        desk.set("key", "setup")
    desk.finish()
    assert value(desk, 12_153) == pytest.approx(there[0], abs=0.2)
    assert value(desk, 12_353) == pytest.approx(7.0, abs=0.01)
    assert value(desk, 12_153) < mm(desk)[0], "before it had braked"
    if by == "probe":
        assert int(value(desk, 12_181)) == 0x0101, "taken, and the input is on"


@shows("bwo900-6.1-30")
@pytest.mark.parametrize(("axes", "kept"), [(0, [12_153, 12_353]), (1, [12_153]), (2, [12_353]), (3, [12_153, 12_353])])
def test_p8895_chooses_the_axes_whose_positions_are_kept(axes: int, kept: list[int]) -> None:
    """A bit an axis, X the lowest; 0 means all."""
    desk = fresh("P1|N10 G1 F1200 X50 Y50 M26|N20 M30", p8895=axes)
    start(desk)
    desk.run(1.5)
    desk.set("probe", "touched")
    desk.finish()
    told = put_out(desk)
    assert [n for n in (12_153, 12_353) if told.get(n - 10_000, 0.0) > 5.0] == kept


@shows("bwo900-7.1-36")
@pytest.mark.parametrize(("definition", "place"), [(0, 5.0), (0x05, 0.0)])
def test_m16_comes_to_the_plc_where_it_is_defined(definition: int, place: float) -> None:
    """P11054 has M16 in byte 1: before the path, with halt. This PLC acknowledges nothing unless the key says so."""
    desk = with_plc(BY_KEY, "P1|N10 M16 G1 F3000 X5|N20 M30", p11054=definition)
    start(desk)
    desk.run(5.0)
    assert (mm(desk)[0], value(desk, 8559)) == (place, float(place == 0.0))
    desk.set("key", "setup")
    desk.finish()
    assert mm(desk)[0] == 5.0


@shows("bwo900-6.1-30")
def test_positions_on_display_are_kept_with_p8855() -> None:
    desk = fresh("P1|N10 G54 G0 X0|N20 G1 F1200 X50 M26|N30 M30", p20003=2.0, p8855=1)
    start(desk)
    desk.run(1.5)
    there = mm(desk)[0]
    desk.set("probe", "touched")
    desk.finish()
    assert value(desk, 12_153) == pytest.approx(there - 2.0, abs=0.2)


@pytest.mark.parametrize(
    ("goal", "logic", "deletes"),
    [
        case("bwo900-6.1-31", "X50", 0x00000001, True),
        case("bwo900-6.1-31", "X-50", 0x00000001, False),
        case("bwo900-6.1-31", "X50", 0x00000100, False),
        case("bwo900-6.1-31", "X-50", 0x00000100, True),
        case("bwo900-6.1-31", "X50", 0x00000000, False),
        case("bwo900-6.1-31", "Y50", 0x00000001, True),  # of Y nothing is said: released
    ],
)
def test_the_probe_is_released_by_axis_and_sense(goal: str, logic: int, deletes: bool) -> None:
    """P12045 of X: byte 1 in +, byte 2 in -; deleted (as delivered) both (bwo900/62)."""
    desk = fresh(f"P1|N5 G0 X60 Y10|N10 G1 F1200 G91 {goal} M26|N20 M30", p12045=float(logic))
    start(desk)
    desk.run(2.5)
    before = mm(desk)
    assert before[1 if "Y" in goal else 0] not in (60.0, 10.0), "under way"
    desk.set("probe", "touched")
    desk.finish()
    axis = "XY".index(goal[0])
    assert (abs(mm(desk)[axis] - (60.0, 10.0)[axis]) < 50.0) == deletes


@shows("bwo900-6.1-31")
def test_the_probe_may_open() -> None:
    """P12045, byte 4, bit 0: the falling edge."""
    desk = fresh(PROBED, p12045=float(0x01000101), p12245=float(0x01000101), p12445=float(0x01000101))
    desk.set("probe", "touched")
    start(desk)
    desk.run(1.0)
    assert mm(desk)[0] > 10.0
    desk.set("probe", "free")
    desk.finish()
    assert mm(desk)[0] < 50.0


@shows("bwo900-6.1-32")
def test_supervision_while_a_watched_path_is_made() -> None:
    """sc:2 with M26 (3.6): the loop begins with the path, and may delete it."""
    text = (
        "P1|N10 G1 F1200 X50 M26|N20 sc:2|N30 P500:P500+1|N40 P500>400.140|N50 M23.30|N140 P8715:1|N150 sc:0|"
        "N160 P8715:0|N200 Y5|N210 M30"
    )
    desk = fresh(text, p500=0)
    start(desk)
    desk.finish()
    assert 5.0 < mm(desk)[0] < 45.0
    assert mm(desk)[1] == 5.0


@shows("bwo900-6.1-33")
def test_behind_a_deleted_path() -> None:
    """G91 counts from where the axes stand; G90 leads to its target; M26 is refused with radius correction."""
    for words, y in (("G91 X1 Y5", None), ("X20 Y5", 20.0)):
        desk = fresh(f"P1|N10 G1 F1200 X50 M26|N20 {words}|N30 M30")
        start(desk)
        desk.run(1.0)
        desk.send(parameters(p8715=1))
        desk.run(0.2)
        desk.send(parameters(p8715=0))
        desk.finish()
        assert mm(desk)[1] == 5.0
        assert mm(desk)[0] == 20.0 if y else 12.0 < mm(desk)[0] < 30.0


@shows("bwo900-3.6-27")
def test_stop_while_a_loop_of_supervision_runs() -> None:
    """Time goes on: supervision waits with the path, and goes on with it."""
    desk = fresh(
        "P1|N10 G1 F1200 X50|N20 sc:1|N30 P500:P500+1|N40 P500>400.140|N50 M23.30|N140 P501:1|N150 sc:0|N200 Y5|"
        "N210 M30",
        p500=0,
    )
    start(desk)
    desk.run(0.3)
    desk.send(parameters(p8684=0))
    desk.run(3.0)
    there = mm(desk)[0]
    assert 0.0 < there < 20.0
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[:2] == (50.0, 5.0)
    assert value(desk, 500) == 401.0


@shows("bwo900-6.1-34")
def test_positions_are_kept_without_deleting() -> None:
    desk = fresh("P1|N10 G1 F1200 X50|N20 M30", p8895=0x01)
    start(desk)
    desk.run(1.5)
    there = mm(desk)[0]
    desk.send(parameters(p8716=1))
    assert value(desk, 8696) == 10.0
    desk.send(parameters(p8716=0))
    assert value(desk, 8696) == 0.0
    desk.finish()
    assert mm(desk)[0] == 50.0
    assert value(desk, 12_153) == pytest.approx(there, abs=0.2)
    assert value(desk, 12_181) == 1.0
    assert put_out(desk).get(2_381, 0.0) == 0.0, "P8895: X only"


@shows("bwo900-6.1-33")
def test_m26_is_refused_where_m01_is() -> None:
    for text, number in (("N10 G41 tr:1 G1 F100 X5|N20 X9 M26", 1229), ("N10 G123 G1 F100 X5 M26|N20 X9 Y1", 1226)):
        with pytest.raises(ProgramError) as error:
            analysed(text + "|N30 M30")
        assert error.value.number == number


@shows("bwo900-6.1-23")
@pytest.mark.parametrize(("plc", "place"), [(BY_KEY, 30.0), (DEAF, 50.0)], ids=["yes", "no"])
def test_a_jump_by_comparison_beside_a_function_with_a_jump(plc: str, place: float) -> None:
    """bwo900/61: acknowledged, the function's goal; else that of the comparison."""
    desk = with_plc(plc, "P1|N10 P500=1.50 M41.30|N20 X20 M30|N30 G0 X30 M30|N50 G0 X50 M30", p11060=M41_JUMPS, p500=1)
    desk.set("key", "setup")
    start(desk)
    desk.finish()
    assert mm(desk)[0] == place


@shows("bwo900-9.3-2")
@pytest.mark.parametrize("number", ["9" * 320, "$" + "F" * 300], ids=["decimal", "hexadecimal"])
def test_numbers_that_no_parameter_holds(number: str) -> None:
    desk = fresh()
    desk.send(file("D", f"K1:P 500: {number}", "K1:P 501: 7"))
    assert said(desk) == [1111]
    assert not desk.controller.idle or value(desk, 501) == 7.0


DELETED = 0.0, 0.5
"""X where a path to 5 has been deleted as it began."""


@shows("bwo900-6.2-17")
@pytest.mark.parametrize(
    ("plc", "words", "messages", "places"),
    [
        (BY_KEY, "M41.90", [1255], DELETED),
        (BY_KEY, "M41.7.90", [1252], DELETED),
        (DEAF, "M41.90", [], (9.0, 9.0)),
        (BY_KEY, "M41.20 M30", [], DELETED),
        (BY_KEY, "M41.90 M30", [], DELETED),
        (DEAF, "M41.90 M30", [], (5.0, 5.0)),
    ],
    ids=["block", "program", "not taken", "end", "end and no goal", "end, not taken"],
)
def test_goals_that_there_are_not(plc: str, words: str, messages: list[int], places: tuple[float, float]) -> None:
    """M1255, M1252 when the jump is taken, which deletes the path; beside M30 the program ends (bwo900/61)."""
    desk = with_plc(plc, f"P1|N10 G1 F1200 X5 {words}|N20 X9|N30 M30", p11060=M41_JUMPS)
    desk.set("key", "setup")
    start(desk)
    desk.finish()
    assert said(desk) == messages
    assert value(desk, 8685) == 0.0
    assert places[0] <= mm(desk)[0] <= places[1]


@shows("bwo900-6.1-32")
def test_supervision_with_a_block_that_is_wrong() -> None:
    """The message comes when it is its turn, behind the watched path."""
    desk = fresh("P1|N10 G1 F1200 X20 M26|N20 X1 X2|N30 M30")
    start(desk)
    desk.finish()
    assert said(desk) == [1222]
    assert mm(desk)[0] == 20.0


@shows("bwo900-6.1-27")
def test_a_loop_of_paths_that_are_deleted_at_once_takes_time() -> None:
    desk = fresh("P1|N10 P500:P500+1|N20 G1 F1200 X50 M26 M23.10", p500=0, p8715=1)
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8705=1))
    desk.finish()
    assert 100 < value(desk, 500) < 1_000
    assert mm(desk)[0] == 0.0


@pytest.mark.parametrize(
    ("bits", "pre", "post", "halt", "jump"),
    [
        case("bwo900-6.2-18", 0x01, 1, 0, False, False),
        case("bwo900-6.2-18", 0x02, 0, 1, False, False),
        case("bwo900-6.2-18", 0x03, 1, 1, False, False),
        case("bwo900-6.2-18", 0x07, 1, 1, True, False),
        case("bwo900-6.2-18", 0x10, 1, 0, True, True),
        case("bwo900-6.2-18", 0x12, 1, 0, True, True),
    ],
)
def test_before_after_or_both(bits: int, pre: int, post: int, halt: bool, jump: bool) -> None:
    done = analysed(f"N10 G0 X5 M50{'.20' if jump else ''}|N20 M30", p11062=float(bits << 16))
    block = done.blocks[0]
    assert ([f.code for f in block.pre], [f.code for f in block.post]) == ([50] * pre, [50] * post)
    assert {(f.halt, f.jump) for f in (*block.pre, *block.post)} == {(halt, jump)}


@shows("bwo900-6.1-21")
@pytest.mark.parametrize(("byte_2", "settings", "way_mm"), [
    (0, {}, 12.5), (0x0100, {}, 0.0), (0x0100, {"ramped_halts": True}, 12.5),
])  # fmt: skip
def test_a_path_is_deleted_with_its_ramp_or_without(byte_2: int, settings: dict[str, bool], way_mm: float) -> None:
    """Byte 2 of P8855; a ramp from 100 mm/s takes 100 / 2 / 400 s."""
    desk = fresh("P1|N10 G1 F6000 X100 M26|N20 Y5|N30 M30", p12004=6000, p12008=250, p8855=byte_2, settings=settings)
    start(desk)
    desk.run(0.6)
    at = mm(desk)[0]
    desk.set("probe", "touched")
    desk.finish()
    assert mm(desk)[0] - at == pytest.approx(way_mm, abs=0.25)
    assert mm(desk)[1] == 5.0
