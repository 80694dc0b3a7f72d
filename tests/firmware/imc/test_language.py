"""The iMC's language: every command and every reply in words, and each answer with the command it belongs to."""

from __future__ import annotations

import random
from collections.abc import Iterable

import hypothesis.strategies as st
import pytest
import unknown
from hypothesis import given

from isel_twin.controller import create_controller
from isel_twin.firmware.imc import commands
from isel_twin.firmware.imc.controller import Imc
from isel_twin.firmware.imc.language import CONTROL, LONGEST
from isel_twin.firmware.imc.replies import WORDS as CODES
from isel_twin.language import Language, LanguageError, Message, MoveSettings, create_language
from isel_twin.testing import Desk


def fresh(name: str = "imc-s8") -> Language:
    language = create_language(name)
    assert language is not None
    return language


def told(language: Language, *exchange: bytes) -> list[str]:
    """Explanations of what goes over the line: sent, received, sent, received ..."""
    return [
        message.explanation
        for number, data in enumerate(exchange)
        for message in language.messages(data, sent=number % 2 == 0)
    ]


# --- what a host says ------------------------------------------------------------------------------------------------


def test_text_gets_its_carriage_return() -> None:
    assert fresh().frame("@0IUé") == b"@0IU\xe9\r"
    with pytest.raises(LanguageError, match=r"^'€' is not a character a serial line can carry$"):
        fresh().frame("@0IU€")


@pytest.mark.parametrize(
    ("sent", "reply", "accepted"),
    [
        (b"@07\r", b"0", True),
        (b"@0P\r", b"0" * 19, True),
        (b"@0V\r", b"isel iMC-S8 V1.0", True),
        (b"@07\r", b"5", False),
        (b"@0S\r", b"F", False),
        (b"@07\r", b"", False),
        (b"\xfd", b"", True),
        (b"\xfd", b"F", False),
        (b"\r", b"", True),
    ],
)
def test_what_is_a_refusal(sent: bytes, reply: bytes, accepted: bool) -> None:
    assert fresh().accepted(sent, reply) is accepted


def test_what_a_host_sends_to_reference_and_to_move() -> None:
    language = fresh()
    assert list(language.reference()) == [b"@07\r", b"@0d5000,5000,5000\r", b"@0R7\r", b"@0z1\r"]
    assert list(language.move((16000, -8, 0), MoveSettings(9000, 50, 250))) == [
        b"@0j250\r", b"@0J50\r", b"@0M16000,9000,-8,9000,0,9000,0,30\r"
    ]  # fmt: skip
    assert language.break_off() == b"\xff"


@pytest.mark.parametrize("target", [(), (1, 2), (1, 2, 3, 4), (1, 2, 3.5), ("1", "2", "3")])
def test_a_target_is_three_counters(target: tuple[int, ...]) -> None:
    with pytest.raises(LanguageError, match="give 3 whole numbers"):
        fresh().move(target, MoveSettings())


@pytest.mark.parametrize("name", ["imc-s8", "imc-m", "imc-mp", "c142"])
def test_the_controller_takes_the_ends_of_the_ranges_and_refuses_what_is_beyond(name: str) -> None:
    desk = Desk.of(name, carriage=(60_000, 48_000, 22_000, 50_000))
    ranges = fresh(name).ranges
    for command, setting in (
        ("@0j{}", "start_stop_hz"),
        ("@0J{}", "acceleration_hz_per_ms"),
        ("@0A1,{},0,900,0,900,0,30", "speed_hz"),
    ):
        assert desk.query("@07") == desk.query("@0N7") == "0"
        low, high = ranges[setting]
        assert [desk.query(command.format(value)) for value in (low, high)] == ["0", "0"]
        assert not {desk.query(command.format(value)) for value in (low - 1, high + 1)} & {"0"}


# --- every command and every code has words --------------------------------------------------------------------------


def parameters(command: commands.Command) -> Iterable[str]:
    """Parameters for a command as they may come from a host, smallest and largest values; X, Y and Z are set."""
    desk = Desk.of("imc-s8")
    desk.query("@07")
    assert isinstance(desk.controller, Imc)
    if command.parameters is None:
        return ["Rp"]
    numbers = command.parameters
    if callable(numbers):
        numbers = numbers(desk.controller._device)
    return [",".join(str(getattr(number, end)) for number in numbers) for end in ("low", "high")]


def dnc_line(code: str) -> str:
    return "@0" if code == commands.AXES_CODE else f"@0{code}"


@pytest.mark.parametrize(
    ("code", "command"), [*commands.DNC.items(), *commands.INITIALISATION.items()], ids=lambda value: str(value)[:4]
)
def test_every_command_is_explained_with_its_parameters(code: str, command: commands.Command) -> None:
    for text in parameters(command):
        language = fresh()
        told(language, b"@07\r", b"0")
        if code == commands.AXES_CODE:
            text = "7"
        (words,) = told(language, language.frame(dnc_line(code) + text))
        assert words.startswith(command.purpose)
        assert (len(words) > len(command.purpose)) == bool(text), words
        assert text.count(",") < 2 or not words.endswith(text), "not just as they came"
        (bare,) = told(fresh(), language.frame(f"@0{code}".replace(commands.AXES_CODE, "7")))
        assert bare.startswith(command.purpose)


@pytest.mark.parametrize(("alias", "code"), commands.DNC_ALIASES.items())
def test_an_alias_means_the_same(alias: str, code: str) -> None:
    assert told(fresh(), f"@0{alias}1,2\r".encode()) == told(fresh(), f"@0{code}1,2\r".encode())


@pytest.mark.parametrize(("code", "command"), [*commands.CNC.items()], ids=lambda value: str(value)[:4])
def test_every_stored_command_is_explained_with_its_parameters(code: str, command: commands.Command) -> None:
    spellings = [code, *(alias for alias, meant in commands.CNC_ALIASES.items() if meant == code)]
    for text in parameters(command):
        for spelling in spellings:
            *_, words = told(fresh(), b"@07\r", b"0", b"@0i\r", b"0", f"{spelling}{text}\r".encode())
            assert words.startswith(f"to store: {command.purpose}")
            assert (len(words) > len(f"to store: {command.purpose}")) == bool(text)
            assert text.count(",") < 2 or not words.endswith(text), "not just as they came"


@pytest.mark.parametrize("line", ["@0i", "@0S", "@0s", "@1R7", unknown.DNC[0], "hello", "@", "", " ", "x" * 300])
def test_whatever_else_a_line_is_has_words_too(line: str) -> None:
    (words,) = told(fresh(), line.encode() + b"\r")
    assert len(words) > 4


@pytest.mark.parametrize("byte", CONTROL)
def test_every_control_byte_is_a_message_of_its_own(byte: int) -> None:
    (message,) = fresh().messages(bytes([byte]), sent=True)
    assert (message.data, message.text, message.explanation) == (bytes([byte]), f"<{byte}>", CONTROL[byte])


@pytest.mark.parametrize("code", "0123456789DFGHR")
def test_every_reply_code_has_words_of_its_own(code: str) -> None:
    language = fresh()
    for _ in range(2):  # the answer to a command, and one that nobody has asked for
        (message,) = language.messages(code.encode(), sent=False)
        assert message == Message(code.encode(), code, f"reply: {CODES[code]}", sent=False)
        told(language, b"@0R7\r")
    assert len(set(CODES.values())) == len(CODES) == 15


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ("@07", "set the axes, initialise: X Y Z"),
        ("@0M16000,10000,8000,900,0,30,5,30", "absolute move to X 16000 at 10000 Hz, Y 8000 at 900 Hz, Z 0 at 30 Hz"),
        ("@0A 1,900,-2,900,3,900,-4,30",
         "relative move by X 1 at 900 Hz, Y -2 at 900 Hz, Z 3 at 900 Hz, then Z -4 at 30 Hz"),
        ("@0A1,900", "relative move: 1,900"),
        ("@0d5000,400,30", "reference speeds: X 5000 Hz, Y 400 Hz, Z 30 Hz"),
        ("@0R4", "reference run: Z"),
        ("@0z1", "3D interpolation: on"),
        ("@0f-1", "direction of arcs: counter-clockwise"),
        ("@0J100", "acceleration: 100 Hz/ms"),
        ("@0j", "start-stop frequency"),
        ("@0Jfast", "acceleration: fast"),
        ("@0y2400,400,-200,0,-400,-1,1", "arc of 2400 steps at 400 Hz, D -200, start 0 -400, directions -1 1"),
        ("@0Z0,1,1,900,10,20,30",
         "move until port event, port 0 with mask 1 at 1, at 900 Hz: X 10, Y 20, Z 30"),
        ("@0IUmine", "set the user information: mine"),
        ("@0ID5", "inverted axes: X Z"),
    ],
)  # fmt: skip
def test_words_of_commands(line: str, words: str) -> None:
    assert told(fresh(), b"@07\r", b"0", line.encode() + b"\r")[-1] == words


# --- answers belong to their commands --------------------------------------------------------------------------------

QUESTIONS = (
    ("@07", "reply: done"),
    ("@0P", "position X 0 Y 0 Z 0"),
    ("@0N7", "reply: done"),
    ("@0A-16,900,300,900,-1,900,0,30", "reply: done"),
    ("@0P", "position X -16 Y 300 Z -1"),
    ("@0b1", "port 1: 23 (bits 00010111)"),
    ("@0b9", "reply: not a number, or out of range"),
    ("@0DS0", "diagnosis S0: 7 (bits 00000111)"),
    ("@0DXX", "reply: no such command"),
    ("@0V", "version: isel iMC-S8, isel-twin 0.2.0"),
    ("@0?", "version: isel iMC-S8, isel-twin 0.2.0"),
    ("@0IUbench 3", "reply: done"),
    ("@0U", "answer: UserInfo: bench 3"),
    ("@0H", "state: e-stop 11 cool 1 power 1, start 0 stop 1 probe 0, hood 11 key 0 spindle 0, operating"),
    ("@0h", "limit switches, 1 struck: X1 0 X2 0, Y1 0 Y2 0, Z1 0 Z2 0, A1 0 A2 0"),
    ("@0h5", "reply: wrong number of parameters"),
    (unknown.DNC[0], "reply: no such command"),
    ("x" * 300, "reply: no such command"),
    ("@08", "reply: done"),
    ("@0P", "position X -16 Y 300 Z -1 A 0"),
    ("@07", "reply: done"),
    ("@0P", "position X -16 Y 300 Z -1"),
    ("@0k", "reply: done"),
    ("@0i", "reply: done"),
    ("j300", "reply: done"),
    ("@0P", "reply: cannot be stored"),
    ("@0i", "reply: nothing to start, or program memory not empty"),
    ("@0P", "position X -16 Y 300 Z -1"),
    ("@0k", "reply: done"),
    ("@0i", "reply: done"),
    ("1 65", "reply: done"),
    ("9", "reply: done"),
    ("@0P", "position X -16 Y 300 Z -1"),
    ("@0G3", "reply: done"),
    ("@3P", "position X -16 Y 300 Z -1"),
)
"""Commands, and what comes for each of them."""


def desk() -> Desk:
    return Desk.of("imc-s8", carriage=(60_000, 48_000, 22_000, 50_000), position_switches=[])


def test_each_answer_is_explained_by_its_command() -> None:
    at, language = desk(), fresh()
    for line, words in QUESTIONS:
        told(language, language.frame(line))
        reply = at.query(line).encode("latin-1")
        (message,) = language.messages(reply, sent=False)
        assert (message.data, message.explanation) == (reply, words), line
        assert language.rest(sent=False) == b""


@pytest.mark.parametrize("seed", range(5))
def test_answers_are_told_apart_however_they_come(seed: int) -> None:
    """All commands at once, one to another device among them; the answers in pieces."""
    at, language = desk(), fresh()
    data = b"".join(language.frame(line) for line, _ in QUESTIONS).replace(b"@0DXX", b"@5P\r@0DXX")
    told(language, data)
    at.send(data)
    reply = at.finish().encode("latin-1")
    explained: list[str] = []
    chance = random.Random(seed)
    while reply:
        size = chance.randint(1, 30)
        explained += [message.explanation for message in language.messages(reply[:size], sent=False)]
        reply = reply[size:]
    assert explained == [words for _, words in QUESTIONS]


def test_a_control_byte_cuts_a_line_that_goes_on() -> None:
    language = fresh()
    sent = list(language.messages(b"@0J1\xfd00\r@0J7\xfe@0J8\r", sent=True))
    assert [(message.data, message.explanation) for message in sent] == [
        (b"@0J1", "beginning of a line"),
        (b"\xfd", CONTROL[253]),
        (b"00\r", "acceleration: 100 Hz/ms"),
        (b"@0J7", "beginning of a line"),
        (b"\xfe", CONTROL[254]),
        (b"@0J8\r", "acceleration: 8 Hz/ms"),
    ]


def test_a_reset_is_not_asked_again_what_was_asked_before() -> None:
    language = fresh()
    told(language, b"@0P\r\xfe" + unknown.DNC[0].encode() + b"\r")
    assert told(language, b"", b"5") == ["reply: no such command"]


def test_a_line_feed_counts_for_nothing() -> None:
    sent = list(fresh().messages(b"@07\r\n@0\nP\r\n\r", sent=True))
    assert [(message.text, message.explanation) for message in sent] == [
        ("@07", "set the axes, initialise: X Y Z"),
        ("@0<10>P", "position"),
        ("<10><13>", "an empty line, no command"),
    ]


def test_a_stored_program_speaks() -> None:
    language = fresh()
    assert told(language, b"@0S\r", b"A0") == [
        "go on, or start the stored program", "a character sent by a stored program", "reply: done"
    ]  # fmt: skip


def test_memory_is_bounded_whatever_comes() -> None:
    language = fresh()
    told(language, b"@0V\r", b"0")
    for sent in (True, False):
        for _ in range(10):
            assert b"".join(message.data for message in language.messages(b"x" * LONGEST, sent)).count(b"x")
        assert len(language.rest(sent)) < LONGEST
    assert told(language, b"\r") == ["a line that is too long"]


WORDS = [b"@07\r", b"@0P\r", b"@08\r", b"@0H\r", b"@0V\r", b"@0U\r", b"@0b1\r", b"@0i\r", b"9\r", b"@0G1\r", b"@1P\r"]
WORDS += [b"0", b"0003E8", b"e-stop 11\r\n", b"\r\n", b"\xfd", b"\xfe", b"\xff", b"\n", b"\r", b"-9" * 40, b"m1,2,3,"]


@given(st.lists(st.tuples(st.booleans(), st.one_of(st.binary(max_size=40), st.sampled_from(WORDS)))))
def test_any_bytes_in_any_pieces_become_messages_that_hold_all_of_them(traffic: list[tuple[bool, bytes]]) -> None:
    language = fresh()
    messages = [message for sent, data in traffic for message in language.messages(data, sent)]
    assert all(message.explanation and message.text for message in messages)
    for direction in (True, False):
        whole = b"".join(data for sent, data in traffic if sent == direction)
        parts = [message.data for message in messages if message.sent == direction]
        assert b"".join(parts) + language.rest(direction) == whole


@given(st.lists(st.sampled_from(WORDS)).map(b"".join), st.lists(st.sampled_from(WORDS)).map(b"".join), st.data())
def test_pieces_make_no_difference(sent: bytes, received: bytes, data: st.DataObject) -> None:
    whole, pieces = fresh(), fresh()
    for direction, stream in ((True, sent), (False, received)):
        expected = list(whole.messages(stream, direction))
        cuts = sorted(data.draw(st.lists(st.integers(0, len(stream)), max_size=6)))
        parts = zip([0, *cuts], [*cuts, len(stream)], strict=True)
        assert [m for begin, end in parts for m in pieces.messages(stream[begin:end], direction)] == expected


def test_the_controller_is_not_needed_to_talk_about_it() -> None:
    assert create_controller("imc-s8").serial_format.baud == 19_200
    assert told(fresh("c142"), b"@0m1,2,3,4,5,6,7,8\r") == ["absolute move to X 1 at 2 Hz, Y 3 at 4 Hz, Z 5 at 6 Hz"]
