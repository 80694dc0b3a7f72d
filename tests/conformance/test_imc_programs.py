"""iMC, chapter 3: stored programs. A program is stored line by line, each line acknowledged, and run by `@0S`."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import hex24, line, off_circle, pulse_times_ns
from conformance.imc_desk import CONTROLLERS, MIDDLE, XYZA, fresh, initialised, made, program, ready, stored
from conformance.rows import case, shows
from from_start import from_start

from isel_twin.testing import Desk

AXES_NAMED = {1: (0,), 2: (1,), 3: (0, 1), 4: (2,), 5: (0, 2), 6: (1, 2), 7: (0, 1, 2), 8: (3,)}


def x(steps: int, speed: int = 900) -> str:
    """A stored relative move of X on a three-axis machine."""
    return f"0{steps},{speed},0,30,0,30,0,30"


def result(*lines: str, axes: int = 7) -> tuple[int, ...]:
    """Steps of each axis that a program makes; it must end with `0`."""
    return made(stored(*lines, axes=axes), "@0S").total


def storing(axes: int = 7) -> Desk:
    """A desk that waits for the first command of a program."""
    desk = ready(axes)
    assert desk.query("@0k") == "0"
    assert desk.query("@0i") == "0"
    return desk


def refused(*lines: str) -> bool:
    """Is this program refused: when a line is stored, at its end, or when it is started?"""
    desk = storing()
    return any(desk.query(text) != "0" for text in (*lines, "9", "@0S"))


# --- 3.1 -----------------------------------------------------------------------------------------------------------


@shows("imc-3.1-1", "imc-3.1-2")
def test_commands_are_stored_and_run_later() -> None:
    desk = storing()
    for text in (x(5), "p0,128,9", "g1"):
        assert desk.query(text) == "0"
    assert desk.query("9") == "0"
    assert desk.ticks == 0
    assert desk.outputs.get("user", 0) == 0
    assert desk.query("@0S") == "0"
    assert desk.counts == (5, 0, 0, 0)
    assert desk.outputs["user"] == 9


@shows("imc-3.1-3")
def test_start_key_runs_the_program() -> None:
    desk = stored(x(500))
    desk.press("start")
    desk.run(5.0)
    assert desk.counts == (500, 0, 0, 0)


@shows("imc-3.1-3", "imc-3.2.9-2")
def test_start_key_runs_the_program_after_power_on_without_a_host() -> None:
    desk = stored("77", x(500), carriage=(2000,) * 4)
    desk.power_cycle()
    desk.press("start")
    desk.run(20.0)
    assert desk.counts == (500, 0, 0, 0)


@shows("imc-3.1-3")
def test_start_key_does_nothing_while_something_runs_or_is_stored() -> None:
    desk = stored(x(500))
    desk.start("@0A-900,900,0,30,0,30,0,30")
    desk.run(0.3)
    desk.press("start")
    assert desk.finish() == "0"
    assert desk.steps.total == (-900, 0, 0, 0)
    desk.start("@0S")
    desk.run(0.3)
    desk.press("start")
    assert desk.finish() == "0"
    assert desk.steps.total == (-400, 0, 0, 0)
    desk = storing()
    assert desk.query(x(500)) == "0"
    desk.press("start")
    assert desk.query("9") == "0"
    assert desk.ticks == 0


WORKPIECE = [
    "N7",
    "j400",
    "J50",
    "p0,128,128",
    "02000,5000,500,900,100,900,-100,900",
    "010,900,20,900,0,30,0,30",
    "3 2,-1",
    "f-1",
    "y400,1500,119,-141,141,-1,-1",
    "3 1,-5",
    "o0,3,1,3",
    "0-7,900,0,30,0,30,0,30",
    "3 0,2",
    "011,900,0,30,0,30,0,30",
    "5 7",
    "z1",
    "0100,900,50,900,200,900,9,900",
    "z0",
    "e1",
    "f0",
    "w800,2000,0,100,0,-1,-1,40",
    "p0,7,0",
    "m0,5000,0,5000,0,5000,0,30",
]
"""Nested loops, a branch on a user input, a wait, port outputs, arcs, a helix."""


def one_by_one(desk: Desk, user_3: bool) -> None:
    """The same, as a host would do it command by command."""
    for text in ("@0N7", "@0j400", "@0J50", "@0B0,128"):
        assert desk.query(text) == "0"
    for _ in range(2):
        assert desk.query("@0A2000,5000,500,900,100,900,-100,900") == "0"
        for _ in range(3):
            assert desk.query("@0A10,900,20,900,0,30,0,30") == "0"
        assert desk.query("@0f-1") == "0"
        assert desk.query("@0y400,1500,119,-141,141,-1,-1") == "0"
    assert desk.query(f"@0A{11 if user_3 else -7},900,0,30,0,30,0,30") == "0"
    desk.run(0.7)
    for text in ("@0z1", "@0A100,900,50,900,200,900,9,900", "@0z0", "@0e1", "@0f0", "@0w800,2000,0,100,0,-1,-1,40"):
        assert desk.query(text) == "0"
    for text in ("@0B0,0", "@0M0,5000,0,5000,0,5000,0,30"):
        assert desk.query(text) == "0"


@shows("imc-3.1-4")
@pytest.mark.parametrize("user_3", [False, True])
@pytest.mark.parametrize("start", ["@0S", "key"])
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_a_program_makes_the_stream_of_its_commands_sent_one_by_one(controller: str, start: str, user_3: bool) -> None:
    desk = stored(*WORKPIECE, controller=controller)
    desk.set("user_3", user_3)
    if start == "key":
        desk.press("start")
        desk.finish()
    else:
        assert desk.query("@0S") == "0"
    host = ready()
    one_by_one(host, user_3)
    assert desk.steps.delta.tolist() == host.steps.delta.tolist()
    assert from_start(desk.steps).t_ns.tolist() == from_start(host.steps).t_ns.tolist()
    assert desk.counts == host.counts == (0, 0, 0, 0)
    assert desk.outputs["user"] == 0
    assert ("user", 128) in [(name, value) for _, name, value in desk.output_log]


@shows("imc-3.1-5", "imc-3.1-6")
@pytest.mark.parametrize("wrong", ["0x,900,0,30,0,30,0,30", "01,900", "@0P", "q", "01,20,0,30,0,30,0,30"])
def test_an_error_while_storing_spoils_the_program(wrong: str) -> None:
    desk = storing()
    assert desk.query(x(5)) == "0"
    assert desk.query(wrong) in ("1", "5", "7", "8", "D")
    assert desk.query("@0S") == "G"
    assert desk.query("@0i") == "G"
    assert desk.ticks == 0
    program(desk, x(7))
    assert made(desk, "@0S").total == (7, 0, 0, 0)


@shows("imc-3.2.1-1")
def test_without_its_opening_a_cnc_command_is_none() -> None:
    desk = ready()
    assert desk.query(x(5)) == "5"
    assert desk.ticks == 0


@shows("imc-3.2.1-2")
def test_opening_is_acknowledged() -> None:
    assert ready().query("@0i") == "0"


# --- 3.2.2, 3.2.16: moves ------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axes", "text", "total"),
    [
        case("imc-3.2.2-2", 1, "05000,900", (5000, 0, 0, 0)),
        case("imc-3.2.2-3", 3, "050,900,20,9000", (50, 20, 0, 0)),
        case("imc-3.2.2-4", 7, "030,800,10,900,4,90,-4,30", (30, 10, 0, 0)),
        case("imc-3.2.2-5", XYZA, "030,800,10,900,4,90,-4,30", (30, 10, 4, -4)),
        case("imc-3.2.16-2", 1, "m5000,900", (5000, 0, 0, 0)),
        case("imc-3.2.16-3", 3, "m50,900,20,9000", (50, 20, 0, 0)),
        case("imc-3.2.16-4", 7, "m30,800,10,900,4,90,0,30", (30, 10, 4, 0)),
        case("imc-3.2.16-5", XYZA, "m30,800,10,900,4,90,4,30", (30, 10, 4, 4)),
    ],
)
def test_printed_moves(axes: int, text: str, total: tuple[int, ...]) -> None:
    assert result(text, axes=axes) == total


@shows("imc-3.2.2-1")
def test_relative_moves_add_up() -> None:
    assert result(x(5), x(-2), x(40)) == (43, 0, 0, 0)


@shows("imc-3.2.2-6")
@pytest.mark.parametrize("letter", "0m")
@pytest.mark.parametrize(("axes", "pairs"), [(1, 1), (3, 2), (7, 4), (XYZA, 4)])
def test_number_of_pairs(letter: str, axes: int, pairs: int) -> None:
    for given in range(1, 6):
        reply = storing(axes).query(letter + ",".join(["0,900"] * given))
        assert reply == ("0" if given == pairs else "7"), given


@shows("imc-3.2.2-7")
def test_2_5d_in_a_program() -> None:
    stream = made(stored("0300,1000,-100,900,40,500,-40,250"), "@0S")
    assert stream.delta.tolist() == np.concatenate([line(300, -100), line(0, 0, 40), line(0, 0, -40)]).tolist()


@shows("imc-3.2.16-1", "imc-3.2.16-6")
def test_absolute_moves() -> None:
    assert result(x(5), "m100,900,-7,900,3,900,99,900") == (100, -7, 3, 0)


# --- 3.2.3, 3.2.4: synchronisation ---------------------------------------------------------------------------------


@shows("imc-3.2.3-1")
def test_character_is_sent_in_its_turn() -> None:
    desk = stored(x(5), "133", x(5), "1126")
    mark = len(desk.replies)
    assert desk.query("@0S") == "!~0"
    first, second = (t for t, data in desk.replies[mark:] if data[:1] in b"!~")
    assert first == desk.steps.t_ns[4]
    assert second == desk.steps.t_ns[9]


@pytest.mark.parametrize(("command"), [case("imc-3.2.3-2", "1{}"), case("imc-3.2.4-5", "2{},1")])
@pytest.mark.parametrize(("code", "reply"), [(32, "1"), (33, "0"), (126, "0"), (127, "1"), (0, "1")])
def test_codes_of_characters(command: str, code: int, reply: str) -> None:
    assert storing().query(command.format(code)) == reply


@shows("imc-3.2.4-1", "imc-3.2.4-2", "imc-3.2.4-3")
@pytest.mark.parametrize(("byte", "steps"), [(b"!", 205), (b"a", 215)])
def test_waiting_for_a_character(byte: bytes, steps: int) -> None:
    desk = stored(x(5), "233,2", x(10), x(200))
    desk.start("@0S")
    desk.run(20.0)
    assert desk.counts[0] == 5
    assert desk.read() == ""
    desk.send(byte)
    assert desk.finish() == "0"
    assert desk.counts[0] == steps


@shows("imc-3.2.4-2", "imc-3.2.4-4")
def test_printed_wait_goes_ten_commands_back() -> None:
    desk = storing()
    for text in (x(1000), *[x(1)] * 10, "233,-10", "9"):
        assert desk.query(text) == "0"
    desk.start("@0S")
    desk.run(2.0)
    assert desk.counts[0] == 1010
    desk.send(b"!")
    desk.run(1.0)
    assert desk.counts[0] == 1020
    desk.send(b".")
    assert desk.finish() == "0"
    assert desk.counts[0] == 1020


# --- 3.2.5: loops and branches -------------------------------------------------------------------------------------


@shows("imc-3.2.5-1")
def test_loop_then_the_command_behind_it() -> None:
    assert result(x(1), x(10), "3 2,-1", x(1000)) == (1031, 0, 0, 0)


@pytest.mark.parametrize(
    ("lines", "steps"),
    [
        case("imc-3.2.5-2", [x(1), "3 25,-1"], 26),
        case("imc-3.2.5-4", ["3 0,5", x(1), x(10), x(100), x(1000), x(5)], 5),
        case("imc-3.2.5-5", [x(1000), *[x(1)] * 5, "3 6,-5"], 1035),
    ],
)
def test_printed_loops_and_branches(lines: list[str], steps: int) -> None:
    assert result(*lines) == (steps, 0, 0, 0)


@shows("imc-3.2.5-3")
def test_printed_branch_five_commands_back() -> None:
    desk = stored(x(1000), "o0,0,1,6", x(1), x(2), x(3), "5 1", "3 0,-5", x(50))
    desk.start("@0S")
    desk.run(5.0)
    desk.set("user_0", True)
    assert desk.finish() == "0"
    laps, rest = divmod(desk.counts[0] - 1000 - 50, 6)
    assert rest == 0
    assert laps > 10


@shows("imc-3.2.5-6")
@pytest.mark.parametrize(("count", "reply"), [(1, "0"), (32_767, "0"), (32_768, "1"), (-1, "1")])
def test_count_of_a_loop(count: int, reply: str) -> None:
    desk = storing()
    assert desk.query(x(1)) == "0"
    assert desk.query(f"3{count},-1") == reply


@shows("imc-3.2.5-7")
@pytest.mark.parametrize("offset", [-32_769, 32_768])
def test_offset_of_a_branch(offset: int) -> None:
    desk = storing()
    assert desk.query(x(1)) == "0"
    assert desk.query(f"3 0,{offset}") == "1"


@shows("imc-3.2.5-8")
def test_seven_loops_in_one_another() -> None:
    assert result(x(1), *[f"3 1,-{depth}" for depth in range(1, 8)]) == (2**7, 0, 0, 0)


@shows("imc-3.2.5-8")
def test_loops_in_sequence_are_not_nested() -> None:
    """Eight loops behind one another, and the last of them within six more: seven deep."""
    assert result(*[x(1), "3 1,-1"] * 8) == (16, 0, 0, 0)
    assert result(*[x(1), "3 1,-1"] * 8, *[f"3 1,-{depth}" for depth in range(2, 8)]) == (14 + 2**7, 0, 0, 0)


@shows("imc-3.2.5-9")
def test_eight_loops_in_one_another() -> None:
    assert refused(x(1), *[f"3 1,-{depth}" for depth in range(1, 9)])


@shows("imc-3.2.5-10")
@pytest.mark.parametrize("text", ["3 5,1", "3 5,0"])
def test_loops_go_back(text: str) -> None:
    desk = storing()
    assert desk.query(x(1)) == "0"
    assert desk.query(text) == "1"


@shows("imc-3.2.5-11")
@pytest.mark.parametrize("text", ["3 0,-3", "3 2,-3", "o0,0,0,-3", "3 0,-32768"])
def test_branch_before_the_beginning(text: str) -> None:
    assert refused(x(1), x(1), text, x(1))
    assert not refused(x(1), x(1), "3 2,-2", x(1))


@shows("imc-3.2.5-12")
@pytest.mark.parametrize("text", ["3 0,5", "o0,0,0,5", "3 0,32767"])
def test_branch_behind_the_end(text: str) -> None:
    assert refused(x(1), text, x(1), x(1))
    assert not refused(x(1), "3 0,2", x(1), x(1))


# --- 3.2.6: delay --------------------------------------------------------------------------------------------------


@shows("imc-3.2.6-1")
@pytest.mark.parametrize("tenths", [50, 1, 0])
def test_delay(tenths: int) -> None:
    stream = made(stored(x(5), f"5 {tenths}", x(5)), "@0S")
    first = pulse_times_ns(5, 900)[0]
    assert stream.t_ns[5] - stream.t_ns[4] == first + tenths * 100_000_000


@shows("imc-3.2.6-2")
def test_stop_key_does_not_cut_a_delay() -> None:
    desk = stored(x(5), "5 50", x(5))
    desk.start("@0S")
    desk.run(1.0)
    desk.press("stop")
    desk.run(3.9)
    assert desk.read() == ""
    assert desk.ticks == 5
    assert desk.finish() == "0"
    assert desk.ticks == 10
    assert desk.steps.t_ns[5] - desk.steps.t_ns[4] == 5_000_000_000 + pulse_times_ns(5, 900)[0]


# --- 3.2.7: until a port event -------------------------------------------------------------------------------------


@shows("imc-3.2.7-1", "imc-3.2.7-3")
def test_condition_on_the_byte() -> None:
    desk = stored("60,128,1", x(9000), x(7))
    desk.set("user_1", True)
    desk.at(1.0, lambda: desk.set("user_0", True))  # 3: not the value
    desk.at(2.0, lambda: desk.set("user_1", False))  # 1
    stream = made(desk, "@0S")
    assert 1790 <= stream.total[0] <= 1810
    assert len(stream) < 1810 + 7


@shows("imc-3.2.7-2", "imc-3.2.7-3")
def test_condition_on_a_bit() -> None:
    desk = stored("60,1,0", x(9000), x(7))
    desk.set("user_1", True)
    desk.set("user_7", True)
    desk.at(2.0, lambda: desk.set("user_1", False))
    assert 1790 <= made(desk, "@0S").total[0] <= 1810


@shows("imc-3.2.7-3")
def test_condition_of_one_move_only() -> None:
    """It still holds when the second move begins, which is made in full."""
    desk = stored("60,0,1", x(9000), "00,900,7,900,0,900,0,900")
    desk.at(1.0, lambda: desk.set("user_0", True))
    stream = made(desk, "@0S")
    assert 890 <= stream.total[0] <= 910
    assert stream.total[1] == 7


@shows("imc-3.2.7-4")
def test_condition_that_is_never_met() -> None:
    assert result("60,128,77", x(900), x(-3)) == (897, 0, 0, 0)


# --- 3.2.8: reference run ------------------------------------------------------------------------------------------


@shows("imc-3.2.8-1", "imc-3.2.8-4")
def test_printed_reference_runs() -> None:
    desk = stored("77", "78", "0100,900,0,900,0,900,0,900", axes=XYZA)
    assert desk.query("@0S") == "0"
    assert desk.counts == (100, 0, 0, 0)
    assert desk.carriage[3] < 100


@shows("imc-3.2.8-2")
@pytest.mark.parametrize("number", AXES_NAMED)
def test_reference_run_of_the_axes_named(number: int) -> None:
    stream = made(stored(f"7{number}", axes=XYZA, carriage=(2000,) * 4), "@0S")
    moved = {axis for axis in range(4) if (stream.delta[:, axis] != 0).any()}
    assert moved == set(AXES_NAMED[number])


@shows("imc-3.2.8-3")
def test_order_of_the_reference_run() -> None:
    stream = made(stored("77", carriage=(2000,) * 4), "@0S")
    axis = np.argmax(stream.delta != 0, axis=1)
    assert axis[np.flatnonzero(np.diff(axis, prepend=-1))].tolist() == [2, 1, 0]


@shows("imc-3.2.8-5")
@pytest.mark.parametrize(("axes", "number"), [(1, 2), (3, 7), (7, 8), (7, 9)])
def test_reference_run_of_an_axis_that_is_not_there(axes: int, number: int) -> None:
    assert storing(axes).query(f"7{number}") == "3"


@shows("imc-3.2.8-6")
def test_reference_run_leaves_3d() -> None:
    stream = made(stored("z1", "77", "00,900,0,900,30,900,-10,900", carriage=(2000,) * 4), "@0S")
    assert (stream.delta[-40:, 2] == [1] * 30 + [-1] * 10).all()


@shows("imc-3.2.8-7")
def test_stop_key_ends_the_run_of_an_axis_without_switch() -> None:
    desk = stored("71", x(5), position_switches=())
    desk.start("@0S")
    desk.run(60.0)
    assert desk.steps.t_ns[-1] > desk.time_ns - 10_000_000
    made_before = desk.counts[0]
    desk.press("stop", 0.1)
    assert desk.finish() == "0"
    assert desk.time_ns < 70_000_000_000
    assert (
        desk.carriage[0] == MIDDLE[0] + made_before + 20 + 5
    )  # run free from where the key was pressed, then the move
    assert desk.counts == (5, 0, 0, 0)


# --- 3.2.9: end ----------------------------------------------------------------------------------------------------


@shows("imc-3.2.9-1", "imc-3.2.9-3")
def test_end_of_the_data_field() -> None:
    desk = storing()
    assert desk.query(x(5)) == "0"
    assert desk.query("9") == "0"
    assert desk.query("@0P") == hex24(0, 0, 0)
    assert desk.query(x(5)) == "5"


@shows("imc-3.2.9-2")
def test_reference_speed_is_kept_with_the_program() -> None:
    desk = initialised()
    assert desk.query("@0d777,777,777") == "0"
    program(desk, "71")
    desk.power_cycle()
    assert desk.query("@07") == "0"
    stream = made(desk, "@0S")
    assert 1e9 / np.diff(stream.t_ns).min() == pytest.approx(777, rel=1e-5)


@shows("imc-3.2.9-4", "imc-2.2.23-5")
def test_a_program_without_its_end_cannot_be_run() -> None:
    desk = storing()
    assert desk.query(x(5)) == "0"
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0S") == "G"
    assert desk.query("@0i") == "G"
    assert desk.ticks == 0


# --- 3.2.10 to 3.2.18: settings ------------------------------------------------------------------------------------


@shows("imc-3.2.10-1")
def test_printed_reference_speeds() -> None:
    desk = stored("d2500,1000,1200,800", "77", "78", axes=XYZA, carriage=(2000,) * 4)
    stream = made(desk, "@0S")
    for axis, speed in enumerate((2500, 1000, 1200, 800)):
        t_ns = stream.t_ns[stream.delta[:, axis] != 0]
        assert 1e9 / np.diff(t_ns).min() == pytest.approx(speed, rel=1e-5)


@pytest.mark.parametrize(
    ("text", "replies"),
    [
        case("imc-3.2.10-2", "d2500,1000,29,800", "D"),
        case("imc-3.2.14-2", "j19", "1D"),
        pytest.param("j4001", "1D", marks=shows("imc-3.2.14-2")),
        case("imc-3.2.15-2", "J0", "1"),
        pytest.param("J4001", "1", marks=shows("imc-3.2.15-2")),
        pytest.param("e3", "1", marks=shows("imc-3.2.11-1")),
        pytest.param("f1", "1", marks=shows("imc-3.2.12-1")),
        pytest.param("g2", "1", marks=shows("imc-3.2.13-1")),
        pytest.param("n9", "3", marks=shows("imc-3.2.17-1")),
        pytest.param("N9", "3", marks=shows("imc-3.2.18-1")),
        pytest.param("T2", "1", marks=shows("imc-3.2.21-1")),
        pytest.param("z2", "1", marks=shows("imc-3.2.24-1")),
        pytest.param("w400,29,119,-141,141,-1,-1,5", "D", marks=shows("imc-3.2.22-1")),
        pytest.param("y400,40001,119,-141,141,-1,-1", "D", marks=shows("imc-3.2.23-1")),
        pytest.param("y400,1500,119,-141,141,-1", "7", marks=shows("imc-3.2.23-1")),
        pytest.param("51,2", "7", marks=shows("imc-3.2.6-1")),
        pytest.param("5-1", "1", marks=shows("imc-3.2.6-1")),
        pytest.param("60,8,1", "1", marks=shows("imc-3.2.7-2")),
        pytest.param("64,0,1", "1", marks=shows("imc-3.2.7-1")),
        pytest.param("60,128,256", "1", marks=shows("imc-3.2.7-1")),
    ],
)
def test_values_out_of_range(text: str, replies: str) -> None:
    assert storing(XYZA).query(text) in list(replies)


@shows("imc-3.2.11-1", "imc-3.2.11-2", "imc-3.2.12-1")
@pytest.mark.parametrize(
    ("plane", "sense", "total"),
    [
        (0, "f-1", (-100, 100, 0, 0)),
        (1, "f-1", (-100, 0, 100, 0)),
        (2, "f-1", (0, -100, 100, 0)),
        (0, "f0", (-100, -100, 0, 0)),
        (1, "f0", (-100, 0, -100, 0)),
    ],
)
def test_plane_and_sense(plane: int, sense: str, total: tuple[int, ...]) -> None:
    arc = "y200,1500,-50,100,0,-1,1" if sense == "f-1" else "y200,1500,50,100,0,-1,-1"
    desk = stored(f"e{plane}", sense, arc, x(0), sense, arc)
    stream = made(desk, "@0S")
    assert stream.total == tuple(2 * n for n in total)
    first, second = stream.delta[:200], stream.delta[200:]
    assert first.tolist() == second.tolist()


@shows("imc-3.2.13-1")
def test_brake() -> None:
    for value in (0, 1, 0):
        desk = stored(f"g{1 - value}", "5 1", f"g{value}")
        assert desk.query("@0S") == "0"
        assert desk.outputs["brake"] == value


@pytest.mark.parametrize(
    ("setting", "law"),
    [
        case("imc-3.2.14-1", "j300", {"start_stop_hz": 300}),
        pytest.param("j1234", {"start_stop_hz": 1234}, marks=shows("imc-3.2.14-1")),
        case("imc-3.2.15-1", "J100", {"acceleration_hz_ms": 100}),
        pytest.param("J33", {"acceleration_hz_ms": 33}, marks=shows("imc-3.2.15-1")),
    ],
)
def test_ramps(setting: str, law: dict[str, int]) -> None:
    desk = ready()
    assert desk.query("@0j999") == "0"
    assert desk.query("@0J999") == "0"
    law = {"start_stop_hz": 999, "acceleration_hz_ms": 999, **law}
    program(desk, setting, x(300, 2000))
    stream = made(desk, "@0S")
    expected = pulse_times_ns(300, 2000, **law)
    assert (stream.t_ns - stream.t_ns[0]).tolist() == [t - expected[0] for t in expected]


@shows("imc-3.2.17-1", "imc-3.2.17-2")
@pytest.mark.parametrize("number", [7, 1, 8])
def test_virtual_zero(number: int) -> None:
    out = "0100,900,100,900,100,900,100,900"
    desk = stored(out, f"n{number}", "m10,900,10,900,10,900,10,900", axes=XYZA)
    assert desk.query("@0S") == "0"
    assert desk.counts == tuple(110 if axis in AXES_NAMED[number] else 10 for axis in range(4))
    assert result(out, f"n{number}", out, axes=XYZA) == (200, 200, 200, 200)


@shows("imc-3.2.18-1")
@pytest.mark.parametrize("number", [7, 1, 8])
def test_simulated_reference_run(number: int) -> None:
    desk = stored("0100,900,100,900,100,900,100,900", f"N{number}", axes=XYZA)
    assert desk.query("@0S") == "0"
    assert desk.counts == tuple(0 if axis in AXES_NAMED[number] else 100 for axis in range(4))


@shows("imc-3.2.18-1")
def test_simulated_reference_run_allows_the_moves_behind_it() -> None:
    desk = initialised(carriage=MIDDLE)
    program(desk, "N7", x(5))
    assert desk.query("@0S") == "0"
    assert desk.counts == (5, 0, 0, 0)


# --- 3.2.19: branch on an input ------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("text", "value"), [case("imc-3.2.19-1", "o0,128,1,-1", 1), case("imc-3.2.19-2", "o0,0,1,-1", 3)]
)
def test_printed_waits(text: str, value: int) -> None:
    """Waiting: as long as the port has the value, one command back, to a short delay."""
    desk = stored("5 1", text, x(5))
    for bit in range(8):
        desk.set(f"user_{bit}", bool(value >> bit & 1))
    desk.start("@0S")
    desk.run(10.0)
    assert desk.ticks == 0
    desk.set("user_0", False)
    assert desk.finish() == "0"
    assert desk.ticks == 5


@shows("imc-3.2.19-1")
def test_byte_must_be_equal() -> None:
    desk = stored("o0,128,1,2", x(5))
    desk.set("user_0", True)
    desk.set("user_4", True)
    assert made(desk, "@0S").total == (5, 0, 0, 0)


@shows("imc-3.2.19-3", "imc-3.2.19-4")
@pytest.mark.parametrize(("bit_0", "steps"), [(True, 100), (False, 111)])
def test_printed_branch(bit_0: bool, steps: int) -> None:
    desk = stored("o0,0,1,3", x(1), x(10), x(100))
    desk.set("user_0", bit_0)
    assert made(desk, "@0S").total == (steps, 0, 0, 0)


@shows("imc-3.2.19-5")
@pytest.mark.parametrize(
    ("port", "bit", "rest", "name", "state"),
    [
        (1, 4, 1, "stop", "down"),
        (1, 5, 0, "probe", "touched"),
        (2, 7, 0, "key", "setup"),
        (3, 6, 1, "limit_a1", "open"),
    ],
)
def test_status_ports_in_branches(port: int, bit: int, rest: int, name: str, state: str) -> None:
    """At rest the bit has the value `rest` and the program skips a command."""
    desk = stored(f"o{port},{bit},{rest},2", x(1), x(10))
    assert made(desk, "@0S").total == (10, 0, 0, 0)
    desk.set(name, state)
    assert made(desk, "@0S").total == (11, 0, 0, 0)


@shows("imc-3.2.19-6")
@pytest.mark.parametrize("text", ["o4,0,1,1", "o0,8,1,1", "o0,127,1,1", "o0,0,2,1", "o0,128,256,1", "o0,128,-1,1"])
def test_wrong_branches(text: str) -> None:
    assert storing().query(text) == "1"


# --- 3.2.20: ports -------------------------------------------------------------------------------------------------


@shows("imc-3.2.20-1", "imc-3.2.20-2")
def test_printed_ports() -> None:
    desk = stored("p0,128,1")
    assert desk.query("@0B0,255") == "0"
    assert desk.query("@0S") == "0"
    assert desk.outputs["user"] == 1
    program(desk, "p0,0,1")
    assert desk.query("@0B0,96") == "0"
    assert desk.query("@0S") == "0"
    assert desk.outputs["user"] == 97


@shows("imc-3.2.20-2")
def test_one_bit_can_be_cleared() -> None:
    desk = stored("p0,5,0")
    assert desk.query("@0B0,255") == "0"
    assert desk.query("@0S") == "0"
    assert desk.outputs["user"] == 255 - 32


@shows("imc-3.2.20-3")
@pytest.mark.parametrize(
    ("text", "output", "value"),
    [
        ("p1,128,0", "hood_release", 0),
        ("p2,128,1", "spindle", 1),
        ("p2,0,1", "spindle", 1),
        ("p3,128,0", "stages", 0),
        ("p4,128,200", "analog", 200),
        ("p5,128,0", "current_lowering", 0),
        ("p6,128,0", "brake", 0),
        ("p100,4,1", "spindle", 1),
        ("p101,7,1", "lamp_fault", 1),
    ],
)
def test_all_ports_in_programs(text: str, output: str, value: int) -> None:
    desk = stored(text)
    assert desk.query("@0S") == "0"
    assert desk.outputs[output] == value


@shows("imc-3.2.20-4")
@pytest.mark.parametrize("text", ["p7,128,1", "p0,8,1", "p0,0,2", "p0,128,256", "p2,128,2", "p99,0,1"])
def test_wrong_ports(text: str) -> None:
    assert storing().query(text) == "1"


@shows("imc-3.2.20-5")
def test_ports_change_in_their_turn() -> None:
    desk = stored(x(100), "p0,128,55", x(100))
    begin = desk.time_ns
    assert desk.query("@0S") == "0"
    change = next(t for t, name, value in desk.output_log if t > begin and (name, value) == ("user", 55))
    assert desk.steps.t_ns[99] <= change < desk.steps.t_ns[100]


# --- 3.2.21 to 3.2.24 ----------------------------------------------------------------------------------------------


@shows("imc-3.2.21-1")
def test_test_mode() -> None:
    desk = stored(x(5), "T1", "77", "T0")
    assert made(desk, "@0S").total == (5, 0, 0, 0)
    assert desk.counts == (0, 0, 0, 0)
    assert made(desk, "@0R1").total[0] < -1000


@shows("imc-3.2.22-1")
def test_printed_helix() -> None:
    desk = stored("f-1", "w32000,600,-1000,-2000,0,1,-1,6000", position_switches=())
    stream = made(desk, "@0S")
    host = ready(position_switches=())
    assert host.query("@0f-1") == "0"
    assert host.query("@0w32000,600,-1000,-2000,0,1,-1,6000") == "0"
    assert len(stream) == 32_000
    assert stream.total[2] == 6000
    assert (stream.delta == host.steps.delta).all()


@shows("imc-3.2.23-1")
def test_printed_arc() -> None:
    stream = made(stored("f-1", "y400,1500,119,-141,141,-1,-1"), "@0S")
    path = stream.path()[:, :2] + (-141, 141)
    assert len(stream) == 400
    assert tuple(path[-1]) == (-141, -141)
    assert off_circle(path, 200) <= 1


@shows("imc-3.2.24-1")
def test_3d() -> None:
    stream = made(stored("z1", "0100,1000,50,900,-30,900,25,900", "z0", "00,900,0,900,5,900,-5,900"), "@0S")
    assert stream.delta[:100].tolist() == line(100, 50, -30).tolist()
    assert len(stream) == 110


# --- power lost ----------------------------------------------------------------------------------------------------


@shows("imc-3.2.9-4", "imc-2.2.17-1", "imc-2.2.13-3")
@pytest.mark.parametrize("command", ["@0k", "9", "@0IW"])
def test_power_lost_at_any_write_leaves_the_old_program_or_the_new_state(command: str) -> None:
    """Every flash image that was ever handed out is a point at which the mains could have failed."""
    desk = ready()
    program(desk, x(5))
    if command == "9":
        for text in ("@0k", "@0i", x(7), x(70)):
            assert desk.query(text) == "0"
    before, mark = desk.flash, len(desk.flash_log)
    desk.start(command)
    desk.finish()
    images = [image for _, image in desk.flash_log[mark:]]
    assert images
    for image in [before, *images]:
        cut = fresh(flash=image, carriage=MIDDLE)
        assert cut.query("@07") == "0"
        assert cut.query("@0N7") == "0"
        reply = cut.query("@0S")
        if command == "@0IW":
            assert (reply, cut.counts[0]) == ("0", 5)
        elif command == "@0k":
            assert (reply, cut.counts[0]) in (("0", 5), ("G", 0))
        else:
            assert (reply, cut.counts[0]) in (("0", 77), ("G", 0))


@shows("imc-2.2.17-1")
@pytest.mark.parametrize("seconds", [0.001, 1.0, 1.999, 2.001])
def test_mains_off_while_erasing(seconds: float) -> None:
    desk = stored(x(5))
    desk.start("@0k")
    desk.run(seconds)
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert (desk.query("@0S"), desk.ticks) in (("0", 5), ("G", 0))


@shows("imc-5-30")
def test_a_new_device_has_no_program() -> None:
    assert initialised().query("@0S") == "G"


@shows("imc-2.2.13-4")
def test_a_program_needs_the_axes() -> None:
    desk = fresh()
    assert desk.query("@0i") == "4"
    assert desk.query("@0k") == "0"
