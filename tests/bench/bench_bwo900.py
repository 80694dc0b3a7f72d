"""The BWO 900: blocks read and planned in a second, at full speed through 0.1 mm pieces, memory of a long program.

Ten thousand blocks a second are a hundred metres a minute in pieces of 0.1 mm and more than the control itself reads
(block cycle time 1.5 ms and less). Plain blocks on the short way take at most a sixth of the general one; an exact
stop takes four looks at the drives.
"""

from __future__ import annotations

import math
import statistics
import tracemalloc
from collections.abc import Sequence
from itertools import chain
from time import process_time

import numpy as np
import pytest
from firmware.bwo900.run import programs
from firmware.bwo900.test_left_out import counted, each_look_made, ready
from firmware.bwo900.test_plain import general_way
from pytest_benchmark.fixture import BenchmarkFixture

from isel_twin.firmware.bwo900.analysis.interpreter import Interpreter
from isel_twin.firmware.bwo900.geometry.blocks import PathBlock
from isel_twin.firmware.bwo900.memory import Memory
from isel_twin.firmware.bwo900.parameters import Parameters
from isel_twin.firmware.bwo900.programs.stored import Store, StoredProgram
from isel_twin.firmware.bwo900.realtime.ahead import Filter, filters, run
from isel_twin.firmware.bwo900.realtime.path import MotionLimits, PieceMaker
from isel_twin.motion.joined import joined
from isel_twin.testing import Desk

BLOCKS = 20_000
AT_ONCE = 200
"""Blocks of a part that is analysed, planned and appended together."""


def wave(count: int, first: int = 2) -> list[str]:
    """A circle of radius 50 mm in pieces of 0.1 mm, as blocks."""
    turn = [(first + n) / 500.0 for n in range(count)]
    return [f"N{first + n} X{50 * math.cos(t):.3f} Y{50 * math.sin(t):.3f}" for n, t in enumerate(turn)]


def analysed(interpreter: Interpreter, stages: Sequence[Filter]) -> list[PathBlock]:
    """The next blocks, through filters, as `Ahead.fill` takes them; none at the end of the program."""
    blocks: list[PathBlock] = []
    while len(blocks) < AT_ONCE:
        if plain := run(interpreter, stages, AT_ONCE - len(blocks)):
            blocks += plain
            continue
        if not isinstance(block := interpreter.next(), PathBlock):
            break
        made = [block]
        for stage in stages:
            made = [out for one in made for out in stage.push(one)]
        blocks += made
    return blocks


def plan(count: int) -> float:
    """Analyse and plan so many blocks, part by part; processor seconds."""
    store = programs("\n".join(["P1", "N1 G1 F6000 X50 Y0", *wave(count), "N9999999 M30"]))
    parameters = Parameters()
    began = process_time()
    interpreter = Interpreter(parameters, store)
    interpreter.begin("P1", (50.0, 0.0, 0.0))
    path, passed = PieceMaker(MotionLimits.of(parameters, [1000.0] * 3), (50.0, 0.0, 0.0)), filters(parameters)
    made, tick = None, 0
    while blocks := analysed(interpreter, passed):
        pieces, _ = path.pieces(blocks)
        if not len(pieces):
            continue
        if made is None:
            made = joined(pieces, 2_000_000)
        else:
            tick = max(tick, made.passed(max(made.pieces - AT_ONCE, 0)))
            made = made.replanned(tick, append=pieces)
    return process_time() - began


@pytest.mark.benchmark(group="bwo900")
def test_ten_thousand_blocks_a_second(benchmark: BenchmarkFixture) -> None:
    """Read, analysed, corrected, planned and appended, on one core."""
    plan(500)
    seconds = benchmark.pedantic(plan, (BLOCKS,), rounds=3)
    benchmark.extra_info["blocks_per_s"] = BLOCKS / seconds
    assert BLOCKS / benchmark.stats.stats.min > 10_000


@pytest.mark.benchmark(group="bwo900")
def test_plain_blocks_beside_the_general_way(benchmark: BenchmarkFixture) -> None:
    """The same blocks on the short way and on that of all blocks, in turn, in CPU time."""

    def general() -> float:
        with general_way():
            return plan(BLOCKS // 4)

    plan(500)
    turns = [(general(), plan(BLOCKS // 4)) for _ in range(4)]
    benchmark.pedantic(lambda: turns.append((general(), plan(BLOCKS // 4))), rounds=1)
    times = statistics.median(slow / fast for slow, fast in turns)
    benchmark.extra_info["general way, times the short one"] = times
    assert times >= 6.0


@pytest.mark.benchmark(group="bwo900")
def test_looks_of_an_exact_stop(benchmark: BenchmarkFixture) -> None:
    """A program of forty exact stops without physics, looks at the drives left out and each made, in turn, in CPU time;
    how often the controller looks at a stop."""
    twin = ready("kinematic", [f"G00 X{12 + n % 2} Y{13 + n % 3}" for n in range(40)])
    state = twin.save()

    def drive() -> tuple[float, int]:
        twin.restore(state)
        began = process_time()
        with counted() as looks:
            twin.run_until_idle()
        return process_time() - began, len(looks)

    def each_made() -> tuple[float, int]:
        with each_look_made():
            return drive()

    drive()
    turns = [(each_made(), drive()) for _ in range(4)]
    benchmark.pedantic(lambda: turns.append((each_made(), drive())), rounds=1)
    benchmark.extra_info["looks a stop, each made"] = turns[0][0][1] / 40
    benchmark.extra_info["looks a stop"] = turns[0][1][1] / 40
    share = statistics.median(few[0] / all_looks[0] for all_looks, few in turns)
    benchmark.extra_info["CPU time over that with each look made"] = share
    assert turns[0][1][1] <= 4 * 40
    assert share <= 0.5


@pytest.mark.benchmark(group="bwo900")
def test_short_pieces_are_run_at_full_speed(benchmark: BenchmarkFixture) -> None:
    """0.1 mm a block at 6000 mm/min: the whole control on the desk, as fast as a line of any length."""

    def lead() -> float:
        desk = Desk.of("bwo900", carriage=(20_000, 20_000, 20_000))
        text = ["", "P1", "N1 G1 F6000 X100 Y50", *(f"{b} " for b in shifted(3_000)), "N9999999 M30", "#"]
        desk.send("\r\n".join(text).encode() + b"\r\n\x04\r\n")
        start = ["K1:P8683: 1", *(f"K1:P{12_130 + 200 * a}: 1" for a in range(3))]
        desk.send(("\r\nD\r\n" + "\r\n".join(start) + "\r\n#\r\n\x04\r\n").encode())
        desk.finish()
        first = desk.ticks
        desk.send(b"\r\nD\r\nK1:P8800: 1\r\nK1:P8683: 2\r\nK1:P8684: 1\r\n#\r\n\x04\r\n")
        desk.finish()
        ways = np.hypot(*(desk.steps_since(first).delta[:, :2].T / 1000.0))
        return float(np.median(ways) / 0.002 * 60.0)

    assert benchmark.pedantic(lead, rounds=1) == pytest.approx(6_000.0, rel=0.01)


def shifted(count: int) -> list[str]:
    """The circle about (50, 50)."""
    turn = [n / 500.0 for n in range(count)]
    return [f"N{n + 2} X{50 + 50 * math.cos(t):.3f} Y{50 + 50 * math.sin(t):.3f}" for n, t in enumerate(turn)]


@pytest.mark.benchmark(group="bwo900")
def test_memory_of_a_long_program(benchmark: BenchmarkFixture) -> None:
    """A program is kept as its text: bytes in memory by bytes of the file, of 10 MB; analysis adds nothing lasting."""
    lines = 150_000
    text = (f"N{n + 1} X{n % 977 / 10:.3f} Y{n % 499 / 10:.3f}" for n in range(lines))
    size = sum(len(f"N{n + 1} X{n % 977 / 10:.3f} Y{n % 499 / 10:.3f}") + 2 for n in range(lines))
    tracemalloc.start()
    program = benchmark.pedantic(lambda: StoredProgram.of("P1", chain(["F1000"], text)), rounds=1)
    kept = tracemalloc.get_traced_memory()[0]
    interpreter = Interpreter(Parameters(), Store({"P1": program}))
    interpreter.begin("P1", (0.0, 0.0, 0.0))
    for _ in range(20_000):
        interpreter.next()
    grown = tracemalloc.get_traced_memory()[0] - kept
    tracemalloc.stop()
    benchmark.extra_info["bytes_per_byte"] = kept / size
    assert kept / size < 8.0
    assert grown < 8e6


@pytest.mark.benchmark(group="bwo900")
def test_the_flash_image_after_a_key(benchmark: BenchmarkFixture) -> None:
    """With programs of 10 MB: what has been compressed stays so."""
    text = (f"N{n + 1} X{n % 977 / 10:.3f} Y{n % 499 / 10:.3f}" for n in range(500_000))
    parameters = Parameters()
    memory = Memory(parameters, Store({"P1": StoredProgram.of("P1", text)}))
    memory.image()

    def press() -> None:
        parameters.write(8_684, 1.0)
        memory.image()

    benchmark.pedantic(press, rounds=5)
    assert benchmark.stats.stats.min < 0.02
