"""Job files: what a line sends, and what becomes of it."""

from __future__ import annotations

import pytest
import unknown
from hypothesis import given
from hypothesis import strategies as st

from isel_twin import Twin
from isel_twin.jobs.job import JobError, Line, decode_job, parse_job
from isel_twin.jobs.sending import play
from isel_twin.language import create_language

CONTROLLERS = ("imc-s8", "ismif")


def parsed(text: str, controller: str = "imc-s8") -> list[Line]:
    return parse_job(text, create_language(controller), controller)


@pytest.mark.parametrize("controller", CONTROLLERS)
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
def test_what_a_line_sends(text, actions, controller):
    (line,) = parsed(text, controller)
    assert list(line.actions) == actions


@pytest.mark.parametrize("text", ["", "\n\n", "   ", "#", "# x", "#!/bin/sh", "#-----", "  # @07", "## x"])
def test_lines_that_send_nothing(text):
    assert parsed(text) == []


@pytest.mark.parametrize("item", ["256", "-1", "", "s", "1.5", "x", "1m", "1e3s"])
def test_bad_items_are_named(item):
    with pytest.raises(JobError, match=r"line 2: <.*> is neither a byte"):
        parsed(f"@07\n@0S <{item}>")


@pytest.mark.parametrize("seconds", ["1000000001", "9" * 400, "9" * 5000])
def test_a_pause_has_a_limit(seconds):
    with pytest.raises(JobError, match="line 2: a pause of more than 1000000000 s"):
        parsed(f"@07\n<{seconds}s>")
    assert parsed("<1000000000s>")[0].actions == (10**18,)


def test_a_byte_of_many_digits_is_a_job_error():
    with pytest.raises(JobError, match="is neither a byte"):
        parsed("<" + "9" * 5000 + ">")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1"])
@pytest.mark.parametrize("end", ["\n", "\r\n", "\r"])
def test_only_line_ends_split_a_file(encoding, end):
    """The second byte of a capital A with ring in UTF-8 is 85h, which str.splitlines takes for a line end."""
    data = end.join(["# Ångström und @0R7", "@07", "", "@0P # Å @0R7"]).encode(encoding)
    assert [(line.number, line.sent) for line in parsed(decode_job(data))] == [(2, b"@07\r"), (4, b"@0P\r")]


def test_ctrl_z_ends_a_file_of_old_systems_and_nothing_before_it():
    """At the end it is padding; within a file it is sent, and refused, so that no line behind it is left out unsaid."""
    assert [line.sent for line in parsed(decode_job(b"@07\r\n@0P\r\n\x1a\x1a"))] == [b"@07\r", b"@0P\r"]
    assert [line.sent for line in parsed(decode_job(b"@07\n\x1a\n@0P\n"))] == [b"@07\r", b"\x1a\r", b"@0P\r"]


@pytest.mark.parametrize("control", ["\x0b", "\x0c", "\x1c", "\x1d", "\x1e", "\x85", "\u2028", "\xa0"])
def test_no_other_character_ends_a_comment(control):
    assert parsed(f"# one{control}@0R7") == []


def test_bytes_that_are_no_utf_8_are_sent_as_they_are():
    (line,) = parsed(decode_job(b"@0M\xfd\x85 # \xe4\n"))
    assert line.sent == b"@0M\xfd\x85\r"


def test_characters_beyond_a_byte_are_named():
    with pytest.raises(JobError, match="line 1: '€'"):
        parsed("@0€")


@given(st.text())
def test_any_text_is_a_job_or_a_job_error(text):
    try:
        lines = parsed(text)
    except JobError:
        lines = []
    assert all(line.actions or line.condition for line in lines)


@given(st.lists(st.integers(0, 255), min_size=1))
def test_bytes_written_as_numbers_are_sent_as_they_are(numbers):
    (line,) = parsed("".join(f"<{number}>" for number in numbers))
    assert line.actions == (bytes(numbers),)


@pytest.mark.parametrize("text", ["@07", "<13>@07", "<1s> ?"])
def test_text_for_a_controller_without_language_is_named(text):
    with pytest.raises(JobError, match="line 2: controller 'toy' has no language: send its bytes as <13>"):
        parse_job(f"<64>\n{text}", None, "toy")


def test_bytes_need_no_language():
    (line,) = parse_job("@07<13> <0.5s> <253>", None, "toy")
    assert line.actions == (b"@07\r", 500_000_000, b"\xfd")


def results(text: str, *, controller: str = "imc-s8", language: bool = True) -> list[tuple[str, bool]]:
    """Reply and verdict of each line, played on a twin."""
    twin = Twin(controller=controller, plant="kinematic")
    twin.language = twin.language if language else None
    return [(result.reply, result.ok) for result in play(twin, parse_job(text, twin.language, controller), 100.0)]


def test_what_becomes_of_a_job():
    assert results(f"@07\n@0R7\n@0P\n{unknown.DNC[0]}\n<253>") == [
        ("0", True),
        ("0", True),
        ("0" * 19, True),
        ("5", False),
        ("", True),
    ]
    assert results("$HZXY<1>\n@X\nL9<1>", controller="ismif") == [
        ("\r\x02\r", True), ("@X000000\r", True), ("\r\x02\r", True)
    ]  # fmt: skip


def test_without_a_language_no_reply_is_a_refusal_and_every_byte_is_shown():
    assert results(f"@07<13>\n{unknown.DNC[0]}<13>\n", language=False) == [("0", True), ("5", True)]
    assert results("$HZXY<1>", controller="ismif", language=False) == [("<13><2><13>", True)]


@pytest.mark.parametrize(("pauses", "total_ns"), [("@07", 0), ("<0.5s> <253> <2 s>", 2_500_000_000)])
def test_how_long_a_line_pauses(pauses, total_ns):
    assert parsed(pauses)[0].pauses_ns == total_ns


def played(text: str, timeout_s: float, stop=None) -> list[tuple[int, str, bool, int]]:
    twin = Twin(plant="kinematic")
    lines = parse_job(text, twin.language, "imc-s8")
    return [(r.number, r.reply, r.complete, r.end_ns) for r in play(twin, lines, timeout_s, stop)]


def test_a_job_ends_with_the_line_that_is_not_over_in_time():
    """A late reply would be taken for that of the lines which follow."""
    ended = played("@07\n@0N7\n@0A16000,5000,0,30,0,30,0,30\n@0P\n", 1.0)
    assert [result[:3] for result in ended] == [(1, "0", True), (2, "0", True), (3, "", False)]
    assert ended[-1][3] - ended[-2][3] == 1_000_000_000


def test_what_has_come_in_time_belongs_to_the_line():
    assert played("@07<13>@0N7<13>@0A16000,5000,0,30,0,30,0,30\n@0P\n", 1.0)[-1][:3] == (1, "00", False)


def test_a_job_can_be_stopped():
    asked = iter([False] * 4 + [True] * 100)
    ended = played("@07\n<1000s>\n@0P\n", 1.0, lambda: next(asked))
    assert ended[0][:2] == (1, "0")
    assert len(ended) < 3
    assert played("@07\n", 1.0, lambda: True) == []
