"""A host that sends ahead, and stops: nothing starts to move that has not been asked for after the stop."""

from __future__ import annotations

import pytest

from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)
MOVE = "@0A900,900,0,900,0,900,0,900"
"""About a second."""
NOTHING = "000000" * 3
STOPS = {"253": b"\xfd", "255": b"\xff"}


def desk_sent(*commands: str, before: tuple[str, ...] = ("@07", "@0N7"), moving: float = 0.3) -> Desk:
    """A desk that carries out the first of these commands, and all the others wait."""
    desk = Desk.of("imc-s8", carriage=MIDDLE)
    for command in before:
        assert desk.query(command) == "0", command
    for command in commands:
        desk.start(command)
    desk.run(moving)
    return desk


def stop(desk: Desk, how: str) -> None:
    if how == "key":
        desk.press("stop")
    else:
        desk.send(STOPS[how])


def go_on(desk: Desk, how: str) -> str:
    if how == "key":
        desk.press("start")
        return desk.finish()
    return desk.query(how)


@pytest.mark.parametrize("goes_on", ["@0S", "key"])
@pytest.mark.parametrize("how", ["253", "key"])
def test_what_waits_is_held_until_the_start(how: str, goes_on: str) -> None:
    desk = desk_sent(MOVE, MOVE, "@0P", MOVE, "@0b0")
    stop(desk, how)
    assert desk.finish() == "F"
    stands = desk.counts[0]
    assert 0 < stands < 900
    desk.run(5.0)
    assert desk.read() == ""
    assert desk.counts[0] == stands
    assert go_on(desk, goes_on) == "0" + "0" + f"0{1800:06X}000000000000" + "0" + "000"
    assert desk.counts[0] == 2700


def test_what_comes_after_the_stop_is_done_at_once() -> None:
    desk = desk_sent(MOVE, MOVE)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    for _ in range(3):
        assert desk.query("@0P") == f"0{desk.counts[0]:06X}000000000000"
    assert desk.query("@0B0,5") == "0"
    assert desk.query("@0S") == "00"
    assert desk.counts[0] == 1800


def test_what_comes_within_the_stop_ramp_comes_after_the_stop() -> None:
    desk = desk_sent("@0A50000,30000,0,900,0,900,0,900", MOVE, moving=1.0)
    desk.send(b"\xfd@0P\r@0S\r@0b0\r")
    reply = desk.finish()
    assert reply[:2] == "F0"
    assert reply[20:] == "0" + "0" + "000"  # the rest, the move held, the query sent last
    assert desk.counts[0] == 50_900


def test_questions_first_in_line_are_answered_where_the_machine_stands() -> None:
    """A host that asks for the position in a move and then stops it gets both: what it asked, and F."""
    desk = desk_sent(MOVE, "@0P", "@0b0", MOVE, "@0b0")
    desk.send(b"\xfd")
    assert desk.finish() == "F" + f"0{desk.counts[0]:06X}000000000000" + "000"
    assert desk.query("@0S") == "0" + "0" + "000"


def test_a_start_sent_before_the_stop_does_not_count() -> None:
    desk = desk_sent(MOVE, "@0S")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert 0 < desk.counts[0] < 900
    assert desk.query("@0S") == "0" + "G"
    assert desk.counts[0] == 900


def test_a_line_begun_before_the_stop_comes_after_it() -> None:
    desk = desk_sent(MOVE)
    desk.send(b"@0b")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    desk.send(b"0\r")
    assert desk.finish() == "000"


@pytest.mark.parametrize("command", ["@0A-10,900,0,900,0,900,0,900", "@07", "@0R1"])
def test_forgetting_the_rest_drops_what_was_held(command: str) -> None:
    """Each is answered F, a question with its answer, before anything moves again: replies stay in the order sent."""
    desk = desk_sent(MOVE, MOVE, "@0b0", "@0B0,255")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    asked_ns = desk.time_ns
    assert desk.query(command) == "F" + "000" + "F" + "0"
    assert [t for t, _ in desk.replies[-4:-1]] == [asked_ns] * 3
    assert desk.outputs["user"] == 0
    assert desk.query("@0S") == "G"


def test_break_drops_what_is_held() -> None:
    desk = desk_sent(MOVE, MOVE)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    desk.send(b"\xff")
    assert desk.finish() == "F"
    assert desk.query("@0S") == "G"


@pytest.mark.parametrize("event", ["estop", "253-then-255"])
def test_a_fault_or_break_in_the_stop_ramp_drops_what_waits(event: str) -> None:
    desk = desk_sent("@0A50000,30000,0,900,0,900,0,900", MOVE, moving=1.0)
    desk.send(b"\xfd")
    if event == "estop":
        desk.set("estop", "pressed")
        assert desk.finish() == "9" + "F"
    else:
        desk.send(b"\xff")
        assert desk.finish() == "F" + "F"


def test_an_emergency_stop_drops_what_is_held() -> None:
    desk = desk_sent(MOVE, MOVE)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    desk.set("estop", "pressed")
    assert desk.finish() == "F"


def test_break_drops_what_waits() -> None:
    desk = desk_sent(MOVE, MOVE, "@0b0", MOVE)
    desk.send(b"\xff")
    assert desk.finish() == "F" + "F" + "000" + "F"
    assert 0 < desk.counts[0] < 900
    assert desk.query(MOVE) == "0"


@pytest.mark.parametrize("how", ["253", "255"])
@pytest.mark.parametrize("first", ["@0R1", "@0k", "@0R4"])
def test_a_stop_that_leaves_nothing_to_go_on_with_drops_what_waits(first: str, how: str) -> None:
    """A reference run is broken off; erasing goes on. Neither is followed by the move behind it."""
    desk = desk_sent(first, "@0R2", MOVE, "@0b0")
    stop(desk, how)
    mark_y = desk.counts[1]
    assert desk.finish() == ("0" if first == "@0k" else "F") + "F" + "F" + "000"
    assert desk.counts[1] == mark_y
    assert desk.query("@0b0") == "000"


def test_each_stop_holds_what_came_before_it() -> None:
    desk = desk_sent("@0A50000,30000,0,900,0,900,0,900", MOVE, moving=1.0)
    desk.send(b"\xfd" + MOVE.encode() + b"\r\xfd")
    assert desk.finish() == "F"
    assert desk.counts[0] < 50_000
    assert desk.query("@0S") == "000"
    assert desk.counts[0] == 51_800


def test_stopped_again_while_going_on() -> None:
    desk = desk_sent(MOVE, MOVE, MOVE)
    for _ in range(2):
        desk.send(b"\xfd")
        assert desk.finish() == "F"
        desk.start("@0S")
        desk.run(0.1)
    assert desk.finish() == "000"
    assert desk.counts[0] == 2700


def test_a_program_stopped_holds_what_waits_behind_it() -> None:
    before = ("@07", "@0N7", "@0k", "@0i", "0900,900,0,900,0,900,0,900", "9")
    desk = desk_sent("@0S", MOVE, before=before)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.query("@0S") == "00"
    assert desk.counts[0] == 1800


def test_a_delay_in_a_program_does_not_hear_the_stop() -> None:
    desk = desk_sent("@0S", "@0b0", before=("@07", "@0N7", "@0k", "@0i", "5 20", "9"))
    desk.send(b"\xfd")
    assert desk.finish() == "0" + "000"


def test_a_reset_forgets_what_is_held() -> None:
    desk = desk_sent(MOVE, MOVE)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    desk.send(b"\xfe")
    assert desk.finish() == ""
    assert desk.query("@0S") == "G"


def test_a_full_queue_leaves_room_for_the_start() -> None:
    desk = desk_sent(MOVE, *["@0b0".ljust(63)] * 10, MOVE.ljust(63), *["@0b0".ljust(63)] * 60)
    desk.send(b"\xfd")
    assert desk.finish() == "F" + "000" * 10 + "5" * 7
    assert desk.query("@0S") == "0" + "0" + "000" * 53
    assert desk.query("@0b0") == "000"


def test_memory_is_bounded_however_often_the_host_stops_and_sends_on() -> None:
    desk = desk_sent("@0A50000,30000,0,900,0,900,0,900", MOVE, moving=1.0)
    for _ in range(30):
        desk.send(b"\xfd" + b"@0b0\r" * 800)
    kept = (2 * 4096 - len(MOVE) - 1) // 5
    assert desk.finish() == "F" + "5" * (30 * 800 - kept)
    assert desk.query("@0S") == "0" + "0" + "000" * kept
