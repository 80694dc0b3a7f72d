"""A trace of positions is as smooth as the motion, wherever the samples lie and whatever has happened to the counters.

Each sample is compared with the cubic through its four neighbours, which meets every x(t) to (2 T)^4 / 96 of its fourth
derivative: below 0.05 um for the carriage's swinging on nut and structure if samples are T <= 0.4 ms apart.

    x-2   x-1  [x0]  x+1   x+2        x0 = (4 (x-1 + x+1) - (x-2 + x+2)) / 6
"""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from test_clock import Build, Scripted, build

from isel_twin import Twin
from isel_twin.motion import SetPointRun

__all__ = ["build"]

OFF_UM = 0.2
"""Farthest that a sample may lie off."""
PERIODS_NS = (137_931, 100_000, 250_000, 371_003)
"""Times between samples, ns: at, between and beyond whole sub-steps of 25 us and periods of steps of 100 us."""


def sampled(twin: Twin, period_ns: int, seconds: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Positions and position errors in um, [n, 3] each."""
    position, error = [], []
    for _ in range(round(seconds * 1e9 / period_ns)):
        twin.run_until(twin.time_ns + period_ns)
        position.append(twin.position_mm * 1e3)
        error.append(twin.position_error_mm * 1e3)
    return np.array(position), np.array(error)


def farthest_um(x: NDArray[np.float64]) -> float:
    """Largest distance of a sample from the curve through its neighbours."""
    curve = (4.0 * (x[1:-3] + x[3:-1]) - (x[:-4] + x[4:])) / 6.0
    return float(np.abs(x[2:-2] - curve).max())


def started(plant: str) -> Twin:
    twin = Twin(plant=plant, start_mm=(5.0, 5.0, 5.0))
    for line in ("@07", "@0R7", "@0z1"):
        assert twin.query(line) == "0"
    return twin


@pytest.mark.parametrize("period_ns", PERIODS_NS)
def test_samples_of_a_move_lie_on_a_curve(period_ns: int) -> None:
    """Three axes, the first at 10 kHz; the counters are set anew at an odd time, and it goes on."""
    twin = started("mujoco")
    for _ in range(2):
        twin.write(b"@0A4000,10000,3000,10000,2000,10000,0,30\r")
        twin.run(0.15)
        position, _ = sampled(twin, period_ns, 0.2)
        assert np.ptp(position, axis=0).min() > 2000.0, "it moves"
        assert farthest_um(position) < OFF_UM
        twin.run_until_idle()
        twin.read()
        twin.run_until(twin.time_ns + 12_345)
        assert twin.query("@0N7") == "0"
        assert np.abs(twin.position_mm).max() < 0.02, "zero is here now, but for friction and backlash"


def test_samples_of_a_reference_run_lie_on_a_curve() -> None:
    """Each axis runs on its switch and off again, and its counter is set to 0 at the end: there alone it may jump."""
    twin = Twin(start_mm=(6.0, 5.0, 5.0))
    assert twin.query("@07") == "0"
    twin.write(b"@0R7\r")
    twin.run(0.2)
    machine, shown = [], []
    while not twin.idle:
        twin.run_until(twin.time_ns + 371_003)
        machine.append(twin.machine_position_mm * 1e3)
        shown.append(twin.position_mm * 1e3)
    zero = np.array(machine) - np.array(shown)
    for axis in range(3):
        jumps = np.abs(np.diff(zero[:, axis]))
        assert np.count_nonzero(jumps > 1e-6) == 1, "the zero changes once"


@pytest.mark.parametrize("period_ns", PERIODS_NS)
def test_without_physics_the_carriage_is_at_its_counter(period_ns: int) -> None:
    twin = started("kinematic")
    twin.write(b"@0A4000,10000,3000,10000,2000,10000,0,30\r")
    twin.run(0.1)
    position, error = sampled(twin, period_ns, 0.2)
    assert np.ptp(position, axis=0).min() > 2000.0
    assert np.abs(error).max() < 1e-6


class Swing:
    """Set points of a swing of three axes, 800 increments wide."""

    ticks, axes, identity = 100, 4, "swing"
    place = np.rint(np.outer(400.0 * (1.0 - np.cos(np.arange(101) * (2 * np.pi / 100))), (1, -1, 1, 0)))

    def deltas(self, first: int, last: int) -> NDArray[np.int32]:
        return np.diff(self.place, axis=0)[first:last].astype(np.int32)

    def displacement(self, k: int) -> tuple[int, ...]:
        return tuple(int(n) for n in self.place[k])


@pytest.mark.parametrize("plant", ["mujoco", "kinematic"])
@pytest.mark.parametrize("period_ns", PERIODS_NS)
def test_samples_of_led_set_points_lie_on_a_curve(build: Build, plant: str, period_ns: int) -> None:
    """One every 4 ms: the counter jumps by up to 25 increments there, 0.08 mm, and the carriage is led."""
    controller = Scripted()
    controller.at(1_000_000, lambda: controller.start(SetPointRun(Swing(), 4_000_000, 1_000_000)))  # type: ignore[arg-type]
    twin = build(controller, plant, start_mm=(50.0, 50.0, 30.0))
    twin.run(0.003)
    position, _ = sampled(twin, period_ns, 0.39)
    assert np.ptp(position, axis=0).min() > 2000.0
    assert farthest_um(position) < OFF_UM


@pytest.mark.parametrize("plant", ["kinematic", "mujoco"])
def test_after_an_axis_was_turned_round_the_first_look_may_come_in_motion(plant: str) -> None:
    """`@0ID1` with nobody looking, and a reference run: position and counter go together."""
    twin = Twin(plant=plant, start_mm=(100.0, 50.0, 30.0))
    for line in ("@07", "@0R7", "@0A3200,5000,0,900,0,900,0,900", "@07", "@0ID1"):
        assert twin.query(line) == "0"
    before_mm = twin.machine_position_mm[0]
    twin.write(b"@0R1\r")
    twin.run(0.2037)
    seen_mm, count = twin.position_mm[0], twin.counts[0]
    assert abs(twin.machine_position_mm[0] - before_mm) > 1.0
    assert seen_mm == pytest.approx(count * twin.step_mm[0], abs=0.05)
