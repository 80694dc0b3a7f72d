"""GMI99: the smaller statements of sections 3 to 6."""

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
from conformance.rows import shows

from isel_twin.firmware.plc.assembler import assemble


def grid(seconds: float) -> float:
    """The first time of the grid that is not before."""
    return math.ceil(round(seconds * 250, 6)) / 250


def flags(desk: CardDesk, byte: int) -> int:
    """A flag byte."""
    return word(desk, byte) & 0xFF


@shows("gmi99-3.1.1-48")
def test_acceleration_of_one_axis() -> None:
    """25 Hz/ms on axis 1 alone: 20000/10000 + 10000/25000 s; P2 = 0 sets it for all again."""
    desk = prepared(command("B", 25, 2))
    assert moved_s(desk, TO_20000) == 2.2
    assert moved_s(desk, command(0x82, 20_000)) == 2.4
    assert moved_s(desk, command("B", 50), command(0x82, 0)) == 2.2


@shows("gmi99-3.1.1-49")
def test_top_speed_of_one_axis() -> None:
    """5000 Hz on axis 1; together with axis 0, whose way is the same, sqrt(2) times that along the path."""
    desk = prepared(command("M", 5000, 2))
    assert moved_s(desk, TO_20000) == 2.2
    assert moved_s(desk, command(0x82, 20_000)) == 4.1
    assert np.abs(desk.steps.delta[:, 1]).max() == 20
    desk.ask(command(0x83, 0, 0))
    desk.finish()
    assert np.abs(desk.steps.delta[:, 1]).max() <= 21


@shows("gmi99-3.1.1-50")
def test_m_parts_moves() -> None:
    desk = prepared()
    assert moved_s(desk, TO_10000, command("M", 50_000), TO_20000) == 2.4


@shows("gmi99-3.1.1-51")
def test_the_reduced_speed_is_limited_by_m() -> None:
    """R 60000 is 50000, the speed of M."""
    desk = prepared(command("R", 60_000), command("p", 11, 3, 0x40), command("G", 0))
    assert moved_s(desk, command(0x81, 200_000)) == 200_000 / 50_000 + 1.0


@shows("gmi99-3.1.1-52")
def test_a_set_position_is_handed_on_to_the_drive() -> None:
    desk = prepared(command("O", 4321, 1))
    assert desk.ask(command("T", 0, address=1)) == long(b"@\xe1\x10\0", address=1)


@shows("gmi99-3.1.1-53")
def test_the_override_activity_is_saved() -> None:
    desk = fresh(override_pot_percent=50)
    desk.tell(command("o", 1), command("s", 85, 170))
    desk.power_cycle()
    desk.tell(*PRE)
    assert moved_s(desk, TO_20000) == 4.1


@shows("gmi99-3.1.1-54")
def test_axes_of_v_stand_if_told_so() -> None:
    desk = prepared(command(0x87, 10, 20, 30))
    desk.finish()
    desk.ask(command("V", 10, 25, 30))
    desk.finish()
    assert desk.counts[:3] == (10, 25, 30)
    desk.tell(G91, command("V", 0, 5, 0))
    desk.finish()
    assert desk.counts[:3] == (10, 30, 30)


@shows("gmi99-3.1.1-55")
def test_the_fine_correction_that_the_plc_has_chosen() -> None:
    desk = running("OB 1\nL KF 6\nL KF 5\nSPA FB 254\nBE\n")
    desk.tell(command("G", 53 | 0x86 << 16, 9, 1), command("G", 54 | 0xFF << 16), TO_0)
    desk.finish()
    assert desk.counts[0] == 9
    assert desk.ask(command("T", 1, 12)) == long(b"I\x06\0")


@shows("gmi99-3.1.1-56")
def test_lost_contact_may_be_suppressed() -> None:
    """A drive of the twin never loses contact."""
    desk = prepared()
    assert desk.tell(command("p", 3, 110), command("p", 3, 111), STATUS) == [OK, OK, READY]
    assert not desk.controller.fault


@shows("gmi99-3.1.1-57")
def test_g54_does_not_part_moves() -> None:
    desk = prepared()
    assert moved_s(desk, TO_10000, command("G", 54), command("G", 90), TO_20000) == 2.2


@shows("gmi99-3.1.1-58")
def test_g94_ends_g95() -> None:
    desk = prepared(command("G", 95), command("f", 1000), short(8, 0x58, 0x02), command("G", 94), command("f", 5000))
    assert moved_s(desk, TO_20000) == 4.1


@shows("gmi99-3.1.1-59")
def test_the_speed_follows_the_spindle_in_motion() -> None:
    """1000 increments a turn at 600, then 1200 rpm: 20000 Hz, 80 increments a tick, after a ramp of 200 ms."""
    desk = prepared(command("G", 95), command("f", 1000), short(8, 0x58, 0x02), command(0x81, 40_000))
    desk.run(1.0)
    desk.ask(short(8, 0xB0, 0x04))
    desk.run(0.5)
    before = desk.counts[0]
    desk.run(0.004)
    assert desk.counts[0] - before == 80


@shows("gmi99-3.1.2-33")
def test_immediate_commands_do_not_wait() -> None:
    desk = prepared(TO_20000)
    desk.run(1.0)
    assert desk.tell(command("c", 7, 0), command("T", 1, 6, 0), command("N", 3, 13)) == [OK, long(b"I\x07\0"), OK]
    assert desk.set_position() == 9000


@shows("gmi99-3.2-12")
@pytest.mark.parametrize("frames", [(), (Q,), (*PRE, TO_20000)])
def test_bit_5_of_the_status_is_0(frames: tuple[str, ...]) -> None:
    desk = fresh()
    desk.tell(*frames)
    assert desk.status() & 0x20 == 0


@shows("gmi99-4-6")
def test_an_m_function_in_a_program_waits_for_the_plc() -> None:
    desk = running("OB 1\nU M 6.2\nL KT 050.1\nSE T 3\nU T 3\nR M 6.2\nBE\n")
    desk.tell(command("p", 3, 100, 0), command("m", 52), command(0x81, 100), command("p", 3, 101))
    desk.ask(command("p", 3, 1, 0))
    desk.run(4.9)
    assert desk.counts[0] == 0
    assert desk.ask(STATUS) == BUSY
    desk.run(1.0)
    assert desk.counts[0] == 100


@shows("gmi99-4-7")
def test_parameters_are_not_recorded() -> None:
    desk = prepared(command("p", 3, 100, 0), command("N", 5, 13), command("p", 3, 101))
    assert desk.ask(command("T", 5, 13)) == long(b"N\x05\0\0")
    desk.tell(command("N", 1, 13), command("p", 3, 1, 0))
    assert desk.ask(command("T", 5, 13)) == long(b"N\x01\0\0")


@shows("gmi99-5-2")
@pytest.mark.parametrize(
    ("m_hz", "factor"),
    [(50_000, 1), (50_001, 2), (100_000, 2), (100_001, 4), (200_001, 8), (400_001, 10), (500_001, 20), (1_000_000, 20)],
)
def test_the_v_factor_is_that_of_the_table(m_hz: int, factor: int) -> None:
    """f = 11 k - 1 becomes 10 k; the smallest speed is 2 k. A way of 40 k takes 4 s, or 20 s, ramps almost nothing."""
    desk = prepared(command("M", m_hz), command("B", 30_000), command("f", 11 * factor - 1))
    if factor == 1:
        desk.ask(command("f", 10))
    assert moved_s(desk, command(0x81, 40 * factor)) == pytest.approx(4.0, abs=0.0041)
    assert moved_s(desk, command("f", 1), command(0x81, 0)) == pytest.approx(20.0, abs=0.0041)


@shows("gmi99-6-7")
def test_the_size_of_the_plc() -> None:
    """The last ones of each kind: M 255.7, T 31, Z 31, DW 127."""
    desk = running(
        "OB 1\nUN M 255.6\n= M 255.7\nL KH 1234\nT DW 127\nU M 255.7\nL KT 010.0\nSV T 31\nU T 31\n= M 254.0\n"
        "U M 255.7\nZV Z 31\nL Z 31\nT MW 252\nBE\n"
    )
    desk.run(0.05)
    assert flags(desk, 255) == 0x80
    assert flags(desk, 254) == 1
    assert word(desk, 252) == 1
    assert desk.ask(command("T", 1, 6, 254)) == long(b"I\x34\x12")


@shows("gmi99-6-8")
def test_sixteen_levels_of_blocks() -> None:
    def nested(levels: int) -> str:
        blocks = [f"PB {n}\nSPA PB {n + 1}\nBE\n" for n in range(1, levels)] + [f"PB {levels}\n= M 30.0\nBE\n"]
        return "OB 1\nUN M 31.7\nSPA PB 1\nBE\n" + "".join(blocks)

    for levels, status in ((15, 0), (16, 2)):
        image = assemble(nested(levels)).image
        desk = fresh()
        load(desk, *(long(b"a" + at.to_bytes(3, "little") + image[at : at + 128]) for at in range(0, len(image), 128)))
        desk.run(0.1)
        assert desk.ask(command("T", 3, 4)) == long(bytes([status]))


@shows("gmi99-6.1-2")
def test_a_direct_output_does_not_wait_for_the_plc() -> None:
    desk = running("OB 1\n" + "NOP0\n" * 900 + "BE\n")
    desk.run(0.1)
    desk.ask(command("p", 10, 16, 7))
    assert desk.outputs["a0.7"] == 1
    desk.run(0.2)
    assert desk.outputs["a0.7"] == 1


@shows("gmi99-6.1.1-16", "gmi99-6.1.1-17")
def test_flags_of_motion_and_readiness() -> None:
    desk = prepared()
    assert (flags(desk, 0) & 8, flags(desk, 1) & 4) == (0, 4)
    desk.ask(TO_20000)
    assert (flags(desk, 0) & 8, flags(desk, 1) & 4) == (8, 0)
    desk.finish()
    assert (flags(desk, 0) & 8, flags(desk, 1) & 4) == (0, 4)


@shows("gmi99-6.1.1-18")
def test_the_plc_resets_the_request_to_report_again() -> None:
    desk = running("OB 1\nU M 3.1\nR M 3.1\nL KB 9\nT MB 60\nBE\n")
    desk.ask(command("q"))
    assert flags(desk, 3) & 2
    desk.run(0.05)
    assert flags(desk, 3) & 2 == 0


@shows("gmi99-6.1.1-19")
def test_the_flag_of_waiting_for_in_position() -> None:
    desk = prepared(command("H", 2))
    assert flags(desk, 3) & 0x20
    desk.finish()
    assert flags(desk, 3) & 0x20 == 0


@shows("gmi99-6.1.1-20")
@pytest.mark.parametrize("byte", [4, 5, 12, 14, 30, 255])
def test_flag_bytes_that_host_and_plc_share(byte: int) -> None:
    desk = fresh()
    assert desk.tell(command("p", 11, byte, 0xA5), command("T", 1, 3, byte)) == [
        OK,
        long(bytes([ord("I"), 0xA5, 0])),
    ]


@shows("gmi99-6.1.3-2")
def test_the_plc_sees_which_axes_search() -> None:
    desk = running("OB 1\nL KF 0\nL KF 3\nSPA FB 254\nT MW 40\nBE\n")
    desk.ask(command("Q", 5, 1))
    desk.run(1.0)
    assert word(desk, 40) == 5
    desk.finish()
    desk.run(0.05)
    assert word(desk, 40) == 0


@shows("gmi99-6.1.3-5")
def test_the_plc_sees_the_number_of_the_command() -> None:
    desk = running("OB 1\nL KF 15\nL KF 6\nSPA FB 254\nT MW 40\nBE\n")
    desk.tell(command("p", 3, 100, 0), *[command("p", 10, 14, 5)] * 3, command("p", 3, 101), command("p", 3, 1, 0))
    seen = []
    for _ in range(3):
        desk.run(0.25)
        seen.append(word(desk, 40))
        desk.run(0.25)
    assert seen == [1, 2, 3]
