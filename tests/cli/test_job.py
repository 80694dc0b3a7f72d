"""Job files: what a line means, and what counts as accepted."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from isel_twin.job import JobError, Line, parse_job
from isel_twin.job import _accepted as accepted


@pytest.mark.parametrize(
    ("text", "actions"),
    [
        ("@07", [b"@07\r"]),
        ("  @07  ", [b"@07\r"]),
        ("@07 # initialise", [b"@07\r"]),
        ("#DX,0,4,4,4", [b"#DX,0,4,4,4\r"]),
        ("<253>", [b"\xfd"]),
        ("<13>", [b"\r"]),
        ("L15,x500<1>", [b"L15,x500\x01"]),
        ("<0.5s>", [500_000_000]),
        ("<2 s>", [2_000_000_000]),
        ("@0S<13> <0.25s> <253>", [b"@0S\r", 250_000_000, b"\xfd"]),
        ("@07<13>@0R7", [b"@07\r@0R7\r"]),
        ("<253><1s>@0P", [b"\xfd", 1_000_000_000, b"@0P\r"]),
        ("<254> <255>", [b"\xfe\xff"]),
    ],
)
def test_what_a_line_sends(text, actions):
    (line,) = parse_job(text)
    assert list(line.actions) == actions


@pytest.mark.parametrize("text", ["", "\n\n", "   ", "#", "# x", "#!/bin/sh", "#-----", "  # @07", "## x"])
def test_lines_that_send_nothing(text):
    assert parse_job(text) == []


@pytest.mark.parametrize("item", ["256", "-1", "", "s", "1.5", "x", "1m", "1e3s"])
def test_bad_items_are_named(item):
    with pytest.raises(JobError, match=r"line 2: <.*> is neither a byte"):
        parse_job(f"@07\n@0S <{item}>")


def test_characters_beyond_a_byte_are_named():
    with pytest.raises(JobError, match="line 1: '€'"):
        parse_job("@0€")


@given(st.text())
def test_any_text_is_a_job_or_a_job_error(text):
    try:
        lines = parse_job(text)
    except JobError:
        lines = []
    assert all(line.actions for line in lines)


@given(st.lists(st.integers(0, 255), min_size=1))
def test_bytes_written_as_numbers_are_sent_as_they_are(numbers):
    (line,) = parse_job("".join(f"<{number}>" for number in numbers))
    assert line.actions == (bytes(numbers),)


@pytest.mark.parametrize(
    ("sent", "reply", "ok"),
    [
        (b"@07\r", "0", True),
        (b"@0P\r", "0" * 19, True),
        (b"@0V\r", "isel iMC-S8 V1.0", True),
        (b"@07\r", "5", False),
        (b"@0S\r", "F", False),
        (b"@07\r", "", False),
        (b"\xfd", "", True),
        (b"\xfd", "F", False),
        (b"@R\r", "\r", True),
        (b"@X\r", "@X100110\r", True),
        (b"L15,x500\x01", "\x02\r", True),
    ],
)
def test_what_counts_as_accepted(sent, reply, ok):
    assert accepted(Line(1, "", (sent,)), reply) is ok
