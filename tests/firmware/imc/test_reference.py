"""Reference run and limit switches as physical things: directions, wiring, bounce, missing switches."""

from __future__ import annotations

import pytest

from isel_twin.testing import Desk

FAR = 126_400
"""Trip point of switch X2 of the desk, steps from switch X1 at 0."""
HYSTERESIS = 8
"""A switch of the desk closes again this many steps from where it opened."""
RUN_FREE = 20
"""Default of X (manual 4.2.2)."""
ZERO_NEAR, ZERO_FAR = HYSTERESIS + 1 + RUN_FREE, FAR - HYSTERESIS - 1 - RUN_FREE
"""Where the zero must lie in carriage steps: out of the switch, one step beyond its hysteresis, then free."""
REST = (48_000, 22_000, 50_000)


def desk_at(x: int, *commands: str, **settings: int) -> Desk:
    desk = Desk.of("imc-s8", carriage=(x, *REST), settings=settings)
    for command in [*commands, "@07"]:
        assert desk.query(command) == "0", command
    return desk


def strike(desk: Desk, steps: int) -> None:
    """Run into the end of the axis, then initialise."""
    assert desk.query("@0N7") == "0"
    assert desk.query(f"@0A{steps},30000,0,900,0,900,0,900") == "2"
    assert desk.query("@07") == "0"


# --- where the zero is -----------------------------------------------------------------------------------------------

# settings, carriage position of the zero, counter direction in which the travel lies
ARRANGEMENTS = [
    pytest.param((), ZERO_NEAR, +1, id="default"),
    pytest.param(("@0IR1",), ZERO_FAR, -1, id="reference-inverted"),
    pytest.param(("@0ID1", "@0Ie1"), ZERO_FAR, +1, id="axis-inverted-switches-swapped"),
    pytest.param(("@0ID1", "@0Ie1", "@0IR1"), ZERO_NEAR, -1, id="all-inverted"),
    pytest.param(("@0ID1",), ZERO_FAR, +1, id="axis-inverted"),
    pytest.param(("@0ID1", "@0IR1"), ZERO_NEAR, -1, id="axis-and-reference-inverted"),
]


@pytest.mark.parametrize(("settings", "zero", "inward"), ARRANGEMENTS)
def test_zero_from_the_middle(settings: tuple[str, ...], zero: int, inward: int) -> None:
    desk = desk_at(60_000, *settings)
    assert desk.query("@0R1") == "0"
    assert desk.carriage[0] == zero
    assert desk.counts[0] == 0
    assert desk.query(f"@0A{inward * 1000},5000,0,900,0,900,0,900") == "0"
    assert abs(desk.carriage[0] - zero) == 1000
    assert 0 < desk.carriage[0] < FAR


@pytest.mark.parametrize("end", [+1, -1], ids=["positive-end", "negative-end"])
@pytest.mark.parametrize(("settings", "zero", "inward"), ARRANGEMENTS)
def test_zero_after_a_limit_error_at_either_end(settings: tuple[str, ...], zero: int, inward: int, end: int) -> None:
    desk = desk_at(60_000, *settings)
    strike(desk, end * 200_000)
    assert desk.query("@0R1") == "0"
    assert desk.carriage[0] == zero


@pytest.mark.parametrize("start", [-5, FAR + 5])
def test_zero_when_switched_on_upon_a_switch(start: int) -> None:
    desk = desk_at(start)
    assert desk.query("@0R1") == "0"
    assert desk.carriage[0] == ZERO_NEAR


def test_zero_repeats() -> None:
    desk = desk_at(60_000)
    zeros = set()
    for steps in (100, 12_345, 77):
        assert desk.query("@0R1") == "0"
        zeros.add(int(desk.carriage[0]))
        assert desk.query(f"@0A{steps},9000,0,900,0,900,0,900") == "0"
    assert zeros == {ZERO_NEAR}


# --- how it goes -----------------------------------------------------------------------------------------------------


def test_phases_of_a_reference_run() -> None:
    desk = desk_at(10_000, "@0IF33,50,50,10")
    assert desk.query("@0d2500,900,900") == "0"
    mark = desk.ticks
    assert desk.query("@0R1") == "0"
    stream = desk.steps_since(mark)
    approach, out, free = 10_000, HYSTERESIS + 1, 33
    assert stream.delta[:, 0].tolist() == [-1] * approach + [1] * (out + free)
    gaps_ns = (stream.t_ns[1:] - stream.t_ns[:-1]).tolist()
    assert min(gaps_ns[:approach]) == 400_000  # 2500 Hz, and not a ramp down at the end:
    assert gaps_ns[approach - 3 : approach - 1] == [400_000, 400_000]
    assert gaps_ns[approach - 1] == pytest.approx(50_000_000 + 1e9 / 600, abs=2)  # settle, half a period
    assert gaps_ns[approach : approach + out - 1] == pytest.approx([1e9 / 300] * (out - 1), abs=2)


def test_order_is_z_y_x() -> None:
    desk = desk_at(500)
    assert desk.query("@0R7") == "0"
    first_tick = [int((desk.steps.delta[:, axis] != 0).argmax()) for axis in range(3)]
    assert first_tick[2] < first_tick[1] < first_tick[0]


def test_stop_byte_breaks_a_reference_run_off() -> None:
    desk = desk_at(60_000)
    desk.start("@0R7")
    desk.run(1.0)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.query("@0S") == "G"
    assert desk.query("@0A1,900,0,900,0,900,0,900") == "R"


@pytest.mark.parametrize("byte", [b"\xfd", b"\xff"])
def test_break_while_stepping_out(byte: bytes) -> None:
    desk = desk_at(100)
    desk.start("@0R1")
    while not desk.struck("limit_x1"):
        desk.run(0.001)
    desk.run(0.06)
    desk.send(byte)
    assert desk.finish() == "F"
    assert desk.struck("limit_x1")
    assert desk.query("@0R1") == "0"
    assert desk.carriage[0] == ZERO_NEAR


def test_stop_key_stands_for_a_switch_that_is_not_there() -> None:
    desk = desk_at(60_000, "@0IE0")
    desk.start("@0R1")
    desk.run(2.0)
    stopped_at = int(desk.carriage[0])
    desk.press("stop")
    assert desk.finish() == "0"
    assert desk.carriage[0] == stopped_at + RUN_FREE
    assert desk.counts[0] == 0


def test_both_switches_struck_is_a_wire() -> None:
    desk = desk_at(60_000)
    desk.set("limit_x1", "open")
    desk.set("limit_x2", "open")
    assert desk.query("@0R1") == "2"
    assert desk.ticks == 0


def test_reference_run_clears_the_virtual_zero_of_its_axes() -> None:
    desk = desk_at(500)
    assert desk.query("@0N7") == "0"
    assert desk.query("@0A100,900,100,900,0,900,0,900") == "0"
    assert desk.query("@0n3") == "0"
    assert desk.query("@0R1") == "0"
    assert desk.query("@0M10,900,10,900,0,900,0,900") == "0"
    assert desk.counts[:2] == (10, 110)


# --- limit switches --------------------------------------------------------------------------------------------------


def test_only_the_axes_that_move_need_a_reference() -> None:
    desk = desk_at(500)
    assert desk.query("@0R1") == "0"
    assert desk.query("@0A10,900,0,900,0,900,0,900") == "0"
    assert desk.query("@0A0,900,10,900,0,900,0,900") == "R"
    assert desk.query("@0A0,900,0,900,0,900,0,900") == "0"


def test_leaving_a_switch_is_allowed_and_its_bounce_is_not_a_strike() -> None:
    desk = desk_at(0)
    assert desk.query("@0N7") == "0"
    assert desk.query("@0A-1,900,0,900,0,900,0,900") == "2"
    for command in ("@07", "@0N7"):
        assert desk.query(command) == "0"
    desk.start("@0A2000,900,0,900,0,900,0,900")
    while desk.struck("limit_x1"):
        desk.run(0.0001)
    for late_s, level in ((0.0002, False), (0.0004, True), (0.0007, False), (0.0009, True)):
        desk.at(late_s, lambda level=level: desk.set("p3.0", level))
    assert desk.finish() == "0"
    assert desk.counts[0] == 2000


def test_a_strike_after_the_bounce_time_counts() -> None:
    desk = desk_at(0)
    assert desk.query("@0N7") == "0"
    desk.start("@0A2000,900,0,900,0,900,0,900")
    while desk.struck("limit_x1"):
        desk.run(0.0001)
    desk.at(0.006, lambda: desk.set("p3.0", False))
    assert desk.finish() == "2"


def test_arc_does_not_start_onto_a_struck_switch() -> None:
    desk = desk_at(-3)
    for command in ("@0N7", "@0f-1"):
        assert desk.query(command) == "0"
    mark = desk.ticks
    assert desk.query("@0y400,1500,119,-141,141,-1,-1") == "2"  # sets off to negative X
    assert desk.ticks == mark


def test_arc_strikes_a_switch_on_its_way() -> None:
    desk = desk_at(30)
    for command in ("@0N7", "@0f-1"):
        assert desk.query(command) == "0"
    assert desk.query("@0y400,1500,119,-141,141,-1,-1") == "2"  # bulges 59 steps to negative X
    assert desk.carriage[0] == 0


def test_test_mode_overruns_switches_and_references_on_the_spot() -> None:
    desk = desk_at(50)
    assert desk.query("@0T1") == "0"
    mark = desk.ticks
    assert desk.query("@0R7") == "0"
    assert desk.ticks == mark
    assert desk.query("@0A-100,900,0,900,0,900,0,900") == "0"
    assert desk.carriage[0] == -50
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"
    assert desk.query("@0T0") == "0"
    assert desk.query("@0A-100,900,0,900,0,900,0,900") == "2"


def test_rotary_axis_has_no_end() -> None:
    desk = Desk.of("imc-s8", carriage=(60_000, *REST[:2], 99_900))
    for command in ("@0IE65535", "@0IT8", "@07", "@08", "@0N7", "@0N8"):
        assert desk.query(command) == "0", command
    assert desk.query("@0A0,900,0,900,0,900,5000,9000") == "0"
    assert desk.struck("limit_a2")
    assert desk.query("@0R8") == "0"
    assert desk.counts[3] == 0


def test_inverting_an_axis_loses_its_reference_only() -> None:
    desk = desk_at(60_000)
    assert desk.query("@0N7") == "0"
    assert desk.query("@0ID2") == "0"
    assert desk.query("@0A1,900,0,900,0,900,0,900") == "0"
    assert desk.query("@0A0,900,1,900,0,900,0,900") == "R"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0ID2") == "0"
    assert desk.query("@0A0,900,1,900,0,900,0,900") == "0"


@pytest.mark.parametrize("swap", [("@0Ie1",), ("@0Ie1", "@0IW", "@0Ie0", "@0IL")], ids=["by-command", "from-flash"])
def test_swapping_the_switches_holds_for_one_struck_before(swap: tuple[str, ...]) -> None:
    """Switch 1, struck at the negative end, lies in the positive direction once the host says so."""
    desk = desk_at(60_000)
    strike(desk, -200_000)
    assert desk.query("@0DRn") == "001"
    for command in (*swap, "@07", "@0N7"):
        assert desk.query(command) == "0"
    assert [desk.query("@0DRn"), desk.query("@0DRp")] == ["000", "001"]
    assert desk.query("@0A1,900,0,900,0,900,0,900") == "2"
    for command in ("@07", "@0N7"):
        assert desk.query(command) == "0"
    assert desk.query("@0A-1,900,0,900,0,900,0,900") == "0"


def test_swapping_other_switches_leaves_what_was_found() -> None:
    desk = desk_at(60_000, "@0ID1")
    strike(desk, 200_000)
    assert desk.query("@0DRp") == "001"
    assert desk.query("@0Ie2") == "0"
    assert desk.query("@0DRp") == "001"


# --- switches that do not answer --------------------------------------------------------------------------------------

NEVER_STRUCK = "reference run of X: limit_x1 has not been struck in 2097152 steps towards it"


def test_a_switch_that_never_closes_ends_the_run() -> None:
    """50 mm at 320 steps/mm, at 300 Hz; then no axis is where anybody knows."""
    desk = desk_at(60_000)
    desk.set("limit_x1", "open")
    assert desk.query("@0R1") == "2"
    assert desk.steps.total == (16_000, 0, 0, 0)
    assert [text for _, text in desk.remarks] == [
        "reference run of X: limit_x1 is still struck 16000 steps away from it"
    ]
    assert desk.query("@0A9,900,0,900,0,900,0,900") == "2"
    desk.set("limit_x1", "free")
    assert desk.query("@0R1") == "2"
    assert desk.query("@07") == "0"
    assert desk.query("@0A9,900,0,900,0,900,0,900") == "R"
    assert desk.query("@0R1") == "0"


def test_a_switch_that_never_closes_ends_running_free() -> None:
    desk = desk_at(60_000, leave_steps=300)
    desk.set("limit_x2", "open")
    assert desk.query("@0F1") == "2"
    assert desk.steps.total == (-300, 0, 0, 0)
    assert [text for _, text in desk.remarks] == ["running free of X: limit_x2 is still struck 300 steps away from it"]


def test_a_switch_that_never_opens_ends_the_run() -> None:
    """6.5 m at 320 steps/mm."""
    desk = desk_at(60_000)
    desk.set("limit_x1", "closed")
    assert desk.query("@0R1", limit_s=2000) == "2"
    assert desk.steps.total == (-(1 << 21), 0, 0, 0)
    assert [text for _, text in desk.remarks] == [NEVER_STRUCK]
    assert desk.query("@0A9,900,0,900,0,900,0,900") == "2"


def test_a_stored_reference_run_with_such_a_switch_ends_its_program() -> None:
    desk = desk_at(60_000, leave_steps=300)
    for command in ("@0k", "@0i", "71", "9"):
        assert desk.query(command) == "0"
    desk.set("limit_x1", "open")
    assert desk.query("@0S") == "2"
    assert [text for _, text in desk.remarks] == ["reference run of X: limit_x1 is still struck 300 steps away from it"]


def test_how_far_is_a_setting() -> None:
    desk = desk_at(60_000, search_steps=5000, leave_steps=300)
    desk.set("limit_x1", "open")
    assert desk.query("@0R1") == "2"
    assert desk.steps.total == (300, 0, 0, 0)
    assert desk.query("@07") == "0"
    desk.set("limit_x1", "closed")
    assert desk.query("@0R1") == "2"
    assert desk.steps.total == (300 - 5000, 0, 0, 0)


def test_a_good_reference_run_has_nothing_to_remark() -> None:
    desk = desk_at(60_000)
    assert desk.query("@0R7") == "0"
    assert not desk.remarks
