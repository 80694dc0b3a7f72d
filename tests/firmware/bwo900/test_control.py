"""The control on the desk: files, modes, start, stop, abort, override, functions, limits, messages."""

from __future__ import annotations

from collections.abc import Sequence

import pytest

from isel_twin.testing import Desk

CARRIAGE = (20_000, 20_000, 20_000)
PROGRAM = "P1|N10 G0 X10 Y10 Z5 F3000|N20 M3 S1200|N30 G1 X60|N40 Y40|N50 G4.0.5|N60 G1 X10 Y10 M5|N70 M30"


def file(*lines: str) -> bytes:
    return "".join(f"{line}\r\n" for line in ("", *lines, "#")).encode() + b"\x04\r\n"


def parameters(**values: float) -> bytes:
    return file("D", *(f"K1:P{name[1:]}: {value}" for name, value in values.items()))


HOMING = parameters(p8683=1, p12530=1, p12330=1, p12130=1)


def desk_with(*programs: str, referenced: bool = True, **before: float) -> Desk:
    desk = Desk.of("bwo900", carriage=CARRIAGE)
    for text in programs:
        desk.send(file(*text.split("|")))
    if referenced:
        desk.send(HOMING)
        desk.finish()
        assert desk.counts == (0, 0, 0)
    if before:
        desk.send(parameters(**before))
    desk.run(0.01)
    return desk


def start(desk: Desk, number: int = 1, mode: int = 2) -> None:
    desk.send(parameters(p8800=number, p8683=mode, p8684=1))


def said(desk: Desk) -> list[str]:
    return [text for _, text in desk.remarks]


def mm(desk: Desk) -> tuple[float, ...]:
    return tuple(count / 1000.0 for count in desk.counts)


def test_a_program_runs_to_its_end() -> None:
    desk = desk_with(PROGRAM)
    start(desk)
    desk.finish()
    assert mm(desk) == (10.0, 10.0, 5.0)
    assert said(desk) == []
    assert [value for _, name, value in desk.output_log if name == "spindle"] == [1, 0]


def test_without_reference_runs_nothing_starts() -> None:
    desk = desk_with(PROGRAM, referenced=False)
    start(desk)
    desk.finish()
    assert said(desk) == ["M1008: the reference points have not been approached (XYZ)"]
    assert desk.counts == (0, 0, 0)


def test_stop_brakes_along_the_path_and_start_goes_on() -> None:
    desk = desk_with("P1|N10 G1 F3000 X100 Y50|N20 M30")
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8684=0))
    desk.run(1.0)
    held = mm(desk)
    assert 0.0 < held[0] < 100.0
    assert held[1] == pytest.approx(held[0] / 2.0, abs=2e-3)
    desk.run(5.0)
    assert mm(desk) == held
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk) == (100.0, 50.0, 0.0)


def test_abort_forgets_the_rest() -> None:
    desk = desk_with("P1|N10 G1 F3000 X100|N20 Y50|N30 M30")
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p8705=1))
    desk.finish()
    assert 0.0 < mm(desk)[0] < 100.0
    assert mm(desk)[1] == 0.0
    start(desk)
    desk.finish()
    assert mm(desk) == (100.0, 50.0, 0.0)


def test_override_scales_the_feed_and_0_holds() -> None:
    def seconds(percent: float) -> float:
        desk = desk_with("P1|N10 G1 F1200 X100|N20 M30", p11310=percent)
        start(desk)
        before = desk.time_ns
        desk.finish()
        return (desk.time_ns - before) / 1e9

    assert seconds(50) == pytest.approx(10.0, rel=0.02)
    assert seconds(100) == pytest.approx(5.0, rel=0.03)
    desk = desk_with("P1|N10 G1 F1200 X100|N20 M30")
    start(desk)
    desk.run(1.0)
    desk.send(parameters(p11310=0))
    desk.run(1.0)
    held = desk.counts
    desk.run(3.0)
    assert desk.counts == held
    desk.send(parameters(p11310=100))
    desk.finish()
    assert mm(desk)[0] == 100.0


def test_single_block_stops_after_each() -> None:
    desk = desk_with("P1|N10 G0 X10|N20 X20|N30 X30|N40 M30")
    start(desk, mode=4)
    seen = []
    for _ in range(3):
        desk.run(3.0)
        seen.append(mm(desk)[0])
        desk.send(parameters(p8684=1))
    assert seen == [10.0, 20.0, 30.0]


def test_measuring_stop_and_dwell() -> None:
    desk = desk_with("P1|N10 G0 X10 M00|N20 G04.2|N30 X20|N40 M30")
    start(desk)
    desk.run(5.0)
    assert mm(desk)[0] == 10.0
    begin = desk.time_ns
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[0] == 20.0
    assert 2.0 < (desk.time_ns - begin) / 1e9 < 3.5


def test_a_wrong_block_is_named_with_its_column() -> None:
    desk = desk_with("P7|N10 G0 X10|N20 G1 X20|N30 M30")
    start(desk, 7)
    desk.finish()
    assert said(desk) == ["M1230 P7 N20 column 8: no feed is programmed"]
    desk = desk_with("P7|N10 G0 X10|N20 G1 F100 Q20|N30 M30")
    start(desk, 7)
    desk.finish()
    assert said(desk) == ["M1216 P7 N20 column 13: unknown axis (Q)"]
    assert mm(desk)[0] == 10.0


def test_emergency_stop_ends_everything_at_once() -> None:
    desk = desk_with("P1|N10 G1 F3000 X100|N20 M30")
    start(desk)
    desk.run(1.0)
    desk.set("estop", "pressed")
    desk.run(0.01)
    there = desk.counts
    desk.run(1.0)
    assert desk.counts == there
    assert said(desk) == ["M3001 P1 N10 column 14: emergency stop"]
    desk.set("estop", "released")
    desk.send(parameters(p8683=1))
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 100.0


def test_a_limit_switch_aborts() -> None:
    desk = desk_with("P1|N10 G1 F6000 X900|N20 M30")
    start(desk)
    desk.finish()
    assert said(desk) == ["M2101 P1 N10 column 14: hardware limit + (X)"]


def test_software_limits() -> None:
    desk = desk_with("P1|N10 G1 F6000 X40|N20 X60|N30 M30", p12030=50)
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 40.0
    assert said(desk) == ["M2103 P1 N20 column 5: software limit + (X)"]


def test_blocks_are_skipped_if_asked() -> None:
    for skip, end in ((0, 20.0), (1, 10.0)):
        desk = desk_with("P1|N10 G0 X10|/N20 X20|N30 M30", p8810=skip)
        start(desk)
        desk.finish()
        assert mm(desk)[0] == end


def test_programs_and_parameters_survive_the_mains() -> None:
    desk = desk_with("P1|N10 G0 X:P500|N20 M30", p500=12.5)
    desk.power_cycle()
    desk.send(HOMING)
    desk.finish()
    start(desk)
    desk.finish()
    assert mm(desk)[0] == 12.5


@pytest.mark.parametrize(
    ("lines", "expected"),
    [
        (
            ("X5", "N10"),
            "M1110: wrong identifier of a file (line 1: 'X5'; a file begins with P or Z and a number, D, W or N)",
        ),
        (("P1", "N20 X1", "N10 X2"), "M1290: block numbers do not rise (N10 after N20, line 3)"),
        (("D", "P1 = 5"), "M1111: a line that has been read makes no sense (line 2: 'P1 = 5')"),
        (("D", "K3:P1: 5"), "M1112: there is no such channel (channel 3)"),
        (("P1", "N10 X" + "1" * 500), "M1113: a line of more than 400 characters (line 2: more than 400 characters)"),
    ],
)
def test_what_is_wrong_with_a_file(lines: Sequence[str], expected: str) -> None:
    desk = Desk.of("bwo900", carriage=CARRIAGE)
    desk.send(file(*lines))
    desk.run(0.1)
    assert said(desk) == [expected]


def test_an_endless_loop_takes_its_time_and_can_be_aborted() -> None:
    desk = desk_with("P1|N10 P500:P500+1 M23.10", p500=0)
    start(desk)
    desk.run(0.3)
    desk.send(parameters(p8705=1))
    desk.run(0.1)
    assert desk.controller.idle


def test_functions_do_not_pile_up() -> None:
    desk = desk_with("P1|N10 M7 M23.10")
    start(desk)
    desk.run(3.0)
    desk.send(parameters(p8705=1))
    desk.run(1.0)
    assert desk.controller.idle


def test_functions_with_halt_wait_for_the_plc() -> None:
    desk = desk_with("P1|N10 G0 X10|N20 M6|N30 X20|N40 M30")
    start(desk)
    before = desk.time_ns
    desk.finish()
    assert mm(desk)[0] == 20.0
    assert (desk.time_ns - before) / 1e9 > 2.0


def test_nothing_moves_further_onto_a_switch_that_is_struck() -> None:
    desk = desk_with("P1|N10 G1 F6000 X900|N20 M30", "P2|N10 G1 F6000 X50|N20 M30")
    start(desk)
    desk.finish()
    there = desk.counts
    for again in (parameters(p8683=1), parameters(p8683=2, p8684=1), parameters(p8683=1, p8751=1, p8752=1)):
        desk.send(again)
        desk.finish()
        assert desk.counts == there
    assert [text.split()[0].rstrip(":") for text in said(desk)] == ["M2101"] * 3
    start(desk, 2)  # off it
    desk.finish()
    assert mm(desk)[0] == 50.0


def test_software_limits_hold_for_what_an_arc_reaches_between_its_ends() -> None:
    """A half circle of radius 20 about (10, 20) from (10, 0): X reaches 30."""
    for limit, runs in ((30.5, True), (29.5, False)):
        desk = desk_with("P1|N10 G1 F3000 X10|N20 G3 X10 Y40 J20 I10|N30 M30", p12030=limit)
        start(desk)
        desk.finish()
        assert (mm(desk)[1] == 40.0) is runs
        assert [text.split()[0] for text in said(desk)] == ([] if runs else ["M2103"])


def test_the_axes_of_one_file_are_referenced_however_slowly_it_comes() -> None:
    desk = Desk.of("bwo900", carriage=CARRIAGE)
    desk.send(file(*PROGRAM.split("|")))
    desk.send(HOMING, byte_time_ns=1_145_833)  # 9600 baud, 8N2
    desk.finish()
    assert desk.counts == (0, 0, 0)
    start(desk)
    desk.finish()
    assert said(desk) == []
    assert mm(desk) == (10.0, 10.0, 5.0)
