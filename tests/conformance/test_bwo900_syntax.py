"""BWO 900, chapter 3, from the manual by another hand: programs, blocks, words, operators, texts, waituntil, feed."""

from __future__ import annotations

import pytest
from conformance.bwo900_desk import T1, analysed, file, fresh, mm, parameters, run, said, start, value
from conformance.rows import case, shows
from firmware.bwo900.run import Analysed

from isel_twin.firmware.bwo900.messages import ProgramError


def refused(text: str, **values: float) -> int:
    with pytest.raises(ProgramError) as error:
        analysed(text, **values)
    return error.value.number


@pytest.mark.parametrize(
    ("lines", "taken"),
    [
        case("bwo900-3.1-1", ("P1234567890", "N10 G0 X5"), True),
        case("bwo900-3.1-1", ("P12345678901", "N10 G0 X5"), False),
        case("bwo900-3.2-3", ("P1", "N9999999999 G0 X5"), True),
        case("bwo900-3.2-3", ("P1", "N10000000000 G0 X5"), False),
        case("bwo900-3.2-3", ("P1", "N" + "9" * 40 + " G0 X5"), False),
        case("bwo900-3.2-4", ("P1", "G0 X5"), False),
        case("bwo900-3.2-4", ("P1", "{a comment} N10 G0 X5"), False),
        case("bwo900-3.2-4", ("q41: 1", "P1", "G0 X5"), True),
        case("bwo900-3.10-8", ("", "", "P1", "", "/N10 X5", "/ N20 X6", ""), True),
    ],
)
def test_what_a_file_may_begin_with(lines: tuple[str, ...], taken: bool) -> None:
    desk = fresh(referenced=False)
    if lines[0][:1] == "q":
        desk.send(file("D", lines[0]))
        lines = lines[1:]
    before = len(desk.flash_log)
    desk.send(file(*lines))
    assert said(desk) == ([] if taken else [1110 if lines[0] == "P12345678901" else 1111])
    assert (len(desk.flash_log) > before) is taken


@pytest.mark.parametrize(
    ("text", "number"),
    [
        case("bwo900-3.5-1", "N10 " + " ".join(f"S{n}:1" for n in (1, 2, 3, 4, 5, 6, 7, 8, 1)), 1222),
        case("bwo900-3.5-2", "N10 T1 T2", 1222),
        case("bwo900-3.5-2", "N10 I1 I2", 1222),
        case("bwo900-3.5-2", "N10 J1 J2", 1222),
        case("bwo900-3.5-2", "N10 K1 K2", 1222),
        case("bwo900-3.5-2", "N10 R1 R2", 1222),
        case("bwo900-3.5-3", "N10 T12345678901", 1211),
        case("bwo900-3.5-3", "N10 T1.5", 1211),
        case("bwo900-3.5-3", "N10 G12345678901", 1202),
        case("bwo900-3.5-3", "N10 G1.5 X5", 1211),
        case("bwo900-3.3-3", "N10 " + " ".join(f"q{n}:1" for n in range(1, 34)), 1208),
        case("bwo900-3.6-33", "N10 P500:SIN(90)", 1211),
        case("bwo900-3.6-33", "N10 P500:Sqr(4)", 1211),
    ],
)
def test_limits_of_words(text: str, number: int) -> None:
    assert refused(text + "|N90 M30", **T1) == number


@shows("bwo900-3.5-1", "bwo900-3.5-3", "bwo900-3.5-5")
def test_what_words_may_hold() -> None:
    done = analysed("N10 " + " ".join(f"S{n}:{n}.5" for n in range(1, 9)) + "|N20 G1 F100.25 X1.125 Y-0,5|N30 M30")
    assert dict(done.blocks[0].speeds) == {n: n + 0.5 for n in range(1, 9)}
    assert (done.path[0].feed_mm_min, done.points) == (100.25, [(1.125, -0.5, 0.0)])
    assert refused("N10 T1234567890|N20 M30", **T1) == 1050  # ten digits: read, and not found


@shows("bwo900-3.5-4")
def test_radius_and_centre_are_modal() -> None:
    done = analysed("N10 G2 F100 X10 R5|N20 X20|N30 G0 X30|N40 G2 X40 R10|N50 M30")
    assert [round(block.elements[0].length_mm, 3) for block in done.path] == [15.708, 15.708, 10.0, 10.472]
    for plane, first, second in (("G17", "X5 Y5", "I0 J5"), ("G18", "Z5 X5", "K0 I5"), ("G19", "Y5 Z5", "J0 K5")):
        done = analysed(f"N10 {plane} G91 G3 F100 {first} {second}|N20 {first}|N30 M30")
        assert [round(block.elements[0].length_mm, 3) for block in done.path] == [7.854, 7.854], plane
    done = analysed("N10 G91 G3 F100 X5 Y5 I0 J5|N20 X-5 Y5 I-5 J0|N30 X-5 Y5 I0 J5 G2|N40 X5 Y5 I5 J0|N50 M30")
    assert [round(block.elements[0].length_mm, 3) for block in done.path] == [7.854] * 4, "until others are written"


@pytest.mark.parametrize(
    ("text", "before", "result"),
    [
        case("bwo900-3.6-7", "- -", 5, None),
        case("bwo900-3.6-7", "-- P501:7", 5, None),
        case("bwo900-3.6-7", "-", 5, None),
        case("bwo900-3.6-14", "-P501", 5, -3.0),
        case("bwo900-3.6-14", "-(P501+1)", 5, -4.0),
        case("bwo900-3.6-14", "2+3*4", 5, 14.0),
        case("bwo900-3.6-15", "P501 | 2", 5, 1.0),
        case("bwo900-3.6-16", "cos(60)", 5, 0.5),
        case("bwo900-3.6-16", "tan(45)", 5, 1.0),
        case("bwo900-3.6-16", "asin(0.5)", 5, 30.0),
        case("bwo900-3.6-16", "acos(P502)", 5, 90.0),
        case("bwo900-3.6-17", "P500 or $100;", 0x2001, 0x2101),
        case("bwo900-3.6-17", "P500 and $3000;", 0x2101, 0x2000),
        case("bwo900-3.6-17", "not P500", 5, -6.0),
    ],
)
def test_what_a_parameter_may_be_set_to(text: str, before: float, result: float | None) -> None:
    done = Analysed(f"N10 P500:{text}\nN20 M30", p500=before, p501=3, p502=0)
    if result is None:
        assert not done.parameters.loaded(500)
    else:
        assert done.parameters.get(500) == pytest.approx(result)


@shows("bwo900-3.6-4")
def test_comments_in_brackets() -> None:
    assert analysed("N10 (X7) G0 {Y8} X5 (Ende)|N20 M30").points == [(5.0, 0.0, 0.0)]
    assert refused("N10 G0 X5 (Ende|N20 M30") == 1210
    assert refused("N10 G0 X5 {Ende|N20 M30") == 1210


@shows("bwo900-3.6-5")
def test_the_printed_hexadecimal_block_with_lines() -> None:
    assert analysed("N10 G01 F1000 P500 : $1AF; X: P500|N20 P501:$ff; M30").parameters.get(501) == 255.0


@shows("bwo900-3.6-20")
def test_printed_indices_of_symbols() -> None:
    done = analysed(
        "N5 _wegx ::= 500;|N10 _wegx[0] := 10; { d.h. P500:10 }|N20 _wegx[1] := 11; { d.h. P501:11 }|N30 M30"
    )
    assert (done.parameters.get(500), done.parameters.get(501)) == (10.0, 11.0)


@shows("bwo900-3.6-19")
def test_symbols_tell_capitals_and_have_30_characters() -> None:
    long = "_" + "a" * 30
    done = analysed(f"N10 _karl:=5 _Karl:=6 {long}:=7|N20 P1:_karl P2:_Karl P3:{long}|N30 M30")
    assert [done.parameters.get(n) for n in (1, 2, 3)] == [5.0, 6.0, 7.0]


@shows("bwo900-3.6-34")
def test_internal_variables_live_as_long_as_their_program() -> None:
    desk = fresh("P1|N10 P1:_a|N20 _a:=5|N30 M28.2|N40 M30", "P2|N10 P2:_a M02")
    for _ in range(2):
        start(desk)
        desk.finish()
        assert (value(desk, 1), value(desk, 2)) == (0.0, 5.0)


@shows("bwo900-3.6-24")
def test_a_printed_text_is_shown_as_its_block_is_executed() -> None:
    """Halfway of 2 mm at 10 mm/s with ramps of 25 ms (400 mm/s^2): 1 mm takes 0.1 s and half a ramp."""
    desk = run("P1|N10 G01 F600 X1|N20 ! Das ist ein Meldungstext|N30 X2|N40 M30")
    time_ns, text = desk.remarks[-1]
    assert text == "P1 N20: Das ist ein Meldungstext"
    assert (desk.steps.t_ns[-1] - time_ns) / 1e9 == pytest.approx(0.1125, abs=0.002)


@pytest.mark.parametrize("code", [case("bwo900-3.6-36", "0"), case("bwo900-3.6-36", "1"), case("bwo900-3.6-36", "$8E")])
def test_a_code_before_a_comma_is_no_text(code: str) -> None:
    """It is taken off, but a text is shown without colours (bwo900/48)."""
    desk = run(f"P1|N10 !{code}, Das ist ein Meldungstext|N20 M30")
    assert [text for _, text in desk.remarks] == ["P1 N10: Das ist ein Meldungstext"]


@shows("bwo900-3.6-25")
def test_a_text_stands_last_beside_other_words() -> None:
    """The printed `M33 P1:23 !` does the rest of its block and shows nothing; what follows `!` is no word."""
    desk = run("P1|N10 M33 P1:23 !|N20 P2:1 ! P2:5 M30|N30 M30", p1=1)
    assert (value(desk, 1), value(desk, 2)) == (23.0, 1.0)
    assert [text for _, text in desk.remarks] == ["P1 N20: P2:5 M30"]


@shows("bwo900-3.6-35")
def test_hand_and_an_empty_text_say_nothing_of_texts() -> None:
    desk = run("P1|N10 !steht da|N20 !|N30 M30")
    desk.send(parameters(p8683=1))
    assert [text for _, text in desk.remarks] == ["P1 N10: steht da"]


@pytest.mark.parametrize(
    ("jumps", "goal"),
    [
        case("bwo900-3.6-37", "P500=1.50 P500=1.60", 50),
        case("bwo900-3.6-37", "P500=2.50 P500=1.60", 60),
        case("bwo900-3.6-37", "P500=2.50 P500=3.60", 20),
        case("bwo900-3.6-37", "M23.50 M23.60", 50),
        case("bwo900-3.6-37", "M23.50 P500=1.60", 60),
        case("bwo900-3.6-26", "P500=2.50 P500:2", 50),
    ],
)
def test_jumps_in_their_order(jumps: str, goal: int) -> None:
    done = analysed(f"N10 {jumps}|N20 P1:20 M30|N50 P1:50 M30|N60 P1:60 M30", p500=1)
    assert done.parameters.get(1) == goal


@shows("bwo900-3.6-26")
def test_assignments_in_their_order() -> None:
    done = analysed("N10 P1:1 P1:P1+1 P2:P1*2 P1:P1+1|N20 M30")
    assert (done.parameters.get(1), done.parameters.get(2)) == (3.0, 4.0)


@shows("bwo900-3.6-38")
def test_what_goes_to_the_plc_and_in_which_order() -> None:
    """The PLC's side of the border is listened to: its S, T and M, and the parameter as it is then."""
    desk = fresh("P1|N10 G0 X5 M7 T2 S500 P100:7|N20 M30", **T1)
    desk.send(file("D+", "K1:P 100: 0 S:$00000005"))
    plc, parameters_now = desk.controller._plc, desk.controller._parameters  # type: ignore[attr-defined]
    seen: list[tuple[str, float, float]] = []
    names = ("speed", "tool", "function")
    for name, inner in [(name, getattr(plc, name)) for name in names]:

        def listen(*values: float, name: str = name, inner: object = inner) -> None:
            seen.append((name, values[-1], parameters_now.get(100)))
            inner(*values)  # type: ignore[operator]

        setattr(plc, name, listen)
    start(desk)
    desk.finish()
    assert seen == [("speed", 500.0, 7.0), ("tool", 2, 7.0), ("function", 7, 7.0)]


@pytest.mark.parametrize(
    ("condition", "values"),
    [
        case("bwo900-3.6-39", "P500 > P501+P502", {"p500": 4.0, "p501": 1.0, "p502": 2.0}),
        case("bwo900-3.6-39", "P500 > 1234", {"p500": 1235.0}),
        case("bwo900-3.6-39", "P500 <> P501+P502+P503", {"p500": 4.0, "p501": 1.0, "p502": 2.0, "p503": 3.0}),
        case("bwo900-3.6-39", "P[K1,500] > P501", {"p500": 2.0, "p501": 1.0}),
        case("bwo900-3.6-39", "P[K1,500] = q1000", {"p500": 2.0, "q1000": 2.0}),
        case(
            "bwo900-3.6-23",
            "P1+P2+P3+P4 < P5+P6+P7+P8",
            dict.fromkeys((f"p{n}" for n in range(1, 8)), 0.0) | {"p8": 1.0},
        ),
    ],
)
def test_printed_conditions(condition: str, values: dict[str, float]) -> None:
    program = f"N100 waituntil {condition}|N110 P9:1|N120 M30"
    assert analysed(program, **values).parameters.get(9) == 1.0
    last = next(iter(values))
    assert not analysed(program, **{**values, last: -5.0, "p8": -9.0}).parameters.loaded(9) or "<>" in condition


@shows("bwo900-3.6-39")
def test_a_condition_without_a_value_names_its_block() -> None:
    desk = fresh("P1|N10 G0 X5|N20 waituntil P500 > 5|N30 X7|N40 M30", p500=1)
    start(desk)
    desk.run(2.0)
    desk.send(file("D", "K1:P500: --"))
    desk.finish()
    assert [text for _, text in desk.remarks] == ["M1300 P1 N20 column 1: parameter deleted or never set (P500)"]


@pytest.mark.parametrize(
    "waits", ["waituntil P500>1", "sc:1|N30 P500>1.60|N40 M23.30|N60 sc:0", "sc:2|N30 P500>1.60|N40 M23.30|N60 sc:0"]
)
@pytest.mark.parametrize("how", ["stop", "override", "abort"])
@shows("bwo900-3.6-40")
def test_supervision_goes_with_stop_start_and_abort(waits: str, how: str) -> None:
    desk = fresh(f"P1|N10 G1 F3000 X50|N20 {waits}|N70 Y10|N80 M30", p500=0)
    start(desk)
    desk.run(0.5)
    desk.send({"stop": parameters(p8684=0), "override": parameters(p11310=0), "abort": parameters(p8705=1)}[how])
    desk.run(1.0)
    held = mm(desk)
    desk.run(1.0)
    assert mm(desk) == held
    desk.send(parameters(p500=2))
    desk.run(0.1)
    assert mm(desk) == held
    if how != "abort":
        desk.send(parameters(p11310=100) if how == "override" else parameters(p8684=1))
    desk.finish()
    assert mm(desk) == ((50.0, 10.0, 0.0) if how != "abort" else held)


@shows("bwo900-3.6-41")
def test_a_program_begins_without_supervision() -> None:
    desk = fresh("P1|N10 sc:1|N20 G0 X5|N30 M23.30", "P2|N10 G0 Y5|N20 M30")
    start(desk)
    desk.run(1.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    desk.send(parameters(p8705=1))
    start(desk, 2)
    desk.finish()
    assert mm(desk) == (0.0, 5.0, 0.0)


@shows("bwo900-3.6-41")
def test_functions_do_not_stay_in_supervision() -> None:
    desk = fresh("P1|N10 G1 F600 X50|N20 sc:1|N30 M7|N40 P500>1.60|N50 M23.40|N60 sc:0|N70 M30", p500=0)
    start(desk)
    desk.run(7.0)
    assert (mm(desk)[0], desk.outputs["a0.3"], value(desk, 8685)) == (50.0, 1, 2.0)


@shows("bwo900-3.7-1")
def test_printed_feed_and_its_end() -> None:
    done = analysed("N50 G0 X400|N60 G1 F6000 f1000 X5600|N70 X5700|N80 M30")
    assert [(b.feed_mm_min, b.end_feed_mm_min) for b in done.path] == [(None, None), (6000.0, 1000.0), (6000.0, None)]


@shows("bwo900-3.7-5")
def test_inches_are_refused() -> None:
    assert refused("N10 G170 F10|N20 M30") == 1232


@pytest.mark.parametrize("percent", [0, 50, 120])
@shows("bwo900-3.7-6")
def test_the_override_changes_the_feed(percent: float) -> None:
    desk = fresh("P1|N10 G1 F1200 X60|N20 M30", p11310=percent)
    start(desk)
    desk.run(2.0)
    before = mm(desk)[0]
    desk.run(0.5)
    assert mm(desk)[0] - before == pytest.approx(1200 / 60 * 0.5 * percent / 100, abs=2e-3)


@shows("bwo900-3.8-4")
def test_speeds_go_to_the_plc_as_programmed() -> None:
    desk = run("P1|N10 S1000 M3|N20 M30", p11315=50)
    assert int.from_bytes(desk.controller._plc._memory.m[34:36], "little") == 1000  # type: ignore[attr-defined]
