"""The main job, end to end: a host's commands drive the physical gantry through the emulated iMC-S8.

Each test is a session as a host would send it (stimulus) and what the machine must have done (verdict).
"""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest

from isel_twin import Twin
from isel_twin.core.state import TwinState

STEPS_PER_MM = 320
HOME = ("@07", "@0R7")


def homing(**options: object) -> Twin:
    twin = Twin(**options)  # type: ignore[arg-type]
    assert [twin.query(command) for command in HOME] == ["0", "0"]
    return twin


@cache
def at_home(**options: object) -> TwinState:
    return homing(**options).save()


def homed(**options: object) -> Twin:
    """Behind the reference run, which is made once for all tests with these options."""
    twin = Twin(**options)  # type: ignore[arg-type]
    twin.restore(at_home(**options))
    return twin


def test_first_session_from_power_on_to_a_true_position() -> None:
    twin = Twin()
    assert twin.query("@07") == "0"
    assert twin.query("@0M16000,10000,8000,10000,0,10000,0,30") == "R"
    assert twin.query("@0R7") == "0"
    assert twin.query("@0P") == "0" + 18 * "0"
    assert twin.query("@0M16000,10000,8000,10000,0,10000,0,30") == "0"
    assert twin.query("@0P") == "0003E80001F40000000"
    twin.run(1.0)
    np.testing.assert_allclose(twin.position_mm, [50.0, 25.0, 0.0], atol=0.03)
    np.testing.assert_array_equal(twin.counts, [16000, 8000, 0, 0])
    assert np.abs(twin.lost_steps).max() < 1.0


def test_power_on_positions_are_random_and_the_found_zero_is_the_switch() -> None:
    starts, zeros = [], []
    for seed in range(4):
        twin = Twin(seed=seed)
        starts.append(twin.machine_position_mm)
        assert [twin.query(command) for command in HOME] == ["0", "0"]
        twin.run(1.0)
        zeros.append(twin.machine_position_mm)
    assert np.ptp(starts, axis=0).min() > 1.0
    repeatability_mm = max(switch.repeatability_mm for switch in twin.machine.switches)
    assert np.ptp(zeros, axis=0).max() < 6 * repeatability_mm + 1 / STEPS_PER_MM
    for axis, zero in zip(twin.machine.axes, np.mean(zeros, axis=0), strict=True):
        hysteresis_mm = next(s.hysteresis_mm for s in twin.machine.switches if s.axis == axis.name)
        assert 0 < zero < hysteresis_mm + 1.0, "the zero lies just off the motor-end switch"


def test_the_found_zero_repeats_within_the_repeatability_of_the_switch() -> None:
    twin = homed()
    zeros = []
    for _ in range(5):
        assert twin.query("@0A3200,5000,3200,5000,3200,5000,0,30") == "0"
        assert twin.query("@0R7") == "0"
        twin.run(0.5)
        zeros.append(twin.machine_position_mm)
    repeatability_mm = max(switch.repeatability_mm for switch in twin.machine.switches)
    assert np.ptp(zeros, axis=0).max() < 6 * repeatability_mm + 1 / STEPS_PER_MM


@pytest.mark.parametrize("plant", ["mujoco", "kinematic"])
def test_stop_byte_ramps_down_and_start_makes_exactly_the_rest(plant: str) -> None:
    twin = homed(plant=plant)
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    twin.run(1.0)
    twin.write(b"\xfd")
    twin.run(1.0)
    assert twin.read() == b"F"
    reply = twin.query("@0P")
    standing = int(reply[1:7], 16)
    assert 0 < standing < 32000
    assert standing == twin.counts[0]
    assert twin.query("@0S") == "0"
    assert twin.counts[0] == 32000
    assert np.abs(twin.lost_steps).max() < 1.0


def test_stop_ramp_falls_at_the_acceleration_to_the_start_stop_frequency() -> None:
    twin = homed(plant="kinematic")
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    start_ns = twin.time_ns
    twin.run(1.0)
    stop_ns = twin.time_ns
    twin.write(b"\xfd")
    twin.run(1.0)
    t_ns = twin.steps.t_ns
    after = t_ns[t_ns > stop_ns]
    # From 10 kHz at 100 Hz/ms to 300 Hz: 97 ms and (10000^2 - 300^2) / (2 * 100000) = 499.55 steps.
    assert after[-1] - stop_ns == pytest.approx(97e6, abs=4e6)
    assert len(after) in (499, 500)
    periods = np.diff(after)
    assert (np.diff(periods) > -2).all(), "periods only grow on a stop ramp"
    assert start_ns < stop_ns


def test_break_forgets_the_rest() -> None:
    twin = homed(plant="kinematic")
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    twin.run(1.0)
    twin.write(b"\xff")
    twin.run(1.0)
    twin.read()
    standing = twin.counts[0]
    assert 0 < standing < 32000
    assert twin.query("@0S") == "G"
    assert twin.counts[0] == standing


def test_reset_is_as_power_on_and_at_once() -> None:
    twin = homed(plant="kinematic")
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    twin.run(1.0)
    twin.write(b"\xfe")
    ticks = len(twin.steps.t_ns)
    twin.run(1.0)
    assert len(twin.steps.t_ns) == ticks
    assert twin.read() == b""
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "4"
    assert twin.query("@07") == "0"
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "R"


def test_running_past_the_far_switch_ends_at_its_edge_and_needs_a_reference_run() -> None:
    twin = homed()
    too_far = round(twin.machine.axes[0].travel_mm * STEPS_PER_MM) + 3200
    assert twin.query(f"@0A{too_far},10000,0,30,0,30,0,30") == "2"
    assert twin.counts[0] < too_far
    assert twin.steps.t_ns[-1] <= twin.time_ns
    switch = next(s for s in twin.machine.switches if s.name == "limit_x2")
    assert twin.machine_position_mm[0] >= switch.position_mm - 0.1
    assert twin.query("@0A-100,1000,0,30,0,30,0,30") in ("2", "R")
    assert twin.query("@07") == "0"
    assert twin.query("@0A-100,1000,0,30,0,30,0,30") == "R"
    assert twin.query("@0R7") == "0"
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "0"


def session(seed: int) -> tuple[bytes, bytes, bytes]:
    twin = homing(seed=seed)
    twin.query("@0M8000,10000,4000,10000,1600,5000,0,30")
    twin.run(0.123)
    return twin.steps.t_ns.tobytes(), twin.steps.delta.tobytes(), twin.position_mm.tobytes()


def test_same_seed_same_bits_another_seed_differs() -> None:
    assert session(7) == session(7)
    assert session(7) != session(8)


def test_how_time_is_cut_changes_no_bit() -> None:
    def job(slices: int) -> tuple[bytes, bytes]:
        twin = homed(seed=3)
        twin.write(b"@0M8000,10000,4000,10000,1600,5000,0,30\r")
        for _ in range(slices):
            twin.run(3.0 / slices)
        return twin.steps.t_ns.tobytes(), twin.position_mm.tobytes()

    assert job(1) == job(7) == job(300)


def test_a_speed_the_motor_cannot_follow_loses_steps_that_the_counter_does_not_know_of() -> None:
    twin = homed()
    assert twin.query("@0A64000,40000,0,30,0,30,0,30") == "0"
    twin.run(1.0)
    assert twin.counts[0] == 64000
    assert twin.lost_steps[0] > 32
    assert abs(twin.position_mm[0] - 200.0) > 1.0
    assert np.abs(twin.lost_steps[1:3]).max() < 1.0


def test_a_reference_run_finds_the_position_again_and_the_loss_is_not_forgotten() -> None:
    twin = homed()
    assert not twin.forgotten_steps.any()
    assert twin.query("@0A64000,40000,0,30,0,30,0,30") == "0"
    twin.run(1.0)
    lost = twin.lost_steps[0]
    assert twin.query("@0R7") == "0"
    twin.run(1.0)
    assert abs(twin.lost_steps[0]) < 1.0
    assert abs(twin.position_mm[0]) < 0.03
    assert twin.forgotten_steps[0] == pytest.approx(lost, abs=1.0)
    assert twin.forgotten_steps[0] % twin.slip_steps[0] == 0
    assert twin.slip_steps[0] == 4 * 1600 / 200, "four full steps at 1600 steps a revolution"


def test_kinematic_plant_follows_exactly() -> None:
    twin = homed(plant="kinematic")
    assert twin.query("@0A64000,40000,0,30,0,30,0,30") == "0"
    np.testing.assert_allclose(twin.position_mm, [200.0, 0.0, 0.0], atol=1e-9)
    np.testing.assert_array_equal(twin.lost_steps, np.zeros(4))


@pytest.mark.parametrize("plant", ["mujoco", "kinematic"])
def test_emergency_stop_in_a_motion(plant: str) -> None:
    twin = homed(plant=plant)
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    twin.run(1.0)
    twin.set_input("estop", "pressed")
    ticks = len(twin.steps.t_ns)
    twin.run(1.0)
    assert twin.read() == b"9"
    assert len(twin.steps.t_ns) == ticks
    assert twin.outputs["power"] == 0
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "9"
    twin.set_input("estop", "released")
    assert twin.query("@07") == "0"
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "R"
    assert twin.query("@0R7") == "0"
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "0"


def test_hood_open_at_rest_refuses_motion_and_closing_it_allows_it() -> None:
    twin = homed(plant="kinematic")
    twin.set_input("hood", "open")
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "H"
    twin.set_input("hood", "closed")
    assert twin.query("@0A100,1000,0,30,0,30,0,30") == "0"


def test_a_broken_switch_wire_stops_a_motion_like_the_switch() -> None:
    twin = homed(plant="kinematic")
    twin.write(b"@0A32000,10000,0,30,0,30,0,30\r")
    twin.run(1.0)
    twin.set_input("limit_x2", "broken")
    twin.run(0.1)
    assert twin.read() == b"2"


def test_timed_line_delays_bytes_and_replies() -> None:
    twin = Twin(plant="kinematic", line_speed=True)
    assert twin.query("@07") == "0"
    # Four bytes out and one back at 19200 baud, ten bits each.
    assert twin.time_ns == pytest.approx(5 * 10 / 19200 * 1e9, abs=5)


def test_query_that_never_ends_times_out_in_virtual_time() -> None:
    twin = homed(plant="kinematic")
    twin.write(b"@0A8000000,30,0,30,0,30,0,30\r")
    with pytest.raises(TimeoutError, match=r"no complete reply to '@0P' within 1 s"):
        twin.query("@0P", timeout_s=1.0)
