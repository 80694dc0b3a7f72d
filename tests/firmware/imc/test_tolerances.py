"""What members of the family take that the manual refuses: settings of every profile."""

from __future__ import annotations

from pathlib import Path

import pytest

from isel_twin.controller import create_controller
from isel_twin.core.twin import Twin
from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)
TOLERANT = {"extra_values": True, "relative_unreferenced": True}


def desk_of(controller: str, *commands: str, settings: dict[str, bool] | None = None) -> Desk:
    desk = Desk.of(controller, carriage=MIDDLE, settings=settings)
    for command in commands:
        assert desk.query(command) == "0", command
    return desk


@pytest.mark.parametrize(("controller", "settings"), [("c142", None), ("imc-s8", TOLERANT)])
@pytest.mark.parametrize("fourth", ["2000", "0", "99999"])
def test_a_speed_for_an_axis_that_is_not_set_is_not_looked_at(
    controller: str, settings: dict[str, bool] | None, fourth: str
) -> None:
    desk = desk_of(controller, "@07", f"@0d500,600,700,{fourth}", settings=settings)
    desk.start("@0R4")
    desk.run(5.0)
    gaps_ns = desk.steps.t_ns[1:] - desk.steps.t_ns[:-1]
    assert abs(int(gaps_ns.min()) - 1_000_000_000 / 700) <= 1


@pytest.mark.parametrize("text", ["@0d500,600", "@0d500,600,700,800,900", "@0d500,600,x,800"])
def test_neither_too_few_nor_five_nor_no_numbers(text: str) -> None:
    assert desk_of("c142", "@07").query(text) in ("7", "1")


def test_default_reference_speeds_with_a_fourth_of_0() -> None:
    desk = desk_of("imc-s8", "@07", settings=TOLERANT)
    assert desk.query("@0Id500,600,700,0") == "0"
    assert desk.query("@0Id500,600,0,700") == "D"
    assert desk.query("@08") == "0"
    desk.start("@0R8")  # the fourth has its default still, 2000 Hz
    desk.run(1.0)
    gaps_ns = desk.steps.t_ns[1:] - desk.steps.t_ns[:-1]
    assert abs(int(gaps_ns.min()) - 500_000) <= 1


@pytest.mark.parametrize(("controller", "settings"), [("c142", None), ("imc-s8", TOLERANT)])
@pytest.mark.parametrize("letter", ["A", "a"])
def test_a_relative_move_before_a_reference_run(controller: str, settings: dict[str, bool] | None, letter: str) -> None:
    desk = desk_of(controller, "@07", settings=settings)
    assert desk.query(f"@0{letter}300,900,0,900,0,900,0,900") == "0"
    assert desk.counts[0] == 300
    assert desk.query("@0M0,900,0,900,0,900,0,900") == "R"


def test_also_in_a_stored_program() -> None:
    desk = desk_of("c142", "@07", "@0k", "@0i", "0300,900,0,900,0,900,0,900", "9", "@0S")
    assert desk.counts[0] == 300


def test_a_limit_switch_still_forbids_it() -> None:
    desk = desk_of("c142", "@07")
    assert desk.query("@0A-100000,9000,0,900,0,900,0,900") == "2"
    assert desk.query("@0A10,9000,0,900,0,900,0,900") == "2"


@pytest.mark.parametrize("move", ["@0a9000,900,0,900,0,900,0,900", "@0m9000,900,0,900,0,900,0,900", "@0r1"])
@pytest.mark.parametrize("byte", [b"\xfd", b"\xff"])
def test_what_was_acknowledged_at_once_says_f_when_it_is_stopped(move: str, byte: bytes) -> None:
    desk = desk_of("c142", "@07", "@0N7")
    desk.start(move)
    desk.run(0.3)
    assert desk.read() == "0"
    desk.send(byte)
    assert desk.finish() == "F"


def test_a_program_of_the_start_key_says_f_when_it_is_broken_off() -> None:
    desk = desk_of("imc-s8", "@07", "@0N7", "@0k", "@0i", "09000,900,0,900,0,900,0,900", "9")
    desk.press("start")
    desk.send(b"\xff")
    assert desk.finish() == "F"


@pytest.mark.parametrize("controller", ["imc-s8", "imc-m", "imc-mp"])
def test_the_manuals_controllers_are_strict(controller: str) -> None:
    desk = desk_of(controller, "@07")
    assert desk.query("@0d500,600,700,800") == "7"
    assert desk.query("@0Id500,600,700,0") == "D"
    assert desk.query("@0A300,900,0,900,0,900,0,900") == "R"
    assert desk.ticks == 0


@pytest.mark.parametrize("key", list(TOLERANT))
@pytest.mark.parametrize("value", [1, "yes", None])
def test_they_are_true_or_false(key: str, value: object) -> None:
    with pytest.raises(ValueError, match=key):
        create_controller("imc-s8", settings={key: value})


def test_a_machine_file_can_say_so(tmp_path: Path) -> None:
    """docs/hosts.md: a few lines in a machine file of one's own."""
    lines = ('based_on = "4030"', "[controller]", *(f"{key} = true" for key in TOLERANT))
    (tmp_path / "machine.toml").write_text("\n".join(lines))
    twin = Twin(machine=tmp_path, controller="imc-s8", plant="kinematic", seed=1)
    assert twin.query("@07") == "0"
    assert twin.query("@0d500,600,700,800") == "0"
    assert twin.query("@0A300,900,0,900,0,900,0,900") == "0"


@pytest.mark.parametrize("key", list(TOLERANT))
def test_the_c142_can_be_made_strict(key: str) -> None:
    desk = desk_of("c142", "@07", settings={key: False})
    reply = desk.query("@0d500,600,700,800" if key == "extra_values" else "@0A300,900,0,900,0,900,0,900")
    assert reply == ("7" if key == "extra_values" else "R")
