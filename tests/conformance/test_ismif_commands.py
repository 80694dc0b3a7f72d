"""iSMIF, section 6: the twenty commands."""

from __future__ import annotations

import numpy as np
import pytest
from conformance.closed_forms import line
from conformance.ismif_desk import (
    ACK,
    DONE,
    HYSTERESIS,
    TRAVEL,
    fresh,
    job,
    moved,
    now,
    pulse_times_ns,
    referenced,
    send_job,
    status,
    top_speed_hz,
)
from conformance.rows import case, shows

from isel_twin.testing import Desk

OFF = HYSTERESIS + 1
"""Half steps from the switch point until the switch lets go."""


def stop_distance(frequency_hz: float, f0: float = 200, acceleration: float = 800) -> float:
    """Steps on a ramp from `frequency_hz` down to the start speed; the factory's ramp is 400 Hz in 0.5 s."""
    return (frequency_hz**2 - f0**2) / (2 * acceleration)


def cruising(desk: Desk, command: str = "L1,X5000", seconds: float = 2.0) -> Desk:
    """Start a long vector and let it get to its speed."""
    send_job(desk, command)
    desk.run(seconds)
    desk.read()
    return desk


# --- 6.1 and 6.16: reset, stop at once ----------------------------------------------------------------------------


@shows("ismif-4-1", "ismif-6.1-1", "ismif-6.1-2", "ismif-6.1-4", "ismif-6.1-5", "ismif-6.3-5")
def test_reset_in_a_motion() -> None:
    desk = cruising(referenced())
    mark = desk.ticks
    assert now(desk, "@R") == ACK
    assert desk.counts == (0, 0, 0, 0)
    assert [now(desk, f"@L{axis}") for axis in "XYZ"] == ["@LX0\r", "@LY0\r", "@LZ0\r"]
    assert status(desk) == "000100"
    desk.run(5.0)
    assert desk.ticks == mark
    assert moved(desk, "L1,X10").total == (10, 0, 0, 0)


@shows("ismif-6.1-3")
def test_reset_clears_the_memory() -> None:
    desk = referenced()
    assert now(desk, "L1,x100") == ACK
    assert now(desk, "@R") == ACK
    assert moved(desk, "L1,y7").total == (0, 7, 0, 0)


@shows("ismif-6.1-6")
def test_reset_keeps_the_settings() -> None:
    desk = referenced("#S150", "#E7,900", "#R400", "F1")
    assert now(desk, "@R") == ACK
    stream = moved(desk, "L7,x300")
    assert stream.t_ns.tolist() == pulse_times_ns(300, v=900, f0=150, ramp_ms=400)
    assert stream.total == (600, 0, 0, 0)


@shows("ismif-4-16", "ismif-6.16-1", "ismif-6.16-2", "ismif-6.16-3")
def test_stop_at_once() -> None:
    desk = referenced()
    send_job(desk, "L1,X5000", "L1,Y100")
    desk.run(2.0)
    mark = desk.ticks
    desk.read()
    assert now(desk, "@S") == ACK
    assert status(desk) == "000100"
    desk.run(20.0)
    assert desk.ticks == mark
    assert desk.read() == ""
    assert [now(desk, f"@L{axis}") for axis in "XYZ"] == ["@LX0\r", "@LY0\r", "@LZ0\r"]
    assert job(desk, "$HXY") == ACK + DONE
    assert status(desk) == "000100"
    assert job(desk, "$HZ") == ACK + DONE
    assert status(desk) == "000000"


# --- 6.2 to 6.4: version, status, position ------------------------------------------------------------------------


@shows("ismif-6.2-1")
def test_version() -> None:
    assert now(fresh(), "@V") == "@V SMC-ISMIF 1.00\r"


@shows("ismif-6.3-1", "ismif-6.3-8", "ismif-6.3-6", "ismif-6.3-5")
def test_status_during_a_reference_run() -> None:
    desk = fresh()
    send_job(desk, "$HXY")
    seen = set()
    while not desk.controller.idle:
        seen.add(now(desk, "@X"))
        desk.run(0.02)
    assert seen == {"@X100110\r"}
    assert now(desk, "@X") == "@X000100\r"  # Z is still unknown
    job(desk, "$HZ")
    assert now(desk, "@X") == "@X000000\r"


@shows("ismif-6.3-9", "ismif-6.3-2", "ismif-6.3-7", "ismif-6.3-10")
def test_status_in_a_job() -> None:
    desk = referenced()
    send_job(desk, "L15,x500,y1000", "L1,x-500")
    seen = []
    while not desk.controller.idle:
        seen.append(now(desk, "@X"))
        desk.run(0.01)
    assert len(seen) > 200
    assert set(seen) == {"@X100001\r"}
    assert now(desk, "@X") == "@X000000\r"


@shows("ismif-6.3-3")
def test_status_in_a_waiting_time() -> None:
    desk = referenced()
    send_job(desk, "W250")
    desk.run(0.249)
    assert status(desk) == "010001"
    desk.run(0.001)
    assert status(desk) == "000000"


@shows("ismif-6.3-4")
def test_an_error_shows_until_a_reset() -> None:
    desk = referenced()
    assert now(desk, "L100,x5") == ACK
    assert status(desk) == "001000"
    job(desk, "L1,x5")
    assert status(desk) == "001000"
    assert now(desk, "@R") == ACK
    assert status(desk) == "000100"
    job(desk, "$HZXY")
    assert status(desk) == "000000"


@shows("ismif-6.4-1", "ismif-6.4-2")
def test_positions_as_printed() -> None:
    desk = referenced()
    moved(desk, "L1,X1234,Y-4")
    assert now(desk, "@LX") == "@LX1234\r"
    desk.carriage[1] = 5000  # room for 1234 steps below zero
    moved(desk, "L1,Y-1234")
    assert now(desk, "@LY") == "@LY-1234\r"


@shows("ismif-6.4-3")
@pytest.mark.parametrize("query", ["@L", "@LA", "@Lx", "@LXY"])
def test_only_three_axes_have_a_position(query: str) -> None:
    desk = referenced()
    assert now(desk, query) == ACK
    assert status(desk) == "001000"


@shows("ismif-6.4-4")
def test_position_of_the_moment() -> None:
    desk = cruising(referenced(), "L1,X900", seconds=0.0)
    times = np.array(pulse_times_ns(900, v=600))
    for tenths in range(1, 15):
        desk.run(0.1)
        assert now(desk, "@LX") == f"@LX{(times <= tenths * 10**8).sum()}\r"


# --- 6.5 to 6.7: signals, steps, Z axis (5.2 and 7 have more) -----------------------------------------------------


@shows("ismif-4-5", "ismif-6.5-1", "ismif-6.5-2")
@pytest.mark.parametrize("command", ["T0", "T1"])
def test_the_choice_of_signals_is_shown(command: str) -> None:
    desk = referenced()
    assert job(desk, command) == ACK + DONE
    assert desk.outputs["clock_signals"] == int(command[1])


@shows("ismif-4-6", "ismif-6.6-1", "ismif-6.6-2", "ismif-7-6")
def test_full_steps_go_twice_as_far() -> None:
    """A full step is two half steps of the stage at once (decision ismif/4); speeds count full steps."""
    desk = referenced()
    half = moved(desk, "F0", "L1,x700,y300")
    full = moved(desk, "F1", "L1,x700,y300")
    again = moved(desk, "F0", "L1,x-700,y-300")
    assert half.total == (700, 300, 0, 0)
    assert full.total == (1400, 600, 0, 0)
    assert full.t_ns.tolist() == half.t_ns.tolist()
    assert np.array_equal(full.delta, 2 * half.delta)
    assert np.array_equal(again.delta, -half.delta)
    assert again.t_ns.tolist() == half.t_ns.tolist()
    assert now(desk, "@LX") == "@LX1400\r"
    job(desk, "F1")
    assert now(desk, "@LX") == "@LX700\r"


@shows("ismif-6.7-1")
def test_z_is_an_axis() -> None:
    assert moved(referenced("Z1"), "L1,x30,z-20").total == (30, 0, -20, 0)


@shows("ismif-6.7-2")
def test_z_is_a_plotters_relay() -> None:
    desk = referenced()
    assert job(desk, "Z2") == ACK + DONE
    assert desk.outputs["z_relay"] == 0
    assert moved(desk, "L1,X30,Z1").total == (30, 0, 0, 0)
    assert desk.outputs["z_relay"] == 1
    assert moved(desk, "L1,Z0").total == (0, 0, 0, 0)
    assert desk.outputs["z_relay"] == 0
    assert status(desk) == "000000"


# --- 6.8 to 6.10: speeds and ramps --------------------------------------------------------------------------------


@shows("ismif-6.8-1", "ismif-6.8-2", "ismif-6.10-2")
@pytest.mark.parametrize(("axis", "number"), [("x", 0), ("y", 1), ("z", 2)])
def test_start_speed(axis: str, number: int) -> None:
    stream = moved(referenced("#S150"), f"L1,{axis}700")
    assert stream.t_ns.tolist() == pulse_times_ns(700, v=600, f0=150, ramp_ms=500)
    assert stream.total[number] == 700


@shows("ismif-6.8-3", "ismif-6.10-1", "ismif-6.10-3")
@pytest.mark.parametrize("f0", [65, 200, 599])
@pytest.mark.parametrize("ramp_ms", [400, 1, 333, 3000])
def test_ramps_follow_from_start_speed_and_ramp_length(f0: int, ramp_ms: int) -> None:
    stream = moved(referenced(f"#S{f0}", f"#R{ramp_ms}"), "L1,x1000")
    assert stream.t_ns.tolist() == pulse_times_ns(1000, v=600, f0=f0, ramp_ms=ramp_ms)
    intervals = np.diff(stream.t_ns, prepend=0)
    assert np.abs(intervals - intervals[::-1]).max() <= 2  # mirrored, but for the rounding


@shows("ismif-6.9-1", "ismif-6.9-2", "ismif-6.9-5", "ismif-6.9-6")
def test_end_speeds_from_the_table() -> None:
    desk = referenced()
    assert job(desk, "#E1,800", "#E25,400") == ACK * 2 + DONE
    assert moved(desk, "L1,x900").t_ns.tolist() == pulse_times_ns(900, v=800)
    assert moved(desk, "L25,y900").t_ns.tolist() == pulse_times_ns(900, v=400)
    assert moved(desk, "L24,z900").t_ns.tolist() == pulse_times_ns(900, v=600)


@shows("ismif-6.9-3")
def test_the_table_has_a_hundred_fields() -> None:
    desk = referenced("#R0", *(f"#E{i},{1000 + 10 * i}" for i in range(100)))
    for index in (0, 1, 42, 98, 99):
        assert top_speed_hz(moved(desk, f"L{index},x3")) == pytest.approx(1000 + 10 * index, rel=1e-5)
    assert now(desk, "#E100,600") == ACK
    assert status(desk) == "001000"


# --- 6.11 to 6.13: reference run ----------------------------------------------------------------------------------


@shows("ismif-6.11-1", "ismif-6.11-3", "ismif-6.11-5")
def test_reference_with_one_speed_for_all() -> None:
    """Search 400 steps, free run OFF steps, offset 25: each with its own ramp. Y keeps field 2."""
    desk = fresh()
    job(desk, "#E4,900", "#E2,500", "#DX,0,4,4,4")
    x = moved(desk, "$HX")
    assert x.delta[:, 0].tolist() == [-1] * 400 + [1] * (OFF + 25)
    assert gaps(x.t_ns[:400]) == gaps(pulse_times_ns(200_000, v=900)[:400])
    assert gaps(x.t_ns[400 : 400 + OFF]) == gaps(pulse_times_ns(4000, v=900)[:OFF])
    assert gaps(x.t_ns[400 + OFF :]) == gaps(pulse_times_ns(25, v=900))
    y = moved(desk, "$HY")
    assert gaps(y.t_ns[:300]) == gaps(pulse_times_ns(200_000, v=500)[:300])


@shows("ismif-6.11-2")
def test_reference_in_positive_direction_with_three_speeds() -> None:
    desk = fresh()
    desk.carriage[1] = TRAVEL[1] - 500
    job(desk, "#S65", "#R0", "#E1,800", "#E2,100", "#E3,300", "#DY,1,1,2,3")
    y = moved(desk, "$HY")
    assert y.delta[:, 1].tolist() == [1] * 500 + [-1] * (OFF + 25)
    assert gaps(y.t_ns[:500]) == gaps(pulse_times_ns(500, v=800, ramp_ms=0))
    assert gaps(y.t_ns[500 : 500 + OFF]) == gaps(pulse_times_ns(OFF, v=100, ramp_ms=0))
    assert gaps(y.t_ns[500 + OFF :]) == gaps(pulse_times_ns(25, v=300, ramp_ms=0))


def gaps(times: object) -> list[int]:
    """Intervals between pulses: equal for equal motions, whenever they begin."""
    return [int(n) for n in np.diff(np.asarray(times, dtype=np.int64))]


@shows("ismif-6.11-4")
@pytest.mark.parametrize("command", ["#DX,2,1,1,1", "#DX,0,100,1,1", "#DX,0,1,1,100", "#DA,0,1,1,1", "#DX,0,1,1"])
def test_reference_settings_out_of_range(command: str) -> None:
    desk = referenced()
    assert now(desk, command) == ACK
    assert status(desk) == "001000"


@shows("ismif-6.12-1", "ismif-6.12-2", "ismif-6.12-3", "ismif-6.13-3")
def test_offset() -> None:
    desk = fresh()
    job(desk, "#OX,35")
    assert moved(desk, "$HX").delta[:, 0].tolist() == [-1] * 400 + [1] * (OFF + 35)
    assert moved(desk, "$HY").delta[:, 1].tolist() == [-1] * 300 + [1] * (OFF + 25)
    assert desk.counts == (0, 0, 0, 0)
    assert now(desk, "@LX") == "@LX0\r"


@shows("ismif-4-13", "ismif-6.13-1")
@pytest.mark.parametrize(("command", "order"), [("$HZXY", [2, 0, 1]), ("$HYZ", [1, 2]), ("$HX", [0])])
def test_reference_in_the_order_given(command: str, order: list[int]) -> None:
    axes = np.argmax(moved(fresh(), command).delta != 0, axis=1)
    assert axes[np.flatnonzero(np.diff(axes, prepend=-1))].tolist() == order


@shows("ismif-6.13-2")
def test_reference_of_one_axis_leaves_the_others() -> None:
    desk = fresh()
    delta = moved(desk, "$HY").delta
    assert not delta[:, [0, 2]].any()
    assert delta[:, 1].any()


# --- 6.14: vectors ------------------------------------------------------------------------------------------------


@shows("ismif-4-14")
@pytest.mark.parametrize(
    ("speeds", "command", "start", "steps", "v"),
    [
        case("ismif-6.14-1", "#E1,800", "L1,X200,Y500", (50, 60, 70), (150, 440, 0), 800),
        case("ismif-6.14-2", "#E15,700", "L15,x500,y1000", (50, 60, 70), (500, 1000, 0), 700),
        case("ismif-6.14-3", "#E3,450", "L3,X0,Y0,Z0", (500, 400, 300), (-500, -400, -300), 450),
        case("ismif-6.14-4", "#E99,300", "L99,x15,y25,z35", (50, 60, 70), (15, 25, 35), 300),
        case("ismif-6.14-5", "#E1,900", "L1,x-50,y-100", (500, 400, 300), (-50, -100, 0), 900),
        case("ismif-6.14-6", "#E1,600", "L1,X40,y-100,Z0", (500, 400, 300), (-460, -100, -300), 600),
    ],
)
def test_vector(speeds: str, command: str, start: tuple[int, ...], steps: tuple[int, ...], v: int) -> None:
    x, y, z = start
    desk = referenced(speeds, f"L0,X{x},Y{y},Z{z}")
    stream = moved(desk, command)
    assert np.array_equal(stream.delta, line(*steps))
    assert stream.t_ns.tolist() == pulse_times_ns(max(map(abs, steps)), v)
    assert desk.counts[:3] == tuple(a + b for a, b in zip(start, steps, strict=True))


@shows("ismif-6.14-7")
@pytest.mark.parametrize("command", ["L100,x5", "L-1,x5", "L,x5", "L1", "L1,a5", "L1,x", "L1,x5,x6", "L1,x5,X6"])
def test_wrong_vectors_do_nothing(command: str) -> None:
    desk = referenced()
    mark = desk.ticks
    assert job(desk, command) == ACK + DONE
    assert desk.ticks == mark
    assert status(desk) == "001000"


@shows("ismif-6.14-8")
def test_axes_not_named_stand_still() -> None:
    assert moved(referenced(), "L1,z-12").total == (0, 0, -12, 0)


# --- 6.15, 6.17, 6.18: stop with ramp, pause ----------------------------------------------------------------------


@shows("ismif-6.15-1", "ismif-6.15-2", "ismif-6.15-3")
def test_stop_with_ramp() -> None:
    desk = referenced()
    send_job(desk, "L1,X5000", "L1,Y100")
    desk.run(2.0)
    desk.read()
    before = desk.counts[0]
    assert now(desk, "@B") == ACK
    assert desk.finish() == DONE
    x, y, *_ = desk.counts
    assert before < x < 5000
    assert x - before == pytest.approx(stop_distance(600), abs=1)
    assert y == 100
    assert status(desk) == "000000"


@shows("ismif-6.17-1", "ismif-6.17-2", "ismif-6.17-3", "ismif-6.18-1")
def test_pause_and_continue() -> None:
    desk = cruising(referenced(), "L1,X5000,Y1700")
    before = desk.counts[0]
    assert now(desk, "@A") == ACK
    assert status(desk) == "100001"  # on the ramp
    desk.run(0.6)
    assert status(desk) == "000001"
    assert desk.counts[0] - before == pytest.approx(stop_distance(600), abs=1)
    assert now(desk, "@LX") == f"@LX{desk.counts[0]}\r"
    stands, stood_at = desk.ticks, desk.counts
    desk.run(60.0)
    assert desk.ticks == stands
    start_ns = desk.time_ns
    assert now(desk, "@C") == ACK
    assert desk.finish() == DONE
    rest = desk.steps_since(stands)
    assert (rest.t_ns - start_ns).tolist() == pulse_times_ns(5000 - stood_at[0], 600)
    assert desk.counts == (5000, 1700, 0, 0)
    assert desk.counts[0] - stood_at[0] == rest.total[0]


@pytest.mark.parametrize("command", [case("ismif-6.17-4", "@R"), case("ismif-6.17-5", "@S")])
def test_reset_and_stop_lift_the_pause(command: str) -> None:
    desk = cruising(referenced())
    now(desk, "@A")
    desk.run(1.0)
    assert now(desk, command) == ACK
    assert moved(desk, "L1,x50").total == (50, 0, 0, 0)


@shows("ismif-6.18-2")
def test_continue_without_a_pause() -> None:
    still, disturbed = referenced(), referenced()
    send_job(still, "L1,X900")
    send_job(disturbed, "L1,X900")
    still.run(0.5)
    disturbed.run(0.5)
    assert now(disturbed, "@C") == ACK
    still.finish()
    disturbed.finish()
    assert np.array_equal(still.steps.t_ns, disturbed.steps.t_ns)


# --- 6.20: waiting time -------------------------------------------------------------------------------------------


@shows("ismif-6.20-1", "ismif-6.20-2")
def test_waiting_time() -> None:
    desk = referenced()
    assert now(desk, "L1,x10") == ACK
    assert now(desk, "W250") == ACK
    stream = moved(desk, "L1,x10")
    first, second = stream.t_ns[:10], stream.t_ns[10:]
    assert first.tolist() == pulse_times_ns(10, 600)
    assert (second - first[-1] - 250_000_000).tolist() == pulse_times_ns(10, 600)
