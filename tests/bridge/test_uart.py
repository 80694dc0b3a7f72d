"""Bytes at the wrong speed: what follows from sampling in the middle of bits, worked out by hand or in closed form."""

from __future__ import annotations

import math

import pytest

from isel_twin.bridge.serve.uart import heard, levels
from isel_twin.controller import SerialFormat

ALL = bytes(range(256))


def at(baud: int, data_bits: int = 8, parity: str = "N", stop_bits: int = 1) -> SerialFormat:
    return SerialFormat(baud, data_bits, parity, stop_bits)  # type: ignore[arg-type]


def test_the_line():
    """41h is 0100 0001, sent from the lowest bit."""
    assert levels(b"A", at(1)) == [0, 1, 0, 0, 0, 0, 0, 1, 0, 1]
    assert levels(b"A", at(1, 7, "E", 2)) == [0, 1, 0, 0, 0, 0, 0, 1, 0, 1, 1]
    assert levels(b"A", at(1, 7, "O")) == [0, 1, 0, 0, 0, 0, 0, 1, 1, 1]
    assert levels(b"", at(1)) == []


@pytest.mark.parametrize("form", [at(9600), at(19_200, 8, "E"), at(300, 8, "O", 2), at(31_250, 8, "M"), at(75, 8, "S")])
def test_the_same_format_hears_what_is_sent(form):
    assert heard(ALL * 2, form, form) == type(heard(b"", form, form))(ALL * 2, 0, 0)


@pytest.mark.parametrize(("sent", "got"), [(0x55, 0x66), (0xFF, 0xFE), (0x00, 0x00), (0x33, 0x1E)])
def test_a_single_byte_at_half_the_receivers_speed(sent, got):
    """Sample j falls in bit floor((2j+1)/4): start, start, d0, d0, d1, d1, d2, d2, d3 are the start bit and data bits.

    So the byte heard is 0 d0 d0 d1 d1 d2 d2 d3 from the lowest bit, and its stop bit is d3 again. Whatever edge comes
    after that begins another one.
    """
    d = [sent >> number & 1 for number in range(4)]
    expected = sum(bit << number for number, bit in enumerate([0, d[0], d[0], d[1], d[1], d[2], d[2], d[3]]))
    assert expected == got
    result = heard(bytes([sent]), at(9600), at(19_200))
    assert result.data[0] == got
    assert (result.framing_errors > 0) == (d[3] == 0)


def test_a_receiver_at_half_the_speed():
    """Sample j falls at the beginning of bit 2j + 1: d0 is taken for the start bit; d2, d4, d6, stop, idle follow."""
    assert heard(b"\xff", at(19_200), at(9600)).data == b""  # a spike
    assert heard(b"\x00", at(19_200), at(9600)).data == bytes([0b11111000])
    assert heard(b"\x54", at(19_200), at(9600)).data == bytes([0b11111111])
    assert heard(b"\x10", at(19_200), at(9600)).data == bytes([0b11111010])


@pytest.mark.parametrize("per_mille", [*range(940, 961), *range(1040, 1062)])
def test_how_far_apart_two_speeds_may_be(per_mille):
    """8N1: sample 9 has to fall in bit 9, so 9 <= 9.5 S/R < 10; sample 8 in bit 8 follows from it."""
    good = 9 <= 9.5 * per_mille / 1000 < 10
    apart = heard(ALL, at(per_mille), at(1000))
    assert (apart.data == ALL and apart.framing_errors == 0) == good


def test_a_sender_that_is_a_little_too_fast_turns_the_highest_bit_into_the_stop_bit():
    """8.5 S/R >= 9, so sample 8 falls in the stop bit; 7.5 S/R < 8, so the others are right. Single bytes."""
    fast = at(1062)
    assert math.floor(8.5 * 1.062) == 9
    assert math.floor(7.5 * 1.062) == 7
    for byte in range(256):
        assert heard(bytes([byte]), fast, at(1000)).data == bytes([byte | 0x80])


def test_a_sender_that_is_much_too_slow_is_a_break_for_each_zero():
    """At 1200 baud a start bit and 8 zeros last 9/1200 s, 144 bits at 19200 baud: low throughout, one byte 0."""
    result = heard(b"\x00", at(1200), at(19_200))
    assert result.data == b"\x00"
    assert result.framing_errors == 1


def test_the_same_speed_with_another_parity_or_fewer_bits():
    """7E1 and 8N1 have ten bits: the parity bit is the eighth data bit of the other."""
    assert heard(b"AC", at(9600, 7, "E"), at(9600)).data == bytes([0x41, 0xC3])  # 2 ones, 3 ones
    wrong = heard(b"AC", at(9600), at(9600, 7, "E"))
    assert wrong.data == b"AC"
    assert wrong.parity_errors == 1  # C has three ones, and its bit 7 is 0
    # 8N1 heard as 8E1: the stop bit is taken for the parity, the idle line for the stop bit
    assert heard(b"A", at(9600), at(9600, 8, "E")).parity_errors == 1
    assert heard(b"C", at(9600), at(9600, 8, "E")).parity_errors == 0


def test_two_stop_bits_do_not_matter_to_one_who_looks_at_the_first():
    assert heard(ALL, at(9600, 8, "N", 2), at(9600)).data == ALL
    assert heard(ALL, at(9600), at(9600, 8, "N", 2)).data == ALL
