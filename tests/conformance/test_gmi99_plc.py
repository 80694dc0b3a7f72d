"""GMI99, section 6: the PLC, loaded by the host, and what it shares with the card."""

from __future__ import annotations

import itertools

import pytest
from conformance.gmi99_desk import (
    BUSY,
    OK,
    PLC_BEGIN,
    PLC_END,
    PLC_STOP,
    PRE,
    READY,
    STATUS,
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
from conformance.rows import shows

M50_AFTER_5_S = (
    "68 21 21 68 E0 61 00 00 00 53 35 01 01 01 01 0A 00 12 00 "
    "80 06 D8 80 80 06 30 02 10 50 24 01 F8 01 B0 06 65 00 18 16"
)
BITS = (
    "68 35 35 68 E0 61 00 00 00 53 35 01 01 01 01 0A 00 26 00 C0 00 C1 00 FB 00 C2 00 C3 00 D8 80 BA 00 C8 00 C9 00 BF "
    "00 E2 00 D9 80 C4 00 90 1E C5 00 B0 1E 80 1E DA 80 65 00 FD 16"
)
WORDS = (
    "68 37 37 68 E0 61 00 00 00 53 35 01 01 01 01 0A 00 28 00 30 40 12 34 13 28 30 04 03 E8 30 04 00 EA 59 00 13 2A 30 "
    "04 00 05 30 04 00 07 21 40 98 2C 30 40 00 F0 61 04 13 2E 65 00 C7 16"
)
BLOCKS = (
    "68 2F 2F 68 E0 61 00 00 00 53 35 01 03 01 01 16 00 06 00 01 16 1C 00 06 00 02 03 22 00 08 00 81 06 55 03 65 00 28 "
    "07 0B 32 65 00 81 06 D3 80 B1 06 65 00 5E 16"
)
CALLS_1 = (
    "68 29 29 68 E0 61 00 00 00 53 35 01 02 01 01 10 00 06 00 02 01 16 00 0E 00 80 06 55 01 65 00 28 01 0B 02 80 06 92 "
    "00 80 06 B0 06 65 00 3B 16"
)
CYCLE_S = 0.004


@shows("gmi99-6-2", "gmi99-6-3", "gmi99-6.1-1", "gmi99-3.1.1-46")
def test_an_m_function_with_a_plc() -> None:
    desk = fresh()
    desk.ask(Q)
    load(desk, M50_AFTER_5_S)
    desk.run(1.0)
    start_ns = desk.time_ns
    assert desk.ask("68 08 08 68 E0 6D 32 00 00 07 00 00 86 16") == OK
    desk.run(2 * CYCLE_S)
    assert desk.outputs["a0.0"] == 1
    assert word(desk, 11) & 0xFF == 7
    assert desk.ask(STATUS) == BUSY
    desk.at_ms(start_ns, 5000)
    assert desk.ask(STATUS) == BUSY
    desk.at_ms(start_ns, 5000 + 16)
    assert desk.ask(STATUS) == READY
    assert word(desk, 6) & 1 == 0
    desk.run(2 * CYCLE_S)
    assert desk.outputs["a0.0"] == 0


@shows("gmi99-6-2")
def test_inputs_come_in_and_outputs_go_out_at_the_end_of_a_pass() -> None:
    """A pass of 1004 instructions takes 48 ms (45.18 ms on the grid of 4 ms).

    E1.2  ____|~~~~~~~~~~~~~~~~~~~|________|~|_________     10 ms into pass 1; off in pass 3; both in pass 4
    pass    1    |    2    |    3    |    4    |
    A0.4  _________________|~~~~~~~~~|_________|_______     seen at the end of 1, put out at the end of 2
    A0.5  the same, although it asks at the other end of the program; A0.6 is set and reset in each pass
    """
    first = "UN M 30.0\n= M 30.0\n= A 0.3\nU E 1.2\n= A 0.4\nUN M 31.0\nS A 0.6\n"
    last = "U E 1.2\n= A 0.5\nUN M 31.0\nR A 0.6\nBE\n"
    desk = running("OB 1\n" + first + "NOP0\n" * 992 + last)
    desk.run(1.0)
    beats = [t_ns for t_ns, name, _ in desk.output_log if name == "a0.3"]
    assert {b - a for a, b in itertools.pairwise(beats)} == {48_000_000}
    begin_ns = beats[-1] + 48_000_000  # of pass 1
    for ms, level in ((10, True), (2 * 48 + 20, False), (3 * 48 + 10, True), (3 * 48 + 12, False)):
        desk.at_ms(begin_ns, ms)
        before = desk.ask(command("T", 1, 1, 1))
        desk.set("e1.2", level)
        assert desk.ask(command("T", 1, 1, 1)) == before, "the image is that of the pass"
    desk.at_ms(begin_ns, 6 * 48)
    changes = [(t_ns, name, on) for t_ns, name, on in desk.output_log if t_ns >= begin_ns and name != "a0.3"]
    on_ns, off_ns = begin_ns + 2 * 48_000_000, begin_ns + 4 * 48_000_000
    assert sorted(changes) == [(on_ns, "a0.4", 1), (on_ns, "a0.5", 1), (off_ns, "a0.4", 0), (off_ns, "a0.5", 0)]


@shows("gmi99-6-4")
def test_bit_logic() -> None:
    desk = fresh()
    for bit in range(6):
        desk.set(f"e0.{bit}", False)
    load(desk, BITS)
    held = False
    for levels in itertools.product((False, True), repeat=6):
        for bit, level in enumerate(levels):
            desk.set(f"e0.{bit}", level)
        desk.run(3 * CYCLE_S)
        e0, e1, e2, e3, e4, e5 = levels
        held = False if e5 else held or e4
        seen = [bool(desk.outputs.get(f"a0.{bit}", 0)) for bit in range(3)]
        assert seen == [(e0 and e1) or (e2 and e3), (e0 or e1) and not e2, held], levels


@shows("gmi99-6-5")
def test_words() -> None:
    desk = fresh()
    load(desk, WORDS)
    desk.run(2 * CYCLE_S)
    asked = (
        "68 0B 0B 68 E0 54 01 00 00 03 00 00 28 00 00 60 16",
        "68 0B 0B 68 E0 54 01 00 00 03 00 00 2A 00 00 62 16",
        "68 0B 0B 68 E0 54 01 00 00 03 00 00 2C 00 00 64 16",
        "68 0B 0B 68 E0 54 01 00 00 03 00 00 2E 00 00 66 16",
    )
    assert desk.tell(*asked) == [
        "68 04 04 68 E0 49 34 12 6F 16",
        "68 04 04 68 E0 49 FE 02 29 16",
        "68 04 04 68 E0 49 01 00 2A 16",
        "68 04 04 68 E0 49 00 0F 38 16",
    ]


@shows("gmi99-6-6", "gmi99-3.1.2-32")
def test_a_start_up_block_and_the_upload() -> None:
    desk = fresh()
    load(desk, BLOCKS)
    desk.run(3 * CYCLE_S)
    assert word(desk, 50) & 0xFF == 0
    assert desk.ask("68 05 05 68 E0 6D 33 00 00 80 16") == OK
    desk.run(4 * CYCLE_S)
    assert desk.outputs["a0.3"] == 1
    desk.power_cycle()
    desk.run(3 * CYCLE_S)
    assert word(desk, 50) & 0xFF == 7
    assert desk.ask(command("T", 3, 4)) == long(b"\x00")
    asked = (
        "68 08 08 68 E0 54 0C 00 00 FF FF FF 3D 16",
        "68 08 08 68 E0 54 0C 00 00 EA FF FF 28 16",
        "68 08 08 68 E0 54 0C 00 00 16 00 00 56 16",
    )
    assert desk.tell(*asked) == [
        "68 04 04 68 E0 65 16 00 5B 16",
        "68 04 04 68 E0 65 1C 00 61 16",
        "68 08 08 68 E0 78 81 06 55 03 65 00 9C 16",
    ]


@shows("gmi99-6.1.1-8", "gmi99-6.1.1-3")
def test_the_plc_starts_a_program() -> None:
    desk = fresh()
    load(desk, CALLS_1)
    desk.tell(command("p", 3, 100, 0), command("p", 3, 101), command("p", 3, 100, 1))
    desk.tell("68 05 05 68 E0 81 64 00 00 C5 16", command("p", 3, 101), Q)
    assert desk.ask("68 05 05 68 E0 6D 32 00 00 7F 16") == OK
    desk.run(2.0)
    assert desk.counts[0] == 100
    assert word(desk, 0) & 0x0104 == 0x0100
    assert word(desk, 2) & 0xFF == 1


@shows("gmi99-9-1")
def test_a_thousand_instructions_take_45_ms() -> None:
    """On the grid of 4 ms 48; an output that the program inverts changes once a pass."""
    text = "OB 1\nUN M 30.0\n= M 30.0\n= A 0.4\n" + "NOP0\n" * 996 + "BE\n"
    desk = running(text)
    desk.run(1.0)
    changes = [t_ns for t_ns, name, _ in desk.output_log if name == "a0.4"]
    assert {b - a for a, b in itertools.pairwise(changes)} == {48_000_000}


@shows("gmi99-3.1.1-46", "gmi99-3.1.2-23")
def test_stop_sets_the_outputs_back_and_what_is_no_program_is_refused() -> None:
    desk = running("OB 1\nUN M 30.7\n= A 0.4\nBE\n")
    desk.run(0.1)
    assert desk.outputs["a0.4"] == 1
    assert desk.ask(command("T", 3, 4)) == long(b"\x00")
    desk.ask(PLC_STOP)
    desk.run(0.1)
    assert desk.outputs["a0.4"] == 0
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")
    desk.tell(PLC_BEGIN, long(b"a\0\0\0\x53\x35\x01\x01\x01"), PLC_END)
    assert desk.ask(command("T", 3, 4)) == long(b"\x03")
    assert desk.controller.fault


@shows("gmi99-3.1.1-47")
def test_a_download_makes_the_programs_invalid() -> None:
    desk = prepared(command("p", 3, 100, 0), command(0x81, 50), command("p", 3, 101))
    desk.tell(PLC_BEGIN, PLC_END, command("p", 3, 1, 0))
    desk.finish()
    assert desk.counts[0] == 0


@shows("gmi99-6.1.1-14")
def test_a_program_cannot_change_what_belongs_to_the_firmware() -> None:
    """It sets every bit of MB0 and MB1 but those that end or start something, and sees what it was allowed."""
    text = "OB 1\n" + "".join(f"S M {b}.{n}\n" for b, n in ((0, 3), (0, 4), (0, 7), (1, 0), (1, 1), (1, 5))) + "BE\n"
    desk = running("OB 1\nUN M 30.7\n" + text.removeprefix("OB 1\n"))
    desk.run(0.1)
    assert word(desk, 0) == 0x2410, "M0.4: no E-stop; M1.2: no command; M1.5: the program's"


FB_254 = """OB 1
L {argument}
L {number}
SPA FB 254
T MW 40
TAK
T MW 42
BE
"""


@pytest.mark.parametrize(
    ("number", "argument", "first", "second"),
    [
        pytest.param("KF 3", "KF 0", 0, 0, marks=shows("gmi99-6.1.3-2"), id="searching"),
        pytest.param("KF 4", "KF 0", 0x5B, 321, marks=shows("gmi99-6.1.3-3"), id="device"),
        pytest.param("KF 5", "KF 7", 7, 7, marks=shows("gmi99-6.1.3-4"), id="fine correction"),
        pytest.param("KF 6", "KH 0103", 0xFFFB, 0xFFFF, marks=shows("gmi99-6.1.3-5"), id="position"),
        pytest.param("KF 10", "KF 1", 0x0010, 1, marks=shows("gmi99-6.1.3-6"), id="status"),
        pytest.param("KF 10", "KF 5", 0x0011, 5, marks=shows("gmi99-6.1.3-6"), id="reference missing"),
        pytest.param("KF 10", "KF 6", 0x0100, 6, marks=shows("gmi99-6.1.3-6"), id="invalid"),
        pytest.param("KF 12", "KF 1", 1, 1, marks=shows("gmi99-6.1.3-7"), id="home"),
        pytest.param("KH 0110", "KF 300", 300, 300, marks=shows("gmi99-6.1.3-8"), id="zero point"),
        pytest.param("KH 0110", "KF 1001", 0, 1001, marks=shows("gmi99-6.1.3-8"), id="zero point too large"),
    ],
)
def test_the_extended_functions(number: str, argument: str, first: int, second: int) -> None:
    desk = fresh()
    told = desk.tell(
        *PRE, command("N", 321, 1000), command("N", -10, 0x108), command("N", 10, 0x109), command("O", -5, 1)
    )
    assert told == [OK] * 7
    load(desk, *assembled(FB_254.format(number=number, argument=argument)))
    desk.run(0.1)
    assert (word(desk, 40), word(desk, 42)) == (first, second)


@shows("gmi99-6.1.3-1", "gmi99-6-1")
def test_the_mode_of_the_images() -> None:
    desk = fresh()
    before = desk.ask(command("T", 1, 1, 0))
    desk.ask(command("N", 1, 12))
    load(desk, *assembled("OB 1\nBE\nOB 21\nL KF 1\nL KF 2\nSPA FB 254\nBE\n"))
    desk.run(0.1)
    assert desk.ask(command("T", 1, 1, 0)) == before


@shows("gmi99-6.1.3-9", "gmi99-6.1.1-11")
def test_the_reduced_speed_of_the_plc() -> None:
    """Always reduced: 5000 Hz, 4.1 s; never, whatever M3.6 says: 2.2 s."""
    for mode, seconds in ((2, 4.1), (0, 2.2)):
        desk = prepared(command("R", 5000), command("p", 11, 3, 0x40))
        load(desk, *assembled(f"OB 1\nL KF {mode}\nL KF 33\nSPA FB 254\nBE\n"))
        desk.run(0.1)
        start_ns = desk.time_ns
        desk.ask(command(0x81, 20_000))
        desk.finish()
        assert (desk.time_ns - start_ns) / 1e9 == pytest.approx(seconds, abs=0.0041)


@shows("gmi99-6.1.3-8", "gmi99-3.1.2-30")
def test_the_zero_point_of_the_plc_moves_the_target() -> None:
    desk = running("OB 1\nL KF -200\nL KH 0110\nSPA FB 254\nBE\n")
    desk.run(0.1)
    desk.ask(command(0x81, 1000))
    desk.finish()
    assert desk.counts[0] == 800
    assert desk.ask(command("T", 8, 100, 0)) == long(b"Z\x38\xff\xff")


@shows("gmi99-6.1.3-10", "gmi99-6.1.1-15")
def test_analog_outputs() -> None:
    desk = running("OB 1\nL KB 77\nT AB 12\nBE\n")
    desk.run(0.1)
    assert desk.outputs.get("analog", 0) == 0
    desk.ask(command("p", 11, 3, 4))
    desk.run(0.1)
    assert desk.outputs["analog"] == 77
    desk = running("OB 1\nL KB 99\nT AB 12\nL KH 0010\nL KF 8\nSPA FB 254\nBE\n")
    desk.run(0.1)
    assert desk.outputs["analog"] == 99
