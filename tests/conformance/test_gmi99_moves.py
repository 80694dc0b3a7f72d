"""GMI99, sections 1 and 3.1.1: straight moves, their speeds, corners, overrides and stops.

Expected times and places are closed forms: at f and the ramp a = B 1000 a straight way n takes n/f + f/a, of which
f^2/(2a) increments are on each ramp; a move that does not reach f takes 2 sqrt(n/a). A move ends in the first tick at
or after that.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from conformance.gmi99_desk import (
    BUSY_MOVING,
    G91,
    NOT_READY,
    OK,
    PRE,
    READY,
    STATUS,
    TICK_NS,
    TO_238,
    TO_10000,
    TO_20000,
    CardDesk,
    command,
    fresh,
    long,
    moved_s,
    prepared,
    short,
)
from conformance.rows import shows


def ends_after(seconds: float) -> float:
    """The first time of the grid that is not before."""
    return math.ceil(round(seconds * 250, 6)) / 250


def ticks_of(desk: CardDesk, axis: int = 0) -> list[int]:
    """Changes of an axis, tick by tick."""
    return [int(n) for n in desk.steps.delta[:, axis]]


@shows("gmi99-3.1.1-38", "gmi99-3.1.1-39")
def test_the_printed_examples() -> None:
    desk = fresh()
    assert (
        desk.tell("68 08 08 68 E0 4E 3F 00 00 0A 00 00 77 16", "68 08 08 68 E0 51 3F 00 00 00 00 00 70 16") == [OK] * 2
    )
    moves = (
        "68 05 05 68 E0 81 EE 00 00 4F 16",
        "68 08 08 68 E0 89 1E 00 00 F4 01 00 7C 16",
        "68 0B 0B 68 E0 96 46 00 00 0F 00 00 64 00 00 2F 16",
    )
    for move in moves:
        assert desk.ask(move) == OK
        desk.finish()
    assert desk.counts == (30, 70, 15, 500, 100, 0)


@shows("gmi99-3.1.1-2", "gmi99-1.2-1")
def test_a_straight_move_with_linear_ramps() -> None:
    desk = prepared()
    t0 = desk.time_ns
    desk.ask(TO_20000)
    expected = {8: 2, 20: 10, 100: 250, 200: 1000, 204: 1040, 1000: 9000, 2100: 19_750}
    for ms, place in expected.items():
        desk.at_ms(t0, ms)
        assert abs(desk.set_position() - place) <= 1, ms
    desk.at_ms(t0, 2199)
    assert desk.ask(STATUS) == BUSY_MOVING
    desk.at_ms(t0, 2200)
    assert desk.set_position() == 20_000
    assert desk.ask(STATUS) == READY
    assert set(np.diff(desk.steps.t_ns).tolist()) == {TICK_NS}


@shows("gmi99-3.1.2-13", "gmi99-3.1.1-2")
def test_sine_ramps_take_half_pi_longer() -> None:
    desk = prepared("68 08 08 68 E0 4E 01 00 00 18 00 00 47 16")
    t0 = desk.time_ns
    desk.ask(TO_20000)
    for ms, place in {100: 79, 200: 545, 312: 1549, 1000: 8429}.items():
        desk.at_ms(t0, ms)
        assert abs(desk.set_position() - place) <= 1, ms
    desk.finish()
    assert desk.time_ns - t0 == 2_316_000_000


@shows("gmi99-3.1.1-1")
def test_a_short_move_has_no_constant_part() -> None:
    """500 increments at 50 Hz/ms: 2 sqrt(500/50000) = 0.2 s, peak 5000 Hz."""
    desk = prepared()
    t0 = desk.time_ns
    desk.ask("68 05 05 68 E0 81 F4 01 00 56 16")
    desk.at_ms(t0, 100)
    assert abs(desk.set_position() - 250) <= 1
    desk.finish()
    assert desk.time_ns - t0 == 200_000_000
    assert max(ticks_of(desk)) <= 20


@shows("gmi99-1.3-1", "gmi99-3.1.1-41")
def test_the_resulting_speed_is_programmed() -> None:
    desk = prepared("68 05 05 68 E0 66 88 13 00 E1 16")
    t0 = desk.time_ns
    desk.ask("68 08 08 68 E0 83 B8 0B 00 A0 0F 00 D5 16")
    desk.at_ms(t0, 500)
    assert np.abs(np.subtract(desk.counts[:2], (1350, 1800))).max() <= 1
    desk.finish()
    assert desk.time_ns - t0 == 1_100_000_000


@shows("gmi99-3.1.1-42")
def test_without_tool_speed_control_the_longest_axis_has_the_speed() -> None:
    desk = prepared("68 05 05 68 E0 66 88 13 00 E1 16", "68 05 05 68 E0 57 00 00 00 37 16")
    t0 = desk.time_ns
    desk.ask("68 08 08 68 E0 83 D0 07 00 A0 0F 00 E9 16")
    desk.at_ms(t0, 500)
    assert np.abs(np.subtract(desk.counts[:2], (1125, 2250))).max() <= 1
    desk.finish()
    assert desk.time_ns - t0 == 900_000_000


@shows("gmi99-3.1.1-41")
def test_the_same_with_tool_speed_control() -> None:
    desk = prepared("68 05 05 68 E0 66 88 13 00 E1 16")
    t0 = desk.time_ns
    desk.ask("68 08 08 68 E0 83 D0 07 00 A0 0F 00 E9 16")
    desk.at_ms(t0, 500)
    assert np.abs(np.subtract(desk.counts[:2], (1006, 2012))).max() <= 1
    desk.finish()
    assert desk.time_ns - t0 == ends_after(0.994427) * 1e9


@shows("gmi99-1.1-1", "gmi99-3.1.1-40")
def test_an_axis_of_twice_the_resolution_runs_twice_as_fast() -> None:
    desk = prepared("68 0B 0B 68 E0 57 01 00 00 00 80 00 02 00 00 BA 16", "68 05 05 68 E0 66 E8 03 00 31 16")
    t0 = desk.time_ns
    desk.ask("68 05 05 68 E0 82 D0 07 00 39 16")
    for ms, place in {100: 180, 500: 980}.items():
        desk.at_ms(t0, ms)
        assert abs(desk.counts[1] - place) <= 1
    desk.finish()
    assert desk.time_ns - t0 == ends_after(1.020015) * 1e9


@shows("gmi99-1-2", "gmi99-1-1")
def test_moves_in_one_direction_join() -> None:
    desk = prepared()
    assert moved_s(desk, TO_10000, TO_20000) == 2.2
    changes = ticks_of(desk)
    assert set(changes[51:-51]) == {40}


@shows("gmi99-3.1.1-44")
def test_a_command_that_is_not_synchronous_parts_them() -> None:
    desk = prepared()
    t0 = desk.time_ns
    assert desk.tell(TO_10000, "68 05 05 68 E0 47 5E 00 00 85 16", TO_20000) == [OK] * 3
    desk.at_ms(t0, 1200)
    assert desk.counts[0] == 10_000
    desk.finish()
    assert desk.time_ns - t0 == 2_400_000_000
    assert ticks_of(desk)[299] <= 1
    assert ticks_of(desk)[300] <= 1


@shows("gmi99-3.1.1-7")
def test_a_speed_between_two_moves_does_not_part_them() -> None:
    desk = prepared()
    t0 = desk.time_ns
    desk.tell(TO_10000, "68 05 05 68 E0 66 88 13 00 E1 16", TO_20000)
    desk.at_ms(t0, 1124)
    before = desk.counts[0]
    desk.at_ms(t0, 1128)
    assert before <= 10_000 <= desk.counts[0]
    assert desk.counts[0] - before in (20, 21)
    desk.finish()
    assert desk.time_ns - t0 == ends_after(3.175) * 1e9


@shows("gmi99-3.1.2-25")
def test_a_right_angle_with_a_full_stop() -> None:
    corner = ("68 08 08 68 E0 83 10 27 00 00 00 00 9A 16", "68 08 08 68 E0 83 10 27 00 10 27 00 D1 16")
    desk = prepared("68 08 08 68 E0 4E E8 03 00 0B 00 00 24 16", "68 08 08 68 E0 4E 00 00 00 10 00 00 3E 16")
    assert moved_s(desk, *corner) == 2.4


@shows("gmi99-3.1.2-25", "gmi99-3.1.2-26")
def test_a_right_angle_with_a_jump_of_1000_hz() -> None:
    corner = ("68 08 08 68 E0 83 10 27 00 00 00 00 9A 16", "68 08 08 68 E0 83 10 27 00 10 27 00 D1 16")
    desk = prepared("68 08 08 68 E0 4E E8 03 00 0B 00 00 24 16", "68 08 08 68 E0 4E E8 03 00 10 00 00 29 16")
    t0 = desk.time_ns
    desk.tell(*corner)
    desk.at_ms(t0, 1180)
    assert desk.counts[1] == 0
    desk.at_ms(t0, 1184)
    assert desk.counts[1] > 0
    desk.finish()
    assert desk.time_ns - t0 == ends_after(2.362) * 1e9


@shows("gmi99-1.2-2")
def test_a_piece_takes_12_ms_at_least() -> None:
    desk = prepared(G91)
    assert moved_s(desk, *["68 05 05 68 E0 81 64 00 00 C5 16"] * 20) == ends_after(0.406667)
    assert desk.counts[0] == 2000


@shows("gmi99-3.1.1-6", "gmi99-3.1.1-18")
def test_the_speed_is_at_most_m() -> None:
    desk = fresh()
    desk.tell(PRE[0], "68 05 05 68 E0 4D 88 13 00 C8 16", "68 05 05 68 E0 66 28 23 00 91 16", TO_20000)
    desk.finish()
    assert max(ticks_of(desk)) == 20
    assert ticks_of(desk).count(20) > 900


@shows("gmi99-5-1")
def test_speeds_are_multiples_of_the_v_factor() -> None:
    desk = prepared("68 05 05 68 E0 4D F0 49 02 68 16", "68 05 05 68 E0 66 13 27 00 80 16")
    desk.ask(TO_20000)
    desk.finish()
    changes = ticks_of(desk)
    assert set(changes[52:-52]) == {40}


@shows("gmi99-3.1.1-8")
def test_g0_runs_at_m() -> None:
    desk = prepared(command("M", 20_000), command("G", 0))
    assert moved_s(desk, TO_20000) == 20_000 / 20_000 + 20_000 / 50_000


@shows("gmi99-3.1.1-13")
def test_relative_and_absolute_coordinates() -> None:
    desk = prepared()
    desk.tell(command(0x81, 100), G91, command(0x81, 100), command("V", 5, -6, 7), command("G", 90), command(0x82, 1))
    desk.finish()
    assert desk.counts[:3] == (205, 1, 7)


@shows("gmi99-3.1.1-43")
def test_v_moves_the_first_three_axes() -> None:
    desk = prepared()
    desk.ask(command("V", 300, -200, 100))
    desk.finish()
    assert desk.counts == (300, -200, 100, 0, 0, 0)


@shows("gmi99-3.2-10", "gmi99-3.1.1-5")
@pytest.mark.parametrize(("frame", "seconds"), [("10 E0 09 32 1B 16", 4.1), ("10 E0 09 78 61 16", 1.906667)])
def test_override_from_outside(frame: str, seconds: float) -> None:
    desk = prepared(frame)
    assert moved_s(desk, TO_20000) == ends_after(seconds)


@shows("gmi99-3.2-10")
@pytest.mark.parametrize(
    ("percents", "f_hz", "m_hz"),
    [
        ([125], 12_500, 50_000),
        ([125], 11_000, 11_000),  # never above M
        ([124], 12_400, 50_000),
        ([1], 100, 50_000),
        ([50, 126], 5_000, 50_000),  # out of range: what was there stays
        ([50, 255], 5_000, 50_000),
    ],
)
def test_the_override_from_outside_is_0_to_125_percent_of_f(percents: list[int], f_hz: int, m_hz: int) -> None:
    desk = prepared(command("M", m_hz), *[short(9, percent) for percent in percents])
    assert moved_s(desk, command(0x81, 5_000)) == ends_after(5_000 / f_hz + f_hz / 50_000)
    assert desk.controller.fault is (percents[-1] > 125)


@shows("gmi99-3.2-10")
def test_the_first_override_from_outside_ends_that_of_the_potentiometer() -> None:
    """From then on o1 and o0 switch the value from outside; one out of range is none."""
    desk = fresh(override_pot_percent=50)
    desk.tell(*PRE, command("o", 1), short(9, 126))
    assert moved_s(desk, TO_20000) == 4.1
    assert moved_s(desk, short(9, 100), command(0x81, 0)) == 2.2
    assert moved_s(desk, short(9, 25), command("o", 0), TO_20000) == 2.2
    assert moved_s(desk, command("o", 1), command(0x81, 0)) == ends_after(8.05)


@shows("gmi99-3.2-10")
def test_the_override_changes_a_motion_and_zero_holds_it() -> None:
    desk = prepared()
    desk.ask(TO_20000)
    desk.run(1.0)
    desk.ask("10 E0 09 00 E9 16")
    desk.run(0.2)
    assert desk.counts[0] == 10_000
    desk.run(1.0)
    assert desk.counts[0] == 10_000
    assert not desk.controller.idle
    desk.ask("10 E0 09 64 4D 16")
    desk.finish()
    assert desk.time_ns == 3_400_000_000
    assert desk.counts[0] == 20_000


@shows("gmi99-3.1.1-26", "gmi99-3.1.2-11")
def test_the_override_is_switched() -> None:
    """Half speed: 20000/5000 + 5000/50000 = 4.1 s; full: 2.2 s."""
    desk = prepared(command("o", 2, 50))
    assert moved_s(desk, TO_20000) == 4.1
    assert moved_s(desk, command("o", 0), command(0x81, 0)) == 2.2
    assert moved_s(desk, command("o", 1), TO_20000) == 2.2


@shows("gmi99-3.1.1-26")
def test_the_potentiometer() -> None:
    desk = fresh(override_pot_percent=50)
    desk.tell(*PRE)
    assert moved_s(desk, TO_20000) == 2.2
    assert moved_s(desk, command("o", 1), command(0x81, 0)) == 4.1


@shows("gmi99-3.1.1-14", "gmi99-3.2-9")
def test_speed_per_revolution() -> None:
    """600 rpm are ten revolutions a second: 1000 increments per revolution are 10000 Hz, half of that at 300 rpm."""
    desk = prepared(command("G", 95), command("f", 1000), "10 E0 08 58 02 42 16")
    assert moved_s(desk, TO_20000) == 2.2
    desk.ask("10 E0 08 2C 01 15 16")
    assert moved_s(desk, command(0x81, 0)) == 4.1


@shows("gmi99-6.1.1-1", "gmi99-3.1.2-24")
def test_the_stop_flag_and_on() -> None:
    desk = prepared()
    t0 = desk.time_ns
    desk.ask(TO_20000)
    desk.at_ms(t0, 1000)
    assert desk.ask("68 0B 0B 68 E0 70 0B 00 00 00 00 00 01 00 00 5C 16") == OK
    desk.at_ms(t0, 1196)
    assert desk.status() & 0x10
    desk.at_ms(t0, 1200)
    assert desk.counts[0] == 10_000
    assert desk.ask(command("T", 3, 8)) == long(b"\x04")
    desk.at_ms(t0, 2000)
    assert desk.counts[0] == 10_000
    assert desk.status() == 0x80
    assert desk.ask("68 0B 0B 68 E0 70 0B 00 00 00 00 00 00 00 00 5B 16") == OK
    desk.finish()
    assert desk.time_ns - t0 == 3_200_000_000
    assert desk.counts[0] == 20_000


@shows("gmi99-6.1.1-9")
def test_the_stop_function_can_be_suppressed() -> None:
    desk = prepared(command("p", 11, 3, 8), command("p", 11, 0, 1))
    assert moved_s(desk, TO_20000) == 2.2


@shows("gmi99-3.2-1", "gmi99-6.1.1-2")
@pytest.mark.parametrize("how", ["10 E0 00 E0 16", command("p", 11, 0, 2)])
def test_abort_in_motion(how: str) -> None:
    desk = prepared()
    t0 = desk.time_ns
    desk.tell(TO_20000, "68 05 05 68 E0 81 00 00 00 61 16")
    desk.at_ms(t0, 1000)
    assert desk.ask(how) == OK
    desk.at_ms(t0, 1196)
    assert desk.status() == 0x90
    desk.at_ms(t0, 1200)
    assert desk.counts[0] == 10_000
    assert desk.ask(STATUS) == READY
    desk.run(1.0)
    assert desk.counts[0] == 10_000


@shows("gmi99-3.2-11")
def test_what_comes_after_an_abort_waits_for_the_ramp() -> None:
    desk = prepared()
    desk.ask(TO_20000)
    desk.run(1.0)
    assert desk.tell("10 E0 00 E0 16", TO_10000, G91, command(0x81, 500)) == [OK] * 4
    desk.finish()
    assert desk.counts[0] == 10_500
    assert desk.time_ns == 1_400_000_000


@shows("gmi99-3.2-7")
def test_a_move_while_not_ready_is_dropped() -> None:
    desk = fresh()
    assert desk.tell(TO_238, STATUS) == [OK, NOT_READY]
    assert desk.set_position() == 0
    assert desk.controller.fault


@shows("gmi99-3.1.2-27", "gmi99-3.1.2-24")
def test_the_enable_input() -> None:
    desk = prepared("68 08 08 68 E0 4E 01 00 00 33 00 00 62 16")
    desk.set("e0.0", False)
    assert desk.ask(TO_238) == OK
    desk.run(1.0)
    assert desk.counts[0] == 0
    assert desk.ask(command("T", 3, 8)) == long(b"\x08")
    desk.set("e0.0", True)
    desk.finish()
    assert desk.counts[0] == 238


@shows("gmi99-3.1.2-28", "gmi99-6.1.1-10")
def test_motion_without_axes() -> None:
    desk = prepared("68 08 08 68 E0 4E 01 00 00 11 00 00 40 16")
    t0 = desk.time_ns
    desk.ask(TO_20000)
    desk.at_ms(t0, 1000)
    assert desk.set_position() == 9000
    assert desk.counts[0] == 0
    assert desk.ask(command("T", 1, 3, 3)) == long(b"I\x10\x00")
    desk.at_ms(t0, 2196)
    assert desk.ask(STATUS) == BUSY_MOVING
    desk.at_ms(t0, 2200)
    assert desk.ask(STATUS) == READY
    assert desk.set_position() == 20_000
    assert desk.carriage[0] == 100_000


@shows("gmi99-3.1.1-32", "gmi99-3.1.1-33", "gmi99-6.1.1-11")
def test_the_reduced_speed() -> None:
    """5000 Hz: 4.1 s; an M sets it to 0."""
    desk = prepared(command("R", 5000), command("p", 11, 3, 0x40))
    assert moved_s(desk, TO_20000) == 4.1
    assert desk.ask(command("T", 3, 8)) == long(b"\x01")
    assert moved_s(desk, command("M", 50_000), command(0x81, 0)) == 2.2


@shows("gmi99-3.1.1-45")
def test_axis_duplication() -> None:
    desk = prepared(command("X", 1, 0))
    desk.ask(command(0x81, 400))
    desk.finish()
    assert desk.counts[:2] == (400, 400)
    desk.tell(command("X", 1, -1), command(0x81, 0))
    desk.finish()
    assert desk.counts[:2] == (0, 400)
