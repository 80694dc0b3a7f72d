"""Stored programs: limits, jumps, keys, and what no single statement of the manual covers."""

from __future__ import annotations

import numpy as np
import pytest
from from_start import from_start

from isel_twin.testing import Desk

MIDDLE = (60_000, 48_000, 22_000, 50_000)


def x(steps: int, speed_hz: int = 5000) -> str:
    return f"0{steps},{speed_hz},0,900,0,900,0,900"


def ready(**options: object) -> Desk:
    desk = Desk.of("imc-s8", carriage=MIDDLE, **options)  # type: ignore[arg-type]
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    return desk


def stored(*lines: str, **options: object) -> Desk:
    desk = ready(**options)
    for line in ("@0i", *lines, "9"):
        assert desk.query(line) == "0", line
    return desk


# --- the same as by hand ---


def test_a_program_makes_the_stream_of_the_same_commands_sent_one_by_one() -> None:
    """Nested loops, a branch, an arc, a helix, 2.5D and 3D moves, ports; only the delay has no DNC form."""
    program = stored(
        "J50", x(700), "30,2", x(9999), "f-1", "y400,1500,119,-141,141,-1,-1", "p0,0,1", "z1",
        "0100,3000,50,900,-25,900,0,900", "z0", "w400,900,119,-141,141,-1,-1,100",
        "0-40,900,30,900,20,900,-20,900", "3 1,-1", "3 2,-3", "m0,9000,0,9000,0,900,0,900",
    )  # fmt: skip
    assert program.query("@0S") == "0"

    hand = ready()
    last = "@0A-40,900,30,900,20,900,-20,900"
    turn = "@0w400,900,119,-141,141,-1,-1,100"
    commands = ["@0J50", "@0A700,5000,0,900,0,900,0,900", "@0f-1", "@0y400,1500,119,-141,141,-1,-1", "@0B0,1", "@0z1"]
    commands += ["@0A100,3000,50,900,-25,900,0,900", "@0z0", turn, last, last]
    commands += 2 * [turn, last, last] + ["@0M0,9000,0,9000,0,900,0,900"]
    for command in commands:
        assert hand.query(command) == "0", command

    first, second = from_start(program.steps), from_start(hand.steps)
    assert np.array_equal(first.delta, second.delta)
    assert np.array_equal(first.t_ns, second.t_ns)
    assert program.outputs["user"] == 1


# --- limits ---


def test_memory_is_counted_in_bytes_of_text() -> None:
    """`z1` + CR: three bytes each."""
    desk = ready(settings={"program_memory_bytes": 30})
    assert desk.query("@0i") == "0"
    assert [desk.query("z1") for _ in range(11)] == ["0"] * 10 + ["6"]
    assert desk.query("@0S") == "G"


def test_memory_holds_what_the_machine_says() -> None:
    desk = ready(settings={"program_memory_bytes": 32_768})
    desk.query("@0i")
    desk.start("\r".join(["z1"] * 1300))
    for _ in range(10):
        desk.start("\r".join(["z1"] * 1300))
        desk.finish()
    assert desk.query("9") == "5"  # 32768 bytes hold 10922 of these, so the field has ended with 6


@pytest.mark.parametrize(("depth", "reply"), [(7, "0"), (8, "1")])
def test_loops_nest_to_seven(depth: int, reply: str) -> None:
    desk = ready()
    for line in ("@0i", x(1)):
        assert desk.query(line) == "0"
    replies = [desk.query(f"3 1,-{number}") for number in range(1, depth + 1)]
    assert replies == ["0"] * (depth - 1) + [reply]
    if reply == "0":
        assert desk.query("9") == "0"
        assert desk.query("@0S") == "0"
        assert desk.counts[0] == 2**7


@pytest.mark.parametrize(
    ("lines", "replies"),
    [
        ((x(1), "3 0,-2"), "01"),
        ((x(1), "3 0,-1", "9"), "000"),
        ((x(1), "3 0,1", "9"), "000"),
        ((x(1), "3 0,2", "9"), "001"),
        (("o0,0,1,3", x(1), "9"), "001"),
        (("2 33,2", x(1), "9"), "000"),
        (("3 5,0",), "1"),
        (("3 5,1",), "1"),
        (("3 32768,-1",), "1"),
        ((x(1), "3 0,-32769"), "01"),
    ],
)
def test_jumps_stay_within_the_field(lines: tuple[str, ...], replies: str) -> None:
    desk = ready()
    assert desk.query("@0i") == "0"
    assert "".join(desk.query(line) for line in lines) == replies


def test_a_loop_left_by_a_branch_does_not_use_up_the_depth() -> None:
    """An outer loop enters and leaves an inner one by a branch ten times."""
    desk = stored(x(1), "o0,0,0,2", "3 5,-2", x(10), "3 9,-4")
    assert desk.query("@0S") == "0"
    assert desk.counts[0] == 10 * 11


def test_waiting_in_a_circle_lets_time_pass() -> None:
    desk = stored("o0,0,0,0", x(5))
    desk.start("@0S")
    desk.run(2.0)
    assert desk.counts[0] == 0
    high_ns = desk.time_ns
    desk.set("user_0", True)
    assert desk.finish() == "0"
    assert desk.steps.t_ns[0] - high_ns < 10_000_000


# --- keys and bytes ---


def test_start_key_runs_it_in_silence() -> None:
    desk = stored(x(50), "133", x(50))
    desk.press("start")
    assert desk.finish() == "!"
    assert desk.counts[0] == 100


def test_start_key_after_power_on_needs_no_host() -> None:
    """Axes come with the program; it references itself first."""
    desk = stored("77", x(500))
    desk.power_cycle()
    desk.press("start")
    assert desk.finish() == ""
    assert desk.counts == (500, 0, 0, 0)


def test_start_key_is_not_heard_while_something_runs() -> None:
    desk = stored(x(500))
    desk.start("@0A900,900,0,900,0,900,0,900")
    desk.run(0.1)
    desk.press("start")
    assert desk.finish() == "0"
    assert desk.counts[0] == 900


@pytest.mark.parametrize("how", ["stop", b"\xfd"])
@pytest.mark.parametrize("on", ["start", "@0S"])
def test_stop_and_go_on(how: str | bytes, on: str) -> None:
    desk = stored(x(3000), "51", x(3000))
    desk.start("@0S")
    desk.run(0.3)
    if isinstance(how, bytes):
        desk.send(how)
    else:
        desk.press(how)
    assert desk.finish() == "F"
    assert 0 < desk.counts[0] < 3000
    if on == "start":
        desk.press("start")
    else:
        desk.start(on)
    assert desk.finish() == "0"
    assert desk.counts[0] == 6000


def test_stop_in_a_delay_is_not_heard() -> None:
    desk = stored(x(10), "5 20", x(10))
    begin_ns = desk.time_ns
    desk.start("@0S")
    desk.run(1.0)
    desk.press("stop")
    assert desk.finish() == "0"
    assert desk.counts[0] == 20
    assert desk.time_ns - begin_ns >= 2_000_000_000


def test_stop_while_waiting_for_a_character() -> None:
    desk = stored("2 33,2", x(10), x(100))
    desk.start("@0S")
    desk.run(0.5)
    desk.press("stop")
    assert desk.finish() == "F"
    desk.start("@0S")
    desk.send(b"!")
    assert desk.finish() == "0"
    assert desk.counts[0] == 100


def test_break_ends_the_program() -> None:
    desk = stored(x(3000), x(3000))
    desk.start("@0S")
    desk.run(0.3)
    desk.send(b"\xff")
    assert desk.finish() == "F"
    assert desk.query("@0S") == "0"  # from its beginning


def test_program_ends_with_the_code_of_the_command_that_fails() -> None:
    desk = stored("p0,0,1", x(10), "p0,1,1")
    desk.send(b"\xfe")
    assert desk.query("@07") == "0"
    assert desk.query("@0S") == "R"
    assert desk.outputs["user"] == 1


def test_program_stored_for_other_axes() -> None:
    desk = stored(x(10))
    assert desk.query("@03") == "0"
    assert desk.query("@0S") == "3"
    assert desk.counts[0] == 0


def test_condition_is_for_one_move() -> None:
    desk = stored("6 0,0,1", x(9000), x(10))
    desk.start("@0S")
    desk.run(0.5)
    desk.set("user_0", True)
    assert desk.finish() == "0"
    stopped = desk.counts[0] - 10
    assert 2000 < stopped < 3000


def test_error_signal() -> None:
    """`@0Ia0,3,1`: 1 after an error, its complement 2 while all is well; other bits stay."""
    desk = stored(x(10), "3 0,-1")
    for command in ("@0Ia0,3,1", "@0B0,240"):
        assert desk.query(command) == "0"
    desk.start("@0S")
    desk.run(0.5)
    assert desk.outputs["user"] == 240 + 2
    desk.set("estop", "pressed")
    assert desk.finish() == "9"
    assert desk.outputs["user"] == 240 + 1


def test_condition_without_a_move_ends_with_the_program() -> None:
    desk = stored(x(10), "6 0,0,0")
    assert desk.query("@0S") == "0"
    assert desk.query("@0A100,900,0,900,0,900,0,900") == "0"
    assert desk.counts[0] == 110


def test_speed_of_a_second_z_way_stored_in_3d() -> None:
    """In 3D the fourth pair is ignored, so it is stored as it is; travelled in 2.5D it is judged."""
    desk = ready()
    for line in ("@0z1", "@0i", "z0", "010,900,0,900,0,900,5,0", "9"):
        assert desk.query(line) == "0", line
    assert desk.query("@0S") == "D"
