"""What it costs to look out for collisions.

Targets: less than a tenth of a run with physics that has a fixture within reach (side by side with the same run without
the sensors), nothing without one; on the kinematic plant a way past a fixture at least 300 times real time.
"""

from __future__ import annotations

import math
import time
from collections.abc import Callable
from typing import Any

import numpy as np
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.machine import Fixture, Machine, load_machine, with_fixtures
from isel_twin.motion import line, trapezoid
from isel_twin.plant.kinematic import KinematicPlant
from isel_twin.plant.model import load_model
from isel_twin.plant.mujoco import MujocoPlant

VISE = (
    Fixture("jaw_left", "box", (100.0, 20.0, 40.0), (200.0, 80.0, 0.0)),
    Fixture("jaw_right", "box", (100.0, 20.0, 40.0), (200.0, 140.0, 0.0)),
    Fixture("base", "box", (140.0, 100.0, 15.0), (200.0, 110.0, 0.0)),
)
START_MM = np.array([160.0, 110.0, 105.0])
"""Between the jaws, the tool 42 mm above the table: 2 mm above them."""
STEPS = 20_000
LAW = trapezoid(STEPS, 10_000, 300, 100_000)
T_NS, SECONDS = LAW.times(0, STEPS), LAW.duration_ns * 1e-9
DELTA = {sign: line((sign * STEPS, sign * STEPS // 20, 0, 0)).deltas(0, STEPS) for sign in (1, -1)}


def there_and_back(plant: Any) -> Callable[[], None]:
    """Each call moves X and Y once, there or back in turn."""
    plant.set_power(stages=True, brake_released=True, lowering=True)
    plant.advance(50_000_000, np.empty(0, dtype=np.int64), np.empty((0, 4), dtype=np.int8))
    sign = -1

    def move() -> None:
        nonlocal sign
        sign = -sign
        start_ns = plant.time_ns
        plant.advance(start_ns + LAW.duration_ns, start_ns + T_NS, DELTA[sign])

    move()
    move()
    return move


def physical(machine: Machine, watched: bool) -> MujocoPlant:
    return MujocoPlant(machine, [], START_MM, model=load_model(machine, visual=False, watched=watched))


def ratio(one: Callable[[], None], other: Callable[[], None], rounds: int = 31) -> float:
    """Quotient of their CPU times, side by side: the least of each, as what other work adds is never negative."""
    least = [math.inf, math.inf]
    for _ in range(rounds):
        for number, work in enumerate((one, other)):
            began = time.process_time()
            work()
            least[number] = min(least[number], time.process_time() - began)
    return least[0] / least[1]


def test_sensors_beside_the_same_vise_without_them(benchmark: BenchmarkFixture) -> None:
    machine = with_fixtures(load_machine("4030"), VISE)
    watched, alone = (there_and_back(physical(machine, is_so)) for is_so in (True, False))
    quotient = ratio(watched, alone)
    benchmark.extra_info["ratio"] = round(quotient, 3)
    benchmark.pedantic(watched, rounds=3)
    print(f"\nwatched / not watched, a vise within reach: {quotient:.3f}, {SECONDS / benchmark.stats['median']:.0f} x")
    assert quotient < 1.10


def test_a_fixture_out_of_reach_costs_nothing(benchmark: BenchmarkFixture) -> None:
    bare = load_machine("4030")
    low = with_fixtures(bare, (Fixture("plate", "box", (300.0, 200.0, 1.0), (200.0, 150.0, 0.0)),))
    clamped, alone = (there_and_back(physical(machine, True)) for machine in (low, bare))
    quotient = ratio(clamped, alone)
    benchmark.extra_info["ratio"] = round(quotient, 3)
    benchmark.pedantic(clamped, rounds=3)
    print(f"\na plate that nothing reaches / no plate: {quotient:.3f}")
    assert quotient < 1.10


def test_without_physics_past_a_vise(benchmark: BenchmarkFixture) -> None:
    move = there_and_back(KinematicPlant(with_fixtures(load_machine("4030"), VISE), [], START_MM))
    benchmark.pedantic(move, rounds=20)
    times = SECONDS / benchmark.stats["min"]
    print(f"\nkinematic, 2 mm above the jaws: {times:.0f} times real time")
    benchmark.extra_info["times real time"] = round(times)
    assert times > 300.0
