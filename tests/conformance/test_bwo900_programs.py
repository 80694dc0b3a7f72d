"""BWO 900, chapters 3 and 6: blocks, words, expressions, jumps, subprograms, functions, as a program says them."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.bwo900_desk import T1, analysed, file, fresh, mm, parameters, put_out, run, said, seconds, start, value
from conformance.rows import case, shows

from isel_twin.firmware.bwo900.messages import ProgramError


def refused(text: str, **values: float) -> ProgramError:
    """What a program is refused with."""
    with pytest.raises(ProgramError) as error:
        analysed(text, **values)
    return error.value


@pytest.mark.parametrize(
    ("text", "number"),
    [
        case("bwo900-3.2-1", "N10 G0 X1 {" + "-" * 190 + "}", 1222),
        case("bwo900-3.3-1", "N10 G0 G17 G29 G40 G43 G46 G53 G60 G90", 1222),
        case("bwo900-3.3-2", "N10 M3 M3 M3 M3 M3 M3 M3 M3 M3", 1222),
        case("bwo900-3.3-3", "N10 " + " ".join(f"P{n}:1" for n in range(33)), 1208),
        case("bwo900-3.3-4", "N10 M1000", 1227),
        case("bwo900-3.3-5", "N10 F1 F2", 1222),
        case("bwo900-3.3-6", "N10 Q5", 1216),
        case("bwo900-3.4-2", "N10 X" + "(" * 11 + "1" + ")" * 11, 1209),
    ],
)
def test_limits_of_a_block(text: str, number: int) -> None:
    assert refused(text).number == number


@shows("bwo900-3.2-1", "bwo900-3.3-1", "bwo900-3.3-2", "bwo900-3.3-3")
def test_what_a_block_may_hold() -> None:
    assert analysed("N10 G0 G17 G29 G40 G43 G46 G53 G60 X1|N20 M30").points == [(1.0, 0.0, 0.0)]
    assert len(analysed("N10 M3 M4 M5 M7 M8 M9 M10 M11|N20 M30").blocks[0].pre) >= 4
    assert analysed("N10 " + " ".join(f"P{n}:1" for n in range(32)) + "|N20 M30").parameters.get(31) == 1.0
    assert analysed("N10 G0 X1 {" + "-" * 188 + "}|N20 M30").points == [(1.0, 0.0, 0.0)]


@shows("bwo900-3.4-1", "bwo900-3.6-1", "bwo900-3.6-4")
def test_the_printed_block() -> None:
    done = analysed(
        "N10 G01 F100 M100 P30:(P20+35)*3 X200.0000 Y400.550 { Kommentar }|N20 X((110 + P20) / 3)|N30 M30", p20=1
    )
    assert done.parameters.get(30) == 108.0
    assert done.points == [pytest.approx((200.0, 400.55, 0.0)), pytest.approx((37.0, 400.55, 0.0))]
    assert done.path[0].feed_mm_min == 100.0


@shows("bwo900-3.6-5")
def test_hexadecimal_numbers_end_with_a_semicolon() -> None:
    assert analysed("N10 G01 F1000 P500 : $1AF; X: P500|N20 M30").points[0][0] == 431.0
    assert refused("N10 P500:$1AF X5").number == 1211


@shows("bwo900-3.6-6")
def test_axes_may_have_an_index() -> None:
    named = {"q110": float(ord("X") | 2 << 8 | 0x01010000), "q112": float(ord("Z") | 1 << 8 | 0x03030000)}
    assert analysed("N10 G0 X2:100 Z1:33|N20 M30", **named).points == [(100.0, 0.0, 33.0)]
    assert refused("N10 G0 X100", **named).number == 1216


@shows("bwo900-3.6-7")
def test_a_dash_deletes_a_parameter() -> None:
    done = analysed("N10 P500:5 P501:6|N20 P500: --|N30 M30")
    assert not done.parameters.loaded(500)
    assert done.parameters.get(501) == 6.0
    assert refused("N10 P500:5|N20 P500: --|N30 X:P500").number == 1300


@shows("bwo900-3.6-3")
def test_a_backslash_joins_lines() -> None:
    assert mm(run("P1|N10 G0 X10 \\|Y20|N20 M30")) == (10.0, 20.0, 0.0)


@pytest.mark.parametrize(
    ("jump", "before", "goal"),
    [
        case("bwo900-3.6-8", "P500=110.50", 110, 50),
        case("bwo900-3.6-9", "P500>P10.10", 4, 10),
        case("bwo900-3.6-10", "P500<250.15.30", 250.1, 30),
        case("bwo900-3.6-11", "P500<>0.40", 1, 40),
        case("bwo900-3.6-12", "P500>=0.50", 0, 50),
        case("bwo900-3.6-13", "P500<=0.80", 0, 80),
    ],
)
def test_jumps_by_comparison(jump: str, before: float, goal: int) -> None:
    tail = "|".join(f"N{n} P1:{n} M30" for n in (8, 10, 30, 40, 50, 80))
    for number, first in ((before, goal), ({50: 111, 10: 3, 30: 250.16, 40: 0, 80: 0.1}[goal] if before else -goal, 8)):
        done = analysed(f"N5 P10:3|N7 {jump}|{tail}", p500=number)
        if number == -50.0 or first == goal or jump != "P500<=0.80":
            assert done.parameters.get(1) == first, (jump, number)
    assert analysed("N7 P500<=0.80|N8 P1:8 M30|N80 P1:80 M30", p500=0.1).parameters.get(1) == 8.0


@pytest.mark.parametrize(
    ("text", "result"),
    [
        case("bwo900-3.6-14", "P200*5", 1000.0),
        case("bwo900-3.6-14", "P200+P201", 203.0),
        case("bwo900-3.6-14", "P200-1", 199.0),
        case("bwo900-3.6-14", "P200 / 2", 100.0),
        case("bwo900-3.6-14", "P200 % 2", 100.0),
        case("bwo900-3.6-15", "P201 mod 2", 1.0),
        case("bwo900-3.6-16", "sin(90)", 1.0),
        case("bwo900-3.6-16", "acos(P202)", 60.0),
        case("bwo900-3.6-16", "atan(1)", 45.0),
        case("bwo900-3.6-17", "$2001; or $100;", 0x2101),
        case("bwo900-3.6-18", "sqr(P200)", 14.142136),
        case("bwo900-3.6-18", "int(1,667)", 1.0),
        case("bwo900-3.6-18", "intr(1,667)", 2.0),
        case("bwo900-3.6-18", "abs(-1,2)", 1.2),
        case("bwo900-3.6-18", "ln(148,413)", 4.999999),
        case("bwo900-3.6-18", "log(100)", 2.0),
        case("bwo900-3.6-18", "exp(5)", 148.413159),
    ],
)
def test_operators_and_functions(text: str, result: float) -> None:
    done = analysed(f"N10 P500:{text}|N20 M30", p200=200, p201=3, p202=0.5)
    assert done.parameters.get(500) == pytest.approx(result, rel=1e-6)


@shows("bwo900-3.6-19", "bwo900-3.6-20", "bwo900-3.6-21")
def test_symbols() -> None:
    done = analysed("N5 _wegx ::= 500;|N10 _wegx:=10 _wegx[1]:=11|N20 _Wegx:=7|N30 G00 X:_wegx Y:_Wegx Z:_wegz|N40 M30")
    assert (done.parameters.get(500), done.parameters.get(501)) == (10.0, 11.0)
    assert done.points == [(10.0, 7.0, 0.0)]
    done = analysed("N10 _test1::=12|N20 _test2:=10|N30 G00 X:_test1 Y:_test2|N40 M30", p12=4)
    assert done.points == [(4.0, 10.0, 0.0)]
    assert refused("N10 _" + "a" * 31 + ":=1").number == 1211
    assert refused("N10 _a[3]:=1").number == 1307


@shows("bwo900-3.6-22")
def test_waituntil_waits_until_a_parameter_has_changed() -> None:
    desk = fresh("P1|N90 G0 X5|N100 waituntil P500 > P501+P502|N110 X10|N120 M30", p500=0, p501=1, p502=2)
    start(desk)
    desk.run(3.0)
    assert mm(desk)[0] == 5.0
    desk.send(parameters(p500=3))
    desk.run(1.0)
    assert mm(desk)[0] == 5.0
    desk.send(parameters(p500=4))
    desk.finish()
    assert mm(desk)[0] == 10.0


@shows("bwo900-3.6-23")
def test_waituntil_of_too_many_parameters() -> None:
    assert refused("N100 waituntil P1+P2+P3+P4+P5 > P6+P7+P8+P9").number == 1222
    assert analysed("N100 waituntil P[K1,500] = q1000 P5:1|N110 M30", p500=3, q1000=3).parameters.get(5) == 1.0


@shows("bwo900-3.6-24", "bwo900-3.6-25")
def test_texts_for_the_operator() -> None:
    desk = run("P1|N10 ! Das ist ein Text|N15 P1:23 !$8E, gelb|N20 !|N30 M30")
    assert [text for _, text in desk.remarks] == ["P1 N10: Das ist ein Text", "P1 N15: gelb"]
    assert value(desk, 1) == 23.0


@shows("bwo900-3.6-26")
def test_the_order_in_a_block() -> None:
    done = analysed("N10 P500:1 P500=1.30 M23.40|N20 P1:20 M30|N30 P1:30 M30|N40 P1:40 M30")
    assert done.parameters.get(1) == 30.0
    done = analysed("N10 P500:0 P500=1.30 M23.40|N20 P1:20 M30|N30 P1:30 M30|N40 P1:40 M30")
    assert done.parameters.get(1) == 40.0
    done = analysed("P1|N10 P500:1 P500=1.30 M28.2|N20 P1:20 M30|N30 P1:30 M30|P2|N10 P2:1 M2")
    assert (done.parameters.get(1), done.parameters.loaded(2)) == (30.0, False)


@shows("bwo900-3.6-27", "bwo900-3.6-28")
def test_a_loop_of_supervision_runs_beside_a_path() -> None:
    program = (
        "P1|N10 G01 F6000 X100|N20 sc :1|N30 P500>P501.140|N40 P502:P502+1|N50 M23.30|"
        "N140 P503:1|N150 sc :0|N200 G00 X20|N210 M30"
    )
    desk = fresh(program, p500=0, p501=5, p502=0, p503=0)
    start(desk)
    desk.run(0.5)
    assert 20.0 < mm(desk)[0] < 60.0
    passes = value(desk, 502)
    assert passes > 20.0
    desk.send(parameters(p500=6))
    desk.run(0.05)
    assert value(desk, 503) == 1.0
    assert mm(desk)[0] < 70.0
    desk.finish()
    assert mm(desk)[0] == 20.0


@shows("bwo900-3.6-29")
def test_supervision_may_wait_for_the_path_to_begin() -> None:
    program = "P1|N5 G01 F6000 X10|N10 X20|N15 X30|N20 sc:2|N30 P500:P12150 M23.140|N140 sc:0|N200 M30"
    desk = run(program)
    assert 19.9 <= value(desk, 500) < 21.0


@shows("bwo900-3.6-30")
def test_what_is_kept_may_be_let_go() -> None:
    program = "P1|N10 sc:1|N20 G0 X10|N30 sc:100|N40 P500>0.60|N50 M23.40|N60 sc:0 M30"
    desk = fresh(program, p500=0)
    start(desk)
    desk.run(2.0)
    assert mm(desk)[0] == 10.0
    desk = fresh(program.replace("N30 sc:100|", ""), p500=0)
    start(desk)
    desk.run(2.0)
    assert mm(desk)[0] == 0.0
    assert refused("N10 sc:7").number == 1211


@shows("bwo900-3.7-1", "bwo900-3.7-2")
def test_feed_is_modal_and_outlives_rapid() -> None:
    done = analysed("N10 G1 F500 X10|N20 G0 X20|N30 G1 X30|N40 X40 F600|N50 M30")
    assert [block.feed_mm_min for block in done.path] == [500.0, None, 500.0, 600.0]
    assert refused("N10 G1 X10").number == 1230


@shows("bwo900-3.7-4")
def test_a_block_may_end_with_another_feed() -> None:
    desk = fresh("P1|N50 G1 F6000 X30|N60 F6000 f1000 X90|N70 X115|N80 M30")
    first = desk.ticks
    start(desk)
    desk.finish()
    ways = desk.steps_since(first).delta[:, 0] / 1000.0
    places, speeds = np.cumsum(ways), ways / 0.002 * 60.0
    assert speeds[(places > 20) & (places < 70)].max() == pytest.approx(6000.0, rel=0.01)
    assert speeds[(places > 89) & (places < 91)].min() == pytest.approx(1000.0, abs=50.0)


@shows("bwo900-3.8-1", "bwo900-3.8-2")
def test_speeds_of_eight_spindles() -> None:
    done = analysed("N10 S1000|N20 S1:500 S2:600 S8:8000|N30 M30")
    assert [dict(block.speeds) for block in done.blocks[:2]] == [{1: 1000.0}, {1: 500.0, 2: 600.0, 8: 8000.0}]
    assert refused("N10 S9:1").number == 1211 or refused("N10 S9:1").number == 1224


@shows("bwo900-3.2-2", "bwo900-9.5-1")
def test_block_numbers_rise() -> None:
    desk = fresh("P1|N20 X1|N20 X2", referenced=False)
    assert said(desk) == [1290]


@shows("bwo900-3.6-2")
def test_blocks_with_a_slash_are_skipped_if_asked() -> None:
    assert mm(run("P1|N10 G0 X10|/ N20 Y20|N30 M30", p8810=1)) == (10.0, 0.0, 0.0)
    assert mm(run("P1|N10 G0 X10|/ N20 Y20|N30 M30", p8810=0)) == (10.0, 20.0, 0.0)


@pytest.mark.parametrize(
    ("text", "number"),
    [
        case("bwo900-9.5-2", "N10 P1:5/0", 1203),
        case("bwo900-9.5-3", "N10 P1:(5", 1210),
        case("bwo900-9.5-4", "N10 X?", 1211),
        case("bwo900-9.5-5", "N10 P1:sqr(-1)", 1212),
        case("bwo900-9.5-6", "N10 P1:tan(90)", 1213),
        case("bwo900-9.5-7", "N10 P5", 1214),
        case("bwo900-9.5-8", "N10 P99999:1", 1302),
        case("bwo900-9.5-9", "N10 G0 X:P77", 1300),
        case("bwo900-9.5-10", "N10 P[K5,1]:1", 1305),
        case("bwo900-9.5-11", "N10 M23.77", 1255),
        case("bwo900-9.5-12", "N10 M28.77", 1252),
        case("bwo900-9.5-13", "N10 G1 X5", 1230),
        case("bwo900-9.5-14", "N10 T9", 1050),
        case("bwo900-9.5-14", "N10 T1 q176:0|N20 T2", 1225),
    ],
)
def test_messages_of_the_interpreter(text: str, number: int) -> None:
    assert refused(text + "|N900 M30", **T1).number == number


# Chapter 6


@shows("bwo900-6.1-1", "bwo900-6.1-2", "bwo900-6.1-3")
def test_measuring_stop() -> None:
    desk = fresh("P1|N5 S1000 M3|N10 G0 X37,95 Y12,76 M00|N20 G1 F1000 X50 G41|N30 M30", p8160=0)
    start(desk)
    desk.run(5.0)
    assert mm(desk)[:2] == (37.95, 12.76)
    assert desk.outputs["spindle"] == 0
    assert value(desk, 8685) == 1.0
    desk.send(parameters(p8160=3, p8684=1))
    desk.finish()
    assert mm(desk)[0] == 50.0
    assert refused("N10 G41 tr:1 G1 F100 X5|N20 X9 M00").number == 1232
    desk = fresh("P1|N10 G0 Z5 M00|N20 Z6|N30 M30")
    start(desk)
    desk.run(3.0)
    desk.send(parameters(p8161=3, p8684=1))
    desk.finish()
    assert mm(desk)[2] == 9.0


@shows("bwo900-6.1-4", "bwo900-6.1-5")
def test_analysis_runs_ahead_unless_it_is_synchronised() -> None:
    text = "P1|N10 G01 F1000 X10 Y10|N20 X20|N30 X100|N40 X50{}|N50 P100:20|N60 M30"
    for synchronise, early in (("", 20.0), (" M01", 0.0)):
        desk = fresh(text.format(synchronise), p100=0)
        start(desk)
        desk.run(0.3)
        assert mm(desk)[0] < 10.0
        assert value(desk, 100) == early
        desk.finish()
        assert value(desk, 100) == 20.0
    assert refused("N10 G41 tr:1 G1 F100 X5|N20 X9 M01").number == 1229


@shows("bwo900-6.1-6", "bwo900-6.1-7")
def test_jumps() -> None:
    done = analysed("P1|N10 M23.110|N20 P1:1 M30|N110 P2:1 M23.10.110|P10|N10 P3:1|N110 P4:1|N120 M30")
    assert [done.parameters.loaded(n) for n in (1, 2, 3, 4)] == [False, True, False, True]


@shows("bwo900-6.1-8", "bwo900-6.1-9", "bwo900-6.1-10")
def test_loops() -> None:
    done = analysed("N10 P1:0 P2:0|N20 P2:P2+1 M24.07|N30 P1:P1+1|N40 M25|N50 P3:1|N60 M30")
    assert [done.parameters.get(n) for n in (1, 2, 3)] == [7.0, 1.0, 1.0]
    done = analysed("N10 P1:0 M24.3|N20 M24.4|N30 P1:P1+1 M25|N40 M25|N50 M30")
    assert done.parameters.get(1) == 12.0
    assert refused("N10 M25").number == 1217
    assert refused("N10 M24").number == 1218
    assert refused("N10 M24.2 M23.10").number == 1218


@shows("bwo900-6.1-11")
def test_the_passes_of_a_loop_can_be_read() -> None:
    desk = fresh("P1|N5 P1:0|N10 M24.3|N20 P1:P1+P8935 P2:P8934 G4.0.1 M25|N30 M30")
    start(desk)
    desk.finish()
    assert (value(desk, 1), value(desk, 2)) == (6.0, 3.0)


@shows("bwo900-6.1-12", "bwo900-6.1-13", "bwo900-6.1-14", "bwo900-6.1-15")
def test_subprograms() -> None:
    sub = "P40|N10 P1:P1+1|N20 P1:P1+10|N30 P1:P1+100|N40 P1:P1+1000|N50 M02"
    for call, result in (("M28.40", 1111), ("M28.40.20", 1110), ("M28 .40.10_30", 111), ("M28..30", 1000)):
        done = analysed(f"P1|N5 P1:0|N10 {call.replace(' ', '')}|N20 P2:1 M30|N30 P1:P1+1000|N40 M02|{sub}")
        assert (done.parameters.get(1), done.parameters.get(2)) == (result, 1.0), call


@shows("bwo900-6.1-16")
def test_six_subprograms_inside_each_other() -> None:
    def nested(levels: int) -> str:
        return "|".join(
            [*(f"P{n}|N10 M28.{n + 1}|N20 M02" for n in range(1, levels + 1)), f"P{levels + 1}|N10 P9:1 M02"]
        )

    assert analysed(nested(6)).parameters.get(9) == 1.0
    assert refused(nested(7)).number == 1220


@shows("bwo900-6.1-17", "bwo900-6.1-18")
def test_end_and_again() -> None:
    desk = fresh("P1|N10 P1:P1+1 G0 X5|N20 X0 M29", p1=0)
    start(desk)
    desk.run(6.0)
    assert desk.controller.idle is False
    assert value(desk, 1) >= 3.0
    done = analysed("P1|N10 M28.2|N20 P2:1 M30|P2|N10 P1:1 M29")
    assert (done.parameters.get(1), done.parameters.get(2)) == (1.0, 1.0)


@shows("bwo900-6.1-19", "bwo900-6.1-20")
def test_the_end_of_a_program() -> None:
    desk = fresh("P1|N10 G54 G0 X5|N20 G91 G18 M30", "P2|N10 G0 X2|N20 M30", p20003=10.0)
    for number, place in ((1, 15.0), (2, 2.0)):
        start(desk, number)
        desk.finish()
        assert mm(desk)[0] == place
    assert value(desk, 8687) == 0.0


@shows("bwo900-6.2-1", "bwo900-6.2-2")
def test_functions_before_and_after_the_path() -> None:
    desk = fresh("P1|N10 G1 F3000 X50 M7|N20 X100 M9|N30 M30")
    start(desk)
    desk.run(0.2)
    assert desk.outputs["a0.3"] == 1
    desk.run(1.5)
    assert desk.outputs["a0.3"] == 1
    desk.finish()
    assert desk.outputs["a0.3"] == 0
    assert [round(desk_value) for desk_value in mm(desk)] == [100, 0, 0]


@shows("bwo900-6.2-3", "bwo900-8.6-1")
def test_the_table_of_functions() -> None:
    """The printed example: P11051 = $10050601 defines M7, M6, M5, M4."""
    done = analysed("N10 M4 M5 M6 G0 X5|N20 M7.30|N30 M30", p11051=float(0x10050601))
    first = done.blocks[0]
    assert [(f.code, f.halt, f.jump) for f in first.pre] == [(4, False, False), (6, True, False)]
    assert [(f.code, f.halt) for f in first.post] == [(5, True)]
    assert [(f.code, f.halt, f.jump) for f in done.blocks[1].pre] == [(7, True, True)]


@shows("bwo900-6.2-4")
def test_functions_with_halt_stop_the_axes_until_they_are_acknowledged() -> None:
    desk = fresh("P1|N10 G1 F3000 X20 M50|N20 X40|N30 M30", p11062=float(0x06 << 16))
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 40.0
    with_halt = seconds("P1|N10 G1 F3000 X20 M50|N20 X40|N30 M30", p11062=float(0x06 << 16))
    assert with_halt > seconds("P1|N10 G1 F3000 X20 M50|N20 X40|N30 M30", p11062=float(0x02 << 16)) + 0.1


JUMPING = float(0x10 << 8)
"""M41 with a jump: byte 2 of P11060."""


@shows("bwo900-6.2-5", "bwo900-6.2-6")
def test_a_function_with_a_jump_deletes_its_path() -> None:
    desk = run("P1|N10 G1 F3000 X50 M41.30|N20 Y50|N30 Z10|N40 M30", p11060=JUMPING)
    assert mm(desk)[0] < 1.0
    assert mm(desk)[1:] == (0.0, 10.0)
    desk = run("P1|N10 M41.2.10|N20 X50|N30 M30", "P2|N5 G0 Y20|N10 G0 Z10|N20 M30", p11060=JUMPING)
    assert mm(desk) == (0.0, 0.0, 10.0)


@shows("bwo900-6.2-7", "bwo900-8.5-13")
def test_without_acknowledgement_the_path_is_made() -> None:
    desk = run("P1|N10 G1 F3000 X50 M41.30|N20 Y50|N30 Z10|N40 M30", p11060=JUMPING, p8813=1)
    assert mm(desk) == (50.0, 50.0, 10.0)


@shows("bwo900-6.2-8")
def test_definition_and_use_of_a_function_agree() -> None:
    assert refused("N10 M41.30").number == 1228
    assert refused("N10 M41", p11060=JUMPING).number == 1228


@shows("bwo900-6.2-9")
def test_a_function_may_be_a_cycle() -> None:
    done = analysed("P1|N10 G0 X5 M234|N20 M30|Z234|N10 P1:1 Y7|N20 M02", p8308=float(0x20 << 16))
    assert done.parameters.get(1) == 1.0
    assert done.points[-1] == (5.0, 7.0, 0.0)
    assert refused("N10 M234.5", p8308=float(0x20 << 16)).number == 1228


@shows("bwo900-8.4-1", "bwo900-8.4-2")
def test_parameters_of_real_time_and_those_that_synchronise() -> None:
    desk = fresh("P1|N10 G1 F1000 X20|N20 P100:7 X40|N30 M30")
    desk.send(file("D+", "K1:P 100: 0 S:$00000005"))
    start(desk)
    desk.run(0.3)
    assert value(desk, 100) == 0.0
    desk.finish()
    assert value(desk, 100) == 7.0
    desk = fresh("P1|N10 G1 F1000 X20|N20 P100:7 X40|N30 P101:1 X50|N40 M30", p101=0)
    desk.send(file("D+", "K1:P 100: 0 S:$00000009"))
    start(desk)
    desk.run(0.3)
    assert (value(desk, 100), value(desk, 101)) == (7.0, 0.0)
    desk.finish()
    assert value(desk, 101) == 1.0


@shows("bwo900-3.6-31")
def test_a_bit_of_the_plc_decides_a_jump() -> None:
    for bit, place in ((0, 10.0), (1, 20.0)):
        assert mm(run("P1|N100 P8714<>0.200|N110 G0 X10 M30|N200 G0 X20 M30", p8714=bit))[0] == place


@shows("bwo900-3.6-32")
def test_parameters_can_be_put_out() -> None:
    assert put_out(fresh(p500=12.5))[10_500] == 12.5
