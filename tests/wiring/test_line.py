"""The serial line: ten bits a byte, one byte after the other, seeded noise."""

from __future__ import annotations

import numpy as np
import pytest

from isel_twin.controller import SerialFormat
from isel_twin.wiring import SerialLine

BYTE_NS = 520_833  # 10 bits at 19200 bit/s, to the nanosecond


def line(timed: bool) -> SerialLine:
    return SerialLine(timed, np.random.default_rng(0))


def test_replies_on_their_way_are_counted() -> None:
    line = SerialLine(timed=True, random=np.random.default_rng(0))
    assert line.replies_due == 0
    line.from_controller(0, b"12345", 100)
    assert line.replies_due == 5
    assert line.at_host(250) == b"12"
    assert line.replies_due == 3


def test_untimed_bytes_arrive_at_once() -> None:
    wire = line(timed=False)
    wire.from_host(7, b"@07\r", BYTE_NS)
    assert wire.at_controller(7) == b"@07\r"
    assert wire.next_ns is None


@pytest.mark.parametrize(("baud", "expected_ns"), [(9600, 1_041_667), (19_200, BYTE_NS), (115_200, 86_806)])
def test_a_byte_is_ten_bits_to_the_nearest_nanosecond(baud: int, expected_ns: int) -> None:
    assert SerialFormat(baud).byte_ns == expected_ns


def test_timed_bytes_arrive_one_after_the_other() -> None:
    wire = line(timed=True)
    wire.from_host(0, b"ab", BYTE_NS)
    wire.from_host(100, b"c", BYTE_NS)
    arrivals = []
    while (t := wire.next_ns) is not None:
        arrivals.append((t, wire.at_controller(t)))
    assert arrivals == [(BYTE_NS, b"a"), (2 * BYTE_NS, b"b"), (3 * BYTE_NS, b"c")]


def test_directions_do_not_wait_for_each_other() -> None:
    wire = line(timed=True)
    wire.from_host(0, b"long command", BYTE_NS)
    wire.from_controller(0, b"0", BYTE_NS)
    assert wire.next_reply_ns == BYTE_NS
    assert wire.at_host(BYTE_NS - 1) == b""
    assert wire.at_host(BYTE_NS) == b"0"


def test_a_usb_adapter_hands_on_what_has_come_when_its_timer_ends() -> None:
    """16 ms; a byte at 9600 baud takes 1.042 ms, so that 15 bytes come before the first end."""
    wire, beat_ns, byte_ns = SerialLine(True, np.random.default_rng(0), 16_000_000), 16_000_000, 1_041_667
    heard: list[tuple[int, bytes, int]] = []
    wire.on_reply = lambda *what: heard.append(what)
    wire.from_controller(0, b"0123456789abcdef\r", byte_ns)
    assert wire.at_host(beat_ns - 1) == b""
    assert wire.at_host(beat_ns) == b"0123456789abcde"
    assert wire.at_host(2 * beat_ns - 1) == b""
    assert (wire.quiet_ns, wire.at_host(2 * beat_ns)) == (2 * beat_ns, b"f\r")
    assert heard == [(2 * beat_ns, b"0123456789abcdef\r", 0)]
    wire.from_host(2 * beat_ns, b"@", byte_ns)
    assert wire.next_ns == 2 * beat_ns + byte_ns


@pytest.mark.parametrize("timed", [True, False])
def test_what_bytes_take_is_counted_whether_they_take_it_or_not(timed: bool) -> None:
    wire = line(timed)
    wire.from_host(0, b"@07\r", BYTE_NS)
    wire.from_controller(0, b"0", BYTE_NS)
    assert wire.bytes_ns == 5 * BYTE_NS


@pytest.mark.parametrize("noise", [0.0, 0.25, 1.0])
def test_noise_flips_one_bit_in_its_share_of_bytes(noise: float) -> None:
    wire = line(timed=False)
    wire.noise = noise
    sent = bytes(range(256)) * 40
    wire.from_host(0, sent, BYTE_NS)
    flipped = [(a ^ b).bit_count() for a, b in zip(sent, wire.at_controller(0), strict=True)]
    assert set(flipped) <= {0, 1}
    assert abs(sum(flipped) / len(sent) - noise) < 0.02


# ---- handshake -------------------------------------------------------------------------------------------------------


def test_while_it_is_not_clear_to_send_the_host_waits() -> None:
    """Ten bytes of 1 ms; held from 3.5 ms to 23.5 ms: the fourth comes 0.5 ms later, the others behind it."""
    line = SerialLine(True, np.random.default_rng(0))
    line.from_host(0, b"0123456789", 1_000_000)
    assert line.at_controller(3_500_000) == b"012"
    line.clear_to_send(3_500_000, False)
    assert (line.next_ns, line.commands_due) == (None, 7)
    line.from_host(10_000_000, b"ab", 1_000_000)
    assert line.at_controller(20_000_000) == b""
    line.clear_to_send(23_500_000, True)
    assert line.next_ns == 24_000_000
    assert line.at_controller(23_999_999) == b""
    assert line.at_controller(26_000_000) == b"345"
    assert line.at_controller(32_000_000) == b"6789ab"
    assert line.commands_due == 0


def test_replies_do_not_wait_for_the_host() -> None:
    line = SerialLine(True, np.random.default_rng(0))
    line.clear_to_send(0, False)
    line.from_controller(0, b"xy", 1_000_000)
    assert line.at_host(2_000_000) == b"xy"


def test_what_waits_at_the_host_is_not_lost_while_the_line_is_cut() -> None:
    line = SerialLine(True, np.random.default_rng(0))
    line.from_host(0, b"0123", 1_000_000)
    line.clear_to_send(500_000, False)
    line.cut(1_000_000, True)
    line.cut(9_000_000, False)
    line.clear_to_send(9_500_000, True)
    assert line.at_controller(13_000_000) == b"0123"


def test_bytes_that_arrive_at_once_come_in_pieces() -> None:
    line = SerialLine(False, np.random.default_rng(0))
    line.from_host(5, b"0123456789", 0, at_once=4)
    assert [line.at_controller(5, 4) for _ in range(4)] == [b"0123", b"4567", b"89", b""]


def test_what_has_landed_before_a_cut_is_not_overtaken() -> None:
    """Two bytes and four have arrived, one comes after the cut: at most four are taken at once, in their order."""
    wire = line(timed=False)
    for t_ns, data in ((1, b"89"), (2, b"0123")):
        wire.from_host(t_ns, data, 0, at_once=4)
    wire.cut(3, True)
    wire.cut(4, False)
    wire.from_host(5, b"x", 0, at_once=4)
    assert [wire.at_controller(5, 4) for _ in range(4)] == [b"89", b"0123", b"x", b""]
