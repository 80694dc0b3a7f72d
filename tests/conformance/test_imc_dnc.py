"""iMC, chapter 1 and sections 2.1 to 2.2.18: overview, axes, moves, ports, settings."""

from __future__ import annotations

import math
import re
from collections.abc import Callable
from decimal import Context, Decimal, localcontext

import numpy as np
import pytest
import unknown
from conformance.closed_forms import hex24, line, pulse_times_ns, stop_times_ns, times_ns
from conformance.imc_desk import CONTROLLERS, MIDDLE, TRAVEL, XYZA, fresh, initialised, made, program, ready, stored
from conformance.rows import case, shows

from isel_twin.testing import Desk, Ticks

# --- 1: every command of the overviews exists ---------------------------------------------------------------------

DNC_CALLS = [
    "@01",
    "@03",
    "@07",
    "@08",
    "@0a1,900,0,30,0,30,0,30",
    "@0A1,900,0,30,0,30,0,30",
    "@0b0",
    "@0B0,0",
    "@0d900,900,900",
    "@0DRp",
    "@0e0",
    "@0f0",
    "@0F1",
    "@0g0",
    "@0G0",
    "@0h",
    "@0H",
    "@0i",
    "@0IR0",
    "@0j300",
    "@0J100",
    "@0k",
    "@0m1,900,0,30,0,30,0,30",
    "@0M1,900,0,30,0,30,0,30",
    "@0n1",
    "@0N1",
    "@0P",
    "@0r1",
    "@0R1",
]
CNC_CALLS = [
    "01,900,0,30,0,30,0,30",
    "133",
    "233,1",
    "30,1",
    "51",
    "60,0,0",
    "77",
    "9",
    "d900,900,900,900",
    "e0",
    "f0",
    "g0",
    "j300",
    "J100",
    "m1,900,0,30,0,30,0,30",
    "n1",
    "N1",
    "o0,0,0,1",
    "p0,0,0",
    "T0",
    "w4,900,0,1,0,-1,1,4",
    "y4,900,0,1,0,-1,1",
    "z0",
]
INI_CALLS = [
    "@0Id900,900,900,900",
    "@0IF20,20,20,20",
    "@0IJ100",
    "@0Ij300",
    "@0IO0",
    "@0IE57343",
    "@0Ie0",
    "@0ID0",
    "@0IR0",
    "@0IT0",
    "@0IA0,0,0",
    "@0Ia0,0,0",
    "@0IH0,0,0",
    "@0IN0,0,0",
    "@0IC0",
    "@0IUtext",
    "@0IL",
    "@0IW",
    "@0IX",
]


@pytest.mark.parametrize("command", [case(f"imc-1-{i}", call) for i, call in enumerate(DNC_CALLS, 1)])
def test_dnc_command_exists(command: str) -> None:
    for controller in CONTROLLERS:
        assert "0" in ready(controller=controller).query(command)


@shows("imc-1-30", "imc-1-31", "imc-2.2.23-3")
@pytest.mark.parametrize("letter", "sS")
def test_start_command_exists(letter: str) -> None:
    desk = stored("05,900,0,30,0,30,0,30")
    assert made(desk, f"@0{letter}").total == (5, 0, 0, 0)


@pytest.mark.parametrize(
    "command",
    [
        case("imc-1-32", "@0T0"),
        case("imc-1-33", "@0U"),
        case("imc-1-34", "@0V"),
        case("imc-1-35", "@0?"),
        case("imc-1-37", "@0y4,900,0,1,0,-1,1"),
        case("imc-1-38", "@0z0"),
        case("imc-1-39", "@0Z0,0,1,900,1,0,0"),
    ],
)
def test_later_dnc_command_exists(command: str) -> None:
    for controller in CONTROLLERS:
        assert "0" in ready(controller=controller).query(command)


@pytest.mark.parametrize("command", [case(f"imc-1-{i}", call) for i, call in enumerate(CNC_CALLS, 40)])
def test_cnc_command_is_stored(command: str) -> None:
    for controller in CONTROLLERS:
        desk = ready(controller=controller)
        assert desk.query("@0k") == "0"
        assert desk.query("@0i") == "0"
        assert desk.query(command) == "0"


@shows("imc-1-82")
@pytest.mark.parametrize("letter", "FGMOPWYZ")
def test_capital_letters_of_the_cnc_overview(letter: str) -> None:
    """Stored in capitals, the command does the same."""
    call = next(call for call in CNC_CALLS if call[0] == letter.lower())
    small, capital = (stored("f-1", text, "02,900,0,30,0,30,0,30") for text in (call, letter + call[1:]))
    assert made(small, "@0S").delta.tolist() == made(capital, "@0S").delta.tolist()


# `@0IH` (1-75) is shown by what an open hood does to a program: test_imc_settings.py
INI_ROWS = {f"imc-1-{i}": call for i, call in enumerate(INI_CALLS, 63) if not call.startswith("@0IH")}


@pytest.mark.parametrize("command", [case(row, call) for row, call in INI_ROWS.items()])
def test_initialisation_command_exists(command: str) -> None:
    for controller in CONTROLLERS:
        assert ready(controller=controller).query(command) == "0"


# --- 2.1 -----------------------------------------------------------------------------------------------------------


@shows("imc-2.1-1", "imc-2.2.2-1", "imc-2.2.2-13")
def test_a_move_starts_with_its_carriage_return_and_is_acknowledged_at_its_last_pulse() -> None:
    desk = ready()
    desk.send(b"@0A 100,900,0,30,0,30,0,30")
    desk.run(1.0)
    assert desk.ticks == 0
    begin = desk.time_ns
    desk.send(b"\r")
    assert desk.finish() == "0"
    assert desk.steps.t_ns.tolist() == [begin + t for t in pulse_times_ns(100, 900)]
    assert desk.replies[-1] == (begin + pulse_times_ns(100, 900)[-1], b"0")


@shows("imc-2.1-2")
def test_commands_are_addressed_by_at_sign_and_device_number_0() -> None:
    desk = fresh()
    assert desk.query("@17") == ""
    assert desk.query("@07") == "0"
    assert desk.query("07") == "5"


@shows("imc-2.1-3")
def test_commands_sent_in_one_go_are_answered_in_order() -> None:
    desk = ready()
    desk.send(b"@0A 10,900,0,30,0,30,0,30\r@0P\r@0b9\r@0b0\r")
    assert desk.finish() == "0" + hex24(10, 0, 0) + "1" + "000"


# --- 2.2.1 ---------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("axes", "pairs"), [case("imc-2.2.1-1", 1, 1), case("imc-2.2.1-2", 3, 2), case("imc-2.2.1-3", 7, 4)]
)
def test_axes_decide_how_many_pairs_a_move_takes(axes: int, pairs: int) -> None:
    desk = ready(axes)
    for count in range(1, 6):
        assert desk.query("@0A" + ",".join(["0,900"] * count)) == ("0" if count == pairs else "7"), count


@shows("imc-2.2.1-4", "imc-2.2.1-6")
def test_a_axis_comes_on_top_of_the_others() -> None:
    desk = fresh(carriage=MIDDLE)
    assert desk.query("@07") == "0"
    assert desk.query("@08") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query("@0N8") == "0"
    assert made(desk, "@0A 0,900,0,900,0,900,5,900").total == (0, 0, 0, 5)
    assert desk.query("@0P") == hex24(0, 0, 0, 5)


@shows("imc-2.2.1-4")
def test_a_axis_alone() -> None:
    desk = fresh(carriage=MIDDLE)
    assert desk.query("@08") == "0"
    assert desk.query("@0R8") == "0"
    assert desk.query("@0R1") == "3"


@shows("imc-2.2.1-5")
@pytest.mark.parametrize("number", ["0", "2", "4", "5", "6", "9"])
def test_combinations_not_allowed(number: str) -> None:
    desk = fresh()
    assert desk.query(f"@0{number}") == "3"
    assert desk.query("@0A1,900") == "4"


# --- 2.2.2 and 2.2.18: moves ---------------------------------------------------------------------------------------


@shows("imc-2.2.2-2", "imc-2.2.18-2")
@pytest.mark.parametrize("letters", ["Aa", "Mm"])
def test_small_and_capital_letter_are_the_same_move(letters: str) -> None:
    first, second = (made(ready(), f"@0{letter}30,800,10,900,4,90,0,30") for letter in letters)
    assert first.t_ns.tolist() == second.t_ns.tolist()
    assert first.delta.tolist() == second.delta.tolist()


@shows("imc-2.2.2-3")
def test_relative_moves_add_up() -> None:
    desk = ready()
    for _ in range(3):
        assert desk.query("@0A100,900,-50,900,20,900,-5,900") == "0"
    assert desk.counts == (300, -150, 45, 0)


@shows("imc-2.2.18-1")
def test_absolute_moves_go_to_the_position() -> None:
    desk = ready()
    for _ in range(3):
        assert desk.query("@0M100,900,-50,900,20,900,0,900") == "0"
        assert desk.counts == (100, -50, 20, 0)


@pytest.mark.parametrize(
    ("axes", "command", "counts"),
    [
        case("imc-2.2.2-4", 1, "@0A 5000,900", (5000, 0, 0, 0)),
        case("imc-2.2.2-5", 3, "@0A 50,900,20,9000", (50, 20, 0, 0)),
        case("imc-2.2.2-6", 7, "@0A 30,800,10,900,4,90,-4,30", (30, 10, 0, 0)),
        case("imc-2.2.2-7", XYZA, "@0A 30,800,10,900,4,90,-4,30", (30, 10, 4, -4)),
        case("imc-2.2.18-3", 1, "@0M 5000,900", (5000, 0, 0, 0)),
        case("imc-2.2.18-4", 3, "@0M 50,900,20,9000", (50, 20, 0, 0)),
        case("imc-2.2.18-5", 7, "@0M 30,800,10,900,4,90,0,30", (30, 10, 4, 0)),
        case("imc-2.2.18-6", XYZA, "@0M 30,800,10,900,4,90,4,30", (30, 10, 4, 4)),
    ],
)
def test_printed_moves(axes: int, command: str, counts: tuple[int, ...]) -> None:
    desk = ready(axes)
    assert desk.query(command) == "0"
    assert desk.counts == counts


@shows("imc-2.2.2-8", "imc-2.2.18-7")
@pytest.mark.parametrize("letter", "AM")
@pytest.mark.parametrize(("axes", "pairs"), [(1, 1), (3, 2), (7, 4), (XYZA, 4)])
def test_number_of_pairs(letter: str, axes: int, pairs: int) -> None:
    desk = ready(axes)
    for count in range(1, 6):
        assert desk.query(f"@0{letter}" + ",".join(["0,900"] * count)) == ("0" if count == pairs else "7")
    assert desk.query(f"@0{letter}" + ",".join(["0,900"] * pairs) + ",0") == "7"


@shows("imc-2.2.2-9")
@pytest.mark.parametrize("text", ["@0A5000;900", "@0A5000 900", "@0A5000:900"])
def test_commas_between_numbers(text: str) -> None:
    desk = ready(1)
    assert desk.query(text) in ("1", "5", "7")
    assert desk.ticks == 0


@shows("imc-2.2.2-10")
def test_2_5d_moves_xy_then_z_down_then_z_up() -> None:
    desk = ready()
    begin = desk.time_ns
    stream = made(desk, "@0A300,1000,-100,900,40,500,-40,250")
    assert stream.delta.tolist() == np.concatenate([line(300, -100), line(0, 0, 40), line(0, 0, -40)]).tolist()
    xy, down, up = pulse_times_ns(300, 1000), pulse_times_ns(40, 500), pulse_times_ns(40, 250)
    expected = [begin + t for t in xy] + [begin + xy[-1] + t for t in down]
    assert stream.t_ns.tolist() == expected + [expected[-1] + t for t in up]


@shows("imc-2.2.2-11")
def test_fourth_pair_belongs_to_a() -> None:
    assert made(ready(XYZA), "@0A0,900,0,900,3,900,70,900").total == (0, 0, 3, 70)


@shows("imc-2.2.2-12")
@pytest.mark.parametrize("axis", range(3))
def test_axes_given_0_make_no_step(axis: int) -> None:
    steps = [0, 0, 0]
    steps[axis] = -77
    stream = made(ready(), "@0A" + ",".join(f"{n},900" for n in (*steps, 0)))
    assert stream.delta.tolist() == line(*steps).tolist()


@shows("imc-2.2.2-14", "imc-2.2.18-10")
@pytest.mark.parametrize("letter", "AM")
def test_a_command_during_a_move_waits(letter: str) -> None:
    desk = ready()
    desk.start(f"@0{letter}900,900,0,30,0,30,0,30")
    desk.run(0.1)
    desk.start("@0B0,5")
    desk.run(0.1)
    assert desk.read() == ""
    assert desk.outputs.get("user", 0) == 0
    assert desk.finish() == "00"
    assert desk.outputs["user"] == 5


@shows("imc-2.2.2-15", "imc-2.2.18-11", "imc-5-8")
@pytest.mark.parametrize("command", ["@0A5000,900", "@0M5000,900", "@0A1,900,1,900,1,900,0,900"])
def test_a_move_before_the_axes_are_set(command: str) -> None:
    desk = fresh()
    assert desk.query(command) == "4"
    assert desk.ticks == 0


@shows("imc-2.2.2-16", "imc-2.2.18-12")
@pytest.mark.parametrize("letter", "AM")
def test_travel_is_not_checked_beforehand(letter: str) -> None:
    desk = ready()
    far = 126_400 - MIDDLE[0]
    stream = made(desk, f"@0{letter}900000,30000,0,30,0,30,0,30", "2")
    assert stream.total == (far, 0, 0, 0)


@shows("imc-2.2.2-17")
@pytest.mark.parametrize(("x", "gx", "y", "gy", "speed"), [(300, 1000, 100, 5000, 1000), (100, 1000, -300, 5000, 5000)])
def test_the_longest_way_gives_the_speed(x: int, gx: int, y: int, gy: int, speed: int) -> None:
    stream = made(ready(), f"@0A{x},{gx},{y},{gy},0,30,0,30")
    expected = pulse_times_ns(300, speed)
    assert (stream.t_ns - stream.t_ns[0]).tolist() == [t - expected[0] for t in expected]
    assert stream.delta.tolist() == line(x, y).tolist()


@shows("imc-2.2.2-17", "imc-2.2.2-18")
@pytest.mark.parametrize("three_d", [0, 1])
def test_the_speed_is_that_of_the_leading_axis_and_not_of_the_path(three_d: int) -> None:
    """On the diagonal of X and Y the tool is sqrt(2) times as fast as the number given (motion/1)."""
    desk = ready()
    assert desk.query(f"@0z{three_d}") == "0"
    stream = made(desk, "@0A4000,900,4000,900,0,900,0,900")
    assert len(stream) == 4000
    assert 1e9 / 901 < (stream.t_ns[2000] - stream.t_ns[1000]) / 1000 < 1e9 / 899


def along_path_ns(steps: tuple[int, ...], speed: int) -> list[int]:
    """V along the path is V N / sqrt(sum n^2) of the leading axis, which makes N steps; ramps are step frequencies."""
    n = max(map(abs, steps))
    with localcontext(Context(prec=60)):
        return times_ns(n, Decimal(speed * n) / Decimal(sum(s * s for s in steps)).sqrt(), 300, 100_000)


@shows("imc-2.2.2-17", "imc-2.2.2-18")
@pytest.mark.parametrize("speed", [350, 5000])
@pytest.mark.parametrize("steps", [(4000, 4000, 0), (-3000, 4000, 0), (777, -301, 0), (0, -900, 0)])
@pytest.mark.parametrize("three_d", [0, 1])
def test_with_path_speed_the_number_is_the_speed_of_the_path(
    three_d: int, steps: tuple[int, int, int], speed: int
) -> None:
    """The other half of the sentence (motion/1)."""
    desk = ready(settings={"path_speed": True})
    assert desk.query(f"@0z{three_d}") == "0"
    begin = desk.time_ns
    x, y, z = steps
    stream = made(desk, f"@0A{x},{speed},{y},{speed},{z},30,0,30")
    assert stream.t_ns.tolist() == [begin + t for t in along_path_ns(steps, speed)]
    assert stream.delta.tolist() == line(x, y, z).tolist()


@shows("imc-2.2.2-18")
@pytest.mark.parametrize(("axes", "steps"), [(7, (4000, 4000, 4000)), (XYZA, (10, 50, -30, 200))])
def test_with_path_speed_all_axes_of_3d_count(axes: int, steps: tuple[int, ...]) -> None:
    desk = ready(axes, settings={"path_speed": True})
    assert desk.query("@0z1") == "0"
    begin = desk.time_ns
    pairs = [f"{n},900" for n in steps] + ["0,30"] * (4 - len(steps))
    stream = made(desk, f"@0A{','.join(pairs)}")
    assert stream.t_ns.tolist() == [begin + t for t in along_path_ns(steps, 900)]


@shows("imc-2.2.2-17", "imc-2.2.2-18")
@pytest.mark.parametrize(("steps", "factor"), [((20_000, 20_000, 0), math.sqrt(2)), ((20_000,) * 3, math.sqrt(3))])
def test_a_diagonal_takes_longer_with_path_speed(steps: tuple[int, int, int], factor: float) -> None:
    """Without ramps by as much as the diagonal is longer than the way of its leading axis."""
    took = []
    for path_speed in (False, True):
        desk = ready(settings={"path_speed": path_speed})
        for text in ("@0j900", "@0z1"):
            assert desk.query(text) == "0"
        begin = desk.time_ns
        assert desk.query(f"@0A{','.join(f'{n},900' for n in steps)},0,30") == "0"
        took.append(desk.time_ns - begin)
    assert took[1] / took[0] == pytest.approx(factor, rel=1e-6)


@shows("imc-2.2.2-17")
def test_a_stop_on_a_diagonal_with_path_speed() -> None:
    """The ramp down begins at the frequency of the leading axis, and what is left goes on at the speed of the path."""
    desk = ready(settings={"path_speed": True})
    begin = desk.time_ns
    desk.at(0.5, lambda: desk.send(b"\xfd"))
    stream = made(desk, "@0A6000,5000,6000,5000,0,30,0,30", "F")
    with localcontext(Context(prec=60)):
        leading = Decimal(5000) / Decimal(2).sqrt()
        expected = stop_times_ns(6000, leading, 300, 100_000, 500_000_000)
    assert stream.t_ns.tolist() == [begin + t for t in expected]
    mark, again = desk.ticks, desk.time_ns
    assert desk.query("@0S") == "0"
    left = 6000 - len(stream)
    with localcontext(Context(prec=60)):
        rest = times_ns(left, leading, 300, 100_000)
    assert desk.steps_since(mark).t_ns.tolist() == [again + t for t in rest]


@shows("imc-2.2.2-18", "imc-2.2.29-6")
def test_3d_takes_the_speed_of_x() -> None:
    desk = ready()
    assert desk.query("@0z1") == "0"
    begin = desk.time_ns
    stream = made(desk, "@0A10,1200,100,5000,-300,7000,0,30")
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(300, 1200)]
    assert stream.delta.tolist() == line(10, 100, -300).tolist()


@shows("imc-2.2.18-8")
def test_second_z_position_is_ignored() -> None:
    desk = ready()
    assert desk.query("@0M10,900,20,900,30,900,0,900") == "0"
    assert desk.counts == (10, 20, 30, 0)
    assert made(desk, "@0M10,900,20,900,30,900,0,900").total == (0, 0, 0, 0)
    assert made(desk, "@0M10,900,20,900,35,900,17,900").total == (0, 0, 5, 0)


@shows("imc-2.2.18-9")
def test_absolute_move_is_acknowledged_at_its_end() -> None:
    desk = ready()
    begin = desk.time_ns
    assert desk.query("@0M100,900,0,30,0,30,0,30") == "0"
    assert desk.replies[-1] == (begin + pulse_times_ns(100, 900)[-1], b"0")


# --- 2.2.3: reading ports ------------------------------------------------------------------------------------------


def port(desk: Desk, number: int) -> int:
    """A port as `@0b` reports it."""
    reply = desk.query(f"@0b{number}")
    assert len(reply) == 3
    assert reply[0] == "0"
    assert set(reply[1:]) <= set("0123456789ABCDEF")
    return int(reply[1:], 16)


@shows("imc-2.2.3-1", "imc-2.2.3-2")
def test_ports_0_and_1_are_reported_in_hexadecimal() -> None:
    desk = initialised()
    for bit in (0, 2, 5, 7):
        desk.set(f"user_{bit}", True)
    assert desk.query("@0b0") == "0A5"
    assert desk.query("@0b1") == "017"


@shows("imc-2.2.3-3")
@pytest.mark.parametrize("bit", range(8))
def test_port_0_is_the_user_inputs(bit: int) -> None:
    desk = initialised()
    assert port(desk, 0) == 0
    desk.set(f"user_{bit}", "high")
    assert port(desk, 0) == 1 << bit


@pytest.mark.parametrize(
    ("number", "bit", "name", "state", "rest"),
    [
        pytest.param(1, 0, "estop_1", "open", 1, marks=shows("imc-2.2.3-4"), id="imc-2.2.3-4-circuit-1"),
        case("imc-2.2.3-4", 1, 1, "estop_2", "open", 1),
        case("imc-2.2.3-5", 1, 2, "overtemperature", "hot", 1),
        case("imc-2.2.3-6", 1, 3, "start", "down", 0),
        case("imc-2.2.3-7", 1, 4, "stop", "down", 1),
        case("imc-2.2.3-8", 1, 5, "probe", "touched", 0),
        case("imc-2.2.3-9", 2, 0, "p2.0", True, 0),
        case("imc-2.2.3-10", 2, 1, "estop", "pressed", 1),
        case("imc-2.2.3-11", 2, 5, "hood", "open", 1),
        case("imc-2.2.3-12", 2, 6, "hood", "open", 1),
        case("imc-2.2.3-13", 2, 7, "key", "setup", 0),
    ],
)
def test_status_inputs(number: int, bit: int, name: str, state: str | bool, rest: int) -> None:
    """At rest the bit has the level `rest` (docs/architecture.md); operating the element changes it."""
    desk = initialised()
    assert desk.query("@0B1,1") == "0"  # the hood may be opened
    assert port(desk, number) >> bit & 1 == rest
    desk.set(name, state)
    assert port(desk, number) >> bit & 1 == 1 - rest


@shows("imc-2.2.3-9")
def test_spindle_input_shows_that_it_runs() -> None:
    desk = initialised()
    assert port(desk, 2) & 1 == 0
    assert desk.query("@0B2,1") == "0"
    assert port(desk, 2) & 1 == 1


@shows("imc-2.2.3-14")
@pytest.mark.parametrize("bit", range(8))
def test_port_3_is_the_limit_switches(bit: int) -> None:
    desk = initialised(carriage=MIDDLE)
    assert port(desk, 3) == 0xFF
    desk.set(f"limit_{'xyza'[bit // 2]}{bit % 2 + 1}", "open")
    assert port(desk, 3) == 0xFF & ~(1 << bit)


@shows("imc-2.2.3-15")
@pytest.mark.parametrize("number", ["4", "9", "100", "65531", "-1"])
def test_no_such_input_port(number: str) -> None:
    assert initialised().query(f"@0b{number}") == "1"


@shows("imc-2.2.3-16")
def test_ports_are_read_after_the_move() -> None:
    desk = ready()
    desk.start("@0A900,900,0,30,0,30,0,30")
    desk.run(0.1)
    desk.start("@0b0")
    desk.run(0.1)
    assert desk.read() == ""
    desk.set("user_0", True)
    assert desk.finish() == "0001"


# --- 2.2.4: writing ports ------------------------------------------------------------------------------------------


@shows("imc-2.2.4-1")
@pytest.mark.parametrize(
    ("command", "reply"),
    [("@0B0,255", "0"), ("@0B7,0", "1"), ("@0B99,0", "1"), ("@0B0,256", "1"), ("@0B0,-1", "1"), ("@0B2,2", "1")],
)
def test_writing_is_acknowledged_or_refused(command: str, reply: str) -> None:
    assert initialised().query(command) == reply


@pytest.mark.parametrize(
    ("number", "values", "output"),
    [
        case("imc-2.2.4-2", 1, (1,), "hood_release"),
        case("imc-2.2.4-3", 0, (0, 1, 90, 255), "user"),
        case("imc-2.2.4-4", 1, (0, 1, 0), "hood_release"),
        case("imc-2.2.4-5", 2, (0, 1, 0), "spindle"),
        case("imc-2.2.4-6", 3, (0, 1, 0), "stages"),
        case("imc-2.2.4-7", 4, (0, 128, 255), "analog"),
        case("imc-2.2.4-8", 5, (0, 1, 0), "current_lowering"),
        case("imc-2.2.4-9", 6, (0, 1, 0), "brake"),
    ],
)
def test_output_ports(number: int, values: tuple[int, ...], output: str) -> None:
    desk = initialised()
    for value in values:
        assert desk.query(f"@0B{number},{value}") == "0"
        assert desk.outputs[output] == value


@pytest.mark.parametrize(
    ("number", "bit", "output"),
    [
        case("imc-2.2.4-10", 100, 0, "current_lowering"),
        case("imc-2.2.4-11", 100, 2, "power_request"),
        case("imc-2.2.4-12", 100, 3, "stages"),
        case("imc-2.2.4-13", 100, 4, "spindle"),
        case("imc-2.2.4-14", 100, 5, "hood_release"),
        case("imc-2.2.4-15", 100, 6, "brake"),
        case("imc-2.2.4-16", 100, 7, "software_ok"),
        case("imc-2.2.4-17", 101, 5, "lamp_stop"),
        case("imc-2.2.4-18", 101, 6, "lamp_start"),
        case("imc-2.2.4-19", 101, 7, "lamp_fault"),
    ],
)
def test_control_and_signal_bits(number: int, bit: int, output: str) -> None:
    """Each bit alone switches its output on; without it the output is off. The brake needs holding stages (imc/23)."""
    desk = initialised()
    stages = 1 << 3 if output == "brake" else 0
    assert desk.query(f"@0B{number},{1 << bit | stages}") == "0"
    assert desk.outputs[output] == 1
    assert desk.query(f"@0B{number},0") == "0"
    assert desk.outputs[output] == 0


@shows("imc-2.2.4-20")
def test_ports_are_written_after_the_move() -> None:
    desk = ready()
    desk.start("@0A900,900,0,30,0,30,0,30")
    desk.run(0.1)
    desk.start("@0B0,7")
    assert desk.finish() == "00"
    change = next(t for t, name, value in desk.output_log if (name, value) == ("user", 7))
    assert change >= desk.steps.t_ns[-1]


@shows("imc-2.2.4-21")
@pytest.mark.parametrize("command", ["@0B0,256", "@0B0,-1", "@0B0,x"])
def test_a_wrong_value_changes_nothing(command: str) -> None:
    desk = initialised()
    assert desk.query("@0B0,42") == "0"
    assert desk.query(command) == "1"
    assert desk.outputs["user"] == 42


# --- 2.2.5: reference speed ----------------------------------------------------------------------------------------


def fastest_hz(stream: Ticks, axis: int) -> float:
    """Highest frequency between two steps of an axis."""
    t_ns = stream.t_ns[stream.delta[:, axis] != 0]
    return 1e9 / float(np.diff(t_ns).min())


@shows("imc-2.2.5-1")
def test_reference_speed_of_each_axis() -> None:
    desk = initialised()
    assert desk.query("@0d1000,3000,2000") == "0"
    stream = made(desk, "@0R7")
    for axis, speed in enumerate((1000, 3000, 2000)):
        assert fastest_hz(stream, axis) == pytest.approx(speed, rel=1e-5)


@pytest.mark.parametrize(
    ("axes", "command"),
    [
        case("imc-2.2.5-2", 1, "@0d2500"),
        case("imc-2.2.5-3", 3, "@0d2400,3000"),
        case("imc-2.2.5-4", 7, "@0d1000,3000,2000"),
        case("imc-2.2.5-5", XYZA, "@0d1000,3000,2000,2000"),
    ],
)
def test_printed_reference_speeds(axes: int, command: str) -> None:
    desk = initialised(axes)
    assert desk.query(command) == "0"
    for axis, speed in enumerate(command[3:].split(",")):
        stream = made(desk, f"@0R{1 << axis}")
        assert fastest_hz(stream, axis) == pytest.approx(int(speed), rel=1e-5)


@shows("imc-2.2.5-6")
def test_default_reference_speed() -> None:
    desk = initialised()
    assert desk.query("@0Id1100,1200,1300,1400") == "0"
    assert desk.query("@0IW") == "0"
    desk.power_cycle()
    assert desk.query("@07") == "0"
    stream = made(desk, "@0R7")
    for axis, speed in enumerate((1100, 1200, 1300)):
        assert fastest_hz(stream, axis) == pytest.approx(speed, rel=1e-5)


@shows("imc-2.2.5-7")
def test_reference_speed_is_lost_at_power_off() -> None:
    desk = initialised()
    before = fastest_hz(made(desk, "@0R1"), 0)
    assert desk.query("@0d777,777,777") == "0"
    assert fastest_hz(made(desk, "@0R1"), 0) == pytest.approx(777, rel=1e-5)
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert fastest_hz(made(desk, "@0R1"), 0) == pytest.approx(before, rel=1e-5)


@shows("imc-2.2.5-8")
@pytest.mark.parametrize(("speed", "reply"), [(29, "D"), (30, "0"), (40_000, "0"), (40_001, "D")])
def test_range_of_reference_speeds(speed: int, reply: str) -> None:
    assert initialised().query(f"@0d1000,{speed},1000") == reply


@shows("imc-2.2.5-9")
def test_one_reference_speed_an_axis() -> None:
    for axes, count in ((1, 1), (3, 2), (7, 3), (XYZA, 4)):
        desk = initialised(axes)
        for given in range(1, 6):
            reply = desk.query("@0d" + ",".join(["900"] * given))
            assert reply == ("0" if given == count else "7"), (axes, given)


# --- 2.2.6: diagnosis ----------------------------------------------------------------------------------------------


@shows("imc-2.2.6-1", "imc-2.2.6-4")
@pytest.mark.parametrize("code", ["Rp", "Rn"])
def test_diagnosis_of_free_switches(code: str) -> None:
    assert initialised(carriage=MIDDLE).query(f"@0D{code}") == "000"


@pytest.mark.parametrize(
    ("code", "other", "end"), [case("imc-2.2.6-2", "Rp", "Rn", 2), case("imc-2.2.6-3", "Rn", "Rp", 1)]
)
def test_diagnosis_of_struck_switches(code: str, other: str, end: int) -> None:
    """Switch 2 is the one in positive direction, switch 1 the one in negative direction."""
    for bit in range(4):
        desk = initialised(XYZA, carriage=MIDDLE)
        assert desk.query("@0IE65535") == "0"  # A2 is disabled by default
        desk.set(f"limit_{'xyza'[bit]}{end}", "open")
        assert desk.query(f"@0D{code}") == f"0{1 << bit:02X}"
        assert desk.query(f"@0D{other}") == "000"


@shows("imc-2.2.6-5")
@pytest.mark.parametrize("code", ["Rx", "Xp", "R", ""])
def test_unknown_diagnosis(code: str) -> None:
    assert initialised().query(f"@0D{code}") == "5"


@shows("imc-2.2.6-6")
def test_printed_diagnosis_without_meaning() -> None:
    reply = initialised().query("@0DS0")
    assert re.fullmatch(r"0[0-9A-F]{2}", reply)


# --- 2.2.10, 2.2.11, 2.2.12 ----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("command", "brake"), [case("imc-2.2.10-1", "@0g1", 1), case("imc-2.2.10-2", "@0g0", 0)])
def test_brake(command: str, brake: int) -> None:
    desk = initialised()
    assert desk.query(f"@0g{1 - brake}") == "0"
    assert desk.query(command) == "0"
    assert desk.outputs["brake"] == brake


@shows("imc-2.2.10-3")
def test_brake_knows_two_states() -> None:
    assert initialised().query("@0g2") == "1"


@shows("imc-2.2.11-1", "imc-2.2.11-2")
def test_device_number() -> None:
    desk = initialised()
    assert desk.query("@0G2") == "0"
    assert desk.query("@0P") == ""
    assert desk.query("@2P") == hex24(0, 0, 0)


@pytest.mark.parametrize(("command"), [case("imc-2.2.12-1", "@0H"), case("imc-2.2.12-2", "@0h")])
def test_state_is_sent_as_lines_of_text(command: str) -> None:
    reply = initialised().query(command)
    assert reply.endswith("0")
    text = reply[:-1]
    assert text.count("\r\n") >= 3
    assert text.replace("\r\n", "").isascii()
    assert text.replace("\r\n", "").isprintable()


@shows("imc-2.2.12-3")
@pytest.mark.parametrize(
    ("name", "state"), [("start", "down"), ("stop", "down"), ("key", "setup"), ("estop", "pressed")]
)
def test_state_text_follows_the_elements(name: str, state: str) -> None:
    desk = initialised()
    before = desk.query("@0H")
    assert desk.query("@0H") == before
    desk.set(name, state)
    assert desk.query("@0H") != before


@shows("imc-2.2.12-4")
@pytest.mark.parametrize("bit", range(7))
def test_state_text_follows_the_limit_switches(bit: int) -> None:
    desk = initialised(carriage=MIDDLE)
    before = desk.query("@0h")
    assert desk.query("@0h") == before
    desk.set(f"limit_{'xyza'[bit // 2]}{bit % 2 + 1}", "open")
    assert desk.query("@0h") != before


# --- 2.2.13, 2.2.17: storing and erasing ---------------------------------------------------------------------------


@shows("imc-2.2.13-1", "imc-2.2.13-2", "imc-3.2.1-2")
def test_while_storing_only_cnc_commands_are_accepted() -> None:
    desk = ready()
    assert desk.query("@0k") == "0"
    assert desk.query("@0i") == "0"
    assert desk.query("05,900,0,30,0,30,0,30") == "0"
    assert desk.ticks == 0
    assert desk.query("@0P") == "8"
    assert desk.query("@0P") == hex24(0, 0, 0)


@shows("imc-2.2.13-3")
def test_stored_commands_survive_in_flash() -> None:
    desk = stored("77", "0900,900,0,30,0,30,0,30")
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert desk.query("@0S") == "0"
    assert desk.counts == (900, 0, 0, 0)


@shows("imc-2.2.13-4", "imc-5-9")
def test_storing_needs_the_axes() -> None:
    assert fresh().query("@0i") == "4"


@shows("imc-2.2.13-5")
def test_storing_waits_for_the_end_of_a_move() -> None:
    desk = ready()
    assert desk.query("@0k") == "0"
    desk.start("@0A900,900,0,30,0,30,0,30")
    desk.run(0.1)
    desk.start("@0i")
    desk.run(0.1)
    assert desk.read() == ""
    desk.run(2.0)
    assert desk.read() == "00"
    assert desk.steps.total == (900, 0, 0, 0)


@shows("imc-2.2.13-6", "imc-5-31")
def test_storing_over_a_program_is_refused() -> None:
    desk = stored("05,900,0,30,0,30,0,30")
    assert desk.query("@0i") == "G"


@shows("imc-2.2.17-1", "imc-2.2.17-3")
def test_erasing() -> None:
    desk = stored("05,900,0,30,0,30,0,30")
    assert desk.query("@0k") == "0"
    assert desk.query("@0S") == "G"
    program(desk, "06,900,0,30,0,30,0,30")
    assert made(desk, "@0S").total == (6, 0, 0, 0)


@shows("imc-2.2.17-2")
def test_erasing_takes_about_two_seconds() -> None:
    desk = stored("05,900,0,30,0,30,0,30")
    begin = desk.time_ns
    desk.start("@0k")
    desk.run(1.5)
    assert desk.read() == ""
    assert desk.finish() == "0"
    assert 1.5 < (desk.replies[-1][0] - begin) / 1e9 < 2.5


# --- 2.2.14 --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "command",
    [
        case("imc-2.2.14-1", "@0ID3"),
        case("imc-2.2.14-2", "@0IR1"),
        case("imc-2.2.14-3", "@0Id1000,900,500,900"),
    ],
)
def test_printed_initialisations(command: str) -> None:
    assert fresh().query(command) == "0"
    assert initialised().query(command) == "0"


def inverted_axes(desk: Desk) -> bool:
    """X and Y run backwards, Z does not."""
    assert desk.query("@0N7") == "0"
    before = desk.carriage
    made(desk, "@0A100,900,100,900,100,900,0,30")
    return [now - was for now, was in zip(desk.carriage, before, strict=True)][:3] == [-100, -100, 100]


def reference_at_the_far_end(desk: Desk) -> bool:
    made(desk, "@0R7")
    return desk.carriage[0] > TRAVEL[0] - 100 and max(desk.carriage[1:3]) < 100


def reference_at_1000_hz(desk: Desk) -> bool:
    times = made(desk, "@0R1").t_ns
    return 1e9 / float((times[1:] - times[:-1]).min()) == pytest.approx(1000.0, rel=1e-5)


@pytest.mark.parametrize(
    ("printed", "acts"),
    [
        case("imc-2.2.14-1", "@0ID3", inverted_axes),
        case("imc-2.2.14-2", "@0IR1", reference_at_the_far_end),
        case("imc-2.2.14-3", "@0Id1000,900,500,900", reference_at_1000_hz),
    ],
)
@shows("imc-2.2.14-4")
@pytest.mark.parametrize("written", [True, False])
def test_printed_initialisations_at_the_next_power_on(
    printed: str, acts: Callable[[Desk], bool], written: bool
) -> None:
    desk = fresh(carriage=(2000, 2000, 2000, 2000))
    for command in ("@0IE65535", "@0IW", printed, *(["@0IW"] if written else [])):
        assert desk.query(command) == "0"
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert acts(desk) == written


@shows("imc-2.2.14-5")
@pytest.mark.parametrize(
    "command",
    [
        "@0Id900,900,900,900",
        "@0IF9,9,9,9",
        "@0IJ90",
        "@0Ij90",
        "@0IO1",
        "@0IE0",
        "@0Ie1",
        "@0ID1",
        "@0IR1",
        "@0IT1",
        "@0IL",
        "@0IW",
        "@0IX",
    ],
)
def test_codes_of_the_table(command: str) -> None:
    assert fresh().query(command) == "0"


@shows("imc-2.2.14-6")
@pytest.mark.parametrize("command", [pytest.param(f"{unknown.INITIAL[0]}1", id="unknown"), "@0I", "@0I1"])
def test_unknown_code(command: str) -> None:
    assert fresh().query(command) == "5"


# --- 2.2.15, 2.2.16: ramps -----------------------------------------------------------------------------------------


def ramp(desk: Desk, **law: int) -> None:
    """A move of 300 steps at 2000 Hz must follow the ramp law."""
    begin = desk.time_ns
    stream = made(desk, "@0A300,2000,0,30,0,30,0,30")
    assert stream.t_ns.tolist() == [begin + t for t in pulse_times_ns(300, 2000, **law)]


@shows("imc-2.2.15-1", "imc-2.2.15-5")
@pytest.mark.parametrize("frequency", [20, 123, 1999, 2000, 4000])
def test_start_stop_frequency(frequency: int) -> None:
    desk = ready()
    assert desk.query(f"@0j{frequency}") == "0"
    ramp(desk, start_stop_hz=frequency)


@shows("imc-2.2.15-2", "imc-2.2.15-3")
def test_default_start_stop_frequency() -> None:
    desk = ready()
    ramp(desk, start_stop_hz=300)
    assert desk.query("@0j999") == "0"
    ramp(desk, start_stop_hz=999)
    assert desk.query("@0j300") == "0"
    ramp(desk, start_stop_hz=300)


@shows("imc-2.2.15-4", "imc-2.2.16-4")
@pytest.mark.parametrize("command", ["@0j999", "@0J7"])
def test_ramps_are_forgotten_at_power_off(command: str) -> None:
    desk = ready()
    assert desk.query(command) == "0"
    desk.power_cycle()
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    ramp(desk)


@shows("imc-2.2.15-6")
@pytest.mark.parametrize("command", ["@0j19", "@0j4001", "@0j0", "@0j-300"])
def test_start_stop_frequency_out_of_range(command: str) -> None:
    desk = ready()
    assert desk.query(command) in ("1", "D")  # a number out of range that is a speed: either is true
    ramp(desk, start_stop_hz=300)


@shows("imc-2.2.16-1", "imc-2.2.16-5")
@pytest.mark.parametrize("acceleration", [1, 10, 150, 4000])
def test_acceleration(acceleration: int) -> None:
    desk = ready()
    assert desk.query(f"@0J{acceleration}") == "0"
    ramp(desk, acceleration_hz_ms=acceleration)


@shows("imc-2.2.16-2", "imc-2.2.16-3")
def test_default_acceleration() -> None:
    desk = ready()
    ramp(desk, acceleration_hz_ms=100)
    assert desk.query("@0J7") == "0"
    ramp(desk, acceleration_hz_ms=7)
    assert desk.query("@0J100") == "0"
    ramp(desk, acceleration_hz_ms=100)


@shows("imc-2.2.16-6")
@pytest.mark.parametrize("command", ["@0J0", "@0J4001", "@0J-5"])
def test_acceleration_out_of_range(command: str) -> None:
    desk = ready()
    assert desk.query(command) == "1"
    ramp(desk, acceleration_hz_ms=100)
