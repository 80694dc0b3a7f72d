"""Lines, numbers, queue and control bytes as they come from hosts, and from nobody in particular."""

from __future__ import annotations

import random
import resource
import tracemalloc
from typing import Any

import hypothesis.strategies as st
import pytest
import unknown
from hypothesis import given

from isel_twin.controller import create_controller
from isel_twin.firmware.imc.grammar import LineAssembler, read_number
from isel_twin.firmware.imc.replies import Refusal
from isel_twin.testing import Desk

MOVE = "@0A900,900,0,900,0,900,0,900"
"""About a second."""


def ready(**options: Any) -> Desk:
    desk = Desk.of("imc-s8", carriage=(60_000, 48_000, 22_000, 50_000), **options)
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    return desk


# --- numbers ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"),
    [
        ("8666.666666666668", 8666),
        ("6000.0", 6000),
        ("-666.67", -666),
        ("-0.9", 0),
        ("+5", 5),
        (" 7 ", 7),
        (".5", 0),
        ("5.", 5),
        ("007", 7),
    ],
)
def test_numbers_as_hosts_send_them(text: str, value: int) -> None:
    assert read_number(text) == value


@pytest.mark.parametrize("text", ["", " ", "-", "1e3", "0x10", "1 000", "1_000", "²", "٣", "nan", "--1", "1.2.3"])
def test_what_is_no_number(text: str) -> None:
    with pytest.raises(Refusal) as refused:
        read_number(text)
    assert refused.value.code == "1"


@given(st.integers(-(10**30), 10**30), st.text("0123456789", max_size=8))
def test_fraction_is_cut_off(whole: int, decimals: str) -> None:
    assert read_number(f"{whole}.{decimals}") == whole
    assert read_number(str(whole)) == whole


@pytest.mark.parametrize(("steps", "reply"), [(8_388_607, "R"), (8_388_608, "1"), (-8_388_608, "R"), (-8_388_609, "1")])
def test_steps_have_24_bits(steps: int, reply: str) -> None:
    desk = Desk.of("imc-s8")
    assert desk.query("@01") == "0"
    assert desk.query(f"@0A{steps},900") == reply
    assert desk.ticks == 0


def test_a_move_may_not_take_the_counter_beyond_24_bits() -> None:
    desk = Desk.of("imc-s8", position_switches=())
    for command in ("@01", "@0N1", "@0A8388600,40000"):
        assert desk.query(command) == "0"
    assert desk.query("@0A8,900") == "1"
    assert desk.query("@0A7,900") == "0"
    assert desk.query("@0P") == "0" + "7FFFFF" + "000000" * 2


# --- lines -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("ending", ["\r", "\r\n", "\n\r", "\r\r", "\n\r\n"])
def test_line_ends(ending: str) -> None:
    desk = ready()
    for command in ("@0P", "@0b0", "@0P"):
        desk.send(f"{command}{ending}".encode())
    assert desk.finish() == "0" + "0" * 18 + "000" + "0" + "0" * 18


@pytest.mark.parametrize(
    "text", ["@0A 10 , 900,0,900 ,0,900,0, 900", " @0A10,900,0,900,0,900,0,900 ", "@0 A10,900,0,9\n00,0,900,0,900"]
)
def test_blanks_and_line_feeds_count_for_nothing(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "0"
    assert desk.counts[0] == 10


@pytest.mark.parametrize(
    "text",
    [
        "hello",
        "07",
        "@",
        "@0",
        "@@07",
        "@x7",
        "?@07",
        unknown.DNC[0],
        "@0I",
        unknown.INITIAL[0] + "1",
        "\x00",
        "@0\xff"[:2],
    ],
)
def test_what_is_no_command(text: str) -> None:
    assert ready().query(text) == "5"


def test_a_line_has_255_bytes() -> None:
    desk = ready()
    fits = "@0A10.0,900,0,900,0,900,0,900".ljust(255)
    assert desk.query(fits) == "0"
    assert desk.query(fits + " ") == "5"
    assert desk.query("x" * 100_000) == "5"
    assert desk.counts[0] == 10
    assert desk.query("@0P")[0] == "0"


def test_waiting_lines_have_4096_bytes() -> None:
    """64 lines of 64 bytes, CR included, fit; what comes behind is answered 5 until all has been answered."""
    desk = ready()
    desk.start(MOVE)
    for _ in range(66):
        desk.start("@0b0".ljust(63))
    desk.start("@0P")
    assert desk.finish() == "0" + "000" * 64 + "5" * 3
    assert desk.query("@0b0") == "000"


def test_other_device_numbers_are_not_ours() -> None:
    desk = ready()
    assert desk.query("@1P") == ""
    assert desk.query("@0G1") == "0"
    assert desk.query("@0P") == ""
    assert desk.query("@1P") == "0" + "0" * 18
    desk.send(b"\xfe")
    assert desk.query("@0b0") == "000"


def test_assembler_keeps_no_more_than_a_line() -> None:
    assembler = LineAssembler(8)
    for runs, line in (
        ((b"12345678",), b"12345678"),
        ((b"1234", b"\n56\n", b"78\n"), b"12345678"),
        ((b"123456789",), b""),
        ((b"12345678", b"9"), b""),
        ((), None),
        ((b"\n\n",), None),
        ((b"  ",), None),
    ):
        for run in runs:
            assembler.feed(run)
        assert assembler.end() == line


def test_bytes_in_runs_act_as_one_by_one() -> None:
    """Commands, control bytes, lines that are too long and programs that listen, several at an instant."""
    parts = [b"@0P\r", MOVE.encode() + b"\r", b"@0b1\r\n", b"\xfd", b"\xff", b"\xfe@07\r", b"@0S\r", b"\r\n"]
    parts += [b"@0k\r@0i\r1 65\r2 66,1\r9\r@0S\r", b"x", b"\nB", b"B", b"@0k\r", b"@07\r", b"9" * 300 + b"\r"]
    chosen = random.Random(3)
    runs, bytewise = ready(), ready()
    for _ in range(200):
        data = b"".join(chosen.choices(parts, k=chosen.randint(1, 4)))
        runs.send(data)
        for byte in data:
            bytewise.send(bytes([byte]))
        for desk in (runs, bytewise):
            desk.advance_to(desk.time_ns + 40_000_000)
    assert runs.replies == bytewise.replies
    assert runs.counts == bytewise.counts
    assert {reply for _, data in runs.replies for reply in data} >= set(b"05FA")  # A: from a program, before it listens


# --- control bytes ---------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("tail", [b"", b"\r", b"\n", b"\r\n", b"\n\r"])
@pytest.mark.parametrize("byte", [b"\xfd", b"\xff"])
def test_control_byte_in_a_move_then_a_stray_line_end(byte: bytes, tail: bytes) -> None:
    desk = ready()
    desk.start(MOVE)
    desk.run(0.5)
    desk.send(byte + tail)
    assert desk.finish() == "F"
    assert 0 < desk.counts[0] < 900
    assert desk.query("@0S") == ("0" if byte == b"\xfd" else "G")
    assert (desk.counts[0] == 900) == (byte == b"\xfd")


@pytest.mark.parametrize("byte", [b"\xfd", b"\xff"])
def test_control_byte_at_rest_says_nothing(byte: bytes) -> None:
    desk = ready()
    desk.send(byte + b"\r")
    assert desk.finish() == ""
    assert desk.query("@0P")[0] == "0"


def test_control_bytes_are_never_part_of_a_line() -> None:
    desk = ready()
    desk.send(b"@0\xfdb\xff0\xfd\r")
    assert desk.finish() == "000"


def test_break_after_a_stop_forgets_the_rest() -> None:
    desk = ready()
    desk.start(MOVE)
    desk.run(0.3)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    desk.send(b"\xff")
    assert desk.finish() == ""
    assert desk.query("@0S") == "G"


def test_a_stop_too_late_to_leave_anything() -> None:
    """In the last ramp the move ends as planned; it is still a stop, and the start has nothing left to do."""
    desk = ready()
    desk.start(MOVE)
    desk.run(1.0025)
    assert desk.controller.run is not None
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.counts[0] == 900
    assert desk.query("@0S") == "0"
    assert desk.query("@0S") == "G"


def test_reset_forgets_all_that_is_not_in_flash() -> None:
    desk = ready()
    assert desk.query("@0B0,255") == "0"
    desk.start(MOVE)
    desk.start(MOVE)
    desk.send(b"@0P")
    desk.run(0.5)
    mark = desk.ticks
    desk.send(b"\xfe")
    assert desk.finish() == ""
    assert desk.ticks == mark
    assert desk.counts == (0, 0, 0, 0)
    assert desk.outputs["user"] == 0
    assert desk.query("@0A1,900") == "4"
    assert desk.query("@07") == "0"
    assert desk.query(MOVE) == "R"


def test_start_key_resumes_and_the_host_gets_its_0() -> None:
    desk = ready()
    desk.start(MOVE)
    desk.run(0.3)
    desk.press("stop")
    assert desk.finish() == "F"
    desk.press("start")
    assert desk.finish() == "0"
    assert desk.counts[0] == 900


# --- noise -----------------------------------------------------------------------------------------------------------

ALPHABET = b"@@@@000007AaMmRrSsPdDefFgGhHiIjJkKnNTUVwyzZbB?,,,,,--..0123456789\r\r\r\n \xff\xfd"


def pour(strings: int, seed: int) -> int:
    """Give a controller so many random strings, and the time to its next event after each; count its replies."""
    source = random.Random(seed)
    controller = create_controller("imc-s8")
    controller.power_on(0, dict.fromkeys(("p1.0", "p1.1", "p1.2", "p1.4", "p2.1", "p2.5", "p2.6"), True))
    now_ns = replies = 0
    for number in range(strings):
        length = source.randrange(24)
        text = source.randbytes(length) if number % 2 else bytes(source.choices(ALPHABET, k=length))
        controller.receive(now_ns, text)
        replies += len(controller.take())
        if controller.next_ns is not None:
            now_ns = controller.next_ns
            controller.advance(now_ns)
    return replies


def memory_of(strings: int) -> int:
    """Most bytes of memory in use during so many random strings."""
    tracemalloc.start()
    try:
        pour(strings, seed=1)
        return tracemalloc.get_traced_memory()[1]
    finally:
        tracemalloc.stop()


def test_noise_does_no_harm_and_takes_no_memory() -> None:
    pour(20_000, seed=1)  # what the interpreter and our caches keep once, they keep now
    few = memory_of(2_000)
    assert memory_of(20_000) - few < 500_000, "28 bytes a string would be too much"


@pytest.mark.slow
def test_eighty_thousand_random_strings() -> None:
    before_kib = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    assert pour(80_000, seed=2) > 800
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before_kib < 20_000


# --- texts -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", ["@0V", "@0?", "@0U", "@0H", "@0h", "@0P", "@0DRp", "@0b3"])
def test_a_reply_is_complete_within_50_ms_at_19200_baud(command: str) -> None:
    desk = ready()
    assert desk.query("@0IU" + 32 * "u") == "0"
    assert len(desk.query(command)) <= 0.050 * 19_200 / 10


def test_texts_show_what_changes() -> None:
    desk = ready()
    before, limits = desk.query("@0H"), desk.query("@0h")
    desk.set("key", "setup")
    desk.set("limit_y2", "open")
    assert desk.query("@0H") != before
    assert desk.query("@0h") == limits.replace("Y2 0", "Y2 1")


def test_lines_too_long_do_not_pile_up() -> None:
    """Each is dropped but for its end; those that do not fit any more are only counted."""
    desk = ready(settings={"line_bytes": 30, "input_bytes": 60})
    desk.start(MOVE)
    desk.send(("x" * 31 + "\r").encode() * 1000)
    assert desk.finish() == "0" + "5" * 1000
