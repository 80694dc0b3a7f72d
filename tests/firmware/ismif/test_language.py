"""The iSMIF's language: every command and answer in words, and moves with the acceleration that was asked for."""

from __future__ import annotations

import hypothesis.strategies as st
import pytest
from hypothesis import given

from isel_twin.firmware.ismif.commands import COMMANDS, LINE_LIMIT
from isel_twin.firmware.ismif.language import ANSWERS, CR, STATUS
from isel_twin.language import Language, LanguageError, Message, MoveSettings, create_language
from isel_twin.testing import Desk, PositionSwitch


def fresh() -> Language:
    language = create_language("ismif")
    assert language is not None
    return language


def told(data: bytes, sent: bool = True) -> list[str]:
    return [message.explanation for message in fresh().messages(data, sent)]


# --- what a host says ------------------------------------------------------------------------------------------------


def test_text_gets_a_carriage_return_also_after_01h() -> None:
    assert fresh().frame("#E1,600") == b"#E1,600\r"
    assert fresh().frame("L1,X5\x01") == b"L1,X5\x01\r"
    with pytest.raises(LanguageError, match=r"^'€' is not a character a serial line can carry$"):
        fresh().frame("€")


@pytest.mark.parametrize(
    ("sent", "reply", "accepted"),
    [
        (b"@R\r", b"\r", True),
        (b"@X\r", b"@X100110\r", True),
        (b"L15,x500\x01", b"\r\x02\r", True),
        (b"L15,x500\r", b"\x03\r", True),
        (b"\x01", b"\x02\r", True),
        (b"\r", b"", True),
        (b"@X\r", b"", False),
        (b"W5\r", b"m", False),
    ],
)
def test_what_is_accepted(sent: bytes, reply: bytes, accepted: bool) -> None:
    assert fresh().accepted(sent, reply) is accepted


@pytest.mark.parametrize(
    ("settings", "ramp_ms"),
    [
        (MoveSettings(2300, 10, 300), 200),
        (MoveSettings(2301, 10, 300), 201),  # never steeper than asked for
        (MoveSettings(5000, 4000, 65), 2),
        (MoveSettings(5000, 1, 65), 4935),
        (MoveSettings(300, 10, 300), 0),
        (MoveSettings(200, 10, 300), 0),
    ],
)
def test_an_acceleration_is_a_ramp_length(settings: MoveSettings, ramp_ms: int) -> None:
    """R = (V - f0) / a."""
    assert list(fresh().move((80, -80, 0), settings)) == [
        b"#S%d\r" % settings.start_stop_hz,
        b"#E0,%d\r" % settings.speed_hz,
        b"#R%d\r" % ramp_ms,
        b"L0,X80,Y-80,Z0\x01",
    ]


def at_home() -> Desk:
    switches = [PositionSwitch(f"limit_{axis}1", number, 0, -1) for number, axis in enumerate("xyz")]
    return Desk.of("ismif", carriage=(300, 300, 300, 0), position_switches=switches)


def test_the_controller_does_what_the_language_asks_for() -> None:
    """1000 half steps at 10 Hz/ms: the frequencies of the stream rise from 300 to 1300 Hz in 100 ms."""
    desk, language = at_home(), fresh()
    for data in (*language.reference(), *language.move((1000, 500, 0), MoveSettings(1300, 10, 300))):
        before = len(desk.steps)
        desk.send(data)
        assert language.accepted(data, desk.finish().encode("latin-1"))
        assert not desk.controller.fault
    assert desk.counts == (1000, 500, 0, 0)
    t_s = desk.steps.t_ns[before:] * 1e-9
    ramp_steps = (1300**2 - 300**2) / (2 * 10_000)
    duration_s = 2 * 0.1 + (1000 - 2 * ramp_steps) / 1300
    assert t_s[-1] - t_s[0] == pytest.approx(duration_s, abs=1 / 300)


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        (MoveSettings(), "speed_hz is 10000; the controller takes 65 to 5000"),
        (MoveSettings(64, 10, 300), "speed_hz is 64"),
        (MoveSettings(600, 10, 64), "start_stop_hz is 64"),
    ],
)
def test_settings_that_the_interface_would_only_swallow_are_named(settings: MoveSettings, message: str) -> None:
    with pytest.raises(LanguageError, match=message) as caught:
        fresh().move((0, 0, 0), settings)
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("target", [(), (1, 2), (1, 2, 3, 4), (1, 2, 3.5)])
def test_a_target_is_three_counters(target: tuple[int, ...]) -> None:
    with pytest.raises(LanguageError, match="give 3 whole numbers"):
        fresh().move(target, MoveSettings(600))


def test_a_move_is_broken_off_with_its_ramp() -> None:
    desk, language = at_home(), fresh()
    *stored, move = language.move((4000, 0, 0), MoveSettings(1300, 10, 300))
    for data in (*language.reference(), *stored):
        desk.send(data)
        desk.finish()
    desk.send(move)
    desk.run(1.0)
    at_speed = desk.counts[0]
    desk.send(language.break_off())
    assert desk.finish() == "\r\r\x02\r"
    assert desk.counts[0] - at_speed == pytest.approx((1300**2 - 300**2) / (2 * 10_000), abs=1)


# --- every command and every answer has words -------------------------------------------------------------------------

LINES = {
    "@R": ("@R", "reset"),
    "@V": ("@V", "ask for the version"),
    "@X": ("@X", "ask for the status"),
    "@L": ("@LY", "ask for the position of Y"),
    "T": ("T1", "drive signals: clock and direction"),
    "F": ("F0", "half steps"),
    "Z": ("Z2", "Z axis: the relay of a plotter"),
    "#S": ("#S200", "start speed: 200 Hz"),
    "#E": ("#E25,400", "end speed 25: 400 Hz"),
    "#R": ("#R500", "ramp length: 500 ms"),
    "#D": ("#DX,0,4,5,6", "reference run of X: towards minus, end speeds 4, 5, 6"),
    "#O": ("#OZ,25", "offset of Z after the reference run: 25 steps"),
    "$H": ("$HZXY", "reference run of Z, X, Y"),
    "L": ("L1,X800,y-50", "move X to 800, Y by -50 at end speed 1"),
    "@B": ("@B", "stop the axes with a ramp"),
    "@S": ("@S", "stop the axes at once"),
    "@A": ("@A", "pause"),
    "@C": ("@C", "end the pause"),
    "A": ("A1", "pin 12: on"),
    "W": ("W250", "wait 250 ms"),
}


@pytest.mark.parametrize("code", COMMANDS)
def test_every_command_has_words(code: str) -> None:
    line, words = LINES[code]
    assert list(fresh().messages(line.encode() + CR, sent=True)) == [
        Message(line.encode() + CR, line, words, sent=True)
    ]
    assert told(line.encode() + b"\x01") == [f"{words}; start the job"]


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (b"\x01", "start the job"),
        (b"\r", "an empty line, no command"),
        (b" \n\r", "an empty line, no command"),
        (b"#Q1\r", "no command: unknown command '#Q'"),
        (b"#E1,9000\r", "no command: '9000' is not a number from 65 to 5000"),
        (b"\xe9\r", "no command: unknown command '<233>'"),
        (b"W" + b"1" * LINE_LIMIT + b"\x01", f"no command: a line of {LINE_LIMIT} bytes or more; start the job"),
    ],
)
def test_whatever_else_a_line_is_has_words_too(data: bytes, words: str) -> None:
    assert told(data) == [words]


@pytest.mark.parametrize("line", ANSWERS)
def test_every_answer_without_text_has_words(line: bytes) -> None:
    assert told(line + CR, sent=False) == [f"reply: {ANSWERS[line]}"]


@pytest.mark.parametrize(("place", "words"), list(enumerate(STATUS)))
def test_every_place_of_the_status_has_words(place: int, words: str) -> None:
    bits = "".join("1" if place == other else "0" for other in range(len(STATUS)))
    assert told(f"@X{bits}\r".encode(), sent=False) == [f"status: {words}"]


@pytest.mark.parametrize(
    ("line", "words"),
    [
        (b"@X000000", "status: ready"),
        (b"@X100001", "status: moving, job in progress"),
        (b"@LX-25", "position X -25"),
        (b"@V SMC-ISMIF 1.00", "version: SMC-ISMIF 1.00"),
        (b"@X1", "no answer of this interface"),
        (b"@L", "no answer of this interface"),
        (b"0", "no answer of this interface"),
    ],
)
def test_words_of_answers(line: bytes, words: str) -> None:
    assert told(line + CR, sent=False) == [words]


def test_what_a_real_session_says() -> None:
    desk, language = at_home(), fresh()
    words = []
    for line in ("$HZXY\x01", "#Q", "@X", "@R", "@X", "@V", "@LX"):
        desk.start(line)
        words += [message.explanation for message in language.messages(desk.finish().encode("latin-1"), sent=False)]
    over = f"reply: {ANSWERS[bytes([2])]}"
    assert words == [
        "reply: acknowledged",
        over,
        "reply: acknowledged",
        "status: error",
        "reply: acknowledged",
        "status: not referenced",
        "version: SMC-ISMIF 1.00",
        "position X 0",
    ]


def test_memory_is_bounded_whatever_comes() -> None:
    language = fresh()
    for sent in (True, False):
        for _ in range(100):
            assert all(message.explanation for message in language.messages(b"x" * 1000, sent))
        assert len(language.rest(sent)) < 10_000
    (end,) = language.messages(b"\r", sent=True)
    assert end.explanation == f"no command: a line of {LINE_LIMIT} bytes or more"


WORDS = [b"$HZ\x01", b"\x01", b"@X\r", b"L1,X5", b",Y-3\r", b"\r", b"\n", b"\x02\r", b"@X000100\r", b"@L", b"@V x\r"]


@given(st.lists(st.tuples(st.booleans(), st.one_of(st.binary(max_size=40), st.sampled_from(WORDS)))))
def test_any_bytes_in_any_pieces_become_messages_that_hold_all_of_them(traffic: list[tuple[bool, bytes]]) -> None:
    language, in_one_piece = fresh(), fresh()
    messages = [message for sent, data in traffic for message in language.messages(data, sent)]
    assert all(message.explanation and message.text for message in messages)
    for direction in (True, False):
        whole = b"".join(data for sent, data in traffic if sent == direction)
        parts = [message for message in messages if message.sent == direction]
        assert b"".join(message.data for message in parts) + language.rest(direction) == whole
        assert list(in_one_piece.messages(whole, direction)) == parts
