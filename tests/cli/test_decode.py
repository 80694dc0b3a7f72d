"""`isel-twin decode`: every byte explained, none lost, and what is said of a call that cannot be carried out."""

from __future__ import annotations

import io
import json
import sys
from pathlib import Path
from types import SimpleNamespace

import hypothesis.strategies as st
import pytest
from hypothesis import given, settings

from isel_twin.cli import main
from isel_twin.jobs.decode import DecodeError, Piece, explain, marked, typed
from isel_twin.language import create_language, language_names, readable
from tests.forked import PATIENCE_S, start_anew


def call(capsys: pytest.CaptureFixture[str], *arguments: object) -> tuple[int, str, str]:
    with pytest.raises(SystemExit) as caught:
        main(["decode", *map(str, arguments)])
    out, err = capsys.readouterr()
    return int(caught.value.code or 0), out, err


def rows(capsys: pytest.CaptureFixture[str], *arguments: object) -> list[dict[str, object]]:
    code, out, err = call(capsys, "--json", *arguments)
    assert (code, err) == (0, "")
    return [json.loads(line) for line in out.splitlines()]


LIKELY = st.sampled_from([b"\r", b"\n", b"@0", b"@07\r", b"0", b"\x01", b"$HX", b"L1,X5", b"\xfd", b"i", b"\x00"])
PIECES = st.lists(st.builds(Piece, st.one_of(LIKELY, st.binary(max_size=60)), st.booleans()), max_size=12)


@pytest.mark.parametrize("controller", ["imc-s8", "imc-mp", "c142", "ismif"])
@settings(deadline=None)
@given(PIECES)
def test_nothing_is_lost(controller: str, pieces: list[Piece]) -> None:
    language = create_language(controller)
    assert language is not None
    found = list(explain(pieces, language))
    for sent in (True, False):
        given_bytes = b"".join(piece.data for piece in pieces if piece.sent is sent)
        of_this = [row for row in found if row.sent is sent]
        assert b"".join(row.data for row in of_this) == given_bytes
        assert [row.offset for row in of_this] == [
            sum(len(before.data) for before in of_this[:index]) for index in range(len(of_this))
        ]
    assert [row.number for row in found] == list(range(1, len(found) + 1))
    assert all(row.text and row.explanation for row in found)


@settings(deadline=None)
@given(st.binary(max_size=200))
def test_a_reply_typed_as_it_is_shown_is_the_same_bytes(data: bytes) -> None:
    language = create_language("imc-s8")
    assert language is not None
    assert b"".join(piece.data for piece in typed(readable(data), False, language, "imc-s8")) == data


def test_a_dump_of_the_host(tmp_path, capsys):
    dump = tmp_path / "sent.bin"
    dump.write_bytes(b"@07\r@0R7\r\xfd\x80?\r@0A 80")
    found = rows(capsys, dump)
    assert [(row["offset"], row["text"], row["complete"]) for row in found] == [
        (0, "@07", True),
        (4, "@0R7", True),
        (9, "<253>", True),
        (10, "<128>?", True),
        (13, "@0A 80", False),
    ]
    assert bytes.fromhex("".join(str(row["hex"]) for row in found)) == dump.read_bytes()
    assert "reference run" in str(found[1]["explanation"])


def test_a_dump_of_the_controller(tmp_path, capsys):
    dump = tmp_path / "received.bin"
    dump.write_bytes(b"0F")
    found = rows(capsys, dump, "--received")
    assert [(row["sent"], row["text"]) for row in found] == [(False, "0"), (False, "F")]
    assert "stopped" in str(found[1]["explanation"])


def test_a_line_typed_in_is_sent_as_in_a_job(capsys):
    (row,) = rows(capsys, "@0R7")
    assert (row["hex"], row["text"], row["complete"]) == (b"@0R7\r".hex(), "@0R7", True)
    assert [row["hex"] for row in rows(capsys, "<253>")] == ["fd"]
    (row,) = rows(capsys, "$HZXY<1>", "--controller", "ismif")
    assert row["hex"] == b"$HZXY\x01".hex()


def test_both_directions_of_marked_lines(tmp_path, capsys):
    """The same digits are one answer to a question and many to no question."""
    session = tmp_path / "session"
    session.write_text("> @07\n< 0\n> @0P\n< 0003E80001F40000000\n\n> <253>\n< F\n")
    found = rows(capsys, session, "--marked")
    assert [(row["sent"], row["text"]) for row in found] == [
        (True, "@07"),
        (False, "0"),
        (True, "@0P"),
        (False, "0003E80001F40000000"),
        (True, "<253>"),
        (False, "F"),
    ]


def test_a_table_for_people(capsys):
    code, out, _ = call(capsys, "@07")
    assert code == 0
    head, row = out.splitlines()
    assert head.split() == ["no", "offset", "dir", "text", "explanation"]
    assert row.split()[:4] == ["1", "0", "host", "@07"]
    assert "initialise" in row


def test_standard_input(monkeypatch, capsys):
    monkeypatch.setattr(sys, "stdin", SimpleNamespace(buffer=io.BufferedReader(io.BytesIO(b"@07\r@0"))))
    assert [row["text"] for row in rows(capsys, "-")] == ["@07", "@0"]


def test_rubbish_is_shown_as_it_is_and_a_large_file_too(tmp_path, capsys):
    dump = tmp_path / "rubbish"
    dump.write_bytes(bytes(range(256)) * 150)
    for controller in ("imc-s8", "ismif"):
        for direction in ("--sent", "--received"):
            found = rows(capsys, dump, direction, "--controller", controller)
            assert bytes.fromhex("".join(str(row["hex"]) for row in found)) == dump.read_bytes()


def test_an_empty_file_has_no_message(tmp_path, capsys):
    (tmp_path / "empty").write_bytes(b"")
    assert rows(capsys, tmp_path / "empty") == []


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["session.bin"], "session.bin: there is no such file; if it is text that goes over the line, add --text"),
        (["./nowhere/x"], "./nowhere/x: there is no such file"),
        (["/"], "/: is a folder, not a file"),
        (["@07", "--controller", "imc-9"], "unknown controller 'imc-9'; installed: "),
        (["@07", "--sent", "--received"], "only one of them"),
        (["@0€"], "is not a character a serial line can carry"),
        (["<300>"], "<300> is neither a byte"),
        (["@07", "--marked"], "text: line 1: begins neither with >"),
        (["", "--marked", "--sent"], "only one of them"),
    ],
)
def test_a_call_that_cannot_be_carried_out_is_one_line(capsys, tmp_path, monkeypatch, arguments, said):
    monkeypatch.chdir(tmp_path)
    code, out, err = call(capsys, *arguments)
    assert code == 2
    assert out == ""
    assert said in err
    assert err.count("\n") == 1


def test_text_that_looks_like_a_file_is_text_if_told_so(capsys):
    assert rows(capsys, "session.bin", "--text")[0]["text"] == "session.bin"


def test_a_file_that_looks_like_text_is_text_if_told_so(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    Path("@07").write_bytes(b"@0P\r")
    assert [rows(capsys, "@07", *more)[0]["text"] for more in ([], ["--text"])] == ["@0P", "@07"]


def test_a_controller_without_language(monkeypatch, capsys):
    monkeypatch.setattr("isel_twin.language.registry._GROUP", "isel_twin.none")
    assert language_names() == []
    code, _, err = call(capsys, "@07")
    assert code == 2
    assert err == "isel-twin: controller 'imc-s8' has no language, which would say what its bytes mean\n"


def test_nobody_reads_any_more(tmp_path):
    dump = tmp_path / "long"
    dump.write_bytes(b"@07\r" * 50_000)
    with start_anew("decode", dump) as process:
        process.stdout.readline()
        process.stdout.close()
        assert process.stderr.read() == ""
        assert process.wait(PATIENCE_S) == 1


def test_marked_lines_say_which_line_is_wrong():
    language = create_language("imc-s8")
    assert language is not None
    with pytest.raises(DecodeError, match=r"^line 2: <300> is neither a byte"):
        list(marked("< 0\n> <300>\n", language, "imc-s8"))
