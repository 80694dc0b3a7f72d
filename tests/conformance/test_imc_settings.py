"""iMC, chapter 4: initialisation values, what they do to the machine, and what survives in flash."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest
from conformance.closed_forms import pulse_times_ns
from conformance.imc_desk import CONTROLLERS, MIDDLE, TRAVEL, XYZA, fresh, initialised, made, program, ready, stored
from conformance.rows import case, shows

from isel_twin.testing import Desk

AXES = range(4)


def move(axis: int, steps: int) -> str:
    """A relative move of one axis of four."""
    return "@0A" + ",".join(f"{steps if i == axis else 0},2000" for i in AXES)


def set_up(*commands: str, axes: int = 7, **options: Any) -> Desk:
    """Initialisation commands first, then the axes, then taken as referenced."""
    desk = fresh(carriage=MIDDLE, **options)
    for text in (*commands, *(("@07", "@08", "@0N7", "@0N8") if axes == XYZA else ("@07", "@0N7"))):
        assert desk.query(text) == "0", text
    return desk


def power_cycled(desk: Desk) -> Desk:
    """The same desk after mains off and on, axes set and taken as referenced."""
    desk.power_cycle()
    for text in ("@07", "@0N7"):
        assert desk.query(text) == "0"
    return desk


def ramp(desk: Desk, start_stop_hz: int = 300, acceleration_hz_ms: int = 100) -> bool:
    """Does a move follow the ramp law with these values?"""
    begin = desk.time_ns
    stream = made(desk, "@0A300,2000,0,30,0,30,0,30")
    expected = pulse_times_ns(300, 2000, start_stop_hz, acceleration_hz_ms)
    return stream.t_ns.tolist() == [begin + t for t in expected]


# --- 4.1 -----------------------------------------------------------------------------------------------------------


@shows("imc-4.1-1", "imc-4.1-2", "imc-4.2.18-1")
def test_values_written_to_flash_are_used_after_every_power_on() -> None:
    desk = set_up("@0IJ120", "@0Ij444", "@0IW")
    for _ in range(2):
        assert ramp(power_cycled(desk), 444, 120)


@shows("imc-4.1-3")
def test_values_not_written_are_lost() -> None:
    desk = set_up("@0IJ120")
    assert ramp(desk, 300, 120)
    assert ramp(power_cycled(desk), 300, 100)


# --- 4.2.1 to 4.2.4 ------------------------------------------------------------------------------------------------


@shows("imc-4.2.1-1")
def test_printed_default_reference_speeds() -> None:
    desk = fresh()
    for text in ("@0Id1000,900,500,900", "@07", "@08"):
        assert desk.query(text) == "0"
    for axis, speed in enumerate((1000, 900, 500, 900)):
        stream = made(desk, f"@0R{1 << axis}")
        periods = stream.t_ns[1:] - stream.t_ns[:-1]
        assert 1e9 / periods.min() == pytest.approx(speed, rel=1e-5)


@shows("imc-4.2.1-2")
@pytest.mark.parametrize("text", ["@0Id1000,29,500,900", "@0Id1000,900,500,40001"])
def test_default_reference_speeds_out_of_range(text: str) -> None:
    assert fresh().query(text) == "D"


@shows("imc-4.2.2-1", "imc-4.2.2-4")
def test_printed_run_free_steps() -> None:
    """The desk's switches close 9 steps from their trip point; the run-free steps come on top."""
    desk = initialised(XYZA)
    for text in ("@0IF20,50,50,10", "@0R7", "@0R8"):
        assert desk.query(text) == "0"
    assert desk.carriage.tolist() == [9 + 20, 9 + 50, 9 + 50, 9 + 10]
    assert desk.counts == (0, 0, 0, 0)


@shows("imc-4.2.3-1")
def test_printed_default_acceleration() -> None:
    assert ramp(set_up("@0IJ120"), 300, 120)


@shows("imc-4.2.4-1")
def test_printed_default_start_stop_frequency() -> None:
    assert ramp(set_up("@0Ij700", "@0Ij300"), 300, 100)
    assert ramp(set_up("@0Ij700"), 700, 100)


# --- 4.2.5: IO only ------------------------------------------------------------------------------------------------


@shows("imc-4.2.5-1", "imc-4.2.5-2")
def test_io_only() -> None:
    desk = ready()
    assert desk.query("@0IO1") == "0"
    assert desk.query("@0B0,90") == "0"
    assert desk.outputs["user"] == 90
    desk.set("user_3", True)
    assert desk.query("@0b0") == "008"
    for text in ("@07", "@0N7", "@0A10,900,0,900,0,900,0,900", "@0M10,900,0,900,0,900,0,900", "@0R1"):
        reply = desk.query(text)
        assert desk.ticks == 0, text
    assert reply != "0"
    assert desk.query("@0IO0") == "0"
    for text in ("@07", "@0N7", "@0A10,900,0,900,0,900,0,900"):
        assert desk.query(text) == "0"
    assert desk.counts == (10, 0, 0, 0)


@shows("imc-4.2.5-3")
def test_io_only_is_on_or_off() -> None:
    assert fresh().query("@0IO2") == "1"


# --- 4.2.6: limit switches -----------------------------------------------------------------------------------------

ALL_LOW_ACTIVE = 0xFFFF


def into_switch(desk: Desk, axis: int, end: int) -> str:
    """Take an axis 100 steps before its switch 200 steps towards it; the reply."""
    desk.carriage[axis] = 100 if end == 1 else TRAVEL[axis] - 100
    return desk.query(move(axis, -200 if end == 1 else 200))


@shows("imc-4.2.6-1")
def test_printed_limit_switch_setting() -> None:
    """57343 is 0xDFFF: all switches enabled and low-active, but for A2, which is disabled."""
    for axis in AXES:
        for end in (1, 2):
            desk = set_up("@0IE57343", axes=XYZA)
            assert into_switch(desk, axis, end) == ("0" if (axis, end) == (3, 2) else "2")


@pytest.mark.parametrize(
    ("axis", "end"),
    [
        pytest.param(axis, end, marks=shows(f"imc-4.2.6-{1 + end}"), id=f"{'xyza'[axis]}{end}")
        for axis in AXES
        for end in (1, 2)
    ],
)
def test_each_switch_can_be_disabled(axis: int, end: int) -> None:
    enable = 1 << (4 * axis + end - 1)
    assert into_switch(set_up(f"@0IE{ALL_LOW_ACTIVE}", axes=XYZA), axis, end) == "2"
    desk = set_up(f"@0IE{ALL_LOW_ACTIVE & ~enable}", axes=XYZA)
    assert into_switch(desk, axis, end) == "0"
    assert desk.counts[axis] == (-200 if end == 1 else 200)


@pytest.mark.parametrize(
    ("axis", "end"),
    [
        pytest.param(axis, end, marks=shows(f"imc-4.2.6-{3 + end}"), id=f"{'xyza'[axis]}{end}")
        for axis in AXES
        for end in (1, 2)
    ],
)
def test_each_switch_can_be_high_active(axis: int, end: int) -> None:
    """Struck while the terminal is high if its bit is 0, while it is low if it is 1; a struck switch ends a motion."""
    level = 1 << (4 * axis + end + 1)
    code = "Rn" if end == 1 else "Rp"
    terminal = f"p3.{2 * axis + end - 1}"
    for setting, struck_by in ((ALL_LOW_ACTIVE & ~level, True), (ALL_LOW_ACTIVE, False)):
        desk = set_up(f"@0IE{setting}", axes=XYZA)
        for high in (True, False, True, not struck_by):
            desk.set(terminal, high)
            assert desk.query(f"@0D{code}") == f"0{1 << axis if high is struck_by else 0:02X}"
        assert desk.query(move(axis, -20 if end == 1 else 20)) == "0"
        desk.start(move(axis, -2000 if end == 1 else 2000))
        desk.run(0.1)
        desk.set(terminal, struck_by)
        assert desk.finish() == "2"
        assert 20 < desk.ticks < 220


@shows("imc-4.2.6-6")
@pytest.mark.parametrize("value", ["65536", "-1"])
def test_limit_switch_setting_has_16_bits(value: str) -> None:
    assert fresh().query(f"@0IE{value}") == "1"


# --- 4.2.7 to 4.2.10: axes -----------------------------------------------------------------------------------------


@shows("imc-4.2.7-1")
@pytest.mark.parametrize("axis", AXES)
def test_swapped_switches(axis: int) -> None:
    desk = set_up("@0IE65535", f"@0Ie{1 << axis}", axes=XYZA)
    desk.set(f"p3.{2 * axis}", False)
    assert desk.query("@0DRp") == f"0{1 << axis:02X}"
    assert desk.query("@0DRn") == "000"
    desk.set(f"p3.{2 * axis}", True)
    desk.set(f"p3.{2 * axis + 1}", False)
    assert desk.query("@0DRp") == "000"
    assert desk.query("@0DRn") == f"0{1 << axis:02X}"


@shows("imc-4.2.7-1")
@pytest.mark.parametrize("swapped", [True, False])
@pytest.mark.parametrize("axis", AXES)
def test_a_swapped_switch_ends_moves_the_other_way(axis: int, swapped: bool) -> None:
    """On switch 1, at the motor end: the positive way leads onto it if it is swapped, else the negative one."""
    for steps in (1, -1):
        desk = fresh(carriage=[-5 if i == axis else n for i, n in enumerate(MIDDLE)])
        for text in ("@0IE65535", f"@0Ie{swapped << axis}", "@07", "@08", "@0N7", "@0N8"):
            assert desk.query(text) == "0"
        struck = (steps > 0) == swapped
        assert desk.query(move(axis, steps)) == ("2" if struck else "0")
        assert desk.ticks == (0 if struck else 1)


@shows("imc-4.2.7-1")
@pytest.mark.parametrize("swapped", [True, False])
def test_printed_swap_tells_which_switch_z_stands_on(swapped: bool) -> None:
    """Z inverted and on its far switch, which is its negative one only if the two are swapped: then it runs off it."""
    desk = fresh(carriage=(*MIDDLE[:2], TRAVEL[2] + 5, MIDDLE[3]), settings={"search_steps": 3000})
    for text in ("@0Ie4" if swapped else "@0Ie0", "@0ID4", "@07"):
        assert desk.query(text) == "0"
    assert desk.query("@0R4") == ("0" if swapped else "2")
    assert (desk.carriage[2] < TRAVEL[2]) == swapped
    assert (desk.steps.delta[:, 2] > 0).all() == swapped


@shows("imc-4.2.7-2")
def test_all_swapped() -> None:
    desk = set_up("@0IE65535", "@0Ie15", axes=XYZA)
    for axis in AXES:
        desk.set(f"p3.{2 * axis}", False)
    assert desk.query("@0DRp") == "00F"
    assert desk.query("@0DRn") == "000"


@pytest.mark.parametrize(
    "text",
    [
        case("imc-4.2.7-2", "@0Ie16"),
        case("imc-4.2.8-2", "@0ID16"),
        case("imc-4.2.9-2", "@0IR16"),
        case("imc-4.2.10-2", "@0IT16"),
    ],
)
def test_axis_codes_have_four_bits(text: str) -> None:
    assert fresh().query(text) == "1"


@shows("imc-4.2.8-1", "imc-4.2.8-2")
@pytest.mark.parametrize("code", [1, 2, 4, 8, 15])
def test_inverted_axes(code: int) -> None:
    desk = set_up(f"@0ID{code}", axes=XYZA)
    assert desk.query("@0A100,900,100,900,100,900,100,900") == "0"
    assert desk.counts == (100, 100, 100, 100)
    moved = (desk.carriage - MIDDLE).tolist()
    assert moved == [-100 if code >> axis & 1 else 100 for axis in AXES]


@shows("imc-4.2.9-1", "imc-4.2.9-2")
@pytest.mark.parametrize("code", [1, 2, 4, 8, 15])
def test_inverted_reference_directions(code: int) -> None:
    desk = fresh(carriage=MIDDLE)
    for text in ("@0IE65535", f"@0IR{code}", "@0IF20,20,20,20", "@07", "@08", "@0R7", "@0R8"):
        assert desk.query(text) == "0", text
    assert desk.counts == (0, 0, 0, 0)
    for axis in AXES:
        expected = TRAVEL[axis] - 29 if code >> axis & 1 else 29
        assert desk.carriage[axis] == expected
    desk.query(move(0, -1000 if code & 1 else 1000))
    assert desk.counts[0] == (-1000 if code & 1 else 1000)


@shows("imc-4.2.10-1")
@pytest.mark.parametrize("code", [0, 1, 2, 4, 8, 15])
def test_rotary_axes_turn_past_their_switches(code: int) -> None:
    """A rotary axis has no ends: its switch is for the reference run alone (decision imc/29)."""
    for axis in AXES:
        desk = set_up("@0IE65535", f"@0IT{code}", axes=XYZA)
        assert into_switch(desk, axis, 1) == ("0" if code >> axis & 1 else "2")


@shows("imc-4.2.10-1")
def test_rotary_axis_has_a_reference_run() -> None:
    desk = fresh()
    for text in ("@0IT8", "@0IF20,20,20,20", "@07", "@08", "@0R8"):
        assert desk.query(text) == "0"
    assert desk.carriage[3] == 29
    assert desk.counts[3] == 0


# --- 4.2.11 to 4.2.14: inputs watched in CNC mode ------------------------------------------------------------------

LONG = ("09000,900,0,30,0,30,0,30", "07,900,0,30,0,30,0,30")
"""Ten seconds of motion, and a little more."""


def running(*settings: str, levels: dict[int, bool], **options: Any) -> Desk:
    """A desk whose program LONG has been running for two seconds; user inputs as given before."""
    desk = stored(*LONG, **options)
    for text in settings:
        assert desk.query(text) == "0"
    for bit, level in levels.items():
        desk.set(f"user_{bit}", level)
    desk.start("@0S")
    desk.run(2.0)
    assert 1700 < desk.ticks < 1800
    return desk


@shows("imc-4.2.11-1", "imc-4.2.11-2")
def test_abort_input_breaks_off_the_program() -> None:
    desk = running("@0IA0,1,1", levels={0: True})
    desk.set("user_0", False)
    assert desk.finish() not in ("", "0")
    assert desk.ticks < 1810


@shows("imc-4.2.11-1")
def test_abort_input_at_the_start_of_the_program() -> None:
    desk = stored(*LONG)
    assert desk.query("@0IA0,1,1") == "0"
    assert desk.query("@0S") not in ("", "0")
    assert desk.ticks <= 1


@shows("imc-4.2.11-2")
def test_only_the_bits_of_the_mask_abort() -> None:
    desk = running("@0IA0,1,1", levels={0: True})
    desk.set("user_1", True)
    assert desk.finish() == "0"
    assert desk.ticks == 9007


@pytest.mark.parametrize(
    "text",
    [case("imc-4.2.11-3", "@0IA0,0,1"), case("imc-4.2.13-2", "@0IH0,0,1"), case("imc-4.2.14-2", "@0IN0,0,1")],
)
def test_mask_0_switches_the_watching_off(text: str) -> None:
    desk = running(text, levels={0: False})
    desk.set("user_0", True)
    desk.set("user_1", True)
    assert desk.finish() == "0"
    assert desk.ticks == 9007


@pytest.mark.parametrize(
    "text",
    [case("imc-4.2.11-4", "@0IA0,1,1"), case("imc-4.2.13-3", "@0IH0,2,2"), case("imc-4.2.14-3", "@0IN0,1,1")],
)
def test_watching_is_kept_in_flash(text: str) -> None:
    for kept in (True, False):
        desk = stored(*LONG)
        assert desk.query(text) == "0"
        if kept:
            assert desk.query("@0IW") == "0"
        power_cycled(desk)
        mark = desk.ticks
        reply = desk.query("@0S")
        assert (reply in ("F", "H", "9"), desk.ticks == mark) == (kept, kept)


@shows("imc-4.2.11-5")
@pytest.mark.parametrize("text", ["@0IA0,1,1", "@0IH0,2,2", "@0IN0,1,1"])
def test_watching_is_for_cnc_mode(text: str) -> None:
    desk = ready()
    assert desk.query(text) == "0"
    assert desk.query("@0A900,900,0,30,0,30,0,30") == "0"


@shows("imc-4.2.12-1", "imc-4.2.12-2")
def test_error_output() -> None:
    desk = ready()
    program(desk, "0500,900,0,30,0,30,0,30")
    for text in ("@0Ia0,1,1", "@0B0,255"):
        assert desk.query(text) == "0"
    desk.start("@0S")
    desk.run(0.3)
    assert desk.outputs["user"] == 254
    assert desk.finish() == "0"
    program(desk, "0900000,40000,0,30,0,30,0,30")
    assert desk.query("@0S") == "2"
    assert desk.outputs["user"] == 255


@shows("imc-4.2.12-3")
def test_error_output_with_mask_0() -> None:
    desk = stored("0500,900,0,30,0,30,0,30")
    for text in ("@0Ia0,0,1", "@0B0,255"):
        assert desk.query(text) == "0"
    desk.start("@0S")
    desk.run(0.3)
    assert desk.outputs["user"] == 255
    assert desk.finish() == "0"


@shows("imc-4.2.12-4")
def test_error_output_is_kept_in_flash() -> None:
    desk = stored("0500,900,0,30,0,30,0,30")
    for text in ("@0Ia0,1,1", "@0IW"):
        assert desk.query(text) == "0"
    power_cycled(desk)
    assert desk.query("@0B0,255") == "0"
    desk.start("@0S")
    desk.run(0.3)
    assert desk.outputs["user"] == 254


@shows("imc-4.2.13-1")
def test_external_hood() -> None:
    """Mask 2, value 1: under the mask the value is 0, so bit 1 set means an open hood."""
    desk = stored(*LONG)
    assert desk.query("@0IH0,2,1") == "0"
    desk.set("user_1", True)
    assert desk.query("@0S") == "H"
    assert desk.ticks == 0
    desk.set("user_1", False)
    assert desk.query("@0S") == "0"
    assert desk.ticks == 9007


@shows("imc-1-75", "imc-4.2.13-1")
@pytest.mark.parametrize("controller", CONTROLLERS)
def test_the_external_hood_opens_in_a_running_program(controller: str) -> None:
    """The port is read cyclically: the axes come to rest, `H` is answered, what follows is not carried out.

    Only the bits of the mask count, and only in CNC mode.
    """
    desk = running("@0IH0,2,1", levels={1: False}, controller=controller)
    desk.set("user_0", True)
    desk.run(1.0)
    assert desk.ticks > 2500
    edge = desk.time_ns
    desk.set("user_1", True)
    assert desk.finish() == "H"
    assert edge < desk.steps.t_ns[-1] <= edge + 20_000_000  # the cycle, and the ramp from 900 to 300 Hz
    assert desk.counts == desk.steps.total
    at_rest = desk.ticks
    assert desk.query("@0S") == "H"
    desk.run(5.0)
    assert desk.ticks == at_rest
    assert made(desk, "@0A5,900,0,30,0,30,0,30").total == (5, 0, 0, 0)
    desk.set("user_1", False)
    assert desk.query("@0S") == "0"
    assert desk.ticks > at_rest + 5


@shows("imc-4.2.14-1")
def test_external_emergency_stop() -> None:
    """Mask 3, value 1: bit 0 must be 1 and bit 1 must be 0."""
    desk = running("@0IN0,3,1", levels={0: True, 1: False})
    edge = desk.time_ns
    desk.set("user_1", True)
    assert desk.finish() == "9"
    assert desk.steps.t_ns[-1] <= edge + 10_000_000  # the port is read cyclically
    assert desk.query("@0A10,900,0,30,0,30,0,30") == "9"
    desk.set("user_1", False)
    assert desk.query("@07") == "0"
    assert desk.query("@0A10,900,0,30,0,30,0,30") == "R"


# --- 4.2.15: baud --------------------------------------------------------------------------------------------------


@shows("imc-4.2.15-1", "imc-4.2.15-2")
@pytest.mark.parametrize("by", ["reset", "power"])
def test_9600_baud_after_flash_and_reset(by: str) -> None:
    desk = fresh()
    assert desk.query("@0IC1") == "0"
    assert desk.controller.serial_format.baud == 19_200
    assert desk.query("@0IW") == "0"
    assert desk.controller.serial_format.baud == 19_200
    if by == "power":
        desk.power_cycle()
    else:
        desk.send(b"\xfe")
        desk.run(3.0)
    assert desk.controller.serial_format.baud == 9600


@shows("imc-4.2.15-2")
def test_9600_baud_needs_the_flash() -> None:
    desk = fresh()
    assert desk.query("@0IC1") == "0"
    desk.power_cycle()
    assert desk.controller.serial_format.baud == 19_200


@shows("imc-4.2.15-3", "imc-4.2.15-4")
def test_back_to_19200_baud() -> None:
    desk = fresh()
    assert desk.controller.serial_format.baud == 19_200
    for text in ("@0IC1", "@0IW"):
        assert desk.query(text) == "0"
    desk.power_cycle()
    for text in ("@0IC0", "@0IW"):
        assert desk.query(text) == "0"
    desk.power_cycle()
    assert desk.controller.serial_format.baud == 19_200


# --- 4.2.16: user information --------------------------------------------------------------------------------------

PRINTED = "isel_1234_aabbcc_24122012"


@shows("imc-4.2.16-1")
def test_printed_user_information() -> None:
    desk = fresh()
    assert desk.query(f"@0IU{PRINTED}") == "0"
    assert PRINTED in desk.query("@0U")


@pytest.mark.parametrize("by", [case("imc-4.2.16-2", "power"), case("imc-4.2.16-3", "reset")])
def test_user_information_survives(by: str) -> None:
    desk = fresh()
    assert desk.query(f"@0IU{PRINTED}") == "0"
    assert desk.query("@0IW") == "0"
    assert desk.query("@0IUother") == "0"
    if by == "power":
        desk.power_cycle()
    else:
        desk.send(b"\xfe")
        desk.run(3.0)
    assert PRINTED in desk.query("@0U")
    assert "other" not in desk.query("@0U")


@shows("imc-4.2.16-4")
def test_user_information_of_32_characters() -> None:
    longest = "ABCDEFGHIJKLMNOPQRSTUVWXYZ012345"
    desk = fresh()
    assert desk.query(f"@0IU{longest}") == "0"
    assert longest in desk.query("@0U")
    desk.query(f"@0IU{longest[::-1]}!")
    assert "!" not in desk.query("@0U")


# --- 4.2.17 to 4.2.19 ----------------------------------------------------------------------------------------------


@shows("imc-4.2.17-1")
def test_values_are_read_from_flash() -> None:
    desk = set_up("@0IJ120", "@0IW", "@0IJ50", "@0IL")
    assert ramp(desk, 300, 120)


@shows("imc-4.2.19-1")
def test_built_in_values_come_back() -> None:
    desk = set_up("@0IJ120", "@0Ij700", "@0ID15", "@0IW", "@0IX")
    assert ramp(desk, 300, 100)
    assert desk.carriage[0] == MIDDLE[0] + 300
    power_cycled(desk)
    assert ramp(desk, 700, 120)


def stored_anew() -> Desk:
    """A desk whose flash has 700 Hz and 120 Hz/ms, while 60 Hz and 50 Hz/ms are in force."""
    return set_up("@0IJ120", "@0Ij700", "@0IW", "@0IJ50", "@0Ij60")


def without_power(desk: Desk) -> None:
    desk.power_cycle()


def reset(desk: Desk) -> None:
    desk.send(b"\xfe")
    desk.run(3.0)


STORE_MS = 40.0


@shows("imc-4.2.18-2")
@pytest.mark.parametrize("loss", [without_power, reset])
@pytest.mark.parametrize("after_ms", [0.0, 0.001, 1.0, 20.0, 39.0, 39.999, 40.0, 40.001, 50.0, 1000.0])
def test_power_lost_while_values_are_stored(after_ms: float, loss: Callable[[Desk], None]) -> None:
    desk = stored_anew()
    desk.send(b"@0IW\r")
    desk.run(after_ms / 1000)
    answered = desk.read()
    loss(desk)
    for text in ("@07", "@0N7"):
        assert desk.query(text) == "0"
    assert answered == ("0" if after_ms >= STORE_MS else "")
    assert ramp(desk, *((60, 50) if answered else (700, 120)))


@shows("imc-4.2.18-2")
def test_a_store_keeps_the_program_whenever_power_is_lost() -> None:
    for after_ms in (0.0, 20.0, 60.0):
        desk = stored("0 300,2000,0,30,0,30,0,30")
        desk.send(b"@0IW\r")
        desk.run(after_ms / 1000)
        desk.power_cycle()
        for text in ("@07", "@0N7"):
            assert desk.query(text) == "0"
        assert len(made(desk, "@0S")) == 300


@pytest.mark.parametrize("image", [b"", b"\x00", b"\xff" * 4096, b"not a flash image"])
def test_a_flash_that_is_no_flash_is_a_new_device(image: bytes) -> None:
    desk = fresh(flash=image, carriage=MIDDLE)
    for text in ("@07", "@0N7"):
        assert desk.query(text) == "0"
    assert ramp(desk, 300, 100)
