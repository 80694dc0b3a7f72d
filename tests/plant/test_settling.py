"""When a servo axis says that it is in position on the kinematic plant: as the law of its loops has it."""

from __future__ import annotations

import dataclasses
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from isel_twin import Twin
from isel_twin.drives.servo_drive import ServoDrive
from isel_twin.machine import load_machine
from isel_twin.plant.settling import Settling

DRIVE = load_machine("4030-servo").axes[0].stage
assert isinstance(DRIVE, ServoDrive)
LEAD_NS = 2_000_000


def trapezoid(speed: float, acceleration: float, length: float) -> NDArray[np.float64]:
    """Set points every 2 ms, in increments."""
    ramp_s, even_s = speed / acceleration, length / speed - speed / acceleration
    t = 2e-3 * np.arange(1, round((2 * ramp_s + even_s) / 2e-3) + 2)
    up = np.clip(t, 0, ramp_s)
    down = np.clip(t - ramp_s - even_s, 0, ramp_s)
    even = np.clip(t - ramp_s, 0, even_s)
    return 0.5 * acceleration * up**2 + speed * even + speed * down - 0.5 * acceleration * down**2


def arrival_s(drive: ServoDrive, places: NDArray[np.float64]) -> float:
    """From the end of the command to the last moment outside the window, by SciPy from the transfer function."""
    from scipy import signal  # half a second, for this file alone

    kv, w_v, kff = drive.position_gain_per_s, drive.speed_bandwidth_rad_s, drive.feed_forward
    t_i = drive.integral_ratio / w_v
    dt = 1e-4
    t = dt * np.arange(round((len(places) * 2e-3 + 1.0) / dt))
    command = np.interp(t, 2e-3 * np.arange(len(places) + 1), np.concatenate([[0.0], places]))
    made = np.polymul([t_i, 1.0], [w_v * kff, w_v * kv])
    _, carriage, _ = signal.lsim((made, [t_i, w_v * t_i, w_v * (1 + kv * t_i), w_v * kv]), command, t)
    outside = np.flatnonzero(np.abs(command - carriage) > drive.window)
    return max(0.0, float(t[outside[-1]]) - len(places) * 2e-3)


def led(settling: Settling, places: NDArray[np.float64], axes: int = 1, start_ns: int = 0) -> int:
    """Give the set points one by one; when the command stands."""
    changes = np.diff(np.round(np.concatenate([[0.0], places]))).astype(np.int64)
    for k, change in enumerate(changes.tolist()):
        row = np.zeros((1, axes), dtype=np.int64)
        row[0, 0] = change
        settling.lead(np.array([start_ns + k * LEAD_NS]), row, LEAD_NS)
    return start_ns + len(changes) * LEAD_NS


@pytest.mark.parametrize(
    ("change", "speed", "acceleration", "length"),
    [
        ({}, 100_000, 1_000_000, 40_000),
        ({}, 20_000, 500_000, 3_000),
        ({"position_gain_per_s": 15.0}, 50_000, 1_000_000, 20_000),
        ({"integral_ratio": 20.0, "window": 3.0}, 100_000, 2_000_000, 40_000),
        ({"feed_forward": 0.7}, 60_000, 1_000_000, 20_000),
    ],
)
def test_it_is_in_position_when_the_law_says_so(
    change: dict[str, Any], speed: float, acceleration: float, length: float
) -> None:
    drive = dataclasses.replace(DRIVE, **change)
    settling = Settling({0: drive})
    places = trapezoid(speed, acceleration, length)
    stands_ns = led(settling, places)
    expected_ns = stands_ns + round((arrival_s(drive, places) + drive.window_time_s) * 1e9)
    assert not settling.in_position(0, expected_ns - 1_500_000)
    assert settling.in_position(0, expected_ns + 1_500_000)


def test_by_hand_a_loop_without_inertia_needs_the_logarithm_of_its_lag() -> None:
    """First order, a ramp at constant speed that ends at once: v / Kv decays to the window in ln(v / (Kv w)) / Kv."""
    drive = dataclasses.replace(DRIVE, speed_bandwidth_rad_s=6000.0, integral_ratio=1e6, window_time_s=0.0)
    settling = Settling({0: drive})
    stands_ns = led(settling, 40.0 * np.arange(1, 400))  # 20 000 / s: a lag of 500, 10 in the window
    expected_ns = stands_ns + round(np.log(500 / 10) / 40.0 * 1e9)
    assert not settling.in_position(0, expected_ns - 2_000_000)
    assert settling.in_position(0, expected_ns + 2_000_000)


def test_an_axis_that_does_not_move_stays_in_position_while_another_settles() -> None:
    settling = Settling({0: DRIVE, 1: DRIVE})
    stands_ns = led(settling, trapezoid(100_000, 1_000_000, 40_000), axes=2, start_ns=50_000_000)
    assert (settling.in_position(0, stands_ns), settling.in_position(1, stands_ns)) == (False, True)


def test_switched_on_it_is_in_position_after_the_time_of_its_window() -> None:
    settling = Settling({0: DRIVE})
    settling.begin(7_000_000)
    assert [settling.in_position(0, 7_000_000 + t) for t in (19_999_999, 20_000_000)] == [False, True]


def test_a_stepper_axis_is_always_in_position() -> None:
    assert Settling({}).in_position(2, 0)


def test_a_saved_one_settles_when_the_other_does() -> None:
    one, other = Settling({0: DRIVE}), Settling({0: DRIVE})
    places = trapezoid(100_000, 1_000_000, 40_000)
    led(one, places[:200])
    other.restore(one.save())
    stands_ns = [led(each, places[200:] - places[199], start_ns=200 * LEAD_NS) for each in (one, other)]
    looks = [stands_ns[0] + t for t in range(0, 200_000_000, 500_000)]
    assert [one.in_position(0, t) for t in looks] == [other.in_position(0, t) for t in looks]
    assert one.in_position(0, looks[-1])
    assert not one.in_position(0, looks[0])


def test_a_program_with_exact_stops_takes_as_long_as_with_physics() -> None:
    """Ten moves of 2 mm, each with an exact stop (G00), on both plants: within 4 %, where nothing but the command would
    be faster by half."""
    program = (
        "P1\nN10 G00 G90 X40 Y30 Z30\n"
        + "".join(f"N{20 + k} G00 X{40 + 2 * (k % 2)}\n" for k in range(10))
        + "N90 M30\n#\n"
    )
    took = []
    for plant in ("kinematic", "mujoco"):
        twin = Twin(controller="bwo900", machine="4030-servo", start_mm=(30.0, 30.0, 30.0), plant=plant)
        parts = [b"".join(data) for _, data in twin.language.job(program)]
        for data in parts[:-1]:
            twin.write(data)
            twin.run_until_idle()
        begin_ns = twin.time_ns
        twin.write(parts[-1])
        twin.run_until_idle()
        took.append((twin.time_ns - begin_ns) / 1e9)
    assert took[0] == pytest.approx(took[1], rel=0.04)
