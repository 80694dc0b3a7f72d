"""iMC, sections 2.2.9 and 2.2.19 to 2.2.26: zeros, position, reference run, start, test mode, texts."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import hex24, pulse_times_ns
from conformance.imc_desk import MIDDLE, TRAVEL, XYZA, fresh, initialised, made, ready, stored
from conformance.rows import case, shows

from isel_twin.testing import Desk

AXES_NAMED = {1: (0,), 2: (1,), 3: (0, 1), 4: (2,), 5: (0, 2), 6: (1, 2), 7: (0, 1, 2), 8: (3,)}
MOVE_OUT = "@0A100,900,100,900,100,900,100,900"

# --- 2.2.9 ---------------------------------------------------------------------------------------------------------


@shows("imc-2.2.9-1", "imc-2.2.9-2", "imc-2.2.9-3")
def test_run_off_the_switch() -> None:
    desk = initialised(carriage=(-5, *MIDDLE[1:]))
    assert desk.struck("limit_x1")
    desk.start("@0F1")
    desk.run(0.001)
    assert desk.read() == ""
    assert desk.finish() == "0"
    assert not desk.struck("limit_x1")
    assert desk.replies[-1][0] >= desk.steps.t_ns[-1]
    assert (desk.steps.delta == (1, 0, 0, 0)).all()


@shows("imc-2.2.9-1")
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("end", [1, 2])
def test_run_off_either_switch_of_an_axis(axis: int, end: int) -> None:
    """Away from it, beyond its edge, and no other axis moves."""
    stands = list(MIDDLE)
    stands[axis] = -5 if end == 1 else TRAVEL[axis] + 5
    desk = initialised(carriage=stands)
    assert desk.struck(f"limit_{'xyz'[axis]}{end}")
    assert desk.query(f"@0F{1 << axis}") == "0"
    assert not desk.struck(f"limit_{'xyz'[axis]}{end}")
    total = desk.steps.total
    assert total[axis] == (1 if end == 1 else -1) * sum(abs(n) for n in total)
    assert 10 < abs(total[axis]) < 100


@shows("imc-2.2.9-4")
def test_after_running_off_a_reference_run_is_needed() -> None:
    desk = ready(carriage=(-5, *MIDDLE[1:]))
    assert desk.query("@0F1") == "0"
    for pairs in ("10,900,0,900,0,900", "0,900,10,900,0,900", "0,900,0,900,10,900"):
        assert desk.query(f"@0A{pairs},0,900") == "R"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0A10,900,10,900,10,900,0,900") == "0"


@shows("imc-2.2.9-5")
def test_run_off_of_an_axis_that_is_not_there() -> None:
    assert initialised(1).query("@0F2") == "3"
    assert initialised(7).query("@0F8") == "3"
    assert fresh().query("@0F1") == "4"


# --- 2.2.19: virtual zero ------------------------------------------------------------------------------------------


@shows("imc-2.2.19-1", "imc-2.2.19-2", "imc-2.2.19-3", "imc-2.2.19-6")
@pytest.mark.parametrize("number", AXES_NAMED)
def test_virtual_zero_of_the_axes_named(number: int) -> None:
    desk = ready(XYZA)
    assert desk.query(MOVE_OUT) == "0"
    assert desk.query(f"@0n{number}") == "0"
    assert desk.query("@0M10,900,10,900,10,900,10,900") == "0"
    assert desk.counts == tuple(110 if axis in AXES_NAMED[number] else 10 for axis in range(4))


@shows("imc-2.2.19-4")
def test_virtual_zero_leaves_relative_moves_alone() -> None:
    desk = ready(XYZA)
    assert desk.query(MOVE_OUT) == "0"
    assert desk.query("@0n7") == "0"
    assert made(desk, MOVE_OUT).total == (100, 100, 100, 100)


@pytest.mark.parametrize("number", [0, 9, 11, 15])
@pytest.mark.parametrize("letter", [case("imc-2.2.19-5", "n"), case("imc-2.2.20-6", "N"), case("imc-2.2.22-10", "R")])
def test_a_is_named_alone(letter: str, number: int) -> None:
    assert ready(XYZA).query(f"@0{letter}{number}") == "3"


# --- 2.2.20: simulated reference run -------------------------------------------------------------------------------


@shows("imc-2.2.20-1", "imc-2.2.20-3", "imc-2.2.20-4", "imc-2.2.20-7")
@pytest.mark.parametrize("number", AXES_NAMED)
def test_simulated_reference_run(number: int) -> None:
    desk = ready(XYZA)
    assert desk.query(MOVE_OUT) == "0"
    assert made(desk, f"@0N{number}").total == (0, 0, 0, 0)
    assert desk.query("@0P") == hex24(*(0 if axis in AXES_NAMED[number] else 100 for axis in range(4)))


@shows("imc-2.2.20-2", "imc-5-33")
def test_simulated_reference_run_allows_moves() -> None:
    desk = initialised(carriage=MIDDLE)
    assert desk.query(MOVE_OUT) == "R"
    assert desk.ticks == 0
    assert desk.query("@0N7") == "0"
    assert desk.query(MOVE_OUT) == "0"


@shows("imc-2.2.20-5")
def test_reference_point_leaves_relative_moves_alone() -> None:
    desk = ready()
    first = made(desk, "@0A33,900,-20,900,5,900,0,900").total
    assert desk.query("@0N7") == "0"
    assert made(desk, "@0A33,900,-20,900,5,900,0,900").total == first


# --- 2.2.21: position ----------------------------------------------------------------------------------------------


@shows("imc-2.2.21-1", "imc-2.2.21-3", "imc-2.2.21-8")
def test_printed_position_of_three_axes() -> None:
    desk = ready(position_switches=())
    assert desk.query("@0M256,40000,131087,40000,-2,900,0,900") == "0"
    assert desk.query("@0P") == "0" + "000100" + "02000F" + "FFFFFE"


@shows("imc-2.2.21-9")
def test_position_of_a_one_axis_controller() -> None:
    """In the form of 2.2.21, of X alone: the first six digits of the printed example."""
    desk = Desk.of("it116", carriage=MIDDLE)
    assert [desk.query(text) for text in ("@01", "@0N1", "@0M256,900", "@0P")] == ["0", "0", "0", "0" + "000100"]


@shows("imc-2.2.21-2", "imc-2.2.21-4")
def test_printed_position_of_four_axes() -> None:
    desk = ready(XYZA, position_switches=())
    assert desk.query("@0M2816,40000,278528,40000,4094,9000,12352,9000") == "0"
    assert desk.query("@0P") == "0" + "000B00044000000FFE003040"


@shows("imc-2.2.21-5")
@pytest.mark.parametrize(("axes", "move"), [(1, "@0A70,900"), (3, "@0A70,900,-1,900")])
def test_three_positions_whatever_the_axes(axes: int, move: str) -> None:
    desk = ready(axes)
    assert desk.query(move) == "0"
    assert desk.query("@0P") == hex24(70, 0 if axes == 1 else -1, 0)


@shows("imc-2.2.21-6")
def test_position_is_given_after_the_move() -> None:
    desk = ready()
    desk.start("@0A900,900,0,900,0,900,0,900")
    desk.run(0.2)
    desk.start("@0P")
    desk.run(0.2)
    assert desk.read() == ""
    assert desk.finish() == "0" + hex24(900, 0, 0)


@shows("imc-2.2.21-7")
def test_position_is_the_counter() -> None:
    desk = ready()
    desk.carriage[:3] += 1000  # somebody has pushed the carriages
    assert desk.query("@0P") == hex24(0, 0, 0)


# --- 2.2.22: reference run -----------------------------------------------------------------------------------------

OUT = 9
"""A desk's switch at 0 with a hysteresis of 8 steps closes again at 9."""


@shows("imc-2.2.22-1", "imc-4.2.2-1")
def test_reference_run_ends_behind_the_switches_at_0() -> None:
    desk = initialised(XYZA)
    assert desk.query("@0IF20,50,40,10") == "0"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0R8") == "0"
    assert desk.counts == (0, 0, 0, 0)
    assert desk.carriage.tolist() == [OUT + 20, OUT + 50, OUT + 40, OUT + 10]


@shows("imc-2.2.22-2")
@pytest.mark.parametrize("command", ["@0R7", "@0r7"])
def test_both_letters_of_the_reference_run(command: str) -> None:
    desk = initialised()
    assert desk.query(command) == "0"
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"


@shows("imc-2.2.22-3")
def test_reference_run_of_a() -> None:
    desk = initialised(XYZA)
    stream = made(desk, "@0R8")
    assert (stream.delta[:, :3] == 0).all()
    assert stream.total[3] < -1900


@shows("imc-2.2.22-4")
@pytest.mark.parametrize("number", AXES_NAMED)
def test_reference_run_of_the_axes_named(number: int) -> None:
    desk = initialised(XYZA)
    stream = made(desk, f"@0R{number}")
    moved = {axis for axis in range(4) if (stream.delta[:, axis] != 0).any()}
    assert moved == set(AXES_NAMED[number])


@shows("imc-2.2.22-5")
def test_order_of_the_reference_run() -> None:
    stream = made(initialised(), "@0R7")
    axis = np.argmax(stream.delta != 0, axis=1)
    assert (np.abs(stream.delta).sum(axis=1) == 1).all()
    changes = axis[np.flatnonzero(np.diff(axis, prepend=-1))]
    assert changes.tolist() == [2, 1, 0]


@shows("imc-2.2.22-6")
def test_commands_wait_for_the_reference_run() -> None:
    desk = initialised()
    desk.start("@0R7")
    desk.run(0.3)
    desk.start("@0B0,3")
    desk.run(0.1)
    assert desk.read() == ""
    assert desk.outputs.get("user", 0) == 0
    assert desk.finish() == "00"


@shows("imc-2.2.22-7")
@pytest.mark.parametrize("number", [1, 7, 8])
def test_reference_run_before_the_axes_are_set(number: int) -> None:
    desk = fresh()
    assert desk.query(f"@0R{number}") == "4"
    assert desk.ticks == 0


@shows("imc-2.2.22-8", "imc-5-7")
@pytest.mark.parametrize(("axes", "number"), [(1, 2), (1, 7), (3, 4), (3, 7), (7, 8)])
def test_reference_run_of_an_axis_that_is_not_there(axes: int, number: int) -> None:
    desk = initialised(axes)
    assert desk.query(f"@0R{number}") == "3"
    assert desk.ticks == 0


@shows("imc-2.2.22-9")
def test_reference_run_leaves_3d() -> None:
    desk = initialised()
    assert desk.query("@0z1") == "0"
    assert desk.query("@0R7") == "0"
    assert made(desk, "@0A0,900,0,900,30,900,-10,900").total == (0, 0, 20, 0)


@shows("imc-2.2.22-11")
def test_without_reference_switch_the_stop_key_stands_in_for_it() -> None:
    desk = initialised(1, position_switches=())
    desk.start("@0R1")
    desk.run(60.0)
    assert desk.read() == ""
    assert desk.steps.t_ns[-1] > desk.time_ns - 10_000_000
    desk.press("stop", 0.1)
    assert desk.finish() == "0"
    assert desk.counts == (0, 0, 0, 0)
    assert desk.query("@0A5,900") == "0"


@shows("imc-1-64", "imc-4.2.2-2", "imc-4.2.2-3", "imc-4.2.2-4")
def test_the_three_parts_of_a_reference_run() -> None:
    desk = initialised()
    assert desk.query("@0d1500,1500,1500") == "0"
    assert desk.query("@0IF20,50,40,10") == "0"
    begin = desk.time_ns
    stream = made(desk, "@0R1")
    x = stream.delta[:, 0].astype(int)
    inwards = int(np.argmax(x > 0))
    assert inwards == 2000
    assert (x[:inwards] == -1).all()
    assert (x[inwards:] == 1).all()
    free = inwards + OUT
    assert len(x) == free + 20
    rise = pulse_times_ns(10**5, 1500)[:inwards]
    assert (stream.t_ns[:inwards] - begin).tolist() == rise
    assert np.diff(stream.t_ns[inwards:free]).tolist() == pytest.approx([1e9 / 300] * (OUT - 1), abs=1)
    struck, free_again = (t for t, terminal, _ in desk.inputs_log if terminal == "p3.0")
    assert struck == stream.t_ns[inwards - 1]
    assert free_again == stream.t_ns[free - 1]
    run_free = stream.t_ns[free:] - free_again
    assert 1e9 / float(np.diff(run_free).min()) <= 1500 * (1 + 1e-6)


@shows("imc-4.2.2-2")
def test_starting_on_the_switch_the_axis_only_runs_off() -> None:
    desk = initialised(carriage=(-5, *MIDDLE[1:]))
    stream = made(desk, "@0R1")
    assert (stream.delta == (1, 0, 0, 0)).all()
    assert desk.counts == (0, 0, 0, 0)


# --- 2.2.23: start -------------------------------------------------------------------------------------------------


@shows("imc-2.2.23-1", "imc-2.2.23-4")
def test_start_makes_the_rest_of_a_stopped_move() -> None:
    desk = ready()
    desk.start("@0A5000,2000,0,900,0,900,0,900")
    desk.run(0.5)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    so_far = desk.counts[0]
    assert 900 < so_far < 1100
    begin = desk.time_ns
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == 5000
    assert desk.replies[-1][0] == begin + pulse_times_ns(5000 - so_far, 2000)[-1]


@shows("imc-2.2.23-2")
@pytest.mark.parametrize("letter", "sS")
def test_both_letters_of_start(letter: str) -> None:
    desk = ready()
    desk.start("@0A5000,2000,0,900,0,900,0,900")
    desk.run(0.5)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.query(f"@0{letter}") == "0"
    assert desk.counts[0] == 5000


@shows("imc-2.2.23-3", "imc-2.2.23-4")
def test_start_runs_the_program() -> None:
    desk = stored("0900,900,0,30,0,30,0,30")
    begin = desk.time_ns
    assert made(desk, "@0S").total == (900, 0, 0, 0)
    assert desk.replies[-1][0] >= begin + pulse_times_ns(900, 900)[-1]


@shows("imc-2.2.23-5", "imc-5-30")
def test_nothing_to_start() -> None:
    desk = ready()
    assert desk.query("@0S") == "G"
    assert desk.ticks == 0


@shows("imc-2.2.23-5", "imc-2.2.31-5")
@pytest.mark.parametrize(
    ("between", "reply"),
    [
        ("@0P", "0"),
        ("@0B0,1", "0"),
        ("@0b0", "0"),
        ("@0A10,900,0,900,0,900,0,900", "G"),
        ("@0M0,900,0,900,0,900,0,900", "G"),
        ("@0y4,900,0,1,0,-1,1", "G"),
        ("@0Z0,1,1,900,1,0,0", "G"),
        ("@0R1", "G"),
        ("@07", "G"),
    ],
)
def test_what_takes_the_rest_of_a_stopped_move(between: str, reply: str) -> None:
    """Another motion or a new initialisation forgets the rest; questions and ports leave it."""
    desk = ready()
    desk.start("@0A5000,2000,0,900,0,900,0,900")
    desk.run(0.5)
    desk.send(b"\xfd")
    assert desk.finish() == "F"
    assert desk.query(between)[0] == "0"
    assert desk.query("@0S") == reply
    assert (desk.steps.total[0] == 5000) == (reply == "0")


# --- 2.2.24: test mode ---------------------------------------------------------------------------------------------

PAST_THE_END = "@0A67000,40000,0,900,0,900,0,900"
"""From the middle of X 600 steps beyond its far switch."""


@shows("imc-2.2.24-1")
def test_test_mode_is_acknowledged() -> None:
    desk = initialised()
    assert desk.query("@0T1") == "0"
    assert desk.query("@0T0") == "0"


@shows("imc-2.2.24-2")
def test_reference_run_in_test_mode() -> None:
    desk = initialised(carriage=MIDDLE)
    assert desk.query("@0T1") == "0"
    assert made(desk, "@0R7").total == (0, 0, 0, 0)
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0P") == hex24(0, 0, 0)


@shows("imc-2.2.24-3")
def test_limit_switches_can_be_overrun_in_test_mode() -> None:
    desk = ready()
    assert desk.query("@0T1") == "0"
    assert desk.query(PAST_THE_END) == "0"
    assert desk.counts[0] == 67_000
    assert desk.query("@0DRp") == "001"


@shows("imc-2.2.24-4")
def test_out_of_the_switch_in_test_mode() -> None:
    desk = fresh(carriage=(-5, *MIDDLE[1:]))
    assert desk.query("@07") == "0"
    assert desk.query("@0T1") == "0"
    assert desk.query("@0R7") == "0"
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"
    assert not desk.struck("limit_x1")


@shows("imc-2.2.24-5")
def test_without_test_mode_switches_and_reference_run_work_again() -> None:
    desk = ready()
    assert desk.query("@0T1") == "0"
    assert desk.query("@0T0") == "0"
    assert made(desk, PAST_THE_END, "2").total == (66_400, 0, 0, 0)
    desk = initialised()
    assert desk.query("@0T1") == "0"
    assert desk.query("@0T0") == "0"
    assert made(desk, "@0R1").total[0] < -1900


@shows("imc-2.2.24-6")
def test_test_mode_knows_two_states() -> None:
    assert initialised().query("@0T2") == "1"


@shows("imc-2.2.24-7")
def test_test_mode_comes_after_the_move() -> None:
    desk = ready()
    desk.start(PAST_THE_END)
    desk.run(0.5)
    desk.start("@0T1")
    assert desk.finish() == "20"
    assert desk.counts[0] == 66_400


# --- 2.2.25, 2.2.26: texts -----------------------------------------------------------------------------------------


@shows("imc-2.2.25-1")
def test_user_information_is_text() -> None:
    reply = initialised().query("@0U")
    assert reply.startswith("0")
    assert "UserInfo" in reply
    assert reply.replace("\r\n", "").isprintable()


@shows("imc-2.2.25-2")
def test_user_information_is_the_one_set() -> None:
    desk = initialised()
    assert desk.query("@0IUworkshop 7, door 2") == "0"
    assert "workshop 7, door 2" in desk.query("@0U")
    assert desk.query("@0IW") == "0"
    desk.power_cycle()
    assert "workshop 7, door 2" in desk.query("@0U")


@shows("imc-2.2.26-1")
def test_version_is_text() -> None:
    reply = fresh().query("@0V")
    assert "isel" in reply
    assert "\r\n" in reply
    assert reply.replace("\r\n", "").isprintable()


@shows("imc-2.2.26-2")
def test_question_mark_asks_for_the_version() -> None:
    desk = fresh()
    assert desk.query("@0?") == desk.query("@0V")
