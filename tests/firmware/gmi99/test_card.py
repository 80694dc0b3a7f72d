"""The card beyond its manual's rows: what is refused, what is held and goes on, drives through the card, programs."""

from __future__ import annotations

import math

import pytest
from conformance.gmi99_desk import (
    G91,
    OK,
    READY,
    STATUS,
    TO_10000,
    TO_20000,
    Q,
    command,
    fresh,
    long,
    prepared,
    short,
)

from isel_twin.controller import create_controller

FIVE_SETTINGS = [
    ("dil_switches", "1111111"),
    ("dil_switches", "1111111x"),
    ("host_parity", "odd"),
    ("override_pot_percent", 126),
    ("override_pot_percent", True),
    ("drive_increments_per_rev", 3),
    ("safety_program", 1),
]


@pytest.mark.parametrize(("key", "value"), FIVE_SETTINGS)
def test_wrong_settings_are_refused(key: str, value: object) -> None:
    with pytest.raises(ValueError, match=f"gmi99: {key}"):
        create_controller("gmi99", settings={key: value})


@pytest.mark.parametrize(
    "frame",
    [
        command("f", 0),
        command("N", 1, 15),
        command("H", 3),
        command("H", 12, 0),
        command("G", 1),
        command("G", 1 << 8 | 90),
        command("G", 54 | 16 << 8, 5, 1),
        command("G", 55 | 1 << 8, 5, 1),
        command("G", 54, 5, 7),
        command("G", 54 | 0x70 << 16),
        command("G", 53, 5, 1),
        command("p", 2),
        command("p", 11, 256, 0),
        command("p", 11, 4, 256),
        command("p", 1, 3),
        command("p", 3, 1, 32),
        command("p", 3, 100, 32),
        command("p", 3, 5),
        command("p", 10, 1),
        command("p", 10, 2, 96),
        command("p", 10, 16, 96),
        command("p", 10, 26, 1),
        command("p", 4, 1, 1),
        command(0x88, 5),
        command(0x81, -8_388_353),
        short(9, 126),
    ],
)
def test_what_cannot_be_done_is_acknowledged_and_shown(frame: str) -> None:
    desk = prepared()
    assert desk.tell(frame, STATUS) == [OK, READY]
    assert desk.controller.fault
    assert desk.remarks
    assert desk.counts == (0,) * 6


@pytest.mark.parametrize(
    "frame",
    [command("T", n, *more) for n, more in ((0, (6,)), (1, (4,)), (1, (1, 48)), (2, ()), (3, (1,)), (5, (15,)))]
    + [command("T", 8, 60, 0), command("T", 8, 54, 6), command("T", 12, 0), command("T", 12, -1)],
)
def test_a_question_that_does_not_exist_has_no_answer(frame: str) -> None:
    assert fresh().ask(frame) == ""


@pytest.mark.parametrize(
    ("frame", "answer"),
    [
        (command("T", 11), b"C\0\0\0"),
        (command("T", 1, 12), b"I\0\0"),
        (command("T", 3, 5), b"\0"),
        (command("T", 5, 18), b"N\xff\xff\xff"),
        (command("T", 8, 53, 0), b"Z\0\0\0"),
        (command("T", 8, 57, 0), b"Z\0\0\0"),
    ],
)
def test_questions_that_have_little_to_tell(frame: str, answer: bytes) -> None:
    assert fresh().ask(frame) == long(answer)


# ---- holds -----------------------------------------------------------------------------------------------------------


def test_moves_that_come_while_it_stands_join() -> None:
    """Held in front of the first move; two come. At 10000 Hz and 50 Hz/ms they are one move of 20000: 2.2 s."""
    desk = prepared(command("p", 11, 0, 1))
    assert desk.tell(TO_10000, TO_20000) == [OK, OK]
    desk.run(0.1)
    assert desk.counts[0] == 0
    assert desk.status() == 0x80
    desk.ask(command("p", 11, 0, 0))
    start_ns = desk.time_ns
    desk.finish()
    assert desk.time_ns - start_ns == 2_200_000_000
    assert desk.counts[0] == 20_000


def test_a_move_that_comes_in_a_hold_on_the_way_is_made_too() -> None:
    desk = prepared()
    desk.ask(TO_10000)
    desk.run(0.5)
    desk.ask(command("p", 11, 0, 1))
    desk.run(1.0)
    desk.tell(TO_20000, command("p", 10, 16, 6))
    desk.run(1.0)
    assert 4000 < desk.counts[0] < 6000
    assert desk.outputs.get("a0.6", 0) == 0
    desk.ask(command("p", 11, 0, 0))
    desk.finish()
    assert desk.counts[0] == 20_000
    assert desk.outputs["a0.6"] == 1


def test_an_abort_of_what_is_held_forgets_it() -> None:
    desk = prepared()
    desk.ask(TO_10000)
    desk.run(0.5)
    desk.ask(command("p", 11, 0, 1))
    desk.run(1.0)
    stands = desk.counts[0]
    desk.ask(short(0))
    assert desk.ask(STATUS) == READY
    desk.ask(command("p", 11, 0, 0))
    desk.run(1.0)
    assert desk.counts[0] == stands
    desk.tell(G91, command(0x81, 100))
    desk.finish()
    assert desk.counts[0] == stands + 100


@pytest.mark.parametrize("override", [0, 1, 7, 50, 125])
def test_it_ends_where_it_was_told_whatever_the_override(override: int) -> None:
    desk = prepared(command("N", 2000, 11), command("N", 1500, 16))
    for angle in range(0, 360, 15):
        x, y = (round(5000 * f(math.radians(angle))) for f in (math.cos, math.sin))
        desk.ask(command(0x83, x, y))
    for percent in (100, override, 80, override, 30):
        desk.run(0.0173)
        desk.ask(short(9, percent))
    desk.finish()
    x, y = (round(5000 * f(math.radians(345))) for f in (math.cos, math.sin))
    assert desk.counts[:2] == (x, y)


def test_outputs_behind_moves_that_go_nowhere_are_switched_too() -> None:
    desk = prepared(command(0x81, 0), command("p", 10, 16, 5))
    assert desk.outputs["a0.5"] == 1


# ---- buffer and programs ---------------------------------------------------------------------------------------------


def test_other_commands_have_a_buffer_of_their_own() -> None:
    desk = prepared(command("f", 100), TO_20000)
    assert desk.tell(*[command("B", 77)] * 101) == [OK] * 100 + ["10 E0 08 E8 16"]
    assert desk.ask(TO_10000) == OK


def test_a_program_that_is_too_long_is_lost() -> None:
    desk = prepared(command("p", 3, 100, 0))
    size = 1 + 3 * 6 + 1
    for _ in range(65_536 // size):
        assert desk.ask(command(0xBF, 1, 2, 3, 4, 5, 6)) == OK
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")
    desk.ask(command(0xBF, 1, 2, 3, 4, 5, 6))
    assert desk.ask(command("T", 3, 4)) == long(b"\x12")
    desk.tell(command("p", 3, 101), command("p", 3, 1, 0))
    assert desk.counts[0] == 0


@pytest.mark.parametrize("frame", [command("r"), command("s", 85, 170), command("p", 1, 1), command("p", 3, 100, 3)])
def test_what_may_not_be_recorded_is_not(frame: str) -> None:
    desk = prepared(command("p", 3, 100, 0), frame)
    assert desk.ask(command("T", 3, 4)) == long(b"\x12")


def test_an_abort_ends_a_recording() -> None:
    desk = prepared(command("p", 3, 100, 0), TO_10000, short(0))
    desk.tell(command("p", 11, 13, 9))
    assert desk.ask(command("T", 1, 3, 13)) == long(b"I\x09\0")
    desk.ask(command("p", 3, 1, 0))
    assert desk.controller.fault


def test_a_long_program_is_planned_as_it_goes() -> None:
    """250 moves of 10 increments in one direction: one motion at 10 / 12 ms; never more than 100 are planned ahead."""
    desk = prepared(command("p", 3, 100, 0), G91, *[command(0x81, 10)] * 250, command("p", 3, 101))
    start_ns = desk.time_ns
    desk.ask(command("p", 3, 1, 0))
    assert desk.ask(TO_10000) == OK
    desk.finish()
    assert desk.counts[0] == 2500 + 10_000
    speed = 10 / 0.012
    assert desk.time_ns - start_ns == pytest.approx((2500 / speed + speed / 50_000) * 1e9 + 1.2e9, abs=2 * 4e6)


# ---- drives through the card -----------------------------------------------------------------------------------------


def test_a_drive_takes_its_place_for_zero_or_runs_to_its_reference() -> None:
    desk = fresh()
    assert desk.tell(command("Q", 3, address=2), short(1, address=2)) == [OK, short(0, address=2)]
    assert desk.ask(STATUS) == "10 E0 40 20 16", "that is not the card's Q"
    assert desk.tell(command("Q", 1, address=1), short(1, address=1)) == [OK, short(0x50, address=1)]
    desk.finish()
    assert desk.ask(short(1, address=1)) == short(0, address=1)
    assert 4900 < desk.carriage[1] < 5100


def test_a_drive_says_its_version_and_acknowledges_the_rest() -> None:
    desk = fresh()
    asked = (
        command("T", 1, 0, address=5),
        command("N", 1, 2, address=5),
        short(0, address=5),
        command("T", 7, address=5),
    )
    assert desk.tell(*asked) == [long(b"V\x26\x02", address=5), OK, OK, ""]
    assert desk.ask(short(1, address=6)) == ""


def test_a_drive_does_not_hear_q_while_the_card_is_busy() -> None:
    desk = prepared(TO_20000)
    assert desk.ask(command("Q", 3, address=0)) == OK
    desk.finish()
    assert desk.counts[0] == 20_000


def test_the_reference_run_fails_at_the_far_switch() -> None:
    desk = fresh()
    desk.ask(command("Q", 1, 1))
    desk.run(1.0)
    desk.set("limit_x2", "open")
    desk.finish()
    assert desk.status() == 0x40
    assert desk.controller.fault
    assert desk.time_ns < 1.2e9


@pytest.mark.parametrize("back", [False, True])
def test_a_move_ends_at_the_switch_it_goes_towards_and_not_at_the_other(back: bool) -> None:
    for switch, stops in (("limit_x2", not back), ("limit_x1", back)):
        desk = prepared(TO_20000)
        if back:
            desk.finish()
            assert desk.tell(command(0x81, 0)) == [OK]
        while not 2_000 < desk.counts[0] < 18_000:
            desk.run(0.01)
        desk.set(switch, "open")
        desk.finish()
        assert (desk.counts[0] == (0 if back else 20_000)) != stops


def test_a_switch_that_is_never_free_fails_the_reference_run() -> None:
    desk = fresh()
    desk.set("limit_x1", "open")
    desk.ask(command("Q", 1, 1))
    desk.finish()
    assert desk.status() == 0x40
    assert desk.counts[0] == 20_000


def test_a_plc_that_stops_by_itself_says_why() -> None:
    desk = fresh()
    image = "53 35 01 01 01 01 0A 00 04 00 75 07 65 00"  # SPA PB 7, which is not there
    desk.tell(
        Q, command("p", 1, 100), long(bytes.fromhex("61 00 00 00" + image)), command("p", 1, 101), command("p", 1, 1)
    )
    desk.run(0.1)
    assert desk.ask(command("T", 3, 4)) == long(b"\x02")
    assert any("PB 7" in text for _, text in desk.remarks)
