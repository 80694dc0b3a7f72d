"""GMI99, sections 6 and 6.1: flags and who may change them, FB 254, and instructions of the PLC through the card."""

from __future__ import annotations

import itertools

import pytest
from conformance.gmi99_desk import (
    BUSY,
    OK,
    PLC_BEGIN,
    PLC_END,
    PLC_START,
    PLC_STOP,
    READY,
    STATUS,
    TO_20000,
    CardDesk,
    Q,
    assembled,
    command,
    fresh,
    load,
    long,
    prepared,
    running,
    word,
)
from conformance.rows import case, shows

from isel_twin.firmware.plc.assembler import assemble
from isel_twin.testing import IdealDrives


def flags(desk: CardDesk, byte: int) -> int:
    """A flag byte."""
    return word(desk, byte) & 0xFF


def after(desk: CardDesk, ms: float) -> CardDesk:
    """The same desk, later."""
    desk.run(ms / 1000)
    return desk


# ---- 6.1.1: rights ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("byte", "bit"),
    [
        case("gmi99-6.1.1-21", 0, 3),
        case("gmi99-6.1.1-21", 0, 4),
        case("gmi99-6.1.1-21", 0, 5),
        case("gmi99-6.1.1-21", 0, 6),
        case("gmi99-6.1.1-21", 0, 7),
        case("gmi99-6.1.1-21", 1, 0),
        case("gmi99-6.1.1-21", 1, 1),
        case("gmi99-6.1.1-21", 1, 2),
        case("gmi99-6.1.1-21", 1, 4),
        case("gmi99-6.1.1-21", 3, 4),
        case("gmi99-6.1.1-21", 3, 5),
        case("gmi99-6.1.1-22", 19, 0),
        case("gmi99-6.1.1-22", 19, 7),
    ],
)
def test_a_flag_of_the_firmware_is_changed_by_nobody_else(byte: int, bit: int) -> None:
    """Neither set nor reset by the program, nor by p11."""
    desk = fresh()
    before = flags(desk, byte) >> bit & 1
    desk.ask(command("p", 11, byte, (1 - before) << bit))
    assert flags(desk, byte) >> bit & 1 == before
    idle = flags(prepared(), byte) >> bit & 1
    for what in ("S", "R"):
        desk = after(running(f"OB 1\nUN M 200.0\n{what} M {byte}.{bit}\nBE\n"), 20)
        assert flags(desk, byte) >> bit & 1 == idle, what


@pytest.mark.parametrize(
    ("byte", "bit"),
    [
        case("gmi99-6.1.1-1", 0, 0),
        case("gmi99-6.1.1-13", 1, 3),
        case("gmi99-6.1.1-23", 1, 5),
        case("gmi99-6.1.1-23", 1, 6),
        case("gmi99-6.1.1-23", 1, 7),
        case("gmi99-6.1.1-15", 3, 2),
        case("gmi99-6.1.1-9", 3, 3),
        case("gmi99-6.1.1-11", 3, 6),
        case("gmi99-6.1.1-24", 3, 7),
        *[case("gmi99-6.1.1-25", byte, 5) for byte in (2, 4, 5, 6, 10, 11, 12, 14, 15, 16, 17, 18, 20, 29, 30, 255)],
    ],
)
def test_a_flag_that_the_program_sets_and_resets(byte: int, bit: int) -> None:
    """As E1.0 says."""
    desk = running(f"OB 1\nU E 1.0\nS M {byte}.{bit}\nUN E 1.0\nR M {byte}.{bit}\nBE\n")
    seen = []
    for state in ("high", "low"):
        desk.set("user_0", state)
        seen.append(flags(after(desk, 20), byte) >> bit & 1)
    assert seen == [1, 0]


@shows("gmi99-6.1.1-23")
def test_block_mark_and_extended_bits_do_nothing() -> None:
    desk = prepared(command("p", 11, 1, 0xE0), TO_20000)
    assert flags(desk, 1) & 0xE0 == 0xE0
    desk.finish()
    assert (desk.counts[0], desk.ask(STATUS)) == (20_000, READY)


@shows("gmi99-6.1.1-2", "gmi99-6.1.1-26")
def test_the_program_breaks_off_a_motion() -> None:
    """M0.1 may be set; the card takes it back."""
    desk = running("OB 1\nU E 1.0\nS M 0.1\nBE\n")
    desk.ask(TO_20000)
    after(desk, 1000).set("user_0", "high")
    after(desk, 20).set("user_0", "low")
    desk.finish()
    assert 9000 < desk.counts[0] < 11_000
    assert flags(desk, 0) & 2 == 0


@shows("gmi99-6.1.1-27")
def test_the_program_cannot_ask_itself_to_report_again() -> None:
    desk = after(running("OB 1\nUN M 200.0\nS M 3.1\nBE\n"), 20)
    assert flags(desk, 3) & 2 == 0


@shows("gmi99-6.1.1-28")
def test_the_key_of_the_host_is_the_host_s() -> None:
    """p11;13,1, as printed; a program can look at it only."""
    desk = running("OB 1\nL KB 9\nT MB 13\nU M 13.0\n= M 40.0\nBE\n")
    assert desk.ask(command("p", 11, 13, 1)) == OK
    after(desk, 20)
    assert (flags(desk, 13), flags(desk, 40)) == (1, 1)


class Overloaded(IdealDrives):
    """The drive at slot 1 has too much current."""

    @property
    def overloaded(self) -> tuple[bool, ...]:
        return (False, True, False, False, False, False)


@shows("gmi99-6.1.1-29", "gmi99-6.1.3-12")
def test_i2t_of_any_drive() -> None:
    """M1.1 is the or of all, .2 of the status register that of one."""
    desk = running("OB 1\nL KF 0\nL KF 10\nSPA FB 254\nT MW 40\nL KF 1\nL KF 10\nSPA FB 254\nT MW 42\nBE\n")
    assert flags(desk, 1) & 2 == 0
    desk.controller.use_drives(Overloaded(desk))
    after(desk, 20)
    assert flags(desk, 1) & 2
    assert (word(desk, 40) & 4, word(desk, 42) & 4) == (0, 4)


@shows("gmi99-6.1.1-24")
def test_data_words_are_kept_without_m3_7() -> None:
    desk = after(running("OB 1\nL KF 77\nT DW 39\nBE\n"), 20)
    assert flags(desk, 3) & 0x80 == 0
    desk.power_cycle()
    assert desk.ask(command("T", 1, 6, 78)) == long(b"I\x4d\0")


@shows("gmi99-6.1.1-30")
@pytest.mark.parametrize(("frame", "flag"), [(command("m", 100, 2, 1500), "15.7"), (command("m", 101, 12), "18.7")])
def test_the_program_ends_s_and_t_functions(frame: str, flag: str) -> None:
    """It copies what it was told and resets the request."""
    desk = running(f"OB 1\nL MW 16\nT MW 42\nU M {flag}\nR M {flag}\nBE\n")
    assert desk.ask(frame) == OK
    assert desk.ask(STATUS) == BUSY
    assert after(desk, 20).ask(STATUS) == READY
    if flag == "15.7":
        assert (flags(desk, 15), word(desk, 42)) == (2, 1500)
    else:
        assert flags(desk, 18) == 12


@shows("gmi99-6.1.2-12")
@pytest.mark.parametrize(
    ("code", "most"),
    [(2, 95), (3, 95), (6, 95), (7, 95), (10, 255), (11, 255), (14, 255), (16, 95), (17, 95), (24, 95), (26, 0)],
)
def test_the_operand_of_a_direct_command(code: int, most: int) -> None:
    assert not prepared(command("p", 10, code, most)).controller.fault
    assert prepared(command("p", 10, code, most + 1)).controller.fault


@shows("gmi99-6.1.2-12")
@pytest.mark.parametrize("code", [0, 1, 4, 5, 8, 9, 12, 13, 15, 18, 23, 25, 27])
def test_a_direct_command_that_is_none(code: int) -> None:
    assert prepared(command("p", 10, code, 0)).controller.fault


# ---- 6.1.3: FB 254 ---------------------------------------------------------------------------------------------------


def called(desk: CardDesk, function: str, argument: str) -> tuple[int, int]:
    """Both accumulators behind FB 254."""
    load(desk, *assembled(f"OB 1\nL {argument}\nL {function}\nSPA FB 254\nT MW 40\nTAK\nT MW 42\nBE\n"))
    after(desk, 20)
    return word(desk, 40), word(desk, 42)


@shows("gmi99-6.1.3-12")
def test_the_status_register_bit_by_bit() -> None:
    """.0 reference missing, .3 E-stop, .4 in position, .9 pulses blocked; .1 while it makes a reference run."""
    desk = fresh()
    assert called(desk, "KF 10", "KF 0")[0] == 0x0211
    desk.ask(Q)
    assert called(desk, "KF 10", "KF 0")[0] == 0x0010
    desk.ask(command("Q", 1, 1))
    after(desk, 200)
    assert word(desk, 40) & 2
    desk.finish()
    assert word(after(desk, 20), 40) == 0x0010
    desk.set("estop", "pressed")
    assert word(after(desk, 20), 40) == 0x0219


@shows("gmi99-6.1.3-13")
@pytest.mark.parametrize(("argument", "put"), [("KH 0000", 0), ("KH 0010", 55), ("KH 0660", 55), ("KH 0606", 0)])
def test_analog_outputs_of_the_drives_are_the_middle_digit(argument: str, put: int) -> None:
    desk = running(f"OB 1\nL KB 55\nT AB 12\nL {argument}\nL KF 8\nSPA FB 254\nBE\n")
    assert after(desk, 20).outputs.get("analog", 0) == put


@shows("gmi99-6.1.3-14")
def test_plc_zero_points_are_read_and_limited() -> None:
    """8000h reads; the number of the axis is hexadecimal: 110h to 115h."""
    desk = prepared()
    assert called(desk, "KH 0113", "KF -1000")[0] == 0xFC18
    for argument in ("KH 8000", "KF -1001", "KF 1001"):
        assert called(desk, "KH 0113", argument)[0] == 0xFC18
    assert called(desk, "KH 0116", "KF 5") == (0x116, 5), "there are six"
    assert called(desk, "KF 113", "KF 5") == (113, 5), "not decimal"
    assert desk.ask(command("T", 8, 100, 3)) == long(b"Z\x18\xfc\xff")


@shows("gmi99-6.1.3-15")
def test_the_number_of_the_fine_correction_is_set_and_read() -> None:
    desk = prepared()
    assert called(desk, "KF 5", "KF 15")[0] == 15
    assert called(desk, "KF 5", "KF -1")[0] == 15
    for page in ("KF 16", "KF 17"):
        assert called(desk, "KF 5", page)[0] == 15


@shows("gmi99-6.1.3-16")
def test_no_axis_is_uncoupled() -> None:
    assert called(prepared(), "KF 6", "KF 5")[0] == 0


@shows("gmi99-6.1.3-5")
def test_a_set_position_is_a_low_word_and_a_high_one() -> None:
    """70000 is 1 1170h, -70000 FFFE EE90h."""
    desk = prepared(command("O", 70_000, 0), command("O", -70_000, 2))
    assert called(desk, "KF 6", "KH 0003") == (0x1170, 1)
    assert called(desk, "KF 6", "KH 0203") == (0xEE90, 0xFFFE)


@shows("gmi99-6.1.3-7")
def test_the_home_window_of_a_new_card_is_0() -> None:
    desk = fresh()
    assert called(desk, "KF 12", "KF 0")[0] == 1
    for position in (-1, 1):
        desk.ask(command("O", position, 0))
        assert word(after(desk, 20), 40) == 0


@shows("gmi99-6.1.3-9")
def test_reduced_speed_goes_by_m3_6_again() -> None:
    """Mode 2, then 1: 41 s/10 of 5000 Hz only if M3.6 is on."""
    desk = prepared(command("R", 5000))
    assert called(desk, "KF 33", "KF 2") == (33, 2)
    assert desk.ask(command("T", 3, 8)) == long(b"\x01")
    assert called(desk, "KF 33", "KF 1") == (33, 1)
    assert desk.ask(command("T", 3, 8)) == long(b"\0")
    desk.ask(command("p", 11, 3, 0x40))
    assert desk.ask(command("T", 3, 8)) == long(b"\x01")


@shows("gmi99-6-12")
def test_mode_0_and_1_of_the_images_and_no_other() -> None:
    desk = fresh()
    desk.ask(command("N", 6, 13))
    for mode, at in ((1, 0), (2, 0), (0, 24)):
        called(desk, "KF 2", f"KF {mode}")
        assert bytes.fromhex(desk.ask(command("T", 1, 1, at)))[6] & 1, mode


@shows("gmi99-6-25")
def test_the_mode_is_in_force_directly_after_the_call() -> None:
    """OB 21 calls, OB 1 looks at E0.0 in the same pass: the drive's, and so is A0.4."""
    desk = fresh()
    desk.ask(command("N", 1, 12))
    load(desk, *assembled("OB 21\nL KF 1\nL KF 2\nSPA FB 254\nBE\nOB 1\nU E 0.0\n= A 0.4\nBE\n"))
    assert after(desk, 4.001).outputs["a0.4"] == 1


@shows("gmi99-6-26")
def test_outputs_of_the_drives_are_those_of_their_place_in_the_image() -> None:
    """A0.1 is on; with cards it is a card's, and the drive's is A24.1."""
    desk = fresh()
    desk.ask(command("p", 10, 16, 1))
    seen = [desk.outputs["a0.1"]]
    for cards in (1, 0):
        desk.ask(command("N", cards, 12))
        seen.append(desk.outputs["a0.1"])
    assert seen == [1, 0, 1]


# ---- 6: instructions through the card --------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "on_ms", "bits"),
    [  # asked 100, 300, 500 .. 1100 ms after E1.0 has gone on, KT 400 ms
        case("gmi99-6-13", "SI", 1000, "110000"),
        case("gmi99-6-13", "SI", 200, "100000"),
        case("gmi99-6-14", "SV", 200, "110000"),
        case("gmi99-6-15", "SE", 1000, "001110"),
        case("gmi99-6-15", "SE", 200, "000000"),
        case("gmi99-6-16", "SS", 200, "001111"),
        case("gmi99-6-17", "SA", 200, "111000"),
    ],
)
def test_timers(kind: str, on_ms: int, bits: str) -> None:
    desk = running(f"OB 1\nU E 1.0\nL KT 004.1\n{kind} T 7\nU T 7\n= A 0.4\nBE\n")
    after(desk, 20).set("user_0", "high")
    desk.at((desk.time_ns + on_ms * 1_000_000) / 1e9, lambda: desk.set("user_0", "low"))
    seen = ""
    desk.run(0.1)
    for _ in range(6):
        seen += str(desk.outputs.get("a0.4", 0))
        desk.run(0.2)
    assert seen == bits


@shows("gmi99-6-18")
def test_a_counter_is_set_counts_and_is_reset() -> None:
    """998 by decimal digits, up twice and no further, down, 0."""
    desk = running(
        "OB 1\nU E 1.0\nL KZ 998\nS Z 4\nU E 1.1\nZV Z 4\nU E 1.2\nZR Z 4\nU E 1.3\nR Z 4\nL Z 4\nT MW 40\nBE\n"
    )
    seen = []
    for user in (0, 1, 1, 2, 3):
        desk.set(f"user_{user}", "high")
        seen.append(word(after(desk, 20), 40))
        desk.set(f"user_{user}", "low")
        after(desk, 20)
    assert seen == [998, 999, 999, 998, 0]


@shows("gmi99-6-19")
def test_jumps_by_the_condition_of_word_logic() -> None:
    """SPZ for a result of 0, SPN and SPP for any other, SPM for none: a pattern of bits has no sign."""
    lines = [f"L MW 30\nL KH 8001\nUW\n{jump} =A{n}\nSPA =B{n}\nA{n}: L KB 1\nT MB {40 + n}\nB{n}: NOP0\n"
             for n, jump in enumerate(("SPZ", "SPN", "SPP", "SPM"))]  # fmt: skip
    clear = "L KB 0\nT MB 40\nT MB 41\nT MB 42\nT MB 43\n"
    desk = running("OB 1\n" + clear + "".join(lines) + "BE\n")
    for high, taken in ((0x80, [0, 1, 1, 0]), (0x40, [1, 0, 0, 0])):
        desk.ask(command("p", 11, 31, high))
        after(desk, 20)
        assert [flags(desk, 40 + n) for n in range(4)] == taken


@pytest.mark.parametrize(
    "text",
    [
        case("gmi99-6-20", "U E 1.0\nSPB PB 9"),
        case("gmi99-6-20", "U E 1.0\nSPB =ON\nBEA\nON: STP"),
        case("gmi99-6-20", "U E 1.0\nSPB =ON\nBEA\nON: )"),
        case("gmi99-6-21", "U E 1.0\nSPB =ON\nBEA\nON: " + "U(\n" * 9 + "O E 1.0\n" + ")\n" * 9),
    ],
)
def test_what_cannot_be_carried_out_stops_the_plc(text: str) -> None:
    """Bit 1 of the memory status, outputs 0."""
    desk = running(f"OB 1\nUN M 200.0\n= A 0.4\n{text}\nBE\n")
    assert after(desk, 20).outputs["a0.4"] == 1
    assert desk.ask(command("T", 3, 4)) == long(b"\0")
    desk.set("user_0", "high")
    after(desk, 20)
    assert (desk.outputs["a0.4"], desk.ask(command("T", 3, 4))) == (0, long(b"\x02"))
    assert desk.controller.fault
    desk.set("user_0", "low")
    desk.ask(PLC_START)
    assert after(desk, 20).outputs["a0.4"] == 1


GOOD = assemble("OB 1\nBE\n").image


@shows("gmi99-6-22")
@pytest.mark.parametrize(
    "image",
    [GOOD[:-1], GOOD[:-2] + b"\0\0", b"\x54" + GOOD[1:], GOOD[:4] + b"\x02" + GOOD[5:], GOOD[:6] + b"\xff" + GOOD[7:]],
    ids=["cut off", "no BE", "no image", "no OB 1", "outside"],
)
def test_what_is_no_program_is_not_loaded(image: bytes) -> None:
    """Bits 0 and 1 of the memory status, start has no effect; a good one clears them."""
    desk = fresh()
    desk.tell(PLC_STOP, PLC_BEGIN, long(b"a\0\0\0" + image), PLC_END)
    assert desk.ask(command("T", 3, 4)) == long(b"\x03")
    assert desk.tell(PLC_START, command("T", 3, 4)) == [OK, long(b"\x03")]
    desk.power_cycle()
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")
    load(desk, long(b"a\0\0\0" + GOOD))
    assert desk.ask(command("T", 3, 4)) == long(b"\0")


@shows("gmi99-6-22")
def test_a_program_comes_in_pieces_in_any_order() -> None:
    text = "OB 1\n" + "NOP0\n" * 80 + "UN M 200.0\n= A 0.4\nBE\n"
    desk = fresh()
    load(desk, *reversed(assembled(text)))
    assert after(desk, 20).outputs["a0.4"] == 1


@shows("gmi99-6-23")
@pytest.mark.parametrize(("instructions", "ms"), [(10, 4), (88, 4), (89, 8), (1000, 48), (2000, 92)])
def test_a_pass_takes_45_us_an_instruction(instructions: int, ms: int) -> None:
    """On the grid of 4 ms: 88 of them are 3.96 ms. Four of them change an output once a pass."""
    desk = running("OB 1\nUN M 30.0\n= M 30.0\n= A 0.4\n" + "NOP0\n" * (instructions - 4) + "BE\n")
    desk.run(1.0)
    changes = [t_ns for t_ns, name, _ in desk.output_log if name == "a0.4"]
    assert {b - a for a, b in itertools.pairwise(changes)} == {ms * 1_000_000}


@shows("gmi99-6-24")
@pytest.mark.parametrize(("power_on", "seen"), [(False, 21), (True, 22)])
def test_start_up_blocks(power_on: bool, seen: int) -> None:
    """Each at its occasion, once, before OB 1; which shows it to outputs from then on."""
    desk = running(
        "OB 1\nL MB 50\nT MB 51\nL MB 52\nI 1\nT MB 52\nBE\nOB 21\nL KB 21\nT MB 50\nBE\nOB 22\nL KB 22\nT MB 50\nBE\n"
    )
    if power_on:
        desk.power_cycle()
    after(desk, 10)
    desk.ask(command("p", 11, 50, 7))
    after(desk, 100)
    assert flags(desk, 50) == 7
    desk.tell(PLC_STOP)
    after(desk, 10)
    desk.tell(command("p", 11, 51, 0), PLC_START)
    after(desk, 20)
    assert flags(desk, 51) == 21, "started by hand again"
    if power_on:
        desk.power_cycle()
        assert flags(after(desk, 20), 51) == seen
