"""Members of the family and what the field says of the older ones; commands as data."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.controller import create_controller, offers
from isel_twin.firmware.imc.commands import CNC, DNC, INITIALISATION
from isel_twin.language import TellsActs, create_language, needed
from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)
OVERVIEW = Path(__file__).parents[3] / "docs" / "imc.md"


def ready(name: str) -> Desk:
    desk = Desk.of(name, carriage=MIDDLE)
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    return desk


@pytest.mark.parametrize("name", ["imc-s8", "imc-m", "imc-mp", "c142", "it116"])
def test_each_says_its_name(name: str) -> None:
    text = ready(name).query("@0V")
    assert "isel" in text
    assert name.split("-")[-1].upper() in text.upper()


@pytest.mark.parametrize(
    ("name", "speed", "reply"),
    [("imc-m", 40_000, "0"), ("c142", 10_000, "0"), ("c142", 10_001, "D"), ("it116", 10_001, "D")],
)
def test_speed_limits(name: str, speed: int, reply: str) -> None:
    assert ready(name).query(f"@0A100,{speed},0,900,0,900,0,900") == reply


def test_small_letters_of_the_c142_answer_at_once_and_run_on() -> None:
    desk = ready("c142")
    sent_ns = desk.time_ns
    desk.start("@0a900,900,0,900,0,900,0,900")
    assert desk.read() == "0"
    assert not desk.controller.idle
    assert desk.query("@0P") == "0" + "000384" + "0" * 12
    assert desk.replies[-1][0] - sent_ns > 900_000_000
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"
    assert desk.replies[-1][0] >= desk.steps.t_ns[-1]


def test_small_letters_of_the_c142_refuse_at_once() -> None:
    desk = Desk.of("c142", carriage=MIDDLE)
    assert desk.query("@07") == "0"
    assert desk.query("@0m900,900,0,900,0,900,0,900") == "R"


def test_silent_motion_that_strikes_a_switch_shows_at_the_next() -> None:
    desk = ready("c142")
    assert desk.query("@0a100000,9000,0,900,0,900,0,900") == "0"
    assert desk.query("@0a1,900,0,900,0,900,0,900") == "2"


def test_spindle_port_of_the_c142() -> None:
    desk = ready("c142")
    assert desk.query("@0B65529,1") == "0"
    assert desk.outputs["spindle"] == 1
    assert desk.query("@0B65529,0") == "0"
    assert desk.outputs["spindle"] == 0
    assert desk.query("@0B65529,2") == "1"
    assert ready("imc-s8").query("@0B65529,1") == "1"


def test_the_c142_does_not_know_default_reference_speeds() -> None:
    assert ready("c142").query("@0Id900,900,900,900") == "5"
    assert ready("c142").query("@0d900,900,900") == "0"
    assert ready("imc-s8").query("@0Id900,900,900,900") == "0"


def one_axis(**settings: object) -> Desk:
    desk = Desk.of("it116", carriage=MIDDLE, settings=settings)
    assert desk.query("@01") == "0"
    assert desk.query("@0N1") == "0"
    return desk


def test_a_session_of_a_one_axis_host() -> None:
    """What two hosts of an IT116 do: X alone, small letters, seven bytes after `@0P`, 253 in the middle of a move."""
    desk = one_axis()
    assert desk.query("@0a900,900") == "0"
    assert desk.query("@0P") == "0000384"
    assert desk.query("@0A-1000,900") == "0"
    assert desk.query("@0P") == "0FFFF9C"
    desk.start("@0A5000,900")
    desk.run(1.0)
    desk.send(bytes([253]))
    assert desk.finish() == "F"
    reply = desk.query("@0P")
    assert (len(reply), 0 < int(reply[1:], 16) < 4900) == (7, True)
    assert desk.query("@0S") == "0"
    assert desk.query("@0P") == "0001324"


@pytest.mark.parametrize(
    ("axes", "answer"), [("@03", "0" + "0" * 12), ("@07", "0" + "0" * 18), ("@08", "0" + "0" * 6), ("", "0" + "0" * 6)]
)
def test_six_digits_for_each_axis_that_is_set(axes: str, answer: str) -> None:
    desk = Desk.of("it116", carriage=MIDDLE)
    if axes:
        assert desk.query(axes) == "0"
    assert desk.query("@0P") == answer


def test_the_digits_are_a_setting_of_any_member() -> None:
    desk = Desk.of("imc-s8", carriage=MIDDLE, settings={"set_axes_only": True})
    assert desk.query("@01") == "0"
    assert desk.query("@0P") == "0000000"
    assert one_axis(set_axes_only=False).query("@0P") == "0" + "0" * 18


def test_its_language_reads_the_short_answer() -> None:
    """The next answer is not taken for digits of the position, however the bytes come."""
    language = needed(create_language("it116"), "it116")
    for text in ("@01", "@0P", "@0P", "@0A1,900"):
        list(language.messages(language.frame(text), sent=True))
    told = [one for byte in b"0000038400003840" for one in language.messages(bytes([byte]), sent=False)]
    assert [one.text for one in told] == ["0", "0000384", "0000384", "0"]
    assert told[1].explanation == "position X 900"
    assert offers(language, TellsActs)
    assert language.counters(b"@0P\r", b"0FFFF9C") == ({0: -100}, b"0")


@pytest.mark.parametrize("value", [0, -1, "many", 1.5, True])
def test_wrong_setting(value: object) -> None:
    with pytest.raises(ValueError, match="program_memory_bytes"):
        create_controller("imc-s8", settings={"program_memory_bytes": value})


def test_settings_of_others_are_none_of_ours() -> None:
    assert create_controller("imc-s8", settings={"frequency_error_ppm": -5}).idle


@pytest.mark.parametrize("table", [DNC, INITIALISATION, CNC], ids=["DNC", "INITIALISATION", "CNC"])
def test_overview_lists_every_command(table: dict) -> None:  # type: ignore[type-arg]
    lines = OVERVIEW.read_text("utf-8").splitlines()
    for code, command in table.items():
        found = [line for line in lines if f"| {command.section} |" in line and command.purpose in line]
        assert found, f"docs/imc.md has no row for {code}: {command.purpose} ({command.section})"
