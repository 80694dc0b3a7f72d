"""GMI99, sections 3.1.1 and 3.1.2: what is set and asked, without motion."""

from __future__ import annotations

import pytest
from conformance.gmi99_desk import OK, READY, STATUS, TO_20000, command, fresh, long, moved_s, prepared
from conformance.rows import case, shows


@shows("gmi99-3.1.2-17")
def test_version() -> None:
    assert fresh().ask("68 08 08 68 E0 54 01 00 00 00 00 00 35 16") == "68 04 04 68 E0 56 E8 01 1F 16"


@shows("gmi99-3.1.2-12", "gmi99-3.1.2-19")
def test_a_flag_byte_is_set_and_read() -> None:
    desk = fresh()
    set_13 = "68 0B 0B 68 E0 70 0B 00 00 0D 00 00 01 00 00 69 16"
    ask_13 = "68 0B 0B 68 E0 54 01 00 00 03 00 00 0D 00 00 45 16"
    assert desk.tell(set_13, ask_13) == [OK, "68 04 04 68 E0 49 01 00 2A 16"]


@shows("gmi99-3.1.1-3", "gmi99-3.1.2-20")
def test_a_data_word_is_set_and_read() -> None:
    desk = fresh()
    told = desk.tell("68 08 08 68 E0 64 34 12 00 04 00 00 8E 16", "68 0B 0B 68 E0 54 01 00 00 06 00 00 04 00 00 3F 16")
    assert told == [OK, "68 04 04 68 E0 49 34 12 6F 16"]


@shows("gmi99-3.1.2-1", "gmi99-3.1.2-2")
def test_a_register_lies_in_the_data_area() -> None:
    desk = fresh()
    told = desk.tell(
        "68 08 08 68 E0 63 FE FF FF 03 00 00 42 16",
        "68 0B 0B 68 E0 54 01 00 00 06 00 00 0C 00 00 47 16",
        "68 0B 0B 68 E0 54 01 00 00 06 00 00 0E 00 00 49 16",
    )
    assert told == [OK, "68 04 04 68 E0 49 FE FF 26 16", "68 04 04 68 E0 49 FF FF 27 16"]


@shows("gmi99-3.1.1-4")
def test_data_words_survive_the_mains() -> None:
    desk = fresh()
    desk.tell(command("d", 0x1234, 158), command("d", 0x5678, 160))
    desk.power_cycle()
    assert desk.tell(command("T", 1, 6, 158), command("T", 1, 6, 160)) == [long(b"I\x34\x12"), long(b"I\0\0")]


@shows("gmi99-3.1.2-3", "gmi99-3.1.2-22")
def test_an_n_parameter_is_set_and_read() -> None:
    desk = fresh()
    told = desk.tell("68 08 08 68 E0 4E 02 00 00 0C 00 00 3C 16", "68 08 08 68 E0 54 05 00 00 0C 00 00 45 16")
    assert told == [OK, "68 05 05 68 E0 4E 02 00 00 30 16"]


@pytest.mark.parametrize(
    ("number", "value", "slot"),
    [
        case("gmi99-3.1.2-4", 0x008, -70, 0),
        case("gmi99-3.1.2-4", 0x509, 70, 0),
        case("gmi99-3.1.2-5", 10, 5, 0),
        case("gmi99-3.1.2-6", 11, 77, 0),
        case("gmi99-3.1.2-8", 40, 3600, 4),
        case("gmi99-3.1.2-9", 1000, 123_456, 0),
    ],
)
def test_a_parameter_is_kept_as_it_was_given(number: int, value: int, slot: int) -> None:
    told = fresh().tell(command("N", value, number, slot), command("T", 5, number, slot))
    assert told == [OK, long(b"N" + (value & 0xFFFFFF).to_bytes(3, "little"))]


@shows("gmi99-3.1.2-7")
def test_the_number_of_input_cards_is_0_to_6_and_moves_the_drives_inputs() -> None:
    """With cards the first 24 bytes are theirs, and those of the drives are EB24 on (section 6)."""
    desk = fresh()
    e0 = desk.ask(command("T", 1, 1, 0))
    nothing = long(b"I\0\0")
    assert e0 != nothing
    for cards in (1, 6, 0, 3):
        assert desk.tell(command("N", cards, 13), command("T", 5, 13)) == [OK, long(bytes([ord("N"), cards, 0, 0]))]
        here, behind = desk.tell(command("T", 1, 1, 0), command("T", 1, 1, 24))
        assert (here, behind) == ((nothing, e0) if cards else (e0, nothing)), cards
    assert desk.ask(command("T", 5, 12)) == long(b"N\0\0\0"), "those for outputs are counted by N12"
    assert not desk.controller.fault
    for wrong in (7, -1):
        assert desk.tell(command("N", wrong, 13), command("T", 5, 13)) == [OK, long(b"N\x03\0\0")]
        assert desk.controller.fault


@shows("gmi99-3.1.2-10")
@pytest.mark.parametrize(("given", "kept"), [(300, 100), (101, 100), (100, 100), (40, 40)])
def test_fs90_is_limited_by_fs0(given: int, kept: int) -> None:
    desk = fresh()
    desk.tell(command("N", 100, 11), command("N", given, 16))
    assert desk.ask(command("T", 5, 16)) == long(bytes([ord("N"), kept, 0, 0]))


@shows("gmi99-3.1.1-25", "gmi99-3.1.2-16")
def test_a_position_is_set_and_read() -> None:
    desk = fresh()
    told = desk.tell("68 08 08 68 E0 4F FB FF FF 00 00 00 28 16", "68 08 08 68 E0 54 00 00 00 00 00 00 34 16")
    assert told == [OK, "68 05 05 68 E0 40 FB FF FF 19 16"]
    assert desk.counts[0] == -5
    assert desk.carriage[0] == 100_000


@pytest.mark.parametrize(
    "frame",
    [
        case("gmi99-3.1.1-1", command("B", 0)),
        case("gmi99-3.1.1-1", command("B", 30_001)),
        case("gmi99-3.1.1-18", command("M", 4)),
        case("gmi99-3.1.1-18", command("M", 1_000_001)),
        case("gmi99-3.1.1-32", command("R", 4)),
        case("gmi99-3.1.1-25", command("O", -8_388_353, 0)),
        case("gmi99-3.1.1-25", command("O", 0, 6)),
        case("gmi99-3.1.1-20", command("m", 49)),
        case("gmi99-3.1.1-3", command("d", 1, 255)),
        case("gmi99-3.1.1-36", command("s", 85, 171)),
        case("gmi99-3.1.1-40", command("W", 1, 0, 7)),
        case("gmi99-3.1.2-2", command("c", 1, 20)),
        case("gmi99-3.1.2-11", command("o", 2, 101)),
        case("gmi99-3.1.2-5", command("N", 64, 10)),
    ],
)
def test_a_value_out_of_range_is_acknowledged_and_has_no_effect(frame: str) -> None:
    """Decision gmi99/6."""
    desk = prepared()
    assert desk.ask(frame) == OK
    assert desk.controller.fault
    assert desk.ask(STATUS) == READY
    assert desk.tell("10 E0 00 E0 16") == [OK]
    assert not desk.controller.fault


@shows("gmi99-3.1.1-36", "gmi99-3.1.1-37")
def test_settings_survive_when_they_were_saved() -> None:
    """20000 increments at 12345 Hz and 77 Hz/ms: 20000/12345 + 12345/77000 s; unsaved at 2000 Hz and 50 Hz/ms."""
    desk = fresh()
    settings = ("68 05 05 68 E0 42 4D 00 00 6F 16", "68 05 05 68 E0 4D 39 30 00 96 16")
    save = "68 08 08 68 E0 73 55 00 00 AA 00 00 52 16"
    assert desk.tell(*settings) == [OK] * 2
    desk.power_cycle()
    assert moved_s(desk, command("Q", 7), command("G", 0), TO_20000) == pytest.approx(10.04, abs=0.004)
    assert desk.tell(*settings, save) == [OK] * 3
    desk.power_cycle()
    expected = 20_000 / 12_345 + 12_345 / 77_000
    assert 0 <= moved_s(desk, command("Q", 7), command("G", 0), TO_20000) - expected <= 0.0041


@shows("gmi99-3.1.1-34", "gmi99-3.1.1-35")
def test_r_sets_defaults_and_erases() -> None:
    desk = fresh()
    desk.tell(command("N", 5, 10), command("s", 85, 170), command("d", 7, 0), command("r"))
    assert desk.ask(command("T", 5, 10)) == long(b"N\x07\x00\x00")
    desk.power_cycle()
    assert desk.tell(command("T", 5, 10), command("T", 1, 6, 0)) == [long(b"N\x05\x00\x00"), long(b"I\x07\x00")]
    desk.tell(command("r", 0, 0, 1))
    desk.power_cycle()
    assert desk.tell(command("T", 5, 10), command("T", 1, 6, 0)) == [long(b"N\x07\x00\x00"), long(b"I\x00\x00")]


@shows("gmi99-3.1.2-14")
def test_q_asks_the_plc_to_report_again() -> None:
    desk = fresh()
    assert desk.tell(command("q"), command("T", 1, 3, 3)) == [OK, long(b"I\x02\x00")]


@shows("gmi99-3.1.2-18")
def test_the_images_are_read() -> None:
    """Inputs of the fixture at rest: E0 power, stop, hood twice, spindle (gmi99/19)."""
    desk = fresh()
    low = bytes.fromhex(desk.ask(command("T", 1, 1, 0)))[6]
    assert low & 1
    desk.set("user_3", "high")
    assert bytes.fromhex(desk.ask(command("T", 1, 1, 0)))[7] & 8
    desk.tell(command("p", 10, 16, 9))
    assert desk.ask(command("T", 1, 2, 0)) == long(b"I\x00\x02")


@shows("gmi99-3.1.2-23")
def test_the_memory_status_of_a_new_card() -> None:
    """No PLC program runs: bit 1."""
    assert fresh().ask(command("T", 3, 4)) == long(b"\x02")


@shows("gmi99-3.1.2-24")
def test_the_safety_status() -> None:
    desk = fresh()
    assert desk.ask(command("T", 3, 8)) == long(b"\x02")
    desk.tell(command("Q", 7), command("p", 11, 0, 1))
    assert desk.ask(command("T", 3, 8)) == long(b"\x04")
