"""GMI99, sections 1.2, 3.1.1 G and H, 4, 6.1.2: circles, zero points, rotary axes, programs, direct commands."""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.gmi99_desk import (
    ABORT,
    BUSY,
    G91,
    OK,
    PRE,
    READY,
    STATUS,
    TO_0,
    TO_10000,
    TO_20000,
    Q,
    command,
    fresh,
    long,
    moved_s,
    prepared,
    running,
)
from conformance.rows import shows

FAST_CIRCLES = "68 08 08 68 E0 4E 01 00 00 0E 00 00 3D 16"
RECORD_0 = "68 0B 0B 68 E0 70 03 00 00 64 00 00 00 00 00 B7 16"
RECORDED = "68 0B 0B 68 E0 70 03 00 00 65 00 00 00 00 00 B8 16"
START_0 = "68 0B 0B 68 E0 70 03 00 00 01 00 00 00 00 00 54 16"
START_1 = "68 0B 0B 68 E0 70 03 00 00 01 00 00 01 00 00 55 16"


def record(number: int, *frames: str) -> tuple[str, ...]:
    """The frames that store a program."""
    return (command("p", 3, 100, number), *frames, command("p", 3, 101))


@shows("gmi99-1.2-3", "gmi99-3.1.1-9", "gmi99-3.1.2-29")
def test_a_quarter_circle() -> None:
    desk = prepared(FAST_CIRCLES, "68 05 05 68 E0 47 5B 00 00 82 16", "68 05 05 68 E0 47 03 00 00 2A 16")
    centre, end = "68 08 08 68 E0 83 F0 D8 FF 00 00 00 2A 16", "68 08 08 68 E0 83 F0 D8 FF 10 27 00 61 16"
    assert moved_s(desk, centre, end) == math.ceil(1.770809 * 250) / 250
    path = desk.steps.path()[:, :2]
    assert np.abs(np.hypot(path[:, 0] + 10_000, path[:, 1]) - 10_000).max() <= 1
    assert desk.counts[:2] == (-10_000, 10_000)
    assert path[100, 1] > 0, "counter-clockwise"


@shows("gmi99-1.2-4", "gmi99-3.1.1-9")
def test_the_speed_limit_of_circles() -> None:
    """sqrt(4 R) / 12 ms = 5270.46 Hz at R = 1000."""
    desk = prepared(FAST_CIRCLES, G91, "68 05 05 68 E0 47 02 00 00 29 16")
    centre, end = "68 08 08 68 E0 83 E8 03 00 00 00 00 4E 16", "68 08 08 68 E0 83 00 00 00 00 00 00 63 16"
    assert moved_s(desk, centre, end) == math.ceil(1.297659 * 250) / 250
    assert desk.counts[:2] == (0, 0)
    path = desk.steps.path()[:, :2]
    assert path[60, 1] > 0, "clockwise from the left of the centre: upwards"
    assert np.hypot(*desk.steps.delta[:, :2].T).max() * 250 <= 5270.46 + 250 * math.sqrt(2)


@shows("gmi99-3.1.1-9")
def test_the_end_of_a_circle_is_absolute_in_g90() -> None:
    desk = prepared(FAST_CIRCLES, command(0x83, 5000, 0))
    desk.finish()
    desk.tell(command("G", 3), command(0x83, -5000, 0), command(0x83, -5000, 0))
    desk.finish()
    assert desk.counts[:2] == (-5000, 0)
    assert desk.steps.path()[:, 1].max() == pytest.approx(5000, abs=1)


@shows("gmi99-3.1.1-9")
def test_a_circle_without_two_axes_is_dropped() -> None:
    desk = prepared(command("G", 2))
    assert desk.tell(command(0x81, 1000), command(0x83, 500, 500)) == [OK, OK]
    desk.finish()
    assert desk.counts[:2] == (0, 0)
    assert desk.controller.fault


@shows("gmi99-3.1.1-11", "gmi99-3.1.2-30", "gmi99-3.1.1-10", "gmi99-3.1.1-12")
def test_a_zero_point_and_off_again() -> None:
    desk = prepared("68 0B 0B 68 E0 47 36 00 00 E8 03 00 01 00 00 49 16", "68 05 05 68 E0 47 36 00 00 5D 16")
    assert desk.counts[0] == 0
    desk.ask("68 05 05 68 E0 81 00 00 00 61 16")
    desk.finish()
    assert desk.counts[0] == 1000
    assert desk.ask("68 0B 0B 68 E0 54 08 00 00 36 00 00 00 00 00 72 16") == "68 05 05 68 E0 5A E8 03 00 25 16"
    assert desk.tell("68 05 05 68 E0 47 35 00 00 5C 16", TO_0) == [OK, OK]
    desk.finish()
    assert desk.counts[0] == 0
    desk.tell(command("G", 54, 1), TO_0)
    desk.finish()
    assert desk.counts[0] == 1000, "the last one again"


@shows("gmi99-3.1.1-10", "gmi99-3.1.1-11", "gmi99-3.1.2-30")
def test_sixteen_zero_points_and_fine_corrections() -> None:
    """G54 with P1M = 15 and fine correction 5: 700 + 3; G55 is entry 1."""
    number, fine = 54 | 15 << 8, 0x85 << 16
    desk = prepared(command("G", number, 700, 1), command("G", 53 | fine, 3, 1), command("G", number | fine), TO_0)
    desk.finish()
    assert desk.counts[0] == 703
    assert desk.ask(command("T", 8, 53 | fine, 0)) == long(b"Z\x03\0\0")
    desk.tell(command("G", 53), TO_0)
    desk.finish()
    assert desk.counts[0] == 0, "both have ended"
    desk.tell(command("G", 55, -50, 1), command("G", 55), TO_0)
    desk.finish()
    assert desk.counts[0] == -50
    assert desk.ask(command("T", 8, 54 | 1 << 8, 0)) == long(b"Z\xce\xff\xff")


@shows("gmi99-3.1.1-11")
def test_zero_points_survive_the_mains() -> None:
    desk = prepared(command("G", 54, 700, 2))
    desk.power_cycle()
    assert desk.ask(command("T", 8, 54, 1)) == long(b"Z\xbc\x02\0")


@shows("gmi99-3.1.1-25")
def test_a_position_is_set_with_offsets() -> None:
    desk = prepared(command("G", 54, 1000, 1), command("G", 54), command("O", 0, 0))
    assert desk.set_position() == 1000


@shows("gmi99-3.1.1-15")
def test_temporary_zero_points_are_for_programs() -> None:
    desk = prepared(*record(0, command("G", 58, 40, 1), TO_0))
    assert desk.ask(command("G", 58, 40, 1)) == OK
    assert desk.controller.fault
    desk.ask(START_0)
    desk.finish()
    assert desk.counts[0] == 40


@shows("gmi99-3.1.1-17", "gmi99-3.1.2-8")
def test_rotary_axes() -> None:
    """A turn of 3600: from 100 to 3500 the short way is 200 backwards, and H12 puts -100 into the first turn."""
    desk = prepared(command("N", 3600, 40, 0), command(0x81, 100))
    desk.finish()
    desk.tell(command("G", 36), command(0x81, 3500))
    desk.finish()
    assert desk.counts[0] == -100
    desk.ask(command("H", 12, 0))
    assert desk.counts[0] == 3500
    desk.ask(command("H", 12, 2))
    assert desk.counts[0] == 3500 + 7200
    desk.ask(command("H", 12, 0x8100))
    assert desk.counts[0] == 3500


@shows("gmi99-4-1", "gmi99-4-2", "gmi99-6.1.1-3", "gmi99-6.1.1-6")
def test_a_program_is_stored_and_run() -> None:
    desk = fresh()
    desk.ask(Q)
    told = desk.tell(
        RECORD_0,
        "68 05 05 68 E0 81 E8 03 00 4C 16",
        "68 0B 0B 68 E0 70 0A 00 00 10 00 00 00 00 00 6A 16",
        TO_0,
        RECORDED,
    )
    assert told == [OK] * 5
    desk.run(1.0)
    assert desk.counts[0] == 0
    t0 = desk.time_ns
    assert desk.ask(START_0) == OK
    assert desk.outputs.get("a0.0", 0) == 0
    desk.at_ms(t0, 539)
    assert desk.status() == 0x90
    desk.at_ms(t0, 540)
    assert abs(desk.counts[0] - 1000) <= 1
    assert (t0 + 540_000_000, "a0.0", 1) in desk.output_log
    assert desk.outputs["spindle"] == 1
    assert bytes.fromhex(desk.ask(command("T", 1, 3, 0)))[6] & 4
    desk.finish()
    assert desk.time_ns - t0 == 1_080_000_000
    assert desk.counts[0] == 0
    flags = bytes.fromhex(desk.ask(command("T", 1, 3, 0)))
    assert flags[6] & 4 == 0
    assert flags[7] & 1 == 1
    assert bytes.fromhex(desk.ask(command("T", 1, 3, 2)))[6] == 0
    assert desk.ask(STATUS) == READY


@shows("gmi99-4-3", "gmi99-3.1.1-27")
def test_a_subprogram() -> None:
    desk = prepared()
    desk.tell(*record(0, START_1))
    stop = "68 0B 0B 68 E0 70 03 00 00 02 00 00 00 00 00 55 16"
    assert (
        desk.tell(*record(1, "68 05 05 68 E0 81 64 00 00 C5 16", stop, "68 05 05 68 E0 81 84 03 00 E8 16")) == [OK] * 5
    )
    desk.ask(START_0)
    desk.finish()
    assert desk.counts[0] == 100


@shows("gmi99-4-3")
def test_subprograms_are_eight_deep() -> None:
    """Program i moves axis 0 by 10 and calls i + 1; program 8 is the eighth, and a ninth is too many."""
    for last, way in ((8, 90), (9, 0)):
        desk = prepared(G91)
        for number in range(last + 1):
            call = (command("p", 3, 1, number + 1),) if number < last else ()
            desk.tell(*record(number, command(0x82, 1), *call, command(0x81, 10)))
        desk.ask(START_0)
        desk.finish()
        assert desk.counts[0] == way
        assert desk.controller.fault == (last == 9)


@shows("gmi99-4-4", "gmi99-3.1.1-28")
def test_program_0_clears_the_store() -> None:
    desk = prepared()
    desk.tell(*record(0, TO_0), *record(1, TO_10000), *record(0, TO_0))
    assert desk.ask("68 0B 0B 68 E0 70 03 00 00 01 00 00 01 00 00 55 16") == OK
    desk.run(1.0)
    assert desk.counts[0] == 0
    assert desk.ask("68 08 08 68 E0 54 03 00 00 04 00 00 3B 16") == "68 02 02 68 E0 12 F2 16"


@shows("gmi99-3.1.2-12", "gmi99-3.1.2-31")
def test_questions_during_a_recording() -> None:
    desk = fresh()
    told = desk.tell(
        "68 0B 0B 68 E0 70 03 00 00 64 00 00 00 00 00 B7 16",
        "68 08 08 68 E0 54 01 00 00 00 00 00 35 16",
        "68 0B 0B 68 E0 70 0B 00 00 0D 00 00 05 00 00 6D 16",
        "68 0B 0B 68 E0 70 03 00 00 65 00 00 00 00 00 B8 16",
        command("T", 1, 3, 13),
        START_0,
        command("T", 1, 3, 13),
    )
    assert told == [OK, "68 04 04 68 E0 56 E8 01 1F 16", OK, OK, long(b"I\0\0"), OK, long(b"I\x05\0")]


@shows("gmi99-4-5")
def test_programs_survive_the_mains() -> None:
    desk = fresh()
    desk.tell(*record(0, TO_10000), command("p", 3, 100, 1), TO_0)
    desk.power_cycle()
    desk.tell(*PRE, START_0)
    desk.finish()
    assert desk.counts[0] == 10_000
    desk.ask(START_1)
    assert desk.ask(command("T", 3, 4)) == long(b"\x12"), "a recording that the mains ended is no program"


@shows("gmi99-3.2-1", "gmi99-6.1.1-7")
def test_an_abort_ends_a_program() -> None:
    desk = prepared(*record(0, TO_20000, TO_0), START_0)
    desk.run(1.0)
    desk.tell(ABORT)
    desk.finish()
    assert desk.counts[0] == 10_000
    assert bytes.fromhex(desk.ask(command("T", 1, 3, 0)))[6] & 4 == 0


@shows("gmi99-6.1.1-3", "gmi99-6.1.1-8")
def test_a_flag_starts_a_program() -> None:
    desk = prepared(*record(0, TO_0), *record(3, TO_10000), command("p", 11, 2, 3), command("p", 11, 0, 4))
    desk.finish()
    assert desk.counts[0] == 10_000


@shows("gmi99-6.1.2-7")
def test_waiting() -> None:
    desk = fresh()
    assert desk.tell(Q, "68 0B 0B 68 E0 70 0A 00 00 0E 00 00 05 00 00 6D 16") == [OK, OK]
    desk.run(0.499_999)
    assert desk.ask(STATUS) == BUSY
    desk.run(0.000_001)
    assert desk.ask(STATUS) == READY


@shows("gmi99-6.1.2-5")
def test_waiting_for_a_flag() -> None:
    desk = fresh()
    assert desk.tell(Q, "68 0B 0B 68 E0 70 0A 00 00 0A 00 00 F3 00 00 57 16") == [OK, OK]
    desk.run(1.0)
    assert desk.ask(STATUS) == BUSY
    assert desk.ask("68 0B 0B 68 E0 70 0B 00 00 1E 00 00 08 00 00 81 16") == OK
    assert desk.ask(STATUS) == READY


@pytest.mark.parametrize(
    ("opcode", "operand", "change"),
    [
        pytest.param(2, 8, ("user_0", "high"), marks=shows("gmi99-6.1.2-1"), id="WOSI"),
        pytest.param(3, 5, ("key", "setup"), marks=shows("gmi99-6.1.2-2"), id="WORI"),
    ],
)
def test_waiting_for_an_input(opcode: int, operand: int, change: tuple[str, str]) -> None:
    desk = fresh()
    desk.ask(Q)
    if opcode == 3:
        desk.set("e0.5", True)
    desk.ask(command("p", 10, opcode, operand))
    assert desk.ask(STATUS) == BUSY
    desk.set("e0.5", False) if opcode == 3 else desk.set(*change)
    assert desk.ask(STATUS) == READY


@shows("gmi99-6.1.2-4")
def test_waiting_until_an_output_is_reset() -> None:
    """A0.4 is what the PLC makes of E1.0."""
    desk = running("OB 1\nU E 1.0\n= A 0.4\nBE\n")
    desk.set("user_0", "high")
    desk.run(0.1)
    desk.ask(command("p", 10, 7, 4))
    desk.run(0.1)
    assert desk.ask(STATUS) == BUSY
    desk.set("user_0", "low")
    desk.run(0.1)
    assert desk.ask(STATUS) == READY


@shows("gmi99-6.1.2-6")
def test_waiting_until_a_flag_is_reset() -> None:
    """Flag 243 is bit 3 of byte 30."""
    desk = fresh()
    desk.tell(Q, command("p", 11, 30, 8), command("p", 10, 11, 243))
    desk.run(1.0)
    assert desk.ask(STATUS) == BUSY
    desk.tell(command("p", 11, 30, 0))
    assert desk.ask(STATUS) == READY


@shows("gmi99-4-2")
def test_moves_of_a_program_join() -> None:
    """20 000 in two moves take as long as in one: 2 s, and 0.2 s for both ramps."""
    desk = prepared(*record(0, TO_10000, TO_20000))
    assert moved_s(desk, START_0) == 2.2
    assert desk.counts[0] == 20_000


@shows("gmi99-6.1.2-8", "gmi99-6.1.2-3")
def test_an_output_on_the_fly() -> None:
    desk = prepared()
    told = desk.tell(
        "68 05 05 68 E0 81 10 27 00 98 16",
        "68 0B 0B 68 E0 70 0A 00 00 10 00 00 03 00 00 6D 16",
        "68 05 05 68 E0 81 20 4E 00 CF 16",
    )
    assert told == [OK] * 3
    desk.tell(command("p", 10, 6, 3), command("p", 10, 16, 4))
    t0 = desk.time_ns
    desk.finish()
    assert desk.time_ns - t0 == 2_200_000_000
    assert set(desk.steps.delta[51:-51, 0].tolist()) == {40}
    switched = {name: t_ns for t_ns, name, value in desk.output_log if value and name.startswith("a0.")}
    passed = int(desk.steps.t_ns[np.searchsorted(desk.steps.path()[:, 0], 10_000)])
    assert switched["a0.3"] == passed == t0 + 1_100_000_000
    assert switched["a0.4"] == t0 + 2_200_000_000


@shows("gmi99-6.1.2-9", "gmi99-6.1.2-10", "gmi99-6.1.2-11")
def test_outputs_off_inverted_and_cleared() -> None:
    desk = fresh()
    desk.tell(Q, *(command("p", 10, 16, bit) for bit in (0, 1, 40)))
    assert [desk.outputs[name] for name in ("a0.0", "a0.1", "a5.0")] == [1, 1, 1]
    assert (desk.outputs["spindle"], desk.outputs["hood_release"]) == (1, 0)
    desk.tell(command("p", 10, 17, 0), command("p", 10, 24, 1), command("p", 10, 24, 2))
    assert [desk.outputs[name] for name in ("a0.0", "a0.1", "a0.2", "a5.0")] == [0, 0, 1, 1]
    desk.ask(command("p", 10, 26, 0))
    assert not any(value for name, value in desk.outputs.items() if name.startswith("a") and name != "analog")


@shows("gmi99-3.1.1-20", "gmi99-6.1.1-12")
def test_an_m_function_waits_for_the_plc() -> None:
    desk = fresh()
    told = desk.tell(
        "68 08 08 68 E0 51 07 00 00 00 00 00 38 16",
        "68 08 08 68 E0 6D 3A 00 00 07 00 00 8E 16",
        "10 E0 01 E1 16",
        "68 0B 0B 68 E0 54 01 00 00 03 00 00 07 00 00 3F 16",
        command("T", 1, 3, 11),
        "10 E0 00 E0 16",
        "10 E0 01 E1 16",
    )
    assert told == [OK, OK, "10 E0 80 60 16", "68 04 04 68 E0 49 01 00 2A 16", long(b"I\x07\0"), OK, READY]


@shows("gmi99-3.1.1-20", "gmi99-3.1.1-21", "gmi99-3.1.1-22")
@pytest.mark.parametrize(
    ("frame", "byte", "expected", "done"),
    [
        (command("m", 89), 10, b"\x80\x00", 0),
        (command("m", 100, 2, 3000), 15, b"\x82\xb8", 2),
        (command("m", 101, 42), 18, b"\xaa\x00", 42),
    ],
)
def test_requests_to_the_plc(frame: str, byte: int, expected: bytes, done: int) -> None:
    desk = fresh()
    assert desk.tell(Q, frame, STATUS, command("T", 1, 3, byte)) == [OK, OK, BUSY, long(b"I" + expected)]
    assert desk.tell(command("p", 11, byte, done), STATUS) == [OK, READY]


@shows("gmi99-6.1.1-13")
def test_the_synchronisation_stop_holds_barriers() -> None:
    desk = prepared(command("p", 11, 1, 8))
    desk.tell(TO_10000, command("p", 10, 24, 4), TO_0)
    desk.run(3.0)
    assert desk.counts[0] == 10_000
    desk.ask(command("p", 11, 1, 0))
    desk.finish()
    assert desk.counts[0] == 0


@shows("gmi99-6-1")
def test_the_images_of_drives_and_cards() -> None:
    """With I/O cards the drives are behind them: E24.0 is then what E0.0 was."""
    desk = fresh()
    before = bytes.fromhex(desk.ask(command("T", 1, 1, 0)))[6:8]
    assert desk.ask(command("N", 1, 13)) == OK
    assert bytes.fromhex(desk.ask(command("T", 1, 1, 24)))[6:8] == before
    assert desk.ask(command("T", 1, 1, 0)) == long(b"I\0\0")
    desk.set("user_2", "high")
    assert bytes.fromhex(desk.ask(command("T", 1, 1, 25)))[6] & 4
