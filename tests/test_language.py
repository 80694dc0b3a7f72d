"""Languages as a border: who has one, what those do who have none, and the parts that languages of text are made of."""

from __future__ import annotations

from pathlib import Path

import hypothesis.strategies as st
import pytest
from hypothesis import given

from isel_twin import Twin
from isel_twin.controller import PluginError, UnknownNameError, controller_names
from isel_twin.envs import Settings
from isel_twin.jobs.job import decode_job
from isel_twin.language import (
    SETTINGS_RANGES,
    LanguageError,
    MoveSettings,
    Pieces,
    create_language,
    encoded,
    language_names,
    needed,
    programs_for,
    readable,
)


def test_every_controller_of_the_package_has_a_language() -> None:
    assert set(language_names()) >= {"imc-s8", "imc-m", "imc-mp", "c142", "ismif", "gmi99", "bwo900", "external"}
    for name in language_names():
        language = create_language(name)
        assert language is not None
        assert language is not create_language(name), "a fresh one each time"
        from_standstill = {"start_stop_hz"} if name in ("gmi99", "bwo900") else set()
        without_ramps = {"start_stop_hz", "acceleration_hz_per_ms"} if name == "external" else set()
        assert language.ranges.keys() == SETTINGS_RANGES.keys() - from_standstill - without_ramps
        for setting, (low, high) in language.ranges.items():
            widest = SETTINGS_RANGES[setting]
            assert widest[0] <= low < high <= widest[1]


def test_a_controller_that_is_not_there_is_named() -> None:
    with pytest.raises(UnknownNameError, match="unknown controller 'imc-s9'; installed: bwo900"):
        create_language("imc-s9")


def test_who_needs_a_language_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("isel_twin.language.registry._GROUP", "isel_twin.none")
    assert language_names() == []
    for name in controller_names():
        assert create_language(name) is None
    with pytest.raises(LanguageError, match=r"^controller 'toy' has no language: send its bytes as <13>"):
        needed(None, "toy")
    twin = Twin(plant="kinematic")
    assert twin.language is None
    with pytest.raises(LanguageError, match="controller 'imc-s8' has no language"):
        twin.query("@07")
    twin.write(b"@07\r")
    assert twin.read() == b"0", "bytes need no language"


def test_a_query_that_cannot_be_sent_is_one_clear_line() -> None:
    with pytest.raises(LanguageError, match=r"^'€' is not a character a serial line can carry$"):
        Twin(plant="kinematic").query("@0€")


def test_settings_are_the_same_wherever_they_come_from() -> None:
    assert Settings is MoveSettings


@given(st.binary())
def test_readable_is_what_a_job_file_has(data: bytes) -> None:
    text = readable(data)
    assert text.isascii()
    assert text.isprintable()
    rebuilt = b""
    while text:
        if text[0] == "<":
            number, text = text[1:].split(">", 1)
            rebuilt += bytes([int(number)])
        else:
            rebuilt += encoded(text[0])
            text = text[1:]
    assert rebuilt == data


def test_pieces() -> None:
    pieces = Pieces(ends=b"\r\x01", alone=b"\xfd", longest=5)
    assert pieces.cut(b"ab") == []
    assert pieces.rest == b"ab"
    assert pieces.cut(b"c\rd\x01\r") == [b"abc\r", b"d\x01", b"\r"]
    assert pieces.cut(b"a\xfdb\xfd\xfd") == [b"a", b"\xfd", b"b", b"\xfd", b"\xfd"]
    assert pieces.cut(b"1234567") == [b"12345"]
    assert pieces.rest == b"67"


JOBS = Path(__file__).parent / "jobs"


@pytest.mark.parametrize("file", sorted(JOBS.rglob("*.txt")) + sorted(JOBS.rglob("*.nc")), ids=lambda file: file.name)
def test_programs_are_told_from_jobs(file: Path) -> None:
    """No job of any controller is taken for a program, and every program is known as one."""
    assert programs_for(decode_job(file.read_bytes())) == (["bwo900"] if file.suffix == ".nc" else [])


def test_a_language_that_does_not_work_claims_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    def broken(name: str) -> None:
        raise PluginError(name)

    monkeypatch.setattr("isel_twin.language.registry.create_language", broken)
    assert programs_for("N10 G0 X5\n") == []
