"""iMC, section 5: every reply code, and the safety chain behind `2`, `9`, `F`, `H` and `R`."""

from __future__ import annotations

import string

import numpy as np
import pytest
import unknown
from conformance.closed_forms import hex24, pulse_times_ns
from conformance.imc_desk import MIDDLE, fresh, initialised, made, program, ready, stored
from conformance.rows import shows

from isel_twin.testing import Desk

OUT = "@0A10,900,0,900,0,900,0,900"
LONG = "@0A20000,5000,-7000,900,300,900,-100,900"


@shows("imc-5-1")
def test_0_then_the_next_command() -> None:
    desk = ready()
    for _ in range(5):
        assert desk.query(OUT) == "0"
    assert desk.counts == (50, 0, 0, 0)


@shows("imc-5-2")
@pytest.mark.parametrize("text", ["@0j3x0", "@0Jabc", "@0B0,1z", "@0A1O,900,0,900,0,900,0,900", "@0d900,--9,900"])
def test_1_letters_in_a_number(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "1"
    assert desk.ticks == 0


@shows("imc-5-3")
@pytest.mark.parametrize("text", ["@0J4001", "@0B0,300", "@0b9", "@0e7", "@0A99999999,900,0,900,0,900,0,900"])
def test_1_a_number_out_of_range(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "1"
    assert desk.ticks == 0


@shows("imc-5-4")
@pytest.mark.parametrize("axis", range(3))
@pytest.mark.parametrize("sign", [1, -1])
def test_2_the_stream_ends_with_the_pulse_that_strikes(axis: int, sign: int) -> None:
    desk = ready()
    far = (126_400, 96_000, 44_800)[axis]
    expected = far - MIDDLE[axis] if sign > 0 else MIDDLE[axis]
    steps = [0, 0, 0]
    steps[axis] = sign * 900_000
    begin = desk.time_ns
    stream = made(desk, "@0A" + ",".join(f"{n},5000" for n in (*steps, 0)), "2")
    assert len(stream) == expected
    edge = next(t for t, terminal, level in desk.inputs_log if terminal.startswith("p3.") and not level)
    assert stream.t_ns[-1] == edge == desk.replies[-1][0]
    assert np.diff(stream.t_ns[-50:]).tolist() == [200_000] * 49  # 5000 Hz to the last: no ramp
    assert (stream.t_ns[:1000] - begin).tolist() == pulse_times_ns(10_000, 5000)[:1000]
    assert desk.counts[axis] == sign * expected


@shows("imc-5-5")
def test_2_a_reference_run_that_meets_the_far_switch() -> None:
    """The reference switch never closes again (broken wire): running off it ends at the far switch."""
    desk = initialised(carriage=(126_000, *MIDDLE[1:]))
    desk.set("limit_x1", "open")
    assert desk.query("@0R1") == "2"
    assert desk.struck("limit_x2")
    assert desk.query(OUT) == "2"


@shows("imc-5-6")
def test_after_a_limit_switch_axes_then_reference_run() -> None:
    desk = ready()
    assert desk.query("@0A900000,40000,0,900,0,900,0,900") == "2"
    mark = desk.ticks
    assert desk.query("@0A-10,900,0,900,0,900,0,900") == "2"
    assert desk.query("@0M0,900,0,900,0,900,0,900") == "2"
    assert desk.query("@0R7") == "2"
    assert desk.query("@0N7") == "2"
    assert desk.query("@07") == "0"
    assert desk.query("@0A-10,900,0,900,0,900,0,900") == "R"
    assert desk.ticks == mark
    assert desk.query("@0R7") == "0"
    assert desk.query(OUT) == "0"


@shows("imc-5-6")
@pytest.mark.parametrize("reference", ["@0R7", "@0N7"])
def test_after_a_limit_switch_a_reference_run_at_once(reference: str) -> None:
    """With a setting, for hosts that send it by themselves on `2`; the twin says that the manual wants more."""
    desk = ready(settings={"reference_ends_limit": True})
    assert desk.query("@0A900000,40000,0,900,0,900,0,900") == "2"
    assert desk.remarks == []
    assert desk.query(reference) == "0"
    assert desk.query("@0A-10,900,0,900,0,900,0,900" if reference == "@0N7" else OUT) == "0"
    (remark,) = [text for _, text in desk.remarks]
    assert "reference_ends_limit" in remark


@shows("imc-5-6")
def test_a_reference_run_that_has_failed_is_a_limit_switch_error_too() -> None:
    """2 stands for both: the axes are set anew before the next one."""
    desk = ready(settings={"search_steps": 1000})
    assert desk.query("@0R1") == "2"
    assert desk.query("@0R1") == "2"
    assert desk.query("@0N7") == "2"
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query(OUT) == "0"


@shows("imc-5-34")
def test_no_reference_run_yet() -> None:
    """The manual lists this under `2` and under `R`; hosts know it as `R` (imc/47)."""
    desk = initialised(7)
    assert desk.query(OUT) == "R"
    assert desk.ticks == 0


@shows("imc-5-7")
@pytest.mark.parametrize("text", ["@0R8", "@0n8", "@0N8", "@0F8", "@0R0", "@0n9"])
def test_3_an_axis_that_is_not_defined(text: str) -> None:
    assert initialised(7).query(text) == "3"


@shows("imc-5-8")
@pytest.mark.parametrize("text", [OUT, "@0M1,900", "@0R7", "@0y400,1500,119,-141,141,-1,-1", "@0Z0,1,1,900,1,1,1"])
def test_4_motion_before_the_axes_are_set(text: str) -> None:
    desk = fresh()
    assert desk.query(text) == "4"
    assert desk.ticks == 0


@shows("imc-5-9")
@pytest.mark.parametrize("text", ["@0d900", "@0d900,900,900", "@0i"])
def test_4_parameters_that_depend_on_the_axes(text: str) -> None:
    assert fresh().query(text) == "4"


@shows("imc-5-10")
@pytest.mark.parametrize("parameters", ["", "1", "7", "1,900"])
def test_5_no_such_command(parameters: str) -> None:
    for command in (*unknown.DNC[:8], *unknown.INITIAL[:8], "@0:"):
        assert initialised().query(command + parameters) == "5"


@shows("imc-5-11")
@pytest.mark.parametrize("text", ["hello", "@", "07", "0A10,900", "@0", "#07", "A"])
def test_5_a_command_with_an_error(text: str) -> None:
    desk = initialised()
    assert desk.query(text) == "5"
    assert desk.query("@0P") == hex24(0, 0, 0)


@shows("imc-5-12")
def test_6_memory_full() -> None:
    desk = ready()
    assert desk.query("@0k") == "0"
    assert desk.query("@0i") == "0"
    for _ in range(200):
        replies = "".join(desk.query("T0") for _ in range(500))
        if set(replies) != {"0"}:
            break
    assert replies.lstrip("0")[0] == "6"
    assert desk.query("@0S") == "G"


@shows("imc-5-13")
@pytest.mark.parametrize("text", ["@0A10,900,0,900,0,900", "@0M10", "@0d900", "@0B0", "@0y1,900,0,1", "@0Id1,2"])
def test_7_too_few(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "7"
    assert desk.ticks == 0


@shows("imc-5-14")
@pytest.mark.parametrize("text", [OUT + ",1", "@0d900,900,900,900,900", "@0B0,1,2", "@0j300,1", "@0J1,1", "@0z1,0"])
def test_7_too_many(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "7"
    assert desk.ticks == 0


@shows("imc-5-15")
@pytest.mark.parametrize("text", ["@0P", "@07", "@0A1,900,0,30,0,30,0,30"])
def test_8_not_a_cnc_command(text: str) -> None:
    desk = ready()
    assert desk.query("@0k") == "0"
    assert desk.query("@0i") == "0"
    assert desk.query(text) == "8"


@shows("imc-5-15")
def test_8_no_such_cnc_command() -> None:
    desk = ready()
    for code in unknown.CNC[:8]:
        assert [desk.query(text) for text in ("@0k", "@0i", f"{code}1")] == ["0", "0", "8"]


# --- 9: the safety chain at rest -----------------------------------------------------------------------------------


@shows("imc-5-16")
def test_9_the_supply_is_off() -> None:
    desk = fresh()
    desk.set("power", "off")
    assert desk.query("@07") == "9"
    desk.set("power", "on")
    assert desk.query("@07") == "0"


@shows("imc-5-17")
@pytest.mark.parametrize("contact", ["estop_1", "estop_2"])
def test_9_a_circuit_is_open(contact: str) -> None:
    desk = fresh()
    desk.set(contact, "open")
    assert desk.query("@07") == "9"
    desk.set(contact, "free")
    assert desk.query("@07") == "0"


@shows("imc-5-18")
def test_9_no_power_with_the_hood_open() -> None:
    desk = initialised()
    desk.press("estop")
    desk.set("hood", "open")
    assert desk.query("@07") == "9"
    desk.set("hood", "closed")
    assert desk.query("@07") == "0"


@shows("imc-5-18")
def test_on_setup_the_hood_may_be_open() -> None:
    desk = initialised()
    desk.press("estop")
    desk.set("key", "setup")
    desk.set("hood", "open")
    assert desk.query("@07") == "0"
    assert desk.query("@0N7") == "0"
    assert desk.query(OUT) == "0"


@shows("imc-5-19")
def test_9_too_hot() -> None:
    desk = fresh()
    desk.set("overtemperature", "hot")
    assert desk.query("@07") == "9"
    desk.set("overtemperature", "normal")
    assert desk.query("@07") == "0"


# --- 9: the safety chain in motion ---------------------------------------------------------------------------------


def moving(in_program: bool = False) -> Desk:
    """A desk in the middle of a move of XY, by command or in a stored program."""
    if in_program:
        desk = stored("0" + LONG[3:], "07,900,0,30,0,30,0,30")
        desk.start("@0S")
    else:
        desk = ready()
        desk.start(LONG)
    desk.run(1.0)
    assert desk.controller.run is not None
    return desk


@shows("imc-5-19", "imc-5-20", "imc-5-21")
@pytest.mark.parametrize("in_program", [False, True])
@pytest.mark.parametrize(
    ("name", "danger", "safe"),
    [
        ("estop", "pressed", "released"),
        ("estop_1", "open", "free"),
        ("estop_2", "open", "free"),
        ("overtemperature", "hot", "normal"),
        ("power", "off", "on"),
        ("hood", "forced", "closed"),
    ],
)
def test_9_danger_in_motion(name: str, danger: str, safe: str, in_program: bool) -> None:
    """The stream ends at once, the command answers 9, and so does every motion until the axes are set again."""
    desk = moving(in_program)
    edge = desk.time_ns
    desk.set(name, danger)
    assert desk.finish() == "9"
    assert desk.steps.t_ns[-1] <= edge
    assert desk.outputs["stages"] == 0
    assert not desk.cabinet.relay
    mark = desk.ticks
    assert desk.query(OUT) in ("9", "H")
    assert desk.query("@0R7") in ("9", "H")
    assert desk.query("@07") == "9"
    desk.set(name, safe)
    assert desk.query(OUT) == "9"
    assert desk.query("@07") == "0"
    assert desk.query(OUT) == "R"
    assert desk.ticks == mark
    assert desk.steps_without_stages == 0
    assert desk.query("@0R7") == "0"
    assert desk.query(OUT) == "0"


@shows("imc-5-20")
def test_9_emergency_stop_at_rest() -> None:
    desk = ready()
    desk.press("estop")
    assert desk.read() == ""
    assert desk.query(OUT) == "9"
    assert desk.query("@07") == "0"
    assert desk.query(OUT) == "R"


@shows("imc-5-20")
def test_9_emergency_stop_in_a_reference_run() -> None:
    desk = initialised()
    desk.start("@0R7")
    desk.run(0.3)
    edge = desk.time_ns
    desk.set("estop", "pressed")
    assert desk.finish() == "9"
    assert desk.steps.t_ns[-1] <= edge


@shows("imc-5-32")
def test_a_locked_hood_does_not_open_in_motion() -> None:
    desk = ready()
    assert desk.query("@0B1,0") == "0"
    desk.start(LONG)
    desk.run(1.0)
    desk.set("hood", "open")
    assert desk.cabinet.state["hood"] == "closed"
    assert desk.finish() == "0"


@shows("imc-5-32")
def test_h_hood_open_in_automatic() -> None:
    desk = ready()
    assert desk.query("@0B1,1") == "0"
    desk.set("hood", "open")
    for text in (OUT, "@0M5,900,0,900,0,900,0,900", "@0R7", "@0Z0,1,1,900,1,1,1", "@0B2,1", "@0F1"):
        assert desk.query(text) == "H", text
    assert desk.ticks == 0
    assert desk.outputs["spindle"] == 0
    desk.set("hood", "closed")
    assert desk.query(OUT) == "0"


@shows("imc-5-32")
def test_h_in_a_program() -> None:
    desk = stored("0900,900,0,30,0,30,0,30")
    assert desk.query("@0B1,1") == "0"
    desk.set("hood", "open")
    assert desk.query("@0S") == "H"
    assert desk.ticks == 0


@shows("imc-5-32")
def test_setup_allows_motion_with_the_hood_open() -> None:
    desk = ready()
    assert desk.query("@0B1,1") == "0"
    desk.set("key", "setup")
    desk.set("hood", "open")
    assert desk.query(OUT) == "0"


# --- unused codes, D, F, G, R --------------------------------------------------------------------------------------


@shows("imc-5-22", "imc-5-23", "imc-5-24", "imc-5-26")
def test_codes_that_are_not_used() -> None:
    """Every letter with parameters of many kinds, in four states: none is ever answered with A, B, C or E."""
    used = set("0123456789DFGHR")
    tails = ("", "0", "1", "7", "-1", "1,1", "300,300,300", "1,900,1,900,1,900,0,900", "x", "4,900,0,1,0,-1,1")
    texts = {"H", "h", "V", "?", "U", "P", "b", "D"}
    letters = [letter for letter in string.ascii_letters + string.punctuation if letter not in texts | {"@", "G"}]
    for desk in (fresh(), initialised(), ready(), stored("77")):
        for letter in letters:
            for tail in tails:
                reply = desk.query(f"@0{letter}{tail}")
                assert set(reply) <= used, f"@0{letter}{tail}: {reply}"


@shows("imc-5-25")
@pytest.mark.parametrize("speed", [0, 29, -900, 40_001])
@pytest.mark.parametrize(
    "text", ["@0A10,{},0,900,0,900,0,900", "@0M10,900,0,{},0,900,0,900", "@0Z0,1,1,{},1,0,0", "@0d900,900,{}"]
)
def test_d_speed_out_of_the_limits(text: str, speed: int) -> None:
    desk = ready()
    assert desk.query(text.format(speed)) == "D"
    assert desk.ticks == 0


@shows("imc-5-25")
@pytest.mark.parametrize("speed", [30, 40_000])
def test_limits_of_the_speed(speed: int) -> None:
    desk = ready()
    assert desk.query(f"@0A10,{speed},0,900,0,900,0,900") == "0"


@shows("imc-5-27")
def test_f_stop_key() -> None:
    desk = moving()
    desk.press("stop")
    assert desk.finish() == "F"
    assert 5000 < desk.counts[0] < 6000


@shows("imc-5-28")
def test_start_key_goes_on_in_a_program() -> None:
    desk = moving(in_program=True)
    desk.press("stop")
    assert desk.finish() == "F"
    desk.press("start")
    desk.finish()
    assert desk.counts == (20_007, -7000, 200, 0)


@shows("imc-5-29")
def test_start_command_goes_on() -> None:
    desk = moving()
    desk.press("stop")
    assert desk.finish() == "F"
    assert desk.query("@0s") == "0"
    assert desk.counts == (20_000, -7000, 200, 0)


@shows("imc-5-30")
def test_g_nothing_to_start() -> None:
    desk = ready()
    assert desk.query("@0S") == "G"
    assert desk.query(OUT) == "0"
    assert desk.query("@0S") == "G"


@shows("imc-5-31")
@pytest.mark.parametrize("complete", [True, False])
def test_g_a_program_or_part_of_one_is_there(complete: bool) -> None:
    desk = ready()
    program(desk, "05,900,0,30,0,30,0,30")
    if not complete:
        assert desk.query("@0k") == "0"
        assert desk.query("@0i") == "0"
        assert desk.query("05,900,0,30,0,30,0,30") == "0"
        desk.power_cycle()
        assert desk.query("@07") == "0"
    assert desk.query("@0i") == "G"


@shows("imc-5-33")
@pytest.mark.parametrize("text", [OUT, "@0M10,900,0,900,0,900,0,900", "@0Z0,1,1,900,5,0,0"])
def test_r_a_reference_run_is_needed(text: str) -> None:
    desk = initialised()
    assert desk.query(text) == "R"
    assert desk.ticks == 0


@shows("imc-5-33")
def test_a_move_of_no_length_needs_no_reference_run() -> None:
    desk = initialised()
    assert desk.query("@0A0,900,0,900,0,900,0,900") == "0"
    assert desk.query("@0M0,900,0,900,0,900,0,900") == "0"
