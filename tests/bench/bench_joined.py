"""Joined motion: pieces planned in a second, at once and as they arrive; set points in a second; the memory of a day.

A controller that reads 10 000 blocks a second has 100 us for each on one core, reading included; set points leave it
every few milliseconds, so a million a second is a thousand times real time and more.
"""

from __future__ import annotations

import pickle
import tracemalloc

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.firmware.gmi99 import planner
from isel_twin.motion.joined import Joined, joined
from isel_twin.motion.pieces import Pieces, piece

PIECES = 100_000
PERIOD_NS = 1_000_000
WINDOW = 1 << 15


def short_pieces(count: int, axes: int = 3) -> Pieces:
    """A wavy path in pieces of 0.1 mm at 10 000 increments a mm: 12 m/min, 2/3 m/s^2, corners mostly flat."""
    turn = np.cumsum(np.random.default_rng(14).normal(0.0, 0.02, count))
    way = np.zeros((count, axes))
    way[:, 0], way[:, 1] = np.rint(1000 * np.cos(turn)), np.rint(1000 * np.sin(turn))
    bend = np.abs(np.diff(turn, prepend=turn[0]))
    return Pieces(
        way,
        np.hypot(way[:, 0], way[:, 1]),
        np.full(count, 2e6),
        np.full(count, 2e6),
        np.full(count, 6.7e6),
        2e4 / np.maximum(bend, 1e-9),
    )


def part(pieces: Pieces, first: int, last: int) -> Pieces:
    columns = (pieces.length, pieces.speed, pieces.limit, pieces.acceleration, pieces.entry)
    return Pieces(pieces.displacement[first:last], *(column[first:last] for column in columns))


def note(benchmark: BenchmarkFixture, name: str, count: float) -> None:
    if benchmark.stats is not None:
        benchmark.extra_info[name] = count / benchmark.stats.stats.median


@pytest.mark.benchmark(group="joined motion")
def test_plan_at_once(benchmark: BenchmarkFixture) -> None:
    pieces = short_pieces(PIECES)
    assert benchmark(joined, pieces, PERIOD_NS).pieces == PIECES
    note(benchmark, "pieces_per_s", PIECES)


@pytest.mark.benchmark(group="joined motion")
@pytest.mark.parametrize("size", [1, 10, 100])
def test_pieces_as_they_arrive(benchmark: BenchmarkFixture, size: int) -> None:
    """While it moves, to a chain that is already long, as a controller that reads ahead hands them over."""
    count = 1000 * size if size < 100 else 20_000
    pieces = short_pieces(PIECES + count)
    long = joined(part(pieces, 0, PIECES), PERIOD_NS)
    parts = [part(pieces, j, j + size) for j in range(PIECES, PIECES + count, size)]

    def arrive() -> Joined:
        plan = long
        for k, more in enumerate(parts):
            plan = plan.replanned(k, append=more)
        return plan

    assert benchmark.pedantic(arrive, rounds=3, iterations=1, warmup_rounds=1).pieces == PIECES + count
    note(benchmark, "pieces_per_s", count)


@pytest.mark.benchmark(group="joined motion")
def test_moves_of_the_gmi99(benchmark: BenchmarkFixture) -> None:
    """From the numbers of a command to a joined piece, a corner at each."""
    rules = planner.Rules(speed_hz=(50_000,) * 7)
    ways = [(300 + k % 7, 100 - k % 11, k % 3, 0, 0, 0) for k in range(200)]

    def arrive() -> Joined:
        move = planner.line(ways[0], 10_000, rules)
        plan, last = planner.start([move], rules), move.last
        for k, way in enumerate(ways[1:]):
            move = planner.line(way, 10_000, rules)
            plan, last = planner.more(plan, k, [move], rules, last), move.last
        return plan

    assert benchmark.pedantic(arrive, rounds=5, iterations=1, warmup_rounds=1).pieces == len(ways)
    note(benchmark, "moves_per_s", len(ways))


@pytest.mark.benchmark(group="joined motion, set points")
@pytest.mark.parametrize("sine", [False, True], ids=["linear", "sin2"])
@pytest.mark.parametrize("axes", [3, 6])
def test_set_points_of_short_pieces(benchmark: BenchmarkFixture, axes: int, sine: bool) -> None:
    plan = joined(short_pieces(PIECES, axes), PERIOD_NS, sine=sine)

    def windows() -> int:
        return sum(len(plan.deltas(k, min(k + WINDOW, plan.ticks))) for k in range(0, plan.ticks, WINDOW))

    assert benchmark(windows) == plan.ticks
    note(benchmark, "set_points_per_s", plan.ticks)


@pytest.mark.benchmark(group="joined motion, set points")
def test_one_set_point_of_a_long_chain(benchmark: BenchmarkFixture) -> None:
    plan = joined(short_pieces(PIECES), PERIOD_NS)
    benchmark(plan.displacement, plan.ticks // 3)


@pytest.mark.benchmark(group="joined motion, a day")
def test_a_day_of_set_points(benchmark: BenchmarkFixture) -> None:
    """86 400 s at 4 ms: 2 x 10^7 set points, every one looked at once, in windows; the memory is that of a window."""
    plan = joined(piece((25_000_000.0, 7.0, 0.0), 25_000_000, 25_000_000 / 86_400, 50_000), 4_000_000)
    assert plan.ticks > 21_600_000

    def day() -> int:
        return sum(int(plan.deltas(k, min(k + WINDOW, plan.ticks))[:, 0].sum()) for k in range(0, plan.ticks, WINDOW))

    tracemalloc.start()
    assert benchmark.pedantic(day, rounds=1, iterations=1) == 25_000_000
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    note(benchmark, "set_points_per_s", plan.ticks)
    benchmark.extra_info["bytes_described"] = len(pickle.dumps(plan))
    benchmark.extra_info["peak_bytes_of_looking"] = peak
    assert len(pickle.dumps(plan)) < 4000
