"""BWO 900: what the PLC asks for beside a program (7.1, 8.4, 8.5, 8.7), once more from the manual's text, and together
with what else can happen meanwhile."""

from __future__ import annotations

import math

import pytest
from conformance.bwo900_desk import (
    REFERENCE,
    T1,
    analysed,
    file,
    fresh,
    mm,
    parameters,
    put_out,
    run,
    said,
    start,
    value,
)
from conformance.rows import shows

from isel_twin import Twin
from isel_twin.testing import Desk

Z6 = "Z6|N10 P500:0|N20 G53 G0 X15 M01|N30 P8047:1|N40 P8045:1|N50 P500:1|N60 M30"


def spindle_tool(desk: Desk) -> tuple[float, float]:
    """Group of the tool in the spindle, and of the one that reckons."""
    return value(desk, 8100), value(desk, 8150)


# P8041, P8043: tools in HAND


def in_hand() -> Desk:
    desk = fresh(Z6, p500=-1, p8100=0, p8150=0, **T1)
    desk.send(parameters(p8683=1))
    return desk


@shows("bwo900-7.1-34")
def test_a_change_moves_and_comes_back_to_hand_again_and_again() -> None:
    desk = in_hand()
    for tool in (2.0, 1.0):
        desk.send(parameters(p8043=tool))
        desk.finish()
        assert spindle_tool(desk) == (tool, tool)
        assert (value(desk, 500), value(desk, 8683), said(desk)) == (1.0, 1.0, [])
    assert mm(desk)[0] == 15.0


@pytest.mark.parametrize("key", [{"p8705": 1.0}, {"p8682": 1.0}])
def test_a_change_that_is_held_or_broken_off(key: dict[str, float]) -> None:
    """Abort: the old tool stays, and a change in HAND is possible again. Stop: Start ends the change."""
    desk = in_hand()
    desk.send(parameters(p8043=2))
    desk.run(0.1)
    desk.send(parameters(**key))
    desk.finish()
    assert (spindle_tool(desk)[0], value(desk, 500)) == (0.0, 0.0)
    if "p8705" in key:
        assert 0.0 < mm(desk)[0] < 15.0
        desk.send(parameters(p8683=1, p8508=1))
        desk.send(parameters(p8043=2))
    else:
        desk.send(parameters(p8682=0))
        desk.send(parameters(p8684=1))
    desk.finish()
    assert (spindle_tool(desk), mm(desk)[0], value(desk, 500)) == ((2.0, 2.0), 15.0, 1.0)


def machine() -> Twin:
    twin = Twin(controller="bwo900", machine="4030-servo", plant="kinematic", start_mm=(6, 6, 6), seed=2)
    twin.write(file(*Z6.replace("X15", "X60").split("|")) + parameters(p8043=0, **T1) + REFERENCE)
    twin.run_until_idle(60.0)
    return twin


@shows("bwo900-2.3-8")
@pytest.mark.parametrize(("contact", "off", "on"), [("estop", "pressed", "released"), ("power", "off", "on")])
def test_reference_points_after_an_emergency_stop(contact: str, off: str, on: str) -> None:
    """2.3 asks for reference runs after switching on: with drives back a program begins where the axes are known."""
    desk = fresh("P1|N10 G1 F600 X20|N20 M30")
    start(desk)
    desk.run(0.6)
    desk.set(contact, off)
    desk.run(0.5)
    held = mm(desk)[0]
    desk.set(contact, on)
    assert [value(desk, n) for n in (8579, 12_180, 12_380, 12_580)] == [1.0] * 4
    desk.send(parameters(p8683=1, p8508=1))
    start(desk)
    desk.finish()
    assert 0.0 < held < 20.0
    assert (mm(desk)[0], len(said(desk))) == (20.0, 1)


def test_a_change_in_hand_goes_on_after_save_and_ends_with_an_emergency_stop() -> None:
    """Saved in the middle of Z6: the copy makes the same move. E-stop: it is over, nothing
    moves after the release, and the next change is whole."""
    twin = machine()
    twin.write(parameters(p8683=1))
    twin.write(parameters(p8043=2))
    twin.run(0.4)
    middle = twin.machine_position_mm[0]
    saved = twin.save()
    twin.run_until_idle(30.0)
    end = tuple(twin.machine_position_mm)
    assert 6.0 < middle < end[0] == pytest.approx(65.0, abs=0.01)
    twin.restore(saved)
    assert twin.machine_position_mm[0] == middle
    twin.run_until_idle(30.0)
    assert tuple(twin.machine_position_mm) == end
    twin.restore(saved)
    twin.set_input("estop", "pressed")
    twin.run(1.0)
    held = tuple(twin.machine_position_mm)
    twin.set_input("estop", "released")
    twin.write(parameters(p8683=1, p8508=1))
    twin.run(2.0)
    assert tuple(twin.machine_position_mm) == held
    assert held[0] < end[0] - 10.0
    twin.write(parameters(p8043=2))
    twin.run_until_idle(30.0)
    assert twin.machine_position_mm[0] == pytest.approx(65.0, abs=0.01)


# P8870, P8871


@shows("bwo900-8.5-75")
def test_length_of_a_helix_and_of_its_shadows() -> None:
    """A full circle of radius 8 while Z goes 6 deep: 2 pi 8 in XY, 4 x 8 in X, with Z the helix."""
    for mask, length in ((3, 16 * math.pi), (1, 32.0), (4, 6.0), (7, math.hypot(16 * math.pi, 6.0)), (0, 0.0)):
        desk = fresh("P1|N10 G0 X20 Y20 Z10 M1|N20 P8870:" + str(mask) + " M1|N30 G2 F3000 X20 Y20 Z16 I28 J20|N40 M30")
        start(desk)
        desk.finish()
        assert value(desk, 8871) == pytest.approx(length, rel=1e-5, abs=1e-9)


# P8812


@shows("bwo900-8.5-30")
@pytest.mark.parametrize("off", ["0", "--"])
def test_without_moving_an_end_is_where_the_axes_stand(off: str) -> None:
    """The next program with motion starts from where the axes are, and comes to its places."""
    desk = run("P1|N10 G0 X25 Y12|N20 G91 X5|N30 M30", p8812=1.0)
    assert mm(desk) == (0.0, 0.0, 0.0)
    desk.send(file("D", f"K1:P 8812: {off}"))
    start(desk)
    desk.finish()
    assert (mm(desk), said(desk)) == ((30.0, 12.0, 0.0), [])


# P12137


@shows("bwo900-8.7-23")
def test_abort_of_a_program_whose_axis_is_locked() -> None:
    """It waits for good without a message; abort ends it, and the other direction is free."""
    desk = fresh("P1|N10 G1 F3000 X-2|N20 M30", "P2|N10 G1 F3000 X5|N20 M30", p12137=256.0)
    start(desk)
    desk.run(2.0)
    assert (mm(desk)[0], value(desk, 8687), said(desk)) == (0.0, 1.0, [])
    desk.send(parameters(p8705=1))
    desk.finish()
    desk.send(parameters(p8508=1))
    start(desk, 2)
    desk.finish()
    assert mm(desk)[0] == 5.0


@shows("bwo900-8.7-23")
@pytest.mark.parametrize(("lock", "ends"), [
    ({"p12137": 1}, (0, 2)), ({"p12137": 256}, (2, 0)), ({"p12137": 257}, (0, 0)), ({"p12137": 0}, (2, 2)),
    ({"p12337": 257}, (2, 2)),
])  # fmt: skip
def test_each_byte_locks_its_direction_of_its_axis_in_hand(lock: dict[str, float], ends: tuple[int, int]) -> None:
    """Byte 1: no travel in +, byte 2: none in -. Steps of 1 mm with X at 10; a step that is held begins with the
    lock's end."""
    for key, moves in zip((1, 2), ends, strict=True):
        desk = fresh("P1|N10 G0 X10|N20 M30")
        start(desk)
        desk.finish()
        desk.send(parameters(p8683=1, p8750=2, p8751=1, p8760=2, **lock))
        desk.send(parameters(p8752=key))
        desk.run(2.0)
        sign = 1 if key == 1 else -1
        assert (mm(desk)[0], said(desk)) == (10.0 + sign * moves, [])
        desk.send(parameters(**dict.fromkeys(lock, 0.0)))
        desk.finish()
        assert mm(desk)[0] == 10.0 + sign * 2


@shows("bwo900-8.7-23")
@pytest.mark.parametrize(("lock", "g"), [(1, 3), (256, 3), (1, 2), (256, 2)])
@pytest.mark.parametrize("turns_in", ["X", "Y"])
def test_half_a_circle_goes_in_both_directions(lock: int, g: int, turns_in: str) -> None:
    """There and back in the axis in which it bulges; X and Y of the start are those of the end but for the diameter."""
    end, centre = ("X10 Y20", "I10 J15") if turns_in == "X" else ("X20 Y10", "I15 J10")
    desk = fresh(f"P1|N10 G0 X10 Y10|N20 M00|N30 G{g} F6000 {end} {centre}|N40 M30")
    start(desk)
    desk.finish()
    desk.send(parameters(**{"p12137" if turns_in == "X" else "p12337": float(lock)}))
    desk.send(parameters(p8684=1))
    desk.run(3.0)
    assert (mm(desk)[:2], value(desk, 8687), said(desk)) == ((10.0, 10.0), 1.0, [])


@shows("bwo900-8.7-23")
def test_locks_of_y_and_z_are_theirs() -> None:
    """P12337 and P12537 are those of the second and third axis: 200 parameters each (8.7)."""
    for lock, waits in (({"p12337": 1}, "N20 Y5"), ({"p12537": 1}, "N20 Z5")):
        desk = fresh(f"P1|N10 G0 X5|{waits}|N30 M30", **lock)
        start(desk)
        desk.run(4.0)
        assert (mm(desk), value(desk, 8687)) == ((5.0, 0.0, 0.0), 1.0)


# P8041, P8043, P8044, once more


@shows("bwo900-7.1-34")
@pytest.mark.parametrize("lock", ["0", "--"])
def test_0_or_deleted_allows_the_change_and_1_does_not(lock: str) -> None:
    desk = in_hand()
    desk.send(parameters(p8041=1))
    desk.send(parameters(p8043=2))
    desk.finish()
    assert (mm(desk)[0], spindle_tool(desk), value(desk, 8683)) == (0.0, (0.0, 0.0), 1.0)
    desk.send(file("D", f"K1:P 8041: {lock}"))
    desk.send(parameters(p8043=2))
    desk.finish()
    assert (mm(desk)[0], spindle_tool(desk)) == (15.0, (2.0, 2.0))


@shows("bwo900-7.1-34")
def test_both_records_are_there_before_z6_which_runs_in_auto() -> None:
    """Z6 itself keeps what it finds in P8050, P8060, P8200 and P8688."""
    z6 = "Z6|N10 P501:P8050 P502:P8060|N20 P503:P8200 P504:P8688|N30 P8045:1|N40 M30"
    desk = fresh(z6, p501=0, p502=0, p503=0, p504=0, **T1)
    desk.send(parameters(p8683=1))
    desk.send(parameters(p8043=2))
    desk.finish()
    assert [value(desk, n) for n in (501, 502, 503, 504, 8688)] == [2.0, 3.0, 2.0, 2.0, 1.0]


@shows("bwo900-7.1-34")
@pytest.mark.parametrize("sub_record", ["0", "1", "--"])
def test_the_main_record_is_0_1_or_deleted(sub_record: str) -> None:
    desk = in_hand()
    desk.send(file("D", f"K1:P 8044: {sub_record}"))
    desk.send(parameters(p8043=2))
    desk.finish()
    assert (spindle_tool(desk), said(desk)) == ((2.0, 2.0), [])


@shows("bwo900-7.1-34")
def test_a_tool_that_is_not_found_is_a_message_and_t0_clears_both_records() -> None:
    desk = in_hand()
    desk.send(parameters(p8043=2))
    desk.finish()
    desk.send(parameters(p8043=7))
    desk.finish()
    assert len(said(desk)) == 1
    assert [value(desk, n) for n in (8050, 8060, 8200, 8683)] == [2.0, 3.0, 2.0, 1.0]
    desk.send(parameters(p8508=1))
    desk.send(parameters(p8043=0))
    desk.finish()
    told = put_out(desk)
    assert [told.get(n + 8_000, 0.0) for n in (*range(8050, 8070), *range(8200, 8220))] == [0.0] * 40


# P8828


@shows("bwo900-8.5-74")
@pytest.mark.parametrize(("modified", "stops"), [(0, True), (1, False), (2, True), (3, False), (256, True)])
def test_only_bit_0_of_byte_1_gives_m00_to_the_plc(modified: int, stops: bool) -> None:
    desk = run("P1|N10 G0 X5|N20 M0|N30 X8|N40 M30", p8828=float(modified))
    assert (mm(desk)[0], value(desk, 8685)) == ((5.0, 1.0) if stops else (8.0, 0.0))


@shows("bwo900-8.5-74")
def test_it_changes_m00_alone() -> None:
    """M01 synchronises, M24 and M25 repeat, M30 ends as ever; a block of single block stops."""
    text = "P1|N10 G0 X1|N20 M24.2 M01|N30 G91 X1 M25|N40 M30"
    plain, modified = run(text), run(text, p8828=1)
    assert mm(plain) == mm(modified)
    assert value(modified, 8687) == 0.0
    desk = run("P1|N10 G0 X5|N20 M00|N30 X8|N40 M30", mode=4, p8828=1)
    assert mm(desk)[0] == 5.0


# P8870, P8871, once more


@shows("bwo900-8.5-75")
def test_a_life_of_a_tool_over_programs_planes_and_directions() -> None:
    """5 there, 5 back in Z; 20 in X, and a quarter of a circle of radius 6: 3 pi in Z and X; 2 there and 2 back."""
    desk = fresh(
        "P1|N10 G0 Z5|N20 G1 F3000 Z0|N30 M30",
        "P2|N10 G18 G0 X20|N20 G3 F3000 X14 Z6 I20 K6|N30 M30",
        "P3|N10 G91 G1 F3000 X2|N20 Y7|N30 X-2|N40 M30",
        p8870=5,
    )
    lengths = []
    for number in (1, 2, 3):
        start(desk, number)
        desk.finish()
        lengths.append(value(desk, 8871))
    assert said(desk) == []
    assert lengths == pytest.approx([10.0, 30.0 + 3.0 * math.pi, 34.0 + 3.0 * math.pi], abs=1e-3)


@shows("bwo900-8.5-75")
def test_a_program_may_write_the_mask_and_read_the_length() -> None:
    """Every write of P8870 clears P8871, also with the same value. N15: analysis is ahead."""
    text = "P1|N10 G0 X4|N15 M01|N20 P8870:1 M01|N30 X10|N40 M01|N50 P501:P8871|N60 P8870:1 M01|N70 P502:P8871|N80 M30"
    desk = run(text, p501=-1, p502=-1, p8870=3)
    assert (value(desk, 501), value(desk, 502)) == (6.0, 0.0)


# M16


@shows("bwo900-7.1-29", "bwo900-7.1-30")
def test_m16_and_the_record_of_the_spindle() -> None:
    """M16 with T fills the record that reckons (P501, P503, P504), T0 clears it, M16 alone leaves it; the spindle's is
    never touched, and is what reckons at the end of a program (7.1)."""
    text = "P1|N10 T2 M16|N20 P501:P8150 P502:P8100|N30 M16|N40 P503:P8160|N50 T0 M16|N60 P504:P8150|N70 M30"
    desk = run(text, p501=-1, p502=-1, p503=-1, p504=-1, p8100=1, p8110=7, p8150=0, **T1)
    assert [value(desk, n) for n in (501, 502, 503, 504)] == [2.0, 1.0, 3.0, 0.0]
    assert [value(desk, n) for n in (8100, 8110, 8150, 8160)] == [1.0, 7.0, 1.0, 7.0]


@shows("bwo900-7.1-29")
def test_the_length_of_m16_acts_from_the_end_of_its_block() -> None:
    """T2 is 10 mm long: the block of M16 itself goes to Z5, the next one to 5 + 10."""
    desk = fresh(
        "P1|N10 G0 Z5 T2 M16|N20 M01|N30 M00|N40 Z5|N50 M30",
        p21031=10,
        **{k: v for k, v in T1.items() if k != "p21031"},
    )
    start(desk)
    desk.finish()
    assert mm(desk)[2] == 5.0
    desk.send(parameters(p8684=1))
    desk.finish()
    assert mm(desk)[2] == 15.0


# EX-31, EX-33 of the manual: 8.5 (words of drilling cycles), 8.6 (numbers of axis cards)


@shows("bwo900-5.3-9")
@pytest.mark.parametrize("cycle", [81, 83, 84, 85])
@pytest.mark.parametrize(
    ("plane", "depth", "approach", "retract"), [(17, "Z", "R", "K"), (18, "Y", "R", "J"), (19, "X", "R", "I")]
)
def test_words_of_a_drilling_cycle_are_parameters(
    cycle: int, plane: int, depth: str, approach: str, retract: str
) -> None:
    """The printed table: F is P32, the depth P33, R P34, the retraction plane P35, H P36, in each of the planes."""
    words = f"F800 {depth}1 {approach}32 {retract}60 H3"
    made = analysed(f"N10 G{plane} S500 M3|N20 P31:1.5 P37:--|N30 G{cycle} {words}|N40 M30", p8806=0x020000)
    assert [made.parameters.get(p) for p in range(32, 37)] == [800.0, 1.0, 32.0, 60.0, 3.0]


@shows("bwo900-8.6-12")
@pytest.mark.parametrize("offset", [0, 1])
def test_numbers_of_axis_cards(offset: int) -> None:
    """Printed example: the axes of a first card (ASM) are 1, 2, 3 either way; this machine has no second card."""
    desk = run("P1|N10 G0 X5 Y6 Z7|N20 M30", p11305=float(offset))
    assert (value(desk, 11_305), mm(desk), said(desk)) == (float(offset), (5.0, 6.0, 7.0), [])
    assert [value(desk, 12_199 + 200 * axis) for axis in range(3)] == [1.0, 2.0, 3.0]


# "geplant": what the manual itself only plans


@shows("bwo900-8.5-48")
@pytest.mark.parametrize("kind", [3, 4, 5])
def test_kinds_of_hand_that_are_planned_move_nothing(kind: int) -> None:
    """P8780 on and P8790 on are headed "planned"; 3 needs a hand wheel."""
    desk = fresh(p8683=1, p8750=float(kind), p8751=1, p8755=600, p8780=1, p8782=5, p8790=1, p8793=5)
    desk.send(parameters(p8752=1))
    desk.run(2.0)
    assert (mm(desk), said(desk)) == ((0.0, 0.0, 0.0), [1321])


@shows("bwo900-8.5-49")
@pytest.mark.parametrize("call", [8712, 8713])
def test_emergency_programs_3_and_4_are_planned(call: int) -> None:
    """8.5 describes P8710 and P8711 alone; P8824 to P8827 are "Notprogramm 3, 4 geplant"."""
    desk = fresh("P1|N10 G1 F1200 X20|N20 M30", "P9|N10 G0 Y5|N20 M30", p8824=9, p8826=9)
    start(desk)
    desk.run(0.5)
    desk.send(parameters(**{f"p{call}": 1.0}))
    desk.finish()
    assert (mm(desk), said(desk), value(desk, call)) == ((20.0, 0.0, 0.0), [], 1.0)


# 7.7: inner contours


@shows("bwo900-7.7-1", "bwo900-7.7-2")
@pytest.mark.parametrize("inner", ["N40 X20|N50 Y2|N60 X40|N70 Y30", "N40 X20|N50 Y-3|N60 X30|N70 Y30"])
def test_an_inner_contour_that_the_tool_cannot_follow(inner: str) -> None:
    """7.7: ways too short beside the radius, no intersection: its pictures say message 1223, chapter 9 breaks off."""
    desk = run(f"P1|N10 tr:5 F3000|N20 G41 G1 X0 Y0|N30 X10|{inner}|N80 G40 X60 Y60|N90 M30")
    assert said(desk) in ([1223], [1152])
    assert value(desk, 8687) == 0.0
