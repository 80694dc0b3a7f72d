"""GMI99: what the manual says in passing: defaults, ranges, ends of ranges, what a command leaves alone."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.gmi99_desk import (
    BUSY,
    G91,
    OK,
    PRE,
    READY,
    STATUS,
    TO_0,
    TO_10000,
    TO_20000,
    CardDesk,
    Q,
    assembled,
    command,
    fresh,
    load,
    long,
    moved_s,
    prepared,
    running,
    short,
    word,
)
from conformance.rows import case, shows


def flags(desk: CardDesk, byte: int) -> int:
    """A flag byte."""
    return word(desk, byte) & 0xFF


def record(number: int, *frames: str) -> tuple[str, ...]:
    """Telegrams that record a program."""
    return (command("p", 3, 100, number), *frames, command("p", 3, 101))


# ---- sections 1 and 2 ------------------------------------------------------------------------------------------------


@shows("gmi99-1-3", "gmi99-3.1.1-39")
def test_six_axes_in_one_move() -> None:
    """All slots of N10 = 63: each as far as it was told, all at once; the standard build has three."""
    desk = fresh()
    desk.tell(command("N", 63, 10), command("Q", 63), *PRE[1:], command(0xBF, 600, -500, 400, -300, 200, 6000))
    desk.run(0.2)
    assert all(desk.counts)
    desk.finish()
    assert desk.counts == (600, -500, 400, -300, 200, 6000)


@shows("gmi99-1-3")
def test_a_slot_without_an_axis_is_not_moved() -> None:
    desk = prepared(command(0x88, 100))
    assert desk.controller.fault
    assert desk.ask(STATUS) == READY


@shows("gmi99-6.1.3-11")
@pytest.mark.parametrize("function", ["KF 14", "KF 23", "KF 24", "KF 26", "KF 27", "KH 0100", "KH 0104"])
def test_functions_of_the_plc_that_do_nothing_here(function: str) -> None:
    """The program goes on behind them, and a move is as it was."""
    desk = running(f"OB 1\nL KF 1\nL {function}\nSPA FB 254\nL KB 9\nT MB 40\nBE\n")
    desk.run(0.02)
    assert flags(desk, 40) == 9
    assert desk.ask(command("T", 3, 4)) == long(b"\0")
    assert moved_s(desk, TO_20000) == pytest.approx(2.2, abs=0.0041)


@shows("gmi99-2-4")
def test_a_program_makes_a_reference_run() -> None:
    desk = fresh()
    desk.tell(*record(0, command("Q", 1, 1), command(0x81, 50)), command("N", 1, 10), command("p", 3, 1, 0))
    desk.run(1.0)
    assert desk.status() & 0x90 == 0x90
    desk.finish()
    assert desk.counts[0] == 50
    assert 0 <= desk.carriage[0] < 10_000


@shows("gmi99-2-5")
def test_parameters_of_drives_are_acknowledged_and_have_no_effect() -> None:
    desk = fresh()
    before = desk.ask(command("T", 1, 0, address=2))
    assert desk.tell(command("N", 77, 3, address=2), short(0, address=2), command("B", 9, address=2)) == [OK] * 3
    assert desk.ask(command("T", 1, 0, address=2)) == before
    assert not desk.controller.fault


@shows("gmi99-2.2-5")
@pytest.mark.parametrize("dil", ["11110011", "11111011", "11110111"])
def test_switches_5_and_6_change_nothing_on_the_line(dil: str) -> None:
    assert fresh(dil_switches=dil).tell(Q, STATUS, command("T", 1, 0, address=0)) == [
        OK,
        READY,
        long(b"V\x26\x02", address=0),
    ]


# ---- 3.1.1 -----------------------------------------------------------------------------------------------------------

NORMAL = [
    command("B", 50), command("d", 1, 2), command("f", 100), command("G", 0), command("G", 90), command("H", 2),
    command("M", 2000), command("m", 50), command("O", 5, 1), command("o", 1), command("p", 3, 111), Q,
    command("R", 5), command("r"), command("s", 85, 170), command("V", 1, 2, 3), command(0x81, 3), command("W", 1),
    command("X", 1, -1),
]  # fmt: skip


@shows("gmi99-3.1.1-60")
@pytest.mark.parametrize("frame", NORMAL, ids=lambda frame: bytes.fromhex(frame)[5:6].hex())
def test_a_normal_command_is_acknowledged_when_it_is_received(frame: str) -> None:
    """Even if it has to wait: here for a motion that takes 2.2 s."""
    desk = prepared(TO_20000)
    desk.run(0.1)
    assert desk.ask(frame) == OK


@shows("gmi99-3.1.1-61")
def test_a_new_card_has_b_50_and_m_2000() -> None:
    """20000 increments at 2000 Hz and 50 Hz/ms: 10 s and 40 ms of ramp; R is 0: M3.6 changes nothing."""
    desk = fresh()
    assert moved_s(desk, Q, command("p", 11, 3, 0x40), command("G", 0), TO_20000) == 10.04


@shows("gmi99-3.1.1-62")
def test_an_axis_without_influence_shares_the_time_of_the_others() -> None:
    """Beside 3000, 4000 axis 2 goes 5000: with influence 7071 at 10000 Hz, without it 5000; 0.2 s of ramp."""
    assert moved_s(prepared(), command(0x87, 3000, 4000, 5000)) == pytest.approx(0.9071, abs=0.0041)
    desk = prepared(command("W", 1, 65_535 + 65_536, 3))
    assert moved_s(desk, command(0x87, 3000, 4000, 5000)) == pytest.approx(0.7, abs=0.0041)
    assert desk.counts[:3] == (3000, 4000, 5000)


@shows("gmi99-3.1.1-63")
def test_the_ratio_is_between_1_and_65535() -> None:
    for value in (0, 65_536, 131_072):
        desk = prepared(command("W", 1, value, 1))
        assert desk.controller.fault, value
    assert not prepared(command("W", 1, 1, 1), command("W", 1, 65_537, 1)).controller.fault


@shows("gmi99-3.1.1-64")
def test_a_circle_joins_with_the_line_before() -> None:
    """10000 along X and a quarter circle of radius 40000 that goes on in the same direction, N14 = 1, corners free to
    jump by 1000 Hz: one motion at 10000 Hz without a stop."""
    desk = prepared(command("N", 1000, 11), command("N", 1000, 16), command("N", 1, 14))
    told = (TO_10000, command("G", 3), command(0x83, 0, 40_000), command(0x83, 50_000, 40_000))
    expected = (10_000 + math.pi / 2 * 40_000) / 10_000 + 0.2
    assert moved_s(desk, *told) == pytest.approx(expected, abs=0.009)


@shows("gmi99-3.1.1-65")
def test_g53_with_1_ends_the_tool_offset_too() -> None:
    """Which is always 0."""
    desk = prepared(command("G", 54, 700, 1), command("G", 54), command("G", 53, 1), TO_10000)
    desk.finish()
    assert desk.counts[0] == 10_000


@shows("gmi99-3.1.1-66")
def test_a_temporary_zero_point_ends_by_0_only() -> None:
    desk = prepared(*record(0, command("G", 58, 40, 1), command("G", 59, 5, 1)), *record(1, command("G", 58, 0, 1)))
    desk.tell(command("p", 3, 1, 0), command("G", 53), TO_0)
    desk.finish()
    assert desk.counts[0] == 45
    desk.tell(command("p", 3, 1, 1), TO_0)
    desk.finish()
    assert desk.counts[0] == 5


@shows("gmi99-3.1.1-67")
def test_the_start_of_a_program_by_the_host_writes_its_number() -> None:
    desk = prepared(*record(0, TO_0), *record(7, command("p", 10, 14, 1)), command("p", 3, 1, 7))
    assert flags(desk, 2) == 7


@shows("gmi99-3.1.1-69")
@pytest.mark.parametrize(("target", "moves"), [(-8_388_352, True), (-8_388_353, False), (-8_388_608, False)])
@pytest.mark.parametrize("letter", ["V", 0x81])
def test_coordinates_end_at_minus_8388352(target: int, moves: bool, letter: str | int) -> None:
    desk = prepared(command("O", -8_388_300, 0), command(letter, target))
    desk.finish()
    assert desk.counts[0] == (target if moves else -8_388_300)
    assert desk.controller.fault is not moves


@shows("gmi99-3.1.1-69")
def test_coordinates_end_at_8388607() -> None:
    desk = prepared(command("O", 8_388_600, 0), command(0x81, 8_388_607))
    desk.finish()
    assert desk.set_position() == 8_388_607


@shows("gmi99-3.1.1-70")
@pytest.mark.parametrize(("target", "source"), [(0, 0), (1, 1), (0, 1), (1, 2), (6, 0)])
def test_an_axis_follows_a_lower_one_only(target: int, source: int) -> None:
    desk = prepared(command("X", target, source), command(0x83, 100, 0))
    assert desk.controller.fault
    desk.finish()
    assert desk.counts[:3] == (100, 0, 0)


@shows("gmi99-3.1.1-71")
@pytest.mark.parametrize(
    ("reduced", "flags", "move", "seconds"),
    [
        (2, 0x40, command(0x82, 20_000), 4.1),  # axis 1 at 5000 Hz, with ramps of 50 Hz/ms
        (2, 0x00, command(0x82, 20_000), 2.2),  # nobody asks for it
        (2, 0x40, command(0x81, 20_000), 2.2),  # axis 0 keeps its 10000 Hz
        (1, 0x40, command(0x82, 20_000), 2.2),
    ],
)
def test_the_reduced_speed_of_one_axis(reduced: int, flags: int, move: bytes, seconds: float) -> None:
    """3.1.1: P2 is the slot and one more; in force while the PLC asks for it (M3.6)."""
    desk = prepared(command("R", 5000, reduced), command("p", 11, 3, flags))
    assert not desk.controller.fault
    assert moved_s(desk, move) == seconds


@shows("gmi99-3.1.1-71")
def test_a_new_top_speed_forgets_the_reduced_one() -> None:
    desk = prepared(command("R", 5000, 2), command("M", 10_000), command("p", 11, 3, 0x40))
    assert moved_s(desk, command(0x82, 20_000)) == 2.2


@shows("gmi99-3.1.1-72")
def test_in_position_of_some_axes() -> None:
    """H2 with a mask waits for those of the mask; here all are in position 4 ms after the last set point."""
    desk = prepared(TO_10000)
    desk.finish()
    start_ns = desk.time_ns
    desk.ask(command("H", 2, 0, 0b010))
    assert desk.ask(STATUS) == BUSY
    desk.at_ms(start_ns, 8)
    assert desk.ask(STATUS) == READY


@shows("gmi99-3.1.1-73")
def test_a_mask_puts_rotary_axes_into_the_first_turn() -> None:
    """P2M.7: axes 0 and 2 of the mask, of 3600 and 1000 increments a turn; axis 1 stays as it is."""
    desk = prepared(command("N", 3600, 40, 0), command("N", 1000, 40, 2), command(0x87, 3700, 4000, -100))
    desk.finish()
    desk.ask(command("H", 12, 0x8500))
    assert desk.counts[:3] == (100, 4000, 900)


@shows("gmi99-3.1.1-73")
def test_a_segment_may_lie_below_0() -> None:
    desk = prepared(command("N", 3600, 40, 1), command(0x82, 3700))
    desk.finish()
    desk.ask(command("H", 12, 0x01FF))
    assert desk.counts[1] == 100 - 3600
    desk.ask(command("H", 12, 0x0081))
    assert desk.controller.fault, "axis 0 has no turn"


@shows("gmi99-3.1.1-74")
def test_a_data_word_has_16_bits() -> None:
    desk = fresh()
    desk.tell(command("d", 0xFFFF, 4), command("d", 0x10000, 4))
    assert desk.controller.fault
    assert desk.ask(command("T", 1, 6, 4)) == long(b"I\xff\xff")


@shows("gmi99-3.1.1-75")
def test_bits_6_and_7_of_a_choice_of_axes_do_not_count() -> None:
    desk = prepared(command("O", 7, 0), command("O", 7, 3), command("Q", 0xC1))
    assert (desk.counts[0], desk.counts[3]) == (0, 7)


@shows("gmi99-3.1.1-76")
def test_rapid_and_speed_hold_for_all_moves_that_follow() -> None:
    desk = prepared(command("f", 5000))
    assert moved_s(desk, TO_20000) == 4.1
    assert moved_s(desk, TO_0) == 4.1
    assert moved_s(desk, command("G", 0), TO_20000) == pytest.approx(2 * math.sqrt(20_000 / 50_000), abs=0.0041)
    assert moved_s(desk, TO_0) == pytest.approx(2 * math.sqrt(20_000 / 50_000), abs=0.0041)


@shows("gmi99-3.1.1-77")
def test_m_functions_from_the_first_to_the_last() -> None:
    """M50 is M6.0, M58 is M7.0, M89 is M10.7."""
    for number, byte, bit in ((50, 6, 0), (58, 7, 0), (89, 10, 7)):
        desk = prepared(command("m", number, 3))
        assert bytes(flags(desk, b) for b in range(6, 12)) == bytes(
            1 << bit if b == byte else 3 if b == 11 else 0 for b in range(6, 12)
        )
    desk = prepared(command("m", 90))
    assert desk.controller.fault


# ---- 3.1.2 -----------------------------------------------------------------------------------------------------------


@shows("gmi99-3.1.2-34")
def test_e_is_not_known() -> None:
    assert fresh().ask(command("e", 1, 1)) == ""


@pytest.mark.parametrize(
    ("index", "highest"),
    [
        case("gmi99-3.1.2-35", 12, 6),
        case("gmi99-3.1.2-35", 13, 6),
        case("gmi99-3.1.2-36", 14, 1),
        case("gmi99-3.1.2-36", 17, 1),
        case("gmi99-3.1.2-36", 24, 1),
        case("gmi99-3.1.2-36", 51, 1),
    ],
)
def test_the_range_of_a_parameter(index: int, highest: int) -> None:
    desk = fresh()
    desk.ask(command("N", highest, index))
    assert not desk.controller.fault
    desk.ask(command("N", highest + 1, index))
    assert desk.controller.fault
    assert desk.ask(command("T", 5, index)) == long(b"N" + bytes([highest, 0, 0]))


@shows("gmi99-3.1.2-37")
def test_r_switches_motion_on_again() -> None:
    desk = prepared(command("N", 1, 17), command("r"))
    assert desk.ask(command("T", 5, 17)) == long(b"N\0\0\0")


@shows("gmi99-3.1.2-38")
def test_ffh_in_the_list_of_addresses_is_no_address() -> None:
    desk = fresh()
    desk.ask(command("N", 0xFFFF02, 18, 0xFFFFFF))
    assert desk.tell(short(1, address=0), short(1, address=2)) == ["", short(0x40, address=2)]


@shows("gmi99-3.1.2-39")
def test_the_enable_input_is_the_drives_with_cards_too() -> None:
    """With I/O cards it is E24.0, where the drives' inputs are then."""
    desk = prepared(command("N", 1, 13), command("N", 1, 51))
    desk.set("e0.0", False)
    assert desk.ask(command("T", 3, 8)) == long(b"\x08")
    desk.ask(TO_10000)
    desk.run(1.0)
    assert desk.counts[0] == 0


@shows("gmi99-3.1.2-40")
def test_the_word_at_4_is_bytes_4_and_5() -> None:
    """The printed example, of flags, which a host can set: byte 4 comes first."""
    desk = fresh()
    desk.tell(command("p", 11, 40, 0x12), command("p", 11, 41, 0x34))
    assert desk.ask(command("T", 1, 3, 40)) == long(b"I\x12\x34")
    desk.set("e5.6", False)
    with_4 = bytes.fromhex(desk.ask(command("T", 1, 1, 4)))[6:8]
    assert with_4[1] & 0x40 == 0


@shows("gmi99-3.1.2-41")
def test_the_memory_status_tells_of_a_program_that_is_wrong() -> None:
    """I.4: an empty program is started; a good recording clears it."""
    desk = prepared(*record(0), command("p", 3, 1, 0))
    assert desk.ask(command("T", 3, 4)) == long(b"\x12")
    desk.tell(*record(0, TO_0))
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")


@shows("gmi99-3.1.2-42")
def test_the_memory_status_tells_of_an_image_that_cannot_be_read() -> None:
    """I.0, I.4 and I.5; I.2 and I.6 stay 0: no memory of the twin breaks otherwise."""
    desk = fresh()
    desk.ask(command("s", 85, 170))
    assert desk.flash is not None
    desk.power_cycle(flash=desk.flash[:-1])
    assert desk.ask(command("T", 3, 4)) == long(b"\x33")


@shows("gmi99-3.1.2-43")
def test_there_is_no_further_information() -> None:
    assert fresh().ask(command("T", 3, 5)) == long(b"\0")


@shows("gmi99-3.1.2-44")
def test_the_machine_zero_is_0() -> None:
    assert [fresh().ask(command("T", 8, 53, axis)) for axis in (0, 5)] == [long(b"Z\0\0\0")] * 2


@shows("gmi99-3.1.2-45")
def test_the_counter_input_is_0() -> None:
    assert fresh().ask(command("T", 11)) == long(b"C\0\0\0")


@shows("gmi99-3.1.2-46")
@pytest.mark.parametrize(
    "question",
    [
        command("T", 0, 6),
        command("T", 2),
        command("T", 1, 4),
        command("T", 1, 1, 48),
        command("T", 1, 3, 256),
        command("T", 3, 1),
        command("T", 5, 9999),
        command("T", 8, 52, 0),
        command("T", 8, 54, 6),
        command("T", 12, -1),
        command("T", 12, 0),
    ],
)
def test_a_question_that_does_not_exist_is_not_answered(question: str) -> None:
    assert fresh().tell(question, command("T", 1, 0)) == ["", long(b"V\xe8\x01")]


@shows("gmi99-3.1.2-47")
def test_zero_points_are_read_by_either_number() -> None:
    """G55 is the second of the sixteen."""
    desk = fresh()
    desk.tell(command("G", 55, -3, 2))
    assert desk.tell(command("T", 8, 55, 1), command("T", 8, 54 + 0x100, 1)) == [long(b"Z\xfd\xff\xff")] * 2


@shows("gmi99-3.1.2-48")
def test_the_upload_ends_with_the_image() -> None:
    """Six bytes, those behind the end 0; nothing beyond."""
    desk = running("OB 1\nL KB 7\nBE\n")
    assert desk.ask(command("T", 12, 10)) == long(b"x\x28\x07\x65\0\0\0")
    assert desk.ask(command("T", 12, 14)) == ""
    assert desk.ask(command("T", 12, -21)) == ""


# ---- 3.2, 4, 5 -------------------------------------------------------------------------------------------------------


@shows("gmi99-3.2-13")
def test_an_abort_ends_a_recording() -> None:
    desk = prepared(command("p", 3, 100, 0), TO_10000, short(0))
    assert moved_s(desk, TO_20000) == 2.2
    desk.ask(command("p", 3, 1, 0))
    assert desk.ask(command("T", 3, 4)) == long(b"\x12")


@shows("gmi99-3.2-14")
@pytest.mark.parametrize("waits", [command("m", 70), command("p", 10, 14, 100), command("H", 2), command("m", 100, 1)])
def test_an_abort_ends_what_waits(waits: str) -> None:
    desk = prepared(waits)
    assert desk.tell(STATUS, short(0), STATUS) == [BUSY, OK, READY]
    assert (flags(desk, 8), flags(desk, 15) & 0x80) == (0, 0)


@shows("gmi99-3.2-15")
def test_an_override_from_outside_ends_the_potentiometer() -> None:
    """The potentiometer says 25 %, #9 says 50; o1 brings 50 again, not 25."""
    desk = fresh(override_pot_percent=25)
    desk.tell(*PRE, command("o", 1))
    assert moved_s(desk, TO_20000) == pytest.approx(8.05, abs=0.0041)
    desk.ask(short(9, 50))
    assert moved_s(desk, TO_0) == 4.1
    assert moved_s(desk, command("o", 0), TO_20000) == 2.2
    assert moved_s(desk, command("o", 1), TO_0) == 4.1


@shows("gmi99-3.2-16")
@pytest.mark.parametrize("frame", [short(0, 1), short(1, 1), short(8, 1), short(8, 1, 2, 3), short(9), short(9, 1, 2)])
def test_a_short_record_with_another_extension_is_dropped(frame: str) -> None:
    desk = fresh()
    assert desk.ask(frame) == ""
    desk.run(0.1)
    assert desk.ask(STATUS) == short(0x40)


@shows("gmi99-3.2-16")
@pytest.mark.parametrize("letter", [2, 7, 10, 0x40])
def test_a_short_record_that_is_none_is_dropped(letter: int) -> None:
    desk = fresh()
    assert desk.ask(short(letter)) == ""
    desk.run(0.1)
    assert desk.ask(STATUS) == short(0x40)


@shows("gmi99-3.2-17")
def test_an_override_above_125_is_not_taken() -> None:
    desk = prepared(short(9, 126))
    assert desk.controller.fault
    assert moved_s(desk, TO_20000) == 2.2


@shows("gmi99-4-8")
def test_there_are_32_programs() -> None:
    desk = prepared(*record(0, TO_0), *record(31, command(0x81, 31)), command("p", 3, 1, 31))
    desk.finish()
    assert desk.counts[0] == 31
    assert not desk.controller.fault
    desk.ask(command("p", 3, 1, 32))
    assert desk.controller.fault
    desk.tell(short(0), command("p", 3, 100, 32))
    assert desk.controller.fault


@shows("gmi99-4-9")
def test_a_program_from_within_a_program_is_not_the_host_s_queue() -> None:
    """What the host sends while a program runs comes after it."""
    desk = prepared(*record(0, command("p", 10, 14, 5), command(0x81, 100)), command("p", 3, 1, 0), G91)
    desk.ask(command(0x81, 7))
    desk.run(0.4)
    assert desk.counts[0] == 0
    desk.finish()
    assert desk.counts[0] == 107


@shows("gmi99-5-3")
def test_the_smallest_speed_per_revolution() -> None:
    """f 1 under G95 is 2 increments a turn: 40 of them at 600 rpm, 20 Hz, take 2 s; with M 100000 it is 4: 1 s."""
    for m_hz, seconds in ((50_000, 2.0), (100_000, 1.0)):
        desk = prepared(command("M", m_hz), command("G", 95), command("f", 1), short(8, 0x58, 0x02))
        assert moved_s(desk, command(0x81, 40)) == pytest.approx(seconds, abs=0.0061)


@shows("gmi99-3.3-3")
def test_the_buffer_takes_100_other_commands_beside_the_moves() -> None:
    """While one waits: 50 moves do not count among them, and #0 makes room."""
    desk = prepared(command("p", 10, 14, 255))
    assert desk.tell(*[command(0x81, 5), command("B", 50)] * 50, *[command("B", 50)] * 50) == [OK] * 150
    assert desk.ask(command("B", 50)) == short(8)
    assert desk.tell(command(0x81, 6), short(0), command("B", 50)) == [OK] * 3


# ---- 6, 8, 9 ---------------------------------------------------------------------------------------------------------


@shows("gmi99-6-9")
@pytest.mark.parametrize("slot", range(6))
def test_a_slot_has_two_bytes(slot: int) -> None:
    desk = running(f"OB 1\nUN M 30.0\n= A {2 * slot}.3\n= A {2 * slot + 1}.7\nBE\n")
    desk.run(0.02)
    on = {name for name, value in desk.outputs.items() if value and name.startswith("a") and name[1].isdigit()}
    assert on == {f"a{2 * slot}.3", f"a{2 * slot + 1}.7"}


@shows("gmi99-6-10")
@pytest.mark.parametrize("slot", range(3))
def test_the_reference_inputs_are_bits_6_and_7_of_the_second_byte(slot: int) -> None:
    """Motor end 6, far end 7: E1.6 and E1.7 at slot 0; openers, struck is 0."""
    desk = fresh()
    for end in (0, 1):
        desk.set(f"limit_{'xyz'[slot]}{1 + end}", "open")
        byte = bytes.fromhex(desk.ask(command("T", 1, 1, 2 * slot + 1)))[6]
        assert byte & 0xC0 == 0x80 >> end
        desk.set(f"limit_{'xyz'[slot]}{1 + end}", "closed")


@shows("gmi99-6-11", "gmi99-3.1.2-3")
def test_with_cards_the_drives_outputs_are_a24_on() -> None:
    """Mode 0: A0.0 is a card's, to which nothing leads; A24.0 is the first drive's."""
    desk = fresh()
    desk.ask(command("N", 1, 12))
    load(desk, *assembled("OB 1\nUN M 30.0\n= A 0.0\n= A 25.1\nBE\n"))
    desk.run(0.02)
    assert (desk.outputs.get("a0.0", 0), desk.outputs["a1.1"]) == (0, 1)


@shows("gmi99-8-1")
def test_q3_to_the_drives_makes_them_ready() -> None:
    """As for a first test: every drive takes its place for zero; then the card's indexer wants its own Q."""
    desk = fresh()
    assert desk.tell(*[command("Q", 3, address=slot) for slot in range(3)]) == [OK] * 3
    assert desk.tell(*[short(1, address=slot) for slot in range(3)]) == [short(0, address=slot) for slot in range(3)]
    assert desk.tell(short(1), command("Q", 0), short(1)) == [short(0x40), OK, READY]


@shows("gmi99-7.5-1")
@pytest.mark.parametrize(("percent", "seconds"), [(0, None), (50, 4.1), (100, 2.2)])
def test_the_potentiometer_is_the_override(percent: int, seconds: float | None) -> None:
    desk = fresh(override_pot_percent=percent)
    desk.tell(*PRE, command("o", 1))
    if seconds is None:
        desk.ask(TO_20000)
        desk.run(5.0)
        assert desk.counts[0] == 0
    else:
        assert moved_s(desk, TO_20000) == seconds


@shows("gmi99-1-3")
def test_steps_of_six_axes_are_on_one_grid() -> None:
    desk = fresh()
    desk.tell(command("N", 63, 10), command("Q", 63), *PRE[1:], command(0xA1, 600, 6000))
    desk.finish()
    assert not np.any(desk.steps.t_ns % 4_000_000)


# ---- positions of 24 bits (gmi99/35) --------------------------------------------------------------------------------

HIGHEST, LOWEST = 8_388_607, -8_388_352  # as the manual prints them at O


def at(place: int, *frames: str) -> CardDesk:
    """Ready, axis 0 told to be there."""
    return prepared(command("O", place, 0), *frames)


@shows("gmi99-3.1.2-16")
@pytest.mark.parametrize(("place", "way"), [(HIGHEST - 100, 100), (LOWEST + 100, -100)])
def test_a_position_may_reach_its_last_value_and_not_pass_it(place: int, way: int) -> None:
    desk = at(place, G91)
    desk.tell(command(0x81, way + (1 if way > 0 else -1)))
    assert desk.controller.fault
    assert str(place + way + (1 if way > 0 else -1)) in desk.remarks[-1][1]
    desk.finish()
    assert desk.set_position() == place
    desk.tell(command(0x81, way))
    desk.finish()
    assert desk.set_position() == place + way


@shows("gmi99-3.1.2-16")
def test_moves_in_a_queue_add_up() -> None:
    """Each is short enough; the second one is refused before the first has ended."""
    desk = at(HIGHEST - 1500, G91)
    desk.tell(command(0x81, 1000), command(0x81, 1000))
    assert desk.controller.fault
    desk.finish()
    assert desk.set_position() == HIGHEST - 500


@shows("gmi99-3.1.2-16")
def test_an_arc_may_not_pass_there_either() -> None:
    """Half a circle of radius 1000: its ends lie on one side, its top 1000 further."""
    for room, refused in ((900, True), (1100, False)):
        desk = at(HIGHEST - room, G91)
        desk.tell(command("G", 3), command(0x83, 0, 1000), command(0x83, 0, 2000))
        assert desk.controller.fault is refused, room


@shows("gmi99-3.1.1-73")
@pytest.mark.parametrize(("segment", "refused"), [(100, True), (8, False)])
def test_a_segment_lies_within_the_positions(segment: int, refused: bool) -> None:
    desk = prepared(command("N", 1_000_000, 40, 1), command("H", 12, 0x0100 | segment))
    assert desk.controller.fault is refused
    assert desk.counts[1] == (0 if refused else segment * 1_000_000)


@shows("gmi99-3.1.1-25")
def test_a_position_that_is_set_counts_with_its_offsets() -> None:
    """10 beyond the zero point of G54, which lies at 1000: 1010 of the machine, and the last value no more."""
    desk = prepared(command("G", 54, 1000, 1), command("G", 54), command("O", 10, 0))
    assert desk.set_position() == 1010
    desk.tell(command("O", HIGHEST, 0))
    assert desk.controller.fault
    assert desk.set_position() == 1010


@shows("gmi99-3.1.1-68", "gmi99-3.1.2-16")
def test_an_axis_that_turns_passes_the_last_position_with_a_remark() -> None:
    """20000 increments a revolution, 60 1/min: 20000 Hz, so that 10000 increments are behind it after half a second."""
    desk = prepared(command("O", HIGHEST - 10_000, 2), command("N", 20_000, 40, 2), command("p", 4, 60, 0x0202))
    assert desk.set_position(2) > 0
    assert desk.remarks == []
    desk.run(2.0)
    for _ in range(2):
        assert desk.set_position(2) == desk.counts[2] - (1 << 24)
    (remark,) = [text for _, text in desk.remarks]
    assert "slot 2" in remark
    assert "modulo 2^24" in remark
    assert not desk.controller.fault
