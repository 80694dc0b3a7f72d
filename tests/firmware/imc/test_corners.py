"""Corners that single mutations of the firmware once went through unnoticed: each is one fact, told apart exactly."""

from __future__ import annotations

import pytest

from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)
FAR = 126_400
"""Trip point of switch X2 of the desk."""
MOVE = "@0A9000,900,0,900,0,900,0,900"
PROGRAM = "09000,900,0,900,0,900,0,900"
ONE_STEP = "@0A1,900,0,900,0,900,0,900"


def desk_after(*commands: str, x: int = MIDDLE[0], y: int = MIDDLE[1]) -> Desk:
    desk = Desk.of("imc-s8", carriage=(x, y, *MIDDLE[2:]))
    for command in commands:
        assert desk.query(command) == "0", command
    return desk


def with_program(*lines: str, before: tuple[str, ...] = ()) -> Desk:
    return desk_after("@07", "@0N7", *before, "@0k", "@0i", *lines, "9")


def going(desk: Desk, command: str, seconds: float = 0.5) -> Desk:
    desk.start(command)
    desk.run(seconds)
    return desk


# --- moves of a program ----------------------------------------------------------------------------------------------


def test_a_condition_is_used_up_by_one_move() -> None:
    desk = with_program("60,0,1", PROGRAM, "00,900,7,900,0,900,0,900")
    desk.at(1.0, lambda: desk.set("user_0", True))
    assert desk.query("@0S") == "0"
    assert 0 < desk.counts[0] < 9000
    assert desk.counts[1] == 7


def test_a_condition_ends_all_legs_of_its_move() -> None:
    """Also if it is over before the ramp is: what it has ended does not begin again."""
    desk = with_program("60,0,1", "09000,900,0,900,50,900,0,900")
    desk.at(1.0, lambda: desk.set("user_0", True))
    desk.at(1.0001, lambda: desk.set("user_0", False))
    assert desk.query("@0S") == "0"
    assert 0 < desk.counts[0] < 9000
    assert desk.counts[2] == 0


def test_eight_loops_one_after_the_other_are_not_nested() -> None:
    desk = with_program(*["01,900,0,900,0,900,0,900", "3 1,-1"] * 8)
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == 16


# --- running free ----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("x", "stands"), [(-5, 8 + 1 + 20), (FAR + 5, FAR - 8 - 1 - 20)], ids=["X1", "X2"])
def test_running_free_leads_away_from_either_switch(x: int, stands: int) -> None:
    assert desk_after("@07", "@0F1", x=x).carriage[0] == stands


def test_running_free_between_two_struck_switches_goes_nowhere() -> None:
    desk = desk_after("@07")
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "open")
    assert desk.query("@0F1") == "2"
    assert desk.ticks == 0


@pytest.mark.parametrize("command", ["@0F3", "@0R3"])
def test_two_switches_struck_while_another_axis_runs_end_the_run(command: str) -> None:
    """Y rests after its last step out; when it is the turn of X, nobody knows where to go."""
    desk = going(desk_after("@07", y=-1), command, 0.0005)
    while desk.controller.run is not None:
        desk.run(0.0005)
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "open")
    assert desk.finish() == "2"
    assert desk.ticks > 0
    assert desk.counts[0] == 0


@pytest.mark.parametrize("command", ["@0R1", "@0R7", "@0F1", "@0F7"])
def test_a_run_refused_for_two_struck_switches_changes_nothing(command: str) -> None:
    """Refused before the first step of any axis: references, position and the rest of a stopped move stay."""
    desk = desk_after("@07", "@0N7", "@0z1")
    going(desk, MOVE).send(b"\xfd")
    assert desk.finish() == "F"
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "open")
    mark = desk.ticks
    assert desk.query(command) == "2"
    assert desk.ticks == mark
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "closed")
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == 9000


def test_a_stored_run_between_two_struck_switches_ends_its_program() -> None:
    desk = with_program("77")
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "open")
    assert desk.query("@0S") == "2"
    assert desk.ticks == 0


def test_in_test_mode_a_reference_run_looks_at_no_switch() -> None:
    desk = desk_after("@07", "@0T1")
    for contact in ("limit_x1", "limit_x2"):
        desk.set(contact, "open")
    assert desk.query("@0R1") == "0"


# --- stop, break and keys --------------------------------------------------------------------------------------------


@pytest.mark.parametrize("line", ["5 100", "2 65,1"], ids=["delay", "wait"])
def test_break_ends_a_program_that_does_not_move(line: str) -> None:
    desk = going(with_program(line, PROGRAM), "@0S")
    begun_ns = desk.time_ns
    desk.send(b"\xff")
    assert desk.finish() == "F"
    assert desk.time_ns == begun_ns
    assert desk.ticks == 0


@pytest.mark.parametrize("second", ["byte", "key"])
def test_a_stop_in_the_ramp_of_a_break_does_not_bring_the_rest_back(second: str) -> None:
    desk = going(desk_after("@07", "@0N7"), "@0A50000,30000,0,900,0,900,0,900", 1.0)
    desk.send(b"\xff")
    if second == "byte":
        desk.send(b"\xfd")
    else:
        desk.set("stop", "down")
    assert desk.finish() == "F"
    assert desk.query("@0S") == "G"


@pytest.mark.parametrize("how", ["byte", "key"])
def test_a_stop_in_the_ramp_of_a_condition_stops_the_program(how: str) -> None:
    """The ramp of the condition is in progress; the next line must wait for a start."""
    desk = going(with_program("60,0,1", "050000,30000,0,900,0,900,0,900", PROGRAM), "@0S", 1.0)
    desk.set("user_0", True)
    desk.run(0.01)
    if how == "byte":
        desk.send(b"\xfd")
    else:
        desk.set("stop", "down")
    assert desk.finish() == "F"
    stands = desk.counts[0]
    desk.run(10.0)
    assert desk.counts[0] == stands
    desk.set("stop", "up")
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == stands + 9000


def test_a_stop_in_the_ramp_of_a_move_until_an_event_is_a_stop() -> None:
    """`F`, and a start ends the command, whose event has come: there is nothing left to travel."""
    desk = going(desk_after("@07", "@0N7"), "@0Z0,1,1,30000,50000,0,0", 1.0)
    desk.set("user_0", True)
    desk.run(0.01)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    stands = desk.counts
    assert desk.query("@0S") == "0"
    assert desk.counts == stands
    assert desk.query("@0S") == "G"


def test_the_stop_key_is_no_switch_once_a_search_is_broken_off() -> None:
    desk = going(desk_after("@07", "@0d30000,900,900"), "@0R1", 0.5)
    desk.send(b"\xff")
    desk.set("stop", "down")
    mark = desk.ticks
    assert desk.finish() == "F"
    assert desk.ticks > mark + 1000  # the ramp goes on: 30 kHz at 100 Hz/ms
    assert desk.query(ONE_STEP) == "R"


def test_letting_the_start_key_go_starts_nothing() -> None:
    desk = going(with_program(PROGRAM), "@0A900,900,0,900,0,900,0,900")
    desk.set("start", "down")
    assert desk.finish() == "0"
    desk.set("start", "up")
    assert desk.finish() == ""
    assert desk.counts[0] == 900


def test_the_start_key_does_nothing_while_a_program_is_stored() -> None:
    """Nor does it go on with a stopped move; afterwards `@0S` does."""
    desk = going(desk_after("@07", "@0N7", "@0k"), MOVE)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    stands = desk.counts
    assert desk.query("@0i") == "0"
    desk.press("start")
    desk.run(1.0)
    assert desk.counts == stands
    assert [desk.query(line) for line in ("1 65", "9", "@0S")] == ["0", "0", "0"]
    assert desk.counts[0] == 9000


def test_watched_ports_are_asked_before_a_program_goes_on() -> None:
    desk = going(with_program(PROGRAM, before=("@0IA0,1,0",)), "@0S")
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    stands = desk.counts
    desk.set("user_0", True)
    assert desk.query("@0S") == "F"
    desk.run(1.0)
    assert desk.counts == stands
    desk.set("user_0", False)
    assert desk.query("@0S") == "0"


def test_an_emergency_counts_before_a_hood_and_a_hood_before_an_abort() -> None:
    for inputs, reply in ((("user_0", "user_1"), "H"), (("user_0", "user_1", "user_2"), "9")):
        desk = with_program(PROGRAM, before=("@0IA0,1,0", "@0IH0,2,0", "@0IN0,4,0"))
        for name in inputs:
            desk.set(name, True)
        assert desk.query("@0S") == reply


# --- settings --------------------------------------------------------------------------------------------------------


def test_three_axes_again_after_four() -> None:
    desk = desk_after("@07", "@08")
    assert len(desk.query("@0P")) == 25
    assert desk.query("@07") == "0"
    assert len(desk.query("@0P")) == 19


def test_a_alone_shows_four_counters() -> None:
    assert len(desk_after("@08").query("@0P")) == 25


def test_a_simulated_reference_run_needs_what_a_real_one_needs() -> None:
    desk = desk_after("@07", "@0B3,0")
    assert desk.query("@0N7") == "9"
    assert desk.query("@0B3,1") == "0"
    desk.set("hood", "open")
    assert desk.query("@0N7") == "H"
    desk.set("hood", "closed")
    assert desk.query("@0N7") == "0"


def test_a_simulated_reference_run_is_as_good_as_a_real_one_after_a_limit_switch() -> None:
    desk = desk_after("@07", "@0N7")
    assert desk.query("@0A100000,30000,0,900,0,900,0,900") == "2"
    assert desk.query("@0A-9,900,0,900,0,900,0,900") == "2"
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0A-9,900,0,900,0,900,0,900") == "0"


@pytest.mark.parametrize("command", ["@0B3,1", "@0B100,8"])
def test_stages_stay_off_in_a_fault(command: str) -> None:
    desk = desk_after("@07")
    desk.set("estop", "pressed")
    assert desk.query(command) == "9"
    desk.set("estop", "released")
    assert desk.query(command) == "9"
    assert desk.outputs["stages"] == 0


@pytest.mark.parametrize("command", ["@0IL", "@0IX"])
def test_values_put_in_force_end_what_the_host_had_set(command: str) -> None:
    def gaps_ns(desk: Desk) -> list[int]:
        mark = desk.ticks
        assert desk.query("@0A300,5000,0,900,0,900,0,900") == "0"
        times = desk.steps_since(mark).t_ns
        return [int(gap) for gap in times[1:] - times[:-1]]

    desk = desk_after("@07", "@0N7")
    before = gaps_ns(desk)
    for value in ("@0J900", "@0j999"):
        assert desk.query(value) == "0"
        assert gaps_ns(desk) != before
        assert desk.query(command) == "0"
        assert gaps_ns(desk) == before


def test_an_arc_finds_out_which_way_a_switch_lies() -> None:
    """With X inverted, the bulge of this arc to positive X strikes switch 1: it lies in the positive direction."""
    desk = desk_after("@0ID1", "@07", "@0N7", "@0f0", x=30)
    assert desk.query("@0y400,1500,119,141,141,1,-1") == "2"
    assert desk.struck("limit_x1")
    assert [desk.query("@0DRp"), desk.query("@0DRn")] == ["001", "000"]


def test_a_switch_lies_where_an_arc_is_going_now_not_where_it_has_been_going() -> None:
    """Clockwise round (141, -141) with radius 200: X goes 341 steps up, then down, and is struck before it is back."""
    desk = going(desk_after("@07", "@0N7", "@0f0"), "@0y1000,1500,119,-141,141,-1,-1", 0.61)
    before = desk.counts[0]
    desk.run(0.01)
    assert 0 < desk.counts[0] < before
    desk.set("limit_x1", "open")
    assert desk.finish() == "2"
    assert [desk.query("@0DRp"), desk.query("@0DRn")] == ["000", "001"]
