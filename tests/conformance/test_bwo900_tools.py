"""BWO 900, chapter 7.1, the tool records of 8.3 and 8.5, and printed examples of chapter 7, from the manual alone."""

from __future__ import annotations

from itertools import pairwise

import pytest
from conformance.bwo900_desk import analysed, fresh, mm, parameters, run, start, value
from conformance.rows import shows
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.geometry.contour import Contour
from isel_twin.firmware.bwo900.geometry.elements import Element
from isel_twin.firmware.bwo900.geometry.offset import Offset
from isel_twin.firmware.bwo900.messages import ProgramError

PLC, SPINDLE, PATH, REAL = 8_050, 8_100, 8_150, 8_200
"""First parameters of the records."""
NUMBER, PLACE, STATUS, RADIUS, LENGTH, QUADRANT, OWN = 1, 2, 8, 10, 11, 14, 15
POOL = {
    "p21020": 2, "p21022": 7, "p21030": 3, "p21031": 20, "p21034": 4, "p21035": 17,
    "p21040": 3, "p21042": 9, "p21050": 5, "p21051": 40,
}  # fmt: skip
"""The printed pool: T2 is its 2nd entry (P21020), T3 its third."""


def record(done: Analysed, first: int, *offsets: int) -> list[float]:
    return [done.parameters.get(first + offset) for offset in offsets]


def filtered(text: str, offset: Offset, **values: float) -> list[PathBlock]:
    """All blocks, corners and radius correction done."""
    done = analysed(text, **values).blocks
    for item in (Contour(), offset):
        done = [out for block in done for out in item.push(block)] + item.flush()
    return done


def corrected(text: str, **values: float) -> list[Element]:
    return [element for block in filtered(text, Offset(None), **values) for element in block.elements]


def refused(text: str, **values: float) -> ProgramError:
    with pytest.raises(ProgramError) as error:
        corrected(text, **values)
    return error.value


# Length and radius


@shows("bwo900-7.1-13")
def test_the_spindle_s_length_counts_from_the_start() -> None:
    """Of the next program, whatever the one before it had set."""
    desk = fresh("P1|N10 G0 tl:3 Z5|N20 Z6|N30 M30", "P2|N10 G0 Z5|N20 M30", p8100=2, p8111=20, p8113=1.5)
    start(desk)
    desk.finish()
    assert mm(desk)[2] == 9.0
    start(desk, 2)
    desk.finish()
    assert mm(desk)[2] == 26.5


@shows("bwo900-7.1-10")
@pytest.mark.parametrize("how", ["p8705", "p8683"])
def test_a_program_that_is_broken_off_leaves_the_spindle_s_tool(how: str) -> None:
    desk = fresh("P1|N10 T2 M16|N20 G1 F100 X50|N30 M30", **POOL, p8100=3, p8110=5)
    start(desk)
    desk.run(1.0)
    assert value(desk, PATH + RADIUS) == 3.0
    desk.send(parameters(**{how: 1}))
    desk.finish()
    assert (value(desk, PATH), value(desk, PATH + RADIUS)) == (3.0, 5.0)


@shows("bwo900-7.1-14")
def test_the_length_is_a_shift() -> None:
    """The display (P12554) says what is programmed; P12557 is the sum of zero point and length."""
    desk = run("P1|N5 G54 G0 tl:12.5|N10 Z4 M01|N20 P500:P12554 P501:P12557|N40 M30", p20005=3)
    assert (mm(desk)[2], value(desk, 500), value(desk, 501)) == (19.5, 4.0, 15.5)


# T


@shows("bwo900-7.1-15")
def test_a_tool_is_fetched_at_its_first_call_and_when_it_changes() -> None:
    done = analysed("N10 T2|N20 P8060:99|N30 T2|N40 P500:P8060 T3|N50 T2|N60 M30", **POOL)
    assert done.parameters.get(500) == 99.0
    assert record(done, PLC, 0, RADIUS) == [2.0, 3.0]


@shows("bwo900-7.1-16")
def test_the_record_says_its_place_in_the_table() -> None:
    """P8051 is the running number of the record, whatever the table says."""
    done = analysed("N10 T3|N20 M30", **POOL, p21041=77)
    assert record(done, PLC, 0, NUMBER, PLACE, RADIUS, LENGTH) == [3.0, 3.0, 9.0, 5.0, 40.0]


@shows("bwo900-7.1-17")
@pytest.mark.parametrize(("words", "info"), [("T2", 0), ("T2 M6", 6), ("T2 M16", 16)])
def test_what_is_said_of_a_tool_besides(words: str, info: int) -> None:
    """P8049 in analysis; P8048 and the record of real time when the block is executed, that one not for M16."""
    done = analysed(f"N10 {words}|N20 M30", **POOL)
    assert done.parameters.get(8_049) == info
    assert done.parameters.get(8_048) == 2.0
    assert record(done, REAL, 0, NUMBER, RADIUS, OWN) == ([2.0, 2.0, 3.0, 17.0] if info != 16 else [0.0] * 4)
    desk = fresh("P1|N10 G1 F600 X5|N20 T2|N30 M30", **POOL, p8048=0, p8200=0)
    start(desk)
    desk.run(0.2)
    assert (value(desk, 8_050), value(desk, 8_048), value(desk, 8_200)) == (2.0, 0.0, 0.0)
    desk.finish()
    assert (value(desk, 8_048), value(desk, 8_200), value(desk, 8_210)) == (2.0, 2.0, 3.0)


@shows("bwo900-7.1-18")
def test_the_real_time_s_record_of_the_spindle_s_tool() -> None:
    done = analysed("N10 T2|N20 M30", **POOL, p8100=2, p8110=9)
    assert record(done, REAL, 0, RADIUS) == [2.0, 9.0]


@shows("bwo900-7.1-19")
def test_every_t_calls_z5() -> None:
    z5 = "Z5|N10 P500:P500+1 P501:P8060|N20 M30"
    done = analysed(f"P1|N10 P500:0|N20 T2|N30 T2|N40 T3|N50 M30|{z5}", **POOL)
    assert (done.parameters.get(500), done.parameters.get(501)) == (3.0, 5.0)
    z6 = "Z6|N10 P502:P500|N20 P8045:1|N30 M30"
    done = analysed(f"P1|N10 P500:0|N20 T2 M6|N30 M30|{z5}|{z6}", **POOL)
    assert record(done, SPINDLE, 0) == [2.0]
    assert (done.parameters.get(500), done.parameters.get(502)) == (1.0, 1.0)  # Z5, then Z6


@shows("bwo900-7.1-20")
@pytest.mark.parametrize(
    ("values", "number"),
    [({"p21028": 1}, 1053), ({"p21028": 0}, 0), ({"p21020": 4}, 1050), ({"q176": 0}, 1225), ({"q176": 1}, 1050)],
)
def test_tools_that_there_are_not(values: dict[str, float], number: int) -> None:
    """The 9th parameter of a record is 1 where its life is over; q176 is the number of records."""
    if number:
        assert refused("N10 T2|N20 M30", **{**POOL, **values}).number == number
    else:
        analysed("N10 T2|N20 M30", **{**POOL, **values})


@shows("bwo900-7.1-21")
def test_a_locked_t_waits() -> None:
    """P8040 = 1: a program with T waits for it; its start clears it, and so does P8045 = 2."""
    text = "P1|N10 P8040:1|N20 G0 X5|N30 T2|N40 G0 X9|N50 M30"
    desk = fresh(text, **POOL)
    start(desk)
    desk.run(3.0)
    assert mm(desk)[0] == 5.0
    desk.send(parameters(p8045=2))
    desk.finish()
    assert (mm(desk)[0], value(desk, 8_040)) == (9.0, 0.0)
    assert mm(run(text.replace("N10 P8040:1", "N10 P500:1"), **POOL, p8040=1))[0] == 9.0


# Words


@shows("bwo900-7.1-6")
def test_the_quadrant_s_word_changes_nothing_else() -> None:
    done = analysed("N10 T2 M16|N20 t:0.5 tq:6|N30 M30", **POOL)
    assert record(done, PATH, 0, RADIUS, 12, QUADRANT) == [2.0, 3.0, 0.5, 6.0]
    done = analysed("N10 T2 M16|N20 t:0.5|N25 tl:80|N30 M30", **POOL, p21033=1)
    assert record(done, PATH, RADIUS, 12, LENGTH, 13, QUADRANT) == [3.0, 0.5, 80.0, 0.0, 4.0]


@shows("bwo900-7.1-22")
@pytest.mark.parametrize("over", ["T3 M6", "T3 M16"])
def test_words_hold_until_tool_data_come(over: str) -> None:
    done = analysed(f"N10 T2 M16|N20 tr:50 tl:60|N30 {over}|N40 P500:P8160 P501:P8161|N50 M30", **POOL)
    assert (done.parameters.get(500), done.parameters.get(501)) == (5.0, 40.0)


@shows("bwo900-7.1-23")
def test_words_need_no_m16() -> None:
    done = analysed("N10 G0 tl:80|N20 Z1|N30 tl:0|N40 Z1|N50 M30")
    assert [point[2] for point in done.points] == [81.0, 1.0]


# M06


@shows("bwo900-7.1-24")
def test_with_z6_the_plc_gets_no_m06() -> None:
    z6 = "Z6|N10 P8045:1|N20 M30"
    sent = [m.code for b in analysed(f"P1|N10 T2 M6|N20 M30|{z6}", **POOL).blocks for m in (*b.pre, *b.post)]
    assert 6 not in sent
    sent = [m.code for b in analysed("P1|N10 T2 M6|N20 M30", **POOL).blocks for m in (*b.pre, *b.post)]
    assert 6 in sent


@shows("bwo900-7.1-25")
def test_the_end_of_z6_synchronises_and_activates() -> None:
    """The new length counts behind Z6, not in it; analysis waits until Z6 has been executed."""
    z6 = "Z6|N10 P8045:1|N20 G0 Z2|N30 M30"
    done = analysed(f"P1|N10 G0 Z1|N20 T2 M6|N30 Z1|N40 M30|{z6}", **POOL)
    assert [point[2] for point in done.points] == [1.0, 2.0, 21.0]
    desk = fresh("P1|N10 T2 M6|N30 P500:1|N40 M30", z6.replace("G0 Z2", "G1 F300 Z20"), **POOL, p500=0)
    start(desk)
    desk.run(1.0)
    assert (0.0 < mm(desk)[2] < 20.0, value(desk, 500)) == (True, 0.0)
    desk.finish()
    assert value(desk, 500) == 1.0


@shows("bwo900-7.1-26")
def test_without_z6_the_change_is_over_when_the_plc_says_so() -> None:
    """The default PLC takes 2 s: the old tool goes back into the table, the new one into the spindle, and counts."""
    desk = fresh("P1|N10 G0 Z1 T3 M6|N20 Z1|N30 M30", **POOL, p8100=2, p8101=2, p8110=2.75)
    start(desk)
    desk.run(1.5)
    assert (value(desk, PLC), value(desk, SPINDLE), value(desk, 21_030)) == (3.0, 2.0, 3.0)
    desk.finish()
    assert (value(desk, SPINDLE), value(desk, SPINDLE + RADIUS), value(desk, 21_030)) == (3.0, 5.0, 2.75)
    assert mm(desk)[2] == 41.0


# P8045 to P8047


@shows("bwo900-7.1-27")
@pytest.mark.parametrize(
    ("command", "spindle", "path"),
    [
        ("P8045:1", 3, 3),
        ("P8045:10", 3, 9),
        ("P8046:1", 2, 2),
        ("P8046:2", 2, 3),
        ("P8045:2", 7, 9),
        ("P8045:$0301;", 3, 3),
    ],
)
def test_records_are_copied(command: str, spindle: float, path: float) -> None:
    """PLC T3, spindle T2, path T9, real time T7 before. The command is byte 1."""
    records = {"p8050": 3, "p8100": 2, "p8150": 9, "p8200": 7}
    done = analysed(f"N10 {command}|N20 P500:P8100 P501:P8150|N30 M30", **records)
    assert (done.parameters.get(500), done.parameters.get(501)) == (spindle, path)
    desk = fresh(**records)
    desk.send(parameters(**{command[:5].lower(): int(command[7:-1], 16) if "$" in command else int(command[6:])}))
    in_hand = spindle if command == "P8045:2" else path
    assert (value(desk, 8_100), value(desk, 8_150)) == (spindle, in_hand)


@shows("bwo900-7.1-28")
def test_a_tool_is_put_back_by_its_number() -> None:
    """P8047: to the entry of P8101, also one whose life is over; then the spindle is empty. Nothing for T0."""
    text = "N10 T3|N20 P8045:1|N30 P8106:10 P8107:11 P8108:1 P8110:4.5|N40 P8047:1|N50 M30"
    done = analysed(text, **POOL, p21043=0)
    assert [done.parameters.get(21_040 + n) for n in (0, 1, STATUS, RADIUS)] == [3.0, 3.0, 1.0, 4.5]
    assert record(done, SPINDLE, 0, RADIUS) == [0.0, 0.0]
    done = analysed("N10 P8110:5|N20 P8047:1|N30 M30", **POOL)
    assert done.parameters.get(8_110) == 5.0


# M16


@shows("bwo900-7.1-29")
def test_tool_data_are_called_without_changing_the_spindle() -> None:
    done = analysed(
        "N10 T2 M16|N20 P500:P8100 P501:P8150|N30 T0 M16|N40 P502:P8150 P503:P8160|N50 M30", **POOL, p8100=3
    )
    assert [done.parameters.get(n) for n in (500, 501, 502, 503)] == [3.0, 2.0, 0.0, 0.0]


@shows("bwo900-7.1-30")
def test_m16_alone_activates_what_is_there() -> None:
    done = analysed("N10 P8161:30|N20 G0 Z1|N30 M16|N40 Z1|N50 M30")
    assert [point[2] for point in done.points] == [1.0, 31.0]


@shows("bwo900-7.1-31")
def test_the_printed_call_of_tool_data() -> None:
    """N100 T2 M16, N120 X100 Y100 G42: the radius counts from G42 on."""
    done = analysed("N90 F1000|N100 T2 M16|N110 X50|N120 X100 Y100 G42|N130 Y200|N140 M30", **POOL)
    assert [(b.correction.side, b.correction.radius_mm) for b in done.path] == [(0, 0.0), (-1, 3.0), (-1, 3.0)]
    made = corrected("N90 F1000|N100 T2 M16|N110 X50|N120 X100 Y100 G42|N130 Y200|N140 M30", **POOL)
    assert [e.end[:2] for e in made] == [(50.0, 0.0), (103.0, 100.0), (103.0, 200.0)]


LONG_Z6 = """Z6
N10 _wzwxl_x_pos := 1000; _wzwxl_y_pos:= 300;
N30 P8100=P8050.200
N40 P8100=0.100
N50 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01
N60 P8047:1
N100 P8050=0.200
N120 G00 X:_wzwxl_x_pos Y:_wzwxl_y_pos M01
N140 P8045:1
N200 M30"""


@shows("bwo900-7.1-32")
@pytest.mark.parametrize(
    ("before", "call", "places", "spindle"),
    [
        ({}, "T3", 1, 3),
        ({"p8100": 2, "p8101": 2, "p8110": 2.5}, "T3", 1, 3),
        ({"p8100": 2, "p8101": 2, "p8110": 2.5}, "T0", 1, 0),
        ({"p8100": 3, "p8101": 3, "p8110": 5}, "T3", 0, 3),
        ({}, "T0", 0, 0),
    ],
)
def test_the_printed_change_of_tools(before: dict[str, float], call: str, places: int, spindle: float) -> None:
    """Empty spindle, another tool, none wanted, the same tool: each goes its way through the jumps."""
    done = analysed(f"P1|N100 {call} M6|N200 M30|" + LONG_Z6.replace("\n", "|"), **POOL, **before)
    assert [point[:2] for point in done.points] == [(1000.0, 300.0)] * places
    assert record(done, SPINDLE, 0) == [spindle]
    assert done.parameters.get(21_030) == before.get("p8110", 3.0) if before.get("p8100") == 2 else 3.0


@shows("bwo900-7.1-33")
def test_the_display_of_a_corrected_place() -> None:
    """The radius is a correction: display (P12154) and programmed position (P12155) differ by it."""
    desk = fresh("P1|N5 tr:2 F1200|N10 G41 G1 X10|N20 X60|N30 G40 X70|N40 M30")
    start(desk)
    desk.run(2.5)
    assert value(desk, 12_354) == pytest.approx(2.0, abs=1e-3)
    assert value(desk, 12_357) == 0.0


# 7.2


@shows("bwo900-7.2-6")
@pytest.mark.parametrize("plane", ["G18", "G19"])
def test_another_plane_needs_g40_first(plane: str) -> None:
    assert refused(f"N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 {plane}|N50 X50 Z9|N60 M30").number == 1232
    made = corrected(f"N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 G40 X40|N45 {plane}|N50 X50 Z9|N60 M30")
    assert made[-1].end == (50.0, 0.0, 9.0)


HEAD = "N10 F500 tr:5|N20 G41 G1 X20|N30 X30|"


@shows("bwo900-7.2-7")
@pytest.mark.parametrize(("line", "wrong_mm"), [("N200 G40 Z100", 5.0), ("N200 G40 X40 Y100 Z100", 0.0)])
@pytest.mark.parametrize("in_place", [False, True])
def test_the_printed_special_case_of_g40(line: str, wrong_mm: float, in_place: bool) -> None:
    """N210 takes the tool's offset along, 5 mm to the left of X, and the next line ends where it should; with a
    setting N210 does, too. The block says what it does."""
    text = f"{HEAD}{line}|N210 G18 X20 Y50|N220 X0 Y0|N230 M30"
    blocks = [block for block in filtered(text, Offset(None, in_place=in_place)) if block.elements]
    made = [element for block in blocks for element in block.elements]
    assert all(a.end == b.start for a, b in pairwise(made))
    assert made[-2].end == (20.0, 50.0 + (0.0 if in_place else wrong_mm), 100.0)
    assert made[-1].end == (0.0, 0.0, 100.0)
    said = {block.number: block.text.text for block in blocks if block.text is not None}
    assert list(said) == ([210] if wrong_mm else [])
    if wrong_mm:
        assert ("plane_change_in_place" if in_place else "wrong by 5 mm") in said[210]


@shows("bwo900-7.2-7")
def test_g40_without_a_path_and_a_move_across_the_new_plane() -> None:
    """Y is across Z X, and it is the offset's axis, too."""
    made = corrected(f"{HEAD}N200 G40 Z100|N210 G18 Y50|N220 X0 Y0|N230 M30")
    assert [element.end for element in made[-2:]] == [(30.0, 55.0, 100.0), (0.0, 0.0, 100.0)]


@shows("bwo900-7.2-7", "bwo900-7.2-13")
def test_g40_without_a_path_in_the_same_plane_ends_where_it_should() -> None:
    made = corrected(f"{HEAD}N200 G40 Z100|N210 X20 Y50|N220 M30")
    assert made[-1].end == (20.0, 50.0, 100.0)


@shows("bwo900-7.2-7")
def test_at_the_control_the_place_is_wrong_and_said() -> None:
    for settings, y in (({}, 55.0), ({"plane_change_in_place": True}, 50.0)):
        desk = fresh("P1|" + HEAD + "N200 G40 Z10|N210 G18 X20 Y50|N220 M30", settings=settings)
        start(desk)
        desk.finish()
        assert mm(desk) == (20.0, y, 10.0)
        assert any("G40 without a path" in text for _, text in desk.remarks)


@shows("bwo900-7.2-8")
def test_synchronising_is_not_allowed_with_correction() -> None:
    """M1229: M01 and whatever else analysis waits for, at the block that says so."""
    head, tail = "N10 F500 tr:2|N20 G41 G1 X10|N30 X30|", "|N50 X50|N60 G40 X70|N70 M30"
    for words, settings in (
        ("N40 M01", {}),
        ("N40 T2 M6", POOL),
        ("N40 M41.50", {"p11060": float(0x10 << 8)}),
    ):
        error = refused(head + words + tail, **settings)
        assert (error.number, error.column > 0) == (1229, True)
    assert corrected(head + "N40 G40 X40 M01|N45 G41 X45" + tail)


@shows("bwo900-7.2-9")
def test_the_axis_of_the_length_is_the_plane_s_third() -> None:
    """With the free plane G117 (P8840) too."""
    done = analysed("N5 P8840:$00020103;|N10 G117 tl:80|N30 G0 X1 Y2 Z3|N40 M30")
    assert done.points[-1] == pytest.approx((1.0, 82.0, 3.0))


@shows("bwo900-7.2-10")
def test_a_quadrant_moves_nothing() -> None:
    plain = corrected("N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 G40 X50|N50 M30")
    for quadrant in range(10):
        made = corrected(f"N10 F500 tr:2 tq:{quadrant}|N20 G41 G1 X10|N30 X30|N40 G40 X50|N50 M30")
        assert [e.end for e in made] == [e.end for e in plain]


@shows("bwo900-7.2-12", "bwo900-7.2-13")
def test_moves_across_the_plane_with_correction() -> None:
    """Outside: after the arc about the corner at (30, 0); inside: where both meet."""
    head, tail = "N10 F500 tr:2|N20 G41 G1 X10|N30 X30|N40 Z-5|", "|N60 G40|N70 Z5|N80 M30"
    outside = corrected(head + "N50 Y-20" + tail)
    assert [e.end for e in outside[2:4]] == [pytest.approx((32.0, 0.0, 0.0)), pytest.approx((32.0, 0.0, -5.0))]
    inside = corrected(head + "N50 Y20" + tail)
    assert [e.end for e in inside[1:]] == [(28.0, 2.0, 0.0), (28.0, 2.0, -5.0), (28.0, 20.0, -5.0), (28.0, 20.0, 5.0)]


@shows("bwo900-7.2-14")
@pytest.mark.parametrize("between", ["N40 M28.2", "/N40 P1:1", "N40 M24.2|N41 M25", "N40 M8"])
def test_a_corner_does_not_depend_on_what_is_analysed_in_between(between: str) -> None:
    made = corrected(
        f"P1|N10 F500 tr:2|N20 G41 G1 X10|N30 X30|{between}|N50 Y20|N60 G40 X0|N70 M30|P2|N10 P2:1|N20 M30"
    )
    assert [e.end[:2] for e in made] == [(10.0, 2.0), (28.0, 2.0), (28.0, 20.0), (0.0, 20.0)]


@shows("bwo900-7.4-2")
def test_another_radius_on_a_circle() -> None:
    """About (20, 10): from 8 mm to 6 mm, the tool inside."""
    made = corrected("N10 F500 tr:2|N20 G41 G1 X10|N30 X20|N40 tr:4 G3 X30 Y10 I20 J10|N50 G1 Y30|N60 G40 X0|N70 M30")
    assert [e.end[:2] for e in made[1:4]] == [(20.0, 2.0), pytest.approx((26.0, 10.0)), pytest.approx((26.0, 30.0))]
    assert made[2].point(0.5)[:2] == pytest.approx((20.0 + 7.0 * 0.5**0.5, 10.0 - 7.0 * 0.5**0.5))


@shows("bwo900-7.1-35")
def test_what_is_not_done_with_tools() -> None:
    done = analysed("N10 tl:80 P8154:500 P8165:7|N20 G0 X1 Y2 Z3|N30 M30")
    assert done.points == [(1.0, 2.0, 83.0)]


@shows("bwo900-7.2-11")
def test_tools_of_different_radii_follow_each_other() -> None:
    """T3 with 5 mm for T2 with 3 mm, on the way."""
    made = corrected("N10 F500 T2 M16|N20 G41 G1 X10|N30 X30|N40 T3 M16 X50|N50 X70|N60 G40 X90|N70 M30", **POOL)
    assert [e.end[1] for e in made] == [3.0, 3.0, 5.0, 5.0, 0.0]
