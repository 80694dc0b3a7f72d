"""The card's language: the manual's own text, and telegrams in words."""

from __future__ import annotations

import pytest

from isel_twin.language import LanguageError, MoveSettings, create_language

LANGUAGE = create_language("gmi99")
assert LANGUAGE is not None


@pytest.mark.parametrize(
    ("text", "frame", "words"),
    [
        ("p3;100;0", "68 0B 0B 68 E0 70 03 00 00 64 00 00 00 00 00 B7 16", "begin to record program 0"),
        ("81h 238", "68 05 05 68 E0 81 EE 00 00 4F 16", "move axes: 0 238"),
        ("96h 70 15 100", "68 0B 0B 68 E0 96 46 00 00 0F 00 00 64 00 00 2F 16", "move axes: 1 70, 2 15, 4 100"),
        ("#1", "10 E0 01 E1 16", "ask for the status"),
        ("#9 50", "10 E0 09 32 1B 16", "override in percent: 50"),
        ("T1;0", "68 08 08 68 E0 54 01 00 00 00 00 00 35 16", "ask for the version"),
        ("O-5;0", "68 08 08 68 E0 4F FB FF FF 00 00 00 28 16", "position counter of axis 0: -5"),
        ("Q7;1", "68 08 08 68 E0 51 07 00 00 01 00 00 39 16", "reference run: axes 0, 1, 2"),
        ("0: #1", "10 00 01 01 16", "drive 0: ask for the status"),
    ],
)
def test_text_to_telegrams_and_back(text: str, frame: str, words: str) -> None:
    data = bytes.fromhex(frame)
    assert LANGUAGE.frame(text) == data
    (message,) = create_language("gmi99").messages(data, True)
    assert (message.data, message.text, message.explanation) == (data, text, words)
    assert LANGUAGE.frame(message.text) == data


@pytest.mark.parametrize(("text", "words"), [
    ("p4;1;513", "axis 2 runs program 1"), ("p4;120;514", "axis 2 turns with 120 1/min"),
    ("p4;-120;258", "axis 1 turns with -120 1/min"), ("p4;0;256", "wait for the program of axis 1"),
    ("p4;0;3", "programming"),
])  # fmt: skip
def test_axes_that_leave_the_interpolation_in_words(text: str, words: str) -> None:
    (message,) = create_language("gmi99").messages(LANGUAGE.frame(text), True)
    assert message.explanation == words


@pytest.mark.parametrize(
    ("reply", "text", "words"),
    [
        ("E5", "E5", "reply: received"),
        ("10 E0 90 70 16", "#90", "status: moving, busy"),
        ("10 E0 02 17 F9 16", "#02 17", "status: message 23"),
        ("10 E0 08 E8 16", "#08", "reply: buffer full, send it again"),
        ("68 04 04 68 E0 56 E8 01 1F 16", "V488", "version"),
        ("68 05 05 68 E0 40 FB FF FF 19 16", "@-5", "position"),
        ("68 02 02 68 E0 12 F2 16", "12h", "status or code"),
        ("00 FF", "00 FF", "no frame"),
    ],
)
def test_replies_in_words(reply: str, text: str, words: str) -> None:
    data = bytes.fromhex(reply)
    assert LANGUAGE.text(data) == text
    (message,) = create_language("gmi99").messages(data, False)
    assert (message.data, message.text, message.explanation) == (data, text, words)


def test_several_at_once() -> None:
    both = LANGUAGE.frame("81h 10 | 82h -5")
    assert both == LANGUAGE.frame("81h 10") + LANGUAGE.frame("82h -5")
    assert LANGUAGE.text(b"\xe5\xe5") == "E5 E5"


@pytest.mark.parametrize(
    "text", ["", "Y1", "#2", "#9", "#9 256", "81h", "81h 1 2", "01h 5", "T1;2;3;4", "M99999999", "a 0", "300: #1", "é"]
)
def test_what_cannot_be_said(text: str) -> None:
    with pytest.raises(LanguageError):
        LANGUAGE.frame(text)


def test_buffer_full_is_a_refusal_and_silence_is_none() -> None:
    move = LANGUAGE.frame("81h 5")
    assert LANGUAGE.accepted(move, b"\xe5")
    assert not LANGUAGE.accepted(move, bytes.fromhex("10 E0 08 E8 16"))
    assert not LANGUAGE.accepted(move, b"")
    assert LANGUAGE.accepted(b"", b"")


def test_a_move_as_a_host_would_make_it() -> None:
    said = [next(create_language("gmi99").messages(f, True)).text
            for f in LANGUAGE.move((100, -200, 300), MoveSettings(20_000, 100, 300))]  # fmt: skip
    assert said == ["M20000", "B100", "f20000", "G90", "87h 100 -200 300"]
    with pytest.raises(LanguageError):
        LANGUAGE.move((0, 0, 9_000_000), MoveSettings())
