"""docs/safety.md is true: every row of its table, tried out."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

import pytest

from isel_twin.testing import Desk

TABLE = Path(__file__).parents[3] / "docs" / "safety.md"
MIDDLE = (60_000, 48_000, 22_000, 50_000)
ONE_STEP = "@0A1,900,0,900,0,900,0,900"
LONG_MOVE = "@0A20000,5000,300,900,0,900,0,900"
LONG_TOTAL = (20_000, 300, 0, 0)
PROGRAM = ("020000,5000,300,900,0,900,0,900",)
WATCHES = ("@0IA0,1,0", "@0IH0,2,0", "@0IN0,4,0")


@dataclass(frozen=True)
class Row:
    """One row of the table; quoted cells are lists of what is quoted."""

    event: str
    situation: str
    motion: str
    stages: str
    spindle: str
    reply: str
    next_move: str
    to_go_on: tuple[str, ...]


def rows() -> list[Row]:
    found = []
    for text in TABLE.read_text("utf-8").splitlines():
        cells = [cell.strip() for cell in text.split("|")[1:-1]]
        if len(cells) == 8 and cells[0].startswith("`"):
            first, *middle, last = cells
            found.append(
                Row(first.strip("`"), *(cell.strip("`") for cell in middle), tuple(re.findall("`(.*?)`", last)))
            )
    return found


def situation(name: str) -> Desk:
    """A desk in a situation of the table; long moves are under way for 0.5 s."""
    desk = Desk.of("imc-s8", carriage=MIDDLE)
    commands = {
        "locked": ["@0B1,0"],
        "spindle": ["@0B2,1"],
        "program": ["@0k", "@0i", *PROGRAM, "9"],
        "watching": [*WATCHES, "@0k", "@0i", *PROGRAM, "9"],
    }
    for command in ["@07", "@0N7", *commands.get(name, [])]:
        assert desk.query(command) == "0", command
    if name == "setup":
        desk.set("key", "setup")
        desk.set("hood", "open")
    begin = {"reference": "@0R7", "program": "@0S", "watching": "@0S", "rest": None, "spindle": None}
    command = begin.get(name, LONG_MOVE)
    if command is not None:
        desk.start(command)
        desk.run(0.5)
    return desk


def operate(desk: Desk, action: str) -> None:
    name, state = action.split(" ")
    desk.set(name, state)


def test_the_table_is_there() -> None:
    assert len(rows()) >= 30
    assert {row.situation for row in rows()} >= {"rest", "moving", "locked", "spindle", "reference", "program"}


@pytest.mark.parametrize("row", rows(), ids=lambda row: f"{row.event}-{row.situation}".replace(" ", "-"))
def test_row(row: Row) -> None:
    desk = situation(row.situation)
    before = desk.ticks
    operate(desk, row.event)
    at_once = desk.ticks
    assert at_once == before
    assert desk.finish() == row.reply.replace("none", "")
    made = desk.steps_since(before)
    slack = 5 if row.situation == "watching" else 0  # watched ports are looked at once in a millisecond, at 5000 Hz
    match row.motion:
        case "none" | "ends at once":
            assert len(made) <= slack
        case "stop ramp":  # from 5000 Hz to 300 Hz at 100 Hz/ms: (5000^2 - 300^2) / (2 * 10^5) = 124.55 steps
            assert 124 <= len(made) - slack <= 126
        case "completes":
            assert desk.counts == LONG_TOTAL
        case other:
            pytest.fail(f"unknown word in the table: {other}")
    assert desk.outputs["stages"] == (row.stages == "on")
    assert desk.outputs["brake"] == (row.stages == "on")
    assert desk.outputs["spindle"] == (row.spindle == "on")
    assert desk.query("@0P")[0] == "0"
    assert desk.query(ONE_STEP) == row.next_move
    for step in row.to_go_on:
        assert desk.query(ONE_STEP) != "0", f"moves before {step}"
        if step.startswith("@"):
            assert desk.query(step) == "0", step
        else:
            operate(desk, step)
    assert desk.query(ONE_STEP) == "0"
    assert desk.steps_without_stages == 0


@pytest.mark.parametrize(
    "row", [row for row in rows() if row.stages == "off"], ids=lambda row: row.event.replace(" ", "-")
)
def test_spindle_needs_the_same_as_motions(row: Row) -> None:
    desk = situation(row.situation)
    operate(desk, row.event)
    desk.finish()
    for step in row.to_go_on:
        assert desk.query("@0B2,1") in "9H", f"spindle before {step}"
        if step == "@07":
            assert desk.query("@07") == "0"
            break
        operate(desk, step)
    assert desk.query("@0B2,1") == "0"


# --- power on ------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("action", "reply"),
    [("estop pressed", "9"), ("overtemperature hot", "9"), ("power off", "9"), ("hood open", "9"), ("key setup", "0")],
)
def test_relay_closes_only_when_all_conditions_hold(action: str, reply: str) -> None:
    """The relay has dropped by a passing E-stop; `@07` closes it again, or says 9."""
    desk = situation("rest")
    desk.set("estop", "pressed")
    desk.set("estop", "released")
    operate(desk, action)
    assert desk.query("@07") == reply
    assert desk.outputs["stages"] == (reply == "0")
    assert desk.outputs["power_request"] == 0


def test_relay_is_given_a_millisecond() -> None:
    desk = situation("rest")
    desk.set("estop", "pressed")
    desk.set("estop", "released")
    desk.run(1.0)
    asked_ns = desk.time_ns
    assert desk.query("@07") == "0"
    assert desk.replies[-1] == (asked_ns + 1_000_000, b"0")
    pulses = [(t, value) for t, name, value in desk.output_log if name == "power_request" and t >= asked_ns]
    assert pulses == [(asked_ns, 1), (asked_ns + 1_000_000, 0)]


def test_power_at_switch_on() -> None:
    desk = Desk.of("imc-s8", power=False)
    desk.cabinet.operate("estop", "pressed")
    desk.power_on()
    assert desk.outputs["stages"] == 0
    assert desk.query("@07") == "9"
    assert desk.query("@0B2,1") == "9"
    desk.set("estop", "released")
    assert desk.query("@07") == "0"
    assert desk.outputs["stages"] == 1


def test_hood_wires_fail_safe() -> None:
    """One of the two hood contacts alone keeps motions from starting."""
    for terminal in ("p2.5", "p2.6"):
        desk = situation("rest")
        desk.set(terminal, False)
        assert desk.query(ONE_STEP) == "H"
        assert desk.query("@0B2,1") == "H"


def test_firmware_cuts_by_itself_when_the_relay_sticks() -> None:
    desk = situation("moving")
    desk.set("p2.1", True)
    opened_ns = desk.time_ns
    desk.set("p2.5", False)
    desk.set("p2.6", False)
    assert desk.finish() == "9"
    assert desk.replies[-1][0] == opened_ns + 1_000_000
    assert desk.outputs["stages"] == 0


def test_lamps() -> None:
    desk = situation("moving")
    assert [desk.outputs[f"lamp_{name}"] for name in ("start", "stop", "fault")] == [1, 0, 0]
    desk.set("stop", "down")
    assert desk.finish() == "F"
    assert [desk.outputs[f"lamp_{name}"] for name in ("start", "stop", "fault")] == [0, 1, 0]
    desk.set("estop", "pressed")
    assert [desk.outputs[f"lamp_{name}"] for name in ("start", "stop", "fault")] == [0, 0, 1]


# --- stages and brake ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("off", "on"), [("@0B3,0", "@0B3,1"), ("@0B100,129", "@0B3,1"), ("@0B100,193", "@0B3,1")])
def test_the_brake_drops_with_the_stages(off: str, on: str) -> None:
    """Whatever the same byte of port 100 says of the brake: Z must not hang on nothing."""
    desk = situation("rest")
    before = len(desk.output_log)
    assert desk.query(off) == "0"
    assert [(name, value) for _, name, value in desk.output_log[before:] if name in ("stages", "brake")] == [
        ("brake", 0),
        ("stages", 0),
    ]
    before = len(desk.output_log)
    assert desk.query(on) == "0"
    assert [(name, value) for _, name, value in desk.output_log[before:] if name in ("stages", "brake")] == [
        ("stages", 1),
        ("brake", 1),
    ]
    assert desk.query(ONE_STEP) == "0"


def test_the_brake_can_be_released_by_hand_without_stages() -> None:
    desk = situation("rest")
    for command in ("@0B3,0", "@0g1"):
        assert desk.query(command) == "0"
    assert (desk.outputs["stages"], desk.outputs["brake"]) == (0, 1)


def test_stages_on_that_are_on_leave_the_brake_as_it_is() -> None:
    desk = situation("rest")
    for command in ("@0g0", "@0B3,1"):
        assert desk.query(command) == "0"
    assert (desk.outputs["stages"], desk.outputs["brake"]) == (1, 0)


# --- what forgets the rest --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    ["@0A0,900,0,900,0,900,0,900", "@0M{0},900,{1},900,0,900,0,900", "@0y0,900,0,0,0,1,1", "@0Z0,1,1,900,0,0,0"],
)
def test_a_move_of_no_length_leaves_the_rest(command: str) -> None:
    desk = situation("moving")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    stands = desk.counts
    assert desk.query(command.format(*stands)) == "0"
    assert desk.counts == stands
    assert desk.query("@0S") == "0"
    assert desk.counts == LONG_TOTAL


@pytest.mark.parametrize("command", [ONE_STEP, "@0Z0,0,0,900,5,0,0", "@0R7", "@0F1", "@0k", "@07"])
def test_what_forgets_the_rest(command: str) -> None:
    desk = situation("moving")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.query(command) == "0"
    assert desk.query("@0S") == "G"
