"""GMI99, sections 2 and 3.2: frames, addresses, switches, the way through to the drives."""

from __future__ import annotations

import pytest
from conformance.gmi99_desk import NOT_READY, OK, PRE, READY, STATUS, TO_20000, command, fresh, long, prepared, short
from conformance.rows import shows

Q7 = "68 08 08 68 E0 51 07 00 00 00 00 00 38 16"


@shows("gmi99-2.1-1", "gmi99-3.2-2", "gmi99-3.2-7")
def test_after_power_on_the_indexer_is_not_ready() -> None:
    assert fresh().ask("10 E0 01 E1 16") == "10 E0 40 20 16"


@shows("gmi99-3.1.1-30", "gmi99-3.2-8")
def test_q_makes_it_ready() -> None:
    assert fresh().tell("68 08 08 68 E0 51 07 00 00 00 00 00 38 16", "10 E0 01 E1 16") == [OK, "10 E0 00 E0 16"]


@shows("gmi99-3.2-1")
def test_abort_is_acknowledged() -> None:
    assert fresh().ask("10 E0 00 E0 16") == "E5"


@shows("gmi99-2.1-2")
@pytest.mark.parametrize(
    "damaged", ["10 E0 01 E0 16", "68 05 06 68 E0 81 EE 00 00 4F 16", "68 05 05 68 E0 81 EE 00 00 4F 17"]
)
def test_a_damaged_frame_has_no_answer_and_no_effect(damaged: str) -> None:
    desk = fresh()
    assert desk.tell(damaged, STATUS) == ["", NOT_READY]
    assert desk.controller.idle
    assert not desk.controller.fault


@shows("gmi99-2.1-3")
def test_another_address_is_not_answered() -> None:
    assert fresh().ask("10 E1 01 E2 16") == ""


@shows("gmi99-2.1-4")
def test_noise_before_a_frame_does_no_harm() -> None:
    assert fresh().ask("00 FF 68 68 10 E0 01 E1 16") == NOT_READY


@shows("gmi99-2.1-5")
def test_a_torn_frame_is_dropped() -> None:
    desk = fresh()
    answers = desk.tell("10 E0")
    desk.run(0.080)
    answers += desk.tell("01 E1 16")
    desk.run(0.080)
    assert answers + desk.tell("10 E0 01 E1 16") == ["", "", NOT_READY]


@shows("gmi99-2.1-6")
def test_a_frame_may_come_byte_by_byte() -> None:
    desk = fresh()
    desk.send(bytes.fromhex(STATUS), byte_time_ns=286_458)
    assert desk.replies[-1][1].hex(" ").upper() == NOT_READY


@shows("gmi99-2.2-3")
def test_the_other_wire_variant() -> None:
    desk = fresh(dil_switches="11111101")
    assert desk.ask("10 01 E0 E1 16") == "10 40 E0 20 16"
    body = bytes.fromhex("43 E0 54 01 00 00 00 00 00")
    asked = bytes([0x68, 9, 9, 0x68]) + body + bytes([sum(body) % 256, 0x16])
    told = bytes.fromhex("08 E0 56 E8 01")
    assert desk.ask(asked.hex()) == (b"\x68\x05\x05\x68" + told + bytes([sum(told) % 256, 0x16])).hex(" ").upper()


@shows("gmi99-2.2-1")
@pytest.mark.parametrize(("switches", "address"), [("1111", 0xE0), ("0111", 0xE1), ("0001", 0xE7), ("1010", 0xEA)])
def test_the_address_is_that_of_the_switches(switches: str, address: int) -> None:
    desk = fresh(dil_switches=switches + "1111")
    for other in (0xE0, 0xE1, 0xE7, 0xEA):
        expected = short(0x40, address=address) if other == address else ""
        assert desk.ask(short(1, address=other)) == expected
    if address == 0xE7:
        assert desk.ask("10 E7 01 E8 16") == "10 E7 40 27 16"


@shows("gmi99-2.2-2")
def test_address_239_is_the_loader_alone() -> None:
    desk = fresh(dil_switches="00001111")
    assert desk.ask(short(1, address=239)) == ""


@shows("gmi99-2.2-4")
@pytest.mark.parametrize(("switch", "line"), [("1", "38400 8E1"), ("0", "9600 8E1")])
def test_the_speed_is_that_of_switch_8(switch: str, line: str) -> None:
    assert str(fresh(dil_switches="1111111" + switch).controller.serial_format) == line


@shows("gmi99-2-1")
def test_through_to_a_drive() -> None:
    desk = fresh()
    assert desk.ask("10 00 01 01 16") == "10 00 40 40 16"
    desk.ask(Q7)
    assert desk.tell("10 00 01 01 16", "10 03 01 04 16") == ["10 00 00 00 16", "10 03 40 43 16"]


@shows("gmi99-2-2")
def test_a_drive_says_its_encoder() -> None:
    desk = prepared()
    desk.ask(command(0x82, -5))
    desk.finish()
    assert desk.ask(command("T", 0, address=1)) == long(b"@\xfb\xff\xff", address=1)


@shows("gmi99-3.1.2-15")
def test_the_address_list() -> None:
    desk = fresh()
    told = desk.tell("68 0B 0B 68 E0 4E 00 01 02 12 00 00 FF FF FF 40 16", "10 05 01 06 16", "10 00 01 01 16")
    assert told == [OK, "", "10 00 40 40 16"]
    assert desk.tell(command("N", -1, 18, -1), "10 05 01 06 16") == [OK, "10 05 40 45 16"]


@shows("gmi99-3-2")
def test_a_length_that_cannot_be_right_is_no_command() -> None:
    desk = prepared()
    wrong = (long(b"B\x4d"), long(b"Q\x07\x00"), long(b"\x81\x01\x00"), long(b"\x81\x01\x00\x00\x00\x00\x00"))
    assert desk.tell(*wrong) == [""] * 4
    assert desk.tell(long(b"y"), long(b"e\x01\x00\x00")) == ["", ""]
    assert desk.ask(STATUS) == READY


@shows("gmi99-3-1")
def test_parameters_may_be_left_out_and_are_low_byte_first() -> None:
    desk = fresh()
    assert desk.ask(long(b"T")) == long(b"@\0\0\0")
    assert desk.tell(long(b"d\x34\x12\x00"), command("T", 1, 6, 0)) == [OK, long(b"I\x34\x12")]


@shows("gmi99-3.3-1", "gmi99-3.3-2")
def test_the_buffer_takes_100_moves() -> None:
    desk = prepared("68 05 05 68 E0 47 5B 00 00 82 16", "68 05 05 68 E0 66 64 00 00 AA 16")
    move = "68 05 05 68 E0 81 E8 03 00 4C 16"
    assert desk.tell(*[move] * 101) == [OK] * 100 + ["10 E0 08 E8 16"]
    desk.run(9.9)
    assert desk.ask(move) == "10 E0 08 E8 16"
    desk.run(0.2)
    assert desk.tell(move, move) == [OK, "10 E0 08 E8 16"]


@shows("gmi99-3.2-3", "gmi99-3.2-4")
def test_a_message_goes_with_the_status_once() -> None:
    desk = fresh()
    told = desk.tell(Q7, "68 0B 0B 68 E0 70 0B 00 00 04 00 00 17 00 00 76 16", STATUS, STATUS)
    assert told == [OK, OK, "10 E0 02 17 F9 16", "10 E0 00 E0 16"]


@shows("gmi99-3.2-6")
def test_a_status_shows_motion_and_business() -> None:
    desk = prepared()
    assert desk.tell(TO_20000, STATUS) == [OK, "10 E0 90 70 16"]
    desk.finish()
    assert desk.ask(STATUS) == READY


@shows("gmi99-3.1.2-21")
def test_t3_0_is_the_status_record() -> None:
    assert fresh().ask(command("T", 3, 0)) == NOT_READY


def test_preparation_is_as_said() -> None:
    assert fresh().tell(*PRE) == [OK] * 3
